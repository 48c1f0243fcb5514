//! The length of a file after its header, which formats tell that can follow each other in a stream.

/// Length of a file after its header.
pub(super) enum Body {
    /// This many bytes.
    Bytes(usize),
    /// This many lines, blank lines and comments not counted.
    Lines(usize),
    /// Two 32-bit numbers, the first of which is the number of bytes after them.
    Sized,
    /// Records of unequal length.
    Records(Box<dyn Records>),
}

/// Records that tell their lengths only as they arrive.
pub(super) trait Records: Send {
    /// The first byte after the last record, once all have arrived. `at` is the start of the current record.
    fn end(&mut self, bytes: &[u8], at: &mut usize) -> Result<Option<usize>, String>;
}
