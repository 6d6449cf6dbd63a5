//! A program without std and without an allocator that opens a package, plays frames and prints a checksum of them.
//!
//! Should anything in the runtime or the package reader reach for the heap, this does not link: "no global memory
//! allocator found". `tests/tests/no_std_link.rs` builds it, runs it and compares the checksum with its own. The
//! package comes in at compile time, from the path in `SINEW_EMBEDDED_PACKAGE`.
#![no_std]
#![no_main]

use core::ffi::{c_char, c_int};
use core::panic::PanicInfo;

use sinew_checksum::{Checksum, play};
use sinew_runtime::{Basis, Controls, Kernels, Workspace};

// Only what puts a line on the screen and ends the program; nothing here knows the heap.
#[link(name = "c")]
unsafe extern "C" {
    fn puts(text: *const c_char) -> c_int;
    fn abort() -> !;
}

/// Where a package may lie.
#[repr(C, align(16))]
struct Aligned<T: ?Sized>(T);

static PACKAGE: &Aligned<[u8]> = &Aligned(*include_bytes!(env!(
    "SINEW_EMBEDDED_PACKAGE",
    "set SINEW_EMBEDDED_PACKAGE to the path of a baked package with at most 64 vertices and 16 components"
)));

const VERTEX_LIMIT: usize = 64;
const COMPONENT_LIMIT: usize = 16;
const WORKSPACE_BYTES: usize = 16 * 1024;

/// Exit codes, one for every step that may refuse.
#[derive(Clone, Copy)]
enum Failure {
    Open = 2,
    TooLarge,
    Workspace,
    Controls,
    Frame,
}

/// Linux starts here.
#[unsafe(no_mangle)]
extern "C" fn main(_argument_count: c_int, _arguments: *const *const c_char) -> c_int {
    match play_package() {
        Ok(Checksum(checksum)) => {
            let mut line = [0_u8; 17];
            for (n, digit) in line[..16].iter_mut().enumerate() {
                *digit = b"0123456789abcdef"[(checksum >> (60 - 4 * n)) as usize & 15];
            }
            // SAFETY: `line` ends with a zero byte.
            unsafe { puts(line.as_ptr().cast()) };
            0
        }
        Err(failure) => failure as c_int,
    }
}

/// The fixed poses, in memory on the stack.
fn play_package() -> Result<Checksum, Failure> {
    let basis = Basis::open(&PACKAGE.0).map_err(|_| Failure::Open)?;
    let (vertex_count, component_count) = (basis.vertex_count(), basis.component_count());
    let (mut positions, mut normals) = ([[0.0; 3]; VERTEX_LIMIT], [[0.0; 3]; VERTEX_LIMIT]);
    let mut weights = [0.0; COMPONENT_LIMIT];
    if vertex_count > VERTEX_LIMIT || component_count > COMPONENT_LIMIT {
        return Err(Failure::TooLarge);
    }
    let mut memory = [0_u8; WORKSPACE_BYTES];
    // Four lanes, where the target has them: the bits are those of one.
    let kernels = [Kernels::Portable, Kernels::Scalar]
        .into_iter()
        .find(|kernels| kernels.run_here());
    let mut workspace = Workspace::with_kernels(&basis, &mut memory, kernels.unwrap_or(Kernels::Scalar))
        .map_err(|_| Failure::Workspace)?;
    let mut controls = Controls::new(&basis, &mut weights[..component_count]).map_err(|_| Failure::Controls)?;
    let (positions, normals) = (&mut positions[..vertex_count], &mut normals[..vertex_count]);
    play(&mut controls, &mut workspace, positions, normals).map_err(|_| Failure::Frame)
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: takes nothing and does not return.
    unsafe { abort() }
}
