//! One exception for all that Sinew refuses, with the sentences of its errors.

use core::error::Error;

use pyo3::create_exception;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

create_exception!(
    sinew,
    SinewError,
    PyValueError,
    "Sinew refuses an input; the text says what is wrong and what to do."
);

/// An error and what caused it, in one text.
pub fn refused(error: impl Error) -> PyErr {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        // Some errors repeat their cause in their own text.
        let more = error.to_string();
        if !text.contains(&more) {
            text = format!("{text}: {more}");
        }
        cause = error.source();
    }
    SinewError::new_err(text)
}

/// A sentence of ours.
pub fn refuse(text: impl Into<String>) -> PyErr {
    SinewError::new_err(text.into())
}
