//! Enumeration of the branches of a problem: what decides which answer is right.

use super::{Numbers, Problem};
use switchback_mpcc::mpcc::{Mpcc, Side};
use switchback_mpcc::nlp::{Control, Ipm, IpmSettings, Monotone, Nlp, Outcome, Start};

/// Pairs up to which all branches are tried.
pub const MAX_PAIRS: usize = 8;

/// What the branches of a problem have.
pub struct Survey {
    /// Objectives and points of branch problems that were solved, from all starting points.
    pub solved: Vec<(f64, Vec<f64>)>,
    /// Does the objective fall for ever in some branch?
    pub unbounded: bool,
    /// Branch solves that ended neither solved nor infeasible nor diverging.
    pub undecided: usize,
}

impl Survey {
    pub fn minimum(&self) -> f64 {
        self.solved.iter().map(|s| s.0).fold(f64::INFINITY, f64::min)
    }
}

/// Solves every branch from the starting points of the problem and `extra` others.
pub fn survey(p: &Problem, extra: usize) -> Survey {
    let (mut lifted, bounds) = p.lifted();
    let pairs = lifted.pairs().len();
    assert!(pairs <= MAX_PAIRS, "{} has too many branches", p.name);
    let mut r = Numbers::new(1);
    let mut starts = p.starts.clone();
    for _ in 0..extra {
        starts.push(p.starts[0].iter().map(|v| v + 3.0 * r.next()).collect());
    }
    let mut ipm = Ipm::new(&lifted, IpmSettings { max_iter: 100, ..IpmSettings::default() }).expect("a structure");
    let mut out = Survey { solved: Vec::new(), unbounded: false, undecided: 0 };
    for code in 0..1usize << pairs {
        let sides: Vec<Side> =
            (0..pairs).map(|k| if code >> k & 1 == 0 { Side::First } else { Side::Second }).collect();
        let mut branch = bounds.clone();
        lifted.branch(&sides, &mut branch);
        for s in &starts {
            let w0 = lifted.start(s);
            let mut rule = Monotone { mu_init: 0.1, tol: 1e-8, primal_tol: 1e-9 };
            match ipm.solve(&mut lifted, &branch, Start::Cold(&w0), &mut rule, &mut Control::default()) {
                Outcome::Solved => out.solved.push((ipm.objective(), ipm.iterate().x[..s.len()].to_vec())),
                Outcome::Diverging => out.unbounded = true,
                Outcome::Infeasible | Outcome::LocallyInfeasible => {}
                _ => out.undecided += 1,
            }
        }
    }
    out.solved.sort_by(|a, b| a.0.total_cmp(&b.0));
    out
}

/// Is `x` a local minimiser: does no branch that contains it have a lower point in a small box around it?
pub fn is_local_minimiser(p: &Problem, x: &[f64]) -> bool {
    let (mut lifted, mut bounds) = p.lifted();
    let w = lifted.start(x);
    let f = {
        let mut c = vec![0.0; lifted.m()];
        lifted.eval(&w, &mut c).expect("a value at the point")
    };
    for (j, v) in x.iter().enumerate() {
        let radius = 1e-2 * (1.0 + v.abs());
        (bounds.xl[j], bounds.xu[j]) = (bounds.xl[j].max(v - radius), bounds.xu[j].min(v + radius));
    }
    let pairs: Vec<(f64, f64)> = lifted.pairs().iter().map(|&(a, b)| (w[a], w[b])).collect();
    let undecided: Vec<usize> = (0..pairs.len()).filter(|&k| pairs[k].0.max(pairs[k].1) < 1e-5).collect();
    let mut sides: Vec<Side> = pairs.iter().map(|p| if p.0 <= p.1 { Side::First } else { Side::Second }).collect();
    let mut ipm = Ipm::new(&lifted, IpmSettings { max_iter: 100, ..IpmSettings::default() }).expect("a structure");
    (0..1usize << undecided.len()).all(|code| {
        for (i, &k) in undecided.iter().enumerate() {
            sides[k] = if code >> i & 1 == 0 { Side::First } else { Side::Second };
        }
        let mut branch = bounds.clone();
        lifted.branch(&sides, &mut branch);
        let mut rule = Monotone { mu_init: 1e-3, tol: 1e-10, primal_tol: 1e-10 };
        let outcome = ipm.solve(&mut lifted, &branch, Start::Cold(&w), &mut rule, &mut Control::default());
        outcome != Outcome::Solved || ipm.objective() > f - 1e-6 * (1.0 + f.abs())
    })
}
