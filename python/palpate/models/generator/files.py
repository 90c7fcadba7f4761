"""Writes ``.seg`` files."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def write_seg(
    path: Path, title: str, x: np.ndarray, elements: np.ndarray, sets: dict[str, np.ndarray]
) -> None:
    """Nodes ``x`` (n, 3) [m], tetrahedra (m, 4) or triangles (m, 3), and node sets."""
    kind = "tetrahedra" if elements.shape[1] == 4 else "triangles"
    lines = [f"// {title}", "seg 1", f"nodes {len(x)}"]
    # Adding zero turns -0.0 into 0.0.
    lines += [" ".join(f"{value:g}" for value in row) for row in x + 0.0]
    lines.append(f"{kind} {len(elements)}")
    lines += [" ".join(map(str, row)) for row in elements.tolist()]
    for name in sorted(sets):
        lines.append(f"set {name} {len(sets[name])}")
        lines.append(" ".join(map(str, sets[name].tolist())))
    temporary = path.with_suffix(".part")
    temporary.write_text("\n".join(lines) + "\n")
    temporary.replace(path)
