//! The kernels: free functions over plain slices, without a basis, a workspace or a check of lengths.
//!
//! [`scalar`] is the reference; every other kernel equals it within a named tolerance. Which ones run is decided once, when
//! a workspace is made: by what the processor says on x86-64, at compile time elsewhere.

/// Hands every kernel that is written for any lanes to a macro: one list, for each instruction set and for the choice
/// between them. Stands before the modules that use it.
macro_rules! generic_kernels {
    ($each:ident) => {
        $each!(rest_activations(blocks: &mut [BlockRest]));
        $each!(decode(decoder: &Decoder<'_>, gradients: &mut [Gradient]));
        $each!(features(decoder: &Decoder<'_>, g: usize, features: &mut Group<f32>));
        $each!(gradients(scales: FeatureScales, features: &Group<f32>, gradients: &mut [Gradient]));
        $each!(held(decoder: &Decoder<'_>, pulls: &[Pull], features: &mut [Group<f32>], sums: &mut [HeldSums]));
        $each!(derivatives(decoder: &Decoder<'_>, pulls: &[Pull], features: &[Group<f32>], sums: &mut [HeldSums]));
        $each!(tangents(decoder: &Decoder<'_>, k: usize, scale: f32, gradients: &mut [Gradient]));
    };
}

pub(crate) mod adjoint;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(crate) mod avx512;
pub(crate) mod decode;
mod functions;
pub(crate) mod lanes;
pub(crate) mod scalar;

use adjoint::{HeldSums, Pull};
#[cfg(test)]
mod poisson_tests;
#[cfg(test)]
mod skin_tests;

use decode::{BlockRest, Decoder, FeatureScales, Group};
use lanes::{Gradient, One};
use scalar::surface::{self, Around};

/// A kernel of decode, by the set that it belongs to.
macro_rules! dispatch {
    ($name:ident ( $($argument:ident : $type:ty),* )) => {
        #[doc = concat!("See [`decode::", stringify!($name), "`].")]
        pub(crate) fn $name(self, $($argument: $type),*) {
            match self {
                #[cfg(target_arch = "x86_64")]
                Self::Avx512 => avx512::$name($($argument),*),
                #[cfg(target_arch = "x86_64")]
                Self::Avx2 => avx2::$name($($argument),*),
                _ => decode::$name::<One>($($argument),*),
            }
        }
    };
}

impl Kernels {
    /// See [`surface::normals`].
    pub(crate) fn normals(self, around: &Around<'_>, posed: &[[f32; 4]], normals: &mut [[f32; 3]]) {
        match self {
            #[cfg(target_arch = "x86_64")]
            // A vertex has four numbers: sixteen lanes were slower than eight.
            Self::Avx512 | Self::Avx2 => avx2::normals(around, posed, normals),
            _ => surface::normals(around, posed, normals),
        }
    }

    generic_kernels!(dispatch);
}

/// A set of kernels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Kernels {
    /// The reference: plain Rust, the same bits on every machine.
    Scalar,
    /// Eight lanes with fused multiply-add: x86-64 with AVX2, FMA and F16C.
    Avx2,
    /// Sixteen lanes: x86-64 with AVX-512 F, BW, DQ and VL besides.
    Avx512,
}

#[cfg(target_arch = "x86_64")]
cpufeatures::new!(avx2_present, "avx2", "fma");
#[cfg(target_arch = "x86_64")]
cpufeatures::new!(
    avx512_present,
    "avx2",
    "fma",
    "avx512f",
    "avx512bw",
    "avx512dq",
    "avx512vl"
);

/// Conversion of halves, which `cpufeatures` does not know. Asked after AVX, so the registers are there.
#[cfg(target_arch = "x86_64")]
fn f16c_present() -> bool {
    use core::sync::atomic::{AtomicU8, Ordering};
    /// Of ECX in leaf 1.
    const F16C: u32 = 1 << 29;
    const UNKNOWN: u8 = 2;
    // Kept: a hypervisor may take longer over this instruction than a kernel takes over its work.
    static PRESENT: AtomicU8 = AtomicU8::new(UNKNOWN);
    match PRESENT.load(Ordering::Relaxed) {
        UNKNOWN => {
            let present = core::arch::x86_64::__cpuid(1).ecx & F16C != 0;
            PRESENT.store(u8::from(present), Ordering::Relaxed);
            present
        }
        present => present == 1,
    }
}

impl Kernels {
    /// The widest that run here.
    pub fn detect() -> Self {
        [Self::Avx512, Self::Avx2]
            .into_iter()
            .find(|kernels| kernels.run_here())
            .unwrap_or(Self::Scalar)
    }

    /// Whether this machine has the instructions.
    pub fn run_here(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => avx2_present::get() && f16c_present(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => avx512_present::get() && f16c_present(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }
}

#[cfg(test)]
mod tests;
