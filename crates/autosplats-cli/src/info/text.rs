//! The report as text: important facts first, numbers aligned.

use std::fmt::Write as _;

use super::report::{AttributeFound, Bounds, Report};
use super::statistics::{Histogram, Statistics};

/// Width of the text in columns.
const WIDTH: usize = 100;

/// Columns of a fact's name and its indent.
const INDENT: usize = 14;

/// Most sensors shown.
const MAX_SCANS: usize = 8;

/// Names of the flags of LAS.
const FLAGS: [&str; 5] = ["Synthetic", "KeyPoint", "Withheld", "Overlap", "EdgeOfFlightLine"];

impl Report {
    /// Whether the report has more than an error.
    pub(super) fn is_known(&self) -> bool {
        self.format.is_some()
    }

    /// The whole report. If `styled`, warnings and the name are highlighted.
    pub(super) fn to_text(&self, styled: bool) -> String {
        let style = |code: &str, text: String| if styled { format!("\x1b[{code}m{text}\x1b[0m") } else { text };
        let mut page = style("1", plain(&self.input)) + "\n";
        let mut fact = |name: &str, value: String| {
            let _ = writeln!(page, "  {name:<11} {}", wrapped(&plain(&value), INDENT));
        };
        let bytes = self.file_bytes.map_or_else(String::new, |bytes| format!("; {} bytes", counted(bytes)));
        fact("format", format!("{}{bytes}", self.format.as_deref().unwrap_or_default()));
        if let Some(points) = self.points {
            fact("points", self.shown_points(points));
        }
        if let Some(faces) = self.faces {
            fact("faces", counted(faces));
        }
        if let Some(bounds) = &self.bounds {
            fact("size", self.shown_size(bounds));
        }
        if self.file_bytes.is_some() && self.points != Some(0) {
            fact("unit", self.shown_unit());
        }
        if let Some(crs) = self.shown_crs() {
            fact("system", crs);
        }
        if let Some(axes) = &self.axes {
            let about = match axes.name {
                "camera" => "a camera's: x right, y down, z forward".into(),
                name => name.replace('-', " is "),
            };
            fact("axes", format!("{about}{}", if axes.guessed { " (guessed from the shape)" } else { "" }));
        }
        if let Some([x, y, z]) = self.resolution {
            let steps = if x == y && y == z { x.to_string() } else { format!("{x} × {y} × {z}") };
            fact("resolution", format!("steps of {steps}"));
        }
        if let Some(spacing) = &self.spacing {
            let metres = self.in_metres(spacing.median);
            fact(
                "spacing",
                format!(
                    "{}{}{metres} to the nearest point (median of {}; 5 to 95 %: {} to {})",
                    short(spacing.median),
                    self.symbol(),
                    counted(spacing.samples as u64),
                    short(spacing.p5),
                    short(spacing.p95),
                ),
            );
        }
        if let Some(density) = &self.density {
            let per = match self.symbol().trim() {
                "" => "square unit".into(),
                symbol => format!("{symbol}²"),
            };
            let metric = self.crs.metres_per_unit.filter(|metres| *metres != 1.0);
            let metric = metric
                .map_or_else(String::new, |metres| format!(" ({} per m²)", short(density.median / (metres * metres))));
            let around = format!("of surface (median, from {} neighbours)", density.neighbors);
            fact("density", format!("{} points per {per}{metric} {around}", short(density.median)));
        }
        match self.duplicates {
            Some(0) => fact("duplicates", "none".into()),
            Some(count) => fact("duplicates", format!("{} at the position of an earlier point", self.part(count))),
            None => {}
        }
        if let Some(not_finite) = self.not_finite.filter(|count| *count > 0) {
            fact("not finite", format!("{} without a finite position", self.part(not_finite)));
        }
        self.attribute_table(&mut page);
        self.class_table(&mut page);
        self.flag_table(&mut page);
        self.scan_table(&mut page);
        self.header_facts(&mut page);
        for warning in &self.warnings {
            let text = format!("warning: {}", plain(warning));
            let _ = writeln!(page, "  {}", style("33", wrapped(&text, 4)));
        }
        page += match (self.scanned, &self.error) {
            (true, _) => "",
            (false, None) => {
                "  These facts are from the header; --scan reads the points: values, spacing, density, duplicates.\n"
            }
            (false, Some(_)) => "  These facts are from the header; the points could not be read.\n",
        };
        page
    }

    fn shown_points(&self, points: u64) -> String {
        match self.points_in_header {
            Some(promised) if promised != points => {
                format!("{} (the header states {})", counted(points), counted(promised))
            }
            _ => counted(points),
        }
    }

    fn shown_size(&self, bounds: &Bounds) -> String {
        let decimals = self.decimals(bounds);
        let [x, y, z] = [0, 1, 2].map(|axis| number(bounds.size[axis], decimals[axis]));
        let metric = self.crs.metres_per_unit.filter(|metres| *metres != 1.0);
        let metric = metric.map_or_else(String::new, |metres| {
            let [x, y, z] = bounds.size.map(|size| short(size * metres));
            format!(" ({x} × {y} × {z} m)")
        });
        match self.crs.vertical_unit.map(symbol) {
            Some(vertical) if vertical != self.symbol() => {
                format!("{x} × {y}{}, {z}{vertical} high", self.symbol())
            }
            _ => format!("{x} × {y} × {z}{}{metric}", self.symbol()),
        }
    }

    fn shown_unit(&self) -> String {
        match (self.crs.unit, self.crs.vertical_unit) {
            (None, None) => "not stated in the file".into(),
            (Some(unit), Some(vertical)) if unit != vertical => format!("{unit}, heights in {vertical}"),
            (unit, vertical) => unit.or(vertical).unwrap_or_default().into(),
        }
    }

    fn shown_crs(&self) -> Option<String> {
        let code = self.crs.epsg.map(|code| format!("EPSG:{code}"));
        match (&self.crs.name, code, &self.crs.wkt) {
            (Some(name), Some(code), _) => Some(format!("{name} ({code})")),
            (Some(name), None, _) => Some(name.clone()),
            (None, Some(code), _) => Some(code),
            (None, None, Some(_)) => Some("given as well-known text (--json shows it)".into()),
            (None, None, None) => None,
        }
    }

    /// The cloud's unit symbol with a leading blank.
    fn symbol(&self) -> &'static str {
        self.crs.unit.map_or("", symbol)
    }

    fn in_metres(&self, value: f64) -> String {
        let metric = self.crs.metres_per_unit.filter(|metres| *metres != 1.0);
        metric.map_or_else(String::new, |metres| format!(" ({} m)", short(value * metres)))
    }

    /// A number of points and its percentage of all.
    fn part(&self, count: u64) -> String {
        let percent = 100.0 * count as f64 / self.points.unwrap_or(1).max(1) as f64;
        let percent = if percent < 0.05 { "less than 0.1".into() } else { format!("{percent:.1}") };
        format!("{} ({percent} %)", counted(count))
    }

    /// Number of decimals for coordinates along each axis.
    fn decimals(&self, bounds: &Bounds) -> [usize; 3] {
        let largest = bounds.size.iter().fold(0.0_f64, |a, b| a.max(*b));
        [0, 1, 2].map(|axis| match self.resolution {
            Some(step) => (0..9).find(|&d| is_whole(step[axis] * 10_f64.powi(d))).unwrap_or(9) as usize,
            None => decimals_for(largest, 6),
        })
    }

    fn attribute_table(&self, page: &mut String) {
        if self.attributes.is_empty() || self.points == Some(0) {
            return;
        }
        let coordinates = self.bounds.as_ref().map(|bounds| self.decimals(bounds));
        let (shown, hidden): (Vec<_>, Vec<_>) = self
            .attributes
            .iter()
            .partition(|attribute| !self.scanned || attribute.statistics != Statistics::default());
        let rows: Vec<[String; 6]> = shown
            .into_iter()
            .map(|AttributeFound { name, stored, statistics }| {
                let Statistics { min, max, mean, histogram, not_finite, .. } = statistics;
                let axis = ["x", "y", "z"].iter().position(|axis| {
                    let name = name.to_ascii_lowercase();
                    name == *axis || name.strip_prefix("cartesian") == Some(axis)
                });
                let decimals = match (axis, &coordinates) {
                    (Some(axis), Some(decimals)) => decimals[axis],
                    _ => value_decimals(min.unwrap_or(0.0), max.unwrap_or(0.0), statistics),
                };
                let shown = |value: &Option<f64>, decimals| value.map_or_else(String::new, |v| number(v, decimals));
                let mean_decimals = if decimals == 0 { 1 } else { decimals };
                // Points without a finite position are counted above.
                let bad = not_finite.filter(|count| *count > 0 && axis.is_none());
                let bad = bad.map_or_else(String::new, |count| format!(" {} not finite", counted(count)));
                let bars = histogram.as_ref().map_or_else(String::new, sparkline);
                [
                    clipped(&plain(name), 22),
                    clipped(&plain(stored), 24),
                    shown(min, decimals),
                    shown(max, decimals),
                    shown(mean, mean_decimals),
                    bars + &bad,
                ]
            })
            .collect();
        let head = ["attribute", "stored", "min", "max", "mean", if self.scanned { "distribution" } else { "" }];
        let width = |column: usize| {
            let filled = rows.iter().any(|row| !row[column].is_empty());
            let least = if filled { head[column].len() } else { 0 };
            rows.iter().map(|row| row[column].chars().count()).fold(least, usize::max)
        };
        let widths = [0, 1, 2, 3, 4].map(width);
        page.push('\n');
        for row in std::iter::once(&head.map(str::to_owned)).chain(&rows) {
            let mut line = String::from(" ");
            for (column, width) in widths.into_iter().enumerate().filter(|(_, width)| *width > 0) {
                let _ = match column {
                    0 | 1 => write!(line, " {:<width$}", row[column]),
                    _ => write!(line, " {:>width$}", row[column]),
                };
            }
            let _ = writeln!(page, "{}", format!("{line}  {}", row[5]).trim_end());
        }
        if !hidden.is_empty() {
            let names: Vec<_> = hidden.iter().map(|attribute| clipped(&plain(&attribute.name), 22)).collect();
            // The LAS reader reads all values and drops fields that are 0 at every point.
            let las =
                self.format.as_ref().is_some_and(|format| format.starts_with("LAS") || format.starts_with("COPC"));
            let why = if las { "0 at every point" } else { "no values of their own (part of others, or not read)" };
            let text = format!("{why}: {}", names.join(", "));
            let _ = writeln!(page, "  {}", wrapped(&text, 4));
        }
    }

    fn class_table(&self, page: &mut String) {
        for attribute in &self.attributes {
            let named = attribute.statistics.values.iter().any(|value| value.name.is_some());
            if !named {
                continue;
            }
            page.push_str("\n  class                               points\n");
            for value in &attribute.statistics.values {
                let share = 100.0 * value.count as f64 / self.points.unwrap_or(1).max(1) as f64;
                let name = value.name.unwrap_or_default();
                let _ = writeln!(page, "  {:>5} {name:<22} {:>13} {share:>6.2} %", value.value, counted(value.count));
            }
        }
    }

    /// Numbers of points with the flags of LAS.
    fn flag_table(&self, page: &mut String) {
        let flagged = |attribute: &AttributeFound| -> u64 {
            let is_flag = FLAGS.iter().any(|flag| flag.eq_ignore_ascii_case(&attribute.name));
            let set = attribute.statistics.values.iter().filter(|value| is_flag && value.value > 0.0);
            set.map(|value| value.count).sum()
        };
        let found = self.attributes.iter().map(|attribute| (attribute, flagged(attribute)));
        let rows: Vec<_> = found.filter(|(_, count)| *count > 0).collect();
        if !rows.is_empty() {
            page.push_str("\n  flag                                points\n");
        }
        for (AttributeFound { name, .. }, count) in rows {
            let share = 100.0 * count as f64 / self.points.unwrap_or(1).max(1) as f64;
            let _ = writeln!(page, "  {:<28} {:>13} {share:>6.2} %", plain(name), counted(count));
        }
    }

    fn scan_table(&self, page: &mut String) {
        if self.scans.is_empty() {
            return;
        }
        page.push_str("\n  sensor at\n");
        let largest = self.bounds.as_ref().map_or(1.0, |bounds| bounds.size.iter().fold(0.0_f64, |a, b| a.max(*b)));
        let decimals = decimals_for(largest, 5);
        let rows: Vec<[String; 3]> =
            self.scans.iter().take(MAX_SCANS).map(|scan| scan.position.map(|value| number(value, decimals))).collect();
        let widths = [0, 1, 2].map(|column| rows.iter().map(|row| row[column].len()).max().unwrap_or(0));
        for (scan, [x, y, z]) in self.scans.iter().zip(rows) {
            let points = counted(scan.points[1].saturating_sub(scan.points[0]) as u64);
            let name = scan.name.as_deref().map_or_else(String::new, |name| format!(": {}", clipped(&plain(name), 40)));
            let [a, b, c] = widths;
            let _ = writeln!(page, "  ({x:>a$}, {y:>b$}, {z:>c$}), {points} points{name}");
        }
        if self.scans.len() > MAX_SCANS {
            let _ = writeln!(page, "  and {} more (--json lists them)", self.scans.len() - MAX_SCANS);
        }
    }

    fn header_facts(&self, page: &mut String) {
        if self.details.is_empty() && self.warnings.is_empty() && self.scanned {
            return;
        }
        page.push('\n');
        for detail in &self.details {
            let text = format!("{}: {}", plain(&detail.name), clipped(&plain(&detail.value), 300));
            let _ = writeln!(page, "  {}", wrapped(&text, 4));
        }
    }
}

/// Symbol of a unit with a leading blank.
fn symbol(unit: &str) -> &'static str {
    match unit {
        "metre" => " m",
        "millimetre" => " mm",
        "foot" | "US survey foot" => " ft",
        "degree" => " °",
        _ => "",
    }
}

/// A histogram in one line, one character per bin. Only an empty bin is blank.
fn sparkline(histogram: &Histogram) -> String {
    const BARS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let most = histogram.counts.iter().copied().max().unwrap_or(0).max(1);
    let bar = |&count: &u64| match count {
        0 => ' ',
        count => BARS[((count as f64 / most as f64 * 8.0).ceil() as usize).clamp(1, 8) - 1],
    };
    histogram.counts.iter().map(bar).collect()
}

/// Number of decimals for values between `min` and `max`.
fn value_decimals(min: f64, max: f64, statistics: &Statistics) -> usize {
    let whole = statistics.distinct.is_some() || (min.fract() == 0.0 && max.fract() == 0.0 && max - min >= 1000.0);
    let range = if max > min { max - min } else { max.abs() };
    // At most eleven digits in all, enough for a reader.
    let integer = min.abs().max(max.abs()).max(1.0).log10().floor() as usize + 1;
    if whole { 0 } else { decimals_for(range, 5).min(11_usize.saturating_sub(integer).max(1)) }
}

/// Number of decimals that show `digits` digits of a value.
fn decimals_for(value: f64, digits: i32) -> usize {
    if value > 0.0 { (digits - 1 - value.log10().floor() as i32).clamp(0, 12) as usize } else { 0 }
}

fn number(value: f64, decimals: usize) -> String {
    if value.abs() >= 1e15 || (value != 0.0 && value.abs() < 1e-9) {
        return format!("{value:.4e}");
    }
    // -0 is shown as 0.
    format!("{:.decimals$}", if value == 0.0 { 0.0 } else { value })
}

/// A number in three digits; numbers from 1000 on as whole numbers.
pub(super) fn short(value: f64) -> String {
    if value.abs() >= 1e9 || (value != 0.0 && value.abs() < 1e-6) {
        return format!("{value:.2e}");
    }
    if value.abs() >= 1000.0 {
        return counted(value.round() as u64);
    }
    let text = format!("{:.*}", decimals_for(value.abs(), 3), value);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

/// A count with thousands separators.
pub(super) fn counted(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

fn is_whole(value: f64) -> bool {
    (value - value.round()).abs() < 1e-6 * value.abs().max(1e-3)
}

/// Text of a file with control characters escaped, which could act on a terminal.
fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            plain.extend(character.escape_default());
        } else {
            plain.push(character);
        }
    }
    plain
}

fn clipped(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.into();
    }
    text.chars().take(most - 1).chain(['…']).collect()
}

/// Wraps text between words, with an indent from the second line on.
pub(crate) fn wrapped(text: &str, indent: usize) -> String {
    let mut lines = String::new();
    let mut column = indent;
    for word in text.split(' ') {
        let width = word.chars().count();
        if column > indent && column + 1 + width > WIDTH {
            lines.push('\n');
            lines.extend(std::iter::repeat_n(' ', indent));
            column = indent;
        } else if column > indent {
            lines.push(' ');
            column += 1;
        }
        lines.push_str(word);
        column += width;
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_for_people() {
        assert_eq!(
            ["0", "999", "1000", "12345678"].map(|n| counted(n.parse().unwrap_or(9))),
            ["0", "999", "1,000", "12,345,678"],
            "commas"
        );
        assert_eq!(
            [0.0, 0.012_34, 2.5, 123.456, 4321.0, 1e-8].map(short),
            ["0", "0.0123", "2.5", "123", "4,321", "1.00e-8"],
            "three digits"
        );
        assert_eq!(
            [number(-0.0, 1), number(5_400_000.25, 2), number(1e300, 2)],
            ["0.0", "5400000.25", "1.0000e300"],
            "values"
        );
    }

    #[test]
    fn bars_show_what_is_there() {
        let histogram = Histogram { edges: vec![0.0, 1.0, 2.0, 3.0], counts: vec![1000, 1, 0] };
        assert_eq!(sparkline(&histogram), "█▁ ", "one point is seen beside a thousand");
    }

    #[test]
    fn lines_break_between_words() {
        let text = wrapped(&"word ".repeat(40), 10);
        assert!(text.lines().all(|line| line.chars().count() <= WIDTH), "within the width: {text}");
        assert_eq!(text.split_whitespace().count(), 40, "no word is lost");
        assert_eq!(plain("a\x1b[31m\nb ü"), "a\\u{1b}[31m\\nb ü", "what files say does not act on the terminal");
    }
}
