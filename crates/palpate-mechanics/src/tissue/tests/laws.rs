//! Each law by itself: derivatives, rest, objectivity, small strain, inverted elements.

use glam::{DMat3, DVec3};
use palpate_model::Material;
use proptest::prelude::*;

use super::super::dual;
use super::super::law::fibres::LARGEST_EXPONENT;
use super::super::law::{self, ElementLaw, Lame, Law, Name, with_law};
use super::super::real::Real;
use super::support::{
    DIRECTIONS, POISSON, YOUNG, dot, energy, law_named, laws, matrices, matrix, norm, rotations,
    rows, stress,
};

/// Change of the stress along `slope`, by dual numbers.
fn stress_slope(law: Law, f: DMat3, slope: DMat3) -> DMat3 {
    let f = dual::join(&rows(f), &rows(slope));
    let directions = DIRECTIONS.map(|d| d.map(|value| f[0][0].splat(value)));
    with_law!(law, law => matrix(&dual::split(&law.stress(&f, &directions)).1))
}

/// Change of the energy along `slope`, by dual numbers.
fn energy_slope(law: Law, f: DMat3, slope: DMat3) -> f64 {
    let f = dual::join(&rows(f), &rows(slope));
    let directions = DIRECTIONS.map(|d| d.map(|value| f[0][0].splat(value)));
    with_law!(law, law => law.energy(&f, &directions).slope)
}

/// Whether the slope of the stress jumps near `f`, so that no difference across it tells a derivative: where a
/// fibre goes slack, and where its exponential goes on straight.
fn near_jump(f: DMat3) -> bool {
    let square = dot(f, f) - 3.0;
    laws().into_iter().any(|law| {
        let Material { k2, kappa, .. } = law.material;
        DIRECTIONS[..law.families()].iter().any(|&d| {
            let fourth = (f * DVec3::from_array(d)).length_squared() - 1.0;
            let strain = kappa * square + (1.0 - 3.0 * kappa) * fourth;
            let straight = (LARGEST_EXPONENT / k2).sqrt();
            strain.abs() < 1e-3 || (strain - straight).abs() < 1e-3
        })
    })
}

/// The stress is the exact derivative of the energy, across its edges too.
fn check_stress_by_dual_numbers(f: DMat3, along: DMat3) -> Result<(), TestCaseError> {
    // Where stretches nearly cancel, the derivative of a rotation is a difference of large numbers.
    prop_assume!(f.determinant() > 0.05);
    for law in laws() {
        let (by_stress, by_energy) = (dot(stress(law, f), along), energy_slope(law, f, along));
        let scale = norm(stress(law, f)) * norm(along) + YOUNG;
        let error = (by_stress - by_energy).abs();
        prop_assert!(error <= 1e-10 * scale, "{law:?}: {by_stress} {by_energy}");
    }
    Ok(())
}

proptest! {
    #[test]
    fn stress_is_the_derivative_of_the_energy(f in matrices(1.2), along in matrices(1.0)) {
        let f = f + DMat3::IDENTITY;
        // A corotated element has an edge in its energy where two stretches cancel.
        prop_assume!(f.determinant() > 0.05 && norm(along) > 0.1 && !near_jump(f));
        let h = 1e-5 / norm(along);
        for law in laws() {
            let analytic = dot(stress(law, f), along);
            let numeric = (energy(law, f + h * along) - energy(law, f - h * along)) / (2.0 * h);
            let scale = norm(stress(law, f)) * norm(along) + 1e-3 * YOUNG;
            prop_assert!((analytic - numeric).abs() <= 1e-7 * scale, "{law:?}: {analytic} {numeric}");
        }
    }

    #[test]
    fn dual_numbers_give_the_stress(f in matrices(1.2), along in matrices(1.0)) {
        check_stress_by_dual_numbers(f + DMat3::IDENTITY, along)?;
    }

    #[test]
    fn dual_numbers_give_the_derivative_of_the_stress(f in matrices(0.8), along in matrices(1.0)) {
        let f = f + DMat3::IDENTITY;
        prop_assume!(f.determinant() > 0.1 && norm(along) > 0.1 && !near_jump(f));
        let h = 1e-6 / norm(along);
        for law in laws() {
            let analytic = stress_slope(law, f, along);
            let numeric = (stress(law, f + h * along) - stress(law, f - h * along)) * (0.5 / h);
            let scale = norm(analytic) + 1e-3 * norm(stress(law, f)) + YOUNG;
            let error = norm(analytic - numeric);
            prop_assert!(error <= 1e-7 * scale, "{law:?}: {error} of {scale}");
        }
    }

    #[test]
    fn rotations_cost_nothing(r in rotations()) {
        for law in laws() {
            prop_assert!(energy(law, r).abs() < 1e-11 * YOUNG, "{law:?}: {}", energy(law, r));
            prop_assert!(norm(stress(law, r)) < 1e-11 * YOUNG, "{law:?}: {}", stress(law, r));
        }
    }

    #[test]
    fn the_stress_turns_with_the_element(f in matrices(1.0), r in rotations()) {
        let f = f + DMat3::IDENTITY;
        prop_assume!(f.determinant() > 0.05);
        for law in laws() {
            let (turned, still) = (stress(law, r * f), r * stress(law, f));
            let scale = norm(still) + YOUNG;
            prop_assert!(norm(turned - still) < 1e-10 * scale, "{law:?}: {turned} {still}");
            // Cauchy's stress is symmetric: no torque.
            let torque = stress(law, f) * f.transpose();
            prop_assert!(norm(torque - torque.transpose()) < 1e-10 * scale * norm(f));
        }
    }

    #[test]
    fn small_strains_are_linear_elastic(change in matrices(1.0)) {
        let lame = Lame::new(YOUNG, POISSON);
        let strain = 0.5 * (change + change.transpose());
        let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
        let linear = 2.0 * lame.mu * strain + DMat3::from_diagonal(DVec3::splat(lame.lambda * trace));
        for law in laws() {
            // Without fibres, which are slack or not at rest.
            let mut law = law;
            law.material.k1 = 0.0;
            let slope = stress_slope(law, DMat3::IDENTITY, change);
            prop_assert!(norm(slope - linear) < 1e-10 * YOUNG, "{law:?}: {slope} {linear}");
        }
    }

    #[test]
    fn any_deformation_gives_finite_forces(
        f in matrices(3.0),
        zero in prop::array::uniform3(any::<bool>()),
        scale in prop::sample::select(vec![1e-200, 1e-8, 1.0, 30.0]),
    ) {
        let columns = [f.x_axis, f.y_axis, f.z_axis];
        let [a, b, c] = [0, 1, 2].map(|k| if zero[k] { DVec3::ZERO } else { scale * columns[k] });
        let f = DMat3::from_cols(a, b, c);
        for law in laws() {
            prop_assert!(energy(law, f).is_finite() && stress(law, f).is_finite(), "{law:?}: {f}");
            prop_assert!(energy(law, f) > -1e-9 * YOUNG, "{law:?}: {}", energy(law, f));
            prop_assert!(stress_slope(law, f, DMat3::from_diagonal(DVec3::X)).is_finite());
        }
    }

    #[test]
    fn inverted_elements_are_pushed_back(depth in -0.9..0.0_f64, r in rotations(), q in rotations()) {
        let f = r * DMat3::from_diagonal(DVec3::new(1.0, 1.0, depth)) * q.transpose();
        let deeper = r * DMat3::from_diagonal(DVec3::new(0.0, 0.0, 1.0)) * q.transpose();
        for law in [law_named(Name::NeoHookean), law_named(Name::Corotated)] {
            let push = -dot(stress(law, f), deeper);
            prop_assert!(push > 0.05 * YOUNG, "{law:?} at {depth}: {push}");
        }
    }
}

/// A fibre whose exponential goes on straight within a step of a difference.
#[test]
fn dual_numbers_give_the_stress_where_fibres_go_on_straight() {
    let f = DMat3::from_cols_array_2d(&[
        [1.439_302_363_266_762_6, 0.664_043_331_240_443_6, 0.854_732_106_246_684_3],
        [-0.788_474_010_591_111_6, 1.102_927_430_970_096_7, 0.895_449_810_755_761],
        [-0.819_859_241_951_045_5, 0.791_915_255_419_442_3, 1.299_573_352_105_936_5],
    ]);
    assert!(near_jump(f));
    let along =
        DMat3::from_diagonal(DVec3::new(-0.324_886_271_580_553_66, 0.0, 0.315_329_320_544_670_2));
    check_stress_by_dual_numbers(f, along).unwrap();
    let jump = [-1e-4, 1e-4].map(|step| stress(laws()[4], f + step * along));
    assert!(norm(jump[1] - jump[0]) < 1e-2 * norm(jump[0]), "{jump:?}");
}

#[test]
fn fibres_stay_finite_when_they_are_torn_apart() {
    for law in laws() {
        let f = DMat3::from_diagonal(DVec3::splat(40.0));
        assert!(stress(law, f).is_finite() && energy(law, f).is_finite(), "{law:?}");
    }
}
