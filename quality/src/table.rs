//! Tables in Markdown, and numbers in them.

/// A table in the making.
#[derive(Debug)]
pub struct Table {
    text: String,
}

impl Table {
    /// A table with these columns: the first of words, the others of numbers.
    pub fn new(columns: &[&str]) -> Self {
        let rule = "|---".to_owned() + &"|--:".repeat(columns.len() - 1);
        Self { text: format!("| {} |\n{rule}|\n", columns.join(" | ")) }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: &[String]) {
        self.text += &format!("| {} |\n", cells.join(" | "));
    }

    /// The table, with an empty line after it.
    pub fn finish(self) -> String {
        self.text + "\n"
    }
}

/// A number with so many decimals; a dash for what is none.
pub fn number(value: f64, decimals: usize) -> String {
    if value.is_finite() { format!("{value:.decimals$}") } else { "–".into() }
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
}
