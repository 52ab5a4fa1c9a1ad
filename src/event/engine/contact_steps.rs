//! Contacts within a step: which are looked at, what their forces do between its ends, and what puts closed ones back at its end.

use super::{recover, Engine, EPS};
use crate::contact::{mode, Dynamics};
use crate::error::{Error, Result};
use crate::event::explicit::Pair;
use crate::event::field::TO_RATE;
use crate::event::watch::{ContactWatch, Watch};
use crate::func::EvalError;
use crate::system::Kind;

/// The stages that a cubic is laid through, with the ends, and where it is compared.
struct StagesOfForce {
    /// The last stage before the end.
    last: usize,
    through: [usize; 2],
    /// Of the start, the two stages and the end, in the value of the cubic where it is compared.
    weights: [f64; 4],
    /// It is compared in the middle of the step, which has no stage near it.
    middle: bool,
    /// Else at this stage.
    at: usize,
}

/// Nodes 0, 0.3, 0.8, 1, compared at 0.5.
const DP5: StagesOfForce = StagesOfForce {
    last: 5,
    through: [2, 3],
    weights: [-1.0 / 8.0, 5.0 / 7.0, 5.0 / 8.0, -3.0 / 14.0],
    middle: true,
    at: 0,
};

/// Nodes 0, 1/3, 6/7, 1, compared at 3/5.
const DOP853: StagesOfForce = StagesOfForce {
    last: 11,
    through: [5, 10],
    weights: [-12.0 / 125.0, 729.0 / 1375.0, 1372.0 / 1375.0, -54.0 / 125.0],
    middle: false,
    at: 9,
};

impl Engine {
    /// Decides which contacts are looked at in the step that was tried, and evaluates those that were not until now where it
    /// begins.
    pub(super) fn look_near(&mut self) -> std::result::Result<(), EvalError> {
        if !self.field.look_near(&self.stepper.step, self.stepper.step_implicit) {
            return Ok(());
        }
        self.functions.looked.clear();
        for (l, w) in self.functions.watches.iter().enumerate() {
            if !self.field.looks_at(w) {
                continue;
            }
            self.functions.looked.push(l);
            if let Watch::Contact { contact, what: ContactWatch::Gap, a } = *w {
                if let Some([gap, rate]) = self.field.approach(contact, &self.stepper.step)? {
                    (self.functions.q0[a], self.functions.q0[a + TO_RATE]) = (gap, rate);
                    (self.functions.w0[l], self.functions.depart[l]) = (gap, 0);
                }
            }
        }
        Ok(())
    }

    /// Notes the contacts whose functions may vanish in the step; says whether there are forces among these, none if there
    /// are no contacts at all.
    pub(super) fn wanted_contacts(&mut self) -> Option<bool> {
        if !self.field.has_contacts() {
            return None;
        }
        self.contact_events.wanted.fill(false);
        let mut forces = false;
        for &l in self.functions.looked.iter().filter(|l| self.functions.suspect[**l]) {
            if let Watch::Contact { contact, what, .. } = self.functions.watches[l] {
                self.contact_events.wanted[contact] = true;
                forces |= what.is_force();
            }
        }
        Some(forces)
    }

    /// Values of what is watched inside of a step, where the state is interpolated from its ends: in the middle, and at the
    /// quarters where forces are not known at the stages.
    pub(super) fn look_inside(&mut self) -> std::result::Result<(), EvalError> {
        let closed = self.field.active.iter().any(|set| set[0] != mode::OPEN);
        let (quarters, forces) =
            (closed && self.stepper.step_implicit, closed && self.stages().is_none_or(|s| s.middle));
        for (w, set) in self.contact_events.wanted.iter_mut().zip(&self.field.active) {
            *w = set[0] != mode::OPEN;
        }
        let (h, t) = (self.stepper.step.h, self.stepper.step.t);
        for (k, s) in [(0, 0.25), (2, 0.75), (1, 0.5)] {
            if k != 1 && !quarters {
                continue;
            }
            if let (1, Some(c)) = (k, self.field.scene()) {
                // of open contacts the middle is enough
                self.contact_events.wanted.iter_mut().enumerate().for_each(|(i, w)| *w = c.is_near(i));
            }
            let (a, b) = ((1.0 + 2.0 * s) * (1.0 - s) * (1.0 - s), s * s * (3.0 - 2.0 * s));
            let (da, db) = (h * s * (1.0 - s) * (1.0 - s), h * s * s * (s - 1.0));
            let step = &self.stepper.step;
            for (i, m) in self.stepper.node.iter_mut().enumerate() {
                *m = a * step.x0[i] + b * step.x1[i] + da * step.f0[i] + db * step.f1[i];
            }
            self.field.scene_values((t + s * h, &self.stepper.node), forces, |c| self.contact_events.wanted[c])?;
            for &l in &self.functions.looked {
                self.functions.samples[l][k] = self.functions.watches[l].value(&self.field.q, &self.field);
            }
        }
        Ok(())
    }

    /// Which stages of an explicit step tell how a contact force goes; none in implicit steps.
    fn stages(&self) -> Option<&'static StagesOfForce> {
        match self.stepper.pair {
            _ if self.stepper.step_implicit => None,
            // which scenes are not integrated by
            Pair::Bs3 => None,
            Pair::Dp5 => Some(&DP5),
            Pair::Dop853 => Some(&DOP853),
        }
    }

    /// Might a contact force vanish in the step, and how well does the step resolve it: the error of a cubic through some of
    /// its values, relative to a tenth of its size?
    pub(super) fn screen_force(&self, l: usize, contact: usize, what: ContactWatch) -> (bool, f64) {
        const FRACTION: f64 = 0.1;
        let (w0, w1) = (self.functions.w0[l], self.functions.w1[l]);
        let samples = &self.functions.samples[l];
        let (mut low, mut high) = (w0.min(w1), w0.max(w1));
        let mut note = |v: f64| (low, high) = (low.min(v), high.max(v));
        let error = match self.stages().zip(self.field.force_at_stages(contact, what)) {
            Some((s, at)) => {
                at[1..=s.last].iter().for_each(|v| note(*v));
                let value = if s.middle { samples[1] } else { at[s.at] };
                note(value);
                let [a, b] = s.through.map(|i| at[i]);
                (value - (s.weights[0] * w0 + s.weights[1] * a + s.weights[2] * b + s.weights[3] * w1)).abs()
            }
            None => {
                let [a, b, c] = [samples[0], samples[1], samples[2]];
                [a, b, c].into_iter().for_each(&mut note);
                (b - (4.0 * (a + c) - w0 - w1) / 6.0).abs()
            }
        };
        let rounding =
            1e3 * EPS * self.functions.watches[l].scale(&self.functions.dq0, &self.field, self.t, &self.x).value;
        (low <= 4.0 * error + 0.25 * (high - low), error / (FRACTION * high.abs().max(low.abs()) + rounding))
    }

    /// Order of the zero a function of a contact has at the start of a phase.
    pub(super) fn contact_departs(&mut self, w: Watch, value: f64) -> u8 {
        let Watch::Contact { contact, what, a } = w else { return 0 };
        let scale = w.scale(&self.functions.dq0, &self.field, self.t, &self.x).value;
        let Some(c) = self.field.scene() else { return 0 };
        let rate_size = c.sizes[contact][3];
        let rate = self.functions.q0[a + TO_RATE];
        let near = (64.0 * EPS * scale).max(8.0 * EPS * rate.abs() * self.t.abs());
        match what {
            _ if what.is_force() => u8::from(value <= 1e-9 * scale),
            _ if value > near => 0,
            ContactWatch::Gap if rate > 64.0 * EPS * rate_size => 1,
            // a contact that has just opened without velocity: by its acceleration, or by what follows
            ContactWatch::Gap => 3,
            _ if rate > 1e-9 * scale * self.field.pace(&self.x, &self.f) => 1,
            _ => 2,
        }
    }

    /// Puts the gaps of closed contacts, and the velocities that are held, back to zero at the end of a step. Says whether
    /// the state has moved; the velocities belong to the new state then.
    pub(super) fn settle_contacts(&mut self) -> Result<bool> {
        if let Some(i) = self.outside() {
            return Err(Error::State(format!(
                "t = {}: coordinate {i} is {}, outside of the bounds that contacts of the scene were left out for: widen them",
                self.t, self.x[i]
            )));
        }
        if self.field.active.iter().all(|s| s[0] == mode::OPEN) {
            return Ok(false);
        }
        let (t, mut x) = (self.t, std::mem::take(&mut self.x));
        // the projection takes the state by itself, for it changes it
        let moved = self.field.with_contacts(t, &[], |c, at, modes| {
            for (i, set) in modes.iter().enumerate().filter(|(_, s)| Dynamics::slides(s[0])) {
                c.dynamics.keep_direction(i, set[0]);
            }
            let (sizes, dynamics) = (&mut c.sizes, &mut c.dynamics);
            for (i, (size, f)) in sizes.iter_mut().zip(&dynamics.forces).enumerate() {
                size[1] = size[1].max(f[usize::from(dynamics.is_joint(i))].abs());
            }
            let joints: Vec<bool> = match dynamics.has_joints() {
                true => (0..modes.len()).map(|i| dynamics.is_joint(i)).collect(),
                false => Vec::new(),
            };
            let rate = |i: usize| if joints.get(i) == Some(&true) { sizes[i][2] } else { sizes[i][3] };
            // as soon as it is more than the rounding of a few operations
            dynamics.project(at, modes, &mut x, &|i, _| [16.0 * EPS * sizes[i][0], 16.0 * EPS * rate(i)])
        });
        self.x = x;
        self.check_joints()?;
        self.check_constraints()?;
        let Some(moved) = recover(moved.unwrap_or(Ok(false)).map(Some), None)? else { return Ok(false) };
        if moved {
            self.field.forget();
            let r = self.field.rhs(t, &self.x, &mut self.f).and_then(|()| self.field.watched(t, &self.x));
            recover(r.map(|()| true), false)?;
        }
        Ok(moved)
    }

    /// A bound of the friction of a joint may be an expression that is fine at the start and not later.
    fn check_joints(&mut self) -> Result<()> {
        let t = self.t;
        let bad = self.field.scene().filter(|c| c.dynamics.has_joints()).and_then(|c| {
            let joints = (0..c.dynamics.n_contacts()).filter(|i| c.dynamics.is_joint(*i));
            joints.filter_map(|i| c.flaw_of_friction(i)).next()
        });
        bad.map_or(Ok(()), |text| Err(Error::State(format!("t = {t}: {text}"))))
    }

    /// Constraints that contradict each other, or whose gradient vanishes, are not held by any force.
    fn check_constraints(&mut self) -> Result<()> {
        /// Share of its size that is far beyond what is left of the drift of a step.
        const FAR: f64 = 1e-6;
        let loosest = self.rtol.iter().fold(FAR, |m, v| m.max(*v));
        let t = self.t;
        let bad = self.field.with_contacts(t, &self.x, |c, at, _| {
            for i in 0..c.dynamics.n_contacts() {
                if c.dynamics.mechanics.contacts[i].kind != Kind::Bilateral || c.dynamics.load_gap(at, i).is_err() {
                    continue;
                }
                let ([gap, rate], size) = (c.dynamics.block(i).gap, c.sizes[i]);
                if gap.abs() > loosest * size[0] || rate.abs() > loosest * size[3] {
                    return Some((c.dynamics.mechanics.contacts[i].name.clone(), gap, rate));
                }
            }
            None
        });
        let Some((name, gap, rate)) = bad.flatten() else { return Ok(()) };
        Err(Error::State(format!(
            "t = {t}: constraint {name} cannot be held: it is {gap}, and its rate {rate}; its gradient vanishes there, or it \
             contradicts other constraints"
        )))
    }

    /// A coordinate beyond the bounds that the reduction relies on.
    pub(super) fn outside(&self) -> Option<usize> {
        let bounds = &self.field.scene().filter(|_| !self.contact_events.passes_bounds)?.dynamics.mechanics.bounds;
        let mut all = bounds.iter().zip(&self.x).enumerate();
        all.find(|(_, (b, x))| b.is_some_and(|(low, high)| !(**x >= low && **x <= high))).map(|(i, _)| i)
    }
}
