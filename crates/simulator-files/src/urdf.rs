//! The object as a URDF.

use physics_model::{ObjectShape, RigShape};

use crate::scene::Scene;
use crate::unsaid::{Format, comment, notes, number, numbers};

/// The object as one link: mass, inertia, collision and friction, the latter as Gazebo and PyBullet read it.
#[must_use]
pub fn urdf(scene: &Scene) -> String {
    let built = scene.build();
    let mass = &built.mass;
    let [xx, yy, zz, xy, xz, yz] = mass.moments().map(number);
    let (com, kg, friction) = (numbers(mass.com_m), number(mass.mass_kg), number(built.nominal.theta.object.friction));
    let mut notes = notes(&scene.effects, Format::Urdf, scene.rolls());
    let geometry = match &scene.object.shape {
        RigShape::Solid { shape, .. } => solid(*shape, built.nominal.theta.object.size_m),
        RigShape::Prism(prism) => {
            notes += "\n  The collision is the box around the outline.";
            solid(ObjectShape::Box, prism.size_m())
        }
    };
    let (title, notes) = (comment(&format!("A model of {}.", scene.name)), comment(&notes));
    format!(
        r#"<?xml version="1.0"?>
<!-- {title}
  SI units. The object as `diagnose` found it; the origin is the centre of its shape.
  {notes} -->
<robot name="object">
  <link name="object">
    <inertial>
      <origin xyz="{com}" rpy="0 0 0"/>
      <mass value="{kg}"/>
      <inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}" ixz="{xz}" iyz="{yz}"/>
    </inertial>
    <collision>
      <geometry>{geometry}</geometry>
    </collision>
    <visual>
      <geometry>{geometry}</geometry>
    </visual>
    <contact>
      <lateral_friction value="{friction}"/>
    </contact>
  </link>
  <gazebo reference="object">
    <mu1>{friction}</mu1>
    <mu2>{friction}</mu2>
  </gazebo>
</robot>
"#
    )
}

fn solid(shape: ObjectShape, size_m: [f64; 3]) -> String {
    let [a, b, _] = size_m.map(number);
    match shape {
        ObjectShape::Box => format!(r#"<box size="{}"/>"#, numbers(size_m)),
        ObjectShape::Cylinder => format!(r#"<cylinder radius="{a}" length="{b}"/>"#),
        ObjectShape::Sphere => format!(r#"<sphere radius="{a}"/>"#),
    }
}
