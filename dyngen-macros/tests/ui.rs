//! What the compiler says about a macro call that is wrong, and where.
//!
//! `DYNGEN_BLESS=1 cargo test -p dyngen-macros --test ui` accepts new messages.

#![allow(clippy::unwrap_used, clippy::panic)]

use std::path::{Path, PathBuf};
use std::process::Command;

/// The macros as they were built for this very test: their library stands next to it.
fn library() -> PathBuf {
    let own = std::env::current_exe().unwrap();
    let files = std::fs::read_dir(own.parent().unwrap()).unwrap().map(|entry| entry.unwrap().path());
    let start = format!("{}dyngen_macros-", std::env::consts::DLL_PREFIX);
    let ours = files.filter(|path| {
        let name = path.file_name().unwrap().to_string_lossy();
        name.starts_with(&start) && name.ends_with(std::env::consts::DLL_SUFFIX)
    });
    ours.max_by_key(|path| path.metadata().unwrap().modified().unwrap()).expect("the macros were built")
}

#[test]
fn errors_of_a_call_stand_where_they_belong() {
    let bless = std::env::var_os("DYNGEN_BLESS").is_some();
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut extern_macros = std::ffi::OsString::from("dyngen_macros=");
    extern_macros.push(library());
    let (mut checked, mut wrong) = (0, Vec::new());
    for entry in std::fs::read_dir(package.join("tests/ui")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "rs") {
            continue;
        }
        // Calls name the arms of `tests/arms`.
        let compiler = Command::new(std::env::var_os("RUSTC").unwrap_or("rustc".into()))
            .current_dir(package)
            .env("CARGO_MANIFEST_DIR", package.join("tests"))
            .args(["--edition", "2024", "--emit", "metadata", "--color", "never", "-o"])
            .arg(Path::new(env!("CARGO_TARGET_TMPDIR")).join("ui.rmeta"))
            .arg("--extern")
            .arg(&extern_macros)
            .arg(path.strip_prefix(package).unwrap())
            .output()
            .unwrap();
        assert!(!compiler.status.success(), "{} compiles", path.display());
        let said = String::from_utf8(compiler.stderr).unwrap();
        let said =
            said.split("error: aborting due to").next().unwrap_or_default().trim_end().to_string() + "\n";
        let golden = path.with_extension("stderr");
        if bless {
            std::fs::write(&golden, said).unwrap();
        } else if std::fs::read_to_string(&golden).unwrap_or_default() != said {
            wrong.push(format!("{}: the compiler says\n{said}", golden.display()));
        }
        checked += 1;
    }
    assert_eq!(checked, 4, "files in tests/ui");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
