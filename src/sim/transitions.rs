//! Transitions in a simulation by finite elements: a step ends where a guard passes zero, the state jumps there, and the rest of the step follows.
//!
//! The rules are those of [`Transition`]. Where a guard passes zero is found in the dense output of a step first; then the step is done
//! anew until its end, whose states have the order of the method, is on the guard.

use super::{is_stop, SimResult, Simulator, MAX_HALVINGS};
use crate::func::Point;
use crate::nlp::{Control, Outcome};
use crate::system::{System, Transition};

/// Transitions at one time at most: more of them follow each other for ever.
const CHAIN: usize = 1000;
/// Share of a step within which a time is its end.
const SAME: f64 = 1e-12;
/// Steps to a guard at most, and halvings of an interval in which one passes zero.
const TO_GUARD: usize = 12;
const HALVINGS: usize = 60;

/// What is watched.
pub(super) struct Watch {
    transitions: Vec<Transition>,
    /// States that transitions alone change.
    discrete: Vec<usize>,
    /// Of every transition: is it watched, and has its guard not been beyond zero since it was made, or is it not watched?
    ready: Vec<bool>,
    value: [f64; 1],
    work: Vec<f64>,
    jump: Vec<f64>,
}

/// Where a step began.
struct Mark {
    t: f64,
    x: Vec<f64>,
    last: Vec<bool>,
    elements: usize,
    switches: usize,
}

impl Watch {
    /// Of a system with transitions that finite elements follow.
    pub fn new(system: &System) -> Watch {
        let transitions = system.transitions().to_vec();
        let functions = transitions.iter().flat_map(|t| std::iter::once(&t.guard).chain(t.reset.iter().map(|r| &r.f)));
        Watch {
            ready: vec![true; transitions.len()],
            discrete: system.discrete_states(),
            value: [0.0],
            work: vec![0.0; functions.map(|f| f.work_len()).max().unwrap_or(0)],
            jump: vec![0.0; system.dims().x],
            transitions,
        }
    }

    /// Is everything watched anew: the state is another one?
    pub fn begin(&mut self) {
        self.ready.fill(true);
    }

    fn is_armed(&self, k: usize, x: &[f64]) -> bool {
        self.transitions[k].from.iter().all(|(i, v)| x[*i] == *v)
    }

    /// The guard, positive beyond zero; NaN where it has no value.
    fn guard(&mut self, k: usize, at: &Point) -> f64 {
        let t = &self.transitions[k];
        match t.guard.value(at, &mut self.value, &mut self.work) {
            Ok(()) => t.direction.sign() * self.value[0],
            Err(_) => f64::NAN,
        }
    }

    /// Makes a transition; false where its reset has no value.
    fn make(&mut self, k: usize, (t, x, u, p): (f64, &mut [f64], &[f64], &[f64])) -> bool {
        let transition = &self.transitions[k];
        if let Some(r) = &transition.reset {
            let out = &mut self.jump[..r.rows.len()];
            if r.f.value(&Point { t, x, u, p }, out, &mut self.work).is_err() || !out.iter().all(|v| v.is_finite()) {
                return false;
            }
            r.rows.iter().zip(out).for_each(|(i, v)| x[*i] = *v);
        }
        transition.to.iter().for_each(|(i, v)| x[*i] = *v);
        true
    }
}

impl Simulator {
    /// A step with the transitions in it.
    pub(super) fn pass(&mut self, h: f64, control: &mut Control, r: &mut SimResult) {
        let Some(mut watch) = self.watch.take() else { return self.divide(h, MAX_HALVINGS, control, r) };
        let ready = watch.ready.clone();
        self.pass_watched(&mut watch, h, control, r);
        if r.outcome != Outcome::Solved {
            watch.ready = ready;
        }
        self.watch = Some(watch);
    }

    fn pass_watched(&mut self, watch: &mut Watch, h: f64, control: &mut Control, r: &mut SimResult) {
        let end = self.t + h;
        loop {
            if !self.jump_at_once(watch, r) {
                return;
            }
            if end - self.t <= SAME * h {
                return;
            }
            let mark = self.mark(r);
            self.step_to(end, watch, control, r);
            if r.outcome != Outcome::Solved {
                return;
            }
            let Some((k, at)) = self.first_passage(watch, &mark, r) else { return };
            if !self.end_on_guard(watch, k, (at, h), &mark, control, r) {
                return;
            }
            if !self.jump(watch, k, r) {
                return;
            }
        }
    }

    fn mark(&self, r: &SimResult) -> Mark {
        let (elements, switches) = (r.trajectory.elements.len(), r.trajectory.switches.len());
        Mark { t: self.t, x: self.x.clone(), last: self.last.clone(), elements, switches }
    }

    fn go_back(&mut self, mark: &Mark, r: &mut SimResult) {
        self.t = mark.t;
        self.x.copy_from_slice(&mark.x);
        self.last.clone_from(&mark.last);
        r.trajectory.elements.truncate(mark.elements);
        r.trajectory.switches.truncate(mark.switches);
    }

    /// A part of a step without transitions, in which discrete states keep their values to the bit.
    fn step_to(&mut self, end: f64, watch: &Watch, control: &mut Control, r: &mut SimResult) {
        let kept: Vec<f64> = watch.discrete.iter().map(|i| self.x[*i]).collect();
        self.divide(end - self.t, MAX_HALVINGS, control, r);
        watch.discrete.iter().zip(kept).for_each(|(i, v)| self.x[*i] = v);
    }

    /// Makes transitions that hold already; false where that has no end, or no value.
    fn jump_at_once(&mut self, watch: &mut Watch, r: &mut SimResult) -> bool {
        for _ in 0..CHAIN {
            let mut next = None;
            for k in 0..watch.transitions.len() {
                let armed = watch.is_armed(k, &self.x);
                let g = watch.guard(k, &Point { t: self.t, x: &self.x, u: &self.u, p: &self.p });
                // one that is not watched, or whose guard is back, may be made again
                watch.ready[k] |= !armed || g < 0.0;
                if next.is_none() && armed && watch.ready[k] && g > 0.0 {
                    next = Some(k);
                }
            }
            let Some(k) = next else { return true };
            if !self.jump(watch, k, r) {
                return false;
            }
        }
        r.outcome = Outcome::Stalled;
        false
    }

    fn jump(&mut self, watch: &mut Watch, k: usize, r: &mut SimResult) -> bool {
        let armed: Vec<bool> = (0..watch.transitions.len()).map(|j| watch.is_armed(j, &self.x)).collect();
        if !watch.make(k, (self.t, &mut self.x, &self.u, &self.p)) {
            r.outcome = Outcome::Failed;
            return false;
        }
        self.last.clear();
        r.jumps.push((self.t, k));
        // those that begin to be watched are made if they hold; the one that was made is watched again when its guard has been back
        for (j, armed) in armed.into_iter().enumerate() {
            watch.ready[j] |= !armed;
        }
        watch.ready[k] = !watch.is_armed(k, &self.x);
        true
    }

    /// The first time in the new elements at which a guard passes zero, and its transition.
    fn first_passage(&mut self, watch: &mut Watch, mark: &Mark, r: &SimResult) -> Option<(usize, f64)> {
        let mut first: Option<(usize, f64)> = None;
        let (u, p) = (self.u.clone(), self.p.clone());
        let (mut x, was_ready) = (mark.x.clone(), watch.ready.clone());
        for k in (0..watch.transitions.len()).filter(|k| watch.is_armed(*k, &mark.x)).collect::<Vec<_>>() {
            let mut at = |t: f64| -> f64 {
                match r.trajectory.state(t, &mut x) {
                    Ok(()) => watch.guard(k, &Point { t, x: &x, u: &u, p: &p }),
                    Err(_) => f64::NAN,
                }
            };
            // where the guard goes back behind the passage of another one, it has not been back: what lasts is seen at the next start
            let (mut before, mut ready) = (mark.t, was_ready[k]);
            'elements: for e in &r.trajectory.elements[mark.elements..] {
                for c in &r.trajectory.tableau().c {
                    let t = e.t + c * e.h;
                    let g = at(t);
                    if ready && g > 0.0 && t > before {
                        let (mut low, mut high) = (before, t);
                        for _ in 0..HALVINGS {
                            let middle = 0.5 * (low + high);
                            match at(middle) > 0.0 {
                                true => high = middle,
                                false => low = middle,
                            }
                        }
                        if first.is_none_or(|f| high < f.1) {
                            first = Some((k, high));
                        }
                        break 'elements;
                    }
                    ready |= g < 0.0;
                    before = t;
                }
            }
        }
        first
    }

    /// Does the step anew until its end is where a guard passes zero; `h` is the length of the whole step.
    fn end_on_guard(
        &mut self,
        watch: &mut Watch,
        k: usize,
        (at, h): (f64, f64),
        mark: &Mark,
        control: &mut Control,
        r: &mut SimResult,
    ) -> bool {
        let (mut length, mut before): (f64, Option<(f64, f64)>) = (at - mark.t, None);
        for _ in 0..TO_GUARD {
            self.go_back(mark, r);
            if length <= SAME * h {
                return true;
            }
            self.step_to(mark.t + length, watch, control, r);
            if r.outcome != Outcome::Solved {
                return false;
            }
            let g = watch.guard(k, &Point { t: self.t, x: &self.x, u: &self.u, p: &self.p });
            let rate = match before {
                Some((l, v)) if l != length => (g - v) / (length - l),
                _ => self.rate(watch, k, r),
            };
            let step = -g / rate;
            if !step.is_finite() || step.abs() <= SAME * h || g == 0.0 {
                return step.is_finite() || g == 0.0 || self.stall(r);
            }
            before = Some((length, g));
            length = (length + step).max(0.0);
        }
        self.stall(r)
    }

    fn stall(&self, r: &mut SimResult) -> bool {
        if !is_stop(r.outcome) {
            r.outcome = Outcome::Stalled;
        }
        false
    }

    /// Rate of a guard at the end of the last element, by its polynomial.
    fn rate(&self, watch: &mut Watch, k: usize, r: &SimResult) -> f64 {
        let Some(e) = r.trajectory.elements.last() else { return f64::NAN };
        let (step, mut x) = (1e-4 * e.h, e.x1.clone());
        if r.trajectory.state(self.t - step, &mut x).is_err() {
            return f64::NAN;
        }
        let before = watch.guard(k, &Point { t: self.t - step, x: &x, u: &self.u, p: &self.p });
        let now = watch.guard(k, &Point { t: self.t, x: &self.x, u: &self.u, p: &self.p });
        (now - before) / step
    }
}
