//! Modes of a simulation as they follow each other, and its transitions.

use crate::event::{Engine, Jump, Phase, Switch};
use crate::ocp::ModeSequence;
use crate::system::System;

/// The modes of every phase of a motion, and the transitions in the order they are made.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::ocp) struct ModeOrder {
    /// Start of every phase from the start of the horizon, and the modes that are active in it, in the order of [`System::mode_counts`].
    pub phases: Vec<(f64, Vec<bool>)>,
    pub transitions: Vec<usize>,
}

/// Where the modes of a system stand.
pub(in crate::ocp) struct Layout {
    /// Modes of every subsystem that switches, see [`System::mode_counts`].
    counts: Vec<usize>,
    /// The first subsystem that is a contact.
    contacts: usize,
}

impl Layout {
    pub fn of(system: &System) -> Layout {
        Layout { counts: system.mode_counts(), contacts: system.n_switching() }
    }
}

/// What a simulation has taken down.
struct Log<'a> {
    switches: &'a [Switch],
    contacts: &'a [Phase],
    jumps: &'a [Jump],
}

impl ModeOrder {
    /// What a user gives.
    pub fn given(m: &ModeSequence) -> ModeOrder {
        let n = m.modes.len() / m.times.len().max(1);
        let mut order =
            ModeOrder { phases: Vec::new(), transitions: m.transitions.iter().map(|t| t.transition).collect() };
        m.times.iter().enumerate().for_each(|(k, t)| order.push(*t, &m.modes[k * n..(k + 1) * n]));
        order
    }

    fn push(&mut self, t: f64, modes: &[bool]) {
        if self.phases.last().is_none_or(|p| p.1 != modes) {
            self.phases.push((t, modes.to_vec()));
        }
    }

    /// That of the last simulation of an engine, from `t0` to `end`. Events within `same` are one.
    pub fn of(engine: &Engine, layout: &Layout, span: [f64; 2], same: f64) -> ModeOrder {
        let log = Log { switches: engine.switches(), contacts: engine.phases(), jumps: engine.jumps() };
        ModeOrder::of_log(&log, layout, &|k| engine.active(k), span, same)
    }

    /// The same of what was taken down, where `last` says the active modes of every subsystem at the end.
    fn of_log(
        log: &Log,
        Layout { counts, contacts }: &Layout,
        last: &dyn Fn(usize) -> Vec<usize>,
        [t0, end]: [f64; 2],
        same: f64,
    ) -> ModeOrder {
        let firsts: Vec<usize> = counts.iter().scan(0, |sum, n| Some(std::mem::replace(sum, *sum + n))).collect();
        let n_contacts = log.contacts.first().map_or(0, |p| p.modes.len());
        let contacts = *contacts..contacts + n_contacts;
        let mut modes = vec![false; counts.iter().sum()];
        let set = |modes: &mut [bool], k: usize, active: &[usize]| {
            let Some((first, n)) = firsts.get(k).zip(counts.get(k)) else { return };
            modes[*first..first + n].fill(false);
            active.iter().filter(|m| *m < n).for_each(|m| modes[first + m] = true);
        };
        for k in (0..counts.len()).filter(|k| !contacts.contains(k)) {
            let first = log.switches.iter().find(|s| s.subsystem == k);
            set(&mut modes, k, &first.map_or_else(|| last(k), |s| s.before.clone()));
        }
        let mut order = ModeOrder { phases: Vec::new(), transitions: log.jumps.iter().map(|j| j.transition).collect() };
        let (mut switches, mut phases) = (log.switches.iter().peekable(), log.contacts.iter().peekable());
        let mut from = t0;
        loop {
            // all that happens at one time
            while switches.peek().is_some_and(|s| s.t <= from + same)
                || phases.peek().is_some_and(|p| p.t <= from + same)
            {
                if let Some(s) = switches.next_if(|s| s.t <= from + same) {
                    set(&mut modes, s.subsystem, &s.after);
                }
                if let Some(p) = phases.next_if(|p| p.t <= from + same) {
                    p.modes.iter().enumerate().for_each(|(i, m)| set(&mut modes, contacts.start + i, &[*m]));
                }
            }
            order.push(from - t0, &modes);
            let next = switches
                .peek()
                .map(|s| s.t)
                .into_iter()
                .chain(phases.peek().map(|p| p.t))
                .fold(f64::INFINITY, f64::min);
            if next >= end - same {
                return order;
            }
            from = next;
        }
    }

    /// Do modes and transitions follow each other in the same order? Modes that were not given say nothing.
    pub fn is_like(&self, given: &ModeOrder) -> bool {
        let says = given.phases.iter().any(|p| !p.1.is_empty());
        let modes = |o: &ModeOrder| o.phases.iter().map(|p| p.1.clone()).collect::<Vec<_>>();
        self.transitions == given.transitions && (!says || modes(self) == modes(given))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::Kind;
    use crate::func::{Callback, Dims};
    use crate::system::{Regions, Subsystem};
    use std::sync::Arc;

    /// A subsystem with two modes.
    fn system() -> System {
        let d = Dims { x: 1, u: 0, p: 0 };
        let f = |n: usize| Arc::new(Callback::new("f", d, n, |_, _| 0));
        let mut s = System::new(1, 0, 0).unwrap();
        let regions = Regions::Signs { psi: f(1), signs: vec![1, -1] };
        s.add_subsystem(Subsystem { rows: vec![0], modes: f(2), n_modes: 2, regions }).unwrap();
        s
    }

    fn switch(t: f64, before: usize, after: usize) -> Switch {
        Switch {
            t,
            kind: Kind::Cross,
            simultaneous: false,
            subsystem: 0,
            before: vec![before],
            after: vec![after],
            rate: 1.0,
            transversality: 1.0,
            unique: true,
            dt: Vec::new(),
        }
    }

    #[test]
    fn events_at_one_time_and_at_the_ends_are_no_phases() {
        let switches =
            [switch(1.0, 1, 0), switch(1.5, 0, 1), switch(1.5 + 1e-9, 1, 0), switch(2.0, 0, 1), switch(3.0, 1, 0)];
        let log = Log { switches: &switches, contacts: &[], jumps: &[] };
        let layout = Layout::of(&system());
        let order = ModeOrder::of_log(&log, &layout, &|_| vec![0], [1.0, 3.0], 1e-6);
        // the first one is at the start, the next two take each other back, the last one is at the end
        let modes: Vec<(f64, Vec<bool>)> = vec![(0.0, vec![true, false]), (1.0, vec![false, true])];
        assert_eq!(order.phases, modes);
        let still = ModeOrder::of_log(&Log { switches: &[], ..log }, &layout, &|_| vec![1], [1.0, 3.0], 1e-6);
        assert_eq!(still.phases, [(0.0, vec![false, true])]);
        assert!(!still.is_like(&order) && order.is_like(&ModeOrder { phases: Vec::new(), ..order.clone() }));
    }

    #[test]
    fn times_of_a_given_order_say_nothing() {
        let of = |times: &[f64], modes: &[bool]| {
            ModeOrder::given(&ModeSequence { times: times.to_vec(), modes: modes.to_vec(), ..ModeSequence::default() })
        };
        let a = of(&[0.0, 0.5], &[true, false, false, true]);
        assert!(a.is_like(&of(&[0.0, 0.1, 0.7], &[true, false, true, false, false, true])));
        assert!(!a.is_like(&of(&[0.0], &[true, false])));
    }
}
