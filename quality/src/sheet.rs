//! Contact sheets: the methods' pictures of a subject, side by side.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use anyhow::{Context as _, Result};
use font8x8::legacy::BASIC_LEGACY;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{Rgb, RgbImage};

use crate::case::Case;
use crate::light::Lit;
use crate::measure::angle;
use crate::method::Method;
use crate::run::Pictures;
use crate::subject::Subject;
use crate::verdict::{Verdict, Verdicts};

/// Greatest width and height of a picture on a sheet, pixels.
const MAX_PICTURE_SIZE_PX: [usize; 2] = [260, 210];
/// Least width of a column, pixels. The titles fit into it.
const MIN_COLUMN_WIDTH_PX: usize = 110;
/// Margin around a subject, as a share of its width and height.
const MARGIN: f64 = 0.06;
/// Space between pictures, pixels.
const GAP_PX: usize = 4;
/// Height of a line of text, pixels.
const LINE_HEIGHT_PX: usize = 14;
/// Error of normals at the end of the colour scale, degrees.
const MAX_ERROR_DEGREES: f64 = 30.0;
/// Colour of the sheet.
const SHEET_COLOR: [u8; 3] = [250, 250, 250];
/// Colour of text.
const TEXT_COLOR: [u8; 3] = [40, 40, 40];
/// Colour of pixels that are empty in both pictures or not measured.
const EMPTY_COLOR: [u8; 3] = [205, 210, 215];
/// Colour of pixels that only the true picture covers.
const MISSING_COLOR: [u8; 3] = [0, 170, 60];
/// Colour of pixels that only our picture covers.
const EXTRA_COLOR: [u8; 3] = [60, 130, 255];

/// Methods with a column, between those of the truth and of our error.
const METHODS: [Method; 3] = [Method::Dots, Method::Paper, Method::Ours];
/// Titles of the columns.
const TITLES: [&str; 5] = ["truth", "dots", "paper", "ours", "error of ours"];

/// One row of a sheet: five small pictures.
#[derive(Debug)]
pub struct Row {
    /// Name of the sheet: the surface's.
    sheet: &'static str,
    title: String,
    pictures: Vec<SmallPicture>,
}

/// A small picture.
#[derive(Debug)]
struct SmallPicture {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

/// The colour of a verdict. Right pixels are black to white, by an error of the normal of 0° to 30°. Holes are red,
/// other missing pixels orange, pixels outside blue, leaks magenta, surfaces in front cyan, beside yellow, unsampled
/// brown.
pub fn verdict_color(verdict: Verdict, degrees: Option<f64>) -> [u8; 3] {
    match verdict {
        Verdict::Empty => [0, 60, 40],
        Verdict::Unsampled => [80, 50, 20],
        Verdict::Right => [(degrees.unwrap_or(90.0) / MAX_ERROR_DEGREES * 255.0).min(255.0) as u8; 3],
        Verdict::Hole => [255, 0, 0],
        Verdict::Short => [255, 140, 0],
        Verdict::Over => [60, 60, 255],
        Verdict::Leak => [255, 0, 255],
        Verdict::Before => [0, 255, 255],
        Verdict::Beside => [200, 200, 0],
    }
}

/// The colour of an error of normals: from blue-black over red and orange to white at 30° and above.
pub fn error_color(degrees: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] =
        [[10.0, 10.0, 40.0], [70.0, 20.0, 110.0], [190.0, 50.0, 70.0], [250.0, 150.0, 30.0], [255.0, 255.0, 230.0]];
    let t = (degrees / MAX_ERROR_DEGREES).clamp(0.0, 1.0) * 4.0;
    let below = (t as usize).min(3);
    [0, 1, 2].map(|i| (STOPS[below][i] + (STOPS[below + 1][i] - STOPS[below][i]) * (t - below as f64)).round() as u8)
}

impl Row {
    /// A row of the pictures of a case, cropped to the subject.
    pub fn new(case: &Case, pictures: &Pictures) -> Self {
        let exact = &pictures.truth.exact;
        let part = Crop::around(&pictures.truth.lit);
        let small_lit = |lit: &Lit| part.small(lit.width, |pixel| lit.over_background(pixel).map(|c| 255.0 * c));
        let mut small = vec![small_lit(&pictures.truth.lit)];
        for method in METHODS {
            small.extend(pictures.drawn.iter().find(|(drawn, ..)| *drawn == method).map(|(.., lit)| small_lit(lit)));
        }
        let ours = pictures.drawn.iter().find(|(drawn, ..)| *drawn == Method::Ours);
        small.extend(ours.map(|(_, picture, _)| {
            part.small(exact.width, |pixel| {
                let color = match (exact.seen[pixel].is_some(), picture.shown[pixel].is_some()) {
                    (false, false) => EMPTY_COLOR,
                    (true, false) if !exact.is_measured(pixel) => EMPTY_COLOR,
                    (true, false) => MISSING_COLOR,
                    (false, true) => EXTRA_COLOR,
                    (true, true) => error_color(angle(exact, picture, pixel).unwrap_or(180.0)),
                };
                color.map(f64::from)
            })
        }));
        Self { sheet: case.recipe.surface_name(), title: case.name(), pictures: small }
    }
}

/// A rectangle of a picture.
#[derive(Clone, Copy, Debug)]
struct Crop {
    low: [usize; 2],
    size: [usize; 2],
    /// Pixels of the picture per pixel of the sheet, along a side.
    scale: f64,
}

impl Crop {
    /// The covered part, with a margin.
    fn around(lit: &Lit) -> Self {
        let sides = [lit.width, lit.pixels.len() / lit.width];
        let mut low = sides;
        let mut high = [0, 0];
        for pixel in (0..lit.pixels.len()).filter(|&pixel| lit.pixels[pixel].is_some()) {
            let at = [pixel % lit.width, pixel / lit.width];
            low = [0, 1].map(|i| low[i].min(at[i]));
            high = [0, 1].map(|i| high[i].max(at[i] + 1));
        }
        let margin = [0, 1].map(|i| 2 + (MARGIN * high[i].saturating_sub(low[i]) as f64) as usize);
        let low = [0, 1].map(|i| low[i].saturating_sub(margin[i]));
        let size = [0, 1].map(|i| (high[i] + margin[i]).min(sides[i]).max(low[i] + 1) - low[i]);
        let scale = [0, 1].map(|i| size[i] as f64 / MAX_PICTURE_SIZE_PX[i] as f64);
        Self { low, size, scale: scale[0].max(scale[1]) }
    }

    /// The rectangle at the sheet's scale: each pixel is a mean. `width` is that of the whole picture.
    fn small(&self, width: usize, color: impl Fn(usize) -> [f64; 3]) -> SmallPicture {
        let [columns, rows] = self.size.map(|side| ((side as f64 / self.scale) as usize).max(1));
        let range = |at: usize, i: usize| {
            let first = ((at as f64 * self.scale) as usize).min(self.size[i] - 1);
            let end = (((at + 1) as f64 * self.scale) as usize).clamp(first + 1, self.size[i]);
            self.low[i] + first..self.low[i] + end
        };
        let mean = |at: usize| {
            let (xs, ys) = (range(at % columns, 0), range(at / columns, 1));
            let count = (xs.len() * ys.len()) as f64;
            let pixels = ys.flat_map(|y| xs.clone().map(move |x| y * width + x));
            let sum = pixels.map(&color).fold([0.0; 3], |sum: [f64; 3], color| [0, 1, 2].map(|i| sum[i] + color[i]));
            sum.map(|channel| (channel / count).round() as u8)
        };
        SmallPicture { width: columns, pixels: (0..columns * rows).map(mean).collect() }
    }
}

/// Writes a sheet for each surface into `folder`, and returns the sheets' names.
///
/// # Errors
/// A file cannot be written.
pub fn write_all(folder: &Path, rows: &[Row]) -> Result<Vec<String>> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.sheet) {
            names.push(row.sheet);
        }
    }
    for name in &names {
        let rows: Vec<_> = rows.iter().filter(|row| row.sheet == *name).collect();
        write(&folder.join(format!("{name}.png")), &rows)?;
    }
    Ok(names.into_iter().map(str::to_owned).collect())
}

/// Writes the full-size pictures of a case into `folder`: the lit truth, each method's lit picture, and verdicts on
/// ours.
///
/// # Errors
/// A file cannot be written.
pub fn write_full_size(folder: &Path, case: &Case, subject: &Subject, pictures: &Pictures) -> Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let exact = &pictures.truth.exact;
    let save = |what: &str, color: &dyn Fn(usize) -> [u8; 3]| {
        let height = exact.seen.len() / exact.width;
        let image = RgbImage::from_fn(exact.width as u32, height as u32, |x, y| {
            Rgb(color(y as usize * exact.width + x as usize))
        });
        let path = folder.join(format!("{} {what}.png", case.name()).replace([' ', ':'], "_"));
        image.save(&path).with_context(|| path.display().to_string())
    };
    let color = |lit: &Lit, pixel: usize| lit.over_background(pixel).map(|c| (255.0 * c).round() as u8);
    save("truth", &|pixel| color(&pictures.truth.lit, pixel))?;
    for (method, picture, lit) in &pictures.drawn {
        save(&method.name(), &|pixel| color(lit, pixel))?;
        if *method == Method::Ours {
            let verdicts = Verdicts::new(exact, picture, subject).verdicts;
            save("verdict", &|pixel| verdict_color(verdicts[pixel], angle(exact, picture, pixel)))?;
        }
    }
    Ok(())
}

/// Writes a sheet of these rows, with titles of the columns and a legend.
fn write(path: &Path, rows: &[&Row]) -> Result<()> {
    let height = |row: &Row| row.pictures.first().map_or(0, |small| small.pixels.len() / small.width);
    let widest = rows.iter().flat_map(|row| &row.pictures).map(|small| small.width).max();
    let column = widest.context("the sheet has no pictures")?.max(MIN_COLUMN_WIDTH_PX) + GAP_PX;
    let width = TITLES.len() * column + GAP_PX;
    let total = 2 * LINE_HEIGHT_PX + rows.iter().map(|row| height(row) + LINE_HEIGHT_PX + GAP_PX).sum::<usize>();
    let mut image = RgbImage::from_pixel(width as u32, total as u32, Rgb(SHEET_COLOR));
    for (i, title) in TITLES.iter().enumerate() {
        draw_text(&mut image, GAP_PX + i * column, 3, title);
    }
    let mut y = LINE_HEIGHT_PX;
    for row in rows {
        draw_text(&mut image, GAP_PX, y + 3, &row.title);
        y += LINE_HEIGHT_PX;
        for (i, small) in row.pictures.iter().enumerate() {
            for (at, &pixel) in small.pixels.iter().enumerate() {
                let x = GAP_PX + i * column + at % small.width;
                image.put_pixel(x as u32, (y + at / small.width) as u32, Rgb(pixel));
            }
        }
        y += height(row) + GAP_PX;
    }
    legend(&mut image, GAP_PX, y);
    let file = File::create(path).with_context(|| path.display().to_string())?;
    let encoder = PngEncoder::new_with_quality(BufWriter::new(file), CompressionType::Best, FilterType::Adaptive);
    image.write_with_encoder(encoder).with_context(|| path.display().to_string())
}

fn legend(image: &mut RgbImage, x: usize, y: usize) {
    draw_text(image, x, y + 3, "error: 0");
    for i in 0..80 {
        let color = Rgb(error_color(MAX_ERROR_DEGREES * i as f64 / 79.0));
        (0..10).for_each(|j| image.put_pixel((x + 68 + i) as u32, (y + 1 + j) as u32, color));
    }
    draw_text(image, x + 152, y + 3, "30 degrees and more");
    for (at, color, name) in [(320, MISSING_COLOR, "missing"), (400, EXTRA_COLOR, "too much")] {
        (0..100).for_each(|i| image.put_pixel((x + at + i % 10) as u32, (y + 1 + i / 10) as u32, Rgb(color)));
        draw_text(image, x + at + 14, y + 3, name);
    }
}

/// Draws ASCII text.
fn draw_text(image: &mut RgbImage, x: usize, y: usize, text: &str) {
    for (column, glyph) in text.bytes().map(|byte| BASIC_LEGACY[usize::from(byte) % 128]).enumerate() {
        for (row, bits) in glyph.into_iter().enumerate() {
            for bit in (0..8).filter(|bit| bits >> bit & 1 == 1) {
                let [x, y] = [x + 8 * column + bit, y + row].map(|at| at as u32);
                if x < image.width() && y < image.height() {
                    image.put_pixel(x, y, Rgb(TEXT_COLOR));
                }
            }
        }
    }
}
