//! Films, made by ffmpeg from raw pictures.

use std::ffi::OsString;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::Mutex;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use autosplats::Image;
use autosplats::cloud::{Draft, Output, lock};

use crate::Error;

/// Whether films can be made: whether ffmpeg starts.
pub fn has_ffmpeg() -> bool {
    let mut probe = Command::new("ffmpeg");
    probe.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    probe.status().is_ok_and(|status| status.success())
}

/// A film in the making. The file appears when the film is [finished](Self::finish). A dropped film leaves nothing
/// behind.
///
/// # Examples
///
/// ```no_run
/// use autosplats::Image;
/// use autosplats_output::{Film, has_ffmpeg};
///
/// if has_ffmpeg() {
///     let mut film = Film::begin("fade.mp4", [64, 48], 25.0)?;
///     for shade in 0..=255 {
///         let pixels = vec![[shade, shade, shade, 255]; 64 * 48];
///         film.add(&Image { width: 64, height: 48, pixels, ..Image::default() })?;
///     }
///     film.finish()?;
/// }
/// # Ok::<(), autosplats_output::Error>(())
/// ```
#[derive(Debug)]
pub struct Film {
    path: PathBuf,
    /// The unfinished file; `None` once it is in place.
    part: Option<Draft>,
    size: [u32; 2],
    child: Running,
    input: Option<ChildStdin>,
    /// Reads ffmpeg's messages, so that ffmpeg never waits for a reader.
    words: Option<JoinHandle<String>>,
}

impl Film {
    /// Begins a film of `size` (width, height) pixels with `rate` pictures per second. A file at `path` stays until the
    /// film is finished.
    ///
    /// # Errors
    /// [`Error::Io`] if the folder is not writable, [`Error::NoFfmpeg`] if ffmpeg does not start.
    pub fn begin<'a>(output: impl Into<Output<'a>>, size: [u32; 2], rate: f64) -> Result<Self, Error> {
        Self::with(output.into(), size, |part| ffmpeg(part, size, rate))
    }

    /// Begins a film with a command that writes to the given path and reads pictures from its standard input.
    fn with(output: Output<'_>, size: [u32; 2], command: impl FnOnce(&Path) -> Command) -> Result<Self, Error> {
        let path = output.path;
        // The extension tells ffmpeg the format.
        let mut suffix = OsString::from(".");
        suffix.push(path.extension().unwrap_or_default());
        let part = Draft::begin(output, suffix).map_err(|source| Error::Io { path: path.into(), source })?;
        let mut command = command(part.path());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = Running::start(command).map_err(Error::NoFfmpeg)?;
        let input = child.child.stdin.take();
        let words = child.child.stderr.take().map(|mut pipe| {
            std::thread::spawn(move || {
                let mut words = Vec::new();
                // Unreadable messages are dropped.
                let _ = pipe.read_to_end(&mut words);
                String::from_utf8_lossy(&words).into_owned()
            })
        });
        Ok(Self { path: path.into(), part: Some(part), size, child, input, words })
    }

    /// Adds a picture.
    ///
    /// # Errors
    /// [`Error::Ffmpeg`] with the last message of ffmpeg if it has ended.
    ///
    /// # Panics
    /// If the picture's size differs from the film's.
    pub fn add(&mut self, picture: &Image) -> Result<(), Error> {
        assert_eq!([picture.width, picture.height], self.size, "all pictures of a film have its size");
        let written = self.input.as_mut().map(|pipe| pipe.write_all(picture.pixels.as_flattened()));
        if matches!(written, Some(Ok(()))) { Ok(()) } else { Err(self.complaint()) }
    }

    /// Completes the film and puts its file in place.
    ///
    /// # Errors
    /// [`Error::Ffmpeg`] if ffmpeg failed, [`Error::Io`] if the file cannot be put in place.
    pub fn finish(mut self) -> Result<(), Error> {
        self.input = None;
        let status = self.child.wait().map_err(|error| Error::Ffmpeg(error.to_string()))?;
        if !status.success() {
            return Err(self.complaint());
        }
        match self.part.take().map(Draft::finish) {
            Some(Err(source)) => Err(Error::Io { path: self.path.clone(), source }),
            _ => Ok(()),
        }
    }

    /// Error with the last message of ffmpeg.
    fn complaint(&mut self) -> Error {
        self.input = None;
        // It has ended, or ends because its input does.
        let _ = self.child.wait();
        let words = self.words.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        let last = words.lines().rev().find(|line| !line.trim().is_empty());
        Error::Ffmpeg(last.unwrap_or("it failed without a message").trim().into())
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        if self.part.is_some() {
            self.input = None;
            self.child.kill();
            let _ = self.child.wait();
        }
    }
}

/// Process numbers of the running ffmpegs, and whether the process ends, so that none may start.
static RUNNING: Mutex<(Vec<u32>, bool)> = Mutex::new((Vec::new(), false));

/// Longest wait for the list of running ffmpegs when the process ends.
const END_WITHIN: Duration = Duration::from_secs(1);

/// Ends the ffmpegs of all films and lets no other start: for a process that ends now. Returns after a second at most.
pub fn abandon_films() {
    let begun = Instant::now();
    while begun.elapsed() < END_WITHIN {
        if let Ok(mut running) = RUNNING.try_lock() {
            running.1 = true;
            running.0.iter().for_each(|&number| kill_group(number));
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Ends a program and all that it has started.
fn kill_group(number: u32) {
    #[cfg(unix)]
    if let Some(group) = i32::try_from(number).ok().and_then(rustix::process::Pid::from_raw) {
        // It may have ended.
        let _ = rustix::process::kill_process_group(group, rustix::process::Signal::KILL);
    }
    #[cfg(not(unix))]
    let _ = number;
}

/// An ffmpeg that the list of all knows.
#[derive(Debug)]
struct Running {
    child: Child,
}

impl Running {
    fn start(mut command: Command) -> std::io::Result<Self> {
        // Ctrl-C must only reach this process, which then removes the unfinished file.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut running = lock(&RUNNING);
        if running.1 {
            return Err(std::io::Error::other("the program ends"));
        }
        let child = command.spawn()?;
        running.0.push(child.id());
        Ok(Self { child })
    }

    fn wait(&mut self) -> std::io::Result<ExitStatus> {
        let status = self.child.wait();
        self.forget();
        status
    }

    fn kill(&mut self) {
        if matches!(self.child.try_wait(), Ok(None)) {
            kill_group(self.child.id());
            let _ = self.child.kill();
        }
    }

    /// The number may be another program's from now on.
    fn forget(&self) {
        lock(&RUNNING).0.retain(|&number| number != self.child.id());
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.forget();
    }
}

/// The command that makes a film of raw pictures.
fn ffmpeg(path: &Path, [width, height]: [u32; 2], rate: f64) -> Command {
    let mut command = Command::new("ffmpeg");
    command.args(["-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgba"]);
    command.args(["-s", &format!("{width}x{height}"), "-r", &rate.to_string(), "-i", "-"]);
    // Most players require even sides and this pixel format.
    command.args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]).arg(path);
    command
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [500, 500];

    /// A film of three pictures, made by a shell script with the file's name as `$0`.
    fn film(path: &Path, script: &str) -> Result<(), Error> {
        let mut film = Film::with(path.into(), SIZE, |part| {
            let mut command = Command::new("sh");
            command.args(["-c", script]).arg(part);
            command
        })?;
        let picture = Image { width: 500, height: 500, pixels: vec![[7; 4]; 500 * 500], linear: Vec::new() };
        (0..3).try_for_each(|_| film.add(&picture))?;
        film.finish()
    }

    #[test]
    fn a_film_appears_when_it_is_complete() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("film.mp4");
        let words = |script: &str| film(&path, script).expect_err("it fails").to_string();
        assert_eq!(words("echo bad >&2; exit 1"), "ffmpeg: bad", "it died before all was read");
        assert_eq!(words("cat > \"$0\"; echo late >&2; exit 1"), "ffmpeg: late", "at the end");
        assert_eq!(words("cat > \"$0\"; exit 1"), "ffmpeg: it failed without a message");
        // More than a pipe holds.
        assert_eq!(words("yes | head -c 300000 >&2; cat > \"$0\"; exit 1"), "ffmpeg: y", "it never waits for a reader");
        let dropped = Film::with((&path).into(), SIZE, |part| {
            let mut command = Command::new("sh");
            command.args(["-c", "cat > \"$0\""]).arg(part);
            command
        });
        drop(dropped.expect("it begins"));
        let names = || std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(names(), 0, "nothing is left behind");
        film(&path, "cat > \"$0\"").expect("all is well");
        assert_eq!(std::fs::read(&path).expect("a film").len(), 3 * 4 * 500 * 500, "every picture is in it");
        let other = folder.path().join("other");
        std::fs::write(&other, "").expect("a file");
        let mode = |path: &Path| std::fs::metadata(path).expect("a file").permissions().mode();
        assert_eq!(mode(&path), mode(&other), "others may see it as any file");
    }
}
