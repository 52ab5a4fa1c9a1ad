//! The answer of one mode sequence: its contact mode program is solved, or given up early.

use super::modal;
use super::modes::Sequence;
use super::problem::Problem;
use super::search::Answer;
use super::track::Track;
use super::transcribe::Transcription;
use crate::error::Result;
use crate::mpcc::{Mpcc, MpccSettings, MpccSolver, Solution, Warm};
use crate::nlp::{Control, IterationInfo, Nlp, Outcome};
use crate::stop;

/// A program and its solver, with the solution they hold.
pub struct Solved {
    pub(super) transcription: Transcription,
    pub(super) solver: MpccSolver,
}

/// Solves the contact mode program of a sequence. It is given up where its violation is not halved in `patience` iterations, far from
/// zero: most sequences next to a good one have no solution, and only saying so exactly is expensive.
pub(super) fn solve_sequence(
    p: &Problem,
    sequence: &Sequence,
    guess: &Track,
    point: Option<&[Vec<f64>; 3]>,
    settings: MpccSettings,
    patience: usize,
    control: &mut Control,
) -> Result<(Answer, Solved)> {
    let mut t = modal::transcribe(p, sequence, guess);
    t.bounds.validate(t.program.n(), t.program.m())?;
    stop::check_building(t.program.n())?;
    let mut solver = MpccSolver::new(&mut t.program, settings)?;
    let s = run(&mut solver, &mut t, point, patience, control);
    let track = t.read(p, &s.x, &|_| Vec::new());
    let cost = t.cost(&s.x).unwrap_or(f64::NAN);
    let trouble = match (s.outcome, t.program.trouble()) {
        (Outcome::Failed, Some((name, _))) => Some(name.to_owned()),
        _ => None,
    };
    let params = (0..t.params.len()).filter_map(|j| t.params[j].map(|v| (j, s.x[v]))).collect();
    let lengths = modal::phase_lengths(p, sequence, &track);
    let vanishing = modal::vanishing(&lengths);
    let planned = sequence.clone();
    let mut sequence = sequence.clone();
    for (stage, lengths) in sequence.stages.iter_mut().zip(&lengths) {
        for (phase, length) in stage.iter_mut().zip(lengths) {
            phase.share = *length;
        }
    }
    sequence.tidy();
    let answer = Answer {
        outcome: s.outcome,
        x0: t.state(p, t.x0, &s.x),
        sequence,
        track,
        cost,
        vanishing,
        residuals: s.residuals,
        certificate: s.certificate,
        stats: s.stats,
        dimensions: (t.program.n(), t.program.m(), t.program.pairs().len()),
        tried: 1,
        violation: if s.residuals.primal.is_finite() { s.residuals.primal } else { f64::INFINITY },
        point: [s.x, s.y, s.z],
        planned,
        params,
        trouble,
    };
    Ok((answer, Solved { transcription: t, solver }))
}

fn run(
    solver: &mut MpccSolver,
    t: &mut Transcription,
    point: Option<&[Vec<f64>; 3]>,
    patience: usize,
    control: &mut Control,
) -> Solution {
    let mut ended = false;
    let mut patience = Patience { patience, best: f64::INFINITY, since: 0, over: false };
    let stop = control.stop.clone();
    let user = &mut control.monitor;
    let mut monitor = |i: &IterationInfo| {
        ended = !user.as_mut().is_none_or(|f| f(i));
        !ended && !patience.is_over(i)
    };
    let mut inner = Control { stop: stop.clone(), monitor: Some(&mut monitor) };
    let (start, bounds) = (&t.start, &t.bounds);
    let mut s = stop.scope_apart(|| {
        match point.filter(|w| w[0].len() == t.program.n() && w[1].len() == t.program.m()) {
            Some([x, y, z]) => {
                solver.solve_warm(&mut t.program, bounds, &Warm { x, y, z }, &mut inner, &mut |_, _, _| false)
            }
            None => solver.solve(&mut t.program, bounds, start, &mut inner),
        }
        .clone()
    });
    if ended {
        stop::raise();
    } else if patience.over && s.outcome == Outcome::Stopped {
        s.outcome = Outcome::MaxIter;
    }
    s
}

/// Violation below which a program is not given up.
const CLOSE: f64 = 1e-2;

/// Iterations without a violation half as large.
struct Patience {
    patience: usize,
    best: f64,
    since: usize,
    over: bool,
}

impl Patience {
    fn is_over(&mut self, i: &IterationInfo) -> bool {
        if i.inf_pr <= 0.5 * self.best {
            self.best = i.inf_pr;
            self.since = 0;
        } else {
            self.since += 1;
        }
        self.over = self.since > self.patience && self.best > CLOSE;
        self.over
    }
}
