//! Distance that a trajectory keeps from surfaces which it does not cross. At a surface that is touched the solution may not be unique: a program
//! goes on with what costs least, and a simulation that is off by the least bit goes on beyond. Between the points of a method
//! the state may be beyond besides. In a branch problem with a clearance multipliers `λ` of cells that are not active have a lower bound, and
//! elements begin where one of them is smallest.

use std::ops::Range;

use super::layout::ElementIndex;
use super::problem::Fesd;
use crate::dcs::Across;
use crate::mpcc::Side;
use crate::nlp::Bounds;

/// Equal parts of an element at whose ends `λ` is looked at for the smallest value inside.
const PARTS: usize = 16;
/// Share of an element within which the smallest value is at its end.
const AT_END: f64 = 1e-3;

/// Share of a control stage below which an element has no length, and of its usual size below which a distance from a surface is none.
const NOTHING: f64 = 1e-6;
/// Share of what is to be kept that is enough between the points of the method.
const ENOUGH: f64 = 0.5;
/// Weight below which a cell of a sliding mode has none.
const WEIGHTLESS: f64 = 1e-6;

/// What a branch problem keeps clear of.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Clearance {
    /// Share of the largest `λ` of a cell that is kept; of its usual size where it is zero all along.
    pub share: f64,
    /// Element, cell that is not active in it, and the least that its `λ` may be.
    pub least: Vec<(usize, usize, f64)>,
    /// Elements that begin where `λ` of a cell is smallest, and that cell.
    pub lowest: Vec<(usize, usize)>,
    /// Lengths of all elements: those of one mode in one stage keep their ratios.
    pub lengths: Vec<f64>,
    /// Active cells of all elements: with others, as those of a later solve from here, nothing is kept clear of.
    pub active: Vec<bool>,
}

/// An element of a solution.
#[derive(Debug, Clone, PartialEq)]
pub struct Piece {
    /// Control stage.
    pub stage: usize,
    /// Length.
    pub h: f64,
    /// Active cells, without those whose weights are zero.
    pub active: Vec<bool>,
    /// Cells whose surface it comes near, and what is kept of their `λ`.
    pub near: Vec<(usize, f64)>,
    /// A cell whose `λ` is smallest where this element begins.
    pub lowest: Option<usize>,
    /// Is the state on the surface of a cell all the time, which is active in the stage before, and in the one behind?
    pub held: [bool; 2],
    /// A cell whose `λ` falls below what is kept inside, and the share of the element at which it is smallest.
    pub dip: Option<(usize, f64)>,
    /// Active cells of the region between, where two surfaces are crossed at once at the end.
    pub corner: Option<Vec<bool>>,
}

/// A way to cross two surfaces one after the other.
struct Meeting {
    /// Active cells in between.
    between: Vec<bool>,
    /// Cells whose `λ` is the distance of the element before from the first surface, and of the one behind from the second.
    cells: [usize; 2],
    /// The largest of these `λ`.
    far: [f64; 2],
}

impl Fesd {
    /// Keeps clear in branch problems from now on; `None`: no longer.
    pub fn set_clearance(&mut self, clearance: Option<Clearance>) {
        self.clearance = clearance;
    }

    /// Length of an element as a multiple of that of the one before, where they are of one mode.
    pub(super) fn ratio(&self, element: usize) -> f64 {
        match &self.clearance {
            Some(k) if element > 0 && element < k.lengths.len() => k.lengths[element] / k.lengths[element - 1],
            _ => 1.0,
        }
    }

    /// What branch problems keep clear of.
    pub fn clearance(&self) -> Option<&Clearance> {
        self.clearance.as_ref()
    }

    /// The elements of a solution with these active cells, those without length left out, and where they come nearer to a surface than a share
    /// of the largest distance from it.
    pub fn pieces(&self, w: &[f64], active: &[&[bool]], share: f64) -> Vec<Piece> {
        let l = &self.l;
        let n = l.n_cells;
        let lengths = self.stage_lengths(w);
        let long = |i: &usize| self.h_of(&l.elements[*i], w) > NOTHING * lengths[l.elements[*i].stage];
        let kept: Vec<usize> = (0..l.elements.len()).filter(long).collect();
        let mut sets: Vec<Vec<bool>> = kept.iter().map(|&i| self.weighty(i, w, active[i])).collect();
        let largest = |c: usize| {
            let of = |e| l.lambdas(e, c).fold(0f64, |m, j| m.max(w[j + c]));
            l.elements.iter().fold(0.0, |m: f64, e| m.max(of(e)))
        };
        // of a surface that is never left only the usual size is known
        let usual = |c: usize| l.elements.iter().find_map(|e| l.lambdas(e, c).next()).map_or(0.0, |j| self.size(j + c));
        let scale = |c: usize| Some(largest(c)).filter(|m| *m > NOTHING * usual(c)).unwrap_or(usual(c));
        let least: Vec<f64> = (0..n).map(|c| share * scale(c)).collect();
        self.choose_for_stages(&kept, &mut sets, w);
        self.stay_on_one_side(&kept, &mut sets, &least, w);
        let lowest = |i: usize| {
            let of = self.clearance.iter().flat_map(|k| &k.lowest);
            of.filter(|(e, _)| *e == i).map(|(_, c)| *c).next()
        };
        let ends = |k: usize| self.corner([kept[k], kept[k + 1]], [&sets[k], &sets[k + 1]], w);
        let mut corners: Vec<Option<Vec<bool>>> = (1..kept.len()).map(|k| ends(k - 1)).collect();
        corners.push(None);
        let mut pieces = Vec::with_capacity(kept.len());
        for (k, &i) in kept.iter().enumerate() {
            let e = &l.elements[i];
            let mut piece = Piece {
                stage: e.stage,
                h: self.h_of(e, w),
                active: sets[k].clone(),
                near: Vec::new(),
                lowest: lowest(i),
                held: [false; 2],
                dip: None,
                corner: corners[k].clone(),
            };
            let beside = [k.checked_sub(1), (k + 1 < kept.len()).then_some(k + 1)];
            let between = [beside[0].and_then(|j| corners[j].as_ref()), corners[k].as_ref()];
            let mut depth = 0.0;
            for c in (0..n).filter(|&c| !piece.active[c]) {
                let crossed = |side: usize| {
                    let with = |&j: &usize| self.passes([kept[j], i], c) && between[side].unwrap_or(&sets[j])[c];
                    beside[side].filter(with)
                };
                let crossed = [crossed(0), crossed(1)];
                let [lo, hi] = self.extremes(i, c, w);
                let flat = |hi: f64| hi <= (1.0 + AT_END) * least[c];
                if let Some(j) = crossed[0].or(crossed[1]) {
                    // a control that holds the state on a surface cannot take it across
                    let held = flat(hi) && l.elements[kept[j]].stage != e.stage && between == [None; 2];
                    if held && crossed[0].is_none() != crossed[1].is_none() {
                        piece.held[usize::from(crossed[1].is_some())] = true;
                        piece.near.push((c, least[c]));
                    }
                    continue;
                }
                let (value, at) = self.smallest(i, c, w);
                let ends = k + 1 == kept.len() && at >= 1.0 - AT_END;
                // what the end of the horizon must be is said by its constraints
                if value > least[c] * (1.0 + AT_END) || ends {
                    continue;
                }
                // the last element of a stage that stays on a surface stands for all of them: more would say the same again
                let same = beside[1].filter(|&j| l.elements[kept[j]].stage == e.stage && !sets[j][c]);
                if flat(hi) && same.is_some_and(|j| flat(self.extremes(kept[j], c, w)[1])) {
                    continue;
                }
                piece.near.push((c, least[c]));
                let inside = at > AT_END && at < 1.0 - AT_END;
                let below = value - lo.min(least[c]);
                if inside && below < -ENOUGH * least[c] && below < depth {
                    (piece.dip, depth) = (Some((c, at)), below);
                }
            }
            pieces.push(piece);
        }
        pieces
    }

    /// Does the state take the surfaces of a cell from one element to the next? At the end of a stage those of controls jump.
    fn passes(&self, elements: [usize; 2], c: usize) -> bool {
        let [a, b] = elements.map(|i| self.l.elements[i].stage);
        a == b || self.l.across[c] == Across::Tied
    }

    /// The active cells between those of two elements, one behind the other, where the state crosses two surfaces at once, which a simulation
    /// does one after the other. Of the two ways round it is the one that the state is not close to all along an element.
    fn corner(&self, elements: [usize; 2], sets: [&[bool]; 2], w: &[f64]) -> Option<Vec<bool>> {
        let far = |m: &Meeting| m.far[0].min(m.far[1]);
        let ways = self.meeting(elements, sets, w)?;
        ways.into_iter().max_by(|a, b| far(a).total_cmp(&far(b))).map(|m| m.between)
    }

    /// The two ways in which the state may cross two surfaces one after the other, where it crosses them at once between two elements.
    fn meeting(&self, elements: [usize; 2], sets: [&[bool]; 2], w: &[f64]) -> Option<[Meeting; 2]> {
        let form = self.spec.dcs.form();
        let single = |set: &[bool], cells: &Range<usize>| {
            let mut of = cells.clone().filter(|&c| set[c]);
            of.next().filter(|_| of.next().is_none())
        };
        let passes = |cells: &Range<usize>| cells.clone().all(|c| self.passes(elements, c));
        let differs = |cells: &Range<usize>| sets[0][cells.clone()] != sets[1][cells.clone()];
        let changed = form.simplices.iter().filter(|cells| differs(cells) && passes(cells));
        let changes = changed.map(|cells| Some((cells, single(sets[0], cells)?, single(sets[1], cells)?)));
        let changes: Vec<(&Range<usize>, usize, usize)> = changes.collect::<Option<_>>()?;
        // cells that become active at the first surface, and those that do so at the second
        let ways: [[(usize, usize); 2]; 2] = match changes[..] {
            [(cells, a, b)] => {
                let ways: Vec<_> = form.between(cells.clone(), a, b).map(|c| [(a, c), (c, b)]).collect();
                ways.try_into().ok()?
            }
            [(_, a, b), (_, c, d)] => [[(a, b), (c, d)], [(c, d), (a, b)]],
            _ => return None,
        };
        Some(ways.map(|[(from, to), (second, _)]| {
            let mut between = sets[0].to_vec();
            (between[from], between[to]) = (false, true);
            let far = [self.extremes(elements[0], to, w)[1], self.extremes(elements[1], second, w)[1]];
            Meeting { between, cells: [to, second], far }
        }))
    }

    /// Controls choose for whole stages: where one is exactly on a surface a program may take both sides, or what is between, and change that at any
    /// time, which no simulation does. The stage has the side with the most weight.
    fn choose_for_stages(&self, kept: &[usize], sets: &mut [Vec<bool>], w: &[f64]) {
        let l = &self.l;
        let chosen = |cells: &&Range<usize>| (*cells).clone().all(|c| l.across[c] == Across::Nothing);
        let mut rest = sets;
        for own in kept.chunk_by(|&a, &b| l.elements[a].stage == l.elements[b].stage) {
            let sets;
            (sets, rest) = rest.split_at_mut(own.len());
            for cells in self.spec.dcs.form().simplices.iter().filter(chosen) {
                let first = &sets[0][cells.clone()];
                if first.iter().filter(|a| **a).count() == 1 && sets.iter().all(|s| s[cells.clone()] == *first) {
                    continue;
                }
                let weight = |c: usize| -> f64 {
                    let of = |e: &ElementIndex| self.h_of(e, w) * e.theta.iter().map(|&j| w[j + c]).sum::<f64>();
                    own.iter().map(|&i| of(&l.elements[i])).sum()
                };
                let Some(most) = cells.clone().max_by(|&a, &b| weight(a).total_cmp(&weight(b))) else { continue };
                sets.iter_mut().for_each(|s| cells.clone().for_each(|c| s[c] = c == most));
            }
        }
    }

    /// What is exactly on a surface within a stage, as a control that does not change in it, stays on one side: where a program takes the other
    /// side as soon as the state crosses another surface, the shorter part of the stage is given the side of the longer one.
    fn stay_on_one_side(&self, kept: &[usize], sets: &mut [Vec<bool>], least: &[f64], w: &[f64]) {
        let stage = |k: usize| self.l.elements[kept[k]].stage;
        for k in 1..kept.len() {
            if stage(k) != stage(k - 1) {
                continue;
            }
            let Some(ways) = self.meeting([kept[k - 1], kept[k]], [&sets[k - 1], &sets[k]], w) else { continue };
            // is the second surface of a way one that both elements are on?
            let on = |m: &Meeting, side: usize| m.far[side] <= least[m.cells[side]];
            let Some(of_state) = ways.iter().position(|m| on(m, 1) && !on(m, 0)) else { continue };
            let of_control = &ways[1 - of_state];
            if !on(of_control, 0) || on(of_control, 1) {
                continue;
            }
            let [from, to] = [k - 1, k].map(|i| sets[i].clone());
            let before = (0..k).rev().take_while(|&i| stage(i) == stage(k) && sets[i] == from).count();
            let behind = (k..kept.len()).take_while(|&i| stage(i) == stage(k) && sets[i] == to).count();
            let long = |range: Range<usize>| range.map(|i| self.h_of(&self.l.elements[kept[i]], w)).sum::<f64>();
            let (set, range) = match long(k - before..k) < long(k..k + behind) {
                true => (&of_control.between, k - before..k),
                false => (&ways[of_state].between, k..k + behind),
            };
            sets[range].iter_mut().for_each(|s| s.clone_from(set));
        }
    }

    /// The smallest and the largest `λ` of a cell at the points of an element.
    fn extremes(&self, element: usize, c: usize, w: &[f64]) -> [f64; 2] {
        let of = self.l.lambdas(&self.l.elements[element], c).map(|j| w[j + c]);
        of.fold([f64::INFINITY, f64::NEG_INFINITY], |[lo, hi], v| [lo.min(v), hi.max(v)])
    }

    /// Active cells of an element without those of a sliding mode that have no weight.
    fn weighty(&self, element: usize, w: &[f64], active: &[bool]) -> Vec<bool> {
        let e = &self.l.elements[element];
        let mut set = active.to_vec();
        for cells in &self.spec.dcs.form().simplices {
            let weight = |c: usize| e.theta.iter().fold(0f64, |m, &j| m.max(w[j + c].abs()));
            let with: Vec<usize> = cells.clone().filter(|&c| active[c] && weight(c) > WEIGHTLESS).collect();
            if !with.is_empty() {
                cells.clone().for_each(|c| set[c] = with.contains(&c));
            }
        }
        set
    }

    /// The smallest value of the polynomial through the `λ` of a cell in an element, and the share of the element at which it is.
    fn smallest(&self, element: usize, c: usize, w: &[f64]) -> (f64, f64) {
        let (l, e) = (&self.l, &self.l.elements[element]);
        let nodes = &self.tableau.c;
        let start = l.start_of(e, c).filter(|_| nodes[0] > 0.0).map(|j| (0.0, w[j + c]));
        let inner = nodes.iter().zip(&e.lambda).map(|(&t, &j)| (t, w[j + c]));
        let end = e.lambda_end.filter(|_| nodes.last().is_some_and(|t| *t < 1.0)).map(|j| (1.0, w[j + c]));
        let mut points: Vec<(f64, f64)> = start.into_iter().chain(inner).chain(end).collect();
        // methods with two stage points at one place have one value there
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.dedup_by(|b, a| b.0 == a.0);
        let value = |t: f64| interpolate(&points, t);
        let at = |k: usize| k as f64 / PARTS as f64;
        let best = (0..=PARTS).min_by(|a, b| value(at(*a)).total_cmp(&value(at(*b)))).unwrap_or(0);
        // between its neighbours, by thirds
        let (mut a, mut b) = (at(best.saturating_sub(1)), at((best + 1).min(PARTS)));
        while b - a > AT_END * AT_END {
            let (s, t) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
            if value(s) < value(t) {
                b = t;
            } else {
                a = s;
            }
        }
        let t = 0.5 * (a + b);
        (value(t), t)
    }

    /// Writes the clearance into the bounds of a branch problem.
    pub(super) fn keep_clear(&self, sides: &[Side], b: &mut Bounds) {
        let l = &self.l;
        let of = |k: &&Clearance| k.active.iter().copied().eq(sides.iter().map(|s| *s == Side::First));
        let Some(clearance) = self.clearance.as_ref().filter(of) else { return };
        let last = l.elements.len() - 1;
        for &(i, c, least) in &clearance.least {
            let e = &l.elements[i];
            let mut at: Vec<usize> = e.lambda.iter().copied().chain(e.lambda_end).collect();
            if i == last {
                at.pop();
            }
            // a start that is free may be off the surface
            let start = self.l.start_of(e, c).filter(|_| i == 0);
            at.extend(start.filter(|_| {
                (0..self.spec.dcs.dims().x)
                    .any(|j| b.xl[l.x0 + j] < b.xu[l.x0 + j] && self.spec.dcs.form().moves_with(c, j))
            }));
            at.iter().for_each(|&j| b.xl[j + c] = least);
        }
    }
}

/// The polynomial through points, at `t`.
fn interpolate(points: &[(f64, f64)], t: f64) -> f64 {
    let basis = |j: usize| {
        let others = points.iter().enumerate().filter(move |(k, _)| *k != j);
        others.map(move |(_, p)| (t - p.0) / (points[j].0 - p.0)).product::<f64>()
    };
    points.iter().enumerate().map(|(j, p)| p.1 * basis(j)).sum()
}
