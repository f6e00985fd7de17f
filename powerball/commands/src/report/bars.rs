//! Pairs of bars: a quantity before and after, for each of several items.

use super::axis::Axis;
use super::escape;
use super::figure::{WIDTH, draw_grid, file, svg, title};
use super::number;
use std::fmt::Write as _;

const LEFT: f64 = 62.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 96.0;
/// The first line of the legend, and from one to the next.
const LEGEND: f64 = 40.0;
const LEGEND_LINE: f64 = 22.0;
const HEIGHT: f64 = 190.0;

/// Two bars for each item, and optionally a line that neither can get below.
#[derive(Clone, Debug)]
pub struct BarPairs {
    title: String,
    y_label: String,
    names: [String; 2],
    pairs: Vec<Pair>,
}

#[derive(Clone, Debug)]
struct Pair {
    label: String,
    values: [f64; 2],
    floor: Option<f64>,
}

impl BarPairs {
    /// A figure without items; `names` says what the first and the second bar of a pair are.
    pub fn new<T: Into<String>>(title: impl Into<String>, y_label: impl Into<String>, names: [T; 2]) -> Self {
        BarPairs {
            title: title.into(),
            y_label: y_label.into(),
            names: names.map(Into::into),
            pairs: Vec::new(),
        }
    }

    /// The figure with one more item.
    #[must_use]
    pub fn pair(mut self, label: impl Into<String>, before: f64, after: f64) -> Self {
        self.pairs.push(Pair { label: label.into(), values: [before, after], floor: None });
        self
    }

    /// The figure with one more item that has a floor, say the noise of the measurement.
    #[must_use]
    pub fn pair_with_floor(mut self, label: impl Into<String>, before: f64, after: f64, floor: f64) -> Self {
        self.pairs.push(Pair { label: label.into(), values: [before, after], floor: Some(floor) });
        self
    }

    /// The figure as a file of its own.
    #[must_use]
    pub fn to_file(&self) -> String {
        file(&self.to_svg())
    }

    /// The figure as an SVG element.
    pub(super) fn to_svg(&self) -> String {
        let (right, bottom) = (WIDTH - RIGHT, TOP + HEIGHT);
        let values = self.pairs.iter().flat_map(|p| p.values.into_iter().chain(p.floor));
        let largest = values.filter(|v| v.is_finite()).fold(0.0, f64::max);
        let y = Axis::over([0.0, if largest > 0.0 { 1.12 * largest } else { 1.0 }].into_iter(), 0.0, 5);
        let mut out = title(&self.title);
        self.legend(&mut out);
        draw_grid(&mut out, None, &y, [LEFT, right, TOP, bottom], false);
        let slot = (right - LEFT) / self.pairs.len().max(1) as f64;
        let width = (0.34 * slot).min(56.0);
        for (i, pair) in self.pairs.iter().enumerate() {
            let middle = LEFT + (i as f64 + 0.5) * slot;
            for (k, value) in pair.values.iter().enumerate() {
                let value = if value.is_finite() { value.max(0.0) } else { 0.0 };
                let (x, at) = (middle + (k as f64 - 1.0) * width, y.place(value, bottom, TOP));
                let class = ["c3", "c4"][k];
                let _ = write!(
                    out,
                    "<rect class=\"b {class}\" x=\"{:.1}\" y=\"{at:.1}\" width=\"{:.1}\" height=\"{:.1}\"/>\
                     <text class=\"v\" x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                    x + 1.0,
                    width - 2.0,
                    bottom - at,
                    x + width / 2.0,
                    at - 4.0,
                    number(pair.values[k]),
                );
            }
            if let Some(floor) = pair.floor.filter(|f| f.is_finite()) {
                let at = y.place(floor, bottom, TOP);
                let _ = write!(
                    out,
                    "<path class=\"k dash c5\" d=\"M{:.1} {at:.1}h{:.1}\"/>",
                    middle - width - 6.0,
                    2.0 * width + 12.0
                );
            }
            let _ = write!(
                out,
                "<text x=\"{middle:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                bottom + 16.0,
                escape(&pair.label)
            );
        }
        let _ = write!(
            out,
            "<text class=\"l\" transform=\"translate(14 {:.1})rotate(-90)\" text-anchor=\"middle\">{}</text>",
            (TOP + bottom) / 2.0,
            escape(&self.y_label)
        );
        svg(&self.title, bottom + 26.0, &out)
    }

    /// One line for each: on a narrow screen text is larger than it is here.
    fn legend(&self, out: &mut String) {
        let mut y = LEGEND;
        for (name, class) in self.names.iter().zip(["c3", "c4"]) {
            let _ = write!(
                out,
                "<rect class=\"b {class}\" x=\"{LEFT:.1}\" y=\"{:.1}\" width=\"14\" height=\"10\"/>\
                 <text x=\"{:.1}\" y=\"{y:.1}\">{}</text>",
                y - 9.0,
                LEFT + 26.0,
                escape(name)
            );
            y += LEGEND_LINE;
        }
        if self.pairs.iter().any(|p| p.floor.is_some()) {
            let _ = write!(
                out,
                "<path class=\"k dash c5\" d=\"M{LEFT:.1} {:.1}h20\"/><text x=\"{:.1}\" y=\"{y:.1}\">noise \
                    floor</text>",
                y - 4.0,
                LEFT + 26.0
            );
        }
    }
}
