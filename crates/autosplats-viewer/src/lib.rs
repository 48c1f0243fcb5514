//! A window that shows raw points as a lit surface.
mod navigation;
