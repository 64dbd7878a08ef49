//! A log as columns of numbers, as tables in memory hold it: NaN is a missing reading.

use std::path::Path;

use crate::columns::{Cell, Columns, Role};
use crate::error::Problem;
use crate::{Error, Header, Log, MAX_ROWS, Readings};

impl Log {
    /// Of columns by the names that they have in `samples.csv`, one number a row: SI units, NaN where nothing was read. `name` stands for the file in
    /// what is said of a wrong one.
    ///
    /// # Errors
    ///
    /// [`Error`] as [`crate::read`] gives for the same table in a file.
    ///
    /// ```
    /// # use measured_log::{Channel, Axis, Log};
    /// let header = measured_log::parse_header("header".as_ref(), r#"
    ///     version = 1
    ///     robot = "none"
    ///     period_secs = 0.01
    ///     gravity_mps2 = 9.81
    ///     table = { height_m = 0.0, friction = 0.4 }
    ///     object = { shape = "sphere", size_m = [0.03], mass_kg = 0.2, com_m = [0.0, 0.0, 0.0] }
    ///     split = { holdout_fraction = 0.5 }
    /// "#)?;
    /// let columns: [(&str, &[f64]); 5] = [
    ///     ("episode", &[0.0, 0.0, 1.0]),
    ///     ("time_secs", &[0.0, 0.01, 0.0]),
    ///     ("object_x_m", &[0.1, f64::NAN, 0.2]),
    ///     ("object_y_m", &[0.0, f64::NAN, 0.0]),
    ///     ("object_z_m", &[0.03, f64::NAN, 0.03]),
    /// ];
    /// let orientation: [(&str, &[f64]); 4] =
    ///     [("object_qx", &[0.0; 3]), ("object_qy", &[0.0; 3]), ("object_qz", &[0.0; 3]), ("object_qw", &[1.0; 3])];
    /// let log = Log::from_columns(header, &[&columns[..], &orientation[..]].concat(), "frame".as_ref())?;
    /// assert_eq!(log.episodes[0].get(Channel::ObjectPosition(Axis::X), 1), None);
    /// assert_eq!(log.columns()[2].1[2], 0.2);
    /// # Ok::<(), measured_log::Error>(())
    /// ```
    pub fn from_columns(header: Header, columns: &[(&str, &[f64])], name: &Path) -> Result<Self, Error> {
        let at = |problem: Problem| problem.at(name, name);
        let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
        let roles = Role::of(&names, header.robot).map_err(at)?;
        let rows = columns.first().map_or(0, |(_, cells)| cells.len());
        if rows > MAX_ROWS {
            return Err(at(Problem::Rows { found: rows }));
        }
        let mut made = Columns::new(&roles);
        for (role, (name, cells)) in roles.iter().zip(columns) {
            if cells.len() != rows {
                return Err(at(Problem::column(*name, format!("expected {rows} cells, found {}", cells.len()))));
            }
            for (row, value) in cells.iter().enumerate() {
                let cell = if value.is_nan() { Cell::Missing } else { Cell::Float(*value) };
                made.push(*role, row, cell).map_err(at)?;
            }
        }
        let log = Self { header, episodes: made.into_episodes() };
        log.checked(name, name)?;
        Ok(log)
    }

    /// Names and cells of its columns, in the order of the format: NaN where nothing was read. Numbers of episodes are exact up to 2⁵³.
    #[must_use]
    #[expect(clippy::cast_precision_loss, reason = "no log counts episodes beyond 2^53")]
    pub fn columns(&self) -> Vec<(String, Vec<f64>)> {
        let episodes = &self.episodes;
        let ids = episodes.iter().flat_map(|e| std::iter::repeat_n(e.id as f64, e.rows())).collect();
        let times = episodes.iter().flat_map(|e| e.time_secs.iter().copied()).collect();
        let mut columns = vec![(Role::Episode.name(), ids), (Role::Time.name(), times)];
        let Some(first) = episodes.first() else { return columns };
        if first.action.is_some() {
            let actions = episodes.iter().flat_map(|e| e.action.iter().flatten());
            columns.push((Role::Action.name(), actions.map(|action| action.map_or(f64::NAN, f64::from)).collect()));
        }
        for channel in first.channels.keys() {
            let readings = episodes.iter().filter_map(|e| e.channels.get(channel)).flat_map(Readings::iter);
            columns.push((channel.name(), readings.map(|reading| reading.unwrap_or(f64::NAN)).collect()));
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recorded() -> Log {
        let logs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/mujoco-logs/logs");
        crate::read(&logs.join("set-003")).unwrap()
    }

    fn slices(columns: &[(String, Vec<f64>)]) -> Vec<(&str, &[f64])> {
        columns.iter().map(|(name, cells)| (name.as_str(), cells.as_slice())).collect()
    }

    #[test]
    fn a_log_survives_the_way_through_columns() {
        let log = recorded();
        let columns = log.columns();
        let again = Log::from_columns(log.header.clone(), &slices(&columns), Path::new("frame")).unwrap();
        assert_eq!(again, log);
    }

    #[test]
    fn a_wrong_cell_is_named_by_row_and_column() {
        let log = recorded();
        let mut columns = log.columns();
        let place = columns.iter().position(|(name, _)| name == "object_x_m").unwrap();
        let read = |columns: &[(String, Vec<f64>)]| {
            Log::from_columns(log.header.clone(), &slices(columns), Path::new("frame")).unwrap_err().to_string()
        };
        columns[place].1[4] = f64::INFINITY;
        assert_eq!(read(&columns), "frame, row 5, column `object_x_m`: expected a finite number or nothing, found inf");
        columns[place].1.pop();
        assert!(read(&columns).contains("column `object_x_m`: expected"), "{}", read(&columns));
        columns[place].0 = "object_x_mm".into();
        assert!(read(&columns).contains("such as object_x_m"), "{}", read(&columns));
    }
}
