//! A window.

#[allow(dead_code, reason = "the window that shows the document is not built yet")]
mod document;
#[allow(dead_code, reason = "the window that measures is not built yet")]
mod measure;
