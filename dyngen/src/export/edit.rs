//! A text with some places replaced and all other bytes unchanged.

use roxmltree::Node;
use std::ops::Range;

/// Replacements in one text, in any order; places must not overlap.
#[derive(Debug, Default)]
pub(super) struct Edits(Vec<(Range<usize>, String)>);

impl Edits {
    /// Puts text in the place of a range; an empty range inserts.
    pub(super) fn replace(&mut self, place: Range<usize>, text: impl Into<String>) {
        self.0.push((place, text.into()));
    }

    /// Puts text before a place.
    pub(super) fn insert(&mut self, at: usize, text: impl Into<String>) {
        self.replace(at..at, text);
    }

    /// The text with all replacements.
    pub(super) fn apply(mut self, text: &str) -> String {
        // Insertions at one place keep their order.
        self.0.sort_by_key(|(place, _)| place.start);
        let (mut result, mut at) = (String::with_capacity(text.len()), 0);
        for (place, new) in self.0 {
            result.push_str(&text[at..place.start.max(at)]);
            result.push_str(&new);
            at = place.end.max(at);
        }
        result.push_str(&text[at..]);
        result
    }
}

/// The white space that the line of a place begins with.
pub(super) fn indentation(text: &str, at: usize) -> &str {
    let start = text[..at].rfind('\n').map_or(0, |i| i + 1);
    let line = &text[start..];
    &line[..line.len() - line.trim_start_matches([' ', '\t']).len()]
}

/// A comment of one line; two dashes would end it.
pub(super) fn comment(words: &str) -> String {
    let mut words: String = words.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    while words.contains("--") {
        words = words.replace("--", "- -");
    }
    format!("<!-- {} -->", words.trim_end_matches('-'))
}

/// A text as an attribute's value.
pub(super) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

/// The shortest text that is the number.
pub(super) fn shortest(x: f64) -> String {
    if x == 0.0 { "0".to_string() } else { format!("{x:?}") }
}

/// The first element of that name below another.
pub(super) fn child<'d, 't>(node: Node<'d, 't>, name: &str) -> Option<Node<'d, 't>> {
    node.children().find(|n| n.is_element() && n.tag_name().name() == name)
}
