//! The command within a process: called again and again, with the caller's streams.

use std::io::Write;
use std::sync::{Arc, Mutex};

use autosplats_cli::{Console, run};

use crate::common::Folder;

/// A stream that keeps what is written to it.
#[derive(Clone, Default)]
struct Stream(Arc<Mutex<Vec<u8>>>);

impl Stream {
    fn text(&self) -> String {
        String::from_utf8(self.0.lock().expect("no writer fails").clone()).expect("UTF-8")
    }
}

impl Write for Stream {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().expect("no writer fails").write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn calls_follow_each_other() {
    let folder = Folder::with_sphere();
    let [sphere, picture] = ["sphere.ply", "out.png"].map(|name| folder.path(name).display().to_string());
    let mut pictures = Vec::new();
    for threads in ["1", "3", "2"] {
        let (data, messages) = (Stream::default(), Stream::default());
        let console = Console::new(data.clone(), messages.clone());
        let words = ["render", &sphere, "-o", &picture, "--size", "64x64", "--threads", threads, "--json"];
        assert_eq!(run(words, &console), 0, "{}", messages.text());
        assert!(data.text().starts_with('{') && data.text().ends_with("}\n"), "{}", data.text());
        assert!(messages.text().contains("6000 points"), "{}", messages.text());
        pictures.push(folder.read("out.png"));
        assert_eq!(run(["render", "none.ply", "-o", &picture], &console), 3, "there is no such file");
        assert!(messages.text().contains("error: none.ply: No such file"), "{}", messages.text());
    }
    assert!(pictures.iter().all(|picture| *picture == pictures[0]), "with any number of threads");
}

#[test]
fn a_request_ends_the_command() {
    let folder = Folder::with_sphere();
    let [sphere, copy] = ["sphere.ply", "copy.ply"].map(|name| folder.path(name).display().to_string());
    let messages = Stream::default();
    let console = Console::new(Stream::default(), messages.clone());
    assert!(console.interrupt().request(), "reading has an end of its own");
    assert_eq!(run(["convert", &sphere, &copy], &console), 130, "{}", messages.text());
    assert_eq!(messages.text(), "error: interrupted\n");
    assert_eq!(folder.list(), ["sphere.ply"], "nothing is left behind");
    assert_eq!(run(["convert", &sphere, &copy], &console), 0, "the request ended with its command");
}
