//! The sources of an FMU compiled and run: its laws against the controller's, its motion against the
//! simulation's.

use super::*;
use crate::simulate::simulate_with;
use crate::torque_model::tests::every_law;
use crate::torque_model::{ModelFile, NamedTerm};
use chacha20::ChaCha8Rng;
use powerball_controller::correction::{Instant, Memory, Term};
use powerball_identification::estimate::JointFriction;
use powerball_logs::motion::Motion;
use powerball_logs::regression::RigidArm;
use rand::{RngExt, SeedableRng};
use std::path::PathBuf;
use std::process::Command;

/// Compiles the sources of an FMU with a program and gives the numbers that it prints; none where there is no
/// compiler, which `REQUIRE_CC` makes a must.
fn run(fmu: &Fmu, main: &str, sources: &[&str], name: &str) -> Option<Vec<f64>> {
    if !Command::new("cc").arg("--version").output().is_ok_and(|o| o.status.success()) {
        assert!(std::env::var_os("REQUIRE_CC").is_none(), "there is no cc");
        return None;
    }
    let folder: PathBuf = std::env::temp_dir().join(format!("powerball_fmu_{name}_{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for (file, text) in fmu.files.iter().filter_map(|(f, t)| Some((f.strip_prefix(Fmu::SOURCES)?, t))) {
        std::fs::write(folder.join(file), text).unwrap();
    }
    std::fs::write(folder.join("main.c"), main).unwrap();
    let mut compiler = Command::new("cc");
    compiler.current_dir(&folder).args([
        "-std=c99",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-Wno-unused-parameter",
    ]);
    let done = compiler.args(["-o", "main", "main.c"]).args(sources).arg("-lm").output().unwrap();
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let printed = Command::new(folder.join("main")).output().unwrap();
    assert!(printed.status.success());
    std::fs::remove_dir_all(&folder).unwrap();
    let text = String::from_utf8(printed.stdout).unwrap();
    Some(text.split_whitespace().map(|number| number.parse().unwrap()).collect())
}

/// Two joints across each other, the second one prismatic where it is asked for.
fn arm(kind: &str) -> Arm {
    let text = format!(
        "name = \"two <b>\"\nconvention = \"standard\"\ngravity = [0, 0, -9.81]\n\
         [[joint]]\nkind = \"revolute\"\na = 0.3\nalpha = \"pi/2\"\nd = 0.1\ntheta = 0\nname = \"shoulder\"\n\
         [[joint]]\nkind = \"{kind}\"\na = 0.2\nalpha = 0.4\nd = 0\ntheta = 0.3\nname = \"fore_arm\"\n"
    );
    Arm::parse(&text, "two.toml").unwrap()
}

fn model(arm: &Arm, laws: &[(usize, f64, Law<f64>)]) -> TorqueModel {
    let body = RigidArm::new(arm).unwrap();
    let of_link = [2.0, -0.2, 0.06, 0.04, 0.05, 0.01, -0.005, 0.08, 0.004, 0.07, 0.0];
    let all: Vec<f64> = of_link.iter().chain(&of_link).copied().collect();
    let values = body.model().set_values(body.model().set(SetKind::Minimal).unwrap(), &all);
    let parameters: Vec<_> = (body.names().iter().zip(values))
        .map(|(name, value)| serde_json::json!({"name": name, "value": value}))
        .collect();
    let mut model: TorqueModel =
        serde_json::from_value(serde_json::json!({"parameters": parameters, "friction": []})).unwrap();
    model.friction = vec![
        JointFriction::plain(0, [0.8, 60.0, 0.3, 4.0, 0.9]),
        JointFriction::plain(1, [0.3, 90.0, 0.1, 5.0, 0.4]),
    ];
    let term = |(joint, coefficient, law): &(usize, f64, Law<f64>)| NamedTerm {
        effect: "an effect */".to_string(),
        std: None,
        term: Term { joint: *joint, coefficient: *coefficient, law: *law },
    };
    model.additions.terms = laws.iter().map(term).collect();
    model
}

/// Each law along a path of random steps, in C and in Rust.
#[test]
fn laws_in_c_are_those_of_the_controller() {
    let laws: Vec<Law<f64>> = every_law();
    // Joints that laws name are four.
    let terms: Vec<NamedTerm> = (laws.iter())
        .map(|law| NamedTerm {
            effect: "e".to_string(),
            std: None,
            term: Term { joint: 1, coefficient: 1.0, law: *law },
        })
        .collect();
    const JOINTS: usize = 4;
    let mut text =
        String::from("#include <stdio.h>\n#include <math.h>\n#define ARM_JOINTS 4\n#include \"motion.h\"\n");
    for (k, term) in terms.iter().enumerate() {
        let mut function = String::new();
        // A memory of its own is behind each function.
        terms::effects(&mut function, std::slice::from_ref(term)).unwrap();
        text += &function.replace("void model_effects", &format!("static void law_{k}"));
    }
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let samples = 60;
    let mut draw =
        |size: f64| -> Vec<f64> { (0..JOINTS).map(|_| size * rng.random_range(-1.0..1.0)).collect() };
    let mut q = vec![0.0; JOINTS];
    let states: Vec<[Vec<f64>; 5]> = (0..samples)
        .map(|_| {
            // About as far as a play or a presliding distance.
            q = q.iter().zip(draw(0.002)).map(|(q, step)| q + step).collect();
            [q.clone(), draw(0.1), draw(2.0), draw(20.0), draw(5.0)]
        })
        .collect();
    let row =
        |x: &Vec<f64>| format!("{{ {} }}", x.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(", "));
    let rows: Vec<String> = states
        .iter()
        .map(|s| format!("{{ {} }}", s.iter().map(row).collect::<Vec<_>>().join(", ")))
        .collect();
    text += &format!("static const double states[{samples}][5][4] = {{ {} }};\n", rows.join(",\n"));
    text += &format!("static struct memory memory[{}];\nint main(void) {{\n", laws.len());
    text += &format!("    for (int s = 0; s < {samples}; s++) {{\n");
    text += "        const struct instant now = { states[s][0], states[s][1], states[s][2], states[s][3], \
             states[s][4], 0.01 * s };\n";
    for k in 0..laws.len() {
        text += &format!(
            "        {{ double t[4] = {{ 0.0 }}; law_{k}(&now, &memory[{k}], t); printf(\"%.17g\\n\", t[1]); \
            }}\n"
        );
    }
    text += "    }\n    return 0;\n}\n";
    let mut fmu = model(&arm("revolute"), &[]).fmu(&arm("revolute"), "a test").unwrap();
    // The header of the arm is not needed, and has another number of joints.
    fmu.files.iter_mut().filter(|(name, _)| name.ends_with("/arm.h")).for_each(|(_, text)| {
        *text = "#define ARM_JOINTS 4\n".to_string();
    });
    let text = text.replace("#define ARM_JOINTS 4\n#include", "#include");
    let Some(found) = run(&fmu, &text, &["laws.c"], "laws") else { return };
    let mut memory = vec![Memory::default(); laws.len()];
    let mut moved = vec![false; laws.len()];
    for (s, [q, dq, ddq, rigid, friction]) in states.iter().enumerate() {
        let now = Instant { q, dq, ddq, rigid, friction, temperature: &[], running: 0.01 * s as f64 };
        for (k, law) in laws.iter().enumerate() {
            let expected = law.value(1, &now, &mut memory[k]);
            approx::assert_relative_eq!(
                found[s * laws.len() + k],
                expected,
                epsilon = 1e-13,
                max_relative = 1e-13
            );
            moved[k] |= expected != 0.0;
        }
    }
    let silent = moved.iter().filter(|moved| !**moved).count();
    assert_eq!(silent, 4, "all but temperatures, and links that give way");
}

/// Torques that change each cycle: the FMU goes where the simulation goes, whose steps it takes.
#[test]
fn the_fmu_moves_as_the_simulation() {
    for kind in ["revolute", "prismatic"] {
        let arm = arm(kind);
        let laws = [
            (0, 0.4, Law::Stribeck { steepness: 60.0, velocity: 0.1 }),
            (1, 0.2, Law::Presliding { distance: 0.01 }),
            (0, 0.1, Law::Cosine { order: 3.0 }),
            (1, 0.05, Law::Load { steepness: 90.0 }),
            (0, 0.02, Law::OtherAcceleration { other: 1 }),
            (1, -0.3, Law::CoolFriction { time_constant: 0.5 }),
        ];
        let mut model = model(&arm, &laws);
        model.additions.log_changes.encoder_offset = vec![0.02, -0.01];
        let (cycles, period) = (400, 0.002);
        let torque = |k: usize, j: usize| {
            let t = period * k as f64;
            [9.0 * (3.0 * t).sin() + 4.0, 5.0 * (7.0 * t).cos()][j]
        };
        let mut path = Motion::new(2, period);
        (0..cycles).for_each(|_| path.push([[0.3, 0.0, 0.0], [-0.2, 0.0, 0.0]]));
        let file = ModelFile { model: model.clone(), file: "model.json".into() };
        let moved = simulate_with(&arm, &file, &path, |cycle| {
            let k = (cycle.t / period).round() as usize;
            Ok::<_, std::convert::Infallible>(vec![torque(k, 0), torque(k, 1)])
        })
        .unwrap();
        let fmu = model.fmu(&arm, "a test").unwrap();
        let main = "#include \"fmi3.c\"\n#include <stdio.h>\n#include <math.h>\nint main(void) {
    void *arm = fmi3InstantiateCoSimulation(\"a\", model_token, \"\", 0, 0, 0, 0, 0, 0, 0, 0, 0);
    const fmi3ValueReference in[] = { 2, 3 }, out[] = { 4, 5, 6, 7 };
    const double at[] = { 0.3, -0.2 };
    bool b; double x[4], last;
    if (fmi3InstantiateCoSimulation(\"a\", \"other\", \"\", 0, 0, 0, 0, 0, 0, 0, 0, 0)) return 1;
    if (fmi3SetFloat64(arm, out, 2, at, 2) || fmi3EnterInitializationMode(arm, 0, 0, 0, 0, 0)) return 2;
    if (fmi3ExitInitializationMode(arm) || !fmi3SetFloat64(arm, out, 2, at, 2)) return 3;
    for (int k = 0; k < CYCLES; k++) {
        const double t = 0.002 * k, tau[] = { 9.0 * sin(3.0 * t) + 4.0, 5.0 * cos(7.0 * t) };
        fmi3GetFloat64(arm, out, 4, x, 4);
        printf(\"%.17g %.17g %.17g %.17g\\n\", x[0], x[1], x[2], x[3]);
        if (fmi3SetFloat64(arm, in, 2, tau, 2) || fmi3DoStep(arm, t, 0.002, 1, &b, &b, &b, &last)) return 4;
    }
    fmi3FreeInstance(arm);
    return 0;
}
";
        let main = main.replace("CYCLES", &cycles.to_string());
        let sources = ["arm.c", "model.c", "motion.c", "laws.c"];
        let Some(found) = run(&fmu, &main, &sources, kind) else { return };
        let expected: Vec<f64> = moved
            .q
            .chunks(2)
            .zip(moved.dq.chunks(2))
            .flat_map(|(q, dq)| [q[0], q[1], dq[0], dq[1]])
            .collect();
        assert_eq!(found.len(), expected.len());
        let far = expected.iter().fold(0.0f64, |far, x| far.max(x.abs()));
        assert!(far > 1.0, "it moves: {far}");
        for (found, expected) in found.iter().zip(&expected) {
            approx::assert_relative_eq!(*found, *expected, epsilon = 1e-9, max_relative = 1e-9);
        }
    }
}

#[test]
fn what_an_fmu_cannot_hold_is_said() {
    let arm = arm("revolute");
    let mut model =
        model(&arm, &[(0, 1e-4, Law::Compliance), (1, 0.1, Law::HotVelocity { reference: 20.0 })]);
    model.additions.log_changes.delay = vec![0.004, 0.0];
    let fmu = model.fmu(&arm, "powerball \"x\"").unwrap();
    let notes = fmu.notes.join("\n");
    for word in ["links do not give way", "temperature of the joint", "4.00 ms late"] {
        assert!(notes.contains(word), "{notes}");
    }
    assert_eq!(fmu.identifier, "two__b_");
    let description = &fmu.files[0].1;
    assert!(description.contains("name=\"tau.shoulder\" valueReference=\"2\""), "{description}");
    assert!(
        description.contains("modelName=\"two &lt;b>\"") && description.contains("powerball &quot;x&quot;")
    );
}
