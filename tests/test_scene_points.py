"""Closest points, containment, rays and penetration from Python."""

import numpy as np
import pytest

import palpate


@pytest.fixture
def two_boxes(make_box):
    return palpate.Scene([make_box((2, 2, 2)), make_box((2, 3, 2), origin=(2.0, 0.0, 0.0))])


def test_closest_points_of_all_bodies_and_of_one(two_boxes):
    points = [[0.5, 0.25, 1.5], [1.25, 0.5, 0.5], [3.5, 0.5, 0.25], [0.5, 0.5, 0.5]]
    found = two_boxes.closest(points)
    assert isinstance(found, palpate.ClosestPoints)
    assert len(found) == 4
    assert found.bodies.tolist() == [0, 0, 1, 0]
    assert found.distances.tolist() == [0.5, 0.25, 0.5, 0.5]
    on = [[0.5, 0.25, 1.0], [1.0, 0.5, 0.5], [3.0, 0.5, 0.25]]
    assert np.allclose(found.positions[:3], on, rtol=1e-15)
    for body, triangle, weights, position in zip(
        found.bodies, found.triangles, found.weights, found.positions, strict=True
    ):
        mesh = two_boxes.meshes[body]
        assert np.allclose(weights @ mesh.nodes[mesh.triangles[triangle]], position)
    for array in (found.bodies, found.triangles, found.weights, found.positions, found.distances):
        assert not array.flags.writeable
    of_second = two_boxes.closest(points, body="body_2")
    assert of_second.bodies.tolist() == [1] * 4
    assert of_second.distances[1] == 0.75


def test_what_is_too_far_has_no_answer(two_boxes):
    found = two_boxes.closest([[0.5, 0.25, 1.5], [0.5, 0.5, 9.0]], max_distance=0.5)
    assert found.bodies.tolist() == [0, -1]
    assert found.triangles[1] == -1
    assert np.isnan(found.weights[1]).all()
    assert np.isnan(found.positions[1]).all()
    assert found.distances[1] == np.inf
    assert repr(found) == "ClosestPoints(1 of 2)"


def test_inside_is_strict(two_boxes):
    points = [[0.5, 0.5, 0.5], [1.0, 0.5, 0.5], [2.5, 0.1, 0.9], [0.0, 0.0, 0.0], [1.5, 0, 0]]
    inside = two_boxes.contains(points)
    assert inside.dtype == bool
    assert inside.tolist() == [[True, False], [False] * 2, [False, True], [False] * 2, [False] * 2]
    assert two_boxes.contains(points, body=1).tolist() == [False, False, True, False, False]
    assert two_boxes.contains(np.zeros((0, 3))).shape == (0, 2)


def test_rays_hit_the_nearest_surface(two_boxes):
    origins = [[-1.0, 0.3, 0.4], [-1.0, 0.3, 0.4], [1.5, 0.5, 0.5], [0.5, 0.5, 0.5]]
    directions = [[1e-6, 0, 0], [-1.0, 0, 0], [300.0, 0, 0], [0, 0, 2.0]]
    hits = two_boxes.cast(origins, directions)
    assert isinstance(hits, palpate.RayHits)
    assert hits.bodies.tolist() == [0, -1, 1, 0]
    assert np.allclose(hits.distances, [1.0, np.inf, 0.5, 0.5], rtol=1e-15)
    assert np.allclose(hits.positions[0], [0.0, 0.3, 0.4])
    assert repr(hits) == "RayHits(3 of 4)"
    assert two_boxes.cast(origins, directions, body=1).distances[0] == pytest.approx(3.0)
    assert (two_boxes.cast(origins, directions, max_distance=0.25).bodies == -1).all()


@pytest.mark.parametrize("method", ["wide", "paper"])
def test_a_box_pushed_into_another_by_a_known_depth(make_box, method):
    upper = make_box((2, 2, 2), origin=(0.25, 0.25, 0.75), size=(0.5, 0.5, 0.5))
    scene = palpate.Scene([make_box((3, 3, 3)), upper], method=method)
    found = scene.penetration()
    assert isinstance(found, palpate.Penetration)
    of_upper = found.bodies[:, 0] == 1
    assert of_upper.sum() == 9
    assert (found.bodies[of_upper, 1] == 0).all()
    assert np.allclose(found.depths, 0.25, rtol=1e-12)
    assert np.allclose(found.directions[of_upper], [0, 0, 1], atol=1e-12)
    assert np.allclose(found.directions[~of_upper], [0, 0, -1], atol=1e-12)
    for row in range(len(found)):
        body, into = found.bodies[row]
        corners = scene.positions(int(into))[scene.meshes[into].triangles[found.triangles[row]]]
        node = scene.positions(int(body))[found.nodes[row]]
        way = found.weights[row] @ corners - node
        assert np.allclose(way, found.depths[row] * found.directions[row])
    assert repr(found) == f"Penetration({len(found)} nodes, deepest 0.25 m)"
    assert found.stats.pair_tests > 0
    scene.update([mesh.nodes + 5.0 * body for body, mesh in enumerate(scene.meshes)])
    assert repr(scene.penetration()) == "Penetration(0 nodes)"


def test_a_body_folded_into_itself(make_box):
    mesh = make_box((36, 2, 2), size=(36.0, 2.0, 2.0))
    angle = mesh.nodes[:, 0] / 36 * 2 * np.pi * 1.1
    radius = 7.0 - mesh.nodes[:, 1] + 1.3 * angle / (2 * np.pi)
    z = mesh.nodes[:, 2] + 0.01 * angle
    folded = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    scene = palpate.Scene(mesh)
    scene.update([folded])
    found = scene.penetration()
    assert len(found) > 0
    assert (found.bodies == 0).all()
    assert len(scene.penetration(self_contact=False)) == 0
    # The two walls of the roll leave each other along the radius.
    nodes = folded[found.nodes, :2]
    radial = nodes / np.linalg.norm(nodes, axis=1)[:, None]
    assert (np.abs(np.sum(radial * found.directions[:, :2], axis=1)) > 0.9).mean() > 0.8


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda s: s.closest([[0, 0, 0], [0, np.nan, 0]]), ValueError, r"points\[1\].*finite"),
        (lambda s: s.closest([0, 0, 0]), ValueError, "points: expected shape"),
        (lambda s: s.closest([[0, 0, 0]], max_distance=-1), ValueError, "max_distance"),
        (lambda s: s.closest([[0, 0, 0]], max_distance=np.nan), ValueError, "max_distance"),
        (lambda s: s.closest([[0, 0, 0]], body=7), IndexError, "body: index 7"),
        (lambda s: s.contains([["a", "b", "c"]]), TypeError, "points"),
        (lambda s: s.contains([[0, 0, np.inf]]), ValueError, r"points\[0\]"),
        (lambda s: s.cast([[0, 0, 0]], [[0, 0, 0]]), ValueError, r"directions\[0\].*zero"),
        (lambda s: s.cast([[0, 0, 0]], [[1, 0, 0]] * 2), ValueError, "directions: got 2 rows"),
        (lambda s: s.cast([[0, 0, 0]], [[1, np.nan, 0]]), ValueError, r"directions\[0\]"),
    ],
)
def test_bad_queries_are_refused_by_name(two_boxes, call, error, text):
    with pytest.raises(error, match=text):
        call(two_boxes)
