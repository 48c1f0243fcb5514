//! Windows that are drawn by a program on the processor, for want of a graphics card, and pictures that are made there too.
//!
//! Both at once take twice as long each, and a window is asked to draw itself for every twitch of the mouse. So while the view
//! moves they take turns: a frame of the window waits for the picture that it has asked for, no longer than a picture may
//! take, and shows that one.

use std::time::{Duration, Instant};

/// The window's turn and the picture's.
#[derive(Debug, Default)]
pub(crate) struct Turns {
    /// When the picture's turn ended.
    ended: Option<Instant>,
    /// Mean milliseconds of the window's turn; 0 while unknown.
    window_ms: f64,
}

impl Turns {
    /// A longer pause is not the window's work.
    const PAUSE_MS: f64 = 200.0;
    /// Share of the time that pictures are left at least.
    const LEAST: f64 = 0.4;

    /// What is left for a picture of the milliseconds that both may take together.
    pub(crate) fn budget_ms(&self, both_ms: f64) -> f64 {
        (both_ms - self.window_ms).max(Self::LEAST * both_ms)
    }

    /// The window's turn is over.
    pub(crate) fn begin(&mut self) {
        let spent = self.ended.map(|ended| ended.elapsed().as_secs_f64() * 1e3);
        if let Some(spent) = spent.filter(|&spent| spent < Self::PAUSE_MS) {
            self.window_ms = if self.window_ms > 0.0 { 0.8 * self.window_ms + 0.2 * spent } else { spent };
        }
    }

    /// How long the picture's turn may last: half as long again as it should, as no two pictures take the same time.
    pub(crate) fn longest(&self, both_ms: f64) -> Duration {
        Duration::from_secs_f64(1.5e-3 * self.budget_ms(both_ms))
    }

    /// The picture's turn is over.
    pub(crate) fn end(&mut self) {
        self.ended = Some(Instant::now());
    }
}

/// Whether the device that draws the window is a program on the processor.
pub(crate) fn are_taken(creation: &eframe::CreationContext<'_>) -> bool {
    let device = creation.wgpu_render_state.as_ref();
    device.is_some_and(|state| state.adapter.get_info().device_type == eframe::wgpu::DeviceType::Cpu)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_get_what_the_window_leaves() {
        let mut turns = Turns::default();
        assert_eq!(turns.budget_ms(30.0), 30.0, "nothing is known of the window");
        turns.window_ms = 10.0;
        assert_eq!(turns.budget_ms(30.0), 20.0, "the window takes ten");
        turns.window_ms = 50.0;
        assert_eq!(turns.budget_ms(30.0), 12.0, "a window slower than all of it leaves a share");
    }

    #[test]
    fn pauses_are_not_the_windows_work() {
        let mut turns = Turns { ended: Instant::now().checked_sub(Duration::from_secs(1)), window_ms: 7.0 };
        turns.begin();
        assert_eq!(turns.window_ms, 7.0, "a second is a pause");
        turns.end();
        turns.begin();
        assert!(turns.window_ms < 7.0, "{} ms", turns.window_ms);
    }
}
