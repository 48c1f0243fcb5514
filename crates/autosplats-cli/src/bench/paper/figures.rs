//! The paper's figures: rendered, joined side by side, and measured.

use std::path::Path;

use autosplats::{Camera, ColorMode, Image, NormalSettings, Projection, Renderer, Settings, estimate_normals};
use autosplats_cloud::PointCloud;
use autosplats_cloud::glam::{DVec3, Vec3};
use autosplats_output::write_png;
use serde::{Deserialize, Serialize};

use super::measure::{K, LoadedScene};
use super::scenes::generated;
use crate::console::Console;
use crate::exit::Failure;
use crate::output::write_file;

/// Gap between pictures side by side, in pixels.
const GAP_PX: u32 = 8;
/// Splat scale at which single splats are distinguishable.
const SEPARATE_SPLAT_SCALE: f32 = 0.35;

/// Angles between normals computed on the fly and precomputed ones, in degrees.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct NormalError {
    pub(super) points: usize,
    pub(super) mean: f64,
    pub(super) median: f64,
    pub(super) rmse: f64,
    /// Fraction of the points below this angle.
    pub(super) within_5: f64,
    pub(super) within_10: f64,
    /// PSNR of the pictures in decibels, with the precomputed one as the truth; `None` if they are equal.
    pub(super) psnr: Option<f64>,
}

/// Medians of the k-radii of the two bodies, in the scene's unit, each from a picture that shows the body large enough.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Radii {
    pub(super) large: f64,
    pub(super) small: f64,
}

/// Renders the scene as measured, at half the size.
pub(super) fn picture(loaded: &LoadedScene<'_>, path: &Path, console: &Console) -> Result<(), Failure> {
    let LoadedScene { scene, cloud, camera, .. } = loaded;
    let size = scene.size.map(|side| side / 2);
    let mut renderer = Renderer::new();
    let frame = renderer.render_while(cloud, camera, size, &Settings::default(), &console.goes_on())?;
    write_file(path, console, |writer| write_png(frame.image, false, writer)).map(|_| ())
}

/// Figure 6: normals on the fly beside precomputed ones, by the same estimator.
pub(super) fn normals(
    loaded: &LoadedScene<'_>,
    side: u32,
    path: &Path,
    console: &Console,
) -> Result<NormalError, Failure> {
    let LoadedScene { cloud, camera, .. } = loaded;
    let size = [side, side];
    let settings = Settings::default();
    let mut renderer = Renderer::new();
    let normal_settings = NormalSettings { k: K, ..NormalSettings::default() };
    let beforehand = estimate_normals(cloud, &normal_settings, console.interrupt())?;
    let on_the_fly = renderer.render_while(cloud, camera, size, &settings, &console.goes_on())?.image.clone();
    let surfels = renderer.surfels()?;
    let angle = |surfel: &autosplats::PointSurfel| {
        let known = Vec3::from(beforehand.normals[surfel.point as usize]);
        f64::from(known.dot(surfel.normal.into()).abs().min(1.0).acos().to_degrees())
    };
    let mut angles: Vec<f64> = surfels.iter().filter(|surfel| surfel.radius > 0.0).map(angle).collect();
    angles.sort_unstable_by(f64::total_cmp);
    let given = renderer.render_with_normals(cloud, &beforehand, camera, size, &settings)?.image.clone();
    write_side_by_side(&[&on_the_fly, &given], path, console)?;
    let count = angles.len().max(1) as f64;
    let mean = |value: &dyn Fn(f64) -> f64| angles.iter().map(|&angle| value(angle)).sum::<f64>() / count;
    Ok(NormalError {
        points: angles.len(),
        mean: mean(&|angle| angle),
        median: angles.get(angles.len() / 2).copied().unwrap_or_default(),
        rmse: mean(&|angle| angle * angle).sqrt(),
        within_5: mean(&|angle| f64::from(u8::from(angle < 5.0))),
        within_10: mean(&|angle| f64::from(u8::from(angle < 10.0))),
        psnr: psnr(&on_the_fly, &given),
    })
}

/// Figure 7: a small body on the head of a large one. Shows the surface, the k-radius in colours and single splats, the
/// latter also near the small body.
pub(super) fn scales(count: usize, side: u32, path: &Path, console: &Console) -> Result<Radii, Failure> {
    let (cloud, camera) = generated(&format!("two-scales:{count}"), console)?;
    let up = camera.up.normalize();
    let height = |position: &[f32; 3]| (Vec3::from(*position).as_dvec3() + cloud.origin()).dot(up);
    let mut heights: Vec<f64> = cloud.positions().iter().map(height).collect();
    heights.sort_unstable_by(f64::total_cmp);
    // Both bodies have equally many points, and the small one stands on top.
    let border = heights.get(heights.len() / 2).copied().unwrap_or_default();
    let is_small = |position: &[f32; 3]| height(position) > border;
    let small: Vec<DVec3> =
        cloud.positions().iter().filter(|at| is_small(at)).map(|at| Vec3::from(*at).as_dvec3()).collect();
    let middle = cloud.origin() + small.iter().sum::<DVec3>() / small.len().max(1) as f64;
    let near = zoomed(&camera, middle, 7.0);

    let mut apart = Settings::default();
    apart.reconstruction.splat_scale = SEPARATE_SPLAT_SCALE;
    let mut colored = Settings::default();
    colored.shading.color = ColorMode::KRadius;
    let plain = Settings::default();
    let mut renderer = Renderer::new();
    let mut images = Vec::new();
    let mut medians = [0.0; 2];
    for (camera, settings) in [(&camera, &plain), (&camera, &colored), (&camera, &apart), (&near, &apart)] {
        let frame = renderer.render_while(&cloud, camera, [side, side], settings, &console.goes_on())?;
        images.push(frame.image.clone());
        let wants_small = std::ptr::eq(camera, &near);
        let surfels = renderer.surfels()?;
        let of_body = surfels
            .iter()
            .filter(|surfel| surfel.radius > 0.0)
            .filter(|surfel| is_small(&cloud.positions()[surfel.point as usize]) == wants_small);
        let mut radii: Vec<f32> = of_body.map(|surfel| surfel.k_radius).collect();
        radii.sort_unstable_by(f32::total_cmp);
        medians[usize::from(wants_small)] = radii.get(radii.len() / 2).copied().unwrap_or_default().into();
    }
    write_side_by_side(&images.iter().collect::<Vec<_>>(), path, console)?;
    Ok(Radii { large: medians[0], small: medians[1] })
}

/// Figure 9: a scan, a closer view, and the curvature there.
pub(super) fn curvature(loaded: &LoadedScene<'_>, side: u32, path: &Path, console: &Console) -> Result<(), Failure> {
    let LoadedScene { cloud, camera, .. } = loaded;
    let near = closer(cloud, camera);
    let mut colored = Settings::default();
    colored.shading.color = ColorMode::Curvature;
    let mut renderer = Renderer::new();
    let mut images = Vec::new();
    for (camera, settings) in [(camera, &Settings::default()), (&near, &Settings::default()), (&near, &colored)] {
        let frame = renderer.render_while(cloud, camera, [side, side * 3 / 2], settings, &console.goes_on())?;
        images.push(frame.image.clone());
    }
    write_side_by_side(&images.iter().collect::<Vec<_>>(), path, console)
}

/// The same camera aimed at the upper part of the cloud, magnified three times.
fn closer(cloud: &PointCloud, camera: &Camera) -> Camera {
    let up = camera.up.normalize();
    let height = |position: &[f32; 3]| (Vec3::from(*position).as_dvec3() + cloud.origin()).dot(up);
    let [low, high] =
        [f64::min, f64::max].map(|of| cloud.positions().iter().map(height).reduce(of).unwrap_or_default());
    let aim = low + 0.83 * (high - low);
    zoomed(camera, camera.look_at + up * (aim - camera.look_at.dot(up)), 3.0)
}

/// A camera with `look_at` in the middle, magnified `times`.
fn zoomed(camera: &Camera, look_at: DVec3, times: f64) -> Camera {
    let projection = match camera.projection {
        Projection::PerspectiveFovDeg(fov) => Projection::PerspectiveFovDeg(fov / times),
        Projection::OrthographicHeight(height) => Projection::OrthographicHeight(height / times),
        Projection::Pinhole { focal, center } => Projection::Pinhole { focal: focal.map(|side| side * times), center },
    };
    Camera { look_at, projection, ..*camera }
}

/// Writes pictures of equal height side by side, with white gaps.
fn write_side_by_side(images: &[&Image], path: &Path, console: &Console) -> Result<(), Failure> {
    let height = images.iter().map(|image| image.height).max().unwrap_or(1);
    let width = images.iter().map(|image| image.width + GAP_PX).sum::<u32>() - GAP_PX;
    let mut pixels = vec![[255; 4]; (width * height) as usize];
    let mut left = 0;
    for image in images {
        for (row, line) in image.pixels.chunks_exact(image.width as usize).enumerate() {
            let at = row * width as usize + left as usize;
            pixels[at..at + line.len()].copy_from_slice(line);
        }
        left += image.width + GAP_PX;
    }
    let joined = Image { width, height, pixels, ..Image::default() };
    write_file(path, console, |writer| write_png(&joined, false, writer)).map(|_| ())
}

/// Peak signal-to-noise ratio in decibels; `None` for equal pictures.
fn psnr(image: &Image, truth: &Image) -> Option<f64> {
    let squared = |(a, b): (&[u8; 4], &[u8; 4])| (0..3).map(|i| f64::from(a[i].abs_diff(b[i])).powi(2)).sum::<f64>();
    let sum: f64 = image.pixels.iter().zip(&truth.pixels).map(squared).sum();
    (sum > 0.0).then(|| 10.0 * (255.0f64.powi(2) * 3.0 * image.pixels.len() as f64 / sum).log10())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn psnr_of_one_step_everywhere() {
        let image = |value| Image { width: 2, height: 1, pixels: vec![[value; 4]; 2], ..Image::default() };
        assert!(psnr(&image(10), &image(11)).is_some_and(|psnr| (psnr - 48.13).abs() < 0.01), "20 log 255");
        assert_eq!(psnr(&image(10), &image(10)), None);
    }

    #[test]
    fn pictures_keep_their_sides() -> Result<(), Failure> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("joined.png");
        let image = |value| Image { width: 3, height: 2, pixels: vec![[value; 4]; 6], ..Image::default() };
        write_side_by_side(&[&image(1), &image(2)], &path, &Console::of_process())?;
        let joined = image::open(&path).expect("a picture").to_rgb8();
        assert_eq!(joined.dimensions(), (6 + GAP_PX, 2));
        assert_eq!(
            [joined.get_pixel(2, 1)[0], joined.get_pixel(4, 0)[0], joined.get_pixel(3 + GAP_PX, 1)[0]],
            [1, 255, 2]
        );
        Ok(())
    }
}
