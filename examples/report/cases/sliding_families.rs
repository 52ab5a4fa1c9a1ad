//! Every Runge-Kutta family on the sliding-mode problem (7.51): both forms, with and without switch detection, work
//! against the error of the terminal constraint (Fig. 7.13), and what that says of the families.

use super::sliding_ocp::{measure, Run};
use super::BOTH;
use crate::json::{Object, Table};
use crate::svg::{Mark, Plot};
use crate::Context;
use switchback::settings::{DcsForm, Discretisation, RkFamily};

/// Families, with their numbers of stages.
const FAMILIES: [(RkFamily, std::ops::RangeInclusive<usize>); 7] = [
    (RkFamily::RadauIia, 1..=4),
    (RkFamily::RadauIa, 1..=4),
    (RkFamily::GaussLegendre, 1..=4),
    (RkFamily::LobattoIiia, 2..=4),
    (RkFamily::LobattoIiib, 2..=4),
    (RkFamily::LobattoIiic, 2..=4),
    (RkFamily::Explicit, 1..=4),
];
const FORMS: [DcsForm; 2] = [DcsForm::Stewart, DcsForm::Heaviside];
const ELEMENTS: std::ops::RangeInclusive<usize> = 1..=7;
/// Elements of the standard discretisation beyond those, so that the fronts overlap in time.
const FINER: [usize; 2] = [12, 24];
/// Cost known of the library the problem comes from.
const KNOWN_COST: f64 = 9.157_859_2;

/// Runs of one family, form and discretisation.
struct Group {
    family: RkFamily,
    form: DcsForm,
    disc: Discretisation,
    runs: Vec<Run>,
}

impl Group {
    fn solved(&self) -> impl Iterator<Item = &Run> {
        self.runs.iter().filter(|r| r.solved)
    }

    /// Lower left hull of error over time: `(log10 s, log10 E)`, errors falling.
    fn front(&self) -> Vec<(f64, f64)> {
        front(self.solved())
    }
}

fn front<'a>(runs: impl Iterator<Item = &'a Run>) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> =
        runs.filter(|r| r.error.is_finite()).map(|r| (r.seconds.log10(), r.error.max(1e-16).log10())).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut best = f64::INFINITY;
    points.retain(|p| {
        let better = p.1 < best;
        best = best.min(p.1);
        better
    });
    points
}

/// Error of a front at this time, by interpolation; none before its first point.
fn at(front: &[(f64, f64)], t: f64) -> Option<f64> {
    let k = front.partition_point(|p| p.0 <= t);
    let a = front.get(k.checked_sub(1)?)?;
    Some(front.get(k).map_or(a.1, |b| a.1 + (b.1 - a.1) * (t - a.0) / (b.0 - a.0)))
}

/// Decades between two fronts at equal time: the median and the largest over the times that both have runs at.
fn decades(slow: &[(f64, f64)], fast: &[(f64, f64)]) -> Option<(f64, f64)> {
    let from = slow.first()?.0.max(fast.first()?.0);
    let to = slow.last()?.0.max(fast.last()?.0);
    let gains: Vec<f64> = (0..=40)
        .filter_map(|k| {
            let t = from + (to - from) * f64::from(k) / 40.0;
            Some(at(slow, t)? - at(fast, t)?)
        })
        .collect();
    let largest = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some((median(gains)?, largest))
}

fn median(mut v: Vec<f64>) -> Option<f64> {
    v.sort_by(f64::total_cmp);
    v.get(v.len() / 2).copied()
}

/// The sweep; where all cases run, a sample of it: Stewart's form, three stages.
pub fn run(c: &Context) {
    c.say("Lobatto IIIB only with switch detection: at fixed stage points it cannot hold a sliding mode");
    let mut groups = Vec::new();
    let wanted = |f: RkFamily| c.method.as_deref().is_none_or(|m| m == f.name());
    for (family, stages) in FAMILIES.into_iter().filter(|f| wanted(f.0)) {
        for form in FORMS.into_iter().filter(|f| !c.all || *f == DcsForm::Stewart) {
            for disc in BOTH {
                // the last stage of these methods moves no other: with the steps fixed the stage points of a sliding mode
                // have an equation too many
                if family == RkFamily::LobattoIiib && disc == Discretisation::Standard {
                    continue;
                }
                let mut runs = Vec::new();
                for n_s in stages.clone().filter(|n| !c.all || *n == 3) {
                    let finer: &[usize] = if disc == Discretisation::Standard { &FINER } else { &[] };
                    for n_fe in ELEMENTS.chain(finer.iter().copied()) {
                        let r = measure(c, (family, n_s, n_fe, disc, form));
                        c.say(&r.line());
                        runs.push(r);
                    }
                }
                groups.push(Group { family, form, disc, runs });
            }
        }
    }
    summary(c, &groups);
    plots(c, &groups);
}

fn counts(c: &Context, label: [&str; 3], runs: &[&Run], gain: Option<(f64, f64)>, table: &mut Table) {
    let solved: Vec<&&Run> = runs.iter().filter(|r| r.solved).collect();
    let exact = solved.iter().filter(|r| r.exact).count();
    let known = solved.iter().filter(|r| r.cost <= KNOWN_COST && r.error < 1e-6).count();
    let best = solved.iter().filter(|r| r.error < 1e-6).map(|r| r.cost).fold(f64::INFINITY, f64::min);
    let error = median(solved.iter().map(|r| r.error).collect()).unwrap_or(f64::NAN);
    let ms = median(solved.iter().map(|r| 1e3 * r.seconds).collect()).unwrap_or(f64::NAN);
    let (mid, top) = gain.unwrap_or((f64::NAN, f64::NAN));
    let o = Object::new().text("case", "sliding-ocp-summary").text("method", label[0]).text("dcs_form", label[1]);
    let o = o.text("discretisation", label[2]).int("runs", runs.len()).int("solved", solved.len());
    let o = o.int("exact", exact).int("known_cost", known).num("best_cost", best).num("median_error", error);
    c.record(&o.num("median_ms", ms).num("decades_median", mid).num("decades_largest", top));
    let or_dash = |v: f64, s: String| if v.is_finite() { s } else { "-".into() };
    let [family, form, disc] = label.map(String::from);
    table.row(vec![
        family,
        form,
        disc,
        format!("{} of {}", solved.len(), runs.len()),
        exact.to_string(),
        known.to_string(),
        or_dash(best, format!("{best:.7}")),
        format!("{error:.1e}"),
        format!("{ms:.1}"),
        or_dash(mid, format!("{mid:.1}")),
        or_dash(top, format!("{top:.1}")),
    ]);
}

fn summary(c: &Context, groups: &[Group]) {
    let mut table = Table::new(&[
        "method",
        "form",
        "discretisation",
        "solved",
        "exact",
        "cost <= 9.1578592",
        "best cost",
        "median E(T)",
        "median ms",
        "decades",
        "most",
    ]);
    for g in groups {
        let other = groups.iter().find(|o| (o.family, o.form) == (g.family, g.form) && o.disc != g.disc);
        let gain = other.filter(|_| g.disc == Discretisation::Fesd).and_then(|o| decades(&o.front(), &g.front()));
        let runs: Vec<&Run> = g.runs.iter().collect();
        counts(c, [g.family.name(), g.form.name(), g.disc.name()], &runs, gain, &mut table);
    }
    let of = |disc| groups.iter().filter(move |g| g.disc == disc).flat_map(|g| &g.runs).collect::<Vec<&Run>>();
    let [fesd, standard] = [of(Discretisation::Fesd), of(Discretisation::Standard)];
    let fronts = [&standard, &fesd].map(|runs| front(runs.iter().copied().filter(|r| r.solved)));
    counts(c, ["all", "both", "fesd"], &fesd, decades(&fronts[0], &fronts[1]), &mut table);
    counts(c, ["all", "both", "standard"], &standard, None, &mut table);
    let all: Vec<&Run> = fesd.into_iter().chain(standard).collect();
    counts(c, ["all", "both", "both"], &all, None, &mut table);
    c.say(&table.text());
}

fn plots(c: &Context, groups: &[Group]) {
    let mut all =
        Plot::new("Sliding-mode problem (7.51), best of all stages and elements", "seconds", "E(T)").log_log();
    for (k, (family, _)) in FAMILIES.iter().enumerate() {
        let title = format!("Sliding-mode problem (7.51), {}", family.name());
        let mut p = Plot::new(&title, "seconds", "E(T)").log_log();
        for g in groups.iter().filter(|g| g.family == *family) {
            let colour =
                2 * usize::from(g.disc == Discretisation::Standard) + usize::from(g.form == DcsForm::Heaviside);
            let points = g.solved().map(|r| (r.seconds, r.error.max(1e-16))).collect();
            p.add_coloured(&format!("{}, {}", g.disc.name(), g.form.name()), Mark::Dots, colour, points);
        }
        c.plot(&p, &format!("sliding-ocp-{}.svg", family.name()));
        for disc in BOTH {
            let of = groups.iter().filter(|g| g.family == *family && g.disc == disc);
            let hull = front(of.flat_map(|g| g.solved()));
            let points = hull.iter().map(|p| (10f64.powf(p.0), 10f64.powf(p.1))).collect();
            let (label, mark) = match disc {
                Discretisation::Fesd => (family.name(), Mark::LineDots),
                Discretisation::Standard => ("", Mark::Dashed),
            };
            all.add_coloured(label, mark, k, points);
        }
    }
    c.plot(&all, "sliding-ocp-families.svg");
}
