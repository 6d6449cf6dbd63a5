//! Patches: the folded components as a frame reads them. Sixteen nodes are a group, and each component has one whole patch
//! for every group that it touches.

use alloc::{collections::BTreeMap, vec::Vec};

use super::{FEATURE_COUNT, GROUP_NODES};

/// One component's halves on one group, number first.
pub type Patch = [[u16; GROUP_NODES]; FEATURE_COUNT];

/// A tier's components, gathered from their entries; fields are those of [`super::BakedTier`].
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "fields are those of BakedTier")]
pub struct Patches {
    pub patch_offsets: Vec<u32>,
    pub patch_owners: Vec<[u16; 2]>,
    pub patch_values: Vec<Patch>,
}

impl Patches {
    /// Gathers entries in any order: component, its block, lane < `node_count`, half bits.
    pub fn gather(
        node_count: usize,
        entries: impl IntoIterator<Item = (usize, u32, u32, [u16; FEATURE_COUNT])>,
    ) -> Self {
        let mut gathered: BTreeMap<(usize, [u16; 2]), Patch> = BTreeMap::new();
        for (component, block, lane, values) in entries {
            let (group, lane) = (lane as usize / GROUP_NODES, lane as usize % GROUP_NODES);
            // The limits of the format keep both far below 2^16.
            let owner = [component as u16, block as u16];
            let patch = gathered.entry((group, owner)).or_default();
            for (row, value) in patch.iter_mut().zip(values) {
                row[lane] = value;
            }
        }
        let mut patches = Self {
            patch_offsets: alloc::vec![0; node_count.div_ceil(GROUP_NODES) + 1],
            ..Self::default()
        };
        for ((group, owner), values) in gathered {
            patches.patch_offsets[group + 1] += 1;
            patches.patch_owners.push(owner);
            patches.patch_values.push(values);
        }
        for group in 1..patches.patch_offsets.len() {
            patches.patch_offsets[group] += patches.patch_offsets[group - 1];
        }
        patches
    }
}
