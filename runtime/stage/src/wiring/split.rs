//! How many of the knobs at hand are for coarse components.

use sinew_runtime::Basis;

/// Coarse and fine knobs out of `knob_count`: three eighths are coarse, as on a box of eight, but never more than there are
/// coarse components, and all of them where no component has children.
pub fn split(basis: &Basis<'_>, knob_count: u16, coarse: Option<u16>, fine: Option<u16>) -> (u16, u16) {
    let knob_count = knob_count.max(1);
    match (coarse, fine) {
        (Some(coarse), Some(fine)) => (coarse, fine),
        (Some(coarse), None) => (coarse, knob_count.saturating_sub(coarse)),
        (None, Some(fine)) => (knob_count.saturating_sub(fine).max(1), fine),
        (None, None) => {
            let coarse_components = basis
                .components()
                .filter(|component| component.parent.is_none())
                .count();
            if coarse_components == basis.component_count() {
                return (knob_count, 0);
            }
            let share = u32::from(knob_count) * 3 / 8;
            let coarse = (share as u16).clamp(1, (coarse_components.min(4096) as u16).max(1));
            (coarse, knob_count - coarse)
        }
    }
}
