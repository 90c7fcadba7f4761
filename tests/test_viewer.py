"""The viewer's session, without a browser."""

import numpy as np
import pytest

import palpate
from palpate.viewer import NullViewer
from palpate.viewer.grip import patch
from palpate.viewer.live import LivePlayer
from palpate.viewer.protocol import PROTOCOL, ProtocolError
from palpate.viewer.surface import Surfaces


def test_a_page_gets_all_it_needs(viewer):
    assert viewer.sent == ["hello", "scene", "state", "frame"]
    hello, scene = viewer.header("hello"), viewer.header("scene")
    assert (hello["protocol"], hello["mode"]) == (PROTOCOL, "live")
    assert [body["name"] for body in scene["bodies"]] == ["lower", "middle", "upper", "tray"]
    assert scene["up"] == [0, 0, 1]
    rest = [viewer.arrays("scene")[f"rest/{i}"] for i in range(4)]
    assert np.array_equal(viewer.arrays("frame")["positions"], np.concatenate(rest))


def test_it_plays_what_the_simulation_does(viewer):
    by_hand = palpate.Simulation("small")
    by_hand.step(9)
    viewer.send({"type": "step", "count": 9})
    meshes = [body.mesh for body in by_hand.model.bodies]
    expected = Surfaces(meshes).stack(by_hand.positions)
    assert np.array_equal(viewer.arrays("frame")["positions"], expected)
    numbers = viewer.header("frame")["numbers"]
    assert numbers["all_pairs"] > 1e6
    assert sum(numbers["times"].values()) > 0


@pytest.mark.parametrize("speed", [0.5, 1, 2])
def test_it_keeps_the_time_that_was_asked_for(viewer, speed):
    viewer.send({"type": "speed", "value": speed})
    viewer.send({"type": "play", "on": True})
    viewer.run(0.5)
    assert viewer.header("frame")["time"] == pytest.approx(0.5 * speed, abs=0.05)
    viewer.send({"type": "play", "on": False})
    before = viewer.header("frame")["time"]
    viewer.run(0.2)
    assert viewer.header("frame")["time"] == before
    assert viewer.header("state")["playing"] is False


def test_reset_returns_to_the_start(viewer):
    start = viewer.arrays("frame")["positions"].copy()
    viewer.send({"type": "step", "count": 5})
    assert not np.array_equal(viewer.arrays("frame")["positions"], start)
    viewer.send({"type": "reset"})
    assert viewer.header("frame")["time"] == 0
    assert np.array_equal(viewer.arrays("frame")["positions"], start)


def test_settings_change_the_model_and_keep_the_state(viewer):
    viewer.send({"type": "step", "count": 6})
    before = viewer.arrays("frame")["positions"].copy()
    viewer.send(
        {"type": "settings", "body": 1, "material": {"young": 9e4}, "contact": {"friction": 0.7}}
    )
    assert np.array_equal(viewer.arrays("frame")["positions"], before)
    bodies = viewer.header("state")["bodies"]
    assert bodies[1]["material"]["young"] == 9e4
    assert bodies[1]["contact"]["friction"] == 0.7
    assert bodies[0]["material"]["young"] == 6000
    viewer.send({"type": "settings", "time_step": 0.005, "gravity": [0, 0, 0]})
    assert viewer.header("state")["time_step"] == 0.005
    assert viewer.header("frame")["time"] == pytest.approx(0.1)
    viewer.send({"type": "step", "count": 2})
    assert viewer.header("frame")["time"] == pytest.approx(0.11)
    viewer.send({"type": "reset"})
    assert viewer.header("state")["gravity"] == [0, 0, 0]
    assert viewer.header("frame")["time"] == 0


def test_a_fall_goes_on_when_settings_change(make_box):
    viewer = NullViewer(palpate.Simulation([make_box((1, 1, 2))]))
    viewer.send({"type": "step", "count": 6})
    before = viewer.arrays("frame")["positions"].copy()
    viewer.send({"type": "settings", "gravity": [0, 0, 0], "time_step": 0.01})
    viewer.send({"type": "step", "count": 10})
    fallen = (before - viewer.arrays("frame")["positions"])[:, 2]
    assert np.allclose(fallen, 0.1 * 9.81 * 0.1, rtol=1e-3)


def test_a_path_goes_on_when_settings_change(make_box):
    moving = palpate.Body(
        make_box((1, 1, 1)),
        name="tool",
        rigid=[palpate.RigidKey(0.0), palpate.RigidKey(1.0, translation=(0.0, 0.0, 1.0))],
    )
    soft = palpate.Body(make_box((1, 1, 1), origin=(3, 0, 0)))
    viewer = NullViewer(palpate.Simulation(palpate.Model([moving, soft], gravity=(0, 0, 0))))
    viewer.send({"type": "step", "count": 30})
    before = viewer.arrays("frame")["positions"].copy()
    viewer.send({"type": "settings", "body": 1, "material": {"young": 9e4}})
    assert np.allclose(viewer.arrays("frame")["positions"], before, atol=1e-6)
    viewer.send({"type": "step", "count": 15})
    assert viewer.arrays("frame")["positions"][:8, 2].min() == pytest.approx(0.75, abs=1e-5)


def test_ties_stay_when_settings_change(make_box):
    lower, upper = make_box((2, 2, 2)), make_box((2, 2, 2), origin=(0.3, 0, 1.02))
    model = palpate.Model(
        [palpate.Body(lower, name="lower", rigid=()), palpate.Body(upper, name="upper")],
        attachments=[palpate.Attachment("upper", "lower", within=0.1, stiffness=1e6)],
    )
    tied = model.attachments[0]
    assert 0 < len(tied.nodes) < len(upper.nodes)
    viewer = NullViewer(player := LivePlayer(palpate.Simulation(model)))
    viewer.send({"type": "step", "count": 3})
    viewer.send({"type": "settings", "body": 1, "material": {"young": 9e5}})
    (again,) = player.simulation.model.attachments
    assert np.array_equal(again.nodes, tied.nodes)
    assert again.stiffness == tied.stiffness


def test_bad_settings_change_nothing_and_are_told(viewer):
    viewer.send({"type": "settings", "body": 17, "material": {"young": 9e4}})
    assert "17" in viewer.header("notice")["text"]
    viewer.send({"type": "undo"})
    assert "undo" in viewer.header("notice")["text"]
    viewer.send({"type": "step", "count": 1})
    assert viewer.header("frame")["time"] > 0


def test_pages_get_what_any_of_them_wants(viewer):
    viewer.send({"type": "step", "count": 40})
    assert list(viewer.arrays("frame")) == ["positions"]
    show = {"type": "show", "field": "deformation", "contacts": True, "touching": True}
    viewer.send(show, client=1)
    viewer.send({"type": "show", "field": None, "contacts": False, "touching": False}, client=2)
    arrays = viewer.arrays("frame")
    assert {"field/deformation", "contact_points", "touching"} <= set(arrays)
    assert len(arrays["contact_points"]) == len(arrays["contact_forces"]) > 10
    viewer.send({"type": "show", "field": "depth", "contacts": False, "touching": False}, client=2)
    for field in ("displacement", "deformation", "strain", "stress", "force"):
        viewer.send({**show, "field": field})
        values = viewer.arrays("frame")[f"field/{field}"]
        assert len(values) == len(arrays["positions"])
        # The tray does not deform, but to round-off of the fit.
        assert 0 <= values.min() < 1e-12 * values.max()
    assert len(viewer.arrays("frame")["field/depth"]) == len(values)
    viewer.send({"type": "show", "field": None, "contacts": False, "touching": False}, client=2)
    viewer.leave(1)
    viewer.send({"type": "step", "count": 1}, client=2)
    assert list(viewer.arrays("frame")) == ["positions"]


def test_boxes_of_a_tree_level_hold_the_bodies(viewer):
    viewer.send({"type": "step", "count": 20})
    show = {"type": "show", "field": None, "contacts": False, "touching": False}
    viewer.send({**show, "level": 0}, client=1)
    viewer.send({**show, "level": 5}, client=2)
    frame, scene = viewer.arrays("frame"), viewer.arrays("scene")
    counts = frame["box_counts/5"]
    assert list(frame["box_counts/0"]) == [1] * 4
    assert len(frame["boxes/5"]) == counts.sum()
    assert counts.min() > 8
    ends = np.cumsum([len(scene[f"rest/{i}"]) for i in range(4)])
    for points, whole, boxes in zip(
        np.split(frame["positions"], ends[:-1]),
        frame["boxes/0"],
        np.split(frame["boxes/5"], np.cumsum(counts)[:-1]),
        strict=True,
    ):
        assert np.array_equal(whole, [*points.min(axis=0), *points.max(axis=0)])
        low, high = boxes[:, None, :3], boxes[:, None, 3:]
        assert ((points >= low) & (points <= high)).all(axis=2).any(axis=0).all()
    with pytest.raises(ProtocolError, match="level: expected a whole number from 0 to 16"):
        viewer.send({**show, "level": 99})


def highest(viewer, body):
    """Row of a body's highest surface node, and where it is."""
    starts = np.cumsum([0, *(len(viewer.arrays("scene")[f"rest/{i}"]) for i in range(body + 1))])
    part = viewer.arrays("frame")["positions"][starts[body] : starts[body + 1]]
    return int(part[:, 2].argmax()), part[part[:, 2].argmax()].astype(np.float64)


def shifted(at, height):
    return [at[0], at[1], at[2] + height]


def test_tissue_is_pulled_and_let_go(viewer):
    viewer.send({"type": "step", "count": 20})
    node, at = highest(viewer, 0)
    grab = {"type": "grab", "grip": 4, "body": 0, "node": node, "strength": 1.0}
    viewer.send({**grab, "target": at.tolist()})
    viewer.send({"type": "drag", "grip": 4, "target": shifted(at, 0.15)})
    viewer.send({"type": "step", "count": 30})
    (pull,) = viewer.header("frame")["pulls"]
    assert pull["force"][2] > 0.05
    assert pull["from"][2] > at[2] + 0.05
    # The spring: force along its length, by its stiffness.
    along = np.array(pull["to"]) - pull["from"]
    assert np.cross(along, pull["force"]) == pytest.approx(
        [0, 0, 0], abs=0.2 * np.hypot(*along[:2]) + 2e-3
    )
    viewer.send({**grab, "grip": 5, "target": at.tolist()}, client=2)
    assert len(viewer.header("frame")["pulls"]) == 2
    viewer.leave(2)
    viewer.send({"type": "release", "grip": 4})
    assert viewer.header("frame")["pulls"] == []
    viewer.send({"type": "drag", "grip": 4, "target": [0, 0, 0]})  # too late: no harm
    viewer.send({**grab, "body": 3, "target": [0, 0, 0]})
    assert "rigid" in viewer.header("notice")["text"]
    viewer.send({**grab, "node": 10**6, "target": [0, 0, 0]})
    assert "no node" in viewer.header("notice")["text"]


def test_a_hand_holds_the_surface_around_its_node(make_box):
    mesh = make_box((4, 4, 4), size=0.04)
    corner = int(np.argmin(mesh.nodes.sum(axis=1)))
    beside = int(np.argmin(np.linalg.norm(mesh.nodes - [0.01, 0, 0], axis=1)))
    body = palpate.Body(mesh, fixed_nodes=[beside])
    nodes, shares = patch(body, mesh.nodes, corner, 0.0)
    assert (list(nodes), list(shares)) == ([corner], [1.0])
    nodes, shares = patch(body, mesh.nodes, corner, 0.0201)
    away = np.linalg.norm(mesh.nodes - mesh.nodes[corner], axis=1)
    within = np.intersect1d(np.flatnonzero(away < 0.0201), mesh.surface_nodes)
    assert np.array_equal(np.sort(nodes), np.setdiff1d(within, [beside]))
    assert nodes[0] == corner
    assert shares.sum() == pytest.approx(1)
    assert (np.diff(shares) <= 0).all()
    assert (shares > 0).all()


def test_a_fold_beside_a_hand_stays_free(make_box):
    near, far = make_box((2, 2, 2), size=0.02), make_box((2, 2, 2), size=0.02, origin=(0.021, 0, 0))
    mesh = palpate.Mesh(
        np.concatenate([near.nodes, far.nodes]),
        tetrahedra=np.concatenate([near.tetrahedra, far.tetrahedra + len(near.nodes)]),
    )
    nodes, _ = patch(palpate.Body(mesh), mesh.nodes, near.surface_nodes[-1], 0.015)
    assert len(nodes) > 1
    assert nodes.max() < len(near.nodes)


def test_a_patch_is_pulled_together_and_what_a_cut_takes_is_let_go(viewer):
    viewer.send({"type": "step", "count": 20})
    node, at = highest(viewer, 0)
    grab = {"type": "grab", "grip": 4, "body": 0, "node": node, "strength": 1.0}
    forces = []
    for radius in (None, 0.015):
        viewer.send({**grab, "radius": radius, "target": at.tolist()})
        viewer.send({"type": "drag", "grip": 4, "target": shifted(at, 0.15)})
        viewer.send({"type": "step", "count": 30})
        (pull,) = viewer.header("frame")["pulls"]
        forces.append(pull["force"][2])
        held = np.array(pull["held"])
        if radius is None:
            assert pull["held"] == [pull["from"]]
            assert pull["from"][2] > at[2] + 0.05
        viewer.send({"type": "release", "grip": 4})
        viewer.send({"type": "reset"})
        viewer.send({"type": "step", "count": 20})
    assert 3 <= len(held) <= 24
    assert np.ptp(held, axis=0).max() < 0.035  # no spike
    assert forces[1] == pytest.approx(forces[0], rel=0.5)
    # A cut beside the hand leaves it what it can.
    viewer.send({**grab, "radius": 0.015, "target": at.tolist()})
    edges = [[[x, at[1] + 0.002, at[2] - 0.006], [x, at[1] + 0.002, 1.0]] for x in (-1.0, 1.0)]
    viewer.send({"type": "cut", "edges": edges})
    viewer.send({"type": "step", "count": 3})
    assert len(viewer.header("frame")["pulls"]) <= 1
    viewer.send({"type": "release", "grip": 4})
    assert viewer.header("frame")["pulls"] == []


def test_the_probe_presses_where_it_is_led(viewer):
    viewer.send({"type": "step", "count": 20})
    _, at = highest(viewer, 2)
    before = viewer.arrays("frame")["positions"].copy()
    lead = {"type": "tool", "direction": [0, 0, -1], "radius": 0.005}
    viewer.send({**lead, "tip": shifted(at, 0.004)})
    assert viewer.header("scene")["bodies"][-1]["name"] == "viewer probe"
    assert np.array_equal(viewer.arrays("frame")["positions"][: len(before)], before)
    viewer.send({**lead, "tip": shifted(at, -0.01)})
    viewer.send({"type": "step", "count": 12})
    tool = viewer.header("frame")["tool"]
    assert tool["tip"] == pytest.approx(shifted(at, -0.01))
    assert tool["force"][2] > 0.05
    assert highest(viewer, 4)[1][2] > at[2] + 0.05  # the rod stands above its tip
    # A change of settings leaves it in the hand.
    viewer.send({"type": "settings", "body": 0, "material": {"young": 7000}})
    viewer.send({"type": "step", "count": 2})
    assert viewer.header("frame")["tool"]["force"][2] > 0.05
    viewer.send({"type": "tool_away"})
    viewer.send({"type": "step", "count": 30})
    assert viewer.header("frame")["tool"] is None
    assert viewer.arrays("frame")["positions"][-50:, 2].min() > at[2] + 0.05
    viewer.send({"type": "reset"})
    viewer.send({"type": "step", "count": 2})
    assert viewer.header("frame")["numbers"]["penetrating_nodes"] == 0


def test_a_model_error_is_shown_and_mended(tmp_path):
    path = tmp_path / "model.bml"
    path.write_text("BRANCH {\n  TREE { NE nothing.seg }\n}\n")
    viewer = NullViewer(lambda: LivePlayer(palpate.Simulation(path)))
    assert viewer.sent == ["problem"]
    problem = viewer.header("problem")
    with pytest.raises(palpate.ModelError) as caught:
        palpate.read_model(path)
    assert problem["text"] == str(caught.value)
    viewer.send({"type": "play", "on": True})
    path.write_text((palpate.model.MODELS / "small.bml").read_text())
    for mesh in ("small.seg", "tray.seg"):
        (tmp_path / mesh).write_bytes((palpate.model.MODELS / mesh).read_bytes())
    viewer.send({"type": "reload"})
    assert viewer.sent[-4:] == ["hello", "scene", "state", "frame"]


def test_a_step_that_fails_pauses_and_says_why(make_box):
    class Failing(LivePlayer):
        def advance(self):
            raise palpate.SimulationError("the test broke it")

    viewer = NullViewer(lambda: Failing(palpate.Simulation([make_box((1, 1, 1))])))
    viewer.send({"type": "play", "on": True})
    assert "the test broke it" in viewer.header("problem")["text"]
    assert viewer.header("state")["playing"] is False
