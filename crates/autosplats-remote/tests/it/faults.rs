//! What servers do wrong.

use std::net::TcpListener;
use std::time::{Duration, Instant};

use autosplats_cloud::ErrorKind;
use autosplats_remote::RemoteOptions;

use crate::{SIZE, Site, bytes, open, part, quick};

/// Faults that pass: the file is read in spite of them.
#[test]
fn what_passes_is_tried_again() {
    let site = Site::new();
    // The number of requests to open and to read one range.
    let cases = [
        ("~busy:2/scan.laz", 4),
        ("~reset:3/scan.laz", 5),
        ("~500:1/scan.laz", 3),
        ("~429:4/scan.laz", 6),
        ("~short:1/scan.laz", 3),
        ("~silent:1/scan.laz", 3),
        ("~stalls:1/scan.laz", 3),
        ("~less:1/scan.laz", 2),
        ("~moved/scan.laz", 3),
        ("~elsewhere/scan.laz", 3),
    ];
    for (path, requests) in cases {
        let file = site.open(path).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(file.size(), SIZE as u64, "{path}");
        assert_eq!(part(&*file, 500_000..500_100).unwrap(), bytes(500_000..500_100), "{path}");
        assert_eq!(file.traffic().requests, requests, "{path}");
    }
}

/// A request that breaks off goes on where it ended.
#[test]
fn what_breaks_off_goes_on() {
    let site = Site::new();
    for path in ["~short:1-5/scan.laz", "~stalls:1-2/scan.laz", "~less:1-5/scan.laz"] {
        let file = site.open(path).unwrap();
        let before = file.traffic().bytes;
        assert!(part(&*file, 500_000..900_000).unwrap() == bytes(500_000..900_000), "{path}");
        assert_eq!(file.traffic().bytes - before, 400_000, "{path}: no byte comes twice");
    }
    let file = site.open("~less/scan.laz").unwrap();
    let told = part(&*file, 1_000_000..1_500_000).unwrap_err().to_string();
    assert!(told.ends_with("the server sends less than was asked for (5 tries); try again later"), "{told}");
    assert_eq!(file.traffic().requests, 7, "tries count anew while much arrives");
}

#[test]
fn each_fault_is_one_line_with_a_remedy() {
    let site = Site::new();
    let unclear = "the server sends other parts than it was asked for, or does not tell which; download it";
    let cases = [
        ("~404/scan.laz", "the server answers 404, Status404: there is no such file; check the address"),
        ("missing", "the server answers 404, Status404: there is no such file; check the address"),
        ("~401/scan.laz", "the server answers 401, Status401: it asks who you are; give --header 'Authorization: …'"),
        (
            "~403/scan.laz",
            "the server answers 403, Status403: it may not be read; a signed address may have expired, else give \
             credentials",
        ),
        ("~418/scan.laz", "the server answers 418, Status418: check the address"),
        ("~busy/scan.laz", "the server answers 503, Status503 (5 tries); try again later"),
        ("~busy-long/scan.laz", "the server answers 503, Status503, and asks to come back after 3600 s"),
        ("~reset/scan.laz", "the connection broke off (5 tries); try again later"),
        ("~short/scan.laz", "the connection broke off (5 tries); try again later"),
        ("~silent/scan.laz", "the server sends nothing for 0.3 s (2 tries); try again later"),
        ("~shifted/scan.laz", unclear),
        ("~unsized/scan.laz", unclear),
        ("~more/scan.laz", unclear),
        ("~shifted:1-99/scan.laz", unclear),
        ("~unsized:1-99/scan.laz", unclear),
        ("~more:1-99/scan.laz", unclear),
        ("~416/scan.laz", unclear),
        ("~416:1-99/scan.laz", "the file changed while it was read; open it again"),
        ("~whole:1-99/scan.laz", "the server sends parts of files only sometimes; download it"),
        ("~changes/scan.laz", "the file changed while it was read; open it again"),
        ("~swaps/scan.laz", "the file changed while it was read; open it again"),
        ("~shrinks/scan.laz", "the file changed while it was read; open it again"),
        ("~loop/scan.laz", "it redirects more than 10 times; check the address"),
        ("~nowhere/scan.laz", "it redirects without saying where to; check the address"),
        ("~ftp/scan.laz", "it redirects to what is no http or https address; check the address"),
        ("~region/scan.laz", "it redirects without saying where to; check the address"),
        ("~gzip/scan.laz", "the server compresses it, so that it has no parts; have it stored as it is"),
        ("~endless-head/scan.laz", "the server sends headers without an end; tell its owner"),
    ];
    for (path, what) in cases {
        assert_eq!(site.fault(path), what, "{path}");
    }
    let noise = site.fault("~noise/scan.laz");
    assert!(noise.starts_with("what answers at 127.0.0.1, port ") && noise.ends_with(" is no HTTP; check the address"));
}

#[test]
fn bytes_without_an_end_are_not_kept() {
    let site = Site::new();
    let options = RemoteOptions { cache: 1 << 20, ..quick() };
    let told = open(&site.server.address("~endless/scan.laz"), &options, &()).unwrap_err().to_string();
    assert!(told.contains("more than 1048576 bytes are not loaded whole"), "{told}");
    assert!(site.server.counts().bytes < 20 << 20, "it stopped to read: {:?}", site.server.counts());
}

#[test]
fn where_a_redirect_led_is_asked_for_anew_when_it_ends() {
    let site = Site::new();
    let file = site.open("~moved/scan.laz").unwrap();
    part(&*file, 500_000..500_100).unwrap();
    let path = site.folder.path().join("scan.laz");
    let hidden = site.folder.path().join("hidden");
    std::fs::rename(&path, &hidden).unwrap();
    let told = part(&*file, 700_000..700_100).unwrap_err().to_string();
    assert!(told.contains("the server answers 404"), "{told}");
    std::fs::rename(&hidden, &path).unwrap();
    assert_eq!(part(&*file, 700_000..700_100).unwrap(), bytes(700_000..700_100));
    let asked: Vec<String> = site.server.heads().iter().map(|head| head.split(' ').nth(1).unwrap().into()).collect();
    let (old, new) = ("/~moved/scan.laz", "/scan.laz");
    assert_eq!(asked, [old, new, new, new, old, new, old, new], "the old one again after each end");
}

#[test]
fn nobody_answers() {
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let start = Instant::now();
    let error = open(&format!("http://127.0.0.1:{port}/a"), &RemoteOptions::default(), &()).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Io);
    let what = format!("nobody answers at 127.0.0.1, port {port}; check the address, and that the server runs");
    assert_eq!(error.to_string(), format!("http://127.0.0.1:{port}/a: {what}"));
    assert!(start.elapsed() < Duration::from_secs(1), "that is not tried again");
    let unknown = open("http://no-such-host.invalid/a", &quick(), &()).unwrap_err().to_string();
    let what = "no-such-host.invalid is not found; check the address and the network";
    assert_eq!(unknown, format!("http://no-such-host.invalid/a: {what}"));
    for wrong in ["http://", "https://a b/", "http://[::1/"] {
        let told = open(wrong, &quick(), &()).unwrap_err().to_string();
        assert!(told.starts_with(&format!("{wrong}: it is no address: ")), "{told}");
    }
}
