//! The pictures of the view: requested when anything that they depend on has changed, and received.

use std::sync::Arc;

use autosplats::Camera;
use autosplats::cloud::Axes;
use eframe::egui;

use super::View;
use crate::session::{Session, ShownCloud, Sight};
use crate::view::{Answer, Flight, Look, Outcome, Purpose, RenderRequest, Task};

/// Seconds from the last movement until the whole picture is rendered.
const REST_DELAY_S: f64 = 0.12;

/// Everything that a picture depends on.
#[derive(Clone, PartialEq)]
pub(super) struct RequestKey {
    version: u64,
    camera: Camera,
    size: [u32; 2],
    look: Look,
    axes: Axes,
    /// Whether another picture is to follow soon.
    hurried: bool,
}

impl View {
    /// Notes that the view moves, so that pictures are rendered within the time limit.
    pub(crate) fn note_movement(&mut self) {
        self.moved_by_preview = true;
    }

    /// The points of the last picture, if they still match the document.
    pub(crate) fn shown(&self, session: &Session) -> Option<Arc<ShownCloud>> {
        let shown = &self.shot.as_ref()?.shown;
        shown.shows(session.document()).then(|| Arc::clone(shown))
    }

    /// Receives what the render thread has sent. Returns the outcomes of tasks.
    pub(crate) fn receive(&mut self, now: f64) -> Vec<Outcome> {
        let answers: Vec<_> = self.render.answers().collect();
        answers.into_iter().filter_map(|answer| self.take(answer, now)).collect()
    }

    /// Receives an answer. Returns the outcome of a task.
    fn take(&mut self, answer: Answer, now: f64) -> Option<Outcome> {
        self.awaited &= matches!(answer, Answer::Finer(_) | Answer::Device(_) | Answer::Done(_));
        match answer {
            Answer::Picture(picture) => {
                self.rate.count(now, &picture);
                self.failure = None;
                self.moving_points = picture.most_points.unwrap_or(self.moving_points);
                let cloud = Arc::clone(&picture.shown.cloud);
                let before = self.shot.replace(picture);
                if let Some(before) = before.filter(|before| !Arc::ptr_eq(&before.shown.cloud, &cloud)) {
                    // To free many points takes longer than a window frame may.
                    crate::threads::spawn("free", move || drop(before));
                }
            }
            Answer::Finer(pixels) => {
                if let Some(shot) = &mut self.shot {
                    shot.pixels = pixels;
                }
            }
            Answer::Empty => self.shot = None,
            Answer::Device(device) => self.device = device,
            Answer::Failed(why) => {
                // The failed picture may belong to the film.
                self.stop_recording();
                self.failure = Some(why);
            }
            Answer::Done(outcome) => return Some(outcome),
        }
        None
    }

    /// The render request for the present view.
    pub(crate) fn wish(&self, session: &Session, size: [u32; 2], moving: bool) -> RenderRequest {
        RenderRequest {
            document: session.document().clone(),
            camera: self.navigation.camera(),
            size,
            settings: self.look.settings.clone(),
            dots: self.look.dots.then_some(self.look.dot_size),
            backend: self.look.backend,
            // Points that change keep one up axis; a guess per frame could change from frame to frame.
            axes: session.up_axis.or(session
                .guessed_axes
                .filter(|_| !session.playing.is_empty() || session.document().trees().next().is_some())),
            moving_ms: self.look.moving_ms,
            budget_ms: self.shared_budget_ms(session, moving).map(|shared_budget_ms| {
                self.turns.as_ref().map_or(shared_budget_ms, |turns| turns.budget_ms(shared_budget_ms))
            }),
        }
    }

    /// Milliseconds for a picture and a window frame together, while the view moves or an input plays; `None` at rest.
    fn shared_budget_ms(&self, session: &Session, moving: bool) -> Option<f64> {
        let least_ms = self.look.moving_ms;
        if moving { Some(least_ms) } else { session.playing.frame_ms(least_ms) }
    }

    /// Requests a picture if anything that it depends on has changed.
    pub(crate) fn ask(&mut self, session: &Session, context: &egui::Context, size: [u32; 2], busy: bool) {
        let (now, seconds) = context.input(|input| (input.time, f64::from(input.stable_dt)));
        let flight = if context.egui_wants_keyboard_input() { Flight::default() } else { flight(context) };
        let busy = busy || std::mem::take(&mut self.moved_by_preview);
        session.loader.frame.set(self.frame(session));
        if self.navigation.advance(seconds, flight) || busy {
            self.moved = now;
        }
        if self.first_camera.is_some_and(|(_, aspect)| aspect != self.aspect) && self.is_first_view() {
            self.first_view(session);
        }
        let moving = now - self.moved < REST_DELAY_S;
        if moving {
            context.request_repaint();
        }
        if session.document().layers.is_empty() {
            self.shot = None;
            if self.wished.take().is_some() {
                // An empty document frees the points that the renderer holds.
                self.render.wish(self.wish(session, size, false));
            }
            return;
        }
        let mut look = self.look.clone();
        // The window draws the legend itself, so that its size stays the same in coarse pictures.
        look.settings.shading.legend = false;
        // Without averaging, noise would differ from picture to picture.
        look.settings.reconstruction.steady = moving;
        if self.shared_budget_ms(session, false).is_none() {
            // A picture at rest shows its own points only, without the coarser pictures before it.
            look.settings.reconstruction.frames_averaged = 1;
        }
        let (version, camera, axes) = (session.version, self.navigation.camera(), session.axes());
        let hurried = self.shared_budget_ms(session, moving).is_some();
        let sight = Sight::new(camera, size, &look.settings.shading.color);
        session.look(if hurried { sight.moving(self.moving_points) } else { sight });
        let key = RequestKey { version, camera, size, look, axes, hurried };
        if self.wished.as_ref() != Some(&key) {
            self.render.wish(RenderRequest { settings: key.look.settings.clone(), ..self.wish(session, size, moving) });
            self.wished = Some(key);
            self.awaited = true;
        }
    }

    /// Waits for the requested picture, if the window and the pictures take turns. Returns the outcome of a task.
    pub(crate) fn take_turns(&mut self, session: &Session, context: &egui::Context) -> Option<Outcome> {
        self.turns.as_mut()?.begin();
        let now = context.input(|input| input.time);
        let shared_budget_ms = self.shared_budget_ms(session, now - self.moved < REST_DELAY_S);
        let longest = shared_budget_ms.filter(|_| self.awaited).zip(self.turns.as_ref());
        let longest = longest.map(|(shared_budget_ms, turns)| turns.longest(shared_budget_ms));
        let answer = longest.and_then(|longest| self.render.answer_within(longest));
        let outcome = answer.and_then(|answer| self.take(answer, now));
        self.turns.as_mut()?.end();
        outcome
    }

    /// Requests the point at a pixel of the picture.
    pub(crate) fn pick(&self, session: &Session, size: [u32; 2], pixel: [f32; 2], purpose: Purpose) {
        let wish = Box::new(self.wish(session, size, false).of_points());
        self.render.task(Task::Pick { wish, pixel, purpose });
    }
}

/// The flight that the held keys ask for.
fn flight(context: &egui::Context) -> Flight {
    use egui::Key;
    context.input(|input| {
        if input.modifiers.command || input.modifiers.alt {
            return Flight::default();
        }
        let axis = |more: Key, less: Key| f64::from(i8::from(input.key_down(more)) - i8::from(input.key_down(less)));
        Flight {
            right: axis(Key::D, Key::A),
            up: axis(Key::E, Key::Q),
            forward: axis(Key::W, Key::S),
            turn_right: axis(Key::ArrowRight, Key::ArrowLeft),
            turn_up: axis(Key::ArrowUp, Key::ArrowDown),
            fast: input.modifiers.shift,
        }
    })
}
