//! `doctor`, `completions` and `man`.

use crate::common::Folder;
use serde_json::Value;

#[test]
fn a_healthy_machine_is_reported() {
    let folder = Folder::new();
    let text = folder.succeed(&["doctor"]).stdout;
    for said in ["cpu", "gpu", "gpu", "thread", "simd", "memory", "coloured points", "read back", "PLY"] {
        assert!(text.contains(said), "'{said}' is not in\n{text}");
    }
    let outcome = folder.succeed(&["doctor", "--json"]);
    let found: Value = serde_json::from_str(&outcome.stdout).expect("it is JSON");
    assert_eq!(found["ok"], true, "{found}");
    let devices = found["adapters"].as_array().expect("devices are listed");
    let ready = [&found["backends"][0]["ready"], &found["backends"][1]["ready"]];
    assert_eq!(ready, [&Value::from(true), &Value::from(!devices.is_empty())], "what renders here: {found}");
    assert!(!devices.is_empty() || std::env::var_os("CI").is_none(), "there is no graphics device");
    assert_eq!(found["self_test"]["gpu_ms"].is_number(), !devices.is_empty(), "a device is tried: {found}");
    for step in ["generate_ms", "render_ms", "write_ms", "read_ms"] {
        assert!(found["self_test"][step].as_f64().is_some_and(|ms| ms > 0.0), "{step}: {found}");
    }
    assert!(found["formats"]["read"].as_array().is_some_and(|formats| formats.len() >= 4), "formats: {found}");
    assert_eq!(outcome.stderr, "", "nothing is wrong");
}

#[cfg(target_os = "linux")]
#[test]
fn memory_is_counted_in_points() {
    let outcome = Folder::new().succeed(&["doctor", "--json"]);
    let found: Value = serde_json::from_str(&outcome.stdout).expect("it is JSON");
    let number = |name: &str| found["memory"][name].as_f64().unwrap_or_else(|| panic!("{name}: {found}"));
    assert!(number("available") <= number("total"), "what is free is a part: {found}");
    let cloud = number("program") + number("picture") + number("largest_cloud") * number("per_point");
    assert!((cloud - number("available")).abs() < 1e6, "what takes {cloud} bytes is the largest: {found}");
}

#[cfg(unix)]
#[test]
fn a_temporary_folder_that_is_none_is_named() {
    let folder = Folder::new();
    let mut command = folder.command(&["doctor"]);
    let output = command.env("TMPDIR", folder.path("absent")).output().expect("the command starts");
    let (text, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(4), "{error}");
    assert!(error.contains("TMPDIR") && error.lines().count() == 1, "{error}");
    assert!(text.contains("broken") && text.contains("absent cannot be written"), "{text}");
}

const COMMANDS: [&str; 11] =
    ["view", "render", "convert", "normals", "demo", "info", "topics", "bench", "doctor", "completions", "man"];

#[test]
fn completions_know_all_commands() {
    let folder = Folder::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = folder.succeed(&["completions", shell]).stdout;
        for command in COMMANDS {
            assert!(script.contains(command), "{shell}: {command} is missing");
        }
        assert!(script.contains("occlusion") && script.contains("autosplats"), "{shell}: options of this program");
    }
    folder.fail(&["completions", "tcsh"], 2, &["bash", "zsh", "fish"]);
    let help = folder.succeed(&["completions", "--help"]).stdout;
    assert!(help.contains("To install") && help.contains("bash-completion"), "how to install: {help}");
}

#[cfg(unix)]
#[test]
fn bash_takes_its_completions() {
    let folder = Folder::new();
    folder.write("complete.bash", &folder.succeed(&["completions", "bash"]).stdout);
    let script = ". ./complete.bash; COMP_WORDS=(autosplats inf); COMP_CWORD=1; _autosplats autosplats inf autosplats; \
                  echo ${COMPREPLY[@]}";
    let Ok(output) = std::process::Command::new("bash").args(["-c", script]).current_dir(folder.path("")).output()
    else {
        println!("there is no bash: this test checks nothing");
        return;
    };
    let (found, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(found.trim(), "info", "{error}");
}

#[test]
fn there_is_a_page_for_each_command() {
    let folder = Folder::new();
    let main = folder.succeed(&["man"]).stdout;
    for command in COMMANDS {
        assert!(main.contains(&format!("autosplats\\-{command}(1)")), "{command} is not in the main page:\n{main}");
    }
    let listed = folder.succeed(&["man", "--out", "man1"]).stdout;
    assert_eq!(listed.lines().count(), 2 + COMMANDS.len(), "each file is named: {listed}");
    for command in COMMANDS.into_iter().chain(["bench-paper"]) {
        let page = String::from_utf8_lossy(&folder.read(&format!("man1/autosplats-{command}.1"))).into_owned();
        assert!(
            page.contains(".SH SYNOPSIS") && page.contains(command.split('-').next().unwrap_or(command)),
            "{command}: {page}"
        );
    }
    assert!(String::from_utf8_lossy(&folder.read("man1/autosplats-info.1")).contains("histogram"), "the JSON too");

    std::fs::write(folder.path("man1/autosplats-man.1"), "mine").expect("the folder can be written");
    std::fs::remove_file(folder.path("man1/autosplats.1")).expect("it is there");
    folder.fail(&["man", "--out", "man1"], 4, &["--force"]);
    assert!(!folder.path("man1/autosplats.1").exists(), "nothing was written before all was checked");
    folder.succeed(&["man", "--out", "man1", "--force"]);
    assert_ne!(folder.read("man1/autosplats-man.1"), b"mine", "now it was replaced");
    folder.fail(&["man", "--force"], 2, &["--out"]);
}
