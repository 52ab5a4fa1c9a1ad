//! Algebraic states of index 1: they follow the others, wherever a state is looked at.
//!
//! Every function of the system has them eliminated ([`System::eliminated`](crate::system::System)), so the method moves the other
//! states alone. Within a step the last `nz` places of the state keep the solution at its start, which is the guess for Newton's
//! method; what leaves the engine has the solution at its own point.
//!
//! Subsystems that switch inside of the equations have their mode in a state behind those, which transitions change, and behind all of them the
//! weight of a surface that is held, as a guess too. Outside of the engine there are neither these states nor these transitions: they are switches
//! of their subsystems.

use std::ops::Range;
use std::sync::Arc;

use super::{recover, Engine, EPS};
use crate::error::{Error, Result};
use crate::event::adjoint::along::Along;
use crate::event::adjoint::{Gradient, Term};
use crate::event::path::Path;
use crate::event::step::{derivative, horner, Poly, Step};
use crate::event::watch::Watch;
use crate::event::{Ambiguity, Kind, Outcome, Switch};
use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::lu::Lu;
use crate::system::{Algebraic, Elimination, Guess, SharedFunction, System};

/// Polynomials of the dense output have so many coefficients, and go through as many points.
const NODES: usize = 8;
/// Points between the nodes at which a polynomial is compared with the solution.
const BETWEEN: [usize; 3] = [0, 3, 6];
/// What is said of steps of inclusions where the option asks for it.
const NOT_UNIQUE: &str = "the continuation is not unique: the step of an inclusion stays on its surface for several weights, or may also leave it";
/// Part of the tolerances that a polynomial may be wrong by.
const SHARE: f64 = 0.1;
/// A step is divided so often at most.
const DEPTH: u32 = 6;

/// A point at which a caller may ask for derivatives of a function of the state.
struct Stop {
    t: f64,
    x: Vec<f64>,
    u: Vec<f64>,
    p: Vec<f64>,
}

/// The algebraic states, and what they follow.
pub(super) struct Follower {
    equations: Arc<Algebraic>,
    unknowns: SharedFunction,
    /// The algebraic states.
    z: Range<usize>,
    /// States of the system, modes behind them, and both with the weights behind those.
    nx: usize,
    n_modes: usize,
    n_all: usize,
    /// Transitions of the system; those behind them change modes.
    n_transitions: usize,
    /// The numbers of subsystems that switch: of those in the equations, and of the others.
    own_subsystems: Vec<usize>,
    other_subsystems: Vec<usize>,
    /// Derivatives of the states without the modes.
    sensitivity: Vec<f64>,
    /// They are consistent with the present state.
    pub(super) settled: bool,
    /// Relative places of the nodes, and the factors of their powers.
    nodes: [f64; NODES],
    powers: Lu<f64>,
    x: Vec<f64>,
    jac: Vec<f64>,
    hess: Vec<f64>,
    work: Vec<f64>,
    /// Where the run was asked for its state, if it is recorded.
    stops: Vec<Stop>,
}

/// What is sought by the states that move: derivatives with respect to the final one, terms, and what parameters and controls add to
/// the gradient on no other way than by the algebraic states.
pub(super) struct Folded {
    pub(super) v: Vec<f64>,
    pub(super) terms: Vec<Term>,
    pub(super) direct: Gradient,
}

/// Derivatives of a function of the algebraic states at one point.
struct Slope {
    /// By states, parameters, controls, time.
    x: Vec<f64>,
    p: Vec<f64>,
    u: Vec<f64>,
    t: f64,
}

impl Follower {
    pub(super) fn new(e: &Elimination, system: &System) -> Follower {
        let switching: Vec<usize> =
            system.subsystems().iter().enumerate().filter(|s| s.1.n_modes > 1).map(|s| s.0).collect();
        let own: Vec<usize> = e.algebraic.loops().collect();
        // behind subsystems contacts switch, and behind those the steps of inclusions
        let n_subsystems = system.subsystems().len();
        let n_contacts = system.mechanics().map_or(0, |m| m.contacts.len());
        let steps = own.iter().filter(|k| **k >= n_subsystems).map(|k| k + n_contacts);
        let contacts = n_subsystems..n_subsystems + n_contacts;
        let switching: Vec<usize> = switching.into_iter().chain(contacts).chain(steps).collect();
        let is_step = |k: usize| k >= n_subsystems + n_contacts;
        let numbers = |is_own: bool| {
            let all = switching.iter().enumerate();
            let is = |k: usize| is_step(k) || k < n_subsystems && own.contains(&k);
            all.filter(|(_, k)| is(**k) == is_own).map(|(n, _)| n).collect::<Vec<usize>>()
        };
        let nodes = std::array::from_fn(|k| {
            let angle = std::f64::consts::PI * k as f64 / (NODES - 1) as f64;
            0.5 * (1.0 - angle.cos())
        });
        let mut powers = Lu::with_capacity(NODES);
        let m = powers.clear(NODES);
        for (row, s) in m.chunks_exact_mut(NODES).zip(nodes) {
            row.iter_mut().fold(1.0, |power, v| {
                *v = power;
                power * s
            });
        }
        let regular = powers.factorise();
        debug_assert!(regular, "the nodes differ");
        let f = &e.unknowns;
        Follower {
            z: e.algebraic.states(),
            nx: e.algebraic.n_states(),
            n_modes: own.len(),
            n_all: f.dims().x,
            n_transitions: system.transitions().len(),
            own_subsystems: numbers(true),
            other_subsystems: numbers(false),
            sensitivity: Vec::new(),
            equations: e.algebraic.clone(),
            settled: false,
            nodes,
            powers,
            x: vec![0.0; f.dims().x],
            jac: vec![0.0; f.jac_pattern().nnz()],
            hess: vec![0.0; f.hess_pattern().nnz()],
            work: vec![0.0; f.work_len()],
            unknowns: f.clone(),
            stops: Vec::new(),
        }
    }

    /// Derivatives of a time without those by the modes of subsystems in the equations, where there are any.
    pub(super) fn shown(follower: Option<&Follower>, dt: &[f64]) -> Vec<f64> {
        match follower.filter(|a| dt.len() >= a.n_all) {
            Some(a) => [&dt[..a.nx], &dt[a.n_all..]].concat(),
            None => dt.to_vec(),
        }
    }

    /// Another run begins.
    pub(super) fn reset(&mut self) {
        self.equations.forget();
        self.settled = false;
        self.stops.clear();
    }

    /// States of the system, without the modes of subsystems in the equations.
    pub(super) fn n_states(&self) -> usize {
        self.nx
    }

    /// Options about subsystems for those that the engine knows.
    pub(super) fn preferred(&self, all: &[Vec<usize>]) -> Vec<Vec<usize>> {
        let of = |k: &usize| all.get(*k).cloned().unwrap_or_default();
        if all.is_empty() {
            Vec::new()
        } else {
            self.other_subsystems.iter().map(of).collect()
        }
    }

    /// Is this a transition that changes the mode of a subsystem in the equations?
    pub(super) fn is_own(&self, transition: usize) -> bool {
        transition >= self.n_transitions
    }

    /// The number of a subsystem that the engine knows.
    pub(super) fn outer(&self, subsystem: usize) -> usize {
        self.other_subsystems.get(subsystem).copied().unwrap_or(subsystem)
    }

    /// Of all subsystems that switch what is known of those in the engine, with the modes of those in the equations.
    fn with_own(&self, x: &[f64], others: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
        let mut all = vec![Vec::new(); self.own_subsystems.len() + self.other_subsystems.len()];
        self.other_subsystems.iter().zip(others).for_each(|(k, modes)| all[*k] = modes);
        self.own_subsystems.iter().enumerate().for_each(|(i, k)| all[*k] = self.active(i, x));
        all
    }

    /// The active modes of a subsystem in the equations.
    fn active(&self, k: usize, x: &[f64]) -> Vec<usize> {
        self.equations.active(k, x[self.nx + k] as usize)
    }

    /// The algebraic states.
    pub(super) fn states(&self) -> Range<usize> {
        self.z.clone()
    }

    pub(super) fn complaint(&self) -> Option<String> {
        self.equations.complaint()
    }

    /// Replaces the guess in `x` by the solution, NaN where there is none. `modes` are those of the subsystems in the equations with the weights
    /// behind them, if they do not stand behind the states.
    pub(super) fn show(&self, t: f64, x: &mut [f64], modes: &[f64], u: &[f64], p: &[f64]) {
        let solved = if x.len() == self.n_all {
            self.equations.solve(t, x, u, p, Guess::Near)
        } else {
            let mut whole = x.to_vec();
            whole.extend_from_slice(modes);
            let r = self.equations.solve(t, &mut whole, u, p, Guess::Near);
            x.copy_from_slice(&whole[..self.nx]);
            r
        };
        if solved.is_err() {
            x[self.z.clone()].fill(f64::NAN);
        }
    }

    /// Polynomials for the algebraic states over a step with dense output, calls `each(t, h, state, poly)` for one after the other.
    fn fit(
        &mut self,
        step: &Step,
        t1: f64,
        (u, p): (&[f64], &[f64]),
        tolerance: &dyn Fn(usize, f64) -> f64,
        each: &mut dyn FnMut(f64, f64, usize, &Poly),
    ) {
        let (z, nd) = (self.z.clone(), self.z.start);
        let mut x = std::mem::take(&mut self.x);
        let mut values = vec![[0.0; NODES]; z.len()];
        let mut parts = vec![(step.t, t1 - step.t, 0u32)];
        x.copy_from_slice(&step.x0);
        let mut start = step.x0[z.clone()].to_vec();
        while let Some((t, h, depth)) = parts.pop() {
            let mut guess = start.clone();
            let at = |time: f64, guess: &[f64], x: &mut [f64]| {
                step.at((time - step.t) / step.h, x);
                x[z.clone()].copy_from_slice(guess);
                self.show(time, x, &[], u, p);
            };
            for (k, s) in self.nodes.iter().enumerate() {
                at(t + s * h, &guess, &mut x);
                guess.copy_from_slice(&x[z.clone()]);
                values.iter_mut().zip(&x[z.clone()]).for_each(|(v, z)| v[k] = *z);
            }
            let end = guess.clone();
            let mut polys: Vec<Poly> = Vec::with_capacity(z.len());
            for v in &values {
                let mut poly = *v;
                self.powers.solve(&mut poly);
                polys.push(poly);
            }
            let good = depth == DEPTH
                || BETWEEN.iter().all(|&k| {
                    let s = 0.5 * (self.nodes[k] + self.nodes[k + 1]);
                    let guess: Vec<f64> = values.iter().map(|v| v[k]).collect();
                    step.at((t + s * h - step.t) / step.h, &mut x);
                    x[z.clone()].copy_from_slice(&guess);
                    self.show(t + s * h, &mut x, &[], u, p);
                    polys.iter().enumerate().all(|(i, poly)| {
                        let v = x[nd + i];
                        let apart = (horner(poly, s) - v).abs();
                        // what has no value is not looked at closer
                        v.is_nan() || apart <= (SHARE * tolerance(nd + i, v)).max(64.0 * EPS * v.abs())
                    })
                });
            if good {
                polys.iter().enumerate().for_each(|(i, poly)| each(t, h, nd + i, poly));
                start.copy_from_slice(&end);
            } else {
                parts.push((t + 0.5 * h, 0.5 * h, depth + 1));
                parts.push((t, 0.5 * h, depth + 1));
            }
        }
        self.x = x;
    }

    /// Derivatives of `v` times the algebraic states.
    fn slope(&mut self, at: &Point, v: &[f64]) -> std::result::Result<Slope, EvalError> {
        let f = &self.unknowns;
        let d = f.dims();
        f.jacobian(at, &mut self.jac, &mut self.work)?;
        let mut all = vec![0.0; d.n_in()];
        for (c, entries) in f.jac_pattern().columns() {
            all[c] = entries.map(|e| self.jac[e] * v[f.jac_pattern().row_idx()[e]]).sum();
        }
        Ok(Slope::of(all, d))
    }

    /// How these derivatives change in a direction, given by states, controls, parameters and time.
    fn bend(&mut self, at: &Point, v: &[f64], along: &[f64]) -> std::result::Result<Slope, EvalError> {
        let f = &self.unknowns;
        let d = f.dims();
        f.hessian(at, v, &mut self.hess, &mut self.work)?;
        let mut all = vec![0.0; d.n_in()];
        for (c, entries) in f.hess_pattern().columns() {
            for e in entries {
                let r = f.hess_pattern().row_idx()[e];
                all[r] += self.hess[e] * along[c];
                if r != c {
                    all[c] += self.hess[e] * along[r];
                }
            }
        }
        Ok(Slope::of(all, d))
    }

    /// Product of the Jacobian of the algebraic states with a direction.
    fn moved(&mut self, at: &Point, along: &[f64], out: &mut [f64]) -> EvalResult {
        let f = &self.unknowns;
        f.jacobian(at, &mut self.jac, &mut self.work)?;
        out.fill(0.0);
        for (c, entries) in f.jac_pattern().columns() {
            for e in entries {
                out[f.jac_pattern().row_idx()[e]] += self.jac[e] * along[c];
            }
        }
        Ok(())
    }
}

impl Slope {
    fn of(mut all: Vec<f64>, d: crate::func::Dims) -> Slope {
        let t = all.pop().unwrap_or(0.0);
        let p = all.split_off(d.x + d.u);
        let u = all.split_off(d.x);
        Slope { x: all, p, u, t }
    }
}

impl Engine {
    /// Algebraic states of the present point, from the user's guess at the start of a run. Says whether there are any.
    pub(super) fn settle_start(&mut self, first: bool) -> Result<bool> {
        let Some(a) = &mut self.algebraic else { return Ok(true) };
        let first = first && !a.settled;
        let Engine { x, field, .. } = self;
        let mut known = false;
        // near the guess, if there is a solution next to it, and any one otherwise
        for guess in [Guess::Jump, Guess::Far].into_iter().take(if first { 2 } else { 1 }) {
            known = recover(a.equations.find(self.t, x, &field.u, &field.p, guess), false)?;
            if known {
                break;
            }
        }
        a.settled |= known;
        field.guards.arm(x);
        let unique = !known || recover(a.equations.steps_are_unique((self.t, &field.u, &field.p), x), true)?;
        self.log.ambiguous |= !unique;
        self.log.one_sided |= !unique;
        if !unique && self.options.ambiguity == Ambiguity::Stop {
            self.fail(Outcome::Ambiguous, NOT_UNIQUE.into());
            return Ok(true);
        }
        let Some(a) = &mut self.algebraic else { return Ok(true) };
        let Engine { x, field, .. } = self;
        if known && self.derivatives.tape.is_some() {
            a.note_stop(self.t, x, &field.u, &field.p);
        }
        if !known && first {
            let why = a.complaint().unwrap_or_default();
            return Err(Error::Numeric(format!(
                "the run has no consistent start: {why}. The initial values of the algebraic states are the guess: give others; and where \
                 that matrix is always singular, the equations are not of index 1: differentiate them, or simulate the system with finite \
                 elements"
            )));
        }
        Ok(known)
    }

    /// The algebraic states at the present point, from those a little before.
    pub(super) fn settle(&mut self) -> EvalResult {
        let Some(a) = &self.algebraic else { return Ok(()) };
        a.equations.solve(self.t, &mut self.x, &self.field.u, &self.field.p, Guess::Near)
    }

    /// Those behind transition `guard`; where it gives them values, these are guesses. Behind one that changes a mode in the equations a surface
    /// may be held.
    pub(super) fn settle_reset(&mut self, guard: usize) -> EvalResult {
        let Some(a) = &self.algebraic else { return Ok(()) };
        let transition = &self.field.guards.all[guard].transition;
        let given = transition.reset.as_ref().is_some_and(|r| r.rows.iter().any(|i| a.z.contains(i)));
        let x = &mut self.derivatives.reset.x;
        if let (true, Some((state, before))) = (a.is_own(guard), transition.from.first()) {
            let own = (state - a.nx, *before as usize);
            return a.equations.solve_behind(own, self.t, x, &self.field.u, &self.field.p);
        }
        let near = a.equations.solve(self.t, x, &self.field.u, &self.field.p, Guess::Jump);
        match near {
            Err(EvalError::Recoverable) if given => {
                a.equations.solve(self.t, x, &self.field.u, &self.field.p, Guess::Far)
            }
            r => r,
        }
    }

    /// Puts states onto the surfaces that are held inside of the equations at the end of a step. Says whether they have moved; velocity and
    /// watched functions belong to the new state then.
    pub(super) fn settle_held(&mut self) -> Result<bool> {
        let Some(a) = self.algebraic.as_ref().filter(|a| a.settled && a.n_all > a.nx + a.n_modes) else {
            return Ok(false);
        };
        let mut x = std::mem::take(&mut self.x);
        let field = &self.field;
        let data = (self.t, &field.u[..], &field.p[..]);
        let moved = a.equations.settle_held(data, &mut x, &|i, v| field.size(i, v));
        self.x = x;
        if !recover(moved, false)? {
            return Ok(false);
        }
        let known = self.field.rhs(self.t, &self.x, &mut self.f).and_then(|()| self.field.watched(self.t, &self.x));
        recover(known.map(|()| true), false)
    }

    /// A call of [`Engine::step`] ends: what it shows has the solution at its point.
    pub(super) fn settle_end(&mut self, at_stop: bool) -> Result<()> {
        if self.algebraic.as_ref().is_none_or(|a| !a.settled) {
            return Ok(());
        }
        let r = self.settle();
        if !recover(r.map(|()| true), false)? {
            if self.log.outcome == Outcome::Reached {
                self.fail(
                    Outcome::NoContinuation,
                    "the algebraic equations have no solution next to that before".into(),
                );
            }
            return Ok(());
        }
        let recorded = self.derivatives.tape.is_some();
        if let Some(a) = self.algebraic.as_mut().filter(|_| recorded && at_stop) {
            a.note_stop(self.t, &self.x, &self.field.u, &self.field.p);
        }
        if let Some(mut s) = self.derivatives.sens.take() {
            let r = self.lift(&mut s.s, &s.dt);
            self.derivatives.sens = Some(s);
            self.log.one_sided |= !recover(r.map(|()| true), false)?;
        }
        Ok(())
    }

    /// Derivatives of the algebraic states in the rows of the sensitivities; the time of a run that a transition ended moves by `dt`.
    fn lift(&mut self, s: &mut [f64], dt: &[f64]) -> EvalResult {
        let Some(a) = &mut self.algebraic else { return Ok(()) };
        let (nx, np, nu) = (self.nx, self.field.p.len(), self.field.u.len());
        let n_c = s.len() / nx.max(1);
        let first = nx + np + nu - n_c;
        let modes = a.nx..nx;
        let at = Point { t: self.t, x: &self.x, u: &self.field.u, p: &self.field.p };
        let f = &a.unknowns;
        f.jacobian(&at, &mut a.jac, &mut a.work)?;
        let mut own = vec![0.0; a.z.len() * n_c];
        let ended = self.log.outcome == Outcome::Event;
        for (c, entries) in f.jac_pattern().columns() {
            for e in entries {
                let row = &mut own[f.jac_pattern().row_idx()[e] * n_c..][..n_c];
                let v = a.jac[e];
                if c < nx {
                    row.iter_mut().zip(&s[c * n_c..]).for_each(|(r, s)| *r += v * s);
                } else if c == nx + nu + np {
                    if ended {
                        row.iter_mut().zip(dt).for_each(|(r, d)| *r += v * d);
                    }
                } else {
                    // states, parameters, controls
                    let place = if c < nx + nu { c + np } else { c - nu };
                    if let Some(place) = place.checked_sub(first) {
                        row[place] += v;
                    }
                }
            }
        }
        s[a.z.start * n_c..a.z.end * n_c].copy_from_slice(&own);
        a.sensitivity.clear();
        if a.n_modes > 0 {
            for row in s[..a.nx * n_c].chunks_exact(n_c.max(1)) {
                let shown = row.iter().enumerate().filter(|(c, _)| !modes.contains(&(c + first)));
                a.sensitivity.extend(shown.map(|(_, v)| *v));
            }
        }
        Ok(())
    }

    /// States of the system, without the modes of subsystems in algebraic equations.
    #[inline]
    pub(super) fn n_shown(&self) -> usize {
        self.algebraic.as_ref().map_or(self.nx, |a| a.nx)
    }

    /// Modes of subsystems in algebraic equations, and of steps of inclusions.
    pub(super) fn n_own_modes(&self) -> usize {
        self.algebraic.as_ref().map_or(0, |a| a.n_modes)
    }

    /// Derivatives of the states without those modes, where there are any.
    pub(super) fn shown_sensitivity(&self) -> Option<&[f64]> {
        self.algebraic.as_ref().filter(|a| a.n_modes > 0 && !a.sensitivity.is_empty()).map(|a| &a.sensitivity[..])
    }

    /// Derivatives of a time, for the log: without those by the modes of subsystems in the equations.
    pub(super) fn shown_dt(&self) -> Vec<f64> {
        let Some(s) = &self.derivatives.sens else { return Vec::new() };
        Follower::shown(self.algebraic.as_deref(), &s.dt)
    }

    /// The algebraic states behind a jump of the others, from those before it.
    pub(super) fn settle_jump(&mut self) -> EvalResult {
        let Some(a) = &self.algebraic else { return Ok(()) };
        a.equations.solve(self.t, &mut self.x, &self.field.u, &self.field.p, Guess::Jump)
    }

    /// Modes of all subsystems that switch, where the engine knows `others`.
    pub(super) fn all_modes(&self, others: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
        match &self.algebraic {
            Some(a) => a.with_own(&self.x, others),
            None => others,
        }
    }

    /// Modes of a subsystem by its number, where it switches inside of algebraic equations; else the number that the engine has for it.
    pub(super) fn own_modes(&self, subsystem: usize) -> std::result::Result<Vec<usize>, usize> {
        let Some(a) = &self.algebraic else { return Err(subsystem) };
        match a.own_subsystems.iter().position(|k| *k == subsystem) {
            Some(k) if a.settled => Ok(a.active(k, &self.x)),
            Some(_) => Ok(Vec::new()),
            None => Err(a.other_subsystems.iter().position(|k| *k == subsystem).unwrap_or(usize::MAX)),
        }
    }

    /// Why modes in the equations follow each other without end, where transition `guard` changes one.
    pub(super) fn endless_modes(&self, guard: usize) -> Option<String> {
        let a = self.algebraic.as_ref().filter(|a| a.is_own(guard))?;
        let state = self.field.guards.all[guard].transition.from.first()?.0;
        let k = a.own_subsystems[state - a.nx];
        if let Some((inclusion, j)) = a.equations.step_of(state - a.nx) {
            return Some(format!(
                "step {j} of inclusion {inclusion} comes back from both sides of its surface, and its weight cannot hold it: the rate of its switching \
                 function is not known without the forces of contacts, or other subsystems, that act on it, or it depends on algebraic \
                 states that the weight does not act on. Write the function in other states; in a scene write what switches into the forces, with \
                 sign or where; else simulate the system with finite elements"
            ));
        }
        Some(format!(
            "no mode of subsystem {k}, which switches inside of the algebraic equations, agrees with their solution under it: each leads to \
             another, and no weights of two of them hold the surface between. Give the state that switches a derivative, or simulate the system \
             with finite elements"
        ))
    }

    /// The transition that stands for `guard`, which was made last: where a surface is held behind it, the one behind it.
    pub(super) fn made_as(&self, guard: usize) -> usize {
        let to = self.field.guards.all[guard].transition.to.first();
        let is_other = |(state, value): &(usize, f64)| self.derivatives.reset.x[*state] != *value;
        let own = self.algebraic.as_ref().is_some_and(|a| a.is_own(guard));
        guard + usize::from(own && to.is_some_and(is_other))
    }

    /// What rounding makes of the rate of a guard where surfaces may be held inside of the equations.
    pub(super) fn noise_of_held(&self, w: &Watch) -> std::result::Result<f64, EvalError> {
        let Some(a) = self.algebraic.as_ref().filter(|a| a.n_all > a.nx + a.n_modes) else { return Ok(0.0) };
        let Some(place) = w.place() else { return Ok(0.0) };
        let known = a.equations.noise_of_rates(self.t, &self.x, &self.field.u, &self.field.p);
        let noise = match known {
            Err(EvalError::Recoverable) => return Ok(0.0),
            r => r?,
        };
        let gradient = self.field.gradients.row(&self.functions.dq0, place);
        Ok(gradient.states().filter(|g| g.0 < noise.len()).map(|(i, g)| g.abs() * noise[i]).sum())
    }

    /// Finds modes in the equations anew at the present point. Says whether there are any.
    pub(super) fn find_modes(&mut self) -> std::result::Result<bool, EvalError> {
        let Some(a) = &self.algebraic else { return Ok(false) };
        let known = a.equations.find(self.t, &mut self.x, &self.field.u, &self.field.p, Guess::Jump)?;
        self.field.arm(&self.x);
        Ok(known)
    }

    /// Transition `guard` is made: what it is in the log. Nothing, if it is one of the system.
    pub(super) fn log_own(&mut self, guard: usize, rate: f64) -> std::result::Result<bool, EvalError> {
        let Some(a) = self.algebraic.as_ref().filter(|a| a.is_own(guard)) else { return Ok(false) };
        let t = &self.field.guards.all[guard].transition;
        let Some(k) = t.from.first().map(|(state, _)| state - a.nx) else { return Ok(true) };
        let (before, after) = (a.active(k, &self.x), a.active(k, &self.derivatives.reset.x));
        let subsystem = a.own_subsystems[k];
        let data = (self.t, &self.field.u[..], &self.field.p[..]);
        let unique = a.equations.continuations(k, data, &self.derivatives.reset.x)? <= 1;
        if !unique {
            (self.log.ambiguous, self.log.one_sided) = (true, true);
            if self.options.ambiguity == Ambiguity::Stop {
                self.fail(Outcome::Ambiguous, NOT_UNIQUE.into());
            }
        }
        let kind = match (before.len(), after.len()) {
            (1, 2) => Kind::Enter,
            (2, 1) => Kind::Leave,
            _ => Kind::Cross,
        };
        self.log.stats.switches += 1;
        if self.log.switches.len() < self.options.max_log {
            let (t, dt) = (self.t, self.shown_dt());
            let (simultaneous, transversality) = (false, f64::NAN);
            self.log.switches.push(Switch {
                t,
                kind,
                simultaneous,
                subsystem,
                before,
                after,
                rate,
                transversality,
                unique,
                dt,
            });
        }
        Ok(true)
    }

    /// [`Engine::derivative`] with that of the algebraic states, NaN where they have none.
    pub fn whole_derivative(&mut self, out: &mut [f64]) {
        out.copy_from_slice(&self.f[..self.n_shown()]);
        let Some(a) = self.algebraic.as_mut().filter(|a| a.settled) else { return };
        let at = Point { t: self.t, x: &self.x, u: &self.field.u, p: &self.field.p };
        let mut along = vec![0.0; a.unknowns.dims().n_in()];
        along[..self.nx].copy_from_slice(&self.f);
        if let Some(t) = along.last_mut() {
            *t = 1.0;
        }
        let z = a.z.clone();
        if a.moved(&at, &along, &mut out[z.clone()]).is_err() {
            out[z].fill(f64::NAN);
        }
    }

    /// The piece of the dense output that was noted last, which ends at `t1`, gets the algebraic states.
    pub(super) fn note_algebraic(&mut self, t1: f64) {
        let Some(a) = &mut self.algebraic else { return };
        let Some(path) = &mut self.log.path else { return };
        let (rtol, atol) = (&self.rtol, &self.atol);
        let tolerance = |i: usize, z: f64| rtol[i] * z.abs() + atol[i];
        let step = &self.stepper.step;
        a.fit(step, t1, (&self.field.u, &self.field.p), &tolerance, &mut |t, h, state, poly| {
            push(path, step, (t, h), state, poly);
        });
    }

    /// `k`-th derivative of the algebraic states in the last step, at a time in it: behind those of the others in `out`.
    pub(super) fn algebraic_dky(&mut self, t: f64, k: usize, out: &mut [f64]) {
        let Some(a) = &mut self.algebraic else { return };
        let (u, p) = (&self.field.u, &self.field.p);
        if k == 0 {
            // what happens at the end of the step is behind it
            if t == self.t {
                out[a.z.clone()].copy_from_slice(&self.x[a.z.clone()]);
            } else {
                let modes = &self.stepper.step.x0[a.nx..];
                a.show(t, out, modes, u, p);
            }
            return;
        }
        let (rtol, atol) = (&self.rtol, &self.atol);
        let tolerance = |i: usize, z: f64| rtol[i] * z.abs() + atol[i];
        let step = &self.stepper.step;
        a.fit(step, self.t, (u, p), &tolerance, &mut |from, h, state, poly| {
            if from <= t || from == step.t {
                let v = if k < poly.len() { derivative(poly, k, (t - from) / h) / h.powi(k as i32) } else { 0.0 };
                out[state] = v;
            }
        });
    }

    /// The derivatives `v` with respect to the final state, and those of `terms`, as derivatives with respect to the states that move;
    /// and what they add to the gradient by parameters and controls.
    pub(super) fn fold(&mut self, v: &[f64], terms: &[Term]) -> Result<Option<Folded>> {
        if self.algebraic.is_none() {
            return Ok(None);
        }
        let (mut v, mut terms) = (v.to_vec(), terms.to_vec());
        v.resize(self.nx, 0.0);
        let mut direct =
            Gradient { x0: vec![0.0; self.nx], p: vec![0.0; self.field.p.len()], u: vec![0.0; self.field.u.len()] };
        let end = Stop { t: self.t, x: self.x.clone(), u: self.field.u.clone(), p: self.field.p.clone() };
        let by_time = self.fold_one(&end, &mut v, &mut direct)?;
        for term in &mut terms {
            let Term::State { t, v } = term else { continue };
            let Some(a) = &mut self.algebraic else { continue };
            let Some(i) = a.stops.iter().rposition(|s| s.t == *t) else { continue };
            let stop = a.stops.swap_remove(i);
            v.resize(self.nx, 0.0);
            let r = self.fold_one(&stop, v, &mut direct);
            if let Some(a) = &mut self.algebraic {
                a.stops.push(stop);
                let last = a.stops.len() - 1;
                a.stops.swap(i, last);
            }
            r?;
        }
        if self.log.outcome == Outcome::Event && by_time != 0.0 {
            // the time at which the run ended moves
            let Some(index) = self.log.jumps.len().checked_sub(1) else { return Ok(Some(Folded { v, terms, direct })) };
            terms.push(Term::Jump { index, weight: by_time });
        }
        Ok(Some(Folded { v, terms, direct }))
    }

    /// One of these, at a point; the derivative by the time there.
    fn fold_one(&mut self, stop: &Stop, v: &mut [f64], direct: &mut Gradient) -> Result<f64> {
        let Some(a) = &mut self.algebraic else { return Ok(0.0) };
        let own: Vec<f64> = v[a.z.clone()].to_vec();
        v[a.z.clone()].fill(0.0);
        if own.iter().all(|v| *v == 0.0) {
            return Ok(0.0);
        }
        let at = Point { t: stop.t, x: &stop.x, u: &stop.u, p: &stop.p };
        let s = recover(a.slope(&at, &own).map(Some), None)?;
        let s =
            s.ok_or_else(|| Error::NonFinite("the algebraic states have no derivatives where the run ends".into()))?;
        add(v, &s.x);
        add(&mut direct.p, &s.p);
        add(&mut direct.u, &s.u);
        Ok(s.t)
    }

    /// What the algebraic states add to derivatives in a direction, whose product with those of `v` is wanted: what `v` changes by along
    /// the motion, as derivatives with respect to the states that move, and what that adds by parameters and controls.
    pub(super) fn fold_along(
        &mut self,
        v: &[f64],
        direction: &Gradient,
        along: &mut Along,
    ) -> Result<Option<(Vec<f64>, Gradient)>> {
        let ended = self.log.outcome == Outcome::Event;
        let Some(a) = &mut self.algebraic else { return Ok(None) };
        let at = Point { t: self.t, x: &self.x, u: &self.field.u, p: &self.field.p };
        let mut z: Vec<f64> = along.state.clone();
        z[a.z.clone()].fill(0.0);
        z.extend(direction.u.iter().chain(&direction.p).chain(&[0.0]));
        let own: Vec<f64> = v[a.z.clone()].to_vec();
        let found = a.bend(&at, &own, &z).and_then(|b| {
            let s = a.slope(&at, &own)?;
            let to = a.z.clone();
            a.moved(&at, &z, &mut along.state[to])?;
            Ok(Some((b, s)))
        });
        let none = || Error::NonFinite("the algebraic states have no derivatives where the run ends".into());
        let (b, s) = recover(found, None)?.ok_or_else(none)?;
        if ended && s.t != 0.0 {
            return Err(Error::Unsupported(
                "second derivatives of algebraic states that depend on time, where a transition ends the run".into(),
            ));
        }
        Ok(Some((b.x, Gradient { x0: vec![0.0; self.nx], p: b.p, u: b.u })))
    }

    /// Adds what does not go through the run to a gradient; initial values of algebraic states are guesses.
    pub(super) fn unfold(&self, g: &mut Gradient, direct: &Gradient) {
        add(&mut g.p, &direct.p);
        add(&mut g.u, &direct.u);
        if let Some(a) = &self.algebraic {
            g.x0[a.z.clone()].fill(0.0);
            g.x0.truncate(a.nx);
        }
    }
}

impl Follower {
    fn note_stop(&mut self, t: f64, x: &[f64], u: &[f64], p: &[f64]) {
        self.stops.push(Stop { t, x: x.to_vec(), u: u.to_vec(), p: p.to_vec() });
    }
}

fn add(to: &mut [f64], what: &[f64]) {
    to.iter_mut().zip(what).for_each(|(t, w)| *t += w);
}

/// A polynomial of one state for a part of the step that was pushed last.
fn push(path: &mut Path, step: &Step, (t, h): (f64, f64), state: usize, poly: &Poly) {
    if t == step.t {
        // in units of the step: a power of two, or the part that the step has gone
        let mut own = *poly;
        own.iter_mut().fold(1.0, |power, c| {
            *c *= power;
            power * (step.h / h)
        });
        path.set_last(state, &own);
    } else {
        path.push_own(state, (t, h), poly);
    }
}
