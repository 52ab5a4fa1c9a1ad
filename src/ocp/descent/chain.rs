//! Problems one behind the other as one, in the variables of all.
//!
//! ```text
//! x_{k+1}(0) = r(x_k(T))        or        x_{k+1}(0) free,  lower ≤ f(x_k(T), x_{k+1}(0)) ≤ upper
//! ```
//!
//! A start that is a function of the end before it is no variable: what rests there rests on, and a motion has no gap. Time goes on from one
//! problem to the next, also where lengths are free.

use super::blocks::Block;
use super::shooting::{Given, Node, Preceding, Shooting};
use super::sqp::{Program, Values};
use crate::error::Result;
use crate::event::{self, Run};
use crate::func::Point;
use crate::ocp::extend::Extended;
use crate::ocp::joint::Link;
use crate::ocp::Ocp;
use crate::system::SharedFunction;
use nalgebra::DMatrix;

/// One of the problems: as it is stated, with its own parameters and controls, and what stands for all that is not varied.
pub(in crate::ocp) type Part<'a> = (&'a Ocp, &'a Extended, Given<'a>);

/// Problems one behind the other.
pub(in crate::ocp) struct Chain<'a> {
    parts: Vec<Shooting<'a>>,
    /// Between a problem and the next.
    links: &'a [Vec<Link>],
    lower: Vec<f64>,
    upper: Vec<f64>,
    sizes: Vec<f64>,
    row_lower: Vec<f64>,
    row_upper: Vec<f64>,
    /// Costs of the parts in the last evaluation.
    costs: Vec<f64>,
}

/// A simulation of one of the problems with all its events and dense output.
pub(in crate::ocp) struct Motion {
    pub run: Run,
    /// Its modes by the times from its start at which they begin.
    pub phases: Vec<(f64, Vec<bool>)>,
    /// The state a little behind the end, where there is an event before that.
    pub behind: Option<Vec<f64>>,
    pub cost: f64,
}

/// The map that says where the next problem begins.
fn start_of(links: &[Link]) -> Option<&SharedFunction> {
    links.iter().find_map(|l| l.start.as_ref())
}

/// Links that are constraints: all but the one that says where the next problem begins.
fn conditions(links: &[Link]) -> impl Iterator<Item = &Link> {
    let start = links.iter().position(|l| l.start.is_some());
    links.iter().enumerate().filter(move |(i, _)| Some(*i) != start).map(|l| l.1)
}

/// States with bounds at the start of a problem, and these.
fn start_bounds(ocp: &Ocp) -> impl Iterator<Item = (usize, f64, f64)> + '_ {
    let bounds = ocp.x0_bounds[0].iter().zip(&ocp.x0_bounds[1]).enumerate();
    bounds.map(|(i, (l, u))| (i, *l, *u)).filter(|(_, l, u)| l.is_finite() || u.is_finite())
}

/// A function of the states `x` of these sizes, with zero as the time: its values, its derivatives, and what states of their sizes change it by.
fn through(f: &SharedFunction, x: &[f64], sizes: &[f64]) -> (Vec<f64>, DMatrix<f64>, Vec<f64>) {
    let (m, pattern) = (f.n_out(), f.jac_pattern());
    let at = Point { t: 0.0, x, u: &[], p: &[] };
    let (mut value, mut entries, mut work) = (vec![f64::NAN; m], vec![0.0; pattern.nnz()], vec![0.0; f.work_len()]);
    let (mut slopes, mut usual) = (DMatrix::zeros(m, x.len()), vec![0.0; m]);
    if f.value(&at, &mut value, &mut work).is_err() || f.jacobian(&at, &mut entries, &mut work).is_err() {
        value.fill(f64::NAN);
        return (value, slopes, usual);
    }
    for (j, size) in sizes.iter().enumerate() {
        for (&i, v) in pattern.rows(j).iter().zip(&entries[pattern.range(j)]) {
            slopes[(i, j)] += v;
            usual[i] += v.abs() * size;
        }
    }
    (value, slopes, usual)
}

impl<'a> Chain<'a> {
    /// Problems with the links between them.
    pub fn new(given: Vec<Part<'a>>, links: &'a [Vec<Link>]) -> Result<Chain<'a>> {
        let mut parts: Vec<Shooting> = Vec::with_capacity(given.len());
        let mut n = 0;
        for (k, (ocp, e, given)) in given.into_iter().enumerate() {
            let leads_on = k > 0 && start_of(&links[k - 1]).is_some();
            let part = Shooting::new(ocp, e, Given { before: Preceding { n, leads_on }, ..given })?;
            n += part.n();
            parts.push(part);
        }
        let mut chain = Chain {
            links,
            lower: Vec::with_capacity(n),
            upper: Vec::with_capacity(n),
            sizes: Vec::with_capacity(n),
            row_lower: Vec::new(),
            row_upper: Vec::new(),
            costs: vec![0.0; parts.len()],
            parts,
        };
        for k in 0..chain.parts.len() {
            chain.parts[k].set_all(n);
            if k > 0 {
                if start_of(&links[k - 1]).is_some() {
                    for (_, l, u) in start_bounds(chain.parts[k].ocp()) {
                        chain.row_lower.push(l);
                        chain.row_upper.push(u);
                    }
                }
                for link in conditions(&links[k - 1]) {
                    chain.row_lower.extend_from_slice(&link.lower);
                    chain.row_upper.extend_from_slice(&link.upper);
                }
            }
            let part = &chain.parts[k];
            let (lower, upper, sizes) = part.bounds();
            chain.lower.extend_from_slice(lower);
            chain.upper.extend_from_slice(upper);
            chain.sizes.extend_from_slice(sizes);
            let (lower, upper) = part.row_bounds();
            chain.row_lower.extend_from_slice(lower);
            chain.row_upper.extend_from_slice(upper);
        }
        Ok(chain)
    }

    /// Its problems.
    pub fn parts(&self) -> &[Shooting<'a>] {
        &self.parts
    }

    /// Steps of simulations so far, and the states that they were made with, for each problem.
    pub fn steps(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.parts.iter().map(|p| (p.ocp().system.dims().x, p.steps))
    }

    /// Where problem `k` begins behind the end of the one before, with the rows between them.
    fn enter(&self, k: usize, z: &[f64], end: &Node, out: &mut Values) -> Node {
        let (before, part) = (&self.parts[k - 1], &self.parts[k]);
        let mut start = part.begin(z);
        (start.t, start.dt) = (end.t, end.dt.clone());
        let (state, first) = (&end.x[before.n_front()..], part.n_front());
        let map = start_of(&self.links[k - 1]);
        let n_start = if map.is_some() { 0 } else { part.usual().x.len() };
        let mut block = Block {
            begins: false,
            states: state.len(),
            n_inputs: state.len() + n_start,
            dense: end.dx.clone(),
            own: Vec::new(),
            next: DMatrix::zeros(0, state.len() + n_start),
            cost: vec![0.0; state.len() + n_start],
            first: out.rows.len(),
            rows: Vec::new(),
            start: Vec::new(),
            curvature: None,
        };
        if let Some(r) = map {
            let (value, slopes, _) = through(r, state, &before.usual().x);
            start.x[first..].copy_from_slice(&value);
            start.dx = &slopes * &end.dx;
            for (i, ..) in start_bounds(part.ocp()) {
                out.rows.push(value[i]);
                out.usual.push(part.usual().x[i]);
                block.rows.extend(slopes.row(i).iter());
            }
            block.next = slopes;
        } else {
            // what begins anew is an input of the conditions
            block.dense =
                DMatrix::from_fn(state.len() + n_start, end.dx.ncols(), |i, j| match i.checked_sub(state.len()) {
                    None => end.dx[(i, j)],
                    Some(i) => start.dx[(i, j)],
                });
        }
        let x = [state, &start.x[first..]].concat();
        let sizes = [&before.usual().x[..], &part.usual().x].concat();
        for link in conditions(&self.links[k - 1]) {
            let (value, slopes, usual) = through(&link.f, &x, &sizes);
            out.rows.extend(value);
            out.usual.extend(usual);
            let by = match map {
                Some(_) => {
                    slopes.columns(0, state.len())
                        + slopes.columns(state.len(), sizes.len() - state.len()) * &block.next
                }
                None => slopes,
            };
            by.row_iter().for_each(|row| block.rows.extend(row.iter()));
        }
        out.push(block, &start.dx);
        start
    }

    /// Simulates one problem after the other; false where one does not get to its end.
    fn run(&mut self, z: &[f64], out: &mut Values, told: &mut dyn FnMut(usize, &Node)) -> Result<bool> {
        out.clear(self.lower.len());
        let mut end: Option<Node> = None;
        for k in 0..self.parts.len() {
            let start = match &end {
                Some(end) => self.enter(k, z, end, out),
                None => self.parts[k].begin(z),
            };
            let cost = out.cost;
            let there = self.parts[k].follow(z, &start, out)?;
            self.costs[k] = out.cost - cost;
            match &there {
                Some(h) => told(k, h),
                None => return Ok(false),
            }
            end = there;
        }
        Ok(out.is_finite())
    }

    /// Variables with controls of the user, and their ends, of every problem; slacks are as at first. A start that is free, and of which nothing is known,
    /// is where the problem before ends.
    pub fn place(&mut self, controls: &[[Vec<f64>; 2]]) -> Result<Vec<f64>> {
        let own = self.parts.iter().zip(controls);
        let mut z: Vec<f64> = own.flat_map(|(p, [u, ends])| p.place_fresh((u, ends))).collect();
        let unknown = |k: usize, i: usize| {
            let ocp = self.parts[k].ocp();
            let open = ocp.x0_bounds.iter().flatten().all(|v| v.is_infinite()) && ocp.x_guess.is_none();
            open.then(|| self.parts[k].initial_at(i)).flatten()
        };
        let starts: Vec<Vec<Option<usize>>> = (1..self.parts.len())
            .map(|k| {
                let same = self.parts[k].ocp().system.dims().x == self.parts[k - 1].ocp().system.dims().x;
                let n = if same { self.parts[k].ocp().system.dims().x } else { 0 };
                (0..n).map(|i| unknown(k, i)).collect()
            })
            .collect();
        for (k, starts) in starts.iter().enumerate().filter(|(_, s)| s.iter().any(Option::is_some)) {
            let first = self.parts[k].n_front();
            let mut ends = Vec::new();
            // as far as simulations get
            let told = &mut |j: usize, h: &Node| {
                if j == k {
                    ends.extend_from_slice(&h.x[first..]);
                }
            };
            self.without_derivatives(|s| s.run(&z, &mut Values::default(), told).map(|_| ()))?;
            starts.iter().zip(&ends).for_each(|(at, v)| at.iter().for_each(|&at| z[at] = *v));
        }
        Ok(z)
    }

    /// Variables of a single problem with controls that lead near states at the ends of its stages, see [`Shooting::track`].
    pub fn track(&mut self, z: Vec<f64>, path: &[Vec<f64>]) -> Result<Option<Vec<f64>>> {
        match &mut self.parts[..] {
            [one] => one.track(z, path),
            _ => Ok(None),
        }
    }

    /// Calls something with engines that know no derivatives.
    fn without_derivatives<T>(&mut self, call: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.parts.iter_mut().try_for_each(Shooting::exchange_plain)?;
        let found = call(self);
        self.parts.iter_mut().try_for_each(Shooting::exchange_plain)?;
        found
    }

    /// What a simulation without derivatives makes of variables; `None` where it fails.
    pub fn plain_at(&mut self, z: &[f64]) -> Result<Option<Values>> {
        self.without_derivatives(|s| s.values_at(z))
    }

    /// Simulations with all events and dense output, what they make of variables where all get to the end, and states a share `more` of a stage
    /// behind their ends.
    pub fn traced(&mut self, z: &[f64], more: f64) -> Result<(Vec<Motion>, Option<Values>)> {
        let mut usual = Vec::with_capacity(self.parts.len());
        for p in &mut self.parts {
            let tracing = p.tracing()?;
            // what is traced is one run
            usual.push((p.exchange(tracing), std::mem::replace(&mut p.goes_on, true)));
        }
        let found = self.values_at(z);
        let mut start = self.parts[0].ocp().t0;
        let traced = |(p, (usual, goes_on)): (&mut Shooting, (event::Engine, bool))| {
            let end = p.time();
            p.goes_on = goes_on;
            let phases = p.order_of_motion(std::mem::replace(&mut start, end), end).phases;
            (p.exchange(usual), phases)
        };
        let engines: Vec<_> = self.parts.iter_mut().zip(usual).map(traced).collect();
        let found = found?;
        let mut motions = Vec::with_capacity(engines.len());
        for (((mut engine, phases), p), &cost) in engines.into_iter().zip(&self.parts).zip(&self.costs) {
            let run = engine.take_run();
            let end = run.t + more * p.ocp().horizon / p.n_stages() as f64;
            let goes_on = found.is_some() && matches!(engine.advance(end), Ok(event::Outcome::Reached));
            let events = [engine.jumps().len(), engine.impacts().len(), engine.switches().len(), engine.phases().len()];
            let behind = (goes_on && events.iter().any(|n| *n > 0)).then(|| engine.state().to_vec());
            motions.push(Motion { run, phases, behind, cost });
        }
        Ok((motions, found))
    }

    /// What every row is of: nothing where it is of the start of a problem, or a link.
    fn owner(&self, mut row: usize) -> Option<(usize, usize)> {
        for (k, part) in self.parts.iter().enumerate() {
            if k > 0 {
                row = row.checked_sub(self.n_between(k))?;
            }
            let n = part.row_bounds().0.len();
            if row < n {
                return Some((k, row));
            }
            row -= n;
        }
        None
    }

    /// Rows between problem `k` and the one before.
    fn n_between(&self, k: usize) -> usize {
        let links = &self.links[k - 1];
        let starts = if start_of(links).is_some() { start_bounds(self.parts[k].ocp()).count() } else { 0 };
        starts + conditions(links).map(|l| l.lower.len()).sum::<usize>()
    }

    /// What a row is of, in words.
    pub fn row_name(&self, row: usize) -> String {
        match self.owner(row) {
            Some((_, i)) if self.parts.len() == 1 => self.parts[0].row_name(i),
            Some((k, i)) => format!("{} of phase {k}", self.parts[k].row_name(i)),
            None => "a link, or the bounds of the start of a phase".into(),
        }
    }

    /// Rows of links and of starts.
    pub fn rows_between(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.row_lower.len()).filter(|i| self.owner(*i).is_none())
    }
}

impl Program for Chain<'_> {
    fn bounds(&self) -> (&[f64], &[f64], &[f64]) {
        (&self.lower, &self.upper, &self.sizes)
    }

    fn row_bounds(&self) -> (&[f64], &[f64]) {
        (&self.row_lower, &self.row_upper)
    }

    fn evaluate(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
        self.run(z, out, &mut |_, _| ())
    }

    fn evaluate_plain(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
        self.without_derivatives(|s| s.evaluate(z, out))
    }

    fn evaluate_curved(&mut self, z: &[f64], out: &mut Values) -> Result<bool> {
        self.parts.iter_mut().for_each(|p| p.ask_curvature(true));
        let found = self.evaluate(z, out);
        self.parts.iter_mut().for_each(|p| p.ask_curvature(false));
        found
    }
}
