//! Models and problems as documents in JSON, and back: for bug reports, replay, and to pass them on.
//!
//! A document says its format and version and holds one model, one scene, one simulation or one optimal control problem.
//! Expressions are written out node by node; functions that are callbacks or foreign code are named, and supplied by
//! their names when the document is read. Numbers return to the last bit. Whatever a document holds, reading it ends with
//! an object or an error.

mod mechanics;
mod parts;
mod problem;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::error::{Error, Result};
use crate::func::Function;
use crate::memory;
use crate::model::SavedModel;
use crate::ocp::Ocp;
use crate::scene::SavedScene;
use crate::settings::Settings;

pub use problem::Simulation;
use problem::{SavedOcp, SavedSimulation};

/// Version of what is written, and the newest that is read.
pub const VERSION: u32 = 1;

const FORMAT: &str = "switchback";

/// Longer texts are not read.
const MAX_BYTES: usize = 256 << 20;

/// Contents of a document.
#[non_exhaustive]
pub enum Document {
    /// A model, not built yet.
    Model(Box<SavedModel>),
    /// A scene or a projected system, not built yet.
    Scene(Box<SavedScene>),
    /// A simulation to be run.
    Simulation(Box<Simulation>),
    /// An optimal control problem to be solved.
    Ocp(Box<Ocp>),
}

#[derive(Deserialize)]
struct Header {
    format: String,
    version: u32,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    version: u32,
    /// Version of the library that wrote it.
    library: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    model: Option<SavedModel>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scene: Option<SavedScene>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    simulation: Option<SavedSimulation>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    ocp: Option<SavedOcp>,
}

impl File {
    fn new() -> File {
        File { format: FORMAT.into(), version: VERSION, library: env!("CARGO_PKG_VERSION").into(), ..File::default() }
    }

    fn text(&self) -> Result<String> {
        let mut text = Bytes(Vec::new());
        serde_json::to_writer(&mut text, self)
            .map_err(|e| Error::Internal(format!("the document cannot be written: {e}")))?;
        String::from_utf8(text.0).map_err(|e| Error::Internal(format!("the document is no text: {e}")))
    }
}

/// A text that grows as long as there is memory.
struct Bytes(Vec<u8>);

impl std::io::Write for Bytes {
    fn write(&mut self, part: &[u8]) -> std::io::Result<usize> {
        memory::room(&mut self.0, part.len());
        self.0.extend_from_slice(part);
        Ok(part.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// A model.
pub fn write_model(model: &SavedModel) -> Result<String> {
    File { model: Some(model.clone()), ..File::new() }.text()
}

/// A scene or a projected system.
pub fn write_scene(scene: &SavedScene) -> Result<String> {
    File { scene: Some(scene.clone()), ..File::new() }.text()
}

/// A simulation.
///
/// # Errors
/// [`Error::Unsupported`] if expressions in it cannot be saved.
pub fn write_simulation(simulation: &Simulation) -> Result<String> {
    File { simulation: Some(SavedSimulation::new(simulation)?), ..File::new() }.text()
}

/// An optimal control problem, with these settings instead of its own.
///
/// # Errors
/// As [`write_simulation`].
pub fn write_ocp(ocp: &Ocp, settings: &Settings) -> Result<String> {
    File { ocp: Some(SavedOcp::new(&ocp.statement(), settings)?), ..File::new() }.text()
}

/// Reads a document. `supplied` are the functions it names but does not contain.
///
/// # Errors
/// [`Error::Range`] for what is no document, with the place; [`Error::Unsupported`] for other versions; [`Error::State`]
/// for a function that is not supplied; else what the setters of the object say.
pub fn read(text: &str, supplied: &[Arc<dyn Function>]) -> Result<Document> {
    let file = parse(text)?;
    match (file.model, file.scene, file.simulation, file.ocp) {
        (Some(m), None, None, None) => Ok(Document::Model(Box::new(m))),
        (None, Some(s), None, None) => Ok(Document::Scene(Box::new(s))),
        (None, None, Some(s), None) => Ok(Document::Simulation(Box::new(s.restore(supplied)?))),
        (None, None, None, Some(o)) => Ok(Document::Ocp(Box::new(o.restore(supplied)?))),
        _ => Err(Error::Range("a document holds one of model, scene, simulation and ocp".into())),
    }
}

fn parse(text: &str) -> Result<File> {
    if text.len() > MAX_BYTES {
        return Err(Error::Range(format!("the document has {} bytes: up to {MAX_BYTES} are read", text.len())));
    }
    // a number of one digit and a comma become eight bytes, and lists grow by copying
    memory::need(16 * text.len() as u128, || format!("a document of {} bytes", text.len()))?;
    let bad = |e: serde_json::Error| Error::Range(format!("this is no document of a model or problem: {e}"));
    let header: Header = serde_json::from_str(text).map_err(bad)?;
    if header.format != FORMAT {
        return Err(Error::Range(format!("the format is '{:.40}', not '{FORMAT}'", header.format)));
    }
    if header.version != VERSION {
        return Err(Error::Unsupported(format!(
            "the document has version {}, this library reads version {VERSION}",
            header.version
        )));
    }
    serde_json::from_str(text).map_err(bad)
}
