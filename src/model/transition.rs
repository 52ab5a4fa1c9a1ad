//! Transitions of a model: guards and resets as expressions, discrete states with the values they begin with.

use std::sync::Arc;

use super::{Built, Model};
use crate::error::{finite, Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id};
use crate::system::{Choice, Direction, Reset, Transition as Made};

/// A jump of the state where a guard passes zero, see [`crate::system::Transition`]; guard and reset are expressions.
#[derive(Debug, Clone, PartialEq)]
pub struct Transition {
    /// The guard.
    pub guard: Id,
    /// Direction in which the guard passes zero.
    pub direction: Direction,
    /// Discrete states and the values they must have for the transition to be watched.
    pub from: Vec<(usize, f64)>,
    /// States and what they become, expressions of the state before; the others stay as they are.
    pub reset: Vec<(usize, Id)>,
    /// Discrete states and the values they have behind the jump.
    pub to: Vec<(usize, f64)>,
}

impl Model {
    /// Says that the last states are discrete and with which values they begin where nothing else is given. Only transitions
    /// change them.
    ///
    /// # Errors
    /// [`Error::Range`] for values that are not finite; [`Error::Dimension`] if there are more than states.
    pub fn set_discrete(&mut self, initial: &[f64]) -> Result<()> {
        check_initial(initial, self.dims.x)?;
        self.discrete = initial.to_vec();
        self.value_names = vec![Vec::new(); initial.len()];
        Ok(())
    }

    /// Names the values 0, 1, ... of the discrete state `k`, which counts from 0: the states of an automaton. No names take
    /// back what was said before.
    ///
    /// # Errors
    /// [`Error::Dimension`] if there is no such discrete state; [`Error::Range`] for names that are empty or repeat.
    pub fn set_value_names(&mut self, k: usize, names: &[String]) -> Result<()> {
        name_values(&mut self.value_names, k, names)
    }

    /// Values with which the last states, which are discrete, begin.
    pub fn discrete(&self) -> &[f64] {
        &self.discrete
    }

    /// Adds a transition and returns its index; what is wrong with it is said when the model is built.
    pub fn add_transition(&mut self, t: Transition) -> usize {
        self.transitions.push(t);
        self.transitions.len() - 1
    }

    /// The transitions in the order they were added.
    pub fn transitions(&self) -> &[Transition] {
        &self.transitions
    }

    /// Says that a control chooses among values; what is wrong with it is said when the model is built. See [`crate::system::System::add_choice`].
    pub fn add_choice(&mut self, control: usize, values: &[f64], dwell: f64) {
        self.choices.push(Choice { control, values: values.to_vec(), dwell });
    }
}

fn name_values(all: &mut [Vec<String>], k: usize, names: &[String]) -> Result<()> {
    let n = all.len();
    let place = all.get_mut(k).ok_or_else(|| {
        Error::Dimension(format!("there is no discrete state {k}, the model has {n}: set them first"))
    })?;
    let mut seen = std::collections::BTreeSet::new();
    for name in names {
        if name.is_empty() || name.contains(['\n', '\0']) {
            return Err(Error::Range(format!("'{name:.40}' is no name of a value of discrete state {k}")));
        }
        if !seen.insert(name) {
            return Err(Error::Range(format!("two values of discrete state {k} have the name '{name:.40}'")));
        }
    }
    *place = names.to_vec();
    Ok(())
}

fn check_initial(initial: &[f64], nx: usize) -> Result<()> {
    if initial.len() > nx {
        return Err(Error::Dimension(format!("{} discrete states, but the model has {nx} states", initial.len())));
    }
    finite("initial value of discrete state", initial, initial.len())
}

/// What a report says of a state that nothing drives.
pub(super) fn constant_note(name: &str) -> String {
    format!("state {name} is constant: a parameter costs less")
}

impl Built {
    /// The transitions in the order they were added; their expressions are those of the graph they were added from.
    pub fn transitions(&self) -> &[Transition] {
        &self.transitions
    }

    /// Values with which the last states, which are discrete, begin.
    pub fn discrete(&self) -> &[f64] {
        &self.discrete
    }

    /// Sets discrete states like [`Model::set_discrete`], in a model that is built already.
    ///
    /// # Errors
    /// Those of [`Model::set_discrete`], and [`Error::State`] if such a state has a derivative.
    pub fn set_discrete(&mut self, initial: &[f64]) -> Result<()> {
        let nx = self.dims.x;
        check_initial(initial, nx)?;
        let own = nx - initial.len()..nx;
        let driven = |i: &usize| !self.still[*i];
        if let Some(i) = own.clone().find(driven) {
            return Err(Error::State(format!(
                "state {} is discrete: only transitions change it, its derivative must be zero",
                self.names.of(Block::X, i)
            )));
        }
        let known: Vec<String> = own.map(|i| self.names.of(Block::X, i)).collect();
        let texts: Vec<String> = known.iter().map(|name| constant_note(name)).collect();
        self.report.notes.retain(|n| !texts.contains(&n.text));
        self.report.discrete = known;
        self.report.value_names = vec![Vec::new(); initial.len()];
        self.discrete = initial.to_vec();
        self.value_names = vec![Vec::new(); initial.len()];
        self.change_source(|saved| saved.set_discrete(initial));
        Ok(())
    }

    /// Sets names of values like [`Model::set_value_names`], in a model that is built already.
    ///
    /// # Errors
    /// Those of [`Model::set_value_names`].
    pub fn set_value_names(&mut self, k: usize, names: &[String]) -> Result<()> {
        name_values(&mut self.value_names, k, names)?;
        self.report.value_names.clone_from(&self.value_names);
        let all = &self.value_names.clone();
        self.change_source(|saved| saved.set_value_names(all));
        Ok(())
    }

    /// Names of the values of every discrete state; none where they have no names.
    pub fn value_names(&self) -> &[Vec<String>] {
        &self.value_names
    }

    /// Says that a control chooses among values, and returns the number of the choice.
    ///
    /// # Errors
    /// Those of [`crate::system::System::add_choice`].
    pub fn add_choice(&mut self, control: usize, values: &[f64], dwell: f64) -> Result<usize> {
        let k = self.system.add_choice(control, values, dwell)?;
        let choice = self.system.choices()[k].clone();
        self.report.choices.push(self.choice_text(&choice));
        self.change_source(|saved| saved.add_choice(&choice));
        Ok(k)
    }

    fn choice_text(&self, c: &Choice) -> String {
        let values: Vec<String> = c.values.iter().map(f64::to_string).collect();
        let held = if c.dwell > 0.0 { format!(", each held for {} at least", c.dwell) } else { String::new() };
        format!("{} is one of {}{held}", self.names.of(Block::U, c.control), values.join(", "))
    }

    /// Adds a transition with expressions of the graph the model was built from, and returns its index.
    ///
    /// # Errors
    /// [`Error::Range`] for states that do not exist or repeat and for guards and resets that switch; those of
    /// [`crate::system::System::add_transition`] and of [`ExprFunction::new`].
    pub fn add_transition(&mut self, dag: &mut Dag, t: Transition) -> Result<usize> {
        let k = self.transitions.len();
        let nx = self.dims.x;
        for (i, &(state, _)) in t.reset.iter().enumerate() {
            if state >= nx {
                return Err(Error::Range(format!(
                    "transition {k}: the reset names the state {state}, but there are {nx}"
                )));
            }
            if t.reset[..i].iter().any(|r| r.0 == state) {
                return Err(Error::Range(format!("transition {k}: the reset names the state {state} twice")));
            }
        }
        for &id in t.reset.iter().map(|r| &r.1).chain([&t.guard]) {
            if dag.is_condition(id) {
                return Err(Error::Range(format!(
                    "transition {k}: guard and reset are values, {} is a condition: a guard is what passes zero",
                    dag.text_with(id, &|block, i| self.names.of(block, i))
                )));
            }
        }
        let function = |dag: &mut Dag, name: &str, outputs: &[Id]| -> Result<Arc<ExprFunction>> {
            Ok(Arc::new(ExprFunction::new(name, dag, self.dims, outputs)?))
        };
        let watched = dag.of_same_sign(t.guard);
        let guard = function(dag, &format!("guard{k}"), &[watched])?;
        let mut reset = None;
        if !t.reset.is_empty() {
            let mut moved = t.reset.clone();
            moved.sort_unstable_by_key(|r| r.0);
            let (rows, ids): (Vec<usize>, Vec<Id>) = moved.into_iter().unzip();
            reset = Some((rows, function(dag, &format!("reset{k}"), &ids)?));
        }
        let made = Made {
            guard: guard.clone(),
            direction: t.direction,
            from: t.from.clone(),
            reset: reset.clone().map(|(rows, f)| Reset { rows, f }),
            to: t.to.clone(),
        };
        self.system.add_transition(made)?;
        self.functions.push(guard);
        self.functions.extend(reset.map(|r| r.1));
        self.report.transitions.push(self.transition_text(dag, &t));
        self.change_source(|saved| saved.add_transition(dag, &t));
        self.transitions.push(t);
        Ok(k)
    }

    /// `heat 0 -> 1 where 18 - x becomes positive`
    fn transition_text(&self, dag: &Dag, t: &Transition) -> String {
        let name = |i: usize| self.names.of(Block::X, i);
        let text = |id: Id| dag.text_with(id, &|block, i| self.names.of(block, i));
        let mut parts: Vec<String> = Vec::new();
        for &(state, value) in &t.to {
            parts.push(match t.from.iter().find(|f| f.0 == state) {
                Some(f) => format!("{} {} -> {value}", name(state), f.1),
                None => format!("{} -> {value}", name(state)),
            });
        }
        parts.extend(t.reset.iter().map(|&(state, id)| format!("{} := {}", name(state), text(id))));
        let mut out = parts.join(", ");
        out += &match (dag.as_const(t.guard), t.direction) {
            (Some(v), d) if v * d.sign() > 0.0 => " at once".to_owned(),
            (_, Direction::Rising) => format!(" where {} becomes positive", text(t.guard)),
            (_, Direction::Falling) => format!(" where {} becomes negative", text(t.guard)),
        };
        let asked = t.from.iter().filter(|f| t.to.iter().all(|to| to.0 != f.0));
        let asked: Vec<String> = asked.map(|&(state, value)| format!("{} = {value}", name(state))).collect();
        if !asked.is_empty() {
            out += &format!(", while {}", asked.join(" and "));
        }
        out
    }
}
