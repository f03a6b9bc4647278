//! Arguments that are arrays.

use numpy::{
    PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArray1, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{expected, unfit};

/// An argument as a C-contiguous array of doubles; it is not copied if it is one.
pub(crate) fn doubles<'py>(
    argument: &str,
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let py = given.py();
    // A masked value is a missing one.
    if given.hasattr("mask")? && given.hasattr("filled")? {
        let numbers = given
            .call_method1("astype", ("float64",))
            .map_err(|_| expected(argument, "an array of numbers", "a masked array of another kind"))?;
        return doubles(argument, &numbers.call_method1("filled", (f64::NAN,))?);
    }
    if let Ok(array) = given.cast::<PyArrayDyn<f64>>()
        && array.is_c_contiguous()
    {
        return Ok(array.readonly());
    }
    let numpy = py.import("numpy")?;
    let wrong = |given: &Bound<'py, PyAny>| {
        let name = given.get_type().name().map_or_else(|_| "an object".to_owned(), |name| name.to_string());
        let dtype = given.getattr("dtype").map_or(name, |dtype| format!("dtype {dtype}"));
        expected(argument, "an array of numbers", dtype)
    };
    let any = numpy.call_method1("asarray", (given,)).map_err(|_| wrong(given))?;
    let kind: String = any.getattr("dtype")?.getattr("kind")?.extract()?;
    // Booleans, integers and floats; complex numbers, text and objects are not quantities.
    if !"biuf".contains(&kind) {
        return Err(wrong(&any));
    }
    let options = PyDict::new(py);
    options.set_item("dtype", "float64")?;
    options.set_item("order", "C")?;
    let array = numpy.call_method("asarray", (any,), Some(&options))?;
    let array =
        array.cast_into::<PyArrayDyn<f64>>().map_err(|error| PyTypeError::new_err(error.to_string()))?;
    Ok(array.readonly())
}

/// An argument with a shape; `None` stands for any length. The shape is returned beside the numbers.
pub(crate) fn shaped<'py, const N: usize>(
    argument: &str,
    given: &Bound<'py, PyAny>,
    shape: [Option<usize>; N],
    names: &str,
) -> PyResult<(PyReadonlyArrayDyn<'py, f64>, [usize; N])> {
    let array = doubles(argument, given)?;
    let found: Option<[usize; N]> = array.shape().try_into().ok();
    match found {
        Some(found) if found.iter().zip(shape).all(|(&n, want)| want.is_none_or(|want| n == want)) => {
            Ok((array, found))
        }
        _ => {
            let want: Vec<String> = names
                .split(',')
                .zip(shape)
                .map(|(name, n)| {
                    n.map_or_else(|| name.trim().to_owned(), |n| format!("{} = {n}", name.trim()))
                })
                .collect();
            Err(unfit(argument, format!("shape ({})", want.join(", ")), format!("{:?}", array.shape())))
        }
    }
}

/// A row of numbers; an array of doubles is read in place.
pub(crate) fn row(
    argument: &str,
    given: &Bound<'_, PyAny>,
    width: usize,
    with: impl FnOnce(&[f64]),
) -> PyResult<()> {
    if let Ok(array) = given.extract::<PyReadonlyArray1<'_, f64>>()
        && let Ok(slice) = array.as_slice()
        && slice.len() == width
    {
        with(slice);
        return Ok(());
    }
    let (array, _) = shaped(argument, given, [Some(width)], "channels")?;
    with(array.as_slice()?);
    Ok(())
}

/// A new array of two dimensions.
pub(crate) fn table(py: Python<'_>, values: Vec<f64>, width: usize) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let rows = values.len().checked_div(width).unwrap_or(0);
    rows_of(py, values, rows, width)
}

/// A table with a number of rows, also without columns.
pub(crate) fn rows_of(
    py: Python<'_>,
    values: Vec<f64>,
    rows: usize,
    width: usize,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    numpy::PyArray1::from_vec(py, values).reshape([rows, width])
}
