//! Files of strokes: an error, or strokes whose cuts leave a sound mesh of the same volume.

use std::path::Path;

use palpate::Mesh;
use palpate::cutting::{CutOptions, cut, read_strokes};

use super::shapes::box_of;
use super::{Target, ensure};

/// Files of strokes.
pub(crate) struct BladeFile;

impl Target for BladeFile {
    fn name(&self) -> &'static str {
        "blade"
    }

    fn words(&self) -> &'static [&'static str] {
        &["blade", "1", "stroke", "plane", "loop", "at", "step", "s", "\n", "//", ",", "0 0 0"]
    }

    fn warranted_memory(&self, input: usize) -> usize {
        // A stroke of forty bytes may cut every tetrahedron of the box, again and again.
        16 * 1024 * 1024 + 4000 * input
    }

    fn try_input(&self, input: &[u8], scratch: &Path) -> Result<String, String> {
        let file = scratch.join("strokes.blade");
        std::fs::write(&file, input).map_err(|error| error.to_string())?;
        let strokes = match read_strokes(&file) {
            Ok(strokes) => strokes,
            Err(error) => return Ok(error.to_string()),
        };
        let mut mesh = box_of([3, 2, 2], 0.5, [-0.5; 3]);
        let mut outcome = format!("{} strokes", strokes.len());
        for stroke in strokes.iter().take(6) {
            let volume = mesh.volume();
            match cut(&mesh, mesh.nodes(), &stroke.blade, &CutOptions::default()) {
                Ok(None) => outcome += " missed",
                Ok(Some(done)) => {
                    let new = &done.change.mesh;
                    let checked = Mesh::new(new.as_ref().clone().into_data())
                        .map_err(|error| format!("a cut mesh is none: {error}"))?;
                    ensure(checked == **new, || "a cut mesh has another surface".into())?;
                    let change = (new.volume() - volume).abs() / volume;
                    ensure(change < 1e-9, || format!("a cut changes the volume by {change:e}"))?;
                    ensure(done.report.pieces >= done.report.pieces_before, || {
                        "a cut joins pieces".into()
                    })?;
                    ensure(done.positions.len() == new.nodes().len(), || {
                        "a node has no position".into()
                    })?;
                    outcome += if done.report.pieces > done.report.pieces_before {
                        " parted"
                    } else {
                        " opened"
                    };
                    if new.tetrahedra().len() > 4000 {
                        break;
                    }
                    mesh = new.as_ref().clone();
                }
                Err(error) => outcome += &error.to_string(),
            }
        }
        Ok(outcome)
    }
}
