//! An arm: which joints of a file it is, and what was assumed about them.

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, IsometryMatrix3, Point3, Translation3, UnitQuaternion};
use thiserror::Error;
use urdf_file::{Joint, JointKind, Urdf, UrdfError, joint_error, link_error};

use crate::MOST_JOINTS;
use crate::chain::{Segment, Walk, joint_of, path_to};
use crate::mass::Mass;

/// Why a file holds no arm that can be used.
#[derive(Debug, Error)]
pub enum ArmError {
    /// The file itself.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
    /// Its links and joints are no serial arm, or not clearly one.
    #[error("{}: {problem}", .path.display())]
    Arm {
        /// File.
        path: PathBuf,
        /// What is wrong and what was expected.
        problem: String,
    },
}

/// Which joints are the arm; by default the longest chain of joints that turn.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// Names of the joints that move, base first.
    pub joints: Option<Vec<String>>,
    /// Link whose frame is the tip; by default the last one of the chain that nothing but fixed joints lead to.
    pub tip: Option<String>,
}

/// A joint. Positions in rad, or m where it slides.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmJoint {
    /// As in the file.
    pub name: String,
    /// Whether it slides rather than turns.
    pub slides: bool,
    /// Lowest position; −∞ without a limit.
    pub lower: f64,
    /// Highest position; +∞ without a limit.
    pub upper: f64,
    /// Fastest, per second; +∞ where the file does not say.
    pub velocity: f64,
    /// Strongest, N·m or N; +∞ where the file does not say.
    pub effort: f64,
    /// Viscous friction of the file, N·m·s/rad.
    pub damping: f64,
    /// Coulomb friction of the file, N·m.
    pub friction: f64,
}

impl ArmJoint {
    /// Lowest and highest position: the limits, and one turn (2π m where it slides) where one of them is missing.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        const TURN: f64 = std::f64::consts::TAU;
        match (self.lower.is_finite(), self.upper.is_finite()) {
            (true, true) => (self.lower, self.upper),
            (true, false) => (self.lower, self.lower + TURN),
            (false, true) => (self.upper - TURN, self.upper),
            (false, false) => (-0.5 * TURN, 0.5 * TURN),
        }
    }
}

/// A serial arm on a base that does not move.
#[derive(Clone, Debug)]
pub struct Arm {
    joints: Vec<ArmJoint>,
    segments: Vec<Segment>,
    tip: String,
    last_from_tip: IsometryMatrix3<f64>,
    notes: Vec<String>,
}

impl Arm {
    /// Reads the arm of a URDF file.
    ///
    /// # Errors
    ///
    /// [`ArmError`] if the file is no URDF, has several roots, or holds no chain as selected.
    pub fn load(path: &Path, selection: &Selection) -> Result<Self, ArmError> {
        Self::new(&urdf_file::read(path)?, path, selection)
    }

    /// The arm of a parsed file; `path` is for messages.
    ///
    /// # Errors
    ///
    /// [`ArmError`] if the file has several roots, or holds no chain as selected.
    pub fn new(urdf: &Urdf, path: &Path, selection: &Selection) -> Result<Self, ArmError> {
        let refuse =
            |problem: String| ArmError::Arm { path: path.into(), problem: whole_file::one_line(&problem, 500) };
        let root = root(urdf, path)?;
        let chain = match &selection.joints {
            Some(names) => named(urdf, path, names)?,
            None => longest(urdf, path)?,
        };
        if chain.is_empty() || chain.len() > MOST_JOINTS {
            return Err(refuse(format!("expected an arm of 1 to {MOST_JOINTS} joints, found {}", chain.len())));
        }
        let joints = chain.iter().map(|joint| joint_of(joint, path)).collect::<Result<Vec<_>, _>>()?;
        let mut walk = Walk::new(path, urdf, &chain);
        walk.visit(root, None, &IsometryMatrix3::identity())?;
        let Walk { mut segments, links, mut notes, .. } = walk;
        for link in &urdf.links {
            let Some((Some(segment), segment_from_link)) = links.get(link.name.as_str()) else { continue };
            check_mass(link, path)?;
            let mass = Mass::of_link(link).moved(segment_from_link);
            segments[*segment].mass = segments[*segment].mass.joined(&mass);
        }
        for (segment, joint) in segments.iter().zip(&joints) {
            if segment.mass.mass_kg <= 0.0 {
                notes.push(format!("what joint {:?} carries up to the next one has no mass in the file", joint.name));
            }
        }
        for joint in &joints {
            let missing = [(joint.velocity, "velocity"), (joint.effort, "effort")];
            let missing: Vec<&str> =
                missing.iter().filter(|(value, _)| value.is_infinite()).map(|(_, name)| *name).collect();
            if !missing.is_empty() {
                notes.push(format!("joint {:?} has no limit of {} in the file", joint.name, missing.join(" and ")));
            }
        }
        let last = chain.len() - 1;
        let tip = match &selection.tip {
            Some(name) => match links.get_key_value(name.as_str()) {
                Some((tip, (Some(segment), _))) if *segment == last => *tip,
                _ => {
                    return Err(refuse(format!(
                        "tip_link = {name:?}: expected a link that moves with {:?}",
                        joints[last].name
                    )));
                }
            },
            None => end_of(urdf, &chain[last].child),
        };
        let last_from_tip = links[tip].1;
        warn_of_masses(&segments, &joints, &mut notes);
        Ok(Self { joints, segments, tip: tip.to_owned(), last_from_tip, notes })
    }

    /// Base first.
    #[must_use]
    pub fn joints(&self) -> &[ArmJoint] {
        &self.joints
    }

    /// What was assumed, and what looks wrong in the file; a sentence each.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Name of the tip's link.
    #[must_use]
    pub fn tip(&self) -> &str {
        &self.tip
    }

    /// Frame of the last joint (z its axis) ← frame of the tip.
    #[must_use]
    pub fn last_from_tip(&self) -> &IsometryMatrix3<f64> {
        &self.last_from_tip
    }

    /// What each joint carries up to the next one, in the joint's frame.
    pub fn masses(&self) -> impl Iterator<Item = &Mass> {
        self.segments.iter().map(|segment| &segment.mass)
    }

    /// Pose of the tip in the base frame, m, at `q` (rad).
    ///
    /// # Panics
    ///
    /// If `q` has not one value for each joint.
    #[must_use]
    pub fn base_from_tip(&self, q: &[f64]) -> Isometry3<f64> {
        assert_eq!(q.len(), self.joints.len(), "positions of the joints");
        let links = self.segments.iter().zip(q).map(|(segment, position)| segment.parent_from_link(*position));
        let pose = links.fold(IsometryMatrix3::identity(), |base, link| base * link) * self.last_from_tip;
        let turn = UnitQuaternion::from_rotation_matrix(&pose.rotation);
        Isometry3::from_parts(Translation3::from(pose.translation.vector), turn)
    }

    /// Places of the base, of each joint and of the tip in the base frame, m, at `q` (rad).
    ///
    /// # Panics
    ///
    /// If `q` has not one value for each joint.
    #[must_use]
    pub fn origins(&self, q: &[f64]) -> Vec<Point3<f64>> {
        assert_eq!(q.len(), self.joints.len(), "positions of the joints");
        let mut places = vec![Point3::origin()];
        let mut base = IsometryMatrix3::identity();
        for (segment, position) in self.segments.iter().zip(q) {
            base *= segment.parent_from_link(*position);
            places.push(base.translation.vector.into());
        }
        places.push((base * self.last_from_tip).translation.vector.into());
        places
    }

    /// The same arm with other masses, one for each joint, in its frame.
    ///
    /// # Panics
    ///
    /// If there is not one mass for each joint.
    #[must_use]
    pub fn with_masses(&self, masses: &[Mass]) -> Self {
        assert_eq!(masses.len(), self.joints.len(), "masses of the joints");
        let mut arm = self.clone();
        arm.segments.iter_mut().zip(masses).for_each(|(segment, mass)| segment.mass = *mass);
        arm
    }

    pub(crate) fn segments(&self) -> &[Segment] {
        &self.segments
    }
}

/// The only link that no joint carries.
fn root<'a>(urdf: &'a Urdf, path: &Path) -> Result<&'a str, ArmError> {
    for (i, joint) in urdf.joints.iter().enumerate() {
        for link in [&joint.parent, &joint.child] {
            if !urdf.links.iter().any(|l| l.name == *link) {
                return Err(
                    joint_error(path, &joint.name, &format!("connects link {link:?}, which does not exist")).into()
                );
            }
        }
        if let Some(other) = urdf.joints[..i].iter().find(|other| other.child == joint.child) {
            let problem = format!("has two parent joints, {:?} and {:?}, expected a tree", other.name, joint.name);
            return Err(link_error(path, &joint.child, &problem).into());
        }
        if urdf.joints[..i].iter().any(|other| other.name == joint.name) {
            return Err(joint_error(path, &joint.name, "occurs twice, expected unique names").into());
        }
    }
    for (i, link) in urdf.links.iter().enumerate() {
        if urdf.links[..i].iter().any(|other| other.name == link.name) {
            return Err(link_error(path, &link.name, "occurs twice, expected unique names").into());
        }
    }
    let roots: Vec<&str> = urdf
        .links
        .iter()
        .map(|link| link.name.as_str())
        .filter(|name| !urdf.joints.iter().any(|joint| joint.child == *name))
        .collect();
    match roots.as_slice() {
        [root] => Ok(root),
        [] if urdf.links.is_empty() => {
            Err(ArmError::Arm { path: path.into(), problem: "has no links, expected those of an arm".into() })
        }
        [] => Err(link_error(
            path,
            urdf.links.first().map_or("", |link| &link.name),
            "moves in a loop of joints, expected a tree",
        )
        .into()),
        several => {
            let problem = format!("expected one root link, found {}: {}", several.len(), several.join(", "));
            Err(ArmError::Arm { path: path.into(), problem: whole_file::one_line(&problem, 400) })
        }
    }
}

fn moves(joint: &Joint) -> bool {
    matches!(joint.kind, JointKind::Revolute | JointKind::Continuous | JointKind::Prismatic) && joint.mimic.is_none()
}

fn named<'a>(urdf: &'a Urdf, path: &Path, names: &[String]) -> Result<Vec<&'a Joint>, ArmError> {
    let refuse = |problem: String| ArmError::Arm { path: path.into(), problem: whole_file::one_line(&problem, 500) };
    let mut found: Vec<&Joint> = Vec::new();
    for name in names {
        let Some(joint) = urdf.joints.iter().find(|joint| joint.name == *name) else {
            let known: Vec<&str> = urdf.joints.iter().filter(|j| moves(j)).map(|j| j.name.as_str()).collect();
            return Err(refuse(format!("joints has {name:?}: no such joint, expected some of {}", known.join(", "))));
        };
        if !moves(joint) {
            let what = if joint.mimic.is_some() { "one that follows another" } else { joint.kind.name() };
            return Err(joint_error(
                path,
                name,
                &format!("is {what}, expected revolute, continuous or prismatic in joints"),
            )
            .into());
        }
        if let Some(before) = found.last() {
            let above = path_to(urdf, path, &joint.child)?;
            if joint.name == before.name || !above.iter().any(|other| other.name == before.name) {
                return Err(refuse(format!(
                    "joint {name:?} does not move with {:?}, expected a serial chain, base first",
                    before.name
                )));
            }
        }
        found.push(joint);
    }
    Ok(found)
}

/// The chain with the most joints that turn, without what slides at its end: fingers. Where several end in fingers that turn, the chain up to where they part.
fn longest<'a>(urdf: &'a Urdf, path: &Path) -> Result<Vec<&'a Joint>, ArmError> {
    /// A chain with fewer joints before it parts is no arm with a hand.
    const FEWEST: usize = 4;
    let turning = |chain: &[&Joint]| chain.iter().filter(|joint| joint.kind != JointKind::Prismatic).count();
    let mut best: Vec<Vec<&Joint>> = Vec::new();
    for link in &urdf.links {
        let mut chain: Vec<&Joint> =
            path_to(urdf, path, &link.name)?.into_iter().filter(|joint| moves(joint)).collect();
        while chain.last().is_some_and(|joint| joint.kind == JointKind::Prismatic) && turning(&chain) > 0 {
            chain.pop();
        }
        let most = best.first().map_or(0, |chain| turning(chain));
        if turning(&chain) > most {
            best.clear();
        }
        let known =
            best.iter().any(|other| other.iter().map(|joint| &joint.name).eq(chain.iter().map(|joint| &joint.name)));
        if turning(&chain) >= most && !chain.is_empty() && !known {
            best.push(chain);
        }
    }
    let Some(first) = best.first() else { return Ok(Vec::new()) };
    let shared = |chain: &Vec<&Joint>| chain.iter().zip(first).take_while(|(a, b)| a.name == b.name).count();
    let common = best.iter().map(shared).min().unwrap_or(0);
    if best.len() > 1 && common < FEWEST {
        let end = |chain: &[&Joint]| chain.last().map_or("", |joint| &joint.name).to_owned();
        let problem = format!(
            "{} chains have {} joints, to {:?} and to {:?}: name the joints of the arm",
            best.len(),
            first.len(),
            end(first),
            end(&best[1])
        );
        return Err(ArmError::Arm { path: path.into(), problem: whole_file::one_line(&problem, 400) });
    }
    Ok(first[..common].to_vec())
}

/// The last link below `link` that fixed joints lead to, where they do not branch.
fn end_of<'a>(urdf: &'a Urdf, mut link: &'a str) -> &'a str {
    loop {
        let mut below = urdf.joints.iter().filter(|joint| joint.parent == link && joint.kind == JointKind::Fixed);
        match (below.next(), below.next()) {
            (Some(joint), None) => link = &joint.child,
            _ => return link,
        }
    }
}

fn check_mass(link: &urdf_file::Link, path: &Path) -> Result<(), ArmError> {
    let numbers = link.inertial.inertia.iter().chain(&link.inertial.origin.xyz).chain(&link.inertial.origin.rpy);
    let fine = link.inertial.mass_kg >= 0.0 && link.inertial.mass_kg <= 1e6 && numbers.clone().all(|v| v.abs() <= 1e9);
    if !fine {
        let problem = format!(
            "inertial has mass {} kg and inertia {:?}, expected a mass of 0 to 1e6 kg and finite numbers",
            link.inertial.mass_kg, link.inertial.inertia
        );
        return Err(link_error(path, &link.name, &problem).into());
    }
    Ok(())
}

/// What no arm weighs: numbers in other units, and masses that no body can have.
fn warn_of_masses(segments: &[Segment], joints: &[ArmJoint], notes: &mut Vec<String>) {
    /// The heaviest industrial arms weigh 10 t.
    const HEAVIEST_KG: f64 = 12_000.0;
    let total: f64 = segments.iter().map(|segment| segment.mass.mass_kg).sum();
    if total > HEAVIEST_KG {
        notes.push(format!("the moving links weigh {total:.0} kg together: are masses in grams?"));
    }
    for (segment, joint) in segments.iter().zip(joints) {
        let moments = segment.mass.central_kgm2().symmetric_eigenvalues();
        let (sum, most, least) = (moments.sum(), moments.max(), moments.min());
        if segment.mass.mass_kg > 0.0 && (least < -1e-9 * most.abs() || sum - most < most * (1.0 - 1e-6)) {
            notes.push(format!(
                "the inertia of what joint {:?} carries is that of no body: a principal moment exceeds the sum of the others",
                joint.name
            ));
        }
        if joint.upper.is_finite() && joint.upper - joint.lower > 40.0 && !joint.slides {
            notes.push(format!(
                "joint {:?} goes from {} to {} rad: are limits in degrees?",
                joint.name, joint.lower, joint.upper
            ));
        }
    }
}
