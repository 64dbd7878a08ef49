//! The world protocol against a world that misbehaves: every fault ends the episode with one sentence that names message and field, and
//! leaves nothing running. Time-outs are short only where the world never answers.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpListener;
use std::path::Path;
use std::time::Duration;

use agent::{Agent, Episode, Error, ExternalWorld, Method, Reason, Timeouts, World as _, WorldAddress, WorldError};
use pomdp::Seed;
use push_task::Action;
use scenario::{Problem, Selection, find_root};

const GENEROUS: Duration = Duration::from_secs(120);
const TINY: Duration = Duration::from_millis(300);

fn problem(robot: &str) -> Problem {
    let root = find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap();
    let set = vec!["task.horizon=3".into()];
    let selection = Selection { domain: "obstacle".into(), robot: robot.into(), set, ..Selection::new(&root) };
    Problem::assemble(&selection.load().unwrap(), &root).unwrap()
}

fn address(mode: &str) -> WorldAddress {
    format!("'{}' {mode}", env!("CARGO_BIN_EXE_misbehaving-world")).parse().unwrap()
}

fn generous() -> Timeouts {
    Timeouts { start: GENEROUS, reset: GENEROUS, act: GENEROUS }
}

/// An episode of the heuristic policy in a world that the mode describes.
fn play(problem: &Problem, mode: &str, timeouts: Timeouts) -> Result<Episode, WorldError> {
    let mut world = ExternalWorld::start(&address(mode), timeouts, problem)?;
    let mut agent = Agent::new(problem, Method::Heuristic, None).unwrap();
    Ok(agent.run(&mut world.episode(problem, 5, 9), Seed(1)).unwrap())
}

/// The sentence of a failed episode.
fn failure(problem: &Problem, mode: &str, timeouts: Timeouts) -> (usize, String) {
    let episode = play(problem, mode, timeouts).unwrap_or_else(|error| panic!("{mode}: {error}"));
    assert_eq!(episode.reason, Reason::WorldFailed, "{mode}");
    let sentence = episode.failure.unwrap_or_else(|| panic!("{mode}: no sentence"));
    assert_eq!(sentence.lines().count(), 1, "{mode}: {sentence}");
    assert!(!sentence.contains('\u{1b}') && sentence.len() < 2000, "{mode}: {sentence}");
    (episode.steps.len(), sentence)
}

#[test]
fn a_good_world_is_played_to_the_horizon_for_any_robot() {
    for robot in ["jaco", "sawyer"] {
        let problem = problem(robot);
        let mut world = ExternalWorld::start(&address("good"), generous(), &problem).unwrap();
        assert_eq!((world.identity().name.as_str(), world.identity().version.as_str()), ("misbehaving", "1.0"));
        for trial in 0..2 {
            let mut agent = Agent::new(&problem, Method::Heuristic, None).unwrap();
            let episode = agent.run(&mut world.episode(&problem, trial, 1), Seed(1)).unwrap();
            assert_eq!((episode.reason, episode.steps.len(), episode.failure), (Reason::Horizon, 3, None), "{robot}");
            assert!(episode.steps.iter().all(|step| step.reward == -1.0), "nothing happens: the reward of a step");
        }
    }
}

#[test]
fn rewards_follow_from_what_the_world_says_happened() {
    let problem = problem("jaco");
    let rewards = |mode: &str| {
        let episode = play(&problem, mode, generous()).unwrap();
        (episode.reason, episode.steps.iter().map(|step| step.reward).collect::<Vec<_>>())
    };
    // −1 a step; 10 for the first movement; −5 each for a large force and for leaving the region; 100 for the goal.
    assert_eq!(rewards("act-moved"), (Reason::Horizon, vec![9.0, -1.0, -1.0]));
    assert_eq!(rewards("act-pressed"), (Reason::Horizon, vec![-11.0; 3]));
    assert_eq!(rewards("act-won"), (Reason::Goal, vec![99.0]));
    // The two steps that a horizon of 3 leaves, discounted by 0.95.
    assert_eq!(rewards("act-diverged"), (Reason::Diverged, vec![-1.0 - 0.95 - 0.9025]));
    let touched = play(&problem, "act-pressed", generous()).unwrap();
    assert!(touched.steps.iter().all(|step| step.obstacle_touched && step.large_force));
}

#[test]
fn places_become_joints_and_quaternions_take_their_standard_form() {
    let problem = problem("jaco");
    let mut world = ExternalWorld::start(&address("act-place"), generous(), &problem).unwrap();
    let mut episode = world.episode(&problem, 0, 1);
    episode.reset().unwrap();
    let joints = episode.act(Action::ALL[2]).unwrap().joints_rad;
    let tool = problem.model.tool_position_m(&joints);
    assert!(tool.iter().zip([0.46, -0.24, 0.05]).all(|(a, b)| (a - b).abs() < 1e-5), "{tool:?}");

    let mut world = ExternalWorld::start(&address("act-negative"), generous(), &problem).unwrap();
    let mut episode = world.episode(&problem, 0, 1);
    episode.reset().unwrap();
    assert_eq!(episode.act(Action::ALL[2]).unwrap().observation.object_pose().1.map(|v| v + 0.0), [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn what_a_world_says_it_has_drawn_is_for_statistics() {
    let problem = problem("jaco");
    let mut world = ExternalWorld::start(&address("reset-drawn"), generous(), &problem).unwrap();
    let mut episode = world.episode(&problem, 0, 1);
    assert_eq!(episode.drawn(), None);
    episode.reset().unwrap();
    let drawn = episode.drawn().unwrap();
    assert_eq!(drawn.theta.object.mass_kg, 0.5);
    assert_eq!(drawn.state.obstacle.as_ref().unwrap().position_m, [0.53, 0.05, 0.045]);
    assert_eq!(episode.has_obstacle(), Some(true), "as what was drawn has one");
    assert!(episode.truth().is_none(), "no method may know of it");
}

#[test]
fn a_world_without_truth_refuses_the_oracle() {
    let problem = problem("jaco");
    let mut world = ExternalWorld::start(&address("good"), generous(), &problem).unwrap();
    let mut agent = Agent::new(&problem, Method::Oracle, None).unwrap();
    let refused = agent.run(&mut world.episode(&problem, 0, 1), Seed(1));
    assert!(matches!(refused, Err(Error::NoTruth)), "{refused:?}");
}

#[test]
fn every_wrong_answer_names_its_message_and_field() {
    let problem = problem("jaco");
    let cases: [(&str, &[&str]); 41] = [
        ("act-nonsense", &["`act`", "expected"]),
        ("act-empty", &["`act`", "the text ends before it is complete"]),
        ("act-array", &["`act`", "expected"]),
        ("act-deep", &["`act`"]),
        ("act-bytes", &["`act`", "UTF-8"]),
        ("act-twice", &["`act`", "one JSON object in a line"]),
        ("act-nan", &["`act`", "`observation[2]`", "NaN"]),
        ("act-infinity", &["`act`", "`observation[2]`", "Infinity"]),
        ("act-huge-number", &["`act`", "`observation[2]`", "out of range"]),
        ("act-null", &["`act`", "`observation[2]`", "null"]),
        ("act-text-number", &["`act`", "`observation[2]`", "expected a number"]),
        ("act-other-name", &["`act`", "`reset"]),
        ("act-error", &["`act`", "the gripper is open"]),
        ("act-short", &["`act`", "`observation`", "expected 13 values, found 12"]),
        ("act-extra", &["`act`", "`observation`", "expected 13 values, found 14"]),
        ("act-missing", &["`act`", "`observation` is missing"]),
        ("act-unknown-key", &["`act`", "`run`"]),
        ("act-no-joints", &["`act`", "`joints_rad`", "found neither"]),
        ("act-both", &["`act`", "`tool_m`", "found both"]),
        ("act-few-joints", &["`act`", "`joints_rad`", "expected 6 values, found 2"]),
        ("act-far-joints", &["`act`", "`joints_rad[1]`", "found 90"]),
        ("act-far-tool", &["`act`", "`tool_m`", "reaches"]),
        ("act-quaternion", &["`act`", "`observation[9..13]`", "unit quaternion"]),
        ("act-far-object", &["`act`", "`observation[6]`", "object_x_m", "1000000"]),
        ("act-wrong-step", &["`act`", "`step`", "expected 1, found 77"]),
        ("act-outcome", &["`act`", "`outcome`", "`won`"]),
        ("act-goal-without-end", &["`act`", "`outcome`", "events.goal true"]),
        ("act-end-without-goal", &["`act`", "`outcome`", "events.goal false"]),
        ("act-event-number", &["`act`", "`events.large_force`", "expected true or false"]),
        ("act-long", &["`act`", "65536 bytes"]),
        ("act-endless", &["`act`", "65536 bytes"]),
        ("reset-short", &["`reset`", "`observation`", "expected 13 values, found 12"]),
        ("reset-wrong-trial", &["`reset`", "`trial`", "expected 5, found 77"]),
        ("reset-drawn-grams", &["`reset`", "`drawn.theta`", "mass", "500"]),
        ("reset-drawn-nowhere", &["`reset`", "`drawn.obstacle`", "only there"]),
        ("reset-drawn-denied", &["`reset`", "`has_obstacle`", "expected true", "found false"]),
        ("reset-drawn-low", &["`reset`", "`drawn.object`", "0.045 m high"]),
        ("reset-drawn-far", &["`reset`", "`drawn.object`", "where it is observed"]),
        ("reset-drawn-wide", &["`reset`", "`drawn`", "outside it"]),
        ("reset-drawn-sphere", &["`reset`", "`drawn`", "distribution of `hello`"]),
        ("reset-elsewhere", &["`reset`", "within 0.02 m of [0.46, -0.26, 0.05]"]),
    ];
    for (mode, parts) in cases {
        let (steps, sentence) = failure(&problem, mode, generous());
        assert_eq!(steps, 0, "{mode}: the step that failed is not one");
        for part in parts {
            assert!(sentence.contains(part), "{mode}: expected `{part}` in: {sentence}");
        }
    }
}

#[test]
fn an_answer_that_nobody_asked_for_is_not_taken_for_the_next() {
    let (steps, sentence) = failure(&problem("jaco"), "act-two-answers", generous());
    assert_eq!(steps, 1, "the first answer is good, and stays in the record");
    assert!(sentence.contains("`step`: expected 2, found 1"), "{sentence}");
}

#[test]
fn a_wrong_hello_is_refused() {
    let problem = problem("jaco");
    let cases: [(&str, &[&str]); 6] = [
        ("hello-version", &["`hello`", "`protocol`", "expected 1, found 2"]),
        ("hello-robot", &["`hello`", "`robot`", "expected jaco, found panda"]),
        ("hello-name", &["`hello`", "`world`", "letters", "etc/passwd"]),
        ("hello-nonsense", &["`hello`", "expected"]),
        ("hello-die", &["`hello`", "exit status: 3", "the motors are"]),
        ("hello-other-name", &["`hello`", "`reset"]),
    ];
    for (mode, parts) in cases {
        let sentence = play(&problem, mode, generous()).unwrap_err().to_string();
        for part in parts {
            assert!(sentence.contains(part), "{mode}: expected `{part}` in: {sentence}");
        }
    }
    let nowhere: WorldAddress = "/nowhere/at-all --port 1".parse().unwrap();
    let sentence = ExternalWorld::start(&nowhere, generous(), &problem).err().unwrap().to_string();
    assert!(sentence.contains("/nowhere/at-all"), "{sentence}");
}

#[test]
fn a_world_that_never_answers_is_given_up() {
    let problem = problem("jaco");
    for mode in ["act-hang", "act-drip"] {
        let (_, sentence) = failure(&problem, mode, Timeouts { act: TINY, ..generous() });
        assert!(sentence.contains("no answer to `act` within 0.3 s"), "{mode}: {sentence}");
    }
    let (_, sentence) = failure(&problem, "reset-hang", Timeouts { reset: TINY, ..generous() });
    assert!(sentence.contains("no answer to `reset` within 0.3 s"), "{sentence}");
    let error = play(&problem, "hello-hang", Timeouts { start: TINY, ..generous() }).unwrap_err();
    assert!(matches!(error, WorldError::Silent { request: "hello", .. }), "{error}");
}

#[test]
fn a_world_that_dies_says_how_and_its_last_words() {
    let problem = problem("jaco");
    let (_, sentence) = failure(&problem, "act-die", generous());
    for part in ["`act`", "exit status: 3", "first line | the motors are", "hot"] {
        assert!(sentence.contains(part), "expected `{part}` in: {sentence}");
    }
    let (_, sentence) = failure(&problem, "act-half-line", generous());
    assert!(sentence.contains("exit status: 0"), "{sentence}");
    let (_, sentence) = failure(&problem, "act-close", generous());
    assert!(sentence.contains("closed its output"), "{sentence}");
}

#[test]
fn a_world_that_fills_its_standard_error_is_not_held_up() {
    // 7 MB: far more than a pipe holds.
    let episode = play(&problem("jaco"), "act-chatter", generous()).unwrap();
    assert_eq!((episode.reason, episode.steps.len()), (Reason::Horizon, 3));
}

#[cfg(target_os = "linux")]
#[test]
fn nothing_is_left_of_a_world_or_of_what_it_started() {
    let problem = problem("jaco");
    let folder = std::env::temp_dir().join(format!("surmise-world-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    for mode in ["good", "act-hang", "act-die", "act-nonsense", "hello-version"] {
        let file = folder.join(mode);
        let world = format!("{mode} '{}'", file.display());
        let timeouts = Timeouts { act: if mode == "act-hang" { TINY } else { GENEROUS }, ..generous() };
        // Some fail: what is left of them is asked here.
        let _ = play(&problem, &world, timeouts);
        // The world has waited for it before it said hello.
        let numbers = std::fs::read_to_string(&file).unwrap();
        let (child, world) = numbers.split_once(' ').unwrap();
        assert!(!Path::new("/proc").join(world).exists(), "{mode}: the world is reaped");
        // Whoever adopts its child reaps it, in time: it must be dead.
        let dead = || {
            let stat = std::fs::read_to_string(format!("/proc/{child}/stat"));
            stat.map_or(true, |stat| {
                stat.rsplit(')').next().is_some_and(|rest| rest.trim_start().starts_with(['Z', 'X']))
            })
        };
        let ended = (0..2000).any(|_| {
            std::thread::sleep(Duration::from_millis(5));
            dead()
        });
        assert!(ended, "{mode}: what the world started is ended");
    }
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn a_world_behind_a_socket_is_played_and_its_end_noticed() {
    let problem = problem("jaco");
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address: WorldAddress = format!("tcp://{}", listener.local_addr().unwrap()).parse().unwrap();
    // A proxy: each connection is a fresh misbehaving world, the first good, the second dies at its first action.
    let server = std::thread::spawn(move || {
        for mode in ["good", "act-die"] {
            let (mut stream, _) = listener.accept().unwrap();
            let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_misbehaving-world"))
                .arg(mode)
                .stdin(std::process::Stdio::piped())
                .stdout(std::process::Stdio::piped())
                .stderr(std::process::Stdio::null())
                .spawn()
                .unwrap();
            let (mut input, mut output) = (child.stdin.take().unwrap(), BufReader::new(child.stdout.take().unwrap()));
            let mut requests = BufReader::new(stream.try_clone().unwrap()).lines();
            let mut closed = false;
            while let Some(Ok(request)) = requests.next() {
                closed = request.contains("\"close\"");
                writeln!(input, "{request}").unwrap();
                let mut answer = String::new();
                if output.read_line(&mut answer).unwrap() == 0 || stream.write_all(answer.as_bytes()).is_err() {
                    break;
                }
            }
            assert_eq!(closed, mode == "good", "a good world is asked to close");
            drop(input);
            child.wait().unwrap();
        }
    });
    let play = || {
        let mut world = ExternalWorld::start(&address, generous(), &problem).unwrap();
        let mut agent = Agent::new(&problem, Method::Heuristic, None).unwrap();
        agent.run(&mut world.episode(&problem, 0, 1), Seed(1)).unwrap()
    };
    assert_eq!(play().reason, Reason::Horizon);
    let failed = play();
    assert_eq!(failed.reason, Reason::WorldFailed);
    assert!(failed.failure.unwrap().contains("closed the connection"));
    server.join().unwrap();
    let refused = ExternalWorld::start(&address, generous(), &problem).err().unwrap();
    assert!(matches!(refused, WorldError::Connect { .. }), "{refused}");
}
