//! What is seen of an episode: plain data. Lengths are in metres in the base frame of the robot.

use serde::{Deserialize, Serialize};

/// Version of the file.
pub const VERSION: u32 = 1;

/// An episode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EpisodeTrace {
    /// [`VERSION`].
    pub version: u32,
    /// What was played, in a line.
    pub title: String,
    /// Domain.
    pub domain: String,
    /// Arm.
    pub robot: String,
    /// Preset of belief and planner.
    pub preset: String,
    /// Method.
    pub method: String,
    /// Root seed.
    pub seed: u64,
    /// Number of the trial under that seed.
    pub trial: u32,
    /// Commit of the programs.
    pub commit: String,
    /// Where the object has to be brought.
    pub goal: Goal,
    /// Height of the table, m.
    pub table_height_m: f64,
    /// Parts of the tool.
    pub tool: Vec<ToolPart>,
    /// Before the first action, then after each one.
    pub moments: Vec<Moment>,
    /// Why it ended.
    pub reason: String,
    /// The object reached the goal.
    pub success: bool,
    /// Σ γ^t r_t.
    pub discounted_return: f64,
}

impl Default for EpisodeTrace {
    fn default() -> Self {
        Self {
            version: VERSION,
            title: String::new(),
            domain: String::new(),
            robot: String::new(),
            preset: String::new(),
            method: String::new(),
            seed: 0,
            trial: 0,
            commit: String::new(),
            goal: Goal::default(),
            table_height_m: 0.0,
            tool: Vec::new(),
            moments: Vec::new(),
            reason: String::new(),
            success: false,
            discounted_return: 0.0,
        }
    }
}

impl EpisodeTrace {
    /// Transitions simulated by the search, and by the updates of the belief; the latter `None` where the trace does not say.
    #[must_use]
    pub fn transitions(&self) -> (usize, Option<usize>) {
        let search = self.moments.iter().filter_map(|moment| moment.search.as_ref()).map(|s| s.transitions).sum();
        let updates: Vec<usize> = self.moments.iter().filter_map(|moment| moment.update_transitions).collect();
        (search, (!updates.is_empty()).then(|| updates.iter().sum()))
    }
}

/// A circle on the table.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    /// Centre x and y, m.
    pub center_m: [f64; 2],
    /// Radius, m.
    pub radius_m: f64,
}

/// All points within a radius of a segment, in the frame of the tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolPart {
    /// One end, m.
    pub from_m: [f64; 3],
    /// The other end, m; the same for a ball.
    pub to_m: [f64; 3],
    /// m.
    pub radius_m: f64,
}

/// What there is to see at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moment {
    /// Number of the action before it, 0 to 9; `None` before the first.
    pub action: Option<u8>,
    /// Reward for it.
    pub reward: Option<f64>,
    /// What happened in it, in words: a large force, a move out of reach, the obstacle touched.
    pub events: Vec<String>,
    /// Frames of the joints from the base on.
    pub joints: Vec<Pose>,
    /// Frame of the tool.
    pub tool: Pose,
    /// What is true, where the world says it.
    pub truth: Option<Scene>,
    /// What is believed; `None` where the method believes nothing.
    pub belief: Option<SeenBelief>,
    /// The search that chose the action before it.
    pub search: Option<SeenSearch>,
    /// Transitions simulated to learn from the action before it; absent in files of older versions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub update_transitions: Option<usize>,
}

/// A place and a direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// m.
    pub position_m: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub orientation: [f64; 4],
}

impl Pose {
    /// Where a point of this frame is, m, in the frame that it is placed in.
    #[must_use]
    pub fn point_m(&self, point_m: [f64; 3]) -> [f64; 3] {
        let [x, y, z, w] = self.orientation;
        let [a, b, c] = point_m;
        // v + 2 w (u × v) + 2 u × (u × v) with u = (x, y, z).
        let cross = [y * c - z * b, z * a - x * c, x * b - y * a];
        let twice = [y * cross[2] - z * cross[1], z * cross[0] - x * cross[2], x * cross[1] - y * cross[0]];
        std::array::from_fn(|i| self.position_m[i] + point_m[i] + 2.0 * (w * cross[i] + twice[i]))
    }
}

/// Object and obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// The object.
    pub object: Body,
    /// The obstacle, where there is one.
    pub obstacle: Option<Body>,
}

/// Shapes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BodyShape {
    /// Cuboid.
    Box,
    /// Upright cylinder.
    Cylinder,
    /// Sphere.
    Sphere,
}

impl BodyShape {
    /// All.
    pub const ALL: [Self; 3] = [Self::Box, Self::Cylinder, Self::Sphere];

    /// Name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Cylinder => "cylinder",
            Self::Sphere => "sphere",
        }
    }
}

/// A body in its place.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Body {
    /// Shape.
    pub shape: BodyShape,
    /// Half extents, m, along the axes of the body.
    pub half_m: [f64; 3],
    /// Where.
    pub pose: Pose,
}

impl Body {
    /// Its outline from above: x and y, m; the first point again at the end.
    #[must_use]
    pub fn footprint_m(&self) -> Vec<(f64, f64)> {
        const CIRCLE: usize = 24;
        let rotated = |[a, b]: [f64; 2]| {
            let [x, y, _] = self.pose.point_m([a, b, 0.0]);
            (x, y)
        };
        let [a, b, _] = self.half_m;
        let circle = |i: usize| {
            let angle = std::f64::consts::TAU * i as f64 / CIRCLE as f64;
            [a * angle.cos(), a * angle.sin()]
        };
        match self.shape {
            BodyShape::Box => [[-a, -b], [a, -b], [a, b], [-a, b], [-a, -b]].map(rotated).to_vec(),
            BodyShape::Cylinder => (0..=CIRCLE).map(circle).map(rotated).collect(),
            // However it has rolled.
            BodyShape::Sphere => {
                let [x, y, _] = self.pose.position_m;
                (0..=CIRCLE).map(circle).map(|[dx, dy]| (x + dx, y + dy)).collect()
            }
        }
    }
}

/// A belief.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenBelief {
    /// Number of particles.
    pub particles: usize,
    /// (Σw)² / Σw².
    pub effective_sample_size: f64,
    /// Probabilities of the object's shapes, in the order of [`BodyShape::ALL`].
    pub shape_probability: [f64; 3],
    /// Probability that there is an obstacle.
    pub obstacle_probability: f64,
    /// Parameters.
    pub parameters: Vec<SeenParameter>,
    /// Particles drawn by weight: each stands for as much probability as any other.
    pub ghosts: Vec<Ghost>,
}

/// A drawn particle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ghost {
    /// The scene in it.
    pub scene: Scene,
    /// Coefficient of friction.
    pub friction: f64,
    /// Mass of the object, kg.
    pub mass_kg: f64,
}

/// What is believed of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenParameter {
    /// Name.
    pub name: String,
    /// Unit; empty for none.
    pub unit: String,
    /// 5 % of the belief lie below.
    pub low: f64,
    /// Half of it.
    pub median: f64,
    /// 95 % of it.
    pub high: f64,
    /// What is true, where the world says it.
    pub truth: Option<f64>,
}

/// A search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeenSearch {
    /// Simulations.
    pub simulations: usize,
    /// Transitions of the model.
    pub transitions: usize,
    /// Deepest node.
    pub depth: usize,
    /// Nodes of the tree.
    pub nodes: usize,
    /// Statistics of the root, by action.
    pub actions: Vec<RootAction>,
}

/// An action at the root of the tree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RootAction {
    /// Visits.
    pub visits: u64,
    /// Mean discounted return.
    pub value: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn footprints_turn_with_their_bodies() {
        let (sin, cos) = (std::f64::consts::FRAC_PI_4.sin(), std::f64::consts::FRAC_PI_4.cos());
        let pose = Pose { position_m: [1.0, 2.0, 0.1], orientation: [0.0, 0.0, sin, cos] };
        let body = Body { shape: BodyShape::Box, half_m: [0.3, 0.1, 0.1], pose };
        // A quarter turn: the long side is along y.
        let corner = body.footprint_m()[2];
        assert!((corner.0 - 0.9).abs() < 1e-12 && (corner.1 - 2.3).abs() < 1e-12, "{corner:?}");
        let disc = Body { shape: BodyShape::Cylinder, half_m: [0.3, 0.3, 0.1], ..body }.footprint_m();
        assert!(disc.iter().all(|(x, y)| ((x - 1.0).hypot(y - 2.0) - 0.3).abs() < 1e-12));
        let rolled = Pose { orientation: [sin, 0.0, 0.0, cos], ..pose };
        let ball = Body { shape: BodyShape::Sphere, half_m: [0.3; 3], pose: rolled }.footprint_m();
        assert!(ball.iter().all(|(x, y)| ((x - 1.0).hypot(y - 2.0) - 0.3).abs() < 1e-12), "round from everywhere");
    }
}
