"""The viewer: its protocol, its session without a browser, its server against strangers."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

import palpate
from palpate.results.stress import Strain
from palpate.viewer import NullViewer, Viewer, ViewerError
from palpate.viewer.grip import patch
from palpate.viewer.live import LivePlayer
from palpate.viewer.page import page_files
from palpate.viewer.probe import aim, probe_mesh
from palpate.viewer.protocol import PROTOCOL, ProtocolError, decode, encode, parse_command
from palpate.viewer.surface import Surfaces, deformation

_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=10,
)


# --- protocol


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from(["float32", "uint32", "uint16", "uint8"]), st.integers(0, 7)),
        max_size=4,
    ),
    st.text(max_size=20),
)
def test_messages_come_back(kinds, title):
    arrays = {
        f"a/{i}": np.arange(3 * count, dtype=dtype).reshape(count, 3)
        for i, (dtype, count) in enumerate(kinds)
    }
    message = encode("hello", {"title": title}, arrays)
    header, found = decode(message)
    assert (header["type"], header["title"]) == ("hello", title)
    assert len(message) % 4 == 0
    assert list(found) == list(arrays)
    for name, values in arrays.items():
        assert found[name].dtype == values.dtype
        assert np.array_equal(found[name], values)


def test_a_message_is_what_its_description_says():
    message = encode("frame", {"n": 1}, {"p": np.array([[1.5, 2, 3]], dtype=np.float32)})
    size = int.from_bytes(message[:4], "little")
    assert json.loads(message[4 : 4 + size]) == {
        "type": "frame",
        "n": 1,
        "arrays": [["p", "float32", [1, 3]]],
    }
    assert message[4 + size :] == np.array([1.5, 2, 3], dtype="<f4").tobytes()


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=60) | st.text(max_size=60) | _JSON.map(json.dumps))
def test_garbage_is_refused(text):
    with pytest.raises(ProtocolError):
        parse_command(text)


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from(["grab", "drag", "play", "speed", "settings", "cut", "tool", "show", "seek"]),
    st.dictionaries(
        st.sampled_from(["grip", "body", "node", "target", "on", "value", "edges", "material"]),
        _JSON,
    ),
)
def test_half_right_commands_are_complete_or_refused(kind, entries):
    try:
        command = parse_command(json.dumps({**entries, "type": kind}))
    except ProtocolError:
        return
    assert command["type"] == kind
    assert np.isfinite(command.get("target", (0.0,))).all()


@pytest.mark.parametrize(
    "command",
    [
        {"type": "play", "on": 1},
        {"type": "speed", "value": float("nan")},
        {"type": "speed", "value": 0},
        {"type": "step", "count": 10**9},
        {"type": "drag", "grip": 1, "target": [0, 0, float("inf")]},
        {"type": "drag", "grip": 1, "target": [0, 0]},
        {"type": "settings", "material": {"law": "evil"}},
        {"type": "settings", "body": 0, "material": {"poisson": 0.5}},
        {"type": "cut", "edges": [[[0, 0, 0], [0, 0, 1]]]},
        {"type": "__class__"},
    ],
)
def test_wrong_values_are_refused(command):
    with pytest.raises(ProtocolError):
        parse_command(json.dumps(command))


# --- what is seen


def test_surfaces_are_the_surface(make_box):
    meshes = [make_box((3, 3, 3)), make_box((1, 2, 1), origin=(2, 0, 0))]
    surfaces = Surfaces(meshes)
    positions = [mesh.nodes + index for index, mesh in enumerate(meshes)]
    stacked = surfaces.stack(positions)
    assert len(stacked) == sum(len(mesh.surface_nodes) for mesh in meshes)
    for index, mesh in enumerate(meshes):
        part = stacked[surfaces.offsets[index] : surfaces.offsets[index + 1]]
        seen = part[surfaces.triangles[index]]
        assert np.allclose(seen, positions[index][mesh.triangles], atol=1e-6)
    assert surfaces.fits(positions)
    assert not surfaces.fits(positions[::-1])
    pairs = np.array([[0, 5, 1, 2], [0, 5, 1, 0]])
    first = len(meshes[0].triangles)
    assert surfaces.triangle_numbers(pairs).tolist() == [5, first, first + 2]


def test_deformation_does_not_see_rigid_motion(make_box):
    nodes = make_box((2, 2, 3)).nodes
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    moved = nodes @ turn.T + (1, 2, 3)
    assert np.allclose(deformation(nodes, moved), 0, atol=1e-12)
    assert deformation(nodes, moved * (1, 1, 1.5)).max() > 0.05
    assert deformation(nodes, nodes * (1, 1, -1)).max() > 0.1  # a mirror is no motion


def test_strain_of_a_stretch(make_box):
    mesh = make_box((2, 3, 2))
    strain = Strain(mesh, seen=True)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    assert np.allclose(strain.at_nodes(mesh.nodes @ turn.T + 7), 0, atol=1e-6)
    assert np.allclose(
        strain.at_nodes(2 * mesh.nodes), 0, atol=1e-6
    )  # it changes volume, not shape
    stretched = strain.at_nodes((mesh.nodes * (1.2, 1, 1)) @ turn.T)
    assert np.allclose(stretched, 2 / 3 * (1.2**2 - 1) / 2)
    # A shear of random nodes: the plain formula, node by node.
    nodes = mesh.nodes + np.random.default_rng(3).normal(scale=0.05, size=mesh.nodes.shape)
    values = []
    for tetrahedron in mesh.tetrahedra:
        rest, now = mesh.nodes[tetrahedron], nodes[tetrahedron]
        gradient = np.linalg.solve(rest[1:] - rest[0], now[1:] - now[0]).T
        green = (gradient.T @ gradient - np.eye(3)) / 2
        deviator = green - np.eye(3) * np.trace(green) / 3
        values.append(np.sqrt(2 / 3 * (deviator**2).sum()))
    mean = [
        np.mean(np.array(values)[(mesh.tetrahedra == k).any(axis=1)]) for k in mesh.surface_nodes
    ]
    assert np.allclose(strain.at_nodes(nodes)[mesh.surface_nodes], mean, rtol=1e-4)
    surface = Strain(palpate.Mesh(mesh.nodes, triangles=mesh.triangles), seen=True)
    assert not surface.at_nodes(mesh.nodes * 2).any()


def test_the_probe_is_closed_and_points_where_it_aims():
    mesh = probe_mesh(0.01, 0.1)
    sides = np.sort(
        np.concatenate(
            [mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]]
        ),
        axis=1,
    )
    assert (np.unique(sides, axis=0, return_counts=True)[1] == 2).all()
    a, b, c = (mesh.nodes[mesh.triangles[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(np.pi * 0.01**2 * (0.1 - 0.01 / 3), rel=0.03)
    for direction in [(0, 0, -1), (1, 0, 0), (0.3, -2, 0.5), (0, 0, 0)]:
        rotation = aim(direction)
        assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1)
        if any(direction):
            unit = np.array(direction) / np.linalg.norm(direction)
            assert np.allclose(rotation @ (0, 0, -1), unit)


# --- a session without a browser


@pytest.fixture
def viewer():
    return NullViewer(palpate.Simulation("small"))


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


def stroke_through(viewer, body):
    """Edges of a blade that passes through the middle of a body, across x."""
    start = sum(len(viewer.arrays("scene")[f"rest/{i}"]) for i in range(body))
    count = len(viewer.arrays("scene")[f"rest/{body}"])
    part = viewer.arrays("frame")["positions"][start : start + count].astype(np.float64)
    middle, half = (part.min(axis=0) + part.max(axis=0)) / 2, np.ptp(part, axis=0) / 2 + 0.003
    return [
        [
            [middle[0], middle[1] + side * half[1], middle[2] + half[2]],
            [middle[0], middle[1] + side * half[1], middle[2] - half[2]],
        ]
        for side in (-1.0, -0.3, 0.3, 1.0)
    ]


def test_a_stroke_cuts_and_undo_mends(viewer):
    viewer.send({"type": "step", "count": 25})
    whole, before = viewer.arrays("scene"), viewer.arrays("frame")["positions"].copy()
    version = viewer.header("scene")["version"]
    viewer.send({"type": "cut", "edges": stroke_through(viewer, 2)})
    assert "upper" in viewer.header("notice")["text"]
    assert viewer.header("scene")["version"] > version
    assert viewer.header("frame")["version"] == viewer.header("scene")["version"]
    assert len(viewer.arrays("scene")["triangles/2"]) > len(whole["triangles/2"])
    assert np.array_equal(viewer.arrays("scene")["triangles/3"], whole["triangles/3"])
    assert viewer.header("state")["undo"] == 1
    inner = viewer.arrays("scene")["cut/2"]
    assert "cut/3" not in viewer.arrays("scene")
    # The surface that was there has kept its area; the two lips are alike.
    rest, triangles = (viewer.arrays("scene")[f"{name}/2"] for name in ("rest", "triangles"))
    a, b, c = np.moveaxis(rest[triangles].astype(np.float64), 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    outer = whole["rest/2"][whole["triangles/2"]].astype(np.float64)
    crosses = np.cross(outer[:, 1] - outer[:, 0], outer[:, 2] - outer[:, 0])
    assert areas[inner == 0].sum() == pytest.approx(np.linalg.norm(crosses, axis=1).sum() / 2)
    assert inner.sum() % 2 == 0
    told = re.search(r"upper: ([0-9.]+) cm²", viewer.header("notice")["text"])
    assert areas[inner == 1].sum() == pytest.approx(2e-4 * float(told[1]), rel=0.05)
    viewer.send({"type": "step", "count": 5})
    assert np.isfinite(viewer.arrays("frame")["positions"]).all()
    viewer.send({"type": "separate"})
    names = [body["name"] for body in viewer.header("scene")["bodies"]]
    assert names[:4] == ["lower", "middle", "upper", "tray"]
    assert len(names) > 4
    for _ in range(2):
        viewer.send({"type": "undo"})
    assert viewer.header("state")["undo"] == 0
    assert np.array_equal(viewer.arrays("frame")["positions"], before)
    for name, array in whole.items():
        assert np.array_equal(viewer.arrays("scene")[name], array)
    far = (np.array(stroke_through(viewer, 2)) + 1).tolist()
    viewer.send({"type": "cut", "edges": far})
    assert "no tissue" in viewer.header("notice")["text"]
    assert viewer.header("state")["undo"] == 0


@pytest.fixture
def moving(viewer):
    """A viewer that plays."""
    viewer.send({"type": "speed", "value": 1})
    viewer.send({"type": "play", "on": True})
    viewer.run(0.4)
    return viewer


def steps(viewer, count):
    """Let it play so many frames; what was sent meanwhile."""
    number, known = viewer.header("frame")["number"], len(viewer.sent)
    for _ in range(1000):
        if viewer.header("frame")["number"] >= number + count:
            break
        viewer.run(0.004)
    return viewer.sent[known:]


def test_while_it_plays_a_stroke_opens_some_steps_later_and_is_told(moving):
    whole, version = moving.arrays("scene"), moving.header("scene")["version"]
    moving.send({"type": "cut", "edges": stroke_through(moving, 2)})
    assert moving.header("state")["undo"] == 1
    assert moving.header("scene")["version"] == version
    sent = steps(moving, 4)
    assert set(sent) == {"frame"}, "the picture goes on"
    sent = steps(moving, 4)
    assert sent.count("scene") == sent.count("notice") == 1
    assert sent.index("scene") < sent.index("notice") < len(sent) - sent[::-1].index("frame")
    told = moving.header("notice")["text"]
    assert re.fullmatch(r".*upper: [0-9.]+ cm² cut.* \(in \d+ ms beside the steps\)", told)
    assert len(moving.arrays("scene")["triangles/2"]) > len(whole["triangles/2"])
    assert moving.arrays("scene")["cut/2"].any()
    assert moving.header("frame")["version"] == moving.header("scene")["version"] > version
    assert moving.header("state")["undo"] == 1
    steps(moving, 5)
    moving.send({"type": "undo"})
    assert moving.header("state")["undo"] == 0
    for name, array in whole.items():
        assert np.array_equal(moving.arrays("scene")[name], array)
    assert "notice" not in steps(moving, 12), "what was undone does not come back"


def test_what_takes_longer_to_prepare_opens_later(monkeypatch):
    simulation = palpate.Simulation("small", time_step=1 / 600)
    player = LivePlayer(simulation)
    viewer = NullViewer(player)
    edges = np.array(stroke_through(viewer, 2))
    edges[:, 1] = edges.mean(axis=1)  # down to its middle
    blade = palpate.Blade.stroke(edges)
    assert player._delay(blade) == 50
    count = len(simulation.positions[2])
    monkeypatch.setattr("palpate.viewer.live._DELAY_OF_A_NODE", 1 / 600)
    assert player._delay(blade) == count, "of the tray, and of what it passes by, none"
    through = palpate.Blade.stroke([[[-1, 0, -1], [-1, 0, 1]], [[1, 0, -1], [1, 0, 1]]])
    assert player._delay(through) == sum(len(simulation.positions[body]) for body in range(3))
    monkeypatch.setattr("palpate.viewer.live._DELAY_OF_A_NODE", 1)
    assert player._delay(blade) == 1000
    slow = LivePlayer(palpate.Simulation("small", time_step=0.5))
    monkeypatch.setattr("palpate.viewer.live._DELAY_OF_A_NODE", 0)
    assert slow._delay(blade) == 1


def test_a_stroke_under_way_that_meets_nothing_is_told(moving):
    far = (np.array(stroke_through(moving, 2)) + 1).tolist()
    moving.send({"type": "cut", "edges": far})
    sent = steps(moving, 8)
    assert "scene" not in sent
    assert "no tissue" in moving.header("notice")["text"]
    assert moving.header("state")["undo"] == 0


@pytest.mark.parametrize("end", ["undo", "reset", "settings", "tool"])
def test_a_stroke_under_way_is_given_up(moving, end):
    start = moving.arrays("scene")
    commands = {
        "settings": {"type": "settings", "body": 0, "material": {"young": 9000}},
        "tool": {"type": "tool", "tip": [0, 0, 0.3], "direction": [0, 0, -1], "radius": 0.004},
    }
    moving.send({"type": "cut", "edges": stroke_through(moving, 2)})
    steps(moving, 2)
    moving.send(commands.get(end, {"type": end}))
    assert moving.header("state")["undo"] == 0
    known = len(moving.sent)
    steps(moving, 12)
    assert "notice" not in moving.sent[known:]
    if end in commands:
        assert "given up" in moving.header("notice")["text"]
    for body in range(4):
        assert np.array_equal(
            moving.arrays("scene")[f"triangles/{body}"], start[f"triangles/{body}"]
        )
    moving.send({"type": "undo"})
    assert "no cut" in moving.header("notice")["text"]


def test_strokes_that_follow_closely_are_undone_together(moving):
    whole = moving.arrays("scene")
    for body in (0, 2):
        moving.send({"type": "cut", "edges": stroke_through(moving, body)})
        steps(moving, 2)
    sent = steps(moving, 14)
    assert sent.count("notice") == 2
    assert moving.header("state")["undo"] == 1
    both = moving.arrays("scene")
    for name in ("triangles/0", "triangles/2"):
        assert len(both[name]) > len(whole[name])
    moving.send({"type": "undo"})
    for name, array in whole.items():
        assert np.array_equal(moving.arrays("scene")[name], array)
    assert "notice" not in steps(moving, 12)


def test_a_pause_and_a_separation_before_a_stroke_opens(moving):
    whole = moving.arrays("scene")
    moving.send({"type": "cut", "edges": stroke_through(moving, 2)})
    moving.send({"type": "play", "on": False})
    moving.send({"type": "cut", "edges": stroke_through(moving, 0)})
    assert "lower" in moving.header("notice")["text"], "nothing moves: it is cut at once"
    assert moving.header("state")["undo"] == 1
    moving.send({"type": "separate"})
    names = [body["name"] for body in moving.header("scene")["bodies"]]
    assert "lower/2" in names
    moving.send({"type": "step", "count": 8})
    assert "upper" in moving.header("notice")["text"]
    assert moving.header("state")["undo"] == 1
    moving.send({"type": "undo"})
    for name, array in whole.items():
        assert np.array_equal(moving.arrays("scene")[name], array)


def test_cuts_of_the_owner_are_shown_and_not_undone():
    simulation = palpate.Simulation("small")
    viewer = NullViewer(simulation)
    edges = stroke_through(viewer, 2)
    simulation.cut_live(palpate.Blade.stroke(edges), delay=2)
    viewer.send({"type": "step", "count": 4})
    assert "upper" in viewer.header("notice")["text"]
    assert viewer.arrays("scene")["cut/2"].any()
    assert viewer.header("state")["undo"] == 0


def test_a_stroke_that_cannot_be_cut_is_told_and_steps_go_on():
    class Broken:
        """A simulation whose live cut fails when it should open."""

        def __init__(self, simulation):
            self._inner, self.left = simulation, None

        def __getattr__(self, name):
            return getattr(self._inner, name)

        def cut_live(self, blade, *, delay):
            assert len(blade.points) == 8
            self.left = delay

        @property
        def has_live_cuts(self):
            return self.left is not None

        def step(self):
            if self.left == 0:
                self.left = None
                raise palpate.SimulationError("body 2 cannot be cut: the test says so")
            if self.left is not None:
                self.left -= 1
            return self._inner.step()

    player = LivePlayer(palpate.Simulation("small"))
    viewer = NullViewer(player)
    player._simulation = Broken(player._simulation)
    viewer.send({"type": "speed", "value": 1})
    viewer.send({"type": "play", "on": True})
    viewer.run(0.2)
    viewer.send({"type": "cut", "edges": stroke_through(viewer, 2)})
    steps(viewer, 10)
    assert "cannot be cut" in viewer.header("notice")["text"]
    assert viewer.header("state")["playing"] is True
    assert viewer.header("state")["undo"] == 0
    assert "problem" not in viewer.sent


def test_cuts_stay_when_settings_change_and_go_with_a_reset(viewer):
    whole = viewer.arrays("scene")
    viewer.send({"type": "step", "count": 10})
    viewer.send({"type": "cut", "edges": stroke_through(viewer, 0)})
    viewer.send({"type": "separate"})
    cut = viewer.arrays("scene")
    before = viewer.arrays("frame")["positions"].copy()
    viewer.send({"type": "settings", "body": 0, "material": {"young": 9000}})
    assert "undone" in viewer.header("notice")["text"]
    assert viewer.header("state")["undo"] == 0
    assert np.array_equal(viewer.arrays("frame")["positions"], before)
    assert {name: len(array) for name, array in viewer.arrays("scene").items()} == {
        name: len(array) for name, array in cut.items()
    }
    # The probe is added behind the pieces, and found again.
    tip = {"type": "tool", "tip": [0, 0, 0.3], "direction": [0, 0, -1], "radius": 0.004}
    viewer.send(tip)
    viewer.send({"type": "step", "count": 2})
    assert viewer.header("scene")["bodies"][-1]["name"] == "viewer probe"
    assert np.abs(viewer.arrays("frame")["positions"][: len(before)] - before).max() < 0.05
    viewer.send({"type": "reset"})
    assert viewer.header("state")["bodies"][0]["material"]["young"] == 9000
    for name, array in whole.items():
        assert np.array_equal(viewer.arrays("scene")[name], array)


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


def test_one_may_step_it_oneself():
    simulation = palpate.Simulation("small")
    with (
        simulation.view(port=0, browser=False, play=False, block=False) as viewer,
        talk(viewer) as page,
    ):
        assert read(page, "frame")[0]["time"] == 0
        simulation.step(3)
        viewer.update()
        assert read(page, "frame")[0]["time"] == pytest.approx(0.05)


def test_a_fault_of_ours_is_shown(make_box, capsys):
    class Faulty(LivePlayer):
        def advance(self):
            raise RuntimeError("a bug")

    player = Faulty(palpate.Simulation([make_box((1, 1, 1))]))
    with Viewer(lambda: player, port=0) as viewer, talk(viewer) as page:
        assert "a bug" in read(page, "problem")[0]["text"]
        page.send(json.dumps({"type": "show", "field": None, "contacts": True, "touching": True}))
        read(page, "frame")
    assert "a bug" in capsys.readouterr().err


# --- the server


@pytest.fixture(scope="module")
def served():
    simulation = palpate.Simulation("small")
    with Viewer(lambda: LivePlayer(simulation), port=0, title="small") as viewer:
        yield viewer


def talk(viewer, **options):
    return connect(viewer.url.replace("http", "ws") + "socket", **options)


def read(page, kind, seconds=10):
    """The next message of a type; frames are confirmed as a page does."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        header, arrays = decode(page.recv(timeout=seconds))
        if header["type"] == "frame":
            page.send(json.dumps({"type": "ack", "number": header["number"]}))
        if header["type"] == kind:
            return header, arrays
    raise AssertionError(f"no {kind}")


def read_all(page, seconds, see=str):
    """Every message, without confirming any, until the connection ends or nothing comes."""
    while True:
        see(decode(page.recv(timeout=seconds))[0]["type"])


def fetch(viewer, path="", **headers):
    return urllib.request.urlopen(urllib.request.Request(viewer.url + path, headers=headers))


def test_it_serves_the_page_and_nothing_else(served):
    for name in ("", "main.js", "style.css", "three.module.min.js", "icon.svg"):
        with fetch(served, name) as answer:
            assert answer.status == 200
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
            assert len(answer.read()) == int(answer.headers["Content-Length"])
    for name in ("../live.py", "__init__.py", "%2e%2e/live.py", "nothing"):
        with pytest.raises(urllib.error.HTTPError) as caught:
            fetch(served, name)
        assert caught.value.code == 404
        caught.value.close()


def test_the_page_asks_nobody_else():
    for path, file in page_files().items():
        if path != "/three.module.min.js":
            text = file.content.decode()
            assert "https://" not in text.replace('https:" ?', "")
            assert text.count("http://") == text.count("http://www.w3.org/2000/svg")


def test_foreign_pages_are_refused(served):
    for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
        with pytest.raises(urllib.error.HTTPError) as caught:
            fetch(served, **headers)
        assert caught.value.code == 403
        caught.value.close()
    with pytest.raises(InvalidStatus) as refused:
        talk(served, origin="http://evil.example")
    assert refused.value.response.status_code == 403
    with talk(served, origin=served.url.rstrip("/")) as page:
        assert read(page, "hello")[0]["title"] == "small"


def test_two_pages_see_the_same_and_one_may_leave(served):
    with talk(served) as first:
        read(first, "frame")
        with talk(served) as second:
            read(second, "frame")
            second.send(json.dumps({"type": "play", "on": False}))
            while read(first, "state")[0]["playing"]:
                pass
            second.send(json.dumps({"type": "step", "count": 1}))
            (one, seen), (two, other) = read(first, "frame"), read(second, "frame")
            while one["number"] != two["number"]:
                if one["number"] < two["number"]:
                    one, seen = read(first, "frame")
                else:
                    two, other = read(second, "frame")
            assert np.array_equal(seen["positions"], other["positions"])
        first.send(json.dumps({"type": "play", "on": True}))
        before = read(first, "frame")[0]["time"]
        assert read(first, "frame")[0]["time"] > before


def test_garbage_and_broken_connections_do_no_harm(served):
    with talk(served) as page:
        page.send("nonsense")
        assert "not understood" in read(page, "notice")[0]["text"]
        page.send(b"\x00\xff" * 100)
        assert "not understood" in read(page, "notice")[0]["text"]
    host, port = served.url.removeprefix("http://").rstrip("/").split(":")
    for junk in (b"", b"\x16\x03\x01\x00", b"GET / HTTP/1.1\r\n", b"POST / HTTP/1.1\r\n\r\n"):
        with socket.create_connection((host, int(port))) as raw:
            raw.sendall(junk)
    with talk(served) as page:
        read(page, "frame")
        page.socket.shutdown(socket.SHUT_RDWR)  # without a goodbye
    with talk(served) as page:
        read(page, "frame")
        page.send("x" * (1 << 21))  # larger than any command
        with pytest.raises(ConnectionClosed, match="1009"):
            read_all(page, 5)
    with talk(served) as page:
        read(page, "frame")
    deadline = time.monotonic() + 5
    while served.page_count and time.monotonic() < deadline:
        time.sleep(0.02)
    assert served.page_count == 0


def test_a_page_that_does_not_confirm_gets_no_more_frames(served):
    with talk(served) as lazy, talk(served) as other:
        other.send(json.dumps({"type": "play", "on": True}))
        for _ in range(10):
            read(other, "frame")
        kinds = []
        with pytest.raises(TimeoutError):
            read_all(lazy, 0.3, kinds.append)
        assert kinds.count("frame") <= 2


def test_a_taken_port_is_not_the_end(served):
    taken = int(served.url.rsplit(":", 1)[1].rstrip("/"))
    with Viewer(lambda: LivePlayer(palpate.Simulation("small")), port=taken) as other:
        assert other.url != served.url
        with talk(other) as page:
            read(page, "frame")
    with pytest.raises(ViewerError, match=r"203\.0\.113\.1"):
        Viewer(lambda: LivePlayer(palpate.Simulation("small")), host="203.0.113.1", port=0)


def test_the_command_serves_until_ctrl_c(tmp_path):
    path = tmp_path / "model.bml"
    path.write_text("BRANCH {\n  TREE { NE nothing.seg }\n}\n")
    command = [sys.executable, "-m", "palpate.cli", "view", str(path), "--no-browser"]
    with subprocess.Popen([*command, "--port", "0"], stdout=subprocess.PIPE, text=True) as process:
        try:
            line = process.stdout.readline()
            url = re.search(r"http://127\.0\.0\.1:\d+/", line).group()
            with urllib.request.urlopen(url) as answer:
                assert answer.status == 200
            with connect(url.replace("http", "ws") + "socket") as page:
                assert "nothing.seg" in read(page, "problem")[0]["text"]
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
        finally:
            process.kill()


def test_where_the_page_is_and_that_no_browser_was_found_are_told(tmp_path):
    # A thread that sends stdout to stderr, as reading a mesh does, must not catch the address.
    start = (
        "import contextlib, sys, palpate.cli.view, palpate.viewer.session as session\n"
        "from palpate.cli import main\n"
        "redirected = contextlib.redirect_stdout(sys.stderr)\n"
        "session.Session.start = lambda self: redirected.__enter__()\n"
        "main()"
    )
    command = [sys.executable, "-c", start, "view", "small", "--port", "0"]
    # Neither a program of that name nor a screen.
    bare = {name: value for name, value in os.environ.items() if "DISPLAY" not in name}
    bare |= {"PATH": str(tmp_path), "BROWSER": "none-of-that-name"}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, **pipes, text=True, env=bare) as process:
        try:
            assert "no browser was found here" in process.stderr.readline()
            process.send_signal(signal.SIGINT)
            assert process.wait(20) == 0
            assert process.stdout.read().startswith("small at http://127.0.0.1:")
            assert process.stderr.read() == ""
        finally:
            process.kill()
