//! Sinew on a bare Cortex-M7: no operating system, no allocator, no std.
//!
//! Path of data: bytes of a knob box on UART 0 -> lines of positions from 0 to 1023 joined by `|` -> weights -> frame ->
//! one line back: the checksum (FNV-1a) over positions and normals of all frames so far. The first line is thrown away, for it may
//! be cut; a line that is none is answered with `refused` and a reason and moves nothing. The byte 4 (end of transmission)
//! ends the program by way of the debugger (semihosting), which QEMU understands. The package comes in at compile time,
//! from the path in `SINEW_EMBEDDED_PACKAGE`.
#![no_std]
#![no_main]

mod uart;

use core::fmt::{self, Write};
use core::hash::Hasher;
use core::panic::PanicInfo;

use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{self, EXIT_FAILURE, EXIT_SUCCESS};
use fnv::FnvHasher;
use sinew_knobs::protocol::Lines;
use sinew_knobs::{FullScale, KnobEvent, Reading};
use sinew_runtime::{Basis, ControlError, Controls, Frame, FrameError, OpenError, Workspace, WorkspaceError};

use uart::Uart;

/// Where a package may lie.
#[repr(C, align(16))]
struct Aligned<T: ?Sized>(T);

static PACKAGE: &Aligned<[u8]> = &Aligned(*include_bytes!(env!(
    "SINEW_EMBEDDED_PACKAGE",
    "set SINEW_EMBEDDED_PACKAGE to the path of a baked package"
)));

/// What a knob of ten bits reads at its upper stop.
const FULL_SCALE: u16 = 1023;

/// What fits the board's 4 MiB of data memory beside the stack.
const VERTEX_LIMIT: usize = 8 * 1024;
const COMPONENT_LIMIT: usize = 256;
const WORKSPACE_BYTES: usize = 160 * VERTEX_LIMIT;
const END_OF_TRANSMISSION: u8 = 4;

#[entry]
fn main() -> ! {
    static mut MEMORY: [u8; WORKSPACE_BYTES] = [0; WORKSPACE_BYTES];
    static mut POSITIONS: [[f32; 3]; VERTEX_LIMIT] = [[0.0; 3]; VERTEX_LIMIT];
    static mut NORMALS: [[f32; 3]; VERTEX_LIMIT] = [[0.0; 3]; VERTEX_LIMIT];
    static mut WEIGHTS: [f32; COMPONENT_LIMIT] = [0.0; COMPONENT_LIMIT];

    let mut uart = Uart::start();
    let status = match perform(&mut uart, MEMORY, POSITIONS, NORMALS, WEIGHTS) {
        Ok(()) => EXIT_SUCCESS,
        Err(failure) => {
            // The UART's writer never fails.
            let _ = writeln!(uart, "cannot play: {failure}");
            EXIT_FAILURE
        }
    };
    loop {
        debug::exit(status);
    }
}

/// Answers lines until the end of transmission.
fn perform(
    uart: &mut Uart,
    memory: &mut [u8],
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
    weights: &mut [f32],
) -> Result<(), Failure> {
    let basis = Basis::open(&PACKAGE.0).map_err(Failure::Open)?;
    let (vertex_count, component_count) = (basis.vertex_count(), basis.component_count());
    if vertex_count > VERTEX_LIMIT || component_count > COMPONENT_LIMIT {
        return Err(Failure::TooLarge {
            vertex_count,
            component_count,
        });
    }
    let mut workspace = Workspace::new(&basis, memory).map_err(Failure::Workspace)?;
    let mut controls = Controls::new(&basis, &mut weights[..component_count]).map_err(Failure::Controls)?;
    let (positions, normals) = (&mut positions[..vertex_count], &mut normals[..vertex_count]);
    let mut checksum = FnvHasher::default();
    let mut lines = Lines::new(FullScale::Fixed(FULL_SCALE));
    loop {
        let byte = uart.receive();
        if byte == END_OF_TRANSMISSION {
            return Ok(());
        }
        let (good, bad) = (lines.counters().good, lines.counters().bad);
        let mut taken = Ok(());
        lines.feed(&[byte], &mut |event| {
            taken = taken.and_then(|()| turn(&mut controls, event))
        });
        taken.map_err(Failure::Controls)?;
        let answered = if lines.counters().good > good {
            let job = Frame {
                basis: &basis,
                controls: &controls,
                positions,
                normals: Some(normals),
            };
            job.run(&mut workspace).map_err(Failure::Frame)?;
            for x in [&*positions, normals].into_iter().flatten().flatten() {
                checksum.write(&x.to_bits().to_le_bytes());
            }
            writeln!(uart, "{:016x}", checksum.finish())
        } else if let Some(fault) = lines.counters().last_fault.filter(|_| lines.counters().bad > bad) {
            writeln!(uart, "refused: {fault}")
        } else {
            Ok(())
        };
        // The UART's writer never fails.
        let _ = answered;
    }
}

/// The knob of a column moves the component of that number; knobs beyond the components move nothing.
fn turn(controls: &mut Controls<'_>, event: KnobEvent) -> Result<(), ControlError> {
    let k = usize::from(event.knob);
    if let Reading::Position { value, .. } = event.reading
        && k < controls.basis().component_count()
    {
        controls.set_share(k, f32::from(value) / f32::from(FULL_SCALE))?;
    }
    Ok(())
}

/// Why the program ended before its input did.
enum Failure {
    Open(OpenError),
    TooLarge {
        vertex_count: usize,
        component_count: usize,
    },
    Workspace(WorkspaceError),
    Controls(ControlError),
    Frame(FrameError),
}

impl fmt::Display for Failure {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open(error) => error.fmt(out),
            Self::TooLarge {
                vertex_count,
                component_count,
            } => write!(
                out,
                "{vertex_count} vertices and {component_count} components; this board takes {VERTEX_LIMIT} and {COMPONENT_LIMIT}"
            ),
            Self::Workspace(error) => error.fmt(out),
            Self::Controls(error) => error.fmt(out),
            Self::Frame(error) => error.fmt(out),
        }
    }
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    // The program may be anywhere, its own UART included; starting it again changes nothing.
    let _ = writeln!(Uart::start(), "panic: {info}");
    loop {
        debug::exit(EXIT_FAILURE);
    }
}
