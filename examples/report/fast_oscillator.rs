//! The oscillator (4.4) as fast as it can be written: compiled functions, and DOP853 with its one event by hand.

use crate::models::{pattern, PI};
use std::sync::Arc;
use std::time::Instant;

use switchback::event::pairs::dop853;
use switchback::func::{Dims, EvalResult, Function, Point};
use switchback::linalg::csc::Pattern;
use switchback::system::{Regions, Subsystem, System};

/// Angular frequency.
pub const W: f64 = 2.0 * PI;

/// The modes of the oscillator as compiled code, one alone where only one is asked for.
struct Modes {
    jac: Pattern,
    hess: Pattern,
}

/// Its switching function.
struct Surface {
    jac: Pattern,
    hess: Pattern,
}

const D2: Dims = Dims { x: 2, u: 0, p: 0 };

impl Function for Modes {
    fn name(&self) -> &str {
        "F"
    }
    fn dims(&self) -> Dims {
        D2
    }
    fn n_out(&self) -> usize {
        4
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        self.value_rows(at, 0..2, out, work)?;
        self.value_rows(at, 2..4, out, work)
    }
    fn value_rows(&self, at: &Point, rows: std::ops::Range<usize>, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let w = if rows.start == 0 { -W } else { W };
        out[rows.start] = at.x[0] + w * at.x[1];
        out[rows.start + 1] = at.x[1] - w * at.x[0];
        Ok(())
    }
    fn jacobian(&self, _: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.copy_from_slice(&[1.0, W, 1.0, -W, -W, 1.0, W, 1.0]);
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        Ok(())
    }
}

impl Function for Surface {
    fn name(&self) -> &str {
        "psi"
    }
    fn dims(&self) -> Dims {
        D2
    }
    fn n_out(&self) -> usize {
        1
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out[0] = at.x[0] * at.x[0] + at.x[1] * at.x[1] - 1.0;
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out[0] = 2.0 * at.x[0];
        out[1] = 2.0 * at.x[1];
        Ok(())
    }
    fn hessian(&self, _: &Point, weights: &[f64], out: &mut [f64], _: &mut [f64]) -> EvalResult {
        out.fill(2.0 * weights[0]);
        Ok(())
    }
}

/// The system.
pub fn compiled() -> System {
    let dense: Vec<(usize, usize)> = (0..2).flat_map(|j| (0..4).map(move |i| (i, j))).collect();
    let modes = Modes { jac: pattern(4, 3, &dense), hess: Pattern::empty(3, 3) };
    let psi = Surface { jac: pattern(1, 3, &[(0, 0), (0, 1)]), hess: pattern(3, 3, &[(0, 0), (1, 1)]) };
    let mut s = System::new(2, 0, 0).expect("two states");
    let regions = Regions::Signs { psi: Arc::new(psi), signs: vec![1, -1] };
    s.add_subsystem(Subsystem { rows: vec![0, 1], modes: Arc::new(modes), n_modes: 2, regions }).expect("it fits");
    s
}

/// DOP853 with this one event, for this one system: what a careful person writes. State at the end, switching time.
pub fn by_hand(rtol: f64, x0: [f64; 2], t_end: f64) -> ([f64; 2], f64) {
    let mut w = W;
    let f = |w: f64, x: [f64; 2]| [x[0] + w * x[1], x[1] - w * x[0]];
    let psi = |x: [f64; 2]| x[0] * x[0] + x[1] * x[1] - 1.0;
    let (mut t, mut x, mut h, mut switched) = (0.0, x0, 0.01f64, f64::NAN);
    let mut k = [[0.0; 2]; 16];
    k[0] = f(w, x);
    fn sum<const M: usize>(k: &[[f64; 2]; 16], row: &[(usize, f64); M]) -> [f64; 2] {
        let mut s = [0.0; 2];
        for &(j, a) in row {
            s[0] += a * k[j][0];
            s[1] += a * k[j][1];
        }
        s
    }
    let at = |x: [f64; 2], h: f64, s: [f64; 2]| [x[0] + h * s[0], x[1] + h * s[1]];
    while t < t_end {
        h = h.min(t_end - t);
        macro_rules! stage {
            ($i:expr, $row:expr) => {
                k[$i] = f(w, at(x, h, sum(&k, &$row)))
            };
        }
        stage!(1, dop853::A1);
        stage!(2, dop853::A2);
        stage!(3, dop853::A3);
        stage!(4, dop853::A4);
        stage!(5, dop853::A5);
        stage!(6, dop853::A6);
        stage!(7, dop853::A7);
        stage!(8, dop853::A8);
        stage!(9, dop853::A9);
        stage!(10, dop853::A10);
        stage!(11, dop853::A11);
        let y = at(x, h, sum(&k, &dop853::A12));
        let (e5, e3) = (sum(&k, &dop853::E5), sum(&k, &dop853::E3));
        let (mut s5, mut s3) = (0.0, 0.0);
        for i in 0..2 {
            let scale = rtol + rtol * x[i].abs().max(y[i].abs());
            s5 += (e5[i] / scale).powi(2);
            s3 += (e3[i] / scale).powi(2);
        }
        let err = h * s5 / (2.0 * (s5 + 0.01 * s3)).sqrt().max(f64::MIN_POSITIVE);
        let factor = (0.9 * err.max(1e-10).powf(-0.125)).clamp(0.333, 6.0);
        if err > 1.0 {
            h *= factor.min(1.0);
            continue;
        }
        k[12] = f(w, y);
        if switched.is_nan() && psi(y) >= 0.0 {
            stage!(13, dop853::A13);
            stage!(14, dop853::A14);
            stage!(15, dop853::A15);
            let rows = [sum(&k, &dop853::D0), sum(&k, &dop853::D1), sum(&k, &dop853::D2), sum(&k, &dop853::D3)];
            let dense = |s: f64| {
                let mut out = [0.0; 2];
                for i in 0..2 {
                    let d = y[i] - x[i];
                    let c = [d, h * k[0][i] - d, 2.0 * d - h * (k[0][i] + k[12][i])];
                    let mut v = 0.0;
                    for (m, r) in rows.iter().enumerate().rev() {
                        v = (v + h * r[i]) * if m % 2 == 1 { s } else { 1.0 - s };
                    }
                    out[i] = x[i] + s * (c[0] + (1.0 - s) * (c[1] + s * (c[2] + v)));
                }
                out
            };
            let (mut lo, mut hi) = (0.0, 1.0);
            let (mut p_lo, mut p_hi) = (psi(x), psi(y));
            for _ in 0..60 {
                let s = lo - p_lo * (hi - lo) / (p_hi - p_lo);
                let p = psi(dense(s));
                if p < 0.0 {
                    (lo, p_lo, p_hi) = (s, p, 0.5 * p_hi);
                } else {
                    (hi, p_hi, p_lo) = (s, p, 0.5 * p_lo);
                }
                if p.abs() < 1e-15 || hi - lo < 1e-16 {
                    lo = s;
                    break;
                }
            }
            switched = t + lo * h;
            x = dense(lo);
            t = switched;
            w = -w;
            k[0] = f(w, x);
            continue;
        }
        t += h;
        x = y;
        k[0] = k[12];
        h *= factor;
    }
    (x, switched)
}

/// Shortest time of one call in seconds, from batches long enough to be measured.
pub fn best_of(mut run: impl FnMut()) -> f64 {
    let mut best = f64::INFINITY;
    for _ in 0..15 {
        let n = 40;
        let clock = Instant::now();
        for _ in 0..n {
            run();
        }
        best = best.min(clock.elapsed().as_secs_f64() / f64::from(n));
    }
    best
}
