//! The writing end of a stream, on its thread.

use core::net::Ipv4Addr;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Report, WrapErr};
use sinew_interchange::{OutputSurface, write_obj};

use super::packets::{Kind, write_datagrams};
use super::{Shape, StreamSpec};

/// An open target.
pub enum Sink {
    Obj {
        path: PathBuf,
        faces: Vec<[u32; 3]>,
    },
    ObjFolder {
        folder: PathBuf,
        faces: Vec<[u32; 3]>,
    },
    Raw(Box<dyn Write + Send>),
    Udp {
        socket: UdpSocket,
        kind: Kind,
        buffer: Vec<u8>,
    },
}

impl Sink {
    /// Opens a target; a raw one gets its head.
    pub fn open(spec: &StreamSpec, vertex_count: usize, faces: &[[u32; 3]]) -> Result<Self, Report> {
        let refuse = || format!("cannot stream to {spec}");
        Ok(match spec {
            StreamSpec::Obj(path) => {
                let folder = path
                    .parent()
                    .filter(|folder| !folder.as_os_str().is_empty())
                    .unwrap_or(Path::new("."));
                if !folder.is_dir() {
                    return Err(miette::miette!("there is no folder {}", folder.display())).wrap_err_with(refuse);
                }
                Self::Obj {
                    path: path.clone(),
                    faces: faces.to_vec(),
                }
            }
            StreamSpec::ObjFolder(folder) => {
                std::fs::create_dir_all(folder)
                    .into_diagnostic()
                    .wrap_err_with(refuse)?;
                Self::ObjFolder {
                    folder: folder.clone(),
                    faces: faces.to_vec(),
                }
            }
            StreamSpec::Raw(target) => {
                let mut out: Box<dyn Write + Send> = match target {
                    None => Box::new(BufWriter::new(io::stdout())),
                    Some(path) => Box::new(BufWriter::new(
                        File::create(path).into_diagnostic().wrap_err_with(refuse)?,
                    )),
                };
                write_raw_head(&mut out, vertex_count, faces)
                    .into_diagnostic()
                    .wrap_err_with(refuse)?;
                Self::Raw(out)
            }
            StreamSpec::Udp(port) => Self::udp(*port, Kind::Positions)
                .into_diagnostic()
                .wrap_err_with(refuse)?,
            StreamSpec::UdpWeights(port) => Self::udp(*port, Kind::Weights)
                .into_diagnostic()
                .wrap_err_with(refuse)?,
        })
    }

    fn udp(port: u16, kind: Kind) -> io::Result<Self> {
        let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0))?;
        socket.connect((Ipv4Addr::LOCALHOST, port))?;
        Ok(Self::Udp {
            socket,
            kind,
            buffer: Vec::new(),
        })
    }

    /// Whether a frame that failed ends the stream: what follows half a frame cannot be read. Files and datagrams stand for themselves.
    pub fn ends_with_a_fault(&self) -> bool {
        matches!(self, Self::Raw(_))
    }

    /// Writes a frame.
    pub fn write(&mut self, shape: &Shape) -> Result<(), String> {
        match self {
            Self::Obj { path, faces } => write_shape(path, shape, faces),
            Self::ObjFolder { folder, faces } => {
                let path = folder.join(format!("frame_{:06}.obj", shape.frame));
                write_shape(&path, shape, faces)
            }
            Self::Raw(out) => write_raw_frame(out, shape).map_err(|error| error.to_string()),
            Self::Udp { socket, kind, buffer } => {
                let values = match kind {
                    Kind::Positions => shape.positions.as_flattened(),
                    Kind::Weights => &shape.weights,
                };
                write_datagrams(
                    *kind,
                    shape.frame,
                    shape.at_us,
                    values,
                    buffer,
                    |datagram| match socket.send(datagram) {
                        Ok(_) => Ok(()),
                        // Nobody listens on that port yet, or not any more: that may change.
                        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => Ok(()),
                        Err(error) => Err(error.to_string()),
                    },
                )
            }
        }
    }

    /// Writes out what is still in buffers.
    pub fn finish(&mut self) -> Result<(), String> {
        match self {
            Self::Raw(out) => out.flush().map_err(|error| error.to_string()),
            _ => Ok(()),
        }
    }
}

fn write_shape(path: &Path, shape: &Shape, faces: &[[u32; 3]]) -> Result<(), String> {
    let surface = OutputSurface::bare("", shape.positions.len(), faces);
    write_obj(path, &shape.positions, &surface).map_err(|error| error.to_string())
}

fn write_raw_head(out: &mut dyn Write, vertex_count: usize, faces: &[[u32; 3]]) -> io::Result<()> {
    out.write_all(b"SNSR")?;
    for number in [1, vertex_count as u32, faces.len() as u32] {
        out.write_all(&number.to_le_bytes())?;
    }
    faces
        .as_flattened()
        .iter()
        .try_for_each(|v| out.write_all(&v.to_le_bytes()))?;
    out.flush()
}

fn write_raw_frame(out: &mut dyn Write, shape: &Shape) -> io::Result<()> {
    out.write_all(&shape.at_us.to_le_bytes())?;
    shape
        .positions
        .as_flattened()
        .iter()
        .try_for_each(|value| out.write_all(&value.to_le_bytes()))?;
    // A reader at the other end of a pipe wants this frame now.
    out.flush()
}
