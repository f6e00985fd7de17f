//! Generation from a build script.

use crate::arm::Arm;
use crate::diagnostic::Diagnostics;
use crate::dynamics::Function;
use crate::emit::{self, FrictionTerm, Options};
use crate::model::{Error, Model};
use crate::parameters::SetKind;
use crate::values::Values;
use std::fmt;
use std::path::{Path, PathBuf};

/// What to generate from an arm file.
///
/// ```no_run
/// // build.rs
/// dyngen::Config::new("arm.toml").build("arm.rs").unwrap_or_else(|e| e.exit());
/// ```
///
/// and in the crate: `mod arm { include!(concat!(env!("OUT_DIR"), "/arm.rs")); }`
#[derive(Clone, Debug)]
pub struct Config {
    arm: PathBuf,
    values: Option<PathBuf>,
    options: Options,
}

/// Why nothing was generated.
#[derive(Debug)]
pub enum GenerateError {
    /// The arm file or the file of values is wrong.
    Arm(Diagnostics),
    /// The arm's model is not to be had.
    Model(Error),
    /// A file could not be written, or the build script's environment is not there.
    Write(PathBuf, std::io::Error),
}

impl fmt::Display for GenerateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GenerateError::Arm(e) => e.fmt(f),
            GenerateError::Model(e) => e.fmt(f),
            GenerateError::Write(path, e) => write!(f, "{}: cannot be written: {e}", path.display()),
        }
    }
}

impl std::error::Error for GenerateError {}

impl GenerateError {
    /// Prints every error as cargo shows it, and ends the build script.
    pub fn exit(self) -> ! {
        for line in self.to_string().lines() {
            println!("cargo::error={line}");
        }
        std::process::exit(1)
    }
}

impl Config {
    /// Generation of the minimal set and every function from an arm file.
    pub fn new(arm: impl Into<PathBuf>) -> Self {
        Config { arm: arm.into(), values: None, options: Options::default() }
    }

    /// Chooses the parameter set.
    #[must_use]
    pub fn parameters(mut self, set: SetKind) -> Self {
        self.options.parameters = set;
        self
    }

    /// Chooses the functions.
    #[must_use]
    pub fn functions(mut self, functions: impl Into<Vec<Function>>) -> Self {
        self.options.functions = functions.into();
        self
    }

    /// Bakes parameter values in: a JSON file `{"parameter": number, …}` by the set's names or the arm's.
    #[must_use]
    pub fn values(mut self, file: impl Into<PathBuf>) -> Self {
        self.values = Some(file.into());
        self
    }

    /// Adds columns for friction: `friction_columns(dq)` and `friction(dq, coefficients)`.
    #[must_use]
    pub fn friction(mut self, terms: impl Into<Vec<FrictionTerm>>) -> Self {
        self.options.friction = terms.into();
        self
    }

    /// Emits the module `batch` too: the functions over blocks of samples, for the processor's vectors.
    #[must_use]
    pub fn batch(mut self, batch: bool) -> Self {
        self.options.batch = batch;
        self
    }

    /// Emits the arm's own consistency tests, in a `#[cfg(test)]` module.
    #[must_use]
    pub fn tests(mut self, tests: bool) -> Self {
        self.options.tests = tests;
        self
    }

    /// The generated source text.
    ///
    /// # Errors
    /// Everything that is wrong with the arm file, or what could not be proven.
    pub fn source(&self) -> Result<String, GenerateError> {
        let arm = Arm::read(&self.arm).map_err(GenerateError::Arm)?;
        let mut options = self.options.clone();
        let model = match self.values {
            Some(_) => Model::derive(arm),
            None => options.model(arm),
        };
        let model = model.map_err(GenerateError::Model)?;
        if let Some(file) = &self.values {
            let set = model.set(options.parameters).map_err(GenerateError::Model)?;
            let values = Values::read(file).and_then(|v| v.of_set(&model, set));
            options.values = Some(values.map_err(GenerateError::Arm)?);
        }
        emit::source(&model, &options).map_err(GenerateError::Model)
    }

    /// Writes the generated file; a file that is there already is replaced as a whole or not at all.
    ///
    /// # Errors
    /// As [`Config::source`], and where the file cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), GenerateError> {
        let source = self.source()?;
        let partial = file.with_extension("rs.partial");
        let written = std::fs::write(&partial, source).and_then(|()| std::fs::rename(&partial, file));
        written.map_err(|e| GenerateError::Write(file.to_path_buf(), e))
    }

    /// From a build script: writes `name` into `OUT_DIR` and tells cargo when to run again.
    ///
    /// # Errors
    /// As [`Config::write`].
    pub fn build(&self, name: &str) -> Result<(), GenerateError> {
        for file in std::iter::once(&self.arm).chain(&self.values) {
            println!("cargo::rerun-if-changed={}", file.display());
        }
        let missing = || std::io::Error::other("OUT_DIR is not set: call this from a build script");
        let folder =
            std::env::var_os("OUT_DIR").ok_or_else(|| GenerateError::Write(name.into(), missing()))?;
        self.write(&Path::new(&folder).join(name))
    }
}
