//! Our simulated Jaco beside the one in MuJoCo: the same scene, the same moves, the joint torques that both report.
//!
//! Needs a Python with `mujoco` and `numpy`: the one that the variable PYTHON names, or python3. Skipped, with the reason, without.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use agent::{ExternalWorld, SimulatedWorld, Timeouts, World, WorldAddress, WorldStep};
use pomdp::{Purpose, Seed};
use push_task::Action;
use scenario::{Problem, Selection, find_root};

const JOINTS: usize = 6;

/// A scene without chance and without noise: every distribution its mean.
fn problem(root: &Path) -> Problem {
    let mut set: Vec<String> =
        ["joint_rad", "force_n", "torque_nm", "joint_torque_nm", "position_m", "orientation_rad"]
            .map(|key| format!("sensor.noise.{key}=1e-9"))
            .to_vec();
    let fixed = |mean: f64| format!("{{mean={mean},stddev=0.0,low={mean},high={mean}}}");
    for (key, mean) in [("x_m", 0.46), ("y_m", -0.08), ("yaw_rad", 0.0), ("friction", 0.4)] {
        set.push(format!("distribution.object.{key}={}", fixed(mean)));
    }
    set.push(format!("distribution.object.com_m=[{0},{0},{0}]", fixed(0.0)));
    set.push(format!("distribution.object.size_m.box=[{0},{0},{1}]", fixed(0.08), fixed(0.09)));
    // A Gamma distribution with a tiny spread: 0.1 %.
    set.push("distribution.object.mass_kg={mean=0.8,shape=1e6}".into());
    set.push("distribution.obstacle.shape=[0.0,0.0,0.0,1.0]".into());
    let selection = Selection { domain: "obstacle".into(), robot: "jaco".into(), set, ..Selection::new(root) };
    Problem::assemble(&selection.load().unwrap(), root).unwrap()
}

/// The address of the MuJoCo world, where it can run.
#[track_caller]
fn mujoco(root: &Path) -> Option<WorldAddress> {
    let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".into());
    let found = Command::new(&python).args(["-c", "import mujoco, numpy"]).output();
    if !found.is_ok_and(|output| output.status.success()) {
        skipped::skipped(&format!("{python} has no mujoco and numpy (set PYTHON to one that has)"));
        return None;
    }
    let script: PathBuf = root.join("assets/worlds/mujoco_jaco.py");
    Some(format!("'{python}' '{}'", script.display()).parse().unwrap())
}

fn play(world: &mut dyn World, actions: &[usize]) -> Vec<WorldStep> {
    world.reset().unwrap();
    actions.iter().map(|&action| world.act(Action::ALL[action]).unwrap()).collect()
}

#[test]
fn torques_of_free_moves_and_pushes_agree_with_mujoco() {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let Some(address) = mujoco(&root) else { return };
    let problem = problem(&root);
    let minute = Duration::from_secs(60);
    let timeouts = Timeouts { start: minute, reset: minute, act: minute };
    let mut external = ExternalWorld::start(&address, timeouts, &problem).unwrap();
    // Up, back, aside, down and forth in the air; then a push along +y.
    let free = [8, 6, 0, 4, 4, 0, 9, 2];
    let push = [2; 7];
    let actions = [free.as_slice(), push.as_slice()].concat();
    let theirs = play(&mut external.episode(&problem, 0, 1), &actions);
    let start = problem.sample_world(&mut Seed(1).stream(Purpose::World, 0)).unwrap();
    let ours = play(&mut SimulatedWorld::new(&problem.truth, start, Seed(1).stream(Purpose::Truth, 0)), &actions);

    let (mut contact_ours, mut contact_theirs) = ([0.0; JOINTS], [0.0; JOINTS]);
    for (i, (a, b)) in ours.iter().zip(&theirs).enumerate() {
        println!("{i} {:?}\n  {:.3?}\n  {:.3?}", a.report.events, &a.observation.0, &b.observation.0);
        assert_eq!(a.report.events, b.report.events, "step {i}");
        for j in 0..JOINTS {
            let (x, y) = (a.observation.0[j], b.observation.0[j]);
            // 0.05 N·m is half of the sensor's noise: less than that is nothing. Gravity is exact in both.
            assert!(
                (x - y).abs() <= 0.02 * x.abs() + 0.05 || a.report.tool_touched,
                "step {i}, joint {j}: {x} and {y} N·m"
            );
            assert!(x * y > 0.0 || x.abs().max(y.abs()) < 0.05, "step {i}, joint {j}: {x} and {y} N·m");
            // What the contact adds to gravity.
            let gravity = problem.model.robot().gravity_torque(&a.joints_rad)[j];
            let (x, y) = (x - gravity, y - gravity);
            if a.report.tool_touched {
                assert!((x - y).abs() <= 0.2 * x.abs().max(y.abs()) + 0.05, "step {i}, joint {j}: {x} and {y} N·m");
                contact_ours[j] += x;
                contact_theirs[j] += y;
            }
        }
        let off_m: f64 =
            (0..2).map(|k| (a.observation.0[JOINTS + k] - b.observation.0[JOINTS + k]).powi(2)).sum::<f64>().sqrt();
        assert!(off_m < 0.005, "step {i}: the objects are {off_m} m apart");
    }
    assert!(ours.last().unwrap().report.tool_touched, "the push is one");
    println!("{contact_ours:.3?}\n{contact_theirs:.3?}");
    for (j, (x, y)) in contact_ours.into_iter().zip(contact_theirs).enumerate() {
        assert!((x - y).abs() <= 0.2 * x.abs().max(y.abs()) + 0.1, "joint {j}, whole push: {x} and {y} N·m");
    }
}
