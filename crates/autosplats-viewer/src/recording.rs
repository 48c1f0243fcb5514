//! Films in the making.
//!
//! # How it works
//! The render thread is asked for one picture after the other, so that the window goes on in between; a thread of its own
//! writes them, as PNG files or to ffmpeg, which makes a film.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use autosplats::{Camera, Image};
use eframe::egui;

use crate::files;
use crate::threads::spawn;

/// Pictures that wait to be written.
const QUEUE: usize = 3;

/// How many recordings there have been.
static RECORDINGS: AtomicU64 = AtomicU64::new(0);

/// Where pictures go.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Target {
    /// A PNG file each: what is before and after the number in its name.
    Frames(PathBuf, String, String),
    /// A film.
    Film(PathBuf),
}

impl Target {
    /// What a path means: a film by its extension, otherwise numbered PNG files.
    ///
    /// # Errors
    /// What is wrong with it.
    pub(crate) fn new(path: &Path) -> Result<Self, String> {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
        match path.extension().map(|extension| extension.to_string_lossy().to_lowercase()).as_deref() {
            Some("mp4" | "mkv" | "webm" | "mov") => Ok(Self::Film(path.into())),
            Some("png") => {
                let stem = name[..name.len() - 4].to_owned();
                let (before, after) = stem.split_once("%05d").map_or((stem.clone() + "_", ""), |(a, b)| (a.into(), b));
                Ok(Self::Frames(folder, before, format!("{after}.png")))
            }
            _ => Err("The name has to end in .mp4, .mkv, .webm, .mov or .png".into()),
        }
    }

    /// The file of a picture.
    fn frame(folder: &Path, before: &str, after: &str, number: usize) -> PathBuf {
        folder.join(format!("{before}{number:05}{after}"))
    }

    /// What would be replaced.
    pub(crate) fn existing(&self, pictures: usize) -> Option<PathBuf> {
        match self {
            Self::Film(path) => Some(path.clone()).filter(|path| path.exists()),
            Self::Frames(folder, before, after) => {
                (0..pictures).map(|number| Self::frame(folder, before, after, number)).find(|path| path.exists())
            }
        }
    }
}

/// Whether films can be made.
pub(crate) fn has_ffmpeg() -> bool {
    let mut probe = Command::new("ffmpeg");
    probe.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    probe.status().is_ok_and(|status| status.success())
}

/// A film in the making.
pub(crate) struct Recording {
    /// Which one it is: no other has the same number.
    pub(crate) number: u64,
    cameras: Vec<Camera>,
    /// Picture that is asked for next.
    next: usize,
    pub(crate) size: [u32; 2],
    /// To the thread that writes.
    pictures: Option<SyncSender<Image>>,
    /// One that the writer had no room for yet.
    waiting: Option<Image>,
    /// Whether a picture is being made.
    asked: bool,
    result: Receiver<Result<String, String>>,
}

impl Recording {
    /// Begins to write pictures of `cameras`, so many a second, to `target`.
    pub(crate) fn start(
        cameras: Vec<Camera>,
        size: [u32; 2],
        rate: u32,
        target: Target,
        context: &egui::Context,
    ) -> Self {
        let (pictures, queue) = sync_channel::<Image>(QUEUE);
        let (sender, result) = sync_channel(1);
        let context = context.clone();
        let total = cameras.len();
        spawn("film", move || {
            let written = match target {
                Target::Frames(folder, before, after) => {
                    write_frames(&queue, &folder, &before, &after, total, &context)
                }
                Target::Film(path) => write_film(&queue, &path, total, &context, |part| ffmpeg(part, size, rate)),
            };
            let _ = sender.send(written);
            context.request_repaint();
        });
        let number = RECORDINGS.fetch_add(1, Ordering::Relaxed);
        Self { number, cameras, next: 0, size, pictures: Some(pictures), waiting: None, asked: false, result }
    }

    /// Part that is done, 0 to 1.
    pub(crate) fn fraction(&self) -> f32 {
        self.next as f32 / self.cameras.len().max(1) as f32
    }

    /// The camera of the picture to be made now, if it is time.
    pub(crate) fn wanted(&mut self) -> Option<Camera> {
        if let Some(image) = self.waiting.take() {
            self.hand_over(image);
        }
        if self.asked || self.waiting.is_some() || self.pictures.is_none() {
            return None;
        }
        let camera = self.cameras.get(self.next).copied();
        match camera {
            Some(_) => {
                self.asked = true;
                self.next += 1;
            }
            // The writer ends when nobody can send any more.
            None => self.pictures = None,
        }
        camera
    }

    /// Takes in the picture that was wanted.
    pub(crate) fn arrived(&mut self, image: Image) {
        self.asked = false;
        self.hand_over(image);
    }

    fn hand_over(&mut self, image: Image) {
        let Some(pictures) = &self.pictures else { return };
        match pictures.try_send(image) {
            Ok(()) => {}
            Err(TrySendError::Full(image)) => self.waiting = Some(image),
            Err(TrySendError::Disconnected(_)) => self.pictures = None,
        }
    }

    /// Makes no more pictures.
    pub(crate) fn stop(&mut self) {
        self.pictures = None;
    }

    /// How it ended, once it has: what was written, or why not.
    pub(crate) fn ended(&self) -> Option<Result<String, String>> {
        self.result.try_recv().ok()
    }
}

/// Writes PNG files; those complete stay if the rest is not wanted any more.
fn write_frames(
    queue: &Receiver<Image>,
    folder: &Path,
    before: &str,
    after: &str,
    total: usize,
    context: &egui::Context,
) -> Result<String, String> {
    let mut count = 0;
    for image in queue {
        let path = Target::frame(folder, before, after, count);
        files::write(&path, |writer| files::encode_png(&image, writer))
            .map_err(|error| format!("{}: {error}", path.display()))?;
        count += 1;
        context.request_repaint();
    }
    let place = folder.join(format!("{before}…{after}"));
    if count < total {
        Err(format!("{count} of {total} pictures were written: {}", place.display()))
    } else {
        Ok(format!("{count} pictures were written: {}", place.display()))
    }
}

/// Hands pictures to ffmpeg, by a command that writes to the path it is given. The film appears complete or not at all.
fn write_film(
    queue: &Receiver<Image>,
    path: &Path,
    total: usize,
    context: &egui::Context,
    command: impl FnOnce(&Path) -> Command,
) -> Result<String, String> {
    let mut suffix = std::ffi::OsString::from(".");
    suffix.push(path.extension().unwrap_or_default());
    let part = files::temporary(path, &suffix).map_err(|error| format!("{}: {error}", path.display()))?;
    let part = part.into_temp_path();
    let mut command = command(&part);
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mut child = command.spawn().map_err(|error| format!("ffmpeg does not start: {error}"))?;
    let mut input = child.stdin.take();
    let mut count = 0;
    let mut died = false;
    for image in queue {
        died = input.as_mut().is_none_or(|pipe| pipe.write_all(image.pixels.as_flattened()).is_err());
        if died {
            break;
        }
        count += 1;
        context.request_repaint();
    }
    drop(input);
    let output = child.wait_with_output().map_err(|error| format!("ffmpeg: {error}"))?;
    // One that ended by itself says why; one that was stopped may complain that there were too few pictures.
    if count < total && !died {
        return Err("The film was stopped; nothing was written".into());
    }
    if died || !output.status.success() {
        let words = String::from_utf8_lossy(&output.stderr);
        return Err(format!("ffmpeg: {}", words.lines().last().unwrap_or("it failed without a word")));
    }
    part.persist(path).map_err(|error| format!("{}: {}", path.display(), error.error))?;
    Ok(format!("{count} pictures were written as {}", path.display()))
}

/// The command that makes a film of raw pictures.
fn ffmpeg(path: &Path, [width, height]: [u32; 2], rate: u32) -> Command {
    let mut command = Command::new("ffmpeg");
    command.args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"]);
    command.args(["-s", &format!("{width}x{height}"), "-r", &rate.to_string(), "-i", "-"]);
    // Most players want even sides and this kind of colour.
    command.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]).arg(path);
    command
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::navigation::Navigation;

    #[test]
    fn names_tell_what_is_written() {
        let target = |path: &str| Target::new(Path::new(path));
        assert_eq!(target("a/film.MP4"), Ok(Target::Film("a/film.MP4".into())), "a film");
        assert_eq!(target("a/f.png"), Ok(Target::Frames("a".into(), "f_".into(), ".png".into())), "numbered");
        assert_eq!(
            target("f%05d_x.png"),
            Ok(Target::Frames("".into(), "f".into(), "_x.png".into())),
            "where it is told"
        );
        assert!(target("film").is_err() && target("film.gif").is_err(), "others are not known");
    }

    /// Writes a film of `pictures` of 3 pictures by a shell script that is told the file's name as `$0`.
    #[cfg(unix)]
    fn film(path: &Path, pictures: usize, script: &str) -> Result<String, String> {
        let (sender, queue) = sync_channel(3);
        for _ in 0..pictures {
            let image = Image { width: 500, height: 500, pixels: vec![[7; 4]; 500 * 500], linear: Vec::new() };
            sender.send(image).expect("there is room");
        }
        drop(sender);
        write_film(&queue, path, 3, &egui::Context::default(), |part| {
            let mut command = Command::new("sh");
            command.args(["-c", script]).arg(part);
            command
        })
    }

    #[cfg(unix)]
    #[test]
    fn a_film_appears_when_it_is_complete() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("film.mp4");
        let stopped = film(&path, 1, "cat > \"$0\"; echo too few >&2; exit 1");
        assert_eq!(stopped, Err("The film was stopped; nothing was written".into()), "the user did that");
        assert_eq!(film(&path, 3, "echo bad >&2; exit 1"), Err("ffmpeg: bad".into()), "it died before all was read");
        assert_eq!(film(&path, 3, "cat > \"$0\"; echo late >&2; exit 1"), Err("ffmpeg: late".into()), "at the end");
        let names = || std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(names(), 0, "nothing is left behind");
        assert!(film(&path, 3, "cat > \"$0\"").is_ok(), "all is well");
        assert_eq!(std::fs::read(&path).expect("a film").len(), 3 * 4 * 500 * 500, "every picture is in it");
        let other = folder.path().join("other");
        std::fs::write(&other, "").expect("a file");
        let mode = |path: &Path| std::fs::metadata(path).expect("a file").permissions().mode();
        assert_eq!(mode(&path), mode(&other), "others may see it as any file");
    }

    #[test]
    fn no_two_recordings_are_mistaken_for_each_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = Target::new(&folder.path().join("t.png")).expect("pictures");
        let context = egui::Context::default();
        let [one, other] = [(); 2].map(|()| Recording::start(Vec::new(), [1, 1], 25, target.clone(), &context).number);
        assert_ne!(one, other, "each has a number of its own");
    }

    #[test]
    fn pictures_are_written_one_by_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let target = Target::new(&folder.path().join("t.png")).expect("pictures");
        let context = egui::Context::default();
        let mut recording = Recording::start(vec![Navigation::new().camera(); 2], [2, 1], 25, target.clone(), &context);
        let result = loop {
            if recording.wanted().is_some() {
                recording.arrived(Image { width: 2, height: 1, pixels: vec![[1, 2, 3, 255]; 2], linear: Vec::new() });
            }
            if let Some(result) = recording.ended() {
                break result;
            }
            std::thread::yield_now();
        };
        assert!(result.is_ok(), "{result:?}");
        assert_eq!(target.existing(2), Some(folder.path().join("t_00000.png")), "the first is there");
        assert!(folder.path().join("t_00001.png").exists(), "and the second");
    }
}
