//! Recordings that are cut off, damaged or false in their claims.

use super::*;

#[test]
fn what_is_cut_off_plays_up_to_the_cut() {
    for (name, bytes) in all_styles() {
        let mut last = 0;
        for cut in 0..200 {
            let len = bytes.len() * cut / 200;
            let Ok((mut recording, notes)) = open(&name, &bytes[..len], &RecordingOptions::default()) else {
                assert_eq!(last, 0, "{name} cut after {len} bytes: it played {last} frames before");
                continue;
            };
            let statistics = recording.statistics();
            let closed = notes.is_empty();
            assert!(!closed || cut > 195, "{name} cut after {len} bytes: nothing is told");
            assert_eq!(statistics.refused as usize, notes.len(), "{name}: told and counted");
            let (updates, refusals) = play(&mut recording);
            assert!(refusals.is_empty(), "{name} cut after {len} bytes: {refusals:?}");
            for (frame, update) in updates.iter().enumerate() {
                assert_eq!(update.cloud.positions(), points(frame), "{name} cut after {len} bytes, frame {frame}");
            }
            assert!(updates.len() >= last, "{name}: fewer frames of more bytes");
            last = updates.len();
        }
        assert!(last >= 9, "{name}: only {last} frames before the end");
    }
}

#[test]
fn damage_is_refused_and_the_rest_plays() {
    let (topics, messages) = ten(Encoding::Cdr);
    for compression in ["none", "lz4", "zstd"] {
        let good = mcap(&topics, &messages, Style { per_chunk: 4, ..Style::of(compression) });
        let mut bytes = good.clone();
        // In the middle of the second of five chunks.
        let at = bytes.len() * 3 / 10;
        bytes[at] ^= 0x55;
        let (mut recording, _) = open("a.mcap", &bytes, &RecordingOptions::default()).unwrap();
        let (updates, refusals) = play(&mut recording);
        assert_eq!((updates.len(), refusals.len()), (8, 2), "{compression}: {refusals:?}");
        assert!(refusals[0].starts_with("a.mcap: byte "), "{}", refusals[0]);
        let statistics = recording.statistics();
        assert_eq!((statistics.taken, statistics.refused), (8, 2), "{compression}");
        assert_eq!(statistics.last_refusal.as_ref(), refusals.last(), "{compression}");
        let mut frames: Vec<usize> = (0..10).collect();
        frames.drain(2..4);
        for (update, frame) in updates.iter().zip(frames) {
            assert_eq!(update.cloud.positions(), points(frame), "{compression}: the right frames");
        }
    }
}

#[test]
fn recordings_changed_anywhere_do_no_harm() {
    let mut random = Random::from_state(11);
    for (name, bytes) in all_styles() {
        for _ in 0..60 {
            let mut bytes = bytes.clone();
            for _ in 0..1 + random.modulo(4) {
                let at = random.modulo(bytes.len());
                let len = (1 << random.modulo(4)).min(bytes.len() - at);
                let value = if random.modulo(2) == 0 { 255 } else { random.bits() as u8 };
                bytes[at..at + len].fill(value);
            }
            if let Ok((mut recording, _)) = open("a", &bytes, &RecordingOptions::default()) {
                assert!(recording.timeline().unwrap().len() <= bytes.len(), "{name}");
                play(&mut recording);
            }
        }
    }
}

#[test]
fn claims_of_gigabytes_are_not_believed() {
    let (topics, messages) = ten(Encoding::Cdr);
    let whole = mcap(&topics, &messages, Style::of("zstd"));
    // Kind and length of the first chunk, after the header; then times, and the claimed size after decompression.
    let chunk = (8..whole.len()).find(|&at| whole[at] == 6 && whole[at + 3..at + 9] == [0; 6]).unwrap();
    for (at, value) in [(1, u32::MAX.into()), (1, u64::MAX), (25, 1 << 32), (25, u64::MAX), (25, 1 << 20)] {
        let mut bytes = whole.clone();
        bytes[chunk + at..chunk + at + 8].copy_from_slice(&value.to_le_bytes());
        if let Ok((mut recording, notes)) = open("a.mcap", &bytes, &RecordingOptions::default()) {
            let (updates, refusals) = play(&mut recording);
            assert!(updates.len() < 10 && refusals.len() + notes.len() > 0, "{value} at {at}");
        }
    }
}

#[test]
fn what_is_lost_is_an_error_if_only_whole_recordings_are_taken() {
    let (topics, messages) = ten(Encoding::Cdr);
    let whole = mcap(&topics, &messages, Style::of("zstd"));
    let read = ReadOptions { whole: true, ..ReadOptions::default() };
    let options = RecordingOptions { read, ..RecordingOptions::default() };
    assert!(open("a.mcap", &whole, &options).is_ok(), "nothing is lost");
    let told = open("a.mcap", &whole[..whole.len() / 2], &options).map(drop).unwrap_err().to_string();
    assert!(told.starts_with("a.mcap: byte ") && told.ends_with("--salvage takes what is left"), "{told}");
}

#[cfg(unix)]
#[test]
fn a_recording_that_is_cut_while_it_is_played() {
    let (topics, messages) = ten(Encoding::Cdr);
    let bytes = mcap(&topics, &messages, Style::of("none"));
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    std::fs::write(&path, &bytes).unwrap();
    let mut recording = Recording::open(&path, &RecordingOptions::default(), &()).unwrap();
    std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(0).unwrap();
    let (updates, refusals) = play(&mut recording);
    assert_eq!((updates.len(), refusals.len()), (0, 10), "nothing is there any more");
    assert!(refusals.iter().all(|told| told.contains("the file changed while it was read")), "{refusals:?}");
}
