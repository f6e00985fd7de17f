//! python-canopen as master of the virtual arm, as slave of `powerball bus`, over UDP multicast and over
//! slcan, and as the arm that `powerball record` moves.
//!
//! `PYTHON` names the interpreter (python3 where it is not set). Where it lacks the packages the tests say so
//! and pass, unless `REQUIRE_PYTHON` is set, as it is in `.ci/run`.

#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::panic)]

use std::process::Command;
use std::sync::{Mutex, PoisonError};

/// One after the other: Python's master and slaves have deadlines, and a busy machine lets them miss some.
static ALONE: Mutex<()> = Mutex::new(());

fn agree(kind: &str) {
    let _alone = ALONE.lock().unwrap_or_else(PoisonError::into_inner);
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_string());
    let packages = Command::new(&python).args(["-c", "import can, canopen, msgpack, serial"]).output();
    let lacking = match packages {
        Ok(output) if output.status.success() => None,
        Ok(output) => Some(String::from_utf8_lossy(&output.stderr).trim().to_string()),
        Err(e) => Some(e.to_string()),
    };
    if let Some(reason) = lacking {
        assert!(std::env::var_os("REQUIRE_PYTHON").is_none(), "{python}: {reason}");
        println!("skipped: {python}: {reason} (pip install canopen python-can msgpack pyserial)");
        return;
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/agree.py");
    let run = Command::new(&python).args([script, env!("CARGO_BIN_EXE_powerball"), kind]).output().unwrap();
    let printed =
        [run.stdout, run.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).join("\n");
    println!("{printed}");
    assert!(run.status.success(), "{printed}");
}

#[test]
fn python_canopen_agrees_over_udp_multicast() {
    agree("udp");
}

/// Six of python-canopen's own slaves follow a whole trajectory, and a failure of one of them stops all.
#[test]
fn python_canopen_is_the_arm() {
    agree("arm");
}

#[test]
fn python_canopen_agrees_over_slcan() {
    agree("slcan");
}
