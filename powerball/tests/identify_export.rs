//! What was found goes where it is used: `powerball identify --export` into the URDF that the arm came from,
//! `powerball export` into the words of a robot's controller, or of a simulator.

#![allow(clippy::unwrap_used)]

use chacha20::ChaCha8Rng;
use dyngen::import::{self, Options};
use dyngen::{Arm, Model, SetKind, Values};
use powerball::controller::friction::TanhFriction;
use powerball::identification::chain::Chain;
use powerball::identification::excite::{Fourier, Harmonics};
use powerball::virtual_arm::{Body, Dynamics, Plant, Sensors};
use rand::{RngExt, SeedableRng};
use std::f64::consts::TAU;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Two joints across each other; the bodies are guesses, as in the files that makers give.
const URDF: &str = r#"<?xml version="1.0"?>
<robot name="two">
  <!-- kept as it is -->
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 0.1"/><mass value="1"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.2" rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.3 0 0" rpy="1.5707963267948966 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-2" upper="2" effort="50" velocity="3"/></joint>
</robot>
"#;

const FRICTION: [[f64; 5]; 2] = [[1.0, 20.0, 0.0, 1.0, 0.8], [0.5, 30.0, 0.0, 1.0, 0.3]];

fn plant(arm: &Arm) -> Plant {
    let bodies = vec![
        Body::even_box(2.0, [0.12, 0.03, -0.02], [0.3, 0.1, 0.1], 0.0),
        Body::even_box(1.2, [0.02, 0.10, 0.05], [0.1, 0.2, 0.1], 0.0),
    ];
    let sensors = Sensors {
        rate: 200.0,
        encoder_step: 1e-5,
        white: vec![0.02; 2],
        coloured: vec![0.0; 2],
        colour_time: 0.1,
    };
    let friction = FRICTION.map(TanhFriction::new).to_vec();
    Plant::new(Dynamics::new(Chain::new(arm), bodies).unwrap(), friction, sensors)
}

fn record(plant: &Plant, seed: u64, file: &Path) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = || -> Vec<f64> { (0..5).map(|_| 0.25 * rng.random_range(-1.0..1.0)).collect() };
    let joints = (0..2).map(|_| Harmonics { middle: 0.0, a: draw(), b: draw() }).collect();
    let path = Fourier { fundamental: TAU / 10.0, periods: 2, ramp: 1.0, joints };
    plant.record(&path.sample(200.0), 0.0, seed).write(file).unwrap();
}

/// A folder with the robot, its arm file and three logs.
fn session(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let imported = import::urdf(URDF, "two.urdf", &Options::default()).unwrap();
    fs::write(folder.join("two.urdf"), URDF).unwrap();
    fs::write(folder.join("arm.toml"), &imported.text).unwrap();
    let plant = plant(&imported.arm);
    (0..3).for_each(|k| record(&plant, k, &folder.join(format!("log{k}.csv"))));
    folder
}

fn identify(folder: &Path, out: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
    command
        .current_dir(folder)
        .args(["identify", "--arm", "arm.toml", "--log", "log0.csv", "log1.csv", "log2.csv"]);
    command.args(["--export", "two.urdf", "--json", "--out", out]).output().unwrap()
}

#[test]
fn what_was_identified_is_in_a_copy_of_the_urdf() {
    let folder = session("export");
    let done = identify(&folder, "result");
    // Standard output is the result alone, whatever is to be reported about the export.
    let printed: serde_json::Value = serde_json::from_slice(&done.stdout).unwrap();
    assert!(printed["friction"][1]["coulomb_std"].as_f64().is_some_and(|std| std > 0.0));
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert_eq!(printed["arm_file"], "arm.toml");
    let text = fs::read_to_string(folder.join("result/two.urdf")).unwrap();
    assert!(text.contains("<!-- kept as it is -->"));
    assert_eq!(fs::read_to_string(folder.join("two.urdf")).unwrap(), URDF);

    // The bodies of the copy are those of the result, and in what an arm's torque depends on those that were
    // recorded.
    let back = import::urdf(&text, "two.urdf", &Options::default()).unwrap();
    let named =
        |values: &[(String, f64)]| Values::named(values.iter().map(|(n, v)| (n.as_str(), *v)), "values");
    let given: Vec<_> = back.values.iter().map(|(p, value)| (p.to_string(), *value)).collect();
    let consistent = Values::read(&folder.join("result/consistent.json")).unwrap();
    let bodies =
        plant(&back.arm).dynamics().bodies().iter().map(Body::parameters).collect::<Vec<_>>().concat();
    let names = back.arm.kept_parameters();
    let truth: Vec<_> = names.iter().map(|p| (p.to_string(), bodies[p.index()])).collect();
    let model = Model::derive(back.arm).unwrap();
    let minimal = |values: &Values| values.of_set(&model, model.set(SetKind::Minimal).unwrap()).unwrap();
    for ((value, written), truth) in
        minimal(&named(&given)).into_iter().zip(minimal(&consistent)).zip(minimal(&named(&truth)))
    {
        approx::assert_relative_eq!(value, written, max_relative = 1e-9, epsilon = 1e-12);
        approx::assert_relative_eq!(value, truth, max_relative = 0.05, epsilon = 2e-3);
    }
    // The errors of its Coulomb friction are those of the sum of both terms, of which neither is known by
    // itself.
    let errors = text.split("friction ").skip(1).filter_map(|rest| rest.split(' ').next());
    let errors: Vec<f64> = errors.filter_map(|error| error.parse().ok()).collect();
    assert!(errors.len() == 2 && errors.iter().all(|error| (1e-4..0.02).contains(error)), "{text}");
    for [coulomb, _, _, _, viscous] in FRICTION {
        let near = |key: &str, wanted: f64| {
            let key = format!("{key}=\"");
            let values = text.split(&key).skip(1).filter_map(|rest| rest.split('"').next());
            values.filter_map(|v| v.parse::<f64>().ok()).any(|v| (v / wanted - 1.0).abs() < 0.05)
        };
        assert!(near("friction", coulomb) && near("damping", viscous), "{text}");
    }
}

#[test]
fn the_original_is_never_written_over() {
    let folder = session("export_over");
    let refused = identify(&folder, ".");
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--export would write over it"));
    assert_eq!(fs::read_to_string(folder.join("two.urdf")).unwrap(), URDF);
    assert!(!folder.join("identified.json").exists());
}

/// A file of the command's own is written anew, one of somebody else is not, and what holds no load is
/// refused.
#[test]
fn a_load_is_exported_for_each_controller() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("export_load");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let explained = |mass: f64| {
        format!(
            r#"{{"effects": [{{"effect": "payload", "joints": [6], "relative_std": [0.01],
              "parameters": {{"mass": {mass}, "com": [0, 0, 0], "com_in_link": [0.01, 0.02, 0.03], "start_time": [0]}}}}]}}"#
        )
    };
    let export = |arguments: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
        command.current_dir(&folder).arg("export").args(arguments.split_whitespace()).output().unwrap()
    };
    let code = |output: &Output| output.status.code().unwrap();
    for mass in [1.5, 2.5] {
        fs::write(folder.join("explained.json"), explained(mass)).unwrap();
        for form in ["franka", "ur", "kuka", "kinova", "doosan", "xarm"] {
            let done = export(&format!("--for {form} explained.json -o load.{form}"));
            assert_eq!(code(&done), 0, "{form}: {}", String::from_utf8_lossy(&done.stderr));
            assert!(String::from_utf8_lossy(&done.stdout).contains("inertia"), "{form}");
            let text = fs::read_to_string(folder.join(format!("load.{form}"))).unwrap();
            assert!(text.contains(&mass.to_string()), "{form}: {text}");
        }
    }
    fs::write(folder.join("mine.script"), "set_payload(3)\n").unwrap();
    assert_eq!(code(&export("--for ur explained.json -o mine.script")), 2);
    assert_eq!(code(&export("--for ur explained.json -o mine.script --force")), 0);
    fs::write(folder.join("none.json"), r#"{"effects": []}"#).unwrap();
    let none = export("--for ur none.json -o none.script");
    assert!(String::from_utf8_lossy(&none.stderr).contains("none.json: no payload was found"));
    assert_eq!((code(&none), folder.join("none.script").exists()), (1, false));
    assert_eq!(code(&export("--for ur missing.json -o none.script")), 2);
    assert_eq!(code(&export("--for abb explained.json -o none.script")), 2);
}

/// identified.json of the arm of the URDF with its own bodies, where `scale` is 1.
fn identified(arm: &Arm, values: &[(dyngen::arm::Parameter, f64)], scale: f64) -> serde_json::Value {
    let model = Model::derive(arm.clone()).unwrap();
    let mut all = vec![0.0; arm.all_parameters().len()];
    values.iter().for_each(|(parameter, value)| all[parameter.index()] = *value);
    let set = model.set(SetKind::Minimal).unwrap();
    let minimal = set.names().into_iter().zip(model.set_values(set, &all));
    let minimal: Vec<_> =
        minimal.map(|(name, value)| serde_json::json!({"name": name, "value": scale * value})).collect();
    let friction = FRICTION.iter().enumerate().map(|(j, [g1, g2, g3, g4, g5])| {
        serde_json::json!({"joint": j + 1, "gamma1": g1, "gamma2": g2, "gamma3": g3, "gamma4": g4, "gamma5": g5})
    });
    let bodies: serde_json::Map<_, _> =
        values.iter().map(|(parameter, value)| (parameter.to_string(), (*value).into())).collect();
    serde_json::json!({"arm": arm.name, "set": "minimal", "parameters": minimal,
        "friction": friction.collect::<Vec<_>>(), "consistent": {"parameters": bodies}})
}

/// Each form has the arm's bodies and friction, and lists what it lacks; errors name what is missing or not
/// supported.
#[test]
fn an_arm_is_exported_for_each_simulator() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("export_arm");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let import::Imported { arm, values, text, .. } =
        import::urdf(URDF, "two.urdf", &Options::default()).unwrap();
    fs::write(folder.join("arm.toml"), &text).unwrap();
    let mut result = identified(&arm, &values, 1.0);
    let put = |name: &str, json: &serde_json::Value| fs::write(folder.join(name), json.to_string()).unwrap();
    put("identified.json", &result);
    let export = |arguments: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_powerball"));
        command.current_dir(&folder).arg("export").args(arguments.split_whitespace()).output().unwrap()
    };
    let refused = |arguments: &str, code: i32, reason: &str| {
        let done = export(arguments);
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert!(done.status.code() == Some(code) && said.contains(reason), "{arguments}: {said}");
    };
    let notes = |arguments: &str| {
        let done = export(arguments);
        assert!(done.status.success(), "{arguments}: {}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8_lossy(&done.stdout).into_owned()
    };
    let read = |name: &str| String::from_utf8_lossy(&fs::read(folder.join(name)).unwrap()).into_owned();

    for (form, masses, friction) in [
        ("sdf", "<mass>1.0</mass>", "<friction>0.5</friction>"),
        ("usd", "float physics:mass = 1.0", "dynamicFrictionEffort = 0.5"),
    ] {
        // Twice: a file of the command's own is written anew.
        for _ in 0..2 {
            notes(&format!("--for {form} --arm arm.toml identified.json -o arm.{form}"));
        }
        let text = read(&format!("arm.{form}"));
        // In USD the base has a mass too.
        assert!(text.matches(masses).count() >= 2 && text.contains(friction), "{text}");
    }
    // The result of a command names its arm file; else it is arm.toml next to the result.
    let mut named = result.clone();
    named["arm_file"] = "arm.toml".into();
    fs::create_dir_all(folder.join("apart")).unwrap();
    for (name, json) in [("identified.json", &result), ("apart/named.json", &named)] {
        put(name, json);
        notes(&format!("--for sdf {name} -o named.sdf"));
        assert_eq!(read("named.sdf"), read("arm.sdf"));
    }
    put("apart/nameless.json", &result);
    refused("--for sdf apart/nameless.json -o nameless.sdf", 2, "--arm ARM.toml");
    fs::write(folder.join("mine.sdf"), "<sdf/>\n").unwrap();
    refused("--for sdf --arm arm.toml identified.json -o mine.sdf", 2, "--force");
    put("comparison.json", &serde_json::json!({"differ": true, "causes": []}));
    refused("--for sdf --arm arm.toml comparison.json -o other.sdf", 1, "compares two results");
    put("explained.json", &serde_json::json!({"effects": []}));
    refused("--for usd --arm arm.toml explained.json -o other.usda", 2, "model.json");

    // With its model next to it; its effects are left out with a note, or are in the FMU.
    result["consistent"] = serde_json::Value::Null;
    result["terms"] =
        serde_json::json!([{"effect": "spring", "joint": 2, "coefficient": 0.5, "law": "position"}]);
    put("model.json", &result);
    let said = notes("--for sdf --arm arm.toml explained.json -o explained.sdf");
    assert!(said.contains("'elbow': spring") && read("explained.sdf").contains("spring"), "{said}");
    notes("--for fmu --arm arm.toml explained.json -o arm.fmu");
    let fmu = read("arm.fmu");
    assert!(fmu.contains("name=\"tau.elbow\"") && fmu.contains("torque[1] += 0.5 * (q[1]);"));
    assert_eq!(fmu.contains("binaries/"), Command::new("cc").arg("--version").output().is_ok() && cfg!(unix));

    // Less than no mass is none of a real arm: what is nearest is taken, and said to be.
    let mut impossible = identified(&arm, &values, -1.0);
    impossible["consistent"] = result["consistent"].clone();
    put("model.json", &impossible);
    let said = notes("--for fmu --arm arm.toml model.json -o arm.fmu");
    assert!(said.contains("no real arm can have the fitted values"), "{said}");
}
