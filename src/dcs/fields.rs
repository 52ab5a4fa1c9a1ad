//! A system cell by cell at a point, and which cells are near the point.

use super::filippov::{CellFields, Gradient, SubsystemCells};
use super::{Dcs, Drift, Stewart};
use crate::func::{EvalResult, Point};

/// Rounding of an indicator, relative to the sizes of the terms of its first-order change from zero.
const ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A subsystem, and where its cells and indicator functions are among those of all.
struct Sub {
    stewart: Stewart,
    first: usize,
    first_function: usize,
    by_signs: bool,
}

/// Right-hand sides and indicators of a system. All memory is allocated once.
///
/// [`DcsFields::move_to`] says where it is; the complementarity problem there is that of
/// [`FilippovProblem`](super::filippov::FilippovProblem).
pub struct DcsFields {
    nx: usize,
    /// Column of the time in Jacobians.
    t_col: usize,
    drifts: Vec<Drift>,
    subs: Vec<Sub>,
    u: Vec<f64>,
    p: Vec<f64>,
    /// Sizes of the states and of the time.
    place: Vec<f64>,
    /// How far states and time go in a step, whatever the mode.
    way: Vec<f64>,
    /// Indicator functions.
    q: Vec<f64>,
    /// Their derivatives with respect to states and time, `n_q × (nx + 1)`.
    dq: Vec<f64>,
    /// All states.
    columns: Vec<usize>,
    f0: Vec<f64>,
    buffer: Vec<f64>,
    work: Vec<f64>,
}

impl DcsFields {
    /// For a system.
    pub fn new(dcs: &Dcs) -> DcsFields {
        let d = dcs.dims();
        let functions = dcs.drifts().iter().map(|d| &d.f);
        let functions = functions.chain(dcs.subsystems().iter().flat_map(|s| [&s.modes, &s.indicators]));
        let (mut buffer, mut work) = (0, 0);
        for f in functions {
            buffer = buffer.max(f.n_out()).max(f.jac_pattern().nnz());
            work = work.max(f.work_len());
        }
        let (mut first, mut first_function) = (0, 0);
        let mut subs = Vec::new();
        for s in dcs.subsystems() {
            subs.push(Sub { stewart: s.clone(), first, first_function, by_signs: s.by_signs() });
            first += s.cells.len();
            first_function += s.indicators.n_out();
        }
        DcsFields {
            nx: d.x,
            t_col: d.t_col(),
            drifts: dcs.drifts().to_vec(),
            subs,
            u: vec![0.0; d.u],
            p: vec![0.0; d.p],
            place: vec![0.0; d.x + 1],
            way: vec![0.0; d.x + 1],
            q: vec![0.0; first_function],
            dq: vec![0.0; first_function * (d.x + 1)],
            columns: (0..d.x).collect(),
            f0: vec![0.0; d.x],
            buffer: vec![0.0; buffer],
            work: vec![0.0; work],
        }
    }

    /// Goes to a point at the start of a step of this length.
    pub fn move_to(&mut self, at: &Point, length: f64) -> EvalResult {
        let nx = self.nx;
        self.u.copy_from_slice(at.u);
        self.p.copy_from_slice(at.p);
        self.place.iter_mut().zip(at.x.iter().chain([&at.t])).for_each(|(p, v)| *p = v.abs());
        for s in &self.subs {
            let f = &s.stewart.indicators;
            f.value(at, &mut self.q[s.first_function..s.first_function + f.n_out()], &mut self.work)?;
        }
        self.gradients(at.t, at.x)?;
        // as fast as the fastest mode and the smooth part together
        self.way.fill(0.0);
        self.way[nx] = 1.0;
        for s in self.subs.iter().map(|s| &s.stewart) {
            let out = &mut self.buffer[..s.modes.n_out()];
            s.modes.value(at, out, &mut self.work)?;
            for mode in out.chunks_exact(s.rows.len().max(1)) {
                s.rows.iter().zip(mode).for_each(|(&r, f)| self.way[r] = self.way[r].max(f.abs()));
            }
        }
        let mut f0 = std::mem::take(&mut self.f0);
        let smooth = self.smooth(at.t, at.x, &mut f0);
        self.way.iter_mut().zip(&f0).for_each(|(w, f)| *w += f.abs());
        self.f0 = f0;
        smooth?;
        self.way.iter_mut().for_each(|w| *w *= length);
        Ok(())
    }

    /// For every subsystem the cells whose indicator is so close to its smallest one that it changes by more in a part
    /// `tol` of the step, or that the difference is rounding.
    pub fn near(&self, tol: f64) -> Vec<Vec<usize>> {
        let nz = self.nx + 1;
        let reach: Vec<f64> = self.way.iter().zip(&self.place).map(|(w, p)| tol * w + ROUNDING * p).collect();
        let of = |s: &Sub| {
            let n_q = s.stewart.indicators.n_out();
            let q = &self.q[s.first_function..s.first_function + n_q];
            let value = |weights: &[f64]| weights.iter().zip(q).map(|(w, v)| w * v).sum::<f64>();
            let values: Vec<f64> = s.stewart.cells.iter().map(|c| value(&c.weights)).collect();
            let min = values.iter().fold(f64::INFINITY, |a, &b| a.min(b));
            let close = |c: &usize| {
                let weights = &s.stewart.cells[*c].weights;
                let slope = |r: usize| -> f64 {
                    let rows = self.dq[s.first_function * nz..].chunks_exact(nz);
                    weights.iter().zip(rows).map(|(w, d)| w * d[r]).sum()
                };
                let change: f64 = reach.iter().enumerate().map(|(r, way)| (slope(r) * way).abs()).sum();
                values[*c] - min <= change
            };
            (0..values.len()).filter(close).map(|c| s.first + c).collect()
        };
        self.subs.iter().map(of).collect()
    }

    /// The cells of every subsystem that are marked.
    pub fn lists(&self, marked: &[bool]) -> Vec<Vec<usize>> {
        let own = |s: &Sub| (s.first..s.first + s.stewart.cells.len()).filter(|&c| marked[c]).collect();
        self.subs.iter().map(own).collect()
    }
}

impl CellFields for DcsFields {
    fn nx(&self) -> usize {
        self.nx
    }

    /// A state is as large as its value and what it may change by in the step.
    fn size(&self, i: usize, value: f64) -> f64 {
        value.abs() + self.way[i]
    }

    fn subsystem(&self, k: usize) -> SubsystemCells<'_> {
        let s = &self.subs[k];
        let functions = s.first_function..s.first_function + s.stewart.indicators.n_out();
        SubsystemCells { cells: &s.stewart.cells, first: s.first, functions, by_signs: s.by_signs }
    }

    fn smooth(&mut self, t: f64, x: &[f64], out: &mut [f64]) -> EvalResult {
        let at = Point { t, x, u: &self.u, p: &self.p };
        out.fill(0.0);
        for d in &self.drifts {
            d.f.value(&at, &mut self.buffer[..d.rows.len()], &mut self.work)?;
            for (v, &r) in self.buffer.iter().zip(&d.rows) {
                out[r] += v;
            }
        }
        Ok(())
    }

    fn add_cell(&mut self, t: f64, x: &[f64], cell: usize, out: &mut [f64]) -> EvalResult {
        let at = Point { t, x, u: &self.u, p: &self.p };
        let k = self.subs.partition_point(|s| s.first <= cell) - 1;
        let (s, first) = (&self.subs[k].stewart, self.subs[k].first);
        let nr = s.rows.len();
        let own = s.cells[cell - first].mode * nr..(s.cells[cell - first].mode + 1) * nr;
        s.modes.value_rows(&at, own.clone(), &mut self.buffer[..s.modes.n_out()], &mut self.work)?;
        for (v, &r) in self.buffer[own].iter().zip(&s.rows) {
            out[r] += v;
        }
        Ok(())
    }

    fn gradients(&mut self, t: f64, x: &[f64]) -> EvalResult {
        let at = Point { t, x, u: &self.u, p: &self.p };
        let (nx, nz) = (self.nx, self.nx + 1);
        for s in &self.subs {
            let f = &s.stewart.indicators;
            let p = f.jac_pattern();
            if p.nnz() > 0 {
                f.jacobian(&at, &mut self.buffer[..p.nnz()], &mut self.work)?;
            }
            for (col, to) in (0..nx).map(|c| (c, c)).chain([(self.t_col, nx)]) {
                for k in p.range(col) {
                    // entries outside of the pattern stay zero
                    self.dq[(s.first_function + p.row_idx()[k]) * nz + to] = self.buffer[k];
                }
            }
        }
        Ok(())
    }

    fn gradient(&self, j: usize) -> Gradient<'_> {
        let nz = self.nx + 1;
        Gradient { columns: &self.columns, values: &self.dq[j * nz..j * nz + self.nx], t: self.dq[j * nz + self.nx] }
    }

    fn value(&self, j: usize) -> f64 {
        self.q[j]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dcs::filippov::{distinct, FilippovProblem};
    use crate::func::{Callback, Dims};
    use crate::linalg::csc::Pattern;
    use crate::system::{Regions, Subsystem, System};
    use std::sync::Arc;

    /// `ẋ = v, v̇ = left` for `x < 0`, `right` for `x > 0`, with `x` in units of `a` and time in units of `b`; the surface
    /// is `c x = 0`.
    fn fields(left: f64, right: f64, x: f64, (a, b, c): (f64, f64, f64)) -> DcsFields {
        let d = Dims { x: 1, u: 0, p: 0 };
        let none = Pattern::new(2, 2, vec![0, 0, 0], vec![]).unwrap();
        let modes = Callback::new("F", d, 2, move |_, out| {
            out.copy_from_slice(&[right * b / a, left * b / a]);
            0
        });
        let modes = modes.with_jacobian(none, |_, _| 0).unwrap();
        let psi = Callback::new("psi", d, 1, move |at, out| {
            out[0] = c * at.x[0];
            0
        });
        let one = Pattern::new(1, 2, vec![0, 1, 1], vec![0]).unwrap();
        let psi = psi.with_jacobian(one, move |_, out| {
            out[0] = c;
            0
        });
        let regions = Regions::Signs { psi: Arc::new(psi.unwrap()), signs: vec![1, -1] };
        let mut s = System::new(1, 0, 0).unwrap();
        s.add_subsystem(Subsystem { rows: vec![0], modes: Arc::new(modes), n_modes: 2, regions }).unwrap();
        let mut e = DcsFields::new(&Dcs::stewart(&s).unwrap());
        // a step of the length one in any unit of time
        e.move_to(&Point { t: 0.0, x: &[x / a], u: &[], p: &[] }, 1.0 / b).unwrap();
        e
    }

    const UNITS: [(f64, f64, f64); 7] = [
        (1.0, 1.0, 1.0),
        (1e12, 1.0, 1.0),
        (1e-12, 1.0, 1.0),
        (1.0, 1e12, 1e-12),
        (1.0, 1e-12, 1e12),
        (1e12, 1e-12, 1e12),
        (1e-12, 1e12, 1e-12),
    ];

    #[test]
    fn continuations_do_not_depend_on_units() {
        // left and right speed, number of solutions, are they different
        for (left, right, n, ambiguous) in
            [(1.0, 2.0, 1, false), (1.0, -2.0, 1, false), (-1.0, 1.0, 3, true), (-1e-3, -5e-4, 1, false)]
        {
            for units in UNITS {
                let mut e = fields(left, right, 0.0, units);
                let problem = FilippovProblem::new(&mut e, 0.0, &[0.0], &[vec![0, 1]]).unwrap();
                let (found, _) = problem.solutions(&mut e, 1.0 / units.1).unwrap();
                if left > 0.0 && right < 0.0 {
                    assert!((found[0].theta[0][0] - 1.0 / 3.0).abs() < 1e-12, "{:?}", found[0]);
                }
                let n_found = found.len();
                let several = distinct(&e, &[0.0], found).len() > 1;
                assert_eq!((n_found, several), (n, ambiguous), "{left} {right} in {units:?}");
            }
        }
    }

    #[test]
    fn what_is_near_a_surface_does_not_depend_on_units() {
        for units in UNITS {
            for (x, near) in [(0.0, true), (1e-9, true), (-1e-9, true), (1e-6, false), (-1e-6, false)] {
                let candidates = fields(1.0, -1.0, x, units).near(2e-8);
                assert_eq!(candidates == [vec![0, 1]], near, "{x} in {units:?}");
            }
        }
    }
}
