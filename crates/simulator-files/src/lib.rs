//! A model as files of other simulators: a MuJoCo scene and a URDF.
//!
//! A [`Scene`] is what a diagnosis found: rig, object and effects. [`mjcf`] and [`urdf`] write what their format has words for, and list the rest in a
//! comment at the top of the file, so that nobody takes a part for the whole.
//!
//! # Example
//!
//! ```
//! use physics_model::config::{ObstacleMobility, WorldConfig};
//! use physics_model::{EffectConfig, ObjectShape, Rig, RigObject, RigShape, RigTool};
//! use physics_model::effects::{ForceGain, TableTilt};
//! use simulator_files::{Scene, mjcf};
//!
//! let world = WorldConfig {
//!     control_period_secs: 0.01,
//!     control_steps: 1,
//!     solver_iterations: 4,
//!     contact_frequency_hz: 60.0,
//!     contact_damping_ratio: 5.0,
//!     table_height_m: 0.0,
//!     gravity_mps2: 9.81,
//!     tool_friction: 0.2,
//!     obstacle_friction: 0.5,
//!     arm_stiffness_npm: 50_000.0,
//!     restitution: 0.0,
//!     obstacle_mobility: ObstacleMobility::Movable,
//! };
//! let shape = RigShape::Solid { shape: ObjectShape::Box, size_m: [0.08, 0.06, 0.05] };
//! let scene = Scene {
//!     name: "push",
//!     rig: Rig { world, tick_steps: 1, tool: RigTool::Ball { radius_m: 0.02 }, tool_slip_mps: 0.0, cone_exponent: 1.0 },
//!     object: RigObject::new(shape, 0.5, 0.3),
//!     effects: vec![
//!         EffectConfig::TableTilt(TableTilt { slope_x_rad: 0.02, slope_y_rad: 0.0 }),
//!         EffectConfig::ForceGain(ForceGain { gain: 1.1 }),
//!     ],
//! };
//! let text = mjcf(&scene);
//! assert!(text.contains(r#"gravity="0.19618"#), "a tilt is another direction of gravity");
//! assert!(text.contains("force_gain"), "what sensors do is no part of a scene, and is said");
//! ```

mod mass;
mod mjcf;
mod scene;
mod unsaid;
mod urdf;

pub use mjcf::mjcf;
pub use scene::Scene;
pub use urdf::urdf;
