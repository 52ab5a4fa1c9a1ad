//! Thresholds of controls: guards and switching functions that controls pass whatever the state is, as a lever between two gears does.
//!
//! A motion may jump there, and no descent leads over. What lies behind one is next to a solution.

use crate::func::Point;
use crate::system::{Regions, SharedFunction, System};

/// How far behind a threshold a control is put: a share of its distance from it, or of the sizes of the controls where that is more.
const BEHIND: f64 = 0.1;
const LEAST: f64 = 0.01;

/// The functions with their outputs that depend on controls, but on no state.
pub(super) struct Thresholds(Vec<(SharedFunction, Vec<usize>)>);

impl Thresholds {
    pub fn of(system: &System) -> Thresholds {
        let psi = system.subsystems().iter().filter_map(|s| match &s.regions {
            Regions::Signs { psi, .. } if s.n_modes > 1 => Some(psi),
            _ => None,
        });
        let all = system.transitions().iter().map(|t| &t.guard).chain(psi);
        let of = |f: &SharedFunction| {
            let (d, pattern) = (f.dims(), f.jac_pattern());
            let depends = |row: usize, columns: std::ops::Range<usize>| {
                columns.into_iter().any(|c| pattern.rows(c).contains(&row))
            };
            let rows = (0..f.n_out()).filter(|r| depends(*r, d.x..d.x + d.u) && !depends(*r, 0..d.x));
            (f.clone(), rows.collect::<Vec<usize>>())
        };
        Thresholds(all.map(of).filter(|f| !f.1.is_empty()).collect())
    }

    /// The number of thresholds.
    pub fn count(&self) -> usize {
        self.0.iter().map(|f| f.1.len()).sum()
    }

    /// Controls just behind each of them, the nearest to those of a point in these sizes; nothing for one that has no slope there.
    pub fn passed(&self, at: &Point, sizes: &[f64]) -> Vec<Option<Vec<f64>>> {
        let mut out = Vec::with_capacity(self.count());
        for (f, rows) in &self.0 {
            let (d, pattern) = (f.dims(), f.jac_pattern());
            let (mut value, mut entries) = (vec![f64::NAN; f.n_out()], vec![f64::NAN; pattern.nnz()]);
            let mut work = vec![0.0; f.work_len()];
            let known = f.value(at, &mut value, &mut work).is_ok() && f.jacobian(at, &mut entries, &mut work).is_ok();
            for &row in rows {
                let slope = |j: usize| {
                    let own = pattern.rows(d.x + j).iter().zip(&entries[pattern.range(d.x + j)]);
                    own.filter(|e| *e.0 == row).map(|e| e.1).sum::<f64>() * sizes[j]
                };
                let slopes: Vec<f64> = (0..d.u).map(slope).collect();
                let square: f64 = slopes.iter().map(|s| s * s).sum();
                let behind = (BEHIND * value[row].abs()).max(LEAST * square.sqrt());
                let change = -value[row] - behind.copysign(value[row]);
                let passed = || (0..d.u).map(|j| at.u[j] + change * slopes[j] * sizes[j] / square).collect();
                out.push((known && change.is_finite() && square > 0.0).then(passed));
            }
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::func::Dims;
    use crate::system::{combination, Direction, Rule, Transition};

    /// A guard of two controls, and one of a state, which is none.
    #[test]
    fn controls_pass_the_nearest_place_of_a_threshold() {
        let d = Dims { x: 2, u: 2, p: 0 };
        let mut s = System::new(2, 2, 0).unwrap();
        for (to, guard) in [(1.0, vec![(2, 3.0), (3, 4.0)]), (2.0, vec![(0, 1.0), (2, 1.0)])] {
            let guard = combination("guard", d, vec![guard]);
            let (rule, clauses) = (Rule::default(), vec![]);
            let t = Transition {
                guard,
                direction: Direction::Rising,
                from: vec![],
                reset: None,
                to: vec![(1, to)],
                rule,
                clauses,
            };
            s.add_transition(t).unwrap();
        }
        let thresholds = Thresholds::of(&s);
        assert_eq!(thresholds.count(), 1);
        for side in [1.0, -1.0] {
            // 3 u + 4 w is 5 there, and zero one half from it
            let at = Point { t: 0.0, x: &[0.0; 2], u: &[side * 0.6, side * 0.8], p: &[] };
            let found = thresholds.passed(&at, &[1.0; 2]).remove(0).unwrap();
            let value = 3.0 * found[0] + 4.0 * found[1];
            assert!((value + side * 0.5).abs() < 1e-12 && (found[0] * 0.8 - found[1] * 0.6).abs() < 1e-12, "{found:?}");
        }
    }
}
