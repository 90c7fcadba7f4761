"""The table at the end of `palpate simulate`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rich.text import Text

from palpate.cli.output import console, duration_text, table, whole
from palpate.pictures.files import length_text

#: What the stages do.
_STAGES = {
    "change": "live cuts that open",
    "update": "positions into the bounding boxes",
    "penetration": "search for nodes inside other bodies",
    "proximity": "search for close pairs",
    "predict": "motion if contact forces stay as they are",
    "filter": "which close pairs are contacts",
    "compliance": "how touching nodes move each other",
    "forces": "contact forces",
    "advance": "motion with the new forces",
    "factor": "new matrices of deformed bodies",
}


def print_profile(report: dict[str, Any]) -> None:
    """Where the time of the steps went."""
    total = report["times"]["total"]
    stages = report["stages"]
    whole_time = sum(spread["sum"] for spread in stages.values())
    console().print(
        table(
            f"Where the time went ({duration_text(whole_time)}; "
            f"{duration_text(total['median'])} a step in the median)",
            "stage<|share|sum|median|p90|max|what it does<",
            [
                (
                    stage,
                    f"{100 * spread['sum'] / whole_time:.0f} %",
                    *(duration_text(spread[key]) for key in ("sum", "median", "p90", "max")),
                    _STAGES[stage],
                )
                for stage, spread in stages.items()
            ],
        )
    )


def print_summary(report: dict[str, Any], files: dict[str, Path]) -> None:
    """Stages, bodies, contacts, and where the files are."""
    out = console()
    steps = report["step_count"]
    rate = report["steps_per_second"]
    title = f"{whole(steps)} steps of {duration_text(report['options']['time_step'])}"
    if rate is not None:
        title += f", {rate:.1f} per second"
    if report["interrupted"]:
        title += f" (interrupted at t = {report['end_time']:.3g} s)"
    keys = ("median", "min", "p90", "max")
    out.print(
        table(
            title,
            "|".join(["stage<", *keys]),
            [
                (stage, *(duration_text(spread[key]) for key in keys))
                for stage, spread in report["times"].items()
            ],
        )
    )
    out.print(
        table(
            "Bodies at the end",
            "body<|volume change|largest|inverted tetrahedra|speed",
            [
                (
                    each["name"],
                    f"{each['volume_change_percent']:+.2f} %",
                    f"{_largest(each):+.2f} %",
                    whole(each["inverted_tetrahedra"]),
                    speed_text(each["final_speed"]),
                )
                for each in report["bodies"]
            ],
        )
    )
    series = report["steps"]
    contacts, own = series["contacts"], series["self_contacts"]
    depth = series["max_depth"]
    out.print(
        table(
            "Contacts",
            "<|at the end|most",
            [
                ("contacts", whole(contacts[-1]), whole(max(contacts))),
                ("of them self-contacts", whole(own[-1]), whole(max(own))),
                ("deepest penetration", _depth_text(depth[-1]), _depth_text(max(depth))),
            ],
        )
    )
    state = "at rest" if report["at_rest"] else "in motion"
    out.print(Text(f"t = {report['end_time']:.3g} s, {state}: {speed_text(report['final_speed'])}"))
    for kind, path in files.items():
        out.print(Text(f"{kind:<11} {path}"), soft_wrap=True)


def speed_text(speed: float) -> str:
    """A speed [m/s] in the unit that suits it."""
    return f"{speed:.3g} m/s" if speed >= 1 else f"{1000 * speed:.3g} mm/s"


def _depth_text(depth: float) -> str:
    return "none" if depth <= 0 else length_text(depth)


def _largest(body: dict[str, Any]) -> float:
    return float(max(body["volume_change_percent_min"], body["volume_change_percent_max"], key=abs))
