//! What a scene consists of, what was left out and why.

use std::fmt;

use super::Scene;
use crate::system::{ImpactLaw, Inertia, Kind, Mechanics, Separation};

/// A contact that the simulation has.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ContactReport {
    /// Its number as it was added.
    pub contact: usize,
    /// Its name.
    pub name: String,
    /// What it is: a contact, dry friction at a joint, a constraint, a switch.
    pub kind: Kind,
    /// Components of the sliding velocity; 0 without friction.
    pub n_tangents: usize,
    /// Functions that an event-driven simulation watches while the contact is open, slides, sticks.
    pub watched: [usize; 3],
    /// Unknown forces while it is closed.
    pub unknowns: usize,
    /// Unknowns of inner problems that are solved where the gap is evaluated.
    pub inner: usize,
    /// Number of the lower bound of its gap. Contacts with the same one are not looked at while that is positive.
    pub group: Option<usize>,
}

impl ContactReport {
    /// Is all but numbers and names the same, of contacts that share a lower bound?
    fn is_like(&self, other: &ContactReport) -> bool {
        let (name, contact) = (other.name.clone(), other.contact);
        self.group.is_some() && *other == ContactReport { name, contact, ..self.clone() }
    }
}

/// A contact that cannot close.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dropped {
    /// Its number as it was added.
    pub contact: usize,
    /// Its name.
    pub name: String,
    /// Why it cannot.
    pub proof: String,
}

/// Parts of a scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Report {
    /// Name of the scene.
    pub name: String,
    /// Coordinates, velocities, controls, parameters.
    pub sizes: [usize; 4],
    /// States beside coordinates and velocities.
    pub n_states: usize,
    /// How the inertia is treated, in words.
    pub inertia: String,
    /// Law for several contacts that close at once.
    pub law: ImpactLaw,
    /// Contacts in the order they are numbered in results.
    pub contacts: Vec<ContactReport>,
    /// Contacts that were left out.
    pub dropped: Vec<Dropped>,
    /// Transitions in words.
    pub transitions: Vec<String>,
}

impl Report {
    pub(super) fn new(s: &Scene, m: &Mechanics, kept: &[usize], dropped: Vec<Dropped>) -> Report {
        let inertia = match &m.inertia {
            Inertia::Identity => "unit matrix: nothing to solve",
            Inertia::Constant(_) => "constant: factored once",
            Inertia::Varying { .. } => "varies: factored once per point",
        };
        // switches are no parts that were added: they are numbered behind these
        let numbers = kept.iter().copied().chain(s.n_contacts()..);
        let (groups, _) = Separation::groups(m.contacts.iter().map(|c| c.local.as_ref()));
        let contact = |(contact, (c, group)): (usize, (&crate::system::Contact, Option<usize>))| ContactReport {
            contact,
            group,
            name: c.name.clone(),
            n_tangents: c.n_tangents,
            kind: c.kind,
            watched: match (c.kind, c.n_tangents) {
                (Kind::Bilateral, _) => [0, 0, 0],
                (Kind::Joint | Kind::Switch, _) => [0, 1, 2],
                (_, 0) => [1, 1, 1],
                (_, 1) => [1, 2, 3],
                _ => [1, 2, 2],
            },
            unknowns: usize::from(!c.kind.has_no_normal()) + c.n_tangents,
            inner: 0,
        };
        Report {
            name: s.name.clone(),
            sizes: [s.n_q, s.n_v, s.nu, s.np],
            n_states: s.n_states(),
            inertia: inertia.into(),
            law: m.law,
            contacts: numbers.zip(m.contacts.iter().zip(groups)).map(contact).collect(),
            dropped,
            transitions: Vec::new(),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [n_q, n_v, nu, np] = self.sizes;
        writeln!(f, "scene {}: {n_q} coordinates, {n_v} velocities, {nu} controls, {np} parameters", self.name)?;
        if self.n_states > 0 {
            writeln!(f, "beside them {} states", self.n_states)?;
        }
        writeln!(f, "inertia: {}", self.inertia)?;
        if self.contacts.is_empty() {
            writeln!(f, "no contacts: a smooth model")?;
        }
        for alike in self.contacts.chunk_by(ContactReport::is_like) {
            let (c, last) = (&alike[0], &alike[alike.len() - 1]);
            let [open, slips, sticks] = c.watched;
            match c.kind {
                Kind::Unilateral => {}
                Kind::Joint => {
                    writeln!(f, "joint {}: dry friction; watched while sliding {slips}, sticking {sticks}", c.name)?;
                    continue;
                }
                Kind::Switch => {
                    writeln!(
                        f,
                        "{}: watched while its sign is given {slips}, while it stays at zero {sticks}",
                        c.name
                    )?;
                    continue;
                }
                Kind::Bilateral => {
                    writeln!(f, "constraint {}: always closed; 1 force", c.name)?;
                    continue;
                }
            }
            let friction = match c.n_tangents {
                0 => "no friction",
                1 => "friction in the plane",
                _ => "friction in space",
            };
            let one = |n: usize| if n == 1 { "1 force".to_owned() } else { format!("{n} forces") };
            let inner = match c.inner {
                0 => String::new(),
                n => format!("; its gap solves for {n} unknowns"),
            };
            let (name, each) = match alike.len() {
                1 => (format!("contact {}", c.name), ""),
                n => (format!("{n} contacts from {} to {}", c.name, last.name), "each "),
            };
            let far = c.group.map_or("", |_| "; not looked at while a lower bound of the gap is positive");
            writeln!(
                f,
                "{name}: {each}{friction}; watched while open {open}, sliding {slips}, sticking {sticks}; {} while closed{inner}{far}",
                one(c.unknowns)
            )?;
        }
        for (k, t) in self.transitions.iter().enumerate() {
            writeln!(f, "transition {k}: {t}")?;
        }
        for d in &self.dropped {
            writeln!(f, "left out: contact {}: {}", d.name, d.proof)?;
        }
        Ok(())
    }
}

impl Report {
    /// The report as one object of JSON.
    pub fn json(&self) -> String {
        let contact = |c: &ContactReport| {
            let kind = match c.kind {
                Kind::Unilateral => "contact",
                Kind::Joint => "friction",
                Kind::Bilateral => "constraint",
                Kind::Switch => "switch",
            };
            serde_json::json!({
                "contact": c.contact, "name": c.name, "kind": kind, "tangents": c.n_tangents, "unknowns": c.unknowns, "inner_unknowns": c.inner,
                "group": c.group,
                "watched": {"open": c.watched[0], "sliding": c.watched[1], "sticking": c.watched[2]},
            })
        };
        let dropped = |d: &Dropped| serde_json::json!({"contact": d.contact, "name": d.name, "proof": d.proof});
        let [n_q, n_v, nu, np] = self.sizes;
        let law = if self.law == ImpactLaw::Newton { "newton" } else { "sequential" };
        serde_json::json!({
            "name": self.name, "n_q": n_q, "n_v": n_v, "n_states": self.n_states, "n_controls": nu, "n_parameters": np,
            "inertia": self.inertia, "impact_law": law,
            "contacts": self.contacts.iter().map(contact).collect::<Vec<_>>(),
            "transitions": self.transitions,
            "dropped": self.dropped.iter().map(dropped).collect::<Vec<_>>(),
        })
        .to_string()
    }
}
