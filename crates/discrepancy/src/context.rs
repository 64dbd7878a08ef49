//! What is known of a log before any effect is tried.

use std::collections::BTreeSet;

use measured_log::{Channel, Episode, Log};
use physics_model::effect;
use physics_model::{EffectConfig, ObjectShape, ObjectTheta};
use rayon::prelude::*;

use crate::candidate::Context;
use crate::fit::Fit;
use crate::likelihood::explained;
use crate::noise::NoiseLevels;
use crate::obstacle::{self, Outlines, Place, distance};
use crate::patch;
use crate::simulator::Nudge;
use crate::study::Study;
use crate::trial::{Kind, Trial};

/// Places that are tried for what is tied to one.
const PLACES: usize = 6;
/// How far apart, m, they are at least, and how far the object moves before it is looked at again.
const APART_M: f64 = 0.03;
const MOVED_M: f64 = 0.01;
/// Places that are tried for an obstacle.
const OBSTACLES: usize = 5;
/// The same for a patch.
const PATCHES: usize = 4;

/// Where the object went and what the log has.
pub(crate) fn context(study: &Study, null: &Fit, log: &Log, noise: &NoiseLevels) -> Context {
    let nominal = study.simulator.nominal;
    let engine = nominal.engine();
    let (world, theta) = nominal.rig(&null.x, &engine).nominal(&nominal.object(&null.x, 0.0, &engine));
    // A friction that a model file has is what another one would take the place of.
    let effects: Vec<_> = nominal.effects.iter().map(EffectConfig::build).collect();
    let (world, theta) = match effect::Nominal::with_effects(&world, &theta, &effects) {
        Some(with) => (with.world, with.theta),
        None => (world, theta),
    };
    let has = |kind: Kind| noise.of(kind).is_some();
    let mut path: Vec<[f64; 2]> = Vec::new();
    let mut forces_n: Vec<f64> = Vec::new();
    // Held-out episodes have no say.
    let ids: BTreeSet<u64> = study.chosen.iter().map(|index| study.simulator.trials[*index].id).collect();
    let fitted = || log.episodes.iter().filter(|episode| ids.contains(&episode.id));
    for episode in fitted() {
        for row in 0..episode.rows() {
            if let Some([x, y, _]) = episode.vector(Channel::ObjectPosition, row)
                && path.last().is_none_or(|last| distance(*last, [x, y]) > MOVED_M)
            {
                path.push([x, y]);
            }
            if let Some(f) = episode.vector(Channel::WristForce, row) {
                forces_n.push(f.iter().map(|v| v * v).sum::<f64>().sqrt());
            }
        }
    }
    // Nothing that stands in the way is looked for where nothing pushes, and no forces tell of a patch.
    let (obstacles_m, patches_m) =
        if nominal.has_tool() { placed(study, null, &theta.object) } else { Default::default() };
    Context {
        world,
        theta,
        places_m: centres(&path, PLACES),
        obstacles_m,
        patches_m,
        largest_force_n: forces_n.iter().copied().fold(0.0, f64::max),
        usual_force_n: quantile(forces_n, 0.99),
        usual_speed_mps: quantile(fitted().flat_map(speeds_mps).collect(), 0.95),
        tool: nominal.has_tool(),
        outline: matches!(nominal.header().object.shape, measured_log::Shape::Prism { .. }),
        forces: has(Kind::WristForce) || has(Kind::JointTorque),
        joints: has(Kind::JointPosition) || (nominal.joints() > 0 && has(Kind::ToolPosition)),
        wrist_torques: has(Kind::WristTorque),
        joint_torques: has(Kind::JointTorque),
    }
}

/// Below which a share of values lies; 0 without any.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get((share * values.len() as f64) as usize).or(values.last()).copied().unwrap_or(0.0)
}

/// Time, s, over which a speed is looked at: a sensor's noise is no motion.
const SPEED_SECS: f64 = 0.1;

/// Mean speeds of the object, m/s, in such times, one after another.
fn speeds_mps(episode: &Episode) -> Vec<f64> {
    let mut last: Option<(f64, [f64; 3])> = None;
    let mut speeds = Vec::new();
    for (row, time) in episode.time_secs.iter().enumerate() {
        let Some(place) = episode.vector(Channel::ObjectPosition, row) else { continue };
        match last {
            Some((begun, from)) if time - begun >= SPEED_SECS => {
                let way = from.iter().zip(place).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt();
                speeds.push(way / (time - begun));
                last = Some((*time, place));
            }
            None => last = Some((*time, place)),
            Some(_) => {}
        }
    }
    speeds
}

/// Farthest-point centres of a cloud of points.
fn centres(points: &[[f64; 2]], count: usize) -> Vec<[f64; 2]> {
    let Some(first) = points.first() else { return Vec::new() };
    let mut centres = vec![*first];
    while centres.len() < count {
        let nearest = |p: &[f64; 2]| centres.iter().map(|c| distance(*p, *c)).fold(f64::INFINITY, f64::min);
        let farthest = points.iter().max_by(|a, b| nearest(a).total_cmp(&nearest(b)));
        match farthest {
            Some(point) if nearest(point) > APART_M => centres.push(*point),
            _ => break,
        }
    }
    centres
}

/// Places at which something may stand in the way, and where the table may be rougher or smoother.
fn placed(study: &Study, null: &Fit, object: &ObjectTheta) -> (Vec<Place>, Vec<Place>) {
    let simulator = study.simulator;
    let hypothesis = null.model.hypothesis(&null.x);
    let simulate = |trial| simulator.readings(&hypothesis, &simulator.nominal.engine(), Nudge::default(), trial).1;
    let fitted = || study.chosen.par_iter().map(|index| &simulator.trials[*index]);
    let courses: Vec<(&Trial, Vec<_>)> = fitted().map(|trial| (trial, simulate(trial))).collect();
    let [x, y, _] = object.size_m;
    let outlines = Outlines {
        sides_m: (object.shape == ObjectShape::Box).then_some([0.5 * x, 0.5 * y]),
        object_m: object.shape.footprint_radius_m(object.size_m),
        tool_m: simulator.nominal.header().tool_radius_m.unwrap_or(0.0),
    };
    let seen = obstacle::Seen::new(&courses, outlines);
    let mut obstacles_m = seen.places(OBSTACLES);
    // A body in the way leaves most episodes as they are.
    let untouched = null.residuals.iter().filter(|residuals| explained(residuals)).count();
    if 2 * untouched >= null.residuals.len()
        && let Some(likeliest) = obstacles_m.first_mut()
    {
        *likeliest = obstacle::refined_place(study, null, &seen, *likeliest).unwrap_or(*likeliest);
    }
    (obstacles_m, patch::places(&courses, outlines, PATCHES))
}
