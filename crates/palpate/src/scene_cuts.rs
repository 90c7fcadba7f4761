//! Cuts of the bodies of a scene, without mechanics.

use std::sync::Arc;

use palpate_contact::{Scene, SceneError};
use palpate_cutting::{Blade, Cut, CutError, CutOptions, cut_on};
use palpate_geometry::Point;
use palpate_model::Mesh;

/// What the cuts of a scene's bodies leave to the next one: the faces that they reached and did not open,
/// and the shortest edge that a body's parts may have. Known by the bodies' meshes, so that bodies that
/// were replaced, taken out or changed otherwise begin anew.
///
/// ```
/// use std::sync::Arc;
/// use palpate::{Blade, CutOptions, Mesh, MeshData, Scene, SceneCuts, SceneOptions};
///
/// let nodes = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
/// let data = MeshData { nodes, tetrahedra: vec![[0, 1, 2, 3]], ..MeshData::default() };
/// let mesh = Arc::new(Mesh::new(data)?);
/// let mut scene = Scene::new(vec![mesh], None, SceneOptions::default())?;
/// let blade = Blade::plane([0.4, 0.0, 0.0], [1.0, 0.1, 0.2], None)?;
/// let options = CutOptions { min_piece: 0.0, ..CutOptions::default() };
/// let cuts = SceneCuts::default().cut(&mut scene, &[0], &blade, &options)?;
/// assert_eq!(cuts[0].1.report.pieces, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SceneCuts {
    bodies: Vec<Left>,
}

/// What was left in one body.
#[derive(Clone, Debug)]
struct Left {
    mesh: Arc<Mesh>,
    pending: Vec<[u32; 3]>,
    min_edge: f64,
}

/// Why the bodies of a scene could not be cut. Nothing has changed then.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneCutError {
    /// There is no such body, or it could not be changed.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A body could not be cut.
    #[error("body {body} cannot be cut: {source}")]
    Cut {
        /// Index of the body.
        body: usize,
        /// Why.
        source: CutError,
    },
}

impl SceneCuts {
    /// Cuts some bodies of a scene along `blade`, where they are now, and returns those that changed, in
    /// the order of `bodies`. A blade may come in steps as short as one likes. Without `min_edge`, the
    /// shortest edge is that of the mesh which the first of a succession of cuts met.
    ///
    /// # Errors
    /// If there is no such body, or one could not be cut; nothing has changed then.
    pub fn cut(
        &mut self,
        scene: &mut Scene,
        bodies: &[usize],
        blade: &Blade,
        options: &CutOptions,
    ) -> Result<Vec<(usize, Cut)>, SceneCutError> {
        let count = scene.body_count();
        if let Some(&body) = bodies.iter().find(|&&body| body >= count) {
            return Err(SceneError::BodyOutOfRange { body, count }.into());
        }
        let mut left: Vec<Left> = (0..count).map(|body| self.left(scene.mesh(body))).collect();
        let once = |&(place, body): &(usize, usize)| !bodies[..place].contains(&body);
        let bodies_once = bodies.iter().copied().enumerate().filter(once);
        let described = bodies_once.map(|(_, body)| BodyToCut {
            body,
            mesh: scene.mesh(body),
            positions: scene.positions(body),
            pending: &left[body].pending,
            min_edge: options.min_edge.unwrap_or(left[body].min_edge),
        });
        let cuts = cut_bodies(described, blade, options)
            .map_err(|(body, source)| SceneCutError::Cut { body, source })?;
        for (body, found) in &cuts {
            scene.change_body(*body, &found.change)?;
            left[*body].mesh = Arc::clone(&found.change.mesh);
            left[*body].pending.clone_from(&found.pending);
        }
        self.bodies = left;
        Ok(cuts)
    }

    fn left(&self, mesh: &Arc<Mesh>) -> Left {
        let known = self.bodies.iter().find(|left| Arc::ptr_eq(&left.mesh, mesh));
        known.cloned().unwrap_or_else(|| Left {
            mesh: Arc::clone(mesh),
            pending: Vec::new(),
            min_edge: CutOptions::EDGE * mesh.mean_surface_edge(),
        })
    }
}

/// A body as a cut meets it.
pub(crate) struct BodyToCut<'a> {
    pub(crate) body: usize,
    pub(crate) mesh: &'a Mesh,
    pub(crate) positions: &'a [Point],
    /// Faces that the cuts before have reached and not opened.
    pub(crate) pending: &'a [[u32; 3]],
    /// Shortest edge [m] of the parts of its tetrahedra.
    pub(crate) min_edge: f64,
}

/// Cuts bodies; those that a blade passes by are left out. An error comes with its body.
pub(crate) fn cut_bodies<'a>(
    bodies: impl Iterator<Item = BodyToCut<'a>>,
    blade: &Blade,
    options: &CutOptions,
) -> Result<Vec<(usize, Cut)>, (usize, CutError)> {
    let mut cuts = Vec::new();
    for BodyToCut { body, mesh, positions, pending, min_edge } in bodies {
        let options = CutOptions { min_edge: Some(min_edge), ..*options };
        let found = cut_on(mesh, positions, blade, pending, &options);
        if let Some(found) = found.map_err(|source| (body, source))? {
            cuts.push((body, found));
        }
    }
    Ok(cuts)
}
