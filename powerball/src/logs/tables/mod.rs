//! What is in a file: tables of named columns, whatever the format, before anybody says what they mean.

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
pub(crate) mod layouts;
#[cfg(feature = "parquet")]
mod lerobot;
#[cfg(feature = "mat")]
mod mat;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "mcap")]
mod mcap_out;
#[cfg(feature = "topics")]
mod messages;
#[cfg(feature = "npz")]
mod npz;
#[cfg(feature = "parquet")]
mod numbers;
mod place;
#[cfg(feature = "mcap")]
mod protobuf;
#[cfg(feature = "remote")]
mod remote;
#[cfg(feature = "rosbag")]
mod rosbag;
#[cfg(feature = "topics")]
mod schema;
mod table;
pub(crate) mod text;

pub use contents::{Contents, Finding, Format, LogError, read_contents};
pub(crate) use contents::{read_dataset, read_topics};
#[cfg(feature = "mcap")]
pub(crate) use mcap_out::from_csv as mcap_from_csv;
#[cfg(feature = "mcap")]
pub use mcap_out::{Channel, JointState, McapWriter};
pub(crate) use place::Place;
pub use table::{Column, Table};
pub(crate) use table::{RowSink, make_room};
