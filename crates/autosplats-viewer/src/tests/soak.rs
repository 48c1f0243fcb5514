//! Anything in any order: nothing may panic, and memory may not grow.

use super::*;
use crate::commands::Command;

/// A sequence of numbers that is the same each time (xorshift64*, Vigna 2016).
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

/// Megabytes of memory that this program has in use.
fn resident_mb() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/statm").ok()?;
    let pages: f64 = text.split_whitespace().nth(1)?.parse().ok()?;
    Some(pages * 4096e-6)
}

/// What is opened and closed.
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
            // Dialogs that write would write.
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
                // More than a few make pictures slow and test nothing more.
                if window.app().document().layers.len() < 3 {
                    window.harness.state_mut().open(input);
                }
            }
        }
        9 => {
            let context = window.harness.ctx.clone();
            crate::keys::run(window.harness.state_mut(), &context, Command::CloseAll);
            if chance.below(2) == 0 {
                window.press(Key::Escape);
            }
        }
        10 => {
            let keys =
                [Key::W, Key::A, Key::S, Key::D, Key::ArrowLeft, Key::Tab, Key::Enter, Key::Escape, Key::Backspace];
            let key = keys[chance.below(keys.len())];
            // Enter in a dialog that writes would write.
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

/// Does anything for so long; memory may grow by so many megabytes.
///
/// How much is open changes all the time, and with it memory. But everything is closed every now and then, so that the least
/// memory of some minutes is what the program itself keeps. The first third fills what is kept on purpose, undo above all; what
/// is more in the last third than in the middle one is lost.
fn soak(seconds: f64, seed: u64, allowed_mb: f64) {
    let mut window = Window::with_statue();
    let mut chance = Chance(seed);
    let start = Instant::now();
    let (mut events, mut samples, mut next) = (0_u64, Vec::new(), 0.0);
    while start.elapsed().as_secs_f64() < seconds {
        anything(&mut window, &mut chance);
        events += 1;
        let now = start.elapsed().as_secs_f64();
        if now >= next {
            next = now + (0.002 * seconds).min(0.25);
            samples.extend(resident_mb());
        }
    }
    let least = least(&samples, 10);
    let peak = samples.iter().copied().fold(0.0, f64::max);
    let what = format!("{events} rounds in {seconds:.0} s, seed {seed}");
    let seen = format!("{what}: {least:.1?} MB at least in each tenth, {peak:.0} at most");
    println!("{seen}");
    assert!(grown(&samples) < allowed_mb, "memory grows: {seen}");
    assert!(events as f64 > 0.5 * seconds, "the window still answers: {seen}");
    window.until("it can still be used", |window| !window.app().navigation.is_moving());
}

/// The least of each of some equal parts.
fn least(samples: &[f64], parts: usize) -> Vec<f64> {
    let len = samples.len() / parts;
    let least = |part: usize| samples[part * len..][..len].iter().copied().fold(f64::INFINITY, f64::min);
    (0..parts).map(least).collect()
}

/// Megabytes that the last third has more than the middle one, each at its least.
fn grown(samples: &[f64]) -> f64 {
    let least = least(samples, 3);
    if least[1].is_finite() { least[2] - least[1] } else { 0.0 }
}

#[test]
fn growth_is_told_from_chance() {
    let mut chance = Chance(7);
    // Between 300 and 400 MB, as things come and go.
    let steady: Vec<f64> = (0..900).map(|_| 300.0 + f64::from(100.0 * chance.share())).collect();
    assert!(grown(&steady).abs() < 2.0, "as things go: {}", grown(&steady));
    let leaking: Vec<f64> = steady.iter().zip(0..).map(|(own, second)| own + 0.1 * f64::from(second)).collect();
    assert!(grown(&leaking) > 10.0, "0.1 MB a sample are seen: {}", grown(&leaking));
    let filling: Vec<f64> = steady.iter().zip(0..).map(|(own, second)| own.min(f64::from(second) * 2.0)).collect();
    assert!(grown(&filling).abs() < 2.0, "what fills at first is kept on purpose: {}", grown(&filling));
    assert_eq!(grown(&[]), 0.0, "where memory cannot be asked for");
}

/// Other tests of this program run at the same time and have memory, too; this is for panics, and for what grows fast.
#[test]
fn twenty_seconds_of_anything() {
    soak(20.0, 0x5EED_0001, 300.0);
}

/// The long form, to be run alone: `AUTOSPLATS_SOAK_SECONDS` tells how long.
#[test]
#[ignore = "takes ten minutes"]
fn ten_minutes_of_anything() {
    let seconds = std::env::var("AUTOSPLATS_SOAK_SECONDS").ok().and_then(|text| text.parse().ok()).unwrap_or(600.0);
    soak(seconds, 0x5EED_0002, 8.0);
}
