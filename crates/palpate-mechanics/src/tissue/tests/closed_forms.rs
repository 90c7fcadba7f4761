//! Uniaxial, equibiaxial and shear response of each law against formulas in the principal stretches.

use glam::{DMat3, DVec3};
use palpate_model::Material;

use super::super::law::{Lame, Law, Name};
use super::support::{
    DIRECTIONS, YOUNG, law_named, laws, material, mooney_factors, rotations, stress, stress_along,
};
use proptest::prelude::*;

/// Principal first Piola-Kirchhoff stresses at principal stretches, without fibres.
fn principal_stress(law: Law, s: DVec3) -> DVec3 {
    let Lame { mu, lambda } = law.lame();
    let volume = s.x * s.y * s.z;
    let (inverse, squares) = (s.recip(), s * s);
    let sum = squares.element_sum();
    match law.material.law {
        Name::Corotated => 2.0 * mu * (s - 1.0) + lambda * (s.element_sum() - 3.0),
        Name::SaintVenantKirchhoff => {
            let strain = 0.5 * (squares - 1.0);
            s * (lambda * strain.element_sum() + 2.0 * mu * strain)
        }
        Name::NeoHookean | Name::HolzapfelGasserOgden => {
            let (m, l) = (4.0 * mu / 3.0, lambda + 5.0 * mu / 6.0);
            m * s * (1.0 - 1.0 / (sum + 1.0)) + (l * (volume - 1.0) - 0.75 * m) * volume * inverse
        }
        Name::MooneyRivlin => {
            let [c10, c01] = mooney_factors(law);
            let rest = 2.0 * c10 + 4.0 * c01;
            let pressure = (lambda + 2.0 * c10) * (volume - 1.0) - rest;
            2.0 * c10 * s + 2.0 * c01 * s * (sum - squares) + pressure * volume * inverse
        }
        other => panic!("{other}"),
    }
}

/// The lateral stretch without lateral stress, by bisection; `stretches` makes three of it.
fn free_stretch(law: Law, stretches: impl Fn(f64) -> DVec3, axis: usize) -> f64 {
    let (mut low, mut high) = (0.2, 3.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if principal_stress(law, stretches(middle))[axis] > 0.0 {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}

fn isotropic_laws() -> impl Iterator<Item = Law> {
    laws().into_iter().filter(|law| law.families() == 0)
}

fn check(law: Law, turn: DMat3, s: DVec3, exact: DVec3) {
    let f = turn * DMat3::from_diagonal(s) * turn.transpose();
    let found = turn.transpose() * stress(law, f) * turn;
    let exact = DMat3::from_diagonal(exact);
    let error = (found - exact).to_cols_array().into_iter().fold(0.0, |a: f64, b| a.max(b.abs()));
    assert!(error < 1e-10 * YOUNG, "{law:?} at {s}: {found} instead of {exact}");
}

proptest! {
    #[test]
    fn uniaxial(stretch in 0.7..1.8_f64, turn in rotations()) {
        for law in isotropic_laws() {
            let with = |lateral| DVec3::new(stretch, lateral, lateral);
            let s = with(free_stretch(law, with, 1));
            let exact = principal_stress(law, s);
            prop_assert!(exact.y.abs() < 1e-9 * YOUNG && exact.z.abs() < 1e-9 * YOUNG);
            prop_assert!((exact.x > 0.0) == (stretch > 1.0));
            check(law, turn, s, DVec3::new(exact.x, 0.0, 0.0) + exact * DVec3::new(0.0, 1.0, 1.0));
        }
    }

    #[test]
    fn equibiaxial(stretch in 0.8..1.3_f64, turn in rotations()) {
        for law in isotropic_laws() {
            let with = |thickness| DVec3::new(stretch, stretch, thickness);
            let s = with(free_stretch(law, with, 2));
            let exact = principal_stress(law, s);
            prop_assert!(exact.z.abs() < 1e-9 * YOUNG && (exact.x > 0.0) == (stretch > 1.0));
            check(law, turn, s, exact);
        }
    }

    #[test]
    fn any_principal_stretches(s in prop::array::uniform3(0.4..2.0_f64), turn in rotations()) {
        for law in isotropic_laws() {
            let s = DVec3::from_array(s);
            check(law, turn, s, principal_stress(law, s));
        }
    }

    #[test]
    fn simple_shear(shear in -1.5..1.5_f64) {
        let f = DMat3::from_cols(DVec3::X, DVec3::new(shear, 1.0, 0.0), DVec3::Z);
        for law in isotropic_laws() {
            let Lame { mu, lambda } = law.lame();
            let exact = match law.material.law {
                Name::MooneyRivlin => mu * shear,
                Name::SaintVenantKirchhoff => {
                    mu * shear + shear.powi(3) * (0.5 * lambda + mu)
                }
                Name::Corotated => {
                    // In the plane the rotation is by -atan(shear / 2).
                    let length = (4.0 + shear * shear).sqrt();
                    let s = shear / length;
                    let pressure = lambda * (length - 2.0);
                    2.0 * mu * (shear - s) + pressure * s
                }
                _ => 4.0 / 3.0 * mu * (1.0 - 1.0 / (4.0 + shear * shear)) * shear,
            };
            // The volume stays, so Cauchy's stress is P Fᵀ.
            let cauchy = stress(law, f) * f.transpose();
            let found = cauchy.y_axis.x;
            prop_assert!((found - exact).abs() < 1e-10 * YOUNG, "{law:?}: {found} {exact}");
        }
    }

    #[test]
    fn fibres_stiffen_along_and_not_across(stretch in 1.0..1.4_f64, kappa in 0.0..0.33_f64) {
        let fibres =
            Material { k1: 700.0, k2: 3.0, kappa, ..material(Name::HolzapfelGasserOgden) };
        let law = Law::new(&fibres, 1);
        for axis in 0..3 {
            let mut s = DVec3::ONE;
            s[axis] = stretch;
            let mut directions = DIRECTIONS;
            directions[0] = [1.0, 0.0, 0.0];
            let found = stress_along(law, DMat3::from_diagonal(s), &directions);
            let strain = (if axis == 0 { 1.0 - 2.0 * kappa } else { kappa }) * (stretch * stretch - 1.0);
            let slope = 2.0 * fibres.k1 * strain * (fibres.k2 * strain * strain).exp();
            let fibre = DVec3::new(1.0 - 2.0 * kappa, kappa, kappa) * slope * s;
            let exact = principal_stress(law, s) + fibre;
            for k in 0..3 {
                let (found, exact) = (found.col(k)[k], exact[k]);
                prop_assert!((found - exact).abs() < 1e-10 * YOUNG, "axis {axis}, {k}: {found} {exact}");
            }
        }
        // Pressed together, parallel fibres do nothing.
        let short = DMat3::from_diagonal(DVec3::new(1.0 / stretch, 1.0, 1.0));
        let parallel = Law::new(&Material { kappa: 0.0, ..fibres }, 1);
        let mut directions = DIRECTIONS;
        directions[0] = [1.0, 0.0, 0.0];
        prop_assert_eq!(
            stress_along(parallel, short, &directions),
            stress(law_named(Name::NeoHookean), short)
        );
    }
}
