//! Models of dynamics written as expressions with operators that switch, turned into a [`System`].
//!
//! ```text
//! ẋ = f0 + Σ_k (terms that switch with the switching functions of group k)
//! ```
//!
//! The right-hand side is split into smooth parts and terms that switch. Terms that share a switching function
//! belong to one group; independent groups become subsystems of their own (6.22), so that `n` friction laws cost `2n`
//! modes and not `2^n`. Within a group every sign pattern that can occur is a cell; what no pattern reaches, switching
//! functions without effect, and rows that are the same in all modes are dropped. [`Report`] says what is left and why.

pub(crate) mod bounds;
mod cells;
mod certificate;
mod clock;
mod combined;
mod on_demand;
mod reach;
mod report;
mod saved;
mod signs;
mod simplex;
pub(crate) mod transition;

pub(crate) use clock::is_state;
pub use clock::{Clock, Pwm, Strikes};
pub use report::{Counts, Group, Note, NoteKind, Report};
pub use saved::SavedModel;
pub use transition::Transition;

pub(crate) use saved::{SavedDirection, SavedNames, SavedRule, SavedTransition, SavedValue};

use std::collections::BTreeMap;
use std::sync::Arc;

use num_traits::{ToPrimitive, Zero};

use crate::error::{Error, Result};
use crate::expr::{Block, Dag, Expr, ExprFunction, Graph, Id, Node, Tape};
use crate::func::{Dims, Function, Point};
use crate::system::{moving, Choice, Regions, SharedFunction, Subsystem, System};
use bounds::Bounds;
use cells::{cells, Cells, Row};
use certificate::Conflict;
use reach::{Decision, Reach};
use signs::Numbers;

/// Names of the inputs, for reports; missing ones are `x[0]`, `u[0]`, ...
#[derive(Debug, Clone, Default)]
pub struct Names {
    /// Names of the states.
    pub x: Vec<String>,
    /// Names of the controls.
    pub u: Vec<String>,
    /// Names of the parameters.
    pub p: Vec<String>,
}

impl Names {
    pub(crate) fn of(&self, block: Block, i: usize) -> String {
        let (list, letter) = match block {
            Block::X => (&self.x, "x"),
            Block::U => (&self.u, "u"),
            Block::P => (&self.p, "p"),
            Block::T => return "t".into(),
            Block::Weight => return format!("w[{i}]"),
            Block::Unknown => return format!("unknown[{i}]"),
        };
        list.get(i).filter(|n| !n.is_empty()).cloned().unwrap_or_else(|| format!("{letter}[{i}]"))
    }
}

/// A point where the model is tried out while it is built.
#[derive(Debug, Clone, Default)]
pub struct Trial {
    /// Time.
    pub t: f64,
    /// States.
    pub x: Vec<f64>,
    /// Controls; zero if empty.
    pub u: Vec<f64>,
    /// Parameters; zero if empty.
    pub p: Vec<f64>,
}

impl Trial {
    fn controls(&self, n: usize) -> Vec<f64> {
        if self.u.is_empty() {
            vec![0.0; n]
        } else {
            self.u.clone()
        }
    }

    fn parameters(&self, n: usize) -> Vec<f64> {
        if self.p.is_empty() {
            vec![0.0; n]
        } else {
            self.p.clone()
        }
    }
}

/// A model: sizes, and the derivative of every state.
#[derive(Debug, Clone)]
pub struct Model {
    name: String,
    dims: Dims,
    names: Names,
    rhs: Vec<Option<Id>>,
    trial: Option<Trial>,
    discrete: Vec<f64>,
    value_names: Vec<Vec<String>>,
    transitions: Vec<Transition>,
    choices: Vec<Choice>,
}

/// The system made of a model, with the report on it.
#[derive(Clone)]
pub struct Built {
    /// The system.
    pub system: System,
    /// Its parts, its costs, and what was dropped from it.
    pub report: Report,
    /// The functions of the system, to be written out or evaluated: smooth part, then modes and switching functions
    /// of every subsystem, then guard and reset of every transition.
    pub functions: Vec<Arc<ExprFunction>>,
    /// Sizes of the model.
    pub dims: Dims,
    saved: Arc<Result<SavedModel>>,
    names: Names,
    /// States that nothing drives.
    still: Vec<bool>,
    discrete: Vec<f64>,
    value_names: Vec<Vec<String>>,
    transitions: Vec<Transition>,
}

impl Built {
    /// The model it was built from, for documents; an error if it cannot be saved.
    pub fn source(&self) -> Result<&SavedModel> {
        self.saved.as_ref().as_ref().map_err(Error::clone)
    }

    /// Changes what documents say of the model; what cannot be saved makes the whole model one that cannot.
    fn change_source(&mut self, change: impl FnOnce(&mut SavedModel) -> Result<()>) {
        let saved = Arc::make_mut(&mut self.saved);
        if let Err(e) = saved.as_mut().map_err(|e| e.clone()).and_then(change) {
            *saved = Err(e);
        }
    }
}

impl Model {
    /// A model without equations.
    pub fn new(name: &str, nx: usize, nu: usize, np: usize) -> Result<Model> {
        if nx == 0 {
            return Err(Error::Dimension("a model needs at least one state".into()));
        }
        Ok(Model {
            name: name.to_owned(),
            dims: Dims { x: nx, u: nu, p: np },
            names: Names::default(),
            rhs: vec![None; nx],
            trial: None,
            discrete: Vec::new(),
            value_names: Vec::new(),
            transitions: Vec::new(),
            choices: Vec::new(),
        })
    }

    /// A model from the derivatives of all states.
    pub fn from_rhs(name: &str, nu: usize, np: usize, rhs: &[Expr]) -> Result<Model> {
        let mut m = Model::new(name, rhs.len(), nu, np)?;
        for (i, e) in rhs.iter().enumerate() {
            m.rhs[i] = Some(e.id());
        }
        Ok(m)
    }

    /// Sizes.
    pub fn dims(&self) -> Dims {
        self.dims
    }

    /// Names for reports and messages.
    pub fn set_names(&mut self, names: Names) {
        self.names = names;
    }

    /// Sets the derivative of a state.
    pub fn set_derivative(&mut self, state: usize, rhs: Id) -> Result<()> {
        match self.rhs.get_mut(state) {
            Some(r) => {
                *r = Some(rhs);
                Ok(())
            }
            None => Err(Error::Range(format!("state {state} does not exist: the model has {}", self.dims.x))),
        }
    }

    /// Derivatives of the states; `None` where one is missing.
    pub fn derivatives(&self) -> &[Option<Id>] {
        &self.rhs
    }

    /// A point, the initial one as a rule, where all functions should be defined.
    pub fn set_trial(&mut self, trial: Trial) -> Result<()> {
        for (what, v, n) in
            [("state", &trial.x, self.dims.x), ("control", &trial.u, self.dims.u), ("parameter", &trial.p, self.dims.p)]
        {
            if !(v.is_empty() && what != "state") {
                crate::error::finite(what, v, n)?;
            }
        }
        self.trial = Some(trial);
        Ok(())
    }

    /// Builds the system with the expressions of a [`Graph`].
    pub fn build(&self, graph: &Graph) -> Result<Built> {
        self.build_in(&mut graph.dag())
    }

    /// Builds the system. The time it takes grows with the number of nodes; [`crate::stop`] ends it.
    ///
    /// Where so many switching functions are coupled that their sign patterns cannot be enumerated, the modes of the system are formed
    /// on demand ([`System::on_demand`]): event-driven simulation takes it, and nothing else does.
    ///
    /// # Errors
    /// [`Error::State`] if a state has no derivative, [`Error::Unsupported`] if there are more than [`MAX_NODES`] nodes, and those of
    /// [`ExprFunction::new`].
    pub fn build_in(&self, dag: &mut Dag) -> Result<Built> {
        self.check_size(dag)?;
        let saved = Arc::new(SavedModel::new(self, dag));
        let mut b = Builder { model: self, dag, notes: Vec::new() };
        let rhs = b.derivatives()?;
        let mut built = match b.enumerate(&rhs)? {
            Some(all) => b.assemble_all(&all, saved)?,
            None => b.on_demand(&rhs, saved)?,
        };
        if !self.discrete.is_empty() {
            built.set_discrete(&self.discrete)?;
        }
        for (k, names) in self.value_names.iter().enumerate().filter(|(_, names)| !names.is_empty()) {
            built.set_value_names(k, names)?;
        }
        for t in &self.transitions {
            built.add_transition(dag, t.clone())?;
        }
        for c in &self.choices {
            built.add_choice(c.control, &c.values, c.dwell)?;
        }
        Ok(built)
    }

    fn check_size(&self, dag: &Dag) -> Result<()> {
        let roots: Vec<Id> = self.rhs.iter().flatten().copied().collect();
        let n = dag.reachable(&roots).len();
        if n <= MAX_NODES {
            return Ok(());
        }
        Err(Error::Unsupported(format!(
            "the derivatives of {} consist of {n} nodes, a model may have {MAX_NODES}: write what is large, a network or a \
             chain of many operations, as a function of its own and call that",
            self.name
        )))
    }
}

/// Nodes of all derivatives of a model. With first and second derivatives, and programs to evaluate them, a node costs
/// about a kilobyte and ten microseconds.
pub const MAX_NODES: usize = 1 << 21;

/// A term of the difference of two speeds across a surface: component of the gradient, value in the one and the other
/// mode.
type Across = [Id; 3];

/// Terms of `∇ψᵀ (f_a − f_b)`.
fn terms_across(c: &Cells, gradient: &[(usize, Id)], a: &[Id], b: &[Id]) -> Vec<Across> {
    let of = |(k, row): (usize, &usize)| gradient.iter().find(|g| g.0 == *row).map(|g| [g.1, a[k], b[k]]);
    c.rows.iter().enumerate().filter_map(of).collect()
}

/// What is smaller at the trial point, relative to the terms it is the sum of, is zero: some thousand times rounding.
const AT_TRIAL: f64 = 1e-12;

/// Proofs a report shows for the patterns of one group; more would not be read.
const MAX_PROOFS: usize = 3;

/// The steps of [`Model::build_in`].
struct Builder<'a> {
    model: &'a Model,
    dag: &'a mut Dag,
    notes: Vec<Note>,
}

/// Derivatives over smooth switching functions, taken apart.
struct Enumerated {
    rhs: Vec<Id>,
    f0: Vec<Id>,
    subsystems: Vec<Cells>,
    /// Groups in which nothing switches.
    settled: Vec<Cells>,
}

type Groups = Vec<(Vec<usize>, Vec<Row>)>;

impl Builder<'_> {
    fn text(&self, id: Id) -> String {
        self.dag.text_with(id, &|block, i| self.model.names.of(block, i))
    }

    fn note(&mut self, kind: NoteKind, text: String) {
        self.notes.push(Note { kind, text });
    }

    fn psi_text(&self, s: usize) -> String {
        self.dag.switching_function(s).map_or_else(String::new, |p| self.text(p))
    }

    /// Derivatives of all states over smooth switching functions.
    fn derivatives(&mut self) -> Result<Vec<Id>> {
        let names = &self.model.names;
        let mut rhs = Vec::with_capacity(self.model.dims.x);
        for (i, r) in self.model.rhs.iter().enumerate() {
            let name = names.of(Block::X, i);
            let r = r.ok_or_else(|| {
                Error::State(format!(
                    "{}: state {name} has no derivative; set it to 0 if it is constant",
                    self.model.name
                ))
            })?;
            if self.dag.is_condition(r) {
                return Err(Error::Range(format!("the derivative of {name} is a condition: choose values with where")));
            }
            if self.dag.has_floor(&[r]) {
                return Err(Error::Unsupported(format!(
                    "the derivative of {name} has floor, which jumps again and again: hold the value in a discrete state, which a clock or a \
                     transition resets"
                )));
            }
            rhs.push(r);
        }
        Ok(rhs)
    }

    /// Smooth parts and modes of the derivatives `rhs`; none where there are too many sign patterns.
    fn enumerate(&mut self, rhs: &[Id]) -> Result<Option<Enumerated>> {
        let given = self.dag.switches_of(rhs);
        let Some(rhs) = self.dag.smooth_switches(rhs)? else { return Ok(None) };
        let nested = self.dag.switches_of(&rhs) != given;
        let n_notes = self.notes.len();
        let bounds = self.bounds(&rhs);
        let rhs = self.settle_constant_signs(&rhs, &bounds);
        let (mut f0, groups) = self.split(&rhs);
        let (mut subsystems, mut settled) = (Vec::new(), Vec::new());
        for (switches, rows) in groups {
            let Some(c) = cells(self.dag, &bounds, &switches, &rows, nested)? else {
                self.notes.truncate(n_notes);
                return Ok(None);
            };
            for &(state, v) in &c.smooth {
                f0[state] = self.dag.add(f0[state], v);
            }
            self.note_reduction(&c);
            if c.rows.is_empty() {
                settled.push(c);
            } else {
                subsystems.push(c);
            }
        }
        Ok(Some(Enumerated { rhs, f0, subsystems, settled }))
    }

    fn assemble_all(mut self, all: &Enumerated, saved: Arc<Result<SavedModel>>) -> Result<Built> {
        let combined = self.combined(&all.rhs, &all.f0, &all.subsystems, &all.settled)?;
        let mut built = self.assemble(&all.f0, &all.subsystems, saved)?;
        if let Some(f) = combined {
            built.system.set_combined(f)?;
        }
        Ok(built)
    }

    /// Bounds of all switching functions and what they consist of.
    fn bounds(&self, rhs: &[Id]) -> Bounds {
        let psi: Vec<Id> =
            self.dag.switches_of(rhs).into_iter().filter_map(|s| self.dag.switching_function(s)).collect();
        Bounds::new(self.dag, &psi)
    }

    /// Decides switching functions that have one sign everywhere, where it is proven.
    fn settle_constant_signs(&mut self, rhs: &[Id], bounds: &Bounds) -> Vec<Id> {
        let mut known: Vec<(usize, bool)> = Vec::new();
        for s in self.dag.switches_of(rhs) {
            let Some(psi) = self.dag.switching_function(s) else { continue };
            let reach = Reach::new(self.dag, bounds, &[psi]);
            let (plus, minus) = (reach.decide(&[true]), reach.decide(&[false]));
            let (sign, positive, proof) = match (plus, minus) {
                (Decision::Never(_), Decision::Never(proof)) => ("anything but zero", false, proof),
                (Decision::Never(proof), _) => ("positive", false, proof),
                (_, Decision::Never(proof)) => ("negative", true, proof),
                _ => continue,
            };
            let since = proof.bounds_text(&|id| self.text(id));
            let text = format!("{} is never {sign}, since {since}: it does not switch", self.psi_text(s));
            self.note(NoteKind::Dropped, text);
            known.push((s, positive));
        }
        self.dag.decide(rhs, &|s| known.iter().find(|k| k.0 == s).map(|k| k.1))
    }

    /// Smooth parts, and groups of terms that share switching functions.
    fn split(&mut self, rhs: &[Id]) -> (Vec<Id>, Groups) {
        let mut f0 = Vec::with_capacity(rhs.len());
        let mut terms: Vec<(usize, Id, Id, Vec<usize>)> = Vec::new();
        for (state, &r) in rhs.iter().enumerate() {
            let (smooth, split) = self.dag.split_sum(r);
            f0.push(smooth);
            for (factor, atom) in split {
                terms.push((state, factor, atom, self.dag.switches_of(&[atom])));
            }
        }
        // Switching functions of one term belong together.
        let n = self.dag.n_switches();
        let mut group: Vec<usize> = (0..n).collect();
        for t in &terms {
            let least = t.3.iter().map(|&s| group[s]).min().unwrap_or(0);
            let joined: Vec<usize> = t.3.iter().map(|&s| group[s]).collect();
            for g in &mut group {
                if joined.contains(g) {
                    *g = least;
                }
            }
        }
        let mut ids: Vec<usize> = terms.iter().map(|t| group[t.3[0]]).collect();
        ids.sort_unstable();
        ids.dedup();
        let mut groups = Vec::new();
        for id in ids {
            let mine = |t: &&(usize, Id, Id, Vec<usize>)| group[t.3[0]] == id;
            let mut switches: Vec<usize> = terms.iter().filter(mine).flat_map(|t| t.3.iter().copied()).collect();
            switches.sort_unstable();
            switches.dedup();
            let mut rows: Vec<Row> = Vec::new();
            for t in terms.iter().filter(mine) {
                match rows.iter_mut().find(|r| r.state == t.0) {
                    Some(r) => r.terms.push((t.1, t.2)),
                    None => rows.push(Row { state: t.0, terms: vec![(t.1, t.2)] }),
                }
            }
            groups.push((switches, rows));
        }
        (f0, groups)
    }

    fn note_reduction(&mut self, c: &Cells) {
        for &s in &c.without_effect {
            let text = format!("{} makes no difference to any mode", self.psi_text(s));
            self.note(NoteKind::Dropped, text);
        }
        let (possible, all) = c.n_patterns;
        if (possible as f64) < all {
            let names: Vec<String> = c.switches.iter().take(4).map(|&s| self.psi_text(s)).collect();
            let mut text =
                format!("{} of {all} sign patterns of {} cannot occur", all - possible as f64, names.join(", "));
            let proof = |p: &Conflict| p.text(&|k| self.psi_text(c.coupled[k]), &|id| self.text(id));
            let shown: Vec<String> = c.conflicts.iter().take(MAX_PROOFS).map(proof).collect();
            if !shown.is_empty() {
                text += &format!(": {}", shown.join("; "));
            }
            match c.conflicts.len().saturating_sub(MAX_PROOFS) {
                0 => {}
                1 => text += "; and one more proof",
                n => text += &format!("; and {n} more proofs"),
            }
            self.note(NoteKind::Dropped, text);
        }
        let (rows, distinct) = (c.modes.len(), c.n_distinct());
        if c.modes.len() < c.n_cells() {
            let text = format!("{} cells with equal modes became {rows} regions", c.n_cells());
            self.note(NoteKind::Merged, text);
        } else if distinct < rows {
            let text = format!("{rows} regions have {distinct} different modes");
            self.note(NoteKind::Merged, text);
        }
        for &(condition, holds) in &c.decided {
            let text = format!("{} is always {holds}: one side of the choice is never taken", self.text(condition));
            self.note(NoteKind::Warning, text);
        }
        for (state, _) in &c.smooth {
            let text = format!("the derivative of {} is the same in all modes", self.model.names.of(Block::X, *state));
            self.note(NoteKind::Dropped, text);
        }
    }

    /// Switching functions that were written in two ways with numbers that differ in the last digit.
    fn note_nearly_equal(&mut self, switches: &[usize]) {
        for &s in switches {
            for psi in self.dag.nearly_equal(s).to_vec() {
                let text = format!(
                    "{} is taken for {}: their coefficients agree to the last binary digit",
                    self.text(psi),
                    self.psi_text(s)
                );
                self.note(NoteKind::Merged, text);
            }
        }
    }

    fn function(&mut self, name: &str, outputs: &[Id]) -> Result<Arc<ExprFunction>> {
        Ok(Arc::new(ExprFunction::new(name, self.dag, self.model.dims, outputs)?))
    }

    fn assemble(mut self, f0: &[Id], subsystems: &[Cells], saved: Arc<Result<SavedModel>>) -> Result<Built> {
        let d = self.model.dims;
        let mut system = System::new(d.x, d.u, d.p)?;
        let mut functions = Vec::new();
        let mut groups = Vec::new();
        let zero = self.dag.constant(0.0);
        let smooth: Vec<usize> = (0..d.x).filter(|&i| f0[i] != zero).collect();
        // A system needs dynamics of some kind.
        if !smooth.is_empty() || subsystems.is_empty() {
            let f = self.function("f0", f0)?;
            system.set_f0(f.clone())?;
            functions.push(f);
        }
        for (k, c) in subsystems.iter().enumerate() {
            let values: Vec<Id> = c.modes.iter().flat_map(|m| m.1.iter().copied()).collect();
            let name = format!("modes{k}");
            let modes = Arc::new(ExprFunction::with_parts(&name, self.dag, d, &values, c.rows.len())?);
            let psi: Vec<Id> = c.switches.iter().filter_map(|&s| self.dag.switching_function(s)).collect();
            let psi_function = self.function(&format!("psi{k}"), &psi)?;
            let moves = moving(&*psi_function);
            let signs: Vec<i8> = c.modes.iter().flat_map(|m| m.0.iter().copied()).collect();
            self.note_nearly_equal(&c.switches);
            self.lint_switches(&psi)?;
            self.lint_sliding(c, &psi)?;
            self.lint_corners(c, &psi);
            let shared: [SharedFunction; 2] = [modes.clone(), psi_function.clone()];
            functions.extend([modes, psi_function]);
            let [modes, psi_shared] = shared;
            system.add_subsystem(Subsystem {
                rows: c.rows.clone(),
                modes,
                n_modes: c.modes.len(),
                regions: Regions::Signs { psi: psi_shared, signs: signs.clone() },
            })?;
            groups.push(Group {
                states: c.rows.iter().map(|&r| self.model.names.of(Block::X, r)).collect(),
                switching_functions: psi.iter().map(|&p| self.text(p)).collect(),
                moves,
                n_regions: c.modes.len(),
                n_modes: c.n_distinct(),
                n_cells: c.n_cells(),
                signs,
            });
        }
        let still = self.lint_states(f0, subsystems);
        self.lint_tables(f0, subsystems, &still);
        self.lint_trial(&functions, subsystems);
        let t_col = d.t_col();
        let clock = functions.iter().any(|f| !f.jac_pattern().rows(t_col).is_empty());
        let report = Report { n_smooth: smooth.len(), groups, ..self.report(clock) };
        self.built(system, report, functions, saved, still)
    }

    /// The report of a model without groups, with the notes so far.
    fn report(&mut self, clock: bool) -> Report {
        let d = self.model.dims;
        Report {
            name: self.model.name.clone(),
            n_states: d.x,
            n_controls: d.u,
            n_parameters: d.p,
            clock,
            n_smooth: 0,
            groups: Vec::new(),
            discrete: Vec::new(),
            value_names: Vec::new(),
            transitions: Vec::new(),
            choices: Vec::new(),
            notes: std::mem::take(&mut self.notes),
        }
    }

    /// What the model became, without discrete states and transitions.
    fn built(
        &self,
        mut system: System,
        report: Report,
        functions: Vec<Arc<ExprFunction>>,
        saved: Arc<Result<SavedModel>>,
        still: Vec<bool>,
    ) -> Result<Built> {
        let rhs: Vec<Id> = self.model.rhs.iter().flatten().copied().collect();
        system.add_known_times(&self.dag.table_times(&rhs))?;
        Ok(Built {
            system,
            report,
            functions,
            dims: self.model.dims,
            saved,
            names: self.model.names.clone(),
            still,
            discrete: Vec::new(),
            value_names: Vec::new(),
            transitions: Vec::new(),
        })
    }

    /// Gradient of an expression with respect to states and time: indices (`nx` is the time) and entries.
    fn gradient(&mut self, id: Id) -> Result<Vec<(usize, Id)>> {
        let mut wrt = self.dag.inputs(Block::X, self.model.dims.x);
        wrt.push(self.dag.input(Block::T, 0));
        Ok(self.dag.jacobian(&[id], &wrt)?.into_iter().map(|e| (e.col, e.value)).collect())
    }

    fn lint_switches(&mut self, psi: &[Id]) -> Result<()> {
        for &p in psi {
            let name = self.text(p);
            if self.gradient(p)?.is_empty() {
                let text = format!("{name} depends neither on the state nor on time: it cannot be crossed");
                self.note(NoteKind::Warning, text);
            }
            let controls =
                self.dag.reachable(&[p]).into_iter().any(|i| matches!(self.dag.node(i), Node::Input(Block::U, _)));
            if controls {
                let text = format!("{name} depends on a control: it jumps with the control between stages");
                self.note(NoteKind::Warning, text);
            }
            // g² or g² h vanishes with its gradient.
            let (constant, terms) = self.dag.affine_terms(p);
            let flat = |t: Id| matches!(self.dag.node(t), Node::PowI(_, n) if n > 1);
            if constant.is_zero() && terms.iter().all(|t| flat(t.0)) {
                let text = format!("{name} has no gradient where it vanishes: write it without the power");
                self.note(NoteKind::Warning, text);
            }
        }
        Ok(())
    }

    /// Speeds across each switching surface: modes with equal ones on both sides have no sliding mode between them, and
    /// the matrix `∇gᵀF` of the active modes is singular where the difference vanishes.
    fn lint_sliding(&mut self, c: &Cells, psi: &[Id]) -> Result<()> {
        let numbers = Numbers::new(c.modes.iter().map(|m| &m.0));
        for (j, &p) in psi.iter().enumerate() {
            let name = self.text(p);
            let gradient = self.gradient(p)?;
            let mut across = Vec::new();
            for group in numbers.equal_without(j, |i| &c.modes[i].0, |i| c.modes[i].0[j] == 0) {
                if let [a, b] = group[..] {
                    across.push(terms_across(c, &gradient, &c.modes[a].1, &c.modes[b].1));
                }
            }
            if across.is_empty() {
                continue;
            }
            let mut differences = across.iter().map(|terms| self.difference(terms)).collect::<Vec<Id>>().into_iter();
            if differences.all(|d| self.dag.as_const(d) == Some(0.0)) {
                let text = format!("both sides cross {name} = 0 with the same speed: no sliding mode");
                self.note(NoteKind::Info, text);
            } else if self.vanish_at_trial(p, &across)? {
                let text = format!(
                    "at the trial point {name} = 0 and both sides have the same speed across: what follows is not decided \
                     by the modes (singular M_I)"
                );
                self.note(NoteKind::Warning, text);
            }
        }
        Ok(())
    }

    /// Where two switching functions vanish together the velocity is `f + s̄ f_s + r̄ f_r + m f_sr` with the means `s̄`, `r̄` of the two
    /// signs, which the surfaces determine, and the mean `m` of their product, which nothing does: a continuum unless `f_sr = 0`
    /// (L. Dieci, L. Lopez, *Sliding motion on discontinuity surfaces of high co-dimension*, Numer. Math. 117 (2011) 779-811).
    fn lint_corners(&mut self, c: &Cells, psi: &[Id]) {
        /// Of more switching functions, or more modes, the pairs are not looked at.
        const MOST: usize = 8;
        if psi.len() > MOST || c.modes.len() > 1 << MOST {
            return;
        }
        let n = c.rows.len();
        for (j, k) in (0..psi.len()).flat_map(|j| (j + 1..psi.len()).map(move |k| (j, k))) {
            let at = |a: &[i8], sj: i8, sk: i8| {
                let fits = |m: &&(Vec<i8>, Vec<Id>)| {
                    m.0[j] == sj && m.0[k] == sk && (0..psi.len()).all(|i| i == j || i == k || m.0[i] == a[i])
                };
                c.modes.iter().find(fits)
            };
            let corner = |a: &(Vec<i8>, Vec<Id>)| {
                let [b, d, e] = [(-1, 1), (1, -1), (-1, -1)].map(|(sj, sk)| at(&a.0, sj, sk));
                let (b, d, e) = (b?.1.clone(), d?.1.clone(), e?.1.clone());
                Some([a.1.clone(), b, d, e])
            };
            let corners: Vec<[Vec<Id>; 4]> =
                c.modes.iter().filter(|a| a.0[j] == 1 && a.0[k] == 1).filter_map(corner).collect();
            let multiplied = corners
                .iter()
                .any(|[a, b, d, e]| (0..n).any(|r| !self.cancels(&[(a[r], 1), (b[r], -1), (d[r], -1), (e[r], 1)])));
            if multiplied {
                let text = format!(
                    "the effects of {} and {} do not add: where both vanish and a sliding mode holds them, the modes allow a continuum of \
                     velocities, of which a simulation takes the one that the option selection asks for",
                    self.text(psi[j]),
                    self.text(psi[k])
                );
                self.note(NoteKind::Info, text);
            }
        }
    }

    /// Is the sum of these expressions with these signs zero, but for the rounding of their coefficients?
    fn cancels(&self, terms: &[(Id, i8)]) -> bool {
        const ROUNDING: f64 = 1e-12;
        let mut sums: BTreeMap<Option<Id>, (f64, f64)> = BTreeMap::new();
        for &(id, sign) in terms {
            let (constant, parts) = self.dag.affine_terms(id);
            for (term, c) in parts.iter().map(|(t, c)| (Some(*t), c)).chain([(None, &constant)]) {
                let (c, sum) = (c.to_f64().unwrap_or(f64::NAN), sums.entry(term).or_default());
                *sum = (sum.0 + f64::from(sign) * c, sum.1 + c.abs());
            }
        }
        sums.values().all(|(sum, size)| sum.abs() <= ROUNDING * size)
    }

    /// `∇ψᵀ (f_a − f_b)`
    fn difference(&mut self, terms: &[Across]) -> Id {
        let mut sum = self.dag.constant(0.0);
        for &[g, a, b] in terms {
            let d = self.dag.sub(a, b);
            let term = self.dag.mul(g, d);
            sum = self.dag.add(sum, term);
        }
        sum
    }

    /// Is the trial point on the surface, with a difference that vanishes? Both to rounding of the terms they are sums of.
    fn vanish_at_trial(&mut self, psi: Id, across: &[Vec<Across>]) -> Result<bool> {
        let Some(t) = &self.model.trial else { return Ok(false) };
        let d = self.model.dims;
        let mut outputs = vec![psi];
        let (_, terms) = self.dag.affine_terms(psi);
        outputs.extend(terms.iter().map(|t| t.0));
        let n = outputs.len();
        outputs.extend(across.iter().flatten().flatten());
        let tape = Tape::new(self.dag, d, 0, &outputs)?;
        let (u, p) = (t.controls(d.u), t.parameters(d.p));
        let (mut out, mut work) = (vec![0.0; outputs.len()], vec![0.0; tape.work_len()]);
        if tape.run(&Point { t: t.t, x: &t.x, u: &u, p: &p }, &[], &mut out, &mut work).is_err() {
            return Ok(false);
        }
        // the constant is as large as the rest where ψ vanishes
        let size = terms.iter().zip(&out[1..n]).map(|((_, c), v)| (c.to_f64().unwrap_or(0.0) * v).abs()).sum::<f64>();
        if out[0].abs() > AT_TRIAL * size {
            return Ok(false);
        }
        let mut values = out[n..].chunks_exact(3);
        Ok(across.iter().any(|terms| {
            let (mut sum, mut size) = (0.0, 0.0);
            for v in values.by_ref().take(terms.len()) {
                sum += v[0] * (v[1] - v[2]);
                size += v[0].abs() * (v[1].abs() + v[2].abs());
            }
            sum.abs() <= AT_TRIAL * size
        }))
    }

    /// States that nothing drives.
    fn lint_states(&mut self, f0: &[Id], subsystems: &[Cells]) -> Vec<bool> {
        let driven = |i: usize| subsystems.iter().any(|c| c.rows.contains(&i));
        let still: Vec<bool> =
            f0.iter().enumerate().map(|(i, &f)| self.dag.as_const(f) == Some(0.0) && !driven(i)).collect();
        for (i, _) in still.iter().enumerate().filter(|s| *s.1) {
            let text = transition::constant_note(&self.model.names.of(Block::X, i));
            self.note(NoteKind::Info, text);
        }
        still
    }

    /// Tables that jump are followed without switch detection; those of discrete states never jump between transitions.
    fn lint_tables(&mut self, f0: &[Id], subsystems: &[Cells], still: &[bool]) {
        let mut roots = f0.to_vec();
        roots.extend(subsystems.iter().flat_map(|c| c.modes.iter().flat_map(|m| m.1.iter().copied())));
        let is_rough = |i: &Id| self.dag.smoothness(*i) < 1 && !self.dag.is_continuation(*i);
        let rough: Vec<Id> = self.dag.reachable(&roots).into_iter().filter(is_rough).collect();
        for id in rough {
            let moves = |i: Id| matches!(self.dag.node(i), Node::Input(Block::X, k) if !still[k as usize]);
            if self.dag.reachable(&[id]).into_iter().any(moves) {
                let text = format!(
                    "{} jumps or has kinks and depends on the state: its breaks are not found as switches; use a table \
                     with switching functions",
                    self.text(id)
                );
                self.note(NoteKind::Warning, text);
            }
        }
    }

    fn lint_trial(&mut self, functions: &[Arc<ExprFunction>], subsystems: &[Cells]) {
        let Some(t) = &self.model.trial else { return };
        let d = self.model.dims;
        let (u, p) = (t.controls(d.u), t.parameters(d.p));
        let at = Point { t: t.t, x: &t.x, u: &u, p: &p };
        let mut bad = Vec::new();
        for f in functions {
            let mut work = vec![0.0; f.work_len()];
            let mut out = vec![0.0; f.n_out()];
            let mut jac = vec![0.0; f.jac_pattern().nnz()];
            let what = match (f.value(&at, &mut out, &mut work), f.jacobian(&at, &mut jac, &mut work)) {
                (Err(_), _) => "value",
                (_, Err(_)) => "derivative",
                _ => continue,
            };
            let modes = f.name().strip_prefix("modes").and_then(|k| k.parse::<usize>().ok());
            let of = match modes.and_then(|k| subsystems.get(k)) {
                Some(c) => {
                    let states: Vec<String> = c.rows.iter().map(|&r| self.model.names.of(Block::X, r)).collect();
                    format!("some mode of {}", states.join(", "))
                }
                None => f.name().to_owned(),
            };
            bad.push(format!("the {what} of {of} is not defined at the trial point"));
        }
        for text in bad {
            self.note(NoteKind::Warning, text);
        }
    }
}
