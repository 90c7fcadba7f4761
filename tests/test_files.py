"""Mesh files: every format there and back, and errors that name the place."""

import numpy as np
import pytest
from conftest import CUBE_NODES, CUBE_TETRAHEDRA

import palpate

#: Formats whose numbers survive exactly, and those that print fewer digits.
EXACT = [".seg", ".vtk", ".vtu", ".msh", ".inp", ".mesh"]
SURFACE = [".stl", ".obj", ".ply"]


@pytest.mark.parametrize("extension", [*EXACT, ".node"])
def test_tetrahedra_round_trip(tmp_path, make_box, extension):
    mesh = make_box((2, 3, 2), size=0.123456789)
    path = tmp_path / f"mesh{extension}"
    palpate.write_mesh(path, mesh)
    back = palpate.read_mesh(path)
    assert np.allclose(back.nodes, mesh.nodes, rtol=0, atol=1e-15)
    assert np.array_equal(back.tetrahedra, mesh.tetrahedra)
    assert [each.name for each in tmp_path.iterdir() if each.name.startswith(".")] == []


@pytest.mark.parametrize("extension", SURFACE)
def test_surfaces_round_trip(tmp_path, cube, extension):
    path = tmp_path / f"surface{extension}"
    palpate.write_mesh(path, cube)
    back = palpate.read_mesh(path)
    assert back.tetrahedra.shape == (0, 4)
    assert len(back.triangles) == 12
    assert len(back.nodes) == 8
    assert back.volume == pytest.approx(1.0)


@pytest.mark.parametrize("version", ["gmsh", "gmsh22"])
@pytest.mark.parametrize("binary", [False, True])
def test_gmsh_files_of_both_versions_are_read(tmp_path, cube, version, binary):
    meshio = pytest.importorskip("meshio")
    raw = meshio.Mesh(cube.nodes, [("tetra", cube.tetrahedra)])
    meshio.write(tmp_path / "cube.msh", raw, version, binary=binary)
    back = palpate.read_mesh(tmp_path / "cube.msh")
    assert np.array_equal(back.nodes, cube.nodes)
    assert np.array_equal(back.tetrahedra, cube.tetrahedra)


def test_seg_keeps_sets_and_regions_exactly(tmp_path):
    rng = np.random.default_rng(1)
    nodes = CUBE_NODES + 1e-3 * rng.standard_normal((8, 3))
    mesh = palpate.Mesh(
        nodes, CUBE_TETRAHEDRA, node_sets={"top": [1, 3, 5]}, regions=[3, 1, 4, 1, 5]
    )
    palpate.write_mesh(tmp_path / "mesh.seg", mesh)
    assert palpate.read_mesh(tmp_path / "mesh.seg") == mesh


def test_mixed_cells_are_reported(tmp_path):
    meshio = pytest.importorskip("meshio")
    cells = [
        ("tetra", CUBE_TETRAHEDRA),
        ("hexahedron", [[0, 4, 6, 2, 1, 5, 7, 3]]),
        ("line", [[0, 1], [1, 2]]),
    ]
    for name in ("mixed.vtk", "mixed.vtu", "mixed.msh"):
        written_as = "gmsh22" if name.endswith(".msh") else None
        meshio.write(tmp_path / name, meshio.Mesh(CUBE_NODES, cells), written_as)
        mesh = palpate.read_mesh(tmp_path / name)
        assert len(mesh.tetrahedra) == 5
        notes = " ".join(mesh.notes)
        assert "hexahedr" in notes
        assert "line" in notes


def test_a_file_without_elements_is_refused(tmp_path):
    meshio = pytest.importorskip("meshio")
    meshio.write(tmp_path / "lines.vtu", meshio.Mesh(CUBE_NODES, [("line", [[0, 1]])]))
    with pytest.raises(palpate.MeshError, match="no tetrahedra and no triangles") as caught:
        palpate.read_mesh(tmp_path / "lines.vtu")
    assert caught.value.path == str(tmp_path / "lines.vtu")


def test_errors_name_file_and_line(tmp_path):
    path = tmp_path / "bad.seg"
    path.write_text("seg 1\nnodes 2\n0 0 0\n0 0 x\n")
    with pytest.raises(palpate.MeshError, match=r"bad\.seg:4") as caught:
        palpate.read_mesh(path)
    assert caught.value.path == str(path)
    assert caught.value.line == 4


@pytest.mark.parametrize("name", ["nothing.seg", "nothing.vtk", "nothing.msh"])
def test_a_missing_file_is_an_os_error(tmp_path, name):
    with pytest.raises(FileNotFoundError) as caught:
        palpate.read_mesh(tmp_path / name)
    assert caught.value.filename == str(tmp_path / name)


@pytest.mark.parametrize(
    "name",
    ["garbage.seg", "garbage.vtk", "garbage.msh", "garbage.vtu", "garbage.inp", "garbage.xyz123"],
)
def test_garbage_is_a_clear_error(tmp_path, name):
    path = tmp_path / name
    path.write_bytes(b"\x00\xffnot a mesh\n\n12 13 14")
    with pytest.raises(palpate.MeshError, match="garbage"):
        palpate.read_mesh(path)


def test_inverted_tetrahedra_are_listed_and_repaired(tmp_path):
    path = tmp_path / "inverted.seg"
    text = "\n".join(
        ["seg 1", "nodes 4", "0 0 0", "1 0 0", "0 1 0", "0 0 1", "tetrahedra 1", "1 0 2 3"]
    )
    path.write_text(text + "\n")
    with pytest.raises(palpate.MeshError, match="inverted"):
        palpate.read_mesh(path)
    assert palpate.read_mesh(path, repair=True).volume == pytest.approx(1 / 6)


def test_an_unwritable_place_leaves_nothing(tmp_path, cube):
    with pytest.raises(OSError, match="nowhere"):
        palpate.write_mesh(tmp_path / "nowhere" / "cube.seg", cube)
    assert list(tmp_path.iterdir()) == []


def test_real_organs_read(organs):
    if organs is None:
        return
    counts = {"aorta_paper": (1600, 5543, 2312), "kidney_l_paper": (2401, 9059, 3212)}
    for name, expected in counts.items():
        mesh = palpate.read_mesh(organs / f"{name}.vtk")
        assert (len(mesh.nodes), len(mesh.tetrahedra), len(mesh.triangles)) == expected
        assert [defect.kind for defect in mesh.validate()] == []
