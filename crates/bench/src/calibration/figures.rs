//! Pictures of the figures.

use std::path::Path;

use anyhow::Result;
use figures::{Axis, Chart, Figure, Lines, Panel, Reference, Series};
use serde_json::Value;

use super::summary::{SOURCES, STEPS};

/// Saves `calibration.svg` and `calibration.png`: the obstacle's Brier score, errors and coverage by step.
pub(super) fn save(summary: &Value, out: &Path) -> Result<()> {
    let steps = STEPS.iter().filter(|step| **step != usize::MAX);
    let panel = |title: &str, figure: &str, references: Vec<Reference>| {
        let of_source = |source: &str| -> Vec<(f64, f64)> {
            let value = |step: &usize| summary["steps"][step.to_string()][source][figure]["mean"].as_f64();
            steps.clone().filter_map(|step| Some((*step as f64, value(step)?))).collect()
        };
        let series = SOURCES.iter().map(|(source, _)| Series {
            name: (*source).into(),
            points: of_source(source),
            ..Series::default()
        });
        let lines = Lines { x: Axis::new("step"), y: Axis::new(title), series: series.collect(), references };
        Panel { title: title.into(), chart: Chart::Lines(lines) }
    };
    let nominal = || vec![Reference { name: "85 to 95 %".into(), low: 0.85, high: 0.95 }];
    let figure = Figure {
        title: "Calibration of the belief".into(),
        panels: vec![
            panel("Brier score of the obstacle", "obstacle_brier", vec![]),
            panel("error of ln mass", "log_mass_error", vec![]),
            panel("coverage of 90 % of mass", "mass_coverage_90", nominal()),
            panel("coverage of 90 % of friction", "friction_coverage_90", nominal()),
        ],
        columns: 2,
        panel_size_px: (420, 260),
        ..Figure::default()
    };
    figure.save(&out.join("calibration"))?;
    Ok(())
}
