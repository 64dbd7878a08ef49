//! What an external world says: its answers to `hello`, `reset` and one `act`, as it sends them.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener};
use std::sync::OnceLock;
use std::thread;
use std::time::Duration;

use agent::{ExternalWorld, Timeouts, World as _, WorldAddress};
use push_task::Action;
use scenario::{Problem, Selection};

use crate::Verdict;
use crate::verdict::{asset, refused, root};

/// Far longer than a socket of this machine takes: what has not come by the end of the input never comes.
const TIMEOUT: Duration = Duration::from_secs(60);

/// Plays a session with a world that says these bytes, whatever it is asked, and hangs up. What is accepted are finite observations, a unit
/// quaternion and joints of the arm.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn world_protocol(data: &[u8]) -> Verdict {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap_or_else(|error| panic!("no socket: {error}"));
    let address = listener.local_addr().unwrap_or_else(|error| panic!("no address: {error}"));
    thread::scope(|scope| {
        scope.spawn(move || {
            let Ok((mut socket, _)) = listener.accept() else { return };
            // It may be hung up on before it has said everything.
            let _ = socket.write_all(data).and_then(|()| socket.shutdown(std::net::Shutdown::Write));
            // Closing with requests unread would take back what was said.
            let _ = socket.read_to_end(&mut Vec::new());
        });
        session(address)
    })
}

fn session(address: SocketAddr) -> Verdict {
    let problem = problem();
    let timeouts = Timeouts { start: TIMEOUT, reset: TIMEOUT, act: TIMEOUT };
    let mut world = match ExternalWorld::start(&WorldAddress::Tcp(address), timeouts, problem) {
        Ok(world) => world,
        Err(error) => return refused(&error, &["the world"]),
    };
    let mut episode = world.episode(problem, 3, 1);
    let check = |values: &[f64], joints: &[f64]| {
        assert!(values.iter().chain(joints).all(|v| v.is_finite()), "{values:?} {joints:?}");
        let norm: f64 = values[values.len() - 4..].iter().map(|v| v * v).sum();
        assert!((norm - 1.0).abs() < 1e-9 && values[values.len() - 1] >= 0.0, "{values:?}");
        assert_eq!(joints.len(), problem.model.joint_count(), "one value a joint");
    };
    match episode.reset() {
        Ok((observation, joints)) => {
            check(&observation.0, &joints);
            let drawn = episode.drawn().map(|drawn| drawn.theta.continuous());
            assert!(drawn.iter().flatten().all(|value| value.is_finite()), "{drawn:?}");
        }
        Err(error) => return refused(&error, &["the world"]),
    }
    match episode.act(Action::ALL[2]) {
        Ok(step) => {
            check(&step.observation.0, &step.joints_rad);
            assert!(step.reward.is_finite(), "{step:?}");
            Verdict::Accepted
        }
        Err(error) => refused(&error, &["the world"]),
    }
}

fn problem() -> &'static Problem {
    static PROBLEM: OnceLock<Problem> = OnceLock::new();
    PROBLEM.get_or_init(|| {
        let selection = Selection { domain: "obstacle".into(), robot: "jaco".into(), ..Selection::new(root()) };
        let problem = selection.load().and_then(|scenario| Problem::assemble(&scenario, &root()));
        problem.unwrap_or_else(|error| panic!("{error}"))
    })
}

/// The session of the documentation, twice, one in which the world reports the tool, and one in which it says what it has drawn.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let text = String::from_utf8_lossy(&asset("docs/src/reference/world-protocol.md")).into_owned();
    let blocks: Vec<String> = text
        .split("```json\n")
        .skip(1)
        .filter_map(|block| block.split("```").next())
        .map(|block| block.trim().replace('\n', " "))
        .collect();
    // The blocks are hello, its answer, reset, its answer, the same with what was drawn, act, its answer, error, close.
    let session = |answers: [&str; 3]| answers.map(|answer| format!("{answer}\n")).concat().into_bytes();
    let documented = session([&blocks[1], &blocks[3], &blocks[6]]);
    let drawn = session([&blocks[1], &blocks[4], &blocks[6]]);
    let tool = blocks[3]
        .replace("\"joints_rad\": [0.6333, 2.117, 4.57, 0.2087, -0.8013, 0.842]", "\"tool_m\": [0.46, -0.26, 0.05]");
    vec![documented.clone(), documented, session([&blocks[1], &tool, &blocks[6]]), drawn]
}
