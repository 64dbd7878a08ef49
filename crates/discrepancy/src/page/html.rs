//! Text for HTML: escaped strings and numbers with sensible digits.

/// What stands for a number that is none.
const VOID: &str = "–";

/// Text between tags or in quoted attributes.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c if c.is_control() => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// With so many decimals and a real minus.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
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
pub(super) fn significant(value: f64, digits: i32) -> String {
    let size = value.abs();
    if !size.is_finite() || size == 0.0 {
        return if size == 0.0 { "0".into() } else { VOID.into() };
    }
    if !(1e-6..1e7).contains(&size) {
        return format!("{value:.*e}", (digits - 1).max(0) as usize).replace('-', "−");
    }
    fixed(value, (digits - 1 - size.log10().floor() as i32).max(0) as usize)
}

/// A mean square: what fits in a cell.
pub(super) fn mean_square(value: f64) -> String {
    match value {
        v if !v.is_finite() => VOID.into(),
        v if v < 9.95 => fixed(v, 1),
        v if v < 999.5 => fixed(v, 0),
        v if v < 999.5e3 => format!("{}k", significant(v / 1e3, 2)),
        v if v < 999.5e6 => format!("{}M", significant(v / 1e6, 2)),
        _ => "&gt;1G".into(),
    }
}

/// A ln evidence: a decimal where it is small.
pub(super) fn log_evidence(value: f64) -> String {
    match value.abs() {
        size if size >= 9_999.5 && size.is_finite() => format!("{}k", fixed(value / 1e3, 1)),
        size => fixed(value, usize::from(size < 9.95)),
    }
}

/// A name of the catalogue or of a channel in words.
pub(super) fn words(name: &str) -> String {
    escape(&name.replace('_', " "))
}
