//! The models of `models.rs` written with operators.
#![allow(dead_code)]

use std::f64::consts::PI;
use switchback::expr::{Expr, Graph};
use switchback::model::{Built, Model};

/// A model without parameters.
fn built(name: &str, g: &Graph, nu: usize, rhs: &[Expr]) -> Built {
    Model::from_rhs(name, nu, 0, rhs).and_then(|m| m.build(g)).expect("the model is well formed")
}

/// `models::oscillator`.
pub fn oscillator() -> Built {
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let outside = (x * x + y * y).gt(1.0);
    let turn = outside.select(g.constant(-2.0 * PI), g.constant(2.0 * PI));
    built("oscillator", &g, 0, &[x + turn * y, y - turn * x])
}

/// `models::switching`.
pub fn switching(case: char) -> Built {
    let g = Graph::new();
    let (x, t) = (g.x(0), g.t());
    let rhs = match case {
        'a' => 2.0 - x.sign(),
        'b' => 0.2 * (5.0 * t).sin() - x.sign(),
        'c' => t - x.sign(),
        _ => x.sign(),
    };
    built("switching", &g, 0, &[rhs])
}

/// `models::sliding_mode`.
pub fn sliding_mode() -> Built {
    let g = Graph::new();
    let (q1, q2, v1, v2) = (g.x(0), g.x(1), g.x(2), g.x(3));
    let c1 = q1 + 0.15 * q2.powi(2);
    let c2 = q2 - 0.05 * q1.powi(3);
    built("sliding mode", &g, 2, &[v1 - c1.sign(), v2 - c2.sign(), g.u(0), g.u(1)])
}

/// `models::blocks`.
pub fn blocks() -> Built {
    let g = Graph::new();
    let q: Vec<Expr> = (0..3).map(|i| g.x(i)).collect();
    let v: Vec<Expr> = (3..6).map(|i| g.x(i)).collect();
    let springs = [q[1] - 2.0 * q[0], q[0] - 2.0 * q[1] + q[2], q[1] - q[2]];
    let mut rhs = v.clone();
    rhs.extend(v.iter().zip(springs).map(|(&v, s)| s - v - 0.3 * v.sign()));
    built("blocks", &g, 0, &rhs)
}

/// `models::coulomb`.
pub fn coulomb() -> Built {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    built("coulomb", &g, 0, &[v, -x + (0.5 * g.t()).cos() - 0.4 * v.sign()])
}

/// `models::zeno`.
pub fn zeno() -> Built {
    let g = Graph::new();
    let (a, b) = (g.x(0).sign(), g.x(1).sign());
    built("zeno", &g, 0, &[2.0 * b - a, -2.0 * a - b])
}

/// `models::stick_slip`.
pub fn stick_slip() -> Built {
    let g = Graph::new();
    let (x, v) = (g.x(0), g.x(1));
    let friction = v.gt(0.2).select(-1.0 / (0.8 + v), 1.0 / (1.2 - v));
    built("stick-slip", &g, 0, &[v, friction - x])
}

/// Two links with dry friction in both joints, under gravity: `M(q) q'' + c(q, q') + g(q) + 0.2 sign q' = 0`.
pub fn arm() -> Built {
    let g = Graph::new();
    let [q1, q2, w1, w2] = [g.x(0), g.x(1), g.x(2), g.x(3)];
    let (b, d) = (0.5 * q2.cos(), g.constant(0.4));
    let mass = [1.2 + 2.0 * b, d + b, d + b, d];
    let swirl = 0.5 * q2.sin();
    let weight = [6.0 * q1.sin() + 2.0 * (q1 + q2).sin(), 2.0 * (q1 + q2).sin()];
    let force = [
        swirl * (2.0 * w1 * w2 + w2 * w2) - weight[0] - 0.2 * w1.sign(),
        -swirl * w1 * w1 - weight[1] - 0.2 * w2.sign(),
    ];
    let acceleration = g.solve(&mass, &force).expect("two rows");
    built("arm", &g, 0, &[w1, w2, acceleration[0], acceleration[1]])
}

/// Cost rate of `models::sliding_ocp`.
pub fn sliding_cost() -> switchback::system::SharedFunction {
    let g = Graph::new();
    let cost = g.u(0).powi(2) + g.u(1).powi(2) + g.x(2).powi(2) + g.x(3).powi(2);
    let dims = switchback::func::Dims { x: 4, u: 2, p: 0 };
    std::sync::Arc::new(g.function("L", dims, &[cost]).expect("the cost is well formed"))
}
