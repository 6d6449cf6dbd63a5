//! The page's server as browsers, other programs and hostile ones meet it.

mod common;

use core::time::Duration;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::process::Child;
use std::time::Instant;

use common::{Ran, Stage};
use serde_json::Value;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

const LINE: &str = "play model.sinew --typed --headless --page 0";

/// How long a test waits for what must come: long enough for a machine that does much else.
const PATIENCE: Duration = Duration::from_secs(30);

/// A stage with a page.
struct Played {
    child: Child,
    /// `http://127.0.0.1:PORT`.
    url: String,
}

impl Played {
    fn start(stage: &Stage, line: &str) -> Self {
        let mut child = stage.start(line);
        let mut said = String::new();
        let mut lines = BufReader::new(child.stderr.take().unwrap());
        let url = loop {
            said.clear();
            assert!(lines.read_line(&mut said).unwrap() > 0, "no page");
            if let Some(url) = said.trim().strip_prefix("page: ") {
                break url.to_owned();
            }
        };
        child.stderr = Some(lines.into_inner());
        Self { child, url }
    }

    fn host(&self) -> &str {
        self.url.strip_prefix("http://").unwrap().split('/').next().unwrap()
    }

    fn get(&self, target: &str) -> Vec<u8> {
        self.ask(format!("GET {target} HTTP/1.1\r\nHost: {}\r\n\r\n", self.host()).as_bytes())
    }

    fn ask(&self, bytes: &[u8]) -> Vec<u8> {
        let mut stream = TcpStream::connect(self.host()).unwrap();
        stream.write_all(bytes).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        answer
    }

    fn page(&self) -> Page {
        let (socket, _) = tungstenite::connect(format!("ws://{}/socket", self.host())).unwrap();
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(PATIENCE)).unwrap();
        }
        Page { socket }
    }

    fn end(mut self) -> Ran {
        self.child.stdin.take().unwrap().write_all(b"quit\n").unwrap();
        Ran::new(LINE, self.child.wait_with_output().unwrap())
    }
}

struct Page {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
}

impl Page {
    fn say(&mut self, text: &str) {
        self.socket.send(Message::text(text)).unwrap();
    }

    /// The next text of a type.
    fn text(&mut self, kind: &str) -> Value {
        loop {
            if let Message::Text(text) = self.socket.read().unwrap() {
                let value: Value = serde_json::from_str(&text).unwrap();
                if value["type"] == kind {
                    return value;
                }
            }
        }
    }

    /// Weights of the next frame for which something holds.
    fn weights_until(&mut self, holds: impl Fn(&[f32]) -> bool) -> Vec<f32> {
        let until = Instant::now() + PATIENCE;
        while Instant::now() < until {
            if let Message::Binary(bytes) = self.socket.read().unwrap() {
                let number = |n: usize| u32::from_le_bytes(bytes[4 * n..][..4].try_into().unwrap());
                let weights: Vec<f32> = (0..number(2) as usize).map(|k| f32::from_bits(number(5 + k))).collect();
                if holds(&weights) {
                    return weights;
                }
            }
        }
        panic!("no such frame");
    }

    /// Whether the stage has ended the connection.
    fn ends(mut self) -> bool {
        loop {
            match self.socket.read() {
                Ok(Message::Close(_)) | Err(tungstenite::Error::ConnectionClosed) => return true,
                Ok(_) => {}
                Err(tungstenite::Error::Io(error)) => {
                    return !matches!(
                        error.kind(),
                        std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut
                    );
                }
                Err(_) => return true,
            }
        }
    }
}

#[test]
fn a_slider_on_one_page_moves_the_mesh_of_another() {
    let stage = Stage::new();
    let played = Played::start(&stage, LINE);
    let (mut first, mut second) = (played.page(), played.page());
    let hello = first.text("hello");
    assert_eq!(hello["version"], 1);
    assert_eq!(hello["components"][0], "c0");
    second.say(r#"{"ask":"set","weights":[[0,0.25],[3,-0.5]]}"#);
    first.weights_until(|weights| (weights[0], weights[3]) == (0.25, -0.5));
    second.say(r#"{"ask":"rest"}"#);
    first.weights_until(|weights| weights.iter().all(|weight| *weight == 0.0));
    // One that comes late sees what the others see.
    first.say(r#"{"ask":"set","weights":[[1,0.125]]}"#);
    second.weights_until(|weights| weights[1] == 0.125);
    let mut late = played.page();
    late.weights_until(|weights| weights[1] == 0.125);
    while first.text("state")["screens"] != 3 {}
    first.say(r#"{"ask":"stop-or-release"}"#);
    while late.text("state")["stopped"] != true {}
    played
        .end()
        .expect(0)
        .says(&["page: opened 3 times, 3 at once", "0 refused"]);
}

#[test]
fn the_page_serves_itself_and_the_package() {
    let stage = Stage::new();
    let played = Played::start(&stage, LINE);
    let page = String::from_utf8(played.get("/")).unwrap();
    assert!(
        page.starts_with("HTTP/1.1 200") && page.contains("Content-Security-Policy") && page.ends_with("</html>\n")
    );
    let answer = played.get("/package.sinew");
    let at = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap() + 4;
    // The package that the stage plays is baked, whatever was given.
    sinew_runtime::Basis::open(&sinew_formats::package::AlignedBytes::from_slice(&answer[at..])).unwrap();
    played.end().expect(0);
}

#[test]
fn hostile_pages_are_dropped_and_counted_and_the_show_goes_on() {
    let stage = Stage::new();
    let played = Played::start(&stage, LINE);
    for hostile in [
        Message::text("{"),
        Message::text(r#"{"ask":"quit"}"#),
        Message::text(r#"{"ask":"set","weights":[[9999,0]]}"#),
        Message::text("x".repeat(70_000)),
        Message::binary(vec![0; 16]),
    ] {
        let mut page = played.page();
        page.socket.send(hostile).unwrap();
        assert!(page.ends());
    }
    // Bytes that are no frame of the protocol, behind a good beginning.
    let mut page = played.page();
    if let MaybeTlsStream::Plain(stream) = page.socket.get_mut() {
        stream.write_all(&[0xff; 64]).unwrap();
    }
    assert!(page.ends());
    for nonsense in [
        "\0\r\n\r\n",
        "GET /\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n",
    ] {
        assert!(played.ask(nonsense.as_bytes()).starts_with(b"HTTP/1.1 4"));
    }
    // One that says nothing, and one that never reads: they hold nobody up.
    let _silent = TcpStream::connect(played.host()).unwrap();
    let _deaf = played.page();
    let mut page = played.page();
    for step in 1..=60 {
        page.say(&format!(r#"{{"ask":"set","weights":[[0,{}]]}}"#, step as f32 / 64.0));
    }
    page.weights_until(|weights| weights[0] == 60.0 / 64.0);
    played.end().expect(0).says(&["6 refused"]);
}

#[test]
fn another_address_wants_the_token() {
    let stage = Stage::new();
    let played = Played::start(&stage, "play model.sinew --typed --headless --page 0.0.0.0:0");
    let (_, token) = played.url.split_once("?token=").expect("a token");
    assert!(played.get("/package.sinew").starts_with(b"HTTP/1.1 403"));
    assert!(tungstenite::connect(format!("ws://{}/socket", played.host())).is_err());
    assert!(
        played
            .get(&format!("/package.sinew?token={token}"))
            .starts_with(b"HTTP/1.1 200")
    );
    assert!(tungstenite::connect(format!("ws://{}/socket?token={token}", played.host())).is_ok());
    played.end().expect(0);
}

#[test]
fn the_demo_needs_no_file() {
    let stage = Stage::new();
    let played = Played::start(&stage, "play --demo --typed --headless --page 0");
    let mut page = played.page();
    let hello = page.text("hello");
    assert_eq!(
        (&hello["components"][0], hello["tree"].as_bool()),
        (&"sway".into(), Some(true))
    );
    page.say(r#"{"ask":"set","weights":[[0,1.5]]}"#);
    page.weights_until(|weights| weights[0] == 1.5);
    played.end().expect(0);
    stage.run("play", "").expect(2).says(&["PACKAGE"]);
}

#[test]
fn an_address_in_use_is_named() {
    let stage = Stage::new();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let line = format!(
        "play model.sinew --typed --headless --for 1s --page {}",
        taken.local_addr().unwrap()
    );
    stage
        .run(&line, "")
        .expect(2)
        .says(&["cannot be served at", "any free port"]);
    stage
        .run("play --page model.sinew", "")
        .expect(2)
        .says(&["the package before --page"]);
}
