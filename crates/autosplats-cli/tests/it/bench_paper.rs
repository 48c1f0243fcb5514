//! `bench paper`: the paper's evaluation on small scenes.

use std::collections::BTreeMap;
use std::fs;

use crate::common::{Folder, data};
use serde_json::Value;

const QUICK: [&str; 5] = ["bench", "paper", "--quick", "--out", "out"];

fn with(more: &[&str]) -> Vec<String> {
    QUICK.iter().chain(more).map(|&argument| argument.into()).collect()
}

fn run(folder: &Folder, more: &[&str]) -> String {
    let arguments = with(more);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    assert_eq!(folder.succeed(&arguments).stdout.trim_end(), "out/RESULTS-quick.md", "it says where the page is");
    String::from_utf8(folder.read("out/RESULTS-quick.md")).expect("the page is text")
}

fn journal(folder: &Folder) -> BTreeMap<String, Value> {
    serde_json::from_slice(&folder.read("out/results-quick/measurements.json")).expect("it is JSON")
}

#[test]
fn the_evaluation_is_written_up_and_goes_on_where_it_stopped() {
    let folder = Folder::new();
    let page = run(&folder, &["--scenes", "bunny,imperia"]);
    for said in ["Table 1", "Figure 6", "Figure 7", "Figure 9", "Figure 10", "Accuracy", "Grid culling"] {
        assert!(page.contains(said), "'{said}' is not in\n{page}");
    }
    let shown: Vec<&str> = page.split("](results-quick/").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    assert!(shown.len() > 6, "pictures and charts: {shown:?}");
    for name in &shown {
        assert!(folder.read(&format!("out/results-quick/{name}")).len() > 200, "{name} shows something");
    }

    let measured = journal(&folder);
    assert_eq!(run(&folder, &["--scenes", "bunny,imperia"]), page, "what was measured is not measured again");
    fs::remove_file(folder.path("out/results-quick/figure-6.png")).expect("it was there");
    run(&folder, &["--scenes", "bunny,imperia"]);
    assert!(folder.read("out/results-quick/figure-6.png").len() > 200, "a picture that is gone is made again");
    fs::write(folder.path("out/results-quick/measurements.json"), serde_json::to_vec(&measured).expect("JSON"))
        .expect("written");
    assert_eq!(journal(&folder), measured);

    let (lost, _) = measured.iter().find(|(key, _)| key.contains("table all")).expect("a line of the table");
    let kept: BTreeMap<_, _> = measured.iter().filter(|(key, _)| *key != lost).collect();
    let text = serde_json::to_string(&kept).expect("JSON");
    fs::write(folder.path("out/results-quick/measurements.json"), text).expect("written");
    run(&folder, &["--scenes", "bunny,imperia"]);
    let again = journal(&folder);
    assert_eq!(again.keys().collect::<Vec<_>>(), measured.keys().collect::<Vec<_>>(), "the lost one is back");
    assert!(again.iter().all(|(key, value)| key == lost || measured[key] == *value), "and no other was touched");
}

#[test]
fn the_bunny_and_the_gallop_are_taken_from_files() {
    let Some(data) = data() else { return };
    let folder = Folder::new();
    let [bunny, gallop] =
        ["models/bunny.ply", "animation/horse_gallop"].map(|name| data.join(name).display().to_string());
    let page = run(&folder, &["--scenes", "bunny,horses", "--bunny", &bunny, "--gallop", &gallop]);
    assert!(page.contains("all points of `bunny.ply`"), "{page}");
    assert!(page.contains("moments of `horse_gallop`"), "{page}");
    assert!(journal(&folder).keys().any(|key| key.starts_with("horses (horse_gallop:30000")), "{:?}", journal(&folder));
}

#[test]
fn what_cannot_be_evaluated_is_named() {
    let folder = Folder::new();
    let fail = |more: &[&str], code: i32, words: &[&str]| {
        let arguments = with(more);
        folder.fail(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), code, words);
    };
    fail(&["--scenes", "bunni"], 2, &["bunni", "did you mean 'bunny'"]);
    fail(&["--bunny", "absent.ply"], 3, &["absent.ply"]);
    fail(&["--gallop", "absent"], 3, &["absent"]);
    fs::create_dir_all(folder.path("empty")).expect("a folder");
    fs::create_dir_all(folder.path("out/results-quick")).expect("a folder");
    fail(&["--scenes", "horses", "--gallop", "empty"], 3, &["empty", "no file"]);
    folder.write("out/results-quick/measurements.json", "{");
    fail(&["--scenes", "bunny"], 3, &["measurements.json", "--fresh"]);
    folder.fail(&["bench", "--scene", "figure:5K", "paper"], 2, &["paper"]);
}
