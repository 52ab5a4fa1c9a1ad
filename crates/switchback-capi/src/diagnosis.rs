//! What the last solve of a program says about itself: names, worst violations, statistics, reports.

use super::guard::{guard, query};
use super::handle::{self, setting};
use super::mpcc::{swb_mpcc, Outcome1, Program};
use super::raw;
use super::report::{swb_linear_stats, swb_residuals, write_sized};
use super::status::swb_status;
use std::ffi::{c_char, CStr};
use std::fmt::Write as _;
use std::ptr;
use switchback::error::{Error, Result};
use switchback::mpcc::diagnostics::{self, Warning};
use switchback::mpcc::{BStationarity, Certificate, Doubt, FoundBy, Polish, Stationarity};
use switchback::nlp::Residuals;
use switchback::nlp::SecondOrder;

/// Parts of a program that have names and can be violated. The first two are those of enum swb_member.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_item {
    /// A variable, by its bounds.
    Variable = 0,
    /// A row of the constraints, by its bounds.
    Constraint = 1,
    /// A complementarity pair, in the order they were added, by min(G, H).
    Pair = 2,
    /// A box, in the order they were added, by the distance of its variable and constraint from complementarity.
    Box = 3,
}

const ITEMS: [(swb_item, &str); 4] = [
    (swb_item::Variable, "variable"),
    (swb_item::Constraint, "constraint"),
    (swb_item::Pair, "pair"),
    (swb_item::Box, "box"),
];

impl swb_item {
    fn of(kind: i32) -> Result<swb_item> {
        let found = ITEMS.iter().find(|i| i.0 as i32 == kind).map(|i| i.0);
        found.ok_or_else(|| Error::Range(format!("the kind of item is {kind}: it must be an enum swb_item")))
    }

    pub(super) fn word(self) -> &'static str {
        ITEMS[self as usize].1
    }
}

/// The strongest type of stationarity for which multipliers of the pairs are known; nu of G, xi of H, at pairs of which
/// both members are zero.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_stationarity {
    /// Strong: both not negative.
    S = 0,
    /// Mordukhovich: both positive, or one of them zero.
    M = 1,
    /// Clarke: the product not negative.
    C = 2,
    /// Abadie: one of them not negative.
    A = 3,
    /// Weak: any signs.
    W = 4,
    /// There are no multipliers at all.
    None = 5,
    /// Not known: the point is no exact one, or certificates are off.
    Unknown = 6,
}

/// Answers to whether no step to first order leads to a better point.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_b_stationarity {
    /// None does: a B-stationary point, which has no descent.
    Yes = 0,
    /// There is a descent.
    No = 1,
    /// Not decided; the doubt says why.
    Undecided = 2,
}

/// Reasons why a certificate does not say more.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_doubt {
    /// Nothing.
    None = 0,
    /// Values that are not finite.
    Data = 1,
    /// The point violates constraints, bounds or pairs.
    Infeasible = 2,
    /// Too many pairs of which both members are zero.
    Nodes = 3,
    /// A linear program could not be solved well enough to believe it.
    Accuracy = 4,
    /// Interrupted, or out of time.
    Stopped = 5,
}

/// Verdicts of the conditions of second order on a point with multipliers of type S.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum swb_second_order {
    /// Sufficient conditions hold: a local minimum, and the only one near by.
    StrictMinimum = 0,
    /// The objective falls along the active constraints, whose gradients are independent: no local minimum.
    Saddle = 1,
    /// Neither could be shown.
    Undecided = 2,
    /// Not asked, or no point with multipliers of type S.
    Unknown = 3,
}

const SECOND_ORDERS: &[(SecondOrder, swb_second_order, &CStr)] = &[
    (SecondOrder::StrictMinimum, swb_second_order::StrictMinimum, c"strict_minimum"),
    (SecondOrder::Saddle, swb_second_order::Saddle, c"saddle"),
    (SecondOrder::Undecided, swb_second_order::Undecided, c"undecided"),
    (SecondOrder::Unknown, swb_second_order::Unknown, c"unknown"),
];

const STATIONARITIES: &[(Stationarity, swb_stationarity, &CStr)] = &[
    (Stationarity::S, swb_stationarity::S, c"S"),
    (Stationarity::M, swb_stationarity::M, c"M"),
    (Stationarity::C, swb_stationarity::C, c"C"),
    (Stationarity::A, swb_stationarity::A, c"A"),
    (Stationarity::W, swb_stationarity::W, c"W"),
    (Stationarity::None, swb_stationarity::None, c"none"),
    (Stationarity::Unknown, swb_stationarity::Unknown, c"unknown"),
];

const B_STATIONARITIES: &[(BStationarity, swb_b_stationarity)] = &[
    (BStationarity::Yes, swb_b_stationarity::Yes),
    (BStationarity::No, swb_b_stationarity::No),
    (BStationarity::Undecided, swb_b_stationarity::Undecided),
];

const DOUBTS: &[(Doubt, swb_doubt, &CStr)] = &[
    (Doubt::None, swb_doubt::None, c"none"),
    (Doubt::Data, swb_doubt::Data, c"data"),
    (Doubt::Infeasible, swb_doubt::Infeasible, c"infeasible"),
    (Doubt::Nodes, swb_doubt::Nodes, c"nodes"),
    (Doubt::Accuracy, swb_doubt::Accuracy, c"accuracy"),
    (Doubt::Stopped, swb_doubt::Stopped, c"stopped"),
];

/// Name of an enum swb_stationarity, such as "M"; NULL for any other number. Static.
#[no_mangle]
pub extern "C" fn swb_stationarity_name(stationarity: i32) -> *const c_char {
    query(ptr::null(), || {
        STATIONARITIES.iter().find(|row| row.1 as i32 == stationarity).map_or(ptr::null(), |row| row.2.as_ptr())
    })
}

/// Name of an enum swb_doubt, such as "nodes"; NULL for any other number. Static.
#[no_mangle]
pub extern "C" fn swb_doubt_name(doubt: i32) -> *const c_char {
    query(ptr::null(), || DOUBTS.iter().find(|row| row.1 as i32 == doubt).map_or(ptr::null(), |row| row.2.as_ptr()))
}

/// Name of an enum swb_second_order, such as "saddle"; NULL for any other number. Static.
#[no_mangle]
pub extern "C" fn swb_second_order_name(second_order: i32) -> *const c_char {
    query(ptr::null(), || {
        SECOND_ORDERS.iter().find(|row| row.1 as i32 == second_order).map_or(ptr::null(), |row| row.2.as_ptr())
    })
}

/// Knowledge of the point of a program. Without pairs type S says that it satisfies the conditions of Karush, Kuhn and Tucker.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct swb_certificate {
    /// Size of this struct in bytes.
    pub struct_size: u64,
    /// Type of stationarity (enum swb_stationarity).
    pub stationarity: i64,
    /// 1 if it is shown that there are no multipliers of a stronger type.
    pub sharp: i64,
    /// B-stationarity (enum swb_b_stationarity).
    pub b_stationarity: i64,
    /// Reason why questions are left open (enum swb_doubt).
    pub doubt: i64,
    /// Pairs of which both members are zero.
    pub biactive: i64,
    /// Smallest of their multipliers, over the largest modulus there or 1; 0 without such pairs.
    pub min_multiplier: f64,
    /// 1 if none of their multipliers is zero.
    pub strict: i64,
    /// Linear programs solved.
    pub lps: i64,
    /// Iterations in them.
    pub lp_iterations: i64,
    /// Nodes of the searches.
    pub nodes: i64,
    /// Verdict of the conditions of second order (enum swb_second_order). Discretised problems with modes are not asked.
    pub second_order: i64,
    /// Active constraints and bounds whose gradients depend on those of others; 0 where the conditions of second order were not
    /// looked at.
    pub dependent: i64,
    /// No point of the program has a lower objective than this, as branch and bound has shown (option branch_work); at the solution,
    /// up to rounding, where that is global. Minus infinity where nothing is shown.
    pub bound: f64,
}

impl swb_certificate {
    pub(super) fn of(c: &Certificate) -> swb_certificate {
        let number = |list: Option<i32>| i64::from(list.unwrap_or(-1));
        swb_certificate {
            struct_size: 0,
            stationarity: number(STATIONARITIES.iter().find(|r| r.0 == c.stationarity).map(|r| r.1 as i32)),
            sharp: c.sharp.into(),
            b_stationarity: number(B_STATIONARITIES.iter().find(|r| r.0 == c.b).map(|r| r.1 as i32)),
            doubt: number(DOUBTS.iter().find(|r| r.0 == c.doubt).map(|r| r.1 as i32)),
            biactive: c.biactive as i64,
            min_multiplier: c.min_multiplier,
            strict: c.ulsc.into(),
            lps: c.lps as i64,
            lp_iterations: c.lp_iterations as i64,
            nodes: c.nodes as i64,
            second_order: number(SECOND_ORDERS.iter().find(|r| r.0 == c.second).map(|r| r.1 as i32)),
            dependent: c.dependent as i64,
            bound: c.bound.unwrap_or(f64::NEG_INFINITY),
        }
    }
}

/// Names that the user gave.
#[derive(Default)]
pub(super) struct Names([Vec<Option<String>>; 4]);

impl Names {
    /// Makes room for, or drops, names at the end.
    pub fn set_len(&mut self, kind: swb_item, len: usize) {
        self.0[kind as usize].resize(len, None);
    }

    pub fn get(&self, kind: swb_item, i: usize) -> Option<&str> {
        self.0[kind as usize].get(i)?.as_deref()
    }

    /// The name, or kind and number.
    pub fn label(&self, kind: swb_item, i: usize) -> String {
        self.get(kind, i).map_or_else(|| format!("{} {i}", kind.word()), str::to_owned)
    }
}

impl Program {
    fn count(&self, kind: swb_item) -> usize {
        match kind {
            swb_item::Variable => self.n,
            swb_item::Constraint => self.m,
            swb_item::Pair => self.members.len(),
            swb_item::Box => self.boxes.len(),
        }
    }

    fn index(&self, kind: swb_item, i: i64) -> Result<usize> {
        let len = self.count(kind);
        usize::try_from(i)
            .ok()
            .filter(|i| *i < len)
            .ok_or_else(|| Error::Dimension(format!("there is no {} {i}, only 0..{len}", kind.word())))
    }

    fn set_name(&mut self, kind: swb_item, i: usize, name: Option<&str>) {
        let len = self.count(kind);
        self.names.set_len(kind, len);
        self.names.0[kind as usize][i] = name.filter(|n| !n.is_empty()).map(str::to_owned);
    }

    /// What is violated, the worst first.
    pub(super) fn worst(&self) -> Result<Vec<(swb_item, usize, f64)>> {
        let r = self.result()?;
        let Some(local) = r.local() else { return Ok(Vec::new()) };
        let mut list = Vec::new();
        for (item, by) in diagnostics::worst(&local) {
            let (kind, i) = self.own(r, item);
            list.push((kind, i, by));
        }
        self.once(&mut list);
        Ok(list)
    }

    /// What conflicts in an infeasible program, with weights, the heaviest first.
    pub(super) fn conflict(&self) -> Result<Vec<(swb_item, usize, f64)>> {
        let r = self.result()?;
        let Some(conflict) = &r.solution.conflict else { return Ok(Vec::new()) };
        let rows = conflict.rows.iter().map(|&(i, w)| (diagnostics::Item::Row(i), w));
        let variables = conflict.variables.iter().map(|&(j, w)| (diagnostics::Item::Variable(j), w));
        let mut all: Vec<_> = rows.chain(variables).map(|(item, w)| (self.own(r, item), w)).collect();
        all.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        let mut all = all.into_iter().map(|((kind, i), w)| (kind, i, w)).collect();
        self.once(&mut all);
        Ok(all)
    }

    /// Members of a pair or box, their rows and the pair itself are one item, the first of them.
    fn once(&self, list: &mut Vec<(swb_item, usize, f64)>) {
        let (mut pairs, mut boxes) = (vec![false; self.members.len()], vec![false; self.boxes.len()]);
        list.retain(|(kind, i, _)| match kind {
            swb_item::Pair => !std::mem::replace(&mut pairs[*i], true),
            swb_item::Box => !std::mem::replace(&mut boxes[*i], true),
            _ => true,
        });
    }

    pub(super) fn warnings(&self, r: &Outcome1) -> Vec<String> {
        let Some(local) = r.local() else { return Vec::new() };
        let name = |row: usize| {
            let (kind, i) = self.own(r, diagnostics::Item::Row(row));
            self.names.label(kind, i)
        };
        diagnostics::warnings(&local).iter().map(|w: &Warning| w.text(&name)).collect()
    }

    /// The violations that matter, as a line of the log.
    pub(super) fn worst_line(&self) -> String {
        self.line("mpcc worst", &self.worst().unwrap_or_default())
    }

    /// What conflicts, likewise.
    pub(super) fn conflict_line(&self) -> String {
        self.line("mpcc conflict", &self.conflict().unwrap_or_default())
    }

    fn line(&self, what: &str, list: &[(swb_item, usize, f64)]) -> String {
        const SHOWN: usize = 5;
        let mut shown: Vec<String> =
            list.iter().take(SHOWN).map(|(kind, i, v)| format!("{} = {v:.2e}", self.names.label(*kind, *i))).collect();
        if list.len() > SHOWN {
            shown.push(format!("more = {}", list.len() - SHOWN));
        }
        // nothing is known where a solve was cut short: no line then
        if shown.is_empty() {
            String::new()
        } else {
            format!("{what} {}", shown.join(", "))
        }
    }
}

// --- reports ------------------------------------------------------------------------------------------

/// Name of an end of the polish.
pub(super) fn polish_name(p: Polish) -> &'static str {
    match p {
        Polish::None => "none",
        Polish::Done => "done",
        Polish::Rejected => "rejected",
    }
}

fn residual_rows(r: &Residuals) -> [(&'static str, f64); 5] {
    [
        ("primal", r.primal),
        ("dual", r.dual),
        ("complementarity", r.complementarity),
        ("pair_product", r.pair_product),
        ("pair_min", r.pair_min),
    ]
}

/// Entries in the lists of reports.
pub(super) const SHOWN: usize = 10;

impl Program {
    fn report_text(&self) -> Result<String> {
        let r = self.result()?;
        let (s, t) = (&r.solution, &r.solution.stats);
        let mut out = String::new();
        let mut line = |name: &str, value: String| {
            let _ = writeln!(out, "{name:<22} {value}");
        };
        line("outcome", s.outcome.name().to_owned());
        line("polish", polish_name(s.polish).to_owned());
        line("objective", format!("{:.10e}", s.objective));
        if s.found_by != FoundBy::Path {
            line("found by", s.found_by.name().to_owned());
        }
        if self.members.len() + self.boxes.len() > 0 {
            let c = &s.certificate;
            let sharp = if c.sharp { " (none stronger)" } else { "" };
            let doubt = if c.doubt == Doubt::None { String::new() } else { format!(", in doubt: {}", c.doubt.name()) };
            let biactive = format!("{} pairs with both members zero", c.biactive);
            line(
                "stationarity",
                format!("{}{sharp}, B-stationary: {}, {biactive}{doubt}", c.stationarity.name(), c.b.name()),
            );
        }
        if let Some(bound) = s.certificate.bound {
            let gap = (s.objective - bound).max(0.0);
            line("bound", format!("no point has an objective below {bound:.10e} (gap {gap:.1e})"));
        }
        if s.certificate.second != SecondOrder::Unknown {
            let c = &s.certificate;
            line("second order", format!("{}, {} dependent active constraints", c.second.name(), c.dependent));
        }
        let boxes = if self.boxes.is_empty() { String::new() } else { format!(", {} boxes", self.boxes.len()) };
        let pairs = self.members.len();
        line("program", format!("{} variables, {} constraints, {pairs} pairs{boxes}", self.n, self.m));
        line(
            "iterations",
            format!(
                "{} ({} in restoration, {} in the polish), {} evaluations, {} factorisations",
                t.iterations, t.restoration_iterations, t.polish_iterations, t.evaluations, t.factorisations
            ),
        );
        if t.moved_bounds > 0 {
            line(
                "no interior",
                format!("{} bounds were moved outwards by 1e-9; the polish takes that back", t.moved_bounds),
            );
        }
        line(
            "time",
            format!("{:.3e} s (functions {:.3e}, linear algebra {:.3e})", t.time_total, t.time_eval, t.time_linalg),
        );
        line(
            "linear algebra",
            format!(
                "{}, order {}, {} entries in the factor, pivots {:.1e} to {:.1e}",
                r.linear.backend, r.linear.n, r.linear.nnz_l, r.linear.min_abs_pivot, r.linear.max_abs_pivot
            ),
        );
        line("residuals", "  unscaled    scaled".to_owned());
        for ((name, plain), (_, scaled)) in residual_rows(&r.residuals).into_iter().zip(residual_rows(&r.scaled)) {
            line(&format!("  {name}"), format!("{plain:>10.2e}{scaled:>10.2e}"));
        }
        let worst = self.worst()?;
        if !worst.is_empty() {
            line("worst violations", String::new());
        }
        for (kind, i, by) in worst.iter().take(SHOWN) {
            line(&format!("  {}", self.names.label(*kind, *i)), format!("{by:>10.2e}"));
        }
        if let Some(conflict) = &s.conflict {
            line("conflict", format!("gap {:.2e}, residual {:.2e}", conflict.gap, conflict.residual));
        }
        for (kind, i, w) in self.conflict()?.iter().take(SHOWN) {
            line(&format!("  {}", self.names.label(*kind, *i)), format!("{w:>10.2e}"));
        }
        for w in self.warnings(r) {
            line("warning", w);
        }
        Ok(out)
    }
}

// --- exports ------------------------------------------------------------------------------------------

/// Name a variable, a constraint, a pair or a box: reports and messages of the log use it.
///
/// @param[in] kind  an enum swb_item
/// @param[in] index its number; pairs and boxes count in the order they were added
/// @param[in] name  copied; NULL or "" takes a name away
/// @return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if there is no such index
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_name(
    mpcc: *mut swb_mpcc,
    kind: i32,
    index: i64,
    name: *const c_char,
) -> swb_status {
    setting(mpcc, || unsafe {
        let name = if name.is_null() { None } else { Some(raw::text(name, "name")?) };
        handle::with_mut(mpcc, |p| {
            let kind = swb_item::of(kind)?;
            let i = p.index(kind, index)?;
            p.set_name(kind, i, name);
            Ok(())
        })
    })
}

/// Name all variables, constraints, pairs or boxes.
///
/// @param[in] kind  an enum swb_item
/// @param[in] names [n] copied; NULL or "" for no name
/// @param[in] n     number of variables, constraints, pairs or boxes
/// @return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if n is not their number
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_set_names(
    mpcc: *mut swb_mpcc,
    kind: i32,
    names: *const *const c_char,
    n: i64,
) -> swb_status {
    setting(mpcc, || unsafe {
        let names = raw::slice(names, n, "names")?;
        let mut texts = Vec::with_capacity(names.len());
        for (i, &name) in names.iter().enumerate() {
            texts.push(if name.is_null() { None } else { Some(raw::text(name, &format!("names[{i}]"))?) });
        }
        handle::with_mut(mpcc, |p| {
            let kind = swb_item::of(kind)?;
            if texts.len() != p.count(kind) {
                return Err(Error::Dimension(format!(
                    "{} names given for {} {}s",
                    texts.len(),
                    p.count(kind),
                    kind.word()
                )));
            }
            texts.iter().enumerate().for_each(|(i, name)| p.set_name(kind, i, *name));
            Ok(())
        })
    })
}

/// Name of a variable, constraint or pair, such as "T_out"; "variable 3" without one.
///
/// @param[in]  kind   an enum swb_item
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_RANGE if there is no such kind; SWB_ERR_DIMENSION if there is no such index or the
///         buffer is too short
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_name(
    mpcc: *const swb_mpcc,
    kind: i32,
    index: i64,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            let kind = swb_item::of(kind)?;
            let label = p.names.label(kind, p.index(kind, index)?);
            raw::write_text(raw::c_string(&label).as_bytes(), buf, len, needed)
        })
    })
}

/// Violations at the point of the last solve, the worst first: bounds by how much they are exceeded, pairs by
/// min(G, H).
///
/// @param[out] kinds      [k] enum swb_item
/// @param[out] indices    [k]
/// @param[out] violations [k] positive
/// @param[in]  k          how many are wanted at most; 0 with NULL arrays to ask for their number
/// @param[out] found      how many there are, also beyond k; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_worst(
    mpcc: *const swb_mpcc,
    kinds: *mut i32,
    indices: *mut i64,
    violations: *mut f64,
    k: i64,
    found: *mut i64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(mpcc, |p| write_items(&p.worst()?, (kinds, indices, violations), k, found)) })
}

unsafe fn write_items(
    list: &[(swb_item, usize, f64)],
    (kinds, indices, values): (*mut i32, *mut i64, *mut f64),
    k: i64,
    found: *mut i64,
) -> Result<()> {
    let room = usize::try_from(k).map_err(|_| Error::Dimension(format!("k is {k}: it must not be negative")))?;
    let n = room.min(list.len());
    if n > 0 {
        raw::check(kinds, "kinds")?;
        raw::check(indices, "indices")?;
        raw::check(values, "values")?;
    }
    let first = &list[..n];
    let column = |f: fn(&(swb_item, usize, f64)) -> f64| first.iter().map(f).collect::<Vec<_>>();
    unsafe {
        raw::write_slice(kinds, n as i64, &first.iter().map(|i| i.0 as i32).collect::<Vec<_>>(), "kinds")?;
        raw::write_slice(indices, n as i64, &first.iter().map(|i| i.1 as i64).collect::<Vec<_>>(), "indices")?;
        raw::write_slice(values, n as i64, &column(|i| i.2), "values")?;
        raw::write_optional(found, list.len() as i64);
    }
    Ok(())
}

/// Constraints, bounds and pairs that contradict each other, after the outcome SWB_OUTCOME_INFEASIBLE; the heaviest
/// first. Weights of constraints are positive where the upper bound takes part, negative where the lower one does;
/// those of variables the other way round.
///
/// The weighted sum of the constraints exceeds what their bounds allow by `gap`, and its gradient is held by the bounds
/// of the variables up to `residual`: with linear constraints a proof that there is no point, with others one to first
/// order.
///
/// @param[out] kinds    [k] enum swb_item
/// @param[out] indices  [k]
/// @param[out] weights  [k] the largest modulus of a constraint is 1
/// @param[in]  k        how many are wanted at most; 0 with NULL arrays to ask for their number
/// @param[out] found    how many there are, also beyond k; 0 without a conflict; may be NULL
/// @param[out] gap      may be NULL
/// @param[out] residual may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_conflict(
    mpcc: *const swb_mpcc,
    kinds: *mut i32,
    indices: *mut i64,
    weights: *mut f64,
    k: i64,
    found: *mut i64,
    gap: *mut f64,
    residual: *mut f64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            write_items(&p.conflict()?, (kinds, indices, weights), k, found)?;
            let proof = p.result()?.solution.conflict.as_ref().map_or((0.0, 0.0), |c| (c.gap, c.residual));
            raw::write_optional(gap, proof.0);
            raw::write_optional(residual, proof.1);
            Ok(())
        })
    })
}

/// Knowledge of the point of the last solve: type of stationarity, B-stationarity.
///
/// @param[out] certificate every field is written
/// @param[in]  struct_size sizeof(swb_certificate)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_certificate(
    mpcc: *const swb_mpcc,
    certificate: *mut swb_certificate,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            let value = swb_certificate::of(&p.result()?.solution.certificate);
            write_sized(&value, certificate, struct_size, "certificate")
        })
    })
}

/// Residuals of the last solve with objective and constraints scaled as the solver scaled them, which are those
/// that the option tol is compared with.
///
/// @param[out] residuals   every field is written
/// @param[in]  struct_size sizeof(swb_residuals)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_scaled_residuals(
    mpcc: *const swb_mpcc,
    residuals: *mut swb_residuals,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| {
            write_sized(&swb_residuals::of(&p.result()?.scaled), residuals, struct_size, "residuals")
        })
    })
}

/// Sizes, pivots and work of the linear systems, since the program was built.
///
/// @param[out] stats       every field is written
/// @param[in]  struct_size sizeof(swb_linear_stats)
/// @return SWB_OK; SWB_ERR_DIMENSION; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_get_linear_stats(
    mpcc: *const swb_mpcc,
    stats: *mut swb_linear_stats,
    struct_size: u64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| write_sized(&swb_linear_stats::of(&p.result()?.linear), stats, struct_size, "stats"))
    })
}

/// Everything about the last solve but the point, as one JSON object: see docs/mpcc.md.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return SWB_OK; SWB_ERR_DIMENSION if the buffer is too short; SWB_ERR_STATE before the first solve
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_statistics_json(
    mpcc: *const swb_mpcc,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe { handle::with_ref(mpcc, |p| raw::write_text(&p.statistics_json()?, buf, len, needed)) })
}

/// Report on the last solve for people: a table with the worst violations and what looks wrong about the program.
///
/// @param[out] buf    [len] the text with its final NUL; NULL with len 0 to ask for the length
/// @param[out] needed length with the final NUL; may be NULL
/// @return as swb_mpcc_statistics_json
#[no_mangle]
pub unsafe extern "C" fn swb_mpcc_report_text(
    mpcc: *const swb_mpcc,
    buf: *mut c_char,
    len: i64,
    needed: *mut i64,
) -> swb_status {
    guard(|| unsafe {
        handle::with_ref(mpcc, |p| raw::write_text(raw::c_string(&p.report_text()?).as_bytes(), buf, len, needed))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn certificates_are_those_of_the_solver() {
        for (s, number, name) in STATIONARITIES {
            assert_eq!((*s as i32, s.name()), (*number as i32, name.to_str().unwrap()));
        }
        for (s, number, name) in SECOND_ORDERS {
            assert_eq!((*s as i32, s.name()), (*number as i32, name.to_str().unwrap()));
        }
        for (d, number, name) in DOUBTS {
            assert_eq!((*d as i32, d.name()), (*number as i32, name.to_str().unwrap()));
        }
        for (b, number) in B_STATIONARITIES {
            assert_eq!(*b as i32, *number as i32);
        }
        assert!(
            swb_stationarity_name(7).is_null() && swb_second_order_name(4).is_null() && swb_doubt_name(-1).is_null()
        );
        let c = swb_certificate::of(&Certificate { stationarity: Stationarity::M, biactive: 3, ..Default::default() });
        assert_eq!((c.stationarity, c.b_stationarity, c.biactive), (1, 2, 3));
    }

    #[test]
    fn numbers_are_places() {
        for (place, (kind, _)) in ITEMS.iter().enumerate() {
            assert_eq!((*kind as usize, swb_item::of(place as i32).unwrap()), (place, *kind));
        }
        assert_eq!(swb_item::of(4).unwrap_err().code(), -3);
        let mut names = Names::default();
        names.set_len(swb_item::Pair, 2);
        names.0[2][1] = Some("valve".into());
        assert_eq!(names.label(swb_item::Pair, 1), "valve");
        assert_eq!(names.label(swb_item::Pair, 0), "pair 0");
        assert_eq!(names.label(swb_item::Variable, 7), "variable 7");
    }
}
