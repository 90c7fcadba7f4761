"""The mesher: fTetWild (Hu et al. 2020), through the package wildmeshing."""

from __future__ import annotations

import importlib.util
import re
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np

from palpate._arrays import Float64Array, IndexArray
from palpate.errors import MeshError

#: Called with what is being done, in a few words.
Progress = Callable[[str], None]

_WORKER = Path(__file__).with_name("worker.py")
_PASS = re.compile(r"/ pass (\d+) /")
_NODES = re.compile(r"^#v = (\d+)")


def require() -> None:
    """Raise a MeshError that tells what to install, unless the mesher is there."""
    if importlib.util.find_spec("wildmeshing") is None:
        raise MeshError(
            "making tetrahedra needs the package wildmeshing: pip install 'palpate[mesh]'"
        )


def tetrahedralise(
    nodes: Float64Array,
    triangles: IndexArray,
    edge_length: float,
    tolerance: float,
    progress: Progress,
) -> tuple[Float64Array, IndexArray]:
    """Nodes [m] (n, 3) and tetrahedra (m, 4) inside a surface.

    ``edge_length`` [m] is aimed at, ``tolerance`` [m] is how far the new surface may lie from the
    given one. The same input gives meshes that differ a little from run to run.
    """
    require()
    with tempfile.TemporaryDirectory(prefix="palpate-") as folder:
        place = Path(folder).resolve()
        source, target = place / "surface.npz", place / "tetrahedra.npz"
        np.savez(
            source,
            nodes=nodes,
            triangles=triangles,
            edge_length=edge_length,
            tolerance=tolerance,
        )
        last = _watch([sys.executable, str(_WORKER), str(source), str(target)], progress)
        if not target.exists():
            raise MeshError(f"the mesher failed: {last or 'it told nothing'}")
        with np.load(target) as made:
            return made["nodes"], made["tetrahedra"]


def _watch(command: list[str], progress: Progress) -> str:
    """Run to the end and tell the passes; the last line that was printed."""
    last: deque[str] = deque(maxlen=1)
    state = "reading"
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace"
    ) as process:
        try:
            assert process.stdout is not None
            for line in process.stdout:
                if line.strip():
                    last.append(line.strip())
                if found := _PASS.search(line):
                    state = f"pass {int(found[1]) + 1}"
                elif found := _NODES.match(line):
                    # Outside the surface too, until the end.
                    progress(f"{state}, {int(found[1]):,} nodes in the box around it")
        finally:
            process.kill()
    return last[0] if last else ""
