"""Killed at any moment, on a full disk, without permission: files are whole or absent.

``PALPATE_KILLS`` is how often each command is killed (4; `make kills` does 100).
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from conftest import box
from typer.testing import CliRunner

import palpate
from palpate.cli import app
from palpate.results.reading import read_frame, read_series

resource = pytest.importorskip("resource")

KILLS = int(os.environ.get("PALPATE_KILLS", "4"))

#: Runs each command in a process forked from this one, which has imported everything, and kills it
#: after a random part of the time that it needs; the first is not killed.
NURSERY = """
import os, random, signal, sys, time
import palpate.cli.run
from palpate.cli import app
palpate.cli.run._CHECKPOINT_INTERVAL = 0.0
rounds, *arguments = sys.argv[1:]
chance = random.Random(7)
needed = None
for number in range(int(rounds) + 1):
    start = time.monotonic()
    child = os.fork()
    if child == 0:
        sys.stdout = sys.stderr = open(os.devnull, "w")
        try:
            app([each.replace("{round}", str(number)) for each in arguments], standalone_mode=False)
        finally:
            os._exit(0)
    if needed is not None:
        time.sleep(chance.uniform(0.0, needed))
        os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    needed = needed or time.monotonic() - start
"""

SIMULATE = ["simulate", "small", "--duration", "0.2", "--checkpoint", "--no-pictures", "--output"]
STEPS = 12
BENCH = [
    "bench",
    "paper",
    "small",
    "-K",
    5,
    "--frames",
    2,
    "--repeats",
    1,
    "--no-plots",
    "--output",
]


def killed(*arguments: object) -> None:
    words = [str(each) for each in (KILLS, *arguments)]
    subprocess.run([sys.executable, "-c", NURSERY, *words], check=True, timeout=3600)


def run(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(each) for each in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.output


def is_temporary(path: Path) -> bool:
    return path.name.startswith(".") or path.suffix == ".part"


def check_whole(folder: Path) -> list[str]:
    """Every file under its own name is whole; returns the names."""
    files = [path for path in folder.rglob("*") if path.is_file() and not is_temporary(path)]
    for path in files:
        if path.suffix == ".vtu":
            assert len(read_frame(path, ("Points", "velocity"))) == 2
        elif path.suffix == ".pvd":
            assert all(frame.exists() for _, frame in read_series(folder))
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix in (".csv", ".md"):
            assert path.read_text().endswith("\n")
        else:
            assert path.suffix == ".palpate", path
            palpate.Simulation.load(path)
    return [path.name for path in files]


def test_simulate(tmp_path: Path) -> None:
    killed(*SIMULATE, tmp_path / "out{round}")
    straight = palpate.Simulation("small")
    straight.step(STEPS)
    for number in range(KILLS + 1):
        folder = tmp_path / f"out{number}"
        if not folder.exists():
            continue
        check_whole(folder)
        checkpoint = folder / "checkpoint.palpate"
        if checkpoint.exists():
            resumed = palpate.Simulation.load(checkpoint)
            done = round(resumed.time / resumed.time_step)
            if done < STEPS:
                resumed.step(STEPS - done)
            for here, there in zip(resumed.positions, straight.positions, strict=True):
                assert here.tobytes() == there.tobytes()
    # A new run into such a folder takes away what the killed one left.
    status, output = run(*SIMULATE, tmp_path / f"out{KILLS}")
    assert status == 0, output
    assert "report.json" in check_whole(tmp_path / f"out{KILLS}")
    assert not [path for path in (tmp_path / f"out{KILLS}").rglob("*") if is_temporary(path)]


@pytest.mark.parametrize("name", ["mesh.vtk", "mesh.seg", "mesh.msh"])
def test_convert(tmp_path: Path, name: str) -> None:
    mesh = box((14, 14, 14))
    palpate.write_mesh(tmp_path / "source.seg", mesh)
    killed("convert", tmp_path / "source.seg", tmp_path / ("{round}" + name))
    assert (tmp_path / f"0{name}").exists()
    for number in range(KILLS + 1):
        if (tmp_path / f"{number}{name}").exists():
            read = palpate.read_mesh(tmp_path / f"{number}{name}")
            assert np.array_equal(read.tetrahedra, mesh.tetrahedra)
            assert np.array_equal(read.nodes, mesh.nodes)


def test_bench(tmp_path: Path) -> None:
    killed(*BENCH, tmp_path / "out{round}")
    assert {"results.json", "report.md"} <= set(check_whole(tmp_path / "out0"))
    for number in range(1, KILLS + 1):
        check_whole(tmp_path / f"out{number}")


#: Saves over and over: there is always a whole checkpoint, of one state or the next.
SAVING = """
import sys, palpate
simulation = palpate.Simulation("small")
simulation.save(sys.argv[1])
print("saved", flush=True)
while True:
    simulation.step()
    simulation.save(sys.argv[1])
"""


def test_save_over_an_older_one(tmp_path: Path) -> None:
    path = tmp_path / "run.palpate"
    straight = palpate.Simulation("small")
    for number in range(max(2, KILLS // 4)):
        with subprocess.Popen(
            [sys.executable, "-c", SAVING, str(path)], stdout=subprocess.PIPE
        ) as process:
            assert process.stdout is not None
            process.stdout.readline()
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=0.05 + 0.037 * number)
            process.kill()
        loaded = palpate.Simulation.load(path)
        straight.reset()
        done = round(loaded.time / loaded.time_step)
        if done:
            straight.step(done)
        for here, there in zip(loaded.positions, straight.positions, strict=True):
            assert here.tobytes() == there.tobytes()


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """No file can grow beyond ``size`` bytes, as if the disk were full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@contextmanager
def no_rights(folder: Path) -> Iterator[None]:
    """Nothing can be made in ``folder``; nor by root, who becomes nobody."""
    folder.chmod(0o500)
    is_root = os.geteuid() == 0
    if is_root:
        os.seteuid(65534)
    try:
        yield
    finally:
        if is_root:
            os.seteuid(0)
        folder.chmod(0o700)


@pytest.mark.parametrize("size", [0, 3000, 20_000])
def test_a_full_disk_ends_a_command_with_the_file(tmp_path: Path, size: int) -> None:
    palpate.write_mesh(tmp_path / "source.seg", box((6, 6, 6)))
    commands = [
        [*SIMULATE, tmp_path / "out"],
        ["convert", tmp_path / "source.seg", tmp_path / "to.vtk"],
        ["convert", tmp_path / "source.seg", tmp_path / "to.msh"],
        [*BENCH, tmp_path / "bench"],
    ]
    failed = 0
    for command in commands:
        with full_disk(size):
            status, output = run(*command)
        if status:
            failed += 1
            told = output.splitlines()[-1]
            assert told.startswith(f"error: {tmp_path}"), output
            assert "File too large" in told or "is the disk full?" in told
        left = [path for path in tmp_path.rglob("*") if is_temporary(path)]
        assert left == []
        for folder in ("out", "bench"):
            check_whole(tmp_path / folder)
    assert failed >= 2
    assert not (tmp_path / "to.vtk").exists()


def test_a_folder_without_rights_is_named(tmp_path: Path) -> None:
    palpate.write_mesh(tmp_path / "source.seg", box((2, 2, 2)))
    (tmp_path / "closed").mkdir()
    (tmp_path / "file").touch()
    tmp_path.chmod(0o755)
    for folder in ("closed", "file"):
        for command in (
            [*SIMULATE, tmp_path / folder / "out"],
            [*BENCH, tmp_path / folder / "bench"],
            ["convert", tmp_path / "source.seg", tmp_path / folder / "to.vtk"],
            ["convert", tmp_path / "source.seg", tmp_path / folder / "to.msh"],
        ):
            with no_rights(tmp_path / "closed"):
                status, output = run(*command)
            assert status == 1
            told = output.splitlines()[-1]
            assert told.startswith(f"error: {tmp_path}"), output
            assert "Permission denied" in told or "Not a directory" in told, output
    assert list((tmp_path / "closed").iterdir()) == []


WRITERS: list[Callable[[palpate.Simulation, Path], object]] = [
    lambda simulation, folder: simulation.save(folder / "run.palpate"),
    lambda simulation, folder: simulation.write_model(folder / "model.bml"),
    lambda simulation, folder: palpate.write_mesh(
        folder / "mesh.seg", simulation.model.bodies[0].mesh
    ),
    lambda simulation, folder: palpate.write_mesh(
        folder / "mesh.vtk", simulation.model.bodies[0].mesh
    ),
    lambda simulation, folder: palpate.write_mesh(
        folder / "mesh.vtu", simulation.model.bodies[0].mesh
    ),
]


@pytest.mark.parametrize("write", WRITERS)
def test_what_cannot_be_written_is_an_oserror_and_leaves_nothing(
    tmp_path: Path, write: Callable[[palpate.Simulation, Path], object]
) -> None:
    simulation = palpate.Simulation("small")
    (tmp_path / "closed").mkdir()
    for size in (0, 100, 2000):
        with full_disk(size), pytest.raises(OSError, match=r"File too large|disk full") as caught:
            write(simulation, tmp_path)
        assert str(tmp_path) in str(caught.value.filename)
        assert [path.name for path in tmp_path.iterdir()] == ["closed"]
    with no_rights(tmp_path / "closed"), pytest.raises(PermissionError) as caught:
        write(simulation, tmp_path / "closed")
    assert str(tmp_path / "closed") in str(caught.value.filename)
    assert list((tmp_path / "closed").iterdir()) == []
    simulation.step()
    write(simulation, tmp_path / "closed")
