"""The viewer's messages, and what is made of bodies for them."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import palpate
from palpate.results.stress import Strain
from palpate.viewer.probe import aim, probe_mesh
from palpate.viewer.protocol import ProtocolError, decode, encode, parse_command
from palpate.viewer.surface import Surfaces, deformation

_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=10,
)


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
