"""How plots of the benchmarks look."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from palpate.results.atomic import replacing

#: Colours that stay apart for colour-blind readers (Okabe and Ito 2008).
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#666666")
INK = "#333333"


def require() -> None:
    """Tell early, before anything is measured, if plots cannot be drawn."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ValueError(
            "plots need matplotlib: pip install 'palpate[plot]', or pass --no-plots"
        ) from None


def figure(rows: int, columns: int, *, width: float = 4.2, height: float = 3.3) -> tuple[Any, Any]:
    """A figure and its axes, shape (rows, columns), in the house's style."""
    from matplotlib.figure import Figure

    made = Figure(figsize=(width * columns, height * rows), layout="constrained", dpi=140)
    axes = made.subplots(rows, columns, squeeze=False)
    for each in axes.flat:
        each.spines[["top", "right"]].set_visible(False)
        each.spines[["left", "bottom"]].set_color("#999999")
        each.tick_params(colors=INK, labelsize=8)
        each.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.7)
        each.set_axisbelow(True)
    return made, axes


def label(axes: Any, title: str, x: str, y: str) -> None:
    """Title and axis names."""
    axes.set_title(title, fontsize=9.5, color=INK, loc="left")
    axes.set_xlabel(x, fontsize=8.5, color=INK)
    axes.set_ylabel(y, fontsize=8.5, color=INK)


def logarithmic(axes: Any, which: str = "xy") -> None:
    """Logarithmic axes with plain numbers at 1, 2 and 5 where few decades are shown."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for name in which:
        (axes.set_xscale if name == "x" else axes.set_yscale)("log")
        axis = axes.xaxis if name == "x" else axes.yaxis
        low, high = axis.get_view_interval()
        few = high / low < 300
        axis.set_major_locator(LogLocator(10, subs=(1, 2, 5) if few else (1,), numticks=20))
        axis.set_major_formatter(FuncFormatter(_number))
        axis.set_minor_formatter(NullFormatter())


def headroom(axes: Any, factor: float) -> None:
    """Room for a legend above the curves of logarithmic axes."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high * factor)


def _number(value: float, _position: int) -> str:
    return f"{value:,.0f}" if value >= 1000 else f"{value:g}"


def save(made: Any, path: Path) -> None:
    """Write the figure; no date inside, so that the same figure is the same file."""
    with replacing(path) as temporary:
        made.savefig(temporary, metadata={"Software": None})
