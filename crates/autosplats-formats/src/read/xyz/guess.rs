//! Guesses the meaning of unnamed columns from the values of the first rows.

/// A value of a sampled row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    Number(f64),
    Missing,
    Word,
}

impl Cell {
    pub(super) fn number(self) -> f64 {
        if let Self::Number(number) = self { number } else { f64::NAN }
    }
}

/// Names for the columns; `pts` if a count of points precedes them.
pub(super) fn guessed(rows: &[Vec<Cell>], width: usize, pts: bool) -> Vec<String> {
    let rest: &[&str] = match width {
        7 if pts && colors(rows, 4) => &["Intensity", "red", "green", "blue"],
        4 => &["Intensity"],
        6 if unit_vectors(rows, 3) => &["nx", "ny", "nz"],
        6 if colors(rows, 3) => &["red", "green", "blue"],
        7 if colors(rows, 3) && constant(rows, 6) => &["red", "green", "blue", "alpha"],
        7 if colors(rows, 4) => &["Intensity", "red", "green", "blue"],
        9 if unit_vectors(rows, 3) && colors(rows, 6) => &["nx", "ny", "nz", "red", "green", "blue"],
        9 if colors(rows, 3) && unit_vectors(rows, 6) => &["red", "green", "blue", "nx", "ny", "nz"],
        10 if colors(rows, 4) && unit_vectors(rows, 7) => &["Intensity", "red", "green", "blue", "nx", "ny", "nz"],
        _ => &[],
    };
    let known = ["x", "y", "z"].iter().chain(rest).map(|&name| name.to_owned());
    let unknown = (3 + rest.len()..width).map(|index| format!("column_{}", index + 1));
    known.chain(unknown).collect()
}

/// Whether three columns are normals: 90 % of length 1, with fractions or negative values, which pure colours lack.
fn unit_vectors(rows: &[Vec<Cell>], first: usize) -> bool {
    let three = |row: &Vec<Cell>| [0, 1, 2].map(|index| row[first + index].number());
    let unit = |row: &&Vec<Cell>| {
        let length = three(row).iter().map(|value| value * value).sum::<f64>().sqrt();
        (0.95..1.05).contains(&length)
    };
    let fractional_or_negative =
        rows.iter().any(|row| three(row).iter().any(|value| value.fract() != 0.0 || *value < 0.0));
    fractional_or_negative && rows.iter().filter(unit).count() * 10 >= rows.len() * 9
}

/// Whether three columns can be colours: 0 to 1, or whole numbers up to 65535.
fn colors(rows: &[Vec<Cell>], first: usize) -> bool {
    let values = || rows.iter().flat_map(|row| &row[first..first + 3]).map(|cell| cell.number());
    let largest = values().fold(0.0, f64::max);
    values().all(|value| (0.0..=65535.0).contains(&value) && (largest <= 1.0 || value.fract() == 0.0))
}

fn constant(rows: &[Vec<Cell>], column: usize) -> bool {
    let first = rows[0][column].number();
    (first == 255.0 || first == 1.0) && rows.iter().all(|row| row[column].number() == first)
}

/// Whether a column has whole numbers that rise by the same step from row to row.
pub(super) fn counts(rows: &[Vec<Cell>], column: usize) -> bool {
    let number = |row: &Vec<Cell>| row[column].number();
    let steps = || rows.windows(2).map(|pair| number(&pair[1]) - number(&pair[0]));
    let step = steps().next().unwrap_or(0.0);
    step > 0.0 && steps().all(|other| other == step) && rows.iter().all(|row| number(row).fract() == 0.0)
}

/// Whether a column has words and no numbers.
pub(super) fn words(rows: &[Vec<Cell>], column: usize) -> bool {
    let mut cells = rows.iter().map(|row| row[column]).filter(|cell| *cell != Cell::Missing).peekable();
    cells.peek().is_some() && cells.all(|cell| cell == Cell::Word)
}

/// Whether a column needs `f64`. Text does not state how wide its numbers are.
pub(super) fn wide(rows: &[Vec<Cell>], column: usize, exact: bool) -> bool {
    rows.iter().map(|row| row[column].number()).any(|value| {
        let lost = f64::from(value as f32) != value;
        // Decimals are hardly ever binary fractions. Nothing is lost if `f32` prints the same decimal again.
        let decimal = || format!("{}", value as f32).parse() == Ok(value);
        value.is_finite() && lost && (value.abs() >= f64::from(1 << 24) || exact && !decimal())
    })
}
