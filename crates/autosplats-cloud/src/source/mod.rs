//! Where clouds come from when not from a file.

pub(crate) mod scene;
