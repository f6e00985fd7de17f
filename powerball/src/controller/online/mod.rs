//! Least squares that runs along, for controllers: no allocation, no clock, constant time for each row.

mod square_root;

pub use square_root::SquareRoot;
