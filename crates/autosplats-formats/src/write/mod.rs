//! Writers of point cloud files, one module per format.
//!
//! # How it works
//!
//! A file appears complete or not at all. It is written under a temporary name in the same folder, then renamed, which
//! replaces an existing file; on failure the temporary file is removed. What a format cannot hold is reported by
//! [`Progress::note`], once per kind of loss.

mod colors;
mod copc;
mod decimal;
mod e57;
mod facts;
mod job;
mod las;
mod names;
mod pcd;
mod ply;
mod records;
mod registry;
mod xyz;

pub use self::copc::{TreeInput, TreeOptions, TreeSummary, write_tree};
use self::job::{Format, Job};
pub use self::registry::{check_writable, write, write_clouds, written_formats};
