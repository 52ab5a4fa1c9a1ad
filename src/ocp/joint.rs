//! Several discretised problems and the links between them as one program.

use super::identify::Identifier;
use super::solve::Built;
use crate::fesd::Fesd;
use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::mpcc::{ActiveSetProposer, Mpcc, MpccSolver, Polish, ProposalKind, Side};
use crate::nlp::{Bounds, Control, Nlp, Outcome};
use crate::system::SharedFunction;

/// `lower ≤ f(x_k(T), x_{k+1}(0)) ≤ upper`.
#[derive(Clone)]
pub(super) struct Link {
    pub(super) f: SharedFunction,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    /// `x_{k+1}(0)` as a function of `x_k(T)`, where the link is that.
    pub(super) start: Option<SharedFunction>,
}

/// The joint program: patterns and where the parts are in it.
pub(super) struct Plan {
    /// First variables, rows and groups of the phases, and one more.
    pub(super) variables: Vec<usize>,
    pub(super) rows: Vec<usize>,
    pub(super) groups: Vec<usize>,
    pub(super) pairs: Vec<(usize, usize)>,
    pub(super) pair_groups: Vec<usize>,
    pub(super) links: Vec<PlacedLink>,
    /// Of the phases that know the time, but for the first.
    pub(super) clocks: Vec<Clock>,
    pub(super) m: usize,
    pub(super) jac: Pattern,
    pub(super) hess: Pattern,
    pub(super) jac_map: Vec<usize>,
    pub(super) hess_map: Vec<usize>,
    /// Room for the derivatives of a part, and of a link.
    pub(super) values: Vec<f64>,
    pub(super) inputs: Vec<f64>,
    pub(super) work: Vec<f64>,
}

/// A link with its place in the program.
pub(super) struct PlacedLink {
    pub(super) row: usize,
    pub(super) link: Link,
    /// The end of a phase, and the start of the next: a link knows no time.
    states: Vec<usize>,
}

/// The row that says when a phase begins.
pub(super) struct Clock {
    pub(super) row: usize,
    pub(super) variable: usize,
    /// Lengths before it that are variables, with their factors.
    pub(super) lengths: Vec<(usize, f64)>,
}

/// What stands in a map of entries for one that belongs to a constant.
const NOWHERE: usize = usize::MAX;

impl Plan {
    /// The program of phases and the links between each and the next.
    pub(super) fn new(links: &[Vec<Link>], built: &[Box<Built>]) -> Plan {
        let mut p = Plan {
            variables: vec![0],
            rows: vec![0],
            groups: vec![0],
            pairs: Vec::new(),
            pair_groups: Vec::new(),
            links: Vec::new(),
            clocks: Vec::new(),
            m: 0,
            jac: Pattern::empty(0, 0),
            hess: Pattern::empty(0, 0),
            jac_map: Vec::new(),
            hess_map: Vec::new(),
            values: Vec::new(),
            inputs: Vec::new(),
            work: Vec::new(),
        };
        let (mut jac, mut hess) = ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()));
        let (mut n, mut m, mut n_groups, mut room) = (0, 0, 0, 0);
        for b in built {
            let f = &b.problem;
            p.pairs.extend(f.pairs().iter().map(|(x, y)| (n + x, n + y)));
            p.pair_groups.extend((0..f.pairs().len()).map(|k| n_groups + f.group(k)));
            record(f.jac_pattern(), &mut jac, |i| m + i, |j| n + j);
            record(f.hess_pattern(), &mut hess, |i| n + i, |j| n + j);
            room = room.max(f.jac_pattern().nnz()).max(f.hess_pattern().nnz());
            n += f.n();
            m += f.m();
            n_groups += f.n_groups();
            p.variables.push(n);
            p.rows.push(m);
            p.groups.push(n_groups);
        }
        // of every entry of every function: does it belong to variables?
        let (mut in_jac, mut in_hess) = (vec![true; jac.0.len()], vec![true; hess.0.len()]);
        for (k, list) in links.iter().enumerate() {
            let (a, b) = (&built[k].problem, &built[k + 1].problem);
            let (end, start) = (p.variables[k] + a.end_place(), p.variables[k + 1] + b.places().0);
            let states: Vec<usize> =
                (end..end + a.spec().dcs.dims().x).chain(start..start + b.spec().dcs.dims().x).collect();
            for link in list {
                let f = &link.f;
                for (j, i) in entries(f.jac_pattern()) {
                    let variable = states.get(j);
                    in_jac.push(variable.is_some());
                    if let Some(v) = variable {
                        jac.0.push(m + i);
                        jac.1.push(*v);
                    }
                }
                for (j, i) in entries(f.hess_pattern()) {
                    let variables = states.get(i).zip(states.get(j));
                    in_hess.push(variables.is_some());
                    if let Some((a, b)) = variables {
                        hess.0.push(*a.min(b));
                        hess.1.push(*a.max(b));
                    }
                }
                room = room.max(f.jac_pattern().nnz()).max(f.hess_pattern().nnz());
                p.work.resize(p.work.len().max(f.work_len()), 0.0);
                p.inputs.resize(p.inputs.len().max(states.len()), 0.0);
                let n_out = f.n_out();
                p.links.push(PlacedLink { row: m, link: link.clone(), states: states.clone() });
                m += n_out;
            }
        }
        let mut lengths: Vec<(usize, f64)> = Vec::new();
        for (k, b) in built.iter().enumerate() {
            let f = &b.problem;
            if let (Some(c), true) = (f.spec().dcs.clock(), k > 0) {
                let clock = p.variables[k] + f.places().0 + c;
                jac.0.push(m);
                jac.1.push(clock);
                for &(v, _) in &lengths {
                    jac.0.push(m);
                    jac.1.push(v);
                }
                p.clocks.push(Clock { row: m, variable: clock, lengths: lengths.clone() });
                m += 1;
            }
            lengths.extend(f.horizon_places().1.iter().map(|&(v, s)| (p.variables[k] + v, s)));
        }
        p.m = m;
        let jac = Pattern::from_triplets(m, n, &jac.0, &jac.1);
        let hess = Pattern::from_triplets(n, n, &hess.0, &hess.1);
        (p.jac, p.jac_map) = (jac.0, spread(jac.1, &in_jac));
        (p.hess, p.hess_map) = (hess.0, spread(hess.1, &in_hess));
        p.values = vec![0.0; room];
        p
    }

    pub(super) fn n(&self) -> usize {
        self.variables[self.variables.len() - 1]
    }

    /// Bounds of the phases, of the links, and of the times at which the phases begin, the first at `t0`.
    pub(super) fn bounds(&self, built: &[Box<Built>], t0: f64) -> Bounds {
        let mut all = Bounds::free(self.n(), self.m);
        for (k, b) in built.iter().enumerate() {
            self.put(k, &b.bounds, &mut all);
        }
        for l in &self.links {
            let rows = l.row..l.row + l.link.lower.len();
            all.cl[rows.clone()].copy_from_slice(&l.link.lower);
            all.cu[rows].copy_from_slice(&l.link.upper);
        }
        let mut given = t0;
        let mut clocks = self.clocks.iter();
        for (k, b) in built.iter().enumerate() {
            if k > 0 && b.problem.spec().dcs.clock().is_some() {
                if let Some(c) = clocks.next() {
                    (all.cl[c.row], all.cu[c.row]) = (given, given);
                    (all.xl[c.variable], all.xu[c.variable]) = (f64::NEG_INFINITY, f64::INFINITY);
                }
            }
            given += b.problem.horizon_places().0;
        }
        all
    }

    /// Bounds of a part of all.
    pub(super) fn take(&self, k: usize, all: &Bounds) -> Bounds {
        let (v, r) = (self.variables[k]..self.variables[k + 1], self.rows[k]..self.rows[k + 1]);
        Bounds {
            xl: all.xl[v.clone()].to_vec(),
            xu: all.xu[v].to_vec(),
            cl: all.cl[r.clone()].to_vec(),
            cu: all.cu[r].to_vec(),
        }
    }

    pub(super) fn put(&self, k: usize, own: &Bounds, all: &mut Bounds) {
        let (v, r) = (self.variables[k]..self.variables[k + 1], self.rows[k]..self.rows[k + 1]);
        all.xl[v.clone()].copy_from_slice(&own.xl);
        all.xu[v].copy_from_slice(&own.xu);
        all.cl[r.clone()].copy_from_slice(&own.cl);
        all.cu[r].copy_from_slice(&own.cu);
    }
}

/// Entries of a pattern, column by column: (column, row).
fn entries(p: &Pattern) -> impl Iterator<Item = (usize, usize)> + '_ {
    (0..p.n_cols()).flat_map(move |j| p.rows(j).iter().map(move |&i| (j, i)))
}

/// Places of entries, with [`NOWHERE`] where an entry has none; those behind `present` have one.
fn spread(places: Vec<usize>, present: &[bool]) -> Vec<usize> {
    let mut places = places.into_iter();
    let mut all = Vec::with_capacity(present.len());
    for &has in present {
        all.push(if has { places.next().unwrap_or(NOWHERE) } else { NOWHERE });
    }
    all.extend(places);
    all
}

fn record(p: &Pattern, to: &mut (Vec<usize>, Vec<usize>), row: impl Fn(usize) -> usize, col: impl Fn(usize) -> usize) {
    for j in 0..p.n_cols() {
        for &i in p.rows(j) {
            to.0.push(row(i));
            to.1.push(col(j));
        }
    }
}

/// Solves the joint program along the homotopy: with the other condition at the ends of sliding modes where the usual one has no solution, then from
/// active sets next to what was found. Every phase proposes active sets of its own.
pub(super) fn solve(
    plan: &mut Plan,
    solver: &mut MpccSolver,
    built: &mut [Box<Built>],
    bounds: &Bounds,
    start: &[f64],
    control: &mut Control,
) {
    let (mut problems, mut identifiers): (Vec<_>, Vec<_>) =
        built.iter_mut().map(|b| (&mut b.problem, &mut b.identifier)).unzip();
    let (groups, variables) = (plan.groups.clone(), plan.variables.clone());
    let mut proposer = InTurn { identifiers: &mut identifiers, groups, variables, turn: Turn::default() };
    let mut all = Program { parts: problems.iter_mut().map(|p| &mut **p).collect(), plan };
    solver.solve_with(&mut all, bounds, start, control, &mut proposer);
    let found = solver.solution();
    if found.polish == Polish::Rejected && found.outcome == Outcome::Solved {
        all.parts.iter_mut().for_each(|p| p.set_exit(p.usual_exit().other()));
        if !solver.polish_again(&mut all, bounds, control, &mut proposer) {
            all.parts.iter_mut().for_each(|p| p.set_exit(p.usual_exit()));
            solver.rescue(&mut all, bounds, control, &mut proposer);
        }
    }
}

/// The proposals of all phases.
struct InTurn<'a, 'b> {
    identifiers: &'a mut [&'b mut Identifier],
    /// Where sides and variables of the phases begin, and the end of the last one's.
    groups: Vec<usize>,
    variables: Vec<usize>,
    turn: Turn,
}

impl ActiveSetProposer for InTurn<'_, '_> {
    fn propose(&mut self, kind: ProposalKind, w: &[f64], sides: &mut [Side]) -> bool {
        let InTurn { identifiers, groups, variables, turn } = self;
        let n_phases = identifiers.len();
        let mut ask = |k: usize, kind: ProposalKind| {
            let own = &mut sides[groups[k]..groups[k + 1]];
            identifiers[k].propose(kind, &w[variables[k]..variables[k + 1]], own)
        };
        match kind {
            // the phases change one after the other
            ProposalKind::Improve(k) => turn.next(k, n_phases, |phase, k| ask(phase, ProposalKind::Improve(k))),
            ProposalKind::Rescue(k) => turn.next(k, n_phases, |phase, k| ask(phase, ProposalKind::Rescue(k))),
            // all at once
            _ => (0..n_phases).filter(|&k| ask(k, kind)).count() > 0,
        }
    }
}

/// Whose proposals come next.
#[derive(Default)]
struct Turn {
    phase: usize,
    /// Proposals it made.
    made: usize,
}

impl Turn {
    /// The next proposal, the first one for `k = 0`, of the phase whose turn it is or of one behind it.
    fn next(&mut self, k: usize, n: usize, mut ask: impl FnMut(usize, usize) -> bool) -> bool {
        if k == 0 {
            *self = Turn::default();
        }
        while self.phase < n {
            self.made += 1;
            if ask(self.phase, self.made - 1) {
                return true;
            }
            *self = Turn { phase: self.phase + 1, made: 0 };
        }
        false
    }
}

/// The phases as one program.
pub(super) struct Program<'a> {
    pub(super) parts: Vec<&'a mut Fesd>,
    pub(super) plan: &'a mut Plan,
}

impl PlacedLink {
    /// Calls `body` with the inputs of the function at a point.
    fn with(
        &self,
        w: &[f64],
        inputs: &mut [f64],
        work: &mut [f64],
        body: impl FnOnce(&Point, &mut [f64]) -> EvalResult,
    ) -> EvalResult {
        let inputs = &mut inputs[..self.states.len()];
        inputs.iter_mut().zip(&self.states).for_each(|(v, j)| *v = w[*j]);
        body(&Point { t: 0.0, x: inputs, u: &[], p: &[] }, work)
    }
}

impl Nlp for Program<'_> {
    fn n(&self) -> usize {
        self.plan.n()
    }
    fn m(&self) -> usize {
        self.plan.m
    }
    fn jac_pattern(&self) -> &Pattern {
        &self.plan.jac
    }
    fn hess_pattern(&self) -> &Pattern {
        &self.plan.hess
    }

    fn eval(&mut self, w: &[f64], c: &mut [f64]) -> std::result::Result<f64, EvalError> {
        let plan = &mut *self.plan;
        let mut f = 0.0;
        for (k, p) in self.parts.iter_mut().enumerate() {
            let own = &w[plan.variables[k]..plan.variables[k + 1]];
            f += p.eval(own, &mut c[plan.rows[k]..plan.rows[k + 1]])?;
        }
        for l in &plan.links {
            let f = &l.link.f;
            let out = &mut c[l.row..l.row + f.n_out()];
            l.with(w, &mut plan.inputs, &mut plan.work, |at, work| f.value(at, out, work))?;
        }
        for k in &plan.clocks {
            c[k.row] = w[k.variable] - k.lengths.iter().map(|(v, s)| s * w[*v]).sum::<f64>();
        }
        Ok(f)
    }

    fn derivatives(&mut self, w: &[f64], grad: &mut [f64], jac: &mut [f64]) -> EvalResult {
        let plan = &mut *self.plan;
        jac.fill(0.0);
        let mut at = 0;
        for (k, p) in self.parts.iter_mut().enumerate() {
            let own = plan.variables[k]..plan.variables[k + 1];
            let nnz = p.jac_pattern().nnz();
            p.derivatives(&w[own.clone()], &mut grad[own], &mut plan.values[..nnz])?;
            for (to, v) in plan.jac_map[at..at + nnz].iter().zip(&plan.values) {
                jac[*to] += v;
            }
            at += nnz;
        }
        for l in &plan.links {
            let f = &l.link.f;
            let nnz = f.jac_pattern().nnz();
            let values = &mut plan.values[..nnz];
            l.with(w, &mut plan.inputs, &mut plan.work, |z, work| f.jacobian(z, values, work))?;
            for (to, v) in plan.jac_map[at..at + nnz].iter().zip(&plan.values).filter(|e| *e.0 != NOWHERE) {
                jac[*to] += v;
            }
            at += nnz;
        }
        for k in &plan.clocks {
            jac[plan.jac_map[at]] += 1.0;
            for (i, (_, s)) in k.lengths.iter().enumerate() {
                jac[plan.jac_map[at + 1 + i]] -= s;
            }
            at += 1 + k.lengths.len();
        }
        Ok(())
    }

    fn hessian(&mut self, w: &[f64], obj: f64, y: &[f64], hess: &mut [f64]) -> EvalResult {
        let plan = &mut *self.plan;
        hess.fill(0.0);
        let mut at = 0;
        for (k, p) in self.parts.iter_mut().enumerate() {
            let nnz = p.hess_pattern().nnz();
            let own = &w[plan.variables[k]..plan.variables[k + 1]];
            p.hessian(own, obj, &y[plan.rows[k]..plan.rows[k + 1]], &mut plan.values[..nnz])?;
            for (to, v) in plan.hess_map[at..at + nnz].iter().zip(&plan.values) {
                hess[*to] += v;
            }
            at += nnz;
        }
        for l in &plan.links {
            let f = &l.link.f;
            let nnz = f.hess_pattern().nnz();
            let values = &mut plan.values[..nnz];
            let weights = &y[l.row..l.row + f.n_out()];
            l.with(w, &mut plan.inputs, &mut plan.work, |z, work| f.hessian(z, weights, values, work))?;
            for (to, v) in plan.hess_map[at..at + nnz].iter().zip(&plan.values).filter(|e| *e.0 != NOWHERE) {
                hess[*to] += v;
            }
            at += nnz;
        }
        Ok(())
    }
}

impl Mpcc for Program<'_> {
    fn pairs(&self) -> &[(usize, usize)] {
        &self.plan.pairs
    }
    fn n_groups(&self) -> usize {
        self.plan.groups[self.plan.groups.len() - 1]
    }
    fn group(&self, pair: usize) -> usize {
        self.plan.pair_groups[pair]
    }
    fn is_discretised(&self) -> bool {
        true
    }
    fn sizes(&self, out: &mut [f64]) {
        for (k, p) in self.parts.iter().enumerate() {
            p.sizes(&mut out[self.plan.variables[k]..self.plan.variables[k + 1]]);
        }
    }
    fn set_polishing(&mut self, on: bool) {
        self.parts.iter_mut().for_each(|p| p.set_polishing(on));
    }
    fn set_steepest(&mut self, steepest: f64) {
        self.parts.iter_mut().for_each(|p| p.set_steepest(steepest));
    }
    fn branch(&self, sides: &[Side], bounds: &mut Bounds) {
        for (k, p) in self.parts.iter().enumerate() {
            let mut own = self.plan.take(k, bounds);
            p.branch(&sides[self.plan.groups[k]..self.plan.groups[k + 1]], &mut own);
            self.plan.put(k, &own, bounds);
        }
    }
    fn enter_branch(&self, from: &[Side], to: &[Side], w: &mut [f64]) {
        for (k, p) in self.parts.iter().enumerate() {
            let (groups, own) =
                (self.plan.groups[k]..self.plan.groups[k + 1], self.plan.variables[k]..self.plan.variables[k + 1]);
            p.enter_branch(&from[groups.clone()], &to[groups], &mut w[own]);
        }
    }
}
