//! Colours of a depth image, from a picture beside it.

use std::{
    fs::{metadata, read as read_file},
    path::{Path, PathBuf},
};

use autosplats_cloud::guard;
use image::{ImageFormat, ImageReader};

use super::decode::{MAX_RATIO, decode};

/// Words that replace `depth` in the name of a colour image.
const WORDS: [&str; 4] = ["color", "rgb", "colour", "image"];

const EXTENSIONS: [&str; 4] = ["png", "jpg", "jpeg", "ppm"];

/// Largest size of a colour image, in bytes.
const MAX_BYTES: u64 = 1 << 28;

/// The colour image of a depth image, found by name: `depth_1.pgm` and `color_1.png`, `depth/1.png` and `rgb/1.jpg`.
pub(in crate::read) fn beside(path: &Path) -> Option<PathBuf> {
    let stem = path.file_stem()?.to_str()?;
    let folder = path.parent()?;
    for word in WORDS {
        let renamed = renamed(stem, word);
        let moved = || Some(folder.with_file_name(renamed_folder(folder, word)?));
        let bases = [
            renamed.as_ref().map(|stem| folder.join(stem)),
            moved().map(|folder| folder.join(stem)),
            moved().zip(renamed.as_ref()).map(|(folder, stem)| folder.join(stem)),
        ];
        for base in bases.into_iter().flatten() {
            // The stem may contain dots, as time stamps do.
            let named = |extension| PathBuf::from(format!("{}.{extension}", base.display()));
            if let Some(found) = EXTENSIONS.into_iter().map(named).find(|path| path.is_file()) {
                return Some(found);
            }
        }
    }
    None
}

fn renamed_folder(folder: &Path, word: &str) -> Option<String> {
    renamed(folder.file_name()?.to_str()?, word)
}

/// Replaces the last `depth` of a name by `word` in the same letter case.
fn renamed(name: &str, word: &str) -> Option<String> {
    let at = name.to_ascii_lowercase().rfind("depth")?;
    let old = &name[at..at + 5];
    let word = match old {
        "depth" => word.to_owned(),
        "DEPTH" => word.to_uppercase(),
        _ => word[..1].to_uppercase() + &word[1..],
    };
    Some(format!("{}{word}{}", &name[..at], &name[at + 5..]))
}

/// The colours of the pixels, or the reason why there are none.
pub(super) fn read(path: &Path, width: usize, height: usize) -> Result<Vec<[u8; 3]>, String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let fault = |what: String| format!("{name}: {what}");
    if metadata(path).map_err(|error| fault(error.to_string()))?.len() > MAX_BYTES {
        return Err(fault("too large for a picture".into()));
    }
    let bytes = read_file(path).map_err(|error| fault(error.to_string()))?;
    let decoded = guard(|| {
        let format = image::guess_format(&bytes).map_err(|error| error.to_string())?;
        if !matches!(format, ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::Pnm) {
            return Err("neither PNG, JPEG nor PPM".into());
        }
        let reader = ImageReader::with_format(std::io::Cursor::new(&bytes), format);
        let size = reader.into_dimensions().map_err(|error| error.to_string())?;
        if size != (width as u32, height as u32) {
            return Err(format!("{} × {} pixels, the depth image has {width} × {height}", size.0, size.1));
        }
        if width * height / MAX_RATIO > bytes.len() {
            return Err("too short for its size".into());
        }
        decode(&bytes, format, width, height)
    });
    let image = decoded.map_err(fault)?.into_rgb8();
    if image.dimensions() != (width as u32, height as u32) {
        return Err(fault("the size of the image differs from its header".into()));
    }
    Ok(image.pixels().map(|pixel| pixel.0).collect())
}
