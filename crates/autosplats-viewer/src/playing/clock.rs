//! What time it is in what is played, without a clock of its own: the window tells how much has passed.

use std::time::Duration;

/// The place in everything that has a timeline, each from its own beginning.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    /// Seconds since the beginning.
    position: f64,
    /// Seconds that the longest timeline takes.
    length: f64,
    /// First and last second that is played; `None` is all.
    span: Option<[f64; 2]>,
    pub(crate) playing: bool,
    pub(crate) looped: bool,
    /// Seconds played in a second.
    pub(crate) speed: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { position: 0.0, length: 0.0, span: None, playing: true, looped: true, speed: 1.0 }
    }
}

impl Clock {
    /// Seconds since the beginning.
    pub(crate) fn position(&self) -> f64 {
        self.position
    }

    /// Seconds that all takes.
    pub(crate) fn length(&self) -> f64 {
        self.length
    }

    /// First and last second that is played.
    pub(crate) fn span(&self) -> [f64; 2] {
        self.span.unwrap_or([0.0, self.length])
    }

    /// Whether only a part is played.
    pub(crate) fn has_span(&self) -> bool {
        self.span.is_some()
    }

    /// What is played takes so long now.
    pub(crate) fn set_length(&mut self, length: Duration) {
        self.length = length.as_secs_f64();
        self.span = self.span.filter(|&[begin, end]| begin < end && end <= self.length);
        self.seek(self.position);
    }

    /// Goes to a second.
    pub(crate) fn seek(&mut self, position: f64) {
        self.position = if position.is_finite() { position.clamp(0.0, self.length) } else { 0.0 };
    }

    /// Begins or stops; from the end it begins anew.
    pub(crate) fn toggle(&mut self) {
        self.playing = !self.playing;
        let [begin, end] = self.span();
        if self.playing && !self.looped && self.position >= end {
            self.position = begin;
        }
    }

    /// Plays from here on, up to where it ended so far if that is later.
    pub(crate) fn begin_here(&mut self) {
        let [_, end] = self.span();
        self.set_span(self.position, if end > self.position { end } else { self.length });
    }

    /// Plays up to here, from where it began so far if that is earlier.
    pub(crate) fn end_here(&mut self) {
        let [begin, _] = self.span();
        self.set_span(if begin < self.position { begin } else { 0.0 }, self.position);
    }

    /// Plays all again.
    pub(crate) fn play_all(&mut self) {
        self.span = None;
    }

    fn set_span(&mut self, begin: f64, end: f64) {
        let all = begin <= 0.0 && end >= self.length;
        self.span = Some([begin, end]).filter(|_| !all && begin < end);
    }

    /// Lets `seconds` pass.
    pub(crate) fn advance(&mut self, seconds: f64) {
        if !self.playing || self.length <= 0.0 {
            return;
        }
        let [begin, end] = self.span();
        let position = self.position.max(begin) + seconds * self.speed;
        self.position = if position < end {
            position
        } else if self.looped {
            begin + (position - begin) % (end - begin)
        } else {
            self.playing = false;
            end
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(seconds: f64) -> Clock {
        let mut clock = Clock::default();
        clock.set_length(Duration::from_secs_f64(seconds));
        clock
    }

    #[test]
    fn it_loops_or_ends() {
        let mut clock = clock(10.0);
        clock.advance(12.5);
        assert!((clock.position() - 2.5).abs() < 1e-9, "once around: {}", clock.position());
        clock.looped = false;
        clock.advance(9.0);
        assert_eq!((clock.position(), clock.playing), (10.0, false), "at the end");
        clock.advance(1.0);
        assert_eq!(clock.position(), 10.0, "it stands");
        clock.toggle();
        assert_eq!((clock.position(), clock.playing), (0.0, true), "and begins anew");
    }

    #[test]
    fn speed_is_seconds_by_seconds() {
        let mut clock = clock(100.0);
        clock.speed = 0.5;
        clock.advance(4.0);
        assert_eq!(clock.position(), 2.0, "half as fast");
        clock.playing = false;
        clock.advance(4.0);
        assert_eq!(clock.position(), 2.0, "not at all");
    }

    #[test]
    fn a_part_is_played() {
        let mut clock = clock(10.0);
        clock.seek(2.0);
        clock.begin_here();
        clock.seek(5.0);
        clock.end_here();
        assert_eq!(clock.span(), [2.0, 5.0]);
        clock.advance(1.0);
        assert_eq!(clock.position(), 3.0, "from the end it goes around to the beginning of the part, and on");
        clock.seek(8.0);
        clock.begin_here();
        assert_eq!(clock.span(), [8.0, 10.0], "an end before the beginning is none");
        clock.play_all();
        assert_eq!(clock.span(), [0.0, 10.0]);
        clock.seek(4.0);
        clock.end_here();
        clock.set_length(Duration::from_secs(3));
        assert_eq!((clock.span(), clock.position()), ([0.0, 3.0], 3.0), "what is shorter now has no such part");
    }

    #[test]
    fn nothing_is_played_where_there_is_nothing() {
        let mut clock = Clock::default();
        clock.advance(1.0);
        clock.seek(f64::NAN);
        assert_eq!(clock.position(), 0.0);
    }
}
