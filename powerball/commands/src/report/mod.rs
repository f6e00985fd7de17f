//! Self-contained HTML pages: figures that can be zoomed, and SVG where there is no script; no network, light
//! and dark, fit for print.
//!
//! ```
//! use powerball_commands::report::{Figure, Ink, Page, Panel, Series, Table};
//!
//! let mut page = Page::new("Identification of an arm");
//! page.heading("Torque");
//! page.figure(
//!     &Figure::new("Joint 1", "time [s]")
//!         .panel(Panel::new("torque [N·m]").line("measured", Ink::Blue, vec![(0.0, 1.0), (0.1, 2.0)])),
//!     "Measured torque.",
//! );
//! page.table(&Table::new(["joint", "error [N·m]"]).row(["1", "0.31"]));
//! assert!(page.to_html().starts_with("<!doctype html>"));
//! # let _ = Series::points("unused", Ink::Grey, Vec::new());
//! ```
//!
//! The SVG of figures is written here and not by a plotting library because colours have to follow the
//! reader's light or dark scheme through CSS classes, and because curves need sub-pixel coordinates to look
//! right when printed: the SVG backend of `plotters` writes fixed colours at whole pixels.

mod axis;
mod bars;
pub mod compared;
pub mod excited;
pub mod explained;
mod figure;
pub mod files;
#[cfg(feature = "procedure")]
pub mod followed;
pub mod identified;
pub mod inspected;
mod live;
pub mod load;
mod page;
pub mod sections;
pub mod servos;
pub mod verified;

pub use bars::BarPairs;
pub use figure::{Figure, Ink, JOINTS, Mark, Panel, Series};
pub use files::Files;
pub use live::stream_page;
pub use page::{Page, Table, Tone, sign};
pub use powerball_explanation::effects::words::number;

/// The style of pages and figures.
const STYLE: &str = include_str!("page.css");

/// The mark in the head of a page that was made here.
pub const MADE_BY: &str = "<meta name=\"generator\" content=\"powerball\">";

/// The band of an error that ends there, Hz, in words.
#[must_use]
pub fn band_of(end: f64) -> String {
    format!("0 to {end}")
}

/// Text as it may stand in HTML, in an element or in a quoted attribute.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            // Control characters are not allowed in HTML text.
            c if c.is_control() && c != '\n' && c != '\t' => out.push('\u{fffd}'),
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_of_a_text_reaches_the_page_as_markup() {
        let evil = "<script>alert(1)</script>\"'&";
        let mut page = Page::new(evil);
        page.lead(evil);
        page.heading(evil);
        page.paragraph(evil);
        page.note(Tone::Bad, evil);
        page.facts([(evil, evil)]);
        page.table(&Table::new([evil]).row([evil]));
        page.folded(evil, &Table::new([evil]).row([evil]));
        page.figure(
            &Figure::new(evil, evil).panel(Panel::new(evil).line(
                evil,
                Ink::Blue,
                vec![(0.0, 0.0), (1.0, 1.0)],
            )),
            evil,
        );
        page.bars(&BarPairs::new(evil, evil, ["a", "b"]).pair(evil, 1.0, 2.0), evil);
        let html = page.to_html();
        let ours = 1 + live::SCRIPTS.len();
        assert_eq!(html.matches("<script").count(), ours, "{html}");
        assert_eq!(html.matches("</script").count(), ours, "{html}");
        for reach in ["src=", "href=", "url(", "@import", "fetch(", "XMLHttpRequest"] {
            assert!(!html.contains(reach), "a page must not reach for the network: {reach}");
        }
    }

    #[test]
    fn a_page_of_long_logs_stays_small() {
        let noisy = |n: usize| -> Vec<(f64, f64)> {
            (0..n).map(|k| (k as f64 * 0.005, ((k * 7919) % 1000) as f64 * 0.01 - 5.0)).collect()
        };
        let mut page = Page::new("six joints");
        for joint in 1..=6 {
            let panel = |label: &str| {
                Panel::new(label).line("m", Ink::Blue, noisy(60_000)).line("p", Ink::Orange, noisy(60_000))
            };
            page.figure(
                &Figure::new(format!("Joint {joint}"), "t [s]").panel(panel("τ")).panel(panel("e")),
                "",
            );
        }
        // 1.4 million samples.
        let html = page.to_html();
        assert!(html.len() < 10_000_000, "{}", html.len());
        let drawings: usize = html.split("<svg").skip(1).filter_map(|rest| rest.find("</svg>")).sum();
        assert!(drawings < 2_000_000, "the drawings alone: {drawings}");
    }
}
