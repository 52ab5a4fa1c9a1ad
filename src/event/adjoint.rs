//! Adjoint sensitivities: the transpose of every operation of [`sens`](super::sens), in reverse order.

pub(super) mod along;

use super::collocation::Collocation;
use super::explicit::{self, Pair};
use super::field::{Field, Rows, StagesOf};
use super::radau::Radau;
use super::step::Stages;
use super::tape::{Entry, Tape, Time};
use crate::error::{finite, Error, Result};
use crate::func::{EvalError, EvalResult};
use crate::stop;

/// A part of the function whose gradient is wanted, beside what depends on the final state.
#[derive(Debug, Clone, PartialEq)]
pub enum Term {
    /// Depends on the state at time `t`, with derivative `v`. The run has to stop there ([`Engine::advance`]); where
    /// something happens at that time, it is the state that the stop shows, behind it.
    ///
    /// [`Engine::advance`]: super::Engine::advance
    State {
        /// The time.
        t: f64,
        /// The derivative, one value per state.
        v: Vec<f64>,
    },
    /// Depends on the time of a switch.
    Switch {
        /// Its place in the log.
        index: usize,
        /// The derivative.
        weight: f64,
    },
    /// Depends on the time of a transition.
    Jump {
        /// Its place in the log.
        index: usize,
        /// The derivative.
        weight: f64,
    },
}

/// A gradient. What it has no value for is NaN: data that part contacts which close together, whose order decides what follows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Gradient {
    /// With respect to the initial state.
    pub x0: Vec<f64>,
    /// With respect to the parameters, changed by the same amount over the whole run.
    pub p: Vec<f64>,
    /// With respect to the controls, changed by the same amount over the whole run.
    pub u: Vec<f64>,
}

/// The state of a sweep.
struct Sweep<'a> {
    tape: &'a Tape,
    radau: &'a Radau,
    field: &'a mut Field,
    /// Derivative with respect to the state.
    v: Vec<f64>,
    /// With respect to parameters and controls.
    g: Vec<f64>,
    collocation: Collocation,
    x: Vec<f64>,
    /// Derivatives with respect to the derivatives at a stage, to the arguments of all stages, or to all unknowns.
    w: Vec<f64>,
    y: Vec<f64>,
    /// Derivatives at the stages of a step by component, and the Jacobians there.
    k: Vec<Stages>,
    jacobians: Vec<Rows>,
}

/// Time, length, the part of it that is gone, and what comes behind its end, of a step.
type Times = (f64, f64, f64, f64);

/// Derivatives that are this share of the sizes of their terms are zero.
const ROUNDING: f64 = 1e-9;

/// What is followed back.
#[derive(Clone, Copy, PartialEq)]
enum Sought {
    Gradient,
    /// What parts contacts that close together, and the sizes of its terms.
    Parts,
    Sizes,
}

/// Goes back over the tape from the derivative `v` with respect to the final state. Leaves active set, parameters and
/// controls of the field changed.
pub(super) fn sweep(tape: &Tape, radau: &Radau, field: &mut Field, v: &[f64], terms: &[Term]) -> Result<Gradient> {
    let mut found = back(tape, radau, field, v, terms, Sought::Gradient)?;
    if tape.entries.iter().any(|e| matches!(e, Entry::Part { .. })) {
        let none = vec![0.0; v.len()];
        let mut seek = |what| back(tape, radau, field, &none, &[], what);
        let (parts, sizes) = (seek(Sought::Parts)?, seek(Sought::Sizes)?);
        let lose = |g: &mut [f64], part: &[f64], size: &[f64]| {
            let each = g.iter_mut().zip(part.iter().zip(size));
            each.filter(|(_, (p, s))| p.abs() > ROUNDING * s.abs()).for_each(|(g, _)| *g = f64::NAN);
        };
        lose(&mut found.x0, &parts.x0, &sizes.x0);
        lose(&mut found.p, &parts.p, &sizes.p);
        lose(&mut found.u, &parts.u, &sizes.u);
    }
    Ok(found)
}

fn back(tape: &Tape, radau: &Radau, field: &mut Field, v: &[f64], terms: &[Term], sought: Sought) -> Result<Gradient> {
    let nx = field.nx;
    let mut terms = Terms::sorted(tape, nx, terms)?;
    let mut s = Sweep::new(tape, radau, field, v);
    for (i, e) in tape.entries.iter().enumerate().rev() {
        stop::check()?;
        let r = match *e {
            Entry::Data { .. } => {
                s.load(i);
                Ok(())
            }
            Entry::Explicit { at, set, t, h, part, end, rest, pair } => {
                terms.add_states(end, &mut s.v);
                s.enter(set);
                s.explicit(&tape.data[at..], (t, h, part, rest), pair)
            }
            Entry::Implicit { at, set, t, h, end } => {
                terms.add_states(end, &mut s.v);
                s.enter(set);
                s.implicit(at, t, h)
            }
            Entry::Switch { at, first, time, .. } => {
                let weight = terms.take_switches(first);
                match (time, weight) {
                    (Time::Moves, w) => s.switch(&tape.data[at..], w.unwrap_or(0.0)),
                    (Time::Unknown, Some(_)) => {
                        let why = "switches accumulate before it";
                        return Err(Error::State(format!("the time of switch {first} has no derivative: {why}")));
                    }
                    _ => {}
                }
                Ok(())
            }
            Entry::Jump { at, first, log, n, .. } => {
                let weight = terms.take_switches(first).unwrap_or(0.0) + terms.take_jumps(log);
                s.jump(&tape.data[at..], n, weight);
                Ok(())
            }
            Entry::Part { at, n } => {
                match sought {
                    Sought::Gradient => {}
                    Sought::Parts => s.part(at, n),
                    Sought::Sizes => s.part(at + n, n),
                }
                Ok(())
            }
            Entry::Gap { t } => {
                let why = "steps through accumulating switches have no derivatives";
                return Err(Error::State(format!("t = {t}: {why}")));
            }
            Entry::Stop { t } => {
                terms.add_states(t, &mut s.v);
                Ok(())
            }
            Entry::Project { at, set, t } => {
                s.enter(set);
                let known = s.field.hidden(t, &tape.data[at..at + nx]);
                known.map(|()| s.project())
            }
        };
        recovered(r)?;
    }
    terms.add_states(tape.start, &mut s.v);
    if let Some((t, _)) = terms.states.last() {
        return Err(Error::Range(format!("the run has no stop at t = {t}: advance to that time first")));
    }
    let u = s.g.split_off(s.field.p.len());
    Ok(Gradient { x0: s.v, p: s.g, u })
}

fn recovered(r: EvalResult) -> Result<()> {
    r.map_err(|e| match e {
        EvalError::Recoverable => Error::NonFinite("a derivative of the model has no value along the run".into()),
        EvalError::Fatal(code) => Error::User { code, what: "a function of the model".into() },
        EvalError::Stopped => stop::error(),
    })
}

/// The terms in the order of time; the last ones are taken first.
struct Terms<'a> {
    states: Vec<(f64, &'a [f64])>,
    switches: Vec<(usize, f64)>,
    jumps: Vec<(usize, f64)>,
}

impl<'a> Terms<'a> {
    fn sorted(tape: &Tape, nx: usize, terms: &'a [Term]) -> Result<Terms<'a>> {
        let mut out = Terms { states: Vec::new(), switches: Vec::new(), jumps: Vec::new() };
        let first = |e: &Entry| {
            if let Entry::Switch { first, .. } | Entry::Jump { first, .. } = e {
                Some(*first)
            } else {
                None
            }
        };
        let least = tape.entries.iter().find_map(first).unwrap_or(usize::MAX);
        for term in terms {
            match term {
                Term::State { t, v } => {
                    finite("time of a term", &[*t], 1)?;
                    finite("derivative of a term", v, nx)?;
                    out.states.push((*t, v));
                }
                Term::Jump { index, weight } => {
                    finite("weight of a term", &[*weight], 1)?;
                    out.jumps.push((*index, *weight));
                }
                Term::Switch { index, weight } => {
                    finite("weight of a term", &[*weight], 1)?;
                    if *index < least {
                        return Err(Error::Range(format!("switch {index} is not in the log of the run")));
                    }
                    out.switches.push((*index, *weight));
                }
            }
        }
        out.jumps.sort_by_key(|s| s.0);
        out.states.sort_by(|a, b| a.0.total_cmp(&b.0));
        out.switches.sort_by_key(|s| s.0);
        Ok(out)
    }

    fn add_states(&mut self, end: f64, v: &mut [f64]) {
        while let Some((_, w)) = self.states.last().filter(|(t, _)| *t == end) {
            v.iter_mut().zip(*w).for_each(|(v, w)| *v += w);
            self.states.pop();
        }
    }

    /// Sum of the weights of the switches from `first` on.
    fn take_switches(&mut self, first: usize) -> Option<f64> {
        take(&mut self.switches, first)
    }

    /// Sum of the weights of the transitions from `first` on.
    fn take_jumps(&mut self, first: usize) -> f64 {
        take(&mut self.jumps, first).unwrap_or(0.0)
    }
}

/// Takes those from `first` on and adds their weights up.
fn take(weights: &mut Vec<(usize, f64)>, first: usize) -> Option<f64> {
    let from = weights.partition_point(|(i, _)| *i < first);
    let taken = weights.split_off(from);
    (!taken.is_empty()).then(|| taken.iter().map(|s| s.1).sum())
}

impl<'a> Sweep<'a> {
    fn new(tape: &'a Tape, radau: &'a Radau, field: &'a mut Field, v: &[f64]) -> Sweep<'a> {
        let (nx, n_z) = (field.nx, field.n_z);
        let most = field.n_cells.saturating_sub(field.subs.len());
        let mut s = Sweep {
            v: v.to_vec(),
            g: vec![0.0; n_z - 1 - nx],
            collocation: Collocation::new(nx, n_z, most),
            x: vec![0.0; nx],
            w: vec![0.0; 3 * (nx + most)],
            y: vec![0.0; 13 * nx],
            k: vec![[0.0; 16]; nx],
            jacobians: Vec::new(),
            tape,
            radau,
            field,
        };
        s.load(tape.entries.len());
        s
    }

    /// Parameters and controls as they were before entry `i`.
    fn load(&mut self, i: usize) {
        let at = |e: &Entry| if let Entry::Data { at } = e { Some(*at) } else { None };
        let Some(at) = self.tape.entries[..i].iter().rev().find_map(at) else { return };
        let (np, nu) = (self.field.p.len(), self.field.u.len());
        self.field.p.copy_from_slice(&self.tape.data[at..at + np]);
        self.field.u.copy_from_slice(&self.tape.data[at + np..at + np + nu]);
        self.field.forget();
    }

    fn enter(&mut self, set: usize) {
        if self.field.active != self.tape.sets[set] {
            self.field.set_active(&self.tape.sets[set]);
        }
    }

    /// Takes the Jacobians of a step at its stages from what is recorded of it. The weights of its dense output, where it ends there.
    fn read_step(
        &mut self,
        data: &[f64],
        (t, h, part, rest): Times,
        pair: Pair,
    ) -> std::result::Result<Option<Stages>, EvalError> {
        let nx = self.field.nx;
        let last = pair.rows().0.len() - 1;
        let (x0, rest_of) = data.split_at(nx);
        let inside = (part < 1.0).then(|| explicit::weights_at(pair, part));
        let (derivatives, traces) = rest_of.split_at((last + usize::from(inside.is_some())) * nx);
        for (j, own) in derivatives.chunks_exact(nx).enumerate() {
            self.k.iter_mut().zip(own).for_each(|(k, v)| k[j] = *v);
        }
        self.field.read_traces(last, traces);
        let n = last + usize::from(rest != 0.0 || inside.is_some());
        let stages = StagesOf { pair, t, h, x0, k: &self.k, n };
        self.field.linearise_stages(&stages, &mut self.jacobians)?;
        Ok(inside)
    }

    /// Where a step ends that is put onto surfaces there, the field stands there then; says whether it is.
    fn stand_at_end(
        &mut self,
        x0: &[f64],
        (t, h, part): (f64, f64, f64),
        pair: Pair,
        inside: Option<&Stages>,
    ) -> std::result::Result<bool, EvalError> {
        if !self.field.asks_for_weights() || self.field.is_explicit_only() {
            return Ok(false);
        }
        let last = pair.rows().0.len() - 1;
        match inside {
            Some(weights) => {
                for ((x, x0), k) in self.x.iter_mut().zip(x0).zip(&self.k) {
                    *x = x0 + h * weights.iter().zip(k).map(|(w, k)| w * k).sum::<f64>();
                }
            }
            None => StagesOf { pair, t, h, x0, k: &self.k, n: last }.point(last, &mut self.x),
        }
        self.field.hidden(t + part * h, &self.x)?;
        Ok(true)
    }

    /// The transpose of `K_i = J_i (S + h Σ_j a_ij K_j)`, `S⁺ = S + h Σ_j b_j K_j`, of the rest behind the end, and in a sliding mode of
    /// the projection onto the surfaces there. Where only a part of the step is gone the `b_j` are those of its dense output.
    fn explicit(&mut self, data: &[f64], (t, h, part, rest): Times, pair: Pair) -> EvalResult {
        let (nx, last_column) = (self.field.nx, self.field.n_z - 1);
        let rows = pair.rows().0;
        let last = rows.len() - 1;
        let inside = self.read_step(data, (t, h, part, rest), pair)?;
        if self.stand_at_end(&data[..nx], (t, h, part), pair, inside.as_ref())? {
            self.project();
        }
        for i in (0..=last).rev() {
            let w = &mut self.w[..nx];
            w.fill(0.0);
            if i == last && inside.is_none() {
                self.y[i * nx..(i + 1) * nx].copy_from_slice(&self.v);
                if rest == 0.0 {
                    continue;
                }
                w.iter_mut().zip(&self.v).for_each(|(w, v)| *w = rest * v);
            } else {
                self.y[i * nx..(i + 1) * nx].fill(0.0);
                for (l, row) in rows.iter().enumerate().skip(i + 1) {
                    if let Some((_, a)) = row.iter().find(|(j, _)| *j == i) {
                        w.iter_mut().zip(&self.y[l * nx..]).for_each(|(w, y)| *w += h * a * y);
                    }
                }
                if let Some(weights) = &inside {
                    w.iter_mut().zip(&self.v).for_each(|(w, v)| *w += h * weights[i] * v);
                }
            }
            let (rows, y) = (&self.jacobians[i], &mut self.y[i * nx..(i + 1) * nx]);
            for (m, w) in self.w[..nx].iter().enumerate().filter(|(_, w)| **w != 0.0) {
                for (z, v) in rows.entries(m).filter(|e| e.0 < last_column) {
                    let to = if z < nx { &mut y[z] } else { &mut self.g[z - nx] };
                    *to += w * v;
                }
            }
        }
        if inside.is_none() {
            self.v.fill(0.0);
        }
        for y in self.y[..(last + 1) * nx].chunks_exact(nx) {
            self.v.iter_mut().zip(y).for_each(|(v, y)| *v += y);
        }
        Ok(())
    }

    fn implicit(&mut self, at: usize, t: f64, h: f64) -> EvalResult {
        let (nx, n_z) = (self.field.nx, self.field.n_z);
        let own = nx + self.field.n_alg();
        let (x0, z) = self.tape.data[at..at + nx + 3 * own].split_at(nx);
        let z = [&z[..own], &z[own..2 * own], &z[2 * own..]];
        self.collocation.assemble(self.radau, self.field, (t, h), x0, z)?;
        let w = &mut self.w[..3 * own];
        w.fill(0.0);
        w[2 * own..2 * own + nx].copy_from_slice(&self.v);
        self.collocation.lu.solve_transposed(w);
        for (i, w) in w.chunks_exact(own).enumerate() {
            for (w, row) in w[..nx].iter().zip(self.collocation.jac(i).chunks_exact(n_z)) {
                add_row(*w, row, &mut self.v, &mut self.g);
            }
            for (w, row) in w[nx..].iter().zip(self.collocation.g(i).chunks_exact(n_z)) {
                add_row(-w, row, &mut self.v, &mut self.g);
            }
        }
        Ok(())
    }

    /// The transpose of `S⁺ = S + (ẋ⁻ − ẋ⁺) dt`.
    fn switch(&mut self, data: &[f64], weight: f64) {
        let (nx, n_c) = (self.field.nx, self.field.n_z - 1);
        let (row, jump) = data[..n_c + nx].split_at(n_c);
        let w = self.v.iter().zip(jump).fold(weight, |w, (v, j)| w + v * j);
        add_row(w, row, &mut self.v, &mut self.g);
    }

    /// The transpose of `S⁺ = r_x (S + f⁻ dt) + r_p + r_t dt − f⁺ dt`, with `n` resets one after the other.
    fn jump(&mut self, data: &[f64], n: usize, weight: f64) {
        let (nx, n_c) = (self.field.nx, self.field.n_z - 1);
        let (row, rest) = data.split_at(n_c);
        let (before, rest) = rest.split_at(nx);
        let (after, resets) = rest.split_at(nx);
        let dot = |v: &[f64], f: &[f64]| v.iter().zip(f).map(|(v, f)| v * f).sum::<f64>();
        let mut w = weight - dot(&self.v, after);
        for jac in resets[..n * nx * (n_c + 1)].chunks_exact(nx * (n_c + 1)).rev() {
            let behind = std::mem::replace(&mut self.v, vec![0.0; nx]);
            for (v, r) in behind.iter().zip(jac.chunks_exact(n_c + 1)) {
                add_row(*v, &r[..n_c], &mut self.v, &mut self.g);
                w += v * r[n_c];
            }
        }
        w += dot(&self.v, before);
        add_row(w, row, &mut self.v, &mut self.g);
    }

    /// Adds rows, of `n` numbers, with weights that do not cancel.
    fn part(&mut self, at: usize, n: usize) {
        let n_c = self.field.n_z - 1;
        for (k, row) in self.tape.data[at..at + n].chunks_exact(n_c).enumerate() {
            add_row(1.0 + (0.618_034 * k as f64).fract(), row, &mut self.v, &mut self.g);
        }
    }

    /// The transpose of `S⁺ = S − D (C D)⁻¹ C S` where the field stands.
    fn project(&mut self) {
        let (nx, n_z, r) = (self.field.nx, self.field.n_z, self.field.n_alg());
        for b in 0..r {
            self.w[b] = self.field.d(b).map(|(a, d)| d * self.v[a]).sum();
        }
        self.field.solve_constraints_transposed(&mut self.w[..r]);
        for (b, w) in self.w[..r].iter().enumerate() {
            for (i, c) in self.field.c(b).filter(|c| c.0 < n_z - 1) {
                let to = if i < nx { &mut self.v[i] } else { &mut self.g[i - nx] };
                *to -= w * c;
            }
        }
    }
}

/// Adds `w` times a row of derivatives with respect to state, parameters, controls (and time).
fn add_row(w: f64, row: &[f64], v: &mut [f64], g: &mut [f64]) {
    let (x, rest) = row.split_at(v.len());
    v.iter_mut().zip(x).for_each(|(v, a)| *v += w * a);
    g.iter_mut().zip(rest).for_each(|(g, a)| *g += w * a);
}
