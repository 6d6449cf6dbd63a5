//! Components as the compact package stores them, unpacked: which vertices, which values.

use sinew_formats::package::{CompactView, FEATURE_COUNT};

/// One component on its support.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SparseComponent {
    /// Source indices, ascending.
    pub vertices: Vec<u32>,
    /// Network units, as the whole numbers say, exactly. Shape: that of `vertices`.
    pub values: Vec<[f64; FEATURE_COUNT]>,
}

/// Unpacks all components of a package. Shape: `[K]`.
pub fn unpack_components(package: &CompactView<'_>) -> Vec<SparseComponent> {
    let scales: Vec<_> = package
        .components()
        .map(|component| component.value_scales.by_feature().map(f64::from))
        .collect();
    let mut components = vec![SparseComponent::default(); scales.len()];
    for entry in package.entries() {
        let component = &mut components[entry.component];
        let scales = &scales[entry.component];
        component.vertices.push(entry.vertex as u32);
        component
            .values
            .push(core::array::from_fn(|c| f64::from(entry.values[c]) * scales[c]));
    }
    components
}
