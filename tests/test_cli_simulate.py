"""`palpate simulate`: the files it leaves, stopped or not, and what they say."""

import json
import re
import signal
import subprocess
import sys
import time
import xml.etree.ElementTree as ET

import meshio
import numpy as np
import pytest
from typer.testing import CliRunner

import palpate
from palpate.cli import app
from palpate.results.atomic import write_bytes


def run(*arguments, status=0):
    """Runs `palpate simulate` in this process; returns (stdout, stderr)."""
    result = CliRunner().invoke(app, ["simulate", *(str(each) for each in arguments)])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    assert result.exit_code == status, result.output
    return result.stdout, result.stderr


def times(folder):
    """(time, file) of each frame that the index names."""
    sets = ET.parse(folder / "simulation.pvd").getroot().iter("DataSet")
    return [(float(each.get("timestep")), folder / each.get("file")) for each in sets]


def left_over(folder):
    """Files with a temporary name."""
    return [each for each in folder.rglob("*") if each.name.startswith(".")]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder and report of a short run in which bodies touch."""
    folder = tmp_path_factory.mktemp("run") / "out"
    out, err = run(
        "small", "--duration", "0.2", "--every", 5, "--output", folder, "--checkpoint", "--json"
    )
    assert err == ""
    return folder, json.loads(out)


@pytest.fixture(scope="module")
def by_hand():
    simulation = palpate.Simulation("small")
    reports = [simulation.step() for _ in range(12)]
    return simulation, reports


def test_every_promised_file_is_there_and_no_other(finished):
    folder, report = finished
    names = sorted(str(each.relative_to(folder)) for each in folder.rglob("*") if each.is_file())
    assert names == [
        "checkpoint.palpate",
        *(f"frames/frame_{index:05d}.vtu" for index in range(4)),
        *(f"pictures/{name}.png" for name in ("first", "last", "middle", "strip")),
        "report.json",
        "simulation.pvd",
    ]
    assert json.loads((folder / "report.json").read_text()) == report


def test_the_report_tells_what_python_finds(finished, by_hand):
    _, report = finished
    simulation, reports = by_hand
    assert report["model"] == "small"
    assert report["step_count"] == 12
    assert report["frame_count"] == 4
    assert report["interrupted"] is False
    assert report["failure"] is None
    assert report["versions"]["palpate"] == palpate.__version__
    assert report["end_time"] == simulation.time
    for name in ("contacts", "self_contacts", "max_depth", "iterations", "time"):
        assert report["steps"][name] == [getattr(each, name) for each in reports]
    assert max(report["steps"]["contacts"]) > 0
    for kind, joules in simulation.energy().items():
        assert len(report["energies"][kind]) == 12
        assert report["energies"][kind][-1] == joules
    assert set(report["times"]) == set(reports[0].times)
    assert set(report["stages"]) == set(reports[0].stages)
    fine = sum(spread["sum"] for spread in report["stages"].values())
    assert 0.5 * report["step_count"] * report["times"]["total"]["min"] < fine
    for spread in report["times"].values():
        assert 0 <= spread["min"] <= spread["median"] <= spread["p90"] <= spread["max"]
    assert [each["name"] for each in report["bodies"]] == ["lower", "middle", "upper"]
    for index, each in enumerate(report["bodies"]):
        mesh = simulation.model.bodies[index].mesh
        now = mesh.with_nodes(simulation.positions[index]).volume
        assert each["volume_change_percent"] == pytest.approx(
            100 * (now / mesh.volume - 1), abs=1e-9
        )
        speed = np.linalg.norm(simulation.velocities[index], axis=1).max()
        assert each["final_speed"] == pytest.approx(speed)
        assert each["inverted_tetrahedra"] == 0
    assert report["at_rest"] is False


def test_frames_read_back_as_the_state(finished, by_hand):
    folder, _ = finished
    simulation, _ = by_hand
    frames = times(folder)
    assert [time for time, _ in frames] == pytest.approx([0, 5 / 60, 10 / 60, 12 / 60])
    bodies = simulation.model.bodies
    rest = np.concatenate([body.mesh.nodes for body in bodies])
    first, last = meshio.read(frames[0][1]), meshio.read(frames[-1][1])
    assert np.array_equal(first.points, rest)
    positions = np.concatenate(simulation.positions)
    assert np.array_equal(last.points, positions)
    assert np.allclose(last.point_data["displacement"], positions - rest, atol=1e-7)
    assert np.allclose(last.point_data["velocity"], np.concatenate(simulation.velocities))
    forces = np.concatenate(simulation.contact_forces)
    assert np.abs(forces).max() > 0
    assert np.allclose(last.point_data["contact_force"], forces)
    assert set(last.cells_dict) == {"tetra", "triangle"}
    starts = np.cumsum([0] + [len(body.mesh.nodes) for body in bodies])
    solid = np.concatenate([bodies[i].mesh.tetrahedra + starts[i] for i in range(3)])
    assert np.array_equal(last.cells_dict["tetra"], solid)
    assert np.array_equal(last.cells_dict["triangle"], bodies[3].mesh.triangles + starts[3])
    numbers = last.get_cell_data("body", "tetra")
    counts = [len(body.mesh.tetrahedra) for body in bodies[:3]]
    assert np.array_equal(numbers, np.repeat([0, 1, 2], counts))
    assert set(last.get_cell_data("body", "triangle")) == {3}
    assert "region" in last.cell_data


def test_pictures_show_the_bodies(finished):
    folder, _ = finished
    from matplotlib.image import imread

    shown = {path.stem: imread(path) for path in (folder / "pictures").glob("*.png")}
    first, last = shown["first"], shown["last"]
    assert first.shape == last.shape == shown["middle"].shape
    assert np.abs(first - last).max() > 0.5  # they fell
    # The upper body is the only blue thing; it starts high in the picture and comes down.
    heights = []
    for image in (first, shown["middle"], last):
        blue = (image[..., 2] > 0.5) & (image[..., 2] > image[..., 0] + 0.2)
        assert blue.mean() > 0.005
        heights.append(np.argwhere(blue)[:, 0].mean() / len(image))
    assert heights[0] < heights[1] < heights[2]
    rows, columns = first.shape[:2]
    assert shown["strip"].shape[:2] == (rows // 2, 3 * (columns // 2) + 16)


def test_a_resumed_run_goes_on_with_the_same_bits(finished, tmp_path):
    folder, _ = finished
    checkpoint = folder / "checkpoint.palpate"
    more = ("--duration", "0.1", "--no-pictures", "--output")
    run("small", "--resume", checkpoint, *more, tmp_path / "a")
    run("--resume", checkpoint, "--threads", 2, *more, tmp_path / "b")
    straight = palpate.Simulation("small")
    straight.step(18)
    for name in ("a", "b"):
        time, frame = times(tmp_path / name)[-1]
        assert time == pytest.approx(straight.time, rel=1e-15)
        points = meshio.read(frame).points
        assert points.tobytes() == np.concatenate(straight.positions).tobytes()
        assert not (tmp_path / name / "pictures").exists()
    _, err = run("case1", "--resume", checkpoint, "--output", tmp_path / "c", status=1)
    assert "not a checkpoint of case1" in err


def test_a_damaged_checkpoint(finished, tmp_path):
    content = bytearray((finished[0] / "checkpoint.palpate").read_bytes())
    content[len(content) // 2] ^= 1
    write_bytes(tmp_path / "bad.palpate", bytes(content))
    out, err = run("--resume", tmp_path / "bad.palpate", "--output", tmp_path / "out", status=1)
    assert out == ""
    assert err.startswith("error: ")
    assert not (tmp_path / "out").exists()


def test_the_table_and_a_second_run_into_the_same_folder(tmp_path):
    folder = tmp_path / "out"
    arguments = ("small", "--time-step", "1/30", "--no-pictures", "--output", folder)
    run(*arguments, "--duration", "0.3")
    assert len(times(folder)) == 10
    out, _ = run(*arguments, "--duration", "0.1")
    assert len(times(folder)) == 4
    assert len(list((folder / "frames").iterdir())) == 4  # no frame of the first run stays
    assert "3 steps of 33.3 ms" in out
    for word in ("penetration", "mechanics", "total", "lower", "middle", "self-contacts"):
        assert word in out
    assert re.search(r"t = 0\.1 s, in motion: \d+ mm/s", out)
    assert str(folder / "report.json") in out


def test_the_profile_names_every_stage(tmp_path):
    out, _ = run("small", "--duration", "0.05", "--output", tmp_path, "--profile", "--no-pictures")
    assert "Where the time went" in out
    for stage in palpate.Simulation("small").step().stages:
        assert stage in out


def test_a_step_that_fails_leaves_what_was_reached(tmp_path, monkeypatch):
    step = palpate.Simulation.step

    def fail_at_the_fourth(self, count=1):
        if self.time > 2.5 / 60:
            raise palpate.SimulationError("node 7 of body 0 is not finite")
        return step(self, count)

    monkeypatch.setattr(palpate.Simulation, "step", fail_at_the_fourth)
    arguments = ("small", "--no-pictures", "--every", 2, "--output", tmp_path)
    out, err = run(*arguments, "--json", status=1)
    assert err.startswith("error: at t = 0.05 s: node 7 of body 0 is not finite")
    assert json.loads(out)["failure"] == "node 7 of body 0 is not finite"
    assert [time for time, _ in times(tmp_path)] == pytest.approx([0, 2 / 60, 3 / 60])
    assert json.loads((tmp_path / "report.json").read_text())["step_count"] == 3


def test_pictures_left_out_when_matplotlib_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    _, err = run("small", "--duration", "1/60", "--output", tmp_path)
    assert "palpate[plot]" in err
    assert (tmp_path / "report.json").exists()
    assert not (tmp_path / "pictures").exists()


def test_ctrl_c_leaves_complete_files(tmp_path):
    arguments = ["small", "--duration", "600", "--checkpoint", "--no-pictures"]
    process = subprocess.Popen(
        [sys.executable, "-m", "palpate.cli", "simulate", *arguments, "--output", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    try:
        wait_for(tmp_path / "frames" / "frame_00006.vtu")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130, err
    assert b"interrupted" in out
    assert b"Traceback" not in err
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["interrupted"] is True
    assert 6 <= report["step_count"] < 36_000
    frames = times(tmp_path)
    assert len(frames) == report["frame_count"] == report["step_count"] + 1
    assert left_over(tmp_path) == []
    resumed = palpate.Simulation.load(tmp_path / "checkpoint.palpate")
    assert resumed.time == report["end_time"] == frames[-1][0]
    assert np.array_equal(meshio.read(frames[-1][1]).points, np.concatenate(resumed.positions))


def wait_for(path, seconds=60):
    end = time.monotonic() + seconds
    while not path.exists():
        assert time.monotonic() < end, path
        time.sleep(0.02)
