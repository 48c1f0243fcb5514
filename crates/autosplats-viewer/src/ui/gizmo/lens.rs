//! Geometry between window and world: lines of sight, the handle under the pointer, and the distance of a drag.

use autosplats::cloud::glam::{DVec2, DVec3};
use autosplats::{Camera, Lens};
use eframe::egui::{Color32, Pos2, Rect, vec2};

/// Colour of the handle that is dragged or would be.
pub(super) const GRABBED_COLOR: Color32 = Color32::from_rgb(255, 205, 60);
/// Largest distance from the pointer to a handle that takes it, screen points.
const REACH_POINTS: f32 = 9.0;
/// Advantage of a dot over a line in the choice of the nearest handle, screen points.
const DOT_ADVANTAGE_POINTS: f32 = 4.0;
/// Squared sine of the angle between a line of sight and an axis, below which a drag along the axis is ambiguous: 4
/// degrees.
const END_ON_SINE_2: f64 = 5e-3;
/// Sine of the angle between a line of sight and a plane, below which the plane is seen edge on: 4 degrees.
const EDGE_ON_SINE: f64 = 0.07;

/// A line of sight: origin and unit direction, world space.
pub(super) type Ray = (DVec3, DVec3);

/// Projection between world and window.
pub(super) struct WindowLens {
    lens: Lens,
    rect: Rect,
    /// Pixels per screen point.
    scale: f64,
    /// Unit vector of the view direction, world space.
    pub(super) forward: DVec3,
}

impl WindowLens {
    /// The projection of `camera` in a picture of `size` pixels, shown in `rect`.
    pub(super) fn new(camera: &Camera, rect: Rect, size: [u32; 2]) -> Option<Self> {
        let lens = camera.lens(size).ok()?;
        let [_, _, forward] = camera.axes().ok()?;
        let scale = f64::from(size[0]) / f64::from(rect.width().max(1.0));
        Some(Self { lens, rect, scale, forward })
    }

    /// Window position and depth of a world position.
    pub(super) fn seen(&self, world: DVec3) -> Option<(Pos2, f64)> {
        let (pixel, depth) = self.lens.to_pixel(world)?;
        let pixel = pixel / self.scale;
        Some((self.rect.min + vec2(pixel.x as f32, pixel.y as f32), depth))
    }

    /// Window position of a world position.
    pub(super) fn place(&self, world: DVec3) -> Option<Pos2> {
        self.seen(world).map(|(place, _)| place)
    }

    /// A window position in shares of the picture's sides, 0 to 1.
    pub(super) fn share(&self, place: Pos2) -> DVec2 {
        let at = (place - self.rect.min) / self.rect.size();
        DVec2::new(at.x.into(), at.y.into())
    }

    fn pixel(&self, place: Pos2) -> DVec2 {
        let at = place - self.rect.min;
        DVec2::new(at.x.into(), at.y.into()) * self.scale
    }

    /// The line of sight through a window position.
    pub(super) fn ray(&self, place: Pos2) -> Ray {
        self.lens.ray(self.pixel(place))
    }

    /// Unit vector of the line of sight to a world position.
    pub(super) fn sight(&self, world: DVec3) -> Option<DVec3> {
        self.place(world).map(|place| self.ray(place).1)
    }

    /// Length of a screen point at the depth of `world`, world units.
    pub(super) fn unit(&self, world: DVec3) -> Option<f64> {
        let (pixel, depth) = self.lens.to_pixel(world)?;
        let aside = self.lens.unproject(pixel + DVec2::new(self.scale, 0.0), depth);
        Some(aside.distance(self.lens.unproject(pixel, depth)))
    }
}

/// Shape of a handle in the window.
pub(super) enum Shape {
    Dot(Pos2),
    Line(Pos2, Pos2),
    /// A closed polyline.
    Loop(Vec<Pos2>),
}

impl Shape {
    fn distance(&self, place: Pos2) -> f32 {
        match self {
            Self::Dot(dot) => dot.distance(place) - DOT_ADVANTAGE_POINTS,
            Self::Line(from, to) => distance(*from, *to, place),
            Self::Loop(places) => {
                let next = places.iter().cycle().skip(1);
                places.iter().zip(next).map(|(&from, &to)| distance(from, to, place)).fold(f32::INFINITY, f32::min)
            }
        }
    }
}

/// Distance from a place to a line segment.
fn distance(from: Pos2, to: Pos2, place: Pos2) -> f32 {
    let (along, way) = (to - from, place - from);
    let part = along.dot(way) / along.length_sq();
    // A segment of length zero is a point.
    let part = if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 };
    (from + along * part).distance(place)
}

/// The handle under the pointer: the nearest one within reach.
pub(super) fn nearest<T: Copy>(handles: &[(T, Shape)], place: Pos2) -> Option<T> {
    let distances = handles.iter().map(|(handle, shape)| (*handle, shape.distance(place)));
    let near = distances.filter(|(_, distance)| *distance < REACH_POINTS);
    near.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(handle, _)| handle)
}

/// Offset from `origin` along the unit vector `axis` of the point of the line that is nearest to a line of sight.
/// `None` if the line is seen end on.
pub(super) fn along(origin: DVec3, axis: DVec3, (eye, sight): Ray) -> Option<f64> {
    let between = origin - eye;
    let cosine = axis.dot(sight);
    let sine_2 = 1.0 - cosine * cosine;
    let way = (cosine * sight.dot(between) - axis.dot(between)) / sine_2;
    (sine_2 > END_ON_SINE_2 && way.is_finite()).then_some(way)
}

/// Intersection of a line of sight with a plane. `None` if the plane is seen edge on.
pub(super) fn on_plane(origin: DVec3, normal: DVec3, (eye, sight): Ray) -> Option<DVec3> {
    let sine = normal.dot(sight);
    let place = eye + sight * (normal.dot(origin - eye) / sine);
    (sine.abs() > EDGE_ON_SINE && place.is_finite()).then_some(place)
}

/// Angle about an axis from one direction to another, radians, -π to π.
pub(super) fn angle(axis: DVec3, from: DVec3, to: DVec3) -> f64 {
    let [from, to] = [from, to].map(|way| way.reject_from_normalized(axis));
    axis.dot(from.cross(to)).atan2(from.dot(to))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use autosplats::Projection;
    use eframe::egui::pos2;

    /// A place so far from the origin that the step of `f32` is half a metre.
    pub(in crate::ui::gizmo) const FAR: DVec3 = DVec3::new(512_000.0, 5_400_000.0, 300.0);

    /// A perspective and an orthographic view of [`FAR`].
    pub(in crate::ui::gizmo) fn views() -> impl Iterator<Item = WindowLens> {
        let rect = Rect::from_min_size(pos2(200.0, 30.0), vec2(600.0, 400.0));
        [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(8.0)].into_iter().map(move |projection| {
            let camera = Camera { eye: FAR + DVec3::new(4.0, -10.0, 5.0), look_at: FAR, up: DVec3::Z, projection };
            WindowLens::new(&camera, rect, [1200, 800]).expect("a camera that sees")
        })
    }

    #[test]
    fn lines_of_sight_lead_to_what_is_seen() {
        for view in views() {
            let world = FAR + DVec3::new(1.0, 2.0, -0.5);
            let place = view.place(world).expect("before the eye");
            let (eye, sight) = view.ray(place);
            // A tenth of a pixel, as window positions are f32.
            assert!((world - eye).cross(sight).length() < 2e-3, "{world} is not on its line of sight");
            let unit = view.unit(world).expect("before the eye");
            let right = view.forward.cross(DVec3::Z).normalize();
            let beside = view.place(world + right * (100.0 * unit)).expect("before the eye");
            assert!(((beside - place).length() - 100.0).abs() < 0.1, "a hundred points are {:?}", beside - place);
            assert!(view.sight(world).is_some_and(|way| way.dot(sight) > 0.999_999), "one direction");
        }
    }

    #[test]
    fn drags_along_an_axis_follow_the_pointer() {
        for view in views() {
            for axis in [DVec3::X, DVec3::Z, DVec3::new(0.6, 0.8, 0.0)] {
                for way in [-1.5, 0.0, 0.75] {
                    let place = view.place(FAR + axis * way).expect("before the eye");
                    let found = along(FAR, axis, view.ray(place)).expect("seen from the side");
                    assert!((found - way).abs() < 2e-3, "{found} is not {way} along {axis}");
                    // Beside the line, the nearest point of the line counts.
                    let up = view.ray(place).1.cross(axis).normalize();
                    let beside = view.place(FAR + axis * way + up * 0.2).expect("before the eye");
                    let found = along(FAR, axis, view.ray(beside)).expect("seen from the side");
                    assert!((found - way).abs() < 0.02, "beside it {found} is not {way} along {axis}");
                }
            }
            let sight = view.sight(FAR).expect("before the eye");
            let place = view.place(FAR).expect("before the eye");
            assert_eq!(along(FAR, sight, view.ray(place)), None, "end on no way is seen");
        }
    }

    #[test]
    fn drags_in_a_plane_follow_the_pointer() {
        for view in views() {
            let (a, b) = (FAR + DVec3::new(1.0, 0.5, 0.0), FAR + DVec3::new(-0.5, 1.0, 0.0));
            let [from, to] = [a, b].map(|world| {
                let place = view.place(world).expect("before the eye");
                on_plane(FAR, DVec3::Z, view.ray(place)).expect("seen from above")
            });
            assert!(from.distance(a) < 4e-3 && to.distance(b) < 4e-3, "{from} and {to}");
            let turned = angle(DVec3::Z, from - FAR, to - FAR).to_degrees();
            assert!((turned - 90.0).abs() < 0.3, "a quarter turn is {turned} degrees");
            assert!((angle(DVec3::NEG_Z, from - FAR, to - FAR).to_degrees() + 90.0).abs() < 0.3, "backward from below");
            let sight = view.sight(FAR).expect("before the eye");
            let place = view.place(FAR).expect("before the eye");
            assert_eq!(
                on_plane(FAR, sight.any_orthonormal_vector(), view.ray(place)),
                None,
                "edge on no plane is seen"
            );
        }
    }

    #[test]
    fn the_nearest_handle_is_taken() {
        let square = vec![pos2(0.0, 0.0), pos2(100.0, 0.0), pos2(100.0, 100.0), pos2(0.0, 100.0)];
        let handles = [
            ('d', Shape::Dot(pos2(50.0, 50.0))),
            ('l', Shape::Line(pos2(50.0, 50.0), pos2(50.0, 20.0))),
            ('r', Shape::Loop(square)),
            ('p', Shape::Line(pos2(300.0, 300.0), pos2(300.0, 300.0))),
        ];
        let wanted = [
            ([50.0, 52.0], Some('d')),
            ([52.0, 46.0], Some('d')),
            ([51.0, 35.0], Some('l')),
            ([50.0, 4.0], Some('r')),
            ([-5.0, 50.0], Some('r')),
            ([30.0, 50.0], None),
            ([303.0, 304.0], Some('p')),
            ([f32::NAN, 50.0], None),
        ];
        for ([x, y], wanted) in wanted {
            assert_eq!(nearest(&handles, pos2(x, y)), wanted, "at {x}, {y}");
        }
        assert_eq!(nearest::<char>(&[], pos2(0.0, 0.0)), None, "of none");
    }
}
