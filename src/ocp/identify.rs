//! Active sets of a whole horizon for the branch problem, where those read off the multipliers have no solution.
//!
//! Near its end the homotopy knows the controls well, but an active set that is read off its multipliers can have a
//! switch in the wrong element. It likes to end a sliding mode at the end of a control stage, where the conditions at
//! stage points leave it room; so such switches are moved to either side first. The simulation of the controls found
//! has every switch where it belongs, and comes last because it costs more.

use super::neighbours::Grid;
use crate::error::Result;
use crate::fesd::Trajectory;
use crate::mpcc::{ActiveSetProposer, ProposalKind, Side};
use crate::nlp::{Control, Outcome};
use crate::sim::{Simulator, SolveOptions};
use crate::system::System;

/// Where controls and initial value are in the variables, and what the grid looks like.
pub(super) struct Identifier {
    system: System,
    options: SolveOptions,
    /// Parameters of every stage.
    pub params: Vec<f64>,
    pub n_p: usize,
    pub t0: f64,
    /// Lengths of the stages; they may be variables where they are not fixed.
    pub durations: Vec<f64>,
    pub fixed: bool,
    pub grid: Grid,
    /// Some control is linear: its stages cannot be simulated with a constant one.
    pub linear: bool,
    pub x0_at: usize,
    pub u_at: Vec<usize>,
    /// Lengths of the elements, where they are variables.
    pub h_at: Vec<Option<usize>>,
    /// Elements have sets at all.
    pub detects: bool,
    /// Decisions about what switches; those of path complementarities are behind them.
    pub n_sides: usize,
    improves: bool,
    /// Neighbouring sequences that may still be tried.
    pub budget: usize,
    simulator: Option<Simulator>,
    /// Way to try next.
    next: usize,
    /// Sequences that may be better than the last solution, and how many of them need no budget.
    proposals: std::vec::IntoIter<Vec<Side>>,
    free: usize,
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

impl ActiveSetProposer for Identifier {
    fn propose(&mut self, kind: ProposalKind, w: &[f64], sides: &mut [Side]) -> bool {
        if !self.detects {
            return false;
        }
        // behind those of the cells are sides that no mode sequence knows of
        let n = self.grid.n_cells() * self.h_at.len();
        let sides = if (1..sides.len()).contains(&n) { &mut sides[..n] } else { sides };
        let sides = &mut sides[..self.n_sides];
        match kind {
            ProposalKind::Repair(k) => self.repair(k, w, sides),
            ProposalKind::Rescue(k) => self.rescue(k, sides),
            ProposalKind::Improve(k) => self.improves && self.improve(k, sides),
            ProposalKind::Collapse => self.collapse(w, sides),
            _ => false,
        }
    }
}

impl Identifier {
    pub fn new(system: &System, options: &SolveOptions) -> Identifier {
        Identifier {
            system: system.clone(),
            options: SolveOptions { n_fe: 2, ..*options },
            params: Vec::new(),
            n_p: 0,
            t0: 0.0,
            durations: Vec::new(),
            fixed: true,
            grid: Grid::default(),
            linear: false,
            x0_at: 0,
            u_at: Vec::new(),
            h_at: Vec::new(),
            detects: true,
            n_sides: 0,
            improves: true,
            budget: 0,
            simulator: None,
            next: 0,
            proposals: Vec::new().into_iter(),
            free: 0,
            tried: Vec::new(),
        }
    }

    /// Simulates with these options from now on.
    pub fn set_options(&mut self, options: &SolveOptions) {
        let options = SolveOptions { n_fe: 2, ..*options };
        if self.options != options {
            self.simulator = None;
        }
        self.options = options;
    }

    /// Forgets what was tried; `budget` neighbours may be tried from now on.
    /// Without `improves` solutions stay as they are.
    pub fn restart(&mut self, improves: bool, budget: usize) {
        self.improves = improves;
        self.budget = budget;
        self.tried.clear();
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

    /// The next neighbour of sides that have no solution.
    fn rescue(&mut self, k: usize, sides: &mut [Side]) -> bool {
        if k == 0 {
            let mut proposals = Vec::new();
            if self.grid.fits(sides) {
                proposals = self.grid.off_boundaries(sides);
                proposals.extend(self.grid.neighbours(sides));
            }
            self.proposals = proposals.into_iter();
            self.tried.push(sides.to_vec());
        }
        let Some(s) = self.proposals.find(|s| !self.tried.contains(s)) else { return false };
        sides.copy_from_slice(&s);
        self.tried.push(s);
        true
    }

    /// The next sequence that was not tried yet: switches off the boundaries of the control stages, then other
    /// neighbours as long as the budget lasts.
    fn improve(&mut self, k: usize, sides: &mut [Side]) -> bool {
        if k == 0 {
            let mut proposals = if self.grid.fits(sides) { self.grid.off_boundaries(sides) } else { Vec::new() };
            self.free = proposals.len();
            if self.budget > 0 && self.grid.fits(sides) {
                proposals.extend(self.grid.neighbours(sides));
            }
            self.proposals = proposals.into_iter();
            self.tried.push(sides.to_vec());
        }
        for s in self.proposals.by_ref() {
            let free = self.free > 0;
            self.free = self.free.saturating_sub(1);
            if self.tried.contains(&s) {
                continue;
            }
            if !free {
                if self.budget == 0 {
                    return false;
                }
                self.budget -= 1;
            }
            sides.copy_from_slice(&s);
            self.tried.push(s);
            return true;
        }
        false
    }

    /// Elements without length take the sets of the one behind them in their stage, or of that before.
    fn collapse(&self, w: &[f64], sides: &mut [Side]) -> bool {
        let n = sides.len() / self.h_at.len();
        let before = sides.to_vec();
        let mut first = 0;
        for (&n_fe, duration) in self.grid.n_fe.iter().zip(&self.durations) {
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

    /// Moves what switches at a boundary between control stages into the last element before, or the first after.
    fn move_switch(&self, boundary: usize, way: Way, sides: &mut [Side]) -> bool {
        let n = sides.len() / self.h_at.len();
        let next = self.grid.n_fe[..boundary].iter().sum::<usize>() * n;
        let switching = self.grid.switches(boundary, sides);
        let (before, after) = (next - n, next);
        let (from, to) = if way == Way::Before { (after, before) } else { (before, after) };
        for c in &switching {
            sides.copy_within(from + c.start..from + c.end, to + c.start);
        }
        !switching.is_empty()
    }

    fn simulate(&mut self, w: &[f64], sides: &mut [Side]) -> Result<bool> {
        let mut sim = match self.simulator.take() {
            Some(s) => s,
            None => Simulator::with_options(&self.system, &self.options)?,
        };
        let d = self.system.dims();
        sim.set_state(self.t0, &w[self.x0_at..self.x0_at + d.x])?;
        let n_cells = sides.len() / self.h_at.len();
        let mut ok = true;
        let mut rest = sides;
        for (k, &u) in self.u_at.iter().enumerate() {
            let (n_fe, duration) = (self.grid.n_fe[k], self.durations[k]);
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

/// Elements of phases of these lengths, `n` in all, one at least for every phase: those with the longest get more.
pub(super) fn shares(lengths: &[f64], n: usize) -> Vec<usize> {
    let mut counts = vec![1usize; lengths.len()];
    for _ in lengths.len()..n {
        let longest = |k: &usize| lengths[*k] / counts[*k] as f64;
        let k = (0..lengths.len()).max_by(|a, b| longest(a).total_cmp(&longest(b)).then(b.cmp(a))).unwrap_or(0);
        counts[k] += 1;
    }
    counts
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
    let lengths: Vec<f64> = phases.iter().map(|p| p.1).collect();
    let counts = shares(&lengths, n_fe);
    let sets = phases.iter().zip(&counts).flat_map(|((set, _), &n)| std::iter::repeat_n(*set, n));
    for (chunk, set) in sides.chunks_mut(n_cells).zip(sets) {
        for (s, &active) in chunk.iter_mut().zip(set) {
            *s = if active { Side::First } else { Side::Second };
        }
    }
    true
}
