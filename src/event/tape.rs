//! What an adjoint sweep has to know of a run: one entry for every operation that moves the sensitivities.

use super::explicit::Pair;
use super::field::{Field, MOST_STAGES};
use super::radau::Radau;
use super::step::Step;
use super::watch::Watch;
use crate::error::Result;
use crate::memory;

/// How the time of a switch depends on the state before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Time {
    /// By the derivatives on the tape.
    Moves,
    /// It is a time at which the run was stopped to change something.
    Fixed,
    /// Behind an accumulation.
    Unknown,
}

/// One operation; `at` is where its numbers begin.
#[derive(Debug, Clone, Copy)]
pub(super) enum Entry {
    /// Parameters, then controls, from here on.
    Data { at: usize },
    /// A step that ends at `end`: start, derivatives at the stages, what else is kept of the stages of a sliding mode; of its length `h` it
    /// has gone this part, or all of it and then `rest` along the velocity at the end.
    Explicit { at: usize, set: usize, t: f64, h: f64, part: f64, end: f64, rest: f64, pair: Pair },
    /// A step: start, increments and weights at the stages.
    Implicit { at: usize, set: usize, t: f64, h: f64, end: f64 },
    /// A switch, the first one in the log that belongs to it; derivatives of its time, jump of the velocity.
    Switch { at: usize, first: usize, time: Time, event: Option<usize> },
    /// Transitions at one time: derivatives of the time, velocities before and behind, Jacobians of the resets; where the
    /// logs of switches and of transitions stood.
    Jump { at: usize, first: usize, log: usize, n: usize, event: Option<usize> },
    /// Derivatives with respect to what these rows, `n` of them, do not vanish for are not known; the sizes of their terms.
    Part { at: usize, n: usize },
    /// A passage that has no derivatives.
    Gap { t: f64 },
    /// The run was asked for its state here, behind all that happens at this time.
    Stop { t: f64 },
    /// A sliding mode begins at this time and state.
    Project { at: usize, set: usize, t: f64 },
}

/// Where the time of an event comes from, for derivatives of its derivatives.
#[derive(Debug, Clone)]
pub(super) struct Event {
    /// What vanishes.
    pub(super) watch: Watch,
    /// Time, state, and the velocity before.
    pub(super) t: f64,
    pub(super) x: Vec<f64>,
    pub(super) f: Vec<f64>,
    /// Active sets before and behind.
    pub(super) before: usize,
    pub(super) after: usize,
    /// The transitions that are made, one after the other.
    pub(super) made: Vec<usize>,
    /// Does the run end there?
    pub(super) ends: bool,
}

/// Entries of one step at most, usually.
const ROOM: usize = 16;

/// Everything since the start.
#[derive(Debug, Default)]
pub(super) struct Tape {
    pub(super) start: f64,
    pub(super) entries: Vec<Entry>,
    pub(super) data: Vec<f64>,
    /// Active sets in the order of their first use after a change.
    pub(super) sets: Vec<Vec<Vec<usize>>>,
    pub(super) events: Vec<Event>,
    /// The event that comes next.
    next: Option<Event>,
}

impl Tape {
    /// Makes room for the next entries, of a field with so many states and algebraic unknowns.
    pub(super) fn room(&mut self, width: usize) -> Result<()> {
        memory::reserve(&mut self.entries, ROOM)?;
        // the longest entries are those of the explicit pair with most stages
        memory::reserve(&mut self.data, ROOM * (MOST_STAGES + 1) * width)
    }

    /// Bytes of the entries.
    pub(super) fn bytes(&self) -> usize {
        let of_event = |e: &Event| size_of::<Event>() + (e.x.len() + e.f.len()) * size_of::<f64>();
        let events = self.events.first().map_or(0, of_event) * self.events.len();
        self.entries.len() * size_of::<Entry>() + self.data.len() * size_of::<f64>() + events
    }

    pub(super) fn reset(&mut self, t: f64, field: &Field) {
        self.start = t;
        self.entries.clear();
        self.data.clear();
        self.sets.clear();
        self.events.clear();
        self.next = None;
        self.set_data(field);
    }

    /// Parameters and controls have changed.
    pub(super) fn set_data(&mut self, field: &Field) {
        let at = self.data.len();
        self.data.extend_from_slice(&field.p);
        self.data.extend_from_slice(&field.u);
        self.entries.push(Entry::Data { at });
    }

    fn set(&mut self, field: &Field) -> usize {
        if self.sets.last() != Some(&field.active) {
            self.sets.push(field.active.clone());
        }
        self.sets.len() - 1
    }

    pub(super) fn explicit(&mut self, pair: Pair, field: &mut Field, s: &Step, end: f64) {
        let (at, set) = (self.data.len(), self.set(field));
        self.data.extend_from_slice(&s.x0);
        let last = pair.rows().0.len() - 1;
        for j in 0..last + usize::from(s.part < 1.0) {
            self.data.extend(s.k.iter().map(|k| k[j]));
        }
        field.write_traces(last, &mut self.data);
        let rest = if s.part < 1.0 { 0.0 } else { end - (s.t + s.h) };
        self.entries.push(Entry::Explicit { at, set, t: s.t, h: s.h / s.part, part: s.part, end, rest, pair });
    }

    pub(super) fn implicit(&mut self, radau: &Radau, field: &Field, s: &Step, end: f64) {
        let (at, set) = (self.data.len(), self.set(field));
        self.data.extend_from_slice(&s.x0);
        for z in &radau.z {
            self.data.extend_from_slice(&z[..field.nx + field.n_alg()]);
        }
        self.entries.push(Entry::Implicit { at, set, t: s.t, h: s.h, end });
    }

    /// An event comes, at which `watch` vanishes; the velocity `f` is that before.
    pub(super) fn announce(&mut self, field: &Field, watch: Watch, t: f64, x: &[f64], f: &[f64]) {
        let before = self.set(field);
        let (x, f, made) = (x.to_vec(), f.to_vec(), Vec::new());
        self.next = Some(Event { watch, t, x, f, before, after: before, made, ends: false });
    }

    /// What is known of the next event is not enough for second derivatives.
    pub(super) fn forget_event(&mut self) {
        self.next = None;
    }

    /// The event that was announced, with what it does; its place.
    pub(super) fn take_event(&mut self, field: &Field, made: Vec<usize>, ends: bool) -> Option<usize> {
        let event = self.next.take()?;
        let after = self.set(field);
        self.events.push(Event { after, made, ends, ..event });
        Some(self.events.len() - 1)
    }

    /// `row` holds the derivatives of the time, `before` and `after` are velocities; `first` counts the log.
    pub(super) fn switch(&mut self, field: &Field, first: usize, row: &[f64], [before, after]: [&[f64]; 2]) {
        let at = self.data.len();
        self.data.extend_from_slice(row);
        self.data.extend(before.iter().zip(after).map(|(a, b)| a - b));
        let event = self.take_event(field, Vec::new(), false);
        self.entries.push(Entry::Switch { at, first, time: Time::Moves, event });
    }

    /// A switch whose time has no derivative, or the derivative zero.
    pub(super) fn mark(&mut self, first: usize, time: Time) {
        self.next = None;
        self.entries.push(Entry::Switch { at: self.data.len(), first, time, event: None });
    }

    /// `row` holds the derivatives of the time, `velocities` are those before and behind, `resets` all Jacobians.
    pub(super) fn jump(
        &mut self,
        log: (usize, usize),
        row: &[f64],
        velocities: [&[f64]; 2],
        resets: &[f64],
        event: Option<usize>,
    ) {
        let at = self.data.len();
        self.data.extend_from_slice(row);
        velocities.iter().for_each(|v| self.data.extend_from_slice(v));
        self.data.extend_from_slice(resets);
        let n = resets.len() / (velocities[0].len() * (row.len() + 1));
        self.entries.push(Entry::Jump { at, first: log.0, log: log.1, n, event });
    }

    /// The last jump goes on: behind its resets come these, and another velocity. Steps since then that are shorter than rounding are left out.
    pub(super) fn jump_again(&mut self, t: f64, after: &[f64], resets: &[f64], rounding: f64) {
        while let Some(Entry::Explicit { at, t: from, end, .. } | Entry::Implicit { at, t: from, end, .. }) =
            self.entries.last()
        {
            if end - from > rounding {
                break;
            }
            self.data.truncate(*at);
            self.entries.pop();
        }
        let Some(Entry::Jump { at, n, .. }) = self.entries.last_mut() else { return self.gap(t) };
        let nx = after.len();
        // with the times of `n` resets, `row + 2 nx + n nx (row + 1)` numbers
        let row = (self.data.len() - *at - 2 * nx - *n * nx) / (1 + *n * nx);
        self.data[*at + row + nx..*at + row + 2 * nx].copy_from_slice(after);
        self.data.extend_from_slice(resets);
        *n += resets.len() / (nx * (row + 1));
    }

    /// Behind this, derivatives with respect to what these rows do not vanish for are not known.
    pub(super) fn part(&mut self, rows: &[f64], sizes: &[f64]) {
        let at = self.data.len();
        self.data.extend_from_slice(rows);
        self.data.extend_from_slice(sizes);
        self.entries.push(Entry::Part { at, n: rows.len() });
    }

    pub(super) fn gap(&mut self, t: f64) {
        self.entries.push(Entry::Gap { t });
    }

    pub(super) fn project(&mut self, field: &Field, t: f64, x: &[f64]) {
        let (at, set) = (self.data.len(), self.set(field));
        self.data.extend_from_slice(x);
        self.entries.push(Entry::Project { at, set, t });
    }

    /// The run stops; at the end of a step the step says so.
    pub(super) fn stop(&mut self, t: f64) {
        let known = match self.entries.last() {
            Some(Entry::Explicit { end, .. } | Entry::Implicit { end, .. }) => *end == t,
            Some(Entry::Stop { t: last }) => *last == t,
            _ => false,
        };
        if !known {
            self.entries.push(Entry::Stop { t });
        }
    }

    /// The last step ends a rounding error later.
    pub(super) fn move_end(&mut self, t: f64) {
        if let Some(Entry::Explicit { end, .. } | Entry::Implicit { end, .. }) = self.entries.last_mut() {
            *end = t;
        }
    }
}
