//! A window that shows raw points as a lit surface.

#[allow(dead_code, reason = "the window that uses it is not built yet")]
mod document;
#[allow(dead_code, reason = "the window that uses it is not built yet")]
mod measure;
mod navigation;
