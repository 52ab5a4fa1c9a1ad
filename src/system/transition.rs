//! Transitions: what makes the state jump, and the discrete states between which they lead.
//!
//! ```text
//! where ψ(x,u,p,t) passes zero in its direction, and x_i = a_i for every discrete state in `from`:
//!     x⁺ = r(x⁻,u,p,t),   then   x_j⁺ = b_j for every discrete state in `to`
//! ```
//!
//! A *discrete state* is a state that a transition names in `from` or `to`. Nothing drives it but transitions: its row of the
//! right-hand side is zero. A thermostat has one that is 0 or 1, an automaton one that counts its locations.
//!
//! The rules, which leave nothing to chance:
//! - A transition is watched only while the discrete states are as `from` says.
//! - It happens where ψ passes zero, or at once where ψ is already beyond zero, or at zero and on its way, when the discrete
//!   states become as `from` says; the start of a simulation is such a time, and so is a change of controls or parameters.
//! - A transition that leaves its own guard beyond zero and its own `from` true happens once; it is watched again when
//!   ψ has been back on the other side.
//! - Of several that happen at one time the one that was added first comes first; the others follow if they still hold.
//!
//! A transition of the trigger [`Trigger::Edge`] happens where its condition *becomes* true while it is watched. Where the condition is true already
//! when the discrete states become as `from` says, it has to be false before. A jump of the state by another transition, and other controls
//! or parameters, make a condition true as the motion does.
//!
//! A guard may have several outputs: the condition is then that of one list among `clauses` all are positive. Its transition happens where that
//! becomes true, and is watched again where it has been false.
//!
//! Two effects change nothing. [`Effect::Note`] writes time and state down and ends no step; [`Effect::Stop`] ends the run. Both have the
//! trigger [`Trigger::Edge`].

use std::sync::Arc;

use super::{SharedFunction, System};
use crate::error::{Error, Result};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// The direction in which the guard of a transition passes zero.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum Direction {
    /// From below: the transition happens where the guard becomes positive.
    #[default]
    Rising = 0,
    /// From above: the transition happens where the guard becomes negative.
    Falling = 1,
}

impl Direction {
    /// 1 for rising, -1 for falling: times this the guard becomes positive where the transition happens.
    pub fn sign(self) -> f64 {
        match self {
            Direction::Rising => 1.0,
            Direction::Falling => -1.0,
        }
    }
}

/// What happens where the condition of a transition becomes true.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum Effect {
    /// The state jumps.
    #[default]
    Jump = 0,
    /// Time and state are written down; no step ends for that.
    Note = 1,
    /// The run ends there.
    Stop = 2,
}

impl Effect {
    /// The effect with this number.
    ///
    /// # Errors
    /// [`Error::Range`] if there is none.
    pub fn from_number(n: i32) -> Result<Effect> {
        let all = [Effect::Jump, Effect::Note, Effect::Stop];
        let found = all.into_iter().find(|e| *e as i32 == n);
        found
            .ok_or_else(|| Error::Range(format!("there is no effect {n}: 0 is a jump, 1 a note, 2 the end of the run")))
    }
}

/// Does a transition happen where its condition is true, or where it becomes true?
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum Trigger {
    /// Where it is true: at once when its discrete states begin, if it is true then.
    #[default]
    Level = 0,
    /// Where it becomes true: what is true when its discrete states begin has to be false before.
    Edge = 1,
}

impl Trigger {
    /// The trigger with this number.
    ///
    /// # Errors
    /// [`Error::Range`] if there is none.
    pub fn from_number(n: i32) -> Result<Trigger> {
        let found = [Trigger::Level, Trigger::Edge].into_iter().find(|e| *e as i32 == n);
        found.ok_or_else(|| Error::Range(format!("there is no trigger {n}: 0 is the level, 1 the edge")))
    }
}

/// What a transition is called, what it does, and when.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Rule {
    /// Its name in results and reports; empty for none.
    pub name: String,
    /// What happens.
    pub effect: Effect,
    /// When; [`Trigger::Edge`] for all but jumps.
    pub trigger: Trigger,
}

impl Rule {
    /// One that changes nothing.
    pub fn event(name: &str, effect: Effect) -> Rule {
        Rule { name: name.to_owned(), effect, trigger: Trigger::Edge }
    }

    /// Errors of names, and of triggers that an effect does not have; `name` is what is known of others.
    pub(crate) fn check<'a>(&self, k: usize, mut others: impl Iterator<Item = &'a Rule>) -> Result<()> {
        if self.name.contains(['\n', '\0']) {
            return Err(Error::Range(format!("transition {k}: a name is one line, {:?} is not", self.name)));
        }
        if !self.name.is_empty() && others.any(|o| o.name == self.name) {
            return Err(Error::Range(format!("transition {k}: there is one called '{}' already", self.name)));
        }
        if self.effect != Effect::Jump && self.trigger == Trigger::Level {
            return Err(Error::State(format!(
                "transition {k} notes or stops, which happens where its condition becomes true: give it the trigger edge"
            )));
        }
        Ok(())
    }
}

/// A jump of the state where a guard passes zero, or another event there, see [`Effect`].
#[derive(Clone)]
pub struct Transition {
    /// The guard `ψ`, one output; as many as `clauses` name.
    pub guard: SharedFunction,
    /// Lists of outputs of the guard: its condition is that all of one list are positive. No lists: that of the one output, in its direction.
    pub clauses: Vec<Vec<usize>>,
    /// Direction in which the guard passes zero.
    pub direction: Direction,
    /// Discrete states and the values they must have for the transition to be watched.
    pub from: Vec<(usize, f64)>,
    /// States that jump, and what they become; none: the state stays as it is, up to `to`.
    pub reset: Option<Reset>,
    /// Discrete states and the values they have behind the jump.
    pub to: Vec<(usize, f64)>,
    /// Name, effect, trigger.
    pub rule: Rule,
}

impl Transition {
    /// Has its guard one output, which acts where it is positive: what optimal control, and systems of many units, follow?
    pub(crate) fn stops(&self) -> bool {
        self.rule.effect == Effect::Stop
    }

    /// Is it one comparison that acts where it is true, and changes states?
    pub(crate) fn is_plain(&self) -> bool {
        self.clauses.is_empty() && self.rule.effect == Effect::Jump && self.rule.trigger == Trigger::Level
    }
}

/// New values of some states in a transition: the others stay as they are.
#[derive(Clone)]
pub struct Reset {
    /// States that jump, ascending.
    pub rows: Vec<usize>,
    /// Their new values, one output for each, of the state before.
    pub f: SharedFunction,
    /// Does it switch or jump, so that its derivatives are those of one branch?
    pub switches: bool,
}

impl From<SharedFunction> for Reset {
    /// Reset of all states.
    fn from(f: SharedFunction) -> Reset {
        Reset { rows: (0..f.dims().x).collect(), f, switches: false }
    }
}

impl Reset {
    /// The reset as a function with one output for every state.
    pub fn whole(&self) -> SharedFunction {
        let nx = self.f.dims().x;
        if self.rows.len() == nx {
            return self.f.clone();
        }
        Arc::new(Whole::new(self))
    }
}

/// A reset of some states with the others, which stay as they are.
struct Whole {
    reset: Reset,
    /// The places among all entries of those of the reset, and of the ones.
    jac: Pattern,
    places: Vec<usize>,
    ones: Vec<usize>,
}

impl Whole {
    fn new(reset: &Reset) -> Whole {
        let (dims, p) = (reset.f.dims(), reset.f.jac_pattern());
        let own = (0..p.n_cols()).flat_map(|c| p.rows(c).iter().map(move |r| (reset.rows[*r], c)));
        let stay = (0..dims.x).filter(|i| reset.rows.binary_search(i).is_err()).map(|i| (i, i));
        let (rows, columns): (Vec<usize>, Vec<usize>) = own.chain(stay).unzip();
        let (jac, map) = Pattern::from_triplets(dims.x, dims.n_in(), &rows, &columns);
        let (places, ones) = map.split_at(p.nnz());
        Whole { jac, places: places.to_vec(), ones: ones.to_vec(), reset: reset.clone() }
    }
}

impl Function for Whole {
    fn name(&self) -> &str {
        self.reset.f.name()
    }
    fn dims(&self) -> Dims {
        self.reset.f.dims()
    }
    fn n_out(&self) -> usize {
        self.dims().x
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        self.reset.f.hess_pattern()
    }
    fn work_len(&self) -> usize {
        let f = &self.reset.f;
        f.work_len() + f.n_out().max(f.jac_pattern().nnz())
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (own, work) = work.split_at_mut(self.reset.f.n_out());
        self.reset.f.value(at, own, work)?;
        out[..at.x.len()].copy_from_slice(at.x);
        self.reset.rows.iter().zip(own).for_each(|(i, v)| out[*i] = *v);
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (own, work) = work.split_at_mut(self.places.len());
        self.reset.f.jacobian(at, own, work)?;
        self.places.iter().zip(own).for_each(|(k, v)| out[*k] = *v);
        self.ones.iter().for_each(|k| out[*k] = 1.0);
        Ok(())
    }
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (own, work) = work.split_at_mut(self.reset.f.n_out());
        self.reset.rows.iter().zip(&mut *own).for_each(|(i, w)| *w = weights[*i]);
        self.reset.f.hessian(at, own, out, work)
    }
    fn is_serial(&self) -> bool {
        self.reset.f.is_serial()
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.reset.f.jacobian_is_approximate()
    }
    fn hessian_is_approximate(&self) -> bool {
        self.reset.f.hessian_is_approximate()
    }
}

impl System {
    /// The transitions in the order they were added.
    pub fn transitions(&self) -> &[Transition] {
        &self.transitions
    }

    /// The states that transitions name in `from` or `to`, ascending.
    pub fn discrete_states(&self) -> Vec<usize> {
        let named = self.transitions.iter().flat_map(|t| t.from.iter().chain(&t.to)).map(|d| d.0);
        let mut all: Vec<usize> = named.collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Adds a transition and returns its index.
    pub fn add_transition(&mut self, t: Transition) -> Result<usize> {
        let k = self.transitions.len();
        t.rule.check(k, self.transitions.iter().map(|t| &t.rule))?;
        self.check_guard(k, &t)?;
        if let Some(r) = &t.reset {
            self.check(r.f.as_ref(), r.rows.len())?;
            if let Some(i) = r.rows.iter().find(|i| **i >= self.dims.x) {
                return Err(Error::Range(format!(
                    "transition {k}: the reset names the state {i}, but there are {}",
                    self.dims.x
                )));
            }
            if r.rows.windows(2).any(|w| w[0] >= w[1]) {
                return Err(Error::Range(format!("transition {k}: the states of a reset ascend, each once")));
            }
        }
        for (what, list) in [("from", &t.from), ("to", &t.to)] {
            for (i, &(state, value)) in list.iter().enumerate() {
                if state >= self.dims.x {
                    return Err(Error::Range(format!(
                        "transition {k}: `{what}` names the state {state}, but there are {}",
                        self.dims.x
                    )));
                }
                if self.algebraic_states().contains(&state) {
                    return Err(Error::Range(format!(
                        "transition {k}: `{what}` names the state {state}, which is algebraic: it has no value of its own"
                    )));
                }
                if !value.is_finite() {
                    return Err(Error::NonFinite(format!(
                        "transition {k}: `{what}` gives the discrete state {state} the value {value}"
                    )));
                }
                if list[..i].iter().any(|d| d.0 == state) {
                    return Err(Error::Range(format!("transition {k}: `{what}` names the state {state} twice")));
                }
            }
        }
        let changes = t.reset.is_some() || !t.to.is_empty();
        match (t.rule.effect, changes) {
            (Effect::Jump, false) => Err(Error::State(format!(
                "transition {k} changes nothing: give a reset, or discrete states `to`; or an effect that notes or stops"
            ))),
            (Effect::Note | Effect::Stop, true) => Err(Error::State(format!(
                "transition {k} notes or stops and changes the state: add a second transition with the same guard for that"
            ))),
            _ => Ok(()),
        }?;
        self.transitions.push(t);
        Ok(k)
    }

    fn check_guard(&self, k: usize, t: &Transition) -> Result<()> {
        if t.clauses.is_empty() {
            return self.check(t.guard.as_ref(), 1);
        }
        let n = t.guard.n_out();
        self.check(t.guard.as_ref(), n)?;
        if t.direction != Direction::Rising {
            return Err(Error::Range(format!(
                "transition {k}: a guard of several outputs rises; negate its condition"
            )));
        }
        if let Some(i) = t.clauses.iter().flatten().find(|i| **i >= n) {
            return Err(Error::Range(format!("transition {k}: a clause names output {i} of the guard, which has {n}")));
        }
        if t.clauses.iter().any(Vec::is_empty) {
            return Err(Error::Range(format!("transition {k}: a clause without outputs is always true")));
        }
        Ok(())
    }

    /// The system as it is between transitions: its discrete states are states that nothing drives.
    pub(crate) fn without_transitions(&self) -> System {
        System { transitions: Vec::new(), ..self.clone() }
    }

    /// An error where there are transitions, for those who cannot follow them.
    pub(crate) fn check_without_transitions(&self, who: &str) -> Result<()> {
        if self.transitions.is_empty() {
            return Ok(());
        }
        Err(Error::Unsupported(format!(
            "{who} cannot follow transitions (guards with resets or discrete states): simulate the system event-driven"
        )))
    }

    /// Is a discrete state driven by something else?
    pub(super) fn check_discrete(&self) -> Result<()> {
        for d in self.discrete_states() {
            let mut driven = self.subsystems.iter().map(|s| &s.rows).chain(self.inclusions.iter().map(|i| &i.rows));
            if driven.any(|rows| rows.contains(&d)) {
                return Err(Error::State(format!(
                    "state {d} is discrete, as transitions set or ask for its value: no mode may drive it"
                )));
            }
        }
        Ok(())
    }
}
