//! Whether names that some of the logs give are contradicted by more of them.
//!
//! Each log judges in turn. To three of the others the model is fitted, and to all of them: a name of the few
//! logs is taken back where all logs together give it on none of its joints. The few logs are searched with
//! `leave_one_out`: whether names that are taken back, and no others, are marked as seen in some logs.

use dyngen::Arm;
use powerball::explanation::explain::NamedEffect;
use powerball::explanation::{ExplainOptions, Explained, explain_body};
use powerball::logs::log::{Log, common_clock, read_logs};
use powerball::logs::regression::RigidArm;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Logs that are fitted at a time.
const FEW: usize = 3;

/// Which logs.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The arm file
    #[arg(long)]
    arm: PathBuf,
    /// The logs, five or more
    #[arg(long, num_args = 5.., required = true)]
    log: Vec<PathBuf>,
}

/// Prints the names of all logs, and which names of three logs they take back.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let arm = Arm::read(&arguments.arm).map_err(|e| e.to_string())?;
    let body = RigidArm::new(&arm).map_err(|e| e.to_string())?;
    let (mut logs, _) = read_logs(&arguments.log, &arm).map_err(|e| e.to_string())?;
    common_clock(&mut logs);
    let explained = |fit: &[usize], judge: usize, leave_one_out: bool| -> Result<Explained, String> {
        let fit: Vec<Log> = fit.iter().map(|k| logs[*k].clone()).collect();
        let options = ExplainOptions { leave_one_out, ..ExplainOptions::default() };
        explain_body(&body, &fit, &logs[judge..=judge], &options).map_err(|e| e.to_string())
    };
    let (mut back, mut marked) = (BTreeMap::<String, usize>::new(), [[0; 2]; 2]);
    let subsets = subsets(logs.len());
    for judge in 0..logs.len() {
        let others: Vec<usize> = (0..logs.len()).filter(|k| *k != judge).collect();
        let all = explained(&others, judge, false)?;
        println!("judged on {}: {}", logs[judge].file, words(&all.effects));
        // Every subset once: it is judged on the first log after its last one.
        for few in subsets.iter().filter(|few| judge_of(few, logs.len()) == judge) {
            let some = explained(few, judge, true)?;
            for effect in &some.effects {
                let is_back = !all.effects.iter().any(|other| other.is(&effect.effect, &effect.joints));
                marked[usize::from(is_back)][usize::from(effect.in_some_logs)] += 1;
                let done = match (is_back, effect.in_some_logs) {
                    (true, true) => "taken back, marked",
                    (true, false) => "taken back",
                    (false, true) => "marked",
                    (false, false) => continue,
                };
                println!("  {few:?}: {} {done}", words(std::slice::from_ref(effect)));
                if is_back {
                    *back.entry(effect.effect.clone()).or_default() += 1;
                }
            }
        }
    }
    let [stay, back_at_all] = marked.map(|own| own[0] + own[1]);
    let names = stay + back_at_all;
    println!("{back_at_all} of {names} names of three logs are taken back by all: {back:?}");
    println!("marked: {} of these {back_at_all}, and {} of the {stay} others", marked[1][1], marked[0][1]);
    Ok(())
}

/// All choices of a few logs.
fn subsets(count: usize) -> Vec<Vec<usize>> {
    let all = 0..1usize << count;
    let chosen = |set: usize| (0..count).filter(|k| set >> k & 1 == 1).collect::<Vec<_>>();
    all.filter(|set| set.count_ones() as usize == FEW).map(chosen).collect()
}

/// The log that a choice is judged on.
fn judge_of(few: &[usize], count: usize) -> usize {
    let after = few.last().map_or(0, |last| last + 1);
    (0..count).map(|k| (after + k) % count).find(|k| !few.contains(k)).unwrap_or(0)
}

fn words(effects: &[NamedEffect]) -> String {
    let one = |e: &NamedEffect| {
        let joints: Vec<String> = e.joints.iter().map(ToString::to_string).collect();
        format!("{} ({}; stated {:.0} %)", e.effect, joints.join(" "), 100.0 * e.probability)
    };
    effects.iter().map(one).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_subset_is_judged_once_by_a_log_outside_of_it() {
        let subsets = subsets(7);
        assert_eq!(subsets.len(), 35);
        assert!(subsets.iter().all(|few| few.len() == 3 && !few.contains(&judge_of(few, 7))));
    }
}
