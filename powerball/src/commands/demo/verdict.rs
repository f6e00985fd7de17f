//! Whether what was found is what is there.

use crate::explanation::explain::Explained;
use crate::virtual_arm::PlantEffect as Effect;
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
    /// Its joints, from 1; empty where it is the whole arm's.
    pub joints: Vec<usize>,
    /// Its figures.
    pub figures: String,
    /// What was named: effect and joints.
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

    /// What is in the plant, in words.
    pub fn truth_in_words(&self) -> String {
        format!("{}{}: {}", self.truth, at(&self.joints), self.figures)
    }

    /// What was named, in words.
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
