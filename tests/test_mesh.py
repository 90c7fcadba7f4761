"""Meshes from arrays: what is computed, what is refused, what is mended."""

import numpy as np
import pytest
from conftest import CUBE_NODES, CUBE_TETRAHEDRA
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import palpate


def test_a_cube_has_its_volume_and_surface(cube):
    assert cube.volume == pytest.approx(1.0, abs=1e-15)
    assert cube.triangles.shape == (12, 3)
    assert cube.triangle_owners.shape == (12,)
    assert cube.validate() == []
    assert cube.surface_edges.shape == (18, 2)


def test_surface_triangles_face_outward_and_belong_to_their_owner(make_box):
    mesh = make_box((3, 2, 2))
    corners = mesh.nodes[mesh.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    owner_centres = mesh.nodes[mesh.tetrahedra[mesh.triangle_owners]].mean(axis=1)
    assert (np.einsum("ij,ij->i", normals, corners[:, 0] - owner_centres) > 0).all()
    for triangle, owner in zip(mesh.triangles, mesh.triangle_owners, strict=True):
        assert set(triangle) <= set(mesh.tetrahedra[owner])


def test_the_surface_is_every_face_of_exactly_one_tetrahedron(make_box):
    mesh = make_box((3, 3, 2))
    count = {}
    for tetrahedron in mesh.tetrahedra.tolist():
        for skip in range(4):
            face = frozenset(tetrahedron[:skip] + tetrahedron[skip + 1 :])
            count[face] = count.get(face, 0) + 1
    expected = {face for face, times in count.items() if times == 1}
    assert {frozenset(triangle) for triangle in mesh.triangles.tolist()} == expected


def test_arrays_handed_out_are_read_only_and_stay(cube):
    for array in (cube.nodes, cube.tetrahedra, cube.triangles, cube.triangle_owners):
        assert not array.flags.writeable
    source = CUBE_NODES.copy()
    mesh = palpate.Mesh(source, CUBE_TETRAHEDRA)
    source[:] = 7.0
    assert np.array_equal(mesh.nodes, CUBE_NODES)


def test_anything_convertible_is_taken():
    lists = palpate.Mesh(CUBE_NODES.tolist(), CUBE_TETRAHEDRA.tolist())
    floats = palpate.Mesh(np.asfortranarray(CUBE_NODES), CUBE_TETRAHEDRA.astype(np.uint8))
    single = palpate.Mesh(CUBE_NODES.astype(np.float32), CUBE_TETRAHEDRA)
    assert lists == floats == single


def test_a_surface_alone_is_a_mesh():
    mesh = palpate.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], triangles=[[0, 1, 2]])
    assert mesh.tetrahedra.shape == (0, 4)
    assert mesh.triangle_owners.shape == (0,)
    assert mesh.triangles.tolist() == [[0, 1, 2]]


def test_node_sets_and_regions_are_kept():
    mesh = palpate.Mesh(
        CUBE_NODES, CUBE_TETRAHEDRA, node_sets={"top": [7, 1, 1]}, regions=[1, 1, 2, 2, -3]
    )
    assert mesh.node_sets["top"].tolist() == [1, 7]
    assert mesh.regions.tolist() == [1, 1, 2, 2, -3]


BAD = [
    (([], []), ValueError, "neither|empty|no nodes|shape"),
    ((CUBE_NODES, np.zeros((0, 4), int)), ValueError, "tetrahedra"),
    ((CUBE_NODES[:, :2], CUBE_TETRAHEDRA), ValueError, r"nodes: expected shape \(n, 3\)"),
    ((CUBE_NODES.astype(complex), CUBE_TETRAHEDRA), TypeError, "complex"),
    ((CUBE_NODES, CUBE_TETRAHEDRA.astype(float)), TypeError, "tetrahedra: expected integers"),
    ((CUBE_NODES, CUBE_TETRAHEDRA[:, :3]), ValueError, r"tetrahedra: expected shape \(m, 4\)"),
    ((CUBE_NODES, CUBE_TETRAHEDRA - 1), ValueError, "row 0 holds -1"),
    ((CUBE_NODES, CUBE_TETRAHEDRA + 1), ValueError, "out of range"),
    (([[0, 0], [1]], CUBE_TETRAHEDRA), ValueError, "ragged"),
    ((CUBE_NODES, [[0, 1, 2, 2]]), ValueError, "tetrahedron 0"),
    ((CUBE_NODES * [1, 1, 0], CUBE_TETRAHEDRA), ValueError, "degenerate|zero volume"),
    ((CUBE_NODES, CUBE_TETRAHEDRA[:, [1, 0, 2, 3]]), ValueError, "inverted"),
    ((CUBE_NODES, np.vstack([CUBE_TETRAHEDRA, CUBE_TETRAHEDRA[:1]])), ValueError, "duplicate|same"),
    (("nodes", CUBE_TETRAHEDRA), (TypeError, ValueError), "nodes"),
    ((None, CUBE_TETRAHEDRA), TypeError, "nodes"),
]


@pytest.mark.parametrize(("arguments", "error", "text"), BAD)
def test_bad_arrays_are_refused_by_name(arguments, error, text):
    with pytest.raises(error, match=text):
        palpate.Mesh(*arguments)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_node_that_is_not_finite_is_named(value):
    nodes = CUBE_NODES.copy()
    nodes[5, 1] = value
    with pytest.raises(palpate.MeshError, match=r"node 5"):
        palpate.Mesh(nodes, CUBE_TETRAHEDRA)


def test_repair_mends_and_says_so():
    tetrahedra = CUBE_TETRAHEDRA.copy()
    tetrahedra[2] = tetrahedra[2, [1, 0, 2, 3]]
    nodes = np.vstack([CUBE_NODES, [[9.0, 9.0, 9.0]]])
    tetrahedra = np.vstack([tetrahedra, tetrahedra[0]])
    mesh = palpate.Mesh(nodes, tetrahedra, repair=True)
    assert mesh.volume == pytest.approx(1.0)
    assert len(mesh.nodes) == 8
    assert len(mesh.notes) == 3


def test_suspicious_meshes_are_described():
    nodes = np.vstack([CUBE_NODES, [[9.0, 9.0, 9.0]]])
    defects = palpate.Mesh(nodes, CUBE_TETRAHEDRA).validate()
    assert [defect.count for defect in defects] == [1]
    assert defects[0].indices == (8,)
    assert "unused" in str(defects[0]) or "no element" in str(defects[0])


def test_with_nodes_moves_the_mesh(cube):
    assert cube.with_nodes(2 * cube.nodes).volume == pytest.approx(8.0)
    with pytest.raises(ValueError, match=r"shape \(8, 3\)"):
        cube.with_nodes(cube.nodes[:5])


@given(
    hnp.arrays(
        st.sampled_from([np.float64, np.float32, np.int64, np.uint8, np.complex128, bool, object]),
        hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
        fill=st.nothing(),
        elements=st.just(1),
    ),
    hnp.arrays(
        st.sampled_from([np.float64, np.int64, np.uint8]),
        hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
        elements=st.integers(0, 9),
    ),
)
def test_any_arrays_make_a_mesh_or_a_clear_error(nodes, tetrahedra):
    try:
        mesh = palpate.Mesh(nodes, tetrahedra)
    except (ValueError, TypeError) as error:
        assert str(error)
    else:
        assert mesh.volume > 0
