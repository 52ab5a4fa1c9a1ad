//! Transitions of a model: guards and resets as expressions, discrete states with the values they begin with.

use std::sync::Arc;

use super::{Built, Model, Names};
use crate::error::{finite, Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id};
use crate::func::Dims;
use crate::system::{Choice, Direction, Effect, Reset, Rule, Transition as Made, Trigger};

/// A jump of the state where a guard passes zero, see [`crate::system::Transition`]; guard and reset are expressions.
///
/// The guard is a value, which passes zero in its direction, or a condition, joined of comparisons, which becomes true (rising) or false
/// (falling). It is smooth. Resets may switch and jump, see [`Dag::function_at_events`].
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
    /// Name, effect, trigger.
    pub rule: Rule,
}

impl Transition {
    /// One that changes nothing: it notes where its guard rises, or ends the run.
    pub fn event(name: &str, effect: Effect, guard: Id) -> Transition {
        let rule = Rule::event(name, effect);
        Transition { guard, direction: Direction::Rising, from: Vec::new(), reset: Vec::new(), to: Vec::new(), rule }
    }
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
    /// [`Error::Range`] for states that do not exist or repeat, [`Error::Unsupported`] for guards that switch; those of
    /// [`crate::system::System::add_transition`] and of [`ExprFunction::new`].
    pub fn add_transition(&mut self, dag: &mut Dag, t: Transition) -> Result<usize> {
        let k = self.transitions.len();
        let f = functions(dag, k, self.dims, &self.names, &t)?;
        self.system.add_transition(f.made(&t))?;
        self.system.add_known_times(&f.times)?;
        self.functions.push(f.guard);
        self.functions.extend(f.reset.map(|r| r.1));
        self.report.transitions.push(t.text(dag, &self.names));
        self.change_source(|saved| saved.add_transition(dag, &t));
        self.transitions.push(t);
        Ok(k)
    }
}

impl Transition {
    /// `heat 0 -> 1 where 18 - x becomes positive`
    pub(crate) fn text(&self, dag: &Dag, names: &Names) -> String {
        let name = |i: usize| names.of(Block::X, i);
        let text = |id: Id| dag.text_with(id, &|block, i| names.of(block, i));
        let mut parts: Vec<String> = Vec::new();
        for &(state, value) in &self.to {
            parts.push(match self.from.iter().find(|f| f.0 == state) {
                Some(f) => format!("{} {} -> {value}", name(state), f.1),
                None => format!("{} -> {value}", name(state)),
            });
        }
        parts.extend(self.reset.iter().map(|&(state, id)| format!("{} := {}", name(state), text(id))));
        let effect = match self.rule.effect {
            Effect::Jump => None,
            Effect::Note => Some("noted"),
            Effect::Stop => Some("ends the run"),
        };
        parts.extend(effect.map(str::to_owned));
        let mut out = if self.rule.name.is_empty() { String::new() } else { format!("{}: ", self.rule.name) };
        out += &parts.join(", ");
        out += &match (dag.as_const(self.guard), self.direction) {
            (Some(v), d) if v * d.sign() > 0.0 => " at once".to_owned(),
            (_, Direction::Rising) if dag.is_condition(self.guard) => {
                format!(" where {} becomes true", text(self.guard))
            }
            (_, Direction::Falling) if dag.is_condition(self.guard) => {
                format!(" where {} becomes false", text(self.guard))
            }
            (_, Direction::Rising) => format!(" where {} becomes positive", text(self.guard)),
            (_, Direction::Falling) => format!(" where {} becomes negative", text(self.guard)),
        };
        let asked = self.from.iter().filter(|f| self.to.iter().all(|to| to.0 != f.0));
        let asked: Vec<String> = asked.map(|&(state, value)| format!("{} = {value}", name(state))).collect();
        if !asked.is_empty() {
            out += &format!(", while {}", asked.join(" and "));
        }
        if self.rule.effect == Effect::Jump && self.rule.trigger == Trigger::Edge {
            out += ", not where it is so from the start";
        }
        out
    }
}

/// The functions of a transition.
pub(crate) struct Functions {
    guard: Arc<ExprFunction>,
    clauses: Vec<Vec<usize>>,
    direction: Direction,
    reset: Option<(Vec<usize>, Arc<ExprFunction>)>,
    switches: bool,
    /// Times at which its guard is known to bend.
    pub(crate) times: Vec<(f64, bool)>,
}

impl Functions {
    /// The transition as systems take it.
    pub(crate) fn made(&self, t: &Transition) -> Made {
        let reset = self.reset.clone();
        Made {
            guard: self.guard.clone(),
            clauses: self.clauses.clone(),
            direction: self.direction,
            from: t.from.clone(),
            reset: reset.map(|(rows, f)| Reset { rows, f, switches: self.switches }),
            to: t.to.clone(),
            rule: t.rule.clone(),
        }
    }
}

/// The functions of transition `k`, of systems of these sizes.
///
/// # Errors
/// Those of [`Built::add_transition`], but for what the system itself checks.
pub(crate) fn functions(dag: &mut Dag, k: usize, dims: Dims, names: &Names, t: &Transition) -> Result<Functions> {
    let nx = dims.x;
    for (i, &(state, _)) in t.reset.iter().enumerate() {
        if state >= nx {
            return Err(Error::Range(format!("transition {k}: the reset names the state {state}, but there are {nx}")));
        }
        if t.reset[..i].iter().any(|r| r.0 == state) {
            return Err(Error::Range(format!("transition {k}: the reset names the state {state} twice")));
        }
    }
    for &id in t.reset.iter().map(|r| &r.1) {
        if dag.is_condition(id) {
            return Err(Error::Range(format!(
                "transition {k}: resets are values, {} is a condition: choose one with where",
                dag.text_with(id, &|block, i| names.of(block, i))
            )));
        }
    }
    let (watched, clauses, direction) = watched(dag, t)?;
    if let Some(&id) = watched.iter().find(|id| !dag.switches_of(&[**id]).is_empty()) {
        return Err(Error::Unsupported(format!(
            "transition {k}: the guard {} switches itself, by sign, abs, min, max, clip or where: join comparisons with & and |, or let a \
             clock hold the value that switches as a discrete state",
            dag.text_with(id, &|block, i| names.of(block, i))
        )));
    }
    let guard = Arc::new(ExprFunction::new(&format!("guard{k}"), dag, dims, &watched)?);
    let (mut reset, mut switches) = (None, false);
    if !t.reset.is_empty() {
        let mut moved = t.reset.clone();
        moved.sort_unstable_by_key(|r| r.0);
        let (rows, ids): (Vec<usize>, Vec<Id>) = moved.into_iter().unzip();
        switches = dag.has_floor(&ids) || !dag.switches_of(&ids).is_empty();
        let f = dag.function_at_events(&format!("reset{k}"), dims, &ids)?;
        reset = Some((rows, Arc::new(f)));
    }
    Ok(Functions { guard, clauses, direction, reset, switches, times: dag.table_times(&watched) })
}

/// What is watched of a guard: functions, the lists of those that must be positive together, and the direction.
fn watched(dag: &mut Dag, t: &Transition) -> Result<(Vec<Id>, Vec<Vec<usize>>, Direction)> {
    if !dag.is_condition(t.guard) {
        return Ok((vec![dag.of_same_sign(t.guard)], Vec::new(), t.direction));
    }
    let condition = match t.direction {
        Direction::Rising => t.guard,
        Direction::Falling => dag.not(t.guard),
    };
    let found = dag.clauses(condition)?;
    let decided = match &found.lists[..] {
        [] => Some(-1.0),
        all if all.iter().any(Vec::is_empty) => Some(1.0),
        _ => None,
    };
    Ok(match (decided, &found.lists[..]) {
        (Some(v), _) => (vec![dag.constant(v)], Vec::new(), Direction::Rising),
        (_, [one]) if one.len() == 1 => (found.functions, Vec::new(), Direction::Rising),
        _ => (found.functions, found.lists, Direction::Rising),
    })
}
