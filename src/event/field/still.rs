//! What the surfaces of a sliding mode hold still: a surface whose gradient is constant and depends on one state alone says how fast
//! that state goes, `g v + g_t = 0`, whatever the weights are. Nothing that its velocity could depend on matters for it, and where a
//! block moves no other states its weights have no derivatives that anybody asks for: friction between blocks and thermostats are
//! such surfaces.

use super::Field;

/// What does not have to be differentiated under the present active set.
#[derive(Debug, Default)]
pub(super) struct Still {
    pub(super) known: bool,
    /// States whose velocity is constant.
    pub(super) states: Vec<bool>,
    /// Blocks that move no others.
    pub(super) blocks: Vec<bool>,
    /// Subsystems whose modes nothing else depends on.
    pub(super) unasked: Vec<bool>,
    /// The state of every pair whose surface depends on one alone; else `usize::MAX`.
    tied: Vec<usize>,
    asked: Vec<bool>,
}

impl Still {
    /// Makes room for as many states, pairs and subsystems.
    pub(super) fn reserve(&mut self, nx: usize, pairs: usize, subsystems: usize) {
        self.states.reserve(nx);
        self.asked.reserve(nx);
        self.blocks.reserve(pairs);
        self.tied.reserve(pairs);
        self.unasked.reserve(subsystems);
    }
}

impl Field {
    pub(super) fn find_still(&mut self) {
        if self.still.known {
            return;
        }
        let mut to = std::mem::take(&mut self.still);
        to.known = true;
        to.states.clear();
        to.states.resize(self.nx, false);
        to.tied.clear();
        let constant = self.valid.constant && self.limit.is_none() && !self.is_selected() && self.contacts.is_none();
        for i in 0..self.pairs.len() {
            let tied = self.only_state_of(i).filter(|_| constant);
            tied.iter().for_each(|a| to.states[*a] = true);
            to.tied.push(tied.unwrap_or(usize::MAX));
        }
        // what something depends on that is not still
        to.asked.clear();
        to.asked.extend(to.states.iter().map(|still| !still));
        to.blocks.clear();
        for b in 0..if self.pairs.is_empty() { 0 } else { self.sliding.n_blocks() } {
            let pairs = self.sliding.pairs_of(b);
            let moved = |i: &usize| self.sliding.column(self.pairs[*i], *i).any(|(a, _)| !to.states[a]);
            let still = !pairs.iter().any(moved);
            to.blocks.push(still);
            for &i in pairs.iter().filter(|_| !still) {
                self.sliding.row_of_states(self.pairs[i], i).for_each(|(a, _)| to.asked[a] = true);
            }
        }
        to.unasked.clear();
        to.unasked.extend(self.subs.iter().map(|s| !s.rows.iter().any(|a| to.asked[*a])));
        self.still = to;
    }

    /// The state that constraint `i` depends on, if it is one alone.
    fn only_state_of(&self, i: usize) -> Option<usize> {
        let p = self.pairs[i];
        let s = &self.subs[p.sub];
        let (w, w0) = (&s.cells[p.cell - s.first].weights, &s.cells[p.base - s.first].weights);
        let rows = (0..s.n_q).filter(|j| w[*j] != w0[*j]);
        let mut states = rows.flat_map(|j| self.gradients.entries(s.q0 + j).1).copied().filter(|c| *c < self.nx);
        let first = states.next()?;
        states.all(|a| a == first).then_some(first)
    }

    /// Does a derivative depend on the weights of the present sliding mode, or on how they change?
    pub(in crate::event) fn asks_for_weights(&mut self) -> bool {
        self.find_still();
        self.still.blocks.contains(&false)
    }

    /// The state that constraint `i` ties alone.
    pub(in crate::event) fn tied_state(&mut self, i: usize) -> Option<usize> {
        self.find_still();
        Some(self.still.tied[i]).filter(|a| *a < self.nx)
    }
}
