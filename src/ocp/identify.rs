//! Active sets of a whole horizon for the branch problem, where those read off the multipliers have no solution.
//!
//! Near its end the homotopy knows the controls well, but an active set that is read off its multipliers can have a
//! switch in the wrong element. It likes to end a sliding mode at the end of a control stage, where the conditions at
//! stage points leave it room; so such switches are moved to either side first. The simulation of the controls found
//! has every switch where it belongs, and comes last because it costs more.

use super::neighbours::{neighbours, Move};
use crate::error::Result;
use crate::fesd::Trajectory;
use crate::mpcc::{Side, Wanted};
use crate::nlp::{Control, Outcome};
use crate::settings::Settings;
use crate::sim::Simulator;
use crate::system::System;

/// Where controls and initial value are in the variables, and what the grid looks like.
pub(super) struct Identifier {
    system: System,
    settings: Settings,
    /// Parameters of every stage.
    pub params: Vec<f64>,
    pub n_p: usize,
    pub t0: f64,
    /// Lengths of the stages; they may be variables where they are not fixed.
    pub durations: Vec<f64>,
    pub fixed: bool,
    /// Elements of every stage.
    pub n_fe: Vec<usize>,
    /// Some control is linear: its stages cannot be simulated with a constant one.
    pub linear: bool,
    pub x0_at: usize,
    pub u_at: Vec<usize>,
    /// Lengths of the elements, where they are variables.
    pub h_at: Vec<Option<usize>>,
    /// Cells of every subsystem.
    pub cells: Vec<usize>,
    improves: bool,
    /// Neighbouring sequences that may still be tried.
    pub budget: usize,
    simulator: Option<Simulator>,
    /// Way to try next.
    next: usize,
    moves: Vec<Move>,
    next_move: usize,
    /// Sequences proposed since the last [`Identifier::restart`].
    tried: Vec<Vec<Side>>,
}

/// Share of its usual length below which an element counts as vanished.
const SHORT: f64 = 1e-3;

/// Where proposals come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Way {
    Before,
    After,
    Simulate,
}

impl Identifier {
    pub fn new(system: &System, settings: &Settings) -> Identifier {
        Identifier {
            system: system.clone(),
            settings: Settings { n_fe: 2, ..*settings },
            params: Vec::new(),
            n_p: 0,
            t0: 0.0,
            durations: Vec::new(),
            fixed: true,
            n_fe: Vec::new(),
            linear: false,
            x0_at: 0,
            u_at: Vec::new(),
            h_at: Vec::new(),
            cells: Vec::new(),
            improves: true,
            budget: 0,
            simulator: None,
            next: 0,
            moves: Vec::new(),
            next_move: 0,
            tried: Vec::new(),
        }
    }

    /// Forgets what was tried; `budget` neighbours may be tried from now on.
    /// Without `improves` solutions stay as they are.
    pub fn restart(&mut self, improves: bool, budget: usize) {
        self.improves = improves;
        self.budget = budget;
        self.tried.clear();
    }

    /// The next proposal, see [`crate::mpcc::Suggest`].
    pub fn suggest(&mut self, wanted: Wanted, w: &[f64], sides: &mut [Side]) -> bool {
        match wanted {
            Wanted::Repair(k) => self.repair(k, w, sides),
            Wanted::Improve(k) => self.improves && self.improve(k, sides),
            Wanted::Collapse => self.collapse(w, sides),
        }
    }

    fn repair(&mut self, k: usize, w: &[f64], sides: &mut [Side]) -> bool {
        let ways = [Way::Before, Way::After, Way::Simulate];
        if k == 0 {
            self.next = 0;
        }
        while self.next < ways.len() {
            self.next += 1;
            let found = match ways[self.next - 1] {
                // lengths and parameters that are variables are not known here
                Way::Simulate => self.fixed && !self.linear && self.simulate(w, sides).unwrap_or(false),
                way => (1..self.u_at.len()).filter(|&k| self.move_switch(k, way, sides)).count() > 0,
            };
            if found {
                return true;
            }
        }
        false
    }

    /// A switch that lies exactly between two control stages may want to be inside one of them, where the branch
    /// problem at hand cannot bring it.
    fn improve(&mut self, k: usize, sides: &mut [Side]) -> bool {
        if k == 0 {
            // other forms have other sides than cells
            let by_cells = self.cells.iter().sum::<usize>() * self.h_at.len() == sides.len();
            self.moves = if self.budget > 0 && by_cells { neighbours(&self.cells, sides) } else { Vec::new() };
            self.next_move = 0;
            self.tried.push(sides.to_vec());
        }
        let mut left = k;
        for boundary in 1..self.u_at.len() {
            for way in [Way::Before, Way::After] {
                if self.is_switch(boundary, sides) {
                    if left == 0 {
                        return self.move_switch(boundary, way, sides);
                    }
                    left -= 1;
                }
            }
        }
        self.next_neighbour(sides)
    }

    /// Elements without length take the sets of the one behind them in their stage, or of that before.
    fn collapse(&self, w: &[f64], sides: &mut [Side]) -> bool {
        let n = sides.len() / self.h_at.len();
        let before = sides.to_vec();
        let mut first = 0;
        for (&n_fe, duration) in self.n_fe.iter().zip(&self.durations) {
            let stage = first..first + n_fe;
            first += n_fe;
            let short = SHORT * duration / n_fe as f64;
            let has_length = |e: &usize| self.h_at[*e].is_none_or(|h| w[h] > short);
            for e in stage.clone().filter(|e| !has_length(e)) {
                let from = (e + 1..stage.end).find(has_length).or_else(|| (stage.start..e).rev().find(has_length));
                if let Some(from) = from {
                    sides[e * n..(e + 1) * n].copy_from_slice(&before[from * n..(from + 1) * n]);
                }
            }
        }
        before != sides
    }

    /// The next neighbour that was not tried yet, as long as the budget lasts.
    fn next_neighbour(&mut self, sides: &mut [Side]) -> bool {
        let n_cells = self.cells.iter().sum();
        while self.budget > 0 && self.next_move < self.moves.len() {
            let mut s = sides.to_vec();
            self.moves[self.next_move].apply(n_cells, &mut s);
            self.next_move += 1;
            if !self.tried.contains(&s) {
                self.budget -= 1;
                sides.copy_from_slice(&s);
                self.tried.push(s);
                return true;
            }
        }
        false
    }

    /// First sides of the last element before a boundary between control stages, and of the first after it.
    fn around(&self, boundary: usize, sides: &[Side]) -> (usize, usize, usize) {
        let n_cells = sides.len() / self.h_at.len();
        let next = self.n_fe[..boundary].iter().sum::<usize>() * n_cells;
        (next - n_cells, next, n_cells)
    }

    fn is_switch(&self, boundary: usize, sides: &[Side]) -> bool {
        let (last, next, n) = self.around(boundary, sides);
        self.n_fe[boundary - 1].min(self.n_fe[boundary]) > 1 && sides[last..next] != sides[next..next + n]
    }

    /// Moves what switches at a boundary between control stages into the last element before, or the first after.
    fn move_switch(&self, boundary: usize, way: Way, sides: &mut [Side]) -> bool {
        let (last, next, n) = self.around(boundary, sides);
        let switches = self.is_switch(boundary, sides);
        if switches && way == Way::Before {
            sides.copy_within(next..next + n, last);
        } else if switches {
            sides.copy_within(last..next, next);
        }
        switches
    }

    fn simulate(&mut self, w: &[f64], sides: &mut [Side]) -> Result<bool> {
        let mut sim = match self.simulator.take() {
            Some(s) => s,
            None => Simulator::new(&self.system, &self.settings)?,
        };
        let d = self.system.dims();
        sim.set_state(self.t0, &w[self.x0_at..self.x0_at + d.x])?;
        let n_cells = sides.len() / self.h_at.len();
        let mut ok = true;
        let mut rest = sides;
        for (k, &u) in self.u_at.iter().enumerate() {
            let (n_fe, duration) = (self.n_fe[k], self.durations[k]);
            let (sides, others) = rest.split_at_mut(n_fe * n_cells);
            rest = others;
            sim.set_params(&self.params[k * self.n_p..(k + 1) * self.n_p])?;
            sim.set_controls(&w[u..u + d.u])?;
            let r = sim.run(duration, n_fe.max(2), &mut Control::default())?;
            ok = r.outcome == Outcome::Solved && assign(&r.trajectory, duration, n_fe, sides);
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
