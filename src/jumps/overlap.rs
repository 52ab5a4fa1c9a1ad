//! Bodies that overlap between the points of a program: gaps are held at stage points, and a gap that comes close to zero between two of them
//! may be negative there, up to the whole of a body where elements are long. Such a motion has an impact that its modes do not know.

use super::modal;
use super::problem::Problem;
use super::track::{Piece, Track};
use crate::func::Point;
use crate::tableau::Tableau;

/// A place at which a gap is to be held besides the stage points: the element of the plan, the contact, and the share of the element.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Witness {
    pub(super) element: usize,
    pub(super) contact: usize,
    pub(super) share: f64,
}

/// Parts of an element at whose ends gaps are looked at.
const PARTS: usize = 16;
/// Share of the largest gap of a contact in the motion from which a negative one is an overlap.
const OVERLAP: f64 = 1e-6;

/// Where open contacts overlap most, in every element in which they do. Elements in which a contact has just opened are left out, from being closed or
/// behind an impact without a rebound: what grows like t³ is negative there by the error of the method. So are gaps that know the time.
pub(super) fn overlaps(p: &Problem, track: &Track) -> Vec<Witness> {
    if p.knows_time {
        return Vec::new();
    }
    let n_c = p.n_contacts();
    let rests = modal::rests(p, track);
    let gaps: Vec<Vec<Vec<f64>>> = track.pieces.iter().map(|piece| along(p, track, piece)).collect();
    let mut out = Vec::new();
    for contact in 0..n_c {
        let largest = gaps.iter().flatten().map(|g| g[contact].abs()).fold(0.0, f64::max);
        for (element, of_piece) in gaps.iter().enumerate() {
            let was_closed = element > 0 && track.pieces[element - 1].modes[contact].is_closed();
            let was_hit = track.pieces[element].jump.as_ref().is_some_and(|parts| parts[contact].is_closed());
            let opens = was_closed || was_hit && rests[contact];
            if opens || track.pieces[element].modes[contact].is_closed() {
                continue;
            }
            let inside = (1..PARTS).map(|k| (k, of_piece[k][contact]));
            let Some((k, least)) = inside.min_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
            if least < -OVERLAP * largest {
                let [a, b] = [k - 1, k + 1].map(|k| of_piece[k][contact]);
                // the least value of the parabola through three of them
                let bend = a - 2.0 * least + b;
                let moved = if bend > 0.0 { (0.5 * (a - b) / bend).clamp(-1.0, 1.0) } else { 0.0 };
                out.push(Witness { element, contact, share: (k as f64 + moved) / PARTS as f64 });
            }
        }
    }
    out
}

/// Gaps of all contacts at the ends of the parts of an element.
fn along(p: &Problem, track: &Track, piece: &Piece) -> Vec<Vec<f64>> {
    let g = &p.given;
    let n_s = track.tableau.n_s;
    let mut w = [0.0; Tableau::MAX_STAGES];
    let mut x = vec![0.0; track.nx];
    let u = &track.controls[piece.stage * g.wide.u..piece.stage * g.wide.u + g.dims.u];
    let params = &g.params[piece.stage * g.wide.p..piece.stage * g.wide.p + g.dims.p];
    let mut at = |k: usize| {
        let share = k as f64 / PARTS as f64;
        if track.tableau.state_weights(share, &mut w[..n_s]).is_err() {
            return vec![f64::NAN; p.n_contacts()];
        }
        let first = 1.0 - w[..n_s].iter().sum::<f64>();
        for (i, o) in x.iter_mut().enumerate() {
            *o = first * piece.x0[i] + (0..n_s).map(|j| w[j] * piece.xs[j * track.nx + i]).sum::<f64>();
        }
        p.gaps(&Point { t: piece.t + share * piece.h, x: &x, u, p: params }).iter().map(|gap| gap.1).collect()
    };
    (0..=PARTS).map(&mut at).collect()
}
