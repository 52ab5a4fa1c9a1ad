//! Usual sizes of the states of a scene, from what a problem says of them.

use super::problem::Problem;
use crate::func::Point;

/// Sizes of the states: the larger of their values at the start, at the target and at their finite bounds. A state of which these say nothing
/// has the size of the largest of its kind; coordinates of which nothing is known have that of the largest gap at the start, velocities cross the
/// largest coordinate in the horizon. Where nothing at all has a size, there is no unit to be independent of, and they are 1.
pub(super) fn of_states(p: &Problem, x0: &[f64], target: Option<&[f64]>) -> Vec<f64> {
    let g = &p.given;
    let n_q = p.functions.n_q;
    let bounds = [&g.x_bounds[0], &g.x_bounds[1], &g.x0_bounds[0], &g.x0_bounds[1]];
    let known = |i: usize| {
        let more = bounds.iter().map(|b| b[i]).filter(|b| b.is_finite());
        more.chain(target.map(|t| t[i])).fold(x0[i].abs(), |m, v| m.max(v.abs()))
    };
    let mut x: Vec<f64> = (0..g.dims.x).map(known).collect();
    let largest = |x: &[f64]| x.iter().copied().fold(0.0, f64::max);
    let horizon: f64 = g.durations.iter().sum();
    let u = vec![0.0; g.dims.u];
    let gaps = p.gaps(&Point { t: g.t0, x: x0, u: &u, p: &g.params[..g.dims.p] });
    let gap = gaps.iter().map(|gap| gap.1.abs()).filter(|gap| gap.is_finite()).fold(0.0, f64::max);
    let ways = [largest(&x[..n_q]), gap, largest(&x[n_q..]) * horizon];
    let way = ways.into_iter().find(|w| *w > 0.0).unwrap_or(1.0);
    let speeds = [largest(&x[n_q..]), way / horizon];
    let speed = speeds.into_iter().find(|w| *w > 0.0).unwrap_or(1.0);
    for (i, size) in x.iter_mut().enumerate().filter(|(_, size)| **size == 0.0) {
        *size = if i < n_q { way } else { speed };
    }
    x
}
