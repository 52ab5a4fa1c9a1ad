//! Contacts of a scene: impacts, and the modes behind impacts and wherever a contact force, a gap or a sliding velocity
//! vanishes.
//!
//! A closed contact is held at the level of accelerations, which explicit methods integrate; at the ends of steps gaps and
//! their rates are put back to zero, so nothing drifts. Derivatives go through events like those through transitions:
//! `S⁺ = r_x (S⁻ + f⁻ dt) + … − f⁺ dt`, where `r` is the impact, or the identity.

use super::order::Met;
use super::{recover, Engine, Progress, EPS};
use crate::contact::{self, mode, Closed};
use crate::error::{Error, Result};
use crate::event::field::Contacts;
use crate::event::watch::{ContactWatch, Watch};
use crate::event::{Continuation, ImpactKind, Outcome, Phase, Start};
use crate::func::{EvalError, Point};
use crate::system::Kind;

/// Impacts in no time at most.
const BURST: usize = 5000;
/// So many closed contacts are a heap.
const MANY: usize = 8;
/// What to do where many contacts are too much.
pub(super) const BY_STEPS: &str =
    "; scenes in which many bodies touch each other are for time stepping (simulate_steps)";
/// A sliding velocity below this share of its size is zero behind an event: what equations solved there leave.
pub(super) const AT_REST: f64 = 1e-11;
/// A gap at the start below so many roundings of its size is closed: the user computed the state in as many operations.
const TOUCHES: f64 = 1e3;
/// Velocities that agree so well are the same.
const SAME: f64 = 1e-9;
/// So many flights in a row double the speed that counts as none.
const PATIENCE: f64 = 10.0;

/// Accumulating impacts are summed where what they still do to the gap is this share of the tolerance.
pub(super) const LAST: f64 = 0.1;

/// Memory for events.
#[derive(Default)]
pub(super) struct SceneRoom {
    /// When every contact was closed last.
    pub(super) left: Vec<f64>,
    /// Contacts that hardly open are closed at the present event, see [`Engine::flight_is_short`].
    pub(super) merges: bool,
    /// Flights one after the other that were too short to be seen and too fast to be nothing.
    pub(super) flights: usize,
    /// How many times what the tolerances see of a velocity counts as none after so many.
    pub(super) patience: f64,
    /// The contact of the present event opened for less than the rounding of its gap, see [`Engine::flight_is_unseen`].
    pub(super) unseen: Option<usize>,
    /// There was an impact at the present event.
    pub(super) struck: bool,
    /// The last event changed nothing: a force that only touched zero, or one that is none at all.
    pub(super) idle: bool,
    /// A contact that counts as at rest has a sliding velocity: what is left of it where others have put the bodies back.
    pub(super) creeps: bool,
    /// Contacts without a gap.
    pub(super) touching: Vec<usize>,
    pub(super) closed: Vec<Closed>,
    /// When the last impact was.
    pub(super) hit: f64,
    /// Contacts of an impact, with another restitution than that of the model.
    pub(super) list: Vec<(usize, Option<f64>)>,
    /// Contacts that were struck at the present time, and what rounding of the impulses makes of the rates of their gaps.
    pub(super) roundings: Vec<(usize, f64)>,
    /// Contacts whose impacts accumulate, and the time until they end.
    pub(super) last: Vec<(usize, f64)>,
    pub(super) after: Vec<f64>,
    pub(super) before: Vec<Vec<usize>>,
    /// Modes that were left since the last step or impact, and how many of these there were.
    passed: (Vec<Vec<Vec<usize>>>, [usize; 2]),
    pub(super) row: Vec<f64>,
    /// Jacobians of the resets of an event.
    pub(super) resets: Vec<f64>,
}

impl SceneRoom {
    /// A run begins.
    pub(super) fn forget(&mut self) {
        self.flights = 0;
        self.idle = false;
        self.hit = f64::NEG_INFINITY;
        self.passed.0.clear();
        self.left.fill(f64::NEG_INFINITY);
    }
}

impl Engine {
    /// Checks a scene at its start, makes the impacts there and finds the first modes.
    pub(super) fn begin_scene(&mut self, t_stop: f64) -> Result<()> {
        let first = self.field.active.iter().any(Vec::is_empty) || self.field.active.is_empty();
        if first {
            for i in 0..self.field.active.len() {
                let first = self.field.scene().map_or(mode::OPEN, |c| c.dynamics.first_mode(i));
                let set = &mut self.field.active[i];
                set.clear();
                set.push(first);
            }
            self.field.carry_none();
        }
        if !self.settle_start(first)? {
            self.fail(Outcome::NoContinuation, "the scene is not defined at this point".into());
            return Ok(());
        }
        if self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        if first {
            self.check_scene()?;
            recover(self.start_on_constraints().map(|()| true), false)?;
        }
        self.field.look_at_all();
        self.derivatives.time_row.fill(0.0);
        if let Some(s) = &mut self.derivatives.sens {
            s.dt.fill(0.0);
        }
        let start = self.log.switches.len();
        let found = self.scene_inner(None, f64::NAN, (t_stop - self.t).max(f64::MIN_POSITIVE));
        if !recover(found.map(|()| true), false)? && self.log.outcome == Outcome::Reached {
            self.fail(Outcome::NoContinuation, "the scene is not defined at this point".into());
        }
        if first {
            // the modes at the start are no switches
            self.log.stats.switches -= self.log.switches.len() - start;
            self.log.switches.truncate(start);
        }
        if self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        self.check_discrete()?;
        if self.notes.is_some() {
            self.note_start()?;
        }
        self.start_off(t_stop, "scene")
    }

    /// Says what is wrong with a scene at its start.
    fn check_scene(&mut self) -> Result<()> {
        let t = self.t;
        if let Some(i) = self.outside() {
            return Err(Error::Range(format!(
                "coordinate {i} starts at {}, outside of the bounds that contacts of the scene were left out for",
                self.x[i]
            )));
        }
        let sizes = recover(self.field.contact_sizes(t, &self.x).map(|()| true), false)?;
        let loosest = self.rtol.iter().fold(0.0f64, |m, v| m.max(*v)).max(TOUCHES * EPS);
        let (rtol, atol, row, n_z) = (&self.rtol, &self.atol, &mut self.contact_events.scene.row, self.field.n_z);
        let checked = self.field.with_contacts(t, &self.x, |c, at, _| -> Result<()> {
            if !c.dynamics.is_definite(at) {
                return Err(Error::Range(format!(
                    "the inertia matrix is not positive definite at t = {t}, or not defined there"
                )));
            }
            if let Some((i, j)) = c.dynamics.asymmetry(at) {
                return Err(Error::Range(format!(
                    "the inertia matrix is not symmetric at t = {t}: entries ({i}, {j}) and ({j}, {i}) differ"
                )));
            }
            if !sizes {
                return Ok(());
            }
            for i in 0..c.dynamics.n_contacts() {
                let known = c.dynamics.load_gap(at, i).and_then(|()| c.dynamics.load_contact(at, i));
                if known.is_err() {
                    continue;
                }
                // what the tolerances do not see of the coordinates is no overlap of bodies
                let unseen = c.unseen(i, at, c.dynamics.mechanics.n_q, (rtol, atol), (row, n_z)).unwrap_or_default();
                if let Some(text) = c.flaw_of_friction(i) {
                    return Err(Error::Range(format!("{text}, at the start")));
                }
                let (b, name) = (c.dynamics.block(i), &c.dynamics.mechanics.contacts[i].name);
                if c.dynamics.is_joint(i) {
                    continue;
                }
                let far = |k: usize, v: f64| v > unseen[k].max(loosest * c.sizes[i][[0, 3][k]]);
                let bilateral = c.dynamics.mechanics.contacts[i].kind == Kind::Bilateral;
                if bilateral && (far(0, b.gap[0].abs()) || far(1, b.gap[1].abs())) {
                    return Err(Error::Range(format!(
                        "constraint {name} is not satisfied at the start: it is {}, and its rate {}; start with coordinates and \
                         velocities at which both vanish",
                        b.gap[0], b.gap[1]
                    )));
                }
                if far(0, -b.gap[0]) {
                    return Err(Error::Range(format!(
                        "the gap of contact {name} is {} at the start: the bodies overlap; start with a gap of zero or more",
                        b.gap[0]
                    )));
                }
                if !(0.0..=1.0).contains(&b.restitution) {
                    return Err(Error::Range(format!(
                        "contact {name} has restitution {} at the start: it must lie between 0 and 1",
                        b.restitution
                    )));
                }
                if b.has_dependent_rows() {
                    return Err(Error::Range(format!(
                        "the tangents of contact {name} depend on each other or on its normal at the start: give directions in \
                         which the bodies slide, each of its own"
                    )));
                }
                if b.gap[0] <= TOUCHES * EPS * c.sizes[i][0] && b.normal.iter().all(|n| *n == 0.0) {
                    return Err(Error::Range(format!(
                        "the gradient of the gap of contact {name} vanishes where it is closed: write the gap as a distance"
                    )));
                }
            }
            Ok(())
        });
        checked.unwrap_or(Ok(()))
    }

    /// What tolerances do not see of constraints at the start is no motion: constraints that depend on each other would contradict each
    /// other there.
    fn start_on_constraints(&mut self) -> std::result::Result<(), EvalError> {
        let mut x = self.x.clone();
        let r = self.field.with_contacts(self.t, &self.x, |c, at, modes| {
            let Contacts { dynamics, sizes, .. } = c;
            let kinds = dynamics.mechanics.contacts.iter().map(|c| c.kind == Kind::Bilateral);
            let held: Vec<Vec<usize>> = kinds.map(|b| vec![if b { mode::CLOSED } else { mode::OPEN }]).collect();
            if held.len() == modes.len() && held.iter().any(|m| m[0] == mode::CLOSED) {
                dynamics.project(at, &held, &mut x, &|i, _| [0, 3].map(|k| 16.0 * EPS * sizes[i][k]))?;
            }
            Ok(())
        });
        self.x = x;
        self.field.forget();
        r.unwrap_or(Ok(()))
    }

    /// An event of watch `l` at the present point.
    pub(super) fn contact_event(&mut self, l: usize, slope: f64, grown: f64) -> Result<Progress> {
        let watch = self.functions.watches[l];
        if let Watch::Contact { contact, what: ContactWatch::Gap, .. } = self.functions.watches[l] {
            if self.t > self.stepper.step.t {
                let x = std::mem::take(&mut self.x);
                let r = self.check_gradient(contact, self.t, &x);
                self.x = x;
                r?;
            }
        }
        let length = self.usual_step();
        let n = self.log.impacts.len();
        let r = self.scene_inner(Some(l), slope, length);
        if !recover(r.map(|()| true), false)? && self.log.outcome == Outcome::Reached {
            let text = "the scene is not defined at this event, or its inertia is not positive definite there";
            return Ok(self.fail(Outcome::NoContinuation, text.into()));
        }
        if let w @ Watch::Contact { contact, what: ContactWatch::Speed, .. } = watch {
            let named = |c: &Contacts| c.dynamics.mechanics.contacts[contact].name.clone();
            let crossed = self.field.active[contact][0] != mode::CLOSED;
            let name = self.field.scene().filter(|c| crossed && c.dynamics.is_switch(contact)).map(named);
            if let Some(p) = name.and_then(|name| self.scene_accumulates(&w, &name)) {
                return Ok(p);
            }
        }
        // guards that vanish here too, or are beyond zero behind an impact
        if let Some(p) = self.make_what_holds("scene")? {
            return Ok(p);
        }
        // behind an impact everything may happen soon again
        self.stepper.h = grown;
        self.stepper.err_before = 1e-4;
        if self.log.outcome != Outcome::Reached {
            return Ok(Progress::Done);
        }
        if self.log.impacts.len() > n {
            // bodies that meet in heaps have many impacts at nearly one time; without end they accumulate
            if self.t - self.contact_events.burst.0 > self.no_time() {
                self.contact_events.burst = (self.t, 0);
            }
            self.contact_events.burst.1 += 1;
            if self.contact_events.burst.1 > BURST {
                let text = format!("{BURST} impacts in no time: they accumulate{BY_STEPS}");
                return Ok(self.fail(Outcome::Zeno, text));
            }
        }
        Ok(Progress::Switched)
    }

    /// A gap whose gradient vanishes where it closes has no normal: no force could act. It is compared with the way the gap
    /// has gone since the step began.
    pub(super) fn check_gradient(&mut self, contact: usize, t: f64, x: &[f64]) -> Result<()> {
        /// Gradients so small are none.
        const LEAST: f64 = 1e-6;
        /// Those that may be, as the point is not exact.
        const LITTLE: f64 = 1e-2;
        let (s, n_z, row) = (&self.stepper.step, self.field.n_z, &mut self.contact_events.scene.row);
        row.clear();
        row.resize(n_z, 0.0);
        let there = self.field.with_contacts(t, x, |c, at, _| c.dynamics.gap_gradient(at, contact, row));
        let before = self.field.with_contacts(s.t, &s.x0, |c, at, _| {
            c.dynamics.load_gap(at, contact).map(|()| c.dynamics.block(contact).gap[0])
        });
        let (Some(Ok(())), Some(Ok(gap))) = (there, before) else { return Ok(()) };
        let ways = x.iter().zip(&s.x0).zip(s.f0.iter().zip(&s.f1));
        let way = ways.map(|((x, x0), (a, b))| (x - x0).abs().max(s.h * a.abs()).max(s.h * b.abs()));
        let reach = row.iter().zip(way).map(|(g, w)| g.abs() * w).sum::<f64>() + row[n_z - 1].abs() * s.h;
        if !(gap > 0.0 && reach <= LITTLE * gap && self.gradient_falls(contact, LITTLE)) {
            return Ok(());
        }
        if reach > LEAST * gap && !self.halves(contact, t, x) {
            return Ok(());
        }
        let name = self.field.scene().map_or("", |c| &c.dynamics.mechanics.contacts[contact].name);
        let text = format!(
            "the gradient of the gap of contact {name} vanishes where it closes: state the gap so that its gradient is not \
             zero there, as a distance and not as a power of it"
        );
        self.fail(Outcome::NoContinuation, text);
        Err(Error::Range(self.log.reason.clone()))
    }

    /// Is each entry of the gradient of a gap, as it is in `scene.row`, at most this share of what it was at the start of the step? A motion
    /// along a surface changes its gap by nothing, too, but there the gradient is as long as before.
    fn gradient_falls(&mut self, contact: usize, share: f64) -> bool {
        let mut before = vec![0.0; self.field.n_z];
        let r = self.field.with_contacts(self.stepper.step.t, &self.stepper.step.x0, |c, at, _| {
            c.dynamics.gap_gradient(at, contact, &mut before)
        });
        let falls = |(now, before): (&f64, &f64)| now.abs() <= share * before.abs();
        matches!(r, Some(Ok(()))) && self.contact_events.scene.row.iter().zip(&before).all(falls)
    }

    /// Does the way to the zero of a gap, along the velocity, halve in every step of Newton's method? Then the zero is a double
    /// one: there the gradient vanishes.
    fn halves(&mut self, contact: usize, t: f64, x: &[f64]) -> bool {
        const STEPS: usize = 10;
        let (mut t, mut there) = (t, x.to_vec());
        let s = &self.stepper.step;
        let part = ((t - s.t) / s.h).clamp(0.0, 1.0);
        let velocity: Vec<f64> = s.f0.iter().zip(&s.f1).map(|(a, b)| a + part * (b - a)).collect();
        let (mut ways, mut steps) = (0, 0);
        let mut last = f64::NAN;
        while steps < STEPS {
            let gap = self.field.with_contacts(t, &there, |c, at, _| {
                c.dynamics.load_gap(at, contact).map(|()| c.dynamics.block(contact).gap)
            });
            let Some(Ok([gap, rate])) = gap else { return false };
            let delta = -gap / rate;
            if rate == 0.0 || !delta.is_finite() {
                return gap == 0.0 || rate == 0.0;
            }
            ways += usize::from((0.3..0.7).contains(&(delta / last)));
            last = delta;
            there.iter_mut().zip(&velocity).for_each(|(x, f)| *x += delta * f);
            t += delta;
            steps += 1;
        }
        ways >= STEPS / 2
    }

    /// What made the steps of a scene too short, if that is known.
    pub(super) fn cause_of_short_steps(&mut self) -> Option<String> {
        let t = self.t;
        let near = 1e-6 * (self.t_stop - self.t_start).abs();
        let singular = self.field.with_contacts(t, &self.x, |c, at, _| c.dynamics.is_nearly_singular(at, near))?;
        if singular {
            return Some(
                "the inertia matrix becomes singular there: choose coordinates in which it stays positive definite"
                    .into(),
            );
        }
        let closed = self.field.active.iter().filter(|set| set[0] != mode::OPEN).count();
        (closed >= MANY).then(|| BY_STEPS[2..].to_owned())
    }

    /// Everything that happens at the present point: the end of a slide in space, impacts, the next modes. `l` is the watch
    /// that vanishes, none at the start or where controls or parameters have changed.
    fn scene_inner(&mut self, l: Option<usize>, slope: f64, length: f64) -> std::result::Result<(), EvalError> {
        self.contact_events.scene.before.clone_from(&self.field.active);
        self.contact_events.scene.resets.clear();
        let event = l.and_then(|l| match self.functions.watches[l] {
            Watch::Contact { contact, what, .. } => Some((contact, what)),
            _ => None,
        });
        let (mut rate, mut again) = (slope, false);
        if let Some(l) = l {
            self.arrive()?;
            let own = self.functions.watches[l].rate_in(&self.field.q, &self.field.dq, &self.field, &self.f);
            rate = if own.is_finite() { own } else { slope };
            self.field.renew_sizes(self.t, &self.x, event.map(|e| e.0))?;
            again = event.is_some_and(|e| self.closes_again(e, rate));
            if !again {
                self.differentiate_time(l)?;
            }
        } else {
            self.f.fill(0.0);
            let r = self.field.rhs(self.t, &self.x, &mut self.stepper.node);
            if r.is_ok() {
                self.f.copy_from_slice(&self.stepper.node);
            }
            r?;
            self.field.contact_sizes(self.t, &self.x)?;
        }
        self.f_before.copy_from_slice(&self.f);
        let recorded = self.derivatives.sens.is_some() || self.derivatives.tape.is_some();
        let meeting = if recorded && !again { self.meeting(event)? } else { None };
        let together = match meeting {
            Some(m) => Some((self.follow_orders(&m, length)?, m, self.derivatives.sens.as_ref().map(|s| s.s.clone()))),
            None => None,
        };
        if let Some(s) = &mut self.derivatives.sens {
            s.advance(&self.f_before, 1.0);
        }
        if let Some((contact, ContactWatch::Speed)) = event {
            self.stop_in_space(contact)?;
        }
        let start = self.log.impacts.len();
        let impacts = self.log.stats.impacts;
        self.contact_events.scene.struck = false;
        (self.contact_events.scene.merges, self.contact_events.scene.unseen) = match event {
            Some((contact, ContactWatch::Gap)) => {
                let unseen = self.flight_is_unseen(contact)?.then_some(contact);
                (self.flight_is_short(contact)?, unseen)
            }
            _ => (false, None),
        };
        let unique_impact = self.collide(event, recorded)?;
        self.contact_events.scene.struck = self.log.stats.impacts > impacts;
        if self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        let mut unique = self.next_modes(event, length, recorded, self.log.impacts.len() == start)?;
        if self.contact_events.scene.merges && self.log.outcome == Outcome::Reached && !self.come_together()? {
            // to close them all would move the bodies by more than the tolerances allow
            self.contact_events.scene.merges = false;
            self.contact_events.scene.flights += 1;
            unique &= self.next_modes(event, length, recorded, false)?;
        }
        if self.log.outcome != Outcome::Reached {
            return Ok(());
        }
        let t = self.t;
        let SceneRoom { left, touching, .. } = &mut self.contact_events.scene;
        left.resize(self.field.active.len(), f64::NEG_INFINITY);
        // what has been struck may have a rate beyond rounding that is none
        let struck = self.log.impacts[start..].iter().map(|i| i.contact);
        touching.iter().copied().chain(struck).for_each(|i| left[i] = t);
        if self.contact_events.scene.merges {
            self.log.stats.accumulations += 1;
            self.log.one_sided = true;
        }
        if self.contact_events.scene.merges
            || self.contact_events.scene.creeps
            || self.contact_events.scene.unseen.is_some()
        {
            self.bring_together()?;
        }
        self.enter()?;
        let several = self.log.impacts[start..].iter().filter(|i| self.opens(i.contact)).count() > 1;
        self.log.impacts[start..].iter_mut().for_each(|i| i.simultaneous = several);
        let met = match together {
            Some((orders, meeting, before)) => self.differentiate_meeting(&meeting, orders, before, start)?,
            None => {
                self.differentiate_impacts(start, again);
                Met::default()
            }
        };
        self.log.one_sided |= !unique || !met.both && (!unique_impact || several);
        let one_sided = self.log.one_sided;
        unique &= unique_impact;
        let returns = self.returns_at_once();
        self.contact_events.scene.idle =
            returns || self.field.active == self.contact_events.scene.before && self.log.impacts.len() == start;
        if returns {
            self.crowd_of_modes();
        }
        if self.field.active == self.contact_events.scene.before {
            if self.contact_events.scene.idle {
                // nothing has changed: a force or a speed that only touches zero
                self.crowd_of_modes();
                if let Some(l) = l.filter(|l| self.is_zero_still(*l)) {
                    self.functions.depart[l] = self.functions.depart[l].max(2);
                }
            }
        } else {
            let before = std::mem::take(&mut self.contact_events.scene.before);
            let from = self.log.switches.len();
            self.log(&before, rate, None, unique);
            self.contact_events.scene.before = before;
            self.time_switches(from, &met.times);
            if met.both {
                self.log.one_sided = one_sided;
            }
        }
        self.note_phase();
        Ok(())
    }

    /// Are the modes behind an event some that were left already, with neither a step nor an impact in between? What tells them apart is rounding.
    fn returns_at_once(&mut self) -> bool {
        let now = [self.log.stats.steps, self.log.stats.impacts];
        let SceneRoom { passed: (left, then), before, .. } = &mut self.contact_events.scene;
        if std::mem::replace(then, now) != now {
            left.clear();
        }
        if self.field.active == *before {
            return false;
        }
        left.push(before.clone());
        left.contains(&self.field.active)
    }

    /// Notes an event that leads to nothing new; a crowd of them at one time ends the run.
    fn crowd_of_modes(&mut self) {
        self.calendar.crowd += 1;
        if self.calendar.crowd > 20 {
            self.fail(Outcome::NoContinuation, format!("the contact modes contradict each other{BY_STEPS}"));
        }
    }

    /// Is watch `l` zero where the modes begin, as well as a located event knows it? Bodies that share a load anew have other forces than before.
    fn is_zero_still(&self, l: usize) -> bool {
        let w = self.functions.watches[l];
        let scale = w.scale(&self.functions.dq0, &self.field, self.t, &self.x).value;
        w.value(&self.functions.q0, &self.field) <= EPS.sqrt() * scale
    }

    /// What follows where transition `g` has changed the state: which contacts are closed, impacts, the next modes. The Jacobians of impacts
    /// are behind those of the resets then. Says whether it is unique.
    pub(super) fn scene_behind_jump(
        &mut self,
        g: usize,
        recorded: bool,
        length: f64,
        resets: &mut Vec<f64>,
    ) -> std::result::Result<bool, EvalError> {
        let t = self.t;
        self.field.forget();
        self.field.look_at_all();
        self.field.carry_none();
        self.field.contact_sizes(t, &self.x)?;
        if let Some(text) = self.flaw_behind_jump(g)? {
            self.fail(Outcome::NoContinuation, text);
            return Ok(true);
        }
        let start = self.log.impacts.len();
        let scene = &mut self.contact_events.scene;
        scene.resets.clear();
        (scene.struck, scene.merges, scene.unseen) = (false, false, None);
        let impacts = self.log.stats.impacts;
        let unique_impact = self.collide(None, recorded)?;
        self.contact_events.scene.struck = self.log.stats.impacts > impacts;
        if self.log.outcome != Outcome::Reached {
            return Ok(true);
        }
        let unique = self.next_modes(None, length, recorded, self.log.impacts.len() == start)?;
        if self.log.outcome != Outcome::Reached {
            return Ok(true);
        }
        let SceneRoom { left, touching, .. } = &mut self.contact_events.scene;
        left.resize(self.field.active.len(), f64::NEG_INFINITY);
        let struck = self.log.impacts[start..].iter().map(|i| i.contact);
        touching.iter().copied().chain(struck).for_each(|i| left[i] = t);
        if self.contact_events.scene.creeps {
            self.bring_together()?;
        }
        resets.extend_from_slice(&self.contact_events.scene.resets);
        self.enter()?;
        self.note_phase();
        Ok(unique && unique_impact)
    }

    /// Opens the contacts that transition `g` has parted; says what is wrong with the others, and with constraints, in words.
    fn flaw_behind_jump(&mut self, g: usize) -> std::result::Result<Option<String>, EvalError> {
        let (rtol, atol, n_z) = (&self.rtol, &self.atol, self.field.n_z);
        let row = &mut self.contact_events.scene.row;
        let mut modes: Vec<Vec<usize>> = self.field.active.clone();
        let r = self.field.with_contacts(self.t, &self.x, |c, at, _| {
            for (i, set) in modes.iter_mut().enumerate() {
                if c.dynamics.is_joint(i) {
                    continue;
                }
                c.dynamics.load_gap(at, i)?;
                c.dynamics.load_contact(at, i)?;
                let unseen = c.unseen(i, at, c.dynamics.mechanics.n_q, (rtol, atol), (row, n_z))?;
                let (b, name, size) = (c.dynamics.block(i), &c.dynamics.mechanics.contacts[i].name, c.sizes[i]);
                let [gap, rate] = b.gap;
                if !c.dynamics.opens(i) {
                    let far = gap.abs() > unseen[0].max(TOUCHES * EPS * size[0])
                        || rate.abs() > unseen[1].max(TOUCHES * EPS * size[3]);
                    if far {
                        return Ok(Some(format!(
                            "transition {g} leaves constraint {name} at {gap}, and its rate at {rate}: a reset must satisfy \
                             constraints and their rates"
                        )));
                    }
                } else if gap < -unseen[0].max(TOUCHES * EPS * size[0]) {
                    return Ok(Some(match c.dynamics.is_first_order() {
                        true => format!(
                            "transition {g} leaves the set: constraint {name} is {gap} behind it, and must not be negative; reset to a state in \
                             the set"
                        ),
                        false => format!(
                            "transition {g} makes the bodies overlap: the gap of contact {name} is {gap} behind it"
                        ),
                    }));
                } else if gap > TOUCHES * EPS * size[0] {
                    set[0] = mode::OPEN;
                }
            }
            Ok(None)
        });
        let flaw = r.unwrap_or(Ok(None))?;
        self.field.set_active(&modes);
        Ok(flaw)
    }

    /// Does a contact that an event has left at this very time close at a rate that is rounding? Its time is that of the event: a rate which is
    /// rounding says nothing of how it changes.
    fn closes_again(&self, (contact, what): (usize, ContactWatch), rate: f64) -> bool {
        let since = self.t - self.contact_events.scene.left.get(contact).copied().unwrap_or(f64::NEG_INFINITY);
        let size = self.field.scene().map_or(0.0, |c| c.sizes[contact][3]);
        what == ContactWatch::Gap && since <= 64.0 * EPS * self.t.abs() && rate.abs() <= AT_REST * size
    }

    /// Derivatives behind an event, of which all that happens does so at the same time also nearby.
    /// What happens `again` does so at the time of the event before it.
    pub(super) fn differentiate_impacts(&mut self, start: usize, again: bool) {
        if let Some(s) = &mut self.derivatives.sens {
            s.advance(&self.f, -1.0);
        }
        if let Some(tape) = self.derivatives.tape.as_mut().filter(|_| again) {
            tape.jump_again(self.t, &self.f, &self.contact_events.scene.resets, 64.0 * EPS * self.t.abs());
        } else if let Some(tape) = &mut self.derivatives.tape {
            let n_c = self.derivatives.time_row.len() - 1;
            tape.jump(
                (self.log.switches.len(), start),
                &self.derivatives.time_row[..n_c],
                [&self.f_before, &self.f],
                &self.contact_events.scene.resets,
                None,
            );
        }
    }

    /// Notes the modes from here on.
    fn note_phase(&mut self) {
        let starting = self.field.with_contacts(self.t, &[], |c, _, _| std::mem::take(&mut c.dynamics.starting));
        if self.contact_events.phases.len() >= self.options.max_log {
            return;
        }
        let (field, last) = (&self.field, self.contact_events.phases.last());
        let modes = || field.active.iter().map(|s| s[0]);
        let behind = &self.x[self.n_shown()..];
        let n_modes = self.n_own_modes();
        let same = |p: &Phase| p.behind[..n_modes] == behind[..n_modes] && p.u == field.u && p.p == field.p;
        if last.is_some_and(|p| p.modes.iter().copied().eq(modes()) && same(p)) {
            return;
        }
        let redundant = field.scene().is_some_and(|c| c.dynamics.is_redundant());
        let (u, p) = (field.u.clone(), field.p.clone());
        let mut starting = starting.unwrap_or_default();
        starting.retain(|(i, _)| field.active[*i][0] == mode::SLIDES);
        let starting = starting.into_iter().map(|(contact, direction)| Start {
            contact,
            direction,
            unseen: field.scene().map_or(0.0, |c| c.dynamics.begins[contact]),
        });
        let starting = starting.collect();
        self.contact_events.phases.push(Phase {
            t: self.t,
            modes: modes().collect(),
            redundant,
            starting,
            u,
            p,
            behind: behind.to_vec(),
        });
    }

    /// What is left of a slide in space goes along the tangent, see [`Dynamics::stop`].
    fn stop_in_space(&mut self, contact: usize) -> std::result::Result<(), EvalError> {
        let left = self.field.with_contacts(self.t, &self.x, |c, _, modes| {
            if c.dynamics.mechanics.contacts[contact].n_tangents < 2 {
                return None;
            }
            let d = c.dynamics.direction(contact, modes[contact][0]);
            let s = c.dynamics.block(contact).sliding;
            Some((s[0].hypot(s[1]), c.dynamics.sliding_acceleration(contact, d)))
        });
        let Some((speed, rate)) = left.flatten() else { return Ok(()) };
        let left = (speed / -rate).min(self.t_stop - self.t);
        if !(left > 0.0 && left.is_finite()) {
            return Ok(());
        }
        self.x.iter_mut().zip(&self.f).for_each(|(x, f)| *x += left * f);
        self.t += left;
        if let Some(tape) = &mut self.derivatives.tape {
            tape.move_end(self.t);
        }
        let mut x = self.x.clone();
        let start = x.clone();
        let r = self.field.with_contacts(self.t, &start, |c, at, modes| {
            let mut held = modes.to_vec();
            held[contact][0] = mode::CLOSED;
            c.dynamics.project(at, &held, &mut x, &|_, _| [-1.0, -1.0])
        });
        r.unwrap_or(Ok(false))?;
        self.x = x;
        Ok(())
    }

    /// Did a contact that closes now fly for so short a time, and so slowly, that the tolerances see neither its gap nor its
    /// velocity? The longer such flights go on one after the other, the faster they may be: two contacts that open each other in
    /// turn, for ever, move a little faster than the tolerances see. Bodies that carry each other knock contacts open which close again, in ever shorter time; the motion goes
    /// on behind that where all that hardly moves is taken as closed.
    fn flight_is_short(&mut self, i: usize) -> std::result::Result<bool, EvalError> {
        let since = self.t - self.contact_events.scene.left.get(i).copied().unwrap_or(f64::NEG_INFINITY);
        if !since.is_finite() || self.field.scene().is_some_and(|c| c.dynamics.is_first_order()) {
            self.contact_events.scene.flights = 0;
            return Ok(false);
        }
        let (rtol, atol, row) = (&self.rtol, &self.atol, &mut self.contact_events.scene.row);
        let n_z = self.field.n_z;
        let patience = 1.0 + self.contact_events.scene.flights as f64 / PATIENCE;
        let r = self.field.with_contacts(self.t, &self.x, |c, at, _| {
            c.dynamics.load_gap(at, i)?;
            c.dynamics.load_contact(at, i)?;
            let (b, n_q) = (c.dynamics.block(i), c.dynamics.mechanics.n_q);
            let (rate, elastic) = (b.gap[1].abs(), b.restitution >= 1.0);
            let [gap, speed] = c.unseen(i, at, n_q, (rtol, atol), (row, n_z))?;
            Ok((!elastic && rate * since <= LAST * gap, rate <= speed * patience))
        });
        let (short, slow) = r.unwrap_or(Ok((false, false)))?;
        self.contact_events.scene.patience = patience;
        self.contact_events.scene.flights = if short { self.contact_events.scene.flights + 1 } else { 0 };
        Ok(short && slow)
    }

    /// Does a contact whose gap is zero open with a velocity so small that the acceleration that closes it again, that of the
    /// modes so far, leaves no gap beyond rounding? With the rate `w` and the acceleration `−a` the gap grows to `w²/2a`. It
    /// closes with `−w` and then rests, where there is no restitution or as its bounces are even lower: as if it had never
    /// opened, since what its force would have done meanwhile is the impulse that is missing.
    fn flight_is_unseen(&mut self, i: usize) -> std::result::Result<bool, EvalError> {
        let f = &self.f_before;
        let r = self.field.with_contacts(self.t, &self.x, |c, at, _| {
            if c.dynamics.is_first_order() {
                return Ok(false);
            }
            c.dynamics.load_gap(at, i)?;
            c.dynamics.load_contact(at, i)?;
            let b = c.dynamics.block(i);
            let (rate, elastic) = (b.gap[1], b.restitution >= 1.0);
            let a = -c.dynamics.gap_acceleration_of(i, f);
            Ok(!elastic && rate > 0.0 && a > 0.0 && rate * rate <= 128.0 * EPS * a * c.sizes[i][0])
        });
        r.unwrap_or(Ok(false))
    }

    /// Can the contacts that are closed now be brought together without moving the bodies by more than the tolerances?
    fn come_together(&mut self) -> std::result::Result<bool, EvalError> {
        let mut x = std::mem::take(&mut self.contact_events.scene.after);
        x.clone_from(&self.x);
        let r = self
            .field
            .with_contacts(self.t, &self.x, |c, at, modes| c.dynamics.project(at, modes, &mut x, &|_, _| [-1.0; 2]));
        let near = self.is_near(&x, self.contact_events.scene.patience);
        self.contact_events.scene.after = x;
        self.field.forget();
        r.unwrap_or(Ok(false)).map(|_| near)
    }

    /// Does this state differ from the present one by no more than the tolerances, in velocities by this many times as much?
    fn is_near(&self, x: &[f64], times: f64) -> bool {
        let n_q = self.field.scene().map_or(0, |c| c.dynamics.mechanics.n_q);
        let mut states = x.iter().zip(&self.x).zip(self.rtol.iter().zip(&self.atol)).enumerate();
        states.all(|(k, ((a, b), (rtol, atol)))| {
            let times = if k < n_q { 1.0 } else { times };
            (a - b).abs() <= times * (rtol * b.abs() + atol)
        })
    }

    /// The gaps of contacts that are taken as closed, their rates, and the velocities of those that rest, become zero.
    fn bring_together(&mut self) -> std::result::Result<(), EvalError> {
        let mut x = std::mem::take(&mut self.contact_events.scene.after);
        x.clone_from(&self.x);
        let r = self
            .field
            .with_contacts(self.t, &self.x, |c, at, modes| c.dynamics.project(at, modes, &mut x, &|_, _| [-1.0; 2]));
        if self.contact_events.scene.merges || self.contact_events.scene.unseen.is_none() || self.is_near(&x, 1.0) {
            self.x.copy_from_slice(&x);
        }
        self.contact_events.scene.after = x;
        self.field.forget();
        r.unwrap_or(Ok(false)).map(|_| ())
    }

    /// Lists the contacts without a gap at the present point that are closed or do not open.
    pub(super) fn touching(&mut self, event: Option<(usize, ContactWatch)>) -> std::result::Result<(), EvalError> {
        let first = event.is_none();
        let (rtol, atol, n_z) = (&self.rtol, &self.atol, self.field.n_z);
        let SceneRoom { touching: out, row, merges, patience, .. } = &mut self.contact_events.scene;
        out.clear();
        let r = self.field.with_contacts(self.t, &self.x, |c, at, modes| {
            for (i, set) in modes.iter().enumerate() {
                if set[0] != mode::OPEN || event == Some((i, ContactWatch::Gap)) {
                    out.push(i);
                    continue;
                }
                if !c.is_near(i) {
                    continue;
                }
                c.dynamics.load_gap(at, i)?;
                let [gap, rate] = c.dynamics.block(i).gap;
                let roundings = if first { TOUCHES } else { 64.0 };
                if c.dynamics.is_first_order() {
                    // what follows is decided by the rates
                    if gap <= roundings * EPS * c.sizes[i][0] {
                        out.push(i);
                    }
                    continue;
                }
                let near = (roundings * EPS * c.sizes[i][0]).max(8.0 * EPS * rate.abs() * at.t.abs());
                let closes = gap <= near && rate <= 64.0 * EPS * c.sizes[i][3];
                if closes || *merges && c.hardly_opens(i, at, (rtol, atol), *patience, (row, n_z))? {
                    out.push(i);
                }
            }
            Ok(())
        });
        r.unwrap_or(Ok(()))
    }

    /// Finds the next modes; where no forces continue the motion, by an impact without collision. Says whether they are
    /// unique.
    fn next_modes(
        &mut self,
        event: Option<(usize, ContactWatch)>,
        length: f64,
        recorded: bool,
        mut listed: bool,
    ) -> std::result::Result<bool, EvalError> {
        let mut undetermined = false;
        // as the velocities are; with those at rest that the tolerances do not see, whose signs may have no forces; behind an impact
        for attempt in 0..3 {
            if !listed {
                self.touching(event)?;
            }
            listed = false;
            self.closed(event, attempt > 0)?;
            let list: Vec<(usize, Option<f64>)> =
                self.contact_events.scene.closed.iter().map(|c| (c.contact, Some(0.0))).collect();
            self.check_laws(&list);
            if self.log.outcome != Outcome::Reached {
                return Ok(false);
            }
            let closed = &self.contact_events.scene.closed;
            let found = self.field.with_contacts(self.t, &self.x, |c, at, _| {
                let sizes = &c.sizes;
                let loaded = c.is_at(at);
                let found = c.dynamics.follow(at, closed, &|k| sizes[k][1], (length, loaded));
                c.forget();
                found
            });
            let Some(found) = found else { return Ok(true) };
            let found = found?;
            if !found.all.is_empty() {
                return self.take(found, event);
            }
            undetermined |= found.undetermined;
            let slides = closed.iter().any(|c| !c.rests);
            if attempt == 2 || !slides {
                break;
            }
            if attempt == 0 {
                continue;
            }
            // Painlevé: an impact without collision, in which friction brings the sliding to rest
            if self.strike(&list, ImpactKind::Painleve, recorded)?.is_none() {
                break;
            }
            self.contact_events.scene.struck = true;
            self.log.one_sided = true;
        }
        if std::mem::take(&mut self.contact_events.scene.merges) {
            // not with all those closed that hardly open
            self.contact_events.scene.flights += 1;
            return self.next_modes(event, length, recorded, false);
        }
        let closed = &self.contact_events.scene.closed;
        if let Some(text) = self.field.scene().and_then(|c| c.product_at_rest(closed)) {
            self.fail(Outcome::NoContinuation, text);
            return Ok(false);
        }
        if self.field.scene().is_some_and(|c| c.dynamics.mechanics.n_switches > 0) {
            let text = "no weights of switches and no contact forces continue the motion: either the sign of a switching function is \
                        undecided, as it and its rates vanish together, or friction and normal force contradict each other (Painlevé)";
            self.fail(Outcome::NoContinuation, text.into());
            return Ok(false);
        }
        if undetermined {
            let text = format!(
                "the contact forces do not determine the motion: each choice of them leaves the states at once that it belongs to{BY_STEPS}"
            );
            self.fail(Outcome::NoContinuation, text);
            return Ok(false);
        }
        let bilateral = |c: &Contacts| c.dynamics.mechanics.contacts.iter().any(|c| c.kind == Kind::Bilateral);
        let text = if self.field.scene().is_some_and(bilateral) {
            "no forces continue the motion: constraints contradict each other, or friction and normal force do (Painlevé)"
        } else {
            "no contact forces continue the motion: friction and normal force contradict each other (Painlevé)"
        };
        self.fail(Outcome::NoContinuation, text.into());
        Ok(false)
    }

    /// Takes one of the modes that may follow an event.
    fn take(
        &mut self,
        found: contact::Follow,
        event: Option<(usize, ContactWatch)>,
    ) -> std::result::Result<bool, EvalError> {
        let present = &self.field.active;
        let mut all = found.all;
        // bodies that fall side by side do not press each other: their force is rounding, and has no sign for long
        let presses_none = event.filter(|e| e.1 == ContactWatch::Pressure && self.contact_events.scene.idle);
        let opens = |c: &contact::Choice| presses_none.is_some_and(|(i, _)| c.modes[i][0] == mode::OPEN);
        let open = all.iter().position(opens);
        if let Some(i) = open.or_else(|| all.iter().position(|c| c.modes == *present)) {
            all[..=i].rotate_right(1);
        }
        let mut taken = 0;
        let mut unique = true;
        if all.len() > 1 {
            let mut continuations: Vec<Continuation> = Vec::with_capacity(all.len());
            let mut kept = Vec::with_capacity(all.len());
            for c in all {
                let mut velocity = vec![0.0; self.nx];
                let r = self.field.with_contacts(self.t, &self.x, |own, at, _| {
                    own.forget();
                    own.dynamics.begin(&c);
                    own.dynamics.rhs(at, &c.modes, &mut velocity)
                });
                r.unwrap_or(Ok(()))?;
                let same = |o: &Continuation| {
                    o.velocity.iter().zip(&velocity).all(|(a, b)| (a - b).abs() <= SAME * (a.abs() + b.abs()))
                };
                // modes that move the system alike are one continuation
                if !continuations.iter().any(same) {
                    continuations.push(Continuation { modes: c.modes.clone(), velocity });
                    kept.push(c);
                }
            }
            all = kept;
            if all.len() > 1 {
                unique = false;
                match self.branch(continuations) {
                    Some(i) => taken = i,
                    None => return Ok(false),
                }
            }
        }
        let choice = &all[taken];
        let (rtol, atol) = (&self.rtol, &self.atol);
        self.field.with_contacts(self.t, &self.x, |c, at, _| c.begin(choice, at, (rtol, atol)));
        self.field.set_active(&choice.modes);
        Ok(unique)
    }

    /// Lists those of the touching contacts that are closed, and whether each is at rest: also where it slides more slowly than the tolerances see, in
    /// space and where `unseen_rests`.
    pub(super) fn closed(
        &mut self,
        event: Option<(usize, ContactWatch)>,
        unseen_rests: bool,
    ) -> std::result::Result<(), EvalError> {
        let (rtol, atol, n_z) = (&self.rtol, &self.atol, self.field.n_z);
        /// Share of its size below which a sliding velocity may be zero, if others that stop say so.
        const STILL: f64 = 1e-3;
        let SceneRoom { touching: all, closed: out, row, merges, patience, creeps, unseen, struck, .. } =
            &mut self.contact_events.scene;
        let mut likely = Vec::new();
        *creeps = false;
        out.clear();
        // as the field does it while it lends the rest of itself
        let floor = std::mem::take(&mut self.field.floor);
        let r = self.field.with_contacts(self.t, &self.x, |c, at, modes| {
            for &i in all.iter() {
                c.dynamics.load_gap(at, i)?;
                c.dynamics.load_contact(at, i)?;
                let hardly =
                    *unseen == Some(i) || *merges && c.hardly_opens(i, at, (rtol, atol), *patience, (row, n_z))?;
                let b = c.dynamics.block(i);
                let pushes = c.dynamics.is_first_order() && !c.dynamics.is_joint(i);
                if pushes || c.dynamics.mechanics.contacts[i].kind == Kind::Bilateral {
                    out.push(Closed { contact: i, rests: true });
                    continue;
                }
                if b.gap[1] > AT_REST * c.sizes[i][3] && !hardly {
                    continue;
                }
                let n_q = c.dynamics.mechanics.n_q;
                let n_t = c.dynamics.mechanics.contacts[i].n_tangents;
                let size = b.sliding_size(n_q, (at.t, at.x), &floor);
                let stops = event == Some((i, ContactWatch::Speed));
                // an impact moves joints that stuck, whatever has led to it
                let pushed = *struck && c.dynamics.is_joint(i);
                let sticks = modes[i][0] == mode::CLOSED && event.is_some_and(|e| e.1 != ContactWatch::Gap) && !pushed;
                let speed = b.sliding[0].hypot(b.sliding[1]);
                // in space a velocity that the tolerances do not see has no direction that friction could go by
                let blind = n_t == 2 || unseen_rests && n_t == 1 && !c.dynamics.is_joint(i);
                let still = if blind { c.unseen_slide(i, at, (rtol, atol)) } else { 0.0 };
                let carried = c.dynamics.carried[i] && !pushed;
                let rests = stops || sticks || speed <= still.max(AT_REST * size) || carried;
                *creeps |= rests && speed > AT_REST * size;
                out.push(Closed { contact: i, rests });
                // switching functions that nearly vanish together need not do so
                likely.extend((!rests && speed <= STILL * size && !c.dynamics.is_switch(i)).then_some(out.len() - 1));
            }
            // what slides together stops together
            if let Some((stopped, ContactWatch::Speed)) = event.filter(|e| !c.dynamics.is_switch(e.0)) {
                for &k in likely.iter() {
                    out[k].rests = c.dynamics.stops_with(out[k].contact, stopped, modes);
                    *creeps |= out[k].rests;
                }
            }
            Ok(())
        });
        self.field.floor = floor;
        r.unwrap_or(Ok(()))
    }
}

impl Contacts {
    /// Says that two switches that multiply each other are at zero at once, where they are.
    fn product_at_rest(&self, closed: &[Closed]) -> Option<String> {
        let name = |i: usize| &self.dynamics.mechanics.contacts[i].name;
        self.dynamics.multiplied(closed).map(|[a, b]| {
            format!(
                "{} and {} vanish together and multiply each other, and no signs of them continue the motion: weights of both would be \
                 no solution of a linear problem, and are not looked for; write a sum of terms that switch separately",
                name(a),
                name(b)
            )
        })
    }

    /// What is wrong with the friction of contact `i`, which is loaded, in words.
    pub(super) fn flaw_of_friction(&self, i: usize) -> Option<String> {
        let (b, c) = (self.dynamics.block(i), &self.dynamics.mechanics.contacts[i]);
        let (name, slides, sticks) = (&c.name, b.friction, b.stiction);
        if slides >= 0.0 && sticks >= slides {
            return None;
        }
        Some(match (c.kind, slides >= 0.0) {
            (Kind::Joint, false) => {
                format!("joint {name} has the bound {slides} of its friction: it must not be negative")
            }
            (Kind::Joint, true) => {
                format!("joint {name} sticks by {sticks} and slides with {slides}: what holds must not be less")
            }
            (_, false) => format!("contact {name} has friction {slides}: it must not be negative"),
            (_, true) => {
                format!("contact {name} sticks by the friction {sticks} and slides with {slides}: what holds must not be less")
            }
        })
    }

    /// Begins with these modes. As long as the tolerances do not see the velocity of a slide, it says nothing of its direction.
    pub(super) fn begin(&mut self, choice: &contact::Choice, at: &Point, (rtol, atol): (&[f64], &[f64])) {
        let d = &mut self.dynamics;
        d.begin(choice);
        let slides = choice.modes.iter().map(|set| set[0] == mode::SLIDES);
        d.begins.iter_mut().zip(slides).filter(|(_, slides)| !slides).for_each(|(b, _)| *b = 0.0);
        for &(i, _) in &choice.directions {
            // what slides at several places stops at all of them at once: the slowest one says nothing of the others
            let alone = choice.directions.iter().all(|&(j, _)| j == i || !self.dynamics.slide_together(i, j));
            self.dynamics.unseen[i] = if alone { self.unseen_slide(i, at, (rtol, atol)) } else { 0.0 };
        }
        for &i in &choice.begin {
            self.dynamics.begins[i] = self.unseen_slide(i, at, (rtol, atol)).max(f64::MIN_POSITIVE);
        }
    }

    /// What of the sliding velocity of contact `i` in space the tolerances do not see; its tangents are loaded.
    fn unseen_slide(&self, i: usize, at: &Point, (rtol, atol): (&[f64], &[f64])) -> f64 {
        let n_q = self.dynamics.mechanics.n_q;
        let unseen = |k: usize| -> f64 {
            let tangent = self.dynamics.tangent(i, k).iter().enumerate();
            tangent.map(|(j, b)| b.abs() * (rtol[n_q + j] * at.x[n_q + j].abs() + atol[n_q + j])).sum()
        };
        (0..self.dynamics.mechanics.contacts[i].n_tangents).map(unseen).fold(0.0, f64::max)
    }

    /// What of the gap of contact `i`, and of its rate, the tolerances do not see; its normal is loaded.
    fn unseen(
        &mut self,
        i: usize,
        at: &Point,
        n_q: usize,
        (rtol, atol): (&[f64], &[f64]),
        (row, n_z): (&mut Vec<f64>, usize),
    ) -> std::result::Result<[f64; 2], EvalError> {
        row.clear();
        row.resize(n_z, 0.0);
        self.dynamics.gap_gradient(at, i, row)?;
        let tolerance = |k: usize| rtol[k] * at.x[k].abs() + atol[k];
        let gap = (0..n_q).map(|k| row[k].abs() * tolerance(k)).sum();
        let normal = &self.dynamics.block(i).normal;
        Ok([gap, normal.iter().enumerate().map(|(k, n)| n.abs() * tolerance(n_q + k)).sum()])
    }

    /// Is the gap of contact `i` zero, and does it rest, as far as the tolerances see, with velocities by so many times as much? A body that
    /// rocks opens one side where it closes the other, at the same speed: both are held to the same measure.
    fn hardly_opens(
        &mut self,
        i: usize,
        at: &Point,
        tolerances: (&[f64], &[f64]),
        patience: f64,
        room: (&mut Vec<f64>, usize),
    ) -> std::result::Result<bool, EvalError> {
        self.dynamics.load_gap(at, i)?;
        let [gap, rate] = self.dynamics.block(i).gap;
        // far from it by any size
        if gap > 1e-3 * self.sizes[i][0] || rate.abs() > 1e-3 * self.sizes[i][3] {
            return Ok(false);
        }
        self.dynamics.load_contact(at, i)?;
        let n_q = self.dynamics.mechanics.n_q;
        let unseen = self.unseen(i, at, n_q, tolerances, room)?;
        Ok(gap <= LAST * unseen[0] && rate.abs() <= patience * unseen[1])
    }
}
