//! The content of a file: tables of named columns, whatever the format, before the columns get a meaning.

#[cfg(any(feature = "npz", feature = "mat", feature = "hdf5"))]
mod arrays;
#[cfg(feature = "topics")]
mod bag;
#[cfg(feature = "bag1")]
mod bag1;
#[cfg(feature = "topics")]
mod cdr;
pub(crate) mod columnar;
mod contents;
#[cfg(feature = "dates")]
mod dates;
#[cfg(feature = "hdf5")]
mod hdf5;
#[cfg(feature = "mcap")]
pub mod layouts;
#[cfg(feature = "parquet")]
mod lerobot;
#[cfg(feature = "mat")]
mod mat;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "mcap")]
mod mcap_out;
mod memory;
#[cfg(feature = "topics")]
mod messages;
#[cfg(feature = "npz")]
mod npz;
#[cfg(feature = "parquet")]
mod numbers;
mod place;
#[cfg(feature = "protobuf")]
mod protobuf;
#[cfg(feature = "remote")]
mod remote;
#[cfg(feature = "rosbag")]
mod rosbag;
#[cfg(feature = "topics")]
mod schema;
mod table;
pub(crate) mod text;

/// Message for a format that this build leaves out; the command has few formats, which keeps it quick to
/// build.
#[allow(dead_code, reason = "a build with every format does not use it")]
pub(crate) const NOT_READ: &str =
    "this build does not read it: build with `--features formats`, which reads every format";
/// Like [`NOT_READ`], for a file that is to be written.
#[allow(dead_code, reason = "a build with every format does not use it")]
pub(crate) const NOT_WRITTEN: &str =
    "this build does not write it: build with `--features formats`, or name a .csv";

pub use contents::{Contents, Finding, Format, LogError, read_contents};
pub(crate) use contents::{read_dataset, read_topics};
#[cfg(feature = "mcap")]
pub(crate) use mcap_out::from_csv as mcap_from_csv;
#[cfg(feature = "mcap")]
pub use mcap_out::{Channel, JointState, McapWriter};
pub use memory::allow_memory;
pub(crate) use place::Place;
pub use place::is_address;
pub use table::{Column, Table};
pub(crate) use table::{RowSink, make_room};
pub use text::number;
