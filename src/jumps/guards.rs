//! What keeps the motion of a mode sequence in its modes, and where that acts: a force that does not pull, friction inside of its cone, a
//! speed with its sign, a gap that is not negative. Where one of these is reached another order of contacts has the same motion, and may
//! have a better one beside it; where none is, no small change of the motion leaves its modes.

use super::transcribe::Transcription;
use crate::nlp::Nlp;

/// A condition of a mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Condition {
    /// An open contact does not overlap.
    Gap,
    /// A closed contact, or one that is hit, does not pull.
    Force,
    /// What sticks stays inside of its cone.
    Cone,
    /// What slides keeps its direction.
    Speed,
    /// What is hit comes closer before it.
    Closing,
}

/// Where a program has it.
#[derive(Debug, Clone, Copy)]
pub(super) enum Limit {
    Row(usize),
    LowerBound(usize),
}

/// A condition of a contact in a phase, given by control stage and place in it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Guard {
    pub(super) contact: usize,
    pub(super) phase: (usize, usize),
    pub(super) condition: Condition,
    pub(super) limit: Limit,
}

/// A condition that is reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Touched {
    pub(super) contact: usize,
    pub(super) phase: (usize, usize),
    pub(super) condition: Condition,
}

/// Share of the largest value of the condition in the motion at which it is reached.
const REACHED: f64 = 1e-6;

/// Conditions that are reached at a point, each of them once.
pub(super) fn touched(guards: &[Guard], t: &mut Transcription, w: &[f64]) -> Vec<Touched> {
    let mut rows = vec![0.0; t.program.m()];
    if guards.is_empty() || t.program.cost(w, &mut rows).is_err() {
        return Vec::new();
    }
    let distance = |g: &Guard| match g.limit {
        Limit::Row(i) => (rows[i] - t.bounds.cl[i]).min(t.bounds.cu[i] - rows[i]),
        Limit::LowerBound(j) => w[j] - t.bounds.xl[j],
    };
    let largest = |g: &Guard| {
        let alike = guards.iter().filter(|o| o.contact == g.contact && o.condition == g.condition);
        alike.map(distance).fold(0.0, f64::max)
    };
    let mut out: Vec<Touched> = Vec::new();
    for g in guards {
        let now = Touched { contact: g.contact, phase: g.phase, condition: g.condition };
        if distance(g) <= REACHED * largest(g) && !out.contains(&now) {
            out.push(now);
        }
    }
    out
}
