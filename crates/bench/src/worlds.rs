//! Which worlds a benchmark plays.

use std::path::Path;

use scenario::Selection;

/// Scenario and seed from which worlds are drawn.
#[derive(Clone, Debug, clap::Args)]
pub struct Worlds {
    /// Domain: D1 to D5, or a scenario file.
    #[arg(long, default_value = "D4")]
    pub domain: String,
    /// Which arm.
    #[command(flatten)]
    pub arm: program::Arm,
    /// Root seed.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Scenario entries.
    #[command(flatten)]
    pub overrides: program::Overrides,
}

impl Worlds {
    /// The layers of the scenario, with a preset.
    pub(crate) fn selection(&self, root: &Path, preset: &str) -> Selection {
        let Self { domain, arm: program::Arm { robot }, overrides: program::Overrides { set }, .. } = self.clone();
        Selection { domain, robot, set, preset: preset.into(), ..Selection::new(root) }
    }
}
