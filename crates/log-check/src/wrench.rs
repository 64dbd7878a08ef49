//! Whether forces push the tool away from the object, as strongly as the object resists, and whether torques are about the tool's centre.

use measured_log::{Channel, Log};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use serde::Serialize;

use crate::geometry::{Tool, distance_m, sized};
use crate::motion::{Motions, vector};
use crate::reading::Reading;

/// Forces that count: of the larger ones this share.
const STRONG_SHARE: f64 = 0.2;
/// Rows of an episode that suffice to judge by.
const LEAST_ROWS: usize = 5;

/// What forces show.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Forces {
    /// Episodes with forces in contact.
    pub episodes: usize,
    /// Mean cosine between the force on the tool and the way out of the object: 1 for pushes without friction.
    pub cosine: f64,
    /// Standard error of it over the episodes.
    pub error: f64,
    /// Median of horizontal force by friction · weight.
    pub strength: f64,
}

/// A row in contact: force, torque, way out of the object, and weight on the table times its friction, N.
struct Row {
    force: Vector3<f64>,
    torque: Option<Vector3<f64>>,
    outward: Vector3<f64>,
    resistance_n: f64,
}

/// Rows in contact, an episode each.
pub(crate) struct Contacts(Vec<Vec<Row>>);

impl Contacts {
    /// Of a log whose poses and sizes are taken under a reading.
    pub(crate) fn new(reading: Option<&Reading>, log: &Log, tool: &Tool, motions: &Motions) -> Self {
        let (solid, tool) = sized(reading, &log.header.object.shape, tool);
        let smallest = solid.half_m().into_iter().fold(f64::INFINITY, f64::min);
        let rows = |index: usize| -> Vec<Row> {
            let (episode, motion) = (&log.episodes[index], &motions.episodes[index]);
            motion
                .seen
                .iter()
                .filter_map(|seen| {
                    let at = seen.tool?;
                    let force = vector(episode, Channel::WristForce, seen.row)?;
                    (distance_m(reading, &solid, &tool, seen, at) < smallest).then_some(())?;
                    let pose = crate::geometry::posed(reading, &solid, &seen.pose);
                    let own = pose.inverse_transform_point(&at.into()).coords;
                    let mass_kg =
                        log.header.object.mass_kg.mean() + episode.get(Channel::AddedMass, seen.row).unwrap_or(0.0);
                    Some(Row {
                        force,
                        torque: vector(episode, Channel::WristTorque, seen.row),
                        outward: pose.rotation * solid.outward(&own),
                        resistance_n: log.header.table.friction.mean() * mass_kg * log.header.gravity_mps2,
                    })
                })
                .collect()
        };
        let all: Vec<Vec<Row>> = (0..log.episodes.len()).map(rows).collect();
        let mut sizes: Vec<f64> = all.iter().flatten().map(|row| row.force.norm()).collect();
        sizes.sort_by(f64::total_cmp);
        // A tenth are stronger than that; what is far weaker is noise, or no contact.
        let strong = STRONG_SHARE * sizes.get(sizes.len() * 9 / 10).copied().unwrap_or(0.0);
        let keep = |rows: Vec<Row>| rows.into_iter().filter(|row| row.force.norm() > strong).collect();
        Self(all.into_iter().map(keep).filter(|rows: &Vec<Row>| rows.len() >= LEAST_ROWS).collect())
    }

    /// What forces show under a reading; `None` where fewer than two episodes have any.
    pub(crate) fn forces(&self, reading: Option<&Reading>) -> Option<Forces> {
        let taken = |row: &Row| reading.map_or(row.force, |reading| reading.wrench(row.force, Vector3::zeros()).0);
        let of_episode = |rows: &Vec<Row>| {
            rows.iter().map(|row| taken(row).normalize().dot(&row.outward)).sum::<f64>() / rows.len() as f64
        };
        let cosines: Vec<f64> = self.0.iter().map(of_episode).collect();
        let count = cosines.len();
        let mean = cosines.iter().sum::<f64>() / count as f64;
        let variance = cosines.iter().map(|cosine| (cosine - mean).powi(2)).sum::<f64>() / (count as f64 - 1.0);
        let mut strengths: Vec<f64> =
            self.0.iter().flatten().map(|row| taken(row).xy().norm() / row.resistance_n.max(1e-9)).collect();
        strengths.sort_by(f64::total_cmp);
        (count >= 2).then(|| Forces {
            episodes: count,
            cosine: mean,
            error: (variance / count as f64).sqrt(),
            strength: strengths[strengths.len() / 2],
        })
    }

    /// The point about which torques are, m from the tool centre, by T = r × F; with the share of their square that it explains, and the median of |T| / |F|, m.
    pub(crate) fn lever(&self) -> Option<Lever> {
        let rows: Vec<(&Row, Vector3<f64>)> =
            self.0.iter().flatten().filter_map(|row| Some((row, row.torque?))).collect();
        if rows.len() < LEAST_ROWS {
            return None;
        }
        // r × F = −[F]ₓ r
        let mut design = DMatrix::zeros(3 * rows.len(), 3);
        let mut torques = DVector::zeros(3 * rows.len());
        for (i, (row, torque)) in rows.iter().enumerate() {
            let f = row.force;
            let cross = Matrix3::new(0.0, f.z, -f.y, -f.z, 0.0, f.x, f.y, -f.x, 0.0);
            design.fixed_view_mut::<3, 3>(3 * i, 0).copy_from(&cross);
            torques.fixed_rows_mut::<3>(3 * i).copy_from(torque);
        }
        let arm = (design.transpose() * &design).try_inverse()? * design.transpose() * &torques;
        let left = (&torques - &design * &arm).norm_squared() / torques.norm_squared().max(f64::MIN_POSITIVE);
        let mut lengths: Vec<f64> = rows.iter().map(|(row, torque)| torque.norm() / row.force.norm()).collect();
        lengths.sort_by(f64::total_cmp);
        Some(Lever { at_m: [arm[0], arm[1], arm[2]], explained: 1.0 - left, length_m: lengths[lengths.len() / 2] })
    }
}

/// About which point torques are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lever {
    /// From the tool centre, m.
    pub at_m: [f64; 3],
    /// Share of the torques' square that it explains.
    pub explained: f64,
    /// Median of |T| / |F|, m.
    pub length_m: f64,
}

/// All ways of naming and counting three axes but the log's own.
pub(crate) fn axes() -> Vec<Reading> {
    let orders: [[u8; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    // Reversed, and a hand that points down, first: the commonest.
    let signs: [[i8; 3]; 8] =
        [[-1, -1, -1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1], [1, 1, 1]];
    let all = orders
        .iter()
        .flat_map(|order| signs.iter().map(move |sign| std::array::from_fn::<(u8, i8), 3, _>(|i| (order[i], sign[i]))));
    let mut all: Vec<[(u8, i8); 3]> = all.filter(|axes| *axes != [(0, 1), (1, 1), (2, 1)]).collect();
    // The reaction, then what a frame can be turned to, then what only a slip of the pen makes.
    all.sort_by_key(|axes| if *axes == REVERSED { 0 } else { 2 - u8::from(is_turn(axes)) });
    all.into_iter().map(Reading::Wrench).collect()
}

/// What the tool exerts on the world.
const REVERSED: [(u8, i8); 3] = [(0, -1), (1, -1), (2, -1)];

/// Whether axes are right-handed.
fn is_turn(axes: &[(u8, i8); 3]) -> bool {
    let even = matches!(axes.map(|(axis, _)| axis), [0, 1, 2] | [1, 2, 0] | [2, 0, 1]);
    let signs: i8 = axes.iter().map(|(_, sign)| sign).product();
    even == (signs > 0)
}
