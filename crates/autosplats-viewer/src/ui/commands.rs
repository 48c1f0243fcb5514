//! All commands of the user. Menus, shortcuts, tooltips and the help window are made from this list.

use autosplats::ViewDirection;
use eframe::egui::{Key, KeyboardShortcut, Modifiers};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Command {
    Open,
    Export,
    Screenshot,
    Film,
    SaveState,
    CloseAll,
    Quit,
    Undo,
    Redo,
    SelectAll,
    SelectNone,
    InvertSelection,
    HideSelected,
    ShowAll,
    DeleteSelected,
    CropToSelected,
    Clip,
    FitAll,
    FitSelected,
    View(ViewDirection),
    OppositeView,
    Projection,
    UpAxis,
    Level,
    CopyView,
    PasteView,
    Dots,
    Play,
    StepBack,
    StepForward,
    PlayFromHere,
    PlayToHere,
    Inputs,
    Look,
    Statistics,
    Help,
    NextPart,
    PreviousPart,
    Tool(Tool),
}

/// What the left mouse button does in the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub(crate) enum Tool {
    /// Turns the view.
    #[default]
    Navigate,
    /// Shows the coordinates and attributes of a point.
    Inspect,
    /// Measures between points.
    Measure,
    /// Moves and turns the selection.
    Move,
    /// Selects the points in a rectangle.
    Rectangle,
    /// Selects the points inside a free-hand line.
    Lasso,
    /// Selects the points that a brush passes over.
    Brush,
}

impl Tool {
    pub(crate) const ALL: [Self; 7] =
        [Self::Navigate, Self::Inspect, Self::Measure, Self::Rectangle, Self::Lasso, Self::Brush, Self::Move];

    /// Name in the tool bar.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Navigate => "Navigate",
            Self::Inspect => "Inspect",
            Self::Measure => "Measure",
            Self::Rectangle => "Rectangle",
            Self::Lasso => "Lasso",
            Self::Brush => "Brush",
            Self::Move => "Move",
        }
    }

    /// Whether the tool selects points.
    pub(crate) fn selects(self) -> bool {
        matches!(self, Self::Rectangle | Self::Lasso | Self::Brush)
    }
}

impl Command {
    /// All commands, in menu order.
    pub(crate) const ALL: [Self; 52] = [
        Self::Open,
        Self::Export,
        Self::Screenshot,
        Self::Film,
        Self::SaveState,
        Self::CloseAll,
        Self::Quit,
        Self::Undo,
        Self::Redo,
        Self::SelectAll,
        Self::SelectNone,
        Self::InvertSelection,
        Self::HideSelected,
        Self::ShowAll,
        Self::DeleteSelected,
        Self::CropToSelected,
        Self::Clip,
        Self::FitAll,
        Self::FitSelected,
        Self::View(ViewDirection::Front),
        Self::View(ViewDirection::Back),
        Self::View(ViewDirection::Right),
        Self::View(ViewDirection::Left),
        Self::View(ViewDirection::Top),
        Self::View(ViewDirection::Bottom),
        Self::View(ViewDirection::Iso),
        Self::View(ViewDirection::Auto),
        Self::OppositeView,
        Self::Projection,
        Self::UpAxis,
        Self::Level,
        Self::CopyView,
        Self::PasteView,
        Self::Dots,
        Self::Play,
        Self::StepBack,
        Self::StepForward,
        Self::PlayFromHere,
        Self::PlayToHere,
        Self::Inputs,
        Self::Look,
        Self::Statistics,
        Self::Help,
        Self::NextPart,
        Self::PreviousPart,
        Self::Tool(Tool::Navigate),
        Self::Tool(Tool::Inspect),
        Self::Tool(Tool::Measure),
        Self::Tool(Tool::Rectangle),
        Self::Tool(Tool::Lasso),
        Self::Tool(Tool::Brush),
        Self::Tool(Tool::Move),
    ];

    /// Label in menus.
    pub(crate) fn label(self) -> &'static str {
        match self {
            Self::Open => "Open…",
            Self::Export => "Export points…",
            Self::Screenshot => "Save picture…",
            Self::Film => "Film…",
            Self::SaveState => "Save session…",
            Self::CloseAll => "Close all",
            Self::Quit => "Quit",
            Self::Undo => "Undo",
            Self::Redo => "Redo",
            Self::SelectAll => "Select all",
            Self::SelectNone => "Select nothing",
            Self::InvertSelection => "Invert selection",
            Self::HideSelected => "Hide selected",
            Self::ShowAll => "Show hidden",
            Self::DeleteSelected => "Delete selected",
            Self::CropToSelected => "Crop to selected",
            Self::Clip => "Clipping box",
            Self::FitAll => "Fit all",
            Self::FitSelected => "Fit selected",
            Self::View(ViewDirection::Front) => "Front",
            Self::View(ViewDirection::Back) => "Back",
            Self::View(ViewDirection::Right) => "Right",
            Self::View(ViewDirection::Left) => "Left",
            Self::View(ViewDirection::Top) => "Top",
            Self::View(ViewDirection::Bottom) => "Bottom",
            Self::View(ViewDirection::Iso) => "From a corner",
            Self::View(_) => "First view",
            Self::OppositeView => "Opposite side",
            Self::Projection => "Perspective / orthographic",
            Self::UpAxis => "Next up axis",
            Self::Level => "Level horizon",
            Self::CopyView => "Copy view",
            Self::PasteView => "Paste view",
            Self::Dots => "Points / surface",
            Self::Play => "Play / pause",
            Self::StepBack => "Previous frame",
            Self::StepForward => "Next frame",
            Self::PlayFromHere => "Play from here",
            Self::PlayToHere => "Play to here",
            Self::Inputs => "Inputs",
            Self::Look => "Look",
            Self::Statistics => "Statistics",
            Self::Help => "Keys and mouse",
            Self::NextPart => "Next part of the window",
            Self::PreviousPart => "Previous part of the window",
            Self::Tool(Tool::Navigate) => "Navigate",
            Self::Tool(Tool::Inspect) => "Inspect point",
            Self::Tool(Tool::Measure) => "Measure",
            Self::Tool(Tool::Rectangle) => "Select by rectangle",
            Self::Tool(Tool::Lasso) => "Select by lasso",
            Self::Tool(Tool::Brush) => "Select by brush",
            Self::Tool(Tool::Move) => "Move selected",
        }
    }

    pub(crate) fn shortcut(self) -> Option<KeyboardShortcut> {
        let plain = |key| Some(KeyboardShortcut::new(Modifiers::NONE, key));
        let command = |key| Some(KeyboardShortcut::new(Modifiers::COMMAND, key));
        let shift = |key| Some(KeyboardShortcut::new(Modifiers::COMMAND | Modifiers::SHIFT, key));
        match self {
            Self::Open => command(Key::O),
            Self::Export => command(Key::E),
            Self::Screenshot => command(Key::S),
            Self::Film => command(Key::T),
            Self::SaveState => shift(Key::S),
            Self::CloseAll => shift(Key::W),
            Self::Quit => command(Key::Q),
            Self::Undo => command(Key::Z),
            Self::Redo => shift(Key::Z),
            Self::SelectAll => command(Key::A),
            Self::SelectNone => plain(Key::Escape),
            Self::InvertSelection => command(Key::I),
            Self::HideSelected => command(Key::H),
            Self::ShowAll => shift(Key::H),
            Self::DeleteSelected => plain(Key::Delete),
            Self::CropToSelected => shift(Key::K),
            Self::Clip => plain(Key::K),
            Self::FitAll => plain(Key::R),
            Self::FitSelected => plain(Key::F),
            Self::View(ViewDirection::Front) => plain(Key::Num1),
            Self::View(ViewDirection::Back) => command(Key::Num1),
            Self::View(ViewDirection::Right) => plain(Key::Num3),
            Self::View(ViewDirection::Left) => command(Key::Num3),
            Self::View(ViewDirection::Top) => plain(Key::Num7),
            Self::View(ViewDirection::Bottom) => command(Key::Num7),
            Self::View(ViewDirection::Iso) => plain(Key::Num0),
            Self::View(_) => plain(Key::Home),
            Self::OppositeView => plain(Key::Num9),
            Self::Projection => plain(Key::Num5),
            Self::UpAxis => plain(Key::U),
            Self::Level => plain(Key::J),
            // The clipboard's own keys, which egui reports as events.
            Self::CopyView => command(Key::C),
            Self::PasteView => command(Key::V),
            Self::Dots => plain(Key::Tab),
            Self::Play => plain(Key::Space),
            Self::StepBack => plain(Key::Comma),
            Self::StepForward => plain(Key::Period),
            Self::PlayFromHere => plain(Key::OpenBracket),
            Self::PlayToHere => plain(Key::CloseBracket),
            Self::Inputs => plain(Key::I),
            Self::Look => plain(Key::L),
            Self::Statistics => plain(Key::P),
            Self::Help => plain(Key::H),
            Self::NextPart => plain(Key::F6),
            Self::PreviousPart => Some(KeyboardShortcut::new(Modifiers::SHIFT, Key::F6)),
            Self::Tool(Tool::Navigate) => plain(Key::N),
            Self::Tool(Tool::Inspect) => plain(Key::X),
            Self::Tool(Tool::Measure) => plain(Key::M),
            Self::Tool(Tool::Rectangle) => plain(Key::B),
            Self::Tool(Tool::Lasso) => plain(Key::G),
            Self::Tool(Tool::Brush) => plain(Key::C),
            Self::Tool(Tool::Move) => plain(Key::V),
        }
    }

    pub(crate) fn tooltip(self) -> &'static str {
        match self {
            Self::Open => "Open point clouds, meshes or depth images, in addition to the open ones",
            Self::Export => "Save the points with all edits, in any format",
            Self::Screenshot => "Save the picture, at any size",
            Self::Film => "Record a turntable or a camera path, as a film or as pictures",
            Self::SaveState => "Save what is open and how it is shown; 'autosplats --state FILE' restores it",
            Self::CloseAll => "Close all inputs",
            Self::Quit => "Close the window",
            Self::Undo => "Undo the last change",
            Self::Redo => "Redo the change that was undone last",
            Self::SelectAll => "Select all visible points",
            Self::SelectNone => "Deselect all points, or leave the tool",
            Self::InvertSelection => "Select the points that are not selected",
            Self::HideSelected => "Hide the selected points until they are shown again",
            Self::ShowAll => "Show all hidden points again",
            Self::DeleteSelected => "Delete the selected points; the files stay unchanged",
            Self::CropToSelected => "Delete all other points; the files stay unchanged",
            Self::Clip => "Show only the points in a box; its faces can be dragged",
            Self::FitAll => "Move the camera to show everything, in the same direction",
            Self::FitSelected => "Move the camera to show the selected points",
            Self::View(ViewDirection::Auto) => "Return to the view that was chosen when the first file was opened",
            Self::View(_) => "Look from this side, at a distance that shows everything",
            Self::OppositeView => "Look from the opposite side",
            Self::Projection => "Switch between perspective and orthographic projection",
            Self::UpAxis => "Next up axis: as guessed, Z, Y, X, -Z, -Y, -X, or a camera's coordinates",
            Self::Level => "Make the horizon level",
            Self::CopyView => "Copy the camera as JSON, for 'render --camera'",
            Self::PasteView => "Move to a copied camera",
            Self::Dots => "Switch between raw points and surface",
            Self::Play => "Start or pause playback; paused points can be edited",
            Self::StepBack => "Pause, one frame earlier",
            Self::StepForward => "Pause, one frame later",
            Self::PlayFromHere => "Play only from this time on",
            Self::PlayToHere => "Play only up to this time",
            Self::Inputs => "The list of open inputs",
            Self::Look => "How the points are shown",
            Self::Statistics => "Render times and point counts",
            Self::Help => "All keys and mouse actions",
            Self::NextPart => "Move the keyboard focus to the next panel or window; Escape returns it to the picture",
            Self::PreviousPart => "Move the keyboard focus to the previous panel or window",
            Self::Tool(Tool::Navigate) => "Left drag turns the view",
            Self::Tool(Tool::Inspect) => "Click a point to see its coordinates and attributes",
            Self::Tool(Tool::Measure) => "Click points to measure distance, height and angle",
            Self::Tool(Tool::Rectangle) => "Drag a rectangle; Shift adds, Ctrl removes",
            Self::Tool(Tool::Lasso) => "Draw around points; Shift adds, Ctrl removes",
            Self::Tool(Tool::Brush) => "Paint over points; Shift adds, Ctrl removes",
            Self::Tool(Tool::Move) => "Drag arrows and rings to move and turn the selected points",
        }
    }

    /// Shortcut as menus show it.
    pub(crate) fn key(self, context: &eframe::egui::Context) -> String {
        self.shortcut().map_or_else(String::new, |shortcut| context.format_shortcut(&shortcut))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_commands_share_a_key() {
        for (number, command) in Command::ALL.iter().enumerate() {
            for other in &Command::ALL[number + 1..] {
                assert!(command.shortcut() != other.shortcut(), "{command:?} and {other:?} share a key");
                assert!(command != other, "{command:?} is in the list twice");
            }
        }
    }

    #[test]
    fn keys_that_fly_do_nothing_else() {
        for key in [Key::W, Key::A, Key::S, Key::D, Key::Q, Key::E] {
            let plain = KeyboardShortcut::new(Modifiers::NONE, key);
            assert!(Command::ALL.iter().all(|command| command.shortcut() != Some(plain)), "{key:?} flies");
        }
    }
}
