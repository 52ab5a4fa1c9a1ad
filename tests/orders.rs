//! Order of convergence on the oscillator (4.4): that of the method with switch detection (Theorem 7.10), one
//! without.

mod common;
use common::*;

const T: f64 = std::f64::consts::FRAC_PI_2;

fn error(set: &switchback::settings::Settings, n: usize) -> f64 {
    let (_, x) = simulate(&models::oscillator(), set, &models::OSCILLATOR_X0, T, n);
    distance(&x, &models::OSCILLATOR_XT)
}

fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |m, p| (m.0 + p.0.ln() / n, m.1 + p.1.ln() / n));
    let sxy: f64 = points.iter().map(|p| (p.0.ln() - mx) * (p.1.ln() - my)).sum();
    sxy / points.iter().map(|p| (p.0.ln() - mx).powi(2)).sum::<f64>()
}

/// Steps whose numbers differ by multiples of eleven keep the switch at the same place of its step, because
/// `11 · 2/π` is almost 7.
fn check_order(family: switchback::settings::RkFamily, n_s: i64, order: f64, numbers: &[usize]) {
    let set = settings(family, n_s, 2, FESD);
    let points: Vec<(f64, f64)> = numbers.iter().map(|&n| (1.0 / n as f64, error(&set, n))).collect();
    let s = slope(&points);
    assert!((s - order).abs() < 0.3, "{family:?} {n_s}: slope {s}, expected {order}: {points:?}");
}

#[test]
fn radau_iia_has_order_2s_minus_1() {
    check_order(RadauIia, 1, 1.0, &[552, 1102, 2202]);
    check_order(RadauIia, 2, 3.0, &[46, 101, 200]);
    check_order(RadauIia, 3, 5.0, &[24, 46, 90, 178]);
    check_order(RadauIia, 4, 7.0, &[13, 24, 46, 68]);
}

#[test]
fn gauss_legendre_has_order_2s() {
    check_order(GaussLegendre, 1, 2.0, &[101, 200, 398]);
    check_order(GaussLegendre, 2, 4.0, &[35, 68, 134]);
    check_order(GaussLegendre, 3, 6.0, &[24, 46, 90]);
    check_order(GaussLegendre, 4, 8.0, &[13, 24, 35]);
}

#[test]
fn explicit_methods_have_order_s() {
    check_order(Explicit, 1, 1.0, &[552, 1102, 2202]);
    check_order(Explicit, 2, 2.0, &[101, 200, 398]);
    check_order(Explicit, 3, 3.0, &[68, 134, 266]);
    check_order(Explicit, 4, 4.0, &[46, 90, 178]);
}

#[test]
fn errors_reach_rounding() {
    for (family, n_s, n) in [(RadauIia, 4, 200), (GaussLegendre, 4, 90), (GaussLegendre, 3, 400), (RadauIia, 3, 1000)] {
        let e = error(&settings(family, n_s, 2, FESD), n);
        assert!(e <= 1e-12, "{family:?} {n_s}: {e:e}");
    }
}

#[test]
fn without_switch_detection_every_order_drops_to_one() {
    for (family, n_s) in [(RadauIia, 3), (GaussLegendre, 2), (Explicit, 4)] {
        let set = settings(family, n_s, 2, STANDARD);
        // the mean over all places of the switch in its step
        let mean = |n: usize| (n..n + 11).map(|n| error(&set, n)).sum::<f64>() / 11.0;
        let points: Vec<(f64, f64)> = [40, 120, 360].iter().map(|&n| (1.0 / (n as f64 + 5.0), mean(n))).collect();
        let s = slope(&points);
        assert!((0.7..1.3).contains(&s), "{family:?} {n_s}: slope {s}: {points:?}");
    }
}
