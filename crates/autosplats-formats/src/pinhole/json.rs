//! Cameras as JSON: Open3D's classes, or values by name.

use glam::DMat4;
use serde_json::Value;

use super::{PinholeCamera, scale_of};

/// Parses an object. Open3D's classes are an intrinsic, parameters with an `intrinsic`, or a trajectory of
/// `parameters`.
pub(super) fn parse(text: &str) -> Option<PinholeCamera> {
    let file: Value = serde_json::from_str(text).ok()?;
    let trajectory = file.get("parameters").and_then(Value::as_array);
    let json = trajectory.map_or(Some(&file), |cameras| cameras.first())?;
    let inner = json.get("intrinsic").unwrap_or(json);
    let value = |names: &[&str]| names.iter().find_map(|name| inner.get(name).or(json.get(name)).or(file.get(name)));
    let number = |names: &[&str]| value(names)?.as_f64();
    let camera = if let Some(matrix) = value(&["intrinsic_matrix"]) {
        let k = flat(matrix)?;
        // Open3D's matrix goes column by column, that of others row by row: the row 0 0 1 tells.
        let columns = k.len() == 9 && k[2] == 0.0 && k[5] == 0.0;
        if columns { PinholeCamera::new([k[0], k[4], k[6], k[7]]) } else { PinholeCamera::from_rows(&k)? }
    } else if let Some(matrix) = value(&["K", "k", "camera_matrix"]) {
        PinholeCamera::from_rows(&flat(matrix.get("data").unwrap_or(matrix))?)?
    } else {
        let [fx, fy] = [&["fx", "fl_x"], &["fy", "fl_y"]].map(|names| number(names));
        PinholeCamera::new([fx?, fy?, number(&["cx", "ppx"])?, number(&["cy", "ppy"])?])
    };
    let extrinsic = value(&["extrinsic"]);
    Some(PinholeCamera {
        size: number(&["width", "w"]).zip(number(&["height", "h"])).map(|(width, height)| [width, height]),
        scale: number(&["depth_scale", "scale"]).map(scale_of),
        world_from_camera: match extrinsic {
            Some(matrix) => Some(pose(&flat(matrix)?)?),
            None => None,
        },
        cameras: trajectory.map_or(1, Vec::len),
        ..camera
    })
}

/// The numbers of a list, or of a list of lists row by row.
fn flat(list: &Value) -> Option<Vec<f64>> {
    let mut numbers = Vec::new();
    for item in list.as_array()? {
        match item {
            Value::Array(row) => {
                for item in row {
                    numbers.push(item.as_f64()?);
                }
            }
            item => numbers.push(item.as_f64()?),
        }
    }
    Some(numbers)
}

/// The pose of an extrinsic, the 4 × 4 matrix from world to camera. It goes column by column as Open3D writes it, or
/// row by row: the row 0 0 0 1 tells. With neither or both, it is no pose or goes column by column.
fn pose(matrix: &[f64]) -> Option<DMat4> {
    let matrix: &[f64; 16] = matrix.try_into().ok()?;
    let columns = DMat4::from_cols_array(matrix);
    let is_pose = |pose: &DMat4| pose.row(3).to_array() == [0.0, 0.0, 0.0, 1.0];
    let camera_from_world = [columns, columns.transpose()].into_iter().find(is_pose)?;
    let turn = glam::DMat3::from_mat4(camera_from_world);
    let is_turn = (turn * turn.transpose()).abs_diff_eq(glam::DMat3::IDENTITY, 1e-3) && turn.determinant() > 0.0;
    is_turn.then(|| camera_from_world.inverse())
}
