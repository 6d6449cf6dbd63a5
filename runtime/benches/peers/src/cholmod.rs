//! CHOLMOD's solve, in each of its modes; a benchmark quotes the fastest.

use core::ffi::{c_double, c_int, c_void};
use core::ptr::NonNull;

use crate::solvers::LowerTriangle;

unsafe extern "C" {
    fn sinew_cholmod_new(
        n: c_int,
        offsets: *const c_int,
        rows: *const c_int,
        values: *const c_double,
        mode: c_int,
    ) -> *mut c_void;
    fn sinew_cholmod_right(peer: *mut c_void) -> *mut c_double;
    fn sinew_cholmod_solve(peer: *mut c_void) -> *const c_double;
    fn sinew_cholmod_free(peer: *mut c_void);
}

/// How CHOLMOD stores the factor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mode {
    /// Column by column, `L D L^T`.
    SimplicialLdl = 0,
    /// Column by column, `L L^T`.
    SimplicialLl = 1,
    /// Dense blocks through BLAS.
    Supernodal = 2,
}

impl Mode {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::SimplicialLdl, Self::SimplicialLl, Self::Supernodal];
}

/// A factor and the memory of its solve.
#[derive(Debug)]
pub struct Cholmod {
    peer: NonNull<c_void>,
    vertex_count: usize,
}

impl Cholmod {
    /// Factors; none where CHOLMOD refuses.
    pub fn new(lower: &LowerTriangle, mode: Mode) -> Option<Self> {
        let vertex_count = lower.vertex_count();
        // SAFETY: the arrays are a valid lower triangle of `vertex_count` columns and are copied.
        let peer = unsafe {
            sinew_cholmod_new(
                vertex_count as c_int,
                lower.offsets.as_ptr(),
                lower.rows.as_ptr(),
                lower.values.as_ptr(),
                mode as c_int,
            )
        };
        NonNull::new(peer).map(|peer| Self { peer, vertex_count })
    }

    /// The right-hand side, to be filled. Shape: `[3][V]`.
    pub fn right(&mut self) -> &mut [f64] {
        // SAFETY: the peer owns three columns of `vertex_count`, and is borrowed mutably.
        unsafe { core::slice::from_raw_parts_mut(sinew_cholmod_right(self.peer.as_ptr()), 3 * self.vertex_count) }
    }

    /// Solves for the right-hand side. Shape: `[3][V]`; none where CHOLMOD refuses.
    pub fn solve(&mut self) -> Option<&[f64]> {
        // SAFETY: the solution lives in the peer until the next call, which needs `&mut self`.
        unsafe {
            let solution = sinew_cholmod_solve(self.peer.as_ptr());
            (!solution.is_null()).then(|| core::slice::from_raw_parts(solution, 3 * self.vertex_count))
        }
    }
}

impl Drop for Cholmod {
    fn drop(&mut self) {
        // SAFETY: made by `sinew_cholmod_new`, freed once.
        unsafe { sinew_cholmod_free(self.peer.as_ptr()) }
    }
}
