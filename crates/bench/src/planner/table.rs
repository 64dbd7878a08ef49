//! The results as Markdown.

use serde_json::{Value, json};

use super::classic::BUDGETS;

/// Rows with POMCP and classes of observations.
const CLASSIC: [(&str, &str); 3] =
    [("rocksample_7_8", "RockSample(7, 8)"), ("rocksample_11_11", "RockSample(11, 11)"), ("tag", "Tag")];
/// Rows of [`super::contest`].
const CONTEST: [(&str, &str); 5] = [
    ("light_dark", "LightDark"),
    ("rocksample_15_15", "RockSample(15, 15)"),
    ("laser_tag", "LaserTag"),
    ("vdp_tag", "VDP Tag"),
    ("sub_hunt", "Sub Hunt"),
];

fn pair(value: &Value, digits: usize) -> String {
    match (value["mean"].as_f64(), value["stderr"].as_f64()) {
        (Some(mean), Some(stderr)) => format!("{mean:.digits$} ± {stderr:.digits$}"),
        (Some(mean), None) => format!("{mean:.digits$}"),
        _ => "–".into(),
    }
}

/// The result as Markdown: the parts that it has.
#[must_use]
pub fn table(result: &Value) -> String {
    let parts = [classic(result), contest(result), tiger(result), threads(result)];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<String>>().join("\n")
}

fn classic(result: &Value) -> String {
    let rows = CLASSIC.iter().filter(|(key, _)| result[key].is_object());
    let rows: String = rows
        .map(|(key, name)| {
            let row = &result[key];
            let speed = row["simulations_per_second"].as_f64().unwrap_or(f64::NAN);
            let returns: Vec<String> = BUDGETS.iter().map(|(n, _)| pair(&row["returns"][n.to_string()], 2)).collect();
            let published = pair(&row["published"]["pomcp"], 2);
            format!("| {name} | {speed:.0} | {} | {published} |\n", returns.join(" | "))
        })
        .collect();
    if rows.is_empty() {
        return rows;
    }
    let head = "| problem | simulations/s | 2^10 | 2^13 | 2^15 | POMCP, 1 s a move |\n|---|---|---|---|---|---|\n";
    format!("{head}{rows}")
}

fn contest(result: &Value) -> String {
    let rows: String = CONTEST.iter().filter_map(|(key, name)| contest_row(name, &result[key])).collect();
    if rows.is_empty() {
        return rows;
    }
    let head =
        "| problem | return | n | simulations a move | s a move | published, 1 s a move |\n|---|---|---|---|---|---|\n";
    let note = "\nMean ± standard error of discounted returns. Seconds are CPU time of one thread.\n";
    format!("{head}{rows}{note}")
}

fn contest_row(name: &str, row: &Value) -> Option<String> {
    let returns = row["returns"].as_object()?.values().next()?;
    let published: Vec<String> =
        row["published"].as_object()?.iter().map(|(who, v)| format!("{who} {}", pair(v, 1))).collect();
    let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
    Some(format!(
        "| {name} | {} | {} | {:.0} | {:.3} | {} |\n",
        pair(returns, 1),
        returns["n"],
        number("simulations_per_decision"),
        number("seconds_per_decision"),
        published.join(", ")
    ))
}

fn tiger(result: &Value) -> String {
    let rows = result["tiger"].as_object().into_iter().flatten();
    let rows: String = rows
        .map(|(horizon, row)| {
            let root = json!({ "mean": row["root_value"], "stderr": row["stderr"] });
            format!("| {horizon} | {} | {} |\n", row["exact"], pair(&root, 2))
        })
        .collect();
    if rows.is_empty() { rows } else { format!("| Tiger, horizon | exact | root value |\n|---|---|---|\n{rows}") }
}

fn threads(result: &Value) -> String {
    let threads = &result["threads"];
    let Some(speedup) = threads["speedup"].as_f64() else { return String::new() };
    format!("{} threads: {speedup:.2} times the speed of one.\n", threads["cores"])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_without_rows_has_no_table() {
        assert_eq!(table(&json!({})), "");
        let row = json!({
            "returns": { "20": { "mean": 1.25, "stderr": 0.5, "n": 200 } }, "simulations_per_decision": 20.0,
            "seconds_per_decision": 0.0125, "published": { "pomcp": { "mean": 15.3, "stderr": null } },
        });
        let text = table(&json!({ "rocksample_15_15": row }));
        assert!(text.contains("| RockSample(15, 15) | 1.2 ± 0.5 | 200 | 20 | 0.013 | pomcp 15.3 |\n"), "{text}");
        assert!(!text.contains("Tiger") && !text.contains("2^10"));
    }
}
