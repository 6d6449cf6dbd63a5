//! Patches: the folded components as a frame reads them. Sixteen nodes are a group, and each component has one whole patch
//! for every group that it touches.

use alloc::{collections::BTreeMap, vec::Vec};

use super::{BakedPatches, FEATURE_COUNT, GROUP_NODES};

/// One component's whole numbers on one group, feature first.
pub type Patch = [[i16; GROUP_NODES]; FEATURE_COUNT];

/// The components at N nodes, gathered from their entries; fields are those of [`BakedPatches`].
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "fields are those of BakedPatches")]
pub struct Patches {
    pub offsets: Vec<u32>,
    pub owners: Vec<[u16; 2]>,
    pub values: Vec<Patch>,
}

impl Patches {
    /// Gathers entries in any order: component, its block, slot < `node_count`, whole numbers.
    pub fn gather(
        node_count: usize,
        entries: impl IntoIterator<Item = (usize, u32, u32, [i16; FEATURE_COUNT])>,
    ) -> Self {
        let mut gathered: BTreeMap<(usize, [u16; 2]), Patch> = BTreeMap::new();
        for (component, block, slot, values) in entries {
            let (group, n) = (slot as usize / GROUP_NODES, slot as usize % GROUP_NODES);
            // The limits of the format keep both far below 2^16.
            let owner = [component as u16, block as u16];
            let patch = gathered.entry((group, owner)).or_default();
            for (row, value) in patch.iter_mut().zip(values) {
                row[n] = value;
            }
        }
        let mut patches = Self {
            offsets: alloc::vec![0; node_count.div_ceil(GROUP_NODES) + 1],
            ..Self::default()
        };
        for ((group, owner), values) in gathered {
            patches.offsets[group + 1] += 1;
            patches.owners.push(owner);
            patches.values.push(values);
        }
        for group in 1..patches.offsets.len() {
            patches.offsets[group] += patches.offsets[group - 1];
        }
        patches
    }

    /// Borrowed, ready to be written.
    pub fn record(&self) -> BakedPatches<'_> {
        BakedPatches {
            offsets: &self.offsets,
            owners: &self.owners,
            values: &self.values,
        }
    }
}
