//! From an optimal control problem as it was stated to functions at nodes.

use super::constraints::{Constraints, Stated, Where};
use super::cost::{Costs, General, Squares};
use super::linearise::{HessianKind, Model};
use super::nodes::Nodes;
use super::stage::{Chain, Evaluations, EventStage, ExplicitRk, ImplicitRk, Stage};
use super::{Level, Options, Scheme};
use crate::error::{Error, Result};
use crate::expr::ExprFunction;
use crate::func::Function;
use crate::ocp::{CostAt, Durations, Norm, Ocp, Statement};
use crate::qp::{Price, StageQp};
use crate::system::SharedFunction;
use crate::tableau::{Family, Tableau};

fn refuse<T>(what: &str) -> Result<T> {
    Err(Error::Unsupported(format!("real-time control does not know {what}")))
}

/// Does the system switch, by itself or since controls choose, so that its stages are simulated by events?
pub(super) fn switches(s: &Statement) -> bool {
    let by_modes = s.system.subsystems().len() + s.system.inclusions().len() > 0;
    by_modes || !s.system.choices().is_empty() || !s.system.transitions().is_empty() || s.system.mechanics().is_some()
}

/// What a controller cannot do yet, said when it is made.
fn check(s: &Statement) -> Result<()> {
    let first = s.system.dims().x - s.system.n_algebraic();
    let by_modes = s.system.subsystems().iter().map(|m| &m.rows).chain(s.system.inclusions().iter().map(|m| &m.rows));
    if by_modes.flatten().any(|row| *row >= first) {
        return refuse("algebraic equations that switch: only rates may");
    }
    let weighed = s.system.mechanics().is_some_and(|m| m.n_switches > 0);
    if s.system.n_algebraic() > 0 && (!s.system.transitions().is_empty() || weighed) {
        return refuse("algebraic equations next to transitions, clocks and forces of scenes that switch");
    }
    if s.system.f0().is_none() && !switches(s) {
        return refuse("systems without a right-hand side");
    }
    if s.time != Durations::Fixed {
        return refuse("free lengths of stages: fix them");
    }
    if s.linear.contains(&true) {
        return refuse("linear controls: make them constant on every stage");
    }
    if !s.boundary.is_empty() {
        return refuse("constraints between the two ends of the horizon");
    }
    if !s.complementarity.is_empty() {
        return refuse("complementarity constraints");
    }
    if s.p_bounds.is_some_and(|[l, u]| l.iter().zip(u).any(|(l, u)| l < u)) {
        return refuse("free parameters: fix them");
    }
    if s.system.dims().u == 0 {
        return refuse("systems without controls");
    }
    Ok(())
}

/// Does a function depend on the controls?
fn sees_controls(f: &SharedFunction) -> bool {
    let d = f.dims();
    (d.x..d.x + d.u).any(|c| !f.jac_pattern().rows(c).is_empty())
}

fn constraints(s: &Statement) -> Result<Vec<Stated>> {
    let mut all = Vec::new();
    for c in s.path {
        let (lower, upper) = (c.lower.clone(), c.upper.clone());
        all.push(Stated { f: c.f.clone(), lower, upper, place: Where::Path, price: None });
    }
    for c in s.terminal {
        let (lower, upper) = (c.lower.clone(), c.upper.clone());
        all.push(Stated { f: c.f.clone(), lower, upper, place: Where::Terminal, price: None });
    }
    for c in s.soft {
        let place = if c.at.is_some() { Where::PricedPath } else { Where::Terminal };
        let price = match c.norm {
            Norm::L1 => Price { linear: c.weight, quadratic: 0.0 },
            Norm::L2 => Price { linear: 0.0, quadratic: c.weight },
            Norm::Linf => return refuse("penalties of the largest violation: take the sum or the sum of squares"),
        };
        if c.cost.is_some() && c.f.n_out() > 1 {
            return refuse(
                "costs with maxima of several values: take an additional control, which is no less than each of them",
            );
        }
        // one constraint with two prices is one row
        let same = |o: &&mut Stated| {
            std::sync::Arc::ptr_eq(&o.f, &c.f) && o.place == place && o.lower == c.lower && o.upper == c.upper
        };
        if let Some(o) = all.iter_mut().filter(|o| o.price.is_some()).find(same) {
            let p = o.price.unwrap_or(price);
            o.price = Some(Price { linear: p.linear + price.linear, quadratic: p.quadratic + price.quadratic });
        } else {
            let (lower, upper) = (c.lower.clone(), c.upper.clone());
            all.push(Stated { f: c.f.clone(), lower, upper, place, price: Some(price) });
        }
    }
    Ok(all)
}

fn costs(s: &Statement, second: bool, width: usize) -> Result<Costs> {
    let mut squares = Vec::new();
    for q in s.squares {
        // at the end of the horizon the control is that of the last stage and counts as given
        if q.place == CostAt::ControlGrid && sees_controls(&q.f) {
            return refuse("costs of controls at the ends of stages: let them count along the horizon");
        }
        squares.push(Squares::new(&q.f, &q.weights, &q.references, q.place, s.n_stages, second));
    }
    let mut general = Vec::new();
    general.extend(s.lagrange.map(|f| General::new(f, CostAt::Running, s.n_stages)));
    general.extend(s.mayer.map(|f| General::new(f, CostAt::Terminal, s.n_stages)));
    Ok(Costs::new(squares, general, width))
}

/// The discretisation of `n` stages.
pub(super) fn stage(ocp: &Ocp, options: &Options, n: usize) -> Result<Box<dyn Stage>> {
    let s = ocp.statement();
    if switches(&s) {
        if options.scheme == Scheme::Mli || options.level != Level::D0 {
            return refuse("levels other than D0 for systems that switch: their derivatives change with the modes");
        }
        // all plans of a preparation, as they begin and as they end; what callbacks see besides may change from call to call
        let is_callback = |f: &dyn Function| f.as_any().and_then(|f| f.downcast_ref::<ExprFunction>()).is_none();
        let callbacks = s.simulated.any_function_or_force(&is_callback);
        let kept = if callbacks { 0 } else { 2 * n * (1 + options.flips) };
        return Ok(Box::new(EventStage::new(s.simulated, &s.settings.into(), algebraic_guess(&s), kept)?));
    }
    let Some(f) = s.system.f0() else { return refuse("systems without a right-hand side") };
    let own = crate::fesd::Options::from_settings(s.settings)?;
    let family = options.family.unwrap_or(own.family);
    let n_s = if options.n_s > 0 { options.n_s } else { own.n_s };
    let steps = if options.steps > 0 { options.steps } else { usize::try_from(s.settings.n_fe).unwrap_or(1).max(1) };
    let tableau = Tableau::new(family, n_s)?;
    let exact = options.hessian() == HessianKind::Exact;
    if family == Family::Explicit {
        if s.system.n_algebraic() > 0 {
            return refuse("explicit methods for algebraic equations: take Gauss-Legendre or Radau IIA");
        }
        return Ok(Box::new(ExplicitRk::new(f, n, steps, tableau, exact)));
    }
    if exact {
        return refuse("exact Hessians with implicit methods: take level D0 or D1");
    }
    let nz = s.system.n_algebraic();
    let make = || {
        let mut one = ImplicitRk::new(f, s.system.algebraic(), nz, n, tableau.clone())?;
        one.guess_algebraic(&algebraic_guess(&s));
        Ok(one)
    };
    if steps == 1 {
        return Ok(Box::new(make()?));
    }
    let links = (0..steps).map(|_| make()).collect::<Result<Vec<_>>>()?;
    let d = s.system.dims();
    Ok(Box::new(Chain::new(links, [n, d.x - nz, d.u])))
}

/// What the user gave as a start for the algebraic states.
fn algebraic_guess(s: &Statement) -> Vec<f64> {
    let (nx, nz) = (s.system.dims().x, s.system.n_algebraic());
    match s.x_guess {
        Some((_, x)) => x[nx - nz..nx].to_vec(),
        None => {
            let middle = |i: usize| {
                let (l, u) = (s.x0_bounds[0][i], s.x0_bounds[1][i]);
                if l.is_finite() && u.is_finite() {
                    0.5 * (l + u)
                } else {
                    0.0
                }
            };
            (nx - nz..nx).map(middle).collect()
        }
    }
}

/// The functions of the problem, and an empty quadratic program for them.
pub(super) fn build(ocp: &Ocp, options: &Options) -> Result<(Model, StageQp)> {
    let s = ocp.statement();
    check(&s)?;
    let exact = options.hessian() == HessianKind::Exact;
    let n = s.n_stages;
    let mut nodes = Nodes::new(s.system, n);
    nodes.h.copy_from_slice(s.durations);
    nodes.t[0] = s.t0;
    for k in 0..n {
        nodes.t[k + 1] = nodes.t[k] + nodes.h[k];
    }
    let guess = algebraic_guess(&s);
    nodes.z.chunks_exact_mut(guess.len().max(1)).for_each(|z| z.copy_from_slice(&guess));
    let np = nodes.np;
    for k in 0..=n {
        let own = s.stage_params.map_or(s.params, |p| &p[k.min(n - 1) * np..(k.min(n - 1) + 1) * np]);
        nodes.p[k * np..(k + 1) * np].copy_from_slice(own);
    }
    let stated = constraints(&s)?;
    let constraints = Constraints::new(&nodes, &stated, [&s.x_bounds[0], &s.x_bounds[1]], exact);
    let qp = StageQp::new(n, nodes.nx, nodes.nu, constraints.rows().to_vec())?;
    let model = Model {
        costs: costs(&s, exact, nodes.nx + nodes.nu)?,
        constraints,
        stage: stage(ocp, options, n)?,
        switches: switches(&s),
        chooses: (0..nodes.nu).map(|j| s.system.choices().iter().any(|c| c.control == j)).collect(),
        u_lower: s.u_bounds[0].clone(),
        u_upper: s.u_bounds[1].clone(),
        nodes,
        evaluations: Evaluations::default(),
        revision: 0,
    };
    Ok((model, qp))
}
