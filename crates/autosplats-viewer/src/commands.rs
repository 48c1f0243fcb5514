//! All commands of the user. Menus, shortcuts, tooltips and the help window are made from this list.

use autosplats::ViewDirection;
use eframe::egui::{Key, KeyboardShortcut, Modifiers};

/// A command of the user.
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
            Self::StepBack => "Frame before",
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

    /// Keyboard shortcut.
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

    /// Text of the tooltip.
    pub(crate) fn tooltip(self) -> &'static str {
        match self {
            Self::Open => "Add point clouds, meshes or depth images to what is open",
            Self::Export => "Write the points as they are now, edits included, in any format",
            Self::Screenshot => "Write what is seen, at any size",
            Self::Film => "A turntable or a way through views, as a film or as pictures",
            Self::SaveState => "Keep what is open and how it is seen; 'autosplats --state FILE' has it again",
            Self::CloseAll => "Remove everything that is open",
            Self::Quit => "Close the window",
            Self::Undo => "Take back the last change",
            Self::Redo => "Do again what was taken back",
            Self::SelectAll => "Select all points that are shown",
            Self::SelectNone => "Select nothing, or leave the tool",
            Self::InvertSelection => "Select what is not selected",
            Self::HideSelected => "Leave the selected points out until they are shown again",
            Self::ShowAll => "Show all points that were hidden",
            Self::DeleteSelected => "Take the selected points out; the files stay as they are",
            Self::CropToSelected => "Take all other points out; the files stay as they are",
            Self::Clip => "Show only what is in a box, whose faces can be dragged",
            Self::FitAll => "Stand where everything is seen, looking the same way",
            Self::FitSelected => "Stand where the selected points are seen",
            Self::View(ViewDirection::Auto) => "Stand where the program stood when the first file was opened",
            Self::View(_) => "Look from this side, at a distance that shows everything",
            Self::OppositeView => "Look from the other side",
            Self::Projection => "With or without things further away becoming smaller",
            Self::UpAxis => "Another axis upward: as guessed, Z, Y, or -Y for a camera's frame",
            Self::Level => "Stand the picture upright",
            Self::CopyView => "Copy the camera as JSON, as 'render --camera' takes it",
            Self::PasteView => "Stand where a copied camera stood",
            Self::Dots => "Change between the raw points and the surface",
            Self::Play => "Let what moves go on, or hold it, so that its points can be edited",
            Self::StepBack => "Hold what moves, one frame earlier",
            Self::StepForward => "Hold what moves, one frame later",
            Self::PlayFromHere => "Play only what comes from this time on",
            Self::PlayToHere => "Play only what comes before this time",
            Self::Inputs => "What is open",
            Self::Look => "How it is shown",
            Self::Statistics => "What a picture costs",
            Self::Help => "Everything that keys and mouse do",
            Self::NextPart => "Give the keyboard to the next panel or window; Escape gives it back to the picture",
            Self::PreviousPart => "The other way round",
            Self::Tool(Tool::Navigate) => "Left drag turns the view",
            Self::Tool(Tool::Inspect) => "Click a point to see its coordinates and attributes",
            Self::Tool(Tool::Measure) => "Click points to measure distance, height and angle",
            Self::Tool(Tool::Rectangle) => "Drag a rectangle; Shift adds, Ctrl takes away",
            Self::Tool(Tool::Lasso) => "Draw around points; Shift adds, Ctrl takes away",
            Self::Tool(Tool::Brush) => "Paint over points; Shift adds, Ctrl takes away",
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
