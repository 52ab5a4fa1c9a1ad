//! Variables and rows of the discretised problem, numbered in the order of time.

use super::eta::Shape;
use super::inside::Inside;
use crate::dcs::{Across, Dcs, Form};
use crate::error::{Error, Result};
use crate::settings::{Cross, Discretisation, Settings, StageForm, StepEquilibration};
use crate::system::SharedFunction;
use crate::tableau::{Family, Tableau};

/// Choices of the discretisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// Runge-Kutta family.
    pub family: Family,
    /// Stages of the method.
    pub n_s: usize,
    /// Switch detection, or fixed steps.
    pub discretisation: Discretisation,
    /// Unknowns at the stage points.
    pub stage_form: StageForm,
    /// Granularity of the cross complementarity.
    pub cross: Cross,
    /// Step equilibration during the homotopy.
    pub equilibration: StepEquilibration,
    /// Weight of the soft forms.
    pub rho_h: f64,
    /// Step sizes lie in `[(1 − γ) h̄, (1 + γ) h̄]` (7.50).
    pub gamma_h: f64,
}

impl Options {
    /// Reads the options out of the settings.
    pub fn from_settings(s: &Settings) -> Result<Options> {
        s.validate()?;
        let family = match s.rk_family()? {
            crate::settings::RkFamily::RadauIia => Family::RadauIia,
            crate::settings::RkFamily::GaussLegendre => Family::GaussLegendre,
            crate::settings::RkFamily::Explicit => Family::Explicit,
            crate::settings::RkFamily::RadauIa => Family::RadauIa,
            crate::settings::RkFamily::LobattoIiia => Family::LobattoIiia,
            crate::settings::RkFamily::LobattoIiib => Family::LobattoIiib,
            crate::settings::RkFamily::LobattoIiic => Family::LobattoIiic,
        };
        Ok(Options {
            family,
            n_s: s.n_s as usize,
            discretisation: s.discretisation()?,
            stage_form: s.stage_form()?,
            cross: s.cross()?,
            equilibration: s.step_equilibration()?,
            rho_h: s.rho_h,
            gamma_h: s.gamma_h,
        })
    }
}

/// Where path constraints hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum PathAt {
    /// At both ends of every control stage, with the control of that stage.
    ControlGrid,
    /// At the start of every control stage and the end of every element.
    Elements,
    /// At the start of every control stage and at every stage point.
    StagePoints,
}

impl PathAt {
    /// Number of points on a horizon without the starts of stages.
    pub(super) fn n_ends(self, n_fe: &[usize], n_s: usize) -> usize {
        match self {
            PathAt::ControlGrid => n_fe.len(),
            _ => self.n_points(n_fe, n_s) - n_fe.len(),
        }
    }

    /// Number of points on a horizon.
    pub(super) fn n_points(self, n_fe: &[usize], n_s: usize) -> usize {
        let per_stage = |n: usize| match self {
            PathAt::ControlGrid => 2,
            PathAt::Elements => n + 1,
            PathAt::StagePoints => n * n_s + 1,
        };
        n_fe.iter().map(|&n| per_stage(n)).sum()
    }
}

/// `lower ≤ c(x, u, p, t) ≤ upper` along the horizon.
#[derive(Clone)]
pub struct PathConstraint {
    /// The function.
    pub f: SharedFunction,
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds.
    pub upper: Vec<f64>,
    /// Where.
    pub at: PathAt,
}

/// `0 ≤ a(x, u, p, t) ⊥ b(x, u, p, t) ≥ 0` along the horizon, component by component.
#[derive(Clone)]
pub struct PathPairs {
    /// The outputs of `a`, then those of `b`.
    pub f: SharedFunction,
    /// Where: at the end of every control stage, at the end of every element, or at every stage point. Not at the starts
    /// of stages, where a function of states alone would say twice what the end before says.
    pub at: PathAt,
}

/// `lower ≤ c(x(T), p) ≤ upper`.
#[derive(Clone)]
pub struct Terminal {
    /// The function; its control is that of the last stage.
    pub f: SharedFunction,
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds.
    pub upper: Vec<f64>,
}

/// `lower ≤ c([x(0); x(T)], u, p, t) ≤ upper`: the function sees twice as many states as the system has, and control and
/// time at the end.
#[derive(Clone)]
pub struct Boundary {
    /// The function.
    pub f: SharedFunction,
    /// Lower bounds.
    pub lower: Vec<f64>,
    /// Upper bounds.
    pub upper: Vec<f64>,
}

/// Lengths of the control stages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum Durations {
    /// Given.
    #[default]
    Fixed,
    /// One variable, the length of the horizon; the stages keep their shares of it.
    Horizon,
    /// One variable for every stage.
    Stages,
}

/// What is discretised.
#[derive(Clone)]
pub struct Spec {
    /// The dynamics.
    pub dcs: Dcs,
    /// Choices of the discretisation.
    pub options: Options,
    /// Finite elements of every control stage.
    pub n_fe: Vec<usize>,
    /// Lengths of the stages.
    pub durations: Durations,
    /// Controls that are continuous and linear on every stage `[nu]`, or empty: all are constant. Such a control is a
    /// state whose derivative takes its place among the controls.
    pub linear: Vec<bool>,
    /// Parameters that are variables of the problem `[np]`, or empty: none is.
    pub free_params: Vec<bool>,
    /// May the stages have parameters of their own?
    pub stage_params: bool,
    /// Cost rate.
    pub lagrange: Option<SharedFunction>,
    /// Terminal cost.
    pub mayer: Option<SharedFunction>,
    /// Cost at the end of every control stage.
    pub grid_cost: Option<SharedFunction>,
    /// Path constraints.
    pub path: Vec<PathConstraint>,
    /// Terminal constraints.
    pub terminal: Vec<Terminal>,
    /// Constraints between the two ends of the horizon.
    pub boundary: Vec<Boundary>,
    /// Complementarity conditions along the horizon.
    pub complementarity: Vec<PathPairs>,
    /// Points inside of elements at which path constraints hold too.
    pub inside: Vec<Inside>,
}

impl Spec {
    /// Dynamics on stages of `n_fe[k]` elements, without costs and constraints.
    pub fn new(dcs: Dcs, options: Options, n_fe: Vec<usize>) -> Spec {
        Spec {
            dcs,
            options,
            n_fe,
            durations: Durations::Fixed,
            linear: Vec::new(),
            free_params: Vec::new(),
            stage_params: false,
            lagrange: None,
            mayer: None,
            grid_cost: None,
            path: Vec::new(),
            terminal: Vec::new(),
            boundary: Vec::new(),
            complementarity: Vec::new(),
            inside: Vec::new(),
        }
    }

    /// Number of control stages.
    pub fn n_stages(&self) -> usize {
        self.n_fe.len()
    }

    fn check(&self) -> Result<()> {
        let d = self.dcs.dims();
        if self.n_fe.is_empty() || self.n_fe.contains(&0) {
            return Err(Error::Dimension("at least one control stage and one finite element are needed".into()));
        }
        for (what, given, n) in
            [("linear controls", self.linear.len(), d.u), ("free parameters", self.free_params.len(), d.p)]
        {
            if given != 0 && given != n {
                return Err(Error::Dimension(format!("{given} entries for the {what}, expected {n}")));
            }
        }
        if let Some(c) = self.complementarity.iter().find(|c| c.f.n_out() % 2 != 0) {
            return Err(Error::Dimension(format!(
                "function '{}' has {} outputs: those of one side of pairs, then those of the other",
                c.f.name(),
                c.f.n_out()
            )));
        }
        for b in &self.boundary {
            let (x, u, p) = (b.f.dims().x, b.f.dims().u, b.f.dims().p);
            if (x, u, p) != (2 * d.x, d.u, d.p) {
                return Err(Error::Dimension(format!(
                    "function '{}' of both ends takes (x, u, p) of sizes ({x}, {u}, {p}), expected ({}, {}, {})",
                    b.f.name(),
                    2 * d.x,
                    d.u,
                    d.p
                )));
            }
        }
        Ok(())
    }
}

/// Multipliers at the start of a control stage.
#[derive(Debug, Clone)]
pub(super) struct StartIndex {
    /// The first element of the stage.
    pub element: usize,
    pub lambda: usize,
    pub mu: usize,
    /// Which equations of the form hold there, and the first row of theirs.
    pub rows: Vec<usize>,
    pub row: usize,
    /// All of them: otherwise only some of the multipliers are there, and the others are zero.
    pub whole: bool,
}

impl StartIndex {
    /// The cells and the `μ` that are there, each once.
    pub fn members(&self, form: &Form) -> [Vec<usize>; 2] {
        let of = |k: &usize| &form.rows[*k];
        let mut out = [
            self.rows.iter().flat_map(|k| of(k).lambda.iter().map(|l| l.0)).collect::<Vec<_>>(),
            self.rows.iter().filter_map(|k| of(k).mu).collect(),
        ];
        out.iter_mut().for_each(|list| {
            list.sort_unstable();
            list.dedup();
        });
        out
    }
}

/// Variables and rows of one finite element. Blocks are given by their first index.
#[derive(Debug, Clone, Default)]
pub(super) struct ElementIndex {
    pub stage: usize,
    pub n: usize,
    pub h: Option<usize>,
    pub u: usize,
    pub x_start: usize,
    pub x_end: usize,
    /// Per stage point.
    pub v: Vec<usize>,
    pub x: Vec<usize>,
    pub theta: Vec<usize>,
    pub lambda: Vec<usize>,
    pub mu: Vec<usize>,
    /// Boundary multipliers: before the first stage point, those at the end of the element before or of the initial state, and those
    /// of the stage's own, see [`Across`]; and after the last stage point where that is no boundary.
    pub lambda_start: Option<usize>,
    pub lambda_own: Option<usize>,
    pub lambda_end: Option<usize>,
    pub mu_end: usize,
    pub sum_theta: usize,
    pub sum_lambda: usize,
    pub row_dyn: Vec<usize>,
    pub row_conv: Vec<usize>,
    pub row_alg: Vec<usize>,
    pub row_norm: Vec<usize>,
    /// Weights that are products.
    pub row_prod: Vec<usize>,
    pub row_end: Option<usize>,
    pub row_end_alg: usize,
    pub row_sum_theta: Option<usize>,
    pub row_sum_lambda: Option<usize>,
    /// `h_n − h_{n−1}`, free until the polish.
    pub row_equal: Option<usize>,
    /// `h − T_k / n_fe` where nothing moves the elements but the length of the stage.
    pub row_tied: Option<usize>,
    /// Two rows: `h − (1 ∓ γ) T_k / n_fe`, where `T_k` is a variable.
    pub row_range: Option<usize>,
    /// `η (h_n − h_{n−1})`, where that is an equation; free in the polish.
    pub row_eta: Option<usize>,
    /// `θ` at the first stage point less the polynomial through those at the others, where nothing else determines it;
    /// free until the polish.
    pub row_first: Option<usize>,
    /// The polynomial through `θ` at the end, where no stage point that counts is there; free until the polish.
    pub row_last: Option<usize>,
    /// Slopes of `λ` at the start, for modes that leave there; free until the polish.
    pub row_slope: Option<usize>,
}

/// The numbering.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub nx: usize,
    pub nu: usize,
    /// Algebraic states.
    pub z: std::ops::Range<usize>,
    /// Cells, and all weights: cells, then products.
    pub n_cells: usize,
    /// How the multipliers of every cell go on from one control stage to the next.
    pub across: Vec<Across>,
    /// Of every simplex: whether its weights may jump there.
    pub weights_jump: Vec<bool>,
    pub n_weights: usize,
    pub n_mu: usize,
    pub n: usize,
    pub m: usize,
    pub x0: usize,
    /// Multipliers at the start of control stages that do not follow from those at the end of the stage before.
    pub starts: Vec<StartIndex>,
    /// Residuals of the algebraic equations at `x0`, where they determine the algebraic states there.
    pub row_z0: Option<usize>,
    /// Per stage: controls, or their rates where they are linear.
    pub u: Vec<usize>,
    /// Index among the states of every control that is one.
    pub linear: Vec<Option<usize>>,
    /// Variables that are parameters.
    pub params: Vec<Option<usize>>,
    /// Per stage: the variable behind its length. It has the length of the stage, or of the horizon.
    pub time: Vec<Option<usize>>,
    pub elements: Vec<ElementIndex>,
    /// First element of every stage, and one more.
    pub first: Vec<usize>,
    /// Rows `Σ h = T` per control stage.
    pub row_time: Vec<usize>,
    pub row_path: Vec<usize>,
    pub row_terminal: Vec<usize>,
    pub row_boundary: Vec<usize>,
    /// Of every point of a path complementarity: the members, those of one side and then those of the other, and rows
    /// that tie them to the function.
    pub members: Vec<usize>,
    pub row_members: Vec<usize>,
    pub pairs: Vec<(usize, usize)>,
    pub groups: Vec<usize>,
    pub n_groups: usize,
    pub values_form: bool,
    pub fesd: bool,
    /// Lifted sums exist.
    pub sums: bool,
    /// The shape of the terms with `η`, where there are any.
    pub eta: Option<Shape>,
}

/// Does `θ` at the end of an element follow from the stage points of a method that starts with one?
fn ends_by_extrapolation(t: &Tableau) -> bool {
    t.family != Family::Explicit && t.n_s > 1 && t.c[0] == 0.0 && !t.stiffly_accurate()
}

#[derive(Default)]
struct Counter(usize);

impl Counter {
    fn take(&mut self, k: usize) -> usize {
        self.0 += k;
        self.0 - k
    }
}

impl Layout {
    pub fn new(spec: &Spec, tableau: &Tableau) -> Result<Layout> {
        let o = &spec.options;
        spec.check()?;
        let values_form = match o.stage_form {
            StageForm::Auto => tableau.a_inv.is_some(),
            StageForm::Derivatives => false,
            StageForm::Values if tableau.a_inv.is_some() => true,
            StageForm::Values => {
                return Err(Error::Unsupported(
                    "stage values as unknowns need an invertible Butcher matrix: use stage_form 'derivatives' \
                     with explicit methods"
                        .into(),
                ))
            }
        };
        let d = spec.dcs.dims();
        let nu = d.u;
        let mut nx = spec.dcs.nx();
        let linear: Vec<Option<usize>> = (0..nu)
            .map(|j| {
                let is = spec.linear.get(j).copied().unwrap_or(false);
                nx += usize::from(is);
                is.then(|| nx - 1)
            })
            .collect();
        let form = spec.dcs.form();
        let (n_cells, n_weights, n_mu) = (form.n_cells, form.n_weights(), form.n_mu);
        let (n_rows, n_norm, n_prod) = (form.rows.len(), form.simplices.len(), form.products.len());
        let z = d.x - spec.dcs.n_algebraic()..d.x;
        // a model that does not switch is plain collocation on a fixed grid
        let fesd = o.discretisation == Discretisation::Fesd && n_cells > 0;
        let needs_end = !tableau.stiffly_accurate();
        if needs_end && !z.is_empty() && tableau.a_inv.is_none() {
            return Err(Error::Unsupported(
                "algebraic equations need a method with an invertible matrix, or with its last stage at the end of the \
                 element: use rk_family 'radau_iia'"
                    .into(),
            ));
        }
        let n_s = tableau.n_s;
        let eta = match o.equilibration {
            StepEquilibration::EtaProduct => Some(Shape::Product),
            StepEquilibration::EtaSquared => Some(Shape::Squared),
            StepEquilibration::EtaSaturated => Some(Shape::Saturated),
            StepEquilibration::EtaEquation => Some(Shape::Equation),
            _ => None,
        };
        let eta = eta.filter(|_| fesd);
        let sums = fesd && (matches!(o.cross, Cross::Element | Cross::Point) || eta.is_some());
        let (mut var, mut row) = (Counter::default(), Counter::default());
        let params: Vec<Option<usize>> =
            (0..d.p).map(|j| spec.free_params.get(j).copied().unwrap_or(false).then(|| var.take(1))).collect();
        let horizon = (spec.durations == Durations::Horizon).then(|| var.take(1));
        let x0 = var.take(nx);
        let across = form.across(&spec.linear, spec.stage_params);
        let mut starts = Vec::new();
        if fesd {
            let all = StartIndex { element: 0, lambda: 0, mu: 0, rows: (0..n_rows).collect(), row: 0, whole: true };
            starts.push(StartIndex { lambda: var.take(n_cells), mu: var.take(n_mu), row: row.take(n_rows), ..all });
        }
        let own = |k: &usize| form.rows[*k].lambda.iter().any(|&(c, _)| across[c] == Across::Own);
        let own: Vec<usize> = (0..n_rows).filter(own).collect();
        let row_z0 = spec.dcs.determines_algebraic().then(|| row.take(z.len()));
        let (mut x_prev, mut lambda_prev) = (x0, starts.first().map(|s| s.lambda));
        let mut l = Layout {
            nx,
            nu,
            z,
            n_cells,
            across,
            weights_jump: spec.dcs.weights_jump(&spec.linear, spec.stage_params),
            n_weights,
            n_mu,
            n: 0,
            m: 0,
            x0,
            starts,
            row_z0,
            u: Vec::new(),
            linear,
            params,
            time: Vec::new(),
            elements: Vec::new(),
            first: vec![0],
            row_time: Vec::new(),
            row_path: Vec::new(),
            row_terminal: Vec::new(),
            row_boundary: Vec::new(),
            members: Vec::new(),
            row_members: Vec::new(),
            pairs: Vec::new(),
            groups: Vec::new(),
            n_groups: 0,
            values_form,
            fesd,
            sums,
            eta,
        };
        for (k, &n_fe) in spec.n_fe.iter().enumerate() {
            let u = var.take(nu);
            l.u.push(u);
            let time = if spec.durations == Durations::Stages { Some(var.take(1)) } else { horizon };
            l.time.push(time);
            let element = l.elements.len();
            if fesd && k > 0 && !own.is_empty() {
                let (lambda, mu, row) = (var.take(n_cells), var.take(n_mu), row.take(own.len()));
                l.starts.push(StartIndex { element, lambda, mu, rows: own.clone(), row, whole: false });
            }
            for n in 0..n_fe {
                let mut e =
                    ElementIndex { stage: k, n, u, x_start: x_prev, lambda_start: lambda_prev, ..Default::default() };
                e.lambda_own = l.starts.last().filter(|s| n == 0 && s.element == element).map(|s| s.lambda);
                if fesd || time.is_some() {
                    e.h = Some(var.take(1));
                }
                if time.is_some() && !fesd {
                    e.row_tied = Some(row.take(1));
                } else if time.is_some() && o.gamma_h < 1.0 {
                    e.row_range = Some(row.take(2));
                }
                for _ in 0..n_s {
                    if !values_form {
                        e.v.push(var.take(nx));
                        e.row_conv.push(row.take(nx));
                    }
                    e.x.push(var.take(nx));
                    e.theta.push(var.take(n_weights));
                    e.lambda.push(var.take(n_cells));
                    e.mu.push(var.take(n_mu));
                    e.row_dyn.push(row.take(nx));
                    e.row_alg.push(row.take(n_rows));
                    e.row_norm.push(row.take(n_norm));
                    e.row_prod.push(row.take(n_prod));
                }
                if needs_end {
                    e.x_end = var.take(nx);
                    e.row_end = Some(row.take(nx));
                } else {
                    e.x_end = e.x[n_s - 1];
                }
                if fesd && needs_end {
                    e.lambda_end = Some(var.take(n_cells));
                    e.mu_end = var.take(n_mu);
                    e.row_end_alg = row.take(n_rows);
                }
                if sums {
                    e.sum_lambda = var.take(n_cells);
                    e.row_sum_lambda = Some(row.take(n_cells));
                    e.sum_theta = e.theta[0];
                    if n_s > 1 {
                        e.sum_theta = var.take(n_cells);
                        e.row_sum_theta = Some(row.take(n_cells));
                    }
                } else if fesd && o.cross == Cross::Stage {
                    e.sum_lambda = var.take(n_cells);
                    e.row_sum_lambda = Some(row.take(n_cells));
                }
                if fesd && n > 0 {
                    e.row_equal = Some(row.take(1));
                }
                if n > 0 && eta == Some(Shape::Equation) {
                    e.row_eta = Some(row.take(1));
                }
                if fesd && tableau.family == Family::LobattoIiia {
                    e.row_first = Some(row.take(n_cells));
                }
                if fesd && n + 1 < n_fe && ends_by_extrapolation(tableau) {
                    e.row_last = Some(row.take(n_cells));
                }
                if fesd && (n > 0 || k > 0) {
                    e.row_slope = Some(row.take(n_cells));
                }
                x_prev = e.x_end;
                lambda_prev = e.lambda_end.or(e.lambda.last().copied());
                l.add_pairs(&e, o.cross);
                l.elements.push(e);
            }
            l.first.push(l.elements.len());
            if fesd {
                l.row_time.push(row.take(1));
            }
        }
        for p in &spec.path {
            for _ in 0..p.at.n_points(&spec.n_fe, n_s) {
                l.row_path.push(row.take(p.f.n_out()));
            }
        }
        for i in &spec.inside {
            l.row_path.push(row.take(spec.path[i.path].f.n_out()));
        }
        for t in &spec.terminal {
            l.row_terminal.push(row.take(t.f.n_out()));
        }
        for b in &spec.boundary {
            l.row_boundary.push(row.take(b.f.n_out()));
        }
        for p in &spec.complementarity {
            let n = p.f.n_out() / 2;
            for _ in 0..p.at.n_ends(&spec.n_fe, n_s) {
                let v = var.take(2 * n);
                l.members.push(v);
                l.row_members.push(row.take(2 * n));
                for i in 0..n {
                    l.pairs.push((v + i, v + n + i));
                    l.groups.push(l.n_groups);
                    l.n_groups += 1;
                }
            }
        }
        l.n = var.0;
        l.m = row.0;
        Ok(l)
    }

    /// The multiplier of cell `c` before the first stage point of an element, by the first of its block.
    pub fn start_of(&self, e: &ElementIndex, c: usize) -> Option<usize> {
        match self.across[c] {
            _ if e.n > 0 || e.stage == 0 => e.lambda_start,
            Across::Tied => e.lambda_start,
            Across::Own => e.lambda_own,
            Across::Nothing => None,
        }
    }

    /// Is the multiplier of cell `c` before the first stage point of an element that at the end of the element before?
    pub fn is_tied(&self, e: &ElementIndex, c: usize) -> bool {
        e.n > 0 || e.stage > 0 && self.across[c] == Across::Tied
    }

    /// All multipliers of cell `c` in an element, by the first of their block.
    pub fn lambdas<'a>(&self, e: &'a ElementIndex, c: usize) -> impl Iterator<Item = usize> + 'a {
        self.start_of(e, c).into_iter().chain(e.lambda.iter().copied()).chain(e.lambda_end)
    }

    /// Elements of stage `k`.
    pub fn stage(&self, k: usize) -> &[ElementIndex] {
        &self.elements[self.first[k]..self.first[k + 1]]
    }

    fn add_pairs(&mut self, e: &ElementIndex, cross: Cross) {
        let n_s = e.x.len();
        let base = self.n_groups;
        for c in 0..self.n_cells {
            if !self.fesd {
                for i in 0..n_s {
                    self.pairs.push((e.lambda[i] + c, e.theta[i] + c));
                    self.groups.push(base + c * n_s + i);
                }
                continue;
            }
            match cross {
                Cross::Element => {
                    self.pairs.push((e.sum_lambda + c, e.sum_theta + c));
                    self.groups.push(base + c);
                }
                Cross::Stage => {
                    for i in 0..n_s {
                        // with the lifted sum of λ already there for (7.10) this is the same variable
                        self.pairs.push((e.sum_lambda + c, e.theta[i] + c));
                        self.groups.push(base + c);
                    }
                }
                Cross::Point => {
                    let lambdas: Vec<usize> = self.lambdas(e, c).collect();
                    for lam in lambdas {
                        self.pairs.push((lam + c, e.sum_theta + c));
                        self.groups.push(base + c);
                    }
                }
                Cross::Full => {
                    let lambdas: Vec<usize> = self.lambdas(e, c).collect();
                    for lam in lambdas {
                        for i in 0..n_s {
                            self.pairs.push((lam + c, e.theta[i] + c));
                            self.groups.push(base + c);
                        }
                    }
                }
            }
        }
        self.n_groups += if self.fesd { self.n_cells } else { self.n_cells * n_s };
    }
}
