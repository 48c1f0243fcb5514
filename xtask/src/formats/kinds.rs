//! Kinds of faults that files have, and what becomes of each.

/// Start of the section.
pub(super) const KINDS_TEXT: &str = "\
## Faults

Each kind has one rule, which all formats share that can have it. *Told* means a note of one line and exit code 0.
*Refused* means an error of one line that names the file, the position and the remedy.
";

/// A kind of fault.
pub(super) struct Kind {
    pub(super) fault: &'static str,
    pub(super) outcome: &'static str,
}

/// All kinds, in the order of the document.
pub(super) const KINDS: &[Kind] = &[];
