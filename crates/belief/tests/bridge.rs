//! The bridge filter against exact posteriors: a line with a walk on top, and whether there is a second body.

mod line;

use belief::{BridgeConfig, BridgeFilter, Error, Particles};
use line::gaussian::Gaussian;
use line::guess::Guess;
use line::{Exact, Kalman, Line, NOW, SLOPE, State};
use pomdp::{Purpose, Rng, Seed, Teacher, UpdateReport};

impl Guess {
    /// q^(1 − power) p^power of this teacher q and the posterior p of a line without a walk, as if it were a posterior.
    fn bridge(&self, line: &Line, power: f64) -> Exact {
        let (posterior, steps) = (Self::exact(line), line.readings.len() as f64);
        let both = [0, 1].map(|class| Gaussian::between(&self.parts[class], &posterior.parts[class], power));
        let of = |guess: &Self, class: usize| if class == 1 { guess.second.0 } else { 1.0 - guess.second.0 };
        let mass =
            |class: usize| of(self, class).powf(1.0 - power) * of(&posterior, class).powf(power) * both[class].1.exp();
        let second = mass(1) / (mass(0) + mass(1));
        let parts = both.each_ref().map(|(part, _)| {
            let (m, c) = (part.mean, part.covariance());
            let mut kalman = Kalman { mean: [0.0; 4], covariance: [[0.0; 4]; 4], log_evidence: f64::NAN };
            // The present value is x_0 + steps × slope.
            kalman.mean[NOW] = m[0] + steps * m[1];
            kalman.covariance[NOW][NOW] = c[0][0] + 2.0 * steps * c[0][1] + steps * steps * c[1][1];
            (kalman.mean[SLOPE], kalman.covariance[SLOPE][SLOPE]) = (m[1], c[1][1]);
            kalman
        });
        Exact { parts, second }
    }
}

/// How episodes are made.
struct Setting<'a> {
    q: f64,
    steps: usize,
    config: BridgeConfig,
    teacher: &'a dyn Fn(&Line) -> Guess,
}

/// An episode of a world drawn from the prior.
struct Found {
    truth: State,
    belief: Particles<State>,
    exact: Exact,
    /// The exact bridge from the last teacher to the posterior, at the exponent that was reached; without a walk alone.
    bridge: Exact,
    /// ln p of all readings.
    log_evidence: f64,
    reports: Vec<UpdateReport>,
}

fn episode(setting: &Setting<'_>, item: u64) -> Found {
    let mut rng = Seed(21).stream(Purpose::Test, item);
    let mut filter_rng = Seed(22).stream(Purpose::Test, item);
    let mut line = Line::new(setting.q, 0.3, 0.5);
    let mut truth = line.draw(&mut rng);
    let first = (setting.teacher)(&line);
    let mut filter = BridgeFilter::new(setting.config.clone(), &line, first, &mut filter_rng).unwrap();
    let reports = (0..setting.steps).map(|_| {
        line.act(&mut truth, &mut rng);
        filter.update(&line, (setting.teacher)(&line), &mut filter_rng).unwrap()
    });
    let reports: Vec<UpdateReport> = reports.collect();
    let exact = Exact::new(&line);
    let bridge = (setting.teacher)(&line).bridge(&line, reports.last().unwrap().temperature);
    let (belief, log_evidence) = (filter.belief().unwrap(), exact.log_evidence(&line));
    Found { truth, belief, log_evidence, exact, bridge, reports }
}

fn episodes(setting: &Setting<'_>, count: u64) -> Vec<Found> {
    (0..count).map(|item| episode(setting, item)).collect()
}

impl Found {
    fn last(&self) -> &UpdateReport {
        self.reports.last().unwrap()
    }

    fn moments(&self, value: impl Fn(&State) -> f64) -> (f64, f64) {
        let mean: f64 = self.belief.iter().map(|(state, w)| w * value(state)).sum();
        (mean, self.belief.iter().map(|(state, w)| w * (value(state) - mean).powi(2)).sum())
    }

    /// Probability of values below the truth's.
    fn rank(&self, value: impl Fn(&State) -> f64) -> f64 {
        let truth = value(&self.truth);
        self.belief.iter().filter(|(state, _)| value(state) < truth).map(|(_, w)| w).sum()
    }

    fn second(&self) -> f64 {
        self.belief.iter().filter(|(state, _)| state.height != 0.0).map(|(_, w)| w).sum()
    }
}

/// What is compared: its place in the exact posterior, and its value in a state.
type Quantity = (usize, fn(&State) -> f64);

const PLACES: [Quantity; 2] = [(NOW, |state| state.x), (SLOPE, |state| state.slope)];

fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n * (n - 1.0))).sqrt())
}

/// Means, variances and class probabilities against the exact ones. Null: errors of `size` independent draws. Errors of means have a standard
/// deviation of 1 / √size posterior spreads, errors of probabilities at most 0.5 / √size; their root mean squares may be twice as large, as `size` varies
/// between episodes. Their averages over episodes are 0 within 4 standard errors and 1 / size, the order of a ratio's bias; so are those of
/// relative variances, whose bias is a few times that.
fn assert_exact(found: &[Found], size: f64) {
    let check = |what: &str, errors: &[f64], rms_most: f64, bias: f64| {
        let (mean, error) = mean_and_error(errors);
        let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
        println!("{what}: mean {mean:.4} ± {error:.4}, rms {rms:.4} of at most {rms_most:.4}");
        assert!(mean.abs() < 4.0 * error + bias, "{what}: {mean} ± {error}");
        assert!(rms < rms_most, "{what}: {rms} of {rms_most}");
    };
    for (place, value) in PLACES {
        let of = |error: &dyn Fn((f64, f64), (f64, f64)) -> f64| -> Vec<f64> {
            found.iter().map(|f| error(f.moments(value), f.exact.moments(place))).collect()
        };
        check("mean", &of(&|(m, _), (exact, variance)| (m - exact) / variance.sqrt()), 2.0 / size.sqrt(), 1.0 / size);
        // The variance of n draws errs by √(2 / n) of itself.
        check("variance", &of(&|(_, v), (_, variance)| v / variance - 1.0), 2.0 * (2.0 / size).sqrt(), 3.0 / size);
    }
    let second: Vec<f64> = found.iter().map(|f| f.second() - f.exact.second).collect();
    check("second body", &second, 1.0 / size.sqrt(), 1.0 / size);
}

#[test]
fn draws_from_the_posterior_have_equal_weights() {
    // Without a walk the likelihood of a start is exact, so that the weights of an exact teacher's draws are equal but for rounding.
    let config = BridgeConfig { draws: 100, kept: 1, effective: 100.0 };
    let found = episodes(&Setting { q: 0.0, steps: 6, config, teacher: &Guess::exact }, 10);
    for report in found.iter().flat_map(|f| &f.reports) {
        assert!((report.effective_sample_size_before - 100.0).abs() < 1e-6, "{report:?}");
        assert!((report.effective_sample_size - 100.0).abs() < 1e-6, "{report:?}");
        assert_eq!(report.particles, 100);
    }
    // ln p of the readings is then met by every draw, whatever the seed.
    for f in &found {
        let sum: f64 = f.reports.iter().map(|report| report.log_evidence).sum();
        assert!((sum - f.log_evidence).abs() < 1e-8, "{sum} {}", f.log_evidence);
    }
}

#[test]
fn an_exact_teacher_leads_to_the_exact_posterior() {
    let config = BridgeConfig { draws: 400, kept: 1, effective: 5.0 };
    let found = episodes(&Setting { q: 0.2, steps: 6, config, teacher: &Guess::exact }, 100);
    let least = found.iter().flat_map(|f| &f.reports).map(|r| r.effective_sample_size).fold(f64::INFINITY, f64::min);
    println!("smallest effective size {least:.1}");
    assert!(found.iter().flat_map(|f| &f.reports).all(|report| report.temperature == 1.0));
    let size = mean_and_error(&found.iter().map(|f| f.last().effective_sample_size).collect::<Vec<_>>()).0;
    assert!(size > 80.0, "the walk costs less than four fifths of the draws: {size}");
    assert_exact(&found, size);
    // ln of an unbiased estimate is low by half its relative variance, 1 / (2 size) or less.
    let errors: Vec<f64> = found
        .iter()
        .map(|f| f.reports.iter().map(|report| report.log_evidence).sum::<f64>() - f.log_evidence)
        .collect();
    let (mean, error) = mean_and_error(&errors);
    assert!(mean.abs() < 4.0 * error + 0.5 / size, "{mean} ± {error}");
}

#[test]
fn many_draws_from_the_prior_lead_to_the_exact_posterior() {
    let config = BridgeConfig { draws: 40_000, kept: 1, effective: 20.0 };
    let found = episodes(&Setting { q: 0.2, steps: 3, config, teacher: &Guess::prior }, 12);
    assert!(found.iter().all(|f| f.last().temperature == 1.0));
    // Few draws explain a truth that is far out: the smallest effective size decides what errors may be.
    let size = found.iter().map(|f| f.last().effective_sample_size).fold(f64::INFINITY, f64::min);
    assert_exact(&found, size);
}

#[test]
fn a_broad_and_shifted_teacher_is_corrected() {
    let teacher = |line: &Line| Guess::wrong(line, 1.0, 2.0, 0.5);
    let config = BridgeConfig { draws: 2000, kept: 1, effective: 10.0 };
    let found = episodes(&Setting { q: 0.2, steps: 6, config, teacher: &teacher }, 60);
    assert!(found.iter().flat_map(|f| &f.reports).all(|report| report.temperature == 1.0));
    let size = mean_and_error(&found.iter().map(|f| f.last().effective_sample_size).collect::<Vec<_>>()).0;
    assert_exact(&found, size);
}

#[test]
fn too_few_draws_show_as_width() {
    let config = BridgeConfig { draws: 100, kept: 1, effective: 50.0 };
    let found = episodes(&Setting { q: 0.2, steps: 6, config, teacher: &Guess::prior }, 300);
    let tempered = found.iter().filter(|f| f.last().temperature < 1.0).count();
    assert!(tempered == found.len(), "{tempered} of {}", found.len());
    for report in found.iter().map(Found::last) {
        // The effective size is a continuous function of the exponent: the bisection ends at the one asked for.
        assert!((report.effective_sample_size - 50.0).abs() < 1e-3, "{report:?}");
        assert!(report.effective_sample_size_before < 50.0, "{report:?}");
    }
    for (place, value) in PLACES {
        let ranks: Vec<f64> = found.iter().map(|f| f.rank(value)).collect();
        let covered = ranks.iter().filter(|rank| (0.05..=0.95).contains(*rank)).count() as f64 / ranks.len() as f64;
        let ratio =
            mean_and_error(&found.iter().map(|f| f.moments(value).1 / f.exact.moments(place).1).collect::<Vec<_>>()).0;
        println!("coverage {covered:.3}, variance {ratio:.2} times the posterior's");
        // A calibrated belief covers 90 %, and of 300 episodes less than 85 % with probability 0.003. The posterior's own variance would be a ratio of 1.
        assert!(covered >= 0.85, "{covered}");
        assert!(ratio > 1.5, "{ratio}");
    }
}

#[test]
fn what_lies_between_a_teacher_and_the_posterior_is_exact_too() {
    // A teacher that is broad, off and in doubt, so that neither end is near. Where earlier ones are kept, which err to the other side, draws come
    // from another density than the last teacher's.
    let teacher = |line: &Line| {
        let side = if line.readings.len() % 2 == 1 { -2.0 } else { 2.0 };
        Guess::wrong(line, side, 1.8, 0.6)
    };
    for (kept, effective) in [(1, 600.0), (3, 900.0)] {
        let config = BridgeConfig { draws: 1000, kept, effective };
        let mut found = episodes(&Setting { q: 0.0, steps: 5, config, teacher: &teacher }, 60);
        let powers: Vec<f64> = found.iter().map(|f| f.last().temperature).collect();
        assert!(powers.iter().all(|power| (0.1..0.9).contains(power)), "{powers:?}");
        // The posterior itself would be refused: averages are held to about 0.02 of its spreads.
        let away = |f: &Found| {
            let ((posterior, variance), (between, _)) = (f.exact.moments(SLOPE), f.bridge.moments(SLOPE));
            (posterior - between) / variance.sqrt()
        };
        let (mean, error) = mean_and_error(&found.iter().map(away).collect::<Vec<_>>());
        println!("the posterior's slope is {mean:.3} ± {error:.3} spreads away");
        assert!(mean.abs() > 0.1, "{mean}");
        found.iter_mut().for_each(|f| std::mem::swap(&mut f.exact, &mut f.bridge));
        assert_exact(&found, effective);
    }
}

#[test]
fn kept_draws_count_as_much_as_new_ones() {
    // Every teacher errs to another side, by as much as it is wide. What one of them suggests is mostly impossible.
    let teacher = |line: &Line| {
        let odd = line.readings.len() % 2 == 1;
        let guess = Guess::wrong(line, if odd { -1.0 } else { 1.0 }, 1.5, 0.5);
        Guess { impossible: if odd { 0.8 } else { 0.0 }, ..guess }
    };
    let of = |draws: usize, kept: usize| {
        let config = BridgeConfig { draws, kept, effective: 20.0 };
        episodes(&Setting { q: 0.2, steps: 6, config, teacher: &teacher }, 60)
    };
    let (kept, single) = (of(400, 5), of(2000, 1));
    for found in [&kept, &single] {
        assert!(found.iter().all(|f| f.last().temperature == 1.0));
        let size = mean_and_error(&found.iter().map(|f| f.last().effective_sample_size).collect::<Vec<_>>()).0;
        println!("effective size {size:.0}");
        assert_exact(found, size);
    }
    assert!(kept.iter().all(|f| f.last().particles == 2000), "five batches are kept");
    // A batch of this step's draws costs a replay of six steps, each of the four others and the one that is dropped a step.
    assert!(kept.iter().all(|f| f.last().transitions == 400 * 6 + 5 * 400));
}

#[test]
fn the_truths_ranks_are_uniform() {
    let teacher = |line: &Line| Guess::wrong(line, 0.0, 1.3, 0.2);
    let config = BridgeConfig { draws: 300, kept: 3, effective: 30.0 };
    let found = episodes(&Setting { q: 0.2, steps: 5, config, teacher: &teacher }, 600);
    for (_, value) in PLACES {
        let mut counts = [0.0; 10];
        for f in &found {
            counts[((10.0 * f.rank(value)) as usize).min(9)] += 1.0;
        }
        // Null: uniform over ten bins. χ² with 9 degrees of freedom exceeds 27.9 with probability 0.001.
        let chi_squared: f64 = counts.iter().map(|count: &f64| (count - 60.0).powi(2) / 60.0).sum();
        println!("χ² {chi_squared:.1}");
        assert!(chi_squared < 27.9, "{chi_squared}: {counts:?}");
    }
    // Null: P(second body) is the frequency of second bodies among worlds with such histories.
    let errors: Vec<f64> = found.iter().map(|f| f.second() - f64::from(u8::from(f.truth.height != 0.0))).collect();
    let (mean, error) = mean_and_error(&errors);
    assert!(mean.abs() < 4.0 * error, "{mean} ± {error}");
}

#[test]
fn results_are_the_same_for_any_number_of_threads() {
    let config = BridgeConfig { draws: 200, kept: 3, effective: 100.0 };
    let text = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let teacher = |line: &Line| Guess::wrong(line, 0.5, 1.5, 0.2);
            let setting = Setting { q: 0.2, steps: 6, config: config.clone(), teacher: &teacher };
            let found = episode(&setting, 0);
            // Debug writes every bit of a number.
            format!("{:?} {:?}", found.belief, found.reports)
        })
    };
    assert_eq!(text(1), text(2));
}

/// A teacher that suggests nothing.
#[derive(Clone)]
struct Mute;

impl Teacher for Mute {
    fn draw(&self, _rng: &mut Rng) -> Option<(Vec<usize>, Vec<f64>)> {
        None
    }

    fn log_ratio(&self, _: &[usize], _: &[f64]) -> f64 {
        f64::NEG_INFINITY
    }
}

#[test]
fn depletion_is_an_error_and_no_belief() {
    let config = BridgeConfig { draws: 50, kept: 3, effective: 20.0 };
    let mut rng = Seed(1).stream(Purpose::Test, 0);
    let mut line = Line::new(0.2, 0.3, 0.5);
    let mute = BridgeFilter::new(config.clone(), &line, Mute, &mut rng);
    assert!(matches!(mute, Err(Error::Depleted { .. })), "nothing was suggested");
    // A reading that has probability 0 in floating point, and one that is none.
    for reading in [1e200, f64::NAN] {
        line.readings = vec![0.5];
        let mut filter =
            BridgeFilter::new(config.clone(), &Line::new(0.2, 0.3, 0.5), Guess::prior(&line), &mut rng).unwrap();
        filter.update(&line, Guess::prior(&line), &mut rng).unwrap();
        line.readings.push(reading);
        let error = filter.update(&line, Guess::prior(&line), &mut rng).unwrap_err();
        assert!(matches!(error, Error::Depleted { attempts, .. } if attempts >= 50), "{error}");
        assert!(filter.belief().is_err(), "no belief is left");
    }
}

#[test]
fn what_the_latest_teacher_excludes_stays_possible() {
    // The second teacher says that there is no second body; the first one's draws of it are still explained, so that the posterior keeps them.
    let exact = |line: &Line| Guess::exact(line);
    let sure = |line: &Line| {
        let mut guess = Guess::exact(line);
        guess.second.0 = 0.0;
        guess
    };
    let teacher = |line: &Line| if line.readings.len() == 4 { sure(line) } else { exact(line) };
    let config = BridgeConfig { draws: 2000, kept: 3, effective: 20.0 };
    let found = episodes(&Setting { q: 0.2, steps: 4, config, teacher: &teacher }, 40);
    assert!(found.iter().all(|f| f.last().temperature == 1.0));
    let size = mean_and_error(&found.iter().map(|f| f.last().effective_sample_size).collect::<Vec<_>>()).0;
    assert_exact(&found, size);
}

#[test]
fn a_teacher_that_is_far_from_all_draws_does_not_leave_a_few_of_them() {
    // The last teacher is narrow, six standard deviations off, and next to nothing that it suggests is possible: its weights of the others' draws vary by
    // many nats.
    let teacher = |line: &Line| match line.readings.len() {
        4 => Guess { impossible: 1.0 - 1e-9, ..Guess::wrong(line, 6.0, 0.3, 0.0) },
        _ => Guess::wrong(line, 0.0, 6.0, 0.0),
    };
    // The draws do not suffice for the posterior either.
    let config = BridgeConfig { draws: 400, kept: 3, effective: 100.0 };
    let found = episodes(&Setting { q: 0.2, steps: 4, config, teacher: &teacher }, 10);
    for f in &found {
        let report = f.last();
        assert!(report.temperature == 0.0 && report.proposed == 0, "{report:?}");
        assert!((99.9..100.1).contains(&report.effective_sample_size), "{report:?}");
        assert!((f.belief.effective_sample_size() - report.effective_sample_size).abs() < 1e-6);
    }
}

#[test]
fn settings_outside_their_limits_are_refused() {
    let good = BridgeConfig::default();
    assert_eq!(good.validate(), Ok(()));
    for bad in [
        BridgeConfig { draws: 0, ..good.clone() },
        BridgeConfig { kept: 0, ..good.clone() },
        BridgeConfig { effective: 0.5, ..good.clone() },
        BridgeConfig { effective: f64::NAN, ..good.clone() },
        BridgeConfig { effective: 101.0, ..good.clone() },
    ] {
        assert!(matches!(bad.validate(), Err(Error::Config { .. })), "{bad:?}");
    }
}
