//! The demo as a page.

use super::{Demo, Judgement};
use crate::report::explained::add_to_page;
use crate::report::{Page, Tone};

/// The page of a demo.
pub fn page(demo: &Demo) -> Page {
    let (session, explained, verdict) = (&demo.session, &demo.explained, &demo.verdict);
    let mut page = Page::new("What is wrong with this arm?");
    page.lead(
        "A virtual LWA 4P has an effect that its model was not told of. It was recorded along exciting \
            paths, its base \
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
    add_to_page(&mut page, explained);
    page
}
