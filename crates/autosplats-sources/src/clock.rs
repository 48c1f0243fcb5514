//! The clock of a sensor, from the stamps of its messages: tells overtaken messages from a clock that was set back.

use std::time::Duration;

/// Number of consecutive messages, each older than the newest but newer than the message before, that mean the clock
/// was set back. Fewer messages may have been delayed together.
const MIN_LATE_STAMPS: u32 = 4;

/// Meaning of a stamp relative to the earlier stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum StampOrder {
    /// At least as new as all earlier stamps.
    Onward,
    /// Older than the newest: either overtaken, or the start of a clock that was set back.
    Behind {
        /// Whether the stamp starts a new series of late stamps.
        first: bool,
    },
    /// The clock was set back: by more than the allowed jump, or for too many consecutive messages.
    Restarted {
        /// Whether the stamp itself is the first of the new clock.
        first: bool,
    },
}

/// The clock of one sensor.
#[derive(Debug, Default)]
pub(super) struct Clock {
    newest: Option<i64>,
    /// Last stamp and length of the current series of late, increasing stamps.
    late_series: Option<(i64, u32)>,
}

impl Clock {
    /// Takes the next stamp, in nanoseconds. A stamp older than the newest by more than `jump` restarts the clock.
    pub(super) fn receive(&mut self, stamp: i64, jump: Duration) -> StampOrder {
        let Some(newest) = self.newest.filter(|&newest| stamp < newest) else {
            // A repeat of the newest stamp fits both the old and a restarted clock.
            if self.newest != Some(stamp) {
                *self = Self { newest: Some(stamp), late_series: None };
            }
            return StampOrder::Onward;
        };
        let (count, first) = match self.late_series {
            Some((last, count)) if stamp > last => (count + 1, false),
            // The same stamp sent again.
            Some((last, count)) if stamp == last => (count, false),
            _ => (1, true),
        };
        let far = Duration::from_nanos(newest.saturating_sub(stamp).unsigned_abs()) > jump;
        if far || count >= MIN_LATE_STAMPS {
            *self = Self { newest: Some(stamp), late_series: None };
            return StampOrder::Restarted { first: far };
        }
        self.late_series = Some((stamp, count));
        StampOrder::Behind { first }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);
    const BEHIND: StampOrder = StampOrder::Behind { first: false };
    const FIRST: StampOrder = StampOrder::Behind { first: true };

    fn orders(stamps: &[i64]) -> Vec<StampOrder> {
        let mut clock = Clock::default();
        stamps.iter().map(|milliseconds| clock.receive(milliseconds * 1_000_000, SECOND)).collect()
    }

    #[test]
    fn what_was_overtaken_does_not_set_a_clock_back() {
        use StampOrder::Onward;
        assert_eq!(orders(&[0, 100, 300, 200, 400]), [Onward, Onward, Onward, FIRST, Onward], "one");
        let pairs = orders(&[100, 0, 300, 200, 500, 400, 700, 600, 900, 800]);
        assert!(pairs.iter().skip(1).step_by(2).all(|order| *order == FIRST), "each second one: {pairs:?}");
        assert_eq!(
            orders(&[900, 100, 200, 300, 1000])[1..],
            [FIRST, BEHIND, BEHIND, Onward],
            "three, held up together"
        );
        let falling = orders(&[900, 800, 700, 600, 500, 400, 300]);
        assert!(falling[1..].iter().all(|order| *order == FIRST), "no clock goes backwards: {falling:?}");
        let again = orders(&[900, 500, 500, 500, 500, 500, 900, 900, 600]);
        assert_eq!(
            again[2..],
            [BEHIND, BEHIND, BEHIND, BEHIND, Onward, Onward, BEHIND],
            "the same ones again count once"
        );
    }

    #[test]
    fn a_clock_that_was_set_back_is_noticed() {
        let near = orders(&[800, 900, 0, 100, 200, 300, 400]);
        let back = StampOrder::Restarted { first: false };
        assert_eq!(near[2..], [FIRST, BEHIND, BEHIND, back, StampOrder::Onward], "by less than a jump, at the fourth");
        let far = orders(&[5000, 0, 100]);
        assert_eq!(far[1..], [StampOrder::Restarted { first: true }, StampOrder::Onward], "by more, at once");
        let mut clock = Clock::default();
        for stamp in [i64::MAX, i64::MIN, 0, i64::MAX, -1] {
            clock.receive(stamp, SECOND);
        }
        assert_eq!(clock.receive(i64::MIN, Duration::MAX), FIRST, "however far");
    }
}
