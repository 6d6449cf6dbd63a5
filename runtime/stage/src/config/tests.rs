//! What mapping files say, and what they are refused for, in the words that a person reads.

use std::path::Path;

use super::*;

fn parse(text: &str) -> Result<KnobsFile, ConfigError> {
    KnobsFile::parse(Path::new("knobs.toml"), text.to_owned())
}

/// The refusal and its advice.
fn refused(text: &str) -> String {
    let error = parse(text).expect_err(text);
    match error.help_text() {
        Some(help) => format!("{error} ({help})"),
        None => error.to_string(),
    }
}

#[test]
fn nothing_said_is_the_default() {
    let file = parse("").unwrap();
    assert_eq!(
        file,
        KnobsFile {
            path: "knobs.toml".into(),
            ..KnobsFile::default()
        }
    );
}

#[test]
fn the_guide_to_a_first_box_has_a_button_that_stops() {
    let guide = include_str!("../../../../docs/first-box.md");
    let (_, behind) = guide.split_once("```toml\n").unwrap();
    let file = parse(behind.split("```").next().unwrap()).unwrap();
    assert_eq!(file.buttons.len(), 1);
}

#[test]
fn the_documented_example_says_what_it_claims() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/knobs.toml"));
    let file = KnobsFile::read(path).unwrap();
    // Keys that stand for a default must be the default: the file is the reference.
    assert_eq!(file.failsafe, Failsafe::default());
    assert_eq!(file.smoothing, Smoothing::default());
    assert_eq!(file.device.midi_settings, MidiSettings::default());
    assert_eq!(file.defaults.takeover, Some(Takeover::default()));
    assert_eq!(file.defaults.curve, Some(Curve::default()));
    assert_eq!(file.defaults.centre, Some(Centre::default()));
    let tree = file.tree.unwrap();
    assert_eq!((tree.coarse, tree.fine, tree.knobs.len()), (Some(3), Some(5), 8));
    assert_eq!(file.knobs.len(), 3);
    assert_eq!(
        file.knobs[0].controls[0].feel.curve,
        Some(Curve::SCurve { steepness: 2.5 })
    );
    assert_eq!(file.knobs[1].controls[1].scale, Some(-0.5));
    assert_eq!(file.knobs[1].controls[1].feel.takeover, Some(Takeover::Scale));
    assert_eq!(file.knobs[2].controls[1].page, Some(2));
    assert_eq!(file.buttons.len(), 3);
}

#[test]
fn the_example_shows_every_key() {
    let text = include_str!("../../../../docs/knobs.toml");
    let source = include_str!("parse.rs");
    let keys = source.match_indices("keys.").chain(source.match_indices("table."));
    let mut count = 0;
    for (at, start) in keys {
        let call = &source[at + start.len()..];
        let Some((method, rest)) = call.split_once("(\"") else {
            continue;
        };
        if method.chars().any(|c| !c.is_alphanumeric() && c != '_') {
            continue;
        }
        let key = rest.split('"').next().unwrap();
        assert!(text.contains(key), "docs/knobs.toml does not mention `{key}`");
        count += 1;
    }
    assert!(count > 30, "the keys were found: {count}");
}

#[test]
fn unknown_keys_are_refused_with_the_nearest() {
    assert_eq!(
        refused("[defaults]\ntakover = \"jump\"\n"),
        "knobs.toml:2:1: [defaults] has no key `takover` (did you mean `takeover`?)"
    );
    assert_eq!(
        refused("[[knob]]\nknob = 1\ncomponent = \"c0\"\ninvert = true\n"),
        "knobs.toml:4:1: [[knob]] has no key `invert` (did you mean `inverted`?)"
    );
    assert_eq!(
        refused("[fail_safe]\n"),
        "knobs.toml:1:2: the file has no key `fail_safe` (did you mean `failsafe`?)"
    );
    assert_eq!(
        refused("[tree]\nzzz = 1\ncoarse = 1"),
        "knobs.toml:2:1: [tree] has no key `zzz` (it knows coarse, fine, follow_touch, first_knob, knobs, curve, ratio, \
         steepness, centre, detent, inverted, slew, takeover)"
    );
}

#[test]
fn values_are_refused_where_they_stand() {
    assert_eq!(
        refused("[failsafe]\nease_s = \"soon\"\n"),
        "knobs.toml:2:10: `ease_s` must be a number, not string"
    );
    assert_eq!(
        refused("[defaults]\ndetent = 0.7"),
        "knobs.toml:2:10: `detent` must be from 0 to 0.5, not 0.7"
    );
    assert_eq!(
        refused("[defaults]\nslew = nan"),
        "knobs.toml:2:8: `slew` must be from 0.000001 to 1000000000, not NaN"
    );
    assert_eq!(
        refused("[defaults]\ntakeover = \"pick\""),
        "knobs.toml:2:12: `takeover` cannot be \"pick\" (did you mean \"pickup\"? it is one of \"jump\", \"pickup\", \
         \"scale\", \"relative\")"
    );
    assert_eq!(
        refused("[defaults]\ncurve = \"exponental\""),
        "knobs.toml:2:9: there is no curve \"exponental\" (did you mean \"exponential\"? it is one of linear, exponential, \
         logarithmic, s-curve)"
    );
    assert_eq!(
        refused("[device]\nprotocol = \"dmx\""),
        "knobs.toml:2:12: there is no protocol \"dmx\" (write \"auto\" to have it found out, or one of lines, packets, midi, \
         firmata, osc)"
    );
    assert_eq!(
        refused("[device]\nfull_scale = 0"),
        "knobs.toml:2:14: `full_scale` must be from 1 to 65535, not 0"
    );
    assert_eq!(
        refused("[[knob]]\nknob = \"cc 200\"\ncomponent = \"c0\""),
        "knobs.toml:2:8: `cc 200` is no MIDI knob: write \"cc 21\", \"cc 21 channel 2\", \"note 36\" or \"bend channel 1\""
    );
    assert!(refused("[device]\nosc = 0").starts_with("knobs.toml:2:7: `0` is neither a port"));
}

#[test]
fn numbers_that_nothing_reads_are_refused() {
    assert_eq!(
        refused("[defaults]\nratio = 5"),
        "knobs.toml:2:9: `ratio` needs curve = \"exponential\" or \"logarithmic\" beside it"
    );
    assert_eq!(
        refused("[defaults]\ncurve = \"linear\"\nsteepness = 2"),
        "knobs.toml:3:13: `steepness` needs curve = \"s-curve\" beside it"
    );
    assert_eq!(
        refused("[defaults]\ncentre = \"even\"\ndetent = 0.1"),
        "knobs.toml:3:10: an even centre has no detent (leave `detent` out, or set centre = \"rest\")"
    );
    assert_eq!(
        refused("[[knob]]\nknob = 1\ncomponent = \"c0\"\nscale = 0.5\nminimum = 0"),
        "knobs.toml:4:9: `scale` and `minimum`, `maximum` both set the range (keep one of them)"
    );
    assert_eq!(
        refused("[device]\nmidi = \"nano\"\nosc = 9000"),
        "knobs.toml:3:7: a second device is named: one plays at a time (keep one of `serial`, `midi` and `osc`)"
    );
    assert_eq!(
        refused("[[knob]]\nknob = \"jaw\"\ncomponent = \"c0\"\nencoder = \"signed-bit\""),
        "knobs.toml:2:8: `encoder` is for MIDI controllers, and this knob goes by a name"
    );
    assert_eq!(
        refused("[tree]\nfirst_knob = 2"),
        "knobs.toml:2:14: `first_knob` needs `coarse` and `fine` beside it"
    );
}

#[test]
fn what_is_missing_is_said_at_its_heading() {
    assert!(
        refused("[[knob]]\ncomponent = \"c0\"").starts_with("knobs.toml:1:1: [[knob]] does not say which knob it is")
    );
    assert!(refused("\n[[button]]\nknob = 3").starts_with("knobs.toml:2:1: [[button]] has no `command`"));
    assert_eq!(
        refused("[[button]]\nknob = 3\ncommand = \"page\""),
        "knobs.toml:1:1: command = \"focus\" needs a `component` beside it, \"page\" a `page`, and the others neither"
    );
    assert!(
        refused("knob = 3")
            .starts_with("knobs.toml:1:8: `knob` must be a list of tables, each headed [[knob]], not integer")
    );
}

#[test]
fn broken_toml_is_refused_with_line_and_column() {
    let text = refused("[device]\nbaud = = 3\n");
    assert!(text.starts_with("knobs.toml:2:8: "), "{text}");
    let text = refused("# é é é\n[device\n");
    assert!(text.starts_with("knobs.toml:2:"), "{text}");
}

#[test]
fn what_a_report_shows_points_into_the_file() {
    let error = parse("[device]\n\n[defaults]\ntakover = \"jump\"\n").unwrap_err();
    let report = format!("{:?}", Report::new(error));
    assert!(report.contains("takover = \"jump\""), "{report}");
    assert!(report.contains("did you mean `takeover`?"), "{report}");
}

#[test]
fn hostile_texts_are_refused_and_do_not_panic() {
    for text in [
        "\u{0}",
        "[[[",
        "a.b.c.d = {",
        "knob = [[1]]",
        "[[knob]]\nknob = 99999999999999999999",
        "[tree]\nknobs = [1.5]",
    ] {
        refused(text);
    }
    let deep = format!("[device]\nx = {}", "[".repeat(10_000));
    refused(&deep);
}
