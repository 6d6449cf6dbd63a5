//! How many of the knobs at hand are for coarse components.

use sinew_knobs::TreePages;
use sinew_runtime::Basis;

/// Coarse and fine knobs out of `knob_count`: what the mapping file says, and [`TreePages::share`] where it says nothing.
pub fn split(basis: &Basis<'_>, knob_count: u16, coarse: Option<u16>, fine: Option<u16>) -> (u16, u16) {
    let knob_count = knob_count.max(1);
    match (coarse, fine) {
        (Some(coarse), Some(fine)) => (coarse, fine),
        (Some(coarse), None) => (coarse, knob_count.saturating_sub(coarse)),
        (None, Some(fine)) => (knob_count.saturating_sub(fine).max(1), fine),
        (None, None) => TreePages::share(basis, knob_count),
    }
}
