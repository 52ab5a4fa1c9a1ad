//! The kernels compiled for wide registers, where the processor has them.
//!
//! A function with a target feature may be called where that was asked for at run time: this is all that is unsafe here.

use super::{gemm_body, gemv_body, gemv_transposed_body, inverse_root_body, potrf_body, Left, Mode, Right};

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn has_avx2() -> bool {
    // the answer is kept by the standard library
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

macro_rules! kernel {
    ($name:ident, $body:ident, ($($arg:ident: $t:ty),*) $(-> $r:ty)?) => {
        #[inline]
        pub(super) fn $name($($arg: $t),*) $(-> $r)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2,fma")]
                fn wide($($arg: $t),*) $(-> $r)? {
                    $body::<true>($($arg),*)
                }
                if has_avx2() {
                    // SAFETY: the processor has the features `wide` is compiled for
                    return unsafe { wide($($arg),*) };
                }
            }
            $body::<false>($($arg),*)
        }
    };
}

kernel!(gemm, gemm_body, (sizes: [usize; 3], a: Left, b: Right, c: &mut [f64], ldc: usize, mode: Mode));
kernel!(gemv, gemv_body, (m: usize, n: usize, a: Left, x: &[f64], y: &mut [f64]));
kernel!(gemv_transposed, gemv_transposed_body, (m: usize, n: usize, a: Left, x: &[f64], y: &mut [f64]));
kernel!(potrf, potrf_body, (n: usize, a: &mut [f64], ld: usize) -> bool);
kernel!(inverse_root, inverse_root_body, (n: usize, l: &[f64], ld: usize, root: &mut [f64], ld_root: usize));

/// Runs `body` compiled for wide registers. What it calls must be `#[inline(always)]` to profit.
#[inline(always)]
pub fn wide<R>(body: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,fma")]
        fn inner<R>(body: impl FnOnce() -> R) -> R {
            body()
        }
        if has_avx2() {
            // SAFETY: the processor has the features `inner` is compiled for
            return unsafe { inner(body) };
        }
    }
    body()
}

/// What [`widest`] runs. What it calls must be `#[inline(always)]` to profit.
pub trait Kernel {
    /// With sums that are rounded once together with a product, if `FUSED`.
    fn run<const FUSED: bool>(self);
}

/// Runs a kernel compiled for wide registers.
#[inline(always)]
pub fn widest(kernel: impl Kernel) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,fma")]
        fn inner(kernel: impl Kernel) {
            kernel.run::<true>();
        }
        if has_avx2() {
            // SAFETY: the processor has the features `inner` is compiled for
            return unsafe { inner(kernel) };
        }
    }
    kernel.run::<false>();
}
