"""Runs read back from disk: frames, the player, films in one file, `palpate render`."""

import base64
import gzip
import re
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import palpate
from palpate import pictures
from palpate.cli import app
from palpate.results import drawing
from palpate.results.reading import RecordingError, read_frame, read_report, read_series
from palpate.results.vtu import Grid
from palpate.viewer import NullViewer, recorded
from palpate.viewer.live import LivePlayer
from palpate.viewer.protocol import decode
from palpate.viewer.recorded import RecordedPlayer
from palpate.viewer.recording import Recording, boundary
from palpate.viewer.surface import Surfaces


def run(*arguments, status=0):
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == status, result.output
    return result.output


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A short run on disk."""
    folder = tmp_path_factory.mktemp("run") / "out"
    run("simulate", "small", "--duration", 0.2, "--every", 3, "--output", folder, "--no-pictures")
    return folder


@pytest.fixture(scope="module")
def by_hand():
    """Positions of each frame of that run, all nodes."""
    simulation = palpate.Simulation("small")
    frames = [np.concatenate(simulation.positions)]
    for _ in range(4):
        simulation.step(3)
        frames.append(np.concatenate(simulation.positions))
    return simulation, frames


@pytest.mark.parametrize("count", [1, 3, 50_000])  # the last makes several compressed blocks
def test_frames_come_back(tmp_path, count):
    rng = np.random.default_rng(count)
    points = rng.normal(size=(count, 3))
    cells = rng.integers(0, count, (7, 4))
    values = rng.normal(size=count).astype(np.float32)
    grid = Grid(count, [cells], {"body": np.arange(7, dtype=np.int32)})
    path = tmp_path / "frame.vtu"
    grid.write(path, points, {"depth": values})
    found = read_frame(path, ("Points", "depth", "connectivity", "body", "nothing"))
    assert np.array_equal(found["Points"], points)
    assert np.array_equal(found["depth"], values)
    assert np.array_equal(found["connectivity"], cells.reshape(-1))
    assert np.array_equal(found["body"], np.arange(7))
    assert "nothing" not in found


def test_the_boundary_is_the_surface(make_box):
    mesh = make_box((2, 3, 1))

    def turned(triangles):
        """Each with its smallest node first, sorted."""
        shift = np.argmin(triangles, axis=1)[:, None]
        return sorted(map(tuple, np.take_along_axis(triangles, (shift + np.arange(3)) % 3, 1)))

    assert turned(boundary(mesh.tetrahedra.astype(np.int64))) == turned(mesh.triangles)


def test_a_recording_plays_what_was_simulated(finished, by_hand):
    simulation, frames = by_hand
    surfaces = Surfaces([body.mesh for body in simulation.model.bodies])
    ends = np.cumsum([0, *surfaces.node_counts])
    viewer = NullViewer(lambda: RecordedPlayer(Recording(finished)))
    assert viewer.header("hello")["mode"] == "recording"
    assert viewer.header("hello")["times"] == pytest.approx([0, 0.05, 0.1, 0.15, 0.2])
    assert [body["name"] for body in viewer.header("scene")["bodies"]] == [
        "lower",
        "middle",
        "upper",
        "tray",
    ]
    assert viewer.header("scene")["bodies"][3]["rigid"] is True
    for index, frame in enumerate(frames):
        parts = [frame[a:b] for a, b in pairwise(ends)]
        viewer.send({"type": "seek", "frame": index})
        assert viewer.header("frame")["frame"] == index
        assert np.array_equal(viewer.arrays("frame")["positions"], surfaces.stack(parts))
    viewer.send({"type": "seek", "frame": 10**6})
    assert viewer.header("frame")["frame"] == 4
    viewer.send({"type": "play", "on": True})  # from the end: again from the start
    assert viewer.header("frame")["frame"] < 4
    viewer.run(0.5)
    assert viewer.header("frame")["frame"] == 4
    assert viewer.header("state")["playing"] is False
    for field in viewer.header("hello")["fields"]:
        show = {"type": "show", "field": field, "contacts": True, "touching": True}
        viewer.send(show)
        values = viewer.arrays("frame")[f"field/{field}"]
        assert len(values) == len(viewer.arrays("frame")["positions"])
        assert values.min() >= 0
        assert values.max() > 0 or field == "depth"  # nothing penetrates


def test_a_run_under_way_can_be_looked_at(finished, tmp_path):
    (tmp_path / "frames").symlink_to(finished / "frames")
    (tmp_path / "simulation.pvd").write_bytes((finished / "simulation.pvd").read_bytes())
    assert read_report(tmp_path) == {}
    scene = NullViewer(lambda: RecordedPlayer(Recording(tmp_path))).header("scene")
    assert [body["name"] for body in scene["bodies"]] == [f"body_{k}" for k in range(1, 5)]


@pytest.mark.parametrize("damage", ["nothing", "index", "empty", "cut", "text", "report"])
def test_damaged_runs_are_refused_by_name(finished, tmp_path, damage):
    if damage != "nothing":
        (tmp_path / "simulation.pvd").write_bytes((finished / "simulation.pvd").read_bytes())
        (tmp_path / "frames").mkdir()
        frame = (finished / "frames" / "frame_00000.vtu").read_bytes()
        (tmp_path / "frames" / "frame_00000.vtu").write_bytes(frame)
    if damage == "index":
        (tmp_path / "simulation.pvd").write_text("<Collection")
    elif damage == "empty":
        (tmp_path / "simulation.pvd").write_text("<Collection></Collection>")
    elif damage == "cut":
        (tmp_path / "frames" / "frame_00000.vtu").write_bytes(frame[: len(frame) // 2])
    elif damage == "text":
        broken = re.sub(rb'(Name="Points"[^>]*>\n.{90})', rb"\1AAAA", frame)
        (tmp_path / "frames" / "frame_00000.vtu").write_bytes(broken)
    elif damage == "report":
        (tmp_path / "report.json").write_text("{")
    with pytest.raises(RecordingError, match=re.escape(str(tmp_path))):
        Recording(tmp_path).frame(0)
    assert str(tmp_path) in run("render", tmp_path, "-o", tmp_path / "x.png", status=1)


def test_the_index_names_times_and_files(finished):
    frames = read_series(finished)
    assert [path.name for _, path in frames] == [f"frame_{k:05d}.vtu" for k in range(5)]
    assert all(path.exists() for _, path in frames)


def messages_of(page):
    """The messages in an exported film."""
    packed = re.search(r'id="recording">([^<]*)<', page).group(1)
    data = gzip.decompress(base64.b64decode(packed))
    found, at = [], 0
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        found.append(decode(data[at + 4 : at + 4 + size]))
        at += 4 + size
    return found


def test_a_film_holds_the_frames(finished, by_hand, tmp_path):
    simulation, frames = by_hand
    path = tmp_path / "film.html"
    assert "5 frames" in run("view", finished, "--export", path)
    page = path.read_text()
    assert not re.search(r"(src|href)=\"(?!data:)", page)
    assert '"./' not in page
    (hello, _), _, *rest = messages_of(page)
    assert hello["fields"] == ["displacement", "stress", "depth", "force"]
    viewer = NullViewer(lambda: RecordedPlayer(Recording(finished)))
    for number, (header, arrays) in enumerate(rest):
        viewer.send({"type": "seek", "frame": number})
        for field in ("stress", "depth", "force"):
            viewer.send({"type": "show", "field": field, "contacts": False, "touching": False})
            values = viewer.arrays("frame")[f"field/{field}"]
            high = header["quantised"]["high"][field]
            assert high == pytest.approx(values.max())
            assert np.allclose(arrays[f"field/{field}"] / 255 * high, values, atol=high / 500)
    assert (hello["mode"], len(hello["times"])) == ("recording", 5)
    surfaces = Surfaces([body.mesh for body in simulation.model.bodies])
    ends = np.cumsum([0, *surfaces.node_counts])
    whole = np.zeros((len(rest[0][1]["positions"]), 3), dtype=np.uint16)
    for (header, arrays), frame in zip(rest, frames, strict=True):
        difference = header["quantised"]["difference"]
        whole = whole + arrays["positions"] if difference else arrays["positions"]
        step = np.array(header["quantised"]["step"])
        parts = [frame[a:b] for a, b in pairwise(ends)]
        off = whole * step + header["quantised"]["low"] - surfaces.stack(parts)
        assert (np.abs(off) <= 0.51 * step + 1e-8).all()
        assert step.max() < 1e-5


def test_a_film_of_a_model(tmp_path):
    path = tmp_path / "film.html"
    assert "4 frames" in run("view", "small", "--export", path, "--duration", 0.05)
    assert len(messages_of(path.read_text())) == 2 + 4


def test_runs_that_know_no_stress_are_played(finished, tmp_path, monkeypatch):
    monkeypatch.setattr(recorded, "STRESS", "of old runs")
    viewer = NullViewer(lambda: RecordedPlayer(Recording(finished)))
    assert "stress" not in viewer.header("hello")["fields"]
    viewer.send({"type": "show", "field": "stress", "contacts": False, "touching": False})
    assert list(viewer.arrays("frame")) == ["positions"]
    run("view", finished, "--export", tmp_path / "film.html")
    (hello, _), *_ = messages_of((tmp_path / "film.html").read_text())
    assert hello["fields"] == ["displacement", "depth", "force"]


def test_a_mesh_alone_floats(tmp_path):
    film, mesh = tmp_path / "film.html", palpate.model.MODELS / "small.seg"
    run("view", mesh, "--export", film, "--duration", 0.1)
    _, _, first, *others = messages_of(film.read_text())
    assert first[1]["positions"].any()
    assert not any(arrays["positions"].any() for _, arrays in others)  # they tell the motion


def test_render_draws_models_and_runs(finished, tmp_path):
    still, strip, film = (tmp_path / name for name in ("a.png", "b.png", "c.gif"))
    run("render", "small", "-o", still, "--width", 200)
    run("render", finished, "-o", strip, "--frames", 3, "--width", 200)
    run("render", "small", "-o", film, "--duration", 0.1, "--frames", 4, "--width", 160)
    with Image.open(still) as one, Image.open(strip) as three:
        assert one.width == 200
        assert three.width == 3 * 200 + 2 * 8
        assert len(one.convert("RGB").getcolors(1 << 20)) > 200
    with Image.open(film) as moving:
        assert (moving.n_frames, moving.width) == (4, 160)
        first = np.asarray(moving.convert("RGB"), dtype=int)
        assert moving.info["duration"] == pytest.approx(33, abs=8)
        moving.seek(3)
        assert np.abs(np.asarray(moving.convert("RGB"), dtype=int) - first).max() > 60
        assert moving.info["duration"] == 1200
    assert sorted(each.name for each in tmp_path.iterdir()) == ["a.png", "b.png", "c.gif"]


@pytest.mark.parametrize("target", ["model", "run"])
def test_render_draws_the_boxes_of_a_level(finished, tmp_path, monkeypatch, target):
    drawn = []

    def watched(shapes, camera, **options):
        drawn.append(options["wires"])
        return pictures.render(shapes, camera, **options)

    monkeypatch.setattr(
        drawing, "pictures", SimpleNamespace(**{**vars(pictures), "render": watched})
    )
    shown = ["small", "--duration", 0.2] if target == "model" else [finished]
    simulation = palpate.Simulation("small")
    simulation.step(12)
    files = []
    for level in (None, 0, 4, 10**6):
        files.append(tmp_path / f"{level}.png")
        chosen = [] if level is None else ["--boxes", level]
        run("render", *shown, "-o", files[-1], "--width", 160, *chosen)
        wires = drawn.pop()
        assert drawn == []
        boxes = [] if level is None else [simulation.boxes(body, level) for body in range(4)]
        for lines, expected in zip(wires, boxes, strict=True):
            # 12 edges between the low and the high corner.
            edges = lines.ends.reshape(len(expected), 24, 3)
            assert np.array_equal(edges.min(axis=1), expected[:, 0])
            assert np.array_equal(edges.max(axis=1), expected[:, 1])
            lengths = np.abs(lines.ends[:, 1] - lines.ends[:, 0]).reshape(-1, 12, 3)
            assert np.allclose(lengths.sum(axis=1), 4 * (expected[:, 1] - expected[:, 0]))
    assert len({path.read_bytes() for path in files}) == 4


@pytest.mark.parametrize(
    ("arguments", "status", "text"),
    [
        (["small", "-o", "x.jpg"], 2, "png"),
        (["small", "--frames", "3"], 2, "duration"),
        (["nothing.bml"], 1, "nothing.bml"),
    ],
)
def test_render_refuses(tmp_path, monkeypatch, arguments, status, text):
    monkeypatch.chdir(tmp_path)
    assert text in run("render", *arguments, status=status)
    assert list(tmp_path.iterdir()) == []


def test_cuts_are_played(tmp_path):
    (tmp_path / "cut.blade").write_text("blade 1\nplane at 0.05 s\n  0 0 0.03  1 0 0\n")
    folder = tmp_path / "out"
    arguments = ["--duration", 0.1, "--every", 3, "--no-pictures", "--output", folder]
    run("simulate", "small", *arguments, "--cut", tmp_path / "cut.blade")
    viewer = NullViewer(lambda: RecordedPlayer(Recording(folder)))
    whole = viewer.arrays("scene")
    viewer.send({"type": "seek", "frame": 2})
    cut = viewer.arrays("scene")
    assert len(cut["triangles/0"]) > len(whole["triangles/0"])
    assert np.array_equal(cut["triangles/3"], whole["triangles/3"])
    assert viewer.header("frame")["version"] == viewer.header("scene")["version"]
    viewer.send({"type": "seek", "frame": 0})
    assert np.array_equal(viewer.arrays("scene")["triangles/0"], whole["triangles/0"])
    run("view", folder, "--export", tmp_path / "film.html")
    messages = messages_of((tmp_path / "film.html").read_text())
    kinds = [header["type"] for header, _ in messages]
    assert kinds == ["hello", "scene", "scene", "frame", "frame", "frame"]
    assert not any(name.startswith("cut/") for name in messages[1][1])
    assert np.array_equal(messages[2][1]["cut/0"], cut["cut/0"])


def test_cut_faces_of_a_run_are_those_of_the_simulation(tmp_path):
    (tmp_path / "cut.blade").write_text("blade 1\nplane at 0.05 s\n  0 0 0.03  1 0 0\n")
    folder = tmp_path / "out"
    arguments = ["--duration", 0.1, "--every", 3, "--no-pictures", "--output", folder]
    run("simulate", "small", *arguments, "--cut", tmp_path / "cut.blade", "--checkpoint")
    loaded = palpate.Simulation.load(folder / "checkpoint.palpate")
    recording = Recording(folder)
    _, parts = recording.frame(2)
    live = NullViewer(lambda: LivePlayer(loaded)).arrays("scene")
    found = recording.cut_faces(parts)
    assert [cut is not None and cut.any() for cut in found] == [True, True, True, False]
    for index, cut in enumerate(found[:3]):
        # The same triangles, in another order.
        mesh = loaded.model.bodies[index].mesh
        expected = live[f"cut/{index}"]
        middles = [
            sorted(map(tuple, np.sort(triangles[marks != 0], axis=1)))
            for triangles, marks in ((mesh.triangles, expected), (parts.triangles[index], cut))
        ]
        assert middles[0] == middles[1]
        # Lips come in pairs, in the plane of the cut as it was when the blade came.
        assert int(expected.sum()) % 2 == 0


def test_boxes_of_a_run_are_those_of_the_simulation(finished):
    viewer = NullViewer(lambda: RecordedPlayer(Recording(finished)))
    assert "levels" in viewer.header("hello")["features"]
    viewer.send({"type": "seek", "frame": 4})
    simulation = palpate.Simulation("small")
    simulation.step(12)
    for level in (1, 5, 16):
        viewer.send(
            {"type": "show", "field": None, "contacts": False, "touching": False, "level": level}
        )
        boxes = [simulation.boxes(body, level) for body in range(4)]
        found = viewer.arrays("frame")
        expected = np.concatenate(boxes).reshape(-1, 6).astype(np.float32)
        assert np.array_equal(found[f"boxes/{level}"], expected)
        assert found[f"box_counts/{level}"].tolist() == [len(each) for each in boxes]
