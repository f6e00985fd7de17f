//! Generated CUDA and WGSL: what is written, what `dyngen verify` proves of it, and that no change of it
//! passes. What compilers and devices make of the text is tested by `.ci/gpu`.

#![allow(clippy::unwrap_used, clippy::panic, clippy::indexing_slicing)]

use chacha20::ChaCha8Rng;
use dyngen::verify::Verifier;
use dyngen::{Arm, Config, Function, Language};
use rand::{RngExt, SeedableRng};
use std::path::{Path, PathBuf};

/// Joints that slide and follow others, names, an angle in radians, and a frame whose name begins as a
/// function's.
const CRANE: &str = r#"
name = "Crane 5"
convention = "standard"
gravity = [1, 0.5, -9]
joint = [
    { name = "lift", kind = "prismatic", a = 0, alpha = "pi/2", d = 0.1, theta = 0 },
    { kind = "prismatic", a = 0.1, alpha = "-pi/2", d = 0.2, theta = "pi/2", mimic = { joint = 1, ratio = "3/2", offset = -0.05 } },
    { kind = "revolute", a = 0.15, alpha = 0, d = 0.05, theta = 0.4 },
    { kind = "revolute", a = 0.12, alpha = "pi/2", d = 0.03, theta = 0 },
]

[[frame]]
name = "twist"
link = 3
xyz = [0.1, -0.02, 0.3]
rpy = [0.4, "pi/3", "-pi/2"]
"#;

/// No joint turns.
const GANTRY: &str = include_str!("support/gantry.toml");

const LANGUAGES: [Language; 2] = [Language::Cuda, Language::Wgsl];

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn file(name: &str, text: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("gpu");
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn arms() -> [PathBuf; 4] {
    let twist = root().join("tests/arms/twist.toml");
    [file("crane.toml", CRANE), file("gantry.toml", GANTRY), twist, root().join("powerball/arm.toml")]
}

/// A generated text and what verifies it.
fn generated(config: &Config, arm: &Path, language: Language) -> (String, Verifier) {
    let text = config.clone().language(language).source().unwrap();
    let verifier = Verifier::new(Arm::read(arm).unwrap(), language, &text).unwrap();
    (text, verifier)
}

#[test]
fn every_function_and_its_kernel_is_proven() {
    for arm in arms() {
        let config = Config::new(&arm).functions(Function::common().collect::<Vec<_>>());
        for language in LANGUAGES {
            let (text, verifier) = generated(&config, &arm, language);
            let report = verifier.verify(&text, None).unwrap();
            assert_eq!(
                (report.difference, report.not_checked),
                (None, vec![]),
                "{language} {}",
                arm.display()
            );
            for function in Function::common() {
                for name in [format!("{function}"), format!("{function}_with"), format!("{function}_batch")] {
                    assert!(report.proven.contains(&name), "{language} {}: {name}", arm.display());
                }
            }
        }
    }
}

/// What takes most arguments, what is of a frame, what is a number, and what has no parameters.
#[test]
fn frames_payloads_and_values_have_kernels_too() {
    use Function::*;
    let arm = file("crane_frames.toml", CRANE);
    let functions =
        [TorqueHessianTimes, InverseDynamicsWithPayload, Twist, KineticEnergy, PotentialEnergyRegressor];
    let config = Config::new(&arm).functions(functions);
    let cuda = config.clone().language(Language::Cuda).source().unwrap();
    for words in [
        "extern \"C\" __global__ void crane_5_torque_hessian_times_batch(",
        "extern \"C\" __global__ void crane_5_twist_twist_batch(",
        "inline __device__ void crane_5_twist_inverse_dynamics_with_payload_with(",
        "payload[9 * count + state],",
        "result[state] = crane_5_kinetic_energy(q_of, dq_of, parameters);",
        "--fmad=false",
    ] {
        assert!(cuda.contains(words), "{words}");
    }
    let wgsl = config.clone().language(Language::Wgsl).source().unwrap();
    for words in [
        "fn crane_5_torque_hessian_times_batch(",
        "fn crane_5_twist_twist(q: array<f32, 3>, dq: array<f32, 3>) -> array<f32, 6> {",
        "crane_5_payload[9u * count + state],",
        "// joint_names[0]: lift\n",
        "Numbers are f32, since the language has no f64.",
    ] {
        assert!(wgsl.contains(words), "{words}");
    }
    let set: Vec<String> = {
        let model = dyngen::Model::derive(Arm::read(&arm).unwrap()).unwrap();
        model.set(dyngen::SetKind::Minimal).unwrap().names()
    };
    let values: Vec<String> = set.iter().enumerate().map(|(k, name)| format!("\"{name}\": 0.{k}7")).collect();
    let values = file("crane_values.json", &format!("{{ {} }}", values.join(", ")));
    for language in LANGUAGES {
        let (text, verifier) = generated(&config, &arm, language);
        let report = verifier.verify(&text, None).unwrap();
        assert_eq!(report.difference, None);
        for name in [
            "twist::twist_batch",
            "twist_batch",
            "torque_hessian_times_batch",
            "potential_energy_regressor_batch",
        ] {
            assert!(report.proven.iter().any(|proven| proven == name), "{language}: {name}");
        }
        let (text, verifier) = generated(&config.clone().values(&values), &arm, language);
        let report = verifier.verify(&text, None).unwrap();
        assert_eq!(report.difference, None);
        assert!(verifier.values().is_some_and(|values| values.len() == set.len()));
        assert!(!text.contains("prepared"), "{language}");
        // Another value than the functions have.
        let changed = text.replacen("0.07", "0.08", 1);
        assert_ne!(changed, text);
        let verifier = Verifier::new(Arm::read(&arm).unwrap(), language, &changed).unwrap();
        assert!(verifier.verify(&changed, None).unwrap().difference.is_some(), "{language}");
    }
}

/// Friction is a function without a kernel in CUDA; it is proven as in C.
#[test]
fn friction_is_proven_too() {
    let arm = root().join("tests/arms/planar2r.toml");
    let terms = ["viscous", "coulomb", "tanh:5"].map(|term| term.parse().unwrap());
    let config = Config::new(&arm).functions([Function::Gravity]).friction(terms);
    let (text, verifier) = generated(&config, &arm, Language::Cuda);
    let report = verifier.verify(&text, None).unwrap();
    assert_eq!((report.difference, report.not_checked), (None, vec![]));
    assert!(report.proven.iter().any(|name| name == "friction_columns"));
    let hidden = text.replacen(
        "    const real dq1 = dq[0];\n    const real dq2",
        "#define c1 s1\n    const real dq2",
        1,
    );
    assert_ne!(hidden, text);
    assert!(verifier.verify(&hidden, None).is_err());
}

/// Whether a line is code in which every change matters.
fn matters(line: &str) -> bool {
    let text = line.trim();
    let is_comment = ["//", "/*", "*"].iter().any(|start| text.starts_with(start));
    // What is set and never read, and what tells a compiler that nothing is.
    !(text.is_empty()
        || is_comment
        || text.starts_with("(void)")
        || text.contains("(real)0.0;")
        || text.starts_with("0.0f,"))
}

/// Words, numbers and single characters.
fn tokens(line: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    let mut open = false;
    for c in line.chars() {
        let word = c.is_alphanumeric() || c == '_';
        match tokens.last_mut() {
            Some(last) if word && open => last.push(c),
            _ => tokens.push(c.to_string()),
        }
        open = word;
    }
    tokens
}

/// One random change of a text; none where the place that was drawn has none.
fn mutant(text: &str, rng: &mut ChaCha8Rng) -> Option<(String, String)> {
    let mut lines: Vec<String> = text.lines().map(String::from).collect();
    let at = rng.random_range(0..lines.len());
    if !matters(&lines[at]) {
        return None;
    }
    let old = lines[at].clone();
    let mut parts = tokens(&old);
    let k = rng.random_range(0..parts.len());
    let changed = match parts[k].as_str() {
        "+" => "-".to_string(),
        "-" => "+".to_string(),
        "*" => "/".to_string(),
        "/" => "*".to_string(),
        "<" => ">".to_string(),
        "s" | "state" => "count".to_string(),
        "count" => "state".to_string(),
        number if number.bytes().all(|c| c.is_ascii_digit()) => (number.parse::<u64>().ok()? + 1).to_string(),
        name if name.starts_with(|c: char| c.is_ascii_alphabetic()) && rng.random_range(0..2) == 0 => {
            // Another name of the lines around.
            let near = &lines[at.saturating_sub(20)..(at + 20).min(lines.len())];
            let near: Vec<String> =
                near.iter().filter(|line| matters(line)).flat_map(|line| tokens(line)).collect();
            let names: Vec<&String> =
                near.iter().filter(|t| t.starts_with(|c: char| c.is_ascii_alphabetic())).collect();
            (*names[rng.random_range(0..names.len())]).clone()
        }
        _ if rng.random_range(0..4) == 0 => {
            lines.remove(at);
            return Some((lines.join("\n") + "\n", format!("{old} -> nothing")));
        }
        _ => return None,
    };
    if changed == parts[k] {
        return None;
    }
    parts[k] = changed;
    lines[at] = parts.concat();
    let what = format!("{old} -> {}", lines[at]);
    Some((lines.join("\n") + "\n", what))
}

/// In the helpers, the sizes, the functions and the kernels.
#[test]
fn no_changed_file_passes() {
    use Function::*;
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    for arm in [file("crane_mutants.toml", CRANE), root().join("tests/arms/twist.toml")] {
        let config = Config::new(&arm).functions([InverseDynamics, MassMatrix, ForwardDynamics, Jacobian]);
        for language in LANGUAGES {
            let (text, verifier) = generated(&config, &arm, language);
            let (mut tried, mut unread) = (0, 0);
            while tried < 120 {
                let Some((changed, what)) = mutant(&text, &mut rng) else { continue };
                tried += 1;
                match verifier.verify(&changed, None) {
                    Err(_) => unread += 1,
                    Ok(report) => {
                        assert!(report.difference.is_some(), "{language} {}: {what}", arm.display())
                    }
                }
            }
            // Both ways to refuse are there.
            assert!(unread > 10 && unread < tried - 10, "{language}: {unread} of {tried}");
        }
    }
}

/// Cut anywhere, or with a letter of two bytes or a bracket anywhere.
#[test]
fn broken_files_end_with_an_error_or_a_difference_and_no_panic() {
    let mut rng = ChaCha8Rng::seed_from_u64(8);
    let arm = file("crane_broken.toml", CRANE);
    let config = Config::new(&arm).functions([Function::Gravity, Function::KineticEnergy]);
    for language in LANGUAGES {
        let (text, verifier) = generated(&config, &arm, language);
        let mut refused = 0;
        for _ in 0..300 {
            let mut at = rng.random_range(0..text.len());
            while !text.is_char_boundary(at) {
                at -= 1;
            }
            let put = ["é", "(", "{", "}", "\"", "#", "/*"][rng.random_range(0..7)];
            let whole = format!("{}{put}{}", &text[..at], &text[at..]);
            let broken = if rng.random_range(0..2) == 0 { &text[..at] } else { &whole };
            let found = verifier.verify(broken, None);
            refused += usize::from(found.is_err() || found.unwrap().difference.is_some());
        }
        // The rest is in comments, or ends behind an item.
        assert!(refused > 150, "{language}: {refused}");
    }
}

#[test]
fn what_surrounds_the_functions_must_be_what_dyngen_writes() {
    let arm = root().join("tests/arms/twist.toml");
    let config = Config::new(&arm).functions([Function::Gravity, Function::Jacobian]);
    let cases = [
        (Language::Cuda, "if (state < count)", "if (state <= count)"),
        (Language::Cuda, "threadIdx.x", "threadIdx.y"),
        (Language::Cuda, "result[1 * count + state]", "result[0 * count + state]"),
        (Language::Cuda, "twist_gravity(q_of, parameters, result_of)", "twist_gravity(q_of, q, result_of)"),
        (Language::Cuda, "inline __device__ void", "inline void"),
        (Language::Cuda, "extern \"C\" __global__", "__global__"),
        (
            Language::Cuda,
            "typedef struct {\n    twist_real values[",
            "typedef struct {\n    twist_real values[1",
        ),
        (Language::Cuda, "#define TWIST_JOINTS", "#define dq1 dq2\n#define TWIST_JOINTS"),
        (Language::Cuda, "#define TWIST_JOINTS 3", "#define TWIST_JOINTS 3\n#define TWIST_JOINTS 2"),
        (Language::Cuda, "#define TWIST_JOINTS 3", "#define TWIST_JOINTS 2"),
        (Language::Cuda, "typedef double twist_real", "typedef int twist_real"),
        (Language::Cuda, "prepared->values[1] = ", "prepared->values[2] = "),
        (Language::Cuda, "__USE_FAST_MATH__ + 0", "__USE_FAST_MATH__ - 1"),
        (Language::Wgsl, "if (state < count)", "if (state <= count)"),
        (Language::Wgsl, "@workgroup_size(64)", "@workgroup_size(32)"),
        (Language::Wgsl, "groups.x * 64u", "groups.x * 32u"),
        (Language::Wgsl, "@binding(1) var", "@binding(0) var"),
        (Language::Wgsl, "twist_result[1u * count", "twist_result[0u * count"),
        (Language::Wgsl, "twist_prepare(parameters)", "twist_prepare(q)"),
        (Language::Wgsl, "return twist_gravity_with(", "return twist_jacobian_with("),
        (Language::Wgsl, "q: array<f32, 3>", "q: array<f32, 4>"),
        (Language::Wgsl, "parameter_names[1]: ", "parameter_names[1]: m1 + "),
        (Language::Wgsl, "parameter_names[1]: ", "parameter_names[2]: "),
        (Language::Wgsl, "round(angle", "floor(angle"),
        // A comment that ends before the line does.
        (Language::Wgsl, "// Number of joints.", "// Number of joints.\u{2028}const a = 1;"),
        (Language::Wgsl, "// Number of joints.", "// Number of joints.\rconst a = 1;"),
        (Language::Wgsl, "// Number of joints.", "/* Number of joints. */"),
        (Language::Wgsl, "const TWIST_JOINTS", "override extra = 1;\nconst TWIST_JOINTS"),
    ];
    for (language, old, new) in cases {
        let (text, verifier) = generated(&config, &arm, language);
        let changed = text.replacen(old, new, 1);
        assert_ne!(changed, text, "{language}: there is no {old}");
        let found = verifier.verify(&changed, None);
        assert!(found.is_err() || found.unwrap().difference.is_some(), "{language}: {old} -> {new}");
    }
}
