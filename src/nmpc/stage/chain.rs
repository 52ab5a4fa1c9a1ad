//! Several steps in every stage, one after the other.

use super::{Evaluations, Stage, Starts};
use crate::func::EvalResult;
use crate::linalg::dense::{gemm, Left, Mode, Right};

/// Steps of equal length; derivatives are products of those of the steps.
pub(in super::super) struct Chain<S> {
    links: Vec<S>,
    n: usize,
    nx: usize,
    nu: usize,
    /// States between the steps `[links + 1][n · nx]`, their times, the length of a step.
    x: Vec<Vec<f64>>,
    t: Vec<f64>,
    h: Vec<f64>,
    a: Vec<f64>,
    b: Vec<f64>,
    product: Vec<f64>,
    bar: Vec<f64>,
    gu: Vec<f64>,
}

impl<S: Stage> Chain<S> {
    /// `sizes`: stages, states, controls.
    pub fn new(links: Vec<S>, [n, nx, nu]: [usize; 3]) -> Chain<S> {
        Chain {
            x: (0..=links.len()).map(|_| vec![0.0; n * nx]).collect(),
            t: vec![0.0; n],
            h: vec![0.0; n],
            a: vec![0.0; n * nx * nx],
            b: vec![0.0; n * nx * nu],
            product: vec![0.0; nx * nx.max(nu)],
            bar: vec![0.0; n * nx],
            gu: vec![0.0; n * nu],
            links,
            n,
            nx,
            nu,
        }
    }

    fn times(&mut self, at: &Starts, link: usize) {
        let m = self.links.len() as f64;
        for k in 0..self.n {
            self.h[k] = at.h[k] / m;
            self.t[k] = at.t[k] + link as f64 * self.h[k];
        }
    }
}

impl<S: Stage> Stage for Chain<S> {
    fn values(&mut self, at: &Starts, next: &mut [f64]) -> EvalResult {
        self.x[0].copy_from_slice(at.x);
        for i in 0..self.links.len() {
            self.times(at, i);
            let (before, after) = self.x.split_at_mut(i + 1);
            let start = Starts { x: &before[i], u: at.u, p: at.p, t: &self.t, h: &self.h };
            self.links[i].values(&start, &mut after[0])?;
        }
        next.copy_from_slice(&self.x[self.links.len()]);
        Ok(())
    }

    fn linearise(
        &mut self,
        at: &Starts,
        next: &mut [f64],
        a: &mut [f64],
        b: &mut [f64],
        second: Option<(&[f64], &mut [f64])>,
    ) -> EvalResult {
        debug_assert!(second.is_none(), "problems with several implicit steps are made without second derivatives");
        let (nx, nu) = (self.nx, self.nu);
        self.x[0].copy_from_slice(at.x);
        for i in 0..self.links.len() {
            self.times(at, i);
            let (before, after) = self.x.split_at_mut(i + 1);
            let start = Starts { x: &before[i], u: at.u, p: at.p, t: &self.t, h: &self.h };
            if i == 0 {
                self.links[0].linearise(&start, &mut after[0], a, b, None)?;
                continue;
            }
            self.links[i].linearise(&start, &mut after[0], &mut self.a, &mut self.b, None)?;
            for k in 0..self.n {
                let own = Left { v: &self.a[k * nx * nx..], ld: nx };
                let a = &mut a[k * nx * nx..(k + 1) * nx * nx];
                let b = &mut b[k * nx * nu..(k + 1) * nx * nu];
                gemm([nx, nx, nx], own, Right { v: a, rs: 1, cs: nx }, &mut self.product, nx, Mode::Set);
                a.copy_from_slice(&self.product[..nx * nx]);
                gemm([nx, nu, nx], own, Right { v: b, rs: 1, cs: nx }, &mut self.product, nx, Mode::Set);
                b.iter_mut().zip(&self.product).zip(&self.b[k * nx * nu..]).for_each(|((b, p), o)| *b = p + o);
            }
        }
        next.copy_from_slice(&self.x[self.links.len()]);
        Ok(())
    }

    fn adjoint(&mut self, at: &Starts, lambda: &[f64], next: &mut [f64], gx: &mut [f64], gu: &mut [f64]) -> EvalResult {
        self.values(at, next)?;
        gx.copy_from_slice(lambda);
        gu.fill(0.0);
        for i in (0..self.links.len()).rev() {
            self.times(at, i);
            self.bar.copy_from_slice(gx);
            let (before, after) = self.x.split_at_mut(i + 1);
            let start = Starts { x: &before[i], u: at.u, p: at.p, t: &self.t, h: &self.h };
            self.links[i].adjoint(&start, &self.bar, &mut after[0], gx, &mut self.gu)?;
            gu.iter_mut().zip(&self.gu).for_each(|(g, v)| *g += v);
        }
        Ok(())
    }

    fn evaluations(&self) -> Evaluations {
        self.links.iter().fold(Evaluations::default(), |s, l| {
            let e = l.evaluations();
            Evaluations {
                values: s.values + e.values,
                jacobians: s.jacobians + e.jacobians,
                adjoints: s.adjoints + e.adjoints,
                hessians: s.hessians + e.hessians,
            }
        })
    }
}
