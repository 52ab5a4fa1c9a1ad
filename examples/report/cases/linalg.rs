//! Factorisation of the Newton matrices of discretised problems: fill, operations and time of the backends and orders
//! of elimination.

use crate::json::{Object, Table};
use crate::models::{affine, oscillator, sliding_mode, sliding_ocp};
use crate::svg::{Mark, Plot};
use crate::Context;
use std::time::Instant;
use switchback::dcs::Dcs;
use switchback::fesd::{Fesd, Options, Spec};
use switchback::func::Dims;
use switchback::linalg::csc::Pattern;
use switchback::linalg::kkt::{Kkt, KktSettings};
#[cfg(feature = "suitesparse")]
use switchback::linalg::ldl::SuiteSparse;
use switchback::linalg::ldl::{interleaved, solver, Native, Ordering, SymmetricSolver};
#[cfg(feature = "faer")]
use switchback::linalg::ldl::{Faer, Form};
use switchback::mpcc::Mpcc;
use switchback::nlp::{Control, Nlp};
use switchback::settings::{self, LinearSolver, Settings};
use switchback::system::{Regions, Subsystem, System};

/// `n` blocks with dry friction, each coupled to `reach` neighbours on either side; `x = (q, v)`, force on the first.
fn chain(n: usize, reach: usize) -> System {
    let d = Dims { x: 2 * n, u: 1, p: 0 };
    let mut entries: Vec<(usize, usize, f64)> = Vec::new();
    for j in 0..n {
        for i in j.saturating_sub(reach)..n.min(j + reach + 1) {
            entries.push((n + i, j, if i == j { -2.0 * reach as f64 } else { 1.0 }));
        }
    }
    for j in 0..n {
        entries.push((j, n + j, 1.0));
    }
    entries.push((n, 2 * n, 1.0));
    let mut s = System::new(2 * n, 1, 0).expect("sizes");
    s.set_f0(affine("f0", d, &vec![0.0; 2 * n], &entries)).expect("f0 fits");
    for k in 0..n {
        s.add_subsystem(Subsystem {
            rows: vec![n + k],
            modes: affine("F", d, &[-0.3, 0.3], &[]),
            n_modes: 2,
            regions: Regions::Signs { psi: affine("psi", d, &[0.0], &[(0, n + k, 1.0)]), signs: vec![1, -1] },
        })
        .expect("the subsystem fits");
    }
    s
}

/// The Newton matrix of the relaxed problem: structure, values of a quasidefinite matrix, number of variables.
fn newton_matrix(system: &System, n_stages: usize, n_fe: usize, n_s: usize) -> (Pattern, Vec<f64>, usize) {
    let set = Settings { n_s: n_s as i64, n_fe: n_fe as i64, ..Settings::default() };
    let dcs = Dcs::stewart(system).expect("the system is complete");
    let options = Options::from_settings(&set).expect("the settings are valid");
    let spec = Spec::new(dcs, options, vec![n_fe; n_stages]);
    let p = Fesd::new(spec, 1.0).expect("the problem can be discretised");
    let (n, m) = (p.n(), p.m());
    let order = n + m + p.pairs().len();
    let (mut rows, mut cols) = ((0..order).collect::<Vec<_>>(), (0..order).collect::<Vec<_>>());
    for j in 0..n {
        for &i in p.hess_pattern().rows(j) {
            rows.push(i);
            cols.push(j);
        }
        for &i in p.jac_pattern().rows(j) {
            rows.push(j);
            cols.push(n + i);
        }
    }
    for (k, &(a, b)) in p.pairs().iter().enumerate() {
        rows.extend([a.min(b), a, b]);
        cols.extend([a.max(b), n + m + k, n + m + k]);
    }
    let (pattern, _) = Pattern::from_triplets(order, order, &rows, &cols);
    let mut values = vec![0.0; pattern.nnz()];
    for j in 0..order {
        for k in pattern.range(j) {
            let i = pattern.row_idx()[k];
            values[k] = match (i == j, j < n) {
                (true, true) => 10.0,
                (true, false) => -1e-2,
                // entries of all signs; the Hessian stays diagonally dominant
                (false, upper) => (if upper { 0.1 } else { 1.0 }) * ((3 * i + 7 * j) as f64).sin(),
            };
        }
    }
    (pattern, values, n)
}

/// A quasidefinite matrix with this structure: diagonally dominant, positive in the first `n` rows and negative in the others.
fn dominant(order: usize, n: usize, entries: &[(usize, usize)]) -> (Pattern, Vec<f64>) {
    let mut rows: Vec<usize> = (0..order).collect();
    let mut cols = rows.clone();
    for &(i, j) in entries {
        rows.push(i.min(j));
        cols.push(i.max(j));
    }
    let (pattern, _) = Pattern::from_triplets(order, order, &rows, &cols);
    let mut values = vec![0.0; pattern.nnz()];
    let mut sums = vec![1.0; order];
    for j in 0..order {
        for k in pattern.range(j) {
            let i = pattern.row_idx()[k];
            if i != j {
                values[k] = ((3 * i + 7 * j) as f64).sin();
                sums[i] += values[k].abs();
                sums[j] += values[k].abs();
            }
        }
    }
    for (j, sum) in sums.iter().enumerate() {
        for k in pattern.range(j).filter(|k| pattern.row_idx()[*k] == j) {
            values[k] = if j < n { *sum } else { -sum };
        }
    }
    (pattern, values)
}

/// Structures that are no discretised problems: obstacles on square grids with a row for every point, bands, random ones with so many
/// entries in a row. Columns beside dense blocks, and what the default takes.
fn structures(c: &Context) {
    let grid = |k: usize| {
        let n = k * k;
        let mut entries = Vec::new();
        for i in 0..n {
            if (i + 1) % k > 0 {
                entries.push((i, i + 1));
            }
            if i + k < n {
                entries.push((i, i + k));
            }
            entries.push((i, n + i));
        }
        (2 * n, n, entries)
    };
    let band = |n: usize, width: usize| {
        let entries = (0..n).flat_map(|i| (i + 1..n.min(i + 1 + width)).map(move |j| (i, j))).collect();
        (n, n, entries)
    };
    let random = |n: usize, each: usize| {
        let mut seed = 1u64;
        let mut draw = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (seed >> 33) as usize % n
        };
        let entries = (0..n * each / 2).map(|k| (k % n, draw())).filter(|(i, j)| i != j).collect();
        (n, n, entries)
    };
    type Structure = (usize, usize, Vec<(usize, usize)>);
    let all: Vec<(&str, Structure)> = vec![
        ("grid 100 x 100", grid(100)),
        ("grid 316 x 316", grid(316)),
        ("band 5, n = 1e5", band(100_000, 5)),
        ("band 50, n = 1e4", band(10_000, 50)),
        ("band 200, n = 1e4", band(10_000, 200)),
        ("random 3, n = 1e4", random(10_000, 3)),
        ("random 4, n = 4e3", random(4_000, 4)),
        ("random 10, n = 2e3", random(2_000, 10)),
    ];
    let head = ["structure", "order", "backend", "nnz(L)", "flops/nnz", "analyse ms", "factor ms", "solve ms"];
    let mut table = Table::new(&head);
    for (name, (order, n, entries)) in all {
        let (p, v) = dominant(order, n, &entries);
        let default: Make = |o| solver(LinearSolver::Auto, o).expect("is always there");
        let compared = BACKENDS.iter().filter(|(name, _)| ["native", "faer supernodal"].contains(name));
        for (backend, make) in compared.copied().chain([("auto", default)]) {
            let mut s = make(Ordering::Amd);
            let analyse = seconds(|| s.analyse(&p).expect("the structure is sound"));
            let factor = seconds(|| {
                s.factor(&v);
            });
            let mut x = vec![1.0; order];
            let solve = seconds(|| s.solve(&mut x));
            let st = s.stats();
            let taken = if backend == "auto" { format!("auto: {}", st.name) } else { backend.to_owned() };
            c.record(
                &Object::new()
                    .text("case", "linalg-structures")
                    .text("problem", name)
                    .int("n", order)
                    .text("backend", &taken)
                    .int("nnz_l", st.nnz_l)
                    .num("flops", st.flops)
                    .num("analyse_s", analyse)
                    .num("factor_s", factor)
                    .num("solve_s", solve),
            );
            let ms = |t: f64| format!("{:.2}", 1e3 * t);
            let ratio = format!("{:.1}", st.flops / st.nnz_l as f64);
            let row = [
                name.into(),
                order.to_string(),
                taken,
                st.nnz_l.to_string(),
                ratio,
                ms(analyse),
                ms(factor),
                ms(solve),
            ];
            table.row(row.to_vec());
        }
    }
    c.say(&table.text());
}

type Make = fn(Ordering) -> Box<dyn SymmetricSolver>;

const BACKENDS: &[(&str, Make)] = &[
    #[cfg(feature = "suitesparse")]
    ("suitesparse", |o| Box::new(SuiteSparse::with_ordering(o))),
    ("native", |o| Box::new(Native::with_ordering(o))),
    #[cfg(feature = "faer")]
    ("faer simplicial", |o| Box::new(Faer::new(Form::Simplicial, o))),
    #[cfg(feature = "faer")]
    ("faer supernodal", |o| Box::new(Faer::new(Form::Supernodal, o))),
    #[cfg(feature = "faer")]
    ("faer pivoted", |o| Box::new(Faer::new(Form::Pivoted, o))),
];

/// Seconds this thread has run, where the system says so: on a busy machine a long run is interrupted.
fn processor_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    text.split(' ').next()?.parse().ok().map(|ns: f64| 1e-9 * ns)
}

/// Seconds of a run: the least of several short ones, of long ones the mean time on the processor.
fn seconds(mut f: impl FnMut()) -> f64 {
    const SHORT: f64 = 2e-3;
    let (mut best, mut runs) = (f64::INFINITY, 0);
    let (clock, used) = (Instant::now(), processor_seconds());
    while runs < 3 || clock.elapsed().as_secs_f64() < 0.1 {
        let start = Instant::now();
        f();
        best = best.min(start.elapsed().as_secs_f64());
        runs += 1;
    }
    match (used, processor_seconds()) {
        (Some(from), Some(to)) if best > SHORT => (to - from) / f64::from(runs),
        _ => best,
    }
}

/// What the parts of a Newton step cost, on the default backend.
fn parts(c: &Context, problems: &[(String, Pattern, Vec<f64>, usize)]) {
    let mut table = Table::new(&["problem", "backend", "equilibrate ms", "factor ms", "solve ms", "refinement steps"]);
    for (name, p, v, n) in problems {
        let backend = solver(LinearSolver::Auto, Ordering::Amd).expect("is always there");
        let mut k = Kkt::new(p, *n, backend, KktSettings::default()).expect("the structure is sound");
        let equilibrate = seconds(|| k.equilibrate(v));
        let factor = seconds(|| {
            k.factor(v, 0.0, 0.0);
        });
        let (rhs, mut x) = (vec![1.0; p.n_cols()], vec![0.0; p.n_cols()]);
        let solve = seconds(|| {
            k.solve(&rhs, &mut x);
        });
        let st = k.stats();
        let steps = st.refinement_steps as f64 / st.solves as f64;
        c.record(
            &Object::new()
                .text("case", "linalg-parts")
                .text("problem", name)
                .text("backend", st.backend)
                .num("equilibrate_s", equilibrate)
                .num("factor_s", factor)
                .num("solve_s", solve)
                .num("refinement_steps", steps),
        );
        let ms = |t: f64| format!("{:.3}", 1e3 * t);
        table.row(vec![name.clone(), st.backend.into(), ms(equilibrate), ms(factor), ms(solve), format!("{steps:.1}")]);
    }
    c.say(&table.text());
}

/// Whole solves of the sliding problem (7.51), by backend and order.
fn solves(c: &Context) {
    let head = &[
        "n_s",
        "n_fe",
        "linear_solver",
        "ordering",
        "n",
        "nnz(L)",
        "it",
        "fact",
        "solves",
        "refine",
        "equil",
        "eval ms",
    ];
    let mut table = Table::new(&[head as &[&str], &["la ms", "total ms", "cost"]].concat());
    for (n_s, n_fe) in [(2, 3), (4, 6)] {
        for kind in [LinearSolver::Auto, LinearSolver::Faer] {
            for ordering in [settings::Ordering::Amd, settings::Ordering::Natural] {
                let set = Settings {
                    n_s,
                    n_fe,
                    linear_solver: kind as i64,
                    ordering: ordering as i64,
                    ..Settings::default()
                };
                let clock = Instant::now();
                let mut ocp = sliding_ocp(&set);
                // faer may not be in this library
                let Ok(r) = ocp.solve(&mut Control::default()) else { continue };
                let (r, total) = (r.clone(), clock.elapsed().as_secs_f64());
                let st = ocp.linear_statistics().expect("it was built");
                c.record(
                    &Object::new()
                        .text("case", "linalg-solves")
                        .int("n_s", n_s as usize)
                        .int("n_fe", n_fe as usize)
                        .text("linear_solver", kind.name())
                        .text("ordering", ordering.name())
                        .int("n", st.n)
                        .int("nnz_l", st.nnz_l)
                        .num("flops", st.flops)
                        .int("iterations", r.stats.iterations)
                        .int("factorisations", st.factorisations)
                        .int("solves", st.solves)
                        .int("refinement_steps", st.refinement_steps)
                        .int("equilibrations", st.equilibrations)
                        .num("eval_s", r.stats.time_eval)
                        .num("linalg_s", r.stats.time_linalg)
                        .num("wall_s", total)
                        .num("cost", r.cost),
                );
                table.row(vec![
                    n_s.to_string(),
                    n_fe.to_string(),
                    kind.name().into(),
                    ordering.name().into(),
                    st.n.to_string(),
                    st.nnz_l.to_string(),
                    r.stats.iterations.to_string(),
                    st.factorisations.to_string(),
                    st.solves.to_string(),
                    st.refinement_steps.to_string(),
                    st.equilibrations.to_string(),
                    format!("{:.1}", 1e3 * r.stats.time_eval),
                    format!("{:.1}", 1e3 * r.stats.time_linalg),
                    format!("{:.1}", 1e3 * total),
                    format!("{:.6}", r.cost),
                ]);
            }
        }
    }
    c.say(&table.text());
}

pub fn run(c: &Context) {
    let sliding = sliding_mode();
    let mut problems: Vec<(String, Pattern, Vec<f64>, usize)> = Vec::new();
    let mut add = |name: String, sys: &System, stages: usize, n_fe: usize, n_s: usize| {
        let (p, v, n) = newton_matrix(sys, stages, n_fe, n_s);
        problems.push((format!("{name} {stages}x{n_fe} n_s={n_s}"), p, v, n));
    };
    for n_s in [2, 4, 9] {
        add("oscillator".into(), &oscillator(), 1, 2, n_s);
    }
    for (stages, n_fe, n_s) in [(6, 3, 2), (6, 6, 4), (40, 3, 2), (40, 6, 4), (40, 3, 9), (150, 3, 2)] {
        add("sliding".into(), &sliding, stages, n_fe, n_s);
    }
    for (blocks, reach, stages, n_s) in
        [(3, 1, 20, 2), (5, 1, 20, 2), (10, 1, 20, 2), (20, 1, 10, 2), (40, 1, 3, 2), (10, 10, 10, 2), (20, 20, 5, 2)]
    {
        add(format!("chain {blocks}/{reach}"), &chain(blocks, reach), stages, 2, n_s);
    }
    let mut table = Table::new(&[
        "problem",
        "n",
        "nnz(K)",
        "order",
        "backend",
        "nnz(L)",
        "flops/nnz",
        "analyse ms",
        "factor ms",
        "solve ms",
        "Gflop/s",
    ]);
    let mut plot =
        Plot::new("Factorisation of Newton matrices", "flops / nnz(L)", &format!("time / time of {}", BACKENDS[0].0))
            .log_log();
    let mut ratios: Vec<Vec<(f64, f64)>> = vec![Vec::new(); BACKENDS.len()];
    for (name, p, v, n) in &problems {
        for (order_name, ordering) in [("amd", Ordering::Amd), ("natural", Ordering::Given(interleaved(p, *n)))] {
            let mut reference = f64::NAN;
            // the fill of the order of time is the same for all backends
            let compared = if order_name == "amd" { BACKENDS } else { &BACKENDS[..1] };
            for (b, (backend, make)) in compared.iter().enumerate() {
                let mut s = make(ordering.clone());
                let analyse = seconds(|| s.analyse(p).expect("the structure is sound"));
                let factor = seconds(|| {
                    s.factor(v);
                });
                let mut x = vec![1.0; p.n_cols()];
                let solve = seconds(|| s.solve(&mut x));
                let st = s.stats();
                let ratio = st.flops / st.nnz_l as f64;
                if b == 0 {
                    reference = factor;
                } else {
                    ratios[b].push((ratio, factor / reference));
                }
                c.record(
                    &Object::new()
                        .text("case", "linalg")
                        .text("problem", name)
                        .int("n", st.n)
                        .int("nnz", st.nnz_a)
                        .text("ordering", order_name)
                        .text("backend", backend)
                        .int("nnz_l", st.nnz_l)
                        .num("flops", st.flops)
                        .num("analyse_s", analyse)
                        .num("factor_s", factor)
                        .num("solve_s", solve),
                );
                table.row(vec![
                    name.clone(),
                    st.n.to_string(),
                    st.nnz_a.to_string(),
                    order_name.into(),
                    (*backend).into(),
                    st.nnz_l.to_string(),
                    format!("{ratio:.1}"),
                    format!("{:.2}", 1e3 * analyse),
                    format!("{:.3}", 1e3 * factor),
                    format!("{:.3}", 1e3 * solve),
                    format!("{:.2}", 1e-9 * st.flops / factor),
                ]);
            }
        }
    }
    for (b, (backend, _)) in BACKENDS.iter().enumerate().skip(1) {
        plot.add_coloured(backend, Mark::Dots, b, ratios[b].clone());
    }
    c.plot(&plot, "linalg-crossover.svg");
    c.say(&table.text());
    structures(c);
    parts(c, &problems);
    solves(c);
}
