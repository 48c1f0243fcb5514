//! The open document and its edits, independent of any window or graphics.
//!
//! # How it works
//!
//! A [`Document`] is a list of [`Layer`]s. The cloud of a layer never changes; edits are kept beside it, as sets of
//! points and a list of moves. All large parts are shared, so that a clone of a document costs next to nothing. An edit
//! makes a new document; [`History`] keeps the old ones, and undo restores them.
//!
//! [`Document::shown`] makes the one cloud that is rendered. The cloud has to be made again only when
//! [`ShownCloud::shows`] returns false; the selection is not part of it. Renderer and pointer identify points by their
//! index in this cloud. [`ShownCloud`] maps the index to a layer and its point.
//!
//! An edit changes visible points only. Points that are hidden, outside the clipping box or in an invisible layer do
//! not change, even if they are selected.
//!
//! The cloud of an octree's layer is replaced as the view changes, because it holds what the view needs alone. So such
//! points cannot be edited; an export reads them anew.
//!
//! Clouds in degrees are shown in metres, on one [map](autosplats::cloud::LocalMetres) per document. Poses and moves
//! are in these metres; exported coordinates are in degrees again.

mod bits;
mod bounds;
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
mod tree;

pub(crate) use self::{
    bits::Bits,
    bounds::bounds_of,
    clip::ClipBox,
    edit::{Grip, about},
    export::{ExportError, ExportScope, Exported, Replace, export},
    history::{History, grouped, label},
    layer::{Counts, Layer, LayerId},
    layers::can_place,
    pick::{PickedPoint, shortest},
    region::Region,
    select::SelectMode,
    shown::ShownCloud,
    tree::{LayerTree, OpenTree},
};

/// The open layers and the clipping box. Clones share all large parts.
#[derive(Clone, Debug, Default)]
pub(crate) struct Document {
    /// The layers, in list order.
    pub(crate) layers: Vec<Layer>,
    /// The box outside of which nothing is shown.
    pub(crate) clip: Option<ClipBox>,
}
