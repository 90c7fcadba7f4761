"""Organ shapes as implicit functions: negative inside, about the distance in metres near the surface.

Body frame: x to the body's left, y to its back, z to its head; the origin lies in the mid-plane at
the height of the renal arteries. All lengths in metres.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import cKDTree

Points = np.ndarray
Shape = Callable[[Points], np.ndarray]


def smooth_union(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Polynomial smooth minimum; `blend` [m] is the width over which the two surfaces merge."""
    h = np.clip(0.5 + 0.5 * (b - a) / blend, 0.0, 1.0)
    return b + (a - b) * h - blend * h * (1.0 - h)


def smooth_intersection(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Polynomial smooth maximum."""
    return -smooth_union(-a, -b, blend)


class Tube:
    """A filled, bent, tapered vessel with blunt, rounded ends.

    `path` (n, 3) [m] is interpolated by a cubic spline, `radii` (n,) [m] along with it. An end whose
    flag in `cut` is set is cut square (rounded by `rim`), the other is a half ball, or buried in a
    parent vessel. `name` is that of the node set at the cut.
    """

    def __init__(
        self,
        name: str,
        path: Sequence[Sequence[float]],
        radii: Sequence[float],
        cut: tuple[bool, bool],
        rim: float = 0.005,
    ) -> None:
        self.name = name
        knots = np.asarray(path, dtype=float)
        steps = np.linalg.norm(np.diff(knots, axis=0), axis=1)
        parameter = np.concatenate([[0.0], np.cumsum(steps)])
        fine = np.linspace(0.0, parameter[-1], 400)
        self.centres = CubicSpline(parameter, knots, bc_type="natural")(fine)
        self.radii = CubicSpline(parameter, np.asarray(radii, dtype=float), bc_type="clamped")(fine)
        self.tree = cKDTree(self.centres)
        self.cut = cut
        self.rim = rim

    def __call__(self, x: Points) -> np.ndarray:
        # Beyond this box the tube is farther than any blend reaches: the box's distance will do.
        reach = 0.012 + float(self.radii.max())
        outside = np.maximum(self.centres.min(0) - reach - x, x - self.centres.max(0) - reach)
        value = 0.012 + np.linalg.norm(np.maximum(outside, 0.0), axis=1)
        near = (outside < 0.0).all(1)
        value[near] = self._distance(x[near])
        return value

    def _distance(self, x: Points) -> np.ndarray:
        _, nearest = self.tree.query(x)
        best = np.full(len(x), np.inf)
        for first in (np.maximum(nearest - 1, 0), np.minimum(nearest, len(self.centres) - 2)):
            a, b = self.centres[first], self.centres[first + 1]
            ab = b - a
            t = np.clip(((x - a) * ab).sum(1) / (ab * ab).sum(1), 0.0, 1.0)
            radius = self.radii[first] * (1 - t) + self.radii[first + 1] * t
            best = np.minimum(best, np.linalg.norm(x - a - t[:, None] * ab, axis=1) - radius)
        for flag, end, inner in ((self.cut[0], 0, 6), (self.cut[1], -1, -7)):
            if flag:
                axis = self.centres[end] - self.centres[inner]
                axis /= np.linalg.norm(axis)
                near = np.linalg.norm(x - self.centres[end], axis=1) < 3.0 * self.radii[end]
                plane = (x - self.centres[end]) @ axis
                best = np.where(near, smooth_intersection(best, plane, self.rim), best)
        return best


class Vessel:
    """Tubes merged smoothly into one body."""

    def __init__(self, tubes: Sequence[Tube], blend: float) -> None:
        self.tubes = tubes
        self.blend = blend

    def __call__(self, x: Points) -> np.ndarray:
        value = self.tubes[0](x)
        for tube in self.tubes[1:]:
            value = smooth_union(value, tube(x), self.blend)
        return value

    def ends(self, nodes: Points, depth: float) -> dict[str, np.ndarray]:
        """Nodes within `depth` [m] of each cut, by the tube's name."""
        found = {}
        for tube in self.tubes:
            for flag, end, inner in ((tube.cut[0], 0, 6), (tube.cut[1], -1, -7)):
                if flag:
                    axis = tube.centres[end] - tube.centres[inner]
                    axis /= np.linalg.norm(axis)
                    offset = nodes - tube.centres[end]
                    near = np.linalg.norm(offset, axis=1) < 1.6 * tube.radii[end] + depth
                    found[tube.name] = np.flatnonzero(near & (offset @ axis > -depth))
        return found


def ellipsoid(x: Points, centre: Sequence[float], half_axes: Sequence[float]) -> np.ndarray:
    """First-order distance to an ellipsoid with axes along x, y, z."""
    half = np.asarray(half_axes)
    p = (x - np.asarray(centre)) / half
    k0 = np.linalg.norm(p, axis=1)
    k1 = np.linalg.norm(p / half, axis=1)
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def aorta() -> Vessel:
    """Abdominal aorta with coeliac trunk, superior mesenteric, both renal and both iliac arteries."""
    trunk = Tube(
        "top",
        [
            (0.004, 0.012, 0.092),
            (0.007, 0.006, 0.062),
            (0.010, 0.001, 0.030),
            (0.011, -0.003, -0.005),
            (0.010, -0.004, -0.038),
            (0.007, -0.002, -0.064),
        ],
        [0.0104, 0.0100, 0.0094, 0.0088, 0.0084, 0.0078],
        (True, False),
    )
    coeliac = Tube(
        "coeliac",
        [(0.007, 0.005, 0.059), (0.007, -0.010, 0.058), (0.009, -0.022, 0.055)],
        [0.0050, 0.0048, 0.0046],
        (False, True),
    )
    mesenteric = Tube(
        "mesenteric",
        [
            (0.009, 0.002, 0.038),
            (0.009, -0.013, 0.032),
            (0.007, -0.0200, 0.016),
            (0.006, -0.0240, -0.004),
            (0.006, -0.0285, -0.022),
        ],
        [0.0052, 0.0050, 0.0047, 0.0045, 0.0045],
        (False, True),
    )
    renal_left = Tube(
        "renal_left",
        [
            (0.010, 0.000, 0.014),
            (0.026, 0.001, 0.012),
            (0.041, 0.007, 0.004),
            (0.053, 0.012, 0.000),
        ],
        [0.0050, 0.0047, 0.0046, 0.0047],
        (False, True),
    )
    renal_right = Tube(
        "renal_right",
        [
            (0.010, 0.000, 0.006),
            (-0.006, 0.003, 0.004),
            (-0.024, 0.010, -0.002),
            (-0.043, 0.014, -0.010),
        ],
        [0.0050, 0.0047, 0.0046, 0.0047],
        (False, True),
    )
    iliac_left = Tube(
        "iliac_left",
        [
            (0.008, -0.002, -0.061),
            (0.014, -0.002, -0.079),
            (0.027, 0.003, -0.098),
            (0.040, 0.004, -0.124),
        ],
        [0.0064, 0.0065, 0.0062, 0.0058],
        (False, True),
    )
    iliac_right = Tube(
        "iliac_right",
        [
            (0.006, -0.002, -0.061),
            (0.000, -0.003, -0.079),
            (-0.015, 0.001, -0.098),
            (-0.030, 0.001, -0.124),
        ],
        [0.0064, 0.0065, 0.0062, 0.0058],
        (False, True),
    )
    return Vessel(
        [trunk, coeliac, mesenteric, renal_left, renal_right, iliac_left, iliac_right], 0.006
    )


def vena_cava() -> Vessel:
    """Inferior vena cava with three hepatic, both renal and both iliac veins."""
    trunk = Tube(
        "top",
        [
            (-0.020, -0.022, 0.118),
            (-0.024, -0.016, 0.085),
            (-0.024, -0.009, 0.050),
            (-0.020, -0.007, 0.010),
            (-0.018, -0.003, -0.030),
            (-0.014, 0.008, -0.068),
        ],
        [0.0125, 0.0128, 0.0118, 0.0112, 0.0106, 0.0098],
        (True, False),
    )
    hepatic_right = Tube(
        "hepatic_right",
        [(-0.024, -0.017, 0.094), (-0.040, -0.015, 0.100), (-0.060, -0.012, 0.097)],
        [0.0062, 0.0058, 0.0052],
        (False, True),
    )
    hepatic_middle = Tube(
        "hepatic_middle",
        [(-0.022, -0.019, 0.100), (-0.026, -0.038, 0.105), (-0.036, -0.054, 0.102)],
        [0.0062, 0.0056, 0.0050],
        (False, True),
    )
    hepatic_left = Tube(
        "hepatic_left",
        [(-0.021, -0.020, 0.101), (-0.006, -0.033, 0.108), (0.012, -0.043, 0.107)],
        [0.0062, 0.0056, 0.0050],
        (False, True),
    )
    renal_left = Tube(
        "renal_left",
        [
            (-0.020, -0.007, 0.018),
            (-0.005, -0.017, 0.019),
            (0.014, -0.019, 0.022),
            (0.034, -0.010, 0.021),
            (0.052, -0.002, 0.017),
        ],
        [0.0064, 0.0058, 0.0054, 0.0056, 0.0060],
        (False, True),
    )
    renal_right = Tube(
        "renal_right",
        [(-0.020, -0.007, 0.014), (-0.036, -0.004, 0.010), (-0.051, 0.002, 0.003)],
        [0.0064, 0.0058, 0.0060],
        (False, True),
    )
    iliac_left = Tube(
        "iliac_left",
        [
            (-0.014, 0.007, -0.063),
            (-0.006, 0.014, -0.080),
            (0.012, 0.021, -0.096),
            (0.032, 0.022, -0.118),
        ],
        [0.0080, 0.0079, 0.0074, 0.0070],
        (False, True),
    )
    iliac_right = Tube(
        "iliac_right",
        [
            (-0.015, 0.007, -0.063),
            (-0.021, 0.014, -0.081),
            (-0.032, 0.020, -0.100),
            (-0.046, 0.020, -0.124),
        ],
        [0.0080, 0.0079, 0.0074, 0.0070],
        (False, True),
    )
    return Vessel(
        [
            trunk,
            hepatic_right,
            hepatic_middle,
            hepatic_left,
            renal_left,
            renal_right,
            iliac_left,
            iliac_right,
        ],
        0.007,
    )


class Kidney:
    """Left kidney: a thick, flattened arc whose poles bend inward, with the hilum on its inner side."""

    CENTRE = (0.084, 0.016, 0.010)
    FLATTENING = 1.28
    # The upper pole leans to the spine; the hilum looks a little forward.
    LEAN, TURN = np.radians(13.0), np.radians(-24.0)

    def __init__(self) -> None:
        w = np.linspace(-0.031, 0.030, 7)
        path = np.stack([-9.0 * w**2 + 0.004, np.zeros(7), w], axis=1)
        radii = [0.0215, 0.0238, 0.0252, 0.0258, 0.0260, 0.0252, 0.0236]
        self.body = Tube("", path.tolist(), radii, (False, False))

    def __call__(self, x: Points) -> np.ndarray:
        p = self.local(x)
        body = self.body(p * (1.0, self.FLATTENING, 1.0))
        sinus = ellipsoid(p, (-0.0225, 0.0, 0.0), (0.0125, 0.0075, 0.0135))
        return smooth_intersection(body, -sinus, 0.007)

    def local(self, x: Points) -> np.ndarray:
        """Axes of the kidney: outward, across its thickness, to the upper pole."""
        p = x - np.asarray(self.CENTRE)
        cos, sin = np.cos(self.LEAN), np.sin(self.LEAN)
        u, w = cos * p[:, 0] + sin * p[:, 2], -sin * p[:, 0] + cos * p[:, 2]
        cos, sin = np.cos(self.TURN), np.sin(self.TURN)
        return np.stack([cos * u + sin * p[:, 1], cos * p[:, 1] - sin * u, w], axis=1)


def small(x: Points) -> np.ndarray:
    """A rounded, slightly bent bean of 6 cm for tests and documents, centred on the origin."""
    bent = np.stack([x[:, 0], x[:, 1], x[:, 2] + 4.0 * x[:, 0] ** 2 - 0.0012], axis=1)
    return ellipsoid(bent, (0.0, 0.0, 0.0), (0.030, 0.018, 0.014))
