//! The active sets of a whole horizon from a simulation with the controls that were found.
//!
//! Near its end the homotopy knows the controls well, but an active set that is read off its multipliers can have a
//! switch in the wrong element. The event-driven simulation of these controls has every switch where it belongs.

use crate::error::Result;
use crate::fesd::Trajectory;
use crate::mpcc::Side;
use crate::nlp::{Control, Outcome};
use crate::settings::Settings;
use crate::sim::Simulator;
use crate::system::System;

/// Where controls and initial value are in the variables, and what the grid looks like.
pub(super) struct Identifier {
    system: System,
    settings: Settings,
    pub params: Vec<f64>,
    pub t0: f64,
    pub duration: f64,
    pub n_fe: usize,
    pub x0_at: usize,
    pub u_at: Vec<usize>,
    simulator: Option<Simulator>,
}

impl Identifier {
    pub fn new(system: &System, settings: &Settings) -> Identifier {
        Identifier {
            system: system.clone(),
            settings: Settings { n_fe: 2, ..*settings },
            params: Vec::new(),
            t0: 0.0,
            duration: 0.0,
            n_fe: 1,
            x0_at: 0,
            u_at: Vec::new(),
            simulator: None,
        }
    }

    /// Writes the active set of every element into `sides`; false when the simulation fails or has more phases in a
    /// control stage than there are elements.
    pub fn suggest(&mut self, w: &[f64], sides: &mut [Side]) -> bool {
        self.simulate(w, sides).unwrap_or(false)
    }

    fn simulate(&mut self, w: &[f64], sides: &mut [Side]) -> Result<bool> {
        let mut sim = match self.simulator.take() {
            Some(s) => s,
            None => Simulator::new(&self.system, &self.settings)?,
        };
        let d = self.system.dims();
        sim.set_params(&self.params)?;
        sim.set_state(self.t0, &w[self.x0_at..self.x0_at + d.x])?;
        let per_stage = sides.len() / self.u_at.len();
        let mut ok = true;
        for (&u, sides) in self.u_at.iter().zip(sides.chunks_mut(per_stage)) {
            sim.set_controls(&w[u..u + d.u])?;
            let r = sim.run(self.duration, self.n_fe.max(2), &mut Control::default())?;
            ok = r.outcome == Outcome::Solved && assign(&r.trajectory, self.duration, self.n_fe, sides);
            if !ok {
                break;
            }
        }
        self.simulator = Some(sim);
        Ok(ok)
    }
}

/// Gives every phase of a stage its share of the elements, one at least.
fn assign(t: &Trajectory, duration: f64, n_fe: usize, sides: &mut [Side]) -> bool {
    let mut phases: Vec<(&[bool], f64)> = Vec::new();
    for e in t.elements.iter().filter(|e| e.h > 1e-9 * duration) {
        match phases.last_mut() {
            Some((set, h)) if *set == &e.active_cells[..] => *h += e.h,
            _ => phases.push((&e.active_cells, e.h)),
        }
    }
    if phases.is_empty() || phases.len() > n_fe {
        return false;
    }
    let n_cells = sides.len() / n_fe;
    let is = |chunk: &[Side], set: &[bool]| chunk.iter().zip(set).all(|(s, &a)| (*s == Side::First) == a);
    let mut identified: Vec<&[Side]> = sides.chunks(n_cells).collect();
    identified.dedup();
    if identified.len() == phases.len() && identified.iter().zip(&phases).all(|(c, (set, _))| is(c, set)) {
        // the order of modes is as identified: so are the numbers of elements, and the grid fits the point
        return true;
    }
    let mut counts = vec![1usize; phases.len()];
    for _ in phases.len()..n_fe {
        // the phase with the longest elements gets the next one
        let longest = |k: &usize| phases[*k].1 / counts[*k] as f64;
        let k = (0..phases.len()).max_by(|a, b| longest(a).total_cmp(&longest(b)).then(b.cmp(a))).unwrap_or(0);
        counts[k] += 1;
    }
    let sets = phases.iter().zip(&counts).flat_map(|((set, _), &n)| std::iter::repeat_n(*set, n));
    for (chunk, set) in sides.chunks_mut(n_cells).zip(sets) {
        for (s, &active) in chunk.iter_mut().zip(set) {
            *s = if active { Side::First } else { Side::Second };
        }
    }
    true
}
