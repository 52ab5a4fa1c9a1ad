//! How far constraints are from being met where they have no unit in common: relative to how far their values are spread among motions
//! under other controls. A constraint with the same value in all of them says nothing about which one is closer.

/// Standard deviations of the values of every constraint among motions, each given by the values of all constraints; empty without motions.
pub(crate) fn spreads<'a>(motions: impl Iterator<Item = &'a [f64]> + Clone) -> Vec<f64> {
    let n = motions.clone().count() as f64;
    let Some(first) = motions.clone().next() else { return Vec::new() };
    let of = |i: usize| {
        let values = || motions.clone().map(move |m| m[i]);
        let mean = values().sum::<f64>() / n;
        (values().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt()
    };
    (0..first.len()).map(of).collect()
}

/// How far a value is outside of its bounds, as a share of its spread, with a sign; 0 where nothing is spread.
pub(crate) fn off(value: f64, [lower, upper]: [f64; 2], spread: f64) -> f64 {
    if spread > 0.0 {
        (value - value.max(lower).min(upper)) / spread
    } else {
        0.0
    }
}
