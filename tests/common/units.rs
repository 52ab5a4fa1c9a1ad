//! Models in other units: states, time, controls, parameters and switching functions multiplied by constants.
#![allow(dead_code)]

use serde_json::{json, Value};
use switchback::expr::Dag;
use switchback::model::{Built, SavedModel};

/// How large a unit is in the old one: `x_old = x · x_new`, and the same for the others.
#[derive(Debug, Clone)]
pub struct Units {
    /// Of every state.
    pub x: Vec<f64>,
    /// Of time.
    pub t: f64,
    /// Of all controls.
    pub u: f64,
    /// Of all parameters.
    pub p: f64,
    /// Factor of all switching functions.
    pub psi: f64,
}

impl Units {
    /// The units of a model of so many states.
    pub fn same(nx: usize) -> Units {
        Units { x: vec![1.0; nx], t: 1.0, u: 1.0, p: 1.0, psi: 1.0 }
    }
}

/// New nodes, and the new numbers of the old ones.
struct Rewriter {
    nodes: Vec<Value>,
    number: Vec<usize>,
}

impl Rewriter {
    fn push(&mut self, node: Value) -> usize {
        self.nodes.push(node);
        self.nodes.len() - 1
    }

    /// `factor · node`
    fn scaled(&mut self, factor: f64, node: usize) -> usize {
        if factor == 1.0 {
            return node;
        }
        let c = self.push(json!(["const", factor]));
        self.push(json!(["*", c, node]))
    }

    fn old(&self, v: &Value) -> usize {
        self.number[v.as_u64().unwrap() as usize]
    }

    fn node(&mut self, node: &Value, units: &Units) -> usize {
        let mut new = node.as_array().unwrap().clone();
        let name = new[0].as_str().unwrap().to_owned();
        let operands = match name.as_str() {
            "const" | "truth" | "component" => 0..0,
            "x" | "u" | "p" | "t" => {
                let i = new[1].as_u64().unwrap() as usize;
                let factor = match name.as_str() {
                    "x" => units.x[i],
                    "u" => units.u,
                    "p" => units.p,
                    _ => units.t,
                };
                let input = self.push(node.clone());
                return self.scaled(factor, input);
            }
            "positive" => {
                let psi = self.old(&new[1]);
                let psi = self.scaled(units.psi, psi);
                return self.push(json!(["positive", psi]));
            }
            "powi" => 1..2,
            "table" => 3..4,
            _ => 1..new.len(),
        };
        for k in operands {
            new[k] = json!(self.old(&new[k]));
        }
        self.push(Value::Array(new))
    }
}

/// The model in other units, and the graph it was built in is forgotten.
pub fn scaled(b: &Built, units: &Units) -> Built {
    let mut model = serde_json::to_value(b.source().unwrap()).unwrap();
    let graph = model["derivatives"].as_object_mut().unwrap();
    let mut r = Rewriter { nodes: Vec::new(), number: Vec::new() };
    for node in graph["nodes"].as_array().unwrap().clone() {
        let k = r.node(&node, units);
        r.number.push(k);
    }
    if let Some(groups) = graph.get_mut("groups") {
        for group in groups.as_array_mut().unwrap() {
            for list in ["matrix", "rhs", "args"] {
                for kind in group.as_object_mut().unwrap().values_mut() {
                    if let Some(list) = kind.get_mut(list) {
                        let new: Vec<usize> = list.as_array().unwrap().iter().map(|v| r.old(v)).collect();
                        *list = json!(new);
                    }
                }
            }
        }
    }
    let roots: Vec<usize> = graph["roots"].as_array().unwrap().iter().map(|v| r.old(v)).collect();
    // dx_new/dt_new = (t / x) dx_old/dt_old
    let roots: Vec<usize> =
        roots.into_iter().enumerate().map(|(i, root)| r.scaled(units.t / units.x[i], root)).collect();
    graph.insert("roots".into(), json!(roots));
    graph.insert("nodes".into(), Value::Array(r.nodes));
    let saved: SavedModel = serde_json::from_value(model).unwrap();
    let mut dag = Dag::new();
    saved.restore(&mut dag, &[]).unwrap().build_in(&mut dag).unwrap()
}
