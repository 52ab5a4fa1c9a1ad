//! Functions the user supplies: values, Jacobian and Hessian of a weighted sum with fixed sparse patterns.
//!
//! Everything a model consists of (vector fields, switching functions, costs, constraints) is a
//! [`Function`] of a [`Point`]. The inputs are the blocks `x`, `u`, `p` and the time `t`; derivative
//! patterns number them in this order, `n_in = nx + nu + np + 1`. This layer knows neither time
//! stepping nor optimisation.

mod callback;
#[allow(unsafe_code)]
pub mod casadi;
mod check;
mod fdiff;
mod kinked;
pub mod trouble;

pub use callback::Callback;
pub use check::{check_derivatives, CheckReport, CheckSettings, Mismatch, MismatchKind};
pub use kinked::{Kinked, Maximum};

use std::ops::Range;

use crate::linalg::csc::Pattern;

/// Sizes of the input blocks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dims {
    /// States (or the variables of a generic optimisation problem).
    pub x: usize,
    /// Controls.
    pub u: usize,
    /// Parameters.
    pub p: usize,
}

impl Dims {
    /// Columns of the derivative patterns: `x`, `u`, `p`, then `t`.
    #[inline]
    pub fn n_in(&self) -> usize {
        self.x + self.u + self.p + 1
    }
    /// Column of the time.
    #[inline]
    pub fn t_col(&self) -> usize {
        self.x + self.u + self.p
    }
}

/// Inputs of a function; the slices have the lengths of [`Dims`].
#[derive(Debug, Clone, Copy)]
pub struct Point<'a> {
    /// Time.
    pub t: f64,
    /// States, or variables.
    pub x: &'a [f64],
    /// Controls.
    pub u: &'a [f64],
    /// Parameters.
    pub p: &'a [f64],
}

/// Why a function has no value at a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EvalError {
    /// Not defined here (positive code of a callback, or a value that is not finite): a shorter step may help.
    Recoverable,
    /// Negative code of a callback: stop.
    Fatal(i32),
    /// The call is to end, see [`crate::stop`]: nothing is known of the point.
    Stopped,
}

/// Result of one evaluation.
pub type EvalResult = std::result::Result<(), EvalError>;

/// Outputs of several functions that are evaluated at the same points, see [`Function::bundle`]. It has memory of its own.
pub trait Bundle: Send {
    /// The point at which parts are evaluated from here on.
    fn move_to(&mut self, at: &Point);
    /// The point with another value of one input, by its number in the order `x`, `u`, `p`, `t`.
    fn set_input(&mut self, input: usize, value: f64);
    /// Operations that many outputs have in common, which every point costs.
    fn common_operations(&self) -> usize;
    /// Writes a part, by its place in the list that the bundle was made of; false where a value is not finite.
    fn evaluate(&mut self, part: usize, out: &mut [f64]) -> bool;
    /// Prepares to evaluate parts together: every part with the place of its first output.
    fn list(&self, parts: &mut dyn Iterator<Item = (usize, usize)>, to: &mut PartList);
    /// Takes parts out of a list, and others into it.
    fn exchange(&self, gone: &[(usize, usize)], new: &[(usize, usize)], list: &mut PartList);
    /// Writes the parts of a list; false where a value is not finite.
    fn evaluate_list(&mut self, list: &PartList, out: &mut [f64]) -> bool;
    /// Number of operations of a part, and whether there are so many like it that together they cost less.
    fn operations(&self, part: usize) -> (usize, bool);
}

/// Points that an instruction does the same for at once.
pub const LANES: usize = 8;

/// One number at [`LANES`] points.
pub type Lanes = [f64; LANES];

/// Parts of a [`Bundle`] that are evaluated together, by what they have in common.
#[derive(Debug, Clone, Default)]
pub struct PartList {
    /// Groups of parts that do the same.
    pub groups: Vec<PartGroup>,
    /// The values of parts without inputs stand where they go since the list was evaluated last.
    pub constants_known: bool,
}

/// Parts that do the same with other inputs and constants.
#[doc(hidden)]
#[derive(Debug, Clone, Default)]
pub struct PartGroup {
    /// Place among the parts like it, place of the first output, number of the part.
    pub parts: Vec<[u32; 3]>,
    /// Where the inputs are, and the constants, of a few parts at a time: one input of all of these after the other.
    pub inputs: Vec<u32>,
    /// Laid out like the inputs.
    pub constants: Vec<f64>,
    /// Of every input, and of the results, of as many parts: the first place, where the others follow it.
    pub runs: Vec<Option<u32>>,
}

/// A vector function with first and second derivatives.
///
/// Implementations are immutable and may be called from several threads at once, unless they are
/// [serial](Function::is_serial); what they need to write is the workspace of length [`Function::work_len`] that the
/// caller owns. Outputs are written in
/// full on success and hold only finite values.
pub trait Function: Send + Sync {
    /// Name used in messages, e.g. `"f0"`.
    fn name(&self) -> &str;
    /// Input blocks.
    fn dims(&self) -> Dims;
    /// Length of the value.
    fn n_out(&self) -> usize;
    /// Pattern of the Jacobian, `n_out × n_in`.
    fn jac_pattern(&self) -> &Pattern;
    /// Pattern of the Hessian of a weighted sum of the outputs, `n_in × n_in`, upper triangle.
    fn hess_pattern(&self) -> &Pattern;
    /// Length of the workspace the evaluations need.
    fn work_len(&self) -> usize;
    /// Value, `out[n_out]`.
    fn value(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult;
    /// Jacobian, `out[jac_pattern().nnz()]` in CSC order.
    fn jacobian(&self, at: &Point, out: &mut [f64], work: &mut [f64]) -> EvalResult;
    /// The outputs `rows` of the value; the other entries of `out[n_out]` are left undefined. Functions of parts that
    /// can be evaluated alone override this: it costs less, and a part that is not defined at the point does not spoil
    /// the others.
    fn value_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let _ = rows;
        self.value(at, out, work)
    }
    /// The entries of the Jacobian that belong to the outputs `rows`; the other entries of `out` are left undefined.
    fn jacobian_rows(&self, at: &Point, rows: Range<usize>, out: &mut [f64], work: &mut [f64]) -> EvalResult {
        let _ = rows;
        self.jacobian(at, out, work)
    }
    /// [`Function::jacobian_rows`] at [`LANES`] points at once: input `j`, in the order `x`, `u`, `p`, `t`, of point `k` is
    /// `inputs[j][k]`, and entry `e` is written to `out[e][k]`, finite or not; `work` has the length of the workspace. None
    /// where one point after the other costs no more.
    fn jacobian_lanes(
        &self,
        rows: Range<usize>,
        inputs: &[Lanes],
        out: &mut [Lanes],
        work: &mut [Lanes],
    ) -> Option<EvalResult> {
        let _ = (rows, inputs, out, work);
        None
    }
    /// `Σ_i weights[i] ∇² f_i`, `out[hess_pattern().nnz()]` in CSC order, upper triangle.
    fn hessian(&self, at: &Point, weights: &[f64], out: &mut [f64], work: &mut [f64]) -> EvalResult;
    /// Bounds of the value over all points between `low` and `high`, the times included: no value lies outside, neither
    /// exactly nor as it is computed. `work` has twice the length [`Function::work_len`]. False where nothing is known, which
    /// functions of expressions do not say.
    fn bounds(&self, low: &Point, high: &Point, out_low: &mut [f64], out_high: &mut [f64], work: &mut [f64]) -> bool {
        let _ = (low, high, out_low, out_high, work);
        false
    }
    /// Is the Hessian the same at all states, controls and times? False where that is not known, which functions of expressions do not say.
    fn hessian_is_constant(&self) -> bool {
        false
    }
    /// The function itself, for who knows its type: documents look for expressions in it.
    fn as_any(&self) -> Option<&dyn std::any::Any> {
        None
    }
    /// The parts of a function with kinks, which only costs may have; none of a smooth one.
    fn kinked(&self) -> Option<&Kinked> {
        None
    }
    /// A program for outputs of several functions, those in a range of each, that costs less than to call one function after
    /// the other; none where there is no such program.
    fn bundle(&self, parts: &[(&dyn Function, Range<usize>)]) -> Option<Box<dyn Bundle>> {
        let _ = parts;
        None
    }
    /// True where the function may only be called by the thread that called the library, one call at a time: whoever
    /// would work on several threads works on one then. Functions made of others are serial if one of these is.
    fn is_serial(&self) -> bool {
        false
    }
    /// True where [`Function::jacobian`] is finite differences.
    fn jacobian_is_approximate(&self) -> bool {
        false
    }
    /// True where [`Function::hessian`] is finite differences.
    fn hessian_is_approximate(&self) -> bool {
        false
    }
}
