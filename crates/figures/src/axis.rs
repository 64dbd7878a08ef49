//! From values to distances, and the ticks between.

use crate::panel::{Axis, Scale};

/// Larger numbers count as not finite, so that differences stay finite.
const LARGEST: f64 = 1e300;

/// Smaller ones are zero, so that quotients stay finite too.
pub(crate) const SMALLEST: f64 = 1e-290;

/// Whether ticks between two numbers can differ: not where rounding is as large as their difference.
pub(crate) fn distinct(low: f64, high: f64) -> bool {
    high - low > (1e-9 * low.abs().max(high.abs())).max(SMALLEST)
}

/// Whether a number can be drawn.
pub(crate) fn drawable(value: f64) -> bool {
    value.abs() < LARGEST
}

/// An axis with its limits found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ruler {
    pub(crate) low: f64,
    pub(crate) high: f64,
    scale: Scale,
    /// All values are whole, so ticks between would mislead.
    whole: bool,
    /// Without data or limits: no ticks.
    pub(crate) empty: bool,
}

/// A value with its label; an empty label for a light line between.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) value: f64,
    pub(crate) label: String,
}

impl Ruler {
    /// Around `values`, with `margin` (a share of their range) on both sides, unless the axis has limits.
    pub(crate) fn around(axis: &Axis, values: impl Iterator<Item = f64>, margin: f64) -> Self {
        let log = axis.scale == Scale::Log;
        let (mut low, mut high, mut whole) = (f64::INFINITY, f64::NEG_INFINITY, !log);
        for value in values.filter(|v| drawable(*v) && (!log || *v > SMALLEST)) {
            low = low.min(value);
            high = high.max(value);
            whole &= value.fract() == 0.0;
        }
        let base = Self { low: 0.0, high: 1.0, scale: axis.scale, whole, empty: false };
        if let Some((low, high)) = axis.limits {
            return Self { low, high, whole: whole && high - low >= 3.0, ..base };
        }
        if low > high {
            return Self { low: if log { 0.1 } else { 0.0 }, empty: true, ..base };
        }
        if log {
            let range = high.ln() - low.ln();
            let pad = if range > 1e-9 { range * margin } else { 0.5 }.exp();
            return Self { low: (low / pad).max(SMALLEST), high: (high * pad).min(LARGEST), ..base };
        }
        let range = high - low;
        let base = Self { whole: whole && range >= 3.0, ..base };
        let pad = if distinct(low, high) { range * margin } else { (0.05 * high.abs()).max(0.5) };
        Self { low: low - pad, high: high + pad, ..base }
    }

    /// From zero up, unless the axis has limits or values are below.
    pub(crate) fn from_zero(axis: &Axis, values: impl Iterator<Item = f64>) -> Self {
        let found = Self::around(axis, values.chain([0.0]), 0.06);
        let negative = found.low < 0.0 && found.low < -0.07 * (found.high - found.low);
        match axis.limits {
            None if axis.scale == Scale::Linear && !negative => Self { low: 0.0, ..found },
            _ => found,
        }
    }

    /// 0 at the low end, 1 at the high end, outside beyond; `None` for what cannot be drawn.
    pub(crate) fn share(&self, value: f64) -> Option<f64> {
        if !drawable(value) {
            return None;
        }
        let share = match self.scale {
            Scale::Linear => (value - self.low) / (self.high - self.low),
            Scale::Log if value >= SMALLEST => (value.ln() - self.low.ln()) / (self.high.ln() - self.low.ln()),
            Scale::Log => return None,
        };
        // Far outside is far enough: pixels stay small integers.
        Some(share.clamp(-1e4, 1e4))
    }

    /// About `count` ticks at round values.
    pub(crate) fn ticks(&self, count: usize) -> Vec<Tick> {
        if self.empty {
            return Vec::new();
        }
        let count = count.max(2);
        let mut ticks = match self.scale {
            Scale::Linear => self.linear(count),
            Scale::Log => self.log(count),
        };
        ticks.retain(|t| drawable(t.value));
        ticks
    }

    fn linear(&self, count: usize) -> Vec<Tick> {
        let rough = (self.high - self.low) / count as f64;
        let power = 10_f64.powf(rough.log10().floor());
        let nice = [1.0, 2.0, 5.0, 10.0].into_iter().find(|n| n * power >= rough * (1.0 - 1e-9)).unwrap_or(10.0);
        let mut step = nice * power;
        if self.whole {
            step = step.max(1.0);
        }
        let first = (self.low / step - 1e-9).ceil();
        let values: Vec<f64> =
            (0..=2 * count).map(|i| (first + i as f64) * step).take_while(|v| *v <= self.high + 1e-9 * step).collect();
        let labels = labels(&values, step);
        values.into_iter().zip(labels).map(|(value, label)| Tick { value, label }).collect()
    }

    fn log(&self, count: usize) -> Vec<Tick> {
        let (low, high) = (self.low.log10(), self.high.log10());
        let first = (low - 1e-9).ceil() as i32;
        let last = (high + 1e-9).floor() as i32;
        let decades = last - first + 1;
        if decades < 2 {
            return self.within_decade(count);
        }
        let stride = (decades as usize).div_ceil(count).max(1) as i32;
        // Two and five times as well where there is room.
        let named = |n: i32| decades == 2 && count >= 5 && (n == 2 || n == 5);
        let mut ticks = Vec::new();
        for exponent in first - 1..=last {
            if exponent.rem_euclid(stride) == 0 && exponent >= first {
                ticks.push(Tick { value: 10_f64.powi(exponent), label: power_of_ten(exponent) });
            }
            if stride == 1 && decades <= 4 {
                let between = (2..10).map(|n| (n, f64::from(n) * 10_f64.powi(exponent)));
                for (n, value) in between.filter(|(_, v)| (self.low..=self.high).contains(v)) {
                    let labels = if named(n) { labels(&[value], 10_f64.powi(exponent)) } else { Vec::new() };
                    ticks.push(Tick { value, label: labels.concat() });
                }
            }
        }
        ticks
    }

    /// 1, 2 and 5 times powers of ten, or even steps where fewer than two of those are inside.
    fn within_decade(&self, count: usize) -> Vec<Tick> {
        let first = self.low.log10().floor() as i32;
        let values: Vec<(f64, i32)> = (first..=first + 2)
            .flat_map(|e| [1.0, 2.0, 5.0].map(|n| (n * 10_f64.powi(e), e)))
            .filter(|(v, _)| (self.low..=self.high).contains(v))
            .collect();
        if values.len() < 2 {
            return self.linear(count);
        }
        let label =
            |(value, exponent): (f64, i32)| Tick { value, label: labels(&[value], 10_f64.powi(exponent)).concat() };
        values.into_iter().map(label).collect()
    }
}

/// Labels with as many digits as `step` needs.
fn labels(values: &[f64], step: f64) -> Vec<String> {
    let largest = values.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
    let step_exponent = (step.log10() + 1e-9).floor() as i32;
    let exponent = if largest > 0.0 { (largest.log10() + 1e-9).floor() as i32 } else { 0 };
    if exponent < 6 && step_exponent > -5 {
        return values.iter().map(|v| number(*v, (-step_exponent).max(0) as usize)).collect();
    }
    let digits = (exponent - step_exponent).clamp(0, 9) as usize;
    let label = |v: &f64| {
        let mantissa = number(v / 10_f64.powi(exponent), digits);
        if v.abs() < step * 1e-6 { "0".to_owned() } else { format!("{mantissa}×10{}", superscript(exponent)) }
    };
    values.iter().map(label).collect()
}

/// With a true minus, no negative zero, and thin spaces from ten thousand on.
pub(crate) fn number(value: f64, digits: usize) -> String {
    let text = format!("{:.digits$}", value.abs());
    let (whole, fraction) = text.split_once('.').map_or((text.as_str(), ""), |(w, f)| (w, f));
    let mut out = String::new();
    if value < 0.0 && text.chars().any(|c| c.is_ascii_digit() && c != '0') {
        out.push('−');
    }
    for (i, digit) in whole.chars().enumerate() {
        if i > 0 && whole.len() > 4 && (whole.len() - i).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(digit);
    }
    if !fraction.is_empty() {
        out.push('.');
        out.push_str(fraction);
    }
    out
}

fn power_of_ten(exponent: i32) -> String {
    match exponent {
        -3..=0 => number(10_f64.powi(exponent), (-exponent) as usize),
        1..=4 => number(10_f64.powi(exponent), 0),
        _ => format!("10{}", superscript(exponent)),
    }
}

fn superscript(exponent: i32) -> String {
    let raised = |c: char| match c {
        '-' => '⁻',
        c => c.to_digit(10).map_or(c, |d| ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'][d as usize]),
    };
    exponent.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(axis: &Axis, values: &[f64], count: usize) -> Vec<String> {
        let ticks = Ruler::around(axis, values.iter().copied(), 0.0).ticks(count);
        ticks.into_iter().map(|t| t.label).filter(|l| !l.is_empty()).collect()
    }

    #[test]
    fn ticks_are_round_with_the_digits_that_they_need() {
        let axis = Axis::default();
        assert_eq!(texts(&axis, &[0.0, 1.03], 5), ["0.0", "0.5", "1.0"]);
        assert_eq!(texts(&axis, &[-0.031, 0.02], 6), ["−0.03", "−0.02", "−0.01", "0.00", "0.01", "0.02"]);
        assert_eq!(texts(&axis, &[0.0, 3.0], 9), ["0", "1", "2", "3"]);
        assert_eq!(texts(&axis, &[0.0, 150_000.0], 3), ["0", "50\u{2009}000", "100\u{2009}000", "150\u{2009}000"]);
        assert_eq!(texts(&axis, &[0.0, 3.2e6], 3), ["0", "2×10⁶"]);
        assert_eq!(texts(&axis, &[0.0, 3.2e6], 6), ["0", "1×10⁶", "2×10⁶", "3×10⁶"]);
        assert_eq!(texts(&axis, &[1e-7, 2.1e-7], 3), ["1.0×10⁻⁷", "1.5×10⁻⁷", "2.0×10⁻⁷"]);
    }

    #[test]
    fn log_ticks_are_decades_or_their_parts() {
        let axis = Axis { scale: Scale::Log, ..Axis::default() };
        assert_eq!(
            texts(&axis, &[1e-5, 100.0, 0.0, -1.0], 8),
            ["10⁻⁵", "10⁻⁴", "0.001", "0.01", "0.1", "1", "10", "100"]
        );
        assert_eq!(texts(&axis, &[1e-5, 100.0], 3), ["0.001", "1"]);
        assert_eq!(texts(&axis, &[0.11, 0.6], 3), ["0.2", "0.5"]);
        assert_eq!(texts(&axis, &[2.1, 3.9], 3), ["3"]);
    }

    #[test]
    fn every_range_gives_few_finite_ticks() {
        let ends =
            [0.0, 5e-324, 1e-300, 1e-289, 1.0, 1.0 + 1e-15, 1e9, 1e9 + 1e-6, -1e299, 9.9e299, f64::NAN, f64::INFINITY];
        for scale in [Scale::Linear, Scale::Log] {
            for a in ends {
                for b in ends {
                    let axis = Axis { scale, ..Axis::default() };
                    let ruler = Ruler::around(&axis, [a, b].into_iter(), 0.05);
                    assert!(ruler.low < ruler.high, "{a} {b} {ruler:?}");
                    let ticks = ruler.ticks(6);
                    assert!(ticks.len() <= 40, "{a} {b}: {} ticks", ticks.len());
                    for tick in ticks {
                        assert!(
                            ruler.share(tick.value).is_some_and(|s| (-0.01..=1.01).contains(&s)),
                            "{a} {b} {tick:?}"
                        );
                        assert!(tick.label.chars().count() <= 18, "{a} {b} {tick:?}");
                    }
                }
            }
        }
    }
}
