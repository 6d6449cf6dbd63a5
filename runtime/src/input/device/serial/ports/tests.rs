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
    }
}

fn built_in(path: &str) -> SerialPort {
    SerialPort {
        path: path.into(),
        usb: None,
        description: String::new(),
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
    };
    // It was ACM5 and came back as ACM0.
    let moved = known("/dev/ttyACM5", &ports[0]);
    assert_eq!(
        paths("/dev/ttyACM5", Some(&moved)).unwrap(),
        "/dev/ttyACM0 /dev/ttyACM5"
    );
    assert_eq!(
        paths("auto", Some(&moved)).unwrap(),
        "/dev/ttyACM0",
        "and no other box is taken for it"
    );
    let twin = known("/dev/ttyACM2", &ports[2]);
    assert_eq!(paths("auto", Some(&twin)).unwrap(), "/dev/ttyACM2 /dev/ttyACM1");
    let only_built_in = candidates(&SerialSelector::Auto, None, &ports[3..]);
    assert_eq!(only_built_in.unwrap(), ["/dev/ttyS0"]);
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
