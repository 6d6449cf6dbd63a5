//! A port that another program makes: socat links a pseudo-terminal, dies, and another one makes the same link.

use std::io::Write;
use std::process::{Child, Command, Stdio};

use super::*;

/// One socat: what goes into it comes out of the terminal at the link.
struct Socat {
    child: Child,
}

impl Socat {
    fn link(path: &Path) -> Self {
        let terminal = format!("PTY,link={},raw,echo=0", path.display());
        let child = Command::new("socat")
            .args(["-u", "-", &terminal])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn();
        let child = child.expect("socat is installed");
        Self { child }
    }

    fn say(&mut self, lines: &str) {
        let input = self.child.stdin.as_mut().expect("it is piped");
        input.write_all(lines.as_bytes()).expect("socat listens");
    }

    /// As a power cut: nothing is tidied up.
    fn kill(mut self) {
        self.child.kill().expect("it runs");
        self.child.wait().expect("it has ended");
    }
}

#[test]
#[ignore = "needs socat"]
fn a_link_that_another_program_makes_again_is_found_again() {
    let folder = folder();
    let path = folder.path().join("knobs");
    let mut socat = Socat::link(&path);
    let patiently = |what: &str, is_so: &mut dyn FnMut() -> bool| {
        let begun = Instant::now();
        while !is_so() {
            assert!(begun.elapsed() < PATIENCE, "{what} did not come");
            thread::sleep(Duration::from_millis(2));
        }
    };
    patiently("the link", &mut || path.exists());
    let clock = Clock::start();
    let mut source = SerialSource::open(selector(&path), named(Protocol::Lines), clock).unwrap();
    let mut heard = Vec::new();
    let mut values = |source: &mut SerialSource, socat: &mut Socat, value: u16| {
        let wanted = SourceEvent::Knob(KnobEvent {
            knob: 1,
            reading: Reading::Position {
                value,
                full_scale: 1023,
            },
        });
        heard.clear();
        patiently("the value", &mut || {
            // Again and again: what was said before the port was open is lost, as with a board.
            socat.say(&format!("7|{value}\n"));
            source.poll(clock.now_us(), &mut |_, event| heard.push(event));
            heard.contains(&wanted)
        });
        heard.clone()
    };
    values(&mut source, &mut socat, 512);
    assert_eq!((source.device_status().unplugs, source.device_status().replugs), (0, 0));

    socat.kill();
    patiently("the loss", &mut || source.device_status().unplugs == 1);
    thread::sleep(Duration::from_millis(300));
    assert_eq!(source.device_status().replugs, 0, "there is nothing to open");
    let mut socat = Socat::link(&path);
    let story = values(&mut source, &mut socat, 700);
    let links: Vec<SourceEvent> = story
        .into_iter()
        .filter(|event| !matches!(event, SourceEvent::Knob(_)))
        .collect();
    assert_eq!(links, [SourceEvent::Unplugged, SourceEvent::Replugged]);
    let counts = source.device_status();
    assert_eq!((counts.unplugs, counts.replugs), (1, 1));
    assert_eq!(counts.counters.bad, 0, "{counts:#?}");
    drop(source);
    socat.kill();
}
