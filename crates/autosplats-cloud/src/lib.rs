//! Point clouds, and what works on them: joining, moving, thinning, sampling on surfaces, coordinate systems.
//!
//! This crate reads no format, draws nothing and uses no GPU. The crates of files, scenes and sources stand on it; what
//! they share is here too: errors, progress, memory, random numbers and whole files.
//!
//! ```
//! use autosplats_cloud::{PointCloud, glam::{DMat4, DVec3}};
//!
//! let wall = PointCloud::new(DVec3::ZERO, vec![[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]]);
//! let pose = DMat4::from_translation(DVec3::new(512_000.0, 5_400_000.0, 310.0));
//! let mut survey = PointCloud::merge(vec![(wall, pose)]);
//! survey.crop(DVec3::splat(0.0), DVec3::splat(1e7));
//! assert_eq!(survey.world_position(1), DVec3::new(512_000.0, 5_400_000.0, 312.0));
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod append;
mod axes;
mod bytes;
mod classes;
mod cloud;
mod clouds;
mod contents;
mod crs;
mod encoding;
mod error;
mod error_kind;
mod files;
mod filter;
mod geographic;
mod guard;
mod identity;
mod maps;
mod memory;
mod merge;
mod merged;
mod moved;
mod output;
mod pool;
mod precision;
mod progress;
mod random;
mod ranges;
mod reserve;
mod retain;
mod sample;
mod scale;
mod spill;
mod spool;
mod thin;
mod thinned;
mod tiles;
mod tree;
mod zeros;

pub use axes::Axes;
pub use bytes::{Bytes, read_small};
pub use classes::class_name;
pub use cloud::{Field, FieldValues, PointCloud, Scan};
pub use clouds::{Changed, Clouds, Held, Outline, add_scans};
pub use contents::Contents;
pub use crs::{Crs, CrsDefinition, GeoKeys, Unit};
pub use encoding::{Unmarked, read_text};
pub use error::{Error, excerpt, one_line, printable, shown_number};
pub use error_kind::ErrorKind;
pub use files::{check_disk, free_disk, is_full, read_exact_at, temporary_failed, temporary_unnamed, write_all_at};
pub use filter::{LeftOut, PointFilter};
pub use geographic::{LocalMetres, looks_like_degrees};
/// Vector library of the public interface.
pub use glam;
pub use guard::guard;
pub use memory::{available_memory, check_memory, own_memory, total_memory, usual_memory};
pub use merge::normal_matrix;
pub use merged::Merged;
pub use output::{Draft, Existing, Output, abandon_drafts, is_there, write_whole};
pub use pool::{PointPool, PointRun, SLOT_POINTS, SLOT_SHIFT};
pub use precision::{
    RelativeValues, ValueOrigin, degree_origin, residual, sample_step, sampled_bounds, sampled_middle, storage_origin,
};
pub use progress::{Part, Progress, tell_loss};
pub use random::Random;
pub use ranges::{FileRanges, Folder, LocalFolder, MemoryRanges, Ranges, Traffic, check_range};
pub use reserve::{may_fail, reserving};
pub use sample::{SurfaceSamples, sample_surface};
pub use scale::computing_scale_of;
pub use spill::{Spill, SpillCell, lock};
pub use spool::Spool;
pub use thinned::{Thinned, Thinning};
pub use tiles::{Tile, TilePoint, Tiles, sampled_median};
pub use tree::{Key, Node, NodeKey, Tree, TreeInfo, Wanted};
