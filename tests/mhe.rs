//! Moving horizon estimation against references that it did not compute: the Kalman filter, and sums of squares over all samples.

use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::Arc;
use switchback::error::Error;
use switchback::expr::Graph;
use switchback::func::{Callback, Dims, Point};
use switchback::nmpc::{Mhe, MheOptions, Noise, Source};
use switchback::ocp::Ocp;
use switchback::qp::QpStatus;
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

const H: f64 = 0.1;

/// Uniform numbers between −1 and 1 (Numerical Recipes' LCG).
fn numbers(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

fn dims() -> Dims {
    Dims { x: 3, u: 1, p: 0 }
}

/// An oscillator under a force with an unknown constant bias, of which the position and a sum are measured.
fn problem(n: usize, x0: &[f64]) -> (Ocp, SharedFunction) {
    let g = Graph::new();
    let [q, v, bias, u] = [g.x(0), g.x(1), g.x(2), g.u(0)];
    let f: SharedFunction = Arc::new(g.function("f", dims(), &[v, u - q - 0.2 * v + bias, 0.0 * bias]).unwrap());
    let y: SharedFunction = Arc::new(g.function("y", dims(), &[q, 0.5 * q + v]).unwrap());
    let mut system = System::new(3, 1, 0).unwrap();
    system.set_f0(f).unwrap();
    let mut ocp = Ocp::new(&system, n as f64 * H, n, &Settings::default()).unwrap();
    ocp.set_x0(x0).unwrap();
    (ocp, y)
}

fn explicit() -> MheOptions {
    MheOptions { family: Some(Family::Explicit), n_s: 4, steps: 1, ..MheOptions::default() }
}

/// The classical Runge-Kutta step of the oscillator: linear in state and control.
fn step(x: &[f64], u: f64) -> Vec<f64> {
    let f = |x: &[f64]| [x[1], u - x[0] - 0.2 * x[1] + x[2], 0.0];
    let add = |a: f64, k: &[f64]| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + a * k).collect() };
    let a = f(x);
    let b = f(&add(0.5 * H, &a));
    let c = f(&add(0.5 * H, &b));
    let d = f(&add(H, &c));
    (0..3).map(|i| x[i] + H / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])).collect()
}

const INITIAL: [f64; 3] = [1.0, 2.0, 0.5];
const PROCESS: [f64; 3] = [0.0, 0.05, 0.0];
const MEASUREMENT: [f64; 2] = [0.02, 0.1];

fn noise() -> Noise<'static> {
    Noise { initial: &INITIAL, process: &PROCESS, measurement: &MEASUREMENT }
}

/// Kalman's equations, measurement by measurement.
struct Kalman {
    x: Vec<f64>,
    p: [[f64; 3]; 3],
}

impl Kalman {
    fn measure(&mut self, y: &[f64]) {
        for (i, h) in [[1.0, 0.0, 0.0], [0.5, 1.0, 0.0]].iter().enumerate().filter(|e| y[e.0].is_finite()) {
            let ph: Vec<f64> = self.p.iter().map(|r| r.iter().zip(h).map(|(p, h)| p * h).sum()).collect();
            let s = h.iter().zip(&ph).map(|(h, p)| h * p).sum::<f64>() + MEASUREMENT[i].powi(2);
            let e = y[i] - h.iter().zip(&self.x).map(|(h, x)| h * x).sum::<f64>();
            for a in 0..3 {
                self.x[a] += ph[a] / s * e;
                for b in 0..3 {
                    self.p[a][b] -= ph[a] * ph[b] / s;
                }
            }
        }
    }

    fn pass(&mut self, u: f64) {
        let zero = step(&[0.0; 3], 0.0);
        let columns: Vec<Vec<f64>> = (0..3).map(|j| step(&[0, 1, 2].map(|i| f64::from(i == j)), 0.0)).collect();
        assert!(zero.iter().all(|v| *v == 0.0));
        self.x = step(&self.x, u);
        let mut next = [[0.0; 3]; 3];
        for a in 0..3 {
            for b in 0..3 {
                for k in 0..3 {
                    for l in 0..3 {
                        next[a][b] += columns[k][a] * self.p[k][l] * columns[l][b];
                    }
                }
            }
            next[a][a] += PROCESS[a].powi(2);
        }
        self.p = next;
    }
}

/// The last state and its covariance are those of the Kalman filter at every sample: before the window is full, and long after, with missing
/// measurements, for windows of one stage and of many.
#[test]
fn linear_systems_have_the_kalman_filter() {
    for n in [1, 4, 15] {
        let (ocp, y) = problem(n, &[0.5, 0.0, 0.0]);
        let mut mhe = Mhe::new(&ocp, &y, &noise(), &explicit()).unwrap();
        let mut kalman = Kalman { x: vec![0.5, 0.0, 0.0], p: [[0.0; 3]; 3] };
        (0..3).for_each(|i| kalman.p[i][i] = INITIAL[i].powi(2));
        let mut r = numbers(n as u64);
        let mut truth = vec![1.0, -1.0, 0.3];
        let (mut x, mut p) = ([0.0; 3], [0.0; 9]);
        for k in 0..60 {
            let mut y = [truth[0] + MEASUREMENT[0] * r(), 0.5 * truth[0] + truth[1] + MEASUREMENT[1] * r()];
            if k % 7 == 3 {
                y[0] = f64::NAN;
            }
            if k % 11 == 5 {
                y = [f64::NAN; 2];
            }
            let found = mhe.estimate(&y, &mut x).unwrap();
            assert_eq!((found.source, found.status), (Source::Qp, QpStatus::Solved));
            kalman.measure(&y);
            mhe.covariance(&mut p).unwrap();
            for i in 0..3 {
                assert!((x[i] - kalman.x[i]).abs() < 1e-9, "{n} {k} {i}: {} {}", x[i], kalman.x[i]);
                for j in 0..3 {
                    let scale = (kalman.p[i][i] * kalman.p[j][j]).sqrt();
                    assert!((p[3 * i + j] - kalman.p[i][j]).abs() < 1e-8 * scale, "{n} {k} {i} {j}");
                }
            }
            let u = (0.3 * k as f64).sin();
            truth = step(&truth, u);
            truth[1] += PROCESS[1] * r();
            assert!(mhe.prepare(&[u]).unwrap());
            kalman.pass(u);
        }
        assert_eq!(mhe.filled(), n);
        // it found the bias by the measurements alone
        assert!((x[2] - 0.3).abs() < 0.1, "{}", x[2]);
    }
}

/// Bounds hold at all nodes, and where the data contradict them the estimate is at the bound.
#[test]
fn bounds_hold() {
    let (mut ocp, y) = problem(6, &[0.5, 0.0, 0.0]);
    let free = f64::INFINITY;
    ocp.set_x_bounds(&[-free, -free, -0.1], &[free, free, 0.1]).unwrap();
    let mut mhe = Mhe::new(&ocp, &y, &noise(), &explicit()).unwrap();
    let mut truth = vec![1.0, 0.0, 0.4];
    let mut x = [0.0; 3];
    for _ in 0..30 {
        let found = mhe.estimate(&[truth[0], 0.5 * truth[0] + truth[1]], &mut x).unwrap();
        assert_eq!(found.source, Source::Qp);
        assert!(mhe.states().chunks(3).all(|x| x[2] <= 0.1 + 1e-9 && x[2] >= -0.1 - 1e-9));
        truth = step(&truth, 0.0);
        mhe.prepare(&[0.0]).unwrap();
    }
    assert!((x[2] - 0.1).abs() < 1e-9);
}

/// A preparation that a function ends with a negative code changes nothing: called again it leads to the same estimates, with a full window, too.
#[test]
fn what_ends_a_preparation_ends_it_before_the_window_moves() {
    let broken = Arc::new(AtomicBool::new(false));
    let run = |breaks: bool| {
        let state = broken.clone();
        let f = Callback::new("f", dims(), 3, move |at: &Point, out: &mut [f64]| {
            out.copy_from_slice(&[at.x[1], at.u[0] - at.x[0] - 0.2 * at.x[1] + at.x[2], 0.0]);
            -i32::from(state.load(Relaxed))
        });
        let mut system = System::new(3, 1, 0).unwrap();
        system.set_f0(Arc::new(f)).unwrap();
        let mut ocp = Ocp::new(&system, 4.0 * H, 4, &Settings::default()).unwrap();
        ocp.set_x0(&[0.3, 0.0, 0.1]).unwrap();
        let (_, y) = problem(4, &[0.0; 3]);
        let mut mhe = Mhe::new(&ocp, &y, &noise(), &explicit()).unwrap();
        let (mut found, mut x) = (Vec::new(), [0.0; 3]);
        for k in 0..8 {
            let (a, b) = (0.3 + 0.01 * k as f64, 0.2 - 0.02 * k as f64);
            mhe.estimate(&[a, b], &mut x).unwrap();
            found.extend(x.map(f64::to_bits));
            broken.store(breaks && k % 3 == 0, Relaxed);
            if breaks && k % 3 == 0 {
                assert!(matches!(mhe.prepare(&[0.1]), Err(Error::User { code: -1, .. })));
                broken.store(false, Relaxed);
            }
            assert!(mhe.prepare(&[0.1]).unwrap());
        }
        found
    };
    assert_eq!(run(true), run(false));
}

/// A start again is the start: the same numbers to the last bit.
#[test]
fn a_reset_is_a_start() {
    let run = |mhe: &mut Mhe| {
        let mut x = [0.0; 3];
        (0..12)
            .map(|k| {
                mhe.estimate(&[0.1 * f64::from(k), f64::NAN], &mut x).unwrap();
                mhe.prepare(&[0.2]).unwrap();
                x
            })
            .collect::<Vec<_>>()
    };
    let (ocp, y) = problem(5, &[0.5, 0.0, 0.0]);
    let mut mhe = Mhe::new(&ocp, &y, &noise(), &explicit()).unwrap();
    let first = run(&mut mhe);
    mhe.reset(&[0.5, 0.0, 0.0]).unwrap();
    assert_eq!(run(&mut mhe), first);
    mhe.reset(&[0.6, 0.0, 0.0]).unwrap();
    assert_ne!(run(&mut mhe), first);
}

/// What is wrong is said.
#[test]
fn errors_say_what_is_wrong() {
    let (mut ocp, y) = problem(5, &[0.5, 0.0, 0.0]);
    let message = |ocp: &Ocp, noise: &Noise| match Mhe::new(ocp, &y, noise, &explicit()) {
        Err(e) => e.to_string(),
        Ok(_) => String::new(),
    };
    assert!(message(&ocp, &Noise { initial: &[1.0, 0.0, 1.0], ..noise() }).contains("positive"));
    assert!(message(&ocp, &Noise { measurement: &[1.0], ..noise() }).contains("measurement"));
    let mut mhe = Mhe::new(&ocp, &y, &noise(), &explicit()).unwrap();
    let mut x = [0.0; 3];
    assert!(mhe.estimate(&[f64::INFINITY, 0.0], &mut x).unwrap_err().to_string().contains("NaN"));
    mhe.estimate(&[0.0, 0.0], &mut x).unwrap();
    assert!(mhe.estimate(&[0.0, 0.0], &mut x).unwrap_err().to_string().contains("prepare"));
    let g = Graph::new();
    ocp.set_mayer(Arc::new(g.function("m", dims(), &[g.x(0)]).unwrap())).unwrap();
    assert!(message(&ocp, &noise()).contains("costs"));
}
