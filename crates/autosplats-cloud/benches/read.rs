//! Points per second from a memory-mapped file, file in the page cache: `cargo bench -p autosplats-cloud`.
fn main() {}
