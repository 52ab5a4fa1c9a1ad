//! The model functions of many subsystems in one program.

use super::{Field, Sub};
use crate::dcs::Drift;
use crate::func::{Bundle, Function, Point};

/// Of fewer subsystems every function is called by itself: that costs as much, and nothing beforehand.
const FEWEST: usize = 4;

/// The program, and which of its parts is what.
pub(super) struct Bundled {
    program: Box<dyn Bundle>,
    /// Number of drifts, which are the first parts.
    drifts: usize,
    /// The part of the first mode of every subsystem.
    modes: Vec<usize>,
    /// The part of the indicators of the first subsystem.
    indicators: usize,
    /// Room for the values of a part.
    room: Vec<f64>,
}

impl Bundled {
    /// None where the functions do not allow for it, or there are few of them.
    pub(super) fn new(drifts: &[Drift], subs: &[Sub]) -> Option<Bundled> {
        if subs.len() < FEWEST {
            return None;
        }
        let mut parts: Vec<(&dyn Function, std::ops::Range<usize>)> =
            drifts.iter().map(|d| (d.f.as_ref(), 0..d.f.n_out())).collect();
        let mut modes = Vec::with_capacity(subs.len());
        for s in subs {
            modes.push(parts.len());
            let nr = s.rows.len();
            let n_modes = s.n_out.checked_div(nr).unwrap_or(0);
            parts.extend((0..n_modes).map(|m| (s.modes.as_ref(), m * nr..(m + 1) * nr)));
        }
        let indicators = parts.len();
        parts.extend(subs.iter().map(|s| (s.indicators.as_ref(), 0..s.n_q)));
        let longest = parts.iter().map(|p| p.1.len()).max().unwrap_or(0);
        let program = parts[0].0.bundle(&parts)?;
        Some(Bundled { program, drifts: drifts.len(), modes, indicators, room: vec![0.0; longest] })
    }
}

/// All that follows says whether it has succeeded. Where a value is not finite the functions are asked one by one, which
/// says more about it.
impl Field {
    /// Are there so many model functions that evaluating all of them for one of them is to be avoided?
    pub(in crate::event) fn many_functions(&self) -> bool {
        self.bundle.is_some()
    }

    /// Right-hand side where nothing slides.
    pub(super) fn bundled_rhs(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        let mut finite = drift(b, &self.drifts, self.direct, out);
        for (k, s) in self.subs.iter().enumerate() {
            let mode = s.cells[self.active[k][0] - s.first].mode;
            let own = &mut b.room[..s.rows.len()];
            finite &= b.program.evaluate(b.modes[k] + mode, own);
            s.rows.iter().zip(own.iter()).for_each(|(&r, f)| out[r] += f);
        }
        finite
    }

    /// The smooth part of the right-hand side.
    pub(super) fn bundled_drift(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        drift(b, &self.drifts, self.direct, out)
    }

    /// Adds the cells `sets` of those subsystems that are `decided`, with the weight `theta` of the first one where there are
    /// two.
    pub(super) fn add_bundled(
        &mut self,
        (t, x): (f64, &[f64]),
        decided: &[bool],
        (sets, theta): (&[Vec<usize>], &[f64]),
        out: &mut [f64],
    ) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        let own: Vec<(usize, f64, usize)> = (0..sets.len())
            .filter(|k| decided[*k])
            .flat_map(|k| {
                let weights = if sets[k].len() > 1 { [theta[k], 1.0 - theta[k]] } else { [1.0, 0.0] };
                sets[k].iter().zip(weights).map(move |(cell, w)| (k, w, *cell))
            })
            .collect();
        let mut values = vec![0.0; own.iter().map(|o| self.subs[o.0].rows.len()).sum()];
        let mut at = 0;
        for &(k, _, cell) in &own {
            let s = &self.subs[k];
            let part = b.modes[k] + s.cells[cell - s.first].mode;
            if !b.program.evaluate(part, &mut values[at..at + s.rows.len()]) {
                return false;
            }
            at += s.rows.len();
        }
        let mut values = values.into_iter();
        for (k, weight, _) in own {
            self.subs[k].rows.iter().zip(&mut values).for_each(|(&r, v)| out[r] += weight * v);
        }
        true
    }

    /// `b` and `D` of a sliding mode.
    pub(super) fn bundled_parts(&mut self, t: f64, x: &[f64]) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        let mut finite = drift(b, &self.drifts, self.direct, &mut self.base);
        for (k, s) in self.subs.iter().enumerate() {
            let (set, nr) = (&self.active[k], s.rows.len());
            let part = |cell: usize| b.modes[k] + s.cells[cell - s.first].mode;
            if set.len() > 1 {
                let own = self.sliding.columns_mut(self.first_pair[k]..self.first_pair[k + 1]);
                for (column, &cell) in own.chunks_exact_mut(nr.max(1)).zip(&set[1..]) {
                    finite &= b.program.evaluate(part(cell), column);
                }
            }
            let own = &mut b.room[..nr];
            finite &= b.program.evaluate(part(set[0]), own);
            if set.len() > 1 {
                let columns = self.sliding.columns_mut(self.first_pair[k]..self.first_pair[k + 1]);
                for column in columns.chunks_exact_mut(nr.max(1)) {
                    column.iter_mut().zip(own.iter()).for_each(|(d, f)| *d -= f);
                }
            }
            s.rows.iter().zip(own.iter()).for_each(|(&r, f)| self.base[r] += f);
        }
        finite
    }

    /// All indicator functions.
    pub(super) fn bundled_indicators(&mut self, t: f64, x: &[f64]) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        b.program.move_to(&Point { t, x, u: &self.u, p: &self.p });
        self.subs.iter().enumerate().all(|(k, s)| b.program.evaluate(b.indicators + k, &mut self.q[s.q0..s.q0 + s.n_q]))
    }
}

/// The smooth part of the right-hand side.
fn drift(b: &mut Bundled, drifts: &[Drift], direct: bool, out: &mut [f64]) -> bool {
    let mut finite = true;
    if !direct {
        out.fill(0.0);
    }
    for (i, d) in drifts.iter().enumerate().take(b.drifts) {
        if i == 0 && direct {
            finite &= b.program.evaluate(0, out);
            continue;
        }
        let own = &mut b.room[..d.rows.len()];
        finite &= b.program.evaluate(i, own);
        d.rows.iter().zip(own.iter()).for_each(|(&r, v)| out[r] += v);
    }
    finite
}
