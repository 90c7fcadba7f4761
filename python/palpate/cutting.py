"""Cuts: blades, what a cut did, and where the nodes and tetrahedra of a changed mesh come from."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from palpate import _arrays, _core
from palpate._arrays import Float64Array, IndexArray
from palpate.mesh import Mesh

_Scalar = TypeVar("_Scalar", bound=np.generic)


class Blade:
    """A surface that cuts what it passes through; it may be open or closed, bent, in parts.

    Parameters
    ----------
    points : (n, 3)
        [m]
    triangles : (m, 3) integers
        Corners of each triangle.

    Raises
    ------
    ValueError
        If the arrays make no blade; the message names the index.

    Examples
    --------
    >>> import palpate
    >>> simulation = palpate.Simulation("small")
    >>> report = simulation.cut(palpate.Blade.plane([0.0, 0, 0], [1, 0, 0]))
    >>> len(report) > 0
    True
    """

    __slots__ = ("_core",)

    def __init__(self, points: npt.ArrayLike, triangles: npt.ArrayLike) -> None:
        self._core = _core.Blade(
            _arrays.points(points, "points"), _arrays.indices(triangles, "triangles", 3)
        )

    @classmethod
    def _from_core(cls, core: _core.Blade) -> Blade:
        blade = cls.__new__(cls)
        blade._core = core
        return blade

    @classmethod
    def stroke(cls, edges: npt.ArrayLike) -> Blade:
        """The strip that an edge, as of a scalpel, sweeps from each of its places to the next.

        Parameters
        ----------
        edges : (n, 2, 3)
            The two ends of the edge [m] at n places, at least two.
        """
        array = np.asarray(edges)
        if array.ndim != 3 or array.shape[1:] != (2, 3):
            raise ValueError(f"edges: expected shape (n, 2, 3), got {array.shape}")
        flat = _arrays.points(array.reshape(-1, 3), "edges")
        return cls._from_core(_core.Blade.stroke(flat.reshape(-1, 2, 3)))

    @classmethod
    def plane(cls, point: npt.ArrayLike, normal: npt.ArrayLike, size: float | None = None) -> Blade:
        """The square of edge length ``size`` [m] around a point, or the whole plane without one."""
        length = None if size is None else _arrays.scalar(size, "size")
        at, across = _arrays.vector(point, "point"), _arrays.vector(normal, "normal")
        return cls._from_core(_core.Blade.plane(at, across, length))

    @classmethod
    def loop(cls, points: npt.ArrayLike) -> Blade:
        """The surface that a closed line (n, 3) [m] spans; the last point joins the first."""
        return cls._from_core(_core.Blade.closed_loop(_arrays.points(points, "points")))

    @property
    def points(self) -> Float64Array:
        """Points [m], shape (n, 3); none for a whole plane."""
        return self._core.points

    @property
    def triangles(self) -> IndexArray:
        """Corners of the triangles, shape (m, 3); none for a whole plane."""
        return self._core.triangles

    def __repr__(self) -> str:
        return f"Blade({len(self.points)} points, {len(self.triangles)} triangles)"


class Stroke(NamedTuple):
    """A stroke of a file: at ``time`` [s] or before ``step`` (from 0), the other being None."""

    time: float | None
    step: int | None
    blade: Blade
    line: int


def read_blades(path: str | os.PathLike[str]) -> list[Stroke]:
    """Read a file of blade strokes, as `palpate simulate --cut` takes it.

    Raises
    ------
    ValueError
        If the text is not in the format or a stroke makes no blade; the message names the line.
    OSError
        If the file cannot be opened.
    """
    return [
        Stroke(time, step, Blade._from_core(core), line)
        for time, step, core, line in _core.read_blades(os.fspath(path))
    ]


@dataclass(frozen=True, eq=False)
class MeshChange:
    """A mesh after a cut or a removal, and what in it was what before.

    ``node_origins`` (n, 4) and ``node_weights`` (n, 4): each node of the new ``mesh`` is this
    affine combination of nodes of the old one; a node that stayed is itself with weight 1.
    ``tetrahedra`` (m,) names the old tetrahedron that each new one is, or is a part of.
    """

    mesh: Mesh
    node_origins: IndexArray
    node_weights: Float64Array
    tetrahedra: IndexArray

    @classmethod
    def _from_core(cls, row: Any) -> MeshChange:
        core, origins, weights, tetrahedra = row
        return cls(Mesh._from_core(core), origins, weights, tetrahedra)

    def at_nodes(self, values: npt.ArrayLike) -> Float64Array:
        """Values at the old nodes, shape (n_old, ...), at the new ones."""
        array = np.asarray(values, dtype=np.float64)
        weights = self.node_weights.reshape(self.node_weights.shape + (1,) * (array.ndim - 1))
        result: Float64Array = (weights * array[self.node_origins]).sum(axis=1)
        return result

    def at_tetrahedra(self, values: npt.NDArray[_Scalar]) -> npt.NDArray[_Scalar]:
        """Values of the old tetrahedra, shape (m_old, ...), of the new ones."""
        return np.asarray(values)[self.tetrahedra]

    def __repr__(self) -> str:
        return f"MeshChange(to {self.mesh!r})"


@dataclass(frozen=True, eq=False)
class BodyCut:
    """What a cut did to a body.

    ``body`` is its index, ``change`` its mesh now and where that comes from. ``new_nodes`` and
    ``new_tetrahedra`` were added, ``split_tetrahedra`` old ones were divided, and the cut passes
    through ``snapped_nodes`` near the blade, at most ``deviation`` [m] beside it. The body was in
    ``pieces_before`` pieces and is in ``pieces``. ``smallest_quality`` is the smallest radius ratio
    of the parts (1 is regular, None when none was split), ``volume_change`` relative, at rest;
    ``cut_area`` [m²] that of one lip. ``released`` counts springs whose node has gone.
    """

    body: int
    change: MeshChange
    new_nodes: int
    new_tetrahedra: int
    split_tetrahedra: int
    snapped_nodes: int
    pieces_before: int
    pieces: int
    smallest_quality: float | None
    volume_change: float
    cut_area: float
    deviation: float
    released: int = 0


@dataclass(frozen=True, eq=False)
class CutReport:
    """What a cut did: the bodies that it changed, and the seconds that its stages took."""

    bodies: tuple[BodyCut, ...]
    times: dict[str, float]

    def __len__(self) -> int:
        return len(self.bodies)


@dataclass(frozen=True, eq=False)
class RemovalReport:
    """What a removal did to ``body``, and the seconds that its stages took."""

    body: int
    change: MeshChange
    released: int
    times: dict[str, float]


def as_blade(value: Any) -> Blade:
    """``value`` if it is a blade."""
    if not isinstance(value, Blade):
        raise TypeError(f"blade: expected a palpate.Blade, got {type(value).__name__}")
    return value


def cut_options(
    snap: float | None,
    min_quality: float | None,
    min_edge: float | None,
    min_piece: float | None,
) -> tuple[float | None, float | None, float | None, float | None]:
    """Options as the core takes them."""

    def number(value: float | None, name: str) -> float | None:
        return None if value is None else _arrays.scalar(value, name)

    return (
        number(snap, "snap"),
        number(min_quality, "min_quality"),
        number(min_edge, "min_edge"),
        number(min_piece, "min_piece"),
    )


def chosen(tetrahedra: npt.ArrayLike, count: int) -> Sequence[int]:
    """Indices, or a mask of ``count`` booleans, as indices from 0."""
    array = np.asarray(tetrahedra)
    if array.dtype == bool:
        if array.shape != (count,):
            raise ValueError(f"tetrahedra: expected a mask of shape ({count},), got {array.shape}")
        array = np.flatnonzero(array)
    indices = _arrays.indices(array, "tetrahedra", None)
    if indices.size and not 0 <= indices.min() <= indices.max() < count:
        wrong = int(indices[(indices < 0) | (indices >= count)][0])
        raise IndexError(f"tetrahedra: index {wrong} is out of range, there are {count}")
    return [int(index) for index in indices]
