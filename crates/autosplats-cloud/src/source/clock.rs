//! The clock of a sensor, by the stamps of what comes from it: when they go back, somebody may have begun anew.

use std::time::Duration;

/// So many messages in a row that are older than the newest, each newer than the one before, come from a clock that was set
/// back. Fewer may have been held up together on their way.
const ROW: u32 = 4;

/// What a stamp means after those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// Newer than all before, or as new as the newest.
    Onward,
    /// Older than the newest: it was overtaken, or begins what may turn out to be a clock that was set back.
    Behind {
        /// Whether it may be the first of them.
        first: bool,
    },
    /// The clock was set back: by too much for a message that was overtaken, or for too many of them.
    Restarted {
        /// Whether it is the first after it.
        first: bool,
    },
}

/// The clock of one sensor.
#[derive(Debug, Default)]
pub(super) struct Clock {
    newest: Option<i64>,
    /// The last of those in a row that were behind, and how many they are.
    row: Option<(i64, u32)>,
}

impl Clock {
    /// Takes the next stamp, in nanoseconds. What is older than the newest by more than `jump` has not been overtaken.
    pub(super) fn hear(&mut self, stamp: i64, jump: Duration) -> Order {
        let Some(newest) = self.newest.filter(|&newest| stamp < newest) else {
            // The newest again says nothing about which clock it is of.
            if self.newest != Some(stamp) {
                *self = Self { newest: Some(stamp), row: None };
            }
            return Order::Onward;
        };
        let (count, first) = match self.row {
            Some((last, count)) if stamp > last => (count + 1, false),
            // The same one sent again.
            Some((last, count)) if stamp == last => (count, false),
            _ => (1, true),
        };
        let far = Duration::from_nanos(newest.saturating_sub(stamp).unsigned_abs()) > jump;
        if far || count >= ROW {
            *self = Self { newest: Some(stamp), row: None };
            return Order::Restarted { first: far };
        }
        self.row = Some((stamp, count));
        Order::Behind { first }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: Duration = Duration::from_secs(1);
    const BEHIND: Order = Order::Behind { first: false };
    const FIRST: Order = Order::Behind { first: true };

    fn orders(stamps: &[i64]) -> Vec<Order> {
        let mut clock = Clock::default();
        stamps.iter().map(|milliseconds| clock.hear(milliseconds * 1_000_000, SECOND)).collect()
    }

    #[test]
    fn what_was_overtaken_does_not_set_a_clock_back() {
        use Order::Onward;
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
        let back = Order::Restarted { first: false };
        assert_eq!(near[2..], [FIRST, BEHIND, BEHIND, back, Order::Onward], "by less than a jump, at the fourth");
        let far = orders(&[5000, 0, 100]);
        assert_eq!(far[1..], [Order::Restarted { first: true }, Order::Onward], "by more, at once");
        let mut clock = Clock::default();
        for stamp in [i64::MAX, i64::MIN, 0, i64::MAX, -1] {
            clock.hear(stamp, SECOND);
        }
        assert_eq!(clock.hear(i64::MIN, Duration::MAX), FIRST, "however far");
    }
}
