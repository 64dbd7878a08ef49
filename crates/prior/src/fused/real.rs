//! Numbers that the fused path runs on: f32 for speed, f64 for finite differences.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

use gemm_common::Parallelism;

/// Defines a function that is compiled for the baseline, for AVX2 and for AVX-512, and picks at run time.
///
/// The bodies are element by element without fused multiply-add, so all give the same bits.
macro_rules! wide {
    ($(#[$meta:meta])* $vis:vis fn $name:ident $(<$t:ident>)? ($($arg:ident: $ty:ty),* $(,)?) $(-> $out:ty)? $body:block) => {
        $(#[$meta])*
        $vis fn $name $(<$t: $crate::fused::Real>)? ($($arg: $ty),*) $(-> $out)? {
            #[inline(always)]
            fn body $(<$t: $crate::fused::Real>)? ($($arg: $ty),*) $(-> $out)? $body
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn avx2 $(<$t: $crate::fused::Real>)? ($($arg: $ty),*) $(-> $out)? {
                    body($($arg),*)
                }
                #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
                fn avx512 $(<$t: $crate::fused::Real>)? ($($arg: $ty),*) $(-> $out)? {
                    body($($arg),*)
                }
                if std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512bw")
                    && std::arch::is_x86_feature_detected!("avx512dq")
                    && std::arch::is_x86_feature_detected!("avx512vl")
                {
                    #[expect(unsafe_code, reason = "the only condition, that the CPU has these units, was just tested")]
                    // SAFETY: the CPU has these units.
                    return unsafe { avx512($($arg),*) };
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    #[expect(unsafe_code, reason = "the only condition, that the CPU has AVX2, was just tested")]
                    // SAFETY: the CPU has AVX2.
                    return unsafe { avx2($($arg),*) };
                }
            }
            body($($arg),*)
        }
    };
}
pub(crate) use wide;

/// A product of matrices as the gemm crates have it: rows, columns and inner length; the target with its strides from column to column and from row to row, and whether
/// it is added to; left and right with theirs; factors of target and product; what is conjugated; threads.
pub(super) type Kernel<T> = unsafe fn(
    usize,
    usize,
    usize,
    *mut T,
    isize,
    isize,
    bool,
    *const T,
    isize,
    isize,
    *const T,
    isize,
    isize,
    T,
    T,
    bool,
    bool,
    bool,
    Parallelism,
);

/// f32 or f64.
///
/// The f32 functions are branch-free polynomials (a few units in the last place) that the compiler vectorises; they use no
/// fused multiply-add, so every x86 machine gets the same bits.
pub trait Real:
    Copy
    + Default
    + PartialOrd
    + Send
    + Sync
    + AddAssign
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + 'static
{
    /// 1.
    const ONE: Self;
    /// 0.
    const ZERO: Self;
    /// The product of matrices for this processor.
    fn kernel() -> Kernel<Self>;
    /// Nearest value.
    fn from_f64(value: f64) -> Self;
    /// Exact or nearest value.
    fn to_f64(self) -> f64;
    /// eˣ.
    fn exp(self) -> Self;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// 1/(1 + e⁻ˣ).
    #[inline(always)]
    fn sigmoid(self) -> Self {
        let half = Self::from_f64(0.5);
        half * (half * self).tanh() + half
    }
    /// The value or the nearer limit.
    fn limit(self, low: Self, high: Self) -> Self;
    /// 0 where the magnitude is below 1e-25, else the value. Subnormal factors make a processor's multiplication a hundred times slower;
    /// gradients so small change nothing.
    #[inline(always)]
    fn flush(self) -> Self {
        let tiny = Self::from_f64(1e-25);
        if self < tiny && -self < tiny { Self::ZERO } else { self }
    }
}

impl Real for f64 {
    const ONE: Self = 1.0;
    const ZERO: Self = 0.0;

    fn kernel() -> Kernel<Self> {
        gemm_f64::gemm::f64::get_gemm_fn()
    }

    fn from_f64(value: f64) -> Self {
        value
    }

    fn to_f64(self) -> f64 {
        self
    }

    fn exp(self) -> Self {
        f64::exp(self)
    }

    fn tanh(self) -> Self {
        f64::tanh(self)
    }

    fn limit(self, low: Self, high: Self) -> Self {
        self.clamp(low, high)
    }
}

impl Real for f32 {
    const ONE: Self = 1.0;
    const ZERO: Self = 0.0;

    fn kernel() -> Kernel<Self> {
        gemm_f32::gemm::f32::get_gemm_fn()
    }

    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        value as f32
    }

    #[inline(always)]
    fn to_f64(self) -> f64 {
        f64::from(self)
    }

    /// Cephes `expf`: e^x = 2^n e^r with |r| ≤ ln 2 / 2.
    #[inline(always)]
    fn exp(self) -> Self {
        // Adding 1.5·2²³ leaves the nearest integer n in the low bits of the mantissa.
        const MAGIC: f32 = 12_582_912.0;
        let x = self.limit(-87.0, 88.0);
        let shifted = x * std::f32::consts::LOG2_E + MAGIC;
        let n = shifted - MAGIC;
        let r = x - n * 0.693_359_4 + n * 2.121_944_4e-4;
        let polynomial = 1.987_569_1e-4;
        let polynomial = polynomial * r + 1.398_2e-3;
        let polynomial = polynomial * r + 8.333_452e-3;
        let polynomial = polynomial * r + 4.166_579_6e-2;
        let polynomial = polynomial * r + 1.666_666_6e-1;
        let polynomial = polynomial * r + 5e-1;
        let mantissa = polynomial * r * r + r + 1.0;
        mantissa * f32::from_bits((shifted.to_bits() << 23).wrapping_add(1.0_f32.to_bits()))
    }

    /// Rational minimax approximation (the coefficients of Eigen's `ptanh`).
    #[inline(always)]
    fn tanh(self) -> Self {
        let x = self.limit(-7.905_311, 7.905_311);
        let x2 = x * x;
        let p = -2.760_768_5e-16;
        let p = p * x2 + 2.000_188e-13;
        let p = p * x2 - 8.604_672e-11;
        let p = p * x2 + 5.122_297_2e-8;
        let p = p * x2 + 1.485_722_4e-5;
        let p = p * x2 + 6.372_619_4e-4;
        let p = p * x2 + 4.893_524_5e-3;
        let q = 1.198_258_4e-6;
        let q = q * x2 + 1.185_347_1e-4;
        let q = q * x2 + 2.268_434_7e-3;
        let q = q * x2 + 4.893_525e-3;
        x * p / q
    }

    #[inline(always)]
    fn limit(self, low: Self, high: Self) -> Self {
        self.max(low).min(high)
    }
}

/// A matrix in a slice: element (i, j) at `i · row_stride + j · column_stride`.
#[derive(Clone, Copy)]
pub(crate) struct Matrix<'a, T> {
    pub(crate) data: &'a [T],
    pub(crate) rows: usize,
    pub(crate) columns: usize,
    pub(crate) row_stride: usize,
    pub(crate) column_stride: usize,
}

impl<'a, T> Matrix<'a, T> {
    /// Row-major and dense.
    pub(crate) fn dense(data: &'a [T], rows: usize, columns: usize) -> Self {
        Self { data, rows, columns, row_stride: columns, column_stride: 1 }
    }

    /// `columns` columns of a row-major matrix whose rows are `row_stride` apart; `data` starts at the first of them.
    pub(crate) fn strided(data: &'a [T], rows: usize, columns: usize, row_stride: usize) -> Self {
        Self { data, rows, columns, row_stride, column_stride: 1 }
    }

    pub(crate) fn transposed(self) -> Self {
        let (rows, columns) = (self.columns, self.rows);
        Self { rows, columns, row_stride: self.column_stride, column_stride: self.row_stride, ..self }
    }

    fn reach(&self) -> usize {
        if self.rows == 0 || self.columns == 0 {
            return 0;
        }
        (self.rows - 1) * self.row_stride + (self.columns - 1) * self.column_stride + 1
    }
}

/// `target (+)= left · right`, where row i of `target` starts at `i · target_stride`.
///
/// Runs on one thread, so the result does not depend on the number of threads.
#[expect(unsafe_code, reason = "the gemm crates take raw pointers; the asserts above the call bound every access")]
pub(crate) fn product<T: Real>(
    target: &mut [T],
    target_stride: usize,
    accumulate: bool,
    left: Matrix<T>,
    right: Matrix<T>,
) {
    let (rows, columns, inner) = (left.rows, right.columns, left.columns);
    assert_eq!(inner, right.rows, "{rows}×{inner} times {}×{columns}", right.rows);
    if rows == 0 || columns == 0 || (inner == 0 && accumulate) {
        return;
    }
    assert!(
        columns <= target_stride || rows == 1,
        "rows of the target overlap: {columns} columns, stride {target_stride}"
    );
    assert!((rows - 1) * target_stride + columns <= target.len(), "target too short");
    assert!(left.reach() <= left.data.len() && right.reach() <= right.data.len(), "operand too short");
    // The kernels want columns of the target that are contiguous, so the transposed product is asked for: rightᵀ · leftᵀ.
    // SAFETY: all accesses lie within the slices by the asserts; `target` is borrowed mutably, so it aliases neither operand.
    unsafe {
        T::kernel()(
            columns,
            rows,
            inner,
            target.as_mut_ptr(),
            target_stride as isize,
            1,
            accumulate,
            right.data.as_ptr(),
            right.row_stride as isize,
            right.column_stride as isize,
            left.data.as_ptr(),
            left.row_stride as isize,
            left.column_stride as isize,
            T::ONE,
            T::ONE,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

wide! {
/// `target += Σ rows` of a row-major matrix whose rows are `stride` apart.
pub(crate) fn add_column_sums<T>(target: &mut [T], data: &[T], rows: usize, stride: usize) {
    let width = target.len();
    for row in data.chunks(stride).take(rows) {
        for (sum, &value) in target.iter_mut().zip(&row[..width]) {
            *sum += value;
        }
    }
}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fast_functions_agree_with_the_standard_library() {
        for i in -200_000..=200_000 {
            let x = i as f32 * 5e-4;
            let exact = f64::from(x.clamp(-87.0, 88.0)).exp();
            assert!((f64::from(Real::exp(x)) / exact - 1.0).abs() < 3e-7, "exp {x}");
            let exact = f64::from(x).tanh();
            assert!((f64::from(Real::tanh(x)) - exact).abs() <= 4e-7 * exact.abs(), "tanh {x}");
            let exact = 1.0 / (1.0 + (-f64::from(x)).exp());
            assert!((f64::from(Real::sigmoid(x)) - exact).abs() < 2e-7, "sigmoid {x}");
        }
    }

    wide! {
    fn widened(values: &mut [f32]) {
        for value in values {
            *value = (Real::exp(*value) * value.sigmoid() + Real::tanh(*value) * *value - 0.3).flush();
        }
    }
    }

    #[test]
    fn vector_units_change_no_bit() {
        let mut values: Vec<f32> = (-50_000..=50_000).map(|i| i as f32 * 7e-4).collect();
        let expected: Vec<u32> =
            values.iter().map(|&x| (Real::exp(x) * x.sigmoid() + Real::tanh(x) * x - 0.3).flush().to_bits()).collect();
        widened(&mut values);
        assert!(values.iter().map(|value| value.to_bits()).eq(expected));
    }

    #[test]
    fn products_of_views_follow_the_definition() {
        let left: Vec<f64> = (0..12).map(f64::from).collect();
        let right: Vec<f64> = (0..20).map(|i| f64::from(i * i)).collect();
        // Left 3×4 dense; right: columns 1..3 of a 4×5 matrix; target: columns 0..2 of rows 3 apart.
        let mut target = vec![1.0; 8];
        let view = Matrix::strided(&right[1..], 4, 2, 5);
        product(&mut target, 3, true, Matrix::dense(&left, 3, 4), view);
        let mut again = vec![0.0; 6];
        product(&mut again, 3, false, view.transposed(), Matrix::dense(&left, 3, 4).transposed());
        for i in 0..3 {
            for j in 0..2 {
                let exact: f64 = (0..4).map(|k| left[4 * i + k] * right[5 * k + 1 + j]).sum();
                assert_eq!(target[3 * i + j], 1.0 + exact);
                assert_eq!(again[3 * j + i], exact, "(AB)ᵀ = BᵀAᵀ");
            }
        }
        assert_eq!((target[2], target[5]), (1.0, 1.0), "what lies between the rows stays");
    }
}
