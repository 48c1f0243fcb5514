//! Cameras as YAML: ROS, OpenCV and others.
//!
//! # How it works
//!
//! Of YAML only lines `key: value` and lists of numbers are read, in one line, over several lines, or an item a line.
//! That covers what calibrations write, and needs no memory beyond the file's own, whatever the file claims.

use super::{PinholeCamera, scale_of};

/// A key with the numbers behind it.
#[derive(Debug, Default)]
struct Entry<'a> {
    indent: usize,
    key: &'a str,
    numbers: Vec<f64>,
}

pub(super) fn parse(text: &str) -> Option<PinholeCamera> {
    let file = File(entries(text));
    let by_projection = || {
        let p = file.list(&["projection_matrix", "P", "p"], 12)?;
        (p[0] > 0.0).then(|| PinholeCamera::new([p[0], p[5], p[2], p[6]]))
    };
    let by_matrix = || PinholeCamera::from_rows(file.list(&["camera_matrix", "K", "k"], 9)?);
    let by_list = || Some(PinholeCamera::new(file.list(&["intrinsics"], 4)?.try_into().ok()?));
    let by_name = || {
        let number = |name: &str| file.number(&[name, &format!("Camera.{name}"), &format!("Camera1.{name}")]);
        Some(PinholeCamera::new([number("fx")?, number("fy")?, number("cx")?, number("cy")?]))
    };
    let camera = by_projection().or_else(by_matrix).or_else(by_list).or_else(by_name)?;
    let width = file.number(&["image_width", "width", "Camera.width"]);
    let height = file.number(&["image_height", "height", "Camera.height"]);
    let resolution = || file.list(&["resolution"], 2).map(|size| [size[0], size[1]]);
    let distortion = file.0.iter().position(|entry| ["distortion_coefficients", "D", "d"].contains(&entry.key));
    let distortion = distortion.and_then(|at| file.under(at).find(|entry| entry.key != "rows" && entry.key != "cols"));
    Some(PinholeCamera {
        size: width.zip(height).map(|(width, height)| [width, height]).or_else(resolution),
        scale: file.number(&["depth_scale", "DepthMapFactor", "RGBD.DepthMapFactor"]).map(scale_of),
        distorted: distortion.is_some_and(|entry| entry.numbers.iter().any(|value| *value != 0.0)),
        ..camera
    })
}

struct File<'a>(Vec<Entry<'a>>);

impl File<'_> {
    /// The first of these keys with one number.
    fn number(&self, names: &[&str]) -> Option<f64> {
        self.0.iter().find(|entry| names.contains(&entry.key) && entry.numbers.len() == 1).map(|entry| entry.numbers[0])
    }

    /// The numbers of the first of these keys that has `len` of them itself or under `data`.
    fn list(&self, names: &[&str], len: usize) -> Option<&[f64]> {
        let mut keys = (0..self.0.len()).filter(|&at| names.contains(&self.0[at].key));
        keys.find_map(|at| self.under(at).find(|entry| entry.numbers.len() == len)).map(|entry| &*entry.numbers)
    }

    /// An entry that has numbers, otherwise the entries under it.
    fn under(&self, at: usize) -> impl Iterator<Item = &Entry<'_>> {
        let own = &self.0[at];
        let alone = !own.numbers.is_empty();
        let below = self.0[at + 1..].iter().take_while(move |entry| !alone && entry.indent > own.indent);
        std::iter::once(own).filter(move |_| alone).chain(below)
    }
}

fn entries(text: &str) -> Vec<Entry<'_>> {
    let mut entries: Vec<Entry<'_>> = Vec::new();
    let mut open = 0_i64;
    for line in text.lines() {
        let line = line.split(" #").next().unwrap_or_default();
        let content = line.trim_start();
        if content.is_empty() || content.starts_with(['#', '%']) || content.starts_with("---") {
            continue;
        }
        let mut value = content;
        let is_item = content.starts_with("- ");
        if let Some((key, rest)) = content.split_once(':').filter(|_| open <= 0 && !is_item) {
            let key = key.trim().trim_matches(['"', '\'']);
            entries.push(Entry { indent: line.len() - content.len(), key, numbers: Vec::new() });
            (value, open) = (rest, 0);
        }
        open += value.matches('[').count() as i64 - value.matches(']').count() as i64;
        if let Some(last) = entries.last_mut() {
            let words = value.split([' ', '\t', ',', '[', ']']);
            last.numbers.extend(words.filter_map(|word| word.trim_matches(['"', '\'']).parse::<f64>().ok()));
        }
    }
    entries
}
