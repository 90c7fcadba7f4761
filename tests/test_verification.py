"""The mechanics beside exact solutions, as a user could check them; docs/verification.md has more.

What needs the inside of the core is checked there: Cook's membrane, the laws' stress in principal
stretches, tangents and stiffness (crates/palpate-mechanics/src/tissue/tests), impact, stacks and
free motion (crates/palpate-mechanics/tests).
"""

import numpy as np
import pytest

import palpate
from palpate.bench.verification import (
    elasticity,
    laws,
    motion,
    organs,
    responses,
    shapes,
    soak,
    touching,
)

ALL = ("linear", *laws.ISOTROPIC, "hgo")


def tissue(law, poisson=0.3, damping=0.0):
    fibre = (1.0, 2.0, 2.0) if law == "hgo" else None
    return palpate.Material(law=law, poisson=poisson, damping=damping, fibre=fibre, kappa=0.1)


@pytest.mark.parametrize("poisson", [0.3, 0.49])
@pytest.mark.parametrize("law", ALL)
def test_patches_are_exact(law, poisson):
    mesh = shapes.box((4, 4, 4), (1.0, 1.0, 1.0), shapes.bumps(0.06))
    assert elasticity.patch(mesh, tissue(law, poisson)) < 1e-10


def test_a_patch_of_an_organ_is_exact():
    assert elasticity.patch(organs.kidney(), tissue("neo-hookean")) < 1e-10


@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
def test_errors_fall_with_the_square_of_the_cell(law):
    result = elasticity.convergence(tissue(law), (4, 8))
    assert result.rate > 1.9
    assert result.errors[-1] < 0.012


def test_a_cantilever_sags_as_timoshenko_says():
    result = elasticity.cantilever((4, 8))
    assert result.ratios[0] < result.ratios[1] < 1
    assert result.limit == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("axis", [1, 2])
def test_a_twisted_beam_bends_as_macneal_and_harder_say(axis):
    result = elasticity.twisted_beam((3, 6), axis)
    assert result.ratios[0] < result.ratios[1] < 1
    assert result.limit == pytest.approx(1.0, abs=0.03)


def test_a_hanging_bar_stretches():
    assert elasticity.bar(16) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("law", ["corotated", "neo-hookean"])
def test_a_bent_beam_is_an_elastica(law):
    result = elasticity.bent_beam(law, 3.0, (3, 5))
    assert result.sag.ratios[0] < result.sag.ratios[1] < 1
    assert result.sag.limit == pytest.approx(1.0, abs=0.05)
    # A mesh that is too stiff still bends into the shape of a smaller load.
    assert result.shape_errors[-1] < 0.02


@pytest.mark.parametrize("law", [law for law in ALL if law != "linear"])
def test_stress_is_the_closed_form(law):
    material = tissue(law, 0.4)
    if law != "hgo":
        assert responses.uniaxial(material, [0.7, 0.9, 1.2, 1.7]).error < 1e-8
    assert responses.simple_shear(material, [-1.0, -0.2, 0.5, 1.5]).error < 1e-8
    f = np.array([[1.2, 0.1, -0.1], [0.1, 0.85, 0.2], [0.0, 0.1, 1.1]])
    assert responses.unbalanced(material, f) < 1e-10


@pytest.mark.parametrize("law", ALL)
def test_nothing_depends_on_the_direction(law):
    rotation = responses.turned([1, 2, 3], 2.5)
    found = responses.rotation_invariance(tissue(law, 0.4, 0.01), rotation)
    # Forces are read through a factor in single precision.
    assert found.energy < 5e-8
    assert found.positions < 1e-9


def test_a_sphere_indents_as_hertz_says():
    (result,) = touching.hertz(4, [1e-3])
    assert result.radius == pytest.approx(result.exact_radius, rel=0.05)
    assert result.depth == pytest.approx(result.exact_depth, rel=0.05)
    assert result.pressures.max() == pytest.approx(result.exact_pressure, rel=0.05)


@pytest.mark.parametrize("friction", [0.2, 0.5])
def test_a_block_slides_from_the_friction_angle_on(friction):
    assert touching.friction_angle(friction) == pytest.approx(1.0, abs=0.01)
    below = touching.incline(0.99 * friction, friction)
    assert abs(below.acceleration) < 1e-5
    for factor in (1.01, 1.5):
        above = touching.incline(factor * friction, friction)
        assert above.acceleration == pytest.approx(above.exact, rel=0.01)


@pytest.mark.parametrize("law", ["linear", "corotated", "neo-hookean"])
def test_momenta_are_kept_and_energy_never_grows_over_many_steps(law):
    drift = motion.collision(law, steps=10_000, every=20)
    assert drift.linear.max() < 1e-12
    assert drift.angular.max() < 1e-9
    assert drift.largest_gain < 1e-6
    assert 0.5 < drift.energy[-1] < 0.8


@pytest.mark.parametrize("law", ["linear", "corotated", "neo-hookean"])
def test_walls_give_no_energy(law):
    drift = motion.prison(law, 600)
    assert drift.largest_gain < 1e-7
    assert drift.energy[-1] < 0.01


@pytest.mark.parametrize(("lower", "upper"), [(3, 4), (5, 8)])
def test_uniform_pressure_passes_through_meshes_that_do_not_match(lower, upper):
    result = touching.contact_patch(lower, upper)
    assert result.typical_error < 0.03
    # What the contact gets wrong stays near it.
    cell = 0.1 / min(lower, upper)
    far = np.abs(result.heights - 0.1) > 2 * cell
    assert np.abs(result.stress[far] / -result.pressure - 1.0).max() < 0.02


@pytest.mark.parametrize("law", ["linear", "corotated", "neo-hookean"])
def test_a_squeezed_organ_comes_back(law):
    material = palpate.Material(law=law, young=8e3, density=1050.0, damping=0.02)
    result = organs.squeeze(organs.kidney(), material, 0.3, rest=0.6)
    assert result.gaps.min() == pytest.approx(0.3)
    assert result.misfits.max() > 0.1
    assert result.beyond.max() < 1e-3
    assert result.inverted[-1] == 0
    assert result.misfits[-1] < 0.005
    assert result.intersections == 0


def test_a_soak_ends_after_its_steps_and_says_how_far_it_is(capsys):
    hands = soak.Soak(7, steps=30)
    hands.round()
    assert hands.is_over
    assert hands.steps >= 30
    assert hands.faults == []
    assert "MB in use" in capsys.readouterr().out


def test_a_soak_tells_what_stays_not_what_passes(monkeypatch):
    monkeypatch.setattr(soak, "LASTING", 40)
    stays, passes = soak.Lasting(), soak.Lasting()
    told = [step for step in range(0, 200, 20) if stays.look(step, {"a", step})]
    assert told == [40]
    assert not any(passes.look(step, {step, step - 20}) for step in range(0, 200, 20))


def test_a_soak_tells_of_bodies_that_are_thrown(monkeypatch):
    monkeypatch.setattr(soak, "TOO_FAST", 0.0)
    hands = soak.Soak(7, steps=1)
    hands.round()
    assert "m/s" in hands.faults[0]
