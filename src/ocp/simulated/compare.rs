//! The end of a descent and another simulation of its controls: how far they are apart.

use crate::error::{Error, Result};
use crate::ocp::accuracy::{self, Accuracy, Answer, Replay};
use crate::ocp::between::Rows;
use crate::ocp::request::Comparison;
use crate::ocp::{Ocp, OcpResult};
use crate::sim::SolveOptions;
use crate::stop::{self, Why};

impl Ocp {
    /// Compares an answer with the simulation of its controls, transitions included; `beside` are states on the other side of events at the ends of
    /// stages, where they are known.
    pub(super) fn compare_motion(
        &self,
        r: &OcpResult,
        beside: &[Option<Vec<f64>>],
        c: Comparison,
        options: &SolveOptions,
    ) -> Result<Accuracy> {
        let nx = self.system.dims().x;
        if let Some(why) = stop::requested() {
            return Ok(Accuracy::stopped(self.n_stages, nx, why));
        }
        let e = self.simulated_costs()?;
        let mut params = self.extended_params(&e);
        let wide = e.system.dims().p;
        if self.stage_params.is_none() && wide > 0 {
            params.chunks_mut(wide).for_each(|p| p[..r.params.len()].copy_from_slice(&r.params));
        }
        let elements = &r.trajectory.elements;
        let mut states = Vec::with_capacity(self.n_stages * nx);
        for k in 0..self.n_stages {
            let last = elements.iter().rev().find(|e| e.stage == k);
            states.extend(last.map_or_else(|| vec![f64::NAN; nx], |e| e.x1.clone()));
        }
        let usual = self.prior_sizes();
        let answer = Answer {
            usual: &usual,
            t0: self.t0,
            x0: r.jumps.first().filter(|j| j.t <= self.t0).map_or(&elements[0].x0, |j| &j.before),
            durations: &r.durations,
            controls: &r.controls,
            control_ends: &r.control_ends,
            linear: &self.linear,
            params: &params,
            states: &states,
            beside,
            cost: r.cost_reached,
            cost_size: self.cost_size(r.cost_reached),
            mayer: e.mayer.as_ref(),
            grid_cost: e.grid_cost.as_ref(),
            tol: c.tol,
            terminal: e.terminal.iter().map(|t| (&t.f, &t.lower[..], &t.upper[..])).collect(),
            path: self.path.iter().map(Rows::of).collect(),
            x_bounds: [&self.x_bounds[0], &self.x_bounds[1]],
        };
        let mut engine = Replay::new(&e.system, None, e.lagrange.as_ref(), &answer, options)?;
        let measured = accuracy::measure(&mut engine, &answer).and_then(|mut found| {
            if c.by_stage {
                let each = answer.by_stage();
                let stages =
                    each.iter().map(|a| accuracy::measure(&mut engine, a)).collect::<Result<Vec<Accuracy>>>()?;
                found.take_stages(&stages);
            }
            Ok(found)
        });
        match measured {
            Err(Error::Interrupted) => Ok(Accuracy::stopped(self.n_stages, nx, Why::Interrupted)),
            Err(Error::OutOfTime) => Ok(Accuracy::stopped(self.n_stages, nx, Why::OutOfTime)),
            r => r,
        }
    }
}
