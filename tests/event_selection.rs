//! Sliding modes on intersections of surfaces whose effects multiply: the velocities that the rules select, against closed forms and
//! regularisations.

use switchback::event::{simulate, Engine, Method, Options, Outcome, Run, Selection, Term};
use switchback::expr::{Expr, Graph};
use switchback::model::{Built, Model};

const RULES: [Selection; 3] = [Selection::Bilinear, Selection::Moments, Selection::Norm];

fn build<'g>(g: &'g Graph, np: usize, rhs: &[Expr<'g>]) -> Built {
    Model::from_rhs("model", 0, np, rhs).unwrap().build(g).unwrap()
}

fn options(selection: Selection, rtol: f64) -> Options {
    Options { selection, ..Options::with_tolerance(rtol, 1e-2 * rtol) }
}

fn run(m: &Built, o: &Options, x0: &[f64], t: f64) -> Run {
    let r = simulate(&m.system, o, 0.0, x0, t).unwrap();
    assert_eq!(r.outcome, Outcome::Reached, "{}", r.reason);
    r
}

/// Rates of the two surfaces under the signs `s`, `r`: linear, with the constant part `b`.
const A: [[f64; 2]; 2] = [[-1.0, 0.1], [0.2, -1.0]];
const B: [f64; 2] = [0.3, -0.2];

/// `ẋ1 = A11 s + A12 r + B1`, `ẋ2` alike, `ẋ3 = 1 + 0.3 s r` with surfaces written in other units.
fn nodal(units: [f64; 2]) -> Built {
    let g = Graph::new();
    let (s, r) = ((g.x(0) * units[0]).sign(), (g.x(1) * units[1]).sign());
    let rate = |j: usize| s * A[j][0] + r * A[j][1] + B[j];
    build(&g, 0, &[rate(0), rate(1), s * r * 0.3 + 1.0])
}

/// Means of the two signs, and the mean of their product by every rule: weights are `(1 + a s̄ + b r̄ + a b m) / 4`.
fn means(rule: Selection) -> f64 {
    let det = A[0][0] * A[1][1] - A[0][1] * A[1][0];
    let s = (A[0][1] * B[1] - A[1][1] * B[0]) / det;
    let r = (A[1][0] * B[0] - A[0][0] * B[1]) / det;
    match rule {
        Selection::Bilinear => s * r,
        // the squares of the weights add up to (1 + s̄² + r̄² + m²) / 4
        Selection::Norm => 0.0,
        _ => {
            let corners = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
            let rate = |j: usize, (a, b): (f64, f64)| A[j][0] * a + A[j][1] * b + B[j];
            let all: Vec<f64> = (0..2).map(|j| corners.iter().map(|c| rate(j, *c).powi(2)).sum()).collect();
            let delta = |c: (f64, f64)| (0..2).map(|j| rate(j, c).powi(2) / all[j]).sum::<f64>().sqrt();
            // Σ a b δ (1 + a s̄ + b r̄ + a b m) = 0
            let known: f64 = corners.iter().map(|&c| c.0 * c.1 * delta(c) * (1.0 + c.0 * s + c.1 * r)).sum();
            -known / corners.iter().map(|c| delta(*c)).sum::<f64>()
        }
    }
}

#[test]
fn the_rules_select_what_their_definitions_say_in_all_units() {
    for units in [[1.0, 1.0], [1e7, 1e-5], [3.0, 1e9]] {
        let m = nodal(units);
        for rule in RULES {
            let r = run(&m, &options(rule, 1e-9), &[0.5, 0.7, 0.0], 3.0);
            let s = r.switches.last().unwrap();
            assert!(!s.unique && s.after.len() == 4, "{s:?}");
            // before it, one surface slides, or none
            let before = simulate(&m.system, &options(rule, 1e-9), 0.0, &[0.5, 0.7, 0.0], s.t).unwrap();
            let expected = before.x[2] + (3.0 - s.t) * (1.0 + 0.3 * means(rule));
            assert!((r.x[2] - expected).abs() < 1e-12, "{rule:?} {units:?}: {} {expected}", r.x[2]);
            // the ends of the continuum are noted behind what was selected
            let c = &r.branchings[0].continuations;
            let speeds: Vec<f64> = c.iter().map(|c| c.velocity[2]).collect();
            assert!(c.len() == 3 && (speeds[0] - speeds[1]) * (speeds[0] - speeds[2]) < 0.0, "{speeds:?}");
        }
        let r = run(&m, &options(Selection::Fewest, 1e-9), &[0.5, 0.7, 0.0], 3.0);
        assert_eq!(r.switches.last().unwrap().after.len(), 3);
    }
}

/// Curved surfaces, effects that depend on the state, parameters.
fn curved() -> Built {
    curved_in(1.0)
}

/// The same with a parameter in another unit.
fn curved_in(unit: f64) -> Built {
    let g = Graph::new();
    let [x1, x2, x3, x4] = [0, 1, 2, 3].map(|i| g.x(i));
    let (s, r) = ((x1 + x3 * x3 * 0.1).sign(), (x2 + x4.sin() * 0.2).sign());
    let rhs = [
        s * -2.0 + x4 * 0.3 + s * r * 0.2,
        r * -2.0 + x3.sin() * 0.4 + s * r * (g.p(0) * unit),
        s * r * 0.3 + s * x4 * 0.2 + 1.0,
        s * r * 0.5 - x3,
    ];
    build(&g, 1, &rhs)
}

const FROM: [f64; 4] = [0.3, 0.2, 0.0, 1.0];

#[test]
fn methods_keep_their_order_on_an_intersection() {
    for rule in RULES {
        let m = curved();
        let start = |o: &Options| {
            let mut e = Engine::new(&m.system, o).unwrap();
            e.reinit(0.0, &FROM).unwrap();
            e.set_params(&[0.3]).unwrap();
            e.advance(0.25).unwrap();
            assert_eq!(e.switches().last().unwrap().after.len(), 4);
            e.advance(2.25).unwrap();
            assert_eq!(e.outcome(), Outcome::Reached, "{}", e.reason());
            e.state().to_vec()
        };
        let exact = start(&options(rule, 1e-13));
        for (method, order) in [(Method::Dp5, 5.0), (Method::Dop853, 8.0)] {
            let lengths = if order > 6.0 { [1.0, 0.5] } else { [0.1, 0.05] };
            let errors = lengths.map(|h| {
                // tolerances that let every step pass
                let o = Options { method, h_max: h, h0: h, ..options(rule, 1e3) };
                let x = start(&o);
                x.iter().zip(&exact).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()))
            });
            let slope = (errors[0] / errors[1]).log2();
            assert!(slope > order - 0.8, "{rule:?} {method:?}: {errors:?}, slope {slope}");
        }
    }
}

/// The classical method of order 4 with steps a part of the width, on independent smoothings of the signs.
fn smoothed(rhs: &dyn Fn(&[f64], f64) -> Vec<f64>, x0: &[f64], t: f64, width: f64) -> Vec<f64> {
    let n = (t / (0.3 * width)).ceil();
    let h = t / n;
    let mut x = x0.to_vec();
    let ahead = |x: &[f64], k: &[f64], h: f64| -> Vec<f64> { x.iter().zip(k).map(|(x, k)| x + h * k).collect() };
    for _ in 0..n as usize {
        let k1 = rhs(&x, width);
        let k2 = rhs(&ahead(&x, &k1, 0.5 * h), width);
        let k3 = rhs(&ahead(&x, &k2, 0.5 * h), width);
        let k4 = rhs(&ahead(&x, &k3, h), width);
        for i in 0..x.len() {
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    x
}

/// Three and four surfaces with products of all signs, in every component.
#[test]
fn bilinear_velocities_are_those_of_independent_smoothings_where_more_surfaces_meet() {
    for n in [3, 4] {
        let g = Graph::new();
        let s: Vec<Expr> = (0..n).map(|i| g.x(i).sign()).collect();
        let all = s.iter().skip(1).fold(s[0], |p, s| p * *s);
        let mut rhs: Vec<Expr> =
            (0..n).map(|i| s[i] * -1.4 + s[(i + 1) % n] * 0.2 + all * 0.15 + 0.1 * i as f64).collect();
        rhs.push(all * 0.4 + s[0] * s[1] * 0.2 + 1.0);
        let m = build(&g, 0, &rhs);
        let mut x0: Vec<f64> = (0..n).map(|i| 0.4 - 0.1 * i as f64).collect();
        x0.push(0.0);
        let r = run(&m, &options(Selection::Bilinear, 1e-9), &x0, 1.5);
        let last = r.switches.last().unwrap();
        assert!(last.after.len() == 1 << n && !last.unique && r.stats.steps < 50, "{last:?}");
        let f = |x: &[f64], width: f64| -> Vec<f64> {
            let s: Vec<f64> = (0..n).map(|i| (x[i] / width).clamp(-1.0, 1.0)).collect();
            let all: f64 = s.iter().product();
            let mut f: Vec<f64> =
                (0..n).map(|i| -1.4 * s[i] + 0.2 * s[(i + 1) % n] + 0.15 * all + 0.1 * i as f64).collect();
            f.push(0.4 * all + 0.2 * s[0] * s[1] + 1.0);
            f
        };
        let [coarse, fine] = [2e-3, 1e-3].map(|width| smoothed(&f, &x0, 1.5, width)[n]);
        // the error of a smoothing is that of its width
        let limit = 2.0 * fine - coarse;
        assert!((r.x[n] - limit).abs() < 2e-5, "{n}: {} {fine} {coarse}", r.x[n]);
        let norm = run(&m, &options(Selection::Norm, 1e-9), &x0, 1.5);
        assert_eq!(norm.switches.last().unwrap().after.len(), 1 << n);
        // of three surfaces the moments method does not speak
        let r = simulate(&m.system, &options(Selection::Moments, 1e-9), 0.0, &x0, 1.5).unwrap();
        assert_eq!(r.outcome, Outcome::Ambiguous);
        assert!(r.reason.contains("3 surfaces meet"), "{}", r.reason);
    }
}

/// The second surface lets go where `0.4 t = 1`: `x2' = 0.4 t − r`. The velocity has no jump there.
#[test]
fn an_intersection_is_left_where_the_selected_weights_say_so() {
    let g = Graph::new();
    let (s, r) = (g.x(0).sign(), g.x(1).sign());
    let m = build(&g, 0, &[s * -1.0 + 0.3, g.t() * 0.4 - r, s * r * 0.3 + 1.0]);
    for rule in [Selection::Bilinear, Selection::Moments] {
        for rtol in [1e-4, 1e-7, 1e-10] {
            let run = run(&m, &options(rule, rtol), &[0.0, 0.0, 0.0], 4.0);
            let exit = run.switches.last().unwrap();
            assert!((exit.t - 2.5).abs() < 10.0 * rtol && exit.unique && exit.after.len() == 2, "{rule:?} {exit:?}");
            let x2 = 0.2 * 1.5 * 1.5;
            assert!((run.x[1] - x2).abs() < 10.0 * rtol && run.x[0].abs() < 1e-12, "{rule:?} {rtol} {:?}", run.x);
            if rule == Selection::Bilinear {
                // s̄ = 0.3, r̄ = 0.4 t until the exit, then 1
                let x3 = 4.0 + 0.09 * (0.2 * 2.5 * 2.5 + 1.5);
                assert!((run.x[2] - x3).abs() < 10.0 * rtol, "{rtol}: {} {x3}", run.x[2]);
            }
        }
    }
}

#[test]
fn derivatives_follow_the_rules() {
    let m = curved();
    for rule in RULES {
        let o = |sensitivity: bool| Options {
            sensitivity: sensitivity.into(),
            adjoint: sensitivity,
            ..options(rule, 1e-11)
        };
        let start = |sensitivity: bool, z: &[f64]| {
            let mut e = Engine::new(&m.system, &o(sensitivity)).unwrap();
            e.reinit(0.0, &z[..4]).unwrap();
            e.set_params(&z[4..]).unwrap();
            e.advance(2.0).unwrap();
            e
        };
        let z0 = [FROM[0], FROM[1], FROM[2], FROM[3], 0.3];
        let mut e = start(true, &z0);
        let s = e.sensitivity().unwrap().to_vec();
        for c in 0..5 {
            let h = 1e-5;
            let [up, down] = [h, -h].map(|h| {
                let mut z = z0;
                z[c] += h;
                start(false, &z).state().to_vec()
            });
            for i in 0..4 {
                let d = (up[i] - down[i]) / (2.0 * h);
                assert!((s[i * 5 + c] - d).abs() < 1e-6 * (1.0 + d.abs()), "{rule:?} {i} {c}: {} {d}", s[i * 5 + c]);
            }
        }
        let v = [1.0, -0.5, 0.7, 0.2];
        let index = e.switches().len() - 1;
        let dt = e.switches()[index].dt.clone();
        let g = e.adjoint(&v, &[Term::Switch { index, weight: 0.6 }]).unwrap();
        for (c, g) in g.x0.iter().chain(&g.p).enumerate() {
            let forward = (0..4).map(|i| v[i] * s[i * 5 + c]).sum::<f64>() + 0.6 * dt[c];
            // weights are differentiated by differences, whose rounding is about 1e-9 where a state passes zero
            assert!((g - forward).abs() < 1e-7 * (1.0 + forward.abs()), "{rule:?} {c}: {g} {forward}");
        }
    }
}

/// Weights under a rule are differentiated by differences, whose steps are relative to the size of a parameter, or, where it is
/// zero, to what it does: one in units of 1e-12 or 1e12 has the same derivatives. With steps of 6e-6 at least the first was
/// changed by millions of its values, the second by less than the rounding of what it does.
#[test]
fn derivatives_do_not_depend_on_the_unit_of_a_parameter() {
    for (rule, p) in RULES.into_iter().flat_map(|r| [(r, 0.3), (r, 0.0)]) {
        let by_parameter = |unit: f64| {
            let m = curved_in(unit);
            let o = Options { sensitivity: true.into(), ..options(rule, 1e-11) };
            let mut e = Engine::new(&m.system, &o).unwrap();
            e.reinit(0.0, &FROM).unwrap();
            e.set_params(&[p / unit]).unwrap();
            e.advance(2.0).unwrap();
            let s = e.sensitivity().unwrap();
            (0..4).map(|i| s[i * 5 + 4] / unit).collect::<Vec<f64>>()
        };
        let usual = by_parameter(1.0);
        for unit in [1e12, 1e-12] {
            for (d, usual) in by_parameter(unit).iter().zip(&usual) {
                assert!((d - usual).abs() < 1e-7 * (1.0 + usual.abs()), "{rule:?} p = {p}, unit {unit}: {d} {usual}");
            }
        }
    }
}

/// Two pairs of surfaces that touch: what the one selects is part of the rates of the other, as is a relay between them.
#[test]
fn intersections_that_touch_are_solved_together() {
    let g = Graph::new();
    let s: Vec<Expr> = (0..5).map(|i| g.x(i).sign()).collect();
    let rate = |s: &[f64], p: [f64; 2]| -> [f64; 5] {
        [
            0.3 - s[0] + 0.2 * p[1],
            0.1 - s[1] + 0.1 * s[4],
            -0.2 - s[2] + 0.3 * p[0],
            0.15 - s[3],
            0.2 - s[4] + 0.2 * p[0],
        ]
    };
    let (p, q) = (s[0] * s[1], s[2] * s[3]);
    let rhs = [
        q * 0.2 - s[0] + 0.3,
        s[4] * 0.1 - s[1] + 0.1,
        p * 0.3 - s[2] - 0.2,
        -s[3] + 0.15,
        p * 0.2 - s[4] + 0.2,
        p + q * 2.0,
    ];
    let m = build(&g, 0, &rhs);
    let r = run(&m, &options(Selection::Bilinear, 1e-9), &[0.0; 6], 1.0);
    // Picard's iteration for the means
    let mut mean = [0.0; 5];
    for _ in 0..200 {
        let f = rate(&mean, [mean[0] * mean[1], mean[2] * mean[3]]);
        mean.iter_mut().zip(f).for_each(|(m, f)| *m += 0.5 * f);
    }
    let expected = mean[0] * mean[1] + 2.0 * mean[2] * mean[3];
    assert!((r.x[5] - expected).abs() < 1e-11, "{} {expected}", r.x[5]);
    for rule in [Selection::Moments, Selection::Norm] {
        let r = run(&m, &options(rule, 1e-9), &[0.0; 6], 1.0);
        assert!(r.x[..5].iter().all(|v| v.abs() < 1e-12) && r.x[5].abs() < 1.0, "{rule:?} {:?}", r.x);
    }
}
