//! The one place that starts threads, since a browser has other ones.

/// Runs `work` on a thread of its own. Nothing joins the thread; it sends its results.
pub(crate) fn spawn(name: &str, work: impl FnOnce() + Send + 'static) {
    let builder = std::thread::Builder::new().name(format!("autosplats {name}"));
    // A system without room for another thread has no room for a window either.
    builder.spawn(work).expect("the system starts a thread");
}
