//! Inputs: files and generated scenes, each perhaps placed by a pose, read into one cloud.

use std::fs::{metadata, read_to_string};
use std::path::{Path, PathBuf};

use autosplats_cloud::glam::{DMat4, DVec4};
use autosplats_cloud::{Error, PointCloud, Progress as _, Scene, check_memory};

use crate::exit::{Exit, Failure, suggest};
use crate::progress::Bar;

/// What begins the name of a generated scene.
const SCENE_PREFIX: &str = "scene:";

/// Bytes a generated point takes: position, and colour or class.
const BYTES_PER_GENERATED_POINT: u64 = 16;

/// The inputs of one command, known to exist.
#[derive(Debug)]
pub(crate) struct Inputs {
    list: Vec<Input>,
}

/// One input and where it stands in the world.
#[derive(Debug)]
struct Input {
    name: String,
    source: Source,
    world_from_input: DMat4,
}

#[derive(Debug)]
enum Source {
    File(PathBuf),
    Scene(Scene, usize),
}

impl Inputs {
    /// Looks at what was typed, without reading a point: names of scenes, existence of files, poses.
    pub(crate) fn new(names: &[String], poses: &[String]) -> Result<Self, Failure> {
        let mut list = names.iter().map(|name| Input::new(name)).collect::<Result<Vec<_>, _>>()?;
        let generated = list.iter().map(Input::generated_points).sum::<u64>();
        check_memory(&format!("{generated} generated points"), generated * BYTES_PER_GENERATED_POINT)
            .map_err(read_failure)?;
        for pose in poses {
            let (input, matrix) = list
                .iter_mut()
                .filter_map(|input| {
                    let matrix = pose.strip_prefix(&input.name)?.strip_prefix('=')?.to_owned();
                    Some((input, matrix))
                })
                // Of `a` and `a=b` the longer name is meant.
                .max_by_key(|(input, _)| input.name.len())
                .ok_or_else(|| {
                    Failure::usage(format!(
                        "--pose {pose}: it has to be INPUT=FILE with one of the inputs as typed: {}",
                        names.join(", ")
                    ))
                })?;
            input.world_from_input = read_pose(Path::new(&matrix))?;
        }
        Ok(Self { list })
    }

    /// The files among the inputs.
    pub(crate) fn files(&self) -> impl Iterator<Item = &Path> {
        self.list.iter().filter_map(|input| match &input.source {
            Source::File(path) => Some(path.as_path()),
            Source::Scene(..) => None,
        })
    }

    /// The scene, if one scene is all there is, where it was generated.
    pub(crate) fn only_scene(&self) -> Option<&Scene> {
        match self.list.as_slice() {
            [Input { source: Source::Scene(scene, _), world_from_input, .. }]
                if *world_from_input == DMat4::IDENTITY =>
            {
                Some(scene)
            }
            _ => None,
        }
    }

    /// Reads everything into one cloud.
    pub(crate) fn read(&self, quiet: bool) -> Result<PointCloud, Failure> {
        let mut clouds = Vec::with_capacity(self.list.len());
        for input in &self.list {
            let cloud = input.read(quiet)?;
            if cloud.is_empty() {
                return Err(Failure::new(Exit::Input, format!("{}: there is no point in it", input.name)));
            }
            clouds.push((cloud, input.world_from_input));
        }
        Ok(PointCloud::merge(clouds))
    }
}

impl Input {
    fn new(name: &str) -> Result<Self, Failure> {
        let source = if name.starts_with(SCENE_PREFIX) {
            let (scene, count) = Scene::parse(name).map_err(unknown_scene)?;
            Source::Scene(scene, count)
        } else {
            let path = PathBuf::from(name);
            let metadata = metadata(&path).map_err(|error| {
                let hint = if Scene::names().any(|(scene, _)| scene == name) {
                    format!("; for the scene type scene:{name}")
                } else {
                    String::new()
                };
                Failure::new(Exit::Input, format!("{name}: {error}{hint}"))
            })?;
            if metadata.is_dir() {
                return Err(Failure::new(Exit::Input, format!("{name}: a folder; name the files in it")));
            }
            Source::File(path)
        };
        Ok(Self { name: name.into(), source, world_from_input: DMat4::IDENTITY })
    }

    /// Points that will be made, if it is a scene.
    fn generated_points(&self) -> u64 {
        match &self.source {
            Source::File(_) => 0,
            Source::Scene(_, count) => *count as u64,
        }
    }

    fn read(&self, quiet: bool) -> Result<PointCloud, Failure> {
        match &self.source {
            Source::File(path) => {
                let bar = Bar::on_file("reading", path, quiet);
                autosplats_cloud::read(path, &bar).map_err(read_failure)
            }
            Source::Scene(scene, count) => {
                let bar = Bar::new(&format!("generating {}", self.name), quiet);
                scene
                    .sample(*count, &|done| {
                        bar.report(done);
                        !bar.cancelled()
                    })
                    .map_err(read_failure)
            }
        }
    }
}

fn unknown_scene(error: Error) -> Failure {
    Failure::usage(match error {
        Error::UnknownScene { given, .. } => {
            format!("no scene is called '{given}'; {}", suggest(&given, Scene::names().map(|(name, _)| name)))
        }
        other => other.to_string(),
    })
}

/// What failing to read is to the caller of the program.
pub(crate) fn read_failure(error: Error) -> Failure {
    match error {
        Error::Cancelled => Failure::interrupted(),
        Error::OutOfMemory { .. } => Failure::new(Exit::Memory, error),
        _ => Failure::new(Exit::Input, error),
    }
}

/// Reads a row-major 4x4 or 3x4 matrix from a text file: numbers separated by blanks or commas, `#` begins a comment.
fn read_pose(path: &Path) -> Result<DMat4, Failure> {
    let text =
        read_to_string(path).map_err(|error| Failure::new(Exit::Input, format!("{}: {error}", path.display())))?;
    parse_pose(&text).map_err(|what| Failure::new(Exit::Input, format!("{}: {what}", path.display())))
}

fn parse_pose(text: &str) -> Result<DMat4, String> {
    let words = text
        .lines()
        .flat_map(|line| line.split('#').next().unwrap_or_default().split([' ', '\t', ',', ';', '[', ']']))
        .filter(|word| !word.is_empty());
    let mut numbers = words
        .map(|word| {
            word.parse().ok().filter(|number: &f64| number.is_finite()).ok_or(format!("'{word}' is not a number"))
        })
        .collect::<Result<Vec<f64>, _>>()?;
    if numbers.len() == 12 {
        numbers.extend([0.0, 0.0, 0.0, 1.0]);
    }
    let numbers: [f64; 16] = numbers.try_into().map_err(|numbers: Vec<f64>| {
        format!("{} numbers; a pose is a row-major matrix of 4x4 or 3x4", numbers.len())
    })?;
    let matrix = DMat4::from_cols_array(&numbers).transpose();
    if matrix.row(3) != DVec4::W {
        return Err("the last row of a pose is 0 0 0 1".into());
    }
    if matrix.determinant() == 0.0 {
        return Err("the matrix flattens the points (its determinant is 0)".into());
    }
    Ok(matrix)
}

#[cfg(test)]
mod tests {
    use autosplats_cloud::glam::DVec3;

    use super::*;

    #[test]
    fn poses() -> Result<(), String> {
        let pose = parse_pose("# a quarter turn\n0 -1 0 10\n1,0,0,20\n[0 0 1 30] # lifted\n")?;
        let moved = pose.transform_point3(DVec3::X);
        assert_eq!(moved, DVec3::new(10.0, 21.0, 30.0), "x turns to y, then moves");
        for bad in ["", "1 2 3", "1 0 0 0 0 1 0 0 0 0 1 x", "1 0 0 0 0 1 0 0 0 0 nan 0"] {
            assert!(parse_pose(bad).is_err(), "{bad} is no pose");
        }
        assert!(parse_pose("1 0 0 0 0 1 0 0 0 0 0 0").is_err(), "a flat pose");
        assert!(parse_pose("1 0 0 0 0 1 0 0 0 0 1 0 1 2 3 1").is_err(), "a column-major pose");
        Ok(())
    }
}
