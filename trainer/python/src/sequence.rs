//! Numpy arrays as a mesh sequence, checked as files are.

use core::ffi::CStr;
use std::ffi::CString;
use std::path::PathBuf;

use numpy::{AllowTypeChange, PyArray1, PyArrayLike2, PyArrayLike3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use sinew_interchange::{Choice, MAPPED_FROM_BYTES, MeshSequence, ShapeStore, read_sequence};

use crate::errors::{refuse, refused};

/// Shapes: `positions` `[N][V][3]`, `faces` `[F][3]`.
pub type Positions<'py> = PyArrayLike3<'py, f32, AllowTypeChange>;
pub type FaceArray<'py> = PyArrayLike2<'py, i64, AllowTypeChange>;

/// Triangles. Shape: `[F]`; every index < V.
pub fn faces_of(faces: &FaceArray<'_>, vertex_count: usize) -> PyResult<Vec<[u32; 3]>> {
    if faces.shape()[1] != 3 {
        return Err(refuse(format!("faces must have shape (F, 3), not {:?}", faces.shape())));
    }
    let array = faces.as_array();
    let mut triangles = Vec::with_capacity(array.nrows());
    for (f, row) in array.rows().into_iter().enumerate() {
        let mut triangle = [0; 3];
        for (corner, &vertex) in triangle.iter_mut().zip(row) {
            *corner = u32::try_from(vertex)
                .ok()
                .filter(|&vertex| (vertex as usize) < vertex_count)
                .ok_or_else(|| refuse(format!("face {f} names vertex {vertex}, but there are {vertex_count}")))?;
        }
        triangles.push(triangle);
    }
    if triangles.is_empty() {
        return Err(refuse("there are no faces"));
    }
    Ok(triangles)
}

/// A sequence of its own, so that the arrays may change while it is used.
pub fn sequence_of(positions: &Positions<'_>, faces: Vec<[u32; 3]>) -> PyResult<MeshSequence> {
    let &[shape_count, vertex_count, 3] = positions.shape() else {
        return Err(refuse(format!(
            "positions must have shape (N, V, 3), not {:?}",
            positions.shape()
        )));
    };
    if shape_count == 0 {
        return Err(refuse("there are no shapes"));
    }
    let mut shapes = ShapeStore::zeros(shape_count, vertex_count, MAPPED_FROM_BYTES).map_err(refused)?;
    for (place, &x) in shapes.values_mut().iter_mut().zip(positions.as_array().iter()) {
        *place = x;
    }
    let values = shapes.values_mut();
    if let Some(place) = values.iter().position(|x| !x.is_finite()) {
        let (shape, vertex) = (place / (3 * vertex_count), place / 3 % vertex_count);
        return Err(refuse(format!(
            "shape {shape}, vertex {vertex} holds {}",
            values[place]
        )));
    }
    Ok(MeshSequence {
        name: "positions".into(),
        faces,
        shape_names: (0..shape_count).map(|m| format!("positions[{m}]")).collect(),
        shapes,
        ..MeshSequence::default()
    })
}

/// The vertex count of an array of shapes, before anything of it is copied.
pub fn vertex_count_of(positions: &Positions<'_>) -> usize {
    positions.shape()[1]
}

/// Triangles of a package as numpy has them.
pub fn face_array<'py>(py: Python<'py>, faces: &[[u32; 3]]) -> PyResult<Bound<'py, PyAny>> {
    matrix(py, faces.as_flattened().to_vec(), 3)
}

/// A matrix of rows of one length.
pub fn matrix<'py, T: numpy::Element>(py: Python<'py>, values: Vec<T>, columns: usize) -> PyResult<Bound<'py, PyAny>> {
    let rows = values.len() / columns.max(1);
    Ok(PyArray1::from_vec(py, values).reshape([rows, columns])?.into_any())
}

/// See the stub file.
#[pyfunction]
#[pyo3(signature = (path, *, mesh=None, clip=None))]
pub fn read<'py>(
    py: Python<'py>,
    path: PathBuf,
    mesh: Option<Vec<String>>,
    clip: Option<String>,
) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
    let choice = Choice {
        meshes: mesh.unwrap_or_default(),
        clip,
        ..Choice::default()
    };
    let read = py
        .detach(|| read_sequence(&path, &choice, &mut |_, _| {}))
        .map_err(refused)?;
    for notice in &read.notices {
        let text = CString::new(notice.to_string().replace('\0', " "))?;
        warn(py, &text)?;
    }
    let (shape_count, vertex_count) = (read.sequence.shape_count(), read.sequence.vertex_count());
    let values: Vec<f32> = read
        .sequence
        .shapes
        .iter()
        .flat_map(|shape| shape.as_flattened())
        .copied()
        .collect();
    let positions = PyArray1::from_vec(py, values).reshape([shape_count, vertex_count, 3])?;
    Ok((positions.into_any(), face_array(py, &read.sequence.faces)?))
}

/// A notice that can be lived with.
pub fn warn(py: Python<'_>, text: &CStr) -> PyResult<()> {
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), text, 2)
}
