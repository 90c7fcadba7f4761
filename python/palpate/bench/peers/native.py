"""parry3d and Embree, through a small program of our own that cargo builds when it is needed."""

from __future__ import annotations

import json
import shutil
import subprocess
import tempfile
from importlib import metadata, util
from pathlib import Path
from typing import Any

import numpy as np

from palpate.bench.measure import Pass
from palpate.bench.peers.contender import Answer, Contender, MissingError, PairArray, Query, Setting

#: The program's sources, in a checkout.
PROGRAM = Path(__file__).parents[4] / "benchmarks" / "peers"


def parry(setting: Setting) -> list[Contender]:
    """Parry's hierarchies with the exact test and with its own."""
    process = _Process(setting, None)
    name = f"parry3d {_locked_version('parry3d-f64')}"
    trees = "one binary tree per body, refitted"
    exact = f"{trees}; palpate's exact test on its candidates"
    own = f"{trees}; parry's own test, GJK"
    near = f"{trees}; palpate's distances on its candidates"
    return [
        process.contender("intersections parry", f"{name}, exact test", exact),
        process.contender("intersections-gjk parry", f"{name}, own test", own),
        process.contender("proximity parry", name, near),
    ]


def embree(setting: Setting) -> list[Contender]:
    """Embree's rtcCollide, with the library that comes with embreex."""
    process = _Process(setting, _embree_library())
    name = f"Embree 4 (of embreex {metadata.version('embreex')})"
    trees = "rtcCollide over user geometries, build quality refit"
    exact = f"{trees}; palpate's exact test on its candidates"
    near = f"{trees}; palpate's distances on its candidates"
    return [
        process.contender("intersections embree", name, exact),
        process.contender("proximity embree", name, near),
    ]


class _Process:
    """The program, waiting for commands; it ends when this object is gone and its input closes."""

    def __init__(self, setting: Setting, library: Path | None) -> None:
        program = _build()
        self._setting = setting
        with tempfile.NamedTemporaryFile(suffix=".scene", delete=False) as file:
            file.write(_scene_bytes(setting))
        words = [file.name, repr(setting.distance), *([str(library)] if library else [])]
        command = [str(program), *words]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self._found: dict[str, list[PairArray]] = {}
        self._scene = Path(file.name)

    def ask(self, command: str) -> Any:
        """The program's answer to one command."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(command + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"palpate-peers ended on {command!r}: {self._process.wait()}")
        return json.loads(line)

    def contender(self, query_and_name: str, title: str, how: str) -> Contender:
        """One of the program's contenders, for one query."""
        near = query_and_name.startswith("proximity")

        def run() -> Pass:
            passed: dict[str, list[float]] = self.ask(f"pass {query_and_name}")
            return passed

        def found(frame: int) -> PairArray:
            if query_and_name not in self._found:
                frames = self.ask(f"found {query_and_name}")
                self._found[query_and_name] = [
                    np.unique(np.array(each, dtype=np.int64).reshape(-1, 5), axis=0)
                    if near
                    else self._setting.stacked(np.array(each))
                    for each in frames
                ]
            return self._found[query_and_name][frame]

        query = Query.PROXIMITY if near else Query.INTERSECTIONS
        return Contender(title, query, Answer.PAIRS, how, run, found)

    def __del__(self) -> None:
        if hasattr(self, "_process") and self._process.stdin is not None:
            self._process.stdin.close()
            self._process.wait(10)
            assert self._process.stdout is not None
            self._process.stdout.close()
        if hasattr(self, "_scene"):
            self._scene.unlink(missing_ok=True)


def _build() -> Path:
    if not PROGRAM.is_dir():
        raise MissingError("needs a checkout of palpate's sources, for benchmarks/peers")
    if shutil.which("cargo") is None:
        raise MissingError("needs cargo, https://rustup.rs")
    command = [
        "cargo",
        "build",
        "--release",
        "--locked",
        "--message-format=json",
        "--manifest-path",
    ]
    built = subprocess.run(
        [*command, str(PROGRAM / "Cargo.toml")], capture_output=True, text=True, check=False
    )
    for line in built.stdout.splitlines():
        executable = json.loads(line).get("executable") if line.startswith("{") else None
        if executable:
            return Path(executable)
    last = built.stderr.strip().splitlines()[-1:] or ["no output"]
    raise MissingError(f"cargo could not build benchmarks/peers: {last[0]}")


def _embree_library() -> Path:
    found = util.find_spec("embreex")
    if found is None or found.origin is None:
        raise MissingError("pip install embreex")
    folder = Path(found.origin).parents[1] / "embreex.libs"
    libraries = sorted(folder.glob("libembree4*.so*"))
    if not libraries:
        raise MissingError(
            f"embreex came without its libembree4 in {folder.name} (Linux wheels have it)"
        )
    return libraries[0]


def _locked_version(package: str) -> str:
    text = (PROGRAM / "Cargo.lock").read_text()
    return text.split(f'name = "{package}"\nversion = "')[1].split('"')[0]


def _scene_bytes(setting: Setting) -> bytes:
    header = [len(setting.meshes), len(setting.frames)]
    for mesh in setting.meshes:
        header += [len(mesh.nodes), len(mesh.triangles)]
    parts = [np.array(header, dtype="<u4").tobytes()]
    parts += [mesh.triangles.astype("<u4").tobytes() for mesh in setting.meshes]
    parts += [body.astype("<f8").tobytes() for frame in setting.frames for body in frame]
    return b"".join(parts)
