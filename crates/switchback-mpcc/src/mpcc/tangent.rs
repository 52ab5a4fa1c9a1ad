//! Derivatives of a solution with respect to data: values of fixed variables, and whatever shifts gradient and rows.

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
        let s = &self.solution;
        let exact = s.polish == Polish::Done || (p.pairs().is_empty() && s.outcome == Outcome::Solved);
        if !exact {
            return Err(Error::State("derivatives of a solution need an exact one: the last solve has none".into()));
        }
        check(changes, bounds)?;
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
        let mut found: Vec<Option<Tangent>> = vec![None; changes.len()];
        if settled {
            let one_sided = self.active.is_weak(self.ipm.constraints()) || self.active.has_weak_pair(p.pairs());
            self.fill(p, changes, one_sided, &mut found);
            if found.contains(&None) && one_sided && self.let_go(p) {
                self.fill(p, changes, true, &mut found);
            }
        }
        self.solution.stats = stats;
        p.set_polishing(false);
        stop::check()?;
        if found.iter().all(Option::is_none) && !found.is_empty() {
            return Err(Error::Numeric(
                "the solution is no isolated minimiser of its branch: it has no derivative".into(),
            ));
        }
        let (n, m) = (self.solution.x.len(), self.solution.y.len());
        let none = || Tangent { x: vec![f64::NAN; n], y: vec![f64::NAN; m], objective: f64::NAN, one_sided: true };
        Ok(found.into_iter().map(|t| t.unwrap_or_else(none)).collect())
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
            *t = self.tangent(c, one_sided);
        }
    }

    fn tangent(&mut self, change: &Change, one_sided: bool) -> Option<Tangent> {
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
        if !self.ipm.tangent(&mut dx, &mut dy) {
            return None;
        }
        dx.truncate(n);
        dx.iter_mut().zip(&scaling.sizes).for_each(|(x, s)| *x *= s);
        dy.truncate(m);
        for (y, scale) in dy.iter_mut().zip(&scaling.rows) {
            *y *= scale / scaling.objective;
        }
        Some(Tangent { x: dx, y: dy, objective, one_sided })
    }
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
