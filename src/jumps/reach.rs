//! Changes of the states that the forces of a scene make in the horizon. States that are small compared with them count as zero.

use super::functions::SceneFunctions;
use super::problem::Statement;
use crate::func::Point;
use crate::linalg::cholesky;
use crate::nlp::middles;

/// Ways of the coordinates and changes of the velocities in the horizon without contacts, at the middle of the bounds of the initial state: accelerations
/// `M⁻¹ f_v` there, with the moduli of what the controls add within their finite bounds, last all the time. Each has the unit of its state. Zero for what
/// no force moves, and where a function has no value.
pub(super) fn of_forces(g: &Statement, f: &SceneFunctions) -> Vec<f64> {
    accelerated(g, f).unwrap_or_else(|| vec![0.0; g.dims.x])
}

fn accelerated(g: &Statement, f: &SceneFunctions) -> Option<Vec<f64>> {
    let (n_q, n_v) = (f.n_q, f.n_v);
    let horizon: f64 = g.durations.iter().sum();
    let params = &g.params[..g.dims.p];
    let x0 = middles(&g.x0_bounds);
    let zeros = vec![0.0; g.dims.u];
    let at = Point { t: g.t0, x: &x0, u: &zeros, p: params };
    // the inertia matrix column by column
    let mut inertia = vec![0.0; n_v * n_v];
    let (mut work, mut column) = (vec![0.0; f.momentum.work_len()], vec![0.0; n_v]);
    for j in 0..n_v {
        let mut with = [params, &vec![0.0; n_v]].concat();
        with[g.dims.p + j] = 1.0;
        f.momentum.value(&Point { p: &with, ..at }, &mut column, &mut work).ok()?;
        (0..n_v).for_each(|i| inertia[i * n_v + j] = column[i]);
    }
    if !cholesky::factorise(n_v, &mut inertia) {
        return None;
    }
    let mut work = vec![0.0; f.smooth.work_len()];
    let mut forces = vec![0.0; n_q + n_v];
    f.smooth.value(&at, &mut forces, &mut work).ok()?;
    let pattern = f.smooth.jac_pattern();
    let mut jac = vec![0.0; pattern.nnz()];
    f.smooth.jacobian(&at, &mut jac, &mut work).ok()?;
    let mut speeds = vec![0.0; n_v];
    let mut add = |mut force: Vec<f64>| {
        cholesky::solve(&inertia, &mut force);
        speeds.iter_mut().zip(force).for_each(|(s, a)| *s += a.abs() * horizon);
    };
    add(forces[n_q..].to_vec());
    for j in 0..g.dims.u {
        let most = g.u_bounds.iter().map(|b| b[j].abs()).filter(|b| b.is_finite()).fold(0.0, f64::max);
        let mut force = vec![0.0; n_v];
        let column = g.dims.x + j;
        for (&i, slope) in pattern.rows(column).iter().zip(&jac[pattern.range(column)]) {
            if i >= n_q {
                force[i - n_q] = most * slope;
            }
        }
        add(force);
    }
    // rates of the coordinates are linear in the velocities
    let mut out = vec![0.0; n_q];
    for (j, speed) in speeds.iter().enumerate() {
        for (&i, slope) in pattern.rows(n_q + j).iter().zip(&jac[pattern.range(n_q + j)]) {
            if i < n_q {
                out[i] += 0.5 * horizon * speed * slope.abs();
            }
        }
    }
    out.extend(speeds);
    out.iter().all(|r| r.is_finite()).then_some(out)
}

#[cfg(test)]
mod tests {
    use super::super::chain_tests::ball_from;
    use super::super::problem::{Problem, Statement};

    #[test]
    fn forces_take_states_as_far_as_they_accelerate_them() {
        // the ball falls for 2 s; a push sideways of 3 on a mass of 1
        let u_bounds = [vec![-1.0], vec![3.0]];
        let p = Problem::new(Statement { u_bounds, ..ball_from(1.0) }).unwrap();
        for (reach, exact) in p.reach.iter().zip([6.0, 19.62, 6.0, 19.62]) {
            assert!((reach - exact).abs() < 1e-12, "{:?}", p.reach);
        }
        // a control without bounds has no force that is known
        assert_eq!(Problem::new(ball_from(1.0)).unwrap().reach[0], 0.0);
    }
}
