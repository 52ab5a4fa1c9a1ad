//! Lagrange's equations: forces that follow from inertia and potential.

use super::dag::{Block, Dag, Id, Node};
use crate::error::{Error, Result};

impl Dag {
    /// Forces beside `M v̇` in Lagrange's equations of the kinetic energy `T = vᵀ M(q, t) v / 2` and the potential `V(q, t)`, for `q̇ = v`:
    ///
    /// ```text
    /// −∂V/∂q + ∂T/∂q − (∂(M v)/∂q) v − (∂M/∂t) v
    /// ```
    ///
    /// The last three are what is called centrifugal and Coriolis forces (Goldstein, *Classical Mechanics*, section 1.4).
    ///
    /// # Errors
    /// [`Error::Dimension`] unless there are as many velocities as coordinates, and as many entries of the symmetric matrix as that times
    /// itself; [`Error::Range`] for coordinates and velocities that are no inputs.
    pub fn lagrangian_forces(&mut self, inertia: &[Id], potential: Id, q: &[Id], v: &[Id]) -> Result<Vec<Id>> {
        let n = q.len();
        if v.len() != n || inertia.len() != n * n {
            return Err(Error::Dimension(format!(
                "Lagrange's equations of {n} coordinates have {n} velocities and {} entries of the inertia, not {} and {}",
                n * n,
                v.len(),
                inertia.len()
            )));
        }
        if let Some(&other) = q.iter().chain(v).find(|id| !matches!(self.node(**id), Node::Input(..))) {
            return Err(Error::Range(format!("{} is no input: coordinates and velocities are", self.text(other))));
        }
        let momentum = self.matmul(n, n, 1, inertia, v)?;
        let twice = self.dot(v, &momentum)?;
        let [half, minus, zero] = [0.5, -1.0, 0.0].map(|c| self.constant(c));
        let mut force = vec![zero; n];
        for (i, slope) in self.gradient(&[twice, potential], &[half, minus], q)? {
            force[i] = slope;
        }
        let time = self.input(Block::T, 0);
        let wrt: Vec<Id> = q.iter().copied().chain([time]).collect();
        for e in self.jacobian(&momentum, &wrt)? {
            let rate = match v.get(e.col) {
                Some(&v) => self.mul(e.value, v),
                None => e.value,
            };
            force[e.row] = self.sub(force[e.row], rate);
        }
        Ok(force)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ExprFunction, Graph};
    use super::*;
    use crate::func::{Dims, Function, Point};

    /// In polar coordinates a free particle goes straight: `r̈ = r φ̇² − V'`, `φ̈ = −2 ṙ φ̇ / r`.
    #[test]
    fn a_particle_in_polar_coordinates() {
        let g = Graph::new();
        let [r, _phi, dr, dphi] = [0, 1, 2, 3].map(|i| g.x(i));
        let (one, zero) = (g.constant(1.0), g.constant(0.0));
        let inertia = g.ids(&[one, zero, zero, r * r]);
        let potential = (r * r * 2.0).id();
        let (q, v) = (g.ids(&[r, g.x(1)]), g.ids(&[dr, dphi]));
        let forces = g.dag().lagrangian_forces(&inertia, potential, &q, &v).unwrap();
        let f = ExprFunction::new("f", &mut g.dag(), Dims { x: 4, u: 0, p: 0 }, &forces).unwrap();
        let (mut out, mut work) = ([0.0; 2], vec![0.0; f.work_len()]);
        f.value(&Point { t: 0.0, x: &[1.5, 0.3, 0.7, -2.0], u: &[], p: &[] }, &mut out, &mut work).unwrap();
        // times the inertia r² the second one is −2 r ṙ φ̇
        let exact = [1.5 * 4.0 - 4.0 * 1.5, -2.0 * 1.5 * 0.7 * -2.0];
        assert!(out.iter().zip(exact).all(|(a, b)| (a - b).abs() < 1e-14), "{out:?}");
        let mut d = g.dag();
        assert!(matches!(d.lagrangian_forces(&inertia, potential, &q, &v[..1]), Err(Error::Dimension(_))));
        assert!(matches!(d.lagrangian_forces(&inertia, potential, &q, &inertia[..2]), Err(Error::Range(_))));
    }
}
