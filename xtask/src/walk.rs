//! `cargo xtask walk`: a chart of what each frame of a film through an octree took, from what `render --json` prints.

use std::fmt::Write as _;
use std::fs::{read_to_string, write};
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

const WIDTH: f64 = 760.0;
/// Height of the plot of a panel, and of the panel with its title.
const PLOT: f64 = 130.0;
const PANEL: f64 = 184.0;
/// Space to the left and to the right of plots.
const LEFT: f64 = 64.0;
const RIGHT: f64 = 14.0;
/// Colours that colour-blind readers can distinguish (Okabe and Ito).
const COLORS: [&str; 3] = ["#0072b2", "#d55e00", "#009e73"];

/// A value of a frame: its name, where the line has it, and the factor to the unit of the panel.
type Series = (&'static str, &'static [&'static str], f64);

/// Panels from top to bottom, each with its title and values.
const PANELS: [(&str, &[Series]); 4] = [
    ("memory, MB", &[("now", &["memory", "resident"], 1e-6), ("most so far", &["memory", "peak"], 1e-6)]),
    ("milliseconds", &[("reading", &["read_ms"], 1.0), ("rendering", &["timings_ms", "frame"], 1.0)]),
    ("million points", &[("shown", &["tree", "points"], 1e-6), ("read", &["tree", "read_points"], 1e-6)]),
    ("nodes", &[("shown", &["tree", "nodes"], 1.0), ("read", &["tree", "read_nodes"], 1.0)]),
];

/// Writes the chart of the lines of `frames` to `out`.
pub(crate) fn run(frames: &Path, out: &Path) -> Result<()> {
    let text = read_to_string(frames).with_context(|| format!("cannot read {}", frames.display()))?;
    let lines: Vec<Value> = text
        .lines()
        .enumerate()
        .map(|(at, line)| serde_json::from_str(line).with_context(|| format!("{}, line {}", frames.display(), at + 1)))
        .collect::<Result<_>>()?;
    write(out, chart(&lines)?).with_context(|| format!("cannot write {}", out.display()))
}

/// The values of a series, one per frame.
fn values(lines: &[Value], (name, place, factor): Series) -> Result<Vec<f64>> {
    let value = |line: &Value| {
        let value = place.iter().try_fold(line, |value, key| value.get(key))?.as_f64()?;
        Some(value * factor)
    };
    let missing = || format!("a line without {} ({name}); is it from a film of an octree?", place.join("."));
    lines.iter().map(|line| value(line).with_context(missing)).collect()
}

/// A chart with a panel for each kind of value, over the numbers of frames.
fn chart(lines: &[Value]) -> Result<String> {
    ensure!(lines.len() > 1, "one frame is no film; give the lines that `render --camera-path --json` prints");
    let height = PANEL * PANELS.len() as f64 + 24.0;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    let x = |frame: usize| LEFT + frame as f64 / (lines.len() - 1) as f64 * (WIDTH - LEFT - RIGHT);
    for (number, (title, all)) in PANELS.into_iter().enumerate() {
        let top = PANEL * number as f64 + 34.0;
        let all = all.iter().map(|series| Ok((series.0, values(lines, *series)?))).collect::<Result<Vec<_>>>()?;
        let most = all.iter().flat_map(|(_, values)| values).copied().fold(0.0, f64::max);
        let step = step_of(most);
        let end = (most / step).ceil().max(1.0) * step;
        let y = |value: f64| top + PLOT - value / end * PLOT;
        text(&mut svg, [LEFT, top - 12.0], "start", &format!("<tspan font-weight=\"bold\">{title}</tspan>"));
        let mut tick = 0.0;
        while tick <= end * 1.0001 {
            let _ = writeln!(svg, r##"<path d="M{LEFT} {:.1}H{}" stroke="#ddd"/>"##, y(tick), WIDTH - RIGHT);
            let decimals = usize::from(step < 1.0);
            text(&mut svg, [LEFT - 6.0, y(tick) + 4.0], "end", &format!("{tick:.decimals$}"));
            tick += step;
        }
        for ((name, values), (index, color)) in all.iter().zip(COLORS.into_iter().enumerate()) {
            let points: Vec<String> =
                values.iter().enumerate().map(|(frame, value)| format!("{:.1},{:.1}", x(frame), y(*value))).collect();
            let points = points.join(" ");
            let _ = writeln!(svg, r#"<polyline points="{points}" fill="none" stroke="{color}" stroke-width="1.5"/>"#);
            let at = [WIDTH - RIGHT - 90.0 * (all.len() - index) as f64, top - 12.0];
            let _ = writeln!(svg, r#"<path d="M{} {}h18" stroke="{color}" stroke-width="3"/>"#, at[0], at[1] - 4.0);
            text(&mut svg, [at[0] + 22.0, at[1]], "start", name);
        }
    }
    let frames = step_of(lines.len() as f64) as usize;
    for frame in (0..lines.len()).step_by(frames.max(1)) {
        text(&mut svg, [x(frame), height - 26.0], "middle", &frame.to_string());
    }
    text(&mut svg, [0.5 * (WIDTH + LEFT), height - 8.0], "middle", "frame");
    Ok(svg + "</svg>\n")
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, content: &str) {
    let _ = writeln!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{content}</text>"#);
}

/// A step of 1, 2 or 5 times a power of ten that divides a range into about four parts.
fn step_of(range: f64) -> f64 {
    let rough = (range / 4.0).max(f64::MIN_POSITIVE);
    let unit = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0].map(|step| step * unit).into_iter().find(|step| *step >= rough).unwrap_or(10.0 * unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(frame: u64, read_ms: f64) -> Value {
        serde_json::json!({
            "frame": frame, "read_ms": read_ms, "timings_ms": { "frame": 300.0 },
            "memory": { "resident": 400_000_000_u64, "peak": 500_000_000_u64 },
            "tree": { "points": 5_000_000, "read_points": 0, "nodes": 200, "read_nodes": 0 },
        })
    }

    #[test]
    fn higher_values_are_higher() {
        let svg = chart(&[line(0, 100.0), line(1, 200.0), line(2, 0.0)]).expect("all values are there");
        let reading = svg.lines().filter(|line| line.starts_with("<polyline")).nth(2).expect("the third series");
        let heights: Vec<f64> = reading
            .split('"')
            .nth(1)
            .into_iter()
            .flat_map(|points| points.split(' '))
            .map(|point| point.split(',').nth(1).and_then(|y| y.parse().ok()).expect("a number"))
            .collect();
        assert_eq!(heights.len(), 3, "a place per frame");
        assert!(((heights[2] - heights[1]) / (heights[2] - heights[0]) - 2.0).abs() < 0.01, "{heights:?}");
        assert_eq!(svg.matches("<polyline").count(), 8, "two values in each panel");
    }

    #[test]
    fn what_is_missing_is_named() {
        let mut without = line(1, 1.0);
        without["tree"] = Value::Null;
        let error = chart(&[line(0, 1.0), without]).expect_err("a value is missing");
        assert!(error.to_string().contains("tree.points"), "{error:#}");
        assert!(chart(&[line(0, 1.0)]).is_err(), "one frame is no film");
    }
}
