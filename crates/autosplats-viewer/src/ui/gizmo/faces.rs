//! The clipping box in the picture: its edges, and a handle on each face.

use autosplats::cloud::glam::DVec3;
use eframe::egui::{Color32, Painter, Pos2, Stroke};

use super::lens::{GRABBED_COLOR, Shape, WindowLens, along};
use super::{Handle, line};
use crate::session::{ClipBox, Session};
use crate::view::View;

/// Segments of an edge, each drawn faint where it is hidden.
const EDGE_SEGMENTS: usize = 48;
/// Radius of a handle, screen points.
const HANDLE_RADIUS_POINTS: f32 = 6.0;
const EDGE: Color32 = Color32::from_rgb(120, 205, 255);
/// Opacity of hidden edges.
const HIDDEN_OPACITY: f32 = 0.28;

/// A drag of a face.
pub(super) struct Drag {
    axis: usize,
    high: bool,
    /// The box when the drag began.
    before: ClipBox,
    /// Offset of the grabbed point from the face's middle, along the axis, world units.
    grabbed: f64,
}

impl Drag {
    pub(super) fn begin(session: &Session, lens: &WindowLens, axis: usize, high: bool, place: Pos2) -> Option<Self> {
        Self::of(session.document().clip?, lens, axis, high, place)
    }

    fn of(before: ClipBox, lens: &WindowLens, axis: usize, high: bool, place: Pos2) -> Option<Self> {
        let grabbed = along(before.face(axis, high), before.axis(axis), lens.ray(place))?;
        Some(Self { axis, high, before, grabbed })
    }

    /// The box with the face under the pointer.
    fn dragged(&self, lens: &WindowLens, place: Pos2) -> Option<ClipBox> {
        let Self { axis, high, before, grabbed } = self;
        let way = along(before.face(*axis, *high), before.axis(*axis), lens.ray(place))?;
        Some(before.with_face(*axis, *high, way - grabbed))
    }

    /// Moves the face to follow the pointer.
    pub(super) fn follow(&self, session: &mut Session, lens: &WindowLens, place: Pos2) {
        if let Some(clip) = self.dragged(lens, place) {
            session.preview_clip(Some(clip));
        }
    }

    /// Moves the face back.
    pub(super) fn cancel(&self, session: &mut Session) {
        session.preview_clip(Some(self.before));
        session.settle_clip();
    }

    pub(super) fn handle(&self) -> Handle {
        Handle::Face { axis: self.axis, high: self.high }
    }

    /// Width of the box along the dragged axis, as text.
    pub(super) fn text(&self, session: &Session) -> Option<String> {
        let clip = session.document().clip?;
        let ruler = session.ruler();
        let width = ruler.distance(clip.face(self.axis, false), clip.face(self.axis, true));
        Some(format!("{} wide", ruler.length_text(width)))
    }
}

/// Handles of the faces, without faces seen head on, for which a drag would be ambiguous.
pub(super) fn handles(clip: &ClipBox, lens: &WindowLens) -> Vec<(Handle, Shape)> {
    let faces = (0..6).filter_map(|face| {
        let (axis, high) = (face / 2, face % 2 == 1);
        let middle = clip.face(axis, high);
        let (origin, direction) = (middle, clip.axis(axis));
        let place = lens.place(middle)?;
        along(origin, direction, lens.ray(place))?;
        Some((Handle::Face { axis, high }, Shape::Dot(place)))
    });
    faces.collect()
}

/// Draws the box and, if `has_handles`, its handles.
pub(super) fn show(
    session: &Session,
    view: &View,
    lens: &WindowLens,
    painter: &Painter,
    taken: Option<Handle>,
    has_handles: bool,
) {
    let Some(clip) = session.document().clip else { return };
    let corners = clip.corners();
    for from in 0..8 {
        for axis in 0..3 {
            if from >> axis & 1 == 0 {
                edge(view, &clip, lens, painter, [from, from | 1 << axis].map(|corner| corners[corner]), (from, axis));
            }
        }
    }
    if !has_handles {
        return;
    }
    for (handle, shape) in handles(&clip, lens) {
        let (Handle::Face { axis, high }, Shape::Dot(place)) = (handle, shape) else { continue };
        let is_taken = taken == Some(handle);
        let front = faces_eye(&clip, lens, axis, high);
        let color =
            if is_taken { GRABBED_COLOR } else { EDGE }.gamma_multiply(if front || is_taken { 1.0 } else { 0.55 });
        if is_taken {
            arrow(&clip, lens, painter, axis, high);
        }
        painter.circle(place, HANDLE_RADIUS_POINTS, color, Stroke::new(1.5, Color32::from_black_alpha(200)));
    }
}

/// Draws the direction in which a face moves.
fn arrow(clip: &ClipBox, lens: &WindowLens, painter: &Painter, axis: usize, high: bool) {
    let middle = clip.face(axis, high);
    let Some(unit) = lens.unit(middle) else { return };
    let ends = [-26.0, 26.0].map(|points| lens.place(middle + clip.axis(axis) * (points * unit)));
    if let [Some(from), Some(to)] = ends {
        line(painter, [from, to], 2.0, GRABBED_COLOR);
    }
}

/// Whether a face is seen from outside the box.
fn faces_eye(clip: &ClipBox, lens: &WindowLens, axis: usize, high: bool) -> bool {
    let middle = clip.face(axis, high);
    let out = clip.axis(axis) * if high { 1.0 } else { -1.0 };
    lens.sight(middle).is_some_and(|sight| sight.dot(out) < 0.0)
}

/// Draws an edge in segments, faint where the box or the surface hides them.
fn edge(
    view: &View,
    clip: &ClipBox,
    lens: &WindowLens,
    painter: &Painter,
    ends: [DVec3; 2],
    (corner, along): (usize, usize),
) {
    let sides = (0..3).filter(|&axis| axis != along).map(|axis| (axis, corner >> axis & 1 == 1));
    let behind_box = sides.into_iter().all(|(axis, high)| !faces_eye(clip, lens, axis, high));
    let picture = view.shot.as_ref();
    let covered = |place: Pos2, depth: f64| {
        let surface = picture.and_then(|picture| picture.depths.world(&picture.camera, lens.share(place)));
        surface.and_then(|surface| lens.seen(surface)).is_some_and(|(_, before)| before < depth)
    };
    let mut before: Option<(Pos2, f64)> = None;
    for piece in 0..=EDGE_SEGMENTS {
        let here = lens.seen(ends[0].lerp(ends[1], piece as f64 / EDGE_SEGMENTS as f64));
        if let (Some((from, _)), Some((to, depth))) = (before, here) {
            let faint = behind_box || covered(from + (to - from) * 0.5, depth);
            let color = EDGE.gamma_multiply(if faint { HIDDEN_OPACITY } else { 0.9 });
            painter.line_segment([from, to], Stroke::new(1.3, color));
        }
        before = here;
    }
}

#[cfg(test)]
mod tests {
    use super::super::lens::tests::{FAR, views};
    use super::*;
    use autosplats::cloud::glam::DQuat;

    #[test]
    fn faces_follow_the_pointer() {
        for lens in views() {
            let rotation = DQuat::from_rotation_z(0.4);
            let clip = ClipBox { rotation, ..ClipBox::new(FAR - DVec3::new(1.0, 1.5, 0.5), FAR + DVec3::ONE) };
            let handles = handles(&clip, &lens);
            assert_eq!(handles.len(), 6, "all faces are seen from the side");
            for (handle, shape) in handles {
                let (Handle::Face { axis, high }, Shape::Dot(dot)) = (handle, shape) else { panic!("no face") };
                let there = lens.place(clip.face(axis, high) + clip.axis(axis) * 0.25).expect("before the eye");
                // Grabbed beside its middle, the face keeps its offset to the pointer.
                let grip = eframe::egui::vec2(3.0, -2.0);
                let drag = Drag::of(clip, &lens, axis, high, dot + grip).expect("seen from the side");
                assert_eq!(drag.dragged(&lens, dot + grip), Some(clip), "{handle:?} has not gone anywhere yet");
                let dragged = drag.dragged(&lens, there + grip).expect("seen from the side");
                let way = (dragged.face(axis, high) - clip.face(axis, high)).dot(clip.axis(axis));
                assert!((way - 0.25).abs() < 0.02, "{handle:?} went {way}");
                let seen = lens.place(dragged.face(axis, high)).expect("before the eye");
                assert!(seen.distance(there) < 2.0, "{handle:?} is seen at {seen}, not {there}");
                let opposite = dragged.face(axis, !high).distance(clip.face(axis, !high));
                assert!(opposite < 1e-8, "the face opposite to {handle:?} went {opposite}");
            }
        }
    }
}
