//! Tests of live points over Zenoh from another session in the same process.

use std::{
    io::{BufRead as _, BufReader},
    net::TcpListener,
    process::{Child, Command, Stdio},
    thread,
    time::{Duration, Instant},
};

use crate::common::{
    positions,
    ros::{Cloud2, transforms},
    zenoh_peer::{TRANSFORM, answering, bridge_token, cache, client, free_port, listener, rmw_key, rmw_token},
};
use autosplats_cloud::glam::DVec3;
use autosplats_sources::{
    Next, Statistics, Stream as _, Update,
    point_cloud2::Encoding,
    remote::{Remote, RemoteOptions, Topic, topics},
};
use zenoh::{Session, Wait as _, qos::CongestionControl};

/// Longer than any expected event takes.
const PATIENCE: Duration = Duration::from_secs(20);

fn live(port: u16, topic: &str) -> Remote {
    Remote::open(&format!("zenoh://127.0.0.1:{port}/{topic}"), &RemoteOptions::default()).unwrap()
}

/// Waits until `holds` is true for the statistics.
fn until(live: &Remote, what: &str, holds: impl Fn(&Statistics) -> bool) {
    let begin = Instant::now();
    while !holds(&live.statistics()) {
        assert!(begin.elapsed() < PATIENCE, "{what}: {:?}", live.statistics());
        thread::sleep(Duration::from_millis(10));
    }
}

fn connected(live: &Remote) {
    until(live, "connected", |told| told.waiting.as_ref().is_none_or(|why| !why.starts_with("no router")));
}

/// The next points, while `send` sends repeatedly. Messages sent before the subscription is known are lost.
fn next(live: &mut Remote, send: impl Fn()) -> Update {
    let begin = Instant::now();
    while begin.elapsed() < PATIENCE {
        send();
        if let Next::Update(update) = live.next(Duration::from_millis(100), &()).unwrap() {
            return update;
        }
    }
    panic!("nothing came: {:?}", live.statistics());
}

fn put(session: &Session, key: &str, message: &[u8]) {
    // Without this, the sender itself drops messages on a busy machine.
    session.put(key, message).congestion_control(CongestionControl::Block).wait().unwrap();
}

#[test]
fn points_of_nodes_and_of_the_bridge_arrive_as_they_were_sent() {
    let message = Cloud2::xyz(&positions(1000), 16);
    for mode in ["peer", "router"] {
        for key in [rmw_key(0, "front/points"), rmw_key(7, "front/points"), "front/points".into()] {
            let port = free_port();
            let there = listener(mode, port);
            let mut live = live(port, "front/points");
            let update = next(&mut live, || put(&there, &key, &message.cdr()));
            assert_eq!(update.cloud.positions(), positions(1000), "{key} of a {mode}");
            assert_eq!((update.channel, update.stamp), (0, message.stamp), "{key} of a {mode}");
            assert_eq!(live.channels(), ["/front/points"], "{key} of a {mode}");
            assert_eq!(live.statistics().waiting, None, "nothing is waited for");
        }
    }
}

#[test]
#[ignore = "needs a network with multicast, which nobody else uses for this topic"]
fn whoever_answers_on_the_network_is_heard() {
    let there = answering(free_port());
    let mut live = live_at("zenoh:///autosplats_test/points");
    let message = Cloud2::xyz(&positions(10), 12).cdr();
    let update = next(&mut live, || put(&there, &rmw_key(0, "autosplats_test/points"), &message));
    assert_eq!(update.cloud.len(), 10, "found");
}

#[test]
fn another_domain_is_not_heard() {
    let port = free_port();
    let there = listener("peer", port);
    let mut live = live(port, "points?domain=3");
    let [wrong, right] = [5, 9].map(|count| Cloud2::xyz(&positions(count), 12).cdr());
    let update = next(&mut live, || {
        put(&there, &rmw_key(0, "points"), &wrong);
        put(&there, &rmw_key(3, "points"), &right);
    });
    assert_eq!(update.cloud.len(), 9, "only those of the domain");
    assert_eq!(live.channels().len(), 1, "only those of the domain");
}

#[test]
fn points_without_a_time_are_of_now() {
    let port = free_port();
    let there = listener("peer", port);
    let mut live = live(port, "points");
    let message = Cloud2 { stamp: 0, ..Cloud2::xyz(&positions(3), 12) };
    let now = std::time::UNIX_EPOCH.elapsed().unwrap().as_nanos() as i64;
    let update = next(&mut live, || put(&there, "points", &message.cdr()));
    assert!((0..20_000_000_000).contains(&(update.stamp - now)), "when it came");
}

#[test]
fn the_newest_wins_and_the_others_are_counted() {
    let port = free_port();
    let there = listener("peer", port);
    let mut live = live(port, "points");
    next(&mut live, || put(&there, "points", &Cloud2::xyz(&positions(1), 12).cdr()));
    // Drains the repeated messages from the beginning.
    while live.next(Duration::from_millis(300), &()).unwrap() != Next::Nothing {}
    let before = live.statistics();
    let message = |number: i64| Cloud2 { stamp: 1 + number, ..Cloud2::xyz(&positions(100_000), 24) }.cdr();
    let sent = 200;
    let last = message(sent);
    // 480 MB, of which one message is kept.
    let memory = resident();
    for number in 0..sent {
        put(&there, "points", &message(number));
    }
    put(&there, "points", &last);
    until(&live, "all came", |told| told.dropped - before.dropped >= sent as u64);
    let grown = resident().saturating_sub(memory);
    assert!(grown < 150 << 20, "{grown} bytes more for 480 MB that nobody took");
    let Next::Update(update) = live.next(PATIENCE, &()).unwrap() else { panic!("nothing is left") };
    assert_eq!(update.stamp, 1 + sent, "the newest");
    assert_eq!(live.next(Duration::ZERO, &()).unwrap(), Next::Nothing, "no queue behind it");
}

/// Resident memory of this process in bytes.
fn resident() -> usize {
    let pages = std::fs::read_to_string("/proc/self/statm").ok();
    pages.and_then(|pages| pages.split(' ').nth(1)?.parse::<usize>().ok()).unwrap_or(0) * 4096
}

#[test]
fn what_is_no_message_is_counted_and_survived() {
    let port = free_port();
    let there = listener("peer", port);
    let mut live = live(port, "points");
    let good = Cloud2::xyz(&positions(10), 12);
    next(&mut live, || put(&there, "points", &good.cdr()));
    let lies = Cloud2 { height: u32::MAX, width: u32::MAX, point_step: 12, ..good.clone() };
    let mut cut = good.cdr();
    cut.truncate(90);
    for garbage in [&b""[..], b"hello", &[0xff; 5000], &lies.cdr(), &cut] {
        let before = live.statistics();
        put(&there, "points", garbage);
        let begin = Instant::now();
        while live.statistics().refused == before.refused && begin.elapsed() < PATIENCE {
            let next = live.next(Duration::from_millis(50), &()).unwrap();
            // Repeated messages from the beginning may still arrive.
            assert!(!matches!(next, Next::Update(update) if update.cloud.len() != 10), "garbage became points");
        }
        let after = live.statistics();
        assert_eq!(after.refused, before.refused + 1, "counted");
        let why = after.last_refusal.unwrap();
        assert!(why.starts_with("/points: byte ") && !why.contains(char::is_control), "{why}");
    }
    assert_eq!(next(&mut live, || put(&there, "points", &good.cdr())).cloud.len(), 10, "and it goes on");
}

#[test]
fn it_waits_for_a_router_and_comes_back_to_one() {
    let port = free_port();
    let begin = Instant::now();
    let mut live = live(port, "points");
    assert!(begin.elapsed() < Duration::from_secs(1), "opening waits for nobody");
    let absent = format!("no router at tcp/127.0.0.1:{port}: nobody listens there");
    until(&live, "nobody is there", |told| told.waiting.as_ref() == Some(&absent));
    assert_eq!(live.next(Duration::from_millis(10), &()).unwrap(), Next::Nothing, "nobody is there");

    for round in 0..3 {
        let router = listener("router", port);
        let sensor = client(port);
        let token = rmw_token(&sensor, "points", "sensor_msgs::msg::dds_::PointCloud2_", 1);
        let message = Cloud2 { stamp: 1 + round, ..Cloud2::xyz(&positions(10), 12) }.cdr();
        let update = next(&mut live, || put(&sensor, &rmw_key(0, "points"), &message));
        assert_eq!(update.stamp, 1 + round, "round {round}");
        until(&live, "counted", |told| told.reconnected == round as u64);
        drop(token);
        sensor.close().wait().unwrap();
        router.close().wait().unwrap();
        let lost = format!("no router at tcp/127.0.0.1:{port}: the connection is lost");
        until(&live, "noticed", |told| told.waiting.as_ref() == Some(&lost));
        while live.next(Duration::ZERO, &()).unwrap() != Next::Nothing {}
    }
    let begin = Instant::now();
    drop(live);
    assert!(begin.elapsed() < Duration::from_secs(1), "closing waits for nobody");
}

#[test]
fn it_says_why_nothing_comes() {
    let port = free_port();
    let there = listener("peer", port);
    let told = |what: &str, live: &Remote, expected: &str| {
        until(live, what, |told| told.waiting.as_ref().is_some_and(|why| why == expected));
    };
    let live = live(port, "points");
    told("nothing", &live, "connected, but nobody publishes /points, nor anything else");
    let _image = rmw_token(&there, "image", "sensor_msgs::msg::dds_::Image_", 1);
    let only = "connected, but nobody publishes /points; known topics, none of them with points: /image";
    told("an image", &live, only);
    let _others = [bridge_token(&there, "rear/points"), bridge_token(&there, "front/points")];
    let others = "connected, but nobody publishes /points; known topics: /front/points, /rear/points";
    told("others", &live, others);
    let wrong = rmw_token(&there, "points", "sensor_msgs::msg::dds_::LaserScan_", 2);
    let scan =
        "connected, but /points has no points: its type is sensor_msgs/msg/LaserScan, not sensor_msgs/msg/PointCloud2";
    told("a scan", &live, scan);
    drop(wrong);
    let right = rmw_token(&there, "points", "sensor_msgs::msg::dds_::PointCloud2_", 3);
    told("a publisher", &live, "publisher found, no message yet");
    put(&there, &rmw_key(0, "points"), &Cloud2::xyz(&positions(3), 12).cdr());
    until(&live, "a message", |told| told.waiting.is_none());
    told("silence", &live, "publisher found, no message for 5 s");
    drop(right);
    told("gone", &live, others);

    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let foreign = live_at(&format!("zenoh://{}/points", other.local_addr().unwrap()));
    thread::spawn(move || other.incoming().for_each(drop));
    until(&foreign, "no zenoh", |told| {
        told.waiting.as_ref().is_some_and(|why| why.ends_with("something else answers there"))
    });
    let unknown = live_at("zenoh://no-such-machine.invalid/points");
    until(&unknown, "unknown", |told| told.waiting.as_ref().is_some_and(|why| why.contains("no machine is called")));
}

fn live_at(url: &str) -> Remote {
    Remote::open(url, &RemoteOptions::default()).unwrap()
}

#[test]
fn several_topics_are_several_channels() {
    let port = free_port();
    let there = listener("peer", port);
    let _bridged = bridge_token(&there, "robot/points");
    let mut live = live(port, "**");
    connected(&live);
    let message = |count| Cloud2::xyz(&positions(count), 12).cdr();
    let sent = [(rmw_key(0, "front/points"), 1), (rmw_key(0, "rear/points"), 2), ("robot/points".to_owned(), 3)];
    let mut seen = std::collections::BTreeMap::new();
    let begin = Instant::now();
    while seen.len() < 3 && begin.elapsed() < PATIENCE {
        for (key, count) in &sent {
            put(&there, key, &message(*count));
        }
        // Topics that have no points and declare none.
        put(&there, "0/image/sensor_msgs::msg::dds_::Image_/RIHS01_00", b"an image");
        put(&there, "image", b"another");
        while let Next::Update(update) = live.next(Duration::from_millis(20), &()).unwrap() {
            seen.insert(live.channels()[update.channel].clone(), update.cloud.len());
        }
    }
    let expected = [("/front/points", 1), ("/rear/points", 2), ("/robot/points", 3)];
    assert!(seen.iter().map(|(name, count)| (&**name, *count)).eq(expected), "{seen:?}");
    assert_eq!(live.statistics().refused, 0, "what is not of points was never heard");
}

/// A message with a frame that is translated but not rotated in its parent.
fn transform(stamp: i64, parent: &str, child: &str, x: f64) -> Vec<u8> {
    transforms(Encoding::Cdr, &[(stamp, parent, child, [x, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])])
}

/// One point at (1, 2, 3) of the sensor's frame.
fn one_point(stamp: i64) -> Vec<u8> {
    Cloud2 { stamp, ..Cloud2::xyz(&[[1.0, 2.0, 3.0]], 12) }.cdr()
}

const SECOND: i64 = 1_000_000_000;
const NOW: i64 = 1_700_000_000 * SECOND;

#[test]
fn sensors_are_where_their_robot_says() {
    for (points, [tf, tf_static]) in [
        (rmw_key(0, "points"), ["tf", "tf_static"].map(|name| format!("0/{name}/{TRANSFORM}/RIHS01_00"))),
        ("points".to_owned(), ["tf", "tf_static"].map(str::to_owned)),
    ] {
        let port = free_port();
        let there = listener("peer", port);
        let mut live = live(port, "points");
        // The robot moves from 10 to 20 within a second. The points are from a time between.
        let sent = [
            (tf_static.clone(), transform(0, "base", "lidar", 100.0)),
            (tf.clone(), transform(NOW, "odom", "base", 10.0)),
            (tf.clone(), transform(NOW + SECOND, "odom", "base", 20.0)),
            (points.clone(), one_point(NOW + SECOND / 4)),
        ];
        let update = next(&mut live, || sent.iter().for_each(|(key, message)| put(&there, key, message)));
        assert_eq!(update.cloud.world_position(0), DVec3::new(113.5, 2.0, 3.0), "{points}");
        assert_eq!(update.cloud.scans()[0].position(), DVec3::new(112.5, 0.0, 0.0), "the sensor, {points}");
        assert_eq!((live.channels(), live.statistics().refused), (vec!["/points".into()], 0), "{points}");
        // Later than all known transforms, and in order after the repeated messages.
        while live.next(Duration::from_millis(200), &()).unwrap() != Next::Nothing {}
        put(&there, &points, &one_point(NOW + 5 * SECOND));
        let Next::Update(update) = live.next(PATIENCE, &()).unwrap() else { panic!("nothing came") };
        assert_eq!(update.cloud.world_position(0).x, 121.0, "where it was last, {points}");
        put(&there, &tf, b"nonsense");
        until(&live, "what is no message is counted", |told| told.refused == 1);
        let why = live.statistics().last_refusal.unwrap();
        assert!(why.starts_with("/tf: byte 0: "), "{why}");
    }
}

#[test]
fn transforms_that_were_sent_before_anybody_listened_are_asked_for() {
    let typed = format!("0/tf_static/{TRANSFORM}/RIHS01_00");
    for (points, key, asked) in [
        (rmw_key(0, "points"), &*typed, format!("{typed}/@adv/pub/7f3a/1/_")),
        (rmw_key(0, "points"), &*typed, format!("7f3a/{typed}")),
        ("points".into(), "tf_static", "tf_static/@adv/pub/7f3a/1/_".into()),
        ("points".into(), "tf_static", "@/7f3a/@ros2_pub_cache/tf_static".into()),
    ] {
        let port = free_port();
        let there = listener("router", port);
        // Two nodes, each with the transform of one of two frames.
        let nodes = [("base", "lidar", 10.0), ("map", "base", 20.0)].map(|(parent, child, x)| {
            let node = client(port);
            let token = rmw_token(&node, "tf_static", TRANSFORM, 7);
            let kept = cache(&node, asked.clone(), key.into(), transform(0, parent, child, x));
            (node, token, kept)
        });
        let mut live = live(port, "points");
        let update = next(&mut live, || put(&there, &points, &one_point(NOW)));
        assert_eq!(update.cloud.world_position(0).x, 31.0, "of both, asked for as {asked}");
        drop(nodes);
    }
}

#[test]
fn points_are_refused_until_the_frame_that_is_asked_for_is_known() {
    let port = free_port();
    let there = listener("peer", port);
    let options = RemoteOptions { frame: Some("map".into()), ..RemoteOptions::default() };
    let mut live = Remote::open(&format!("zenoh://127.0.0.1:{port}/robot/points"), &options).unwrap();
    let key = rmw_key(0, "robot/points");
    let begin = Instant::now();
    while live.statistics().refused == 0 {
        put(&there, &key, &one_point(NOW));
        assert_eq!(live.next(Duration::from_millis(100), &()).unwrap(), Next::Nothing, "nobody knows where it is");
        assert!(begin.elapsed() < PATIENCE, "nothing came: {:?}", live.statistics());
    }
    let why = live.statistics().waiting.unwrap_or_default();
    assert!(why.contains("robot/points") && why.contains("'lidar'") && why.contains("'map'"), "{why}");
    let mut place = |message: &[u8]| {
        put(&there, &format!("0/robot/tf/{TRANSFORM}/RIHS01_00"), message);
        thread::sleep(Duration::from_millis(200));
        while live.next(Duration::ZERO, &()).unwrap() != Next::Nothing {}
        put(&there, &key, &one_point(NOW));
        match live.next(Duration::from_secs(2), &()).unwrap() {
            Next::Update(update) => Ok(update.cloud.world_position(0).x),
            _ => Err(live.statistics().waiting.unwrap_or_default()),
        }
    };
    let why = place(&transform(NOW, "base", "lidar", 10.0)).unwrap_err();
    assert!(why.contains("no frame is called 'map'; there are: base, lidar"), "{why}");
    assert_eq!(place(&transform(NOW, "map", "base", 20.0)), Ok(31.0), "now there is");
    // The robot is moved. Then its clock goes back, and only transforms after that count.
    assert_eq!(place(&transform(NOW + SECOND, "map", "base", 50.0)), Ok(31.0), "later than the points");
    assert_eq!(place(&transform(NOW - 60 * SECOND, "map", "base", 70.0)), Ok(81.0), "the only one");
    assert_eq!(live.statistics().waiting, None, "and nothing is waited for");
}

#[test]
fn topics_are_listed_points_first() {
    let port = free_port();
    let there = listener("router", port);
    let node = client(port);
    let kind = "sensor_msgs::msg::dds_::PointCloud2_";
    let _tokens = [
        rmw_token(&node, "camera/image", "sensor_msgs::msg::dds_::Image_", 1),
        rmw_token(&node, "points", kind, 2),
        rmw_token(&there, "points", kind, 3),
        bridge_token(&node, "robot/points"),
    ];
    let topic = |name: &str, kind: &str, domain, publishers| Topic {
        name: name.into(),
        kind: format!("sensor_msgs/msg/{kind}"),
        domain,
        publishers,
    };
    let expected = [
        topic("/points", "PointCloud2", Some(0), 2),
        topic("/robot/points", "PointCloud2", None, 1),
        topic("/camera/image", "Image", Some(0), 1),
    ];
    assert_eq!(topics(&format!("zenoh://127.0.0.1:{port}"), PATIENCE).unwrap(), expected, "as declared");
}

#[test]
fn topics_that_nobody_declares_are_heard() {
    let port = free_port();
    let there = listener("peer", port);
    let (stop, stopped) = std::sync::mpsc::channel::<()>();
    let sender = thread::spawn(move || {
        while stopped.try_recv().is_err() {
            put(&there, "points", &Cloud2::xyz(&positions(3), 12).cdr());
            put(&there, "camera", b"an image");
            thread::sleep(Duration::from_millis(20));
        }
    });
    let found = topics(&format!("zenoh://127.0.0.1:{port}/"), Duration::from_secs(4)).unwrap();
    stop.send(()).unwrap();
    sender.join().unwrap();
    let told: Vec<_> = found.iter().map(|topic| (&*topic.name, topic.has_points(), topic.publishers)).collect();
    assert_eq!(told, [("/points", true, 0), ("/camera", false, 0)], "by what they send");
}

#[test]
fn topics_of_nobody_are_an_error_with_a_remedy() {
    let url = format!("zenoh://127.0.0.1:{}/", free_port());
    let begin = Instant::now();
    let error = topics(&url, Duration::from_secs(2)).unwrap_err().to_string();
    assert!(error.starts_with(&url) && error.contains("nobody listens there; start one there"), "{error}");
    assert!(begin.elapsed() < Duration::from_secs(3), "patience is kept");
    assert!(Remote::open("zenoh://127.0.0.1", &RemoteOptions::default()).is_err(), "no topic is named");
}

/// A Python process in which `rosbags` writes the messages and `eclipse-zenoh` sends them.
fn python(port: u16) -> Child {
    let python = std::env::var_os("AUTOSPLATS_PYTHON")
        .expect("AUTOSPLATS_PYTHON must name a Python that has eclipse-zenoh, rosbags and numpy");
    let script = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interop/publish_points.py");
    let mut command = Command::new(python);
    let mut other =
        command.arg(script).arg(port.to_string()).stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(other.stdout.take().unwrap()).read_line(&mut line).unwrap();
    assert_eq!(line.trim(), "publishing", "the script failed; what it says is above");
    other
}

#[test]
#[ignore = "needs AUTOSPLATS_PYTHON: a Python that has eclipse-zenoh, rosbags and numpy"]
fn who_is_killed_and_started_again_is_heard_again() {
    let port = free_port();
    let mut other = python(port);
    let mut live = live(port, "front/points");
    for round in 0..3 {
        next(&mut live, || {});
        until(&live, "counted", |told| told.reconnected == round);
        other.kill().unwrap();
        other.wait().unwrap();
        until(&live, "noticed", |told| {
            told.waiting.as_ref().is_some_and(|why| why.ends_with("the connection is lost"))
        });
        while live.next(Duration::ZERO, &()).unwrap() != Next::Nothing {}
        other = python(port);
    }
    drop(other.stdin.take());
    other.wait().unwrap();
}

#[test]
#[ignore = "needs AUTOSPLATS_PYTHON: a Python that has eclipse-zenoh, rosbags and numpy"]
fn points_of_another_implementation_arrive() {
    let port = free_port();
    let mut other = python(port);
    let found = topics(&format!("zenoh://127.0.0.1:{port}"), PATIENCE).unwrap();
    let names: Vec<_> = found.iter().map(|topic| (&*topic.name, topic.has_points(), topic.domain)).collect();
    assert_eq!(names[..2], [("/front/points", true, Some(0)), ("/rear/points", true, None)], "both ways of naming");
    let others = [("/tf", Some(0)), ("/tf", None), ("/tf_static", Some(0)), ("/tf_static", None)];
    let mut found: Vec<_> = names[2..].iter().map(|&(name, _, domain)| (name, domain)).collect();
    found.sort_by_key(|&(name, domain)| (name, domain.is_none()));
    assert_eq!(found, others, "and what has no points");
    for (topic, frame, x) in [("front/points", "front_lidar", 1.0), ("rear/points", "rear_lidar", -1.0)] {
        let mut live = live(port, topic);
        let Next::Update(Update { stamp, cloud, .. }) = live.next(PATIENCE, &()).unwrap() else {
            panic!("nothing came: {:?}", live.statistics());
        };
        assert_eq!((stamp, cloud.len()), (1_700_000_000_123_456_789, 1000), "{topic}");
        let scan = &cloud.scans()[0];
        assert_eq!(scan.name.as_deref(), Some(frame), "{topic}");
        // Fixed transforms were sent once, before the subscription.
        let place = DVec3::new(10.0 + x, 20.0, 0.5);
        assert_eq!(scan.position(), place, "{topic}: where the robot says that its sensor is");
        let (light, ring) = (cloud.field("Intensity").unwrap(), cloud.field("Ring").unwrap());
        for i in 0..1000 {
            let of = i as f64;
            let wanted = place + DVec3::new(1.0 + of / 2.0, -of, of % 7.0);
            assert_eq!(cloud.world_position(i), wanted, "point {i} of {topic}");
            assert_eq!([light.values.get(i), ring.values.get(i)], [of + 0.25, of % 128.0], "point {i} of {topic}");
        }
    }
    drop(other.stdin.take());
    assert!(other.wait().unwrap().success(), "the script ends in order");
}
