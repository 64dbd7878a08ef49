//! Serial arms of up to [`MOST_JOINTS`] joints from the URDF files that vendors publish: where the links are, which torques a motion takes, and how
//! these depend on masses.
//!
//! Unlike `physics_model::robot`, which pushes objects in a simulator of contacts, nothing here needs a tool, a home posture or shapes. A file is
//! taken as it is, and what was assumed about it is listed in [`Arm::notes`].
//!
//! All SI and radians; a prismatic joint's position is in m and its torque a force in N. The base frame is the root link of the file, z up.
//!
//! # Example
//!
//! ```
//! let text = r#"<robot name="rod"><link name="base"/>
//!   <link name="rod"><inertial><origin xyz="0.5 0 0"/><mass value="2"/><inertia ixx="1e-3" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
//!   <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 -1 0"/></joint></robot>"#;
//! let urdf = urdf_file::parse(std::path::Path::new("rod.urdf"), text)?;
//! let arm = arm_dynamics::Arm::new(&urdf, std::path::Path::new("rod.urdf"), &arm_dynamics::Selection::default())?;
//! // Stretched out, 2 kg half a metre from the hinge.
//! let torque = arm.inverse_dynamics(&[0.0], &[0.0], &[0.0], &arm_dynamics::GRAVITY);
//! assert!((torque[0] - 2.0 * 9.81 * 0.5).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod arm;
mod chain;
mod dynamics;
mod file;
mod mass;

use nalgebra::Vector3;

pub use arm::{Arm, ArmError, ArmJoint, Selection};
pub use dynamics::{Motion, PARAMETERS};
pub use mass::Mass;

/// Joints of an arm, at most.
pub const MOST_JOINTS: usize = 12;

/// Acceleration of free fall in the base frame, m/s².
pub const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

/// One value for each joint; places beyond the last joint are 0.
pub type PerJoint = [f64; MOST_JOINTS];
