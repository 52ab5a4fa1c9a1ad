//! What was found: a certificate of the exact point, and the way on where it is no B-stationary one.

use super::certificate::{BStationarity, CertSettings, Certificate, Certifier, Doubt, Local};
use super::conflict::Conflict;
use super::infeasible::Claim;
use super::problem::{Mpcc, Side};
use super::scaling::Scaling;
use super::solver::{MpccSolver, Polish, Solution, Warm};
use crate::error::Result;
use crate::linalg::csc::Pattern;
use crate::nlp::{within, Bounds, Control, Outcome};
use crate::stop;

/// Trust regions of the linearised problem, the wide one first.
const RADII: [f64; 2] = [1e-2, 1e-4];
/// Work of all certificates of a solve at most: a share of that of the solve so far, or what takes some hundredths of a
/// second ([`LinearStats::work`](crate::linalg::kkt::LinearStats::work)). Work and not time, so that answers are the same
/// every time.
const SHARE: f64 = 0.2;
const LITTLE_WORK: f64 = 2e7;
/// Steps along a descent, from the longest on each a share of the one before, down to the shortest; and the violation of scaled rows up to which one is a step.
const SHORTER: f64 = 0.125;
const LONGEST: f64 = 4096.0;
const SHORTEST: f64 = 1e-3;
const HELD: f64 = 1e-8;
/// Largest scaled derivative of the objective from which on tolerances are those of this point.
const FLAT: f64 = 0.1;
/// Share of an objective that is rounding.
const SAME: f64 = 64.0 * f64::EPSILON;
/// Distance at which constraints of an infeasible problem count as active.
const ACTIVE: f64 = 1e-6;

/// Room for functions and derivatives at a point, and the certifier.
pub(super) struct Judge {
    certifier: Certifier,
    bounds: Bounds,
    c: Vec<f64>,
    grad: Vec<f64>,
    jac: Vec<f64>,
    /// The point and its multipliers in the units of the solver.
    x: Vec<f64>,
    y: Vec<f64>,
    z: Vec<f64>,
    /// Objective of the point evaluated last.
    objective: f64,
}

impl Judge {
    pub fn new(p: &dyn Mpcc) -> Result<Judge> {
        let (n, m) = (p.n(), p.m());
        Ok(Judge {
            certifier: Certifier::new(p.jac_pattern(), p.pairs())?,
            bounds: Bounds::free(n, m),
            c: vec![0.0; m],
            grad: vec![0.0; n],
            jac: vec![0.0; p.jac_pattern().nnz()],
            x: vec![0.0; n],
            y: vec![0.0; m],
            z: vec![0.0; n],
            objective: f64::NAN,
        })
    }

    /// Evaluates at `x`; false where something has no value.
    fn evaluate(&mut self, p: &mut dyn Mpcc, x: &[f64]) -> bool {
        p.set_polishing(true);
        let ok = p.eval(x, &mut self.c).is_ok() && p.derivatives(x, &mut self.grad, &mut self.jac).is_ok();
        p.set_polishing(false);
        ok
    }

    /// Everything in the units of the solver: distances and slopes are compared with constants, which mean nothing in those of
    /// the user.
    fn measure(&mut self, s: &Solution, scaling: &Scaling, jac: &Pattern) {
        scaling.value(0.0, &mut self.c);
        scaling.derivatives(&mut self.grad, jac, &mut self.jac);
        scaling.shrink(&s.x, &mut self.x);
        scaling.bounds(&mut self.bounds);
        self.y.iter_mut().zip(&s.y).enumerate().for_each(|(i, (out, y))| *out = scaling.row_multiplier(i, *y));
        self.z.iter_mut().zip(&s.z).enumerate().for_each(|(j, (out, z))| *out = scaling.bound_multiplier(j, *z));
    }
}

/// Factorisations of all certificates by `certifier` after a solve that took so much work.
pub(super) fn allowance(certifier: &Certifier, work: f64) -> usize {
    ((SHARE * work).max(LITTLE_WORK) / certifier.linear_statistics().work().max(1.0)) as usize
}

/// Two certificates of one point, by trust regions of different size: what they say together.
fn combined(wide: Certificate, narrow: Certificate) -> Certificate {
    let of = |b: BStationarity, doubt: Doubt| Certificate { b, doubt, ..narrow };
    match (wide.b, narrow.b) {
        (BStationarity::Undecided, _) => narrow,
        (b, BStationarity::Undecided) => of(b, wide.doubt),
        (a, b) if a == b => narrow,
        _ => of(BStationarity::Undecided, Doubt::Accuracy),
    }
}

impl MpccSolver {
    /// Certifies the recorded solution.
    fn certify(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        settings: &CertSettings,
        control: &mut Control,
    ) -> Certificate {
        let Some(judge) = &mut self.judge else { return Certificate::default() };
        let s = &self.solution;
        if !judge.evaluate(p, &s.x) {
            judge.certifier.forget();
            let doubt = if stop::requested().is_some() { Doubt::Stopped } else { Doubt::None };
            return Certificate { doubt, ..Certificate::default() };
        }
        judge.bounds.copy_from(bounds);
        if self.policy.branch_fixes {
            p.branch(&s.sides, &mut judge.bounds);
            for j in p.pairs().iter().flat_map(|k| [k.0, k.1]) {
                judge.bounds.xl[j] = bounds.xl[j];
                judge.bounds.xu[j] = bounds.xu[j];
            }
        }
        judge.measure(s, &self.st.scaling, p.jac_pattern());
        let local = Local {
            x: &judge.x,
            c: &judge.c,
            grad: &judge.grad,
            jac: p.jac_pattern(),
            jac_values: &judge.jac,
            bounds: &judge.bounds,
            pairs: p.pairs(),
            y: &judge.y,
            z: &judge.z,
        };
        judge.certifier.certify(&local, settings, control)
    }

    /// Follows descents of the linearised problem to better points, and certifies the last one.
    pub(super) fn judge(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) {
        if self.judge.is_none() || !self.settings.certify {
            return;
        }
        let descents = self.policy.descents;
        let mut spent = 0;
        let mut cert = Certificate::default();
        for k in 0..=descents {
            cert = self.ask(p, bounds, RADII[0], &mut spent, control);
            if k == descents || cert.b == BStationarity::Yes {
                break;
            }
            if self.descend(p, bounds, control) {
                continue;
            }
            if spent >= self.certificate_allowance() {
                break;
            }
            let narrow = self.ask(p, bounds, RADII[1], &mut spent, control);
            if narrow.b != BStationarity::Yes && self.descend(p, bounds, control) {
                continue;
            }
            cert = combined(cert, narrow);
            if cert.b == BStationarity::No && stop::requested().is_none() {
                // the rows bend away from all of it, or it is lost in rounding: nothing that could be followed
                (cert.b, cert.doubt) = (BStationarity::Undecided, Doubt::Accuracy);
            }
            break;
        }
        self.solution.certificate = self.refine(cert, spent, control);
        self.certify_curvature(p, bounds);
    }

    /// Certifies the recorded solution as far as B-stationarity goes; `spent` are the factorisations in certificates so far.
    fn ask(
        &mut self,
        p: &mut dyn Mpcc,
        bounds: &Bounds,
        radius: f64,
        spent: &mut usize,
        control: &mut Control,
    ) -> Certificate {
        let max_factorisations = self.certificate_allowance().saturating_sub(*spent);
        let settings = CertSettings { radius, type_nodes: 0, max_factorisations, ..self.certificate_settings() };
        let cert = self.certify(p, bounds, &settings, control);
        *spent += self.judge.as_ref().map_or(0, |j| j.certifier.factorisations());
        cert
    }

    /// Completes the last certificate by the type of stationarity.
    fn refine(&mut self, cert: Certificate, spent: usize, control: &mut Control) -> Certificate {
        let left = self.certificate_allowance().saturating_sub(spent);
        let settings = self.certificate_settings();
        let Some(judge) = &mut self.judge else { return cert };
        let max_factorisations = judge.certifier.factorisations() + left;
        judge.certifier.refine(cert, &CertSettings { max_factorisations, ..settings }, control)
    }

    fn certificate_settings(&self) -> CertSettings {
        let usual = CertSettings::default();
        CertSettings { rounding: usual.rounding * self.st.scaling.steepness(), ..usual }
    }

    /// Factorisations of all certificates of this solve.
    fn certificate_allowance(&self) -> usize {
        self.judge.as_ref().map_or(0, |j| allowance(&j.certifier, self.work()))
    }

    /// Are so many factorisations of the solver a small part of the work of this solve?
    pub(super) fn affords(&self, factorisations: f64) -> bool {
        factorisations * self.ipm.linear_statistics().work() <= (SHARE * self.work()).max(LITTLE_WORK)
    }

    /// Work of this solve so far.
    fn work(&self) -> f64 {
        self.solution.stats.factorisations as f64 * self.ipm.linear_statistics().work()
    }

    /// Goes to a better point along the last descent; true where there is one.
    fn descend(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        if self.follow_descent(p, bounds, control) {
            return true;
        }
        // tolerances are those of the gradient at the start: beside it the one at this point may be small
        let steepest = self.judge.as_ref().map_or(0.0, |j| j.grad.iter().fold(0f64, |a, g| a.max(g.abs())));
        let usual = self.st.scaling.objective;
        if steepest > 0.0 && steepest < FLAT {
            self.st.scaling.objective = usual * steepest.recip().log2().floor().exp2();
            let followed = self.follow_descent(p, bounds, control);
            self.st.scaling.objective = usual;
            if followed {
                return true;
            }
        }
        self.step_down(p, bounds, control)
    }

    /// Solves the branch the last descent leads into, from its end.
    fn follow_descent(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        let Some((d, sides)) = self.judge.as_ref().and_then(|j| j.certifier.descent()) else { return false };
        for (((w, x), d), size) in self.room.iter_mut().zip(&self.solution.x).zip(d).zip(&self.st.scaling.sizes) {
            *w = x + d * size;
        }
        self.st.start(&self.room, &mut self.point);
        for (k, side) in sides.iter().enumerate() {
            self.sides[p.group(k)] = *side;
        }
        for (k, &(a, b)) in p.pairs().iter().enumerate() {
            let zero = if self.sides[p.group(k)] == Side::First { a } else { b };
            self.point[zero] = 0.0;
        }
        let best = self.solution.objective;
        let ok = self.try_point(p, bounds, control) && self.is_better(best);
        if ok {
            self.record_exact(p, control);
        }
        ok
    }

    /// Where the branch of the last descent has no better solution: a step along it after which rows and pairs hold and the objective is
    /// lower, and from there to the solution of the square system. The step itself is the point where that leads to none.
    fn step_down(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) -> bool {
        let best = self.solution.objective;
        let mut step = LONGEST;
        while step >= SHORTEST && stop::requested().is_none() {
            let Some((d, sides)) = self.judge.as_ref().and_then(|j| j.certifier.descent()) else { return false };
            for (((w, x), d), size) in self.room.iter_mut().zip(&self.solution.x).zip(d).zip(&self.st.scaling.sizes) {
                *w = x + step * d * size;
            }
            for (k, side) in sides.iter().enumerate() {
                self.sides[p.group(k)] = *side;
            }
            for (j, w) in self.room.iter_mut().enumerate() {
                *w = within(*w, bounds.xl[j], bounds.xu[j]);
            }
            for (k, &(a, b)) in p.pairs().iter().enumerate() {
                self.room[if self.sides[p.group(k)] == Side::First { a } else { b }] = 0.0;
            }
            if self.is_lower(p, bounds, best) {
                break;
            }
            step *= SHORTER;
        }
        if step < SHORTEST || stop::requested().is_some() {
            return false;
        }
        let before = self.solution.clone();
        self.branch.copy_from(bounds);
        p.branch(&self.sides, &mut self.branch);
        let x = self.room.clone();
        self.load(p, &Warm { x: &x, y: &before.y, z: &before.z });
        let lowest = self.judge.as_ref().map_or(f64::INFINITY, |j| j.objective);
        if self.settle_saved(p, control) && self.solution.objective <= lowest + SAME * lowest.abs() {
            return true;
        }
        let stats = self.solution.stats;
        self.solution = Solution { stats, x, objective: lowest, ..before };
        for (k, side) in self.sides.iter().enumerate() {
            self.solution.sides[k] = *side;
        }
        true
    }

    /// Does the point in `room` meet the rows, and is its objective, which is kept, below `best`?
    fn is_lower(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, best: f64) -> bool {
        let Some(judge) = &mut self.judge else { return false };
        p.set_polishing(true);
        let value = p.eval(&self.room, &mut judge.c);
        p.set_polishing(false);
        let Ok(f) = value else { return false };
        judge.objective = f;
        let scaling = &self.st.scaling;
        let rows = judge.c.iter().zip(bounds.cl.iter().zip(&bounds.cu)).zip(&scaling.rows);
        let violation = rows.fold(0f64, |v, ((c, (lo, hi)), s)| v.max(s * (lo - c)).max(s * (c - hi)));
        violation <= HELD.max(self.solution.residuals.primal) && f < best - SAME * best.abs()
    }

    /// Takes the claim back that the program is infeasible where its point does not show it. Programs with pairs keep
    /// theirs: the restoration phase ends at a minimiser of the violation with relaxed pairs, at which they need not hold,
    /// so that the check with exact pairs would take back claims that are right.
    pub(super) fn confirm(&mut self, p: &mut dyn Mpcc, bounds: &Bounds, control: &mut Control) {
        let s = &self.solution;
        if s.outcome != Outcome::Infeasible || s.polish == Polish::Done || !p.pairs().is_empty() {
            return;
        }
        let claim = Claim { x: &s.x, y: &s.y, weights: &self.st.scaling.rows[..s.y.len()], bounds };
        if !claim.holds(p, self.work(), control) {
            self.solution.outcome = stop::requested().map_or(Outcome::Stalled, Outcome::from);
        }
    }

    /// Which constraints conflict at the point of least violation that was recorded.
    pub(super) fn explain(&mut self, p: &mut dyn Mpcc, bounds: &Bounds) {
        let s = &mut self.solution;
        let claimed = matches!(s.outcome, Outcome::Infeasible | Outcome::LocallyInfeasible);
        if !claimed || s.polish == Polish::Done {
            return;
        }
        // programs without pairs need no judge but for this
        let mut own = None;
        let judge = match &mut self.judge {
            Some(judge) => judge,
            None => match Judge::new(p) {
                Ok(judge) => own.insert(judge),
                Err(_) => return,
            },
        };
        if judge.evaluate(p, &s.x) {
            let (jac, pairs) = (p.jac_pattern(), p.pairs());
            s.conflict = Some(Conflict::combine(&s.x, &judge.c, jac, &judge.jac, bounds, pairs, &s.y, ACTIVE));
        }
    }
}
