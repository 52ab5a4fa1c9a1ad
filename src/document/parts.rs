//! Functions, systems, settings, and numbers that may be infinite.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::mechanics::SavedMechanics;
use crate::error::{Error, Result};
use crate::expr::{Block, Dag, ExprFunction, SavedGraph, Signature};
use crate::func::{Dims, Function};
use crate::memory::sizes::check as sizes;
use crate::model::{SavedDirection, SavedRule, SavedValue};
use crate::scene::{embedding_of, Embedding};
use crate::settings::{Settings, Value, OPTIONS};
use crate::system::{
    Choice, Inclusion, Linear, Regions, Reset, SetValued, SharedFunction, Subsystem, System, Transition,
};

/// Numbers of which some may be infinite, which JSON writes as text.
#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum Bound {
    Number(f64),
    Infinite(Infinite),
}

#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) enum Infinite {
    #[serde(rename = "inf")]
    Plus,
    #[serde(rename = "-inf")]
    Minus,
}

/// Lower and upper bounds.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Interval {
    lower: Vec<Bound>,
    upper: Vec<Bound>,
}

impl Bound {
    pub(super) fn new(v: f64) -> Bound {
        match v {
            f64::INFINITY => Bound::Infinite(Infinite::Plus),
            f64::NEG_INFINITY => Bound::Infinite(Infinite::Minus),
            v => Bound::Number(v),
        }
    }

    pub(super) fn value(self) -> f64 {
        match self {
            Bound::Number(v) => v,
            Bound::Infinite(Infinite::Plus) => f64::INFINITY,
            Bound::Infinite(Infinite::Minus) => f64::NEG_INFINITY,
        }
    }
}

impl Interval {
    pub(super) fn new(lower: &[f64], upper: &[f64]) -> Interval {
        let all = |v: &[f64]| v.iter().map(|&v| Bound::new(v)).collect();
        Interval { lower: all(lower), upper: all(upper) }
    }

    pub(super) fn values(&self) -> [Vec<f64>; 2] {
        [&self.lower, &self.upper].map(|b| b.iter().map(|b| b.value()).collect())
    }
}

/// A function: its expressions, or its name.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedFunction {
    signature: Signature,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    expressions: Option<SavedGraph>,
    /// Length of the parts that are evaluated alone.
    #[serde(default, skip_serializing_if = "is_zero")]
    part: usize,
    /// It has no second derivatives.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    first_order: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    embedded: Option<Box<SavedEmbedding>>,
}

/// A function of some of the inputs, with their places among all; its outputs have places likewise, the others are zero.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedEmbedding {
    f: SavedFunction,
    states: Vec<u32>,
    params: Vec<u32>,
    outputs: Vec<u32>,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

/// Linear combinations as expressions.
fn combination(f: &Linear, d: Dims) -> Result<SavedGraph> {
    let mut dag = Dag::new();
    let mut inputs = dag.inputs(Block::X, d.x);
    inputs.extend(dag.inputs(Block::U, d.u));
    inputs.extend(dag.inputs(Block::P, d.p));
    inputs.extend(dag.inputs(Block::T, 1));
    let mut roots = Vec::with_capacity(f.rows.len());
    for row in &f.rows {
        let mut sum = dag.constant(0.0);
        for &(column, factor) in row {
            let factor = dag.constant(factor);
            let term = dag.mul(factor, inputs[column]);
            sum = dag.add(sum, term);
        }
        roots.push(sum);
    }
    SavedGraph::new(&dag, &roots)
}

impl SavedFunction {
    pub(super) fn new(f: &SharedFunction) -> Result<SavedFunction> {
        let known = f.as_any();
        let expr = known.and_then(|f| f.downcast_ref::<ExprFunction>());
        let linear = known.and_then(|f| f.downcast_ref::<Linear>());
        Ok(SavedFunction {
            signature: Signature::of(f.as_ref()),
            expressions: match (expr, linear) {
                (Some(e), _) => Some(e.source()?.clone()),
                (_, Some(l)) => Some(combination(l, f.dims())?),
                _ => None,
            },
            part: expr.map_or(0, ExprFunction::part_len),
            first_order: expr.is_some_and(ExprFunction::is_first_order),
            embedded: match embedding_of(f.as_ref()) {
                Some(e) => Some(Box::new(SavedEmbedding {
                    f: SavedFunction::new(&e.f)?,
                    states: e.states,
                    params: e.params,
                    outputs: e.outputs,
                })),
                None => None,
            },
        })
    }

    pub(super) fn restore(&self, supplied: &[Arc<dyn Function>]) -> Result<SharedFunction> {
        self.restore_as(supplied, false)
    }

    /// One that is evaluated at events only, and may jump.
    fn restore_at_events(&self, supplied: &[Arc<dyn Function>]) -> Result<SharedFunction> {
        self.restore_as(supplied, true)
    }

    fn restore_as(&self, supplied: &[Arc<dyn Function>], at_events: bool) -> Result<SharedFunction> {
        let s = &self.signature;
        if let Some(e) = &self.embedded {
            sizes(&s.name, &[s.x, s.u, s.p, s.outputs])?;
            let inner = Embedding {
                f: e.f.restore(supplied)?,
                states: e.states.clone(),
                params: e.params.clone(),
                outputs: e.outputs.clone(),
            };
            return inner.function(&s.name, Dims { x: s.x, u: s.u, p: s.p }, s.outputs);
        }
        let Some(graph) = &self.expressions else { return s.find(supplied) };
        sizes(&s.name, &[s.x, s.u, s.p])?;
        if graph.n_roots() != s.outputs || self.part > s.outputs {
            return Err(Error::Dimension(format!(
                "function '{}' has {} expressions for {} outputs in parts of {}",
                s.name,
                graph.n_roots(),
                s.outputs,
                self.part
            )));
        }
        let mut dag = Dag::new();
        let outputs = graph.restore(&mut dag, supplied)?;
        let dims = Dims { x: s.x, u: s.u, p: s.p };
        Ok(Arc::new(match self.part {
            0 if self.first_order => ExprFunction::first_order(&s.name, &mut dag, dims, &outputs)?,
            0 if at_events => dag.function_at_events(&s.name, dims, &outputs)?,
            0 => ExprFunction::new(&s.name, &mut dag, dims, &outputs)?,
            len => ExprFunction::with_parts(&s.name, &mut dag, dims, &outputs, len)?,
        }))
    }
}

/// A system.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SavedSystem {
    states: usize,
    controls: usize,
    parameters: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    f0: Option<SavedFunction>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    subsystems: Vec<SavedSubsystem>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    inclusions: Vec<SavedInclusion>,
    #[serde(default, skip_serializing_if = "is_zero")]
    algebraic: usize,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    algebraic_equations: Option<SavedFunction>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    transitions: Vec<SavedTransition>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    choices: Vec<Choice>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    known_times: Vec<SavedTime>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    mechanics: Option<SavedMechanics>,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedTransition {
    guard: SavedFunction,
    direction: SavedDirection,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    from: Vec<SavedValue>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    reset: Option<SavedFunction>,
    /// States that the reset moves; none: all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    reset_states: Vec<usize>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    reset_switches: bool,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    to: Vec<SavedValue>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    clauses: Vec<Vec<usize>>,
    #[serde(default, skip_serializing_if = "SavedRule::is_default")]
    rule: SavedRule,
}

/// A time at which functions of the system are not smooth.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedTime {
    t: f64,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    jumps: bool,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedInclusion {
    rows: Vec<usize>,
    f: SavedFunction,
    psi: SavedFunction,
    /// The numbers are multipliers of the constraints `psi`, not steps.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    multipliers: bool,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SavedSubsystem {
    rows: Vec<usize>,
    n_modes: usize,
    modes: SavedFunction,
    regions: SavedRegions,
}

#[derive(Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
enum SavedRegions {
    Signs { psi: SavedFunction, signs: Vec<i8> },
    Indicators(SavedFunction),
}

impl SavedSystem {
    pub(super) fn new(system: &System) -> Result<SavedSystem> {
        let d = system.dims();
        let subsystem = |s: &Subsystem| -> Result<SavedSubsystem> {
            Ok(SavedSubsystem {
                rows: s.rows.clone(),
                n_modes: s.n_modes,
                modes: SavedFunction::new(&s.modes)?,
                regions: match &s.regions {
                    Regions::Signs { psi, signs } => {
                        SavedRegions::Signs { psi: SavedFunction::new(psi)?, signs: signs.clone() }
                    }
                    Regions::Indicators(g) => SavedRegions::Indicators(SavedFunction::new(g)?),
                },
            })
        };
        let inclusion = |i: &Inclusion| -> Result<SavedInclusion> {
            let (f, psi) = (SavedFunction::new(&i.f)?, SavedFunction::new(&i.psi)?);
            Ok(SavedInclusion { rows: i.rows.clone(), f, psi, multipliers: i.set == SetValued::Multiplier })
        };
        let transition = |t: &Transition| -> Result<SavedTransition> {
            Ok(SavedTransition {
                guard: SavedFunction::new(&t.guard)?,
                direction: t.direction.into(),
                from: SavedValue::list(&t.from),
                reset: t.reset.as_ref().map(|r| SavedFunction::new(&r.f)).transpose()?,
                reset_states: t.reset.iter().filter(|r| r.rows.len() < d.x).flat_map(|r| r.rows.clone()).collect(),
                reset_switches: t.reset.as_ref().is_some_and(|r| r.switches),
                to: SavedValue::list(&t.to),
                clauses: t.clauses.clone(),
                rule: (&t.rule).into(),
            })
        };
        Ok(SavedSystem {
            states: d.x,
            controls: d.u,
            parameters: d.p,
            f0: system.f0().map(SavedFunction::new).transpose()?,
            subsystems: system.subsystems().iter().map(subsystem).collect::<Result<_>>()?,
            inclusions: system.inclusions().iter().map(inclusion).collect::<Result<_>>()?,
            algebraic: system.n_algebraic(),
            algebraic_equations: system.algebraic().map(SavedFunction::new).transpose()?,
            transitions: system.transitions().iter().map(transition).collect::<Result<_>>()?,
            choices: system.choices().to_vec(),
            known_times: system.known_times().iter().map(|&(t, jumps)| SavedTime { t, jumps }).collect(),
            mechanics: system.mechanics().map(|m| SavedMechanics::new(m)).transpose()?,
        })
    }

    pub(super) fn restore(&self, supplied: &[Arc<dyn Function>]) -> Result<System> {
        sizes("system", &[self.states, self.controls, self.parameters])?;
        let mut system = match &self.mechanics {
            Some(m) => {
                let m = m.restore(supplied)?;
                if m.n_states() != self.states {
                    return Err(Error::Dimension(format!("{} states, and a scene of {}", self.states, m.n_states())));
                }
                System::of_mechanics(m, self.controls, self.parameters)?
            }
            None => System::new(self.states, self.controls, self.parameters)?,
        };
        if let Some(f) = &self.f0 {
            system.set_f0(f.restore(supplied)?)?;
        }
        for s in &self.subsystems {
            sizes("subsystem", &[s.n_modes, s.rows.len()])?;
            let regions = match &s.regions {
                SavedRegions::Signs { psi, signs } => {
                    Regions::Signs { psi: psi.restore(supplied)?, signs: signs.clone() }
                }
                SavedRegions::Indicators(g) => Regions::Indicators(g.restore(supplied)?),
            };
            let modes = s.modes.restore(supplied)?;
            system.add_subsystem(Subsystem { rows: s.rows.clone(), modes, n_modes: s.n_modes, regions })?;
        }
        for i in &self.inclusions {
            let (f, psi) = (i.f.restore(supplied)?, i.psi.restore(supplied)?);
            let set = if i.multipliers { SetValued::Multiplier } else { SetValued::Step };
            system.add_inclusion(Inclusion { rows: i.rows.clone(), f, psi, set })?;
        }
        for t in &self.transitions {
            system.add_transition(Transition {
                guard: t.guard.restore(supplied)?,
                clauses: t.clauses.clone(),
                direction: t.direction.into(),
                from: SavedValue::values(&t.from),
                reset: match &t.reset {
                    Some(r) => {
                        let f = r.restore_at_events(supplied)?;
                        let rows =
                            if t.reset_states.is_empty() { (0..self.states).collect() } else { t.reset_states.clone() };
                        Some(Reset { rows, f, switches: t.reset_switches })
                    }
                    None => None,
                },
                to: SavedValue::values(&t.to),
                rule: (&t.rule).into(),
            })?;
        }
        // behind the transitions, which say which of the last states are discrete
        let equations = self.algebraic_equations.as_ref().map(|g| g.restore(supplied)).transpose()?;
        system.set_algebraic(self.algebraic, equations)?;
        for c in &self.choices {
            system.add_choice(c.control, &c.values, c.dwell)?;
        }
        let known: Vec<(f64, bool)> = self.known_times.iter().map(|k| (k.t, k.jumps)).collect();
        system.add_known_times(&known)?;
        Ok(system)
    }
}

/// Options by name, so that new ones and another order do no harm.
#[derive(Clone, Serialize, Deserialize)]
#[serde(transparent)]
pub(super) struct SavedSettings(BTreeMap<String, SavedOption>);

#[derive(Clone, Serialize, Deserialize)]
#[serde(untagged)]
enum SavedOption {
    Int(i64),
    Float(f64),
    Text(String),
}

impl SavedSettings {
    pub(super) fn new(settings: &Settings) -> Result<SavedSettings> {
        let mut all = BTreeMap::new();
        for o in OPTIONS {
            let value = match settings.get_by_name(o.name)? {
                Value::Int(v) => SavedOption::Int(v),
                Value::Float(v) if v.is_finite() => SavedOption::Float(v),
                Value::Float(v) => SavedOption::Text(v.to_string()),
                Value::Text(v) => SavedOption::Text(v),
            };
            all.insert(o.name.to_owned(), value);
        }
        Ok(SavedSettings(all))
    }

    pub(super) fn restore(&self) -> Result<Settings> {
        let mut settings = Settings::default();
        for (name, value) in &self.0 {
            let value = match value {
                SavedOption::Int(v) => Value::Int(*v),
                SavedOption::Float(v) => Value::Float(*v),
                SavedOption::Text(v) => Value::Text(v.clone()),
            };
            settings.set_by_name(name, value)?;
        }
        settings.validate()?;
        Ok(settings)
    }
}
