"""Detection from Python: pairs, methods, moving and changing bodies, bad input."""

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import palpate


def all_pairs(scene):
    twin = palpate.Scene(scene.meshes, method="all-pairs")
    twin.update([scene.positions(body) for body in range(len(scene))])
    return twin.intersections()


def test_two_boxes_that_overlap(make_box):
    left, right = make_box((2, 2, 2)), make_box((2, 2, 2), origin=(0.75, 0.3, 0.2))
    found = palpate.Scene([left, right]).intersections()
    assert len(found) > 0
    assert found.pairs.dtype == np.int32
    assert not found.pairs.flags.writeable
    assert np.array_equal(found.pairs[:, [0, 2]], found.bodies)
    assert np.array_equal(found.pairs[:, [1, 3]], found.triangles)
    assert found.pairs.tolist() == sorted(found.pairs.tolist())
    assert 0 < found.stats.fraction <= 1
    assert found.stats.all_pairs == 96 * 95 // 2


@pytest.mark.parametrize("method", ["wide", "paper", "hash", "all-pairs"])
@pytest.mark.parametrize("leaf_size", [1, 4])
@pytest.mark.parametrize("threads", [1, 3])
def test_methods_agree_while_bodies_move(make_box, method, leaf_size, threads):
    meshes = [make_box((2, 2, 3)), make_box((3, 2, 2), origin=(0.9, 0.1, 0.2))]
    scene = palpate.Scene(meshes, method=method, leaf_size=leaf_size, threads=threads)
    rng = np.random.default_rng(3)
    for _ in range(4):
        scene.update([mesh.nodes + 0.15 * rng.standard_normal(mesh.nodes.shape) for mesh in meshes])
        found = scene.intersections()
        assert len(found) > 0
        assert np.array_equal(found.pairs, all_pairs(scene).pairs)


def test_stacked_positions_are_the_same_as_a_sequence(make_box):
    meshes = [make_box((2, 2, 2)), make_box((1, 2, 3), origin=(0.5, 0.5, 0.5))]
    scene = palpate.Scene(meshes)
    stacked = np.concatenate([mesh.nodes for mesh in meshes]) * 1.25
    assert scene.node_offsets.tolist() == [0, 27, 27 + 24]
    assert scene.triangle_offsets.tolist()[-1] == sum(len(mesh.triangles) for mesh in meshes)
    scene.update(stacked)
    by_stack = scene.intersections().pairs
    scene.update(np.split(stacked, scene.node_offsets[1:-1]))
    assert np.array_equal(scene.intersections().pairs, by_stack)
    scene.update(stacked.astype(np.float32))
    scene.update(np.asfortranarray(stacked))
    scene.update([part.tolist() for part in np.split(stacked, scene.node_offsets[1:-1])])


def test_bodies_come_and_go(make_box, cube):
    scene = palpate.Scene([make_box((2, 2, 2))])
    assert scene.add(cube, name="cube") == 1
    assert len(scene.intersections()) > 0
    scene.replace("cube", cube.with_nodes(cube.nodes + 5.0))
    assert len(scene.intersections()) == 0
    scene.replace(1, make_box((3, 1, 1), origin=(0.5, 0.5, 0.5)))
    assert np.array_equal(scene.intersections().pairs, all_pairs(scene).pairs)
    scene.remove("body_1")
    assert scene.names == ("cube",)
    assert len(scene.intersections()) == 0


def test_self_contact_can_be_left_out(make_box):
    mesh = make_box((12, 1, 1), size=(6.0, 1.0, 1.0))
    nodes = mesh.nodes.copy()
    angle = nodes[:, 0] / 6.0 * 2 * np.pi * 1.05
    radius = 2.0 - nodes[:, 1]
    folded = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), nodes[:, 2]])
    scene = palpate.Scene(mesh.with_nodes(folded))
    assert len(scene.intersections()) > 0
    assert len(scene.intersections(self_contact=False)) == 0


def test_same_leaf_pairs_are_the_papers_exemption(make_box):
    mesh = make_box((2, 2, 2))
    crumpled = np.random.default_rng(5).random(mesh.nodes.shape)
    scene = palpate.Scene(mesh, leaf_size=1000, method="paper")
    scene.update([crumpled])
    assert len(scene.intersections(same_leaf=False)) == 0
    assert len(scene.intersections()) > 0


GOOD = np.zeros((8, 3))
BAD_POSITIONS = [
    ([], ValueError, "expected 2 arrays, one per body, got 0"),
    ([GOOD], ValueError, "expected 2 arrays"),
    (GOOD, ValueError, r"expected shape \(16, 3\), got \(8, 3\)"),
    ([GOOD, GOOD[:7]], ValueError, r"positions\[1\]: expected shape \(8, 3\), got \(7, 3\)"),
    ([GOOD, GOOD[:, :2]], ValueError, r"positions\[1\]"),
    ([GOOD, GOOD.astype(complex)], TypeError, "complex"),
    ([GOOD, "nodes"], (TypeError, ValueError), r"positions\[1\]"),
    (None, TypeError, "positions: expected a sequence"),
    (7, TypeError, "positions: expected a sequence"),
    ([GOOD, np.full((8, 3), np.nan)], ValueError, "finite"),
    ([GOOD, np.full((8, 3), np.inf)], ValueError, r"positions\[1\]\[0\]"),
]


@pytest.mark.parametrize(("positions", "error", "text"), BAD_POSITIONS)
def test_bad_positions_leave_the_scene_as_it_was(cube, positions, error, text):
    scene = palpate.Scene([cube, cube.with_nodes(cube.nodes + 0.5)])
    before = scene.intersections().pairs
    with pytest.raises(error, match=text):
        scene.update(positions)
    assert np.array_equal(scene.intersections().pairs, before)
    assert np.array_equal(scene.positions(0), cube.nodes)


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"leaf_size": 0}, ValueError, "leaf_size"),
        ({"leaf_size": 1.5}, TypeError, "leaf_size"),
        ({"method": "magic"}, ValueError, "method: expected one of paper, all-pairs, hash, wide"),
        ({"split": "best"}, ValueError, "split"),
        ({"threads": 0}, ValueError, "threads"),
    ],
)
def test_bad_options_are_refused_by_name(cube, options, error, text):
    with pytest.raises(error, match=text):
        palpate.Scene([cube], **options)


def test_bodies_are_checked(cube):
    with pytest.raises(TypeError, match=r"bodies\[1\]: expected a palpate.Mesh, got int"):
        palpate.Scene([cube, 7])
    scene = palpate.Scene([cube])
    with pytest.raises(IndexError, match="body: index 3 is out of range"):
        scene.remove(3)
    with pytest.raises(ValueError, match="no body is named 'liver'"):
        scene.positions("liver")


def test_two_threads_may_use_one_scene(make_box):
    scene = palpate.Scene([make_box((3, 3, 3)), make_box((3, 3, 3), origin=(0.5, 0.4, 0.3))])
    expected = scene.intersections().pairs
    wrong = []

    def work():
        for _ in range(20):
            if not np.array_equal(scene.intersections().pairs, expected):
                wrong.append(1)

    workers = [threading.Thread(target=work) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert wrong == []


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([1, 2, 7]),
    st.sampled_from(["wide", "paper", "hash"]),
    st.sampled_from([0.0, 0.5, 1e8]),
    st.sampled_from([1e-9, 1.0, 1e9]),
    st.booleans(),
)
def test_any_scene_gives_the_pairs_of_the_double_loop(seed, leaf_size, method, offset, scale, grid):
    rng = np.random.default_rng(seed)
    from conftest import box

    meshes = [box((2, 1, 2)), box((1, 2, 1))]
    scene = palpate.Scene(meshes, leaf_size=leaf_size, method=method)
    draw = (lambda shape: rng.integers(0, 4, shape) / 4.0) if grid else rng.random
    scene.update([(draw(mesh.nodes.shape) + offset) * scale for mesh in meshes])
    assert np.array_equal(scene.intersections().pairs, all_pairs(scene).pairs)


def test_real_organs_touch_where_they_are_known_to(organs):
    if organs is None:
        return
    names = ["aorta_paper", "kidney_l_paper", "kidney_r_paper", "vena_cava_paper"]
    scene = palpate.Scene([palpate.read_mesh(organs / f"{name}.vtk") for name in names])
    found = scene.intersections()
    counts = {}
    for pair in found.bodies.tolist():
        counts[tuple(pair)] = counts.get(tuple(pair), 0) + 1
    assert counts == {(0, 3): 37, (2, 3): 14}


def test_memory_is_told_by_part(make_box):
    mesh = make_box((12, 12, 12))
    scene = palpate.Scene([mesh])
    memory = scene.memory()
    parts = ["nodes", "elements", "triangle_boxes", "feature_boxes"]
    parts += ["triangle_masks", "feature_masks"]
    assert sum(memory[part] for part in parts) == memory["layout"]
    assert memory["layout_per_triangle"] == memory["layout"] / len(mesh.triangles)
    assert memory["layout_per_triangle"] <= 160
    assert palpate.Scene([mesh], method="paper").memory()["layout"] == 0
