//! Tests of what is visible of a stream at one moment.

use std::{
    collections::VecDeque,
    io::Read,
    path::Path,
    sync::Arc,
    thread::sleep,
    time::{Duration, Instant},
};

use autosplats_cloud::{Error, PointCloud, Progress, glam::DVec3};
use autosplats_formats::ReadOptions;
use autosplats_sources::{
    LatestOptions, Live, LiveOptions, Next, PlayOptions, Player, Source, Statistics, Stream, Timeline, Update,
};

/// A folder of frames with three points each. The x of the first point is the number of the frame.
fn folder(frames: usize) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    for frame in 0..frames {
        let rows = format!("{frame} 0 1\n{frame} 1 1\n{frame} 2 1\n");
        std::fs::write(folder.path().join(format!("f_{frame}.xyz")), rows).expect("a frame");
    }
    folder
}

fn player(folder: &Path, latest: LatestOptions) -> Player {
    let play = PlayOptions { latest, ..PlayOptions::default() };
    let source = Source::parse(&folder.display().to_string()).expect("a folder");
    source.play(&play, &ReadOptions::default(), &()).expect("it can be played")
}

/// The frames that the points belong to, sorted.
fn frames(cloud: &PointCloud) -> Vec<i64> {
    let mut frames: Vec<i64> = (0..cloud.len()).map(|point| cloud.world_position(point).x as i64).collect();
    frames.sort_unstable();
    frames.dedup();
    frames
}

#[test]
fn a_frame_is_the_same_however_it_is_come_to() {
    let [whole, broken] = [(); 2].map(|()| folder(9));
    std::fs::write(broken.path().join("f_4.xyz"), "no cloud at all\n").expect("a frame");
    let decay = LatestOptions { decay: Some(Duration::from_millis(250)), ..LatestOptions::default() };
    let accumulate = LatestOptions { accumulate: true, ..LatestOptions::default() };
    for (folder, options) in [
        (&whole, LatestOptions::default()),
        (&whole, decay),
        (&whole, accumulate.clone()),
        (&broken, LatestOptions::default()),
        (&broken, accumulate),
    ] {
        let mut through = player(folder.path(), options.clone());
        let played: Vec<_> = (0..9).map(|frame| frames(&through.frame(frame, &()).expect("a frame"))).collect();
        for frame in [8, 3, 4, 5, 0, 7, 7, 2, 4] {
            let again = frames(&through.frame(frame, &()).expect("a frame"));
            assert_eq!(again, played[frame], "frame {frame} sought, {options:?}");
            let alone = player(folder.path(), options.clone()).frame(frame, &()).expect("a frame");
            assert_eq!(frames(&alone), played[frame], "frame {frame} alone, {options:?}");
        }
    }
}

/// Frames of two channels in turn, some of them unreadable. The point of a frame is at the frame's number.
struct Turns {
    timeline: Timeline,
    broken: Vec<usize>,
    position: usize,
}

impl Stream for Turns {
    fn timeline(&self) -> Option<&Timeline> {
        Some(&self.timeline)
    }

    fn seen_at(&self, frame: usize) -> Vec<usize> {
        (frame.saturating_sub(1)..=frame).collect()
    }

    fn seek(&mut self, frame: usize) {
        self.position = frame;
    }

    fn next(&mut self, _: Duration, _: &dyn Progress) -> Result<Next, Error> {
        let frame = self.position;
        self.position += 1;
        if self.broken.contains(&frame) {
            return Err(Error::NoFrames { name: frame.to_string(), why: "it is broken".into() });
        }
        let cloud = Arc::new(PointCloud::new(DVec3::ZERO, vec![[frame as f32, 0.0, 0.0]]));
        Ok(Next::Update(Update { channel: frame % 2, stamp: self.timeline.stamps()[frame], cloud }))
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }
}

#[test]
fn what_is_broken_of_one_channel_takes_nothing_from_the_other() {
    let player = || {
        let timeline = Timeline::new((0..12).collect());
        Player::new(Box::new(Turns { timeline, broken: vec![4, 6, 7], position: 0 }), LatestOptions::default())
    };
    let mut through = player();
    let played: Vec<_> = (0..12).map(|frame| frames(&through.frame(frame, &()).expect("a frame"))).collect();
    assert_eq!(played[6..9], [[2, 5], [2, 5], [5, 8]], "the newest of each that can be read");
    for frame in [7, 6, 1, 7, 8, 2, 8] {
        let again = frames(&through.frame(frame, &()).expect("a frame"));
        assert_eq!(again, played[frame], "frame {frame} sought");
        let alone = frames(&player().frame(frame, &()).expect("a frame"));
        assert_eq!(alone, played[frame], "frame {frame} alone");
    }
}

#[test]
fn what_is_kept_is_seen() {
    let folder = folder(9);
    let seen = |options, frame| frames(&player(folder.path(), options).frame(frame, &()).expect("a frame"));
    assert_eq!(seen(LatestOptions::default(), 5), [5], "the frame alone");
    let decay = LatestOptions { decay: Some(Duration::from_millis(250)), ..LatestOptions::default() };
    assert_eq!(seen(decay, 5), [3, 4, 5], "a quarter of a second at ten a second");
    let accumulate = LatestOptions { accumulate: true, ..LatestOptions::default() };
    assert_eq!(seen(accumulate, 5), [0, 1, 2, 3, 4, 5], "all");
}

/// Updates with these stamps in milliseconds, one after the other.
struct Stamps(VecDeque<i64>);

impl Stream for Stamps {
    fn timeline(&self) -> Option<&Timeline> {
        None
    }

    fn seek(&mut self, _: usize) {}

    fn next(&mut self, _: Duration, _: &dyn Progress) -> Result<Next, Error> {
        let Some(milliseconds) = self.0.pop_front() else { return Ok(Next::End) };
        let cloud = PointCloud::new(DVec3::ZERO, vec![[milliseconds as f32, 0.0, 0.0]]);
        Ok(Next::Update(Update { channel: 0, stamp: milliseconds * 1_000_000, cloud: Arc::new(cloud) }))
    }

    fn statistics(&self) -> Statistics {
        Statistics::default()
    }
}

#[test]
fn what_became_of_updates_is_told() {
    let stamps = Stamps([100, 200, 200, 150, 300, 0, 10, 20, 30, 40].into());
    let mut player = Player::new(Box::new(stamps), LatestOptions::default());
    let mut seen = Vec::new();
    while let Ok(Some(cloud)) = player.next(Duration::ZERO, &()) {
        seen.push(cloud.world_position(0).x as i64);
    }
    assert_eq!(seen, [100, 200, 200, 200, 300, 300, 300, 300, 30, 40], "a clock that is set back is followed");
    let told = player.latest_statistics();
    assert_eq!((told.shown, told.late, told.duplicates, told.restarted), (5, 4, 1, 1), "{told:?}");
}

/// Gives one byte at a time, with a delay.
struct Slow(VecDeque<u8>, Duration);

impl Read for Slow {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        sleep(self.1);
        let Some(byte) = self.0.pop_front() else { return Ok(0) };
        buffer[0] = byte;
        Ok(1)
    }
}

#[test]
fn as_long_as_bytes_of_the_first_frame_come_it_is_waited_for() {
    let slow = |text: &str, pause| {
        let input = Slow(text.bytes().collect(), pause);
        let live = Live::bytes(input, "standard input", &LiveOptions::default()).expect("a thread");
        Player::new(Box::new(live), LatestOptions::default())
    };
    let frame = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                 end_header\n1 2 3\n";
    let (patience, begun) = (Duration::from_millis(400), Instant::now());
    let cloud = slow(frame, Duration::from_millis(10)).first(patience, &()).expect("the frame, in the end");
    assert_eq!(cloud.world_position(0), DVec3::new(1.0, 2.0, 3.0), "all of it");
    assert!(begun.elapsed() > patience, "which took longer than nothing is waited for");
    let told =
        |text: &str| slow(text, Duration::from_millis(10)).first(patience, &()).map_err(|error| error.to_string());
    let garbage = "no frame ".repeat(1000);
    assert!(
        told(&garbage).is_err_and(|why| why.contains("no points within")),
        "bytes of no frame are nothing to wait for"
    );
    let silence = slow(frame, Duration::from_secs(2)).first(patience, &());
    assert!(silence.is_err_and(|why| why.to_string().contains("no points within")), "nor is silence");
}
