//! Whether the object rests on the table, and tool and object meet where it sets out and never lie in each other.

use measured_log::{Log, Shape};
use nalgebra::{Isometry3, Vector3};
use serde::Serialize;

use crate::motion::{Motion, Motions, Seen};
use crate::reading::Reading;
use crate::shape::Solid;

/// Clocks of tool and object differ by so much at most; the tool is looked for in this time about an onset, s.
const CLOCKS_SECS: f64 = 0.05;
/// What places, sizes and rims may be off by: in itself, m, and as a share of the object's smallest half length.
const TOLERANCE_M: f64 = 0.003;
const TOLERANCE_SHARE: f64 = 0.15;
/// How far an object at rest may be from lying on a face, rad.
const TILT_RAD: f64 = 0.1;
/// Onsets that suffice to judge by.
const LEAST_ONSETS: usize = 5;

/// Tolerances that the tool of an episode is away from the object if it has another frame than the others; the share of all that have to meet.
const ASTRAY: f64 = 5.0;
const MOST_MET: f64 = 0.7;
/// Other frames that an episode may have. Sizes and units that fit one episode alone do so by chance.
const FRAMES: [Reading; 8] = [
    Reading::TrackerTurned(1),
    Reading::TrackerTurned(2),
    Reading::TrackerTurned(3),
    Reading::Mirrored(0),
    Reading::Mirrored(1),
    Reading::PositionMirrored(0),
    Reading::PositionMirrored(1),
    Reading::PositionSwapped,
];

/// A tool: balls about its centre, m, base axes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tool {
    /// Centre and radius of each.
    pub(crate) balls: Vec<([f64; 3], f64)>,
}

/// How well a log fits together under a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Fit {
    /// Of the tool at the moments at which the object sets out; `None` where there are too few.
    pub touch: Option<Touch>,
    /// Of the object at rest; `None` where it never rests.
    pub rest: Option<Rest>,
}

/// The tool where the object sets out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Touch {
    /// Times that it sets out.
    pub onsets: usize,
    /// Share of them at which the tool touches it.
    pub met: f64,
    /// Median distance then, m: negative inside.
    pub distance_m: f64,
    /// Mean ln(1 + (e / tolerance)²) of these, and of the deepest rows of episodes.
    pub cost: f64,
}

/// The object at rest.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rest {
    /// Episodes in which it rests.
    pub episodes: usize,
    /// Median angle from lying on a face, rad.
    pub tilt_rad: f64,
    /// Median height of its lowest point above the table, m.
    pub height_m: f64,
    /// Mean ln(1 + (e / tolerance)²) of angle and height.
    pub cost: f64,
}

impl Fit {
    /// Smaller is better.
    #[must_use]
    pub fn cost(&self) -> f64 {
        self.touch.map_or(0.0, |touch| touch.cost) + self.rest.map_or(0.0, |rest| rest.cost)
    }
}

/// Signed distance of the tool from the object at a row under a reading, m.
pub(crate) fn distance_m(reading: Option<&Reading>, solid: &Solid, tool: &Tool, seen: &Seen, at: Vector3<f64>) -> f64 {
    between_m(solid, &posed(reading, solid, &seen.pose), tool, at)
}

/// Signed distance of the tool at a place from the object in a pose, m; infinite without a tool.
pub(crate) fn between_m(solid: &Solid, pose: &Isometry3<f64>, tool: &Tool, at: Vector3<f64>) -> f64 {
    let own = |(centre, radius_m): &([f64; 3], f64)| {
        solid.distance_m(&pose.inverse_transform_point(&(at + Vector3::from(*centre)).into()).coords) - radius_m
    };
    tool.balls.iter().map(own).fold(f64::INFINITY, f64::min)
}

/// A pose under a reading.
pub(crate) fn posed(reading: Option<&Reading>, solid: &Solid, pose: &Isometry3<f64>) -> Isometry3<f64> {
    reading.map_or(*pose, |reading| reading.pose(pose, solid.half_m()))
}

/// Shape and tool under a reading.
pub(crate) fn sized(reading: Option<&Reading>, shape: &Shape, tool: &Tool) -> (Solid, Tool) {
    let (mut shape, mut tool) = (shape.clone(), tool.clone());
    if let Some(reading) = reading {
        reading.shape(&mut shape);
        tool.balls.iter_mut().for_each(|(_, radius_m)| *radius_m = reading.tool_radius_m(*radius_m));
    }
    (Solid::new(&shape), tool)
}

/// How well a log fits together under a reading.
pub(crate) fn fit(reading: Option<&Reading>, log: &Log, tool: &Tool, motions: &Motions) -> Fit {
    let shape = &log.header.object.shape;
    let (solid, tool) = sized(reading, shape, tool);
    // By the sizes of the log: a reading does not widen what counts as a touch.
    let smallest = Solid::new(shape).half_m().into_iter().fold(f64::INFINITY, f64::min);
    let tolerance_m = (TOLERANCE_M + 2.0 * motions.position_m).max(TOLERANCE_SHARE * smallest);
    let table_m =
        if let Some(Reading::TableAt(height_m)) = reading { *height_m } else { log.header.table.height_m.mean() };
    Fit {
        touch: touch(reading, &solid, &tool, motions, tolerance_m),
        rest: rest(reading, &solid, motions, table_m, tolerance_m),
    }
}

/// An episode whose tool is elsewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Astray {
    pub(crate) id: u64,
    /// Where its object first sets out, s.
    pub(crate) secs: f64,
    /// How far the tool is from the object there, m.
    pub(crate) distance_m: f64,
    /// Under which it touches it.
    pub(crate) reading: Reading,
    /// Such episodes, and all in which the object sets out.
    pub(crate) count: usize,
    pub(crate) of: usize,
}

/// Episodes in which the tool is far from the object wherever it sets out, and touches it under a usual mistake, where it touches it in nearly all others.
pub(crate) fn astray(log: &Log, tool: &Tool, motions: &Motions) -> Option<Astray> {
    let smallest = Solid::new(&log.header.object.shape).half_m().into_iter().fold(f64::INFINITY, f64::min);
    let tolerance_m = (TOLERANCE_M + 2.0 * motions.position_m).max(TOLERANCE_SHARE * smallest);
    let distances = |reading: Option<&Reading>, episode: &Motion| -> Vec<f64> {
        let (solid, tool) = sized(reading, &log.header.object.shape, tool);
        let nearest = |onset: &usize| nearest_m(reading, &solid, &tool, &episode.seen, *onset);
        episode.onsets.iter().filter_map(nearest).map(f64::abs).collect()
    };
    let least = |distances: &[f64]| distances.iter().copied().min_by(f64::total_cmp);
    let all: Vec<(&Motion, f64)> =
        motions.episodes.iter().filter_map(|episode| Some((episode, least(&distances(None, episode))?))).collect();
    let met = all.iter().filter(|(_, distance_m)| *distance_m <= tolerance_m).count();
    // An object that something else moves has the frame of the others: only another reading tells.
    let told = |episode: &Motion| {
        // A touch once, and never far: where it sets out again, the moment is less sure.
        let fits = |reading: &Reading| {
            let distances = distances(Some(reading), episode);
            least(&distances).is_some_and(|distance_m| distance_m <= tolerance_m)
                && distances.iter().all(|distance_m| *distance_m <= 0.5 * ASTRAY * tolerance_m)
        };
        FRAMES.into_iter().find(fits)
    };
    let far: Vec<(&Motion, f64, Reading)> = all
        .iter()
        .filter(|(_, distance_m)| *distance_m > ASTRAY * tolerance_m)
        .filter_map(|&(episode, distance_m)| Some((episode, distance_m, told(episode)?)))
        .collect();
    let &(episode, distance_m, reading) = far.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let (id, secs) = (episode.id, episode.seen[episode.onsets[0]].secs);
    let known = met >= LEAST_ONSETS && met as f64 >= MOST_MET * all.len() as f64;
    known.then_some(Astray { id, secs, distance_m, reading, count: far.len(), of: all.len() })
}

/// Signed distance of the tool from the object as it sets out, m: of the moments nearby that which comes nearest to a touch, as the clocks are not known better.
fn nearest_m(reading: Option<&Reading>, solid: &Solid, tool: &Tool, seen: &[Seen], onset: usize) -> Option<f64> {
    let begun = &seen[onset];
    let near = |seen: &&Seen| (seen.secs - begun.secs).abs() <= CLOCKS_SECS;
    // The object has moved by no more than makes an onset.
    let around = seen.iter().filter(near).filter_map(|seen| Some(distance_m(reading, solid, tool, begun, seen.tool?)));
    around.min_by(|a, b| a.abs().total_cmp(&b.abs()))
}

fn cost(off: f64) -> f64 {
    off.powi(2).ln_1p()
}

fn mean(of: &[f64]) -> f64 {
    of.iter().sum::<f64>() / of.len() as f64
}

pub(crate) fn median(mut of: Vec<f64>) -> Option<f64> {
    of.sort_by(f64::total_cmp);
    of.get(of.len() / 2).copied()
}

fn touch(reading: Option<&Reading>, solid: &Solid, tool: &Tool, motions: &Motions, tolerance_m: f64) -> Option<Touch> {
    let (mut met, mut distances, mut costs, mut deep) = (0_u32, Vec::new(), Vec::new(), Vec::new());
    for episode in &motions.episodes {
        for onset in &episode.onsets {
            let Some(off) = nearest_m(reading, solid, tool, &episode.seen, *onset) else { continue };
            met += u32::from(off.abs() <= tolerance_m);
            distances.push(off);
            costs.push(cost(off / tolerance_m));
        }
        let inside = |seen: &Seen| Some(distance_m(reading, solid, tool, seen, seen.tool?));
        let mut all: Vec<f64> = episode.seen.iter().filter_map(inside).collect();
        if !all.is_empty() {
            all.sort_by(f64::total_cmp);
            // Not the deepest row: it may be an outlier.
            deep.push(cost(all[all.len() / 50].min(0.0) / tolerance_m));
        }
    }
    (distances.len() >= LEAST_ONSETS).then(|| Touch {
        onsets: distances.len(),
        met: f64::from(met) / distances.len() as f64,
        cost: mean(&costs) + mean(&deep),
        distance_m: median(distances).unwrap_or(0.0),
    })
}

fn rest(reading: Option<&Reading>, solid: &Solid, motions: &Motions, table_m: f64, tolerance_m: f64) -> Option<Rest> {
    let (mut tilts, mut heights, mut costs) = (Vec::new(), Vec::new(), Vec::new());
    for episode in &motions.episodes {
        let poses = episode.rests.iter().map(|index| posed(reading, solid, &episode.seen[*index].pose));
        let (tilt, height): (Vec<f64>, Vec<f64>) = poses
            .map(|pose| {
                let vertical = pose.rotation.inverse() * Vector3::z();
                // Without turns nobody knows how it lies: as flat as it can.
                let below_m = if motions.turns { solid.below_m(&vertical) } else { solid.half_m()[2] };
                (solid.tilt_rad(&vertical), pose.translation.vector.z - below_m - table_m)
            })
            .unzip();
        let (Some(tilt), Some(height)) = (median(tilt), median(height)) else { continue };
        costs.push(cost(tilt / TILT_RAD) + cost(height / tolerance_m));
        tilts.push(tilt);
        heights.push(height);
    }
    (!costs.is_empty()).then(|| Rest {
        episodes: costs.len(),
        cost: mean(&costs),
        tilt_rad: median(tilts).unwrap_or(0.0),
        height_m: median(heights).unwrap_or(0.0),
    })
}

/// The readings that rest and contact can tell.
pub(crate) fn readings(shape: &Shape, turns: bool) -> Vec<Reading> {
    let mut all = Vec::new();
    if turns {
        all.extend([Reading::Conjugate, Reading::RealFirst, Reading::ConjugateRealFirst]);
        all.extend([1, 3].map(Reading::BodyTurned));
    }
    all.extend([1, 2, 3].map(Reading::TrackerTurned));
    all.extend([0, 1].map(Reading::Mirrored));
    all.extend([0, 1].map(Reading::PositionMirrored));
    all.push(Reading::PositionSwapped);
    all.extend([1e-3, 1e-2, 0.1, 0.0254, 10.0, 100.0, 1e3].map(Reading::PositionScaled));
    match shape {
        Shape::Box { .. } => all.extend([(0, 1), (0, 2), (1, 2)].map(|(a, b)| Reading::LengthsSwapped(a, b))),
        Shape::Cylinder { .. } | Shape::Prism { .. } => all.extend([0.5, 2.0].map(Reading::RadiusScaled)),
        Shape::Sphere { .. } => {}
    }
    all.extend([0.5, 2.0, 0.1, 10.0].map(Reading::LengthsScaled));
    all.extend([0.5, 2.0, 0.1, 10.0].map(Reading::ToolRadiusScaled));
    all.extend([-1.0, 1.0].map(Reading::OriginAt));
    all
}
