//! Several discretised problems and the links between them as one program.

use super::solve::Built;
use crate::fesd::Fesd;
use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::csc::Pattern;
use crate::mpcc::{Mpcc, Side};
use crate::nlp::{Bounds, Nlp};
use crate::system::SharedFunction;

/// `lower ≤ f(x_k(T), x_{k+1}(0)) ≤ upper`.
#[derive(Clone)]
pub(super) struct Link {
    pub(super) f: SharedFunction,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
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
    pub(super) f: SharedFunction,
    pub(super) row: usize,
    /// Variables behind its inputs, but for the time.
    pub(super) inputs: Vec<usize>,
}

/// The row that says when a phase begins.
pub(super) struct Clock {
    pub(super) row: usize,
    pub(super) variable: usize,
    /// Lengths before it that are variables, with their factors.
    pub(super) lengths: Vec<(usize, f64)>,
}

impl Plan {
    pub(super) fn new(links: &[Vec<Link>], built: &[Built]) -> Plan {
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
        for (k, list) in links.iter().enumerate() {
            let (a, b) = (&built[k].problem, &built[k + 1].problem);
            let (end, start) = (p.variables[k] + a.end_place(), p.variables[k + 1] + b.places().0);
            let inputs: Vec<usize> = (0..a.spec().dcs.dims().x)
                .map(|i| end + i)
                .chain((0..b.spec().dcs.dims().x).map(|i| start + i))
                .collect();
            for link in list {
                let f = &link.f;
                let known = |j: &usize| *j < inputs.len();
                for j in (0..f.jac_pattern().n_cols()).filter(known) {
                    for &i in f.jac_pattern().rows(j) {
                        jac.0.push(m + i);
                        jac.1.push(inputs[j]);
                    }
                }
                for j in (0..f.hess_pattern().n_cols()).filter(known) {
                    for &i in f.hess_pattern().rows(j) {
                        hess.0.push(inputs[i].min(inputs[j]));
                        hess.1.push(inputs[i].max(inputs[j]));
                    }
                }
                room = room.max(f.jac_pattern().nnz()).max(f.hess_pattern().nnz());
                p.work.resize(p.work.len().max(f.work_len()), 0.0);
                p.inputs.resize(p.inputs.len().max(inputs.len()), 0.0);
                p.links.push(PlacedLink { f: f.clone(), row: m, inputs: inputs.clone() });
                m += f.n_out();
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
        (p.jac, p.jac_map) = Pattern::from_triplets(m, n, &jac.0, &jac.1);
        (p.hess, p.hess_map) = Pattern::from_triplets(n, n, &hess.0, &hess.1);
        p.values = vec![0.0; room];
        p
    }

    pub(super) fn n(&self) -> usize {
        self.variables[self.variables.len() - 1]
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

fn record(p: &Pattern, to: &mut (Vec<usize>, Vec<usize>), row: impl Fn(usize) -> usize, col: impl Fn(usize) -> usize) {
    for j in 0..p.n_cols() {
        for &i in p.rows(j) {
            to.0.push(row(i));
            to.1.push(col(j));
        }
    }
}

/// The phases as one program.
pub(super) struct Program<'a> {
    pub(super) parts: Vec<&'a mut Fesd>,
    pub(super) plan: &'a mut Plan,
}

impl PlacedLink {
    /// Calls `body` with the function at a point.
    fn with(
        &self,
        w: &[f64],
        inputs: &mut [f64],
        work: &mut [f64],
        body: impl FnOnce(&Point, &mut [f64]) -> EvalResult,
    ) -> EvalResult {
        for (v, &j) in inputs.iter_mut().zip(&self.inputs) {
            *v = w[j];
        }
        body(&Point { t: 0.0, x: &inputs[..self.inputs.len()], u: &[], p: &[] }, work)
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
            let out = &mut c[l.row..l.row + l.f.n_out()];
            l.with(w, &mut plan.inputs, &mut plan.work, |at, work| l.f.value(at, out, work))?;
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
            let nnz = l.f.jac_pattern().nnz();
            let values = &mut plan.values[..nnz];
            l.with(w, &mut plan.inputs, &mut plan.work, |z, work| l.f.jacobian(z, values, work))?;
            // the column of the time is the last one and has no place
            let known = l.f.jac_pattern().col_ptr()[l.inputs.len()];
            for (to, v) in plan.jac_map[at..at + known].iter().zip(&plan.values) {
                jac[*to] += v;
            }
            at += known;
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
            let nnz = l.f.hess_pattern().nnz();
            let values = &mut plan.values[..nnz];
            let weights = &y[l.row..l.row + l.f.n_out()];
            l.with(w, &mut plan.inputs, &mut plan.work, |z, work| l.f.hessian(z, weights, values, work))?;
            let known = l.f.hess_pattern().col_ptr()[l.inputs.len()];
            for (to, v) in plan.hess_map[at..at + known].iter().zip(&plan.values) {
                hess[*to] += v;
            }
            at += known;
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
    fn set_polishing(&mut self, on: bool) {
        self.parts.iter_mut().for_each(|p| p.set_polishing(on));
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
