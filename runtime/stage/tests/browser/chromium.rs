//! Headless Chromium over its debugging socket: just enough to open pages, press keys, drag and take pictures.

use core::time::Duration;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Instant;

use serde_json::{Value, json};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// A browser; it ends with the test.
pub struct Chromium {
    child: Child,
    port: u16,
    /// Its profile, which goes with it.
    _profile: tempfile::TempDir,
}

impl Drop for Chromium {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn program() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("SINEW_CHROMIUM") {
        return Some(named.into());
    }
    let folders = std::env::var_os("PATH")?;
    let names = ["chromium", "chromium-browser", "google-chrome"];
    std::env::split_paths(&folders)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|path| path.is_file())
}

impl Chromium {
    /// `None` where there is none.
    pub fn start() -> Option<Self> {
        let profile = tempfile::tempdir().unwrap();
        let mut command = Command::new(program()?);
        command.args([
            "--headless=new",
            "--no-sandbox",
            "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader",
        ]);
        command.args([
            "--remote-debugging-port=0",
            "--no-first-run",
            "--hide-scrollbars",
            "about:blank",
        ]);
        command.arg(format!("--user-data-dir={}", profile.path().display()));
        command.stdout(Stdio::null()).stderr(Stdio::null());
        let child = command.spawn().unwrap();
        let port = wait_for_port(&profile.path().join("DevToolsActivePort"));
        Some(Self {
            child,
            port,
            _profile: profile,
        })
    }

    /// A page of a size, in CSS pixels.
    pub fn open(&self, url: &str, width: u32, height: u32) -> Tab {
        let mut stream = TcpStream::connect(("127.0.0.1", self.port)).unwrap();
        let host = format!("127.0.0.1:{}", self.port);
        write!(
            stream,
            "PUT /json/new?about:blank HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"
        )
        .unwrap();
        let target = read_json(&mut stream);
        let (socket, _) = tungstenite::connect(target["webSocketDebuggerUrl"].as_str().unwrap()).unwrap();
        if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
            stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        }
        let mut tab = Tab { socket, calls: 0 };
        let mobile = width < 500;
        let metrics = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile });
        tab.call("Emulation.setDeviceMetricsOverride", metrics);
        let clear = json!({ "color": { "r": 0, "g": 0, "b": 0, "a": 0 } });
        tab.call("Emulation.setDefaultBackgroundColorOverride", clear);
        // A page behind another one must go on drawing.
        tab.call("Emulation.setFocusEmulationEnabled", json!({ "enabled": true }));
        tab.call("Page.navigate", json!({ "url": url }));
        tab
    }
}

/// The body of an answer, which the browser sends without closing the connection.
fn read_json(stream: &mut TcpStream) -> Value {
    stream.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
    let (mut answer, mut buffer) = (Vec::new(), [0; 4096]);
    loop {
        let read = stream.read(&mut buffer).unwrap();
        assert!(read > 0, "Chromium closed the connection");
        answer.extend_from_slice(&buffer[..read]);
        let text = String::from_utf8_lossy(&answer);
        let body = text.split_once("\r\n\r\n").map_or("", |(_, body)| body);
        if let Ok(value) = serde_json::from_str(body) {
            return value;
        }
    }
}

fn wait_for_port(file: &Path) -> u16 {
    let until = Instant::now() + Duration::from_secs(60);
    while Instant::now() < until {
        let text = std::fs::read_to_string(file).unwrap_or_default();
        if let Some(port) = text.lines().next().and_then(|line| line.parse().ok()) {
            return port;
        }
        thread::sleep(Duration::from_millis(50));
    }
    panic!("Chromium did not start");
}

/// One page.
pub struct Tab {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    calls: u64,
}

impl Tab {
    fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.calls += 1;
        let call = json!({ "id": self.calls, "method": method, "params": parameters });
        self.socket.send(Message::text(call.to_string())).unwrap();
        loop {
            let Message::Text(text) = self.socket.read().unwrap() else {
                continue;
            };
            let mut answer: Value = serde_json::from_str(&text).unwrap();
            if answer["id"] == self.calls {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].take();
            }
        }
    }

    /// Value of an expression; null for one that throws, as in a page that is still loading.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let parameters = json!({ "expression": expression, "returnByValue": true });
        self.call("Runtime.evaluate", parameters)["result"]["value"].take()
    }

    /// Before the others, as a person looks at it.
    fn bring_forward(&mut self) {
        self.call("Page.bringToFront", json!({}));
    }

    /// Presses a key and lets it go.
    pub fn key(&mut self, key: &str, code: u32) {
        self.bring_forward();
        let (kind, text) = if key.len() == 1 {
            ("keyDown", key)
        } else {
            ("rawKeyDown", "")
        };
        let down = json!({ "type": kind, "key": key, "code": key, "text": text, "windowsVirtualKeyCode": code });
        self.call("Input.dispatchKeyEvent", down);
        self.call(
            "Input.dispatchKeyEvent",
            json!({ "type": "keyUp", "key": key, "windowsVirtualKeyCode": code }),
        );
    }

    /// Waits until the page has drawn what it knows: a page behind another one may be many pictures late.
    fn settle(&mut self) {
        self.bring_forward();
        let two_pictures =
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))";
        let parameters = json!({ "expression": two_pictures, "awaitPromise": true });
        self.call("Runtime.evaluate", parameters);
    }

    /// A point of the window where the mesh can be taken hold of: the seen vertex that is highest.
    pub fn mesh_point(&mut self) -> (f64, f64) {
        self.settle();
        let found = self.evaluate(
            "(() => { const all = Array.from({ length: sinew.vertexCount }, (_, v) => view.screenOf(sinew.positions, v)); \
             const seen = all.filter(([x, y], v) => view.vertexAt(sinew.positions, sinew.normals, x, y, 2)?.vertex === v); \
             seen.sort((a, b) => a[1] - b[1]); return seen[0].slice(0, 2); })()",
        );
        (found[0].as_f64().unwrap(), found[1].as_f64().unwrap())
    }

    /// Drags with the main button, as slowly as the page draws.
    pub fn drag(&mut self, from: (f64, f64), to: (f64, f64)) {
        self.settle();
        let mut mouse = |kind: &str, (x, y): (f64, f64), buttons: u32| {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
            self.settle();
        };
        mouse("mousePressed", from, 1);
        for step in 1..=8 {
            let share = f64::from(step) / 8.0;
            mouse(
                "mouseMoved",
                (from.0 + share * (to.0 - from.0), from.1 + share * (to.1 - from.1)),
                1,
            );
        }
        mouse("mouseReleased", to, 0);
    }

    /// The look that the system asks for.
    pub fn dark(&mut self, is_dark: bool) {
        let value = if is_dark { "dark" } else { "light" };
        let features = json!([{ "name": "prefers-color-scheme", "value": value }]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
        thread::sleep(Duration::from_millis(300));
    }

    /// The page as it looks: RGBA, row by row. Kept as NAME.png where `SINEW_SCREENSHOTS` says.
    pub fn picture(&mut self, name: &str) -> Vec<u8> {
        self.bring_forward();
        thread::sleep(Duration::from_millis(400));
        let answer = self.call("Page.captureScreenshot", json!({ "format": "png" }));
        let bytes = decode(answer["data"].as_str().unwrap());
        if let Some(folder) = std::env::var_os("SINEW_SCREENSHOTS") {
            std::fs::write(Path::new(&folder).join(format!("{name}.png")), &bytes).unwrap();
        }
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::ALPHA);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        pixels
    }
}

fn decode(text: &str) -> Vec<u8> {
    use base64::Engine as _;
    base64::engine::general_purpose::STANDARD.decode(text).unwrap()
}
