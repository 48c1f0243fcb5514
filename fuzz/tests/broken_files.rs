//! Runs the fuzzer for a minute as one of the tests.

use std::process::Command;

const SECONDS: &str = "60";

#[test]
fn no_reader_fails_on_a_minute_of_broken_files() {
    let fuzz = Command::new(env!("CARGO_BIN_EXE_autosplats-fuzz")).args(["--seconds", SECONDS]).output();
    let output = fuzz.expect("the program that the tests have built");
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
    println!("{said}");
    assert!(output.status.success(), "there are findings; what it says is above");
}
