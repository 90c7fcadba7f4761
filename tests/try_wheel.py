"""Installs the newest wheel of a folder into an empty environment without Rust and simulates.

Usage: python tests/try_wheel.py DIST
"""

import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path


def main(folder: Path) -> None:
    wheel = max(folder.glob("palpate-*-abi3-*.whl"), key=lambda each: each.stat().st_mtime)
    with tempfile.TemporaryDirectory(prefix="palpate-wheel-") as place:
        venv.create(place, with_pip=True)
        binaries = Path(place) / "bin"
        # Nothing but what is in the environment and the system's own programs.
        environment = {**os.environ, "PATH": f"{binaries}:/usr/bin:/bin"}
        for unwanted in ("PYTHONPATH", "PYTHONHOME", "CARGO_TARGET_DIR"):
            environment.pop(unwanted, None)
        for command in (
            ["python", "-m", "pip", "install", "--quiet", str(wheel.resolve())],
            ["palpate", "--version"],
            ["palpate", "simulate", "small", "--duration", "0.25", "--output", "out"],
            ["palpate", "view", "out", "--export", "film.html"],
        ):
            subprocess.run(
                [binaries / command[0], *command[1:]], cwd=place, env=environment, check=True
            )
        if not (Path(place) / "out" / "simulation.pvd").exists():
            raise SystemExit(f"{wheel}: it simulated nothing")
    print(f"{wheel}: {wheel.stat().st_size / 1e6:.1f} MB, installs and simulates")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
