//! Bounds of states, and path constraints that are such bounds, that switching surfaces keep. A speed `v ≥ 0` with dry friction is zero where the mass comes to rest, and stays there: the
//! bound acts at a point that moves with the switch, or on a state that does not move at all, and no change of the controls violates it.
//! In the discretised problem it shares the force with the rows that keep the modes, in any ratio, so that its multiplier there says
//! nothing.

use crate::fesd::StatePoint;
use crate::func::Point;
use crate::system::System;

/// Distance of a state from a surface, relative to the size of the state, at which it is on it; the same of derivatives.
const ON: f64 = 1e-8;

/// Data of the control stages: times at their starts and their lengths, parameters, controls.
pub(super) struct Stages<'a> {
    pub(super) starts: &'a [f64],
    pub(super) lengths: &'a [f64],
    pub(super) params: &'a [f64],
    pub(super) controls: &'a [f64],
}

/// The variables among those at the points that something bounds alone, as `bounded [n]` says, and that are on a switching surface of their own
/// there: one that nothing else changes. `sizes` are those of the states.
pub(super) fn on_own_surfaces(
    system: &System,
    points: &[StatePoint],
    (w, bounded): (&[f64], &[bool]),
    sizes: &[f64],
    stages: &Stages,
) -> Vec<usize> {
    let functions = system.switching_functions();
    let d = system.dims();
    let mut out = Vec::new();
    // the initial state is no variable that a multiplier of a bound acts on behind it
    for at in points.iter().skip(1) {
        if !bounded[at.at..at.at + d.x].contains(&true) {
            continue;
        }
        let k = at.stage;
        let point = Point {
            t: stages.starts[k] + at.share * stages.lengths[k],
            x: &w[at.at..at.at + d.x],
            u: &stages.controls[k * d.u..(k + 1) * d.u],
            p: &stages.params[k * d.p..(k + 1) * d.p],
        };
        for f in &functions {
            let pattern = f.jac_pattern();
            let (mut values, mut jac) = (vec![0.0; f.n_out()], vec![0.0; pattern.nnz()]);
            let mut work = vec![0.0; f.work_len()];
            if f.value(&point, &mut values, &mut work).is_err() || f.jacobian(&point, &mut jac, &mut work).is_err() {
                continue;
            }
            // the largest derivative of every output by a state in its size, which state that is, and the sum of all others
            let mut own = vec![(0.0, 0, 0.0); f.n_out()];
            for j in 0..f.dims().n_in() {
                // a surface that anything but states moves is none of a state alone
                let size = sizes.get(j).copied().unwrap_or(f64::INFINITY);
                for (&i, v) in pattern.rows(j).iter().zip(&jac[pattern.range(j)]) {
                    let (largest, which, others) = own[i];
                    let change = if *v == 0.0 { 0.0 } else { (v * size).abs() };
                    own[i] = match j < d.x && change > largest {
                        true => (change, j, others + largest),
                        false => (largest, which, others + change),
                    };
                }
            }
            let on = own
                .iter()
                .zip(&values)
                .filter(|((change, _, others), v)| *change > 0.0 && v.abs() <= ON * change && *others <= ON * change);
            out.extend(on.map(|((_, j, _), _)| at.at + j).filter(|&j| bounded[j]));
        }
    }
    out
}
