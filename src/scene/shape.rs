//! A contact as functions of what it touches.
//!
//! What a contact depends on is copied to a graph of its own and differentiated there: the work for a contact does not grow
//! with the scene, and contacts whose copies are equal, as of bodies alike, share their functions.

use std::sync::{Arc, OnceLock};

use super::embedded::Embedded;
use super::{Scene, Stated};
use crate::error::{Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id, Node, SavedGraph};
use crate::func::{Dims, Function};
use crate::system::{self, Kind, Local, Order, SharedFunction};

/// Systems with so many states, and fewer, have functions of all of them: to pick a few of them out takes longer.
const FEW: usize = 16;

/// A scalar quantity of `q` and `t`, its rate, and the parts of its second derivative: `ṙ = aᵀ v̇ + rest`.
pub(super) struct Motion {
    rate: Id,
    along: Vec<Id>,
    rest: Id,
}

/// A graph with coordinates and velocities.
pub(super) struct Frame<'a> {
    pub(super) dag: &'a mut Dag,
    pub(super) n_q: usize,
    pub(super) n_v: usize,
    pub(super) dims: Dims,
}

impl Frame<'_> {
    pub(super) fn velocities(&mut self) -> Vec<Id> {
        (0..self.n_v).map(|i| self.dag.input(Block::X, self.n_q + i)).collect()
    }

    /// Is an expression linear in the velocities?
    pub(super) fn is_linear(&mut self, id: Id) -> Result<bool> {
        let v = self.velocities();
        let all: Vec<Id> = self.dag.jacobian(&[id], &v)?.iter().map(|e| e.value).collect();
        Ok(self.dag.jacobian(&all, &v)?.is_empty())
    }

    /// Derivative along the motion of something that depends on coordinates, velocities and time: that part of it that the
    /// accelerations have nothing to do with.
    pub(super) fn along_motion(&mut self, id: Id, rates: &[Id]) -> Result<Id> {
        let mut wrt: Vec<Id> = (0..self.n_q).map(|i| self.dag.input(Block::X, i)).collect();
        wrt.push(self.dag.input(Block::T, 0));
        let mut sum = self.dag.constant(0.0);
        for e in self.dag.jacobian(&[id], &wrt)? {
            let term = match rates.get(e.col) {
                Some(&r) => self.dag.mul(e.value, r),
                None => e.value,
            };
            sum = self.dag.add(sum, term);
        }
        Ok(sum)
    }

    /// Of something whose rate is `rate`.
    fn motion(&mut self, rate: Id, rates: &[Id]) -> Result<Motion> {
        let v = self.velocities();
        let along = self.dag.dense_jacobian(&[rate], &v)?;
        let rest = self.along_motion(rate, rates)?;
        Ok(Motion { rate, along, rest })
    }

    fn depends(&self, id: Id, from: usize) -> bool {
        let all = self.dag.reachable(&[id]);
        all.iter().any(|&n| matches!(self.dag.node(n), Node::Input(Block::X, i) if i as usize >= from))
    }

    fn values(&mut self, name: &str, dims: Dims, outputs: &[Id]) -> Result<SharedFunction> {
        Ok(Arc::new(ExprFunction::values(name, self.dag, dims, outputs)?))
    }

    fn function(&mut self, name: &str, dims: Dims, outputs: &[Id]) -> Result<SharedFunction> {
        Ok(Arc::new(ExprFunction::first_order(name, self.dag, dims, outputs)?))
    }

    /// The sliding velocity that a tangent stands for: its rate, or itself where it contains velocities.
    fn sliding(&mut self, k: usize, tangent: Id, rates: &[Id]) -> std::result::Result<Motion, Flaw> {
        let rate = if !self.depends(tangent, self.n_q) {
            self.along_motion(tangent, rates)?
        } else if self.is_linear(tangent)? {
            tangent
        } else {
            return Err(Flaw::Tangent(k, "must be linear in the velocities"));
        };
        Ok(self.motion(rate, rates)?)
    }

    fn reaction(&mut self, name: &str, motions: &[&Motion]) -> Result<SharedFunction> {
        let (n_v, dims) = (self.n_v, self.dims);
        let a: Vec<Id> = (0..n_v).map(|i| self.dag.input(Block::P, dims.p + i)).collect();
        let mut out = vec![self.dag.constant(0.0); n_v];
        for (k, m) in motions.iter().enumerate() {
            let force = self.dag.input(Block::P, dims.p + n_v + k);
            for (o, n) in out.iter_mut().zip(&m.along) {
                let term = self.dag.mul(*n, force);
                *o = self.dag.add(*o, term);
            }
        }
        for m in motions {
            let along = self.dag.dot(&m.along, &a)?;
            out.push(self.dag.add(along, m.rest));
        }
        let dims = Dims { p: dims.p + n_v + motions.len(), ..dims };
        self.function(name, dims, &out)
    }

    /// The contact as functions of the states that occur in it.
    fn local(&mut self, name: &str, gap: Id, parts: &Parts, motions: &[&Motion]) -> Result<Local> {
        let (n_q, n_v, dims) = (self.n_q, self.n_v, self.dims);
        let zero = self.dag.constant(0.0);
        let along = || motions.iter().map(|m| &m.along);
        let mut all = vec![gap, parts.friction, parts.restitution];
        all.extend(parts.stiction);
        all.extend(motions.iter().map(|m| m.rate));
        all.extend(along().flatten().filter(|a| **a != zero));
        let mut touched: Vec<usize> = Vec::new();
        for id in self.dag.reachable(&all) {
            if let Node::Input(Block::X, i) = self.dag.node(id) {
                touched.push(i as usize);
            }
        }
        touched.extend(along().flat_map(|a| (0..a.len()).filter(|&i| a[i] != zero).map(|i| n_q + i)));
        touched.sort_unstable();
        touched.dedup();
        let velocities: Vec<usize> =
            touched.iter().filter(|&&i| (n_q..n_q + n_v).contains(&i)).map(|i| i - n_q).collect();
        let mut rows = Vec::new();
        for (k, m) in motions.iter().enumerate() {
            rows.push(m.rate);
            if k == 0 {
                rows.extend([parts.friction, parts.restitution]);
            }
            rows.extend(velocities.iter().map(|&i| m.along[i]));
        }
        rows.extend(parts.stiction);
        let place = |block: Block, i: usize| match block {
            Block::X => touched.binary_search(&i).unwrap_or(i),
            _ => i,
        };
        let (gap, rows) = (self.dag.renumber(&[gap], &place), self.dag.renumber(&rows, &place));
        let dims = Dims { x: touched.len(), ..dims };
        let gap = self.values(&format!("gap of {name} and contacts alike"), dims, &gap)?;
        let rows = self.values(&format!("normal and tangents of {name} and contacts alike"), dims, &rows)?;
        let coordinates = touched.iter().copied().filter(|i| *i < n_q).collect();
        let others = touched.iter().filter_map(|i| i.checked_sub(n_q + n_v)).collect();
        Ok(Local { coordinates, velocities, others, gap, separation: None, rows })
    }
}

/// What is wrong with a contact.
pub(super) enum Flaw {
    /// Its gap does not depend on anything that moves.
    Gap,
    /// It contains velocities and is not linear in them.
    Linear,
    /// Something of this tangent.
    Tangent(usize, &'static str),
    Other(Error),
}

impl From<Error> for Flaw {
    fn from(e: Error) -> Flaw {
        Flaw::Other(e)
    }
}

/// The expressions of a contact, and the rates of the coordinates.
pub(super) struct Parts {
    pub(super) kind: Kind,
    /// The gap; of a constraint what is zero.
    pub(super) gap: Id,
    pub(super) friction: Id,
    pub(super) restitution: Id,
    pub(super) tangents: Vec<Id>,
    pub(super) stiction: Option<Id>,
    pub(super) rates: Vec<Id>,
}

/// Where some coordinates and velocities stand among all.
#[derive(Clone)]
pub(super) struct Places {
    coordinates: Vec<usize>,
    velocities: Vec<usize>,
    /// States beside these.
    others: Vec<usize>,
    /// Number of all coordinates, velocities and others.
    sizes: [usize; 3],
}

impl Places {
    pub(super) fn all(sizes: [usize; 3]) -> Places {
        let [coordinates, velocities, others] = sizes.map(|n| (0..n).collect());
        Places { coordinates, velocities, others, sizes }
    }

    fn is_all(&self) -> bool {
        [self.coordinates.len(), self.velocities.len(), self.others.len()] == self.sizes
    }

    fn states(&self) -> Vec<u32> {
        let velocities = self.velocities.iter().map(|v| self.sizes[0] + v);
        let others = self.others.iter().map(|z| self.sizes[0] + self.sizes[1] + z);
        self.coordinates.iter().copied().chain(velocities).chain(others).map(|i| i as u32).collect()
    }
}

/// What a contact depends on, copied.
pub(super) struct Excerpt {
    graph: SavedGraph,
    kind: Kind,
    n_tangents: usize,
    stiction: bool,
    pub(super) places: Places,
}

impl Excerpt {
    /// Copies the gap, friction, restitution, tangents and stiction of a contact, and the rates of all coordinates that occur in these,
    /// in rates of such coordinates, and so on.
    pub(super) fn new(dag: &Dag, s: &Scene, stated: &Stated, rates: &[Id]) -> Result<Excerpt> {
        let (n_q, n_v) = s.sizes();
        let c = &stated.contact;
        let (kind, n_tangents, stiction) = (stated.kind, c.tangents.len(), stated.stiction.is_some());
        let mut roots = vec![c.gap, c.friction, c.restitution];
        roots.extend_from_slice(&c.tangents);
        roots.extend(stated.stiction);
        let own = roots.len();
        let sizes = [n_q, n_v, s.n_states()];
        let mut places = if sizes.iter().sum::<usize>() <= FEW || s.order == Order::First {
            roots.extend_from_slice(rates);
            Places::all(sizes)
        } else {
            Places { coordinates: Vec::new(), velocities: Vec::new(), others: Vec::new(), sizes }
        };
        loop {
            let graph = SavedGraph::new(dag, &roots)?;
            if places.is_all() {
                return Ok(Excerpt { graph, kind, n_tangents, stiction, places });
            }
            let mut states: Vec<usize> = graph.inputs().filter(|i| i.0 == Block::X).map(|i| i.1).collect();
            states.sort_unstable();
            let split = states.partition_point(|i| *i < n_q);
            let complete = places.coordinates == states[..split];
            let mut rest = states.split_off(split);
            let behind = rest.split_off(rest.partition_point(|i| *i < n_q + n_v));
            places.velocities = rest.into_iter().map(|i| i - n_q).collect();
            places.others = behind.into_iter().map(|i| i - n_q - n_v).collect();
            places.coordinates = states;
            if complete {
                let at = places.states();
                let number = |block: Block, i: usize| match block {
                    Block::X => at.binary_search(&(i as u32)).unwrap_or(i),
                    _ => i,
                };
                let graph = graph.renumbered(&number);
                return Ok(Excerpt { graph, kind, n_tangents, stiction, places });
            }
            roots.truncate(own);
            roots.extend(places.coordinates.iter().map(|&j| rates[j]));
        }
    }

    /// Contacts with the same key have the same functions. Those of all states keep their names in messages.
    pub(super) fn key(&self, name: &str) -> String {
        let name = if self.places.is_all() { name } else { "" };
        let Places { coordinates, velocities, others, .. } = &self.places;
        let (kind, n_t, sticks) = (self.kind, self.n_tangents, self.stiction);
        let (q, v, z) = (coordinates.len(), velocities.len(), others.len());
        format!("{name} {q} {v} {z} {kind:?} {n_t} {sticks} {:?}", self.graph)
    }

    /// The functions; `dims` are the sizes of the system, and `functions` those that expressions may call.
    pub(super) fn shape(
        &self,
        functions: &[Arc<dyn Function>],
        order: Order,
        name: &str,
        dims: Dims,
    ) -> std::result::Result<Arc<Shape>, Flaw> {
        let mut dag = Dag::new();
        let ids = self.graph.restore(&mut dag, functions)?;
        let (own, rates) = ids.split_at(3 + self.n_tangents + usize::from(self.stiction));
        let (tangents, stiction) = own[3..].split_at(self.n_tangents);
        let parts = Parts {
            kind: self.kind,
            gap: own[0],
            friction: own[1],
            restitution: own[2],
            tangents: tangents.to_vec(),
            stiction: stiction.first().copied(),
            rates: rates.to_vec(),
        };
        let (n_q, n_v) = (self.places.coordinates.len(), self.places.velocities.len());
        let x = n_q + n_v + self.places.others.len();
        let mut frame = Frame { dag: &mut dag, n_q, n_v, dims: Dims { x, ..dims } };
        Shape::new(&mut frame, order, name, &parts).map(Arc::new)
    }
}

/// The functions of a contact, of the states it depends on.
pub(super) struct Shape {
    kind: Kind,
    n_tangents: usize,
    stiction: bool,
    gap: SharedFunction,
    motion: SharedFunction,
    reaction: SharedFunction,
    local: Option<Local>,
}

impl Shape {
    pub(super) fn new(f: &mut Frame, order: Order, name: &str, c: &Parts) -> std::result::Result<Shape, Flaw> {
        let zero = f.dag.constant(0.0);
        let first_order = order == Order::First;
        let moves = c.kind == Kind::Bilateral && f.depends(c.gap, f.n_q);
        // what of the gap is a length: a constraint on velocities has none
        let mut length = c.gap;
        let normal = if c.kind == Kind::Joint {
            Motion { rate: zero, along: vec![zero; f.n_v], rest: zero }
        } else if moves {
            if !f.is_linear(c.gap)? {
                return Err(Flaw::Linear);
            }
            length = zero;
            f.motion(c.gap, &c.rates)?
        } else if first_order {
            // the gradient with respect to the states is the normal, and what is left of the rate is the derivative with
            // respect to time
            let v = f.velocities();
            let along = f.dag.dense_jacobian(&[c.gap], &v)?;
            let rest = f.along_motion(c.gap, &[])?;
            Motion { rate: c.gap, along, rest }
        } else {
            let rate = f.along_motion(c.gap, &c.rates)?;
            f.motion(rate, &c.rates)?
        };
        if c.kind != Kind::Joint && normal.along.iter().all(|n| *n == zero) {
            return Err(Flaw::Gap);
        }
        let mut motions = vec![normal];
        for (k, &tangent) in c.tangents.iter().enumerate() {
            let m = f.sliding(k, tangent, &c.rates)?;
            if m.along.iter().all(|b| *b == zero) {
                return Err(Flaw::Tangent(k, "does not depend on anything that moves"));
            }
            if motions.iter().any(|o| o.along == m.along) {
                return Err(Flaw::Tangent(k, "has the direction of the normal or of the other tangent"));
            }
            motions.push(m);
        }
        let all: Vec<&Motion> = motions.iter().collect();
        let (what, rate) = if first_order { ("constraint", zero) } else { ("gap of", motions[0].rate) };
        let gap = f.function(&format!("{what} {name}"), f.dims, &[length, rate])?;
        let mut motion = vec![motions[0].rest, c.friction, c.restitution];
        motion.extend_from_slice(&motions[0].along);
        for m in &motions[1..] {
            motion.extend_from_slice(&[m.rate, m.rest]);
            motion.extend_from_slice(&m.along);
        }
        motion.extend(c.stiction);
        let motion = f.function(&format!("motion of {name}"), f.dims, &motion)?;
        let reaction = f.reaction(&format!("reaction of {name}"), &all)?;
        let local = if first_order { None } else { Some(f.local(name, length, c, &all)?) };
        let (kind, stiction) = (c.kind, c.stiction.is_some());
        Ok(Shape { kind, n_tangents: c.tangents.len(), stiction, gap, motion, reaction, local })
    }

    /// The contact whose states stand at these places, in a system of these sizes.
    pub(super) fn contact(&self, name: &str, at: &Places, dims: Dims) -> system::Contact {
        let n = self.n_tangents;
        let local = self.local.as_ref().map(|l| Local {
            coordinates: l.coordinates.iter().map(|&i| at.coordinates[i]).collect(),
            velocities: l.velocities.iter().map(|&i| at.velocities[i]).collect(),
            others: l.others.iter().map(|&i| at.others[i]).collect(),
            ..l.clone()
        });
        let name = name.to_owned();
        let (kind, stiction) = (self.kind, self.stiction);
        if at.is_all() {
            let (gap, motion, reaction) = (self.gap.clone(), self.motion.clone(), self.reaction.clone());
            return system::Contact { name, kind, stiction, n_tangents: n, gap, motion, reaction, local };
        }
        let (n_v, np) = (at.sizes[1], dims.p);
        let along = |from: usize| at.velocities.iter().map(move |v| (from + v) as u32);
        let parameters: Vec<u32> = (0..np as u32).collect();
        let mut rows: Vec<u32> = (0..3).chain(along(3)).collect();
        for k in 0..n {
            let from = 3 + n_v + k * (2 + n_v);
            rows.extend((from as u32..from as u32 + 2).chain(along(from + 2)));
        }
        let length = system::Contact::motion_len(n_v, n);
        rows.extend(stiction.then_some(length as u32));
        let forces = |from: usize| from as u32..(from + 1 + n) as u32;
        let reaction: Vec<u32> = along(0).chain(forces(n_v)).collect();
        let given: Vec<u32> = parameters.iter().copied().chain(along(np)).chain(forces(np + n_v)).collect();
        let embed = |what: &str, inner: &SharedFunction, p: Vec<u32>, out: Vec<u32>, dims: Dims, n_out: usize| {
            Arc::new(Embedded {
                name: format!("{what} of {name}"),
                inner: inner.clone(),
                dims,
                n_out,
                x: at.states(),
                p,
                out,
                patterns: OnceLock::new(),
            })
        };
        let extended = Dims { p: np + n_v + 1 + n, ..dims };
        system::Contact {
            gap: embed("gap", &self.gap, parameters.clone(), vec![0, 1], dims, 2),
            motion: embed("motion", &self.motion, parameters, rows, dims, length + usize::from(stiction)),
            reaction: embed("reaction", &self.reaction, given, reaction, extended, n_v + 1 + n),
            name,
            kind,
            stiction,
            n_tangents: n,
            local,
        }
    }
}
