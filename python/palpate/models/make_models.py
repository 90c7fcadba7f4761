"""Makes the example meshes beside this file, the same bits at every run.

Needs numpy and scipy (``pip install palpate[test]`` brings both); takes about ten minutes, most of it
spent on improving elements. Run it as ``python make_models.py``, or with names to make some of them:
``python make_models.py aorta tray``. The ``.bml`` files are written by hand.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from generator import nodes, shapes, tetrahedra, tray
from generator.checks import check_solid, check_surface
from generator.files import write_seg
from generator.improve import improve

FOLDER = Path(__file__).parent


@dataclass
class Organ:
    """An implicit shape and the counts that its mesh shall have.

    ``edge`` [m] is the expected edge length, ``low`` and ``high`` [m] hold the shape. ``growth`` is
    how much the spacing of inner nodes grows per metre of depth; ``seed`` is of the first placement.
    """

    shape: shapes.Shape
    node_count: int
    triangle_count: int
    edge: float
    low: tuple[float, float, float] = (-0.07, -0.06, -0.13)
    high: tuple[float, float, float] = (0.12, 0.04, 0.125)
    growth: float = 0.3
    seed: int = 1
    sets: Callable[[np.ndarray], dict[str, np.ndarray]] = field(default=lambda _: {})


def near(centre: np.ndarray, radius: float) -> Callable[[np.ndarray], np.ndarray]:
    """Indices of nodes within ``radius`` [m] of ``centre``."""
    return lambda x: np.flatnonzero(np.linalg.norm(x - np.asarray(centre), axis=1) < radius)


def vessel_sets(vessel: shapes.Vessel) -> Callable[[np.ndarray], dict[str, np.ndarray]]:
    """Node sets at the cut ends: the upper end of the trunk, and all others."""
    (top, top_radius), *others = vessel.ends()

    def sets(x: np.ndarray) -> dict[str, np.ndarray]:
        outlets = [near(centre, 1.4 * radius)(x) for centre, radius in others]
        return {
            "outlets": np.unique(np.concatenate(outlets)),
            "top": near(top, 1.4 * top_radius)(x),
        }

    return sets


def organs() -> dict[str, Organ]:
    """The paper's counts (its table of organs), and a small body for tests and documents."""
    aorta, vena_cava = shapes.aorta(), shapes.vena_cava()
    return {
        "aorta": Organ(aorta, 1597, 2316, 0.00442, sets=vessel_sets(aorta)),
        "kidney": Organ(
            shapes.kidney,
            2397,
            3202,
            0.0033,
            sets=lambda x: {"hilum": near(shapes.KIDNEY_HILUM, 0.016)(x)},
        ),
        "vena_cava": Organ(vena_cava, 2659, 3958, 0.0040, seed=5, sets=vessel_sets(vena_cava)),
        "small": Organ(
            shapes.small,
            300,
            400,
            0.0055,
            low=(-0.035, -0.022, -0.022),
            high=(0.035, 0.022, 0.018),
            sets=lambda x: {
                "left": np.flatnonzero(x[:, 0] < -0.022),
                "right": np.flatnonzero(x[:, 0] > 0.022),
            },
        ),
    }


def make(name: str, organ: Organ) -> None:
    """Place nodes, connect, improve, check and write one organ."""
    rng = np.random.default_rng(organ.seed)
    samples = nodes.sample(organ.shape, np.array(organ.low), np.array(organ.high), organ.edge / 6.0)
    surface_count = organ.triangle_count // 2 + 2  # a closed surface of genus 0
    surface = nodes.surface_nodes(samples, organ.shape, surface_count, rng)
    edge = nodes.mean_spacing(surface)
    inner_count = organ.node_count - surface_count
    inner = nodes.interior_nodes(
        samples, surface, inner_count, edge, organ.growth, np.random.default_rng(organ.seed)
    )
    x = np.concatenate([surface, inner])
    elements = tetrahedra.tetrahedralise(organ.shape, x, surface_count, edge)
    x, elements = improve(x, elements, surface_count, samples, seed=2)
    x = np.round(x, 6)  # micrometres: small files, and far below the element size
    report = check_solid(x, elements)
    write_seg(FOLDER / f"{name}.seg", title(name), x, elements, organ.sets(x))
    print(f"{name}: {report}", flush=True)


def title(name: str) -> str:
    """First line of the file."""
    return f"{name.replace('_', ' ')}, metres; made by make_models.py"


def main(names: list[str]) -> None:
    """Make the meshes that are named, or all."""
    everything = organs()
    for name in names or [*everything, "tray"]:
        if name == "tray":
            x, triangles = tray.bowl()
            check_surface(x, triangles)
            write_seg(FOLDER / "tray.seg", title(name), x, triangles, {})
            print(f"tray: {len(x)} nodes, {len(triangles)} triangles")
        else:
            make(name, everything[name])


if __name__ == "__main__":
    main(sys.argv[1:])
