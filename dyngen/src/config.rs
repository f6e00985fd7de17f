//! Generation from a build script.

use crate::Language;
use crate::arm::Arm;
use crate::consistency;
use crate::diagnostic::Diagnostics;
use crate::dynamics::Function;
use crate::emit::{self, CFiles, FrictionTerm, Options};
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
    language: Language,
    options: Options,
}

/// Why nothing was generated.
#[derive(Debug)]
pub enum GenerateError {
    /// The arm file or the file of values is wrong.
    Arm(Diagnostics),
    /// The arm's model is not to be had.
    Model(Error),
    /// The language does not have the requested item.
    Language(String),
    /// A file could not be written, or the build script's environment is not there.
    Write(PathBuf, std::io::Error),
}

impl fmt::Display for GenerateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            GenerateError::Arm(e) => e.fmt(f),
            GenerateError::Model(e) => e.fmt(f),
            GenerateError::Language(why) => f.write_str(why),
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
        Config { arm: arm.into(), values: None, language: Language::Rust, options: Options::default() }
    }

    /// Chooses the language.
    #[must_use]
    pub fn language(mut self, language: Language) -> Self {
        self.language = language;
        self
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

    /// Lets sums take products in: a·b + c is one operation that rounds once, on processors that have it.
    /// Bits are then no longer those of every machine.
    #[must_use]
    pub fn contract(mut self, contract: bool) -> Self {
        self.options.contract = contract;
        self
    }

    /// The generated source text; in C that of the `.c`, which includes the arm file's name with `.h`.
    ///
    /// # Errors
    /// Everything that is wrong with the arm file, or what could not be proven.
    pub fn source(&self) -> Result<String, GenerateError> {
        let texts = self.texts(&self.arm.with_extension(self.language.extension()))?;
        Ok(texts.into_iter().next().map(|(_, text)| text).unwrap_or_default())
    }

    /// The files that [`Config::write`] writes, with their texts: `file`, and in C the header of the same
    /// name.
    ///
    /// # Errors
    /// Those of [`Config::source`].
    pub fn texts(&self, file: &Path) -> Result<Vec<(PathBuf, String)>, GenerateError> {
        let files = self.files(file)?;
        let (model, options) = self.model()?;
        let texts = match self.language {
            Language::Rust => emit::source(&model, &options).map(|source| vec![source]),
            Language::C => {
                let header = file.with_extension("h");
                let header = header.file_name().unwrap_or_default().to_string_lossy();
                let files = emit::c_files(&model, &options, &header);
                files.map(|CFiles { header, source }| vec![source, header])
            }
            Language::Cuda => emit::cuda_source(&model, &options).map(|source| vec![source]),
            Language::Wgsl => emit::wgsl_source(&model, &options).map(|source| vec![source]),
        };
        Ok(files.into_iter().zip(texts.map_err(GenerateError::Model)?).collect())
    }

    /// The model, and the options with the values.
    fn model(&self) -> Result<(Model, Options), GenerateError> {
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
        Ok((model, options))
    }

    /// The reasons why no real arm can have the values that are baked in; empty if there are none, or if one
    /// can.
    ///
    /// # Errors
    /// Those of [`Config::source`].
    pub fn warnings(&self) -> Result<Vec<String>, GenerateError> {
        let Some(file) = &self.values else { return Ok(Vec::new()) };
        let (model, options) = self.model()?;
        let values = options.values.unwrap_or_default();
        let found = consistency::check(&model, options.parameters, &values).map_err(GenerateError::Model)?;
        Ok(found.warnings(file))
    }

    /// `file`, and in C its header.
    ///
    /// # Errors
    /// What the language does not have.
    pub fn files(&self, file: &Path) -> Result<Vec<PathBuf>, GenerateError> {
        let language = self.language;
        let only_in = |others: &str, what: &str| {
            let message = format!("{what}: only in {others}; leave it out for {language}");
            Err(GenerateError::Language(message))
        };
        let has_header = language == Language::C;
        match language {
            Language::Rust => return Ok(vec![file.to_path_buf()]),
            _ if self.options.batch => return only_in("Rust", "batch (functions over blocks of samples)"),
            _ if self.options.tests => return only_in("Rust", "tests (the arm's own consistency tests)"),
            Language::Wgsl if !self.options.friction.is_empty() => {
                return only_in("Rust, C and CUDA", "friction (columns of the joints' friction)");
            }
            _ if Language::of(file) == language => {}
            _ => {
                let header = if has_header { ", and its header, written next to it, in .h" } else { "" };
                return Err(GenerateError::Language(format!(
                    "{}: a file in {language} ends in .{}{header}",
                    file.display(),
                    language.extension()
                )));
            }
        }
        let header = has_header.then(|| file.with_extension("h"));
        Ok(std::iter::once(file.to_path_buf()).chain(header).collect())
    }

    /// Writes the generated file, in C with its header; a file that is there already is replaced as a whole
    /// or not at all.
    ///
    /// # Errors
    /// Those of [`Config::source`], and where a file cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), GenerateError> {
        for (file, text) in self.texts(file)? {
            let mut partial = file.clone().into_os_string();
            partial.push(".partial");
            let written = std::fs::write(&partial, text).and_then(|()| std::fs::rename(&partial, &file));
            written.map_err(|e| GenerateError::Write(file, e))?;
        }
        Ok(())
    }

    /// For a build script: writes `name` into `OUT_DIR`, and sets when cargo runs it again.
    ///
    /// # Errors
    /// Those of [`Config::write`].
    pub fn build(&self, name: &str) -> Result<(), GenerateError> {
        for file in std::iter::once(&self.arm).chain(&self.values) {
            println!("cargo::rerun-if-changed={}", file.display());
        }
        self.warnings()?.iter().for_each(|warning| println!("cargo::warning={warning}"));
        let missing = || std::io::Error::other("OUT_DIR is not set: call this from a build script");
        let folder =
            std::env::var_os("OUT_DIR").ok_or_else(|| GenerateError::Write(name.into(), missing()))?;
        self.write(&Path::new(&folder).join(name))
    }
}
