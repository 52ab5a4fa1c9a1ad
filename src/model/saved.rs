//! A model as data, for documents.

use serde::{Deserialize, Serialize};

use super::{Model, Names, Transition, Trial};
use crate::error::{Error, Result};
use crate::expr::{Dag, Id, SavedGraph};
use crate::func::Function;
use crate::memory::sizes;
use crate::system::{Choice, Direction, Effect, Rule, Trigger};
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
    /// Values with which the last states, which are discrete, begin.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    discrete: Vec<f64>,
    /// Names of the values 0, 1, ... of each of them; none where they have no names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    value_names: Vec<Vec<String>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    transitions: Vec<SavedTransition>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    choices: Vec<Choice>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedNames {
    states: Vec<String>,
    controls: Vec<String>,
    parameters: Vec<String>,
}

impl SavedNames {
    pub(crate) fn of(n: &Names) -> SavedNames {
        SavedNames { states: n.x.clone(), controls: n.u.clone(), parameters: n.p.clone() }
    }
}

impl From<&SavedNames> for Names {
    fn from(n: &SavedNames) -> Names {
        Names { x: n.states.clone(), u: n.controls.clone(), p: n.parameters.clone() }
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedTrial {
    t: f64,
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
}

/// A discrete state and a value of it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedValue {
    state: usize,
    value: f64,
}

impl SavedValue {
    pub(crate) fn list(values: &[(usize, f64)]) -> Vec<SavedValue> {
        values.iter().map(|&(state, value)| SavedValue { state, value }).collect()
    }

    pub(crate) fn values(list: &[SavedValue]) -> Vec<(usize, f64)> {
        list.iter().map(|v| (v.state, v.value)).collect()
    }
}

/// The direction of a guard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum SavedDirection {
    Rising,
    Falling,
}

impl From<Direction> for SavedDirection {
    fn from(d: Direction) -> SavedDirection {
        match d {
            Direction::Rising => SavedDirection::Rising,
            Direction::Falling => SavedDirection::Falling,
        }
    }
}

impl From<SavedDirection> for Direction {
    fn from(d: SavedDirection) -> Direction {
        match d {
            SavedDirection::Rising => Direction::Rising,
            SavedDirection::Falling => Direction::Falling,
        }
    }
}

/// What a transition does.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedEffect {
    #[default]
    Jump,
    Note,
    Stop,
}

/// When it does so.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedTrigger {
    #[default]
    Level,
    Edge,
}

fn is_default<T: Default + PartialEq>(v: &T) -> bool {
    *v == T::default()
}

/// Name, effect and trigger of a transition.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedRule {
    #[serde(default, skip_serializing_if = "String::is_empty")]
    name: String,
    #[serde(default, skip_serializing_if = "is_default")]
    effect: SavedEffect,
    #[serde(default, skip_serializing_if = "is_default")]
    trigger: SavedTrigger,
}

impl SavedRule {
    pub(crate) fn is_default(&self) -> bool {
        is_default(self)
    }
}

impl From<&Rule> for SavedRule {
    fn from(r: &Rule) -> SavedRule {
        SavedRule {
            name: r.name.clone(),
            effect: match r.effect {
                Effect::Jump => SavedEffect::Jump,
                Effect::Note => SavedEffect::Note,
                Effect::Stop => SavedEffect::Stop,
            },
            trigger: match r.trigger {
                Trigger::Level => SavedTrigger::Level,
                Trigger::Edge => SavedTrigger::Edge,
            },
        }
    }
}

impl From<&SavedRule> for Rule {
    fn from(r: &SavedRule) -> Rule {
        Rule {
            name: r.name.clone(),
            effect: match r.effect {
                SavedEffect::Jump => Effect::Jump,
                SavedEffect::Note => Effect::Note,
                SavedEffect::Stop => Effect::Stop,
            },
            trigger: match r.trigger {
                SavedTrigger::Level => Trigger::Level,
                SavedTrigger::Edge => Trigger::Edge,
            },
        }
    }
}

/// A transition: the first root of the expressions is the guard, the others are what the states in `reset` become.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SavedTransition {
    expressions: SavedGraph,
    direction: SavedDirection,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    from: Vec<SavedValue>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    reset: Vec<usize>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    to: Vec<SavedValue>,
    #[serde(default, skip_serializing_if = "SavedRule::is_default")]
    rule: SavedRule,
}

impl SavedTransition {
    pub(crate) fn new(dag: &Dag, t: &Transition) -> Result<SavedTransition> {
        let roots: Vec<Id> = [t.guard].into_iter().chain(t.reset.iter().map(|r| r.1)).collect();
        Ok(SavedTransition {
            expressions: SavedGraph::new(dag, &roots)?,
            direction: t.direction.into(),
            from: SavedValue::list(&t.from),
            reset: t.reset.iter().map(|r| r.0).collect(),
            to: SavedValue::list(&t.to),
            rule: (&t.rule).into(),
        })
    }

    /// Does it move states?
    pub(crate) fn resets(&self) -> bool {
        !self.reset.is_empty()
    }

    pub(crate) fn restore(&self, dag: &mut Dag, supplied: &[Arc<dyn Function>]) -> Result<Transition> {
        let n = 1 + self.reset.len();
        if self.expressions.n_roots() != n {
            return Err(Error::Dimension(format!(
                "a transition that resets {} states has {} expressions: the guard, and one for each of these",
                self.reset.len(),
                self.expressions.n_roots()
            )));
        }
        let roots = self.expressions.restore(dag, supplied)?;
        Ok(Transition {
            guard: roots[0],
            direction: self.direction.into(),
            from: SavedValue::values(&self.from),
            reset: self.reset.iter().copied().zip(roots[1..].iter().copied()).collect(),
            to: SavedValue::values(&self.to),
            rule: (&self.rule).into(),
        })
    }
}

impl SavedModel {
    /// Saves a model with all its derivatives.
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
            names: named.then(|| SavedNames::of(n)),
            derivatives: SavedGraph::new(dag, &rhs)?,
            trial: model.trial.as_ref().map(|t| SavedTrial { t: t.t, x: t.x.clone(), u: t.u.clone(), p: t.p.clone() }),
            discrete: Vec::new(),
            value_names: Vec::new(),
            transitions: Vec::new(),
            choices: Vec::new(),
        })
    }

    pub(super) fn set_discrete(&mut self, initial: &[f64]) -> Result<()> {
        self.discrete = initial.to_vec();
        self.value_names = Vec::new();
        Ok(())
    }

    pub(super) fn set_value_names(&mut self, all: &[Vec<String>]) -> Result<()> {
        self.value_names = if all.iter().all(Vec::is_empty) { Vec::new() } else { all.to_vec() };
        Ok(())
    }

    pub(super) fn add_transition(&mut self, dag: &Dag, t: &Transition) -> Result<()> {
        self.transitions.push(SavedTransition::new(dag, t)?);
        Ok(())
    }

    pub(super) fn add_choice(&mut self, c: &Choice) -> Result<()> {
        self.choices.push(c.clone());
        Ok(())
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of states, controls and parameters; empty where none are given.
    pub fn names(&self) -> Names {
        self.names.as_ref().map_or_else(Names::default, Names::from)
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
            model.set_names(Names::from(n));
        }
        if let Some(t) = &self.trial {
            model.set_trial(Trial { t: t.t, x: t.x.clone(), u: t.u.clone(), p: t.p.clone() })?;
        }
        model.set_discrete(&self.discrete)?;
        for (k, names) in self.value_names.iter().enumerate() {
            model.set_value_names(k, names)?;
        }
        // a reset has an output for every state, which a document does not write out
        sizes::entries("the resets", &[self.transitions.iter().filter(|t| t.resets()).count(), model.dims.x])?;
        for (k, t) in self.transitions.iter().enumerate() {
            model.add_transition(t.restore(dag, supplied).map_err(|e| at_transition(k, e))?);
        }
        for c in &self.choices {
            model.add_choice(c.control, &c.values, c.dwell);
        }
        Ok(model)
    }
}

fn at_transition(k: usize, e: Error) -> Error {
    let put = |s: String| format!("transition {k}: {s}");
    match e {
        Error::Dimension(s) => Error::Dimension(put(s)),
        Error::Range(s) => Error::Range(put(s)),
        other => other,
    }
}
