//! For windows drawn by the CPU, for want of a graphics card, while the CPU renders the pictures too.
//!
//! Window and picture slow each other down when drawn at once, and every mouse event asks for a new window frame. So
//! they take turns while the view moves. A window frame waits for the picture that it has requested, up to a limit, and
//! shows that picture.

use std::time::{Duration, Instant};

/// Timing of the window's turn and the picture's turn.
#[derive(Debug, Default)]
pub(crate) struct Turns {
    /// Time when the picture's turn ended.
    ended: Option<Instant>,
    /// Mean milliseconds of the window's turn; 0 while unknown.
    window_ms: f64,
}

impl Turns {
    /// A turn longer than this is a pause, milliseconds.
    const PAUSE_MS: f64 = 200.0;
    /// Smallest share of the time that is left to pictures.
    const MIN_PICTURE_SHARE: f64 = 0.4;

    /// Milliseconds for a picture, given the time for window and picture together.
    pub(crate) fn budget_ms(&self, both_ms: f64) -> f64 {
        (both_ms - self.window_ms).max(Self::MIN_PICTURE_SHARE * both_ms)
    }

    /// Ends the window's turn and starts the picture's.
    pub(crate) fn begin(&mut self) {
        let spent = self.ended.map(|ended| ended.elapsed().as_secs_f64() * 1e3);
        if let Some(spent) = spent.filter(|&spent| spent < Self::PAUSE_MS) {
            self.window_ms = if self.window_ms > 0.0 { 0.8 * self.window_ms + 0.2 * spent } else { spent };
        }
    }

    /// Time limit of the picture's turn: 1.5 times its budget, since render times vary.
    pub(crate) fn longest(&self, both_ms: f64) -> Duration {
        Duration::from_secs_f64(1.5e-3 * self.budget_ms(both_ms))
    }

    /// Ends the picture's turn and starts the window's.
    pub(crate) fn end(&mut self) {
        self.ended = Some(Instant::now());
    }
}

/// Whether the device that draws the window is a software device on the CPU.
pub(crate) fn are_taken(device: &eframe::wgpu::Device) -> bool {
    device.adapter_info().device_type == eframe::wgpu::DeviceType::Cpu
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
