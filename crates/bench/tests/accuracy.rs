//! The shipped settings against MuJoCo's recorded answers and closed forms.

use std::path::{Path, PathBuf};

use bench::report::{page, summarise};
use bench::{accuracy, closed_forms, report, scenes};
use physics_model::config::WorldConfig;
use physics_model::feasible::parts_in_reach;
use physics_model::world::ToolPose;

fn root() -> PathBuf {
    scenario::find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).expect("project")
}

fn world() -> WorldConfig {
    scenario::Selection::new(root()).load().expect("scenario").world
}

#[test]
fn pushes_end_where_mujoco_says() {
    let scenes = scenes::load(&root()).expect("record");
    assert!(scenes.len() >= 60, "{} scenes", scenes.len());
    let errors: Vec<_> = scenes.iter().map(|(scene, theirs)| accuracy::compare(scene, theirs, &world())).collect();
    let s = summarise(&errors);
    // Measured figures are on the page (`accuracy.md`); the limits are those of the requirement.
    assert!(s.position_mm[0] < 2.0 && s.position_mm[1] < 8.0, "{s:?}");
    assert!(s.angle_deg[0] < 3.0 && s.angle_deg[1] < 12.0, "{s:?}");
    assert!(s.force[0] < 0.1, "{s:?}");
    // And closer than rapier without the correction of its friction comes even with eight iterations (0.71 mm, 1.0 degrees).
    assert!(s.position_mm[0] < 0.5 && s.angle_deg[0] < 0.9, "{s:?}");
}

#[test]
fn with_fine_steps_the_two_engines_agree() {
    let coarse = world();
    let fine = WorldConfig {
        control_steps: 4 * coarse.control_steps,
        control_period_secs: coarse.control_period_secs / 4.0,
        solver_iterations: 4,
        ..coarse
    };
    let scenes = scenes::load(&root()).expect("record");
    let errors: Vec<_> = scenes.iter().map(|(scene, theirs)| accuracy::compare(scene, theirs, &fine)).collect();
    let s = summarise(&errors);
    assert!(s.position_mm[0] < 0.25 && s.angle_deg[0] < 0.35 && s.force[0] < 0.06, "{s:?}");
}

#[test]
fn closed_forms_hold_to_the_time_step() {
    for measure in closed_forms::measure(&root(), &world()).expect("record") {
        let reference = measure.exact.unwrap_or(measure.mujoco);
        // v h / 2 of the slide is 3.3 %, ω h / 2 of the spin 11.6 %; turns within 10 % of MuJoCo's.
        let limit = match measure.name {
            "push_force_n" | "sphere_rolls_mps" | "lying_cylinder_rolls_mps" => 0.02,
            "slide_m" => 0.04,
            "spin_rad" => 0.13,
            _ => 0.1,
        };
        assert!((measure.ours / reference - 1.0).abs() < limit, "{measure:?}");
    }
}

#[test]
fn parts_of_the_hand_that_are_left_out_do_not_matter() {
    let mut left_out = 0;
    for (scene, _) in scenes::load(&root()).expect("record") {
        // Many iterations: with few, the order in which the engine takes the contacts that remain shows (0.2 mm).
        let config = WorldConfig { solver_iterations: 16, ..scene.config(&world()) };
        let all = scene.tool.shapes();
        let pose = ToolPose { position_m: scene.tool_m, orientation: [0.0, 0.0, 0.0, 1.0] };
        let target = std::array::from_fn(|i| scene.tool_m[i] + scenes::MOVE_M * scene.direction[i]);
        let obstacle = scene.obstacle.as_ref();
        let near = parts_in_reach(&config, &scene.theta, &scene.object, obstacle, &pose, target, &all);
        left_out += all.len() - near.len();
        let (whole, part) = (scene.simulate(&config, &all), scene.simulate(&config, &near));
        let (position, angle) = scenes::pose_error(&whole.object, &part.object, true);
        assert!(position < 5e-5 && angle < 1e-3, "{}: {position} m, {angle} rad apart", scene.name);
    }
    assert!(left_out >= 10, "only {left_out} parts are left out: nothing was tested");
}

#[test]
fn the_page_in_the_docs_is_the_one_that_the_command_writes() {
    if !cfg!(all(target_arch = "x86_64", target_os = "linux")) {
        skipped::skipped("the page was written on x86-64 Linux, whose last digits other machines need not share");
        return;
    }
    let committed = std::fs::read_to_string(root().join(report::PAGE)).expect("page");
    assert_eq!(page(&root(), &world()).expect("records"), committed, "run `cargo xtask bench accuracy --write`");
}
