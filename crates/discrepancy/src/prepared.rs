//! A log and its nominal model as they are simulated: driven by what the arm did, in units of the object, with the tick of the stamps.

use std::borrow::Cow;

use measured_log::Log;

use crate::driven::driven;
use crate::error::Error;
use crate::noise::NoiseLevels;
use crate::nominal::Nominal;
use crate::plausible;
use crate::stamps::period_secs;
use crate::units::Units;

pub(crate) struct Prepared<'a> {
    pub(crate) log: Cow<'a, Log>,
    pub(crate) nominal: Nominal,
    pub(crate) noise: NoiseLevels,
    /// Those of what is simulated, in units of the log.
    pub(crate) units: Units,
}

impl<'a> Prepared<'a> {
    /// Of a log called `name` in which at least so many episodes show motion.
    ///
    /// # Errors
    ///
    /// [`Error::Unfit`] for a log that cannot be simulated, or whose numbers cannot mean what they say.
    pub(crate) fn new(log: &'a Log, name: &str, nominal: &Nominal, least: usize) -> Result<Self, Error> {
        let driven = driven(log, name, nominal)?;
        let units = Units::of(&driven);
        let mut log = match driven {
            Cow::Borrowed(log) => units.inverse().log(log),
            Cow::Owned(log) => Cow::Owned(units.inverse().log(&log).into_owned()),
        };
        let period_secs = period_secs(&log);
        if period_secs != log.header.period_secs {
            log.to_mut().header.period_secs = period_secs;
        }
        let nominal = nominal.in_units(&units.inverse())?.with_period_secs(period_secs);
        let noise = NoiseLevels::of_log(&log);
        plausible::check(&log, name, &nominal, (&noise, &units), least)?;
        Ok(Self { log, nominal, noise, units })
    }
}
