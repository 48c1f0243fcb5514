//! Many requests at a time, on threads that the caller can leave.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::Builder;
use std::time::Duration;

use autosplats_cloud::{Error, Progress};

use crate::patience::Stop;

/// Most requests of a client at a time.
pub(crate) const AT_ONCE: usize = 12;

/// Time between two checks for cancellation.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);

/// Lets only so many threads pass at a time, from however many callers.
#[derive(Debug, Default)]
pub(crate) struct Gate {
    inside: Mutex<usize>,
    news: Condvar,
}

struct Inside<'a>(&'a Gate);

impl Gate {
    fn enter(&self, stop: &Stop) -> Result<Inside<'_>, Error> {
        let mut inside = self.inside.lock().unwrap_or_else(PoisonError::into_inner);
        while *inside >= AT_ONCE {
            stop.check()?;
            let waited = self.news.wait_timeout(inside, CHECK_INTERVAL);
            inside = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        *inside += 1;
        Ok(Inside(self))
    }
}

impl Drop for Inside<'_> {
    fn drop(&mut self) {
        *self.0.inside.lock().unwrap_or_else(PoisonError::into_inner) -= 1;
        self.0.news.notify_one();
    }
}

/// Does the jobs 0 to `jobs` for the address `shown` on at most [`AT_ONCE`] threads, and gives each result to `done` as
/// it arrives. The first failure ends all.
///
/// # Errors
/// Those of `job` and `done`, and [`Error::Cancelled`] if `progress` says so, without waiting for what runs.
pub(crate) fn run<T: Send + 'static>(
    gate: &Arc<Gate>,
    shown: &str,
    jobs: usize,
    job: impl Fn(usize, &Stop) -> Result<T, Error> + Send + Sync + 'static,
    progress: &dyn Progress,
    mut done: impl FnMut(usize, T) -> Result<(), Error>,
) -> Result<(), Error> {
    let stop = Arc::new(Stop::default());
    let work = Arc::new((job, AtomicUsize::new(0)));
    // What waits here has left the gate, so it is bounded too.
    let (sender, results) = sync_channel(AT_ONCE);
    for _ in 0..jobs.min(AT_ONCE) {
        let (stop, work, sender, gate) = (stop.clone(), work.clone(), sender.clone(), gate.clone());
        let labour = move || {
            let (job, next) = &*work;
            loop {
                let at = next.fetch_add(1, Ordering::Relaxed);
                if at >= jobs || stop.check().is_err() {
                    return;
                }
                let result = gate.enter(&stop).and_then(|_inside| job(at, &stop));
                if sender.send((at, result)).is_err() {
                    return;
                }
            }
        };
        // With fewer threads it only takes longer.
        if Builder::new().name("request".into()).spawn(labour).is_err() {
            break;
        }
    }
    drop(sender);
    let mut left = jobs;
    let mut step = || {
        if progress.cancelled() {
            return ControlFlow::Break(Err(Error::Cancelled));
        }
        if left == 0 {
            return ControlFlow::Break(Ok(()));
        }
        match results.recv_timeout(CHECK_INTERVAL) {
            Ok((at, result)) => match result.and_then(|result| done(at, result)) {
                Ok(()) => left -= 1,
                Err(error) => return ControlFlow::Break(Err(error)),
            },
            Err(RecvTimeoutError::Timeout) => {}
            // There is no thread, or it ended by a panic.
            Err(RecvTimeoutError::Disconnected) => {
                let what = "no thread is left for its requests; close other programs".to_owned();
                return ControlFlow::Break(Err(Error::Remote { address: shown.to_owned(), what }));
            }
        }
        ControlFlow::Continue(())
    };
    let outcome = loop {
        if let ControlFlow::Break(outcome) = step() {
            break outcome;
        }
    };
    stop.give();
    outcome
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;
    use std::time::Instant;

    use super::*;

    #[test]
    fn a_dozen_jobs_run_at_a_time() {
        let (gate, counts) = (Arc::new(Gate::default()), Arc::new((AtomicUsize::new(0), AtomicUsize::new(0))));
        let shared = counts.clone();
        let job = move |at: usize, _: &Stop| {
            let running = shared.0.fetch_add(1, Ordering::SeqCst) + 1;
            shared.1.fetch_max(running, Ordering::SeqCst);
            std::thread::sleep(Duration::from_millis(20));
            shared.0.fetch_sub(1, Ordering::SeqCst);
            Ok(at * at)
        };
        let mut squares = [0; 40];
        std::thread::scope(|scope| {
            let other = scope.spawn(|| run(&gate, "", 40, job.clone(), &(), |_, _| Ok(())));
            let keep = |at, square| {
                squares[at] = square;
                Ok(())
            };
            run(&gate, "", 40, job.clone(), &(), keep).expect("nothing fails");
            other.join().expect("no panic").expect("nothing fails");
        });
        assert!(squares.iter().enumerate().all(|(at, square)| *square == at * at), "each result is at its place");
        assert_eq!(counts.1.load(Ordering::SeqCst), AT_ONCE, "of both callers together");
    }

    #[test]
    fn failures_and_cancellation_end_waits() {
        struct Soon(AtomicBool);
        impl Progress for Soon {
            fn report(&self, _: f32) {}
            fn cancelled(&self) -> bool {
                self.0.swap(true, Ordering::SeqCst)
            }
        }
        let slow = |at: usize, _: &Stop| {
            if at == 3 {
                return Err(Error::NoSurface);
            }
            std::thread::sleep(Duration::from_secs(2));
            Ok(())
        };
        let start = Instant::now();
        let failed = run(&Arc::default(), "", 9, slow, &(), |_, ()| Ok(()));
        assert!(matches!(failed, Err(Error::NoSurface)), "{failed:?}");
        let cancelled = run(&Arc::default(), "", 3, slow, &Soon(AtomicBool::new(false)), |_, ()| Ok(()));
        assert!(matches!(cancelled, Err(Error::Cancelled)), "{cancelled:?}");
        assert!(start.elapsed() < Duration::from_secs(1), "{:?}", start.elapsed());
    }
}
