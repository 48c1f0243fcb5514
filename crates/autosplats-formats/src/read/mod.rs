//! Readers of point cloud files, one module per format.
//!
//! # How it works
//!
//! A file is mapped into memory. Its format is recognised by its first bytes, then by its extension. Most formats end
//! in the same shape, a [`table`]: named columns of numbers at fixed strides. Positions, colours and fields are taken
//! from the table in parallel. Binary PLY and PCD already are such a table in the file; their text and lists are packed
//! into a table first. Bare text, whose files can be the largest, is parsed straight into the columns of a cloud. LAS
//! has columns of bits and integer coordinates and makes its cloud itself.
//!
//! A file is not trusted: the claims of its header are checked against its size before anything is allocated.

mod body;
mod choose;
mod columns;
mod cuts;
mod depth_image;
mod describe;
mod e57;
pub mod framing;
mod gltf;
mod grid;
mod job;
pub(crate) mod las;
mod lines;
mod mesh;
mod names;
mod obj;
mod off;
mod opened;
mod options;
mod parts;
mod pcd;
mod pieces;
mod placed;
mod ply;
mod ptx;
mod raw;
mod records;
mod registry;
mod sensor;
mod stl;
pub mod table;
mod text;
pub(crate) mod units;
mod unpack;
mod xyz;

use self::job::{Format, Job, MAX_HEADER_LINE};
pub use self::{
    columns::check_columns,
    describe::{Attribute, Description},
    opened::Unpacking,
    options::ReadOptions,
    parts::{Parts, open_parts, open_parts_of, open_parts_unpacked},
    registry::{
        check_not_lfs_pointer, describe, describe_bytes, files_beside, formats, gltf_animation, is_named_as_points,
        read, read_bytes, read_gltf_at, read_marked, read_mesh, read_mesh_bytes, read_with,
    },
};
