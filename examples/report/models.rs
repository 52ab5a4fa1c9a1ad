//! The models of the report and the tests, with exact derivatives on declared patterns.
#![allow(dead_code)]

use std::sync::Arc;
use switchback::func::{Callback, Dims, Point};
use switchback::linalg::csc::Pattern;
use switchback::ocp::Ocp;
use switchback::settings::Settings;
use switchback::system::{Regions, SharedFunction, Subsystem, System};

pub const PI: f64 = std::f64::consts::PI;
pub const INF: f64 = f64::INFINITY;

/// Pattern with these entries `(row, column)`.
pub fn pattern(m: usize, n: usize, entries: &[(usize, usize)]) -> Pattern {
    let rows: Vec<usize> = entries.iter().map(|e| e.0).collect();
    let cols: Vec<usize> = entries.iter().map(|e| e.1).collect();
    Pattern::from_triplets(m, n, &rows, &cols).0
}

fn input(at: &Point, col: usize) -> f64 {
    at.x.iter().chain(at.u).chain(at.p).copied().nth(col).unwrap_or(at.t)
}

/// `constant + A z`, `z = (x, u, p, t)`, with entries `(row, column, value)` sorted by columns.
pub fn affine(name: &str, d: Dims, constant: &[f64], entries: &[(usize, usize, f64)]) -> SharedFunction {
    let positions: Vec<(usize, usize)> = entries.iter().map(|e| (e.0, e.1)).collect();
    let values: Vec<f64> = entries.iter().map(|e| e.2).collect();
    let (constant, entries) = (constant.to_vec(), entries.to_vec());
    let n_out = constant.len();
    let f = Callback::new(name, d, n_out, move |at, o| {
        o.copy_from_slice(&constant);
        for &(r, c, v) in &entries {
            o[r] += v * input(at, c);
        }
        0
    });
    let f = f.with_jacobian(pattern(n_out, d.n_in(), &positions), move |_, o| {
        o.copy_from_slice(&values);
        0
    });
    Arc::new(f.expect("the pattern fits").linear())
}

/// A function with Jacobian and Hessian; entries sorted by columns, the Hessian's of the upper triangle.
#[allow(clippy::too_many_arguments)]
pub fn smooth(
    name: &str,
    d: Dims,
    n_out: usize,
    value: impl Fn(&Point, &mut [f64]) + Send + Sync + 'static,
    jac_entries: &[(usize, usize)],
    jac: impl Fn(&Point, &mut [f64]) + Send + Sync + 'static,
    hess_entries: &[(usize, usize)],
    hess: impl Fn(&Point, &[f64], &mut [f64]) + Send + Sync + 'static,
) -> SharedFunction {
    let f = Callback::new(name, d, n_out, move |at, o| {
        value(at, o);
        0
    });
    let f = f.with_jacobian(pattern(n_out, d.n_in(), jac_entries), move |at, o| {
        jac(at, o);
        0
    });
    let f = f.and_then(|f| {
        f.with_hessian(pattern(d.n_in(), d.n_in(), hess_entries), move |at, w, o| {
            hess(at, w, o);
            0
        })
    });
    Arc::new(f.expect("the patterns fit"))
}

/// Adds `±` modes on the two sides of `ψ = 0`: the first is valid where `ψ > 0`.
pub fn add_sides(s: &mut System, rows: &[usize], modes: SharedFunction, psi: SharedFunction) {
    s.add_subsystem(Subsystem {
        rows: rows.to_vec(),
        modes,
        n_modes: 2,
        regions: Regions::Signs { psi, signs: vec![1, -1] },
    })
    .expect("the subsystem fits");
}

/// Oscillator (4.4) as printed: `A1` inside the unit disc, `A2` outside.
pub fn oscillator() -> System {
    let d = Dims { x: 2, u: 0, p: 0 };
    let w = 2.0 * PI;
    let mut s = System::new(2, 0, 0).expect("two states");
    // outside first: ψ = |x|² − 1 > 0
    let entries = [(0, 0, 1.0), (1, 0, w), (2, 0, 1.0), (3, 0, -w), (0, 1, -w), (1, 1, 1.0), (2, 1, w), (3, 1, 1.0)];
    let f = affine("F", d, &[0.0; 4], &entries);
    let psi = smooth(
        "psi",
        d,
        1,
        |at, o| o[0] = at.x[0] * at.x[0] + at.x[1] * at.x[1] - 1.0,
        &[(0, 0), (0, 1)],
        |at, o| {
            o[0] = 2.0 * at.x[0];
            o[1] = 2.0 * at.x[1];
        },
        &[(0, 0), (1, 1)],
        |_, w, o| o.fill(2.0 * w[0]),
    );
    add_sides(&mut s, &[0, 1], f, psi);
    s
}

pub const OSCILLATOR_X0: [f64; 2] = [0.367_879_441_171_442_33, 0.0];
/// `e^{T−1} (cos 2π(T−1), sin 2π(T−1))` at `T = π/2`.
pub const OSCILLATOR_XT: [f64; 2] = [-1.5974603774506984, -0.7614936206060108];

/// The four cases of Example 6.8, `a` to `d`.
pub fn switching(case: char) -> System {
    let d = Dims { x: 1, u: 0, p: 0 };
    let mut s = System::new(1, 0, 0).expect("one state");
    let (plus, minus) = match case {
        'a' => (1.0, 3.0),
        'd' => (1.0, -1.0),
        _ => (-1.0, 1.0),
    };
    match case {
        'b' => {
            let f0 = smooth(
                "f0",
                d,
                1,
                |at, o| o[0] = 0.2 * (5.0 * at.t).sin(),
                &[(0, 1)],
                |at, o| o[0] = (5.0 * at.t).cos(),
                &[(1, 1)],
                |at, w, o| o[0] = -5.0 * w[0] * (5.0 * at.t).sin(),
            );
            s.set_f0(f0).expect("f0 fits");
        }
        'c' => s.set_f0(affine("f0", d, &[0.0], &[(0, 1, 1.0)])).expect("f0 fits"),
        _ => {}
    }
    let psi = affine("psi", d, &[0.0], &[(0, 0, 1.0)]);
    add_sides(&mut s, &[0], affine("F", d, &[plus, minus], &[]), psi);
    s
}

/// (7.51): `q' = −sign c(q) + v`, `v' = u`; `x = (q1, q2, v1, v2)`.
pub fn sliding_mode() -> System {
    let d = Dims { x: 4, u: 2, p: 0 };
    let mut s = System::new(4, 2, 0).expect("four states");
    let f0 = affine("f0", d, &[0.0; 4], &[(0, 2, 1.0), (1, 3, 1.0), (2, 4, 1.0), (3, 5, 1.0)]);
    s.set_f0(f0).expect("f0 fits");
    let c1 = smooth(
        "c1",
        d,
        1,
        |at, o| o[0] = at.x[0] + 0.15 * at.x[1] * at.x[1],
        &[(0, 0), (0, 1)],
        |at, o| {
            o[0] = 1.0;
            o[1] = 0.3 * at.x[1];
        },
        &[(1, 1)],
        |_, w, o| o[0] = 0.3 * w[0],
    );
    let c2 = smooth(
        "c2",
        d,
        1,
        |at, o| o[0] = at.x[1] - 0.05 * at.x[0] * at.x[0] * at.x[0],
        &[(0, 0), (0, 1)],
        |at, o| {
            o[0] = -0.15 * at.x[0] * at.x[0];
            o[1] = 1.0;
        },
        &[(0, 0)],
        |at, w, o| o[0] = -0.3 * at.x[0] * w[0],
    );
    add_sides(&mut s, &[0], affine("F", d, &[-1.0, 1.0], &[]), c1);
    add_sides(&mut s, &[1], affine("F", d, &[-1.0, 1.0], &[]), c2);
    s
}

/// Three blocks on a chain with dry friction 0.3; `x = (q1, q2, q3, v1, v2, v3)`.
pub fn blocks() -> System {
    let d = Dims { x: 6, u: 0, p: 0 };
    let mut s = System::new(6, 0, 0).expect("six states");
    let f0 = affine(
        "f0",
        d,
        &[0.0; 6],
        &[
            (3, 0, -2.0),
            (4, 0, 1.0),
            (3, 1, 1.0),
            (4, 1, -2.0),
            (5, 1, 1.0),
            (4, 2, 1.0),
            (5, 2, -1.0),
            (0, 3, 1.0),
            (3, 3, -1.0),
            (1, 4, 1.0),
            (4, 4, -1.0),
            (2, 5, 1.0),
            (5, 5, -1.0),
        ],
    );
    s.set_f0(f0).expect("f0 fits");
    for k in 3..6 {
        let psi = affine("psi", d, &[0.0], &[(0, k, 1.0)]);
        add_sides(&mut s, &[k], affine("F", d, &[-0.3, 0.3], &[]), psi);
    }
    s
}

/// `x'' + x + 0.4 sign x' = cos(t/2)`; `x = (x, v)`.
pub fn coulomb() -> System {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).expect("two states");
    let f0 = smooth(
        "f0",
        d,
        2,
        |at, o| {
            o[0] = at.x[1];
            o[1] = -at.x[0] + (0.5 * at.t).cos();
        },
        &[(1, 0), (0, 1), (1, 2)],
        |at, o| {
            o[0] = -1.0;
            o[1] = 1.0;
            o[2] = -0.5 * (0.5 * at.t).sin();
        },
        &[(2, 2)],
        |at, w, o| o[0] = -0.25 * w[1] * (0.5 * at.t).cos(),
    );
    s.set_f0(f0).expect("f0 fits");
    let psi = affine("psi", d, &[0.0], &[(0, 1, 1.0)]);
    add_sides(&mut s, &[1], affine("F", d, &[-0.4, 0.4], &[]), psi);
    s
}

/// (4.1): switches accumulate at the origin, which is reached from `(1, 1)` at `t = 1`.
pub fn zeno() -> System {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).expect("two states");
    for (k, f) in [[-1.0, -2.0, 1.0, 2.0], [2.0, -1.0, -2.0, 1.0]].iter().enumerate() {
        let psi = affine("psi", d, &[0.0], &[(0, k, 1.0)]);
        add_sides(&mut s, &[0, 1], affine("F", d, f, &[]), psi);
    }
    s
}

/// Oscillator on a belt of speed 0.2 with friction that falls with the speed of sliding; `x = (x, v)`. The mode
/// of `v > 0.2` has a pole at `v = −0.8`, where it is not active.
pub fn stick_slip() -> System {
    let d = Dims { x: 2, u: 0, p: 0 };
    let mut s = System::new(2, 0, 0).expect("two states");
    s.set_f0(affine("f0", d, &[0.0; 2], &[(1, 0, -1.0), (0, 1, 1.0)])).expect("f0 fits");
    let f = smooth(
        "F",
        d,
        2,
        |at, o| {
            o[0] = -1.0 / (0.8 + at.x[1]);
            o[1] = 1.0 / (1.2 - at.x[1]);
        },
        &[(0, 1), (1, 1)],
        |at, o| {
            o[0] = (0.8 + at.x[1]).powi(-2);
            o[1] = (1.2 - at.x[1]).powi(-2);
        },
        &[(1, 1)],
        |at, w, o| o[0] = -2.0 * w[0] * (0.8 + at.x[1]).powi(-3) + 2.0 * w[1] * (1.2 - at.x[1]).powi(-3),
    );
    add_sides(&mut s, &[1], f, affine("psi", d, &[-0.2], &[(0, 1, 1.0)]));
    s
}

/// Cost rate and terminal cost of (7.35).
pub fn tutorial_costs() -> [SharedFunction; 2] {
    [("L", 0.0), ("M", 5.0 / 3.0)].map(|(name, shift)| {
        smooth(
            name,
            Dims { x: 1, u: 0, p: 0 },
            1,
            move |at, o| o[0] = (at.x[0] - shift) * (at.x[0] - shift),
            &[(0, 0)],
            move |at, o| o[0] = 2.0 * (at.x[0] - shift),
            &[(0, 0)],
            |_, w, o| o[0] = 2.0 * w[0],
        )
    })
}

/// (7.35): `min ∫ x² dt + (x(2) − 5/3)²` over `x0`, `x' ∈ 2 − sign x`.
pub fn tutorial_ocp(settings: &Settings) -> Ocp {
    let mut o = Ocp::new(&switching('a'), 2.0, 1, settings).expect("the settings fit");
    let [l, m] = tutorial_costs();
    o.set_lagrange(l).expect("L fits");
    o.set_mayer(m).expect("M fits");
    o.set_x0_bounds(&[-INF], &[INF]).expect("one state");
    o
}

/// `(9 − √417)/8`.
pub const TUTORIAL_X0: f64 = -1.427572232082767;
pub const TUTORIAL_COST: f64 = 1.5237727753749573;

pub const SLIDING_X0: [f64; 4] = [2.0 * PI / 3.0, PI / 3.0, 0.0, 0.0];
pub const SLIDING_QT: [f64; 2] = [-PI / 6.0, -PI / 4.0];

/// (7.51) with the misprint of `c` put right.
pub fn sliding_ocp(settings: &Settings) -> Ocp {
    let sys = sliding_mode();
    let d = sys.dims();
    let mut o = Ocp::new(&sys, 4.0, 6, settings).expect("the settings fit");
    let l = smooth(
        "L",
        d,
        1,
        |at, o| o[0] = at.u[0] * at.u[0] + at.u[1] * at.u[1] + at.x[2] * at.x[2] + at.x[3] * at.x[3],
        &[(0, 2), (0, 3), (0, 4), (0, 5)],
        |at, o| {
            o[0] = 2.0 * at.x[2];
            o[1] = 2.0 * at.x[3];
            o[2] = 2.0 * at.u[0];
            o[3] = 2.0 * at.u[1];
        },
        &[(2, 2), (3, 3), (4, 4), (5, 5)],
        |_, w, o| o.fill(2.0 * w[0]),
    );
    o.set_lagrange(l).expect("L fits");
    o.set_x0(&SLIDING_X0).expect("four states");
    o.set_x_bounds(&[-INF, -INF, -2.0, -2.0], &[INF, INF, 2.0, 2.0]).expect("four states");
    o.set_u_bounds(&[-10.0, -10.0], &[10.0, 10.0]).expect("two controls");
    let e = affine("e", d, &[0.0; 2], &[(0, 0, 1.0), (1, 1, 1.0)]);
    o.add_terminal(e, &SLIDING_QT, &SLIDING_QT).expect("e fits");
    o
}
