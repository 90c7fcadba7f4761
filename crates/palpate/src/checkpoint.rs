//! Checkpoints: model, meshes and state in one file, from which a simulation continues bit for bit.
//!
//! Layout: magic, format version (u32), payload length (u64), CRC-32 of the payload (u32), all
//! little-endian, then the payload (postcard).

use std::path::{Path, PathBuf};
use std::sync::Arc;

use palpate_contact::SceneOptions;
use palpate_mechanics::State;
use palpate_model::files::write_whole;
use palpate_model::{Document, Model};
use serde::{Deserialize, Serialize};

use crate::simulation::{
    LiveCuts, PendingFaces, Simulation, SimulationError, SimulationOptions, Snapshot, Substeps,
};

const MAGIC: [u8; 8] = *b"palpate\n";
const VERSION: u32 = 8;
const HEADER: usize = 8 + 4 + 8 + 4;

/// Why a checkpoint could not be written or read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Not a checkpoint, of another version, or damaged.
    #[error("{}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The checkpoint is whole, but its simulation cannot start.
    #[error("{}: {source}", path.display())]
    Simulation {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: SimulationError,
    },
}

/// What a checkpoint holds. Documents travel as text, their one exact form.
#[derive(Deserialize, Serialize)]
struct Payload<M, S> {
    model: M,
    text: Option<String>,
    time_step: f64,
    scene: SceneOptions,
    substeps: Substeps,
    /// Before all cuts; `None` where there were none.
    initial_model: Option<(M, Option<String>)>,
    initial: S,
    state: S,
    initial_pending: PendingFaces,
    pending: PendingFaces,
    live: LiveCuts,
}

impl Simulation {
    /// Writes a checkpoint to `path`; the file is complete or absent.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let (initial, now) = (self.initial(), self.snapshot());
        let was_cut = !Arc::ptr_eq(&initial.model, &now.model);
        let payload = Payload {
            model: self.model().as_ref(),
            text: self.model().to_text(),
            time_step: self.options().time_step,
            scene: self.options().scene,
            substeps: self.options().substeps,
            initial_model: was_cut.then(|| (initial.model.as_ref(), initial.model.to_text())),
            initial: &initial.state,
            state: &now.state,
            initial_pending: initial.pending.clone(),
            pending: now.pending,
            live: now.live,
        };
        let io = |source| CheckpointError::Io { path: path.to_path_buf(), source };
        let bytes = postcard::to_stdvec(&payload)
            .map_err(|error| io(std::io::Error::other(error.to_string())))?;
        write_checkpoint(path, &bytes).map_err(io)
    }

    /// Continues from a checkpoint, bit for bit, with any number of threads.
    ///
    /// # Errors
    /// If the file cannot be read, is damaged, or is not a checkpoint of this version.
    pub fn load(path: &Path, threads: usize) -> Result<Self, CheckpointError> {
        let unreadable =
            |reason: String| CheckpointError::Unreadable { path: path.to_path_buf(), reason };
        let bytes = std::fs::read(path)
            .map_err(|source| CheckpointError::Io { path: path.to_path_buf(), source })?;
        let payload = checked_payload(&bytes).map_err(unreadable)?;
        let payload: Payload<Model, State> = postcard::from_bytes(payload)
            .map_err(|error| unreadable(format!("the checkpoint is damaged: {error}")))?;
        let with_text = |mut model: Model, text: Option<String>| {
            if let Some(text) = &text {
                let document = Document::parse(text, path);
                model.document = Some(document.map_err(|error| unreadable(error.to_string()))?);
            }
            Ok::<_, CheckpointError>(Arc::new(model))
        };
        let model = with_text(payload.model, payload.text)?;
        let initial_model = match payload.initial_model {
            Some((initial, text)) => with_text(initial, text)?,
            None => Arc::clone(&model),
        };
        let options = SimulationOptions {
            time_step: payload.time_step,
            scene: payload.scene,
            threads,
            substeps: payload.substeps,
        };
        let continued = || {
            let mut simulation =
                Simulation::in_state(model, options, payload.state, payload.pending)?;
            simulation.set_initial(Snapshot {
                model: initial_model,
                state: payload.initial,
                pending: payload.initial_pending,
                live: LiveCuts::default(),
            });
            simulation.set_live_cuts(&payload.live)?;
            Ok(simulation)
        };
        continued()
            .map_err(|source| CheckpointError::Simulation { path: path.to_path_buf(), source })
    }
}

/// Header and payload, complete or absent.
fn write_checkpoint(path: &Path, payload: &[u8]) -> std::io::Result<()> {
    write_whole(path, |file| {
        file.write_all(&MAGIC)?;
        file.write_all(&VERSION.to_le_bytes())?;
        file.write_all(&(payload.len() as u64).to_le_bytes())?;
        file.write_all(&crc32fast::hash(payload).to_le_bytes())?;
        file.write_all(payload)
    })
}

/// The payload of a whole checkpoint, or what is wrong with it.
fn checked_payload(bytes: &[u8]) -> Result<&[u8], String> {
    let Some((header, payload)) = bytes.split_at_checked(HEADER) else {
        return Err("not a palpate checkpoint: the file is too short".into());
    };
    let (magic, rest) = header.split_at(MAGIC.len());
    if magic != MAGIC {
        return Err("not a palpate checkpoint".into());
    }
    let word = |at: usize| u32::from_le_bytes([rest[at], rest[at + 1], rest[at + 2], rest[at + 3]]);
    let (version, length, checksum) =
        (word(0), u64::from(word(4)) | u64::from(word(8)) << 32, word(12));
    if version != VERSION {
        return Err(format!("checkpoint version {version}, this palpate reads version {VERSION}"));
    }
    if payload.len() as u64 != length {
        let found = payload.len();
        return Err(format!(
            "the checkpoint is damaged: {found} bytes of payload, expected {length}"
        ));
    }
    if crc32fast::hash(payload) != checksum {
        return Err("the checkpoint is damaged: its checksum does not match".into());
    }
    Ok(payload)
}
