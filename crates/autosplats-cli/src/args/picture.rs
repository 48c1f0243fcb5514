//! Options of a picture: camera, surface and look.

use std::path::PathBuf;

use autosplats::{Background, ColorMode, Reconstruction, Shading};
use autosplats_cloud::glam::DVec3;
use clap::Args;

use crate::choices::{AxesChoice, Backend, BacksChoice, Engine, Map, Side};
use crate::values::{self, FirstRadius, Neighbors, Ortho};

#[derive(Args, Debug)]
#[command(next_help_heading = "Camera")]
pub(crate) struct CameraArgs {
    /// Side to look from, with all points but far outliers in the picture [default: the camera's own view for depth
    /// images, just behind the sensor for sweeps, else the side that sensors saw, else iso]
    #[arg(long, value_enum, conflicts_with_all = ["eye", "camera"])]
    pub(crate) view: Option<Side>,
    /// Position of the eye in world coordinates
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, conflicts_with = "camera")]
    pub(crate) eye: Option<DVec3>,
    /// Point at the centre of the picture, in world coordinates [default: the middle of the cloud]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, requires = "eye")]
    pub(crate) look_at: Option<DVec3>,
    /// Direction that points up in the picture [default: the up axis of --axes]
    #[arg(long, value_name = "X,Y,Z", value_parser = values::vector, allow_hyphen_values = true, requires = "eye")]
    pub(crate) up: Option<DVec3>,
    /// Vertical field of view in degrees, 0.01 to 170 [default: 40]
    #[arg(long, value_name = "DEGREES", value_parser = values::fov, allow_negative_numbers = true, conflicts_with_all = ["ortho", "camera"])]
    pub(crate) fov: Option<f64>,
    /// Orthographic projection, HEIGHT world units high; 'fit' shows everything
    #[arg(long, value_name = "HEIGHT", value_parser = values::ortho, allow_negative_numbers = true, conflicts_with = "camera")]
    pub(crate) ortho: Option<Ortho>,
    /// Read the camera from a file that --save-camera wrote, or from Open3D's JSON of a camera with an extrinsic
    #[arg(long, value_name = "FILE")]
    pub(crate) camera: Option<PathBuf>,
    /// Write the camera of this picture to a JSON file, for --camera
    #[arg(long, value_name = "FILE")]
    pub(crate) save_camera: Option<PathBuf>,
    /// Up axis of the input; 'auto' takes it from the file or guesses it from the shape
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) axes: AxesChoice,
}

/// Which neighbours a splat is made from, and how they are found.
#[derive(Args, Debug)]
#[command(next_help_heading = "Surface")]
pub(crate) struct NeighborArgs {
    /// Number of neighbours that each splat is made from, 1 to 64; more is smoother. 'auto' takes 10, up to thousands
    /// where points are noisy, and turns outliers into dots or drops them
    #[arg(short, value_name = "COUNT|auto", default_value = "auto", allow_negative_numbers = true)]
    pub(crate) k: Neighbors,
    /// Number of points that a pixel keeps, 1 or 2; 2 preserves outlines, thin parts and dense scans. 1 with engines of
    /// splat communication and on devices with little memory
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().points_per_pixel,
        allow_negative_numbers = true
    )]
    pub(crate) points_per_pixel: u32,
    /// Algorithm that finds the neighbours
    #[arg(long, value_enum, default_value = "screen-grid")]
    pub(crate) engine: Engine,
    /// First search radius of the engine kd-tree, in the input's units. 'best' takes the fastest that finds 99.9 % of
    /// the visible points' neighbourhoods, and keeps it for all frames
    #[arg(long, value_name = "RADIUS|best", default_value = "best", allow_negative_numbers = true)]
    pub(crate) first_radius: FirstRadius,
}

impl NeighborArgs {
    /// Puts the options into the settings.
    pub(crate) fn set(&self, reconstruction: &mut Reconstruction) {
        (reconstruction.k, reconstruction.adaptive) = self.k.settings();
        reconstruction.points_per_pixel = self.points_per_pixel;
        reconstruction.engine = self.engine.with_first_radius(self.first_radius);
    }
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Surface")]
pub(crate) struct SurfaceArgs {
    #[command(flatten)]
    pub(crate) neighbors: NeighborArgs,
    /// Device that renders; pictures are the same except for rounding
    #[arg(long, value_enum, default_value = "auto")]
    pub(crate) backend: Backend,
    /// Graphics device that renders, by its number or its place on the PCI bus, as 'autosplats doctor' lists them
    #[arg(long, value_name = "NUMBER|BUS")]
    pub(crate) device: Option<String>,
    /// Number of expansions of the search radius, 0 to 8, before a point without neighbours is dropped as an outlier
    #[arg(
        long,
        value_name = "COUNT",
        default_value_t = Reconstruction::default().outlier_expansions.unwrap_or_default(),
        allow_negative_numbers = true,
        conflicts_with = "keep_outliers"
    )]
    pub(crate) e0: u32,
    /// Keep outliers: points without neighbours or on no surface
    #[arg(long)]
    pub(crate) keep_outliers: bool,
    /// Growth of the search circle's area that counts as a gap and ends a neighbourhood, above 1; less keeps narrower
    /// gaps open. With '-k auto' a single neighbour allows the square of it
    #[arg(
        long,
        value_name = "FACTOR",
        value_parser = values::gap_factor,
        default_value_t = Reconstruction::default().gap_factor.unwrap_or_default(),
        allow_negative_numbers = true,
        conflicts_with = "bridge_gaps"
    )]
    pub(crate) gap_factor: f32,
    /// Search all k neighbours across any gap
    #[arg(long)]
    pub(crate) bridge_gaps: bool,
    /// Factor on the radius of every splat, 0.01 to 10
    #[arg(long, value_name = "FACTOR", default_value_t = Reconstruction::default().splat_scale, allow_negative_numbers = true)]
    pub(crate) splat_scale: f32,
    /// Draw splats as ellipses along the spread of the neighbours instead of circles. With '-k auto' scan lines always
    /// get ellipses and noisy surfaces circles
    #[arg(long)]
    pub(crate) ellipses: bool,
    /// Average surfaces over about COUNT frames, 1 to 32, if each frame has new, noisy points; slow motion lags behind.
    /// Points that stay the same are averaged one by one
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
    /// Let splats of hidden points influence the depth of the visible surface
    #[arg(long)]
    pub(crate) no_depth_refinement: bool,
    /// Do not trim splats at silhouettes, which become too wide by the width of the splats
    #[arg(long)]
    pub(crate) no_trim: bool,
}

#[derive(Args, Debug)]
#[command(next_help_heading = "Look")]
pub(crate) struct LookArgs {
    /// auto, rgb, plain, height, intensity, classification, normal, curvature, radius, k-radius, depth, or the name of
    /// a field (field:NAME if a mode has the same name)
    #[arg(long, value_name = "MODE", default_value = "auto", allow_hyphen_values = true)]
    pub(crate) color: ColorMode,
    /// Values at both ends of the colour map [default: 1st and 99th percentile of the picture]
    #[arg(long, value_name = "A..B", value_parser = values::range, allow_hyphen_values = true)]
    pub(crate) range: Option<[f64; 2]>,
    /// Colour map of scalar values [default: reds for radii, gray for intensity, otherwise viridis]
    #[arg(long, value_enum)]
    pub(crate) color_map: Option<Map>,
    /// Draw the colour map and its range into the picture
    #[arg(long)]
    pub(crate) legend: bool,
    /// Show colours without lighting
    #[arg(long)]
    pub(crate) no_lighting: bool,
    /// Brightness factor on the points' own colours where they are lit, 0.01 to 100. The first picture decides for all
    /// [default: 1, up to 8 if all colours are dark]
    #[arg(long, value_name = "FACTOR", allow_negative_numbers = true)]
    pub(crate) exposure: Option<f32>,
    /// Strength of occlusion, which darkens creases and surfaces behind others, 0 (off) to 10
    #[arg(long, alias = "eye-dome", value_name = "STRENGTH", default_value_t = Shading::default().occlusion, allow_negative_numbers = true)]
    pub(crate) occlusion: f32,
    /// Look of a surface's back, the side that its sensor did not see; needs sensor positions in the file
    #[arg(long, value_enum, default_value_t = BacksChoice::Toned)]
    pub(crate) backs: BacksChoice,
    /// Colour by its CSS name such as white, or '#rrggbb'; two as TOP,BOTTOM for a gradient; or transparent, for .png
    /// and .exr [default: dark grey gradient]
    #[arg(long, value_name = "COLOR", allow_hyphen_values = true)]
    pub(crate) background: Option<Background>,
}
