//! Mapping files against a package: what becomes of names, places, pages and trees, and what is refused.

use std::path::Path;

use sinew_bake::{bake_bytes, fixture};
use sinew_formats::package::AlignedBytes;
use sinew_knobs::{Command, KnobCalibration, KnobEvent, OnPage, Reading};

use super::*;
use crate::calibration::{CalibratedKnob, DeviceCalibration};
use crate::config::KnobsFile;

/// Components c0 to c6: three coarse ones; c3 and c4 under c0, c5 and c6 under c1.
fn package() -> AlignedBytes {
    bake_bytes(&fixture::compact(1, true)).unwrap()
}

fn file(text: &str) -> KnobsFile {
    KnobsFile::parse(Path::new("knobs.toml"), text.to_owned()).unwrap()
}

fn heard(addresses: &[u16]) -> Vec<HeardKnob> {
    addresses
        .iter()
        .map(|&address| HeardKnob { address, name: None })
        .collect()
}

fn wire(text: &str, addresses: &[u16]) -> Wiring {
    let bytes = package();
    let basis = Basis::open(&bytes).unwrap();
    let wiring = resolve(&file(text), &basis, &heard(addresses), None).unwrap();
    // Whatever it makes, a map takes.
    let knobs = wiring.borrowed_knobs();
    wiring.map(basis, &knobs).unwrap();
    wiring
}

fn refused(text: &str) -> String {
    let bytes = package();
    let error = resolve(&file(text), &Basis::open(&bytes).unwrap(), &[], None).expect_err(text);
    match error.help_text() {
        Some(help) => format!("{error} ({help})"),
        None => error.to_string(),
    }
}

#[test]
fn without_a_file_the_knobs_found_follow_the_tree() {
    let wiring = wire("", &[0, 1, 2, 3, 4, 5, 6, 7]);
    let tree = wiring.tree.unwrap();
    assert_eq!((tree.coarse_knobs, tree.fine_knobs), (3, 5));
    assert_eq!(wiring.routes.same, [0, 1, 2, 3, 4, 5, 6, 7]);
    let nothing_heard = wire("", &[]);
    assert_eq!(nothing_heard.knobs.len(), 8);
    assert_eq!(nothing_heard.routes.free.len(), 8);
    let one = wire("", &[21]);
    assert_eq!((one.tree.unwrap().coarse_knobs, one.tree.unwrap().fine_knobs), (1, 0));
}

#[test]
fn boxes_of_every_size_have_knobs_for_coarse_components() {
    let bytes = package();
    let basis = Basis::open(&bytes).unwrap();
    for (count, expected) in [(1, (1, 0)), (2, (1, 1)), (4, (1, 3)), (8, (3, 5)), (16, (3, 13))] {
        assert_eq!(split(&basis, count, None, None), expected, "{count}");
    }
    assert_eq!(split(&basis, 8, Some(2), None), (2, 6));
    assert_eq!(split(&basis, 8, None, Some(6)), (2, 6));
}

#[test]
fn components_are_found_by_name_and_misspelt_ones_are_named() {
    assert_eq!(
        refused("[[knob]]\nknob = 0\ncomponent = \"c00\"\n"),
        "knobs.toml:3:13: the package has no component `c00` (did you mean `c0`? `sinew inspect` lists all of them)"
    );
    assert_eq!(
        refused("[[button]]\nknob = 0\ncommand = \"focus\"\ncomponent = \"jaw\""),
        "knobs.toml:4:13: the package has no component `jaw` (its components are c0, c1, c2, c3, c4, c5, c6)"
    );
}

#[test]
fn limits_and_scales_stay_within_the_component() {
    let bytes = package();
    let basis = Basis::open(&bytes).unwrap();
    let component = basis.component(2);
    let wiring = wire("[[knob]]\nknob = 4\ncomponent = \"c2\"\nscale = -0.5\n", &[]);
    let response = wiring.bindings[0].response;
    assert_eq!(
        (response.minimum, response.maximum),
        (Some(0.5 * component.minimum), Some(0.5 * component.maximum))
    );
    assert!(response.inverted);
    let too_wide = refused("[[knob]]\nknob = 4\ncomponent = \"c2\"\nmaximum = 1e6\n");
    assert!(
        too_wide.starts_with("knobs.toml:3:13: the limits must be in order"),
        "{too_wide}"
    );
    assert!(too_wide.contains("`c2` goes from"), "{too_wide}");
}

#[test]
fn two_hands_on_one_component_need_two_pages() {
    let two = "[[knob]]\nknob = 4\ncomponent = \"c2\"\n[[knob]]\nknob = 5\ncomponent = \"c2\"\n";
    assert_eq!(
        refused(two),
        "knobs.toml:6:13: `c2` is moved by knob 4 already (put one of the two on another `page`)"
    );
    let pages =
        two.replacen("\"c2\"", "\"c2\"\npage = 1", 1) + "page = 2\n[[button]]\nknob = 9\ncommand = \"page\"\npage = 2";
    let wiring = wire(&pages, &[]);
    assert_eq!(wiring.bindings[1].page, OnPage::Only(1));
    assert_eq!(wiring.buttons[0].command, Command::Page(1));
    assert!(wiring.tree.is_none());
    assert_eq!(
        refused(&pages.replace("page\"\npage = 2", "page\"\npage = 3")),
        "knobs.toml:12:8: there is no page 3: knobs use pages up to 2"
    );
}

#[test]
fn one_place_has_one_entry() {
    let twice = "[[knob]]\nknob = 4\ncomponent = \"c2\"\n[[button]]\nknob = 4\ncommand = \"stop\"\n";
    assert!(refused(twice).starts_with("knobs.toml:5:8: knob 4 is listed already"));
    let idle = "[tree]\ncoarse = 1\nfine = 0\nfirst_knob = 0\n[[knob]]\nknob = 4\n";
    assert!(refused(idle).starts_with("knobs.toml:6:8: knob 4 moves nothing"));
    let in_tree = "[tree]\nknobs = [3, 4]\n[[knob]]\nknob = 4\ncomponent = \"c2\"\n";
    assert!(refused(in_tree).starts_with("knobs.toml:2:13: knob 4 has a component of its own"));
    assert!(refused("[tree]\nknobs = [3, 3]").starts_with("knobs.toml:2:13: knob 3 is in the tree already"));
    assert!(
        refused("[tree]\nknobs = [3, 4]\ncoarse = 3\nfine = 5")
            .contains("2 knobs are listed, and coarse + fine make 8")
    );
    assert!(
        refused("[tree]\nknobs = [3, 4]\n[[button]]\nknob = 3\ncommand = \"stop\"").contains("3 is a knob of the tree")
    );
}

#[test]
fn a_tree_takes_what_the_rest_of_the_file_leaves() {
    let text = "[tree]\n[[knob]]\nknob = 1\ncomponent = \"c2\"\n[[knob]]\nknob = 2\nname = \"brow\"\n[[button]]\nknob = 5\ncommand = \"stop\"\n";
    let wiring = wire(text, &[0, 1, 2, 3, 4, 5]);
    let addresses: Vec<u16> = wiring.knobs.iter().map(|knob| knob.address).collect();
    assert_eq!(
        addresses,
        [2, 0, 3, 4, 1],
        "listed ones first, then those heard; own ones last"
    );
    assert_eq!(wiring.knobs[0].name, "brow");
}

#[test]
fn calibrations_follow_names_and_make_knobs_known() {
    let bytes = package();
    let basis = Basis::open(&bytes).unwrap();
    let pot = |lowest| KnobCalibration {
        full_scale: 1023,
        lowest,
        highest: 1000,
        centre: None,
        noise: 2,
    };
    let knob = |address, name: &str, lowest| CalibratedKnob {
        address,
        name: name.to_owned(),
        calibration: pot(lowest),
    };
    let device = DeviceCalibration {
        device: "x".to_owned(),
        knobs: vec![knob(0, "", 10), knob(6, "", 16), knob(3, "jaw", 13)],
    };
    let wiring = resolve(
        &file("[tree]\n[[knob]]\nknob = \"jaw\"\n"),
        &basis,
        &heard(&[0, 1]),
        Some(&device),
    )
    .unwrap();
    let lowest: Vec<_> = wiring
        .knobs
        .iter()
        .map(|knob| knob.calibration.map(|c| c.lowest))
        .collect();
    assert_eq!(lowest, [Some(13), Some(10), None, Some(16)]);
}

fn at(knob: u16, value: u16) -> KnobEvent {
    let full_scale = 127;
    KnobEvent {
        knob,
        reading: Reading::Position { value, full_scale },
    }
}

fn turned(knob: u16) -> KnobEvent {
    at(knob, 64)
}

#[test]
fn the_router_gives_each_knob_its_place_once() {
    let wiring = wire(
        "[tree]\ncoarse = 2\nfine = 1\n[[knob]]\nknob = \"jaw\"\ncomponent = \"c2\"\n",
        &[4],
    );
    let [named, ..] = wiring.routes.named.as_slice() else {
        panic!()
    };
    let mut router = Router::new(wiring.routes.clone());
    router.name(7, "jaw");
    assert_eq!((router.route(turned(4)), router.route(turned(7))), (4, named.1));
    let free = &wiring.routes.free;
    assert_eq!(
        [router.route(at(20, 127)), router.route(at(20, 0))],
        [20, 20],
        "a button takes no knob's place"
    );
    assert_eq!(free.len(), 2);
    assert_eq!([router.route(turned(30)), router.route(turned(2))], [free[0], free[1]]);
    assert_eq!(router.route(turned(30)), free[0], "it keeps it");
    assert_eq!(router.route(turned(9)), 9, "no room: it is what it is");
    // A name that comes late.
    router.name(9, "jaw");
    assert_eq!(router.route(turned(9)), named.1);
}
