//! Pictures against the exact surface, in one program of tests, because every further program is linked by itself.

mod light;
mod limits;
mod subjects;
mod sweep;
mod truth;
