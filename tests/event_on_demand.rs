//! Modes that are formed on demand: models whose sign patterns are too many to be listed.

use switchback::event::{simulate, Options, Outcome, Run};
use switchback::expr::{Expr, Graph};
use switchback::model::Model;
use switchback::system::System;

fn system(g: &Graph, rhs: &[Expr]) -> System {
    let built = Model::from_rhs("m", 0, 0, rhs).unwrap().build(g).unwrap();
    assert!(built.system.on_demand().is_some(), "{}", built.report);
    assert!(built.report.to_string().contains("formed on demand"), "{}", built.report);
    built.system
}

fn options(tol: f64) -> Options {
    Options { rtol: vec![tol], atol: vec![1e-2 * tol], ..Options::default() }
}

fn run(s: &System, x0: &[f64], t: f64, tol: f64) -> Run {
    let run = simulate(s, &options(tol), 0.0, x0, t).unwrap();
    assert_eq!(run.outcome, Outcome::Reached, "{}", run.reason);
    run
}

/// Numbers without a pattern, the same every time.
fn weight(k: usize, i: usize, j: usize) -> f64 {
    (12.9898 * (i + 1) as f64 + 78.233 * (j + 1) as f64 + 37.719 * k as f64).sin()
}

/// A constant and a sum of products with weights.
type Affine<'a, T> = dyn Fn(f64, &[(f64, T)]) -> T + 'a;

/// Two hidden layers of `h` rectifiers over `n` inputs, weights of the output `k`; `max` is the rectifier.
fn network<T: Clone>((h, n): (usize, usize), x: &[T], affine: &Affine<T>, max: &dyn Fn(T) -> T) -> Vec<T> {
    let layer = |k: usize, from: &[T], scale: f64| -> Vec<T> {
        let row = |i| from.iter().enumerate().map(|(j, v)| (scale * weight(k, i, j), v.clone())).collect::<Vec<_>>();
        (0..h).map(|i| max(affine(0.3 * weight(k + 10, i, 99), &row(i)))).collect()
    };
    let a = layer(2, x, 2.0);
    let b = layer(4, &a, 2.0 / (h as f64).sqrt());
    let row =
        |i| b.iter().enumerate().map(|(j, v)| (weight(5, i, j) / (h as f64).sqrt(), v.clone())).collect::<Vec<_>>();
    (0..n).map(|i| affine(0.0, &row(i))).collect()
}

fn network_of_numbers(size: (usize, usize), x: &[f64]) -> Vec<f64> {
    network(size, x, &|c, t| t.iter().fold(c, |s, (w, v)| s + w * v), &|v| v.max(0.0))
}

fn network_of_expressions<'g>(g: &'g Graph, size: (usize, usize), x: &[Expr<'g>]) -> Vec<Expr<'g>> {
    let affine = |c: f64, t: &[(f64, Expr<'g>)]| t.iter().fold(g.constant(c), |s, (w, v)| s + *v * *w);
    network(size, x, &affine, &|v| v.max(g.constant(0.0)))
}

/// Classical Runge-Kutta steps, small enough that the kinks of the right-hand side do not show.
fn small_steps(f: &dyn Fn(f64, &[f64]) -> Vec<f64>, x0: &[f64], t: f64, n: usize) -> Vec<f64> {
    let h = t / n as f64;
    let mut x = x0.to_vec();
    let add = |x: &[f64], k: &[f64], h: f64| x.iter().zip(k).map(|(x, k)| x + h * k).collect::<Vec<f64>>();
    for i in 0..n {
        let t = i as f64 * h;
        let k1 = f(t, &x);
        let k2 = f(t + 0.5 * h, &add(&x, &k1, 0.5 * h));
        let k3 = f(t + 0.5 * h, &add(&x, &k2, 0.5 * h));
        let k4 = f(t + h, &add(&x, &k3, h));
        for (j, x) in x.iter_mut().enumerate() {
            *x += h / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j]);
        }
    }
    x
}

/// 2^32 and 2^128 sign patterns, against small steps of a program that knows nothing of patterns.
#[test]
fn networks_of_rectifiers() {
    for (h, t, n) in [(16, 2.0, 20_000), (64, 1.0, 5_000)] {
        let g = Graph::new();
        let x: Vec<Expr> = (0..3).map(|i| g.x(i)).collect();
        let out = network_of_expressions(&g, (h, 3), &x);
        let rhs: Vec<Expr> = (0..3).map(|i| out[i] * 2.0 - x[i] + (g.t() * 3.0 + i as f64).sin()).collect();
        let s = system(&g, &rhs);
        let f = |t: f64, x: &[f64]| -> Vec<f64> {
            let out = network_of_numbers((h, 3), x);
            (0..3).map(|i| 2.0 * out[i] - x[i] + (3.0 * t + i as f64).sin()).collect()
        };
        let x0 = [0.5, -0.4, 0.3];
        let exact = small_steps(&f, &x0, t, n);
        for (tol, allowed) in [(1e-5, 1e-4), (1e-9, 1e-7)] {
            let run = run(&s, &x0, t, tol);
            assert!(run.switches.len() > 3, "{h}: {} switches", run.switches.len());
            let error = run.x.iter().zip(&exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(error <= allowed, "{h} rectifiers at {tol}: {error:e}");
        }
    }
}

/// A relay holds the state on the graph of a network: the sliding mode goes on over all kinks of its surface, `x_1 = N(x_0)` with
/// `x_0 = t`.
#[test]
fn sliding_along_a_surface_with_kinks() {
    let h = 16;
    let g = Graph::new();
    let (x, y) = (g.x(0), g.x(1));
    let n = network_of_expressions(&g, (h, 1), &[x])[0];
    let s = system(&g, &[g.constant(1.0), (y - n).sign() * -6.0]);
    let run = run(&s, &[-1.0, 0.4], 2.0, 1e-8);
    let exact = network_of_numbers((h, 1), &[1.0])[0];
    assert!((run.x[1] - exact).abs() < 1e-7, "{:?} instead of {exact}", run.x);
    let slides = run.switches.iter().filter(|s| s.after.len() == 2).count();
    assert!(slides > 3, "{slides} sliding modes in {:?}", run.switches.len());
}

/// `ẋ = 1 + sign(g(x)) / 2` with moduli inside of moduli, 21 deep: the time to a place is the sum of the pieces between the zeros of `g`.
#[test]
fn moduli_inside_of_moduli() {
    let depth = 20;
    let fold = |x: f64| (0..depth).fold(x, |a, k| (a - 1.7 / f64::from(k + 1)).abs()) - 0.04;
    let g = Graph::new();
    let x = g.x(0);
    let nested = (0..depth).fold(x, |a, k| (a - 1.7 / f64::from(k + 1)).abs()) - 0.04;
    let s = system(&g, &[nested.sign() * 0.5 + 1.0]);
    let (from, t) = (-3.0, 5.0);
    // by bisection of every change of sign on a fine grid
    let (n, to) = (400_000, from + 1.5 * t);
    let grid = |i: usize| from + (to - from) * i as f64 / n as f64;
    let (mut left, mut at, mut switches) = (t, from, 0);
    for i in 0..n {
        let (mut a, mut b) = (grid(i), grid(i + 1));
        if (fold(a) > 0.0) == (fold(b) > 0.0) {
            continue;
        }
        let before = fold(a) > 0.0;
        for _ in 0..60 {
            let middle = 0.5 * (a + b);
            if (fold(middle) > 0.0) == before {
                a = middle;
            } else {
                b = middle;
            }
        }
        let speed = if before { 1.5 } else { 0.5 };
        if (a - at) / speed > left {
            break;
        }
        (left, at, switches) = (left - (a - at) / speed, a, switches + 1);
    }
    let end = at + left * if fold(at + 1e-7) > 0.0 { 1.5 } else { 0.5 };
    assert!(switches > 4, "{switches}");
    let run = run(&s, &[from], t, 1e-9);
    assert!((run.x[0] - end).abs() < 1e-8, "{} instead of {end}", run.x[0]);
}

/// Two relays whose surfaces meet, behind so many others that modes are formed on demand: a sliding mode of codimension two.
#[test]
fn two_surfaces_are_held() {
    let g = Graph::new();
    let x: Vec<Expr> = (0..16).map(|i| g.x(i)).collect();
    // far away from zero, 14 signs whose product multiplies the relays
    let product = x[2..].iter().fold(g.constant(1.0), |p, x| p * x.sign());
    let mut rhs =
        vec![product * (-x[0].sign() - x[1].sign() * 0.25) + 0.1, product * (x[0].sign() * 0.25 - x[1].sign())];
    rhs.extend((2..16).map(|i| (x[i] - 1.0) * -0.5));
    let s = system(&g, &rhs);
    let mut x0 = vec![1.0; 16];
    (x0[0], x0[1]) = (0.3, -0.2);
    let run = run(&s, &x0, 3.0, 1e-8);
    assert!(run.x[0].abs() < 1e-12 && run.x[1].abs() < 1e-12, "{:?}", &run.x[..2]);
}

/// Networks without biases: all functions of the first layer vanish at the equilibrium, where the motion ends, and at a start there.
#[test]
fn all_surfaces_through_the_origin() {
    let g = Graph::new();
    let x: Vec<Expr> = (0..2).map(|i| g.x(i)).collect();
    let zero = g.constant(0.0);
    let layer = |k: usize, from: &[Expr<'_>]| -> Vec<f64> { (0..from.len()).map(|j| weight(k, j, 7)).collect() };
    let first: Vec<Expr> = (0..14).map(|i| (x[0] * weight(1, i, 0) + x[1] * weight(1, i, 1)).max(zero)).collect();
    let second: Vec<Expr> = (0..14)
        .map(|i| first.iter().zip(layer(20 + i, &first)).fold(zero, |s, (a, w)| s + *a * (0.3 * w)).max(zero))
        .collect();
    let sum = |k: usize| second.iter().zip(layer(k, &second)).fold(zero, |s, (a, w)| s + *a * (0.1 * w));
    let s = system(&g, &[x[1] * 2.0 - x[0] + sum(50), x[0] * -2.0 - x[1] + sum(51)]);
    let rest = run(&s, &[0.0, 0.0], 1.0, 1e-8);
    assert_eq!(rest.x, [0.0, 0.0]);
    let moves = run(&s, &[1.0, 0.5], 6.0, 1e-8);
    assert!(moves.x.iter().all(|v| v.abs() < 1.0) && moves.switches.len() > 10, "{:?}", moves.x);
}

/// A hundred relays on one sum of rectifiers: every relay has few branches, all of them together have too many.
#[test]
fn branches_are_counted_together() {
    let g = Graph::new();
    let x: Vec<Expr> = (0..2).map(|i| g.x(i)).collect();
    let zero = g.constant(0.0);
    let rectified = |i: usize| (x[0] * weight(1, i, 0) + x[1] * weight(1, i, 1) + 0.1 * i as f64).max(zero);
    let sum = (0..8).fold(zero, |s, i| s + rectified(i) * weight(2, i, 0));
    let stairs = (0..100).fold(zero, |s, k| s + (sum - 0.02 * k as f64).sign());
    let s = system(&g, &[x[1], stairs * -0.01 - x[1]]);
    run(&s, &[1.0, 0.0], 1.0, 1e-8);
}

/// What cannot do without all modes refuses, and says what to do.
#[test]
fn refusals_say_what_to_do() {
    let g = Graph::new();
    let x: Vec<Expr> = (0..3).map(|i| g.x(i)).collect();
    let s = system(&g, &network_of_expressions(&g, (16, 3), &x));
    let e = switchback::dcs::Dcs::stewart(&s).map(|_| ()).unwrap_err().to_string();
    assert!(e.contains("32 coupled switching functions") && e.contains("terms that switch separately"), "{e}");
    let o = Options { sensitivity: true.into(), ..options(1e-6) };
    let e = simulate(&s, &o, 0.0, &[0.0; 3], 1.0).map(|_| ()).unwrap_err().to_string();
    assert!(e.contains("derivatives"), "{e}");
}
