//! The frame rate.

use crate::view::Picture;

/// Measures pictures per second while the picture changes.
#[derive(Default)]
pub(crate) struct Rate {
    last: Option<f64>,
    /// Mean seconds between pictures; 0 while unknown.
    interval: f64,
    /// Times per stage of the last pictures, for the plot.
    pub(crate) timings: std::collections::VecDeque<autosplats::Timings>,
}

impl Rate {
    /// Number of pictures in the plot.
    const PLOT_PICTURE_COUNT: usize = 120;

    /// Counts a picture at time `now`, seconds.
    pub(crate) fn count(&mut self, now: f64, picture: &Picture) {
        if let Some(last) = self.last {
            let interval = now - last;
            // A pause is no slow picture.
            if interval < 0.5 {
                self.interval = if self.interval > 0.0 { 0.8 * self.interval + 0.2 * interval } else { interval };
            } else {
                self.interval = 0.0;
            }
        }
        self.last = Some(now);
        if self.timings.len() == Self::PLOT_PICTURE_COUNT {
            self.timings.pop_front();
        }
        self.timings.push_back(picture.timings);
    }

    /// Pictures per second; `None` after a pause.
    pub(crate) fn per_second(&self) -> Option<f64> {
        (self.interval > 0.0).then(|| 1.0 / self.interval)
    }
}
