//! Where tests find logs of real arms, which are not part of the sources. Each crate whose tests read them
//! has this file as a module.

use std::path::PathBuf;

/// A set of measured logs with its arm file; `None`, and a line that says so, where it is not at hand.
/// `POWERBALL_DATA` names the folder of all sets.
pub(crate) fn measured(set: &str) -> Option<PathBuf> {
    let folder = std::env::var_os("POWERBALL_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"), PathBuf::from)
        .join(set);
    if folder.join("arm.toml").exists() {
        return Some(folder);
    }
    println!("skipped: there are no measured logs in {}", folder.display());
    None
}
