//! Generated C against the generated Rust: both are compiled, and give the same bits for every function, in
//! double and in single precision.

#![allow(clippy::unwrap_used, clippy::panic)]

use chacha20::ChaCha8Rng;
use dyngen::dynamics::function::{Argument, Size};
use dyngen::{Arm, Config, FrictionTerm, Function, Language, Model, SetKind};
use rand::{RngExt, SeedableRng};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Joints that slide and follow others, angles in radians, motors that turn with two joints, and a frame.
const CRANE: &str = r#"
name = "Crane 5"
convention = "standard"
gravity = [1, 0.5, -9]
joint = [
    { kind = "prismatic", a = 0, alpha = "pi/2", d = 0.1, theta = 0 },
    { kind = "prismatic", a = 0.1, alpha = "-pi/2", d = 0.2, theta = "pi/2", mimic = { joint = 1, ratio = "3/2", offset = -0.05 } },
    { kind = "revolute", a = 0.2, alpha = "pi", d = 0, theta = 0.4, mimic = { joint = 4, ratio = "1/2", offset = 0.2 } },
    { kind = "revolute", a = 0.15, alpha = "pi/2", d = 0.05, theta = 0 },
    { kind = "revolute", a = 0.12, alpha = 0, d = 0.03, theta = 0, rotor_ratio = 30, mimic = { joint = 4, ratio = -2 } },
    { kind = "revolute", a = 0.1, alpha = "pi/2", d = 0, theta = "pi/6", mimic = { joint = 3, ratio = 1.06399 } },
]

[[transmission]]
joints = [5, 4]
matrix = [[1, "1/2"], [0, 1]]

[[frame]]
name = "elbow"
link = 3
xyz = [0.1, -0.02, 0.3]
rpy = [0.4, "pi/3", "-pi/2"]
"#;

/// No joint turns.
const GANTRY: &str = include_str!("support/gantry.toml");

/// An arm as it is generated.
struct Case {
    /// Of files and of the module in Rust.
    name: &'static str,
    /// Before names in C.
    prefix: &'static str,
    arm: PathBuf,
    set: SetKind,
    friction: Vec<FrictionTerm>,
    values: Option<PathBuf>,
    /// Whether products are formed within sums.
    contract: bool,
}

fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

fn folder() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("c_language");
    std::fs::create_dir_all(folder.join("src")).unwrap();
    folder
}

fn file(name: &str, text: &str) -> PathBuf {
    let path = folder().join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn cases() -> Vec<Case> {
    let arms = workspace().join("tests/arms");
    let terms = |terms: &[&str]| terms.iter().map(|term| term.parse().unwrap()).collect::<Vec<_>>();
    let case = |name, prefix, arm| Case {
        name,
        prefix,
        arm,
        set: SetKind::Minimal,
        friction: Vec::new(),
        values: None,
        contract: false,
    };
    let planar = Arm::read(&arms.join("planar2r.toml")).unwrap();
    let planar = Model::derive(planar).unwrap();
    let values: serde_json::Map<String, serde_json::Value> = planar
        .set(SetKind::Minimal)
        .unwrap()
        .names()
        .into_iter()
        .enumerate()
        .map(|(k, name)| (name, (0.7 + 0.31 * k as f64).into()))
        .collect();
    let values = file("planar2r.json", &serde_json::Value::Object(values).to_string());
    vec![
        Case {
            friction: terms(&["viscous", "coulomb"]),
            ..case("lwa4p", "powerball_lwa4p", workspace().join("powerball/arm.toml"))
        },
        case("stanford", "stanford", arms.join("stanford.toml")),
        Case { contract: true, ..case("contracted", "stanford", arms.join("stanford.toml")) },
        Case {
            set: SetKind::Full,
            friction: terms(&["coulomb", "viscous"]),
            ..case("crane", "crane_5", file("crane.toml", CRANE))
        },
        case("linkage", "rocker", workspace().join("dyngen/tests/loops/rocker.toml")),
        case("gantry", "gantry", file("gantry.toml", GANTRY)),
        Case { values: Some(values), ..case("planar", "planar_2r", arms.join("planar2r.toml")) },
    ]
}

impl Case {
    fn model(&self) -> Model {
        Model::derive(Arm::read(&self.arm).unwrap()).unwrap()
    }

    fn config(&self, model: &Model) -> Config {
        let config = Config::new(&self.arm)
            .parameters(self.set)
            .functions(functions(model))
            .friction(self.friction.clone())
            .contract(self.contract);
        match &self.values {
            Some(values) => config.values(values),
            None => config,
        }
    }

    /// How many numbers an argument of the harness has.
    fn length(&self, model: &Model, argument: Argument) -> usize {
        argument.length(model.arm().dof(), model.set(self.set).unwrap().parameters.len())
    }

    /// Every function with the frame at which it is.
    fn functions(&self, model: &Model) -> Vec<(Option<String>, Function)> {
        let at = model.arm().frames.iter().flat_map(|frame| {
            let at = model.at_frame(&frame.name).unwrap();
            let of_tool = functions(&at).into_iter().filter(|f| f.is_of_tool());
            of_tool.map(|f| (Some(frame.name.clone()), f)).collect::<Vec<_>>()
        });
        functions(model).into_iter().map(|f| (None, f)).chain(at).collect()
    }

    fn takes(&self, function: Function) -> impl Iterator<Item = Argument> {
        let baked = self.values.is_some();
        function.arguments().iter().copied().filter(move |a| !baked || *a != Argument::Parameters)
    }
}

/// The common functions, and those that take what these do not.
fn functions(model: &Model) -> Vec<Function> {
    let more = [
        Function::AccelerationByPosition,
        Function::MassMatrixTimesByPosition,
        Function::JacobianRate,
        Function::JacobianTransposeTimes,
        Function::InverseDynamicsWithPayload,
        Function::PayloadRegressor,
        Function::TorqueHessianTimes,
    ];
    model
        .functions(SetKind::Minimal)
        .filter(|f| more.contains(f) || Function::common().any(|common| common == *f))
        .collect()
}

const ARGUMENTS: [Argument; 12] = {
    use Argument::*;
    [
        Positions,
        Velocities,
        Accelerations,
        ReferenceVelocities,
        ReferenceAccelerations,
        Torques,
        Errors,
        Wrench,
        Payload,
        PositionDirection,
        VelocityDirection,
        Parameters,
    ]
};

fn is_number(function: Function) -> bool {
    matches!(function, Function::KineticEnergy | Function::PotentialEnergy)
}

/// A program that reads states and writes what every function gives, in C.
fn main_in_c(case: &Case, model: &Model) -> String {
    let prefix = case.prefix;
    let (n, p) = (model.arm().dof(), model.set(case.set).unwrap().parameters.len());
    let terms = case.friction.len();
    let mut body = String::new();
    for argument in ARGUMENTS {
        let (name, length) = (argument.name(), case.length(model, argument));
        let _ = writeln!(body, "        real {name}[{length}];");
    }
    let _ = writeln!(body, "        {prefix}_trig trig;");
    for argument in ARGUMENTS {
        let (name, length) = (argument.name(), case.length(model, argument));
        let _ = writeln!(body, "        for (i = 0; i < {length}; i++) {name}[i] = (real)next();");
    }
    let _ = writeln!(body, "        {prefix}_trig_of(q, &trig);");
    if case.values.is_some() {
        body += "        (void)parameters;\n";
    } else {
        let _ = writeln!(
            body,
            "        {prefix}_prepared prepared;\n        {prefix}_prepare(parameters, &prepared);"
        );
    }
    for (frame, f) in case.functions(model) {
        let name = frame.map_or(String::new(), |frame| format!("{frame}_")) + f.name();
        let plain: Vec<&str> = case.takes(f).map(Argument::name).collect();
        let with = case.takes(f).filter(|a| *a != Argument::Positions);
        let with = with.map(|a| if a == Argument::Parameters { ", &prepared" } else { a.name() });
        let with: String = with.map(|a| format!(", {}", a.trim_start_matches(", "))).collect();
        let (plain, (rows, columns)) = (plain.join(", "), f.shape(n, p));
        let (shape, first) = match f.size() {
            (Size::Fixed(1), _) | (_, Size::Fixed(1)) => (format!("[{}]", rows * columns), "result"),
            _ => (format!("[{rows}][{columns}]"), "&result[0][0]"),
        };
        let _ = if is_number(f) {
            writeln!(
                body,
                "        {{ real x = {prefix}_{name}({plain}); put(&x, 1); x = \
                {prefix}_{name}_with(&trig{with}); put(&x, 1); }}"
            )
        } else {
            writeln!(
                body,
                "        {{ real result{shape}; {prefix}_{name}({plain}, result); put({first}, {0}); \
                 {prefix}_{name}_with(&trig{with}, result); put({first}, {0}); }}",
                rows * columns
            )
        };
    }
    if terms > 0 {
        let _ = writeln!(
            body,
            "        {{ real c[{n}][{terms}]; real k[{n}][{terms}]; real f2[{n}]; \
             for (i = 0; i < {n} * {terms}; i++) k[i / {terms}][i % {terms}] = tau[i / {terms}] + dq[i % \
             {terms}]; {prefix}_friction_columns(dq, c); put(&c[0][0], {n} * {terms}); \
             {prefix}_friction(dq, (const real(*)[{terms}])k, f2); put(f2, {n}); }}"
        );
    }
    format!(
        "#include \"{}.h\"\n#include <stdio.h>\n#include <stdlib.h>\ntypedef {prefix}_real real;\n\
         static double next(void) {{ double x; if (fread(&x, sizeof x, 1, stdin) != 1) exit(0); return x; \
         }}\n\
         static void put(const real *x, int n) {{ int i; for (i = 0; i < n; i++) {{ double y = (double)x[i]; \
         fwrite(&y, sizeof y, 1, stdout); }} }}\n\
         int main(void) {{\n    int i;\n    for (;;) {{\n{body}    }}\n}}\n",
        case.name
    )
}

/// A program as of [`main_in_c`], in Rust, as a function.
fn main_in_rust(case: &Case, model: &Model) -> String {
    let name = case.name;
    let mut body = String::new();
    for argument in ARGUMENTS {
        let (name, length) = (argument.name(), case.length(model, argument));
        let _ = writeln!(body, "        let {name} = SVector::<T, {length}>::from_fn(|_, _| next.take());");
    }
    let _ = writeln!(body, "        let trig = {name}::Trig::new(&q);");
    if case.values.is_none() {
        let _ = writeln!(body, "        let prepared = {name}::prepare(&parameters);");
    }
    for (frame, f) in case.functions(model) {
        let path = frame.map_or(String::new(), |frame| format!("{frame}::")) + f.name();
        let plain: String = case.takes(f).map(|a| format!("&{}, ", a.name())).collect();
        let with = case.takes(f).filter(|a| *a != Argument::Positions);
        let with: String = with
            .map(|a| format!(", &{}", if a == Argument::Parameters { "prepared" } else { a.name() }))
            .collect();
        let slice = if is_number(f) { "SVector::<T, 1>::new(x)" } else { "x.transpose()" };
        let _ = writeln!(body, "        let x = {name}::{path}({plain}); put({slice}.as_slice());");
        let _ = writeln!(body, "        let x = {name}::{path}_with(&trig{with}); put({slice}.as_slice());");
    }
    if !case.friction.is_empty() {
        let _ = writeln!(
            body,
            "        let k = SMatrix::<T, {{ {name}::JOINTS }}, {}>::from_fn(|i, j| tau[i] + \
             dq[j]);\n        put({name}::friction_columns(&dq).transpose().as_slice());\n        \
             put({name}::friction(&dq, &k).as_slice());",
            case.friction.len()
        );
    }
    format!(
        "mod {name} {{ include!(\"{name}.inc\"); }}\nfn run_{name}<T: Real>(mut next: Input) {{\n    \
        while !next.0.is_empty() {{\n{body}    }}\n}}\n"
    )
}

const RUST: &str = r#"
use nalgebra::{SMatrix, SVector};
use std::io::{Read, Write};
trait Real: nalgebra::RealField + Copy + nalgebra::SimdRealField {}
impl Real for f32 {}
impl Real for f64 {}
struct Input(Vec<f64>);
impl Input {
    fn take<T: Real>(&mut self) -> T { nalgebra::convert(self.0.pop().unwrap()) }
}
fn put<T: Real>(values: &[T]) {
    let mut out = std::io::stdout().lock();
    for x in values {
        let x: f64 = x.to_subset().unwrap();
        out.write_all(&x.to_le_bytes()).unwrap();
    }
}
fn main() {
    let mut bytes = Vec::new();
    std::io::stdin().read_to_end(&mut bytes).unwrap();
    let numbers = bytes.chunks(8).rev().map(|x| f64::from_le_bytes(x.try_into().unwrap()));
    let next = Input(numbers.collect());
    let given: Vec<String> = std::env::args().collect();
    match (given[1].as_str(), given[2].as_str()) {
"#;

/// States, one after another, as the programs read them.
fn states(case: &Case, model: &Model) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(case.name.len() as u64);
    let mut states = Vec::new();
    for sample in 0..60 {
        for argument in ARGUMENTS {
            let size = match (argument, sample % 4) {
                (Argument::Positions, 0) => 0.7,
                (Argument::Positions, 1) => 3.0,
                (Argument::Positions, 2) => 40.0,
                // 1.5 times as much is the angle of a joint that follows, and added to others still below
                // 10⁵.
                (Argument::Positions, _) => 2e4,
                _ => 2.0,
            };
            for _ in 0..case.length(model, argument) {
                // Standing still is a state too.
                let x: f64 = random.random_range(-size..size);
                states.push(if argument == Argument::Velocities && sample % 10 == 0 { 0.0 } else { x });
            }
        }
    }
    states
}

/// What a program writes.
fn run(program: &mut Command, states: &[f64]) -> Vec<f64> {
    let mut child = program.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let bytes: Vec<u8> = states.iter().flat_map(|x| x.to_le_bytes()).collect();
    let writer = std::thread::spawn(move || input.write_all(&bytes).unwrap());
    let out = child.wait_with_output().unwrap();
    writer.join().unwrap();
    assert!(out.status.success());
    out.stdout.chunks(8).map(|x| f64::from_le_bytes(x.try_into().unwrap())).collect()
}

/// Whether a program can be called. `REQUIRE_CC` makes a C compiler a must.
fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok_and(|out| out.status.success());
    assert!(found || program != "cc" || std::env::var_os("REQUIRE_CC").is_none(), "there is no cc");
    found
}

/// Compiles source files with every warning an error.
fn compile(compiler: &str, arguments: &[&str], files: &[PathBuf]) {
    let strict = ["-Wall", "-Wextra", "-pedantic", "-Werror", "-O2", "-ffp-contract=off"];
    let linked = (!arguments.contains(&"-fsyntax-only")).then_some("-lm");
    let out = Command::new(compiler).args(strict).args(arguments).args(files).args(linked).output().unwrap();
    assert!(out.status.success(), "{compiler} {arguments:?}: {}", String::from_utf8_lossy(&out.stderr));
}

/// The program in Rust with all arms.
fn built_rust(cases: &[(Case, Model)]) -> PathBuf {
    let manifest = "[package]\nname = \"c_language\"\nversion = \"0.0.0\"\nedition = \"2024\"\n[workspace]\n\
        [dependencies]\nnalgebra = { version = \"0.35\", default-features = false, features = [\"libm\"] }\n";
    file("Cargo.toml", manifest);
    // No processor is asked for one here: it is a function of libm.
    file("build.rs", "fn main() { println!(\"cargo::rustc-cfg=dyngen_fma\"); }\n");
    // The versions of this workspace, so that nothing has to be looked up.
    std::fs::copy(workspace().join("Cargo.lock"), folder().join("Cargo.lock")).unwrap();
    let (mut main, mut modules) = (RUST.to_string(), String::new());
    for (case, model) in cases {
        let name = case.name;
        case.config(model).write(&folder().join(format!("src/{name}.inc"))).unwrap();
        let _ = writeln!(main, "        (\"{name}\", \"f64\") => run_{name}::<f64>(next),");
        let _ = writeln!(main, "        (\"{name}\", _) => run_{name}::<f32>(next),");
        modules += &main_in_rust(case, model);
    }
    file("src/main.rs", &format!("{main}        _ => panic!(),\n    }}\n}}\n{modules}"));
    // What tests/golden.rs builds too.
    let target = folder().parent().unwrap().join("golden/target");
    let out = Command::new(env!("CARGO"))
        .args(["build", "--offline", "--quiet"])
        .current_dir(folder())
        .env("CARGO_TARGET_DIR", &target)
        .output()
        .unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    target.join("debug/c_language")
}

/// To the bit, most of them finite.
fn assert_equal(found: &[f64], expected: &[f64], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let same = |x: f64, y: f64| x.to_bits() == y.to_bits() || x.is_nan() && y.is_nan();
    let wrong: Vec<usize> = (0..found.len()).filter(|k| !same(found[*k], expected[*k])).collect();
    if let Some(k) = wrong.first() {
        panic!("{what}: {} of {} differ, {k}: {} {}", wrong.len(), found.len(), found[*k], expected[*k]);
    }
    let finite = expected.iter().filter(|x| x.is_finite()).count();
    assert!(finite > 1000 && finite * 10 > found.len() * 9, "{what}: {finite} of {} are finite", found.len());
}

#[test]
fn c_is_rust_to_the_bit() {
    if !has("cc") {
        eprintln!("skipped: there is no C compiler (apt-get install gcc)");
        return;
    }
    let cases: Vec<(Case, Model)> =
        cases().into_iter().map(|case| (case.model(), case)).map(|(m, c)| (c, m)).collect();
    let rust = built_rust(&cases);
    for (case, model) in &cases {
        let source = folder().join(format!("{}.c", case.name));
        case.config(model).language(Language::C).write(&source).unwrap();
        let main = file(&format!("{}_main.c", case.name), &main_in_c(case, model));
        let float = format!("-D{}_FLOAT", case.prefix.to_uppercase());
        let states = states(case, model);
        for (scalar, define) in [("f64", "-DDOUBLE"), ("f32", float.as_str())] {
            let program = folder().join(format!("{}_{scalar}", case.name));
            let output = program.to_str().unwrap();
            let fused = format!("-D{}_FMA", case.prefix.to_uppercase());
            compile("cc", &["-std=c99", define, &fused, "-o", output], &[source.clone(), main.clone()]);
            let expected = run(Command::new(&rust).args([case.name, scalar]), &states);
            let found = run(&mut Command::new(&program), &states);
            assert_equal(&found, &expected, &format!("{} {scalar}", case.name));
        }
    }
}

/// Every compiler at hand accepts the file without a warning, as C99 and as C++17, for both scalars.
#[test]
fn the_file_compiles_without_a_warning() {
    if !has("cc") {
        eprintln!("skipped: there is no C compiler (apt-get install gcc)");
        return;
    }
    let folder = folder().join("strict");
    std::fs::create_dir_all(&folder).unwrap();
    for case in cases() {
        let model = case.model();
        let source = folder.join(format!("{}.c", case.name));
        let friction = ["viscous", "coulomb", "tanh:200"].map(|term| term.parse::<FrictionTerm>().unwrap());
        case.config(&model).friction(friction).language(Language::C).write(&source).unwrap();
        let [float, fused] = ["FLOAT", "FMA"].map(|of| format!("-D{}_{of}", case.prefix.to_uppercase()));
        let strict = ["-fsyntax-only", "-Wconversion", "-Wdouble-promotion", "-Wshadow"];
        for scalar in ["-DDOUBLE", float.as_str()] {
            for compiler in ["cc", "clang"].into_iter().filter(|compiler| has(compiler)) {
                let arguments = [&strict[..], &["-std=c99", "-Wmissing-prototypes", scalar, &fused]].concat();
                compile(compiler, &arguments, std::slice::from_ref(&source));
            }
            for compiler in ["c++", "clang++"].into_iter().filter(|compiler| has(compiler)) {
                let arguments = [&strict[..], &["-x", "c++", "-std=c++17", scalar, &fused]].concat();
                compile(compiler, &arguments, std::slice::from_ref(&source));
            }
        }
    }
}

/// The reduction of angles stands on sums that are rounded as they are written: a compiler that is set
/// otherwise is refused.
/// A call of a function for each sum would be no gain: nobody gets it without asking for it.
#[test]
fn contraction_is_refused_where_the_target_has_no_instruction_for_it() {
    if !has("cc") || !cfg!(target_arch = "x86_64") {
        eprintln!("skipped: there is no C compiler for x86-64");
        return;
    }
    let folder = folder().join("refused");
    std::fs::create_dir_all(&folder).unwrap();
    let source = folder.join("gantry.c");
    let config = Config::new(file("gantry.toml", GANTRY)).language(Language::C).contract(true);
    config.write(&source).unwrap();
    for float in [&[][..], &["-DGANTRY_FLOAT"]] {
        let with = |flag: &str| {
            let mut compiler = Command::new("cc");
            compiler.args([flag, "-fsyntax-only"]).args(float).arg(&source).output().unwrap()
        };
        let without = with("-O2");
        let text = String::from_utf8_lossy(&without.stderr);
        assert!(!without.status.success() && text.contains("compile with -march=native or -mfma"), "{text}");
        assert!(with("-mfma").status.success() && with("-DGANTRY_FMA").status.success());
    }
}

#[test]
fn fast_mathematics_is_refused() {
    if !has("cc") {
        eprintln!("skipped: there is no C compiler (apt-get install gcc)");
        return;
    }
    let source = folder().join("fast.c");
    let config = Config::new(workspace().join("tests/arms/planar2r.toml")).functions([Function::Gravity]);
    config.language(Language::C).write(&source).unwrap();
    let with = |flag: &str| Command::new("cc").args([flag, "-fsyntax-only"]).arg(&source).output().unwrap();
    assert!(with("-O3").status.success());
    let refused = with("-ffast-math");
    assert!(!refused.status.success());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("compile without -ffast-math"));
}

/// Beyond 10⁵ rad, where Rust and C call functions of their machine, and of tanh: close to f64's own.
#[test]
fn what_the_machine_computes_is_close() {
    if !has("cc") {
        eprintln!("skipped: there is no C compiler (apt-get install gcc)");
        return;
    }
    let folder = folder().join("far");
    std::fs::create_dir_all(&folder).unwrap();
    let arm = workspace().join("tests/arms/planar2r.toml");
    let config = Config::new(arm).functions([Function::Gravity]).friction([FrictionTerm::Tanh(vec![0.5])]);
    config.language(Language::C).write(&folder.join("planar.c")).unwrap();
    let main = "#include \"planar.h\"
#include <stdio.h>
int main(void) {
    planar_2r_real q[2], c[2][1];
    planar_2r_trig t;
    while (fread(q, sizeof q[0], 2, stdin) == 2) {
        planar_2r_trig_of(q, &t);
        planar_2r_friction_columns(q, c);
        fwrite(t.sin, sizeof q[0], 2, stdout);
        fwrite(t.cos, sizeof q[0], 2, stdout);
        fwrite(c, sizeof q[0], 2, stdout);
    }
}
";
    std::fs::write(folder.join("main.c"), main).unwrap();
    let program = folder.join("far");
    let files = ["planar.c", "main.c"].map(|name| folder.join(name));
    compile("cc", &["-std=c99", "-o", program.to_str().unwrap()], &files);
    for q in [[0.3, 1.1e5], [-3e9, 0.9], [1e22, -7e15]] {
        let found = run(&mut Command::new(&program), &q);
        let expected = [q.map(f64::sin), q.map(f64::cos), q.map(|x| (0.5 * x).tanh())].concat();
        assert_eq!(found.len(), expected.len());
        for (x, y) in found.iter().zip(&expected) {
            assert!((x - y).abs() <= 2.0 * f64::EPSILON, "{q:?}: {found:?} {expected:?}");
        }
    }
}
