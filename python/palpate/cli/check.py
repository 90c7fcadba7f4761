"""`palpate check`: what a model holds and what is suspicious about it."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.text import Text

from palpate.cli.opening import open_model, pair_counts
from palpate.cli.output import (
    JsonOption,
    ModelArgument,
    RepairOption,
    console,
    numbers_text,
    print_json,
    table,
    volume_text,
    whole,
)
from palpate.model import Body, Model
from palpate.results.measures import mean_ratios
from palpate.scene import Scene


def command(
    model: ModelArgument, repair: RepairOption = False, json_output: JsonOption = False
) -> None:
    """Report every body of a model, its placement, its defects, and what overlaps at the start.

    Defects are told and allowed; what makes the model unusable is an error (exit status 1).

    Example: palpate check case1

    Example: palpate check kidney.msh --repair
    """
    opened, path, notes = open_model(model, repair=repair)
    report = describe_model(opened)
    if json_output:
        print_json({"model": str(path), **report, "notes": list(notes)})
        return
    _print_report(str(path), report, notes)


def describe_model(model: Model) -> dict[str, Any]:
    """Everything `check` tells, in plain types."""
    names = [body.name for body in model.bodies]
    overlaps = Scene(model).intersections()
    return {
        "gravity": list(model.gravity),
        "bodies": [
            _describe_body(body, core)
            for body, core in zip(model.bodies, model._core.bodies, strict=True)
        ],
        "overlaps": pair_counts(overlaps, names),
    }


def _describe_body(body: Body, core: Any) -> dict[str, Any]:
    mesh, material, contact = body.mesh, body.material, body.contact
    translation, axis, angle, scale, sheared = core.placement
    shape = mean_ratios(mesh.nodes, mesh.tetrahedra) if len(mesh.tetrahedra) else None
    return {
        "name": body.name,
        "file": core.source,
        "nodes": len(mesh.nodes),
        "tetrahedra": len(mesh.tetrahedra),
        "triangles": len(mesh.triangles),
        "volume": mesh.volume,
        "bounds": [mesh.nodes.min(axis=0).tolist(), mesh.nodes.max(axis=0).tolist()],
        "quality": None
        if shape is None
        else {"min": float(shape.min()), "median": float(np.median(shape))},
        "placement": {
            "translation": list(translation),
            "rotation_axis": list(axis),
            "rotation_angle_degrees": angle,
            "scale": list(scale),
            "sheared": sheared,
        },
        "processor": body.processor,
        "rigid": None if body.rigid is None else ("moving" if body.rigid else "fixed"),
        "fixed_nodes": len(np.asarray(body.fixed_nodes)),
        "material": {
            "law": material.law,
            "young": material.young,
            "poisson": material.poisson,
            "density": material.density,
            "damping": material.damping,
            "mass_damping": material.mass_damping,
        },
        "regions": {
            str(region): {
                "law": each.law,
                "young": each.young,
                "poisson": each.poisson,
                "density": each.density,
            }
            for region, each in body.regions.items()
        },
        "contact": {
            "friction": contact.friction,
            "distance": contact.distance,
            "stiffness": contact.stiffness,
            "self": contact.self_contact,
        },
        "defects": [
            {"kind": each.kind, "count": each.count, "message": each.message}
            for each in mesh.validate()
        ],
    }


def _print_report(path: str, report: dict[str, Any], notes: tuple[str, ...]) -> None:
    out = console()
    bodies = report["bodies"]
    out.print(Text(f"{path}: {len(bodies)} {'body' if len(bodies) == 1 else 'bodies'}"))
    out.print(
        table(
            "Meshes",
            "body<|nodes|tetrahedra|triangles|volume|shape min|median",
            [
                (
                    each["name"],
                    whole(each["nodes"]),
                    whole(each["tetrahedra"]),
                    whole(each["triangles"]),
                    volume_text(each["volume"]),
                    *_quality_texts(each["quality"]),
                )
                for each in bodies
            ],
        )
    )
    out.print(
        table(
            "Placement",
            "body<|translation [m]<|rotation<|scale<|PE|file<",
            [
                (
                    each["name"],
                    numbers_text(each["placement"]["translation"]),
                    _rotation_text(each["placement"]),
                    numbers_text(each["placement"]["scale"])
                    + (" (shears)" if each["placement"]["sheared"] else ""),
                    "auto" if each["processor"] is None else each["processor"],
                    each["file"] or "",
                )
                for each in bodies
            ],
        )
    )
    out.print(
        table(
            "Behaviour",
            "body<|kind<|law<|young [Pa]|poisson|density [kg/m³]|fixed nodes|friction|"
            "self-contact<",
            [
                (
                    each["name"],
                    "soft" if each["rigid"] is None else f"rigid, {each['rigid']}",
                    *_material_texts(each),
                    whole(each["fixed_nodes"]),
                    f"{each['contact']['friction']:g}",
                    "on" if each["contact"]["self"] else "off",
                )
                for each in bodies
            ],
        )
    )
    for each in bodies:
        for defect in each["defects"]:
            out.print(Text(f"warning: {each['name']}: {defect['message']}", style="yellow"))
    for note in notes:
        out.print(Text(f"note: {note}"))
    if report["overlaps"]:
        out.print(
            table(
                "Overlaps at the start",
                "body<|with<|triangle pairs",
                [
                    (
                        each["body_a"],
                        "itself" if each["body_a"] == each["body_b"] else each["body_b"],
                        whole(each["pairs"]),
                    )
                    for each in report["overlaps"]
                ],
            )
        )
    else:
        out.print(Text("Nothing overlaps at the start."))


def _quality_texts(quality: dict[str, float] | None) -> tuple[str, str]:
    if quality is None:
        return "-", "-"
    return f"{quality['min']:.2f}", f"{quality['median']:.2f}"


def _material_texts(body: dict[str, Any]) -> tuple[str, str, str, str]:
    if body["rigid"] is not None:
        return "-", "-", "-", "-"
    material = body["material"]
    laws = dict.fromkeys([material["law"], *(each["law"] for each in body["regions"].values())])
    young, poisson, density = (f"{material[name]:g}" for name in ("young", "poisson", "density"))
    return ", ".join(laws), young, poisson, density


def _rotation_text(placement: dict[str, Any]) -> str:
    angle = placement["rotation_angle_degrees"]
    if abs(angle) < 1e-9:
        return "none"
    return f"{angle:.4g}° about {numbers_text(placement['rotation_axis'])}"
