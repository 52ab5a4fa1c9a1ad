//! Models as functional mock-up units: the standard FMI 2.0 and 3.0 of the Modelica Association, model exchange and co-simulation in one unit.
//!
//! A unit is an archive: a description, the model as a document, and the shared library itself, which has the functions of the standard. No
//! compiler is needed to write one. In co-simulation the engine of the library goes from one communication point to the next. In model exchange an
//! integrator outside makes the steps, and the engine finds the modes: what it watches are the event indicators, and behind an event it says how
//! the motion goes on, with transitions, resets and sliding modes ([`Engine::go_on_outside`](crate::event::Engine::go_on_outside)).

mod archive;
mod describe;
mod unit;

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::document::{read, write_model, Document};
use crate::error::{finite, Error, Result};
use crate::event::{Engine, Options};
use crate::expr::{is_c_identifier, Dag};
use crate::model::{Built, SavedModel};
use archive::Archive;
use describe::Description;

pub use unit::{Kind, Unit};

/// Names in the folder of resources.
const MODEL: &str = "model.json";
const DATA: &str = "unit.json";

/// Versions of the standard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FmiVersion {
    /// 2.0
    Two,
    /// 3.0
    Three,
}

/// What a unit begins with, and how accurate its co-simulation is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Start {
    /// States, the discrete ones too.
    pub x: Vec<f64>,
    /// Controls.
    pub u: Vec<f64>,
    /// Parameters.
    pub p: Vec<f64>,
    /// Tolerances of co-simulation, relative and absolute; an importer may ask for another relative one.
    pub rtol: f64,
    /// See `rtol`.
    pub atol: f64,
    /// Usual length of a simulation.
    pub duration: f64,
}

/// What stands in the resources beside the model.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Data {
    /// By which importers tell that description and library belong together.
    token: String,
    start: Start,
}

impl Start {
    fn check(&self, model: &Built) -> Result<()> {
        let d = model.dims;
        for (what, v, n) in [("x0", &self.x, d.x), ("u0", &self.u, d.u), ("params", &self.p, d.p)] {
            finite(what, v, n)?;
        }
        if !(self.duration > 0.0 && self.duration.is_finite()) {
            return Err(Error::Range(format!("duration is {}: it must be positive", self.duration)));
        }
        Ok(())
    }

    fn options(&self) -> Options {
        Options::with_tolerance(self.rtol, self.atol)
    }
}

/// A model read from a document.
fn restored(text: &str) -> Result<(Box<SavedModel>, Built)> {
    let Document::Model(saved) = read(text, &[])? else {
        return Err(Error::Range("the document of a unit holds a model".into()));
    };
    let mut dag = Dag::new();
    let built = saved.restore(&mut dag, &[])?.build_in(&mut dag)?;
    Ok((saved, built))
}

/// Writes a model as a unit to the file `path`, whose name without its ending names the unit; `library` is the shared library, a copy of which
/// goes into the unit.
///
/// # Errors
/// [`Error::Range`] where the name is no C identifier, values are not finite, or a file cannot be read or written; [`Error::State`] for models that
/// call functions of the caller; those of [`Engine::new`].
pub fn write(model: &Built, version: FmiVersion, start: &Start, library: &Path, path: &Path) -> Result<()> {
    let name = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    if !is_c_identifier(name) || name.is_empty() {
        return Err(Error::Range(format!(
            "{}: the name of a unit is that of its file, and has letters, digits and underscores only, a digit not first",
            path.display()
        )));
    }
    start.check(model)?;
    let document = write_model(model.source()?)?;
    // what a unit cannot supply is missing here
    let (saved, built) = restored(&document)?;
    let engine = Engine::new(&built.system, &start.options())?;
    let exchange = engine.check_outside().is_ok().then(|| engine.most_watched());
    let d = Description::new(name, &saved, &built, start, exchange, &document);
    let data = Data { token: d.token.clone(), start: start.clone() };
    let data = serde_json::to_string(&data).map_err(|e| Error::Internal(format!("the unit cannot be written: {e}")))?;
    let binary = std::fs::read(library)
        .map_err(|e| Error::Range(format!("the library {} cannot be read: {e}", library.display())))?;
    let mut all = Archive::default();
    all.add("modelDescription.xml", d.text(version).as_bytes())?;
    all.add(&format!("resources/{MODEL}"), document.as_bytes())?;
    all.add(&format!("resources/{DATA}"), data.as_bytes())?;
    all.add(&format!("binaries/{}/{name}{}", describe::platform(version), std::env::consts::DLL_SUFFIX), &binary)?;
    std::fs::write(path, all.finish()?).map_err(|e| Error::Range(format!("{} cannot be written: {e}", path.display())))
}
