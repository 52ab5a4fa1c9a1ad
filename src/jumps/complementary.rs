//! FESD with jumps: a program that finds contact modes itself.
//!
//! In every element either all normal forces of a contact are zero, or its gap is zero at the start and at all stage points,
//! the cross complementarity that puts events on ends of elements. With `λ`, `g` at the stage points and the gap `g_0` at the
//! start of the element,
//!
//! ```text
//! 0 ≤ Σ_j λ_j  ⊥  g_0 + Σ_j g_j ≥ 0,
//! ```
//!
//! and in the plane, with `τ = β₁ − β₂`, `s` the sliding velocity, sums over the element with its start on the right,
//!
//! ```text
//! 0 ≤ Σ β₁ ⊥ Σ (γ + s) ≥ 0,    0 ≤ Σ β₂ ⊥ Σ (γ − s) ≥ 0,    0 ≤ Σ (μλ − β₁ − β₂) ⊥ Σ γ ≥ 0.
//! ```
//!
//! Where elements of one stage meet a contact may land: `0 ≤ Λ ⊥ g ≥ 0`, and where `Λ > 0` the law of restitution holds,
//! `0 ≤ Λ ⊥ w`, `w ≥ |ġ⁺ + e ġ⁻|`; friction impulses satisfy the same conditions as forces (section 8.1 of the thesis).
//! Solutions lead to modes; the exact answer is that of the contact mode program.

use super::assembly::{Input, NOWHERE};
use super::modes::ContactMode;
use super::problem::Problem;
use super::track::Track;
use super::transcribe::{Element, Forces, Jump, Place, Planned, Transcriber, Transcription, EQUAL, POSITIVE};
use crate::mpcc::Mpcc;

/// Steps lie between these shares of their mean.
const STEPS: [f64; 2] = [0.02, 1.98];

/// Equal elements, with impacts wherever two of one stage meet.
pub(super) fn plan(p: &Problem, n_fe: usize) -> Vec<Planned> {
    let mut plan = Vec::new();
    let mut t = p.given.t0;
    for (k, &length) in p.given.durations.iter().enumerate() {
        let h = length / n_fe as f64;
        for i in 0..n_fe {
            plan.push(Planned {
                stage: k,
                modes: None,
                jump: (i > 0).then_some(Jump::Undecided),
                span: [t, t + h],
                from: [t, t + h],
                length: if n_fe == 1 { [h, h] } else { [STEPS[0] * h, STEPS[1] * h] },
                tied: false,
            });
            t += h;
        }
    }
    plan
}

/// Complementarity variables of a contact at a point: what stands against friction.
#[derive(Debug, Clone, Copy)]
struct Sliding {
    /// `γ + s`, `γ − s`.
    ahead: usize,
    back: usize,
    gamma: usize,
}

/// What the program has of every contact where the last element ended.
#[derive(Debug, Clone, Copy)]
struct End {
    gap: usize,
    sliding: Option<Sliding>,
}

/// The program of a grid of `n_fe` elements in every stage; `weight` is that of the soft step equilibration.
pub(super) fn transcribe(p: &Problem, n_fe: usize, weight: f64, guess: &Track) -> Transcription {
    assemble(p, &plan(p, n_fe), weight, guess, false)
}

/// The program of a plan; `stepping` has complementarity at the ends of elements alone, and no impulses.
pub(super) fn assemble(p: &Problem, plan: &[Planned], weight: f64, guess: &Track, stepping: bool) -> Transcription {
    let mut c = Complementary { t: Transcriber::new(p, guess), ends: Vec::new(), stepping, restitutions: Vec::new() };
    if stepping {
        c.restitutions = p.restitutions(&guess.pieces.first().map_or_else(Vec::new, |q| q.x0.clone()));
    }
    for k in 0..plan.len() {
        let new_stage = k == 0 || plan[k].stage != plan[k - 1].stage;
        if new_stage {
            c.t.stage();
        }
        if k == 0 && !stepping {
            c.beginning();
        }
        let n = c.t.element(&plan[k]);
        if !new_stage && weight > 0.0 {
            let (a, b) = (c.t.elements[n - 1].h, c.t.elements[n].h);
            c.t.b.guide(a, b, weight);
        }
        if plan[k].jump.is_some() {
            c.impact(n, &plan[k]);
        }
        for i in 0..p.n_contacts() {
            c.contact(n, i, &plan[k]);
        }
    }
    let mut t = c.t.finish();
    disturb(&mut t, p);
    t
}

/// Share of the size of a variable by which starts are disturbed.
const DISTURBANCE: f64 = 1e-3;

/// Moves states and controls a little off the guess, always by the same numbers: a start that is symmetric is a saddle point
/// of problems with two mirrored solutions, which Newton's method does not leave.
fn disturb(t: &mut Transcription, p: &Problem) {
    let mut state = 1u64;
    let mut next = || {
        // the generator of Knuth's MMIX; the upper bits are the better ones
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    };
    let mut sizes = vec![1.0; t.start.len()];
    t.program.sizes(&mut sizes);
    let (nx, nu) = (p.given.dims.x, p.given.dims.u);
    let blocks = t.elements.iter().flat_map(|e| e.points.iter().map(|at| (at.q, nx)));
    for (first, n) in blocks.chain(t.controls.iter().map(|&u| (u, nu))) {
        for j in first..first + n {
            let moved = t.start[j] + DISTURBANCE * next() * t.start[j].abs().max(sizes[j]);
            t.start[j] = moved.max(t.bounds.xl[j]).min(t.bounds.xu[j]);
        }
    }
}

struct Complementary<'a> {
    t: Transcriber<'a>,
    ends: Vec<End>,
    /// Complementarity at the ends of steps alone.
    stepping: bool,
    /// Coefficients of restitution, for time stepping.
    restitutions: Vec<f64>,
}

impl Complementary<'_> {
    /// A variable that is not negative and equals `Σ` of others.
    fn sum(&mut self, of: &[usize]) -> usize {
        if let [one] = of {
            return *one;
        }
        let start = of.iter().map(|&j| self.t.b.start[j]).sum();
        let size = of.len() as f64 * self.t.b.size[of[0]];
        let sum = self.t.b.variables(1, POSITIVE, start, size);
        let row = self.t.b.rows(1, EQUAL);
        self.t.b.linear(row, sum, 1.0);
        for &j in of {
            self.t.b.linear(row, j, -1.0);
        }
        sum
    }

    /// A variable that is not negative and equals the gap.
    fn gap(&mut self, i: usize, at: Place, stage: usize) -> usize {
        let inputs = self.t.inputs(at, stage, &[]);
        let start = self.t.value(&self.t.contact(i).gap, &inputs)[0];
        let gap = self.t.b.variables(1, POSITIVE, start.max(0.0), self.t.units.contacts[i].gap);
        let row = self.t.row(&self.t.contact(i).gap, &inputs, EQUAL);
        self.t.b.linear(row, gap, -1.0);
        gap
    }

    /// A variable that is not negative and equals `g_k + e g_{k−2}`, of step `n` with its end at `at`.
    fn rebounding_gap(&mut self, n: usize, i: usize, at: Place, stage: usize) -> usize {
        let e = self.restitutions[i];
        let gap = self.gap(i, at, stage);
        if e > 0.0 && n > 0 {
            // the gap where this step begins is the one at the end of the last: two ends ago is where that began
            let past = self.t.elements[n - 1].start;
            let inputs = self.t.inputs(past, stage, &[]);
            let row = self.t.b.last_row();
            self.t.b.term(&self.t.contact(i).gap, &inputs, e, None, [row as u32]);
            self.t.b.start[gap] += e * self.t.value(&self.t.contact(i).gap, &inputs)[0].max(0.0);
        }
        gap
    }

    /// `γ ± s` of a contact with a tangent at a point.
    fn sliding(&mut self, i: usize, at: Place, stage: usize) -> Option<Sliding> {
        let slide = self.t.contact(i).slide.as_ref()?;
        let inputs = self.t.inputs(at, stage, &[]);
        let s = self.t.value(slide, &inputs)[0];
        let size = self.t.units.contacts[i].slide;
        let gamma = self.t.b.variables(1, POSITIVE, s.abs(), size);
        let ahead = self.t.b.variables(1, POSITIVE, s.abs() + s, size);
        let back = self.t.b.variables(1, POSITIVE, s.abs() - s, size);
        for (d, sign) in [(ahead, 1.0), (back, -1.0)] {
            let row = self.t.b.rows(1, EQUAL);
            self.t.b.term(slide, &inputs, sign, None, [row as u32]);
            self.t.b.linear(row, gamma, 1.0);
            self.t.b.linear(row, d, -1.0);
        }
        Some(Sliding { ahead, back, gamma })
    }

    /// Gaps and sliding velocities of the initial state.
    fn beginning(&mut self) {
        let x0 = self.t.last_end();
        for i in 0..self.t.p.n_contacts() {
            let end = End { gap: self.gap(i, x0, 0), sliding: self.sliding(i, x0, 0) };
            self.ends.push(end);
        }
    }

    /// Parts of the friction force: those along the tangent and against it, and what is left of the cone.
    fn friction(
        &mut self,
        i: usize,
        inputs_of: &dyn Fn(&Self, Forces) -> Vec<Input>,
        forces: Forces,
    ) -> Option<[usize; 3]> {
        let cone = self.t.contact(i).cone.as_ref()?;
        let tau = forces.tangential?;
        let start = self.t.b.start[tau];
        let size = self.t.b.size[tau];
        let ahead = self.t.b.variables(1, POSITIVE, start.max(0.0), size);
        let back = self.t.b.variables(1, POSITIVE, (-start).max(0.0), size);
        let left = self.t.b.variables(1, POSITIVE, 0.0, size);
        let row = self.t.b.rows(1, EQUAL);
        self.t.b.linear(row, tau, 1.0);
        self.t.b.linear(row, ahead, -1.0);
        self.t.b.linear(row, back, 1.0);
        // left = μλ − τ − 2 β₂ = μλ − β₁ − β₂
        let row = self.t.b.rows(1, EQUAL);
        let inputs = inputs_of(self, forces);
        self.t.b.term(cone, &inputs, 1.0, None, [row as u32, NOWHERE]);
        self.t.b.linear(row, back, -2.0);
        self.t.b.linear(row, left, -1.0);
        let value = self.t.value(cone, &inputs)[0] - 2.0 * self.t.b.start[back];
        self.t.b.start[left] = value.max(0.0);
        Some([ahead, back, left])
    }

    /// A contact in an element.
    fn contact(&mut self, n: usize, i: usize, plan: &Planned) {
        let start = self.ends.get(i).copied();
        let points = self.t.elements[n].points.clone();
        let (mut lambdas, mut gaps) = (Vec::new(), Vec::new());
        gaps.extend(start.map(|s| s.gap));
        let mut parts: [Vec<usize>; 3] = Default::default();
        let mut against: [Vec<usize>; 3] = Default::default();
        let note = |against: &mut [Vec<usize>; 3], s: Option<Sliding>| {
            if let Some(s) = s {
                against[0].push(s.ahead);
                against[1].push(s.back);
                against[2].push(s.gamma);
            }
        };
        note(&mut against, start.and_then(|s| s.sliding));
        for (j, &at) in points.iter().enumerate() {
            let t = plan.span[0] + self.t.p.given.tableau.c[j] * (plan.span[1] - plan.span[0]);
            let forces = self.t.forces(i, self.t.guess.force(t, i), self.t.units.contacts[i].force);
            self.t.add_force(n, j, i, forces, false);
            lambdas.push(forces.normal);
            let gap =
                if self.stepping { self.rebounding_gap(n, i, at, plan.stage) } else { self.gap(i, at, plan.stage) };
            gaps.push(gap);
            let sliding = self.sliding(i, at, plan.stage);
            note(&mut against, sliding);
            let stage = plan.stage;
            if let Some(three) = self.friction(i, &|c, f| c.t.force_inputs(at, stage, None, f), forces) {
                for (list, v) in parts.iter_mut().zip(three) {
                    list.push(v);
                }
            }
            if !self.stepping {
                self.ends[i] = End { gap: gaps[gaps.len() - 1], sliding };
            }
        }
        let (a, b) = (self.sum(&lambdas), self.sum(&gaps));
        self.t.b.pairs.push((a, b));
        for (a, b) in parts.iter().zip(&against) {
            if !a.is_empty() {
                let pair = (self.sum(a), self.sum(b));
                self.t.b.pairs.push(pair);
            }
        }
    }

    /// A possible impact at the start of element `n`.
    fn impact(&mut self, n: usize, plan: &Planned) {
        let Some(mut impact) = self.t.elements[n].impact.clone() else { return };
        let (at, stage, before) = (self.t.elements[n].start, plan.stage, impact.before);
        let (n_q, n_v) = (self.t.p.functions.n_q, self.t.p.functions.n_v);
        for i in 0..self.t.p.n_contacts() {
            let forces = self.t.forces(i, [0.0; 2], self.t.units.contacts[i].impulse);
            impact.impulses[i] = Some(forces);
            let off = self.t.b.variables(1, POSITIVE, 0.0, self.t.units.contacts[i].rate);
            let mut both = self.t.inputs(before, stage, &[]);
            both.splice(n_q + n_v..n_q + n_v, (at.v..at.v + n_v).map(Input::Variable));
            let rebound = &self.t.contact(i).rebound;
            self.t.b.start[off] = self.t.value(rebound, &both)[0].abs();
            for sign in [1.0, -1.0] {
                let row = self.t.b.rows(1, POSITIVE);
                self.t.b.term(rebound, &both, sign, None, [row as u32]);
                self.t.b.linear(row, off, 1.0);
            }
            self.t.b.pairs.push((forces.normal, off));
            self.t.b.pairs.push((forces.normal, self.ends[i].gap));
            let sliding = self.sliding(i, at, stage);
            if let (Some([ahead, back, left]), Some(s)) =
                (self.friction(i, &|c, f| c.t.force_inputs(at, stage, None, f), forces), sliding)
            {
                self.t.b.pairs.extend([(ahead, s.ahead), (back, s.back), (left, s.gamma)]);
            }
            self.ends[i].sliding = sliding;
        }
        self.t.impact_forces(stage, at, &impact);
        self.t.elements[n].impact = Some(impact);
    }
}

/// Share of the largest speed below which a closed contact sticks, and of the largest impulse from which there is an impact.
pub(super) const SHARE: f64 = 1e-3;

/// What the contacts do at a point of the program: modes and impacts of every element. Of every pair that is zero which is
/// smaller in its units: the largest gap of the contact, and the largest force of the contact or of the inertia.
pub(super) fn read(p: &Problem, t: &Transcription, w: &[f64]) -> Track {
    let n_c = p.n_contacts();
    let sizes = Sizes::new(p, t, w);
    let slide = |i: usize, x: &[f64], e: &Element| t.slide(p, i, x, w, e);
    let speed = t.largest_speed(p, w);
    let of_element = |e: &Element| -> Vec<ContactMode> {
        (0..n_c)
            .map(|i| {
                let force = e.forces.iter().filter_map(|at| at[i]).map(|f| w[f.normal]).sum::<f64>();
                let gap = e.points.iter().map(|at| t.gap(p, i, *at, w, e)).sum::<f64>();
                if force * sizes.gaps[i] <= gap * sizes.forces[i] {
                    return ContactMode::Open;
                }
                let speeds: Vec<f64> = e.points.iter().map(|at| slide(i, &t.state(p, *at, w), e)).collect();
                direction(&speeds, SHARE * speed)
            })
            .collect()
    };
    let mut track = t.read(p, w, &of_element);
    for (e, piece) in t.elements.iter().zip(&mut track.pieces) {
        let Some(impact) = &e.impact else { continue };
        let parts: Vec<ContactMode> = (0..n_c)
            .map(|i| match impact.impulses[i] {
                Some(f) if w[f.normal] > SHARE * sizes.impulses[i] => {
                    direction(&[slide(i, &piece.x0, e)], SHARE * speed)
                }
                _ => ContactMode::Open,
            })
            .collect();
        if parts.iter().any(|m| m.is_closed()) {
            piece.jump = Some(parts);
        } else {
            piece.impulses.clear();
        }
    }
    track
}

/// Units of what the contacts have, contact by contact.
pub(super) struct Sizes {
    pub(super) gaps: Vec<f64>,
    pub(super) forces: Vec<f64>,
    pub(super) impulses: Vec<f64>,
}

impl Sizes {
    pub(super) fn new(p: &Problem, t: &Transcription, w: &[f64]) -> Sizes {
        let n_c = p.n_contacts();
        let n_q = p.functions.n_q;
        let n_own = p.functions.n_own();
        let (mut acceleration, mut change) = (0f64, 0f64);
        for e in &t.elements {
            for r in &e.rates {
                let most = w[r + n_q..r + n_q + n_own].iter().fold(0f64, |m, v| m.max(v.abs()));
                acceleration = acceleration.max(most / w[e.h].max(f64::MIN_POSITIVE));
            }
            change = change.max(t.largest_speed(p, w));
        }
        let mut s = Sizes { gaps: vec![0.0; n_c], forces: vec![0.0; n_c], impulses: vec![0.0; n_c] };
        for e in &t.elements {
            for i in 0..n_c {
                for (at, forces) in e.points.iter().zip(&e.forces) {
                    s.gaps[i] = s.gaps[i].max(t.gap(p, i, *at, w, e));
                    s.forces[i] = forces[i].map_or(s.forces[i], |f| s.forces[i].max(w[f.normal]));
                }
                if let Some(f) = e.impact.as_ref().and_then(|m| m.impulses[i]) {
                    s.impulses[i] = s.impulses[i].max(w[f.normal]);
                }
            }
        }
        // forces that are all small are none
        for i in 0..n_c {
            s.forces[i] = s.forces[i].max(SHARE * acceleration);
            s.impulses[i] = s.impulses[i].max(change);
        }
        s
    }
}

/// Mode of a closed contact with these sliding velocities, where speeds below `least` are none.
pub(super) fn direction(speeds: &[f64], least: f64) -> ContactMode {
    let mean = speeds.iter().sum::<f64>() / speeds.len().max(1) as f64;
    if mean.abs() <= least {
        ContactMode::Closed
    } else if mean > 0.0 {
        ContactMode::Slides
    } else {
        ContactMode::SlidesBack
    }
}
