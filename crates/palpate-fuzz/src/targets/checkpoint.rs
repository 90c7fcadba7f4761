//! Checkpoints: damaged ones are refused, and one whose checksum is right, whatever it holds, is refused
//! or simulates.

use std::path::Path;
use std::sync::OnceLock;

use palpate::{Simulation, SimulationOptions};

use super::simulation::model;
use super::{Target, ensure};
use crate::choices::Choices;

/// Length of the magic, the version, the payload's length and its checksum.
const HEADER: usize = 24;

/// Checkpoint files.
#[derive(Default)]
pub(crate) struct Checkpoint {
    seeds: OnceLock<Vec<Vec<u8>>>,
}

impl Target for Checkpoint {
    fn name(&self) -> &'static str {
        "checkpoint"
    }

    /// Made anew, since their layout has versions: some states with contacts, springs, drives and cuts.
    fn seeds(&self) -> Vec<Vec<u8>> {
        self.seeds.get_or_init(|| (0..6).filter_map(made).collect()).clone()
    }

    fn warranted_memory(&self, input: usize) -> usize {
        // A tetrahedron has a matrix, a factor, a tree and a surface.
        16 * 1024 * 1024 + 6000 * input
    }

    fn try_input(&self, input: &[u8], scratch: &Path) -> Result<String, String> {
        let file = scratch.join("state.palpate");
        std::fs::write(&file, input).map_err(|error| error.to_string())?;
        let as_is = Simulation::load(&file, 1);
        // Mutations of the payload get past its checksum only when that follows.
        let mut input = input.to_vec();
        if input.len() > HEADER {
            let (header, payload) = input.split_at_mut(HEADER);
            header[12..20].copy_from_slice(&(payload.len() as u64).to_le_bytes());
            header[20..].copy_from_slice(&crc32fast::hash(payload).to_le_bytes());
        }
        std::fs::write(&file, &input).map_err(|error| error.to_string())?;
        let mut simulation = match Simulation::load(&file, 1) {
            Ok(simulation) => simulation,
            Err(error) => {
                ensure(as_is.is_err(), || "a damaged checkpoint was loaded".into())?;
                return Ok(error.to_string());
            }
        };
        let mut outcome = "loaded".to_owned();
        if let Err(error) = simulation.step() {
            outcome += &error.to_string();
        }
        simulation.save(&file).map_err(|error| format!("cannot be saved: {error}"))?;
        Simulation::load(&file, 1).map_err(|error| format!("cannot be loaded again: {error}"))?;
        if let Err(error) = simulation.reset() {
            outcome += &error.to_string();
        }
        Ok(outcome)
    }
}

/// A checkpoint of some model after some steps.
fn made(kind: u8) -> Option<Vec<u8>> {
    use palpate::cutting::{Blade, CutOptions};
    let bytes: Vec<u8> = (0..60).map(|i: u8| i.wrapping_mul(37).wrapping_add(kind) | 8).collect();
    let mut simulation =
        Simulation::new(model(&mut Choices::new(&bytes)), SimulationOptions::default()).ok()?;
    if kind.is_multiple_of(2) {
        simulation.pull(0, 5, [0.0, 0.0, 0.2], 20.0).ok()?;
    }
    if kind.is_multiple_of(3) {
        simulation.drive(0, &[2, 4]).ok()?;
    }
    for step in 0..4 {
        simulation.step().ok()?;
        if kind > 3 && step == 2 {
            let blade = Blade::plane([0.02, 0.0, 0.0], [1.0, 0.1, 0.0], None).ok()?;
            simulation.cut(&blade, &CutOptions::default()).ok()?;
        }
    }
    let folder = tempfile::tempdir().ok()?;
    let file = folder.path().join("state.palpate");
    simulation.save(&file).ok()?;
    std::fs::read(file).ok()
}
