"""`palpate mesh`: tetrahedra from surfaces and from segmented images, and what is refused."""

import json
import re
import sys

import meshio
import numpy as np
import pytest
from conftest import CUBE_NODES, CUBE_TETRAHEDRA
from test_cli import run, run_json

import palpate
from palpate.cli.mesh import _joined, describe_quality
from palpate.meshing import ftetwild
from palpate.meshing.nets import surface_net
from palpate.meshing.surface import _enclosed, _unmatched_edges
from palpate.results.measures import dihedral_angles


def sphere(radius, rounds=3):
    """Points and outward triangles of a sphere: an octahedron, each triangle split in four."""
    points = np.concatenate([np.eye(3), -np.eye(3)])
    triangles = np.array([[a, b, c] for a in (0, 3) for b in (1, 4) for c in (2, 5)])
    inward = np.linalg.det(points[triangles]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    for _ in range(rounds):
        corners = points[triangles]
        middles = (corners + corners[:, [1, 2, 0]]) / 2
        a, b, c = (corners[:, k] for k in range(3))
        ab, bc, ca = (middles[:, k] for k in range(3))
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        soup = np.concatenate([np.stack(part, axis=1) for part in parts]).reshape(-1, 3)
        points, inverse = np.unique(soup.round(12), axis=0, return_inverse=True)
        triangles = inverse.reshape(-1, 3)
    return radius * points / np.linalg.norm(points, axis=1)[:, None], triangles


def labels(shape=(40, 40, 16), spacing=(1.0, 1.0, 2.5), radius=14.0):
    """A ball of label 3 with a small ball of label 7 beside it; the affine in mm."""
    spacing = np.array(spacing)
    index = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), axis=-1)
    places = (index - (np.array(shape) - 1) / 2) * spacing
    image = np.zeros(shape, dtype=np.int16)
    image[(places**2).sum(axis=-1) < radius**2] = 3
    image[((places - (17, 17, 0)) ** 2).sum(axis=-1) < 2.5**2] = 7
    affine = np.diag([*spacing, 1.0])
    affine[:3, 3] = -(np.array(shape) - 1) / 2 * spacing
    return image, affine


def test_a_sphere_in_stl_becomes_a_good_mesh_of_the_wanted_edges(tmp_path):
    pytest.importorskip("wildmeshing")
    points, triangles = sphere(50.0)
    meshio.write(tmp_path / "ball.stl", meshio.Mesh(points, [("triangle", triangles)]))
    report = run_json(
        *("mesh", tmp_path / "ball.stl", tmp_path / "ball.seg"),
        *("--unit", "mm", "--edge-length", "15mm"),
    )
    mesh = palpate.read_mesh(tmp_path / "ball.seg")
    assert len(mesh.nodes) == report["nodes"]
    assert mesh.validate() == []
    assert report["defects"] == []
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.05**3, rel=0.05)
    assert report["dihedral_angle"]["min"] == dihedral_angles(mesh.nodes, mesh.tetrahedra).min()
    assert report["dihedral_angle"]["min"] > 12
    assert report["deviation"] < 0.05 * 0.015
    edges = mesh.nodes[mesh.tetrahedra][:, [0, 0, 0, 1, 1, 2]]
    edges = edges - mesh.nodes[mesh.tetrahedra][:, [1, 2, 3, 2, 3, 3]]
    assert np.linalg.norm(edges, axis=2).mean() == pytest.approx(0.015, rel=0.3)
    away = np.linalg.norm(mesh.nodes[mesh.surface_nodes], axis=1)
    assert np.abs(away - 0.05).max() < 0.0015
    assert [each.name for each in tmp_path.iterdir() if each.name.startswith(".")] == []


def test_about_as_many_nodes_as_wanted_and_only_the_largest_part(tmp_path, monkeypatch):
    pytest.importorskip("wildmeshing")
    points, triangles = sphere(0.05)
    small = 0.1 * points + (0.1, 0, 0)
    both = palpate.Mesh(
        np.concatenate([points, small]),
        triangles=np.concatenate([triangles, triangles + len(points)]),
    )
    told = []
    monkeypatch.chdir(tmp_path)
    mesh = palpate.mesh_surface(both, nodes=400, largest=True, progress=told.append)
    assert len(mesh.nodes) == pytest.approx(400, rel=0.35)  # the small part took its share
    assert mesh.nodes[:, 0].max() < 0.06
    assert "the largest of 2 parts kept" in mesh.notes
    assert any("pass 1" in text for text in told)
    assert list(tmp_path.iterdir()) == []  # the mesher's own files are elsewhere


def test_a_label_becomes_a_mesh_in_its_place(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    pytest.importorskip("wildmeshing")
    image, affine = labels()
    nibabel.save(nibabel.Nifti1Image(image, affine), tmp_path / "labels.nii.gz")
    out, _ = run(
        *("mesh", tmp_path / "labels.nii.gz", tmp_path / "ball.seg"),
        *("--label", 3, "--edge-length", "5mm"),
    )
    assert "dihedral angles" in out
    mesh = palpate.read_mesh(tmp_path / "ball.seg")
    voxels = np.count_nonzero(image == 3) * 2.5e-9
    assert mesh.volume == pytest.approx(voxels, rel=0.02)
    assert mesh.nodes.mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-3)
    away = np.linalg.norm(mesh.nodes[mesh.surface_nodes], axis=1)
    assert np.abs(away - 0.014).max() < 0.0015  # voxels are 1 x 1 x 2.5 mm


# From Python 3.12 on it warns of how pynrrd writes the time.
@pytest.mark.filterwarnings("ignore:datetime.datetime.utcnow:DeprecationWarning")
@pytest.mark.parametrize(
    ("space", "signs"),
    [
        ("right-anterior-superior", (1, 1, 1)),
        ("left-posterior-superior", (-1, -1, 1)),
        ("LPS", (-1, -1, 1)),
        ("left-anterior-superior-time", (-1, 1, 1)),
    ],
)
def test_the_same_image_in_nrrd_lies_where_it_does_in_nifti(tmp_path, space, signs):
    nrrd = pytest.importorskip("nrrd")
    nibabel = pytest.importorskip("nibabel")
    image, affine = labels()
    affine[:3, :3] = affine[:3, :3] @ [[0, 1, 0], [1, 0, 0], [0, 0, 1]]  # axes swapped
    affine[:3, 3] = 10, 20, -30
    nibabel.save(nibabel.Nifti1Image(image, affine), tmp_path / "labels.nii")
    placed = np.diag(signs) @ affine[:3]
    header = {"space": space, "space directions": placed[:, :3].T, "space origin": placed[:, 3]}
    nrrd.write(str(tmp_path / "labels.seg.nrrd"), image, header)
    there = palpate.label_surface(tmp_path / "labels.nii", 3)
    here = palpate.label_surface(tmp_path / "labels.seg.nrrd", 3)
    assert here.nodes == pytest.approx(there.nodes, abs=1e-12)
    assert np.array_equal(here.triangles, there.triangles)


def test_several_labels_are_regions_of_one_body():
    pytest.importorskip("wildmeshing")
    image = np.zeros((20, 10, 10), dtype=np.uint8)
    image[2:10, 2:8, 2:8] = 4
    image[10:18, 2:8, 2:8] = 9
    mesh = palpate.mesh_image(image, [4, 9], affine=1e-3 * np.eye(4), edge_length=4e-3)
    middle = mesh.nodes[mesh.tetrahedra].mean(axis=1)[:, 0]
    assert np.array_equal(mesh.regions[middle < 0.009], np.full((middle < 0.009).sum(), 4))
    assert np.array_equal(mesh.regions[middle > 0.010], np.full((middle > 0.010).sum(), 9))


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (1.0, 1.0, 2.5), (-1.0, 1.0, 2.0)])
def test_the_surface_of_a_label_has_no_steps(spacing):
    image, affine = labels((44, 44, 44), spacing)
    surface = palpate.label_surface(image, 3, affine=1e-3 * affine)
    assert surface.validate() == []
    assert surface.volume == pytest.approx(
        np.count_nonzero(image == 3) * 1e-9 * abs(np.prod(spacing)), rel=1e-6
    )
    a, b, c = (surface.nodes[corner] for corner in surface.triangles.T)
    vectors, middle = np.cross(b - a, c - a), (a + b + c) / 3
    area = np.linalg.norm(vectors, axis=1)
    cosine = (vectors * middle).sum(axis=1) / (area * np.linalg.norm(middle, axis=1))
    angle = np.degrees(np.arccos(np.clip(cosine, -1, 1)))
    # As they are, voxels turn normals by 45° and more in the mean square.
    assert np.sqrt(np.average(angle**2, weights=area)) < 6
    away = np.linalg.norm(surface.nodes, axis=1)
    assert np.abs(away - 0.014).max() < 0.5e-3 * max(np.abs(spacing))


def test_a_few_voxels_keep_their_volume():
    image = np.zeros((5, 5, 5), dtype=int)
    for count, voxel in enumerate([(2, 2, 2), (3, 2, 2), (2, 3, 2), (2, 2, 3)], 1):
        image[voxel] = 1
        surface = palpate.label_surface(image, affine=np.eye(4))
        assert surface.volume == pytest.approx(count, rel=1e-3)


def test_nets_stay_closed_around_any_voxels():
    rng = np.random.default_rng(7)
    for density in (0.02, 0.3, 0.7, 1.0):
        inside = rng.random((6, 5, 4)) < density
        inside[2, 2, 2] = True
        nodes, triangles = surface_net(inside, np.diag([1.0, 2.0, -0.5]))
        odd, turned = _unmatched_edges(triangles)
        assert len(odd) == len(turned) == 0
        # Every node stays within half a voxel of its cell's middle: near a voxel of each kind.
        near = np.abs(nodes[:, None] - np.argwhere(inside)[None]).max(axis=2).min(axis=1)
        assert near.max() <= 1 + 1e-12
        assert _enclosed(nodes * [1, 2, -0.5], triangles) >= 0


def test_parts_that_grew_together_are_told():
    points, triangles = sphere(0.05, rounds=1)
    two = palpate.Mesh(
        np.concatenate([points, points + np.array([0.2, 0, 0])]),
        triangles=np.concatenate([triangles, triangles + len(points)]),
    )
    cube = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)
    report = describe_quality(cube, two)
    assert report["euler_characteristic"] == {"surface": 4, "mesh": 2}
    assert "now 2" in _joined(report)
    assert _joined(describe_quality(cube, cube)) is None
    assert _joined(describe_quality(cube, open_box())) is None  # not comparable


def open_box():
    box = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)
    return palpate.Mesh(box.nodes, triangles=box.triangles[1:])


def test_an_open_surface_is_refused_and_tells_where(tmp_path):
    pytest.importorskip("wildmeshing")
    palpate.write_mesh(tmp_path / "box.seg", open_box())
    out, err = run("mesh", tmp_path / "box.seg", tmp_path / "out.seg", status=1)
    assert out == ""
    assert "not closed: 3 open edges, the first near" in err
    assert "--fill-holes" in err
    assert not (tmp_path / "out.seg").exists()
    run(
        *("mesh", tmp_path / "box.seg", tmp_path / "out.seg"),
        *("--fill-holes", "--edge-length", "0.5"),
    )
    assert palpate.read_mesh(tmp_path / "out.seg").volume == pytest.approx(1, rel=0.25)


def test_corners_that_nearly_meet_are_merged_and_inward_surfaces_turned():
    pytest.importorskip("wildmeshing")
    cube = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)
    rng = np.random.default_rng(3)
    soup = cube.nodes[cube.triangles[:, ::-1]].reshape(-1, 3)
    soup = soup + 1e-9 * rng.standard_normal(soup.shape)
    surface = palpate.Mesh(soup, triangles=np.arange(36).reshape(12, 3))
    mesh = palpate.mesh_surface(surface, edge_length=0.5)
    assert mesh.volume == pytest.approx(1, rel=0.02)
    assert any("28 points" in note for note in mesh.notes)
    assert any("inward" in note for note in mesh.notes)


def test_surfaces_that_enclose_nothing_or_face_both_ways_are_refused():
    pytest.importorskip("wildmeshing")
    cube = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)
    turned = cube.triangles.copy()
    turned[0] = turned[0, ::-1]
    with pytest.raises(palpate.MeshError, match="3 edges between triangles that face opposite"):
        palpate.mesh_surface(palpate.Mesh(cube.nodes, triangles=turned))
    flat = palpate.Mesh(cube.nodes * [1, 1, 1e-12], triangles=cube.triangles)
    with pytest.raises(palpate.MeshError, match="encloses no volume"):
        palpate.mesh_surface(flat)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"edge_length": 0.1, "nodes": 5}, "give one"),
        ({"edge_length": -1.0}, "positive length"),
        ({"edge_length": float("nan")}, "finite"),
        ({"edge_length": 9.0}, "shorter"),
        ({"nodes": 3}, "at least 4"),
        ({"nodes": 2.5}, "integer"),
        ({"tolerance": 0.0}, "positive length"),
    ],
)
def test_sizes_that_make_no_sense(keywords, message):
    pytest.importorskip("wildmeshing")
    cube = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)
    with pytest.raises((ValueError, TypeError), match=message):
        palpate.mesh_surface(cube, **keywords)


@pytest.mark.parametrize(
    ("values", "label", "message"),
    [
        (np.zeros((4, 4, 4), dtype=int), None, "empty"),
        (np.ones((4, 4), dtype=int), 1, "three dimensions"),
        (np.ones((4, 4, 4), dtype=int), 2, "no voxel has label 2; there are 1 \\(64 voxels\\)"),
        (np.arange(64).reshape(4, 4, 4), None, "which label"),
        (np.full((4, 4, 4), 0.5), 1, "not whole"),
        (np.full((4, 4, 4), np.nan), 1, "not finite"),
        (np.ones((4, 4, 4), dtype=int), 0, "at least 1"),
        (np.ones((4, 4, 4), dtype=int), [], "at least one"),
    ],
)
def test_images_that_hold_no_such_label(values, label, message):
    with pytest.raises(ValueError, match=message):
        palpate.label_surface(values, label, affine=np.eye(4))


def test_images_need_a_sound_affine():
    values = np.ones((4, 4, 4), dtype=int)
    for affine in (None, np.eye(3), np.full((4, 4), np.nan), np.diag([1.0, 0, 1, 1])):
        with pytest.raises(ValueError, match="affine"):
            palpate.label_surface(values, 1, affine=affine)


def test_a_file_that_is_no_image(tmp_path):
    pytest.importorskip("nibabel")
    pytest.importorskip("wildmeshing")
    (tmp_path / "broken.nii.gz").write_bytes(b"no image")
    _, err = run("mesh", tmp_path / "broken.nii.gz", tmp_path / "out.seg", status=1)
    assert "broken.nii.gz: not an image" in err
    _, err = run("mesh", tmp_path / "none.nii.gz", tmp_path / "out.seg", status=1)
    assert "none.nii.gz: No such file" in err


def test_what_is_missing_is_named(tmp_path, monkeypatch):
    cube = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)
    palpate.write_mesh(tmp_path / "cube.seg", cube)
    monkeypatch.setattr(ftetwild.importlib.util, "find_spec", lambda _: None)
    error = run_json("mesh", tmp_path / "cube.seg", tmp_path / "out.seg", status=1)["error"]
    assert "pip install 'palpate[mesh]'" in json.dumps(error)
    monkeypatch.undo()
    monkeypatch.setitem(sys.modules, "nibabel", None)
    monkeypatch.setitem(sys.modules, "nrrd", None)
    for name, package in (("image.nii", "nibabel"), ("image.seg.nrrd", "pynrrd")):
        (tmp_path / name).write_bytes(b"")
        with pytest.raises(palpate.MeshError, match=f"{package}: pip install 'palpate\\[mesh\\]'"):
            palpate.label_surface(tmp_path / name)


def test_a_mesher_that_dies_is_told(monkeypatch, tmp_path):
    pytest.importorskip("wildmeshing")
    worker = tmp_path / "worker.py"
    worker.write_text("print('out of luck'); raise SystemExit(3)")
    monkeypatch.setattr(ftetwild, "_WORKER", worker)
    cube = palpate.Mesh(CUBE_NODES, CUBE_TETRAHEDRA)
    with pytest.raises(palpate.MeshError, match="out of luck"):
        palpate.mesh_surface(cube, edge_length=0.5)


@pytest.mark.parametrize(
    "arguments",
    [
        ("a.stl", "b"),
        ("a.stl", "b.seg", "--label", "3"),
        ("a.nii", "b.seg", "--unit", "mm"),
        ("a.stl", "b.seg", "--unit", "inch"),
        ("a.stl", "b.seg", "--nodes", "9", "--edge-length", "1mm"),
        ("a.stl", "b.seg", "--edge-length", "4 furlongs"),
        ("a.stl", "b.seg", "--edge-length", "-4mm"),
        ("a.stl", "b.seg", "--edge-length", "nan"),
    ],
)
def test_wrong_usage(arguments):
    run("mesh", *arguments, status=2)


def test_a_folder_that_is_not_there_is_told_before_the_work(tmp_path):
    _, err = run("mesh", tmp_path / "none.stl", tmp_path / "no" / "out.seg", status=1)
    assert f"{tmp_path / 'no'}: No such folder" in err


def test_long_bodies_are_asked_about_millimetres(tmp_path):
    pytest.importorskip("wildmeshing")
    points, triangles = sphere(50.0, rounds=1)
    palpate.write_mesh(tmp_path / "ball.stl", palpate.Mesh(points, triangles=triangles))
    out, _ = run("mesh", tmp_path / "ball.stl", tmp_path / "ball.vtk", "--edge-length", "40")
    assert "give --unit mm" in out
    assert re.search(r"size +\d+(\.\d+)? x \d+(\.\d+)? x \d+(\.\d+)? m +\n", out)
