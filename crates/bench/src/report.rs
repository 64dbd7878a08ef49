//! The accuracy report: a Markdown page in the docs of `physics-model`.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Result;
use physics_model::config::WorldConfig;
use statistics::nearest_rank;

use crate::accuracy::{SMALL_FORCE_N, SceneError, compare};
use crate::closed_forms::measure;
use crate::scenes::load;

/// Where the page lies in the project.
pub const PAGE: &str = "crates/physics-model/src/accuracy.md";

/// Scenes beyond these are listed: position, mm; angle, degrees; force, share.
const OUTLIER: (f64, f64, f64) = (2.0, 3.0, 0.2);

/// Time bases shown beside the scenario's: control steps, solver iterations.
const TIME_BASES: [(u32, u32); 10] =
    [(20, 1), (20, 2), (20, 3), (20, 4), (20, 8), (10, 2), (10, 3), (10, 4), (40, 1), (80, 4)];

/// Medians and 90th percentiles over the scenes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Median and 90th percentile of the object's distance, mm.
    pub position_mm: [f64; 2],
    /// Of the object's angle, degrees.
    pub angle_deg: [f64; 2],
    /// Of the force error, share.
    pub force: [f64; 2],
}

/// Summary of the errors.
#[must_use]
pub fn summarise(errors: &[SceneError]) -> Summary {
    let both =
        |values: Vec<f64>| [0.5, 0.9].map(|level| nearest_rank(values.iter().copied(), level).unwrap_or(f64::NAN));
    Summary {
        position_mm: both(errors.iter().map(|e| e.position_mm).collect()),
        angle_deg: both(errors.iter().map(|e| e.angle_deg).collect()),
        force: both(errors.iter().filter_map(|e| e.force).collect()),
    }
}

/// The page for the settings of `world`.
///
/// # Errors
///
/// Missing or broken records.
pub fn page(root: &Path, world: &WorldConfig) -> Result<String> {
    let scenes = load(root)?;
    let errors = |world: &WorldConfig| -> Vec<SceneError> {
        scenes.iter().map(|(scene, theirs)| compare(scene, theirs, world)).collect()
    };
    let (ours, fine) = (errors(world), errors(&finest(world)));
    let mut page = String::new();
    let _ = writeln!(page, "<!-- Written by `cargo xtask bench accuracy --write`; do not edit. -->\n");
    let _ = writeln!(
        page,
        "Settings of `scenarios/base.toml`: {} control steps of {:.4} s, {} solver iterations each, contacts of {} Hz and damping ratio {}. \
         MuJoCo 4.0.0 with fine settings (`tests/peers/`), recorded.\n",
        world.control_steps,
        world.control_period_secs,
        world.solver_iterations,
        world.contact_frequency_hz,
        world.contact_damping_ratio
    );
    page += &closed_forms(root, world)?;
    let _ = writeln!(
        page,
        "## {} scenes, one 2 cm action each\n\nDistance and angle between where we and MuJoCo leave the object; length of the difference of the mean \
         forces on the tool over MuJoCo's, where that is at least {SMALL_FORCE_N} N. Median / 90th percentile.\n\n\
         | control steps × iterations | position, mm | angle, ° | force, % |\n|---|---|---|---|",
        scenes.len()
    );
    for (steps, iterations) in TIME_BASES {
        let base = world.in_steps(steps, iterations);
        let chosen = (steps, iterations) == (world.control_steps, world.solver_iterations);
        let mark = if chosen { "**" } else { "" };
        page += &row(&format!("{mark}{steps} × {iterations}{mark}"), &errors(&base));
    }
    page += &row(&format!("{} × 8, 200 Hz contacts", 8 * world.control_steps), &fine);
    page += &outliers(&ours, &fine);
    Ok(page)
}

/// The finest settings that are shown.
fn finest(world: &WorldConfig) -> WorldConfig {
    WorldConfig {
        control_steps: 8 * world.control_steps,
        control_period_secs: world.control_period_secs / 8.0,
        solver_iterations: 8,
        contact_frequency_hz: 200.0,
        ..world.clone()
    }
}

fn closed_forms(root: &Path, world: &WorldConfig) -> Result<String> {
    let mut page =
        String::from("## Closed forms\n\n| quantity | closed form | MuJoCo | ours | error |\n|---|---|---|---|---|\n");
    for m in measure(root, world)? {
        let reference = m.exact.unwrap_or(m.mujoco);
        let exact = m.exact.map_or("–".into(), |v| format!("{v:.4}"));
        let error = 100.0 * (m.ours / reference - 1.0);
        let _ = writeln!(page, "| {} | {exact} | {:.4} | {:.4} | {error:+.1} % |", m.text, m.mujoco, m.ours);
    }
    page += "\nA body that friction stops ends v h / 2 short (h: substep), because its position follows the speed at the end of each substep: \
             3.3 % of the slide and 11.6 % of the spin.\n\n";
    Ok(page)
}

/// Medians and 90th percentiles as a row.
fn row(settings: &str, errors: &[SceneError]) -> String {
    let Summary { position_mm, angle_deg, force } = summarise(errors);
    let [force, high] = force.map(|force| 100.0 * force);
    format!(
        "| {settings} | {:.2} / {:.2} | {:.2} / {:.2} | {force:.1} / {high:.1} |\n",
        position_mm[0], position_mm[1], angle_deg[0], angle_deg[1]
    )
}

fn outliers(ours: &[SceneError], fine: &[SceneError]) -> String {
    let mut page = format!(
        "\n## Outliers\n\nScenes beyond {} mm, {}° or {:.0} %, with their errors at the finest settings above: what shrinks there is the time step, what stays \
         is a difference of the engines.\n\n| scene | position, mm | angle, ° | force, % | fine: position, mm | angle, ° | force, % |\n|---|---|---|---|---|---|---|\n",
        OUTLIER.0,
        OUTLIER.1,
        100.0 * OUTLIER.2
    );
    let percent = |force: Option<f64>| force.map_or("–".into(), |f| format!("{:.0}", 100.0 * f));
    for (error, fine) in ours.iter().zip(fine) {
        let force = error.force.unwrap_or(0.0);
        if error.position_mm > OUTLIER.0 || error.angle_deg > OUTLIER.1 || force > OUTLIER.2 {
            let _ = writeln!(
                page,
                "| {} | {:.2} | {:.1} | {} | {:.2} | {:.1} | {} |",
                error.name,
                error.position_mm,
                error.angle_deg,
                percent(error.force),
                fine.position_mm,
                fine.angle_deg,
                percent(fine.force)
            );
        }
    }
    page
}
