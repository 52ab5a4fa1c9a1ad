//! A sequence of transitions as problems between them: every leg has its own stages, and ends where its transition is made.

use super::automaton::{Automaton, Passage};
use super::guess::Guess;
use crate::error::{Error, Result};
use crate::fesd::{Durations, Element, PathAt, PathConstraint, Place, RowMeaning, Terminal};
use crate::func::Function;
use crate::ocp::solve::Built;
use crate::ocp::{CostAt, Ocp};
use crate::settings::RkFamily;
use crate::system::{combination, Direction, Transition};

const INF: f64 = f64::INFINITY;
/// Share of a stage a piece of it has at least where a solve starts.
const SHORT: f64 = 0.02;

/// What happens between two transitions.
pub(super) struct Leg {
    /// The problem: the smooth system, stages of free lengths.
    pub ocp: Ocp,
    /// The stage of the whole problem that its first one belongs to.
    pub first: usize,
    /// Values of the discrete states.
    pub values: Vec<f64>,
    /// The transitions it begins and ends with.
    pub begins: Option<Passage>,
    pub ends: Option<Passage>,
    /// Transitions that are watched: their guards follow the path constraints of the user.
    pub guards: Vec<usize>,
}

/// Bounds that keep a guard from passing zero, and those where it passes.
fn guard_bounds(t: &Transition) -> ([f64; 2], [f64; 2]) {
    match t.direction {
        Direction::Rising => ([-INF, 0.0], [0.0, INF]),
        Direction::Falling => ([0.0, INF], [-INF, 0.0]),
    }
}

/// Does a function depend on the time?
pub(super) fn knows_time(f: &dyn Function) -> bool {
    !f.jac_pattern().rows(f.dims().t_col()).is_empty()
}

impl Ocp {
    /// Are the initial values of discrete states given? They jump, and no search varies them.
    pub(in crate::ocp) fn check_discrete_start(&self) -> Result<()> {
        for s in self.system.discrete_states() {
            let (l, u) = (self.x0_bounds[0][s], self.x0_bounds[1][s]);
            if l != u {
                return Err(Error::State(format!(
                    "state {s} is discrete: its initial value must be given, its bounds are {l} and {u}"
                )));
            }
        }
        Ok(())
    }
}

impl Leg {
    /// The legs of a complete sequence, to start from `guess`.
    pub fn all(ocp: &Ocp, automaton: &Automaton, sequence: &[Passage], guess: &Guess) -> Result<Vec<Leg>> {
        let values = automaton
            .values(sequence)
            .ok_or_else(|| Error::Internal("a sequence of transitions that cannot follow each other".into()))?;
        let n = sequence.len();
        (0..=n)
            .map(|j| {
                let begins = j.checked_sub(1).map(|i| sequence[i]);
                let span =
                    [if j == 0 { 0.0 } else { guess.passages[j - 1] }, guess.passages.get(j).copied().unwrap_or(INF)];
                Leg::new(ocp, automaton, begins, sequence.get(j).copied(), values[j].clone(), span, guess)
            })
            .collect()
    }

    fn new(
        whole: &Ocp,
        automaton: &Automaton,
        begins: Option<Passage>,
        ends: Option<Passage>,
        values: Vec<f64>,
        span: [f64; 2],
        guess: &Guess,
    ) -> Result<Leg> {
        let (first, last) = (begins.map_or(0, |p| p.stage), ends.map_or(whole.n_stages - 1, |p| p.stage));
        let stages = first..last + 1;
        let mut o = whole.blank();
        o.system = whole.system.without_transitions();
        o.settings.adapt_tol = 0.0;
        o.n_stages = stages.len();
        o.time = Durations::Stages;
        o.time_bounds = [0.0, INF];
        (o.durations, o.t0) = pieces(whole, guess, stages.clone(), span);
        o.horizon = o.durations.iter().sum();
        if !o.n_fe.is_empty() {
            o.n_fe = whole.n_fe[stages.clone()].to_vec();
        }
        let d = o.system.dims();
        let of_stages = |b: &Vec<f64>| b[first * d.u..(last + 1) * d.u].to_vec();
        o.chosen = whole.chosen.as_ref().map(|b| [of_stages(&b[0]), of_stages(&b[1])]);
        o.stage_params = whole.stage_params.as_ref().map(|p| p[first * d.p..(last + 1) * d.p].to_vec());
        if o.stage_params.is_none() {
            o.params.clone_from(&guess.params);
        }
        for q in &mut o.squares {
            let n = q.f.n_out();
            if q.references.len() > n {
                q.references = q.references[first * n..(last + 1) * n].to_vec();
            }
        }
        if begins.is_some() || ends.is_some() {
            o.boundary.clear();
        }
        if ends.is_some() {
            o.mayer = None;
            o.terminal.clear();
            o.squares.retain(|q| q.place != CostAt::Terminal);
            o.soft.retain(|s| s.at.is_some());
            // the last leg pays for what they have in common
            o.soft.iter_mut().filter(|s| !s.by_stage()).for_each(|s| s.weight = 0.0);
            o.transitions.goes_on = true;
        }
        o.modes = guess.modes.as_ref().map(|m| m.within(span[0], span[1].min(guess.horizon())));
        let mut leg = Leg { ocp: o, first, values, begins, ends, guards: Vec::new() };
        leg.bound_discrete(whole, automaton);
        leg.watch(automaton)?;
        leg.start_from(whole, automaton, guess, span);
        Ok(leg)
    }

    /// The discrete states are what they are: their bounds are those of sequences.
    fn bound_discrete(&mut self, whole: &Ocp, automaton: &Automaton) {
        let o = &mut self.ocp;
        if let Some(p) = self.begins {
            // where a reset leads to is no end of an element, which has bounds already
            let resets = automaton.transitions[p.transition].reset.is_some();
            let free = |v: f64| vec![v; o.system.dims().x];
            o.x0_bounds = if resets { whole.x_bounds.clone() } else { [free(-INF), free(INF)] };
        }
        for (&s, &v) in automaton.states.iter().zip(&self.values) {
            (o.x_bounds[0][s], o.x_bounds[1][s]) = (-INF, INF);
            (o.x0_bounds[0][s], o.x0_bounds[1][s]) = (v, v);
        }
    }

    /// Guards that are watched stay on their side; that of the transition at the end passes zero there.
    fn watch(&mut self, automaton: &Automaton) -> Result<()> {
        let o = &mut self.ocp;
        // where the method has no point at the end of an element the guard would pass zero there unseen
        let ends_on_points =
            matches!(o.settings.rk_family()?, RkFamily::RadauIia | RkFamily::LobattoIiia | RkFamily::LobattoIiic);
        let at = if ends_on_points { PathAt::StagePoints } else { PathAt::Elements };
        for (k, t) in automaton.transitions.iter().enumerate() {
            if automaton.is_constant(k) || !automaton.is_armed(k, &self.values) {
                continue;
            }
            let [lower, upper] = guard_bounds(t).0;
            o.path.push(PathConstraint { f: t.guard.clone(), lower: vec![lower], upper: vec![upper], at });
            self.guards.push(k);
        }
        let Some(p) = self.ends else { return Ok(()) };
        let t = &automaton.transitions[p.transition];
        if !automaton.is_constant(p.transition) {
            let [lower, upper] = if p.at_once { guard_bounds(t).1 } else { [0.0; 2] };
            o.terminal.push(Terminal { f: t.guard.clone(), lower: vec![lower], upper: vec![upper] });
        }
        if t.reset.as_ref().is_some_and(|r| knows_time(r.f.as_ref())) {
            self.tell_time();
        }
        Ok(())
    }

    /// Makes the time a state of the discretised problem.
    pub fn tell_time(&mut self) {
        let d = self.ocp.system.dims();
        let f = combination("time", d, vec![vec![(d.t_col(), 1.0)]]);
        self.ocp.terminal.push(Terminal { f, lower: vec![-INF], upper: vec![INF] });
    }

    fn start_from(&mut self, whole: &Ocp, automaton: &Automaton, guess: &Guess, span: [f64; 2]) {
        let nu = whole.system.dims().u;
        let o = &mut self.ocp;
        o.u_guess = Some(guess.controls[self.first * nu..(self.first + o.n_stages) * nu].to_vec());
        let (times, mut states) = guess.between(span[0], span[1].min(guess.horizon()));
        for x in states.chunks_exact_mut(whole.system.dims().x) {
            automaton.states.iter().zip(&self.values).for_each(|(&s, &v)| x[s] = v);
        }
        o.x_guess = Some((times, states));
    }

    /// Writes the values of the discrete states into an element, which has them up to rounding.
    pub fn say_discrete(&self, e: &mut Element, states: &[usize]) {
        let nx = e.x0.len();
        for (&i, &v) in states.iter().zip(&self.values) {
            (e.x0[i], e.x1[i]) = (v, v);
            e.xs.iter_mut().skip(i).step_by(nx).for_each(|x| *x = v);
            e.hk.iter_mut().skip(i).step_by(nx).for_each(|k| *k = 0.0);
        }
    }

    /// Is its last stage one without a length, at whose end a transition is made at once?
    pub fn ends_at_once(&self) -> bool {
        self.ends.is_some_and(|p| p.at_once)
    }

    /// Where a constraint along the path holds, relaxed ones behind the others.
    fn place_of(&self, k: usize) -> Option<PathAt> {
        let relaxed = self.ocp.soft.iter().filter_map(|s| s.at);
        self.ocp.path.iter().map(|p| p.at).chain(relaxed).nth(k)
    }

    /// Rows that say again what others say: the guard of the transition that is made where it passes zero, what
    /// the leg before ends with, and constraints at the control grid where a transition cuts a stage.
    pub fn rows_again(&self, b: &Built, before: Option<&Leg>, automaton: &Automaton) -> Vec<usize> {
        let mut rows = Vec::new();
        let n_user = self.ocp.path.len() - self.guards.len();
        let n_s = b.problem.tableau().n_s;
        let (last, last_element) = (self.ocp.n_stages - 1, b.n_fe()[self.ocp.n_stages - 1] - 1);
        let continues = self.begins.is_some_and(|p| !p.at_once && automaton.transitions[p.transition].reset.is_none());
        for (row, meaning) in b.problem.row_meanings().into_iter().enumerate() {
            let RowMeaning::Path(Place { stage, element, point }, k, _) = meaning else { continue };
            let at_start = stage == 0 && element.is_none();
            let at_end = stage == last && element == Some(last_element) && point.is_none_or(|i| i + 1 == n_s);
            let guard = k.checked_sub(n_user).and_then(|k| self.guards.get(k)).copied();
            let of_grid = guard.is_none() && self.place_of(k) == Some(PathAt::ControlGrid);
            let again = match guard {
                Some(t) => {
                    let made = |p: Option<Passage>| p.is_some_and(|p| p.transition == t);
                    let watched = before.is_some_and(|l| l.guards.contains(&t));
                    (at_end && made(self.ends)) || (at_start && (made(self.begins) || (continues && watched)))
                }
                None if of_grid => {
                    (at_start && self.begins.is_some_and(|p| !p.at_once)) || (at_end && self.ends.is_some())
                }
                None => at_start && continues,
            };
            if again || (self.ends_at_once() && stage == last) {
                rows.push(row);
            }
        }
        rows
    }
}

/// Lengths of the parts of stages within a span of time, and the time at which it begins.
fn pieces(whole: &Ocp, guess: &Guess, stages: std::ops::Range<usize>, span: [f64; 2]) -> (Vec<f64>, f64) {
    let mut lengths = Vec::new();
    for k in stages {
        let (from, to) = guess.stage(k);
        lengths.push((to.min(span[1]) - from.max(span[0])).max(SHORT * (to - from)));
    }
    (lengths, whole.t0 + span[0])
}
