//! Ten kinds of small programs with pairs, drawn from a seed.

use switchback_mpcc::mpcc::Member;
use switchback_mpcc::random::SplitMix64;

use crate::program::{Expr, Program};

const INF: f64 = f64::INFINITY;

/// Names of the kinds.
pub const KINDS: [&str; 10] =
    ["lpcc", "qpcc", "bilevel", "market", "tolls", "sparse", "friction", "obstacle", "design", "inverse"];

struct Draw(SplitMix64);

impl Draw {
    fn within(&mut self, lo: f64, hi: f64) -> f64 {
        lo + (hi - lo) * self.0.share()
    }
    fn sign(&mut self) -> f64 {
        self.within(-1.0, 1.0)
    }
    fn int(&mut self, lo: usize, hi: usize) -> usize {
        (lo + (self.0.share() * (hi - lo + 1) as f64) as usize).min(hi)
    }
    fn vector(&mut self, n: usize, size: f64) -> Vec<f64> {
        (0..n).map(|_| size * self.sign()).collect()
    }
    fn matrix(&mut self, m: usize, n: usize) -> Vec<Vec<f64>> {
        (0..m).map(|_| self.vector(n, 1.0)).collect()
    }
    /// A positive semidefinite matrix of this rank, plus a skew one.
    fn monotone(&mut self, n: usize, rank: usize, skew: f64) -> Vec<Vec<f64>> {
        let l = self.matrix(rank, n);
        let mut m = vec![vec![0.0; n]; n];
        for i in 0..n {
            for j in 0..n {
                m[i][j] = l.iter().map(|r| r[i] * r[j]).sum();
            }
        }
        for i in 0..n {
            for j in 0..i {
                let s = skew * self.sign();
                m[i][j] += s;
                m[j][i] -= s;
            }
        }
        m
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// `constant + Σ aⱼ x_{first+j}` added to an expression.
fn along(mut e: Expr, a: &[f64], first: usize) -> Expr {
    for (j, a) in a.iter().enumerate() {
        e = e.plus(*a, first + j);
    }
    e
}

/// The program of this kind and seed: 4 to 12 pairs, more often few, or so many; at most 8 where branches are not convex and enumerations take long.
pub fn draw(kind: &str, seed: u64, pairs: Option<usize>) -> Program {
    let number = KINDS.iter().position(|k| *k == kind).unwrap_or(0) as u64;
    let mut d = Draw(SplitMix64::new(seed.wrapping_mul(64).wrapping_add(number)));
    d.0.share();
    let drawn = 4 + (9.0 * d.0.share().powf(1.5)) as usize;
    let k = pairs.unwrap_or(drawn);
    match kind {
        "lpcc" => linear(&mut d, k),
        "qpcc" => pairs_alone(&mut d, k),
        "bilevel" => bilevel(&mut d, k),
        "market" => market(&mut d, k / 2),
        "tolls" => tolls(&mut d, k.min(8)),
        "sparse" => sparse(&mut d, k),
        "friction" => friction(&mut d, k / 2),
        "obstacle" => obstacle(&mut d, k),
        "design" => design(&mut d, k.min(8)),
        _ => inverse(&mut d, k.min(8)),
    }
    .finish()
}

/// Parameters `x` of a linear complementarity problem, monotone or not, joint rows, and a linear objective. Some have no point.
fn linear(d: &mut Draw, k: usize) -> Program {
    let nx = d.int(2, 5);
    let monotone = d.sign() > 0.0;
    let nm = d.matrix(k, nx);
    let m = if monotone { d.monotone(k, k.div_ceil(2), 1.0) } else { d.matrix(k, k) };
    let x: Vec<f64> = (0..nx).map(|_| d.within(1.0, 9.0)).collect();
    let (mut y, mut w) = (vec![0.0; k], vec![0.0; k]);
    for i in 0..k {
        (if d.sign() > 0.0 { &mut y } else { &mut w })[i] = d.within(0.5, 5.0);
    }
    let bounds: Vec<(f64, f64)> = (0..nx + k).map(|j| (0.0, if j < nx { 10.0 } else { 50.0 })).collect();
    let mut f = Expr::of(0.0);
    for j in 0..nx + k {
        f = f.plus(if j < nx { d.sign() } else { d.within(-0.5, 1.0) }, j);
    }
    let mut p = Program::new(&bounds, f, true);
    for i in 0..k {
        let q = w[i] - dot(&nm[i], &x) - dot(&m[i], &y);
        p.pair(nx + i, along(along(Expr::of(q), &nm[i], 0), &m[i], nx));
    }
    let shift = if d.within(0.0, 1.0) < 0.15 { d.within(5.0, 30.0) } else { 0.0 };
    for _ in 0..3 {
        let (a, b) = (d.vector(nx, 1.0), d.vector(k, 1.0));
        let at = dot(&a, &x) + dot(&b, &y);
        p.row(along(along(Expr::of(0.0), &a, 0), &b, nx), at - d.within(0.0, 2.0) + shift, INF);
    }
    p.x0 = vec![1.0; nx + k];
    p
}

/// The point next to a given one whose pairs are closed, under joint rows.
fn pairs_alone(d: &mut Draw, k: usize) -> Program {
    let mut f = Expr::of(0.0);
    let mut point = vec![0.0; 2 * k];
    for j in 0..2 * k {
        f = f.square(d.within(0.2, 1.0), &[(j, 1.0)], -d.within(-0.5, 3.0));
    }
    for i in 0..k {
        point[if d.sign() > 0.0 { i } else { k + i }] = d.within(0.2, 3.0);
    }
    let mut p = Program::new(&vec![(0.0, 20.0); 2 * k], f, true);
    p.pairs.extend((0..k).map(|j| (Member::Variable(j), Member::Variable(k + j))));
    let shift = if d.within(0.0, 1.0) < 0.1 { d.within(5.0, 50.0) } else { 0.0 };
    for _ in 0..d.int(1, k.div_ceil(2)) {
        let a = d.vector(2 * k, 1.0);
        p.row(along(Expr::of(0.0), &a, 0), dot(&a, &point) - d.within(0.0, 0.5) + shift, INF);
    }
    p.x0.fill(1.0);
    p
}

/// A leader over a follower with a strictly convex quadratic program of `k` inequalities.
fn bilevel(d: &mut Draw, k: usize) -> Program {
    let (nx, ny) = (d.int(1, 3), d.int(2, 4));
    let mut q = d.monotone(ny, ny, 0.0);
    (0..ny).for_each(|i| q[i][i] += 0.5);
    let (c, a, r) = (d.matrix(ny, nx), d.matrix(k, ny), d.matrix(k, nx));
    let bounds: Vec<(f64, f64)> = (0..nx + ny + k)
        .map(|j| if j < nx { (-5.0, 5.0) } else { (if j < nx + ny { -INF } else { 0.0 }, INF) })
        .collect();
    let mut f = Expr::of(0.0);
    for j in 0..nx + ny {
        f = f.square(if j < nx { d.within(0.02, 0.5) } else { 1.0 }, &[(j, 1.0)], 4.0 * d.sign());
    }
    let mut p = Program::new(&bounds, f, true);
    for i in 0..ny {
        let mut e = along(along(Expr::of(2.0 * d.sign()), &c[i], 0), &q[i], nx);
        for j in 0..k {
            e = e.plus(a[j][i], nx + ny + j);
        }
        p.row(e, 0.0, 0.0);
    }
    for j in 0..k {
        let minus: Vec<f64> = a[j].iter().map(|a| -a).collect();
        p.pair(nx + ny + j, along(along(Expr::of(d.within(0.2, 2.0)), &r[j], 0), &minus, nx));
    }
    p.x0[..nx].fill(0.5);
    p.x0[nx + ny..].fill(0.5);
    p
}

/// A leader in two markets with Cournot followers of bounded capacity: `firms` of them, each with two pairs.
fn market(d: &mut Draw, firms: usize) -> Program {
    // x_1, x_2 of the leader, then quantities, then prices of capacities
    let n = 2 + 2 * firms;
    let mut bounds = vec![(0.0, INF); n];
    bounds[..2].fill((0.0, 20.0));
    let (a, b) = ([d.within(15.0, 30.0), d.within(15.0, 30.0)], [d.within(0.5, 2.0), d.within(0.5, 2.0)]);
    let home = |i: usize| i % 2;
    let mut f = Expr::of(0.0);
    for s in 0..2 {
        f = f.plus(d.within(1.0, 6.0) - a[s], s).times(b[s], s, s);
        for i in (0..firms).filter(|i| home(*i) == s) {
            f = f.times(b[s], s, 2 + i);
        }
    }
    let mut p = Program::new(&bounds, f, false);
    for i in 0..firms {
        let s = home(i);
        let mut e = Expr::of(d.within(1.0, 20.0) - a[s])
            .plus(d.within(0.1, 1.0) + b[s], 2 + i)
            .plus(b[s], s)
            .plus(1.0, 2 + firms + i);
        for j in (0..firms).filter(|j| home(*j) == s) {
            e = e.plus(b[s], 2 + j);
        }
        p.pair(2 + i, e);
        p.pair(2 + firms + i, Expr::of(d.within(0.5, 6.0)).plus(-1.0, 2 + i));
    }
    p.row(Expr::of(0.0).plus(1.0, 0).plus(1.0, 1), -INF, d.within(4.0, 15.0));
    p.x0.fill(1.0);
    p
}

/// Tolls on some of `k` parallel roads; who drives takes what is fastest with them. The largest revenue.
fn tolls(d: &mut Draw, k: usize) -> Program {
    let tolled = k.div_ceil(2);
    // flows, tolls, least time, how many drive
    let mut bounds = vec![(0.0, INF); k];
    bounds.extend(vec![(0.0, 20.0); tolled]);
    bounds.extend([(0.0, 100.0), (0.0, INF)]);
    let (time, drive) = (k + tolled, k + tolled + 1);
    let mut f = Expr::of(0.0);
    for j in 0..tolled {
        f = f.times(-1.0, j, k + j);
    }
    let mut p = Program::new(&bounds, f, false);
    let mut all = Expr::of(0.0).plus(-1.0, drive);
    for j in 0..k {
        all = all.plus(1.0, j);
        let b = d.within(0.1, 2.0);
        let mut e = Expr::of(d.within(1.0, 8.0)).plus(b, j).times(d.within(0.0, 0.3), j, j).plus(-1.0, time);
        if j < tolled {
            e = e.plus(1.0, k + j);
        }
        p.pair(j, e);
    }
    p.row(all, 0.0, 0.0);
    p.row(Expr::of(-d.within(10.0, 25.0)).plus(1.0, time).plus(d.within(0.3, 1.5), drive), 0.0, 0.0);
    p.x0.fill(1.0);
    p
}

/// Least squares with few coefficients: `0 ≤ x ⊥ s ≥ 0`, `s ≤ 1`, and every `s` below one costs.
fn sparse(d: &mut Draw, k: usize) -> Program {
    let rows = k + 2;
    let (mut phi, price) = (d.matrix(rows, k), d.within(0.02, 0.5));
    for r in &mut phi {
        let common = 2.0 * d.sign();
        r.iter_mut().for_each(|v| *v += common);
    }
    let truth: Vec<f64> = (0..k).map(|_| if d.sign() > 0.2 { d.within(0.2, 2.0) } else { 0.0 }).collect();
    let mut f = Expr::of(price * k as f64);
    for r in &phi {
        let terms: Vec<(usize, f64)> = r.iter().copied().enumerate().collect();
        f = f.square(0.5, &terms, -dot(r, &truth) - 0.5 * d.sign());
    }
    for j in 0..k {
        f = f.plus(-price, k + j);
    }
    let mut bounds = vec![(0.0, INF); k];
    bounds.extend(vec![(0.0, 1.0); k]);
    let mut p = Program::new(&bounds, f, true);
    p.pairs.extend((0..k).map(|j| (Member::Variable(j), Member::Variable(k + j))));
    p.x0.fill(0.5);
    p
}

/// A mass with dry friction, of one stage for every two pairs, moved with the least effort and error.
fn friction(d: &mut Draw, stages: usize) -> Program {
    // per stage: u, v⁺, v⁻, α; rows of relay and momentum
    let (h, at) = (d.within(0.3, 1.0), |i: usize, q: usize| 4 * i + q);
    let mut bounds = Vec::new();
    for _ in 0..stages {
        bounds.extend([(-4.0, 4.0), (0.0, INF), (0.0, INF), (0.0, 1.0)]);
    }
    let v0 = d.sign();
    let mut f = Expr::of(0.0);
    for i in 0..stages {
        f = f.square(d.within(0.05, 0.5), &[(at(i, 0), 1.0)], 0.0);
    }
    for _ in 0..2 {
        let last = d.int(stages / 2, stages - 1);
        let way: Vec<(usize, f64)> = (0..=last).flat_map(|i| [(at(i, 1), h), (at(i, 2), -h)]).collect();
        f = f.square(d.within(0.5, 3.0), &way, 3.0 * d.sign());
    }
    let mut p = Program::new(&bounds, f, true);
    for i in 0..stages {
        let force = d.within(0.5, 3.0);
        let mut e = Expr::of(0.0).plus(1.0, at(i, 1)).plus(-1.0, at(i, 2)).plus(-h, at(i, 0));
        e = e.plus(2.0 * h * force, at(i, 3));
        e.constant = -h * force;
        if i > 0 {
            e = e.plus(-1.0, at(i - 1, 1)).plus(1.0, at(i - 1, 2));
        } else {
            e.constant -= v0;
        }
        p.row(e, 0.0, 0.0);
        p.pair(at(i, 1), Expr::of(1.0).plus(-1.0, at(i, 3)));
        p.pairs.push((Member::Variable(at(i, 2)), Member::Variable(at(i, 3))));
    }
    p.x0.iter_mut().skip(3).step_by(4).for_each(|a| *a = 0.5);
    p
}

/// A string over an obstacle of `k` points, drawn by few forces towards a shape.
fn obstacle(d: &mut Draw, k: usize) -> Program {
    let nu = d.int(2, 4);
    // u, heights above the obstacle, reactions
    let mut bounds = vec![(-5.0, 5.0); nu];
    bounds.extend(vec![(0.0, INF); 2 * k]);
    let ground: Vec<f64> = (0..k).map(|_| d.within(-1.0, 1.0)).collect();
    let mut f = Expr::of(0.0);
    for j in 0..nu {
        f = f.square(d.within(0.01, 0.2), &[(j, 1.0)], 0.0);
    }
    for i in 0..k {
        f = f.square(0.5, &[(nu + i, 1.0)], -d.within(-0.5, 1.5)).square(
            0.05,
            &[(nu + k + i, 1.0)],
            -d.within(0.0, 3.0),
        );
    }
    let mut p = Program::new(&bounds, f, true);
    for i in 0..k {
        let mut e = Expr::of(2.0 * ground[i] + d.within(0.0, 1.0)).plus(2.0, nu + i).plus(-1.0, nu + k + i);
        for j in [i.checked_sub(1), (i + 1 < k).then_some(i + 1)].into_iter().flatten() {
            e = e.plus(-1.0, nu + j);
            e.constant -= ground[j];
        }
        let b = d.vector(nu, 1.0);
        p.row(along(e, &b, 0), 0.0, 0.0);
        p.pairs.push((Member::Variable(nu + i), Member::Variable(nu + k + i)));
    }
    p.x0.fill(0.5);
    p
}

/// Stiffness of `k` one-sided springs under a plate with two degrees of freedom.
fn design(d: &mut Draw, k: usize) -> Program {
    // stiffness, compressions, two displacements
    let mut bounds = vec![(0.1, 10.0); k];
    bounds.extend(vec![(0.0, INF); k]);
    bounds.extend([(-10.0, 10.0); 2]);
    let load = d.within(1.0, 5.0);
    let load = [load, 0.25 * load * d.sign()];
    let mut f =
        Expr::of(0.0).square(0.5, &[(2 * k, 1.0)], -d.within(0.0, 2.0)).square(1.0, &[(2 * k + 1, 1.0)], d.sign());
    for j in 0..k {
        f = f.plus(d.within(0.02, 0.3), j);
    }
    let mut p = Program::new(&bounds, f, true);
    let mut balance = [Expr::of(-load[0]), Expr::of(-load[1])];
    for j in 0..k {
        let arm = d.within(0.3, 1.0) * if j % 2 == 0 { 1.0 } else { -1.0 };
        balance[0] = balance[0].clone().times(1.0, j, k + j);
        balance[1] = balance[1].clone().times(arm, j, k + j);
        p.pair(k + j, Expr::of(d.within(-0.2, 1.0)).plus(1.0, k + j).plus(-1.0, 2 * k).plus(-arm, 2 * k + 1));
    }
    for e in balance {
        p.row(e, 0.0, 0.0);
    }
    p.x0.fill(1.0);
    p
}

/// Parameters of a complementarity problem whose solution was observed, with errors.
fn inverse(d: &mut Draw, k: usize) -> Program {
    let mut m = if d.sign() > 0.0 { d.monotone(k, k, 0.5) } else { d.matrix(k, k) };
    (0..k).for_each(|i| m[i][i] += 0.5);
    // two parameters, then the solution
    let mut bounds = vec![(-2.0, 2.0); 2];
    bounds.extend(vec![(0.0, 50.0); k]);
    let mut f = Expr::of(0.0).square(0.02, &[(0, 1.0)], 0.0).exp(0.02, d.within(0.2, 1.0), 1);
    for j in 0..k {
        f = f.square(0.5, &[(2 + j, 1.0)], -d.within(-1.0, 2.0));
    }
    let mut p = Program::new(&bounds, f, true);
    for i in 0..k {
        let mut e = along(Expr::of(2.0 * d.sign()), &m[i], 2).times(d.within(0.0, 0.7), 0, 2 + i).plus(d.sign(), 1);
        e = e.times(d.sign(), 1, 2 + (i + 1) % k);
        p.pair(2 + i, e);
    }
    p.x0.fill(0.5);
    p
}

/// The program with an objective that is bent by exponentials of its variables, and so are the conditions of a follower: branches that were
/// convex programs stay ones, but none is quadratic.
pub fn bend(mut program: Program, kind: &str, seed: u64) -> Program {
    let mut d = Draw(SplitMix64::new(seed.wrapping_mul(64).wrapping_add(63)));
    d.0.share();
    let n = program.x0.len();
    for j in 0..n {
        let slope = 0.4 * d.sign();
        program.objective = program.objective.exp(d.within(0.0, 1.0), slope, j);
    }
    if kind == "bilevel" {
        let equations = (0..program.rows.len()).filter(|i| program.bounds.cl[*i] == program.bounds.cu[*i]).count();
        let first = n - equations - program.pairs.len();
        for (i, row) in program.rows.iter_mut().take(equations).enumerate() {
            *row = row.clone().exp(d.within(0.0, 2.0), d.within(0.1, 0.5), first + i);
        }
    }
    program.finish()
}

/// Kinds of linear complementarity problems.
pub const COMPLEMENTARITY: [&str; 5] = ["positive", "monotone", "copositive", "indefinite", "banded"];

/// A linear complementarity problem `0 ≤ z ⊥ q + M z ≥ 0` of `n` pairs without an objective: `M` positive definite and not symmetric;
/// positive semidefinite of half rank plus a skew part, with a solution; strictly copositive, which always has one; of any signs, with a
/// solution; or a banded M-matrix.
pub fn complementarity(kind: &str, n: usize, seed: u64) -> Program {
    let number = COMPLEMENTARITY.iter().position(|k| *k == kind).unwrap_or(0) as u64;
    let mut d = Draw(SplitMix64::new(seed.wrapping_mul(64).wrapping_add(32 + number)));
    d.0.share();
    let mut p = Program::new(&vec![(0.0, INF); n], Expr::of(0.0), true);
    let mut m = match kind {
        "banded" => Vec::new(),
        "copositive" => {
            d.matrix(n, n).into_iter().map(|r| r.into_iter().map(|v| (4.0 * v - 3.0).max(0.0)).collect()).collect()
        }
        "indefinite" => d.matrix(n, n),
        _ => d.monotone(n, if kind == "monotone" { n.div_ceil(2) } else { n }, 1.0),
    };
    let mut q = d.vector(n, 1.0);
    if kind == "monotone" || kind == "indefinite" {
        for (q, row) in q.iter_mut().zip(&m) {
            *q = -row
                .iter()
                .enumerate()
                .map(|(j, v)| if j % 2 == 0 { (1 + j % 3) as f64 * v } else { 0.0 })
                .sum::<f64>();
        }
        q.iter_mut().skip(1).step_by(2).for_each(|q| *q += d.within(0.0, 2.0));
    }
    for i in 0..n {
        let mut e = Expr::of(q[i]);
        if kind == "banded" {
            e = e.plus(2.0 + d.within(0.0, 0.1), i);
            for j in [i.wrapping_sub(1), i + 1].into_iter().filter(|j| *j < n) {
                e = e.plus(-1.0, j);
            }
        } else {
            m[i][i] += if kind == "copositive" || kind == "positive" { 0.1 } else { 0.0 };
            for (j, v) in m[i].iter().enumerate().filter(|e| *e.1 != 0.0) {
                e = e.plus(*v, j);
            }
        }
        p.pair(i, e);
    }
    p.x0.fill(1.0);
    p.finish()
}

/// The program in drawn decimal units, and that of the objective.
pub fn in_units(program: Program, digits: i32, seed: u64) -> (Program, f64) {
    let mut draw = SplitMix64::new(seed ^ 0x5eed);
    let mut unit = || 10f64.powi((f64::from(2 * digits + 1) * draw.share()) as i32 - digits);
    let objective = unit();
    let rows: Vec<f64> = program.rows.iter().map(|_| unit()).collect();
    let variables: Vec<f64> = program.x0.iter().map(|_| unit()).collect();
    (program.in_units(objective, &rows, &variables), objective)
}
