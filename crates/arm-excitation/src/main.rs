//! `cargo xtask robot`: what a file says about an arm, and which motion shows most of it.

mod excite;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, Result, bail};
use arm_dynamics::{Arm, GRAVITY, Selection};
use clap::{Parser, Subcommand};
use serde::Serialize;

/// Shows what a file says about an arm, and writes a motion that shows what the file may lack.
#[derive(Debug, Parser)]
#[command(name = "robot", version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    /// Prints joints, limits, masses, the pose of the tip, the torques that hold the arm, its reach, and what was assumed.
    #[command(after_help = EXAMPLES)]
    Check {
        /// URDF file, or TOML file with a table [robot].
        file: PathBuf,
        /// Joints of the arm, base first, separated by commas [default: the longest chain of joints that turn].
        #[arg(long, value_delimiter = ',')]
        joints: Option<Vec<String>>,
        /// Link whose pose is shown [default: the last one of the chain].
        #[arg(long)]
        tip: Option<String>,
        /// Positions of the joints, rad or m, separated by commas [default: 0, or the middle of the limits where 0 is outside].
        #[arg(long, value_delimiter = ',', allow_hyphen_values = true)]
        at: Option<Vec<f64>>,
        /// Prints the same as JSON.
        #[arg(long)]
        json: bool,
    },
    /// Writes a motion, within the limits, whose log would tell most of what the file may lack.
    #[command(after_help = EXCITE_EXAMPLES)]
    Excite(excite::Excite),
}

/// Largest position that `--at` takes, rad or m: more was not meant.
const FARTHEST: f64 = 1e4;

const EXAMPLES: &str = "\
Examples:
  cargo xtask robot check scenarios/robots/sawyer.toml
  cargo xtask robot check tests/data/joint-log/arm.urdf --tip flange --at 0,-0.5,0,-1,0,1,0.8,0";

const EXCITE_EXAMPLES: &str = "\
Examples:
  cargo xtask robot excite tests/data/joint-log/arm.urdf --tell friction --tries 200 --out runs/excitation.csv";

/// What `check` prints.
#[derive(Debug, Serialize)]
struct Check {
    joints: Vec<Joint>,
    tip_link: String,
    moving_mass_kg: f64,
    /// Base ← tip: place, m, and quaternion x, y, z, w.
    tip_position_m: [f64; 3],
    tip_quaternion_xyzw: [f64; 4],
    /// Largest distance of the tip from the base that was met in postures drawn within the limits, m.
    reach_m: f64,
    notes: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Joint {
    name: String,
    slides: bool,
    /// None: without a limit.
    lower: Option<f64>,
    upper: Option<f64>,
    velocity: Option<f64>,
    effort: Option<f64>,
    damping: f64,
    friction: f64,
    carries_kg: f64,
    position: f64,
    holds_nm: f64,
}

fn main() -> ExitCode {
    program::end(run(&program::parse()), program::code)
}

fn run(arguments: &Arguments) -> Result<()> {
    let (file, joints, tip, at, json) = match &arguments.verb {
        Verb::Check { file, joints, tip, at, json } => (file, joints, tip, at, json),
        Verb::Excite(asked) => return excite::run(asked),
    };
    let arm = Arm::open(file, &Selection { joints: joints.clone(), tip: tip.clone() })?;
    let check = check(&arm, file, at.as_deref())?;
    if *json {
        program::show(&(serde_json::to_string_pretty(&check).context("JSON")? + "\n"));
    } else {
        print(&check);
    }
    Ok(())
}

fn check(arm: &Arm, file: &Path, at: Option<&[f64]>) -> Result<Check> {
    let count = arm.joints().len();
    let q: Vec<f64> = match at {
        Some(at) if at.len() == count && at.iter().all(|value| value.abs() <= FARTHEST) => at.to_vec(),
        Some(at) => {
            bail!("--at: expected {count} numbers from -{FARTHEST} to {FARTHEST} for {}, found {at:?}", file.display())
        }
        None => arm
            .joints()
            .iter()
            .map(
                |joint| {
                    if (joint.lower..=joint.upper).contains(&0.0) { 0.0 } else { 0.5 * (joint.lower + joint.upper) }
                },
            )
            .collect(),
    };
    let zero = vec![0.0; count];
    let torques = arm.inverse_dynamics(&q, &zero, &zero, &GRAVITY);
    let tip = arm.base_from_tip(&q);
    let mut notes = arm.notes().to_vec();
    for (joint, (position, torque)) in arm.joints().iter().zip(q.iter().zip(&torques)) {
        if !(joint.lower..=joint.upper).contains(position) {
            notes.push(format!("joint {:?} is at {position}, outside of its limits", joint.name));
        }
        if joint.effort > 0.0 && torque.abs() > 50.0 * joint.effort {
            notes.push(format!(
                "joint {:?} would have to hold {:.0} times what it can: are masses in grams?",
                joint.name,
                torque.abs() / joint.effort
            ));
        } else if torque.abs() > joint.effort {
            notes.push(format!(
                "joint {:?} cannot hold this posture: {:.1} of {:.1} N m",
                joint.name,
                torque.abs(),
                joint.effort
            ));
        }
    }
    let finite = |value: f64| value.is_finite().then_some(value);
    let joint = |(index, (joint, mass)): (usize, (&arm_dynamics::ArmJoint, &arm_dynamics::Mass))| Joint {
        name: joint.name.clone(),
        slides: joint.slides,
        lower: finite(joint.lower),
        upper: finite(joint.upper),
        velocity: finite(joint.velocity),
        effort: finite(joint.effort),
        damping: joint.damping,
        friction: joint.friction,
        carries_kg: mass.mass_kg,
        position: q[index],
        holds_nm: torques[index],
    };
    let turn = tip.rotation.coords;
    Ok(Check {
        joints: arm.joints().iter().zip(arm.masses()).enumerate().map(joint).collect(),
        tip_link: arm.tip().to_owned(),
        moving_mass_kg: arm.masses().map(|mass| mass.mass_kg).sum(),
        tip_position_m: tip.translation.vector.into(),
        tip_quaternion_xyzw: turn.into(),
        reach_m: reach(arm),
        notes,
    })
}

/// Postures spread evenly over the limits by additive recurrence with the roots of primes.
fn reach(arm: &Arm) -> f64 {
    const POSTURES: u32 = 4096;
    const PRIMES: [f64; 12] = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0, 37.0];
    let place = |i: u32| -> f64 {
        let q: Vec<f64> = arm
            .joints()
            .iter()
            .zip(PRIMES)
            .map(|(joint, prime)| {
                let share = (f64::from(i) * prime.sqrt()).fract();
                let (lower, upper) = joint.range();
                lower + share * (upper - lower)
            })
            .collect();
        arm.base_from_tip(&q).translation.vector.norm()
    };
    (0..POSTURES).map(place).fold(0.0, f64::max)
}

fn print(check: &Check) {
    let shown = |value: Option<f64>| value.map_or_else(|| "–".into(), |value| format!("{value:.3}"));
    program::out!(
        "{:<28} {:>8} {:>8} {:>9} {:>8} {:>8} {:>8} {:>8} {:>9}",
        "joint",
        "lower",
        "upper",
        "velocity",
        "effort",
        "damping",
        "friction",
        "kg",
        "holds"
    );
    for joint in &check.joints {
        program::out!(
            "{:<28} {:>8} {:>8} {:>9} {:>8} {:>8.3} {:>8.3} {:>8.3} {:>9.3}",
            whole_file::one_line(&joint.name, 28),
            shown(joint.lower),
            shown(joint.upper),
            shown(joint.velocity),
            shown(joint.effort),
            joint.damping,
            joint.friction,
            joint.carries_kg,
            joint.holds_nm
        );
    }
    program::out!(
        "Limits in rad, rad/s and N m (m, m/s and N where a joint slides); kg: what a joint carries up to the next one; holds: torque against gravity."
    );
    let q: Vec<String> = check.joints.iter().map(|joint| format!("{:.3}", joint.position)).collect();
    let [x, y, z] = check.tip_position_m;
    let [qx, qy, qz, qw] = check.tip_quaternion_xyzw;
    program::out!(
        "At {}: {} at x {x:.4}, y {y:.4}, z {z:.4} m, quaternion x {qx:.4}, y {qy:.4}, z {qz:.4}, w {qw:.4}",
        q.join(", "),
        check.tip_link
    );
    program::out!(
        "Moving mass {:.2} kg; the tip reaches at least {:.2} m from the base.",
        check.moving_mass_kg,
        check.reach_m
    );
    for note in &check.notes {
        program::out!("  {note}");
    }
}
