//! Accelerations and contact forces at a point, under given modes.

use std::sync::Arc;

use super::inertia::Mass;
use super::least_norm::LeastNorm;
use super::mode;
use super::problem::{Problem, Room};
use super::sensitivity::Linearised;
use crate::func::{EvalError, EvalResult, Function, Point};
use crate::system::{Contact, Inertia, Kind, Mechanics, Order};

/// Where the motion is looked at: time, state, controls, parameters.
pub(crate) type At<'a> = Point<'a>;

/// Normal force and tangential forces of a contact.
pub(crate) type Forces = [f64; 3];

/// What is known of one contact at the last point it was loaded for.
#[derive(Debug, Clone, Default)]
pub(crate) struct Block {
    /// Gap and its rate.
    pub(crate) gap: [f64; 2],
    /// `g̈ − nᵀ v̇`.
    pub(super) rest: f64,
    pub(crate) friction: f64,
    /// The coefficient of friction for sticking.
    pub(crate) stiction: f64,
    pub(crate) restitution: f64,
    pub(crate) normal: Vec<f64>,
    /// Sliding velocity.
    pub(crate) sliding: [f64; 2],
    /// `ṡ − Bᵀ v̇`.
    pub(super) sliding_rest: [f64; 2],
    pub(super) tangents: Vec<f64>,
    /// Of a switch: what it pushes along, zero where its weight is given, and the gradient of its switching function with respect to
    /// states and time. Empty for others.
    push: Vec<f64>,
    gradient: Vec<f64>,
}

impl Block {
    pub(crate) fn tangent(&self, k: usize) -> &[f64] {
        let n_v = self.normal.len();
        &self.tangents[k * n_v..(k + 1) * n_v]
    }

    /// Number of tangents.
    pub(crate) fn n_tangents(&self) -> usize {
        self.tangents.len() / self.normal.len()
    }

    /// Do tangents depend on each other or on the normal? The determinant of their cosines tells.
    pub(crate) fn has_dependent_rows(&self) -> bool {
        /// Angles of a millionth are none.
        const LEAST: f64 = 1e-12;
        let n_v = self.normal.len();
        let n_t = self.tangents.len() / n_v;
        let size = |v: &[f64]| dot(v, v).sqrt();
        let rows: Vec<&[f64]> = (0..=n_t).map(|k| self.row(k)).filter(|r| size(r) > 0.0).collect();
        let cosine = |a: &[f64], b: &[f64]| dot(a, b) / (size(a) * size(b));
        let determinant = match rows[..] {
            [a, b] => 1.0 - cosine(a, b).powi(2),
            [a, b, c] => {
                let (x, y, z) = (cosine(a, b), cosine(a, c), cosine(b, c));
                1.0 + 2.0 * x * y * z - x * x - y * y - z * z
            }
            _ => 1.0,
        };
        determinant < LEAST
    }

    /// The row of component `k`: 0 is the normal.
    pub(super) fn row(&self, k: usize) -> &[f64] {
        if k == 0 {
            &self.normal
        } else {
            self.tangent(k - 1)
        }
    }

    /// The column along which the force of component `k` pushes: its row, but for switches.
    pub(super) fn column(&self, k: usize) -> &[f64] {
        if k == 1 && !self.push.is_empty() {
            &self.push
        } else {
            self.row(k)
        }
    }

    /// What a sliding velocity, or a switching function, consists of before anything cancels, at a state whose entries count as no less than
    /// `floor`; coordinates are the first `n_q` of them.
    pub(crate) fn sliding_size(&self, n_q: usize, (t, x): (f64, &[f64]), floor: &[f64]) -> f64 {
        if let Some((of_time, of_states)) = self.gradient.split_last() {
            let terms = of_states.iter().zip(x.iter().zip(floor)).map(|(g, (x, f))| g.abs() * (x.abs() + f));
            return (terms.sum::<f64>() + (of_time * t).abs()).max(self.sliding[0].abs());
        }
        let row = |k: usize| {
            let states = x[n_q..].iter().zip(&floor[n_q..]);
            self.tangent(k).iter().zip(states).map(|(g, (v, f))| g.abs() * (v.abs() + f)).sum::<f64>()
        };
        (0..self.n_tangents()).map(row).fold(0.0, f64::max)
    }

    /// Second derivative of component `k` without accelerations.
    pub(super) fn rest_of(&self, k: usize) -> f64 {
        if k == 0 {
            self.rest
        } else {
            self.sliding_rest[k - 1]
        }
    }
}

/// A closed contact and the component of it that is held: 0 the gap, then tangents.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Row {
    pub(super) contact: usize,
    pub(super) component: usize,
}

/// What is remembered of slides in space.
pub(crate) struct Slides {
    directions: Vec<[f64; 2]>,
    settled: Vec<[f64; 2]>,
    starting: Vec<(usize, [f64; 2])>,
    begins: Vec<f64>,
    fastest: Vec<f64>,
    unseen: Vec<f64>,
    reference: Vec<Forces>,
}

/// Evaluates motion with contacts. All memory is allocated once, but for singular sets of contacts.
pub(crate) struct Dynamics {
    pub(crate) mechanics: Arc<Mechanics>,
    /// A constant inertia is positive definite.
    definite: bool,
    /// When a varying inertia was not positive definite last.
    refused: f64,
    /// Its smallest pivot at the start.
    first_pivot: f64,
    pub(super) mass: Mass,
    pub(super) blocks: Vec<Block>,
    /// `N v`, `f_v`, and the rates of the states beside coordinates and velocities.
    pub(super) smooth: Vec<f64>,
    /// Accelerations without contact forces, and with them.
    pub(super) free: Vec<f64>,
    pub(crate) acceleration: Vec<f64>,
    /// Forces of all contacts; those of open ones are zero.
    pub(crate) forces: Vec<Forces>,
    /// What is held under the modes of the last evaluation.
    pub(super) rows: Vec<Row>,
    /// `M⁻¹` times the force directions of the rows, one after the other.
    pub(super) y: Vec<f64>,
    pub(super) held: LeastNorm,
    /// Contacts without a normal: dry friction at joints, switches.
    joints: Vec<usize>,
    /// Weights of the switches: signs, or 0 where they are found with the forces.
    pub(super) weights: Vec<f64>,
    /// Contacts of which nothing but the sliding velocity changes: flat, with tangents that are straight.
    flat: Vec<bool>,
    /// Modes whose rows and matrix are those that are kept, where nothing of them changes; empty: none.
    kept: Vec<usize>,
    pub(super) lambda: Vec<f64>,
    /// Directions of sliding where the sliding velocity is zero, of contacts in space that begin to slide.
    pub(crate) directions: Vec<[f64; 2]>,
    /// Those of the contacts that begin to slide at the point of the last accelerations, see [`super::breakaway`].
    pub(super) settled: Vec<[f64; 2]>,
    /// Those of the choice of modes that was begun last, contact by contact, until somebody notes them.
    pub(crate) starting: Vec<(usize, [f64; 2])>,
    /// Sliding velocity that tolerances do not see, of contacts in space that have begun to slide: while no more of it goes across
    /// they go where they accelerate to, see [`super::breakaway`]. Zero for others.
    pub(crate) begins: Vec<f64>,
    /// Largest sliding velocity of a contact in space since it began to slide.
    pub(crate) fastest: Vec<f64>,
    /// Sliding velocity of a contact in space that tolerances do not see, where its slide began, see [`Dynamics::stop`].
    pub(crate) unseen: Vec<f64>,
    pub(super) buffer: Vec<f64>,
    pub(super) work: Vec<f64>,
    pub(super) extended: Vec<f64>,
    pub(super) problem: Problem,
    pub(super) room: Room,
    pub(super) linearised: Linearised,
    /// Forces that the present modes began with: where forces are not unique, they stay as near to these as they can.
    pub(super) reference: Vec<Forces>,
    /// The direction of derivatives, where only one is looked for.
    pub(super) along: Option<Arc<[f64]>>,
    /// Contacts that would slide and are held back by others that stick, see [`Dynamics::find_carried`].
    pub(crate) carried: Vec<bool>,
    pub(crate) evaluations: usize,
}

/// A contact in space sticks when its sliding velocity has fallen to this share of the largest it had since it began to
/// slide: what is left of the way to the stop goes along the tangent, with an error of the square of it.
const STOP: f64 = 1e-8;

/// Share of the largest velocity above which none counts as zero, however little the tolerances see.
const MOST: f64 = 0.1;

impl Dynamics {
    /// Do the tangents of two contacts in space, which are loaded, have a velocity in common?
    pub(crate) fn slide_together(&self, i: usize, j: usize) -> bool {
        let moves = |k: usize, l: usize| self.tangent(k, 0)[l] != 0.0 || self.tangent(k, 1)[l] != 0.0;
        (0..self.mechanics.n_v).any(|l| moves(i, l) && moves(j, l))
    }

    /// The sliding velocity at which contact `i` in space stops: a share of the largest, or what the tolerances do not see, for the error of a
    /// step is as large as that. Below it the direction would be one of errors, and steps as short as the way to the stop.
    pub(crate) fn stop(&self, i: usize) -> f64 {
        (STOP * self.fastest[i]).max(self.unseen[i].min(MOST * self.fastest[i]))
    }

    pub(crate) fn new(mechanics: &Arc<Mechanics>) -> Dynamics {
        let m = mechanics.as_ref();
        let n_v = m.n_v;
        let most: usize = m.contacts.iter().map(|c| 1 + c.n_tangents).sum();
        let block = |c: &Contact| {
            let (push, gradient) = if c.kind == Kind::Switch { (n_v, m.n_states() + 1) } else { (0, 0) };
            Block {
                normal: vec![0.0; n_v],
                tangents: vec![0.0; c.n_tangents * n_v],
                push: vec![0.0; push],
                gradient: vec![0.0; gradient],
                ..Block::default()
            }
        };
        let (mut buffer, mut work) = (n_v, 0);
        let mut note = |f: &dyn Function| {
            buffer = buffer.max(f.n_out()).max(f.jac_pattern().nnz());
            work = work.max(f.work_len());
        };
        note(m.smooth.as_ref());
        if let Inertia::Varying { matrix, product } = &m.inertia {
            note(matrix.as_ref());
            note(product.as_ref());
        }
        for c in &m.contacts {
            note(c.gap.as_ref());
            note(c.motion.as_ref());
            note(c.reaction.as_ref());
        }
        let (mass, definite) = Mass::new(m);
        // as many contacts as are closed at once share a matrix, usually a few
        let some = most.min(64);
        Dynamics {
            mechanics: mechanics.clone(),
            definite,
            refused: f64::NEG_INFINITY,
            first_pivot: 0.0,
            mass,
            blocks: m.contacts.iter().map(block).collect(),
            smooth: vec![0.0; m.n_states()],
            free: vec![0.0; n_v],
            acceleration: vec![0.0; n_v],
            forces: vec![[0.0; 3]; m.contacts.len()],
            rows: Vec::with_capacity(some),
            y: Vec::with_capacity(some * n_v),
            held: LeastNorm::with_capacity(some),
            joints: (0..m.contacts.len()).filter(|i| m.contacts[*i].kind.has_no_normal()).collect(),
            weights: vec![0.0; m.n_switches],
            flat: m.contacts.iter().map(|c| is_flat(c, n_v)).collect(),
            kept: Vec::with_capacity(m.contacts.len()),
            lambda: Vec::with_capacity(some),
            directions: vec![[0.0; 2]; m.contacts.len()],
            settled: vec![[0.0; 2]; m.contacts.len()],
            starting: Vec::new(),
            begins: vec![0.0; m.contacts.len()],
            fastest: vec![0.0; m.contacts.len()],
            unseen: vec![0.0; m.contacts.len()],
            buffer: vec![0.0; buffer],
            work: vec![0.0; work],
            extended: Vec::new(),
            problem: Problem::default(),
            room: Room::with_capacity(some),
            linearised: Linearised::default(),
            reference: vec![[0.0; 3]; m.contacts.len()],
            along: None,
            carried: vec![false; m.contacts.len()],
            evaluations: 0,
        }
    }

    /// Do contacts act on the states themselves?
    pub(crate) fn is_first_order(&self) -> bool {
        self.mechanics.order == Order::First
    }

    /// Are there contacts without a normal?
    pub(crate) fn has_joints(&self) -> bool {
        !self.joints.is_empty()
    }

    /// Has contact `i` no normal?
    pub(crate) fn is_joint(&self, i: usize) -> bool {
        self.mechanics.contacts[i].kind.has_no_normal()
    }

    /// Is contact `i` a switch?
    pub(crate) fn is_switch(&self, i: usize) -> bool {
        self.mechanics.contacts[i].kind == Kind::Switch
    }

    /// The first of the switches, which are the last contacts.
    pub(super) fn first_switch(&self) -> usize {
        self.n_contacts() - self.weights.len()
    }

    /// Number of contact `i` among the switches, if it is one.
    pub(super) fn switch(&self, i: usize) -> Option<usize> {
        i.checked_sub(self.first_switch())
    }

    /// Gives the switches the weights of these modes.
    pub(super) fn weigh(&mut self, modes: &[Vec<usize>]) {
        let first = self.first_switch();
        for (w, set) in self.weights.iter_mut().zip(&modes[first..]) {
            *w = match set[0] {
                mode::SLIDES => 1.0,
                mode::SLIDES_BACK => -1.0,
                _ => 0.0,
            };
        }
    }

    /// The parameters of functions that depend on the weights of switches; those of the system where there are none.
    pub(super) fn weighted<'a>(weights: &[f64], room: &'a mut Vec<f64>, at: &At<'a>) -> At<'a> {
        if weights.is_empty() {
            return *at;
        }
        room.clear();
        room.extend_from_slice(at.p);
        room.extend_from_slice(weights);
        Point { p: room, ..*at }
    }

    /// Can contact `i` open?
    pub(crate) fn opens(&self, i: usize) -> bool {
        self.mechanics.contacts[i].kind.opens()
    }

    /// The mode of contact `i` where nothing else is known of it.
    pub(crate) fn first_mode(&self, i: usize) -> usize {
        if self.opens(i) {
            mode::OPEN
        } else {
            mode::CLOSED
        }
    }

    /// Forces of contact `i` as results have them: a joint has no normal force, and of a switch it is its weight, which has the sign of its
    /// switching function.
    pub(crate) fn of_results(&self, i: usize, f: Forces) -> Forces {
        if self.is_switch(i) {
            [0.0, -f[1], 0.0]
        } else if self.is_joint(i) {
            [0.0, f[1], f[2]]
        } else {
            f
        }
    }

    /// The first component of contact `i` that has equations.
    pub(super) fn lead(&self, i: usize) -> usize {
        usize::from(self.is_joint(i))
    }

    /// Number of contacts.
    pub(crate) fn n_contacts(&self) -> usize {
        self.blocks.len()
    }

    /// Gap and its rate, and all else of contact `i`, at the last point it was loaded for.
    pub(crate) fn block(&self, i: usize) -> &Block {
        &self.blocks[i]
    }

    /// `N v`, `f_v`, and the acceleration without contact forces.
    pub(super) fn load(&mut self, at: &At) -> EvalResult {
        self.evaluations += 1;
        if !self.definite {
            return Err(EvalError::Recoverable);
        }
        let m = &self.mechanics;
        let there = Dynamics::weighted(&self.weights, &mut self.extended, at);
        m.smooth.value(&there, &mut self.smooth, &mut self.work)?;
        if let Err(e) = self.mass.load(m, at, &mut self.work) {
            self.refused = at.t;
            return Err(e);
        }
        self.free.copy_from_slice(&self.smooth[m.velocities()]);
        self.mass.solve(&mut self.free);
        Ok(())
    }

    /// Is the inertia matrix positive definite at a point, where a run begins?
    pub(crate) fn is_definite(&mut self, at: &At) -> bool {
        let fine = self.definite && self.mass.load(&self.mechanics, at, &mut self.work).is_ok();
        (self.refused, self.first_pivot) = (f64::NEG_INFINITY, self.mass.smallest_pivot());
        fine
    }

    /// Is the inertia matrix at a point hardly positive definite, compared with the start, or was it not within a time
    /// around it?
    pub(crate) fn is_nearly_singular(&mut self, at: &At, time: f64) -> bool {
        /// Share of a pivot that is left of it.
        const LEFT: f64 = 1e-6;
        if self.mass.is_constant() {
            return false;
        }
        let known = self.mass.load(&self.mechanics, at, &mut self.work).is_ok();
        !known || self.mass.smallest_pivot() < LEFT * self.first_pivot || (self.refused - at.t).abs() <= time
    }

    /// Entries of a varying inertia matrix that should be one and differ.
    pub(crate) fn asymmetry(&mut self, at: &At) -> Option<(usize, usize)> {
        let n = self.mechanics.n_v;
        let Inertia::Varying { matrix, .. } = &self.mechanics.inertia else { return None };
        let m = &mut self.buffer[..n * n];
        matrix.value(at, m, &mut self.work).ok()?;
        let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
        let differ = |&(i, j): &(usize, usize)| {
            let (a, b) = (m[i * n + j], m[j * n + i]);
            // the same entry written twice, in another order of its terms
            (a - b).abs() > 1e3 * f64::EPSILON * (m[i * n + i] * m[j * n + j]).abs().sqrt()
        };
        pairs.into_iter().find(|p| differ(p))
    }

    /// Gap of contact `i` and its rate.
    pub(crate) fn load_gap(&mut self, at: &At, i: usize) -> EvalResult {
        self.mechanics.contacts[i].gap.value(at, &mut self.blocks[i].gap, &mut self.work)
    }

    /// Everything of contact `i` but its gap.
    pub(crate) fn load_contact(&mut self, at: &At, i: usize) -> EvalResult {
        let weight = self.switch(i).map(|k| self.weights[k]);
        let (c, b, n_v) = (&self.mechanics.contacts[i], &mut self.blocks[i], self.mechanics.n_v);
        let out = &mut self.buffer[..c.motion.n_out()];
        if let Some(weight) = weight {
            let there = Dynamics::weighted(&self.weights, &mut self.extended, at);
            c.motion.value(&there, out, &mut self.work)?;
            let behind = &out[Contact::motion_len(n_v, 1)..];
            b.push.copy_from_slice(&behind[..n_v]);
            b.gradient.copy_from_slice(&behind[n_v..]);
            if weight != 0.0 {
                // it is one of the parameters of the smooth forces
                b.push.fill(0.0);
            }
        } else {
            c.motion.value(at, out, &mut self.work)?;
        }
        (b.rest, b.friction, b.restitution) = (out[0], out[1], out[2]);
        b.normal.copy_from_slice(&out[3..3 + n_v]);
        for (k, own) in out[3 + n_v..].chunks_exact(2 + n_v).take(c.n_tangents).enumerate() {
            (b.sliding[k], b.sliding_rest[k]) = (own[0], own[1]);
            b.tangents[k * n_v..(k + 1) * n_v].copy_from_slice(&own[2..]);
        }
        b.stiction = out[c.stiction_at(n_v)];
        Ok(())
    }

    /// Unit vector of the sliding velocity of contact `i` under a sliding mode.
    #[inline]
    pub(crate) fn direction(&self, i: usize, m: usize) -> [f64; 2] {
        if self.mechanics.contacts[i].n_tangents == 1 {
            return [if m == mode::SLIDES_BACK { -1.0 } else { 1.0 }, 0.0];
        }
        // a contact that has begun to slide has no velocity yet: it goes where it will go
        if self.has_no_direction(i) {
            return if self.begins[i] > 0.0 { self.settled[i] } else { self.directions[i] };
        }
        let s = self.blocks[i].sliding;
        let size = s[0].hypot(s[1]);
        [s[0] / size, s[1] / size]
    }

    /// A contact in space that slides remembers where to and how fast, at the end of a step.
    pub(crate) fn keep_direction(&mut self, i: usize, m: usize) {
        if self.mechanics.contacts[i].n_tangents == 2 && !self.carried[i] {
            self.directions[i] = self.direction(i, m);
            let s = self.blocks[i].sliding;
            self.fastest[i] = self.fastest[i].max(s[0].hypot(s[1]));
            if self.begins[i] > 0.0 && self.has_begun(i) {
                self.begins[i] = 0.0;
            }
        }
    }

    /// What is remembered of slides in space, to be put back.
    pub(crate) fn keep_slides(&self) -> Slides {
        Slides {
            directions: self.directions.clone(),
            settled: self.settled.clone(),
            starting: self.starting.clone(),
            begins: self.begins.clone(),
            fastest: self.fastest.clone(),
            unseen: self.unseen.clone(),
            reference: self.reference.clone(),
        }
    }

    /// Undoes what has been remembered since.
    pub(crate) fn put_back_slides(&mut self, s: Slides) {
        let Slides { directions, settled, starting, begins, fastest, unseen, reference } = s;
        (self.directions, self.settled, self.starting) = (directions, settled, starting);
        (self.begins, self.fastest, self.unseen, self.reference) = (begins, fastest, unseen, reference);
    }

    /// Is contact `i` sliding under this mode?
    pub(crate) fn slides(m: usize) -> bool {
        m == mode::SLIDES || m == mode::SLIDES_BACK
    }

    /// Finds the contacts that are at the limit of their friction and do not slide, as others that stick hold the bodies: two
    /// legs of a table share a push at will, and while one of them sticks none slides. What such a contact does is decided by
    /// forces; its sliding velocity, which is zero, says nothing. The modes are those of the last accelerations, and `size` is
    /// what the sliding velocity of a contact is compared with.
    pub(crate) fn find_carried(&mut self, modes: &[Vec<usize>], size: &dyn Fn(&Block) -> f64) {
        /// Share of its size that a velocity, or its rate, is zero below.
        const STILL: f64 = 1e-6;
        self.carried.fill(false);
        for i in (0..modes.len()).filter(|i| Dynamics::slides(modes[*i][0])) {
            let (b, n_t) = (&self.blocks[i], self.mechanics.contacts[i].n_tangents);
            let others = self.rows.iter().any(|r| r.contact != i);
            if n_t == 0 || !others || b.sliding[0].hypot(b.sliding[1]) > STILL * size(b) {
                continue;
            }
            let still = |k: usize| {
                let (t, rest) = (b.tangent(k), b.sliding_rest[k]);
                // compared with what it would be without contacts: where all is at rest, accelerations are rounding
                let size = |a: &[f64]| t.iter().zip(a).map(|(t, a)| (t * a).abs()).sum::<f64>();
                let terms = size(&self.free).max(size(&self.acceleration)) + rest.abs();
                (dot(t, &self.acceleration) + rest).abs() <= STILL * terms
            };
            if (0..n_t).all(still) && self.is_held_by(i, &self.rows) {
                self.carried[i] = true;
            }
        }
    }

    /// Do the tangents of contact `i` depend on these rows? All blocks are loaded.
    fn is_held_by(&self, i: usize, rows: &[Row]) -> bool {
        /// Angles of a millionth are none.
        const LEAST: f64 = 1e-12;
        let (b, m) = (&self.blocks[i], rows.len());
        let shifts: Vec<Vec<f64>> = rows
            .iter()
            .map(|r| {
                let mut y = self.blocks[r.contact].row(r.component).to_vec();
                self.mass.solve(&mut y);
                y
            })
            .collect();
        let mut solver = LeastNorm::with_capacity(m);
        let a = solver.clear(m);
        for (k, r) in rows.iter().enumerate() {
            let g = self.blocks[r.contact].row(r.component);
            shifts.iter().enumerate().for_each(|(l, y)| a[k * m + l] = dot(g, y));
        }
        if m == 0 || !solver.factorise() {
            return false;
        }
        (0..self.mechanics.contacts[i].n_tangents).all(|k| {
            let t = b.tangent(k);
            let mut own = t.to_vec();
            self.mass.solve(&mut own);
            let whole = dot(t, &own);
            let products: Vec<f64> = shifts.iter().map(|y| dot(t, y)).collect();
            let mut weights = products.clone();
            solver.solve(&mut weights);
            // what is left of the tangent beside all rows, in the metric of the inertia; a switch may have no tangent
            whole > 0.0 && whole - dot(&products, &weights) <= LEAST * whole
        })
    }

    /// Can contact `i` not slide where all that is held under these modes is held, and contact `sticks` sticks? All closed
    /// contacts are loaded.
    pub(crate) fn stops_with(&self, i: usize, sticks: usize, modes: &[Vec<usize>]) -> bool {
        let mut rows = Vec::new();
        for (contact, set) in modes.iter().enumerate().filter(|(_, set)| set[0] != mode::OPEN) {
            if !self.is_joint(contact) {
                rows.push(Row { contact, component: 0 });
            }
            if set[0] == mode::CLOSED || contact == sticks {
                let n = self.mechanics.contacts[contact].n_tangents;
                rows.extend((1..=n).map(|component| Row { contact, component }));
            }
        }
        self.is_held_by(i, &rows)
    }

    /// Nothing is held any more.
    pub(super) fn forget_rows(&mut self) {
        self.kept.clear();
        self.rows.clear();
        self.y.clear();
    }

    /// Which components are held under these modes.
    fn list_rows(&mut self, modes: &[Vec<usize>]) {
        self.forget_rows();
        for (contact, set) in modes.iter().enumerate() {
            if set[0] == mode::OPEN {
                continue;
            }
            if !self.is_joint(contact) {
                self.rows.push(Row { contact, component: 0 });
            }
            if set[0] == mode::CLOSED {
                let n = self.mechanics.contacts[contact].n_tangents;
                self.rows.extend((1..=n).map(|component| Row { contact, component }));
            }
        }
    }

    /// Accelerations and forces under the modes of all contacts, at a point where everything is evaluated anew.
    pub(crate) fn accelerate(&mut self, at: &At, modes: &[Vec<usize>]) -> EvalResult {
        self.weigh(modes);
        self.load(at)?;
        let kept = self.kept.len() == modes.len() && self.kept.iter().zip(modes).all(|(a, b)| *a == b[0]);
        if !kept {
            self.list_rows(modes);
        }
        self.acceleration.copy_from_slice(&self.free);
        self.forces.fill([0.0; 3]);
        if self.rows.is_empty() && self.joints.is_empty() {
            return Ok(());
        }
        if !kept {
            for (i, _) in modes.iter().enumerate().filter(|(_, set)| set[0] != mode::OPEN) {
                self.load_contact(at, i)?;
            }
            // an evaluation knows nothing of those before it
            self.settled.copy_from_slice(&self.directions);
            self.assemble(modes)?;
            self.keep(modes);
        }
        self.push_joints(modes);
        self.solve_held();
        if !kept {
            self.settle_directions(modes)?;
        }
        for (i, set) in modes.iter().enumerate() {
            if Dynamics::slides(set[0]) {
                let (d, mu) = (self.direction(i, set[0]), self.blocks[i].friction);
                for k in 0..self.mechanics.contacts[i].n_tangents {
                    self.forces[i][1 + k] = -mu * self.forces[i][0] * d[k];
                }
            }
        }
        Ok(())
    }

    /// Joints that slide push with all that their friction has: their part of the accelerations without contact forces.
    fn push_joints(&mut self, modes: &[Vec<usize>]) {
        for k in 0..self.joints.len() {
            let i = self.joints[k];
            self.forces[i][0] = 1.0;
            if Dynamics::slides(modes[i][0]) && !self.is_switch(i) {
                let (d, b) = (self.direction(i, modes[i][0]), &self.blocks[i]);
                let push = &mut self.buffer[..self.mechanics.n_v];
                push.iter_mut().zip(b.tangent(0)).for_each(|(p, t)| *p = -b.friction * d[0] * t);
                self.mass.solve(push);
                self.free.iter_mut().zip(&*push).for_each(|(f, p)| *f += p);
            }
        }
    }

    /// Forces of what is held, and the accelerations with them.
    pub(super) fn solve_held(&mut self) {
        let n_v = self.mechanics.n_v;
        self.acceleration.copy_from_slice(&self.free);
        self.lambda.clear();
        for r in &self.rows {
            let b = &self.blocks[r.contact];
            self.lambda.push(-dot(b.row(r.component), &self.free) - b.rest_of(r.component));
        }
        self.held.solve(&mut self.lambda);
        if self.held.is_singular() {
            self.keep_reference();
        }
        for (r, (l, y)) in self.rows.iter().zip(self.lambda.iter().zip(self.y.chunks_exact(n_v))) {
            self.forces[r.contact][r.component] = *l;
            self.acceleration.iter_mut().zip(y).for_each(|(a, y)| *a += l * y);
        }
    }

    /// Adds to forces of least norm what of the reference changes nothing of the motion: rigid bodies do not say how they share
    /// a load, and the share of least norm may ask more of friction than it gives.
    fn keep_reference(&mut self) {
        let m = self.rows.len();
        let reference: Vec<f64> = self.rows.iter().map(|r| self.reference[r.contact][r.component]).collect();
        let mut moved: Vec<f64> = self.held.entries().chunks_exact(m).map(|row| dot(row, &reference)).collect();
        self.held.solve(&mut moved);
        let rest = reference.iter().zip(&moved).map(|(r, m)| r - m);
        self.lambda.iter_mut().zip(rest).for_each(|(l, r)| *l += r);
    }

    /// Keeps rows and matrix for the next evaluation if nothing of them changes.
    fn keep(&mut self, modes: &[Vec<usize>]) {
        let contacts = modes.iter().zip(&self.flat).zip(&self.mechanics.contacts);
        let mut closed = contacts.filter(|((m, _), _)| m[0] != mode::OPEN);
        // the direction of a slide in space turns
        if self.mass.is_constant()
            && closed.all(|((m, flat), c)| *flat && !(c.n_tangents == 2 && Dynamics::slides(m[0])))
        {
            self.kept.extend(modes.iter().map(|m| m[0]));
        }
    }

    /// `M⁻¹ F` and the matrix `G M⁻¹ F` of the rows, factored; the blocks of the closed contacts are loaded.
    pub(super) fn assemble(&mut self, modes: &[Vec<usize>]) -> EvalResult {
        let n_v = self.mechanics.n_v;
        self.y.clear();
        for r in &self.rows {
            let b = &self.blocks[r.contact];
            let from = self.y.len();
            self.y.extend_from_slice(b.column(r.component));
            let m = modes[r.contact][0];
            if r.component == 0 && Dynamics::slides(m) {
                let d = self.direction(r.contact, m);
                for k in 0..self.mechanics.contacts[r.contact].n_tangents {
                    let weight = b.friction * d[k];
                    self.y[from..].iter_mut().zip(b.tangent(k)).for_each(|(y, t)| *y -= weight * t);
                }
            }
            self.mass.solve(&mut self.y[from..]);
        }
        let m = self.rows.len();
        let a = self.held.clear(m);
        for (i, r) in self.rows.iter().enumerate() {
            let g = self.blocks[r.contact].row(r.component);
            for (j, y) in self.y.chunks_exact(n_v).enumerate() {
                a[i * m + j] = dot(g, y);
            }
        }
        if self.held.factorise() {
            Ok(())
        } else {
            Err(EvalError::Recoverable)
        }
    }

    /// Derivative of the state under the modes of all contacts.
    pub(crate) fn rhs(&mut self, at: &At, modes: &[Vec<usize>], out: &mut [f64]) -> EvalResult {
        self.accelerate(at, modes)?;
        self.write(out);
        Ok(())
    }

    /// Derivative of the state at the point of the last accelerations.
    pub(crate) fn write(&self, out: &mut [f64]) {
        let n_q = self.mechanics.n_q;
        let velocities = self.mechanics.velocities();
        out[..n_q].copy_from_slice(&self.smooth[..n_q]);
        out[velocities.end..].copy_from_slice(&self.smooth[velocities.end..]);
        out[velocities].copy_from_slice(&self.acceleration);
    }

    /// Contacts that were closed in the last accelerations, and joints that stuck.
    pub(crate) fn closed(&self) -> impl Iterator<Item = usize> + '_ {
        self.rows.iter().filter(|r| r.component == self.lead(r.contact)).map(|r| r.contact)
    }

    /// Are the forces under the modes of the last evaluation not unique? The motion is.
    pub(crate) fn is_redundant(&self) -> bool {
        !self.rows.is_empty() && self.held.is_singular()
    }

    /// Moves the coordinates until the gaps of all closed contacts vanish to rounding, and the velocities until the gaps and
    /// the sticking contacts rest. `tolerance` is what of a gap is zero. Says whether the state has changed.
    pub(crate) fn project(
        &mut self,
        at: &At,
        modes: &[Vec<usize>],
        x: &mut [f64],
        tolerance: &dyn Fn(usize, &Block) -> [f64; 2],
    ) -> Result<bool, EvalError> {
        let (n_q, n_v) = (self.mechanics.n_q, self.mechanics.n_v);
        let closed = |c: usize| modes[c][0] != mode::OPEN;
        let mut moved = false;
        self.weigh(modes);
        for i in (0..modes.len()).filter(|i| closed(*i)) {
            let at = Point { x, ..*at };
            if self.is_joint(i) {
                // what sticks has no gap that would tell of its drift
                if modes[i][0] == mode::CLOSED {
                    self.load_contact(&at, i)?;
                    moved |= self.blocks[i].sliding[0].abs() > tolerance(i, &self.blocks[i])[1];
                }
                continue;
            }
            self.load_gap(&at, i)?;
            let [g, rate] = tolerance(i, &self.blocks[i]);
            moved |= self.blocks[i].gap[0].abs() > g || self.blocks[i].gap[1].abs() > rate && !self.is_first_order();
        }
        if !moved {
            return Ok(false);
        }
        for _ in 0..3 {
            // along M⁻¹ of the normals: the shift of the coordinates is N times that of a velocity
            self.evaluate_rows(&Point { x, ..*at }, modes)?;
            self.lambda.clear();
            for r in &self.rows {
                let b = &self.blocks[r.contact];
                self.lambda.push(match r.component {
                    0 => -b.gap[0],
                    k if self.mechanics.order == Order::First => -b.sliding[k - 1],
                    _ => 0.0,
                });
            }
            self.held.solve(&mut self.lambda);
            if self.is_first_order() {
                for (l, y) in self.lambda.iter().zip(self.y.chunks_exact(n_v)) {
                    x[n_q..].iter_mut().zip(y).for_each(|(x, y)| *x += l * y);
                }
                continue;
            }
            let mut shift = vec![0.0; n_q + n_v];
            for (l, y) in self.lambda.iter().zip(self.y.chunks_exact(n_v)) {
                shift[n_q..].iter_mut().zip(y).for_each(|(s, y)| *s += l * y);
            }
            // N times the shift: the rates of the coordinates are linear in the velocities
            let mut there = x.to_vec();
            let mut room = Vec::new();
            let mut rates = |d: &Dynamics, at: &Point, out: &mut [f64], work: &mut [f64]| {
                d.mechanics.smooth.value(&Dynamics::weighted(&d.weights, &mut room, at), out, work)
            };
            let (mut work, mut with, mut without) =
                (std::mem::take(&mut self.work), vec![0.0; x.len()], vec![0.0; x.len()]);
            there[n_q..n_q + n_v].copy_from_slice(&shift[n_q..]);
            let first = rates(self, &Point { x: &there, ..*at }, &mut with, &mut work);
            there[n_q..n_q + n_v].fill(0.0);
            let second = rates(self, &Point { x: &there, ..*at }, &mut without, &mut work);
            self.work = work;
            first.and(second)?;
            x[..n_q].iter_mut().zip(with.iter().zip(&without)).for_each(|(x, (a, b))| *x += a - b);
        }
        if self.is_first_order() {
            return Ok(true);
        }
        // the velocities, at the coordinates that are right now
        self.evaluate_rows(&Point { x, ..*at }, modes)?;
        self.lambda.clear();
        for r in &self.rows {
            let b = &self.blocks[r.contact];
            self.lambda.push(if r.component == 0 { -b.gap[1] } else { -b.sliding[r.component - 1] });
        }
        self.held.solve(&mut self.lambda);
        for (l, y) in self.lambda.iter().zip(self.y.chunks_exact(n_v)) {
            x[n_q..].iter_mut().zip(y).for_each(|(v, y)| *v += l * y);
        }
        Ok(true)
    }

    /// Rate of the sliding velocity of contact `i` along a direction, under the last accelerations.
    pub(crate) fn sliding_acceleration(&self, i: usize, direction: [f64; 2]) -> f64 {
        self.sliding_rate(i, direction, &self.acceleration)
    }

    /// The same with the accelerations in a derivative of the state.
    pub(crate) fn sliding_acceleration_of(&self, i: usize, direction: [f64; 2], velocity: &[f64]) -> f64 {
        self.sliding_rate(i, direction, &velocity[self.mechanics.n_q..])
    }

    fn sliding_rate(&self, i: usize, direction: [f64; 2], acceleration: &[f64]) -> f64 {
        let b = &self.blocks[i];
        let n_t = self.mechanics.contacts[i].n_tangents;
        (0..n_t).map(|k| direction[k] * (dot(b.tangent(k), acceleration) + b.sliding_rest[k])).sum()
    }

    /// Second derivative of the gap of contact `i` under the last accelerations; the contact is loaded.
    pub(crate) fn gap_acceleration(&self, i: usize) -> f64 {
        let b = &self.blocks[i];
        dot(&b.normal, &self.acceleration) + b.rest
    }

    /// What the rate of a constraint of first order, which is loaded, consists of before anything cancels.
    pub(crate) fn gap_rate_size(&self, i: usize) -> f64 {
        let b = &self.blocks[i];
        b.normal.iter().zip(&self.acceleration).map(|(n, a)| (n * a).abs()).sum::<f64>() + b.rest.abs()
    }

    /// The same with the accelerations in a derivative of the state.
    pub(crate) fn gap_acceleration_of(&self, i: usize, velocity: &[f64]) -> f64 {
        let b = &self.blocks[i];
        dot(&b.normal, &velocity[self.mechanics.n_q..]) + b.rest
    }

    /// Column `k` of the tangents of contact `i`.
    pub(crate) fn tangent(&self, i: usize, k: usize) -> &[f64] {
        self.blocks[i].tangent(k)
    }

    /// What the normal force of contact `i`, which is loaded and closed, consists of before anything cancels: free
    /// accelerations, and the pushes of the other contacts of the last evaluation. Of a joint it is its friction.
    pub(crate) fn force_size(&mut self, i: usize) -> f64 {
        let lead = self.lead(i);
        let y = &mut self.buffer[..self.mechanics.n_v];
        let b = &self.blocks[i];
        let m = self.rows.len();
        let held = self.held.entries();
        let pushes: f64 = match self.rows.iter().position(|r| r.contact == i && r.component == lead) {
            Some(r) if held.len() == m * m && self.lambda.len() == m => {
                held[r * m..(r + 1) * m].iter().zip(&self.lambda).map(|(a, l)| (a * l).abs()).sum()
            }
            _ => 0.0,
        };
        let row = b.row(lead);
        y.copy_from_slice(b.column(lead));
        self.mass.solve(y);
        let w = dot(row, y).abs();
        let own = row.iter().zip(&self.free).map(|(n, a)| (n * a).abs()).sum::<f64>() + b.rest_of(lead).abs();
        let terms = own + pushes;
        if w > 0.0 {
            terms / w
        } else {
            terms
        }
    }

    /// For every closed contact, the normal force that its rounding is proportional to: that of the equations of all contacts
    /// that are held, as far as they act on it (componentwise: N. J. Higham, *Accuracy and Stability of Numerical Algorithms*,
    /// 2002, 7.2). A contact that nothing presses has what the others leave.
    pub(crate) fn force_roundings(&mut self) -> Vec<(usize, f64)> {
        let m = self.rows.len();
        let held = self.held.entries();
        if held.len() != m * m || self.lambda.len() != m || m < 2 {
            return Vec::new();
        }
        let of = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a * b).abs()).sum::<f64>();
        let terms = self.rows.iter().zip(held.chunks_exact(m)).map(|(r, a)| {
            let b = &self.blocks[r.contact];
            of(a, &self.lambda) + of(b.row(r.component), &self.free) + b.rest_of(r.component).abs()
        });
        let terms: Vec<f64> = terms.collect();
        let (mut sizes, mut column) = (vec![0.0; m], vec![0.0; m]);
        for (j, t) in terms.iter().enumerate() {
            column.fill(0.0);
            column[j] = *t;
            self.held.solve(&mut column);
            sizes.iter_mut().zip(&column).for_each(|(s, c)| *s += c.abs());
        }
        let normal = self.rows.iter().zip(&sizes).filter(|(r, _)| r.component == 0);
        normal.map(|(r, s)| (r.contact, *s)).collect()
    }

    /// Loads all closed contacts and the matrix of what is held.
    fn evaluate_rows(&mut self, at: &At, modes: &[Vec<usize>]) -> EvalResult {
        self.list_rows(modes);
        self.mass.load(&self.mechanics, at, &mut self.work)?;
        for i in 0..self.rows.len() {
            let contact = self.rows[i].contact;
            if self.rows[i].component == self.lead(contact) {
                self.load_gap(at, contact)?;
                self.load_contact(at, contact)?;
            }
        }
        self.assemble(modes)
    }
}

/// Is the sliding velocity all that changes of what is known of a contact?
fn is_flat(c: &Contact, n_v: usize) -> bool {
    let p = c.motion.jac_pattern();
    (0..p.n_cols()).all(|col| p.rows(col).iter().all(|&r| c.sliding_at(n_v, r).is_some()))
}

pub(super) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
