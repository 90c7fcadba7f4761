"""What happened in a simulation, step by step, and its summary for report.json."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate.model import Model
from palpate.results.measures import signed_volumes
from palpate.simulation import Simulation, StepReport

#: Nodes slower than this [m/s] are at rest.
REST_SPEED = 0.01

#: What is kept of every step's report.
_SERIES = (
    "time",
    "contacts",
    "self_contacts",
    "proximity_pairs",
    "penetrating_nodes",
    "max_depth",
    "newton_iterations",
    "iterations",
    "residual",
    "substeps",
)


class Record:
    """Collects steps; `summary` is plain JSON types."""

    def __init__(self, simulation: Simulation) -> None:
        self._model: Model = simulation.model
        self._rest: dict[str, float] = {}
        self._times: dict[str, list[float]] = {}
        self._stages: dict[str, list[float]] = {}
        self._steps: dict[str, list[Any]] = {name: [] for name in _SERIES}
        self._energies: dict[str, list[float]] = {}
        self._measure_rest()
        self._volumes: dict[str, list[float]] = {
            body.name: [] for body in self._model.bodies if _soft_solid(body)
        }
        self._inverted = dict.fromkeys(self._volumes, 0)
        self._speeds: dict[str, float] = {}
        self.observe(simulation)

    def _measure_rest(self) -> None:
        for body in self._model.bodies:
            volumes = signed_volumes(body.mesh.nodes, body.mesh.tetrahedra)
            self._rest[body.name] = float(volumes.sum())

    def __len__(self) -> int:
        return len(self._steps["time"])

    def add(self, report: StepReport, simulation: Simulation) -> None:
        """Keep one step."""
        for name in _SERIES:
            self._steps[name].append(getattr(report, name))
        for stage, seconds in report.times.items():
            self._times.setdefault(stage, []).append(seconds)
        for stage, seconds in report.stages.items():
            self._stages.setdefault(stage, []).append(seconds)
        for kind, joules in simulation.energy().items():
            self._energies.setdefault(kind, []).append(joules)

    def observe(self, simulation: Simulation) -> None:
        """Measure volumes, inverted tetrahedra and speeds of the present state."""
        if simulation.model is not self._model:  # it was cut
            self._model = simulation.model
            self._measure_rest()
        for index, body in enumerate(self._model.bodies):
            if body.rigid is not None:
                continue
            velocities = simulation.velocities[index]
            self._speeds[body.name] = float(np.sqrt((velocities**2).sum(axis=1).max()))
            if body.name in self._volumes:
                volumes = signed_volumes(simulation.positions[index], body.mesh.tetrahedra)
                change = float(volumes.sum()) / self._rest[body.name] - 1
                self._volumes[body.name].append(100 * change)
                self._inverted[body.name] = int((volumes <= 0).sum())

    @property
    def last(self) -> dict[str, Any]:
        """The kept values of the last step."""
        return {name: values[-1] for name, values in self._steps.items() if values}

    def summary(self) -> dict[str, Any]:
        """Times per stage, steps, bodies, and whether everything is at rest."""
        total = sum(self._times.get("total", []))
        speed = max(self._speeds.values(), default=0.0)
        return {
            "step_count": len(self),
            "steps_per_second": len(self) / total if total > 0 else None,
            "times": {stage: spread(values) for stage, values in self._times.items()},
            "stages": {
                stage: {**spread(values), "sum": sum(values)}
                for stage, values in self._stages.items()
            },
            "bodies": [
                {
                    "name": name,
                    "volume_change_percent": values[-1],
                    "volume_change_percent_min": min(values),
                    "volume_change_percent_max": max(values),
                    "inverted_tetrahedra": self._inverted[name],
                    "final_speed": self._speeds[name],
                }
                for name, values in self._volumes.items()
            ],
            "max_depth": max(self._steps["max_depth"], default=0.0),
            "final_speed": speed,
            "rest_speed": REST_SPEED,
            "at_rest": speed < REST_SPEED,
            "steps": self._steps,
            "energies": self._energies,
        }


def spread(values: Sequence[float]) -> dict[str, float]:
    """Median, extremes and the 90th percentile."""
    low, median, ninety, high = np.percentile(values, [0, 50, 90, 100]).tolist()
    return {"median": median, "min": low, "max": high, "p90": ninety}


def _soft_solid(body: Any) -> bool:
    return body.rigid is None and len(body.mesh.tetrahedra) > 0
