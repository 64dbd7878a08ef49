//! What the force on the object that no model explains follows: sparse terms in the object's motion, its place and the time.
//!
//! An effect that the catalogue does not have is described by a regression of what is lacking ([`crate::trial`], windows of an episode) on a library of
//! terms, one added after another as long as episodes that it was not fitted to are explained better by it (sparse regression with forward selection: Brunton,
//! Proctor & Kutz, PNAS 113, 2016, by Efroymson's steps instead of thresholds). Episodes are left out, never single windows: what an episode does lasts.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use crate::fit::Fit;
use crate::likelihood::mean_square;
use crate::simulator::{Nudge, Simulator};
use crate::trial::{Window, groups};

/// Episodes that are simulated for it, the worst explained ones.
const EPISODES: usize = 20;
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
/// Windows and episodes that say anything.
const LEAST: [usize; 2] = [40, 6];
/// Frequencies that are tried, Hz, in steps by which a few seconds lose less than a quarter of a period. All episodes are taken to begin at the same phase.
const FREQUENCIES_HZ: [f64; 2] = [0.5, 8.3];
const STEP_HZ: f64 = 0.05;
/// Stripes on the table that are tried, m: the shortest and the longest, each a sixteenth longer than the one before.
const WAVES_M: [f64; 2] = [0.03, 0.3];
const NEXT: f64 = 1.0 + 1.0 / 16.0;
/// Places along each axis of where the object was, and a tenth beyond, from which something may pull.
const PLACES: usize = 21;
const BEYOND: f64 = 0.1;
/// Nearer than this, m, it pulls less hard: bodies are no points.
const NEAREST_M: f64 = 0.03;

/// Force on the object that the re-tuned nominal model lacks, and what it follows. Base axes.
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
    /// Terms, the first that was found first; none where it follows none of the library.
    pub terms: Vec<FoundTerm>,
}

impl LackingForce {
    /// In words.
    pub(crate) fn sentence(&self) -> String {
        let lacks = format!(
            "the re-tuned nominal model lacks a force on the object, {:.2} N (root mean square beyond noise while it moves)",
            (self.root_mean_square_n.powi(2) - self.noise_n.powi(2)).max(0.0).sqrt()
        );
        if self.terms.is_empty() {
            return format!("{lacks}, that follows no term that was tried");
        }
        let terms: Vec<String> =
            self.terms.iter().map(|term| format!("{} ({:.0} %)", term.description, 100.0 * term.share)).collect();
        format!("{lacks}: {}", terms.join("; "))
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

/// A term of the library. Forces on the object in base axes; u is the direction of its motion, v its velocity, p its place, t the time.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Term {
    /// c.
    Constant,
    /// −c u.
    AgainstMotion,
    /// c ẑ × u.
    Sideways,
    /// −c v.
    Velocity,
    /// −c |v| v.
    SpeedSquared,
    /// −u (c₁ cos 2φ + c₂ sin 2φ), φ the angle of u.
    TwiceDirection,
    /// −k (p − a).
    TowardsPlace,
    /// k ẑ × (p − a).
    AroundPlace,
    /// k (a − p) / r³, no nearer than `NEAREST_M`: pulls (or pushes) that fall with the square of the distance r.
    NearPlace { place_m: [f64; 2] },
    /// −u (g · p).
    AgainstMotionByPlace,
    /// −u (c₁ cos + c₂ sin of 2π p / wave) along base x or y.
    AgainstMotionInStripes { axis: usize, wave_m: f64 },
    /// c t.
    Time,
    /// −c t u.
    AgainstMotionByTime,
    /// c₁ cos + c₂ sin of 2π t / period, both vectors.
    Periodic { period_secs: f64 },
    /// c (m − m̄).
    Mass,
    /// −c (m − m̄) u.
    AgainstMotionByMass,
    /// The simulated force at the wrist, its components by gains of their own.
    Force,
}

/// What coefficients are about: means over all windows.
#[derive(Clone, Copy, Debug)]
struct Middle {
    place_m: [f64; 3],
    mass_kg: f64,
    axes: usize,
}

impl Term {
    /// All of the library; `masses`: whether known weights differ.
    fn library(masses: bool, corners_m: [[f64; 2]; 2]) -> Vec<Self> {
        let mut all = vec![
            Self::Constant,
            Self::AgainstMotion,
            Self::Sideways,
            Self::Velocity,
            Self::SpeedSquared,
            Self::TwiceDirection,
            Self::TowardsPlace,
            Self::AroundPlace,
            Self::AgainstMotionByPlace,
            Self::Time,
            Self::AgainstMotionByTime,
            Self::Force,
        ];
        if masses {
            all.extend([Self::Mass, Self::AgainstMotionByMass]);
        }
        all.extend(steps(WAVES_M).flat_map(|wave_m| [0, 1].map(|axis| Self::AgainstMotionInStripes { axis, wave_m })));
        let at = |axis: usize, i: usize| {
            let [low, high] = [0, 1].map(|corner| corners_m[corner][axis]);
            low + (high - low) * i as f64 / (PLACES - 1) as f64
        };
        let places = (0..PLACES * PLACES).map(|i| [at(0, i % PLACES), at(1, i / PLACES)]);
        all.extend(places.map(|place_m| Self::NearPlace { place_m }));
        let [lowest_hz, highest_hz] = FREQUENCIES_HZ;
        let count = ((highest_hz - lowest_hz) / STEP_HZ) as usize;
        let period_secs = |i: usize| 1.0 / (lowest_hz + STEP_HZ * i as f64);
        all.extend((0..=count).map(|i| Self::Periodic { period_secs: period_secs(i) }));
        all
    }

    /// Its columns in a window: forces for coefficients of 1.
    fn columns(self, window: &Window, middle: &Middle) -> Vec<[f64; 3]> {
        let v = window.velocity_mps;
        let speed = v.iter().map(|v| v * v).sum::<f64>().sqrt();
        let against = v.map(|v| -v / speed);
        let times = |factor: f64, vector: [f64; 3]| vector.map(|x| factor * x);
        let around = |[x, y, _]: [f64; 3]| [-y, x, 0.0];
        let unit = |axis: usize| -> [f64; 3] { std::array::from_fn(|i| f64::from(u8::from(i == axis))) };
        let units = |factor: f64| (0..middle.axes).map(move |axis| times(factor, unit(axis)));
        let from: [f64; 3] = std::array::from_fn(|i| window.place_m[i] - middle.place_m[i]);
        let wave = |place: f64, length: f64| (std::f64::consts::TAU * place / length).sin_cos();
        match self {
            Self::Constant => units(1.0).collect(),
            Self::AgainstMotion => vec![against],
            Self::Sideways => vec![times(-1.0, around(against))],
            Self::Velocity => vec![times(-1.0, v)],
            Self::SpeedSquared => vec![times(-speed, v)],
            Self::TwiceDirection => {
                let (sin, cos) = (2.0 * v[1].atan2(v[0])).sin_cos();
                vec![times(cos, against), times(sin, against)]
            }
            Self::TowardsPlace => std::iter::once(times(-1.0, from)).chain(units(1.0)).collect(),
            Self::AroundPlace => std::iter::once(around(from)).chain(units(1.0).take(2)).collect(),
            Self::NearPlace { place_m: [x, y] } => {
                let way = [x - window.place_m[0], y - window.place_m[1], 0.0];
                vec![times(way[0].hypot(way[1]).max(NEAREST_M).powi(-3), way)]
            }
            Self::AgainstMotionByPlace => (0..2).map(|axis| times(from[axis], against)).collect(),
            Self::AgainstMotionInStripes { axis, wave_m } => {
                let (sin, cos) = wave(window.place_m[axis], wave_m);
                vec![times(cos, against), times(sin, against)]
            }
            Self::Time => units(window.time_secs).collect(),
            Self::AgainstMotionByTime => vec![times(window.time_secs, against)],
            Self::Periodic { period_secs } => {
                let (sin, cos) = wave(window.time_secs, period_secs);
                units(cos).chain(units(sin)).collect()
            }
            Self::Mass => units(window.mass_kg - middle.mass_kg).collect(),
            Self::AgainstMotionByMass => vec![times(window.mass_kg - middle.mass_kg, against)],
            Self::Force => (0..2).map(|axis| times(window.simulated_n[axis], unit(axis))).collect(),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant",
            Self::AgainstMotion => "against_motion",
            Self::Sideways => "sideways",
            Self::Velocity => "velocity",
            Self::SpeedSquared => "speed_squared",
            Self::TwiceDirection => "twice_direction",
            Self::TowardsPlace => "towards_place",
            Self::AroundPlace => "around_place",
            Self::NearPlace { .. } => "near_place",
            Self::AgainstMotionByPlace => "against_motion_by_place",
            Self::AgainstMotionInStripes { .. } => "against_motion_in_stripes",
            Self::Time => "time",
            Self::AgainstMotionByTime => "against_motion_by_time",
            Self::Periodic { .. } => "periodic",
            Self::Mass => "mass",
            Self::AgainstMotionByMass => "against_motion_by_mass",
            Self::Force => "force",
        }
    }

    /// In words.
    fn description(self) -> String {
        match self {
            Self::Constant => "constant".into(),
            Self::AgainstMotion => "against the motion, whatever the speed (sign v)".into(),
            Self::Sideways => "square to the motion".into(),
            Self::Velocity => "against the motion, in proportion to the speed (v)".into(),
            Self::SpeedSquared => "against the motion, with the square of the speed (|v| v)".into(),
            Self::TwiceDirection => "against the motion, twice a turn of its direction".into(),
            Self::TowardsPlace => "towards a place, in proportion to the distance".into(),
            Self::AroundPlace => "around a place, in proportion to the distance".into(),
            Self::NearPlace { place_m: [x, y] } => {
                format!("towards or from ({x:.3}, {y:.3}) m, falling with the distance")
            }
            Self::AgainstMotionByPlace => "against the motion, changing along the table".into(),
            Self::AgainstMotionInStripes { axis, wave_m } => {
                format!("against the motion, in stripes of {:.0} mm along {}", 1e3 * wave_m, ["x", "y"][axis])
            }
            Self::Time => "in proportion to the time".into(),
            Self::AgainstMotionByTime => "against the motion, in proportion to the time".into(),
            Self::Periodic { period_secs } => format!("periodic in time, {period_secs:.2} s"),
            Self::Mass => "in proportion to the known weight".into(),
            Self::AgainstMotionByMass => "against the motion, in proportion to the known weight".into(),
            Self::Force => "in proportion to the force at the wrist, axis by axis".into(),
        }
    }

    fn coefficients(self, values: &[f64], middle: &Middle) -> Vec<Coefficient> {
        let one = |key: &'static str, unit: &'static str, value: f64| Coefficient { key, unit, value };
        let keyed = |keys: &[&'static str], unit: &'static str| -> Vec<Coefficient> {
            keys.iter().zip(values).map(|(key, value)| one(key, unit, *value)).collect()
        };
        const AXES: [&str; 3] = ["x", "y", "z"];
        // −k (p − a) as −k (p − p̄) + c, with a = p̄ + c / k.
        let place = |at: [f64; 2]| vec![one("strength", "N/m", values[0]), one("x", "m", at[0]), one("y", "m", at[1])];
        let shift = |i: usize| if values[0] == 0.0 { 0.0 } else { values[i] / values[0] };
        match self {
            Self::Constant => keyed(&AXES, "N"),
            Self::AgainstMotion | Self::Sideways => keyed(&["size"], "N"),
            Self::Velocity => keyed(&["size"], "N s/m"),
            Self::SpeedSquared => keyed(&["size"], "N s²/m²"),
            Self::TwiceDirection => keyed(&["cos", "sin"], "N"),
            Self::TowardsPlace => place([middle.place_m[0] + shift(1), middle.place_m[1] + shift(2)]),
            Self::AroundPlace => place([middle.place_m[0] - shift(2), middle.place_m[1] + shift(1)]),
            Self::NearPlace { place_m: [x, y] } => {
                [keyed(&["strength"], "N m²"), vec![one("x", "m", x), one("y", "m", y)]].concat()
            }
            Self::AgainstMotionByPlace => keyed(&AXES, "N/m"),
            Self::AgainstMotionInStripes { wave_m, .. } => {
                [keyed(&["cos", "sin"], "N"), vec![one("wave", "m", wave_m)]].concat()
            }
            Self::Time => keyed(&AXES, "N/s"),
            Self::AgainstMotionByTime => keyed(&["size"], "N/s"),
            Self::Periodic { period_secs } => {
                let axes = middle.axes;
                let keys = [["cos_x", "cos_y", "cos_z"], ["sin_x", "sin_y", "sin_z"]];
                let keys: Vec<&str> = keys.iter().flat_map(|keys| keys[..axes].to_vec()).collect();
                [keyed(&keys, "N"), vec![one("period", "s", period_secs)]].concat()
            }
            Self::Mass => keyed(&AXES, "N/kg"),
            Self::AgainstMotionByMass => keyed(&["size"], "N/kg"),
            Self::Force => keyed(&AXES, "N/N"),
        }
    }
}

fn steps([shortest, longest]: [f64; 2]) -> impl Iterator<Item = f64> {
    std::iter::successors(Some(shortest), |value| Some(value * NEXT)).take_while(move |value| *value <= longest)
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

/// What is lacking, and what it follows; `None` where too little moves to say. `episodes`: the windows of each.
fn describe(episodes: &[Vec<Window>], axes: usize) -> Option<LackingForce> {
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
    let reach = |axis: usize| {
        let fold = |start: f64, pick: fn(f64, f64) -> f64| all().map(|w| w.place_m[axis]).fold(start, pick);
        let [low, high] = [fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max)];
        [low - BEYOND * (high - low), high + BEYOND * (high - low)]
    };
    let [x, y] = [reach(0), reach(1)];
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
                description: term.description(),
                share: *share,
                coefficients: term.coefficients(own, &middle),
            })
        })
        .collect();
    let root = |mean_square: f64| (mean_square * axes as f64).sqrt();
    Some(LackingForce {
        windows: count,
        episodes: episodes.len(),
        root_mean_square_n: (squares.iter().sum::<f64>() / count as f64).sqrt(),
        noise_n: root(mean(&|window| window.variance_n2)),
        explained_share: shares.iter().sum(),
        terms: found,
    })
}

/// What force a fit lacks in the episodes, or pieces of them, that it was fitted to; `None` where too little moves to say.
pub(crate) fn lacking_force(simulator: &Simulator, chosen: &[usize], fit: &Fit) -> Option<LackingForce> {
    let nominal = simulator.nominal;
    let hypothesis = fit.model.hypothesis(&fit.x);
    let engine = nominal.engine();
    let mut groups = groups(chosen.iter().map(|index| &simulator.trials[*index]));
    let error = |group: &std::ops::Range<usize>| mean_square(&fit.residuals[group.clone()]);
    groups.sort_by(|a, b| error(b).total_cmp(&error(a)));
    groups.truncate(EPISODES);
    groups.sort_by_key(|group| group.start);
    let (rolls, gravity_mps2) = (nominal.rolls(), nominal.header().gravity_mps2);
    let windows = |index: &usize| {
        let trial = &simulator.trials[*index];
        let (start, readings) = simulator.readings(&hypothesis, &engine, Nudge::default(), trial);
        let phases = trial.phases(&readings, rolls, gravity_mps2);
        let object = nominal.object(&hypothesis.z, trial.added_mass_kg, &engine);
        let mass_kg = object.mass_kg + object.added_mass_kg;
        let slides = nominal.has_tool() && !rolls;
        let friction_n = if slides { object.friction * mass_kg * gravity_mps2 } else { 0.0 };
        trial.windows(&start, &readings, &phases, mass_kg, friction_n)
    };
    let episodes: Vec<Vec<Window>> =
        groups.into_iter().map(|group| chosen[group].iter().flat_map(windows).collect()).collect();
    describe(&episodes, if nominal.has_tool() { 2 } else { 3 })
}

#[cfg(test)]
mod tests;
