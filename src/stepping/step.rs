//! One step.

use super::near::Place;
use super::solver::{Limits, Outcome};
use super::{Statistics, Stepper};
use crate::error::{finite, Error, Result};
use crate::func::{EvalError, Point};
use crate::stop;
use crate::system::{Contact, ImpactLaw, Kind};

/// A gap may be negative at the start by this share of the coordinates in it, and by what the motion makes in two steps.
const START: f64 = 1e-3;
/// Shifts are found to this share of what the impulses move in a step.
const SHIFT: f64 = 1e-3;
/// The share of a penetration that stays at least.
const KEPT: f64 = 0.05;
/// Impacts one after the other in one step, by contact.
const SEQUENCE: usize = 1000;

impl Stepper {
    /// Sets time and state (coordinates, then velocities), and forgets the impulses and statistics of former steps.
    ///
    /// # Errors
    /// [`Error::Dimension`] and [`Error::Range`] for states that do not fit or are not finite, [`Error::Range`] if a gap is
    /// negative by more than a thousandth of the coordinates in it and more than the motion makes in two steps, or friction or
    /// restitution of a contact that is closed is out of range, or a coordinate outside of bounds that contacts were left out for, [`Error::NonFinite`] if a function is not defined there,
    /// [`Error::Numeric`] if the inertia is not positive definite.
    pub fn reset(&mut self, t: f64, x: &[f64]) -> Result<()> {
        finite("time", &[t], 1)?;
        finite("state", x, self.x.len())?;
        self.ready = false;
        self.t = t;
        self.x.copy_from_slice(x);
        self.impulses.fill([0.0; 3]);
        self.held.clear();
        self.stats = Statistics::default();
        (self.near.looked, self.near.bounded) = (0, 0);
        self.middle.copy_from_slice(x);
        self.check_bounds()?;
        self.evaluate_smooth(t)?;
        self.load_inertia(t)?;
        self.find_rates();
        self.forget_gaps();
        self.check_gaps()?;
        self.ready = true;
        Ok(())
    }

    /// The next step looks at all contacts.
    pub(super) fn forget_gaps(&mut self) {
        let h = self.options.h;
        self.near.reset(self.smooth[..self.mechanics.n_q].iter().map(|r| h * r));
    }

    /// `N v` and `f_v` at the middle of the step.
    fn evaluate_smooth(&mut self, t: f64) -> Result<()> {
        let m = &self.mechanics;
        let at = Point { t, x: &self.middle, u: &self.u, p: &self.p };
        let r = m.smooth.value(&at, &mut self.smooth, &mut self.work);
        r.map_err(|e| failed(e, m.smooth.name(), t))
    }

    fn load_inertia(&mut self, t: f64) -> Result<()> {
        let at = Point { t, x: &self.middle, u: &self.u, p: &self.p };
        match self.inertia.load(&self.mechanics, &at, &mut self.work) {
            Ok(true) => Ok(()),
            Ok(false) => Err(Error::Numeric(format!("the inertia is not positive definite at t = {t}"))),
            Err(e) => Err(failed(e, "inertia", t)),
        }
    }

    /// Entries of `N` if the pattern says that the rates of the coordinates depend on nothing but velocities: they are linear
    /// in them.
    fn find_rates(&mut self) {
        let (m, dims) = (&self.mechanics, self.mechanics.smooth.dims());
        let (n_q, p) = (m.n_q, m.smooth.jac_pattern());
        self.rates = None;
        let varies =
            (0..dims.n_in()).filter(|j| !(n_q..dims.x).contains(j)).any(|j| p.rows(j).iter().any(|r| *r < n_q));
        if varies || m.smooth.jacobian_is_approximate() {
            return;
        }
        let mut values = vec![0.0; p.nnz()];
        let at = Point { t: self.t, x: &self.x, u: &self.u, p: &self.p };
        if m.smooth.jacobian(&at, &mut values, &mut self.work).is_err() {
            return;
        }
        let mut entries: Vec<(usize, usize, f64)> = Vec::new();
        for j in n_q..dims.x {
            let of = p.range(j).zip(p.rows(j)).filter(|e| *e.1 < n_q);
            entries.extend(of.map(|(k, &i)| (i, j - n_q, values[k])));
        }
        entries.sort_unstable_by_key(|e| (e.0, e.1));
        self.rates = Some(entries);
    }

    fn check_gaps(&mut self) -> Result<()> {
        let m = self.mechanics.clone();
        let h = self.options.h;
        self.free.copy_from_slice(&self.smooth[m.velocities()]);
        self.inertia.solve(&mut self.free);
        let place = Place { t: self.t, q: &self.x[..m.n_q], u: &self.u, p: &self.p };
        for (c, contact) in m.contacts.iter().enumerate() {
            let l = &self.contacts[c];
            let gap = self.near.gap(&place, c).map_err(|e| failed(e, &format!("gap of {}", contact.name), self.t))?;
            if gap >= 0.0 && contact.kind.opens() {
                continue;
            }
            let own: Vec<f64> = l
                .coordinates
                .iter()
                .copied()
                .chain(l.velocities.iter().map(|v| m.n_q + v))
                .chain(l.others.iter().map(|z| m.velocities().end + z))
                .map(|i| self.x[i])
                .collect();
            let at = Point { t: self.t, x: &own, u: &self.u, p: &self.p };
            // what is local has no derivatives: hardly any contact is closed at the start
            let (whole, p) = (Point { x: &self.x, ..at }, contact.gap.jac_pattern());
            let mut slopes = vec![0.0; p.nnz()];
            let mut work = vec![0.0; contact.gap.work_len().max(l.rows.work_len())];
            let mut rows = vec![0.0; l.rows.n_out()];
            let name = &contact.name;
            let gap_failed = |e| failed(e, &format!("gap of {name}"), self.t);
            contact.gap.jacobian(&whole, &mut slopes, &mut work).map_err(gap_failed)?;
            l.rows.value(&at, &mut rows, &mut work).map_err(|e| failed(e, &format!("normal of {name}"), self.t))?;
            let slope = |j: usize| p.range(j).filter(|&k| p.row_idx()[k] == 0).map(|k| slopes[k]).sum::<f64>();
            let size: f64 = l.coordinates.iter().map(|&j| (slope(j) * self.x[j]).abs()).sum();
            let move_ = |(n, &j): (&f64, &usize)| n.abs() * (self.x[m.n_q + j].abs() + h * self.free[j].abs());
            let motion: f64 = rows[3..].iter().zip(&l.velocities).map(move_).sum();
            let allowed = START * size + 2.0 * h * motion;
            if contact.kind == Kind::Bilateral {
                let rate = rows[0];
                let speed: f64 =
                    rows[3..].iter().zip(&l.velocities).map(|(n, &j)| (n * self.x[m.n_q + j]).abs()).sum::<f64>();
                if gap.abs() > START * size || rate.abs() > START * speed {
                    return Err(Error::Range(format!(
                        "constraint {name} is not satisfied at the start: it is {gap}, its rate {rate}; start with coordinates \
                         and velocities at which both vanish"
                    )));
                }
                continue;
            }
            if -gap > allowed {
                return Err(Error::Range(format!(
                    "the gap of contact {name} is {gap} at the start: bodies may overlap by {allowed:.3e} there, start with \
                     gaps that are not negative"
                )));
            }
            let stiction = if contact.stiction { rows[rows.len() - 1] } else { rows[1] };
            check_law(contact, [rows[1], stiction], rows[2])?;
        }
        Ok(())
    }

    /// Makes one step of the length in the options.
    ///
    /// # Errors
    /// [`Error::State`] before [`Stepper::reset`] and after a step that failed, [`Error::NonFinite`] if a function is not
    /// defined where the step needs it or the state grows beyond all numbers, [`Error::Range`] if friction or restitution of a
    /// closed contact is out of range, [`Error::Numeric`] if the inertia is not positive definite, [`Error::Interrupted`] and
    /// [`Error::OutOfTime`] if the call is to end: then the step was not made, and can be.
    pub fn step(&mut self) -> Result<()> {
        let (t, h) = (self.t, self.options.h);
        self.step_to(t + h, h)
    }

    /// Makes equal steps, not longer than that of the options, that end at time `t`.
    pub fn advance(&mut self, t: f64) -> Result<()> {
        let n = self.count_steps(t)?;
        let (from, h) = (self.t, (t - self.t) / n as f64);
        for k in 1..=n {
            let end = if k == n { t } else { from + h * k as f64 };
            self.step_to(end, h)?;
        }
        Ok(())
    }

    /// Steps from here to time `t`.
    pub(super) fn count_steps(&self, t: f64) -> Result<u64> {
        finite("time", &[t], 1)?;
        if t < self.t {
            return Err(Error::Range(format!("the end {t} lies before the time {}: steps go forward", self.t)));
        }
        // a whole number of steps up to rounding is that number
        let n = ((t - self.t) / self.options.h * (1.0 - 1e-9)).ceil();
        if n > 1e15 {
            return Err(Error::Range(format!("{n} steps to time {t}: h is {}", self.options.h)));
        }
        Ok(n as u64)
    }

    /// One step of length `h` that ends at time `end`.
    pub(super) fn step_to(&mut self, end: f64, h: f64) -> Result<()> {
        stop::check()?;
        if !self.ready {
            return Err(Error::State("the stepper has no state to go on from: set its state first".into()));
        }
        self.ready = false;
        let r = self.make_step(h);
        // a step that was to end early has not changed the state
        self.ready = matches!(r, Ok(()) | Err(Error::Interrupted | Error::OutOfTime));
        if r.is_err() {
            self.forget_gaps();
        }
        r?;
        self.t = end;
        self.stats.steps += 1;
        Ok(())
    }

    fn make_step(&mut self, h: f64) -> Result<()> {
        let m = self.mechanics.clone();
        let (n_q, theta) = (m.n_q, self.options.theta);
        let t = self.t + (1.0 - theta) * h;
        self.middle.copy_from_slice(&self.x);
        let part = (1.0 - theta) * h;
        if self.rates.is_none() && part > 0.0 {
            self.evaluate_smooth(self.t)?;
        }
        self.move_middle(part);
        let place = Place { t, q: &self.middle[..n_q], u: &self.u, p: &self.p };
        self.near
            .look(&place, self.options.h)
            .map_err(|(c, e)| failed(e, &format!("gap of {}", m.contacts[c].name), t))?;
        self.evaluate_smooth(t)?;
        self.load_inertia(t)?;
        let velocities = m.velocities();
        self.free.copy_from_slice(&self.smooth[velocities.clone()]);
        let states = self.x[velocities.end..].iter().zip(&self.smooth[velocities.end..]);
        self.rest.iter_mut().zip(states).for_each(|(r, (z, rate))| *r = z + h * rate);
        self.inertia.solve(&mut self.free);
        self.load_contacts(t)?;
        // velocities with forces, and with the impulses that were there in the last step
        self.v.copy_from_slice(&self.x[velocities.clone()]);
        let sequential = self.law == ImpactLaw::Sequential;
        if sequential {
            self.impacts_in_sequence();
        }
        self.v.iter_mut().zip(&self.free).for_each(|(v, a)| *v += h * a);
        self.solve(sequential, h);
        self.shift.fill(0.0);
        if self.options.correct && self.rows.len() > 0 {
            self.correct(h);
        }
        // θ h v⁺ + shift as a velocity over the whole step
        let (v, shift) = (&self.v, &self.shift);
        let mean = self.middle[n_q..].iter_mut().zip(v.iter().zip(shift));
        mean.for_each(|(m, (v, s))| *m = theta * v + s / h);
        if self.rates.is_none() {
            self.evaluate_smooth(t)?;
        }
        self.move_middle(h);
        self.x[..n_q].copy_from_slice(&self.middle[..n_q]);
        self.x[velocities.end..].copy_from_slice(&self.rest);
        self.x[velocities].copy_from_slice(&self.v);
        self.check_bounds()?;
        if let Some(i) = self.x.iter().position(|v| !v.is_finite()) {
            return Err(Error::NonFinite(format!(
                "state {i} is {} after the step from t = {}: forces that the step does not resolve grow without end, make it \
                 shorter",
                self.x[i], self.t
            )));
        }
        Ok(())
    }

    /// Nothing is known of the contacts that were left out where the coordinates leave the bounds.
    fn check_bounds(&self) -> Result<()> {
        let outside = |b: &Option<(f64, f64)>, x: f64| b.is_some_and(|(low, high)| x < low || x > high);
        match self.mechanics.bounds.iter().zip(&self.x).position(|(b, x)| outside(b, *x)) {
            None => Ok(()),
            Some(i) => Err(Error::Range(format!(
                "coordinate {i} is {}, in the step from t = {}: outside of the bounds that contacts of the scene were left \
                 out for, widen them",
                self.x[i], self.t
            ))),
        }
    }

    /// Moves the coordinates of the middle by `h N v`, with the velocities that stand there.
    fn move_middle(&mut self, h: f64) {
        let n_q = self.mechanics.n_q;
        let (q, v) = self.middle.split_at_mut(n_q);
        match &self.rates {
            Some(entries) => entries.iter().for_each(|&(i, j, n)| q[i] += h * (n * v[j])),
            None => q.iter_mut().zip(&self.smooth).for_each(|(q, r)| *q += h * r),
        }
    }

    /// Rows of the closed contacts.
    fn load_contacts(&mut self, t: f64) -> Result<()> {
        self.rows.clear();
        let at = Point { t, x: &self.middle, u: &self.u, p: &self.p };
        for (&c, &gap) in self.near.active.iter().zip(&self.near.gaps) {
            let own = &self.mechanics.contacts[c];
            let contact = (&self.contacts[c], self.mechanics.n_q, own);
            let r = self.rows.add(contact, &self.touched, &self.inertia, &at, (c, gap), &mut self.work);
            r.map_err(|e| failed(e, &format!("normal of {}", own.name), t))?;
            let a = self.rows.len() - 1;
            check_law(own, [self.rows.friction[a], self.rows.stiction[a]], self.rows.restitution[a])?;
            if -gap > self.stats.penetration && own.kind.opens() {
                (self.stats.penetration, self.stats.deepest) = (-gap, Some(c));
            }
        }
        self.stats.contacts += self.rows.len() as u64;
        self.stats.most_contacts = self.stats.most_contacts.max(self.rows.len());
        Ok(())
    }

    /// Impulses and velocities at the end of the step. `settled`: impacts are over, what is left has no restitution.
    fn solve(&mut self, settled: bool, h: f64) {
        let rows = &mut self.rows;
        self.solver.part.clear();
        self.solver.part.extend((0..rows.len()).map(|a| rows.acts(a)));
        self.solver.normal_only = false;
        let before = std::mem::take(&mut self.normal);
        for a in 0..rows.len() {
            let (c, first) = (rows.contact[a], rows.first[a]);
            if !settled {
                rows.drive[first] += rows.restitution[a] * rows.rate[a].min(0.0);
            }
            let known = if settled { [0.0; 3] } else { self.impulses[c] };
            let lead = usize::from(rows.is_joint(a));
            if lead > 0 {
                // the bounds are those of forces
                rows.impulse[first] = h;
            }
            for k in lead..=rows.n_tangents(a) {
                if self.solver.part[a] && known[k] != 0.0 {
                    rows.impulse[first + k] = known[k];
                    rows.push(&self.touched, a, first + k, known[k], &mut self.v);
                }
            }
        }
        for &c in &self.held {
            self.impulses[c] = [0.0; 3];
        }
        self.held.clear();
        let o = &self.options;
        let limits = Limits { tolerance: o.tolerance, iterations: o.max_iterations, energy: 0.0 };
        let out = match rows.len() {
            0 => Outcome { converged: true, ..Outcome::default() },
            _ => self.solver.solve(rows, &self.touched, &mut self.v, &limits),
        };
        for a in 0..rows.len() {
            let (c, first) = (rows.contact[a], rows.first[a]);
            for k in usize::from(rows.is_joint(a))..=rows.n_tangents(a) {
                let earlier = if settled { before.get(first + k).copied().unwrap_or(0.0) } else { 0.0 };
                self.impulses[c][k] = rows.impulse[first + k] + earlier;
            }
            self.held.push(c);
        }
        self.normal = before;
        self.count(&out);
        if !out.converged {
            self.stats.unconverged += 1;
            self.stats.worst_change = self.stats.worst_change.max(out.change);
        }
    }

    fn count(&mut self, out: &Outcome) {
        self.stats.sweeps += out.sweeps as u64;
        self.stats.gradients += out.gradients as u64;
    }

    /// Newton's law for one contact after the other, the one with the most energy of closing first; what they add up to is left
    /// in `normal`, by row.
    fn impacts_in_sequence(&mut self) {
        let (rows, t) = (&mut self.rows, &self.touched);
        self.normal.clear();
        self.normal.resize(rows.impulse.len(), 0.0);
        let mut first_energy = 0.0;
        for n in 0..SEQUENCE * rows.len() {
            let mut fastest: Option<(usize, f64, f64)> = None;
            for a in (0..rows.len()).filter(|&a| rows.acts(a) && !rows.is_joint(a)) {
                let r = rows.first[a];
                let rate = rows.drive[r] + rows.times(t, a, r, &self.v);
                let energy = rate * rate / rows.own[a][0];
                if (rate < 0.0 || rows.kind[a] == Kind::Bilateral) && fastest.is_none_or(|f| energy > f.2) {
                    fastest = Some((a, rate, energy));
                }
            }
            let Some((a, rate, energy)) = fastest else { break };
            if n == 0 {
                first_energy = energy;
            }
            if energy <= self.options.tolerance * self.options.tolerance * first_energy {
                break;
            }
            let (r, n_t) = (rows.first[a], rows.n_tangents(a));
            let mut rates = [(1.0 + rows.restitution[a]) * rate, 0.0, 0.0];
            for k in 1..=n_t {
                rates[k] = rows.drive[r + k] + rows.times(t, a, r + k, &self.v);
            }
            let z = super::solver::alone(&rows.own[a], rates, rows.friction[a], (n_t, rows.least(a)));
            for k in 0..=n_t {
                self.normal[r + k] += z[k];
                rows.push(t, a, r + k, z[k], &mut self.v);
            }
        }
    }

    /// The shift of the coordinates, as one of velocities, that brings back what came to rest too deep.
    fn correct(&mut self, h: f64) {
        let n_q = self.mechanics.n_q;
        let (rows, t, v) = (&mut self.rows, &self.touched, &self.v);
        let (mut any, mut energy) = (false, 0.0);
        for a in 0..rows.len() {
            let first = rows.first[a];
            if rows.is_joint(a) {
                self.solver.part[a] = false;
                continue;
            }
            let (l, w) = (rows.impulse[first], rows.own[a][0]);
            let holds = rows.kind[a] == Kind::Bilateral;
            let pushes = (l > 0.0 || holds) && self.solver.part[a];
            energy += if pushes { l * l * w } else { 0.0 };
            // the drive holds the restitution by now, so the rate is counted from that at the start
            let start = rows.times(t, a, first, &self.x[n_q..]);
            let rate = rows.rate[a] + rows.times(t, a, first, v) - start;
            let end = rows.gap[a] + self.options.theta * h * rate;
            let depth = (0.5 * h * h * rows.times_abs(t, a, first, &self.free)).max(-KEPT * end);
            let stays = pushes && end + h * rate < -depth;
            any |= stays || holds && pushes && end != 0.0;
            rows.drive[first] = match (holds, stays) {
                (true, _) => end,
                (_, true) => end + depth,
                _ => (end + depth).max(0.0),
            };
            rows.impulse[first] = 0.0;
        }
        if !any {
            return;
        }
        self.solver.normal_only = true;
        let o = &self.options;
        let limits = Limits { tolerance: SHIFT, iterations: o.max_iterations, energy: h * h * energy };
        let out = self.solver.solve(rows, t, &mut self.shift, &limits);
        self.count(&out);
    }
}

fn check_law(contact: &Contact, [friction, stiction]: [f64; 2], restitution: f64) -> Result<()> {
    let name = &contact.name;
    let what = if contact.kind == Kind::Joint { "joint" } else { "contact" };
    if friction.is_nan() || friction < 0.0 {
        return Err(Error::Range(format!("the friction of {what} {name} is {friction}: it must not be negative")));
    }
    if stiction.is_nan() || stiction < friction {
        return Err(Error::Range(format!(
            "{what} {name} sticks by the friction {stiction} and slides with {friction}: what holds must not be less"
        )));
    }
    if !(0.0..=1.0).contains(&restitution) {
        return Err(Error::Range(format!(
            "the restitution of contact {name} is {restitution}: it must be between 0 and 1"
        )));
    }
    Ok(())
}

fn failed(e: EvalError, what: &str, t: f64) -> Error {
    match e {
        EvalError::Stopped => stop::error(),
        EvalError::Fatal(code) => Error::User { code, what: what.to_owned() },
        EvalError::Recoverable => Error::NonFinite(format!("{what} is not finite at t = {t}, where a step needs it")),
    }
}
