//! From a body's materials to its tissue laws.

use glam::DVec3;
use palpate_geometry::Point;
use palpate_model::{Body, FIBRE_FAMILIES, Law as LawName, Material};

use crate::error::MechanicsError;
use crate::tissue::law::{Law, MAX_FAMILIES};
use crate::tissue::{Tissue, TissueInput, VolumeAveraging};

const _: () = assert!(MAX_FAMILIES == FIBRE_FAMILIES, "the mesh holds what the laws read");

/// Refuses a body that is linear in some regions and not in others: the linear law turns with the
/// whole body, the others with each element.
pub(crate) fn check_laws(index: usize, body: &Body) -> Result<(), MechanicsError> {
    let linear = |material: &Material| material.law == LawName::Linear;
    let first = linear(&body.material);
    match body.materials().find(|material| linear(material) != first) {
        Some(other) => Err(MechanicsError::MixedLaws {
            body: index,
            name: body.name.clone(),
            laws: [body.material.law, other.law],
        }),
        None => Ok(()),
    }
}

/// The tissue of a body at rest; none of its laws may be linear.
///
/// # Panics
/// If a law is linear, or as [`Tissue::new`].
pub(crate) fn tissue_of(body: &Body, averaging: VolumeAveraging) -> Tissue {
    let materials: Vec<&Material> =
        std::iter::once(&body.material).chain(body.regions.iter().map(|(_, m)| m)).collect();
    // Each material twice: where it has one family of fibres or none, and where it has two.
    let laws: Vec<Law> = materials
        .iter()
        .flat_map(|material| [1, 2].map(|families| (material, families)))
        .map(|(material, families)| Law::new(material, families))
        .collect();
    let (mut regions, mut fibres) = (Vec::new(), Vec::new());
    let any_fibres = materials.iter().any(|material| material.law == LawName::HolzapfelGasserOgden);
    for tetrahedron in 0..body.mesh.tetrahedra().len() {
        let region = body.mesh.regions().get(tetrahedron).copied();
        let own = region.and_then(|region| {
            body.regions.binary_search_by_key(&region, |(number, _)| *number).ok()
        });
        let place = own.map_or(0, |own| own + 1);
        let directions = directions(body, materials[place], tetrahedron);
        let second = usize::from(directions[1] != [0.0; 3]);
        regions.push((2 * place + second) as u32);
        if any_fibres {
            fibres.push(directions);
        }
    }
    Tissue::new(&TissueInput {
        rest: body.mesh.nodes(),
        tetrahedra: body.mesh.tetrahedra(),
        laws: &laws,
        regions: &regions,
        fibres: &fibres,
        viscosity: body.material.damping,
        averaging,
    })
}

/// Unit directions of the fibres of a tetrahedron, zero where there is none.
fn directions(body: &Body, material: &Material, tetrahedron: usize) -> [Point; MAX_FAMILIES] {
    [0, 1].map(|family| {
        let of_mesh = || body.mesh.fibres()[family].get(tetrahedron).copied();
        let fibre = material.fibres[family].or_else(of_mesh).unwrap_or_default();
        // The largest component goes first: tiny and huge directions are directions too.
        let fibre = DVec3::from_array(fibre);
        (fibre / fibre.abs().max_element()).normalize_or_zero().to_array()
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use palpate_model::{Mesh, MeshData};

    use super::*;

    /// Two tetrahedra on a common face, in regions 3 and 5.
    fn body() -> Body {
        let data = MeshData {
            nodes: vec![
                [0.0; 3],
                [1.0, 0.0, 0.0],
                [0.0, 1.0, 0.0],
                [0.0, 0.0, 1.0],
                [1.0, 1.0, 1.0],
            ],
            tetrahedra: vec![[0, 1, 2, 3], [1, 2, 3, 4]],
            regions: vec![3, 5],
            fibres: [vec![[0.0, 0.0, 3e-200]; 2], vec![[0.0; 3], [5.0, 0.0, 0.0]]],
            ..MeshData::default()
        };
        let mut body = Body::new("artery", Arc::new(Mesh::new(data).unwrap()));
        body.material.law = LawName::MooneyRivlin;
        body.material.mooney = 0.25;
        let hgo = Material { law: LawName::HolzapfelGasserOgden, young: 900.0, ..body.material };
        body.regions = vec![(5, hgo)];
        body
    }

    /// Forces on the last node, which only the second tetrahedron has, when it is pulled along x.
    fn pull(body: &Body) -> [f64; 3] {
        let mut x = body.mesh.nodes().to_vec();
        x[4][0] += 0.5;
        let mut tissue = tissue_of(body, VolumeAveraging::Automatic);
        let mut forces = vec![[0.0; 3]; x.len()];
        tissue.forces(&x, &mut forces);
        forces[4]
    }

    #[test]
    fn each_tetrahedron_has_the_law_and_the_fibres_of_its_region() {
        let two_families = body();
        assert_eq!(two_families.validate(), Ok(()));
        let mut stiff = pull(&two_families)[0];
        // Without the second family, whose direction the pull is along.
        let mut data = two_families.mesh.as_ref().clone().into_data();
        data.fibres[1].clear();
        let mut one_family = body();
        one_family.mesh = Arc::new(Mesh::new(data).unwrap());
        let soft = pull(&one_family)[0];
        assert!(stiff < 3.0 * soft && soft < 0.0, "{stiff} {soft}");
        // A direction of the material wins over that of the mesh.
        one_family.regions[0].1.fibres[1] = Some([-2.0, 0.0, 0.0]);
        assert_eq!(pull(&one_family)[0], stiff);
        // Without fibres the region is neo-Hookean.
        one_family.regions[0].1 =
            Material { law: LawName::HolzapfelGasserOgden, k1: 0.0, ..one_family.regions[0].1 };
        stiff = pull(&one_family)[0];
        one_family.regions[0].1.law = LawName::NeoHookean;
        assert_eq!(pull(&one_family)[0], stiff);
    }

    #[test]
    fn the_linear_law_is_not_mixed_with_others() {
        assert_eq!(check_laws(4, &body()), Ok(()));
        let mut mixed = body();
        mixed.material.law = LawName::Linear;
        assert_eq!(
            check_laws(4, &mixed).unwrap_err().to_string(),
            "body 4 'artery' has regions of law linear and of law hgo: linear regions cannot be \
             mixed with others; use corotated"
        );
        mixed.regions[0].1.law = LawName::Linear;
        assert_eq!(check_laws(4, &mixed), Ok(()));
    }
}
