//! Pictures of scenes against the exact surface, with several samples per pixel.

use std::array::from_fn;

use autosplats_cloud::{ValueOrigin, glam::DVec3};
use autosplats_scenes::Scene as ExactScene;
use rayon::prelude::*;

use super::super::*;
use crate::camera::{Camera, Projection};
use crate::splat::GBuffer;
use crate::{Renderer, Settings};

/// Samples along each side of a pixel.
const SAMPLES: u32 = 4;
const BEHIND: [u8; 3] = [60, 66, 75];

/// A picture in linear light.
struct Picture(Vec<[f32; 3]>);

impl Picture {
    /// Pixels of a picture `factor` times as wide and high that form `pixel` of a picture `width` wide.
    fn samples(&self, pixel: usize, width: usize, factor: usize) -> impl Iterator<Item = [f32; 3]> + Clone {
        let [x, y] = [pixel % width * factor, pixel / width * factor];
        (0..factor * factor).map(move |i| self.0[(y + i / factor) * width * factor + x + i % factor])
    }

    /// The picture averaged to `width` pixels wide; each pixel is the mean of `factor`² pixels.
    fn averaged(&self, width: usize, factor: usize) -> Self {
        let count = factor * factor;
        let channel = |pixel, i| self.samples(pixel, width, factor).map(|color| color[i]).sum::<f32>() / count as f32;
        Self((0..self.0.len() / count).map(|pixel| from_fn(|i| channel(pixel, i))).collect())
    }

    /// PSNR in decibels of sRGB values, which are about what the eye perceives; the peak is 1.
    fn psnr(&self, truth: &Self, counts: &[bool]) -> f64 {
        let error = |(a, b): (&[f32; 3], &[f32; 3])| -> f64 {
            (0..3).map(|i| f64::from(srgb(a[i]) - srgb(b[i])).powi(2)).sum::<f64>() / 3.0
        };
        let pairs = self.0.iter().zip(&truth.0).zip(counts).filter(|(_, counts)| **counts);
        let errors: Vec<f64> = pairs.map(|(pair, _)| error(pair)).collect();
        -10.0 * (errors.iter().sum::<f64>() / errors.len() as f64).log10()
    }
}

/// The exact surface at the middle of each pixel.
fn traced(exact: &ExactScene, camera: &Camera, [width, height]: [u32; 2]) -> GBuffer {
    let [right, down, forward] = camera.axes().expect("a camera that can see");
    let Projection::PerspectiveFovDeg(fov) = camera.projection else { panic!("scenes are seen in perspective") };
    let pixel = 2.0 * (0.5 * fov.to_radians()).tan() / f64::from(height);
    let hits: Vec<_> = (0..width * height)
        .into_par_iter()
        .map(|index| {
            let [x, y] = [f64::from(index % width) + 0.5, f64::from(index / width) + 0.5];
            let [x, y] = [x - 0.5 * f64::from(width), y - 0.5 * f64::from(height)].map(|at| at * pixel);
            let direction = (forward + right * x + down * y).normalize();
            let hit = exact.trace(camera.eye, direction)?;
            let towards = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
            let normal = [right, down, forward].map(|axis| towards.dot(axis) as f32);
            Some(((hit.distance * direction.dot(forward)) as f32, normal))
        })
        .collect();
    let mut layers = GBuffer::new(width, height);
    for (pixel, hit) in hits.into_iter().enumerate() {
        let at = layers.index(pixel % width as usize, pixel / width as usize);
        if let Some((depth, normal)) = hit {
            (layers.weight[at], layers.depth[at], layers.normal[at]) = (1.0, depth, normal);
        }
    }
    layers
}

/// The picture with blended edges, and without blending.
fn pictures(image: &Image, layers: &GBuffer) -> [Picture; 2] {
    let steps = linear_steps();
    let behind = BEHIND.map(|channel| steps[channel as usize]);
    let width = image.width as usize;
    let blended = image.pixels.iter().map(|pixel| from_fn(|i| steps[pixel[i] as usize])).collect();
    let covered = |pixel: usize| layers.weight[layers.index(pixel % width, pixel / width)] > 0.0;
    let plain = image.linear.iter().enumerate().map(|(at, color)| if covered(at) { *color } else { behind }).collect();
    [Picture(blended), Picture(plain)]
}

struct Quality {
    blended: f64,
    plain: f64,
}

/// Quality of a scene's picture at silhouettes and steps, from points and from the exact surface.
fn measure(name: &str, size: [u32; 2]) -> [Quality; 2] {
    let (exact, count) = ExactScene::parse(name).expect("a scene");
    let seen = exact.view();
    let projection = Projection::PerspectiveFovDeg(seen.fov_degrees);
    let camera = Camera { eye: seen.eye, look_at: seen.look_at, up: seen.up, projection };
    let cloud = exact.sample(count, &()).expect("points");
    let shading = Shading { color: ColorMode::Plain, background: Background::Color(BEHIND), ..Shading::default() };
    let shaded = |layers: &GBuffer| {
        let view = camera.view(DVec3::ZERO, [layers.width, layers.height]).expect("a view");
        let mut image = Image::default();
        shade(
            layers,
            &Scene {
                view: &view,
                up: DVec3::Z,
                origin: DVec3::ZERO,
                unit: 1.0,
                exposure: 1.0,
                values: ValueOrigin::default(),
            },
            &shading,
            true,
            None,
            &mut image,
            &crate::cancel::NEVER,
        );
        image
    };
    let fine = traced(&exact, &camera, size.map(|side| side * SAMPLES));
    let [_, fine] = pictures(&shaded(&fine), &fine);
    let [width, height] = size.map(|side| side as usize);
    let truth = fine.averaged(width, SAMPLES as usize);
    // Pixels whose samples differ by much are at an edge.
    let edges: Vec<bool> = (0..width * height)
        .map(|pixel| {
            let bright = fine.samples(pixel, width, SAMPLES as usize).map(|color| srgb(color[1]));
            bright.clone().fold(0.0, f32::max) - bright.fold(1.0, f32::min) > 0.15
        })
        .collect();
    let mut renderer = Renderer::new();
    let settings = Settings { shading: shading.clone(), all_layers: true, ..Settings::default() };
    let frame = renderer.render(&cloud, &camera, size, &settings).expect("a frame");
    let coarse = traced(&exact, &camera, size);
    let of = |image: &Image, layers: &GBuffer, counts: &[bool]| {
        let [blended, plain] = pictures(image, layers).map(|picture| picture.psnr(&truth, counts));
        Quality { blended, plain }
    };
    let all = vec![true; width * height];
    let whole = of(frame.image, frame.layers, &all);
    println!("{name} {size:?}: whole picture {:.2} dB, without blending {:.2}", whole.blended, whole.plain);
    let found = [of(frame.image, frame.layers, &edges), of(&shaded(&coarse), &coarse, &edges)];
    for (from, found) in ["points", "exact surface"].iter().zip(&found) {
        println!("  at edges, from {from}: {:.2} dB, without blending {:.2}", found.blended, found.plain);
    }
    for factor in [2, 3] {
        let frame = renderer.render(&cloud, &camera, size.map(|side| side * factor), &settings).expect("a frame");
        let [blended, _] = pictures(frame.image, frame.layers).map(|picture| picture.averaged(width, factor as usize));
        let [whole, edges] = [&all, &edges].map(|counts| blended.psnr(&truth, counts));
        println!(
            "  from points, {factor} times as wide and averaged: at edges {edges:.2} dB, whole picture {whole:.2}"
        );
    }
    found
}

#[test]
fn blended_edges_are_nearer_to_the_truth() {
    for (name, size) in [("figure:300K", [240, 180]), ("statue:200K", [240, 180])] {
        let [points, exact] = measure(name, size);
        assert!(exact.blended > exact.plain + 0.5, "{name}, exact surface: {} and {}", exact.blended, exact.plain);
        assert!(points.blended > points.plain + 0.2, "{name}, points: {} and {}", points.blended, points.plain);
    }
}

#[test]
#[ignore = "takes a while; prints figures"]
fn figures() {
    for name in ["figure:300K", "statue:800K"] {
        measure(name, [880, 450]);
    }
}
