//! The inertia matrix in blocks: velocities that no entry couples are solved apart.

use crate::func::{EvalError, EvalResult, Point};
use crate::linalg::cholesky;
use crate::linalg::forest::{join, root};
use crate::system::{Inertia, Mechanics};

/// A factored inertia matrix: the lower factors of Cholesky of its blocks, one after the other, row-major.
pub(super) struct Blocks {
    /// Block of every velocity, and its place in it.
    pub(super) of: Vec<usize>,
    place: Vec<usize>,
    /// Velocities of block `b`: `members[start[b]..start[b + 1]]`.
    start: Vec<usize>,
    members: Vec<usize>,
    /// Where the factor of block `b` begins.
    offset: Vec<usize>,
    factors: Vec<f64>,
    /// The whole matrix, where it varies.
    matrix: Vec<f64>,
    scratch: Vec<f64>,
}

impl Blocks {
    /// Blocks of the entries that can differ from zero; a constant matrix is factored. None if that one is not positive
    /// definite.
    pub(super) fn new(m: &Mechanics) -> Option<Blocks> {
        let n = m.n_v;
        let mut forest: Vec<usize> = (0..n).collect();
        let mut couple = |i: usize, j: usize| join(&mut forest, i, j);
        match &m.inertia {
            Inertia::Identity => {}
            Inertia::Constant(a) => {
                (0..n * n).filter(|&k| a[k] != 0.0).for_each(|k| couple(k / n, k % n));
            }
            // entries that are constant and not zero cannot be told from others before the matrix was evaluated
            Inertia::Varying { .. } => (1..n).for_each(|i| couple(0, i)),
        }
        let roots: Vec<usize> = (0..n).map(|i| root(&mut forest, i)).collect();
        let mut blocks = Blocks {
            of: vec![0; n],
            place: vec![0; n],
            start: vec![0],
            members: Vec::with_capacity(n),
            offset: Vec::new(),
            factors: Vec::new(),
            matrix: Vec::new(),
            scratch: Vec::new(),
        };
        let mut number = vec![usize::MAX; n];
        let mut lists: Vec<Vec<usize>> = Vec::new();
        for i in 0..n {
            let r = roots[i];
            if number[r] == usize::MAX {
                number[r] = lists.len();
                lists.push(Vec::new());
            }
            blocks.of[i] = number[r];
            blocks.place[i] = lists[number[r]].len();
            lists[number[r]].push(i);
        }
        let mut largest = 0;
        for list in &lists {
            blocks.offset.push(blocks.factors.len());
            blocks.factors.resize(blocks.factors.len() + list.len() * list.len(), 0.0);
            blocks.members.extend_from_slice(list);
            blocks.start.push(blocks.members.len());
            largest = largest.max(list.len());
        }
        blocks.scratch = vec![0.0; largest];
        let fine = match &m.inertia {
            Inertia::Identity => {
                blocks.factors.fill(1.0);
                true
            }
            Inertia::Constant(a) => blocks.factorise(a),
            Inertia::Varying { .. } => {
                blocks.matrix = vec![0.0; n * n];
                true
            }
        };
        fine.then_some(blocks)
    }

    /// Velocities of block `b`.
    pub(super) fn members(&self, b: usize) -> &[usize] {
        &self.members[self.start[b]..self.start[b + 1]]
    }

    /// Evaluates and factors the matrix where it varies; [`EvalError::Recoverable`] also where it is not positive definite.
    pub(super) fn load(&mut self, m: &Mechanics, at: &Point, work: &mut [f64]) -> Result<bool, EvalError> {
        let Inertia::Varying { matrix, .. } = &m.inertia else { return Ok(true) };
        let mut a = std::mem::take(&mut self.matrix);
        let r: EvalResult = matrix.value(at, &mut a, work);
        let fine = r.is_ok() && self.factorise(&a);
        self.matrix = a;
        r.map(|()| fine)
    }

    fn factorise(&mut self, a: &[f64]) -> bool {
        let n = self.of.len();
        for b in 0..self.offset.len() {
            let (from, list) = (self.offset[b], &self.members[self.start[b]..self.start[b + 1]]);
            let k = list.len();
            let l = &mut self.factors[from..from + k * k];
            for (r, &i) in list.iter().enumerate() {
                for (c, &j) in list.iter().enumerate() {
                    l[r * k + c] = a[i * n + j];
                }
            }
            if !cholesky::factorise(k, l) {
                return false;
            }
        }
        true
    }

    /// Replaces what stands at the velocities of block `b`, in their order, by the solution.
    pub(super) fn solve_block(&self, b: usize, x: &mut [f64]) {
        cholesky::solve(&self.factors[self.offset[b]..], x);
    }

    /// Replaces `x` by `M⁻¹ x`.
    pub(super) fn solve(&mut self, x: &mut [f64]) {
        let mut scratch = std::mem::take(&mut self.scratch);
        for b in 0..self.offset.len() {
            let list = self.members(b);
            let part = &mut scratch[..list.len()];
            part.iter_mut().zip(list).for_each(|(p, &i)| *p = x[i]);
            self.solve_block(b, part);
            part.iter().zip(list).for_each(|(p, &i)| x[i] = *p);
        }
        self.scratch = scratch;
    }

    /// Place of a velocity in its block.
    pub(super) fn place(&self, i: usize) -> usize {
        self.place[i]
    }
}
