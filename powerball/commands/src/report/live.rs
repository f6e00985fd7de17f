//! The samples of a figure, for the script that lets a reader zoom.
//!
//! Without a script, and on paper, the page shows the figure as an SVG. With one, `figures.js` draws the
//! samples with uPlot (Leon Sorokin, MIT, in `uplot/`): it reduces what is drawn to the lowest and highest
//! value of each column of the screen, so a long log is an envelope from afar and samples from near.

use super::figure::{Figure, MOST_POINTS, Mark, Panel, Series, envelope};
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// uPlot's licence, which goes with every copy.
pub(super) const LICENCE: &str = include_str!("uplot/LICENSE");
/// uPlot and its style, and what makes charts of a page's samples.
pub(super) const SCRIPTS: [&str; 2] = [include_str!("uplot/uPlot.iife.min.js"), include_str!("figures.js")];
pub(super) const STYLE: &str = include_str!("uplot/uPlot.min.css");

/// The page of a running motion: it takes server-sent events from `events` next to it, with its own query;
/// `stream.js` defines them.
#[must_use]
pub fn stream_page() -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" \
            content=\"width=device-width\"><title>powerball</title><style>{}{STYLE}</style></head><body><main><h1 \
            id=\"title\">powerball</h1><p class=\"lead\" id=\"state\">waiting</p><div \
            id=\"events\"></div><div id=\"charts\"></div></main><!-- {LICENCE} \
            --><script>{}</script><script>{}</script></body></html>\n",
        super::STYLE,
        SCRIPTS[0],
        include_str!("stream.js")
    )
}

/// Longer curves keep the lowest and highest value of this many stretches: an hour at 20 Hz.
const STRETCHES: usize = 75_000;
/// Values are stored in this many steps of their range; the code below all of them is not a number.
const STEPS: f64 = 65_000.0;
const NOT_A_NUMBER: i16 = i16::MIN;

/// The figure's panels as an element that the script reads.
pub(super) fn samples(figure: &Figure) -> String {
    let Figure { title, x_label, panels } = figure;
    let panels: Vec<Value> = panels.iter().map(panel).collect();
    let text = json!({ "title": title, "x": x_label, "panels": panels }).to_string();
    // No part of a text may end the element.
    format!("<script type=\"application/json\">{}</script>", text.replace('<', "\\u003c"))
}

fn panel(panel: &Panel) -> Value {
    let series = panel.series.iter().filter(|s| !s.points.is_empty());
    let mut series: Vec<Value> = series.map(of_series).collect();
    // Curves over the same samples share them.
    for k in (1..series.len()).rev() {
        if series[k]["x"] == series[k - 1]["x"] {
            series[k]["x"] = Value::Null;
        }
    }
    json!({ "label": panel.y_label, "height": panel.height, "series": series })
}

fn of_series(series: &Series) -> Value {
    let Series { name, ink, mark, points } = series;
    let points = match mark {
        Mark::Points => {
            let mut points = points.clone();
            points.retain(|p| p.0.is_finite() && p.1.is_finite());
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let stride = points.len().div_ceil(MOST_POINTS).max(1);
            points.into_iter().step_by(stride).collect()
        }
        _ => envelope(points, STRETCHES),
    };
    // A break without a time of its own has the time of the sample before it.
    let mut last = f64::NAN;
    let times = points.iter().map(|p| {
        last = if p.0.is_finite() { p.0 } else { last };
        last as f32
    });
    let x: Vec<u8> = times.flat_map(f32::to_le_bytes).collect();
    let values = || points.iter().map(|p| p.1).filter(|y| y.is_finite());
    let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(y), h.max(y)));
    let step = if high > low { (high - low) / STEPS } else { 1.0 };
    let middle = if high >= low { 0.5 * (low + high) } else { 0.0 };
    let code = |y: f64| if y.is_finite() { ((y - middle) / step).round() as i16 } else { NOT_A_NUMBER };
    let y: Vec<u8> = points.iter().flat_map(|p| code(p.1).to_le_bytes()).collect();
    let mark = match mark {
        Mark::Line => "line",
        Mark::Broad => "broad",
        Mark::Dashed => "dashed",
        Mark::Points => "points",
    };
    json!({
        "name": name, "ink": ink.class(), "mark": mark, "middle": middle, "step": step,
        "x": STANDARD.encode(x), "y": STANDARD.encode(y),
    })
}

#[cfg(test)]
mod tests {
    use super::super::Ink;
    use super::*;

    fn decoded(series: &Value) -> Vec<(f64, f64)> {
        let bytes = |key: &str| STANDARD.decode(series[key].as_str().unwrap()).unwrap();
        let number = |key: &str| series[key].as_f64().unwrap();
        let x = bytes("x")
            .chunks(4)
            .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())))
            .collect::<Vec<_>>();
        let y = bytes("y").chunks(2).map(|b| i16::from_le_bytes(b.try_into().unwrap())).collect::<Vec<_>>();
        let value = |y: i16| match y {
            NOT_A_NUMBER => f64::NAN,
            y => number("middle") + number("step") * f64::from(y),
        };
        x.into_iter().zip(y.into_iter().map(value)).collect()
    }

    #[test]
    fn samples_are_kept_to_a_sixtieth_of_a_thousandth_of_their_range_and_breaks_stay() {
        let wave = |k: i32| (f64::from(k) * 0.25, 40.0 + 3.0 * f64::from(k).sin());
        let mut points: Vec<(f64, f64)> = (0..1000).map(wave).collect();
        points[500] = (f64::NAN, f64::NAN);
        let read = decoded(&of_series(&Series::line("a", Ink::Blue, points.clone())));
        assert_eq!(read.len(), points.len());
        for (k, (p, r)) in points.iter().zip(&read).enumerate() {
            if k == 500 {
                assert!(r.1.is_nan() && r.0 == points[499].0, "{r:?}");
            } else {
                assert!((p.1 - r.1).abs() <= 6.0 / 60_000.0 && p.0 == r.0, "{p:?} {r:?}");
            }
        }
    }

    #[test]
    fn constants_and_nothing_at_all_are_kept_too() {
        let constant = decoded(&of_series(&Series::line("a", Ink::Blue, vec![(0.0, 7.5), (1.0, 7.5)])));
        assert_eq!(constant, [(0.0, 7.5), (1.0, 7.5)]);
        let empty = decoded(&of_series(&Series::line("a", Ink::Blue, vec![(0.0, f64::NAN)])));
        assert!(empty.len() == 1 && empty[0].1.is_nan());
    }

    #[test]
    fn curves_over_the_same_samples_store_them_once() {
        let points = |f: f64| (0..100).map(|k| (f64::from(k), f * f64::from(k))).collect::<Vec<_>>();
        let made =
            panel(&Panel::new("y").line("a", Ink::Blue, points(1.0)).line("b", Ink::Green, points(2.0)));
        assert!(made["series"][0]["x"].is_string() && made["series"][1]["x"].is_null());
    }
}
