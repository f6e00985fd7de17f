//! Procedural macros over dyngen.
