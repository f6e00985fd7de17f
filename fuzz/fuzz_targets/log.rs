// Not a target: what those of logs share. Bytes are put into a file and read, or refused with a reason.

use powerball::logs::tables::read_contents;
use std::path::PathBuf;
use std::sync::OnceLock;

/// A folder of this process's own, in memory where the system has one there.
fn folder() -> &'static PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let shared = PathBuf::from("/dev/shm");
        let above = if shared.is_dir() { shared } else { std::env::temp_dir() };
        let folder = above.join(format!("powerball_fuzz_{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the file");
        folder
    })
}

/// Reads `begin`, by which a format is known, and what follows it.
pub fn read(begin: &[u8], data: &[u8]) {
    let file = folder().join("log");
    std::fs::write(&file, [begin, data].concat()).expect("a file can be written");
    if let Err(why) = read_contents(&file) {
        assert!(!why.to_string().is_empty());
    }
}
