use pomdp::{Purpose, Rng, Seed};
use rand_distr::{Distribution as _, StandardNormal, StandardUniform};

use super::*;

const NOISE_N: f64 = 0.1;

/// Straight pushes of 30 cm at three speeds over a table of 30 cm, with a force beside noise.
fn pushes(seed: u64, episodes: usize, force: impl Fn(&Window) -> [f64; 2]) -> Option<LackingForce> {
    let mut rng = Seed(seed).stream(Purpose::World, 0);
    let uniform = |rng: &mut Rng| -> f64 { StandardUniform.sample(rng) };
    let mut all = Vec::new();
    for episode in 0..episodes {
        let (angle, speed) = (std::f64::consts::TAU * uniform(&mut rng), [0.03, 0.08, 0.16][episode % 3]);
        let start = [0, 1].map(|_| 0.3 * uniform(&mut rng) - 0.15);
        let windows = (0..30).map(|i| {
            let way = 0.01 * f64::from(i) - 0.15;
            let mut window = Window {
                time_secs: 0.6 + (way + 0.15) / speed,
                place_m: [0.3 * start[0] + way * angle.cos(), 0.3 * start[1] + way * angle.sin(), 0.0],
                velocity_mps: [speed * angle.cos(), speed * angle.sin(), 0.0],
                mass_kg: 0.5,
                lacking_n: [0.0; 3],
                variance_n2: NOISE_N * NOISE_N,
                simulated_n: [-2.0 * angle.cos(), -2.0 * angle.sin(), 0.0],
            };
            let [x, y] = force(&window);
            let noise: [f64; 2] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            window.lacking_n = [x + NOISE_N * noise[0], y + NOISE_N * noise[1], 0.0];
            window
        });
        all.push(windows.collect());
    }
    describe(&all, 2, &Units::default())
}

fn value(term: &FoundTerm, key: &str) -> f64 {
    term.coefficients.iter().find(|coefficient| coefficient.key == key).unwrap().value
}

#[test]
fn a_swirl_turns_around_its_place() {
    let found = pushes(1, 15, |w| [-6.0 * (w.place_m[1] - 0.02), 6.0 * (w.place_m[0] + 0.03)]).unwrap();
    let [term] = found.terms.as_slice() else { panic!("{found:?}") };
    assert_eq!(term.name, "around_place");
    assert!((value(term, "strength") - 6.0).abs() < 0.2, "{term:?}");
    assert!((value(term, "x") + 0.03).abs() < 0.003 && (value(term, "y") - 0.02).abs() < 0.003, "{term:?}");
    assert!(found.explained_share > 0.8, "{found:?}");
    // What explains all leaves noise: 0.1 N in each of two directions.
    assert!((found.noise_n - NOISE_N * 2.0_f64.sqrt()).abs() < 1e-9);
}

#[test]
fn a_force_that_is_another_in_each_episode_is_told_as_that() {
    // As good as random, one in each direction.
    let found =
        pushes(5, 20, |w| [0.5 * (1e4 * w.velocity_mps[0]).sin(), 0.5 * (1e4 * w.velocity_mps[1]).cos()]).unwrap();
    assert!(found.terms.is_empty(), "{found:?}");
    // A force of 0.35 N beside noise of 0.1 N an axis.
    assert!((0.85..0.97).contains(&found.between_episodes_share), "{found:?}");
    assert!(found.sentence().contains("differs between episodes"));
    let noise = pushes(6, 20, |_| [0.0; 2]).unwrap();
    assert!(noise.between_episodes_share < 0.05 && !noise.sentence().contains("differs between"), "{noise:?}");
}

#[test]
fn a_spring_pulls_towards_its_place_and_a_magnet_where_it_is_near() {
    let spring = pushes(2, 15, |w| [-5.0 * (w.place_m[0] - 0.04), -5.0 * w.place_m[1]]).unwrap();
    assert_eq!(spring.terms[0].name, "towards_place", "{spring:?}");
    assert!((value(&spring.terms[0], "x") - 0.04).abs() < 0.004, "{spring:?}");
    let magnet = pushes(3, 20, |w| {
        let [dx, dy] = [0.05 - w.place_m[0], -0.04 - w.place_m[1]];
        [dx, dy].map(|d| 0.001 * d / dx.hypot(dy).max(0.03).powi(3))
    });
    let magnet = magnet.unwrap();
    assert_eq!(magnet.terms[0].name, "near_place", "{magnet:?}");
    let [x, y] = ["x", "y"].map(|key| value(&magnet.terms[0], key));
    assert!((x - 0.05).hypot(y + 0.04) < 0.02, "{magnet:?}");
}

#[test]
fn frictions_that_change_with_time_and_place_are_told_apart() {
    let against = |w: &Window, size: f64| {
        let speed = w.velocity_mps[0].hypot(w.velocity_mps[1]);
        [-size * w.velocity_mps[0] / speed, -size * w.velocity_mps[1] / speed]
    };
    let over_time = pushes(4, 15, |w| against(w, 0.15 * w.time_secs - 0.4)).unwrap();
    let term = over_time.terms.iter().find(|term| term.name == "against_motion_by_time").unwrap();
    assert!((value(term, "size") - 0.15).abs() < 0.01, "{over_time:?}");
    let stripes = pushes(5, 15, |w| against(w, 0.6 * (std::f64::consts::TAU * w.place_m[0] / 0.08).sin())).unwrap();
    let [term] = stripes.terms.as_slice() else { panic!("{stripes:?}") };
    assert_eq!(term.name, "against_motion_in_stripes");
    assert!((value(term, "wave") - 0.08).abs() < 0.005, "{stripes:?}");
    let shaken = pushes(6, 15, |w| [0.5 * (std::f64::consts::TAU * w.time_secs / 0.4).sin(), 0.0]).unwrap();
    assert_eq!(shaken.terms[0].name, "periodic", "{shaken:?}");
    assert!((value(&shaken.terms[0], "period") - 0.4).abs() < 0.02, "{shaken:?}");
}

#[test]
fn another_friction_is_one_term_and_noise_is_none() {
    let mut spurious = 0;
    for seed in 0..20 {
        let found = pushes(100 + seed, 20, |w| {
            let speed = w.velocity_mps[0].hypot(w.velocity_mps[1]);
            [-0.3 * w.velocity_mps[0] / speed, -0.3 * w.velocity_mps[1] / speed]
        });
        let found = found.unwrap();
        assert!((value(&found.terms[0], "size") - 0.3).abs() < 0.03, "{found:?}");
        spurious += usize::from(found.terms.len() > 1);
        spurious += usize::from(!pushes(200 + seed, 20, |_| [0.0; 2]).unwrap().terms.is_empty());
    }
    assert!(spurious <= 2, "{spurious} of 40");
}

#[test]
fn of_few_windows_nothing_is_said() {
    assert!(pushes(7, 4, |_| [1.0, 0.0]).is_none());
}
