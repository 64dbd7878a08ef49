//! URDF files as vendors publish them: the links, joints, masses and shapes that an arm needs, read in bounded memory, time and depth.
//!
//! # Example
//!
//! ```
//! let text = r#"<robot name="rod"><link name="base"/><link name="rod"/>
//!   <joint name="hinge" type="continuous"><parent link="base"/><child link="rod"/><dynamics damping="0.1"/></joint></robot>"#;
//! let urdf = urdf_file::parse(std::path::Path::new("rod.urdf"), text)?;
//! assert_eq!((urdf.joints[0].name.as_str(), urdf.joints[0].dynamics.damping), ("hinge", 0.1));
//! # Ok::<(), urdf_file::UrdfError>(())
//! ```

mod edit;
mod error;
mod file;
mod model;

pub use edit::{with_dynamics, with_elements};
pub use error::{UrdfError, joint_error, link_error};
pub use file::{parse, read};
pub use model::{Dynamics, Geometry, Inertial, Joint, JointKind, Limit, Link, Mimic, Origin, Urdf};
