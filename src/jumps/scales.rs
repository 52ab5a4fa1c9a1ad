//! Usual sizes of the states of a scene, from what a problem says of them.

use super::functions::ContactFunctions;
use super::problem::Problem;
use super::track::Piece;
use crate::func::Point;
use crate::nlp::middles;
use crate::system::SharedFunction;

/// Bounds count up to this multiple of what states have as their size without them.
const BOUNDED: f64 = 10.0;

/// Share of what forces move a state by in the horizon below which a value says nothing of its size: who starts that near to zero starts at it, and a
/// program in units of such a value would hold nothing but rounding. What forces do to a state has its unit, so that this is the same in all units.
const NEXT_TO_ZERO: f64 = 1e-6;
/// Share of the largest state of its kind, or of the size that is known of a state, below which it is zero but for rounding.
const ROUNDING: f64 = 1e-12;

/// Sizes of the states: the largest of their values at the start, at the target and at their finite bounds, where these are more than next to zero. A
/// state of which these say nothing has the size of the largest of its kind; coordinates of which nothing is known have that of the largest gap at the
/// start, velocities cross the largest coordinate in the horizon. Bounds say how large a state may be, not how large it is, and are often generous: they count up to ten times
/// what its kind has without them. Where nothing at all has a size, there is no unit to be independent of, and they are 1.
pub(super) fn of_states(p: &Problem, x0: &[f64]) -> Vec<f64> {
    let g = &p.given;
    let n_q = p.functions.n_q;
    // behind them every state is of its own kind
    let mechanical = n_q + p.functions.n_own();
    let largest = |x: &[f64]| x.iter().copied().fold(0.0, f64::max);
    let beyond = |v: f64, least: f64| if v > least { v } else { 0.0 };
    let value = |i: usize| g.target.as_ref().map_or(x0[i].abs(), |t| x0[i].abs().max(t[i].abs()));
    let mut known: Vec<f64> = (0..g.dims.x).map(|i| beyond(value(i), NEXT_TO_ZERO * p.reach[i])).collect();
    let (coordinates, velocities) = known[..mechanical].split_at_mut(n_q);
    for kind in [coordinates, velocities] {
        let least = ROUNDING * largest(kind);
        kind.iter_mut().for_each(|v| *v = beyond(*v, least));
    }
    let sides = [&g.x_bounds[0], &g.x_bounds[1], &g.x0_bounds[0], &g.x0_bounds[1]];
    let bound = |i: usize| sides.iter().map(|b| b[i].abs()).filter(|b| b.is_finite()).fold(0.0, f64::max);
    let bounds: Vec<f64> = (0..g.dims.x).map(|i| beyond(bound(i), NEXT_TO_ZERO * p.reach[i])).collect();
    let horizon: f64 = g.durations.iter().sum();
    let u = vec![0.0; g.dims.u];
    let at = Point { t: g.t0, x: x0, u: &u, p: &g.params[..g.dims.p] };
    let own = |(gap, f): ((&str, f64), &ContactFunctions)| {
        beyond(gap.1.abs(), NEXT_TO_ZERO * of_value(&f.gap, &at, &p.reach))
    };
    let gap = p.gaps(&at).into_iter().zip(&p.functions.contacts).map(own).filter(|g| g.is_finite()).fold(0.0, f64::max);
    let (q, v) = (largest(&known[..n_q]), largest(&known[n_q..mechanical]));
    let of_bounds = [largest(&bounds[..n_q]), largest(&bounds[n_q..mechanical]) * horizon];
    let ways = [q, gap, v * horizon].into_iter().chain(of_bounds);
    let way = ways.into_iter().find(|w| *w > 0.0).unwrap_or(1.0);
    let speed = if v > 0.0 { v } else { way / horizon };
    let size = |i: usize| {
        let usual = match i {
            _ if i < n_q => way,
            _ if i < mechanical => speed,
            _ if known[i] > 0.0 => known[i],
            _ => bounds[i],
        };
        match (known[i], bounds[i].min(BOUNDED * usual)) {
            (0.0, 0.0) => usual,
            (known, bound) => known.max(bound),
        }
    };
    let mut sizes: Vec<f64> = (0..g.dims.x).map(size).collect();
    size_further_states(p, &at, &mut sizes);
    sizes
}

/// Gives further states of which nothing is known, whose sizes are zero, those with which they make the usual rates of what they act on: forces that bring
/// velocities to their sizes in the horizon, rates of other such states. Those that act on nothing have 1.
fn size_further_states(p: &Problem, at: &Point, sizes: &mut [f64]) {
    let (f, dims) = (&p.functions, p.given.dims);
    if f.n_z == 0 {
        return;
    }
    let first = dims.x - f.n_z;
    let horizon: f64 = p.given.durations.iter().sum();
    let pattern = f.smooth.jac_pattern();
    let mut jac = vec![0.0; pattern.nnz()];
    let mut momenta = vec![0.0; f.n_v];
    let speeds = [at.p, &sizes[f.n_q..]].concat();
    let work = &mut vec![0.0; f.smooth.work_len().max(f.momentum.work_len())];
    let is_known = f.smooth.jacobian(at, &mut jac, work).is_ok()
        && f.momentum.value(&Point { p: &speeds, ..*at }, &mut momenta, work).is_ok();
    for _ in 0..if is_known { f.n_z } else { 0 } {
        for z in first..dims.x {
            let acts = pattern.rows(z).iter().zip(&jac[pattern.range(z)]).filter(|(k, _)| **k >= f.n_q && **k != z);
            let usual = |k: usize| if k < first { momenta[k - f.n_q].abs() } else { sizes[k] };
            let by = acts.map(|(k, slope)| usual(*k) / (horizon * slope.abs()));
            let least = by.filter(|s| *s > 0.0 && s.is_finite()).fold(f64::INFINITY, f64::min);
            if sizes[z] == 0.0 && least.is_finite() {
                sizes[z] = least;
            }
        }
    }
    sizes[first..].iter_mut().filter(|s| **s == 0.0).for_each(|s| *s = 1.0);
}

/// Size of the value of a function of one output: what states of their sizes make of it to first order, at a point. Gaps need not be lengths, nor
/// have a unit in common with any state.
pub(super) fn of_value(f: &SharedFunction, at: &Point, sizes: &[f64]) -> f64 {
    of_values(f, at, sizes).into_iter().sum()
}

/// The same of every output, the boundary's, whose states are those of the start and of the end, included; zeros where it has no derivatives.
pub(super) fn of_values(f: &SharedFunction, at: &Point, sizes: &[f64]) -> Vec<f64> {
    let pattern = f.jac_pattern();
    let (mut jac, mut out) = (vec![0.0; pattern.nnz()], vec![0.0; f.n_out()]);
    if f.jacobian(at, &mut jac, &mut vec![0.0; f.work_len()]).is_ok() {
        for j in 0..at.x.len() {
            let size = sizes[j % sizes.len()];
            pattern.rows(j).iter().zip(&jac[pattern.range(j)]).for_each(|(&i, v)| out[i] += v.abs() * size);
        }
    }
    out
}

/// Sizes of the states of a motion: their largest moduli, and of those that are next to zero all the time the sizes that are known without it.
pub(super) fn of_motion(p: &Problem, x0: &[f64], pieces: &[Piece]) -> Vec<f64> {
    let mut sizes = vec![0f64; x0.len()];
    let states = pieces.iter().flat_map(|q| q.x0.chunks(x0.len()).chain(q.xs.chunks(x0.len())));
    for x in states.chain([x0]) {
        sizes.iter_mut().zip(x).for_each(|(size, v)| *size = size.max(v.abs()));
    }
    let known = of_states(p, x0);
    for ((size, known), reach) in sizes.iter_mut().zip(known).zip(&p.reach) {
        if *size <= (ROUNDING * known).max(NEXT_TO_ZERO * reach) {
            *size = known;
        }
    }
    sizes
}

/// Units in which the variables of programs are numbers of the usual sizes: thousands of the units of the problem, or thousandths, or these themselves,
/// as engineers write. Programs in micrometers and in kilometers are then the same up to rounding, and one whose numbers are
/// between 0.03 and 30 is taken as it is.
#[derive(Debug, Clone)]
pub(super) struct Units {
    /// Of coordinates, then velocities.
    pub(super) x: Vec<f64>,
    /// Of controls.
    pub(super) u: Vec<f64>,
    pub(super) time: f64,
    /// Of what holds coordinates on a gap that is not linear, per contact.
    pub(super) shifts: Vec<f64>,
    pub(super) contacts: Vec<ContactUnits>,
}

/// Units of a contact.
#[derive(Debug, Clone, Copy)]
pub(super) struct ContactUnits {
    pub(super) gap: f64,
    /// Of rates of the gap.
    pub(super) rate: f64,
    /// Of sliding velocities.
    pub(super) slide: f64,
    /// Of forces, and of impulses.
    pub(super) force: f64,
    pub(super) impulse: f64,
}

/// The power of a thousand that is next to a size; 1 for what has none.
pub(super) fn unit(size: f64) -> f64 {
    if size > 0.0 && size.is_finite() {
        1e3f64.powi((size.log10() / 3.0).round() as i32)
    } else {
        1.0
    }
}

impl Units {
    /// Of a problem, and the controls of a guess. Velocities cross the sizes of the coordinates in the horizon, or are larger where the
    /// problem says so; with the energy `vᵀ M v` of these a force does over a gap of its size what an impulse does at a rate of its size, and
    /// a control without bounds is large enough to do it on the way of a coordinate.
    pub(super) fn new(p: &Problem, controls: &[f64]) -> Units {
        let g = &p.given;
        let f = &p.functions;
        let (n_q, n_v) = (f.n_q, f.n_v);
        let x0 = &middles(&g.x0_bounds)[..];
        let mut sizes = of_states(p, x0);
        let horizon: f64 = g.durations.iter().sum();
        let n_own = f.n_own();
        if n_q == n_own {
            (0..n_q).for_each(|i| sizes[n_q + i] = sizes[n_q + i].max(sizes[i] / horizon));
        }
        let zeros = vec![0.0; g.wide.u + n_v];
        let params = &g.params[..g.dims.p];
        let at = Point { t: g.t0, x: x0, u: &zeros[..g.dims.u], p: params };
        let speeds = &sizes[n_q..];
        let momentum = {
            let with_speeds = [params, speeds].concat();
            let mut out = vec![0.0; n_v];
            let at = Point { p: &with_speeds, ..at };
            f.momentum.value(&at, &mut out, &mut vec![0.0; f.momentum.work_len()]).map_or_else(|_| Vec::new(), |()| out)
        };
        let energy: f64 = momentum.iter().zip(speeds).take(n_own).map(|(m, v)| (m * v).abs()).sum();
        let contacts = f.contacts.iter().map(|c| {
            let (gap, rate) = (of_value(&c.gap, &at, &sizes), of_value(&c.rate, &at, &sizes));
            let slide = c.slide.as_ref().map_or(rate, |s| of_value(s, &at, &sizes));
            let over = |way: f64| if way > 0.0 { unit(energy / way) } else { 1.0 };
            ContactUnits { gap: unit(gap), rate: unit(rate), slide: unit(slide), force: over(gap), impulse: over(rate) }
        });
        let shift = |c: &ContactUnits| sizes[..n_q].iter().fold(0f64, |m, s| m.max(*s)).powi(2) / c.gap;
        let contacts: Vec<ContactUnits> = contacts.collect();
        let bounds = |j: usize| g.u_bounds.iter().map(move |b| b[j].abs()).filter(|b| b.is_finite());
        let given = |j: usize| controls.iter().skip(j).step_by(g.wide.u.max(1)).map(|u| u.abs());
        let of_control = |j: usize| {
            // spread over its range a control is half of its bound on average
            let known = bounds(j).map(|b| 0.5 * b).chain(given(j)).fold(0.0, f64::max);
            if known > 0.0 || j >= g.dims.u {
                return known;
            }
            // what it does is a force for every velocity: its power at their sizes, for one unit of it
            let pattern = f.smooth.jac_pattern();
            let mut jac = vec![0.0; pattern.nnz()];
            if f.smooth.jacobian(&at, &mut jac, &mut vec![0.0; f.smooth.work_len()]).is_err() {
                return 0.0;
            }
            let column = f.smooth.dims().x + j;
            let rows = pattern.rows(column).iter().zip(&jac[pattern.range(column)]);
            let power: f64 = rows.filter(|(i, _)| **i >= n_q).map(|(&i, v)| (v * speeds[i - n_q]).abs()).sum();
            if power > 0.0 {
                energy / (horizon * power)
            } else {
                0.0
            }
        };
        Units {
            u: (0..g.wide.u).map(|j| unit(of_control(j))).collect(),
            time: unit(horizon),
            shifts: contacts.iter().map(|c| unit(shift(c))).collect(),
            contacts,
            x: sizes.into_iter().map(unit).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::chain_tests::ball_from;
    use super::super::problem::{Problem, Statement};
    use super::{of_states, unit};

    #[test]
    fn generous_bounds_say_little_of_sizes() {
        const FREE: [f64; 4] = [f64::INFINITY; 4];
        let sizes = |height: f64, most: [f64; 4]| {
            let x_bounds = [most.map(|v| -v).to_vec(), most.to_vec()];
            let p = Problem::new(Statement { x_bounds, ..ball_from(height) }).unwrap();
            of_states(&p, &p.given().x0_bounds[0])
        };
        // it falls from 1 in 2 s
        assert_eq!(sizes(1.0, FREE), [1.0, 1.0, 0.5, 0.5]);
        assert_eq!(sizes(1.0, [1e3; 4]), [10.0, 10.0, 5.0, 5.0]);
        assert_eq!(sizes(1.0, [1e6; 4]), sizes(1.0, [1e3; 4]));
        // others say how far it gets
        assert_eq!(sizes(1.0, [0.2, 3.0, 2.0, 0.1]), [0.2, 3.0, 2.0, 0.1]);
        // at rest on the floor, nothing else has a unit
        assert_eq!(sizes(0.0, [3.0, f64::INFINITY, 1.0, 1e3]), [3.0, 3.0, 1.0, 15.0]);
    }

    #[test]
    fn a_start_next_to_zero_is_one_at_zero() {
        let sizes = |height: f64| {
            let p = Problem::new(ball_from(height)).unwrap();
            of_states(&p, &p.given().x0_bounds[0])
        };
        let at_zero = sizes(0.0);
        for height in [1e-17, -1e-15, 1e-9, 1e-6] {
            assert_eq!(sizes(height), at_zero, "{height}");
        }
        // it falls by 20 in that time
        assert_eq!(sizes(1e-4)[1], 1e-4);
    }

    #[test]
    fn units_are_powers_of_a_thousand() {
        assert_eq!([0.05, 1.0, 20.0, 100.0, 2e-6, 3e7, 0.0].map(unit), [1.0, 1.0, 1.0, 1e3, 1e-6, 1e6, 1.0]);
    }
}
