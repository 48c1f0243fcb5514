//! The tests of the public interface, in one program: each further one is linked for itself, with all that the crate
//! stands on.

mod backends;
mod kd_tree;
mod properties;
mod sensors;
mod smoothing;
mod surfels;
#[path = "../../src/test_clouds.rs"]
mod test_clouds;
