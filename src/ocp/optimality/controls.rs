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

use super::{dot, Corner, Judge, Kind, Leg, AWAY, NOISE, RANK, TOLERANCE, TOUCH};
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

/// Surfaces that the controls of a stage stay on: gradients in units of the controls.
type Surfaces = Vec<DVector<f64>>;

impl Judge<'_> {
    /// The corners of controls that stay on surfaces in stages, whose legs then are those of the sides where the functions are
    /// negative. Derivatives are left as they are in stages of which not all of this can be told.
    pub(super) fn held_on_surfaces(
        &mut self,
        system: &System,
        movable: &Movable,
        (t0, lengths): (f64, &[f64]),
        (all, kept): (&[StatePoint], &[StatePoint]),
        legs: &mut [Leg],
    ) -> Result<Vec<Corner>> {
        let functions = system.switching_functions();
        let mut out = Vec::new();
        let (mut t, mut first) = (t0, 0);
        for (k, &length) in lengths.iter().enumerate() {
            let last = kept.iter().rposition(|p| p.stage == k).unwrap_or(first);
            let along: Vec<StatePoint> = all.iter().filter(|p| p.stage == k).copied().collect();
            let surfaces = self.surfaces_of_stage(&functions, movable, (t, length), &along);
            if !surfaces.is_empty() {
                let points = (t, length, &kept[first..=last]);
                out.extend(self.sides_of_stage(k, &surfaces, movable, points, &mut legs[k])?);
            }
            (t, first) = (t + length, last);
        }
        Ok(out)
    }

    /// Switching functions that are zero along a stage whatever the state is, and that the controls change everywhere to the same side.
    fn surfaces_of_stage(
        &self,
        functions: &[SharedFunction],
        movable: &Movable,
        (t, length): (f64, f64),
        along: &[StatePoint],
    ) -> Surfaces {
        let mut out = Surfaces::new();
        let Some(stage) = along.first().map(|p| p.stage) else { return out };
        let p = &self.params[stage * self.n_p..(stage + 1) * self.n_p];
        let u = &self.controls[stage * self.n_u..(stage + 1) * self.n_u];
        for f in functions {
            let (d, pattern) = (f.dims(), f.jac_pattern());
            let mut normals: Vec<Option<DVector<f64>>> = vec![Some(DVector::zeros(self.n_u)); f.n_out()];
            let (mut values, mut jac) = (vec![0.0; f.n_out()], vec![0.0; pattern.nnz()]);
            let mut work = vec![0.0; f.work_len()];
            for at in along {
                let x = self.state(at.at);
                let point = Point { t: t + at.share * length, x: &x, u, p };
                if f.value(&point, &mut values, &mut work).is_err() || f.jacobian(&point, &mut jac, &mut work).is_err()
                {
                    return Surfaces::new();
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
                for (i, normal) in normals.iter_mut().enumerate() {
                    let (own, before) = (&of_controls[i], normal.as_ref().map_or(0.0, |n| n.norm()));
                    let on = values[i].abs().max(of_states[i]) <= ON * own.norm();
                    let along = normal.as_ref().is_some_and(|n| n.dot(own) >= (1.0 - ON) * before * own.norm());
                    match on && along {
                        true if own.norm() > before => *normal = Some(own.clone()),
                        true => (),
                        false => *normal = None,
                    }
                }
            }
            out.extend(normals.into_iter().flatten().filter(|n| n.norm() > 0.0));
        }
        out
    }

    /// Simulates a stage on the sides of its surfaces.
    fn sides_of_stage(
        &mut self,
        k: usize,
        surfaces: &Surfaces,
        movable: &Movable,
        (t, length, points): (f64, f64, &[StatePoint]),
        leg: &mut Leg,
    ) -> Result<Vec<Corner>> {
        let rows = DMatrix::from_fn(surfaces.len(), self.n_u, |i, j| surfaces[i][j] / surfaces[i].norm());
        let svd = rows.clone().svd(true, true);
        // which side of one is which side of another where they depend on each other
        if svd.rank(RANK) < surfaces.len() {
            return Ok(Vec::new());
        }
        // a unit towards every surface, along all others
        let Ok(towards) = svd.pseudo_inverse(RANK) else { return Ok(Vec::new()) };
        let own = self.controls[k * self.n_u..(k + 1) * self.n_u].to_vec();
        let leaves = |d: &DVector<f64>| {
            let [lower, upper] = &movable.bounds;
            let moved = |j: usize| own[j] + TOUCH * movable.sizes[j] * d[j];
            (0..own.len()).any(|j| d[j].abs() > RANK && (moved(j) < lower[j] || moved(j) > upper[j]))
        };
        // where bounds leave one side only there is no other; where several controls at bounds are on a surface, some of them may leave it
        // to one side and some to the other
        let side = |i: usize| {
            let d = towards.column(i).into_owned();
            match (leaves(&-&d), leaves(&d)) {
                (false, true) => [-1.0, -1.0],
                (true, false) => [1.0, 1.0],
                _ => [-1.0, 1.0],
            }
        };
        let sides: Vec<[f64; 2]> = (0..surfaces.len()).map(side).collect();
        let at = |signs: &[f64]| -> DVector<f64> { &towards * DVector::from_column_slice(signs) * TOUCH };
        let base: Vec<f64> = sides.iter().map(|s| s[0]).collect();
        let Some(here) = self.moved_leg(k, (&own, &at(&base), movable), (t, length, points))? else {
            return Ok(Vec::new());
        };
        let mut out = Vec::new();
        for i in (0..surfaces.len()).filter(|&i| sides[i][0] != sides[i][1]) {
            let mut signs = base.clone();
            signs[i] = sides[i][1];
            let Some(there) = self.moved_leg(k, (&own, &at(&signs), movable), (t, length, points))? else {
                return Ok(Vec::new());
            };
            if !self.continuous(&here, &there, &(at(&signs) - at(&base)), movable) {
                return Ok(Vec::new());
            }
            // in units of the controls the gradient has length 1, and so has the unit towards it in the direction of the gradient
            let unit = towards.column(i);
            let jump = |(a, b): (&super::Piece, &super::Piece)| -> Vec<f64> {
                let n_z = self.n() + self.n_p + self.n_u;
                let rows = a.s.chunks_exact(n_z).zip(b.s.chunks_exact(n_z));
                let first = self.n() + self.n_p;
                let change = |a: &[f64], b: &[f64]| {
                    (0..self.n_u).map(|j| (b[first + j] - a[first + j]) * movable.sizes[j] * unit[j]).sum()
                };
                rows.map(|(a, b)| change(a, b)).collect()
            };
            let beyond = here.pieces.iter().zip(&there.pieces).map(jump).collect();
            let controls = (0..self.n_u).map(|j| rows[(i, j)] / movable.sizes[j]).collect();
            out.push(Corner { stage: k, t, normal: Vec::new(), controls, own: k, kind: Kind::Control { beyond } });
        }
        *leg = here;
        Ok(out)
    }

    /// A stage with controls that are moved by `by`, in their units.
    fn moved_leg(
        &mut self,
        k: usize,
        (own, by, movable): (&[f64], &DVector<f64>, &Movable),
        (t, length, points): (f64, f64, &[StatePoint]),
    ) -> Result<Option<Leg>> {
        let place = k * self.n_u..(k + 1) * self.n_u;
        let moved = own.iter().zip(by.iter().zip(&movable.sizes)).map(|(u, (d, s))| u + d * s);
        self.controls.splice(place.clone(), moved);
        let leg = self.leg(k, t, length, points);
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
