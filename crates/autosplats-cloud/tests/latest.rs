//! What is shown of streams: the newest, what is not too old, or everything.

use std::{sync::Arc, time::Duration};

use autosplats_cloud::{
    Arrival, Latest, LatestOptions, PointCloud, Scan, Update,
    glam::{DMat4, DVec3},
};

const MS: i64 = 1_000_000;

/// An update of `count` points at a number of milliseconds, seen by a sensor.
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
    assert_eq!((latest.statistics().shown, latest.statistics().refused), (2, 2), "counted");
}

#[test]
fn sensors_and_streams_are_merged_each_with_its_pose() {
    let mut latest = one(LatestOptions::default());
    let second = latest.add(DMat4::from_translation(DVec3::X));
    latest.put(0, update(0, 100, 10));
    latest.put(0, update(1, 90, 20));
    // Clocks of streams have nothing to do with each other.
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
