//! The discrete part of a system: which transitions may follow each other, and which sequences are next to one.

use crate::func::{Dims, Point};
use crate::system::{System, Transition};

/// A transition that is made, one of a sequence.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Passage {
    /// Which one, in the order they were added to the system.
    pub transition: usize,
    /// The control stage it is made in.
    pub stage: usize,
    /// Its guard does not pass zero: it is beyond zero where its discrete state begins, or where the control changes.
    pub at_once: bool,
}

/// Transitions made one after the other.
pub(super) type Sequence = Vec<Passage>;

/// Transitions made at one place one after the other, at most.
const CHAIN: usize = 64;
/// Stages between the two transitions of a pair that is put in, at most.
const PAIR_REACH: usize = 3;

/// The transitions of a system, its discrete states, the values they begin with and those they may have.
pub(super) struct Automaton {
    pub transitions: Vec<Transition>,
    /// The discrete states, ascending.
    pub states: Vec<usize>,
    initial: Vec<f64>,
    bounds: [Vec<f64>; 2],
    /// Of guards that are constant: do they hold?
    constant: Vec<Option<bool>>,
}

impl Automaton {
    /// Of a system whose discrete states begin with the values they have in `x0[nx]` and stay within `bounds`, `[nx]` each.
    pub fn new(system: &System, x0: &[f64], bounds: &[Vec<f64>; 2]) -> Automaton {
        let states = system.discrete_states();
        let of = |v: &[f64]| -> Vec<f64> { states.iter().map(|&i| v[i]).collect() };
        let constant = system.transitions().iter().map(|t| constant_guard(t, system.dims())).collect();
        Automaton {
            transitions: system.transitions().to_vec(),
            initial: of(x0),
            bounds: [of(&bounds[0]), of(&bounds[1])],
            constant,
            states,
        }
    }

    /// Is it watched while the discrete states have these values?
    pub fn is_armed(&self, transition: usize, values: &[f64]) -> bool {
        let has = |&(state, value): &(usize, f64)| self.value(values, state) == Some(value);
        self.transitions[transition].from.iter().all(has)
    }

    /// Does its guard say nothing, since it is constant?
    pub fn is_constant(&self, transition: usize) -> bool {
        self.constant[transition].is_some()
    }

    /// Can a change of controls or parameters take its guard beyond zero?
    pub fn knows_controls(&self, transition: usize) -> bool {
        let f = &self.transitions[transition].guard;
        let d = f.dims();
        (d.x..d.t_col()).any(|column| !f.jac_pattern().rows(column).is_empty())
    }

    fn value(&self, values: &[f64], state: usize) -> Option<f64> {
        self.states.iter().position(|s| *s == state).map(|k| values[k])
    }

    fn made(&self, transition: usize, values: &mut [f64]) {
        for &(state, value) in &self.transitions[transition].to {
            if let Some(k) = self.states.iter().position(|s| *s == state) {
                values[k] = value;
            }
        }
    }

    /// The sequence with the transitions that follow of themselves, as their guards hold always; `None` where it cannot be:
    /// a transition that is not watched then, values beyond their bounds, transitions that follow each other for ever.
    pub fn complete(&self, sequence: &[Passage]) -> Option<Sequence> {
        let mut out = Vec::new();
        let mut values = self.initial.clone();
        let (mut stage, mut chain) = (0, 0);
        let mut given = sequence.iter().filter(|p| !self.is_constant(p.transition)).peekable();
        loop {
            let holds = |t: &usize| self.constant[*t] == Some(true) && self.is_armed(*t, &values);
            let before = out.last().map(|p: &Passage| p.transition);
            let follows = (0..self.transitions.len()).find(holds).filter(|t| Some(*t) != before);
            let next = match follows {
                Some(transition) => {
                    chain += 1;
                    Passage { transition, stage, at_once: true }
                }
                None => match given.next() {
                    Some(p) => *p,
                    None => return self.values(&out).map(|_| out),
                },
            };
            if chain > CHAIN || !self.is_armed(next.transition, &values) {
                return None;
            }
            if follows.is_none() {
                (stage, chain) = (next.stage, 0);
            }
            self.made(next.transition, &mut values);
            out.push(next);
        }
    }

    /// Values of the discrete states before every passage and behind the last one.
    pub fn values(&self, sequence: &[Passage]) -> Option<Vec<Vec<f64>>> {
        let mut now = self.initial.clone();
        let mut all = vec![now.clone()];
        for p in sequence {
            if !self.is_armed(p.transition, &now) {
                return None;
            }
            self.made(p.transition, &mut now);
            all.push(now.clone());
        }
        let [lower, upper] = &self.bounds;
        let inside = |v: &Vec<f64>| v.iter().zip(lower.iter().zip(upper)).all(|(v, (l, u))| l <= v && v <= u);
        // the initial value has bounds of its own
        all[1..].iter().all(inside).then_some(all)
    }

    /// Sequences next to one, complete: a transition a stage earlier or later, one or two left out, one or two put in.
    /// `near(transition, stage)`: may it be worth a try to make this transition in that stage?
    pub fn neighbours(&self, of: &[Passage], n_stages: usize, near: &dyn Fn(usize, usize) -> bool) -> Vec<Sequence> {
        let base: Sequence = of.iter().copied().filter(|p| !self.is_constant(p.transition)).collect();
        let mut raw = shifted(&base, n_stages);
        for j in 0..base.len() {
            for n in 1..=2.min(base.len() - j) {
                raw.push([&base[..j], &base[j + n..]].concat());
            }
            if j > 0 && j + 2 < base.len() {
                raw.push(base[..j].to_vec());
            }
            if base[j].at_once {
                let mut s = base.clone();
                s[j].at_once = false;
                raw.push(s);
            }
        }
        self.put_in(&base, n_stages, near, &mut raw);
        let mut out: Vec<Sequence> = Vec::new();
        for s in raw {
            if let Some(s) = self.complete(&s).filter(|s| s != of && !out.contains(s)) {
                out.push(s);
            }
        }
        out
    }

    /// Adds the sequences with one or two more transitions.
    fn put_in(&self, base: &[Passage], n_stages: usize, near: &dyn Fn(usize, usize) -> bool, out: &mut Vec<Sequence>) {
        let free: Vec<usize> = (0..self.transitions.len()).filter(|t| !self.is_constant(*t)).collect();
        let passage = |transition: usize, stage: usize| Passage { transition, stage, at_once: false };
        for j in 0..=base.len() {
            let first = if j == 0 { 0 } else { base[j - 1].stage };
            let last = base.get(j).map_or(n_stages - 1, |p| p.stage);
            for k in first..=last {
                for &a in free.iter().filter(|a| near(**a, k)) {
                    out.push([&base[..j], &[passage(a, k)], &base[j..]].concat());
                    for l in k..=last.min(k + PAIR_REACH) {
                        for &b in &free {
                            out.push([&base[..j], &[passage(a, k), passage(b, l)], &base[j..]].concat());
                        }
                    }
                }
            }
        }
    }

    /// The sequence in words: `transition 0 in stage 2, ...`.
    pub fn text(&self, sequence: &[Passage]) -> String {
        let one = |p: &Passage| format!("transition {} in stage {}", p.transition, p.stage);
        match sequence {
            [] => "no transition".to_owned(),
            s => s.iter().map(one).collect::<Vec<_>>().join(", "),
        }
    }
}

/// Sequences with a transition one stage earlier or later, and with it those of the same stage that are in its way.
fn shifted(base: &[Passage], n_stages: usize) -> Vec<Sequence> {
    let mut out = Vec::new();
    for (j, p) in base.iter().enumerate() {
        // what follows at once goes along
        let mut end = j + 1;
        while base.get(end).is_some_and(|q| q.at_once && q.stage == p.stage) {
            end += 1;
        }
        if p.stage > 0 {
            let mut s = base.to_vec();
            s[..end].iter_mut().filter(|q| q.stage == p.stage).for_each(|q| q.stage -= 1);
            out.push(s);
        }
        if p.stage + 1 < n_stages {
            let mut s = base.to_vec();
            s[j..].iter_mut().filter(|q| q.stage == p.stage).for_each(|q| q.stage += 1);
            out.push(s);
        }
    }
    out
}

/// Does the guard of a transition hold, if it depends on nothing?
fn constant_guard(t: &Transition, d: Dims) -> Option<bool> {
    if t.guard.jac_pattern().nnz() > 0 {
        return None;
    }
    let (x, u, p) = (vec![0.0; d.x], vec![0.0; d.u], vec![0.0; d.p]);
    let mut value = [f64::NAN];
    let at = Point { t: 0.0, x: &x, u: &u, p: &p };
    t.guard.value(&at, &mut value, &mut vec![0.0; t.guard.work_len()]).ok()?;
    Some(value[0] * t.direction.sign() > 0.0)
}
