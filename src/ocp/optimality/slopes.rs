//! Derivatives of the cost along the simulation by everything that may change, and what they say.

use super::{
    dot, Corner, Held, Judge, Kind, Kink, Leg, Optimality, Outer, Piece, Sides, Verdict, AT_BOUND, NONE, RANK,
    UNDECIDED, WITHOUT_DERIVATIVES,
};
use nalgebra::{DMatrix, DVector};

/// A quantity that may change, with the derivatives of the Lagrange function: the first column is that with the multipliers
/// of the answer, the others are what a unit more of something adds: of a kink's gradient to the costate, then of the
/// multiplier of a constraint. The last is that of the cost alone.
pub(super) struct Free {
    pub(super) slopes: Vec<f64>,
    /// Sum of the moduli of the terms of the last: what it changes the cost by. With the terms of constraints the scale of an answer would be
    /// another one with every choice of their multipliers, and without bound where they depend on each other.
    pub(super) terms: f64,
    pub(super) size: f64,
    /// At its lower bound, at its upper one.
    pub(super) held: [bool; 2],
}

impl Free {
    pub(super) fn new(value: f64, bounds: [f64; 2], usual: f64, n: usize) -> Free {
        let [l, u] = bounds;
        let size = match (l.is_finite() && u.is_finite(), value.abs().max(usual)) {
            (true, _) => 0.5 * (u - l),
            (false, v) if v > 0.0 => v,
            _ => 1.0,
        };
        Free {
            slopes: vec![0.0; n],
            terms: 0.0,
            size,
            held: [value <= l + AT_BOUND * size, value >= u - AT_BOUND * size],
        }
    }

    /// What may not change.
    pub(super) fn held(n: usize) -> Free {
        Free { slopes: vec![0.0; n], terms: 0.0, size: 0.0, held: [true; 2] }
    }

    pub(super) fn add(&mut self, column: usize, term: f64) {
        self.slopes[column] += term;
        if column + 1 == self.slopes.len() {
            self.terms += term.abs();
        }
    }

    /// The slope along `c`, as far as bounds let it be followed, over its size.
    pub(super) fn left(&self, c: &[f64]) -> f64 {
        let g = self.slopes[0] + c.iter().zip(&self.slopes[1..]).map(|(c, s)| c * s).sum::<f64>();
        let g = if self.held[0] { g.min(0.0) } else { g };
        self.size * if self.held[1] { g.max(0.0) } else { g }
    }
}

/// All quantities that may change.
pub(super) struct Quantities {
    /// Controls `[n_stages · nu]`.
    pub(super) controls: Vec<Free>,
    /// Initial values of the states of the simulation behind the cost.
    pub(super) initial: Vec<Free>,
    /// Parameters `[np]`.
    pub(super) params: Vec<Free>,
    /// Lengths of the stages, or of the horizon.
    pub(super) lengths: Vec<Free>,
    /// Share of every stage in its length.
    pub(super) shares: Vec<f64>,
    /// Largest change of the cost by one state that changes by its range, or else the smallest change that counts.
    pub(super) states: f64,
    /// Lengths of the stages.
    pub(super) lasting: Vec<f64>,
}

impl Quantities {
    /// What the length of a stage is, and its share in that.
    pub(super) fn length(&mut self, stage: usize) -> Option<(&mut Free, f64)> {
        let at = if self.lengths.len() == 1 { 0 } else { stage };
        let share = self.shares[stage];
        self.lengths.get_mut(at).map(|l| (l, share))
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &Free> {
        self.controls.iter().chain(&self.initial).chain(&self.params).chain(&self.lengths)
    }

    /// Multiples `c [n]` of the columns, as small as they can be within `range`, that leave least of the slopes.
    pub(super) fn fit(&self, range: &[[f64; 2]]) -> Vec<f64> {
        let n = range.len();
        let mut c = vec![0.0; n];
        let mut fixed = vec![false; n];
        // what a bound holds back may not be fitted: it joins where the rest pulls it away from the bound
        let mut rows: Vec<&Free> = self.all().filter(|f| f.held == [false; 2]).collect();
        for _ in 0..=n + self.controls.len() {
            let open: Vec<usize> = (0..n).filter(|&j| !fixed[j]).collect();
            if open.is_empty() || rows.is_empty() {
                break;
            }
            let slope = |f: &Free, j: usize| f.size * f.slopes[j + 1];
            let norm = |j: usize| rows.iter().map(|f| slope(f, j).powi(2)).sum::<f64>().sqrt();
            let units: Vec<f64> = open.iter().map(|&j| Some(norm(j)).filter(|n| *n > 0.0).unwrap_or(1.0)).collect();
            let a = DMatrix::from_fn(rows.len(), open.len(), |i, j| slope(rows[i], open[j]) / units[j]);
            let held = |f: &Free| (0..n).filter(|&j| fixed[j]).map(|j| c[j] * slope(f, j)).sum::<f64>();
            let b = DVector::from_fn(rows.len(), |i, _| -rows[i].size * rows[i].slopes[0] - held(rows[i]));
            if !a.iter().chain(b.iter()).all(|v| v.is_finite()) {
                break;
            }
            let Ok(found) = a.svd(true, true).solve(&b, RANK) else { break };
            open.iter().zip(found.iter().zip(&units)).for_each(|(&j, (v, u))| c[j] = v / u);
            let outside = |j: usize| (range[j][0] - c[j]).max(c[j] - range[j][1]);
            let worst = open.iter().copied().max_by(|&i, &j| outside(i).total_cmp(&outside(j)));
            if let Some(j) = worst.filter(|&j| outside(j) > 0.0) {
                c[j] = c[j].clamp(range[j][0], range[j][1]);
                fixed[j] = true;
                continue;
            }
            let known = rows.len();
            let pulled = self.all().filter(|f| f.held != [false; 2] && f.held != [true; 2] && f.left(&c).abs() > 0.0);
            let more: Vec<&Free> = pulled.filter(|f| !rows.iter().any(|r| std::ptr::eq(*r, *f))).collect();
            rows.extend(more);
            if rows.len() == known {
                break;
            }
        }
        c
    }
}

impl Judge<'_> {
    /// Sweeps backwards through the stages and adds up the slopes of all quantities. Returns for every kink what every
    /// column of the costate behind it says of the multiple of its gradient that the costate jumps by: with the switch in
    /// the stage before, and in the one behind.
    pub(super) fn sweep(&self, legs: &[Leg], kinks: &[Corner], outer: &Outer, q: &mut Quantities) -> Vec<Sides> {
        let (n, n_z) = (self.n(), self.n() + self.n_p + self.n_u);
        let n_columns = 2 + kinks.len() + outer.held.len();
        let mut columns = vec![vec![0.0; n]; n_columns];
        columns[0][0] = 1.0;
        columns[n_columns - 1][0] = 1.0;
        // what shifts everything behind by a unit of time
        let mut clock = 0.0;
        let mut sides = vec![[None, None]; kinks.len()];
        for (i, b) in kinks.iter().enumerate() {
            let own = &mut q.controls[b.own * self.n_u..(b.own + 1) * self.n_u];
            own.iter_mut().zip(&b.controls).for_each(|(u, n)| u.add(1 + i, *n));
        }
        for (k, leg) in legs.iter().enumerate().rev() {
            for (m, piece) in leg.pieces.iter().enumerate().rev() {
                let mut force: Vec<Vec<f64>> =
                    (0..columns.len()).map(|c| self.force(outer, c, kinks.len(), piece)).collect();
                if let Some(moves) = &piece.moves {
                    let own = &mut q.controls[k * self.n_u..(k + 1) * self.n_u];
                    for (c, force) in force.iter_mut().enumerate() {
                        let share = dot(&moves.arrival, force);
                        force.iter_mut().zip(&moves.normal).for_each(|(f, n)| *f -= share * n);
                        own.iter_mut().zip(&moves.controls).for_each(|(u, n)| u.add(c, -share * n));
                    }
                }
                for (i, b) in kinks.iter().enumerate() {
                    if b.at() == Some(piece.at.at) {
                        pass(&mut columns, i, b, &mut sides[i]);
                    }
                }
                let end = m + 1 == leg.pieces.len();
                if end {
                    let goes = |(r, c): (usize, &Held)| c.along.then(|| (1 + kinks.len() + r, self.held_at(c, piece)));
                    let mut along = vec![(0, self.at_point(self.along, piece))];
                    along.extend(outer.held.iter().enumerate().filter_map(goes));
                    for (b, sides) in kinks.iter().zip(&mut sides).filter(|(b, _)| b.stage == k + 1) {
                        for (side, arrival) in sides.iter_mut().zip(b.arrivals()) {
                            if let (Some(s), Some(a)) = (side, arrival) {
                                along.iter().for_each(|(c, force)| s[*c] -= dot(a, force));
                            }
                        }
                    }
                }
                columns.iter_mut().zip(&force).for_each(|(l, f)| l.iter_mut().zip(f).for_each(|(l, f)| *l += f));
                // a surface that is touched at the end of the horizon: what the state there costs is behind it
                if end && k + 1 == legs.len() {
                    for (i, b) in kinks.iter().enumerate().filter(|(_, b)| b.stage == legs.len()) {
                        pass(&mut columns, i, b, &mut sides[i]);
                    }
                }
                let late = outer.clock.map_or(0.0, |c| outer.gradient[piece.at.at + c]);
                if let Some((length, share)) = q.length(k) {
                    for (c, (column, force)) in columns.iter().zip(&force).enumerate() {
                        let (moved, part) = if end { (column, 1.0) } else { (force, piece.at.share) };
                        length.add(c, share * part * dot(moved, &piece.rate));
                    }
                    length.add(0, share * if end { clock + late } else { piece.at.share * late });
                }
                clock += late;
                for (i, b) in kinks.iter().enumerate().filter(|(_, b)| b.stage == k) {
                    let Kind::Control { beyond } = &b.kind else { continue };
                    let side = sides[i][0].get_or_insert_with(|| vec![0.0; columns.len()]);
                    side.iter_mut().zip(&columns).for_each(|(s, l)| *s += dot(&beyond[m], l));
                }
                for (c, column) in columns.iter_mut().enumerate() {
                    let mut back = vec![0.0; n];
                    for (row, l) in piece.s.chunks_exact(n_z).zip(column.iter()).filter(|r| *r.1 != 0.0) {
                        back.iter_mut().zip(row).for_each(|(b, s)| *b += l * s);
                        q.params.iter_mut().zip(&row[n..]).for_each(|(p, s)| p.add(c, l * s));
                        let own = &mut q.controls[k * self.n_u..(k + 1) * self.n_u];
                        own.iter_mut().zip(&row[n + self.n_p..]).for_each(|(u, s)| u.add(c, l * s));
                    }
                    *column = back;
                }
                let change = |(l, r): (&f64, &f64)| (l * r).abs();
                q.states = columns[n_columns - 1].iter().zip(&self.ranges).map(change).fold(q.states, f64::max);
            }
            let at_start =
                |b: &Corner| b.stage == k && matches!(b.kind, Kind::Switch { .. } | Kind::Peak { at: None, .. });
            for (i, b) in kinks.iter().enumerate().filter(|(_, b)| at_start(b)) {
                pass(&mut columns, i, b, &mut sides[i]);
            }
        }
        for (c, column) in columns.iter().enumerate() {
            q.initial.iter_mut().zip(&column[1..]).for_each(|(x, l)| x.add(c, *l));
        }
        sides
    }

    /// What acts on the states at the end of a piece in a column.
    pub(super) fn force(&self, outer: &Outer, column: usize, n_kinks: usize, piece: &Piece) -> Vec<f64> {
        match column.checked_sub(1 + n_kinks) {
            Some(r) => outer.held.get(r).map_or_else(|| self.at_point(&outer.cost, piece), |c| self.held_at(c, piece)),
            None if column == 0 => self.at_point(&outer.gradient, piece),
            None => vec![0.0; self.n()],
        }
    }

    /// The gradient of a constraint in the states of the simulation at the end of a piece.
    fn held_at(&self, c: &Held, piece: &Piece) -> Vec<f64> {
        let mut out = vec![0.0; self.n()];
        for &(v, g) in &c.gradient {
            if let Some(i) = v.checked_sub(piece.at.at).and_then(|i| self.places.iter().position(|p| *p == Some(i))) {
                out[i] += g;
            }
        }
        out
    }

    /// What of a gradient in the variables of the answer belongs to the states of the simulation at the end of a piece.
    fn at_point(&self, gradient: &[f64], piece: &Piece) -> Vec<f64> {
        self.places.iter().map(|p| p.map_or(0.0, |i| gradient[piece.at.at + i])).collect()
    }
}

fn pass(columns: &mut [Vec<f64>], i: usize, corner: &Corner, sides: &mut Sides) {
    *sides = corner.sides().map(|of| of.map(|jump| columns.iter().map(|l| dot(jump, l)).collect()));
    columns[1 + i].iter_mut().zip(&corner.normal).for_each(|(l, n)| *l += n);
}

impl Quantities {
    /// What the slopes say with those multipliers of kinks and of the constraints `held` that prove most; `own` controls of every stage are
    /// the user's.
    pub(super) fn verdict(&self, kinks: &[Corner], sides: &[Sides], held: &[Held], own: usize) -> Optimality {
        let finite = |v: &[f64]| v.iter().all(|v| v.is_finite());
        if !self.all().all(|f| finite(&f.slopes)) || !sides.iter().flatten().flatten().all(|s| finite(s)) {
            return Optimality::unknown(WITHOUT_DERIVATIVES);
        }
        let scale = self.all().fold(self.states, |m, f| m.max(f.size * f.terms)).max(f64::MIN_POSITIVE);
        let left = |c: &[f64]| self.all().fold(0f64, |m, f| m.max(f.left(c).abs())) / scale;
        let any = [f64::NEG_INFINITY, f64::INFINITY];
        // at a touched surface the multiplier of staying on this side is not negative
        let stays = |k: &Corner| if k.touches() { [0.0, f64::INFINITY] } else { any };
        let mut range: Vec<[f64; 2]> = kinks.iter().map(stays).collect();
        range.extend(held.iter().map(Held::range));
        let jump = |of: &Option<Vec<f64>>, c: &[f64]| of.as_ref().map(|s| s[0] + dot(&s[1..], c));
        let mut c = self.fit(&range);
        // where several multiples do, one between the two sides is wanted
        for i in (0..kinks.len()).rev().filter(|&i| !matches!(kinks[i].kind, Kind::Touch { .. })) {
            let [before, after] = [jump(&sides[i][0], &c), jump(&sides[i][1], &c)];
            let [least, most] = stays(&kinks[i]);
            let (high, low) = (before.unwrap_or(most), after.unwrap_or(least));
            if low <= high && !(low..=high).contains(&c[i]) {
                range[i] = [low, high];
                let other = self.fit(&range);
                if left(&other) > NONE.max(left(&c)) {
                    range[i] = [least, most];
                } else {
                    c = other;
                }
            }
        }
        let conditions = self.conditions(kinks, sides, scale);
        // least squares share what they cannot take away: whether some multipliers do is another question
        let decided = if conditions.worst(&c) <= NONE { None } else { conditions.best(&range) };
        let undecided = decided.is_none();
        if let Some(best) = decided.filter(|best| conditions.worst(best) <= NONE) {
            c = best;
        }
        let residual = left(&c);
        let one_sided = |i: usize| conditions.sides[i].clone().map(|side| side.map_or(f64::NAN, |side| side.at(&c)));
        let kink = |(i, b): (usize, &Corner)| {
            let [before, after] = one_sided(i);
            Kink { stage: b.stage, t: b.t, before, after, touch: b.touches() }
        };
        let found: Vec<Kink> = kinks.iter().enumerate().map(kink).collect();
        let falls = |k: &Kink| k.before < -NONE || k.after < -NONE;
        let (verdict, reason) = if !residual.is_finite() {
            (Verdict::Unknown, WITHOUT_DERIVATIVES)
        } else if residual > NONE || found.iter().any(falls) {
            if undecided {
                (Verdict::Unknown, UNDECIDED)
            } else {
                (Verdict::NotOptimal, "")
            }
        } else if found.is_empty() {
            (Verdict::LocalOptimum, "")
        } else {
            (Verdict::Kink, "")
        };
        let all = (self.controls.len() / self.shares.len()).max(1);
        let users = || self.controls.iter().enumerate().filter(|(i, _)| i % all < own).map(|(_, f)| f);
        let worst =
            found.iter().enumerate().map(|(i, k)| (i, k.before.min(k.after))).min_by(|a, b| a.1.total_cmp(&b.1));
        // the surface of a kink is reached earlier, or later
        let across = |i: usize, earlier: bool| -> Vec<f64> {
            let sign = if found[i].touch || earlier { 1.0 } else { -1.0 };
            users().map(|f| sign * f.size * f.size * f.slopes[1 + i]).collect()
        };
        let scaled = |mut d: Vec<f64>| -> Vec<f64> {
            let shares = d.iter().zip(users()).map(|(d, f)| if f.size > 0.0 { d.abs() / f.size } else { 0.0 });
            let largest = shares.fold(0.0, f64::max);
            if !(largest > 0.0 && largest.is_finite()) {
                d.clear();
            }
            d.iter_mut().for_each(|d| *d /= largest);
            d
        };
        // of what the derivatives leave and what kinks do, the steeper
        let direction: Vec<f64> = match worst.filter(|w| w.1 < -NONE.max(residual)) {
            _ if verdict != Verdict::NotOptimal => Vec::new(),
            // towards the side of the kink that is lower
            Some((i, low)) => scaled(across(i, found[i].before == low)),
            // what least squares leave goes along the constraints that act
            None => scaled(users().map(|f| -f.size * f.left(&c)).collect()),
        };
        let gradient = users().map(|f| f.slopes[0] + dot(&c, &f.slopes[1..])).collect();
        let gap = f64::NAN;
        Optimality { verdict, reason, gap, residual, gradient, kinks: found, direction, others: false }
    }
}
