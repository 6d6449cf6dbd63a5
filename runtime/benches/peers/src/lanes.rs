//! Compiles a loop for the widest vectors of this machine: a peer must not lose because it was built for an old one.

/// Defines `$name`, which runs `$body` compiled for AVX-512, AVX2 or the baseline, whatever is there.
#[macro_export]
macro_rules! widest {
    ($(#[$meta:meta])* pub fn $name:ident($($argument:ident: $type:ty),* $(,)?) = $body:ident) => {
        $(#[$meta])*
        pub fn $name($($argument: $type),*) {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma")]
                fn widest($($argument: $type),*) {
                    $body($($argument),*);
                }
                #[target_feature(enable = "avx2,fma")]
                fn wide($($argument: $type),*) {
                    $body($($argument),*);
                }
                let avx2 = std::is_x86_feature_detected!("avx2") && std::is_x86_feature_detected!("fma");
                let avx512 = avx2
                    && std::is_x86_feature_detected!("avx512f")
                    && std::is_x86_feature_detected!("avx512bw")
                    && std::is_x86_feature_detected!("avx512dq")
                    && std::is_x86_feature_detected!("avx512vl");
                if avx512 {
                    // SAFETY: the features were found.
                    return unsafe { widest($($argument),*) };
                }
                if avx2 {
                    // SAFETY: the features were found.
                    return unsafe { wide($($argument),*) };
                }
            }
            $body($($argument),*);
        }
    };
}
