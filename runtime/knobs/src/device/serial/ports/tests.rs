//! Which port is tried first, and what people are told.

use super::*;

fn usb(path: &str, product_id: u16, number: Option<&str>) -> SerialPort {
    SerialPort {
        path: path.into(),
        usb: Some(UsbIdentity {
            vendor_id: 0x2341,
            product_id,
            serial_number: number.map(Into::into),
        }),
        description: "Arduino".into(),
        socket: None,
    }
}

fn built_in(path: &str) -> SerialPort {
    SerialPort {
        path: path.into(),
        usb: None,
        description: String::new(),
        socket: None,
    }
}

#[test]
fn a_selector_is_read_as_it_is_written() {
    for (text, selector) in [
        ("auto", SerialSelector::Auto),
        ("/dev/ttyACM0", SerialSelector::Path("/dev/ttyACM0".into())),
        ("COM3", SerialSelector::Path("COM3".into())),
        (
            "2341:0043",
            SerialSelector::Usb {
                vendor_id: 0x2341,
                product_id: 0x43,
            },
        ),
        ("serial=95A0", SerialSelector::SerialNumber("95A0".into())),
        ("2341:43", SerialSelector::Path("2341:43".into())),
        ("+341:0043", SerialSelector::Path("+341:0043".into())),
    ] {
        assert_eq!(text.parse(), Ok(selector.clone()));
        assert_eq!(selector.to_string(), text);
    }
}

#[test]
fn candidates_come_in_order_of_trust() {
    let ports = [
        usb("/dev/ttyACM0", 1, Some("A")),
        usb("/dev/ttyACM1", 2, None),
        usb("/dev/ttyACM2", 2, None),
        built_in("/dev/ttyS0"),
    ];
    let paths = |selector: &str, known: Option<&Known>| {
        let selector: SerialSelector = selector.parse().unwrap();
        candidates(&selector, known, &ports).map(|paths| paths.join(" "))
    };
    assert_eq!(paths("auto", None).unwrap(), "/dev/ttyACM0 /dev/ttyACM1 /dev/ttyACM2");
    assert_eq!(paths("2341:0002", None).unwrap(), "/dev/ttyACM1 /dev/ttyACM2");
    assert_eq!(paths("serial=A", None).unwrap(), "/dev/ttyACM0");
    assert_eq!(paths("/tmp/box", None).unwrap(), "/tmp/box");
    let known = |path: &str, port: &SerialPort| Known {
        path: path.into(),
        usb: port.usb.clone(),
        socket: None,
    };
    // It was ACM5 and came back as ACM0.
    let moved = known("/dev/ttyACM5", &ports[0]);
    assert_eq!(
        paths("/dev/ttyACM5", Some(&moved)).unwrap(),
        "/dev/ttyACM0 /dev/ttyACM5"
    );
    let taken = known("/dev/ttyACM1", &ports[0]);
    assert_eq!(
        paths("/dev/ttyACM1", Some(&taken)).unwrap(),
        "/dev/ttyACM0",
        "another device has the old path"
    );
    assert_eq!(
        paths("auto", Some(&moved)).unwrap(),
        "/dev/ttyACM0",
        "and no other box is taken for it"
    );
}

#[test]
fn a_twin_is_not_taken_for_the_box_that_is_gone() {
    // Lights and a knob box with the same converter chip, which has no serial number.
    let (lights, knobs) = (usb("/dev/ttyUSB0", 2, None), usb("/dev/ttyUSB1", 2, None));
    let known = Known {
        path: "/dev/ttyUSB1".into(),
        usb: knobs.usb.clone(),
        socket: None,
    };
    let at_socket = |port: &SerialPort, socket: &str| SerialPort {
        socket: Some(socket.into()),
        ..port.clone()
    };
    for selector in ["auto", "2341:0002"] {
        let selector: SerialSelector = selector.parse().unwrap();
        let both = [lights.clone(), knobs.clone()];
        assert_eq!(candidates(&selector, Some(&known), &both).unwrap(), ["/dev/ttyUSB1"]);
        assert!(candidates(&selector, Some(&known), &both[..1]).is_err(), "{selector}");
        // Where the system names the sockets, a box that came back under another name is known by its own.
        let plugged = Known {
            socket: Some("usb-2".into()),
            ..known.clone()
        };
        let renamed = [
            at_socket(&lights, "usb-1"),
            at_socket(&usb("/dev/ttyUSB2", 2, None), "usb-2"),
        ];
        assert_eq!(
            candidates(&selector, Some(&plugged), &renamed).unwrap(),
            ["/dev/ttyUSB2"]
        );
        assert!(candidates(&selector, Some(&plugged), &renamed[..1]).is_err());
    }
}

#[test]
fn auto_takes_no_port_that_is_not_on_usb() {
    let ports = [built_in("/dev/cu.Bluetooth-Incoming-Port"), built_in("/dev/ttyS0")];
    let error = candidates(&SerialSelector::Auto, None, &ports).unwrap_err().to_string();
    assert!(error.contains("no knob box is plugged into USB"), "{error}");
    assert!(error.contains("/dev/ttyS0") && error.contains("name it"), "{error}");
}

#[test]
fn an_error_names_the_port_and_the_cure() {
    let ports = [usb("/dev/ttyACM0", 1, Some("A"))];
    let missing = candidates(&SerialSelector::SerialNumber("B".into()), None, &ports)
        .unwrap_err()
        .to_string();
    assert!(
        missing.contains("serial=B") && missing.contains("/dev/ttyACM0  2341:0001  serial=A  Arduino"),
        "{missing}"
    );
    let none = candidates(&SerialSelector::Auto, None, &[]).unwrap_err().to_string();
    assert!(none.contains("plugged in"), "{none}");
    let of = |kind| SerialError::of_opening("/dev/null", &serialport::Error::new(kind, "reason")).to_string();
    assert!(of(ErrorKind::Io(std::io::ErrorKind::PermissionDenied)).contains("dialout"));
    assert!(of(ErrorKind::NoDevice).contains("/dev/null is in use"));
    assert!(of(ErrorKind::Unknown).contains("reason"));
}
