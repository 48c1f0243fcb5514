//! What all rows of a text tell, and what follows from it for each point. Rows that are read in pieces become the same
//! points as those that are read at once.

use autosplats_cloud::{Error, FieldValues, PointCloud};
use glam::DVec3;
use rayon::prelude::*;

use super::super::{Job, cuts::Text, table::reserve};
use super::{
    columns::{Colors, Columns, Values, floats},
    layout::Layout,
};
use crate::color_scale::{ColorLook, ColorScale};

/// Heights that models write where there is none.
const NO_HEIGHTS: [f64; 4] = [-9999.0, -99999.0, -32767.0, -32768.0];

/// What rows tell. What parts of a text tell can be added.
#[derive(Default)]
pub(super) struct Look {
    pub(super) points: usize,
    pub(super) without: Without,
    /// Sum of the counts between rows.
    pub(super) counts: usize,
    /// Whether `f32` loses digits of a position that are wanted.
    residuals: bool,
    /// Whether some colour is no whole number of 0 to 255.
    floats: bool,
    /// Whether some colour is above 1, if all are such numbers.
    above_one: bool,
    /// Whether some colour is no whole number of 16 bits.
    fractions: bool,
    colors: ColorLook,
    heights: Heights,
}

impl Look {
    /// What points tell that are stored about an origin.
    pub(super) fn of(columns: &Columns, origin: DVec3, exact: bool) -> Self {
        let (floats, above_one, fractions, colors) = match &columns.colors {
            Colors::Bytes(bytes) => {
                let above_one = bytes.iter().flatten().any(|&value| value > 1);
                (false, above_one, false, ColorLook::of_bytes(bytes))
            }
            Colors::Floats(floats) => {
                let whole = |value: &f32| (0.0..=65535.0).contains(value) && value.fract() == 0.0;
                let fractions = exact && !floats.iter().flatten().all(whole);
                (true, false, fractions, ColorLook::of(floats.len(), exact, |i| floats[i].map(f64::from)))
            }
        };
        Self {
            points: columns.positions.len(),
            residuals: columns.residuals.iter().any(|residual| *residual != [0.0; 3]),
            floats,
            above_one,
            fractions,
            colors,
            heights: Heights::of(&columns.positions, origin.z),
            ..Self::default()
        }
    }

    /// Adds what the rows after these tell.
    pub(super) fn add(&mut self, other: Self) {
        self.points += other.points;
        self.without.add(other.without);
        self.counts = self.counts.saturating_add(other.counts);
        self.residuals |= other.residuals;
        self.floats |= other.floats;
        self.above_one |= other.above_one;
        self.fractions |= other.fractions;
        self.colors = self.colors.and(other.colors);
        self.heights = self.heights.and(other.heights);
    }

    /// Fails if so many rows lack coordinates that the columns must be others, or if rows are missing. Tells of fewer.
    /// `promised` is the number of points that the text states before the first.
    pub(super) fn check(&self, job: &Job<'_>, text: &Text<'_>, promised: Option<usize>) -> Result<(), Error> {
        self.without.check(job, text, self.points)?;
        check_promise(job, text, self.points, promised, self.counts)
    }

    /// Decides, and tells the user.
    pub(super) fn settle(&self, job: &Job<'_>, has_color: bool, origin: DVec3, exact: bool) -> Settled {
        // If no value exceeds 1, the colours are rather floats that happen to be 0 or 1.
        let scaled = has_color && (self.floats || !self.above_one);
        let scale = scaled.then(|| self.colors.scale(true));
        scale.and_then(ColorScale::note).iter().for_each(|note| job.note(note));
        let loses = exact && scale.is_some_and(|scale| self.colors.loses(scale));
        let mut settled =
            Settled { residuals: self.residuals, scale, wide: loses.then_some(!self.fractions), without_height: 0 };
        if let Some(value) = self.heights.none(origin.z) {
            settled.without_height = self.heights.marked;
            let (count, points) = (self.heights.marked, self.points);
            job.note(format!("{count} of {points} points have the height {value}, which stands for none; left out"));
        }
        settled
    }
}

/// What all rows decide.
pub(super) struct Settled {
    pub(super) residuals: bool,
    /// The scale of colours; `None` if all are whole numbers of 0 to 255.
    pub(super) scale: Option<ColorScale>,
    /// Whether colours are kept as fields, too; if they are, whether all are whole numbers of 16 bits.
    pub(super) wide: Option<bool>,
    /// Number of points whose height stands for none.
    pub(super) without_height: usize,
}

impl Settled {
    /// Makes the points of these values, which are stored about an origin.
    pub(super) fn build(&self, columns: Columns, layout: &Layout, origin: DVec3) -> Result<PointCloud, Error> {
        let mut positions = columns.positions;
        positions.shrink_to_fit();
        let mut cloud = PointCloud::new(origin, positions);
        if self.residuals {
            cloud = cloud.with_residuals(columns.residuals)?;
        }
        if layout.has_color {
            cloud = self.with_colors(cloud, columns.colors)?;
        }
        for ((name, _), values) in layout.fields.iter().zip(columns.fields) {
            let values = match values {
                Values::F32(mut values) => {
                    values.shrink_to_fit();
                    FieldValues::F32(values)
                }
                Values::F64(values) => FieldValues::F64(values),
            };
            cloud = cloud.with_field(name, values)?;
        }
        Ok(cloud)
    }

    fn with_colors(&self, cloud: PointCloud, colors: Colors) -> Result<PointCloud, Error> {
        let Some(scale) = self.scale else {
            return match colors {
                Colors::Bytes(bytes) => cloud.with_colors(bytes),
                // All were bytes when the scale was settled, so the file has changed, which ends reading.
                Colors::Floats(floats) => {
                    cloud.with_colors(floats.iter().map(|color| color.map(|v| v as u8)).collect())
                }
            };
        };
        let floats = match colors {
            Colors::Bytes(bytes) => floats(&bytes)?,
            Colors::Floats(floats) => floats,
        };
        let mut bytes = Vec::new();
        reserve(&mut bytes, floats.len(), "colours")?;
        bytes.par_extend(floats.par_iter().map(|color| color.map(|value| scale.byte(value.into()))));
        let mut cloud = cloud.with_colors(bytes)?;
        let Some(whole) = self.wide else { return Ok(cloud) };
        for (channel, name) in ["Red", "Green", "Blue"].into_iter().enumerate() {
            let values = floats.iter().map(|color| color[channel]);
            cloud = cloud.with_field(
                name,
                if whole {
                    FieldValues::U16(values.map(|value| value as u16).collect())
                } else {
                    FieldValues::F32(values.collect())
                },
            )?;
        }
        Ok(cloud)
    }

    /// Drops points whose height stands for none.
    pub(super) fn drop_no_heights(&self, cloud: &mut PointCloud) {
        if self.without_height > 0 {
            let up = cloud.origin().z;
            let none: Vec<bool> = cloud.positions().iter().map(|point| stands_for_none(height(point, up))).collect();
            cloud.retain(|i| !none[i]);
        }
    }
}

fn height(point: &[f32; 3], up: f64) -> f64 {
    f64::from(point[2]) + up
}

fn stands_for_none(height: f64) -> bool {
    // Nearly all heights are above.
    height <= NO_HEIGHTS[0] && NO_HEIGHTS.contains(&height)
}

/// The heights of points.
#[derive(Clone, Copy)]
struct Heights {
    lowest: f32,
    /// Number of those that may stand for none.
    marked: usize,
    /// The lowest and the highest of those, and of the others.
    marks: [f64; 2],
    others: [f64; 2],
}

impl Default for Heights {
    fn default() -> Self {
        let none = [f64::INFINITY, f64::NEG_INFINITY];
        Self { lowest: f32::INFINITY, marked: 0, marks: none, others: none }
    }
}

impl Heights {
    fn of(positions: &[[f32; 3]], up: f64) -> Self {
        let range = |[low, high]: [f32; 2], point: &[f32; 3]| [low.min(point[2]), high.max(point[2])];
        let [lowest, highest] = positions.iter().fold([f32::INFINITY, f32::NEG_INFINITY], range);
        let [low, high] = [lowest, highest].map(|height| f64::from(height) + up);
        if !(low <= NO_HEIGHTS[0]) {
            return Self { lowest, others: [low, high], ..Self::default() };
        }
        let mut heights = Self { lowest, ..Self::default() };
        for point in positions {
            let height = height(point, up);
            let range = if stands_for_none(height) {
                heights.marked += 1;
                &mut heights.marks
            } else {
                &mut heights.others
            };
            *range = [range[0].min(height), range[1].max(height)];
        }
        heights
    }

    fn and(self, other: Self) -> Self {
        let join = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
        Self {
            lowest: self.lowest.min(other.lowest),
            marked: self.marked + other.marked,
            marks: join(self.marks, other.marks),
            others: join(self.others, other.others),
        }
    }

    /// The height that stands for none, which is told by the heights of the others: they span less than they are away
    /// from it. It is the lowest of all.
    fn none(&self, up: f64) -> Option<f64> {
        let ([_, mark], [low, high]) = (self.marks, self.others);
        let is_lowest = NO_HEIGHTS.contains(&(f64::from(self.lowest) + up));
        (is_lowest && self.marked > 0 && low <= high && low - mark > high - low).then_some(self.marks[0])
    }
}

/// Rows without coordinates.
#[derive(Default)]
pub(super) struct Without {
    pub(super) count: usize,
    /// How many of them hold no value at all.
    pub(super) empty: usize,
    /// The first: its first byte, and what is missing.
    pub(super) first: Option<(usize, String)>,
}

impl Without {
    pub(super) fn add(&mut self, other: Self) {
        self.count += other.count;
        self.empty += other.empty;
        self.first = self.first.take().or(other.first);
    }

    /// Tells of them. A text in which most rows are so has other columns than was thought.
    fn check(&self, job: &Job<'_>, text: &Text<'_>, points: usize) -> Result<(), Error> {
        let Some((at, what)) = &self.first else { return Ok(()) };
        let (count, rows) = (self.count, self.count + points);
        if self.count - self.empty >= points {
            let what = format!("{what}, as in {count} of {rows} rows; name the columns with --columns");
            return Err(job.malformed(text.line(*at)?, what));
        }
        job.note(format!("{count} of {rows} rows have no coordinates; skipped, the first in {}", text.line(*at)?));
        Ok(())
    }
}

/// Compares the number of rows with the stated counts.
fn check_promise(
    job: &Job<'_>,
    text: &Text<'_>,
    rows: usize,
    first: Option<usize>,
    between: usize,
) -> Result<(), Error> {
    let Some(first) = first else { return Ok(()) };
    if rows < first {
        return Err(job.malformed(
            text.line(text.len())?,
            format!("the file ends after {rows} of {first} points; it is cut off, copy it again"),
        ));
    }
    let all = first.saturating_add(between);
    if rows < all {
        let loss = format!("the counts of points add up to {all}, but there are {rows}; the file may be cut off");
        job.loss(&text.line(text.len())?, loss)?;
    }
    Ok(())
}
