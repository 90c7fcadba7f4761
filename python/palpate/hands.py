"""What a user's hands do: pull tissue by springs, drive nodes along paths, move rigid tools."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from palpate import _arrays, _core
from palpate._arrays import Float64Array

# How far the columns of a rotation matrix may be off right angles and length 1.
_ROTATION_TOLERANCE = 1e-6

_IDENTITY = np.eye(3)

_RELEASED = "this was released before, or belongs to another state"


class _State(NamedTuple):
    body: int
    node: int
    target: tuple[float, float, float]
    stiffness: float
    force: tuple[float, float, float]


class Pull:
    """A spring that pulls a node towards a target, made by `Simulation.pull`.

    It is part of the simulation's state: after `Simulation.restore` or `Simulation.reset` to a
    state without it, it is released.
    """

    def __init__(self, core: _core.Simulation, identity: int) -> None:
        self._core = core
        self._id = identity

    def _state(self) -> _State:
        state = self._core.pulled(self._id)
        if state is None:
            raise ValueError(_RELEASED)
        return _State(*state)

    @property
    def is_active(self) -> bool:
        """Whether it still pulls."""
        return self._core.pulled(self._id) is not None

    @property
    def body(self) -> int:
        """Index of the body that is pulled."""
        return self._state().body

    @property
    def node(self) -> int:
        """Node that is pulled."""
        return self._state().node

    @property
    def stiffness(self) -> float:
        """Force per distance [N/m]."""
        return self._state().stiffness

    @property
    def target(self) -> Float64Array:
        """Where the spring ends [m], shape (3,); may be set at any time."""
        return np.array(self._state().target)

    @target.setter
    def target(self, target: npt.ArrayLike) -> None:
        self._core.set_pull_target(self._id, _arrays.vector(target, "target"))

    @property
    def force(self) -> Float64Array:
        """Force on the node in the last step [N], shape (3,)."""
        return np.array(self._state().force)

    def release(self) -> None:
        """Let go."""
        self._core.release(self._id)

    def __repr__(self) -> str:
        if not self.is_active:
            return "Pull(released)"
        state = self._state()
        return f"Pull(body {state.body}, node {state.node}, {state.stiffness:g} N/m)"


class Drive:
    """Nodes that are moved along a path, made by `Simulation.drive`.

    It is part of the simulation's state, as a `Pull` is; a path that is a function is this object's
    own, and goes on with the time of the simulation.
    """

    def __init__(
        self,
        core: _core.Simulation,
        identity: int,
        places: npt.NDArray[np.intp],
        path: Callable[[float], npt.ArrayLike] | None,
        changed: Callable[[], None],
    ) -> None:
        self._core = core
        self._id = identity
        # The core has the nodes in ascending order.
        self._places = places
        self._path = path
        self._changed = changed

    def _state(self) -> tuple[int, npt.NDArray[np.int32], Float64Array, Float64Array]:
        state = self._core.driven(self._id)
        if state is None:
            raise ValueError(_RELEASED)
        return state

    @property
    def is_active(self) -> bool:
        """Whether it still moves its nodes."""
        return self._core.driven(self._id) is not None

    @property
    def body(self) -> int:
        """Index of the body."""
        return self._state()[0]

    @property
    def nodes(self) -> npt.NDArray[np.int32]:
        """The nodes (k,), in ascending order."""
        return self._state()[1]

    @property
    def targets(self) -> Float64Array:
        """Where the nodes are at the end of the next step [m], shape (k, 3)."""
        return self._state()[2]

    @property
    def force(self) -> Float64Array:
        """Force that moved each node in the last step [N], shape (k, 3)."""
        return self._state()[3]

    def move_to(self, positions: npt.ArrayLike) -> None:
        """Say where the nodes are at the end of the next step [m].

        ``positions`` has shape (k, 3), in the order in which the nodes were given to
        `Simulation.drive` (in ascending order once a cut has changed them), or (3,) for a single
        node.
        """
        count = len(self._state()[1])
        array = np.asarray(positions)
        if count == 1 and array.shape == (3,):
            array = array[None]
        array = _arrays.points(array, "path", count)
        places = self._places
        self._core.set_drive_targets(self._id, array[places] if len(places) == count else array)

    def follow(self, time: float) -> None:
        """Take the targets from the path at a time [s]; without a function nothing changes."""
        if self._path is not None:
            self.move_to(self._path(time))

    def release(self) -> None:
        """Let the nodes go; those that the model holds stay fixed."""
        self._core.release_drive(self._id)
        self._changed()

    def __repr__(self) -> str:
        if not self.is_active:
            return "Drive(released)"
        body, nodes, *_ = self._state()
        return f"Drive(body {body}, {len(nodes)} nodes)"


class Tool:
    """A rigid body that the user moves, got by `Simulation.tool`.

    Without `set_pose` it rests, or follows the path of its model (RG).
    """

    def __init__(self, core: _core.Simulation, index: int, name: str) -> None:
        self._core = core
        self._index = index
        self._name = name

    @property
    def name(self) -> str:
        """Name of the body."""
        return self._name

    def set_pose(self, rotation: npt.ArrayLike, translation: npt.ArrayLike) -> None:
        """Move the tool to a pose during the next step.

        Parameters
        ----------
        rotation : (3, 3) or (4,)
            Rotation matrix, or quaternion with the real part first: how the tool is turned from how
            the model placed it.
        translation : (3,)
            Where the origin of its mesh file is [m].

        Raises
        ------
        ValueError
            If the rotation is none, or a number is not finite.

        Notes
        -----
        A tool should move by less than a few surface edges of the tissue in a step: contacts are
        looked for three edges ahead.
        """
        quaternion = _quaternion(rotation)
        self._core.set_pose(self._index, quaternion, _arrays.vector(translation, "translation"))

    @property
    def rotation(self) -> Float64Array:
        """How it is turned from how the model placed it, shape (3, 3)."""
        columns: Float64Array = np.array(self._core.tool_pose(self._index)[0])
        return np.ascontiguousarray(columns.T)

    @property
    def translation(self) -> Float64Array:
        """Where the origin of its mesh file is [m], shape (3,)."""
        return np.array(self._core.tool_pose(self._index)[1])

    @property
    def force(self) -> Float64Array:
        """Force of all contacts on the tool in the last step [N], shape (3,)."""
        return np.array(self._core.tool_force(self._index)[0])

    @property
    def torque(self) -> Float64Array:
        """Torque of all contacts on the tool [N m] about its `translation`, shape (3,)."""
        return np.array(self._core.tool_force(self._index)[1])

    def loop(self, *, margin: float | None = None) -> ToolLoop:
        """A loop in which the tool feels tissue between steps, at 1 kHz.

        Call `ToolLoop.tick` from a thread of its own while another one calls `Simulation.step`:
        every step moves the tool to the pose of the newest tick, and tells the loop how the tissue
        near the tool lies and answers.

        Parameters
        ----------
        margin : float
            Tissue within this distance [m] of the tool gives way, beside what it can reach until
            the next step; a mean edge of the tissue's surface unless given.

        Notes
        -----
        A tool has one loop: an earlier one gets no news any more.
        """
        margin = None if margin is None else _arrays.scalar(margin, "margin")
        return ToolLoop(self._core.tool_loop(self._index, margin), self._name)

    def __repr__(self) -> str:
        return f"Tool({self._name!r})"


class ToolLoop:
    """A tool that feels tissue between the steps of a simulation, made by `Tool.loop`.

    Between two steps the tissue is as the last one left it and gives way with its own compliance
    within a step, inertia included; contact and friction obey the laws of the step.
    """

    def __init__(self, core: _core.ToolLoop, name: str) -> None:
        self._core = core
        self._name = name
        self._contacts = 0
        self._step = 0

    def tick(
        self, rotation: npt.ArrayLike, translation: npt.ArrayLike
    ) -> tuple[Float64Array, Float64Array]:
        """Move the tool; what it feels there.

        Parameters
        ----------
        rotation : (3, 3) or (4,)
            Rotation matrix, or quaternion with the real part first, as in `Tool.set_pose`.
        translation : (3,)
            Where the origin of its mesh file is [m].

        Returns
        -------
        force : (3,) float64
            Of all contacts on the tool [N].
        torque : (3,) float64
            About ``translation`` [N m].

        Raises
        ------
        ValueError
            If the rotation is none, or a number is not finite; the tool has not moved then.
        """
        matrix = np.asarray(rotation)
        if matrix.shape != (3, 3) or matrix.dtype != np.float64 or not _is_rotation(matrix):
            matrix = _matrix(_quaternion(rotation))
        place = _arrays.vector(translation, "translation")
        force, torque, self._contacts, self._step = self._core.tick(matrix.tolist(), place)
        return np.array(force), np.array(torque)

    @property
    def contacts(self) -> int:
        """Contacts that carried a force in the last tick."""
        return self._contacts

    @property
    def step(self) -> int:
        """Number of the step whose outcome the last tick has worked on."""
        return self._step

    def __repr__(self) -> str:
        return f"ToolLoop({self._name!r})"


def _is_rotation(matrix: Float64Array) -> bool:
    off = matrix @ matrix.T - _IDENTITY
    turned = float(np.dot(np.cross(matrix[0], matrix[1]), matrix[2]))
    return bool(np.abs(off).max() <= _ROTATION_TOLERANCE and turned > 0)


def _matrix(quaternion: tuple[float, float, float, float]) -> Float64Array:
    """The rotation matrix of a unit quaternion, real part first."""
    w, x, y, z = quaternion
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quaternion(rotation: npt.ArrayLike) -> tuple[float, float, float, float]:
    """A rotation matrix or quaternion as a unit quaternion, real part first."""
    array = np.asarray(rotation)
    if array.dtype.kind not in "fiu":
        raise TypeError(f"rotation: expected numbers, got dtype {array.dtype}")
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        raise ValueError("rotation: expected finite numbers")
    if array.shape == (4,):
        length = float(np.linalg.norm(array))
        if abs(length - 1) > 1e-3:
            raise ValueError(f"rotation: expected a quaternion of length 1, got length {length:g}")
        w, x, y, z = (float(entry) for entry in array / length)
        return w, x, y, z
    if array.shape != (3, 3):
        raise ValueError(f"rotation: expected shape (3, 3) or (4,), got {array.shape}")
    off = float(np.abs(array @ array.T - np.eye(3)).max())
    if off > _ROTATION_TOLERANCE or np.linalg.det(array) < 0:
        raise ValueError(
            "rotation: expected a rotation matrix; its columns are not at right angles, not of "
            "length 1, or mirror"
        )
    # The largest of the four squares first (Shepperd 1978): no division by a small number.
    trace = float(np.trace(array))
    squares = np.array([trace, array[0, 0], array[1, 1], array[2, 2]])
    largest = int(squares.argmax())
    if largest == 0:
        axial = [array[2, 1] - array[1, 2], array[0, 2] - array[2, 0], array[1, 0] - array[0, 1]]
        parts = np.array([1 + trace, *axial])
    else:
        i = largest - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        parts = np.empty(4)
        parts[0] = array[k, j] - array[j, k]
        parts[1 + i] = 1 + 2 * array[i, i] - trace
        parts[1 + j] = array[j, i] + array[i, j]
        parts[1 + k] = array[k, i] + array[i, k]
    w, x, y, z = (float(entry) for entry in parts / np.linalg.norm(parts))
    return w, x, y, z
