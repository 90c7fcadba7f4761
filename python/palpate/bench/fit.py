"""The paper's cost model, T = traversal + polygon tests + update, fitted to measured times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from palpate._arrays import Float64Array


@dataclass(frozen=True)
class Fit:
    """``seconds = factor * term + constant``, neither negative.

    ``r_squared`` is the part of the variance explained; ``error`` the median relative deviation.
    """

    stage: str
    term: str
    factor: float
    constant: float
    r_squared: float
    error: float

    def at(self, terms: npt.ArrayLike) -> Float64Array:
        """The fitted time [s] for values of the term."""
        return np.asarray(self.factor * np.asarray(terms) + self.constant)


def fit_line(stage: str, term: str, terms: npt.ArrayLike, seconds: npt.ArrayLike) -> Fit:
    """A factor and a constant with the least squared relative deviations.

    Relative, because times span decades: otherwise the largest alone would decide.
    """
    x, y = np.asarray(terms, dtype=np.float64), np.asarray(seconds, dtype=np.float64)
    if len(x) < 3 or np.ptp(x) == 0:
        raise ValueError(f"{stage}: a fit needs at least three leaf sizes with different trees")
    scale = float(np.abs(x).max())
    columns = np.stack([x / scale / y, 1 / y], axis=1)
    # Not negative: the best of both together, each alone, and neither.
    choices = [np.linalg.lstsq(columns, np.ones(len(y)), rcond=None)[0]]
    for column in range(2):
        alone = np.zeros(2)
        alone[column] = columns[:, column].sum() / np.sum(columns[:, column] ** 2)
        choices.append(alone)
    allowed = [choice for choice in choices if (choice >= 0).all()]
    factor, constant = min(allowed, key=lambda each: float(np.sum((columns @ each - 1) ** 2)))
    factor /= scale
    residual = y - (factor * x + constant)
    variance = float(np.sum((y - y.mean()) ** 2))
    r_squared = 1 - float(np.sum(residual**2)) / variance if variance else 1.0
    error = float(np.median(np.abs(residual) / y))
    return Fit(stage, term, float(factor), float(constant), r_squared, error)


#: Terms of the cost model over P tree nodes and N surface triangles. The polygon tests stand twice:
#: the paper's term is the cost of one pair of leaves; the number of such pairs grows with P.
TERMS: dict[tuple[str, str], Callable[[Float64Array, float], Float64Array]] = {
    ("update", "P"): lambda p, _n: p,
    ("traversal", "P log2 P"): lambda p, _n: np.asarray(p * np.log2(p)),
    ("polygons", "(N/P)²"): lambda p, n: np.asarray((n / p) ** 2),
    ("polygons", "P (N/P)²"): lambda p, n: np.asarray(p * (n / p) ** 2),
}


def fit_cost_model(
    nodes: npt.ArrayLike, triangles: int, seconds: dict[str, npt.ArrayLike]
) -> list[Fit]:
    """Every term fitted to the stage's times over the node counts P; ``triangles`` is N."""
    p = np.asarray(nodes, dtype=np.float64)
    return [
        fit_line(stage, term, of(p, triangles), seconds[stage])
        for (stage, term), of in TERMS.items()
    ]
