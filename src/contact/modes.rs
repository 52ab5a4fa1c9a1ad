//! Which contact modes may follow at a point: a complementarity problem of forces and accelerations, and, where that leaves
//! quantities at zero, of the way they go from there.

use super::dynamics::{dot, At, Dynamics, Forces};
use super::mode;
use super::problem::{Part, Problem, Solution, State};
use super::sensitivity::{add_jacobian, zeros};
use crate::func::{EvalError, Point};
use crate::system::Kind;

/// Modes of all contacts that may follow.
#[derive(Debug, Clone)]
pub(crate) struct Choice {
    /// The modes.
    pub(crate) modes: Vec<Vec<usize>>,
    /// Directions of contacts in space that begin to slide.
    pub(crate) directions: Vec<(usize, [f64; 2])>,
    /// Those of them that have no sliding velocity.
    pub(crate) begin: Vec<usize>,
    /// Forces of the closed contacts: which are meant where the modes leave them open.
    forces: Vec<(usize, Forces)>,
}

/// What may follow.
#[derive(Debug, Clone, Default)]
pub(crate) struct Follow {
    /// The choices, those with most forces first.
    pub(crate) all: Vec<Choice>,
    /// There are forces, but whichever are taken leave the states that they belong to at once: the motion is not determined.
    pub(crate) undetermined: bool,
}

/// A closed contact whose next mode is looked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Closed {
    pub(crate) contact: usize,
    /// It does not slide: its sliding velocity is zero.
    pub(crate) rests: bool,
}

/// Share of its size that is zero for a quantity at a located event.
pub(crate) const ZERO: f64 = 1e-9;

impl Dynamics {
    /// The modes that may follow where these contacts are closed and the others open. Over a time `length` the solution
    /// hardly changes; what is `loaded` already is not evaluated again; `lately` are sizes that the normal forces had, for where all of what they consist of vanishes.
    pub(crate) fn follow(
        &mut self,
        at: &At,
        closed: &[Closed],
        lately: &dyn Fn(usize) -> f64,
        (length, loaded): (f64, bool),
    ) -> Result<Follow, EvalError> {
        let listed = self.fix_weights(at, closed)?;
        let closed = listed.as_deref().unwrap_or(closed);
        let tried = self.signs_to_try(closed);
        if tried.is_empty() && self.multiplied(closed).is_some() {
            return Ok(Follow::default());
        }
        if tried.is_empty() {
            return self.follow_with(at, closed, &[], lately, (length, loaded));
        }
        // of switches that multiply each other one has a sign that is tried, so that the problem is linear
        let weights = self.weights.clone();
        let first = self.n_contacts() - weights.len();
        let mut out = Follow::default();
        for signs in tried {
            self.weights.copy_from_slice(&weights);
            signs.iter().for_each(|&(i, sign)| self.weights[i - first] = sign);
            let found = self.follow_with(at, closed, &signs, lately, (length, false))?;
            out.undetermined |= found.undetermined;
            for c in found.all {
                if out.all.iter().all(|o: &Choice| o.modes != c.modes) {
                    out.all.push(c);
                }
            }
        }
        Ok(out)
    }

    /// The modes that may follow where these switches at zero have these signs.
    fn follow_with(
        &mut self,
        at: &At,
        closed: &[Closed],
        signs: &[(usize, f64)],
        lately: &dyn Fn(usize) -> f64,
        (length, loaded): (f64, bool),
    ) -> Result<Follow, EvalError> {
        // what is loaded under modes has the friction of sliding joints in it
        if !loaded || self.has_joints() {
            self.load(at)?;
        }
        for c in closed {
            self.load_contact(at, c.contact)?;
        }
        let mut problem = std::mem::take(&mut self.problem);
        self.delassus(closed.iter().map(|c| c.contact), &mut problem);
        let sum = |row: &[f64], a: &[f64]| row.iter().zip(a).map(|(r, a)| (r * a).abs()).sum::<f64>();
        let m = self.rows.len();
        for r in &self.rows {
            let b = &self.blocks[r.contact];
            problem.free.push(dot(b.row(r.component), &self.free) + b.rest_of(r.component));
        }
        let mut first = 0;
        for c in closed {
            let (b, n_t) = (&self.blocks[c.contact], self.mechanics.contacts[c.contact].n_tangents);
            let kind = self.mechanics.contacts[c.contact].kind;
            let lead = first + usize::from(kind.has_no_normal());
            let lately = problem.matrix[lead * m + lead] * lately(c.contact);
            let size = (0..=n_t).map(|k| sum(b.row(k), &self.free) + b.rest_of(k).abs()).fold(lately, f64::max);
            let s = b.sliding;
            let speed = s[0].hypot(s[1]);
            let begins = n_t == 2 && self.follows(c.contact);
            let along = || if begins { self.settled[c.contact] } else { [s[0] / speed, s[1] / speed] };
            let slides = (n_t > 0 && !c.rests && speed > 0.0).then(along);
            let (friction, stiction) = (b.friction, b.stiction);
            let given = signs.iter().find(|s| s.0 == c.contact).map(|s| s.1);
            problem.parts.push(Part { first, n_t, friction, stiction, kind, slides, given, size });
            problem.start.extend_from_slice(&self.forces[c.contact][..=n_t]);
            first += 1 + n_t;
        }
        let found = problem.solve(&mut self.room);
        let mut out = Follow::default();
        let r = found.all.iter().try_for_each(|s| {
            let choice = self.choice(closed, &problem.parts, s);
            if self.do_not_go_on(at, closed, &problem, s, &choice, length)?.is_empty() {
                out.all.push(choice);
            }
            Ok(())
        });
        let has_forces = !found.all.is_empty();
        let r = match (r, found.all.into_iter().next()) {
            (Ok(()), Some(s)) if out.all.is_empty() => {
                self.change_borders(at, closed, &problem, s, length).map(|c| out.all.extend(c))
            }
            (r, _) => r,
        };
        out.undetermined = has_forces && out.all.is_empty();
        self.keep_sticking(&mut out.all, closed);
        problem.clear();
        self.problem = problem;
        r.map(|()| out)
    }

    /// Signs of switches at rest that are to be tried one after the other, so that of two that multiply each other one has a weight that is
    /// given. Empty where none do, or too many.
    fn signs_to_try(&self, closed: &[Closed]) -> Vec<Vec<(usize, f64)>> {
        /// Switches that multiply each other and vanish together: 3^6 sets of signs.
        const MOST: usize = 6;
        let first = self.first_switch();
        let rests = |k: usize| closed.iter().any(|c| c.contact == first + k);
        let pairs: Vec<[usize; 2]> =
            self.mechanics.products.iter().copied().filter(|p| rests(p[0]) && rests(p[1])).collect();
        if pairs.is_empty() {
            return Vec::new();
        }
        let mut all: Vec<usize> = pairs.iter().flatten().copied().collect();
        all.sort_unstable();
        all.dedup();
        if all.len() > MOST {
            return Vec::new();
        }
        let mut out = Vec::new();
        for code in 0..3usize.pow(all.len() as u32) {
            let mut rest = code;
            let mut signs = Vec::new();
            for &k in &all {
                match rest % 3 {
                    1 => signs.push((first + k, 1.0)),
                    2 => signs.push((first + k, -1.0)),
                    _ => {}
                }
                rest /= 3;
            }
            let given = |k: usize| signs.iter().any(|s| s.0 == first + k);
            if pairs.iter().all(|p| given(p[0]) || given(p[1])) {
                out.push(signs);
            }
        }
        out
    }

    /// Two switches at rest that multiply each other: their weights are not the solution of a linear problem.
    pub(crate) fn multiplied(&self, closed: &[Closed]) -> Option<[usize; 2]> {
        let first = self.first_switch();
        let rests = |k: usize| closed.iter().any(|c| c.contact == first + k && c.rests);
        let pair = self.mechanics.products.iter().find(|p| rests(p[0]) && rests(p[1]))?;
        Some(pair.map(|k| first + k))
    }

    /// Gives the switches the weights their signs say, and zero to those at rest, which are part of the problem; returns what else is. None where
    /// there are no switches.
    fn fix_weights(&mut self, at: &At, closed: &[Closed]) -> Result<Option<Vec<Closed>>, EvalError> {
        if self.weights.is_empty() {
            return Ok(None);
        }
        let mut listed = closed.to_vec();
        for c in closed {
            let Some(k) = self.switch(c.contact) else { continue };
            self.load_contact(at, c.contact)?;
            let s = self.blocks[c.contact].sliding[0];
            let given = !c.rests && s != 0.0;
            self.weights[k] = if given { s.signum() } else { 0.0 };
            if given {
                listed.retain(|l| l.contact != c.contact);
            }
        }
        Ok(Some(listed))
    }

    /// Where friction holds more than it does to something that slides, both may be solutions: what sticks goes on sticking. Leaves out
    /// choices in which less of it does than in another.
    fn keep_sticking(&self, all: &mut Vec<Choice>, closed: &[Closed]) {
        let holds_more = |i: &usize| self.blocks[*i].stiction > self.blocks[*i].friction;
        let some: Vec<usize> = closed.iter().map(|c| c.contact).filter(holds_more).collect();
        if some.is_empty() || all.len() < 2 {
            return;
        }
        let sticks = |c: &Choice, i: usize| c.modes[i][0] == mode::CLOSED;
        let less = |a: &Choice, b: &Choice| {
            some.iter().all(|&i| !sticks(a, i) || sticks(b, i)) && some.iter().any(|&i| !sticks(a, i) && sticks(b, i))
        };
        let kept: Vec<bool> = all.iter().map(|a| !all.iter().any(|b| less(a, b))).collect();
        let mut kept = kept.into_iter();
        all.retain(|_| kept.next().unwrap_or(true));
    }

    fn choice(&self, closed: &[Closed], parts: &[Part], s: &Solution) -> Choice {
        let mut out = Choice {
            modes: (0..self.n_contacts()).map(|i| vec![self.first_mode(i)]).collect(),
            directions: Vec::new(),
            begin: Vec::new(),
            forces: Vec::new(),
        };
        let switches = self.first_switch();
        for (w, set) in self.weights.iter().zip(&mut out.modes[switches..]).filter(|(w, _)| **w != 0.0) {
            set[0] = if *w > 0.0 { mode::SLIDES } else { mode::SLIDES_BACK };
        }
        let mut first = 0;
        for ((c, p), state) in closed.iter().zip(parts).zip(&s.states) {
            let n_t = self.mechanics.contacts[c.contact].n_tangents;
            let mut force = [0.0; 3];
            force[..=n_t].copy_from_slice(&s.r[first..=first + n_t]);
            out.forces.push((c.contact, force));
            first += 1 + n_t;
            out.modes[c.contact][0] = match state {
                State::Open => mode::OPEN,
                State::Rests => mode::CLOSED,
                State::Slides(d) => {
                    if n_t == 2 {
                        out.directions.push((c.contact, *d));
                        out.begin.extend(p.slides.is_none().then_some(c.contact));
                    }
                    if n_t == 1 && d[0] < 0.0 {
                        mode::SLIDES_BACK
                    } else {
                        mode::SLIDES
                    }
                }
            };
        }
        out
    }

    /// Takes over what a choice says about directions, before its modes are used.
    pub(crate) fn begin(&mut self, choice: &Choice) {
        self.starting.clone_from(&choice.directions);
        self.reference.fill([0.0; 3]);
        choice.forces.iter().for_each(|&(i, f)| self.reference[i] = f);
        for &(i, d) in &choice.directions {
            (self.directions[i], self.settled[i]) = (d, d);
            // so small a velocity is rounding: the direction is that which is given
            let b = &self.blocks[i];
            let noise = 64.0 * f64::EPSILON * b.sliding[0].hypot(b.sliding[1]).max(f64::MIN_POSITIVE);
            self.fastest[i] = noise;
        }
        choice.begin.iter().for_each(|&i| self.begins[i] = f64::INFINITY);
    }

    /// Several contacts may have to change together where they are at the border between two states: those that do not go on
    /// change, all of them at first and then one at a time, until all do.
    fn change_borders(
        &mut self,
        at: &At,
        closed: &[Closed],
        problem: &Problem,
        mut s: Solution,
        length: f64,
    ) -> Result<Option<Choice>, EvalError> {
        let n = problem.parts.len();
        for pass in 0..3 * n {
            let choice = self.choice(closed, &problem.parts, &s);
            let mut wrong = self.do_not_go_on(at, closed, problem, &s, &choice, length)?;
            if wrong.is_empty() {
                return Ok(Some(choice));
            }
            if pass >= n {
                wrong.truncate(1);
            }
            let undecided =
                |(k, state): &(usize, State)| problem.parts[*k].kind == Kind::Switch && *state == State::Rests;
            let switches = wrong.iter().any(undecided);
            wrong.into_iter().for_each(|(k, state)| s.states[k] = state);
            // a switch stays at zero only where its weight is determined
            if switches && !(problem.with_states(&mut s, &mut self.room) && problem.holds(&s)) {
                return Ok(None);
            }
        }
        Ok(None)
    }

    /// The quantities of a solution that are zero and do not go where they may: the places of their contacts, with the states
    /// these have then.
    fn do_not_go_on(
        &mut self,
        at: &At,
        closed: &[Closed],
        problem: &Problem,
        s: &Solution,
        choice: &Choice,
        length: f64,
    ) -> Result<Vec<(usize, State)>, EvalError> {
        // its contact, the state behind zero, its size, and the weights of its rate: of the component of z, of the forces
        struct Quantity {
            place: usize,
            contact: usize,
            behind: State,
            size: f64,
            z: [f64; 3],
            r: [f64; 3],
            /// The share of the rate of the coefficient of friction.
            bound: f64,
        }
        let mut zero = Vec::new();
        let sizes = problem.parts.iter().map(|p| problem.scale(p, p.first, &s.r));
        // where nothing acts on a contact, what acts on the others leaves its rounding
        let least = f64::EPSILON / ZERO * sizes.fold(0.0, f64::max);
        for (place, ((c, p), state)) in closed.iter().zip(&problem.parts).zip(&s.states).enumerate() {
            let (r, z) = (&s.r[p.first..=p.first + p.n_t], &s.z[p.first..=p.first + p.n_t]);
            let (size, force) = (problem.scale(p, p.lead(), &s.r), problem.force_scale(p, p.lead(), &s.r));
            let mut note = |bound: f64, value: f64, size: f64, z: [f64; 3], r: [f64; 3], behind: State| {
                if value.abs() <= ZERO * size {
                    zero.push(Quantity { place, contact: c.contact, behind, size: size.max(least), z, r, bound });
                }
            };
            match state {
                State::Open => {
                    let behind = problem.may_push(p, s).unwrap_or(State::Rests);
                    note(0.0, z[0], size, [1.0, 0.0, 0.0], [0.0; 3], behind);
                }
                State::Rests => {
                    if p.kind.opens() {
                        note(0.0, r[0], force, [0.0; 3], [1.0, 0.0, 0.0], State::Open);
                    }
                    let (mu, push) = (p.stiction, r[0]);
                    if p.n_t == 1 {
                        let behind = State::Slides([-1.0, 0.0]);
                        note(push, mu * push - r[1], force, [0.0; 3], [mu, -1.0, 0.0], behind);
                        let behind = State::Slides([1.0, 0.0]);
                        note(push, mu * push + r[1], force, [0.0; 3], [mu, 1.0, 0.0], behind);
                    } else if p.n_t == 2 {
                        let size = r[1].hypot(r[2]);
                        let d = if size > 0.0 { [r[1] / size, r[2] / size] } else { [0.0; 2] };
                        let behind = State::Slides([-d[0], -d[1]]);
                        note(push, mu * push - size, force, [0.0; 3], [mu, -d[0], -d[1]], behind);
                    }
                }
                State::Slides(d) => {
                    if p.kind.opens() {
                        note(0.0, r[0], force, [0.0; 3], [1.0, 0.0, 0.0], State::Open);
                    }
                    if p.slides.is_none() {
                        let along = z[1..].iter().zip(d).map(|(z, d)| z * d).sum();
                        note(0.0, along, size, [0.0, d[0], d[1]], [0.0; 3], State::Rests);
                    }
                }
            }
        }
        if zero.is_empty() {
            return Ok(Vec::new());
        }
        let m = self.mechanics.clone();
        let [mut rates, mut forces, mut row] = {
            let l = &mut self.linearised;
            [&mut l.jacobian, &mut l.of_forces, &mut l.row].map(std::mem::take)
        };
        zeros(&mut rates, at.x.len());
        zeros(&mut forces, 3 * m.contacts.len());
        self.begin(choice);
        self.along_motion(at, &choice.modes, &mut rates, &mut forces)?;
        let mut check = || -> Result<Vec<(usize, State)>, EvalError> {
            self.turn(at, &choice.begin, (&mut rates[m.n_q..], &mut forces), &mut row)?;
            let mut wrong = Vec::new();
            for q in &zero {
                let mut rate = if q.bound == 0.0 { 0.0 } else { q.bound * self.bound_rate(at, q.contact, &mut row)? };
                for k in 0..=m.contacts[q.contact].n_tangents {
                    if q.r[k] != 0.0 {
                        rate += q.r[k] * forces[3 * q.contact + k];
                    }
                    if q.z[k] != 0.0 {
                        rate += q.z[k] * self.third_rate(at, (q.contact, k), &rates[m.n_q..], &mut row)?;
                    }
                }
                if rate * length < -ZERO * q.size {
                    wrong.push((q.place, q.behind));
                }
            }
            Ok(wrong)
        };
        let fine = check();
        self.along_nothing();
        let l = &mut self.linearised;
        (l.jacobian, l.of_forces, l.row) = (rates, forces, row);
        fine
    }

    /// Rate of the coefficient of friction of a contact for sticking, along the motion.
    fn bound_rate(&mut self, at: &At, contact: usize, row: &mut Vec<f64>) -> Result<f64, EvalError> {
        let columns = self.columns(at);
        self.add_bound(at, contact, &columns, zeros(row, 1))?;
        Ok(row[0])
    }

    /// Rate of the acceleration of component `k` of a contact, where the accelerations have these `rates` along the motion.
    fn third_rate(
        &mut self,
        at: &At,
        (contact, k): (usize, usize),
        rates: &[f64],
        row: &mut Vec<f64>,
    ) -> Result<f64, EvalError> {
        let m = self.mechanics.clone();
        let c = &m.contacts[contact];
        zeros(row, 1);
        let a = std::mem::take(&mut self.acceleration);
        self.extend(at, Some(contact), &a, &[0.0; 3][..1 + c.n_tangents]);
        self.acceleration = a;
        let columns = self.columns(at);
        let there = Point { p: &self.extended, ..*at };
        let room = (&mut self.buffer[..], &mut self.work[..]);
        let pick = |i: usize| (i == m.n_v + k).then_some((0, 1.0));
        add_jacobian(c.reaction.as_ref(), &there, &columns, &pick, row, room)?;
        Ok(row[0] + dot(self.blocks[contact].row(k), rates))
    }

    /// Adds what contacts in space that begin to slide do by turning to the rates of accelerations and forces.
    fn turn(
        &mut self,
        at: &At,
        begin: &[usize],
        (rates, forces): (&mut [f64], &mut [f64]),
        row: &mut Vec<f64>,
    ) -> Result<(), EvalError> {
        let turning = |i: &usize| self.blocks[*i].friction * self.forces[*i][0] > 0.0;
        let begin: Vec<usize> = begin.iter().copied().filter(turning).collect();
        if begin.is_empty() {
            return Ok(());
        }
        let mut jerks = Vec::with_capacity(begin.len());
        for &i in &begin {
            jerks.push([self.third_rate(at, (i, 1), rates, row)?, self.third_rate(at, (i, 2), rates, row)?]);
        }
        let Some((turning, angles)) = self.turning_rates(&begin, &jerks) else { return Ok(()) };
        for (j, w) in angles.iter().enumerate() {
            rates.iter_mut().zip(&turning.accelerations[j]).for_each(|(r, a)| *r += w * a);
            for (row, l) in self.rows.iter().zip(&turning.forces[j]) {
                forces[3 * row.contact + row.component] += w * l;
            }
        }
        Ok(())
    }
}
