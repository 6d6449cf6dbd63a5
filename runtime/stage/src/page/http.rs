//! What a browser asks before it speaks WebSocket: the head of a request, checked, and what is answered.

use tungstenite::handshake::derive_accept_key;

use super::address::Token;
use super::files;

/// Longest head of a request, bytes.
pub const HEAD_BYTES_MAX: usize = 8 * 1024;
/// Headers that are read; a request with more is refused.
const HEADERS_MAX: usize = 64;
/// The page runs its own scripts and its WebAssembly and speaks with this server, and nothing else.
const POLICY: &str = "default-src 'self'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data:; connect-src 'self'; base-uri 'none'; form-action 'none'";

/// What to do with a request.
#[derive(Debug)]
pub enum Answer {
    /// Send this and close.
    Send {
        /// Status line and headers, with the empty line.
        head: Vec<u8>,
        /// What follows it.
        body: Body,
    },
    /// Send this and speak WebSocket.
    Upgrade {
        /// Status line and headers, with the empty line.
        head: Vec<u8>,
    },
}

/// What follows the head of an answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Body {
    /// These bytes.
    Bytes(&'static [u8]),
    /// The package that is played.
    Package,
}

/// Who may come.
#[derive(Debug)]
pub struct Door {
    /// The page must know it.
    pub token: Option<Token>,
    /// Whether the address is one of this machine alone: then a name that somebody else's server gave this machine is refused.
    pub is_loopback: bool,
    /// Length of the package, bytes.
    pub package_bytes: usize,
}

impl Door {
    /// Reads a head. `None`: it has not come to its end.
    pub fn answer(&self, bytes: &[u8]) -> Option<Answer> {
        let mut headers = [httparse::EMPTY_HEADER; HEADERS_MAX];
        let mut request = httparse::Request::new(&mut headers);
        match request.parse(bytes) {
            Ok(httparse::Status::Complete(_)) => {}
            Ok(httparse::Status::Partial) if bytes.len() < HEAD_BYTES_MAX => return None,
            Ok(httparse::Status::Partial) => return Some(refuse(431, "Request Header Fields Too Large")),
            Err(_) => return Some(refuse(400, "Bad Request")),
        }
        Some(self.route(&request))
    }

    fn route(&self, request: &httparse::Request<'_, '_>) -> Answer {
        if request.method != Some("GET") {
            return refuse(405, "Method Not Allowed");
        }
        let header = |name: &str| {
            let found = request
                .headers
                .iter()
                .find(|header| header.name.eq_ignore_ascii_case(name));
            found
                .and_then(|header| core::str::from_utf8(header.value).ok())
                .map(str::trim)
        };
        let host = header("host").unwrap_or("");
        if self.is_loopback && !is_own_name(host) {
            return refuse(421, "Misdirected Request");
        }
        let target = request.path.unwrap_or("");
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        if let Some(file) = files::find(path) {
            return send(file.kind, Body::Bytes(file.bytes), file.bytes.len());
        }
        let given = query
            .split('&')
            .find_map(|pair| pair.strip_prefix("token="))
            .unwrap_or("");
        let may_come = self.token.as_ref().is_none_or(|token| token.is(given));
        match path {
            "/package.sinew" | "/socket" if !may_come => refuse(403, "Forbidden"),
            "/package.sinew" => send("application/octet-stream", Body::Package, self.package_bytes),
            "/socket" => {
                // A page of another site must not speak for its visitor. What is no browser sends no origin.
                let is_own = header("origin").is_none_or(|origin| origin.strip_prefix("http://") == Some(host));
                let asks = header("upgrade").is_some_and(|value| value.eq_ignore_ascii_case("websocket"));
                match header("sec-websocket-key") {
                    _ if !is_own => refuse(403, "Forbidden"),
                    Some(key) if asks && header("sec-websocket-version") == Some("13") => upgrade(key),
                    _ => refuse(426, "Upgrade Required"),
                }
            }
            _ => refuse(404, "Not Found"),
        }
    }
}

/// Whether a host, with or without a port, is a name of this machine for itself.
fn is_own_name(host: &str) -> bool {
    let name = match host.strip_prefix('[') {
        Some(rest) => rest.split(']').next().unwrap_or(""),
        None => host.split(':').next().unwrap_or(""),
    };
    name.eq_ignore_ascii_case("localhost") || name.parse().is_ok_and(|ip: core::net::IpAddr| ip.is_loopback())
}

fn send(kind: &str, body: Body, length: usize) -> Answer {
    let head = format!(
        "HTTP/1.1 200 OK\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nCache-Control: no-store\r\n\
         Content-Security-Policy: {POLICY}\r\nX-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\n\
         Connection: close\r\n\r\n"
    );
    Answer::Send {
        head: head.into_bytes(),
        body,
    }
}

fn refuse(status: u16, reason: &str) -> Answer {
    let head = format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: text/plain\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{reason}",
        reason.len()
    );
    Answer::Send {
        head: head.into_bytes(),
        body: Body::Bytes(&[]),
    }
}

fn upgrade(key: &str) -> Answer {
    let head = format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {}\r\n\r\n",
        derive_accept_key(key.as_bytes())
    );
    Answer::Upgrade {
        head: head.into_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn door(token: Option<Token>) -> Door {
        Door {
            is_loopback: token.is_none(),
            token,
            package_bytes: 7,
        }
    }

    fn status(door: &Door, request: &str) -> String {
        let head = match door.answer(request.as_bytes()) {
            None => return "more".to_owned(),
            Some(Answer::Send { head, .. } | Answer::Upgrade { head }) => String::from_utf8(head).unwrap(),
        };
        head.split(' ').nth(1).unwrap().to_owned()
    }

    fn get(target: &str, more: &str) -> String {
        format!("GET {target} HTTP/1.1\r\nHost: 127.0.0.1:8080\r\n{more}\r\n")
    }

    const ASKS: &str =
        "Upgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

    #[test]
    fn files_the_package_and_the_socket_are_answered() {
        let door = door(None);
        for target in ["/", "/?view=mesh", "/page.js", "/sinew.wasm", "/package.sinew"] {
            assert_eq!(status(&door, &get(target, "")), "200", "{target}");
        }
        let Some(Answer::Upgrade { head }) = door.answer(get("/socket", ASKS).as_bytes()) else {
            panic!("no upgrade");
        };
        // The example of RFC 6455, section 1.3.
        assert!(
            String::from_utf8(head)
                .unwrap()
                .contains("s3pPLMBiTxaQ9kYGzzhZRbK+xOo=")
        );
    }

    #[test]
    fn strangers_and_nonsense_are_refused() {
        let open = door(None);
        for (request, expected) in [
            (get("/../Cargo.toml", ""), "404"),
            (get("/socket", ""), "426"),
            (
                get("/socket", &format!("{ASKS}Origin: http://elsewhere.example\r\n")),
                "403",
            ),
            (
                get("/socket", &format!("{ASKS}Origin: http://127.0.0.1:8080\r\n")),
                "101",
            ),
            ("GET / HTTP/1.1\r\nHost: elsewhere.example\r\n\r\n".to_owned(), "421"),
            ("POST / HTTP/1.1\r\nHost: localhost\r\n\r\n".to_owned(), "405"),
            ("\0\0\0\r\n\r\n".to_owned(), "400"),
            ("GET / HTTP/1.1\r\n".to_owned(), "more"),
            (format!("GET / HTTP/1.1\r\nX: {}", "x".repeat(HEAD_BYTES_MAX)), "431"),
            (get("/", &"X: y\r\n".repeat(HEADERS_MAX)), "400"),
        ] {
            assert_eq!(status(&open, &request), expected, "{request:?}");
        }
    }

    #[test]
    fn without_the_token_there_is_the_empty_page_alone() {
        let token = Token::random().unwrap();
        let text = token.to_string();
        let door = door(Some(token));
        assert_eq!(status(&door, &get("/", "")), "200");
        for target in [
            "/package.sinew",
            "/socket",
            "/package.sinew?token=",
            "/socket?token=0123",
        ] {
            assert_eq!(status(&door, &get(target, ASKS)), "403", "{target}");
        }
        assert_eq!(
            status(&door, &get(&format!("/package.sinew?a=b&token={text}"), "")),
            "200"
        );
        assert_eq!(status(&door, &get(&format!("/socket?token={text}"), ASKS)), "101");
    }
}
