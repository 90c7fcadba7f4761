"""`palpate mesh`: tetrahedra from a surface or a segmented image."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.text import Text

from palpate.cli.opening import is_mesh
from palpate.cli.output import JsonOption, console, print_json, table, volume_text, whole
from palpate.files import read_mesh, write_mesh
from palpate.mesh import Mesh
from palpate.meshing import mesh_surface
from palpate.meshing.ftetwild import Progress
from palpate.meshing.image import fill_labels
from palpate.meshing.image_files import is_image
from palpate.results.measures import dihedral_angles, mean_ratios
from palpate.scene import Scene

#: Metres in the units that lengths may be given in.
UNITS = {"m": 1.0, "dm": 1e-1, "cm": 1e-2, "mm": 1e-3, "um": 1e-6}
#: A body longer than this [m] is taken for one in millimetres.
TOO_LONG = 3.0
SURFACES = (".stl", ".obj", ".ply", ".off")


def parse_length(text: str) -> float:
    """Metres from a number with or without a unit, such as 4mm or 0.004; positive."""
    found = re.fullmatch(r"\s*([0-9.eE+-]+?)\s*(m|dm|cm|mm|um)?\s*", text)
    try:
        value = float(found[1]) * UNITS[found[2] or "m"] if found else np.nan
    except ValueError:
        value = np.nan
    if not (np.isfinite(value) and value > 0):
        raise typer.BadParameter(f"expected a length such as 4mm or 0.004, got {text!r}")
    return value


def command(
    source: Annotated[
        Path,
        typer.Argument(metavar="IN", help="Closed surface, or segmented image (NIfTI, NRRD, MGH)."),
    ],
    target: Annotated[Path, typer.Argument(metavar="OUT", help="Mesh file to write, in metres.")],
    label: Annotated[
        list[int] | None,
        typer.Option("--label", help="Label in the image; several become regions of one body."),
    ] = None,
    nodes: Annotated[
        int | None, typer.Option("--nodes", min=4, help="About how many nodes (default 2500).")
    ] = None,
    edge_length: Annotated[
        float | None,
        typer.Option(
            "--edge-length",
            parser=parse_length,
            metavar="LENGTH",
            help="Mean length of an edge instead, such as 4mm.",
        ),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance",
            parser=parse_length,
            metavar="LENGTH",
            help="How far the surface may move (default a twentieth of an edge).",
        ),
    ] = None,
    unit: Annotated[
        str, typer.Option("--unit", help="Unit of a surface file: m, dm, cm, mm, um.")
    ] = "m",
    fill_holes: Annotated[
        bool, typer.Option("--fill-holes", help="Take an open surface and close it.")
    ] = False,
    largest: Annotated[
        bool, typer.Option("--largest", help="Keep only the largest of several parts.")
    ] = False,
    json_output: JsonOption = False,
) -> None:
    r"""Fill a closed surface, or a label of a segmented image, with tetrahedra.

    Needs pip install 'palpate\[mesh]'. The mesher is fTetWild: any closed surface will do, also
    one of many thin triangles that cross. Steps between the voxels of an image are smoothed within
    a voxel.

    Example: palpate mesh organ.stl organ.seg --unit mm --nodes 2500

    Example: palpate mesh labels.nii.gz kidney.seg --label 3 --edge-length 5mm
    """
    if nodes is not None and edge_length is not None:
        raise typer.BadParameter("give --nodes or --edge-length")
    if unit not in UNITS:
        raise typer.BadParameter(f"expected one of {', '.join(UNITS)}, got {unit!r}")
    image = is_image(source)
    if image and (unit != "m" or fill_holes):
        raise typer.BadParameter("--unit and --fill-holes are for surfaces")
    if not image and label:
        raise typer.BadParameter(f"--label is for images; {source} is none by its name")
    # Told before the work, not after it.
    if not is_mesh(str(target)):
        raise typer.BadParameter(f"OUT: expected a mesh file such as organ.seg, got {target}")
    if not target.parent.is_dir():
        raise FileNotFoundError(2, "No such folder", str(target.parent))
    size: dict[str, Any] = {
        "nodes": nodes,
        "edge_length": edge_length,
        "tolerance": tolerance,
        "largest": largest,
    }
    notes: list[str] = []
    with redirect_stdout(sys.stderr), _progress(quiet=json_output) as progress:
        if image:
            made, surface = fill_labels(source, label or None, progress=progress, **size)
        else:
            given = read_mesh(source)
            notes.extend(given.notes)
            surface = given.with_nodes(given.nodes * UNITS[unit])
            made = mesh_surface(surface, fill_holes=fill_holes, progress=progress, **size)
        notes.extend(made.notes)
        write_mesh(target, made)
    length = float(np.ptp(made.nodes, axis=0).max())
    if not image and length > TOO_LONG:
        notes.append(f"it is {length:.4g} m long: if the file is in millimetres, give --unit mm")
    if target.suffix.lower() in SURFACES:
        notes.append(f"{target.suffix} holds surfaces: tetrahedra left out")
    report = describe_quality(made, surface)
    if json_output:
        print_json(
            {
                "source": str(source),
                "target": str(target),
                **report,
                "defects": [
                    {"kind": each.kind, "count": each.count, "message": each.message}
                    for each in made.validate()
                ],
                "notes": notes,
            }
        )
    else:
        _print_report(str(target), made, report, notes)


def describe_quality(made: Mesh, surface: Mesh) -> dict[str, Any]:
    """Counts, shape of the tetrahedra, and how near the mesh is to the surface it was made from."""
    angles = dihedral_angles(made.nodes, made.tetrahedra)
    shape = mean_ratios(made.nodes, made.tetrahedra)
    a, b = made.nodes[made.surface_edges.T]
    edges = np.linalg.norm(a - b, axis=1)
    away = Scene([surface]).closest(made.nodes[made.surface_nodes]).distances
    before, after = _euler_characteristic(surface), _euler_characteristic(made)
    return {
        "nodes": len(made.nodes),
        "tetrahedra": len(made.tetrahedra),
        "triangles": len(made.triangles),
        "volume": made.volume,
        "surface_volume": abs(surface.volume),
        "extent": np.ptp(made.nodes, axis=0).tolist(),
        "surface_edge": {"mean": float(edges.mean()), "min": float(edges.min())},
        "dihedral_angle": {"min": float(angles.min()), "max": float(angles.max())},
        "quality": {"min": float(shape.min()), "median": float(np.median(shape))},
        "deviation": float(away.max()),
        "euler_characteristic": {"surface": before, "mesh": after},
    }


def _euler_characteristic(mesh: Mesh) -> int | None:
    """Nodes - edges + triangles of a surface, 2 for a ball; None unless closed and manifold."""
    edges = np.sort(mesh.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    unique, counts = np.unique(edges, axis=0, return_counts=True)
    if np.any(counts != 2):
        return None
    return len(np.unique(mesh.triangles)) - len(unique) + len(mesh.triangles)


def _joined(report: dict[str, Any]) -> str | None:
    """What to tell if the mesh hangs together in another way than the surface."""
    before, after = (report["euler_characteristic"][each] for each in ("surface", "mesh"))
    if None in (before, after) or before == after:
        return None
    return (
        f"holes, handles or parts came or went (Euler characteristic {before}, now {after}): "
        "parts that nearly touch may have grown together; try a smaller --tolerance"
    )


def _print_report(path: str, made: Mesh, report: dict[str, Any], notes: list[str]) -> None:
    out = console()
    unit, metre = ("m", 1.0) if max(report["extent"]) >= 10 else ("mm", 1e3)
    size = " x ".join(f"{metre * each:.4g}" for each in report["extent"])
    angle, shape, edge = report["dihedral_angle"], report["quality"], report["surface_edge"]
    change = report["volume"] / report["surface_volume"] - 1
    out.print(
        table(
            path,
            "quantity<|value<",
            [
                ("nodes", whole(report["nodes"])),
                ("tetrahedra", whole(report["tetrahedra"])),
                ("surface triangles", whole(report["triangles"])),
                ("size", f"{size} {unit}"),
                ("volume", f"{volume_text(report['volume'])} ({100 * change:+.2f} %)"),
                (
                    "surface edges",
                    f"{metre * edge['mean']:.3g} {unit}, shortest {metre * edge['min']:.3g}",
                ),
                ("farthest from the surface", f"{metre * report['deviation']:.2g} {unit}"),
                ("dihedral angles", f"{angle['min']:.1f}° to {angle['max']:.1f}°"),
                ("shape (1 regular)", f"min {shape['min']:.2f}, median {shape['median']:.2f}"),
            ],
        )
    )
    for defect in made.validate():
        out.print(Text(f"warning: {defect.message}", style="yellow"))
    if joined := _joined(report):
        out.print(Text(f"warning: {joined}", style="yellow"))
    for note in notes:
        out.print(Text(f"note: {note}"))


@contextmanager
def _progress(*, quiet: bool) -> Iterator[Progress | None]:
    """What to call with news: changes a line on a terminal; None elsewhere."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    with console(error=True).status("reading") as status:
        yield lambda text: status.update(text)
