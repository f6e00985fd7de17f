//! The demo as a page.

use super::{Demo, Judgement};
use crate::report::{BarPairs, Page, Table, Tone, number};

/// The page of a demo.
pub fn page(demo: &Demo) -> Page {
    let (session, explained, verdict) = (&demo.session, &demo.explained, &demo.verdict);
    let mut page = Page::new("What is wrong with this arm?");
    page.lead(
        "A virtual LWA 4P has an effect that its model was not told of. It was recorded along exciting paths, its base \
         model was identified, and the residual was explained from the logs alone.",
    );
    let tone = match verdict.judgement {
        Judgement::Right => Tone::Good,
        Judgement::RightAmongOthers => Tone::Plain,
        Judgement::Wrong | Judgement::NotNamed => Tone::Bad,
    };
    let truth = format!(
        "In the plant: {}. Named: {}. {}",
        verdict.truth_in_words(),
        verdict.named_in_words(),
        verdict.sentence()
    );
    page.note(tone, &truth);
    let paths = session.fit.len() + session.held_out.len();
    page.facts([
        ("paths recorded".to_string(), format!("{paths}")),
        ("to fit / held out".to_string(), format!("{} / {}", session.fit.len(), session.held_out.len())),
        ("recorded".to_string(), format!("{:.0} s", session.recorded)),
        ("band of the errors".to_string(), format!("{} to {} Hz", explained.band[0], explained.band[1])),
    ]);
    errors(&mut page, demo);
    page
}

/// Errors on held-out paths before and after.
fn errors(page: &mut Page, demo: &Demo) {
    let explained = &demo.explained;
    page.heading("Errors on held-out paths");
    let (before, after) = (&explained.before.validate, &explained.after.validate);
    let mut bars =
        BarPairs::new("Torque error on held-out paths", "rms [N·m]", ["base model", "with what was named"]);
    let mut table =
        Table::new(["joint", "base model [N·m]", "with what was named [N·m]", "change", "noise floor [N·m]"]);
    for joint in 0..before.rms.len() {
        let (b, a, floor) = (before.rms[joint], after.rms[joint], explained.noise_floor[joint]);
        bars = bars.pair_with_floor(format!("joint {}", joint + 1), b, a, floor);
        table.push([
            (joint + 1).to_string(),
            number(b),
            number(a),
            format!("{:+.0} %", 100.0 * (a / b - 1.0)),
            number(floor),
        ]);
    }
    page.bars(&bars, "The dashed lines are what the measurement noise alone leaves in the band.");
    page.table(&table);
}
