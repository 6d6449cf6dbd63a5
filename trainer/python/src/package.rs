//! Packages: bytes that were checked, and what is asked of them.

use std::path::PathBuf;
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sinew_formats::package::{AlignedBytes, CompactView, PackageKind, read_package, save_package};
use sinew_interchange::MeshSequence;
use sinew_runtime::Basis;
use sinew_trainer::bake::{BakeOptions, BoneOptions, Influences, bake_bytes_with};
use sinew_trainer::config::TrainConfig;
use sinew_trainer::evaluate::{EncodeInput, EvaluationInput, WeightFit, encode, evaluate};

use crate::errors::{refuse, refused};
use crate::player::Player;
use crate::sequence::{Positions, face_array, matrix, sequence_of, vertex_count_of};

/// One component and its control.
#[pyclass(frozen, eq, get_all, module = "sinew")]
#[derive(Clone, PartialEq)]
pub struct Component {
    name: String,
    minimum: f32,
    maximum: f32,
    level: u32,
    parent: Option<usize>,
}

#[pymethods]
impl Component {
    fn __repr__(&self) -> String {
        format!("Component({:?}, {:.3} to {:.3})", self.name, self.minimum, self.maximum)
    }
}

/// See the stub file.
#[pyclass(frozen, module = "sinew")]
pub struct Package {
    bytes: Arc<AlignedBytes>,
    kind: PackageKind,
}

/// See the stub file.
#[pyfunction]
pub fn load(py: Python<'_>, path: PathBuf) -> PyResult<Package> {
    let bytes = py.detach(|| read_package(&path)).map_err(refused)?;
    Package::new(bytes)
}

impl Package {
    /// Checks the bytes.
    pub fn new(bytes: AlignedBytes) -> PyResult<Self> {
        let kind = PackageKind::of(&bytes).map_err(refused)?;
        match kind {
            PackageKind::Compact => CompactView::open(&bytes).map(drop),
            PackageKind::Baked => Basis::open(&bytes).map(drop),
        }
        .map_err(refused)?;
        Ok(Self {
            bytes: Arc::new(bytes),
            kind,
        })
    }

    /// The compact view, checked when the package came.
    fn compact(&self, wanted_for: &str) -> PyResult<CompactView<'_>> {
        match self.kind {
            PackageKind::Compact => CompactView::open(&self.bytes).map_err(refused),
            PackageKind::Baked => Err(refuse(format!(
                "{wanted_for} needs the compact package, and this one is baked"
            ))),
        }
    }

    fn basis(&self) -> PyResult<Basis<'_>> {
        Basis::open(&self.bytes).map_err(refused)
    }

    /// Shapes of the package's mesh.
    fn sequence(&self, positions: &Positions<'_>, view: &CompactView<'_>) -> PyResult<MeshSequence> {
        let (own, given) = (view.vertex_count(), vertex_count_of(positions));
        if own != given {
            return Err(refuse(format!("the package has {own} vertices, and positions {given}")));
        }
        sequence_of(positions, view.faces().to_vec())
    }
}

fn config_of(view: &CompactView<'_>) -> PyResult<TrainConfig> {
    TrainConfig::from_toml(view.provenance().config).map_err(refused)
}

#[pymethods]
impl Package {
    #[staticmethod]
    fn from_bytes(bytes: &[u8]) -> PyResult<Self> {
        Self::new(AlignedBytes::from_slice(bytes))
    }

    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.bytes)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyBytes>,))> {
        Ok((py.get_type::<Self>().getattr("from_bytes")?, (self.to_bytes(py),)))
    }

    fn __eq__(&self, other: &Self) -> bool {
        self.bytes == other.bytes
    }

    fn __len__(&self) -> usize {
        self.bytes.len()
    }

    fn __repr__(&self) -> PyResult<String> {
        let components = self.components()?.len();
        Ok(format!(
            "Package({}, {} vertices, {components} components, {:.2} MB)",
            self.kind(),
            self.vertex_count()?,
            self.bytes.len() as f64 / 1e6
        ))
    }

    fn save(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| save_package(&path, &self.bytes)).map_err(refused)
    }

    #[getter]
    fn kind(&self) -> &'static str {
        match self.kind {
            PackageKind::Compact => "compact",
            PackageKind::Baked => "baked",
        }
    }

    #[getter]
    fn vertex_count(&self) -> PyResult<usize> {
        match self.kind {
            PackageKind::Compact => Ok(self.compact("")?.vertex_count()),
            PackageKind::Baked => Ok(self.basis()?.vertex_count()),
        }
    }

    #[getter]
    fn bone_count(&self) -> PyResult<usize> {
        match self.kind {
            PackageKind::Compact => Ok(0),
            PackageKind::Baked => Ok(self.basis()?.bones().map_or(0, |bones| bones.count())),
        }
    }

    #[getter]
    fn faces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let faces = match self.kind {
            PackageKind::Compact => self.compact("")?.faces().to_vec(),
            PackageKind::Baked => self.basis()?.faces().to_vec(),
        };
        face_array(py, &faces)
    }

    #[getter]
    fn rest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let rest: Vec<[f32; 3]> = match self.kind {
            PackageKind::Compact => self.compact("")?.rest_positions().to_vec(),
            PackageKind::Baked => {
                let basis = self.basis()?;
                let positions = basis.rest_positions();
                basis
                    .slot_from_vertex()
                    .iter()
                    .map(|slot| positions[slot as usize])
                    .collect()
            }
        };
        matrix(py, rest.into_flattened(), 3)
    }

    #[getter]
    fn components(&self) -> PyResult<Vec<Component>> {
        if self.kind == PackageKind::Baked {
            let each = self.basis()?.components().map(|component| Component {
                name: component.name.into(),
                minimum: component.minimum,
                maximum: component.maximum,
                level: component.level,
                parent: component.parent,
            });
            return Ok(each.collect());
        }
        let view = self.compact("")?;
        let each = view.components().map(|component| {
            let block = view.block(component.block as usize);
            Component {
                name: component.name.into(),
                minimum: component.minimum,
                maximum: component.maximum,
                level: block.level,
                parent: (block.parent_component != sinew_formats::package::NONE)
                    .then_some(block.parent_component as usize),
            }
        });
        Ok(each.collect())
    }

    #[pyo3(signature = (*, bones=Some(128), influences=4, exact=true))]
    fn bake(&self, py: Python<'_>, bones: Option<u16>, influences: u8, exact: bool) -> PyResult<Self> {
        self.compact("bake")?;
        let influences = match influences {
            4 => Influences::Four,
            8 => Influences::Eight,
            _ => return Err(refuse(format!("influences must be 4 or 8, not {influences}"))),
        };
        if bones.is_none() && !exact {
            return Err(refuse(
                "without bones and without the exact tier nothing is left to play",
            ));
        }
        let options = BakeOptions {
            exact,
            bones: bones.map(|count| BoneOptions { count, influences }),
        };
        Self::new(py.detach(|| bake_bytes_with(&self.bytes, &options)).map_err(refused)?)
    }

    #[pyo3(signature = (positions, *, fit="encoder"))]
    fn encode<'py>(&self, py: Python<'py>, positions: Positions<'py>, fit: &str) -> PyResult<Bound<'py, PyAny>> {
        let view = self.compact("encode")?;
        let config = config_of(&view)?;
        let fit = match fit {
            "encoder" => WeightFit::Encoder,
            "features" => WeightFit::Features,
            "positions" => WeightFit::Positions,
            _ => {
                return Err(refuse(format!(
                    "fit must be \"encoder\", \"features\" or \"positions\", not {fit:?}"
                )));
            }
        };
        let sequence = self.sequence(&positions, &view)?;
        let input = EncodeInput {
            package: &self.bytes,
            sequence: &sequence,
            fit,
            settings: config.features,
            encoder: config.encoder_settings(),
        };
        let weights = py.detach(|| encode(&input, &|_| {})).map_err(refused)?;
        let flat = weights.iter().flatten().map(|&weight| weight as f32).collect();
        matrix(py, flat, view.component_count())
    }

    #[pyo3(signature = (positions, *, shapes=None))]
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        positions: Positions<'py>,
        shapes: Option<Vec<usize>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let view = self.compact("evaluate")?;
        let config = config_of(&view)?;
        let sequence = self.sequence(&positions, &view)?;
        let (count, provenance) = (sequence.shape_count(), view.provenance());
        // Shapes of another sequence are unseen as a whole.
        let trained: Vec<usize> = match provenance.shape_count as usize == count {
            true => provenance
                .train_shapes
                .iter()
                .map(|&m| m as usize)
                .filter(|&m| m != 0)
                .collect(),
            false => Vec::new(),
        };
        let test = shapes.unwrap_or_else(|| (1..count).filter(|m| !trained.contains(m)).collect());
        if let Some(seen) = test.iter().find(|m| trained.contains(m)) {
            return Err(refuse(format!(
                "shape {seen} was trained on: figures on it would say nothing about unseen shapes"
            )));
        }
        if test.is_empty() {
            return Err(refuse(format!(
                "all {count} shapes were trained on: train on some of them, shapes=range(0, {count}, 10)"
            )));
        }
        let input = EvaluationInput {
            package: &self.bytes,
            sequence: &sequence,
            test_shapes: &test,
            trained_shapes: &trained,
            settings: config.features,
            encoder: config.encoder_settings(),
        };
        let (figures, _) = py.detach(|| evaluate(&input, &|_| {})).map_err(refused)?;
        let text = serde_json::to_string(&figures).map_err(refused)?;
        py.import("json")?.call_method1("loads", (text,))
    }

    #[pyo3(signature = (tier=None))]
    fn player(&self, py: Python<'_>, tier: Option<&str>) -> PyResult<Player> {
        if self.kind == PackageKind::Baked {
            return Player::new(Arc::clone(&self.bytes), tier);
        }
        // The exact tier takes no time worth speaking of; bones are fitted, which does.
        let options = match tier {
            None | Some("exact") => BakeOptions {
                exact: true,
                bones: None,
            },
            _ => BakeOptions::default(),
        };
        let baked = py.detach(|| bake_bytes_with(&self.bytes, &options)).map_err(refused)?;
        Player::new(Arc::new(baked), tier)
    }
}
