//! Tiles: the folded components as a frame reads them. Sixteen nodes are a group, and each component has one whole tile
//! for every group that it touches.

use alloc::{collections::BTreeMap, vec::Vec};

use super::{FEATURE_COUNT, GROUP_NODES};

/// One component's halves on one group, number first.
pub type Tile = [[u16; GROUP_NODES]; FEATURE_COUNT];

/// A tier's components, gathered from their entries; fields are those of [`super::BakedTier`].
#[derive(Debug, Clone, Default, PartialEq)]
#[expect(missing_docs, reason = "fields are those of BakedTier")]
pub struct Tiles {
    pub tile_offsets: Vec<u32>,
    pub tile_owners: Vec<[u16; 2]>,
    pub tile_values: Vec<Tile>,
}

impl Tiles {
    /// Gathers entries in any order: component, its block, lane < `node_count`, half bits.
    pub fn gather(
        node_count: usize,
        entries: impl IntoIterator<Item = (usize, u32, u32, [u16; FEATURE_COUNT])>,
    ) -> Self {
        let mut gathered: BTreeMap<(usize, [u16; 2]), Tile> = BTreeMap::new();
        for (component, block, lane, values) in entries {
            let (group, lane) = (lane as usize / GROUP_NODES, lane as usize % GROUP_NODES);
            // The limits of the format keep both far below 2^16.
            let owner = [component as u16, block as u16];
            let tile = gathered.entry((group, owner)).or_default();
            for (row, value) in tile.iter_mut().zip(values) {
                row[lane] = value;
            }
        }
        let mut tiles = Self {
            tile_offsets: alloc::vec![0; node_count.div_ceil(GROUP_NODES) + 1],
            ..Self::default()
        };
        for ((group, owner), values) in gathered {
            tiles.tile_offsets[group + 1] += 1;
            tiles.tile_owners.push(owner);
            tiles.tile_values.push(values);
        }
        for group in 1..tiles.tile_offsets.len() {
            tiles.tile_offsets[group] += tiles.tile_offsets[group - 1];
        }
        tiles
    }
}
