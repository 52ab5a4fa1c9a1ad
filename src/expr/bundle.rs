//! Parts of several functions in one program: inputs are loaded once, and parts that are needed together cost no more than
//! their arithmetic.
//!
//! A hundred joints with friction are a hundred times the same few operations with other inputs and constants. Parts of the
//! same [`Shape`] are evaluated side by side, every operation for [`LANES`] of them at once, which is vectorised; the results
//! are those of one after the other, to the last bit. What many outputs of one function have in common is computed once.

use std::collections::HashMap;
use std::ops::Range;

use super::function::ExprFunction;
use super::op::powi;
use super::snippet::{Place, Shape, Snippet};
use super::sums::Sums;
use super::tape::{Code, Instruction, LANES};
use super::Piecewise;
use crate::func::{Bundle, Function, PartGroup, PartList, Point};

/// Fewer parts than these are evaluated one by one.
const FEWEST: usize = LANES / 2;

/// Numbers of several parts.
type Lanes = [f64; LANES];

/// Parts of the same shape.
struct Class {
    shape: Shape,
    /// Inputs of one part after the other.
    inputs: Vec<u32>,
    /// Constants of one part after the other.
    constants: Vec<f64>,
    /// Number of parts.
    members: u32,
}

/// One part.
struct Part {
    code: Range<usize>,
    outputs: Range<usize>,
    class: u32,
    /// Its place in the class.
    member: u32,
}

/// Parts as they are put together: what is common to outputs of one function, and what has its results as inputs.
#[derive(Default)]
struct Draft {
    common: Vec<Snippet>,
    n_common: u32,
    parts: Vec<Snippet>,
}

/// The program. Its workspace holds all inputs in the order `x`, `u`, `p`, `t`, what is common to outputs, all constants, then
/// the results of the operations of one part after the other, and 1.
pub(super) struct Program {
    work: Vec<f64>,
    piecewise: Vec<Piecewise>,
    code: Sums,
    outputs: Vec<u32>,
    parts: Vec<Part>,
    classes: Vec<Class>,
    lanes: Vec<Lanes>,
    /// The parts that compute what is common to others come behind those that were asked for; where the results go.
    common: Vec<(usize, Range<usize>)>,
    common_known: bool,
}

impl Program {
    /// Of outputs of functions; none where one of them is no expression, decomposes matrices or calls others.
    pub(super) fn new(parts: &[(&dyn Function, Range<usize>)]) -> Option<Program> {
        let mut p = Program {
            work: Vec::new(),
            piecewise: Vec::new(),
            code: Sums::default(),
            outputs: Vec::new(),
            parts: Vec::new(),
            classes: Vec::new(),
            lanes: Vec::new(),
            common: Vec::new(),
            common_known: false,
        };
        let dims = parts.first()?.0.dims();
        let Draft { common, n_common, parts: mut snippets } = p.snippets(dims.n_in(), parts)?;
        let mut first = dims.n_in();
        for c in common {
            let n = c.outputs.len();
            p.common.push((snippets.len(), first..first + n));
            snippets.push(c);
            first += n;
        }
        if parts.iter().any(|(f, _)| f.dims() != dims) {
            return None;
        }
        let n_constants: usize = snippets.iter().map(Snippet::constants).sum();
        let longest = snippets.iter().map(|s| s.operations.len()).max().unwrap_or(0);
        let registers = dims.n_in() + n_common as usize + n_constants;
        u32::try_from(registers + longest + 1).ok()?;
        // the last one is for sums
        p.work = vec![0.0; registers + longest];
        p.work.push(1.0);
        let mut constants = dims.n_in() + n_common as usize;
        let mut known = HashMap::new();
        for s in &snippets {
            let (class, member) = p.classify(s, &mut known);
            p.append(s, &mut constants, registers, (class, member));
        }
        p.lanes = vec![[0.0; LANES]; p.classes.iter().map(Class::len).max().unwrap_or(0)];
        Some(p)
    }

    /// The parts, one by one; a tape that several are taken from is read once.
    fn snippets(&mut self, n_in: usize, parts: &[(&dyn Function, Range<usize>)]) -> Option<Draft> {
        let mut whole: Option<(*const (), Snippet)> = None;
        let mut all = Draft::default();
        for (f, rows) in parts {
            let own: &ExprFunction = (*f).as_any()?.downcast_ref()?;
            if let Some(t) = own.tape_of(rows) {
                all.parts.push(Snippet::of(t, self.piecewise.len() as u32)?);
                self.piecewise.extend(t.piecewise.iter().cloned());
                continue;
            }
            let name = std::ptr::from_ref(own).cast::<()>();
            if whole.as_ref().is_none_or(|w| w.0 != name) {
                let t = own.value_tape();
                let (common, rest) =
                    Snippet::of(t, self.piecewise.len() as u32)?.without_common(n_in as u32 + all.n_common);
                all.n_common += common.outputs.len() as u32;
                all.common.push(common);
                whole = Some((name, rest));
                self.piecewise.extend(t.piecewise.iter().cloned());
            }
            all.parts.push(whole.as_ref()?.1.part(rows.clone()));
        }
        Some(all)
    }

    /// Puts a part to those of the same shape.
    fn classify(&mut self, s: &Snippet, known: &mut HashMap<Shape, u32>) -> (u32, u32) {
        let (shape, inputs, constants) = s.shape();
        let n = self.classes.len() as u32;
        let class = *known.entry(shape.clone()).or_insert(n);
        if class == n {
            self.classes.push(Class { shape, inputs: Vec::new(), constants: Vec::new(), members: 0 });
        }
        let c = &mut self.classes[class as usize];
        c.inputs.extend(inputs);
        c.constants.extend(constants);
        c.members += 1;
        (class, c.members - 1)
    }

    /// Adds a part whose constants begin at `constants` and whose results begin at `registers`.
    fn append(&mut self, s: &Snippet, constants: &mut usize, registers: usize, (class, member): (u32, u32)) {
        let from = (self.code.steps.len(), self.outputs.len());
        let work = &mut self.work;
        let mut place = |p: Place| -> u32 {
            match p {
                Place::Input(i) => i,
                Place::Result(r) => registers as u32 + r,
                Place::Constant(c) => {
                    work[*constants] = c;
                    *constants += 1;
                    *constants as u32 - 1
                }
            }
        };
        let mut code = Vec::with_capacity(s.operations.len());
        for (k, o) in s.operations.iter().enumerate() {
            let a = place(o.a);
            let b = if o.code.has_two_operands() { place(o.b) } else { o.n };
            code.push(Instruction { code: o.code, dst: (registers + k) as u32, a, b });
        }
        self.outputs.extend(s.outputs.iter().map(|o| place(*o)));
        let one = self.work.len() as u32 - 1;
        self.code.push(&code, &[], &self.outputs[from.1..], one);
        self.parts.push(Part {
            code: from.0..self.code.steps.len(),
            outputs: from.1..self.outputs.len(),
            class,
            member,
        });
    }

    /// Computes what is common to outputs at the present point.
    fn know_common(&mut self) {
        if std::mem::replace(&mut self.common_known, true) {
            return;
        }
        for (part, to) in &self.common {
            let Part { code, outputs, .. } = &self.parts[*part];
            let w = &mut self.work[..];
            self.code.run(&self.code.steps[code.clone()], w, &[], &self.piecewise);
            for (to, &from) in to.clone().zip(&self.outputs[outputs.clone()]) {
                w[to] = w[from as usize];
            }
        }
    }

    /// Evaluates at most `LANES` parts of a class: those of a group from number `at` on.
    fn evaluate_lanes(&mut self, class: usize, group: &PartGroup, at: usize, out: &mut [f64]) -> bool {
        let c = &self.classes[class];
        let (n_inputs, n_constants) = (c.shape.n_inputs as usize, c.shape.n_constants as usize);
        let own = &group.parts[at..group.parts.len().min(at + LANES)];
        let runs = &group.runs[at / LANES * (n_inputs + 1)..][..n_inputs + 1];
        let (work, lanes) = (&self.work[..], &mut self.lanes[..]);
        let inputs = group.inputs[at * n_inputs..].chunks_exact(LANES);
        for ((to, from), run) in lanes[..n_inputs].iter_mut().zip(inputs).zip(runs) {
            match run {
                Some(first) => to.copy_from_slice(&work[*first as usize..*first as usize + LANES]),
                None => to.iter_mut().zip(from).for_each(|(to, &i)| *to = work[i as usize]),
            }
        }
        let constants = group.constants[at * n_constants..].chunks_exact(LANES);
        for (to, from) in lanes[n_inputs..n_inputs + n_constants].iter_mut().zip(constants) {
            to.copy_from_slice(from);
        }
        for (k, &(code, a, b, n)) in c.shape.operations.iter().enumerate() {
            let (known, own) = lanes.split_at_mut(n_inputs + n_constants + k);
            operate(code, (&known[a as usize], &known[b as usize]), n, &self.piecewise, &mut own[0]);
        }
        let mut zero = [0.0; LANES];
        for (o, &from) in c.shape.outputs.iter().enumerate() {
            let v = &lanes[from as usize];
            zero.iter_mut().zip(v).for_each(|(z, v)| *z += v * 0.0);
            match runs[n_inputs] {
                Some(first) => out[first as usize..first as usize + LANES].copy_from_slice(v),
                None => v.iter().zip(own).for_each(|(v, m)| out[m[1] as usize + o] = *v),
            }
        }
        zero.iter().sum::<f64>() == 0.0
    }
}

/// One operation for all lanes; a loop each, so that it is vectorised.
#[inline(always)]
fn operate(code: Code, (a, b): (&Lanes, &Lanes), n: u32, tables: &[Piecewise], to: &mut Lanes) {
    let each = |to: &mut Lanes, f: &dyn Fn(f64) -> f64| to.iter_mut().zip(a).for_each(|(to, a)| *to = f(*a));
    match code {
        Code::Add | Code::AddConstant => (0..LANES).for_each(|l| to[l] = a[l] + b[l]),
        Code::Sub | Code::ConstantMinus => (0..LANES).for_each(|l| to[l] = a[l] - b[l]),
        Code::Mul | Code::Scale => (0..LANES).for_each(|l| to[l] = a[l] * b[l]),
        Code::Div | Code::ConstantOver => (0..LANES).for_each(|l| to[l] = a[l] / b[l]),
        Code::Neg => (0..LANES).for_each(|l| to[l] = -a[l]),
        Code::Square => (0..LANES).for_each(|l| to[l] = a[l] * a[l]),
        Code::Sqrt => (0..LANES).for_each(|l| to[l] = a[l].sqrt()),
        Code::Pow => (0..LANES).for_each(|l| to[l] = a[l].powf(b[l])),
        Code::Atan2 => (0..LANES).for_each(|l| to[l] = a[l].atan2(b[l])),
        Code::Unary(op) => each(to, &|a| op.eval(a)),
        Code::PowI => each(to, &|a| powi(a, n as i32)),
        Code::Piecewise => each(to, &|a| tables[(n >> 4) as usize].eval((n & 15) as u8, a)),
        Code::Block => *to = *a,
    }
}

/// The first of some places, where each follows the one before.
fn follow(mut places: impl Iterator<Item = u32>) -> Option<u32> {
    let first = places.next()?;
    places.zip(first + 1..).all(|(p, expected)| p == expected).then_some(first)
}

impl Class {
    /// Where the inputs of the parts of a group are, and their constants; idle lanes repeat the last part.
    fn gather(&self, g: &mut PartGroup) {
        let (n_inputs, n_constants) = (self.shape.n_inputs as usize, self.shape.n_constants as usize);
        let n = g.parts.len().next_multiple_of(LANES);
        g.inputs.resize(n * n_inputs, 0);
        g.constants.resize(n * n_constants, 0.0);
        g.runs.resize(n / LANES * (n_inputs + 1), None);
        (0..n).for_each(|l| self.gather_lane(g, l));
        (0..n / LANES).for_each(|chunk| self.find_runs(g, chunk));
    }

    /// The same for the part in one place.
    fn gather_lane(&self, g: &mut PartGroup, l: usize) {
        let (n_inputs, n_constants) = (self.shape.n_inputs as usize, self.shape.n_constants as usize);
        let member = g.parts[l.min(g.parts.len() - 1)][0] as usize;
        let (chunk, lane) = (l / LANES * LANES, l % LANES);
        let own = &self.inputs[member * n_inputs..(member + 1) * n_inputs];
        own.iter().enumerate().for_each(|(k, i)| g.inputs[chunk * n_inputs + k * LANES + lane] = *i);
        let own = &self.constants[member * n_constants..(member + 1) * n_constants];
        own.iter().enumerate().for_each(|(k, v)| g.constants[chunk * n_constants + k * LANES + lane] = *v);
    }

    /// Finds the inputs and results of a few parts that follow each other: they are read and written at once.
    fn find_runs(&self, g: &mut PartGroup, chunk: usize) {
        let n_inputs = self.shape.n_inputs as usize;
        let own = &g.parts[chunk * LANES..g.parts.len().min((chunk + 1) * LANES)];
        for k in 0..n_inputs {
            let places = &g.inputs[(chunk * n_inputs + k) * LANES..][..LANES];
            g.runs[chunk * (n_inputs + 1) + k] = follow(places.iter().copied());
        }
        let single = own.len() == LANES && self.shape.outputs.len() == 1;
        g.runs[chunk * (n_inputs + 1) + n_inputs] = if single { follow(own.iter().map(|m| m[1])) } else { None };
    }

    /// Brings a group up to date whose parts have changed at place `l`, or at its end.
    fn gather_again(&self, g: &mut PartGroup, l: usize) {
        if g.parts.len() < FEWEST {
            return;
        }
        let n = g.parts.len().next_multiple_of(LANES);
        // a shape may have no inputs, or no constants
        let needed = [n * self.shape.n_inputs as usize, n * self.shape.n_constants as usize];
        if [g.inputs.len(), g.constants.len()] != needed {
            return self.gather(g);
        }
        g.runs.resize(n / LANES * (self.shape.n_inputs as usize + 1), None);
        std::iter::once(l).chain(n - LANES..n).for_each(|l| self.gather_lane(g, l));
        [l.min(n - 1) / LANES, n / LANES - 1].into_iter().for_each(|chunk| self.find_runs(g, chunk));
    }

    /// Lanes that it needs.
    fn len(&self) -> usize {
        (self.shape.n_inputs + self.shape.n_constants) as usize + self.shape.operations.len()
    }
}

impl Bundle for Program {
    fn move_to(&mut self, at: &Point) {
        let mut to = &mut self.work[..];
        for block in [at.x, at.u, at.p, &[at.t]] {
            let (own, rest) = to.split_at_mut(block.len());
            own.copy_from_slice(block);
            to = rest;
        }
        self.common_known = self.common.is_empty();
    }

    fn set_input(&mut self, input: usize, value: f64) {
        self.work[input] = value;
        self.common_known = self.common.is_empty();
    }

    fn common_operations(&self) -> usize {
        self.common.iter().map(|(part, _)| self.parts[*part].code.len()).sum()
    }

    fn evaluate(&mut self, part: usize, out: &mut [f64]) -> bool {
        self.know_common();
        let Part { code, outputs, .. } = &self.parts[part];
        let w = &mut self.work[..];
        self.code.run(&self.code.steps[code.clone()], w, &[], &self.piecewise);
        let mut finite = true;
        for (v, &o) in out.iter_mut().zip(&self.outputs[outputs.clone()]) {
            *v = w[o as usize];
            finite &= v.is_finite();
        }
        finite
    }

    fn list(&self, parts: &mut dyn Iterator<Item = (usize, usize)>, to: &mut PartList) {
        to.constants_known = false;
        to.groups.resize(self.classes.len(), PartGroup::default());
        to.groups.iter_mut().for_each(|g| g.parts.clear());
        for (part, at) in parts {
            let p = &self.parts[part];
            to.groups[p.class as usize].parts.push([p.member, at as u32, part as u32]);
        }
        for (c, g) in self.classes.iter().zip(&mut to.groups).filter(|(_, g)| g.parts.len() >= FEWEST) {
            c.gather(g);
        }
    }

    fn exchange(&self, gone: &[(usize, usize)], new: &[(usize, usize)], list: &mut PartList) {
        list.constants_known = false;
        for &(part, at) in gone {
            let p = &self.parts[part];
            let g = &mut list.groups[p.class as usize];
            let Some(l) = g.parts.iter().position(|q| *q == [p.member, at as u32, part as u32]) else { continue };
            g.parts.swap_remove(l);
            self.classes[p.class as usize].gather_again(g, l);
        }
        for &(part, at) in new {
            let p = &self.parts[part];
            let g = &mut list.groups[p.class as usize];
            g.parts.push([p.member, at as u32, part as u32]);
            self.classes[p.class as usize].gather_again(g, g.parts.len() - 1);
        }
    }

    fn evaluate_list(&mut self, list: &PartList, out: &mut [f64]) -> bool {
        self.know_common();
        let mut finite = true;
        for (class, group) in list.groups.iter().enumerate() {
            if list.constants_known && self.classes[class].shape.n_inputs == 0 {
                continue;
            }
            let mut at = 0;
            while group.parts.len() - at >= FEWEST {
                finite &= self.evaluate_lanes(class, group, at, out);
                at = group.parts.len().min(at + LANES);
            }
            for &[_, at, part] in &group.parts[at..] {
                let n = self.parts[part as usize].outputs.len();
                finite &= self.evaluate(part as usize, &mut out[at as usize..at as usize + n]);
            }
        }
        finite
    }

    fn operations(&self, part: usize) -> (usize, bool) {
        let p = &self.parts[part];
        (p.code.len(), self.classes[p.class as usize].members >= LANES as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expr::Graph;
    use crate::func::Dims;

    #[test]
    fn parts_have_the_values_of_their_functions_to_the_last_bit() {
        let d = Dims { x: 3, u: 1, p: 1 };
        let g = Graph::new();
        let (x, u, p, t) = (|i| g.x(i), g.u(0), g.p(0), g.t());
        let smooth = [x(0) * x(1) + u.sin(), (x(2) - 2.0) * t / (p + 3.0), g.constant(0.25)];
        let a = g.function("a", d, &smooth).unwrap();
        let b = g.function("b", d, &[x(1).powi(3).exp(), 7.0 * x(2)]).unwrap();
        let parts: [(&dyn Function, Range<usize>); 4] = [(&a, 0..3), (&b, 0..2), (&a, 1..2), (&b, 1..2)];
        let mut program = Program::new(&parts).unwrap();
        for s in 0..3 {
            let v = |i: usize| (0.3 + f64::from(s) + i as f64).sin();
            let (xs, us, ps) = ([v(0), v(1), v(2)], [v(3)], [v(4)]);
            let at = Point { t: v(5), x: &xs, u: &us, p: &ps };
            program.move_to(&at);
            for (k, (f, rows)) in parts.iter().enumerate().rev() {
                let (mut own, mut out) = (vec![0.0; f.n_out()], vec![0.0; rows.len()]);
                f.value(&at, &mut own, &mut vec![0.0; f.work_len()]).unwrap();
                assert!(program.evaluate(k, &mut out));
                assert_eq!(own[rows.clone()], out);
            }
        }
    }

    #[test]
    fn parts_of_the_same_shape_side_by_side_are_those_one_by_one() {
        const N: usize = 21;
        let d = Dims { x: N + 1, u: 0, p: 0 };
        let g = Graph::new();
        let x = |i: usize| g.x(i);
        let output = |i: usize| (0.3 + i as f64) / (1.0 + 2.5 * x(i) * x(i)) - x(i + 1).powi(3).sin() - 0.7;
        let all: Vec<_> = (0..N).map(output).collect();
        let f = g.function("f", d, &all).unwrap();
        let parts: Vec<(&dyn Function, Range<usize>)> = (0..N).map(|i| (&f as &dyn Function, i..i + 1)).collect();
        let mut program = Program::new(&parts).unwrap();
        assert!(program.classes.iter().any(|c| c.members as usize >= N - 1));
        let xs: Vec<f64> = (0..=N).map(|i| (1.3 * i as f64).cos()).collect();
        let at = Point { t: 0.0, x: &xs, u: &[], p: &[] };
        let (mut own, mut out) = (vec![0.0; N], vec![0.0; 2 * N]);
        f.value(&at, &mut own, &mut vec![0.0; f.work_len()]).unwrap();
        program.move_to(&at);
        for skipped in [usize::MAX, 4, 20] {
            let mut list = PartList::default();
            program.list(&mut (0..N).filter(|i| *i != skipped).map(|i| (i, 2 * i)), &mut list);
            out.fill(7.0);
            assert!(program.evaluate_list(&list, &mut out));
            for i in 0..N {
                assert_eq!(out[2 * i], if i == skipped { 7.0 } else { own[i] });
            }
        }
        let bad = vec![f64::INFINITY; N + 1];
        program.move_to(&Point { x: &bad, ..at });
        let mut list = PartList::default();
        program.list(&mut (0..N).map(|i| (i, i)), &mut list);
        assert!(!program.evaluate_list(&list, &mut out));
    }

    /// Parts that come and go one by one leave the list as if it had been made of those that are there: parts with inputs and constants,
    /// with constants alone, and with inputs alone.
    #[test]
    fn lists_are_changed_part_by_part() {
        const N: usize = 21;
        let d = Dims { x: N + 1, u: 0, p: 0 };
        let g = Graph::new();
        let x = |i: usize| g.x(i);
        let all = 0..N;
        let shapes = [
            all.clone().map(|i| (0.3 + i as f64) / (1.0 + 2.5 * x(i) * x(i)) - 0.7).collect::<Vec<_>>(),
            all.clone().map(|i| g.constant(1.5 * i as f64)).collect(),
            all.map(|i| x(i) * x(i + 1) + x(i)).collect(),
        ];
        for shape in shapes {
            let f = g.function("f", d, &shape).unwrap();
            let parts: Vec<(&dyn Function, Range<usize>)> = (0..N).map(|i| (&f as &dyn Function, i..i + 1)).collect();
            let mut program = Program::new(&parts).unwrap();
            let xs: Vec<f64> = (0..=N).map(|i| (1.3 * i as f64).cos()).collect();
            let at = Point { t: 0.0, x: &xs, u: &[], p: &[] };
            let (mut own, mut out) = (vec![0.0; N], vec![0.0; 2 * N]);
            f.value(&at, &mut own, &mut vec![0.0; f.work_len()]).unwrap();
            program.move_to(&at);
            let mut list = PartList::default();
            program.list(&mut (0..N).map(|i| (i, 2 * i)), &mut list);
            let mut there = [true; N];
            for i in (0..N).chain([3, 17, 4, 20, 9, 0]).chain((0..N).rev()).chain(2..N) {
                there[i] = !there[i];
                let one = [(i, 2 * i)];
                let (gone, new): (&[_], &[_]) = if there[i] { (&[], &one) } else { (&one, &[]) };
                program.exchange(gone, new, &mut list);
                out.fill(7.0);
                assert!(program.evaluate_list(&list, &mut out));
                for k in 0..N {
                    assert_eq!(out[2 * k], if there[k] { own[k] } else { 7.0 });
                }
            }
        }
    }
}
