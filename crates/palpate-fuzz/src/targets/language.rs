//! Model texts: diagnostics, or a model whose canonical text says the same, and which can be simulated.

use std::path::Path;

use palpate::model::language::{LoadError, MeshLoader};
use palpate::model::{Document, ReadMesh, write_model};
use palpate::{Model, ReadOptions, Simulation, SimulationOptions, load_model};

use super::shapes::{box_of, plate};
use super::{Target, ensure};

/// The model language.
pub(crate) struct Language;

/// Gives a small mesh for any name.
struct AnyMesh;

impl MeshLoader for AnyMesh {
    fn load(&self, path: &Path) -> Result<ReadMesh, LoadError> {
        let name = path.to_string_lossy();
        let mesh = if name.contains("none") {
            return Err(LoadError::new("there is none"));
        } else if name.contains("plate") {
            plate(1.0, 0.0)
        } else {
            box_of([2, 1, 1], 0.5, [0.0; 3])
        };
        Ok(ReadMesh { mesh, notes: Vec::new() })
    }
}

impl Target for Language {
    fn name(&self) -> &'static str {
        "language"
    }

    fn words(&self) -> &'static [&'static str] {
        &[
            "BRANCH",
            "TREE",
            "ME",
            "PE",
            "NE",
            "MT",
            "FX",
            "RG",
            "CN",
            "VE",
            "IV",
            "AT",
            "{",
            "}",
            "trans",
            "rot",
            "axis",
            "angle",
            "scale",
            "matrix",
            "quat",
            "young",
            "poisson",
            "density",
            "damping",
            "mass_damping",
            "friction",
            "distance",
            "stiffness",
            "color",
            "opacity",
            "gravity",
            "unit",
            "mm",
            "fixed",
            "path",
            "at",
            "set",
            "base",
            "region",
            "box",
            "sphere",
            "law",
            "linear",
            "corotated",
            "stvk",
            "hgo",
            "neo-hookean",
            "kappa",
            "k1",
            "k2",
            "fibre",
            "mooney",
            "within",
            "self",
            "off",
            "plate.seg",
            "box.seg",
            "//",
            ",",
            "deg",
            "rad",
            "s",
            "m",
            "and",
        ]
    }

    fn warranted_memory(&self, input: usize) -> usize {
        // A body of the shortest text has a mesh, a tree and a factor of its own.
        4 * 1024 * 1024 + 6000 * input
    }

    fn try_input(&self, input: &[u8], scratch: &Path) -> Result<String, String> {
        let file = scratch.join("model.bml");
        std::fs::write(&file, input).map_err(|error| error.to_string())?;
        let model = match load_model(&file, &AnyMesh) {
            Ok(model) => model,
            Err(error) => {
                let first = error.diagnostics.first();
                // The text shows every finding with its line: it must end, too.
                ensure(!error.to_string().is_empty(), || "an error without words".into())?;
                return Ok(first.map_or("no diagnostic".into(), |each| each.message.clone()));
            }
        };
        let text = model.to_text().ok_or("a model from a text has none")?;
        let document = Document::parse(&text, &file)
            .map_err(|error| format!("the canonical text is refused: {error}"))?;
        ensure(document.to_text() == text, || "the canonical text is not canonical".into())?;
        let again = document
            .load(&AnyMesh)
            .map_err(|error| format!("the canonical text does not load: {error}"))?;
        ensure(bytes(&model)? == bytes(&again)?, || {
            "the canonical text describes another model".into()
        })?;
        if model.bodies.len() > 20 {
            return Ok("many bodies".into());
        }
        let written = write_model(&scratch.join("written.bml"), &model);
        let mut outcome = match &written {
            Ok(files) => {
                let last = files.last().ok_or("no file was written")?;
                match load_model(last, &ReadOptions::default()) {
                    Ok(read) => ensure(read.bodies.len() == model.bodies.len(), || {
                        "a written model has other bodies".into()
                    })?,
                    Err(error) => return Err(format!("a written model is refused: {error}")),
                }
                "model".to_owned()
            }
            Err(error) => error.to_string(),
        };
        for file in written.into_iter().flatten() {
            std::fs::remove_file(file).map_err(|error| error.to_string())?;
        }
        match Simulation::new(model, SimulationOptions::default()) {
            Ok(mut simulation) => match simulation.step() {
                Ok(_) => outcome += " steps",
                Err(error) => outcome += &error.to_string(),
            },
            Err(error) => outcome += &error.to_string(),
        }
        Ok(outcome)
    }
}

/// All that a model holds.
fn bytes(model: &Model) -> Result<Vec<u8>, String> {
    postcard::to_stdvec(model).map_err(|error| error.to_string())
}
