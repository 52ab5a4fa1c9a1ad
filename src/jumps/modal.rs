//! The contact mode program: a smooth program for given contact modes and jumps, in physical time.
//!
//! Forces exist only where a contact is closed. A closed contact has `g = 0` and `ġ = 0` at the stage points (and sticking `s = 0`), with a
//! multiplier of its own in the rates of the coordinates, `q' = N v + μ ∇g` (C. W. Gear, B. Leimkuhler, G. K. Gupta, *Automatic
//! integration of Euler-Lagrange equations with constraints*, 1985): a differential-algebraic equation of index 2, in which Radau IIA
//! methods of `s` stages keep their order `2s − 1` of the state on curved gaps (E. Hairer, Ch. Lubich, M. Roche, *The Numerical Solution
//! of Differential-Algebraic Systems by Runge-Kutta Methods*, 1989, section 4). Without `μ` gaps drift while they are closed, and a
//! terminal position that lies on the contact has next to no solution.
//!
//! Forces of elements are variables as impulses, `h λ`. A closed contact whose velocity already fits it at the start of an element needs no
//! more than a force there, and in the limit of a phase without length the rows that hold it say what the rows of the impact before them
//! have said: with `λ` their coefficients are `h`, and phases that want to vanish leave Newton's method without direction.
//!
//! What is hit comes closer before it: `ġ⁻ ≤ 0`. Newton's law of restitution, `ġ⁺ = −e ġ⁻` with an impulse `Λ ≥ 0`, says nothing of the sign of the rate
//! it is given where `ġ⁺ − ġ⁻ = (W Λ)_i` may be negative with impulses that push: of several contacts with normals at an acute angle, and of one with
//! friction whose tangent and normal are coupled by the inertia. Of one contact without friction `−(1 + e) ġ⁻ = W Λ` with `W > 0` is all there is, and
//! the rate has its sign by that of `Λ`. A contact that was closed has the rate zero by the rows that held it.
//!
//! The gap of a body that bounces from a contact and lands on it again is `h (ġ⁺ + …)`: zero, to the second order, for a bounce without length, too.
//! Bounces in a chain are shorter by the restitution each; the singular values of the rows of their landings fall with its square, and Newton's
//! method goes to the roots without length, of which there are as many as bounces. So where a gap begins with zero and is linear, rows take it
//! divided by `h`, the mean of its rates: `Σ a_jk ġ_k` at stage point `j`, which collocation makes the same without error. One that is not linear is
//! `g(q) − g(q_0) = h ∫ ∇g(q_0 + σ (q − q_0)) dσ · w` with the mean velocity `w`, of which Gauss quadrature along the chord leaves rounding. A contact
//! without rebound that opens behind its impact opens from rest, as one that was closed does.
//!
//! An event inside a control stage adds the equation that decides when it happens: a gap or a sliding speed that is zero at
//! the end of the phase, or, where a contact opens or begins to slide, a force at that point. Forces at stage points are less
//! accurate than states, so the forces that decide are those of the accelerations at the point itself, as functions of the
//! state there.

use super::align::align;
use super::assembly::{Input, NOWHERE};
use super::guards::{Condition, Guard, Limit};
use super::modes::{ContactMode, Phase, Sequence, SHORTEST};
use super::overlap::Witness;
use super::problem::Problem;
use super::scales;
use super::track::Track;
use super::transcribe::{Jump, Place, Planned, Transcriber, Transcription, EQUAL, FREE, INF, NEGATIVE, POSITIVE};
use crate::fesd::Durations;
use crate::func::Point;
use crate::system::SharedFunction;
use crate::tableau::{gauss_rule, Tableau};

/// The elements of a sequence.
pub(super) fn plan(p: &Problem, s: &Sequence) -> Vec<Planned> {
    let g = &p.given;
    let mut plan = Vec::new();
    let mut t = g.t0;
    for (k, stage) in s.stages.iter().enumerate() {
        let length = g.durations[k];
        for phase in stage {
            let n = n_elements(p, k, phase);
            let h = length * phase.share / n as f64;
            for i in 0..n {
                let alone = stage.len() == 1 && g.time == Durations::Fixed;
                let least = SHORTEST * length / n as f64;
                plan.push(Planned {
                    stage: k,
                    modes: Some(phase.modes.clone()),
                    jump: if i == 0 { phase.jump.clone().map(Jump::Given) } else { None },
                    span: [t, t + h],
                    from: [t, t + h],
                    length: if alone { [h, h] } else { [least, INF] },
                    tied: i > 0 && !alone,
                });
                t += h;
            }
        }
    }
    plan
}

/// What is held besides the conditions of the modes at stage points, and what is not held.
#[derive(Debug, Clone, Default)]
pub(super) struct Held {
    /// Gaps between stage points.
    pub(super) witnesses: Vec<Witness>,
    /// A contact whose gap may be negative.
    pub(super) without_gap: Option<usize>,
    /// A contact whose friction has no cone.
    pub(super) without_cone: Option<usize>,
}

/// The program of a sequence, started from a guess whose phases are as long as the shares of the sequence say.
pub(super) fn transcribe<'a>(p: &'a Problem, s: &Sequence, guess: &'a Track, held: &'a Held) -> Transcription {
    let mut plan = plan(p, s);
    align(&mut plan, guess);
    let opened = vec![None; p.n_contacts()];
    let left = vec![None; p.n_contacts()];
    let rests = rests(p, guess);
    let mut m = Modal { t: Transcriber::new(p, guess), held, opened, left, guards: Vec::new(), phase: (0, 0), rests };
    let phases = phases_of_plan(p, s);
    for k in 0..plan.len() {
        m.phase = phases[k];
        if k == 0 || plan[k].stage != plan[k - 1].stage {
            m.t.stage();
        }
        if k == 0 {
            m.beginning(&plan[0]);
        } else if plan[k].jump.is_none() {
            m.change(&plan[k - 1], &plan[k]);
        }
        let n = m.t.element(&plan[k]);
        if let Some(Jump::Given(parts)) = &plan[k].jump {
            m.impact(n, parts, &plan[k], k.checked_sub(1).map(|k| &plan[k]));
        }
        m.note_openings(k.checked_sub(1).map(|k| &plan[k]), &plan[k], n);
        m.contacts(n, &plan[k], plan.get(k + 1));
        held.witnesses.iter().filter(|w| w.element == n).for_each(|w| m.hold_at(w, &plan[k]));
    }
    let guards = m.guards;
    Transcription { guards, ..m.t.finish() }
}

/// The phase of every element of a plan: its control stage and place in that.
pub(super) fn phases_of_plan(p: &Problem, s: &Sequence) -> Vec<(usize, usize)> {
    let of_stage = |(k, stage): (usize, &Vec<Phase>)| {
        let of = |(j, phase): (usize, &Phase)| vec![(k, j); n_elements(p, k, phase)];
        stage.iter().enumerate().flat_map(of).collect::<Vec<_>>()
    };
    s.stages.iter().enumerate().flat_map(of_stage).collect()
}

/// Largest gap, and rate of a gap, of a contact that is closed at a given initial state, as a share of what states of their sizes make of it: what
/// keeps it apart is more than rounding from there on.
const TOUCHES: f64 = 1e-7;

/// Can a sequence begin at the initial state, where that is given: are closed contacts closed there, and what is hit does
/// not move away?
pub(super) fn can_begin(p: &Problem, s: &Sequence) -> bool {
    let g = &p.given;
    let x0 = &g.x0_bounds[0];
    if x0.iter().zip(&g.x0_bounds[1]).any(|(l, u)| l != u) {
        return true;
    }
    let Some(first) = s.stages.first().and_then(|stage| stage.first()) else { return false };
    let u = vec![0.0; g.dims.u];
    let at = Point { t: g.t0, x: x0, u: &u, p: &g.params[..g.dims.p] };
    let sizes = scales::of_states(p, x0);
    let value = |f: &SharedFunction| {
        let mut out = [f64::NAN];
        f.value(&at, &mut out, &mut vec![0.0; f.work_len()]).map_or(f64::NAN, |()| out[0])
    };
    let size = |f: &SharedFunction| scales::of_value(f, &at, &sizes);
    let is_zero = |f: &SharedFunction| value(f).abs() <= TOUCHES * size(f);
    (0..p.n_contacts()).all(|i| {
        let c = &p.functions.contacts[i];
        let hit = first.jump.as_ref().is_some_and(|parts| parts[i].is_closed());
        let slides = first.modes[i] == ContactMode::Closed && c.slide.as_ref().is_some_and(|f| !is_zero(f));
        let closed = first.modes[i].is_closed() || hit;
        let moves_on = if first.jump.is_some() {
            !hit || value(&c.rate) <= TOUCHES * size(&c.rate)
        } else {
            is_zero(&c.rate) && !slides
        };
        !closed || (is_zero(&c.gap) && moves_on)
    })
}

/// Points of Gauss quadrature along a chord.
const CHORD: usize = 3;

/// Contacts that do not rebound, judged at the start of a motion.
pub(super) fn rests(p: &Problem, motion: &Track) -> Vec<bool> {
    p.restitutions(motion.pieces.first().map_or(&[], |q| &q.x0)).iter().map(|e| *e == 0.0).collect()
}

fn modes(plan: &Planned) -> &[ContactMode] {
    plan.modes.as_deref().unwrap_or(&[])
}

/// Adds the contacts.
struct Modal<'a> {
    t: Transcriber<'a>,
    held: &'a Held,
    /// Where open contacts have opened: what the gap has drifted off zero while it was closed is no violation.
    opened: Vec<Option<Place>>,
    /// The element at whose start a contact was left last, of those that are open in the same phase since then.
    left: Vec<Option<usize>>,
    guards: Vec<Guard>,
    /// The phase that is written.
    phase: (usize, usize),
    /// Contacts that do not rebound.
    rests: Vec<bool>,
}

impl Modal<'_> {
    fn n_contacts(&self) -> usize {
        self.t.p.n_contacts()
    }

    /// Notes a condition of a mode.
    fn guard(&mut self, contact: usize, condition: Condition, limit: Limit) {
        self.guards.push(Guard { contact, phase: self.phase, condition, limit });
    }

    /// Friction of a contact that is closed in this mode: inside of the cone, or on its border.
    fn friction(&mut self, i: usize, mode: ContactMode, inputs: &[Input]) {
        let Some(cone) = &self.t.contact(i).cone else { return };
        if self.held.without_cone == Some(i) {
            return;
        }
        // outputs μλ − τ, μλ + τ; where one is zero the other is implied
        let rows = match mode {
            ContactMode::Slides => [NOWHERE, self.t.b.rows(1, EQUAL) as u32],
            ContactMode::SlidesBack => [self.t.b.rows(1, EQUAL) as u32, NOWHERE],
            _ => {
                let both = self.t.b.rows(2, POSITIVE);
                [both, both + 1].map(|row| {
                    self.guard(i, Condition::Cone, Limit::Row(row));
                    row as u32
                })
            }
        };
        self.t.b.term(cone, inputs, 1.0, None, rows);
    }

    /// Contacts of an element at its stage points.
    fn contacts(&mut self, n: usize, plan: &Planned, next: Option<&Planned>) {
        let n_s = self.t.elements[n].points.len();
        for i in 0..self.n_contacts() {
            let mode = modes(plan)[i];
            for j in 0..n_s {
                let (at, stage) = (self.t.elements[n].points[j], plan.stage);
                let inputs = self.t.inputs(at, stage, &[]);
                let ends = j + 1 == n_s;
                if mode == ContactMode::Open {
                    // A gap that opens from rest with a force that falls to zero grows like t³, and at the inner stages, which are of lower
                    // order than the end, the method has it negative: −0.037 h³ of 0.037 h³ at the first of two.
                    let unsure = !ends && self.opens(n, i);
                    let closes = ends && next.is_some_and(|next| takes_part(next, i));
                    if !(unsure || closes) {
                        match self.flight(i, n) {
                            Some(first) if self.held.without_gap != Some(i) => {
                                let row = self.mean_rate(i, first, (n, j), POSITIVE);
                                self.guard(i, Condition::Gap, Limit::Row(row));
                            }
                            _ => self.gap_not_negative(i, at, stage),
                        }
                    }
                    continue;
                }
                let t = plan.from[0] + self.t.p.given.tableau.c[j] * (plan.from[1] - plan.from[0]);
                let h = plan.span[1] - plan.span[0];
                let forces =
                    self.t.forces(i, self.t.guess.force(t, i).map(|f| h * f), self.t.units.contacts[i].impulse);
                self.guard(i, Condition::Force, Limit::LowerBound(forces.normal));
                self.t.add_force(n, j, i, forces, true);
                let c = self.t.contact(i);
                self.t.row(&c.rate, &inputs, EQUAL);
                self.t.hold(n, j, i);
                let stops = ends && next.is_some_and(|next| stops(plan, next, i));
                if let Some(slide) = &c.slide {
                    match mode {
                        ContactMode::Closed => {
                            self.t.row(slide, &inputs, EQUAL);
                        }
                        // where it stops the speed is zero: a row of the event
                        _ if stops => {}
                        _ => {
                            let row = self.t.row(slide, &inputs, speeds(mode));
                            self.guard(i, Condition::Speed, Limit::Row(row));
                        }
                    }
                }
                let inputs = self.t.force_inputs(at, stage, None, forces);
                self.friction(i, mode, &inputs);
            }
        }
    }

    /// Does contact `i` open at the start of element `n`?
    fn opens(&self, n: usize, i: usize) -> bool {
        self.opened[i].is_some_and(|o| o.q == self.t.elements[n].start.q)
    }

    fn is_linear(&self, i: usize) -> bool {
        self.t.contact(i).gap.hess_pattern().nnz() == 0
    }

    /// The element at whose start contact `i`, which is open in element `n`, was left in the same phase, where its gap is known from the rates since
    /// then: where it is linear, or velocities are the rates of the coordinates, and no contact that is held closed moves coordinates besides. Without a
    /// rebound a flight begins at rest, and its gap falls with the square of its length: it gains nothing by the gradients along a chord.
    fn flight(&self, i: usize, n: usize) -> Option<usize> {
        let f = &self.t.p.functions;
        let modes = self.t.elements[n].modes.as_deref()?;
        let first = self.left[i].filter(|_| self.is_linear(i) || f.plain && !f.knows_time && !self.rests[i])?;
        (0..self.n_contacts()).all(|c| !modes[c].is_closed() || self.is_linear(c)).then_some(first)
    }

    /// A row that holds the gap of contact `i` at stage point `j` of element `n`, divided by the lengths of the elements since `first`, at whose
    /// start it is zero, and times that of the control stage, which makes it a gap again.
    fn mean_rate(&mut self, i: usize, first: usize, (n, j): (usize, usize), bounds: [f64; 2]) -> usize {
        if !self.is_linear(i) {
            return self.mean_rate_of_chord(i, first, (n, j), bounds);
        }
        let row = self.t.b.rows(1, bounds);
        let rate = &self.t.contact(i).rate;
        let tableau = &self.t.p.given.tableau;
        for e in first..=n {
            let (stage, points) = (self.t.elements[e].stage, self.t.elements[e].points.clone());
            let length = self.t.p.given.durations[stage];
            for (k, at) in points.into_iter().enumerate() {
                let weight = if e == n { tableau.a(j, k) } else { tableau.b[k] };
                let inputs = self.t.inputs(at, stage, &[]);
                self.t.b.term(rate, &inputs, length * weight, None, [row as u32]);
            }
        }
        row
    }

    /// The same of a gap that is not linear, from its gradients along the chord between the coordinates at both places.
    fn mean_rate_of_chord(&mut self, i: usize, first: usize, (n, j): (usize, usize), bounds: [f64; 2]) -> usize {
        let (n_q, stage) = (self.t.p.functions.n_q, self.t.elements[n].stage);
        let (from, to) = (self.t.elements[first].start, self.t.elements[n].points[j]);
        let tableau = &self.t.p.given.tableau;
        let mean = self.t.b.sized(&self.t.units.x[n_q..], FREE);
        let rows = self.t.b.rows(n_q, EQUAL);
        for k in 0..n_q {
            self.t.b.linear(rows + k, mean + k, 1.0);
            let mut value = 0.0;
            for e in first..=n {
                for (at, l) in self.t.elements[e].points.iter().zip(0..) {
                    let weight = if e == n { tableau.a(j, l) } else { tableau.b[l] };
                    self.t.b.linear(rows + k, at.v + k, -weight);
                    value += weight * self.t.b.start[at.v + k];
                }
            }
            self.t.b.start[mean + k] = value;
        }
        let row = self.t.b.rows(1, bounds);
        let rate = &self.t.contact(i).rate;
        let length = self.t.p.given.durations[stage];
        for (share, weight) in gauss_rule(CHORD) {
            let q = self.t.b.sized(&self.t.units.x[..n_q], FREE);
            let rows = self.t.b.rows(n_q, EQUAL);
            for k in 0..n_q {
                self.t.b.linear(rows + k, q + k, 1.0);
                self.t.b.linear(rows + k, from.q + k, share - 1.0);
                self.t.b.linear(rows + k, to.q + k, -share);
                self.t.b.start[q + k] = (1.0 - share) * self.t.b.start[from.q + k] + share * self.t.b.start[to.q + k];
            }
            let inputs = self.t.inputs(Place { q, v: mean, ..to }, stage, &[]);
            self.t.b.term(rate, &inputs, length * weight, None, [row as u32]);
        }
        row
    }

    fn gap_not_negative(&mut self, i: usize, at: Place, stage: usize) {
        if self.held.without_gap == Some(i) {
            return;
        }
        let gap = &self.t.contact(i).gap;
        let inputs = self.t.inputs(at, stage, &[]);
        let row = self.t.row(gap, &inputs, POSITIVE);
        self.guard(i, Condition::Gap, Limit::Row(row));
        if let Some(opened) = self.opened[i] {
            let inputs = self.t.inputs(opened, stage, &[]);
            self.t.b.term(gap, &inputs, -1.0, None, [row as u32]);
        }
    }

    /// Holds the gap of an open contact at a share of an element, at the coordinates of the polynomial there.
    fn hold_at(&mut self, w: &Witness, plan: &Planned) {
        let n_q = self.t.p.functions.n_q;
        let (start, points) = (self.t.elements[w.element].start, self.t.elements[w.element].points.clone());
        let mut weights = [0.0; Tableau::MAX_STAGES];
        let weights = &mut weights[..points.len()];
        if self.t.p.given.tableau.state_weights(w.share, weights).is_err() {
            return;
        }
        let first = 1.0 - weights.iter().sum::<f64>();
        let q = self.t.b.sized(&self.t.units.x[..n_q], FREE);
        let rows = self.t.b.rows(n_q, EQUAL);
        for i in 0..n_q {
            self.t.b.linear(rows + i, q + i, 1.0);
            self.t.b.linear(rows + i, start.q + i, -first);
            let mut value = first * self.t.b.start[start.q + i];
            for (at, weight) in points.iter().zip(weights.iter()) {
                self.t.b.linear(rows + i, at.q + i, -weight);
                value += weight * self.t.b.start[at.q + i];
            }
            self.t.b.start[q + i] = value;
        }
        let end = self.t.elements[w.element].end();
        self.gap_not_negative(w.contact, Place { q, ..end }, plan.stage);
    }

    /// Remembers where contacts open, and forgets it where they close; and where they were left in the present phase.
    fn note_openings(&mut self, before: Option<&Planned>, plan: &Planned, n: usize) {
        let same = before.is_some_and(|b| plan.jump.is_none() && b.stage == plan.stage && b.modes == plan.modes);
        for i in 0..self.n_contacts() {
            let touches = before.is_some_and(|b| modes(b)[i].is_closed()) || takes_part(plan, i);
            if modes(plan)[i].is_closed() {
                self.left[i] = None;
            } else if touches {
                self.left[i] = Some(n);
            } else if !same {
                self.left[i] = None;
            }
            let was = before.is_some_and(|b| modes(b)[i].is_closed()) || takes_part(plan, i) && self.rests[i];
            if was && modes(plan)[i] == ContactMode::Open {
                self.opened[i] = Some(self.t.elements[n].start);
            } else if takes_part(plan, i) {
                self.opened[i] = None;
            }
        }
    }

    /// Does a function of the state depend on what of the initial state is free?
    fn is_free(&self, f: &SharedFunction) -> bool {
        let g = &self.t.p.given;
        let p = f.jac_pattern();
        (0..g.dims.x).any(|k| !p.rows(k).is_empty() && g.x0_bounds[0][k] < g.x0_bounds[1][k])
    }

    /// Contacts closed at the initial time: a condition on the initial state as far as that is free.
    fn beginning(&mut self, plan: &Planned) {
        let x0 = self.t.last_end();
        for i in 0..self.n_contacts() {
            let c = self.t.contact(i);
            let inputs = self.t.inputs(x0, 0, &[]);
            let closed = modes(plan)[i].is_closed();
            if self.is_free(&c.gap) && !takes_part(plan, i) {
                self.t.row(&c.gap, &inputs, if closed { EQUAL } else { POSITIVE });
            }
            if !closed || plan.jump.is_some() {
                continue;
            }
            if self.is_free(&c.rate) {
                self.t.row(&c.rate, &inputs, EQUAL);
            }
            if let Some(slide) = c.slide.as_ref().filter(|f| modes(plan)[i] == ContactMode::Closed && self.is_free(f)) {
                self.t.row(slide, &inputs, EQUAL);
            }
        }
    }

    /// Conditions of a change of modes without an impact, at the end of the last element.
    fn change(&mut self, before: &Planned, next: &Planned) {
        let at = self.t.last_end();
        let inside = before.stage == next.stage;
        let mut decides = Vec::new();
        for i in 0..self.n_contacts() {
            let (a, b) = (modes(before)[i], modes(next)[i]);
            if a == b {
                continue;
            }
            let c = self.t.contact(i);
            let inputs = self.t.inputs(at, before.stage, &[]);
            match (a, b) {
                // a contact closes without an impact: the gap comes to zero with its rate
                (ContactMode::Open, _) => {
                    self.t.row(&c.gap, &inputs, EQUAL);
                    self.t.row(&c.rate, &inputs, EQUAL);
                }
                (_, ContactMode::Open) | (ContactMode::Closed, _) => decides.push(i),
                _ => {
                    if let Some(slide) = &c.slide {
                        self.t.row(slide, &inputs, EQUAL);
                    }
                }
            }
        }
        if inside && !decides.is_empty() {
            self.decisive_forces(at, before, next, &decides);
        }
    }

    /// Accelerations and forces at a point under the modes before it; those of the contacts that open there are zero, those
    /// of contacts that begin to slide are on the border of their cone.
    fn decisive_forces(&mut self, at: Place, before: &Planned, next: &Planned, decides: &[usize]) {
        let (stage, n_v) = (before.stage, self.t.p.functions.n_v);
        let h = (before.span[1] - before.span[0]).max(f64::MIN_POSITIVE);
        let n_q = self.t.p.functions.n_q;
        let of_rates: Vec<f64> = self.t.units.x[n_q..].iter().map(|v| v / self.t.units.time).collect();
        let a = self.t.b.sized(&of_rates, FREE);
        if let Some(last) = self.t.elements.last() {
            let rate = last.rates[last.rates.len() - 1] + self.t.p.functions.n_q;
            for i in 0..n_v {
                self.t.b.start[a + i] = self.t.b.start[rate + i] / h;
            }
        }
        let rows = self.t.b.rows(n_v, EQUAL);
        let velocities = || (rows..rows + n_v).map(|r| r as u32);
        let more: Vec<Input> = (0..n_v).map(|i| Input::Variable(a + i)).collect();
        let inputs = self.t.inputs(at, stage, &more);
        let f = &self.t.p.functions;
        self.t.b.term(&f.momentum, &inputs, 1.0, None, velocities());
        let inputs = self.t.inputs(at, stage, &[]);
        let places = (0..f.n_q).map(|_| NOWHERE).chain(velocities());
        self.t.b.term(&f.smooth, &inputs, -1.0, None, places);
        for i in 0..self.n_contacts() {
            let mode = modes(before)[i];
            if !mode.is_closed() {
                continue;
            }
            let forces = self.t.forces(i, self.t.guess.force(before.from[1], i), self.t.units.contacts[i].force);
            let inputs = self.t.force_inputs(at, stage, Some(a), forces);
            let c = self.t.contact(i);
            self.t.b.term(&c.push, &inputs, -1.0, None, velocities());
            let n = c.accelerate.n_out();
            // what slides has an acceleration along the tangent
            let held = if mode == ContactMode::Closed { n } else { 1 };
            let rows = self.t.b.rows(held, EQUAL);
            let rows = (0..n).map(|k| if k < held { (rows + k) as u32 } else { NOWHERE });
            self.t.b.term(&c.accelerate, &inputs, 1.0, None, rows);
            if mode != ContactMode::Closed {
                self.friction(i, mode, &inputs);
            } else if decides.contains(&i) && modes(next)[i].is_closed() {
                self.friction(i, modes(next)[i], &inputs);
            }
            if decides.contains(&i) && !modes(next)[i].is_closed() {
                (self.t.b.xl[forces.normal], self.t.b.xu[forces.normal]) = (0.0, 0.0);
            }
        }
    }

    /// An impact at the start of element `n`.
    fn impact(&mut self, n: usize, parts: &[ContactMode], plan: &Planned, last: Option<&Planned>) {
        let Some(mut impact) = self.t.elements[n].impact.clone() else { return };
        let (at, stage) = (self.t.elements[n].start, plan.stage);
        let control = last.map_or(stage, |l| l.stage);
        let several = parts.iter().filter(|part| part.is_closed()).count() > 1;
        for i in 0..self.n_contacts() {
            let c = self.t.contact(i);
            let inputs = self.t.inputs(at, control, &[]);
            let was_closed = last.is_some_and(|l| modes(l)[i].is_closed());
            if !parts[i].is_closed() {
                if was_closed {
                    self.t.row(&c.rate, &inputs, POSITIVE);
                }
                continue;
            }
            let start = self.guessed_impulse(plan.from[0], i);
            let forces = self.t.forces(i, start, self.t.units.contacts[i].impulse);
            impact.impulses[i] = Some(forces);
            self.guard(i, Condition::Force, Limit::LowerBound(forces.normal));
            let arrival = self.t.inputs(impact.before, control, &[]);
            if !was_closed && (n > 0 || self.is_free(&c.gap)) {
                match n.checked_sub(1).and_then(|before| self.flight(i, before)) {
                    Some(first) => {
                        let ends = self.t.elements[n - 1].points.len() - 1;
                        self.mean_rate(i, first, (n - 1, ends), EQUAL);
                    }
                    None => {
                        self.t.row(&c.gap, &arrival, EQUAL);
                    }
                }
            }
            // of a single contact without friction the sign of its impulse says the same
            if !was_closed && (several || c.cone.is_some()) && (n > 0 || self.is_free(&c.rate)) {
                let row = self.t.row(&c.rate, &arrival, NEGATIVE);
                self.guard(i, Condition::Closing, Limit::Row(row));
            }
            let both = self.both_velocities(impact.before, at, control);
            self.t.row(&c.rebound, &both, EQUAL);
            if let Some(slide) = &c.slide {
                let row = self.t.row(slide, &inputs, speeds(parts[i]));
                if parts[i].sign() != 0.0 {
                    self.guard(i, Condition::Speed, Limit::Row(row));
                }
            }
            let inputs = self.t.force_inputs(at, control, None, forces);
            self.friction(i, parts[i], &inputs);
        }
        self.t.impact_forces(control, at, &impact);
        self.t.elements[n].impact = Some(impact);
    }

    fn guessed_impulse(&self, t: f64, i: usize) -> [f64; 2] {
        let near = self.t.guess.pieces.iter().filter(|p| p.impulses.len() > 2 * i + 1 && p.impulses[2 * i] > 0.0);
        let nearest = near.min_by(|a, b| (a.t - t).abs().total_cmp(&(b.t - t).abs()));
        nearest.map_or([0.0; 2], |p| [p.impulses[2 * i], p.impulses[2 * i + 1]])
    }

    /// Inputs `(q, v⁻, v⁺)` of a restitution.
    fn both_velocities(&self, before: Place, after: Place, stage: usize) -> Vec<Input> {
        let (n_q, n_v) = (self.t.p.functions.n_q, self.t.p.functions.n_v);
        let mut inputs = self.t.inputs(before, stage, &[]);
        let later = (after.v..after.v + n_v).map(Input::Variable);
        inputs.splice(n_q + n_v..n_q + n_v, later);
        inputs
    }
}

/// Bounds of the sliding speed of a closed contact.
fn speeds(mode: ContactMode) -> [f64; 2] {
    match mode {
        ContactMode::Slides => POSITIVE,
        ContactMode::SlidesBack => NEGATIVE,
        _ => EQUAL,
    }
}

/// Has contact `i` an impulse at the start of an element?
fn takes_part(plan: &Planned, i: usize) -> bool {
    matches!(&plan.jump, Some(Jump::Given(parts)) if parts[i].is_closed())
}

/// Does contact `i` stop sliding at the end of an element, without an impact?
fn stops(plan: &Planned, next: &Planned, i: usize) -> bool {
    let (a, b) = (modes(plan)[i], modes(next)[i]);
    next.jump.is_none() && a.sign() != 0.0 && b.is_closed() && b != a
}

/// Elements of a phase.
fn n_elements(p: &Problem, stage: usize, phase: &Phase) -> usize {
    ((p.given.n_fe[stage] as f64 * phase.share).ceil() as usize).max(1)
}

/// Lengths of the phases of a sequence in the motion of its program.
pub(super) fn phase_lengths(p: &Problem, s: &Sequence, found: &Track) -> Vec<Vec<f64>> {
    let mut pieces = found.pieces.iter();
    let mut of = |k: usize, phase: &Phase| pieces.by_ref().take(n_elements(p, k, phase)).map(|p| p.h).sum();
    s.stages.iter().enumerate().map(|(k, stage)| stage.iter().map(|phase| of(k, phase)).collect()).collect()
}

/// Phases that are as short as they may be at a solution: those that want to vanish. In pairs of stage and place in it.
pub(super) fn vanishing(lengths: &[Vec<f64>]) -> Vec<(usize, usize)> {
    shorter(lengths, 2.0 * SHORTEST)
}

/// Phases shorter than a share of their stage that are not all of it.
pub(super) fn shorter(lengths: &[Vec<f64>], share: f64) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    for (k, stage) in lengths.iter().enumerate() {
        let whole: f64 = stage.iter().sum();
        let short = |i: &usize| stage.len() > 1 && stage[*i] < share * whole;
        out.extend((0..stage.len()).filter(short).map(|i| (k, i)));
    }
    out
}
