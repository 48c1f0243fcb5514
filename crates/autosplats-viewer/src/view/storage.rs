//! What is kept between starts.

use std::path::PathBuf;

use crate::session::{Session, StoredInput};
use crate::view::{Look, View};

const LOOK: &str = "look";
const RECENT: &str = "recent";

/// Stores the look and the recent inputs, with how these are read and played.
pub(crate) fn save(session: &Session, view: &View, storage: &mut dyn eframe::Storage) {
    let mut look = view.look.clone();
    // Value range and exposure belong to one file's values and colours.
    look.settings.shading.range = None;
    look.settings.shading.exposure = None;
    eframe::set_value(storage, LOOK, &look);
    eframe::set_value(storage, RECENT, &session.recent);
}

/// Loads what was stored. Values that this version does not understand become defaults.
pub(crate) fn load(storage: Option<&dyn eframe::Storage>) -> (Look, Vec<StoredInput>) {
    let Some(storage) = storage else { return (Look::default(), Vec::new()) };
    let look: Look = eframe::get_value(storage, LOOK).unwrap_or_default();
    let look = if look.settings.check().is_ok() { look } else { Look::default() };
    // Older versions stored paths only.
    let paths = || eframe::get_value::<Vec<PathBuf>>(storage, RECENT).unwrap_or_default();
    let recent = eframe::get_value(storage, RECENT)
        .unwrap_or_else(|| paths().iter().map(|path| StoredInput::named(path.display().to_string())).collect());
    (look, recent)
}
