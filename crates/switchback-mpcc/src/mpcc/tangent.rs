//! Derivatives of a solution with respect to data: values of fixed variables, and whatever shifts gradient and rows.
//!
//! Where bounds or pairs are active without a multiplier the solution has a kink. A derivative is then that of one side, and
//! [`Sides`] says of which: the rates of multipliers and distances must have the signs that keep the active set (A. V. Fiacco,
//! Introduction to Sensitivity and Stability Analysis, 1983, of the branch; D. Ralph, S. Dempe, Math. Programming 70, 1995).

use super::endgame::Rates;
use super::problem::Mpcc;
use super::relaxed::Relaxed;
use super::solver::{MpccSolver, Polish, Warm};
use crate::error::{finite, Error, Result};
use crate::nlp::{Bounds, Control, Outcome};
use crate::stop;

/// One direction in the space of the data. Indices may repeat; their values add.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Change {
    /// Changes of the values of variables with equal bounds.
    pub fixed: Vec<(usize, f64)>,
    /// Changes of the gradient of the Lagrangian `∇f + Jᵀ y` with the variables held: `∂∇L/∂q`.
    pub gradient: Vec<(usize, f64)>,
    /// Changes of the rows with the variables held: `∂c/∂q`; of a bound that is active, minus its change.
    pub rows: Vec<(usize, f64)>,
}

/// On which sides of the present data a derivative holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sides {
    /// On both: it is a derivative.
    Both,
    /// Where the data move along their change.
    Rising,
    /// Where they move against it.
    Falling,
    /// On neither: the solution has a kink, and follows other active sets on both sides.
    Neither,
}

/// How a solution follows one [`Change`].
#[derive(Debug, Clone, PartialEq)]
pub struct Tangent {
    /// Derivative of the point `[n]`.
    pub x: Vec<f64>,
    /// Derivative of the multipliers of the rows `[m]`.
    pub y: Vec<f64>,
    /// Derivative of the objective, without what the change does to `f` itself while the variables are held.
    pub objective: f64,
    /// Some bound or pair is active without a multiplier: the derivative is that of one side, the one on which
    /// the active set stays as it is.
    pub one_sided: bool,
    /// On which sides the derivative holds, as far as the signs of multipliers and distances tell.
    pub sides: Sides,
}

/// Weights of the data from a weight of the point: the adjoint of the map from [`Change`] to [`Tangent::x`]. The weight of a
/// change is the sum of its entries times these.
#[derive(Debug, Clone, PartialEq)]
pub struct Adjoint {
    /// Of the values of fixed variables `[n]`; zero for others.
    pub fixed: Vec<f64>,
    /// Of changes of the gradient of the Lagrangian `[n]`.
    pub gradient: Vec<f64>,
    /// Of changes of the rows `[m]`.
    pub rows: Vec<f64>,
}

impl MpccSolver {
    /// Derivatives of the last solution in the directions `changes`, from one factorisation. The problem and `bounds` must
    /// be those of that solve, and its result exact ([`Polish::Done`], or solved if there are no pairs). The active set is
    /// held: for a discretisation, modes keep their order.
    ///
    /// Where bounds are active without a multiplier they may leave a direction no solution: a variable that is fixed by its
    /// bound and by the data. They are let go for that direction, which is then one-sided. Directions that have no
    /// derivative even so are NaN; `Err` where none has one.
    pub fn tangents(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, changes: &[Change]) -> Result<Vec<Tangent>> {
        self.tangents_of(p, bounds, changes, false)
    }

    /// The same, where `isolated` of a point that is the only solution near by: of others, which have flat directions, what
    /// follows the data is one among many.
    pub(super) fn tangents_of(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        changes: &[Change],
        isolated: bool,
    ) -> Result<Vec<Tangent>> {
        check(changes, bounds)?;
        let mut found: Vec<Option<Tangent>> = vec![None; changes.len()];
        self.at_solution(p, bounds, |s, p| {
            if isolated && !(s.ipm.linearise(&mut Relaxed { inner: p, st: &mut s.st }) && s.ipm.is_isolated()) {
                return;
            }
            let one_sided = s.is_weak(p);
            s.fill(p, changes, one_sided, &mut found);
            if found.contains(&None) && one_sided && s.let_go(p) {
                s.fill(p, changes, true, &mut found);
            }
        })?;
        if found.iter().all(Option::is_none) && !found.is_empty() {
            return Err(no_derivative());
        }
        let (n, m) = (self.solution.x.len(), self.solution.y.len());
        let none = || Tangent {
            x: vec![f64::NAN; n],
            y: vec![f64::NAN; m],
            objective: f64::NAN,
            one_sided: true,
            sides: Sides::Neither,
        };
        Ok(found.into_iter().map(|t| t.unwrap_or_else(none)).collect())
    }

    /// The adjoint of [`MpccSolver::tangents`]: for every weight of the point in `weights`, `[n]` each, the weights of the data, from
    /// one factorisation and a solve each. Nothing where the derivative is not the same on both sides and along all changes, because
    /// bounds or pairs are active without a multiplier or active gradients are dependent: there `tangents` says what is
    /// known of a change.
    ///
    /// # Errors
    /// As [`MpccSolver::tangents`]; [`Error::Dimension`] if a weight has another size.
    pub fn adjoints(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        weights: &[Vec<f64>],
    ) -> Result<Option<Vec<Adjoint>>> {
        for w in weights {
            finite("weight of the point", w, bounds.xl.len())?;
        }
        let mut found: Vec<Adjoint> = Vec::new();
        let mut regular = false;
        self.at_solution(p, bounds, |s, p| {
            let smooth = !s.is_weak(p) && s.ipm.linearise(&mut Relaxed { inner: p, st: &mut s.st });
            regular = smooth && s.ipm.is_regular();
            if regular {
                found.extend(weights.iter().map_while(|w| s.adjoint(w)));
            }
        })?;
        Ok((regular && found.len() == weights.len()).then_some(found))
    }

    /// Does some bound hold, or some pair, without a multiplier?
    fn is_weak(&self, p: &dyn Mpcc) -> bool {
        self.active.is_weak(self.ipm.constraints()) || self.active.has_weak_pair(p.pairs())
    }

    /// Calls `f` where the square system of the last solution, which must be exact, is solved.
    fn at_solution(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        f: impl FnOnce(&mut MpccSolver, &mut dyn Mpcc),
    ) -> Result<()> {
        let s = &self.solution;
        let exact = s.polish == Polish::Done || (p.pairs().is_empty() && s.outcome == Outcome::Solved);
        if !exact {
            return Err(Error::State("derivatives of a solution need an exact one: the last solve has none".into()));
        }
        let (x, y, z) = (s.x.clone(), s.y.clone(), s.z.clone());
        let warm = Warm { x: &x, y: &y, z: &z };
        self.load(p, &warm);
        p.set_polishing(true);
        self.sides.copy_from_slice(&self.solution.sides);
        self.branch.copy_from(bounds);
        if !p.pairs().is_empty() {
            p.branch(&self.sides, &mut self.branch);
        }
        let stats = self.solution.stats;
        let mut settled = self.settle_saved(p, &mut Control::default());
        if !settled && self.st.scaling.sized {
            // where the optimum is flat, which bounds are active may be clearer in the units of the problem
            self.st.scaling.forget_sizes();
            self.load(p, &warm);
            settled = self.settle_saved(p, &mut Control::default());
        }
        if settled {
            f(self, p);
        }
        self.solution.stats = stats;
        p.set_polishing(false);
        stop::check()?;
        if settled {
            Ok(())
        } else {
            Err(no_derivative())
        }
    }

    /// The derivatives that the present active set has and that are missing.
    fn fill(&mut self, p: &mut dyn Mpcc, changes: &[Change], one_sided: bool, found: &mut [Option<Tangent>]) {
        if !self.ipm.linearise(&mut Relaxed { inner: p, st: &mut self.st }) {
            return;
        }
        for (c, t) in changes.iter().zip(found).filter(|f| f.1.is_none()) {
            if stop::requested().is_some() {
                return;
            }
            *t = self.tangent(p, c, one_sided);
        }
    }

    fn tangent(&mut self, p: &dyn Mpcc, change: &Change, one_sided: bool) -> Option<Tangent> {
        let (n, m) = (self.solution.x.len(), self.solution.y.len());
        let (n_all, m_all) = self.st.size();
        let (mut dx, mut dy) = (vec![0.0; n_all], vec![0.0; m_all]);
        let scaling = &self.st.scaling;
        let mut objective = 0.0;
        for &(j, v) in &change.fixed {
            dx[j] += v / scaling.sizes[j];
            objective += self.solution.z[j] * v;
        }
        for &(j, v) in change.gradient.iter().filter(|c| self.bounds.xl[c.0] != self.bounds.xu[c.0]) {
            dx[j] += v * scaling.objective * scaling.sizes[j];
        }
        for &(i, v) in &change.rows {
            dy[i] += v * scaling.rows[i];
            objective += self.solution.y[i] * v;
        }
        let rows = dy.clone();
        if !self.ipm.tangent(&mut dx, &mut dy) {
            return None;
        }
        let mut sides = Sides::Both;
        if one_sided {
            let (mut z, mut c) = (vec![0.0; n_all], vec![0.0; m_all]);
            self.ipm.rates(&dx, &dy, &mut z, &mut c);
            for &(j, v) in &change.gradient {
                z[j] += v * scaling.objective * scaling.sizes[j];
            }
            c.iter_mut().zip(&rows).for_each(|(c, r)| *c += r);
            let rates = Rates { x: &dx, z: &z, y: &dy, c: &c };
            sides = self.active.sides(self.ipm.constraints(), p.pairs(), &rates);
        }
        dx.truncate(n);
        dx.iter_mut().zip(&scaling.sizes).for_each(|(x, s)| *x *= s);
        dy.truncate(m);
        for (y, scale) in dy.iter_mut().zip(&scaling.rows) {
            *y *= scale / scaling.objective;
        }
        Some(Tangent { x: dx, y: dy, objective, one_sided, sides })
    }

    fn adjoint(&mut self, weight: &[f64]) -> Option<Adjoint> {
        let (n, m) = (self.solution.x.len(), self.solution.y.len());
        let (n_all, m_all) = self.st.size();
        let (mut dx, mut dy) = (vec![0.0; n_all], vec![0.0; m_all]);
        let scaling = &self.st.scaling;
        for ((d, w), size) in dx.iter_mut().zip(weight).zip(&scaling.sizes) {
            *d = w * size;
        }
        let mut fixed = dx.clone();
        if !self.ipm.adjoint(&mut dx, &mut dy) {
            return None;
        }
        let (mut of_fixed, mut unused) = (vec![0.0; n_all], vec![0.0; m_all]);
        self.ipm.rates(&dx, &dy, &mut of_fixed, &mut unused);
        for j in 0..n {
            let is_fixed = self.bounds.xl[j] == self.bounds.xu[j];
            fixed[j] = if is_fixed { (fixed[j] - of_fixed[j]) / scaling.sizes[j] } else { 0.0 };
        }
        fixed.truncate(n);
        let gradient = dx[..n].iter().zip(&scaling.sizes).map(|(l, size)| -l * scaling.objective * size).collect();
        let rows = dy[..m].iter().zip(&scaling.rows).map(|(l, scale)| -l * scale).collect();
        Some(Adjoint { fixed, gradient, rows })
    }
}

fn no_derivative() -> Error {
    Error::Numeric("the solution is no isolated minimiser of its branch: it has no derivative".into())
}

fn check(changes: &[Change], b: &Bounds) -> Result<()> {
    for c in changes {
        for &(j, v) in &c.fixed {
            if j >= b.xl.len() || b.xl[j] != b.xu[j] {
                return Err(Error::Range(format!("variable {j} has no fixed value that could change")));
            }
            finite("change of a fixed value", &[v], 1)?;
        }
        let parts = [("gradient", &c.gradient, b.xl.len()), ("rows", &c.rows, b.cl.len())];
        for (what, list, n) in parts {
            for &(i, v) in list {
                if i >= n {
                    return Err(Error::Range(format!("change {i} of the {what}: there are {n}")));
                }
                finite(&format!("change of the {what}"), &[v], 1)?;
            }
        }
    }
    Ok(())
}
