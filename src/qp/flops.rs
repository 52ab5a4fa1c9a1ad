//! What a sample costs with one method and the other: floating-point operations, weighted by the lengths of their loops.
//!
//! Loops of `n` steps run at the share `n/(n + n½)` of the full rate (R. W. Hockney, C. R. Jesshope, *Parallel Computers*, 1981): those of condensing are as
//! long as the first state and all controls, those of recursions as a node.

use super::StageQp;

/// Steps of the active set in a sample that count: one for the solution, one for a change, one for a correction.
const STEPS: f64 = 3.0;

/// `n½`: between 12 and 40 for a pendulum and three masses with 10 to 160 stages. The feedback of condensing is the shorter one at equal cost, so a
/// large value does less harm than a small one.
const HALF: f64 = 16.0;

/// Is it cheaper to solve a program of this size stage by stage? Preparation and feedback count together; what both do alike, the first
/// recursion, does not.
pub fn is_long(qp: &StageQp) -> bool {
    let [n, nx, nu, rows] = [qp.n, qp.nx, qp.nu, qp.rows.len()].map(|v| v as f64);
    let weighted = |work: f64, length: f64| work * (1.0 + HALF / length);
    weighted(stagewise(n, nx, nu, rows), nx + nu) < weighted(condensing(n, nx, nu, rows), nx + n * nu)
}

/// Responses of `nx + k nu` columns at node `k`, half of the product of two triangles, and per step a column of the inverse and the rows.
fn condensing(n: f64, nx: f64, nu: f64, rows: f64) -> f64 {
    let (w, n_u) = (nx + nu, n * nu);
    let responses = 2.0 * nx * w * (n * nx + 0.5 * n * n * nu);
    let inverse = n_u.powi(3) / 3.0;
    let step = 2.0 * n * nx * w + 2.0 * rows * w + 2.0 * n_u;
    responses + inverse + 2.0 * nx * n_u + STEPS * step
}

/// A recursion for the guess and one for every step, on half of the stages in the mean, with two sweeps and an evaluation for each; covariances
/// where there are rows.
fn stagewise(n: f64, nx: f64, nu: f64, rows: f64) -> f64 {
    let w = nx + nu;
    let recursion = n * (2.0 * nx * nx * w + nx * w * w + nu * w * w) + rows * w * w;
    let sweeps = n * (2.0 * nx * nx + 4.0 * nx * w + 4.0 * nu * w + 2.0 * w * w) + 4.0 * rows * w;
    let covariances = if rows > 0.0 { n * 4.0 * nx * nx * w } else { 0.0 };
    recursion + covariances + STEPS * (0.5 * recursion + sweeps)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The longer the horizon the cheaper is the method whose work is linear; between the two there is one length.
    #[test]
    fn one_length_divides() {
        for (nx, nu) in [(1, 1), (4, 1), (21, 3), (6, 6)] {
            let long = |n: usize| is_long(&StageQp::new(n, nx, nu, vec![]).unwrap());
            let first = (1..2000).find(|n| long(*n)).unwrap();
            assert!(first > 5 && (first..first + 200).all(long), "{nx} {nu}: {first}");
        }
    }
}
