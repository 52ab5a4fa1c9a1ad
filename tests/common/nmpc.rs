//! Benchmarks of model predictive control as `tests/data/nmpc/problems.json` has them, for tests and for the report.

use std::sync::Arc;
use switchback::expr::Graph;
use switchback::func::{Dims, Point};
use switchback::nmpc::*;
use switchback::ocp::{CostAt, Ocp};
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

/// What a closed loop was.
pub struct Loop {
    pub cost: f64,
    pub controller: Nmpc,
    /// Seconds of preparation and feedback of every sample.
    pub times: Vec<[f64; 2]>,
}

/// A benchmark: problem, plant, disturbances.
pub struct Case {
    pub ocp: Ocp,
    pub nx: usize,
    pub nu: usize,
    pub ts: f64,
    pub steps: usize,
    pub plant_steps: usize,
    pub q: Vec<f64>,
    pub r: Vec<f64>,
    pub qn: Vec<f64>,
    pub xref: Vec<f64>,
    pub x0: Vec<f64>,
    pub samples: usize,
    pub seed: u64,
    pub amp: Vec<f64>,
    pub kicks: Vec<(usize, Vec<f64>)>,
    pub f: SharedFunction,
}

/// Numbers of `tests/data/nmpc/problems.json`.
fn numbers(case: &str, name: &str) -> Vec<f64> {
    let all: serde_json::Value = serde_json::from_str(include_str!("../data/nmpc/problems.json")).unwrap();
    all[case][name].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect()
}

/// `m` masses on springs between a fixed point and one that is moved: the controls are its velocity.
pub fn chain(m: usize) -> Case {
    let g = Graph::new();
    let nx = 6 * m + 3;
    let at = |i: usize, c: usize| if i == 0 { g.constant(0.0) } else { g.x(3 * (i - 1) + c) };
    let (mass, stiffness, rest) = (0.03, 1.0, 0.033);
    let spring: Vec<Vec<_>> = (0..=m)
        .map(|i| {
            let d: Vec<_> = (0..3).map(|c| at(i + 1, c) - at(i, c)).collect();
            let length = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
            let f = (1.0 - rest / length) * stiffness;
            d.into_iter().map(|d| f * d).collect()
        })
        .collect();
    let velocity = |i: usize, c: usize| g.x(3 * (m + 1) + 3 * i + c);
    let mut rates: Vec<_> = (0..m).flat_map(|i| (0..3).map(move |c| (i, c))).map(|(i, c)| velocity(i, c)).collect();
    rates.extend((0..3).map(|c| g.u(c)));
    for pair in spring.windows(2).take(m) {
        for (c, (before, behind)) in pair[0].iter().zip(&pair[1]).enumerate() {
            let weight = if c == 2 { -9.81 } else { 0.0 };
            rates.push((*behind - *before) / mass + weight);
        }
    }
    let f: SharedFunction = Arc::new(g.function("chain", Dims { x: nx, u: 3, p: 0 }, &rates).unwrap());
    let name = format!("chain{m}");
    let (q, r, qn) = (numbers(&name, "Q_diag"), numbers(&name, "R_diag"), numbers(&name, "QN_diag"));
    let mut kick = vec![0.0; nx];
    kick[3 * (m + 1)..].iter_mut().enumerate().for_each(|(i, v)| *v = [0.4, -0.8, 0.4][i % 3]);
    tracking(f, 40, 0.2, 2, q, r, qn, numbers(&name, "xref"), numbers(&name, "x0"), 1.0).with(
        60,
        2,
        numbers(&name, "noise_amp"),
        vec![(25, kick)],
    )
}

/// The swing-up of a pendulum on a cart: states (p, theta, v, omega), theta = 0 upright.
pub fn pendulum() -> Case {
    let g = Graph::new();
    let [th, v, om, force] = [g.x(1), g.x(2), g.x(3), g.u(0)];
    let (mc, mp, l, grav) = (1.0, 0.1, 0.5, 9.81);
    let d = th.sin() * th.sin() * mp + mc;
    let t = force + om * om * th.sin() * (mp * l);
    let dv = (t - th.sin() * th.cos() * (mp * grav)) / d;
    let dom = (th.sin() * ((mc + mp) * grav) - t * th.cos()) / (d * l);
    let dims = Dims { x: 4, u: 1, p: 0 };
    let f: SharedFunction = Arc::new(g.function("pendulum", dims, &[v, om, dv, dom]).unwrap());
    let (q, r, qn) = (vec![10.0, 10.0, 0.1, 0.1], vec![0.01], vec![100.0, 100.0, 10.0, 10.0]);
    tracking(f, 40, 0.05, 1, q, r, qn, vec![0.0; 4], vec![0.0, std::f64::consts::PI, 0.0, 0.0], 12.0).with(
        120,
        1,
        vec![0.0, 0.0, 0.02, 0.05],
        vec![(60, vec![0.0, 0.0, 0.0, 2.0]), (90, vec![0.0, 0.0, -0.8, -1.5])],
    )
}

/// `½ (x − xref)' Q (x − xref) + ½ u' R u`, summed over the starts of the stages, and a terminal cost.
#[allow(clippy::too_many_arguments)]
fn tracking(
    f: SharedFunction,
    n: usize,
    ts: f64,
    steps: usize,
    q: Vec<f64>,
    r: Vec<f64>,
    qn: Vec<f64>,
    xref: Vec<f64>,
    x0: Vec<f64>,
    limit: f64,
) -> Case {
    let d = f.dims();
    let mut system = System::new(d.x, d.u, d.p).unwrap();
    system.set_f0(f.clone()).unwrap();
    let mut settings = Settings::default();
    settings.set_by_name("rk_family", "explicit").unwrap();
    settings.set_by_name("n_s", 4i64).unwrap();
    settings.set_by_name("n_fe", steps as i64).unwrap();
    let mut ocp = Ocp::new(&system, n as f64 * ts, n, &settings).unwrap();
    let g = Graph::new();
    let all: Vec<_> = (0..d.x).map(|i| g.x(i)).chain((0..d.u).map(|i| g.u(i))).collect();
    let stage: SharedFunction = Arc::new(g.function("stage", d, &all).unwrap());
    let end: SharedFunction = Arc::new(g.function("end", d, &all[..d.x]).unwrap());
    let half = |v: &[f64]| v.iter().map(|v| 0.5 * v).collect::<Vec<_>>();
    let weights = [half(&q), half(&r)].concat();
    let mut reference = xref.clone();
    reference.extend(vec![0.0; d.u]);
    ocp.add_least_squares(stage, &weights, &reference, CostAt::Running).unwrap();
    ocp.add_least_squares(end, &half(&qn), &xref, CostAt::Terminal).unwrap();
    ocp.set_u_bounds(&vec![-limit; d.u], &vec![limit; d.u]).unwrap();
    ocp.set_x0(&x0).unwrap();
    let line: Vec<f64> = x0.iter().chain(&xref).copied().collect();
    ocp.set_x_guess(&[0.0, n as f64 * ts], &line).unwrap();
    let (nx, nu) = (d.x, d.u);
    let (amp, kicks) = (vec![0.0; nx], Vec::new());
    Case { ocp, nx, nu, ts, steps, plant_steps: 10, q, r, qn, xref, x0, samples: 0, seed: 0, amp, kicks, f }
}

impl Case {
    fn with(self, samples: usize, seed: u64, amp: Vec<f64>, kicks: Vec<(usize, Vec<f64>)>) -> Case {
        Case { samples, seed, amp, kicks, ..self }
    }

    /// The plant over one sample: the classical method with small steps.
    pub fn plant(&self, x: &mut [f64], u: &[f64]) {
        let (nx, h) = (self.nx, self.ts / self.plant_steps as f64);
        let mut work = vec![0.0; self.f.work_len()];
        let mut f = |x: &[f64], out: &mut [f64]| {
            self.f.value(&Point { t: 0.0, x, u, p: &[] }, out, &mut work).unwrap();
        };
        for _ in 0..self.plant_steps {
            let mut k = vec![vec![0.0; nx]; 4];
            for i in 0..4 {
                let c = [0.0, 0.5, 0.5, 1.0][i];
                let z: Vec<f64> = (0..nx).map(|j| x[j] + if i > 0 { c * h * k[i - 1][j] } else { 0.0 }).collect();
                f(&z, &mut k[i]);
            }
            (0..nx).for_each(|j| x[j] += h / 6.0 * (k[0][j] + 2.0 * k[1][j] + 2.0 * k[2][j] + k[3][j]));
        }
    }

    pub fn stage_cost(&self, x: &[f64], u: &[f64]) -> f64 {
        let part = |w: &[f64], v: &[f64], y: &dyn Fn(usize) -> f64| -> f64 {
            w.iter().zip(v).enumerate().map(|(i, (w, v))| 0.5 * w * (v - y(i)).powi(2)).sum()
        };
        self.ts * (part(&self.q, x, &|i| self.xref[i]) + part(&self.r, u, &|_| 0.0))
    }

    /// The closed loop.
    pub fn run(&self, options: &Options) -> Loop {
        // every problem solved with the state that will be measured
        let ideal = options.scheme == Scheme::Asc;
        let mut c = Nmpc::new(&self.ocp, options).unwrap();
        c.initialise(&self.x0, 200).unwrap();
        let mut x = self.x0.clone();
        let mut u = vec![0.0; self.nu];
        let (mut cost, mut s) = (0.0, self.seed);
        let mut times = Vec::new();
        for k in 0..self.samples {
            let prepared = c.prepare(ideal.then_some(&x)).unwrap();
            let info = c.feedback(&x, &mut u).unwrap();
            assert_eq!(info.source, Source::Qp, "{k}");
            times.push([prepared.time, info.time]);
            cost += self.stage_cost(&x, &u);
            self.plant(&mut x, &u);
            for (x, amp) in x.iter_mut().zip(&self.amp) {
                s = s.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                *x += amp * (2.0 * ((s >> 11) as f64 * 2f64.powi(-53)) - 1.0);
            }
            if let Some((_, kick)) = self.kicks.iter().find(|e| e.0 == k) {
                x.iter_mut().zip(kick).for_each(|(x, d)| *x += d);
            }
        }
        Loop { cost, controller: c, times }
    }
}

pub fn scheme(scheme: Scheme, level: Level, inner: usize) -> Options {
    Options { scheme, level, inner, family: Some(Family::Explicit), ..Options::default() }
}
