//! Which modes follow at a switch: all solutions of the complementarity problem (6.19), and the choice among them.
//!
//! With `ν_k` the rate of the active indicators of subsystem `k`, a set of active cells continues the solution if
//! `θ ≥ 0` and `ġ_j − ν_k ≥ 0` for the candidates that are not active. Where one of these is zero to first order
//! (a mode that is left, a grazing contact), its derivative along the solution decides: the second-order condition.

use super::field::Field;
use super::lu::Lu;
use crate::func::EvalError;

/// Zero for weights, and relative to its scale for rates.
const TOL: f64 = 1e-9;
/// Combinations of active sets looked at.
const MAX_COMBINATIONS: usize = 8192;
/// Solutions kept where groups of subsystems have several each.
const MAX_PRODUCT: usize = 256;
/// Candidates of one subsystem.
const MAX_CANDIDATES: usize = 12;

/// A continuation.
#[derive(Debug, Clone)]
pub(super) struct Solution {
    pub(super) sets: Vec<Vec<usize>>,
    pub(super) velocity: Vec<f64>,
    /// No weight of an active cell and no rate of another candidate is zero.
    strict: bool,
    /// Smallest weight or relative rate.
    margin: f64,
}

/// Fields and rates of the candidates at a point.
struct Rates {
    /// Candidates of all subsystems, and where each subsystem begins.
    cells: Vec<usize>,
    begin: Vec<usize>,
    f0: Vec<f64>,
    fields: Vec<f64>,
    /// `ġ` of candidate `a` under the smooth part, and under the field of candidate `b`.
    own: Vec<f64>,
    by: Vec<f64>,
    scale: Vec<f64>,
}

impl Rates {
    fn new(field: &mut Field, t: f64, x: &[f64], candidates: &[Vec<usize>]) -> Result<Rates, EvalError> {
        let (nx, n_z) = (field.nx, field.n_z);
        let mut begin = vec![0];
        let mut cells = Vec::new();
        for c in candidates {
            cells.extend(c);
            begin.push(cells.len());
        }
        let n = cells.len();
        let mut r = Rates {
            f0: vec![0.0; nx],
            fields: vec![0.0; n * nx],
            own: vec![0.0; n],
            by: vec![0.0; n * n],
            scale: vec![0.0; n],
            cells,
            begin,
        };
        field.drift(t, x, &mut r.f0)?;
        field.gradients(t, x)?;
        let mut y = Vec::new();
        for (i, &c) in r.cells.iter().enumerate() {
            let own = &mut r.fields[i * nx..(i + 1) * nx];
            if field.add_mode(t, x, c, 1.0, own) == Err(EvalError::Recoverable) {
                y.clear();
                y.extend_from_slice(x);
                field.nudge(c, &mut y);
                own.fill(0.0);
                field.add_mode(t, &y, c, 1.0, own)?;
            }
        }
        let mut g = vec![0.0; n_z];
        for a in 0..n {
            let s = &field.subs[field.owner[r.cells[a]]];
            g.fill(0.0);
            for (j, w) in s.cells[r.cells[a] - s.first].weights.iter().enumerate() {
                for (g, d) in g.iter_mut().zip(&field.dq[(s.q0 + j) * n_z..]) {
                    *g += w * d;
                }
            }
            let dot = |v: &[f64]| g[..nx].iter().zip(v).map(|(a, b)| a * b).sum::<f64>();
            let size = |v: &[f64]| g[..nx].iter().zip(v).map(|(a, b)| (a * b).abs()).sum::<f64>();
            r.own[a] = dot(&r.f0) + g[n_z - 1];
            r.scale[a] = size(&r.f0) + g[n_z - 1].abs();
            for b in 0..n {
                let f = &r.fields[b * nx..(b + 1) * nx];
                r.by[a * n + b] = dot(f);
                r.scale[a] = r.scale[a].max(size(f));
            }
        }
        // rates of one subsystem are compared with each other
        for k in 0..candidates.len() {
            let own = r.begin[k]..r.begin[k + 1];
            let most = r.scale[own.clone()].iter().fold(f64::MIN_POSITIVE, |m, v| m.max(*v));
            r.scale[own].fill(most);
        }
        Ok(r)
    }

    /// Weights of all candidates with the active sets `sets` (positions among the candidates); none where they are not
    /// determined.
    fn weights(&self, sets: &[&[usize]], lu: &mut Lu<f64>) -> Option<Vec<f64>> {
        let n = self.cells.len();
        let pairs: Vec<(usize, usize)> = sets.iter().flat_map(|s| s[1..].iter().map(move |&i| (i, s[0]))).collect();
        let r = pairs.len();
        let mut theta = vec![0.0; n];
        for s in sets {
            theta[s[0]] = 1.0;
        }
        if r > 0 {
            let m = lu.clear(r);
            let mut b = vec![0.0; r];
            for (e, &(i, i0)) in pairs.iter().enumerate() {
                let scale = 1.0 / self.scale[i];
                let between = |c: usize| (self.by[i * n + c] - self.by[i0 * n + c]) * scale;
                for (j, &(c, c0)) in pairs.iter().enumerate() {
                    m[e * r + j] = between(c) - between(c0);
                }
                b[e] = -(self.own[i] - self.own[i0]) * scale - sets.iter().map(|s| between(s[0])).sum::<f64>();
            }
            if m.iter().any(|v| !v.is_finite()) || !lu.factorise() {
                return None;
            }
            lu.solve(&mut b);
            for (v, &(i, i0)) in b.iter().zip(&pairs) {
                theta[i] = *v;
                theta[i0] -= v;
            }
        }
        Some(theta)
    }

    /// Smallest weight and relative rate among the candidates of the subsystems `which`; none where one is negative.
    fn margin(&self, sets: &[&[usize]], theta: &[f64], which: &[usize], tol: f64) -> Option<f64> {
        let n = self.cells.len();
        let rate = |a: usize| self.own[a] + (0..n).map(|b| self.by[a * n + b] * theta[b]).sum::<f64>();
        let mut margin = f64::INFINITY;
        for &k in which {
            let s = sets[k];
            let nu = rate(s[0]);
            for a in self.begin[k]..self.begin[k + 1] {
                let m = if s.contains(&a) { theta[a] } else { (rate(a) - nu) / self.scale[a] };
                if m.is_nan() || m < -tol {
                    return None;
                }
                margin = margin.min(m);
            }
        }
        Some(margin)
    }

    /// The solution with the active sets `sets`, if it is one.
    fn solve(&self, sets: &[&[usize]], lu: &mut Lu<f64>, tol: f64) -> Option<Solution> {
        let theta = self.weights(sets, lu)?;
        let which: Vec<usize> = (0..sets.len()).collect();
        let margin = self.margin(sets, &theta, &which, tol)?;
        let nx = self.f0.len();
        let mut velocity = self.f0.clone();
        for (b, th) in theta.iter().enumerate() {
            for (v, f) in velocity.iter_mut().zip(&self.fields[b * nx..]) {
                *v += th * f;
            }
        }
        let sets = sets.iter().map(|s| s.iter().map(|&i| self.cells[i]).collect()).collect();
        Some(Solution { sets, velocity, strict: margin > TOL, margin })
    }

    /// Groups of subsystems whose weights do not depend on those of other groups.
    fn groups(&self) -> Vec<Vec<usize>> {
        let (n, n_sub) = (self.cells.len(), self.begin.len() - 1);
        let couples = |k: usize, l: usize| {
            let (a0, b0) = (self.begin[k], self.begin[l]);
            let change = |a: usize, b: usize| self.by[a * n + b] - self.by[a0 * n + b];
            (a0..self.begin[k + 1]).any(|a| {
                let small = 1e-13 * self.scale[a];
                (b0..self.begin[l + 1]).any(|b| (change(a, b) - change(a, b0)).abs() > small)
            })
        };
        let mut group: Vec<usize> = (0..n_sub).collect();
        for k in 0..n_sub {
            for l in 0..k {
                let (a, b) = (group[k], group[l]);
                if a != b && (couples(k, l) || couples(l, k)) {
                    group.iter_mut().filter(|g| **g == a).for_each(|g| *g = b);
                }
            }
        }
        let all = (0..n_sub).map(|g| (0..n_sub).filter(|k| group[*k] == g).collect::<Vec<usize>>());
        all.filter(|g| !g.is_empty()).collect()
    }

    /// Subsets of the candidates of a subsystem, small ones first; all of them as one where there are too many.
    fn subsets(&self, k: usize, whole: bool) -> Vec<Vec<usize>> {
        let own: Vec<usize> = (self.begin[k]..self.begin[k + 1]).collect();
        if whole || own.len() > MAX_CANDIDATES {
            return vec![own];
        }
        let mut all: Vec<Vec<usize>> = (1..1usize << own.len())
            .map(|m| own.iter().enumerate().filter(|(i, _)| m >> i & 1 == 1).map(|(_, &c)| c).collect())
            .collect();
        all.sort_by_key(Vec::len);
        all
    }

    /// All solutions; `kept` says which subsystems keep all their candidates where there are too many combinations.
    fn all(&self, kept: &[bool], lu: &mut Lu<f64>, tol: f64) -> Vec<Solution> {
        let n_sub = self.begin.len() - 1;
        let first: Vec<Vec<usize>> = (0..n_sub).map(|k| vec![self.begin[k]]).collect();
        let whole: Vec<usize> = (0..n_sub).collect();
        let sizes = |group: &[usize]| {
            let size = |k: &usize| 1usize << (self.begin[k + 1] - self.begin[*k]).min(MAX_CANDIDATES + 1);
            group.iter().map(size).fold(1usize, usize::saturating_mul)
        };
        // together where that is little work, else by groups
        let groups = if sizes(&whole) <= MAX_COMBINATIONS { vec![whole] } else { self.groups() };
        let mut found: Vec<Vec<Vec<usize>>> = vec![first.clone()];
        for group in &groups {
            let mut lists: Vec<Vec<Vec<usize>>> = group.iter().map(|&k| self.subsets(k, false)).collect();
            let product = |l: &[Vec<Vec<usize>>]| l.iter().fold(1usize, |p, l| p.saturating_mul(l.len()));
            if product(&lists) > MAX_COMBINATIONS {
                lists = group.iter().map(|&k| self.subsets(k, kept[k])).collect();
            }
            let mut good: Vec<Vec<&Vec<usize>>> = Vec::new();
            for mut m in 0..product(&lists).min(MAX_COMBINATIONS) {
                let mut sets: Vec<&[usize]> = first.iter().map(Vec::as_slice).collect();
                let mut choice = Vec::with_capacity(group.len());
                for (l, &k) in lists.iter().zip(group) {
                    let s = &l[m % l.len()];
                    m /= l.len();
                    sets[k] = s;
                    choice.push(s);
                }
                let holds = self.weights(&sets, lu).and_then(|theta| self.margin(&sets, &theta, group, tol));
                if holds.is_some() {
                    good.push(choice);
                }
            }
            // what was found for the groups before, with every solution of this one
            let mut next = Vec::new();
            for sets in &found {
                for choice in &good {
                    let mut sets = sets.clone();
                    for (s, &k) in choice.iter().zip(group) {
                        sets[k].clone_from(s);
                    }
                    next.push(sets);
                }
            }
            next.truncate(MAX_PRODUCT);
            found = next;
        }
        let whole = |sets: &Vec<Vec<usize>>| {
            let sets: Vec<&[usize]> = sets.iter().map(Vec::as_slice).collect();
            self.solve(&sets, lu, tol)
        };
        let mut out: Vec<Solution> = found.iter().filter_map(whole).collect();
        out.sort_by_key(|s| s.sets.iter().map(Vec::len).sum::<usize>());
        out
    }
}

/// The common case without a search: one subsystem with two candidates, the others with one, and rates that leave no
/// doubt. Writes the active set of that subsystem to `out` and returns its index; `None` leaves it to [`next`].
pub(super) fn quick(
    field: &mut Field,
    t: f64,
    x: &[f64],
    candidates: &[Vec<usize>],
    room: (&mut [f64], &mut [f64]),
    out: &mut Vec<usize>,
) -> Result<Option<usize>, EvalError> {
    let mut two = candidates.iter().enumerate().filter(|c| c.1.len() > 1);
    let (Some((k, pair)), None) = (two.next(), two.next()) else { return Ok(None) };
    let &[a, b] = &pair[..] else { return Ok(None) };
    let (nx, n_z) = (field.nx, field.n_z);
    let (fa, fb) = room;
    field.drift(t, x, fa)?;
    for (j, c) in candidates.iter().enumerate() {
        if j != k {
            field.add_mode(t, x, c[0], 1.0, fa)?;
        }
    }
    fb.copy_from_slice(fa);
    for (cell, f) in [(a, &mut *fa), (b, &mut *fb)] {
        match field.add_mode(t, x, cell, 1.0, f) {
            Err(EvalError::Recoverable) => return Ok(None),
            r => r?,
        }
    }
    field.gradients(t, x)?;
    let s = &field.subs[k];
    let (wa, wb) = (&s.cells[a - s.first].weights, &s.cells[b - s.first].weights);
    // rates of g_b − g_a under both fields, and the size of their terms
    let (mut ra, mut rb, mut size) = (0.0f64, 0.0f64, 0.0f64);
    for (j, (wa, wb)) in wa.iter().zip(wb).enumerate() {
        let w = wb - wa;
        if w != 0.0 {
            let g = &field.dq[(s.q0 + j) * n_z..(s.q0 + j + 1) * n_z];
            for i in 0..nx {
                ra += w * g[i] * fa[i];
                rb += w * g[i] * fb[i];
                size += (w * g[i]).abs() * fa[i].abs().max(fb[i].abs());
            }
            let own = w * g[n_z - 1];
            (ra, rb, size) = (ra + own, rb + own, size + own.abs());
        }
    }
    let clear = 1e-6 * size;
    if ra.is_nan() || rb.is_nan() || ra.abs() <= clear || rb.abs() <= clear || (ra > 0.0 && rb < 0.0) {
        return Ok(None);
    }
    out.clear();
    match (ra > 0.0, rb > 0.0) {
        (true, _) => out.push(a),
        (_, false) => out.push(b),
        _ => out.extend([a, b]),
    }
    Ok(Some(k))
}

/// An implicit step of length `h`: (6.19) for the indicators at its end, to first order. `x` is where the indicators
/// of the field are.
pub(super) fn implicit(
    field: &mut Field,
    t: f64,
    x: &[f64],
    candidates: &[Vec<usize>],
    h: f64,
) -> Result<Option<Solution>, EvalError> {
    let mut rates = Rates::new(field, t, x, candidates)?;
    for k in 0..candidates.len() {
        let s = &field.subs[k];
        let value =
            |c: usize| -> f64 { s.cells[c - s.first].weights.iter().zip(&field.q[s.q0..]).map(|(w, q)| w * q).sum() };
        let own = rates.begin[k]..rates.begin[k + 1];
        let least = rates.cells[own.clone()].iter().fold(f64::INFINITY, |m, c| m.min(value(*c)));
        for a in own {
            rates.own[a] += (value(rates.cells[a]) - least) / h;
        }
    }
    let kept = vec![false; candidates.len()];
    let mut lu = Lu::with_capacity(rates.cells.len());
    let found = rates.all(&kept, &mut lu, TOL).into_iter().next();
    Ok(found.or_else(|| rates.all(&kept, &mut lu, 1e-4).into_iter().max_by(|a, b| a.margin.total_cmp(&b.margin))))
}

/// Solves (6.19) among `candidates` and orders the continuations: the present set first, if it is one, then by the
/// number of active cells, then by index; of those with the same velocity the first is kept. `length` is a time over
/// which the solution hardly changes.
pub(super) fn next(
    field: &mut Field,
    t: f64,
    x: &[f64],
    candidates: &[Vec<usize>],
    length: f64,
) -> Result<Vec<Solution>, EvalError> {
    let present = field.active.clone();
    let rates = Rates::new(field, t, x, candidates)?;
    let kept: Vec<bool> = candidates.iter().zip(&present).map(|(c, p)| c.len() == p.len()).collect();
    let mut lu = Lu::with_capacity(rates.cells.len());
    let mut found = rates.all(&kept, &mut lu, TOL);
    if found.iter().filter(|s| s.strict).count() != 1 || found.len() > 1 {
        let weak: Vec<usize> = (0..found.len()).filter(|&i| !found[i].strict).collect();
        let holds: Vec<bool> = (0..found.len())
            .map(|i| !weak.contains(&i) || second_order(field, t, x, candidates, &found[i], length).unwrap_or(false))
            .collect();
        if holds.iter().any(|h| *h) {
            let mut i = 0;
            found.retain(|_| {
                i += 1;
                holds[i - 1]
            });
        }
    }
    if found.is_empty() {
        found = rates.all(&kept, &mut lu, 1e-4);
        found.sort_by(|a, b| b.margin.total_cmp(&a.margin));
        found.truncate(1);
    }
    field.set_active(&present);
    let same =
        |s: &Solution| s.sets.iter().zip(&present).all(|(a, b)| a.len() == b.len() && a.iter().all(|c| b.contains(c)));
    if let Some(i) = found.iter().position(same) {
        let s = found.remove(i);
        found.insert(0, s);
    }
    let mut out: Vec<Solution> = Vec::new();
    for s in found {
        if out.iter().all(|o| differ(&s.velocity, &o.velocity)) {
            out.push(s);
        }
    }
    Ok(out)
}

fn differ(a: &[f64], b: &[f64]) -> bool {
    let scale = a.iter().chain(b).fold(f64::MIN_POSITIVE, |m, v| m.max(v.abs()));
    a.iter().zip(b).any(|(a, b)| (a - b).abs() > 1e-6 * scale)
}

/// Do the weights and rates that are zero grow along the solution?
fn second_order(
    field: &mut Field,
    t: f64,
    x: &[f64],
    candidates: &[Vec<usize>],
    s: &Solution,
    length: f64,
) -> Result<bool, EvalError> {
    let ahead = 1e-4 * length;
    let before = degrees(field, t, x, candidates, s)?;
    let y: Vec<f64> = x.iter().zip(&s.velocity).map(|(x, v)| x + ahead * v).collect();
    let after = degrees(field, t + ahead, &y, candidates, s)?;
    Ok(before.iter().zip(&after).all(|(b, a)| *b > TOL || a - b >= -1e-11))
}

/// Weights of the active cells, relative rates of the other candidates, at a point.
fn degrees(
    field: &mut Field,
    t: f64,
    x: &[f64],
    candidates: &[Vec<usize>],
    s: &Solution,
) -> Result<Vec<f64>, EvalError> {
    field.set_active(&s.sets);
    let mut v = vec![0.0; x.len()];
    field.rhs(t, x, &mut v)?;
    let rates = Rates::new(field, t, x, candidates)?;
    let n_z = field.n_z;
    let mut out = Vec::new();
    for (k, set) in s.sets.iter().enumerate() {
        let sub = &field.subs[k];
        let rate = |cell: usize| -> f64 {
            let weights = &sub.cells[cell - sub.first].weights;
            let each = weights.iter().enumerate().map(|(j, w)| {
                let g = &field.dq[(sub.q0 + j) * n_z..(sub.q0 + j + 1) * n_z];
                w * (g.iter().zip(&v).map(|(g, v)| g * v).sum::<f64>() + g[n_z - 1])
            });
            each.sum()
        };
        let nu = rate(set[0]);
        for (a, &c) in candidates[k].iter().enumerate() {
            let scale = rates.scale[rates.begin[k] + a];
            out.push(if set.contains(&c) { field.theta(c) } else { (rate(c) - nu) / scale });
        }
    }
    Ok(out)
}
