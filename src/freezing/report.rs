//! What became of the contacts of a scene in numerical time.

use std::fmt;

/// Devices that stand for contacts.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Kind {
    /// A constant push until the gap does not close any more (8.31).
    Inelastic {
        /// Its strength.
        a_n: f64,
        /// Directions of sliding with friction.
        tangents: usize,
    },
    /// A spring and a damper in a depth of its own (8.15).
    Elastic {
        /// Stiffness `k`.
        stiffness: f64,
        /// Damping `c` (8.13).
        damping: f64,
        /// Restitution.
        restitution: f64,
    },
}

/// One contact.
#[derive(Debug, Clone, PartialEq)]
pub struct ContactReport {
    /// Its name.
    pub name: String,
    /// Device that stands for it.
    pub kind: Kind,
    /// `a_n`, or `k`, with which a jump takes the step that was asked for.
    pub recommended: f64,
    /// The constant that is taken.
    pub given: f64,
    /// Numerical time of a jump, at the typical speed where it depends on it.
    pub jump: f64,
}

impl ContactReport {
    /// True where the constant is less than a tenth, or more than ten times, of what is recommended.
    pub fn is_doubtful(&self) -> bool {
        !(0.1..=10.0).contains(&(self.given / self.recommended))
    }
}

/// All contacts.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Report {
    /// In the order of the scene, without those that bounds exclude.
    pub contacts: Vec<ContactReport>,
    /// The step a jump should take.
    pub step: f64,
}

impl Report {
    /// Sentences about what was given and is far from what is recommended.
    pub fn warnings(&self) -> Vec<String> {
        let sentence = |c: &ContactReport| {
            let what = match c.kind {
                Kind::Inelastic { .. } => "a_n",
                Kind::Elastic { .. } => "stiffness",
            };
            format!(
                "contact {}: {what} = {:.3e} is {:.1e} times the recommended {:.3e}; a jump takes {:.2e}, the step is {:.2e}",
                c.name,
                c.given,
                c.given / c.recommended,
                c.recommended,
                c.jump,
                self.step
            )
        };
        self.contacts.iter().filter(|c| c.is_doubtful()).map(sentence).collect()
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        for c in &self.contacts {
            match c.kind {
                Kind::Inelastic { a_n, tangents } => {
                    let friction = ["without friction", "friction in the plane", "friction in space"][tangents.min(2)];
                    write!(f, "{}: inelastic, {friction}, a_n = {a_n:.6e}", c.name)?;
                }
                Kind::Elastic { stiffness, damping, restitution } => write!(
                    f,
                    "{}: restitution {restitution}, one state for its depth, k = {stiffness:.6e}, c = {damping:.6e}",
                    c.name
                )?,
            }
            writeln!(f, "; recommended {:.6e}, a jump takes {:.3e}", c.recommended, c.jump)?;
        }
        for w in self.warnings() {
            writeln!(f, "warning: {w}")?;
        }
        Ok(())
    }
}
