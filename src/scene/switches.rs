//! Switches of forces and of rates of further states, as parts of the contact problem.
//!
//! ```text
//! M v̇ = f(…, w) + contact forces,    ż = h(…, w),    w_k ∈ Sign ψ_k(q, v, z, u, p, t)
//! ```
//!
//! `f` and `h` are affine in every weight alone. A switch is told like dry friction at a joint: where `ψ_k ≠ 0` its weight is given, and where
//! `ψ_k` stays at zero the weight is found together with the contact forces, from `ψ̇_k = 0`. The weights of products of switches at one
//! time would not be the solution of a linear problem; they are named, and refused where they meet.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::shape::Frame;
use super::{Builder, Built, Scene};
use crate::error::{Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id};
use crate::func::Dims;
use crate::system::{Contact, Kind, SharedFunction};

/// Forces and rates of further states with their switches.
pub(super) struct Switching {
    /// Forces, then rates of further states, affine in the weight of every switch alone.
    rhs: Vec<Id>,
    switches: Vec<Switch>,
    /// Pairs of switches that multiply each other.
    products: Vec<[usize; 2]>,
}

struct Switch {
    name: String,
    psi: Id,
    /// The derivatives of `rhs` with respect to its weight.
    column: Vec<Id>,
}

impl Scene {
    /// The same scene with states beside coordinates and velocities as velocities of unit inertia, which nothing but forces depends on.
    fn widened(&self, dag: &mut Dag) -> Scene {
        let (n_v, n_z) = (self.n_v, self.states.len());
        if n_z == 0 {
            return self.clone();
        }
        let (zero, one) = (dag.constant(0.0), dag.constant(1.0));
        let n = n_v + n_z;
        let entry = |m: &Vec<Id>, i: usize, j: usize| match (i < n_v && j < n_v, i == j) {
            (true, _) => m[i * n_v + j],
            (false, true) => one,
            (false, false) => zero,
        };
        let inertia = self.inertia.as_ref().map(|m| (0..n * n).map(|k| entry(m, k / n, k % n)).collect());
        let rates = self.rates.clone().unwrap_or_else(|| dag.inputs(Block::X, self.n_q + n_v).split_off(self.n_q));
        let driven = n_z - self.discrete.len();
        let still = std::iter::repeat_n(Some(zero), self.discrete.len());
        let force = self.force.iter().chain(&self.states[..driven]).copied().chain(still).collect();
        Scene { n_v: n, states: Vec::new(), rates: Some(rates), inertia, force, beside: n_z, ..self.clone() }
    }
}

impl Builder<'_> {
    /// The switches of forces and of rates of further states, none where nothing switches.
    pub(super) fn switching(&mut self, force: &[Id]) -> Result<Option<Switching>> {
        let s = self.scene;
        let known = |h: &Option<Id>| *h;
        let mut rhs = force.to_vec();
        rhs.extend(s.states.iter().filter_map(known));
        if self.dag.switches_of(&rhs).is_empty() {
            return Ok(None);
        }
        rhs.truncate(force.len());
        rhs.extend(self.state_rates()?);
        let Some(rhs) = self.dag.smooth_switches(&rhs)? else {
            return Err(Error::Unsupported(format!(
                "{}: switching functions of forces contain so many switches themselves that they cannot be told apart: write fewer \
                 choices inside of choices",
                s.name
            )));
        };
        let numbers = self.dag.switches_of(&rhs);
        let weighted = self.dag.with_signs(&rhs, &numbers);
        // the weights in [0, 1] of conditions become signs, which are parameters behind those of the scene
        let (one, half) = (self.dag.constant(1.0), self.dag.constant(0.5));
        let signs: Vec<Id> = (0..numbers.len()).map(|k| self.dag.input(Block::P, s.np + k)).collect();
        let mut by = BTreeMap::new();
        for (k, &w) in signs.iter().enumerate() {
            let weight = self.dag.input(Block::Weight, k);
            let shifted = self.dag.add(one, w);
            by.insert(weight, self.dag.mul(half, shifted));
        }
        let mut rhs = self.dag.replace(&weighted, &by);
        for &w in &signs {
            rhs = self.affine_in(&rhs, w)?;
        }
        let entries = self.dag.jacobian(&rhs, &signs)?;
        let zero = self.dag.constant(0.0);
        let mut columns = vec![vec![zero; rhs.len()]; signs.len()];
        entries.iter().for_each(|e| columns[e.col][e.row] = e.value);
        let mut products = Vec::new();
        for (k, column) in columns.iter().enumerate() {
            let coupled = self.dag.jacobian(column, &signs)?;
            products.extend(coupled.iter().filter(|e| e.col > k).map(|e| [k, e.col]));
        }
        products.sort_unstable();
        products.dedup();
        let switch = |(&number, column): (&usize, Vec<Id>)| {
            let psi = self.dag.switching_function(number).unwrap_or(zero);
            Switch { name: format!("switch at {} = 0", self.text(psi)), psi, column }
        };
        let switches = numbers.iter().zip(columns).map(switch).collect();
        Ok(Some(Switching { rhs, switches, products }))
    }

    /// The expressions affine in a weight that have the same values where it is 1 and -1.
    fn affine_in(&mut self, roots: &[Id], w: Id) -> Result<Vec<Id>> {
        let slopes: Vec<Id> = self.dag.jacobian(roots, &[w])?.iter().map(|e| e.value).collect();
        if self.dag.jacobian(&slopes, &[w])?.is_empty() {
            return Ok(roots.to_vec());
        }
        let (one, minus, half) = (self.dag.constant(1.0), self.dag.constant(-1.0), self.dag.constant(0.5));
        let plus = self.dag.replace(roots, &BTreeMap::from([(w, one)]));
        let less = self.dag.replace(roots, &BTreeMap::from([(w, minus)]));
        let mut out = Vec::with_capacity(roots.len());
        for (a, b) in plus.into_iter().zip(less) {
            let (sum, difference) = (self.dag.add(a, b), self.dag.sub(a, b));
            let odd = self.dag.mul(w, difference);
            let both = self.dag.add(sum, odd);
            out.push(self.dag.mul(half, both));
        }
        Ok(out)
    }

    /// The system of a scene that switches.
    pub(super) fn build_switching(self, rates: &[Id], all: Switching) -> Result<Built> {
        let stated = self.scene;
        let wide = stated.widened(self.dag);
        let mut b = Builder { alike: self.alike, ..Builder::new(&wide, self.dag) };
        let (dims, n) = (wide.dims(), all.switches.len());
        let mut smooth = rates.to_vec();
        smooth.extend_from_slice(&all.rhs);
        let smooth = b.function("smooth", Dims { p: dims.p + n, ..dims }, &smooth)?;
        let mut switches = Vec::with_capacity(n);
        for s in &all.switches {
            let shape = switch(&mut b.frame(), s, rates, n)?;
            switches.push(shape);
        }
        b.assemble(stated, rates.to_vec(), all.rhs, switches, Some((smooth, all.products)))
    }
}

/// A switch as a part of the contact problem.
fn switch(f: &mut Frame, s: &Switch, rates: &[Id], n_switches: usize) -> Result<Contact> {
    let (n_v, dims) = (f.n_v, f.dims);
    let weighted = Dims { p: dims.p + n_switches, ..dims };
    let (zero, one) = (f.dag.constant(0.0), f.dag.constant(1.0));
    let push: Vec<Id> = s.column.iter().map(|c| f.dag.neg(*c)).collect();
    let v = f.velocities();
    let along = f.dag.dense_jacobian(&[s.psi], &v)?;
    let rest = f.along_motion(s.psi, rates)?;
    let mut inputs = f.dag.inputs(Block::X, dims.x);
    inputs.push(f.dag.input(Block::T, 0));
    let gradient = f.dag.dense_jacobian(&[s.psi], &inputs)?;
    let mut motion = vec![zero, one, zero];
    motion.resize(3 + n_v, zero);
    motion.extend([s.psi, rest]);
    motion.extend_from_slice(&along);
    motion.extend_from_slice(&push);
    motion.extend(gradient);
    let a: Vec<Id> = (0..n_v).map(|i| f.dag.input(Block::P, weighted.p + i)).collect();
    let force = f.dag.input(Block::P, weighted.p + n_v + 1);
    let mut reaction: Vec<Id> = push.iter().map(|p| f.dag.mul(*p, force)).collect();
    let moved = f.dag.dot(&along, &a)?;
    let rate = f.dag.add(moved, rest);
    reaction.extend([zero, rate]);
    let mut function = |name: &str, dims: Dims, outputs: &[Id]| -> Result<SharedFunction> {
        Ok(Arc::new(ExprFunction::first_order(name, f.dag, dims, outputs)?))
    };
    Ok(Contact {
        gap: function("no gap", dims, &[zero, zero])?,
        motion: function(&format!("motion of the {}", s.name), weighted, &motion)?,
        reaction: function(
            &format!("reaction of the {}", s.name),
            Dims { p: weighted.p + n_v + 2, ..weighted },
            &reaction,
        )?,
        name: s.name.clone(),
        kind: Kind::Switch,
        stiction: false,
        n_tangents: 1,
        local: None,
    })
}
