//! Reading what is there.

use std::sync::Mutex;
use std::time::{Duration, Instant};

use autosplats_cloud::{Error, Progress, Traffic};
use autosplats_remote::{Client, Header, RemoteOptions, is_address};
use autosplats_serve::Server;

use crate::{SIZE, Site, byte, bytes, open, open_folder, part, quick};

#[derive(Default)]
struct Notes(Mutex<Vec<String>>);

impl Progress for Notes {
    fn report(&self, _: f32) {}

    fn note(&self, note: &str) {
        self.0.lock().unwrap().push(note.into());
    }
}

/// Is cancelled after some time.
struct Until(Instant);

impl Progress for Until {
    fn report(&self, _: f32) {}

    fn cancelled(&self) -> bool {
        Instant::now() > self.0
    }
}

#[test]
fn opening_is_one_request_and_its_bytes_are_kept() {
    let site = Site::new();
    let file = site.open("scan.laz").unwrap();
    assert_eq!((file.size(), file.name().to_str().unwrap()), (SIZE as u64, &*site.server.address("scan.laz")));
    assert_eq!(
        file.read(&[0..589, 65_000..65_536, 7..7], &()).unwrap(),
        [bytes(0..589), bytes(65_000..65_536), vec![]]
    );
    assert_eq!(file.traffic(), Traffic { requests: 1, bytes: 65_536 });
    let ranges = [2_999_000..3_000_000, 65_530..65_540, 100_000..100_001, 1_000_000..1_500_000];
    let read = file.read(&ranges, &()).unwrap();
    for (range, read) in ranges.iter().zip(&read) {
        assert!(*read == bytes(range.clone()), "{range:?}");
    }
    let after = file.traffic();
    assert_eq!(after.requests, 4, "two are near each other");
    let heads: Vec<String> = site.server.heads().iter().map(|head| head.to_lowercase()).collect();
    assert!(heads[0].contains("range: bytes=0-65535\r\n") && !heads[0].contains("if-range"), "{}", heads[0]);
    assert!(heads[1..].iter().all(|head| head.contains("if-range: \"first\"\r\n")), "of the version that was opened");
    assert_eq!(file.read(&ranges, &()).unwrap(), read, "the same bytes again");
    assert_eq!(file.traffic(), after, "from memory");
    let counts = site.server.counts();
    assert_eq!((counts.requests, counts.bytes), (after.requests, after.bytes), "the server counts the same");
    let beyond = file.read(&[0..1, 2_999_999..3_000_001], &()).unwrap_err();
    assert!(matches!(beyond, Error::Malformed { .. }), "{beyond:?}");
}

#[test]
fn large_ranges_are_fetched_in_pieces() {
    let site = Site::new();
    site.add("large", &(0..20 << 20).map(byte).collect::<Vec<u8>>());
    let file = site.open("large").unwrap();
    let all = part(&*file, 0..20 << 20).unwrap();
    assert!(all == bytes(0..20 << 20), "all bytes are in their place");
    assert_eq!(file.traffic().requests, 6);
}

#[test]
fn small_and_empty_files_are_whole() {
    let site = Site::new();
    site.add("small", b"0123456789");
    site.add("empty", b"");
    for path in ["small", "~whole/small"] {
        let file = site.open(path).unwrap();
        assert_eq!((file.size(), part(&*file, 3..7).unwrap()), (10, b"3456".to_vec()), "{path}");
        assert_eq!(file.traffic().requests, 1, "{path}");
    }
    for path in ["empty", "~whole/empty"] {
        assert_eq!(site.open(path).unwrap().size(), 0, "{path}");
    }
}

#[test]
fn a_server_without_ranges_gives_all_of_what_is_small() {
    let site = Site::new();
    let notes = Notes::default();
    let file = open(&site.server.address("~whole/scan.laz"), &quick(), &notes).unwrap();
    assert_eq!(*notes.0.lock().unwrap(), ["its server sends no parts of files; all 3000000 bytes were loaded"]);
    assert_eq!(part(&*file, 2_000_000..2_000_100).unwrap(), bytes(2_000_000..2_000_100));
    assert_eq!(file.traffic().requests, 1);
    let less = RemoteOptions { cache: 1_000_000, ..quick() };
    let told = open(&site.server.address("~whole/scan.laz"), &less, &()).unwrap_err().to_string();
    let what = "the server sends no parts of files, and more than 1000000 bytes are not loaded whole; download it";
    assert!(told.ends_with(what), "{told}");
}

#[test]
fn names_may_have_any_characters() {
    let site = Site::new();
    for name in ["a b", "ä+&=;", "a|b^c{d}[e]", "50%", "a'b\"c<d>", "~", "a:b@c"] {
        site.add(name, name.as_bytes());
        let encoded = name.replace('%', "%25");
        let file = open(&site.server.address(&encoded), &quick(), &()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(part(&*file, 0..name.len() as u64).unwrap(), name.as_bytes(), "{name}");
        let folder = open_folder(&site.server.address(""), &quick()).unwrap();
        assert_eq!(folder.read(&[name.to_owned()], 99, &()).unwrap(), [name.as_bytes()], "{name}");
    }
}

#[test]
fn queries_are_sent_and_not_shown() {
    let site = Site::new();
    let file = site.open("scan.laz?X-Amz-Signature=abc&b=%20").unwrap();
    assert_eq!(file.name().to_str().unwrap(), site.server.address("scan.laz?…"));
    assert!(site.server.heads()[0].starts_with("GET /scan.laz?X-Amz-Signature=abc&b=%20 HTTP/1.1\r\n"));
    assert!(!format!("{file:?}").contains("abc"), "{file:?}");
    assert!(site.fault("~404/a?secret=abc").starts_with("the server answers 404"));
}

#[test]
fn headers_reach_only_the_host_they_are_for() {
    let site = Site::new();
    let headers: Vec<Header> =
        ["Authorization: Bearer abc", "X-Key: def"].into_iter().map(|header| header.parse().unwrap()).collect();
    let options = RemoteOptions { headers, ..quick() };
    let with = |path: &str| {
        let before = site.server.heads().len();
        let file = open(&site.server.address(path), &options, &()).unwrap();
        part(&*file, 1_000_000..1_000_001).unwrap();
        let heads = site.server.heads()[before..].to_vec();
        heads.iter().map(|head| (head.contains("Bearer abc"), head.contains("def"))).collect::<Vec<_>>()
    };
    assert_eq!(with("scan.laz"), [(true, true); 2]);
    assert_eq!(with("~moved/scan.laz"), [(true, true); 3], "it stays on the host, and is not moved again");
    assert_eq!(with("~elsewhere/scan.laz"), [(true, true), (false, false), (false, false)]);
    let told = open(&site.server.address("~elsewhere/~401/a"), &options, &()).unwrap_err().to_string();
    let what = "it redirects to localhost, which answers 401 and gets no headers; give the address there";
    assert!(told.ends_with(what), "{told}");
    let user = site.server.address("scan.laz").replace("http://", "http://me:secret@");
    let file = open(&user, &quick(), &()).unwrap();
    assert_eq!(file.name().to_str().unwrap(), site.server.address("scan.laz"), "the password is not shown");
    assert!(site.server.heads().last().unwrap().to_lowercase().contains("authorization: basic bwu6c2vjcmv0"));
}

#[test]
fn cancelling_ends_waits_at_once() {
    let site = Site::new();
    let options = RemoteOptions { idle_timeout: Duration::from_secs(20), ..RemoteOptions::default() };
    let file = open(&site.server.address("~silent:0/scan.laz"), &options, &()).unwrap();
    assert_eq!(file.size(), SIZE as u64);
    for path in ["~silent/scan.laz", "~stalls/scan.laz", "~busy/scan.laz"] {
        let start = Instant::now();
        let until = Until(start + Duration::from_millis(100));
        let outcome = open(&site.server.address(path), &options, &until);
        assert!(matches!(outcome, Err(Error::Cancelled)), "{path}: {outcome:?}");
        assert!(start.elapsed() < Duration::from_secs(1), "{path}: {:?}", start.elapsed());
    }
}

#[test]
fn many_ranges_share_the_delay() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a"), vec![7; 60 << 20]).unwrap();
    let server = Server::start(folder.path(), Duration::from_millis(50)).unwrap();
    let file = open(&server.address("a"), &quick(), &()).unwrap();
    // Each by itself: more than 64 KB are between them.
    let ranges: Vec<_> = (0..200).map(|at: u64| at * 300_000 + 100_000..at * 300_000 + 200_000).collect();
    let start = Instant::now();
    let read = file.read(&ranges, &()).unwrap();
    let seconds = start.elapsed().as_secs_f64();
    let traffic = file.traffic();
    let connections = server.counts().connections;
    println!("{} requests, {} bytes, {connections} connections, {seconds:.2} s", traffic.requests, traffic.bytes);
    assert!(connections <= 13, "{connections} connections");
    assert!(read.iter().all(|bytes| bytes.len() == 100_000), "all of them");
    assert_eq!(traffic, Traffic { requests: 201, bytes: 65_536 + 200 * 100_000 });
    assert!(seconds < 5.0, "one after the other it takes 10 s: {seconds:.2} s");
}

#[test]
fn addresses_are_told_from_files() {
    for address in ["http://a", "HTTPS://a/b", "s3://a/b", "gs://", "az://a"] {
        assert!(is_address(address), "{address}");
    }
    for name in ["a.laz", "c:\\a", "/http://a", "zenoh://a", "scene:figure", "http:/a", ""] {
        assert!(!is_address(name), "{name}");
    }
}

#[test]
fn files_of_a_client_share_connections_and_memory() {
    let site = Site::new();
    site.add("other", &[9; 200_000]);
    let client = Client::new(RemoteOptions { cache: 450_000, ..quick() });
    let [file, other] = ["scan.laz", "other"].map(|path| client.open(&site.server.address(path), &()).unwrap());
    let range = 100_000..200_000;
    assert_eq!(part(&*file, range.clone()).unwrap(), bytes(range.clone()));
    assert_eq!(part(&*other, range.clone()).unwrap(), [9; 100_000], "the same range of another file");
    assert_eq!([&file, &other].map(|file| file.traffic().requests), [2, 2], "each counts its own");
    assert_eq!(part(&*file, range.clone()).unwrap(), bytes(range.clone()));
    assert_eq!(site.server.counts().requests, 4, "both are kept");
    for at in 0..5 {
        part(&*file, 500_000 + at * 100_000..600_000 + at * 100_000).unwrap();
    }
    let before = site.server.counts().requests;
    part(&*other, range.clone()).unwrap();
    part(&*file, range).unwrap();
    assert!(site.server.counts().requests > before, "there is no room for all");
    assert_eq!(site.server.counts().connections, 1, "one after the other");
}
