//! Finds where simulation and measurement disagree, names the missing effect, adds it to the model and proves it.
//!
//! # Method
//!
//! 1. A [`Trial`](trial::Trial) is an episode of the log, or a piece of a toss: what a simulation starts from, and what it is compared with. It runs
//!    freely from its first row with a pose of the object, driven by the logged commands.
//! 2. The null hypothesis is the nominal model with its uncertain numbers re-tuned within their priors ([`nominal`]).
//! 3. A right model's residuals are not white: solvers and starts differ, and such errors last for the rest of an episode. Simulations with other
//!    solver settings and other starts say what they look like. A [`whitener`] takes them out of each episode; those of the engine are also the
//!    same in all episodes, and are coordinates of every [`model`]. An episode that goes another way has little say ([`likelihood`]).
//! 4. Every effect of the catalogue gets one linear step beside re-tuning ([`screen`]); what promises most is fitted ([`fit`]), first to a part of the
//!    episodes, then to all.
//! 5. An effect is named if its ln evidence beats re-tuning's by a margin and held-out episodes agree. Where what is left stands out
//!    ([`locate`]), or another one promises enough, the search goes on beside it; where it still does, and much of the gap is open, the verdict is `unknown`. Of what is thrown
//!    up to four are looked for in a part of the episodes, and fitted to all together.
//! 6. [`report`]: where ([`locate`]), what, how sure ([`interval`]), before and after, what to record next ([`separate`]).
//!    Of an unknown gap what the force that is lacking follows ([`terms`]), and how contacts differ ([`touch`]).
//!
//! The same log, seed and version give the same answer, whatever the number of threads.
//!
//! # Example
//!
//! ```no_run
//! use discrepancy::{Nominal, Report, Settings, diagnose, rig_tool};
//!
//! let folder = "tests/data/mujoco-logs/logs/set-003";
//! let log = measured_log::read(folder.as_ref())?;
//! let nominal = Nominal::new(&log.header, rig_tool(&log, None)?)?;
//! let settings = Settings::default();
//! let report = Report::new(&diagnose(&log, folder, &nominal, &settings)?, &settings, 0.0);
//! assert_eq!(report.effects[0].name, "table_tilt", "{}", report.summary);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod accept;
pub mod answer;
mod begin;
pub mod budget;
pub mod candidate;
mod cells;
mod chain;
mod clock;
mod context;
pub mod decision;
pub mod diagnosis;
mod driven;
mod error;
pub mod evidence;
pub mod findings;
pub mod fit;
mod gains;
pub mod heldout;
pub mod interval;
pub mod likelihood;
mod linear;
pub mod listing;
pub mod locate;
pub mod model;
pub mod model_file;
pub mod noise;
pub mod nominal;
pub mod obstacle;
mod overlay;
mod page;
mod patch;
mod plausible;
mod prepared;
mod progress;
mod replay;
pub mod report;
pub mod rival;
pub mod screen;
mod search;
mod sentences;
pub mod separate;
pub mod simulator;
pub mod split;
mod stamps;
pub mod study;
pub mod terms;
pub mod thin;
pub mod touch;
pub mod trial;
mod tunable;
mod units;
mod verdict;
pub mod warning;
pub mod whitener;

use std::path::Path;
use std::sync::Arc;

use measured_log::{Axis, Channel, Log, Robot};
use physics_model::rig::RigTool;
use physics_model::robot::{Robot as Arm, RobotConfig, find_root};

pub use answer::Answer;
pub use begin::are_twins_by_name;
pub use diagnosis::{Diagnosis, Settings, diagnose, diagnose_watched};
pub use error::Error;
pub use model_file::ModelFile;
pub use nominal::Nominal;
pub use overlay::{Row, Seen, overlay};
pub use page::page;
pub use progress::Progress;
pub use report::{Report, Verdict};

/// What moves by command in a log.
///
/// # Errors
///
/// [`Error::Robot`] where the arm's description cannot be read; [`Error::Model`] for a tool without a radius.
pub fn rig_tool(log: &Log, root: Option<&Path>) -> Result<RigTool, Error> {
    let name = match log.header.robot {
        Robot::Sawyer => "sawyer",
        Robot::Jaco => "jaco",
        Robot::None => {
            let has = |channel: Channel| log.episodes.iter().any(|episode| episode.channels.contains_key(&channel));
            if !has(Channel::Command(Axis::X)) && !has(Channel::Tool(Axis::X)) {
                return Ok(RigTool::None);
            }
            let radius_m = log.header.tool_radius_m;
            let missing = || Error::Model {
                reason: "key `tool_radius_m`: expected the radius of the ball that is the tool".into(),
            };
            return Ok(RigTool::Ball { radius_m: radius_m.ok_or_else(missing)? });
        }
    };
    let root = match root {
        Some(root) => root.to_path_buf(),
        None => find_root(Path::new("."))?,
    };
    let config = RobotConfig::read(&root.join("scenarios/robots").join(name).with_extension("toml"))?;
    Ok(RigTool::Arm(Arc::new(Arm::load(&config, &root)?)))
}
