//! The commands as a user types them: results, exit codes, errors.

#![allow(clippy::unwrap_used, clippy::panic)]

use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn dyngen(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_dyngen")).args(args).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn arm() -> String {
    workspace().join("powerball/arm.toml").display().to_string()
}

/// A file in a folder of this test run.
fn file(name: &str, content: &str) -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::write(&path, content).unwrap();
    path.display().to_string()
}

fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap_or_else(|e| panic!("{e}: {}", text(&output.stderr)))
}

#[test]
fn describe_reports_the_counts_of_the_paper() {
    let out = dyngen(&["describe", &arm(), "--json"]);
    assert!(out.status.success());
    let d = json(&out);
    assert_eq!(d["parameters"].as_array().unwrap().len(), 44);
    let count = |set: &str, key: &str| d["sets"][set][key].as_u64().unwrap();
    assert_eq!((count("minimal", "count"), count("minimal", "rank")), (19, 19));
    assert_eq!((count("symbolic", "count"), count("symbolic", "rank")), (29, 19));
    assert_eq!((count("published", "count"), count("published", "rank")), (29, 19));
    assert_eq!(d["sets"]["published"]["exact"], true);
    assert_eq!(d["sets"]["published"]["relations"].as_array().unwrap().len(), 10);
    assert_eq!(d["sets"]["minimal"]["relations"].as_array().unwrap().len(), 0);
    assert_eq!(d["unidentifiable"], serde_json::json!(["m1", "my1", "Ixx1", "Izz1"]));
    let first = &d["sets"]["minimal"]["parameters"][0]["terms"][0];
    assert_eq!(
        (&first["parameter"], &first["coefficient"], &first["value"]),
        (&"Iyy1".into(), &"1".into(), &1.0.into())
    );
    for function in ["regressor", "inverse_dynamics", "mass_matrix", "coriolis_matrix", "gravity"] {
        assert!(d["operations"][function]["mul"].as_u64().unwrap() > 0, "{function}");
    }
    let table = text(&dyngen(&["describe", &arm()]).stdout);
    for words in ["44 of 66 parameters", "minimal: 19", "symbolic: 29", "published: 29 parameters of rank 19"]
    {
        assert!(table.contains(words), "{words} in\n{table}");
    }
}

#[test]
fn describe_bounds_the_rounding_where_the_arm_has_limits() {
    // The paper's arm has none.
    assert!(json(&dyngen(&["describe", &arm(), "--json"])).get("rounding").is_none());
    let path = |file: &str| workspace().join(file).display().to_string();
    let [geared, values] = ["powerball/lwa4p.toml", "examples/cpp-controller/model.json"].map(path);
    let unit = json(&dyngen(&["describe", &geared, "--json"]));
    let given = json(&dyngen(&["describe", &geared, "--json", "--values", &values]));
    assert!(unit["rounding_parameters"].as_str().unwrap().contains("±1 SI unit"));
    assert!(given["rounding_parameters"].as_str().unwrap().contains("given values"));
    let of = |d: &Value, function: &str, format: &str| -> Vec<f64> {
        let bounds = d["rounding"][function][format].as_array().unwrap();
        bounds.iter().map(|x| x.as_f64().unwrap()).collect()
    };
    for (function, entries) in [("inverse_dynamics", 6), ("mass_matrix", 36), ("forward_kinematics", 16)] {
        let (single, double) = (of(&given, function, "f32"), of(&given, function, "f64"));
        assert_eq!((single.len(), double.len()), (entries, entries));
        // Of unit by unit 2⁻²⁹, apart from constants, which a double has exactly more often.
        for (s, d) in single.iter().zip(&double) {
            assert!(*d <= 1.1 * s * 2f64.powi(-29) && *s < 1e-3, "{function}: {s:e} {d:e}");
        }
    }
    // B is positive for these values: accelerations have a bound.
    let accelerations = of(&given, "forward_dynamics", "f32");
    assert!(accelerations.len() == 6 && accelerations.iter().all(|x| *x < 2e-3), "{accelerations:?}");
    // Λ has bounds where it is not too large, and in f64 alone: no bound is no number, with the reason.
    let all = given["rounding"].as_object().unwrap();
    let without = all.iter().filter(|(_, of)| of.get("why").is_some()).map(|(f, _)| f.as_str());
    let expected = ["task_inertia", "dynamically_consistent_inverse"];
    assert_eq!(without.collect::<BTreeSet<_>>(), BTreeSet::from(expected));
    let inertia = &given["rounding"]["task_inertia"];
    assert!(of(&given, "task_inertia", "f64").iter().all(|x| *x < 1e-5), "{inertia}");
    let inverse = of(&given, "dynamically_consistent_inverse", "f64");
    assert!(inverse.len() == 36 && inverse.iter().all(|x| *x < 1e-5), "{inverse:?}");
    let loaded = of(&given, "forward_dynamics_with_payload", "f64");
    assert!(loaded.len() == 6 && loaded.iter().all(|x| *x < 1e-4), "{loaded:?}");
    assert!(inertia["f32"][0].is_null() && inertia["why"].as_str().unwrap().contains("in f32"), "{inertia}");
    let poses = &inertia["where"];
    assert_eq!(poses["task_inertia_diagonal_at_most"].as_array().unwrap().len(), 6, "{inertia}");
    assert!((0.5..0.6).contains(&poses["share_of_poses"].as_f64().unwrap()), "{inertia}");
    let why = unit["rounding"]["forward_dynamics"]["why"].as_str().unwrap();
    assert!(why.contains("--values"), "{why}");
    let table = text(&dyngen(&["describe", &geared]).stdout);
    for part in ["rounding: |emitted − exact|", "none for ", "τ in f32, joint by joint: "] {
        assert!(table.contains(part), "{part}: {table}");
    }
    let wrong = dyngen(&["describe", &geared, "--values", &geared]);
    assert_eq!(wrong.status.code(), Some(2));
}

#[test]
fn describe_says_why_the_published_sums_are_not_exact_with_another_ratio() {
    let original = std::fs::read_to_string(arm()).unwrap();
    let at = original.rfind("rotor_ratio = 1").unwrap();
    let geared = file("k6.toml", &format!("{}rotor_ratio = 100{}", &original[..at], &original[at + 15..]));
    let d = json(&dyngen(&["describe", &geared, "--json"]));
    assert_eq!(d["sets"]["published"]["exact"], false);
    assert_eq!(d["sets"]["published"]["lost"][0]["parameter"], "Im6");
    assert!(text(&dyngen(&["describe", &geared]).stdout).contains("NOT exact"));
    let refused = dyngen(&["generate", &geared, "-o", &file("never.rs", ""), "--parameters", "published"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(text(&refused.stderr).contains("Im6"));
    let all = file("k100.toml", &original.replace("rotor_ratio = 1\n", "rotor_ratio = 100\n"));
    assert_eq!(json(&dyngen(&["describe", &all, "--json"]))["sets"]["minimal"]["count"], 23);
}

#[test]
fn generate_writes_the_same_bytes_twice_and_notices_a_stale_file() {
    let (one, two) = (file("one.rs", ""), file("two.rs", ""));
    for out in [&one, &two] {
        assert!(dyngen(&["generate", &arm(), "-o", out]).status.success());
    }
    let source = std::fs::read_to_string(&one).unwrap();
    assert_eq!(source, std::fs::read_to_string(&two).unwrap());
    assert!(source.starts_with("// @generated by dyngen"));
    assert!(dyngen(&["generate", &arm(), "-o", &one, "--check"]).status.success());
    std::fs::write(&two, source.replace("dq1", "dq2")).unwrap();
    assert_eq!(dyngen(&["generate", &arm(), "-o", &two, "--check"]).status.code(), Some(1));
    let some = file("some.rs", "");
    assert!(
        dyngen(&[
            "generate",
            &arm(),
            "-o",
            &some,
            "--functions",
            "gravity,mass_matrix",
            "--parameters",
            "full"
        ])
        .status
        .success()
    );
    let some = std::fs::read_to_string(&some).unwrap();
    assert!(some.contains("fn gravity") && some.contains("fn mass_matrix") && !some.contains("fn regressor"));
    assert!(some.contains("PARAMETERS: usize = 44"));
}

#[test]
fn generate_in_c_writes_a_header_too_and_says_what_c_does_not_have() {
    let (source, header) = (file("inc.c", ""), file("inc.h", ""));
    let generate = |more: &[&str]| {
        let given = ["generate", &arm(), "--language", "c", "--functions", "gravity"];
        dyngen(&[&given[..], more].concat())
    };
    assert!(generate(&["-o", &source]).status.success());
    let declared = std::fs::read_to_string(&header).unwrap();
    assert!(std::fs::read_to_string(&source).unwrap().contains("#include \"inc.h\""));
    assert!(declared.contains("void powerball_lwa4p_gravity("), "{declared}");
    assert!(generate(&["-o", &source, "--check"]).status.success());
    std::fs::write(&header, declared.replace("gravity(", "weight(")).unwrap();
    let stale = generate(&["-o", &source, "--check"]);
    assert_eq!(stale.status.code(), Some(1));
    assert!(text(&stale.stderr).contains("inc.h is stale"), "{}", text(&stale.stderr));
    for (more, words) in [
        (&["-o", &source, "--batch"][..], "batch"),
        (&["-o", &source, "--tests"], "tests"),
        (&["-o", "arm.rs"], "ends in .c"),
    ] {
        let refused = generate(more);
        assert_eq!(refused.status.code(), Some(2), "{more:?}");
        assert!(text(&refused.stderr).contains(words), "{}", text(&refused.stderr));
    }
}

#[test]
fn generate_for_a_gpu_writes_one_file_and_says_what_it_does_not_have() {
    for (language, end, name) in [("cuda", "cu", "CUDA"), ("wgsl", "wgsl", "WGSL")] {
        let source = file(&format!("gpu.{end}"), "");
        let generate = |more: &[&str]| {
            let given = ["generate", &arm(), "--language", language, "--functions", "gravity"];
            dyngen(&[&given[..], more].concat())
        };
        assert!(generate(&["-o", &source]).status.success());
        assert!(std::fs::read_to_string(&source).unwrap().contains("powerball_lwa4p_gravity_batch("));
        assert!(generate(&["-o", &source, "--check"]).status.success());
        let verified = dyngen(&["verify", &source, &arm()]);
        assert!(text(&verified.stdout).contains("proven: gravity_batch\n"), "{}", text(&verified.stderr));
        let friction = generate(&["-o", &source, "--check", "--friction", "viscous"]);
        let said = text(&friction.stderr);
        assert!(
            said.contains(if name == "CUDA" { "is stale" } else { "only in Rust, C and CUDA" }),
            "{said}"
        );
        for (more, words) in [
            (&["-o", &source, "--batch"][..], format!("only in Rust; leave it out for {name}")),
            (&["-o", &source, "--tests"], format!("only in Rust; leave it out for {name}")),
            (&["-o", "arm.c"], format!("arm.c: a file in {name} ends in .{end}\n")),
        ] {
            let refused = generate(more);
            assert_eq!(refused.status.code(), Some(2), "{more:?}");
            assert!(text(&refused.stderr).contains(&words), "{}", text(&refused.stderr));
        }
    }
}

#[test]
fn eval_gives_the_torque_of_the_regressor_and_takes_values_by_either_name() {
    let states = file(
        "states.csv",
        "q1,q2,q3,q4,q5,q6,dq1,dq2,dq3,dq4,dq5,dq6,ddq1,ddq2,ddq3,ddq4,ddq5,ddq6\n0.1,0.2,0.3,0.4,0.5,0.6,1,2,3,4,5,6,6,5,4,3,2,1\n-1,1,-1,1,-1,1,0,0,0,0,0,0,0,0,0,0,0,0\n",
    );
    let d = json(&dyngen(&["describe", &arm(), "--json"]));
    // Values of all parameters, and the sums that the minimal set makes of them.
    let names: Vec<&str> = d["parameters"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let value = |name: &str| 0.1 + names.iter().position(|n| *n == name).unwrap() as f64 / 7.0;
    let all: serde_json::Map<String, Value> =
        names.iter().map(|n| (n.to_string(), value(n).into())).collect();
    let sum = |p: &Value| -> f64 {
        let terms = p["terms"].as_array().unwrap().iter();
        terms.map(|t| t["value"].as_f64().unwrap() * value(t["parameter"].as_str().unwrap())).sum()
    };
    let minimal = d["sets"]["minimal"]["parameters"].as_array().unwrap();
    let sums: Vec<f64> = minimal.iter().map(sum).collect();
    let by_set: serde_json::Map<String, Value> = minimal
        .iter()
        .zip(&sums)
        .map(|(p, s)| (p["name"].as_str().unwrap().to_string(), (*s).into()))
        .collect();
    let all = file("all.json", &Value::Object(all).to_string());
    let by_set = file("set.json", &Value::Object(by_set).to_string());

    let table = |args: &[&str]| -> Vec<Vec<f64>> {
        let out = dyngen(args);
        assert!(out.status.success(), "{}", text(&out.stderr));
        text(&out.stdout)
            .lines()
            .skip(1)
            .map(|l| l.split(',').map(|x| x.parse().unwrap()).collect())
            .collect()
    };
    let eval = |function: &'static str, values: Option<&str>| {
        let arm = arm();
        let mut args = vec!["eval", &arm, "--function", function, "--states", &states];
        if let Some(values) = values {
            args.extend(["--values", values]);
        }
        table(&args)
    };
    let regressor = eval("regressor", None);
    assert_eq!((regressor.len(), regressor[0].len()), (2, 6 * 19));
    for values in [&all, &by_set] {
        let torques = eval("inverse_dynamics", Some(values));
        for (row, torque) in regressor.iter().zip(&torques) {
            for (i, tau) in torque.iter().enumerate() {
                let product: f64 = row[i * 19..(i + 1) * 19].iter().zip(&sums).map(|(y, p)| y * p).sum();
                assert!((product - tau).abs() < 1e-11 * (1.0 + tau.abs()), "{product} {tau}");
            }
        }
    }
    assert_eq!(eval("mass_matrix", Some(&all))[0].len(), 36);
    assert_eq!(eval("forward_kinematics", None)[1].len(), 16);
}

#[test]
fn check_finds_table_3_impossible_and_real_bodies_possible() {
    let table3 = workspace().join("powerball/table3.json").display().to_string();
    let out = dyngen(&["check", &arm(), "--values", &table3, "--json"]);
    assert_eq!(out.status.code(), Some(1));
    let verdict = json(&out);
    assert_eq!(verdict["possible"], false);
    assert!(verdict["min_eigenvalue"].as_f64().unwrap() < -2.5);
    assert_eq!(verdict["pose"].as_array().unwrap().len(), 6);
    assert!(verdict["reasons"][0].as_str().unwrap().contains("512 of 512"), "{verdict}");

    // A body for each link: point masses mirrored so that the symmetries hold; a rotor each.
    let d = json(&dyngen(&["describe", &arm(), "--json"]));
    let mut values = serde_json::Map::new();
    for name in d["parameters"].as_array().unwrap().iter().filter_map(Value::as_str) {
        let value = match &name[..name.len() - 1] {
            "m" => 2.0,
            "Ixx" | "Iyy" | "Izz" => 0.05,
            "Im" => 0.01,
            _ => 0.0,
        };
        values.insert(name.to_string(), value.into());
    }
    let good = file("bodies.json", &Value::Object(values.clone()).to_string());
    let out = dyngen(&["check", &arm(), "--values", &good, "--json"]);
    assert_eq!(
        (out.status.code(), &json(&out)["possible"]),
        (Some(0), &Value::Bool(true)),
        "{}",
        text(&out.stdout)
    );
    // The triangle inequality broken in a parameter that no torque shows.
    values.insert("Izz1".to_string(), 0.2.into());
    let bad = file("triangle.json", &Value::Object(values).to_string());
    let out = dyngen(&["check", &arm(), "--values", &bad]);
    assert_eq!(out.status.code(), Some(1));
    assert!(text(&out.stdout).contains("link 1: Izz"), "{}", text(&out.stdout));
}

#[test]
fn wrong_use_and_wrong_input_end_with_2_and_say_where() {
    let broken = file("broken.toml", "name = \"x\"\nconvention = \"dh\"\n");
    let no_column = file("no_column.csv", "q1,q2\n1,2\n");
    let nan = file("nan.csv", "q1,q2,q3,q4,q5,q6\n1,2,3,NaN,5,6\n");
    let seven = file("seven.csv", "q1,q2,q3,q4,q5,q6,q7\n1,2,3,4,5,6,7\n");
    let json = file("broken.json", "{\"m1\": ");
    let arm = arm();
    let cases: &[(&[&str], &[&str])] = &[
        (&["describe", "/nowhere.toml"], &["/nowhere.toml", "cannot be read"]),
        (&["describe", &broken], &["broken.toml:2:14", "convention", "gravity"]),
        (&["eval", &arm, "--function", "gravity", "--states", &no_column], &["--values"]),
        (
            &["eval", &arm, "--function", "forward_kinematics", "--states", &no_column],
            &["no column q3, q4, q5, q6"],
        ),
        (&["eval", &arm, "--function", "forward_kinematics", "--states", &nan], &["nan.csv:2", "q4"]),
        (
            &["eval", &arm, "--function", "forward_kinematics", "--states", &seven],
            &["seven.csv:1", "q7", "6 joints"],
        ),
        (&["eval", &arm, "--function", "flying", "--states", &nan], &["flying"]),
        (&["check", &arm, "--values", &json], &["broken.json:1:7"]),
        (&["check", &arm], &["--values"]),
        (&["fly"], &["fly"]),
    ];
    for (args, words) in cases {
        let out = dyngen(args);
        assert_eq!(out.status.code(), Some(2), "{args:?}: {}", text(&out.stderr));
        for word in *words {
            assert!(text(&out.stderr).contains(word), "{args:?}: '{word}' in {}", text(&out.stderr));
        }
    }
}

#[test]
fn inspect_shows_what_each_pass_leaves() {
    let out = dyngen(&["inspect", &arm(), "--function", "gravity", "--pass", "merge"]);
    assert!(out.status.success(), "{}", text(&out.stderr));
    let listing = text(&out.stdout);
    let cost = |pass: &str| -> Vec<usize> {
        let line = listing.lines().find(|l| l.starts_with(&format!("# after {pass}: "))).unwrap();
        line.split(|c: char| !c.is_ascii_digit()).filter_map(|n| n.parse().ok()).collect()
    };
    let (built, merged) = (cost("build"), cost("merge"));
    assert!(merged[0] <= built[0] && merged[1] <= built[1], "{listing}");
    // One line for each operation of the last graph but the sum of two angles, q2 − q3, and one for each
    // joint's torque that is not zero.
    assert_eq!(
        listing.lines().filter(|l| l.starts_with('x')).count(),
        merged.iter().sum::<usize>() - merged[3] - 1
    );
    assert_eq!(listing.lines().filter(|l| l.starts_with("result[")).count(), 4);
    let wrong = dyngen(&["inspect", &arm(), "--function", "gravity", "--pass", "magic"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(
        text(&wrong.stderr).contains("there are build, merge, associate, factor"),
        "{}",
        text(&wrong.stderr)
    );
}

#[test]
fn friction_terms_that_do_not_fit_are_refused() {
    let target = file("friction.rs", "untouched");
    let generate = |terms: &str| {
        dyngen(&["generate", &arm(), "-o", &target, "--functions", "gravity", "--friction", terms, "--force"])
    };
    for (terms, code, reason) in [
        ("sticky", 2, "there are viscous, coulomb and tanh:SHAPE"),
        ("tanh:fast", 2, "'fast' is no number"),
        ("tanh:1:2", 1, "2 shapes for 6 joints"),
        ("viscous,tanh:-3", 1, "the shape -3 is not greater than zero"),
    ] {
        let out = generate(terms);
        assert_eq!(out.status.code(), Some(code), "{terms}: {}", text(&out.stderr));
        assert!(text(&out.stderr).contains(reason), "{terms}: {}", text(&out.stderr));
        assert_eq!(std::fs::read_to_string(&target).unwrap(), "untouched");
    }
    // What dyngen has not generated is not written over.
    let out = dyngen(&["generate", &arm(), "-o", &target, "--functions", "gravity"]);
    assert_eq!(out.status.code(), Some(2));
    assert!(text(&out.stderr).contains("--force"), "{}", text(&out.stderr));
    assert_eq!(std::fs::read_to_string(&target).unwrap(), "untouched");
    assert!(generate("viscous,coulomb,tanh:216").status.success());
    let source = std::fs::read_to_string(&target).unwrap();
    assert!(source.contains("pub fn friction_columns<") && source.contains("FRICTION_TERMS: usize = 3"));
}

/// Against the definition: a parameter that is declared zero is let in again, and the rank says what it was
/// worth.
#[test]
fn describe_says_what_each_symmetry_removed() {
    let rank = |path: &str| {
        json(&dyngen(&["describe", path, "--json"]))["sets"]["minimal"]["rank"].as_u64().unwrap()
    };
    let toml = std::fs::read_to_string(arm()).unwrap();
    let described = json(&dyngen(&["describe", &arm(), "--json"]));
    let symmetries = described["symmetries"].as_array().unwrap();
    assert_eq!(symmetries.len(), 22);
    let grouping = toml.find("[[grouping]]").unwrap();
    for (symmetry, zero, left) in [
        ("mx1", "[\"mx\", \"mz\", \"Ixy\", \"Ixz\", \"Iyz\"]", "[\"mz\", \"Ixy\", \"Ixz\", \"Iyz\"]"),
        ("my2", "[\"my\", \"Ixy\", \"Iyz\"]", "[\"Ixy\", \"Iyz\"]"),
    ] {
        assert!(toml.contains(zero));
        let path = file(&format!("without_{symmetry}.toml"), &toml[..grouping].replacen(zero, left, 1));
        let removed =
            symmetries.iter().find(|s| s["parameter"] == symmetry).unwrap()["removed"].as_str().unwrap();
        let expected = if removed == "base parameter" { 20 } else { 19 };
        assert_eq!(rank(&path), expected, "{symmetry}: {removed}");
    }
}

/// What `powerball explain` writes in addition to values is no parameter of the rigid arm; a list without
/// names is refused.
#[test]
fn a_model_is_a_file_of_values() {
    let model = dyngen::Model::derive(dyngen::Arm::read(Path::new(&arm())).unwrap()).unwrap();
    let set = model.set(dyngen::SetKind::Minimal).unwrap();
    let list: Vec<Value> =
        set.names().iter().map(|n| serde_json::json!({ "name": n, "value": 0.125 })).collect();
    let text = serde_json::json!({ "arm": "x", "parameters": list, "terms": [], "friction": [] }).to_string();
    let read = dyngen::Values::parse(&text, "model.json").unwrap().of_set(&model, set).unwrap();
    assert_eq!(read, vec![0.125; set.parameters.len()]);
    let wrong = dyngen::Values::parse(r#"{"parameters": [{"value": 1.0}]}"#, "model.json").unwrap_err();
    assert!(wrong.to_string().contains("an entry without a name"), "{wrong}");
}

/// Of several notes of one kind two are shown, and all where all are asked for.
#[test]
fn notes_of_an_import_are_few_unless_all_are_wanted() {
    let rounded = include_str!("urdf/puma.urdf").replace("1.5707963267948966", "1.5708");
    let (urdf, arm) = (file("rounded.urdf", &rounded), file("rounded.toml", ""));
    let notes = |extra: &[&str]| {
        let out = dyngen(&[&["import", &urdf, "-o", &arm, "--force"], extra].concat());
        text(&out.stderr).matches("taken as meant: joint ").count()
    };
    assert!(notes(&["--verbose"]) >= 4);
    assert_eq!(notes(&[]), 2);
}

/// Files are replaced only on purpose, and the original never; a result that is no number ends with an error.
#[test]
fn nothing_is_lost_and_no_nan_is_printed() {
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("force");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    let path = |name: &str| folder.join(name).display().to_string();
    let (urdf, arm, values) = (path("one.urdf"), path("one.toml"), path("one.values.json"));
    let text = "<robot name=\"one\"><link name=\"base\"/><link name=\"l\"/><joint name=\"j\" \
                type=\"continuous\"><parent link=\"base\"/><child link=\"l\"/></joint></robot>";
    std::fs::write(&urdf, text).unwrap();
    let import = |extra: &[&str]| dyngen(&[&["import", &urdf, "-o", &arm], extra].concat());
    let no_tip = import(&["--tip", "nowhere"]);
    assert_eq!(no_tip.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&no_tip.stderr).contains("'nowhere'"));
    assert!(import(&[]).status.success());
    assert!(!folder.join("one.values.json").exists(), "no inertia, no values");
    std::fs::write(&arm, format!("{}# mine\n", std::fs::read_to_string(&arm).unwrap())).unwrap();
    let again = import(&[]);
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("--force"));
    assert!(std::fs::read_to_string(&arm).unwrap().contains("# mine"));
    assert!(import(&["--force"]).status.success());
    assert!(!std::fs::read_to_string(&arm).unwrap().contains("# mine"));
    assert_eq!(dyngen(&["import", &urdf, "-o", &urdf, "--force"]).status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(&urdf).unwrap(), text);

    std::fs::write(&values, "{\"mx1\": 0, \"my1\": 0, \"Izz1\": 0}").unwrap();
    let states = path("states.csv");
    std::fs::write(&states, "q1,dq1,tau1\n0.1,0,1\n").unwrap();
    let eval = ["eval", &arm, "--function", "forward_dynamics", "--states", &states, "--values", &values];
    let eval = dyngen(&eval);
    let message = String::from_utf8_lossy(&eval.stderr).to_string();
    assert_eq!((eval.status.code(), eval.stdout.len()), (Some(1), 0), "{message}");
    assert!(message.contains("states.csv:2") && message.contains("singular"), "{message}");
}

/// What need not end is no input: it is refused before it is opened, which of a pipe without a writer never
/// returns.
#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused() {
    let pipe = Path::new(env!("CARGO_TARGET_TMPDIR")).join("pipe");
    let _ = std::fs::remove_file(&pipe);
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let pipe = pipe.display().to_string();
    let out = file("never.toml", "");
    for input in [pipe.as_str(), "/dev/zero"] {
        let values = ["describe", &arm(), "--values", input];
        let states = ["eval", &arm(), "--function", "forward_kinematics", "--states", input];
        for command in [&["describe", input][..], &values, &states, &["import", input, "-o", &out, "--force"]]
        {
            let done = dyngen(command);
            let said = text(&done.stderr);
            assert_eq!(done.status.code(), Some(2), "{command:?}: {said}");
            assert!(said.contains(input) && said.contains("it is a pipe or a device"), "{command:?}: {said}");
        }
    }
}

/// A rod of negative inertia is generated, with a warning that says why and what to take; units that no arm
/// has end with 3.
#[test]
fn what_no_arm_can_have_is_said() {
    let rod = |a: &str, gravity: &str| {
        format!(
            "name = \"rod\"\nconvention = \"standard\"\ngravity = [0, {gravity}, 0]\n[[joint]]\n\
            kind = \"revolute\"\na = {a}\nalpha = 0\nd = 0\ntheta = 0\n"
        )
    };
    let arm = file("rod.toml", &rod("0.5", "-9.81"));
    let values = |izz: f64| {
        let zero =
            ["mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz"].map(|name| format!("\"{name}1\": 0, "));
        file("rod.json", &format!("{{{}\"m1\": 1, \"Izz1\": {izz}}}", zero.concat()))
    };
    let generate = |arm: &str, values: &str, more: &[&str]| {
        let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rod.rs").display().to_string();
        dyngen(
            &[&["generate", arm, "-o", &out, "--functions", "gravity", "--force", "--values", values], more]
                .concat(),
        )
    };
    // 1 kg at 0.5 m has 0.25 kg·m² about the axis.
    let bad = generate(&arm, &values(-0.9), &[]);
    assert_eq!(bad.status.code(), Some(0));
    let said = text(&bad.stderr);
    assert!(said.starts_with("warning: ") && said.contains("B(q) is not positive definite"), "{said}");
    assert!(said.contains("consistent.json"), "{said}");
    for (a, gravity, reason) in
        [("500", "-9.81", "give a, b and d in metres"), ("0.5", "-9810", "give it in m/s²")]
    {
        let arm = file("rod_in_mm.toml", &rod(a, gravity));
        let done = generate(&arm, &values(0.1), &[]);
        assert_eq!(done.status.code(), Some(3), "{}", text(&done.stderr));
        assert!(text(&done.stderr).lines().next().unwrap().contains(reason), "{}", text(&done.stderr));
        assert_eq!(generate(&arm, &values(0.1), &["--accept"]).status.code(), Some(0));
        assert_eq!(dyngen(&["describe", &arm]).status.code(), Some(3));
    }
}

#[test]
fn help_lists_every_function_and_generate_says_what_it_wrote() {
    for command in ["eval", "generate"] {
        let help = text(&dyngen(&[command, "--help"]).stdout);
        for function in dyngen::Function::ALL {
            let line = help.lines().find(|line| line.trim_start().starts_with(&format!("{function} ")));
            assert!(line.is_some_and(|line| line.contains(function.meaning().0)), "{command}: {function}");
        }
    }
    let out = file("said.rs", "");
    let generate = |more: &[&str]| {
        let given = ["generate", &arm(), "-o", &out, "--functions", "gravity,jacobian"];
        text(&dyngen(&[&given[..], more].concat()).stderr)
    };
    let said = generate(&[]);
    assert!(said.lines().count() == 1 && said.contains("said.rs") && said.contains("2 of them"), "{said}");
    assert_eq!(generate(&["--quiet"]), "");
}
