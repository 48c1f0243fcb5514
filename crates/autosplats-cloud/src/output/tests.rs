use std::{
    fs,
    io::{Error, ErrorKind, Write as _},
    path::{Path, PathBuf},
    time::{Duration, SystemTime},
};

use super::{
    Draft, Existing, Output,
    temporary::{ABANDONED_AFTER, PREFIX, computer, sweep},
    write_whole,
};

fn write(output: Output<'_>, text: &str) -> Result<u64, Error> {
    write_whole(output, |error| error, |file| file.write_all(text.as_bytes()))
}

fn kept(path: &Path) -> Output<'_> {
    Output { path, existing: Existing::Keep }
}

fn refused(output: Output<'_>) -> Option<ErrorKind> {
    write(output, "new").err().map(|error| error.kind())
}

fn text(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Names in a folder, in order.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut names: Vec<_> =
        entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn nothing_is_replaced_that_is_to_be_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a");
    assert_eq!(write(kept(&path), "first").ok(), Some(5), "there is none");
    assert_eq!(refused(kept(&path)), Some(ErrorKind::AlreadyExists));
    // A file that comes while the draft is made.
    let other = folder.path().join("b");
    let draft = Draft::begin(kept(&other), ".tmp").expect("there is none");
    fs::write(&other, "meanwhile").expect("written");
    assert_eq!(draft.finish().map_err(|error| error.kind()), Err(ErrorKind::AlreadyExists));
    assert_eq!([text(&path), text(&other)], ["first", "meanwhile"], "both stay");
    assert_eq!(names(folder.path()), ["a", "b"], "and no draft");
    assert_eq!(write((&path).into(), "second").ok(), Some(6), "but replaced where that is said");
    assert_eq!(text(&path), "second");
}

#[test]
fn of_many_at_once_exactly_one_makes_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    for round in 0..20 {
        let path = folder.path().join(round.to_string());
        let made: Vec<bool> = std::thread::scope(|scope| {
            let begin = || scope.spawn(|| write(kept(&path), "x").is_ok());
            let threads = [(); 8].map(|()| begin());
            threads.map(|thread| thread.join().expect("no panic")).into()
        });
        assert_eq!(made.into_iter().filter(|&made| made).count(), 1, "round {round}");
    }
    assert_eq!(names(folder.path()).len(), 20, "no draft stays");
}

#[test]
fn names_that_no_file_can_have_are_refused_at_once() {
    let folder = tempfile::tempdir().expect("a folder");
    let begin = |name: &str| Draft::begin(&folder.path().join(name), ".tmp").err().map(|error| error.kind());
    assert_eq!(begin(""), Some(ErrorKind::IsADirectory), "the folder itself");
    assert_eq!(begin("a.png/"), Some(ErrorKind::IsADirectory), "a name of a folder");
    assert_eq!(begin("nowhere/a.png"), Some(ErrorKind::NotFound));
    assert!(begin(&"a".repeat(300)).is_some(), "too long");
    assert_eq!(names(folder.path()), [""; 0], "nothing is left");
}

#[cfg(unix)]
#[test]
fn links_are_followed_and_stay() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    fs::create_dir(path("elsewhere")).expect("a folder");
    fs::write(path("elsewhere/a"), "old").expect("written");
    symlink("elsewhere/a", path("link")).expect("a link");
    symlink("elsewhere/b", path("dangling")).expect("a link");
    symlink("second", path("first")).expect("a link");
    symlink("first", path("second")).expect("a link");
    symlink("missing/a", path("away")).expect("a link");
    for name in ["link", "dangling", "first", "away"] {
        assert!(refused(kept(&path(name))).is_some(), "{name}: something is there");
    }
    for name in ["link", "dangling"] {
        write((&path(name)).into(), "new").expect("written");
        assert!(path(name).symlink_metadata().expect("it is there").is_symlink(), "{name} stays a link");
        assert_eq!(text(&path(name)), "new", "{name}");
    }
    assert_eq!(names(&path("elsewhere")), ["a", "b"], "what they point to");
    for name in ["first", "away"] {
        assert!(refused((&path(name)).into()).is_some(), "{name} points to nothing that can be made");
        assert!(path(name).symlink_metadata().expect("it is there").is_symlink(), "{name} stays");
    }
}

#[cfg(unix)]
#[test]
fn access_rights_and_owner_are_kept() {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, chown};
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("private");
    fs::write(&path, "old").expect("written");
    let set = |mode: u32| fs::set_permissions(&path, fs::Permissions::from_mode(mode)).expect("it is ours");
    let mode = || fs::metadata(&path).expect("a file").mode() & 0o7777;
    for wanted in [0o600, 0o640, 0o666, 0o755] {
        set(wanted);
        let mut draft = Draft::begin(&path, ".tmp").expect("it begins");
        let while_written = fs::metadata(draft.path()).expect("a file").mode() & 0o7777;
        draft.file().write_all(b"new").expect("written");
        draft.finish().expect("in place");
        assert_eq!((while_written, mode()), (wanted, wanted), "private from the beginning");
    }
    // Only the superuser can give files away.
    if chown(&path, Some(12_345), Some(54_321)).is_ok() {
        write((&path).into(), "newer").expect("written");
        let file = fs::metadata(&path).expect("a file");
        assert_eq!((file.uid(), file.gid(), mode()), (12_345, 54_321, 0o755), "the owner's");
    }
    set(0o444);
    assert_eq!(refused((&path).into()), Some(ErrorKind::PermissionDenied), "read-only");
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_written_into() {
    use std::os::unix::fs::FileTypeExt as _;
    let folder = tempfile::tempdir().expect("a folder");
    let pipe = folder.path().join("pipe");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo is there");
    assert!(made.success(), "a pipe can be made");
    for output in [kept(&pipe), (&pipe).into()] {
        let reading = {
            let pipe = pipe.clone();
            std::thread::spawn(move || fs::read_to_string(pipe))
        };
        assert_eq!(write(output, "all of it").ok(), Some(9), "nothing is replaced, so both may");
        assert_eq!(reading.join().expect("no panic").ok().as_deref(), Some("all of it"));
    }
    assert!(pipe.symlink_metadata().expect("it is there").file_type().is_fifo(), "it stays a pipe");
    let socket = folder.path().join("socket");
    let _listener = std::os::unix::net::UnixListener::bind(&socket).expect("a socket");
    assert!(refused((&socket).into()).is_some(), "a socket is refused");
    assert_eq!(names(folder.path()), ["pipe", "socket"], "and stays");
}

#[cfg(unix)]
#[test]
fn what_killed_processes_have_left_is_removed() {
    let folder = tempfile::tempdir().expect("a folder");
    let leave = |name: String, age: Duration| {
        let path: PathBuf = folder.path().join(name);
        let file = fs::File::create(&path).expect("a file");
        file.set_modified(SystemTime::now() - age).expect("it is ours");
    };
    let (own, other) = (computer(), computer() ^ 1);
    leave(format!("{PREFIX}{own:08x}-left.tmp"), Duration::ZERO);
    leave(format!("{PREFIX}{own:08x}-left.mp4"), Duration::ZERO);
    leave(format!("{PREFIX}{other:08x}-used.tmp"), Duration::ZERO);
    leave(format!("{PREFIX}{other:08x}-left.tmp"), 2 * ABANDONED_AFTER);
    leave("mine.tmp".into(), 2 * ABANDONED_AFTER);
    let draft = Draft::begin(&folder.path().join("a"), ".tmp").expect("it begins");
    let used = draft.path().file_name().expect("a name").to_string_lossy().into_owned();
    let mut expected = [used, format!("{PREFIX}{other:08x}-used.tmp"), "mine.tmp".into()];
    expected.sort();
    assert_eq!(names(folder.path()), expected, "what is in use stays");
    sweep(folder.path());
    assert_eq!(names(folder.path()), expected, "also the own draft, if another process looks for it");
    draft.finish().expect("in place");
}
