//! Which values of a world are believed: those that this arm's sensors could have measured.

use physics_model::feasible::check_theta;
use physics_model::{BodyState, ObjectShape, Theta};
use pomdp::{Purpose, Seed};
use push_task::sensor::observation_names;
use push_task::{Coordinates, Observation, Particle, State};
use scenario::Problem;

use super::WorldError;
use super::message::{Drawn, Place, wrong};

/// Beyond this an object is not on the table: the range of the published observation, ±m.
const POSITION_RANGE_M: f64 = 10.0;
/// No sensor of these arms says more: N, N·m or rad.
const READING_RANGE: f64 = 1e4;
/// How far the norm of a quaternion may be from 1.
const QUATERNION_TOLERANCE: f64 = 0.01;
/// How far encoders may report beyond the limits of a joint, rad.
const JOINT_TOLERANCE_RAD: f64 = 0.05;
/// Turns of a continuous joint that are believed, rad.
const JOINT_RANGE_RAD: f64 = 1000.0;
/// How far a body settles where it is put, m.
const STANDING_M: f64 = 0.005;
/// How far from `tool_start_m` the tool may start, in lengths of a move.
const START_TOLERANCE_MOVES: f64 = 1.0;

/// An observation with a unit quaternion of w ≥ 0.
pub(super) fn observation(
    request: &'static str,
    problem: &Problem,
    mut values: Vec<f64>,
) -> Result<Observation, WorldError> {
    let names = observation_names(problem.scenario.sensor.force, problem.model.joint_count());
    if values.len() != names.len() {
        let found = format!("expected {} values, found {}", names.len(), values.len());
        return Err(wrong(request, "observation", &found));
    }
    let pose = values.len() - 7;
    for (i, (value, name)) in values.iter().zip(&names).enumerate() {
        let limit = match i.checked_sub(pose) {
            None => READING_RANGE,
            Some(0..3) => POSITION_RANGE_M,
            Some(_) => 1.0 + QUATERNION_TOLERANCE,
        };
        // Also false for NaN.
        if !(-limit..=limit).contains(value) {
            let expectation = format!("expected {name} from -{limit} to {limit}, found {value}");
            return Err(wrong(request, &format!("observation[{i}]"), &expectation));
        }
    }
    let orientation = &mut values[pose + 3..];
    let norm = orientation.iter().map(|v| v * v).sum::<f64>().sqrt();
    if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
        let field = format!("observation[{}..{}]", pose + 3, pose + 7);
        return Err(wrong(request, &field, &format!("expected a unit quaternion x, y, z, w, found norm {norm}")));
    }
    let scale = if orientation[3] < 0.0 { -1.0 / norm } else { 1.0 / norm };
    for value in orientation {
        *value *= scale;
    }
    Ok(Observation(values))
}

/// Joint positions, rad: as reported, or those nearest to `near_rad` that bring the tool to where it is reported.
pub(super) fn joints(
    request: &'static str,
    problem: &Problem,
    near_rad: &[f64],
    joints_rad: Option<Vec<f64>>,
    tool_m: Option<[f64; 3]>,
) -> Result<Vec<f64>, WorldError> {
    let joints = match (joints_rad, tool_m) {
        (Some(joints), None) => joints,
        (None, Some(tool)) => {
            let inside = tool.iter().all(|v| (-POSITION_RANGE_M..=POSITION_RANGE_M).contains(v));
            let joints = if inside { problem.model.joints_for(near_rad, tool) } else { None };
            return joints.ok_or_else(|| {
                wrong(request, "tool_m", &format!("expected a point that the arm reaches, found {tool:?}"))
            });
        }
        (Some(_), Some(_)) => return Err(wrong(request, "tool_m", "expected joints_rad or tool_m, found both")),
        (None, None) => return Err(wrong(request, "joints_rad", "expected joints_rad or tool_m, found neither")),
    };
    let limits = problem.model.robot().limits();
    if joints.len() != limits.len() {
        let found = format!("expected {} values, found {}", limits.len(), joints.len());
        return Err(wrong(request, "joints_rad", &found));
    }
    for (j, (value, limit)) in joints.iter().zip(limits).enumerate() {
        let low = limit.lower_rad.max(-JOINT_RANGE_RAD) - JOINT_TOLERANCE_RAD;
        let high = limit.upper_rad.min(JOINT_RANGE_RAD) + JOINT_TOLERANCE_RAD;
        if !(low..=high).contains(value) {
            let expectation = format!("expected {low} to {high} rad, found {value}");
            return Err(wrong(request, &format!("joints_rad[{j}]"), &expectation));
        }
    }
    Ok(joints)
}

/// The tool must start where the task says, or every belief begins in another place.
pub(super) fn start(request: &'static str, problem: &Problem, joints_rad: &[f64]) -> Result<(), WorldError> {
    let task = &problem.scenario.task;
    let tool = problem.model.tool_position_m(joints_rad);
    let off_m = tool.iter().zip(task.tool_start_m).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt();
    let limit_m = START_TOLERANCE_MOVES * task.step_m;
    if off_m <= limit_m {
        return Ok(());
    }
    let expectation = format!("expected the tool within {limit_m} m of {:?}, found it at {tool:?}", task.tool_start_m);
    Err(wrong(request, "joints_rad", &expectation))
}

/// What the world says it has drawn, as a particle: for statistics of a belief. It has to be what `first`, the observation, shows.
pub(super) fn drawn(
    request: &'static str,
    problem: &Problem,
    (observation, joints_rad): (&Observation, &[f64]),
    has_obstacle: Option<bool>,
    answer: Drawn,
) -> Result<Particle, WorldError> {
    let Drawn { theta, object, obstacle } = answer;
    if !theta.effects.is_empty() {
        return Err(wrong(request, "drawn.theta.effects", "expected none"));
    }
    check_theta(&theta).map_err(|error| wrong(request, "drawn.theta", &error.to_string()))?;
    // Without sizes that its shapes do not have, and with the frame of a sphere that is taken here.
    let theta = Theta::from_parts(&theta.continuous(), theta.classes());
    let with = theta.obstacle.is_some();
    if obstacle.is_some() != with {
        return Err(wrong(request, "drawn.obstacle", "expected a place where theta has an obstacle, and only there"));
    }
    if let Some(said) = has_obstacle.filter(|said| *said != with) {
        return Err(wrong(request, "has_obstacle", &format!("expected {with}, as drawn.theta has it, found {said}")));
    }
    let table_m = problem.scenario.world.table_height_m;
    let body = |field: &str, place: &Place, shape: ObjectShape, size_m: [f64; 3]| {
        let Place { position_m: [x, y, z], yaw_rad } = *place;
        let height_m = table_m + shape.half_height_m(size_m);
        let inside = [x, y].iter().all(|v| (-POSITION_RANGE_M..=POSITION_RANGE_M).contains(v)) && yaw_rad.is_finite();
        if inside && (z - height_m).abs() <= STANDING_M {
            return Ok(BodyState::at_rest([x, y, z], yaw_rad));
        }
        let range = format!("expected a finite yaw and a position within {POSITION_RANGE_M} m");
        let found = format!("found {:?} and {yaw_rad} rad", place.position_m);
        Err(wrong(request, field, &format!("{range}, {height_m} m high as it stands on the table, {found}")))
    };
    let o = &theta.object;
    let object = body("drawn.object", &object, o.shape, o.size_m)?;
    let seen = observation.object_pose().0;
    let off_m = seen.iter().zip(object.position_m).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
    let limit_m = STANDING_M + 6.0 * problem.scenario.sensor.noise.position_m;
    if off_m > limit_m {
        let expectation = format!("expected the object within {limit_m} m of where it is observed, found {off_m} m");
        return Err(wrong(request, "drawn.object", &expectation));
    }
    let obstacle = theta.obstacle.as_ref().zip(obstacle);
    let obstacle = obstacle.map(|(o, place)| body("drawn.obstacle", &place, o.shape, o.size_m)).transpose()?;
    let [shape, class] = theta.classes();
    let drawn = Particle::new(State { joints_rad: joints_rad.to_vec(), object, obstacle }, theta);
    let (from, mut rng) = (&problem.worlds, Seed(0).stream(Purpose::Statistics, 0));
    let has_classes = from.object.shape[shape] > 0.0 && from.obstacle.shape[class] > 0.0;
    if !has_classes || Coordinates::new(&problem.model, from, joints_rad, observation).of(&drawn, &mut rng).is_none() {
        return Err(wrong(
            request,
            "drawn",
            "expected what the distribution of `hello` can give, found a value outside it",
        ));
    }
    Ok(drawn)
}
