//! Real-time contact detection and deformation for soft bodies made of tetrahedra.
//!
//! [`Scene`] finds what touches; [`Simulation`] lets it touch: a model is loaded, its contacts are
//! found every step by a bounding tree that is only refitted, and its bodies deform under them.
//!
//! ```no_run
//! use palpate::{ReadOptions, Simulation, SimulationOptions, load_model};
//!
//! let model = load_model("models/case1.bml".as_ref(), &ReadOptions::default())?;
//! let mut simulation = Simulation::new(model, SimulationOptions::default())?;
//! let report = simulation.step()?;
//! println!("{} contacts at {} s", report.mechanics.contacts, simulation.time());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod checkpoint;
mod scene_cuts;
mod simulation;
mod tool_loop;

pub use checkpoint::CheckpointError;
pub use palpate_contact as contact;
pub use palpate_cutting as cutting;
pub use palpate_geometry as geometry;
pub use palpate_mechanics as mechanics;
pub use palpate_model as model;

pub use palpate_contact::{Scene, SceneError, SceneOptions};
pub use palpate_cutting::{Blade, CutOptions};
pub use palpate_model::{Mesh, MeshData, Model, ModelError, ReadOptions, load_model};
pub use scene_cuts::{SceneCutError, SceneCuts};
pub use simulation::{
    BodyChange, ChangeReport, ChangeTimes, Simulation, SimulationError, SimulationOptions,
    Snapshot, StepReport, StepTimes, Substeps,
};
pub use tool_loop::{ToolForce, ToolLoop};
