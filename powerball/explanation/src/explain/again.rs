//! Whether names are found again where a log is left out.
//!
//! A name that a few logs give may owe it to one of them: another log takes it back, though its size is the
//! same in each. Sizes log by log do not show that, the search on fewer logs does (stability selection:
//! Meinshausen and Bühlmann, J. R. Stat. Soc. B 2010, whose random halves are logs here, since samples of one
//! log have its path in common).

use super::named::Again;
use super::results::Explained;
use crate::options::{ExplainError, ExplainOptions};
use powerball_logs::Progress;
use powerball_logs::log::Log;

/// Searches all logs but one, for each of them, and both halves where there is one log, and counts for every
/// name how often it is found again. What is in some logs only is not asked: it is gone with its log.
/// `search` explains logs with options.
///
/// # Errors
/// [`ExplainError`] but for a part that holds too little, which counts as none.
pub(super) fn find_again(
    search: impl Fn(&[Log], &ExplainOptions<'_>) -> Result<Explained, ExplainError>,
    logs: &[Log],
    options: &ExplainOptions<'_>,
    explained: &mut Explained,
) -> Result<(), ExplainError> {
    let parts = parts(logs);
    let count = parts.len();
    let alone = ExplainOptions { leave_one_out: false, progress: Progress::default(), ..options.clone() };
    let mut searched: Vec<Explained> = Vec::new();
    for (number, part) in parts.iter().enumerate() {
        options.progress.say(&format!("searching part {} of {count} of the logs", number + 1));
        match search(part, &alone) {
            Ok(explained) => searched.push(explained),
            Err(ExplainError::Fit(_)) => {}
            Err(other) => return Err(other),
        }
    }
    for effect in explained.effects.iter_mut().filter(|effect| effect.logs.is_empty()) {
        let gives = |part: &&Explained| part.effects.iter().any(|e| e.is(&effect.effect, &effect.joints));
        let found = searched.iter().filter(gives).count();
        effect.again = (!searched.is_empty()).then_some(Again { found, of: searched.len() });
        effect.in_some_logs = effect.again.is_some_and(|again| again.is_in_some(&options.rule));
    }
    Ok(())
}

/// All logs but one, for each of them; both halves of a single one.
fn parts(logs: &[Log]) -> Vec<Vec<Log>> {
    match logs {
        [one] => one.halves().map(|half| vec![half]).to_vec(),
        _ => (0..logs.len()).map(|out| [&logs[..out], &logs[out + 1..]].concat()).collect(),
    }
}
