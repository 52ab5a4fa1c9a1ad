//! Equations of motion with contacts.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::parts::{Bound, SavedFunction};
use crate::error::{Error, Result};
use crate::func::Function;
use crate::memory::sizes::check as sizes;
use crate::system::{
    Contact, ImpactLaw, Inertia, Kind, Local, Mechanics, Order, Projection, Separation, SharedFunction,
};

/// What [`Mechanics`] has; functions are written once, and stand by their numbers.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedMechanics {
    functions: Vec<SavedFunction>,
    /// The constraints act on the states themselves: a projected system.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    projected: bool,
    coordinates: usize,
    velocities: usize,
    #[serde(default, skip_serializing_if = "is_zero")]
    others: usize,
    smooth: usize,
    #[serde(default, skip_serializing_if = "SavedInertia::is_identity")]
    inertia: SavedInertia,
    /// Lower bounds of gaps.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    separations: Vec<SavedSeparation>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    contacts: Vec<SavedContact>,
    /// Pairs of switches whose weights are multiplied.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    products: Vec<[usize; 2]>,
    /// Contacts that close at once strike one after the other.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    sequential: bool,
    /// Of the coordinates.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    bounds: Vec<Option<[Bound; 2]>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    elements: Option<SavedProjection>,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

#[derive(Clone, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum SavedInertia {
    #[default]
    Identity,
    Constant(Vec<f64>),
    Varying {
        matrix: usize,
        product: usize,
    },
}

impl SavedInertia {
    fn is_identity(&self) -> bool {
        matches!(self, SavedInertia::Identity)
    }
}

#[derive(Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum SavedKind {
    #[default]
    Unilateral,
    Joint,
    Bilateral,
    Switch,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedContact {
    name: String,
    #[serde(default, skip_serializing_if = "is_unilateral")]
    kind: SavedKind,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    stiction: bool,
    tangents: usize,
    gap: usize,
    motion: usize,
    reaction: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    local: Option<SavedLocal>,
}

fn is_unilateral(kind: &SavedKind) -> bool {
    *kind == SavedKind::Unilateral
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedLocal {
    coordinates: Vec<usize>,
    velocities: Vec<usize>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    others: Vec<usize>,
    gap: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    separation: Option<usize>,
    rows: usize,
}

/// A lower bound of gaps.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedSeparation {
    coordinates: Vec<usize>,
    distance: usize,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedProjection {
    smooth: usize,
    push: usize,
    constraints: usize,
}

/// The functions that were written down so far.
#[derive(Default)]
struct Written {
    known: Vec<SharedFunction>,
    saved: Vec<SavedFunction>,
    /// Places by address.
    places: std::collections::HashMap<usize, usize>,
}

impl Written {
    fn number(&mut self, f: &SharedFunction) -> Result<usize> {
        let address = Arc::as_ptr(f).cast::<u8>() as usize;
        if let Some(&k) = self.places.get(&address) {
            return Ok(k);
        }
        self.saved.push(SavedFunction::new(f)?);
        // held, so that its address stays its own
        self.known.push(f.clone());
        self.places.insert(address, self.saved.len() - 1);
        Ok(self.saved.len() - 1)
    }
}

impl SavedMechanics {
    pub(super) fn new(m: &Mechanics) -> Result<SavedMechanics> {
        let mut w = Written::default();
        let smooth = w.number(&m.smooth)?;
        let inertia = match &m.inertia {
            Inertia::Identity => SavedInertia::Identity,
            Inertia::Constant(entries) => SavedInertia::Constant(entries.clone()),
            Inertia::Varying { matrix, product } => {
                SavedInertia::Varying { matrix: w.number(matrix)?, product: w.number(product)? }
            }
        };
        let mut contacts = Vec::with_capacity(m.contacts.len());
        let (groups, bounds) = Separation::groups(m.contacts.iter().map(|c| c.local.as_ref()));
        let mut separations = Vec::with_capacity(bounds.len());
        for s in bounds {
            separations.push(SavedSeparation { coordinates: s.coordinates.clone(), distance: w.number(&s.distance)? });
        }
        for (c, separation) in m.contacts.iter().zip(groups) {
            let local = match &c.local {
                Some(l) => Some(SavedLocal {
                    coordinates: l.coordinates.clone(),
                    velocities: l.velocities.clone(),
                    others: l.others.clone(),
                    gap: w.number(&l.gap)?,
                    separation,
                    rows: w.number(&l.rows)?,
                }),
                None => None,
            };
            contacts.push(SavedContact {
                name: c.name.clone(),
                kind: match c.kind {
                    Kind::Unilateral => SavedKind::Unilateral,
                    Kind::Joint => SavedKind::Joint,
                    Kind::Bilateral => SavedKind::Bilateral,
                    Kind::Switch => SavedKind::Switch,
                },
                stiction: c.stiction,
                tangents: c.n_tangents,
                gap: w.number(&c.gap)?,
                motion: w.number(&c.motion)?,
                reaction: w.number(&c.reaction)?,
                local,
            });
        }
        let elements = match &m.projection {
            Some(p) => Some(SavedProjection {
                smooth: w.number(&p.smooth)?,
                push: w.number(&p.push)?,
                constraints: w.number(&p.constraints)?,
            }),
            None => None,
        };
        Ok(SavedMechanics {
            functions: w.saved,
            projected: m.order == Order::First,
            coordinates: m.n_q,
            velocities: m.n_v,
            others: m.n_z,
            smooth,
            inertia,
            separations,
            contacts,
            products: m.products.clone(),
            sequential: m.law == ImpactLaw::Sequential,
            bounds: m.bounds.iter().map(|b| b.map(|(low, high)| [Bound::new(low), Bound::new(high)])).collect(),
            elements,
        })
    }

    /// What is checked with the sizes of the system is left to it.
    pub(super) fn restore(&self, supplied: &[Arc<dyn Function>]) -> Result<Mechanics> {
        sizes("coordinates, velocities and other states", &[self.coordinates, self.velocities, self.others])?;
        let functions = self.functions.iter().map(|f| f.restore(supplied)).collect::<Result<Vec<SharedFunction>>>()?;
        let function = |k: usize| -> Result<SharedFunction> {
            let n = functions.len();
            functions.get(k).cloned().ok_or_else(|| Error::Range(format!("function {k} of a scene: there are {n}")))
        };
        let bound = |s: &SavedSeparation| -> Result<Arc<Separation>> {
            Ok(Arc::new(Separation { coordinates: s.coordinates.clone(), distance: function(s.distance)? }))
        };
        let bounds = self.separations.iter().map(bound).collect::<Result<Vec<Arc<Separation>>>>()?;
        let contact = |c: &SavedContact| -> Result<Contact> {
            let local = match &c.local {
                Some(l) => Some(Local {
                    coordinates: l.coordinates.clone(),
                    velocities: l.velocities.clone(),
                    others: l.others.clone(),
                    gap: function(l.gap)?,
                    separation: match l.separation {
                        Some(k) => Some(bounds.get(k).cloned().ok_or_else(|| {
                            Error::Range(format!(
                                "lower bound {k} of the gap of {}: there are {}",
                                c.name,
                                bounds.len()
                            ))
                        })?),
                        None => None,
                    },
                    rows: function(l.rows)?,
                }),
                None => None,
            };
            Ok(Contact {
                name: c.name.clone(),
                kind: match c.kind {
                    SavedKind::Unilateral => Kind::Unilateral,
                    SavedKind::Joint => Kind::Joint,
                    SavedKind::Bilateral => Kind::Bilateral,
                    SavedKind::Switch => Kind::Switch,
                },
                stiction: c.stiction,
                n_tangents: c.tangents,
                gap: function(c.gap)?,
                motion: function(c.motion)?,
                reaction: function(c.reaction)?,
                local,
            })
        };
        let contacts = self.contacts.iter().map(contact).collect::<Result<Vec<Contact>>>()?;
        let inertia = match &self.inertia {
            SavedInertia::Identity => Inertia::Identity,
            SavedInertia::Constant(entries) => Inertia::Constant(entries.clone()),
            SavedInertia::Varying { matrix, product } => {
                Inertia::Varying { matrix: function(*matrix)?, product: function(*product)? }
            }
        };
        let order = if self.projected { Order::First } else { Order::Second };
        let n_bounded = if self.projected { self.velocities } else { self.coordinates };
        let bounds: Vec<Option<(f64, f64)>> =
            self.bounds.iter().map(|b| b.map(|[low, high]| (low.value(), high.value()))).collect();
        if !bounds.is_empty() && bounds.len() != n_bounded || bounds.iter().flatten().any(|(low, high)| low > high) {
            return Err(Error::Range(format!(
                "the bounds of {n_bounded} coordinates are an interval for each, or none"
            )));
        }
        let elements = match &self.elements {
            Some(p) => Some(Projection {
                smooth: function(p.smooth)?,
                push: function(p.push)?,
                constraints: function(p.constraints)?,
            }),
            None => None,
        };
        Ok(Mechanics {
            order,
            n_q: self.coordinates,
            n_v: self.velocities,
            n_z: self.others,
            n_switches: contacts.iter().filter(|c| c.kind == Kind::Switch).count(),
            products: self.products.clone(),
            smooth: function(self.smooth)?,
            inertia,
            contacts,
            law: if self.sequential { ImpactLaw::Sequential } else { ImpactLaw::Newton },
            bounds,
            projection: elements,
        })
    }
}
