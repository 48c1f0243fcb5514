//! How a picture is taken: camera, surface and look.

use std::path::PathBuf;

use autosplats::{Background, ColorMode, Reconstruction, Shading};
use autosplats_cloud::glam::DVec3;
use clap::Args;

use crate::choices::{AxesChoice, Backend, BacksChoice, Engine, Map, Side};
use crate::first_radius::FirstRadius;
use crate::values::{self, Neighbors, Ortho};

#[derive(Args, Debug)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Side to look from, so that everything is in the picture but far outliers [default: iso, from the front, right and above;
    /// but points in a camera's frame as that camera saw them, and those around a sensor from close behind it, both in
    /// perspective alone; and those that sensors saw from one side from there]
    #[arg(long, value_enum, conflicts_with_all = ["eye", "camera"])]
    pub(crate) view: Option<Side>,
    /// Position of the eye in world coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, conflicts_with = "camera")]
    pub(crate) eye: Option<DVec3>,
    /// Point in the middle of the picture [default: the middle of the cloud]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, requires = "eye")]
    pub(crate) look_at: Option<DVec3>,
    /// Direction that is upward in the picture [default: by --axes]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, requires = "eye")]
    pub(crate) up: Option<DVec3>,
    /// Vertical field of view in degrees [default: 40]
    #[arg(long, value_name = "DEGREES", value_parser = values::fov, allow_negative_numbers = true, conflicts_with_all = ["ortho", "camera"])]
    pub(crate) fov: Option<f64>,
    /// Orthographic picture, so many world units high; 'fit' shows everything
    #[arg(long, value_name = "HEIGHT", value_parser = values::ortho, allow_negative_numbers = true, conflicts_with = "camera")]
    pub(crate) ortho: Option<Ortho>,
    /// Take the camera from a file that --save-camera wrote
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: Option<PathBuf>,
    /// Write the camera of this picture as JSON
    #[arg(long, value_name = "FILE")]
    pub(crate) save_camera: Option<PathBuf>,
    /// Which way is up in the input; 'auto' goes by the file and its shape
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) axes: AxesChoice,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Surface")]
pub(crate) struct SurfaceArgs {
    /// Neighbours of each point that its splat is made from, 1 to 64; more is smoother. 'auto' takes 10, and more, up to
    /// thousands, where points scatter about the surface, and shows points on no surface as dots or not at all
    #[arg(short, value_name = "COUNT|auto", default_value = "auto", allow_negative_numbers = true)]
    pub(crate) k: Neighbors,
    /// Points that a pixel keeps, 1 or 2: 2 show outlines, thin parts and dense scans more truly. The engine
    /// splat-communication and graphics devices with little room keep 1
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().points_per_pixel,
        allow_negative_numbers = true
    )]
    pub(crate) points_per_pixel: u32,
    /// How the neighbours are found
    #[arg(long, value_enum, default_value = "screen-grid")]
    pub(crate) engine: Engine,
    /// Radius within which the kd-tree looks for a point's neighbours, in the input's units; 'best' tries several and takes
    /// the fastest that finds 99.9 % of the visible points' neighbourhoods, and keeps the first frame's for all frames
    #[arg(long, value_name = "RADIUS|best", default_value = "best", allow_negative_numbers = true)]
    pub(crate) first_radius: FirstRadius,
    /// What renders; the picture is the same but for rounding
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) backend: Backend,
    /// Expansions of its first search radius after which a point without a neighbour is dropped as an outlier, 0 to 8
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().outlier_expansions.unwrap_or_default(),
        allow_negative_numbers = true,
        conflicts_with = "keep_outliers"
    )]
    pub(crate) e0: u32,
    /// Keep points that have no neighbour, or are no part of a surface
    #[arg(long)]
    pub(crate) keep_outliers: bool,
    /// Above 1; less keeps narrower gaps open. A point's neighbours end where the next one is further away than all so far times
    /// the square root of this, or with '-k auto', as long as there is but one, times this
    #[arg(
        long,
        value_name = "FACTOR",
        default_value_t = Reconstruction::default().gap_factor.unwrap_or_default(),
        allow_negative_numbers = true,
        conflicts_with = "bridge_gaps"
    )]
    pub(crate) gap_factor: f32,
    /// Look for all k neighbours across any gap
    #[arg(long)]
    pub(crate) bridge_gaps: bool,
    /// Factor on the size of every splat, 0.01 to 10
    #[arg(long, value_name = "FACTOR", default_value_t = Reconstruction::default().splat_scale, allow_negative_numbers = true)]
    pub(crate) splat_scale: f32,
    /// Draw ellipses that follow the spread of the neighbours, instead of circles; with '-k auto' rows of points are
    /// ellipses in any case, and what is fitted to noise is circles
    #[arg(long)]
    pub(crate) ellipses: bool,
    /// Average surfaces over about so many frames, 1 to 32, where points are new and noisy in each; what moves slowly lags
    /// behind. Points that are the same in each frame are averaged each by itself
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().frames_averaged,
        allow_negative_numbers = true
    )]
    pub(crate) frames_averaged: u32,
    /// Reconstruct hidden points too
    #[arg(long)]
    pub(crate) no_grid_culling: bool,
    /// Let the splats of hidden points take part in the depth of the visible surface
    #[arg(long)]
    pub(crate) no_depth_refinement: bool,
    /// Leave splats whole at silhouettes, which makes these too wide by as much as splats are
    #[arg(long)]
    pub(crate) no_trim: bool,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Look")]
pub(crate) struct LookArgs {
    /// auto, rgb, plain, height, intensity, classification, normal, curvature, radius, k-radius, depth, or the name
    /// of a field of the file (field:NAME if it is called like one of these)
    #[arg(long, value_name = "MODE", default_value = "auto", value_parser = values::color)]
    pub(crate) color: ColorMode,
    /// Values at the two ends of the colour map [default: 1st and 99th percentile of the picture]
    #[arg(long, value_name = "A..B", value_parser = values::range, allow_hyphen_values = true)]
    pub(crate) range: Option<[f32; 2]>,
    /// Colours of scalar values [default: reds for radii, gray for intensity, viridis for the rest]
    #[arg(long, value_enum)]
    pub(crate) color_map: Option<Map>,
    /// Draw the colour map and its range into the picture
    #[arg(long)]
    pub(crate) legend: bool,
    /// Show colours as they are, without light
    #[arg(long)]
    pub(crate) no_lighting: bool,
    /// How many times as bright the points' own colours are shown where they are lit, 0.01 to 100 [default: 1, and up to 8 where
    /// all are dark, which the first picture decides for those that follow]
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub(crate) exposure: Option<f32>,
    /// Strength of occlusion, the darkening of creases and of what lies behind something, 0 (off) to 10
    #[arg(long, alias = "eye-dome", value_name = "STRENGTH", default_value_t = Shading::default().occlusion, allow_negative_numbers = true)]
    pub(crate) occlusion: f32,
    /// How the side of a surface is shown that its sensor did not see, where the file says where that stood
    #[arg(long, value_enum, default_value_t = BacksChoice::Toned)]
    pub(crate) backs: BacksChoice,
    /// '#rrggbb', '#top,#bottom' or transparent [default: dark grey gradient]
    #[arg(long, value_name = "COLOR", value_parser = values::background)]
    pub(crate) background: Option<Background>,
}
