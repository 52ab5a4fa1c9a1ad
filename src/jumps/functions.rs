//! The functions of a scene that its programs are made of, with second derivatives.
//!
//! Simulation needs first derivatives of equations of motion and contacts, so that is what a scene has; optimisation needs
//! second ones. They are built here, once per control problem, from the expressions behind the functions of the scene.

use std::sync::Arc;

use crate::error::{Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id};
use crate::func::Dims;
use crate::scene::expressions_of;
use crate::system::{Inertia, Mechanics, Order, SharedFunction};

/// Functions of one contact. `x` is the state, `p` the parameters; `a`, `λ`, `τ` (accelerations, normal force, friction
/// force) stand behind the parameters in this order, in all functions that know forces.
#[derive(Clone)]
pub(super) struct ContactFunctions {
    pub(super) name: String,
    /// Tangents: none, or one.
    pub(super) n_tangents: usize,
    /// The gap.
    pub(super) gap: SharedFunction,
    /// Rate of the gap.
    pub(super) rate: SharedFunction,
    /// Sliding velocity, of a contact with a tangent.
    pub(super) slide: Option<SharedFunction>,
    /// `n λ + B τ`, `n_v` outputs; knows forces.
    pub(super) push: SharedFunction,
    /// `g̈`, and `ṡ` with a tangent; knows forces.
    pub(super) accelerate: SharedFunction,
    /// `μλ − τ`, `μλ + τ` with a tangent; knows forces.
    pub(super) cone: Option<SharedFunction>,
    /// `ġ(q, v⁺) + e ġ(q, v⁻)` as a function of the state `(q, v⁻, v⁺)`.
    pub(super) rebound: SharedFunction,
    /// `μ ∇g` with respect to the coordinates, `n_q` outputs; `μ` stands behind the parameters.
    pub(super) shift: SharedFunction,
    /// `e`.
    pub(super) restitution: SharedFunction,
}

/// Functions of a scene.
#[derive(Clone)]
pub(super) struct SceneFunctions {
    pub(super) n_q: usize,
    /// Velocities, and behind them the further states of the scene, as velocities of unit inertia that no contact pushes.
    pub(super) n_v: usize,
    /// These further states.
    pub(super) n_z: usize,
    /// `N v`, then `f_v`.
    pub(super) smooth: SharedFunction,
    /// `M a`; `a` stands behind the parameters.
    pub(super) momentum: SharedFunction,
    pub(super) contacts: Vec<ContactFunctions>,
    /// Does anything depend on time?
    pub(super) knows_time: bool,
    /// Are velocities the rates of the coordinates, `N = I`?
    pub(super) plain: bool,
}

impl SceneFunctions {
    /// Velocities without the further states behind them.
    pub(super) fn n_own(&self) -> usize {
        self.n_v - self.n_z
    }

    /// Of the equations of motion of a system with these sizes.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for projected systems, friction in space, and functions that are no expressions.
    pub(super) fn new(m: &Mechanics, dims: Dims) -> Result<SceneFunctions> {
        if m.order == Order::First {
            return Err(Error::Unsupported(
                "optimal control of projected systems and sweeping processes is not there: the states would stand for \
                 velocities"
                    .into(),
            ));
        }
        m.check_contacts("optimal control")?;
        if let Some(c) = m.contacts.iter().find(|c| c.n_tangents > 1) {
            return Err(Error::Unsupported(format!(
                "contact {} has friction in space, which optimal control does not know: give it one tangent, or none",
                c.name
            )));
        }
        let mut dag = Dag::new();
        let mut make = Maker { dag: &mut dag, n_q: m.n_q, n_v: m.n_v, n_z: m.n_z, dims };
        let roots = make.load(&m.smooth)?;
        let plain = m.n_q == m.n_v && (0..m.n_q).all(|i| roots[i] == make.dag.input(Block::X, m.n_q + i));
        let smooth = make.function("equations of motion", dims, &roots)?;
        let momentum = make.momentum(&m.inertia)?;
        let contacts: Vec<ContactFunctions> = m.contacts.iter().map(|c| make.contact(c)).collect::<Result<_>>()?;
        let mut all = SceneFunctions {
            n_q: m.n_q,
            n_v: m.n_v + m.n_z,
            n_z: m.n_z,
            smooth,
            momentum,
            contacts,
            knows_time: false,
            plain,
        };
        let knows_time = all.iter().any(|f| !f.jac_pattern().rows(f.dims().t_col()).is_empty());
        all.knows_time = knows_time;
        Ok(all)
    }

    fn iter(&self) -> impl Iterator<Item = &SharedFunction> {
        [&self.smooth, &self.momentum].into_iter().chain(self.contacts.iter().flat_map(|c| {
            [Some(&c.gap), Some(&c.rate), Some(&c.push), Some(&c.rebound), c.slide.as_ref(), c.cone.as_ref()]
                .into_iter()
                .flatten()
        }))
    }
}

/// Builds functions in one graph, which shares what they have in common.
struct Maker<'a> {
    dag: &'a mut Dag,
    n_q: usize,
    n_v: usize,
    n_z: usize,
    dims: Dims,
}

impl Maker<'_> {
    fn load(&mut self, f: &SharedFunction) -> Result<Vec<Id>> {
        expressions_of(self.dag, f.as_ref()).unwrap_or_else(|| {
            Err(Error::Unsupported(format!(
                "function '{}' of the scene is not made of expressions: optimal control needs its second derivatives",
                f.name()
            )))
        })
    }

    fn function(&mut self, name: &str, dims: Dims, outputs: &[Id]) -> Result<SharedFunction> {
        Ok(Arc::new(ExprFunction::new(name, self.dag, dims, outputs)?))
    }

    fn momentum(&mut self, inertia: &Inertia) -> Result<SharedFunction> {
        let (n, first) = (self.n_v, self.dims.p);
        let dims = Dims { p: first + n + self.n_z, ..self.dims };
        let mut outputs = match inertia {
            Inertia::Varying { product, .. } => self.load(product)?,
            Inertia::Identity => (0..n).map(|i| self.dag.input(Block::P, first + i)).collect(),
            Inertia::Constant(m) => {
                let mut out = Vec::with_capacity(n);
                for i in 0..n {
                    let mut sum = self.dag.constant(0.0);
                    for j in 0..n {
                        let (k, a) = (self.dag.constant(m[i * n + j]), self.dag.input(Block::P, first + j));
                        let term = self.dag.mul(k, a);
                        sum = self.dag.add(sum, term);
                    }
                    out.push(sum);
                }
                out
            }
        };
        outputs.extend((n..n + self.n_z).map(|i| self.dag.input(Block::P, first + i)));
        self.function("momentum", dims, &outputs)
    }

    fn contact(&mut self, c: &crate::system::Contact) -> Result<ContactFunctions> {
        let (own, dims, name) = (self.n_v, self.dims, &c.name);
        let n_v = own + self.n_z;
        let forces = Dims { p: dims.p + n_v + 1 + c.n_tangents, ..dims };
        let gap = self.load(&c.gap)?;
        let motion = self.load(&c.motion)?;
        let reaction = self.load(&c.reaction)?;
        // rates of the further states stand between accelerations and forces
        let n_z = self.n_z;
        let reaction = self.dag.renumber(&reaction, &|block, i| match block {
            Block::P if i >= dims.p + own => i + n_z,
            _ => i,
        });
        let mut push = reaction[..own].to_vec();
        push.resize(n_v, self.dag.constant(0.0));
        let (friction, e) = (motion[1], motion[2]);
        let slide = (c.n_tangents > 0).then(|| motion[3 + own]);
        let lambda = self.dag.input(Block::P, dims.p + n_v);
        let cone = if c.n_tangents > 0 {
            let tau = self.dag.input(Block::P, dims.p + n_v + 1);
            let most = self.dag.mul(friction, lambda);
            let both = [self.dag.sub(most, tau), self.dag.add(most, tau)];
            Some(self.function(&format!("friction of {name}"), forces, &both)?)
        } else {
            None
        };
        let n_q = self.n_q;
        let later = self.dag.renumber(&gap[1..2], &|block, i| match block {
            Block::X if i >= n_q => i + n_v,
            _ => i,
        });
        let mu = self.dag.input(Block::P, dims.p);
        let coordinates: Vec<Id> = (0..n_q).map(|k| self.dag.input(Block::X, k)).collect();
        let mut shift = vec![self.dag.constant(0.0); n_q];
        for (k, slope) in self.dag.gradient(&gap[..1], &[mu], &coordinates)? {
            shift[k] = slope;
        }
        let before = self.dag.mul(e, gap[1]);
        let rebound = self.dag.add(later[0], before);
        let wide = Dims { x: dims.x + n_v, ..dims };
        Ok(ContactFunctions {
            name: name.clone(),
            n_tangents: c.n_tangents,
            gap: self.function(&format!("gap of {name}"), dims, &gap[..1])?,
            rate: self.function(&format!("rate of the gap of {name}"), dims, &gap[1..2])?,
            slide: match slide {
                Some(s) => Some(self.function(&format!("sliding velocity of {name}"), dims, &[s])?),
                None => None,
            },
            push: self.function(&format!("force of {name}"), forces, &push)?,
            accelerate: self.function(&format!("acceleration of {name}"), forces, &reaction[own..])?,
            cone,
            shift: self.function(&format!("normal of {name}"), Dims { p: dims.p + 1, ..dims }, &shift)?,
            restitution: self.function(&format!("coefficient of restitution of {name}"), dims, &[e])?,
            rebound: self.function(&format!("restitution of {name}"), wide, &[rebound])?,
        })
    }
}
