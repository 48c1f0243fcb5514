//! The `autosplats` command.
fn main() {}
