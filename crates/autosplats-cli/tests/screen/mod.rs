//! A screen in memory, with mouse, keyboard and screenshots.

use std::io::{BufRead as _, BufReader, IoSlice, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use x11rb::connection::{Connection as _, RequestConnection as _};
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    AtomEnum, ConnectionExt as _, CreateWindowAux, ImageFormat, InputFocus, MapState, Window, WindowClass,
};
use x11rb::rust_connection::RustConnection;

/// Longest time of a step on a busy machine.
const STEP_TIMEOUT: Duration = Duration::from_secs(300);
/// Time between two screenshots.
const SCREENSHOT_INTERVAL: Duration = Duration::from_millis(400);

/// X11 symbols of keys.
pub(crate) mod keys {
    pub(crate) const TAB: u32 = 0xff09;
    pub(crate) const ENTER: u32 = 0xff0d;
    pub(crate) const ESCAPE: u32 = 0xff1b;
    pub(crate) const DELETE: u32 = 0xffff;
    pub(crate) const CTRL: u32 = 0xffe3;
    pub(crate) const B: u32 = 'b' as u32;
    pub(crate) const C: u32 = 'c' as u32;
    pub(crate) const M: u32 = 'm' as u32;
    pub(crate) const Q: u32 = 'q' as u32;
    pub(crate) const S: u32 = 's' as u32;
    pub(crate) const X: u32 = 'x' as u32;
    pub(crate) const Z: u32 = 'z' as u32;
}

/// A screenshot, or a part of one.
#[derive(Clone, PartialEq)]
pub(crate) struct Picture {
    width: usize,
    pixels: Vec<[u8; 3]>,
}

impl Picture {
    /// The part between left, top, right and bottom.
    pub(crate) fn crop(&self, [left, top, right, bottom]: [i16; 4]) -> Self {
        let columns = left as usize..right as usize;
        let rows = self.pixels.chunks(self.width).take(bottom as usize).skip(top as usize);
        Self { width: columns.len(), pixels: rows.flat_map(|row| row[columns.clone()].to_vec()).collect() }
    }

    fn levels(&self) -> impl Iterator<Item = f64> + '_ {
        self.pixels.iter().map(|pixel| pixel.iter().map(|&value| f64::from(value)).sum::<f64>() / 3.0)
    }

    /// Mean level, 0 to 255.
    pub(crate) fn mean(&self) -> f64 {
        self.levels().sum::<f64>() / self.pixels.len() as f64
    }

    /// Standard deviation of the levels.
    pub(crate) fn spread(&self) -> f64 {
        let mean = self.mean();
        (self.levels().map(|level| (level - mean).powi(2)).sum::<f64>() / self.pixels.len() as f64).sqrt()
    }

    /// Mean level difference of horizontal neighbours.
    pub(crate) fn roughness(&self) -> f64 {
        let levels: Vec<f64> = self.levels().collect();
        let steps = levels.chunks(self.width).flat_map(|row| row.windows(2).map(|pair| (pair[0] - pair[1]).abs()));
        steps.sum::<f64>() / levels.len() as f64
    }

    /// Mean difference from another picture of the same size, 0 to 1.
    pub(crate) fn difference(&self, other: &Self) -> f64 {
        assert_eq!(self.pixels.len(), other.pixels.len(), "pictures of one size are compared");
        let pairs = self.pixels.as_flattened().iter().zip(other.pixels.as_flattened());
        pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / (255.0 * 3.0 * self.pixels.len() as f64)
    }

    /// Fraction of the pixels that satisfy `is`.
    pub(crate) fn share(&self, is: impl Fn([u8; 3]) -> bool) -> f64 {
        self.pixels.iter().filter(|&&pixel| is(pixel)).count() as f64 / self.pixels.len() as f64
    }

    /// Reads a picture from a file.
    pub(crate) fn read(path: &Path) -> Self {
        let picture = image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgb8();
        Self { width: picture.width() as usize, pixels: picture.pixels().map(|pixel| pixel.0).collect() }
    }

    fn write(&self, path: &Path) {
        let height = self.pixels.len() / self.width;
        let data = self.pixels.as_flattened();
        image::save_buffer(path, data, self.width as u32, height as u32, image::ExtendedColorType::Rgb8)
            .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

/// The screen and the program on it. Both end when this is dropped.
pub(crate) struct Screen {
    server: Child,
    name: String,
    connection: RustConnection,
    root: Window,
    size: [u16; 2],
    program: Option<Child>,
    errors: Option<PathBuf>,
    pictures: PathBuf,
}

impl Drop for Screen {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("pictures are in {}; the program said: {}", self.pictures.display(), self.words());
        }
        for child in self.program.iter_mut().chain([&mut self.server]) {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

impl Screen {
    /// Starts a screen of this size. Returns `None` where Xvfb is missing, which fails in CI.
    pub(crate) fn start([width, height]: [u16; 2]) -> Option<Self> {
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-nolisten", "tcp", "-noreset", "-screen", "0"]);
        command.arg(format!("{width}x{height}x24"));
        let started = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut server = match started {
            Ok(server) => server,
            Err(error) => {
                assert!(std::env::var_os("CI").is_none(), "CI has Xvfb: {error}");
                println!("Xvfb cannot be started ({error}): this test checks nothing. On Debian: apt-get install xvfb");
                return None;
            }
        };
        let mut number = String::new();
        let output = server.stdout.take().expect("it is piped");
        BufReader::new(output).read_line(&mut number).expect("the server tells its number");
        let name = format!(":{}", number.trim());
        let (connection, screen) = RustConnection::connect(Some(&name)).expect("the screen is there");
        let root = connection.setup().roots[screen].root;
        let pictures = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("window-session");
        std::fs::create_dir_all(&pictures).expect("the folder of pictures can be made");
        Some(Self { server, name, connection, root, size: [width, height], program: None, errors: None, pictures })
    }

    /// Runs a program on the screen, with a home folder of its own.
    pub(crate) fn run(&mut self, mut command: Command, home: &Path) {
        std::fs::create_dir_all(home).expect("a home can be made");
        let errors = home.join("errors.txt");
        let file = std::fs::File::create(&errors).expect("the home can be written");
        command.env("DISPLAY", &self.name).env_remove("WAYLAND_DISPLAY").env_remove("WAYLAND_SOCKET");
        for name in ["HOME", "XDG_DATA_HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME", "XDG_RUNTIME_DIR"] {
            command.env(name, home);
        }
        // Without a session bus, no portal answers requests for dialogs.
        command.env_remove("DBUS_SESSION_BUS_ADDRESS");
        // The machine's GPU may not support this screen; the software renderer does.
        let software = "/usr/share/vulkan/icd.d/lvp_icd.x86_64.json";
        if Path::new(software).is_file() {
            command.env("VK_DRIVER_FILES", software).env("VK_ICD_FILENAMES", software);
        }
        let child = command.stdout(Stdio::null()).stderr(file).spawn().expect("the program starts");
        self.program = Some(child);
        self.errors = Some(errors);
        self.focus();
    }

    /// Gives the keyboard to the program's window, since the screen has no window manager.
    fn focus(&mut self) {
        let start = Instant::now();
        let window = loop {
            let tree = self.connection.query_tree(self.root).expect("asked").reply().expect("the root has a tree");
            let shown = |window: &Window| {
                let asked = self.connection.get_window_attributes(*window).ok();
                let size = self.connection.get_geometry(*window).ok().and_then(|asked| asked.reply().ok());
                asked.and_then(|asked| asked.reply().ok()).is_some_and(|state| state.map_state == MapState::VIEWABLE)
                    && size.is_some_and(|size| size.width > 300)
            };
            if let Some(window) = tree.children.into_iter().find(shown) {
                break window;
            }
            self.check_alive();
            assert!(start.elapsed() < STEP_TIMEOUT, "there is no window after {STEP_TIMEOUT:?}");
            std::thread::sleep(SCREENSHOT_INTERVAL);
        };
        self.connection
            .set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME)
            .expect("asked")
            .check()
            .expect("the window takes the keyboard");
    }

    fn check_alive(&mut self) {
        if let Some(program) = &mut self.program {
            let ended = program.try_wait().expect("the program can be asked");
            assert!(ended.is_none(), "the program has ended: {ended:?}");
        }
    }

    /// The program's standard error.
    pub(crate) fn words(&self) -> String {
        let mut words = String::new();
        if let Some(mut file) = self.errors.as_ref().and_then(|path| std::fs::File::open(path).ok()) {
            let _ = file.read_to_string(&mut words);
        }
        words
    }

    /// Waits until the program ends and returns its exit code.
    pub(crate) fn finish(&mut self) -> Option<i32> {
        let start = Instant::now();
        let program = self.program.as_mut().expect("a program runs");
        while start.elapsed() < STEP_TIMEOUT {
            if let Some(status) = program.try_wait().expect("the program can be asked") {
                return status.code();
            }
            std::thread::sleep(SCREENSHOT_INTERVAL);
        }
        panic!("the program still runs after {STEP_TIMEOUT:?}");
    }

    /// Takes a screenshot.
    fn look(&self) -> Picture {
        let [width, height] = self.size;
        let asked = self.connection.get_image(ImageFormat::Z_PIXMAP, self.root, 0, 0, width, height, u32::MAX);
        let data = asked.expect("asked").reply().expect("the screen can be seen").data;
        let pixels = data.chunks_exact(4).map(|pixel| [pixel[2], pixel[1], pixel[0]]).collect();
        Picture { width: width.into(), pixels }
    }

    /// Waits until the screen shows what `is` accepts, two screenshots are equal, and the program hardly computes
    /// between them: while it does, a finer picture follows. Saves the picture. Panics after `STEP_TIMEOUT`.
    pub(crate) fn settled(&mut self, name: &str, is: impl Fn(&Picture) -> bool) -> Picture {
        self.wait(name, STEP_TIMEOUT, is).unwrap_or_else(|| panic!("step '{name}' is not seen after {STEP_TIMEOUT:?}"))
    }

    /// Like [`settled`](Self::settled), but returns `None` after `time`.
    pub(crate) fn wait(&mut self, name: &str, time: Duration, is: impl Fn(&Picture) -> bool) -> Option<Picture> {
        let start = Instant::now();
        let (mut last, mut computed) = (self.look(), self.computing_time());
        loop {
            std::thread::sleep(SCREENSHOT_INTERVAL);
            self.check_alive();
            let (now, computed_now) = (self.look(), self.computing_time());
            let rests = computed_now.saturating_sub(computed) < SCREENSHOT_INTERVAL / 4;
            let done = now == last && rests && is(&now);
            if done || start.elapsed() > time {
                now.write(&self.pictures.join(format!("{name}.png")));
                return done.then_some(now);
            }
            (last, computed) = (now, computed_now);
        }
    }

    /// Processor time that the program has used so far, on all its threads; zero once it has ended.
    fn computing_time(&self) -> Duration {
        let Some(program) = &self.program else { return Duration::ZERO };
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", program.id())).unwrap_or_default();
        // The name, in parentheses, may hold spaces. Fields 14 and 15 are user and system time in hundredths.
        let fields = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace();
        let hundredths = fields.skip(11).take(2).filter_map(|field| field.parse::<u64>().ok()).sum::<u64>();
        Duration::from_millis(10 * hundredths)
    }

    /// Sends XTEST's FakeInput. The request is encoded here because the window's x11rb is built without the feature for
    /// it.
    fn fake(&self, kind: u8, detail: u8, [x, y]: [i16; 2]) {
        let extension = self.connection.extension_information("XTEST").expect("asked").expect("the screen has XTEST");
        let mut request = [0_u8; 36];
        request[..6].copy_from_slice(&[extension.major_opcode, 2, 9, 0, kind, detail]);
        request[2..4].copy_from_slice(&9_u16.to_ne_bytes());
        request[12..16].copy_from_slice(&self.root.to_ne_bytes());
        request[24..26].copy_from_slice(&x.to_ne_bytes());
        request[26..28].copy_from_slice(&y.to_ne_bytes());
        let sent = self.connection.send_request_without_reply(&[IoSlice::new(&request)], Vec::new());
        sent.expect("sent").check().expect("the screen takes it");
        // Events within one frame could merge into one.
        std::thread::sleep(Duration::from_millis(60));
    }

    pub(crate) fn point(&self, place: [i16; 2]) {
        self.fake(6, 0, place);
    }

    pub(crate) fn click(&self, place: [i16; 2]) {
        self.point(place);
        [4, 5].into_iter().for_each(|kind| self.fake(kind, 1, [0, 0]));
    }

    /// Drags in eight steps. Lets go when the screen has changed, as a person would: on a busy machine all steps may
    /// fall between two frames of the window, which then sees no drag.
    pub(crate) fn drag(&self, button: u8, from: [i16; 2], to: [i16; 2]) {
        let (before, start) = (self.look(), Instant::now());
        self.point(from);
        self.fake(4, button, [0, 0]);
        for step in 1..=8 {
            self.point([0, 1].map(|i| from[i] + (to[i] - from[i]) * step / 8));
        }
        while self.look() == before && start.elapsed() < STEP_TIMEOUT {
            std::thread::sleep(SCREENSHOT_INTERVAL);
        }
        self.fake(5, button, [0, 0]);
    }

    fn code(&self, symbol: u32) -> u8 {
        let setup = self.connection.setup();
        let (least, most) = (setup.min_keycode, setup.max_keycode);
        let asked = self.connection.get_keyboard_mapping(least, most - least + 1).expect("asked");
        let map = asked.reply().expect("there is a keyboard");
        let mut codes = map.keysyms.chunks(map.keysyms_per_keycode.into()).zip(least..);
        codes.find(|(symbols, _)| symbols[0] == symbol).unwrap_or_else(|| panic!("no key for {symbol:x}")).1
    }

    pub(crate) fn key(&self, symbol: u32) {
        let code = self.code(symbol);
        [2, 3].into_iter().for_each(|kind| self.fake(kind, code, [0, 0]));
    }

    /// Presses a key while another is held.
    pub(crate) fn keys_with(&self, held: u32, symbol: u32) {
        let held = self.code(held);
        self.fake(2, held, [0, 0]);
        self.key(symbol);
        self.fake(3, held, [0, 0]);
    }

    /// Text on the clipboard; `None` if none arrives in time.
    pub(crate) fn clipboard(&self) -> Option<String> {
        let atom = |name: &str| {
            let asked = self.connection.intern_atom(false, name.as_bytes()).expect("asked");
            asked.reply().expect("a name has a number").atom
        };
        let (clipboard, text, place) = (atom("CLIPBOARD"), atom("UTF8_STRING"), atom("AUTOSPLATS_TEST"));
        let window = self.connection.generate_id().expect("there are numbers");
        let (class, aux) = (WindowClass::INPUT_ONLY, CreateWindowAux::new());
        let made =
            self.connection.create_window(0, window, self.root, 0, 0, 1, 1, 0, class, x11rb::COPY_FROM_PARENT, &aux);
        made.expect("asked").check().expect("a window that nobody sees");
        let start = Instant::now();
        while start.elapsed() < STEP_TIMEOUT {
            let asked = self.connection.convert_selection(window, clipboard, text, place, x11rb::CURRENT_TIME);
            asked.expect("asked").check().expect("the screen has a clipboard");
            std::thread::sleep(SCREENSHOT_INTERVAL);
            while let Some(event) = self.connection.poll_for_event().expect("the screen is there") {
                if matches!(&event, Event::SelectionNotify(answer) if answer.property == place) {
                    let asked = self.connection.get_property(true, window, place, AtomEnum::ANY, 0, u32::MAX / 4);
                    return String::from_utf8(asked.expect("asked").reply().expect("it was told of").value).ok();
                }
            }
        }
        None
    }
}
