//! What was identified, in a copy of the robot description that the arm was imported from.

use super::{Failure, output};
use dyngen::Arm;
use dyngen::export::{self, Known};
use dyngen::import::{ImportError, Options, Source};
use std::path::{Path, PathBuf};

/// A URDF or a MuJoCo model, and where its copy goes.
pub(super) struct Original {
    source: Source,
    copy: PathBuf,
}

impl Original {
    /// Reads a robot description; the copy has its name, in `folder`.
    pub(super) fn read(path: &Path, folder: &Path) -> Result<Original, Failure> {
        let source = Source::read(path).map_err(|e| Failure::Unusable(e.to_string()))?;
        let copy = folder.join(path.file_name().unwrap_or_default());
        if matches!((copy.canonicalize(), path.canonicalize()), (Ok(copy), Ok(own)) if copy == own) {
            return Err(Failure::Unusable(format!(
                "{}: --export would write over it: choose another folder for --out",
                path.display()
            )));
        }
        Ok(Original { source, copy })
    }

    /// Writes the copy with the values, friction and effects of `identified`, a result as JSON that stands in `file`.
    pub(super) fn write(&self, arm: &Arm, identified: &str, file: &Path) -> Result<(), Failure> {
        let file = file.display().to_string();
        let known = Known::read(arm, (identified, &file), Some((identified, &file)));
        let known = known.map_err(Failure::Refused)?;
        let exported = export::source(&self.source, arm, &known, &Options::default());
        let exported = exported.map_err(|e| {
            let said = format!("{e}\n{file} is written; `dyngen export` has --base, --tip and --lock");
            match e {
                ImportError::Unreadable(_) => Failure::Unusable(said),
                ImportError::Refused(_) => Failure::Refused(said),
            }
        })?;
        for note in &exported.notes {
            // Standard output may be the result as JSON.
            eprintln!("{}: note: {note}", self.source.file);
        }
        output::write_file(&self.copy, &self.source.bytes(&exported.text))
    }
}
