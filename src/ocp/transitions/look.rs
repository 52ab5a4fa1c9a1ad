//! A second look for answers that sequences next to the best one do not lead to: simulations of controls drawn at random, whose sequences
//! are tried in the order of how nearly they meet the conditions at the end.

use super::automaton::{Automaton, Sequence};
use super::guess::{self, Guess};
use crate::error::Result;
use crate::fesd::Terminal;
use crate::func::Point;
use crate::jumps::spread::misses;
use crate::ocp::Ocp;
use crate::random::SplitMix64;
use crate::stop;

/// Controls that are drawn.
const DRAWN: usize = 80;
/// Pieces of the horizon on which they are constant, in turn; 0: as many as stages.
const PIECES: [usize; 5] = [1, 2, 3, 6, 0];
/// Parts of the pieces in which a control is at its lower bound, at its upper one, or as in the answer.
const AT_LOWER: f64 = 0.15;
const AT_UPPER: f64 = 0.3;
const AS_KNOWN: f64 = 0.5;
/// Range of a control without a bound, as a multiple of its largest modulus in the answer.
const WIDER: f64 = 2.0;
const SEED: u64 = 0x10_0c;

/// Sequences of simulations with their motions, none of them twice, those first whose end comes closest to its conditions. `known` are the controls
/// of an answer.
///
/// # Errors
/// Those of making what simulates.
pub(super) fn shots(ocp: &Ocp, automaton: &Automaton, known: &[f64]) -> Result<Vec<(Sequence, Guess)>> {
    let nu = ocp.system.dims().u;
    let ranges: Vec<[f64; 2]> = (0..nu).map(|j| range(ocp, known, j)).collect();
    let mut engine = guess::engine(ocp)?;
    let mut numbers = SplitMix64::new(SEED);
    let mut motions: Vec<(Sequence, Guess)> = Vec::new();
    let mut ends: Vec<Vec<f64>> = Vec::new();
    for k in 0..DRAWN {
        if stop::requested().is_some() {
            break;
        }
        let controls = drawn(ocp.n_stages, &ranges, known, k, &mut numbers);
        // what cannot be simulated leads nowhere
        let Ok((sequence, motion)) = guess::simulate(ocp, automaton, &mut engine, &controls) else { continue };
        let Some(end) = conditions(ocp, &motion) else { continue };
        motions.push((sequence, motion));
        ends.push(end);
    }
    let of =
        |c: &Terminal| c.lower.iter().copied().zip(c.upper.iter().copied()).map(|(l, u)| [l, u]).collect::<Vec<_>>();
    let bounds: Vec<[f64; 2]> = ocp.terminal.iter().flat_map(of).collect();
    let misses = misses(ends.iter().map(|e| &e[..]), &bounds);
    let mut order: Vec<usize> = (0..motions.len()).collect();
    order.sort_by(|a, b| misses[*a].total_cmp(&misses[*b]));
    let mut motions: Vec<Option<(Sequence, Guess)>> = motions.into_iter().map(Some).collect();
    let mut out: Vec<(Sequence, Guess)> = Vec::new();
    for k in order {
        let Some(motion) = motions[k].take() else { continue };
        if out.iter().all(|known| known.0 != motion.0) {
            out.push(motion);
        }
    }
    Ok(out)
}

/// What a control is drawn from.
fn range(ocp: &Ocp, known: &[f64], j: usize) -> [f64; 2] {
    let nu = ocp.system.dims().u;
    let own = known.iter().skip(j).step_by(nu).fold(0f64, |m, u| m.max(u.abs()));
    let [lower, upper] = [ocp.u_bounds[0][j], ocp.u_bounds[1][j]];
    [if lower.is_finite() { lower } else { -WIDER * own }, if upper.is_finite() { upper } else { WIDER * own }]
}

fn drawn(n_stages: usize, ranges: &[[f64; 2]], known: &[f64], k: usize, numbers: &mut SplitMix64) -> Vec<f64> {
    let drawn = numbers.on_pieces(n_stages, PIECES[k % PIECES.len()], ranges.len());
    let value = |(((which, share), [lower, upper]), known): (((f64, f64), &[f64; 2]), &f64)| match which {
        w if w < AT_LOWER => *lower,
        w if w < AT_UPPER => *upper,
        w if w < AS_KNOWN => known.max(*lower).min(*upper),
        _ => lower + share * (upper - lower),
    };
    drawn.into_iter().zip(ranges.iter().cycle()).zip(known).map(value).collect()
}

/// Values of the conditions at the end of a motion; nothing where one has no value.
fn conditions(ocp: &Ocp, motion: &Guess) -> Option<Vec<f64>> {
    let (last, nu) = (ocp.n_stages - 1, ocp.system.dims().u);
    let (x, u) = (motion.last_state(), &motion.controls[last * nu..]);
    let mut values = Vec::new();
    for c in &ocp.terminal {
        let at = Point { t: ocp.t0 + motion.horizon(), x, u, p: ocp.params_of(last) };
        let mut out = vec![0.0; c.f.n_out()];
        c.f.value(&at, &mut out, &mut vec![0.0; c.f.work_len()]).ok()?;
        values.extend(out);
    }
    values.iter().all(|v| v.is_finite()).then_some(values)
}
