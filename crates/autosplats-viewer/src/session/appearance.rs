//! How an input is shown.

/// How an input is shown once it has points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Appearance {
    pub(crate) visible: bool,
    /// One colour for all points; `None` shows their own colours.
    pub(crate) tint: Option<[u8; 3]>,
}

impl Default for Appearance {
    fn default() -> Self {
        Self { visible: true, tint: None }
    }
}
