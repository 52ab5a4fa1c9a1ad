//! First-order conditions at the end of a descent: multipliers, costates, how the optimum follows its data.

use super::Last;
use crate::error::{Error, Result};
use crate::ocp::descent::{Gradients, Lowest, Program, RowOf, Shooting, Values};
use crate::ocp::{stage_times, Multipliers, MultipliersOf, Ocp, OcpSensitivity};
use nalgebra::{DMatrix, DVector};

/// Step of the central differences of first derivatives, as a share of the size of what is moved: the third root of the tolerance of the simulations.
const STEP: f64 = 2e-3;
/// Share of a difference by which the halves of it may differ: the second derivative over such a step is far less where there is one.
const BENT: f64 = 0.2;
/// Share of the largest multiplier below which one acts nowhere.
const NOTHING: f64 = 1e-9;
/// Distance from a bound, in units of the size of a variable, at which it is reached.
const AT_BOUND: f64 = 1e-8;

/// Derivatives of the cost to come, with the constraints in it, on the way.
struct Costates {
    /// By the state at the start of every control stage and at the end `[n_stages + 1]`, `[nx]` each.
    states: Vec<Vec<f64>>,
    /// By the parameters `[np]`.
    params: Vec<f64>,
    /// Of constraints between both ends, by the state at the start `[nx]`.
    start: Vec<f64>,
}

impl Costates {
    fn values_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.states.iter_mut().flatten().chain(&mut self.params).chain(&mut self.start)
    }
}

fn missing() -> Error {
    Error::Numeric("the end of a descent has no derivatives".into())
}

/// The gradient of the cost with multiples of the constraints.
fn lagrangian(values: &Values, multipliers: &[f64]) -> Vec<f64> {
    let mut gradient = values.gradient.clone();
    let n = gradient.len();
    for (mu, row) in multipliers.iter().zip(values.jacobian.chunks_exact(n.max(1))).filter(|(mu, _)| **mu != 0.0) {
        gradient.iter_mut().zip(row).for_each(|(g, v)| *g += mu * v);
    }
    gradient
}

/// The gradient of the Lagrange function at the end of a descent: at a kink a combination of those on its sides.
pub(super) fn gradient(program: &mut dyn Program, found: &Lowest) -> Result<Vec<f64>> {
    let mut sum = vec![0.0; found.z.len()];
    for (weight, z) in found.sides() {
        let values = program.values_at(z)?.ok_or_else(missing)?;
        sum.iter_mut().zip(lagrangian(&values, &found.multipliers)).for_each(|(s, g)| *s += weight * g);
    }
    Ok(sum)
}

impl Shooting<'_> {
    /// Is a variable held by a bound, with this gradient?
    fn holds(&self, z: &[f64], j: usize, gradient: &[f64]) -> bool {
        let (lower, upper, size) = self.bounds();
        let at = |b: f64| (z[j] - b).abs() <= AT_BOUND * size[j];
        gradient[j] > 0.0 && at(lower[j]) || gradient[j] < 0.0 && at(upper[j]) || lower[j] == upper[j]
    }

    /// Rows that act, and whether one is at its bound without a multiplier.
    fn active(&self, values: &Values, multipliers: &[f64]) -> (Vec<usize>, bool) {
        let (lower, upper) = self.row_bounds();
        let largest = multipliers.iter().fold(0f64, |m, v| m.max(v.abs()));
        let acts = |i: &usize| lower[*i] == upper[*i] || multipliers[*i].abs() > NOTHING * largest;
        let near = |i: usize| {
            let off = (values.rows[i] - lower[i]).abs().min((upper[i] - values.rows[i]).abs());
            off <= AT_BOUND * values.usual[i]
        };
        let all = || 0..multipliers.len();
        (all().filter(acts).collect(), all().any(|i| !acts(&i) && near(i)))
    }

    /// Costates at the end of a descent: at a kink a combination of those of the motions on its sides.
    fn costates(&mut self, found: &Lowest) -> Result<Costates> {
        let (n, d) = (self.n_stages(), self.extended().system.dims());
        let mut sum = Costates { states: vec![vec![0.0; d.x]; n + 1], params: vec![0.0; d.p], start: vec![0.0; d.x] };
        for (weight, z) in found.sides() {
            let mut side = self.costates_at(z, &found.multipliers)?;
            sum.values_mut().zip(side.values_mut()).for_each(|(a, b)| *a += weight * *b);
        }
        Ok(sum)
    }

    /// Those of one motion: of its stages from the last one on, and of what depends on the state at its end.
    fn costates_at(&mut self, z: &[f64], multipliers: &[f64]) -> Result<Costates> {
        let (values, ends) = self.with_end(z)?.ok_or_else(missing)?;
        let (nx, first) = (self.extended().system.dims().x, self.params_of_block());
        let gradients = Gradients::new(&values.blocks, (1.0, multipliers));
        let mut found = Costates {
            states: gradients.of.iter().map(|g| g[..nx].to_vec()).collect(),
            params: vec![0.0; self.extended().system.dims().p],
            start: gradients.start,
        };
        found.start.resize(nx, 0.0);
        for of in &gradients.of {
            found.params.iter_mut().zip(&of[first..]).for_each(|(a, v)| *a += v);
        }
        let mut end = ends.cost;
        end.resize(nx, 0.0);
        for (row, by) in &ends.rows {
            end.iter_mut().zip(by).for_each(|(a, v)| *a += multipliers[*row] * v);
        }
        found.states.push(end);
        Ok(found)
    }
}

/// The conditions of first order in the variables that no bound holds and the rows that act.
struct Conditions {
    free: Vec<usize>,
    active: Vec<usize>,
    /// Is a row at its bound without a multiplier?
    weak: bool,
    multipliers: Vec<f64>,
    /// What the change of the cost by one variable is compared with.
    unit: f64,
    /// At the end of the descent.
    here: Vec<f64>,
    /// Derivatives of the rows that act by all variables there, row by row.
    slopes: Vec<f64>,
}

impl Conditions {
    fn new(s: &mut Shooting, found: &Lowest) -> Result<Conditions> {
        let values = s.values_at(&found.z)?.ok_or_else(missing)?;
        let gradient = lagrangian(&values, &found.multipliers);
        let free: Vec<usize> = (0..found.z.len()).filter(|&j| !s.holds(&found.z, j, &gradient)).collect();
        let (active, weak) = s.active(&values, &found.multipliers);
        let multipliers = found.multipliers.clone();
        let n = found.z.len();
        let slopes = active.iter().flat_map(|&i| values.jacobian[i * n..(i + 1) * n].to_vec()).collect();
        let mut out = Conditions { free, active, weak, multipliers, unit: found.unit, here: Vec::new(), slopes };
        out.here = out.of(&values);
        Ok(out)
    }

    fn of(&self, values: &Values) -> Vec<f64> {
        let l = lagrangian(values, &self.multipliers);
        self.free.iter().map(|&j| l[j]).chain(self.active.iter().map(|&i| values.rows[i])).collect()
    }

    /// At other variables or data; nothing where there is no motion.
    fn at(&self, s: &mut Shooting, z: &[f64]) -> Result<Option<Vec<f64>>> {
        Ok(s.values_at(z)?.map(|v| self.of(&v)))
    }

    /// Central differences by something of this size. Nothing where a side has no motion, or both say something else, as they do across a kink.
    fn change(&self, size: f64, at: &mut dyn FnMut(f64) -> Result<Option<Vec<f64>>>) -> Result<Option<Vec<f64>>> {
        let h = STEP * size;
        let (Some(right), Some(left)) = (at(h)?, at(-h)?) else { return Ok(None) };
        let (mut bend, mut slope) = (0f64, 0f64);
        for ((r, l), c) in right.iter().zip(&left).zip(&self.here).take(self.free.len()) {
            bend = bend.max((r + l - 2.0 * c).abs());
            slope = slope.max((r - l).abs());
        }
        let known = bend <= BENT * slope.max(STEP * self.unit);
        Ok(known.then(|| right.iter().zip(&left).map(|(r, l)| (r - l) / (2.0 * h)).collect()))
    }

    /// Their derivatives by the variables and multipliers; nothing where there are none.
    fn matrix(&self, s: &mut Shooting, z: &[f64]) -> Result<Option<DMatrix<f64>>> {
        let (n, m) = (self.free.len(), self.active.len());
        let size: Vec<f64> = s.bounds().2.to_vec();
        let mut kkt = DMatrix::<f64>::zeros(n + m, n + m);
        for (c, &j) in self.free.iter().enumerate() {
            let mut moved = z.to_vec();
            let column = self.change(size[j], &mut |h| {
                moved[j] = z[j] + h;
                self.at(s, &moved)
            })?;
            let Some(column) = column else { return Ok(None) };
            (0..n).for_each(|i| kkt[(i, c)] = column[i]);
            for k in 0..m {
                let slope = self.slopes[k * z.len() + j];
                (kkt[(n + k, c)], kkt[(c, n + k)]) = (slope, slope);
            }
        }
        for i in 0..n {
            for j in 0..i {
                let mean = 0.5 * (kkt[(i, j)] + kkt[(j, i)]);
                (kkt[(i, j)], kkt[(j, i)]) = (mean, mean);
            }
        }
        Ok(Some(kkt))
    }
}

impl Ocp {
    /// The end of the last solve by shooting, if it is a solution.
    fn last_simulated(&self) -> Result<&Last> {
        let solved = self.result.as_ref().is_some_and(|r| r.is_exact());
        self.simulated.last.as_deref().filter(|_| solved).ok_or_else(|| {
            Error::State("there is no exact solution to have derivatives: solve the problem first".into())
        })
    }

    /// The problem of the last solve in the variables of descents.
    fn solved_shooting<'a>(&'a self, last: &'a Last) -> Result<Shooting<'a>> {
        let s = last.base.shooting(self, &last.cuts)?;
        if (s.bounds().0.len(), s.row_bounds().0.len()) != (last.lowest.z.len(), last.lowest.multipliers.len()) {
            return Err(Error::State("the problem was changed since its last solution: solve it again".into()));
        }
        Ok(s)
    }

    /// Multipliers of an answer of shooting: those of the rows of its program, whose points are those of the simulation at which they are held.
    pub(in crate::ocp) fn simulated_multipliers(&self, of: MultipliersOf) -> Result<Multipliers> {
        let last = self.last_simulated()?;
        let mut s = self.solved_shooting(last)?;
        let (z, mu) = (&last.lowest.z, &last.lowest.multipliers);
        let d = self.system.dims();
        let r = self.result.as_ref().ok_or_else(missing)?;
        let mut starts = stage_times(self.t0, &r.durations);
        let at_start = |values: Vec<f64>| Multipliers { times: vec![self.t0], values };
        let rows = s.rows();
        let time = |(_, k, share): (RowOf, usize, f64)| starts[k] + share * (starts[k + 1] - starts[k]);
        // those of one constraint, `width` numbers for every point
        let of_rows = |is: RowOf, width: usize| {
            let own: Vec<usize> = (0..rows.len()).filter(|&i| rows[i].0 == is).collect();
            let times = own.iter().step_by(width.max(1)).map(|&i| time(rows[i])).collect();
            Multipliers { times, values: own.iter().map(|&i| mu[i]).collect() }
        };
        let at_end = |m: Multipliers| Multipliers { times: vec![starts[self.n_stages]], ..m };
        Ok(match of {
            MultipliersOf::Costates => {
                let mut found = s.costates(&last.lowest)?;
                found.states[0].iter_mut().zip(&found.start).for_each(|(a, v)| *a += v);
                let values = found.states.concat();
                Multipliers { times: starts, values }
            }
            MultipliersOf::InitialState => {
                let found = s.costates(&last.lowest)?;
                let by = |i: usize| match s.initial_at(i) {
                    Some(_) => 0.0,
                    None => -(found.states[0][i] + found.start[i]),
                };
                at_start((0..d.x).map(by).collect())
            }
            MultipliersOf::States => {
                let mut points: Vec<(usize, f64)> = rows.iter().filter(|r| r.2 > 0.0).map(|r| (r.1, r.2)).collect();
                points.dedup();
                let by = |&(k, share): &(usize, f64)| -> Vec<f64> {
                    let at = |i: usize| rows.iter().position(|r| *r == (RowOf::State(i), k, share));
                    (0..d.x).map(|i| at(i).map_or(0.0, |row| mu[row])).collect()
                };
                let times = points.iter().map(|&(k, share)| time((RowOf::State(0), k, share))).collect();
                Multipliers { times, values: points.iter().flat_map(by).collect() }
            }
            MultipliersOf::Params | MultipliersOf::Controls => {
                let gradient = gradient(&mut s, &last.lowest)?;
                let held = |j: usize| if s.holds(z, j, &gradient) { -gradient[j] } else { 0.0 };
                let held: Vec<f64> = (0..z.len()).map(held).collect();
                if of == MultipliersOf::Params {
                    return Ok(at_start((0..d.p).map(|j| s.param_at(j).map_or(0.0, |at| held[at])).collect()));
                }
                let of = |(k, v): (usize, f64)| if s.is_linear(k % d.u) { 0.0 } else { v };
                let values = s.own_controls(&held).into_iter().enumerate().map(of).collect();
                starts.pop();
                Multipliers { times: starts, values }
            }
            MultipliersOf::Path(k) => of_rows(RowOf::Path(k), self.path[k].f.n_out()),
            MultipliersOf::Terminal(k) => at_end(of_rows(RowOf::Terminal(k), self.terminal[k].f.n_out())),
            MultipliersOf::Boundary(k) => at_end(of_rows(RowOf::Boundary(k), self.boundary[k].f.n_out())),
            MultipliersOf::Relaxed(k) => {
                let (width, before, is_at_end) = self.place_of_relaxed(k);
                let both = match is_at_end {
                    false => of_rows(RowOf::Path(self.path.len() + before), 2 * width),
                    true => at_end(of_rows(RowOf::Terminal(self.terminal.len() + before), 2 * width)),
                };
                // the lower bounds, then the upper ones: of a row at most one is active
                let one = |v: &[f64]| (0..width).map(|i| v[i] + v[i + width]).collect::<Vec<f64>>();
                let values = both.values.chunks_exact(2 * width).flat_map(one).collect();
                Multipliers { values, ..both }
            }
        })
    }

    /// Derivatives of an answer of shooting: of the cost by the costates, of the variables by the theorem of the implicit function at the conditions of
    /// first order, whose derivatives are central differences. These are NaN where they are not known: at kinks, next to them, and for
    /// initial states that leave a constraint.
    pub(in crate::ocp) fn simulated_sensitivity(&self) -> Result<OcpSensitivity> {
        let last = self.last_simulated()?;
        let mut s = self.solved_shooting(last)?;
        let z = &last.lowest.z;
        let d = self.system.dims();
        let found = s.costates(&last.lowest)?;
        let conditions = Conditions::new(&mut s, &last.lowest)?;
        let factor = if last.lowest.kink { None } else { conditions.matrix(&mut s, z)?.map(DMatrix::lu) };
        let mut out = OcpSensitivity {
            cost: Vec::new(),
            controls: Vec::new(),
            variables: Vec::new(),
            one_sided: conditions.weak || last.lowest.kink,
        };
        let discrete = self.system.discrete_states();
        for datum in 0..d.x + d.p {
            let (is_given, cost) = match datum.checked_sub(d.x) {
                None => (
                    s.initial_at(datum).is_none() && !discrete.contains(&datum),
                    found.states[0][datum] + found.start[datum],
                ),
                Some(j) => (s.param_at(j).is_none(), found.params[j]),
            };
            // where bounds hold all variables nothing moves them
            let moves = is_given && !conditions.free.is_empty();
            let mut by = vec![if moves { f64::NAN } else { 0.0 }; z.len()];
            if let Some(lu) = factor.as_ref().filter(|_| moves) {
                let size = s.move_datum(datum, 0.0);
                let change = conditions.change(size, &mut |h| {
                    s.move_datum(datum, h);
                    let found = conditions.at(&mut s, z);
                    s.move_datum(datum, -h);
                    found
                })?;
                if let Some(moved) = change.and_then(|c| lu.solve(&-DVector::from_vec(c))) {
                    by.fill(0.0);
                    conditions.free.iter().zip(moved.iter()).for_each(|(&j, v)| by[j] = *v);
                }
            }
            out.cost.push(if is_given { cost } else { 0.0 });
            out.controls.extend(s.own_controls(&by));
            out.variables.extend(by);
        }
        Ok(out)
    }
}
