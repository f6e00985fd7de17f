//! What is in a file: tables of named columns, whatever the format, before anybody says what they mean.

#[cfg(any(feature = "npz", feature = "mat"))]
mod arrays;
#[cfg(any(feature = "mcap", feature = "rosbag"))]
mod cdr;
pub(crate) mod columnar;
mod contents;
#[cfg(feature = "parquet")]
mod lists;
#[cfg(feature = "mat")]
mod mat;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "mcap")]
mod mcap_out;
#[cfg(any(feature = "mcap", feature = "rosbag"))]
mod messages;
#[cfg(feature = "npz")]
mod npz;
#[cfg(feature = "rosbag")]
mod rosbag;
#[cfg(feature = "rosbag")]
mod sqlite;
mod table;
pub(crate) mod text;
#[cfg(feature = "parquet")]
mod zstd_pages;

pub(crate) use contents::read_topics;
pub use contents::{Contents, Finding, Format, LogError, read_contents};
#[cfg(feature = "mcap")]
pub(crate) use mcap_out::from_csv as mcap_from_csv;
#[cfg(feature = "mcap")]
pub use mcap_out::{Channel, JointState, McapWriter};
pub(crate) use table::RowSink;
pub use table::{Column, Table};
