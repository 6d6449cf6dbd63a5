//! Sinew for Python: the module `sinew._sinew` behind the package `sinew`.
//!
//! Path of data: numpy arrays -> [`sequence`] -> [`train`] -> [`package`] (compact, then baked) -> [`player`] -> numpy arrays, without a
//! copy on the frame path and without the interpreter's lock while anything is computed.

mod errors;
mod package;
mod player;
mod sequence;
mod train;

use pyo3::prelude::*;

#[pymodule]
fn _sinew(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("SinewError", module.py().get_type::<errors::SinewError>())?;
    module.add_class::<package::Package>()?;
    module.add_class::<package::Component>()?;
    module.add_class::<player::Player>()?;
    module.add_function(wrap_pyfunction!(train::train, module)?)?;
    module.add_function(wrap_pyfunction!(package::load, module)?)?;
    module.add_function(wrap_pyfunction!(sequence::read, module)?)?;
    Ok(())
}
