//! Derivatives of the solution of a program with respect to its parameters.

use super::guard::guard;
use super::handle;
use super::mpcc::{swb_mpcc, Program};
use super::raw;
use super::status::swb_status;
use switchback::error::{Error, Result};
use switchback::mpcc::{ParameterTangent, ParameterWeights, Sides};

/// On which sides of a parameter a derivative of a solution holds.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_sides {
    /// On both: the solution is differentiable.
    Both = 0,
    /// Where the parameter rises: a bound or pair is active without a multiplier, and on the other side the derivative is another.
    Rising = 1,
    /// Where it falls, likewise.
    Falling = 2,
    /// On neither: the derivative is not known and is NaN. Active gradients are dependent, or several bounds or pairs are active without
    /// multipliers and do not stay so together.
    Neither = 3,
}

fn number(sides: Sides) -> i32 {
    let sides = match sides {
        Sides::Both => swb_sides::Both,
        Sides::Rising => swb_sides::Rising,
        Sides::Falling => swb_sides::Falling,
        Sides::Neither => swb_sides::Neither,
    };
    sides as i32
}

impl Program {
    fn tangents(&mut self) -> Result<Vec<ParameterTangent>> {
        self.of_solution(|b, bounds| b.solver.parameter_tangents(&mut b.problem, bounds))
    }

    fn weights(&mut self, x: &[f64], objective: f64) -> Result<ParameterWeights> {
        self.of_solution(|b, bounds| b.solver.parameter_vjp(&mut b.problem, bounds, x, objective))
    }
}

unsafe fn write_sides(out: *mut i32, n: i64, sides: impl Iterator<Item = Sides>) -> Result<()> {
    let numbers: Vec<i32> = sides.map(number).collect();
    unsafe { raw::write_slice(out, n, &numbers, "sides") }
}

/// Is an optional array wanted?
fn wanted<T>(p: *mut T, n: i64) -> bool {
    n != 0 || !p.is_null()
}

/// Derivatives of the last solution with respect to all parameters, with the active bounds and sides of pairs as they are. The
/// solution must be exact (SWB_POLISHED_DONE, or solved if there are no pairs). Functions need derivatives by the parameters as well. One
/// factorisation, and a solve for every parameter; swb_mpcc_vjp is faster where one number depends on many parameters.
///
/// A derivative that is returned holds on the sides that are returned with it. Where it is not known it is NaN. Bounds and parameters
/// that were set since the solve are not used.
///
/// @param[out] x         [n_x] np * n, derivatives of the point, those by one parameter together; NULL with n_x 0 if not wanted
/// @param[out] objective [n_objective] np, derivatives of the objective; NULL with n_objective 0 if not wanted
/// @param[out] sides     [n_sides] np, an enum swb_sides each; NULL with n_sides 0 if not wanted
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE without an exact solution, or after pairs or options that are fixed when a program
///         is made have changed; SWB_ERR_NUMERIC if the solution is no isolated minimiser, or if derivatives by the parameters are
///         not those of the functions; SWB_ERR_NONFINITE if a function has no value next to the parameters; SWB_ERR_USER
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_tangents(
    mpcc: *mut swb_mpcc,
    x: *mut f64,
    n_x: i64,
    objective: *mut f64,
    n_objective: i64,
    sides: *mut i32,
    n_sides: i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_mut(mpcc, |p| {
            let (n, np) = (p.n, p.n_params());
            if wanted(x, n_x) {
                raw::check_slice(x, n_x, np * n, "x")?;
            }
            if wanted(objective, n_objective) {
                raw::check_slice(objective, n_objective, np, "objective")?;
            }
            if wanted(sides, n_sides) {
                raw::check_slice(sides, n_sides, np, "sides")?;
            }
            let found = p.tangents()?;
            if wanted(x, n_x) {
                let all: Vec<f64> = found.iter().flat_map(|t| t.x.iter().copied()).collect();
                raw::write_slice(x, n_x, &all, "x")?;
            }
            if wanted(objective, n_objective) {
                let all: Vec<f64> = found.iter().map(|t| t.objective).collect();
                raw::write_slice(objective, n_objective, &all, "objective")?;
            }
            if wanted(sides, n_sides) {
                write_sides(sides, n_sides, found.iter().map(|t| t.sides))?;
            }
            Ok(())
        })
    })
}

/// The derivative of the last solution with respect to its parameters from the left: the weights p of the parameters for weights x of
/// the point and objective of the objective, which are derivatives of a number that depends on both (a vector-Jacobian product).
/// Conditions are those of swb_mpcc_get_tangents. One solve with the factorised matrix for all parameters where the solution is
/// differentiable, and one for each where it is not.
///
/// @param[in]  x         [n_x] n, weights of the point; NULL with n_x 0 for zeros
/// @param[in]  objective weight of the objective
/// @param[out] p         [n_p] np; NaN where the derivative is not known
/// @param[out] sides     [n_sides] np, an enum swb_sides each; NULL with n_sides 0 if not wanted
/// @return as swb_mpcc_get_tangents; SWB_ERR_RANGE if a weight is not finite
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_vjp(
    mpcc: *mut swb_mpcc,
    x: *const f64,
    n_x: i64,
    objective: f64,
    p: *mut f64,
    n_p: i64,
    sides: *mut i32,
    n_sides: i64,
) -> swb_status {
    guard(|| unsafe {
        let given = raw::slice(x, n_x, "x")?;
        handle::with_mut(mpcc, |program| {
            let zeros = vec![0.0; if given.is_empty() { program.n } else { 0 }];
            let given = if given.is_empty() { &zeros } else { given };
            switchback::error::finite("weight of the point", given, program.n)?;
            switchback::error::finite("weight of the objective", &[objective], 1)?;
            raw::check_slice(p, n_p, program.n_params(), "p")?;
            if wanted(sides, n_sides) {
                raw::check_slice(sides, n_sides, program.n_params(), "sides")?;
            }
            let found = program.weights(given, objective)?;
            raw::write_slice(p, n_p, &found.p, "p")?;
            if wanted(sides, n_sides) {
                write_sides(sides, n_sides, found.sides.iter().copied())?;
            }
            Ok(())
        })
    })
}

/// What has changed since the solution was found.
pub(super) fn changed() -> Error {
    Error::State("the program has other pairs or options than at its last solve: solve it again first".into())
}
