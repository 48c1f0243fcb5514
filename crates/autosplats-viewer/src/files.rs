//! The one place that asks the system for files, since a browser has none.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, channel};

use autosplats::cloud::{Output, write_whole};
use eframe::egui;

use crate::threads::spawn;

/// Path of a dropped file, if the platform has paths.
pub(crate) fn dropped(file: &dyn egui::DroppedFile) -> Option<PathBuf> {
    Some(file.path()).filter(|path| path.is_absolute()).map(Path::to_path_buf)
}

/// Opens the system's file dialog on a thread of its own. The receiver yields the chosen paths: an empty list if the
/// dialog was cancelled, `None` if there is no dialog.
pub(crate) fn ask_for_inputs(context: &egui::Context) -> Receiver<Option<Vec<PathBuf>>> {
    let (sender, receiver) = channel();
    let context = context.clone();
    spawn("dialog", move || {
        let extensions: Vec<&str> =
            autosplats_formats::formats().flat_map(|(_, extensions)| extensions).copied().chain(["gz"]).collect();
        let dialog =
            rfd::FileDialog::new().set_title("Open").add_filter("Point clouds, meshes, depth images", &extensions);
        // Tests have no user to ask.
        let files = if cfg!(test) { None } else { dialog.add_filter("All files", &["*"]).pick_files() };
        // On Linux the dialog is another program, which may be missing. `rfd` then returns `None`, and an empty list
        // for a cancelled dialog. Elsewhere `None` means cancelled.
        let _ = sender.send(files.or_else(|| (!cfg!(target_os = "linux")).then(Vec::new)));
        context.request_repaint();
    });
    receiver
}

/// Opens the system's dialog for an output file. The receiver yields `None` if the dialog was cancelled or does not
/// exist.
pub(crate) fn ask_for_output(context: &egui::Context, title: &str, name: &str) -> Receiver<Option<PathBuf>> {
    let (sender, receiver) = channel();
    let context = context.clone();
    let (title, name) = (title.to_owned(), name.to_owned());
    spawn("dialog", move || {
        let chosen = if cfg!(test) {
            // Tests write to the temporary folder, without a dialog.
            Some(std::env::temp_dir().join(format!("{}-{name}", std::process::id())))
        } else {
            rfd::FileDialog::new().set_title(title).set_file_name(name).save_file()
        };
        let _ = sender.send(chosen);
        context.request_repaint();
    });
    receiver
}

/// Writes a file atomically: it appears complete or not at all.
pub(crate) fn write<'a>(
    output: impl Into<Output<'a>>,
    content: impl FnOnce(&mut dyn std::io::Write) -> std::io::Result<()>,
) -> std::io::Result<()> {
    write_whole(output, |error| error, |file| content(file)).map(|_bytes| ())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn others_may_read_what_is_written() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let mode = |name: &str| std::fs::metadata(folder.path().join(name)).expect("a file").permissions().mode();
        write(&folder.path().join("ours"), |writer| writer.write_all(b"ours")).expect("it is written");
        std::fs::write(folder.path().join("any"), b"any").expect("it is written");
        assert_eq!(mode("ours"), mode("any"), "as any other file");
    }
}
