//! `render` of points that move.

#[cfg(unix)]
use crate::common::STORE_INPUT;
use crate::common::{Folder, Outcome};
use serde_json::Value;

/// A folder with `sweep`, four frames of a rising sheet.
fn folder() -> Folder {
    let folder = Folder::new();
    std::fs::create_dir(folder.path("sweep")).expect("a folder");
    for frame in 0..4 {
        let points = (0..900).map(|point| format!("{} {} {}", point % 30, point / 30, frame * 4));
        let rows: Vec<String> = points.collect();
        folder.write(&format!("sweep/scan_{frame}.xyz"), &rows.join("\n"));
    }
    folder
}

fn render(folder: &Folder, options: &[&str]) -> Outcome {
    folder.succeed(&[&["render", "sweep", "--size", "120x90", "--quiet"][..], options].concat())
}

fn pictures(folder: &Folder) -> Vec<String> {
    folder.list().into_iter().filter(|name| name.contains(".png")).collect()
}

#[test]
fn each_frame_has_a_picture() {
    let folder = folder();
    render(&folder, &["-o", "f_%02d.png"]);
    assert_eq!(pictures(&folder), ["f_00.png", "f_01.png", "f_02.png", "f_03.png"], "and nothing else");
    let files: Vec<_> = pictures(&folder).iter().map(|name| folder.read(name)).collect();
    assert!(files.windows(2).all(|pair| pair[0] != pair[1]), "the sheet climbs before a camera that stands still");
    render(&folder, &["-o", "again_%02d.png"]);
    assert_eq!(files[3], folder.read("again_03.png"), "the same frames are the same pictures");
}

#[test]
fn frames_are_chosen_and_numbered_as_they_are() {
    let folder = folder();
    render(&folder, &["--frames", "1..2", "-o", "f.png"]);
    assert_eq!(pictures(&folder), ["f_00001.png", "f_00002.png"], "both ends are included");
    let out = folder.succeed(&["render", "sweep", "--size", "120x90", "--frames", "3..99", "-o", "g.png"]);
    assert!(
        out.stderr.contains("note: sweep has 4 frames, 0 to 3") && out.stderr.contains("1 picture"),
        "{}",
        out.stderr
    );
    render(&folder, &["--frames", "2", "-o", "one.png"]);
    render(&folder, &["--frames", "2", "-o", "one_%d.png"]);
    assert_eq!(folder.read("one.png"), folder.read("one_2.png"), "one picture has the name that it is given");
    folder.fail(&["render", "sweep", "--frames", "4..", "-o", "f.png"], 2, &["sweep", "4 frames", "0 to 3"]);
    folder.fail(&["render", "sweep", "--frames", "3..2", "-o", "f.png"], 2, &["--frames"]);
}

#[test]
fn frames_of_few_points_have_fewer_neighbours() {
    let folder = folder();
    folder.write("sweep/scan_4.xyz", "0 0 0\n9 0 0\n0 9 0\n9 9 0");
    let out = folder.succeed(&["render", "sweep", "--size", "120x90", "-k", "10", "-o", "f_%d.png"]);
    let told: Vec<_> = out.stderr.lines().filter(|line| line.contains("neighbours")).collect();
    assert!(told.len() == 1 && told[0].contains("4 points cannot have 10 neighbours each; using 3"), "{told:?}");
}

#[test]
fn resume_skips_existing_pictures() {
    let folder = folder();
    folder.write("f_1.png", "kept");
    render(&folder, &["--resume", "-o", "f_%d.png"]);
    assert_eq!(pictures(&folder).len(), 4, "the others are made");
    assert_eq!(folder.read("f_1.png"), b"kept", "this one was there");
    folder.fail(&["render", "sweep", "--resume", "-o", "f.mp4"], 2, &["--resume", "f_%05d.png"]);
    let averaged = ["render", "sweep", "--resume", "--frames-averaged", "4", "-o", "f_%d.png"];
    folder.fail(&averaged, 2, &["--resume", "depends on earlier ones"]);
}

#[test]
fn json_tells_each_frame() {
    let folder = folder();
    let out = render(&folder, &["--json", "--fps", "4", "-o", "f_%d.png"]).stdout;
    let lines: Vec<Value> = out.lines().map(|line| serde_json::from_str(line).expect("a line of JSON")).collect();
    let numbers: Vec<_> = lines.iter().map(|line| line["frame"].as_u64()).collect();
    assert_eq!(numbers, [Some(0), Some(1), Some(2), Some(3)]);
    assert_eq!(lines[3]["seconds"], 0.75, "four a second");
    assert_eq!(lines[2]["counts"]["points"], 900);
    assert_eq!(lines[1]["path"], "f_1.png");
}

#[test]
fn a_folder_alone_is_its_first_frame() {
    let folder = folder();
    let out = folder.succeed(&["render", "sweep", "--size", "120x90", "-o", "first.png"]);
    assert!(out.stderr.contains("sweep: this is the first of 4 frames"), "which is said: {}", out.stderr);
    folder.succeed(&["render", "sweep/scan_0.xyz", "--size", "120x90", "--quiet", "-o", "file.png"]);
    assert_eq!(folder.read("first.png"), folder.read("file.png"), "the same as the file");
}

#[test]
fn frames_without_points_come_before_the_first() {
    let folder = folder();
    for name in ["sweep/scan_0.xyz", "sweep/scan_1.xyz"] {
        folder.write(name, "nan nan nan\nnan nan nan\n");
    }
    let out = folder.succeed(&["render", "sweep", "--size", "120x90", "-o", "first.png"]);
    assert!(out.stderr.contains("sweep: this is frame 2 of 0 to 3, the first with points"), "{}", out.stderr);
    folder.succeed(&["render", "sweep/scan_2.xyz", "--size", "120x90", "--quiet", "-o", "file.png"]);
    assert_eq!(folder.read("first.png"), folder.read("file.png"), "the same as the file");
    let out = folder.succeed(&["render", "sweep", "--size", "120x90", "-o", "f_%d.png"]);
    assert!(out.stderr.contains("2 frames show nothing, the first is frame 0"), "{}", out.stderr);
    let told = folder.succeed(&["info", "sweep"]).stdout;
    assert!(told.contains("frame 2 of 0 to 3, the first with points") && told.contains("900"), "{told}");
    let Some(field) = crate::common::data().map(|data| data.with_file_name("field")) else { return };
    let bag = field.join("bag_b06_empty_then_full.bag").display().to_string();
    let out = folder.succeed(&["convert", &bag, "bag.ply"]);
    assert!(out.stderr.contains("this is frame 1 of 0 to 1, the first with points"), "{}", out.stderr);
    let out = folder.succeed(&["render", &bag, "--frames", "0..", "--size", "120x90", "-o", "g_%d.jpg"]);
    assert!(folder.path("g_1.jpg").exists() && out.stderr.contains("frame 0 shows nothing"), "{}", out.stderr);
}

#[test]
fn an_unreadable_frame_is_reported_and_skipped() {
    let folder = folder();
    folder.write("sweep/scan_2.xyz", "this is no cloud\n");
    let out = folder.succeed(&["render", "sweep", "--size", "120x90", "-o", "f_%d.png"]);
    assert_eq!(pictures(&folder).len(), 4, "the frame before is shown for it");
    assert_eq!(out.stderr.matches("scan_2.xyz").count(), 1, "told once: {}", out.stderr);
    assert_eq!(folder.read("f_1.png"), folder.read("f_2.png"), "as it was");
}

#[test]
fn empty_frames_are_reported() {
    let folder = folder();
    let out = folder.succeed(&["render", "sweep", "--eye", "15,15,2", "--look-at", "15,15.1,12", "-o", "f_%d.png"]);
    assert_eq!(pictures(&folder).len(), 4, "they have a picture as well");
    assert!(out.stderr.contains("note: frame 0 shows nothing"), "behind the eye: {}", out.stderr);
}

#[test]
fn scanners_see_a_part_each() {
    let folder = Folder::new();
    let scan = |count: &str| {
        let line =
            ["render", "scene:figure:20K", "--scan", count, "--frames", "0", "--size", "80x60", "--quiet", "--json"];
        let out = folder.succeed(&[&line[..], &["-o", "f.png"]].concat()).stdout;
        let report: Value = serde_json::from_str(&out).expect("JSON");
        report["counts"]["points"].as_u64().expect("a number of points")
    };
    let [one, four] = ["1", "4"].map(scan);
    assert!(one > 1000 && four > 2 * one, "{one} points by one, {four} by four");
    folder.fail(&["render", "scene:figure", "--scan", "5", "-o", "f.png"], 2, &["--scan"]);
}

#[test]
fn a_film_needs_ffmpeg_and_says_so() {
    let folder = folder();
    let mut command = folder.command(&["render", "sweep", "-o", "f.mp4"]);
    let out = command.env("PATH", "").output().expect("it runs");
    assert_eq!(out.status.code(), Some(2), "before anything is rendered");
    let words = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(words.contains("ffmpeg") && words.contains("f_%05d.png"), "what to do: {words}");
    assert!(!folder.path("f.mp4").exists(), "and nothing is left");
}

#[test]
fn no_picture_takes_the_place_of_an_input() {
    let folder = folder();
    // The third picture is a link to a frame.
    std::fs::copy(folder.path("sweep/scan_2.xyz"), folder.path("kept.xyz")).expect("a copy");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(folder.path("sweep/scan_2.xyz"), folder.path("f_2.png")).expect("a link");
        folder.fail(&["render", "sweep", "-o", "f_%d.png"], 2, &["f_2.png", "overwrite an input"]);
        folder.fail(&["render", "sweep/*.xyz", "-o", "f_%d.png"], 2, &["f_2.png", "overwrite an input"]);
        render(&folder, &["--frames", "0..1", "-o", "f_%d.png"]);
        assert_eq!(folder.read("sweep/scan_2.xyz"), folder.read("kept.xyz"), "as it was");
    }
    folder.fail(&["render", "sweep", "-o", "c_%d.png", "--save-camera", "c_3.png"], 2, &["c_3.png", "two outputs"]);
    folder.write("pose_1.png", "1 0 0 0  0 1 0 0  0 0 1 0");
    let posed = ["render", "sweep", "--pose", "sweep=pose_1.png", "-o", "pose_%d.png"];
    folder.fail(&posed, 2, &["pose_1.png", "overwrite an input"]);
    folder.fail(&["convert", "sweep", "sweep/scan_3.xyz", "--force"], 2, &["scan_3.xyz", "overwrite an input"]);
}

#[test]
fn an_unwritable_picture_is_not_reported() {
    let folder = folder();
    // A folder blocks the third picture.
    std::fs::create_dir(folder.path("f_2.png")).expect("a folder");
    let out = folder.run(&["render", "sweep", "--size", "120x90", "--quiet", "--json", "-o", "f_%d.png"]);
    assert_eq!(out.code, Some(4), "{}", out.stderr);
    assert_eq!(out.stdout.lines().count(), 2, "only of those that are in place: {}", out.stdout);
    assert_eq!(pictures(&folder), ["f_0.png", "f_1.png", "f_2.png"], "and nothing after it");
}

/// Renders a film with a shell script as ffmpeg.
#[cfg(unix)]
fn film(folder: &Folder, script: &str, arguments: &[&str]) -> Outcome {
    let mut command = folder.command(&[&["render"][..], arguments, &["--size", "40x30", "-o", "f.mp4"]].concat());
    let out = command.env("PATH", folder.with_ffmpeg(script)).output().expect("it runs");
    let words = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    Outcome { code: out.status.code(), stdout: words(out.stdout), stderr: words(out.stderr) }
}

#[cfg(unix)]
fn film_pictures(folder: &Folder) -> Vec<Vec<u8>> {
    folder.read("f.mp4").chunks(4 * 40 * 30).map(<[u8]>::to_vec).collect()
}

/// A recording of a rising sheet at these milliseconds: MCAP without chunks, in ROS 1 messages.
fn recording(times: &[u64]) -> Vec<u8> {
    let text = |text: &str| [&(text.len() as u32).to_le_bytes()[..], text.as_bytes()].concat();
    let record = |kind: u8, parts: &[&[u8]]| {
        let body = parts.concat();
        [&[kind][..], &(body.len() as u64).to_le_bytes(), &body].concat()
    };
    let number = |value: u32| value.to_le_bytes();
    let one = 1_u16.to_le_bytes();
    let magic = b"\x89MCAP0\r\n";
    let mut file = [&magic[..], &record(1, &[&text(""), &text("test")])].concat();
    file.extend(record(3, &[&one, &text("sensor_msgs/msg/PointCloud2"), &text("ros1msg"), &text("")]));
    file.extend(record(4, &[&one, &one, &text("/points"), &text("ros1"), &[0; 4]]));
    for (frame, time) in times.iter().enumerate() {
        let place = |point: usize| [(point % 30) as f32, (point / 30) as f32, (frame * 4) as f32];
        let data: Vec<u8> = (0..900).flat_map(|point| place(point).map(f32::to_le_bytes).concat()).collect();
        let stamp = [number((time / 1000) as u32), number((time % 1000) as u32 * 1_000_000)].concat();
        let mut message = [&number(0)[..], &stamp, &text("lidar"), &number(1), &number(900), &number(3)].concat();
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            message.extend([&text(name)[..], &number(4 * axis as u32), &[7], &number(1)].concat());
        }
        message.extend([&[0][..], &number(12), &number(12 * 900), &number(data.len() as u32), &data, &[1]].concat());
        let stamp = (time * 1_000_000).to_le_bytes();
        file.extend(record(5, &[&one, &[0; 4], &stamp, &stamp, &message]));
    }
    file.extend(record(15, &[&[0; 4]]));
    file.extend(record(2, &[&[0; 20]]));
    file.extend_from_slice(magic);
    file
}

#[test]
fn recordings_made_at_once_are_shown_at_once() {
    let folder = Folder::new();
    std::fs::write(folder.path("one.mcap"), recording(&[1000, 1100, 1500])).expect("a recording");
    std::fs::write(folder.path("other.mcap"), recording(&[1200, 1400])).expect("a recording");
    std::fs::write(folder.path("later.mcap"), recording(&[9000, 9300])).expect("a recording");
    let seconds = |others: &[&str]| {
        let arguments = [&["render", "one.mcap"], others, &["--size", "80x60", "--json", "-o", "f_%d.png"]].concat();
        let out = folder.succeed(&arguments);
        let seconds =
            out.stdout.lines().map(|line| serde_json::from_str::<Value>(line).expect("JSON")["seconds"].clone());
        (seconds.map(|seconds| seconds.as_f64().expect("a number")).collect::<Vec<_>>(), out.stderr)
    };
    let (aligned, said) = seconds(&["other.mcap"]);
    assert_eq!(aligned, [0.0, 0.1, 0.2, 0.4, 0.5], "by their stamps");
    assert!(
        said.contains("other.mcap: begins 0.200 s after the first input, by its time stamps"),
        "which is said: {said}"
    );
    let (begun_at_once, said) = seconds(&["later.mcap"]);
    assert_eq!(begun_at_once, [0.0, 0.1, 0.3, 0.5], "stamps that have no time in common say nothing of each other");
    assert!(!said.contains("begins"), "{said}");
}

#[cfg(unix)]
#[test]
fn a_film_shows_each_frame_for_as_long_as_it_lasts() {
    let folder = folder();
    let out = film(&folder, STORE_INPUT, &["sweep", "--fps", "12.5", "--json"]);
    assert_eq!(out.code, Some(0), "{}", out.stderr);
    assert_eq!(film_pictures(&folder).len(), 4, "even frames have a picture each");
    assert!(folder.read("words").starts_with(b"-loglevel error -y"), "by ffmpeg");
    assert!(String::from_utf8_lossy(&folder.read("words")).contains("-r 12.5 "), "at their rate");
    assert!(out.stderr.contains("4 pictures"), "{}", out.stderr);
    let lines: Vec<Value> = out.stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    assert!(lines.len() == 4 && lines.iter().all(|line| line["pictures"] == 1 && line["path"].is_null()), "{lines:?}");

    std::fs::write(folder.path("drive.mcap"), recording(&[0, 100, 500, 520])).expect("a recording");
    let out = film(&folder, STORE_INPUT, &["drive.mcap", "--fps", "10", "--json"]);
    assert_eq!(out.code, Some(0), "{}", out.stderr);
    let lines: Vec<Value> = out.stdout.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let shown: Vec<_> = lines.iter().map(|line| (line["frame"].as_u64(), line["pictures"].as_u64())).collect();
    // Pictures show 0, 0.1, 0.2 s and so on. The last frame is shown for the mean duration.
    assert_eq!(shown, [(Some(0), Some(1)), (Some(1), Some(4)), (Some(2), Some(1)), (Some(3), Some(1))]);
    let pictures = film_pictures(&folder);
    assert_eq!(pictures.len(), 7, "0.69 s");
    assert!(pictures[1..5].iter().all(|picture| *picture == pictures[1]), "it stands still");
    assert!(pictures[0] != pictures[1] && pictures[5] != pictures[4], "and moves on");
}

#[cfg(unix)]
#[test]
fn a_failed_film_is_not_reported() {
    let folder = folder();
    film(&folder, STORE_INPUT, &["sweep", "--quiet"]);
    let whole = folder.read("f.mp4");
    let out = film(&folder, "cat > /dev/null; echo full >&2; exit 1", &["sweep", "--json", "--frames", "0..1"]);
    assert_eq!(out.code, Some(4), "{}", out.stderr);
    assert_eq!(out.stderr.trim(), "error: ffmpeg: full", "why");
    assert!(out.stdout.is_empty(), "no line of a film that is not there");
    assert_eq!(folder.read("f.mp4"), whole, "what was there stays");
}
