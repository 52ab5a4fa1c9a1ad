//! Controls that stay on a switching surface for a whole stage, such as `u = 0` where the model has `|u|`. Nothing switches there, but the
//! derivatives of the cost are others on the two sides. With `n` the gradient of the surface in the controls, and `Λᵀ S_A`,
//! `Λᵀ S_B` the derivatives on the side where its function is negative and on the other, the cost is continuous only if
//!
//! ```text
//! Λᵀ S_B = Λᵀ S_A + β n,
//! ```
//!
//! and the answer is stationary if `Λᵀ S_A + c n` vanishes for some `0 ≤ c ≤ β`: `c` and `β − c` are the derivatives towards
//! either side. The derivatives are those of simulations with controls that are moved off the surface by a little.
//!
//! Where the motion is another one beyond, as with a lever that is exactly between two gears, the cost jumps. Of the two sides that of the
//! answer is the one whose simulation leads to it; there the answer is stationary if `Λᵀ S + c n` vanishes for some `c ≥ 0`, with `n` the
//! gradient of what is positive beyond: the derivative of moving away from the surface is `c`.

use super::simulate::Stage;
use super::{dot, Corner, Judge, Kind, Leg, Piece, AWAY, NOISE, RANK, TOLERANCE, TOUCH};
use crate::error::Result;
use crate::fesd::StatePoint;
use crate::func::Point;
use crate::system::{SharedFunction, System};
use nalgebra::{DMatrix, DVector};

/// The values of a switching function along a stage, relative to what the controls change it by, that count as zero.
const ON: f64 = 1e-8;

/// Controls of the answer that are moved: what they are measured in, and their bounds. `[nu]` each.
pub(super) struct Movable {
    pub(super) sizes: Vec<f64>,
    pub(super) bounds: [Vec<f64>; 2],
}

/// A surface that the controls of a stage stay on.
struct Surface {
    /// Gradient in units of the controls.
    normal: DVector<f64>,
    /// How far the controls are from it, on the side where its function is positive, in the same units.
    offset: f64,
}

impl Judge<'_> {
    /// The corners of controls that stay on surfaces in stages, whose legs then are those of the sides where the functions are
    /// negative. Derivatives are left as they are in stages of which not all of this can be told.
    pub(super) fn held_on_surfaces(
        &mut self,
        system: &System,
        movable: &Movable,
        stages: &[Stage],
        all: &[StatePoint],
        legs: &mut [Leg],
    ) -> Result<Vec<Corner>> {
        let functions = system.switching_functions();
        // functions are as far from zero as they are large, at most, on the way of the answer: twice what half of a range changes them by
        let near = if self.keeps_clear { ON.max(2.0 * self.touch) } else { ON };
        let mut out = Vec::new();
        for &stage in stages {
            let Stage { k, t, length, .. } = stage;
            let along: Vec<StatePoint> = all.iter().filter(|p| p.stage == k).copied().collect();
            let surfaces = self.surfaces_of_stage(&functions, movable, (t, length), (&along, near));
            if !surfaces.is_empty() {
                out.extend(self.sides_of_stage(stage, &surfaces, movable, &mut legs[k])?);
            }
        }
        Ok(out)
    }

    /// Switching functions that are zero, or no further from it than `near` of what the controls change them by, along a stage whatever the
    /// state is, and that the controls change everywhere to the same side.
    fn surfaces_of_stage(
        &self,
        functions: &[SharedFunction],
        movable: &Movable,
        (t, length): (f64, f64),
        (along, near): (&[StatePoint], f64),
    ) -> Vec<Surface> {
        let mut out = Vec::new();
        let Some(stage) = along.first().map(|p| p.stage) else { return out };
        let p = &self.params[stage * self.n_p..(stage + 1) * self.n_p];
        let u = &self.controls[stage * self.n_u..(stage + 1) * self.n_u];
        for f in functions {
            let (d, pattern) = (f.dims(), f.jac_pattern());
            let zero = || Some(Surface { normal: DVector::zeros(self.n_u), offset: 0.0 });
            let mut found: Vec<Option<Surface>> = (0..f.n_out()).map(|_| zero()).collect();
            let (mut values, mut jac) = (vec![0.0; f.n_out()], vec![0.0; pattern.nnz()]);
            let mut work = vec![0.0; f.work_len()];
            for at in along {
                let x = self.state(at.at);
                let point = Point { t: t + at.share * length, x: &x, u, p };
                if f.value(&point, &mut values, &mut work).is_err() || f.jacobian(&point, &mut jac, &mut work).is_err()
                {
                    return Vec::new();
                }
                let mut of_states = vec![0.0; f.n_out()];
                let mut of_controls = vec![DVector::zeros(self.n_u); f.n_out()];
                for j in 0..d.n_in() {
                    for (&i, v) in pattern.rows(j).iter().zip(&jac[pattern.range(j)]) {
                        match j.checked_sub(d.x) {
                            None => of_states[i] += (v * self.ranges[j]).abs(),
                            Some(c) if c < self.n_u => of_controls[i][c] = v * movable.sizes[c],
                            Some(_) => (),
                        }
                    }
                }
                for (i, surface) in found.iter_mut().enumerate() {
                    let (own, before) = (&of_controls[i], surface.as_ref().map_or(0.0, |s| s.normal.norm()));
                    let on = values[i].abs() <= near * own.norm() && of_states[i] <= ON * own.norm();
                    let along = surface.as_ref().is_some_and(|s| s.normal.dot(own) >= (1.0 - ON) * before * own.norm());
                    match on && along {
                        true if own.norm() > before => {
                            *surface = Some(Surface { normal: own.clone(), offset: values[i] / own.norm() });
                        }
                        true => (),
                        false => *surface = None,
                    }
                }
            }
            out.extend(found.into_iter().flatten().filter(|s| s.normal.norm() > 0.0));
        }
        out
    }

    /// Simulates a stage on the sides of its surfaces.
    fn sides_of_stage(
        &mut self,
        stage: Stage,
        surfaces: &[Surface],
        movable: &Movable,
        leg: &mut Leg,
    ) -> Result<Vec<Corner>> {
        let Stage { k, t, .. } = stage;
        let rows = DMatrix::from_fn(surfaces.len(), self.n_u, |i, j| surfaces[i].normal[j] / surfaces[i].normal.norm());
        let svd = rows.clone().svd(true, true);
        // which side of one is which side of another where they depend on each other
        if svd.rank(RANK) < surfaces.len() {
            return Ok(Vec::new());
        }
        // a unit towards every surface, along all others
        let Ok(towards) = svd.pseudo_inverse(RANK) else { return Ok(Vec::new()) };
        let own = self.controls[k * self.n_u..(k + 1) * self.n_u].to_vec();
        // as far from the surface as the answer is, at least a little
        let place = |(surface, sign): (&Surface, &f64)| sign * TOUCH.max(surface.offset.abs()) - surface.offset;
        // where bounds leave one side only there is no other; where several controls at bounds are on a surface, some of them may leave it
        // to one side and some to the other
        let side = |(i, surface): (usize, &Surface)| {
            let leaves = |sign: f64| {
                let ([lower, upper], far) = (&movable.bounds, place((surface, &sign)));
                let moved = |j: usize| own[j] + far * movable.sizes[j] * towards[(j, i)];
                (0..own.len()).any(|j| towards[(j, i)].abs() > RANK && (moved(j) < lower[j] || moved(j) > upper[j]))
            };
            match (leaves(-1.0), leaves(1.0)) {
                (false, true) => [-1.0, -1.0],
                (true, false) => [1.0, 1.0],
                _ => [-1.0, 1.0],
            }
        };
        let sides: Vec<[f64; 2]> = surfaces.iter().enumerate().map(side).collect();
        let at = |signs: &[f64]| -> DVector<f64> {
            &towards * DVector::from_iterator(signs.len(), surfaces.iter().zip(signs).map(place))
        };
        let beyond = |signs: &[f64], i: usize| {
            let mut signs = signs.to_vec();
            signs[i] = -signs[i];
            signs
        };
        // an answer that keeps a distance tells its side
        let first = |(s, surface): (&[f64; 2], &Surface)| match surface.offset {
            o if o.abs() > ON && s.contains(&o.signum()) => o.signum(),
            _ => s[0],
        };
        let mut signs: Vec<f64> = sides.iter().zip(surfaces).map(first).collect();
        let mut jumps = vec![false; surfaces.len()];
        // in units of the controls the gradient has length 1, and so has the unit towards it in the direction of the gradient
        let gradient = |i: usize, sign: f64| (0..own.len()).map(|j| sign * rows[(i, j)] / movable.sizes[j]).collect();
        'sides: loop {
            let here = self.moved_leg(stage, (&own, &at(&signs), movable))?;
            let mut out = Vec::new();
            for i in (0..surfaces.len()).filter(|&i| sides[i][0] != sides[i][1]) {
                let other = at(&beyond(&signs, i));
                let corner = |controls, kind| Corner { stage: k, t, normal: Vec::new(), controls, own: k, kind };
                if !jumps[i] {
                    let there = self.moved_leg(stage, (&own, &other, movable))?;
                    match (&here, &there) {
                        (Some(here), Some(there)) if self.continuous(here, there, &(&other - at(&signs)), movable) => {
                            // the derivatives are those of the side where the function is negative
                            if signs[i] > 0.0 {
                                signs = beyond(&signs, i);
                                continue 'sides;
                            }
                            let beyond = self.changes(here, there, movable, &towards.column(i).into_owned());
                            out.push(corner(gradient(i, 1.0), Kind::Control { beyond }));
                            continue;
                        }
                        (None, None) => return Ok(Vec::new()),
                        _ => jumps[i] = true,
                    }
                    let off = |leg: &Option<Leg>| leg.as_ref().map_or(f64::INFINITY, |leg| leg.off);
                    if off(&there) < off(&here) {
                        signs = beyond(&signs, i);
                        continue 'sides;
                    }
                }
                let across = own.iter().zip(other.iter().zip(&movable.sizes)).map(|(u, (d, s))| u + d * s).collect();
                out.push(corner(gradient(i, -signs[i]), Kind::Jump { across }));
            }
            let Some(here) = here else { return Ok(Vec::new()) };
            *leg = here;
            return Ok(out);
        }
    }

    /// For every piece of a stage by how much more its end changes `there` than `here` with a step `unit` of the controls, in their units.
    fn changes(&self, here: &Leg, there: &Leg, movable: &Movable, unit: &DVector<f64>) -> Vec<Vec<f64>> {
        let (n_z, first) = (self.n() + self.n_p + self.n_u, self.n() + self.n_p);
        let change = |a: &[f64], b: &[f64]| {
            (0..self.n_u).map(|j| (b[first + j] - a[first + j]) * movable.sizes[j] * unit[j]).sum()
        };
        let of_piece = |(a, b): (&Piece, &Piece)| -> Vec<f64> {
            a.s.chunks_exact(n_z).zip(b.s.chunks_exact(n_z)).map(|(a, b)| change(a, b)).collect()
        };
        here.pieces.iter().zip(&there.pieces).map(of_piece).collect()
    }

    /// A stage with controls that are moved by `by`, in their units.
    fn moved_leg(
        &mut self,
        stage: Stage,
        (own, by, movable): (&[f64], &DVector<f64>, &Movable),
    ) -> Result<Option<Leg>> {
        let place = stage.k * self.n_u..(stage.k + 1) * self.n_u;
        let moved = own.iter().zip(by.iter().zip(&movable.sizes)).map(|(u, (d, s))| u + d * s);
        self.controls.splice(place.clone(), moved);
        let leg = self.leg(stage);
        self.controls[place].copy_from_slice(own);
        leg
    }

    /// Do two simulations of a stage differ by no more than what their derivatives make of the difference of their controls?
    fn continuous(&self, here: &Leg, there: &Leg, by: &DVector<f64>, movable: &Movable) -> bool {
        let n_z = self.n() + self.n_p + self.n_u;
        let moved: Vec<f64> = by.iter().zip(&movable.sizes).map(|(d, s)| d * s).collect();
        let expected = |leg: &Leg, i: usize| -> f64 {
            let rows = leg.pieces.iter().map(|p| &p.s[i * n_z..(i + 1) * n_z][self.n() + self.n_p..]);
            rows.map(|row| dot(row, &moved).abs()).sum()
        };
        (0..self.n()).filter(|&i| self.ranges[i] > 0.0).all(|i| {
            let apart = (here.end.x[i] - there.end.x[i]).abs();
            apart <= AWAY * (expected(here, i) + expected(there, i) + NOISE * TOLERANCE * self.ranges[i])
        })
    }
}
