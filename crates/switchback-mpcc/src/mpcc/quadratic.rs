//! Convex quadratic objectives over the rows of a [`Simplex`], by an active-set method on its tableau.
//!
//! Variables outside of the basis that are between their bounds are *free*; all others follow from the tableau. The objective is
//! minimised over the free ones, with the Hessian reduced to them; where that leads beyond a bound, what reaches it first is held
//! there, and a free variable takes its place in the basis. At a minimiser the variable whose reduced derivative promises most is let
//! go (P. Wolfe, *The simplex method for quadratic programming*, Econometrica 27 (1959); R. Fletcher, *Practical Methods of
//! Optimization*, 10.3, for the reduced Hessian, which the last variable let go may leave singular once).
//!
//! What is believed is the bound: any multipliers of the rows give one from below, by convexity and weak duality, with the rows as
//! they were given.

use super::simplex::{sum, Found, Simplex, MET, PATIENCE, PIVOT, ROUNDING};

/// Share of its terms up to which a reduced derivative is none.
const FLAT: f64 = 1e-10;
/// Share of the terms of the curvature along a variable below which there is none beside that along the others.
const CURVED: f64 = 1e-13;
/// Share of the largest derivative that counts as a term of every reduced one: entries of a tableau that vanish leave rounding.
const NOISE: f64 = 1e-3;

/// An objective `½ xᵀQx + cᵀx` of a number of variables.
#[derive(Debug, Clone)]
pub struct Quadratic {
    n: usize,
    /// Entries of both triangles.
    entries: Vec<(usize, usize, f64)>,
    linear: Vec<f64>,
}

impl Quadratic {
    /// From the entries of both triangles of the matrix, which is symmetric and positive semidefinite, and `c[n]`.
    pub fn new(entries: Vec<(usize, usize, f64)>, c: Vec<f64>) -> Quadratic {
        Quadratic { n: c.len(), entries, linear: c }
    }

    /// The rows of the matrix that are not zero, and the linear terms, `[k · n]` by rows.
    pub fn rows(&self) -> Vec<f64> {
        let n = self.n;
        let mut full = vec![0.0; n * n];
        self.entries.iter().for_each(|&(i, j, q)| full[i * n + j] = q);
        full.extend_from_slice(&self.linear);
        full.chunks(n.max(1)).filter(|row| row.iter().any(|v| *v != 0.0)).flatten().copied().collect()
    }

    /// Is it zero everywhere?
    pub fn is_zero(&self) -> bool {
        self.entries.is_empty() && self.linear.iter().all(|c| *c == 0.0)
    }

    /// The value at `x[n]`.
    pub fn value(&self, x: &[f64]) -> f64 {
        let curved: f64 = self.entries.iter().map(|&(i, j, q)| 0.5 * q * x[i] * x[j]).sum();
        curved + self.linear.iter().zip(x).map(|(c, x)| c * x).sum::<f64>()
    }

    /// Sum of the sizes of the terms of the value at `x[n]`.
    pub fn terms(&self, x: &[f64]) -> f64 {
        let curved: f64 = self.entries.iter().map(|&(i, j, q)| (0.5 * q * x[i] * x[j]).abs()).sum();
        curved + self.linear.iter().zip(x).map(|(c, x)| (c * x).abs()).sum::<f64>()
    }

    /// The product of the matrix and `x`.
    fn times(&self, x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        self.entries.iter().for_each(|&(i, j, q)| out[i] += q * x[j]);
    }

    /// The gradient at `x`, and the sizes of its terms.
    fn gradient(&self, x: &[f64], out: &mut [f64], sizes: &mut [f64]) {
        out.copy_from_slice(&self.linear);
        sizes.iter_mut().zip(&self.linear).for_each(|(s, c)| *s = c.abs());
        for &(i, j, q) in &self.entries {
            out[i] += q * x[j];
            sizes[i] += (q * x[j]).abs();
        }
    }

    /// The objective in other units of its variables.
    fn in_units(&self, unit: &[f64]) -> Quadratic {
        let entries = self.entries.iter().map(|&(i, j, q)| (i, j, q * unit[i] * unit[j])).collect();
        Quadratic { n: self.n, entries, linear: self.linear.iter().zip(unit).map(|(c, u)| c * u).collect() }
    }
}

/// The end of a minimisation: multipliers of the rows and of the bounds of variables, in the units of the program, and the bound
/// from below that they prove.
#[derive(Debug, Clone, Default)]
pub struct Proof {
    /// Multipliers of the rows `[m]`: derivatives of the least objective by their bounds.
    pub rows: Vec<f64>,
    /// Those of the bounds of variables `[n]`.
    pub variables: Vec<f64>,
    /// No point within the bounds has a lower objective.
    pub bound: f64,
}

/// Room of a minimisation.
struct Work {
    f: Quadratic,
    /// Gradient by the variables of the program, and the sizes of its terms.
    gradient: Vec<f64>,
    terms: Vec<f64>,
    /// Reduced derivatives by nonbasic columns, and the sizes of their terms.
    reduced: Vec<f64>,
    sizes: Vec<f64>,
    /// Columns that are free.
    free: Vec<usize>,
    /// Directions of the free ones.
    ways: Vec<Vec<f64>>,
    /// Triangular factor of the reduced Hessian, by rows.
    factor: Vec<f64>,
    /// Steps without a length, one after the other.
    stays: usize,
    /// Variables along which there is nothing but rounding, since the last step.
    flat: Vec<usize>,
}

impl Work {
    /// Do vertices take turns? Then the first variable that may change does (R. G. Bland, *New finite pivoting rules for the simplex
    /// method*, 1977).
    fn turns(&self) -> bool {
        self.stays > PATIENCE
    }
}

/// Ends of a step.
enum Advance {
    /// At the least objective along it.
    Rests,
    /// At a bound, where a variable is held.
    Held,
    /// There is none: nothing ends it.
    Unlimited,
}

impl Simplex {
    /// From a point within all bounds to the one with the least `f`, which has to be convex. Multipliers and the bound that is proved
    /// are written to `proof` where there is such a point.
    pub fn minimise_quadratic(&mut self, f: &Quadratic, proof: &mut Proof, goes_on: &dyn Fn() -> bool) -> Found {
        let n = self.n;
        self.update_values();
        let mut w = Work {
            f: f.in_units(&self.unit),
            gradient: vec![0.0; n],
            terms: vec![0.0; n],
            reduced: vec![0.0; n],
            sizes: vec![0.0; n],
            free: Vec::new(),
            ways: Vec::new(),
            factor: Vec::new(),
            stays: 0,
            flat: Vec::new(),
        };
        // what is between its bounds is free from the start
        let between = |v: &usize| self.value[*v] != self.lower[*v] && self.value[*v] != self.upper[*v];
        w.free.extend((0..n).filter(|k| between(&self.nonbasic[*k])));
        let mut at_rest = w.free.is_empty();
        for pivots in 0.. {
            if self.is_over(pivots, goes_on) {
                return Found::Nothing;
            }
            self.reduce(&mut w);
            if at_rest {
                let Some((column, sense)) = self.promising(&w) else {
                    self.prove(&w, proof);
                    return if self.is_feasible() { Found::Point } else { Found::Nothing };
                };
                if !self.let_go(&mut w, column) {
                    // no curvature along it: to a bound, or without end
                    self.flat_direction(&w, column, sense);
                    self.forget(&mut w);
                    if self.is_flat(&w) {
                        // nor a slope: it may stay where it is, held like one that is at a bound
                        w.flat.push(self.nonbasic[column]);
                        continue;
                    }
                    w.free.push(column);
                    match self.advance(&mut w) {
                        Advance::Unlimited => return self.falls_without_end(&w),
                        _ => at_rest = false,
                    }
                    continue;
                }
            }
            if w.free.is_empty() {
                at_rest = true;
                continue;
            }
            if w.factor.is_empty() {
                self.factorise(&mut w);
            }
            self.newton_direction(&mut w);
            match self.advance(&mut w) {
                Advance::Held => {
                    at_rest = false;
                    self.forget(&mut w);
                }
                _ => at_rest = true,
            }
        }
        Found::Nothing
    }

    /// Gradient and reduced derivatives at the present point.
    fn reduce(&mut self, w: &mut Work) {
        let n = self.n;
        w.f.gradient(&self.value[..n], &mut w.gradient, &mut w.terms);
        self.work += (n * (self.m + 1) + w.f.entries.len()) as f64;
        for k in 0..n {
            let v = self.nonbasic[k];
            (w.reduced[k], w.sizes[k]) = if v < n { (w.gradient[v], w.terms[v]) } else { (0.0, 0.0) };
        }
        let noise = NOISE * w.terms.iter().fold(0f64, |a, t| a.max(*t));
        w.sizes.iter_mut().for_each(|s| *s += noise);
        for i in (0..self.m).filter(|i| self.basic[*i] < n) {
            let (g, size) = (w.gradient[self.basic[i]], w.terms[self.basic[i]]);
            if size != 0.0 {
                for (k, t) in self.tableau[i * n..][..n].iter().enumerate() {
                    w.reduced[k] += g * t;
                    w.sizes[k] += size * t.abs();
                }
            }
        }
    }

    /// Is the slope along the direction nothing but rounding?
    fn is_flat(&self, w: &Work) -> bool {
        let slope: f64 = w.gradient.iter().zip(&self.direction).map(|(g, d)| g * d).sum();
        let terms: f64 = w.terms.iter().zip(&self.direction).map(|(t, d)| t * d.abs()).sum();
        slope >= -FLAT * terms
    }

    /// The held variable whose reduced derivative promises most, and the sense in which it goes.
    fn promising(&self, w: &Work) -> Option<(usize, f64)> {
        let mut best: Option<(usize, f64, f64)> = None;
        for k in (0..self.n).filter(|k| !w.free.contains(k)) {
            let (v, d) = (self.nonbasic[k], w.reduced[k]);
            let possible = if d < 0.0 { self.value[v] < self.upper[v] } else { self.value[v] > self.lower[v] };
            if d.abs() <= FLAT * w.sizes[k] || d == 0.0 || !possible || w.flat.contains(&v) {
                continue;
            }
            let key = if w.turns() { -(v as f64) } else { d.abs() };
            if best.is_none_or(|b| key > b.2) {
                best = Some((k, -d.signum(), key));
            }
        }
        best.map(|b| (b.0, b.1))
    }

    /// The change of the variables of the program with that of a column.
    fn way(&self, column: usize) -> Vec<f64> {
        let mut d = vec![0.0; self.n];
        let v = self.nonbasic[column];
        if v < self.n {
            d[v] = 1.0;
        }
        for i in (0..self.m).filter(|i| self.basic[*i] < self.n) {
            let t = self.tableau[i * self.n + column];
            d[self.basic[i]] = if t.abs() <= PIVOT { 0.0 } else { t };
        }
        d
    }

    /// Adds a column to those that are free; false where the objective is not curved along it beside the others, which leaves its last
    /// row in the factor, without a diagonal.
    fn let_go(&mut self, w: &mut Work, column: usize) -> bool {
        if w.factor.is_empty() && !w.free.is_empty() {
            self.factorise(w);
        }
        let d = self.way(column);
        self.extend(w, column, d)
    }

    fn extend(&mut self, w: &mut Work, column: usize, d: Vec<f64>) -> bool {
        let (n, s) = (self.n, w.ways.len());
        let mut bent = vec![0.0; n];
        w.f.times(&d, &mut bent);
        self.work += (n * (s + 1) + w.f.entries.len()) as f64;
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // a new row of the Cholesky factor
        let mut row = Vec::with_capacity(s + 1);
        for i in 0..s {
            let known: f64 = (0..i).map(|j| w.factor[i * (i + 1) / 2 + j] * row[j]).sum();
            row.push((dot(&w.ways[i], &bent) - known) / w.factor[i * (i + 1) / 2 + i]);
        }
        let own = dot(&d, &bent);
        let size: f64 = w.f.entries.iter().map(|&(i, j, q)| (q * d[i] * d[j]).abs()).sum();
        let left = own - dot(&row, &row);
        let curved = left > CURVED * size;
        row.push(if curved { left.sqrt() } else { 0.0 });
        w.factor.extend_from_slice(&row);
        if curved {
            w.ways.push(d);
            w.free.push(column);
        }
        curved
    }

    /// The factor of the reduced Hessian of the free columns. Those along which rounding leaves no curvature are held where they are.
    fn factorise(&mut self, w: &mut Work) {
        self.forget(w);
        for column in std::mem::take(&mut w.free) {
            let (d, known) = (self.way(column), w.factor.len());
            if !self.extend(w, column, d) {
                w.factor.truncate(known);
            }
        }
    }

    /// The tableau or the free columns have changed.
    fn forget(&self, w: &mut Work) {
        w.factor.clear();
        w.ways.clear();
    }

    /// Solves with the factor, or, by `s` rows of it, with its transpose.
    fn solve_upper(factor: &[f64], s: usize, x: &mut [f64]) {
        for i in (0..s).rev() {
            let later: f64 = (i + 1..s).map(|j| factor[j * (j + 1) / 2 + i] * x[j]).sum();
            x[i] = (x[i] - later) / factor[i * (i + 1) / 2 + i];
        }
    }

    /// The direction to the minimiser over the free columns.
    fn newton_direction(&mut self, w: &mut Work) {
        let s = w.free.len();
        let mut x: Vec<f64> = w.free.iter().map(|k| -w.reduced[*k]).collect();
        for i in 0..s {
            let known: f64 = (0..i).map(|j| w.factor[i * (i + 1) / 2 + j] * x[j]).sum();
            x[i] = (x[i] - known) / w.factor[i * (i + 1) / 2 + i];
        }
        Self::solve_upper(&w.factor, s, &mut x);
        self.point_along(&w.free, &x);
    }

    /// A direction without curvature in which this column goes by one, the free ones along with it.
    fn flat_direction(&mut self, w: &Work, column: usize, sense: f64) {
        let s = w.free.len();
        let mut x: Vec<f64> = w.factor[s * (s + 1) / 2..][..s].iter().map(|r| -sense * r).collect();
        Self::solve_upper(&w.factor, s, &mut x);
        let mut columns = w.free.clone();
        columns.push(column);
        x.push(sense);
        self.point_along(&columns, &x);
    }

    /// The direction of all variables in which these columns change so.
    fn point_along(&mut self, columns: &[usize], x: &[f64]) {
        let n = self.n;
        self.work += (self.m * columns.len()) as f64;
        self.direction.fill(0.0);
        let longest = x.iter().fold(0f64, |a, x| a.max(x.abs()));
        for (k, x) in columns.iter().zip(x) {
            self.direction[self.nonbasic[*k]] = *x;
        }
        for i in 0..self.m {
            let row = &self.tableau[i * n..][..n];
            let (d, size) = sum(columns.iter().zip(x).map(|(k, x)| row[*k] * x));
            self.direction[self.basic[i]] = if d.abs() <= (PIVOT * size).max(ROUNDING * longest) { 0.0 } else { d };
        }
    }

    /// Goes along the direction to the least objective on it. What reaches a bound first is held there.
    fn advance(&mut self, w: &mut Work) -> Advance {
        let (n, m) = (self.n, self.m);
        let d = &self.direction[..n];
        let slope: f64 = w.gradient.iter().zip(d).map(|(g, d)| g * d).sum();
        let (bend, terms) = sum(w.f.entries.iter().map(|&(i, j, q)| q * d[i] * d[j]));
        self.work += (n + w.f.entries.len()) as f64;
        if slope >= 0.0 {
            return Advance::Rests;
        }
        let longest = if bend > ROUNDING * terms { -slope / bend } else { f64::INFINITY };
        let (mut length, mut end, mut best) = (longest, None, 0.0);
        let movers = w.free.iter().map(|k| self.nonbasic[*k]).chain(self.basic.iter().copied());
        for v in movers {
            let d = self.direction[v];
            if d == 0.0 {
                continue;
            }
            let bound = if d > 0.0 { self.upper[v] } else { self.lower[v] };
            if !bound.is_finite() {
                continue;
            }
            let reach = ((bound - self.value[v]) / d).max(0.0);
            let key = if w.turns() { -(v as f64) } else { d.abs() };
            if reach < length || (reach == length && end.is_some() && key > best) {
                (length, end, best) = (reach, Some((v, bound)), key);
            }
        }
        w.stays = if length == 0.0 { w.stays + 1 } else { 0 };
        w.flat.clear();
        if length.is_infinite() {
            return Advance::Unlimited;
        }
        for k in &w.free {
            let v = self.nonbasic[*k];
            self.value[v] += length * self.direction[v];
        }
        if let Some((v, bound)) = end {
            if let Some(at) = w.free.iter().position(|k| self.nonbasic[*k] == v) {
                w.free.remove(at);
                self.value[v] = bound;
            } else if let Some(row) = (0..m).find(|i| self.basic[*i] == v) {
                // the free column that it depends on most takes its place
                let size = |k: usize| self.tableau[row * n + k].abs();
                let Some(at) = (0..w.free.len()).max_by(|&a, &b| size(w.free[a]).total_cmp(&size(w.free[b]))) else {
                    return Advance::Rests;
                };
                let column = w.free.remove(at);
                self.exchange(row, column);
                self.value[v] = bound;
            }
        }
        self.update_values();
        if end.is_some() {
            Advance::Held
        } else {
            Advance::Rests
        }
    }

    /// Is the direction without curvature a ray along which the objective falls?
    fn falls_without_end(&mut self, w: &Work) -> Found {
        let falls = sum(w.gradient.iter().zip(&self.direction).map(|(g, d)| g * d));
        let is_ray = self.is_ray() && falls.0 < -MET * falls.1;
        if is_ray && self.is_feasible() {
            Found::Ray
        } else {
            Found::Nothing
        }
    }

    /// Multipliers at the present point, and the bound that they prove: `f(x) ≥ −½ x̂ᵀQx̂ + ∇f(x̂)ᵀx` by convexity, and the gradient is
    /// `Aᵀy + z`.
    fn prove(&self, w: &Work, proof: &mut Proof) {
        let n = self.n;
        let mut y = vec![0.0; self.m];
        for (k, &v) in self.nonbasic.iter().enumerate() {
            if v >= n && w.reduced[k].abs() > FLAT * w.sizes[k] {
                y[v - n] = w.reduced[k];
            }
        }
        let noise = NOISE * w.terms.iter().fold(0f64, |a, t| a.max(*t));
        let x = &self.value[..n];
        let mut bound: f64 = -0.5 * w.f.entries.iter().map(|&(i, j, q)| q * x[i] * x[j]).sum::<f64>();
        // what rounding leaves of a multiplier that vanishes counts at the point where its variable has no bound
        let mut rounding = 0.0;
        let mut add = |weight: f64, v: usize, size: f64| {
            let mut end = if weight > 0.0 { self.lower[v] } else { self.upper[v] };
            if weight.abs() <= ROUNDING.sqrt() * size && !end.is_finite() {
                end = self.value[v];
                rounding += (weight * end).abs();
            }
            if weight != 0.0 {
                bound += weight * end;
            }
        };
        for (i, y) in y.iter().enumerate() {
            add(*y, n + i, y.abs());
        }
        proof.variables.clear();
        for j in 0..n {
            let (z, size) = sum(y.iter().enumerate().map(|(i, y)| -y * self.rows[i * n + j]));
            let (z, size) = (z + w.gradient[j], size + w.terms[j].max(noise));
            let z = if z.abs() <= ROUNDING * size { 0.0 } else { z };
            add(z, j, size);
            proof.variables.push(z / self.unit[j]);
        }
        proof.rows.clear();
        proof.rows.extend(y.iter().enumerate().map(|(i, y)| y * self.unit[n + i]));
        proof.bound = if rounding <= MET * w.f.terms(x) { bound } else { f64::NEG_INFINITY };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::SplitMix64;

    const INF: f64 = f64::INFINITY;

    fn go() -> bool {
        true
    }

    /// The point of the simplex `x ≥ 0`, `Σ x = 1` next to a given one, by its closed form: `max(t − θ, 0)` (C. Michelot, J. Optim. Theory
    /// Appl. 50, 1986).
    #[test]
    fn the_projection_onto_a_simplex_is_its_closed_form() {
        let mut draw = SplitMix64::new(3);
        for n in [1, 2, 5, 12] {
            for _ in 0..20 {
                let t: Vec<f64> = (0..n).map(|_| 4.0 * draw.share() - 2.0).collect();
                let f = Quadratic::new((0..n).map(|i| (i, i, 1.0)).collect(), t.iter().map(|t| -t).collect());
                let mut lp = Simplex::new(n, 1, vec![1.0; n]);
                (0..n).for_each(|j| lp.bound(j, 0.0, INF));
                lp.bound(n, 1.0, 1.0);
                let mut proof = Proof::default();
                assert_eq!(lp.feasible(&go), Found::Point);
                assert_eq!(lp.minimise_quadratic(&f, &mut proof, &go), Found::Point);
                let mut sorted = t.clone();
                sorted.sort_by(|a, b| b.total_cmp(a));
                let theta = |k: usize| (sorted[..k].iter().sum::<f64>() - 1.0) / k as f64;
                let k = (1..=n).rev().find(|&k| sorted[k - 1] > theta(k)).unwrap();
                let x: Vec<f64> = lp.point().collect();
                for j in 0..n {
                    assert!((x[j] - (t[j] - theta(k)).max(0.0)).abs() < 1e-12, "{x:?} {t:?}");
                }
                assert!((proof.bound - f.value(&x)).abs() < 1e-12, "{} {}", proof.bound, f.value(&x));
                assert!((proof.rows[0] + theta(k)).abs() < 1e-12);
            }
        }
    }

    /// A singular matrix: a valley, a slope along it to a bound, and without one a ray.
    #[test]
    fn objectives_without_curvature_end_at_bounds_or_fall_for_ever() {
        // (x + y − 3)² − y
        let f = Quadratic::new((0..4).map(|k| (k / 2, k % 2, 2.0)).collect(), vec![-6.0, -7.0]);
        let mut lp = Simplex::new(2, 1, vec![1.0, -1.0]);
        let mut proof = Proof::default();
        lp.bound(1, -INF, 10.0);
        assert_eq!(lp.feasible(&go), Found::Point);
        assert_eq!(lp.minimise_quadratic(&f, &mut proof, &go), Found::Point);
        let x: Vec<f64> = lp.point().collect();
        assert!((x[0] + 7.0).abs() < 1e-9 && (x[1] - 10.0).abs() < 1e-9, "{x:?}");
        assert!((proof.bound + 19.0).abs() < 1e-9 && (proof.variables[1] + 1.0).abs() < 1e-9, "{proof:?}");
        lp.bound(1, -INF, INF);
        assert_eq!(lp.feasible(&go), Found::Point);
        assert_eq!(lp.minimise_quadratic(&f, &mut proof, &go), Found::Ray);
        let d: Vec<f64> = lp.ray().collect();
        assert!((d[0] + d[1]).abs() < 1e-12 && d[1] > 0.0, "{d:?}");
        // the row ends it, in units of its own
        lp.bound(2, -4.0, INF);
        assert_eq!(lp.feasible(&go), Found::Point);
        assert_eq!(lp.minimise_quadratic(&f, &mut proof, &go), Found::Point);
        let x: Vec<f64> = lp.point().collect();
        assert!((x[0] - x[1] + 4.0).abs() < 1e-9, "{x:?}");
    }

    /// Of random programs with dependent rows no drawn point is below the bound, and the bound is met.
    #[test]
    fn no_point_is_below_the_bound() {
        let mut draw = SplitMix64::new(8);
        let mut s = move || 2.0 * draw.share() - 1.0;
        for case in 0..60 {
            let (n, rank) = (4 + case % 5, 1 + case % 4);
            let l: Vec<f64> = (0..rank * n).map(|_| s()).collect();
            let entry = |i: usize, j: usize| (0..rank).map(|r| l[r * n + i] * l[r * n + j]).sum();
            let f = Quadratic::new(
                (0..n * n).map(|k| (k / n, k % n, entry(k / n, k % n))).collect(),
                (0..n).map(|_| s()).collect(),
            );
            let mut a: Vec<f64> = (0..2 * n).map(|_| s()).collect();
            a.extend((0..n).map(|j| a[j] - a[n + j]).collect::<Vec<f64>>());
            let row = |x: &[f64], i: usize| -> f64 { (0..n).map(|j| a[i * n + j] * x[j]).sum() };
            let mut lp = Simplex::new(n, 3, a.clone());
            (0..n).for_each(|j| lp.bound(j, -1.0, 1.0));
            (0..3).for_each(|i| lp.bound(n + i, -0.5, INF));
            let mut proof = Proof::default();
            assert_eq!(lp.feasible(&go), Found::Point, "{case}");
            assert_eq!(lp.minimise_quadratic(&f, &mut proof, &go), Found::Point, "{case}");
            let x: Vec<f64> = lp.point().collect();
            assert!((proof.bound - f.value(&x)).abs() < 1e-9, "{case}: {} {}", proof.bound, f.value(&x));
            for _ in 0..200 {
                let y: Vec<f64> = (0..n).map(|_| s()).collect();
                let holds = (0..3).all(|i| row(&y, i) >= -0.5);
                assert!(!holds || f.value(&y) >= proof.bound - 1e-9, "{case}");
            }
        }
    }
}
