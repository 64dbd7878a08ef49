//! Readings at a moment.

use crate::mapping::Sampling;
use crate::rigid::slerp;
use crate::store::Stream;

/// Moments that are closer are one: rounding of stamps.
const SAME_SECS: f64 = 1e-6;

/// How a stream is read between its readings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sampler {
    pub(crate) how: Sampling,
    pub(crate) near_secs: f64,
    /// Where four numbers are a rotation.
    pub(crate) rotation: Option<usize>,
}

impl Sampler {
    /// The numbers at a moment; NaN where nothing was read near enough.
    pub(crate) fn at(&self, stream: &Stream, time: f64, out: &mut [f64]) {
        out.fill(f64::NAN);
        let near = self.near_secs + SAME_SECS;
        let after = stream.times.partition_point(|t| *t < time - SAME_SECS);
        let later = stream.times.get(after).map(|t| (after, t - time));
        if let Some((index, gap)) = later
            && gap.abs() <= SAME_SECS
        {
            out.copy_from_slice(stream.get(index));
            return;
        }
        let earlier = after.checked_sub(1).map(|index| (index, time - stream.times[index]));
        let chosen = match (self.how, earlier, later) {
            (Sampling::Hold, Some(before), _) => before,
            (Sampling::Nearest | Sampling::Rows, Some(before), Some(next)) => {
                if before.1 <= next.1 {
                    before
                } else {
                    next
                }
            }
            (Sampling::Nearest | Sampling::Rows, Some(one), None)
            | (Sampling::Nearest | Sampling::Rows, None, Some(one)) => one,
            (Sampling::Linear, Some((before, gap)), Some((next, rest))) if gap <= near && rest <= near => {
                self.between(stream, before, next, gap / (gap + rest), out);
                return;
            }
            _ => return,
        };
        if chosen.1 <= near {
            out.copy_from_slice(stream.get(chosen.0));
        }
    }

    fn between(&self, stream: &Stream, before: usize, next: usize, share: f64, out: &mut [f64]) {
        let (a, b) = (stream.get(before), stream.get(next));
        for (i, value) in out.iter_mut().enumerate() {
            *value = a[i] + share * (b[i] - a[i]);
        }
        if let Some(i) = self.rotation {
            let four = |v: &[f64]| [v[i], v[i + 1], v[i + 2], v[i + 3]];
            out[i..i + 4].copy_from_slice(&slerp(four(a), four(b), share));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(how: Sampling, time: f64) -> Vec<f64> {
        let stream = Stream { width: 1, times: vec![0.0, 1.0, 5.0], values: vec![10.0, 20.0, 60.0], replaced: 0 };
        let mut out = [0.0];
        Sampler { how, near_secs: 1.0, rotation: None }.at(&stream, time, &mut out);
        out.to_vec()
    }

    #[test]
    fn each_way_reads_what_it_says() {
        assert_eq!(at(Sampling::Linear, 0.25), [12.5]);
        assert_eq!(at(Sampling::Hold, 0.75), [10.0]);
        assert_eq!(at(Sampling::Nearest, 0.75), [20.0]);
        assert_eq!(at(Sampling::Linear, 1.0 + 1e-9), [20.0]);
    }

    #[test]
    fn nothing_is_made_up_far_from_readings() {
        for how in [Sampling::Linear, Sampling::Hold, Sampling::Nearest] {
            assert!(at(how, 3.0)[0].is_nan(), "{how:?}");
        }
        assert!(at(Sampling::Linear, 1.5)[0].is_nan(), "the next reading is 3.5 s away");
        assert!(at(Sampling::Linear, -0.5)[0].is_nan() && at(Sampling::Linear, 5.5)[0].is_nan());
        assert_eq!(at(Sampling::Hold, 5.5), [60.0]);
    }

    #[test]
    fn a_missing_component_stays_missing_and_alone() {
        let stream = Stream { width: 2, times: vec![0.0, 1.0], values: vec![1.0, f64::NAN, 3.0, 4.0], replaced: 0 };
        let mut out = [0.0; 2];
        Sampler { how: Sampling::Linear, near_secs: 1.0, rotation: None }.at(&stream, 0.5, &mut out);
        assert!(out[0] == 2.0 && out[1].is_nan());
    }
}
