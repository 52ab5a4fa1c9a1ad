//! An estimator allocates nothing after it was made: while its window fills and after, with missing measurements, bounds that hold and bounds that
//! contradict the data.

#[path = "common/counting.rs"]
mod counting;
use counting::count;
use std::sync::Arc;
use switchback::expr::Graph;
use switchback::func::Dims;
use switchback::nmpc::{Mhe, MheOptions, Noise, Source};
use switchback::ocp::Ocp;
use switchback::settings::Settings;
use switchback::system::{SharedFunction, System};
use switchback::tableau::Family;

#[test]
fn nothing_is_allocated_after_creation() {
    let g = Graph::new();
    let dims = Dims { x: 3, u: 1, p: 0 };
    let [a, w, c, u] = [g.x(0), g.x(1), g.x(2), g.u(0)];
    let f: SharedFunction = Arc::new(g.function("f", dims, &[w, u - a.sin() - c * w, 0.0 * c]).unwrap());
    let y: SharedFunction = Arc::new(g.function("y", dims, &[a.sin()]).unwrap());
    let mut system = System::new(3, 1, 0).unwrap();
    system.set_f0(f).unwrap();
    let mut ocp = Ocp::new(&system, 0.8, 8, &Settings::default()).unwrap();
    ocp.set_x0(&[0.3, 0.0, 0.1]).unwrap();
    // the constant state has bounds that the samples contradict
    ocp.set_x_bounds(&[-2.0, -9.0, 0.05], &[2.0, 9.0, 0.2]).unwrap();
    let noise = Noise { initial: &[0.5, 0.5, 0.1], process: &[0.0, 0.01, 0.0], measurement: &[0.02] };
    for (family, n_s) in [(Family::Explicit, 4), (Family::RadauIia, 2)] {
        let options = MheOptions { iterations: 3, family: Some(family), n_s, steps: 1, ..MheOptions::default() };
        let mut mhe = Mhe::new(&ocp, &y, &noise, &options).unwrap();
        let (mut x, mut p, mut found) = ([0.0; 3], [0.0; 9], [0; 5]);
        let before = count();
        for k in 0..40 {
            let t = 0.1 * f64::from(k);
            let y = if k % 5 == 2 { f64::NAN } else { (0.3 * (-0.3 * t).exp() * t.cos()).sin() };
            found[mhe.estimate(&[y], &mut x).unwrap().source as usize] += 1;
            mhe.covariance(&mut p).unwrap();
            assert!(mhe.prepare(&[0.0]).unwrap());
        }
        mhe.reset(&[0.3, 0.0, 0.1]).unwrap();
        assert_eq!(count(), before, "{family:?}");
        assert_eq!(found[Source::Qp as usize], 40, "{found:?}");
        // damping was 0.3 per second for the velocity alone; the data want more than the bound allows
        assert!(x.iter().all(|v| v.is_finite()) && x[2] <= 0.2 + 1e-9);
    }
}
