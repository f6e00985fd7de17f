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

/// Of two logs, or halves of one, each often shows too little of what both show together.
pub const FEWEST_LOGS: usize = 3;

/// Searches all logs but one, for each of them, and counts for every name how often it is found again. What
/// is in some logs only is not asked: it is gone with its log. Below [`FEWEST_LOGS`] no name is asked.
/// `search` explains logs with options.
///
/// # Errors
/// [`ExplainError`] but for a search that has no result without one of the logs, which is not counted. Where
/// fewer than two are left, no name is asked.
pub(super) fn find_again(
    search: impl Fn(&[Log], &ExplainOptions<'_>) -> Result<Explained, ExplainError>,
    logs: &[Log],
    options: &ExplainOptions<'_>,
    explained: &mut Explained,
) -> Result<(), ExplainError> {
    if logs.len() < FEWEST_LOGS {
        return Ok(());
    }
    let alone = ExplainOptions { leave_one_out: false, progress: Progress::default(), ..options.clone() };
    let mut searched: Vec<Explained> = Vec::new();
    for (out, log) in logs.iter().enumerate() {
        options.progress.say(&format!("searching without {}", log.file));
        match search(&[&logs[..out], &logs[out + 1..]].concat(), &alone) {
            Ok(explained) => searched.push(explained),
            Err(ExplainError::Fit(_) | ExplainError::Changes(_)) => {}
            Err(other) => return Err(other),
        }
    }
    if searched.len() < 2 {
        return Ok(());
    }
    for effect in explained.effects.iter_mut().filter(|effect| effect.logs.is_empty()) {
        let gives = |part: &&Explained| part.effects.iter().any(|e| e.is(&effect.effect, &effect.joints));
        let again = Again { found: searched.iter().filter(gives).count(), of: searched.len() };
        effect.in_some_logs = again.is_in_some(&options.rule);
        effect.again = Some(again);
    }
    Ok(())
}
