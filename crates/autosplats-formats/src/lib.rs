//! Files of points: reading, describing and writing them in all formats.
//!
//! Formats are recognised by content. Nothing that a file claims is trusted before it is checked.
//!
//! ```
//! use autosplats_formats::{read, write};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = |name| folder.path().join(name);
//! std::fs::write(path("survey.csv"), "x,y,z,Intensity\n512000.5,5400000.25,310.0,7\n")?;
//! let cloud = read(&path("survey.csv"), &())?;
//! assert_eq!(cloud.world_position(0).y, 5_400_000.25);
//! write(&cloud, &path("survey.ply"), &())?;
//! # Ok(())
//! # }
//! ```

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod color_scale;
mod las;
mod parts;
mod pinhole;
mod read;
mod tree;
mod write;

pub use pinhole::{DepthCamera, PinholeCamera};
pub use read::{
    Attribute, Description, Parts, ReadOptions, Unpacking, check_columns, check_not_lfs_pointer, describe,
    describe_bytes, files_beside, formats, framing, gltf_animation, is_named_as_points, open_parts, open_parts_of,
    open_parts_unpacked, read, read_bytes, read_gltf_at, read_marked, read_mesh, read_mesh_bytes, read_with, table,
};
pub use tree::{
    Part, TREE_FILES, describe_tree, is_tree_file, open_folder_tree, open_tree, open_tree_in, read_part, tree_file,
};
pub use write::{
    TreeInput, TreeOptions, TreeSummary, check_writable, write, write_clouds, write_tree, written_formats,
};
