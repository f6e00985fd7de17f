//! An FMU as its archive, with the library that the system's C compiler makes.

use super::Failure;
use powerball_explanation::fmu::Fmu;
use std::io::{Cursor, Write};
use std::path::Path;
use std::process::Command;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// The archive, and what is to be reported about it. The library is of this machine's kind; without a C
/// compiler there is none, and whoever runs the FMU compiles its sources.
pub(super) fn packed(fmu: &Fmu) -> Result<(Vec<u8>, Vec<String>), Failure> {
    let failed = |e: &dyn std::fmt::Display| Failure::Refused(format!("the FMU cannot be packed: {e}"));
    let mut notes = Vec::new();
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    // Not compressed, so that what made it can be read in it; the same model gives the same bytes.
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut put = |name: &str, bytes: &[u8]| {
        archive.start_file(name, options).map_err(|e| failed(&e))?;
        archive.write_all(bytes).map_err(|e| failed(&e))
    };
    for (name, text) in &fmu.files {
        put(name, text.as_bytes())?;
    }
    match library(fmu) {
        Ok((name, bytes)) => put(&name, &bytes)?,
        Err(why) => notes.push(format!("the FMU has no library, its sources alone: {why}")),
    }
    let archive = archive.finish().map_err(|e| failed(&e))?;
    Ok((archive.into_inner(), notes))
}

/// The folder of `binaries/` for this machine, and how its libraries end.
fn platform() -> Option<(&'static str, &'static str)> {
    match (std::env::consts::ARCH, std::env::consts::OS) {
        ("x86_64", "linux") => Some(("x86_64-linux", "so")),
        ("aarch64", "linux") => Some(("aarch64-linux", "so")),
        ("x86_64", "macos") => Some(("x86_64-darwin", "dylib")),
        ("aarch64", "macos") => Some(("aarch64-darwin", "dylib")),
        _ => None,
    }
}

/// The library's name in the archive and its bytes, or why there is none.
fn library(fmu: &Fmu) -> Result<(String, Vec<u8>), String> {
    let (folder, end) = platform().ok_or("none is made on this system")?;
    let compiler = std::env::var("CC").unwrap_or_else(|_| "cc".to_string());
    let here = tempfile::tempdir().map_err(|e| format!("no folder for it: {e}"))?;
    let name = format!("{}.{end}", fmu.identifier);
    compile(fmu, &compiler, here.path(), &name)?;
    let bytes = std::fs::read(here.path().join(&name)).map_err(|e| format!("{name} cannot be read: {e}"))?;
    Ok((format!("binaries/{folder}/{name}"), bytes))
}

fn compile(fmu: &Fmu, compiler: &str, folder: &Path, name: &str) -> Result<(), String> {
    let mut command = Command::new(compiler);
    // Sums are rounded as they are written.
    command.args([
        "-std=c99",
        "-O2",
        "-ffp-contract=off",
        "-fPIC",
        "-shared",
        "-fvisibility=hidden",
        "-o",
        name,
    ]);
    for (file, text) in
        fmu.files.iter().filter_map(|(file, text)| Some((file.strip_prefix(Fmu::SOURCES)?, text)))
    {
        std::fs::write(folder.join(file), text).map_err(|e| format!("{file} cannot be written: {e}"))?;
        if file.ends_with(".c") {
            command.arg(file);
        }
    }
    let done = command.arg("-lm").current_dir(folder).output();
    let done =
        done.map_err(|e| format!("there is no C compiler '{compiler}' ({e}); CC names another one"))?;
    match done.status.success() {
        true => Ok(()),
        false => Err(format!("'{compiler}' refused them: {}", String::from_utf8_lossy(&done.stderr).trim())),
    }
}
