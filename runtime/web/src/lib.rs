//! Sinew's runtime in a browser or in node: plain functions over linear memory, without std, allocator or generated
//! glue. `sinew.js` beside this crate is the JavaScript side.
//!
//! Path of data: package bytes at [`sinew_reserve`]'s address -> [`sinew_open`] -> [`sinew_set_control`] or [`sinew_drag`] ->
//! [`sinew_frame`] -> positions and normals at fixed addresses, ready for a GPU upload. A module instance plays one
//! package; a page that wants two makes two instances. Every function may be called at any time, in any order, with any
//! number: what makes no sense is refused with a status and a sentence in [`sinew_message`].
#![cfg(target_arch = "wasm32")]
#![no_std]

mod memory;
mod message;
mod player;

use core::panic::PanicInfo;

use sinew_runtime::FrameOutcome;

use player::{Fault, Player, with_player};

/// The call did what it says.
pub const OK: i32 = 0;
/// The controls were those of the frame before: positions and normals are still right, and nothing was computed.
pub const UNCHANGED: i32 = 1;
/// Refused; [`sinew_message`] says why.
pub const REFUSED: i32 = -1;

fn status(outcome: Result<i32, Fault>) -> i32 {
    outcome.unwrap_or_else(|fault| {
        message::set(&fault);
        REFUSED
    })
}

/// An answer from the opened package, or `otherwise` and a message.
fn ask<T>(otherwise: T, question: impl FnOnce(&mut Player) -> Result<T, Fault>) -> T {
    with_player(question).unwrap_or_else(|fault| {
        message::set(&fault);
        otherwise
    })
}

/// Makes room for a package and forgets the opened one, with every address handed out for it. Returns where the bytes
/// go, or 0 if memory cannot grow that far. The memory may move in JavaScript's eyes: take new views of its buffer.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_reserve(package_bytes: usize) -> usize {
    player::reserve(package_bytes).unwrap_or_else(|fault| {
        message::set(&fault);
        0
    })
}

/// Opens the reserved bytes as a baked package and sets it at rest; positions and normals then hold the rest shape.
/// Returns [`OK`] or [`REFUSED`].
#[unsafe(no_mangle)]
pub extern "C" fn sinew_open() -> i32 {
    status(player::open().map(|()| OK))
}

/// Why the last call that refused did so: address of UTF-8 text.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_message() -> *const u8 {
    message::bytes().as_ptr()
}

/// Length of [`sinew_message`]'s text in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_message_bytes() -> usize {
    message::bytes().len()
}

/// V, or 0 when no package is open.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_vertex_count() -> usize {
    ask(0, |player| Ok(player.basis.vertex_count()))
}

/// F, or 0 when no package is open.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_face_count() -> usize {
    ask(0, |player| Ok(player.basis.face_count()))
}

/// K, or 0 when no package is open.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_component_count() -> usize {
    ask(0, |player| Ok(player.basis.component_count()))
}

/// Address of the triangles, u32 `[F][3]`, counter-clockwise; 0 when no package is open.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_faces() -> usize {
    ask(0, |player| Ok(player.faces.as_ptr().addr()))
}

/// Address of the positions, f32 `[V][3]`, units of the source; 0 when no package is open.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_positions() -> usize {
    ask(0, |player| Ok(player.positions.as_ptr().addr()))
}

/// Address of the unit vertex normals, f32 `[V][3]`; 0 when no package is open.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_normals() -> usize {
    ask(0, |player| Ok(player.normals.as_ptr().addr()))
}

/// Address of component `k`'s name, UTF-8; 0 when there is none.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_component_name(k: usize) -> usize {
    ask(0, |player| Ok(player.component(k)?.name.as_ptr().addr()))
}

/// Length of component `k`'s name in bytes; 0 when there is none.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_component_name_bytes(k: usize) -> usize {
    ask(0, |player| Ok(player.component(k)?.name.len()))
}

/// The component above component `k`; -1 for a coarse one and when there is no component `k`.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_component_parent(k: usize) -> i32 {
    ask(-1, |player| {
        let parent = player.component(k)?.parent;
        Ok(parent.map_or(-1, |parent| parent as i32))
    })
}

/// Lower stop of control `k`, at most 0; NaN when there is none.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_component_minimum(k: usize) -> f32 {
    ask(f32::NAN, |player| Ok(player.component(k)?.minimum))
}

/// Upper stop of control `k`, at least 0; NaN when there is none.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_component_maximum(k: usize) -> f32 {
    ask(f32::NAN, |player| Ok(player.component(k)?.maximum))
}

/// Sets control `k`, clamped between its stops. Returns the weight it took, or NaN when `k` or the weight was refused;
/// then nothing changed.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_set_control(k: usize, weight: f32) -> f32 {
    ask(f32::NAN, |player| Ok(player.controls.set(k, weight)?))
}

/// Sets control `k` by the share of its way from the lower stop, 0, to the upper one, 1. Returns like
/// [`sinew_set_control`].
#[unsafe(no_mangle)]
pub extern "C" fn sinew_set_share(k: usize, share: f32) -> f32 {
    ask(f32::NAN, |player| Ok(player.controls.set_share(k, share)?))
}

/// The weight of control `k`; NaN when there is none.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_weight(k: usize) -> f32 {
    ask(f32::NAN, |player| {
        player.component(k)?;
        Ok(player.controls.weights()[k])
    })
}

/// Takes hold of a vertex, by its source index, where the last frame has it. Eight at most. Returns [`OK`] or [`REFUSED`].
#[unsafe(no_mangle)]
pub extern "C" fn sinew_hold(vertex: usize) -> i32 {
    status(with_player(|player| player.hold(vertex).map(|()| OK)))
}

/// Lets go of a held vertex. Returns [`OK`] or [`REFUSED`].
#[unsafe(no_mangle)]
pub extern "C" fn sinew_let_go(vertex: usize) -> i32 {
    status(with_player(|player| player.let_go(vertex).map(|()| OK)))
}

/// Moves the controls so that a held vertex comes to a point, units of the source, and the other held ones stay, as well as the
/// components allow; run [`sinew_frame`] afterwards. Returns [`OK`] or [`REFUSED`]; then nothing moved.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_drag(vertex: usize, x: f32, y: f32, z: f32) -> i32 {
    status(with_player(|player| player.drag(vertex, [x, y, z]).map(|()| OK)))
}

/// All controls to rest. Returns [`OK`] or [`REFUSED`].
#[unsafe(no_mangle)]
pub extern "C" fn sinew_reset() -> i32 {
    status(with_player(|player| {
        player.controls.reset();
        Ok(OK)
    }))
}

/// Positions and normals for the controls as they stand. Returns [`OK`], [`UNCHANGED`] or [`REFUSED`]; when the weights
/// overflow, the outputs hold the rest shape.
#[unsafe(no_mangle)]
pub extern "C" fn sinew_frame() -> i32 {
    status(with_player(|player| {
        Ok(match player.frame()? {
            FrameOutcome::Solved => OK,
            FrameOutcome::Unchanged => UNCHANGED,
        })
    }))
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    core::arch::wasm32::unreachable()
}
