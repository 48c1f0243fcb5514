//! The values of rows as columns.

use autosplats_cloud::Error;

use super::super::table::reserve;
use super::layout::Layout;

/// The values of a piece of text, or of all of it.
pub(super) struct Columns {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) residuals: Vec<[f32; 3]>,
    pub(super) colors: Colors,
    pub(super) fields: Vec<Values>,
}

/// Colours in the narrowest type that holds all values so far.
pub(super) enum Colors {
    /// Whole numbers of 0 to 255.
    Bytes(Vec<[u8; 3]>),
    Floats(Vec<[f32; 3]>),
}

/// Values of a field. Text does not state how wide its numbers are.
pub(super) enum Values {
    F32(Vec<f32>),
    F64(Vec<f64>),
}

impl Columns {
    pub(super) fn new(layout: &Layout) -> Self {
        let values = |(_, wide): &(String, bool)| if *wide { Values::F64(Vec::new()) } else { Values::F32(Vec::new()) };
        Self {
            positions: Vec::new(),
            residuals: Vec::new(),
            colors: Colors::Bytes(Vec::new()),
            fields: layout.fields.iter().map(values).collect(),
        }
    }

    pub(super) fn append(&mut self, other: &Self) -> Result<(), Error> {
        append(&mut self.positions, &other.positions, "positions")?;
        append(&mut self.residuals, &other.residuals, "residuals")?;
        match (&mut self.colors, &other.colors) {
            (Colors::Bytes(all), Colors::Bytes(more)) => append(all, more, "colours")?,
            (Colors::Floats(all), Colors::Floats(more)) => append(all, more, "colours")?,
            (Colors::Floats(all), Colors::Bytes(more)) => append(all, &floats(more)?, "colours")?,
            (Colors::Bytes(all), Colors::Floats(more)) => {
                let mut widened = floats(all)?;
                append(&mut widened, more, "colours")?;
                self.colors = Colors::Floats(widened);
            }
        }
        for (all, more) in self.fields.iter_mut().zip(&other.fields) {
            match (all, more) {
                (Values::F32(all), Values::F32(more)) => append(all, more, "a field")?,
                (Values::F64(all), Values::F64(more)) => append(all, more, "a field")?,
                _ => unreachable!("both are made from one layout"),
            }
        }
        Ok(())
    }
}

fn append<T: Copy>(all: &mut Vec<T>, more: &[T], what: &str) -> Result<(), Error> {
    reserve(all, more.len(), what)?;
    all.extend_from_slice(more);
    Ok(())
}

/// Colours as floats.
pub(super) fn floats(bytes: &[[u8; 3]]) -> Result<Vec<[f32; 3]>, Error> {
    let mut floats = Vec::new();
    reserve(&mut floats, bytes.len(), "colours")?;
    floats.extend(bytes.iter().map(|color| color.map(f32::from)));
    Ok(floats)
}

impl Colors {
    pub(super) fn push(&mut self, color: [f64; 3]) {
        let bytes = color.map(|value| value as u8);
        match self {
            Self::Bytes(all) if bytes.map(f64::from) == color => all.push(bytes),
            Self::Bytes(all) => {
                let mut floats: Vec<[f32; 3]> = all.iter().map(|color| color.map(f32::from)).collect();
                floats.push(color.map(|value| value as f32));
                *self = Self::Floats(floats);
            }
            Self::Floats(all) => all.push(color.map(|value| value as f32)),
        }
    }
}
