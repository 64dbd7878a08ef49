//! Which worlds a benchmark plays.

use std::path::Path;

use scenario::Selection;

/// Scenario and seed from which worlds are drawn.
#[derive(Clone, Debug, clap::Args)]
pub struct Worlds {
    /// Domain: D1 to D5, or a scenario file.
    #[arg(long, default_value = "D4")]
    pub domain: String,
    /// Arm: sawyer, jaco, or a robot file.
    #[arg(long, default_value = "sawyer")]
    pub robot: String,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Overrides a scenario entry: key=value.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

impl Worlds {
    /// The layers of the scenario, with a preset.
    pub(crate) fn selection(&self, root: &Path, preset: &str) -> Selection {
        let Self { domain, robot, set, .. } = self.clone();
        Selection { domain, robot, set, preset: preset.into(), ..Selection::new(root) }
    }
}
