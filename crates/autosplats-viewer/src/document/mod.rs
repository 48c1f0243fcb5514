//! What is open in the viewer, and all that is done to it. There is nothing of a window or of graphics in here.
//!
//! # How it works
//!
//! A [`Document`] is a list of [`Layer`]s. A layer's cloud is never changed; what was done to its points is kept beside it,
//! as sets of points and a list of moves. All big parts are shared, so that a clone of a document costs next to nothing:
//! an edit is a new document, [`History`] keeps the old ones, and undoing takes one back.
//!
//! [`Document::shown`] makes the one cloud that is rendered. It has to be made anew only when [`Shown::shows`] says no; the
//! selection is not part of it. Points of it are told by an index into it, as the renderer and the pointer know them, and
//! [`Shown`] knows which point of which layer that is.
//!
//! An edit reaches what can be seen and nothing else: points that are hidden, outside of the clipping box or in an
//! invisible layer are safe from it even if they were selected before.
//!
//! Clouds in degrees are shown in metres on a [map](autosplats::cloud::LocalMetres) that all of a document's share; poses
//! and moves are in these metres, and what is exported is in degrees again.

mod bits;
mod clip;
mod edit;
mod export;
mod history;
mod layer;
mod layers;
mod pick;
mod region;
mod select;
mod shown;
#[cfg(test)]
mod tests;

pub(crate) use self::{
    bits::Bits,
    clip::ClipBox,
    edit::{Grip, about},
    export::{ExportError, Exported, Replace, What, export},
    history::{History, grouped, label},
    layer::{Counts, Layer, LayerId},
    layers::bounds_of,
    pick::{PickedPoint, shortest},
    region::Region,
    select::SelectMode,
    shown::Shown,
};

/// Everything that is open. Clones share all that is big.
#[derive(Clone, Debug, Default)]
pub(crate) struct Document {
    /// The inputs, in the order of the list.
    pub(crate) layers: Vec<Layer>,
    /// The box outside of which nothing is shown.
    pub(crate) clip: Option<ClipBox>,
}
