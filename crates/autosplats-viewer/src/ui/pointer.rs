//! What the mouse does in the picture.

use autosplats::cloud::glam::{DVec2, DVec3};
use eframe::egui::{self, MouseWheelSource, PointerButton};

use crate::session::Session;
use crate::ui::{Tool, Tools};
use crate::view::{Purpose, TwoFingers, View};

/// Zoom per point scrolled: natural logarithm of the factor.
const ZOOM_PER_SCROLL: f64 = 0.0024;

/// The mouse over the picture.
#[derive(Default)]
pub(crate) struct Pointer {
    /// Whether the last scrolling came from fingers on a touchpad rather than a wheel.
    fingers: bool,
    /// The part of the drag that the view has followed, screen points.
    dragged: egui::Vec2,
    /// Depth of the point grabbed by the drag, world units.
    grabbed: Option<f64>,
    /// The target of the wheel.
    zoomed: Option<Zoomed>,
}

/// The start of a turn of the wheel.
#[derive(Clone, Copy, Debug)]
struct Zoomed {
    /// Time of the last click of the wheel, seconds.
    time: f64,
    place: egui::Pos2,
    world: DVec3,
}

impl Pointer {
    /// Handles the pointer. Returns whether the pointer moves the view.
    pub(crate) fn handle(
        &mut self,
        session: &Session,
        view: &mut View,
        tools: &mut Tools,
        response: &egui::Response,
        size: [u32; 2],
    ) -> bool {
        let rect = response.rect;
        let context = &response.ctx;
        let modifiers = context.input(|input| input.modifiers);
        // The way of the pointer before the drag was recognized belongs to the drag.
        let dragged = response.total_drag_delta().unwrap_or_default();
        let drag = if response.dragged() { dragged - self.dragged } else { egui::Vec2::ZERO };
        self.dragged = dragged;
        let drag = DVec2::new(drag.x.into(), drag.y.into()) / f64::from(rect.height().max(1.0));
        let mut busy = false;
        if response.drag_started() {
            let pressed = context.input(|input| input.pointer.press_origin()).or(response.interact_pointer_pos());
            self.grabbed = pressed.and_then(|place| under(view, rect, place)).map(|(_, depth)| depth);
            // Takes the keyboard focus from any control, so that keys fly.
            response.request_focus();
            response.surrender_focus();
        }
        let left = response.dragged_by(PointerButton::Primary);
        let turns = tools.current == Tool::Navigate || !tools.current.selects() || modifiers.alt;
        if left && turns && !modifiers.shift && !modifiers.command {
            view.navigation.orbit(drag);
            busy = true;
        } else if left && turns && modifiers.command {
            view.navigation.look(drag);
            busy = true;
        } else if response.dragged_by(PointerButton::Secondary) || left && turns && modifiers.shift {
            view.navigation.pan(drag, self.grabbed);
            busy = true;
        } else if response.dragged_by(PointerButton::Middle) {
            if tools.current.selects() {
                view.navigation.orbit(drag);
            } else {
                view.navigation.pan(drag, self.grabbed);
            }
            busy = true;
        } else if tools.current.selects() {
            tools.drag(session, view, response, size);
        }
        let pixel = |place: egui::Pos2| {
            let scale = size[0] as f32 / rect.width();
            [(place.x - rect.left()) * scale, (place.y - rect.top()) * scale]
        };
        if let Some(place) = response.interact_pointer_pos() {
            if response.double_clicked() && tools.current != Tool::Measure {
                view.pick(session, size, pixel(place), Purpose::Pivot);
            } else if response.clicked() {
                match tools.current {
                    Tool::Inspect => view.pick(session, size, pixel(place), Purpose::Inspect),
                    Tool::Measure => view.pick(session, size, pixel(place), Purpose::Measure),
                    _ => {}
                }
            }
        }
        if response.hovered() {
            let (scroll, pinch) = context.input(|input| (input.smooth_scroll_delta(), input.zoom_delta()));
            self.fingers = context.input(|input| by_fingers(&input.events)).unwrap_or(self.fingers);
            let way = DVec2::new(scroll.x.into(), scroll.y.into()) / f64::from(rect.height().max(1.0));
            let fingers = self.fingers && way != DVec2::ZERO;
            let mut factor = f64::from(pinch);
            match view.look.two_fingers {
                TwoFingers::Orbit if fingers => view.navigation.orbit(way),
                TwoFingers::Pan if fingers => {
                    let depth = context.pointer_hover_pos().and_then(|place| under(view, rect, place));
                    view.navigation.pan(way, depth.map(|(_, depth)| depth));
                }
                _ => factor *= (f64::from(scroll.y) * ZOOM_PER_SCROLL).exp(),
            }
            if factor != 1.0 {
                let target = context.pointer_hover_pos().and_then(|place| self.zoom_target(view, context, rect, place));
                view.navigation.zoom(factor, target);
            }
            busy |= factor != 1.0 || way != DVec2::ZERO;
        }
        if let Some(touch) = context.multi_touch().filter(|_| response.contains_pointer()) {
            let drag = touch.translation_delta / rect.height();
            view.navigation.pan(DVec2::new(drag.x.into(), drag.y.into()), self.grabbed);
            busy = true;
        }
        busy
    }

    /// The point that a wheel zooms to: the one under the pointer when the turn began, while the wheel turns and the
    /// pointer stays. Pictures rendered meanwhile lag behind, and a GPU's moving pictures have no depths.
    fn zoom_target(
        &mut self,
        view: &View,
        context: &egui::Context,
        rect: egui::Rect,
        place: egui::Pos2,
    ) -> Option<DVec3> {
        /// Longest pause between clicks of one turn, seconds.
        const MAX_WHEEL_PAUSE_S: f64 = 0.4;
        /// Largest movement of the pointer that counts as staying, screen points.
        const MAX_TREMBLE_POINTS: f32 = 3.0;
        let time = context.input(|input| input.time);
        let last = self
            .zoomed
            .filter(|last| time - last.time < MAX_WHEEL_PAUSE_S && last.place.distance(place) < MAX_TREMBLE_POINTS);
        let world = last.map(|last| last.world).or_else(|| under(view, rect, place).map(|(world, _)| world));
        self.zoomed = world.map(|world| Zoomed { time, place, world });
        world
    }
}

/// Whether fingers on a touchpad scroll, by the last event that tells. Where the system does not name the source,
/// scrolling in pixels means fingers; X11 scrolls in lines for both.
fn by_fingers(events: &[egui::Event]) -> Option<bool> {
    events.iter().rev().find_map(|event| match event {
        egui::Event::MouseWheel { source: MouseWheelSource::Trackpad | MouseWheelSource::Momentum, .. } => Some(true),
        egui::Event::MouseWheel { source: MouseWheelSource::Wheel, .. } => Some(false),
        egui::Event::MouseWheel { unit, .. } => Some(*unit == egui::MouseWheelUnit::Point),
        _ => None,
    })
}

/// World position and depth under a position in the window: on the surface where there is one, else at the depth of the
/// pivot.
fn under(view: &View, rect: egui::Rect, place: egui::Pos2) -> Option<(DVec3, f64)> {
    let share =
        DVec2::new(((place.x - rect.left()) / rect.width()).into(), ((place.y - rect.top()) / rect.height()).into());
    let camera = view.navigation.camera();
    let picture = view.shot.as_ref();
    let surface = picture.and_then(|picture| picture.depths.world(&picture.camera, share));
    let [_, _, forward] = camera.axes().ok()?;
    let world = surface.or_else(|| {
        let depth = forward.dot(camera.look_at - camera.eye);
        let size = [1000.0 * view.aspect, 1000.0].map(|side| side.round().max(1.0) as u32);
        camera.unproject(share * DVec2::new(size[0].into(), size[1].into()), depth, size).ok()
    })?;
    Some((world, forward.dot(world - camera.eye)))
}
