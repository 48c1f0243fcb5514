//! Measures the speed of live points, and checks that memory does not grow. Takes minutes: `cargo test --release -p
//! autosplats-sources --features zenoh --test remote_speed -- --ignored --nocapture`.

#![allow(clippy::unwrap_used, reason = "a test that cannot be set up should fail")]

#[path = "it/common/mod.rs"]
mod common;

use std::{
    thread,
    time::{Duration, Instant, UNIX_EPOCH},
};

use autosplats_sources::{
    Next, Stream as _,
    remote::{Remote, RemoteOptions},
};
use common::{
    positions,
    ros::Cloud2,
    zenoh_peer::{client, free_port, listener, rmw_key},
};
use zenoh::{Wait as _, qos::CongestionControl};

fn now() -> i64 {
    UNIX_EPOCH.elapsed().unwrap().as_nanos() as i64
}

/// Resident memory of this process in kilobytes.
fn resident() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).unwrap();
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

/// Sends `count` points at 20 Hz from a node through a router.
fn measure(count: usize, step: u32, seconds: u64) {
    let port = free_port();
    let _router = listener("router", port);
    let sensor = client(port);
    let mut live = Remote::open(&format!("zenoh://127.0.0.1:{port}/points"), &RemoteOptions::default()).unwrap();
    let mut message = Cloud2 { stamp: 0, ..Cloud2::xyz(&positions(count), step) }.cdr();
    let bytes = message.len();
    let sent = thread::spawn(move || {
        // By default the sender drops messages on a busy machine, which would count against the receiver.
        let publisher = sensor.declare_publisher(rmw_key(0, "points"));
        let publisher = publisher.congestion_control(CongestionControl::Block).wait().unwrap();
        while !publisher.matching_status().wait().unwrap().matching() {
            thread::sleep(Duration::from_millis(10));
        }
        let (begin, mut sent) = (Instant::now(), 0_u32);
        while begin.elapsed() < Duration::from_secs(seconds) {
            // Seconds and nanoseconds follow the four bytes of CDR.
            let stamp = now();
            message[4..8].copy_from_slice(&((stamp / 1_000_000_000) as u32).to_le_bytes());
            message[8..12].copy_from_slice(&((stamp % 1_000_000_000) as u32).to_le_bytes());
            publisher.put(&message[..]).wait().unwrap();
            sent += 1;
            thread::sleep((Duration::from_millis(50) * sent).saturating_sub(begin.elapsed()));
        }
        u64::from(sent)
    });
    let (mut latencies, mut memory) = (Vec::new(), Vec::new());
    while let Next::Update(update) = live.next(Duration::from_secs(20), &()).unwrap() {
        latencies.push((now() - update.stamp) as f64 / 1e6);
        assert_eq!(update.cloud.len(), count, "whole");
        if latencies.len() % 100 == 20 {
            memory.push(resident() / 1024);
        }
        if sent.is_finished() && live.statistics().taken + live.statistics().dropped >= latencies.len() as u64 {
            while live.next(Duration::from_millis(500), &()).unwrap() != Next::Nothing {}
            break;
        }
    }
    let (sent, told) = (sent.join().unwrap(), live.statistics());
    latencies.sort_by(f64::total_cmp);
    let at = |share: f64| latencies[((latencies.len() - 1) as f64 * share) as usize];
    println!(
        "{count} points, {bytes} bytes: {sent} sent, {} taken, {} dropped; latency ms: median {:.1}, 95 % {:.1}, 99 % {:.1}, max {:.1}; MB: {memory:?}",
        told.taken,
        told.dropped,
        at(0.5),
        at(0.95),
        at(0.99),
        at(1.0)
    );
    assert_eq!(told.taken + told.dropped, sent, "none is lost unless it is counted");
    let (first, last) = (memory[0], memory[memory.len() - 1]);
    assert!(last < first + 30, "memory grew from {first} to {last} MB");
}

#[test]
#[ignore = "takes a minute; prints figures"]
fn a_minute_of_large_messages_is_neither_lost_nor_kept() {
    measure(100_000, 24, 60);
}

#[test]
#[ignore = "takes twenty seconds; prints figures"]
fn small_messages_are_soon_there() {
    measure(100_000, 12, 20);
}
