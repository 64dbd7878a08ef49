//! The check of a log.

use measured_log::{Channel, Log, Shape};
use nalgebra::Vector3;
use physics_model::robot::{Robot, ToolShape};
use serde::Serialize;

use crate::arm;
use crate::arrival::{self, Followed};
use crate::geometry::{self, Fit, Tool};
use crate::motion::Motions;
use crate::sensors::{self, Clock, Sensor};
use crate::suspicion::{Kind, Suspicion};
use crate::wrench::{self, Contacts, Forces, Lever};
use crate::{Reading, shape::Solid};

/// What another reading has to lower the cost of a log by to be suspected, in units of [`Fit::cost`]. Chosen on simulated logs of four engines (seed 11) and their
/// corruptions; of good logs there none gains more than 0.75.
const GAIN: f64 = 1.0;
/// Cost above which a rule is broken.
const BROKEN: f64 = 0.5;
/// Readings within this of the best are as good.
const AS_GOOD: f64 = 0.1;
/// What the mean cosine of force and way out has to rise by, and to be at least; and in its standard errors.
const COSINE_GAIN: f64 = 0.5;
const LEAST_COSINE: f64 = 0.6;
const COSINE_ERRORS: f64 = 4.0;
/// Readings within this of each other are as good.
const COSINE_SAME: f64 = 0.02;
/// Forces that pull by this much are reversed, however much else turns them.
const LEAST_REVERSED: f64 = 0.2;
/// Share of onsets at which tool and object meet under the reading that is offered.
const MEETS: f64 = 0.75;
/// Forces of pushes are friction · weight within this factor; what rolls needs less.
const STRENGTH: f64 = 5.0;
/// A torque's lever beyond the tool's own reach, m, and the share of torques that it has to explain.
const LEVER_M: f64 = 0.02;
const LEVER_EXPLAINED: f64 = 0.8;
/// No wrist is so far from its tool, m: that is another unit.
const FAR_M: f64 = 1.0;
/// Share of onsets at which tool and object have to meet if no reading mends it.
const LEAST_MET: f64 = 0.25;
/// A known weight that is this many times the object's is asked about.
const HEAVY: f64 = 20.0;
/// Gravity at sea level, from the equator to the poles with a margin for heights, m/s².
const GRAVITY_MPS2: [f64; 2] = [9.76, 9.84];

/// What a log's own readings say.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Its sensors.
    pub sensors: Vec<Sensor>,
    /// When rows come.
    pub clock: Option<Clock>,
    /// How well poses and sizes fit together.
    pub fit: Fit,
    /// What forces show.
    pub forces: Option<Forces>,
    /// Whether motion follows the unevenness of stamps; `None` where nothing moves, or stamps are even.
    pub followed: Option<Followed>,
    /// Whether the object may roll: what rolls is pushed with any small force.
    pub may_roll: bool,
    /// What looks wrong.
    pub suspicions: Vec<Suspicion>,
    /// What this log cannot show.
    pub not_told: Vec<String>,
}

/// Checks a log. `arm`: the arm whose tool and joints it has.
#[must_use]
pub fn check(log: &Log, arm: Option<&Robot>) -> Check {
    let sensors = sensors::sensors(log);
    let clock = sensors::clock(log);
    let mut suspicions = header(log);
    suspicions.extend(arm.and_then(|arm| arm::suspicion(log, arm)));
    let tool = tool(log, arm);
    let width_m = 2.0 * Solid::new(&log.header.object.shape).half_m().into_iter().fold(f64::INFINITY, f64::min);
    let motions = Motions::new(log, width_m, |episode, row| arm::tool_m(log, arm, episode, row));
    let fit = geometry::fit(None, log, &tool, &motions);
    let (followed, may_roll) = (arrival::stamps_followed(log), motions.may_roll(&log.header.object.shape));
    let (geometry, mut not_told) = of_geometry(log, &tool, &motions, &fit);
    if geometry.is_none() {
        suspicions.extend(geometry::astray(log, &tool, &motions).map(of_astray));
    }
    let meant = geometry.as_ref().and_then(|suspicion| suspicion.readings.first().copied());
    let mass_kg = log.header.object.mass_kg.mean();
    suspicions.extend(sensors::suspicions(
        log,
        &sensors,
        clock.as_ref(),
        followed.as_ref(),
        &|index, secs, force_n| motions.is_blow(index, secs, force_n, mass_kg),
    ));
    suspicions.extend(geometry);
    let contacts = Contacts::new(meant.as_ref(), log, &tool, &motions);
    let forces = contacts.forces(None);
    let reach_m = tool.balls.iter().map(|(at, radius_m)| Vector3::from(*at).norm() + radius_m).fold(0.0, f64::max);
    let axes = of_axes(&contacts, forces);
    let turned = axes.is_some();
    suspicions.extend(axes);
    suspicions.extend(of_strength(forces, may_roll));
    if !turned {
        suspicions.extend(contacts.lever().and_then(|lever| of_lever(lever, reach_m)));
    }
    if forces.is_none() && log.has(Channel::WristForce(measured_log::Axis::X)) {
        not_told.push(
            "sign, axes and unit of the wrench: too few readings of forces where tool and object are known to touch"
                .into(),
        );
    }
    suspicions.sort_by_key(|suspicion| suspicion.kind);
    Check { sensors, clock, fit, forces, followed, may_roll, suspicions, not_told }
}

/// What touches: the ball of the log, or what of the hand can touch.
pub(crate) fn tool(log: &Log, arm: Option<&Robot>) -> Tool {
    let Some(arm) = arm else {
        return Tool { balls: log.header.tool_radius_m.map(|radius_m| ([0.0; 3], radius_m)).into_iter().collect() };
    };
    let turn = arm.tool_orientation();
    let placed = |at: [f64; 3]| -> [f64; 3] { (turn * Vector3::from(at)).into() };
    let balls = arm.tool_shapes().iter().flat_map(|shape| match *shape {
        ToolShape::Ball { center_m, radius_m } => vec![(placed(center_m), radius_m)],
        ToolShape::Capsule { a_m, b_m, radius_m } => {
            let along = |share: f64| std::array::from_fn(|i| a_m[i] + share * (b_m[i] - a_m[i]));
            (0..=8).map(|step| (placed(along(f64::from(step) / 8.0)), radius_m)).collect()
        }
    });
    Tool { balls: balls.collect() }
}

/// Numbers of the header that are asked about.
fn header(log: &Log) -> Vec<Suspicion> {
    let mut all = Vec::new();
    let gravity = log.header.gravity_mps2;
    if !(GRAVITY_MPS2[0]..=GRAVITY_MPS2[1]).contains(&gravity) {
        let found = format!("gravity_mps2 = {gravity}: on Earth it is 9.76 to 9.84.");
        all.push(Suspicion::new(Kind::Gravity, found, "It is in m/s², not in multiples of g."));
    }
    let heaviest = log.episodes.iter().filter_map(|episode| {
        let cells = episode.channels.get(&Channel::AddedMass)?;
        Some((cells.iter().flatten().fold(0.0, f64::max), episode.id))
    });
    let mass_kg = log.header.object.mass_kg.mean();
    if let Some((added_kg, episode)) = heaviest.max_by(|a, b| a.0.total_cmp(&b.0))
        && added_kg > HEAVY * mass_kg
    {
        let found = format!("added_mass_kg is {added_kg} in episode {episode}, on an object of {mass_kg} kg.");
        let mut suspicion =
            Suspicion::new(Kind::AddedMass, found, "It is in kg; grams would have to be divided by 1000.");
        suspicion.readings.push(Reading::AddedMassScaled(1e-3));
        all.push(suspicion);
    }
    all
}

/// What poses and sizes show, and what they cannot.
fn of_geometry(log: &Log, tool: &Tool, motions: &Motions, own: &Fit) -> (Option<Suspicion>, Vec<String>) {
    let mut candidates = geometry::readings(&log.header.object.shape, motions.turns);
    if let Some(rest) = own.rest {
        candidates.push(Reading::TableAt(log.header.table.height_m.mean() + rest.height_m));
    }
    let mut fits: Vec<(Reading, Fit)> =
        candidates.into_iter().map(|reading| (reading, geometry::fit(Some(&reading), log, tool, motions))).collect();
    let same = |(reading, fit): &&(Reading, Fit)| {
        (fit.cost() - own.cost()).abs() < AS_GOOD && !matches!(reading, Reading::TableAt(_))
    };
    let same: Vec<Reading> = fits.iter().filter(same).map(|(reading, _)| *reading).collect();
    let not_told = not_told(log, own, motions, &same);
    // A stable sort: of readings that are as good, the commonest mistake comes first.
    fits.sort_by(|a, b| a.1.cost().total_cmp(&b.1.cost()));
    let best = fits.first().map_or(own.cost(), |(_, fit)| fit.cost());
    if own.cost() - best < GAIN {
        return (lost(own), not_told);
    }
    if fits.first().and_then(|(_, fit)| fit.touch).is_some_and(|touch| touch.met < MEETS) {
        // Better is not good.
        return (Some(unexplained(own)), not_told);
    }
    let good: Vec<&(Reading, Fit)> = fits.iter().filter(|(_, fit)| fit.cost() < best + AS_GOOD).collect();
    let raised = good.iter().all(|(reading, _)| matches!(reading, Reading::TableAt(_) | Reading::OriginAt(_)));
    let found = match (own.rest, own.touch) {
        (Some(rest), _) if raised => format!(
            "At rest the object's lowest point is {:.1} mm {} the table.",
            1e3 * rest.height_m.abs(),
            if rest.height_m > 0.0 { "above" } else { "below" }
        ),
        (rest, touch) => broken(rest, touch),
    };
    let ways: Vec<String> = good.iter().take(3).map(|(reading, _)| reading.words()).collect();
    let then = good.first().and_then(|(_, fit)| fit.touch).filter(|_| !raised);
    let after = then
        .map(|touch| format!(": the tool then touches it in {:.0} % of the times that it sets out", 100.0 * touch.met));
    let mend = format!("It fits {}{}.", ways.join(", or "), after.unwrap_or_default());
    let mut suspicion = Suspicion::new(if raised { Kind::Height } else { Kind::Geometry }, found, &mend);
    suspicion.readings = good.iter().map(|(reading, _)| *reading).collect();
    suspicion.shown_at = motions.episodes.iter().find_map(|episode| {
        let seen = &episode.seen[*episode.onsets.first()?];
        Some((episode.id, seen.secs))
    });
    (Some(suspicion), not_told)
}

/// What rest and contact break, with numbers.
fn broken(rest: Option<geometry::Rest>, touch: Option<geometry::Touch>) -> String {
    let mut parts = Vec::new();
    if let Some(touch) = touch {
        let mm = 1e3 * touch.distance_m;
        let place = if mm < 0.0 { format!("{:.1} mm inside it", -mm) } else { format!("{mm:.1} mm away from it") };
        parts.push(format!(
            "where the object sets out ({} times) the tool touches it in {:.0} % of cases and is {place} in the median",
            touch.onsets,
            100.0 * touch.met
        ));
    }
    if let Some(rest) = rest.filter(|rest| rest.cost > BROKEN || touch.is_none()) {
        parts.push(format!(
            "at rest the object leans by {:.0}° from its nearest face, and its lowest point is {:.1} mm from the table",
            rest.tilt_rad.to_degrees(),
            1e3 * rest.height_m
        ));
    }
    format!("Object, tool and table do not fit together: {}.", parts.join("; "))
}

/// A log whose tool is not where the object sets out, and that no reading mends.
fn lost(own: &Fit) -> Option<Suspicion> {
    own.touch.filter(|touch| touch.met < LEAST_MET).map(|_| unexplained(own))
}

fn of_astray(astray: geometry::Astray) -> Suspicion {
    let geometry::Astray { id, secs, distance_m, reading, count, of } = astray;
    let others = match count {
        1 => String::new(),
        many => format!(" So it is in {} others.", many - 1),
    };
    let found = format!(
        "In episode {id} the tool is {:.0} mm from the object where that sets out, and it touches it in nearly all of the {of} episodes.{others}",
        1e3 * distance_m
    );
    let mend = format!("It fits {}: was it recorded otherwise than the others? Else take it out.", reading.words());
    let mut suspicion = Suspicion::new(Kind::Geometry, found, &mend);
    suspicion.shown_at = Some((id, secs));
    suspicion
}

fn unexplained(own: &Fit) -> Suspicion {
    let mend =
        "No usual mistake explains it. Check frames, clocks, sizes, and whether something else moves the object.";
    Suspicion::new(Kind::Geometry, broken(own.rest, own.touch), mend)
}

/// What poses and sizes cannot show in this log; `same`: readings that change nothing.
fn not_told(log: &Log, own: &Fit, motions: &Motions, same: &[Reading]) -> Vec<String> {
    let mut all = Vec::new();
    if own.touch.is_none() {
        all.push("frames and sizes: too few moments at which the object sets out beside a tool".into());
    } else {
        let words: Vec<String> =
            same.iter().map(|reading| reading.words().trim_start_matches("with ").to_owned()).collect();
        if !words.is_empty() {
            all.push(format!("these readings, which fit as well: {}", words.join("; ")));
        }
    }
    if !motions.turns && !matches!(log.header.object.shape, Shape::Sphere { .. }) {
        all.push("how the object is turned: it was not measured".into());
    }
    all
}

fn of_axes(contacts: &Contacts, own: Option<Forces>) -> Option<Suspicion> {
    let own = own?;
    let mut all: Vec<(Reading, Forces)> =
        wrench::axes().into_iter().filter_map(|reading| Some((reading, contacts.forces(Some(&reading))?))).collect();
    let best = all.iter().max_by(|a, b| a.1.cosine.total_cmp(&b.1.cosine))?.1;
    // Forces that pull where they should push have the wrong sign, whatever else turns them: another reading has to be better by far.
    let pull = own.cosine < -LEAST_REVERSED && own.cosine < -COSINE_ERRORS * own.error;
    let clear = best.cosine - own.cosine >= COSINE_GAIN.max(COSINE_ERRORS * own.error.hypot(best.error));
    if !(pull || clear && best.cosine >= LEAST_COSINE) {
        return None;
    }
    let margin = if pull { COSINE_GAIN } else { COSINE_SAME };
    // The order is that of how common they are.
    let (first, with) = *all.iter().find(|(_, forces)| forces.cosine > best.cosine - margin)?;
    all.retain(|(reading, forces)| *reading != first && forces.cosine > with.cosine - COSINE_SAME);
    let readings: Vec<Reading> = std::iter::once(first).chain(all.into_iter().map(|(reading, _)| reading)).collect();
    let ways: Vec<String> = readings.iter().take(3).map(Reading::words).collect();
    let mend = format!("It is {:.0}° {}.", angle(with.cosine), ways.join(", or "));
    let mut suspicion = Suspicion::new(Kind::WrenchAxes, aside(own), &mend);
    suspicion.readings = readings;
    Some(suspicion)
}

fn aside(own: Forces) -> String {
    format!(
        "Forces on the tool point {:.0}° away from where the object would push it, in {} episodes with contact.",
        angle(own.cosine),
        own.episodes
    )
}

fn angle(cosine: f64) -> f64 {
    cosine.clamp(-1.0, 1.0).acos().to_degrees()
}

/// `rolls`: what rolls is pushed with any small force.
fn of_strength(forces: Option<Forces>, rolls: bool) -> Option<Suspicion> {
    let strength = forces?.strength;
    if !(strength > 0.0 && strength < 1e7) {
        // Without gravity or friction there is nothing to compare with.
        return None;
    }
    if strength < STRENGTH && (rolls || strength > STRENGTH.recip()) {
        return None;
    }
    const FACTORS: [(f64, &str); 5] = [
        (9.81, "kilograms-force"),
        (4.448, "pounds-force"),
        (1e-3, "millinewtons"),
        (1e3, "kilonewtons"),
        (0.01, "hundredths of a newton"),
    ];
    let off = |factor: &f64| (factor * strength).ln().abs();
    let (factor, unit) = FACTORS.into_iter().min_by(|a, b| off(&a.0).total_cmp(&off(&b.0)))?;
    let found = format!(
        "Pushes take {strength:.3e} times the friction of the object on the table, by its mass, friction and gravity."
    );
    let mend = if off(&factor) < 0.5 * off(&1.0) {
        format!(
            "Are forces in {unit}, or is the mass, the added mass or the friction wrong by {:.0}?",
            factor.max(factor.recip())
        )
    } else {
        "Check the unit of forces, mass, added mass and friction.".into()
    };
    // Forces and masses cannot be told from each other: nothing is mended unasked.
    Some(Suspicion::new(Kind::ForceUnit, found, &mend))
}

fn of_lever(lever: Lever, reach_m: f64) -> Option<Suspicion> {
    let far = lever.length_m > FAR_M;
    if (lever.explained < LEVER_EXPLAINED && !far) || lever.length_m < reach_m + LEVER_M {
        return None;
    }
    let [x, y, z] = lever.at_m.map(|at| -at);
    let found = format!(
        "Torques are {:.0} mm times the force, the tool reaches {:.0} mm from its centre.",
        1e3 * lever.length_m,
        1e3 * reach_m
    );
    let (mend, reading) = if far {
        ("Are they in N·mm?".to_owned(), Reading::TorqueScaled(1e-3))
    } else {
        let mend =
            format!("They are about a point at ({x:.3}, {y:.3}, {z:.3}) m from the tool's centre, such as the wrist.");
        (mend, Reading::TorqueAbout(lever.at_m))
    };
    let mut suspicion = Suspicion::new(Kind::TorquePoint, found, &mend);
    suspicion.readings.push(reading);
    Some(suspicion)
}
