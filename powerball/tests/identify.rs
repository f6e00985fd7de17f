//! `powerball identify` and `powerball verify` as a user runs them, on logs of the virtual arm.

#![allow(clippy::unwrap_used, clippy::panic)]

use powerball::commands::demo::Session;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

fn powerball(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_powerball")).args(arguments).output().unwrap()
}

fn json(output: &Output) -> Value {
    let complaint = String::from_utf8_lossy(&output.stderr);
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {complaint}"))
}

fn scratch(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// Logs of an arm whose friction grows with the load: fitted ones, and those of another path. They are
/// recorded once, and every test has them in a folder of its own.
fn session(name: &str) -> (PathBuf, Vec<String>, Vec<String>) {
    static RECORDED: OnceLock<Session> = OnceLock::new();
    // A folder of its own for each process that records: tests may be processes next to each other.
    let logs = scratch(&format!("{name}_logs"));
    let recorded = RECORDED.get_or_init(|| Session::record(&logs, 3, &["load_friction"]).unwrap());
    let folder = scratch(name);
    let own = |file: &PathBuf| {
        let copy = folder.join(file.file_name().unwrap());
        std::fs::copy(file, &copy).unwrap();
        copy.display().to_string()
    };
    own(&recorded.arm_file);
    let [fit, held_out] = [&recorded.fit, &recorded.held_out].map(|files| files.iter().map(own).collect());
    (folder, fit, held_out)
}

fn run(command: &[&str], logs: &[String], rest: &[&str]) -> Output {
    let logs: Vec<&str> = logs.iter().map(String::as_str).collect();
    powerball(&[command, &["--log"], &logs, rest].concat())
}

#[test]
fn a_fit_comes_with_a_real_arm_that_costs_next_to_nothing() {
    let (folder, fit, other) = session("identify");
    let (arm, out) = (folder.join("arm.toml"), folder.join("result"));
    let (arm, out) = (arm.to_str().unwrap(), out.to_str().unwrap());
    let held_out: Vec<&str> = other.iter().map(String::as_str).collect();
    let rest = [&["--out", out, "--json", "--validate"][..], &held_out].concat();
    let done = run(&["identify", "--arm", arm], &fit, &rest);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let result = json(&done);
    let consistent = &result["consistent"];
    for (cost, eigenvalue) in
        consistent["cost"].as_array().unwrap().iter().zip(consistent["eigenvalues"].as_array().unwrap())
    {
        assert!(cost.as_f64().unwrap() < 0.005 && eigenvalue.as_f64().unwrap() > 0.0);
    }
    // The values are those of a real arm by the generator's own judgement, and every parameter is there.
    let values = dyngen::Values::read(&Path::new(out).join("consistent.json")).unwrap();
    let model = dyngen::Model::derive(dyngen::Arm::read(Path::new(arm)).unwrap()).unwrap();
    let set = model.set(dyngen::SetKind::Full).unwrap();
    let values = values.of_set(&model, set).unwrap();
    assert!(dyngen::consistency::check(&model, dyngen::SetKind::Full, &values).unwrap().possible);

    // On the other path the model does as the fit says, and the undeclared effect keeps it from the noise
    // floor.
    let identified = format!("{out}/identified.json");
    let verify = |tolerance: &str| {
        run(
            &["verify", "--arm", arm, "--model", &identified, "--tolerance", tolerance],
            &other,
            &["--out", out, "--json"],
        )
    };
    let judged = verify("0.5");
    assert!(judged.status.success(), "{}", String::from_utf8_lossy(&judged.stderr));
    let verdict = json(&judged);
    for (j, joint) in verdict["joints"].as_array().unwrap().iter().enumerate() {
        let number = |v: &Value| v.as_f64().unwrap();
        let rms = number(&joint["rms"]);
        assert!((rms - number(&result["validate"]["rms"][j])).abs() < 1e-9 * rms);
        assert!(number(&joint["interval"][0]) < rms && rms < number(&joint["interval"][1]));
        assert!(rms > 0.9 * number(&joint["noise_floor"]));
    }
    let strict = verify("0.001");
    assert_eq!(strict.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&strict.stderr).contains("may exceed 0.1 % of its torque"));
}

/// Results are written and the reason is reported; who knows better accepts them.
#[test]
fn a_result_that_should_not_be_built_on_ends_with_3() {
    let (folder, fit, _) = session("doubtful");
    let (arm, out) = (folder.join("arm.toml"), folder.join("result"));
    let (arm, out) = (arm.to_str().unwrap(), out.to_str().unwrap());
    let identify = |rest: &[&str]| run(&["identify", "--arm", arm, "--out", out], &fit, rest);
    let reversed = ["--map", "tau.sign = -1"];
    let said = |output: &Output| String::from_utf8_lossy(&output.stdout).into_owned();

    let doubtful = identify(&reversed);
    assert_eq!(doubtful.status.code(), Some(3));
    assert!(
        said(&doubtful).starts_with("The columns are not what they are declared to be."),
        "{}",
        said(&doubtful)
    );
    let reason = String::from_utf8_lossy(&doubtful.stderr);
    assert!(reason.contains("not what they are declared to be") && reason.contains("--accept"), "{reason}");
    assert!(Path::new(out).join("identified.json").is_file());

    let accepted = identify(&[&reversed[..], &["--accept", "--quiet"]].concat());
    assert_eq!((accepted.status.code(), said(&accepted).as_str()), (Some(0), ""));

    // Notes are counted, and all there with --verbose.
    let sound = identify(&[]);
    assert_eq!(sound.status.code(), Some(0));
    assert!(said(&sound).contains(": --verbose or the page\nreport: "), "{}", said(&sound));
    let verbose = said(&identify(&["--verbose"]));
    assert!(verbose.contains("\nnote: ") && !verbose.contains("--verbose"), "{verbose}");
}

#[test]
fn a_model_of_another_arm_is_not_judged() {
    let (folder, fit, _) = session("verify_wrong");
    let arm = folder.join("arm.toml").display().to_string();
    let out = folder.display().to_string();
    for (content, reason) in [
        ("{", "is no JSON"),
        ("{}", "has no list 'parameters'"),
        (r#"{"parameters": [], "friction": []}"#, "it was identified for another arm file"),
    ] {
        let model = folder.join("model.json");
        std::fs::write(&model, content).unwrap();
        let model = model.display().to_string();
        let done = run(&["verify", "--arm", &arm, "--model", &model], &fit, &["--out", &out]);
        assert_eq!(done.status.code(), Some(2));
        let complaint = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(complaint.contains(reason) && complaint.contains("model.json"), "{complaint}");
    }
}

/// Summaries made one by one, mixed with a log, come to the answer of the logs, to the last digit; others are
/// refused.
#[test]
fn summaries_stand_for_their_logs() {
    let (folder, fit, other) = session("summaries");
    let arm = folder.join("arm.toml").display().to_string();
    let out = folder.join("result").display().to_string();
    let file = |name: &str| folder.join(name).display().to_string();
    let mut mixed = Vec::new();
    for (k, log) in fit.iter().enumerate() {
        let summary = file(&format!("{k}.summary"));
        let done = powerball(&["summarize", "--arm", &arm, "--log", log, "--out", &summary, "--json"]);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        assert_eq!(json(&done)["logs"][0], log.as_str());
        // Logs of about 20 s are longer than what is kept of them.
        let size = |file: &str| std::fs::metadata(file).unwrap().len();
        assert!(4 * size(&summary) < 3 * size(log), "{} of {} bytes", size(&summary), size(log));
        mixed.push(if k == 0 { log.clone() } else { summary });
    }
    let answer = |logs: &[String]| json(&run(&["identify", "--arm", &arm], logs, &["--out", &out, "--json"]));
    let (direct, reduced) = (answer(&fit), answer(&mixed));
    for key in ["parameters", "friction", "fit", "consistent"] {
        assert_eq!(direct[key], reduced[key], "{key}");
    }

    let refused = |files: &[String], rest: &[&str]| {
        let done = run(&["identify", "--arm", &arm], files, &[&["--out", out.as_str()], rest].concat());
        assert_eq!(done.status.code(), Some(2));
        String::from_utf8_lossy(&done.stderr).into_owned()
    };
    assert!(refused(&mixed[1..2], &["--estimator", "robust"]).contains("give the log itself"));
    assert!(refused(&[mixed[1].clone(), mixed[1].clone()], &[]).contains("given twice"));
    let torn = file("torn.summary");
    let bytes = std::fs::read(&mixed[1]).unwrap();
    std::fs::write(&torn, &bytes[..bytes.len() / 2]).unwrap();
    assert!(refused(&[torn], &[]).contains("torn or damaged"));
    let changed = file("changed.toml");
    let text = std::fs::read_to_string(&arm).unwrap().replacen("velocity = 1.257", "velocity = 1.25", 1);
    std::fs::write(&changed, text).unwrap();
    let done = run(&["identify", "--arm", &changed], &mixed[1..2], &["--out", &out]);
    let complaint = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(
        done.status.code() == Some(2) && complaint.contains("its arm file said something else"),
        "{complaint}"
    );
    assert!(other.iter().all(|o| !fit.contains(o)));
}

/// Every estimator gives a model of these logs, and identified.json goes into generated code as it is.
#[test]
fn estimators_are_chosen_by_name_and_their_values_go_back() {
    let (folder, fit, _) = session("estimators");
    let arm = folder.join("arm.toml").display().to_string();
    let weighted = json(&run(
        &["identify", "--arm", &arm],
        &fit,
        &["--out", &folder.join("w").display().to_string(), "--json"],
    ));
    for estimator in ["robust", "instrumental"] {
        let out = folder.join(estimator).display().to_string();
        let options = ["--out", out.as_str(), "--estimator", estimator, "--friction", "asymmetric", "--json"];
        let done = run(&["identify", "--arm", &arm], &fit, &options);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let result = json(&done);
        assert!(result["friction"][0]["offset"].is_number());
        for (a, b) in
            weighted["fit"]["rms"].as_array().unwrap().iter().zip(result["fit"]["rms"].as_array().unwrap())
        {
            assert!(b.as_f64().unwrap() < 1.2 * a.as_f64().unwrap());
        }
    }
    let identified = folder.join("w/identified.json");
    let values = dyngen::Values::read(&identified).unwrap();
    let model = dyngen::Model::derive(dyngen::Arm::read(Path::new(&arm)).unwrap()).unwrap();
    let values = values.of_set(&model, model.set(dyngen::SetKind::Minimal).unwrap()).unwrap();
    assert_eq!(values[0], weighted["parameters"][0]["value"].as_f64().unwrap());

    let out = folder.join("real.json").display().to_string();
    let identified = identified.display().to_string();
    let done = powerball(&["consistent", "--arm", &arm, "--values", &identified, "--out", &out, "--json"]);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(json(&done)["distance"].as_array().unwrap().iter().all(|d| d.as_f64().unwrap() < 1.0));
}

/// Table 3 is no arm's: the nearest one is reported with its distance, and is one by the generator's
/// judgement.
#[test]
fn published_values_become_those_of_a_real_arm() {
    let folder = scratch("published");
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (arm, table) =
        (here.join("arm.toml").display().to_string(), here.join("table3.json").display().to_string());
    let out = folder.join("real.json");
    let written = out.display().to_string();
    let done = powerball(&["consistent", "--arm", &arm, "--values", &table, "--out", &written, "--json"]);
    let found = json(&done);
    assert!(found["set"] == "published" && found["possible"] == false);
    assert!(found["distance"][0].as_f64().unwrap() > 0.1);
    let model = dyngen::Model::derive(dyngen::Arm::read(Path::new(&arm)).unwrap()).unwrap();
    let (kind, values) = dyngen::Values::read(&out).unwrap().recognise(&model).unwrap();
    assert!(dyngen::consistency::check(&model, kind, &values).unwrap().possible);
    let missing = powerball(&["consistent", "--arm", &arm, "--values", "nowhere.json", "--out", &written]);
    assert_eq!(missing.status.code(), Some(2));
}

/// The library gives what the command writes: of files, of logs in memory, and of what was made of them; and
/// says why it does not.
#[test]
fn the_library_gives_what_the_command_writes() {
    use powerball::identification::{IdentifyError, VerifyOptions, summarize, verify};
    use powerball::logs::{Progress, regression::DataOptions};
    use powerball::{IdentifyOptions, Log, Source, identify};
    let (folder, fit, other) = session("library");
    let arm = folder.join("arm.toml").display().to_string();
    let out = folder.join("result").display().to_string();
    let held_out: Vec<&str> = other.iter().map(String::as_str).collect();
    let rest = [&["--out", &out, "--json", "--validate"][..], &held_out].concat();
    let mut written = json(&run(&["identify", "--arm", &arm], &fit, &rest));
    // The library does not know where the arm came from.
    assert_eq!(written.as_object_mut().unwrap().remove("arm_file"), Some(arm.as_str().into()));
    let arm = dyngen::Arm::read(Path::new(&arm)).unwrap();
    let file = |name: &String| Source::file(name);
    let options = IdentifyOptions::default();
    let files = identify(&arm, fit.iter().map(file), other.iter().map(file), &options).unwrap();
    assert_eq!(serde_json::to_value(&files).unwrap(), written);

    let read = |files: &[String]| -> (Vec<Log>, usize) {
        let read = files.iter().map(|f| Log::read(f, &arm).unwrap());
        read.fold((Vec::new(), 0), |(mut logs, count), (log, findings)| {
            logs.push(log);
            (logs, count + findings.len())
        })
    };
    let ((logs, a), (judges, b)) = (read(&fit), read(&other));
    let memory = identify(&arm, &logs, &judges, &options).unwrap();
    let memory_json = serde_json::to_value(&memory).unwrap();
    let warnings = |value: &Value| value["warnings"].as_array().unwrap().len();
    assert_eq!(warnings(&memory_json) + a + b, warnings(&written));
    written["warnings"] = memory_json["warnings"].clone();
    assert_eq!(memory_json, written);

    // Sufficient statistics stand for their logs, and a model is judged as it was in the fit.
    let summary = summarize(&arm, &logs, &DataOptions::default(), Progress::default()).unwrap();
    let reduced = identify(&arm, [&summary.bands], [], &options).unwrap();
    assert_eq!((&reduced.parameters, &reduced.fit), (&memory.parameters, &memory.fit));
    let settings =
        VerifyOptions { joint_bands: memory.joint_bands.clone(), tolerance: 0.5, ..VerifyOptions::default() };
    let judged = verify(&arm, &memory.model(), &judges, &settings).unwrap();
    for (joint, rms) in judged.joints.iter().zip(&memory.validate.as_ref().unwrap().rms) {
        approx::assert_relative_eq!(joint.rms, *rms, max_relative = 1e-12);
    }

    let nowhere = identify(&arm, [Source::file("nowhere.csv")], [], &options).unwrap_err();
    assert!(matches!(&nowhere, IdentifyError::Unusable(reasons) if reasons[0].starts_with("nowhere.csv")));
    let itself = identify(&arm, [file(&fit[0])], [file(&fit[0])], &options).unwrap_err();
    assert!(matches!(&itself, IdentifyError::JudgesItself(name) if *name == fit[0]) && itself.is_input());
    let too_short = Log { pieces: Vec::new(), ..logs[0].clone() };
    let refused = identify(&arm, [&too_short], [], &options).unwrap_err();
    assert!(matches!(refused, IdentifyError::NothingUsable(_)) && !refused.is_input());
}
