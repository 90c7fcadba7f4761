"""A running simulation as a `Player`: steps it, carries out what the pages ask, shows its state."""

from __future__ import annotations

import time
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array
from palpate.contacts import DetectionStats
from palpate.cutting import Blade, BodyCut, CutReport
from palpate.errors import PalpateError
from palpate.model import Body, Model
from palpate.results.cut_faces import CutFaces
from palpate.results.drawing import looks_of, upward
from palpate.results.frames import contact_depths
from palpate.results.measures import node_means
from palpate.results.stress import Strain, VonMises
from palpate.simulation import MAX_DELAY, Simulation, Snapshot, StepReport
from palpate.viewer.editing import edited, settings_of, transferred
from palpate.viewer.hands import Hands
from palpate.viewer.player import Outcome, Player, Wishes
from palpate.viewer.protocol import Command, box_arrays, encode, finite
from palpate.viewer.surface import Surfaces, deformation

#: Seconds between two counts of the tested triangle pairs while nobody looks at them closely.
_COUNT_INTERVAL = 0.5
_FIELDS = ("displacement", "deformation", "strain", "stress", "depth", "force")
#: States before a cut that are kept at most.
_UNDO = 16
#: Seconds of simulated time until a stroke opens that is drawn while steps go on: so many at
#: least, and for each node of the bodies that it may cut.
_DELAY = 5 / 60
_DELAY_OF_A_NODE = _DELAY / 2400


class LivePlayer(Player):
    """Plays a simulation; the settings that it cannot change are changed by making it anew."""

    mode = "live"

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        #: What `reset` returns to, with the settings of now.
        self._start = simulation.model
        self._remade = False
        self._passed = 0.0
        self._cut_faces = CutFaces.since_the_start(simulation)
        self._surfaces = Surfaces([body.mesh for body in simulation.model.bodies])
        self._version = 0
        self._sent = -1
        self._rest = tuple(body.mesh.nodes for body in simulation.model.bodies)
        self._report: StepReport | None = None
        self._stats: DetectionStats | None = None
        self._counted = 0.0
        self._undo: list[Snapshot] = []
        #: Before the strokes that have not opened yet.
        self._under_way: Snapshot | None = None
        self._strain: list[Strain] = []
        self._strain_version = -1
        self._von_mises = VonMises(simulation)
        self._hands = Hands(simulation)

    @property
    def simulation(self) -> Simulation:
        """The simulation that is played now."""
        return self._simulation

    @property
    def interval(self) -> float:
        return self._simulation.time_step

    @property
    def time(self) -> float:
        return self._passed + self._simulation.time

    @property
    def at_end(self) -> bool:
        return False

    def hello(self) -> dict[str, Any]:
        features = ["settings", "reset", "pull", "tool", "cut", "levels"]
        return {"features": features, "fields": _FIELDS}

    def scene(self) -> bytes:
        model = self._simulation.model
        self._sent = self._version
        arrays: dict[str, npt.NDArray[Any]] = {}
        for index, body in enumerate(model.bodies):
            seen = body.mesh.nodes[self._surfaces.nodes[index]]
            arrays[f"rest/{index}"] = seen.astype(np.float32)
            arrays[f"triangles/{index}"] = self._surfaces.triangles[index]
            cut = self._cut_faces.of_mesh(body.name, body.mesh)
            if cut is not None:
                arrays[f"cut/{index}"] = cut
        return encode(
            "scene",
            {
                "version": self._version,
                "bodies": rows_of(model.bodies),
                "up": upward(model.gravity),
                "bounds": bounds(model.bodies, self._simulation.positions),
            },
            arrays,
        )

    def state(self) -> dict[str, Any]:
        model, before = self._simulation.model, self._under_way
        return {
            "time_step": self._simulation.time_step,
            "gravity": model.gravity,
            "bodies": [settings_of(body) for body in model.bodies],
            "undo": len(self._undo) + (before is not None and self._is_new(before)),
        }

    def advance(self) -> Outcome:
        self._hands.move(self._simulation.time_step)
        try:
            self._report = self._simulation.step()
        except PalpateError as error:
            if self._under_way is None or self._simulation.has_live_cuts or self._is_changed():
                raise
            # The stroke could not be cut, and that is all: nothing has changed, steps go on.
            self._under_way = None
            self._report = self._simulation.step()
            return Outcome(state=True, notice=str(error))
        return self._opened(self._report.cuts) if self._report.cuts else Outcome()

    def changed(self) -> bool:
        if self._is_changed():
            self._new_topology()
        return self._version != self._sent

    def _is_changed(self) -> bool:
        return not self._surfaces.fits(self._simulation.positions)

    def frame(self, number: int, wishes: Wishes, numbers: dict[str, Any]) -> bytes:
        simulation = self._simulation
        positions = simulation.positions
        arrays: dict[str, npt.NDArray[Any]] = {"positions": self._surfaces.stack(positions)}
        for name in wishes.fields.intersection(_FIELDS):
            arrays[f"field/{name}"] = self._surfaces.stack_values(self._field(name, positions))
        if wishes.contacts:
            contacts = simulation.contacts
            arrays["contact_points"] = contacts.points.astype(np.float32)
            arrays["contact_normals"] = contacts.normals.astype(np.float32)
            arrays["contact_forces"] = np.linalg.norm(contacts.forces, axis=1).astype(np.float32)
        for level in wishes.levels:
            boxes = [simulation.boxes(body, level) for body in range(len(positions))]
            arrays |= box_arrays(level, boxes)
        now = time.perf_counter()
        if wishes.touching or now - self._counted > _COUNT_INTERVAL:
            found = simulation.intersections()
            self._stats = found.stats
            self._counted = now
            if wishes.touching:
                arrays["touching"] = self._surfaces.triangle_numbers(found.pairs)
        header = {
            "version": self._version,
            "number": number,
            "time": self.time,
            "numbers": {**numbers, **self._numbers()},
            **self._hands.shown(),
        }
        return encode("frame", finite(header), arrays)

    def obey(self, command: Command, client: int) -> Outcome:
        kind = command["type"]
        if kind in ("grab", "drag", "release", "tool", "tool_away"):
            return self._handle(command, client)
        if kind == "cut":
            return self._cut(command["edges"])
        if kind == "separate":
            return self._separate()
        if kind == "undo":
            return self._undo_cut()
        if kind == "reset":
            return self._reset()
        if kind == "settings":
            return self._change(command)
        return Outcome()

    def leave(self, client: int) -> None:
        self._hands.leave(client)

    def _handle(self, command: Command, client: int) -> Outcome:
        if command["type"] == "tool" and not self._hands.has_tool:
            self._hands.take_probe(command)
            notice = self._remake(self._simulation.model, self._simulation.time_step)
            self._hands.obey(command, client, self._surfaces)
            return Outcome(scene=True, frame=True, state=True, notice=notice)
        self._hands.obey(command, client, self._surfaces)
        return Outcome(frame=True)

    def _cut(self, edges: list[Any]) -> Outcome:
        """Beside the steps while there are any, so that the picture goes on; else at once."""
        before, blade = self._before(), Blade.stroke(edges)
        if self.is_playing:
            self._simulation.cut_live(blade, delay=self._delay(blade))
            self._under_way = before
            return Outcome(state=True)
        cut = self._simulation.cut(blade)
        return self._done(before, cut.bodies, f"in {1e3 * cut.times['total']:.0f} ms")

    def _delay(self, blade: Blade) -> int:
        """Steps until a stroke opens: in fewer it is not ready, and the picture would wait."""
        low, high = blade.points.min(axis=0), blade.points.max(axis=0)
        simulation = self._simulation
        nodes = sum(
            len(points)
            for body, points in zip(simulation.model.bodies, simulation.positions, strict=True)
            if body.rigid is None
            and (points.min(axis=0) <= high).all()
            and (points.max(axis=0) >= low).all()
        )
        seconds = max(_DELAY, _DELAY_OF_A_NODE * nodes)
        return min(max(1, round(seconds / simulation.time_step)), MAX_DELAY)

    def _opened(self, cuts: tuple[CutReport, ...]) -> Outcome:
        """What the strokes did that opened before the step."""
        before = self._under_way  # None of those that its owner has begun
        if not self._simulation.has_live_cuts:
            self._under_way = None
        seconds = sum(cut.times["total"] for cut in cuts)
        how = f"in {1e3 * seconds:.0f} ms beside the steps"
        return self._done(before, tuple(body for cut in cuts for body in cut.bodies), how)

    def _done(self, before: Snapshot | None, cuts: tuple[BodyCut, ...], how: str) -> Outcome:
        if not cuts:
            return Outcome(state=True, notice="the stroke met no tissue")
        self._changed_by_hand(before)
        bodies = self._simulation.model.bodies
        done = [
            f"{bodies[each.body].name}: {each.cut_area * 1e4:.3g} cm² cut"
            + (f", {each.pieces} pieces" if each.pieces > 1 else "")
            for each in cuts
        ]
        return Outcome(scene=True, frame=True, state=True, notice=f"{'; '.join(done)} ({how})")

    def _before(self) -> Snapshot:
        """What undoing a change of now goes back to: what is on its way is undone with it."""
        return self._under_way or self._simulation.snapshot()

    def _is_new(self, before: Snapshot) -> bool:
        return before not in self._undo[-1:]

    def _separate(self) -> Outcome:
        """Pieces that came apart become bodies."""
        before, count = self._before(), len(self._simulation.model.bodies)
        self._hands.let_go()
        if not self._simulation.separate():
            return Outcome(notice="nothing has come apart")
        self._changed_by_hand(before)
        self._hands.attach(self._simulation)
        more = len(self._simulation.model.bodies) - count
        return Outcome(scene=True, frame=True, state=True, notice=f"{more} more bodies")

    def _changed_by_hand(self, before: Snapshot | None) -> None:
        if before is not None and self._is_new(before):
            self._undo = [*self._undo[1 - _UNDO :], before]
        self._hands.forget_released()
        self._new_topology()

    def _undo_cut(self) -> Outcome:
        before = self._under_way
        if before is None or not self._is_new(before):
            if not self._undo:
                return Outcome(notice="there is no cut to undo")
            before = self._undo.pop()
        self._under_way = None
        self._hands.let_go()
        self._simulation.restore(before)
        self._hands.attach(self._simulation)
        self._new_topology()
        return Outcome(scene=True, frame=True, state=True)

    def _reset(self) -> Outcome:
        self._hands.let_go()
        self._passed = 0.0
        self._undo.clear()
        self._under_way = None
        self._report = None
        if self._remade:
            start = self._hands.with_probe(self._start)
            self._replace(self._simulation_of(start, self._simulation.time_step))
            self._remade = False
        else:
            self._simulation.reset()
        self._new_topology()
        return Outcome(scene=True, frame=True, state=True)

    def _change(self, command: Command) -> Outcome:
        """Settings are part of the model: a new simulation takes over the state."""
        time_step = command["time_step"] or self._simulation.time_step
        model = edited(self._simulation.model, command)
        notice = self._remake(model, time_step)
        self._start = edited(self._start, command)
        return Outcome(scene=True, frame=True, state=True, notice=notice)

    def _remake(self, model: Model, time_step: float) -> str | None:
        """Go on with another simulation in the same state; what the user should know of it."""
        before = self._simulation
        self._hands.let_go()
        model = self._hands.with_probe(model)
        after = transferred(before, model, lambda moved: self._simulation_of(moved, time_step))
        self._passed += before.time
        self._remade = True
        self._replace(after)
        given_up, dropped = self._under_way is not None, bool(self._undo)
        self._under_way = None
        self._undo.clear()
        told = ["the stroke that was on its way was given up"] if given_up else []
        if dropped:
            told.append("what was cut before this cannot be undone any more")
        return "; ".join(told) or None

    def _simulation_of(self, model: Model, time_step: float) -> Simulation:
        return Simulation(model, time_step=time_step, **self._simulation._options)

    def _replace(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._hands.attach(simulation)
        self._new_topology()

    def _new_topology(self) -> None:
        bodies = self._simulation.model.bodies
        self._surfaces = Surfaces([body.mesh for body in bodies])
        self._rest = tuple(body.mesh.nodes for body in bodies)
        self._von_mises = VonMises(self._simulation)
        self._version += 1

    def _field(self, name: str, positions: tuple[Float64Array, ...]) -> list[Float64Array]:
        """A number per node of each body."""
        pairs = list(zip(self._rest, positions, strict=True))
        if name == "displacement":
            return [np.linalg.norm(now - rest, axis=1) for rest, now in pairs]
        if name == "deformation":
            return [deformation(rest, now) for rest, now in pairs]
        if name == "force":
            return [np.linalg.norm(each, axis=1) for each in self._simulation.contact_forces]
        if name == "strain":
            return [
                strain.at_nodes(now) for strain, now in zip(self._strains(), positions, strict=True)
            ]
        if name == "stress":
            return [self._stress(index) for index in range(len(positions))]
        offsets = np.concatenate([[0], np.cumsum([len(each) for each in positions])])
        depths = contact_depths(self._simulation, offsets)
        return [depths[start:end] for start, end in pairwise(offsets)]

    def _stress(self, index: int) -> Float64Array:
        """Von Mises stress around each node; 0 for rigid bodies."""
        mesh = self._simulation.model.bodies[index].mesh
        return node_means(self._von_mises.of(index), mesh.tetrahedra, len(mesh.nodes))

    def _strains(self) -> list[Strain]:
        if self._strain_version != self._version:
            self._strain = [Strain(body.mesh, seen=True) for body in self._simulation.model.bodies]
            self._strain_version = self._version
        return self._strain

    def _numbers(self) -> dict[str, Any]:
        numbers: dict[str, Any] = {}
        if self._report is not None:
            report = self._report
            numbers = {
                "times": {**report.stages, "total": report.times["total"]},
                "contacts": report.contacts,
                "self_contacts": report.self_contacts,
                "penetrating_nodes": report.penetrating_nodes,
                "max_depth": report.max_depth,
                "newton_iterations": report.newton_iterations,
            }
        if self._stats is not None:
            numbers["pair_tests"] = self._stats.pair_tests
            numbers["all_pairs"] = self._stats.all_pairs
        return numbers


def rows_of(bodies: tuple[Body, ...]) -> list[dict[str, Any]]:
    """The bodies for the page: look and size."""
    return [
        {
            **asdict(look),
            "nodes": len(body.mesh.nodes),
            "tetrahedra": len(body.mesh.tetrahedra),
        }
        for look, body in zip(looks_of(bodies), bodies, strict=True)
    ]


def bounds(
    bodies: tuple[Body, ...], positions: tuple[Float64Array, ...]
) -> dict[str, list[list[float]]]:
    """Corners of the box around the deformable bodies (all, if there is none), and around all."""
    soft = [points for body, points in zip(bodies, positions, strict=True) if body.rigid is None]
    result = {}
    for name, parts in (("soft", soft or list(positions)), ("all", list(positions))):
        cloud = np.concatenate(parts)
        result[name] = [cloud.min(axis=0).tolist(), cloud.max(axis=0).tolist()]
    return result
