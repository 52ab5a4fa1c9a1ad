//! Steps of inclusions as switches of a scene: where the forces of contacts push what a switching function depends on, the weight that holds its
//! surface is found with these forces, see [`Kind::Switch`].
//!
//! ```text
//! M v̇ = f_v + f(x, α) + contact forces,   α = (1 + w)/2,   w ∈ Sign ψ(q, v, z, u, p, t)
//! ```
//!
//! With `f` affine in every `α_j` alone, its part is `f(x, ½) + ½ Σ f_α w_j`: the column `½ f_α` times a force in `[-1, 1]` that is told like dry
//! friction whose sliding velocity is `ψ`. Other inclusions stay as they are, see [`steps`](super::steps).

use std::borrow::Cow;
use std::sync::Arc;

use super::complementary::{with_zeros, Combination};
use super::linear::combination;
use super::steps::Placed;
use super::{Contact, Inclusion, Inertia, Kind, Local, Mechanics, Order, SetValued, SharedFunction, System};
use crate::func::{Dims, EvalResult, Function, Point};
use crate::linalg::csc::Pattern;

impl System {
    /// The system with those inclusions as switches of its scene whose weights must be found with the forces of contacts.
    pub(crate) fn with_switches(&self) -> Cow<'_, System> {
        let Some(m) = self.mechanics.as_ref().filter(|_| !self.inclusions.is_empty()) else {
            return Cow::Borrowed(self);
        };
        let pushed = m.pushed();
        let (own, rest): (Vec<&Inclusion>, Vec<&Inclusion>) =
            self.inclusions.iter().partition(|i| self.is_pushed(m, i, &pushed));
        if own.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut out = self.clone();
        out.inclusions = rest.into_iter().cloned().collect();
        out.mechanics = Some(Arc::new(self.switched(m, &own)));
        Cow::Owned(out)
    }

    /// Do the forces of contacts act on the surface of a step of an inclusion that can be a switch?
    fn is_pushed(&self, m: &Mechanics, i: &Inclusion, pushed: &[bool]) -> bool {
        let (nx, z) = (self.dims.x, self.algebraic_states());
        let psi = i.psi.jac_pattern();
        let depends = |is: &dyn Fn(usize) -> bool| (0..nx).any(|c| is(c) && !psi.rows(c).is_empty());
        let bends = |j: usize| i.f.hess_pattern().rows(nx + j).contains(&(nx + j));
        let affine = !i.f.hessian_is_approximate() && (0..i.psi.n_out()).all(|j| !bends(j));
        let of_coordinates = m.order == Order::Second && i.rows.iter().any(|r| *r < m.n_q);
        let widens = m.n_z == 0 || !matches!(m.inertia, Inertia::Varying { .. });
        i.set == SetValued::Step
            && affine
            && widens
            && !of_coordinates
            && !i.rows.iter().any(|r| z.contains(r))
            && !depends(&|c| z.contains(&c))
            && depends(&|c| pushed[c])
    }

    /// The scene with these inclusions as switches, and with all states beside coordinates and velocities as velocities of unit inertia.
    fn switched(&self, m: &Mechanics, inclusions: &[&Inclusion]) -> Mechanics {
        let (dims, before) = (self.dims, m.n_switches);
        let steps: Vec<(&Inclusion, usize)> =
            inclusions.iter().flat_map(|i| (0..i.psi.n_out()).map(move |j| (*i, j))).collect();
        let n_switches = before + steps.len();
        let weighted = Dims { p: dims.p + n_switches, ..dims };
        let wide = m.n_v + m.n_z;
        // parameters: those of the system, the weights, accelerations, forces
        let place = |f: &SharedFunction, n_weights: usize, behind: Option<usize>| {
            let own = f.dims();
            let more_weights = if n_weights > 0 { n_switches - n_weights } else { 0 };
            let more = more_weights + behind.map_or(0, |_| m.n_z);
            let (weights, accelerations) = (dims.n_in() - 1 + n_weights, dims.n_in() - 1 + n_weights + m.n_v);
            let to = |c: usize| match c {
                c if c < weights => Some(c),
                c if c < accelerations && c + 1 < own.n_in() => Some(c + more_weights),
                c => Some(c + more),
            };
            let f: SharedFunction = Arc::new(Placed::new(f, Dims { p: own.p + more, ..own }, &to));
            f
        };
        let mut sources = vec![match before {
            0 => of_more(&m.smooth, weighted),
            n => place(&m.smooth, n, None),
        }];
        let mut terms: Vec<Vec<(usize, usize, f64)>> = (0..dims.x).map(|o| vec![(0, o, 1.0)]).collect();
        let mut first = before;
        let mut products = m.products.clone();
        for i in inclusions {
            i.rows.iter().enumerate().for_each(|(o, r)| terms[*r].push((sources.len(), o, 1.0)));
            sources.push(Arc::new(Weighed::new(&i.f, dims, n_switches, first)));
            for (c, entries) in i.f.hess_pattern().columns().filter(|c| (dims.x..i.f.dims().x).contains(&c.0)) {
                let rows = entries.map(|e| i.f.hess_pattern().row_idx()[e]).filter(|r| *r >= dims.x && *r < c);
                products.extend(rows.map(|r| [first + r - dims.x, first + c - dims.x]));
            }
            first += i.psi.n_out();
        }
        let smooth: SharedFunction = Arc::new(Combination::new(m.smooth.name().to_owned(), sources, terms));
        let inertia = match &m.inertia {
            Inertia::Constant(v) => {
                let entry =
                    |i: usize, j: usize| if i < m.n_v && j < m.n_v { v[i * m.n_v + j] } else { f64::from(i == j) };
                Inertia::Constant((0..wide * wide).map(|k| entry(k / wide, k % wide)).collect())
            }
            other => other.clone(),
        };
        let mut contacts: Vec<Contact> = m.contacts.iter().map(|c| widened(c, m, &place)).collect();
        let mut first = before;
        for (k, i) in inclusions.iter().enumerate() {
            for j in 0..i.psi.n_out() {
                let part = |is_motion: bool| -> SharedFunction {
                    Arc::new(StepSwitch::new(i, j, (m, &m.smooth, dims), (first, n_switches), is_motion))
                };
                let none = combination("no gap", dims, vec![Vec::new(), Vec::new()]);
                contacts.push(Contact {
                    name: format!("step {j} of inclusion {k}"),
                    kind: Kind::Switch,
                    stiction: false,
                    n_tangents: 1,
                    gap: none,
                    motion: part(true),
                    reaction: part(false),
                    local: None,
                });
            }
            first += i.psi.n_out();
        }
        Mechanics { n_v: wide, n_z: 0, n_switches, products, smooth, inertia, contacts, projection: None, ..m.clone() }
    }
}

/// A function that does not depend on the parameters behind those of the system.
fn of_more(f: &SharedFunction, dims: Dims) -> SharedFunction {
    let last = f.dims().n_in() - 1;
    let to = |c: usize| Some(if c == last { dims.n_in() - 1 } else { c });
    Arc::new(Placed::new(f, dims, &to))
}

/// A contact among more velocities and switches.
fn widened(
    c: &Contact,
    m: &Mechanics,
    place: &dyn Fn(&SharedFunction, usize, Option<usize>) -> SharedFunction,
) -> Contact {
    let (n_v, n_z) = (m.n_v, m.n_z);
    let weights = if c.kind == Kind::Switch { m.n_switches } else { 0 };
    let motion = if weights > 0 { place(&c.motion, weights, None) } else { c.motion.clone() };
    let reaction = place(&c.reaction, weights, Some(n_v));
    // zeros behind what there are `n_v` values of
    let padded = |f: SharedFunction, ends: &[usize]| if n_z == 0 { f } else { with_zeros(&f, ends, n_z) };
    let tangents = (0..c.n_tangents).map(|k| 3 + n_v + (k + 1) * (2 + n_v));
    let ends: Vec<usize> = std::iter::once(3 + n_v).chain(tangents).collect();
    let local = c.local.as_ref().map(|l| {
        let others = l.others.iter().map(|i| n_v + i);
        Local { velocities: l.velocities.iter().copied().chain(others).collect(), others: Vec::new(), ..l.clone() }
    });
    Contact { motion: padded(motion, &ends), reaction: padded(reaction, &[n_v]), local, ..c.clone() }
}

/// The function of an inclusion, of the weights of switches behind the parameters instead of steps behind the states.
struct Weighed {
    f: SharedFunction,
    dims: Dims,
    /// Own steps, and the place of the weight of the first of them among the parameters.
    n: usize,
    first: usize,
    jac: Pattern,
    places: Vec<usize>,
    hess: Pattern,
}

impl Weighed {
    fn new(f: &SharedFunction, own: Dims, n_switches: usize, first: usize) -> Weighed {
        let dims = Dims { p: own.p + n_switches, ..own };
        let n = f.dims().x - own.x;
        let of = columns(own, n, n_switches, own.p + first);
        let p = f.jac_pattern();
        let (rows, cols): (Vec<usize>, Vec<usize>) =
            p.columns().flat_map(|(c, e)| e.map(move |e| (e, c))).map(|(e, c)| (p.row_idx()[e], of(c))).unzip();
        let (jac, places) = Pattern::from_triplets(f.n_out(), dims.n_in(), &rows, &cols);
        Weighed {
            f: f.clone(),
            dims,
            n,
            first: own.p + first,
            jac,
            places,
            hess: Pattern::empty(dims.n_in(), dims.n_in()),
        }
    }
}

/// Where the inputs of the function of an inclusion with `n` steps stand where weights are parameters from `first` on.
fn columns(own: Dims, n: usize, n_switches: usize, first: usize) -> impl Fn(usize) -> usize {
    move |c| match c {
        c if c < own.x => c,
        c if c < own.x + n => own.x + own.u + first + c - own.x,
        c if c < n + own.n_in() - 1 => c - n,
        _ => own.n_in() - 1 + n_switches,
    }
}

/// The states and the steps of weights in the parameters.
fn with_steps(at: &Point, first: usize, n: usize, room: &mut [f64]) {
    room[..at.x.len()].copy_from_slice(at.x);
    room[at.x.len()..].iter_mut().zip(&at.p[first..first + n]).for_each(|(a, w)| *a = 0.5 * (1.0 + w));
}

impl Function for Weighed {
    fn name(&self) -> &str {
        self.f.name()
    }
    fn dims(&self) -> Dims {
        self.dims
    }
    fn n_out(&self) -> usize {
        self.f.n_out()
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        self.dims.x + self.n + self.f.jac_pattern().nnz() + self.f.work_len()
    }
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (x, work) = work.split_at_mut(self.dims.x + self.n);
        with_steps(at, self.first, self.n, x);
        let d = self.f.dims();
        self.f.value(&Point { x, p: &at.p[..d.p], ..*at }, out, work)
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let (x, work) = work.split_at_mut(self.dims.x + self.n);
        with_steps(at, self.first, self.n, x);
        let d = self.f.dims();
        let (own, work) = work.split_at_mut(self.f.jac_pattern().nnz());
        self.f.jacobian(&Point { x, p: &at.p[..d.p], ..*at }, own, work)?;
        for (c, entries) in self.f.jac_pattern().columns() {
            let scale = if (self.dims.x..d.x).contains(&c) { 0.5 } else { 1.0 };
            entries.for_each(|e| out[self.places[e]] = scale * own[e]);
        }
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        // functions of contacts are differentiated once
        Ok(())
    }
    fn is_serial(&self) -> bool {
        self.f.is_serial()
    }
    fn jacobian_is_approximate(&self) -> bool {
        self.f.jacobian_is_approximate()
    }
}

/// [`Contact::motion`] or [`Contact::reaction`] of a step that is a switch.
struct StepSwitch {
    f: SharedFunction,
    psi: SharedFunction,
    /// `q̇`, the first outputs.
    smooth: SharedFunction,
    rows: Vec<usize>,
    j: usize,
    own: Dims,
    n_q: usize,
    /// Velocities: all states behind the coordinates.
    n_v: usize,
    /// Place of the weight of the first step of the inclusion among the parameters; weights of all switches.
    first: usize,
    n_switches: usize,
    is_motion: bool,
    n_out: usize,
    jac: Pattern,
    places: Vec<usize>,
    hess: Pattern,
}

/// Values and derivatives that both are made of, by places of the functions' own patterns.
struct Parts {
    psi: f64,
    psi_jac: Vec<f64>,
    psi_hess: Vec<f64>,
    rates: Vec<f64>,
    rates_jac: Vec<f64>,
    f_jac: Vec<f64>,
    /// Second derivatives of every output of `f`.
    f_hess: Vec<Vec<f64>>,
    /// Accelerations, and the force along the column.
    a: Vec<f64>,
    force: f64,
}

impl StepSwitch {
    fn new(
        i: &Inclusion,
        j: usize,
        (m, smooth, own): (&Mechanics, &SharedFunction, Dims),
        (first, n_switches): (usize, usize),
        is_motion: bool,
    ) -> StepSwitch {
        let n_v = m.n_v + m.n_z;
        let n_out = if is_motion { Contact::switch_len(n_v, own.x) } else { n_v + 2 };
        let empty = || Pattern::empty(0, 0);
        let mut made = StepSwitch {
            f: i.f.clone(),
            psi: i.psi.clone(),
            smooth: smooth.clone(),
            rows: i.rows.clone(),
            j,
            own,
            n_q: m.n_q,
            n_v,
            first: own.p + first,
            n_switches,
            is_motion,
            n_out,
            jac: empty(),
            places: Vec::new(),
            hess: empty(),
        };
        let (mut rows, mut cols) = (Vec::new(), Vec::new());
        made.each_derivative(&made.room(), &mut |r, c, _| {
            rows.push(r);
            cols.push(c);
        });
        let n_in = made.dims().n_in();
        (made.jac, made.places) = Pattern::from_triplets(n_out, n_in, &rows, &cols);
        made.hess = Pattern::empty(n_in, n_in);
        made
    }

    /// Parameters behind the weights.
    fn n_given(&self) -> usize {
        if self.is_motion {
            0
        } else {
            self.n_v + 2
        }
    }

    fn room(&self) -> Parts {
        let f = &self.f;
        Parts {
            psi: 0.0,
            psi_jac: vec![0.0; self.psi.jac_pattern().nnz()],
            psi_hess: vec![0.0; self.psi.hess_pattern().nnz()],
            rates: vec![0.0; self.smooth.n_out()],
            rates_jac: vec![0.0; self.smooth.jac_pattern().nnz()],
            f_jac: vec![0.0; f.jac_pattern().nnz()],
            f_hess: vec![vec![0.0; f.hess_pattern().nnz()]; f.n_out()],
            a: vec![0.0; self.n_v],
            force: 0.0,
        }
    }

    /// Evaluates all parts at a point; second derivatives only if they are asked for.
    fn parts(&self, at: &Point, derivatives: bool) -> std::result::Result<Parts, crate::func::EvalError> {
        let mut out = self.room();
        let n = self.f.dims().x - self.own.x;
        let p = &at.p[..self.own.p];
        let plain = Point { p, ..*at };
        let mut work = vec![0.0; self.psi.work_len().max(self.f.work_len()).max(self.smooth.work_len())];
        let mut values = vec![0.0; self.psi.n_out()];
        self.psi.value(&plain, &mut values, &mut work)?;
        out.psi = values[self.j];
        self.psi.jacobian(&plain, &mut out.psi_jac, &mut work)?;
        let mut x = vec![0.0; self.own.x + n];
        with_steps(at, self.first, n, &mut x);
        let there = Point { x: &x, p, ..*at };
        self.f.jacobian(&there, &mut out.f_jac, &mut work)?;
        // rates of coordinates depend on no weight
        let mut given = p.to_vec();
        given.resize(self.smooth.dims().p, 0.0);
        let moving = Point { p: &given, ..*at };
        self.smooth.value_rows(&moving, 0..self.n_q, &mut out.rates, &mut work)?;
        if !self.is_motion {
            let behind = &at.p[self.own.p + self.n_switches..];
            out.a.copy_from_slice(&behind[..self.n_v]);
            out.force = behind[self.n_v + 1];
        }
        if derivatives {
            values.fill(0.0);
            values[self.j] = 1.0;
            self.psi.hessian(&plain, &values, &mut out.psi_hess, &mut work)?;
            self.smooth.jacobian_rows(&moving, 0..self.n_q, &mut out.rates_jac, &mut work)?;
            let mut weights = vec![0.0; self.f.n_out()];
            for (o, hess) in out.f_hess.iter_mut().enumerate() {
                weights.fill(0.0);
                weights[o] = 1.0;
                self.f.hessian(&there, &weights, hess, &mut work)?;
            }
        }
        Ok(out)
    }

    /// The input that column `c` of functions of the system is.
    fn column(&self, c: usize) -> usize {
        if c + 1 == self.own.n_in() {
            self.dims().n_in() - 1
        } else {
            c
        }
    }

    /// The first place of what stands behind a tangent in [`Contact::motion`].
    fn behind(&self) -> usize {
        Contact::motion_len(self.n_v, 1)
    }

    /// Calls `each(output, input, value)` for all derivatives, some of them more than once; the same ones in the same order at every point.
    fn each_derivative(&self, d: &Parts, each: &mut dyn FnMut(usize, usize, f64)) {
        let (own, n_q, n_v) = (self.own, self.n_q, self.n_v);
        let t = own.n_in() - 1;
        let gradient = self.row_of_psi(d);
        let given = own.x + own.u + own.p + self.n_switches;
        let rest_at = if self.is_motion { 4 + n_v } else { n_v + 1 };
        // of the function itself
        for (c, v) in &gradient {
            if self.is_motion {
                each(3 + n_v, self.column(*c), *v);
            } else if (n_q..n_q + n_v).contains(c) {
                each(n_v + 1, given + c - n_q, *v);
            }
            // q̇ turns
            if *c < n_q {
                let p = self.smooth.jac_pattern();
                for (col, entries) in p.columns() {
                    let last = col + 1 == p.n_cols();
                    for e in entries.filter(|e| p.row_idx()[*e] == *c) {
                        if last || col < own.n_in() - 1 {
                            each(rest_at, if last { self.column(t) } else { col }, v * d.rates_jac[e]);
                        }
                    }
                }
            }
        }
        // of its gradient
        let p = self.psi.hess_pattern();
        for (c, entries) in p.columns() {
            for e in entries {
                let r = p.row_idx()[e];
                let both = [(r, c), (c, r)];
                for (of, by) in both.into_iter().take(if r == c { 1 } else { 2 }) {
                    let (v, by) = (d.psi_hess[e], self.column(by));
                    if of < n_q {
                        each(rest_at, by, v * d.rates[of]);
                    } else if of == t {
                        each(rest_at, by, v);
                    }
                    let moves = (n_q..n_q + n_v).contains(&of);
                    match self.is_motion {
                        true if moves => each(5 + n_v + of - n_q, by, v),
                        false if moves => each(rest_at, by, v * d.a[of - n_q]),
                        _ => {}
                    }
                    if self.is_motion && (of < own.x || of == t) {
                        each(self.behind() + n_v + of.min(own.x), by, v);
                    }
                }
            }
        }
        // of the column that it pushes along
        let push = if self.is_motion { self.behind() } else { 0 };
        let scale = if self.is_motion { 1.0 } else { d.force };
        let n = self.f.dims().x - own.x;
        let of = columns(own, n, self.n_switches + self.n_given(), self.first);
        let (step, p) = (own.x + self.j, self.f.hess_pattern());
        for (c, entries) in p.columns() {
            for e in entries {
                let r = p.row_idx()[e];
                let Some(by) = (if r == step { Some(c) } else { (c == step).then_some(r) }) else { continue };
                let weight = if (own.x..own.x + n).contains(&by) { 0.5 } else { 1.0 };
                for (o, row) in self.rows.iter().enumerate() {
                    each(push + row - n_q, of(by), -0.5 * weight * scale * d.f_hess[o][e]);
                }
            }
        }
        if !self.is_motion {
            for (k, v) in self.push(d) {
                each(k, given + n_v + 1, v);
            }
        }
    }

    /// Derivatives of the switching function: inputs of the system, values.
    fn row_of_psi(&self, d: &Parts) -> Vec<(usize, f64)> {
        let p = self.psi.jac_pattern();
        let own = p.columns().flat_map(|(c, entries)| entries.map(move |e| (c, e)));
        own.filter(|(_, e)| p.row_idx()[*e] == self.j).map(|(c, e)| (c, d.psi_jac[e])).collect()
    }

    /// The column that it pushes along: velocities, values.
    fn push(&self, d: &Parts) -> Vec<(usize, f64)> {
        let p = self.f.jac_pattern();
        let entry = |e: usize| (self.rows[p.row_idx()[e]] - self.n_q, -0.5 * d.f_jac[e]);
        p.range(self.own.x + self.j).map(entry).collect()
    }
}

impl Function for StepSwitch {
    fn name(&self) -> &str {
        self.psi.name()
    }
    fn dims(&self) -> Dims {
        Dims { p: self.own.p + self.n_switches + self.n_given(), ..self.own }
    }
    fn n_out(&self) -> usize {
        self.n_out
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.hess
    }
    fn work_len(&self) -> usize {
        0
    }
    fn value(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let d = self.parts(at, false)?;
        let (n_q, n_v) = (self.n_q, self.n_v);
        let t = self.own.n_in() - 1;
        out.fill(0.0);
        let mut rest = 0.0;
        for (c, v) in self.row_of_psi(&d) {
            if c < n_q {
                rest += v * d.rates[c];
            } else if c == t {
                rest += v;
            } else if c < self.own.x {
                match self.is_motion {
                    true => out[5 + n_v + c - n_q] = v,
                    false => rest += v * d.a[c - n_q],
                }
            }
            if self.is_motion && (c < self.own.x || c == t) {
                out[self.behind() + n_v + c.min(self.own.x)] = v;
            }
        }
        if self.is_motion {
            (out[1], out[3 + n_v], out[4 + n_v]) = (1.0, d.psi, rest);
            self.push(&d).into_iter().for_each(|(k, v)| out[self.behind() + k] = v);
        } else {
            out[n_v + 1] = rest;
            self.push(&d).into_iter().for_each(|(k, v)| out[k] = v * d.force);
        }
        Ok(())
    }
    fn jacobian(&self, at: &Point, out: &mut [f64], _: &mut [f64]) -> EvalResult {
        let d = self.parts(at, true)?;
        out.fill(0.0);
        let mut places = self.places.iter();
        self.each_derivative(&d, &mut |_, _, v| {
            if let Some(k) = places.next() {
                out[*k] += v;
            }
        });
        Ok(())
    }
    fn hessian(&self, _: &Point, _: &[f64], _: &mut [f64], _: &mut [f64]) -> EvalResult {
        // functions of contacts are differentiated once
        Ok(())
    }
    fn is_serial(&self) -> bool {
        [&self.f, &self.psi, &self.smooth].iter().any(|f| f.is_serial())
    }
    fn jacobian_is_approximate(&self) -> bool {
        [&self.f, &self.psi].iter().any(|f| f.hessian_is_approximate() || f.jacobian_is_approximate())
    }
}
