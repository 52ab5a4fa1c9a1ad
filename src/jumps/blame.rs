//! Which contact keeps a problem from having a motion: the one without which there would be one.

use super::answer::Answer;
use super::exact::{solve_sequence, Limits};
use super::modal::Held;
use super::modes::{ContactMode, Sequence};
use super::problem::Problem;
use crate::error::Result;
use crate::mpcc::MpccSettings;
use crate::nlp::Control;
use crate::stop;

/// What of a contact keeps a problem from having a motion.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Blame {
    /// Its gap: if bodies could overlap there, there would be a motion.
    InTheWay(usize),
    /// Its friction: if it held as much as it had to, there would be a motion.
    Slippery(usize),
}

/// Iterations of such a program, and those without half the violation after which it is given up.
const ITERATIONS: usize = 100;
const PATIENCE: usize = 20;

/// Solves for the sequence of the point that came closest without one contact after the other, and then without the limit of its friction.
pub(super) fn blame(
    p: &Problem,
    closest: &Answer,
    settings: MpccSettings,
    control: &mut Control,
) -> Result<Option<Blame>> {
    let settings = MpccSettings { max_iter: settings.max_iter.min(ITERATIONS), certify: false, ..settings };
    let limits = Limits::of_patience(PATIENCE);
    let mut is_solved = |s: &Sequence, held: &Held| -> Result<bool> {
        if stop::requested().is_some() {
            return Ok(false);
        }
        Ok(solve_sequence(p, s, &closest.track, held, None, settings, limits, control)?.0.is_solved())
    };
    for c in 0..p.n_contacts() {
        let open = with_modes(&closest.sequence, c, |_| ContactMode::Open);
        if is_solved(&open, &Held { without_gap: Some(c), ..Held::default() })? {
            return Ok(Some(Blame::InTheWay(c)));
        }
    }
    for c in (0..p.n_contacts()).filter(|&c| p.has_friction(c)) {
        let held = Held { without_cone: Some(c), ..Held::default() };
        let sticks = |m: ContactMode| if m.is_closed() { ContactMode::Closed } else { m };
        if is_solved(&with_modes(&closest.sequence, c, sticks), &held)? {
            return Ok(Some(Blame::Slippery(c)));
        }
    }
    Ok(None)
}

/// The sequence with other modes of one contact, in phases and in impacts.
fn with_modes(s: &Sequence, c: usize, of: impl Fn(ContactMode) -> ContactMode) -> Sequence {
    let mut out = s.clone();
    for phase in out.stages.iter_mut().flatten() {
        phase.modes[c] = of(phase.modes[c]);
        if let Some(parts) = &mut phase.jump {
            parts[c] = of(parts[c]);
        }
        if phase.jump.as_ref().is_some_and(|parts| !parts.iter().any(|m| m.is_closed())) {
            phase.jump = None;
        }
    }
    out.tidy();
    out
}
