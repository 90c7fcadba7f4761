"""Plots of `palpate bench paper`: six of stages and two of totals as in the paper, and tests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.bench import plots
from palpate.bench.fit import TERMS
from palpate.bench.paper import PRINTED_FRACTIONS, Case

#: Files, as the report names them.
FILES = ("stages.png", "totals.png", "tests.png")

_NODES = "nodes of the tree P"
_TITLES = {"update": "update", "traversal": "traversal, level 2", "polygons": "polygon tests"}


def draw(cases: Sequence[Case], folder: Path) -> None:
    """All plots into a folder."""
    _stages(cases, folder / FILES[0])
    _totals(cases, folder / FILES[1])
    _tests(cases, folder / FILES[2])


def _stages(cases: Sequence[Case], path: Path) -> None:
    made, axes = plots.figure(len(cases), 3)
    for row, case in zip(axes, cases, strict=True):
        for each, (stage, title) in zip(row, _TITLES.items(), strict=True):
            _curve(each, case, stage, plots.COLORS[0], "paper's method")
            grid = np.geomspace(case.rows[-1].nodes, case.rows[0].nodes, 200)
            for fit, style in zip(
                [fit for fit in case.fits if fit.stage == stage], ("--", ":"), strict=False
            ):
                fitted = fit.at(TERMS[fit.stage, fit.term](grid, case.triangles)) * 1e3
                floor = 0.5 * min(one.times[stage][0] for one in case.rows) * 1e3
                fitted[fitted < floor] = np.nan
                name = f"{fit.term} + constant, R² {fit.r_squared:.3f}"
                each.plot(grid, fitted, style, color=plots.COLORS[1], linewidth=1.2, label=name)
            wide = case.wide[stage][1] * 1e3
            each.axhline(wide, color=plots.COLORS[2], linewidth=1.2, label="wide method")
            plots.label(each, f"{case.name}: {title}", _NODES, "ms per frame")
            plots.logarithmic(each)
            plots.headroom(each, 6)
            each.legend(fontsize=6.5, frameon=False, loc="upper left")
    plots.save(made, path)


def _totals(cases: Sequence[Case], path: Path) -> None:
    made, axes = plots.figure(1, len(cases), width=5.2, height=3.9)
    for each, case in zip(axes[0], cases, strict=True):
        _curve(each, case, "total", plots.COLORS[0], "paper's method, our measurement")
        best = case.best
        each.annotate(
            f"best {best.times['total'][1] * 1e3:.2f} ms\nK = {best.leaf_size}, P = {best.nodes:,}",
            (best.nodes, best.times["total"][1] * 1e3),
            xytext=(0, -30),
            textcoords="offset points",
            ha="center",
            fontsize=7.5,
            color=plots.COLORS[0],
        )
        for row in case.rows:
            if row.leaf_size in (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000):
                each.annotate(
                    f"K={row.leaf_size}",
                    (row.nodes, row.times["total"][2] * 1e3),
                    xytext=(0, 5),
                    textcoords="offset points",
                    ha="center",
                    fontsize=6.5,
                    color="#777777",
                )
        wide = case.wide["total"][1] * 1e3
        label = f"wide method, {wide:.2f} ms"
        each.axhline(wide, color=plots.COLORS[2], linewidth=1.4, label=label)
        if case.printed is not None:
            printed = case.printed
            each.plot(
                printed.nodes,
                printed.total * 1e3,
                "*",
                markersize=12,
                color=plots.COLORS[1],
                label=f"printed best: {printed.total * 1e3:.0f} ms, P = {printed.nodes:,}",
            )
        plots.label(each, f"{case.name}: total", _NODES, "ms per frame")
        plots.logarithmic(each)
        plots.headroom(each, 4)
        each.legend(fontsize=7, frameon=False, loc="upper left")
    plots.save(made, path)


def _tests(cases: Sequence[Case], path: Path) -> None:
    made, axes = plots.figure(1, len(cases), width=5.2, height=3.6)
    for each, case in zip(axes[0], cases, strict=True):
        nodes = [row.nodes for row in case.rows]
        for count, name, color in (
            ("box_tests", "pairs in leaf pairs that overlap", plots.COLORS[0]),
            ("pair_tests", "of these, tested exactly (boxes overlap too)", plots.COLORS[2]),
        ):
            fractions = [case.all_pairs / max(row.counts[count], 1) for row in case.rows]
            each.plot(
                nodes, fractions, "o-", color=color, markersize=3.5, linewidth=1.3, label=name
            )
        low, high = (1 / fraction for fraction in PRINTED_FRACTIONS[::-1])
        each.axhspan(low, high, color=plots.COLORS[1], alpha=0.15, label="the paper's range")
        plots.label(each, f"{case.name}: one polygon pair in so many", _NODES, "all pairs / tests")
        plots.logarithmic(each)
        plots.headroom(each, 4)
        each.legend(fontsize=7, frameon=False, loc="upper left")
    plots.save(made, path)


def _curve(axes: Any, case: Case, stage: str, color: str, name: str) -> None:
    nodes = [row.nodes for row in case.rows]
    low, median, high = (np.array([row.times[stage] for row in case.rows]) * 1e3).T
    axes.plot(nodes, median, "o-", color=color, markersize=3.5, linewidth=1.4, label=name)
    axes.fill_between(nodes, low, high, color=color, alpha=0.2, linewidth=0)
