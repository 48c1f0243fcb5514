//! What is seen of a stream at one moment.

use std::{path::Path, time::Duration};

use autosplats_cloud::{LatestOptions, PlayOptions, Player, PointCloud, ReadOptions, Source};

/// A folder of frames of three points each, the first of which lies as far to the right as the frame's number.
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

/// The frames that points are of, in order.
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
        for frame in [8, 3, 4, 5, 0, 7, 7, 2] {
            let again = frames(&through.frame(frame, &()).expect("a frame"));
            assert_eq!(again, played[frame], "frame {frame} sought, {options:?}");
            let alone = player(folder.path(), options.clone()).frame(frame, &()).expect("a frame");
            assert_eq!(frames(&alone), played[frame], "frame {frame} alone, {options:?}");
        }
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
