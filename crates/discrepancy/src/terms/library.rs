//! The terms that a lacking force is compared with.

use super::Coefficient;
use crate::trial::Window;
use crate::units::Units;

/// Frequencies that are tried, Hz, in steps by which a few seconds lose less than a quarter of a period. All episodes are taken to begin at the same phase.
const FREQUENCIES_HZ: [f64; 2] = [0.5, 8.3];
const STEP_HZ: f64 = 0.05;
/// Stripes on the table that are tried, m: the shortest and the longest, each a sixteenth longer than the one before.
const WAVES_M: [f64; 2] = [0.03, 0.3];
const NEXT: f64 = 1.0 + 1.0 / 16.0;
/// Places along each axis of where the object was, and a tenth beyond, from which something may pull.
const PLACES: usize = 21;
pub(super) const BEYOND: f64 = 0.1;
/// Nearer than this, m, it pulls less hard: bodies are no points.
const NEAREST_M: f64 = 0.03;

/// A term of the library. Forces on the object in base axes; u is the direction of its motion, v its velocity, p its place, t the time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Term {
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
pub(super) struct Middle {
    pub(super) place_m: [f64; 3],
    pub(super) mass_kg: f64,
    pub(super) axes: usize,
}

impl Term {
    /// All of the library; `masses`: whether known weights differ.
    pub(super) fn library(masses: bool, corners_m: [[f64; 2]; 2]) -> Vec<Self> {
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
    pub(super) fn columns(self, window: &Window, middle: &Middle) -> Vec<[f64; 3]> {
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

    /// Where it acts, in units of which `units` says how much one of today's is.
    pub(super) fn in_units(self, units: &Units) -> Self {
        let length = units.factor("m");
        match self {
            Self::NearPlace { place_m } => Self::NearPlace { place_m: place_m.map(|place| length * place) },
            Self::AgainstMotionInStripes { axis, wave_m } => {
                Self::AgainstMotionInStripes { axis, wave_m: length * wave_m }
            }
            term => term,
        }
    }

    pub(super) fn name(self) -> &'static str {
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
    pub(super) fn description(self) -> String {
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
                format!(
                    "towards ({x:.3}, {y:.3}) m, or from it where `strength` is negative, falling with the distance"
                )
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

    pub(super) fn coefficients(self, values: &[f64], middle: &Middle) -> Vec<Coefficient> {
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
