//! Measures pictures against the exact surface: `cargo xtask quality`.
//!
//! # How it works
//! A *case* is a subject and a view of it ([`case`]). A subject is an exact surface with points on it ([`subject`]).
//! The points are sampled evenly or scanned by a spinning lidar ([`sweep`]), with the defects of real scans. One ray
//! through each pixel's centre finds the true surface ([`exact`]). Several methods draw the points ([`method`]). Each
//! picture is judged pixel by pixel ([`verdict`]), lit like the truth ([`light`]) and measured ([`measure`]). Lit
//! pictures and stills are also compared with a truth of 16 rays per pixel ([`still`]). The measures of all cases are a
//! record ([`record`]), from which the page is made ([`page`]) and which is compared with the committed one
//! ([`compare`]).

pub mod case;
pub mod compare;
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
pub mod rays;
pub mod record;
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
