//! Right-hand sides that jump although they are stated as smooth.
//!
//! At a jump the error of a step is of order one in its length, so error control makes the steps as short as the tolerance
//! divided by the jump; where the fields on both sides lead to the jump, all further steps are so short. That looks like
//! slow progress, which honest problems show too. So slow progress only asks the question, and the right-hand side
//! answers it: a jump stays as large as it is between points that come together, and the change of a smooth function does
//! not, however steep.

use super::limit_set::Origin;
use super::{recover, Engine, Progress};
use crate::error::Result;
use crate::event::Outcome;

/// Attempts at steps between two looks at the progress.
const WINDOW: usize = 2000;
/// Slow: this many windows more would not reach the time asked for.
const PATIENCE: f64 = 500.0;
/// Windows in a row that are too slow: then the motion goes on in a limit set or by steps with a stated error, for it would end
/// without having arrived, or much later than it has come where it is.
const SLOW: usize = 4;
/// Too slow for the steps allowed is what locates so many zeros in a window: surfaces that are touched again and again make no
/// switch, but have to be located like one.
const LOCATIONS: usize = 20;
/// Too slow next to surfaces is what gets on by so little compared with before: a motion that switches ever faster.
const STALLED: f64 = 1e-3;
/// The same where nothing switches, with so many windows left: a field like `-sqrt |x|` that has come to its end, whose steps are as
/// short as the tolerances are small. It may be in a limit set, but nothing else is as good as its steps.
const CRAWLING: f64 = 1e-2;
const LEFT: f64 = 50.0;
/// Points at which the right-hand side is looked at, and how many mean steps of the window they reach to either side.
const POINTS: usize = 65;
const RADIUS: f64 = 16.0;
/// What a jump does to the state in a mean step, relative to the tolerance, if it is the reason for the short steps: 6e-4
/// to 1e5 where that was tried, as the error constants of the methods and the failed steps have their part in it.
const JUMP: std::ops::Range<f64> = 1e-6..1e5;

/// Where the attempts were counted from.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Window {
    pub(super) attempts: usize,
    pub(super) steps: usize,
    pub(super) t: f64,
    /// Switches made and zeros looked for.
    pub(super) locations: usize,
    /// Slow windows before this one, in a row.
    pub(super) slow: usize,
    /// The longest time that a window took so far.
    pub(super) longest: f64,
}

impl Engine {
    /// Ends the run where steps stay tiny because the right-hand side jumps. Costs a comparison but for one attempt in
    /// two thousand, and nothing but that while the run gets on.
    #[inline]
    pub(super) fn chatters(&mut self) -> Result<Option<Progress>> {
        if self.attempts() < self.calendar.window.attempts + WINDOW {
            return Ok(None);
        }
        self.look_for_jump()
    }

    /// Attempts at steps so far.
    fn attempts(&self) -> usize {
        self.log.stats.steps + self.log.stats.rejections + self.log.stats.relocations
    }

    #[cold]
    fn look_for_jump(&mut self) -> Result<Option<Progress>> {
        let (attempts, steps) = (self.attempts(), self.log.stats.steps);
        let (from, t) = (self.calendar.window, self.t);
        let locations = self.log.stats.switches + self.log.stats.relocations;
        let advanced = t - from.t;
        self.calendar.window = Window { attempts, steps, t, locations, slow: 0, longest: from.longest.max(advanced) };
        let rest = self.t_stop - t;
        let switching = self.calendar.window.locations >= from.locations + LOCATIONS;
        let crawls = !switching && advanced * LEFT < rest && advanced < CRAWLING * self.calendar.window.longest;
        if advanced * PATIENCE >= rest {
            return if crawls { self.pass_slowness(from, false) } else { Ok(None) };
        }
        let mean = advanced / (steps - from.steps).max(1) as f64;
        let mean = if mean > 0.0 { mean } else { self.stepper.h };
        let r = self.discontinuity(mean);
        let Some(at) = recover(r, None)? else {
            let left = self.options.max_steps.saturating_sub(attempts) as f64;
            let too_slow = advanced < STALLED * self.calendar.window.longest
                || switching && advanced * left < WINDOW as f64 * rest;
            return if too_slow || crawls { self.pass_slowness(from, too_slow) } else { Ok(None) };
        };
        if switching {
            let before = self.field.active.clone();
            if let Some(p) = self.go_through(&before, false)? {
                return Ok(Some(p));
            }
        }
        let text = format!(
            "the right-hand side looks discontinuous near t = {at}: it jumps between points that differ by rounding, and \
             steps of about {mean:.1e} are all it allows; state it as modes (switching functions)"
        );
        Ok(Some(self.fail(Outcome::StepTooSmall, text)))
    }

    /// After so many slow windows next to surfaces the motion goes on in a limit set or, if it may, is gone through by steps.
    fn pass_slowness(&mut self, from: Window, by_steps: bool) -> Result<Option<Progress>> {
        self.calendar.window.slow = from.slow + 1;
        if self.calendar.window.slow < SLOW {
            return Ok(None);
        }
        self.calendar.window.slow = 0;
        let before = self.field.active.clone();
        // there may be a limit set that was not seen
        if self.is_on_time(SLOW * WINDOW) {
            if let Some(p) = self.rescue(&before, Origin::Outside)? {
                self.stepper.h = self.no_time();
                return Ok(Some(p));
            }
        }
        if by_steps {
            self.go_through(&before, false)
        } else {
            Ok(None)
        }
    }

    /// The time of a jump of the right-hand side within some steps of length `mean` along the velocity.
    fn discontinuity(&mut self, mean: f64) -> std::result::Result<Option<f64>, crate::func::EvalError> {
        let point = |i: usize| RADIUS * mean * (2.0 * i as f64 / (POINTS - 1) as f64 - 1.0);
        let mut before = self.beside(point(0))?;
        // the largest change between neighbours
        let (mut worst, mut lo, mut hi) = (0.0, (0.0, before.clone()), (0.0, before.clone()));
        for i in 1..POINTS {
            let now = self.beside(point(i))?;
            let change = self.change(&before, &now);
            if change > worst {
                worst = change;
                (lo, hi) = ((point(i - 1), before), (point(i), now.clone()));
            }
            before = now;
        }
        // Rounding does not vanish between points that come together either. And a jump that makes the steps short makes an
        // error of about the tolerance in each of them: where it would make far more or far less, something else does.
        let size = self.change(&before, &vec![0.0; self.nx]).max(self.change(&hi.1, &vec![0.0; self.nx]));
        if worst <= 1e-6 * size || !JUMP.contains(&(worst * mean)) {
            return Ok(None);
        }
        for _ in 0..40 {
            let middle = 0.5 * (lo.0 + hi.0);
            let now = self.beside(middle)?;
            let (left, right) = (self.change(&lo.1, &now), self.change(&now, &hi.1));
            if left >= right {
                hi = (middle, now);
            } else {
                lo = (middle, now);
            }
            if self.change(&lo.1, &hi.1) < 0.5 * worst {
                return Ok(None);
            }
        }
        Ok(Some(self.t + lo.0))
    }

    /// The right-hand side at a time `by` later or earlier, along the velocity.
    fn beside(&mut self, by: f64) -> std::result::Result<Vec<f64>, crate::func::EvalError> {
        let x: Vec<f64> = self.x.iter().zip(&self.f).map(|(x, f)| x + by * f).collect();
        let mut out = vec![0.0; self.nx];
        self.field.rhs(self.t + by, &x, &mut out)?;
        Ok(out)
    }

    /// Difference of two velocities, relative to the tolerances of the states.
    fn change(&self, a: &[f64], b: &[f64]) -> f64 {
        let each = a.iter().zip(b).enumerate();
        each.fold(0.0f64, |m, (i, (a, b))| {
            m.max((a - b).abs() / (self.atol[i] + self.rtol[i] * self.x[i].abs()).max(f64::MIN_POSITIVE))
        })
    }
}
