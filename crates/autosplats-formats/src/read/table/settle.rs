//! Columns to a cloud, in two steps: what all points tell is settled first, and the points are made by it. Points that
//! come in pieces are so the same as those that come at once.

use autosplats_cloud::{Crs, Error, FieldValues, PointCloud, Unit, degree_origin, residual, storage_origin};
use glam::DVec3;
use rayon::prelude::*;

use super::super::{
    Job,
    columns::{AGAIN, field_name, find_axes, find_color, is_longitude},
    units::{LOOKS_LIKE_DEGREES, look_like_degrees},
};
use super::{Column, MAX_COLUMNS, ProgressRange, Scalar, Table, collect, is_packed_color};
use crate::color_scale::{ColorLook, ColorScale};

/// Columns of 3D Gaussian splats that hold the coefficients of the colour seen from everywhere.
const SPLAT_COLORS: [&str; 3] = ["f_dc_0", "f_dc_1", "f_dc_2"];

/// The spherical harmonic of degree 0: 1 / (2 √π).
const SPLAT_COLOR_STEP: f64 = 0.282_094_791_773_878_14;

/// What the columns are.
pub(in super::super) struct Plan {
    xyz: [Column; 3],
    tint: Tint,
    /// Columns that become fields.
    rest: Vec<Column>,
    origin: DVec3,
    degrees: bool,
    /// Whether the shape of the points tells that they are in degrees.
    guessed: bool,
    /// Whether all digits are kept.
    exact: bool,
}

/// Where colours are.
enum Tint {
    None,
    Channels([Column; 3]),
    /// All channels in 32 bits.
    Packed(Column),
    /// The coefficients of 3D Gaussian splats.
    Splats([Column; 3]),
}

/// What all points tell together.
#[derive(Default)]
pub(in super::super) struct Look {
    /// Number of points.
    pub(in super::super) points: usize,
    /// Whether `f32` loses digits of a position that are wanted.
    residuals: bool,
    colors: ColorLook,
    /// Alpha of the first point.
    alpha: Option<u8>,
    /// Whether another point has another alpha.
    alpha_varies: bool,
}

/// All that the points are made by.
pub(in super::super) struct Settled {
    plan: Plan,
    residuals: bool,
    scale: ColorScale,
    /// Whether colours are kept as fields too, because 8 bits lose some.
    wide_colors: bool,
    alpha: bool,
    /// Names of the fields of the columns in `rest`.
    names: Vec<String>,
}

impl Plan {
    /// Finds out what the columns are, from their names and a sample of the points. `place` is the place in errors;
    /// `guess` tells whether coordinates without a unit may be taken for degrees by their shape.
    pub(in super::super) fn of(table: &Table<'_>, job: &Job<'_>, place: &str, guess: bool) -> Result<Self, Error> {
        let mut rest = table.columns.clone();
        if rest.len() > MAX_COLUMNS {
            return Err(job.malformed(place, format!("{} values a point; at most {MAX_COLUMNS}", rest.len())));
        }
        let names = |columns: &[Column]| columns.iter().map(|column| column.name.clone()).collect::<Vec<_>>();
        let Some(axes) = find_axes(&names(&rest)) else {
            return Err(job.malformed(place, "there are no x, y and z among the values of a point"));
        };
        table.check_size(job, place)?;
        let xyz = take(&mut rest, axes);
        let world = |i| table.world(&xyz, i);
        let fine = xyz[..2].iter().all(|column| column.scalar == Scalar::F64);
        let named = is_longitude(&xyz[0].name);
        let guessed = guess && !named && fine && job.options.columns.is_none() && look_like_degrees(table.count, world);
        let degrees = named || guessed;
        let origin = if degrees { degree_origin(table.count, world) } else { storage_origin(table.count, world) };
        let colors = find_color(&names(&rest)).map(|three| take(&mut rest, three));
        let is_packed = |column: &Column| table.packed_rgb && is_packed_color(&column.name, column.scalar);
        let packed = rest.iter().position(is_packed).map(|index| rest.remove(index));
        let splats = || find(&rest, SPLAT_COLORS).map(|indices| indices.map(|index| rest[index].clone()));
        let tint = match (colors, packed) {
            (Some(colors), _) => Tint::Channels(colors),
            (None, Some(packed)) => Tint::Packed(packed),
            (None, None) => splats().map_or(Tint::None, Tint::Splats),
        };
        Ok(Self { xyz, tint, rest, origin, degrees, guessed, exact: job.options.exact })
    }

    /// Most bytes of a point in memory.
    pub(super) fn point_bytes(&self) -> usize {
        let colors = match &self.tint {
            Tint::Channels(rgb) => rgb.iter().map(|column| column.scalar.size()).sum(),
            Tint::Packed(column) => column.scalar.size(),
            Tint::Splats(_) | Tint::None => 0,
        };
        let fields: usize = self.rest.iter().map(|column| column.scalar.size()).sum();
        12 + if self.exact { 12 } else { 0 } + colors + fields
    }

    /// Adds what the points of a table tell. Tables come in the order of the points.
    pub(in super::super) fn look(&self, table: &Table<'_>, job: &Job<'_>, look: &mut Look) -> Result<(), Error> {
        look.points += table.count;
        let lossless = |column: &Column| column.scalar == Scalar::F32 || column.scalar.size() < 4;
        let may_lose = self.exact && !(self.origin == DVec3::ZERO && self.xyz.iter().all(lossless));
        if may_lose && !look.residuals {
            look.residuals = (0..table.count).into_par_iter().any(|i| self.lost(table, i) != [0.0; 3]);
        }
        match &self.tint {
            Tint::Channels(rgb) if rgb.iter().any(|column| column.scalar != Scalar::U8) => {
                job.go_on()?;
                let color = |i| rgb.each_ref().map(|column| table.value_f64(column, i));
                look.colors = look.colors.and(ColorLook::of(table.count, self.exact, color));
            }
            Tint::Packed(column) if column.name.eq_ignore_ascii_case("rgba") && table.count > 0 => {
                let first = *look.alpha.get_or_insert_with(|| alpha(table, column, 0));
                look.alpha_varies |= (0..table.count).into_par_iter().any(|i| alpha(table, column, i) != first);
            }
            _ => {}
        }
        Ok(())
    }

    /// What `f32` loses of a position.
    fn lost(&self, table: &Table<'_>, index: usize) -> [f32; 3] {
        residual(table.world(&self.xyz, index) - self.origin)
    }

    /// The positions of a table's points, with what `f32` loses if all digits are wanted.
    pub(in super::super) fn placed(&self, table: &Table<'_>, job: &Job<'_>) -> Result<PointCloud, Error> {
        let part = ProgressRange { start: 0.0, len: 0.0 };
        let cloud = PointCloud::new(self.origin, table.positions(job, &self.xyz, self.origin, part)?);
        if !self.exact {
            return Ok(cloud);
        }
        cloud.with_residuals(collect("residuals", table.count, job, part, |i| self.lost(table, i))?)
    }

    /// Decides by what all points tell, and tells the user.
    pub(in super::super) fn settle(self, look: &Look, job: &Job<'_>) -> Settled {
        if self.guessed {
            job.note(LOOKS_LIKE_DEGREES);
        }
        let channels = if let Tint::Channels(rgb) = &self.tint { &rgb[..] } else { &[] };
        let is_float = |column: &Column| matches!(column.scalar, Scalar::F32 | Scalar::F64);
        let float = channels.iter().any(is_float);
        let scale = look.colors.scale(float);
        if channels.iter().any(|column| column.scalar != Scalar::U8) {
            let wide = !float && channels.iter().any(|column| column.scalar.size() > 1);
            if let Some(note) = scale.note() {
                job.note(note);
            } else if wide && look.points > 0 && scale.full() == 255.0 {
                job.note("colours of 16 bits or more have no value above 255; read as 8 bits");
            }
        }
        if matches!(self.tint, Tint::Splats(_)) {
            job.note("these are 3D Gaussian splats; shown as points in their base colours");
        }
        let (wide_colors, alpha) = (self.exact && look.colors.loses(scale), look.alpha_varies);
        let mut fields: Vec<String> = Vec::new();
        if wide_colors {
            fields.extend(CHANNELS.map(String::from));
        }
        if alpha {
            fields.push(ALPHA.into());
        }
        let own = fields.len();
        let known: Vec<String> = self.xyz.iter().chain(channels).map(|column| column.name.to_lowercase()).collect();
        for column in &self.rest {
            // Two columns may map to one name, as `intensity` and `scalar_Intensity` do.
            let mut name = field_name(&column.name);
            let again = known.contains(&name.to_lowercase());
            if again {
                job.note(format!("there is more than one {name}; the first is read, another is kept as {name}{AGAIN}"));
                name.push_str(AGAIN);
            }
            while fields.contains(&name) {
                name.push_str(if again { AGAIN } else { "_" });
            }
            fields.push(name);
        }
        let names = fields.split_off(own);
        Settled { residuals: look.residuals, scale, wide_colors, alpha, names, plan: self }
    }
}

/// Names of the fields of colours that 8 bits do not hold.
const CHANNELS: [&str; 3] = ["Red", "Green", "Blue"];

const ALPHA: &str = "Alpha";

fn alpha(table: &Table<'_>, column: &Column, index: usize) -> u8 {
    table.value::<u32>(column, index).to_be_bytes()[0]
}

impl Settled {
    /// Whether points have colours.
    pub(in super::super) fn colored(&self) -> bool {
        !matches!(self.plan.tint, Tint::None)
    }

    /// Makes the points of a table.
    pub(in super::super) fn build(&self, table: &Table<'_>, job: &Job<'_>) -> Result<PointCloud, Error> {
        let Plan { xyz, tint, rest, origin, .. } = &self.plan;
        let steps = 1 + usize::from(self.colored()) + rest.len();
        let part = |step: usize| ProgressRange {
            start: table.done + (1.0 - table.done) * step as f32 / steps as f32,
            len: (1.0 - table.done) / steps as f32,
        };
        let mut cloud = PointCloud::new(*origin, table.positions(job, xyz, *origin, part(0))?);
        if self.plan.degrees {
            cloud = cloud.with_crs(Crs { unit: Some(Unit::Degree), ..Crs::default() });
        }
        if self.residuals {
            let none = ProgressRange { start: part(1).start, len: 0.0 };
            let lost = |i| self.plan.lost(table, i);
            cloud = cloud.with_residuals(collect("residuals", table.count, job, none, lost)?)?;
        }
        let colors = |color: &(dyn Fn(usize) -> [u8; 3] + Sync)| collect("colours", table.count, job, part(1), color);
        match tint {
            Tint::None => {}
            Tint::Channels(rgb) if rgb.iter().all(|column| column.scalar == Scalar::U8) => {
                let color = |i| rgb.each_ref().map(|column| table.value::<u8>(column, i));
                cloud = cloud.with_colors(collect("colours", table.count, job, part(1), color)?)?;
            }
            Tint::Channels(rgb) => {
                let color = |i| rgb.each_ref().map(|column| self.scale.byte(table.value_f64(column, i)));
                cloud = cloud.with_colors(collect("colours", table.count, job, part(1), color)?)?;
                for (column, name) in rgb.iter().zip(CHANNELS).filter(|_| self.wide_colors) {
                    cloud = cloud.with_field(name, table.field(job, column, part(1))?)?;
                }
            }
            Tint::Packed(column) => {
                if self.alpha {
                    let values = collect("alpha", table.count, job, part(1), |i| alpha(table, column, i))?;
                    cloud = cloud.with_field(ALPHA, FieldValues::U8(values))?;
                }
                cloud = cloud.with_colors(colors(&|i| {
                    let [_, red, green, blue] = table.value::<u32>(column, i).to_be_bytes();
                    [red, green, blue]
                })?)?;
            }
            Tint::Splats(rgb) => {
                let byte = |value: f64| ((0.5 + SPLAT_COLOR_STEP * value) * 255.0 + 0.5) as u8;
                cloud =
                    cloud.with_colors(colors(&|i| rgb.each_ref().map(|column| byte(table.value_f64(column, i))))?)?;
            }
        }
        let first = steps - rest.len();
        for (step, (column, name)) in (first..).zip(rest.iter().zip(&self.names)) {
            cloud = cloud.with_field(name, table.field(job, column, part(step))?)?;
        }
        Ok(cloud)
    }
}

/// Indices of the columns of three names, if all are there. Letter case is ignored.
fn find(columns: &[Column], names: [&str; 3]) -> Option<[usize; 3]> {
    let find = |name: &str| columns.iter().position(|column| column.name.eq_ignore_ascii_case(name));
    Some([find(names[0])?, find(names[1])?, find(names[2])?])
}

/// Removes and returns three columns.
fn take(columns: &mut Vec<Column>, indices: [usize; 3]) -> [Column; 3] {
    let taken = indices.map(|index| columns[index].clone());
    let mut index = 0;
    columns.retain(|_| {
        index += 1;
        !indices.contains(&(index - 1))
    });
    taken
}
