//! The instruction sets of x86-64, chosen when a workspace is made by what the processor says.

pub(crate) mod avx2;
pub(crate) mod avx512;

cpufeatures::new!(avx2_present, "avx2", "fma");
cpufeatures::new!(
    avx512_present,
    "avx2",
    "fma",
    "avx512f",
    "avx512bw",
    "avx512dq",
    "avx512vl"
);

/// Whether this machine has what [`avx2`] is compiled for.
pub(super) fn has_avx2() -> bool {
    avx2_present::get()
}

/// Whether this machine has what [`avx512`] is compiled for.
pub(super) fn has_avx512() -> bool {
    avx512_present::get()
}
