"""Stiffness matrices beside those of scikit-fem, an independent finite element library."""

import numpy as np
import pytest
from skfem import Basis, ElementTetP1, ElementVector, MeshTet
from skfem.models.elasticity import lame_parameters, linear_elasticity

import palpate
from palpate.bench.verification import laws, shapes

YOUNG = 5e3


def mesh():
    return shapes.box((2, 2, 2), (0.1, 0.1, 0.1), lambda x: 0.1 * shapes.bumps(0.1)(x / 0.1))


def by_scikit_fem(body_mesh, parts):
    """Dense stiffness [N/m]; ``parts`` are (tetrahedra, Poisson's ratio)."""
    found = MeshTet(body_mesh.nodes.T, body_mesh.tetrahedra.T.astype(np.int64))
    total = 0.0
    for tetrahedra, poisson in parts:
        basis = Basis(found, ElementVector(ElementTetP1()), elements=tetrahedra)
        total = total + linear_elasticity(*lame_parameters(YOUNG, poisson)).assemble(basis)
    # Its unknowns are numbered node by node, as ours.
    return total.toarray()


def by_palpate(body):
    """The same from forces: a step so short that a displaced body's velocities are its forces."""
    time_step, small = 1e-7, 1e-7
    simulation = palpate.Simulation(palpate.Model([body], gravity=(0, 0, 0)), time_step=time_step)
    rest, still = body.mesh.nodes, np.zeros_like(body.mesh.nodes)
    weights = shapes.masses(body.mesh, body.material.density)[:, None]
    columns = []
    for unknown in range(rest.size):
        forces = []
        for sign in (1, -1):
            moved = rest.copy()
            moved.flat[unknown] += sign * small
            simulation.set_positions(0, moved)
            simulation.set_velocities(0, still)
            simulation.step()
            forces.append(simulation.velocities[0] * weights / time_step)
        columns.append((forces[1] - forces[0]).ravel() / (2 * small))
    return np.array(columns).T


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.44])
@pytest.mark.parametrize("law", ["linear", *laws.ISOTROPIC])
def test_the_stiffness_at_rest_is_that_of_scikit_fem(law, poisson):
    material = palpate.Material(law=law, young=YOUNG, poisson=poisson, damping=0.0)
    body = palpate.Body(mesh(), material=material)
    exact = by_scikit_fem(body.mesh, [(np.arange(len(body.mesh.tetrahedra)), poisson)])
    found = by_palpate(body)
    assert np.abs(found - exact).max() < 1e-6 * np.abs(exact).max()
    assert np.abs(found - found.T).max() < 1e-6 * np.abs(exact).max()


@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
def test_two_regions_are_two_materials(law):
    plain = mesh()
    regions = (np.arange(len(plain.tetrahedra)) % 3 == 0).astype(int)
    soft = palpate.Material(law=law, young=YOUNG, poisson=0.2, damping=0.0)
    stiff = palpate.Material(law=law, young=YOUNG, poisson=0.4, damping=0.0)
    divided = palpate.Mesh(plain.nodes, plain.tetrahedra, regions=regions)
    body = palpate.Body(divided, material=soft, regions={1: stiff})
    parts = [(np.flatnonzero(regions == region), nu) for region, nu in ((0, 0.2), (1, 0.4))]
    exact = by_scikit_fem(divided, parts)
    assert np.abs(by_palpate(body) - exact).max() < 1e-6 * np.abs(exact).max()
