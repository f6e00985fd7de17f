//! Logs that cannot show what they are asked for: what `identify` and `explain` report about them, and how
//! they end.

use powerball::commands::demo::Session;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A folder with good logs of the virtual arm, and room for spoilt ones.
struct Bench {
    folder: PathBuf,
    arm: PathBuf,
    logs: Vec<PathBuf>,
}

/// A log as columns: names and rows.
type Table = (Vec<String>, Vec<Vec<f64>>);

impl Bench {
    fn new(name: &str) -> Bench {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::create_dir_all(&folder).unwrap();
        let session = Session::record(&folder, 2, &["load_friction"]).unwrap();
        let logs = session.fit.into_iter().take(3).chain(session.held_out.into_iter().take(1)).collect();
        Bench { folder, arm: session.arm_file, logs }
    }

    /// The logs with something done to each; the last one is held out.
    fn spoilt(&self, name: &str, spoil: impl Fn(&mut Table)) -> Vec<String> {
        let spoil = |(k, path): (usize, &PathBuf)| {
            let text = std::fs::read_to_string(path).unwrap();
            let mut lines = text.lines();
            let names = lines.next().unwrap().split(',').map(str::to_string).collect();
            let rows = lines.map(|l| l.split(',').map(|x| x.parse().unwrap()).collect()).collect();
            let mut table: Table = (names, rows);
            spoil(&mut table);
            let mut out = table.0.join(",") + "\n";
            for row in &table.1 {
                let cells: Vec<String> = row.iter().map(ToString::to_string).collect();
                out += &(cells.join(",") + "\n");
            }
            let file = self.folder.join(format!("{name}_{k}.csv"));
            std::fs::write(&file, out).unwrap();
            file.to_str().unwrap().to_string()
        };
        self.logs.iter().enumerate().map(spoil).collect()
    }

    fn run(&self, command: &str, logs: &[String]) -> Output {
        let (held_out, fit) = logs.split_last().unwrap();
        let out = self.folder.join("out");
        Command::new(env!("CARGO_BIN_EXE_powerball"))
            .args([command, "--arm", self.arm.to_str().unwrap(), "--json", "--out", out.to_str().unwrap()])
            .arg("--log")
            .args(fit)
            .args(["--validate", held_out])
            .output()
            .unwrap()
    }
}

fn complaint(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The warnings of a result that should not be used, for a reason that names a joint.
fn warnings(output: &Output, joint: usize) -> String {
    let first = complaint(output).lines().next().unwrap_or_default().to_string();
    assert_eq!(output.status.code(), Some(3), "{first}");
    assert!(first.contains(&format!("joint {joint} does not move in the logs to fit")), "{first}");
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    let list = result["warnings"].as_array().unwrap();
    list.iter().map(|w| w.as_str().unwrap().to_string() + "\n").collect()
}

/// Every position drawn towards its first one.
fn calm(table: &mut Table, joints: std::ops::RangeInclusive<usize>, share: f64) {
    for joint in joints {
        let first = table.1[0][joint];
        table.1.iter_mut().for_each(|row| row[joint] = first + share * (row[joint] - first));
    }
}

#[test]
fn what_logs_cannot_show_is_said_with_what_to_record_instead() {
    let bench = Bench::new("poor_logs");
    for command in ["identify", "explain"] {
        // Too little motion on every joint: nothing is claimed at all.
        let refused = bench.run(command, &bench.spoilt("little", |t| calm(t, 1..=6, 0.004)));
        let said = complaint(&refused);
        assert_eq!(refused.status.code(), Some(1), "{command}: {said}");
        assert!(said.contains("joint 2 moves by 0.0") && said.contains("powerball excite"), "{said}");

        // … and on one of them.
        let said = warnings(&bench.run(command, &bench.spoilt("one", |t| calm(t, 4..=4, 0.004))), 4);
        assert!(
            said.contains("joint 4 moves by 0.0") && said.contains("nor any effect on it"),
            "{command}: {said}"
        );
        assert!(!said.contains("joint 3 moves by"), "{said}");

        // No position of a joint, although its torque changes.
        let said = warnings(&bench.run(command, &bench.spoilt("still", |t| calm(t, 3..=3, 0.0))), 3);
        assert!(
            said.contains("joint 3 does not move") && said.contains("encoder is dead"),
            "{command}: {said}"
        );

        // A dead torque spoils no other joint: it is not fitted.
        let dead = bench.run(command, &bench.spoilt("dead", |t| t.1.iter_mut().for_each(|row| row[8] = 3.2)));
        let said = warnings(&dead, 2);
        assert!(said.contains("joint 2 moves, but its torque never changes"), "{command}: {said}");
        let result: Value = serde_json::from_slice(&dead.stdout).unwrap();
        let errors = if command == "explain" { &result["before"]["validate"] } else { &result["validate"] };
        let relative = |joint: usize| errors["relative"][joint - 1].as_f64().unwrap();
        assert!(relative(3) < 0.05 && relative(1) < 0.05, "{errors}");

        // Currents of a joint, or of all, that were not logged: not readable as a log of this arm.
        let drop = |from: usize, to: usize| {
            move |t: &mut Table| {
                t.0.drain(from..to);
                t.1.iter_mut().for_each(|row| drop_range(row, from, to));
            }
        };
        for (from, to, missing) in [(7, 13, "tau1, tau2"), (10, 11, "missing: tau4")] {
            let unusable = bench.run(command, &bench.spoilt("missing", drop(from, to)));
            assert_eq!(unusable.status.code(), Some(2));
            assert!(complaint(&unusable).contains(missing), "{}", complaint(&unusable));
        }
    }
}

fn drop_range(row: &mut Vec<f64>, from: usize, to: usize) {
    row.drain(from..to);
}
