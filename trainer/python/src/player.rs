//! The frame path on numpy arrays: weights in, positions in the caller's memory.

use std::sync::{Arc, Mutex, MutexGuard, TryLockError};

use numpy::{AllowTypeChange, PyArray1, PyArrayLike1, PyReadwriteArray2, PyUntypedArrayMethods};
use ouroboros::self_referencing;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use sinew_formats::package::AlignedBytes;
use sinew_runtime::{
    Basis, BoneMaps, BoneOutput, Controls, Drag, Frame, FrameError, FrameOutcome, Handles, HandlesLayout, Kernels,
    TierChoice, Workspace, WorkspaceLayout,
};

use crate::errors::{refuse, refused};
use crate::sequence::matrix;

/// Vertices that may be held at a time.
const HELD_MAX: usize = 16;

type Weights<'py> = PyArrayLike1<'py, f32, AllowTypeChange>;

#[self_referencing]
struct Playing {
    bytes: Arc<AlignedBytes>,
    memory: Vec<u8>,
    held_memory: Vec<u8>,
    weights: Vec<f32>,
    #[borrows(bytes)]
    #[covariant]
    basis: Basis<'this>,
    #[borrows(basis, mut weights)]
    #[not_covariant]
    controls: Controls<'this>,
    #[borrows(basis, mut memory)]
    #[not_covariant]
    workspace: Workspace<'this>,
    #[borrows(basis, mut held_memory)]
    #[not_covariant]
    held: Handles<'this>,
}

/// See the stub file.
#[pyclass(frozen, module = "sinew")]
pub struct Player {
    playing: Mutex<Playing>,
    tier: TierChoice,
    vertex_count: usize,
    component_count: usize,
    bone_count: usize,
}

impl Player {
    /// A player of a baked package, of its nearest tier or of the named one.
    pub fn new(bytes: Arc<AlignedBytes>, tier: Option<&str>) -> PyResult<Self> {
        let basis = Basis::open(&bytes).map_err(refused)?;
        let tier = match tier {
            None => basis.nearest_tier(),
            Some("exact") => TierChoice::Exact,
            Some("bones") => TierChoice::Bones,
            Some(name) => return Err(refuse(format!("tier must be \"exact\" or \"bones\", not {name:?}"))),
        };
        let layout = WorkspaceLayout::for_tier(&basis, tier).map_err(refused)?;
        let memory = vec![0; layout.unaligned_bytes()];
        let held_memory = vec![0; HandlesLayout::for_basis(&basis, HELD_MAX).unaligned_bytes()];
        let (vertex_count, component_count) = (basis.vertex_count(), basis.component_count());
        let bone_count = basis.bones().map_or(0, |bones| bones.count());
        let playing = PlayingTryBuilder {
            bytes,
            memory,
            held_memory,
            weights: vec![0.0; component_count],
            basis_builder: |bytes: &Arc<AlignedBytes>| Basis::open(bytes).map_err(refused),
            controls_builder: |basis, weights: &mut Vec<f32>| Controls::new(basis, weights).map_err(refused),
            workspace_builder: |basis, memory: &mut Vec<u8>| {
                Workspace::for_tier(basis, tier, memory, Kernels::detect()).map_err(refused)
            },
            held_builder: |basis, memory: &mut Vec<u8>| Handles::new(basis, HELD_MAX, memory).map_err(refused),
        }
        .try_build()?;
        Ok(Self {
            playing: Mutex::new(playing),
            tier,
            vertex_count,
            component_count,
            bone_count,
        })
    }

    fn lock(&self) -> PyResult<MutexGuard<'_, Playing>> {
        match self.playing.try_lock() {
            Ok(playing) => Ok(playing),
            Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err(
                "another thread is using this player: give each thread one of its own",
            )),
            Err(TryLockError::Poisoned(_)) => Err(PyRuntimeError::new_err("this player is broken by an earlier fault")),
        }
    }

    /// Takes weights where there are some. Checks all before any counts.
    fn set(&self, playing: &mut Playing, weights: Option<&Weights<'_>>) -> PyResult<()> {
        let Some(weights) = weights else { return Ok(()) };
        let array = weights.as_array();
        if array.len() != self.component_count {
            return Err(refuse(format!(
                "weights must have shape ({},), not ({},)",
                self.component_count,
                array.len()
            )));
        }
        if let Some(k) = array.iter().position(|weight| !weight.is_finite()) {
            return Err(refuse(format!("weight {k} is {}", array[k])));
        }
        playing
            .with_controls_mut(|controls| {
                let mut each = array.iter().enumerate();
                each.try_for_each(|(k, &weight)| controls.set_unclamped(k, weight).map(drop))
            })
            .map_err(refused)
    }
}

/// An array to write to, which must be as it is wanted: nothing is converted, for then nobody would see the result.
fn writable<'py>(
    name: &str,
    array: &Bound<'py, PyAny>,
    rows: usize,
    columns: usize,
) -> PyResult<PyReadwriteArray2<'py, f32>> {
    let wrong = |what: &str| {
        refuse(format!(
            "{name} must be a float32 array of shape ({rows}, {columns}) in C order{what}"
        ))
    };
    let array: PyReadwriteArray2<'py, f32> = array.extract().map_err(|_| wrong(", writable and used nowhere else"))?;
    if array.shape() != [rows, columns] || !array.is_c_contiguous() {
        return Err(wrong(&format!(", not {:?}", array.shape())));
    }
    Ok(array)
}

fn new_array(py: Python<'_>, rows: usize, columns: usize) -> PyResult<Bound<'_, PyAny>> {
    matrix(py, vec![0.0_f32; rows * columns], columns)
}

#[pymethods]
impl Player {
    #[getter]
    fn tier(&self) -> &'static str {
        match self.tier {
            TierChoice::Exact => "exact",
            _ => "bones",
        }
    }

    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let playing = self.lock()?;
        Ok(playing.with_controls(|controls| PyArray1::from_slice(py, controls.weights())))
    }

    #[pyo3(signature = (weights=None, out=None, normals=None))]
    fn frame<'py>(
        &self,
        py: Python<'py>,
        weights: Option<Weights<'py>>,
        out: Option<Bound<'py, PyAny>>,
        normals: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let out = match out {
            Some(out) => out,
            None => new_array(py, self.vertex_count, 3)?,
        };
        let mut positions = writable("out", &out, self.vertex_count, 3)?;
        let mut turned = normals
            .as_ref()
            .map(|array| writable("normals", array, self.vertex_count, 3))
            .transpose()?;
        let mut playing = self.lock()?;
        self.set(&mut playing, weights.as_ref())?;
        let positions = positions.as_slice_mut()?.as_chunks_mut::<3>().0;
        let normals = match &mut turned {
            Some(turned) => Some(turned.as_slice_mut()?.as_chunks_mut::<3>().0),
            None => None,
        };
        let playing = &mut *playing;
        py.detach(|| -> Result<FrameOutcome, FrameError> {
            playing.with_mut(|own| {
                Frame {
                    basis: own.basis,
                    controls: own.controls,
                    positions,
                    normals,
                }
                .run(own.workspace)
            })
        })
        .map_err(refused)?;
        Ok(out)
    }

    #[pyo3(signature = (weights=None, out=None))]
    fn bones<'py>(
        &self,
        py: Python<'py>,
        weights: Option<Weights<'py>>,
        out: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if self.tier != TierChoice::Bones {
            return Err(refuse(
                "this player is of the exact tier: package.bake().player(\"bones\") has bones",
            ));
        }
        let out = match out {
            Some(out) => out,
            None => new_array(py, self.bone_count, 12)?,
        };
        let mut maps = writable("out", &out, self.bone_count, 12)?;
        let mut playing = self.lock()?;
        self.set(&mut playing, weights.as_ref())?;
        let maps = maps.as_slice_mut()?.as_chunks_mut::<12>().0;
        let playing = &mut *playing;
        py.detach(|| {
            playing.with_mut(|own| {
                BoneMaps {
                    basis: own.basis,
                    controls: own.controls,
                    maps: BoneOutput::Rows(maps),
                }
                .run(own.workspace)
            })
        })
        .map_err(refused)?;
        Ok(out)
    }

    fn hold(&self, vertex: usize) -> PyResult<()> {
        self.lock()?
            .with_mut(|own| own.held.add(own.basis, own.workspace, vertex))
            .map_err(refused)
    }

    fn drag(&self, py: Python<'_>, vertex: usize, target: [f32; 3]) -> PyResult<f32> {
        let mut playing = self.lock()?;
        let playing = &mut *playing;
        py.detach(|| {
            playing.with_mut(|own| {
                own.held.set_target(vertex, target)?;
                Drag {
                    basis: own.basis,
                    handles: own.held,
                    controls: own.controls,
                }
                .run(own.workspace)
            })
        })
        .map(|report| report.misfit)
        .map_err(refused)
    }

    fn let_go(&self, vertex: usize) -> PyResult<()> {
        self.lock()?.with_held_mut(|held| held.remove(vertex)).map_err(refused)
    }

    fn __repr__(&self) -> String {
        format!(
            "Player({}, {} vertices, {} components)",
            self.tier(),
            self.vertex_count,
            self.component_count
        )
    }
}
