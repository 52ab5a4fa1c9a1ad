//! What a discretised problem takes in memory, estimated from its counts before anything of it is built.

use super::layout::Spec;
use crate::error::Result;
use crate::memory::{self, sizes};
use crate::system::SharedFunction;

/// Bytes of a finite element apart from its numbers: its index, its calls.
const ELEMENT: u128 = 2000;
/// Bytes of a variable or row: bounds, iterates, multipliers, directions, scaling, work space of the factorisation.
const VARIABLE: u128 = 1200;
/// Bytes of an entry of the derivatives: in the value and its cache, in the list the pattern is made of, in the matrices of
/// the relaxed and of the branch problem and their maps, in the factors.
const ENTRY: u128 = 250;

/// Refuses numbers of elements nobody can mean, and problems for which there is not enough memory.
pub(super) fn check(spec: &Spec) -> Result<()> {
    let elements = elements(spec);
    sizes::check("finite elements", &[usize::try_from(elements).unwrap_or(usize::MAX)])?;
    memory::need(bytes(spec), || {
        let (d, n_s) = (spec.dcs.dims(), spec.options.n_s);
        format!(
            "a problem with {elements} finite elements, {n_s} stage points in each, {} states and {} weights",
            d.x,
            spec.dcs.form().n_weights()
        )
    })
}

fn elements(spec: &Spec) -> u128 {
    spec.n_fe.iter().map(|&n| n as u128).sum()
}

/// Bytes that the problem of `spec` and its solver will take.
pub(crate) fn bytes(spec: &Spec) -> u128 {
    elements(spec) * element(spec)
}

/// Bytes of one element.
fn element(spec: &Spec) -> u128 {
    let (form, d, n_s) = (spec.dcs.form(), spec.dcs.dims(), spec.options.n_s as u128);
    let entries = |f: &SharedFunction| (f.jac_pattern().nnz() + f.hess_pattern().nnz()) as u128;
    let apart = spec.dcs.drifts().iter().map(|f| &f.f).chain(form.terms.iter().map(|t| &t.modes));
    let apart = apart.filter(|_| spec.dcs.combined().is_none());
    let point = spec.dcs.combined().map(|c| &c.f).into_iter().chain(apart).chain(&form.sources);
    let point = point.chain(form.inclusions.iter().map(|i| &i.f)).chain(&spec.lagrange);
    let model: u128 = point.map(entries).sum();
    // constraints hold at the stage points at most
    let path: u128 = spec.path.iter().map(|c| &c.f).chain(spec.complementarity.iter().map(|c| &c.f)).map(entries).sum();
    let nx = spec.dcs.nx().max(d.x) as u128;
    let variables = 2 * nx + (2 * form.n_weights() + form.n_cells + form.n_mu) as u128;
    // a state depends on all stages of its element, a weight on its multiplier and the sums over the element
    let coupled = (n_s + 1) * nx + 6 * form.n_cells as u128;
    ELEMENT + n_s * (VARIABLE * variables + ENTRY * (model + path + coupled))
}
