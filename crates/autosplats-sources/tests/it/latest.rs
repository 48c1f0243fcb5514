//! Tests of the points shown of streams: the newest, the recent, or all.

use std::{sync::Arc, time::Duration};

use autosplats_cloud::{
    PointCloud, Scan,
    glam::{DMat4, DVec3},
};
use autosplats_sources::{Arrival, Latest, LatestOptions, Update};

const MS: i64 = 1_000_000;

/// An update of `count` points at a time in milliseconds from one sensor.
fn update(channel: usize, milliseconds: i64, count: usize) -> Update {
    let scan = Scan { name: Some(format!("{channel}")), world_from_sensor: DMat4::IDENTITY, points: 0..count };
    let cloud = PointCloud::new(DVec3::ZERO, vec![[1.0, 2.0, 3.0]; count]).with_scans(vec![scan]);
    Update { channel, stamp: milliseconds * MS, cloud: Arc::new(cloud) }
}

fn one(options: LatestOptions) -> Latest {
    let mut latest = Latest::new(options);
    assert_eq!(latest.add(DMat4::IDENTITY), 0, "the first stream");
    latest
}

#[test]
fn a_single_cloud_is_handed_through_and_changes_only_with_the_points() {
    let mut latest = one(LatestOptions::default());
    assert!(latest.cloud().is_empty(), "nothing yet");
    let first = update(0, 100, 10);
    assert_eq!(latest.put(0, first.clone()), Arrival::Shown, "the first");
    assert!(Arc::ptr_eq(&latest.cloud(), &first.cloud), "no copy");
    assert_eq!(latest.put(0, update(0, 100, 11)), Arrival::Duplicate, "the same time");
    assert_eq!(latest.put(0, update(0, 50, 12)), Arrival::Late, "older");
    assert!(Arc::ptr_eq(&latest.cloud(), &first.cloud), "refused ones change nothing");
    latest.put(0, update(0, 200, 13));
    assert_eq!(latest.cloud().len(), 13, "the newest alone");
    let told = latest.statistics();
    assert_eq!((told.shown, told.late, told.duplicates, told.restarted), (2, 1, 1, 0), "counted");
}

#[test]
fn sensors_and_streams_are_merged_each_with_its_pose() {
    let mut latest = one(LatestOptions::default());
    let second = latest.add(DMat4::from_translation(DVec3::X));
    latest.put(0, update(0, 100, 10));
    latest.put(0, update(1, 90, 20));
    // Clocks of different streams are independent.
    latest.put(second, update(0, -100_000, 30));
    let cloud = latest.cloud();
    assert_eq!(cloud.len(), 60, "all three");
    assert_eq!(cloud.identity(), latest.cloud().identity(), "put together once");
    assert_eq!(cloud.scans().len(), 3, "each with its sensor");
    assert_eq!(cloud.scans()[2].position(), DVec3::X, "which the pose moves");
    assert_eq!(cloud.world_position(59), DVec3::new(2.0, 2.0, 3.0), "as it moves the points");
    latest.set_pose(second, DMat4::from_translation(DVec3::Y));
    assert_eq!(latest.cloud().world_position(59), DVec3::new(1.0, 3.0, 3.0), "another pose");
    assert_ne!(latest.cloud().identity(), cloud.identity(), "is another cloud");
    let moved = latest.cloud();
    latest.set_pose(second, DMat4::from_translation(DVec3::Y));
    assert!(Arc::ptr_eq(&moved, &latest.cloud()), "the same pose is not");
    latest.forget(0);
    assert_eq!(latest.cloud().len(), 30, "without the first stream");
}

#[test]
fn what_decays_is_shown_for_its_time_in_whatever_order_it_comes() {
    let mut latest = one(LatestOptions { decay: Some(Duration::from_millis(250)), ..LatestOptions::default() });
    for time in [0, 100, 300, 200] {
        assert_eq!(latest.put(0, update(0, time, 10 + time as usize)), Arrival::Shown, "at {time}");
    }
    assert_eq!(latest.cloud().len(), 110 + 210 + 310, "0 is older than 250 ms");
    assert_eq!(latest.put(0, update(0, 200, 1)), Arrival::Duplicate, "known");
    assert_eq!(latest.put(0, update(0, 40, 1)), Arrival::Late, "too old to be shown");
    latest.put(0, update(1, 0, 1));
    assert_eq!(latest.cloud().len(), 631, "another sensor has its own time");
    latest.put(0, update(0, 5000, 2));
    assert_eq!(latest.cloud().len(), 3, "all others are gone");
    latest.put(0, update(0, 5100, 4));
    latest.set_options(LatestOptions::default());
    assert_eq!(latest.cloud().len(), 5, "the newest of each");
}

#[test]
fn clocks_that_go_back_begin_anew() {
    let decay = Some(Duration::from_secs(3));
    for (options, back) in
        [(LatestOptions::default(), 1100), (LatestOptions { decay, ..LatestOptions::default() }, 3100)]
    {
        let mut latest = one(options);
        latest.put(0, update(0, 10_000, 1));
        latest.put(0, update(1, 10_000, 2));
        assert_eq!(latest.put(0, update(0, 10_000 - back, 4)), Arrival::Restarted, "by {back} ms");
        assert_eq!(latest.put(0, update(0, 10_010 - back, 8)), Arrival::Shown, "said once");
        let shown = if latest.statistics().restarted == 1 { latest.cloud().len() } else { 0 };
        assert_eq!(shown & 2, 2, "the other sensor stays");
        assert_eq!(shown & 9, 8, "the old time is gone");
    }
    let mut latest = one(LatestOptions::default());
    for stamp in [i64::MAX, i64::MIN, 0, i64::MAX, -1] {
        latest.put(0, Update { stamp, ..update(0, 0, 1) });
    }
    assert_eq!((latest.cloud().len(), latest.statistics().restarted), (1, 2), "clocks gone mad");
}

#[test]
fn a_clock_that_goes_back_a_little_is_followed_once_that_is_sure() {
    let decay = Some(Duration::from_secs(2));
    for (options, late) in [
        (LatestOptions::default(), Arrival::Late),
        (LatestOptions { decay, ..LatestOptions::default() }, Arrival::Shown),
    ] {
        let mut latest = one(options.clone());
        for time in [600, 700, 800] {
            latest.put(0, update(0, time, 1000));
        }
        // A simulation that is started again.
        for (time, count) in [(0, 1), (100, 2), (200, 4)] {
            assert_eq!(latest.put(0, update(0, time, count)), late, "at {time}, {options:?}");
            assert!(latest.cloud().len() >= 1000, "it may have been overtaken");
        }
        assert_eq!(latest.put(0, update(0, 300, 8)), Arrival::Restarted, "{options:?}");
        let kept = if options.decay.is_some() { 1 + 2 + 4 + 8 } else { 8 };
        assert_eq!(latest.cloud().len(), kept, "what came since then, {options:?}");
        assert_eq!(latest.put(0, update(0, 400, 16)), Arrival::Shown, "and so on, {options:?}");
        assert_eq!(latest.put(0, update(0, 600, 32)), Arrival::Shown, "as if the old time had never been, {options:?}");
        assert_eq!(latest.statistics().restarted, 1, "once, {options:?}");
    }
}

#[test]
fn messages_that_are_late_or_sent_twice_set_no_clock_back() {
    let decay = Some(Duration::from_millis(900));
    for options in [LatestOptions::default(), LatestOptions { decay, ..LatestOptions::default() }] {
        let mut latest = one(options.clone());
        // Every second one is overtaken, three are delayed together, and one repeats.
        for time in [100, 0, 300, 200, 500, 400, 900, 600, 700, 800, 1000, 950, 950, 950, 950, 950, 1100, 1100, 1050] {
            assert_ne!(latest.put(0, update(0, time, 1)), Arrival::Restarted, "at {time}, {options:?}");
        }
        let told = latest.statistics();
        assert_eq!((told.shown + told.late + told.duplicates, told.restarted), (19, 0), "{told:?}, {options:?}");
    }
    // With `accumulate`, late points are shown and remove nothing.
    let mut latest = one(LatestOptions { accumulate: true, ..LatestOptions::default() });
    for time in [500, 600, 0, 100, 200, 300, 400] {
        assert_eq!(latest.put(0, update(0, time, 1)), Arrival::Shown, "at {time}");
    }
    assert_eq!(latest.cloud().len(), 7, "all");
}

#[test]
fn no_single_stamp_takes_away_what_is_accumulated() {
    let mut latest = one(LatestOptions { accumulate: true, ..LatestOptions::default() });
    for time in [100_000, 100_100, 900_000, 100_200, 100_300, 5, 900_100] {
        assert_eq!(latest.put(0, update(0, time, 1)), Arrival::Shown, "at {time}");
    }
    assert_eq!(latest.cloud().len(), 7, "all, however far apart");
    let again = [0, 100, 200, 300].map(|time| latest.put(0, update(0, time, 10)));
    assert_eq!(again, [Arrival::Shown, Arrival::Shown, Arrival::Shown, Arrival::Restarted], "four in a row begin anew");
    assert_eq!(latest.cloud().len(), 40, "and what came since then is kept");
}

#[test]
fn a_stream_that_is_played_again_shows_its_first_frame_once_it_is_there() {
    let mut latest = one(LatestOptions::default());
    latest.put(0, update(0, 900, 9));
    latest.restart(0);
    assert_eq!(latest.cloud().len(), 9, "until then the last one");
    assert_eq!(latest.put(0, update(0, 0, 1)), Arrival::Shown, "less than a second before it");
    assert_eq!(latest.cloud().len(), 1, "the first frame");
}

#[test]
fn everything_is_kept_up_to_a_number_of_points() {
    let mut latest = one(LatestOptions { accumulate: true, most_points: 1000, ..LatestOptions::default() });
    for time in 0..50 {
        latest.put(0, update(0, time * 100, 100));
        latest.put(0, update(1, time * 100, 10));
        assert!(latest.cloud().len() <= 1000, "at {time}");
    }
    let given_up = latest.statistics().given_up;
    assert!(given_up > 80 && latest.cloud().len() > 880, "{} points, {given_up} given up", latest.cloud().len());
    latest.put(0, update(0, 6000, 5000));
    assert_eq!(latest.cloud().len(), 5000 + 10, "the newest of each stays, however large");
}

/// Measures the merging of clouds for each update, which happens anew because the last cloud is still shown. Compare
/// with the 50 ms between updates and with the time of a picture of as many points.
#[test]
#[ignore = "a measurement; prints figures"]
fn what_putting_together_takes() {
    for (kept, count) in [(10, 100_000), (40, 100_000), (100, 100_000), (1000, 10_000)] {
        let decay = Some(Duration::from_millis(50 * kept - 1));
        let mut latest = one(LatestOptions { decay, ..LatestOptions::default() });
        let mut times = Vec::new();
        let mut before = latest.cloud();
        for number in 0..kept as i64 + 20 {
            latest.put(0, update(0, number * 50, count));
            let begun = std::time::Instant::now();
            let cloud = latest.cloud();
            times.push(begun.elapsed().as_secs_f64() * 1e3);
            // The last cloud is released once the next one is there.
            before = cloud;
        }
        assert_eq!(before.len(), kept as usize * count, "all that is kept");
        let full = &mut times[kept as usize..];
        full.sort_by(f64::total_cmp);
        println!("{kept} x {count} points: median {:.1} ms, most {:.1} ms", full[full.len() / 2], full[full.len() - 1]);
    }
}
