//! A path that was followed, as JSON and as a page: the error with each model, and the parts of the torque.

use crate::procedure::follow::{Followed, Path, Track};
use crate::report::{Figure, Files, Ink, Page, Panel, Table, Tone, number};

/// follow.json and report.html; `tracks` by name in the order in which they were driven, the last one in
/// detail.
///
/// # Errors
/// A result that is not JSON.
pub fn files<const N: usize>(
    followed: &Followed,
    path: &Path<N>,
    tracks: &[(&str, Track<N>)],
) -> Result<Files, String> {
    let page = page(followed, path, tracks).to_html();
    Ok(Files::default().json("follow.json", followed)?.with("report.html", page))
}

/// The colours of the runs: without a model, base, explained.
const INKS: [Ink; 3] = [Ink::Grey, Ink::Orange, Ink::Blue];

/// The page.
#[must_use]
pub fn page<const N: usize>(followed: &Followed, path: &Path<N>, tracks: &[(&str, Track<N>)]) -> Page {
    let mut page = Page::new(format!("{} along a path", followed.arm));
    page.lead(
        "Measured minus desired position by joint, and the torque that was needed. This project ran none of \
        it on hardware.",
    );
    let mut facts = vec![("with", followed.with.clone()), ("cycles", followed.cycles.to_string())];
    if followed.delay > 0.0 {
        facts
            .push(("drives follow late by", format!("{:.1} ms, not counted as error", 1e3 * followed.delay)));
    }
    if let (Some(bandwidth), Some(pole)) = (followed.bandwidth, followed.largest_pole) {
        facts.push(("feedback", format!("{} rad/s, largest pole {pole:.3}", number(bandwidth))));
    }
    page.facts(facts);
    add_to_page(&mut page, followed, path, tracks);
    if let Some((name, track)) = tracks.last() {
        page.heading(&format!("Torque, {name}"));
        torques(&mut page, followed, name, track);
    }
    page
}

/// Tracking errors as a table, and along the path.
pub fn add_to_page<const N: usize>(
    page: &mut Page,
    followed: &Followed,
    path: &Path<N>,
    tracks: &[(&str, Track<N>)],
) {
    page.heading("Tracking error");
    errors(page, followed, tracks);
    let inks = &INKS[INKS.len().saturating_sub(tracks.len())..];
    for joint in 0..N {
        let panel =
            tracks.iter().enumerate().fold(Panel::new("error [mrad]"), |panel, (k, (name, track))| {
                let errors = track.errors(path, followed.delay);
                let points = track.samples.iter().zip(errors).map(|(s, e)| (s.t, 1e3 * e[joint])).collect();
                panel.line(*name, inks[k % inks.len()], points)
            });
        page.figure(&Figure::new(format!("Joint {}", joint + 1), "time [s]").panel(panel), "");
    }
}

fn errors<const N: usize>(page: &mut Page, followed: &Followed, tracks: &[(&str, Track<N>)]) {
    let columns = tracks.iter().map(|(name, _)| format!("{name}: rms (largest) [mrad]"));
    let mut table = Table::new(std::iter::once("joint".to_string()).chain(columns));
    for joint in 0..N {
        let cell = |name: &str| {
            let of = |map: &std::collections::BTreeMap<String, Vec<f64>>| {
                map.get(name).and_then(|list| list.get(joint)).copied().unwrap_or(f64::NAN)
            };
            let [rms, most] = [of(&followed.tracking_error), of(&followed.largest_error)];
            format!("{} ({})", number(1e3 * rms), number(1e3 * most))
        };
        let cells = tracks.iter().map(|(name, _)| cell(name));
        table.push(std::iter::once((joint + 1).to_string()).chain(cells));
    }
    page.table(&table);
    if let Some(share) = followed.share_of_base() {
        let tone = if share <= 1.0 { Tone::Good } else { Tone::Bad };
        page.note(
            tone,
            &format!("All joints together: {:.0} % of the error with the base model.", 100.0 * share),
        );
    }
}

fn torques<const N: usize>(page: &mut Page, followed: &Followed, name: &str, track: &Track<N>) {
    if let Some(parts) = followed.torque.get(name) {
        let columns = ["joint", "rigid arm", "friction", "effects", "feedback", "external (observer)"];
        let mut table =
            Table::new(columns.map(|c| if c == "joint" { c.to_string() } else { format!("{c} [N·m rms]") }));
        for joint in 0..N {
            let of = |list: &[f64]| list.get(joint).map_or_else(String::new, |x| number(*x));
            let external = parts.external.as_deref().map_or_else(String::new, of);
            let cells = [&parts.rigid, &parts.friction, &parts.effects, &parts.feedback].map(|list| of(list));
            table.push(std::iter::once((joint + 1).to_string()).chain(cells).chain([external]));
        }
        page.table(&table);
    }
    let parts = ["rigid arm", "friction", "effects", "feedback"];
    for joint in 0..N {
        let panel = parts.iter().enumerate().fold(Panel::new("torque [N·m]"), |panel, (k, part)| {
            let of = |s: &crate::procedure::follow::Sample<N>| {
                s.forward.get(k).map_or(s.feedback[joint], |forward| forward[joint])
            };
            let points = track.samples.iter().map(|s| (s.t, of(s))).collect();
            panel.line(*part, crate::report::JOINTS[k], points)
        });
        page.figure(&Figure::new(format!("Joint {}", joint + 1), "time [s]").panel(panel), "");
    }
}
