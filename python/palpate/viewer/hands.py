"""What the pages do to the tissue: grips that pull at it, and a probe that pushes."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.mesh import Mesh
from palpate.model import Body, Contact, Model
from palpate.simulation import Simulation
from palpate.viewer.editing import remade
from palpate.viewer.grip import Grip, patch
from palpate.viewer.probe import NAME, aim, probe_mesh
from palpate.viewer.protocol import Command
from palpate.viewer.surface import Surfaces

#: Fastest motion of the probe, in lengths of the scene per second.
_PROBE_SPEED = 0.8
#: Length of a spring at its full force, in lengths of the scene.
_REACH = 0.1
#: Where the probe waits, in lengths of the scene above it.
_AWAY = 1.5


class Hands:
    """Grips by page and number, and at most one probe, which all pages share."""

    def __init__(self, simulation: Simulation) -> None:
        self._grips: dict[tuple[int, int], Grip] = {}
        self._tip = self._target = np.zeros(3)
        self._direction = np.array([0.0, 0.0, -1.0])
        #: How the probe's mesh stands in the model: rotation and tip.
        self._placed = (np.eye(3), np.zeros(3))
        self._radius = 0.0
        self._owner: int | None = None
        soft = [
            points
            for body, points in zip(simulation.model.bodies, simulation.positions, strict=True)
            if body.rigid is None
        ]
        cloud = np.concatenate(soft or list(simulation.positions))
        self._scale = float(np.linalg.norm(np.ptp(cloud, axis=0))) or 1.0
        self.attach(simulation)

    def attach(self, simulation: Simulation) -> None:
        """Work on another simulation; grips of the last one must have been let go."""
        self._simulation = simulation
        self._tool: Any = None
        if self.has_tool:
            self._tool = simulation.tool(NAME)

    @property
    def has_tool(self) -> bool:
        """Whether the model has the probe already."""
        return any(body.name == NAME for body in self._simulation.model.bodies)

    def take_probe(self, command: Command) -> None:
        """Hold the probe where the command puts it; `with_probe` makes it a body."""
        self._tip = self._target = np.array(command["tip"])
        self._direction = np.array(command["direction"])
        self._radius = command["radius"]

    def with_probe(self, model: Model) -> Model:
        """The model with the probe, if it is held, as its last body and where it is now."""
        bodies = [body for body in model.bodies if body.name != NAME]
        if self._radius == 0:
            return model
        rotation = aim(self._direction)
        self._placed = (rotation, self._tip)
        probe = probe_mesh(self._radius, length=0.6 * self._scale)
        body = Body(
            Mesh(probe.nodes @ rotation.T + self._tip, triangles=probe.triangles),
            name=NAME,
            rigid=(),
            contact=Contact(self_contact=False),
            color=(0.62, 0.66, 0.72),
        )
        return remade(model, [*bodies, body])

    def obey(self, command: Command, client: int, surfaces: Surfaces) -> None:
        """Carry out grab, drag, release, tool or tool_away."""
        kind = command["type"]
        if kind == "grab":
            self._grab(command, client, surfaces)
        elif kind == "tool":
            self._owner = client
            self._target = np.array(command["tip"])
            self._direction = np.array(command["direction"])
        elif kind == "tool_away":
            self._put_away()
        else:
            grip = self._grips.get((client, command["grip"]))
            if grip is None:
                return
            if kind == "drag":
                grip.drag(np.array(command["target"]))
            else:
                self._grips.pop((client, command["grip"])).release()

    def move(self, seconds: float) -> None:
        """Move grips and probe towards where they are wanted, no faster than contact can follow."""
        positions = self._simulation.positions if self._grips else ()
        for grip in self._grips.values():
            grip.move(positions)
        if self._tool is None:
            return
        way = self._target - self._tip
        length = float(np.linalg.norm(way))
        most = _PROBE_SPEED * self._scale * seconds
        self._tip = self._target if length <= most else self._tip + way * (most / length)
        rotation, tip = self._placed
        turn = aim(self._direction) @ rotation.T
        self._tool.set_pose(turn, self._tip - turn @ tip)

    def leave(self, client: int) -> None:
        """Release what a page held."""
        for key in [key for key in self._grips if key[0] == client]:
            self._grips.pop(key).release()
        if self._owner == client:
            self._put_away()

    def let_go(self) -> None:
        """Release everything."""
        for grip in self._grips.values():
            grip.release()
        self._grips.clear()

    def forget_released(self) -> None:
        """Drop grips whose node a cut has taken away."""
        self._grips = {key: grip for key, grip in self._grips.items() if grip.holds}

    def shown(self) -> dict[str, Any]:
        """Pulls and probe for the header of a frame."""
        tool = None
        if self._tool is not None and self._owner is not None:
            tool = {"tip": self._tip.tolist(), "force": np.asarray(self._tool.force).tolist()}
        return {
            "pulls": [grip.shown(self._simulation) for grip in self._grips.values() if grip.holds],
            "tool": tool,
        }

    def _grab(self, command: Command, client: int, surfaces: Surfaces) -> None:
        self.obey({"type": "release", "grip": command["grip"]}, client, surfaces)
        index = command["body"]
        if index >= len(surfaces.nodes) or command["node"] >= len(surfaces.nodes[index]):
            raise ValueError(f"there is no node {command['node']} on body {index}")
        body = self._simulation.model.bodies[index]
        if body.rigid is not None:
            raise ValueError(f"{body.name} is rigid and cannot be pulled")
        node = int(surfaces.nodes[index][command["node"]])
        reach = _REACH * self._scale
        stiffness = command["strength"] * _natural_force(body) / reach
        positions = self._simulation.positions[index]
        nodes, shares = patch(body, positions, node, command["radius"] or 0.0)
        target = np.array(command["target"])
        self._grips[client, command["grip"]] = Grip(
            self._simulation, index, nodes, shares, target, stiffness, reach
        )

    def _put_away(self) -> None:
        self._owner = None
        up = -self._direction / (np.linalg.norm(self._direction) or 1.0)
        self._target = self._target + _AWAY * self._scale * up


def _natural_force(body: Body) -> float:
    """A force [N] that lifts the body, and strains its stuff around one node by about one."""
    mesh = body.mesh
    ends = mesh.nodes[mesh.surface_edges]
    edge = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
    weight = 9.81 * body.material.density * mesh.volume
    return 4 * weight + 2 * body.material.young * edge**2
