//! Plans RockSample(7, 8) with `planner` and `belief`.

mod rock_sample;

use belief::{Particles, RejectionConfig, RejectionFilter};
use planner::{Budget, Config, Exploration, Pomcp};
use pomdp::rand::RngExt as _;
use pomdp::{Discretise as _, GenerativeModel as _, Outcome, Proposals, Purpose, Rng, Seed, Updater as _};
use rock_sample::{East, RockSample, State};

/// Discounted return of one episode.
fn play(model: &RockSample, rng: &mut Rng) -> Result<f64, Box<dyn std::error::Error>> {
    let config =
        Config::default().with_budget(Budget::Simulations(8192)).with_exploration(Exploration::ReturnRange(0.3));
    let mut planner = Pomcp::new(config)?;
    let mut filter = RejectionFilter::new(RejectionConfig::default())?;
    let start = |rng: &mut Rng| State { rover: [0, 3], good: rng.random() };
    let mut belief = Particles::uniform((0..1000).map(|_| start(rng)).collect())?;
    let (mut truth, mut rewards) = (start(rng), Vec::new());
    for left in (1..=90).rev() {
        let action = planner.search(model, &belief, &East, left, rng).action;
        let step = model.step(&mut truth, &action, rng);
        rewards.push(step.reward);
        if step.outcome != Outcome::Continue {
            break;
        }
        (belief, _) = filter.update(model, belief, &action, &step.observation, Proposals::none(), rng)?;
        planner.prune(&action, &model.key(&step.observation));
    }
    Ok(pomdp::discounted_return(rewards, model.discount()))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = RockSample::new();
    let episode = |item| play(&model, &mut Seed(1).stream(Purpose::Custom(1), item));
    let returns = (0..40).map(episode).collect::<Result<Vec<f64>, _>>()?;
    println!("mean discounted return of 40 episodes: {:.1}", returns.iter().sum::<f64>() / 40.0);
    Ok(())
}
