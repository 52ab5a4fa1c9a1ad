//! Time-freezing of a relay with hysteresis by Voronoi regions (section 9.2 of the thesis).
//!
//! ```text
//! x' = f_low(x,u,p,t) while w = 0,   f_high(x,u,p,t) while w = 1;   w goes to 1 where ψ ≥ 1, to 0 where ψ ≤ 0
//! ```
//!
//! The plane of `(ψ, w)` is divided by the points `z = (¼,−¼), (¼,¼), (¾,¾), (¾,5/4)`: evolution with `w = 0` is the sliding mode
//! between the first two regions, with `w = 1` that between the last two, and in the second and third `w` moves while the
//! clock stands still. Optimal control by descents on simulations is faster and exact; this is for comparison, and for chains
//! `w → w ± 1` as sums of such relays.

use std::sync::Arc;

use crate::error::{check_positive, Error, Result};
use crate::expr::{Block, Dag, ExprFunction, Id};
use crate::func::Dims;
use crate::system::{Regions, Subsystem, System};

/// The points of the Voronoi regions in the plane of `(ψ, w)`.
const POINTS: [(f64, f64); 4] = [(0.25, -0.25), (0.25, 0.25), (0.75, 0.75), (0.75, 1.25)];

/// A relay with hysteresis, in expressions of `x`, `u`, `p` and the time.
#[derive(Debug, Clone)]
pub struct Relay {
    /// Sizes of states, controls and parameters without `w` and the clock.
    pub dims: Dims,
    /// The expression that the relay follows.
    pub value: Id,
    /// Value at which the relay goes to 1.
    pub on: f64,
    /// Value at which the relay goes back to 0: below `on`.
    pub off: f64,
    /// Derivatives of the states while `w = 0`.
    pub low: Vec<Id>,
    /// Derivatives of the states while `w = 1`.
    pub high: Vec<Id>,
    /// Speed of `w`: a change takes `2/strength` of numerical time.
    pub strength: f64,
}

/// The system in numerical time: states `(x, w, t)`.
///
/// # Errors
/// [`Error::Range`] for thresholds in the wrong order and a strength that is not positive; [`Error::Dimension`] for other numbers of
/// derivatives than states; those of [`ExprFunction::new`].
pub fn freeze_relay(dag: &mut Dag, relay: &Relay) -> Result<System> {
    let d = relay.dims;
    let span = relay.on - relay.off;
    if !span.is_finite() || span <= 0.0 {
        return Err(Error::Range(format!("off is {} and on is {}: off must be smaller", relay.off, relay.on)));
    }
    check_positive("the strength", relay.strength)?;
    for list in [&relay.low, &relay.high] {
        if list.len() != d.x {
            return Err(Error::Dimension(format!("{} derivatives for {} states", list.len(), d.x)));
        }
    }
    let wide = Dims { x: d.x + 2, ..d };
    let clock = d.x + 1;
    let place = move |block: Block, i: usize| if block == Block::T { (Block::X, clock) } else { (block, i) };
    let value = dag.move_inputs(&[relay.value], &place)[0];
    let (low, high) = (dag.move_inputs(&relay.low, &place), dag.move_inputs(&relay.high, &place));
    let (off, width) = (dag.constant(relay.off), dag.constant(relay.on - relay.off));
    let above = dag.sub(value, off);
    let psi = dag.div(above, width);
    let w = dag.input(Block::X, d.x);
    // |z − z_i|² without |z|², which is the same in all
    let mut indicators = Vec::new();
    for (a, b) in POINTS {
        let (size, a, b) = (dag.constant(a * a + b * b), dag.constant(-2.0 * a), dag.constant(-2.0 * b));
        let (a, b) = (dag.mul(a, psi), dag.mul(b, w));
        let sum = dag.add(a, b);
        indicators.push(dag.add(size, sum));
    }
    let one = dag.constant(1.0);
    let beyond = dag.sub(psi, one);
    let (down, up) = (speed(dag, beyond, -relay.strength), speed(dag, psi, relay.strength));
    let mut modes = run(dag, &low, down);
    modes.extend(still(dag, d.x, down));
    modes.extend(still(dag, d.x, up));
    modes.extend(run(dag, &high, up));
    let mut system = System::new(wide.x, wide.u, wide.p)?;
    system.add_subsystem(Subsystem {
        rows: (0..wide.x).collect(),
        modes: Arc::new(ExprFunction::new("relay", dag, wide, &modes)?),
        n_modes: POINTS.len(),
        regions: Regions::Indicators(Arc::new(ExprFunction::new("regions of the relay", dag, wide, &indicators)?)),
    })?;
    Ok(system)
}

/// `strength z²/(1 + z²)`, Proposition 9.2.
fn speed(dag: &mut Dag, z: Id, strength: f64) -> Id {
    let square = dag.mul(z, z);
    let one = dag.constant(1.0);
    let below = dag.add(one, square);
    let ratio = dag.div(square, below);
    let strength = dag.constant(strength);
    dag.mul(strength, ratio)
}

/// `w` moves, all else stands still.
fn still(dag: &mut Dag, nx: usize, rate: Id) -> Vec<Id> {
    let zero = dag.constant(0.0);
    let mut out = vec![zero; nx];
    out.extend([rate, zero]);
    out
}

/// `2 (f, 0, 1)` less the field beside it: with equal weights of both `w` stands still (Proposition 9.3).
fn run(dag: &mut Dag, f: &[Id], beside: Id) -> Vec<Id> {
    let two = dag.constant(2.0);
    let mut out: Vec<Id> = f.iter().map(|f| dag.mul(two, *f)).collect();
    out.push(dag.neg(beside));
    out.push(two);
    out
}
