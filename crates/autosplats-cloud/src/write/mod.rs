//! Point clouds to files.

mod ply;

pub use ply::write_ply;
