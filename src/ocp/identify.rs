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
    pub params: Vec<f64>,
    pub t0: f64,
    pub duration: f64,
    pub n_fe: usize,
    pub x0_at: usize,
    pub u_at: Vec<usize>,
    /// Lengths of the elements, where they are variables.
    pub h_at: Vec<Option<usize>>,
    /// Cells of every subsystem.
    pub cells: Vec<usize>,
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
            t0: 0.0,
            duration: 0.0,
            n_fe: 1,
            x0_at: 0,
            u_at: Vec::new(),
            h_at: Vec::new(),
            cells: Vec::new(),
            budget: 0,
            simulator: None,
            next: 0,
            moves: Vec::new(),
            next_move: 0,
            tried: Vec::new(),
        }
    }

    /// Forgets what was tried; `budget` neighbours may be tried from now on.
    pub fn restart(&mut self, budget: usize) {
        self.budget = budget;
        self.tried.clear();
    }

    /// The next proposal, see [`crate::mpcc::Suggest`].
    pub fn suggest(&mut self, wanted: Wanted, w: &[f64], sides: &mut [Side]) -> bool {
        match wanted {
            Wanted::Repair(k) => self.repair(k, w, sides),
            Wanted::Improve(k) => self.improve(k, sides),
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
                Way::Simulate => self.simulate(w, sides).unwrap_or(false),
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
            self.moves = if self.budget > 0 { neighbours(&self.cells, sides) } else { Vec::new() };
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
        let n: usize = self.cells.iter().sum();
        let short = 1e-3 * self.duration / self.n_fe as f64;
        let has_length = |e: usize| self.h_at[e].is_none_or(|h| w[h] > short);
        let before = sides.to_vec();
        for e in (0..self.h_at.len()).filter(|&e| !has_length(e)) {
            let stage = e / self.n_fe * self.n_fe..(e / self.n_fe + 1) * self.n_fe;
            let from =
                (e + 1..stage.end).find(|&k| has_length(k)).or_else(|| (stage.start..e).rev().find(|&k| has_length(k)));
            if let Some(from) = from {
                sides[e * n..(e + 1) * n].copy_from_slice(&before[from * n..(from + 1) * n]);
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
        let n_cells = sides.len() / (self.u_at.len() * self.n_fe);
        let next = boundary * self.n_fe * n_cells;
        (next - n_cells, next, n_cells)
    }

    fn is_switch(&self, boundary: usize, sides: &[Side]) -> bool {
        let (last, next, n) = self.around(boundary, sides);
        self.n_fe > 1 && sides[last..next] != sides[next..next + n]
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
