//! From the tables of `knobs.toml` to a [`KnobsFile`]: every key, what it may be, and what it may not stand beside.

use sinew_knobs::protocol::{Coding, MidiSettings, Pairing};
use sinew_knobs::{Centre, Command, Curve, Failsafe, FullScale, Protocol, Smoothing, Takeover};

use super::keys::{Fault, Found, Keys, WholeOrText, nearest};
use super::{
    ButtonCommand, ButtonEntry, COMMANDS, ControlEntry, DeviceChoice, Feel, KnobEntry, KnobsFile, Place, TreeEntry,
    parse_toml,
};
use crate::device::parse_osc;

const CURVES: [&str; 4] = ["linear", "exponential", "logarithmic", "s-curve"];

/// Reads the text of a file; its path and text are the caller's to add.
pub(super) fn parse(text: &str) -> Result<KnobsFile, Fault> {
    let table = parse_toml(text)?;
    let mut keys = Keys::new(&table, 0..0, "the file");
    let mut file = KnobsFile::default();
    // The order of headings in the file does not matter: what others build on is read first.
    if let Some(device) = keys.table("device", "[device]")? {
        file.device = device_choice(device)?;
    }
    if let Some(failsafe) = keys.table("failsafe", "[failsafe]")? {
        file.failsafe = read_failsafe(failsafe)?;
    }
    if let Some(mut defaults) = keys.table("defaults", "[defaults]")? {
        file.defaults = feel(&mut defaults)?;
        if let Some(smoothing) = smoothing(&mut defaults, file.smoothing)? {
            file.smoothing = smoothing;
        }
        defaults.finish()?;
    }
    if let Some(tree) = keys.table("tree", "[tree]")? {
        file.tree = Some(read_tree(tree)?);
    }
    for knob in keys.tables("knob", "[[knob]]")? {
        let entry = read_knob(knob, &mut file.device.midi_settings, file.smoothing)?;
        file.knobs.push(entry);
    }
    for button in keys.tables("button", "[[button]]")? {
        file.buttons.push(read_button(button)?);
    }
    keys.finish()?;
    Ok(file)
}

fn device_choice(mut keys: Keys<'_>) -> Result<DeviceChoice, Fault> {
    let serial = keys.text("serial")?.map(|found| Found {
        value: found.value.to_owned(),
        span: found.span,
    });
    let mut device = DeviceChoice {
        serial,
        ..DeviceChoice::default()
    };
    let midi = keys.text("midi")?;
    let osc = keys.whole_or_text("osc")?;
    let spans = [
        device.serial.as_ref().map(|found| &found.span),
        midi.as_ref().map(|found| &found.span),
        osc.as_ref().map(|found| &found.span),
    ];
    let mut named: Vec<_> = spans.into_iter().flatten().collect();
    named.sort_by_key(|span| span.start);
    if let Some(second) = named.get(1) {
        return Err(
            Fault::new((*second).clone(), "a second device is named: one plays at a time")
                .help("keep one of `serial`, `midi` and `osc`"),
        );
    }
    device.midi = midi.map(|found| found.value.to_owned());
    if let Some(osc) = osc {
        let text = match osc.value {
            WholeOrText::Whole(port) => port.to_string(),
            WholeOrText::Text(text) => text.to_owned(),
        };
        device.osc = Some(parse_osc(&text).map_err(|message| Fault::new(osc.span, message))?);
    }
    if let Some(protocol) = keys.text("protocol")?
        && protocol.value != "auto"
    {
        let found = Protocol::parse_name(protocol.value).ok_or_else(|| {
            let names: Vec<_> = Protocol::ALL.iter().map(|protocol| protocol.name()).collect();
            Fault::new(protocol.span, format!("there is no protocol \"{}\"", protocol.value)).help(format!(
                "write \"auto\" to have it found out, or one of {}",
                names.join(", ")
            ))
        })?;
        device.protocol = Some(found);
    }
    device.baud = keys.whole("baud", 50..=20_000_000)?.map(|found| found.value);
    if let Some(full_scale) = keys.small("full_scale", 1..=u16::MAX)? {
        device.full_scale = FullScale::Fixed(full_scale.value);
    }
    if let Some(coding) = keys.word("encoders", &CODINGS)? {
        device.midi_settings.set_all_codings(coding);
    }
    let pairings = [
        ("learned", Pairing::Learned),
        ("always", Pairing::Always),
        ("never", Pairing::Never),
    ];
    if let Some(pairing) = keys.word("pairs", &pairings)? {
        device.midi_settings.pairing = pairing;
    }
    device.spike_guard = keys.flag("spike_guard")?;
    keys.finish()?;
    Ok(device)
}

const CODINGS: [(&str, Coding); 4] = [
    ("absolute", Coding::Absolute),
    ("twos-complement", Coding::TwosComplement),
    ("signed-bit", Coding::SignedBit),
    ("binary-offset", Coding::BinaryOffset),
];

fn read_failsafe(mut keys: Keys<'_>) -> Result<Failsafe, Fault> {
    let mut failsafe = Failsafe::default();
    if let Some(limit) = keys.seconds_or_never("ease_after_s")? {
        failsafe.ease_after_us = limit;
    }
    if let Some(limit) = keys.seconds("ease_s")? {
        failsafe.ease_us = limit;
    }
    if let Some(limit) = keys.seconds_or_never("silence_s")? {
        failsafe.silence_us = limit;
    }
    if let Some(limit) = keys.seconds_or_never("frozen_s")? {
        failsafe.frozen_us = limit;
    }
    if let Some(limit) = keys.whole("flood_per_second", 1..=u32::MAX)? {
        failsafe.flood_per_second = limit.value;
    }
    keys.finish()?;
    Ok(failsafe)
}

fn feel(keys: &mut Keys<'_>) -> Result<Feel, Fault> {
    let curve = keys.text("curve")?;
    let ratio = keys.number("ratio", 1.001..=1000.0)?;
    let steepness = keys.number("steepness", 1.0..=8.0)?;
    let slope = ratio.as_ref().map_or(10.0, |found| found.value);
    let curve = match curve {
        None => None,
        Some(found) => Some(match found.value {
            "linear" => Curve::Linear,
            "exponential" => Curve::Exponential { ratio: slope },
            "logarithmic" => Curve::Logarithmic { ratio: slope },
            "s-curve" => Curve::SCurve {
                steepness: steepness.as_ref().map_or(2.0, |found| found.value),
            },
            other => {
                let meant = nearest(other, CURVES).map_or(String::new(), |word| format!("did you mean \"{word}\"? "));
                return Err(Fault::new(found.span, format!("there is no curve \"{other}\""))
                    .help(format!("{meant}it is one of {}", CURVES.join(", "))));
            }
        }),
    };
    // A number that nothing reads would be a surprise on stage.
    let slopes = matches!(curve, Some(Curve::Exponential { .. } | Curve::Logarithmic { .. }));
    if let Some(ratio) = ratio.filter(|_| !slopes) {
        return Err(Fault::new(
            ratio.span,
            "`ratio` needs curve = \"exponential\" or \"logarithmic\" beside it",
        ));
    }
    if let Some(steepness) = steepness.filter(|_| !matches!(curve, Some(Curve::SCurve { .. }))) {
        return Err(Fault::new(
            steepness.span,
            "`steepness` needs curve = \"s-curve\" beside it",
        ));
    }
    let centre = keys.word("centre", &[("rest", true), ("even", false)])?;
    let detent = keys.number("detent", 0.0..=0.5)?;
    let centre = match (centre, detent) {
        (Some(false), Some(detent)) => {
            return Err(Fault::new(detent.span, "an even centre has no detent")
                .help("leave `detent` out, or set centre = \"rest\""));
        }
        (Some(false), None) => Some(Centre::Even),
        (_, Some(detent)) => Some(Centre::Rest { detent: detent.value }),
        (Some(true), None) => Some(Centre::default()),
        (None, None) => None,
    };
    let takeovers = [
        ("jump", Takeover::Jump),
        ("pickup", Takeover::Pickup),
        ("scale", Takeover::Scale),
        ("relative", Takeover::Relative),
    ];
    Ok(Feel {
        inverted: keys.flag("inverted")?,
        curve,
        centre,
        slew: keys.number("slew", 1e-6..=1e9)?.map(|found| found.value),
        takeover: keys.word("takeover", &takeovers)?,
    })
}

fn smoothing(keys: &mut Keys<'_>, under: Smoothing) -> Result<Option<Smoothing>, Fault> {
    let Some(mut table) = keys.table("smoothing", "`smoothing`")? else {
        return Ok(None);
    };
    let mut smoothing = under;
    if let Some(found) = table.number("minimum_cutoff_hz", 0.01..=1000.0)? {
        smoothing.minimum_cutoff_hz = found.value;
    }
    if let Some(found) = table.number("speed_gain", 0.0..=10_000.0)? {
        smoothing.speed_gain = found.value;
    }
    if let Some(found) = table.number("speed_cutoff_hz", 0.01..=1000.0)? {
        smoothing.speed_cutoff_hz = found.value;
    }
    table.finish()?;
    Ok(Some(smoothing))
}

fn read_place(found: Found<WholeOrText<'_>>) -> Result<Found<Place>, Fault> {
    let value = Place::of(found.value).map_err(|message| Fault::new(found.span.clone(), message))?;
    Ok(Found {
        value,
        span: found.span,
    })
}

fn place(keys: &mut Keys<'_>, heading: &str) -> Result<Found<Place>, Fault> {
    match keys.whole_or_text("knob")? {
        Some(found) => read_place(found),
        None => Err(Fault::new(keys.span.clone(), format!("{heading} does not say which knob it is")).help(
            "add for example knob = 0 (a column or an index), knob = \"cc 21\", or knob = \"jaw\" (what the device calls it)",
        )),
    }
}

fn read_tree(mut keys: Keys<'_>) -> Result<TreeEntry, Fault> {
    let coarse = keys.small("coarse", 1..=4096)?.map(|found| found.value);
    let fine = keys.small("fine", 0..=4096)?.map(|found| found.value);
    let follow_touch = keys.flag("follow_touch")?.unwrap_or(true);
    let first = keys.small("first_knob", 0..=u16::MAX)?;
    let listed = keys.whole_or_text_list("knobs")?;
    let knobs = match (first, listed) {
        (Some(first), Some(_)) => {
            return Err(Fault::new(
                first.span,
                "`first_knob` and `knobs` both say where the tree's knobs are",
            )
            .help("keep one of them"));
        }
        (Some(first), None) => {
            let (Some(coarse), Some(fine)) = (coarse, fine) else {
                return Err(Fault::new(
                    first.span,
                    "`first_knob` needs `coarse` and `fine` beside it",
                ));
            };
            let last = u32::from(first.value) + u32::from(coarse) + u32::from(fine);
            if last > u32::from(u16::MAX) {
                return Err(Fault::new(first.span, "the tree's knobs end beyond 65535"));
            }
            let span = first.span;
            let knobs = u32::from(first.value)..last;
            knobs
                .map(|address| Found {
                    value: Place::Number(address as u16),
                    span: span.clone(),
                })
                .collect()
        }
        (None, Some(listed)) => listed.into_iter().map(read_place).collect::<Result<Vec<_>, _>>()?,
        (None, None) => Vec::new(),
    };
    let feel = feel(&mut keys)?;
    let span = keys.span.clone();
    keys.finish()?;
    Ok(TreeEntry {
        coarse,
        fine,
        follow_touch,
        knobs,
        feel,
        span,
    })
}

fn read_knob(mut keys: Keys<'_>, midi: &mut MidiSettings, under: Smoothing) -> Result<KnobEntry, Fault> {
    let place = place(&mut keys, "[[knob]]")?;
    let name = keys.text("name")?.map_or(String::new(), |found| found.value.to_owned());
    let step = keys.number("step", 1e-6..=1.0)?.map(|found| found.value);
    let acceleration = keys.number("acceleration", 1.0..=100.0)?.map(|found| found.value);
    let smoothing = smoothing(&mut keys, under)?;
    if let Some(coding) = keys.word("encoder", &CODINGS)? {
        let Place::Number(address) = place.value else {
            return Err(Fault::new(
                place.span,
                "`encoder` is for MIDI controllers, and this knob goes by a name",
            ));
        };
        midi.set_coding(address, coding);
    }
    let mut controls = Vec::new();
    let own = keys
        .has("component")
        .then(|| read_control(&mut keys, Feel::default()))
        .transpose()?;
    let common = match &own {
        Some(own) => own.feel,
        None => feel(&mut keys)?,
    };
    let groups = keys.tables("control", "[[knob.control]]")?;
    if let (Some(_), Some(group)) = (&own, groups.first()) {
        return Err(
            Fault::new(group.span.clone(), "this knob has a `component` and a group as well")
                .help("move the component into a [[knob.control]] of its own"),
        );
    }
    controls.extend(own);
    for mut group in groups {
        controls.push(read_control(&mut group, common)?);
        group.finish()?;
    }
    keys.finish()?;
    Ok(KnobEntry {
        place,
        name,
        step,
        acceleration,
        smoothing,
        controls,
    })
}

fn read_control(keys: &mut Keys<'_>, under: Feel) -> Result<ControlEntry, Fault> {
    let component = keys
        .text("component")?
        .ok_or_else(|| Fault::new(keys.span.clone(), "[[knob.control]] names no `component`"))?;
    let scale = keys.number("scale", -1.0..=1.0)?;
    let minimum = keys.number("minimum", -1e9..=1e9)?;
    let maximum = keys.number("maximum", -1e9..=1e9)?;
    if let Some(scale) = scale.as_ref().filter(|_| minimum.is_some() || maximum.is_some()) {
        return Err(Fault::new(
            scale.span.clone(),
            "`scale` and `minimum`, `maximum` both set the range",
        )
        .help("keep one of them"));
    }
    if let Some(scale) = scale.as_ref().filter(|scale| scale.value == 0.0) {
        return Err(Fault::new(scale.span.clone(), "a `scale` of 0 moves nothing").help("leave the control out"));
    }
    Ok(ControlEntry {
        span: component.span.clone(),
        component: Found {
            value: component.value.to_owned(),
            span: component.span,
        },
        page: keys.small("page", 1..=u16::MAX)?.map(|found| found.value),
        scale: scale.map(|found| found.value),
        minimum: minimum.map(|found| found.value),
        maximum: maximum.map(|found| found.value),
        feel: feel(keys)?.over(under),
    })
}

fn read_button(mut keys: Keys<'_>) -> Result<ButtonEntry, Fault> {
    let place = place(&mut keys, "[[button]]")?;
    let mut words: Vec<(&'static str, Option<Command>)> =
        COMMANDS.map(|(word, command)| (word, Some(command))).to_vec();
    words.extend([("focus", None), ("page", None)]);
    let Some(command) = keys.word("command", &words)? else {
        return Err(Fault::new(keys.span, "[[button]] has no `command`").help("add for example command = \"stop\""));
    };
    let component = keys.text("component")?;
    let page = keys.small("page", 1..=u16::MAX)?;
    let span = keys.span.clone();
    keys.finish()?;
    let command = match (command, component, page) {
        (Some(command), None, None) => ButtonCommand::Plain(command),
        (None, Some(component), None) => ButtonCommand::Focus(Found {
            value: component.value.to_owned(),
            span: component.span,
        }),
        (None, None, Some(page)) => ButtonCommand::Page(page),
        _ => {
            return Err(Fault::new(
                span,
                "command = \"focus\" needs a `component` beside it, \"page\" a `page`, and the others neither",
            ));
        }
    };
    Ok(ButtonEntry { place, command })
}
