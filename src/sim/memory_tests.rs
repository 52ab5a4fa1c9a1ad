//! The estimate of what a discretised problem takes, beside what it and its solver do take.

use std::sync::Arc;

use crate::dcs::Dcs;
#[cfg(feature = "allocator")]
use crate::fesd::size::bytes;
use crate::fesd::{Fesd, Options, Spec};
use crate::func::{Callback, Dims, Point};
use crate::memory;
#[cfg(feature = "allocator")]
use crate::mpcc::{MpccSettings, MpccSolver};
use crate::settings::Settings;
use crate::system::{Regions, Subsystem, System};

fn spec(nx: usize, n_stages: usize) -> Spec {
    let dims = Dims { x: nx, u: 1, p: 0 };
    let modes = Callback::new("F", dims, 2 * nx, move |at: &Point, out| {
        for i in 0..nx {
            out[i] = at.x[(i + 1) % nx] + at.u[0];
            out[nx + i] = -at.x[i];
        }
        0
    });
    let psi = Callback::new("psi", dims, 1, |at: &Point, out| {
        out[0] = at.x[0];
        0
    });
    let mut system = System::new(nx, 1, 0).unwrap();
    let regions = Regions::Signs { psi: Arc::new(psi), signs: vec![-1, 1] };
    system.add_subsystem(Subsystem { rows: (0..nx).collect(), modes: Arc::new(modes), n_modes: 2, regions }).unwrap();
    let options = Options::from_settings(&Settings::default()).unwrap();
    Spec::new(Dcs::stewart(&system).unwrap(), options, vec![3; n_stages])
}

/// The estimate is neither far below what is taken nor many times as much.
#[test]
#[cfg(feature = "allocator")]
fn estimates_fit_what_is_taken() {
    for (nx, n_stages) in [(1, 60), (2, 40), (10, 20), (40, 5)] {
        let spec = spec(nx, n_stages);
        let estimate = bytes(&spec) as f64;
        let before = memory::held();
        let mut problem = Fesd::new(spec, 0.1).unwrap();
        let solver = MpccSolver::new(&mut problem, MpccSettings::default()).unwrap();
        let taken = (memory::held() - before) as f64;
        let ratio = estimate / taken;
        assert!((0.5..8.0).contains(&ratio), "nx = {nx}: {taken} bytes are taken, {estimate} estimated, {ratio:.2}");
        drop(solver);
    }
}

#[test]
fn what_cannot_be_is_refused_before_it_is_built() {
    let e = Fesd::new(spec(2, 1 << 20), 0.1).err().unwrap();
    assert!(e.code() == -2 && e.to_string().contains("finite elements"), "{e}");
    let e = memory::limited(1 << 20, || Fesd::new(spec(2, 1000), 0.1)).err().unwrap();
    assert!(e.code() == -50 && e.to_string().contains("max_memory") && e.to_string().contains("3000"), "{e}");
}
