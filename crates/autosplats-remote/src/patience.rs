//! How often, and after which wait, a request is tried again.

use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use autosplats_cloud::{Error, one_line};

use crate::fault::{Fault, Wait};

/// How often a request is tried again.
const MORE_TRIES: u32 = 4;

/// Longest wait that a server may ask for.
const LONGEST_WAIT: Duration = Duration::from_secs(30);

/// A signal to threads that nobody waits for them any more.
#[derive(Debug, Default)]
pub(crate) struct Stop {
    given: Mutex<bool>,
    news: Condvar,
}

impl Stop {
    pub(crate) fn give(&self) {
        *self.given.lock().unwrap_or_else(PoisonError::into_inner) = true;
        self.news.notify_all();
    }

    pub(crate) fn check(&self) -> Result<(), Error> {
        self.sleep(Duration::ZERO)
    }

    fn sleep(&self, time: Duration) -> Result<(), Error> {
        let given = self.given.lock().unwrap_or_else(PoisonError::into_inner);
        let (given, _) =
            self.news.wait_timeout_while(given, time, |given| !*given).unwrap_or_else(PoisonError::into_inner);
        if *given { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// Tries of one request.
pub(crate) struct Patience<'a> {
    shown: &'a str,
    stop: &'a Stop,
    wait: Duration,
    left: u32,
    tries: u32,
}

impl<'a> Patience<'a> {
    /// For a request to the address `shown`. `wait` is the first wait, and each further one is twice as long.
    pub(crate) fn new(shown: &'a str, wait: Duration, stop: &'a Stop) -> Self {
        Self { shown, stop, wait, left: MORE_TRIES, tries: 1 }
    }

    /// Waits after a fault until it is time for the next try.
    ///
    /// # Errors
    /// The fault, if there is no next try.
    pub(crate) fn after(&mut self, fault: Fault) -> Result<(), Error> {
        let remote = |what: String| Error::Remote { address: self.shown.to_owned(), what: one_line(&what) };
        let (what, wait) = match fault {
            Fault::Error(error) => return Err(error),
            Fault::Final(what) => return Err(remote(what)),
            Fault::Passing(what, wait) => (what, wait),
        };
        let pause = match wait {
            Wait::Usual => self.wait,
            Wait::None => Duration::ZERO,
            Wait::Once => {
                self.left = self.left.min(1);
                self.wait
            }
            Wait::Told(told) if told > LONGEST_WAIT => {
                return Err(remote(format!("{what}, and asks to come back after {} s", told.as_secs())));
            }
            Wait::Told(told) => told.max(self.wait),
        };
        if self.left == 0 {
            return Err(remote(format!("{what} ({} tries); try again later", self.tries)));
        }
        self.stop.sleep(pause)?;
        self.left -= 1;
        self.tries += 1;
        self.wait *= 2;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tries(fault: impl Fn() -> Fault) -> (u32, String) {
        let stop = Stop::default();
        let mut patience = Patience::new("http://h/a", Duration::ZERO, &stop);
        let mut tries = 1;
        loop {
            match patience.after(fault()) {
                Ok(()) => tries += 1,
                Err(error) => return (tries, error.to_string()),
            }
        }
    }

    #[test]
    fn passing_faults_are_tried_five_times() {
        let told = |tries: u32, what: &str| (tries, format!("http://h/a: {what}"));
        let passing = |wait: fn() -> Wait| tries(move || Fault::Passing("it broke".into(), wait()));
        assert_eq!(passing(|| Wait::Usual), told(5, "it broke (5 tries); try again later"));
        assert_eq!(passing(|| Wait::Once), told(2, "it broke (2 tries); try again later"));
        let hour = || Wait::Told(Duration::from_secs(3600));
        assert_eq!(passing(hour), told(1, "it broke, and asks to come back after 3600 s"));
        assert_eq!(tries(|| Fault::Final("it is so".into())), told(1, "it is so"));
    }

    #[test]
    fn waits_end_when_nobody_waits() {
        let stop = Stop::default();
        std::thread::scope(|scope| {
            let waiting = scope.spawn(|| {
                let mut patience = Patience::new("", Duration::from_secs(100), &stop);
                patience.after(Fault::Passing(String::new(), Wait::Usual))
            });
            stop.give();
            assert!(matches!(waiting.join(), Ok(Err(Error::Cancelled))), "it ended by the signal");
        });
        assert!(matches!(stop.check(), Err(Error::Cancelled)), "and stays so");
    }
}
