"""Stresses of the laws in closed form, written from their energies and from nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate._arrays import Float64Array
from palpate.model import Material

#: Laws of isotropic tissue that know large deformation.
ISOTROPIC = ("corotated", "stvk", "neo-hookean", "mooney-rivlin")


def lame(material: Material) -> tuple[float, float]:
    """Lamé's parameters mu and lambda [Pa]."""
    e, nu = material.young, material.poisson
    return e / (2 * (1 + nu)), e * nu / ((1 + nu) * (1 - 2 * nu))


def _rotation(f: Float64Array) -> Float64Array:
    u, _, v = np.linalg.svd(f)
    u[..., 2] *= np.linalg.det(u @ v)[..., None]
    return np.asarray(u @ v)


def _cofactor(f: Float64Array) -> Float64Array:
    return np.asarray(np.linalg.det(f)[..., None, None] * np.linalg.inv(f).swapaxes(-1, -2))


def stress(material: Material, f: Float64Array) -> Float64Array:
    """First Piola-Kirchhoff stress [Pa] at deformation gradients, both of shape (..., 3, 3)."""
    mu, lam = lame(material)
    identity = np.eye(3)

    def trace(a: Float64Array) -> Float64Array:
        return np.asarray(np.trace(a, axis1=-2, axis2=-1)[..., None, None])

    transposed = f.swapaxes(-1, -2)
    if material.law == "linear":
        strain = 0.5 * (f + transposed) - identity
        return np.asarray(2 * mu * strain + lam * trace(strain) * identity)
    if material.law == "corotated":
        r = _rotation(f)
        stretch = r.swapaxes(-1, -2) @ f
        return np.asarray(2 * mu * (f - r) + lam * trace(stretch - identity) * r)
    if material.law == "stvk":
        strain = 0.5 * (transposed @ f - identity)
        return np.asarray(f @ (2 * mu * strain + lam * trace(strain) * identity))
    first, volume = trace(transposed @ f), np.linalg.det(f)[..., None, None]
    if material.law == "neo-hookean":
        m, bulk = 4 * mu / 3, lam + 5 * mu / 6
        pressure = bulk * (volume - 1) - 0.75 * m
        return np.asarray(m * (1 - 1 / (first + 1)) * f + pressure * _cofactor(f))
    if material.law == "hgo" and material.fibre is not None:
        a = np.array(material.fibre) / np.linalg.norm(material.fibre)
        along = f @ a
        fourth = (along**2).sum(axis=-1)[..., None, None]
        kappa = material.kappa
        strain = np.maximum(kappa * (first - 3) + (1 - 3 * kappa) * (fourth - 1), 0.0)
        slope = material.k1 * strain * np.exp(material.k2 * strain**2)
        outer = along[..., :, None] * a
        fibres = slope * 2 * (kappa * f + (1 - 3 * kappa) * outer)
        return np.asarray(stress(replace(material, law="neo-hookean"), f) + fibres)
    if material.law == "mooney-rivlin":
        c01 = 0.5 * mu * material.mooney
        c10 = 0.5 * mu - c01
        pressure = (lam + 2 * c10) * (volume - 1) - 2 * c10 - 4 * c01
        second = first * f - f @ transposed @ f
        return np.asarray(2 * c10 * f + 2 * c01 * second + pressure * _cofactor(f))
    raise ValueError(f"law: no closed form of {material.law!r} here")


def uniaxial(material: Material, stretch: float) -> tuple[float, float]:
    """Lateral stretch and nominal stress [Pa] of a bar that is pulled to ``stretch``."""
    low, high = 0.2, 3.0
    for _ in range(100):
        lateral = 0.5 * (low + high)
        p = stress(material, np.diag([stretch, lateral, lateral]))
        low, high = (low, lateral) if p[1, 1] > 0 else (lateral, high)
    return lateral, float(p[0, 0])


def elastic_energy(material: Material, f: Float64Array) -> float:
    """Energy density [J/m³] at a deformation gradient: the stress's work on a straight way."""
    points, weights = np.polynomial.legendre.leggauss(40)
    way = f - np.eye(3)
    along = np.eye(3) + 0.5 * (points + 1)[:, None, None] * way
    return float(0.5 * weights @ (stress(material, along) * way).sum(axis=(1, 2)))
