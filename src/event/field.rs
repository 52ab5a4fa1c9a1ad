//! The right-hand side under a fixed active set.
//!
//! Subsystem `k` has the active cells `I_k`. With `α` the weights of all of them but the first,
//!
//! ```text
//! ẋ = f0 + Σ_k f_{i0(k)} + Σ_k Σ_{i ∈ I_k \ i0} α_i (f_i − f_{i0}) = b + D α,     0 = c_i(x) = g_i − g_{i0}     (6.15)
//! ```
//!
//! where every subsystem has one active cell this is an ordinary differential equation. Else `α` follows from the
//! derivative of the constraints, `C (b + D α) + c_t = 0` (6.17): a function of time and state, so switches that end a
//! sliding mode are located on it as accurately as the state is known.

mod apart;
mod bundled;
mod cells;
mod contacts;
mod derivatives;
mod entries;
mod evaluate;
mod gradients;
mod limit;
mod near;
mod on_demand;
mod rows;
mod selection;
mod sliding;
mod stages;
mod still;
mod supports;
mod units;

pub(super) use apart::{Apart, Known, Open};
pub(super) use contacts::{Contacts, TO_RATE};
pub(super) use gradients::{scatter, Gradients, Row};
pub(super) use on_demand::Formed;
pub use on_demand::SLOTS as MODES_ON_DEMAND;
pub(super) use rows::Rows;
use sliding::Sliding;
pub(super) use stages::{StagesOf, MOST_STAGES};
pub(super) use supports::{reachable, Supports};
pub(super) use units::{Depends, Moving, Owner, SLIDES};

use self::bundled::Bundled;
use self::contacts::WATCHED;
use self::entries::Entries;
use self::limit::Limit;
use self::on_demand::{Demand, TOGETHER};
use self::rows::{Filled, Fixed};
use self::selection::Selected;
use self::stages::Side;
use self::still::Still;
use super::guard::Guards;
use super::sets;
use super::step::Stages;
use super::Selection;
use crate::dcs::{filippov, Cell, Dcs, Drift};
use crate::func::{Dims, EvalError, EvalResult, Function};
use crate::system::{SharedFunction, System};

/// One subsystem.
pub(super) struct Sub {
    rows: Vec<usize>,
    modes: SharedFunction,
    indicators: SharedFunction,
    pub(super) cells: Vec<Cell>,
    /// Cells (of the subsystem) of every mode.
    cells_of: Vec<Vec<usize>>,
    /// First cell among those of all subsystems.
    pub(super) first: usize,
    /// First of its indicator functions among those of all subsystems.
    pub(super) q0: usize,
    /// Number of indicator functions.
    pub(super) n_q: usize,
    /// Indicators come from signs of switching functions.
    pub(super) signs: bool,
    /// Their gradient is constant.
    pub(super) affine: bool,
    /// Outputs of all modes.
    n_out: usize,
    /// The states driven are all, in order.
    identity: bool,
    /// Where the entries of the Jacobian of the indicators go.
    to_dq: Vec<usize>,
    /// Where the entries of the gradients of its indicators stand in a row of `C`, from the first of them on.
    c_places: Vec<usize>,
}

/// Which cells have every mode.
fn cells_of_modes(cells: &[Cell]) -> Vec<Vec<usize>> {
    let mut out = vec![Vec::new(); cells.iter().map(|c| c.mode + 1).max().unwrap_or(0)];
    cells.iter().enumerate().for_each(|(k, c)| out[c.mode].push(k));
    out
}

impl Sub {
    /// The inputs that its indicators depend on, ascending; notes where the entries of their gradients stand among them.
    fn collect_columns(&mut self, gradients: &Gradients) -> Vec<usize> {
        let rows = self.q0..self.q0 + self.n_q;
        let mut columns: Vec<usize> = rows.clone().flat_map(|j| gradients.entries(j).1).copied().collect();
        columns.sort_unstable();
        columns.dedup();
        let place = |c: &usize| columns.partition_point(|d| d < c);
        self.c_places = rows.flat_map(|j| gradients.entries(j).1.iter().map(place)).collect();
        columns
    }

    /// Does the mode of this cell (of the subsystem) depend on the sign of function `j`?
    pub(super) fn cares(&self, cell: usize, j: usize) -> bool {
        let Cell { mode, weights } = &self.cells[cell];
        self.cells_of[*mode].iter().all(|&c| self.cells[c].weights[j] == weights[j])
    }
}

/// An algebraic variable: a cell and the cell it is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pair {
    sub: usize,
    cell: usize,
    base: usize,
}

/// Counts of work.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub(super) values: usize,
    pub(super) jacobians: usize,
    /// Of Jacobians of the velocity.
    pub(super) entries: usize,
}

/// What an evaluator stands at.
pub(super) struct Held {
    active: Vec<Vec<usize>>,
    unit: Vec<f64>,
    q_unit: Vec<f64>,
    p: Vec<f64>,
    u: Vec<f64>,
}

/// What holds without an evaluation.
struct Valid {
    /// Gradients are the same at any point.
    constant: bool,
    /// Those of indicators are known, those of guards, and those that single units know.
    gradients: bool,
    guards: bool,
    straight: bool,
    /// The rows of `C` are those of the present active set and scale, for any point where gradients are constant.
    rows: bool,
}

impl Valid {
    /// Nothing, but that gradients are constant or not.
    fn new(constant: bool) -> Valid {
        Valid { constant, gradients: false, guards: false, straight: false, rows: false }
    }
}

/// What sliding modes are at the stages of the present step of an explicit pair.
pub(super) struct Traces {
    weights: Vec<Stages>,
    /// The columns of `D`, one after the other, where they are kept: for derivatives.
    columns: Vec<Stages>,
    pub(super) keeps_columns: bool,
}

/// The Jacobian of the velocity: for fixed weights, and with what the weights of sliding modes add.
struct Linear {
    fixed: Fixed,
    filled: Option<Box<Filled>>,
    /// Are the last rows those with what the weights add?
    weights_add: bool,
}

/// Evaluates the system under its active set. All memory is allocated once.
pub(super) struct Field {
    pub(super) nx: usize,
    /// Columns of Jacobians: `x`, `p`, `u`, `t`.
    pub(super) n_z: usize,
    pub(super) u: Vec<f64>,
    pub(super) p: Vec<f64>,
    /// Size below which the tolerance of a state is absolute, `atol / rtol`: a state that is zero counts as so large.
    pub(super) floor: Vec<f64>,
    pub(super) subs: Vec<Sub>,
    /// Transitions; their guards have the last places among the indicator functions.
    pub(super) guards: Guards,
    pub(super) n_cells: usize,
    /// Subsystem of every cell.
    pub(super) owner: Vec<usize>,
    drifts: Vec<Drift>,
    /// The first drift is the whole right-hand side of the states: written without a detour.
    direct: bool,
    /// Active cells per subsystem, never empty.
    pub(super) active: Vec<Vec<usize>>,
    pairs: Vec<Pair>,
    /// First pair of every subsystem; one place more than there are subsystems.
    first_pair: Vec<usize>,
    /// Where one mode is the whole right-hand side: its outputs among those of all modes, and how many those are.
    lone: Option<(usize, usize, usize)>,
    /// Reciprocal of what every constraint changes by when all states change by their size.
    unit: Vec<f64>,
    /// The same for the switching functions, whose units have nothing to do with each other; 1 for indicators, which are
    /// compared with each other.
    q_unit: Vec<f64>,
    /// Indicator functions at the last point.
    pub(super) q: Vec<f64>,
    /// Entries of their gradients.
    pub(super) dq: Vec<f64>,
    /// Which entries these are.
    pub(super) gradients: Gradients,
    valid: Valid,
    /// `b`.
    base: Vec<f64>,
    /// `D`, and the rows of `C`, scaled.
    sliding: Sliding,
    /// The motion in a limit set, where the present mode is one.
    pub(super) limit: Option<Box<Limit>>,
    /// How weights are selected where surfaces meet and do not determine them, and the intersections of the present active set.
    pub(super) selection: Selection,
    selected: Option<Box<Selected>>,
    /// Weights at the last point.
    pub(super) alpha: Vec<f64>,
    pub(super) traces: Traces,
    side: Option<Box<Side>>,
    still: Still,
    room: Vec<f64>,
    linear: Linear,
    /// Weights of the indicators of one subsystem.
    q_weights: Vec<f64>,
    buffer: Vec<f64>,
    work: Vec<f64>,
    /// Drifts, modes and indicators in one program, where there is one.
    bundle: Option<Bundled>,
    /// Where the entries of the Jacobian go, where most of them are zero.
    entries: Option<Entries>,
    /// Contacts; where there are any, nothing but transitions moves the system beside them, and the active sets are their modes.
    contacts: Option<Box<Contacts>>,
    /// Modes that are formed on demand; where there are any, they are those of the only subsystem.
    demand: Option<Box<Demand>>,
    pub(super) counts: Counts,
}

impl Field {
    pub(super) fn new(dcs: &Dcs, system: &System) -> Field {
        let (dims, transitions) = (dcs.dims(), system.transitions());
        let nx = dims.x;
        let (mut subs, mut owner) = (Vec::new(), Vec::new());
        let (mut buffer, mut work, mut q0) = (0, 0, 0);
        let mut gradients = Gradients::new(&dims);
        let mut note = |f: &dyn Function| {
            buffer = buffer.max(f.n_out()).max(f.jac_pattern().nnz()).max(f.hess_pattern().nnz());
            work = work.max(f.work_len());
        };
        for d in dcs.drifts() {
            note(d.f.as_ref());
        }
        for (k, s) in dcs.subsystems().iter().enumerate() {
            note(s.modes.as_ref());
            note(s.indicators.as_ref());
            let n_q = s.indicators.n_out();
            subs.push(Sub {
                rows: s.rows.clone(),
                modes: s.modes.clone(),
                indicators: s.indicators.clone(),
                cells: s.cells.clone(),
                cells_of: cells_of_modes(&s.cells),
                first: owner.len(),
                q0,
                n_q,
                signs: s.by_signs(),
                affine: s.indicators.hess_pattern().nnz() == 0,
                n_out: s.modes.n_out(),
                identity: is_identity(&s.rows, nx),
                to_dq: gradients.push(s.indicators.jac_pattern(), &dims),
                c_places: Vec::new(),
            });
            owner.resize(owner.len() + s.cells.len(), k);
            q0 += n_q;
        }
        let demand = system.on_demand().map(|d| Box::new(Demand::new(d)));
        if let Some(d) = &demand {
            let (modes, indicators) = (d.modes(), d.indicators());
            note(modes.as_ref());
            note(indicators.as_ref());
            q0 = TOGETHER * d.n_functions();
            subs.push(Sub {
                rows: (0..nx).collect(),
                cells_of: cells_of_modes(&d.cells()),
                cells: d.cells(),
                first: 0,
                q0: 0,
                n_q: q0,
                signs: true,
                affine: d.is_affine(),
                n_out: modes.n_out(),
                identity: true,
                to_dq: gradients.push(indicators.jac_pattern(), &dims),
                c_places: Vec::new(),
                modes,
                indicators,
            });
            owner.resize(subs[0].cells.len(), 0);
        }
        transitions.iter().flat_map(|t| t.reset.iter().map(|r| &r.f).chain([&t.guard])).for_each(|f| note(f.as_ref()));
        let guards = Guards::new(transitions, q0, &dims, &mut gradients);
        q0 += guards.n_outputs();
        let (n_cells, n_z) = (owner.len(), nx + dims.p + dims.u + 1);
        let columns = subs.iter_mut().map(|s| s.collect_columns(&gradients)).collect();
        let rows = subs.iter().map(|s| s.rows.clone()).collect();
        let contacts = system.mechanics().map(|m| Box::new(Contacts::new(m, q0, nx, n_z)));
        let n_contacts = system.mechanics().map_or(0, |m| m.contacts.len());
        q0 += WATCHED * n_contacts;
        let most = n_cells.saturating_sub(subs.len());
        let entries = Entries::new(nx, dcs.drifts(), &subs).filter(|_| contacts.is_none());
        let bundle = Bundled::new(nx, dcs.drifts(), &subs, &guards).filter(|_| contacts.is_none());
        let fixed = Fixed::new(nx, dims.p, dims.u, dcs.drifts(), &subs);
        Field {
            nx,
            n_z,
            u: vec![0.0; dims.u],
            p: vec![0.0; dims.p],
            floor: vec![0.0; nx],
            active: subs
                .iter()
                .map(|s| Vec::with_capacity(s.cells.len()))
                .chain((0..n_contacts).map(|_| Vec::with_capacity(1)))
                .collect(),
            valid: Valid::new(subs.iter().all(|s| s.affine) && guards.all.iter().all(|g| g.affine)),
            subs,
            guards,
            n_cells,
            owner,
            direct: dcs.drifts().first().is_some_and(|d| is_identity(&d.rows, nx)),
            drifts: dcs.drifts().to_vec(),
            pairs: Vec::with_capacity(most),
            first_pair: Vec::new(),
            lone: None,
            unit: vec![1.0; most],
            q_unit: vec![1.0; q0],
            q: vec![0.0; q0],
            dq: vec![0.0; gradients.len()],
            gradients,
            base: vec![0.0; nx],
            sliding: Sliding::new(rows, columns, (nx, n_z)),
            limit: None,
            selection: Selection::Bilinear,
            selected: None,
            alpha: vec![0.0; most],
            traces: Traces { weights: vec![[0.0; 16]; most], columns: Vec::new(), keeps_columns: false },
            side: None,
            still: Still::default(),
            room: vec![0.0; most],
            linear: Linear { fixed, filled: None, weights_add: false },
            q_weights: vec![0.0; q0],
            buffer: vec![0.0; buffer],
            work: vec![0.0; work],
            bundle,
            entries,
            contacts,
            demand,
            counts: Counts::default(),
        }
    }

    /// Number of algebraic variables: 0 outside of sliding modes.
    pub(super) fn n_alg(&self) -> usize {
        self.pairs.len()
    }

    /// The algebraic variables of the present active set.
    pub(super) fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// The algebraic variables of subsystem `k`.
    fn pairs_of(&self, k: usize) -> std::ops::Range<usize> {
        self.first_pair[k]..self.first_pair[k + 1]
    }

    /// Column `i` of `D` at the last point: states, and how it moves them.
    pub(super) fn d(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.sliding.column(self.pairs[i], i)
    }

    /// Row `i` of `C` at the last point, scaled: inputs, and the derivatives by them.
    pub(super) fn c(&self, i: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.sliding.row(self.pairs[i], i)
    }

    /// The gradient of watched function `j` at the last point.
    pub(super) fn gradient_row(&self, j: usize) -> Row<'_> {
        self.gradients.row(&self.dq, j)
    }

    /// Parameters or controls have changed: nothing is known any more.
    pub(super) fn forget(&mut self) {
        self.valid = Valid::new(self.valid.constant);
        self.guards.forget();
        if let Some(c) = &mut self.contacts {
            c.forget();
        }
    }

    /// What [`Field::release`] brings back.
    pub(super) fn hold(&self) -> Held {
        Held {
            active: self.active.clone(),
            unit: self.unit.clone(),
            q_unit: self.q_unit.clone(),
            p: self.p.clone(),
            u: self.u.clone(),
        }
    }

    /// Active set, parameters and controls as they were.
    pub(super) fn release(&mut self, held: Held) {
        if held.active.iter().all(|a| !a.is_empty()) {
            self.set_active(&held.active);
        }
        (self.unit, self.q_unit, self.p, self.u) = (held.unit, held.q_unit, held.p, held.u);
        self.forget();
    }

    /// Makes `sets` the active cells.
    pub(super) fn set_active(&mut self, sets: &[Vec<usize>]) {
        sets::copy(&mut self.active, sets);
        self.lay_out(sets.len());
    }

    /// Takes over the active cells as they stand.
    pub(super) fn take_active(&mut self) {
        self.lay_out(self.active.len());
    }

    /// Makes room for the modes that are active in the first `n` subsystems.
    fn lay_out(&mut self, n: usize) {
        self.limit = None;
        self.valid.rows = false;
        if let Some(f) = &mut self.linear.filled {
            f.listed = false;
        }
        self.still.known = false;
        if let Some(b) = &mut self.bundle {
            b.listed = false;
        }
        self.pairs.clear();
        self.first_pair.clear();
        if let Some(c) = &mut self.contacts {
            c.forget();
        }
        for (k, from) in self.active[..n].iter().enumerate() {
            self.first_pair.push(self.pairs.len());
            for &cell in from.iter().skip(1) {
                self.pairs.push(Pair { sub: k, cell, base: from[0] });
            }
        }
        self.first_pair.push(self.pairs.len());
        self.lone = None;
        if self.contacts.is_some() {
            return;
        }
        self.sliding.lay_out(&self.pairs, &self.first_pair);
        self.find_intersections();
        if let ([s], true, true) = (&self.subs[..], self.drifts.is_empty(), self.pairs.is_empty()) {
            if s.identity {
                let mode = s.cells[self.active[0][0] - s.first].mode;
                self.lone = Some((mode * self.nx, (mode + 1) * self.nx, s.n_out));
            }
        }
    }

    /// Scales the constraints: their values are relative to the sizes of the states at this point.
    pub(super) fn scale_constraints(&mut self, t: f64, x: &[f64]) -> EvalResult {
        if self.pairs.is_empty() {
            return Ok(());
        }
        self.gradients(t, x)?;
        self.valid.rows = false;
        self.unit.fill(1.0);
        let reciprocal = |size: f64| if size > 0.0 { 1.0 / size } else { 1.0 };
        let sliding = |k: &usize| self.first_pair[*k + 1] > self.first_pair[*k];
        for s in (0..self.subs.len()).filter(sliding).map(|k| &self.subs[k]).filter(|s| s.signs) {
            for j in s.q0..s.q0 + s.n_q {
                self.q_unit[j] = reciprocal(self.sum_of_sizes(self.gradient_row(j).states(), x));
            }
        }
        self.constraint_rows();
        for i in 0..self.pairs.len() {
            let size = self.sum_of_sizes(self.sliding.row_of_states(self.pairs[i], i), x);
            self.unit[i] = reciprocal(size);
            let unit = self.unit[i];
            self.sliding.row_mut(i).iter_mut().for_each(|c| *c *= unit);
        }
        self.valid.rows = true;
        Ok(())
    }

    /// The switching functions of subsystem `k`; none where indicators are compared with each other.
    pub(super) fn surfaces(&self, k: usize) -> std::ops::Range<usize> {
        let s = &self.subs[k];
        s.q0..if s.signs { s.q0 + s.n_q } else { s.q0 }
    }

    /// Modes active in subsystem `k`, ascending, each once.
    pub(super) fn modes(&self, k: usize) -> Vec<usize> {
        self.modes_of(k, &self.active[k])
    }

    /// Modes of a set of cells of subsystem `k`, ascending, each once.
    pub(super) fn modes_of(&self, k: usize, set: &[usize]) -> Vec<usize> {
        let Some(s) = self.subs.get(k) else { return set.to_vec() };
        let mut m: Vec<usize> = set.iter().map(|c| s.cells[c - s.first].mode).collect();
        m.sort_unstable();
        m.dedup();
        m
    }

    /// Are the modes of one set of cells of subsystem `k` among those of another?
    pub(super) fn has_modes_of(&self, k: usize, set: &[usize], other: &[usize]) -> bool {
        let mode = |c: usize| self.subs.get(k).map_or(c, |s| s.cells[c - s.first].mode);
        set.iter().all(|a| other.iter().any(|b| mode(*a) == mode(*b)))
    }

    /// Size of a state, for comparisons with it and with others: its value, and what its tolerances take for zero. All
    /// that is "small" in the engine is small compared with this, so that no answer depends on units.
    #[inline]
    pub(super) fn size(&self, i: usize, value: f64) -> f64 {
        value.abs() + self.floor[i]
    }

    /// `Σ |g_i| size_i`: what a function with the gradient `g` changes by when all states change by their size.
    pub(super) fn sum_of_sizes(&self, g: impl Iterator<Item = (usize, f64)>, x: &[f64]) -> f64 {
        g.map(|(i, g)| g.abs() * self.size(i, x[i])).sum()
    }

    /// Reciprocal of the time in which the first state has moved by its size with this velocity.
    pub(super) fn pace(&self, x: &[f64], velocity: &[f64]) -> f64 {
        filippov::pace(self, x, velocity)
    }

    /// Moves `x` by rounding into the region of a cell, away from the surfaces it lies on; gradients are those of the
    /// last point.
    pub(super) fn nudge(&self, cell: usize, x: &mut [f64]) {
        let s = &self.subs[self.owner[cell]];
        for (j, w) in s.cells[cell - s.first].weights.iter().enumerate() {
            let g = self.gradient_row(s.q0 + j);
            if self.q[s.q0 + j].abs() > 64.0 * f64::EPSILON * self.sum_of_sizes(g.states(), x) {
                continue;
            }
            for (i, g) in g.states().filter(|(_, g)| *g != 0.0) {
                x[i] -= w * g.signum() * (8.0 * f64::EPSILON * self.size(i, x[i])).max(f64::MIN_POSITIVE);
            }
        }
    }

    /// Rows of `C` from the gradients of the last point.
    fn constraint_rows(&mut self) {
        for (i, p) in self.pairs.iter().enumerate() {
            let s = &self.subs[p.sub];
            let row = self.sliding.row_mut(i);
            row.fill(0.0);
            let (w, w0) = (&s.cells[p.cell - s.first].weights, &s.cells[p.base - s.first].weights);
            let own = self.gradients.entries(s.q0).0.start;
            for j in 0..s.n_q {
                let weight = (w[j] - w0[j]) * self.unit[i] * self.q_unit[s.q0 + j];
                if weight != 0.0 {
                    for e in self.gradients.entries(s.q0 + j).0 {
                        row[s.c_places[e - own]] += weight * self.dq[e];
                    }
                }
            }
        }
    }

    /// Constraint `i` from the indicators of the last point.
    pub(super) fn constraint(&self, i: usize) -> f64 {
        let p = self.pairs[i];
        let s = &self.subs[p.sub];
        let (w, w0) = (&s.cells[p.cell - s.first].weights, &s.cells[p.base - s.first].weights);
        self.unit[i] * (0..s.n_q).map(|j| (w[j] - w0[j]) * self.q_unit[s.q0 + j] * self.q[s.q0 + j]).sum::<f64>()
    }

    /// Everything of a sliding mode at a point: `b`, `D`, `C` and the weights (6.17c).
    pub(super) fn hidden(&mut self, t: f64, x: &[f64]) -> EvalResult {
        if self.limit.is_some() {
            return self.hidden_limit(t, x);
        }
        self.parts(t, x)?;
        self.gradients(t, x)?;
        if !(self.valid.rows && self.valid.constant) {
            self.constraint_rows();
            self.valid.rows = true;
        }
        let r = self.pairs.len();
        match self.sliding.weights_alone(&self.pairs, &self.base, &mut self.alpha[..r]) {
            Some(true) => return Ok(()),
            Some(false) => return Err(EvalError::Recoverable),
            None => {}
        }
        for i in 0..r {
            self.alpha[i] = -self.sliding.rate(self.pairs[i], i, &self.base);
        }
        if !self.sliding.factorise(&self.pairs, &self.first_pair) {
            return Err(EvalError::Recoverable);
        }
        self.sliding.solve(&mut self.alpha[..r]);
        self.select_weights()
    }

    /// Solves with the transpose of `C D` of the last [`Field::hidden`].
    pub(super) fn solve_constraints_transposed(&mut self, b: &mut [f64]) {
        self.sliding.solve_transposed(b);
    }

    /// Solves with `C D` of the last [`Field::hidden`] for `n` right-hand sides, `b [r × n]`.
    pub(super) fn solve_constraints(&mut self, n: usize, b: &mut [f64]) {
        self.sliding.solve_rows(n, b);
    }

    /// Moves `x` along `D` until all constraints hold to rounding; `C D` is that of the last [`Field::hidden`]. Says
    /// whether `x` has changed. Where it has not, in a sliding mode, the indicators are those at `x`.
    pub(super) fn project(&mut self, t: f64, x: &mut [f64]) -> Result<bool, EvalError> {
        if self.limit.is_some() {
            return self.project_limit(t, x);
        }
        let r = self.pairs.len();
        let mut moved = false;
        let mut before = f64::INFINITY;
        for _ in 0..if r == 0 { 0 } else { 4 } {
            self.indicators(t, x)?;
            let mut worst = 0.0f64;
            for i in 0..r {
                self.room[i] = -self.constraint(i);
                worst = worst.max(self.room[i].abs());
            }
            // constraints are relative to the sizes of the states
            if worst >= 0.5 * before || worst <= f64::EPSILON {
                break;
            }
            before = worst;
            moved = true;
            self.sliding.solve(&mut self.room[..r]);
            self.return_to_intersections();
            for i in 0..r {
                for (row, d) in self.d(i) {
                    x[row] += self.room[i] * d;
                }
            }
        }
        Ok(moved)
    }

    /// Largest component of `D` at the last point.
    pub(super) fn largest_difference(&self) -> f64 {
        (0..self.pairs.len()).flat_map(|i| self.d(i)).fold(0.0, |m, (_, v)| m.max(v.abs()))
    }

    /// Weight of an active cell at the last point.
    pub(super) fn theta(&self, cell: usize) -> f64 {
        self.theta_in(&self.alpha, cell)
    }

    /// Weight of an active cell among these algebraic variables.
    pub(super) fn theta_in(&self, alpha: &[f64], cell: usize) -> f64 {
        let mut base = 1.0;
        for i in self.pairs_of(self.owner[cell]) {
            if self.pairs[i].cell == cell {
                return alpha[i];
            }
            base -= alpha[i];
        }
        base
    }

    /// Least and largest weight of an active cell at these stages of an explicit pair.
    pub(super) fn theta_at_stages(&self, cell: usize, stages: std::ops::Range<usize>) -> (f64, f64) {
        let pairs = self.pairs_of(self.owner[cell]);
        let own = pairs.clone().find(|j| self.pairs[*j].cell == cell);
        let theta = |i: usize| match own {
            Some(j) => self.traces.weights[j][i],
            None => pairs.clone().fold(1.0, |base, j| base - self.traces.weights[j][i]),
        };
        stages.map(theta).fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(v), hi.max(v)))
    }

    /// Active cells, which contacts have none of.
    pub(super) fn active_cells(&self) -> impl Iterator<Item = usize> + '_ {
        self.active[..self.subs.len()].iter().flatten().copied()
    }

    /// Are the gradients of the indicators the same everywhere?
    pub(super) fn constant_gradients(&self) -> bool {
        self.valid.constant
    }
}

/// Where the entries of the Jacobian of a function go: these rows, with the columns `x`, `p`, `u`, `t`.
pub(super) fn gradient_map(f: &SharedFunction, rows: &[usize], dims: &Dims) -> Vec<usize> {
    let column = Columns { nx: dims.x, nu: dims.u, np: dims.p };
    let (p, n_z) = (f.jac_pattern(), dims.x + dims.p + dims.u + 1);
    let mut map = vec![0; p.nnz()];
    for (col, own) in p.columns() {
        let to = column.of(col);
        for k in own {
            map[k] = rows[p.row_idx()[k]] * n_z + to;
        }
    }
    map
}

fn is_identity(rows: &[usize], nx: usize) -> bool {
    rows.len() == nx && rows.iter().enumerate().all(|(i, &r)| i == r)
}

/// Where the columns `x`, `u`, `p`, `t` of a pattern go: parameters before controls.
struct Columns {
    nx: usize,
    nu: usize,
    np: usize,
}

impl Columns {
    fn of(&self, col: usize) -> usize {
        let Columns { nx, nu, np } = *self;
        match col {
            c if c < nx => c,
            c if c < nx + nu => c + np,
            c if c < nx + nu + np => c - nu,
            c => c,
        }
    }
}
