//! The rows of a shard as flat columns: checked and counted.

use crate::{Error, Row, Schema};

/// Columns of one shard; vector columns are row-major.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Columns {
    pub(crate) episode: Vec<u64>,
    pub(crate) step: Vec<u32>,
    pub(crate) action: Vec<i8>,
    pub(crate) reward: Vec<f32>,
    pub(crate) outcome: Vec<u8>,
    pub(crate) observation: Vec<f32>,
    pub(crate) state: Vec<f64>,
    pub(crate) theta: Vec<f64>,
    pub(crate) classes: Vec<u8>,
    pub(crate) events: Vec<u8>,
}

impl Columns {
    /// Columns of `rows`, which must fit the schema and form whole episodes.
    pub(crate) fn from_rows(schema: &Schema, rows: &[Row]) -> Result<Self, Error> {
        let mut columns = Self::default();
        for (i, row) in rows.iter().enumerate() {
            let found = [row.observation.len(), row.state.len(), row.theta.len(), row.classes.len(), row.events.len()];
            if let Some(((column, names), found)) =
                schema.lists().into_iter().zip(found).find(|((_, names), found)| names.len() != *found)
            {
                let (episode, step, column) = (row.episode, row.step, column.to_owned());
                let reason = format!("expected {} values, found {found}", names.len());
                return Err(Error::Row { row: i, episode, step, column, reason });
            }
            columns.episode.push(row.episode);
            columns.step.push(row.step);
            columns.action.push(row.action);
            columns.reward.push(row.reward);
            columns.outcome.push(row.outcome);
            columns.observation.extend(&row.observation);
            columns.state.extend(&row.state);
            columns.theta.extend(&row.theta);
            columns.classes.extend(&row.classes);
            columns.events.extend(&row.events);
        }
        columns.check(schema)?;
        Ok(columns)
    }

    /// Checks that the rows form whole episodes of values that the schema allows.
    pub(crate) fn check(&self, schema: &Schema) -> Result<(), Error> {
        for i in 0..self.rows() {
            let row = |i| RowRef::new(self, schema, i);
            let next = (i + 1 < self.rows()).then(|| row(i + 1));
            check(schema, &row(i), i.checked_sub(1).map(row).as_ref(), next.as_ref()).map_err(|(column, reason)| {
                Error::Row { row: i, episode: self.episode[i], step: self.step[i], column, reason }
            })?;
        }
        Ok(())
    }

    /// Number of rows.
    pub(crate) fn rows(&self) -> usize {
        self.episode.len()
    }

    /// Half-open ranges of rows, one an episode.
    pub(crate) fn episodes(&self) -> Vec<std::ops::Range<usize>> {
        let mut start = 0;
        self.episode
            .chunk_by(|a, b| a == b)
            .map(|run| {
                let range = start..start + run.len();
                start = range.end;
                range
            })
            .collect()
    }
}

/// A row of the columns.
struct RowRef<'a> {
    episode: u64,
    step: u32,
    action: i8,
    reward: f32,
    outcome: u8,
    observation: &'a [f32],
    state: &'a [f64],
    theta: &'a [f64],
    classes: &'a [u8],
    events: &'a [u8],
}

impl<'a> RowRef<'a> {
    fn new(columns: &'a Columns, schema: &Schema, i: usize) -> Self {
        fn at<'a, T>(values: &'a [T], names: &[String], i: usize) -> &'a [T] {
            &values[i * names.len()..(i + 1) * names.len()]
        }
        Self {
            episode: columns.episode[i],
            step: columns.step[i],
            action: columns.action[i],
            reward: columns.reward[i],
            outcome: columns.outcome[i],
            observation: at(&columns.observation, &schema.observation, i),
            state: at(&columns.state, &schema.state, i),
            theta: at(&columns.theta, &schema.theta, i),
            classes: at(&columns.classes, &schema.classes, i),
            events: at(&columns.events, &schema.events, i),
        }
    }
}

/// Column and reason if `row` does not fit the schema or its neighbours.
fn check(
    schema: &Schema,
    row: &RowRef<'_>,
    previous: Option<&RowRef<'_>>,
    next: Option<&RowRef<'_>>,
) -> Result<(), (String, String)> {
    let fail = |column: &str, reason: String| Err((column.to_owned(), reason));
    let values = (row.observation.iter().map(|v| f64::from(*v)).zip(&schema.observation))
        .chain(row.state.iter().copied().zip(&schema.state))
        .chain(row.theta.iter().copied().zip(&schema.theta));
    for (value, name) in values {
        if !value.is_finite() {
            return fail(name, format!("expected a finite value, found {value}"));
        }
    }
    for (event, name) in row.events.iter().zip(&schema.events) {
        if *event > u8::from(row.step > 0) {
            let expected = if row.step > 0 { "0 or 1" } else { "0 before any action" };
            return fail(name, format!("expected {expected}, found {event}"));
        }
    }
    if !row.reward.is_finite() {
        return fail("reward", format!("expected a finite value, found {}", row.reward));
    }

    let before = previous.filter(|p| p.episode == row.episode);
    if let Some(previous) = previous
        && row.episode < previous.episode
    {
        return fail("episode", format!("expected ascending episodes, found {} before", previous.episode));
    }
    let step = before.map_or(Some(0), |p| p.step.checked_add(1));
    if step != Some(row.step) {
        return fail("step", format!("expected consecutive steps from 0, found {}", row.step));
    }
    match (before, usize::try_from(row.action)) {
        (None, _) if row.action == -1 => {}
        (None, _) => {
            return fail("action", format!("expected -1 in the first row of an episode, found {}", row.action));
        }
        (Some(_), Ok(action)) if action < schema.action_count => {}
        (Some(_), _) => {
            return fail("action", format!("expected 0 to {}, found {}", schema.action_count - 1, row.action));
        }
    }
    if let Some(before) = before {
        // Bits, because a sign of zero also has to survive where an episode keeps one copy.
        if !before.theta.iter().map(|v| v.to_bits()).eq(row.theta.iter().map(|v| v.to_bits())) {
            return fail("theta", "expected the same values in the whole episode".into());
        }
        if before.classes != row.classes {
            return fail("classes", "expected the same values in the whole episode".into());
        }
    }
    let last = next.is_none_or(|n| n.episode != row.episode);
    if last != (row.outcome != 0) {
        return fail("outcome", format!("expected 0 but in the last row of an episode, found {}", row.outcome));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schema() -> Schema {
        Schema {
            robot: "arm".into(),
            observation: vec!["torque_nm".into()],
            action_count: 10,
            state: vec!["x_m".into()],
            theta: vec!["mass_kg".into()],
            classes: vec!["shape".into()],
            events: vec!["tool_touched".into()],
        }
    }

    fn episode() -> Vec<Row> {
        let row = |step, action, outcome| Row {
            episode: 7,
            step,
            action,
            reward: 0.0,
            outcome,
            observation: vec![1.0],
            state: vec![2.0],
            theta: vec![0.0],
            classes: vec![1],
            events: vec![u8::from(step == 2)],
        };
        vec![row(0, -1, 0), row(1, 9, 0), row(2, 0, 3)]
    }

    #[test]
    fn whole_episodes_pass_and_are_found_again() {
        let mut rows = episode();
        rows.extend(episode().into_iter().map(|r| Row { episode: 9, ..r }));
        let columns = Columns::from_rows(&schema(), &rows).unwrap();
        assert_eq!(columns.episodes(), [0..3, 3..6]);
    }

    #[test]
    fn a_row_that_breaks_a_rule_is_refused_by_its_column() {
        type Case = (&'static str, usize, fn(&mut Row));
        let broken: [Case; 15] = [
            ("observation", 0, |r| r.observation.push(0.0)),
            ("classes", 0, |r| r.classes.clear()),
            ("events", 1, |r| r.events.clear()),
            ("tool_touched", 0, |r| r.events[0] = 1),
            ("tool_touched", 1, |r| r.events[0] = 2),
            ("torque_nm", 1, |r| r.observation[0] = f32::NAN),
            ("x_m", 1, |r| r.state[0] = f64::INFINITY),
            ("reward", 1, |r| r.reward = f32::NAN),
            ("step", 1, |r| r.step = 2),
            ("action", 0, |r| r.action = 0),
            ("action", 1, |r| r.action = 10),
            ("action", 1, |r| r.action = -1),
            ("theta", 1, |r| r.theta[0] = -0.0),
            ("outcome", 1, |r| r.outcome = 1),
            ("outcome", 2, |r| r.outcome = 0),
        ];
        for (expected, at, change) in broken {
            let mut rows = episode();
            change(&mut rows[at]);
            match Columns::from_rows(&schema(), &rows) {
                Err(Error::Row { row, column, .. }) => assert_eq!((column.as_str(), row), (expected, at)),
                other => panic!("{expected}: {other:?}"),
            }
        }
        let mut rows = episode();
        rows.extend(episode().into_iter().map(|r| Row { episode: 6, ..r }));
        let error = Columns::from_rows(&schema(), &rows).unwrap_err().to_string();
        assert!(error.contains("`episode`"), "{error}");
    }
}
