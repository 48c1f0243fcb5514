//! Poses: files that place an input in the world.

use std::path::Path;

use autosplats_cloud::glam::{DMat4, DQuat, DVec3, DVec4};
use autosplats_cloud::read_text;

use crate::exit::{Exit, Failure};

/// Reads a pose from a text file: a row-major 4x4 or 3x4 matrix, or a translation and a quaternion. Blanks or commas
/// separate the numbers, `#` begins a comment.
pub(super) fn read_pose(path: &Path) -> Result<DMat4, Failure> {
    let text = read_text(path).map_err(|error| error.to_string());
    let bad = |what: String| Failure::new(Exit::Input, format!("{}: {what}", path.display()));
    text.and_then(|text| parse_pose(&text)).map_err(bad)
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
    if let [tx, ty, tz, qx, qy, qz, qw] = numbers[..] {
        let rotation = DQuat::from_xyzw(qx, qy, qz, qw);
        if (rotation.length() - 1.0).abs() > 0.01 {
            return Err(format!("the quaternion {qx} {qy} {qz} {qw} is not a rotation: its length must be 1"));
        }
        return Ok(DMat4::from_rotation_translation(rotation.normalize(), DVec3::new(tx, ty, tz)));
    }
    if numbers.len() == 12 {
        numbers.extend([0.0, 0.0, 0.0, 1.0]);
    }
    let numbers: [f64; 16] = numbers.try_into().map_err(|numbers: Vec<f64>| {
        format!("{} numbers; a pose must be a row-major 4x4 or 3x4 matrix, or tx ty tz qx qy qz qw", numbers.len())
    })?;
    let matrix = DMat4::from_cols_array(&numbers).transpose();
    if matrix.row(3) != DVec4::W {
        return Err("the last row of the matrix must be 0 0 0 1".into());
    }
    if matrix.determinant() == 0.0 {
        return Err("the matrix flattens the points (its determinant is 0)".into());
    }
    Ok(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses() -> Result<(), String> {
        let pose = parse_pose("# a quarter turn\n0 -1 0 10\n1,0,0,20\n[0 0 1 30] # lifted\n")?;
        let moved = pose.transform_point3(DVec3::X);
        assert_eq!(moved, DVec3::new(10.0, 21.0, 30.0), "x turns to y, then moves");
        let turned = parse_pose("10 20 30 0 0 0.7071068 0.7071068")?.transform_point3(DVec3::X);
        assert!(turned.abs_diff_eq(DVec3::new(10.0, 21.0, 30.0), 1e-6), "the same as a quaternion: {turned}");
        for bad in ["", "1 2 3", "1 2 3 0 0 0 0", "1 0 0 0 0 1 0 0 0 0 1 x", "1 0 0 0 0 1 0 0 0 0 nan 0"] {
            assert!(parse_pose(bad).is_err(), "{bad} is no pose");
        }
        assert!(parse_pose("1 0 0 0 0 1 0 0 0 0 0 0").is_err(), "a flat pose");
        assert!(parse_pose("1 0 0 0 0 1 0 0 0 0 1 0 1 2 3 1").is_err(), "a column-major pose");
        Ok(())
    }
}
