//! Components as the compact package stores them, unpacked: which vertices, which values.

use half::f16;
use sinew_formats::package::{CompactView, FEATURE_COUNT};

/// One component on its support.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SparseComponent {
    /// Source indices, ascending.
    pub vertices: Vec<u32>,
    /// Network units, as the half-precision values say. Shape: that of `vertices`.
    pub values: Vec<[f32; FEATURE_COUNT]>,
}

/// Unpacks all components of a package. Shape: `[K]`.
pub fn unpack_components(package: &CompactView<'_>) -> Vec<SparseComponent> {
    let scales: Vec<f32> = package.components().map(|component| component.value_scale).collect();
    let mut components = vec![SparseComponent::default(); scales.len()];
    for entry in package.entries() {
        let component = &mut components[entry.component];
        component.vertices.push(entry.vertex as u32);
        component.values.push(
            entry
                .values
                .map(|bits| f16::from_bits(bits).to_f32() * scales[entry.component]),
        );
    }
    components
}
