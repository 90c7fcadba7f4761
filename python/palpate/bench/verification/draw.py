"""Plots of the checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.bench.plots import COLORS, INK, figure, label, logarithmic, save
from palpate.bench.verification.elasticity import Bending, Convergence, Refinement, elastica
from palpate.bench.verification.motion import Drift
from palpate.bench.verification.organs import Heap, Squeeze
from palpate.bench.verification.responses import Curve
from palpate.bench.verification.touching import ContactPatch, Hertz, Slide

_MARKS = "osD^v<"


def _legend(axes: Any, **options: Any) -> None:
    axes.legend(fontsize=7.5, frameon=False, labelcolor=INK, **options)


def convergence(results: Mapping[str, Convergence], path: Path) -> None:
    """Error over the length of a cell, and the slope that theory asks for."""
    made, ((axes,),) = figure(1, 1)
    for (name, result), color, mark in zip(results.items(), COLORS, _MARKS, strict=False):
        lengths = 1 / np.array(result.cells)
        text = f"{name}: {result.rate:.2f}"
        axes.plot(lengths, result.errors, mark + "-", color=color, label=text, markersize=4)
    result = next(iter(results.values()))
    lengths = 1 / np.array([result.cells[0], result.cells[-1]])
    square = 0.5 * result.errors[-1] * (lengths / lengths[-1]) ** 2
    axes.plot(lengths, square, "--", color="#999999", label="slope 2", linewidth=1)
    label(axes, "Manufactured solution", "length of a cell / edge of the cube", "error in L2")
    logarithmic(axes)
    _legend(axes, title="rate between the last two", title_fontsize=7.5)
    save(made, path)


def beams(
    refined: Mapping[str, Refinement], bent: Mapping[str, Mapping[float, Bending]], path: Path
) -> None:
    """Deflections over theory, and large rotation beside the elastica."""
    made, ((left, right),) = figure(1, 2)
    for (name, result), color, mark in zip(refined.items(), COLORS, _MARKS, strict=False):
        squares = 1 / np.array(result.cells) ** 2.0
        text = f"{name}: {result.limit:.3f}"
        ends = np.array([0.0, squares[-1]])
        left.plot(squares, 1 / np.array(result.ratios), mark + "-", color=color, markersize=4)
        left.plot(ends, 1 / np.array([result.limit, result.ratios[-1]]), ":", color=color)
        left.plot(0, 1 / result.limit, mark, color=color, label=text, clip_on=False, markersize=4)
    left.axhline(1, color="#999999", linestyle="--", linewidth=1)
    left.set_xlim(0, None)
    label(
        left,
        "Stiffness over theory, under refinement",
        "(cells across the thickness)$^{-2}$",
        "load per deflection / theory",
    )
    _legend(left, title="deflection for cells of no size", title_fontsize=7.5)
    loads = np.linspace(0, 10.5, 60)
    exact = np.array([elastica(load) if load else (0.0, 0.0) for load in loads])
    right.plot(loads, exact[:, 0], color=INK, linewidth=1, label="sag, elastica")
    right.plot(loads, exact[:, 1], "--", color=INK, linewidth=1, label="shortening, elastica")
    for (law, results), color, mark in zip(bent.items(), COLORS, _MARKS, strict=False):
        x = list(results)
        limits = [_limit(result) for result in results.values()]
        for part, text in ((0, law), (1, "")):
            y = [limit[part] for limit in limits]
            right.plot(x, y, mark, color=color, label=text or None, markersize=4, fillstyle="none")
    label(right, "Cantilever in large rotation", "load L² / E I", "displacement / length")
    _legend(right)
    save(made, path)


def _limit(result: Bending) -> tuple[float, float]:
    """Sag for cells of no size, and the shortening with it at the finest mesh's shape."""
    sag, short = result.moved[-1]
    grown = result.sag.limit / result.sag.ratios[-1]
    return sag * grown, short * grown**2


def responses(
    uniaxial: Mapping[str, Curve], shear: Mapping[str, Curve], young: float, path: Path
) -> None:
    """Stress of each law over stretch and shear: closed form and measured."""
    made, ((left, right),) = figure(1, 2)
    for axes, curves in ((left, uniaxial), (right, shear)):
        for (law, curve), color, mark in zip(curves.items(), COLORS, _MARKS, strict=False):
            axes.plot(curve.parameters, curve.exact / young, color=color, linewidth=1, label=law)
            some = slice(None, None, 4)
            measured = curve.measured[some] / young
            axes.plot(curve.parameters[some], measured, mark, color=color, markersize=3.5)
    label(left, "Uniaxial: lines exact, marks measured", "stretch", "nominal stress / E")
    label(right, "Simple shear", "shear", "shear stress (first Piola-Kirchhoff) / E")
    _legend(left)
    _legend(right)
    save(made, path)


def contact(
    hertz: Sequence[Hertz],
    patches: Mapping[str, ContactPatch],
    slides: Mapping[float, Sequence[Slide]],
    path: Path,
) -> None:
    """Hertz, the contact patch, the incline."""
    made, ((first, second), (third, fourth)) = figure(2, 2)
    last = hertz[-1]
    r = np.linspace(0, last.exact_radius, 100)
    exact = last.exact_pressure * np.sqrt(np.maximum(0, 1 - (r / last.exact_radius) ** 2))
    first.plot(r * 1e3, exact, color=INK, linewidth=1, label="Hertz")
    first.plot(
        last.distances * 1e3, last.pressures, "o", color=COLORS[0], markersize=2.5, label="nodes"
    )
    label(first, "Sphere on a soft block", "distance from the axis [mm]", "pressure [Pa]")
    _legend(first)
    loads = np.array([each.load for each in hertz])
    for values, exact_values, name, color in (
        ([h.radius for h in hertz], [h.exact_radius for h in hertz], "contact radius", COLORS[0]),
        ([h.depth for h in hertz], [h.exact_depth for h in hertz], "depth", COLORS[1]),
    ):
        second.plot(loads, np.array(exact_values) * 1e3, color=color, linewidth=1)
        second.plot(loads, np.array(values) * 1e3, "o", color=color, markersize=4, label=name)
    label(second, "Lines: Hertz", "load [N]", "[mm]")
    logarithmic(second)
    _legend(second)
    for (name, patch), color in zip(patches.items(), COLORS, strict=False):
        error = 100 * (patch.stress / -patch.pressure - 1)
        text = f"{name}: {100 * patch.typical_error:.1f} % rms"
        third.plot(error, patch.heights * 1e3, ".", color=color, markersize=2.5, label=text)
    third.axhline(100, color="#999999", linestyle="--", linewidth=1)
    label(third, "Uniform pressure through two meshes", "error of the stress [%]", "height [mm]")
    _legend(third, loc="lower left")
    for (friction, series), color in zip(slides.items(), COLORS, strict=False):
        slopes = np.array([each.slope for each in series])
        fourth.plot(slopes, [each.exact for each in series], color=color, linewidth=1)
        fourth.plot(
            slopes,
            [each.acceleration for each in series],
            "o",
            color=color,
            markersize=3.5,
            label=f"friction {friction:g}",
        )
    label(fourth, "Block on an incline; lines: Coulomb", "tan(angle)", "acceleration [m/s²]")
    _legend(fourth)
    save(made, path)


def motion(collisions: Mapping[str, Drift], prisons: Mapping[str, Drift], path: Path) -> None:
    """Errors of the momenta, and energies, over time."""
    made, ((left, right),) = figure(1, 2)
    for (law, drift), color in zip(collisions.items(), COLORS, strict=False):
        left.plot(drift.times[1:], drift.angular[1:], color=color, linewidth=1, label=law)
        left.plot(drift.times[1:], np.maximum(drift.linear[1:], 1e-17), ":", color=color)
    left.set_yscale("log")
    label(
        left,
        "10,000 steps: angular (solid), linear (dotted)",
        "time [s]",
        "error of the momentum / momentum",
    )
    _legend(left)
    for (law, drift), color in zip(prisons.items(), COLORS, strict=False):
        right.plot(drift.times, drift.energy, color=color, linewidth=1, label=law)
    right.set_yscale("log")
    label(right, "A block between six walls", "time [s]", "energy / energy at the start")
    _legend(right)
    save(made, path)


def organs(squeezes: Mapping[str, Squeeze], heaps: Mapping[str, Heap], path: Path) -> None:
    """The squeezed organ over time, and the heap."""
    made, rows = figure(2 if heaps else 1, 2)
    left, right = rows[0]
    for (name, squeeze), color in zip(squeezes.items(), COLORS, strict=False):
        left.plot(squeeze.times, squeeze.misfits, color=color, linewidth=1, label=name)
        right.plot(squeeze.times, squeeze.inverted, color=color, linewidth=1, label=name)
    gaps = next(iter(squeezes.values()))
    twin = left.twinx()
    twin.plot(gaps.times, gaps.gaps, "--", color="#999999", linewidth=1)
    twin.set_ylabel("distance of the plates / thickness (dashed)", fontsize=7, color="#777777")
    twin.spines[["top", "right"]].set_visible(False)
    twin.tick_params(colors="#777777", labelsize=7)
    label(left, "Squeezed: distance from the rest shape", "time [s]", "largest / size")
    label(right, "Squeezed: inverted tetrahedra", "time [s]", "count")
    _legend(left)
    _legend(right)
    if heaps:
        left, right = rows[1]
        for (name, heap), color in zip(heaps.items(), COLORS, strict=False):
            left.plot(heap.times, heap.depths, color=color, linewidth=1, label=name)
            right.plot(heap.times, heap.intersections, color=color, linewidth=1, label=name)
        label(left, "Dropped: deepest node inside another", "time [s]", "depth / mean edge")
        label(right, "Dropped: pairs of triangles that meet", "time [s]", "count")
        _legend(left)
        _legend(right)
    save(made, path)
