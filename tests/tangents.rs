//! Derivatives of solutions against analytic ones and differences of solutions.

use std::sync::Arc;

use switchback::error::Error;
use switchback::expr::{Expr, Graph};
use switchback::func::{Dims, Function};
use switchback::mpcc::{Change, Lifted, Member, MpccSettings, MpccSolver, Polish, Tangent};
use switchback::nlp::{Bounds, CallbackNlp, Control};

const INF: f64 = f64::INFINITY;

/// Objective, then rows.
type Formulas = for<'g> fn(&[Expr<'g>]) -> Vec<Expr<'g>>;

/// A program with pairs of variables.
struct Case {
    formulas: Formulas,
    x: Vec<(f64, f64)>,
    c: Vec<(f64, f64)>,
    pairs: &'static [(usize, usize)],
    start: Vec<f64>,
}

type Found = (Vec<f64>, f64, Result<Vec<Tangent>, Error>);

impl Case {
    fn bounds(&self) -> Bounds {
        let split = |v: &[(f64, f64)]| -> (Vec<f64>, Vec<f64>) { v.iter().copied().unzip() };
        let ((xl, xu), (cl, cu)) = (split(&self.x), split(&self.c));
        Bounds { xl, xu, cl, cu }
    }

    /// Point and objective under `bounds`, and the derivatives there.
    fn solve(&self, bounds: &Bounds, changes: &[Change]) -> Found {
        let g = Graph::new();
        let n = self.x.len();
        let x: Vec<Expr> = (0..n).map(|i| g.x(i)).collect();
        let all = (self.formulas)(&x);
        let d = Dims { x: n, u: 0, p: 0 };
        let f: Arc<dyn Function> = Arc::new(g.function("f", d, &all[..1]).unwrap());
        let c: Arc<dyn Function> = Arc::new(g.function("c", d, &all[1..]).unwrap());
        let nlp = CallbackNlp::new(n, 0, f, (all.len() > 1).then_some(c)).unwrap();
        let members: Vec<_> = self.pairs.iter().map(|&(a, b)| (Member::Variable(a), Member::Variable(b))).collect();
        let mut p = Lifted::new(nlp, &members).unwrap();
        let b = p.bounds(bounds).unwrap();
        let start = p.start(&self.start);
        let mut solver = MpccSolver::new(&mut p, MpccSettings::default()).unwrap();
        let s = solver.solve(&mut p, &b, &start, &mut Control::default());
        assert_eq!(s.polish, Polish::Done, "{:?}", s.outcome);
        let (x, f) = (s.x.clone(), s.objective);
        let tangents = solver.tangents(&mut p, &b, changes);
        (x, f, tangents)
    }

    /// Compares the derivative along `change` with central differences under bounds moved by `shift`.
    fn check(&self, change: Change, shift: impl Fn(f64, &mut Bounds)) {
        let h = 1e-4;
        let at = |h: f64| {
            let mut b = self.bounds();
            shift(h, &mut b);
            self.solve(&b, &[])
        };
        let (right, left) = (at(h), at(-h));
        let (_, _, tangents) = self.solve(&self.bounds(), &[change]);
        let t = &tangents.unwrap()[0];
        assert!(!t.one_sided);
        for (j, d) in t.x.iter().enumerate() {
            let difference = (right.0[j] - left.0[j]) / (2.0 * h);
            // truncation h² and the tolerance of the solutions over h
            assert!((d - difference).abs() <= 1e-6 * (1.0 + d.abs()), "x[{j}]: {d}, differences {difference}");
        }
        let difference = (right.1 - left.1) / (2.0 * h);
        assert!((t.objective - difference).abs() <= 1e-6 * (1.0 + difference.abs()), "{} {difference}", t.objective);
    }
}

fn hock_schittkowski_71() -> Case {
    Case {
        formulas: |x| {
            let squares = x.iter().fold(0.0 * x[0], |s, v| s + *v * *v);
            vec![x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2], x[0] * x[1] * x[2] * x[3], squares]
        },
        x: vec![(1.0, 5.0); 4],
        c: vec![(25.0, INF), (40.0, 40.0)],
        pairs: &[],
        start: vec![1.0, 5.0, 5.0, 1.0],
    }
}

#[test]
fn bounds_of_rows_and_values_of_variables_move_the_solution() {
    let p = hock_schittkowski_71();
    p.check(Change { rows: vec![(0, -1.0)], ..Change::default() }, |h, b| b.cl[0] += h);
    p.check(Change { rows: vec![(1, -1.0)], ..Change::default() }, |h, b| {
        b.cl[1] += h;
        b.cu[1] += h;
    });
    let fixed = Case { x: vec![(1.0, 1.0), (1.0, 5.0), (1.0, 5.0), (1.0, 5.0)], ..p };
    fixed.check(Change { fixed: vec![(0, 1.0)], ..Change::default() }, |h, b| {
        b.xl[0] += h;
        b.xu[0] += h;
    });
}

/// `min (a − q)² + (b − 1)² + sin(a q) / 10 + c²,  a b = 0,  c ≥ a²`, large rows to have them scaled.
fn switched(q: f64) -> Case {
    Case {
        formulas: |x| {
            let [a, b, q, c] = [x[0], x[1], x[2], x[3]];
            let f = (a - q).powi(2) + (b - 1.0).powi(2) + (a * q).sin() * 0.1 + c * c * 0.2;
            vec![f, 1e4 * (c - a * a)]
        },
        x: vec![(0.0, INF), (0.0, INF), (q, q), (-INF, INF)],
        c: vec![(0.0, INF)],
        pairs: &[(0, 1)],
        start: vec![1.0, 0.2, q, 1.0],
    }
}

#[test]
fn programs_with_pairs_follow_on_their_branch() {
    switched(2.0).check(Change { fixed: vec![(2, 1.0)], ..Change::default() }, |h, b| {
        b.xl[2] += h;
        b.xu[2] += h;
    });
    switched(2.0).check(Change { rows: vec![(0, -1.0)], ..Change::default() }, |h, b| b.cl[0] += h);
}

#[test]
fn shifted_gradients_are_perturbations_of_the_objective() {
    // f + ε x_1 on the quadratic ½ (x_0² + 4 x_1²) + x_0 x_1: dx = −H⁻¹ e_1
    let quadratic = Case {
        formulas: |x| vec![0.5 * (x[0] * x[0] + 4.0 * x[1] * x[1]) + x[0] * x[1]],
        x: vec![(-INF, INF); 2],
        c: vec![],
        pairs: &[],
        start: vec![1.0, 1.0],
    };
    let (_, _, t) = quadratic.solve(&quadratic.bounds(), &[Change { gradient: vec![(1, 1.0)], ..Change::default() }]);
    let t = t.unwrap();
    assert!((t[0].x[0] - 1.0 / 3.0).abs() < 1e-12 && (t[0].x[1] + 1.0 / 3.0).abs() < 1e-12, "{t:?}");
}

#[test]
fn weakly_active_pairs_are_reported() {
    let kink = |q: f64| Case {
        formulas: |x| vec![(x[0] - x[2]).powi(2) + (x[1] + 1.0).powi(2)],
        x: vec![(0.0, INF), (0.0, INF), (q, q)],
        c: vec![],
        pairs: &[(0, 1)],
        start: vec![0.5, 0.5, q],
    };
    let one_sided = |q: f64| {
        let p = kink(q);
        let change = Change { fixed: vec![(2, 1.0)], ..Change::default() };
        p.solve(&p.bounds(), &[change]).2.unwrap()[0].one_sided
    };
    // a = max(q, 0): smooth away from q = 0 only
    assert_eq!([0.0, 0.5, -0.5].map(one_sided), [true, false, false]);
}

#[test]
fn changes_that_make_no_sense_and_solutions_without_a_derivative_are_refused() {
    let p = switched(2.0);
    let refused = |change: Change| p.solve(&p.bounds(), &[change]).2.unwrap_err();
    assert!(matches!(refused(Change { fixed: vec![(0, 1.0)], ..Change::default() }), Error::Range(_)));
    assert!(matches!(refused(Change { rows: vec![(7, 1.0)], ..Change::default() }), Error::Range(_)));
    assert!(matches!(refused(Change { gradient: vec![(0, f64::NAN)], ..Change::default() }), Error::Range(_)));
    // every point of a line is a minimiser
    let flat = Case {
        formulas: |x| vec![(x[0] + x[1] - 1.0).powi(2)],
        x: vec![(-INF, INF); 2],
        c: vec![],
        pairs: &[],
        start: vec![0.0, 0.0],
    };
    let change = Change { gradient: vec![(0, 1.0)], ..Change::default() };
    assert!(matches!(flat.solve(&flat.bounds(), &[change]).2, Err(Error::Numeric(_))));
}
