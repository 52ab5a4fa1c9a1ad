//! Small programs of ten kinds, drawn from seeds: what the solver finds beside a full enumeration of branches, and two builds or two
//! settings of one, in pairs.
//!
//! ```text
//! cargo bench -p switchback-mpcc --bench families -- run [--seed S] [--count N] [--kinds a,b] [--set portfolio=agree] > new.tsv
//! cargo bench -p switchback-mpcc --bench families -- compare old.tsv new.tsv
//! ```
//!
//! `lcp` solves linear complementarity problems without an objective, of five kinds.
//!
//! `run` solves the programs of `count` seeds of every kind from `seed` on, which is drawn from the clock where it is not given, and
//! writes a line for each. Branches are enumerated with the interior-point method, one smooth program for every choice of sides; those
//! of linear rows that a linear program shows to be empty are left out. The optimum is that of an enumeration where branches are
//! convex; elsewhere it is the best of three starts of every branch, and of what the arms found. `--reference FILE` keeps optima.
//!
//! `--units K` gives objective, rows and variables units of their own, drawn from `10^-K` to `10^K`; optima stay those of the program as it was
//! drawn. The certificate is then judged where K is 0 alone, as its tolerances are those of a scaling.
//!
//! `--bend` adds exponentials to objectives and to the conditions of followers, so that no branch is a quadratic program.
//!
//! `--pairs K` draws programs of so many pairs; those of more than 12 are not enumerated, and only what can be judged without is.
//!
//! Every word is judged: rows and pairs evaluated anew, B-stationarity by linear programs over all branches at the point,
//! infeasibility by the enumeration.

#![allow(clippy::needless_range_loop)]

mod draw;
mod enumerate;
mod program;

use std::collections::HashMap;
use std::fmt::Write as _;
use std::io::Write as _;

use switchback_mpcc::mpcc::simplex::Found;
use switchback_mpcc::mpcc::{BStationarity, Lifted, Mpcc, MpccSettings, MpccSolver, Solution};
use switchback_mpcc::nlp::{Bounds, Control, Nlp, Outcome, INFINITE};
use switchback_mpcc::settings::Portfolio;

use draw::{bend, complementarity, draw, in_units, COMPLEMENTARITY, KINDS};
use enumerate::{enumerate, holds, linear_rows, Lift};

/// Violation of rows, bounds and pairs of a point that is one, relative to bounds above one.
const MET: f64 = 1e-6;
/// Two objectives are the same up to this, relative above one.
const SAME: f64 = 1e-3;
/// Pairs up to which branches are enumerated.
const MOST: usize = 12;
/// Radius of the linearised problem, and the share of its steepest descent that refutes B-stationarity.
const RADIUS: f64 = 1e-3;
const DESCENT: f64 = 1e-4;

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    match args.first().map(String::as_str) {
        Some("run") => run(&args[1..]),
        Some("lcp") => run_complementarity(&args[1..]),
        Some("compare") if args.len() == 3 => compare(&read(&args[1]), &read(&args[2])),
        _ => eprintln!("usage: families run [--seed S] [--count N] [--kinds a,b] [--set KEY=VALUE] [--reference FILE] [--units K] [--pairs K] [--bend] | lcp [--sizes 10,50] [--seed S] [--count N] [--kinds a,b] [--set KEY=VALUE] | compare OLD NEW"),
    }
}

fn option<'a>(args: &'a [String], name: &str) -> Option<&'a str> {
    args.iter().position(|a| a == name).and_then(|i| args.get(i + 1)).map(String::as_str)
}

fn settings(args: &[String]) -> MpccSettings {
    let mut s = MpccSettings::default();
    for (_, pair) in args.iter().zip(args.iter().skip(1)).filter(|a| a.0 == "--set") {
        let (key, value) = pair.split_once('=').expect("KEY=VALUE");
        match key {
            "portfolio" => {
                s.portfolio = [Portfolio::Off, Portfolio::Rescue, Portfolio::All, Portfolio::Agree]
                    .into_iter()
                    .find(|p| format!("{p:?}").to_lowercase() == value)
                    .expect("a portfolio");
            }
            "certify" => s.certify = value == "on",
            "early_polish" => s.early_polish = value == "on",
            "branch_work" => s.branch_work = value.parse().expect("a number"),
            "sigma_factor" => s.sigma_factor = value.parse().expect("a number"),
            _ => panic!("{key} is no option of this benchmark"),
        }
    }
    s
}

fn run(args: &[String]) {
    let clock = || std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).map_or(1, |d| d.as_secs());
    let seed = option(args, "--seed").map_or_else(clock, |s| s.parse().expect("a seed"));
    let count: u64 = option(args, "--count").map_or(10, |s| s.parse().expect("a count"));
    let kinds: Vec<&str> = option(args, "--kinds").map_or(KINDS.to_vec(), |s| s.split(',').collect());
    let settings = settings(args);
    let pairs: Option<usize> = option(args, "--pairs").map(|s| s.parse().expect("a number"));
    let units: i32 = option(args, "--units").map_or(0, |s| s.parse().expect("a number of digits"));
    let bent = args.iter().any(|a| a == "--bend");
    let file = option(args, "--reference");
    let mut known: HashMap<(String, u64), f64> = HashMap::new();
    for line in file.and_then(|f| std::fs::read_to_string(f).ok()).unwrap_or_default().lines() {
        let of: Vec<&str> = line.split('\t').collect();
        known.insert((of[0].to_string(), of[1].parse().unwrap()), of[2].parse().unwrap());
    }
    println!("kind\tseed\tpairs\toutcome\tfound\tbest\titerations\tmicroseconds\tclaims\tfalse");
    for kind in kinds {
        for seed in seed..seed + count {
            let drawn = draw(kind, seed, pairs);
            let program = if bent { bend(drawn, kind, seed) } else { drawn };
            let mut p = Lifted::new(program.clone(), &program.pairs).expect("pairs");
            let b = p.bounds(&program.bounds).expect("bounds");
            let best = *known.entry((kind.to_string(), seed)).or_insert_with(|| {
                let best = if p.pairs().len() > MOST { f64::NAN } else { enumerate(&program, &mut p, &b) };
                if let Some(f) = file {
                    let mut out = std::fs::OpenOptions::new().create(true).append(true).open(f).expect("a file");
                    writeln!(out, "{kind}\t{seed}\t{best:e}").expect("a file");
                }
                best
            });
            let (program, unit) = in_units(program, units, seed);
            let mut p = Lifted::new(program.clone(), &program.pairs).expect("pairs");
            let b = p.bounds(&program.bounds).expect("bounds");
            let x0 = p.start(&program.x0);
            let mut least = f64::INFINITY;
            let mut found: Option<Solution> = None;
            for _ in 0..3 {
                let begin = processor_time();
                let mut solver = MpccSolver::new(&mut p, settings).expect("a solver");
                found = Some(solver.solve(&mut p, &b, &x0, &mut Control::default()).clone());
                least = least.min(processor_time() - begin);
            }
            let s = found.expect("a solution");
            let (claims, wrong) = judge(&mut p, &b, &s, (unit, units > 0), best);
            let value = if s.outcome == Outcome::Solved { s.objective / unit } else { f64::NAN };
            let (outcome, pairs, us) = (s.outcome, p.pairs().len(), 1e6 * least);
            let iterations = s.stats.iterations;
            println!(
                "{kind}\t{seed}\t{pairs}\t{outcome:?}\t{value:.10e}\t{best:.10e}\t{iterations}\t{us:.0}\t{claims}\t{wrong}"
            );
        }
    }
}

/// Linear complementarity problems: how many are solved, by which iterations and time.
fn run_complementarity(args: &[String]) {
    let seed: u64 = option(args, "--seed").map_or(1, |s| s.parse().expect("a seed"));
    let count: u64 = option(args, "--count").map_or(5, |s| s.parse().expect("a count"));
    let sizes: Vec<usize> = option(args, "--sizes")
        .map_or(vec![10, 50, 150], |s| s.split(',').map(|n| n.parse().expect("a size")).collect());
    let kinds: Vec<&str> = option(args, "--kinds").map_or(COMPLEMENTARITY.to_vec(), |s| s.split(',').collect());
    let settings = settings(args);
    println!("kind           n  problems  solved  iterations: mean  most  milliseconds: mean  most");
    for kind in kinds {
        for &n in &sizes {
            let (mut solved, mut all, mut most, mut time, mut longest) = (0, 0, 0, 0.0, 0f64);
            for seed in seed..seed + count {
                let program = complementarity(kind, n, seed);
                let mut p = Lifted::new(program.clone(), &program.pairs).expect("pairs");
                let b = p.bounds(&program.bounds).expect("bounds");
                let x0 = p.start(&program.x0);
                let begin = processor_time();
                let mut solver = MpccSolver::new(&mut p, settings).expect("a solver");
                let s = solver.solve(&mut p, &b, &x0, &mut Control::default()).clone();
                let spent = 1e3 * (processor_time() - begin);
                let mut c = vec![0.0; p.m()];
                let closed = p.pairs().iter().all(|&(u, v)| s.x[u].min(s.x[v]) <= MET);
                let known = p.eval(&s.x, &mut c).is_ok();
                solved += usize::from(s.outcome == Outcome::Solved && known && closed && holds(&s.x, &c, &b, MET));
                (all, most) = (all + s.stats.iterations, most.max(s.stats.iterations));
                (time, longest) = (time + spent, longest.max(spent));
            }
            let mean = all as f64 / count as f64;
            println!(
                "{kind:<11} {n:>4}  {count:>8}  {solved:>6}  {mean:>16.1}  {most:>4}  {:>18.2}  {longest:>4.2}",
                time / count as f64
            );
        }
    }
}

/// Processor seconds of this thread.
fn processor_time() -> f64 {
    #[cfg(unix)]
    {
        let mut t = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        // SAFETY: `t` is a valid place for the answer
        unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut t) };
        t.tv_sec as f64 + 1e-9 * t.tv_nsec as f64
    }
    #[cfg(not(unix))]
    {
        use std::{sync::OnceLock, time::Instant};
        static BEGIN: OnceLock<Instant> = OnceLock::new();
        BEGIN.get_or_init(Instant::now).elapsed().as_secs_f64()
    }
}

/// What was claimed, and which of it is false: `s` solved, `b` B-stationary, `g` no point is below the bound, `i` infeasible, `l` locally infeasible, which is
/// false of no program that has a point elsewhere and is only listed.
fn judge(p: &mut Lift, b: &Bounds, s: &Solution, (unit, mixed): (f64, bool), best: f64) -> (String, String) {
    let (mut claims, mut wrong) = (String::new(), String::new());
    let mut claim = |name: char, is_true: bool| {
        claims.push(name);
        if !is_true {
            wrong.push(name);
        }
    };
    match s.outcome {
        Outcome::Solved => {
            let mut c = vec![0.0; p.m()];
            let f = p.eval(&s.x, &mut c).unwrap_or(f64::NAN);
            let closed = p.pairs().iter().all(|&(u, v)| s.x[u].min(s.x[v]) <= MET || s.x[u] * s.x[v] <= 1e-7);
            let same = (f - s.objective).abs() <= MET * f.abs().max(unit);
            claim('s', holds(&s.x, &c, b, MET) && closed && same);
            if s.certificate.b == BStationarity::Yes {
                claim('b', mixed || !descends(p, b, &s.x));
            }
            if let Some(bound) = s.certificate.bound {
                claim('g', best.is_nan() || bound / unit <= best + MET * best.abs().max(1.0));
            }
        }
        Outcome::Infeasible => claim('i', best.is_nan() || best == f64::INFINITY),
        Outcome::LocallyInfeasible => claim('l', true),
        Outcome::Diverging => claim('d', false),
        _ => {}
    }
    (claims, if wrong.is_empty() { "-".into() } else { wrong })
}

/// Is there a descent of the linearised problem in some branch at the point?
fn descends(p: &mut Lift, b: &Bounds, x: &[f64]) -> bool {
    let (n, m) = (p.n(), p.m());
    let (mut lp, _) = linear_rows(p, x);
    let (mut c, mut grad, mut jac) = (vec![0.0; m], vec![0.0; n], vec![0.0; p.jac_pattern().nnz()]);
    p.eval(x, &mut c).expect("values");
    p.derivatives(x, &mut grad, &mut jac).expect("derivatives");
    for j in 0..n {
        lp.bound(j, (b.xl[j] - x[j]).clamp(-RADIUS, 0.0), (b.xu[j] - x[j]).clamp(0.0, RADIUS));
    }
    for i in 0..m {
        lp.bound(n + i, (b.cl[i] - c[i]).min(0.0), (b.cu[i] - c[i]).max(0.0));
    }
    let mut biactive = Vec::new();
    for &(u, v) in p.pairs() {
        match (x[u] <= MET, x[v] <= MET) {
            (true, true) => biactive.push((u, v)),
            (true, false) => lp.bound(u, 0.0, 0.0),
            _ => lp.bound(v, 0.0, 0.0),
        }
    }
    let size: f64 = grad.iter().fold(1e-3, |a, g| a.max(g.abs()));
    (0..1usize << biactive.len().min(14)).any(|number| {
        for (i, &(u, v)) in biactive.iter().enumerate() {
            let (zero, open) = if number >> i & 1 == 0 { (u, v) } else { (v, u) };
            lp.bound(zero, 0.0, 0.0);
            lp.bound(open, 0.0, (b.xu[open] - x[open]).clamp(0.0, RADIUS));
        }
        let ended = lp.feasible(&|| true) == Found::Point && lp.minimise(&grad, &|| true) == Found::Point;
        ended && lp.point().zip(&grad).map(|(d, g)| d * g).sum::<f64>() < -DESCENT * size * RADIUS
    })
}

/// A line of a table.
#[derive(Debug, Clone)]
struct Line {
    kind: String,
    found: f64,
    best: f64,
    iterations: f64,
    us: f64,
    outcome: String,
    claims: String,
    wrong: String,
}

fn read(file: &str) -> HashMap<(String, u64), Line> {
    let text = std::fs::read_to_string(file).expect("a table");
    let mut all = HashMap::new();
    for line in text.lines().skip(1) {
        let f: Vec<&str> = line.split('\t').collect();
        let number = |i: usize| f[i].parse::<f64>().expect("a number");
        let (kind, seed) = (f[0].to_string(), number(1) as u64);
        let line = Line {
            kind: kind.clone(),
            outcome: f[3].into(),
            found: number(4),
            best: number(5),
            iterations: number(6),
            us: number(7),
            claims: f[8].into(),
            wrong: f[9].into(),
        };
        all.insert((kind, seed), line);
    }
    all
}

/// Sums of one arm over some programs.
#[derive(Default)]
struct Sum {
    solved: usize,
    /// Solved, or shown to be infeasible.
    ended: usize,
    global: usize,
    locally: usize,
    wrong: usize,
    b: usize,
}

impl Sum {
    fn add(&mut self, l: &Line, best: f64) {
        self.solved += usize::from(l.outcome == "Solved");
        self.ended += usize::from(l.outcome == "Solved" || (l.outcome == "Infeasible" && best == f64::INFINITY));
        self.global += usize::from(l.found <= best + SAME * best.abs().max(1.0) && best < INFINITE);
        self.locally += usize::from(l.outcome == "LocallyInfeasible");
        self.wrong += usize::from(l.wrong != "-");
        self.b += usize::from(l.claims.contains('b'));
    }
}

fn compare(old: &HashMap<(String, u64), Line>, new: &HashMap<(String, u64), Line>) {
    println!("kind        feasible | solved      global      ended       B           loc.inf.  false | lower higher | iterations  CPU");
    let (mut lower, mut higher) = (0, 0);
    for kind in KINDS.iter().copied().chain(["all"]) {
        let (mut a, mut b) = (Sum::default(), Sum::default());
        let (mut its, mut cpu, mut both, mut feasible, mut n) = (0.0, 0.0, 0.0, 0, 0);
        (lower, higher) = (0, 0);
        for (key, o) in old.iter().filter(|o| kind == "all" || o.1.kind == kind) {
            let Some(w) = new.get(key) else { continue };
            let best = o.best.min(w.best).min(o.found).min(w.found);
            n += 1;
            feasible += usize::from(best < INFINITE);
            a.add(o, best);
            b.add(w, best);
            if o.outcome == "Solved" && w.outcome == "Solved" {
                both += 1.0;
                its += (w.iterations.max(1.0) / o.iterations.max(1.0)).ln();
                cpu += (w.us / o.us).ln();
                let room = SAME * best.abs().max(1.0);
                lower += usize::from(w.found < o.found - room);
                higher += usize::from(w.found > o.found + room);
            }
        }
        if n == 0 {
            continue;
        }
        let mut line = String::new();
        let mut two = |a: usize, b: usize| write!(line, "{a:>4} {b:>4}   ").expect("room");
        two(a.solved, b.solved);
        two(a.global, b.global);
        two(a.ended, b.ended);
        two(a.b, b.b);
        two(a.locally, b.locally);
        two(a.wrong, b.wrong);
        let ratio = |v: f64| (v / f64::max(both, 1.0)).exp();
        println!(
            "{kind:<10} {feasible:>4} {n:>4} | {line}| {lower:>4} {higher:>4} | {:.3} {:.3}",
            ratio(its),
            ratio(cpu)
        );
    }
    println!("sign test of objectives: p = {:.3}", sign_test(lower, higher));
}

/// Probability of a division as uneven as this one, or more, by chance: the exact binomial test on both sides.
fn sign_test(a: usize, b: usize) -> f64 {
    let n = a + b;
    let (mut term, mut sum) = (0.5f64.powi(n as i32), 0.0);
    for i in 0..=a.min(b) {
        sum += term;
        term *= (n - i) as f64 / (i + 1) as f64;
    }
    (2.0 * sum).min(1.0)
}
