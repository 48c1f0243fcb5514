//! The one place where threads are started, as a browser has other ones.

/// Runs `work` beside the window. Nobody waits for it: what it has to say it sends.
pub(crate) fn spawn(name: &str, work: impl FnOnce() + Send + 'static) {
    let builder = std::thread::Builder::new().name(format!("autosplats {name}"));
    // A system without room for another thread has no room for a window either.
    builder.spawn(work).expect("the system starts a thread");
}
