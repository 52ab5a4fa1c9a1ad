//! The statistics of a solve as a document of JSON, schema `switchback.mpcc/1`.

use super::diagnosis::{polish_name, swb_item, SHOWN};
use super::json;
use super::mpcc::Program;
use serde::ser::{SerializeMap, Serializer};
use serde::Serialize;
use switchback::error::Result;
use switchback::nlp::Residuals;
use switchback::settings::Settings;

#[derive(Serialize)]
struct Document<'a> {
    schema: &'static str,
    outcome: &'static str,
    polish: &'static str,
    objective: f64,
    sizes: Sizes,
    residuals: BothResiduals,
    certificate: Certificate,
    conflict: Option<Conflict<'a>>,
    stats: Stats,
    linear_algebra: LinearAlgebra,
    worst: Vec<Item<'a>>,
    warnings: Vec<String>,
    #[serde(serialize_with = "options")]
    settings: &'a Settings,
}

#[derive(Serialize)]
struct Sizes {
    variables: usize,
    constraints: usize,
    pairs: usize,
    boxes: usize,
    solver_variables: usize,
    solver_constraints: usize,
}

#[derive(Serialize)]
struct BothResiduals {
    unscaled: Errors,
    scaled: Errors,
}

#[derive(Serialize)]
struct Errors {
    primal: f64,
    dual: f64,
    complementarity: f64,
    pair_product: f64,
    pair_min: f64,
}

impl From<&Residuals> for Errors {
    fn from(r: &Residuals) -> Errors {
        Errors {
            primal: r.primal,
            dual: r.dual,
            complementarity: r.complementarity,
            pair_product: r.pair_product,
            pair_min: r.pair_min,
        }
    }
}

#[derive(Serialize)]
struct Certificate {
    stationarity: &'static str,
    sharp: bool,
    b_stationary: &'static str,
    doubt: &'static str,
    biactive: usize,
    min_multiplier: f64,
    strict: bool,
    lps: usize,
    lp_iterations: usize,
    nodes: usize,
    second_order: &'static str,
    dependent: usize,
    bound: Option<f64>,
}

#[derive(Serialize)]
struct Conflict<'a> {
    items: Vec<Item<'a>>,
    gap: f64,
    residual: f64,
}

/// A part of the program with a number that belongs to it.
#[derive(Serialize)]
struct Item<'a> {
    kind: &'static str,
    index: usize,
    name: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    weight: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    violation: Option<f64>,
}

#[derive(Serialize)]
struct Stats {
    found_by: &'static str,
    iterations: usize,
    restoration_iterations: usize,
    polish_iterations: usize,
    factorisations: usize,
    evaluations: usize,
    max_delta_w: f64,
    moved_bounds: usize,
    time_total: f64,
    time_eval: f64,
    time_linalg: f64,
    time_build: f64,
}

#[derive(Serialize)]
struct LinearAlgebra {
    backend: &'static str,
    n: usize,
    nnz_k: usize,
    nnz_l: usize,
    flops: f64,
    min_abs_pivot: f64,
    max_abs_pivot: f64,
    shift: f64,
    factorisations: usize,
    solves: usize,
    refinement_steps: usize,
    equilibrations: usize,
}

/// All options by name: integers, numbers (infinite ones as text), names of values.
fn options<S: Serializer>(settings: &&Settings, to: S) -> std::result::Result<S::Ok, S::Error> {
    use switchback::settings::{Kind, Value, OPTIONS};
    let mut map = to.serialize_map(Some(OPTIONS.len()))?;
    for o in OPTIONS {
        match (o.kind, o.get(settings)) {
            (Kind::Int, Value::Int(v)) => map.serialize_entry(o.name, &v)?,
            (Kind::Float, Value::Float(v)) if v.is_finite() => map.serialize_entry(o.name, &v)?,
            _ => map.serialize_entry(o.name, &o.get_text(settings))?,
        }
    }
    map.end()
}

impl Program {
    fn item(&self, kind: swb_item, index: usize) -> Item<'_> {
        Item { kind: kind.word(), index, name: self.names.get(kind, index), weight: None, violation: None }
    }

    pub(super) fn statistics_json(&self) -> Result<Vec<u8>> {
        let r = self.result()?;
        let (s, c, t, l) = (&r.solution, &r.solution.certificate, &r.solution.stats, &r.linear);
        let conflict = match &s.conflict {
            None => None,
            Some(found) => {
                let items = self.conflict()?.into_iter().take(SHOWN);
                let items = items.map(|(kind, i, w)| Item { weight: Some(w), ..self.item(kind, i) }).collect();
                Some(Conflict { items, gap: found.gap, residual: found.residual })
            }
        };
        let worst = self.worst()?.into_iter().take(SHOWN);
        json::text(&Document {
            schema: "switchback.mpcc/1",
            outcome: s.outcome.name(),
            polish: polish_name(s.polish),
            objective: s.objective,
            sizes: Sizes {
                variables: self.n,
                constraints: self.m,
                pairs: self.members.len(),
                boxes: self.boxes.len(),
                solver_variables: r.dimensions.0,
                solver_constraints: r.dimensions.1,
            },
            residuals: BothResiduals { unscaled: Errors::from(&r.residuals), scaled: Errors::from(&r.scaled) },
            certificate: Certificate {
                stationarity: c.stationarity.name(),
                sharp: c.sharp,
                b_stationary: c.b.name(),
                doubt: c.doubt.name(),
                biactive: c.biactive,
                min_multiplier: c.min_multiplier,
                strict: c.ulsc,
                lps: c.lps,
                lp_iterations: c.lp_iterations,
                nodes: c.nodes,
                second_order: c.second.name(),
                dependent: c.dependent,
                bound: c.bound,
            },
            conflict,
            stats: Stats {
                found_by: s.found_by.name(),
                iterations: t.iterations,
                restoration_iterations: t.restoration_iterations,
                polish_iterations: t.polish_iterations,
                factorisations: t.factorisations,
                evaluations: t.evaluations,
                max_delta_w: t.max_delta_w,
                moved_bounds: t.moved_bounds,
                time_total: t.time_total,
                time_eval: t.time_eval,
                time_linalg: t.time_linalg,
                time_build: r.time_build,
            },
            linear_algebra: LinearAlgebra {
                backend: l.backend,
                n: l.n,
                nnz_k: l.nnz_k,
                nnz_l: l.nnz_l,
                flops: l.flops,
                min_abs_pivot: l.min_abs_pivot,
                max_abs_pivot: l.max_abs_pivot,
                shift: l.shift,
                factorisations: l.factorisations,
                solves: l.solves,
                refinement_steps: l.refinement_steps,
                equilibrations: l.equilibrations,
            },
            worst: worst.map(|(kind, i, by)| Item { violation: Some(by), ..self.item(kind, i) }).collect(),
            warnings: self.warnings(r),
            settings: &self.settings,
        })
    }
}
