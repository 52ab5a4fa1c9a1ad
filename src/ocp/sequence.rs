//! Mode sequences by simulation: controls are simulated by the event-driven engine from the states of an answer, stage by
//! stage, and the phases that follow are the start of the mode program, whose grid has room for all of them.

use super::accuracy::{Answer, Replay};
use super::moves::Sequence;
use super::request::Request;
use super::solve::Start;
use super::{Ocp, OcpResult};
use crate::dcs::Dcs;
use crate::error::Result;
use crate::fesd::Sizes;
use crate::nlp::Control;
use crate::sim::SolveOptions;

/// Share of a stage below which a phase of a simulation is left out, with controls that are a first guess and with those next
/// to an answer.
const SHORT: f64 = 0.02;
pub(super) const BRIEF: f64 = 1e-4;
/// Share of the range of a state by which the simulation may be off before it starts from the answer again.
const OFF: f64 = 0.05;
/// Tolerance of the simulation.
pub(super) const TOLERANCE: f64 = 1e-7;
/// Points of a control stage of a projected system at which its states are taken down.
pub(super) const SAMPLES: usize = 16;

/// How much of a simulation is kept.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    /// Share of a stage below which a phase is left out.
    pub short: f64,
    /// Multiples of the elements that the options ask for.
    pub elements: usize,
    /// Do the controls come from where a descent ended? The mode program is solved there but for its multipliers.
    pub lowest: bool,
}

/// With controls that are a first guess, and with those next to an answer.
pub(super) const ROUGH: Room = Room { short: SHORT, elements: 1, lowest: false };
pub(super) const NEAR: Room = Room { short: BRIEF, elements: 1, lowest: false };
/// With those at the end of a descent.
pub(super) const LOWEST: Room = Room { lowest: true, ..NEAR };

/// States and phases of a simulation.
#[derive(Debug, Clone, Default)]
pub(super) struct Traced {
    /// Times from the start of the horizon, and the states there.
    pub times: Vec<f64>,
    pub states: Vec<f64>,
    /// Phases, with regions in the place of cells.
    pub phases: Sequence,
}

impl Ocp {
    /// Simulates the controls of `r`, every stage from the state of the answer where the simulation before it led elsewhere.
    /// `None` where there is no such simulation.
    pub(super) fn trace(&self, r: &OcpResult, options: &SolveOptions) -> Result<Option<Traced>> {
        self.trace_from(r, options, OFF)
    }

    /// The same, but only from the initial state.
    pub(super) fn trace_through(&self, r: &OcpResult, options: &SolveOptions) -> Result<Option<Traced>> {
        self.trace_from(r, options, f64::INFINITY)
    }

    fn trace_from(&self, r: &OcpResult, options: &SolveOptions, off: f64) -> Result<Option<Traced>> {
        let d = self.system.dims();
        let Ok(dcs) = Dcs::stewart(&self.system) else { return Ok(None) };
        let elements = &r.trajectory.elements;
        let mut ends = Vec::new();
        for k in 0..self.n_stages {
            let Some(e) = elements.iter().rev().find(|e| e.stage == k) else { return Ok(None) };
            ends.extend_from_slice(&e.x1);
        }
        let x0 = elements[0].x0.clone();
        let params: Vec<f64> = match &self.stage_params {
            Some(p) => p.clone(),
            None => self.params_from(r).repeat(self.n_stages),
        };
        let usual = self.sizes.as_ref().map_or_else(|| self.prior_sizes(), |s| s.x.clone());
        let answer = Answer {
            usual: &usual,
            t0: self.t0,
            x0: &x0,
            durations: &r.durations,
            controls: &r.controls,
            control_ends: &r.control_ends,
            linear: &self.linear,
            params: &params,
            states: &ends,
            beside: &[],
            cost: 0.0,
            cost_size: 1.0,
            mayer: None,
            grid_cost: None,
            tol: TOLERANCE,
            terminal: Vec::new(),
            path: Vec::new(),
            x_bounds: [&[], &[]],
        };
        let mut engine = Replay::new(&self.system, None, None, &answer, options)?;
        let range: Vec<f64> = (0..d.x)
            .map(|i| {
                let values = ends.chunks_exact(d.x).map(|x| x[i]).chain([x0[i]]);
                let (lo, hi) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
                hi - lo
            })
            .collect();
        engine.trace(&answer, &|x, at| (0..d.x).any(|i| (x[i] - at[i]).abs() > off * range[i]), dcs.n_cells())
    }

    /// Phases of a simulation along the stages of `r`, without those that are too short to keep.
    pub(super) fn phases_along(&self, r: &OcpResult, (traced, room): (&Traced, Room), dcs: &Dcs) -> Sequence {
        // the multipliers of a projected system are cells of their own
        let cells = |set: &[bool]| if self.projected.is_some() { set.to_vec() } else { dcs.from_regions(set) };
        let mut stages = Vec::with_capacity(traced.phases.stages.len());
        for (k, (stage, duration)) in traced.phases.stages.iter().zip(&r.durations).enumerate() {
            let mut phases: Vec<(&[bool], f64)> = Vec::new();
            for (set, length) in stage {
                let short = room.short * duration;
                // the initial state begins in its mode, however soon that ends: no control can take it out of there before
                let begins = k == 0 && phases.len() == 1 && phases[0].1 < short;
                match phases.last_mut() {
                    Some((last, sum)) if *last == &set[..] => *sum += length,
                    Some((_, sum)) if *length < short && !begins => *sum += length,
                    Some((last, sum)) if *sum < short && !begins => (*last, *sum) = (set, *sum + length),
                    _ => phases.push((set, *length)),
                }
            }
            stages.push(phases.into_iter().map(|(set, length)| (cells(set), length)).collect());
        }
        Sequence { stages }
    }

    /// The mode program of the phases of a simulation, from its states and the controls of `r`: a copy of the
    /// problem, whose result is what became of it. The grid has room as told.
    pub(super) fn solve_traced(
        &self,
        r: &OcpResult,
        (traced, room): (&Traced, Room),
        known: &Sizes,
        request: &Request,
        control: &mut Control,
    ) -> Result<Box<Ocp>> {
        let dcs = Dcs::new(&self.system, request.options.form)?;
        let mut work = Box::new(self.blank());
        let s = self.phases_along(r, (traced, room), &dcs);
        let own = self.elements(&request.options);
        let n_fe: Vec<usize> = own.iter().zip(&s.stages).map(|(n, s)| (room.elements * n).max(s.len())).collect();
        work.set_elements(&n_fe)?;
        work.set_x_guess(&traced.times, &traced.states)?;
        work.set_u_guess(&r.controls)?;
        if r.durations.iter().all(|d| *d > 0.0) {
            work.durations.clone_from(&r.durations);
        }
        work.params = self.params_from(r);
        let along = (&traced.times[..], &traced.states[..]);
        work.sizes = Some(self.sizes_along(along, &r.controls, &r.durations, known));
        work.modes = Some(s.modes(dcs.form(), &work.durations));
        work.run(if room.lowest { Start::Lowest } else { Start::Branch }, request, control)?;
        Ok(work)
    }
}
