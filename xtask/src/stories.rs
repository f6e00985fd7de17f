//! What `explain` finds in measured logs: for each case the residual, what was named and on what evidence,
//! and the errors before and after. Figures show means over many samples; the logs themselves stay where they
//! are.

use dyngen::Arm;
use powerball::controller::JointNumber;
use powerball::explanation::explain::{NamedEffect, Shown};
use powerball::explanation::{ExplainOptions, Explained, explain};
use powerball::logs::log::read_logs;
use powerball::report::explained::{effect_figure, error_bars};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// Where to read and to write.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// The folder of the measured logs
    #[arg(long, default_value = "../shared/data")]
    data: PathBuf,
    /// The page; its figures go into the folder `figures` of the folder above
    #[arg(long, default_value = "docs/results/measured_cases.md")]
    write: PathBuf,
}

/// Some logs and the question that they are asked.
struct Case {
    /// Of the figures' files.
    name: &'static str,
    title: &'static str,
    question: &'static str,
    folder: &'static str,
    fit: Vec<String>,
    validate: Vec<String>,
}

fn cases() -> Vec<Case> {
    let ur10e = |names: &[&str]| names.iter().map(|n| format!("fourier_{n}.csv")).collect::<Vec<_>>();
    let repeats = |group: &str, numbers: &mut dyn Iterator<Item = usize>| {
        numbers.map(|k| format!("{group}_{k:02}.csv")).collect::<Vec<_>>()
    };
    let mut cases = vec![
        Case {
            name: "ur10e",
            title: "UR10e: what a rigid arm with tanh friction (Eq. 16) lacks",
            question: "Five exciting trajectories are fitted, two others are held out. Currents stand for \
                torques.",
            folder: "ur10e",
            fit: ur10e(&["12a", "12b", "12c", "7", "8"]),
            validate: ur10e(&["5", "14"]),
        },
        Case {
            name: "ur10e_load",
            title: "UR10e: a load that nobody declared",
            question: "One of the fitted logs runs with a load of about 2.8 kg on the flange; the held-out \
                one runs the same path without it.",
            folder: "ur10e",
            fit: ur10e(&["12a", "12b", "12c", "14_load", "5", "8"]),
            validate: ur10e(&["14", "7"]),
        },
    ];
    for (group, count) in [("A0", 20), ("A1", 20), ("A2", 20), ("B0", 14)] {
        cases.push(Case {
            name: match group {
                "A0" => "a0_even_odd",
                "A1" => "a1_even_odd",
                "A2" => "a2_even_odd",
                _ => "b0_even_odd",
            },
            title: match group {
                "A0" => "SCHUNK arm, group A0: even repeats against odd ones",
                "A1" => "SCHUNK arm, group A1: even repeats against odd ones",
                "A2" => "SCHUNK arm, group A2: even repeats against odd ones",
                _ => "SCHUNK arm, group B0: even repeats against odd ones",
            },
            question: "One torque input is repeated while the arm warms up. Even repeats are fitted, odd \
                ones held out. Both run one path: what only fits that path cannot be determined there.",
            folder: "lwa4p_rollouts",
            fit: repeats(group, &mut (2..=count).step_by(2)),
            validate: repeats(group, &mut (1..=count).step_by(2)),
        });
    }
    cases.push(Case {
        name: "b0_early_late",
        title: "SCHUNK arm, group B0: early repeats against late ones",
        question: "The first half of the repeats is fitted and the second half held out: a model that does \
            not know of warmth is wrong by then.",
        folder: "lwa4p_rollouts",
        fit: repeats("B0", &mut (1..=7)),
        validate: repeats("B0", &mut (8..=14)),
    });
    cases.push(Case {
        name: "start_points",
        title: "SCHUNK arm: across start points",
        question: "All repeats from two start points are fitted, those from a third are held out.",
        folder: "lwa4p_rollouts",
        fit: [repeats("A0", &mut (1..=20)), repeats("A1", &mut (1..=20))].concat(),
        validate: repeats("A2", &mut (1..=20)),
    });
    cases
}

/// Explains every case and writes the page.
pub(crate) fn run(arguments: &Arguments) -> Result<(), String> {
    let figures = arguments.write.with_file_name("..").join("figures");
    fs::create_dir_all(&figures).map_err(|e| format!("{}: {e}", figures.display()))?;
    let mut page = String::from(
        "# Measured logs, case by case\n\n\
         Every case is one run of `powerball explain`; the page is made, figures and all, by\n\n```sh\n\
         cargo run --release -p xtask -- stories\n```\n\n\
         Figures show means over equal numbers of samples (purple without the effect but with all others, \
         blue with it, orange what it adds), torques against the direction of motion where that is stated. \
         [measured.md](../measured.md) has the results in short and describes the data, \
         [explain.md](../explain.md) says what must be true before a name is given, and \
         [study.md](../study.md) how often a name is right where the truth is known.\n",
    );
    for case in cases() {
        println!("{}", case.title);
        let explained = explained(&case, &arguments.data)?;
        tell(&mut page, &case, &explained, &figures)?;
    }
    fs::write(&arguments.write, page).map_err(|e| format!("{}: {e}", arguments.write.display()))
}

fn explained(case: &Case, data: &Path) -> Result<Explained, String> {
    let folder = data.join(case.folder);
    let arm = Arm::read(&folder.join("arm.toml")).map_err(|e| e.to_string())?;
    let files: Vec<PathBuf> = case.fit.iter().chain(&case.validate).map(|file| folder.join(file)).collect();
    let (mut logs, _) = read_logs(&files, &arm).map_err(|e| e.to_string())?;
    let held_out = logs.split_off(case.fit.len());
    explain(&arm, &logs, &held_out, &ExplainOptions::default()).map_err(|e| e.to_string())
}

fn tell(page: &mut String, case: &Case, explained: &Explained, figures: &Path) -> Result<(), String> {
    let figure = |page: &mut String, name: &str, words: &str, text: String| {
        let file = format!("{}_{name}.svg", case.name);
        let _ = writeln!(page, "\n![{words}](../figures/{file})");
        fs::write(figures.join(&file), text).map_err(|e| format!("{file}: {e}"))
    };
    let _ = writeln!(page, "\n## {}\n\n{}\n", case.title, case.question);
    let _ = writeln!(page, "Fitted: {}. Held out: {}.", brief(&case.fit), brief(&case.validate));
    figure(page, "errors", "held-out errors before and after", error_bars(explained).to_file())?;
    let _ = writeln!(
        page,
        "\n| joint | base model, N·m | with what was named, N·m | change, 95 % interval |\n|---|---|---|---|"
    );
    let (before, after) = (&explained.before.validate.rms, &explained.after.validate.rms);
    for change in &explained.held_out_change {
        let (b, a) = (before[change.joint.index()], after[change.joint.index()]);
        let [low, high] = change.interval.map(|share| 100.0 * share);
        let rms = 100.0 * change.rms;
        let _ =
            writeln!(page, "| {} | {b:.3} | {a:.3} | {rms:+.0} % ({low:+.0} to {high:+.0}) |", change.joint);
    }
    if explained.effects.is_empty() {
        let _ = writeln!(page, "\nNothing is named.");
    }
    for effect in &explained.effects {
        evidence(page, effect, &explained.sliding);
        // One joint stands for all: the first is the one on which the effect explains most.
        if let Some(shown) = explained.shown.iter().find(|s| s.effect == effect.effect && !s.means.is_empty())
        {
            let means = Shown { rows: Vec::new(), ..shown.clone() };
            let words = format!("{} on joint {} over {}", shown.effect, shown.joint, shown.signal);
            figure(
                page,
                &format!("{}_{}", effect.effect, shown.joint),
                &words,
                effect_figure(&means).to_file(),
            )?;
        }
    }
    match &explained.unattributed {
        Some(rest) => {
            let _ = writeln!(
                page,
                "\nThe residual of joint {} still depends on {}, and nothing that was tried explains that \
                    well enough to be named.",
                list(&rest.joints),
                rest.depends_on.join(", ")
            );
        }
        None => page.push_str("\nNothing else is left that these logs could show.\n"),
    }
    let chance = &explained.false_positives;
    let _ = writeln!(
        page,
        "Of {} effects that cannot be in these logs, {} were accepted.",
        chance.surrogates, chance.accepted
    );
    for warning in explained.warnings.iter().filter(|w| !w.contains(".csv")) {
        let _ = writeln!(page, "\n> {warning}");
    }
    Ok(())
}

fn evidence(page: &mut String, effect: &NamedEffect, sliding: &[bool]) {
    let _ = writeln!(
        page,
        "\n**{}** on joint {}: {}.",
        effect.effect,
        list(&effect.joints),
        effect.size(sliding)
    );
    let least = effect.held_out_gain.iter().copied().fold(f64::INFINITY, f64::min);
    let _ = writeln!(
        page,
        "Squared errors of folds that were left out fall by {:.0} % on the joint where they fall least; p = \
            {:.1e} over all that was tried; evidence {:.1} times that of \
         the next name; {:.0} % of the excess over noise stays on these joints.",
        100.0 * least,
        effect.p_value,
        effect.margin,
        100.0 * effect.leftover
    );
    if !effect.rivals.is_empty() {
        page.push_str("\n| not | because it |\n|---|---|\n");
        for rival in &effect.rivals {
            let _ = writeln!(page, "| {} | {} |", rival.effect, rival.why_not);
        }
    }
}

fn list(joints: &[JointNumber]) -> String {
    joints.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

fn brief(files: &[String]) -> String {
    files.iter().map(|f| f.trim_end_matches(".csv")).collect::<Vec<_>>().join(", ")
}
