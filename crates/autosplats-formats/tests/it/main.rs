//! The tests of the public interface, in one program, since every program is linked with all dependencies.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

mod choosing;
mod color_scales;
mod common;
mod copc;
mod copc_writing;
mod depth_images;
mod e57;
mod e57_faults;
mod ept;
mod field_text;
mod formats;
mod gltf;
mod hostile;
mod interop;
mod las;
mod las_faults;
mod las_writing;
mod losses;
mod meshes;
mod oddities;
mod parts;
mod potree;
mod progress;
mod ptx;
mod real_files;
mod sensors;
mod text;
mod tree_parts;
mod units;
mod written_in_parts;
