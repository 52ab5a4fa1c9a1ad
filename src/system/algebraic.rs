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
//!
//! Where two modes are apart at the surface between them, and neither goes on beyond it, the surface is held: a further mode, in which the
//! weight of both is an unknown, see [`held`](super::held).

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use super::held::{are_one, bends_of, flows, By, Flow, Held, Taken};
use super::steps::{held_by, of_fewer, of_weights, signs_of_step};
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
/// Where a surface may be held, functions within so many times their rounding are on it.
const NEAR: f64 = 16.0;
/// A weight this little outside of its interval is at its end.
const ROUNDED: f64 = 1e-10;

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
    /// Where the derivatives of its equations by the weight of its loop go.
    by_weight: Vec<usize>,
}

impl Part {
    /// Its outputs under a mode.
    pub(super) fn outputs(&self, mode: usize) -> Range<usize> {
        let by = self.switched.map_or(0, |(_, n)| mode * n);
        self.outputs.start + by..self.outputs.end + by
    }

    /// The loop whose modes it has.
    pub(super) fn of_loop(&self) -> Option<usize> {
        self.switched.map(|s| s.0)
    }

    /// The equation of an output of any mode.
    fn equation(&self, output: usize) -> Option<usize> {
        let o = self.switched.map_or(output, |(_, n)| output % n);
        self.outputs.contains(&o).then(|| self.equations[o - self.outputs.start])
    }
}

/// A subsystem that switches inside of the equations, or a step of an inclusion.
pub(super) struct Loop {
    /// Its place in the system; steps of inclusions stand behind all subsystems.
    pub(super) subsystem: usize,
    /// A step, whose weight is an argument of functions: the inclusion and its number there. It is 1 in the first mode and 0 in the
    /// second one, or found where its surface is held.
    pub(super) step: Option<(usize, usize)>,
    pub(super) n_modes: usize,
    regions: Regions,
    /// Surfaces that may be held: mode `n_modes + i` holds the one of entry `i`. Its weight is this one of all, if there are any.
    pub(super) held: Vec<Held>,
    pub(super) weight: Option<usize>,
}

impl Loop {
    /// Switching functions, or indicators.
    pub(super) fn functions(&self) -> &SharedFunction {
        let (Regions::Signs { psi: f, .. } | Regions::Indicators(f)) = &self.regions;
        f
    }

    /// All modes, with those that hold a surface.
    pub(super) fn n_all(&self) -> usize {
        self.n_modes + self.held.len()
    }

    /// The modes that are active in one of all, ascending.
    pub(super) fn active(&self, mode: usize) -> Vec<usize> {
        match self.held.get(mode.wrapping_sub(self.n_modes)) {
            Some(h) => vec![h.low.min(h.high), h.low.max(h.high)],
            None => vec![mode],
        }
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

impl Loop {
    /// Its weight in one of its own modes.
    pub(super) fn weight_in(&self, mode: usize) -> f64 {
        if self.step.is_some() {
            f64::from(mode == 0)
        } else {
            0.0
        }
    }

    /// The surfaces that two modes are apart by, and that may be held.
    fn surfaces(&self, system: &System, known: &[bool]) -> Vec<Held> {
        if let Some(step) = self.step {
            let by = held_by(system, step, known);
            let terms: Vec<(usize, f64)> = self.exits(1).into_iter().flat_map(|e| e.0).collect();
            return by.map(|by| Held { low: 1, high: 0, terms, by }).into_iter().collect();
        }
        let (s, psi, z) = (&system.subsystems[self.subsystem], self.functions(), system.algebraic_states());
        let mut all: Vec<Held> = Vec::new();
        for low in 0..self.n_modes {
            for (terms, high) in self.exits(low) {
                let is_there = |h: &Held| (h.low, h.high) == (high, low) || (h.low, h.high) == (low, high);
                if all.iter().any(is_there) || are_one(s, psi, &terms, (low, high)) {
                    continue;
                }
                let p = psi.jac_pattern();
                let depends = |c: usize| p.rows(c).iter().any(|r| terms.iter().any(|t| t.0 == *r));
                let by = if z.clone().any(depends) { By::Value } else { By::Rate };
                if by == By::Rate && !(0..z.start).all(|i| known[i] || !depends(i)) {
                    continue;
                }
                all.push(Held { low, high, terms, by });
            }
        }
        all
    }

    /// The mode that holds the surface between two modes.
    pub(super) fn between(&self, a: usize, b: usize) -> Option<usize> {
        let is_it = |h: &Held| (h.low, h.high) == (a, b) || (h.low, h.high) == (b, a);
        self.held.iter().position(is_it).map(|i| self.n_modes + i)
    }

    /// The mode that follows where another surface of a mode than the one that is held is passed.
    fn leaves(&self, mode: usize, h: &Held, v: &[f64], rounding: &[f64]) -> Option<usize> {
        let passed = |terms: &[(usize, f64)]| {
            let sum = |of: &dyn Fn(&(usize, f64)) -> f64| terms.iter().map(of).sum::<f64>();
            sum(&|(o, t)| t * v[*o]) > sum(&|(o, t)| t.abs() * rounding[*o])
        };
        let others = self.exits(mode).into_iter().filter(|e| e.1 != h.low && e.1 != h.high);
        others.into_iter().find(|e| passed(&e.0)).map(|e| e.1)
    }

    /// How the mode that holds a surface may end, but for its weight.
    pub(super) fn exits_of_held(&self, h: &Held) -> Vec<(Vec<(usize, f64)>, usize)> {
        let mut all: Vec<(Vec<(usize, f64)>, usize)> = Vec::new();
        for e in self.exits(h.low).into_iter().chain(self.exits(h.high)) {
            if e.1 != h.low && e.1 != h.high && !all.iter().any(|a| a.0 == e.0) {
                all.push(e);
            }
        }
        all
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
    /// Block of every unknown: algebraic states, then weights.
    pub(super) block_of: Vec<usize>,
    /// What gives derivatives, and which states it moves.
    pub(super) flows: Vec<Flow>,
    pub(super) driven: Vec<bool>,
    /// Entries of the Jacobian in the equation of every weight: column, place.
    rows_of_weights: Vec<Vec<(usize, usize)>>,
    n_weights: usize,
    /// The functions of the inclusions, of the states and all weights.
    pub(super) inclusions: Vec<SharedFunction>,
    /// The equations are part of a scene.
    of_scene: bool,
    /// The Jacobian is the same everywhere.
    pub(super) affine: bool,
    solver: Mutex<Solver>,
}

/// What the last point was, and what is known there.
#[derive(Default)]
pub(super) struct Solver {
    t: f64,
    /// States with the guess and the modes, controls, parameters.
    key: Vec<f64>,
    /// Modes of the subsystems that switch inside of the equations.
    pub(super) modes: Vec<usize>,
    pub(super) known: Option<std::result::Result<(), EvalError>>,
    /// The states with the solution, and the weights behind them.
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
    pub(super) buffer: Vec<f64>,
    pub(super) other: Vec<f64>,
    pub(super) work: Vec<f64>,
    /// Weights where functions are evaluated, and room for the equations of weights: derivatives of the states, of a surface, and of such an equation by all it depends on.
    pub(super) w: Vec<f64>,
    /// The states, and the weights behind them, where functions are evaluated.
    pub(super) whole: Vec<f64>,
    pub(super) rate: Vec<f64>,
    pub(super) gradient: Vec<f64>,
    pub(super) row: Vec<f64>,
    pub(super) column: Vec<f64>,
    pub(super) failure: Option<(f64, Failure)>,
    /// A weight that is given, to see what follows from it: its loop and its value.
    pub(super) fixed: Option<(usize, f64)>,
    guess: Guess,
    tangent: Tangent,
}

/// A solution from which others begin: the stages of a step have the one where it starts as their guess. Along its tangent they begin
/// with an error of second order.
#[derive(Default)]
struct Tangent {
    state: TangentState,
    /// The point: time; states, controls and parameters as in [`Solver::key`]; the modes.
    t: f64,
    key: Vec<f64>,
    modes: Vec<usize>,
    /// The solution.
    unknowns: Vec<f64>,
    /// Derivatives of the unknowns of a block by its columns.
    slopes: Vec<Vec<f64>>,
    /// Sign of the determinant of `h_z`.
    negative: bool,
}

#[derive(Default, PartialEq)]
enum TangentState {
    #[default]
    None,
    /// A point, from which nothing has begun yet but one solution.
    Point,
    Slopes,
    /// The solution has no derivatives there.
    Singular,
}

impl Solver {
    /// The states of a point and the present weights behind them; give it back.
    pub(super) fn whole(&mut self, at: &Point) -> Vec<f64> {
        let mut whole = std::mem::take(&mut self.whole);
        whole.clear();
        whole.extend_from_slice(at.x);
        whole.extend_from_slice(&self.w);
        whole
    }
}

impl Algebraic {
    /// Of a system with algebraic states or inclusions.
    ///
    /// # Errors
    /// [`Error::State`] where an equation contains none of the states.
    pub(crate) fn new(system: &System) -> Result<Algebraic> {
        let (dims, nz, z) = (system.dims, system.n_z, system.algebraic_states());
        let nd = z.start;
        let mut parts = Vec::new();
        let mut add = |f: &SharedFunction, outputs: Range<usize>, equations: Vec<usize>, switched| {
            parts.push(Part { f: f.clone(), outputs, equations, switched, to_jac: Vec::new(), by_weight: Vec::new() });
        };
        if let Some(f) = &system.f0 {
            add(f, z.clone(), (0..nz).collect(), None);
        }
        if let Some(m) = &system.mechanics {
            add(&of_fewer(&m.smooth, dims), z.clone(), (0..nz).collect(), None);
        }
        if let Some(f) = &system.algebraic {
            add(f, 0..nz, (0..nz).collect(), None);
        }
        let mut loops: Vec<Loop> = Vec::new();
        for (k, s) in system.subsystems.iter().enumerate().filter(|s| s.1.rows.iter().any(|r| z.contains(r))) {
            let switched = (s.n_modes > 1).then_some((loops.len(), s.rows.len()));
            if s.n_modes > 1 {
                loops.push(Loop {
                    subsystem: k,
                    step: None,
                    n_modes: s.n_modes,
                    regions: s.regions.clone(),
                    held: Vec::new(),
                    weight: None,
                });
            }
            for (o, r) in s.rows.iter().enumerate().filter(|r| z.contains(r.1)) {
                add(&s.modes, o..o + 1, vec![r - nd], switched);
            }
        }
        let loop_of = |k: usize| loops.iter().position(|l| l.subsystem == k);
        let (mut flows, mut driven, known) = flows(system, &loop_of);
        let n_subsystems = system.subsystems.len();
        for (k, i) in system.inclusions.iter().enumerate() {
            let n = i.psi.n_out();
            let steps = (0..n).map(|j| Loop {
                subsystem: n_subsystems + loops.iter().filter(|l| l.step.is_some()).count() + j,
                step: Some((k, j)),
                n_modes: 2,
                regions: Regions::Signs { psi: i.psi.clone(), signs: signs_of_step(n, j) },
                held: Vec::new(),
                weight: None,
            });
            let steps: Vec<Loop> = steps.collect();
            loops.extend(steps);
        }
        let mut n_weights = 0;
        for l in &mut loops {
            l.held = l.surfaces(system, &known);
            l.weight = (l.step.is_some() || !l.held.is_empty()).then_some(n_weights);
            n_weights += usize::from(l.weight.is_some());
        }
        let mut inclusions = Vec::with_capacity(system.inclusions.len());
        for (k, i) in system.inclusions.iter().enumerate() {
            let first = loops.iter().find(|l| l.step == Some((k, 0))).and_then(|l| l.weight).unwrap_or(n_weights);
            let f = of_weights(&i.f, dims, (first, n_weights));
            let rows = i.rows.iter().copied().enumerate();
            for (o, r) in rows.clone().filter(|r| z.contains(&r.1)) {
                add(&f, o..o + 1, vec![r - nd], None);
            }
            let rows: Vec<(usize, usize)> = rows.filter(|r| !z.contains(&r.1)).collect();
            rows.iter().for_each(|r| driven[r.1] = true);
            if !rows.is_empty() {
                flows.push(Flow { f: f.clone(), rows, switched: None });
            }
            inclusions.push(f);
        }
        let mut all = Algebraic {
            dims,
            z,
            loops,
            parts,
            jac: Pattern::empty(0, 0),
            blocks: Vec::new(),
            block_of: Vec::new(),
            flows,
            driven,
            rows_of_weights: Vec::new(),
            n_weights,
            inclusions,
            of_scene: system.mechanics.is_some(),
            affine: false,
            solver: Mutex::new(Solver::default()),
        };
        all.lay_out()?;
        Ok(all)
    }

    /// Pattern, blocks, and room.
    fn lay_out(&mut self) -> Result<()> {
        let (dims, nz, nd, nu) = (self.dims, self.z.len(), self.z.start, self.n_unknowns());
        let n_columns = dims.n_in() + self.n_weights;
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        for p in &self.parts {
            for (c, entries) in p.f.jac_pattern().columns() {
                for e in entries {
                    if let Some(r) = p.equation(p.f.jac_pattern().row_idx()[e]) {
                        rows.push(r);
                        cols.push(self.input_of(&p.f, c));
                    }
                }
            }
            if let Some(w) = p.of_loop().and_then(|k| self.loops[k].weight) {
                rows.extend(&p.equations);
                cols.extend(p.equations.iter().map(|_| dims.n_in() + w));
            }
        }
        let of_weights: Vec<Vec<usize>> =
            (0..self.loops.len()).filter(|k| self.loops[*k].weight.is_some()).map(|k| self.weight_columns(k)).collect();
        for (w, columns) in of_weights.iter().enumerate() {
            rows.extend(columns.iter().map(|_| nz + w));
            cols.extend(columns);
        }
        let (jac, map) = Pattern::from_triplets(nu, n_columns, &rows, &cols);
        let mut places = map.into_iter();
        for p in &mut self.parts {
            let own = |o: &usize| p.equation(*o).and_then(|_| places.next());
            let to_jac = p.f.jac_pattern().row_idx().iter().map(own).collect();
            p.to_jac = to_jac;
            if p.of_loop().is_some_and(|k| self.loops[k].weight.is_some()) {
                p.by_weight = places.by_ref().take(p.equations.len()).collect();
            }
        }
        self.rows_of_weights = of_weights.into_iter().map(|c| c.into_iter().zip(places.by_ref()).collect()).collect();
        let unknowns: Vec<usize> = (nd..nd + nz).chain(dims.n_in()..n_columns).collect();
        (self.blocks, self.block_of) = blocks(&jac, &unknowns)?;
        let parts = &self.parts;
        let linear = |p: &Part| p.f.hess_pattern().nnz() == 0 && !p.f.hessian_is_approximate();
        // equations of a scene are differentiated once: that there are no second derivatives says nothing
        self.affine = self.n_weights == 0 && !self.of_scene && parts.iter().all(linear);
        let of_flows = self.flows.iter().filter(|_| self.n_weights > 0).map(Flow::function);
        let functions = parts.iter().map(|p| &p.f).chain(self.loops.iter().map(Loop::functions)).chain(of_flows);
        let sizes = |f: &SharedFunction| f.n_out().max(f.jac_pattern().nnz()).max(f.hess_pattern().nnz());
        let (buffer, work) = functions.fold((0, 0), |(b, w): (usize, usize), f| (b.max(sizes(f)), w.max(f.work_len())));
        let blocks = &self.blocks;
        let solver = Solver {
            key: vec![0.0; self.outer().x + dims.u + dims.p],
            modes: vec![0; self.loops.len()],
            full: vec![0.0; dims.x + self.n_weights],
            jac: vec![0.0; jac.nnz()],
            units: vec![0.0; nu],
            lus: blocks.iter().map(|b| Lu::with_capacity(b.rows.len())).collect(),
            slopes: blocks.iter().map(|b| vec![0.0; b.rows.len() * b.columns.len()]).collect(),
            h: vec![0.0; nu],
            sizes: vec![0.0; nu],
            step: vec![0.0; nu],
            start: vec![0.0; nu],
            next: vec![0.0; nu],
            trial: vec![0.0; dims.x + self.n_weights],
            weights: vec![0.0; nu],
            buffer: vec![0.0; buffer],
            other: vec![0.0; buffer],
            work: vec![0.0; work],
            column: vec![0.0; nu],
            w: vec![0.0; self.n_weights],
            whole: Vec::with_capacity(dims.x + self.n_weights),
            rate: vec![0.0; dims.x],
            gradient: vec![0.0; dims.n_in()],
            row: vec![0.0; n_columns],
            tangent: Tangent {
                slopes: blocks.iter().map(|b| vec![0.0; b.rows.len() * b.columns.len()]).collect(),
                ..Tangent::default()
            },
            ..Solver::default()
        };
        (self.jac, self.solver) = (jac, Mutex::new(solver));
        Ok(())
    }

    /// The input of the system that column `c` of a function is; weights stand behind the inputs, and parameters that the system has not behind
    /// those.
    pub(super) fn input_of(&self, f: &SharedFunction, c: usize) -> usize {
        let (own, all) = (f.dims(), self.dims);
        let behind = own.x - all.x;
        match c {
            c if c < all.x => c,
            c if c < own.x => all.n_in() + c - all.x,
            c if c + 1 == own.n_in() => all.n_in() - 1,
            c if c < own.x + all.u + all.p => c - behind,
            c => all.n_in() + self.n_weights + c - (own.x + all.u + all.p),
        }
    }

    /// Weights that may be unknown.
    pub(crate) fn n_weights(&self) -> usize {
        self.n_weights
    }

    fn n_unknowns(&self) -> usize {
        self.z.len() + self.n_weights
    }

    /// The place of an unknown where weights stand behind the states of the system.
    fn place(&self, i: usize) -> usize {
        match i.checked_sub(self.z.len()) {
            Some(w) => self.dims.x + w,
            None => self.z.start + i,
        }
    }

    /// The mode of loop `k` that a discrete state stands for.
    pub(super) fn mode_at(&self, k: usize, v: f64) -> usize {
        (v as usize).min(self.loops[k].n_all() - 1)
    }

    /// The modes of loop `k` that are active in one of all.
    pub(crate) fn active(&self, k: usize, mode: usize) -> Vec<usize> {
        self.loops[k].active(mode)
    }

    /// The algebraic states.
    pub(crate) fn states(&self) -> Range<usize> {
        self.z.clone()
    }

    /// Forgets everything: the next run gives what the first one did.
    pub(crate) fn forget(&self) {
        let mut s = self.lock();
        (s.known, s.jac_known, s.slopes_known, s.failure) = (None, false, false, None);
        s.tangent.state = TangentState::None;
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
        let first = self.dims.x + self.loops.len();
        x[first..].copy_from_slice(&s.full[self.dims.x..]);
        Ok(())
    }

    /// The solution behind transition `k` of a loop from mode `before`, where the surface between may be held from here on.
    pub(crate) fn solve_behind(
        &self,
        (k, before): (usize, usize),
        t: f64,
        x: &mut [f64],
        u: &[f64],
        p: &[f64],
    ) -> EvalResult {
        let start = x.to_vec();
        let first = self.dims.x + self.loops.len();
        let weight = self.loops[k].weight;
        let now = self.mode_at(k, x[self.dims.x + k]);
        if let Some(w) = weight.filter(|_| now < self.loops[k].n_modes) {
            x[first + w] = self.loops[k].weight_in(now);
        }
        let crossed = self.solve(t, x, u, p, Guess::Jump);
        if weight.is_none() || before >= self.loops[k].n_modes {
            return crossed;
        }
        if crossed.is_ok() {
            let found = self.comes_back(&mut self.lock(), (k, before), &Point { t, x, u, p })?;
            let Some(mode) = found else { return Ok(()) };
            let is_low = self.loops[k].held[mode - self.loops[k].n_modes].low == before;
            let mut held = start;
            held[self.dims.x + k] = mode as f64;
            held[first + weight.unwrap_or(0)] = if is_low { 0.0 } else { 1.0 };
            match self.solve(t, &mut held, u, p, Guess::Jump) {
                Ok(()) => x.copy_from_slice(&held),
                // what follows says that nothing does
                Err(EvalError::Recoverable) => self.lock().known = None,
                e => return e,
            }
        }
        crossed
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
        let mut came_from = vec![None; self.loops.len()];
        for _ in 0..MOST_MODES.min(1 + self.loops.iter().map(|l| 8 * l.n_all()).sum::<usize>()) {
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
            for (k, mode) in &outside[..n] {
                let now = self.mode_at(*k, x[self.dims.x + k]);
                // each of two modes says that the other one is it: their surface is held
                let between = self.loops[*k].between(now, *mode).filter(|_| came_from[*k] == Some(*mode));
                came_from[*k] = Some(now);
                self.enter_mode(*k, between.unwrap_or(*mode), x);
            }
        }
        let all = self.loops.iter().try_fold(1usize, |n, l| n.checked_mul(l.n_all())).filter(|n| *n <= MOST_MODES);
        for k in 0..all.filter(|n| *n > 1).unwrap_or(0) {
            x.copy_from_slice(&start);
            let mut rest = k;
            for (i, l) in self.loops.iter().enumerate() {
                self.enter_mode(i, rest % l.n_all(), x);
                rest /= l.n_all();
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

    /// Loop `k` is in this mode from here on.
    fn enter_mode(&self, k: usize, mode: usize, x: &mut [f64]) {
        let l = &self.loops[k];
        x[self.dims.x + k] = mode as f64;
        if let Some(w) = l.weight {
            x[self.dims.x + self.loops.len() + w] = if mode < l.n_modes { l.weight_in(mode) } else { 0.5 };
        }
    }

    /// The subsystems whose modes have their regions elsewhere, and the modes that have theirs here.
    fn outside(&self, t: f64, x: &[f64], u: &[f64], p: &[f64]) -> std::result::Result<Vec<(usize, usize)>, EvalError> {
        let at = Point { t, x: &x[..self.dims.x], u, p };
        let mut found = Vec::new();
        for (k, l) in self.loops.iter().enumerate() {
            let (v, rounding) = self.regions_at(k, &at)?;
            let now = self.mode_at(k, x[self.dims.x + k]);
            match l.held.get(now.wrapping_sub(l.n_modes)) {
                Some(h) => {
                    let w = x[self.dims.x + self.loops.len() + l.weight.unwrap_or(0)];
                    let value: f64 = h.terms.iter().map(|(o, t)| t * v[*o]).sum();
                    let noise: f64 = h.terms.iter().map(|(o, t)| t.abs() * rounding[*o]).sum();
                    let beyond = |m: usize| l.leaves(m, h, &v, &rounding);
                    if h.by == By::Rate && value.abs() > noise {
                        found.push((k, if value > 0.0 { h.high } else { h.low }));
                    } else if w < -ROUNDED {
                        found.push((k, h.low));
                    } else if w > 1.0 + ROUNDED {
                        found.push((k, h.high));
                    } else if let Some(next) = beyond(h.low).or_else(|| beyond(h.high)) {
                        found.push((k, next));
                    }
                }
                None => {
                    let near = if l.weight.is_some() { NEAR } else { 1.0 };
                    let rounding: Vec<f64> = rounding.iter().map(|r| near * r).collect();
                    if let Some(next) = self.goes_over((k, now), &at, &v, &rounding)? {
                        found.push((k, next));
                    } else if !l.is_inside(now, &v, &rounding) {
                        let there = (0..l.n_modes).find(|m| l.is_inside(*m, &v, &rounding));
                        found.push((k, there.ok_or(EvalError::Recoverable)?));
                    }
                }
            }
        }
        Ok(found)
    }

    /// Values of the functions of loop `k`, and their rounding.
    pub(super) fn regions_at(&self, k: usize, at: &Point) -> std::result::Result<(Vec<f64>, Vec<f64>), EvalError> {
        let f = self.loops[k].functions();
        let (mut v, mut work) = (vec![0.0; f.n_out()], vec![0.0; f.work_len()]);
        f.value(at, &mut v, &mut work)?;
        let mut jac = vec![0.0; f.jac_pattern().nnz()];
        f.jacobian(at, &mut jac, &mut work)?;
        let mut rounding = vec![0.0; v.len()];
        let inputs = at.x.iter().chain(at.u).chain(at.p).chain(std::iter::once(&at.t));
        for ((_, entries), value) in f.jac_pattern().columns().zip(inputs) {
            entries.for_each(|e| rounding[f.jac_pattern().row_idx()[e]] += 64.0 * EPS * (jac[e] * value).abs());
        }
        Ok((v, rounding))
    }

    /// The subsystems that switch inside of the equations, by their places in the system.
    pub(crate) fn loops(&self) -> impl Iterator<Item = usize> + '_ {
        self.loops.iter().map(|l| l.subsystem)
    }

    /// The inclusion of loop `k`, and its number there, if it is a step of one.
    pub(crate) fn step_of(&self, k: usize) -> Option<(usize, usize)> {
        self.loops[k].step
    }

    /// States of the system as it was stated.
    pub(crate) fn n_states(&self) -> usize {
        self.dims.x
    }

    /// Sizes with the modes behind the states, and the weights behind those.
    pub(super) fn outer(&self) -> Dims {
        Dims { x: self.dims.x + self.loops.len() + self.n_weights, ..self.dims }
    }

    /// The place of an input where the modes stand behind the states.
    pub(super) fn outer_input(&self, c: usize) -> usize {
        if c < self.dims.x {
            c
        } else {
            c + self.loops.len() + self.n_weights
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
        let predicts = self.begin_tangent(s, at)?;
        s.t = at.t;
        s.key.iter_mut().zip(at.x.iter().chain(at.u).chain(at.p)).for_each(|(k, v)| *k = *v);
        let mut same = self.affine;
        for (k, (m, v)) in s.modes.iter_mut().zip(&at.x[self.dims.x..]).enumerate() {
            let mode = self.mode_at(k, *v);
            same &= *m == mode;
            *m = mode;
        }
        (s.jac_known, s.slopes_known) = (same && s.jac_known, same && s.slopes_known);
        self.take_guess(s, at);
        let mut r = Err(Failure::Stuck.into());
        if predicts {
            self.predict(s, at);
            let negative = s.tangent.negative;
            r = self.newton(s, at, Some(negative));
            if matches!(r, Err(Unsolved::Equations(_))) {
                self.take_guess(s, at);
            }
        }
        if matches!(r, Err(Unsolved::Equations(_))) {
            r = self.newton(s, at, None);
        }
        let r = r.map_err(|e| match e {
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

    /// The states of a point, and the guess in it, to `full`.
    fn take_guess(&self, s: &mut Solver, at: &Point) {
        s.full[..self.dims.x].copy_from_slice(&at.x[..self.dims.x]);
        s.full[self.dims.x..].copy_from_slice(&at.x[self.dims.x + self.loops.len()..]);
    }

    /// Makes the tangent ready that a point begins on, if its guess is a solution that is known. Says whether there is one. To be called while the solver
    /// is where it was last.
    fn begin_tangent(&self, s: &mut Solver, at: &Point) -> std::result::Result<bool, EvalError> {
        if s.guess != Guess::Near || self.affine {
            return Ok(false);
        }
        let (weights, bits) = (self.dims.x + self.loops.len(), f64::to_bits);
        let guess = |x: &[f64], i: usize| x[i.checked_sub(self.z.len()).map_or(self.z.start + i, |w| weights + w)];
        let modes =
            |known: &[usize]| known.iter().enumerate().all(|(k, m)| *m == self.mode_at(k, at.x[self.dims.x + k]));
        let t = &s.tangent;
        let begins = t.state != TangentState::None
            && modes(&t.modes)
            && t.unknowns.iter().enumerate().all(|(i, v)| bits(*v) == bits(guess(at.x, i)));
        if begins {
            if s.tangent.state == TangentState::Point {
                self.differentiate_tangent(s, at)?;
            }
            return Ok(s.tangent.state == TangentState::Slopes);
        }
        let follows = matches!(s.known, Some(Ok(())))
            && modes(&s.modes)
            && (0..self.n_unknowns()).all(|i| bits(s.full[self.place(i)]) == bits(guess(at.x, i)));
        if follows {
            let Solver { tangent: t, key, modes, full, .. } = s;
            t.key.clone_from(key);
            t.modes.clone_from(modes);
            t.unknowns.clear();
            t.unknowns.extend((0..self.n_unknowns()).map(|i| full[self.place(i)]));
            (t.t, t.state) = (s.t, TangentState::Point);
        }
        Ok(false)
    }

    /// The derivatives where the tangent begins; `at` has its modes. The solver has no point behind this.
    fn differentiate_tangent(&self, s: &mut Solver, at: &Point) -> EvalResult {
        let key = std::mem::take(&mut s.tangent.key);
        let (x, rest) = key.split_at(at.x.len());
        let (u, p) = rest.split_at(at.u.len());
        let there = Point { t: s.tangent.t, x, u, p };
        (s.known, s.jac_known, s.slopes_known) = (None, false, false);
        s.modes.clone_from(&s.tangent.modes);
        self.take_guess(s, &there);
        for i in 0..self.n_unknowns() {
            s.full[self.place(i)] = s.tangent.unknowns[i];
        }
        let failure = s.failure;
        let r = self.differentiate(s, &there);
        s.tangent.negative = self.is_negative(s);
        let Solver { tangent: t, slopes, .. } = s;
        t.slopes.iter_mut().zip(slopes).for_each(|(to, from)| to.copy_from_slice(from));
        t.key = key;
        t.state = match r {
            Ok(()) => TangentState::Slopes,
            Err(EvalError::Recoverable) => TangentState::Singular,
            Err(_) => TangentState::None,
        };
        // that there is no tangent is no failure
        s.failure = failure;
        match r {
            Err(EvalError::Recoverable) => Ok(()),
            r => r,
        }
    }

    /// Moves the guess in `full` along the tangent.
    fn predict(&self, s: &mut Solver, at: &Point) {
        let (nx, nu, np) = (self.dims.x, at.u.len(), at.p.len());
        let Solver { tangent, full, .. } = s;
        let from = &tangent.key;
        let behind = at.x.len();
        let moved = |c: usize| match c {
            c if c < nx => at.x[c] - from[c],
            c if c < nx + nu => at.u[c - nx] - from[behind + c - nx],
            c if c < nx + nu + np => at.p[c - nx - nu] - from[behind + c - nx],
            _ => at.t - tangent.t,
        };
        for (b, slopes) in self.blocks.iter().zip(&tangent.slopes) {
            for (i, row) in b.unknowns.iter().zip(slopes.chunks_exact(b.columns.len().max(1))) {
                full[self.place(*i)] += b.columns.iter().zip(row).map(|(c, v)| v * moved(*c)).sum::<f64>();
            }
        }
    }

    /// How the outputs of a part are taken together.
    fn taken_in(&self, s: &Solver, p: &Part) -> Taken {
        p.of_loop().map_or(([(0, 1.0, 0.0); 2], 1), |k| self.taken(s, k))
    }

    /// Loops with a weight, and its number.
    fn weighted(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.loops.iter().enumerate().filter_map(|(k, l)| Some((k, l.weight?)))
    }

    /// Residuals at the states `full`, or at those on trial, to `h`.
    fn residuals(&self, s: &mut Solver, at: &Point, of_trial: bool) -> EvalResult {
        let x = std::mem::take(if of_trial { &mut s.trial } else { &mut s.full });
        let (states, weights) = x.split_at(self.dims.x);
        s.w.copy_from_slice(weights);
        let r = self.residuals_at(s, &Point { x: states, ..*at });
        *(if of_trial { &mut s.trial } else { &mut s.full }) = x;
        r
    }

    fn residuals_at(&self, s: &mut Solver, at: &Point) -> EvalResult {
        s.h.fill(0.0);
        let whole = s.whole(at);
        for p in &self.parts {
            let at = &Point { x: &whole[..p.f.dims().x], ..*at };
            let (taken, n) = self.taken_in(s, p);
            for (mode, weight, _) in &taken[..n] {
                let outputs = p.outputs(*mode);
                p.f.value_rows(at, outputs.clone(), &mut s.buffer[..p.f.n_out()], &mut s.work)?;
                outputs.zip(&p.equations).for_each(|(o, e)| s.h[*e] += weight * s.buffer[o]);
            }
        }
        s.whole = whole;
        for (k, w) in self.weighted() {
            s.h[self.z.len() + w] = self.weight_residual(s, k, at)?;
        }
        s.h.iter().all(|v| v.is_finite()).then_some(()).ok_or(EvalError::Recoverable)
    }

    /// Jacobian at a point to `jac`.
    fn jacobian_at(&self, s: &mut Solver, at: &Point) -> EvalResult {
        s.jac.fill(0.0);
        let whole = s.whole(at);
        for p in &self.parts {
            let at = &Point { x: &whole[..p.f.dims().x], ..*at };
            let (taken, n) = self.taken_in(s, p);
            for (mode, weight, slope) in &taken[..n] {
                let outputs = p.outputs(*mode);
                let own = &mut s.buffer[..p.f.jac_pattern().nnz()];
                p.f.jacobian_rows(at, outputs.clone(), own, &mut s.work)?;
                for ((to, v), r) in p.to_jac.iter().zip(own).zip(p.f.jac_pattern().row_idx()) {
                    if let Some(to) = to.filter(|_| outputs.contains(r)) {
                        s.jac[to] += weight * *v;
                    }
                }
                if *slope != 0.0 {
                    p.f.value_rows(at, outputs.clone(), &mut s.buffer[..p.f.n_out()], &mut s.work)?;
                    outputs.zip(&p.by_weight).for_each(|(o, to)| s.jac[*to] += slope * s.buffer[o]);
                }
            }
        }
        s.whole = whole;
        for (k, w) in self.weighted() {
            self.weight_row(s, k, at)?;
            self.rows_of_weights[w].iter().for_each(|(c, to)| s.jac[*to] = s.row[*c]);
        }
        Ok(())
    }

    /// Jacobian at the states `full`, and the factors of its part by the unknowns; false where that is singular.
    fn factorise(&self, s: &mut Solver, at: &Point) -> std::result::Result<bool, EvalError> {
        if self.affine && s.jac_known {
            return Ok(true);
        }
        (s.jac_known, s.slopes_known) = (false, false);
        let x = std::mem::take(&mut s.full);
        let (states, weights) = x.split_at(self.dims.x);
        s.w.copy_from_slice(weights);
        let r = self.jacobian_at(s, &Point { x: states, ..*at });
        s.full = x;
        r?;
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
        let (states, weights) = x.split_at(self.dims.x);
        let inputs = states.iter().chain(at.u).chain(at.p).chain(std::iter::once(&at.t)).chain(weights);
        for ((_, entries), v) in self.jac.columns().zip(inputs) {
            for e in entries {
                s.sizes[self.jac.row_idx()[e]] += (s.jac[e] * v).abs();
            }
        }
        for b in &self.blocks {
            let unit = |c: usize| s.units[b.unknowns[c]];
            let largest = b.unknowns.iter().map(|i| x[self.place(*i)].abs() * s.units[*i]).fold(0.0, f64::max);
            b.by_unknowns.iter().for_each(|(e, r, c)| s.sizes[b.rows[*r]] += s.jac[*e].abs() * largest / unit(*c));
        }
        // what may be an underflow is zero
        let of = |(h, size): (&f64, &f64)| if h.abs() <= TINY { 0.0 } else { h.abs() / (EPS * size) };
        s.h.iter().zip(&s.sizes).map(of).fold(0.0, f64::max)
    }

    /// From the guess in `full` to the solution; with a sign of the determinant of `h_z` only where it is that of the guess.
    fn newton(&self, s: &mut Solver, at: &Point, sign: Option<bool>) -> std::result::Result<(), Unsolved> {
        let n = self.n_unknowns();
        self.residuals(s, at, false)?;
        if !self.factorise(s, at)? {
            return Err(Failure::Singular.into());
        }
        let negative = self.is_negative(s);
        if sign.is_some_and(|sign| sign != negative) {
            return Err(Failure::Fold.into());
        }
        let mut fresh = true;
        let mut noise = self.roundings(s, at, false);
        self.correct(s);
        s.step.copy_from_slice(&s.next);
        for i in 0..n {
            s.start[i] = s.full[self.place(i)];
            s.weights[i] = s.start[i].abs().max(s.step[i].abs());
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
                (0..n).for_each(|i| s.full[self.place(i)] += s.step[i]);
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
                (0..n).for_each(|i| s.trial[self.place(i)] += part * s.step[i]);
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
                let least = |i: usize| SHORTEST * s.full[self.place(i)].abs().max(s.start[i].abs()) / s.step[i].abs();
                let least = (0..n).map(least).fold(SHORTEST, f64::min).max(f64::MIN_POSITIVE);
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

    /// Derivatives of unknown `i` where they are known: by which inputs, and the values.
    pub(super) fn slopes<'a>(&'a self, s: &'a Solver, i: usize) -> (&'a [usize], &'a [f64]) {
        let k = self.block_of[i];
        let b = &self.blocks[k];
        let (at, m) = (b.unknowns.binary_search(&i).unwrap_or(0), b.columns.len());
        (&b.columns, &s.slopes[k][at * m..(at + 1) * m])
    }
}

impl Algebraic {
    /// The inputs that one input of the whole system, or a weight behind them, follows, with its derivatives by them: itself, if it is no
    /// unknown.
    pub(super) fn follows<'a>(&'a self, s: &'a Solver, input: &'a [usize; 1]) -> (&'a [usize], &'a [f64]) {
        match self.unknown(input[0]) {
            Some(i) => self.slopes(s, i),
            None => (input, &[1.0]),
        }
    }

    /// The unknown that stands at an input of the whole system, or is a weight behind them.
    pub(super) fn unknown(&self, input: usize) -> Option<usize> {
        match input.checked_sub(self.dims.n_in()) {
            Some(w) => (w < self.n_weights).then_some(self.z.len() + w),
            None => self.z.contains(&input).then(|| input - self.z.start),
        }
    }

    /// Multipliers of the equations for weights of the unknowns.
    pub(super) fn multipliers(&self, s: &mut Solver, by_unknown: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; by_unknown.len()];
        for (b, lu) in self.blocks.iter().zip(&mut s.lus) {
            let column = &mut s.column[..b.rows.len()];
            column.iter_mut().zip(&b.unknowns).for_each(|(c, i)| *c = -by_unknown[*i]);
            lu.solve_transposed(column);
            b.rows.iter().zip(column).for_each(|(r, c)| out[*r] = *c);
        }
        out
    }

    /// Second derivatives of the equations times these multipliers, at a point with the solution: input or weight, input or weight, value.
    pub(super) fn bends_of_equations(
        &self,
        s: &mut Solver,
        at: &Point,
        multipliers: &[f64],
    ) -> std::result::Result<Vec<(usize, usize, f64)>, EvalError> {
        let mut out = Vec::new();
        let whole = s.whole(at);
        for p in &self.parts {
            let at = &Point { x: &whole[..p.f.dims().x], ..*at };
            let (taken, n) = self.taken_in(s, p);
            let column = p.of_loop().and_then(|k| self.loops[k].weight).map(|w| self.dims.n_in() + w);
            for (mode, weight, slope) in &taken[..n] {
                let mut own = vec![0.0; p.f.n_out()];
                p.outputs(*mode).zip(&p.equations).for_each(|(o, e)| own[o] = multipliers[*e]);
                let Solver { buffer, other, work, .. } = s;
                let input = |c: usize| self.input_of(&p.f, c);
                bends_of((&p.f, at, &input), &own, (*weight, *slope, column), (buffer, other, work), &mut out)?;
            }
        }
        s.whole = whole;
        for (k, w) in self.weighted() {
            self.weight_bends(s, k, at, multipliers[self.z.len() + w], &mut out)?;
        }
        Ok(out)
    }
}

/// Parts of the equations that have to do with each other, and the part of every unknown.
/// `places` are the columns of the unknowns, ascending.
fn blocks(jac: &Pattern, places: &[usize]) -> Result<(Vec<Block>, Vec<usize>)> {
    let nz = places.len();
    // representatives of equations, and of unknowns behind them
    let mut chief: Vec<usize> = (0..2 * nz).collect();
    let mut used = vec![false; 2 * nz];
    for c in 0..nz {
        for &r in jac.rows(places[c]) {
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
                if let Ok(unknown) = places.binary_search(&c) {
                    let c = b.unknowns.binary_search(&unknown).unwrap_or(0);
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
