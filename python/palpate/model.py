"""The model: bodies placed in space, as a model file or Python describes them."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate import _arrays, _core, files
from palpate.errors import MeshError
from palpate.mesh import Mesh, as_mesh

#: Example models that travel with the package, by name.
MODELS = Path(__file__).parent / "models"


@dataclass(frozen=True)
class Material:
    """Material of a body or a region; the defaults are a generic soft organ.

    ``law`` is one of ``linear``, ``corotated``, ``stvk``, ``neo-hookean``, ``mooney-rivlin``,
    ``hgo``. ``young`` [Pa] and ``poisson`` in (-1, 0.5) are those of small strain, ``density``
    [kg/m³]. ``damping`` [s] is Rayleigh's, proportional to stiffness, and the viscosity of the
    nonlinear laws; ``mass_damping`` [1/s] is proportional to mass.

    ``mooney``, 0 to 1, is the share of the second invariant in ``mooney-rivlin``. ``k1`` [Pa],
    ``k2`` and the dispersion ``kappa``, 0 to 1/3, are those of the fibres of ``hgo``; ``fibre``
    and ``fibre_2`` their directions, None for those of the mesh.
    """

    law: str = "linear"
    young: float = 5_000.0
    poisson: float = 0.45
    density: float = 1_000.0
    damping: float = 0.01
    mass_damping: float = 0.0
    mooney: float = 0.2
    k1: float = 2363.2
    k2: float = 0.8393
    kappa: float = 0.0
    fibre: tuple[float, float, float] | None = None
    fibre_2: tuple[float, float, float] | None = None

    @classmethod
    def _of(cls, row: _core._Material) -> Material:
        law, values, fibre, fibre_2 = row
        numbers: dict[str, Any] = dict(zip(_PARAMETERS, values, strict=True))
        return cls(law, fibre=fibre, fibre_2=fibre_2, **numbers)

    def _row(self, name: str) -> _core._Material:
        return (
            _arrays.instance(self.law, f"{name}: law", str),
            [_arrays.number(getattr(self, each), f"{name}: {each}") for each in _PARAMETERS],
            None if self.fibre is None else _arrays.vector(self.fibre, f"{name}: fibre"),
            None if self.fibre_2 is None else _arrays.vector(self.fibre_2, f"{name}: fibre_2"),
        )


#: The numbers among the fields of `Material`, in the order of the core.
_PARAMETERS = tuple(each.name for each in fields(Material))[1:-2]


@dataclass(frozen=True)
class Contact:
    """Contact parameters of a body.

    ``friction`` is Coulomb's coefficient; surfaces closer than ``distance`` [m] push each other
    apart with ``stiffness`` [Pa/m]; None derives both from the mesh and the material.
    """

    friction: float = 0.0
    distance: float | None = None
    stiffness: float | None = None
    self_contact: bool = True

    def _row(self, name: str) -> _core._Contact:
        distance, stiffness = (
            None if value is None else _arrays.number(value, f"{name}: {what}")
            for what, value in (("distance", self.distance), ("stiffness", self.stiffness))
        )
        return (
            _arrays.number(self.friction, f"{name}: friction"),
            distance,
            stiffness,
            bool(self.self_contact),
        )


@dataclass(frozen=True)
class RigidKey:
    """Pose of a rigid body at ``time`` [s], relative to its placement.

    ``translation`` [m] of, and ``rotation`` (unit quaternion, real part first) about, the place of
    the mesh file's origin.
    """

    time: float
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def _row(self, name: str) -> _core._Key:
        rotation = np.asarray(_arrays.sequence(self.rotation, f"{name}: rotation", "4 numbers"))
        if rotation.shape != (4,) or rotation.dtype.kind not in "fiu":
            raise ValueError(
                f"{name}: rotation: expected a quaternion, 4 numbers, got {self.rotation!r}"
            )
        w, x, y, z = (float(entry) for entry in rotation)
        return (
            _arrays.number(self.time, f"{name}: time"),
            _arrays.vector(self.translation, f"{name}: translation"),
            (w, x, y, z),
        )


@dataclass(frozen=True, eq=False)
class Body:
    """One object of a model: a mesh in its place, and how it behaves.

    ``rigid`` is None for a deformable body, otherwise the keys of its motion; no keys: it is
    fixed. ``fixed_nodes`` are held in place. ``processor`` is the paper's PE, None when the body is
    assigned automatically. ``regions`` maps region numbers of the mesh to materials of their own
    (damping is the body's). ``color`` (red, green, blue in 0..1) and ``opacity`` are for pictures.
    """

    mesh: Mesh
    name: str = "body"
    material: Material = field(default_factory=Material)
    regions: Mapping[int, Material] = field(default_factory=dict)
    fixed_nodes: npt.ArrayLike = ()
    rigid: Sequence[RigidKey] | None = None
    contact: Contact = field(default_factory=Contact)
    processor: int | None = None
    initial_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    color: tuple[float, float, float] | None = None
    opacity: float = 1.0

    def _to_core(self) -> _core.Body:
        label = f'body "{self.name}"'
        as_mesh(self.mesh, f"{label}: mesh")
        regions = _arrays.mapping(self.regions, f"{label}: regions")
        return _core.Body(
            str(self.name),
            self.mesh._core,
            _arrays.instance(self.material, f"{label}: material", Material)._row(label),
            {
                _region(region, label): _arrays.instance(
                    material, f"{label}: regions[{region!r}]", Material
                )._row(f"{label}: region {region}")
                for region, material in regions.items()
            },
            _arrays.indices(self.fixed_nodes, f"{label}: fixed_nodes", None),
            None if self.rigid is None else _keys(self.rigid, f"{label}: rigid"),
            _arrays.instance(self.contact, f"{label}: contact", Contact)._row(label),
            None if self.processor is None else _processor(self.processor, f"{label}: processor"),
            _arrays.vector(self.initial_velocity, f"{label}: initial_velocity"),
            None if self.color is None else _arrays.vector(self.color, f"{label}: color"),
            _arrays.number(self.opacity, f"{label}: opacity"),
        )

    @classmethod
    def _from_core(cls, core: _core.Body) -> Body:
        keys = core.rigid
        return cls(
            mesh=Mesh._from_core(core.mesh),
            name=core.name,
            material=Material._of(core.material),
            regions={region: Material._of(row) for region, row in core.regions.items()},
            fixed_nodes=core.fixed_nodes,
            rigid=None if keys is None else tuple(RigidKey(*key) for key in keys),
            contact=Contact(*core.contact),
            processor=core.processor,
            initial_velocity=core.initial_velocity,
            color=core.color,
            opacity=core.opacity,
        )

    def __repr__(self) -> str:
        kind = "deformable" if self.rigid is None else "rigid"
        return f"Body({self.name!r}, {kind}, {self.mesh!r})"


def _region(number: Any, label: str) -> int:
    name = f"{label}: regions: number of a region"
    region = _arrays.count(number, name, minimum=-(2**31))
    if region >= 2**31:
        raise ValueError(f"{name}: expected an integer below 2**31, got {region}")
    return region


def _processor(number: Any, name: str) -> int:
    processor = _arrays.count(number, name, minimum=0)
    if processor >= 2**32:
        raise ValueError(f"{name}: expected an integer below 2**32, got {processor}")
    return processor


def _keys(rigid: Any, name: str) -> list[_core._Key]:
    keys = _arrays.sequence(rigid, name, "RigidKeys, or () for a fixed body")
    return [
        _arrays.instance(key, f"{name}[{index}]", RigidKey)._row(f"{name}[{index}]")
        for index, key in enumerate(keys)
    ]


@dataclass(frozen=True, eq=False)
class Attachment:
    """Two bodies tied together where they touch in the model, as by a ligament.

    The surface nodes of ``first`` within ``within`` [m] of the surface of ``second`` are tied to
    it (default: half the mean surface edge of ``first``) with ``stiffness`` [Pa/m] (default: that
    of contact between the two). Bodies are given by index or name. When ``first`` is rigid the two
    change places. ``nodes`` (m,) are the tied nodes of a model's attachment.
    """

    first: int | str
    second: int | str
    within: float | None = None
    stiffness: float | None = None
    nodes: npt.NDArray[np.int32] | None = None


@dataclass(frozen=True)
class TreeElement:
    """An element of the upper binary tree: ``CE`` joins two subtrees, ``NE`` is a body."""

    kind: str
    body: int | None
    children: tuple[TreeElement, ...]

    @classmethod
    def _from_core(cls, structure: Any) -> TreeElement:
        if isinstance(structure, int):
            return cls("NE", structure, ())
        return cls("CE", None, tuple(cls._from_core(child) for child in structure))


class Model:
    """Bodies, how they are joined, and gravity.

    Parameters
    ----------
    bodies : iterable of Body or Mesh
        At least one. Names are made unique with ``_2``, ``_3``; a mesh alone is ``body_1`` and so
        on.
    gravity : three numbers
        [m/s²]
    attachments : iterable of Attachment
        Bodies that are tied together.
    """

    __slots__ = ("__dict__", "_core")

    def __init__(
        self,
        bodies: Iterable[Body | Mesh],
        *,
        gravity: Sequence[float] = (0.0, 0.0, -9.81),
        attachments: Iterable[Attachment] = (),
    ) -> None:
        if isinstance(bodies, (Body, Mesh)):
            bodies = [bodies]
        items = _arrays.sequence(bodies, "bodies", "palpate.Body or palpate.Mesh objects")
        cores: list[_core.Body] = []
        names: list[str] = []
        for index, item in enumerate(items):
            if isinstance(item, Mesh):
                item = Body(item, name=f"body_{index + 1}")
            if not isinstance(item, Body):
                raise TypeError(
                    f"bodies[{index}]: expected a palpate.Body or palpate.Mesh, "
                    f"got {type(item).__name__}"
                )
            name = unique_name(str(item.name), names)
            cores.append((item if name == item.name else replace(item, name=name))._to_core())
            names.append(name)
        ties = []
        given = _arrays.sequence(attachments, "attachments", "palpate.Attachment objects")
        for index, each in enumerate(given):
            if not isinstance(each, Attachment):
                raise TypeError(
                    f"attachments[{index}]: expected a palpate.Attachment, "
                    f"got {type(each).__name__}"
                )
            reach, stiffness = (
                None if value is None else _arrays.scalar(value, f"attachments[{index}]: {name}")
                for name, value in (("within", each.within), ("stiffness", each.stiffness))
            )
            pair = (body_index(names, each.first), body_index(names, each.second))
            ties.append((*pair, reach, stiffness))
        self._core = _core.Model(cores, _arrays.vector(gravity, "gravity"), ties)

    @classmethod
    def _from_core(cls, core: _core.Model) -> Model:
        model = cls.__new__(cls)
        model._core = core
        return model

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """The bodies, placed, in the order of their TREE blocks."""
        return tuple(Body._from_core(core) for core in self._core.bodies)

    @property
    def gravity(self) -> tuple[float, float, float]:
        """Acceleration of gravity [m/s²]."""
        return self._core.gravity

    @cached_property
    def tree(self) -> TreeElement:
        """The upper binary tree (CE and NE) that the text's BRANCH and TREE blocks make."""
        return TreeElement._from_core(self._core.structure)

    @property
    def attachments(self) -> tuple[Attachment, ...]:
        """Bodies that are tied together, with the tied nodes."""
        names = [body.name for body in self.bodies]
        return tuple(
            Attachment(names[first], names[second], stiffness=stiffness, nodes=nodes)
            for first, second, stiffness, nodes in self._core.attachments
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What reading the meshes left out or changed."""
        return tuple(self._core.notes)

    def to_text(self) -> str:
        """The model in canonical form of the model language.

        Raises
        ------
        ValueError
            If the model was made from arrays: it has no text.
        """
        return self._core.to_text()

    def body_index(self, body: int | str) -> int:
        """Index of a body given by index (negative from the end) or name."""
        return body_index([each.name for each in self.bodies], body)

    def __repr__(self) -> str:
        names = ", ".join(body.name for body in self.bodies)
        return f"Model({len(self.bodies)} bodies: {names})"


def unique_name(name: str, names: Sequence[str]) -> str:
    """The name, with ``_2``, ``_3`` and so on where it is among ``names`` already."""
    candidate, number = name, 1
    while candidate in names:
        number += 1
        candidate = f"{name}_{number}"
    return candidate


def body_index(names: Sequence[str], body: int | str) -> int:
    """Index of a body given by index (negative from the end) or name."""
    if isinstance(body, str):
        if body not in names:
            raise ValueError(f"body: no body is named {body!r}; there are {', '.join(names)}")
        return names.index(body)
    if isinstance(body, bool) or not isinstance(body, (int, np.integer)):
        raise TypeError(f"body: expected an index or a name, got {type(body).__name__}")
    index = int(body)
    if not -len(names) <= index < len(names):
        raise IndexError(f"body: index {index} is out of range, there are {len(names)} bodies")
    return index % len(names)


def find_model(model: str | os.PathLike[str]) -> Path:
    """Path of a model file given by path or by the name of a bundled one."""
    path = Path(model)
    bundled = MODELS / f"{model}.bml"
    if not path.exists() and path.suffix == "" and bundled.exists():
        return bundled
    if not path.exists():
        names = ", ".join(sorted(each.stem for each in MODELS.glob("*.bml")))
        raise FileNotFoundError(
            2, f"No such model file, and no bundled model of that name ({names})", str(path)
        )
    return path


def read_model(path: str | os.PathLike[str], *, repair: bool = False) -> Model:
    """Read a model file (``.bml``) or a bundled model by its name.

    Meshes named by NE may have any format that `read_mesh` reads.

    Parameters
    ----------
    path : path-like
        The file, or the name of a bundled model such as ``"case1"``.
    repair : bool
        Mend inverted tetrahedra and the like in the meshes instead of refusing them.

    Raises
    ------
    ModelError
        With ``.path``, ``.line`` and ``.column`` of the first finding; its text shows all.
    OSError
        If the file cannot be opened.
    """

    def load(mesh_path: str) -> tuple[_core.Mesh, list[str]]:
        try:
            mesh = files.read_mesh(mesh_path, repair=repair)
        except OSError as error:
            raise MeshError(f"{mesh_path}: {error.strerror or error}", mesh_path) from None
        return mesh._core, list(mesh.notes)

    return Model._from_core(_core.load_model(str(find_model(path)), load))
