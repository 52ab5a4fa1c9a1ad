//! Algebraic equations of index 1: the states that they determine, as functions of the others.
//!
//! ```text
//! ẋ = f(x, z, u, p, t),   0 = h(x, z, u, p, t),   h_z regular:   z = Z(x, u, p, t),   Z' = −h_z⁻¹ h'
//! ```
//!
//! Some states of such a system are `z`. Where a function is evaluated they hold a guess: the values that `z` had a little
//! before. Newton's method goes from there to the solution on the same branch, along the path on which `h` falls proportionally (P.
//! Deuflhard, *Newton Methods for Nonlinear Problems*, 2004, section 3.3), and stops where that path comes to a singular `h_z`. What
//! is found depends on the point and the guess alone.
//!
//! Where a subsystem switches inside of `h`, as diodes and saturations do, `z` is found under one mode of it. The mode is a discrete
//! state behind the states of the system, and a transition makes the next one where a switching function, which sees the `z` of the
//! present mode, passes zero. Behind it the functions are looked at again with the `z` of the new mode, one subsystem after the other:
//! for linear complementarity problems with P-matrices that is the method of least index (K. Murty, *Note on a Bard-type
//! scheme for solving the complementarity problem*, Opsearch 11, 1974). Where a run begins, and behind a jump of the controls, all modes
//! that are outside of their regions change at once, as long as they become fewer (M. Kostreva, *Block pivot methods for solving the
//! complementarity problem*, Linear Algebra and its Applications 21, 1978).

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::{Regions, SharedFunction, System};
use crate::error::{Error, Result};
use crate::func::{Dims, EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::linalg::forest::{join, root};
use crate::linalg::lu::Lu;

/// Rounding.
const EPS: f64 = f64::EPSILON;
/// Numbers up to this have no full precision.
const TINY: f64 = f64::MIN_POSITIVE / EPS;
/// Residuals below so many roundings of their terms are zero.
const ZERO: f64 = 8.0;
/// Residuals that no correction makes smaller are rounding up to so many of them.
const STUCK: f64 = 1e5;
/// An unknown below this part of the largest one in its block does not decide whether a correction is good.
const SMALL: f64 = 1e-2;
/// A correction falls to this part at least, or the derivatives are evaluated anew.
const FAST: f64 = 0.25;
/// Shortest part that is taken of a correction, and of an algebraic state.
const SHORTEST: f64 = 1e-5;
/// How often all modes are changed at once although they do not become fewer.
const PATIENCE: usize = 8;
/// Modes that are tried at most.
const MOST_MODES: usize = 4096;

/// What the guess is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum Guess {
    /// The solution a little before.
    #[default]
    Near,
    /// The solution before an event at the same time, where the equations jump.
    Jump,
    /// Given by the user: any solution is good.
    Far,
}

impl Guess {
    /// Corrections at most.
    fn most(self) -> usize {
        match self {
            Guess::Near => 60,
            Guess::Jump | Guess::Far => 1000,
        }
    }
}

/// Why equations are not solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Failure {
    /// `h_z` is singular at the guess.
    Singular,
    /// It is singular between the guess and where Newton's method goes.
    Fold,
    /// No correction makes the residuals smaller, or too many are needed.
    Stuck,
    /// The equations have no values at the guess.
    Undefined,
}

impl Failure {
    fn text(self) -> &'static str {
        match self {
            Failure::Singular => "the matrix of their derivatives by the algebraic states is singular",
            Failure::Fold => "the matrix of their derivatives by the algebraic states becomes singular on the way",
            Failure::Stuck => "Newton's method finds no solution near the last one",
            Failure::Undefined => "they have no finite values",
        }
    }
}

/// What keeps equations from being solved: their functions end the call, or they have no solution that is found.
enum Unsolved {
    Call(EvalError),
    Equations(Failure),
}

impl From<Failure> for Unsolved {
    fn from(f: Failure) -> Unsolved {
        Unsolved::Equations(f)
    }
}

impl From<EvalError> for Unsolved {
    fn from(e: EvalError) -> Unsolved {
        match e {
            EvalError::Recoverable => Unsolved::Equations(Failure::Undefined),
            e => Unsolved::Call(e),
        }
    }
}

/// One function whose outputs are algebraic equations, or parts of them.
pub(super) struct Part {
    pub(super) f: SharedFunction,
    /// The outputs, and the equation of the first of them.
    outputs: Range<usize>,
    /// Equations of all outputs of the range.
    pub(super) equations: Vec<usize>,
    /// Where a subsystem switches: its number among those that do, and how many outputs a mode has. The range is that of the first mode.
    switched: Option<(usize, usize)>,
    /// Where the entries of its Jacobian go among those of `h`; none for other outputs.
    to_jac: Vec<Option<usize>>,
}

impl Part {
    /// Its outputs under these modes.
    pub(super) fn outputs(&self, modes: &[usize]) -> Range<usize> {
        let by = self.switched.map_or(0, |(k, n)| modes[k] * n);
        self.outputs.start + by..self.outputs.end + by
    }

    /// The equation of an output of any mode.
    fn equation(&self, output: usize) -> Option<usize> {
        let o = self.switched.map_or(output, |(_, n)| output % n);
        self.outputs.contains(&o).then(|| self.equations[o - self.outputs.start])
    }
}

/// A subsystem that switches inside of the equations.
pub(super) struct Loop {
    /// Its place in the system.
    pub(super) subsystem: usize,
    pub(super) n_modes: usize,
    regions: Regions,
}

impl Loop {
    /// Switching functions, or indicators.
    pub(super) fn functions(&self) -> &SharedFunction {
        let (Regions::Signs { psi: f, .. } | Regions::Indicators(f)) = &self.regions;
        f
    }

    /// Has a mode its region where the functions have these values, up to these roundings?
    fn is_inside(&self, mode: usize, v: &[f64], rounding: &[f64]) -> bool {
        match &self.regions {
            Regions::Signs { signs, .. } => {
                let row = &signs[mode * v.len()..(mode + 1) * v.len()];
                row.iter().zip(v.iter().zip(rounding)).all(|(s, (v, r))| f64::from(*s) * v >= -r)
            }
            Regions::Indicators(_) => v.iter().zip(rounding).all(|(other, r)| v[mode] - other <= r + rounding[mode]),
        }
    }

    /// How the mode may end: weights of the functions whose sum becomes positive, and the next mode.
    pub(super) fn exits(&self, mode: usize) -> Vec<(Vec<(usize, f64)>, usize)> {
        match &self.regions {
            Regions::Indicators(_) => {
                let others = (0..self.n_modes).filter(|j| *j != mode);
                others.map(|j| (vec![(mode, 1.0), (j, -1.0)], j)).collect()
            }
            Regions::Signs { psi, signs } => {
                let n = psi.n_out();
                let row = |m: usize| &signs[m * n..(m + 1) * n];
                let own = row(mode);
                let next = |l: usize| {
                    (0..self.n_modes).find(|j| {
                        let other = row(*j);
                        other[l] == -own[l] && (0..n).all(|m| m == l || other[m] * own[m] >= 0)
                    })
                };
                (0..n)
                    .filter(|l| own[*l] != 0)
                    .filter_map(|l| Some((vec![(l, -f64::from(own[l]))], next(l)?)))
                    .collect()
            }
        }
    }
}

/// Equations and algebraic states that have to do with each other.
pub(super) struct Block {
    /// Equations, and as many algebraic states.
    pub(super) rows: Vec<usize>,
    pub(super) unknowns: Vec<usize>,
    /// The other inputs that the equations depend on, ascending.
    pub(super) columns: Vec<usize>,
    /// Of every entry of the Jacobian: place, row and column in the block.
    by_unknowns: Vec<(usize, usize, usize)>,
    by_columns: Vec<(usize, usize, usize)>,
}

/// The equations, and what is known of their solution at one point.
pub(crate) struct Algebraic {
    /// Sizes of the system as it was stated, and which states are algebraic.
    pub(super) dims: Dims,
    pub(super) z: Range<usize>,
    pub(super) loops: Vec<Loop>,
    pub(super) parts: Vec<Part>,
    jac: Pattern,
    pub(super) blocks: Vec<Block>,
    /// Block of every algebraic state.
    pub(super) block_of: Vec<usize>,
    /// The Jacobian is the same everywhere.
    pub(super) affine: bool,
    solver: Mutex<Solver>,
}

/// What the last point was, and what is known there.
pub(super) struct Solver {
    t: f64,
    /// States with the guess and the modes, controls, parameters.
    key: Vec<f64>,
    /// Modes of the subsystems that switch inside of the equations.
    pub(super) modes: Vec<usize>,
    known: Option<std::result::Result<(), EvalError>>,
    /// The states with the solution.
    pub(super) full: Vec<f64>,
    jac_known: bool,
    slopes_known: bool,
    jac: Vec<f64>,
    pub(super) lus: Vec<Lu<f64>>,
    /// Largest entry of every unknown in `h_z` where the largest of every row is 1: times this, unknowns of one block have one unit.
    units: Vec<f64>,
    /// Derivatives of every algebraic state of a block by the columns of the block.
    slopes: Vec<Vec<f64>>,
    h: Vec<f64>,
    sizes: Vec<f64>,
    step: Vec<f64>,
    start: Vec<f64>,
    next: Vec<f64>,
    trial: Vec<f64>,
    weights: Vec<f64>,
    buffer: Vec<f64>,
    pub(super) work: Vec<f64>,
    pub(super) column: Vec<f64>,
    failure: Option<(f64, Failure)>,
    guess: Guess,
}

impl Algebraic {
    /// Of a system with algebraic states.
    ///
    /// # Errors
    /// [`Error::State`] where an equation contains none of the states.
    pub(crate) fn new(system: &System) -> Result<Algebraic> {
        let (dims, nz, z) = (system.dims, system.n_z, system.algebraic_states());
        let nd = z.start;
        let mut parts = Vec::new();
        let mut add = |f: &SharedFunction, outputs: Range<usize>, equations: Vec<usize>, switched| {
            parts.push(Part { f: f.clone(), outputs, equations, switched, to_jac: Vec::new() });
        };
        if let Some(f) = &system.f0 {
            add(f, z.clone(), (0..nz).collect(), None);
        }
        if let Some(f) = &system.algebraic {
            add(f, 0..nz, (0..nz).collect(), None);
        }
        let mut loops: Vec<Loop> = Vec::new();
        for (k, s) in system.subsystems.iter().enumerate().filter(|s| s.1.rows.iter().any(|r| z.contains(r))) {
            let switched = (s.n_modes > 1).then_some((loops.len(), s.rows.len()));
            if s.n_modes > 1 {
                loops.push(Loop { subsystem: k, n_modes: s.n_modes, regions: s.regions.clone() });
            }
            for (o, r) in s.rows.iter().enumerate().filter(|r| z.contains(r.1)) {
                add(&s.modes, o..o + 1, vec![r - nd], switched);
            }
        }
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for p in &parts {
            for (c, entries) in p.f.jac_pattern().columns() {
                for e in entries {
                    if let Some(r) = p.equation(p.f.jac_pattern().row_idx()[e]) {
                        rows.push(r);
                        cols.push(c);
                    }
                }
            }
        }
        let (jac, map) = Pattern::from_triplets(nz, dims.n_in(), &rows, &cols);
        let mut places = map.into_iter();
        for p in &mut parts {
            let own = |o: &usize| p.equation(*o).and_then(|_| places.next());
            let to_jac = p.f.jac_pattern().row_idx().iter().map(own).collect();
            p.to_jac = to_jac;
        }
        let (blocks, block_of) = blocks(&jac, nd, nz)?;
        let affine = parts.iter().all(|p| p.f.hess_pattern().nnz() == 0 && !p.f.hessian_is_approximate());
        let most = |of: &dyn Fn(&Part) -> usize| parts.iter().map(of).max().unwrap_or(0);
        let buffer = most(&|p| p.f.n_out().max(p.f.jac_pattern().nnz()).max(p.f.hess_pattern().nnz()));
        let solver = Solver {
            t: 0.0,
            key: vec![0.0; dims.x + loops.len() + dims.u + dims.p],
            modes: vec![0; loops.len()],
            known: None,
            full: vec![0.0; dims.x],
            jac_known: false,
            slopes_known: false,
            jac: vec![0.0; jac.nnz()],
            units: vec![0.0; nz],
            lus: blocks.iter().map(|b| Lu::with_capacity(b.rows.len())).collect(),
            slopes: blocks.iter().map(|b| vec![0.0; b.rows.len() * b.columns.len()]).collect(),
            h: vec![0.0; nz],
            sizes: vec![0.0; nz],
            step: vec![0.0; nz],
            start: vec![0.0; nz],
            next: vec![0.0; nz],
            trial: vec![0.0; dims.x],
            weights: vec![0.0; nz],
            buffer: vec![0.0; buffer],
            work: vec![0.0; most(&|p| p.f.work_len())],
            column: vec![0.0; nz],
            failure: None,
            guess: Guess::Near,
        };
        Ok(Algebraic { dims, z, loops, jac, blocks, block_of, affine, solver: Mutex::new(solver), parts })
    }

    /// The algebraic states.
    pub(crate) fn states(&self) -> Range<usize> {
        self.z.clone()
    }

    /// Forgets everything: the next run gives what the first one did.
    pub(crate) fn forget(&self) {
        let mut s = self.lock();
        (s.known, s.jac_known, s.slopes_known, s.failure) = (None, false, false, None);
    }

    /// Where and why the equations were not solved last, in words.
    pub(crate) fn complaint(&self) -> Option<String> {
        let failure = self.lock().failure;
        failure.map(|(t, f)| format!("the algebraic equations were not solved at t = {t}: {}", f.text()))
    }

    /// Replaces the guess in `x` by the solution.
    pub(crate) fn solve(&self, t: f64, x: &mut [f64], u: &[f64], p: &[f64], guess: Guess) -> EvalResult {
        let mut s = self.lock();
        s.guess = guess;
        if guess != Guess::Near {
            s.known = None;
        }
        let r = self.settle(&mut s, &Point { t, x, u, p });
        s.guess = Guess::Near;
        if guess != Guess::Near && r.is_err() {
            // from there another guess may be nearer
            s.known = None;
        }
        r?;
        x[self.z.clone()].copy_from_slice(&s.full[self.z.clone()]);
        Ok(())
    }

    /// Finds modes of the subsystems that switch inside of the equations, whose regions contain the solution, from those that stand behind
    /// the states in `x`; solves the equations as [`Algebraic::solve`] does. False where there are none.
    pub(crate) fn find(
        &self,
        t: f64,
        x: &mut [f64],
        u: &[f64],
        p: &[f64],
        guess: Guess,
    ) -> std::result::Result<bool, EvalError> {
        let start = x.to_vec();
        // all that are outside at once, as long as they become fewer; then one after the other
        let (mut fewest, mut patience) = (usize::MAX, PATIENCE);
        for _ in 0..MOST_MODES.min(1 + self.loops.iter().map(|l| 8 * l.n_modes).sum::<usize>()) {
            match self.solve(t, x, u, p, guess) {
                Ok(()) => {}
                Err(EvalError::Recoverable) => break,
                Err(e) => return Err(e),
            }
            let outside = self.outside(t, x, u, p)?;
            if outside.is_empty() {
                return Ok(true);
            }
            patience = if outside.len() < fewest { PATIENCE } else { patience.saturating_sub(1) };
            fewest = fewest.min(outside.len());
            let n = if patience > 0 { outside.len() } else { 1 };
            outside[..n].iter().for_each(|(k, mode)| x[self.dims.x + k] = *mode as f64);
        }
        let all = self.loops.iter().try_fold(1usize, |n, l| n.checked_mul(l.n_modes)).filter(|n| *n <= MOST_MODES);
        for k in 0..all.filter(|n| *n > 1).unwrap_or(0) {
            x.copy_from_slice(&start);
            let mut rest = k;
            for (l, to) in self.loops.iter().zip(&mut x[self.dims.x..]) {
                (*to, rest) = ((rest % l.n_modes) as f64, rest / l.n_modes);
            }
            let inside = self.solve(t, x, u, p, guess).and_then(|()| self.outside(t, x, u, p));
            match inside {
                Ok(outside) if outside.is_empty() => return Ok(true),
                Ok(_) | Err(EvalError::Recoverable) => {}
                Err(e) => return Err(e),
            }
        }
        x.copy_from_slice(&start);
        if !self.loops.is_empty() {
            self.lock().failure.get_or_insert((t, Failure::Stuck));
        }
        Ok(false)
    }

    /// The subsystems whose modes have their regions elsewhere, and the modes that have theirs here.
    fn outside(&self, t: f64, x: &[f64], u: &[f64], p: &[f64]) -> std::result::Result<Vec<(usize, usize)>, EvalError> {
        let at = Point { t, x: &x[..self.dims.x], u, p };
        let mut found = Vec::new();
        for (k, l) in self.loops.iter().enumerate() {
            let f = l.functions();
            let (mut v, mut work) = (vec![0.0; f.n_out()], vec![0.0; f.work_len()]);
            f.value(&at, &mut v, &mut work)?;
            let mut jac = vec![0.0; f.jac_pattern().nnz()];
            f.jacobian(&at, &mut jac, &mut work)?;
            let mut rounding = vec![0.0; v.len()];
            let inputs = at.x.iter().chain(u).chain(p).chain(std::iter::once(&t));
            for ((_, entries), value) in f.jac_pattern().columns().zip(inputs) {
                entries.for_each(|e| rounding[f.jac_pattern().row_idx()[e]] += 64.0 * EPS * (jac[e] * value).abs());
            }
            let now = mode_at(x[self.dims.x + k], l.n_modes);
            if l.is_inside(now, &v, &rounding) {
                continue;
            }
            let there = (0..l.n_modes).find(|m| l.is_inside(*m, &v, &rounding));
            found.push((k, there.ok_or(EvalError::Recoverable)?));
        }
        Ok(found)
    }

    /// The subsystems that switch inside of the equations, by their places in the system.
    pub(crate) fn loops(&self) -> impl Iterator<Item = usize> + '_ {
        self.loops.iter().map(|l| l.subsystem)
    }

    /// States of the system as it was stated.
    pub(crate) fn n_states(&self) -> usize {
        self.dims.x
    }

    /// Sizes with the modes behind the states.
    pub(super) fn outer(&self) -> Dims {
        Dims { x: self.dims.x + self.loops.len(), ..self.dims }
    }

    /// The place of an input where the modes stand behind the states.
    pub(super) fn outer_input(&self, c: usize) -> usize {
        if c < self.dims.x {
            c
        } else {
            c + self.loops.len()
        }
    }

    pub(super) fn lock(&self) -> std::sync::MutexGuard<'_, Solver> {
        self.solver.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Brings the solver to a point.
    pub(super) fn settle(&self, s: &mut Solver, at: &Point) -> EvalResult {
        let (of_x, rest) = s.key.split_at(at.x.len());
        let (of_u, of_p) = rest.split_at(at.u.len());
        let same = s.t.to_bits() == at.t.to_bits() && same(of_x, at.x) && same(of_u, at.u) && same(of_p, at.p);
        if let Some(known) = s.known.filter(|_| same) {
            return known;
        }
        s.t = at.t;
        s.key.iter_mut().zip(at.x.iter().chain(at.u).chain(at.p)).for_each(|(k, v)| *k = *v);
        let (states, modes) = at.x.split_at(self.dims.x);
        s.full.copy_from_slice(states);
        let mut same = self.affine;
        for ((m, v), l) in s.modes.iter_mut().zip(modes).zip(&self.loops) {
            let mode = mode_at(*v, l.n_modes);
            same &= *m == mode;
            *m = mode;
        }
        (s.jac_known, s.slopes_known) = (same && s.jac_known, same && s.slopes_known);
        let r = self.newton(s, at).map_err(|e| match e {
            Unsolved::Call(e) => e,
            Unsolved::Equations(f) => {
                s.failure = Some((at.t, f));
                EvalError::Recoverable
            }
        });
        // a call that is to end says nothing of the point
        s.known = (!matches!(r, Err(EvalError::Stopped | EvalError::Fatal(_)))).then_some(r);
        r
    }

    /// Residuals at states `x` to `h`.
    fn residuals(&self, s: &mut Solver, at: &Point, of_trial: bool) -> EvalResult {
        let x = if of_trial { &s.trial } else { &s.full };
        let at = Point { x, ..*at };
        s.h.fill(0.0);
        for p in &self.parts {
            let outputs = p.outputs(&s.modes);
            p.f.value_rows(&at, outputs.clone(), &mut s.buffer[..p.f.n_out()], &mut s.work)?;
            for (o, e) in outputs.zip(&p.equations) {
                s.h[*e] += s.buffer[o];
            }
        }
        s.h.iter().all(|v| v.is_finite()).then_some(()).ok_or(EvalError::Recoverable)
    }

    /// Jacobian at the states `full`, and the factors of its part by the algebraic states; false where that is singular.
    fn factorise(&self, s: &mut Solver, at: &Point) -> std::result::Result<bool, EvalError> {
        if self.affine && s.jac_known {
            return Ok(true);
        }
        (s.jac_known, s.slopes_known) = (false, false);
        let at = Point { x: &s.full, ..*at };
        s.jac.fill(0.0);
        for p in &self.parts {
            let own = &mut s.buffer[..p.f.jac_pattern().nnz()];
            let outputs = p.outputs(&s.modes);
            p.f.jacobian_rows(&at, outputs.clone(), own, &mut s.work)?;
            for ((to, v), r) in p.to_jac.iter().zip(own).zip(p.f.jac_pattern().row_idx()) {
                if let Some(to) = to.filter(|_| outputs.contains(r)) {
                    s.jac[to] += *v;
                }
            }
        }
        for (b, lu) in self.blocks.iter().zip(&mut s.lus) {
            let n = b.rows.len();
            let a = lu.clear(n);
            b.by_unknowns.iter().for_each(|(e, r, c)| a[r * n + c] = s.jac[*e]);
            // pivots as if rows and columns were of one size
            let columns = &mut s.column[..n];
            let largest = |row: &[f64]| row.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            columns.fill(0.0);
            for row in a.chunks_exact(n) {
                let of_row = largest(row);
                if !(of_row > 0.0 && of_row.is_finite()) {
                    return Ok(false);
                }
                columns.iter_mut().zip(row).for_each(|(c, v)| *c = c.max(v.abs() / of_row));
            }
            b.unknowns.iter().zip(&*columns).for_each(|(i, c)| s.units[*i] = *c);
            if columns.contains(&0.0) || !lu.factorise_sized(|j| 1.0 / columns[j]) {
                return Ok(false);
            }
        }
        s.jac_known = true;
        Ok(true)
    }

    fn is_negative(&self, s: &Solver) -> bool {
        s.lus.iter().fold(false, |n, lu| n ^ lu.is_determinant_negative())
    }

    /// `−h_z⁻¹ h` to `next`.
    fn correct(&self, s: &mut Solver) {
        for (b, lu) in self.blocks.iter().zip(&mut s.lus) {
            let column = &mut s.column[..b.rows.len()];
            column.iter_mut().zip(&b.rows).for_each(|(c, r)| *c = -s.h[*r]);
            lu.solve(column);
            b.unknowns.iter().zip(column).for_each(|(i, c)| s.next[*i] = *c);
        }
    }

    /// The largest residual in roundings, for the states `full` or those on trial: of its terms, and of unknowns of the size of the
    /// largest in the block, which is what factors of `h_z` know them by.
    fn roundings(&self, s: &mut Solver, at: &Point, of_trial: bool) -> f64 {
        let x = if of_trial { &s.trial } else { &s.full };
        s.sizes.fill(0.0);
        let inputs = x.iter().chain(at.u).chain(at.p).chain(std::iter::once(&at.t));
        for ((_, entries), v) in self.jac.columns().zip(inputs) {
            for e in entries {
                s.sizes[self.jac.row_idx()[e]] += (s.jac[e] * v).abs();
            }
        }
        for b in &self.blocks {
            let unit = |c: usize| s.units[b.unknowns[c]];
            let largest = b.unknowns.iter().map(|i| x[self.z.start + i].abs() * s.units[*i]).fold(0.0, f64::max);
            b.by_unknowns.iter().for_each(|(e, r, c)| s.sizes[b.rows[*r]] += s.jac[*e].abs() * largest / unit(*c));
        }
        // what may be an underflow is zero
        let of = |(h, size): (&f64, &f64)| if h.abs() <= TINY { 0.0 } else { h.abs() / (EPS * size) };
        s.h.iter().zip(&s.sizes).map(of).fold(0.0, f64::max)
    }

    /// From the guess in `full` to the solution.
    fn newton(&self, s: &mut Solver, at: &Point) -> std::result::Result<(), Unsolved> {
        let (nd, nz) = (self.z.start, self.z.len());
        self.residuals(s, at, false)?;
        if !self.factorise(s, at)? {
            return Err(Failure::Singular.into());
        }
        let negative = self.is_negative(s);
        let mut fresh = true;
        let mut noise = self.roundings(s, at, false);
        self.correct(s);
        s.step.copy_from_slice(&s.next);
        s.start.copy_from_slice(&s.full[nd..nd + nz]);
        for i in 0..nz {
            s.weights[i] = s.full[nd + i].abs().max(s.step[i].abs());
        }
        for b in &self.blocks {
            let largest = b.unknowns.iter().map(|i| s.weights[*i] * s.units[*i]).fold(0.0, f64::max);
            for i in &b.unknowns {
                let floor = SMALL * if largest > 0.0 { largest } else { 1.0 } / s.units[*i];
                s.weights[*i] = 1.0 / s.weights[*i].max(floor);
            }
        }
        let mut part = 1.0f64;
        for _ in 0..s.guess.most() {
            if noise <= ZERO {
                // the last correction costs nothing, and the result does not depend on how close the others came
                (0..nz).for_each(|i| s.full[nd + i] += s.step[i]);
                s.jac_known = self.affine;
                return Ok(());
            }
            let weighted = |v: &[f64]| norm(v.iter().zip(&s.weights).map(|(v, w)| v * w));
            let long = weighted(&s.step);
            if long == 0.0 {
                s.jac_known = self.affine;
                return Ok(());
            }
            if !long.is_finite() {
                return Err(Failure::Singular.into());
            }
            let fall = loop {
                s.trial.copy_from_slice(&s.full);
                (0..nz).for_each(|i| s.trial[nd + i] += part * s.step[i]);
                let mut shorter = 0.5 * part;
                match self.residuals(s, at, true) {
                    Ok(()) => {
                        self.correct(s);
                        let fall = norm(s.next.iter().zip(&s.weights).map(|(v, w)| v * w)) / long;
                        if fall <= 1.0 - part / 4.0 {
                            break Some(fall);
                        }
                        if part == 1.0 && noise <= STUCK && self.roundings(s, at, true) <= STUCK {
                            break None;
                        }
                        let apart = s.next.iter().zip(&s.step).zip(&s.weights);
                        let apart = norm(apart.map(|((n, d), w)| (n - (1.0 - part) * d) * w));
                        let likely = 0.5 * long * part * part / apart;
                        // far out the estimate says little
                        shorter = shorter.min(likely.max(0.1 * part));
                    }
                    Err(EvalError::Recoverable) => {}
                    Err(e) => return Err(e.into()),
                }
                // far out a correction may be much longer than what it corrects
                let least = |i: usize| SHORTEST * s.full[nd + i].abs().max(s.start[i].abs()) / s.step[i].abs();
                let least = (0..nz).map(least).fold(SHORTEST, f64::min).max(f64::MIN_POSITIVE);
                if shorter.is_nan() || shorter < least {
                    return Err(Failure::Stuck.into());
                }
                part = shorter;
            };
            let Some(fall) = fall else {
                // rounding
                if fresh {
                    s.jac_known = self.affine;
                    return Ok(());
                }
                if !self.factorise(s, at)? {
                    return Err(Failure::Singular.into());
                }
                self.residuals(s, at, false)?;
                noise = self.roundings(s, at, false);
                self.correct(s);
                s.step.copy_from_slice(&s.next);
                fresh = true;
                continue;
            };
            std::mem::swap(&mut s.full, &mut s.trial);
            if part == 1.0 && fall <= FAST {
                s.step.copy_from_slice(&s.next);
                fresh = false;
                noise = self.roundings(s, at, false);
                continue;
            }
            if !self.factorise(s, at)? {
                return Err(Failure::Singular.into());
            }
            if s.guess != Guess::Far && self.is_negative(s) != negative {
                return Err(Failure::Fold.into());
            }
            fresh = true;
            noise = self.roundings(s, at, false);
            // the correction by the old factors
            s.step.copy_from_slice(&s.next);
            self.correct(s);
            let apart = s.step.iter().zip(&s.next).zip(&s.weights);
            let apart = norm(apart.map(|((a, b), w)| (a - b) * w));
            let weighted = |v: &[f64]| norm(v.iter().zip(&s.weights).map(|(v, w)| v * w));
            let likely = part * (long / apart) * (weighted(&s.step) / weighted(&s.next));
            part = if likely < 1.0 { likely.max(f64::MIN_POSITIVE) } else { 1.0 };
            s.step.copy_from_slice(&s.next);
        }
        Err(Failure::Stuck.into())
    }

    /// Derivatives of the solution at a point, where the solver is.
    pub(super) fn differentiate(&self, s: &mut Solver, at: &Point) -> EvalResult {
        if s.slopes_known {
            return Ok(());
        }
        if !s.jac_known && !self.factorise(s, at)? {
            s.failure = Some((at.t, Failure::Singular));
            return Err(EvalError::Recoverable);
        }
        for (k, b) in self.blocks.iter().enumerate() {
            let (n, m) = (b.rows.len(), b.columns.len());
            s.slopes[k].fill(0.0);
            // by columns first
            let mut entries = b.by_columns.iter().peekable();
            for c in 0..m {
                let column = &mut s.column[..n];
                column.fill(0.0);
                while let Some((e, r, _)) = entries.next_if(|e| e.2 == c) {
                    column[*r] -= s.jac[*e];
                }
                s.lus[k].solve(column);
                column.iter().enumerate().for_each(|(i, v)| s.slopes[k][i * m + c] = *v);
            }
        }
        s.slopes_known = true;
        Ok(())
    }

    /// Derivatives of algebraic state `i` where they are known: by which inputs, and the values.
    pub(super) fn slopes<'a>(&'a self, s: &'a Solver, i: usize) -> (&'a [usize], &'a [f64]) {
        let k = self.block_of[i];
        let b = &self.blocks[k];
        let (at, m) = (b.unknowns.binary_search(&i).unwrap_or(0), b.columns.len());
        (&b.columns, &s.slopes[k][at * m..(at + 1) * m])
    }
}

impl Algebraic {
    /// The inputs that one input of the whole system follows, with its derivatives by them: itself, if it is no algebraic state.
    pub(super) fn follows<'a>(&'a self, s: &'a Solver, input: &'a [usize; 1]) -> (&'a [usize], &'a [f64]) {
        match self.z.contains(&input[0]) {
            true => self.slopes(s, input[0] - self.z.start),
            false => (input, &[1.0]),
        }
    }
}

/// Parts of the equations that have to do with each other, and the part of every unknown.
fn blocks(jac: &Pattern, nd: usize, nz: usize) -> Result<(Vec<Block>, Vec<usize>)> {
    // representatives of equations, and of unknowns behind them
    let mut chief: Vec<usize> = (0..2 * nz).collect();
    let mut used = vec![false; 2 * nz];
    for c in 0..nz {
        for &r in jac.rows(nd + c) {
            (used[r], used[nz + c]) = (true, true);
            join(&mut chief, r, nz + c);
        }
    }
    let higher = "the equations are not of index 1. Differentiate those without algebraic states until they contain one, or simulate the \
                  system with finite elements";
    if let Some(r) = (0..nz).find(|r| !used[*r]) {
        return Err(Error::State(format!("algebraic equation {r} contains no algebraic state: {higher}")));
    }
    if let Some(c) = (0..nz).find(|c| !used[nz + c]) {
        return Err(Error::State(format!("no algebraic equation contains the algebraic state {c}: {higher}")));
    }
    let mut number = vec![usize::MAX; 2 * nz];
    let mut out: Vec<Block> = Vec::new();
    let mut block_of = vec![0; nz];
    for i in 0..2 * nz {
        let a = root(&mut chief, i);
        if number[a] == usize::MAX {
            number[a] = out.len();
            out.push(Block {
                rows: Vec::new(),
                unknowns: Vec::new(),
                columns: Vec::new(),
                by_unknowns: Vec::new(),
                by_columns: Vec::new(),
            });
        }
        let b = number[a];
        if i < nz {
            out[b].rows.push(i);
        } else {
            out[b].unknowns.push(i - nz);
            block_of[i - nz] = b;
        }
    }
    for b in &mut out {
        if b.rows.len() != b.unknowns.len() {
            return Err(Error::State(format!(
                "the algebraic equations {:?} contain the algebraic states {:?} only: {higher}",
                b.rows, b.unknowns
            )));
        }
        for (c, entries) in jac.columns() {
            for e in entries {
                let Ok(r) = b.rows.binary_search(&jac.row_idx()[e]) else { continue };
                if (nd..nd + nz).contains(&c) {
                    let c = b.unknowns.binary_search(&(c - nd)).unwrap_or(0);
                    b.by_unknowns.push((e, r, c));
                } else {
                    if b.columns.last() != Some(&c) {
                        b.columns.push(c);
                    }
                    b.by_columns.push((e, r, b.columns.len() - 1));
                }
            }
        }
    }
    Ok((out, block_of))
}

/// Are these the same numbers, to the last bit?
fn same(a: &[f64], b: &[f64]) -> bool {
    /// So many are compared at once.
    const MANY: usize = 16;
    let mut parts = a.chunks(MANY).zip(b.chunks(MANY));
    parts.all(|(a, b)| a.iter().zip(b).fold(true, |s, (a, b)| s & (a.to_bits() == b.to_bits())))
}

/// Euclidean norm of `v` times weights, for numbers of any size.
fn norm(v: impl Iterator<Item = f64> + Clone) -> f64 {
    let largest = v.clone().fold(0.0, |m: f64, v| if (m + v).is_nan() { f64::NAN } else { m.max(v.abs()) });
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    largest * v.map(|v| (v / largest).powi(2)).sum::<f64>().sqrt()
}

/// The mode that a discrete state stands for.
pub(super) fn mode_at(v: f64, n_modes: usize) -> usize {
    (v as usize).min(n_modes - 1)
}
