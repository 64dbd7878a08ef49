//! Units of sources, as factors to those of a log.

/// What a number measures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Dimension {
    Length,
    Angle,
    Time,
    Mass,
    Force,
    Torque,
    Speed,
    Spin,
}

/// One pound-force and one kilogram-force, N (NIST Special Publication 811, appendix B.8: exact by definition).
const LBF_N: f64 = 4.448_221_615_260_5;
const KGF_N: f64 = 9.806_65;
const INCH_M: f64 = 0.0254;
const DEGREE_RAD: f64 = std::f64::consts::PI / 180.0;

impl Dimension {
    /// Its units, each with the factor to that of a log, which comes first.
    fn units(self) -> &'static [(&'static str, f64)] {
        match self {
            Self::Length => &[("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("um", 1e-6), ("in", INCH_M)],
            Self::Angle => &[("rad", 1.0), ("deg", DEGREE_RAD), ("mrad", 0.001)],
            Self::Time => &[("s", 1.0), ("ms", 0.001), ("us", 1e-6), ("ns", 1e-9)],
            Self::Mass => &[("kg", 1.0), ("g", 0.001)],
            Self::Force => &[("N", 1.0), ("mN", 0.001), ("kN", 1000.0), ("kgf", KGF_N), ("lbf", LBF_N)],
            Self::Torque => &[
                ("Nm", 1.0),
                ("mNm", 0.001),
                ("Ncm", 0.01),
                ("Nmm", 0.001),
                ("kgfcm", KGF_N * 0.01),
                ("lbfin", LBF_N * INCH_M),
            ],
            Self::Speed => &[("m/s", 1.0), ("cm/s", 0.01), ("mm/s", 0.001)],
            Self::Spin => &[("rad/s", 1.0), ("deg/s", DEGREE_RAD), ("rpm", 6.0 * DEGREE_RAD)],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Length => "length",
            Self::Angle => "angle",
            Self::Time => "time",
            Self::Mass => "mass",
            Self::Force => "force",
            Self::Torque => "torque",
            Self::Speed => "speed",
            Self::Spin => "angular velocity",
        }
    }

    /// The factor of a unit, that of the log where none is named; what was expected where there is no such unit.
    pub(crate) fn factor(self, unit: Option<&str>) -> Result<f64, String> {
        let Some(unit) = unit else { return Ok(1.0) };
        self.units().iter().find(|(name, _)| *name == unit).map(|(_, factor)| *factor).ok_or_else(|| {
            let names: Vec<&str> = self.units().iter().map(|(name, _)| *name).collect();
            format!("expected a unit of {} ({}), found {}", self.name(), names.join(", "), crate::error::excerpt(unit))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factors_are_those_of_the_definitions() {
        for (dimension, unit, factor) in [
            (Dimension::Length, "mm", 0.001),
            (Dimension::Angle, "deg", 0.017_453_292_519_943_295),
            (Dimension::Time, "ns", 1e-9),
            (Dimension::Mass, "g", 0.001),
            (Dimension::Torque, "kgfcm", 0.098_066_5),
            (Dimension::Spin, "rpm", std::f64::consts::TAU / 60.0),
        ] {
            let found = dimension.factor(Some(unit)).unwrap();
            assert!((found / factor - 1.0).abs() < 1e-12, "{unit}: {found}");
        }
        assert_eq!(Dimension::Force.factor(None), Ok(1.0));
    }

    #[test]
    fn a_unit_of_another_dimension_is_answered_with_those_that_fit() {
        let message = Dimension::Length.factor(Some("deg")).unwrap_err();
        assert_eq!(message, "expected a unit of length (m, cm, mm, um, in), found `deg`");
    }
}
