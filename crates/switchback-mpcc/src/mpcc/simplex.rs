//! Linear programs with dense rows, by the simplex method for variables with bounds.
//!
//! ```text
//! min cᵀx   s.t.   l ≤ (x, A x) ≤ u
//! ```
//!
//! What it ends with is checked with the rows as they were given, not with what pivots have made of them: a proof after Farkas
//! that there is no point, a point, or a ray along which the objective falls. Where rounding leaves neither, nothing is said.
//! The programs are small; a tableau keeps its basis while bounds change, so that branches next to one another take few pivots.

use crate::nlp::within;

/// Largest entry of a scaled row that counts as none in a choice of pivots.
pub(super) const PIVOT: f64 = 1e-9;
/// Violation of a bound that counts as none, relative to the sizes of the terms of its row or, of a variable, to its size.
pub(super) const MET: f64 = 1e-9;
/// Share of the largest value that rounding of pivots leaves of one that vanishes.
const NOISE: f64 = 1e-13;
/// Share of the terms of a sum that rounding may leave of one that vanishes.
pub(super) const ROUNDING: f64 = 1e-12;
/// Passes over rows and columns at most, to scale them.
const PASSES: usize = 20;
/// Pivots after which the first possible one is taken (R. G. Bland, *New finite pivoting rules for the simplex method*, 1977), and after which a
/// program is left, both as multiples of its rows and variables.
pub(super) const PATIENCE: usize = 5;
pub(super) const MOST: usize = 50;

/// Knowledge of a program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Found {
    /// A point within all bounds, and, where there is an objective, the best one.
    Point,
    /// There is none: shown by a combination of the rows.
    Infeasible,
    /// A ray of points along which the objective falls without end.
    Ray,
    /// Rounding, a limit, or an end that was asked for.
    Nothing,
}

/// A program, its basis and the point or ray found last. Variables are numbered through: those of the program, then the rows.
#[derive(Debug, Clone)]
pub struct Simplex {
    pub(super) n: usize,
    pub(super) m: usize,
    /// Rows as they were given, scaled, `[m · n]` by rows.
    pub(super) rows: Vec<f64>,
    /// Basic variables by nonbasic ones, `[m · n]` by rows.
    pub(super) tableau: Vec<f64>,
    pub(super) basic: Vec<usize>,
    pub(super) nonbasic: Vec<usize>,
    pub(super) lower: Vec<f64>,
    pub(super) upper: Vec<f64>,
    pub(super) value: Vec<f64>,
    /// Unit of every variable, and factor of every row: powers of two.
    pub(super) unit: Vec<f64>,
    /// Largest value.
    largest: f64,
    pub(super) direction: Vec<f64>,
    rate: Vec<f64>,
    /// Exchanges since the tableau was made from the rows.
    exchanges: usize,
    /// Entries of tableaus that pivots have gone over so far.
    pub work: f64,
    /// Entries that they may go over.
    pub allowed: f64,
}

/// A change of one nonbasic variable, up to the first bound on its way.
struct Step {
    column: usize,
    sense: f64,
    length: f64,
    /// The basic variable that reaches a bound, and that bound; none where it is the variable itself.
    leaving: Option<(usize, f64)>,
}

impl Simplex {
    /// Rows `a`, `[m · n]` by rows, without bounds.
    pub fn new(n: usize, m: usize, a: Vec<f64>) -> Simplex {
        Simplex::beside(n, m, a, Vec::new())
    }

    /// The same with units of variables in which these further rows, `[k · n]`, have entries of about one as well.
    pub fn beside(n: usize, m: usize, mut a: Vec<f64>, further: Vec<f64>) -> Simplex {
        let k = further.len().checked_div(n).unwrap_or(0);
        let mut unit = vec![1.0; n + m + k];
        a.extend(further);
        equilibrate(n, m + k, &mut a, &mut unit);
        a.truncate(m * n);
        unit.truncate(n + m);
        Simplex {
            tableau: a.clone(),
            rows: a,
            basic: (n..n + m).collect(),
            nonbasic: (0..n).collect(),
            lower: vec![f64::NEG_INFINITY; n + m],
            upper: vec![f64::INFINITY; n + m],
            value: vec![0.0; n + m],
            largest: 0.0,
            direction: vec![0.0; n + m],
            rate: vec![0.0; n],
            exchanges: 0,
            unit,
            work: 0.0,
            allowed: f64::INFINITY,
            n,
            m,
        }
    }

    /// Bounds of a variable, or, from `n` on, of a row.
    pub fn bound(&mut self, v: usize, lower: f64, upper: f64) {
        let s = self.unit[v];
        (self.lower[v], self.upper[v]) = if v < self.n { (lower / s, upper / s) } else { (lower * s, upper * s) };
    }

    /// The point found last, `x[n]`.
    pub fn point(&self) -> impl Iterator<Item = f64> + '_ {
        self.value[..self.n].iter().zip(&self.unit).map(|(v, s)| v * s)
    }

    /// The ray found last, `d[n]`.
    pub fn ray(&self) -> impl Iterator<Item = f64> + '_ {
        self.direction[..self.n].iter().zip(&self.unit).map(|(v, s)| v * s)
    }

    /// Value of a variable at the point found last, in units in which the rows have entries of one.
    pub fn scaled(&self, v: usize) -> f64 {
        self.value[v]
    }

    /// Looks for a point; `goes_on` is asked at every pivot. What rounding of a tableau that has served long hides is looked for once more, with one made
    /// from the rows.
    pub fn feasible(&mut self, goes_on: &dyn Fn() -> bool) -> Found {
        match self.look(goes_on) {
            Found::Nothing if self.exchanges > 0 && self.work <= self.allowed => {
                self.renew();
                self.look(goes_on)
            }
            found => found,
        }
    }

    fn look(&mut self, goes_on: &dyn Fn() -> bool) -> Found {
        let crossed = (0..self.n + self.m).any(|v| self.lower[v] > self.upper[v]);
        if crossed {
            return Found::Infeasible;
        }
        for k in 0..self.n {
            let v = self.nonbasic[k];
            self.value[v] = within(self.value[v], self.lower[v], self.upper[v]);
        }
        for pivots in 0.. {
            self.update_values();
            let mut violated = false;
            self.rate.fill(0.0);
            for i in 0..self.m {
                let sense = self.violation(self.basic[i]);
                if sense != 0.0 {
                    violated = true;
                    let row = &self.tableau[i * self.n..][..self.n];
                    self.rate.iter_mut().zip(row).for_each(|(r, t)| *r += sense * t);
                }
            }
            if !violated {
                return if self.is_feasible() { Found::Point } else { Found::Nothing };
            }
            if self.is_over(pivots, goes_on) {
                return Found::Nothing;
            }
            let Some((column, sense)) = self.entering(pivots) else {
                return if self.proves_infeasible() { Found::Infeasible } else { Found::Nothing };
            };
            match self.step(column, sense, pivots) {
                Some(step) => self.take(&step),
                None => return Found::Nothing,
            }
        }
        Found::Nothing
    }

    /// From a point within all bounds to the one with the least `cᵀx`.
    pub fn minimise(&mut self, c: &[f64], goes_on: &dyn Fn() -> bool) -> Found {
        let largest = c.iter().zip(&self.unit).fold(0f64, |a, (c, s)| a.max((c * s).abs()));
        if largest == 0.0 || !largest.is_finite() {
            return if largest == 0.0 { Found::Point } else { Found::Nothing };
        }
        let c: Vec<f64> = c.iter().zip(&self.unit).map(|(c, s)| c * s / largest).collect();
        // the check of a point has computed its rows: rounding off its bound, one that holds it would seem to have room towards it
        self.settle_at_bounds();
        for pivots in 0.. {
            self.update_values();
            for k in 0..self.n {
                self.rate[k] = self.nonbasic.get(k).filter(|v| **v < self.n).map_or(0.0, |v| -c[*v]);
            }
            for i in (0..self.m).filter(|i| self.basic[*i] < self.n) {
                let weight = c[self.basic[i]];
                let row = &self.tableau[i * self.n..][..self.n];
                self.rate.iter_mut().zip(row).for_each(|(r, t)| *r -= weight * t);
            }
            if self.is_over(pivots, goes_on) {
                return Found::Nothing;
            }
            let Some((column, sense)) = self.entering(pivots) else {
                return if self.is_feasible() { Found::Point } else { Found::Nothing };
            };
            match self.step(column, sense, pivots) {
                Some(step) => self.take(&step),
                None => {
                    self.write_direction(column, sense);
                    let falls = sum(c.iter().zip(&self.direction).map(|(c, d)| c * d));
                    let is_ray = self.is_ray() && falls.0 < -MET * falls.1;
                    return if is_ray && self.is_feasible() { Found::Ray } else { Found::Nothing };
                }
            }
        }
        Found::Nothing
    }

    /// Variables outside of the basis are at a bound where they have one.
    pub(super) fn settle_at_bounds(&mut self) {
        for k in 0..self.n {
            let v = self.nonbasic[k];
            self.value[v] = nearest(self.value[v], self.lower[v], self.upper[v]);
        }
    }

    pub(super) fn is_over(&self, pivots: usize, goes_on: &dyn Fn() -> bool) -> bool {
        self.work > self.allowed || pivots > MOST * (self.n + self.m) || !goes_on()
    }

    /// Values of the basic variables, from those of the others.
    pub(super) fn update_values(&mut self) {
        self.work += (self.n * self.m) as f64;
        for i in 0..self.m {
            let row = &self.tableau[i * self.n..][..self.n];
            self.value[self.basic[i]] = row.iter().zip(&self.nonbasic).map(|(t, v)| t * self.value[*v]).sum();
        }
        self.largest = self.value.iter().fold(0.0, |a, v| a.max(v.abs()));
    }

    /// The sense in which a variable has to move to get within its bounds; 0 where it is.
    fn violation(&self, v: usize) -> f64 {
        let (x, lo, hi) = (self.value[v], self.lower[v], self.upper[v]);
        let room = 0.1 * (MET * self.size(v) + NOISE * self.largest);
        f64::from(i8::from(x < lo - room) - i8::from(x > hi + room))
    }

    /// What the violation of a variable is compared with: the sizes of the terms of a row, or the variable.
    fn size(&self, v: usize) -> f64 {
        let nearest = self.lower[v].abs().min(self.upper[v].abs());
        let own = if nearest.is_finite() { nearest } else { 0.0 };
        if v < self.n {
            return own.max(self.value[v].abs());
        }
        let row = &self.rows[(v - self.n) * self.n..][..self.n];
        own.max(sum(row.iter().zip(&self.value).map(|(a, x)| a * x)).1)
    }

    /// The nonbasic variable to change, and in which sense: the steepest, after many pivots the first.
    fn entering(&self, pivots: usize) -> Option<(usize, f64)> {
        let first = pivots > PATIENCE * (self.n + self.m);
        let mut best: Option<(usize, f64, f64)> = None;
        for (k, &v) in self.nonbasic.iter().enumerate() {
            let rate = self.rate[k];
            let possible = if rate > 0.0 { self.value[v] < self.upper[v] } else { self.value[v] > self.lower[v] };
            if rate.abs() <= PIVOT || !possible {
                continue;
            }
            let key = if first { -(v as f64) } else { rate.abs() };
            if best.is_none_or(|b| key > b.2) {
                best = Some((k, rate.signum(), key));
            }
        }
        best.map(|b| (b.0, b.1))
    }

    /// How far the nonbasic variable of a column can go; `None`: without end.
    fn step(&self, column: usize, sense: f64, pivots: usize) -> Option<Step> {
        let own = self.nonbasic[column];
        let first = pivots > PATIENCE * (self.n + self.m);
        let room = if sense > 0.0 { self.upper[own] - self.value[own] } else { self.value[own] - self.lower[own] };
        let mut found = Step { column, sense, length: room, leaving: None };
        let mut pivot = 0.0;
        for i in 0..self.m {
            let t = sense * self.tableau[i * self.n + column];
            if t.abs() <= PIVOT {
                continue;
            }
            let v = self.basic[i];
            let out = self.violation(v);
            // what is outside ends at the bound that it violates, or moves away without a limit
            let bound = match out {
                _ if out * t > 0.0 => {
                    if out > 0.0 {
                        self.lower[v]
                    } else {
                        self.upper[v]
                    }
                }
                0.0 => {
                    if t > 0.0 {
                        self.upper[v]
                    } else {
                        self.lower[v]
                    }
                }
                _ => continue,
            };
            if !bound.is_finite() {
                continue;
            }
            let length = ((bound - self.value[v]) / t).max(0.0);
            let tie = length == found.length && found.leaving.is_some();
            let better = if first { found.leaving.is_some_and(|l| v < self.basic[l.0]) } else { t.abs() > pivot };
            if length < found.length || (tie && better) {
                pivot = t.abs();
                (found.length, found.leaving) = (length, Some((i, bound)));
            }
        }
        found.length.is_finite().then_some(found)
    }

    fn take(&mut self, step: &Step) {
        let entering = self.nonbasic[step.column];
        let Some((row, bound)) = step.leaving else {
            self.value[entering] = if step.sense > 0.0 { self.upper[entering] } else { self.lower[entering] };
            return;
        };
        self.value[entering] += step.sense * step.length;
        self.value[self.basic[row]] = bound;
        self.exchange(row, step.column);
    }

    /// Makes the tableau of the present basis from the rows; of variables that depend on others some leave the basis.
    fn renew(&mut self) {
        let (n, m) = (self.n, self.m);
        let mut wanted = vec![false; n + m];
        self.basic.iter().for_each(|v| wanted[*v] = true);
        self.tableau.copy_from_slice(&self.rows);
        self.basic.iter_mut().enumerate().for_each(|(i, v)| *v = n + i);
        self.nonbasic.iter_mut().enumerate().for_each(|(j, v)| *v = j);
        for column in 0..n {
            let v = self.nonbasic[column];
            if !wanted[v] {
                continue;
            }
            let size = |i: usize| self.tableau[i * n + column].abs();
            let free = (0..m).filter(|&i| !wanted[self.basic[i]]);
            if let Some(row) = free.max_by(|&a, &b| size(a).total_cmp(&size(b))).filter(|&i| size(i) > PIVOT) {
                self.exchange(row, column);
            }
        }
        self.exchanges = 0;
    }

    /// The basic variable of a row leaves the basis, the nonbasic one of a column takes its place.
    pub(super) fn exchange(&mut self, row: usize, column: usize) {
        let n = self.n;
        self.exchanges += 1;
        self.work += (n * self.m) as f64;
        // x_l = Σ t_k x_k solved for the variable of the column
        let mut own = self.tableau[row * n..][..n].to_vec();
        let pivot = own[column];
        own.iter_mut().for_each(|t| *t /= -pivot);
        own[column] = 1.0 / pivot;
        for i in (0..self.m).filter(|i| *i != row) {
            let line = &mut self.tableau[i * n..][..n];
            let factor = std::mem::replace(&mut line[column], 0.0);
            if factor != 0.0 {
                line.iter_mut().zip(&own).for_each(|(t, o)| *t += factor * o);
            }
        }
        self.tableau[row * n..][..n].copy_from_slice(&own);
        std::mem::swap(&mut self.basic[row], &mut self.nonbasic[column]);
    }

    /// Is the point within all bounds, by the rows as they were given?
    pub(super) fn is_feasible(&mut self) -> bool {
        let kept = self.value.clone();
        self.write_rows(|s| &mut s.value);
        let holds = (0..self.n + self.m).all(|v| {
            let (x, room) = (self.value[v], MET * self.size(v) + NOISE * self.largest);
            x >= self.lower[v] - room && x <= self.upper[v] + room
        });
        // those outside of the basis are what they were: off its bound by rounding, one would seem to have room towards it
        for v in self.nonbasic.iter().filter(|v| **v >= self.n) {
            self.value[*v] = kept[*v];
        }
        holds
    }

    /// The rows of a vector, by the rows as they were given.
    fn write_rows(&mut self, of: fn(&mut Simplex) -> &mut Vec<f64>) {
        let mut v = std::mem::take(of(self));
        let (x, out) = v.split_at_mut(self.n);
        for (i, r) in out.iter_mut().enumerate() {
            *r = self.rows[i * self.n..][..self.n].iter().zip(&*x).map(|(a, x)| a * x).sum();
        }
        *of(self) = v;
    }

    /// The change of all variables with that of the nonbasic one of a column.
    fn write_direction(&mut self, column: usize, sense: f64) {
        self.direction.fill(0.0);
        self.direction[self.nonbasic[column]] = sense;
        for i in 0..self.m {
            let t = self.tableau[i * self.n + column];
            self.direction[self.basic[i]] = if t.abs() <= PIVOT { 0.0 } else { sense * t };
        }
    }

    /// Does the direction stay within all bounds for ever? By the rows as they were given, which it makes its own.
    pub(super) fn is_ray(&mut self) -> bool {
        self.write_rows(|s| &mut s.direction);
        (0..self.n + self.m).all(|v| {
            let d = self.direction[v];
            let room = if v < self.n {
                0.0
            } else {
                let row = &self.rows[(v - self.n) * self.n..][..self.n];
                ROUNDING.sqrt() * 1e-3 * sum(row.iter().zip(&self.direction).map(|(a, d)| a * d)).1
            };
            (d >= -room || self.lower[v] == f64::NEG_INFINITY) && (d <= room || self.upper[v] == f64::INFINITY)
        })
    }

    /// Does the combination of the rows at which no violation can fall any more show that there is no point? With weights `y` of the
    /// rows, `yᵀ(A x) − (Aᵀy)ᵀ x` vanishes for all `x`; it shows that, if its least value within the bounds is positive.
    fn proves_infeasible(&self) -> bool {
        let mut y = vec![0.0; self.m];
        for i in 0..self.m {
            let (sense, v) = (self.violation(self.basic[i]), self.basic[i]);
            if v >= self.n {
                y[v - self.n] += sense;
            }
        }
        for (k, &v) in self.nonbasic.iter().enumerate() {
            if v >= self.n && self.rate[k].abs() > PIVOT {
                y[v - self.n] -= self.rate[k];
            }
        }
        let (mut least, mut terms) = (0.0, 0f64);
        let mut add = |weight: f64, v: usize| -> bool {
            let bound = if weight > 0.0 { self.lower[v] } else { self.upper[v] };
            least += weight * bound;
            terms += (weight * bound).abs();
            bound.is_finite()
        };
        let mut finite = true;
        for (i, weight) in y.iter().enumerate().filter(|w| *w.1 != 0.0) {
            finite &= add(*weight, self.n + i);
        }
        for j in 0..self.n {
            let (z, size) = sum(y.iter().enumerate().map(|(i, y)| -y * self.rows[i * self.n + j]));
            let bounded = if z > 0.0 { self.lower[j] } else { self.upper[j] }.is_finite();
            // what rounding leaves of a weight that vanishes needs no bound
            if z != 0.0 && (bounded || z.abs() > ROUNDING * size) {
                finite &= add(z, j);
            }
        }
        finite && least > MET * terms
    }
}

/// A sum, and the sum of the sizes of its terms.
pub(super) fn sum(terms: impl Iterator<Item = f64>) -> (f64, f64) {
    terms.fold((0.0, 0.0), |(s, t), v| (s + v, t + v.abs()))
}

/// The value within bounds next to this one.
fn nearest(v: f64, lo: f64, hi: f64) -> f64 {
    if v < lo || (v < hi && v - lo <= hi - v && lo.is_finite()) {
        lo
    } else if v > hi || (v > lo && hi.is_finite()) {
        hi
    } else {
        v
    }
}

/// Scales rows and columns by powers of two, so that the largest and the smallest entries of each are about as far from one.
fn equilibrate(n: usize, m: usize, a: &mut [f64], unit: &mut [f64]) {
    let factor = |least: f64, most: f64| -> f64 {
        if most > 0.0 && most.is_finite() {
            (least * most).sqrt().log2().round().clamp(-200.0, 200.0).exp2()
        } else {
            1.0
        }
    };
    for _ in 0..PASSES {
        let mut changed = false;
        for i in 0..m {
            let row = &mut a[i * n..][..n];
            let s = extremes(row.iter().copied());
            let s = factor(s.0, s.1);
            if s != 1.0 {
                changed = true;
                row.iter_mut().for_each(|v| *v /= s);
                unit[n + i] /= s;
            }
        }
        for j in 0..n {
            let s = extremes((0..m).map(|i| a[i * n + j]));
            let s = factor(s.0, s.1);
            if s != 1.0 {
                changed = true;
                (0..m).for_each(|i| a[i * n + j] /= s);
                unit[j] /= s;
            }
        }
        if !changed {
            break;
        }
    }
}

/// Smallest and largest modulus of what is not zero.
fn extremes(v: impl Iterator<Item = f64>) -> (f64, f64) {
    v.filter(|v| *v != 0.0).fold((f64::INFINITY, 0.0), |(a, b), v| (v.abs().min(a), v.abs().max(b)))
}
