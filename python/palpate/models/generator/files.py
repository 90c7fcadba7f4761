"""Writes and reads `.seg` files: only what the generator needs."""

from pathlib import Path

import numpy as np

from .mesher import Mesh


def write_seg(path: Path, mesh: Mesh, comments: list[str]) -> None:
    """One node or element a line; the shortest decimals that read back to the same bits."""
    kind = "tetrahedra" if mesh.elements.shape[1] == 4 else "triangles"
    lines = [f"// {comment}" for comment in comments]
    lines += ["seg 1", f"nodes {len(mesh.nodes)}"]
    lines += [" ".join(short(value) for value in row) for row in mesh.nodes.tolist()]
    lines.append(f"{kind} {len(mesh.elements)}")
    lines += [" ".join(map(str, row)) for row in mesh.elements.tolist()]
    for name, members in mesh.sets.items():
        lines.append(f"set {name} {len(members)}")
        lines += [
            " ".join(map(str, members[k : k + 16].tolist())) for k in range(0, len(members), 16)
        ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def short(value: float) -> str:
    """`repr` without a trailing `.0`."""
    text = repr(value)
    return text[:-2] if text.endswith(".0") else text


def read_seg(path: Path) -> Mesh:
    """Reads back what `write_seg` wrote, word by word."""
    lines = (line.partition("//")[0] for line in path.read_text(encoding="utf-8").splitlines())
    words = " ".join(lines).split()
    position = 0

    def take(count: int) -> list[str]:
        nonlocal position
        position += count
        return words[position - count : position]

    if take(2) != ["seg", "1"]:
        raise ValueError(f"{path}: not a .seg file")
    nodes = elements = None
    sets: dict[str, np.ndarray] = {}
    while position < len(words):
        keyword = take(1)[0]
        if keyword == "set":
            name, count = take(2)
            sets[name] = np.array(take(int(count)), dtype=np.int64)
            continue
        count = int(take(1)[0])
        columns = {"nodes": 3, "tetrahedra": 4, "triangles": 3}[keyword]
        block = take(columns * count)
        if keyword == "nodes":
            nodes = np.array(block, dtype=float).reshape(-1, 3)
        else:
            elements = np.array(block, dtype=np.int64).reshape(-1, columns)
    if nodes is None or elements is None:
        raise ValueError(f"{path}: nodes or elements are missing")
    return Mesh(nodes, elements, sets)
