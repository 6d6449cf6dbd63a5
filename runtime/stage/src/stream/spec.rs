//! How a stream is asked for: `obj:live.obj`, `obj:frames/`, `raw`, `raw:shape.bin`, `udp:9001`, `udp-weights:9001`.

use core::fmt;
use core::str::FromStr;
use std::path::PathBuf;

/// A stream, as asked for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum StreamSpec {
    /// One OBJ file, replaced whole at every frame.
    Obj(PathBuf),
    /// Numbered OBJ files in a folder.
    ObjFolder(PathBuf),
    /// Raw floats, to standard output or a file.
    Raw(Option<PathBuf>),
    /// Positions in datagrams to this port of the own machine.
    Udp(u16),
    /// Weights in datagrams to this port of the own machine.
    UdpWeights(u16),
}

impl StreamSpec {
    /// Whether it ends in files, which may take a replay faster than it was played. A pipe may be looked at.
    pub fn is_file(&self) -> bool {
        matches!(self, Self::Obj(_) | Self::ObjFolder(_) | Self::Raw(Some(_)))
    }

    /// Whether it sends positions.
    pub fn wants_positions(&self) -> bool {
        !matches!(self, Self::UdpWeights(_))
    }
}

impl FromStr for StreamSpec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (kind, target) = match text.split_once(':') {
            Some((kind, target)) => (kind, Some(target).filter(|target| !target.is_empty())),
            None => (text, None),
        };
        let port = || {
            let port: Option<u16> = target.and_then(|target| target.parse().ok()).filter(|&port| port > 0);
            port.ok_or_else(|| format!("`{text}` needs a port from 1 to 65535, for example {kind}:9001"))
        };
        match kind {
            "obj" => {
                let path = target.unwrap_or("sinew-stage.obj");
                let folder = path.ends_with(['/', std::path::MAIN_SEPARATOR]) || PathBuf::from(path).is_dir();
                Ok(if folder {
                    Self::ObjFolder(path.into())
                } else {
                    Self::Obj(path.into())
                })
            }
            "raw" => Ok(Self::Raw(target.filter(|target| *target != "-").map(PathBuf::from))),
            "udp" => port().map(Self::Udp),
            "udp-weights" => port().map(Self::UdpWeights),
            _ => Err(format!(
                "there is no stream `{kind}`: it is obj, obj:FILE, obj:FOLDER/, raw, raw:FILE, udp:PORT or udp-weights:PORT"
            )),
        }
    }
}

impl fmt::Display for StreamSpec {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Obj(path) | Self::ObjFolder(path) => write!(out, "obj:{}", path.display()),
            Self::Raw(None) => out.write_str("raw"),
            Self::Raw(Some(path)) => write!(out, "raw:{}", path.display()),
            Self::Udp(port) => write!(out, "udp:{port}"),
            Self::UdpWeights(port) => write!(out, "udp-weights:{port}"),
        }
    }
}
