//! Rules of what is added after the solve and of the prior, which are the same in both payloads.

use super::super::super::fixture::{TinyAfter, TinyPrior};
use super::*;

fn both(damage: impl Fn(&mut TinyAfter, &mut TinyPrior), expected: OpenError) {
    compact(|t| damage(&mut t.after, &mut t.prior), expected);
    baked(|t| damage(&mut t.after, &mut t.prior), expected);
}

#[test]
fn nothing_need_be_added_and_nothing_known() {
    let mut tiny = tiny_baked();
    (tiny.after, tiny.prior) = (TinyAfter::default(), TinyPrior::default());
    let bytes = write_baked(&tiny.basis()).unwrap();
    let view = BakedView::open(&bytes).unwrap();
    assert_eq!((view.after(), view.prior()), (After::NONE, Prior::NONE));
    assert!(view.after().is_empty());
}

#[test]
fn piece_rules() {
    let (v, k) = (u64::from(V), COMPONENT_COUNT as u64);
    let field = "after.piece_of";
    both(|t, _| t.piece_of.truncate(3), counts(field, v, 3));
    both(|t, _| t.piece_of[0] = 1, beyond(field, 0, 1, 1));
    both(|t, _| t.piece_offsets.clear(), counts(field, 0, v));
    let field = "after.piece_offsets";
    both(|t, _| t.piece_offsets.push([0.0; 3]), counts(field, k, k + 1));
    both(|t, _| t.piece_offsets[2][1] = f32::NAN, not_finite(field, 2));
    both(
        |t, _| t.piece_offsets.resize((limits::PIECES + 1) * COMPONENT_COUNT, [0.0; 3]),
        TooMany {
            field,
            limit: limits::PIECES,
            actual: limits::PIECES + 1,
        },
    );
}

#[test]
fn mode_rules() {
    let (v, k) = (u64::from(V), COMPONENT_COUNT as u64);
    both(|t, _| t.mix.truncate(7), counts("after.mix", 2 * k, 7));
    both(|t, _| t.mix[5] = f32::INFINITY, not_finite("after.mix", 5));
    both(|t, _| t.modes.push([0; 3]), counts("after.modes", 2 * v, 2 * v + 1));
    let field = "after.mode_scales";
    both(|t, _| t.mode_scales[1] = 0.0, NotPositive { field, index: 1 });
    both(
        |t, _| t.mode_scales = alloc::vec![1.0; limits::MODES + 1],
        TooMany {
            field,
            limit: limits::MODES,
            actual: limits::MODES + 1,
        },
    );
}

#[test]
fn prior_rules() {
    let k = COMPONENT_COUNT as u64;
    both(|_, p| p.mean.truncate(1), counts("prior.mean", k, 1));
    both(|_, p| p.variances.clear(), counts("prior.variances", k, 0));
    both(|_, p| p.factors.push(0.0), counts("prior.factors", k, k + 1));
    both(|_, p| p.mean.clear(), counts("prior.variances", 0, k));
    both(|_, p| p.mean[1] = f32::NAN, not_finite("prior.mean", 1));
    both(|_, p| p.factors[3] = f32::NAN, not_finite("prior.factors", 3));
    let field = "prior.variances";
    both(|_, p| p.variances[2] = 0.0, NotPositive { field, index: 2 });
    both(|_, p| p.strength = f32::NAN, not_finite("prior.strength", 0));
    both(
        |_, p| p.factors = alloc::vec![0.0; (limits::PRIOR_FACTORS + 1) * COMPONENT_COUNT],
        TooMany {
            field: "prior.factors",
            limit: limits::PRIOR_FACTORS,
            actual: limits::PRIOR_FACTORS + 1,
        },
    );
}

#[test]
fn the_encoders_bytes_are_the_trainers_own() {
    let mut tiny = tiny_compact();
    tiny.encoder = alloc::vec![0xff; 1000];
    let bytes = write_compact(&tiny.basis()).unwrap();
    assert_eq!(CompactView::open(&bytes).unwrap().encoder(), tiny.encoder);
}
