//! The handles that move and turn the selection: an arrow along each axis, a ring about each axis, and a dot for free
//! moves.

use autosplats::cloud::glam::{DMat4, DVec3};
use eframe::egui::{Color32, Painter, Pos2, Stroke};

use super::lens::{GRABBED_COLOR, Shape, WindowLens, along, angle, on_plane};
use super::{Handle, line};
use crate::session::document::about;
use crate::session::measure::angle_text;
use crate::session::{Grip, Session};

/// Start and end of an arrow, screen points from the middle.
const ARROW_ENDS_POINTS: [f64; 2] = [16.0, 78.0];
/// Radius of the rings, screen points.
const RING_RADIUS_POINTS: f64 = 96.0;
/// Corners of a ring's polygon.
const RING_CORNER_COUNT: usize = 72;
/// Step of a stepped rotation, degrees.
const STEP_DEG: f64 = 15.0;
/// Red, green and blue of the axes, as in the corner of the picture.
const COLORS: [Color32; 3] =
    [Color32::from_rgb(235, 95, 85), Color32::from_rgb(150, 205, 90), Color32::from_rgb(95, 150, 255)];

/// A drag of the selected points.
pub(super) struct Drag {
    pub(super) handle: Handle,
    grip: Grip,
    /// Middle of the selection when the drag began, world space.
    from: DVec3,
    /// The grabbed point: its offset along the axis, or its place in the plane.
    grabbed: Grabbed,
    /// Angle so far, over more than one turn, radians.
    turned: f64,
    matrix: DMat4,
}

#[derive(Clone, Copy)]
enum Grabbed {
    Along(f64),
    At(DVec3),
}

impl Drag {
    pub(super) fn begin(
        session: &Session,
        middle: DVec3,
        lens: &WindowLens,
        handle: Handle,
        place: Pos2,
    ) -> Option<Self> {
        Self::of(session.document().grip(), middle, lens, handle, place)
    }

    fn of(grip: Grip, from: DVec3, lens: &WindowLens, handle: Handle, place: Pos2) -> Option<Self> {
        let ray = lens.ray(place);
        let grabbed = match handle {
            Handle::Arrow(axis) => Grabbed::Along(along(from, DVec3::AXES[axis], ray)?),
            Handle::Ring(axis) => Grabbed::At(on_plane(from, DVec3::AXES[axis], ray)?),
            _ => Grabbed::At(on_plane(from, lens.forward, ray)?),
        };
        Some(Self { handle, grip, from, grabbed, turned: 0.0, matrix: DMat4::IDENTITY })
    }

    /// Moves the points to follow the pointer.
    pub(super) fn follow(&mut self, session: &mut Session, lens: &WindowLens, place: Pos2, stepped: bool) {
        let before = self.matrix;
        self.matrix = self.map(lens, place, stepped).unwrap_or(before);
        if self.matrix != before {
            session.change(|document| document.move_gripped(&self.grip, &self.matrix));
        }
    }

    fn map(&mut self, lens: &WindowLens, place: Pos2, stepped: bool) -> Option<DMat4> {
        let ray = lens.ray(place);
        Some(match (self.handle, self.grabbed) {
            (Handle::Arrow(axis), Grabbed::Along(start)) => {
                let axis = DVec3::AXES[axis];
                DMat4::from_translation(axis * (along(self.from, axis, ray)? - start))
            }
            (Handle::Ring(axis), Grabbed::At(start)) => {
                let axis = DVec3::AXES[axis];
                let now = on_plane(self.from, axis, ray)?;
                let angle = angle(axis, start - self.from, now - self.from);
                // Of the equivalent angles the one nearest to the last, so that the drag can pass half a turn.
                let turn = std::f64::consts::TAU;
                self.turned = angle + turn * ((self.turned - angle) / turn).round();
                about(self.from, DMat4::from_axis_angle(axis, self.radians(stepped)))
            }
            (_, Grabbed::At(start)) => DMat4::from_translation(on_plane(self.from, lens.forward, ray)? - start),
            (_, Grabbed::Along(_)) => return None,
        })
    }

    fn radians(&self, stepped: bool) -> f64 {
        let step = STEP_DEG.to_radians();
        if stepped { (self.turned / step).round() * step } else { self.turned }
    }

    /// Moves the points back.
    pub(super) fn cancel(&self, session: &mut Session) {
        session.change(|document| document.move_gripped(&self.grip, &DMat4::IDENTITY));
    }

    /// Makes the drag an undo step.
    pub(super) fn finish(&self, session: &mut Session) {
        self.cancel(session);
        if self.matrix != DMat4::IDENTITY {
            let verb = if matches!(self.handle, Handle::Ring(_)) { "Turn" } else { "Move" };
            session.edit_points(verb, |document| document.move_gripped(&self.grip, &self.matrix));
        }
    }

    /// The present middle of the selection, world space.
    pub(super) fn middle(&self) -> DVec3 {
        self.matrix.transform_point3(self.from)
    }

    /// Distance or angle of the drag, as text.
    pub(super) fn text(&self, session: &Session) -> String {
        match self.handle {
            Handle::Ring(axis) => {
                let seen = self.matrix.transform_vector3(DVec3::AXES[(axis + 1) % 3]);
                let angle = angle(DVec3::AXES[axis], DVec3::AXES[(axis + 1) % 3], seen);
                let turn = std::f64::consts::TAU;
                angle_text((angle + turn * ((self.turned - angle) / turn).round()).to_degrees())
            }
            handle => {
                let ruler = session.ruler();
                let length = ruler.length_text(ruler.distance(self.from, self.middle()));
                let way = self.middle() - self.from;
                match handle {
                    Handle::Arrow(axis) if way[axis] < 0.0 => format!("{} -{length}", ["X", "Y", "Z"][axis]),
                    Handle::Arrow(axis) => format!("{} {length}", ["X", "Y", "Z"][axis]),
                    _ => length,
                }
            }
        }
    }
}

/// Ends of an arrow; `None` if it is seen end on.
fn arrow(middle: DVec3, axis: usize, lens: &WindowLens) -> Option<[Pos2; 2]> {
    let unit = lens.unit(middle)?;
    let axis = DVec3::AXES[axis];
    along(middle, axis, lens.ray(lens.place(middle)?))?;
    let [from, to] = ARROW_ENDS_POINTS.map(|points| lens.place(middle + axis * (points * unit)));
    Some([from?, to?])
}

/// Corners of a ring; `None` if it is seen edge on.
fn ring(middle: DVec3, axis: usize, lens: &WindowLens) -> Option<Vec<Pos2>> {
    let radius = RING_RADIUS_POINTS * lens.unit(middle)?;
    let [across, along] = [1, 2].map(|next| DVec3::AXES[(axis + next) % 3] * radius);
    on_plane(middle, DVec3::AXES[axis], lens.ray(lens.place(middle)?))?;
    let corners = (0..RING_CORNER_COUNT).map(|corner| {
        let (sin, cos) = (corner as f64 / RING_CORNER_COUNT as f64 * std::f64::consts::TAU).sin_cos();
        lens.place(middle + across * cos + along * sin)
    });
    corners.collect()
}

/// The handles of the selection and their shapes.
pub(super) fn handles(middle: DVec3, lens: &WindowLens) -> Vec<(Handle, Shape)> {
    let mut handles = Vec::new();
    handles.extend(lens.place(middle).map(|place| (Handle::Middle, Shape::Dot(place))));
    for axis in 0..3 {
        let shaft = arrow(middle, axis, lens).map(|[from, to]| (Handle::Arrow(axis), Shape::Line(from, to)));
        handles.extend(shaft);
        handles.extend(ring(middle, axis, lens).map(|places| (Handle::Ring(axis), Shape::Loop(places))));
    }
    handles
}

pub(super) fn show(middle: DVec3, lens: &WindowLens, painter: &Painter, taken: Option<Handle>) {
    let mut handles = handles(middle, lens);
    // The dragged or hovered handle is drawn on top.
    handles.sort_by_key(|(handle, _)| (taken == Some(*handle), !matches!(handle, Handle::Ring(_))));
    for (handle, shape) in handles {
        let is_taken = taken == Some(handle);
        let own = match handle {
            Handle::Arrow(axis) | Handle::Ring(axis) => COLORS[axis],
            _ => Color32::WHITE,
        };
        let color = if is_taken { GRABBED_COLOR } else { own };
        match shape {
            Shape::Dot(place) => {
                painter.circle(place, 6.0, color, Stroke::new(1.5, Color32::from_black_alpha(200)));
            }
            Shape::Line(from, to) => {
                line(painter, [from, to], 3.0, color);
                let along = (to - from).normalized();
                let aside = along.rot90() * 6.0;
                let head = vec![to + along * 12.0, to + aside, to - aside];
                painter.add(eframe::egui::Shape::convex_polygon(
                    head,
                    color,
                    Stroke::new(1.0, Color32::from_black_alpha(160)),
                ));
            }
            Shape::Loop(places) => {
                let width = if is_taken { 3.0 } else { 1.8 };
                let faint = if is_taken { 1.0 } else { 0.75 };
                painter.add(eframe::egui::Shape::closed_line(
                    places.clone(),
                    Stroke::new(width + 2.0, Color32::from_black_alpha(90)),
                ));
                painter.add(eframe::egui::Shape::closed_line(places, Stroke::new(width, color.gamma_multiply(faint))));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lens::tests::{FAR, views};
    use super::*;
    use crate::session::Document;

    fn drag(lens: &WindowLens, handle: Handle, place: Pos2) -> Drag {
        Drag::of(Document::default().grip(), FAR, lens, handle, place).expect("it is seen well")
    }

    #[test]
    fn points_follow_the_pointer() {
        for lens in views() {
            assert_eq!(handles(FAR, &lens).len(), 7, "a dot, three arrows and three rings");
            let taken = FAR + 0.1;
            let place = lens.place(taken).expect("before the eye");
            for axis in 0..3 {
                let way = DVec3::AXES[axis] * -0.75;
                let map =
                    drag(&lens, Handle::Arrow(axis), place).map(&lens, lens.place(taken + way).expect("seen"), false);
                let moved = map.expect("seen from the side").transform_point3(FAR) - FAR;
                // The grabbed point lies beside the arrow, so that it follows the pointer less exactly.
                assert!(moved.distance(way) < 0.05, "along {axis} by {moved}, not {way}");
                assert_eq!(moved.reject_from(way), DVec3::ZERO, "and along nothing else");
            }
            let aside = lens.forward.any_orthonormal_vector() * 0.5;
            let to = lens.place(taken + aside).expect("before the eye");
            let moved =
                drag(&lens, Handle::Middle, place).map(&lens, to, false).expect("seen").transform_point3(FAR) - FAR;
            assert!(moved.distance(aside) < 0.02, "in the plane of the picture by {moved}, not {aside}");
        }
    }

    #[test]
    fn rings_turn_as_far_as_the_pointer_goes_round() {
        for lens in views() {
            let at = |degrees: f64| {
                let (sin, cos) = degrees.to_radians().sin_cos();
                lens.place(FAR + DVec3::new(cos, sin, 0.0)).expect("before the eye")
            };
            let mut drag = drag(&lens, Handle::Ring(2), at(0.0));
            for step in 1..=50 {
                let degrees = f64::from(step) * 10.0;
                let map = drag.map(&lens, at(degrees), false).expect("seen from above");
                // Half a pixel, seen from the side.
                assert!(
                    (drag.turned.to_degrees() - degrees).abs() < 0.5,
                    "{} is not {degrees}",
                    drag.turned.to_degrees()
                );
                assert!(map.transform_point3(FAR).distance(FAR) < 1e-8, "the middle stays");
            }
            let stepped = drag.map(&lens, at(500.0 + 12.0), true).expect("seen from above");
            let turned = angle(DVec3::Z, DVec3::X, stepped.transform_vector3(DVec3::X)).to_degrees();
            assert!((turned - 150.0).abs() < 1e-6, "512 degrees in steps of 15 are 510, not {turned}");
        }
    }
}
