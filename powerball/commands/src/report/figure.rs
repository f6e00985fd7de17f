//! Line and scatter figures: one or several panels over a common horizontal axis.
//!
//! The module also reduces the number of points without a visible change.

use super::axis::Axis;
use super::escape;
use std::collections::HashSet;
use std::fmt::Write as _;

/// Width of every figure in SVG units; the page scales figures to its column.
pub(super) const WIDTH: f64 = 820.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 12.0;
const PANEL: f64 = 150.0;
const BETWEEN: f64 = 14.0;
const BELOW: f64 = 40.0;
const LEGEND_LINE: f64 = 18.0;
/// Points of a cloud beyond this number are not distinguished by eye.
pub(super) const MOST_POINTS: usize = 2_500;
/// At most this many are drawn large.
const FEW_POINTS: usize = 200;

/// The colour of a curve, after the Okabe–Ito palette, which colour-blind readers can distinguish, each with
/// a lighter twin for dark pages. By convention measured is blue, predicted orange, residuals grey (before)
/// and green (after).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Ink {
    Blue,
    Orange,
    Grey,
    Green,
    Purple,
    Gold,
    Black,
}

/// The colours of joints, from the first on.
pub const JOINTS: [Ink; 7] =
    [Ink::Blue, Ink::Orange, Ink::Green, Ink::Purple, Ink::Gold, Ink::Black, Ink::Grey];

impl Ink {
    pub(super) fn class(self) -> &'static str {
        match self {
            Ink::Blue => "c1",
            Ink::Orange => "c2",
            Ink::Grey => "c3",
            Ink::Green => "c4",
            Ink::Purple => "c5",
            Ink::Gold => "c6",
            Ink::Black => "c7",
        }
    }
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// A line through the points in their order.
    Line,
    /// A broad pale line, to be seen under another one.
    Broad,
    /// A thin dashed line, for limits and references.
    Dashed,
    /// A dot at each point.
    Points,
}

/// A named set of points in one colour.
#[derive(Clone, Debug)]
pub struct Series {
    pub(super) name: String,
    pub(super) ink: Ink,
    pub(super) mark: Mark,
    pub(super) points: Vec<(f64, f64)>,
}

impl Series {
    /// A curve; points that are not finite break it.
    pub fn line(name: impl Into<String>, ink: Ink, points: Vec<(f64, f64)>) -> Self {
        Series { name: name.into(), ink, mark: Mark::Line, points }
    }

    /// A broad pale curve, to be seen under another one.
    pub fn broad(name: impl Into<String>, ink: Ink, points: Vec<(f64, f64)>) -> Self {
        Series { name: name.into(), ink, mark: Mark::Broad, points }
    }

    /// A dashed curve.
    pub fn dashed(name: impl Into<String>, ink: Ink, points: Vec<(f64, f64)>) -> Self {
        Series { name: name.into(), ink, mark: Mark::Dashed, points }
    }

    /// A cloud of points.
    pub fn points(name: impl Into<String>, ink: Ink, points: Vec<(f64, f64)>) -> Self {
        Series { name: name.into(), ink, mark: Mark::Points, points }
    }
}

/// One pair of axes of a figure.
#[derive(Clone, Debug)]
pub struct Panel {
    pub(super) y_label: String,
    pub(super) height: f64,
    pub(super) series: Vec<Series>,
}

impl Panel {
    /// A panel whose vertical axis has this label, with its unit.
    pub fn new(y_label: impl Into<String>) -> Self {
        Panel { y_label: y_label.into(), height: PANEL, series: Vec::new() }
    }

    /// The panel `factor` times as high as usual.
    #[must_use]
    pub fn height(mut self, factor: f64) -> Self {
        self.height = PANEL * factor.clamp(0.3, 4.0);
        self
    }

    /// The panel with one more series.
    #[must_use]
    pub fn series(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// The panel with one more curve.
    #[must_use]
    pub fn line(self, name: impl Into<String>, ink: Ink, points: Vec<(f64, f64)>) -> Self {
        self.series(Series::line(name, ink, points))
    }
}

/// A figure: a title, a common horizontal axis, and panels from top to bottom.
#[derive(Clone, Debug)]
pub struct Figure {
    pub(super) title: String,
    pub(super) x_label: String,
    pub(super) panels: Vec<Panel>,
}

impl Figure {
    /// A figure without panels; `x_label` names the common axis with its unit.
    pub fn new(title: impl Into<String>, x_label: impl Into<String>) -> Self {
        Figure { title: title.into(), x_label: x_label.into(), panels: Vec::new() }
    }

    /// The figure with one more panel below the others.
    #[must_use]
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// The figure as a file of its own, for a page that is no [`Page`](super::Page); light and dark as the
    /// reader's screen is.
    #[must_use]
    pub fn to_file(&self) -> String {
        file(&self.to_svg())
    }

    /// The figure as an SVG element whose colours come from the page's style.
    pub(super) fn to_svg(&self) -> String {
        let xs = self.panels.iter().flat_map(|p| &p.series).flat_map(|s| s.points.iter().map(|p| p.0));
        let x = Axis::over(xs, 0.0, 10);
        let (legend, top) = self.legend();
        let inner: f64 = self.panels.iter().map(|p| p.height + BETWEEN).sum();
        let height = top + inner - BETWEEN + BELOW;
        let mut body = legend;
        let mut y0 = top;
        for (i, panel) in self.panels.iter().enumerate() {
            let last = i + 1 == self.panels.len();
            draw_panel(&mut body, panel, &x, y0, last);
            y0 += panel.height + BETWEEN;
        }
        let _ = write!(
            body,
            "<text class=\"l\" x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"middle\">{}</text>",
            (LEFT + WIDTH - RIGHT) / 2.0,
            height - 6.0,
            escape(&self.x_label)
        );
        svg(&self.title, height, &body)
    }

    /// Title and legend, and the height that they take.
    fn legend(&self) -> (String, f64) {
        let mut entries: Vec<(&str, Ink, Mark)> = Vec::new();
        for s in self.panels.iter().flat_map(|p| &p.series) {
            if !s.name.is_empty() && !s.points.is_empty() && !entries.iter().any(|e| e.0 == s.name) {
                entries.push((&s.name, s.ink, s.mark));
            }
        }
        let mut out = title(&self.title);
        let (mut x, mut y) = (LEFT, 38.0);
        for (name, ink, mark) in &entries {
            let width = 34.0 + text_width(name);
            if x + width > WIDTH - RIGHT && x > LEFT {
                (x, y) = (LEFT, y + LEGEND_LINE);
            }
            let (class, sample) = (ink.class(), y - 4.0);
            let _ = match mark {
                Mark::Points => {
                    write!(out, "<path class=\"d big {class}\" d=\"M{:.1} {sample:.1}h0\"/>", x + 10.0)
                }
                Mark::Line => write!(out, "<path class=\"k {class}\" d=\"M{x:.1} {sample:.1}h20\"/>"),
                Mark::Broad => write!(out, "<path class=\"k broad {class}\" d=\"M{x:.1} {sample:.1}h20\"/>"),
                Mark::Dashed => write!(out, "<path class=\"k dash {class}\" d=\"M{x:.1} {sample:.1}h20\"/>"),
            };
            let _ = write!(out, "<text x=\"{:.1}\" y=\"{y:.1}\">{}</text>", x + 26.0, escape(name));
            x += width;
        }
        (out, if entries.is_empty() { 30.0 } else { y + 12.0 })
    }
}

/// A figure's element with its style and paper.
pub(super) fn file(svg: &str) -> String {
    let style = super::STYLE;
    let element = svg.replacen("<svg ", "<svg xmlns=\"http://www.w3.org/2000/svg\" ", 1);
    let paper = "<rect width=\"100%\" height=\"100%\" style=\"fill:var(--paper)\"/>";
    element.replacen('>', &format!("><style>{style}</style>{paper}"), 1)
}

/// A figure's frame element.
pub(super) fn svg(title: &str, height: f64, body: &str) -> String {
    format!(
        "<svg viewBox=\"0 0 {WIDTH:.0} {height:.0}\" role=\"img\" aria-label=\"{}\">{body}</svg>\n",
        escape(title)
    )
}

/// A figure's title.
pub(super) fn title(text: &str) -> String {
    format!("<text class=\"t\" x=\"{LEFT:.0}\" y=\"18\">{}</text>", escape(text))
}

/// About how wide a legend text is; there is no font to measure it with.
fn text_width(text: &str) -> f64 {
    6.6 * text.chars().count() as f64 + 12.0
}

fn draw_panel(out: &mut String, panel: &Panel, x: &Axis, top: f64, labels_below: bool) {
    let (right, bottom) = (WIDTH - RIGHT, top + panel.height);
    let values = panel.series.iter().flat_map(|s| s.points.iter().map(|p| p.1));
    let y = Axis::over(values, 0.06, (panel.height / 34.0) as usize);
    draw_grid(out, Some(x), &y, [LEFT, right, top, bottom], labels_below);
    let _ = write!(
        out,
        "<text class=\"l\" transform=\"translate(14 {:.1})rotate(-90)\" text-anchor=\"middle\">{}</text>",
        (top + bottom) / 2.0,
        escape(&panel.y_label)
    );
    for series in &panel.series {
        draw_series(out, series, |p| (x.place(p.0, LEFT, right), y.place(p.1, bottom, top)));
    }
}

/// Grid lines and tick labels within `[left, right, top, bottom]`; without `x` only the horizontal ones.
pub(super) fn draw_grid(out: &mut String, x: Option<&Axis>, y: &Axis, frame: [f64; 4], labels_below: bool) {
    let [left, right, top, bottom] = frame;
    let mut lines = String::new();
    for (value, label) in y.ticks() {
        let at = y.place(value, bottom, top);
        let _ = write!(lines, "M{left:.1} {at:.1}H{right:.1}");
        let _ = write!(
            out,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            left - 6.0,
            at + 4.0
        );
    }
    let columns = x.map(|x| x.ticks().into_iter().map(|(v, label)| (x.place(v, left, right), label)));
    for (at, label) in columns.into_iter().flatten() {
        let _ = write!(lines, "M{at:.1} {top:.1}V{bottom:.1}");
        if labels_below {
            let _ = write!(
                out,
                "<text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{label}</text>",
                bottom + 15.0
            );
        }
    }
    let _ = write!(out, "<path class=\"g\" d=\"{lines}\"/>");
    if y.low() < 0.0 && y.high() > 0.0 {
        let zero = y.place(0.0, bottom, top);
        let _ = write!(out, "<path class=\"z\" d=\"M{left:.1} {zero:.1}H{right:.1}\"/>");
    }
}

fn draw_series(out: &mut String, series: &Series, place: impl Fn((f64, f64)) -> (f64, f64)) {
    // Decimation works on what is seen, so it comes after the placing.
    let placed: Vec<(f64, f64)> = series.points.iter().map(|p| place(*p)).collect();
    let class = series.ink.class();
    let mut d = String::new();
    if series.mark == Mark::Points {
        for (x, y) in decimate(&placed, (1.0, 1.0), MOST_POINTS) {
            let _ = write!(d, "M{x:.1} {y:.1}h0");
        }
        // A few are measured values of their own, many are a cloud.
        let size = if placed.len() <= FEW_POINTS { "d big" } else { "d" };
        let _ = write!(out, "<path class=\"{size} {class}\" d=\"{d}\"/>");
        return;
    }
    let mut pen_down = false;
    for (x, y) in envelope(&placed, WIDTH as usize) {
        if !(x.is_finite() && y.is_finite()) {
            pen_down = false;
            continue;
        }
        let _ = write!(d, "{}{x:.1} {y:.1}", if pen_down { 'L' } else { 'M' });
        pen_down = true;
    }
    let style = match series.mark {
        Mark::Dashed => " dash",
        Mark::Broad => " broad",
        Mark::Line | Mark::Points => "",
    };
    let _ = write!(out, "<path class=\"s{style} {class}\" d=\"{d}\"/>");
}

// Fewer points for the same picture.

/// A curve of at most about two points for each of `columns` columns: the lowest and the highest value of
/// each column, in their order, so that no peak is lost. Points that are not finite break the curve and are
/// kept as one break. The points must be ordered by their first coordinate within each unbroken piece.
pub(super) fn envelope(points: &[(f64, f64)], columns: usize) -> Vec<(f64, f64)> {
    let finite = |p: &(f64, f64)| p.0.is_finite() && p.1.is_finite();
    let (low, high) = points
        .iter()
        .filter(|p| finite(p))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.0), h.max(p.0)));
    if points.len() <= 2 * columns || high <= low {
        return points.to_vec();
    }
    let column = |x: f64| ((x - low) / (high - low) * columns as f64) as usize;
    let mut out = Vec::with_capacity(2 * columns + 2);
    let mut start = 0;
    while start < points.len() {
        if !finite(&points[start]) {
            out.push((f64::NAN, f64::NAN));
            start += 1;
            while start < points.len() && !finite(&points[start]) {
                start += 1;
            }
            continue;
        }
        let this = column(points[start].0);
        let mut end = start + 1;
        while end < points.len() && finite(&points[end]) && column(points[end].0) == this {
            end += 1;
        }
        let by_value = |a: &usize, b: &usize| points[*a].1.total_cmp(&points[*b].1);
        let lowest = (start..end).min_by(by_value).unwrap_or(start);
        let highest = (start..end).max_by(by_value).unwrap_or(start);
        out.push(points[lowest.min(highest)]);
        if lowest != highest {
            out.push(points[lowest.max(highest)]);
        }
        start = end;
    }
    out
}

/// A cloud in which each cell of a grid holds at most one point, and at most `most` points in all.
pub(super) fn decimate(points: &[(f64, f64)], cell: (f64, f64), most: usize) -> Vec<(f64, f64)> {
    let mut seen = HashSet::new();
    let distinct: Vec<(f64, f64)> = points
        .iter()
        .filter(|p| p.0.is_finite() && p.1.is_finite())
        .filter(|p| seen.insert(((p.0 / cell.0).round() as i64, (p.1 / cell.1).round() as i64)))
        .copied()
        .collect();
    let stride = distinct.len().div_ceil(most.max(1)).max(1);
    distinct.into_iter().step_by(stride).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_and_empty_data_give_a_picture_without_nan() {
        let figure = Figure::new("f", "x").panel(
            Panel::new("y")
                .line("a", Ink::Blue, vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0)])
                .series(Series::points("b", Ink::Green, vec![(f64::NAN, 1.0)]))
                .series(Series::dashed("c", Ink::Grey, Vec::new())),
        );
        let svg = figure.to_svg();
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert_eq!(svg.matches("class=\"s c1\" d=\"M").count(), 1);
        assert!(!svg.contains(">c</text>"), "nothing is drawn of c");
        let file = figure.to_file();
        assert!(
            file.starts_with("<svg xmlns=") && file.contains("--c1:") && file.trim_end().ends_with("</svg>")
        );
    }
}

#[cfg(test)]
mod decimate_tests {
    use super::*;

    #[test]
    fn a_lone_peak_survives() {
        let mut points: Vec<(f64, f64)> = (0..10_000).map(|k| (k as f64, (k as f64 * 0.01).sin())).collect();
        points[5_003].1 = 50.0;
        points[7_001].1 = -50.0;
        let small = envelope(&points, 300);
        assert!(small.len() <= 602, "{}", small.len());
        assert!(small.contains(&(5003.0, 50.0)) && small.contains(&(7001.0, -50.0)));
        assert!(small.windows(2).all(|w| w[0].0 <= w[1].0));
    }

    #[test]
    fn gaps_stay_gaps() {
        let mut points: Vec<(f64, f64)> = (0..5_000).map(|k| (k as f64, 1.0)).collect();
        for p in &mut points[2_000..2_100] {
            p.1 = f64::NAN;
        }
        let small = envelope(&points, 100);
        assert_eq!(small.iter().filter(|p| p.1.is_nan()).count(), 1);
    }

    #[test]
    fn a_cloud_is_thinned() {
        let points: Vec<(f64, f64)> = (0..50_000).map(|k| ((k % 97) as f64, (k % 89) as f64)).collect();
        assert!(decimate(&points, (1.0, 1.0), 2_000).len() <= 2_000);
        assert_eq!(decimate(&points, (1e3, 1e3), 2_000).len(), 1);
    }
}
