//! Raw points in, a lit surface out, every frame.
//!
//! The method is Preiner, Jeschke and Wimmer, "Auto Splats: Dynamic Point Cloud Visualization on the GPU" (EGPGV 2012).
//! It needs no normals, no radii and no preprocessing: each frame reconstructs the surface from its visible points. A
//! frame has six stages. Each is a module of this crate that owns the type of its result:
//!
//! ```text
//! PointCloud --project--> ScreenPoints --search--> Neighborhoods --fit--> Surfels
//!            --adapt--> Surfels --splat--> GBuffer --shade--> Image
//! ```
//!
//! ```
//! use autosplats::{Camera, Projection, Renderer, Settings, ViewDirection, cloud::PointCloud, guess_axes};
//! # use autosplats::cloud::glam::DVec3;
//! # let grid = (0..40_000).map(|i| [(i % 200) as f32, (i / 200) as f32, ((i % 200) as f32 * 0.1).sin() * 5.0]);
//! # let cloud = PointCloud::new(DVec3::ZERO, grid.collect());
//! let size = [400, 300];
//! let projection = Projection::PerspectiveFovDeg(40.0);
//! let camera = Camera::fit(&cloud, guess_axes(&cloud), ViewDirection::Iso, 400.0 / 300.0, projection)?;
//! let mut renderer = Renderer::new();
//! let frame = renderer.render(&cloud, &camera, size, &Settings::default())?;
//! assert_eq!(frame.image.pixels.len(), 400 * 300);
//! # Ok::<(), autosplats::Error>(())
//! ```
//!
//! [`estimate_normals`] computes normal, curvature and density radius of all points of a cloud, visible or not. It uses
//! the exact nearest neighbours in space.

#![warn(clippy::print_stderr, clippy::print_stdout, reason = "they panic where the stream cannot be written")]

mod adapt;
mod camera;
mod cancel;
mod detail;
mod error;
mod fit;
mod gpu;
mod normals;
mod points;
mod project;
mod renderer;
mod room;
mod search;
mod shade;
mod simd;
mod splat;
#[cfg(test)]
mod test_clouds;

pub use autosplats_cloud as cloud;
pub use camera::{Camera, Lens, Projection, ViewDirection, guess_axes};
pub use detail::{
    Choice, Coarsest, Detail, NodePoints, PlacedTree, Shown, TreeScene, choose, choose_loading, load_nodes,
};
pub use error::{Error, MAX_SIDE};
pub use gpu::{AdapterSummary, PassTime, StageWork, adapters, device_descriptor};
pub use normals::{
    NormalSettings, Normals, NormalsInParts, Orientation, PartsOptions, Viewpoint, estimate_normals,
    estimate_normals_in_parts,
};
pub use points::Points;
pub use renderer::{
    BYTES_PER_PIXEL, Backend, Counts, Frame, PointSurfel, RadiusTrial, Reconstruction, Renderer, Settings, Timings,
    best_first_radius, shade_layers, still_supersample, usual_exposure,
};
pub use search::SearchEngine;
pub use shade::{Background, Backs, ColorMap, ColorMode, Image, Shading};
pub use splat::{GBuffer, TILE};
pub use wgpu;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
