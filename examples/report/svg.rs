//! Plots as SVG: linear and logarithmic axes, lines, dots, steps, a legend.

use std::fmt::Write as _;

/// How a series is drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    Line,
    Dashed,
    Dots,
    LineDots,
    /// Piecewise constant: the value of a point holds until the next one.
    Steps,
}

struct Series {
    label: String,
    points: Vec<(f64, f64)>,
    mark: Mark,
    colour: usize,
}

/// A plot in the making.
pub struct Plot {
    title: String,
    labels: [String; 2],
    log: [bool; 2],
    series: Vec<Series>,
}

const COLOURS: [&str; 10] =
    ["#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22"];
const SIZE: (f64, f64) = (860.0, 520.0);
/// Left, right, top, bottom.
const MARGIN: (f64, f64, f64, f64) = (80.0, 210.0, 40.0, 55.0);

/// One axis: range in the drawn scale, and where it lies on the paper.
struct Axis {
    log: bool,
    from: f64,
    to: f64,
    at: (f64, f64),
}

impl Axis {
    fn new(values: impl Iterator<Item = f64>, log: bool, at: (f64, f64)) -> Axis {
        let (mut from, mut to) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values.filter(|v| v.is_finite() && (!log || *v > 0.0)) {
            let v = if log { v.log10() } else { v };
            from = from.min(v);
            to = to.max(v);
        }
        if from > to {
            (from, to) = (0.0, 1.0);
        }
        let pad = if to > from { 0.04 * (to - from) } else { 0.5 };
        Axis { log, from: from - pad, to: to + pad, at }
    }
    fn place(&self, v: f64) -> Option<f64> {
        let v = if self.log { v.log10() } else { v };
        v.is_finite().then(|| self.at.0 + (v - self.from) / (self.to - self.from) * (self.at.1 - self.at.0))
    }
    fn ticks(&self) -> Vec<(f64, String)> {
        let span = self.to - self.from;
        let mut step = 10f64.powf((span / 6.0).log10().floor());
        for f in [1.0, 2.0, 5.0, 10.0] {
            if span / (step * f) <= 8.0 {
                step *= f;
                break;
            }
        }
        if self.log {
            step = step.max(1.0).round();
        }
        let first = (self.from / step).ceil() as i64;
        let last = (self.to / step).floor() as i64;
        (first..=last)
            .map(|k| {
                let v = k as f64 * step;
                match self.log {
                    true => (10f64.powf(v), format!("1e{v}")),
                    false => (v, format!("{:.*}", (-step.log10().floor()).max(0.0) as usize, v)),
                }
            })
            .collect()
    }
}

impl Plot {
    pub fn new(title: &str, x: &str, y: &str) -> Plot {
        Plot { title: title.into(), labels: [x.into(), y.into()], log: [false, false], series: Vec::new() }
    }
    pub fn log_log(mut self) -> Plot {
        self.log = [true, true];
        self
    }
    /// Adds a series in the next colour.
    pub fn add(&mut self, label: &str, mark: Mark, points: Vec<(f64, f64)>) -> &mut Plot {
        self.add_coloured(label, mark, self.series.len(), points)
    }
    pub fn add_coloured(&mut self, label: &str, mark: Mark, colour: usize, points: Vec<(f64, f64)>) -> &mut Plot {
        self.series.push(Series { label: label.into(), points, mark, colour });
        self
    }
    pub fn svg(&self) -> String {
        stacked(std::slice::from_ref(self))
    }

    /// What stands between the tags of the file.
    fn body(&self) -> String {
        let all = || self.series.iter().flat_map(|s| s.points.iter());
        let (l, r, t, b) = MARGIN;
        let (x0, x1, y0, y1) = (l, SIZE.0 - r, SIZE.1 - b, t);
        let ax = Axis::new(all().map(|p| p.0), self.log[0], (x0, x1));
        let ay = Axis::new(all().map(|p| p.1), self.log[1], (y0, y1));
        let mut o = String::new();
        let text = |o: &mut String, x: f64, y: f64, anchor: &str, s: &str| {
            let s = s.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
            let _ = writeln!(o, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{s}</text>");
        };
        let line = |o: &mut String, p: [f64; 4], style: &str| {
            let [a, b, c, d] = p;
            let _ = writeln!(o, "<line x1=\"{a:.1}\" y1=\"{b:.1}\" x2=\"{c:.1}\" y2=\"{d:.1}\" {style}/>");
        };
        for (v, s) in ax.ticks() {
            let x = ax.place(v).unwrap_or(x0);
            line(&mut o, [x, y0, x, y1], "stroke=\"#ddd\"");
            text(&mut o, x, y0 + 17.0, "middle", &s);
        }
        for (v, s) in ay.ticks() {
            let y = ay.place(v).unwrap_or(y0);
            line(&mut o, [x0, y, x1, y], "stroke=\"#ddd\"");
            text(&mut o, x0 - 6.0, y + 4.0, "end", &s);
        }
        let _ = writeln!(
            o,
            "<rect x=\"{x0}\" y=\"{y1}\" width=\"{}\" height=\"{}\" fill=\"none\" stroke=\"#444\"/>",
            x1 - x0,
            y0 - y1
        );
        text(&mut o, 0.5 * (x0 + x1), t - 14.0, "middle", &self.title);
        text(&mut o, 0.5 * (x0 + x1), SIZE.1 - 14.0, "middle", &self.labels[0]);
        let _ = write!(o, "<g transform=\"translate(18 {:.1}) rotate(-90)\">", 0.5 * (y0 + y1));
        text(&mut o, 0.0, 0.0, "middle", &self.labels[1]);
        o.push_str("</g>\n");
        let mut legend = 0.0;
        for s in &self.series {
            let colour = COLOURS[s.colour % COLOURS.len()];
            let at: Vec<(f64, f64)> = s.points.iter().filter_map(|p| Some((ax.place(p.0)?, ay.place(p.1)?))).collect();
            let mut path: Vec<(f64, f64)> = Vec::new();
            for (k, p) in at.iter().enumerate() {
                if s.mark == Mark::Steps && k > 0 {
                    path.push((p.0, at[k - 1].1));
                }
                path.push(*p);
            }
            let dash = if s.mark == Mark::Dashed { " stroke-dasharray=\"6 4\"" } else { "" };
            let style = format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"{dash}");
            if s.mark != Mark::Dots {
                let d: Vec<String> = path.iter().map(|p| format!("{:.1},{:.1}", p.0, p.1)).collect();
                let _ = writeln!(o, "<polyline points=\"{}\" {style}/>", d.join(" "));
            }
            let dots = matches!(s.mark, Mark::Dots | Mark::LineDots);
            if dots {
                for p in &at {
                    let _ = writeln!(o, "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"2.6\" fill=\"{colour}\"/>", p.0, p.1);
                }
            }
            if !s.label.is_empty() {
                let y = t + 10.0 + 18.0 * legend;
                legend += 1.0;
                match s.mark {
                    Mark::Dots => {
                        let _ = writeln!(o, "<circle cx=\"{}\" cy=\"{y}\" r=\"3\" fill=\"{colour}\"/>", x1 + 24.0);
                    }
                    _ => line(&mut o, [x1 + 12.0, y, x1 + 36.0, y], &style),
                }
                text(&mut o, x1 + 42.0, y + 4.0, "start", &s.label);
            }
        }
        o
    }
}

/// Plots one below the other.
pub fn stacked(plots: &[Plot]) -> String {
    let height = SIZE.1 * plots.len() as f64;
    let mut o = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {height}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        SIZE.0
    );
    for (k, p) in plots.iter().enumerate() {
        let _ = writeln!(o, "<g transform=\"translate(0 {})\">", SIZE.1 * k as f64);
        o.push_str(&p.body());
        o.push_str("</g>\n");
    }
    o.push_str("</svg>\n");
    o
}
