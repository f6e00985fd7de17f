//! The languages of generated code.

use std::fmt;
use std::path::Path;

/// The language of generated code.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Language {
    /// `no_std`, generic over the scalar.
    #[default]
    Rust,
    /// C99, `double` or `float`: a source file and its header.
    C,
    /// CUDA, `double` or `float`: the functions in C for a GPU's threads, each with a kernel over many
    /// states.
    Cuda,
    /// WGSL, the language of WebGPU, `f32`: functions, each with an entry point over many states.
    Wgsl,
}

impl Language {
    /// The extension of its files.
    #[must_use]
    pub fn extension(self) -> &'static str {
        match self {
            Language::Rust => "rs",
            Language::C => "c",
            Language::Cuda => "cu",
            Language::Wgsl => "wgsl",
        }
    }

    /// The language of a file, by its name; Rust where that ends in something else.
    #[must_use]
    pub fn of(file: &Path) -> Language {
        let named = |language: &Language| file.extension().is_some_and(|e| e == language.extension());
        [Language::C, Language::Cuda, Language::Wgsl].into_iter().find(named).unwrap_or_default()
    }
}

impl fmt::Display for Language {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Language::Rust => "Rust",
            Language::C => "C",
            Language::Cuda => "CUDA",
            Language::Wgsl => "WGSL",
        })
    }
}
