//! What the force on the object that no model explains follows: sparse terms in the object's motion, its place and the time.
//!
//! An effect that the catalogue does not have is described by a regression of what is lacking ([`crate::trial`], windows of an episode) on a library of
//! terms, one added after another as long as episodes that it was not fitted to are explained better by it (sparse regression with forward selection: Brunton,
//! Proctor & Kutz, PNAS 113, 2016, by Efroymson's steps instead of thresholds). Episodes are left out, never single windows: what an episode does lasts.

use nalgebra::{DMatrix, DVector};
use physics_model::EffectConfig;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use crate::fit::Fit;
use crate::replay::Replay;
use crate::simulator::Simulator;
use crate::trial::Window;
use crate::units::Units;

mod library;

use library::{BEYOND, Middle, Term};

/// Terms, at most, beside another friction.
const TERMS: usize = 3;
/// Parts that are left out in turn.
const PARTS: usize = 5;
/// Chance that a term gains as much in single episodes by luck, by Student's t: it is the best of some hundreds, most of which say nearly the same.
const CHANCE: f64 = 0.001;
/// Of terms that explain nearly as much as the best, to this share of all, the simplest is taken.
const NEARLY: f64 = 0.02;
/// Of an episode of which less than this share of a mean episode's square is left, little is gained.
const FLOOR: f64 = 0.1;
/// A term has to explain this share of all.
const LEAST_SHARE: f64 = 0.03;
/// What differs from one episode to the next is told if it is more than this share of what is left.
const MOST: f64 = 0.5;
/// Windows and episodes that say anything.
const LEAST: [usize; 2] = [40, 6];
/// Force on the object that a model lacks, the re-tuned nominal one in reports, and what it follows. Base axes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LackingForce {
    /// Windows of some hundredths of a second in which the object moves.
    pub windows: usize,
    /// Episodes that they are of: those explained worst.
    pub episodes: usize,
    /// Root mean square of its size, N.
    pub root_mean_square_n: f64,
    /// The same of what the sensors' noise alone makes, N.
    pub noise_n: f64,
    /// Share of its square, weighted by what the sensors' noise leaves of a window, that all terms and another friction explain in episodes left out. The terms were chosen by it.
    pub explained_share: f64,
    /// Share of what they leave that is one force in each episode and another in the next, beyond chance.
    pub between_episodes_share: f64,
    /// Terms, the first that was found first; none where it follows none of the library.
    pub terms: Vec<FoundTerm>,
}

impl LackingForce {
    /// In words.
    pub(crate) fn sentence(&self) -> String {
        let lacks = format!(
            "the re-tuned nominal model lacks a force on the object of {:.2} N (root mean square beyond noise, while the object moves)",
            (self.root_mean_square_n.powi(2) - self.noise_n.powi(2)).max(0.0).sqrt()
        );
        let differs = if self.between_episodes_share > MOST {
            format!(
                "; {:.0} % of what is left of it is constant within an episode and differs between episodes: look for what changes between them (how the object \
                 stands, the surface, the zero of the force sensor)",
                100.0 * self.between_episodes_share
            )
        } else {
            String::new()
        };
        if self.terms.is_empty() {
            return format!("{lacks}; it follows none of the terms that were tried{differs}");
        }
        let terms: Vec<String> =
            self.terms.iter().map(|term| format!("{} ({:.0} %)", term.description, 100.0 * term.share)).collect();
        format!("{lacks}: {}{differs}", terms.join("; "))
    }
}

/// A term that it follows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FoundTerm {
    /// Name.
    pub name: &'static str,
    /// In words.
    pub description: String,
    /// What it adds to the share explained.
    pub share: f64,
    /// Its coefficients beside the others.
    pub coefficients: Vec<Coefficient>,
}

/// A coefficient.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Coefficient {
    /// Key.
    pub key: &'static str,
    /// Unit.
    pub unit: &'static str,
    /// Value.
    pub value: f64,
}

/// Normal equations of an episode.
#[derive(Clone, Debug)]
struct Normal {
    gram: DMatrix<f64>,
    moment: DVector<f64>,
    square: f64,
}

impl Normal {
    fn zero(columns: usize) -> Self {
        Self { gram: DMatrix::zeros(columns, columns), moment: DVector::zeros(columns), square: 0.0 }
    }

    fn of(windows: &[Window], terms: &[Term], middle: &Middle, scatter_n2: f64) -> Self {
        let mut normal: Option<Self> = None;
        for window in windows {
            let columns: Vec<[f64; 3]> = terms.iter().flat_map(|term| term.columns(window, middle)).collect();
            let sums = normal.get_or_insert_with(|| Self::zero(columns.len()));
            let weight = 1.0 / (scatter_n2 + window.variance_n2);
            for axis in 0..middle.axes {
                let row = DVector::from_iterator(columns.len(), columns.iter().map(|column| column[axis]));
                sums.gram.ger(weight, &row, &row, 1.0);
                sums.moment.axpy(weight * window.lacking_n[axis], &row, 1.0);
                sums.square += weight * window.lacking_n[axis].powi(2);
            }
        }
        normal.unwrap_or_else(|| Self::zero(0))
    }

    /// Least squares; a little of each column's own square keeps what two of them share small.
    fn solve(&self) -> Option<DVector<f64>> {
        let mut gram = self.gram.clone();
        for i in 0..gram.nrows() {
            gram[(i, i)] = gram[(i, i)] * (1.0 + 1e-6) + 1e-12;
        }
        Some(gram.cholesky()?.solve(&self.moment))
    }

    fn left(&self, x: &DVector<f64>) -> f64 {
        self.square - 2.0 * self.moment.dot(x) + (&self.gram * x).dot(x)
    }
}

/// The sum of some.
fn sum<'a>(normals: impl Iterator<Item = &'a Normal>, columns: usize) -> Normal {
    normals.fold(Normal::zero(columns), |mut sum, one| {
        sum.gram += &one.gram;
        sum.moment += &one.moment;
        sum.square += one.square;
        sum
    })
}

/// What is left of each episode by coefficients that were fitted to others.
fn left_out(episodes: &[Normal]) -> Option<Vec<f64>> {
    let columns = episodes.first()?.moment.len();
    let solutions: Vec<DVector<f64>> = (0..PARTS)
        .map(|part| {
            let others = episodes.iter().enumerate().filter(|(i, _)| i % PARTS != part).map(|(_, normal)| normal);
            sum(others, columns).solve()
        })
        .collect::<Option<_>>()?;
    Some(episodes.iter().enumerate().map(|(i, normal)| normal.left(&solutions[i % PARTS])).collect())
}

/// Student's t of what single episodes gain, as a share of what is left of each before and after: long episodes hold nearly all of a sum of squares.
fn standing_out(before: &[f64], after: &[f64]) -> f64 {
    let n = before.len() as f64;
    let floor = FLOOR * before.iter().sum::<f64>() / n;
    let gains: Vec<f64> = before.iter().zip(after).map(|(b, a)| (b - a) / (b + a + floor)).collect();
    let mean = gains.iter().sum::<f64>() / n;
    let variance = gains.iter().map(|gain| (gain - mean).powi(2)).sum::<f64>() / (n - 1.0);
    mean / (variance / n).sqrt().max(1e-9)
}

/// From where to where something along an axis may pull, m: where the object was, and beyond.
fn reach<'a>(windows: impl Iterator<Item = &'a Window>, axis: usize) -> [f64; 2] {
    let wider = |[low, high]: [f64; 2], w: &Window| [low.min(w.place_m[axis]), high.max(w.place_m[axis])];
    let [low, high] = windows.fold([f64::INFINITY, f64::NEG_INFINITY], wider);
    [low - BEYOND * (high - low), high + BEYOND * (high - low)]
}

/// Share of the square of what terms leave that a mean of its own for each episode explains, beyond what chance gives to so many means (ω², Hays 1963, of a
/// one-way analysis of variance about 0).
fn between_episodes(episodes: &[&Vec<Window>], terms: &[Term], values: &[f64], middle: &Middle) -> f64 {
    let left = |window: &Window| -> [f64; 3] {
        let columns = terms.iter().flat_map(|term| term.columns(window, middle));
        columns.zip(values).fold(window.lacking_n, |left, (column, value)| {
            std::array::from_fn(|axis| left[axis] - value * column[axis])
        })
    };
    let (mut total, mut between, mut freedoms) = (0.0, 0.0, 0.0);
    for windows in episodes {
        let left: Vec<[f64; 3]> = windows.iter().map(left).collect();
        let n = left.len() as f64;
        for axis in 0..middle.axes {
            total += left.iter().map(|force| force[axis].powi(2)).sum::<f64>();
            between += left.iter().map(|force| force[axis]).sum::<f64>().powi(2) / n;
        }
        freedoms += (n - 1.0) * middle.axes as f64;
    }
    let within = (total - between) / f64::max(freedoms, 1.0);
    ((between - (episodes.len() * middle.axes) as f64 * within) / (total + within).max(1e-300)).clamp(0.0, 1.0)
}

fn in_units(mut coefficients: Vec<Coefficient>, units: &Units) -> Vec<Coefficient> {
    coefficients.iter_mut().for_each(|coefficient| coefficient.value *= units.factor(coefficient.unit));
    coefficients
}

/// What is lacking, and what it follows; `None` where too little moves to say. `episodes`: the windows of each.
fn describe(episodes: &[Vec<Window>], axes: usize, units: &Units) -> Option<LackingForce> {
    let episodes: Vec<&Vec<Window>> = episodes.iter().filter(|windows| !windows.is_empty()).collect();
    let all = || episodes.iter().flat_map(|windows| windows.iter());
    let count = all().count();
    if count < LEAST[0] || episodes.len() < LEAST[1] {
        return None;
    }
    let mean = |pick: &dyn Fn(&Window) -> f64| all().map(pick).sum::<f64>() / count as f64;
    let middle = Middle {
        place_m: std::array::from_fn(|i| mean(&|window| window.place_m[i])),
        mass_kg: mean(&|window| window.mass_kg),
        axes,
    };
    let masses = all().any(|window| (window.mass_kg - middle.mass_kg).abs() > 0.01 * middle.mass_kg);
    // Where much is lacking the sensor's noise is not what makes a window worth less.
    let mut squares: Vec<f64> = all().map(|w| w.lacking_n[..axes].iter().map(|f| f * f).sum::<f64>()).collect();
    squares.sort_by(f64::total_cmp);
    let scatter_n2 = (squares[count / 2] / axes as f64).max(1e-12);
    let normals = |terms: &[Term]| -> Vec<Normal> {
        episodes.iter().map(|windows| Normal::of(windows, terms, &middle, scatter_n2)).collect()
    };
    let [x, y] = [0, 1].map(|axis| reach(all(), axis));
    let library = Term::library(masses, [[x[0], y[0]], [x[1], y[1]]]);
    let total: f64 = normals(&[]).iter().map(|normal| normal.square).sum();
    // What re-tuning moves is no discovery: whatever else there is acts beside another friction.
    let mut terms = vec![Term::AgainstMotion];
    let mut left = left_out(&normals(&terms))?;
    let mut shares = vec![1.0 - left.iter().sum::<f64>() / total];
    let law = StudentsT::new(0.0, 1.0, (episodes.len() - 1) as f64).ok()?;
    let least = law.inverse_cdf(1.0 - CHANCE);
    while terms.len() <= TERMS {
        let tried = library.iter().filter(|term| !terms.iter().any(|other| other.name() == term.name()));
        let sure: Vec<(f64, Term, Vec<f64>)> = tried
            .filter_map(|term| {
                let with = [terms.as_slice(), &[*term]].concat();
                let after = left_out(&normals(&with))?;
                let gain: f64 = left.iter().zip(&after).map(|(before, after)| before - after).sum();
                let sure = gain > LEAST_SHARE * total && standing_out(&left, &after) > least;
                sure.then_some((gain, *term, after))
            })
            .collect();
        let most = sure.iter().map(|tried| tried.0).fold(0.0, f64::max);
        let width = |term: &Term| term.columns(&episodes[0][0], &middle).len();
        let near = sure.into_iter().filter(|tried| tried.0 > most - NEARLY * total);
        let best = near.min_by(|a, b| width(&a.1).cmp(&width(&b.1)).then(b.0.total_cmp(&a.0)));
        let Some((gain, term, after)) = best else { break };
        terms.push(term);
        shares.push(gain / total);
        left = after;
    }
    let normals = normals(&terms);
    let values = sum(normals.iter(), normals[0].moment.len()).solve()?;
    let mut first = 0;
    let found = (terms.iter().zip(&shares))
        .filter_map(|(term, share)| {
            let width = term.columns(&episodes[0][0], &middle).len();
            let own = &values.as_slice()[first..first + width];
            first += width;
            (*share > LEAST_SHARE).then(|| FoundTerm {
                name: term.name(),
                description: term.in_units(units).description(),
                share: *share,
                coefficients: in_units(term.coefficients(own, &middle), units),
            })
        })
        .collect();
    let newton = units.factor("N");
    let root = |mean_square: f64| newton * (mean_square * axes as f64).sqrt();
    Some(LackingForce {
        windows: count,
        episodes: episodes.len(),
        root_mean_square_n: newton * (squares.iter().sum::<f64>() / count as f64).sqrt(),
        noise_n: root(mean(&|window| window.variance_n2)),
        explained_share: shares.iter().sum(),
        between_episodes_share: between_episodes(&episodes, &terms, values.as_slice(), &middle),
        terms: found,
    })
}

/// What force a fit lacks in replayed episodes; `None` where too little moves to say. In units of which `units` says how much one of today's is.
pub(crate) fn lacking_force(
    simulator: &Simulator,
    fit: &Fit,
    episodes: &[Vec<Replay>],
    units: &Units,
) -> Option<LackingForce> {
    let nominal = simulator.nominal;
    let hypothesis = fit.model.hypothesis(&fit.x);
    let engine = nominal.engine();
    let (rolls, gravity_mps2) = (nominal.rolls(), nominal.header().gravity_mps2);
    // Another friction takes the nominal one's place. A friction or a mass that changes on the way counts as the nominal one.
    let level = hypothesis.effects.iter().find_map(|effect| match effect {
        EffectConfig::FrictionLevel(level) => Some(level.coefficient),
        _ => None,
    });
    let windows = |replay: &Replay| {
        let Replay { trial, start, readings } = replay;
        let phases = trial.phases(readings, rolls, gravity_mps2);
        let object = nominal.object(&hypothesis.z, trial.added_mass_kg, &engine);
        let mass_kg = object.mass_kg + object.added_mass_kg;
        let slides = nominal.has_tool() && !rolls;
        let friction_n = if slides { level.unwrap_or(object.friction) * mass_kg * gravity_mps2 } else { 0.0 };
        trial.windows(start, readings, &phases, mass_kg, friction_n)
    };
    let episodes: Vec<Vec<Window>> = episodes.iter().map(|pieces| pieces.iter().flat_map(windows).collect()).collect();
    describe(&episodes, if nominal.has_tool() { 2 } else { 3 }, units)
}

#[cfg(test)]
mod tests;
