//! Arrays of Python to the values of clouds. Each is copied once, while the interpreter is held, so that no thread of
//! Python changes it meanwhile.

use autosplats_cloud::{FieldValues, PointCloud, glam::DVec3};
use numpy::{Element, PyArrayMethods as _, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::errors::{self, Class, Failure};

/// A cloud of the positions in an (n, 3) array of `f32` or `f64`, in any order and with any strides. If `exact`, no
/// digit is lost.
pub(crate) fn cloud(positions: &Bound<'_, PyAny>, exact: bool) -> PyResult<PointCloud> {
    if let Ok(rows) = positions.extract::<PyReadonlyArray2<'_, f32>>() {
        return of_rows(&rows, exact);
    }
    match positions.extract::<PyReadonlyArray2<'_, f64>>() {
        Ok(rows) => of_rows(&rows, exact),
        Err(_) => Err(errors::raise(Class::Argument, "points: an (n, 3) array of float32 or float64 is wanted".into())),
    }
}

fn of_rows<T: Element + Copy + Into<f64>>(rows: &PyReadonlyArray2<'_, T>, exact: bool) -> PyResult<PointCloud> {
    let rows = rows.as_array();
    let &[count, 3] = rows.shape() else {
        return Err(errors::raise(Class::Argument, format!("points: shape {:?}, must be (n, 3)", rows.shape())));
    };
    if u32::try_from(count).is_err() {
        return Err(Failure::Render(autosplats::Error::TooManyPoints(count)).raise());
    }
    autosplats_cloud::check_memory("the points", 12 * (1 + u64::from(exact)) * count as u64)
        .map_err(|error| Failure::Cloud(error).raise())?;
    // Values side by side are read several times as fast as through strides.
    Ok(match rows.as_slice() {
        Some(values) => {
            let (values, _) = values.as_chunks::<3>();
            PointCloud::from_world(count, |i| DVec3::from(values[i].map(Into::into)), exact)
        }
        None => PointCloud::from_world(
            count,
            |i| DVec3::new(rows[[i, 0]].into(), rows[[i, 1]].into(), rows[[i, 2]].into()),
            exact,
        ),
    })
}

/// Colours of an (n, 3) or (n, 4) array of bytes; the fourth is left out.
pub(crate) fn colors(colors: &PyReadonlyArray2<'_, u8>) -> Vec<[u8; 3]> {
    let colors = colors.as_array();
    match (colors.as_slice(), colors.ncols()) {
        (Some(values), 3) => values.as_chunks::<3>().0.to_vec(),
        _ => colors.rows().into_iter().map(|row| [row[0], row[1], row[2]]).collect(),
    }
}

/// Values of a field in an array of one dimension.
pub(crate) fn field(name: &str, values: &Bound<'_, PyAny>) -> PyResult<FieldValues> {
    macro_rules! each {
        ($($variant:ident $type:ty),*) => {
            $(if let Ok(values) = values.extract::<PyReadonlyArray1<'_, $type>>() {
                return Ok(FieldValues::$variant(values.as_array().to_vec()));
            })*
        };
    }
    each!(F32 f32, F64 f64, U8 u8, I8 i8, U16 u16, I16 i16, U32 u32, I32 i32, U64 u64, I64 i64);
    Err(errors::raise(Class::Argument, format!("field {name}: one number per point is wanted")))
}

/// Rows of three numbers as an array, which takes their memory.
pub(crate) fn rows<'py, T: Element>(py: Python<'py>, rows: Vec<[T; 3]>) -> PyResult<Bound<'py, PyAny>> {
    let count = rows.len();
    let flat = numpy::PyArray1::from_vec(py, rows.into_flattened());
    Ok(flat.reshape([count, 3])?.into_any())
}
