//! Line and scatter figures: one or several panels over a common horizontal axis.

use super::axis::Axis;
use super::decimate::{envelope, thin};
use super::escape;
use std::fmt::Write as _;

/// Width of every figure in SVG units; the page scales figures to its column.
pub(super) const WIDTH: f64 = 820.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 12.0;
const PANEL: f64 = 150.0;
const BETWEEN: f64 = 14.0;
const BELOW: f64 = 40.0;
const LEGEND_LINE: f64 = 18.0;
/// Points of a cloud beyond this number are not told apart by eye.
pub(super) const MOST_POINTS: usize = 2_500;
/// So few are drawn large.
const FEW_POINTS: usize = 200;

/// The colour of a curve, after the Okabe–Ito palette, which colour-blind readers can distinguish, each with a lighter twin
/// for dark pages. By convention measured is blue, predicted orange, residuals grey (before) and green (after).
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
pub(super) fn text_width(text: &str) -> f64 {
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
        for (x, y) in thin(&placed, (1.0, 1.0), MOST_POINTS) {
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
