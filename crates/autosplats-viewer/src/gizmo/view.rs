//! Between the window and the world: lines of sight, what the pointer is on, and how far something goes that is dragged.

use autosplats::cloud::glam::{DVec2, DVec3};
use autosplats::{Camera, Lens};
use eframe::egui::{Pos2, Rect, vec2};

/// How far from a handle the pointer may be to take it, screen points.
const REACH: f32 = 9.0;
/// By how much a dot may be further away than a line and is taken nevertheless, screen points.
const DOTS_FIRST: f32 = 4.0;
/// Square of the sine of the angle between a line of sight and an axis below which it cannot be told how far a drag along
/// the axis goes: 4 degrees.
const END_ON: f64 = 5e-3;
/// Sine of the angle between a line of sight and a plane below which the plane is seen edge on: 4 degrees.
const EDGE_ON: f64 = 0.07;

/// A line of sight: where it begins and its direction, of length 1.
pub(super) type Ray = (DVec3, DVec3);

/// The window's picture as a map of the world.
pub(super) struct View {
    lens: Lens,
    rect: Rect,
    /// Pixels of the picture by screen points.
    scale: f64,
    /// Where the eye looks.
    pub(super) forward: DVec3,
}

impl View {
    /// The picture of so many pixels that `camera` takes, shown in `rect`.
    pub(super) fn new(camera: &Camera, rect: Rect, size: [u32; 2]) -> Option<Self> {
        let lens = camera.lens(size).ok()?;
        let [_, _, forward] = camera.axes().ok()?;
        let scale = f64::from(size[0]) / f64::from(rect.width().max(1.0));
        Some(Self { lens, rect, scale, forward })
    }

    /// Where a place is seen, and how far away.
    pub(super) fn seen(&self, world: DVec3) -> Option<(Pos2, f64)> {
        let (pixel, depth) = self.lens.to_pixel(world)?;
        let pixel = pixel / self.scale;
        Some((self.rect.min + vec2(pixel.x as f32, pixel.y as f32), depth))
    }

    /// Where a place is seen.
    pub(super) fn place(&self, world: DVec3) -> Option<Pos2> {
        self.seen(world).map(|(place, _)| place)
    }

    /// A place of the window by the picture's sides, 0 to 1.
    pub(super) fn share(&self, place: Pos2) -> DVec2 {
        let at = (place - self.rect.min) / self.rect.size();
        DVec2::new(at.x.into(), at.y.into())
    }

    fn pixel(&self, place: Pos2) -> DVec2 {
        let at = place - self.rect.min;
        DVec2::new(at.x.into(), at.y.into()) * self.scale
    }

    /// The line of sight through a place of the window.
    pub(super) fn ray(&self, place: Pos2) -> Ray {
        self.lens.ray(self.pixel(place))
    }

    /// The direction in which a place is seen, of length 1.
    pub(super) fn sight(&self, world: DVec3) -> Option<DVec3> {
        self.place(world).map(|place| self.ray(place).1)
    }

    /// How long a screen point is where `world` is.
    pub(super) fn unit(&self, world: DVec3) -> Option<f64> {
        let (pixel, depth) = self.lens.to_pixel(world)?;
        let aside = self.lens.unproject(pixel + DVec2::new(self.scale, 0.0), depth);
        Some(aside.distance(self.lens.unproject(pixel, depth)))
    }
}

/// What a handle looks like to the pointer.
pub(super) enum Shape {
    Dot(Pos2),
    Line(Pos2, Pos2),
    /// A line that goes round.
    Loop(Vec<Pos2>),
}

impl Shape {
    fn distance(&self, place: Pos2) -> f32 {
        match self {
            Self::Dot(dot) => dot.distance(place) - DOTS_FIRST,
            Self::Line(from, to) => distance(*from, *to, place),
            Self::Loop(places) => {
                let next = places.iter().cycle().skip(1);
                places.iter().zip(next).map(|(&from, &to)| distance(from, to, place)).fold(f32::INFINITY, f32::min)
            }
        }
    }
}

/// The distance of a place to a stretch of a line.
fn distance(from: Pos2, to: Pos2, place: Pos2) -> f32 {
    let (along, way) = (to - from, place - from);
    let part = along.dot(way) / along.length_sq();
    // A stretch without length is a point.
    let part = if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 };
    (from + along * part).distance(place)
}

/// The handle that the pointer is on: the nearest one within reach.
pub(super) fn nearest<T: Copy>(handles: &[(T, Shape)], place: Pos2) -> Option<T> {
    let distances = handles.iter().map(|(handle, shape)| (*handle, shape.distance(place)));
    let near = distances.filter(|(_, distance)| *distance < REACH);
    near.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(handle, _)| handle)
}

/// Where on a line the pointer is: how far beyond `origin`, in the direction `axis` of length 1, the line is nearest to a
/// line of sight. Nothing if it is seen end on.
pub(super) fn along(origin: DVec3, axis: DVec3, (eye, sight): Ray) -> Option<f64> {
    let between = origin - eye;
    let cosine = axis.dot(sight);
    let sine_2 = 1.0 - cosine * cosine;
    let way = (cosine * sight.dot(between) - axis.dot(between)) / sine_2;
    (sine_2 > END_ON && way.is_finite()).then_some(way)
}

/// Where a line of sight meets a plane. Nothing if it is seen edge on.
pub(super) fn on_plane(origin: DVec3, normal: DVec3, (eye, sight): Ray) -> Option<DVec3> {
    let sine = normal.dot(sight);
    let place = eye + sight * (normal.dot(origin - eye) / sine);
    (sine.abs() > EDGE_ON && place.is_finite()).then_some(place)
}

/// The angle about an axis that takes one direction to another, in radians, from half a turn back to half a turn on.
pub(super) fn angle(axis: DVec3, from: DVec3, to: DVec3) -> f64 {
    let [from, to] = [from, to].map(|way| way.reject_from_normalized(axis));
    axis.dot(from.cross(to)).atan2(from.dot(to))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use autosplats::Projection;
    use eframe::egui::pos2;

    /// A place where `f32` holds half metres.
    pub(in crate::gizmo) const FAR: DVec3 = DVec3::new(512_000.0, 5_400_000.0, 300.0);

    /// A perspective and an orthographic picture of [`FAR`].
    pub(in crate::gizmo) fn views() -> impl Iterator<Item = View> {
        let rect = Rect::from_min_size(pos2(200.0, 30.0), vec2(600.0, 400.0));
        [Projection::PerspectiveFovDeg(40.0), Projection::OrthographicHeight(8.0)].into_iter().map(move |projection| {
            let camera = Camera { eye: FAR + DVec3::new(4.0, -10.0, 5.0), look_at: FAR, up: DVec3::Z, projection };
            View::new(&camera, rect, [1200, 800]).expect("a camera that sees")
        })
    }

    #[test]
    fn lines_of_sight_lead_to_what_is_seen() {
        for view in views() {
            let world = FAR + DVec3::new(1.0, 2.0, -0.5);
            let place = view.place(world).expect("before the eye");
            let (eye, sight) = view.ray(place);
            // A tenth of a pixel, as places of the window are f32.
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
                    // Beside the line it is the nearest place of it.
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
