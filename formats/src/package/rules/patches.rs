//! Rules of patches: components at the vertices of the exact tier and at the nodes of the bones, which obey the same ones.

use super::{
    super::{BakedView, GROUP_NODES, OpenError, PatchesView, limits},
    below, count, offsets, same_count,
};

/// Owners ascend within a group and stand in their blocks; values are as many.
pub(super) fn patches(view: &BakedView<'_>, patches: &PatchesView<'_>, node_count: usize) -> Result<(), OpenError> {
    let owners = patches.owners;
    count("patch_owners", owners.len(), 0, limits::PATCHES)?;
    same_count("patch_values", patches.values.len(), owners.len())?;
    let group_count = node_count.div_ceil(GROUP_NODES);
    offsets("patch_offsets", patches.offsets, group_count, owners.len())?;
    for row in patches.offsets.windows(2) {
        let mut previous = None;
        for index in row[0] as usize..row[1] as usize {
            let [component, block] = owners[index];
            below("patch_owners", index, u32::from(component), view.component_count())?;
            if previous.is_some_and(|previous| component <= previous) {
                return Err(OpenError::NotAscending {
                    field: "patch_owners",
                    index,
                });
            }
            // Components stand in block order, so the blocks ascend too.
            if view.component(component as usize).block != u32::from(block) {
                return Err(OpenError::NotContiguous {
                    field: "patch_owners",
                    index,
                });
            }
            previous = Some(component);
        }
    }
    Ok(())
}
