//! Models of the gallery twice: by hand with exact derivatives, and as expressions.
#![allow(dead_code)]

use switchback::expr::{Expr, Graph};
use switchback::func::Dims;
use switchback::model::{Built, Model};
use switchback::system::{Regions, SharedFunction, Subsystem, System};

use super::models::{add_sides, affine, smooth};

fn built(name: &str, g: &Graph, nu: usize, rhs: &[Expr]) -> Built {
    Model::from_rhs(name, nu, 0, rhs).and_then(|m| m.build(g)).unwrap()
}

fn signs(s: &mut System, rows: &[usize], n_modes: usize, modes: SharedFunction, psi: SharedFunction, signs: &[i8]) {
    let regions = Regions::Signs { psi, signs: signs.to_vec() };
    s.add_subsystem(Subsystem { rows: rows.to_vec(), modes, n_modes, regions }).unwrap();
}

/// Above a speed of 10 the acceleration is three times the control.
pub fn turbo_car() -> (System, Built) {
    let d = Dims { x: 2, u: 1, p: 0 };
    let mut s = System::new(2, 1, 0).unwrap();
    s.set_f0(affine("f0", d, &[0.0; 2], &[(0, 1, 1.0)])).unwrap();
    let modes = affine("F", d, &[0.0; 2], &[(0, 2, 3.0), (1, 2, 1.0)]);
    add_sides(&mut s, &[1], modes, affine("psi", d, &[-10.0], &[(0, 1, 1.0)]));
    let g = Graph::new();
    let (v, a) = (g.x(1), g.u(0));
    (s, built("turbo car", &g, 1, &[v, v.gt(10.0).select(3.0 * a, a)]))
}

/// Two genes, each expressed in a band of both concentrations.
pub fn two_genes() -> (System, Built) {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).unwrap();
    s.set_f0(affine("f0", d, &[0.0; 2], &[(0, 0, -4.5), (1, 1, -1.5)])).unwrap();
    let pattern = [1, 1, 0, -1, -1, 1];
    let on_off = || affine("F", d, &[40.0, 0.0, 0.0], &[]);
    signs(&mut s, &[0], 3, on_off(), affine("psi", d, &[-4.0, 8.0], &[(0, 0, 1.0), (1, 1, -1.0)]), &pattern);
    signs(&mut s, &[1], 3, on_off(), affine("psi", d, &[8.0, -4.0], &[(0, 0, -1.0), (1, 1, 1.0)]), &pattern);
    let g = Graph::new();
    let (a, b) = (g.x(0), g.x(1));
    let first = (a.gt(4.0) & b.lt(8.0)).select(40.0, 0.0);
    let second = (a.lt(8.0) & b.gt(4.0)).select(40.0, 0.0);
    (s, built("two genes", &g, 0, &[first - 4.5 * a, second - 1.5 * b]))
}

/// Three lags in a loop with a relay.
pub fn relay_feedback() -> (System, Built) {
    let d = Dims { x: 3, u: 0, p: 0 };
    let mut s = System::new(3, 0, 0).unwrap();
    let lags = [(0, 0, -1.0), (1, 0, 1.0), (1, 1, -1.0), (2, 1, 1.0), (2, 2, -1.0)];
    s.set_f0(affine("f0", d, &[0.0; 3], &lags)).unwrap();
    add_sides(&mut s, &[0], affine("F", d, &[-1.0, 1.0], &[]), affine("psi", d, &[0.0], &[(0, 2, 1.0)]));
    let g = Graph::new();
    let (x, y, z) = (g.x(0), g.x(1), g.x(2));
    (s, built("relay", &g, 0, &[z.relay(-1.0, 1.0) - x, x - y, y - z]))
}

/// Three tanks in a row that spill over above level 1.
pub fn tank_cascade() -> (System, Built) {
    let d = Dims { x: 3, u: 1, p: 0 };
    let mut s = System::new(3, 1, 0).unwrap();
    let f0 = smooth(
        "f0",
        d,
        3,
        |at, o| {
            let out = [0, 1, 2].map(|k| 0.6 * at.x[k].sqrt());
            o.copy_from_slice(&[at.u[0] - out[0], out[0] - out[1], out[1] - out[2]]);
        },
        &[(0, 0), (1, 0), (1, 1), (2, 1), (2, 2), (0, 3)],
        |at, o| {
            let slope = [0, 1, 2].map(|k| 0.3 / at.x[k].sqrt());
            o.copy_from_slice(&[-slope[0], slope[0], -slope[1], slope[1], -slope[2], 1.0]);
        },
        &[(0, 0), (1, 1), (2, 2)],
        |at, w, o| {
            let bend = [0, 1, 2].map(|k| -0.15 / at.x[k].powf(1.5));
            o.copy_from_slice(&[(w[1] - w[0]) * bend[0], (w[2] - w[1]) * bend[1], -w[2] * bend[2]]);
        },
    );
    s.set_f0(f0).unwrap();
    for k in 0..3 {
        let rows: Vec<usize> = (k..3.min(k + 2)).collect();
        let n = rows.len();
        // the modes: spilling first
        let (mut constant, mut slope) = (vec![0.0; 2 * n], vec![(0, k, -2.0)]);
        constant[0] = 2.0;
        if n == 2 {
            constant[1] = -2.0;
            slope.push((1, k, 2.0));
        }
        add_sides(&mut s, &rows, affine("F", d, &constant, &slope), affine("psi", d, &[-1.0], &[(0, k, 1.0)]));
    }
    let g = Graph::new();
    let out: Vec<Expr> = (0..3).map(|k| 0.6 * g.x(k).sqrt() + 2.0 * (g.x(k) - 1.0).max(0.0)).collect();
    (s, built("tanks", &g, 1, &[g.u(0) - out[0], out[0] - out[1], out[1] - out[2]]))
}

/// A motor under a saturated position controller, with dry friction.
pub fn motor() -> (System, Built) {
    let d = Dims { x: 3, u: 0, p: 0 };
    let mut s = System::new(3, 0, 0).unwrap();
    let f0 = [(0, 1, 1.0), (1, 1, -0.1), (2, 1, -2.0), (1, 2, 5.0), (2, 2, -10.0)];
    s.set_f0(affine("f0", d, &[0.0; 3], &f0)).unwrap();
    // 12 (1 − angle) − 2 speed, above 6, in between, below −6
    let modes = affine("F", d, &[60.0, 120.0, -60.0], &[(1, 0, -120.0), (1, 1, -20.0)]);
    let psi = affine("psi", d, &[6.0, 18.0], &[(0, 0, -12.0), (1, 0, -12.0), (0, 1, -2.0), (1, 1, -2.0)]);
    signs(&mut s, &[2], 3, modes, psi, &[1, 1, -1, 1, -1, -1]);
    add_sides(&mut s, &[1], affine("F", d, &[-0.8, 0.8], &[]), affine("psi", d, &[0.0], &[(0, 1, 1.0)]));
    let g = Graph::new();
    let (angle, speed, current) = (g.x(0), g.x(1), g.x(2));
    let voltage = (12.0 * (1.0 - angle) - 2.0 * speed).clip(-6.0, 6.0);
    let rhs = [speed, 5.0 * current - 0.1 * speed - 0.8 * speed.sign(), 10.0 * (voltage - current) - 2.0 * speed];
    (s, built("motor", &g, 0, &rhs))
}
