//! Every fault × every mode × every phase: the arm is commanded to stop in time, no set-point leaves
//! afterwards, the cause is latched, and only an explicit act enables again. Prints the matrix that
//! `docs/results/bus_faults.md` holds:
//! `cargo test --release -p powerball --test bus_faults -- --ignored --nocapture`.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test's helpers may stop the test")]

mod faults;
mod motion;
mod pairs;
mod refusals;
mod rules;
mod walks;
mod world;

use faults::{Expected, Fault, Stage};
use powerball::bus::driver::lwa4p::LWA4P;
use powerball::bus::driver::{ControlMode, Phase, Refusal};
use world::{CYCLE, VICTIM, World};

/// For the drives to come to rest and close their brakes by themselves.
const REST: u64 = 800_000;

fn world(stage: Stage) -> World {
    let mut profile = LWA4P;
    profile.reactions.commutation_settle = 50_000;
    profile.reactions.boot_timeout = 500_000;
    World::new(stage != Stage::Commutating, profile)
}

/// One cell; what it came to, in a word for the matrix, or what is wrong.
fn cell(fault: Fault, stage: Stage, control: ControlMode) -> Result<String, String> {
    let mut world = world(stage);
    stage.reach(&mut world, control);
    let before = world.driver.cause().copied();
    let injected = world.now();
    let expected = fault.expected(stage, control);
    fault.inject(&mut world);
    let fail = |what: String| Err(what);
    match expected {
        Expected::GoesOn => {
            if stage == Stage::Ready {
                world.run(10 * CYCLE);
                world.pilot.enable = true;
            }
            let end = if matches!(stage, Stage::Stopping | Stage::Resetting) {
                Phase::Ready
            } else {
                Phase::Running
            };
            let came = world.run_until(12_000_000, |w| w.driver.phase() == end);
            world.run(200_000);
            if !came || world.driver.phase() != end {
                return fail(format!("{:?}: {:?}", world.driver.phase(), world.driver.cause()));
            }
            let from = world.now() - 100_000;
            if end == Phase::Running
                && !world.accepted.iter().any(|(at, _)| *at > from)
                && !matches!(fault, Fault::NanAgain | Fault::JumpAgain)
            {
                return fail("no set-points any more".into());
            }
            if end == Phase::Ready && world.motion_after(injected + CYCLE).is_some() {
                return fail("moves after a stop".into());
            }
            Ok("goes on".into())
        }
        Expected::Stops { cycles } => {
            // A drive that says nothing keeps the stop waiting for its time limits.
            world.run_until(4_000_000, |w| w.driver.phase() == Phase::Faulted);
            world.run(REST);
            let stops = world.quick_stops(injected);
            let Some(last) =
                stops.iter().copied().collect::<Option<Vec<_>>>().and_then(|s| s.into_iter().max())
            else {
                return fail(format!("no quick stop for some drive: {stops:?}, {:?}", world.driver.cause()));
            };
            // The last frames of the stop need their time on the wire.
            let took = (last - injected).saturating_sub(2_500).div_ceil(CYCLE);
            if took > cycles {
                return fail(format!("stopped after {took} cycles, {cycles} are allowed"));
            }
            if let Some((at, node, word)) = world.motion_after_stop(injected, last) {
                return fail(format!("node {node} is commanded to move ({word:?}) after its stop, at {at}"));
            }
            after_stop(&mut world, fault, last)?;
            latched(&mut world, fault)?;
            recovers(&mut world, fault, control)?;
            Ok(format!("stop ≤ {cycles}"))
        }
        Expected::Refused => {
            world.pilot.enable |= matches!(
                fault,
                Fault::NanAgain
                    | Fault::JumpAgain
                    | Fault::NoVoltage
                    | Fault::NotRemote
                    | Fault::InternalLimit
                    | Fault::VelocityHuge
            );
            let came = world
                .run_until(12_000_000, |w| w.driver.phase() == Phase::Faulted && w.driver.cause().is_some());
            if !came {
                return fail(format!("not refused: {:?}, {:?}", world.driver.phase(), world.driver.cause()));
            }
            let at = world.now();
            world.run(REST);
            after_stop(&mut world, fault, at)?;
            latched(&mut world, fault)?;
            recovers(&mut world, fault, control)?;
            Ok("refused".into())
        }
        Expected::Stays => {
            world.run(REST);
            let cause = world.driver.cause().copied();
            let kept = cause.is_some_and(|cause| Some(cause) == before || fault.is_reported_by(&cause));
            if world.driver.phase() != Phase::Faulted || !kept {
                return fail(format!("{:?}: {before:?} became {cause:?}", world.driver.phase()));
            }
            after_stop(&mut world, fault, injected)?;
            Ok("stays".into())
        }
        Expected::SlavesStop => {
            // The master says nothing, or nobody hears it: the drives' own watching must do.
            world.run_without_driver(REST);
            rests(&world, fault)?;
            world.run(50_000);
            world.pilot.enable = false;
            if world.driver.phase() == Phase::Running {
                return fail("the driver goes on as if nothing had been".into());
            }
            if matches!(stage, Stage::Enabling | Stage::Commutating | Stage::Running) {
                let at = world.now();
                world.run(200_000);
                after_stop(&mut world, fault, at)?;
                if world.driver.cause().is_none() {
                    return fail("nothing is latched".into());
                }
            }
            Ok("drives stop".into())
        }
    }
}

/// Nothing that moves leaves after `from`, and the arm rests with its brakes closed.
fn after_stop(world: &mut World, fault: Fault, from: u64) -> Result<(), String> {
    if let Some((at, node, word)) = world.motion_after(from) {
        return Err(format!("node {node} is commanded to move ({word:?}) {} µs after the stop", at - from));
    }
    rests(world, fault)
}

fn rests(world: &World, fault: Fault) -> Result<(), String> {
    let arm = &world.bus.peer().arm;
    for (j, node) in arm.nodes().iter().enumerate() {
        // A node that neither hears nor speaks cannot be commanded, and this one does not watch either.
        let deaf = fault == Fault::Silent && node.id() == VICTIM;
        let velocity = arm.simulation().velocity(j);
        if !deaf && (!node.brake_closed() || velocity.abs() > 1e-3) {
            return Err(format!(
                "joint {} does not rest: {velocity} rad/s, brake closed: {}",
                j + 1,
                node.brake_closed()
            ));
        }
    }
    Ok(())
}

/// The cause is reported, and nothing is enabled without an explicit act.
fn latched(world: &mut World, fault: Fault) -> Result<(), String> {
    let Some(cause) = world.driver.cause().copied() else { return Err("nothing is latched".into()) };
    if !fault.is_reported_by(&cause) {
        return Err(format!("reported is: {cause}"));
    }
    world.pilot.enable = false;
    match world.driver.enable() {
        Err(Refusal::Latched(kept)) if kept == cause => {}
        other => return Err(format!("enabling without acknowledging: {other:?}")),
    }
    let at = world.now();
    fault.repair(world);
    world.run(200_000);
    match world.motion_after(at) {
        Some(_) => Err("moves again without a command".into()),
        None => Ok(()),
    }
}

/// With the fault gone, acknowledged and enabled the arm runs again.
fn recovers(world: &mut World, fault: Fault, control: ControlMode) -> Result<(), String> {
    fault.repair(world);
    world.driver.acknowledge().map_err(|e| format!("acknowledge: {e}"))?;
    let at = world.now();
    let ready = world.run_until(5_000_000, |w| matches!(w.driver.phase(), Phase::Ready | Phase::Idle));
    if !ready {
        return Err(format!(
            "not ready after acknowledging: {:?}, {:?}",
            world.driver.phase(),
            world.driver.cause()
        ));
    }
    if world.motion_after(at).is_some() {
        return Err("acknowledging alone moves the arm".into());
    }
    if world.driver.phase() == Phase::Idle {
        world.driver.start(control, true).map_err(|e| e.to_string())?;
    }
    world.pilot.enable = true;
    match world.run_until(20_000_000, |w| w.driver.phase() == Phase::Running || w.driver.cause().is_some()) {
        true if world.driver.cause().is_none() => Ok(()),
        _ => Err(format!("does not run again: {:?}, {:?}", world.driver.phase(), world.driver.cause())),
    }
}

/// The name of each mode in what is printed.
const MODES: [&str; 4] = ["PP", "VL", "IP", "current"];

/// The matrix of faults by phases, each in the modes of `modes` by the numbers of its row and column: what it
/// came to, or what is wrong.
fn matrix(modes: impl Fn(usize, usize) -> Vec<usize>) -> Result<Vec<Vec<Vec<String>>>, String> {
    let only = std::env::var("CELL").ok();
    let mut wrong = Vec::new();
    let mut rows = Vec::new();
    for (i, (fault, name)) in Fault::ALL.into_iter().enumerate() {
        let mut row = Vec::new();
        for (j, (stage, stage_name)) in Stage::ALL.into_iter().enumerate() {
            let asked =
                only.as_ref().is_none_or(|only| format!("{fault:?}/{stage:?}").contains(only.as_str()));
            let mut results = Vec::new();
            for mode in modes(i, j).into_iter().filter(|_| asked) {
                match cell(fault, stage, ControlMode::ALL[mode]) {
                    Ok(word) => results.push(word),
                    Err(what) => {
                        wrong.push(format!("{name} × {stage_name} × {}: {what}", MODES[mode]));
                        results.push(format!("WRONG in {}", MODES[mode]));
                    }
                }
            }
            results.dedup();
            row.push(results);
        }
        rows.push(row);
    }
    if wrong.is_empty() { Ok(rows) } else { Err(format!("{} cells:\n{}", wrong.len(), wrong.join("\n"))) }
}

/// In one mode each, by turns: every fault and every phase meets every mode.
#[test]
fn every_fault_in_every_phase() {
    let rows = matrix(|i, j| vec![(i + j) % MODES.len()]).unwrap_or_else(|wrong| panic!("{wrong}"));
    let page = std::fs::read_to_string(page()).unwrap();
    let (shown, _) = page.split_once(BEGIN).unwrap().1.split_once(END).unwrap();
    assert_eq!(shown.lines().count(), 2 + rows.len());
    for (row, shown) in rows.iter().zip(shown.lines().skip(2)) {
        for (results, shown) in row.iter().zip(shown.split(" | ").skip(1)) {
            let shown = shown.trim_end_matches(" |");
            assert!(results.iter().all(|word| shown.split(", ").any(|w| w == word)), "{results:?}, {shown}");
        }
    }
}

#[test]
#[ignore = "at length: a minute and a half; the one above guards it"]
fn every_fault_in_every_mode_and_phase_at_length() {
    let rows = matrix(|_, _| (0..MODES.len()).collect()).unwrap_or_else(|wrong| panic!("{wrong}"));
    let mut table = vec![
        format!("| fault \\ phase | {} |", Stage::ALL.map(|(_, name)| name).join(" | ")),
        format!("|---|{}", "---|".repeat(Stage::ALL.len())),
    ];
    for ((_, name), row) in Fault::ALL.into_iter().zip(rows) {
        let cells: Vec<String> = row.iter().map(|results| results.join(", ")).collect();
        table.push(format!("| {name} | {} |", cells.join(" | ")));
    }
    println!("{}", table.join("\n"));
    if std::env::var_os("CELL").is_none() {
        the_page_holds(&table.join("\n"));
    }
}

/// Where `docs/results/bus_faults.md` shows the matrix.
const BEGIN: &str = "<!-- matrix -->\n";
const END: &str = "\n<!-- end of matrix -->";

fn page() -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/results/bus_faults.md")
}

/// `docs/results/bus_faults.md` shows this matrix. With `POWERBALL_BLESS` set, it is written there.
fn the_page_holds(matrix: &str) {
    let text = std::fs::read_to_string(page()).unwrap();
    let (head, rest) = text.split_once(BEGIN).unwrap();
    let (shown, tail) = rest.split_once(END).unwrap();
    if std::env::var_os("POWERBALL_BLESS").is_some() {
        std::fs::write(page(), format!("{head}{BEGIN}{matrix}{END}{tail}")).unwrap();
    } else {
        assert!(
            shown == matrix,
            "docs/results/bus_faults.md shows another matrix; run this test with POWERBALL_BLESS=1"
        );
    }
}
