"""Strokes drawn in the viewer, without a browser."""

import re

import numpy as np
import pytest

import palpate
from palpate.viewer import NullViewer
from palpate.viewer.live import LivePlayer


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
