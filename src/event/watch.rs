//! What must stay positive under an active set: distances to the surfaces around, weights of the active cells.

use super::field::{Field, TO_RATE};
use super::step::{horner, Poly, Stages, Step};
use crate::func::EvalResult;

/// A function of time and state that is positive as long as the active set holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Watch {
    /// `sign · (q_a − q_b)`: another region begins where it vanishes.
    Enter { sub: usize, a: usize, b: Option<usize>, sign: f64 },
    /// The weight of an active cell.
    Leave { sub: usize, cell: usize },
    /// `sign · q_a`, of the guard of a transition: it happens where this vanishes, or, where the guard has passed zero
    /// already (`back`), it is watched again from there on.
    Guard { guard: usize, a: usize, sign: f64, back: bool },
    /// A function of a contact, whose value stands at `a`.
    Contact { contact: usize, what: ContactWatch, a: usize },
}

/// What is watched of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum ContactWatch {
    /// The gap of an open contact.
    Gap,
    /// The normal force of a closed one.
    Pressure,
    /// What is left of the friction of one that sticks; in the plane towards either side.
    Cone(f64),
    /// The speed of one that slides.
    Speed,
}

impl ContactWatch {
    /// Is it a force, whose rate is not known?
    pub(super) fn is_force(self) -> bool {
        matches!(self, ContactWatch::Pressure | ContactWatch::Cone(_))
    }
}

impl Watch {
    pub(super) fn is_leave(&self) -> bool {
        matches!(self, Watch::Leave { .. })
    }

    /// Is it something that may begin a little below zero and rise: a gap that others have pushed there by less than the
    /// tolerances see, a sliding velocity that is taken as zero?
    pub(super) fn may_begin_below(&self) -> bool {
        matches!(self, Watch::Contact { what: ContactWatch::Gap | ContactWatch::Speed, .. })
    }

    /// What is watched as a difference of indicators: `sign · (q_a − q_b)`; none for a weight.
    fn difference(&self) -> Option<(usize, Option<usize>, f64)> {
        match *self {
            Watch::Enter { a, b, sign, .. } => Some((a, b, sign)),
            Watch::Guard { a, sign, .. } => Some((a, None, sign)),
            Watch::Leave { .. } | Watch::Contact { .. } => None,
        }
    }

    /// The place of its value among those of all that is watched; none for a weight.
    pub(super) fn place(&self) -> Option<usize> {
        match *self {
            Watch::Enter { a, .. } | Watch::Guard { a, .. } | Watch::Contact { a, .. } => Some(a),
            Watch::Leave { .. } => None,
        }
    }

    /// Is it something that a state jump, a reset or an impact, may put to zero and push away from it?
    pub(super) fn is_left_by_jumps(&self) -> bool {
        matches!(self, Watch::Guard { .. } | Watch::Contact { .. })
    }

    /// Rate of change for a velocity: of a contact that which stands among the values `q`, NaN for forces.
    #[inline]
    pub(super) fn rate_in(&self, q: &[f64], dq: &[f64], field: &Field, velocity: &[f64]) -> f64 {
        match *self {
            Watch::Contact { a, .. } => q[a + TO_RATE],
            _ => self.rate(dq, field, velocity),
        }
    }

    /// Is its gradient constant?
    #[inline]
    pub(super) fn is_affine(&self, field: &Field) -> bool {
        match *self {
            Watch::Enter { sub, .. } => field.subs[sub].affine,
            Watch::Guard { guard, .. } => field.guards.all[guard].affine,
            Watch::Leave { .. } | Watch::Contact { .. } => false,
        }
    }

    /// Value from indicators `q` and the weights of the field.
    #[inline]
    pub(super) fn value(&self, q: &[f64], field: &Field) -> f64 {
        match *self {
            Watch::Enter { a, b, sign, .. } => sign * (q[a] - b.map_or(0.0, |b| q[b])),
            Watch::Guard { a, sign, .. } => sign * q[a],
            Watch::Leave { cell, .. } => field.theta(cell),
            Watch::Contact { a, .. } => q[a],
        }
    }

    /// Rate of change for a velocity, from the gradients `dq` of all that is watched; 0 for weights.
    #[inline]
    pub(super) fn rate(&self, dq: &[f64], field: &Field, velocity: &[f64]) -> f64 {
        let Some((a, b, sign)) = self.difference() else { return 0.0 };
        let along = |j: usize| field.gradients.row(dq, j).along(velocity);
        sign * (along(a) - b.map_or(0.0, along))
    }

    /// The same for a velocity that is given by its components.
    pub(super) fn rate_at(&self, dq: &[f64], field: &Field, velocity: impl Fn(usize) -> f64) -> f64 {
        let Some((a, b, sign)) = self.difference() else { return 0.0 };
        let along = |j: usize| {
            let g = field.gradients.row(dq, j);
            g.states().map(|(i, g)| g * velocity(i)).sum::<f64>() + g.t
        };
        sign * (along(a) - b.map_or(0.0, along))
    }

    /// Change since the start of a step at relative time `s` of its dense output, where the gradient is constant.
    pub(super) fn change(&self, dq: &[f64], field: &Field, step: &Step, s: f64) -> f64 {
        let Some((a, b, sign)) = self.difference() else { return 0.0 };
        let along = |j: usize| {
            let g = field.gradients.row(dq, j);
            g.states().map(|(i, g)| g * (horner(&step.poly[i], s) - step.x0[i])).sum::<f64>() + g.t * s * step.h
        };
        sign * (along(a) - b.map_or(0.0, along))
    }

    /// The same as a polynomial in the relative time.
    pub(super) fn change_in_powers(&self, dq: &[f64], field: &Field, step: &Step) -> Poly {
        let mut out = [0.0; 8];
        let Some((a, b, sign)) = self.difference() else { return out };
        for (j, sign) in std::iter::once((a, sign)).chain(b.map(|b| (b, -sign))) {
            let g = field.gradients.row(dq, j);
            for (i, g) in g.states() {
                out.iter_mut().zip(&step.poly[i]).skip(1).for_each(|(o, c)| *o += sign * g * c);
            }
            out[1] += sign * g.t * step.h;
        }
        out
    }

    /// Least and largest rate for the velocities at the first `n` stages of a step.
    pub(super) fn rates(&self, dq: &[f64], field: &Field, k: &[Stages], n: usize) -> (f64, f64) {
        // of few stages few are looked at
        match n {
            0..=4 => self.rates_at_most::<4>(dq, field, k, n),
            5..=8 => self.rates_at_most::<8>(dq, field, k, n),
            _ => self.rates_at_most::<16>(dq, field, k, n),
        }
    }

    fn rates_at_most<const N: usize>(&self, dq: &[f64], field: &Field, k: &[Stages], n: usize) -> (f64, f64) {
        let mut out = [0.0; N];
        let Some((a, b, sign)) = self.difference() else { return (0.0, 0.0) };
        for (j, sign) in std::iter::once((a, sign)).chain(b.map(|b| (b, -sign))) {
            let g = field.gradients.row(dq, j);
            out.iter_mut().for_each(|o| *o += sign * g.t);
            for (i, g) in g.states() {
                out.iter_mut().zip(&k[i]).for_each(|(o, k)| *o += sign * g * k);
            }
        }
        let range = (f64::INFINITY, f64::NEG_INFINITY);
        out[..n].iter().fold(range, |(lo, hi), r| (lo.min(*r), hi.max(*r)))
    }

    /// Derivatives of the time at which this vanishes with respect to state, parameters and controls, written to the
    /// first `n_z − 1` places of `out`; `velocity` is that before, gradients and active set of the field are those at
    /// the point.
    pub(super) fn time_gradient(
        &self,
        field: &mut Field,
        (t, x, velocity): (f64, &[f64], &[f64]),
        out: &mut [f64],
    ) -> EvalResult {
        let n_z = field.n_z;
        match (*self, self.difference()) {
            (Watch::Contact { contact, what, .. }, _) => field.contact_gradient((contact, what), (t, x), out)?,
            (Watch::Leave { cell, .. }, _) => field.theta_gradient(cell, (t, x, velocity), out)?,
            (_, None) => {}
            (_, Some((a, b, sign))) => {
                out.fill(0.0);
                field.gradient_row(a).inputs().for_each(|(i, g)| out[i] = sign * g);
                if let Some(b) = b {
                    field.gradient_row(b).inputs().for_each(|(i, g)| out[i] -= sign * g);
                }
            }
        }
        let rate = out.iter().zip(velocity).fold(out[n_z - 1], |r, (g, v)| r + g * v);
        out[..n_z - 1].iter_mut().for_each(|g| *g /= -rate);
        Ok(())
    }

    /// Is the rate of a guard at this velocity positive beyond its own rounding? A guard that has just been left by a reset
    /// is zero to rounding, and its rate, however small, is what separates it from zero.
    pub(super) fn rises(&self, dq: &[f64], field: &Field, velocity: &[f64]) -> bool {
        let Some((a, _, _)) = self.difference() else { return false };
        let g = field.gradients.row(dq, a);
        let terms = g.states().map(|(i, g)| (g * velocity[i]).abs()).sum::<f64>() + g.t.abs();
        self.rate(dq, field, velocity) > 64.0 * f64::EPSILON * terms
    }

    /// Half a unit in the last place of the value. For a guard it is that of the numbers themselves, not of what tolerances
    /// take for zero: a ball that hardly leaves the floor must know when it is back.
    pub(super) fn rounding(&self, dq: &[f64], field: &Field, t: f64, x: &[f64]) -> f64 {
        let Watch::Guard { a, .. } = *self else { return 0.5 * f64::EPSILON * self.scale(dq, field, t, x).value };
        let g = field.gradients.row(dq, a);
        let terms = g.states().map(|(i, g)| (g * x[i]).abs()).sum::<f64>() + (g.t * t).abs();
        0.5 * f64::EPSILON * terms
    }

    /// What its value may be off by where a step is to end at its zero: [`Watch::rounding`]. For a guard in which time alone moves that is what half a unit
    /// in the last place of the time makes, so that clocks strike at the times of their formula.
    pub(super) fn rounding_of_zero(&self, dq: &[f64], field: &Field, (t, x): (f64, &[f64]), velocity: &[f64]) -> f64 {
        if let (Watch::Guard { a, .. }, true) = (*self, self.is_affine(field)) {
            let g = field.gradients.row(dq, a);
            if g.t != 0.0 && g.states().all(|(i, g)| g * velocity[i] == 0.0) {
                return 0.5 * (t.abs().next_up() - t.abs()) * g.t.abs();
            }
        }
        self.rounding(dq, field, t, x)
    }

    /// [`Watch::scale`] and [`Watch::rate`] at once, where there are many of these.
    pub(super) fn scale_and_rate(
        &self,
        dq: &[f64],
        field: &Field,
        (t, x): (f64, &[f64]),
        velocity: &[f64],
    ) -> (Scale, f64) {
        let Watch::Enter { a, b: None, sign, .. } = *self else {
            return (self.scale(dq, field, t, x), self.rate(dq, field, velocity));
        };
        let g = field.gradients.row(dq, a);
        let (mut reach, mut rate) = (0.0, 0.0);
        for (i, g) in g.states() {
            reach += g.abs() * field.size(i, x[i]);
            rate += g * velocity[i];
        }
        (Scale { value: (g.t * t).abs() + reach, reach }, sign * (rate + g.t))
    }

    /// Sizes to compare value and rate with; `dq` are the gradients of the indicators.
    pub(super) fn scale(&self, dq: &[f64], field: &Field, t: f64, x: &[f64]) -> Scale {
        if let Watch::Contact { contact, what, .. } = *self {
            return field.contact_scale(contact, what);
        }
        let Some((a, b, _)) = self.difference() else { return Scale { value: 1.0, reach: 1.0 } };
        let mut s = Scale { value: 0.0, reach: 0.0 };
        for j in std::iter::once(a).chain(b) {
            let g = field.gradients.row(dq, j);
            s.reach += field.sum_of_sizes(g.states(), x);
            s.value += (g.t * t).abs();
        }
        s.value += s.reach;
        s
    }

    /// Euclidean norm of the gradient with respect to the state, for cosines that are reported; 1 for what has none.
    pub(super) fn steepness(&self, dq: &[f64], field: &Field) -> f64 {
        let Some((a, b, _)) = self.difference() else { return 1.0 };
        let square = |j: usize| field.gradients.row(dq, j).values.iter().map(|g| g * g).sum::<f64>();
        std::iter::once(a).chain(b).map(square).sum::<f64>().sqrt()
    }
}

/// Sizes of a watched function at a point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Scale {
    /// Size of the terms of the value: its rounding errors in units of the machine precision.
    pub(super) value: f64,
    /// What it changes by when all states change by their size.
    pub(super) reach: f64,
}

/// All that is to be watched under the active set of the field.
pub(super) fn list(field: &Field, out: &mut Vec<Watch>) {
    out.clear();
    for (k, (s, set)) in field.subs.iter().zip(&field.active).enumerate() {
        let first = set[0] - s.first;
        if s.signs {
            for j in 0..s.n_q {
                let w = s.cells[first].weights[j];
                let fixed = set.iter().all(|c| s.cells[c - s.first].weights[j] == w);
                if w != 0.0 && fixed && set.iter().any(|c| s.cares(c - s.first, j)) {
                    out.push(Watch::Enter { sub: k, a: s.q0 + j, b: None, sign: -w });
                }
            }
        } else {
            for j in (0..s.cells.len()).filter(|j| !set.contains(&(s.first + j))) {
                out.push(Watch::Enter { sub: k, a: s.q0 + j, b: Some(s.q0 + first), sign: 1.0 });
            }
        }
        if set.len() > 1 {
            out.extend(set.iter().map(|&cell| Watch::Leave { sub: k, cell }));
        }
    }
    field.own_watches(out);
    field.contact_watches(out);
    for &guard in &field.guards.armed {
        let g = &field.guards.all[guard];
        let toward = g.transition.direction.sign();
        let sign = if g.spent { toward } else { -toward };
        out.extend(g.watched.iter().map(|l| Watch::Guard { guard, a: g.q + l, sign, back: g.spent }));
    }
}
