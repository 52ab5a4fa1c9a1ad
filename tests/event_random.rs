//! Random piecewise linear Filippov systems: the engine against small steps of Euler's method.

mod common;
use common::models::affine;
use switchback::event::{simulate, Options, Outcome};
use switchback::func::Dims;
use switchback::system::{Regions, Subsystem, System};

/// Numbers in `[−1, 1)` from a linear congruential generator.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// `ẋ = Σ_k A_{k,i} x + b_{k,i}`, side `i` of line `k` by the sign of `n_k · x − c_k`.
struct Planar {
    /// Per line: two fields of six numbers (columns of `A`, then `b`), the normal, the offset.
    lines: Vec<([[f64; 6]; 2], [f64; 2], f64)>,
}

impl Planar {
    fn new(r: &mut Random) -> Planar {
        let n = if r.next() > 0.0 { 1 } else { 2 };
        let lines = (0..n).map(|_| {
            let mut field = || [r.next(), r.next(), r.next(), r.next(), 2.0 * r.next(), 2.0 * r.next()];
            let fields = [field(), field()];
            let angle = 3.2 * r.next();
            (fields, [angle.cos(), angle.sin()], 0.3 * r.next())
        });
        Planar { lines: lines.collect() }
    }

    fn system(&self) -> System {
        let d = Dims { x: 2, u: 0, p: 0 };
        let mut s = System::new(2, 0, 0).unwrap();
        for (f, n, c) in &self.lines {
            let entries: Vec<(usize, usize, f64)> =
                (0..2).flat_map(|j| (0..4).map(move |i| (i, j, f[i / 2][2 * j + i % 2]))).collect();
            let modes = affine("F", d, &[f[0][4], f[0][5], f[1][4], f[1][5]], &entries);
            let psi = affine("psi", d, &[-c], &[(0, 0, n[0]), (0, 1, n[1])]);
            let regions = Regions::Signs { psi, signs: vec![1, -1] };
            s.add_subsystem(Subsystem { rows: vec![0, 1], modes, n_modes: 2, regions }).unwrap();
        }
        s
    }

    fn euler(&self, x0: [f64; 2], t: f64, n: usize) -> [f64; 2] {
        let h = t / n as f64;
        let mut x = x0;
        for _ in 0..n {
            let mut v = [0.0; 2];
            for (f, normal, c) in &self.lines {
                let side = usize::from(normal[0] * x[0] + normal[1] * x[1] - c < 0.0);
                let f = &f[side];
                v[0] += f[0] * x[0] + f[2] * x[1] + f[4];
                v[1] += f[1] * x[0] + f[3] * x[1] + f[5];
            }
            x[0] += h * v[0];
            x[1] += h * v[1];
        }
        x
    }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    (a[0] - b[0]).abs().max((a[1] - b[1]).abs())
}

/// Runs systems with these seeds; returns how many had no continuation that small steps agree on, and all mismatches.
fn compare(seeds: std::ops::Range<u64>) -> (usize, Vec<String>) {
    const T: f64 = 2.0;
    let (mut open, mut wrong) = (0, Vec::new());
    for seed in seeds {
        let mut r = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 1);
        r.next();
        let p = Planar::new(&mut r);
        let x0 = [r.next(), r.next()];
        let run = simulate(&p.system(), &Options::with_tolerance(1e-9, 1e-9), 0.0, &x0, T).unwrap();
        assert!(run.x.iter().all(|v| v.is_finite()) && run.stats.steps < 100_000, "seed {seed}: {:?}", run.stats);
        let coarse = p.euler(x0, T, 4_000);
        let size = 1.0 + coarse[0].abs().max(coarse[1].abs());
        if run.outcome == Outcome::Reached && apart(&run.x, &coarse) < 0.01 * size {
            continue;
        }
        let fine = p.euler(x0, T, 200_000);
        if run.outcome == Outcome::Reached && apart(&run.x, &fine) < 2e-3 * size {
            continue;
        }
        // a chatter of Euler's method may be wider than expected: again with finer steps
        let finest = p.euler(x0, T, 4_000_000);
        if run.outcome == Outcome::Reached && apart(&run.x, &finest) < 2e-3 * size {
            continue;
        }
        // small steps that disagree among themselves say that the solution is not unique, or unstable
        let others = [(1e-5, 0.0), (-1e-5, 0.0), (0.0, 1e-5), (0.0, -1e-5)];
        let spread = others.iter().map(|(a, b)| apart(&fine, &p.euler([x0[0] + a, x0[1] + b], T, 150_000)));
        if spread.fold(0.0, f64::max) > 0.01 * size {
            open += 1;
            continue;
        }
        wrong.push(format!(
            "seed {seed}: {:?} {} {:?}, Euler {fine:?}, {} switches, last {:?}",
            run.outcome,
            run.reason,
            run.x,
            run.switches.len(),
            run.switches.last()
        ));
    }
    (open, wrong)
}

#[test]
fn ten_thousand_random_planar_systems() {
    let (open, wrong) = compare(0..10_000);
    assert!(wrong.is_empty(), "{} of 10000 differ:\n{}", wrong.len(), wrong.join("\n"));
    // repelling surfaces, corners: small steps themselves have no clear answer there
    assert!(open < 100, "{open} of 10000 without a clear answer");
}

/// Three states and three surfaces that mostly attract: sliding modes of any codimension, coupled with each other.
struct Spatial {
    a: [[f64; 3]; 3],
    b: [f64; 3],
    /// Fields on both sides, normal, offset.
    surfaces: Vec<([[f64; 3]; 2], [f64; 3], f64)>,
}

impl Spatial {
    fn new(r: &mut Random) -> Spatial {
        let mut v = || [r.next(), r.next(), r.next()];
        let (a, b) = ([v(), v(), v()], v());
        let surface = |_| {
            let (n, mut f) = (v(), [v(), v()]);
            for i in 0..3 {
                f[0][i] -= 1.5 * n[i];
                f[1][i] += 1.5 * n[i];
            }
            (f, n, 0.2 * v()[0])
        };
        let surfaces = (0..3).map(surface).collect();
        Spatial { a, b, surfaces }
    }

    fn system(&self) -> System {
        let d = Dims { x: 3, u: 0, p: 0 };
        let mut s = System::new(3, 0, 0).unwrap();
        let entries: Vec<(usize, usize, f64)> = (0..9).map(|k| (k % 3, k / 3, self.a[k % 3][k / 3])).collect();
        s.set_f0(affine("f0", d, &self.b, &entries)).unwrap();
        for (f, n, c) in &self.surfaces {
            let psi = affine("psi", d, &[-c], &[(0, 0, n[0]), (0, 1, n[1]), (0, 2, n[2])]);
            let regions = Regions::Signs { psi, signs: vec![1, -1] };
            let modes = affine("F", d, &f.concat(), &[]);
            s.add_subsystem(Subsystem { rows: vec![0, 1, 2], modes, n_modes: 2, regions }).unwrap();
        }
        s
    }

    fn euler(&self, x0: &[f64; 3], t: f64, n: usize) -> [f64; 3] {
        let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let h = t / n as f64;
        let mut x = *x0;
        for _ in 0..n {
            let mut v: [f64; 3] = std::array::from_fn(|i| self.b[i] + dot(&self.a[i], &x));
            for (f, normal, c) in &self.surfaces {
                let side = usize::from(dot(normal, &x) < *c);
                v.iter_mut().zip(&f[side]).for_each(|(v, f)| *v += f);
            }
            x.iter_mut().zip(&v).for_each(|(x, v)| *x += h * v);
        }
        x
    }
}

#[test]
fn random_systems_that_slide_on_three_surfaces() {
    let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    let mut sliding = 0;
    for seed in 0..1000u64 {
        let mut r = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) + 7);
        r.next();
        let s = Spatial::new(&mut r);
        let x0 = [r.next(), r.next(), r.next()];
        let run = simulate(&s.system(), &Options::with_tolerance(1e-9, 1e-9), 0.0, &x0, 2.0).unwrap();
        assert_eq!(run.outcome, Outcome::Reached, "seed {seed}: {}", run.reason);
        sliding += usize::from(run.switches.iter().any(|w| w.after.len() > 1));
        // small steps chatter along a surface: coarse ones are enough for most systems
        let near = |n: usize, tol: f64| {
            let e = s.euler(&x0, 2.0, n);
            apart(&run.x, &e) < tol * (1.0 + apart(&e, &[0.0; 3]))
        };
        assert!(near(20_000, 0.01) || near(1_000_000, 2e-3) || near(4_000_000, 2e-3), "seed {seed}: {run:?}");
    }
    assert!(sliding > 900, "{sliding}");
}
