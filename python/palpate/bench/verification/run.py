"""All checks at full size, with a table, plots and a report."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from palpate.bench.output import markdown_table, write_json, write_text
from palpate.bench.verification import (
    draw,
    elasticity,
    laws,
    motion,
    organs,
    responses,
    shapes,
    touching,
)
from palpate.model import Material

#: Laws by name.
LAWS = ("linear", *laws.ISOTROPIC, "hgo")
#: How many times :func:`run` calls ``advance``.
PARTS = 5

#: Organs of the drop test, and Young's modulus [Pa] of each.
ORGANS = {
    "aorta_n2500": 200e3,
    "vena_cava_n2500": 150e3,
    "kidney_l_n2500": 8e3,
    "kidney_r_n2500": 8e3,
}


@dataclass(frozen=True)
class Finding:
    """One line of the table: what was checked, what it must reach, what was measured."""

    check: str
    target: str
    measured: str
    holds: bool


def tissue(law: str, poisson: float = 0.3, damping: float = 0.0) -> Material:
    """A law with fibres along a direction that is no axis."""
    fibre = (1.0, 2.0, 2.0) if law == "hgo" else None
    return Material(law=law, poisson=poisson, damping=damping, fibre=fibre, kappa=0.1)


def _percent(ratio: float) -> str:
    return f"{100 * (ratio - 1):+.2g} %"


def _within(check: str, target: float, ratios: dict[str, float]) -> Finding:
    worst = max(abs(ratio - 1) for ratio in ratios.values())
    measured = ", ".join(f"{name} {_percent(ratio)}" for name, ratio in ratios.items())
    return Finding(check, f"{100 * target:g} %", measured, worst <= target)


def _below(check: str, target: float, values: dict[str, float]) -> Finding:
    name = max(values, key=lambda each: values[each])
    return Finding(check, f"{target:g}", f"{values[name]:.1e} ({name})", values[name] <= target)


def check_elasticity(folder: Path | None) -> list[Finding]:
    """Patch tests, convergence, beams."""
    mesh = shapes.box((4, 4, 4), (1.0, 1.0, 1.0), shapes.bumps(0.06))
    patches = {
        f"{law}, nu {nu}": elasticity.patch(mesh, tissue(law, nu))
        for law in LAWS
        for nu in (0.3, 0.49)
    }
    patches["an organ"] = elasticity.patch(organs.kidney(), tissue("neo-hookean"))
    rates = {
        law: elasticity.convergence(tissue(law), (4, 8, 16))
        for law in ("linear", "corotated", "neo-hookean", "mooney-rivlin")
    }
    refined = {
        "cantilever": elasticity.cantilever((4, 8, 16)),
        "twisted, across": elasticity.twisted_beam((2, 4, 8), 1),
        "twisted, in plane": elasticity.twisted_beam((2, 4, 8), 2),
    }
    bent = {
        law: {load: elasticity.bent_beam(law, load, (4, 6)) for load in (1.0, 3.0, 6.0, 10.0)}
        for law in ("corotated", "neo-hookean")
    }
    if folder is not None:
        draw.convergence(rates, folder / "convergence.png")
        draw.beams(refined, bent, folder / "beams.png")
    slowest = min(rates, key=lambda law: rates[law].rate)
    every = [result for results in bent.values() for result in results.values()]
    return [
        _below("patch tests, largest error / displacement", 1e-10, patches),
        Finding(
            "convergence in L2, rate",
            "1.9",
            f"{rates[slowest].rate:.2f} ({slowest})",
            rates[slowest].rate >= 1.9,
        ),
        _within("cantilever, Timoshenko", 0.03, {"sag": refined["cantilever"].limit}),
        _within("hanging bar", 0.01, {"stretch": elasticity.bar(32)}),
        _within(
            "twisted beam, MacNeal and Harder",
            0.03,
            {name.removeprefix("twisted, "): refined[name].limit for name in list(refined)[1:]},
        ),
        _within(
            "elastica, large rotation: sag",
            0.03,
            {"worst": max((e.sag.limit for e in every), key=lambda limit: abs(limit - 1))},
        ),
        _below(
            "elastica: shortening at the same sag",
            0.02,
            {"worst": max(each.shape_errors[-1] for each in every)},
        ),
    ]


def check_laws(folder: Path | None) -> list[Finding]:
    """Responses in closed form, invariance."""
    young = tissue("stvk").young
    stretches, shears = list(np.linspace(0.6, 1.8, 49)), list(np.linspace(0.02, 1.2, 49))
    names = [law for law in LAWS if law != "linear"]
    uniaxial = {law: responses.uniaxial(tissue(law, 0.4), stretches) for law in laws.ISOTROPIC}
    shear = {law: responses.simple_shear(tissue(law, 0.4), shears) for law in names}
    f = np.array([[1.2, 0.1, -0.1], [0.1, 0.85, 0.2], [0.0, 0.1, 1.1]])
    left_over = {law: responses.unbalanced(tissue(law, 0.4), f) for law in names}
    rotation = responses.turned([1, 2, 3], 2.5)
    found = {law: responses.rotation_invariance(tissue(law, 0.4, 0.01), rotation) for law in LAWS}
    if folder is not None:
        draw.responses(uniaxial, shear, young, folder / "laws.png")
    return [
        _below("uniaxial stress, error", 1e-8, {law: c.error for law, c in uniaxial.items()}),
        _below("simple shear, error", 1e-8, {law: c.error for law, c in shear.items()}),
        _below("forces left over under closed-form tractions", 1e-10, left_over),
        _below(
            "half a second, everything turned: positions / size",
            1e-9,
            {law: each.positions for law, each in found.items()},
        ),
    ]


def check_hertz() -> tuple[list[touching.Hertz], list[Finding]]:
    """A rigid sphere on a soft block."""
    series = touching.hertz(6, [2.5e-4, 5e-4, 7.5e-4, 1e-3])
    last = series[-1]
    ratios = {
        "radius": last.radius / last.exact_radius,
        "depth": last.depth / last.exact_depth,
        "peak pressure": float(last.pressures.max() / last.exact_pressure),
    }
    return series, [_within("Hertz contact, 6 cells to the radius", 0.05, ratios)]


def check_contact(folder: Path | None) -> list[Finding]:
    """Hertz, the contact patch, the incline."""
    series, found = check_hertz()
    patches = {
        f"{a} on {b} cells": touching.contact_patch(b, a) for a, b in ((4, 3), (8, 5), (12, 7))
    }
    frictions = (0.2, 0.5)
    slides = {
        mu: [touching.incline(k * mu, mu) for k in (0.5, 0.8, 0.95, 0.99, 1.01, 1.05, 1.2, 1.5, 2)]
        for mu in frictions
    }
    if folder is not None:
        draw.contact(series, patches, slides, folder / "contact.png")
    angles = {f"mu {mu}": touching.friction_angle(mu) for mu in frictions}
    typical = max(patch.typical_error for patch in patches.values())
    return [
        *found,
        Finding(
            "contact patch, rms error of the stress",
            "3 %",
            f"{100 * typical:.1f} %",
            typical < 0.03,
        ),
        _within("slope at which a block slides", 0.01, angles),
    ]


def check_motion(folder: Path | None) -> list[Finding]:
    """Momenta and energy."""
    names = ("linear", "corotated", "neo-hookean")
    collisions = {law: motion.collision(law) for law in names}
    prisons = {law: motion.prison(law, 1200) for law in names}
    if folder is not None:
        draw.motion(collisions, prisons, folder / "motion.png")
    return [
        _below(
            "linear momentum, 10,000 steps",
            1e-12,
            {k: d.linear.max() for k, d in collisions.items()},
        ),
        _below(
            "angular momentum, 10,000 steps",
            1e-9,
            {k: d.angular.max() for k, d in collisions.items()},
        ),
        _below(
            "energy gained without work, of that at the start",
            1e-6,
            {k: d.largest_gain for each in (collisions, prisons) for k, d in each.items()},
        ),
    ]


def check_organs(folder: Path | None) -> list[Finding]:
    """A squeezed kidney; a heap of real organs where there is a folder of them."""
    kidney = organs.kidney()
    squeezes = {
        law: organs.squeeze(kidney, Material(law=law, young=8e3, density=1050, damping=0.02), 0.3)
        for law in ("linear", "corotated", "neo-hookean")
    }
    heaps: dict[str, organs.Heap] = {}
    data = os.environ.get("PALPATE_DATA")
    if data:
        meshes = organs.real_organs(Path(data), list(ORGANS))
        for law in ("linear", "neo-hookean"):
            materials = [
                Material(law=law, young=young, density=1050, damping=0.02)
                for young in ORGANS.values()
            ]
            heaps[law] = organs.heap(meshes, materials)
    if folder is not None:
        draw.organs(squeezes, heaps, folder / "organs.png")
    found = []
    for name, squeeze in squeezes.items():
        left = int(squeeze.inverted[-1])
        misfit, beyond = squeeze.misfits[-1], squeeze.beyond.max()
        found.append(
            Finding(
                f"squeezed to 30 %, {name}",
                "misfit 0.01, 0 inverted, 0 pairs, 0.001 beyond a plate",
                f"misfit {misfit:.1e}, {left} inverted, {squeeze.intersections} pairs, "
                f"{beyond:.0e} beyond",
                misfit < 0.01 and left == 0 and squeeze.intersections == 0 and beyond < 1e-3,
            )
        )
    for name, heap in heaps.items():
        left, depth = int(heap.inverted[-1]), heap.depths[-1]
        found.append(
            Finding(
                f"four organs dropped, {name}",
                "0 inverted, depth 1 % of an edge",
                f"{left} inverted, depth {100 * depth:.1f} %, "
                f"{heap.intersections[-1]:.0f} of {heap.intersections[0]:.0f} pairs left",
                left == 0 and depth <= 0.01,
            )
        )
    return found


def run(output: Path, *, drawn: bool, advance: Callable[[], None]) -> list[Finding]:
    """All checks; writes results.json, report.md and plots to ``output``."""
    folder = output if drawn else None
    findings: list[Finding] = []
    for check in (
        check_elasticity,
        check_laws,
        check_contact,
        check_motion,
        check_organs,
    ):
        findings += check(folder)
        advance()
    rows = [
        (each.check, each.target, each.measured, "yes" if each.holds else "**no**")
        for each in findings
    ]
    table = markdown_table("check<|target<|measured<|holds<", rows)
    write_text(output / "report.md", "# Verification", table)
    write_json(
        output / "results.json",
        "palpate bench verification",
        {"plots": drawn},
        findings=[asdict(each) for each in findings],
    )
    return findings
