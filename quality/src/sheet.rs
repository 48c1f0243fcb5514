//! Contact sheets: what the methods make of a subject, side by side.

use std::path::Path;

use anyhow::{Context as _, Result};
use font8x8::legacy::BASIC_LEGACY;
use image::{Rgb, RgbImage};

use crate::case::Case;
use crate::light::Lit;
use crate::measure::angle;
use crate::method::Method;
use crate::run::Pictures;
use crate::verdict::Verdict;

/// Width of a picture on a sheet.
const WIDTH: usize = 320;
/// Pixels between pictures, and for a line of words above them.
const GAP: usize = 4;
const LINE: usize = 14;
/// Error of normals that is shown at full strength, degrees.
const MOST_DEGREES: f64 = 30.0;
const PAPER_COLOR: [u8; 3] = [250, 250, 250];
const INK: [u8; 3] = [40, 40, 40];

/// Columns of a sheet: the truth, these methods, and the error of ours.
const METHODS: [Method; 3] = [Method::Dots, Method::Paper, Method::Ours];

/// One row of a sheet: five small pictures.
#[derive(Debug)]
pub struct Row {
    /// What the sheet is of.
    sheet: &'static str,
    title: String,
    pictures: Vec<Small>,
}

/// A small picture.
#[derive(Debug)]
struct Small {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

/// The colour of a verdict: normals right in black to 30° wrong in white, holes red, other missing pixels orange, pixels too
/// many blue, leaks magenta, surface before the true one cyan, beside it yellow, unsampled brown.
pub fn verdict_color(verdict: Verdict, degrees: Option<f64>) -> [u8; 3] {
    match verdict {
        Verdict::Empty => [0, 60, 40],
        Verdict::Unsampled => [80, 50, 20],
        Verdict::Right => [(degrees.unwrap_or(90.0) / MOST_DEGREES * 255.0).min(255.0) as u8; 3],
        Verdict::Hole => [255, 0, 0],
        Verdict::Short => [255, 140, 0],
        Verdict::Over => [60, 60, 255],
        Verdict::Leak => [255, 0, 255],
        Verdict::Before => [0, 255, 255],
        Verdict::Beside => [200, 200, 0],
    }
}

/// The colour of an error of normals: blue-black over red and orange to white at 30° and above.
pub fn error_color(degrees: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 5] =
        [[10.0, 10.0, 40.0], [70.0, 20.0, 110.0], [190.0, 50.0, 70.0], [250.0, 150.0, 30.0], [255.0, 255.0, 230.0]];
    let t = (degrees / MOST_DEGREES).clamp(0.0, 1.0) * 4.0;
    let below = (t as usize).min(3);
    [0, 1, 2].map(|i| (STOPS[below][i] + (STOPS[below + 1][i] - STOPS[below][i]) * (t - below as f64)).round() as u8)
}

impl Row {
    /// A row for the pictures of a case.
    pub fn new(case: &Case, pictures: &Pictures) -> Self {
        let mut small = vec![small_lit(&pictures.truth.lit)];
        for method in METHODS {
            small.extend(pictures.drawn.iter().find(|(drawn, ..)| *drawn == method).map(|(.., lit)| small_lit(lit)));
        }
        let ours = pictures.drawn.iter().find(|(drawn, ..)| *drawn == Method::Ours);
        small.extend(ours.map(|(_, picture, _)| {
            let exact = &pictures.truth.exact;
            let color = |pixel: usize| {
                let color = match (exact.seen[pixel].is_some(), picture.shown[pixel].is_some()) {
                    (false, false) => [205, 210, 215],
                    (true, false) => [0, 170, 60],
                    (false, true) => [60, 130, 255],
                    (true, true) => error_color(angle(exact, picture, pixel).unwrap_or(180.0)),
                };
                color.map(f64::from)
            };
            small_picture(exact.width, &(0..exact.seen.len()).map(color).collect::<Vec<_>>())
        }));
        Self { sheet: case.recipe.surface_name(), title: case.name(), pictures: small }
    }
}

fn small_lit(lit: &Lit) -> Small {
    let pixels: Vec<_> = (0..lit.pixels.len()).map(|pixel| lit.over_background(pixel).map(|c| 255.0 * c)).collect();
    small_picture(lit.width, &pixels)
}

/// Means over squares of pixels.
fn small_picture(width: usize, pixels: &[[f64; 3]]) -> Small {
    let side = width.div_ceil(WIDTH).max(1);
    let [columns, rows] = [width / side, pixels.len() / width / side];
    let mean = |at: usize| {
        let [x, y] = [at % columns * side, at / columns * side];
        let square = (0..side * side).map(|i| pixels[(y + i / side) * width + x + i % side]);
        let sum = square.fold([0.0; 3], |sum: [f64; 3], pixel| [0, 1, 2].map(|i| sum[i] + pixel[i]));
        sum.map(|channel| (channel / (side * side) as f64).round() as u8)
    };
    Small { width: columns, pixels: (0..columns * rows).map(mean).collect() }
}

/// Writes a sheet for each surface into `folder` and returns their names.
///
/// # Errors
/// A file that cannot be written.
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

/// Writes rows below each other, with a title for each column and a legend.
fn write(path: &Path, rows: &[&Row]) -> Result<()> {
    let first = rows.first().and_then(|row| row.pictures.first()).context("a sheet without pictures")?;
    let height = |row: &Row| row.pictures.first().map_or(0, |small| small.pixels.len() / small.width);
    let columns = METHODS.len() + 2;
    let width = columns * (first.width + GAP) + GAP;
    let total = 2 * LINE + rows.iter().map(|row| height(row) + LINE + GAP).sum::<usize>();
    let mut image = RgbImage::from_pixel(width as u32, total as u32, Rgb(PAPER_COLOR));
    let names = ["truth", "dots", "paper", "ours", "ours: error of normals"];
    for (column, name) in names.iter().enumerate() {
        say(&mut image, GAP + column * (first.width + GAP), 3, name);
    }
    let mut y = LINE;
    for row in rows {
        say(&mut image, GAP, y + 3, &row.title);
        y += LINE;
        for (column, small) in row.pictures.iter().enumerate() {
            let x = GAP + column * (first.width + GAP);
            for (at, &pixel) in small.pixels.iter().enumerate() {
                image.put_pixel((x + at % small.width) as u32, (y + at / small.width) as u32, Rgb(pixel));
            }
        }
        y += height(row) + GAP;
    }
    legend(&mut image, GAP + (columns - 1) * (first.width + GAP), y);
    image.save(path).with_context(|| path.display().to_string())
}

fn legend(image: &mut RgbImage, x: usize, y: usize) {
    say(image, x, y + 3, "0");
    for i in 0..80 {
        let color = Rgb(error_color(MOST_DEGREES * i as f64 / 79.0));
        (0..10).for_each(|j| image.put_pixel((x + 12 + i) as u32, (y + 1 + j) as u32, color));
    }
    say(image, x + 96, y + 3, "30 deg");
    for (at, color, name) in [(160, [0, 170, 60], "missing"), (240, [60, 130, 255], "extra")] {
        (0..100).for_each(|i| image.put_pixel((x + at + i % 10) as u32, (y + 1 + i / 10) as u32, Rgb(color)));
        say(image, x + at + 14, y + 3, name);
    }
}

/// Writes ASCII.
fn say(image: &mut RgbImage, x: usize, y: usize, text: &str) {
    for (column, glyph) in text.bytes().map(|byte| BASIC_LEGACY[usize::from(byte) % 128]).enumerate() {
        for (row, bits) in glyph.into_iter().enumerate() {
            for bit in (0..8).filter(|bit| bits >> bit & 1 == 1) {
                let [x, y] = [x + 8 * column + bit, y + row].map(|at| at as u32);
                if x < image.width() && y < image.height() {
                    image.put_pixel(x, y, Rgb(INK));
                }
            }
        }
    }
}
