//! Measures speed against error on the standard problems.
//!
//! `cargo run --release --example report -- CASE [--json] [--plot DIR] [--problems DIR] [--casadi DIR] [--method FAMILY]`, `CASE` one
//! of [`cases::ALL`] or `all`. Prints a table; with `--json` one object per line and nothing else on standard output.
//! `replay FILE` solves what a document holds and prints what happened.
//! `--problems` (default: the environment variable `SWITCHBACK_MPCC_PROBLEMS`) names a folder of recorded problems for the
//! cases that can use one, `--casadi` a folder that
//! `bindings/python/benchmarks/model_eval.py` wrote; `--method` restricts `sliding-ocp` to one Runge-Kutta family.

mod automata_models;
mod cases;
mod compiled;
mod expression_models;
mod fast_oscillator;
mod json;
mod models;
mod recorded;
mod reference;
mod replay;
mod svg;

use std::path::PathBuf;

/// Where results go.
pub struct Context {
    json: bool,
    plot: Option<PathBuf>,
    problems: Option<PathBuf>,
    casadi: Option<PathBuf>,
    /// Runge-Kutta family to restrict a sweep to.
    method: Option<String>,
    /// Is this one case of all of them, where a sweep takes a sample?
    all: bool,
}

impl Context {
    /// One result.
    fn record(&self, o: &json::Object) {
        if self.json {
            println!("{}", o.line());
        }
    }
    /// What a person reads.
    fn say(&self, text: &str) {
        if !self.json {
            println!("{}", text.trim_end());
        }
    }
    fn plot(&self, p: &svg::Plot, name: &str) {
        self.draw(&p.svg(), name);
    }
    /// Writes a drawing.
    fn draw(&self, drawing: &str, name: &str) {
        if let Some(dir) = &self.plot {
            let written = std::fs::create_dir_all(dir).and_then(|()| std::fs::write(dir.join(name), drawing));
            if let Err(e) = written {
                eprintln!("cannot write {}: {e}", dir.join(name).display());
            }
        }
    }
}

fn usage(problem: &str) -> ! {
    let names: Vec<&str> = cases::ALL.iter().map(|c| c.0).collect();
    eprintln!(
        "{problem}\nusage: report CASE [--json] [--plot DIR] [--problems DIR] [--casadi DIR] [--method FAMILY]\n       report replay FILE\n\
         cases: {}, all",
        names.join(", ")
    );
    std::process::exit(2)
}

fn main() {
    let problems = std::env::var_os("SWITCHBACK_MPCC_PROBLEMS").map(PathBuf::from);
    let mut context = Context { json: false, plot: None, problems, casadi: None, method: None, all: false };
    let mut case = None;
    let mut args = std::env::args().skip(1);
    while let Some(a) = args.next() {
        match a.as_str() {
            "--json" => context.json = true,
            "--plot" => match args.next() {
                Some(dir) => context.plot = Some(dir.into()),
                None => usage("--plot needs a directory"),
            },
            "--problems" => match args.next() {
                Some(dir) => context.problems = Some(dir.into()),
                None => usage("--problems needs a directory"),
            },
            "--casadi" => match args.next() {
                Some(dir) => context.casadi = Some(dir.into()),
                None => usage("--casadi needs a directory"),
            },
            "--method" => match args.next() {
                Some(name) => context.method = Some(name),
                None => usage("--method needs the name of a Runge-Kutta family"),
            },
            _ if a.starts_with('-') => usage(&format!("unknown option '{a}'")),
            "replay" if case.is_none() => {
                let Some(file) = args.next() else { usage("replay needs a document") };
                if let Err(e) = replay::run(&file) {
                    eprintln!("{e}");
                    std::process::exit(1);
                }
                return;
            }
            _ if case.is_some() => usage("one case at a time"),
            _ => case = Some(a),
        }
    }
    let Some(case) = case else { usage("which case?") };
    let chosen: Vec<_> = cases::ALL.iter().filter(|c| case == "all" || case == c.0).collect();
    if chosen.is_empty() {
        usage(&format!("unknown case '{case}'"));
    }
    context.all = case == "all";
    for (_, run) in chosen {
        run(&context);
    }
}
