//! Derivatives through contacts that close at one time.
//!
//! Nearby motions meet such contacts one after the other. Contact `k` is struck at a time of its own, which depends on the state that the
//! strikes before it have left, `dt_k = −(∇g_k S + g_p) / ġ_k`, and every strike moves the derivatives by its saltation matrix,
//! `S⁺ = r_x (S + f⁻ dt) + r_p + r_t dt − f⁺ dt`, with the velocities `f` between the strikes. In which order that happens is
//! decided by the direction of the change (A. P. Ivanov, On multiple impact, J. Appl. Math. Mech. 59 (1995) 887-902; S. A. Burden, S. S. Sastry,
//! D. E. Koditschek, S. Revzen, Event-selected vector field discontinuities yield piecewise-differentiable flows, SIAM J. Appl. Dyn.
//! Syst. 15 (2016) 1227-1267). Three cases:
//!
//! - All orders end in the state behind the impact at one time, and the products of their matrices agree, as they do where
//!   no contact changes the rate of another: that product is the derivative.
//! - The orders of two contacts differ, and one of them ends in that state: its product is the derivative of that side.
//! - No order ends there: the motion is discontinuous for changes that part the contacts, and has no derivative with respect to
//!   them. Those that leave the contacts together are struck by the law for all at once.

use super::algebraic::Follower;
use super::contact::{SceneRoom, AT_REST};
use super::{Engine, EPS};
use crate::contact::{mode, ZERO};
use crate::event::watch::ContactWatch;
use crate::event::ImpactKind;
use crate::func::EvalError;
use crate::system::ImpactLaw;

/// States and derivatives that agree to this share of the terms they consist of are the same.
const SAME: f64 = 1e-9;
/// Of so many contacts at most all orders are followed: there are 24.
const MOST: usize = 4;
/// Two contacts that strike each other in turn so often come to no end that could be used.
const STRIKES: usize = 64;

/// The time of a strike at less than this share of the size of its rate depends on the rounding of what was before by more than [`SAME`].
const SLOW: f64 = 1e-6;

/// One contact is struck.
pub(super) struct Strike {
    pub(super) contact: usize,
    /// Derivatives of its time with respect to the state just before, parameters, controls.
    pub(super) row: Vec<f64>,
    /// Velocities before and behind.
    pub(super) velocities: [Vec<f64>; 2],
    /// Jacobian of the reset.
    jac: Vec<f64>,
}

/// What contacts that close at one time do to the derivatives.
pub(super) enum Several {
    /// The strikes of one order; whether the others end alike.
    Ordered(Vec<Strike>, bool),
    /// Functions of the state before, parameters and controls that vanish for a change which leaves the contacts together, and the sizes of their
    /// terms, row by row.
    Parted(Vec<f64>, Vec<f64>),
}

/// What a meeting has done to the derivatives.
#[derive(Default)]
pub(super) struct Met {
    /// They hold for both sides.
    pub(super) both: bool,
    /// Contacts in the order of their strikes, and the derivatives of their times.
    pub(super) times: Vec<(usize, Vec<f64>)>,
}

/// An order that was followed.
pub(super) struct Order {
    strikes: Vec<Strike>,
    after: Vec<f64>,
    /// Sizes of what the state behind is the sum of.
    sizes: Vec<f64>,
    /// A contact was struck twice.
    again: bool,
}

/// Where it all begins.
pub(super) struct Meeting {
    /// Contacts that close, and those that touch without a force, which a change may part.
    free: Vec<usize>,
    /// Those that touch without a force: a change in one direction only can part them.
    loose: Vec<usize>,
    /// Closed contacts that are pressed together, and stay so.
    pressed: Vec<usize>,
    x: Vec<f64>,
    f: Vec<f64>,
    event: Option<usize>,
}

/// A product of saltation matrices, with the sizes of the terms of its entries.
struct Product {
    m: Vec<f64>,
    terms: Vec<f64>,
    nx: usize,
    n_c: usize,
}

impl Product {
    fn identity(nx: usize, n_c: usize) -> Product {
        let mut m = vec![0.0; nx * n_c];
        (0..nx).for_each(|i| m[i * n_c + i] = 1.0);
        Product { terms: m.clone(), m, nx, n_c }
    }

    /// `A (m; I)`, of `m` or of the sizes of its terms, for a row of states, parameters and controls.
    fn along(&self, row: &[f64], sizes: bool) -> Vec<f64> {
        let (m, size) = (if sizes { &self.terms } else { &self.m }, |v: f64| if sizes { v.abs() } else { v });
        let mut out = vec![0.0; self.n_c];
        out[self.nx..].iter_mut().zip(&row[self.nx..]).for_each(|(o, r)| *o = size(*r));
        for (m, r) in m.chunks_exact(self.n_c).zip(&row[..self.nx]).filter(|(_, r)| **r != 0.0) {
            out.iter_mut().zip(m).for_each(|(o, m)| *o += size(*r) * m);
        }
        out
    }

    fn strike(&mut self, s: &Strike) {
        let (nx, n_c) = (self.nx, self.n_c);
        for sizes in [false, true] {
            let size = |v: f64| if sizes { v.abs() } else { v };
            let dt = self.along(&s.row, sizes);
            let add = |m: &mut [f64], f: &[f64], sign: f64| {
                for (row, f) in m.chunks_exact_mut(n_c).zip(f) {
                    row.iter_mut().zip(&dt).for_each(|(m, dt)| *m += size(sign * f) * dt);
                }
            };
            add(if sizes { &mut self.terms } else { &mut self.m }, &s.velocities[0], 1.0);
            let mut behind = Vec::with_capacity(nx * n_c);
            for jac in s.jac.chunks_exact(n_c + 1) {
                let mut row = self.along(&jac[..n_c], sizes);
                row.iter_mut().zip(&dt).for_each(|(r, dt)| *r += size(jac[n_c]) * dt);
                behind.extend(row);
            }
            add(&mut behind, &s.velocities[1], -1.0);
            *(if sizes { &mut self.terms } else { &mut self.m }) = behind;
        }
    }

    fn of(order: &Order, nx: usize, n_c: usize) -> Product {
        let mut p = Product::identity(nx, n_c);
        order.strikes.iter().for_each(|s| p.strike(s));
        p
    }

    fn agrees(&self, other: &Product) -> bool {
        let terms = self.terms.iter().zip(&other.terms);
        self.m.iter().zip(&other.m).zip(terms).all(|((a, b), (s, r))| (a - b).abs() <= SAME * (s + r))
    }
}

/// All orders of these.
fn orders(of: &[usize]) -> Vec<Vec<usize>> {
    if of.len() < 2 {
        return vec![of.to_vec()];
    }
    let mut all = Vec::new();
    for (i, first) in of.iter().enumerate() {
        let rest: Vec<usize> = of.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| *c).collect();
        for mut order in orders(&rest) {
            order.insert(0, *first);
            all.push(order);
        }
    }
    all
}

impl Engine {
    /// The contacts that close at the present point, if it is more than one that a change may part; at a time that is given, one is
    /// enough. The velocity before is known.
    pub(super) fn meeting(
        &mut self,
        event: Option<(usize, ContactWatch)>,
    ) -> std::result::Result<Option<Meeting>, EvalError> {
        let closes = matches!(event, None | Some((_, ContactWatch::Gap)));
        if !closes || self.field.scene().is_none_or(|c| c.dynamics.is_first_order()) {
            return Ok(None);
        }
        self.touching(event)?;
        let event = event.map(|e| e.0);
        let all = self.contact_events.scene.touching.clone();
        let (mut free, mut loose, mut pressed) = (Vec::new(), Vec::new(), Vec::new());
        let r = self.field.with_contacts(self.t, &self.x, |c, at, modes| {
            for i in all {
                if !c.dynamics.opens(i) {
                    pressed.push(i);
                    continue;
                }
                c.dynamics.load_gap(at, i)?;
                let (rate, open) = (c.dynamics.block(i).gap[1], modes[i][0] == mode::OPEN);
                let noise = match (open, event == Some(i)) {
                    (true, true) => 0.0,
                    (true, false) => 64.0 * EPS,
                    _ => AT_REST,
                };
                let closes = rate < -noise * c.sizes[i][3];
                if closes {
                    free.push(i);
                } else if open || c.dynamics.forces[i][0] <= ZERO * c.sizes[i][1] {
                    free.push(i);
                    loose.push(i);
                } else {
                    pressed.push(i);
                }
            }
            Ok(())
        });
        r.unwrap_or(Ok(()))?;
        let least = if event.is_none() { 1 } else { 2 };
        let some = free.len() > loose.len() && free.len() >= least;
        Ok(some.then(|| Meeting { free, loose, pressed, x: self.x.clone(), f: self.f_before.clone(), event }))
    }

    /// Follows all orders of a meeting, or none if there are too many. The present state is that before.
    pub(super) fn follow_orders(
        &mut self,
        meeting: &Meeting,
        length: f64,
    ) -> std::result::Result<Vec<Option<Order>>, EvalError> {
        if meeting.free.len() > MOST {
            return Ok(Vec::new());
        }
        let kept = self.field.with_contacts(self.t, &[], |c, _, _| c.dynamics.keep_slides());
        let each = orders(&meeting.free).into_iter().map(|order| match self.follow_order(meeting, &order, length) {
            Err(EvalError::Recoverable) => Ok(None),
            found => found,
        });
        let all = each.collect();
        self.x.copy_from_slice(&meeting.x);
        self.field.with_contacts(self.t, &[], |c, _, _| {
            kept.into_iter().for_each(|k| c.dynamics.put_back_slides(k));
            c.forget();
        });
        all
    }

    /// What a meeting does to the derivatives, where the impact for all at once has led to the present state.
    pub(super) fn part(
        &mut self,
        meeting: &Meeting,
        all: Vec<Option<Order>>,
    ) -> std::result::Result<Several, EvalError> {
        let n_c = self.field.n_z - 1;
        let n = all.len();
        let mut first: Option<(Order, Product)> = None;
        let mut alike = n > 0;
        for found in all {
            let ends = |o: &Order| {
                let behind = o.after.iter().zip(&self.x).zip(&o.sizes);
                behind.into_iter().all(|((a, b), size)| (a - b).abs() <= SAME * size)
            };
            let Some(mut found) = found.filter(|o| ends(o) && !(n > 2 && o.again)) else {
                alike = false;
                continue;
            };
            if let Some(last) = found.strikes.last_mut() {
                last.velocities[1].copy_from_slice(&self.f);
            }
            let product = Product::of(&found, self.nx, n_c);
            match &first {
                Some((_, p)) => alike &= p.agrees(&product),
                None => first = Some((found, product)),
            }
        }
        match first.filter(|_| alike || n <= 2) {
            Some((o, _)) => {
                // where contacts touch before, or close at a given time, bodies overlap on the other side
                let feasible = meeting.event.is_some() && !o.strikes.iter().any(|s| meeting.loose.contains(&s.contact));
                Ok(Several::Ordered(o.strikes, alike && feasible))
            }
            None => {
                let parted = self.parted(meeting);
                self.field.forget();
                parted
            }
        }
    }

    /// Strikes contacts one after the other, always the next in this order that closes, until none does.
    fn follow_order(
        &mut self,
        meeting: &Meeting,
        order: &[usize],
        length: f64,
    ) -> std::result::Result<Option<Order>, EvalError> {
        let law = self.field.scene().map_or(ImpactLaw::Newton, |c| c.dynamics.mechanics.law);
        let (n_z, mut order) = (self.field.n_z, order.to_vec());
        self.x.copy_from_slice(&meeting.x);
        let mut f = meeting.f.clone();
        let mut out = Order {
            strikes: Vec::new(),
            after: Vec::new(),
            sizes: meeting.x.iter().enumerate().map(|(i, x)| self.field.size(i, *x)).collect(),
            again: false,
        };
        // closed contacts, and those that were struck and have not opened
        let (mut stay, mut struck, mut next) = (meeting.pressed.clone(), Vec::new(), 0);
        loop {
            let n = order.len();
            let closing = self.rates(&order, |i, rate, size| {
                let noise = match (struck.contains(&i), meeting.event == Some(i)) {
                    (false, true) => 0.0,
                    (false, false) => 64.0 * EPS,
                    _ => AT_REST,
                };
                (rate < -noise * size).then_some(rate > -SLOW * size)
            })?;
            let Some(k) = (0..n).map(|k| (next + k) % n).find(|k| closing[*k].is_some()) else { break };
            if out.strikes.len() == STRIKES || closing[k] == Some(true) {
                return Ok(None);
            }
            let contact = order[k];
            next = k + 1;
            out.again |= struck.contains(&contact);
            struck.push(contact);
            let mut list = vec![(contact, None)];
            if law != ImpactLaw::Sequential {
                list.extend(stay.iter().filter(|i| **i != contact).map(|i| (*i, None)));
            }
            let mut row = vec![0.0; n_z];
            self.field.contact_gradient((contact, ContactWatch::Gap), (self.t, &self.x), &mut row)?;
            let rate = row.iter().zip(&f).fold(row[n_z - 1], |r, (g, v)| r + g * v);
            row.pop();
            row.iter_mut().for_each(|g| *g /= -rate);
            let mut after = self.x.clone();
            let mut jac = vec![0.0; self.nx * n_z];
            let r = self.field.with_contacts(self.t, &self.x, |c, at, _| {
                let sizes = &c.sizes;
                let found = c.dynamics.impact(at, &list, true, &|i, _| sizes[i][3], &mut after)?;
                if let Some(impact) = &found {
                    c.dynamics.impact_jacobian(at, &after, impact, &mut jac)?;
                }
                Ok(found.is_some_and(|i| i.unique))
            });
            if !r.unwrap_or(Ok(false))? {
                return Ok(None);
            }
            out.sizes.iter_mut().zip(after.iter().zip(&self.x)).for_each(|(s, (a, b))| *s += (a - b).abs());
            self.x.copy_from_slice(&after);
            if !stay.contains(&contact) {
                stay.push(contact);
            }
            let rests = self.rates(&stay, |_, rate, size| rate.abs() <= AT_REST * size)?;
            let (mut rests, opens) = (rests.iter(), |i: usize| self.field.scene().is_some_and(|c| c.dynamics.opens(i)));
            stay.retain(|i| rests.next().is_some_and(|r| *r) || !opens(*i));
            let Some(behind) = self.velocity_between(&mut stay, length)? else { return Ok(None) };
            // what is not pressed any more opens before the next strike, and may be struck in its turn
            let opened = meeting.pressed.iter().filter(|i| !stay.contains(i));
            for i in opened {
                if !order.contains(i) {
                    order.push(*i);
                    struck.push(*i);
                }
            }
            let before = std::mem::replace(&mut f, behind);
            out.strikes.push(Strike { contact, row, velocities: [before, f.clone()], jac });
        }
        out.after.clone_from(&self.x);
        Ok(Some(out))
    }

    /// Something of the rates of the gaps of these contacts at the present point, and of the sizes of these rates.
    fn rates<T>(
        &mut self,
        of: &[usize],
        mut each: impl FnMut(usize, f64, f64) -> T,
    ) -> std::result::Result<Vec<T>, EvalError> {
        let r = self.field.with_contacts(self.t, &self.x, |c, at, _| {
            let one = |i: &usize| {
                c.dynamics.load_gap(at, *i)?;
                Ok(each(*i, c.dynamics.block(*i).gap[1], c.sizes[*i][3]))
            };
            of.iter().map(one).collect()
        });
        r.unwrap_or_else(|| Ok(Vec::new()))
    }

    /// The derivative of the state at the present point where of the contacts only these are closed; none where it is not unique. Those that
    /// open are left out.
    fn velocity_between(
        &mut self,
        stay: &mut Vec<usize>,
        length: f64,
    ) -> std::result::Result<Option<Vec<f64>>, EvalError> {
        let touching = std::mem::replace(&mut self.contact_events.scene.touching, stay.clone());
        let closed = self.closed(None, false);
        self.contact_events.scene.touching = touching;
        closed?;
        let mut f = vec![0.0; self.nx];
        let SceneRoom { closed, .. } = &self.contact_events.scene;
        let tolerances = (&self.rtol[..], &self.atol[..]);
        let r = self.field.with_contacts(self.t, &self.x, |c, at, _| {
            c.forget();
            let sizes = &c.sizes;
            let found = c.dynamics.follow(at, closed, &|k| sizes[k][1], (length, false))?;
            for (k, choice) in found.all.iter().enumerate() {
                let mut velocity = vec![0.0; f.len()];
                c.begin(choice, at, tolerances);
                c.dynamics.rhs(at, &choice.modes, &mut velocity)?;
                // modes that move the system alike are one
                if k > 0 && f.iter().zip(&velocity).any(|(a, b)| (a - b).abs() > SAME * (a.abs() + b.abs())) {
                    return Ok(false);
                }
                f = velocity;
            }
            let n_q = c.dynamics.mechanics.n_q;
            stay.retain(|i| {
                let (a, normal) = (c.dynamics.gap_acceleration_of(*i, &f), &c.dynamics.block(*i).normal);
                let size: f64 = normal.iter().zip(&f[n_q..]).map(|(n, a)| (n * a).abs()).sum();
                a <= ZERO * size || !c.dynamics.opens(*i)
            });
            c.forget();
            Ok(!found.all.is_empty())
        });
        Ok(r.unwrap_or(Ok(false))?.then_some(f))
    }

    /// How far apart the contacts of a meeting are for a change of the state before it, when one of them is struck.
    fn parted(&mut self, meeting: &Meeting) -> std::result::Result<Several, EvalError> {
        let n_z = self.field.n_z;
        let mut gradients = Vec::new();
        for &i in &meeting.free {
            let mut row = vec![0.0; n_z];
            self.field.contact_gradient((i, ContactWatch::Gap), (self.t, &meeting.x), &mut row)?;
            let rate = row.iter().zip(&meeting.f).fold(row[n_z - 1], |r, (g, v)| r + g * v);
            row.pop();
            gradients.push((row, rate));
        }
        // at the time of the first that closes, or at a time that is given
        let of = |(g, rate): &(Vec<f64>, f64)| g.iter().map(|g| -g / rate).collect::<Vec<f64>>();
        let reference = meeting.free.iter().position(|i| meeting.event == Some(*i));
        let dt = reference.map_or_else(|| vec![0.0; n_z - 1], |k| of(&gradients[k]));
        let (mut rows, mut sizes) = (Vec::new(), Vec::new());
        for (k, (g, rate)) in gradients.iter().enumerate() {
            if reference == Some(k) {
                continue;
            }
            rows.extend(g.iter().zip(&dt).map(|(g, dt)| g + rate * dt));
            sizes.extend(g.iter().zip(&dt).map(|(g, dt)| g.abs() + (rate * dt).abs()));
        }
        Ok(Several::Parted(rows, sizes))
    }

    /// Derivatives behind a meeting, with those before it.
    pub(super) fn differentiate_meeting(
        &mut self,
        meeting: &Meeting,
        orders: Vec<Option<Order>>,
        before: Option<Vec<f64>>,
        start: usize,
    ) -> std::result::Result<Met, EvalError> {
        let kinds = |kind| self.log.impacts[start..].iter().any(|i| i.kind == kind);
        if !kinds(ImpactKind::Painleve) && (self.contact_events.scene.merges || kinds(ImpactKind::Last)) {
            // the orders differ by no more than the tolerances see of these impacts
            self.differentiate_impacts(start, false);
            self.log.one_sided = true;
            return Ok(Met::default());
        }
        let apart = !kinds(ImpactKind::Painleve);
        let several = self.part(meeting, if apart { orders } else { Vec::new() })?;
        let behind = before.and_then(|b| self.derivatives.sens.as_mut().map(|s| std::mem::replace(&mut s.s, b)));
        match several {
            Several::Ordered(strikes, both) => {
                self.log.one_sided |= !both;
                Ok(Met { both, times: self.strike_in_order(&strikes, start) })
            }
            Several::Parted(rows, sizes) => {
                if let Some(tape) = &mut self.derivatives.tape {
                    tape.part(&rows, &sizes);
                }
                let columns =
                    self.derivatives.sens.as_ref().map_or_else(Vec::new, |s| s.columns_of(&rows, &sizes, SAME));
                if let (Some(s), Some(behind)) = (&mut self.derivatives.sens, behind) {
                    s.s = behind;
                }
                self.differentiate_impacts(start, false);
                if let Some(s) = &mut self.derivatives.sens {
                    s.lose(&columns);
                    self.log.impacts[start..]
                        .iter_mut()
                        .filter(|i| !i.dt.is_empty())
                        .for_each(|i| i.dt.clone_from(&s.dt));
                }
                self.log.one_sided = true;
                Ok(Met { both: false, times: Vec::new() })
            }
        }
    }

    /// Moves the derivatives, which are those before a meeting, by the strikes of an order. The impacts from `start` on come to stand in
    /// that order, with the derivatives of their times, which are returned.
    fn strike_in_order(&mut self, strikes: &[Strike], start: usize) -> Vec<(usize, Vec<f64>)> {
        let place = |i: usize| strikes.iter().position(|s| s.contact == i);
        self.log.impacts[start..].sort_by_key(|i| place(i.contact).unwrap_or(usize::MAX));
        // changes of modes are logged in that order, too
        let changed = self.contact_events.scene.before.iter().zip(&self.field.active).enumerate();
        let changed: Vec<usize> = changed.filter(|(_, (a, b))| a != b).map(|(i, _)| place(i).unwrap_or(0)).collect();
        let n_c = self.derivatives.time_row.len() - 1;
        let mut times = Vec::new();
        for (k, strike) in strikes.iter().enumerate() {
            let [before, after] = &strike.velocities;
            if let Some(s) = &mut self.derivatives.sens {
                s.time(&strike.row);
                s.advance(before, 1.0);
                s.reset_by(&strike.jac);
                s.advance(after, -1.0);
                if place(strike.contact) == Some(k) {
                    let own = self.log.impacts[start..].iter_mut().filter(|i| i.contact == strike.contact);
                    let dt = Follower::shown(self.algebraic.as_deref(), &s.dt);
                    own.for_each(|i| i.dt.clone_from(&dt));
                    times.push((strike.contact, dt));
                }
            }
            if let Some(tape) = &mut self.derivatives.tape {
                let first = self.log.switches.len() + changed.iter().filter(|p| **p < k).count();
                tape.jump((first, start), &strike.row[..n_c], [before, after], &strike.jac, None);
            }
        }
        times
    }

    /// Sorts the changes of modes from `from` on, which the strikes of a meeting have made, and says how their times depend on the start.
    pub(super) fn time_switches(&mut self, from: usize, times: &[(usize, Vec<f64>)]) {
        let place = |i: usize| times.iter().position(|t| t.0 == i);
        let log = &mut self.log.switches[from..];
        log.sort_by_key(|s| place(s.subsystem).unwrap_or(0));
        for s in log.iter_mut().filter(|s| !s.dt.is_empty()) {
            if let Some(k) = place(s.subsystem).or((!times.is_empty()).then_some(0)) {
                s.dt.clone_from(&times[k].1);
            }
        }
    }
}
