//! The Arduino sketches of `docs/arduino`, compiled for the boards that `avr-g++` knows. Debian's packages are gcc-avr, avr-libc and
//! arduino-core-avr.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const CORE: &str = "/usr/share/arduino/hardware/arduino/avr";

/// What the IDE calls a board, its processor and its pins.
const BOARDS: [(&str, &str, &str); 3] = [
    ("ARDUINO_AVR_UNO", "atmega328p", "standard"),
    ("ARDUINO_AVR_NANO", "atmega328p", "eightanaloginputs"),
    ("ARDUINO_AVR_MEGA2560", "atmega2560", "mega"),
];

fn library() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/arduino")
}

fn sketches() -> Vec<PathBuf> {
    let folders = fs::read_dir(library().join("examples")).unwrap();
    let sketch = |folder: PathBuf| {
        // The IDE opens a sketch only if it is called as its folder is.
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        folder.join(format!("{name}.ino"))
    };
    folders.map(|entry| sketch(entry.unwrap().path())).collect()
}

#[test]
#[ignore = "needs avr-g++ and Arduino's core"]
fn every_sketch_compiles_for_uno_nano_and_mega() {
    assert_eq!(sketches().len(), 3);
    for (board, processor, variant) in BOARDS {
        for sketch in sketches() {
            let mut compiler = Command::new("avr-g++");
            compiler.args(["-std=gnu++11", "-Os", "-Wall", "-Werror", "-fsyntax-only", "-x", "c++"]);
            compiler.args([
                "-DF_CPU=16000000L",
                "-DARDUINO=10819",
                "-DARDUINO_ARCH_AVR",
                "-include",
                "Arduino.h",
            ]);
            compiler.arg(format!("-mmcu={processor}")).arg(format!("-D{board}"));
            for folder in [format!("{CORE}/cores/arduino"), format!("{CORE}/variants/{variant}")] {
                compiler.args(["-I", &folder]);
            }
            compiler.arg("-I").arg(library()).arg(&sketch);
            let output = compiler.output().unwrap();
            let said = String::from_utf8_lossy(&output.stderr);
            assert!(output.status.success(), "{board}, {}:\n{said}", sketch.display());
        }
    }
}

#[test]
fn the_library_names_its_headers() {
    let properties = fs::read_to_string(library().join("library.properties")).unwrap();
    let includes = properties
        .lines()
        .find_map(|line| line.strip_prefix("includes="))
        .unwrap();
    for header in includes.split(',') {
        assert!(library().join(header).is_file(), "{header}");
    }
}
