//! Depth images: 16-bit grey PNG and PGM, where a pixel's value is the distance along the camera's axis.
//!
//! # How it works
//!
//! The camera is given by the caller, by a file beside the image, or else guessed. A picture of the same size, whose
//! name has `color` instead of `depth`, gives the colours. Pixels without depth make no points.

mod camera;
pub(super) mod color;
mod decode;
mod pgm;

use autosplats_cloud::{Axes, Contents, Crs, Error, PointCloud, Scan, Unit, guard};
use glam::DMat4;
use image::{DynamicImage, ImageFormat};

use self::{
    camera::Camera,
    decode::{MAX_RATIO, decode},
};
use super::{Attribute, Description, Format, Job, table::reserve};

pub(super) const FORMAT: Format = Format {
    name: "depth image",
    extensions: &["png", "pgm"],
    recognised: |bytes| bytes.starts_with(PNG) || pgm::recognised(bytes),
    sensor_frame: true,
    describe,
    read,
};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// Header of an image.
struct Header {
    width: usize,
    height: usize,
    format: String,
    /// Header of a PGM, if the image is one.
    pgm: Option<pgm::Header>,
}

impl Header {
    fn parse(job: &Job<'_>) -> Result<Self, Error> {
        if job.bytes.is_empty() {
            return Err(job.malformed("byte 0", "the file is empty; copy it again"));
        }
        if !job.bytes.starts_with(PNG) {
            let header = pgm::Header::parse(job)?;
            if header.largest < 256 {
                return Err(no_depth(job, "8-bit grey"));
            }
            return Ok(Self {
                width: header.width,
                height: header.height,
                format: format!("depth image, PGM, {}", if header.ascii { "ascii" } else { "16 bit" }),
                pgm: Some(header),
            });
        }
        // The first chunk's length and name follow the signature, then its content, all at fixed places.
        let Some(header) = job.bytes.get(12..29).filter(|header| header.starts_with(b"IHDR")) else {
            return Err(job.malformed("byte 12", "the PNG lacks its header; copy it again"));
        };
        let [width, height] =
            [4, 8].map(|at| u32::from_be_bytes(std::array::from_fn(|byte| header[at + byte])) as usize);
        let (depth, kind) = (header[12], header[13]);
        if (depth, kind) != (16, 0) {
            let kind = match kind {
                0 => "grey",
                3 => "palette",
                4 => "grey and alpha",
                _ => "colour",
            };
            return Err(no_depth(job, &format!("{depth}-bit {kind}")));
        }
        let pixels = width.checked_mul(height).filter(|&pixels| pixels > 0);
        if pixels.is_none_or(|pixels| pixels / MAX_RATIO > job.bytes.len() / 2) {
            let what = format!("{width} × {height} pixels cannot be in {} bytes; copy the file again", job.bytes.len());
            return Err(job.malformed("byte 16", what));
        }
        Ok(Self { width, height, format: "depth image, PNG, 16 bit".into(), pgm: None })
    }
}

fn no_depth(job: &Job<'_>, kind: &str) -> Error {
    job.unsupported(format!("a picture without depth ({kind}); a depth image has 16 bits of grey"))
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let header = Header::parse(job)?;
    let Camera { camera, source, notes } = Camera::of(job, header.width, header.height);
    let mut details = vec![
        ("size".into(), format!("{} × {}", header.width, header.height)),
        (
            "camera".into(),
            format!("fx {} fy {} cx {} cy {}, {} per metre", camera.fx, camera.fy, camera.cx, camera.cy, camera.scale),
        ),
        ("camera from".into(), source),
    ];
    let mut attributes = vec![Attribute::new("depth", "uint16")];
    if let Some(path) = color::beside(job.path) {
        details.push(("colours from".into(), path.display().to_string()));
        attributes.extend(["red", "green", "blue"].map(|name| Attribute::new(name, "uint8")));
    }
    Ok(Description {
        format: header.format,
        attributes,
        crs: Crs { unit: Some(Unit::Metre), ..Crs::default() },
        details,
        notes,
        ..Description::default()
    })
}

fn read(job: &Job<'_>) -> Result<Contents, Error> {
    let header = Header::parse(job)?;
    let (width, height) = (header.width, header.height);
    // Memory: the decoded image, positions and colours.
    job.check_memory(width * height, 2 + 12 + 3)?;
    let depths = match &header.pgm {
        Some(pgm) => pgm.values(job)?,
        None => png_values(job, width, height)?,
    };
    job.tick(0.5)?;
    let Camera { camera, notes, .. } = Camera::of(job, width, height);
    notes.iter().for_each(|note| job.note(note));
    let colors = match color::beside(job.path).map(|path| color::read(&path, width, height)) {
        Some(Ok(colors)) => Some(colors),
        Some(Err(why)) => {
            job.note(format!("no colours: {why}"));
            None
        }
        None => None,
    };
    job.tick(0.7)?;

    let valid = depths.iter().filter(|&&depth| depth > 0).count();
    let mut positions = Vec::new();
    reserve(&mut positions, valid, "the points of a depth image")?;
    let mut point_colors = Vec::new();
    reserve(&mut point_colors, if colors.is_some() { valid } else { 0 }, "the colours of a depth image")?;
    for (v, row) in depths.chunks_exact(width).enumerate() {
        if v % 256 == 0 {
            job.tick(0.7 + 0.3 * v as f32 / height as f32)?;
        }
        let y = (v as f64 - camera.cy) / camera.fy;
        for (u, &depth) in row.iter().enumerate().filter(|(_, depth)| **depth > 0) {
            let z = f64::from(depth) / camera.scale;
            let x = (u as f64 - camera.cx) / camera.fx;
            positions.push([x * z, y * z, z].map(|value| value as f32));
            if let Some(colors) = &colors {
                point_colors.push(colors[v * width + u]);
            }
        }
    }
    if valid < depths.len() {
        job.note(format!("{} of {} pixels have no depth; dropped", depths.len() - valid, depths.len()));
    }
    let mut cloud = PointCloud::new(glam::DVec3::ZERO, positions)
        .with_axes(Axes::Camera)
        .with_crs(Crs { unit: Some(Unit::Metre), ..Crs::default() })
        .with_scans(vec![Scan { name: None, world_from_sensor: DMat4::IDENTITY, points: 0..valid }]);
    if colors.is_some() {
        cloud = cloud.with_colors(point_colors)?;
    }
    Ok(cloud.into())
}

fn png_values(job: &Job<'_>, width: usize, height: usize) -> Result<Vec<u16>, Error> {
    let fault = |what: &str| job.malformed("pixels", format!("{what}; copy the file again"));
    let image = guard(|| decode(job.bytes, ImageFormat::Png, width, height)).map_err(|what| fault(&what))?;
    let DynamicImage::ImageLuma16(image) = image else { return Err(no_depth(job, "no 16-bit grey")) };
    if image.dimensions() != (width as u32, height as u32) {
        return Err(fault("the size of the image differs from its header"));
    }
    Ok(image.into_raw())
}
