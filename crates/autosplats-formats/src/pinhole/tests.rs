//! Tests of camera files.

use glam::DVec3;

use super::*;

const EXPECTED: DepthCamera = DepthCamera { fx: 518.0, fy: 519.0, cx: 325.5, cy: 253.5, scale: None };

fn depth_camera(text: &str) -> Option<DepthCamera> {
    PinholeCamera::parse(text).map(|camera| camera.depth_camera(640, 480))
}

#[test]
fn cameras_of_every_spelling() {
    for text in [
        r#"{"width": 640, "height": 480, "intrinsic_matrix": [518.0, 0, 0, 0, 519.0, 0, 325.5, 253.5, 1]}"#,
        r#"{"intrinsic_matrix": [518.0, 0, 325.5, 0, 519.0, 253.5, 0, 0, 1]}"#,
        r#"{"intrinsic_matrix": [[518.0, 0, 325.5], [0, 519.0, 253.5], [0, 0, 1]]}"#,
        r#"{"K": [518.0, 0, 325.5, 0, 519.0, 253.5, 0, 0, 1], "width": 640, "height": 480}"#,
        r#"{"w": 320, "h": 240, "fl_x": 259, "fl_y": 259.5, "cx": 162.75, "cy": 126.75}"#,
        "518 0 325.5\n0 519 253.5\n0 0 1\n",
        "# fx fy cx cy\n518, 519, 325.5, 253.5",
        "518 0 325.5 0 0 519 253.5 0 0 0 1 0 0 0 0 1",
        // ROS's camera_calibration.
        "image_width: 640\nimage_height: 480\ncamera_name: depth\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [518., 0., \
         325.5,\n         0., 519., 253.5,\n         0., 0., 1.]\ndistortion_model: plumb_bob\n",
        // A projection matrix precedes the camera's own.
        "camera_matrix:\n  rows: 3\n  cols: 3\n  data: [500, 0, 320, 0, 500, 240, 0, 0, 1]\nprojection_matrix:\n  rows: 3\n  \
         cols: 4\n  data: [518, 0, 325.5, 0, 0, 519, 253.5, 0, 0, 0, 1, 0]\n",
        // One that is not set does not.
        "K: [518.0, 0.0, 325.5, 0.0, 519.0, 253.5, 0.0, 0.0, 1.0]\nP: [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]\n",
        // A message of ROS 2 as its tools print it.
        "header:\n  stamp:\n    sec: 7\n  frame_id: depth\nheight: 480\nwidth: 640\nd:\n- 0.0\n- 0.0\nk:\n- 518.0\n- 0.0\n\
         - 325.5\n- 0.0\n- 519.0\n- 253.5\n- 0.0\n- 0.0\n- 1.0\n---\n",
        "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 5.18e+02, 0., 3.255e+02, \
         0.,\n       5.19e+02, 2.535e+02, 0., 0., 1. ]\n",
        "cam0:\n  camera_model: pinhole\n  intrinsics: [259, 259.5, 162.75, 126.75]\n  resolution: [320, 240]\n",
        "%YAML:1.0\nCamera.fx: 518.0 # pixels\nCamera.fy: 519.0\nCamera.cx: 325.5\nCamera.cy: 253.5\n",
    ] {
        assert_eq!(depth_camera(text), Some(EXPECTED), "{text}");
    }
    let scale = |text| PinholeCamera::parse(text).and_then(|camera| camera.scale);
    assert_eq!(scale("518 519 325.5 253.5 5000"), Some(5000.0), "behind the numbers");
    assert_eq!(scale("518 0 325.5\n0 519 253.5\n0 0 1\n1000"), Some(1000.0), "behind a matrix");
    assert_eq!(
        scale(r#"{"fx": 1, "fy": 1, "ppx": 1, "ppy": 1, "depth_scale": 0.001}"#),
        Some(1000.0),
        "metres a value"
    );
    assert_eq!(scale("fx: 1\nfy: 1\ncx: 1\ncy: 1\nDepthMapFactor: 5000.0\n"), Some(5000.0), "by name");
    for text in [
        "",
        "1 2 3",
        "518 0 0 0 519 0 325.5 253.5 1",
        "0 519 1 1",
        "{}",
        "[1, 2]",
        "x 1 2 3",
        "nan 1 2 3",
        "camera_matrix:\n  data: [518, 0, 325.5, 0, 519]\n",
        "K: [0, 0, 0, 0, 0, 0, 0, 0, 0]\n",
        "width: 640\nheight: 480\n",
        r#"{"parameters": []}"#,
    ] {
        assert_eq!(PinholeCamera::parse(text), None, "{text} is no camera");
    }
}

#[test]
fn distortion_is_known() {
    let with = |d: &str| {
        let text = format!("K: [518, 0, 325, 0, 519, 253, 0, 0, 1]\n{d}\nwidth: 640\nheight: 480\n");
        PinholeCamera::parse(&text).expect("a camera").distorted
    };
    assert!(
        with("D: [0.1, -0.2, 0, 0, 0]") && with("distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0, 1e-3, 0]")
    );
    assert!(
        !with("D: [0, 0, 0, 0, 0]") && !with("distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0., 0., 0.]")
    );
}

#[test]
fn poses_of_open3d() {
    // A camera at (1, 2, 3) that looks along x, with z up.
    let axes = [DVec3::NEG_Y, DVec3::NEG_Z, DVec3::X];
    let eye = DVec3::new(1.0, 2.0, 3.0);
    let rows: Vec<[f64; 4]> = axes.iter().map(|axis| [axis.x, axis.y, axis.z, -axis.dot(eye)]).collect();
    let rows = [rows, vec![[0.0, 0.0, 0.0, 1.0]]].concat();
    let columns: Vec<f64> = (0..4).flat_map(|column| rows.iter().map(move |row| row[column])).collect();
    let inner = r#""intrinsic": {"width": 640, "height": 480, "intrinsic_matrix": [500,0,0,0,500,0,319.5,239.5,1]}"#;
    let parameters = |extrinsic: String| format!("{{\"extrinsic\": {extrinsic}, {inner}}}");
    let open3d = parameters(format!("{columns:?}"));
    let several = format!("{{\"class_name\": \"PinholeCameraTrajectory\", \"parameters\": [{open3d}, {open3d}]}}");
    for (text, cameras) in [(open3d, 1), (several, 2), (parameters(format!("{rows:?}")), 1)] {
        let camera = PinholeCamera::parse(&text).expect("a camera");
        let pose = camera.world_from_camera.expect("a pose");
        assert!((pose.w_axis.truncate() - eye).length() < 1e-12, "{pose}");
        assert!((pose.z_axis.truncate() - DVec3::X).length() < 1e-12, "{pose}");
        assert_eq!(camera.cameras, cameras);
    }
    for bad in ["[1, 2]", "[1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,2]", "[9,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]", "3"] {
        assert_eq!(PinholeCamera::parse(&parameters(bad.into())), None, "{bad} is no pose");
    }
}
