//! A MuJoCo scene.
//!
//! The object has three sliding joints along the axes of the base frame and a ball joint, at its centre of mass, so that damping, springs and forces act on its translation
//! alone; its seven coordinates are those of a free joint. It bears on small spheres in its corners, or on its rim: what resists turning on the spot is then the friction
//! of these points, as for any box on a plane. Contacts are damped springs in units of acceleration, nearly ideal: a rate of 300 rad/s for each of many points, of
//! 800 rad/s for one alone, and an impedance of 0.001 with a large ratio of the frictional one, so that friction sticks.
//! `tests/peers/mujoco_logs.py` says why. MuJoCo takes the damping of contacts explicitly, so that many points far from the middle of a flat body have to
//! be softer.

use std::f64::consts::PI;
use std::fmt::Write as _;

use physics_model::effect::HiddenBody;
use physics_model::{ObjectShape, RigShape, RigTool};

use crate::mass::uniform;
use crate::scene::{Built, Scene};
use crate::unsaid::{Format, comment, notes, number, numbers};

/// Radius of a support point, m.
const POINT_M: f64 = 0.000_1;
/// Points on a rim.
const RIM: u32 = 8;
/// How far the rest of a sole is above the points that it bears on, m.
const SOLE_GAP_M: f64 = 0.000_3;
/// Rate (rad/s) and damping ratio of the contact of one of many points, and of one alone.
const SUPPORT: (f64, f64) = (300.0, 1.0);
const ALONE: (f64, f64) = (800.0, 1.5);
/// An exponent of the cone of friction that differs from 1 by more than this factor is a pyramid's.
const PYRAMID: f64 = 2.0;
/// Rate at which friction stops a slip, 1/s, and impedance of contacts.
const STOP_RATE: f64 = 1500.0;
const IMPEDANCE: f64 = 0.001;
/// Mass of a tool that goes where it is sent, kg.
const TOOL_KG: f64 = 1e4;
/// Where the tool stands at first, m from the object.
const TOOL_AT_M: f64 = 0.3;
/// How much stiffer all points together may be than one alone, for its mass or about an axis. At 13 the damping of a step turns the velocity round.
const STIFFEST: f64 = 10.0;
/// Contacts are those of the pairs alone.
const NO_COLLISION: &str = r#"contype="0" conaffinity="0""#;

/// The scene as MJCF: table, object, tool if it is a ball, and bodies that effects know of.
///
/// What drives the tool sets `qpos` and `qvel` of its three joints at the start of each control period. Forces on it are its gain of momentum.
#[must_use]
pub fn mjcf(scene: &Scene) -> String {
    let built = scene.build();
    let shape = Shape::of(scene, &built);
    let mut pairs = String::new();
    let friction = built.nominal.theta.object.friction;
    let support = (SUPPORT.0 * softer(&built, &shape.points), SUPPORT.1);
    for index in 0..shape.points.len() {
        pairs += &pair("table", &format!("point{index}"), friction, 0.0, support);
    }
    if shape.points.is_empty() {
        pairs += &pair("table", "object", friction, built.rolling_m, ALONE);
    }
    let ball = match scene.rig.tool {
        RigTool::Ball { radius_m } => {
            pairs += &pair("tool", "object", built.nominal.world.tool_friction, 0.0, ALONE);
            tool(radius_m)
        }
        RigTool::None | RigTool::Arm(_) => String::new(),
    };
    let mut obstacles = String::new();
    for (index, body) in built.nominal.hidden.iter().enumerate() {
        obstacles += &obstacle(index, body, built.nominal.world.table_height_m);
        let name = format!("obstacle{index}");
        // Flat faces meet in many points.
        let flat = if body.shape == ObjectShape::Sphere { ALONE } else { SUPPORT };
        let met = if scene.rolls() { ALONE } else { flat };
        pairs += &pair("object", &name, friction.min(built.nominal.world.obstacle_friction), 0.0, met);
        if !ball.is_empty() {
            pairs += &pair("tool", &name, built.nominal.world.tool_friction, 0.0, ALONE);
        }
        if body.movable {
            pairs += &pair("table", &name, built.nominal.world.obstacle_friction, 0.0, flat);
        }
    }
    format!(
        r#"<!-- {title}
  SI units, angles in rad. Table, object and tool as `diagnose` found them.
  {notes} -->
<mujoco model="surmise">
  <compiler angle="radian" inertiafromgeom="false"/>
  <option timestep="0.00025" gravity="{gravity}" cone="elliptic" impratio="30000" solver="Newton" iterations="100" tolerance="1e-13" integrator="implicitfast" jacobian="dense"><flag island="disable"/></option>
{assets}  <worldbody>
    <geom name="table" type="plane" size="0 0 1" pos="0 0 {height}" {NO_COLLISION}/>
{object}{ball}{obstacles}  </worldbody>
  <contact>
{pairs}  </contact>
{forces}  <keyframe><key name="start" qpos="{start}"/></keyframe>
</mujoco>
"#,
        title = comment(&format!("A model of {}.", scene.name)),
        notes = comment(&unsaid(scene, &built, &shape)),
        gravity = numbers(built.gravity_mps2),
        assets = shape.asset,
        height = number(built.nominal.world.table_height_m),
        object = object(&built, &shape),
        forces = forces(&built),
        start = numbers(start(&built, &shape, !ball.is_empty())),
    )
}

/// What the scene leaves out, and how to begin with it.
fn unsaid(scene: &Scene, built: &Built, shape: &Shape) -> String {
    let mut notes = notes(&scene.effects, Format::Mjcf, scene.rolls());
    if let RigTool::Arm(_) = scene.rig.tool {
        let friction = number(built.nominal.world.tool_friction);
        notes += &format!(
            "\n  The arm is not in this file: add yours, with a friction of {friction} between its tool and the geom `object`."
        );
    }
    if shape.is_hull {
        notes += "\n  MuJoCo takes the convex hull of the outline.";
    }
    let restitution = built.nominal.world.restitution;
    if restitution > 0.0 {
        notes += &format!(
            "\n  Contacts do not bounce: the coefficient of restitution, {}, is not in this file.",
            number(restitution)
        );
    }
    if built.damping_nspm != 0.0 && built.nominal.hidden.iter().any(|body| body.movable) {
        notes += "\n  Only the object is damped, not the body in its way.";
    }
    notes += pyramid(scene.rig.cone_exponent).as_str();
    notes += "\n  Contacts are those of this file, not `contact.*` of model.toml. Clocks are about the log.";
    notes += "\n  Begin with the keyframe `start`. The joints are at the centre of mass; the site `object` is the centre of the shape.";
    notes
}

/// What this file lacks of friction that is not Coulomb's.
fn pyramid(exponent: f64) -> String {
    let exponent = match exponent {
        exponent if exponent > PYRAMID => format!("{exponent:.1}; `cone=\"pyramidal\"` has one as well"),
        exponent if exponent < PYRAMID.recip() => {
            format!("{exponent:.2}; MuJoCo has none whose friction is more between the axes")
        }
        _ => return String::new(),
    };
    format!(
        "\n  Friction on the table was found with a pyramid along x and y, which is not in this file (exponent {exponent})."
    )
}

/// Coordinates of the object upright on the table, of a tool beside it, and of bodies that can move.
fn start(built: &Built, shape: &Shape, has_tool: bool) -> Vec<f64> {
    let table_m = built.nominal.world.table_height_m;
    let [x, y, z] = built.mass.com_m;
    let mut coordinates = vec![x, y, table_m + shape.half_height_m + z, 1.0, 0.0, 0.0, 0.0];
    if has_tool {
        coordinates.extend([-TOOL_AT_M, 0.0, table_m + shape.half_height_m]);
    }
    for body in built.nominal.hidden.iter().filter(|body| body.movable) {
        coordinates.extend(place(body, table_m));
        coordinates.extend(turn(body));
    }
    coordinates
}

/// By how much the contacts of `points` have to be slower than [`SUPPORT`], so that all of one face together are no stiffer than [`STIFFEST`].
fn softer(built: &Built, points: &[[f64; 3]]) -> f64 {
    let mass = &built.mass;
    let lowest = points.iter().map(|point| point[2]).fold(f64::INFINITY, f64::min);
    let face: Vec<&[f64; 3]> = points.iter().filter(|point| point[2] <= lowest + 1e-9).collect();
    let about = |axis: usize| {
        let lever = |point: &&[f64; 3]| (point[1 - axis] - mass.com_m[1 - axis]).powi(2);
        mass.mass_kg * face.iter().map(lever).sum::<f64>() / mass.inertia_kgm2[(axis, axis)]
    };
    (STIFFEST / about(0).max(about(1)).max(face.len() as f64)).min(1.0)
}

/// Geometry of the object.
struct Shape {
    /// Attributes of the geom.
    geom: String,
    /// The mesh, if it is one.
    asset: String,
    /// Centres of support points, m, object frame.
    points: Vec<[f64; 3]>,
    /// Whether a mesh is larger than the outline.
    is_hull: bool,
    half_height_m: f64,
}

impl Shape {
    fn of(scene: &Scene, built: &Built) -> Self {
        // What asks for all of its points does not move them.
        let share = built.nominal.support_share.filter(|share| *share < 1.0);
        match &scene.object.shape {
            RigShape::Prism(prism) => {
                let half = 0.5 * prism.height_m();
                let corners = [-half, half].map(|z| prism.outline_m().iter().map(move |[x, y]| [*x, *y, z]));
                let vertices = numbers(corners.into_iter().flatten().flatten());
                let asset = format!("  <asset><mesh name=\"object\" vertex=\"{vertices}\"/></asset>\n");
                let geom = r#"type="mesh" mesh="object""#.into();
                let points = on_both_faces(&prism.extremes_m(), prism.feet_m(), half, share);
                Self { geom, asset, points, is_hull: !is_convex(prism.outline_m()), half_height_m: half }
            }
            RigShape::Solid { shape, .. } => {
                let size_m = built.nominal.theta.object.size_m;
                let half = shape.half_extents_m(size_m);
                let sole: Vec<[f64; 2]> = match shape {
                    ObjectShape::Box => {
                        let [a, b] = [half[0] - POINT_M, half[1] - POINT_M];
                        vec![[a, b], [a, -b], [-a, b], [-a, -b]]
                    }
                    ObjectShape::Cylinder => {
                        let angle = |k: u32| f64::from(k) * 2.0 * PI / f64::from(RIM);
                        let rim = half[0] - POINT_M;
                        (0..RIM).map(|k| [rim * angle(k).cos(), rim * angle(k).sin()]).collect()
                    }
                    ObjectShape::Sphere => Vec::new(),
                };
                Self {
                    geom: solid(*shape, size_m),
                    asset: String::new(),
                    points: on_both_faces(&sole, &[], half[2], share),
                    is_hull: false,
                    half_height_m: half[2],
                }
            }
        }
    }
}

/// Support points in the corners of the lower and the upper face. Where the object stands on `feet`, or with a `share` on points nearer to the middle, the corners of
/// the lower face are a little higher.
fn on_both_faces(corners: &[[f64; 2]], feet: &[[f64; 2]], half_m: f64, share: Option<f64>) -> Vec<[f64; 3]> {
    let z = half_m - POINT_M;
    let sole = if feet.is_empty() { corners } else { feet };
    let count = sole.len().max(1) as f64;
    let middle: [f64; 2] = std::array::from_fn(|axis| sole.iter().map(|point| point[axis]).sum::<f64>() / count);
    let share_of = share.unwrap_or(1.0);
    let nearer = |p: &[f64; 2]| {
        let at: [f64; 2] = std::array::from_fn(|axis| middle[axis] + share_of * (p[axis] - middle[axis]));
        [at[0], at[1], -z]
    };
    let mut points: Vec<[f64; 3]> = Vec::new();
    let stands_inside = share.is_some() || !feet.is_empty();
    if stands_inside {
        points.extend(sole.iter().map(nearer));
    }
    let lower = if stands_inside { -z + SOLE_GAP_M } else { -z };
    points.extend(corners.iter().map(|[x, y]| [*x, *y, lower]));
    points.extend(corners.iter().map(|[x, y]| [*x, *y, z]));
    points
}

fn is_convex(outline: &[[f64; 2]]) -> bool {
    let count = outline.len();
    let turn = |i: usize| {
        let [a, b, c] = [outline[i], outline[(i + 1) % count], outline[(i + 2) % count]];
        (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
    };
    (0..count).all(|i| turn(i) >= 0.0) || (0..count).all(|i| turn(i) <= 0.0)
}

/// Attributes of a geom.
fn solid(shape: ObjectShape, size_m: [f64; 3]) -> String {
    let [a, b, c] = size_m;
    match shape {
        ObjectShape::Box => format!(r#"type="box" size="{}""#, numbers([a / 2.0, b / 2.0, c / 2.0])),
        ObjectShape::Cylinder => format!(r#"type="cylinder" size="{}""#, numbers([a, b / 2.0])),
        ObjectShape::Sphere => format!(r#"type="sphere" size="{}""#, number(a)),
    }
}

/// Joints of a body that slides, turns and tips, with the same coordinates as a free joint.
fn joints(name: &str, damping: f64, tether: (f64, [f64; 2])) -> String {
    let mut text = String::new();
    for (axis, direction) in [("x", "1 0 0"), ("y", "0 1 0"), ("z", "0 0 1")] {
        let _ = write!(
            text,
            r#"      <joint name="{name}_{axis}" type="slide" axis="{direction}" damping="{}""#,
            number(damping)
        );
        let place = ["x", "y"].iter().position(|other| *other == axis);
        if let Some(place) = place.filter(|_| tether.0 != 0.0) {
            let _ = write!(text, r#" stiffness="{}" springref="{}""#, number(tether.0), number(tether.1[place]));
        }
        text += "/>\n";
    }
    text
}

fn object(built: &Built, shape: &Shape) -> String {
    let mass = &built.mass;
    let mut text = format!("    <body name=\"object\">\n{}", joints("object", built.damping_nspm, built.tether));
    text += "      <joint name=\"object_turn\" type=\"ball\"/>\n";
    let _ = writeln!(
        text,
        r#"      <inertial pos="0 0 0" mass="{}" fullinertia="{}"/>"#,
        number(mass.mass_kg),
        numbers(mass.moments())
    );
    // From the centre of mass.
    let from_com = |at: [f64; 3]| numbers((0..3).map(|axis| at[axis] - mass.com_m[axis]));
    let centre = from_com([0.0; 3]);
    let _ = writeln!(text, r#"      <site name="object" pos="{centre}"/>"#);
    let _ = writeln!(text, r#"      <geom name="object" {} pos="{centre}" {NO_COLLISION}/>"#, shape.geom);
    for (index, point) in shape.points.iter().enumerate() {
        let (size, at) = (number(POINT_M), from_com(*point));
        let _ = writeln!(
            text,
            r#"      <geom name="point{index}" type="sphere" size="{size}" pos="{at}" {NO_COLLISION}/>"#
        );
    }
    text + "    </body>\n"
}

fn tool(radius_m: f64) -> String {
    let joints = joints("tool", 0.0, (0.0, [0.0; 2]));
    let (mass, radius) = (number(TOOL_KG), number(radius_m));
    format!(
        r#"    <body name="tool" gravcomp="1">
{joints}      <inertial pos="0 0 0" mass="{mass}" diaginertia="1 1 1"/>
      <geom name="tool" type="sphere" size="{radius}" {NO_COLLISION}/>
    </body>
"#
    )
}

fn obstacle(index: usize, body: &HiddenBody, table_m: f64) -> String {
    let geom = format!(r#"<geom name="obstacle{index}" {} {NO_COLLISION}/>"#, solid(body.shape, body.size_m));
    let mass = number(body.mass_kg);
    let moments = numbers(uniform(body.shape, body.size_m).map(|moment| moment * body.mass_kg));
    let inertial = format!(r#"<inertial pos="0 0 0" mass="{mass}" diaginertia="{moments}"/>"#);
    let free = if body.movable { format!("<freejoint name=\"obstacle{index}\"/>{inertial}") } else { String::new() };
    let (at, turn) = (numbers(place(body, table_m)), numbers(turn(body)));
    format!("    <body name=\"obstacle{index}\" pos=\"{at}\" quat=\"{turn}\">{free}{geom}</body>\n")
}

/// Where a body stands, m.
fn place(body: &HiddenBody, table_m: f64) -> [f64; 3] {
    [body.place_m[0], body.place_m[1], table_m + body.shape.half_extents_m(body.size_m)[2]]
}

/// Its quaternion, w first.
fn turn(body: &HiddenBody) -> [f64; 4] {
    [(0.5 * body.yaw_rad).cos(), 0.0, 0.0, (0.5 * body.yaw_rad).sin()]
}

/// A contact. `rolling_m`: lever of rolling.
fn pair(one: &str, other: &str, friction: f64, rolling_m: f64, (rate, damping): (f64, f64)) -> String {
    let condim = if rolling_m > 0.0 { 6 } else { 3 };
    let friction = numbers([friction, friction, 0.0, rolling_m, rolling_m]);
    let spring = number(-rate * rate);
    let (normal, stop) = (number(-2.0 * damping * rate), number(-STOP_RATE * IMPEDANCE));
    let impedance = number(IMPEDANCE);
    format!(
        r#"    <pair geom1="{one}" geom2="{other}" condim="{condim}" friction="{friction}" solref="{spring} {normal}" solreffriction="{spring} {stop}" solimp="{impedance} {impedance} 0.001 0.5 2"/>
"#
    )
}

/// Actuators that push the object with a constant force.
fn forces(built: &Built) -> String {
    if built.force_n == [0.0; 2] {
        return String::new();
    }
    let one = |(axis, force): (&str, f64)| {
        let force = number(force);
        format!(r#"    <general joint="object_{axis}" gainprm="0" biastype="affine" biasprm="{force} 0 0"/>"#) + "\n"
    };
    let all: String = ["x", "y"].into_iter().zip(built.force_n).map(one).collect();
    format!("  <actuator>\n{all}  </actuator>\n")
}
