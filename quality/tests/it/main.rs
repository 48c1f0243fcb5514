//! Pictures against the exact surface, in one program of tests: each further one is linked for itself.

mod light;
mod limits;
mod subjects;
mod sweep;
mod truth;
