//! From the rows of a table to readings.

use std::collections::BTreeMap;
use std::path::Path;

use crate::Error;
use crate::error::{excerpt, one_by_one};
use crate::mapping::{Mapping, Sampling};
use crate::plan::{Part, Pick, Plan, Quantity, Stamp};
use crate::store::{Moment, Store};
use crate::value::Value;

/// Names of the elements of columns that hold lists.
pub(crate) type ElementNames = BTreeMap<String, Vec<String>>;

/// Columns of a table, and what is known of the lists in them.
pub(crate) struct Columns<'a> {
    pub(crate) names: Vec<String>,
    pub(crate) elements: &'a ElementNames,
    /// Which columns may hold lists.
    pub(crate) lists: Vec<bool>,
}

impl Columns<'_> {
    /// Names of the elements of a column, where they are known.
    fn elements_of(&self, column: usize) -> Option<&Vec<String>> {
        self.elements.get(&self.names[column]).filter(|elements| !elements.is_empty())
    }

    /// Checks that the place of a vector of `count` numbers holds as many.
    fn check_vector(&self, place: Place, text: &str, count: usize) -> Result<(), String> {
        let found = if place.element.is_some() {
            "one element of it"
        } else if !self.lists[place.column] {
            "a column of single numbers"
        } else {
            return match self.elements_of(place.column).map(Vec::len) {
                Some(length) if length != count => {
                    Err(format!("expected a list of {count} in {}, found one of {length}", excerpt(text)))
                }
                _ => Ok(()),
            };
        };
        Err(format!("expected a list of {count} in {}, or a list of columns here, found {found}", excerpt(text)))
    }
}

/// A column, or an element of the lists in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub(crate) column: usize,
    pub(crate) element: Option<usize>,
}

#[derive(Clone, Copy)]
enum Source {
    Constant(f64),
    Cell(Place),
}

/// Takes from each row of a table what a plan asks for.
pub(crate) struct Extractor<'a> {
    plan: &'a Plan,
    path: &'a Path,
    names: Vec<String>,
    /// Of each track, its numbers and its stamp.
    tracks: Vec<(Vec<Source>, Place)>,
    /// What stands behind the end of each vector that is a list; its length.
    beyond: Vec<Place>,
    row: u64,
    picked: Vec<f64>,
}

impl<'a> Extractor<'a> {
    /// Looks up the columns of a plan among `names`.
    pub(crate) fn new(mapping: &Mapping, plan: &'a Plan, path: &'a Path, columns: Columns<'_>) -> Result<Self, Error> {
        let find = |key: &str, text: &str| {
            place(&columns, text).ok_or_else(|| {
                let some = columns.names.iter().map(|name| excerpt(name)).take(40).collect::<Vec<_>>().join(", ");
                let reason = format!("expected a column of {} ({some}), found {}", path.display(), excerpt(text));
                mapping.wrong(key, reason)
            })
        };
        let (mut tracks, mut beyond) = (Vec::new(), Vec::new());
        for track in &plan.tracks {
            let key = track.quantity.key();
            let mut sources = Vec::new();
            for pick in &track.picks {
                sources.push(match pick {
                    Pick::Constant(value) => Source::Constant(*value),
                    Pick::Value { path, part: Part::All } => Source::Cell(find(key, path)?),
                    Pick::Value { path, part: Part::Of(element, _) } => {
                        let place = find(key, path)?;
                        let count = track.elements_of(path);
                        // One number is a list of one.
                        if count > 1 {
                            let check = columns.check_vector(place, path, count);
                            check.map_err(|reason| mapping.wrong(key, reason))?;
                            let end = Place { element: Some(count), ..place };
                            if !beyond.contains(&end) {
                                beyond.push(end);
                            }
                        }
                        Source::Cell(Place { column: place.column, element: place.element.or(*element) })
                    }
                    Pick::Value { .. } => {
                        let reason = "expected a list of columns in a table, found names and order";
                        return Err(mapping.wrong(format!("{key}.names"), reason));
                    }
                });
            }
            let Stamp::Field(column) = &track.stamp else {
                return Err(mapping.wrong("clock.stamp", "expected the name of a column, found none"));
            };
            tracks.push((sources, find("clock.stamp", column)?));
        }
        Ok(Self { plan, path, names: columns.names, tracks, beyond, row: 0, picked: Vec::new() })
    }

    /// The columns that are asked for.
    pub(crate) fn columns(&self) -> Vec<usize> {
        let cells = self.tracks.iter().flat_map(|(sources, stamp)| {
            let cell = |source: &Source| if let Source::Cell(place) = source { Some(place.column) } else { None };
            sources.iter().filter_map(cell).chain([stamp.column])
        });
        let mut columns: Vec<usize> = cells.collect();
        columns.sort_unstable();
        columns.dedup();
        columns
    }

    /// Takes the readings of a row, whose cells `cell` gives.
    pub(crate) fn row(&mut self, store: &mut Store, cell: &dyn Fn(Place) -> Value) -> Result<(), Error> {
        self.row += 1;
        if let Some(place) = self.beyond.iter().find(|place| !matches!(cell(**place), Value::Missing)) {
            let (count, name) = (place.element.unwrap_or_default(), &self.names[place.column]);
            let where_ = format!("row {}, column {}", self.row, excerpt(name));
            let found = format!("a longer one {}", one_by_one(name));
            return Err(Error::source(self.path, where_, &format!("a list of {count}"), found));
        }
        let keep_rows = self.plan.sample == Sampling::Rows;
        let shift = if keep_rows { 0.0 } else { self.shift(store, cell) };
        for (index, (track, (sources, stamp))) in self.plan.tracks.iter().zip(&self.tracks).enumerate() {
            if track.fixed().is_some() {
                continue;
            }
            let time = match moment(&cell(*stamp), self.plan.clock_unit_secs) {
                Some(moment) => store.seconds(moment) + shift + track.offset_secs,
                None => return Err(self.wrong(*stamp, "a time as a number", &cell(*stamp))),
            };
            // An offset moves the first readings of an episode whose clock starts anew into no other one.
            if !keep_rows && time < store.restarted_secs() {
                continue;
            }
            self.picked.clear();
            for source in sources {
                let value = match source {
                    Source::Constant(value) => *value,
                    Source::Cell(place) => match cell(*place) {
                        Value::Missing => f64::NAN,
                        value if track.quantity == Quantity::Label => {
                            value.words().map_or(f64::NAN, |words| store.label(&words))
                        }
                        value => match value.number() {
                            Some(number) => number,
                            None => return Err(self.wrong(*place, "a finite number or nothing", &value)),
                        },
                    },
                };
                self.picked.push(value);
            }
            track.convert(&mut self.picked);
            if keep_rows || !self.picked.iter().all(|value| value.is_nan()) {
                store.push(index, time, &self.picked).map_err(|full| too_large(self.path, full.limit))?;
            }
        }
        Ok(())
    }

    /// Where episodes are named, what keeps them apart.
    fn shift(&self, store: &mut Store, cell: &dyn Fn(Place) -> Value) -> f64 {
        let Some(index) = self.plan.index(Quantity::Label) else { return 0.0 };
        let (sources, stamp) = &self.tracks[index];
        let Some(time) = moment(&cell(*stamp), self.plan.clock_unit_secs) else { return 0.0 };
        let [Source::Cell(place)] = sources[..] else { return 0.0 };
        let label = cell(place).words().map_or(f64::NAN, |words| store.label(&words));
        let time = store.seconds(time);
        store.shift(label, time)
    }

    fn wrong(&self, place: Place, expected: &str, found: &Value) -> Error {
        let words = match found {
            Value::Missing => "nothing".into(),
            Value::List(_) => "a list: name an element as in name[0]".into(),
            value => excerpt(&value.words().unwrap_or_default()),
        };
        let hint = if words.contains(',') { " (table.decimal = \",\" reads a decimal comma)" } else { "" };
        let name = &self.names[place.column];
        let element = place.element.map_or_else(String::new, |element| format!("[{element}]"));
        let where_ = format!("row {}, column {}{element}", self.row, excerpt(name));
        Error::source(self.path, where_, expected, format!("{words}{hint}"))
    }
}

/// More was asked for than is kept in memory.
pub(crate) fn too_large(path: &Path, limit: usize) -> Error {
    Error::TooLarge {
        path: path.to_owned(),
        what: "numbers that a mapping takes from a source",
        limit: limit as u64,
        found: limit as u64 + 1,
    }
}

/// The column that a text names: as it stands, or `name[2]`, or `name[element]`.
pub(crate) fn place(columns: &Columns<'_>, text: &str) -> Option<Place> {
    let column_of = |name: &str| columns.names.iter().position(|other| other == name);
    if let Some(column) = column_of(text) {
        return Some(Place { column, element: None });
    }
    let (name, element) = text.strip_suffix(']')?.split_once('[')?;
    let column = column_of(name)?;
    let elements = columns.elements_of(column);
    let named = || elements?.iter().position(|other| other == element);
    let element = element.parse().ok().or_else(named)?;
    // Some writers keep a list of one as a number.
    let there = if columns.lists[column] { elements.is_none_or(|all| element < all.len()) } else { element == 0 };
    there.then_some(Place { column, element: Some(element) })
}

/// A time of a clock whose unit is `unit_secs`. Whole numbers stay exact: nanoseconds since 1970 have more digits than a float.
#[expect(clippy::cast_possible_truncation, reason = "1, 1e3, 1e6 or 1e9")]
pub(crate) fn moment(value: &Value, unit_secs: f64) -> Option<Moment> {
    let whole = match value {
        Value::Whole(whole) => Some(*whole),
        Value::Text(text) => text.trim().parse().ok(),
        _ => None,
    };
    let unit_nanos = (unit_secs * 1e9).round() as i128;
    match whole.and_then(|whole| whole.checked_mul(unit_nanos)) {
        // Differences must not overflow.
        Some(nanos) if nanos.unsigned_abs() < 1 << 120 => Some(Moment::Nanos(nanos)),
        _ => value.number().map(|number| Moment::Secs(number * unit_secs)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_name_by_place_and_by_the_name_of_an_element() {
        let names = ["t", "observation.state", "a[0]"].map(String::from).to_vec();
        let elements = ElementNames::from([("observation.state".into(), vec!["x.pos".into(), "y.pos".into()])]);
        let columns = Columns { names, elements: &elements, lists: vec![false, true, false] };
        let find = |text| place(&columns, text).map(|place| (place.column, place.element));
        assert_eq!(find("t"), Some((0, None)));
        assert_eq!(find("a[0]"), Some((2, None)), "a name with brackets");
        assert_eq!(find("observation.state[1]"), Some((1, Some(1))));
        assert_eq!(find("observation.state[y.pos]"), Some((1, Some(1))));
        assert_eq!(find("observation.state[z.pos]"), None);
        assert_eq!(find("observation.stat"), None);
        assert_eq!((find("observation.state[2]"), find("t[1]")), (None, None), "there are two, and one");
        assert_eq!(find("t[0]"), Some((0, Some(0))));
    }

    #[test]
    fn a_vector_wants_a_list_of_its_length() {
        let elements = ElementNames::from([("pair".into(), vec!["x".into(), "y".into()])]);
        let names = ["t", "pair", "unnamed"].map(String::from).to_vec();
        let columns = Columns { names, elements: &elements, lists: vec![false, true, true] };
        let check = |text: &str, count| columns.check_vector(place(&columns, text).unwrap(), text, count);
        assert_eq!((check("pair", 2), check("unnamed", 3)), (Ok(()), Ok(())));
        assert_eq!(check("pair", 3).unwrap_err(), "expected a list of 3 in `pair`, found one of 2");
        for (text, found) in [("t", "a column of single numbers"), ("pair[0]", "one element of it")] {
            let message = check(text, 2).unwrap_err();
            assert!(message.ends_with(&format!("or a list of columns here, found {found}")), "{message}");
        }
    }

    #[test]
    fn a_list_that_is_longer_than_its_vector_is_refused() {
        let header = "robot = \"none\"\nperiod_secs = 0.1\ngravity_mps2 = 9.81\ntable = { height_m = 0.0, friction = 0.4 }\n\
                      object = { shape = \"sphere\", size_m = [0.03], mass_kg = 0.2, com_m = [0.0, 0.0, 0.0] }\n\
                      split = { holdout_fraction = 0.5 }";
        let text = format!(
            "version = 1\nclock = {{ stamp = \"t\" }}\nepisodes = \"source\"\n[log]\n{header}\n[object]\nposition = \"xyz\"\n"
        );
        let mapping = Mapping::parse(Path::new("map.toml"), &text).unwrap();
        let plan = crate::plan::resolve(&mapping, crate::plan::Kind::Table, None).unwrap();
        let elements = ElementNames::new();
        for (length, expected) in
            [(3, None), (4, Some("rig.parquet, row 1, column `xyz`: expected a list of 3, found a longer one"))]
        {
            let names = ["t", "xyz"].map(String::from).to_vec();
            let columns = Columns { names, elements: &elements, lists: vec![false, true] };
            let mut extractor = Extractor::new(&mapping, &plan, Path::new("rig.parquet"), columns).unwrap();
            let cell = |place: Place| match place.element {
                Some(element) if element >= length => Value::Missing,
                _ => Value::Number(0.5),
            };
            let result = extractor.row(&mut Store::new(&plan, 0.1), &cell).map_err(|error| error.to_string());
            let message = result.err();
            assert_eq!(message.is_some(), expected.is_some(), "{message:?}");
            assert!(message.unwrap_or_default().starts_with(expected.unwrap_or_default()));
        }
    }

    #[test]
    fn nanoseconds_since_1970_stay_exact() {
        let text = Value::Text("1700000000123456789".into());
        assert_eq!(moment(&text, 1e-9), Some(Moment::Nanos(1_700_000_000_123_456_789)));
        assert_eq!(moment(&Value::Text("12.5".into()), 0.001), Some(Moment::Secs(0.0125)));
        assert_eq!(moment(&Value::Text("yesterday".into()), 1.0), None);
    }
}
