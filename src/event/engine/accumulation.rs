//! Accumulating switches.

use super::limit_set::{Origin, FAILED};
use super::{recover, Engine, Progress, EPS};
use crate::error::Result;
use crate::event::tape::Time;
use crate::event::watch::Watch;
use crate::event::{Accumulation, Outcome, Zeno};

/// Intervals between switches that are remembered.
pub(super) const MEMORY: usize = 8;

/// The last times at which one function of the state vanished, or the weight of one cell: a *source* of switches. Infinitely many switches in
/// finite time are so of at least one source, as there are finitely many. So it is the times of one source that say whether
/// switches accumulate: those of many sources that happen to act together say nothing.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct History {
    times: [f64; MEMORY + 1],
    n: usize,
    /// What was before [`Recent::forget`] is of another epoch.
    epoch: usize,
}

impl History {
    fn note(&mut self, t: f64, epoch: usize) {
        if self.epoch != epoch {
            (self.n, self.epoch) = (0, epoch);
        }
        self.times[self.n % (MEMORY + 1)] = t;
        self.n += 1;
    }

    /// The time so many switches before the last one; none where there were not so many.
    pub(super) fn back(&self, switches: usize) -> Option<f64> {
        (switches < self.n.min(MEMORY + 1)).then(|| self.times[(self.n - 1 - switches) % (MEMORY + 1)])
    }

    /// The last time between two of them, or one of those before it.
    pub(super) fn gap(&self, back: usize) -> Option<f64> {
        self.back(back).zip(self.back(back + 1)).map(|(now, before)| now - before)
    }

    /// All intervals that are remembered, the oldest first, if there are as many as that.
    pub(super) fn gaps(&self) -> Option<[f64; MEMORY]> {
        self.back(MEMORY)?;
        Some(std::array::from_fn(|i| {
            let time = |back| self.back(back).unwrap_or(f64::NAN);
            time(MEMORY - 1 - i) - time(MEMORY - i)
        }))
    }
}

/// The last switches but for their times.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Kind {
    source: usize,
    /// Functions that vanished.
    zeros: usize,
    /// Nothing slid behind it.
    free: bool,
    /// It was a transition.
    jumped: bool,
}

/// Where switches were lately.
#[derive(Default)]
pub(super) struct Recent {
    pub(super) gaps: [f64; MEMORY],
    pub(super) n: usize,
    pub(super) last: f64,
    kinds: [Kind; MEMORY],
    /// By source, see [`Engine::source`].
    sources: Vec<History>,
    epoch: usize,
    /// When an indicator vanished last.
    vanished: Vec<f64>,
    /// Where the run began, or went on with other data: the time, and the indicators.
    pub(super) start: (f64, Vec<f64>),
    /// The usual sizes of states, and the part of them that they are taken for, see [`Engine::set_sizes`].
    pub(super) sizes: Vec<f64>,
    pub(super) sized: f64,
    /// How fast the rates of the last crossings fall, see [`Engine::sharpness`].
    pub(super) falling: Falling,
    /// Where the intervals lead to, taken one by one, two by two, and by the rates of what vanishes.
    pub(super) series: [Series; 3],
    /// Of every indicator when it vanished last, and its rate there.
    pub(super) rates: Vec<(f64, f64)>,
}

/// Crossings of one surface at rates that fall quickly: the intervals behind them fall as quickly.
#[derive(Debug, Clone, Copy)]
pub(super) struct Falling {
    /// The function that vanished last, and its rate there.
    last: Option<(usize, f64)>,
    /// The interval before it.
    gap: f64,
    n: usize,
    /// The rate of the next crossing relative to the first, as it is to be expected.
    share: f64,
    /// The last rate relative to the first.
    reached: f64,
    /// How long that says something.
    lasts: f64,
}

impl Default for Falling {
    fn default() -> Falling {
        Falling { last: None, gap: f64::INFINITY, n: 0, share: 1.0, reached: 1.0, lasts: 0.0 }
    }
}

/// So much slower than the last crossing says that the next one is slower again.
const ONCE: f64 = 0.1;
/// How much longer than that says the next interval may be.
const LONGER: f64 = 4.0;
/// What a function reaches between two switches, relative to its tolerance, for the time between them to mean anything.
const RESOLVED: f64 = 1e3;

impl Falling {
    /// A crossing a time `since` the last one turns out to be so much slower than that: the way to it is followed as closely. Says whether it
    /// was not.
    fn expect(&mut self, ratio: f64, since: f64) -> bool {
        /// What makes a difference.
        const MUCH: f64 = 0.5;
        let share = self.reached * ratio;
        let surprise = ratio < ONCE && share < MUCH * self.share(since);
        if surprise {
            (self.share, self.lasts) = (share, LONGER * since);
        }
        surprise
    }

    /// Another crossing, after an interval of length `gap`, at the end of which an error of one tolerance makes one of `noise` in time; `before`
    /// is the rate that it is compared with: at the last crossing of the same surface, or on the way to the first one.
    fn note(&mut self, crossed: Option<(usize, f64)>, (gap, noise): (f64, f64), before: Option<f64>) {
        /// So much slower than the last one several times in a row, where intervals become as much shorter. Those of damped
        /// oscillations do not.
        const OFTEN: f64 = 0.5;
        let ratio = match (crossed, before) {
            (Some((_, rate)), Some(before)) => (rate / before).abs(),
            _ => f64::NAN,
        };
        let shrinks = gap * gap <= OFTEN * self.gap * self.gap;
        (self.last, self.gap) = (crossed, gap);
        if ratio < ONCE || ratio < OFTEN && shrinks {
            self.n += 1;
            self.reached *= ratio;
            // next to the end the time between two of them is shorter than what that leaves of it
            self.share = (self.reached * ratio).min(ratio * ratio * gap / (RESOLVED * noise));
            self.lasts = if self.n > 1 || ratio < ONCE { LONGER * ratio * gap } else { 0.0 };
        } else {
            (self.n, self.share, self.reached, self.lasts) = (0, 1.0, 1.0, 0.0);
        }
    }

    /// The share a time `since` the last crossing.
    fn share(&self, since: f64) -> f64 {
        if since <= self.lasts {
            self.share
        } else {
            1.0
        }
    }
}

/// The limit of a geometric series of intervals. Early ones may not be of the series yet, and next to the limit, where what is left of
/// the state is below its tolerance, intervals are noise: the limits that differ least are taken.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Series {
    last: Option<f64>,
    best: Option<Limit>,
    /// The best one is the last one.
    latest: bool,
}

#[derive(Debug, Clone, Copy)]
struct Limit {
    t: f64,
    /// The one before it, and the difference.
    earlier: f64,
    spread: f64,
    /// The time it was found from.
    from: f64,
    /// What the tolerances make of the time of the last switch behind it.
    noise: f64,
}

impl Series {
    /// At time `t`, known to `noise`, the last three members are these, the oldest first.
    fn note(&mut self, (t, noise): (f64, f64), [a, b, c]: [f64; 3]) {
        self.note_limit((c < b && b < a).then(|| t + c * c / (b - c)), (a + b + c, noise), None);
    }

    /// A limit, from the time `from`, and what the first one may be off by; none where it says nothing without another one.
    ///
    /// Later ones are nearer to the limit and know less of it, as its switches are closer together. Where one does not contradict one
    /// that is known better, that stays (the balancing principle of O. V. Lepskii, Theory Probab. Appl. 35 (1990) 454-466).
    fn note_limit(&mut self, limit: Option<f64>, (from, noise): (f64, f64), first: Option<f64>) {
        /// An error of a state in local tolerances.
        const ERRORS: f64 = 10.0;
        let found = match (limit, self.last, first) {
            (Some(t), Some(earlier), _) => Some(Limit { t, earlier, spread: (t - earlier).abs(), from, noise }),
            (Some(t), None, Some(spread)) => Some(Limit { t, earlier: t, spread, from, noise }),
            _ => None,
        };
        self.last = limit;
        match (found, &mut self.best) {
            (Some(f), Some(best))
                if best.noise <= f.noise && (f.t - best.t).abs() <= ERRORS * (f.noise + best.noise) =>
            {
                best.spread = best.spread.min(ERRORS * best.noise);
                self.latest = false;
            }
            (Some(f), Some(best)) if f.spread < best.spread => (*best, self.latest) = (f, true),
            (Some(f), None) => (self.best, self.latest) = (Some(f), true),
            (_, Some(best)) if self.latest => {
                // it has become worse: so it may have before
                best.t = best.earlier;
                self.latest = false;
            }
            _ => {}
        }
    }
}

impl Recent {
    /// Of `n_q` indicators and `n_cells` cells; `sizes` are the usual ones of states.
    pub(super) fn new(n_q: usize, n_cells: usize, sizes: Vec<f64>) -> Recent {
        Recent {
            sources: vec![History::default(); n_q + n_cells],
            vanished: vec![f64::NEG_INFINITY; n_q],
            start: (f64::NAN, vec![f64::NAN; n_q]),
            sizes,
            sized: 1.0,
            rates: vec![(f64::NAN, f64::NAN); n_q],
            ..Recent::default()
        }
    }

    /// What was says nothing about what comes.
    pub(super) fn forget(&mut self) {
        self.n = 0;
        self.epoch += 1;
    }

    /// Of one source, as far as it says something.
    pub(super) fn of(&self, source: usize) -> History {
        Some(self.sources[source]).filter(|h| h.epoch == self.epoch).unwrap_or_default()
    }

    /// A unit has switched by itself at time `t`.
    pub(super) fn note_source(&mut self, source: usize, t: f64) {
        self.sources[source].note(t, self.epoch);
    }

    /// Were the last switches crossings of the same surfaces, without sliding?
    pub(super) fn are_crossings_of_one(&self, switches: usize) -> bool {
        let kind = |back: usize| self.kinds[(self.n + MEMORY - 1 - back) % MEMORY];
        kind(0).free && (1..switches).all(|back| kind(back) == kind(0))
    }

    /// Of the source of the last switch.
    pub(super) fn of_last(&self) -> History {
        match self.n {
            0 => History::default(),
            n => self.of(self.kinds[(n - 1) % MEMORY].source),
        }
    }

    /// Follows the series of the intervals behind a crossing of function `j` with this rate, if it is resolved.
    fn follow(&mut self, resolved: Option<(usize, f64)>, noise: f64) {
        /// What the first limit by rates may be off by, relative to the time that it says is left.
        const FIRST: f64 = 1e-3;
        if self.n <= 1 {
            self.series = Default::default();
            self.rates.fill((f64::NAN, f64::NAN));
        }
        let Some((j, rate)) = resolved else {
            self.series.iter_mut().for_each(|s| (s.last, s.latest) = (None, false));
            return;
        };
        // where its second derivative is bounded and does not vanish, the time between two zeros goes with the rate there
        let (before, fast) = std::mem::replace(&mut self.rates[j], (self.last, rate.abs()));
        let (gap, ratio) = (self.last - before, rate.abs() / fast);
        let left = if ratio < 1.0 { gap * ratio / (1.0 - ratio) } else { f64::NAN };
        let limit = (left > 0.0).then_some(self.last + left);
        self.series[2].note_limit(limit, (gap, noise), Some(FIRST * left));
        let back = |i: usize| self.gaps[(self.n + MEMORY - 1 - i) % MEMORY];
        let [single, double] = [0, 1].map(|wide| {
            let member = |m: usize| (0..=wide).map(|i| back(m * (wide + 1) + i)).sum::<f64>();
            (self.n >= 3 * (wide + 1)).then(|| [member(2), member(1), member(0)])
        });
        for (series, members) in self.series.iter_mut().zip([single, double]) {
            members.into_iter().for_each(|m| series.note((self.last, noise), m));
        }
    }

    /// Where switches accumulate that have come to `t`: what their series says if it says more. A limit that they have passed is none.
    pub(super) fn limit(&self, t: f64) -> f64 {
        /// What is left, relative to the time the series was followed for.
        const LEFT: f64 = 1e-2;
        /// How well it is known, relative to what is left.
        const KNOWN: f64 = 0.1;
        let says = |l: &Limit| {
            let left = (l.t - t).abs();
            l.t >= self.last && left <= LEFT * l.from && l.spread <= KNOWN * left
        };
        let best = self.series.iter().filter_map(|s| s.best).filter(says);
        best.min_by(|a, b| a.spread.total_cmp(&b.spread)).map_or(t, |l| l.t)
    }

    /// The last switch was a transition.
    pub(super) fn note_jump(&mut self) {
        self.kinds[(self.n + MEMORY - 1) % MEMORY].jumped = true;
    }

    /// Were several of the last switches transitions? One of them, such as that which begins a phase of a controller, is only followed by what
    /// accumulates.
    pub(super) fn are_transitions(&self) -> bool {
        let place = |back: usize| (self.n + MEMORY - back) % MEMORY;
        (1..=self.n.min(MEMORY)).filter(|back| self.kinds[place(*back)].jumped).count() > 1
    }

    /// Time between two switches of whatever source, the `i`-th of those that are remembered.
    pub(super) fn gap(&self, i: usize) -> f64 {
        self.gaps[(self.n + i) % MEMORY]
    }

    /// A time before the last so many switches of whatever source, and behind the one before them; at most [`MEMORY`].
    pub(super) fn before_last(&self, switches: usize) -> f64 {
        let later: f64 = (MEMORY + 1 - switches..MEMORY).map(|i| self.gap(i)).sum();
        self.last - later - 0.5 * self.gap(MEMORY - switches)
    }

    /// Time between the last two switches or jumps.
    pub(super) fn last_gap(&self) -> f64 {
        self.gaps[(self.n + MEMORY - 1) % MEMORY]
    }
}

/// Ratio of two sums of intervals, one behind the other, below which they become shorter.
const SHRINKS: f64 = 0.95;

/// What is left of the intervals between switches of one source, the oldest first, if they become shorter as a geometric series does. One long
/// interval with short ones behind it is none: there it is by chance that several of them are close.
pub(super) fn rest_of_series(gaps: &[f64; MEMORY]) -> Option<f64> {
    /// How much larger the last ratio of two intervals and the next two may be than those before it.
    const LARGER: f64 = 4.0;
    let pair = |i: usize| gaps[2 * i] + gaps[2 * i + 1];
    let ratio = |i: usize| pair(i + 1) / pair(i);
    let (old, new) = (pair(0) + pair(1), pair(2) + pair(3));
    let (last, earlier) = (ratio(2), ratio(0).min(ratio(1)));
    let whole = new / old;
    (whole < SHRINKS && last < SHRINKS && last <= LARGER * earlier).then(|| new * whole / (1.0 - whole))
}

/// The same where the last half of the intervals is shorter than the first.
fn rest_by_halves(gaps: &[f64; MEMORY]) -> Option<f64> {
    let half = |i: usize| gaps[i * MEMORY / 2..(i + 1) * MEMORY / 2].iter().sum::<f64>();
    let ratio = half(1) / half(0);
    (ratio < SHRINKS).then(|| half(1) * ratio / (1.0 - ratio))
}

impl Engine {
    /// What is watched, as a source of switches: by indicator, then by cell.
    pub(super) fn source(&self, w: &Watch) -> usize {
        match *w {
            Watch::Leave { cell, .. } => self.functions.q0.len() + cell,
            Watch::Enter { a, .. } | Watch::Guard { a, .. } | Watch::Contact { a, .. } => a,
        }
    }

    /// Notes the time of a switch of this source, and what vanished there: `j` among it, with this rate, if it is known.
    pub(super) fn remember(&mut self, source: usize, crossed: Option<(usize, f64)>) {
        let (gap, sharpness) = (self.t - self.calendar.recent.last, self.sharpness());
        let usual = crossed.map_or(f64::INFINITY, |(j, rate)| self.reach_of(j) / rate.abs());
        let noise = sharpness * usual;
        let resolved = crossed.filter(|_| gap >= RESOLVED * noise);
        let i = self.calendar.recent.n % MEMORY;
        self.calendar.recent.gaps[i] = gap;
        self.calendar.recent.last = self.t;
        let mut zeros = 0;
        for (last, _) in self.calendar.recent.vanished.iter_mut().zip(&self.functions.zero).filter(|(_, zero)| **zero) {
            *last = self.t;
            zeros += 1;
        }
        self.calendar.recent.kinds[i] = Kind { source, zeros, free: self.field.n_alg() == 0, jumped: false };
        self.calendar.recent.sources[source].note(self.t, self.calendar.recent.epoch);
        self.calendar.recent.n += 1;
        self.calendar.recent.follow(resolved, noise);
        let before = crossed.and_then(|(j, _)| self.rate_before(j, self.t, self.calendar.recent.n == 1));
        let before = before.filter(|_| self.calendar.recent.n == 1 || self.calendar.recent.are_crossings_of_one(2));
        // the times of what no state moves are exact, whatever the tolerances
        let crossed = crossed.filter(|_| usual > 0.0);
        self.calendar.recent.falling.note(crossed, (gap, usual), before);
        self.follow_sharpness();
    }

    /// The rate that the one of a crossing of function `j` is compared with, if it says something: that of the crossing before it, if it was
    /// of the same surface, and for the `first` crossing of a run the mean one on the way.
    fn rate_before(&self, j: usize, at: f64, first: bool) -> Option<f64> {
        if first {
            let (t, values) = &self.calendar.recent.start;
            return Some(values[j] / (at - t)).filter(|_| self.field.n_alg() == 0);
        }
        self.calendar.recent.falling.last.filter(|last| last.0 == j).map(|last| last.1)
    }

    /// Is the crossing at the end of the step, where watch `l` vanishes with this rate, much slower than the one before it, and not known as well?
    /// An error that is small at that one is `1 / ġ` times as large in the time of this one: the step is taken again, with tolerances
    /// that are in proportion to the rate. What was before it matters less, where motions that come so slowly to a surface approach each other.
    pub(super) fn comes_slowly(&mut self, l: usize, rate: f64) -> bool {
        let Watch::Enter { a, b: None, .. } = self.functions.watches[l] else { return false };
        let at = self.t + self.stepper.step.h;
        let Some(before) = self.rate_before(a, at, self.calendar.recent.n == 0) else { return false };
        let free = self.calendar.recent.n == 0 || self.calendar.recent.are_crossings_of_one(1);
        let since = at - self.calendar.recent.last;
        free && self.functions.depart[l] == 0
            && self.reach_of(a) > 0.0
            && self.calendar.recent.falling.expect((rate / before).abs(), since)
    }

    /// Part of the absolute tolerances that the state is followed to.
    ///
    /// An error `δ` of a switching function makes an error `δ / ġ` of the time at which it vanishes. Where switches accumulate
    /// the rate `ġ` goes to zero with the time between them, so a fixed `δ` loses the switches when they are `√δ` apart, and with them
    /// the time of the accumulation. With a `δ` in proportion to the rate all of them are known as well as the first.
    #[inline]
    pub(super) fn sharpness(&self) -> f64 {
        self.calendar.recent.falling.share(self.t - self.calendar.recent.last)
    }

    /// The sizes that states have at least fall with the tolerances where several crossings in a row were slower.
    #[inline]
    pub(super) fn follow_sharpness(&mut self) {
        let part = if self.calendar.recent.falling.n > 1 { self.sharpness() } else { 1.0 };
        self.set_sizes(part);
    }

    /// Makes the sizes that states have at least, which rounding is relative to, this part of the usual ones: those of values that are
    /// followed to the same part of their absolute tolerances.
    #[inline]
    pub(super) fn set_sizes(&mut self, part: f64) {
        if part != self.calendar.recent.sized {
            self.calendar.recent.sized = part;
            self.field
                .floor
                .iter_mut()
                .zip(&self.calendar.recent.sizes)
                .for_each(|(floor, usual)| *floor = part * usual);
        }
    }

    /// Ends the run where transitions accumulate.
    pub(super) fn end_at_accumulation(&mut self, limit: f64) -> Progress {
        self.accumulations_push(Accumulation { t: limit, until: self.t, steps: 0, error: 0.0 });
        let text =
            format!("transitions accumulate at t = {limit}: what comes behind needs a discrete state of its own");
        self.fail(Outcome::Zeno, text)
    }

    pub(super) fn accumulations_push(&mut self, a: Accumulation) {
        if self.log.accumulations.len() < self.options.max_log {
            self.log.accumulations.push(a);
        }
    }

    /// Marks what has vanished since some time, and what the present sliding modes tie.
    pub(super) fn mark_since(&mut self, from: f64) {
        self.functions
            .zero
            .iter_mut()
            .zip(&self.calendar.recent.vanished)
            .for_each(|(zero, last)| *zero = *last >= from);
        self.keep_surfaces();
    }

    /// Since when the source of the last switch is remembered, if it has switched as often as that.
    pub(super) fn since(&self) -> Option<f64> {
        self.calendar.recent.of_last().back(MEMORY)
    }

    /// Has the same transition happened more than once since some time? One of them, such as that which begins a phase of a controller, is
    /// only followed by what accumulates.
    pub(super) fn jumped_since(&self, from: f64) -> bool {
        let mut places = self.field.guards.all.iter().flat_map(|g| g.places());
        places.any(|a| self.calendar.recent.of(a).back(1).is_some_and(|t| t >= from))
    }

    /// Does the present mode slide on all surfaces that the last switches were at? The last of them began it, where the
    /// surfaces could not be told apart any more.
    fn is_past_accumulation(&mut self, from: f64) -> bool {
        self.mark_since(from);
        let all = self.functions.zero.clone();
        self.functions.zero.fill(false);
        self.keep_surfaces();
        self.functions.zero == all
    }

    /// Has time not moved since then, but for rounding?
    fn is_stuck_since(&self, from: f64) -> bool {
        self.t - from <= 64.0 * EPS * self.t.abs()
    }

    /// Does a state move by what the tolerances see, at its present rate for so long?
    fn moves_within(&self, left: f64) -> bool {
        (0..self.nx).any(|i| {
            let tol = self.atol[i] + self.rtol[i] * self.x[i].abs();
            self.f[i].abs() * left > 1e-2 * tol.max(4.0 * EPS * self.x[i].abs())
        })
    }

    /// Does a switch of a scene, that of watch `w`, which is crossed, accumulate at the present point, so that nothing moves any more as far as
    /// the tolerances see? Then the run ends: which mode follows is not looked for there. Crossings between impacts or transitions accumulate
    /// with these, which go on by rules of their own.
    pub(super) fn scene_accumulates(&mut self, w: &Watch, name: &str) -> Option<Progress> {
        self.functions.zero.fill(false);
        self.remember(self.source(w), None);
        let (gaps, from) = self.calendar.recent.of_last().gaps().zip(self.since())?;
        if self.contact_events.scene.hit >= from || self.jumped_since(from) {
            return None;
        }
        let left = if self.is_stuck_since(from) { 0.0 } else { rest_by_halves(&gaps)? };
        if self.moves_within(left) {
            return None;
        }
        self.log.stats.accumulations += 1;
        let limit = self.t + left;
        let text = format!(
            "the {name} happens again and again, ever faster, until t = {limit}: what follows is not known, as its rate does not depend on \
             its weight; switch with a function whose rate does, or smoothly"
        );
        Some(self.fail(Outcome::Zeno, text))
    }

    /// Do switches accumulate here? Then the policy decides.
    pub(super) fn accumulate(&mut self) -> Result<Option<Progress>> {
        if let Some(p) = self.approach_limit_set()? {
            return Ok(Some(p));
        }
        let history = self.calendar.recent.of_last();
        let Some((gaps, from)) = history.gaps().zip(self.since()) else { return Ok(None) };
        let stuck = self.is_stuck_since(from);
        let jumps = self.jumped_since(from);
        let left = match stuck {
            true => Some(0.0),
            // independent guards fire as they like; what slides does not
            false if jumps => rest_of_series(&gaps),
            false => rest_by_halves(&gaps),
        };
        let Some(left) = left else { return Ok(None) };
        if !stuck && self.moves_within(left) {
            return Ok(None);
        }
        let loosest = self.rtol.iter().fold(1e-14f64, |m, v| m.max(*v));
        if left > 1e-2 * loosest * self.t.abs() && !stuck {
            return Ok(None);
        }
        self.log.stats.accumulations += 1;
        self.calendar.recent.forget();
        let limit = self.t + left;
        if jumps {
            return Ok(Some(self.end_at_accumulation(limit)));
        }
        let text = format!("switches accumulate at t = {limit}");
        if self.options.zeno != Zeno::Stop {
            if self.is_past_accumulation(from) {
                let t = self.calendar.recent.limit(limit);
                self.accumulations_push(Accumulation { t, until: self.t, steps: 0, error: 0.0 });
                return Ok(None);
            }
            self.mark_since(from);
            if let Some(p) = self.enter_limit_set(FAILED, limit, Origin::Outside)? {
                return Ok(Some(p));
            }
        }
        if self.options.zeno == Zeno::TimeStepping {
            return self.step_through(limit).map(Some);
        }
        let t = self.calendar.recent.limit(limit);
        self.accumulations_push(Accumulation { t, until: self.t, steps: 0, error: 0.0 });
        if self.options.zeno == Zeno::Stop {
            return Ok(Some(self.fail(Outcome::Zeno, text)));
        }
        let before = self.field.active.clone();
        self.mark_since(from);
        let kept = self.kept_modes();
        let formed = self.form_modes(&kept);
        if !recover(formed, false)? {
            return Ok(Some(self.fail(Outcome::Zeno, text)));
        }
        let candidates = self.candidates();
        let r = self.choose(&candidates, self.stepper.h.max(1e3 * EPS * self.t.abs()));
        let unique = recover(r, false)?;
        if self.log.outcome != Outcome::Reached {
            return Ok(Some(Progress::Done));
        }
        let tied: usize = self.field.active.iter().map(Vec::len).sum();
        if tied <= before.iter().map(Vec::len).sum() {
            let failed = self.fail(Outcome::Zeno, text + ", and no sliding mode begins there");
            return Ok(Some(self.go_through(&before, true)?.unwrap_or(failed)));
        }
        self.mark_time(Time::Unknown);
        let r = self.enter().and_then(|()| self.project_sensitivity());
        self.log.one_sided = true;
        if !recover(r.map(|()| true), false)? {
            let failed = self.fail(Outcome::Zeno, text + ", where the sliding mode is not defined");
            return Ok(Some(self.go_through(&before, true)?.unwrap_or(failed)));
        }
        self.log(&before, f64::NAN, None, unique);
        Ok(Some(Progress::Switched))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_source_remembers_eight_intervals_of_its_own_epoch() {
        let mut h = History::default();
        assert_eq!((h.back(0), h.gap(0), h.gaps()), (None, None, None));
        (0..20).for_each(|k| h.note(f64::from(k * k), 0));
        assert_eq!(h.back(0), Some(361.0));
        assert_eq!(h.back(MEMORY), Some(121.0));
        assert_eq!(h.back(MEMORY + 1), None);
        assert_eq!(h.gap(1), Some(35.0));
        assert_eq!(h.gaps(), Some(std::array::from_fn(|i| (23 + 2 * i) as f64)));
        h.note(500.0, 1);
        assert_eq!((h.back(0), h.back(1)), (Some(500.0), None));
    }

    #[test]
    fn the_rest_of_a_geometric_series() {
        let series = |ratio: f64| -> [f64; MEMORY] { std::array::from_fn(|i| ratio.powi(i as i32)) };
        for ratio in [0.2f64, 0.5, 0.9] {
            let rest = ratio.powi(MEMORY as i32) / (1.0 - ratio);
            assert!((rest_of_series(&series(ratio)).unwrap() / rest - 1.0).abs() < 1e-12, "{ratio}");
        }
        assert_eq!(rest_of_series(&[1.0; MEMORY]), None);
        assert_eq!(rest_of_series(&series(1.1)), None);
        // one long interval, with short ones of no order behind it
        assert_eq!(rest_of_series(&[100.0, 1.0, 1.2, 0.9, 1.1, 1.0, 0.8, 1.1]), None);
    }

    /// Switches at rates that fall by a half, and so at intervals that do.
    fn falling(recent: &mut Recent, switches: i32) {
        for k in 0..switches {
            let gap = 0.5f64.powi(k);
            recent.gaps[recent.n % MEMORY] = gap;
            recent.last += gap;
            recent.n += 1;
            recent.follow(Some((0, -gap)), 1e-9);
        }
    }

    #[test]
    fn the_limit_of_a_series_is_found_and_none_that_switches_have_passed() {
        let mut r = Recent::new(1, 0, Vec::new());
        falling(&mut r, 20);
        // the last switch is at 2 - 2^-19
        let exact = 2.0;
        let late = exact + 1e-4;
        assert!((r.limit(late) - exact).abs() < 1e-12);
        // what is as near as that is known no better by the series
        assert_eq!(r.limit(exact), exact);
        r.last = exact + 1e-5;
        assert_eq!(r.limit(late), late);
    }

    #[test]
    fn rates_that_fall_quickly_sharpen_the_tolerances_for_a_while() {
        let mut f = Falling::default();
        assert_eq!(f.share(0.0), 1.0);
        f.note(Some((0, -1.0)), (1.0, 1e-9), None);
        assert_eq!(f.share(0.0), 1.0);
        f.note(Some((0, -0.01)), (0.1, 1e-9), Some(-1.0));
        let share = f.share(0.0);
        assert!(share > 0.0 && share <= 1e-4, "{share}");
        assert_eq!(f.share(1.0), 1.0);
        // at the same rate: over
        f.note(Some((0, -0.01)), (0.1, 1e-9), Some(-0.01));
        assert_eq!((f.n, f.share(0.0)), (0, 1.0));
    }
}
