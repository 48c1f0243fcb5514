//! What keys, panels and dialogs ask for. The application performs it.

use autosplats::Camera;
use autosplats::cloud::PointFilter;
use autosplats::cloud::glam::{DMat4, DVec3};

use crate::session::{ClipBox, Clock, Document, Input, LayerId, StoredInput};
use crate::ui::Command;
use crate::view::{Look, Recording};

/// Something to do.
pub(crate) enum Action {
    Run(Command),
    Open(Input),
    /// Opens a stored input, read and played as it was.
    OpenAgain(StoredInput),
    /// Reads the input of a layer again.
    Reload(LayerId),
    /// Chooses which points of a layer are shown.
    Keep(LayerId, PointFilter),
    /// Stops an input that has no points yet, by its number among the playing ones.
    GiveUpWaiting(usize),
    /// Removes layers, after a question if they have unsaved edits.
    Remove(Vec<LayerId>),
    /// Removes layers with their unsaved edits.
    RemoveEdited(Vec<LayerId>),
    SetVisible(LayerId, bool),
    /// Hides all other layers.
    ShowOnly(LayerId),
    SetTint(LayerId, Option<[u8; 3]>),
    Rename(LayerId, String),
    /// Moves a layer to a place in the list.
    Reorder(LayerId, usize),
    /// Opens the window for the pose of a layer.
    Place(LayerId),
    /// Poses a layer, until [`SettlePose`](Self::SettlePose) makes an undo step of it.
    PreviewPose {
        layer: LayerId,
        pose: DMat4,
    },
    SettlePose {
        layer: LayerId,
        before: DMat4,
        made: DMat4,
    },
    /// Sets the clipping box, until [`SettleClip`](Self::SettleClip) makes an undo step of it.
    PreviewClip(Option<ClipBox>),
    SettleClip,
    MoveSelected(DVec3),
    /// Turns the selected points about their middle.
    TurnSelected {
        axis: DVec3,
        radians: f64,
    },
    /// Notes that layers of an exported document are in a file.
    MarkSaved {
        document: Document,
        layers: Vec<LayerId>,
    },
    SetClock(Clock),
    SetLook(Box<Look>),
    /// Sets the vertical field of view, degrees.
    SetFov(f64),
    /// Moves the camera to show all of a layer.
    Fit(LayerId),
    GoTo(Camera),
    /// Moves to a copied camera.
    PasteView(String),
    /// Sets the key cameras of a film.
    SetKeys(Vec<Camera>),
    /// Shows a moment of a film: its camera and, where time runs, its clock position.
    ShowMoment {
        camera: Camera,
        place: Option<f64>,
    },
    Record(Box<Recording>),
    StopRecording,
}

impl From<Command> for Action {
    fn from(command: Command) -> Self {
        Self::Run(command)
    }
}
