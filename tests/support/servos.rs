//! The measured servo: a Feetech STS3215 on a pendulum. Each crate whose tests read its logs has this file as
//! a module.

use dyngen::{Arm, Values};
use powerball_logs::log::ServoLog;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Paths of the set.
pub(crate) const PATHS: [&str; 5] = ["brutal", "lift_and_drop", "sin_sin", "sin_time_square", "up_and_down"];
/// Masses of the set, kg, with their names in files.
pub(crate) const MASSES: [(&str, f64); 2] = [("0.535", 0.535), ("1.168", 1.1682)];
/// Lengths of the set, m, and gains.
pub(crate) const LENGTHS: [f64; 2] = [0.1, 0.15];
pub(crate) const GAINS: [u32; 3] = [8, 16, 32];

/// A pendulum of one link of a length, m, that hangs at q = 0.
pub(crate) fn pendulum(length: f64, servo: &str) -> Arm {
    let text = format!(
        "name = \"pendulum\"\nconvention = \"standard\"\ngravity = [0, -9.81, 0]\n[[joint]]\n\
        kind = \"revolute\"\na = {length}\nalpha = 0\nd = 0\ntheta = \"-pi/2\"\n[joint.servo]\n{servo}"
    );
    Arm::parse(&text, "pendulum.toml").unwrap()
}

/// A point of a mass, kg, at its end.
pub(crate) fn point(mass: f64) -> Values {
    let zero = ["mx1", "my1", "mz1", "Ixx1", "Ixy1", "Ixz1", "Iyy1", "Iyz1", "Izz1"].map(|name| (name, 0.0));
    Values::named(std::iter::once(("m1", mass)).chain(zero), "point")
}

/// A velocity after an explicit step of `h`, s, with Karnopp's stick: a joint rests while dry friction can
/// hold what drives it, N·m.
pub(crate) fn karnopp(v: f64, (drive, dry, inertia): (f64, f64, f64), h: f64) -> f64 {
    let rests = v.abs() < 1e-4;
    if rests && drive.abs() <= dry {
        return 0.0;
    }
    let way = if rests { drive.signum() } else { v.signum() };
    v + h * (drive - way * dry) / inertia
}

/// The set's logs, unpacked into a folder that goes with their last use.
pub(crate) struct Measured(PathBuf);

impl Measured {
    /// `None`, and a line that says so, where they are not at hand. `POWERBALL_DATA` names the folder of all
    /// sets.
    pub(crate) fn unpack() -> Option<Measured> {
        let folder = std::env::var_os("POWERBALL_DATA").map_or_else(
            || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
            PathBuf::from,
        );
        let archive = folder.join("sts3215.tar.xz");
        if !archive.exists() {
            println!("skipped: there is no {}", archive.display());
            return None;
        }
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let to = std::env::temp_dir().join(format!("powerball_servo_{}_{number}", std::process::id()));
        std::fs::create_dir_all(&to).unwrap();
        let unpacked = Command::new("tar").arg("xJf").arg(&archive).arg("-C").arg(&to).status();
        if !unpacked.is_ok_and(|status| status.success()) {
            println!("skipped: tar cannot unpack {}", archive.display());
            return None;
        }
        Some(Measured(to))
    }

    /// A log of a pendulum with a mass (its name), a length (m) and a gain.
    pub(crate) fn log(&self, (mass, length, kp): (&str, f64, u32), path: &str, repetition: u32) -> ServoLog {
        let name = format!("shared/m{mass}_l{:.0}_kp{kp}_{path}_{repetition}.csv", 1e3 * length);
        let arm = pendulum(length, &format!("kp = {kp}"));
        ServoLog::read(&self.0.join(name), &arm, &Default::default()).unwrap().0
    }

    /// All paths.
    pub(crate) fn logs(&self, of: (&str, f64, u32), repetition: u32) -> Vec<ServoLog> {
        PATHS.iter().map(|path| self.log(of, path, repetition)).collect()
    }
}

impl Drop for Measured {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
