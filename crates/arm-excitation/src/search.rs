//! The motion that tells most.

use arm_dynamics::{Arm, GRAVITY};
use basin::{CmaEs, CostFunction, DenseMatrix, Executor, PopulationProgress};
use pomdp::{Purpose, Rng, Seed};
use rand::RngExt as _;
use rand_distr::{Distribution as _, StandardNormal};

use crate::Error;
use crate::information::{Question, Spread, Unknowns, Usual};
use crate::motion::{Motion, NUMBERS, RATE, Room, Sample};
use crate::room::Rods;

/// Times at which collisions and torques are looked at, per second: a link that goes 1 m/s moves 5 cm between two of them.
const GRID_HZ: f64 = 20.0;
/// Random series that the best start is taken of, and that the result is compared with.
const STARTS: usize = 64;
/// How much smaller random series are at most: by a factor of about exp of that.
const WIDE: f64 = 6.0;
/// Share of a joint's strongest torque that a motion may ask for.
const EFFORT: f64 = 0.8;
/// Least cost of a motion that breaks a limit: more than any log can tell, so that every motion that keeps the limits is better.
const BROKEN: f64 = 1e6;
/// Excess that is none.
const NOTHING: f64 = 1e-4;

/// What is wanted.
#[derive(Clone, Debug)]
pub struct Settings {
    /// What a log should tell.
    pub question: Question,
    /// Length of the motion, s.
    pub seconds: f64,
    /// Share of the fastest rate of each joint that is used, above 0 and at most 1.
    pub speed: f64,
    /// Radius of the links, m.
    pub radius_m: f64,
    /// Height below which nothing may come, m in the base frame; none where there is no floor.
    pub floor_m: Option<f64>,
    /// Motions that are tried.
    pub tries: usize,
    /// Of all that is drawn.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        let (question, seconds, speed) = (Question::All, 20.0, 0.5);
        Self { question, seconds, speed, radius_m: 0.06, floor_m: Some(0.0), tries: 2000, seed: 1 }
    }
}

/// The motion that was found.
#[derive(Clone, Debug)]
pub struct Excitation {
    /// Positions, rates and accelerations.
    pub motion: Motion,
    /// Expected information about what was asked, nats.
    pub nats: f64,
    /// The same of random series, from wide to small ones, that keep the limits; sorted.
    pub random_nats: Vec<f64>,
    /// Their median; none where there is none.
    pub random_median: Option<f64>,
    /// Random series that were tried.
    pub random: usize,
    /// How well each number would be known.
    pub spreads: Vec<Spread>,
    /// What was assumed, a sentence each.
    pub notes: Vec<String>,
}

struct Task<'a> {
    arm: &'a Arm,
    settings: &'a Settings,
    rooms: Vec<Room>,
    rods: Rods,
    unknowns: Unknowns<'a>,
}

/// The motion whose log tells most of what `settings` ask. `note` hears of progress: motions tried, of how many, and the most
/// nats of one that keeps the limits.
///
/// # Errors
///
/// [`Error::Setting`] where a setting is outside its limits; [`Error::Limits`] where no motion was found that keeps them.
pub fn excitation(
    arm: &Arm,
    settings: &Settings,
    note: impl Fn(usize, usize, Option<f64>),
) -> Result<Excitation, Error> {
    settings.check()?;
    if let Some(joint) = arm.joints().iter().find(|joint| joint.slides && !(joint.upper - joint.lower).is_finite()) {
        return Err(Error::Setting(format!(
            "joint {:?} slides without limits, expected limits in the file",
            joint.name
        )));
    }
    if arm.masses().all(|mass| mass.mass_kg <= 0.0) {
        return Err(Error::Setting("the arm has no mass in the file, expected masses of its links".into()));
    }
    let mut rng = Seed(settings.seed).stream(Purpose::Exploration, 0);
    let task = Task::new(arm, settings, &mut rng);
    let count = NUMBERS * arm.joints().len();
    let drawn: Vec<(f64, Vec<f64>)> = (0..STARTS)
        .map(|_| {
            let mut numbers: Vec<f64> = (0..count).map(|_| StandardNormal.sample(&mut rng)).collect();
            // From wide motions to small ones, anywhere: a wide one seldom keeps clear of everything.
            let wide = WIDE * rng.random::<f64>();
            for joint in numbers.chunks_mut(NUMBERS) {
                joint[NUMBERS - 2] -= wide;
                joint[NUMBERS - 1] *= 2.0;
            }
            (task.cost(&numbers), numbers)
        })
        .collect();
    let mut random_nats: Vec<f64> = drawn.iter().map(|(cost, _)| -cost).filter(|nats| *nats > -BROKEN).collect();
    let random_median = statistics::quantile(&mut random_nats, 0.5);
    let first = drawn.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let (mut least, mut best) = first.unwrap_or((f64::INFINITY, vec![0.0; count]));
    let most = |least: f64| if least < BROKEN { Some(-least) } else { None };
    note(STARTS, settings.tries.max(STARTS), most(least));
    let generation = CmaEs::<Vec<f64>, DenseMatrix>::default_lambda(count) as u64;
    let rest = settings.tries.saturating_sub(STARTS) as u64 / generation;
    if rest > 0 {
        let solver = CmaEs::<_, DenseMatrix>::new(rng.random(), 0.3);
        let found = Executor::new(&task, solver, PopulationProgress::from_point(best.clone())).max_iter(rest).run();
        let found = found.unwrap_or_else(|never| match never {});
        if found.best_cost() < least {
            (least, best) = (found.best_cost(), found.best_param().clone());
        }
        note(settings.tries, settings.tries, most(least));
    }
    let motion = task.motion(&best);
    if least >= BROKEN {
        return Err(Error::Limits { seconds: settings.seconds, why: task.why(&motion) });
    }
    let spreads = task.unknowns.spreads(&motion);
    let notes = task.notes();
    Ok(Excitation { nats: -least, random_nats, random_median, random: STARTS, spreads, motion, notes })
}

impl Settings {
    /// Whether all values are within their limits.
    ///
    /// # Errors
    ///
    /// [`Error::Setting`], naming the first value that is not.
    pub fn check(&self) -> Result<(), Error> {
        let within = |name: &str, value: f64, low: f64, high: f64| {
            let inside = (low..=high).contains(&value);
            inside.then_some(()).ok_or_else(|| Error::Setting(format!("--{name} is {value}, expected {low} to {high}")))
        };
        within("seconds", self.seconds, 1.0, 600.0)?;
        within("speed", self.speed, 0.01, 1.0)?;
        within("radius", self.radius_m, 0.0, 1.0)?;
        within("floor", self.floor_m.unwrap_or(0.0), -10.0, 10.0)?;
        within("tries", self.tries as f64, STARTS as f64, 1e6)
    }
}

impl<'a> Task<'a> {
    fn new(arm: &'a Arm, settings: &'a Settings, rng: &mut Rng) -> Self {
        let rooms = Room::of(arm, settings.speed);
        let posture = |rng: &mut Rng| -> Vec<f64> {
            rooms.iter().map(|room| room.lower + (room.upper - room.lower).max(0.0) * rng.random::<f64>()).collect()
        };
        let postures: Vec<Vec<f64>> = (0..64).map(|_| posture(rng)).collect();
        let usual = usual(arm, settings.speed, &rooms, &postures);
        let rods = Rods::new(arm, settings.radius_m, settings.floor_m, postures.into_iter());
        let unknowns = Unknowns::new(arm, usual, settings.question);
        Self { arm, settings, rooms, rods, unknowns }
    }

    fn motion(&self, numbers: &[f64]) -> Motion {
        Motion::of(numbers, &self.rooms, self.settings.seconds)
    }

    /// Torques beyond what motors can, in units of that, and rods that meet, in units of their radius; the mean over the motion.
    fn excess(&self, motion: &Motion) -> f64 {
        let (torque, room) = self.excesses(motion);
        torque + room
    }

    fn excesses(&self, motion: &Motion) -> (f64, f64) {
        let (mut torque, mut room) = (0.0, 0.0);
        let grid = (GRID_HZ * motion.seconds()).ceil();
        for i in 0..grid as usize {
            let samples = motion.at((i as f64 + 0.5) * motion.seconds() / grid);
            let each = |pick: fn(&Sample) -> f64| samples.iter().map(pick).collect::<Vec<f64>>();
            let q = each(|sample| sample.position);
            let torques = self.arm.inverse_dynamics(&q, &each(|s| s.rate), &each(|s| s.acceleration), &GRAVITY);
            for ((joint, sample), own) in self.arm.joints().iter().zip(&samples).zip(&torques) {
                if joint.effort.is_finite() && joint.effort > 0.0 {
                    let most = own.abs() + joint.friction + joint.damping * sample.rate.abs();
                    torque += (most / joint.effort - EFFORT).max(0.0);
                }
            }
            room += self.rods.overlap(self.arm, &q) / self.settings.radius_m.max(0.01);
        }
        (torque / grid, room / grid)
    }

    /// What the file does not say, and which rods were not watched.
    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for joint in self.arm.joints() {
            let missing = |value: f64| !(value.is_finite() && value > 0.0);
            if missing(joint.velocity) {
                let (rate, unit) = if joint.slides { (RATE[1], "m/s") } else { (RATE[0], "rad/s") };
                notes.push(format!("joint {:?} has no fastest rate in the file: {rate} {unit} were taken", joint.name));
            }
            if joint.lower.is_infinite() || joint.upper.is_infinite() {
                notes.push(format!("joint {:?} has no limits in the file: it stays within one turn", joint.name));
            }
            if missing(joint.effort) {
                notes.push(format!("joint {:?} has no strongest torque in the file: none was kept", joint.name));
            }
        }
        let name = |rod: usize| match rod.checked_sub(1) {
            Some(joint) => format!("what joint {:?} carries", self.arm.joints()[joint].name),
            None => "the base".into(),
        };
        for (a, b) in &self.rods.unwatched {
            let (a, b) = (name(*a), name(*b));
            notes.push(format!("{a} and {b} are near each other in all postures: whether they meet was not watched"));
        }
        notes
    }

    fn why(&self, motion: &Motion) -> String {
        match self.excesses(motion) {
            (torque, room) if torque + room < NOTHING => "what a log would tell cannot be computed".into(),
            (torque, room) if torque > room => {
                let most = 100.0 * EFFORT;
                format!(
                    "the arm's own weight and motion take more than {most:.0} % of a motor's torque; expected stronger motors or more tries"
                )
            }
            _ => "links meet each other or the floor; expected a lower floor, thinner links or more tries".into(),
        }
    }

    fn cost(&self, numbers: &[f64]) -> f64 {
        let motion = self.motion(numbers);
        let excess = self.excess(&motion);
        let nats = self.unknowns.nats(&motion);
        if excess < NOTHING && nats.is_finite() { -nats } else { BROKEN * (1.0 + excess) }
    }
}

impl CostFunction for &Task<'_> {
    type Param = Vec<f64>;
    type Output = f64;
    type Error = std::convert::Infallible;

    fn cost(&self, numbers: &Vec<f64>) -> Result<f64, Self::Error> {
        Ok(Task::cost(self, numbers))
    }
}

/// What is usual in each joint: torques that hold it and that accelerate all joints by 1 rad/s², over postures; at least a hundredth of the largest.
fn usual(arm: &Arm, speed: f64, rooms: &[Room], postures: &[Vec<f64>]) -> Vec<Usual> {
    let count = arm.joints().len();
    let (zero, one) = (vec![0.0; count], vec![1.0; count]);
    let (mut squares, mut inertia) = (vec![0.0; count], vec![0.0; count]);
    for q in postures {
        let still = arm.inverse_dynamics(q, &zero, &zero, &GRAVITY);
        let moved = arm.inverse_dynamics(q, &zero, &one, &nalgebra::Vector3::zeros());
        for joint in 0..count {
            squares[joint] += (still[joint].powi(2) + moved[joint].powi(2)) / postures.len() as f64;
            inertia[joint] += arm.mass_column(q, joint)[joint] / postures.len() as f64;
        }
    }
    let most = squares.iter().copied().fold(0.0, f64::max).sqrt();
    let origins = arm.origins(&zero);
    let lengths = arm.masses().enumerate().map(|(joint, mass)| {
        let next = (origins[joint + 2] - origins[joint + 1]).norm();
        if mass.mass_kg > 0.0 { next.max(mass.centre_m().norm()) } else { next }
    });
    let each = squares.into_iter().zip(inertia).zip(lengths).zip(rooms);
    each.map(|(((square, inertia), length_m), room)| Usual {
        torque: square.sqrt().max(0.01 * most).max(1e-12),
        inertia: inertia.max(1e-15),
        rate: (room.rate / speed).max(1e-9),
        length_m,
    })
    .collect()
}
