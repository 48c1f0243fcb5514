//! Random input in random order: nothing may panic, and memory may not grow.

use super::*;
use crate::ui::Command;

/// A reproducible sequence of random numbers (xorshift64*, Vigna 2016).
struct Chance(u64);

impl Chance {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() >> 33) as usize % count
    }

    fn share(&mut self) -> f32 {
        self.below(10_001) as f32 / 10_000.0
    }
}

/// Counts memory that is allocated and not freed. The memory of the process depends on the allocator.
#[global_allocator]
static ALLOCATED: peak_alloc::PeakAlloc = peak_alloc::PeakAlloc;

/// Inputs that are opened and closed.
const SCENES: [&str; 4] = [STATUE, "scene:figure:5K", "scene:herd:3K", "/nowhere/absent.ply"];

fn anything(window: &mut Window, chance: &mut Chance) {
    let size = window.harness.input().screen_rect.map_or(SMALL, |rect| rect.size());
    let place = |chance: &mut Chance| egui::pos2(chance.share() * size.x, chance.share() * size.y);
    let modifiers = |chance: &mut Chance| [Modifiers::NONE, Modifiers::NONE, SHIFT, CTRL, CTRL_SHIFT][chance.below(5)];
    match chance.below(12) {
        0 | 1 => {
            let command = Command::ALL[chance.below(Command::ALL.len())];
            let Some(shortcut) = command.shortcut() else { return };
            if !matches!(command, Command::Quit | Command::SaveState) {
                let ctrl = if shortcut.modifiers.command { CTRL } else { Modifiers::NONE };
                window.key(ctrl | shortcut.modifiers, shortcut.logical_key);
            }
        }
        2 | 3 => {
            let buttons =
                [PointerButton::Primary, PointerButton::Primary, PointerButton::Secondary, PointerButton::Middle];
            let (button, held) = (buttons[chance.below(4)], modifiers(chance));
            let (from, to) = (place(chance), place(chance));
            window.drag(button, held, from, to);
        }
        4 | 5 => {
            let place = place(chance);
            // A click in a dialog could write a file.
            if !window.says("Browse…") {
                window.click(place);
            }
        }
        6 => {
            let place = place(chance);
            window.event(Event::PointerMoved(place));
            window.event(Event::MouseWheel {
                unit: egui::MouseWheelUnit::Line,
                delta: egui::vec2(0.0, 8.0 * (chance.share() - 0.5)),
                phase: egui::TouchPhase::Move,
                modifiers: modifiers(chance),
                source: egui::MouseWheelSource::Wheel,
            });
        }
        7 => {
            let side = |least: f32, share: f32| (least + 700.0 * share).round();
            let size = egui::vec2(side(640.0, chance.share()), side(400.0, chance.share()));
            window.harness.set_size(size);
        }
        8 => {
            if let Ok(input) = Input::parse(SCENES[chance.below(SCENES.len())]) {
                // More layers make pictures slow and test nothing more.
                if window.app().session.document().layers.len() < 3 {
                    window.harness.state_mut().session.open(input);
                }
            }
        }
        9 => {
            let context = window.harness.ctx.clone();
            window.harness.state_mut().run(Command::CloseAll, &context);
            if chance.below(2) == 0 {
                window.press(Key::Escape);
            }
        }
        10 => {
            let keys =
                [Key::W, Key::A, Key::S, Key::D, Key::ArrowLeft, Key::Tab, Key::Enter, Key::Escape, Key::Backspace];
            let key = keys[chance.below(keys.len())];
            // Enter in a dialog could write a file.
            if key == Key::Enter && window.says("Browse…") {
                return;
            }
            let held = modifiers(chance);
            window.event(Event::Key { key, physical_key: None, pressed: true, repeat: false, modifiers: held });
            window.steps(4);
            window.event(Event::Key { key, physical_key: None, pressed: false, repeat: false, modifiers: held });
        }
        _ => {
            let text = ["scene:statue:20K", "ä", "?", "\u{0}", "{\"eye\":[0,0,1]}"][chance.below(5)];
            let event = if chance.below(2) == 0 { Event::Text(text.into()) } else { Event::Paste(text.into()) };
            window.event(event);
        }
    }
    window.steps(1 + chance.below(3));
}

/// Resets the program: everything is closed, the undo history is dropped, and the window has its first size. Returns
/// the megabytes still allocated.
fn rest(window: &mut Window) -> f64 {
    window.harness.set_size(SMALL);
    // The window's requests to the system are kept by the test, not by the program.
    (window.commands, window.outputs) = (Vec::new(), Vec::new());
    let app = window.harness.state_mut();
    app.session.loader.cancel_all();
    app.session.history = crate::session::History::default();
    app.session.version += 1;
    // A film preview may hold tens of thousands of cameras.
    app.ui.panels.film.stop();
    window.until("everything is closed", |window| {
        let app = window.app();
        app.session.loader.jobs().is_empty() && app.session.document().layers.is_empty() && app.view.render.is_idle()
    });
    // Pending results are received, and writing threads release their data.
    for _ in 0..10 {
        std::thread::sleep(Duration::from_millis(5));
        window.step();
    }
    f64::from(ALLOCATED.current_usage_as_mb())
}

/// Least number of times that everything is closed.
const RESTS: usize = 12;

/// Sends random input for `seconds`, on a busy machine longer, until there are [`RESTS`]. Memory that remains after
/// everything is closed may grow by `allowed_mb`.
///
/// While inputs are open, memory varies by hundreds of megabytes, which would hide a leak. So everything is closed from
/// time to time, and the memory still allocated is sampled. Caches are full after a third of the time. The growth is
/// the minimum of the last third minus that of the middle third.
fn soak(seconds: f64, seed: u64, allowed_mb: f64) {
    let mut window = Window::with_statue();
    let mut chance = Chance(seed);
    let start = Instant::now();
    let (mut events, mut samples, mut next) = (0_u64, Vec::new(), 0.0);
    let lasts = |seconds: f64| start.elapsed().as_secs_f64() < seconds;
    while lasts(seconds) || samples.len() < RESTS && lasts(10.0 * seconds) {
        anything(&mut window, &mut chance);
        // Another backend has buffers of its own, so that samples could not be compared.
        window.harness.state_mut().view.look.backend = Backend::Cpu;
        events += 1;
        if start.elapsed().as_secs_f64() >= next {
            samples.push(rest(&mut window));
            next = start.elapsed().as_secs_f64() + (0.03 * seconds).min(2.0);
        }
    }
    let (least, grown) = (least(&samples, 6), grown(&samples));
    let what = format!("{events} rounds in {:.0?}, seed {seed}, {} rests", start.elapsed(), samples.len());
    let peak = ALLOCATED.peak_usage_as_mb();
    let seen = format!("{what}: {least:.2?} MB at least in each sixth, {grown:.2} MB more at last; {peak:.0} at most");
    println!("{seen}");
    assert!(grown < allowed_mb, "memory grows: {seen}");
    assert!(samples.len() >= RESTS, "the window still answers: {seen}");
    window.until("it can still be used", |window| !window.app().view.navigation.is_moving());
}

/// The minima of `parts` equal parts.
fn least(samples: &[f64], parts: usize) -> Vec<f64> {
    let len = samples.len() / parts;
    let least = |part: usize| samples[part * len..][..len].iter().copied().fold(f64::INFINITY, f64::min);
    (0..parts).map(least).collect()
}

/// Minimum of the last third minus that of the middle third, megabytes.
fn grown(samples: &[f64]) -> f64 {
    let least = least(samples, 3);
    least[2] - least[1]
}

#[test]
fn growth_is_told_from_chance() {
    let mut chance = Chance(7);
    // Between 300 and 400 MB, as inputs come and go.
    let steady: Vec<f64> = (0..900).map(|_| 300.0 + f64::from(100.0 * chance.share())).collect();
    assert!(grown(&steady).abs() < 2.0, "as things go: {}", grown(&steady));
    let leaking: Vec<f64> = steady.iter().zip(0..).map(|(own, second)| own + 0.1 * f64::from(second)).collect();
    assert!(grown(&leaking) > 10.0, "0.1 MB a sample are seen: {}", grown(&leaking));
    let filling: Vec<f64> = steady.iter().zip(0..).map(|(own, second)| own.min(f64::from(second) * 2.0)).collect();
    assert!(grown(&filling).abs() < 2.0, "what fills at first is kept on purpose: {}", grown(&filling));
}

/// Other tests of this process run at the same time and allocate memory too. This test finds panics and fast growth
/// only.
#[test]
fn twenty_seconds_of_anything() {
    soak(20.0, 0x5EED_0001, 300.0);
}

/// The long test, to be run alone. `AUTOSPLATS_SOAK_SECONDS` sets its length.
#[test]
#[ignore = "takes ten minutes"]
fn ten_minutes_of_anything() {
    let seconds = std::env::var("AUTOSPLATS_SOAK_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(600.0);
    soak(seconds, 0x5EED_0002, 2.0);
}
