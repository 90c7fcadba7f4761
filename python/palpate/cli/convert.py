"""`palpate convert`: a mesh from any format to any other."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Annotated

import typer
from rich.text import Text

from palpate.cli.output import JsonOption, RepairOption, console, print_json, volume_text, whole
from palpate.files import read_mesh, write_mesh


def command(
    source: Annotated[
        Path, typer.Argument(metavar="IN", help="Mesh file; the extension names the format.")
    ],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="Mesh file to write.")],
    repair: RepairOption = False,
    json_output: JsonOption = False,
) -> None:
    """Convert a mesh from one format to another, and tell what was left out or mended.

    .seg and .vtk need nothing; .msh, .vtu, .node, .inp, .mesh, .stl, .obj and .ply need meshio.

    Example: palpate convert kidney.msh kidney.seg --repair
    """
    with redirect_stdout(sys.stderr):  # meshio prints while it reads; stdout is for results
        mesh = read_mesh(source, repair=repair)
    notes = list(mesh.notes)
    if len(mesh.tetrahedra) and target.suffix.lower() in (".stl", ".obj", ".ply", ".off"):
        notes.append(f"{target.suffix} holds surfaces: tetrahedra left out")
    elif target.suffix.lower() != ".seg" and mesh.node_sets:
        notes.append(f"{target.suffix} written without node sets: {', '.join(mesh.node_sets)}")
    with redirect_stdout(sys.stderr):
        write_mesh(target, mesh)
    if json_output:
        print_json(
            {
                "source": str(source),
                "target": str(target),
                "nodes": len(mesh.nodes),
                "tetrahedra": len(mesh.tetrahedra),
                "triangles": len(mesh.triangles),
                "volume": mesh.volume,
                "notes": notes,
            }
        )
        return
    out = console()
    out.print(
        Text(
            f"{target}: {whole(len(mesh.nodes))} nodes, {whole(len(mesh.tetrahedra))} tetrahedra, "
            f"{whole(len(mesh.triangles))} surface triangles, {volume_text(mesh.volume)}"
        )
    )
    for note in notes:
        out.print(Text(f"note: {note}"))
