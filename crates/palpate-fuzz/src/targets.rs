//! What is thrown at. A new target is a file below and its line in [`all`].

mod blade;
mod checkpoint;
mod language;
mod mesh_file;
mod scene;
mod shapes;
mod simulation;

use std::path::Path;

/// A part of palpate that takes input from outside.
pub(crate) trait Target {
    /// What it is called; also the folder of its corpus.
    fn name(&self) -> &'static str;

    /// Words of its language, for mutations.
    fn words(&self) -> &'static [&'static str] {
        &[]
    }

    /// Inputs beside the committed ones.
    fn seeds(&self) -> Vec<Vec<u8>> {
        Vec::new()
    }

    /// Bytes that a sound program may need at once for an input of so many.
    fn warranted_memory(&self, input: usize) -> usize;

    /// Tries an input; the outcome in words, or what is wrong with it. A panic is a finding, too.
    /// Files go to `scratch`.
    fn try_input(&self, input: &[u8], scratch: &Path) -> Result<String, String>;
}

/// All targets.
pub(crate) fn all() -> Vec<Box<dyn Target>> {
    vec![
        Box::new(language::Language),
        Box::new(mesh_file::MeshFile { extension: "seg" }),
        Box::new(mesh_file::MeshFile { extension: "vtk" }),
        Box::new(blade::BladeFile),
        Box::new(checkpoint::Checkpoint::default()),
        Box::new(scene::SceneCalls),
        Box::new(simulation::SimulationCalls),
    ]
}

/// A finding where something does not hold.
fn ensure(holds: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what()) }
}
