//! Models with so many coupled switching functions that their modes are formed on demand.

use std::sync::Arc;

use super::{Builder, Built, NoteKind, SavedModel};
use crate::error::Result;
use crate::expr::{Id, SignedFunction};
use crate::func::{Dims, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::system::{OnDemand, Signed, System};

impl Signed for SignedFunction {
    fn dims(&self) -> Dims {
        SignedFunction::dims(self)
    }
    fn n_out(&self) -> usize {
        SignedFunction::n_out(self)
    }
    fn jac_pattern(&self) -> &Pattern {
        SignedFunction::jac_pattern(self)
    }
    fn is_affine(&self) -> bool {
        SignedFunction::is_affine(self)
    }
    fn work_len(&self) -> usize {
        SignedFunction::work_len(self)
    }
    fn value(&self, at: &Point, signs: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        SignedFunction::value(self, at, signs, out, work)
    }
    fn jacobian(&self, at: &Point, signs: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult {
        SignedFunction::jacobian(self, at, signs, out, work)
    }
    fn is_serial(&self) -> bool {
        SignedFunction::is_serial(self)
    }
}

impl Builder<'_> {
    /// The system with the derivatives `rhs` as they were written: the signs of its switching functions, those inside of others too, are
    /// inputs.
    pub(super) fn on_demand(mut self, rhs: &[Id], saved: Arc<Result<SavedModel>>) -> Result<Built> {
        let d = self.model.dims;
        let switches = self.dag.switches_of(rhs);
        let psi: Vec<Id> = switches.iter().filter_map(|&s| self.dag.switching_function(s)).collect();
        let inner = |p: &Id| -> Vec<usize> {
            self.dag.switches_of(&[*p]).iter().filter_map(|s| switches.binary_search(s).ok()).collect()
        };
        let upstream: Vec<Vec<usize>> = psi.iter().map(inner).collect();
        let nested = upstream.iter().filter(|u| !u.is_empty()).count();
        self.note_nearly_equal(&switches);
        let n = psi.len();
        let text = format!(
            "{n} switching functions are coupled, {nested} of them inside of others: their modes are formed on demand by event-driven \
             simulation. What needs all modes, as optimal control and finite elements do, refuses the model: there it takes terms that \
             switch separately, fewer choices inside of choices, or smooth functions in their place"
        );
        self.note(NoteKind::Warning, text);
        let rhs_function = SignedFunction::new("derivatives", self.dag, d, &switches, rhs)?;
        let psi_function = SignedFunction::new("switching functions", self.dag, d, &switches, &psi)?;
        let timed = |f: &SignedFunction| !f.jac_pattern().rows(d.t_col()).is_empty();
        let clock = timed(&rhs_function) || timed(&psi_function);
        let still = self.lint_states(rhs, &[]);
        let mut system = System::new(d.x, d.u, d.p)?;
        system.set_on_demand(OnDemand { rhs: Arc::new(rhs_function), psi: Arc::new(psi_function), upstream })?;
        let report = self.report(clock);
        self.built(system, report, Vec::new(), saved, still)
    }
}
