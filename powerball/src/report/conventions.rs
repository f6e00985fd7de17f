//! What the columns of logs are, for a page.

use crate::identification::conventions::Conventions;
use crate::report::{Page, Table, Tone};

/// What is wrong with the columns or the arm file, or that nothing is.
pub fn verdict(page: &mut Page, conventions: &Conventions) {
    let tone = if conventions.differ() { Tone::Bad } else { Tone::Plain };
    page.note(tone, &conventions.verdict());
}

/// Adds the verdict, and every question.
pub fn add_to_page(page: &mut Page, conventions: &Conventions) {
    verdict(page, conventions);
    let mut table =
        Table::new(["question", "as said", "held-out error as it is [%]", "as it would be [%]", "evidence"]);
    for answer in &conventions.answers {
        let said = match answer.as_said {
            Some(true) => "yes",
            Some(false) => "no",
            None => "not told by these logs",
        };
        table.push([
            answer.question.to_string(),
            said.to_string(),
            errors(&answer.as_it_is),
            errors(&answer.as_it_would_be),
            answer.sentence.clone(),
        ]);
    }
    page.folded("What the columns of the logs are, question by question", &table);
}

fn errors(list: &[Option<f64>]) -> String {
    let one = |x: &Option<f64>| x.map_or("–".to_string(), |x| format!("{x:.1}"));
    list.iter().map(one).collect::<Vec<_>>().join(", ")
}
