//! What a point of an MPCC is: the type of stationarity (definition 2.29), shown by multipliers, and B-stationarity,
//! shown by the linearised problem (2.29).
//!
//! Types are claims of existence: multipliers at hand give a type at once, and where constraint qualifications fail
//! better ones may exist. By duality there are multipliers with given signs at the biactive pairs exactly if `d = 0`
//! solves the linearised problem with the polar signs there, so one search over linear programs serves both questions:
//! with signs that shrink from those of the relaxed problem (2.24) to those of its branches (2.26) it looks for a
//! descent, with signs that grow from those of the tight problem (2.25) for multipliers.

use super::lpcc::{rounding, Lpcc, Piece, Signs, Verdict};
use super::problem::Side;
use crate::error::{Error, Result};
use crate::linalg::csc::{mul_add_transposed, Pattern};
use crate::linalg::kkt::LinearStats;
use crate::nlp::{within, Bounds, Control, SecondOrder, INFINITE};

/// An MPCC in vertical form at a point, to first order.
#[derive(Debug, Clone, Copy)]
pub struct Local<'a> {
    /// The point `[n]`.
    pub x: &'a [f64],
    /// Rows `[m]` there.
    pub c: &'a [f64],
    /// Gradient of the objective `[n]`.
    pub grad: &'a [f64],
    /// Pattern of the Jacobian of the rows, `m × n`.
    pub jac: &'a Pattern,
    /// Its values `[nnz]`.
    pub jac_values: &'a [f64],
    /// Bounds of the MPCC, not of a branch: members of pairs have lower bound 0.
    pub bounds: &'a Bounds,
    /// The pairs `(a, b)`, `0 ≤ x_a ⊥ x_b ≥ 0`.
    pub pairs: &'a [(usize, usize)],
    /// Multipliers of the rows `[m]`, of the Lagrangian `f + yᵀc − zᵀx`; need not be right.
    pub y: &'a [f64],
    /// Multipliers of the bounds, lower minus upper `[n]`; `ν`, `ξ` of (2.31) for members of pairs.
    pub z: &'a [f64],
}

/// The strongest type of stationarity (definition 2.29) for which multipliers are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum Stationarity {
    /// Strong: `ν, ξ ≥ 0` at biactive pairs.
    S = 0,
    /// Mordukhovich: both positive, or one of them zero.
    M = 1,
    /// Clarke: `ν ξ ≥ 0`.
    C = 2,
    /// Abadie: one of them not negative.
    A = 3,
    /// Weak: no signs.
    W = 4,
    /// There are no multipliers at all.
    None = 5,
    /// Not known.
    #[default]
    Unknown = 6,
}

impl Stationarity {
    /// Name as in reports.
    pub fn name(self) -> &'static str {
        match self {
            Stationarity::S => "S",
            Stationarity::M => "M",
            Stationarity::C => "C",
            Stationarity::A => "A",
            Stationarity::W => "W",
            Stationarity::None => "none",
            Stationarity::Unknown => "unknown",
        }
    }
}

/// B-stationarity: `d = 0` solves the linearised problem with complementarity constraints (2.29).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum BStationarity {
    /// No step to first order is a descent.
    Yes = 0,
    /// There is a descent to first order.
    No = 1,
    /// Not decided, see [`Certificate::doubt`].
    #[default]
    Undecided = 2,
}

impl BStationarity {
    /// Name as in reports.
    pub fn name(self) -> &'static str {
        match self {
            BStationarity::Yes => "yes",
            BStationarity::No => "no",
            BStationarity::Undecided => "undecided",
        }
    }
}

/// Reasons why a certificate does not say more.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
#[non_exhaustive]
pub enum Doubt {
    /// Nothing.
    #[default]
    None = 0,
    /// The data have wrong sizes or are not finite.
    Data = 1,
    /// The point violates rows, bounds or complementarity.
    Infeasible = 2,
    /// Too many pieces for the limits of nodes or of iterations.
    Nodes = 3,
    /// A linear program could not be solved well enough to believe it.
    Accuracy = 4,
    /// Interrupted, or out of time.
    Stopped = 5,
}

impl Doubt {
    /// Name as in reports.
    pub fn name(self) -> &'static str {
        match self {
            Doubt::None => "none",
            Doubt::Data => "data",
            Doubt::Infeasible => "infeasible",
            Doubt::Nodes => "nodes",
            Doubt::Accuracy => "accuracy",
            Doubt::Stopped => "stopped",
        }
    }
}

/// Knowledge of a point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Certificate {
    /// Type of stationarity.
    pub stationarity: Stationarity,
    /// True where it is shown that there are no multipliers of a stronger type.
    pub sharp: bool,
    /// B-stationarity.
    pub b: BStationarity,
    /// Reason why questions are left open: that of B-stationarity first, else that of the type.
    pub doubt: Doubt,
    /// Number of biactive pairs.
    pub biactive: usize,
    /// Smallest of `ν`, `ξ` over the biactive pairs, over the largest modulus there or 1; 0 without such pairs.
    pub min_multiplier: f64,
    /// Upper-level strict complementarity: `ν ξ ≠ 0` at all biactive pairs.
    pub ulsc: bool,
    /// Linear programs solved.
    pub lps: usize,
    /// Interior-point iterations in them.
    pub lp_iterations: usize,
    /// Nodes of the searches.
    pub nodes: usize,
    /// Conditions of second order, of programs without pairs and of strongly stationary points.
    pub second: SecondOrder,
    /// Active constraints whose gradients depend on those of others; 0 where the conditions of second order were not looked at.
    pub dependent: usize,
    /// No point of the program has a lower objective than this: where branch and bound has shown it. At a global optimum it is the
    /// objective of the point.
    pub bound: Option<f64>,
}

/// Tolerances and limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CertSettings {
    /// Violation of the stationarity conditions allowed, relative to the largest entry of the gradient.
    pub tol: f64,
    /// Entry of the gradient, or of what is left of it, that is rounding.
    pub rounding: f64,
    /// Distance at which a bound counts as active. A member of a pair that is not larger, relative to the largest one where
    /// that is below 1, is zero; one up to 1e-4, depending on what the multipliers leave over, may be.
    pub active_tol: f64,
    /// Violation of rows and bounds allowed, relative to bounds above 1.
    pub feasibility_tol: f64,
    /// Radius `ρ` of the trust region.
    pub radius: f64,
    /// Nodes for B-stationarity.
    pub max_nodes: usize,
    /// Nodes for every type that is tried; 0 keeps to the multipliers given.
    pub type_nodes: usize,
    /// Factorisations in all linear programs together; what is not decided then stays undecided.
    pub max_factorisations: usize,
}

impl Default for CertSettings {
    fn default() -> Self {
        CertSettings {
            tol: 1e-7,
            rounding: 1e-11,
            active_tol: 1e-8,
            feasibility_tol: 1e-6,
            radius: 1e-2,
            max_nodes: 500,
            type_nodes: 100,
            max_factorisations: usize::MAX,
        }
    }
}

/// Largest member of a pair that may count as zero.
const ACTIVE_MAX: f64 = 1e-4;
/// Error of a point whose multipliers are not known.
const UNKNOWN: f64 = 1e-6;
/// Residual of multipliers, relative to the gradient, above which they prove nothing.
const GIVEN_TOL: f64 = 1e-6;
/// Share of what a step in the trust region can gain that multipliers times distances which count as none may hide.
pub(super) const HIDDEN: f64 = 1e-5;

/// A pair whose two members are zero.
#[derive(Debug, Clone, Copy)]
struct Biactive {
    /// Number of the pair.
    pair: usize,
    /// Members whose multiplier is free because something else holds them at zero.
    pinned: (bool, bool),
    /// Members that are not quite zero: what the pair shows has to hold without it as well, so their multiplier is zero.
    open: (bool, bool),
    /// A member that is not pinned belongs to another biactive pair as well: its multiplier is a sum.
    shared: bool,
}

/// A decision of a search, and what is still to be tried.
#[derive(Debug, Clone, Copy)]
struct Choice {
    k: usize,
    pieces: [Piece; 3],
    n: usize,
    at: usize,
    /// Does the proof found for the present piece rest on it?
    used: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Aim {
    Descent,
    Multipliers(Stationarity),
}

enum Node {
    Found,
    Prune,
    /// Nothing is shown, and there is nothing left to decide.
    Lost,
    /// There are no factorisations left.
    Spent,
    Stopped,
    Branch(Choice),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Found,
    Exhausted,
    Open(Doubt),
}

/// Certifies points of MPCCs of one structure. Memory is allocated when it is made.
pub struct Certifier {
    n: usize,
    m: usize,
    nnz: usize,
    pairs: Vec<(usize, usize)>,
    lpcc: Lpcc,
    biactive: Vec<Biactive>,
    members: Vec<(usize, usize)>,
    pinned: Vec<bool>,
    /// Number of biactive pairs a variable is in.
    uses: Vec<u32>,
    assigned: Vec<Option<Piece>>,
    stack: Vec<Choice>,
    /// Multipliers of the strongest type known.
    y: Vec<f64>,
    z: Vec<f64>,
    work: Vec<f64>,
    sign_tol: f64,
    /// Strongest type that multipliers at hand prove.
    known: Stationarity,
    /// The linear programs are those of the last point.
    loaded: bool,
    /// What the relaxed problem (2.24) showed.
    root: Verdict,
    nodes: usize,
    /// Part of the linearised problem that is searched, or all of it.
    part: Option<usize>,
    descent: bool,
    d: Vec<f64>,
    sides: Vec<Side>,
}

impl Certifier {
    /// Allocates for Jacobians with the pattern `jac`, `m × n`, and the pairs `(a, b)`.
    ///
    /// # Errors
    /// [`Error::Range`] when a pair names a variable that does not exist, or one variable twice.
    pub fn new(jac: &Pattern, pairs: &[(usize, usize)]) -> Result<Certifier> {
        let (m, n) = (jac.n_rows(), jac.n_cols());
        if let Some(k) = pairs.iter().position(|&(a, b)| a >= n || b >= n || a == b) {
            return Err(Error::Range(format!(
                "pair {k} is {:?}; a pair consists of two different variables below {n}",
                pairs[k]
            )));
        }
        let p = pairs.len();
        Ok(Certifier {
            n,
            m,
            nnz: jac.nnz(),
            pairs: pairs.to_vec(),
            lpcc: Lpcc::new(jac)?,
            biactive: Vec::with_capacity(p),
            members: Vec::with_capacity(p),
            pinned: vec![false; n],
            uses: vec![0; n],
            assigned: vec![None; p],
            stack: Vec::with_capacity(p),
            y: vec![0.0; m],
            z: vec![0.0; n],
            work: vec![0.0; n],
            sign_tol: 0.0,
            known: Stationarity::Unknown,
            loaded: false,
            root: Verdict::Unclear,
            nodes: 0,
            part: None,
            descent: false,
            d: vec![0.0; n],
            sides: vec![Side::First; p],
        })
    }

    /// After [`BStationarity::No`], or where a pair that may be biactive has to be: a step `d[n]`, feasible to first order,
    /// along which the objective falls, and the side of every pair that stays zero.
    pub fn descent(&self) -> Option<(&[f64], &[Side])> {
        self.descent.then_some((&self.d, &self.sides))
    }

    /// Numbers of the pairs that count as biactive.
    pub fn biactive(&self) -> impl Iterator<Item = usize> + '_ {
        self.biactive.iter().map(|q| q.pair)
    }

    /// Multipliers `y[m]`, `z[n]` of the type that was certified, with the signs of [`Local`].
    pub fn multipliers(&self) -> (&[f64], &[f64]) {
        (&self.y, &self.z)
    }

    /// Forgets the point that was classified last.
    pub fn forget(&mut self) {
        (self.descent, self.loaded) = (false, false);
    }

    /// Structure and work of the factorisations in the linear programs.
    pub fn linear_statistics(&self) -> LinearStats {
        self.lpcc.linear_statistics()
    }

    /// Factorisations since the last [`Certifier::certify`] began.
    pub fn factorisations(&self) -> usize {
        self.lpcc.factorisations
    }

    /// Classifies the point. `p` has the structure this object was made for.
    pub fn certify(&mut self, p: &Local, settings: &CertSettings, control: &mut Control) -> Certificate {
        control.within(f64::INFINITY, |control| {
            let mut cert = self.examine(p, settings, control);
            self.improve_type(&mut cert, settings, control);
            self.describe(cert)
        })
    }

    /// Looks for multipliers of a stronger type than `cert` has, which is of the point that was classified last.
    pub fn refine(&mut self, mut cert: Certificate, settings: &CertSettings, control: &mut Control) -> Certificate {
        control.within(f64::INFINITY, |control| {
            self.lpcc.allow(settings.max_factorisations);
            self.improve_type(&mut cert, settings, control);
            self.describe(cert)
        })
    }

    /// B-stationarity, and what the multipliers at hand prove.
    fn examine(&mut self, p: &Local, settings: &CertSettings, control: &mut Control) -> Certificate {
        self.forget();
        self.root = Verdict::Unclear;
        self.known = Stationarity::Unknown;
        self.nodes = 0;
        self.biactive.clear();
        self.members.clear();
        self.lpcc.begin();
        self.lpcc.allow(settings.max_factorisations);
        let mut cert = Certificate::default();
        if !self.usable(p) {
            return Certificate { doubt: Doubt::Data, ..cert };
        }
        let size = p.grad.iter().fold(0f64, |a, g| a.max(g.abs()));
        let tol = (settings.tol * size).max(settings.rounding);
        let given = self.take_multipliers(p, size.max(settings.rounding), tol, settings.radius);
        let tol = tol.max(given.map_or(0.0, |g| 10.0 * g.0));
        self.sign_tol = tol;
        let zero = Zero::new(p, settings, given);
        if !feasible(p, settings.feasibility_tol, zero.perhaps) {
            return Certificate { doubt: Doubt::Infeasible, ..cert };
        }
        self.identify(p, &zero);
        self.known = if given.is_some() { self.classify() } else { Stationarity::Unknown };
        if size <= tol {
            self.y.fill(0.0);
            self.z.fill(0.0);
            self.known = Stationarity::S;
        }
        if self.known == Stationarity::S {
            return Certificate { b: BStationarity::Yes, sharp: true, ..cert };
        }
        self.lpcc.load(p, settings.active_tol, tol, settings.radius);
        self.mark();
        self.loaded = true;
        match self.search_parts(settings.max_nodes, control) {
            End::Found => {
                self.record_descent(p);
                if self.descends_either_way() {
                    cert.b = BStationarity::No;
                } else {
                    cert.doubt = Doubt::Accuracy;
                }
            }
            End::Exhausted => cert.b = BStationarity::Yes,
            End::Open(doubt) => cert.doubt = doubt,
        }
        cert
    }

    /// Sizes and values that can be worked with.
    fn usable(&self, p: &Local) -> bool {
        let finite = |v: &[f64]| v.iter().all(|v| v.is_finite());
        (p.x.len(), p.c.len(), p.grad.len()) == (self.n, self.m, self.n)
            && (p.jac.n_rows(), p.jac.n_cols()) == (self.m, self.n)
            && (p.jac.nnz(), p.jac_values.len()) == (self.nnz, self.nnz)
            && p.pairs == self.pairs
            && p.bounds.validate(self.n, self.m).is_ok()
            && finite(p.x)
            && finite(p.c)
            && finite(p.grad)
            && finite(p.jac_values)
    }

    /// Copies the multipliers of the point and measures what they leave over: stationarity, and complementarity of
    /// rows and bounds. `None` when that is too much for a proof: a share of the gradient, or what rounding or distances hide.
    fn take_multipliers(&mut self, p: &Local, size: f64, tol: f64, radius: f64) -> Option<(f64, f64)> {
        if p.y.len() != self.m || p.z.len() != self.n || p.y.iter().chain(p.z).any(|v| !v.is_finite()) {
            return None;
        }
        // what distances that count as none are worth
        let (rounding, mut hidden) = (rounding(p), 0.0);
        self.y.copy_from_slice(p.y);
        self.z.copy_from_slice(p.z);
        self.work.copy_from_slice(p.grad);
        mul_add_transposed(p.jac, p.jac_values, p.y, &mut self.work, 1.0);
        let (mut dual, mut slack) = (0f64, 0f64);
        // the sign of the multiplier of a member is free where it is zero
        self.pinned.fill(false);
        for &(a, b) in &self.pairs {
            self.pinned[a] = true;
            self.pinned[b] = true;
        }
        for j in 0..self.n {
            dual = dual.max((self.work[j] - p.z[j]).abs());
            let (lo, hi) = (p.bounds.xl[j], p.bounds.xu[j]);
            if lo != hi {
                let cost = unused(p.z[j], p.x[j] - lo, hi - p.x[j]);
                let member = if self.pinned[j] { p.z[j].abs() * p.x[j].abs() } else { f64::INFINITY };
                slack = slack.max(cost.min(member));
                hidden += cost.min(member).min(p.z[j].abs() * radius);
            }
        }
        for i in 0..self.m {
            let (lo, hi) = (p.bounds.cl[i], p.bounds.cu[i]);
            let cost = unused(-p.y[i], p.c[i] - lo, hi - p.c[i]);
            if lo != hi {
                slack = slack.max(cost);
            }
            hidden += cost.min(p.y[i].abs() * radius);
        }
        let small = dual.max(slack) <= GIVEN_TOL * size && rounding <= tol && hidden <= HIDDEN * size * radius;
        small.then_some((dual, slack))
    }

    /// Pairs with two zero members, and variables that are zero whatever their own pair does.
    fn identify(&mut self, p: &Local, zero: &Zero) {
        let active = zero.perhaps;
        self.pinned.fill(false);
        self.uses.fill(0);
        for j in 0..self.n {
            self.pinned[j] = p.bounds.xu[j] <= zero.surely && p.bounds.xl[j] >= 0.0;
        }
        for &(a, b) in &self.pairs {
            match (p.x[a] <= active, p.x[b] <= active) {
                (true, false) => self.pinned[a] = true,
                (false, true) => self.pinned[b] = true,
                _ => {}
            }
        }
        for (k, &(a, b)) in self.pairs.iter().enumerate() {
            self.sides[k] = if p.x[a] <= p.x[b] { Side::First } else { Side::Second };
            if p.x[a] <= active && p.x[b] <= active {
                self.uses[a] += 1;
                self.uses[b] += 1;
                let pinned = (self.pinned[a], self.pinned[b]);
                let open = (p.x[a] > zero.surely, p.x[b] > zero.surely);
                self.biactive.push(Biactive { pair: k, pinned, open, shared: false });
                self.members.push((a, b));
            }
        }
        for (q, &(a, b)) in self.biactive.iter_mut().zip(&self.members) {
            q.shared = (self.uses[a] > 1 && !q.pinned.0) || (self.uses[b] > 1 && !q.pinned.1);
        }
    }

    /// Tells the linear program what [`Certifier::identify`] found.
    fn mark(&mut self) {
        for &(a, b) in &self.members {
            self.lpcc.unpin(a);
            self.lpcc.unpin(b);
        }
        for j in (0..self.n).filter(|&j| self.pinned[j]) {
            self.lpcc.pin(j);
        }
    }

    /// Strongest type that the present multipliers prove.
    fn classify(&self) -> Stationarity {
        let proves = |kind| (0..self.biactive.len()).all(|k| self.satisfies(kind, k, &self.z));
        [Stationarity::S, Stationarity::M, Stationarity::C, Stationarity::A]
            .into_iter()
            .find(|&kind| proves(kind))
            .unwrap_or(Stationarity::W)
    }

    /// Do the multipliers `z` have the signs of a type at biactive pair `k`? A free multiplier is what suits.
    fn satisfies(&self, kind: Stationarity, k: usize, z: &[f64]) -> bool {
        let (q, (a, b), t) = (self.biactive[k], self.members[k], self.sign_tol);
        let up = |j: usize, free: bool| free || z[j] >= -t;
        let zero = |j: usize, free: bool| free || z[j].abs() <= t;
        let closed = (!q.open.0 || zero(a, q.pinned.0)) && (!q.open.1 || zero(b, q.pinned.1));
        let strong = closed && up(a, q.pinned.0) && up(b, q.pinned.1);
        if strong || kind == Stationarity::W {
            return true;
        }
        if q.shared || !closed {
            return false;
        }
        let mordukhovich = zero(a, q.pinned.0) || zero(b, q.pinned.1);
        match kind {
            Stationarity::M => mordukhovich,
            Stationarity::C => mordukhovich || (z[a] < 0.0 && z[b] < 0.0),
            Stationarity::A => up(a, q.pinned.0) || up(b, q.pinned.1),
            _ => false,
        }
    }

    /// Looks for multipliers of a stronger type than is known, with linear programs that are loaded.
    fn improve_type(&mut self, cert: &mut Certificate, settings: &CertSettings, control: &mut Control) {
        if !self.loaded {
            return;
        }
        if self.root == Verdict::Stationary {
            self.known = Stationarity::S;
            cert.sharp = true;
            return;
        }
        if settings.type_nodes == 0 || (self.known == Stationarity::Unknown && !self.find_multipliers(cert, control)) {
            return;
        }
        cert.sharp = self.root == Verdict::Descent;
        for kind in [Stationarity::M, Stationarity::C, Stationarity::A] {
            if kind as i32 >= self.known as i32 {
                return;
            }
            match self.search(Aim::Multipliers(kind), settings.type_nodes, control) {
                End::Found => self.known = kind,
                End::Exhausted => {}
                End::Open(why) => {
                    cert.sharp = false;
                    doubt(cert, why);
                    if why == Doubt::Stopped || self.lpcc.is_spent() {
                        return;
                    }
                }
            }
        }
    }

    /// Multipliers of any type, by the tight problem (2.25); false where there are none, or none were found.
    fn find_multipliers(&mut self, cert: &mut Certificate, control: &mut Control) -> bool {
        self.nodes += 1;
        self.lpcc.exact = false;
        match self.lpcc.solve(&self.members, |_| (Signs::ZERO, Signs::ZERO), None, control) {
            Verdict::Stationary => {
                self.y.copy_from_slice(&self.lpcc.y);
                self.z.copy_from_slice(&self.lpcc.z);
                self.known = self.classify();
                return true;
            }
            Verdict::Descent => {
                self.known = Stationarity::None;
                cert.sharp = true;
            }
            Verdict::Unclear => doubt(cert, Doubt::Accuracy),
            Verdict::Spent => doubt(cert, Doubt::Nodes),
            Verdict::Stopped => doubt(cert, Doubt::Stopped),
        }
        false
    }

    /// Looks for a descent. Where one relaxed program does not settle it, parts that have nothing in common are searched
    /// one by one: their numbers of pieces are added, not multiplied.
    fn search_parts(&mut self, max_nodes: usize, control: &mut Control) -> End {
        let parts = self.lpcc.split(&self.members);
        if parts <= 2 {
            return self.search(Aim::Descent, max_nodes, control);
        }
        let whole = self.search(Aim::Descent, 1, control);
        if whole != End::Open(Doubt::Nodes) {
            return whole;
        }
        let mut end = End::Exhausted;
        for part in 0..parts {
            self.part = Some(part);
            match self.search(Aim::Descent, max_nodes, control) {
                End::Exhausted => {}
                other => end = other,
            }
            if end == End::Found || end == End::Open(Doubt::Stopped) || self.lpcc.is_spent() {
                break;
            }
        }
        self.part = None;
        end
    }

    /// Depth-first search over the pieces of the biactive pairs.
    fn search(&mut self, aim: Aim, max_nodes: usize, control: &mut Control) -> End {
        self.stack.clear();
        self.lpcc.exact = aim == Aim::Descent;
        for (a, &(member, _)) in self.assigned.iter_mut().zip(&self.members) {
            let outside = self.part.is_some_and(|part| self.lpcc.part(member) != part);
            *a = outside.then_some((Signs::ZERO, Signs::ZERO));
        }
        let mut end = End::Exhausted;
        for at in 0..max_nodes {
            self.nodes += 1;
            let root = at == 0;
            let node = match aim {
                Aim::Descent => self.descent_node(root, control),
                Aim::Multipliers(kind) => self.multiplier_node(kind, root, control),
            };
            match node {
                Node::Found => return End::Found,
                Node::Stopped => return End::Open(Doubt::Stopped),
                Node::Spent => return End::Open(Doubt::Nodes),
                Node::Branch(choice) => {
                    self.assigned[choice.k] = Some(choice.pieces[0]);
                    self.stack.push(choice);
                    continue;
                }
                Node::Lost => end = End::Open(Doubt::Accuracy),
                Node::Prune => {}
            }
            if !self.backtrack() {
                return end;
            }
        }
        End::Open(Doubt::Nodes)
    }

    /// Takes the next piece of the last choice that has one; false when everything has been tried. Where the proofs
    /// below a piece do not rest on it, they hold for the other pieces as well.
    fn backtrack(&mut self) -> bool {
        while let Some(c) = self.stack.last_mut() {
            c.at += 1;
            if c.at < c.n && c.used {
                c.used = c.n > 2;
                self.assigned[c.k] = Some(c.pieces[c.at]);
                return true;
            }
            self.assigned[c.k] = None;
            self.stack.pop();
        }
        false
    }

    /// Marks the choices that the multipliers just found rest on: those of pairs with a negative one.
    fn trace_proof(&mut self) {
        for at in 0..self.stack.len() {
            let k = self.stack[at].k;
            self.stack[at].used |= !self.satisfies(Stationarity::S, k, &self.lpcc.z);
        }
    }

    /// Linear program with the pieces assigned, and `rest` elsewhere.
    fn solve(&mut self, rest: Piece, control: &mut Control) -> Verdict {
        let assigned = &self.assigned;
        self.lpcc.solve(&self.members, |k| assigned[k].unwrap_or(rest), self.part, control)
    }

    /// A node of the search for a descent: pairs that are undecided are relaxed.
    fn descent_node(&mut self, root: bool, control: &mut Control) -> Node {
        const BRANCHES: [Piece; 2] = [(Signs::ZERO, Signs::UP), (Signs::UP, Signs::ZERO)];
        let verdict = self.solve((Signs::UP, Signs::UP), control);
        let whole = root && self.part.is_none();
        if whole {
            self.root = verdict;
        }
        match verdict {
            Verdict::Stopped => return Node::Stopped,
            Verdict::Spent => return Node::Spent,
            Verdict::Stationary => {
                if whole {
                    self.y.copy_from_slice(&self.lpcc.y);
                    self.z.copy_from_slice(&self.lpcc.z);
                }
                self.trace_proof();
                return Node::Prune;
            }
            Verdict::Descent | Verdict::Unclear => {}
        }
        // the pair whose complementarity the step violates most
        let step = &self.lpcc.step;
        let violation = |k: usize| step[self.members[k].0].min(step[self.members[k].1]);
        let undecided = (0..self.members.len()).filter(|&k| self.assigned[k].is_none());
        let worst = undecided.max_by(|&k, &l| violation(k).total_cmp(&violation(l)).then(l.cmp(&k)));
        let Some(k) = worst else {
            self.stack.iter_mut().for_each(|c| c.used = true);
            return if verdict == Verdict::Descent { Node::Found } else { Node::Lost };
        };
        let prefer = |k: usize| usize::from(step[self.members[k].0] > step[self.members[k].1]);
        let first = prefer(k);
        let open = self.assigned[..self.members.len()].iter().filter(|a| a.is_none()).count();
        if verdict == Verdict::Descent && open > 1 && self.stack.last().is_none_or(|c| c.at > 0) {
            // one program more often settles it: the branch next to the step. Below a first piece it was tried before
            for l in 0..self.members.len() {
                if self.assigned[l].is_none() {
                    self.assigned[l] = Some(BRANCHES[prefer(l)]);
                    self.stack.push(Choice { k: l, pieces: [BRANCHES[0]; 3], n: 0, at: 0, used: true });
                }
            }
            match self.solve((Signs::UP, Signs::UP), control) {
                Verdict::Descent => return Node::Found,
                Verdict::Stopped => return Node::Stopped,
                Verdict::Spent => return Node::Spent,
                Verdict::Stationary | Verdict::Unclear => {}
            }
            for c in self.stack.drain(self.stack.len() - open..) {
                self.assigned[c.k] = None;
            }
        }
        let (p, q) = (BRANCHES[first], BRANCHES[1 - first]);
        Node::Branch(Choice { k, pieces: [p, q, q], n: 2, at: 0, used: false })
    }

    /// A node of the search for multipliers of a type: those of undecided pairs are free.
    fn multiplier_node(&mut self, kind: Stationarity, root: bool, control: &mut Control) -> Node {
        use Signs as T;
        if !root {
            match self.solve((T::ZERO, T::ZERO), control) {
                Verdict::Stationary => {}
                Verdict::Descent => return Node::Prune,
                Verdict::Unclear => return Node::Lost,
                Verdict::Spent => return Node::Spent,
                Verdict::Stopped => return Node::Stopped,
            }
        }
        // at the root the multipliers at hand do
        let z = if root { &self.z } else { &self.lpcc.z };
        let open = (0..self.members.len()).filter(|&k| self.assigned[k].is_none() && !self.satisfies(kind, k, z));
        let violation = |k: usize| -z[self.members[k].0].min(z[self.members[k].1]);
        let Some(k) = open.max_by(|&k, &l| violation(k).total_cmp(&violation(l)).then(l.cmp(&k))) else {
            if !root {
                self.y.copy_from_slice(&self.lpcc.y);
                self.z.copy_from_slice(&self.lpcc.z);
            }
            return Node::Found;
        };
        let (a, b) = self.members[k];
        let both = (T::UP, T::UP);
        let (pieces, n) = match kind {
            Stationarity::M if z[a].abs() <= z[b].abs() => ([(T::FREE, T::ZERO), (T::ZERO, T::FREE), both], 3),
            Stationarity::M => ([(T::ZERO, T::FREE), (T::FREE, T::ZERO), both], 3),
            Stationarity::C if z[a] + z[b] >= 0.0 => ([both, (T::DOWN, T::DOWN), both], 2),
            Stationarity::C => ([(T::DOWN, T::DOWN), both, both], 2),
            _ if z[a] >= z[b] => ([(T::UP, T::ZERO), (T::ZERO, T::UP), both], 2),
            _ => ([(T::ZERO, T::UP), (T::UP, T::ZERO), both], 2),
        };
        Node::Branch(Choice { k, pieces, n, at: 0, used: true })
    }

    /// Keeps the step of the last program and the sides that it takes.
    fn record_descent(&mut self, p: &Local) {
        self.descent = true;
        self.lpcc.unscaled_step(&mut self.d);
        for (q, &(a, b)) in self.biactive.iter().zip(&self.members) {
            let (da, db) = (self.d[a], self.d[b]);
            self.sides[q.pair] = match da.total_cmp(&db) {
                std::cmp::Ordering::Less => Side::First,
                std::cmp::Ordering::Greater => Side::Second,
                std::cmp::Ordering::Equal if p.x[a] <= p.x[b] => Side::First,
                std::cmp::Ordering::Equal => Side::Second,
            };
        }
    }

    /// Is the descent feasible too where members that are not quite zero are positive? Their partners have to stay zero.
    fn descends_either_way(&self) -> bool {
        self.biactive.iter().zip(&self.members).all(|(q, &(a, b))| match q.open {
            (true, false) => self.d[b] <= 0.0,
            (false, true) => self.d[a] <= 0.0,
            _ => true,
        })
    }

    /// With the type that is known, numbers about the multipliers behind it, and what it cost.
    fn describe(&self, mut cert: Certificate) -> Certificate {
        cert.stationarity = self.known;
        cert.biactive = self.biactive.len();
        cert.lps = self.lpcc.lps;
        cert.lp_iterations = self.lpcc.iterations;
        cert.nodes = self.nodes;
        if matches!(self.known, Stationarity::None | Stationarity::Unknown) {
            return cert;
        }
        let (mut least, mut largest) = (f64::INFINITY, 1f64);
        cert.ulsc = true;
        for (q, &(a, b)) in self.biactive.iter().zip(&self.members) {
            for (j, free) in [(a, q.pinned.0), (b, q.pinned.1)] {
                if !free {
                    least = least.min(self.z[j]);
                    largest = largest.max(self.z[j].abs());
                    cert.ulsc &= self.z[j].abs() > self.sign_tol;
                }
            }
        }
        if least.is_finite() {
            cert.min_multiplier = least / largest;
        }
        cert
    }
}

/// How small members of pairs are that are zero, and that may be.
struct Zero {
    surely: f64,
    perhaps: f64,
}

impl Zero {
    /// The errors of a point whose multipliers leave `given` over are as large as its square root, where the objective grows
    /// no faster than by the second order. Relative to the largest member, where that is below 1 and not zero itself.
    fn new(p: &Local, s: &CertSettings, given: Option<(f64, f64)>) -> Zero {
        let largest = p.pairs.iter().fold(0f64, |a, k| a.max(p.x[k.0]).max(p.x[k.1]));
        let unit = if largest > s.active_tol { largest.min(1.0) } else { 1.0 };
        let error = given.map_or(UNKNOWN, |(dual, slack)| (10.0 * dual.max(slack)).sqrt());
        Zero { surely: s.active_tol * unit, perhaps: within(error, s.active_tol, ACTIVE_MAX) * unit }
    }
}

/// The first reason stays.
fn doubt(cert: &mut Certificate, why: Doubt) {
    if cert.doubt == Doubt::None {
        cert.doubt = why;
    }
}

/// What a multiplier of a bound, lower minus upper, costs at the distances given.
fn unused(z: f64, below: f64, above: f64) -> f64 {
    let distance = if z > 0.0 { below } else { above };
    if z == 0.0 {
        0.0
    } else if distance >= 0.5 * INFINITE {
        z.abs()
    } else {
        z.abs() * distance.abs()
    }
}

/// Rows and bounds within `tol`, pairs within `active`.
fn feasible(p: &Local, tol: f64, active: f64) -> bool {
    let inside = |v: f64, lo: f64, hi: f64| {
        v >= lo - tol * lo.abs().clamp(1.0, INFINITE) && v <= hi + tol * hi.abs().clamp(1.0, INFINITE)
    };
    let b = p.bounds;
    (0..p.x.len()).all(|j| inside(p.x[j], b.xl[j], b.xu[j]))
        && (0..p.c.len()).all(|i| inside(p.c[i], b.cl[i], b.cu[i]))
        && p.pairs.iter().all(|&(a, c)| p.x[a].min(p.x[c]) <= active && p.x[a].min(p.x[c]) >= -tol)
}
