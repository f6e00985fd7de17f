//! What a controller runs, on an emulated Cortex-M4F and Cortex-M7: `firmware/` is built, judged by its
//! symbols, run, and compared with the host to the bit.
//!
//! Sizes, stack and instruction counts do not depend on the machine. `firmware/costs.txt` holds them, and
//! none may grow. `POWERBALL_BLESS=1 cargo test --release -p powerball-workspace --test firmware` writes it,
//! and the table in `docs/results/performance.md`, anew.

#![allow(clippy::unwrap_used, clippy::panic)]

use object::{Object, ObjectSymbol, SymbolKind};
use powerball_workspace::{document, root};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

const TARGET: &str = "thumbv7em-none-eabihf";
const BLESS: &str = "POWERBALL_BLESS=1 cargo test --release -p powerball-workspace --test firmware";

/// What is missing to run this, if anything.
fn missing() -> Option<String> {
    let output = |program: &str, arguments: &[&str]| {
        let out = Command::new(program).args(arguments).output().ok()?;
        out.status.success().then(|| String::from_utf8_lossy(&out.stdout).into_owned())
    };
    let sysroot = output("rustc", &["--print", "sysroot"])?;
    if !Path::new(sysroot.trim()).join("lib/rustlib").join(TARGET).is_dir() {
        return Some(format!("the target is not installed (rustup target add {TARGET})"));
    }
    output("qemu-system-arm", &["--version"])
        .is_none()
        .then(|| "qemu-system-arm is not installed (apt-get install qemu-system-arm)".to_string())
}

fn target_folder() -> PathBuf {
    std::env::var_os("FIRMWARE_TARGET_DIR")
        .map_or_else(|| Path::new(env!("CARGO_TARGET_TMPDIR")).join("firmware"), PathBuf::from)
}

/// A board that QEMU has, and its core.
const M4F: [&str; 2] = ["mps2-an386", "cortex-m4"];
const M7: [&str; 2] = ["mps2-an500", "cortex-m7"];

/// Cargo in the firmware's own workspace.
fn cargo(arguments: &[&str]) -> std::process::Output {
    cargo_with("", arguments)
}

/// With more flags for the target's code.
fn cargo_with(flags: &str, arguments: &[&str]) -> std::process::Output {
    let mut command = Command::new(env!("CARGO"));
    command.args(arguments).args(["--release", "--locked"]).current_dir(root().join("firmware"));
    if !flags.is_empty() {
        command.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_RUSTFLAGS", flags);
    }
    command.env("CARGO_TARGET_DIR", target_folder()).output().unwrap()
}

fn built(name: &str) -> PathBuf {
    target_folder().join(TARGET).join("release").join(name)
}

/// What a program prints on an emulated board. One that hangs is killed.
fn emulate([board, core]: [&str; 2], program: &Path) -> String {
    let mut child = Command::new("qemu-system-arm")
        .args(["-M", board, "-cpu", core, "-nographic", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-icount", "shift=0", "-kernel"])
        .arg(program)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(120) {
            child.kill().unwrap();
            panic!("the emulated board does not come to an end");
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    let out = child.wait_with_output().unwrap();
    let text = String::from_utf8_lossy(&out.stdout).into_owned() + &String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "{text}");
    text
}

/// Sizes in bytes of a program's functions by their mangled names.
fn functions(program: &Path) -> BTreeMap<String, u64> {
    let data = std::fs::read(program).unwrap();
    let file = object::File::parse(&*data).unwrap();
    let symbols = file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text);
    symbols.filter_map(|symbol| Some((symbol.name().ok()?.to_string(), symbol.size()))).collect()
}

/// Whether a function computes with doubles in software: what the compiler calls where the core cannot.
fn is_soft_double(name: &str) -> bool {
    let runtime =
        name.strip_prefix("__aeabi_").is_some_and(|rest| rest.starts_with('d') || rest.ends_with("2d"));
    let builtin = name.contains("compiler_builtins") || name.starts_with("__");
    runtime
        || builtin
            && ["df2", "df3", "dfsf", "dfdi", "dfsi", "sfdf", "didf", "sidf"]
                .iter()
                .any(|part| name.contains(part))
}

/// One line of `firmware/costs.txt`: bytes of code, bytes of stack, instructions of a call.
type Costs = BTreeMap<String, [u64; 3]>;

fn costs(report: &str, of_single: &BTreeMap<String, u64>, of_double: &BTreeMap<String, u64>) -> Costs {
    let lines = report.lines().filter_map(|line| line.strip_prefix("cost "));
    lines
        .map(|line| {
            let [scalar, name, stack, instructions] = line.split(' ').collect::<Vec<_>>()[..] else {
                panic!("{line}");
            };
            // Where a function was not inlined into the one that stands for it here, both count.
            let emitted = match name {
                "trig" => "trigonometry",
                "tau" => "inverse_dynamics_with",
                "regressor" => "regressor_with",
                "mass_matrix" => "mass_matrix_with",
                "coriolis" => "coriolis_matrix_with",
                "gravity" => "gravity_with",
                _ => "nothing else",
            };
            let parts: &[&str] = match (scalar, name) {
                ("cycle", "row") => &["watch"],
                ("cycle", "step") => &["step", "control", "watch"],
                _ => &[name],
            };
            let own = |symbol: &str| {
                parts.iter().any(|part| {
                    symbol.contains(&format!(
                        "powerball_firmware{}{scalar}{}{part}17h",
                        scalar.len(),
                        part.len()
                    ))
                })
            };
            // A cycle is in single precision alone; what of the laws is not inlined is in the library.
            let symbols = if matches!(scalar, "f32" | "cycle") { of_single } else { of_double };
            let text = symbols
                .iter()
                .filter(|(symbol, _)| {
                    own(symbol)
                        || symbol.contains("3arm") && symbol.contains(emitted)
                        || scalar == "cycle" && name != "row" && symbol.contains("10controller10correction")
                })
                .map(|(_, size)| size)
                .sum();
            (format!("{scalar} {name}"), [text, stack.parse().unwrap(), instructions.parse().unwrap()])
        })
        .collect()
}

fn written(costs: &Costs) -> String {
    let mut text =
        format!("# function: bytes of code, bytes of stack, instructions of a call. Made by {BLESS}\n");
    for (name, [code, stack, instructions]) in costs {
        let _ = writeln!(text, "{name}: {code} {stack} {instructions}");
    }
    text
}

fn read(text: &str) -> Costs {
    let lines = text.lines().filter(|line| !line.starts_with('#')).filter_map(|line| line.split_once(": "));
    lines
        .map(|(name, numbers)| {
            let numbers: Vec<u64> = numbers.split(' ').map(|n| n.parse().unwrap()).collect();
            (name.to_string(), numbers.try_into().unwrap())
        })
        .collect()
}

/// The table for people: single precision compared with double.
fn table(costs: &Costs) -> String {
    let mut text =
        "| function | f32: code, B | stack, B | instructions | f64: code, B | stack, B | instructions | f64 \
            on a Cortex-M7: code, B | stack, B | instructions |\n\
                    |---|---|---|---|---|---|---|---|---|---|\n"
            .to_string();
    let meaning = [
        ("trig", "sines and cosines of five joints"),
        ("tau", "τ, trigonometry and prepared parameters passed in, as below"),
        ("regressor", "Y, 6 × 19"),
        ("mass_matrix", "B"),
        ("coriolis", "C"),
        ("gravity", "g"),
        ("friction", "friction, Eq. 16, six joints"),
        ("estimator_row", "online estimator of 19 parameters: a row"),
        ("estimate", "online estimator: the estimate"),
        ("control", "a control step: trigonometry, τ, friction, feedback"),
    ];
    for (name, words) in meaning {
        let cells: Vec<String> = ["f32", "f64", "m7 f64"]
            .iter()
            .flat_map(|scalar| costs[&format!("{scalar} {name}")])
            .map(|n| n.to_string())
            .collect();
        let _ = writeln!(text, "| {words} | {} |", cells.join(" | "));
    }
    text
}

/// As [`table`], of a control cycle, for `docs/control.md`.
fn table_of_cycle(costs: &Costs) -> String {
    let mut text =
        "| on a Cortex-M4F, `f32`, six joints | stack, B | instructions |\n|---|---|---|\n".to_string();
    for (name, words) in [
        ("control", "trigonometry, torque with friction and three effects, impedance, limits, observer"),
        ("row", "a row of the test whether the model holds: six joints and the alarm"),
        ("step", "the longest cycle, in which two of the six joints have their turn of that row"),
    ] {
        let [_, stack, instructions] = costs[&format!("cycle {name}")];
        let _ = writeln!(text, "| {words} | {stack} | {instructions} |");
    }
    text
}

/// The cycle in which the report's controller saw that its model no longer holds.
fn alarm_in(report: &str) -> Option<u64> {
    let (_, rest) = report.split_once("alarm in Some(")?;
    rest.split(')').next()?.parse().ok()
}

#[test]
fn a_controller_runs_it_without_panic_allocation_or_soft_doubles_and_to_the_same_bits() {
    if let Some(reason) = missing() {
        assert!(std::env::var_os("REQUIRE_QEMU").is_none(), "{reason}");
        println!("skipped: {reason}");
        return;
    }
    // That these link is the proof that no panic is reachable; the one that can panic does not.
    let out = cargo(&["build", "--bin", "report", "--bin", "single", "--bin", "double"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let out = cargo(&["build", "--bin", "panics"]);
    let errors = String::from_utf8_lossy(&out.stderr);
    assert!(!out.status.success() && errors.contains("undefined symbol: a_panic_is_reachable"), "{errors}");

    let (single, double) = (functions(&built("single")), functions(&built("double")));
    for (name, symbols) in [("single", &single), ("double", &double)] {
        let allocates =
            symbols.keys().find(|symbol| symbol.contains("__rust_alloc") || symbol.contains("__rg_alloc"));
        assert!(allocates.is_none(), "{name} has an allocator: {allocates:?}");
    }
    let soft: Vec<_> = single.keys().filter(|name| is_soft_double(name)).collect();
    assert!(soft.is_empty(), "single precision computes with doubles: {soft:?}");
    assert!(
        double.keys().filter(|name| is_soft_double(name)).count() > 5,
        "the search for doubles finds none"
    );

    let report = emulate(M4F, &built("report"));
    let out = cargo_with("-C target-cpu=cortex-m7", &["build", "--bin", "report", "--bin", "double"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let (report_m7, double_m7) = (emulate(M7, &built("report")), functions(&built("double")));
    let host = Command::new("rustc").arg("-vV").output().unwrap();
    let host = String::from_utf8_lossy(&host.stdout)
        .lines()
        .find_map(|l| l.strip_prefix("host: ").map(String::from));
    let out =
        cargo(&["run", "--bin", "report", "--target", &host.unwrap(), "--features", "std,deterministic"]);
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    let bits = |text: &str| -> Vec<String> {
        text.lines().filter(|line| line.starts_with("bits ")).map(String::from).collect()
    };
    let here = bits(&String::from_utf8_lossy(&out.stdout));
    assert_eq!(bits(&report), here);
    assert_eq!(bits(&report_m7), here);
    assert_eq!(here.len(), 20);
    // The change comes in cycle 1000.
    let seen = alarm_in(&report).unwrap();
    assert!((1000..1400).contains(&seen), "{seen}");

    let mut all = costs(&report, &single, &double);
    // Single precision costs there what it costs on the smaller core.
    let m7 = costs(&report_m7, &single, &double_m7).into_iter().filter(|(name, _)| name.starts_with("f64"));
    all.extend(m7.map(|(name, cost)| (format!("m7 {name}"), cost)));
    let costs = all;
    let path = root().join("firmware/costs.txt");
    if std::env::var_os("POWERBALL_BLESS").is_some() {
        std::fs::write(&path, written(&costs)).unwrap();
        document::write_section(&root().join("docs/results/performance.md"), "firmware", &table(&costs))
            .unwrap();
        document::write_section(&root().join("docs/control.md"), "cycle", &table_of_cycle(&costs)).unwrap();
    }
    let [tau, regressor] = ["f32 tau", "f32 regressor"].map(|name| costs[name]);
    assert!(tau[0] <= 1700 && tau[1] <= 256, "{tau:?}");
    assert!(regressor[0] <= 2200, "{regressor:?}");
    let cycle = costs["cycle step"];
    assert!(cycle[1] < 2048 && cycle[2] < 12_000, "{cycle:?}");
    let allowed = read(&std::fs::read_to_string(&path).unwrap());
    assert_eq!(allowed.keys().collect::<Vec<_>>(), costs.keys().collect::<Vec<_>>());
    let grown: Vec<String> = costs
        .iter()
        .filter(|(name, now)| now.iter().zip(allowed[*name]).any(|(now, before)| *now > before))
        .map(|(name, now)| format!("{name}: {now:?}, was {:?}", allowed[name]))
        .collect();
    assert!(grown.is_empty(), "{}\nIf this is meant, run {BLESS}", grown.join("\n"));
}
