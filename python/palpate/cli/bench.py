"""`palpate bench paper | scaling | peers | realtime | cutting | verification`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text

from palpate.bench import compare, cutting, paper, plots, realtime, scaling
from palpate.bench.output import milliseconds
from palpate.bench.verification import run as verification
from palpate.cli.opening import open_model
from palpate.cli.output import (
    JsonOption,
    ThreadsOption,
    console,
    print_json,
    reporting,
    table,
    whole,
)
from palpate.model import Model

ModelsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="MODEL",
        help="Models to measure; the paper's two cases if none is named.",
        show_default=False,
    ),
]
FramesOption = Annotated[int, typer.Option(min=2, help="Frames of the recorded motion.")]
RepeatsOption = Annotated[int, typer.Option(min=1, help="Passes over the motion that count.")]
PlotsOption = Annotated[bool, typer.Option("--plots/--no-plots", help="Draw plots (matplotlib).")]

_DEFAULT_MODELS = ("paper1", "paper2")

bench_app = typer.Typer(
    name="bench",
    help="Measure: the paper's evaluation, growth with size, other libraries, exact solutions.",
    no_args_is_help=True,
)


def _output_option(name: str) -> Any:
    return typer.Option("--output", "-o", help=f"Folder for results, e.g. out/bench/{name}.")


def bench_paper(
    models: ModelsArgument = None,
    leaf_size: Annotated[
        list[int] | None,
        typer.Option("--leaf-size", "-K", min=1, help="A leaf size; may be given several times."),
    ] = None,
    frames: FramesOption = 24,
    repeats: RepeatsOption = 7,
    output: Annotated[Path, _output_option("paper")] = Path("out/bench/paper"),
    draw: PlotsOption = True,
    json_output: JsonOption = False,
) -> None:
    """Repeat the paper's evaluation: update, traversal and polygon tests over the leaf size K.

    Writes results.json, paper.csv, report.md and plots.

    Example: palpate bench paper

    Example: palpate bench paper scene.bml -K 1 -K 5 -K 20 --output results
    """
    opened = _prepare(models, draw=draw)
    sizes = sorted(set(leaf_size)) if leaf_size else list(paper.LEAF_SIZES)
    total = paper.rounds(len(opened), sizes, repeats)
    with progress(total, quiet=json_output) as advance:
        cases = paper.run(
            opened,
            output,
            leaf_sizes=sizes,
            frames=frames,
            repeats=repeats,
            plots=draw,
            advance=advance,
        )
    rows: list[dict[str, Any]] = [
        {
            "model": case.name,
            "best_leaf_size": case.best.leaf_size,
            "nodes": case.best.nodes,
            "total": case.best.times["total"][1],
            "wide": case.wide["total"][1],
        }
        for case in cases
    ]
    if json_output:
        print_json({"output": str(output), "cases": rows})
        return
    console().print(
        table(
            "Best leaf size of the paper's method, and the wide method",
            "model<|K|tree nodes P|total [ms]|wide [ms]",
            [
                (
                    row["model"],
                    row["best_leaf_size"],
                    whole(row["nodes"]),
                    milliseconds(row["total"]),
                    milliseconds(row["wide"]),
                )
                for row in rows
            ],
        )
    )
    _tell(output)


def bench_scaling(
    models: ModelsArgument = None,
    divisions: Annotated[
        list[int] | None,
        typer.Option("--divisions", "-n", min=1, help="Parts of each edge; may be repeated."),
    ] = None,
    threads: Annotated[
        list[int] | None, typer.Option(min=1, help="Worker threads; may be repeated.")
    ] = None,
    frames: FramesOption = 12,
    repeats: RepeatsOption = 5,
    bearable: Annotated[
        float,
        typer.Option(min=0, help="Seconds of the longest frame; slower methods are left out."),
    ] = 0.5,
    output: Annotated[Path, _output_option("scaling")] = Path("out/bench/scaling"),
    draw: PlotsOption = True,
    json_output: JsonOption = False,
) -> None:
    """Refine the models to 200,000 nodes and measure how the time of a frame grows.

    Writes results.json, scaling.csv, report.md and a plot.

    Example: palpate bench scaling

    Example: palpate bench scaling scene.bml -n 1 -n 2 --threads 1 --threads 4
    """
    opened = _prepare(models, draw=draw)
    parts = sorted(set(divisions or (1, 2, 3)))
    with progress(len(opened) * len(parts), quiet=json_output) as advance:
        results = scaling.run(
            opened,
            output,
            divisions=parts,
            threads=sorted(set(threads or (1, 2))),
            frames=frames,
            repeats=repeats,
            bearable=bearable,
            drawn=draw,
            advance=advance,
        )
    if json_output:
        rows = [
            {
                "model": each.model,
                "triangles": each.triangles,
                "query": each.query,
                "contender": each.contender,
                "wall": each.wall,
            }
            for each in results
        ]
        print_json({"output": str(output), "measurements": rows})
        return
    console().print(
        table(
            "Time of a frame",
            "model<|triangles|query<|contender<|ms",
            [
                (
                    each.model,
                    whole(each.triangles),
                    each.query,
                    each.contender,
                    milliseconds(each.wall),
                )
                for each in results
            ],
        )
    )
    _tell(output)


def bench_peers(
    models: ModelsArgument = None,
    peer: Annotated[
        list[str] | None,
        typer.Option(
            help=f"Only this library; may be repeated. One of: {', '.join(compare.PEERS)}."
        ),
    ] = None,
    frames: FramesOption = 24,
    repeats: RepeatsOption = 7,
    output: Annotated[Path, _output_option("peers")] = Path("out/bench/peers"),
    draw: PlotsOption = True,
    json_output: JsonOption = False,
) -> None:
    r"""Measure palpate beside other libraries and compare their answers, pair by pair.

    What is missing is named, with how to get it: pip install 'palpate\[peers]' for the Python
    packages; parry3d and Embree need a checkout and cargo. Writes results.json, peers.csv,
    report.md and a plot.

    Example: palpate bench peers

    Example: palpate bench peers scene.bml --peer palpate --peer parry3d
    """
    chosen = peer or list(compare.PEERS)
    unknown = [name for name in chosen if name not in compare.PEERS]
    if unknown:
        known = ", ".join(compare.PEERS)
        raise typer.BadParameter(f"no peer {unknown[0]}; expected one of {known}")
    opened = _prepare(models, draw=draw)
    with progress(len(opened) * len(chosen) * (repeats + 1), quiet=json_output) as advance:
        outcomes, missing = compare.run(
            opened,
            output,
            peers=chosen,
            frames=frames,
            repeats=repeats,
            drawn=draw,
            advance=advance,
        )
    if json_output:
        rows = [
            {
                "model": each.model,
                "query": each.query,
                "contender": each.contender,
                "wall": each.wall,
                "answer": each.answer,
            }
            for each in outcomes
        ]
        print_json({"output": str(output), "outcomes": rows, "missing": missing})
        return
    console().print(
        table(
            "Time of a frame",
            "model<|contender<|ms|answer<",
            [
                (each.model, each.contender, milliseconds(each.wall), each.answer)
                for each in sorted(outcomes, key=lambda each: (each.model, each.wall))
            ],
        )
    )
    for name, how in missing.items():
        console().print(Text(f"missing: {name}: {how}"))
    _tell(output)


def bench_realtime(
    models: Annotated[
        list[str] | None,
        typer.Argument(metavar="MODEL", help="Models; case2 unless given.", show_default=False),
    ] = None,
    law: Annotated[
        list[str] | None,
        typer.Option(help="A law for all bodies, or `as written`; may be given several times."),
    ] = None,
    threads: Annotated[
        list[int] | None,
        typer.Option("--threads", min=1, help="Worker threads; may be given several times."),
    ] = None,
    divisions: Annotated[
        int, typer.Option(min=1, help="Every edge in so many parts: 2 makes 8 times the elements.")
    ] = 1,
    landing: Annotated[int, typer.Option(min=1, help="Frames until all is at rest.")] = (
        realtime.LANDING
    ),
    rest: Annotated[int, typer.Option(min=0, help="Frames at rest.")] = realtime.REST,
    pulled: Annotated[int, typer.Option(min=0, help="Frames with a body pulled about.")] = (
        realtime.PULLED
    ),
    loop: Annotated[
        float, typer.Option(min=0, help="Seconds of a tool's loop at 1 kHz; 0 for none.")
    ] = 4.0,
    output: Annotated[Path, _output_option("realtime")] = Path("out/bench/realtime"),
    json_output: JsonOption = False,
) -> None:
    """Measure whole frames of 1/60 s: bodies that land, that rest, and one that is pulled about.

    Then a tool's loop at 1 kHz that feels the pile while it is stepped in real time.

    Every run is a process of its own. Writes results.json, realtime.csv and report.md.

    Example: palpate bench realtime --law linear --law corotated --law neo-hookean

    Example: palpate bench realtime case2 --divisions 2 --landing 20 --rest 0 --pulled 0
    """
    laws = law or ["linear", "corotated", "neo-hookean"]
    counts = threads or [1, 2]
    chosen = [(Path(name).stem, name, divisions) for name in models or ["case2"]]
    for _, name, _ in chosen:
        for each in laws:  # errors before anything is measured
            realtime.with_law(open_model(name)[0], each)
    with progress(len(chosen) * len(laws) * len(counts), quiet=json_output) as advance:
        outcomes = realtime.run(
            chosen,
            output,
            laws=laws,
            threads=counts,
            frames=(landing, rest, pulled),
            loop=loop,
            advance=advance,
        )
    if json_output:
        rows = [
            {
                "model": each.model,
                "law": each.law,
                "threads": each.threads,
                "situation": situation.name,
                "median": situation.median,
                "p90": situation.p90,
                "worst": situation.worst,
            }
            for each in outcomes
            for situation in each.situations
        ]
        print_json({"output": str(output), "frames": rows})
        return
    console().print(
        table(
            "Frames of 1/60 s",
            "model<|law<|threads|situation<|median ms|90 %|worst|frames/s",
            [
                (
                    each.model,
                    each.law,
                    str(each.threads),
                    situation.name,
                    milliseconds(situation.median),
                    milliseconds(situation.p90),
                    milliseconds(situation.worst),
                    realtime.rate(situation.median),
                )
                for each in outcomes
                for situation in each.situations
            ],
        )
    )
    _tell(output)


def bench_cutting(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="What is cut.")] = "case2",
    body: Annotated[str, typer.Option(help="The body that the cut goes through.")] = "kidney_left",
    frames: Annotated[int, typer.Option(min=2, help="Frames of the cut.")] = 120,
    threads: ThreadsOption = 1,
    output: Annotated[Path, _output_option("cutting")] = Path("out/bench/cutting"),
    json_output: JsonOption = False,
) -> None:
    """Cut through a resting organ in small steps: median, 99th percentile, worst, by stage.

    Writes results.json, cutting.csv and report.md.

    Example: palpate bench cutting --threads 2
    """
    opened = open_model(model)[0]
    with progress(cutting.SETTLE + frames, quiet=json_output) as advance:
        outcome = cutting.run(
            opened,
            Path(model).stem,
            body,
            frames=frames,
            threads=threads,
            output=output,
            advance=advance,
        )
    if json_output:
        print_json({"output": str(output), **asdict(outcome)})
        return
    console().print(table("Frames of 1/60 s", cutting.HEADINGS, cutting.rows(outcome)))
    console().print(table("Refit and traversal", cutting.TREES, cutting.trees(outcome)))
    _tell(output)


def bench_verification(
    output: Annotated[Path, _output_option("verification")] = Path("out/bench/verification"),
    draw: PlotsOption = True,
    json_output: JsonOption = False,
) -> None:
    """Check the mechanics against exact solutions: elasticity, contact, motion.

    Takes some minutes. With PALPATE_DATA set to a folder with organs/*.vtk real organs are dropped
    in a heap as well. Writes results.json, report.md and plots.

    Example: palpate bench verification
    """
    if draw:
        plots.require()
    with progress(verification.PARTS, quiet=json_output) as advance:
        findings = verification.run(output, drawn=draw, advance=advance)
    if json_output:
        print_json({"output": str(output), "findings": [asdict(each) for each in findings]})
        return
    console().print(
        table(
            "The mechanics beside exact solutions",
            "check<|target<|measured<|holds<",
            [
                (each.check, each.target, each.measured, "yes" if each.holds else "NO")
                for each in findings
            ],
        )
    )
    _tell(output)


def _prepare(models: list[str] | None, *, draw: bool) -> list[tuple[str, Model]]:
    """Open the models, and find out what is missing before anything is measured."""
    if draw:
        plots.require()
    return [(Path(name).stem, open_model(name)[0]) for name in models or _DEFAULT_MODELS]


def _tell(output: Path) -> None:
    console().print(Text(f"report: {output / 'report.md'}"))


@contextmanager
def progress(total: int, *, quiet: bool) -> Iterator[Callable[[], None]]:
    """A function that moves a bar on a terminal and does nothing elsewhere."""
    if quiet or not sys.stderr.isatty():
        yield lambda: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console(error=True), transient=True) as bar:
        task = bar.add_task("", total=total)
        yield lambda: bar.advance(task)


for _name, _command in (
    ("paper", bench_paper),
    ("scaling", bench_scaling),
    ("peers", bench_peers),
    ("realtime", bench_realtime),
    ("cutting", bench_cutting),
    ("verification", bench_verification),
):
    bench_app.command(_name)(reporting(_command))
