//! Pictures held against the exact surface.
//!
//! # How it works
//! A *case* is a subject and a view of it ([`case`]). A subject is a surface that is known exactly, and points on it as
//! good or as bad as scanners make them ([`subject`]), strewn or in the rings of a spinning lidar ([`sweep`]). One ray per
//! pixel centre tells what is truly there ([`exact`]). Several methods draw the points ([`method`]); each picture is judged
//! pixel by pixel ([`verdict`]), lit like the truth ([`light`]), and measured ([`measure`]). Lit pictures are held against a truth of
//! many rays besides, stills among them ([`still`]).

pub mod case;
pub mod exact;
pub mod flip;
pub mod light;
pub mod measure;
pub mod mesh;
pub mod method;
pub mod motion;
pub mod neighbors;
pub mod page;
pub mod picture;
pub mod random;
pub mod run;
pub mod sheet;
pub mod still;
pub mod subject;
pub mod surface;
pub mod sweep;
pub mod table;
pub mod target;
pub mod verdict;
pub mod view;
