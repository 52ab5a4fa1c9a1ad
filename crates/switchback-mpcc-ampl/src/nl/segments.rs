//! The segments behind the header.

use super::header::{self, Header};
use super::source::Source;
use super::{Body, Forest, Objective, Problem, Row};
use switchback::nlp::INFINITE;
use switchback::{Error, Result};

/// Reads a file.
///
/// # Errors
/// [`Error::Range`] where the file is no `.nl` file, with the place; [`Error::Unsupported`] for logical constraints.
pub fn read(bytes: &[u8]) -> Result<Problem> {
    let mut source = Source::new(bytes);
    let header = header::read(&mut source)?;
    if header.n_logical > 0 {
        return Err(logical(header.n_logical));
    }
    let mut reader = Reader {
        problem: Problem {
            forest: Forest::new(header.n_defined),
            constraints: vec![Body::default(); header.n_cons],
            objectives: vec![Objective::default(); header.n_objs],
            start: vec![0.0; header.n_vars],
            ..Problem::default()
        },
        header,
        source,
    };
    while let Some(key) = reader.source.key() {
        reader.segment(key)?;
    }
    let Reader { mut problem, header, source } = reader;
    if problem.bounds.len() != header.n_vars {
        return Err(source.fault("expected a segment b, the bounds of the variables, but the file ends"));
    }
    if problem.rows.len() != header.n_cons {
        return Err(source.fault("expected a segment r, the bounds of the constraints, but the file ends"));
    }
    problem.header = header;
    Ok(problem)
}

fn logical(n: usize) -> Error {
    Error::Unsupported(format!(
        ".nl file: {n} logical constraints (segment L): write them with complementarity constraints, min, max or abs"
    ))
}

struct Reader<'a> {
    problem: Problem,
    header: Header,
    source: Source<'a>,
}

impl Reader<'_> {
    fn segment(&mut self, key: u8) -> Result<()> {
        let (n_vars, n_cons, n_objs) = (self.header.n_vars, self.header.n_cons, self.header.n_objs);
        let Reader { problem, source, .. } = self;
        match key {
            b'C' => {
                let i = source.index("the number of a constraint", n_cons)?;
                problem.constraints[i].nonlinear = Some(problem.forest.read(source, n_vars)?);
            }
            b'O' => {
                let i = source.index("the number of an objective", n_objs)?;
                problem.objectives[i].maximise = match source.int("0 to minimise or 1 to maximise")? {
                    0 => false,
                    1 => true,
                    other => return Err(source.fault(format_args!("expected 0 or 1 for the sense, found {other}"))),
                };
                problem.objectives[i].body.nonlinear = Some(problem.forest.read(source, n_vars)?);
            }
            b'L' => return Err(logical(1)),
            b'V' => self.defined()?,
            b'F' => self.function()?,
            b'r' => self.rows()?,
            b'b' => self.bounds()?,
            b'J' => {
                let i = source.index("the number of a constraint", n_cons)?;
                problem.constraints[i].linear = terms(source, n_vars)?;
            }
            b'G' => {
                let i = source.index("the number of an objective", n_objs)?;
                problem.objectives[i].body.linear = terms(source, n_vars)?;
            }
            b'k' | b'K' => {
                for _ in 0..source.count("a number of columns")? {
                    source.count("a number of entries of columns")?;
                }
            }
            b'x' => {
                for _ in 0..source.count("a number of starting values")? {
                    let j = source.index("the number of a variable", n_vars)?;
                    problem.start[j] = source.finite("a starting value")?;
                }
            }
            b'd' => {
                for _ in 0..source.count("a number of dual values")? {
                    source.index("the number of a constraint", n_cons)?;
                    source.finite("a dual value")?;
                }
            }
            b'S' => self.suffix()?,
            other => return Err(source.strange("a segment: one of C O V F L r b k K J G x d S", other)),
        }
        Ok(())
    }

    fn defined(&mut self) -> Result<()> {
        let (n_vars, n_defined) = (self.header.n_vars, self.header.n_defined);
        let Reader { problem, source, .. } = self;
        let j = source.index("the number of a defined variable", n_vars + n_defined)?;
        let Some(k) = j.checked_sub(n_vars) else {
            return Err(
                source.fault(format_args!("the number of a defined variable is {j}: it must be {n_vars} at least"))
            );
        };
        let n = source.count("a number of linear terms")?;
        source.int("the constraint the defined variable is for")?;
        let linear = some_terms(source, n_vars, n)?;
        let nonlinear = problem.forest.read(source, n_vars)?;
        problem.forest.define(k, nonlinear, &linear)
    }

    fn function(&mut self) -> Result<()> {
        let source = &mut self.source;
        source.index("the number of a function", self.header.n_functions)?;
        source.int("the kind of a function")?;
        source.int("a number of arguments")?;
        self.problem.functions.push(source.name("the name of a function")?);
        Ok(())
    }

    fn suffix(&mut self) -> Result<()> {
        let source = &mut self.source;
        let kind = source.index("the kind of a suffix", 8)?;
        let n = source.count("a number of values of a suffix")?;
        source.name("the name of a suffix")?;
        let limit = match kind & 3 {
            0 => self.header.n_vars,
            1 => self.header.n_cons,
            2 => self.header.n_objs,
            _ => 1,
        };
        for _ in 0..n {
            source.index("the number of what has a suffix", limit)?;
            match kind & 4 {
                0 => source.int("the value of a suffix").map(|_| ())?,
                _ => source.real("the value of a suffix").map(|_| ())?,
            }
        }
        Ok(())
    }

    fn rows(&mut self) -> Result<()> {
        let (n_vars, n_cons) = (self.header.n_vars, self.header.n_cons);
        let Reader { problem, source, .. } = self;
        problem.rows.clear();
        for _ in 0..n_cons {
            let kind = source.letter("bounds of a constraint")?;
            let row = match kind {
                b'5' => {
                    let flags = source.index("the flags of a complementarity constraint", 4)?;
                    let j = source.count("the variable of a complementarity constraint")?;
                    let variable = j.checked_sub(1).filter(|j| *j < n_vars).ok_or_else(|| {
                        source.fault(format_args!("a constraint complements variable {j}, outside 1..{n_vars}"))
                    })?;
                    Row::Complements { variable, lower: flags & 1 != 0, upper: flags & 2 != 0 }
                }
                kind => {
                    let (l, u) = interval(source, kind, "a constraint")?;
                    Row::Within(l, u)
                }
            };
            problem.rows.push(row);
        }
        Ok(())
    }

    fn bounds(&mut self) -> Result<()> {
        let Reader { problem, source, header } = self;
        problem.bounds.clear();
        for _ in 0..header.n_vars {
            let kind = source.letter("bounds of a variable")?;
            problem.bounds.push(interval(source, kind, "a variable")?);
        }
        Ok(())
    }
}

/// Bounds that are infinite where the solver takes them for absent.
fn interval(source: &mut Source, kind: u8, what: &str) -> Result<(f64, f64)> {
    let inf = f64::INFINITY;
    let mut bound = |what| source.real(what).map(|v| if v.abs() >= INFINITE { v.signum() * inf } else { v });
    match kind {
        b'0' => Ok((bound("a lower bound")?, bound("an upper bound")?)),
        b'1' => Ok((-inf, bound("an upper bound")?)),
        b'2' => Ok((bound("a lower bound")?, inf)),
        b'3' => Ok((-inf, inf)),
        b'4' => {
            let v = source.finite("a value")?;
            Ok((v, v))
        }
        other => Err(source.strange(&format!("the kind of bounds of {what}"), other)),
    }
}

fn terms(source: &mut Source, n_vars: usize) -> Result<Vec<(usize, f64)>> {
    let n = source.count("a number of terms")?;
    some_terms(source, n_vars, n)
}

/// Linear terms, without those whose factor is zero: a file lists all variables of a nonlinear part.
fn some_terms(source: &mut Source, n_vars: usize, n: usize) -> Result<Vec<(usize, f64)>> {
    let mut terms = Vec::new();
    for _ in 0..n {
        let j = source.index("the number of a variable", n_vars)?;
        let a = source.finite("a factor")?;
        if a != 0.0 {
            terms.push((j, a));
        }
    }
    Ok(terms)
}
