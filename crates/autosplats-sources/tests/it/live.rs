//! Tests of live points: through a pipe, and in files that others write.

use std::{
    io::Read,
    path::Path,
    sync::mpsc::{Receiver, Sender, channel},
    time::{Duration, Instant},
};

use crate::common::{pcd_bytes, positions, read_bytes};
use autosplats_cloud::{Error, PointCloud, Progress, glam::DVec3};
use autosplats_formats::{ReadOptions, write};
use autosplats_sources::{Live, LiveOptions, Next, Stream as _, Update};

/// Longer than any expected event takes.
const PATIENCE: Duration = Duration::from_secs(60);

/// A pipe in which each sent piece is returned by one read.
struct Pipe(Receiver<Vec<u8>>, Vec<u8>);

impl Read for Pipe {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        if self.1.is_empty() {
            self.1 = self.0.recv().unwrap_or_default();
        }
        let len = self.1.len().min(buffer.len());
        buffer[..len].copy_from_slice(&self.1[..len]);
        self.1.drain(..len);
        Ok(len)
    }
}

fn pipe(options: &LiveOptions) -> (Sender<Vec<u8>>, Live) {
    let (sender, receiver) = channel();
    (sender, Live::bytes(Pipe(receiver, Vec::new()), "standard input", options).unwrap())
}

fn update(live: &mut Live) -> Update {
    match live.next(PATIENCE, &()).unwrap() {
        Next::Update(update) => update,
        other => panic!("no update: {other:?}"),
    }
}

#[test]
fn frames_of_a_pipe_are_those_of_files_whatever_pieces_they_come_in() {
    let (sender, mut live) = pipe(&LiveOptions::default());
    assert!(live.timeline().is_none(), "nobody knows what will come");
    let mut last = 0;
    for (number, encoding) in ["ascii", "binary", "binary_compressed"].into_iter().enumerate() {
        let bytes = pcd_bytes(encoding, 40 + number);
        bytes.iter().for_each(|&byte| sender.send(vec![byte]).unwrap());
        let Update { channel, stamp, cloud } = update(&mut live);
        assert_eq!((channel, &*cloud), (0, &read_bytes("a.pcd", &bytes).unwrap()), "{encoding}");
        assert!(stamp >= last, "stamps are times of arrival");
        last = stamp;
    }
    assert_eq!(live.next(Duration::ZERO, &()).unwrap(), Next::Nothing, "as yet");
    drop(sender);
    assert_eq!(live.next(PATIENCE, &()).unwrap(), Next::End, "the input has ended");
    assert_eq!(live.statistics().taken, 3, "taken");
}

#[test]
fn what_is_not_taken_in_time_is_dropped_and_counted() {
    let (sender, mut live) = pipe(&LiveOptions::default());
    for count in 1..=100 {
        sender.send(pcd_bytes("binary", count)).unwrap();
    }
    drop(sender);
    let started = Instant::now();
    while live.statistics().dropped < 99 && started.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert_eq!(update(&mut live).cloud.len(), 100, "the newest");
    assert_eq!(live.next(PATIENCE, &()).unwrap(), Next::End, "nothing else was kept");
    let statistics = live.statistics();
    assert_eq!((statistics.taken, statistics.dropped, statistics.refused), (1, 99, 0), "counted");
}

#[test]
fn where_all_are_taken_the_writer_waits() {
    let (sender, mut live) = pipe(&LiveOptions { all: true, ..LiveOptions::default() });
    for count in 1..=100 {
        let refused: &[u8] = if count % 10 == 0 { b"nonsense\n" } else { b"" };
        sender.send([&pcd_bytes("binary", count), refused].concat()).unwrap();
    }
    std::thread::sleep(Duration::from_millis(100));
    let (mut lens, mut refusals) = (Vec::new(), 0);
    loop {
        match live.next(PATIENCE, &()) {
            Ok(Next::Update(update)) => lens.push(update.cloud.len()),
            Ok(_) => break,
            Err(_) => refusals += 1,
        }
        if lens.len() == 99 {
            // Only the waiting one is left.
            break;
        }
    }
    assert!(lens.iter().copied().eq(1..=99), "all, in order: {lens:?}");
    assert_eq!((refusals, live.statistics().dropped), (9, 0), "and all that is refused");
    drop(live);
    let started = Instant::now();
    while sender.send(pcd_bytes("binary", 1)).is_ok() && started.elapsed() < PATIENCE {
        std::thread::sleep(Duration::from_millis(1));
    }
    assert!(started.elapsed() < PATIENCE, "the thread ends where nobody takes what it holds");
}

#[test]
fn what_is_refused_is_said_and_the_next_frame_read() {
    let options = LiveOptions { max_frame_bytes: 100_000, ..LiveOptions::default() };
    let (sender, mut live) = pipe(&options);
    let good = pcd_bytes("binary", 10);
    let refused = |live: &mut Live, says: &str| {
        let message = live.next(PATIENCE, &()).unwrap_err().to_string();
        assert!(message.starts_with("standard input: byte ") && message.contains(says), "{says}: {message}");
        assert!(!message.contains(char::is_control), "{message:?}");
    };
    sender.send([b"\x1b[31m nonsense \0".to_vec(), good.clone()].concat()).unwrap();
    refused(&mut live, "is neither PLY nor PCD");
    assert_eq!(update(&mut live).cloud.len(), 10, "after garbage");
    let claims = String::from_utf8_lossy(&good).replace("POINTS 10", "POINTS 238609295").into_bytes();
    sender.send([&claims[..200], &good].concat()).unwrap();
    refused(&mut live, "4294967");
    assert_eq!(update(&mut live).cloud.len(), 10, "after a header of four gigabytes");
    let words = String::from_utf8_lossy(&pcd_bytes("ascii", 10)).replacen("\n", " nonsense\n", 12).into_bytes();
    sender.send([words, good.clone()].concat()).unwrap();
    refused(&mut live, "");
    assert_eq!(update(&mut live).cloud.len(), 10, "after a frame whose numbers are none");
    assert_eq!(live.statistics().refused, 3, "each once: {:?}", live.statistics().last_refusal);
    for what in ["filled up with zeros", "after zeros"] {
        sender.send([&good[..], &[0; 512]].concat()).unwrap();
        assert_eq!(update(&mut live).cloud.len(), 10, "{what}");
    }
    assert_eq!(live.statistics().refused, 3, "zeros are nothing to refuse: {:?}", live.statistics().last_refusal);
    sender.send(good[..good.len() - 5].to_vec()).unwrap();
    drop(sender);
    refused(&mut live, "cut off");
    assert_eq!(live.next(PATIENCE, &()).unwrap(), Next::End, "and that was all");
}

#[test]
fn waiting_ends_when_it_is_told_to() {
    struct Stop;
    impl Progress for Stop {
        fn report(&self, _: f32) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    let (_sender, mut live) = pipe(&LiveOptions::default());
    assert!(matches!(live.next(PATIENCE, &Stop), Err(Error::Cancelled)), "cancelled");
    let start = Instant::now();
    assert_eq!(live.next(Duration::from_millis(30), &()).unwrap(), Next::Nothing, "nothing came");
    assert!(start.elapsed() >= Duration::from_millis(30), "in that time");
}

#[test]
fn a_thread_that_panics_does_not_end_without_a_word() {
    struct Mistake(Vec<u8>);
    impl Read for Mistake {
        fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
            assert!(!self.0.is_empty(), "an oversight\nof ours");
            let len = self.0.len();
            buffer[..len].copy_from_slice(&self.0);
            self.0.clear();
            Ok(len)
        }
    }
    let mut live = Live::bytes(Mistake(pcd_bytes("binary", 10)), "standard input", &LiveOptions::default()).unwrap();
    let mut told = Vec::new();
    loop {
        match live.next(PATIENCE, &()) {
            Ok(Next::Update(update)) => assert_eq!(update.cloud.len(), 10, "what came before is there"),
            Ok(Next::Nothing) => panic!("it must end: {:?}", live.statistics()),
            Ok(Next::End) => break,
            Err(error) => told.push(error.to_string()),
        }
    }
    let [told] = &told[..] else { panic!("it is told once: {told:?}") };
    assert!(told.starts_with("standard input: ") && told.contains("an oversight"), "{told}");
    assert!(!told.contains(char::is_control), "in a line: {told:?}");
    assert_eq!((live.statistics().taken, live.statistics().refused), (1, 1), "and counted");
}

#[test]
fn an_empty_input_ends_at_once() {
    let mut live = Live::bytes(std::io::empty(), "-", &LiveOptions::default()).unwrap();
    assert_eq!(live.next(PATIENCE, &()).unwrap(), Next::End, "no bytes at all");
}

fn put(count: usize, path: &Path) {
    write(&PointCloud::new(DVec3::ZERO, positions(count)), path, &()).unwrap();
}

#[test]
fn a_watched_file_is_read_each_time_it_was_written_and_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scan.ply");
    let mut live = Live::watch(&path, &ReadOptions::default()).unwrap();
    assert_eq!(live.next(Duration::from_millis(250), &()).unwrap(), Next::Nothing, "it is not there yet");
    put(10, &path);
    assert_eq!(update(&mut live).cloud.len(), 10, "there it is");
    put(20, &path);
    assert_eq!(update(&mut live).cloud.len(), 20, "another in its place");
    // Written slowly in place: nothing is read before the end.
    let other = folder.path().join("other.ply");
    put(3000, &other);
    let bytes = std::fs::read(&other).unwrap();
    let mut file = std::fs::File::create(&path).unwrap();
    for piece in bytes.chunks(bytes.len() / 12) {
        std::io::Write::write_all(&mut file, piece).unwrap();
        std::thread::sleep(Duration::from_millis(30));
    }
    let written = update(&mut live);
    assert_eq!(written.cloud.len(), 3000, "whole");
    assert_eq!(live.next(Duration::from_millis(250), &()).unwrap(), Next::Nothing, "it has not changed");
    std::fs::write(&path, "ply\nnonsense\n").unwrap();
    assert!(live.next(PATIENCE, &()).is_err(), "what cannot be read is said");
    put(40, &path);
    assert_eq!(update(&mut live).cloud.len(), 40, "and it goes on");
    std::fs::remove_file(&path).unwrap();
    assert_eq!(live.next(Duration::from_millis(250), &()).unwrap(), Next::Nothing, "what is gone changes nothing");
    assert_eq!((live.statistics().taken, live.statistics().refused), (4, 1), "counted");
}

#[test]
fn of_a_watched_folder_the_newest_file_is_shown() {
    let folder = tempfile::tempdir().unwrap();
    put(5, &folder.path().join("frame_1.ply"));
    let mut live = Live::watch(folder.path(), &ReadOptions::default()).unwrap();
    assert_eq!(update(&mut live).cloud.len(), 5, "the one that is there");
    std::fs::write(folder.path().join("notes.md"), "no cloud").unwrap();
    std::fs::write(folder.path().join(".frame_9.ply"), "hidden").unwrap();
    assert_eq!(live.next(Duration::from_millis(250), &()).unwrap(), Next::Nothing, "nothing to show");
    // Written elsewhere and then moved into place.
    let elsewhere = tempfile::tempdir_in(folder.path()).unwrap();
    for count in 6..=9 {
        put(count, &elsewhere.path().join(format!("{count}.ply")));
    }
    for count in 6..=9 {
        let name = format!("frame_{}.ply", count + 3);
        std::fs::rename(elsewhere.path().join(format!("{count}.ply")), folder.path().join(name)).unwrap();
    }
    assert_eq!(update(&mut live).cloud.len(), 9, "the newest, 12, which comes behind 9 in the order of numbers");
    std::fs::remove_file(folder.path().join("frame_12.ply")).unwrap();
    assert_eq!(live.next(Duration::from_millis(250), &()).unwrap(), Next::Nothing, "what is gone changes nothing");
    let statistics = live.statistics();
    assert!(statistics.taken + statistics.dropped <= 5, "those between are counted if they were seen: {statistics:?}");
}

#[test]
fn a_folder_that_fills_faster_than_it_is_looked_at_is_shown_nevertheless() {
    let [folder, elsewhere] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let pattern = folder.path().join("scan_*.ply");
    let lives = [folder.path(), &pattern].map(|path| Live::watch(path, &ReadOptions::default()).unwrap());
    let begun = Instant::now();
    let seconds = Duration::from_secs(3);
    // Thirty per second, each moved into place, beside files with other names.
    let mut written = 0;
    while begun.elapsed() < seconds {
        written += 1;
        for (name, count) in [(format!("other_{written}.xyz"), 5000), (format!("scan_{written}.ply"), written)] {
            let made = elsewhere.path().join(&name);
            put(count, &made);
            std::fs::rename(made, folder.path().join(name)).unwrap();
        }
        std::thread::sleep((Duration::from_millis(33) * written as u32).saturating_sub(begun.elapsed()));
    }
    assert!(written > 30, "only {written} were written");
    for (which, mut live) in ["folder", "pattern"].into_iter().zip(lives) {
        let told = live.statistics();
        assert!(told.dropped > 10, "{which}: those before the newest were read or seen all the while: {told:?}");
        loop {
            let count = update(&mut live).cloud.len();
            assert!(which == "folder" || count <= written, "only what the pattern stands for");
            if count == written {
                break;
            }
        }
    }
}
