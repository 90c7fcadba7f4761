"""Close pairs, contact nodes, folds, and what is left out, from Python."""

import numpy as np
import pytest
from conftest import box
from hypothesis import given, settings
from hypothesis import strategies as st

import palpate
from palpate import Proximity

METHODS = ["wide", "paper", "hash", "all-pairs"]
SHEET = palpate.Mesh(
    [[x, y, 0.0] for x in range(4) for y in range(3)],
    triangles=[
        corners
        for x in range(3)
        for y in range(2)
        for a in [3 * x + y]
        for corners in ([a, a + 3, a + 4], [a, a + 4, a + 1])
    ],
)


def columns(found):
    names = ["kind", "bodies", "elements", "nodes", "weights", "normals", "distances"]
    return [getattr(found, name) for name in names]


def crumpled(meshes, seed=1, grid=False):
    rng = np.random.default_rng(seed)
    draw = (lambda shape: rng.integers(0, 4, shape) / 4.0) if grid else rng.random
    return [draw(mesh.nodes.shape) for mesh in meshes]


def test_proximity_of_two_boxes_says_what_its_columns_say():
    meshes = [box((2, 2, 2)), box((2, 2, 2), origin=(1.1, 0.2, 0.3))]
    scene = palpate.Scene(meshes)
    found = scene.proximity(0.15, self_contact=False)
    count = len(found)
    assert count > 10
    widths = [(), (2,), (2,), (4,), (4,), (3,), ()]
    for array, width in zip(columns(found), widths, strict=True):
        assert array.shape == (count, *width)
        assert not array.flags.writeable
    for array in columns(found)[:4]:
        assert array.dtype == np.int32
    for array in columns(found)[4:]:
        assert array.dtype == np.float64
    rows = np.column_stack([found.kind, found.bodies, found.elements])
    assert rows.tolist() == sorted(rows.tolist())
    assert set(found.kind) == {Proximity.VERTEX_TRIANGLE, Proximity.EDGE_EDGE}
    assert found.stats.pair_tests >= count
    assert "vertex-triangle pairs" in repr(found)

    edges = found.kind == Proximity.EDGE_EDGE
    side = np.where(edges, 2, 1)[:, None] > np.arange(4)
    stacked = np.concatenate([mesh.nodes for mesh in meshes])
    body = np.where(side, found.bodies[:, :1], found.bodies[:, 1:])
    points = stacked[found.nodes + scene.node_offsets[body]]
    gaps = np.einsum("ki,kij,kj->k", found.weights, points, found.normals)
    assert np.allclose(gaps, found.distances)
    assert np.allclose(gaps.min(), 0.1)
    assert gaps.max() < 0.15
    assert np.allclose(found.weights.sum(axis=1), 0.0)
    assert (np.where(side, found.weights, -found.weights) >= 0.0).all()
    for row in np.flatnonzero(edges):
        first, second = found.elements[row]
        a, b = found.bodies[row]
        assert found.nodes[row].tolist() == [
            *meshes[a].surface_edges[first],
            *meshes[b].surface_edges[second],
        ]
    for row in np.flatnonzero(~edges):
        node, triangle = found.elements[row]
        assert found.nodes[row].tolist() == [
            node,
            *meshes[found.bodies[row, 1]].triangles[triangle],
        ]


@settings(max_examples=40, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(METHODS[:-1]),
    st.sampled_from([0.01, 0.2]),
    st.booleans(),
    st.booleans(),
    st.booleans(),
)
def test_any_scene_gives_the_pairs_of_the_double_loop(
    seed, method, distance, grid, self_contact, close_at_rest
):
    meshes = [box((2, 1, 2)), SHEET]
    rng = np.random.default_rng(seed)
    ignored = [(a, b) for a in range(2) for b in range(a, 2) if rng.random() < 0.2]
    groups = [rng.integers(0, 5, len(mesh.triangles)) for mesh in meshes]
    results = []
    for each in (method, "all-pairs"):
        scene = palpate.Scene(meshes, method=each)
        for a, b in ignored:
            scene.ignore(b, a)
        for body in range(2):
            scene.set_groups(body, groups[body])
        scene.update(crumpled(meshes, seed, grid))
        close = scene.proximity(distance, self_contact=self_contact, close_at_rest=close_at_rest)
        meeting = scene.intersections(self_contact=self_contact, shared_nodes=True)
        nodes = scene.contact_nodes(self_contact=self_contact)
        results.append([*columns(close), meeting.pairs, *nodes])
    for found, expected in zip(*results, strict=True):
        assert np.array_equal(found, expected)


@pytest.mark.parametrize(
    ("distance", "error", "text"),
    [
        (0.0, ValueError, "distance: expected a positive number of metres, got 0.0"),
        (-1, ValueError, "distance: expected a positive number of metres, got -1.0"),
        (np.nan, ValueError, "distance: expected a finite number, got nan"),
        (np.inf, ValueError, "distance: expected a finite number, got inf"),
        ("1", TypeError, "distance: expected a number, got str"),
        (None, TypeError, "distance: expected a number, got NoneType"),
        ([0.1], TypeError, "distance: expected a number, got list"),
    ],
)
def test_a_distance_is_a_positive_number(cube, distance, error, text):
    with pytest.raises(error, match=text):
        palpate.Scene([cube]).proximity(distance)


@pytest.mark.parametrize("method", METHODS)
def test_what_is_close_at_rest_can_be_left_out(method):
    scene = palpate.Scene(SHEET, method=method)
    assert len(scene.proximity(1.2)) > 0
    assert len(scene.proximity(1.2, self_contact=False)) == 0
    assert len(scene.proximity(1.2, close_at_rest=False)) == 0
    x, y, z = SHEET.nodes.T
    scene.update([np.column_stack([np.minimum(x, 3 - x), y, np.where(x > 1.5, 0.5, z)])])
    new = scene.proximity(1.2, close_at_rest=False)
    assert 0 < len(new) < len(scene.proximity(1.2))


@pytest.mark.parametrize("method", METHODS)
def test_contact_nodes_are_those_of_the_triangles_that_meet(method):
    meshes = [
        box((3, 3, 3)),
        box((2, 2, 2), origin=(0.8, 0.3, 0.2)),
        box((1, 1, 1), origin=(9, 9, 9)),
    ]
    scene = palpate.Scene(meshes, method=method)
    pairs = scene.intersections().pairs
    found = scene.contact_nodes()
    assert isinstance(found, tuple)
    for body, (mesh, nodes) in enumerate(zip(meshes, found, strict=True)):
        touching = {*pairs[pairs[:, 0] == body, 1], *pairs[pairs[:, 2] == body, 3]}
        expected = np.unique(mesh.triangles[sorted(touching)])
        assert nodes.dtype == np.int32
        assert not nodes.flags.writeable
        assert np.array_equal(nodes, expected)
    assert [len(nodes) > 0 for nodes in found] == [True, True, False]
    crumpled_alone = np.random.default_rng(4).random(meshes[0].nodes.shape) + 5.0
    scene.update([crumpled_alone, meshes[1].nodes, meshes[2].nodes])
    assert len(scene.contact_nodes()[0]) > 0
    assert [len(nodes) for nodes in scene.contact_nodes(self_contact=False)] == [0, 0, 0]


@pytest.mark.parametrize("method", METHODS)
def test_a_sheet_folded_flat_meets_itself_at_its_fold(method):
    scene = palpate.Scene(SHEET, method=method)
    assert len(scene.intersections(shared_nodes=True)) == 0
    x, y, z = SHEET.nodes.T
    scene.update([np.column_stack([np.where(x > 2, 4 - x, x), y, z])])
    triangles = SHEET.triangles
    shared = {
        (a, b)
        for _, a, _, b in scene.intersections(shared_nodes=True).pairs.tolist()
        if set(triangles[a]) & set(triangles[b])
    }
    # The column folded over lies on the one beside it, cell by cell.
    on_edge = [(a, b) for a, b in shared if len(set(triangles[a]) & set(triangles[b])) == 2]
    assert len(on_edge) == 2
    apart = scene.intersections().pairs.tolist()
    assert not {(a, b) for _, a, _, b in apart} & shared


def test_ignored_bodies_stay_ignored(make_box):
    meshes = [make_box((2, 2, 2), origin=(0.3 * i, 0.2 * i, 0.1 * i)) for i in range(3)]
    scene = palpate.Scene(meshes)

    def touching():
        bodies = {tuple(pair) for pair in scene.intersections().bodies.tolist()}
        close = {tuple(sorted(pair)) for pair in scene.proximity(0.01).bodies.tolist()}
        assert bodies <= close
        return bodies

    assert touching() == {(0, 1), (0, 2), (1, 2)}
    scene.ignore(2, "body_2")
    assert touching() == {(0, 1), (0, 2)}
    scene.update([mesh.nodes for mesh in meshes])
    scene.replace(2, meshes[2])
    assert touching() == {(0, 1), (0, 2)}
    scene.remove(0)
    assert touching() == set()
    scene.ignore(0, 1, ignored=False)
    assert touching() == {(0, 1)}
    scene.ignore(0, 0)
    scene.update(crumpled(scene.meshes))
    assert touching() == {(0, 1), (1, 1)}
    assert all(len(nodes) for nodes in scene.contact_nodes())


def test_groups_end_with_the_mesh(make_box):
    mesh = make_box((2, 2, 2))
    scene = palpate.Scene([mesh, mesh.with_nodes(mesh.nodes + 0.3)])
    assert len(scene.intersections()) > 0
    for body in (0, "body_2"):
        scene.set_groups(body, np.full(len(mesh.triangles), 4))
    assert len(scene.intersections()) == 0
    assert len(scene.proximity(0.1)) == 0
    assert [len(nodes) for nodes in scene.contact_nodes()] == [0, 0]
    scene.set_groups(1, [5] * len(mesh.triangles))
    assert len(scene.intersections()) > 0
    scene.set_groups(1, np.full(len(mesh.triangles), 4, np.uint8))
    scene.replace(1, scene.meshes[1])
    assert len(scene.intersections()) > 0


@pytest.mark.parametrize(
    ("groups", "error", "text"),
    [
        ([1, 2], ValueError, "groups: got 2, expected 12, one for each surface triangle of body 0"),
        ([0] * 11 + [-1], ValueError, r"groups\[11\]: got -1, expected 0 to"),
        ([0] * 11 + [2**32], ValueError, r"groups\[11\]: got 4294967296"),
        ([0.5] * 12, TypeError, "groups: expected integers"),
        ([[0] * 12], ValueError, "groups: expected shape"),
        (3, ValueError, "groups: expected shape"),
    ],
)
def test_groups_are_checked(cube, groups, error, text):
    scene = palpate.Scene([cube])
    with pytest.raises(error, match=text):
        scene.set_groups(0, groups)
    with pytest.raises(IndexError, match="index 1 is out of range"):
        scene.set_groups(1, groups)
    with pytest.raises(ValueError, match="no body is named 'liver'"):
        scene.ignore(0, "liver")
