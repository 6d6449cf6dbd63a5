//! The kernels: free functions over plain slices, without a basis, a workspace or a check of lengths.
//!
//! [`generic`] holds what is written once and the types of every step, [`all`] the reference: one lane of plain Rust, and
//! `four` the same operations in the same order on four lanes, with the same bits. Every other kernel equals them within a
//! named tolerance. Which ones run is decided once, when a workspace is made: by what the processor says on x86-64, at
//! compile time elsewhere.

/// Hands every kernel that is written for any lanes to a macro: one list, for each instruction set and for the choice
/// between them. Stands before the modules that use it.
macro_rules! generic_kernels {
    ($each:ident) => {
        $each!(decode::rest_activations(blocks: &mut [BlockRest]));
        $each!(decode::decode(decoder: &Decoder<'_>, touched: &[u8], gradients: &mut [Gradient]));
        $each!(decode::features(decoder: &Decoder<'_>, g: usize, features: &mut Group<f32>));
        $each!(decode::gradients(scales: FeatureScales, features: &Group<f32>, gradients: &mut [Gradient]));
        $each!(bones::turn(bones: &BonesView<'_>, gradients: &[Gradient], turned: &mut [Gradient]));
        $each!(bones::displace(bones: &BonesView<'_>, gradients: &[Gradient], weights: &[f32], displaced: &mut [BoneLanes]));
        $each!(decode::tangents(decoder: &Decoder<'_>, k: usize, gradients: &mut [Gradient]));
        $each!(adjoint::held(decoder: &Decoder<'_>, pulls: &[Pull], features: &mut [Group<f32>], sums: &mut [HeldSums]));
        $each!(adjoint::derivatives(decoder: &Decoder<'_>, pulls: &[Pull], features: &[Group<f32>], sums: &mut [HeldSums]));
    };
}

pub(crate) mod all;
// Instructions that every processor of the target has.
#[cfg(any(
    target_arch = "x86_64",
    target_arch = "aarch64",
    all(target_arch = "wasm32", target_feature = "simd128")
))]
mod four;
pub(crate) mod generic;
// Never chosen there; see `Kernels::run_here`.
#[cfg(not(any(
    target_arch = "x86_64",
    target_arch = "aarch64",
    all(target_arch = "wasm32", target_feature = "simd128")
)))]
use all as four;
#[cfg(target_arch = "x86_64")]
mod x86_64;

use core::ops::Range;

use sinew_formats::package::{BonesView, Index};

use generic::adjoint::{HeldSums, Pull};
use generic::bones::BoneLanes;
use generic::decode::{BlockRest, Decoder, FeatureScales, Group};
use generic::lanes::Gradient;
use generic::normals::Around;
use generic::solve::{Factor, Quad, Rings, Xyz0};
#[cfg(target_arch = "x86_64")]
use x86_64::{avx2, avx512};

/// A set of kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Kernels {
    /// The reference: plain Rust, the same bits on every machine.
    Scalar,
    /// Four lanes with the reference's bits: SSE2 of every x86-64, NEON of every aarch64, WebAssembly with simd128.
    Portable,
    /// Eight lanes with fused multiply-add: x86-64 with AVX2 and FMA.
    Avx2,
    /// Sixteen lanes: x86-64 with AVX-512 F, BW, DQ and VL besides.
    Avx512,
}

/// A kernel written for any lanes, by the set that it belongs to.
macro_rules! dispatch {
    ($module:ident :: $name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`", stringify!($module), "::", stringify!($name), "`].")]
        pub(crate) fn $name(self, $($argument: $type),*) {
            match self {
                #[cfg(target_arch = "x86_64")]
                Self::Avx512 => avx512::$name($($argument),*),
                #[cfg(target_arch = "x86_64")]
                Self::Avx2 => avx2::$name($($argument),*),
                Self::Portable => four::$name($($argument),*),
                _ => all::$name($($argument),*),
            }
        }
    };
}

impl Kernels {
    generic_kernels!(dispatch);

    /// See [`generic::solve::right_hand_side`].
    pub(crate) fn right_hand_side<I: Index>(
        self,
        rings: &Rings<'_, I>,
        rest: &[[f32; 3]],
        gradients: &[Gradient],
        slots: Range<usize>,
        b: &mut [Quad],
    ) {
        match self {
            #[cfg(target_arch = "x86_64")]
            // Rows have four lanes: sixteen were no faster.
            Self::Avx512 | Self::Avx2 => avx2::solve::right_hand_side(rings, rest, gradients, slots, b),
            Self::Portable => four::right_hand_side(rings, rest, gradients, slots, b),
            _ => all::right_hand_side(rings, rest, gradients, slots, b),
        }
    }

    /// See [`generic::solve::substitute`].
    pub(crate) fn substitute<I: Index>(self, factor: &Factor<'_, I>, x: &mut [Quad]) {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512::solve::substitute(factor, x),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2::solve::substitute(factor, x),
            Self::Portable => four::substitute(factor, x),
            _ => all::substitute(factor, x),
        }
    }

    /// See [`generic::normals::normals`].
    pub(crate) fn normals<I: Index>(self, around: &Around<'_, I>, posed: &[Xyz0], normals: &mut [[f32; 3]]) {
        match self {
            #[cfg(target_arch = "x86_64")]
            // A vertex has four numbers: sixteen lanes were slower than eight.
            Self::Avx512 | Self::Avx2 => avx2::normals(around, posed, normals),
            Self::Portable => four::normals(around, posed, normals),
            _ => all::normals(around, posed, normals),
        }
    }

    /// The widest that run here.
    pub fn detect() -> Self {
        [Self::Avx512, Self::Avx2, Self::Portable]
            .into_iter()
            .find(|kernels| kernels.run_here())
            .unwrap_or(Self::Scalar)
    }

    /// Whether this machine has the instructions.
    pub fn run_here(self) -> bool {
        match self {
            Self::Scalar => true,
            Self::Portable => cfg!(any(
                target_arch = "x86_64",
                target_arch = "aarch64",
                all(target_arch = "wasm32", target_feature = "simd128")
            )),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86_64::has_avx2(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => x86_64::has_avx512(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
