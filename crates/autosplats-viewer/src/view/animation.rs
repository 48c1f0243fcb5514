//! Camera paths for films: one camera per picture.

use autosplats::cloud::glam::{DQuat, DVec3};
use autosplats::{Camera, Projection};

/// Cameras of a turn of `degrees` in all about the vertical through the pivot, `pictures` of them. The last camera
/// stops one step short of the full angle, so that the film loops.
pub(crate) fn turntable(camera: &Camera, up: DVec3, degrees: f64, pictures: usize) -> Vec<Camera> {
    let turned = |picture: usize| {
        let turn = DQuat::from_axis_angle(up, (degrees * picture as f64 / pictures.max(1) as f64).to_radians());
        Camera { eye: camera.look_at + turn * (camera.eye - camera.look_at), up: turn * camera.up, ..*camera }
    };
    (0..pictures).map(turned).collect()
}

/// Cameras of a smooth path through `keys`, `pictures` of them. The first and the last camera are the first and the
/// last key.
pub(crate) fn path(keys: &[Camera], pictures: usize) -> Vec<Camera> {
    match keys {
        [] => Vec::new(),
        [only] => vec![*only; pictures],
        keys => {
            let spans = (keys.len() - 1) as f64;
            let last = pictures.saturating_sub(1).max(1) as f64;
            (0..pictures).map(|picture| at(keys, spans * picture as f64 / last)).collect()
        }
    }
}

/// The camera at `time`, counted in keys.
fn at(keys: &[Camera], time: f64) -> Camera {
    let span = (time.floor() as usize).min(keys.len() - 2);
    let part = (time - span as f64).clamp(0.0, 1.0);
    let around = [span.saturating_sub(1), span, span + 1, (span + 2).min(keys.len() - 1)].map(|key| keys[key]);
    let smooth = |value: fn(&Camera) -> DVec3| {
        let [a, b, c, d] = around.map(|key| value(&key));
        // Catmull-Rom spline: it passes through b and c, and its tangent at b is parallel to c - a.
        let t = part;
        0.5 * (2.0 * b
            + (c - a) * t
            + (2.0 * a - 5.0 * b + 4.0 * c - d) * t * t
            + (3.0 * b - a - 3.0 * c + d) * t * t * t)
    };
    let [_, from, to, _] = around;
    let eye = smooth(|camera| camera.eye);
    let look_at = smooth(|camera| camera.look_at);
    let up = from.up.normalize_or(DVec3::Z).lerp(to.up.normalize_or(DVec3::Z), part);
    let projection = match (from.projection, to.projection) {
        (Projection::PerspectiveFovDeg(a), Projection::PerspectiveFovDeg(b)) => {
            Projection::PerspectiveFovDeg(a + (b - a) * part)
        }
        (Projection::OrthographicHeight(a), Projection::OrthographicHeight(b)) => {
            Projection::OrthographicHeight(a * (b / a).powf(part))
        }
        (from, to) => {
            if part < 0.5 {
                from
            } else {
                to
            }
        }
    };
    let camera = Camera { eye, look_at, up, projection };
    // Where the interpolated camera is invalid, the nearer key is used.
    if camera.check().is_ok() {
        camera
    } else if part < 0.5 {
        from
    } else {
        to
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(x: f64) -> Camera {
        Camera {
            eye: DVec3::new(x, -10.0, 3.0),
            look_at: DVec3::new(x, 0.0, 0.0),
            up: DVec3::Z,
            projection: Projection::PerspectiveFovDeg(40.0),
        }
    }

    #[test]
    fn a_turntable_goes_round_and_does_not_repeat_itself() {
        let cameras = turntable(&camera(0.0), DVec3::Z, 360.0, 8);
        assert_eq!(cameras.len(), 8, "one a picture");
        assert!(cameras[0].eye.distance(DVec3::new(0.0, -10.0, 3.0)) < 1e-9, "begins where the eye is");
        assert!(cameras[2].eye.distance(DVec3::new(10.0, 0.0, 3.0)) < 1e-9, "a quarter: {}", cameras[2].eye);
        assert!(cameras[7].eye.distance(cameras[0].eye) > 1.0, "the last is not the first");
    }

    #[test]
    fn a_path_goes_through_its_keys() {
        let keys = [camera(0.0), camera(5.0), camera(7.0)];
        let cameras = path(&keys, 41);
        for (key, picture) in keys.iter().zip([0, 20, 40]) {
            assert!(cameras[picture].eye.distance(key.eye) < 1e-9, "picture {picture}: {}", cameras[picture].eye);
        }
        let steps = cameras.windows(2).map(|ends| ends[0].eye.distance(ends[1].eye));
        assert!(steps.fold(0.0, f64::max) < 0.5, "it does not jump");
        assert!(path(&[], 5).is_empty() && path(&keys[..1], 5).len() == 5, "few keys are no harm");
    }
}
