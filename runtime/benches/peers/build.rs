//! Compiles the door to CHOLMOD where the feature asks for it; nothing otherwise.

fn main() {
    println!("cargo::rerun-if-changed=src/cholmod.c");
    #[cfg(feature = "cholmod")]
    {
        cc::Build::new()
            .file("src/cholmod.c")
            .include("/usr/include/suitesparse")
            .flag_if_supported("-std=c99")
            .compile("sinew_cholmod");
        println!("cargo::rustc-link-lib=cholmod");
    }
}
