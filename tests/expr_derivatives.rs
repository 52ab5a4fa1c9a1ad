//! Derivatives of expressions: exact to rounding, patterns exact.
//!
//! The reference knows nothing of the graph: random programs are evaluated with truncated second-order Taylor numbers
//! over double-double arithmetic (about 31 digits), with elementary functions summed here.

use switchback::expr::{Binary, Block, Dag, ExprFunction, Id, Node, Unary};
use switchback::func::{Dims, Function, Point};

#[path = "common/double.rs"]
mod double;
#[path = "../examples/report/expression_models.rs"]
mod expression_models;
#[path = "common/gallery.rs"]
mod gallery;
#[path = "../examples/report/models.rs"]
mod models;
use double::Dd;

/// Deterministic numbers.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }
    fn below(&mut self, n: usize) -> usize {
        ((self.next() >> 33) % n as u64) as usize
    }
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A step of a random program; operands are earlier values.
#[derive(Debug, Clone, Copy)]
enum Step {
    Input(usize),
    Constant(f64),
    Unary(Unary, usize),
    Binary(Binary, usize, usize),
    PowI(usize, i32),
    /// First component of the solution of `[[3 + a², b], [b, −2]] x = (a, 1)`.
    Solve(usize, usize),
}

/// `f + f_i ε_i + f_j ε_j + f_ij ε_i ε_j`
#[derive(Clone, Copy)]
struct Taylor([Dd; 4]);

impl Taylor {
    fn constant(v: Dd) -> Taylor {
        Taylor([v, Dd::ZERO, Dd::ZERO, Dd::ZERO])
    }
    fn map(self, f: Dd, d: Dd, dd: Dd) -> Taylor {
        let [_, a, b, ab] = self.0;
        Taylor([f, d * a, d * b, dd * a * b + d * ab])
    }
    fn add(self, o: Taylor, s: f64) -> Taylor {
        let s = Dd::from(s);
        Taylor(std::array::from_fn(|k| self.0[k] + s * o.0[k]))
    }
    fn mul(self, o: Taylor) -> Taylor {
        let ([a, b, c, d], [p, q, r, s]) = (self.0, o.0);
        Taylor([a * p, a * q + b * p, a * r + c * p, a * s + b * r + c * q + d * p])
    }
    fn inverse(self) -> Taylor {
        let i = Dd::ONE / self.0[0];
        self.map(i, -(i * i), Dd::from(2.0) * i * i * i)
    }
    fn powi(self, n: i32) -> Taylor {
        let mut out = Taylor::constant(Dd::ONE);
        for _ in 0..n.unsigned_abs() {
            out = out.mul(self);
        }
        if n < 0 {
            out.inverse()
        } else {
            out
        }
    }
    fn binary(self, op: Binary, b: Taylor) -> Taylor {
        let a = self;
        match op {
            Binary::Add => a.add(b, 1.0),
            Binary::Sub => a.add(b, -1.0),
            Binary::Mul => a.mul(b),
            Binary::Div => a.mul(b.inverse()),
            Binary::Pow => b.mul(a.unary(Unary::Log)).unary(Unary::Exp),
            // The angle through the half angle: atan2(y, x) = 2 atan((r − x)/y), or a shifted quotient.
            Binary::Atan2 => {
                let (y, x) = (a, b);
                if x.0[0].hi() > 0.0 {
                    y.mul(x.inverse()).unary(Unary::Atan)
                } else {
                    let q = x.mul(y.inverse()).unary(Unary::Atan);
                    let shift = if y.0[0].hi() > 0.0 { Dd::PI_2 } else { -Dd::PI_2 };
                    Taylor::constant(shift).add(q, -1.0)
                }
            }
        }
    }
    fn unary(self, op: Unary) -> Taylor {
        let a = self.0[0];
        let one = Dd::ONE;
        let two = Dd::from(2.0);
        match op {
            Unary::Neg => Taylor::constant(Dd::ZERO).add(self, -1.0),
            Unary::Sqrt => {
                let s = a.sqrt();
                self.map(s, one / (two * s), -(one / (Dd::from(4.0) * a * s)))
            }
            Unary::Exp => self.map(a.exp(), a.exp(), a.exp()),
            Unary::Log => self.map(a.ln(), one / a, -(one / (a * a))),
            Unary::Sin => self.map(a.sin(), a.cos(), -a.sin()),
            Unary::Cos => self.map(a.cos(), -a.sin(), -a.cos()),
            Unary::Tan => {
                let t = a.sin() / a.cos();
                self.map(t, one + t * t, two * t * (one + t * t))
            }
            Unary::Asin | Unary::Acos => {
                let s = (one - a * a).sqrt();
                let (d, dd) = (one / s, a / (s * s * s));
                let v = (a / s).atan();
                if op == Unary::Asin {
                    self.map(v, d, dd)
                } else {
                    self.map(Dd::PI_2 - v, -d, -dd)
                }
            }
            Unary::Atan => {
                let d = one / (one + a * a);
                self.map(a.atan(), d, -(two * a * d * d))
            }
            Unary::Sinh | Unary::Cosh | Unary::Tanh => {
                let (p, m) = (a.exp(), (-a).exp());
                let half = Dd::from(0.5);
                let (s, c) = (half * (p - m), half * (p + m));
                match op {
                    Unary::Sinh => self.map(s, c, s),
                    Unary::Cosh => self.map(c, s, c),
                    _ => self.map(s / c, one / (c * c), -(two * s / (c * c * c))),
                }
            }
            Unary::Floor => Taylor::constant(Dd::from(a.hi().floor())),
            Unary::Erf => {
                let d = two / Dd::PI.sqrt() * (-(a * a)).exp();
                self.map(a.erf(), d, -(two * a * d))
            }
        }
    }
}

/// A program, with values that keep it well inside every domain.
struct Program {
    steps: Vec<Step>,
    outputs: Vec<usize>,
}

impl Program {
    fn random(r: &mut Random, n_in: usize, n_steps: usize, at: &[f64]) -> Program {
        let mut steps: Vec<Step> = (0..n_in).map(Step::Input).collect();
        let mut values: Vec<f64> = at.to_vec();
        while steps.len() < n_in + n_steps {
            // Recent values as a rule, so that the outputs depend on much of the program.
            let recent = |r: &mut Random, n: usize| n - 1 - r.below(5);
            let (i, j) = (recent(r, steps.len()), r.below(steps.len()));
            let (i, j) = if r.below(2) == 0 { (i, j) } else { (j, i) };
            let (a, b) = (values[i], values[j]);
            let (step, v) = match r.below(12) {
                0 => {
                    let c = (r.uniform(-3.0, 3.0) * 8.0).round() / 8.0;
                    (Step::Constant(c), c)
                }
                1..=4 => {
                    // all but the last one, floor, which has no derivative where it jumps
                    let op = Unary::ALL[r.below(Unary::ALL.len() - 1)];
                    let inside = match op {
                        Unary::Sqrt | Unary::Log => a > 0.2,
                        Unary::Asin | Unary::Acos => a.abs() < 0.9,
                        Unary::Tan => a.cos().abs() > 0.3,
                        _ => a.abs() < 3.0,
                    };
                    if !inside {
                        continue;
                    }
                    (Step::Unary(op, i), op.eval(a))
                }
                5..=9 => {
                    let op = Binary::ALL[r.below(Binary::ALL.len())];
                    let inside = match op {
                        Binary::Div => b.abs() > 0.3,
                        Binary::Pow => a > 0.2 && a < 5.0 && b.abs() < 3.0,
                        Binary::Atan2 => a * a + b * b > 0.1,
                        // No digits are lost that the reference keeps.
                        Binary::Add => i != j && (a + b).abs() > 0.2 * a.abs().max(b.abs()),
                        Binary::Sub => i != j && (a - b).abs() > 0.2 * a.abs().max(b.abs()),
                        Binary::Mul => true,
                    };
                    if !inside {
                        continue;
                    }
                    (Step::Binary(op, i, j), op.eval(a, b))
                }
                10 => {
                    let n = r.below(8) as i32 - 3;
                    if a.abs() < 0.3 || a.abs() > 3.0 {
                        continue;
                    }
                    (Step::PowI(i, n), a.powi(n))
                }
                _ => (Step::Solve(i, j), (-2.0 * a - b) / (-2.0 * (3.0 + a * a) - b * b)),
            };
            if v.is_finite() && v.abs() < 50.0 && v.abs() > 1e-3 {
                steps.push(step);
                values.push(v);
            }
        }
        let n = steps.len();
        let outputs = (0..3).map(|k| n - 1 - k).collect();
        Program { steps, outputs }
    }

    fn build(&self, d: &mut Dag, inputs: &[Id]) -> Vec<Id> {
        let mut v: Vec<Id> = Vec::new();
        for s in &self.steps {
            let id = match *s {
                Step::Input(k) => inputs[k],
                Step::Constant(c) => d.constant(c),
                Step::Unary(op, a) => d.unary(op, v[a]),
                Step::Binary(op, a, b) => d.binary(op, v[a], v[b]),
                Step::PowI(a, n) => d.powi(v[a], n),
                Step::Solve(a, b) => {
                    let [three, two, one] = [3.0, -2.0, 1.0].map(|c| d.constant(c));
                    let square = d.powi(v[a], 2);
                    let corner = d.add(three, square);
                    d.solve(&[corner, v[b], v[b], two], &[v[a], one]).unwrap()[0]
                }
            };
            v.push(id);
        }
        self.outputs.iter().map(|&o| v[o]).collect()
    }

    /// Value and derivatives of the outputs in the directions of inputs `i` and `j`.
    fn reference(&self, at: &[f64], i: usize, j: usize) -> Vec<Taylor> {
        let mut v: Vec<Taylor> = Vec::new();
        for s in &self.steps {
            let t = match *s {
                Step::Input(k) => Taylor([
                    Dd::from(at[k]),
                    Dd::from(f64::from(u8::from(k == i))),
                    Dd::from(f64::from(u8::from(k == j))),
                    Dd::ZERO,
                ]),
                Step::Constant(c) => Taylor::constant(Dd::from(c)),
                Step::Unary(op, a) => v[a].unary(op),
                Step::PowI(a, n) => v[a].powi(n),
                Step::Binary(op, a, b) => v[a].binary(op, v[b]),
                Step::Solve(a, b) => {
                    // Cramer's rule.
                    let (a, b) = (v[a], v[b]);
                    let c = |x: f64| Taylor::constant(Dd::from(x));
                    let corner = c(3.0).add(a.mul(a), 1.0);
                    let det = c(0.0).add(corner, -2.0).add(b.mul(b), -1.0);
                    c(0.0).add(a, -2.0).add(b, -1.0).mul(det.inverse())
                }
            };
            v.push(t);
        }
        self.outputs.iter().map(|&o| v[o]).collect()
    }
}

/// What the comparison saw.
#[derive(Debug, Default)]
struct Seen {
    entries: usize,
    /// Entries that vanish by an identity of the functions, not by structure, as in `asin(cos(x))`.
    identities: usize,
    /// Of these, values of outputs that are the constant zero.
    zero_values: usize,
    /// Entries with cancellation: an error above 1e-13 of the entry.
    cancelled: usize,
    /// Largest error relative to the entry, cancelled ones left out.
    worst: f64,
    /// Largest error relative to the largest entry of the matrix.
    worst_of_matrix: f64,
}

impl Seen {
    fn matrix(&mut self, what: &str, all: &[(Option<f64>, Dd)]) {
        let largest = all.iter().map(|e| e.1.hi().abs()).fold(0.0, f64::max);
        for (k, &(got, exact)) in all.iter().enumerate() {
            // What cancels leaves the rounding of 31 digits.
            let zero = exact.hi().abs() < 1e-26;
            let Some(got) = got else {
                assert!(zero, "{what}: entry {k} is missing: {exact:?}");
                continue;
            };
            self.entries += 1;
            self.identities += usize::from(zero);
            let error = (Dd::from(got) - exact).hi().abs();
            self.worst_of_matrix = self.worst_of_matrix.max(error / largest.max(1e-26));
            let relative = error / exact.hi().abs();
            if relative <= 1e-13 {
                self.worst = self.worst.max(relative);
            } else if !zero {
                self.cancelled += 1;
            }
        }
    }

    /// Value and derivatives of a function at `at` (`x`, `u`, `p`, then `t`), against what `reference` says in the
    /// directions of two inputs.
    fn function(
        &mut self,
        what: &str,
        f: &ExprFunction,
        at: &[f64],
        weights: &[f64],
        reference: impl Fn(usize, usize) -> Vec<Taylor>,
    ) {
        let d = f.dims();
        let n = d.n_in();
        let point = Point { t: at[n - 1], x: &at[..d.x], u: &at[d.x..d.x + d.u], p: &at[d.x + d.u..n - 1] };
        let mut work = vec![f64::NAN; f.work_len()];
        let mut value = vec![0.0; f.n_out()];
        f.value(&point, &mut value, &mut work).unwrap();
        let mut jac = vec![0.0; f.jac_pattern().nnz()];
        f.jacobian(&point, &mut jac, &mut work).unwrap();
        let mut hess = vec![0.0; f.hess_pattern().nnz()];
        f.hessian(&point, weights, &mut hess, &mut work).unwrap();
        let [mut values, mut first, mut second] = [Vec::new(), Vec::new(), Vec::new()];
        for j in 0..n {
            for i in 0..=j {
                let exact = reference(i, j);
                if i == j {
                    for (row, e) in exact.iter().enumerate() {
                        values.push((Some(value[row]), e.0[0]));
                        first.push((f.jac_pattern().get(row, j).map(|k| jac[k]), e.0[2]));
                    }
                }
                let sum = exact.iter().zip(weights).fold(Dd::ZERO, |s, (e, w)| s + Dd::from(*w) * e.0[3]);
                second.push((f.hess_pattern().get(i, j).map(|k| hess[k]), sum));
            }
        }
        self.zero_values += values.iter().filter(|v| v.1.hi() == 0.0).count();
        self.matrix(&format!("{what}, value"), &values);
        self.matrix(&format!("{what}, Jacobian"), &first);
        self.matrix(&format!("{what}, Hessian"), &second);
    }
}

#[test]
fn derivatives_of_200_random_graphs_are_exact_to_rounding() {
    let mut r = Random(0x5eed);
    let dims = Dims { x: 3, u: 1, p: 1 };
    let n = dims.n_in();
    let mut seen = Seen::default();
    for case in 0..200 {
        let at: Vec<f64> = (0..n).map(|_| r.uniform(0.3, 1.8) * if r.below(3) == 0 { -1.0 } else { 1.0 }).collect();
        let p = Program::random(&mut r, n, 12 + case / 8, &at);
        let mut d = Dag::new();
        let mut inputs = d.inputs(Block::X, 3);
        inputs.extend([Block::U, Block::P, Block::T].map(|b| d.input(b, 0)));
        let outputs = p.build(&mut d, &inputs);
        let f = ExprFunction::new("f", &mut d, dims, &outputs).unwrap();
        seen.function(&format!("case {case}"), &f, &at, &[0.7, -1.3, 0.4], |i, j| p.reference(&at, i, j));
    }
    println!("{seen:?}");
    assert!(seen.entries > 5000, "{seen:?}");
    assert!(seen.worst_of_matrix < 1e-13, "{seen:?}");
    assert!(seen.cancelled * 500 < seen.entries && seen.identities * 500 < seen.entries, "{seen:?}");
}

/// Nodes of a graph without linear systems, evaluated like programs.
fn evaluate(dag: &Dag, roots: &[Id], d: Dims, at: &[f64], i: usize, j: usize) -> Vec<Taylor> {
    let mut v: Vec<Taylor> = Vec::with_capacity(dag.len());
    for k in 0..dag.len() {
        let t = match dag.node(dag.id(k).unwrap()) {
            Node::Const(bits) => Taylor::constant(Dd::from(f64::from_bits(bits))),
            Node::Input(block, index) => {
                let first = match block {
                    Block::X => 0,
                    Block::U => d.x,
                    Block::P => d.x + d.u,
                    _ => d.n_in() - 1,
                };
                let k = first + index as usize;
                let direction = |m: usize| Dd::from(f64::from(u8::from(k == m)));
                Taylor([Dd::from(at[k]), direction(i), direction(j), Dd::ZERO])
            }
            Node::Unary(op, a) => v[a.index()].unary(op),
            Node::Binary(op, a, b) => v[a.index()].binary(op, v[b.index()]),
            Node::PowI(a, n) => v[a.index()].powi(n),
            // Arguments of roots that are continued beyond the region of their piece, on their own side: a modulus is its argument
            // there, and what goes on smoothly adds nothing.
            Node::Piecewise(_, 0, a) => match dag.smoothness(dag.id(k).unwrap()) {
                0 => v[a.index()],
                _ => Taylor::constant(Dd::ZERO),
            },
            other => panic!("{other:?} has no reference"),
        };
        v.push(t);
    }
    roots.iter().map(|r| v[r.index()]).collect()
}

#[test]
fn derivatives_of_the_gallery_are_exact_to_rounding_and_patterns_are_exact() {
    use expression_models as e;
    let models = [
        e::oscillator(),
        e::switching('a'),
        e::switching('b'),
        e::switching('c'),
        e::sliding_mode(),
        e::blocks(),
        e::coulomb(),
        e::stick_slip(),
        e::zeno(),
        gallery::turbo_car().1,
        gallery::two_genes().1,
        gallery::relay_feedback().1,
        gallery::tank_cascade().1,
        gallery::motor().1,
    ];
    let mut seen = Seen::default();
    for b in &models {
        for f in &b.functions {
            let d = f.dims();
            let mut dag = Dag::new();
            let roots = f.source().unwrap().restore(&mut dag, &[]).unwrap();
            let at: Vec<f64> = (0..d.n_in()).map(|k| 0.37 + 0.23 * k as f64).collect();
            let weights: Vec<f64> = (0..f.n_out()).map(|k| 0.7 - 0.3 * k as f64).collect();
            let what = format!("{} of {}", f.name(), b.report.name);
            seen.function(&what, f, &at, &weights, |i, j| evaluate(&dag, &roots, d, &at, i, j));
        }
    }
    println!("{seen:?}");
    assert!(seen.entries > 100, "{seen:?}");
    assert!(seen.worst < 1e-13 && seen.cancelled == 0, "{seen:?}");
    // entries of the patterns that are zero at a point of no distinction: the values of modes and switching functions only
    assert!(seen.identities <= seen.zero_values, "{seen:?}");
}
