//! The Jacobian of the right-hand side with respect to the state by its entries, for systems large enough that most of them
//! are zero.

use super::{Field, Sub};
use crate::dcs::Drift;
use crate::func::{EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

/// Of fewer states, or more entries than this part of the matrix, dense factors cost as little.
const FEWEST: usize = 24;
const SHARE: usize = 4;

/// Entry of a Jacobian as a function computes it, and its place in the whole.
type Placed = Vec<(usize, usize)>;

/// The pattern, whatever the active set, and where the entries of every function go.
pub(in crate::event) struct Entries {
    pub(in crate::event) pattern: Pattern,
    drifts: Vec<Placed>,
    /// Of every mode of every subsystem.
    modes: Vec<Vec<Placed>>,
}

impl Entries {
    /// None where the matrix is small or full. The diagonal is always part of the pattern.
    pub(super) fn new(nx: usize, drifts: &[Drift], subs: &[Sub]) -> Option<Entries> {
        if nx < FEWEST {
            return None;
        }
        let (mut rows, mut cols): (Vec<usize>, Vec<usize>) = (0..nx).map(|i| (i, i)).unzip();
        let mut note = |f: &dyn Function, from: usize, to: &[usize]| -> Placed {
            let (p, mut own) = (f.jac_pattern(), Vec::new());
            for (j, entries) in p.columns().take_while(|c| c.0 < nx) {
                for k in entries {
                    if let Some(&row) = p.row_idx()[k].checked_sub(from).and_then(|i| to.get(i)) {
                        own.push((k, rows.len()));
                        rows.push(row);
                        cols.push(j);
                    }
                }
            }
            own
        };
        let mut of_drifts: Vec<Placed> = drifts.iter().map(|d| note(d.f.as_ref(), 0, &d.rows)).collect();
        let mut of_modes: Vec<Vec<Placed>> = Vec::with_capacity(subs.len());
        for s in subs {
            let nr = s.rows.len();
            let n_modes = s.n_out.checked_div(nr).unwrap_or(0);
            of_modes.push((0..n_modes).map(|m| note(s.modes.as_ref(), m * nr, &s.rows)).collect());
        }
        let (pattern, map) = Pattern::from_triplets(nx, nx, &rows, &cols);
        if SHARE * pattern.nnz() > nx * nx {
            return None;
        }
        let all = of_drifts.iter_mut().chain(of_modes.iter_mut().flatten()).flatten();
        all.for_each(|(_, place)| *place = map[*place]);
        Some(Entries { pattern, drifts: of_drifts, modes: of_modes })
    }
}

impl Field {
    /// The pattern of the Jacobian with respect to the state; none where dense factors serve.
    pub(in crate::event) fn sparse_pattern(&self) -> Option<&Pattern> {
        self.entries.as_ref().map(|e| &e.pattern)
    }

    /// Entries of the Jacobian of `b + D α` with respect to the state for fixed `α`, in the order of the pattern.
    pub(in crate::event) fn jacobian_entries(
        &mut self,
        t: f64,
        x: &[f64],
        alpha: &[f64],
        out: &mut [f64],
    ) -> EvalResult {
        self.counts.jacobians += 1;
        let Some(e) = &self.entries else { return Ok(()) };
        let at = Point { t, x, u: &self.u, p: &self.p };
        out.fill(0.0);
        for (d, own) in self.drifts.iter().zip(&e.drifts) {
            let n = d.f.jac_pattern().nnz();
            d.f.jacobian(&at, &mut self.buffer[..n], &mut self.work)?;
            own.iter().for_each(|&(k, place)| out[place] += self.buffer[k]);
        }
        for (k, s) in self.subs.iter().enumerate() {
            let n = s.modes.jac_pattern().nnz();
            if n == 0 {
                continue;
            }
            let nr = s.rows.len();
            for &cell in &self.active[k] {
                let weight = self.theta_in(alpha, cell);
                let mode = s.cells[cell - s.first].mode;
                s.modes.jacobian_rows(&at, mode * nr..(mode + 1) * nr, &mut self.buffer[..n], &mut self.work)?;
                e.modes[k][mode].iter().for_each(|&(k, place)| out[place] += weight * self.buffer[k]);
            }
        }
        Ok(())
    }
}
