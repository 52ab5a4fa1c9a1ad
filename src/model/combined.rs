//! The right-hand side as one function of the states and the weights of all modes.
//!
//! A mechanism with friction in every joint is `q'' = M⁻¹ (b − Σ_k c_k sign(w_k))`. Taken apart, the smooth part and the modes of every
//! joint each solve with `M`, and differentiate that; put together with a weight for every mode it is one solution of one linear system.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::cells::Cells;
use super::Builder;
use crate::error::Result;
use crate::expr::{Block, ExprFunction, Id};
use crate::func::Dims;

impl Builder<'_> {
    /// The right-hand side `rhs` with the parts that switch replaced by their weighted sums over modes: states first, then the weights
    /// of the modes of `subsystems`. `settled` are groups in which nothing switches. None where smooth part `f0` and modes have no
    /// decomposition of a matrix in common: evaluated one by one they cost no more then.
    pub(super) fn combined(
        &mut self,
        rhs: &[Id],
        f0: &[Id],
        subsystems: &[Cells],
        settled: &[Cells],
    ) -> Result<Option<Arc<ExprFunction>>> {
        if !self.shares_decomposition(f0, subsystems) {
            return Ok(None);
        }
        let nx = self.model.dims.x;
        let mut by = BTreeMap::new();
        let mut n_weights = 0;
        for c in settled {
            let Some(values) = c.atoms_in(self.dag, 0) else { return Ok(None) };
            by.extend(c.atoms.iter().copied().zip(values));
        }
        for c in subsystems {
            let mut sums = vec![self.dag.constant(0.0); c.atoms.len()];
            for mode in 0..c.modes.len() {
                let weight = self.dag.input(Block::X, nx + n_weights);
                let Some(values) = c.atoms_in(self.dag, mode) else { return Ok(None) };
                for (sum, v) in sums.iter_mut().zip(values) {
                    let term = self.dag.mul(weight, v);
                    *sum = self.dag.add(*sum, term);
                }
                n_weights += 1;
            }
            by.extend(c.atoms.iter().copied().zip(sums));
        }
        let outputs = self.dag.replace(rhs, &by);
        if !self.dag.switches_of(&outputs).is_empty() {
            return Ok(None);
        }
        let dims = Dims { x: nx + n_weights, ..self.model.dims };
        Ok(Some(Arc::new(ExprFunction::new("rhs", self.dag, dims, &outputs)?)))
    }

    /// Do two of the functions that a system is made of decompose the same matrix?
    fn shares_decomposition(&self, f0: &[Id], subsystems: &[Cells]) -> bool {
        let mut all = self.dag.decompositions_of(f0);
        for c in subsystems {
            let values: Vec<Id> = c.modes.iter().flat_map(|m| m.1.iter().copied()).collect();
            all.extend(self.dag.decompositions_of(&values));
        }
        let n = all.len();
        all.sort_unstable();
        all.dedup();
        all.len() < n
    }
}
