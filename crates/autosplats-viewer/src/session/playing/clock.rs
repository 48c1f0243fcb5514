//! The time in everything that is played. The window advances this clock by the time that has passed.

use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Slowest and fastest speed, seconds played per second.
pub(crate) const SPEEDS: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// The position in everything that has a timeline. A session stores it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Clock {
    /// Seconds since the beginning.
    position: f64,
    /// Length of everything, seconds.
    #[serde(skip)]
    length: f64,
    /// First and last second that is played; `None` plays all.
    span: Option<[f64; 2]>,
    pub(crate) playing: bool,
    pub(crate) looped: bool,
    /// Speed, seconds played per second.
    pub(crate) speed: f64,
    /// Whether the clock stands still until all inputs are open, so that it keeps its position.
    #[serde(skip)]
    held: bool,
}

impl Default for Clock {
    fn default() -> Self {
        Self { position: 0.0, length: 0.0, span: None, playing: true, looped: true, speed: 1.0, held: false }
    }
}

impl Clock {
    /// Seconds since the beginning.
    pub(crate) fn position(&self) -> f64 {
        self.position
    }

    /// Length of everything, seconds.
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

    /// Stops at the present position until everything is open and the length is known.
    pub(crate) fn hold(&mut self) {
        self.held = true;
    }

    /// Whether the clock waits for inputs that are being opened.
    pub(crate) fn is_held(&self) -> bool {
        self.held
    }

    /// Whether time runs: the clock is neither stopped nor held, and has not reached its end.
    pub(crate) fn runs(&self) -> bool {
        self.playing && !self.held && self.length > 0.0 && (self.looped || self.position < self.span()[1])
    }

    /// Sets the length of everything. `known` says whether all inputs are open, so that the length is final.
    pub(crate) fn set_length(&mut self, length: Duration, known: bool) {
        self.length = length.as_secs_f64();
        self.held &= !known;
        if !self.held {
            // A span stored in a file may be rounded.
            let span = self.span.filter(|&[begin, end]| begin < end && end <= self.length + 1e-6);
            self.span = span.map(|[begin, end]| [begin, end.min(self.length)]);
            self.seek(self.position);
        }
    }

    /// Moves to a second.
    pub(crate) fn seek(&mut self, position: f64) {
        let end = if self.held { f64::MAX } else { self.length };
        self.position = if position.is_finite() { position.clamp(0.0, end) } else { 0.0 };
    }

    /// Moves position and span `seconds` later, when all inputs begin later. [`set_length`](Self::set_length) must
    /// follow.
    pub(crate) fn shift(&mut self, seconds: f64) {
        self.position = (self.position + seconds).max(0.0);
        self.span = self.span.map(|span| span.map(|end| (end + seconds).max(0.0)));
    }

    /// Starts or stops. At the end, the clock starts again from the beginning.
    pub(crate) fn toggle(&mut self) {
        self.playing = !self.playing;
        let [begin, end] = self.span();
        if self.playing && !self.held && !self.looped && self.position >= end {
            self.position = begin;
        }
    }

    /// Starts the span here. Its end stays if it is later, else the span ends with everything.
    pub(crate) fn begin_here(&mut self) {
        let [_, end] = self.span();
        self.set_span(self.position, if end > self.position { end } else { self.length });
    }

    /// Ends the span here. Its beginning stays if it is earlier, else the span begins with everything.
    pub(crate) fn end_here(&mut self) {
        let [begin, _] = self.span();
        self.set_span(if begin < self.position { begin } else { 0.0 }, self.position);
    }

    /// Plays everything again.
    pub(crate) fn play_all(&mut self) {
        self.span = None;
    }

    fn set_span(&mut self, begin: f64, end: f64) {
        let all = begin <= 0.0 && end >= self.length;
        self.span = Some([begin, end]).filter(|_| !all && begin < end);
    }

    /// Advances by `seconds` of the window. At the end the clock stops, unless some input is live.
    pub(crate) fn advance(&mut self, seconds: f64, live: bool) {
        if !self.playing || self.held || self.length <= 0.0 {
            return;
        }
        self.position = self.later(self.position.max(self.span()[0]), seconds);
        self.playing = live || self.looped || self.position < self.span()[1];
    }

    /// Position `seconds` after playback of the span has begun.
    pub(crate) fn place_after(&self, seconds: f64) -> f64 {
        self.later(self.span()[0], seconds)
    }

    /// Position `seconds` after it was `from`.
    fn later(&self, from: f64, seconds: f64) -> f64 {
        let [begin, end] = self.span();
        let position = from + seconds * self.speed;
        if position < end {
            position
        } else if self.looped && end > begin {
            begin + (position - begin) % (end - begin)
        } else {
            end
        }
    }

    /// Whether the values are valid; a file may hold any.
    pub(crate) fn is_clock(&self) -> bool {
        let Self { position, span, speed, .. } = self;
        let times = span.iter().flatten().chain([position]);
        times.into_iter().all(|time| time.is_finite() && *time >= 0.0)
            && span.is_none_or(|[begin, end]| begin < end)
            && SPEEDS.contains(speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(seconds: f64) -> Clock {
        let mut clock = Clock::default();
        clock.set_length(Duration::from_secs_f64(seconds), true);
        clock
    }

    #[test]
    fn it_loops_or_ends() {
        let mut clock = clock(10.0);
        clock.advance(12.5, false);
        assert!((clock.position() - 2.5).abs() < 1e-9, "once around: {}", clock.position());
        clock.looped = false;
        clock.advance(9.0, false);
        assert_eq!((clock.position(), clock.playing), (10.0, false), "at the end");
        clock.advance(1.0, false);
        assert_eq!(clock.position(), 10.0, "it stands");
        clock.toggle();
        assert_eq!((clock.position(), clock.playing), (0.0, true), "and begins anew");
    }

    #[test]
    fn what_is_live_goes_on_at_the_end() {
        let mut clock = clock(10.0);
        clock.looped = false;
        clock.advance(12.0, true);
        assert_eq!((clock.position(), clock.playing, clock.runs()), (10.0, true, false), "only frames have ended");
        clock.advance(1.0, true);
        assert_eq!((clock.position(), clock.playing), (10.0, true), "and stay so");
        clock.seek(4.0);
        assert!(clock.runs(), "from an earlier time they go on");
        clock.seek(10.0);
        clock.advance(1.0, false);
        assert!(!clock.playing, "nothing is live any more");
    }

    #[test]
    fn it_keeps_its_place_until_everything_is_open() {
        let mut clock = clock(10.0);
        clock.seek(6.0);
        clock.begin_here();
        clock.hold();
        clock.set_length(Duration::ZERO, false);
        clock.advance(1.0, false);
        clock.seek(7.0);
        assert_eq!((clock.position(), clock.span(), clock.runs()), (7.0, [6.0, 10.0], false), "nothing is lost");
        clock.set_length(Duration::from_secs(10), true);
        clock.advance(1.0, false);
        assert_eq!((clock.position(), clock.span()), (8.0, [6.0, 10.0]), "it goes on");
        clock.hold();
        clock.set_length(Duration::from_secs(5), true);
        assert_eq!((clock.position(), clock.has_span()), (5.0, false), "what is open now may be shorter");
    }

    #[test]
    fn a_film_goes_around_as_the_window_does() {
        let mut clock = clock(10.0);
        clock.speed = 2.0;
        clock.seek(4.0);
        clock.begin_here();
        assert_eq!([0.0, 1.0, 3.0, 4.0].map(|seconds| clock.place_after(seconds)), [4.0, 6.0, 4.0, 6.0]);
        clock.looped = false;
        assert_eq!([1.0, 3.0, 9.0].map(|seconds| clock.place_after(seconds)), [6.0, 10.0, 10.0], "or stays at the end");
        assert_eq!(Clock::default().place_after(3.0), 0.0, "where there is no time");
    }

    #[test]
    fn speed_is_seconds_by_seconds() {
        let mut clock = clock(100.0);
        clock.speed = 0.5;
        clock.advance(4.0, false);
        assert_eq!(clock.position(), 2.0, "half as fast");
        clock.playing = false;
        clock.advance(4.0, false);
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
        clock.advance(1.0, false);
        assert_eq!(clock.position(), 3.0, "from the end it goes around to the beginning of the part, and on");
        clock.seek(8.0);
        clock.begin_here();
        assert_eq!(clock.span(), [8.0, 10.0], "an end before the beginning is none");
        clock.play_all();
        assert_eq!(clock.span(), [0.0, 10.0]);
        clock.seek(4.0);
        clock.end_here();
        clock.set_length(Duration::from_secs(3), true);
        assert_eq!((clock.span(), clock.position()), ([0.0, 3.0], 3.0), "what is shorter now has no such part");
    }

    #[test]
    fn nothing_is_played_where_there_is_nothing() {
        let mut clock = Clock::default();
        clock.advance(1.0, false);
        clock.seek(f64::NAN);
        assert_eq!(clock.position(), 0.0);
        assert!(clock.is_clock(), "all the same");
        for broken in [
            Clock { position: f64::NAN, ..Clock::default() },
            Clock { position: -1.0, ..Clock::default() },
            Clock { speed: 0.0, ..Clock::default() },
            Clock { span: Some([2.0, 1.0]), ..Clock::default() },
        ] {
            assert!(!broken.is_clock(), "{broken:?}");
        }
    }
}
