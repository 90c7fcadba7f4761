"""The report of `palpate bench paper`, in Markdown."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from palpate.bench import machine, motion
from palpate.bench.output import markdown_table, milliseconds, whole
from palpate.bench.paper import Case


def report(cases: Sequence[Case], options: Mapping[str, Any], *, plots: bool) -> Iterator[str]:
    """Paragraphs."""
    yield "# The paper's evaluation, on our models"
    yield (
        "Sakamoto, Nagasaka and Ogata, *A Fast Collision Detection for Deformable Objects*, "
        "section 4: how long update, traversal and polygon tests take as the leaf size K, and with "
        "it the number of tree nodes P, varies. The method is the paper's as described: split in "
        "the middle of the longest axis, polygons of one leaf not tested against each other, one "
        "thread."
    )
    yield f"Machine: {machine.sentence(machine.describe())}."
    yield (
        f"Motion: {motion.DESCRIPTION}. {options['frames']} frames, {options['repeats']} passes, "
        f"the leaf sizes taking turns pass by pass. A time is the median over the passes, averaged "
        f"over the frames; quartiles are in `paper.csv`."
    )
    yield "## Best totals"
    yield markdown_table(
        "model<|tetrahedra|triangles|best K|P|total [ms]|pairs missed|best K that misses none|"
        "total [ms]|wide [ms]|all pairs [ms]|printed best [ms]|printed P",
        [_best(case) for case in cases],
    )
    yield (
        "The printed totals are of a 2.66 GHz Core 2 Quad, one core used; hardware and organs "
        "differ, the shape of the curves is what can be compared. Our best K is larger than the "
        "printed ones because a polygon pair is cheap here: the polygons' own boxes are compared "
        "first, in about a nanosecond, and only what overlaps is tested exactly, so that the "
        "balance of tests against traversal moves to larger leaves. Larger leaves also leave out "
        "more, since the paper does not test polygons of one leaf; the best K that misses nothing "
        "stands beside. The wide method finds every pair."
    )
    yield (
        "**On the printed P = 68,878.** For case 2 the paper prints the best total at P = 68,878 "
        "with K = 5. Both cannot be right: its four organs have 34,441 tetrahedra, and a tree down "
        "to single tetrahedra has 2 S - 1 nodes per organ, 2 x 34,441 - 4 = 68,878 in all. The "
        "printed P belongs to K = 1; at K = 5 it would be about 2 S / K - 1 = 13,800."
    )
    if plots:
        yield "![Totals over the number of tree nodes](totals.png)"
        yield "![Update, traversal and polygon tests over the number of tree nodes](stages.png)"
    for case in cases:
        yield from _case(case)
    if plots:
        yield "## Polygon tests against all pairs"
        yield "![One polygon pair in so many is tested](tests.png)"
        yield (
            "The paper tests 1/5,000 to 1/40,000 of all pairs and does not say whether it compares "
            "the polygons' own boxes first. We do: blue counts every pair in two leaves that "
            "overlap, green those whose boxes overlap too and which the exact test decides."
        )


def _best(case: Case) -> list[str]:
    best, complete, printed = case.best, case.best_complete, case.printed
    return [
        case.name,
        whole(case.tetrahedra),
        whole(case.triangles),
        str(best.leaf_size),
        whole(best.nodes),
        milliseconds(best.times["total"][1]),
        whole(best.missed),
        "-" if complete is None else str(complete.leaf_size),
        "-" if complete is None else milliseconds(complete.times["total"][1]),
        milliseconds(case.wide["total"][1]),
        "-" if case.all_pairs_time is None else milliseconds(case.all_pairs_time),
        "-" if printed is None else milliseconds(printed.total),
        "-" if printed is None else f"{printed.nodes:,} (K = {printed.leaf_size_of_nodes})",
    ]


def _case(case: Case) -> Iterator[str]:
    yield f"## {case.name}: {', '.join(case.bodies)}"
    if case.printed is not None:
        printed = case.printed
        yield (
            f"The paper's case {printed.case} ({printed.organs}): {printed.tetrahedra:,} "
            f"tetrahedra and {printed.triangles:,} polygons there, {case.tetrahedra:,} and "
            f"{case.triangles:,} here."
        )
    yield markdown_table(
        "K|P|update [ms]|traversal 1 [ms]|traversal 2 [ms]|polygon tests [ms]|total [ms]|"
        "all pairs / polygon pairs|all pairs / exact tests|missed pairs",
        [
            [
                f"**{row.leaf_size}**" if row is case.best else row.leaf_size,
                whole(row.nodes),
                *(
                    milliseconds(row.times[stage][1])
                    for stage in ("update", "objects", "traversal", "polygons", "total")
                ),
                whole(case.all_pairs / max(row.counts["box_tests"], 1)),
                whole(case.all_pairs / max(row.counts["pair_tests"], 1)),
                row.missed,
            ]
            for row in case.rows
        ]
        + [["wide", "", *_wide(case), "", "", 0]],
    )
    yield (
        "Traversal 1 finds the bodies whose boxes overlap, traversal 2 the leaves. Missed pairs, "
        "summed over the motion, meet within one leaf, where the paper does not look; `Scene` "
        "looks there too unless `same_leaf=False` is passed."
    )
    if not case.fits:
        return
    yield "The cost model, fitted by least squares as factor x term + constant:"
    yield markdown_table(
        "stage<|term<|factor [ns]|constant [ms]|R²|median error",
        [
            [
                fit.stage,
                fit.term,
                f"{fit.factor * 1e9:.3g}",
                f"{fit.constant * 1e3:.3f}",
                f"{fit.r_squared:.3f}",
                f"{fit.error:.0%}",
            ]
            for fit in case.fits
        ],
    )
    terms = {fit.term: fit.r_squared for fit in case.fits if fit.stage == "polygons"}
    better = max(terms, key=lambda term: terms[term])
    yield (
        f"Deviations are weighted relatively, so that every leaf size counts alike. The polygon "
        f"tests stand twice: (N/P)², the paper's, is what one pair of leaves costs; how many pairs "
        f"overlap grows with P. Here {better} describes the measurement better. The constant is "
        f"what no leaf size avoids: neighbours, whose boxes always overlap, and the triangles that "
        f"meet."
    )


def _wide(case: Case) -> list[str]:
    return [
        milliseconds(case.wide[stage][1])
        for stage in ("update", "objects", "traversal", "polygons", "total")
    ]
