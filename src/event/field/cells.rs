//! What the complementarity problem (6.19) asks of the right-hand side.

use super::Field;
use crate::dcs::filippov::{CellFields, Gradient, SubsystemCells};
use crate::func::{EvalError, EvalResult};

impl CellFields for Field {
    fn nx(&self) -> usize {
        self.nx
    }

    fn size(&self, i: usize, value: f64) -> f64 {
        Field::size(self, i, value)
    }

    fn subsystem(&self, k: usize) -> SubsystemCells<'_> {
        let s = &self.subs[k];
        SubsystemCells { cells: &s.cells, first: s.first, functions: s.q0..s.q0 + s.n_q, by_signs: s.signs }
    }

    fn smooth(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        self.drift(t, x, out)
    }

    /// A mode that is not defined at the point, which rounding may have put behind its boundary, is evaluated inside
    /// its region.
    fn add_cell(&mut self, t: f64, x: &[f64], cell: usize, out: &mut [f64]) -> EvalResult {
        match self.add_mode(t, x, cell, 1.0, out) {
            Err(EvalError::Recoverable) => {
                let mut y = x.to_vec();
                self.nudge(cell, &mut y);
                self.add_mode(t, &y, cell, 1.0, out)
            }
            r => r,
        }
    }

    fn gradients(&mut self, t: f64, x: &[f64]) -> EvalResult {
        Field::gradients(self, t, x)
    }

    fn gradient(&self, j: usize) -> Gradient<'_> {
        let g = self.gradient_row(j);
        Gradient { columns: g.columns, values: g.values, t: g.t }
    }

    fn value(&self, j: usize) -> f64 {
        self.q[j]
    }
}
