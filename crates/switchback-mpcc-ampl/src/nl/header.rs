//! The ten lines a `.nl` file begins with.

use super::source::{Form, Source};
use switchback::{Error, Result};

/// What the header says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Header {
    /// Options of AMPL, which go back in the `.sol` file.
    pub options: Vec<i64>,
    /// Tolerance that goes back with them.
    pub tolerance: Option<f64>,
    /// Variables.
    pub n_vars: usize,
    /// Constraints that are not logical.
    pub n_cons: usize,
    /// Objectives.
    pub n_objs: usize,
    /// Logical constraints.
    pub n_logical: usize,
    /// Imported functions.
    pub n_functions: usize,
    /// Variables that must be integers.
    pub n_integer: usize,
    /// Defined variables.
    pub n_defined: usize,
}

/// Options AMPL may send.
const MAX_OPTIONS: usize = 9;

/// Reads the header, and leaves the source at what follows it.
pub fn read(source: &mut Source) -> Result<Header> {
    let first = source.header_line("the first line of the header")?;
    let kind = first.bytes().next();
    if !matches!(kind, Some(b'g' | b'b')) {
        return Err(source.fault("this is no .nl file: it begins with neither 'g' nor 'b'"));
    }
    let mut header = Header::default();
    let mut words = first[1..].split_ascii_whitespace();
    let n_options = words.next().and_then(|w| w.parse::<usize>().ok()).filter(|n| *n <= MAX_OPTIONS);
    let n_options = n_options.ok_or_else(|| source.fault("expected a number of options up to 9 behind 'g' or 'b'"))?;
    for _ in 0..n_options {
        let option = words.next().and_then(|w| w.parse::<i64>().ok());
        header.options.push(option.ok_or_else(|| source.fault("expected an option, an integer"))?);
    }
    if header.options.get(1) == Some(&3) {
        header.tolerance = words.next().and_then(|w| w.parse().ok()).filter(|t: &f64| t.is_finite());
    }

    let sizes = numbers(source, "numbers of variables, constraints and objectives", 3)?;
    let at = |line: &[usize], k: usize| line.get(k).copied().unwrap_or(0);
    (header.n_vars, header.n_cons, header.n_objs) = (sizes[0], sizes[1], sizes[2]);
    header.n_logical = at(&sizes, 5);
    numbers(source, "numbers of nonlinear constraints and objectives", 2)?;
    numbers(source, "numbers of network constraints", 2)?;
    numbers(source, "numbers of nonlinear variables", 2)?;
    let line = numbers(source, "numbers of network variables and functions", 2)?;
    header.n_functions = line[1];
    let arithmetic = at(&line, 2);
    let line = numbers(source, "numbers of discrete variables", 2)?;
    header.n_integer = sum(source, &line)?;
    numbers(source, "numbers of nonzeros", 2)?;
    numbers(source, "lengths of names", 2)?;
    let line = numbers(source, "numbers of defined variables", 5)?;
    header.n_defined = sum(source, &line)?;

    // Everything that is counted takes a byte of the file at least: what is made of the counts cannot be larger than the file.
    let counted = sum(source, &[header.n_vars, header.n_cons, header.n_objs, header.n_logical, header.n_defined])?;
    if counted > source.len() {
        return Err(source.fault(format_args!(
            "the header counts {counted} variables, constraints and objectives, more than the {} bytes of the file",
            source.len()
        )));
    }
    if kind == Some(b'b') {
        source.set_form(match arithmetic {
            0 | 1 => Form::Little,
            2 => Form::Big,
            other => {
                return Err(Error::Unsupported(format!(
                    ".nl file: arithmetic {other} of the binary form: only IEEE numbers (1 and 2) are read; write the text \
                     form (option g)"
                )))
            }
        });
    }
    Ok(header)
}

fn sum(source: &Source, counts: &[usize]) -> Result<usize> {
    let all = counts.iter().try_fold(0usize, |a, n| a.checked_add(*n));
    all.ok_or_else(|| source.fault("counts of the header are too large"))
}

/// The numbers of a line, `least` of them at least.
fn numbers(source: &mut Source, what: &str, least: usize) -> Result<Vec<usize>> {
    let line = source.header_line(what)?;
    let all: Option<Vec<usize>> = line.split_ascii_whitespace().map(|w| w.parse().ok()).collect();
    match all {
        Some(all) if all.len() >= least => Ok(all),
        _ => Err(source.fault(format_args!("the line before this one should be the {what}, at least {least}"))),
    }
}
