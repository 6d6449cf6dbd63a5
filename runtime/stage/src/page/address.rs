//! Where the page is served, and who may come: an address of this machine needs nothing more, any other one a token that only its
//! URL tells.

use core::fmt;
use core::net::{IpAddr, Ipv4Addr, SocketAddr};
use core::str::FromStr;

use miette::{IntoDiagnostic, Report, WrapErr};

/// The port when none is given.
const PORT: u16 = 8080;

/// `ADDRESS:PORT`, `PORT` or `ADDRESS`; without an address this machine alone, without a port 8080.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PageAddress(pub SocketAddr);

impl FromStr for PageAddress {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(address) = text.parse() {
            return Ok(Self(address));
        }
        if let Ok(port) = text.parse() {
            return Ok(Self(SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port)));
        }
        match text.parse::<IpAddr>() {
            Ok(ip) => Ok(Self(SocketAddr::new(ip, PORT))),
            Err(_) => Err(format!(
                "`{text}` is no address: write for example 8080, 127.0.0.1:8080 or 0.0.0.0:8080, and the package before --page"
            )),
        }
    }
}

impl PageAddress {
    /// Whether only programs of this machine reach it.
    pub fn is_loopback(self) -> bool {
        self.0.ip().is_loopback()
    }

    /// The URL to open: an address that means every interface is reached at this machine's own.
    pub fn url(self, token: Option<&Token>) -> String {
        let mut address = self.0;
        if address.ip().is_unspecified() {
            let own = match address.ip() {
                IpAddr::V4(_) => IpAddr::V4(Ipv4Addr::LOCALHOST),
                IpAddr::V6(_) => IpAddr::V6(core::net::Ipv6Addr::LOCALHOST),
            };
            address.set_ip(own);
        }
        match token {
            None => format!("http://{address}/"),
            Some(token) => format!("http://{address}/?token={token}"),
        }
    }
}

/// What a page of another machine must know: 128 random bits.
#[derive(Clone, PartialEq, Eq)]
pub struct Token([u8; 16]);

impl Token {
    /// A new one.
    ///
    /// # Errors
    /// The system gives no random numbers.
    pub fn random() -> Result<Self, Report> {
        let mut bits = [0; 16];
        getrandom::fill(&mut bits)
            .into_diagnostic()
            .wrap_err("no random numbers for the page's token")?;
        Ok(Self(bits))
    }

    /// Whether a text is this token. Takes as long for a wrong one, wherever it is wrong.
    pub fn is(&self, text: &str) -> bool {
        let own = self.to_string();
        let differing = own.bytes().zip(text.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
        own.len() == text.len() && differing == 0
    }
}

impl fmt::Display for Token {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(out, "{byte:02x}"))
    }
}

impl fmt::Debug for Token {
    /// Not the token: it would end in a log.
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("Token")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_people_write_them() {
        let read = |text: &str| text.parse::<PageAddress>().map(|address| address.0.to_string());
        assert_eq!(read("8081"), Ok("127.0.0.1:8081".to_owned()));
        assert_eq!(read("0.0.0.0:80"), Ok("0.0.0.0:80".to_owned()));
        assert_eq!(read("192.168.1.5"), Ok("192.168.1.5:8080".to_owned()));
        assert_eq!(read("[::1]:9"), Ok("[::1]:9".to_owned()));
        assert!(read("walk.sinew").unwrap_err().contains("the package before --page"));
        assert!(read("99999").is_err());
    }

    #[test]
    fn a_token_is_only_itself() {
        let token = Token::random().unwrap();
        let text = token.to_string();
        assert!(token.is(&text) && text.len() == 32);
        assert!(!token.is("") && !token.is(&text[1..]) && !token.is(&format!("{text}0")));
        assert_ne!(Token::random().unwrap(), token);
        let address: PageAddress = "0.0.0.0:80".parse().unwrap();
        assert_eq!(address.url(Some(&token)), format!("http://127.0.0.1:80/?token={text}"));
        assert!(!format!("{token:?}").contains(&text));
    }
}
