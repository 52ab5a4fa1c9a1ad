//! Which input is what, and where the entries of the outputs belong.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::object::{Io, Object};
use crate::error::{Error, Result};
use crate::func::{Dims, Point};
use crate::linalg::csc::Pattern;

/// Block of the point that an input is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Block {
    X,
    U,
    P,
    T,
    /// No entries: no dependence.
    Nothing,
}

/// Inputs and outputs of a function.
pub(super) struct Binding {
    name: String,
    dims: Dims,
    /// What the inputs are, with their numbers of entries.
    inputs: Vec<(Block, usize)>,
    /// Numbers of entries of the outputs, structural zeros included.
    outputs: Vec<usize>,
    /// Are outputs given by all entries?
    dense: bool,
}

/// Entries of a derivative: row, column; their place in the results.
type Entries = Vec<(usize, usize)>;

impl Binding {
    pub(super) fn new(f: &Object, dims: Dims, inputs: Option<&str>) -> Result<Binding> {
        let name = &f.name;
        let listed: Option<Vec<&str>> =
            inputs.map(|s| s.split(|c: char| c == ',' || c.is_whitespace()).filter(|s| !s.is_empty()).collect());
        if let Some(l) = listed.as_ref().filter(|l| l.len() != f.inputs.len()) {
            let (given, has) = (l.len(), f.inputs.len());
            return Err(Error::Dimension(format!("{name}: {given} inputs are listed, the function has {has}")));
        }
        let mut blocks = Vec::new();
        for (k, input) in f.inputs.iter().enumerate() {
            let called = listed.as_ref().map(|l| l[k]).or(input.name.as_deref());
            let (block, size) = match called {
                _ if input.numel() == 0 => (Block::Nothing, 0),
                Some("x") => (Block::X, dims.x),
                Some("u") => (Block::U, dims.u),
                Some("p") => (Block::P, dims.p),
                Some("t") => (Block::T, 1),
                _ => {
                    let called = called.map_or("without a name".to_owned(), |n| format!("named '{n}'"));
                    return Err(Error::Range(format!(
                        "{name}: input {k} is {called}: name the inputs x, u, p and t when the function is made, or say \
                         what they are, such as \"x u\""
                    )));
                }
            };
            if block != Block::Nothing && blocks.iter().any(|b: &(Block, usize)| b.0 == block) {
                return Err(Error::Range(format!("{name}: input {k} is '{}' a second time", called.unwrap_or(""))));
            }
            if input.numel() != size {
                return Err(Error::Dimension(format!(
                    "{name}: input {k} ({}) has {} entries, expected {size}",
                    called.unwrap_or(""),
                    input.numel()
                )));
            }
            if !input.is_dense() {
                return Err(Error::Unsupported(format!("{name}: input {k} is sparse: make it of a dense symbol")));
            }
            blocks.push((block, size));
        }
        let outputs: Vec<usize> = f.outputs.iter().map(Io::numel).collect();
        let dense = f.outputs.iter().all(Io::is_dense);
        Ok(Binding { name: name.clone(), dims, inputs: blocks, outputs, dense })
    }

    /// Length of the value.
    pub(super) fn n_out(&self) -> usize {
        self.outputs.iter().sum()
    }

    /// Blocks of the Jacobian.
    pub(super) fn n_blocks(&self) -> usize {
        self.inputs.len() * self.outputs.len()
    }

    fn n_in(&self) -> usize {
        self.inputs.iter().map(|i| i.1).sum()
    }

    /// First column of an input, in the numbering of derivative patterns.
    fn column(&self, input: usize) -> usize {
        match self.inputs[input].0 {
            Block::X | Block::Nothing => 0,
            Block::U => self.dims.x,
            Block::P => self.dims.x + self.dims.u,
            Block::T => self.dims.t_col(),
        }
    }

    /// Columns of all inputs, one after the other.
    fn columns(&self) -> Vec<usize> {
        (0..self.inputs.len()).flat_map(|k| (0..self.inputs[k].1).map(move |j| self.column(k) + j)).collect()
    }

    fn expect(&self, of: &str, what: &str, pattern: &Pattern, (m, n): (usize, usize)) -> Result<()> {
        if (pattern.n_rows(), pattern.n_cols()) == (m, n) {
            return Ok(());
        }
        Err(Error::Dimension(format!(
            "{of}: {what} is {} x {}, expected {m} x {n}",
            pattern.n_rows(),
            pattern.n_cols()
        )))
    }

    /// The first inputs of a derivative are those of the function.
    fn expect_inputs(&self, d: &Object) -> Result<()> {
        let fits = |(k, (_, n)): (usize, &(Block, usize))| {
            d.inputs.get(k).is_some_and(|i| (i.numel() == *n && i.is_dense()) || i.numel() == 0)
        };
        if self.inputs.iter().enumerate().all(fits) {
            return Ok(());
        }
        Err(Error::Dimension(format!("{}: the inputs must begin with those of {}", d.name, self.name)))
    }

    /// Entries of the blocks (output, input), inputs first.
    fn of_blocks(&self, of: &str, blocks: &[&Pattern]) -> Result<Entries> {
        let mut out = Vec::new();
        let mut first_row = 0;
        for (o, &m) in self.outputs.iter().enumerate() {
            for (i, &(_, n)) in self.inputs.iter().enumerate() {
                let block = blocks[o * self.inputs.len() + i];
                self.expect(of, &format!("the block of output {o} and input {i}"), block, (m, n))?;
                out.extend(entries(block).map(|(r, c)| (first_row + r, self.column(i) + c)));
            }
            first_row += m;
        }
        Ok(out)
    }

    /// Pattern of the Jacobian where the values are missing: as declared, or dense in all inputs.
    pub(super) fn jacobian_pattern(&self, declared: Option<Vec<Pattern>>) -> Result<Pattern> {
        let entries = match declared {
            Some(blocks) => self.of_blocks(&self.name, &blocks.iter().collect::<Vec<_>>())?,
            None => self.columns().into_iter().flat_map(|c| (0..self.n_out()).map(move |r| (r, c))).collect(),
        };
        Ok(pattern_of(self.n_out(), self.dims.n_in(), &entries).0)
    }
}

fn entries(p: &Pattern) -> impl Iterator<Item = (usize, usize)> + '_ {
    (0..p.n_cols()).flat_map(|c| p.rows(c).iter().map(move |&r| (r, c)))
}

fn pattern_of(m: usize, n: usize, entries: &Entries) -> (Pattern, Vec<usize>) {
    let (rows, cols): (Vec<usize>, Vec<usize>) = entries.iter().copied().unzip();
    Pattern::from_triplets(m, n, &rows, &cols)
}

/// What an argument is.
#[derive(Debug, Clone, Copy)]
enum Argument {
    Zeros,
    Block(Block),
    /// Weights from here on, so many.
    Weights(usize, usize),
    /// Nonzeros of the value from here on, so many.
    Value(usize, usize),
}

/// Destination of an entry that is not wanted.
const DROP: u32 = u32::MAX;

/// The value, the Jacobian or the Hessian.
pub(super) struct Part {
    object: Arc<Object>,
    arguments: Vec<Argument>,
    /// Where the outputs begin in the results.
    starts: Vec<Option<usize>>,
    /// Place of every result; none if they are in order.
    places: Option<Vec<u32>>,
    n_results: usize,
    /// Whose value is an argument, with where its outputs begin and how many numbers they are.
    value: Option<(Arc<Object>, Vec<Option<usize>>, usize)>,
}

impl Part {
    fn new(
        object: Arc<Object>,
        arguments: Vec<Argument>,
        wanted: &[bool],
        places: Vec<usize>,
        n_entries: usize,
    ) -> Part {
        let mut n_results = 0;
        let mut starts = Vec::new();
        for (output, &wanted) in object.outputs.iter().zip(wanted) {
            starts.push(wanted.then_some(n_results));
            n_results += if wanted { output.pattern.nnz() } else { 0 };
        }
        let in_order = n_results == n_entries && places.iter().enumerate().all(|(k, &p)| k == p);
        let places = (!in_order).then(|| places.iter().map(|&p| u32::try_from(p).unwrap_or(DROP)).collect());
        Part { object, arguments, starts, places, n_results, value: None }
    }

    /// Adds the value of the function as an argument, if an argument asks for it.
    fn with_value(mut self, f: &Arc<Object>) -> Part {
        if self.arguments.iter().any(|a| matches!(a, Argument::Value(_, n) if *n > 0)) {
            let (starts, n) = starts_of(f);
            self.value = Some((f.clone(), starts, n));
        }
        self
    }

    fn blocks(b: &Binding) -> Vec<Argument> {
        b.inputs.iter().map(|&(block, _)| Argument::Block(block)).collect()
    }

    pub(super) fn value(f: &Arc<Object>, b: &Binding) -> Part {
        let mut places = Vec::new();
        let mut first = 0;
        for output in &f.outputs {
            let m = output.pattern.n_rows();
            places.extend(entries(&output.pattern).map(|(r, c)| first + r + m * c));
            first += output.numel();
        }
        Part::new(f.clone(), Part::blocks(b), &vec![true; f.outputs.len()], places, b.n_out())
    }

    pub(super) fn jacobian(j: Object, f: &Arc<Object>, b: &Binding) -> Result<(Part, Pattern)> {
        b.expect_inputs(&j)?;
        let patterns: Vec<&Pattern> = j.outputs.iter().map(|o| &o.pattern).collect();
        let found = if patterns.len() == 1 && (b.n_blocks() != 1 || b.outputs.len() == 1) {
            b.expect(&j.name, "the Jacobian", patterns[0], (b.n_out(), b.n_in()))?;
            let columns = b.columns();
            entries(patterns[0]).map(|(r, c)| (r, columns[c])).collect()
        } else if patterns.len() == b.n_blocks() {
            b.of_blocks(&j.name, &patterns)?
        } else {
            return Err(Error::Dimension(format!(
                "{}: it has {} outputs, expected 1, or {}: one for each output and input of {}",
                j.name,
                patterns.len(),
                b.n_blocks(),
                b.name
            )));
        };
        let mut arguments = Part::blocks(b);
        match j.inputs.len() - b.inputs.len() {
            0 => {}
            n if n == b.outputs.len() => arguments.extend(value_arguments(&j, b.inputs.len(), f)?),
            n => {
                return Err(Error::Dimension(format!(
                    "{}: it has {n} inputs more than {}, expected none, or its {} outputs",
                    j.name,
                    b.name,
                    b.outputs.len()
                )))
            }
        }
        let (pattern, places) = pattern_of(b.n_out(), b.dims.n_in(), &found);
        let wanted = vec![true; patterns.len()];
        let n = pattern.nnz();
        Ok((Part::new(Arc::new(j), arguments, &wanted, places, n).with_value(f), pattern))
    }

    pub(super) fn hessian(h: Object, f: &Arc<Object>, b: &Binding) -> Result<(Part, Pattern)> {
        b.expect_inputs(&h)?;
        let (n_in, n_out) = (b.inputs.len(), b.outputs.len());
        let more = h.inputs.len() - n_in;
        let mut arguments = Part::blocks(b);
        let mut wanted = vec![true; h.outputs.len()];
        let mut found: Entries = Vec::new();
        if more == 1 || more == n_out {
            arguments.extend(weight_arguments(&h, n_in, more, b)?);
            let [output] = h.outputs.as_slice() else {
                return Err(Error::Dimension(format!("{}: it has {} outputs, expected 1", h.name, h.outputs.len())));
            };
            b.expect(&h.name, "the Hessian", &output.pattern, (b.n_in(), b.n_in()))?;
            let columns = b.columns();
            found.extend(entries(&output.pattern).map(|(r, c)| (columns[r], columns[c])));
        } else if more == 2 * n_out + n_in && h.outputs.len() == n_in * (n_in + 2 * n_out) {
            arguments.extend(value_arguments(&h, n_in, f)?);
            arguments.extend(weight_arguments(&h, n_in + n_out, n_out, b)?);
            let solved = h.inputs[n_in + 2 * n_out..].iter().all(|i| i.pattern.nnz() == 0);
            if !solved {
                return Err(Error::Unsupported(format!(
                    "{}: it needs the adjoint derivatives as inputs: make a function hess_{} of the inputs and weights",
                    h.name, b.name
                )));
            }
            arguments.extend(vec![Argument::Zeros; n_in]);
            for (k, output) in h.outputs.iter().enumerate() {
                let (row, column) = (k / (n_in + 2 * n_out), k % (n_in + 2 * n_out));
                wanted[k] = column < n_in;
                if wanted[k] {
                    let shape = (b.inputs[row].1, b.inputs[column].1);
                    b.expect(&h.name, &format!("output {k}"), &output.pattern, shape)?;
                    let first = (b.column(row), b.column(column));
                    found.extend(entries(&output.pattern).map(|(r, c)| (first.0 + r, first.1 + c)));
                }
            }
        } else {
            return Err(Error::Dimension(format!(
                "{}: it has {} inputs, expected the {n_in} of {}, then weights: one vector, or one for each output",
                h.name,
                h.inputs.len(),
                b.name
            )));
        }
        let (pattern, places) = upper(b.dims.n_in(), &found);
        let n = pattern.nnz();
        Ok((Part::new(Arc::new(h), arguments, &wanted, places, n).with_value(f), pattern))
    }

    /// Length of the memory of [`Part::run`].
    pub(super) fn work_len(&self) -> usize {
        let value = self.value.as_ref().map_or(0, |(f, _, n)| n + f.work_len());
        let results = self.places.as_ref().map_or(0, |_| self.n_results);
        results + value + self.object.work_len()
    }

    /// Evaluates into `out`, which is zero. Returns a code for [`crate::func::Callback`]: a failure of CasADi says nothing
    /// about why, it counts as not defined at the point.
    pub(super) fn run(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> i32 {
        let t = [at.t];
        let block = |b: Block| match b {
            Block::X => Some(at.x),
            Block::U => Some(at.u),
            Block::P => Some(at.p),
            Block::T => Some(&t[..]),
            Block::Nothing => None,
        };
        let (values, work) = match &self.value {
            None => (&[][..], work),
            Some((f, starts, n)) => {
                let (values, work) = work.split_at_mut(*n);
                let inputs = |k: usize| match self.arguments[k] {
                    Argument::Block(b) => block(b),
                    _ => None,
                };
                if f.eval(inputs, starts, values, work) != 0 {
                    return 1;
                }
                (&*values, work)
            }
        };
        let argument = |k: usize| match *self.arguments.get(k)? {
            Argument::Zeros => None,
            Argument::Block(b) => block(b),
            Argument::Weights(first, n) => weights.get(first..first + n),
            Argument::Value(first, n) => values.get(first..first + n),
        };
        let Some(places) = &self.places else {
            return i32::from(self.object.eval(argument, &self.starts, out, work) != 0);
        };
        let (results, work) = work.split_at_mut(self.n_results);
        if self.object.eval(argument, &self.starts, results, work) != 0 {
            return 1;
        }
        for (&v, &place) in results.iter().zip(places) {
            if place != DROP {
                out[place as usize] = v;
            }
        }
        0
    }
}

fn starts_of(f: &Object) -> (Vec<Option<usize>>, usize) {
    let mut n = 0;
    let starts = f
        .outputs
        .iter()
        .map(|o| {
            n += o.pattern.nnz();
            Some(n - o.pattern.nnz())
        })
        .collect();
    (starts, n)
}

/// Outputs of the function as inputs of a derivative, from input `first` on; without entries where they are not needed.
fn value_arguments(d: &Object, first: usize, f: &Object) -> Result<Vec<Argument>> {
    let (starts, _) = starts_of(f);
    let argument = |(k, o): (usize, &Io)| {
        let n = d.inputs[first + k].pattern.nnz();
        match n {
            0 => Ok(Argument::Zeros),
            _ if n == o.pattern.nnz() => Ok(Argument::Value(starts[k].unwrap_or(0), n)),
            _ => Err(Error::Dimension(format!(
                "{}: input {} has {n} entries, expected those of output {k} of {}: {}",
                d.name,
                first + k,
                f.name,
                o.pattern.nnz()
            ))),
        }
    };
    f.outputs.iter().enumerate().map(argument).collect()
}

/// Weights of all outputs in one vector, or one for each.
fn weight_arguments(h: &Object, first: usize, n: usize, b: &Binding) -> Result<Vec<Argument>> {
    let sizes = if n == 1 { vec![b.n_out()] } else { b.outputs.clone() };
    let mut start = 0;
    let mut out = Vec::new();
    for (k, size) in sizes.into_iter().enumerate() {
        let input = &h.inputs[first + k];
        if input.pattern.nnz() == 0 {
            // Without second derivatives there is nothing to weigh.
            out.push(Argument::Zeros);
        } else if input.is_dense() && input.numel() == size {
            out.push(Argument::Weights(start, size));
        } else {
            return Err(Error::Dimension(format!(
                "{}: input {} has {} entries, expected {size} weights{}",
                h.name,
                first + k,
                input.pattern.nnz(),
                if b.dense { "" } else { "; make the outputs dense, with densify" }
            )));
        }
        start += size;
    }
    Ok(out)
}

/// Upper triangle of a symmetric matrix given by one triangle or both.
fn upper(n: usize, found: &Entries) -> (Pattern, Vec<usize>) {
    let given: BTreeSet<(usize, usize)> = found.iter().copied().collect();
    let kept: Vec<bool> = found.iter().map(|&(r, c)| r <= c || !given.contains(&(c, r))).collect();
    let mirrored: Entries = found.iter().zip(&kept).filter(|k| *k.1).map(|(&(r, c), _)| (r.min(c), r.max(c))).collect();
    let (pattern, places) = pattern_of(n, n, &mirrored);
    let mut places = places.into_iter();
    let places = kept.iter().map(|&k| if k { places.next().unwrap_or(DROP as usize) } else { DROP as usize }).collect();
    (pattern, places)
}
