//! A model as data, for documents.

use serde::{Deserialize, Serialize};

use super::{Model, Names, Trial};
use crate::error::{Error, Result};
use crate::expr::{Dag, Id, SavedGraph};
use crate::func::Function;
use crate::memory::sizes;
use std::sync::Arc;

/// Name, sizes and derivatives of a model; there are as many states as derivatives.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedModel {
    name: String,
    controls: usize,
    parameters: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    names: Option<SavedNames>,
    derivatives: SavedGraph,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    trial: Option<SavedTrial>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedNames {
    states: Vec<String>,
    controls: Vec<String>,
    parameters: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedTrial {
    t: f64,
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
}

impl SavedModel {
    /// Of a model with all its derivatives.
    ///
    /// # Errors
    /// [`Error::State`] if a state has no derivative, and those of [`SavedGraph::new`].
    pub fn new(model: &Model, dag: &Dag) -> Result<SavedModel> {
        let rhs: Option<Vec<Id>> = model.rhs.iter().copied().collect();
        let rhs = rhs.ok_or_else(|| Error::State(format!("{}: a state has no derivative", model.name)))?;
        let n = &model.names;
        let named = [&n.x, &n.u, &n.p].into_iter().flatten().any(|name| !name.is_empty());
        Ok(SavedModel {
            name: model.name.clone(),
            controls: model.dims.u,
            parameters: model.dims.p,
            names: named.then(|| SavedNames { states: n.x.clone(), controls: n.u.clone(), parameters: n.p.clone() }),
            derivatives: SavedGraph::new(dag, &rhs)?,
            trial: model.trial.as_ref().map(|t| SavedTrial { t: t.t, x: t.x.clone(), u: t.u.clone(), p: t.p.clone() }),
        })
    }

    /// The model, with its expressions added to a graph.
    ///
    /// # Errors
    /// Those of [`SavedGraph::restore`] and of the setters of [`Model`].
    pub fn restore(&self, dag: &mut Dag, supplied: &[Arc<dyn Function>]) -> Result<Model> {
        sizes::check("controls and parameters", &[self.controls, self.parameters])?;
        let rhs = self.derivatives.restore(dag, supplied)?;
        let mut model = Model::new(&self.name, rhs.len(), self.controls, self.parameters)?;
        for (i, id) in rhs.into_iter().enumerate() {
            model.set_derivative(i, id)?;
        }
        if let Some(n) = &self.names {
            model.set_names(Names { x: n.states.clone(), u: n.controls.clone(), p: n.parameters.clone() });
        }
        if let Some(t) = &self.trial {
            model.set_trial(Trial { t: t.t, x: t.x.clone(), u: t.u.clone(), p: t.p.clone() })?;
        }
        Ok(model)
    }
}
