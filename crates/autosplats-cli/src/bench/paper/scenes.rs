//! The scenes of the paper's evaluation, or their substitutes.

use std::path::{Path, PathBuf};

use autosplats::{Camera, Projection, ViewDirection, guess_axes};
use autosplats_cloud::glam::{DMat4, DVec3};
use autosplats_cloud::{Contents, PointCloud, sample_surface};
use autosplats_formats::{ReadOptions, read_mesh, read_with};
use autosplats_scenes::Scene;

use crate::console::Console;
use crate::exit::{Exit, Failure};
use crate::input::Inputs;
use crate::progress::Bar;
use crate::render::scene_camera;

/// Size of the paper's pictures in pixels.
const SIZE: [u32; 2] = [1760, 900];
/// Size of the pictures of a quick run in pixels.
const QUICK_SIZE: [u32; 2] = [440, 225];
/// Vertical field of view in degrees that files are fitted into. The herd is then shown with `HERD_FOV_DEG`.
const FOV_DEG: f64 = 30.0;
const HERD_FOV_DEG: f64 = 17.0;
/// Number of horses in the herd and in one of its rows.
const HORSE_COUNT: usize = 24;
const HORSES_PER_ROW: usize = 8;

/// A scene of Table 1.
#[derive(Clone, Debug)]
pub(super) struct PaperScene {
    pub(super) name: &'static str,
    /// The paper's figures of this scene.
    pub(super) paper: PaperFigures,
    /// Number of points to generate; ignored for a file.
    points: usize,
    /// Width and height of the pictures in pixels.
    pub(super) size: [u32; 2],
    source: SceneSource,
}

/// A scene's figures in Table 1 of the paper, in milliseconds: GeForce GTX 580, k = 10. `None` where the table has no
/// value.
#[derive(Clone, Copy, Debug)]
pub(super) struct PaperFigures {
    pub(super) points: &'static str,
    pub(super) pixels: &'static str,
    pub(super) kd_tree: Option<f64>,
    pub(super) splat_communication: f64,
    /// Time with grid culling.
    pub(super) culled: Option<f64>,
}

#[derive(Clone, Debug)]
enum SceneSource {
    /// A built-in scene by this name.
    Generated(&'static str),
    /// All points of a file, seen from its front.
    File(PathBuf),
    /// Horses at different moments of a gallop, from a folder of meshes with one topology.
    Gallop(PathBuf),
}

/// Names of the scenes for `--scenes`.
pub(super) const NAMES: [&str; 4] = ["bunny", "imperia", "horses", "cathedral"];

impl PaperScene {
    /// The scene of this name; `quick` makes it small.
    pub(super) fn new(name: &'static str, bunny: Option<&Path>, gallop: Option<&Path>, quick: bool) -> Self {
        let figures = |points, pixels, kd_tree, splat_communication, culled| PaperFigures {
            points,
            pixels,
            kd_tree,
            splat_communication,
            culled,
        };
        let (paper, points, source) = match name {
            "bunny" => (
                figures("36K", "34K", Some(14.0), 9.0, None),
                [35_947, 8_000],
                bunny.map_or(SceneSource::Generated("figure"), |path| SceneSource::File(path.into())),
            ),
            "imperia" => {
                (figures("546K", "291K", Some(95.0), 37.0, None), [546_000, 20_000], SceneSource::Generated("statue"))
            }
            "horses" => (
                figures("1M", "690K", Some(169.0), 117.0, Some(71.0)),
                [1_000_000, 30_000],
                gallop.map_or(SceneSource::Generated("herd"), |path| SceneSource::Gallop(path.into())),
            ),
            _ => (
                figures("10M", "1.3M", None, 264.0, Some(123.0)),
                [10_000_000, 60_000],
                SceneSource::Generated("cathedral"),
            ),
        };
        let [width, height] = if quick { QUICK_SIZE } else { SIZE };
        // The paper shows the statue in portrait format.
        let size = if name == "imperia" { [height, width] } else { [width, height] };
        Self { name, paper, points: points[usize::from(quick)], size, source }
    }

    /// Origin of the points, for the report.
    pub(super) fn origin(&self) -> String {
        match &self.source {
            SceneSource::Generated(scene) => format!("generated substitute, `scene:{scene}:{}`", self.points),
            SceneSource::File(path) => format!("all points of `{}`", file_name(path)),
            SceneSource::Gallop(folder) => {
                format!(
                    "{HORSE_COUNT} moments of `{}`, {} points sampled on the surfaces",
                    file_name(folder),
                    self.points
                )
            }
        }
    }

    /// Key of the scene in the journal.
    pub(super) fn key(&self) -> String {
        let source = match &self.source {
            SceneSource::Generated(scene) => format!("{scene}:{}", self.points),
            SceneSource::File(path) => {
                format!("{} of {} bytes", file_name(path), path.metadata().map_or(0, |metadata| metadata.len()))
            }
            SceneSource::Gallop(folder) => format!("{}:{}", file_name(folder), self.points),
        };
        let [width, height] = self.size;
        format!("{} ({source}, {width}x{height})", self.name)
    }

    /// File or folder of the scene, checked before the work begins.
    pub(super) fn file(&self) -> Option<&Path> {
        match &self.source {
            SceneSource::Generated(_) => None,
            SceneSource::File(path) | SceneSource::Gallop(path) => Some(path),
        }
    }

    /// The points, and the camera that shows them.
    pub(super) fn load(&self, console: &Console) -> Result<(PointCloud, Camera), Failure> {
        match &self.source {
            SceneSource::Generated(scene) => generated(&format!("{scene}:{}", self.points), console),
            SceneSource::File(path) => {
                let bar = Bar::on_file("reading", path, console);
                let cloud = read_with(path, &ReadOptions::default(), &bar)?;
                self.fitted(cloud, ViewDirection::Front)
            }
            SceneSource::Gallop(folder) => {
                let (cloud, camera) = self.fitted(herd(folder, self.points, console)?, ViewDirection::Iso)?;
                // The herd extends beyond the picture, which matches the paper's pixel counts.
                Ok((cloud, Camera { projection: Projection::PerspectiveFovDeg(HERD_FOV_DEG), ..camera }))
            }
        }
    }

    fn fitted(&self, cloud: PointCloud, direction: ViewDirection) -> Result<(PointCloud, Camera), Failure> {
        let aspect = f64::from(self.size[0]) / f64::from(self.size[1]);
        let projection = Projection::PerspectiveFovDeg(FOV_DEG);
        let camera = Camera::fit(&cloud, guess_axes(&cloud), direction, aspect, projection)?;
        Ok((cloud, camera))
    }
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// A built-in scene, `NAME[:COUNT]`, and its camera.
pub(super) fn generated(name: &str, console: &Console) -> Result<(PointCloud, Camera), Failure> {
    let inputs = Inputs::scene(name)?;
    let scene: &Scene = inputs.only_scene().ok_or_else(|| Failure::usage(format!("{name} is not a scene")))?;
    Ok((inputs.read(console)?, scene_camera(scene)))
}

/// Horses in rows of `HORSES_PER_ROW` at moments of one gallop, with `count` sampled points in all.
fn herd(folder: &Path, count: usize, console: &Console) -> Result<PointCloud, Failure> {
    let unreadable = |error: std::io::Error| Failure::new(Exit::Input, format!("{}: {error}", folder.display()));
    let mut files = Vec::new();
    for entry in folder.read_dir().map_err(unreadable)? {
        files.push(entry.map_err(unreadable)?.path());
    }
    files.sort();
    if files.is_empty() {
        return Err(Failure::new(Exit::Input, format!("{}: there are no files in it", folder.display())));
    }
    let bar = Bar::new("resampling the gallop", console);
    let options = ReadOptions::default();
    // The first file has the triangles of all.
    let triangles = read_mesh(&files[0], &options, &())?.triangles;
    let mut horses = Vec::new();
    for horse in 0..HORSE_COUNT {
        autosplats_cloud::Progress::report(&bar, horse as f32 / HORSE_COUNT as f32);
        // Files seven frames apart show neighbours at different moments.
        let file = &files[horse * 7 % files.len()];
        let cloud = read_with(file, &options, &())?;
        let mesh = Contents { cloud, triangles: triangles.clone() };
        let share = count / HORSE_COUNT + usize::from(horse < count % HORSE_COUNT);
        let points = sample_surface(&mesh, share, horse as u64, &())?;
        let [across, along] = [(horse % HORSES_PER_ROW) as f64, (horse / HORSES_PER_ROW) as f64];
        // The horses run along z; rows are staggered.
        let place = DVec3::new(0.95 * across + 0.45 * along, 0.0, -2.1 * along - 0.35 * (2.4 * across).sin());
        horses.push((points, DMat4::from_translation(place)));
    }
    Ok(PointCloud::merge(horses))
}
