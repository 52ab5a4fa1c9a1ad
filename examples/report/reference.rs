//! Reference solutions (`tests/data/reference`): one JSON file per problem, with switching times and sensitivities.
#![allow(dead_code)]

use std::path::PathBuf;

use serde_json::Value;

fn number(v: &Value) -> f64 {
    v.as_f64().unwrap_or(f64::NAN)
}

fn list(v: &Value) -> &[Value] {
    v.as_array().map_or(&[], Vec::as_slice)
}

fn numbers(v: &Value) -> Vec<f64> {
    list(v).iter().map(number).collect()
}

/// A reference problem.
pub struct Reference {
    pub t_end: f64,
    pub x0: Vec<f64>,
    pub x_end: Vec<f64>,
    /// Time, kind (`cross[0]`, `enter_sliding[1]`), derivative of the time with respect to the initial state.
    pub switches: Vec<(f64, String, Vec<f64>)>,
    /// `∂x(T)/∂x0`, rows.
    pub sensitivity: Vec<Vec<f64>>,
    /// Times and states on the way.
    pub samples: Vec<(f64, Vec<f64>)>,
}

/// Reads the reference of this name; panics where the file is missing or is no JSON.
pub fn load(name: &str) -> Reference {
    let path: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "tests", "data", "reference", &format!("{name}.json")].iter().collect();
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let j: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let kind = |s: &Value| s["kind"].as_str().unwrap_or_default().to_owned();
    Reference {
        t_end: number(&j["T"]),
        x0: numbers(&j["x0"]),
        x_end: numbers(&j["x_T"]),
        switches: list(&j["switches"]).iter().map(|s| (number(&s["t"]), kind(s), numbers(&s["dt_dx0"]))).collect(),
        sensitivity: list(&j["sens_xT_x0"]).iter().map(numbers).collect(),
        samples: list(&j["samples"]).iter().map(|s| (number(&s["t"]), numbers(&s["x"]))).collect(),
    }
}
