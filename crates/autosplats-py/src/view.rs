//! Arrays that show the memory of an immutable object without a copy.

use numpy::ndarray::{ArrayView, Dimension, StrideShape};
use numpy::{Element, PyArray, PyArrayMethods as _};
use pyo3::prelude::*;

/// A read-only array of `shape` over `values`, which belong to `owner`. The array keeps the owner alive.
pub(crate) fn view<'py, T: Element, D: Dimension>(
    values: &[T],
    shape: impl Into<StrideShape<D>>,
    owner: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let view = ArrayView::from_shape(shape, values)
        .map_err(|error| crate::errors::Failure::Fault(error.to_string()).raise())?;
    #[allow(unsafe_code, reason = "the only way to lend memory to numpy")]
    // SAFETY: the owner, which the array keeps, is a frozen class: its values neither move nor change while it lives.
    let array = unsafe { PyArray::borrow_from_array(&view, owner) };
    // Nothing may be written through it.
    array.try_readwrite()?.make_nonwriteable();
    Ok(array)
}
