"""The simulation: bodies that fall, touch, deform and come to rest."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from palpate import _arrays, _core
from palpate._arrays import Float64Array, IndexArray
from palpate.contacts import DetectionStats, Intersections
from palpate.cutting import (
    Blade,
    BodyCut,
    CutReport,
    MeshChange,
    RemovalReport,
    as_blade,
    chosen,
    cut_options,
)
from palpate.hands import Drive, Pull, Tool
from palpate.mesh import Mesh
from palpate.model import Body, Model, body_index, read_model
from palpate.scene import METHODS, SPLITS, _choice

if TYPE_CHECKING:
    from palpate.viewer import Viewer


#: Most steps until a live cut opens.
MAX_DELAY = 1000


@dataclass(frozen=True)
class StepReport:
    """What the last of the asked steps did, and what all of them cost.

    ``times`` maps a stage to seconds, summed over the steps, and ``stages`` the same in finer
    parts: detection (``update``, ``penetration``, ``proximity``), the motion without new contact
    forces (``predict``), which pairs are contacts (``filter``), how the touching nodes move each
    other (``compliance``), the contact ``forces``, the new state (``advance``), new matrices
    (``factor``). ``contacts`` carry a force,
    ``penetrating_nodes`` were inside another body at the start of the last step, by at most
    ``max_depth`` [m]; ``newton_iterations`` are the quasi-Newton iterations of the body that took
    most (none with the linear law), ``iterations`` the contact solver's changes of a force, both
    summed; ``residual`` is the largest error of a gap or slip that it left in the last step, in
    contact distances. ``substeps`` is the largest number of smaller steps that one of them took.
    ``cuts`` are the live cuts that opened before one of them (`Simulation.cut_live`), ``change`` in
    ``stages`` is what that took of the steps.
    """

    step: int
    time: float
    times: dict[str, float]
    stages: dict[str, float]
    proximity_pairs: int
    contacts: int
    self_contacts: int
    penetrating_nodes: int
    max_depth: float
    newton_iterations: int
    iterations: int
    residual: float
    substeps: int
    cuts: tuple[CutReport, ...] = ()


@dataclass(frozen=True, eq=False)
class Contacts:
    """Contacts that carried a force in the last step.

    ``nodes`` and ``weights`` (k, 4) are the contact's Jacobian: the gap is the weighted sum of the
    nodes' positions along ``normals`` (k, 3), which points from side b to side a. The first nodes
    belong to ``bodies[:, 0]``: one of a vertex-triangle contact (``kinds`` 0), two of an edge-edge
    contact (``kinds`` 1). ``gaps`` [m] are negative when penetrating; ``points`` [m] lie on side b;
    ``forces`` (k, 3) [N] act on side a, their negative on side b.
    """

    kinds: IndexArray
    bodies: IndexArray
    nodes: IndexArray
    weights: Float64Array
    normals: Float64Array
    points: Float64Array
    gaps: Float64Array
    forces: Float64Array

    def __len__(self) -> int:
        return len(self.gaps)


class Simulation:
    """Bodies of a model, moved step by step.

    Parameters
    ----------
    model : Model, path of a model, or iterable of Body or Mesh
        What is simulated.
    time_step : float
        [s]
    threads : int
        Worker threads. Results are the same bits at any number.
    leaf_size, split, method
        Contact detection, as in `Scene`.
    substeps : 1 or "auto"
        ``"auto"``: a step that fails is tried again from the last good state in 2, 4, 8, ... and at
        last 64 smaller ones, during which drives, tools and springs' targets move steadily.
        `StepReport.substeps` says how many it took. Steps that turn tetrahedra over to more than
        their volume at rest, or blow them up to ten times that, count as failed too.

    Examples
    --------
    >>> import palpate
    >>> simulation = palpate.Simulation("small")
    >>> report = simulation.step(5)
    >>> round(simulation.time * 60)
    5
    """

    def __init__(
        self,
        model: Model | str | os.PathLike[str] | Iterable[Body | Mesh],
        *,
        time_step: float = 1.0 / 60.0,
        threads: int = 1,
        leaf_size: int | None = None,
        split: str = "middle",
        method: str = "wide",
        substeps: int | str = 1,
    ) -> None:
        if isinstance(model, (str, os.PathLike)):
            model = read_model(model)
        if not isinstance(model, Model):
            model = Model(model)
        time_step = _arrays.scalar(time_step, "time_step")
        if time_step <= 0:
            raise ValueError(f"time_step: expected a positive number of seconds, got {time_step}")
        if substeps not in (1, "auto"):
            raise ValueError(
                f'substeps: expected 1 or "auto", got {substeps!r}; for smaller steps throughout '
                "give a smaller time_step"
            )
        self._options: dict[str, Any] = {
            "threads": _arrays.count(threads, "threads"),
            "leaf_size": None if leaf_size is None else _arrays.count(leaf_size, "leaf_size"),
            "split": _choice(split, "split", SPLITS),
            "method": _choice(method, "method", METHODS),
            "substeps": substeps,
        }
        options = {name: value for name, value in self._options.items() if name != "substeps"}
        auto = substeps == "auto"
        self._start(_core.Simulation(model._core, time_step, **options, auto_substeps=auto))

    def _start(self, core: _core.Simulation) -> None:
        self._core = core
        self._drives: list[Drive] = []
        self._changed()

    def _changed(self) -> None:
        """Look at the model again: cuts and drives change it."""
        core = self._core
        self._model = Model._from_core(core.model)
        self._names = [body.name for body in self._model.bodies]
        self._counts = [len(body.mesh.nodes) for body in self._model.bodies]

    @property
    def model(self) -> Model:
        """The model that is simulated, with the cuts that were made."""
        return self._model

    @property
    def initial_model(self) -> Model:
        """The model that `reset` returns to, before the cuts."""
        return Model._from_core(self._core.initial_model)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._core.time

    @property
    def time_step(self) -> float:
        """Length of a step [s]."""
        return self._core.time_step

    @property
    def positions(self) -> tuple[Float64Array, ...]:
        """Node positions [m] of each body, shape (n, 3), read-only; they never change later."""
        return self._core.positions

    @property
    def velocities(self) -> tuple[Float64Array, ...]:
        """Node velocities [m/s] of each body, shape (n, 3), read-only."""
        return self._core.velocities

    @property
    def contact_forces(self) -> tuple[Float64Array, ...]:
        """Force [N] of contacts and springs on each node in the last step, shape (n, 3)."""
        return self._core.contact_forces

    @property
    def contacts(self) -> Contacts:
        """Contacts that carried a force in the last step."""
        return Contacts(*self._core.contacts)

    def step(self, count: int = 1) -> StepReport:
        """Move on by ``count`` time steps.

        Raises
        ------
        SimulationError
            If a step fails, with ``substeps="auto"`` also in smaller ones. The state is then that
            before the failed step, bit for bit; the error names body, node, tetrahedron and cause.
        """
        count = _arrays.count(count, "count")
        # Those that were released stay known: a snapshot may bring them back.
        drives = [drive for drive in self._drives if drive.is_active]
        if not drives:
            return self._step(count)
        reports = []
        for _ in range(count):
            for drive in drives:
                drive.follow(self.time + self.time_step)
            reports.append(self._step(1))
        return _together(reports)

    @property
    def has_live_cuts(self) -> bool:
        """Whether cuts are on their way that have not opened yet."""
        return self._core.has_live_cuts

    def _step(self, count: int) -> StepReport:
        changes = self.has_live_cuts
        try:
            row = self._core.step(count)
        finally:
            if changes:
                self._changed()
        cuts = tuple(_cut_report(cut) for cut in row.pop("cuts"))
        return StepReport(**row, cuts=cuts)

    def set_positions(self, body: int | str, positions: npt.ArrayLike) -> None:
        """Put the nodes of a body elsewhere; positions [m], shape (n, 3)."""
        index = self._index(body)
        self._core.set_positions(index, self._points(positions, "positions", index))

    def set_velocities(self, body: int | str, velocities: npt.ArrayLike) -> None:
        """Set the velocities [m/s] of a body's nodes, shape (n, 3)."""
        index = self._index(body)
        self._core.set_velocities(index, self._points(velocities, "velocities", index))

    def set_forces(self, body: int | str, forces: npt.ArrayLike) -> None:
        """Set external forces [N] on a body's nodes, shape (n, 3); they act until set again."""
        index = self._index(body)
        self._core.set_forces(index, self._points(forces, "forces", index))

    def pull(self, body: int | str, node: int, target: npt.ArrayLike, stiffness: float) -> Pull:
        """Pull a node towards a target with a spring, as a mouse or a haptic device does.

        Parameters
        ----------
        body : int or str
            The body, by index or name.
        node : int
            The node, one that is not fixed.
        target : (3,)
            Where the spring ends [m].
        stiffness : float
            Force per distance [N/m]. The spring is part of the implicit step: it may be as stiff as
            wanted.

        Returns
        -------
        Pull
            Move its `Pull.target`, read its `Pull.force`, and `Pull.release` it.

        Examples
        --------
        >>> import palpate
        >>> simulation = palpate.Simulation("small")
        >>> pull = simulation.pull(0, 5, target=[0, 0, 0.2], stiffness=50.0)
        >>> report = simulation.step(3)
        >>> bool(pull.force[2] > 0)
        True
        >>> pull.release()
        """
        index = self._index(body)
        node = _arrays.count(node, "node", minimum=0)
        goal = _arrays.vector(target, "target")
        identity = self._core.pull(index, node, goal, _arrays.scalar(stiffness, "stiffness"))
        return Pull(self._core, identity)

    def drive(
        self,
        body: int | str,
        nodes: npt.ArrayLike,
        path: Callable[[float], npt.ArrayLike] | npt.ArrayLike,
    ) -> Drive:
        """Move nodes of a body along a path, whatever it takes.

        Parameters
        ----------
        body : int or str
            The body, by index or name.
        nodes : (k,) integers
            The nodes; fixed ones may be driven as well.
        path : function or (k, 3)
            Positions [m] of the nodes at a time [s], in their order: called before every step with
            the time at its end. Or where they are to be at the end of the next step, to be moved on
            by `Drive.move_to`.

        Returns
        -------
        Drive
            Read its `Drive.force`, and `Drive.release` it.

        Notes
        -----
        The body's matrix is made anew here and at the release.

        Examples
        --------
        >>> import numpy as np
        >>> import palpate
        >>> simulation = palpate.Simulation("small")
        >>> nodes = [0, 1, 2]
        >>> start = simulation.positions[0][nodes]
        >>> drive = simulation.drive(0, nodes, lambda time: start + [0, 0, 0.05 * time])
        >>> report = simulation.step(6)
        >>> bool(np.allclose(simulation.positions[0][nodes], start + [0, 0, 0.005]))
        True
        """
        index = self._index(body)
        chosen = _arrays.indices(nodes, "nodes", None)
        if len(np.unique(chosen)) != len(chosen):
            raise ValueError("nodes: each node may be named once")
        identity = self._core.drive(index, chosen)
        follows = path if callable(path) else None
        drive = Drive(self._core, identity, chosen.argsort(), follows, self._changed)
        self._changed()
        try:
            if callable(path):
                drive.follow(self.time + self.time_step)
            else:
                drive.move_to(path)
        except Exception:
            drive.release()
            raise
        self._drives.append(drive)
        return drive

    def cut(
        self,
        blade: Blade,
        *,
        snap: float | None = None,
        min_quality: float | None = None,
        min_edge: float | None = None,
        min_piece: float | None = None,
    ) -> CutReport:
        """Cut all deformable bodies along a blade, where they are now.

        The next step goes on with the new surfaces; both lips of the cut touch each other. Node and
        tetrahedron numbers that were there stay; what is new comes after them. `model` and the
        shapes of all arrays are new, fixed nodes, regions and fibres follow.

        A scalpel may move on in steps as short as one likes, frame by frame: what it has reached
        and not opened yet is remembered (snapshots and checkpoints hold it) until tetrahedra of the
        body are removed or it is separated.

        Parameters
        ----------
        blade : Blade
            In the space of the bodies [m].
        snap : float
            A node closer to the blade than this part of an edge counts as on the blade, 0 to 0.5.
        min_quality : float
            Smallest radius ratio of the parts of split tetrahedra, 0 to 1.
        min_edge : float
            Shortest part of a split edge [m], 0 for no bound; unless given, a tenth of the mean
            edge that the body had at the start.
        min_piece : float
            Smallest piece that comes off, in mean tetrahedra of the mesh: smaller ones stay where
            they are. 0 for no bound, 4 unless given.

        Returns
        -------
        CutReport
            Empty when the blade passed everything by. `BodyCut.change` maps arrays of yours.

        Raises
        ------
        SimulationError
            If a body cannot be cut or simulated afterwards; nothing has changed then.
        """
        options = cut_options(snap, min_quality, min_edge, min_piece)
        report = _cut_report(self._core.cut(as_blade(blade)._core, options))
        if len(report):
            self._changed()
        return report

    def cut_live(
        self,
        blade: Blade,
        *,
        delay: int = 5,
        snap: float | None = None,
        min_quality: float | None = None,
        min_edge: float | None = None,
        min_piece: float | None = None,
    ) -> None:
        """Cut as `cut`, beside the steps: what keeps a picture moving while a scalpel is drawn.

        What the bodies become is made in a thread of its own while steps go on; it begins with the
        next step and opens ``delay`` steps later. `StepReport.cuts` of that step holds what
        it did, and `model` and the shapes of all arrays are new then. Strokes that come while one
        is on its way open together, ``delay`` steps after that one. All cut what the blade passed
        through when they came, wherever that has moved since.

        Results do not depend on how fast the thread is: a step waits for it where ``delay`` is too
        short. Snapshots and checkpoints hold what is on its way; after another change of the
        bodies it begins anew on what they are then.

        Parameters
        ----------
        blade, snap, min_quality, min_edge, min_piece
            As in `cut`.
        delay : int
            Steps until the cut opens, 1 to 1000. At 60 steps a second, 5 are enough for a kidney
            of 2,400 nodes.

        Raises
        ------
        SimulationError
            If an option is out of range. What else can go wrong, as in `cut`, the step says in
            which the cut should open; the bodies are as before, and later steps go on without it.
        """
        options = cut_options(snap, min_quality, min_edge, min_piece)
        steps = _arrays.count(delay, "delay")
        if steps > MAX_DELAY:
            raise ValueError(f"delay: expected at most {MAX_DELAY} steps, got {steps}")
        self._core.cut_live(as_blade(blade)._core, options, steps)

    def remove(self, body: int | str, tetrahedra: npt.ArrayLike) -> RemovalReport:
        """Remove tetrahedra of a deformable body, as cautery or resection does.

        Parameters
        ----------
        body : int or str
            The body, by index or name.
        tetrahedra : (k,) integers, or a mask of shape (m,)
            Which ones; not all. Nodes that no tetrahedron is left of go as well.

        Raises
        ------
        SimulationError
            If one is named twice or none would be left; nothing has changed then.
        IndexError
            If there is no such tetrahedron.
        """
        index = self._index(body)
        count = len(self._model.bodies[index].mesh.tetrahedra)
        rows, times = self._core.remove(index, chosen(tetrahedra, count))
        self._changed()
        ((_, change, _, released),) = rows
        return RemovalReport(index, MeshChange._from_core(change), len(released), times)

    def separate(self) -> list[tuple[int, MeshChange]]:
        """Make every piece that has come apart a body of its own, in the same state.

        The largest piece keeps the body's index and name; the others come last, named ``kidney/2``
        and so on, with the same material, processor and looks.

        Returns
        -------
        list of (int, MeshChange)
            For each body now the index of the one before, and what became of its mesh; empty when
            nothing has come apart.
        """
        parts = self._core.separate()
        if parts:
            self._changed()
        return [(old, MeshChange._from_core(change)) for old, change in parts]

    def write_model(self, path: str | os.PathLike[str]) -> list[str]:
        """Write the model as it is now, cuts included: a ``.bml`` and a ``.seg`` for each body.

        Meshes are written at rest, in metres, beside ``path``. Returns all files.
        """
        return [os.fspath(file) for file in self._core.write_model(os.fspath(path))]

    def tool(self, name: int | str) -> Tool:
        """A rigid body as a tool: move it by `Tool.set_pose`, read its `Tool.force`."""
        index = self._index(name)
        self._core.tool_force(index)  # only rigid bodies feel one
        return Tool(self._core, index, self._names[index])

    def intersections(self, *, self_contact: bool = True) -> Intersections:
        """Surface triangles that meet right now; see `Scene.intersections`."""
        pairs, stats = self._core.intersections(bool(self_contact))
        return Intersections(pairs, DetectionStats(*stats))

    def boxes(self, body: int | str, level: int = 0) -> Float64Array:
        """Boxes (k, 2, 3) [m] at one level of a body's bounding tree; see `Scene.boxes`."""
        level = _arrays.count(level, "level", minimum=0)
        return self._core.boxes(self._index(body), level).reshape(-1, 2, 3)

    def stress(self, body: int | str) -> Float64Array:
        """Cauchy stress [Pa] of each tetrahedron of a body, without viscosity.

        Returns
        -------
        (m, 6) float64
            xx, yy, zz, xy, yz, xz.

        Raises
        ------
        ValueError
            If the body is rigid, or of law ``linear``, whose stress does not turn with the
            elements: take ``corotated``.
        """
        index = self._index(body)
        stress = self._core.stress(index)
        if stress is None:
            raise ValueError(
                f"body {self._names[index]!r} is rigid or of law linear, which has no stress that "
                "turns with the elements: take corotated"
            )
        return stress

    @property
    def factor_bytes(self) -> tuple[int, ...]:
        """Bytes of each body's factored matrix, what a solve has to read at least once."""
        return tuple(self._core.factor_bytes())

    def energy(self) -> dict[str, float]:
        """Kinetic, elastic and gravitational energy [J] of the deformable bodies."""
        return self._core.energy()

    def snapshot(self) -> Snapshot:
        """The whole state, to come back to with `restore`."""
        return Snapshot(self._core.snapshot())

    def restore(self, snapshot: Snapshot) -> None:
        """Return to a snapshot of this simulation; it continues with the same bits.

        Cuts made since are undone.
        """
        if not isinstance(snapshot, Snapshot):
            raise TypeError(f"snapshot: expected a Snapshot, got {type(snapshot).__name__}")
        self._core.restore(snapshot._core)
        self._changed()

    def reset(self) -> None:
        """Return to the start, before all cuts."""
        self._core.reset()
        self._changed()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a checkpoint: model, meshes and state in one file, complete or absent."""
        self._core.save(os.fspath(path))

    @classmethod
    def load(cls, path: str | os.PathLike[str], *, threads: int = 1) -> Simulation:
        """Continue from a checkpoint, bit for bit.

        Raises
        ------
        CheckpointError
            If the file is damaged or not a checkpoint.
        """
        simulation = cls.__new__(cls)
        core = _core.Simulation.load(os.fspath(path), _arrays.count(threads, "threads"))
        substeps = "auto" if core.auto_substeps else 1
        simulation._options = {"threads": threads, "substeps": substeps}
        simulation._start(core)
        return simulation

    def view(
        self,
        *,
        host: str = "127.0.0.1",
        port: int = 8642,
        browser: bool = True,
        play: bool = True,
        block: bool = True,
        title: str = "",
    ) -> Viewer:
        """Show the simulation in the browser, to look at and to touch.

        The viewer steps the simulation until it is closed; meanwhile leave that to it.

        Parameters
        ----------
        host, port
            Where the page is served; another port when this one is taken.
        browser : bool
            Open the user's browser.
        play : bool
            Play at once.
        block : bool
            Return when Ctrl-C was pressed; else at once, with a viewer that has ``url``,
            ``wait()`` and ``close()`` and is a context manager.
        title : str
            Name at the top of the page.
        """
        from palpate.viewer import view

        return view(
            self, host=host, port=port, browser=browser, play=play, block=block, title=title
        )

    def _index(self, body: int | str) -> int:
        return body_index(self._names, body)

    def _points(self, values: npt.ArrayLike, name: str, index: int) -> Float64Array:
        array = _arrays.points(values, name, self._counts[index])
        if not np.isfinite(array).all():
            node = int(np.argwhere(~np.isfinite(array).all(axis=1))[0, 0])
            raise ValueError(f"{name}: node {node} is not finite: {array[node].tolist()}")
        return array

    def __repr__(self) -> str:
        return f"Simulation({len(self._names)} bodies, t = {self.time:.4g} s)"


def _cut_report(rows: tuple[list[Any], dict[str, float]]) -> CutReport:
    changes, times = rows
    bodies = tuple(
        BodyCut(body, MeshChange._from_core(change), **(cut or {}), released=len(released))
        for body, change, cut, released in changes
    )
    return CutReport(bodies, times)


def _together(reports: Sequence[StepReport]) -> StepReport:
    """One report of several steps."""

    def summed(parts: Sequence[dict[str, float]]) -> dict[str, float]:
        return {name: sum(part[name] for part in parts) for name in parts[0]}

    return replace(
        reports[-1],
        times=summed([each.times for each in reports]),
        stages=summed([each.stages for each in reports]),
        newton_iterations=sum(each.newton_iterations for each in reports),
        iterations=sum(each.iterations for each in reports),
        substeps=max(each.substeps for each in reports),
        cuts=tuple(cut for each in reports for cut in each.cuts),
    )


class Snapshot:
    """State of a simulation at a time."""

    __slots__ = ("_core",)

    def __init__(self, core: _core.Snapshot) -> None:
        self._core = core

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._core.time
