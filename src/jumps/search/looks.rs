//! Second looks: would another start have bettered the answer?

use super::super::answer::{is_cheaper, Answer, NEARLY};
use super::super::modes::Key;
use super::super::shots::cheaper;
use super::{Search, NEAR_ITERATIONS};
use crate::error::Result;
use crate::nlp::Control;
use crate::stop;

/// What a search spends to find an answer that has nothing to do with the one it has: on simulations, whose steps times states count like
/// iterations times variables, and on programs.
struct Second {
    simulations: Share,
    programs: Share,
}

/// A share of the effort so far, and what so many programs of the search have taken on average, whichever is more: a search that was over soon has
/// seen little of what else there is, and shares of it would be a handful of simulations.
#[derive(Clone, Copy)]
struct Share {
    of_effort: f64,
    programs: f64,
}

const SECOND: Second = Second {
    simulations: Share { of_effort: 0.36, programs: 44.0 },
    programs: Share { of_effort: 0.5, programs: 30.0 },
};

/// How often it looks: again where the last look has bettered the answer by more than this share, each time for this part of the first and from so
/// many shots. A better answer has other controls, from which others are drawn: a valve costs 192 before, and 38.5 and 33.9 after two looks.
const LOOKS: usize = 4;
pub(super) const LOOKED_GAIN: f64 = 0.01;
const LATER_LOOK: f64 = 0.25;
const LATER_SHOTS: usize = 2;

impl Search<'_> {
    /// Asks whether another start would have bettered the best answer, and again from what is better as long as that pays.
    pub(super) fn look_elsewhere(&mut self, control: &mut Control) -> Result<()> {
        for look in 0..LOOKS {
            let Some(before) = self.solution().map(|a| a.cost) else { break };
            self.look_once(look > 0, control)?;
            let after = self.best.as_ref().map_or(before, |b| b.0.cost);
            if stop::requested().is_some() || !is_cheaper(after + LOOKED_GAIN * before.abs(), before, self.largest) {
                break;
            }
        }
        Ok(())
    }

    /// Shots that may cost less, each a start of its own, for what [`SECOND`] says, or, `again`, for a part of it. Nothing else notices that an
    /// answer is dear: all sequences next to it may cost more where the motion that costs a tenth of it has its impacts elsewhere, all of them.
    fn look_once(&mut self, again: bool, control: &mut Control) -> Result<()> {
        let Some(best) = self.solution() else { return Ok(()) };
        if !self.has_costs() {
            return Ok(());
        }
        let known = best.cost;
        let program = self.effort as f64 / self.attempts.max(1) as f64;
        let part = if again { LATER_LOOK } else { 1.0 };
        let share = |s: Share| part * (s.of_effort * self.effort as f64).max(s.programs * program);
        let steps = share(SECOND.simulations) / self.p.given.dims.x as f64;
        let shots = cheaper(self.p, self.options, best, steps as usize)?;
        self.most_effort = self.effort + share(SECOND.programs) as usize;
        let mut asked: Vec<Key> = Vec::new();
        for shot in shots.into_iter().take(if again { LATER_SHOTS } else { usize::MAX }) {
            let sequence = shot.track.sequence(self.p.n_stages());
            let key = sequence.key();
            if self.is_over() {
                break;
            }
            if asked.contains(&key) || !self.is_new(&sequence) {
                continue;
            }
            asked.push(key);
            self.compete(control, |s, control| {
                s.attempt(&sequence, &shot.track, NEAR_ITERATIONS, control)?;
                let promises = |a: &Answer| a.is_solved() || a.violation < NEARLY && a.cost < known;
                Ok(s.best.as_ref().is_some_and(|b| promises(&b.0)))
            })?;
        }
        self.most_effort = usize::MAX;
        Ok(())
    }
}
