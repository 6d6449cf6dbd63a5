//! Every way in which a map can be wrong, one by one.

use super::*;
use crate::fixture::{Package, open};
use crate::response::{Curve, ResponseFault};

fn binding(knob: u16, control: u16) -> Binding {
    Binding {
        knob,
        control,
        ..Binding::default()
    }
}

#[test]
fn validity() {
    let package = Package::small(1);
    let basis = open(&package);
    let knobs: [Knob<'_>; 4] = core::array::from_fn(|n| Knob::new(10 + n as u16, "knob"));
    let good = [binding(0, 0), binding(0, 1), binding(1, 2)];
    let map = ControlMap::new(basis, &knobs, &good, &[], None).unwrap();
    assert_eq!(map.page_count(), 1);
    assert!(map.unmapped_knobs().eq([2, 3]));
    assert_eq!((map.knob_at(12), map.knob_at(2)), (Some(2), None));

    let bindings = |bindings: &[Binding]| ControlMap::new(basis, &knobs, bindings, &[], None).unwrap_err();
    assert_eq!(bindings(&[binding(4, 0)]), MapError::NoSuchKnob { binding: 0, knob: 4 });
    let missing = MapError::NoSuchControl {
        control: 5,
        component_count: 5,
    };
    assert_eq!(bindings(&[binding(0, 5)]), missing);
    let curve = Curve::SCurve { steepness: 0.0 };
    let response = Response {
        curve,
        ..Response::default()
    };
    let fault = ResponseFault::Curve;
    assert_eq!(
        bindings(&[Binding {
            response,
            ..binding(0, 0)
        }]),
        MapError::Response { binding: 0, fault }
    );
    assert_eq!(
        bindings(&[binding(0, 1), binding(1, 1)]),
        MapError::TwoHands { first: 0, second: 1 }
    );
    let on = |page, knob| Binding {
        page: OnPage::Only(page),
        ..binding(knob, 1)
    };
    assert_eq!(
        bindings(&[on(1, 0), binding(1, 1)]),
        MapError::TwoHands { first: 0, second: 1 }
    );
    let pages = [on(0, 0), on(2, 1)];
    assert_eq!(
        ControlMap::new(basis, &knobs, &pages, &[], None).unwrap().page_count(),
        3
    );

    let knob = |knob: Knob<'_>| ControlMap::new(basis, &[knob], &[], &[], None).unwrap_err();
    let plain = knobs[0];
    let calibration = Some(KnobCalibration::assumed(0));
    assert_eq!(knob(Knob { calibration, ..plain }), MapError::Calibration { knob: 0 });
    let smoothing = Smoothing {
        minimum_cutoff_hz: f32::NAN,
        ..Smoothing::default()
    };
    assert_eq!(knob(Knob { smoothing, ..plain }), MapError::Smoothing { knob: 0 });
    for acceleration in [0.9, 101.0, f32::NAN] {
        let spun = Knob { acceleration, ..plain };
        assert_eq!(knob(spun), MapError::Acceleration { knob: 0 });
    }
    for step in [0.0, 1.1, f32::NAN] {
        assert_eq!(knob(Knob { step, ..plain }), MapError::Step { knob: 0 });
    }

    let button = |address, command| {
        let buttons = [Button { address, command }];
        ControlMap::new(basis, &knobs, &pages, &buttons, None).map(|_| ())
    };
    assert_eq!(button(12, Command::Stop), Err(MapError::SameAddress { address: 12 }));
    assert_eq!(button(1, Command::Focus(5)), Err(missing));
    assert_eq!(button(1, Command::Page(3)), Err(MapError::NoSuchPage { page: 3 }));
    assert_eq!(button(1, Command::Page(2)), Ok(()));
    let many: [Button; BUTTONS_MAX + 1] = core::array::from_fn(|n| Button {
        address: 100 + n as u16,
        command: Command::Next,
    });
    assert_eq!(
        ControlMap::new(basis, &knobs, &[], &many, None).unwrap_err(),
        MapError::TooMany
    );

    let tree = |tree, bindings: &[Binding]| ControlMap::new(basis, &knobs, bindings, &[], Some(tree)).map(|_| ());
    let two = TreePages {
        coarse_knobs: 2,
        fine_knobs: 2,
        ..TreePages::default()
    };
    assert_eq!(tree(two, &[]), Ok(()));
    assert_eq!(tree(TreePages { first_knob: 1, ..two }, &[]), Err(MapError::TreeKnobs));
    assert_eq!(
        tree(TreePages { coarse_knobs: 0, ..two }, &[]),
        Err(MapError::TreeKnobs)
    );
    assert_eq!(tree(two, &[binding(3, 1)]), Err(MapError::TreeKnobBound { binding: 0 }));
    let response = Response {
        minimum: Some(-1.5),
        ..Response::default()
    };
    let fault = ResponseFault::Limits;
    assert_eq!(
        tree(TreePages { response, ..two }, &[]),
        Err(MapError::TreeResponse { control: 0, fault })
    );
}

#[test]
fn knobs_are_shared_between_coarse_and_fine() {
    let package = Package::small(1);
    let basis = open(&package);
    let shares = [0, 1, 2, 3, 8, u16::MAX].map(|knob_count| TreePages::share(&basis, knob_count));
    assert_eq!(
        shares,
        [(1, 0), (1, 0), (1, 1), (1, 2), (2, 6), (2, u16::MAX - 2)],
        "two coarse components"
    );
}
