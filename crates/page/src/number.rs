//! Numbers as text, with sensible digits and a real minus.

/// What stands for a number that is none.
const VOID: &str = "–";

/// With so many decimals; a dash for what is no number.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return VOID.into();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().any(|c| c.is_ascii_digit() && c != '0') => format!("−{rest}"),
        Some(rest) => rest.into(),
        None => text,
    }
}

/// With so many significant digits.
#[must_use]
pub fn significant(value: f64, digits: i32) -> String {
    let size = value.abs();
    if !size.is_finite() || size == 0.0 {
        return if size == 0.0 { "0".into() } else { VOID.into() };
    }
    if !(1e-6..1e7).contains(&size) {
        return format!("{value:.*e}", (digits - 1).max(0) as usize).replace('-', "−");
    }
    fixed(value, (digits - 1 - size.log10().floor() as i32).max(0) as usize)
}

/// A share as a percentage.
#[must_use]
pub fn percent(share: f64) -> String {
    format!("{} %", fixed(100.0 * share, 0))
}

/// A count with its thousands set apart.
#[must_use]
pub fn count(value: usize) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A p value, or a bound where it is small.
#[must_use]
pub fn p_value(p: f64) -> String {
    if p < 0.001 { "< 0.001".into() } else { fixed(p, 3) }
}

/// A mean square: what fits in a cell.
#[must_use]
pub fn mean_square(value: f64) -> String {
    match value {
        v if !v.is_finite() => VOID.into(),
        v if v < 9.95 => fixed(v, 1),
        v if v < 999.5 => fixed(v, 0),
        v if v < 999.5e3 => format!("{}k", significant(v / 1e3, 2)),
        v if v < 999.5e6 => format!("{}M", significant(v / 1e6, 2)),
        _ => ">1G".into(),
    }
}

/// A ln evidence: a decimal where it is small.
#[must_use]
pub fn log_evidence(value: f64) -> String {
    match value.abs() {
        size if size >= 9_999.5 && size.is_finite() => format!("{}k", fixed(value / 1e3, 1)),
        size => fixed(value, usize::from(size < 9.95)),
    }
}
