//! Depth images: grey PNG, PGM, TIFF, PFM and OpenEXR, where a pixel's value is the distance along the camera's axis.
//!
//! # How it works
//!
//! The camera is given by the caller, by a file beside the image, or else guessed. A picture of the same size, whose
//! name has `color` instead of `depth`, gives the colours. Pixels without depth make no points. 16-bit values whose
//! bytes are swapped are told by the roughness that this makes.

mod camera;
pub(super) mod color;
mod decode;
mod exr;
mod pfm;
mod pgm;
mod tiff;
mod values;

use autosplats_cloud::{Axes, Contents, Crs, Error, PointCloud, Scan, Unit, guard, one_line};
use glam::DMat4;
use image::{DynamicImage, ImageFormat};

use self::{
    camera::Camera,
    decode::{MAX_RATIO, decode},
    values::{Values, mend_byte_order},
};
use super::{Attribute, Description, Format, Job, table::reserve};

pub(super) const FORMAT: Format = Format {
    name: "depth image",
    extensions: &["png", "pgm", "tif", "tiff", "exr", "pfm"],
    recognised: |bytes| {
        bytes.starts_with(PNG)
            || bytes.starts_with(exr::MAGIC)
            || [pgm::recognised, pfm::recognised, tiff::recognised].iter().any(|recognised| recognised(bytes))
    },
    sensor_frame: true,
    describe,
    read,
};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";

/// More than the number of bytes that one byte of a compressed TIFF or EXR can expand to.
const MAX_EXPANSION: usize = 1 << 13;

/// Header of an image.
struct Header {
    width: usize,
    height: usize,
    format: String,
    /// Type of the values.
    type_name: &'static str,
    kind: Kind,
}

/// File format of an image.
enum Kind {
    Png,
    Pgm(pgm::Header),
    Pfm(pfm::Header),
    Tiff(tiff::Header),
    Exr(exr::Header),
}

impl Header {
    fn parse(job: &Job<'_>) -> Result<Self, Error> {
        if job.bytes.is_empty() {
            return Err(job.malformed("byte 0", "the file is empty; copy it again"));
        }
        check_no_disparities(job)?;
        if tiff::recognised(job.bytes) {
            let header = tiff::Header::parse(job)?;
            let type_name = header.type_name();
            let (width, height, format) = (header.width, header.height, format!("depth image, TIFF, {type_name}"));
            return Ok(Self { width, height, format, type_name, kind: Kind::Tiff(header) });
        }
        if job.bytes.starts_with(exr::MAGIC) {
            let header = exr::Header::parse(job)?;
            let (width, height, type_name) = (header.width, header.height, header.type_name);
            let format = format!("depth image, OpenEXR, channel {}, {type_name}", one_line(&header.channel));
            return Ok(Self { width, height, format, type_name, kind: Kind::Exr(header) });
        }
        if pfm::recognised(job.bytes) {
            let header = pfm::Header::parse(job)?;
            let (width, height, format) = (header.width, header.height, "depth image, PFM, float32".into());
            return Ok(Self { width, height, format, type_name: "float32", kind: Kind::Pfm(header) });
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
                type_name: "uint16",
                kind: Kind::Pgm(header),
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
        Ok(Self { width, height, format: "depth image, PNG, 16 bit".into(), type_name: "uint16", kind: Kind::Png })
    }

    fn values(&self, job: &Job<'_>) -> Result<Values, Error> {
        let mut values = match &self.kind {
            Kind::Png => Values::Whole(png_values(job, self.width, self.height)?),
            Kind::Pgm(header) => Values::Whole(header.values(job)?),
            Kind::Pfm(header) => Values::Floats(header.values(job)?),
            Kind::Tiff(header) => header.values(job)?,
            Kind::Exr(header) => Values::Floats(header.values(job)?),
        };
        if let Values::Whole(values) = &mut values {
            mend_byte_order(job, values, self.width);
        }
        Ok(values)
    }
}

/// Fails for an image whose name says that it holds disparities, which fall as depths grow.
fn check_no_disparities(job: &Job<'_>) -> Result<(), Error> {
    let stem = job.path.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let mut words = stem.split(|character: char| !character.is_alphabetic());
    if words.any(|word| ["disp", "disparity", "disparities"].contains(&word)) {
        let what = "its name says that it holds disparities, not depths; a depth is focal length × baseline / disparity; \
                    an image of depths needs another name";
        return Err(job.unsupported(what));
    }
    Ok(())
}

fn no_depth(job: &Job<'_>, kind: &str) -> Error {
    job.unsupported(format!("a picture without depth ({kind}); a depth image has 16 bits of grey, or floats"))
}

fn describe(job: &Job<'_>) -> Result<Description, Error> {
    let header = Header::parse(job)?;
    let Camera { camera, source, notes } = Camera::of(job, header.width, header.height);
    let scale = camera.scale.or((header.type_name == "uint16").then_some(values::WHOLE_PER_METRE));
    let mut details = vec![
        ("size".into(), format!("{} × {}", header.width, header.height)),
        (
            "camera".into(),
            format!("fx {} fy {} cx {} cy {}", camera.fx, camera.fy, camera.cx, camera.cy)
                + &scale.map_or_else(String::new, |scale| format!(", {scale} per metre")),
        ),
        ("camera from".into(), source),
    ];
    let mut attributes = vec![Attribute::new("depth", header.type_name)];
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
    job.check_memory(width * height, 4 + 12 + 3)?;
    let depths = header.values(job)?;
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

    let scale = camera.scale.unwrap_or_else(|| depths.usual_scale(job));
    let valid = depths.count();
    let mut positions = Vec::new();
    reserve(&mut positions, valid, "the points of a depth image")?;
    let mut point_colors = Vec::new();
    reserve(&mut point_colors, if colors.is_some() { valid } else { 0 }, "the colours of a depth image")?;
    for v in 0..height {
        if v % 256 == 0 {
            job.tick(0.7 + 0.3 * v as f32 / height as f32)?;
        }
        let y = (v as f64 - camera.cy) / camera.fy;
        for (u, depth) in (0..width).filter_map(|u| Some((u, depths.get(v * width + u)?))) {
            let z = depth / scale;
            let x = (u as f64 - camera.cx) / camera.fx;
            positions.push([x * z, y * z, z].map(|value| value as f32));
            if let Some(colors) = &colors {
                point_colors.push(colors[v * width + u]);
            }
        }
    }
    let all = width * height;
    if valid < all {
        job.note(format!("{} of {all} pixels have no depth; dropped", all - valid));
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
