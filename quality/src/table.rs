//! Tables in Markdown, and numbers as their cells.

/// A table that grows row by row.
#[derive(Debug)]
pub struct Table {
    text: String,
}

impl Table {
    /// A table with these columns. The first is aligned left, like words, the others right, like numbers.
    pub fn new(columns: &[&str]) -> Self {
        let rule = "|---".to_owned() + &"|--:".repeat(columns.len() - 1);
        Self { text: format!("| {} |\n{rule}|\n", columns.join(" | ")) }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: &[String]) {
        self.text += &format!("| {} |\n", cells.join(" | "));
    }

    /// The table as text, followed by an empty line.
    pub fn finish(self) -> String {
        self.text + "\n"
    }
}

/// A number with this many decimals, or a dash if it is not finite.
pub fn number(value: f64, decimals: usize) -> String {
    let text = if value.is_finite() { format!("{value:.decimals$}") } else { return "–".into() };
    // Values that round to zero have no sign.
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if is_zero { text.trim_start_matches('-').into() } else { text }
}

/// A share in percent.
pub fn percent(share: f64, decimals: usize) -> String {
    number(100.0 * share, decimals)
}

#[test]
fn tables_are_markdown() {
    let mut table = Table::new(&["name", "value"]);
    table.row(&["one".into(), number(1.26, 1)]);
    table.row(&["none".into(), percent(f64::NAN, 1)]);
    assert_eq!(table.finish(), "| name | value |\n|---|--:|\n| one | 1.3 |\n| none | – |\n\n", "a table");
    assert_eq!([number(-0.004, 2), number(-0.006, 2), percent(0.5, 0)], ["0.00", "-0.01", "50"], "numbers");
}
