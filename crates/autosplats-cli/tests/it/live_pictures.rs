//! Measures ten minutes of live points from the sent message to the picture. Another program sends 100,000 points (2.4
//! MB) twenty times per second over Zenoh on this machine. The measurement needs that program and an otherwise idle
//! machine. AUTOSPLATS_LIVE_SECONDS sets the duration; the default is 600: `AUTOSPLATS_PYTHON=... cargo test --release
//! -p autosplats-cli --features zenoh --test it live_pictures:: -- --ignored --nocapture`.

use std::{
    io::{BufRead as _, BufReader},
    net::TcpListener,
    path::Path,
    process::{Command, Stdio},
    thread,
    time::{Duration, Instant, UNIX_EPOCH},
};

use autosplats::{Camera, Projection, Renderer, Settings, ViewDirection, cloud::glam::DMat4, guess_axes};
use autosplats_sources::{
    Latest, LatestOptions, Next, Stream as _,
    remote::{Remote, RemoteOptions},
};

const POINTS: usize = 100_000;
/// Size of the first `PICTURES_PER_STEP` pictures. The size may then shrink in up to `STEPS` steps, each after as many
/// pictures.
const SIZE: [u32; 2] = [960, 540];
const PICTURES_PER_STEP: usize = 100;
const STEPS: usize = 3;
/// Milliseconds between messages.
const PERIOD_MS: f64 = 50.0;
/// Fraction of the period that a picture may take, as in the window.
const MAX_PERIOD_FRACTION: f64 = 0.6;
/// Largest growth of memory from the first minute to the end, in megabytes.
const MAX_GROWTH_MB: f64 = 20.0;

fn now() -> i64 {
    UNIX_EPOCH.elapsed().unwrap().as_nanos() as i64
}

/// Resident memory of this process in megabytes.
fn resident() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse::<f64>().unwrap() / 1024.0
}

/// Median, 95th and 99th percentile, and maximum.
fn percentiles(values: &[f64]) -> [f64; 4] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    [0.5, 0.95, 0.99, 1.0].map(|share| sorted[((sorted.len() - 1) as f64 * share) as usize])
}

fn shown([median, most, nearly, all]: [f64; 4]) -> String {
    format!("median {median:.1}, 95 % {most:.1}, 99 % {nearly:.1}, most {all:.1} ms")
}

#[test]
#[ignore = "takes ten minutes and a Python that AUTOSPLATS_PYTHON names; prints figures"]
fn ten_minutes_of_live_points_become_pictures() {
    let seconds: u64 = std::env::var("AUTOSPLATS_LIVE_SECONDS").map_or(600, |text| text.parse().unwrap());
    let python = std::env::var_os("AUTOSPLATS_PYTHON").expect("AUTOSPLATS_PYTHON names a Python with what is needed");
    let port = TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).unwrap().port();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../autosplats-sources/tests/interop/publish_points.py");
    let arguments = [port.to_string(), POINTS.to_string(), seconds.to_string()];
    let mut sender =
        Command::new(python).arg(script).args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(sender.stdout.take().unwrap()).lines();
    assert_eq!(said.next().unwrap().unwrap(), "publishing", "the script failed; what it says is above");
    let sent = thread::spawn(move || said.next().unwrap().unwrap().parse::<u64>().unwrap());

    let mut live = Remote::open(&format!("zenoh://127.0.0.1:{port}/points"), &RemoteOptions::default()).unwrap();
    let mut latest = Latest::new(LatestOptions::default());
    latest.add(DMat4::IDENTITY);
    let mut renderer = Renderer::new();
    let (mut camera, mut size, settings) = (None, SIZE, Settings::default());
    let (mut pictures, mut steps) = (0, 0);
    let (mut since_sent, mut since_taken, mut memory) = (Vec::new(), Vec::new(), Vec::new());
    let begun = Instant::now();
    loop {
        let Next::Update(update) = live.next(Duration::from_millis(200), &()).unwrap() else {
            if sent.is_finished() {
                break;
            }
            assert!(begun.elapsed().as_secs() < seconds + 60, "it does not end: {:?}", live.statistics());
            continue;
        };
        let (taken, stamp) = (Instant::now(), update.stamp);
        latest.put(0, update);
        let cloud = latest.cloud();
        assert_eq!(cloud.len(), POINTS, "whole");
        if since_taken.len() == PICTURES_PER_STEP && steps < STEPS {
            // The first second is left out, since the program has just started.
            let [median, ..] = percentiles(&since_taken[PICTURES_PER_STEP / 5..]);
            println!(
                "{} x {}: {}; from taking {median:.1}",
                size[0],
                size[1],
                shown(percentiles(&since_sent[PICTURES_PER_STEP / 5..]))
            );
            let scale = (MAX_PERIOD_FRACTION * PERIOD_MS / median).sqrt().min(1.0);
            size = size.map(|side| (f64::from(side) * scale) as u32);
            (since_sent, since_taken) = (Vec::new(), Vec::new());
            steps += 1;
        }
        let fitted = || {
            let (aspect, projection) = (f64::from(SIZE[0]) / f64::from(SIZE[1]), Projection::PerspectiveFovDeg(40.0));
            Camera::fit(&cloud, guess_axes(&cloud), ViewDirection::Iso, aspect, projection).unwrap()
        };
        let camera = camera.get_or_insert_with(fitted);
        let frame = renderer.render(&cloud, camera, size, &settings).unwrap();
        pictures += 1;
        since_sent.push((now() - stamp) as f64 / 1e6);
        since_taken.push(taken.elapsed().as_secs_f64() * 1e3);
        let background = frame.image.pixels[0];
        let drawn = frame.image.pixels.iter().filter(|&&pixel| pixel != background).count();
        assert!(drawn > frame.image.pixels.len() / 10, "{drawn} pixels are of something");
        if begun.elapsed().as_secs() / 60 > memory.len() as u64 {
            memory.push(resident());
            let minute = percentiles(&since_sent[since_sent.len().saturating_sub(600)..]);
            println!("minute {}: {:.0} MB, {:?}, {}", memory.len(), resident(), live.statistics(), shown(minute));
        }
    }
    let (sent, told, kept) = (sent.join().unwrap(), live.statistics(), latest.statistics());
    assert!(sender.wait().unwrap().success(), "the script ends in order");
    memory.push(resident());
    println!(
        "{sent} sent in {seconds} s, {} taken, {} dropped, {pictures} pictures; of {} x {} from sending to the picture: {}; from taking: {}; MB by minute: {memory:.0?}",
        told.taken,
        told.dropped,
        size[0],
        size[1],
        shown(percentiles(&since_sent)),
        shown(percentiles(&since_taken)),
    );
    assert_eq!(told.taken + told.dropped, sent, "none is lost unless it is counted: {told:?}");
    assert_eq!((kept.shown, kept.late + kept.duplicates), (told.taken, 0), "each that was taken is shown: {kept:?}");
    let grown = memory[memory.len() - 1] - memory[0];
    assert!(grown < MAX_GROWTH_MB, "memory grew by {grown:.0} MB");
    assert!(size[0] >= SIZE[0] / 3, "{size:?} is hardly a picture");
    let [median, ..] = percentiles(&since_sent);
    assert!(
        median < PERIOD_MS,
        "{median:.1} ms from sending to the picture, where the next message comes after {PERIOD_MS}"
    );
}
