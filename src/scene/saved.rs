//! A scene as data, for documents.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Constraint, Contact, Friction, Part, Scene};
use crate::error::{Error, Result};
use crate::expr::{Dag, Id, SavedGraph};
use crate::func::Function;
use crate::memory::sizes;
use crate::model::{Names, SavedNames, SavedTransition};
use crate::system::{ImpactLaw, Order};

/// A scene or a projected system: sizes, names, and its expressions, which stand by their numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedScene {
    name: String,
    /// The states stand for velocities: a projected system.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    projected: bool,
    #[serde(default, skip_serializing_if = "is_zero")]
    coordinates: usize,
    velocities: usize,
    controls: usize,
    parameters: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    names: Option<SavedNames>,
    expressions: SavedGraph,
    /// Rates of the coordinates, where they are not the velocities.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rates: Option<Vec<usize>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    inertia: Option<Vec<usize>>,
    forces: Vec<Option<usize>>,
    /// Rates of the states beside coordinates and velocities, discrete ones left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    states: Vec<Option<usize>>,
    /// Values with which the last states, which are discrete, begin.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    discrete: Vec<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    contacts: Vec<SavedPart>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    transitions: Vec<SavedTransition>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    sequential: bool,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    bounds: Vec<SavedBounds>,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum SavedPart {
    Contact {
        name: String,
        gap: usize,
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        tangents: Vec<usize>,
        friction: usize,
        restitution: usize,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stiction: Option<usize>,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        separation: Option<usize>,
    },
    Friction {
        name: String,
        sliding: usize,
        bound: usize,
        #[serde(default, skip_serializing_if = "Option::is_none")]
        stiction: Option<usize>,
    },
    Constraint {
        name: String,
        zero: usize,
    },
}

/// A coordinate that stays between bounds; a side without one has none.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedBounds {
    coordinate: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    low: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    high: Option<f64>,
}

/// Numbers of expressions in the order in which they were met.
#[derive(Default)]
struct Roots(Vec<Id>);

impl Roots {
    fn number(&mut self, id: Id) -> usize {
        self.0.push(id);
        self.0.len() - 1
    }

    fn all(&mut self, ids: &[Id]) -> Vec<usize> {
        ids.iter().map(|&id| self.number(id)).collect()
    }

    fn each(&mut self, ids: &[Option<Id>]) -> Vec<Option<usize>> {
        ids.iter().map(|id| id.map(|id| self.number(id))).collect()
    }

    fn part(&mut self, part: &Part) -> SavedPart {
        match part {
            Part::Contact(c, more) => SavedPart::Contact {
                name: c.name.clone(),
                gap: self.number(c.gap),
                tangents: self.all(&c.tangents),
                friction: self.number(c.friction),
                restitution: self.number(c.restitution),
                stiction: more.stiction.map(|id| self.number(id)),
                separation: more.separation.map(|id| self.number(id)),
            },
            Part::Friction(f) => SavedPart::Friction {
                name: f.name.clone(),
                sliding: self.number(f.sliding),
                bound: self.number(f.bound),
                stiction: f.stiction.map(|id| self.number(id)),
            },
            Part::Constraint(c) => SavedPart::Constraint { name: c.name.clone(), zero: self.number(c.zero) },
        }
    }
}

impl SavedScene {
    /// Saves a scene with all its expressions.
    ///
    /// # Errors
    /// Those of [`SavedGraph::new`].
    pub fn new(s: &Scene, dag: &Dag) -> Result<SavedScene> {
        let mut roots = Roots::default();
        let n_driven = s.states.len() - s.discrete.len();
        let n = &s.names;
        let named = [&n.x, &n.u, &n.p].into_iter().flatten().any(|name| !name.is_empty());
        let finite = |v: f64| Some(v).filter(|v| v.is_finite());
        let bounds = s.bounds.iter().enumerate();
        Ok(SavedScene {
            name: s.name.clone(),
            projected: s.order == Order::First,
            coordinates: s.n_q,
            velocities: s.n_v,
            controls: s.nu,
            parameters: s.np,
            names: named.then(|| SavedNames::of(n)),
            rates: s.rates.as_ref().map(|r| roots.all(r)),
            inertia: s.inertia.as_ref().map(|m| roots.all(m)),
            forces: roots.each(&s.force),
            states: roots.each(&s.states[..n_driven]),
            discrete: s.discrete.clone(),
            contacts: s.contacts.iter().map(|c| roots.part(c)).collect(),
            transitions: s.transitions.iter().map(|t| SavedTransition::new(dag, t)).collect::<Result<_>>()?,
            sequential: s.law == ImpactLaw::Sequential,
            bounds: bounds
                .filter_map(|(coordinate, b)| {
                    b.map(|(low, high)| SavedBounds { coordinate, low: finite(low), high: finite(high) })
                })
                .collect(),
            expressions: SavedGraph::new(dag, &roots.0)?,
        })
    }

    /// The scene, with its expressions added to a graph.
    ///
    /// # Errors
    /// Those of [`SavedGraph::restore`] and of the setters of [`Scene`].
    pub fn restore(&self, dag: &mut Dag, supplied: &[Arc<dyn Function>]) -> Result<Scene> {
        let n_discrete = self.discrete.len();
        sizes::check("states, controls or parameters", &[self.coordinates, self.velocities, self.states.len()])?;
        sizes::check("controls, parameters or discrete states", &[self.controls, self.parameters, n_discrete])?;
        let roots = self.expressions.restore(dag, supplied)?;
        let n = roots.len();
        let root = |k: usize| {
            roots.get(k).copied().ok_or_else(|| Error::Range(format!("expression {k} of the scene: there are {n}")))
        };
        let all = |list: &[usize]| list.iter().map(|&k| root(k)).collect::<Result<Vec<Id>>>();
        let maybe = |k: Option<usize>| k.map(root).transpose();
        let mut s = match self.projected {
            true if self.coordinates > 0
                || !self.states.is_empty()
                || self.rates.is_some()
                || self.inertia.is_some() =>
            {
                return Err(Error::Range(
                    "a projected system has no coordinates, no rates, no inertia and no states beside its own".into(),
                ))
            }
            true => Scene::projected(&self.name, self.velocities, self.controls, self.parameters)?,
            false => Scene::with_states(
                &self.name,
                self.coordinates,
                self.velocities,
                self.states.len(),
                self.controls,
                self.parameters,
            )?,
        };
        if let Some(r) = &self.rates {
            s.set_rates(&all(r)?)?;
        }
        if let Some(m) = &self.inertia {
            s.set_inertia(&all(m)?)?;
        }
        for (i, f) in self.forces.iter().enumerate().filter_map(|(i, f)| f.map(|f| (i, f))) {
            s.set_force(i, root(f)?)?;
        }
        for (i, h) in self.states.iter().enumerate().filter_map(|(i, h)| h.map(|h| (i, h))) {
            s.set_state_rate(i, root(h)?)?;
        }
        for value in &self.discrete {
            s.add_discrete("", *value)?;
        }
        if let Some(n) = &self.names {
            s.set_names(Names::from(n));
        }
        for part in &self.contacts {
            match part {
                SavedPart::Contact { name, gap, tangents, friction, restitution, stiction, separation } => {
                    let k = s.add_contact(Contact {
                        name: name.clone(),
                        gap: root(*gap)?,
                        tangents: all(tangents)?,
                        friction: root(*friction)?,
                        restitution: root(*restitution)?,
                    })?;
                    if let Some(id) = maybe(*stiction)? {
                        s.set_stiction(k, id)?;
                    }
                    if let Some(id) = maybe(*separation)? {
                        s.set_separation(k, id)?;
                    }
                }
                SavedPart::Friction { name, sliding, bound, stiction } => {
                    let (name, stiction) = (name.clone(), maybe(*stiction)?);
                    s.add_friction(Friction { name, sliding: root(*sliding)?, bound: root(*bound)?, stiction })?;
                }
                SavedPart::Constraint { name, zero } => {
                    s.add_constraint(Constraint { name: name.clone(), zero: root(*zero)? })?;
                }
            }
        }
        // a reset has an output for every state, which a document does not write out
        sizes::entries("the resets", &[self.transitions.iter().filter(|t| t.resets()).count(), s.dims().x])?;
        for t in &self.transitions {
            s.add_transition(t.restore(dag, supplied)?)?;
        }
        s.set_law(if self.sequential { ImpactLaw::Sequential } else { ImpactLaw::Newton });
        for b in &self.bounds {
            s.set_bounds(b.coordinate, b.low.unwrap_or(f64::NEG_INFINITY), b.high.unwrap_or(f64::INFINITY))?;
        }
        Ok(s)
    }
}

impl Scene {
    /// Expressions that what stands among the contacts is known by: the gap of a contact, then its tangents; what slides; what is zero. Behind
    /// them the guard of every transition, and what its reset makes of the states.
    pub fn expressions(&self) -> Vec<Id> {
        let mut all = Vec::new();
        for part in &self.contacts {
            match part {
                Part::Contact(c, _) => all.extend([c.gap].iter().chain(&c.tangents)),
                Part::Friction(f) => all.push(f.sliding),
                Part::Constraint(c) => all.push(c.zero),
            }
        }
        for t in &self.transitions {
            all.push(t.guard);
            all.extend(t.reset.iter().map(|r| r.1));
        }
        all
    }
}
