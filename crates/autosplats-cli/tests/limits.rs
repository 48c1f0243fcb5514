//! Inputs that fail, lie or change while they are read, and limits of the system. Each run ends in time, by no signal,
//! with the right exit code and at most one line of error.

#![cfg(target_os = "linux")]
#![allow(missing_docs, reason = "a test")]

#[path = "it/common/mod.rs"]
mod common;

use std::fs::{OpenOptions, write};
use std::io::Read as _;
use std::os::unix::process::ExitStatusExt as _;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use autosplats_cloud::Random;
use common::{Folder, rounds};

/// Longest run. Machines that test may be busy, so this is far more than a sound run takes.
const LIMIT: Duration = Duration::from_secs(60);

/// How a run ended: its exit code, or the negative number of the signal that ended it.
#[derive(Debug)]
struct Ended {
    code: i32,
    stderr: String,
}

/// Waits for a command, and does something to its input `after` it has begun.
fn run(command: &mut Command, after: Duration, meanwhile: impl FnOnce()) -> Ended {
    let begun = Instant::now();
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the command starts");
    let mut pipe = child.stderr.take().expect("a pipe");
    let reader = std::thread::spawn(move || {
        let mut text = String::new();
        pipe.read_to_string(&mut text).map(|_| text).expect("standard error is UTF-8")
    });
    sleep(after);
    meanwhile();
    let status = loop {
        if let Some(status) = child.try_wait().expect("the command ends") {
            break status;
        }
        if begun.elapsed() > LIMIT {
            child.kill().expect("the command is ended");
            panic!("{command:?} does not end");
        }
        sleep(Duration::from_millis(2));
    };
    let code = status.code().unwrap_or_else(|| -status.signal().unwrap_or_default());
    Ended { code, stderr: reader.join().expect("the pipe is read") }
}

fn at_once(command: &mut Command) -> Ended {
    run(command, Duration::ZERO, || ())
}

/// The command behind a limit of the shell, such as `-v 500000`.
fn limited(folder: &Folder, limit: &str, arguments: &[&str]) -> Command {
    let inner = folder.command(arguments);
    let mut command = Command::new("sh");
    command.args(["-c", &format!("ulimit {limit} && exec \"$0\" \"$@\"")]);
    command.arg(inner.get_program()).args(inner.get_args()).stdin(Stdio::null());
    command.current_dir(inner.get_current_dir().expect("a folder"));
    command
}

/// Fails unless the run ended with one of these codes: without errors, or with one line.
fn expect(ended: &Ended, codes: &[i32], about: &str) {
    assert!(codes.contains(&ended.code), "{about}: {ended:?}");
    let errors: Vec<&str> = ended.stderr.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), usize::from(ended.code != 0), "{about}: {ended:?}");
    assert!(ended.code == 0 || ended.stderr.lines().last() == errors.last().copied(), "{about}: {ended:?}");
}

/// A folder with a file of each format that may be cut while it is read.
fn with_files(points: &str) -> (Folder, [&'static str; 6]) {
    let folder = Folder::new();
    let names = ["a.ply", "a.las", "a.laz", "a.pcd", "a.e57", "a.xyz"];
    folder.succeed(&["convert", &format!("scene:figure:{points}"), names[0]]);
    names[1..].iter().for_each(|name| {
        folder.succeed(&["convert", names[0], name]);
    });
    (folder, names)
}

#[test]
fn files_that_are_cut_while_they_are_read() {
    let (folder, names) = with_files("60K");
    let mut told = 0;
    let mut random = Random::new(20_261_131, 0);
    for name in names {
        let whole = folder.read(name);
        let begun = Instant::now();
        folder.succeed(&["info", "--scan", name]);
        let takes = begun.elapsed();
        for _ in 0..8 * rounds() {
            write(folder.path(name), &whole).expect("written");
            let cut = || {
                let file = OpenOptions::new().write(true).open(folder.path(name)).expect("opened");
                file.set_len(whole.len() as u64 / 3).expect("cut");
            };
            let mut command = folder.command(&["info", "--scan", name]);
            let ended = run(&mut command, takes.mul_f64(0.4 * random.unit()), cut);
            expect(&ended, &[0, 3], name);
            told += usize::from(ended.stderr.contains("the file changed while it was read; start again"));
        }
    }
    assert!(told > 0, "no file was cut in time, so nothing was tested");
}

#[test]
fn what_a_file_has_lost_is_told() {
    let (folder, names) = with_files("20K");
    for name in names.into_iter().filter(|name| ["a.ply", "a.las", "a.pcd"].contains(name)) {
        let half = format!("half-{name}");
        let whole = folder.read(name);
        write(folder.path(&half), &whole[..whole.len() / 2]).expect("written");
        for command in [&["convert"][..], &["normals"], &["convert", "--memory", "300K"]] {
            folder.fail(&[command, &[&half, "none.ply"]].concat(), 3, &["is cut off", "--salvage"]);
        }
        folder.fail(&["convert", &half, "none.copc.laz"], 3, &["is cut off", "--salvage"]);
        for output in ["out.ply", "out.copc.laz"] {
            let kept = folder.succeed(&["convert", &half, output, "--salvage", "--force", "--quiet"]);
            assert!(kept.stderr.starts_with("warning: ") && kept.stderr.contains("are lost"), "{}", kept.stderr);
        }
        let shown = folder.succeed(&["render", &half, "-o", "a.png", "--size", "40x30", "--quiet"]);
        assert!(shown.stderr.starts_with("warning: ") && shown.stderr.contains("are lost"), "{}", shown.stderr);
        let described = folder.succeed(&["info", &half]);
        assert!(described.stdout.contains("is cut off"), "{}", described.stdout);
    }
}

/// Most memory in bytes that is a process's own while it runs. Pages of files are not: the system takes them back.
fn peak(command: &mut Command) -> u64 {
    let mut child = command.stdout(Stdio::null()).spawn().expect("the command starts");
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    while child.try_wait().expect("the command ends").is_none() {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let own = text.lines().find_map(|line| line.strip_prefix("RssAnon:")?.strip_suffix("kB")?.trim().parse().ok());
        most = most.max(own.unwrap_or(0_u64) << 10);
        sleep(Duration::from_millis(1));
    }
    assert!(child.wait().expect("it has ended").success(), "{command:?}");
    most
}

#[test]
fn rendering_takes_the_memory_that_doctor_tells() {
    const POINTS: u64 = 5_000_000;
    let folder = Folder::new();
    let told: serde_json::Value = serde_json::from_str(&folder.succeed(&["doctor", "--json"]).stdout).expect("JSON");
    let told = |what: &str| told["memory"][what].as_u64().unwrap_or_else(|| panic!("{what}: {told}"));
    folder.succeed(&["convert", &format!("scene:cathedral:{POINTS}"), "a.ply", "--quiet"]);
    let small = ["--size", "80x60", "--supersample", "1", "--quiet"];
    for name in ["a.ply", "a.las", "a.laz", "a.pcd", "a.copc.laz"] {
        if name != "a.ply" {
            folder.succeed(&["convert", "a.ply", name, "--quiet"]);
        }
        let taken = peak(&mut folder.command(&[&["render", name, "-o", "a.png"], &small[..]].concat()));
        let expected = told("program") + POINTS * told("per_point");
        assert!(taken.abs_diff(expected) < 64 << 20, "{name}: {taken} bytes, told were {expected}");
    }
}

#[test]
fn limits_of_memory() {
    let (folder, _) = with_files("20K");
    let jobs: [&[&str]; 6] = [
        &["info", "a.ply", "--scan"],
        &["convert", "a.las", "out.ply", "--force"],
        &["normals", "a.ply", "out.ply", "--force"],
        &["render", "a.ply", "-o", "a.png", "--size", "1920x1080"],
        &["render", "scene:cathedral:400M", "-o", "a.png", "--size", "40x30"],
        &["convert", "scene:figure:300K", "out.laz", "--force"],
    ];
    for (job, arguments) in jobs.iter().enumerate() {
        for kibibytes in ["400000", "1100000"] {
            let limit = format!("-v {kibibytes}");
            let ended = at_once(&mut limited(&folder, &limit, arguments));
            expect(&ended, &[0, 6], &format!("{limit}: {arguments:?}"));
            assert!(job != 4 || ended.code == 6, "6 GB of points: {ended:?}");
        }
    }
    assert!(folder.list().iter().all(|name| !name.starts_with('.')), "nothing is left: {:?}", folder.list());
}

#[test]
fn limits_of_open_files() {
    let (folder, names) = with_files("20K");
    for limit in ["-n 4", "-n 6", "-n 12"] {
        for name in names {
            let ended = at_once(&mut limited(&folder, limit, &["convert", name, "out.ply", "--force"]));
            expect(&ended, &[0, 3, 4], &format!("{limit}: {name}"));
        }
    }
}

/// A record of a ROS bag: fields and data.
fn bag_record(fields: &[(&str, &[u8])], data: &[u8]) -> Vec<u8> {
    let field = |(name, value): &(&str, &[u8])| {
        let len = (name.len() + 1 + value.len()) as u32;
        [&len.to_le_bytes(), name.as_bytes(), b"=", value].concat()
    };
    let header: Vec<u8> = fields.iter().flat_map(field).collect();
    [&(header.len() as u32).to_le_bytes(), &header[..], &(data.len() as u32).to_le_bytes(), data].concat()
}

/// A ROS bag with one chunk, which claims to unpack to `size` bytes.
fn bag(compression: &str, size: u32, data: &[u8]) -> Vec<u8> {
    let fields = [("op", &[5][..]), ("compression", compression.as_bytes()), ("size", &size.to_le_bytes())];
    [b"#ROSBAG V2.0\n", &bag_record(&fields, data)[..]].concat()
}

/// An MCAP file with one chunk, which claims to unpack to `size` bytes.
fn mcap(compression: &str, size: u64, data: &[u8]) -> Vec<u8> {
    let name = [&(compression.len() as u32).to_le_bytes(), compression.as_bytes()].concat();
    let chunk = [&[0; 16][..], &size.to_le_bytes(), &[0; 4], &name, &(data.len() as u64).to_le_bytes(), data].concat();
    [b"\x89MCAP0\r\n", &[6][..], &(chunk.len() as u64).to_le_bytes(), &chunk].concat()
}

/// A Zstandard frame of `blocks` blocks, each of four bytes that stand for 128 KiB of zeros.
fn zeros(blocks: usize) -> Vec<u8> {
    // The magic number, no content size, a window of 8 MiB; then blocks of one repeated byte, none of them the last but
    // one.
    let block = |last: usize| [&((1 << 20) | 2 | last as u32).to_le_bytes()[..3], &[0]].concat();
    let all = (1..=blocks).flat_map(|index| block(usize::from(index == blocks)));
    [0x28, 0xb5, 0x2f, 0xfd, 0, 0x68].into_iter().chain(all).collect()
}

#[test]
fn archives_unpack_to_no_more_than_points_could_be() {
    let folder = Folder::new();
    let empty_stream = b"BZh9\x17\x72\x45\x38\x50\x90\0\0\0\0";
    let repeated: Vec<u8> =
        std::iter::repeat_n(&b"#\n"[..], 1 << 19).flatten().copied().chain(*b"1 2 3\n4 5 6\n").collect();
    let files = [
        ("large.mcap", mcap("zstd", 4 << 30, &zeros(1 << 15)), 3),
        ("vast.mcap", mcap("zstd", u64::MAX, &zeros(1)), 3),
        ("large.bag", bag("bz2", u32::MAX, empty_stream), 3),
        ("empty.bag", bag("bz2", 1 << 20, &empty_stream.repeat(200_000)), 3),
        ("large.xyz.gz", gzip(&repeated), 0),
    ];
    for (name, bytes, code) in files {
        write(folder.path(name), bytes).expect("written");
        let begun = Instant::now();
        // Half of what the smallest of the larger ones would take.
        let ended = at_once(&mut limited(&folder, "-v 2000000", &["info", name]));
        expect(&ended, &[code], name);
        assert!(begun.elapsed() < Duration::from_secs(20), "{name}: {:?}", begun.elapsed());
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    use std::io::Write as _;
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    encoder.write_all(bytes).and_then(|()| encoder.finish()).expect("memory")
}

#[test]
fn pipes_are_read_once_and_devices_never() {
    let folder = Folder::with_sphere();
    for command in ["info /dev/stdin", "convert /dev/stdin out.ply --force", "render /dev/stdin -o a.png --size 40x30"]
    {
        let piped = format!("cat sphere.ply | \"$0\" {command}");
        let program = folder.command(&[]).get_program().to_owned();
        let mut shell = Command::new("sh");
        shell.args(["-c", &piped]).arg(program).current_dir(folder.path(".")).stdin(Stdio::null());
        expect(&at_once(&mut shell), &[0], command);
    }
    assert!(folder.succeed(&["info", "out.ply"]).stdout.contains("6,000"), "all points");
    for device in ["/dev/zero", "/dev/null", "/dev/urandom"] {
        folder.fail(&["info", device], 3, &[device, "device"]);
        folder.fail(&["convert", device, "b.ply"], 3, &[device, "device"]);
        folder.fail(&["convert", "sphere.ply", "b.ply", "--pose", &format!("sphere.ply={device}")], 3, &["device"]);
        folder.fail(&["render", "sphere.ply", "-o", "b.png", "--camera", device], 2, &["device"]);
    }
}

#[test]
fn the_first_points_that_are_any_place_the_camera() {
    let folder = Folder::new();
    let frame = |point: &dyn Fn(usize) -> String| common::ply(&["float x", "float y", "float z"], (0..500).map(point));
    let nowhere = frame(&|_| "nan nan nan".into());
    let somewhere = frame(&|index| format!("{} {} 0", index % 25, index / 25));
    folder.write("frames", &(nowhere + &somewhere + &somewhere));
    let mut command = folder.command(&["render", "-", "-o", "frame_%02d.png", "--size", "40x30"]);
    command.stdin(std::fs::File::open(folder.path("frames")).expect("opened"));
    let ended = at_once(&mut command);
    expect(&ended, &[0], "a first frame of NaN");
    assert_eq!(folder.list().iter().filter(|name| name.ends_with(".png")).count(), 2, "{:?}", folder.list());
}

#[test]
fn values_that_no_file_makes_right() {
    let folder = Folder::with_sphere();
    let render = |more: &[&str]| [&["render", "sphere.ply", "-o", "a.png"], more].concat().join(" ");
    for (arguments, code, words) in [
        ("convert sphere.ply a.ply --columns nonsense".to_owned(), 2, ["--columns", "x is named 0 times"]),
        ("normals sphere.ply a.ply -k 2".into(), 2, ["-k", "within 3 to 1024"]),
        (render(&["--gap-factor", "1e300"]), 2, ["--gap-factor", "1e300"]),
        (render(&["--gap-factor", "inf"]), 2, ["--gap-factor", "inf"]),
    ] {
        folder.fail(&arguments.split(' ').collect::<Vec<_>>(), code, &words);
    }
    folder.write("far.txt", "1e308 0 0 0\n0 1e308 0 0\n0 0 1e308 0\n");
    folder.fail(&["convert", "sphere.ply", "a.ply", "--pose", "sphere.ply=far.txt"], 3, &["--pose", "6000 of 6000"]);
    let holes = std::fs::File::create(folder.path("holes.gltf")).expect("a file");
    holes.set_len(1 << 30).expect("holes");
    folder.fail(&["info", "holes.gltf"], 3, &["holes.gltf"]);
    let begun = Instant::now();
    std::fs::rename(folder.path("holes.gltf"), folder.path("holes.ply")).expect("renamed");
    write(folder.path("holes.ply"), "ply\n").expect("written");
    OpenOptions::new().write(true).open(folder.path("holes.ply")).expect("opened").set_len(1 << 30).expect("holes");
    folder.fail(&["info", "holes.ply"], 3, &["holes.ply", "a header line of more than"]);
    assert!(begun.elapsed() < Duration::from_secs(5), "the rest is not searched: {:?}", begun.elapsed());
}
