"""A hundred wrong inputs: the exact error of each; the objects work on and are as they were."""

import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import CUBE_NODES, CUBE_TETRAHEDRA, box

import palpate

CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


@dataclass
class World:
    """What a wrong input is tried on."""

    mesh: palpate.Mesh
    scene: palpate.Scene
    simulation: palpate.Simulation
    pull: palpate.Pull
    drive: palpate.Drive
    folder: Path

    def file(self, name: str, content: str | bytes) -> Path:
        path = self.folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    def state(self) -> list[bytes]:
        arrays = [
            *self.simulation.positions,
            *self.simulation.velocities,
            *(self.scene.positions(body) for body in range(len(self.scene))),
            self.mesh.nodes,
            self.pull.target,
            self.drive.targets,
        ]
        fixed = [np.asarray(body.fixed_nodes) for body in self.simulation.model.bodies]
        parts = [array.tobytes() for array in [*arrays, *fixed]]
        return [*parts, repr((self.simulation.time, self.scene.names, self.pull)).encode()]

    def works(self) -> None:
        assert len(self.scene.intersections()) > 0
        self.simulation.step()
        assert np.isfinite(np.concatenate(self.simulation.positions)).all()


@pytest.fixture
def world(tmp_path: Path) -> World:
    return make_world(tmp_path)


def make_world(folder: Path) -> World:
    mesh = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA, node_sets={"low": [0, 2]})
    scene = palpate.Scene([mesh, mesh.with_nodes(mesh.nodes + 0.5)])
    soft = palpate.Body(box((2, 2, 1), size=0.1, origin=(0, 0, 0.02)), name="soft")
    plate = palpate.Mesh(
        [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], triangles=[[0, 1, 2], [0, 2, 3]]
    )
    simulation = palpate.Simulation([soft, palpate.Body(plate, name="plate", rigid=())])
    pull = simulation.pull("soft", 3, [0, 0, 0.2], 5.0)
    drive = simulation.drive("soft", [0, 1], simulation.positions[0][:2])
    return World(mesh, scene, simulation, pull, drive, folder)


def seg(text: str) -> Callable[[World], Any]:
    return lambda world: palpate.read_mesh(world.file("mesh.seg", text))


def vtk(text: str | bytes) -> Callable[[World], Any]:
    return lambda world: palpate.read_mesh(world.file("mesh.vtk", text))


def grid(text: str) -> Callable[[World], Any]:
    head = "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
    return vtk(head + text)


def model(text: str | bytes) -> Callable[[World], Any]:
    def read(world: World) -> Any:
        palpate.write_mesh(world.folder / "cube.seg", world.mesh)
        return palpate.read_model(world.file("model.bml", text))

    return read


def blade(text: str) -> Callable[[World], Any]:
    return lambda world: palpate.read_blades(world.file("cut.blade", text))


def checkpoint(change: Callable[[bytes], bytes]) -> Callable[[World], Any]:
    def load(world: World) -> Any:
        path = world.folder / "run.palpate"
        world.simulation.save(path)
        path.write_bytes(change(path.read_bytes()))
        return palpate.Simulation.load(path)

    return load


def mesh(*arguments: Any, **options: Any) -> Callable[[World], Any]:
    return lambda _: palpate.Mesh(*arguments, **options)


def soft(**settings: Any) -> Callable[[World], Any]:
    def start(world: World) -> Any:
        return palpate.Simulation([palpate.Body(world.mesh, name="cube", **settings)])

    return start


def positions(world: World, *, count: int = 8, at: int | None = None, value: float = 0.0) -> Any:
    array = np.zeros((count, 3))
    if at is not None:
        array[at, 1] = value
    return [world.mesh.nodes, array]


NAN, INF = float("nan"), float("inf")
UNIT = palpate.Blade.plane([0, 0, 0], [1, 0, 0])

#: Name, what is done, the error, its text; {folder} is the folder of the test.
TABLE: list[tuple[str, Callable[[World], Any], type[Exception], str]] = [
    (
        "seg-empty",
        seg(""),
        palpate.MeshError,
        "{folder}/mesh.seg:1: the file is empty; expected `seg 1`",
    ),
    (
        "seg-other-format",
        seg("solid cube"),
        palpate.MeshError,
        "{folder}/mesh.seg:1: expected `seg 1` at the start, found `solid`",
    ),
    (
        "seg-version",
        seg("seg 2"),
        palpate.MeshError,
        "{folder}/mesh.seg:1: version 2 of .seg is not known; this reads version 1",
    ),
    (
        "seg-no-count",
        seg("seg 1 nodes many"),
        palpate.MeshError,
        "{folder}/mesh.seg:1: `nodes`: expected how many follow, found `many`",
    ),
    (
        "seg-too-few-coordinates",
        seg("seg 1\nnodes 2\n0 0 0\n0 0"),
        palpate.MeshError,
        "{folder}/mesh.seg:4: node 1 of 2: expected a coordinate, found the end of the file",
    ),
    (
        "seg-too-many-coordinates",
        seg("seg 1\nnodes 1\n0 0 0 7\n"),
        palpate.MeshError,
        "{folder}/mesh.seg:3: expected a section (nodes, tetrahedra, triangles, regions, "
        "fibres, fibres_2, set) or the end of the file, found `7`; `nodes` announces "
        "fewer values",
    ),
    (
        "seg-lying-count",
        seg("seg 1\nnodes 4000000000\n0 0 0"),
        palpate.MeshError,
        "{folder}/mesh.seg:3: node 1 of 4000000000: expected a coordinate, found the end "
        "of the file",
    ),
    (
        "seg-nan",
        seg("seg 1\nnodes 4\n0 0 0\n1 nan 0\n0 1 0\n0 0 1\ntetrahedra 1\n0 1 2 3"),
        palpate.MeshError,
        "{folder}/mesh.seg:4: node 1: position (1, NaN, 0) is not finite; give "
        "coordinates in metres",
    ),
    (
        "seg-index",
        seg("seg 1\nnodes 4\n0 0 0 1 0 0 0 1 0 0 0 1\ntetrahedra 1\n0 1 2 4"),
        palpate.MeshError,
        "{folder}/mesh.seg:5: tetrahedron 0: node index 4 is out of range (the mesh has "
        "4 nodes, counted from 0)",
    ),
    (
        "seg-negative-index",
        seg("seg 1\nnodes 4\n0 0 0 1 0 0 0 1 0 0 0 1\ntetrahedra 1\n0 1 2 -1"),
        palpate.MeshError,
        "{folder}/mesh.seg:5: tetrahedron 0 of 1: expected a node index, found `-1`",
    ),
    (
        "seg-inverted",
        seg("seg 1\nnodes 4\n0 0 0 1 0 0 0 1 0 0 0 1\ntetrahedra 1\n0 2 1 3"),
        palpate.MeshError,
        "{folder}/mesh.seg:5: 1 tetrahedron is inverted (negative volume): 0; repair "
        "re-orients them",
    ),
    (
        "seg-flat",
        seg("seg 1\nnodes 4\n0 0 0 1 0 0 0 1 0 1 1 0\ntetrahedra 1\n0 1 2 3"),
        palpate.MeshError,
        "{folder}/mesh.seg:5: 1 tetrahedron is flat (zero volume): 0; repair drops them",
    ),
    (
        "seg-twice",
        seg("seg 1\nnodes 4\n0 0 0 1 0 0 0 1 0 0 0 1\ntetrahedra 2\n0 1 2 3\n1 2 0 3"),
        palpate.MeshError,
        "{folder}/mesh.seg:6: 1 tetrahedron has the same four nodes as an earlier one: "
        "1; repair drops them",
    ),
    (
        "seg-second-nodes",
        seg("seg 1\nnodes 0\nnodes 0"),
        palpate.MeshError,
        "{folder}/mesh.seg:3: a second `nodes` section; a mesh has one",
    ),
    (
        "seg-regions-first",
        seg("seg 1\nregions 1"),
        palpate.MeshError,
        "{folder}/mesh.seg:2: `regions` has one number for each tetrahedron: give "
        "`tetrahedra` first",
    ),
    (
        "seg-second-set",
        seg("seg 1\nset a 0\nset a 0"),
        palpate.MeshError,
        "{folder}/mesh.seg:3: a second set `a`; give each name once",
    ),
    (
        "seg-no-elements",
        seg("seg 1 nodes 1 0 0 0"),
        palpate.MeshError,
        "{folder}/mesh.seg: the mesh has neither tetrahedra nor triangles; give one of them",
    ),
    (
        "seg-binary",
        lambda world: palpate.read_mesh(world.file("mesh.seg", b"seg 1 nodes \xff\xfe")),
        palpate.MeshError,
        "{folder}/mesh.seg:1: this is no text file: found bytes that are not UTF-8",
    ),
    (
        "file-missing",
        lambda world: palpate.read_mesh(world.folder / "none.seg"),
        FileNotFoundError,
        "[Errno 2] No such file or directory: '{folder}/none.seg'",
    ),
    (
        "file-folder",
        lambda world: palpate.read_mesh(world.folder),
        IsADirectoryError,
        "[Errno 21] Is a directory: '{folder}'",
    ),
    (
        "file-unknown",
        lambda world: palpate.read_mesh(world.file("mesh.xyz", "0 0 0")),
        palpate.MeshError,
        "{folder}/mesh.xyz: .xyz is no mesh format known here; use .seg, .vtk or one of "
        "meshio's, such as .msh, .vtu, .stl",
    ),
    (
        "vtk-header",
        vtk("solid cube"),
        palpate.MeshError,
        "{folder}/mesh.vtk:1: expected `# vtk DataFile Version 4.2` at the start, found "
        "`solid cube`",
    ),
    (
        "vtk-xml",
        vtk('<?xml version="1.0"?>'),
        palpate.MeshError,
        "{folder}/mesh.vtk:1: expected `# vtk DataFile Version 4.2` at the start, found "
        '`<?xml version="1.0"?>`; this is VTK\'s XML format, which belongs in a .vtu file',
    ),
    (
        "vtk-version",
        vtk("# vtk DataFile Version 9.0\nt\nASCII\n"),
        palpate.MeshError,
        "{folder}/mesh.vtk:1: version `9.0` of legacy .vtk is not known; this reads 1.0 to 5.1",
    ),
    (
        "vtk-encoding",
        vtk("# vtk DataFile Version 3.0\nt\nUTF-8\n"),
        palpate.MeshError,
        "{folder}/mesh.vtk:3: expected ASCII or BINARY, found `UTF-8`",
    ),
    (
        "vtk-dataset",
        vtk("# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_GRID\n"),
        palpate.MeshError,
        "{folder}/mesh.vtk:4: expected UNSTRUCTURED_GRID or POLYDATA, found "
        "`STRUCTURED_GRID`; other datasets have no tetrahedra",
    ),
    (
        "vtk-no-points",
        grid(""),
        palpate.MeshError,
        "{folder}/mesh.vtk: the file has no POINTS section",
    ),
    (
        "vtk-lying-count",
        grid("POINTS 9999999999 float\n0 0 0"),
        palpate.MeshError,
        "{folder}/mesh.vtk:6: point 1 of 9999999999: expected a number, found the end of the file",
    ),
    (
        "vtk-type",
        grid("POINTS 1 quaternion\n0 0 0"),
        palpate.MeshError,
        "{folder}/mesh.vtk:5: expected a data type such as `double`, found `quaternion`",
    ),
    (
        "vtk-cell-types",
        grid(
            "POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 2\n10 10\n"
        ),
        palpate.MeshError,
        "{folder}/mesh.vtk: 2 cell types for 1 cells; give one for each",
    ),
    (
        "vtk-no-solid",
        grid("POINTS 2 float\n0 0 0 1 0 0\nCELLS 1 3\n2 0 1\nCELL_TYPES 1\n3\n"),
        palpate.MeshError,
        "{folder}/mesh.vtk: the mesh has neither tetrahedra nor triangles; give one of them",
    ),
    (
        "vtk-cut-off",
        vtk(
            b"# vtk DataFile Version 3.0\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 2 double\n"
            + struct.pack(">3d", 0, 0, 0)
        ),
        palpate.MeshError,
        "{folder}/mesh.vtk: the file ends in the middle of binary data",
    ),
    (
        "write-unknown",
        lambda world: palpate.write_mesh(world.folder / "mesh", world.mesh),
        palpate.MeshError,
        "{folder}/mesh: a name without extension is no mesh format known here; use .seg, "
        ".vtk or one of meshio's, such as .msh, .vtu, .stl",
    ),
    (
        "write-no-folder",
        lambda world: palpate.write_mesh(world.folder / "none" / "mesh.seg", world.mesh),
        FileNotFoundError,
        "[Errno 2] No such file or directory: '{folder}/none/mesh.seg'",
    ),
    (
        "write-set-name",
        lambda world: palpate.write_mesh(
            world.folder / "mesh.seg", palpate.Mesh(CORNERS, [[0, 1, 2, 3]], node_sets={"a b": [0]})
        ),
        palpate.MeshError,
        '{folder}/mesh.seg: node set "a b": a name in a .seg file has no blanks, commas '
        "or `//`; rename it",
    ),
    (
        "model-empty",
        model(""),
        palpate.ModelError,
        "error: {folder}/model.bml: expected BRANCH or TREE, found the end of the file\n"
        " |\n"
        " = help: a model is one block: TREE{ NE kidney.seg }, or a BRANCH of several TREEs",
    ),
    (
        "model-not-text",
        model(b"TREE{ NE \xff }"),
        palpate.ModelError,
        "error: {folder}/model.bml: this is no text file: it is not UTF-8",
    ),
    (
        "model-unknown-word",
        model("TREE{ NE cube.seg  MX{ young 1 } }"),
        palpate.ModelError,
        "error: unknown word `MX`\n"
        " --> {folder}/model.bml:1:20\n"
        "  |\n"
        "1 | TREE{ NE cube.seg  MX{ young 1 } }\n"
        "  |                    ^^\n"
        "  |\n"
        "  = help: expected one of ME, PE, NE, MT, FX, RG, CN, VE, IV",
    ),
    (
        "model-misspelt",
        model("TREE{ NE cube.seg  MT{ yuong 1 } }"),
        palpate.ModelError,
        "error: unknown word `yuong`\n"
        " --> {folder}/model.bml:1:24\n"
        "  |\n"
        "1 | TREE{ NE cube.seg  MT{ yuong 1 } }\n"
        "  |                        ^^^^^\n"
        "  |\n"
        "  = help: yuong: did you mean young?",
    ),
    (
        "model-not-closed",
        model("BRANCH{ TREE{ NE cube.seg }"),
        palpate.ModelError,
        "error: this bracket is never closed\n"
        " --> {folder}/model.bml:1:7\n"
        "  |\n"
        "1 | BRANCH{ TREE{ NE cube.seg }\n"
        "  |       ^",
    ),
    (
        "model-no-mesh",
        model("TREE{ PE 1 }"),
        palpate.ModelError,
        "error: this TREE names no object data\n"
        " --> {folder}/model.bml:1:1\n"
        "  |\n"
        "1 | TREE{ PE 1 }\n"
        "  | ^^^^\n"
        "  |\n"
        "  = help: write NE and its mesh file, such as NE kidney.seg",
    ),
    (
        "model-missing-mesh",
        model("TREE{\n  NE none.seg\n}"),
        palpate.ModelError,
        "error: {folder}/none.seg: No such file or directory\n"
        " --> {folder}/model.bml:2:6\n"
        "  |\n"
        "2 |   NE none.seg\n"
        "  |      ^^^^^^^^",
    ),
    (
        "model-young",
        model("TREE{ NE cube.seg  MT{ young -5 } }"),
        palpate.ModelError,
        "error: young must be greater than 0, found -5\n"
        " --> {folder}/model.bml:1:30\n"
        "  |\n"
        "1 | TREE{ NE cube.seg  MT{ young -5 } }\n"
        "  |                              ^^",
    ),
    (
        "model-poisson",
        model("TREE{ NE cube.seg  MT{ poisson 0.5 } }"),
        palpate.ModelError,
        "error: poisson must be greater than -1 and less than 0.5, found 0.5\n"
        " --> {folder}/model.bml:1:32\n"
        "  |\n"
        "1 | TREE{ NE cube.seg  MT{ poisson 0.5 } }\n"
        "  |                                ^^^",
    ),
    (
        "model-set",
        model("TREE{ NE cube.seg  FX{ set high } }"),
        palpate.ModelError,
        "error: the mesh has no node set `high`\n"
        " --> {folder}/model.bml:1:24\n"
        "  |\n"
        "1 | TREE{ NE cube.seg  FX{ set high } }\n"
        "  |                        ^^^\n"
        "  |\n"
        "  = help: the mesh has the sets low",
    ),
    (
        "model-same-name",
        model("BRANCH{ TREE a{ NE cube.seg } TREE a{ NE cube.seg } }"),
        palpate.ModelError,
        "error: a second TREE named `a`; names are unique\n"
        " --> {folder}/model.bml:1:36\n"
        "  |\n"
        "1 | BRANCH{ TREE a{ NE cube.seg } TREE a{ NE cube.seg } }\n"
        "  |                                    ^",
    ),
    (
        "model-missing",
        lambda world: palpate.read_model(world.folder / "none.bml"),
        FileNotFoundError,
        "[Errno 2] No such model file, and no bundled model of that name (case1, case2, "
        "paper1, paper2, small): '{folder}/none.bml'",
    ),
    (
        "model-not-bundled",
        lambda _: palpate.Simulation("liver"),
        FileNotFoundError,
        "[Errno 2] No such model file, and no bundled model of that name (case1, case2, "
        "paper1, paper2, small): 'liver'",
    ),
    (
        "blade-empty",
        blade(""),
        ValueError,
        "{folder}/cut.blade:1: a file of strokes begins with the line `blade 1`",
    ),
    (
        "blade-version",
        blade("blade 2\n"),
        ValueError,
        "{folder}/cut.blade:1: a file of strokes begins with the line `blade 1`",
    ),
    (
        "blade-no-stroke",
        blade("blade 1\n"),
        ValueError,
        "{folder}/cut.blade:1: no stroke; give at least one `stroke`, `plane` or `loop`",
    ),
    (
        "blade-kind",
        blade("blade 1\nslash at 0 s\n0 0 0 1 0 0\n"),
        ValueError,
        "{folder}/cut.blade:2: `slash` is no kind of cut: stroke, plane or loop",
    ),
    (
        "blade-when",
        blade("blade 1\nstroke at noon\n"),
        ValueError,
        "{folder}/cut.blade:2: say when: `stroke at 0.2 s` or `stroke at step 30`",
    ),
    (
        "blade-numbers",
        blade("blade 1\nplane at 0 s\n0 0 0 1 0\n"),
        ValueError,
        "{folder}/cut.blade:3: 5 numbers; expected 6 or 7 numbers: a point [m], a "
        "normal, and a size [m] if any",
    ),
    (
        "blade-word",
        blade("blade 1\nplane at 0 s\n0 0 zero 1 0 0\n"),
        ValueError,
        "{folder}/cut.blade:3: `zero` is no number",
    ),
    (
        "blade-inf",
        blade("blade 1\nplane at 0 s\n0 0 inf 1 0 0\n"),
        ValueError,
        "{folder}/cut.blade:3: `inf` is not finite",
    ),
    (
        "blade-normal",
        blade("blade 1\nplane at 0 s\n0 0 0 0 0 0\n"),
        ValueError,
        "{folder}/cut.blade:2: the normal [0.0, 0.0, 0.0] of the plane has no direction; "
        "give a vector of any length but 0",
    ),
    (
        "blade-one-edge",
        blade("blade 1\nstroke at 0 s\n0 0 0 1 0 0\n"),
        ValueError,
        "{folder}/cut.blade:2: 1 edges of the stroke are too few for a blade: give at least 2",
    ),
    (
        "blade-missing",
        lambda world: palpate.read_blades(world.folder / "none.blade"),
        FileNotFoundError,
        "[Errno 2] No such file or directory: '{folder}/none.blade'",
    ),
    (
        "checkpoint-empty",
        checkpoint(lambda _: b""),
        palpate.CheckpointError,
        "{folder}/run.palpate: not a palpate checkpoint: the file is too short",
    ),
    (
        "checkpoint-other",
        checkpoint(lambda whole: b"solid cube" + whole[10:]),
        palpate.CheckpointError,
        "{folder}/run.palpate: not a palpate checkpoint",
    ),
    (
        "checkpoint-version",
        checkpoint(lambda whole: whole[:8] + struct.pack("<I", 99) + whole[12:]),
        palpate.CheckpointError,
        "{folder}/run.palpate: checkpoint version 99, this palpate reads version {version}",
    ),
    (
        "checkpoint-cut-off",
        checkpoint(lambda whole: whole[:24]),
        palpate.CheckpointError,
        "{folder}/run.palpate: the checkpoint is damaged: 0 bytes of payload, expected {length}",
    ),
    (
        "checkpoint-bit",
        checkpoint(lambda whole: whole[:24] + bytes([whole[24] ^ 1]) + whole[25:]),
        palpate.CheckpointError,
        "{folder}/run.palpate: the checkpoint is damaged: its checksum does not match",
    ),
    (
        "checkpoint-missing",
        lambda world: palpate.Simulation.load(world.folder / "none.palpate"),
        FileNotFoundError,
        "[Errno 2] No such file or directory: '{folder}/none.palpate'",
    ),
    (
        "checkpoint-no-folder",
        lambda world: world.simulation.save(world.folder / "none" / "run.palpate"),
        FileNotFoundError,
        "[Errno 2] No such file or directory: '{folder}/none/run.palpate'",
    ),
    (
        "mesh-shape",
        mesh([[0, 0], [1, 0]], [[0, 1, 2, 3]]),
        ValueError,
        "nodes: expected shape (n, 3), got (2, 2)",
    ),
    (
        "mesh-dtype",
        mesh([["a", "b", "c"]], [[0, 1, 2, 3]]),
        TypeError,
        "nodes: expected numbers of shape (n, 3), got dtype <U1",
    ),
    (
        "mesh-complex",
        mesh(np.zeros((4, 3), dtype=complex), [[0, 1, 2, 3]]),
        TypeError,
        "nodes: expected numbers of shape (n, 3), got dtype complex128",
    ),
    (
        "mesh-ragged",
        mesh([[0, 0, 0], [1, 0]], [[0, 1, 2, 3]]),
        ValueError,
        "nodes: expected numbers of shape (n, 3), got a ragged sequence: give rows of "
        "the same length",
    ),
    (
        "mesh-objects",
        mesh([[None, 0, 0]], [[0, 1, 2, 3]]),
        TypeError,
        "nodes: expected numbers of shape (n, 3), got an array of Python objects",
    ),
    (
        "mesh-nan",
        mesh([[0, 0, 0], [1, 0, NAN], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]]),
        palpate.MeshError,
        "node 1: position (1, 0, NaN) is not finite; give coordinates in metres",
    ),
    (
        "mesh-inf",
        mesh([[0, 0, 0], [1, 0, INF], [0, 1, 0], [0, 0, 1]], [[0, 1, 2, 3]]),
        palpate.MeshError,
        "node 1: position (1, 0, inf) is not finite; give coordinates in metres",
    ),
    (
        "mesh-no-elements",
        mesh(CORNERS),
        palpate.MeshError,
        "the mesh has neither tetrahedra nor triangles; give one of them",
    ),
    (
        "mesh-both",
        mesh(CORNERS, [[0, 1, 2, 3]], [[0, 1, 2]]),
        ValueError,
        "triangles: the surface of tetrahedra is extracted; give tetrahedra or triangles",
    ),
    (
        "mesh-index",
        mesh(CORNERS, [[0, 1, 2, 4]]),
        palpate.MeshError,
        "tetrahedron 0: node index 4 is out of range (the mesh has 4 nodes, counted from 0)",
    ),
    (
        "mesh-negative-index",
        mesh(CORNERS, [[0, 1, 2, -1]]),
        ValueError,
        "tetrahedra: row 0 holds -1, expected a node index from 0",
    ),
    (
        "mesh-huge-index",
        mesh(CORNERS, [[0, 1, 2, 2**40]]),
        ValueError,
        "tetrahedra: row 0 holds 1099511627776, expected a node index from 0",
    ),
    (
        "mesh-float-index",
        mesh(CORNERS, [[0, 1, 2, 3.5]]),
        TypeError,
        "tetrahedra: expected integers of shape (m, 4), got dtype float64",
    ),
    (
        "mesh-columns",
        mesh(CORNERS, [[0, 1, 2]]),
        ValueError,
        "tetrahedra: expected shape (m, 4), got (1, 3)",
    ),
    (
        "mesh-same-node",
        mesh(CORNERS, [[0, 1, 2, 2]]),
        palpate.MeshError,
        "tetrahedron 0: node 2 is named twice; name different nodes",
    ),
    (
        "mesh-inverted",
        mesh(CORNERS, [[0, 2, 1, 3]]),
        palpate.MeshError,
        "1 tetrahedron is inverted (negative volume): 0; repair re-orients them",
    ),
    (
        "mesh-regions",
        mesh(CORNERS, [[0, 1, 2, 3]], regions=[1, 2]),
        palpate.MeshError,
        "2 region numbers for 1 tetrahedra; give one for each, or none",
    ),
    (
        "mesh-fibres",
        mesh(CORNERS, [[0, 1, 2, 3]], fibres=[[1, 0]]),
        ValueError,
        "fibres: expected shape (n, 3), got (1, 2)",
    ),
    (
        "mesh-fibre-nan",
        mesh(CORNERS, [[0, 1, 2, 3]], fibres=[[1, 0, NAN]]),
        palpate.MeshError,
        "the fibre direction of tetrahedron 0 is not finite; 0,0,0 is for none",
    ),
    (
        "mesh-set-index",
        mesh(CORNERS, [[0, 1, 2, 3]], node_sets={"low": [0, 9]}),
        palpate.MeshError,
        "set `low`: node index 9 is out of range (the mesh has 4 nodes)",
    ),
    (
        "mesh-moved-count",
        lambda world: world.mesh.with_nodes(np.zeros((7, 3))),
        ValueError,
        "nodes: expected shape (8, 3), got (7, 3)",
    ),
    (
        "mesh-moved-flat",
        lambda world: world.mesh.with_nodes(np.zeros((8, 3))),
        palpate.MeshError,
        "5 tetrahedra are flat (zero volume): 0, 1, 2, 3, 4; repair drops them",
    ),
    (
        "body-poisson",
        soft(material=palpate.Material(poisson=0.5)),
        ValueError,
        'body "cube": poisson must be greater than -1 and less than 0.5, found 0.5',
    ),
    (
        "body-young",
        soft(material=palpate.Material(young=0.0)),
        ValueError,
        'body "cube": young must be greater than 0, found 0',
    ),
    (
        "body-density",
        soft(material=palpate.Material(density=NAN)),
        ValueError,
        'body "cube": density must be greater than 0, found NaN',
    ),
    (
        "body-law",
        soft(material=palpate.Material(law="jelly")),
        ValueError,
        'body "cube": law "jelly" is not known; it must be one of linear, corotated, '
        "stvk, neo-hookean, mooney-rivlin, hgo",
    ),
    (
        "body-damping",
        soft(material=palpate.Material(damping=-1.0)),
        ValueError,
        'body "cube": damping must be 0 or more, found -1',
    ),
    (
        "body-number",
        soft(material=palpate.Material(young="soft")),
        TypeError,
        'body "cube": young: expected a number, got str',
    ),
    (
        "body-friction",
        soft(contact=palpate.Contact(friction=-0.5)),
        ValueError,
        'body "cube": friction must be 0 or more, found -0.5',
    ),
    (
        "body-distance",
        soft(contact=palpate.Contact(distance=0.0)),
        ValueError,
        'body "cube": distance must be greater than 0, found 0',
    ),
    (
        "body-fixed",
        soft(fixed_nodes=[99]),
        ValueError,
        'body "cube": fixed_nodes: node index 99 is out of range (the mesh has 8 nodes)',
    ),
    (
        "body-fixed-negative",
        soft(fixed_nodes=[-1]),
        ValueError,
        'body "cube": fixed_nodes: row 0 holds -1, expected a node index from 0',
    ),
    (
        "body-velocity",
        soft(initial_velocity=(0, 0, NAN)),
        ValueError,
        'body "cube": initial_velocity: expected finite numbers, got (0.0, 0.0, nan)',
    ),
    (
        "body-region",
        soft(regions={3: palpate.Material()}),
        ValueError,
        'body "cube": regions: the mesh has no region 3; it has none',
    ),
    (
        "body-key",
        soft(rigid=[palpate.RigidKey(1.0), palpate.RigidKey(0.5)]),
        ValueError,
        'body "cube": rigid: times of a path must increase, key 1 does not come after '
        "the one before it",
    ),
    (
        "body-key-type",
        soft(rigid=[(0.0, (0, 0, 0))]),
        TypeError,
        'body "cube": rigid[0]: expected a palpate.RigidKey, got tuple',
    ),
    (
        "body-opacity",
        soft(opacity=2.0),
        ValueError,
        'body "cube": opacity must be from 0 to 1, found 2',
    ),
    (
        "body-color",
        soft(color=(1, 0)),
        ValueError,
        'body "cube": color: expected shape (3,), got (2,)',
    ),
    (
        "body-processor",
        soft(processor=-1),
        ValueError,
        'body "cube": processor: expected an integer of at least 0, got -1',
    ),
    (
        "body-mesh",
        lambda _: palpate.Model([palpate.Body(7)]),
        TypeError,
        'body "body": mesh: expected a palpate.Mesh, got int',
    ),
    (
        "model-no-bodies",
        lambda _: palpate.Model([]),
        ValueError,
        "bodies: expected at least one body, got none",
    ),
    (
        "model-body-type",
        lambda world: palpate.Model([world.mesh, "cube"]),
        TypeError,
        "bodies[1]: expected a palpate.Body or palpate.Mesh, got str",
    ),
    (
        "model-gravity",
        lambda world: palpate.Model([world.mesh], gravity=(0, 0)),
        ValueError,
        "gravity: expected shape (3,), got (2,)",
    ),
    (
        "model-attachment-self",
        lambda world: palpate.Model([world.mesh], attachments=[palpate.Attachment(0, 0)]),
        ValueError,
        "attachments[0]: a body cannot be attached to itself",
    ),
    (
        "model-attachment-far",
        lambda world: palpate.Model(
            [world.mesh, world.mesh.with_nodes(world.mesh.nodes + 9)],
            attachments=[palpate.Attachment(0, 1)],
        ),
        ValueError,
        "attachments[0]: no node of `body_1` is within 0.569 m of `body_2`; the "
        "nearest is 13.86 m away",
    ),
    (
        "simulation-time-step",
        lambda world: palpate.Simulation([world.mesh], time_step=0),
        ValueError,
        "time_step: expected a positive number of seconds, got 0.0",
    ),
    (
        "simulation-time-step-nan",
        lambda world: palpate.Simulation([world.mesh], time_step=NAN),
        ValueError,
        "time_step: expected a finite number, got nan",
    ),
    (
        "simulation-threads",
        lambda world: palpate.Simulation([world.mesh], threads=-2),
        ValueError,
        "threads: expected an integer of at least 1, got -2",
    ),
    (
        "simulation-method",
        lambda world: palpate.Simulation([world.mesh], method="guess"),
        ValueError,
        "method: expected one of paper, all-pairs, hash, wide; got 'guess'",
    ),
    (
        "simulation-membrane",
        lambda _: palpate.Simulation([palpate.Mesh(CORNERS[:3], triangles=[[0, 1, 2]])]),
        palpate.SimulationError,
        "body 0 'body_1' has no tetrahedra, so it cannot deform: make it rigid or give "
        "it a tetrahedral mesh",
    ),
    (
        "simulation-loose-node",
        lambda _: palpate.Simulation([palpate.Mesh([*CORNERS, [5, 5, 5]], [[0, 1, 2, 3]])]),
        palpate.SimulationError,
        "node 4 of body 0 'body_1' belongs to no tetrahedron: remove it",
    ),
    (
        "step-count",
        lambda world: world.simulation.step(0),
        ValueError,
        "count: expected an integer of at least 1, got 0",
    ),
    (
        "step-count-type",
        lambda world: world.simulation.step(1.5),
        TypeError,
        "count: expected an integer, got float",
    ),
    (
        "set-positions-count",
        lambda world: world.simulation.set_positions(0, np.zeros((3, 3))),
        ValueError,
        "positions: expected shape (18, 3), got (3, 3)",
    ),
    (
        "set-positions-nan",
        lambda world: world.simulation.set_positions("soft", np.full((18, 3), NAN)),
        ValueError,
        "positions: node 0 is not finite: [nan, nan, nan]",
    ),
    (
        "set-velocities-body",
        lambda world: world.simulation.set_velocities("liver", np.zeros((18, 3))),
        ValueError,
        "body: no body is named 'liver'; there are soft, plate",
    ),
    (
        "set-forces-index",
        lambda world: world.simulation.set_forces(-3, np.zeros((18, 3))),
        IndexError,
        "body: index -3 is out of range, there are 2 bodies",
    ),
    (
        "pull-node",
        lambda world: world.simulation.pull(0, 99, [0, 0, 0], 1.0),
        palpate.SimulationError,
        "node 99 does not exist: body 0 has 18 nodes, numbered from 0",
    ),
    (
        "pull-fixed",
        lambda world: world.simulation.pull(0, 0, [0, 0, 0], 1.0),
        palpate.SimulationError,
        "node 0 of body 0 is fixed or rigid: it cannot be pulled",
    ),
    (
        "pull-rigid",
        lambda world: world.simulation.pull("plate", 0, [0, 0, 0], 1.0),
        palpate.SimulationError,
        "node 0 of body 1 is fixed or rigid: it cannot be pulled",
    ),
    (
        "pull-target",
        lambda world: setattr(world.pull, "target", [0, NAN, 0]),
        ValueError,
        "target: expected finite numbers, got (0.0, nan, 0.0)",
    ),
    (
        "pull-stiffness",
        lambda world: world.simulation.pull(0, 4, [0, 0, 0], -1.0),
        palpate.SimulationError,
        "the stiffness is -1 N/m; expected a positive number",
    ),
    (
        "drive-driven",
        lambda world: world.simulation.drive(0, [1, 2], np.zeros((2, 3))),
        palpate.SimulationError,
        "node 1 of body 0 is driven already: release that first",
    ),
    (
        "drive-rigid",
        lambda world: world.simulation.drive("plate", [0], [[0, 0, 0]]),
        palpate.SimulationError,
        "body 1 is rigid: move it as a tool",
    ),
    (
        "drive-targets",
        lambda world: world.drive.move_to([[0, 0, 0]]),
        ValueError,
        "path: expected shape (2, 3), got (1, 3)",
    ),
    (
        "drive-nan",
        lambda world: world.drive.move_to([[0, 0, 0], [0, NAN, 0]]),
        palpate.SimulationError,
        "the target of node 1 of body 0 is not finite",
    ),
    (
        "drive-path",
        lambda world: world.simulation.drive(0, [2], lambda _: 1 / 0),
        ZeroDivisionError,
        "division by zero",
    ),
    (
        "tool-soft",
        lambda world: world.simulation.tool("soft"),
        palpate.SimulationError,
        "body 0 is not rigid, so it cannot be a tool: give it RG fixed in the model",
    ),
    (
        "tool-mirror",
        lambda world: world.simulation.tool(1).set_pose(np.diag([1, 1, -1]), [0, 0, 0]),
        ValueError,
        "rotation: expected a rotation matrix; its columns are not at right angles, not "
        "of length 1, or mirror",
    ),
    (
        "tool-inf",
        lambda world: world.simulation.tool(1).set_pose(np.eye(3), [0, 0, INF]),
        ValueError,
        "translation: expected finite numbers, got (0.0, 0.0, inf)",
    ),
    (
        "cut-no-blade",
        lambda world: world.simulation.cut("knife"),
        TypeError,
        "blade: expected a palpate.Blade, got str",
    ),
    (
        "cut-snap",
        lambda world: world.simulation.cut(UNIT, snap=0.9),
        palpate.SimulationError,
        "body 0 cannot be cut: the option snap is 0.9; it must be in [0, 0.5]",
    ),
    (
        "cut-min-edge",
        lambda world: world.simulation.cut(UNIT, min_edge=-1.0),
        palpate.SimulationError,
        "body 0 cannot be cut: the option min_edge is -1; it must be a length, or 0 for none",
    ),
    (
        "cut-live-no-blade",
        lambda world: world.simulation.cut_live(None),
        TypeError,
        "blade: expected a palpate.Blade, got NoneType",
    ),
    (
        "cut-live-snap",
        lambda world: world.simulation.cut_live(UNIT, snap=-0.1),
        palpate.SimulationError,
        "body 0 cannot be cut: the option snap is -0.1; it must be in [0, 0.5]",
    ),
    (
        "cut-live-at-once",
        lambda world: world.simulation.cut_live(UNIT, delay=0),
        ValueError,
        "delay: expected an integer of at least 1, got 0",
    ),
    (
        "cut-live-never",
        lambda world: world.simulation.cut_live(UNIT, delay=10**12),
        ValueError,
        "delay: expected at most 1000 steps, got 1000000000000",
    ),
    (
        "remove-index",
        lambda world: world.simulation.remove(0, [99]),
        IndexError,
        "tetrahedra: index 99 is out of range, there are 24",
    ),
    (
        "remove-twice",
        lambda world: world.simulation.remove(0, [1, 1]),
        palpate.SimulationError,
        "body 0: tetrahedron 1 is to be removed twice; name each one once",
    ),
    (
        "remove-all",
        lambda world: world.simulation.remove(0, np.ones(24, dtype=bool)),
        palpate.SimulationError,
        "body 0: removing all 24 tetrahedra would leave nothing; leave at least one",
    ),
    (
        "remove-mask",
        lambda world: world.simulation.remove(0, np.ones(3, dtype=bool)),
        ValueError,
        "tetrahedra: expected a mask of shape (24,), got (3,)",
    ),
    (
        "restore-other",
        lambda world: world.simulation.restore(palpate.Simulation([world.mesh]).snapshot()),
        palpate.SimulationError,
        "the snapshot is of a simulation of another model",
    ),
    (
        "restore-type",
        lambda world: world.simulation.restore(None),
        TypeError,
        "snapshot: expected a Snapshot, got NoneType",
    ),
    (
        "stress-rigid",
        lambda world: world.simulation.stress("plate"),
        ValueError,
        "body 'plate' is rigid or of law linear, which has no stress that turns with the "
        "elements: take corotated",
    ),
    (
        "blade-flat-triangle",
        lambda _: palpate.Blade([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]),
        ValueError,
        "triangle 0 of the blade has no area: its corners lie on a line; leave it out",
    ),
    (
        "blade-index",
        lambda _: palpate.Blade(CORNERS, [[0, 1, 7]]),
        ValueError,
        "triangle 0 of the blade: point index 7 is out of range (there are 4 points, "
        "counted from 0)",
    ),
    (
        "blade-size",
        lambda _: palpate.Blade.plane([0, 0, 0], [0, 0, 1], size=0.0),
        ValueError,
        "the size 0 of the plane is not positive; give its edge length [m], or none for all of it",
    ),
    (
        "blade-edges",
        lambda _: palpate.Blade.stroke([[0, 0, 0], [1, 0, 0]]),
        ValueError,
        "edges: expected shape (n, 2, 3), got (2, 3)",
    ),
    (
        "scene-empty",
        lambda _: palpate.Scene([]),
        ValueError,
        "meshes: got none, expected at least one",
    ),
    (
        "scene-leaf-size",
        lambda world: palpate.Scene([world.mesh], leaf_size=0),
        ValueError,
        "leaf_size: expected an integer of at least 1, got 0",
    ),
    (
        "scene-type",
        lambda world: palpate.Scene([world.mesh, None]),
        TypeError,
        "bodies[1]: expected a palpate.Mesh, got NoneType",
    ),
    (
        "update-count",
        lambda world: world.scene.update([world.mesh.nodes]),
        ValueError,
        "positions: expected 2 arrays, one per body, got 1",
    ),
    (
        "update-nodes",
        lambda world: world.scene.update(positions(world, count=7)),
        ValueError,
        "positions[1]: expected shape (8, 3), got (7, 3)",
    ),
    (
        "update-nan",
        lambda world: world.scene.update(positions(world, at=5, value=NAN)),
        ValueError,
        "positions[1][5]: got [0.0, NaN, 0.0], expected finite numbers",
    ),
    (
        "update-inf",
        lambda world: world.scene.update(positions(world, at=2, value=-INF)),
        ValueError,
        "positions[1][2]: got [0.0, -inf, 0.0], expected finite numbers",
    ),
    (
        "update-stacked",
        lambda world: world.scene.update(np.zeros((15, 3))),
        ValueError,
        "positions: expected shape (16, 3), got (15, 3)",
    ),
    (
        "update-type",
        lambda world: world.scene.update(None),
        TypeError,
        "positions: expected a sequence of (n, 3) arrays or one stacked array of shape "
        "(16, 3), got NoneType",
    ),
    (
        "scene-remove",
        lambda world: world.scene.remove(5),
        IndexError,
        "body: index 5 is out of range, there are 2 bodies",
    ),
    (
        "scene-remove-name",
        lambda world: world.scene.remove("liver"),
        ValueError,
        "body: no body is named 'liver'; there are body_1, body_2",
    ),
    (
        "scene-replace",
        lambda world: world.scene.replace(0, CUBE_NODES),
        TypeError,
        "mesh: expected a palpate.Mesh, got ndarray",
    ),
    (
        "scene-groups",
        lambda world: world.scene.set_groups(0, [1, 2]),
        ValueError,
        "groups: got 2, expected 12, one for each surface triangle of body 0",
    ),
    (
        "scene-groups-negative",
        lambda world: world.scene.set_groups(0, -np.ones(12, dtype=int)),
        ValueError,
        "groups[0]: got -1, expected 0 to 4294967295",
    ),
    (
        "scene-cut-surface",
        lambda _: palpate.Scene([palpate.Mesh(CORNERS[:3], triangles=[[0, 1, 2]])]).cut(
            UNIT, bodies=[0]
        ),
        ValueError,
        "body 0 cannot be cut: a mesh of triangles only cannot be cut; it needs tetrahedra",
    ),
    (
        "proximity-zero",
        lambda world: world.scene.proximity(0.0),
        ValueError,
        "distance: expected a positive number of metres, got 0.0",
    ),
    (
        "proximity-text",
        lambda world: world.scene.proximity("near"),
        TypeError,
        "distance: expected a number, got str",
    ),
    (
        "closest-nan",
        lambda world: world.scene.closest([[0, 0, NAN]]),
        ValueError,
        "points[0]: got [0.0, 0.0, NaN], expected finite numbers",
    ),
    (
        "closest-distance",
        lambda world: world.scene.closest([[0, 0, 0]], max_distance=-1.0),
        ValueError,
        "max_distance: got -1, expected a number of at least 0",
    ),
    (
        "cast-counts",
        lambda world: world.scene.cast([[0, 0, 0]], [[0, 0, 1], [0, 1, 0]]),
        ValueError,
        "directions: got 2 rows, expected 1, one for each origin",
    ),
    (
        "cast-zero",
        lambda world: world.scene.cast([[0, 0, 0]], [[0, 0, 0]]),
        ValueError,
        "directions[0]: got a zero vector, expected one with a direction",
    ),
    (
        "contains-shape",
        lambda world: world.scene.contains([0, 0, 0]),
        ValueError,
        "points: expected shape (n, 3), got (3,)",
    ),
    (
        "body-material-type",
        soft(material=None),
        TypeError,
        'body "cube": material: expected a palpate.Material, got NoneType',
    ),
    (
        "body-law-type",
        soft(material=palpate.Material(law=7)),
        TypeError,
        'body "cube": law: expected a str, got int',
    ),
    (
        "body-regions-type",
        soft(regions=[palpate.Material()]),
        TypeError,
        'body "cube": regions: expected a mapping such as a dict, got list',
    ),
    (
        "body-region-name",
        soft(regions={"wall": palpate.Material()}),
        TypeError,
        'body "cube": regions: number of a region: expected an integer, got str',
    ),
    (
        "body-rigid-type",
        soft(rigid=7),
        TypeError,
        'body "cube": rigid: expected RigidKeys, or () for a fixed body, got int',
    ),
    (
        "body-key-translation",
        soft(rigid=[palpate.RigidKey(0.0, translation=(0, 0))]),
        ValueError,
        'body "cube": rigid[0]: translation: expected shape (3,), got (2,)',
    ),
    (
        "body-key-rotation",
        soft(rigid=[palpate.RigidKey(0.0, rotation=(1, 0))]),
        ValueError,
        'body "cube": rigid[0]: rotation: expected a quaternion, 4 numbers, got (1, 0)',
    ),
    (
        "body-contact-type",
        soft(contact={"friction": 0.5}),
        TypeError,
        'body "cube": contact: expected a palpate.Contact, got dict',
    ),
    (
        "body-opacity-type",
        soft(opacity="half"),
        TypeError,
        'body "cube": opacity: expected a number, got str',
    ),
    (
        "body-fixed-type",
        soft(fixed_nodes="all"),
        TypeError,
        'body "cube": fixed_nodes: expected integers of shape (m,), got dtype <U3',
    ),
    (
        "mesh-sets-type",
        mesh(CORNERS, [[0, 1, 2, 3]], node_sets=[0, 1]),
        TypeError,
        "node_sets: expected a mapping such as a dict, got list",
    ),
    (
        "model-bodies-type",
        lambda _: palpate.Model(7),
        TypeError,
        "bodies: expected palpate.Body or palpate.Mesh objects, got int",
    ),
    (
        "scene-bodies-type",
        lambda _: palpate.Scene(7),
        TypeError,
        "bodies: expected palpate.Mesh or palpate.Body objects, got int",
    ),
    (
        "closest-distance-type",
        lambda world: world.scene.closest([[0, 0, 0]], max_distance="far"),
        TypeError,
        "max_distance: expected a number, got str",
    ),
]


@pytest.mark.parametrize(
    ("action", "error", "text"),
    [pytest.param(*case[1:], id=case[0]) for case in TABLE],
)
def test_bad_input(
    world: World, action: Callable[[World], Any], error: type[Exception], text: str
) -> None:
    before = world.state()
    with pytest.raises(Exception) as caught:  # noqa: PT011
        action(world)
    assert type(caught.value) is error
    world.simulation.save(world.folder / "now")
    version, length = struct.unpack_from("<IQ", (world.folder / "now").read_bytes(), 8)
    text = text.replace("{folder}", str(world.folder))
    text = text.replace("{version}", str(version)).replace("{length}", str(length))
    assert str(caught.value) == text
    assert world.state() == before
    world.works()


def test_there_are_a_hundred() -> None:
    assert len(TABLE) >= 100
    assert len({case[0] for case in TABLE}) == len(TABLE)
