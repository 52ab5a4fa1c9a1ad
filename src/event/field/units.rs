//! Some of the states by themselves: what depends on them, and their velocities without those of the others.

use super::bundled::MANY_STATES;
use super::Field;

/// Lists of numbers, one for each of some things.
#[derive(Debug, Default)]
pub(in crate::event) struct Lists {
    /// Where they begin; one place more than there are lists.
    begin: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    /// Of `n` things; `pairs` of a thing and what belongs to it.
    fn new(n: usize, mut pairs: Vec<(u32, u32)>) -> Lists {
        pairs.sort_unstable();
        pairs.dedup();
        let begin = (0..=n as u32).map(|i| pairs.partition_point(|p| p.0 < i) as u32).collect();
        Lists { begin, items: pairs.into_iter().map(|p| p.1).collect() }
    }

    /// That of thing `i`, ascending.
    pub(in crate::event) fn of(&self, i: usize) -> &[u32] {
        &self.items[self.begin[i] as usize..self.begin[i + 1] as usize]
    }
}

/// What a watched function belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::event) enum Owner {
    /// The guard of a transition; its gradient is constant.
    Guard(usize),
    /// The only switching function, with a constant gradient, of a subsystem of two modes.
    Surface(usize),
    /// Anything else.
    Other,
}

/// What depends on what, as sparse as the model is.
#[derive(Debug, Default)]
pub(in crate::event) struct Depends {
    /// Of every state the other states that its velocity depends on.
    pub(in crate::event) reads: Lists,
    /// Of every state the others whose velocities depend on it.
    pub(in crate::event) readers: Lists,
    /// Of every state the places of the watched functions that depend on it.
    pub(in crate::event) watching: Lists,
    /// Of every state the transitions that ask for its value.
    pub(in crate::event) asking: Lists,
    /// Of every state the subsystems that drive it.
    pub(in crate::event) driven: Lists,
    /// Of every transition the states that its reset depends on.
    pub(in crate::event) of_reset: Lists,
    /// Of every place of a watched function what it belongs to.
    pub(in crate::event) owner: Vec<Owner>,
}

/// The parts of the model that move some states.
#[derive(Debug, Default)]
pub(in crate::event) struct Moving {
    /// Parts, and where their values go.
    parts: Vec<(u32, u32)>,
    /// Values, and the states they are added to, by their places among those that are moved.
    adds: Vec<(u32, u32)>,
    values: Vec<f64>,
}

impl Field {
    /// What depends on what; none for few states, where the functions cannot be taken apart, or where so much is common to them that every
    /// point costs as much as a part of all states.
    pub(in crate::event) fn depends(&self) -> Option<Depends> {
        /// Part of the states.
        const COMMON: usize = 4;
        let b = self.bundle.as_ref().filter(|b| b.has_transitions())?;
        let few = self.nx < MANY_STATES;
        if few || self.contacts.is_some() || self.demand.is_some() || COMMON * b.common_operations() > self.nx {
            return None;
        }
        let nx = self.nx;
        let number = |i: usize| i as u32;
        let reads =
            || (0..nx).flat_map(|i| self.fixed.inputs(i).filter(move |c| *c < nx && *c != i).map(move |c| (i, c)));
        let n_q = self.subs.last().map_or(0, |s| s.q0 + s.n_q) + self.guards.n_outputs();
        let watched =
            (0..n_q).flat_map(|q| self.gradients.entries(q).1.iter().filter(|c| **c < nx).map(move |c| (*c, q)));
        let asked = |(g, t): (usize, &super::super::guard::Guard)| -> Vec<(u32, u32)> {
            t.transition.from.iter().map(|f| (number(f.0), number(g))).collect()
        };
        let driven = |(k, s): (usize, &super::Sub)| -> Vec<(u32, u32)> {
            s.rows.iter().map(|r| (number(*r), number(k))).collect()
        };
        let reset = |(g, t): (usize, &super::super::guard::Guard)| -> Vec<(u32, u32)> {
            let Some(r) = &t.transition.reset else { return Vec::new() };
            let p = r.f.jac_pattern();
            p.columns().map(|c| c.0).filter(|c| *c < nx).map(|c| (number(g), number(c))).collect()
        };
        let mut owner = vec![Owner::Other; n_q];
        for (k, s) in self.subs.iter().enumerate() {
            let two = s.signs && s.n_q == 1 && s.affine && s.cells.len() == 2 && s.cells[0].mode != s.cells[1].mode;
            if two && s.cells.iter().all(|c| c.weights[0] != 0.0) {
                owner[s.q0] = Owner::Surface(k);
            }
        }
        let plain = |g: &(usize, &super::super::guard::Guard)| g.1.affine && g.1.transition.is_plain();
        self.guards.all.iter().enumerate().filter(plain).for_each(|(i, g)| owner[g.q] = Owner::Guard(i));
        let pairs = |all: &mut dyn Iterator<Item = (usize, usize)>| all.map(|(a, b)| (number(a), number(b))).collect();
        Some(Depends {
            reads: Lists::new(nx, pairs(&mut reads())),
            readers: Lists::new(nx, pairs(&mut reads().map(|(i, c)| (c, i)))),
            watching: Lists::new(nx, pairs(&mut { watched })),
            asking: Lists::new(nx, self.guards.all.iter().enumerate().flat_map(asked).collect()),
            driven: Lists::new(nx, self.subs.iter().enumerate().flat_map(driven).collect()),
            of_reset: Lists::new(self.guards.all.len(), self.guards.all.iter().enumerate().flat_map(reset).collect()),
            owner,
        })
    }

    /// The states that subsystem `k` drives.
    pub(in crate::event) fn driven_by(&self, k: usize) -> &[usize] {
        &self.subs[k].rows
    }

    /// Of a subsystem of two cells with one switching function: the sign of that in cell `cell`, and the other cell.
    pub(in crate::event) fn sides(&self, k: usize, cell: usize) -> (f64, usize) {
        let s = &self.subs[k];
        let own = cell - s.first;
        (-s.cells[own].weights[0], s.first + 1 - own)
    }

    /// Marks the states that sliding subsystems drive, and those that their surfaces depend on.
    pub(in crate::event) fn mark_tied(&self, tied: &mut [bool]) {
        tied.fill(false);
        for (_, s) in self.subs.iter().enumerate().filter(|(k, _)| self.active[*k].len() > 1) {
            s.rows.iter().for_each(|i| tied[*i] = true);
            let surfaces = (s.q0..s.q0 + s.n_q).flat_map(|j| self.gradients.entries(j).1);
            surfaces.filter(|i| **i < self.nx).for_each(|i| tied[*i] = true);
        }
    }

    /// All inputs of the functions that are evaluated by parts: those at this point.
    pub(in crate::event) fn move_parts_to(&mut self, t: f64, x: &[f64]) {
        if let Some(b) = &mut self.bundle {
            b.move_to(&crate::func::Point { t, x, u: &self.u, p: &self.p });
        }
    }

    /// Another value of one state.
    #[inline]
    pub(in crate::event) fn set_state_of_parts(&mut self, i: usize, value: f64) {
        if let Some(b) = &mut self.bundle {
            b.set_input(i, value);
        }
    }

    /// Another time.
    #[inline]
    pub(in crate::event) fn set_time_of_parts(&mut self, t: f64) {
        let time = self.n_z - 1;
        self.set_state_of_parts(time, t);
    }

    /// Lists the parts that move these states, whose places among them `place` says, under the cells `cells` of the subsystems.
    pub(in crate::event) fn list_moving(
        &self,
        states: &[u32],
        (depends, cells): (&Depends, &[usize]),
        place: impl Fn(usize) -> Option<usize>,
        to: &mut Moving,
    ) {
        let Moving { parts, adds, values } = to;
        parts.clear();
        adds.clear();
        let Some(b) = &self.bundle else { return };
        let mut at = 0;
        for (k, &i) in states.iter().enumerate() {
            for &part in b.singles_of(i as usize) {
                parts.push((part as u32, at));
                adds.push((at, k as u32));
                at += 1;
            }
        }
        for &i in states {
            for &k in depends.driven.of(i as usize) {
                let s = &self.subs[k as usize];
                // once, for the first of its rows
                if s.rows.iter().find(|r| place(**r).is_some()) != Some(&(i as usize)) {
                    continue;
                }
                let mode = s.cells[cells[k as usize] - s.first].mode;
                parts.push((b.mode_of(k as usize, mode) as u32, at));
                let own = s.rows.iter().enumerate().filter_map(|(n, r)| Some((at + n as u32, place(*r)? as u32)));
                adds.extend(own);
                at += s.rows.len() as u32;
            }
        }
        values.resize(at as usize, 0.0);
    }

    /// Velocities of the states whose parts are listed; false where they are not defined.
    pub(in crate::event) fn move_by_parts(&mut self, moving: &mut Moving, out: &mut [f64]) -> bool {
        let Some(b) = &mut self.bundle else { return false };
        let mut finite = true;
        let Moving { parts, adds, values } = moving;
        for (i, &(part, at)) in parts.iter().enumerate() {
            let end = parts.get(i + 1).map_or(values.len(), |p| p.1 as usize);
            finite &= b.evaluate_part(part as usize, &mut values[at as usize..end]);
        }
        out.fill(0.0);
        adds.iter().for_each(|&(v, k)| out[k as usize] += values[v as usize]);
        finite
    }

    /// What the reset of transition `g` makes of the states it names; false where that is not defined.
    pub(in crate::event) fn reset_by_parts(&mut self, g: usize, out: &mut Vec<f64>) -> bool {
        out.clear();
        let Some(r) = &self.guards.all[g].transition.reset else { return true };
        out.resize(r.rows.len(), 0.0);
        let Some(b) = &mut self.bundle else { return false };
        b.evaluate_reset(g, out)
    }
}
