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
    flag in `cut` is set is cut square (rounded by `rim`), the other is buried in a parent vessel.
    """

    def __init__(
        self,
        path: Sequence[Sequence[float]],
        radii: Sequence[float],
        cut: tuple[bool, bool],
        rim: float = 0.005,
    ) -> None:
        knots = np.asarray(path, dtype=float)
        steps = np.linalg.norm(np.diff(knots, axis=0), axis=1)
        parameter = np.concatenate([[0.0], np.cumsum(steps)])
        fine = np.linspace(0.0, parameter[-1], 400)
        self.centres = CubicSpline(parameter, knots, bc_type="natural")(fine)
        self.radii = CubicSpline(parameter, np.asarray(radii, dtype=float), bc_type="natural")(fine)
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

    def ends(self) -> list[tuple[Points, float]]:
        """Centre and radius of every cut end, tube by tube, first end before last."""
        return [
            (tube.centres[end], float(tube.radii[end]))
            for tube in self.tubes
            for flag, end in zip(tube.cut, (0, -1), strict=True)
            if flag
        ]


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
        [(0.007, 0.005, 0.059), (0.007, -0.010, 0.058), (0.009, -0.022, 0.055)],
        [0.0050, 0.0048, 0.0046],
        (False, True),
    )
    mesenteric = Tube(
        [
            (0.009, 0.003, 0.036),
            (0.009, -0.015, 0.030),
            (0.007, -0.024, 0.014),
            (0.005, -0.029, -0.010),
        ],
        [0.0052, 0.0050, 0.0047, 0.0045],
        (False, True),
    )
    renal_left = Tube(
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
        [
            (0.008, -0.002, -0.055),
            (0.014, -0.002, -0.077),
            (0.027, 0.003, -0.098),
            (0.040, 0.004, -0.124),
        ],
        [0.0072, 0.0068, 0.0062, 0.0058],
        (False, True),
    )
    iliac_right = Tube(
        [
            (0.008, -0.002, -0.055),
            (0.000, -0.003, -0.077),
            (-0.015, 0.001, -0.098),
            (-0.030, 0.001, -0.124),
        ],
        [0.0072, 0.0068, 0.0062, 0.0058],
        (False, True),
    )
    return Vessel(
        [trunk, coeliac, mesenteric, renal_left, renal_right, iliac_left, iliac_right], 0.006
    )


def vena_cava() -> Vessel:
    """Inferior vena cava with three hepatic, both renal and both iliac veins."""
    trunk = Tube(
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
        [(-0.024, -0.017, 0.094), (-0.040, -0.015, 0.100), (-0.060, -0.012, 0.097)],
        [0.0062, 0.0058, 0.0052],
        (False, True),
    )
    hepatic_middle = Tube(
        [(-0.022, -0.019, 0.100), (-0.026, -0.038, 0.105), (-0.036, -0.054, 0.102)],
        [0.0062, 0.0056, 0.0050],
        (False, True),
    )
    hepatic_left = Tube(
        [(-0.021, -0.020, 0.101), (-0.006, -0.033, 0.108), (0.012, -0.043, 0.107)],
        [0.0062, 0.0056, 0.0050],
        (False, True),
    )
    renal_left = Tube(
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
        [(-0.020, -0.007, 0.014), (-0.036, -0.004, 0.010), (-0.051, 0.002, 0.003)],
        [0.0064, 0.0058, 0.0060],
        (False, True),
    )
    iliac_left = Tube(
        [
            (-0.015, 0.006, -0.056),
            (-0.006, 0.014, -0.078),
            (0.012, 0.021, -0.096),
            (0.032, 0.022, -0.118),
        ],
        [0.0090, 0.0082, 0.0074, 0.0070],
        (False, True),
    )
    iliac_right = Tube(
        [
            (-0.015, 0.006, -0.056),
            (-0.021, 0.014, -0.080),
            (-0.032, 0.020, -0.100),
            (-0.046, 0.020, -0.124),
        ],
        [0.0090, 0.0082, 0.0074, 0.0070],
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


KIDNEY_CENTRE = (0.082, 0.016, 0.010)
KIDNEY_HILUM = (0.059, 0.010, 0.008)


def kidney(x: Points) -> np.ndarray:
    """Left kidney: a bent ellipsoid, upper pole leaning to the spine, with the hilum on its inner side."""
    p = x - np.asarray(KIDNEY_CENTRE)
    tilt_z, tilt_y = np.radians(14.0), np.radians(-25.0)
    # The long axis leans inward above, and the inner side looks a little forward.
    u = np.cos(tilt_z) * p[:, 0] + np.sin(tilt_z) * p[:, 2]
    w = -np.sin(tilt_z) * p[:, 0] + np.cos(tilt_z) * p[:, 2]
    v = -np.sin(tilt_y) * u + np.cos(tilt_y) * p[:, 1]
    u = np.cos(tilt_y) * u + np.sin(tilt_y) * p[:, 1]
    bent = np.stack([u + 5.2 * w * w - 0.003, v, w], axis=1)
    # The upper pole is broader than the lower one.
    widen = 1.0 + 1.3 * w
    bent[:, :2] /= widen[:, None]
    body = ellipsoid(bent, (0.0, 0.0, 0.0), (0.0275, 0.0205, 0.0555))
    sinus = ellipsoid(np.stack([u, v, w], axis=1), (-0.029, 0.0, 0.0), (0.0155, 0.0075, 0.0165))
    return smooth_intersection(body, -sinus, 0.009)


def small(x: Points) -> np.ndarray:
    """A rounded, slightly bent bean of 6 cm for tests and documents, centred on the origin."""
    bent = np.stack([x[:, 0], x[:, 1], x[:, 2] + 4.0 * x[:, 0] ** 2 - 0.0012], axis=1)
    return ellipsoid(bent, (0.0, 0.0, 0.0), (0.030, 0.018, 0.014))
