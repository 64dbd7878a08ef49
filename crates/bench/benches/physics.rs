//! Restore, control step and whole action, on one thread and on all.

use bench::physics::{Case, OBSTACLES};
use bench::scenes::Tool;
use divan::Bencher;

fn main() {
    divan::main();
}

fn case(obstacle: &str, tool: Tool) -> Case {
    let root = scenario::find_root(std::path::Path::new(env!("CARGO_MANIFEST_DIR"))).expect("project");
    Case::new(&scenario::Selection::new(root).load().expect("scenario"), obstacle, tool)
}

#[divan::bench(args = OBSTACLES, threads = [1, 0])]
fn restore(bencher: Bencher, obstacle: &str) {
    let case = case(obstacle, Tool::Ball);
    bencher.bench(|| drop(case.restore()));
}

#[divan::bench(args = OBSTACLES)]
fn first_step(bencher: Bencher, obstacle: &str) {
    let case = case(obstacle, Tool::Ball);
    bencher.with_inputs(|| case.restore()).bench_local_refs(|world| case.step(world, 1));
}

#[divan::bench(args = OBSTACLES)]
fn later_step(bencher: Bencher, obstacle: &str) {
    let case = case(obstacle, Tool::Ball);
    let moving = || {
        let mut world = case.restore();
        for step in 1..=8 {
            case.step(&mut world, step);
        }
        world
    };
    bencher.with_inputs(moving).bench_local_refs(|world| case.step(world, 9));
}

#[divan::bench(args = OBSTACLES, threads = [1, 0])]
fn action_ball(bencher: Bencher, obstacle: &str) {
    let case = case(obstacle, Tool::Ball);
    bencher.bench(|| case.act());
}

#[divan::bench(args = OBSTACLES, threads = [1, 0])]
fn action_hand(bencher: Bencher, obstacle: &str) {
    let case = case(obstacle, Tool::Hand);
    bencher.bench(|| case.act());
}
