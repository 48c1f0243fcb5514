//! SVG charts: stacked bars and lines, black on white, for a page at any zoom.

use std::fmt::Write as _;

/// Colours that colour-blind readers can distinguish (Okabe and Ito), without black.
const COLORS: [&str; 7] = ["#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442"];

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 300.0;
/// Space around the plot in pixels: left, top, right, bottom.
const MARGIN: [f64; 4] = [64.0, 34.0, 14.0, 44.0];
/// Width of a column of the legend in pixels.
const LEGEND_PX: f64 = 112.0;

/// Title and axis labels.
#[derive(Clone, Copy, Debug)]
pub(super) struct Labels<'a> {
    pub(super) title: &'a str,
    pub(super) x: &'a str,
    pub(super) y: &'a str,
}

/// A series of values [x, y].
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) name: String,
    pub(super) points: Vec<[f64; 2]>,
}

/// A chart of stacked bars, one per name; `parts` names their segments.
pub(super) fn stacked_bars(labels: Labels<'_>, parts: &[&str], bars: &[(String, Vec<f64>)]) -> String {
    let tallest = bars.iter().map(|(_, values)| values.iter().sum::<f64>()).fold(0.0, f64::max);
    let step = nice_step(tallest);
    let top = (tallest / step).ceil().max(1.0) * step;
    let [left, .., right, _] = MARGIN;
    let y = |value: f64| plot_bottom() - value / top * plot_height();
    let mut svg = frame(labels, parts);
    let mut tick = 0.0;
    while tick <= top * 1.0001 {
        grid_line(&mut svg, y(tick), &number(tick));
        tick += step;
    }
    let pitch = (WIDTH - left - right) / bars.len().max(1) as f64;
    for (index, (name, values)) in bars.iter().enumerate() {
        let x = left + (index as f64 + 0.18) * pitch;
        let mut below = 0.0;
        for (part, value) in values.iter().enumerate() {
            let [bottom, top] = [y(below), y(below + value)];
            let color = COLORS[part % COLORS.len()];
            _ = writeln!(
                svg,
                r#"<rect x="{x:.1}" y="{top:.1}" width="{:.1}" height="{:.1}" fill="{color}"/>"#,
                0.64 * pitch,
                (bottom - top).max(0.0)
            );
            below += value;
        }
        text(&mut svg, [x + 0.32 * pitch, plot_bottom() + 14.0], "middle", name);
    }
    svg + "</svg>\n"
}

/// A chart of lines with a logarithmic y axis; values of 0 are left out.
pub(super) fn log_lines(labels: Labels<'_>, lines: &[Line]) -> String {
    let values = || lines.iter().flat_map(|line| &line.points).filter(|[_, y]| *y > 0.0);
    let [low, high] = [f64::min, f64::max].map(|of| values().map(|[_, y]| y.log10()).reduce(of).unwrap_or(0.0));
    let [low, high] = [low.floor(), high.ceil().max(low.floor() + 1.0)];
    let [first, last] = [f64::min, f64::max].map(|of| values().map(|[x, _]| *x).reduce(of).unwrap_or(0.0));
    let [left, .., right, _] = MARGIN;
    let x = |value: f64| left + (value - first) / (last - first).max(1.0) * (WIDTH - left - right);
    let y = |value: f64| plot_bottom() - (value.log10() - low) / (high - low) * plot_height();
    let names: Vec<&str> = lines.iter().map(|line| line.name.as_str()).collect();
    let mut svg = frame(labels, &names);
    let mut decade = low;
    while decade <= high {
        let value = 10f64.powf(decade);
        grid_line(&mut svg, y(value), &number(value));
        decade += 1.0;
    }
    let mut place = first.ceil();
    let step = nice_step(last - first).max(1.0);
    while place <= last {
        text(&mut svg, [x(place), plot_bottom() + 14.0], "middle", &number(place));
        place += step;
    }
    for (index, line) in lines.iter().enumerate() {
        let color = COLORS[index % COLORS.len()];
        let shown = line.points.iter().filter(|[_, y]| *y > 0.0).map(|&[at, value]| [x(at), y(value)]);
        let path: Vec<String> = shown.clone().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        _ = writeln!(svg, r#"<polyline points="{}" fill="none" stroke="{color}" stroke-width="1.8"/>"#, path.join(" "));
        for [x, y] in shown {
            _ = writeln!(svg, r#"<circle cx="{x:.1}" cy="{y:.1}" r="2.4" fill="{color}"/>"#);
        }
    }
    svg + "</svg>\n"
}

fn plot_bottom() -> f64 {
    HEIGHT - MARGIN[3]
}

fn plot_height() -> f64 {
    HEIGHT - MARGIN[1] - MARGIN[3]
}

/// Start of the SVG with everything except the data.
fn frame(labels: Labels<'_>, names: &[&str]) -> String {
    let legend = names.len().div_ceil(legend_columns()) as f64 * 16.0 + 8.0;
    let height = HEIGHT + legend;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" \
         height=\"{height}\" font-family=\"sans-serif\" font-size=\"11\">\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    _ = writeln!(
        svg,
        r#"<text x="{}" y="18" font-size="13" font-weight="bold">{}</text>"#,
        MARGIN[0],
        escaped(labels.title)
    );
    text(&mut svg, [0.5 * (WIDTH + MARGIN[0]), plot_bottom() + 32.0], "middle", labels.x);
    let middle = MARGIN[1] + 0.5 * plot_height();
    _ = writeln!(
        svg,
        r#"<text x="14" y="{middle}" text-anchor="middle" transform="rotate(-90 14 {middle})">{}</text>"#,
        escaped(labels.y)
    );
    for (index, name) in names.iter().enumerate() {
        let [column, row] = [index % legend_columns(), index / legend_columns()].map(|at| at as f64);
        let [x, y] = [12.0 + column * LEGEND_PX, HEIGHT + 8.0 + 16.0 * row];
        let color = COLORS[index % COLORS.len()];
        _ = writeln!(svg, r#"<rect x="{x}" y="{}" width="10" height="10" fill="{color}"/>"#, y - 9.0);
        text(&mut svg, [x + 14.0, y], "start", name);
    }
    svg
}

fn legend_columns() -> usize {
    (WIDTH / LEGEND_PX) as usize
}

fn grid_line(svg: &mut String, y: f64, label: &str) {
    let [left, _, right, _] = MARGIN;
    _ = writeln!(svg, r##"<path d="M{left} {y:.1}H{}" stroke="#ddd"/>"##, WIDTH - right);
    text(svg, [left - 6.0, y + 4.0], "end", label);
}

fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, content: &str) {
    _ = writeln!(svg, r#"<text x="{x:.1}" y="{y:.1}" text-anchor="{anchor}">{}</text>"#, escaped(content));
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

/// A step of 1, 2 or 5 times a power of ten that divides a range into about five parts.
fn nice_step(range: f64) -> f64 {
    let rough = (range / 5.0).max(f64::MIN_POSITIVE);
    let unit = 10f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0].map(|step| step * unit).into_iter().find(|step| *step >= rough).unwrap_or(10.0 * unit)
}

/// A tick's value in as few digits as needed.
fn number(value: f64) -> String {
    let digits = if value == 0.0 { 0.0 } else { -value.abs().log10().floor() };
    let text = format!("{value:.*}", digits.clamp(0.0, 6.0) as usize + usize::from(value < 1.0 && value > 0.0));
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LABELS: Labels<'_> = Labels { title: "a < b", x: "k", y: "ms" };

    #[test]
    fn bars_are_as_tall_as_their_values() {
        let bars = [("5".to_owned(), vec![10.0, 30.0]), ("10".to_owned(), vec![20.0, 0.0])];
        let svg = stacked_bars(LABELS, &["search", "fit"], &bars);
        let heights: Vec<f64> = svg
            .lines()
            .filter(|line| line.starts_with("<rect x=") && line.contains("y=") && !line.contains("width=\"10\""))
            .map(|line| line.split("height=\"").nth(1).and_then(|rest| rest.split('"').next()).expect("a height"))
            .map(|height| height.parse().expect("a number"))
            .collect();
        assert_eq!(heights.len(), 4, "{svg}");
        assert!((heights[1] / heights[0] - 3.0).abs() < 0.02, "30 is three times 10: {heights:?}");
        assert!((heights[2] / heights[0] - 2.0).abs() < 0.02, "20 is twice 10: {heights:?}");
        assert!(svg.contains("a &lt; b"), "texts are escaped");
    }

    #[test]
    fn a_tenth_is_a_decade_lower() {
        let line = Line { name: "x".into(), points: vec![[1.0, 100.0], [2.0, 10.0], [3.0, 1.0], [4.0, 0.0]] };
        let svg = log_lines(LABELS, &[line]);
        let circles: Vec<f64> =
            svg.lines().filter_map(|line| line.split("cy=\"").nth(1)?.split('"').next()?.parse().ok()).collect();
        assert_eq!(circles.len(), 3, "zero has no place: {svg}");
        assert!((circles[1] - circles[0] - (circles[2] - circles[1])).abs() < 0.2, "{circles:?}");
    }

    #[test]
    fn ticks_are_short_and_round() {
        assert_eq!([0.0, 0.001, 0.5, 1.0, 20.0, 1000.0].map(number), ["0", "0.001", "0.5", "1", "20", "1000"]);
        assert_eq!(nice_step(100.0), 20.0);
        assert_eq!(nice_step(7.0), 2.0);
    }

    #[test]
    fn nothing_to_show_is_no_panic() {
        assert!(stacked_bars(LABELS, &[], &[]).ends_with("</svg>\n"));
        assert!(log_lines(LABELS, &[]).ends_with("</svg>\n"));
    }
}
