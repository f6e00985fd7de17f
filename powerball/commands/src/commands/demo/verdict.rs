//! The verdict of the demo: whether the effects found are those in the plant.
//!
//! The module also writes the demo as a page.

use super::Demo;
use crate::report::explained::add_to_page;
use crate::report::{Page, Tone, followed};
use powerball_explanation::explain::Explained;
use powerball_virtual_arm::PlantEffect as Effect;
use serde::Serialize;

/// How well the truth was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    /// The name is right, the joints too, and no other name was given.
    Right,
    /// The truth is among several names.
    RightAmongOthers,
    /// Names were given, the true one is not among them.
    Wrong,
    /// No name was given.
    NotNamed,
}

/// The truth against what was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// How well the truth was found.
    pub judgement: Judgement,
    /// The effect in the plant.
    pub truth: String,
    /// The effect's joints, from 1; empty where it is the whole arm's.
    pub joints: Vec<usize>,
    /// The effect's figures.
    pub figures: String,
    /// The named effects with their joints.
    pub named: Vec<(String, Vec<usize>)>,
}

impl Verdict {
    /// Compares.
    pub fn new(effect: &Effect, explained: &Explained) -> Verdict {
        let named: Vec<(String, Vec<usize>)> = (explained.effects.iter())
            .map(|e| (e.effect.clone(), e.joints.iter().map(|j| j.number()).collect()))
            .collect();
        let joints = effect.joints();
        let hit = |(name, at): &(String, Vec<usize>)| {
            name == effect.name() && joints.iter().all(|joint| at.contains(joint))
        };
        let exact =
            |(name, at): &(String, Vec<usize>)| name == effect.name() && (joints.is_empty() || *at == joints);
        let judgement = match named.as_slice() {
            [] => Judgement::NotNamed,
            [only] if exact(only) => Judgement::Right,
            several if several.iter().any(hit) => Judgement::RightAmongOthers,
            _ => Judgement::Wrong,
        };
        Verdict { judgement, truth: effect.name().to_string(), joints, figures: effect.describe(), named }
    }

    /// The verdict in a sentence.
    pub fn sentence(&self) -> &'static str {
        match self.judgement {
            Judgement::Right => "The name is right.",
            Judgement::RightAmongOthers => {
                "The true name is among those given; the others are not in the plant."
            }
            Judgement::Wrong => "The name is wrong.",
            Judgement::NotNamed => "Nothing was named.",
        }
    }

    /// The effect in the plant, in words.
    pub fn truth_in_words(&self) -> String {
        format!("{}{}: {}", self.truth, at(&self.joints), self.figures)
    }

    /// The named effects, in words.
    pub fn named_in_words(&self) -> String {
        if self.named.is_empty() {
            return "nothing".to_string();
        }
        let words: Vec<String> =
            self.named.iter().map(|(name, joints)| format!("{name}{}", at(joints))).collect();
        words.join(", ")
    }
}

/// ` on joint 2`, ` on joints 1, 2`, or nothing.
fn at(joints: &[usize]) -> String {
    let list: Vec<String> = joints.iter().map(ToString::to_string).collect();
    match list.len() {
        0 => String::new(),
        1 => format!(" on joint {}", list[0]),
        _ => format!(" on joints {}", list.join(", ")),
    }
}

// The demo as a page.

/// The page of a demo.
pub fn page(demo: &Demo) -> Page {
    let (session, explained, verdict) = (&demo.session, &demo.explained, &demo.verdict);
    let mut page = Page::new("What is wrong with this arm?");
    page.lead(
        "A virtual LWA 4P has an effect that its model does not know about. It was recorded along exciting \
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
    match &demo.driven {
        Ok(driven) => {
            page.heading("The arm moved with what was found");
            page.lead(
                "The same virtual arm along a path that no model has seen, with computed torque in \
                current mode: once with the base model, once with the explained one.",
            );
            followed::add_to_page(&mut page, &driven.followed, &driven.path, &driven.tracks);
        }
        Err(why) => page.note(Tone::Plain, &format!("The arm was not moved with the models: {why}")),
    }
    page
}
