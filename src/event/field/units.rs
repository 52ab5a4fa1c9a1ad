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

/// The cell of a subsystem that slides.
pub(in crate::event) const SLIDES: usize = usize::MAX;

/// What a source of switches belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::event) enum Owner {
    /// The guard of a transition, of one output.
    Guard(usize),
    /// The only switching function of a subsystem of two modes.
    Surface(usize),
    /// The weight of a cell of such a subsystem.
    Weight(usize),
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
    /// Of every subsystem the states that its switching functions depend on, and those that it drives.
    pub(in crate::event) columns: Lists,
    pub(in crate::event) drives: Lists,
    /// Of every source what it belongs to: places of watched functions, then cells.
    pub(in crate::event) owner: Vec<Owner>,
    /// Number of places.
    pub(in crate::event) places: usize,
    /// Of every place whether the gradient is not constant. On such a surface nothing slides by itself.
    pub(in crate::event) bent: Vec<bool>,
}

impl Depends {
    /// Of the surfaces that depend on state `i` those that slide under the cells `cells`.
    fn sliding_on<'a>(&'a self, i: usize, cells: &'a [usize]) -> impl Iterator<Item = usize> + 'a {
        self.watching.of(i).iter().filter_map(move |q| match self.owner[*q as usize] {
            Owner::Surface(k) if cells[k] == SLIDES => Some(k),
            _ => None,
        })
    }

    /// The states that the velocity of state `i` depends on beside itself: where a subsystem slides that drives it, the rates of all states
    /// that its surface depends on do.
    pub(in crate::event) fn each_read(&self, i: usize, cells: &[usize], mut f: impl FnMut(u32)) {
        self.reads.of(i).iter().for_each(|j| f(*j));
        for &k in self.driven.of(i).iter().filter(|k| cells[**k as usize] == SLIDES) {
            self.each_read_of_weight(k as usize, &mut f);
        }
    }

    /// The states that the weight of subsystem `k` depends on, which slides.
    pub(in crate::event) fn each_read_of_weight(&self, k: usize, mut f: impl FnMut(u32)) {
        for &c in self.columns.of(k) {
            f(c);
            self.reads.of(c as usize).iter().for_each(|j| f(*j));
        }
    }

    /// The other states whose velocities depend on state `i`, but for those that their surface holds still.
    pub(in crate::event) fn each_reader(&self, i: usize, cells: &[usize], mut f: impl FnMut(u32)) {
        let held =
            |j: u32| self.driven.of(j as usize).iter().any(|k| cells[*k as usize] == SLIDES && self.holds(*k as usize));
        self.readers.of(i).iter().filter(|j| !held(**j)).for_each(|j| f(*j));
        self.each_weight(i, cells, |k| {
            if !self.holds(k) {
                self.drives.of(k).iter().filter(|j| **j as usize != i).for_each(|j| f(*j));
            }
        });
    }

    /// The subsystems that slide whose weights depend on state `i` or its velocity; some more than once.
    pub(in crate::event) fn each_weight(&self, i: usize, cells: &[usize], mut f: impl FnMut(usize)) {
        self.sliding_on(i, cells).for_each(&mut f);
        self.readers.of(i).iter().for_each(|j| self.sliding_on(*j as usize, cells).for_each(&mut f));
    }

    /// Does the surface of subsystem `k` hold the only state still that it drives?
    fn holds(&self, k: usize) -> bool {
        matches!((self.columns.of(k), self.drives.of(k)), ([c], [r]) if c == r)
    }

    /// May subsystem `k` slide by itself, whose first function has the place `q`?
    pub(in crate::event) fn may_slide(&self, k: usize, q: usize) -> bool {
        self.owner[q] == Owner::Surface(k) && !self.bent[q]
    }

    /// The source of the weight of a cell.
    pub(in crate::event) fn weight(&self, cell: usize) -> usize {
        self.places + cell
    }
}

/// A sliding mode of one subsystem: `α = −(Σ c v + c_t) / Σ c d`, with `c` the gradient of its surface, `v` the velocity under its first cell
/// and `v + d` that under the second. What belongs to it ends here in the lists.
#[derive(Debug, Clone, Copy)]
struct Slide {
    rates: usize,
    across: usize,
    moved: usize,
    by_time: f64,
}

/// The parts of the model that move some states.
#[derive(Debug, Default)]
pub(in crate::event) struct Moving {
    /// Parts, and where their values go.
    parts: Vec<(u32, u32)>,
    /// Values, and the states they are added to, by their places among those that are moved.
    adds: Vec<(u32, u32)>,
    /// Of every one of these states the values of its drifts: the first, and the one behind the last.
    own: Vec<(u32, u32)>,
    slides: Vec<Slide>,
    /// What its surface makes of a value; of the difference of two; the state that this difference moves.
    rates: Vec<(f64, u32)>,
    across: Vec<(f64, u32, u32)>,
    moved: Vec<(u32, u32, u32)>,
    /// The weights of the second cells at the last point, and how the surfaces change from one cell to the other.
    pub(in crate::event) weights: Vec<(f64, f64)>,
    /// There is something among them that is no part by itself.
    mixed: bool,
    values: Vec<f64>,
}

impl Moving {
    fn clear(&mut self) {
        let Moving { parts, adds, own, slides, rates, across, moved, weights, mixed, values } = self;
        parts.clear();
        adds.clear();
        own.clear();
        slides.clear();
        rates.clear();
        across.clear();
        moved.clear();
        weights.clear();
        values.clear();
        *mixed = false;
    }

    /// Lists a part of `n` values; says where they go.
    fn push(&mut self, part: usize, n: usize) -> u32 {
        let at = self.values.len();
        self.parts.push((part as u32, at as u32));
        self.values.resize(at + n, 0.0);
        at as u32
    }
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
        let reads = || {
            (0..nx).flat_map(|i| self.linear.fixed.inputs(i).filter(move |c| *c < nx && *c != i).map(move |c| (i, c)))
        };
        let n_q = self.subs.last().map_or(0, |s| s.q0 + s.n_q) + self.guards.n_outputs();
        let watched =
            (0..n_q).flat_map(|q| self.gradients.entries(q).1.iter().filter(|c| **c < nx).map(move |c| (*c, q)));
        let asked = |(g, t): (usize, &super::super::guard::Guard)| -> Vec<(u32, u32)> {
            // no step ends for notes
            let from = if t.n > 0 { &t.transition.from[..] } else { &[] };
            from.iter().map(|f| (number(f.0), number(g))).collect()
        };
        let driven = |(k, s): (usize, &super::Sub)| -> Vec<(u32, u32)> {
            s.rows.iter().map(|r| (number(*r), number(k))).collect()
        };
        let reset = |(g, t): (usize, &super::super::guard::Guard)| -> Vec<(u32, u32)> {
            let Some(r) = &t.transition.reset else { return Vec::new() };
            let p = r.f.jac_pattern();
            p.columns().map(|c| c.0).filter(|c| *c < nx).map(|c| (number(g), number(c))).collect()
        };
        let columns = |(k, s): (usize, &super::Sub)| -> Vec<(u32, u32)> {
            let all = (s.q0..s.q0 + s.n_q).flat_map(|q| self.gradients.entries(q).1);
            all.filter(|c| **c < nx).map(|c| (number(k), number(*c))).collect()
        };
        let mut bent = vec![false; n_q];
        let mut owner = vec![Owner::Other; n_q + self.n_cells];
        for (k, s) in self.subs.iter().enumerate() {
            let two = s.signs && s.n_q == 1 && s.cells.len() == 2 && s.cells[0].mode != s.cells[1].mode;
            if two && s.cells.iter().all(|c| c.weights[0] != 0.0) {
                owner[s.q0] = Owner::Surface(k);
                owner[n_q + s.first..n_q + s.first + 2].fill(Owner::Weight(k));
                bent[s.q0] = !s.affine;
            }
        }
        for (i, g) in self.guards.all.iter().enumerate().filter(|(_, g)| g.transition.is_plain()) {
            (owner[g.q], bent[g.q]) = (Owner::Guard(i), !g.affine);
        }
        let pairs = |all: &mut dyn Iterator<Item = (usize, usize)>| all.map(|(a, b)| (number(a), number(b))).collect();
        Some(Depends {
            reads: Lists::new(nx, pairs(&mut reads())),
            readers: Lists::new(nx, pairs(&mut reads().map(|(i, c)| (c, i)))),
            watching: Lists::new(nx, pairs(&mut { watched })),
            asking: Lists::new(nx, self.guards.all.iter().enumerate().flat_map(asked).collect()),
            driven: Lists::new(nx, self.subs.iter().enumerate().flat_map(driven).collect()),
            of_reset: Lists::new(self.guards.all.len(), self.guards.all.iter().enumerate().flat_map(reset).collect()),
            columns: Lists::new(self.subs.len(), self.subs.iter().enumerate().flat_map(columns).collect()),
            drives: Lists::new(
                self.subs.len(),
                self.subs.iter().enumerate().flat_map(driven).map(|(i, k)| (k, i)).collect(),
            ),
            owner,
            places: n_q,
            bent,
        })
    }

    /// Of a subsystem of two cells with one switching function: the sign of that in cell `cell`, and the other cell.
    pub(in crate::event) fn sides(&self, k: usize, cell: usize) -> (f64, usize) {
        let s = &self.subs[k];
        let own = cell - s.first;
        (-s.cells[own].weights[0], s.first + 1 - own)
    }

    /// The first of the two cells of subsystem `k`.
    pub(in crate::event) fn first_cell(&self, k: usize) -> usize {
        self.subs[k].first
    }

    /// Do the weights of subsystem `k` depend on those of another one that slides, or the other way round?
    pub(in crate::event) fn slides_with_others(&self, k: usize, cells: &[usize]) -> bool {
        let mut beside = self.sliding.depends(k).iter().copied().chain(self.sliding.dependencies(k));
        beside.any(|o| o != k && cells[o] == SLIDES)
    }

    /// Marks what sliding subsystems drive, and what their surfaces depend on, where they are not of the kind that is followed by itself.
    pub(in crate::event) fn mark_tied(&self, depends: &Depends, cells: &[usize], tied: &mut [bool]) {
        tied.fill(false);
        for (k, s) in self.subs.iter().enumerate().filter(|(k, _)| cells[*k] == SLIDES) {
            if depends.may_slide(k, s.q0) && !self.slides_with_others(k, cells) {
                continue;
            }
            depends.drives.of(k).iter().chain(depends.columns.of(k)).for_each(|i| tied[*i as usize] = true);
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

    /// Value of the function that belongs to `owner`, at the point where the states are that it depends on; NaN where it is not finite.
    pub(in crate::event) fn watched_by_parts(&mut self, owner: Owner) -> f64 {
        let Some(b) = &mut self.bundle else { return f64::NAN };
        match owner {
            Owner::Guard(g) => b.evaluate_guard(g),
            Owner::Surface(k) => b.evaluate_indicator(k),
            _ => f64::NAN,
        }
    }

    /// Are the gradients known that are constant, of single units?
    pub(in crate::event) fn knows_straight(&self) -> bool {
        self.valid.straight
    }

    /// They are, until parameters or controls change.
    pub(in crate::event) fn note_straight(&mut self, known: bool) {
        self.valid.straight = known;
    }

    /// Writes the gradient of this function at a point of which those states are known.
    pub(in crate::event) fn gradient_by_parts(&mut self, owner: Owner, t: f64, x: &[f64], out: &mut [f64]) -> bool {
        let at = crate::func::Point { t, x, u: &self.u, p: &self.p };
        let room = (&mut self.buffer[..], &mut self.work[..]);
        match owner {
            Owner::Guard(g) => self.guards.all[g].gradient(&at, out, room).is_ok(),
            Owner::Surface(k) => {
                let s = &self.subs[k];
                super::scatter(&s.indicators, &at, &s.to_dq, out, room).is_ok()
            }
            _ => false,
        }
    }

    /// Lists the parts that move these states, whose places among them `place` says, under the cells `cells` of the subsystems.
    pub(in crate::event) fn list_moving(
        &self,
        states: &[u32],
        (depends, cells): (&Depends, &[usize]),
        place: impl Fn(usize) -> Option<usize>,
        to: &mut Moving,
    ) {
        to.clear();
        let Some(b) = &self.bundle else { return };
        for (k, &i) in states.iter().enumerate() {
            let from = to.values.len() as u32;
            for &part in b.singles_of(i as usize) {
                let at = to.push(part, 1);
                to.adds.push((at, k as u32));
            }
            to.own.push((from, to.values.len() as u32));
        }
        for &i in states {
            for &k in depends.driven.of(i as usize) {
                let s = &self.subs[k as usize];
                // once, for the first of its rows
                if s.rows.iter().find(|r| place(**r).is_some()) != Some(&(i as usize)) {
                    continue;
                }
                if cells[k as usize] == SLIDES {
                    self.list_slide(k as usize, (depends, cells), &place, to);
                    continue;
                }
                let mode = s.cells[cells[k as usize] - s.first].mode;
                let at = to.push(b.mode_of(k as usize, mode), s.rows.len());
                let own = s.rows.iter().enumerate().filter_map(|(n, r)| Some((at + n as u32, place(*r)? as u32)));
                to.adds.extend(own);
            }
        }
    }

    /// Lists what the weight of subsystem `k` follows from, which slides.
    pub(in crate::event) fn list_weight(&self, k: usize, on: (&Depends, &[usize]), to: &mut Moving) {
        to.clear();
        self.list_slide(k, on, &|_| None, to);
    }

    fn list_slide(
        &self,
        k: usize,
        (depends, cells): (&Depends, &[usize]),
        place: &impl Fn(usize) -> Option<usize>,
        to: &mut Moving,
    ) {
        let s = &self.subs[k];
        let Some(b) = &self.bundle else { return };
        if !depends.may_slide(k, s.q0) {
            to.mixed = true;
            return;
        }
        let [first, second] = [0, 1].map(|c| to.push(b.mode_of(k, s.cells[c].mode), s.rows.len()));
        for (n, p) in s.rows.iter().enumerate().filter_map(|(n, r)| Some((n as u32, place(*r)? as u32))) {
            to.adds.push((first + n, p));
            to.moved.push((p, second + n, first + n));
        }
        let g = self.gradient_row(s.q0);
        for (c, g) in g.states() {
            match place(c).and_then(|p| to.own.get(p)) {
                Some(&(from, end)) => to.rates.extend((from..end).map(|v| (g, v))),
                None => {
                    for &part in b.singles_of(c) {
                        let at = to.push(part, 1);
                        to.rates.push((g, at));
                    }
                }
            }
            for o in depends.driven.of(c).iter().map(|o| *o as usize).filter(|o| *o != k) {
                let other = &self.subs[o];
                if cells[o] == SLIDES {
                    to.mixed = true;
                    return;
                }
                let at = to.push(b.mode_of(o, other.cells[cells[o] - other.first].mode), other.rows.len());
                let own = other.rows.iter().zip(at..).filter(|(r, _)| **r == c);
                to.rates.extend(own.map(|(_, v)| (g, v)));
            }
            for (n, _) in s.rows.iter().enumerate().filter(|(_, r)| **r == c) {
                to.rates.push((g, first + n as u32));
                to.across.push((g, second + n as u32, first + n as u32));
            }
        }
        let (rates, across, moved) = (to.rates.len(), to.across.len(), to.moved.len());
        to.slides.push(Slide { rates, across, moved, by_time: g.t });
    }

    /// Velocities of the states whose parts are listed; false where they are not defined.
    pub(in crate::event) fn move_by_parts(&mut self, moving: &mut Moving, out: &mut [f64]) -> bool {
        let Some(b) = self.bundle.as_mut().filter(|_| !moving.mixed) else { return false };
        let mut finite = true;
        let Moving { parts, adds, slides, rates, across, moved, weights, values, .. } = moving;
        for (i, &(part, at)) in parts.iter().enumerate() {
            let end = parts.get(i + 1).map_or(values.len(), |p| p.1 as usize);
            finite &= b.evaluate_part(part as usize, &mut values[at as usize..end]);
        }
        out.fill(0.0);
        adds.iter().for_each(|&(v, k)| out[k as usize] += values[v as usize]);
        weights.clear();
        let value = |v: u32| values[v as usize];
        let mut from = Slide { rates: 0, across: 0, moved: 0, by_time: 0.0 };
        for s in slides {
            let rate = rates[from.rates..s.rates].iter().fold(s.by_time, |r, &(g, v)| r + g * value(v));
            let by = across[from.across..s.across].iter().map(|&(g, b, a)| g * (value(b) - value(a))).sum::<f64>();
            let alpha = -rate / by;
            finite &= alpha.is_finite();
            weights.push((alpha, by));
            for &(k, b, a) in &moved[from.moved..s.moved] {
                out[k as usize] += alpha * (value(b) - value(a));
            }
            from = *s;
        }
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
