//! Files of a folder.

use std::io::Write as _;

use autosplats_cloud::{Error, Traffic};
use flate2::{Compression, write::GzEncoder};

use crate::{Site, open_folder, quick};

#[test]
fn files_are_read_whole_and_kept() {
    let site = Site::new();
    for at in 0..40 {
        site.add(&format!("tree/data/{at}"), &[at; 1000]);
    }
    let folder = open_folder(&site.server.address("tree/ept.json?sas=abc"), &quick()).unwrap();
    assert_eq!(folder.name().to_str().unwrap(), site.server.address("tree/?…"));
    let names: Vec<String> = (0..40).map(|at| format!("data/{at}")).collect();
    let read = folder.read(&names, 1000, &()).unwrap();
    assert!(read.iter().enumerate().all(|(at, bytes)| *bytes == [at as u8; 1000]), "each at its place");
    assert_eq!(folder.traffic(), Traffic { requests: 40, bytes: 40_000 });
    assert!(site.server.heads().iter().all(|head| head.contains("?sas=abc ")), "the query goes with each");
    assert_eq!(folder.read(&names, 1000, &()).unwrap(), read);
    assert_eq!(folder.traffic().requests, 40, "from memory");
    for limit in [999, 10] {
        let told = folder.read(&names[..1], limit, &()).unwrap_err();
        assert!(matches!(told, Error::Unsupported { .. }), "{told:?}");
    }
}

#[test]
fn faults_of_files_name_them() {
    let site = Site::new();
    site.add("a", &[1; 1000]);
    let read = |path: &str, name: &str, most: u64| {
        let folder = open_folder(&site.server.address(path), &quick()).unwrap();
        let error = folder.read(&[name.to_owned()], most, &()).unwrap_err().to_string();
        error.strip_prefix(&format!("{}: ", site.server.address(&format!("{path}{name}")))).unwrap().to_owned()
    };
    assert_eq!(read("", "b", 9), "the server answers 404, Status404: there is no such file; check the address");
    assert_eq!(read("", "a", 9), "it has more than the 9 bytes that such a file may have");
    assert_eq!(read("~endless/", "a", 5000), "it has more than the 5000 bytes that such a file may have");
    assert_eq!(read("~reset/", "a", 9), "the connection broke off (5 tries); try again later");
    assert_eq!(read("~gzip/", "a", 9999), "what the server compressed is damaged; try again");
    let folder = open_folder(&site.server.address("~busy:2/"), &quick()).unwrap();
    assert_eq!(folder.read(&["a".to_owned()], 1000, &()).unwrap(), [[1; 1000]]);
}

#[test]
fn compressed_answers_are_unpacked_within_the_limit() {
    let site = Site::new();
    let mut packed = GzEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&[b' '; 100_000]).unwrap();
    site.add("a", &packed.finish().unwrap());
    let folder = open_folder(&site.server.address("~gzip/"), &quick()).unwrap();
    let read = |most| folder.read(&["a".to_owned()], most, &());
    assert!(matches!(read(99_999), Err(Error::Unsupported { .. })), "a little too large");
    assert!(read(100_000).unwrap()[0] == [b' '; 100_000], "as it was");
}
