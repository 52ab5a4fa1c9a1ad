//! The complementarity problem (6.19) at random points: its solutions are those of a plain enumeration, in any units.

use std::sync::Arc;

use switchback::dcs::filippov::{decide_pair, distinct, implicit_step, FilippovProblem, FilippovSolution};
use switchback::dcs::{Dcs, DcsFields};
use switchback::func::{Callback, Dims, Point};
use switchback::linalg::csc::Pattern;
use switchback::system::{Regions, SharedFunction, Subsystem, System};

/// Numbers from a linear congruential generator.
struct Random(u64);

impl Random {
    /// In `[−1, 1)`.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    fn list(&mut self, n: usize) -> Vec<f64> {
        (0..n).map(|_| self.next()).collect()
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next().abs() * n as f64) as usize % n
    }

    /// One of `1e-8`, `1`, `1e8`.
    fn unit(&mut self) -> f64 {
        [1e-8, 1.0, 1e8][self.below(3)]
    }
}

/// A subsystem with constant modes and affine indicator functions, all zero at the point.
#[derive(Clone)]
struct Affine {
    modes: Vec<Vec<f64>>,
    /// Derivatives of the functions with respect to states and time.
    gradients: Vec<Vec<f64>>,
    /// Signs of the switching functions in the modes; none where the functions are indicators.
    signs: Option<Vec<Vec<i8>>>,
}

impl Affine {
    fn new(nx: usize, r: &mut Random) -> Affine {
        let n = 2 + r.below(3);
        let signs = (r.next() > 0.0).then(|| match n {
            2 => vec![vec![1], vec![-1]],
            3 => vec![vec![1, 0], vec![-1, 1], vec![-1, -1]],
            _ => vec![vec![1, 1], vec![1, -1], vec![-1, 1], vec![-1, -1]],
        });
        let n_functions = signs.as_ref().map_or(n, |s| s[0].len());
        Affine {
            modes: (0..n).map(|_| r.list(nx)).collect(),
            gradients: (0..n_functions).map(|_| r.list(nx + 1)).collect(),
            signs,
        }
    }

    /// Mode and gradient of the indicator of every cell; a zero among the signs stands for two cells.
    fn cells(&self) -> Vec<(&[f64], Vec<f64>)> {
        let Some(signs) = &self.signs else {
            return self.modes.iter().zip(&self.gradients).map(|(f, g)| (&f[..], g.clone())).collect();
        };
        let mut out = Vec::new();
        for (f, row) in self.modes.iter().zip(signs) {
            let mut rows = vec![row.clone()];
            while let Some(j) = rows[0].iter().position(|s| *s == 0) {
                let with =
                    |s: i8, row: &Vec<i8>| row.iter().enumerate().map(|(i, r)| if i == j { s } else { *r }).collect();
                rows = rows.iter().flat_map(|r| [with(1, r), with(-1, r)]).collect();
            }
            for row in rows {
                let n = self.gradients[0].len();
                let g = |i: usize| row.iter().zip(&self.gradients).map(|(s, g)| -f64::from(*s) * g[i]).sum();
                out.push((&f[..], (0..n).map(g).collect()));
            }
        }
        out
    }
}

/// A system at a point.
#[derive(Clone)]
struct Case {
    t: f64,
    x: Vec<f64>,
    f0: Vec<f64>,
    subs: Vec<Affine>,
}

fn affine(n_out: usize, nx: usize, origin: Vec<f64>, gradients: Vec<Vec<f64>>) -> SharedFunction {
    let d = Dims { x: nx, u: 0, p: 0 };
    let by_column: Vec<f64> = (0..=nx).flat_map(|i| gradients.iter().map(move |g| g[i]).collect::<Vec<_>>()).collect();
    let value = move |at: &Point, out: &mut [f64]| {
        for (o, g) in out.iter_mut().zip(&gradients) {
            let z = at.x.iter().chain([&at.t]).zip(&origin).map(|(z, z0)| z - z0);
            *o = g.iter().zip(z).map(|(g, z)| g * z).sum();
        }
        0
    };
    let jacobian = move |_: &Point, out: &mut [f64]| {
        out.copy_from_slice(&by_column);
        0
    };
    let f = Callback::new("g", d, n_out, value).with_jacobian(Pattern::dense(n_out, nx + 1), jacobian);
    Arc::new(f.unwrap())
}

fn constant(nx: usize, values: Vec<f64>) -> SharedFunction {
    let (d, n) = (Dims { x: nx, u: 0, p: 0 }, values.len());
    let f = Callback::new("F", d, n, move |_, out| {
        out.copy_from_slice(&values);
        0
    });
    let none = Pattern::new(n, nx + 1, vec![0; nx + 2], vec![]).unwrap();
    Arc::new(f.with_jacobian(none, |_, _| 0).unwrap())
}

impl Case {
    fn new(r: &mut Random) -> Case {
        let (nx, n_sub) = (1 + r.below(4), 1 + r.below(3));
        let subs = (0..n_sub).map(|_| Affine::new(nx, r)).collect();
        Case { t: r.next(), x: r.list(nx), f0: r.list(nx), subs }
    }

    /// The same with time in other units (`a` times the velocities), states `b` times as large, switching functions
    /// too: each by its own factor, the indicators of a subsystem by one.
    fn scaled(&self, a: f64, b: &[f64], mut unit: impl FnMut() -> f64) -> Case {
        let times = |v: &[f64], s: f64| v.iter().zip(b).map(|(v, b)| v * b * s).collect::<Vec<f64>>();
        let subs = self.subs.iter().map(|s| {
            let mut s = s.clone();
            s.modes.iter_mut().for_each(|f| *f = times(f, a));
            let mut c = unit();
            for g in &mut s.gradients {
                if s.signs.is_some() {
                    c = unit();
                }
                g.iter_mut().zip(b).for_each(|(g, b)| *g *= c / b);
                *g.last_mut().unwrap() *= c * a;
            }
            s
        });
        Case { t: self.t / a, x: times(&self.x, 1.0), f0: times(&self.f0, a), subs: subs.collect() }
    }

    /// The fields at the point, before a step of this length.
    fn fields(&self, length: f64) -> DcsFields {
        let nx = self.x.len();
        let mut system = System::new(nx, 0, 0).unwrap();
        system.set_f0(constant(nx, self.f0.clone())).unwrap();
        for s in &self.subs {
            let n = s.gradients.len();
            let origin: Vec<f64> = self.x.iter().chain([&self.t]).copied().collect();
            let functions = affine(n, nx, origin, s.gradients.clone());
            let regions = match &s.signs {
                Some(signs) => Regions::Signs { psi: functions, signs: signs.concat() },
                None => Regions::Indicators(functions),
            };
            let modes = constant(nx, s.modes.concat());
            let n_modes = s.modes.len();
            system.add_subsystem(Subsystem { rows: (0..nx).collect(), modes, n_modes, regions }).unwrap();
        }
        let mut fields = DcsFields::new(&Dcs::stewart(&system).unwrap());
        fields.move_to(&Point { t: self.t, x: &self.x, u: &[], p: &[] }, length).unwrap();
        fields
    }

    fn candidates(&self) -> Vec<Vec<usize>> {
        let mut first = 0;
        let own = |s: &Affine| {
            first += s.cells().len();
            (first - s.cells().len()..first).collect()
        };
        self.subs.iter().map(own).collect()
    }

    fn solve(&self, length: f64) -> (Vec<FilippovSolution>, usize) {
        let mut fields = self.fields(length);
        let problem = FilippovProblem::new(&mut fields, self.t, &self.x, &self.candidates()).unwrap();
        let (found, _) = problem.solutions(&mut fields, length).unwrap();
        let n = distinct(&fields, &self.x, found.clone()).len();
        (found, n)
    }
}

/// Gaussian elimination of the rows `[A b]`: the solution, nothing if a pivot is zero; an error if it nearly is.
fn gauss(mut rows: Vec<Vec<f64>>) -> Result<Option<Vec<f64>>, ()> {
    let n = rows.len();
    for k in 0..n {
        let best = (k..n).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs())).unwrap();
        rows.swap(k, best);
        match rows[k][k].abs() {
            p if p < 1e-11 => return Ok(None),
            p if p < 1e-6 => return Err(()),
            _ => {}
        }
        for i in (0..n).filter(|i| *i != k) {
            let l = rows[i][k] / rows[k][k];
            let pivot = rows[k].clone();
            rows[i].iter_mut().zip(&pivot).for_each(|(v, p)| *v -= l * p);
        }
    }
    Ok(Some((0..n).map(|k| rows[k][n] / rows[k][k]).collect()))
}

/// Sets, weights and velocity.
type Found = (Vec<Vec<usize>>, Vec<f64>, Vec<f64>);

/// All solutions by trying all combinations of active sets; nothing where rounding might decide.
fn enumerate(case: &Case) -> Option<Vec<Found>> {
    let nx = case.x.len();
    let cells: Vec<(usize, &[f64], Vec<f64>)> =
        case.subs.iter().enumerate().flat_map(|(k, s)| s.cells().into_iter().map(move |(f, g)| (k, f, g))).collect();
    let rate = |c: usize, v: &[f64]| cells[c].2.iter().zip(v).map(|(g, v)| g * v).sum::<f64>();
    let n_sub = case.subs.len();
    let mut out = Vec::new();
    for mask in 0..1usize << cells.len() {
        let on: Vec<usize> = (0..cells.len()).filter(|c| mask >> c & 1 == 1).collect();
        if (0..n_sub).any(|k| on.iter().all(|c| cells[*c].0 != k)) {
            continue;
        }
        // unknown weights of the active cells, then ν of every subsystem
        let n = on.len() + n_sub;
        let mut rows = vec![vec![0.0; n + 1]; n];
        for (i, &c) in on.iter().enumerate() {
            for (j, &d) in on.iter().enumerate() {
                rows[i][j] = rate(c, cells[d].1);
            }
            rows[i][on.len() + cells[c].0] = -1.0;
            rows[i][n] = -rate(c, &case.f0) - cells[c].2[nx];
            rows[on.len() + cells[c].0][i] = 1.0;
        }
        (0..n_sub).for_each(|k| rows[on.len() + k][n] = 1.0);
        let Some(z) = gauss(rows).ok()? else { continue };
        let mut velocity = case.f0.clone();
        for (&c, th) in on.iter().zip(&z) {
            velocity.iter_mut().zip(cells[c].1).for_each(|(v, f)| *v += th * f);
        }
        let off = (0..cells.len()).filter(|c| !on.contains(c));
        let rates = off.map(|c| rate(c, &velocity) + cells[c].2[nx] - z[on.len() + cells[c].0]);
        let least = z[..on.len()].iter().copied().chain(rates).fold(f64::INFINITY, f64::min);
        if least.abs() < 1e-6 {
            return None;
        }
        if least > 0.0 {
            let set = |k: usize| on.iter().copied().filter(|c| cells[*c].0 == k).collect();
            out.push(((0..n_sub).map(set).collect(), z[..on.len()].to_vec(), velocity));
        }
    }
    Some(out)
}

fn close(a: &[f64], b: &[f64], unit: &[f64]) -> bool {
    a.len() == b.len() && a.iter().zip(b).zip(unit).all(|((a, b), u)| (a / u - b).abs() < 1e-7 * (1.0 + b.abs()))
}

#[test]
fn random_points_have_the_solutions_of_an_enumeration_in_any_units() {
    let mut r = Random(7);
    let (mut several, mut none, mut sliding, mut doubtful) = (0, 0, 0, 0);
    for i in 0..250 {
        let case = Case::new(&mut r);
        let Some(mut expected) = enumerate(&case) else {
            doubtful += 1;
            continue;
        };
        expected.sort_by(|a, b| a.0.cmp(&b.0));
        none += usize::from(expected.is_empty());
        several += usize::from(expected.len() > 1);
        sliding += usize::from(expected.iter().any(|e| e.0.iter().any(|s| s.len() > 1)));
        let ones = vec![1.0; case.x.len()];
        let mut variants = vec![(1.0, ones.clone(), 1.0)];
        for s in [1e8, 1e-8] {
            variants.extend([(s, ones.clone(), 1.0), (1.0, ones.clone(), s), (1.0, vec![s; ones.len()], 1.0)]);
        }
        // and every state and switching function in units of its own
        variants.push((r.unit(), ones.iter().map(|_| r.unit()).collect(), 0.0));
        for (v, (a, b, c)) in variants.into_iter().enumerate() {
            let scaled = case.scaled(a, &b, || if c > 0.0 { c } else { r.unit() });
            let (mut found, n_distinct) = scaled.solve(1.0 / a);
            let sizes: Vec<usize> = found.iter().map(|s| s.sets.concat().len()).collect();
            assert!(sizes.is_sorted(), "case {i}.{v}: {sizes:?}");
            assert_eq!(n_distinct, found.len(), "case {i}.{v}: {found:?}");
            found.sort_by(|a, b| a.sets.cmp(&b.sets));
            let sets: Vec<_> = found.iter().map(|s| &s.sets).collect();
            assert_eq!(sets, expected.iter().map(|e| &e.0).collect::<Vec<_>>(), "case {i}.{v}");
            let speed: Vec<f64> = b.iter().map(|b| a * b).collect();
            for (s, (_, theta, velocity)) in found.iter().zip(&expected) {
                let weights = s.theta.concat();
                assert!(close(&weights, theta, &vec![1.0; theta.len()]), "case {i}.{v}: {s:?}, expected {theta:?}");
                assert!(close(&s.velocity, velocity, &speed), "case {i}.{v}: {s:?}, expected {velocity:?}");
            }
        }
    }
    assert!(several > 20 && sliding > 40 && doubtful < 25, "{several} {none} {sliding} {doubtful}");
}

/// The common case is decided without the search, and all are candidates of a point where all functions are zero.
#[test]
fn shortcuts_agree_with_the_search() {
    let mut r = Random(11);
    let mut decided = 0;
    for i in 0..400 {
        let case = Case::new(&mut r);
        let mut fields = case.fields(1.0);
        let all = case.candidates();
        assert_eq!(fields.near(1e-8), all, "case {i}");
        let (found, _) = case.solve(1.0);
        if found.iter().all(|s| s.margin > 1e-6) {
            // all indicators are zero, so a step of any length has the active set of the point
            let step = implicit_step(&mut fields, case.t, &case.x, &all, 0.1).unwrap();
            assert_eq!(step.map(|s| s.sets), found.first().map(|s| s.sets.clone()), "case {i}");
        }
        let k = r.below(all.len());
        let mut candidates: Vec<Vec<usize>> = all.iter().map(|c| vec![c[r.below(c.len())]]).collect();
        let first = r.below(all[k].len() - 1);
        candidates[k] = all[k][first..first + 2].to_vec();
        let (mut fa, mut fb, mut set) = (vec![0.0; case.x.len()], vec![0.0; case.x.len()], Vec::new());
        let room = (&mut fa[..], &mut fb[..]);
        let quick = decide_pair(&mut fields, case.t, &case.x, &candidates, room, &mut set).unwrap();
        let problem = FilippovProblem::new(&mut fields, case.t, &case.x, &candidates).unwrap();
        let (found, _) = problem.solutions(&mut fields, 1.0).unwrap();
        if let Some(q) = quick {
            decided += 1;
            assert_eq!((q, found.len()), (k, 1), "case {i}: {found:?}");
            assert_eq!(found[0].sets[k], set, "case {i}");
        }
    }
    assert!(decided > 150, "{decided}");
}

/// `ẋ = v, v̇ = push`, and the modes are the same on both sides of `x = 0`: at the origin `x` has no rate, the sign of
/// `push` decides.
#[test]
fn the_second_order_decides_where_the_first_does_not() {
    let d = Dims { x: 2, u: 0, p: 0 };
    for scale in [1.0, 1e8, 1e-8] {
        for push in [scale, -scale] {
            let modes = Callback::new("F", d, 4, move |at, out| {
                out.copy_from_slice(&[at.x[1], push, at.x[1], push]);
                0
            });
            let psi = affine(1, 2, vec![0.0; 3], vec![vec![1.0, 0.0, 0.0]]);
            let regions = Regions::Signs { psi, signs: vec![1, -1] };
            let mut s = System::new(2, 0, 0).unwrap();
            s.add_subsystem(Subsystem { rows: vec![0, 1], modes: Arc::new(modes), n_modes: 2, regions }).unwrap();
            let mut fields = DcsFields::new(&Dcs::stewart(&s).unwrap());
            fields.move_to(&Point { t: 0.0, x: &[0.0, 0.0], u: &[], p: &[] }, 1.0).unwrap();
            let problem = FilippovProblem::new(&mut fields, 0.0, &[0.0, 0.0], &[vec![0, 1]]).unwrap();
            let (found, asked) = problem.solutions(&mut fields, 1.0).unwrap();
            assert_eq!((found.len(), asked), (1, 2), "{push}: {found:?}");
            assert_eq!(found[0].sets, [[usize::from(push < 0.0)]], "{push}");
        }
    }
}

/// Subsystems that do not influence each other have too many combinations together, and few one by one.
#[test]
fn many_independent_subsystems_are_solved_one_by_one() {
    let n = 14;
    let gradient = |k: usize| (0..=n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
    let sub = |k: usize| {
        let f = |v: f64| (0..n).map(|i| if i == k { v } else { 0.0 }).collect::<Vec<f64>>();
        Affine { modes: vec![f(-1.0), f(3.0)], gradients: vec![gradient(k)], signs: Some(vec![vec![1], vec![-1]]) }
    };
    let case = Case { t: 0.0, x: vec![0.0; n], f0: vec![0.0; n], subs: (0..n).map(sub).collect() };
    let (found, _) = case.solve(1.0);
    assert_eq!(found.len(), 1);
    assert!(found[0].theta.iter().all(|th| close(th, &[0.75, 0.25], &[1.0, 1.0])), "{:?}", found[0]);
}
