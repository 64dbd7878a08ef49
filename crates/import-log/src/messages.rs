//! From messages to readings.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path as FilePath;

use crate::Error;
use crate::error::{excerpt, one_by_one};
use crate::mapping::Mapping;
use crate::plan::{Part, Pick, Plan, Quantity, Stamp, Track};
use crate::rows::{moment, too_large};
use crate::store::{Moment, Store};
use crate::value::{Path, Value, join};

/// Topics that a message of this program lists.
const LISTED: usize = 40;
/// Names that it lists of those that were not asked for.
const NAMES: usize = 12;

/// A message on its way from a file.
pub(crate) struct Message<'a> {
    pub(crate) path: &'a FilePath,
    pub(crate) topic: &'a str,
    pub(crate) log_nanos: i128,
    pub(crate) publish_nanos: i128,
    pub(crate) value: Value,
}

/// What takes messages: an import, or a look at what a source holds.
pub(crate) trait Sink {
    /// A topic with the type of its messages, and why they cannot be decoded if they cannot.
    fn channel(&mut self, path: &FilePath, topic: &str, kind: &str, problem: Option<&str>) -> Result<(), Error>;

    /// Whether messages of a topic are decoded.
    fn wants(&self, topic: &str) -> bool;

    fn message(&mut self, message: &Message<'_>) -> Result<(), Error>;
}

enum Source {
    Constant(f64),
    /// With how many numbers come from the same place.
    Value(Path, Part, usize),
}

struct Compiled {
    at: Path,
    sources: Vec<Source>,
    names: Option<Path>,
    stamp: Option<Path>,
    messages: u64,
    /// Which of its numbers were ever there.
    found: Vec<bool>,
    /// What the first message holds that lacks some.
    fields: Vec<String>,
    /// Names of elements and of joints where the one that is asked for was not among them.
    others: BTreeSet<String>,
    zero_stamps: u64,
}

impl Compiled {
    /// Keeps what a message holds that lacks something.
    fn look(&mut self, message: &Value) {
        if self.fields.is_empty() {
            self.fields = message.fields();
        }
    }

    /// Keeps what stands where `path`, or a name, was looked for.
    fn look_for(&mut self, others: impl IntoIterator<Item = String>) {
        for other in others {
            if self.others.len() < NAMES {
                self.others.insert(excerpt(&other));
            }
        }
    }
}

/// Takes from each message what a plan asks for.
pub(crate) struct Extractor<'a> {
    mapping: &'a Mapping,
    plan: &'a Plan,
    pub(crate) store: &'a mut Store,
    tracks: Vec<Compiled>,
    by_topic: BTreeMap<&'a str, Vec<usize>>,
    seen: BTreeSet<String>,
}

impl<'a> Extractor<'a> {
    pub(crate) fn new(mapping: &'a Mapping, plan: &'a Plan, store: &'a mut Store) -> Result<Self, Error> {
        let mut tracks = Vec::new();
        let mut by_topic: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for (index, track) in plan.tracks.iter().enumerate() {
            let key = track.quantity.key();
            let path = |key: String, text: &str| Path::parse(text).map_err(|reason| mapping.wrong(key, reason));
            let source = |pick: &Pick| {
                Ok(match pick {
                    Pick::Constant(value) => Source::Constant(*value),
                    Pick::Value { path: text, part } => {
                        let count = track.elements_of(text);
                        Source::Value(path(key.to_string(), text)?, part.clone(), count)
                    }
                })
            };
            let stamp = match &track.stamp {
                Stamp::Header => Some(Path::parse("header.stamp").unwrap_or_default()),
                Stamp::Field(text) => Some(path(format!("{key}.stamp"), text)?),
                Stamp::Log | Stamp::Publish => None,
            };
            tracks.push(Compiled {
                at: path(format!("{key}.at"), &track.at)?,
                sources: track.picks.iter().map(source).collect::<Result<_, Error>>()?,
                names: track.names.as_ref().map(|names| path(format!("{key}.names"), names)).transpose()?,
                stamp,
                messages: 0,
                found: vec![false; track.picks.len()],
                fields: Vec::new(),
                others: BTreeSet::new(),
                zero_stamps: 0,
            });
            if let Some(topic) = &track.topic {
                by_topic.entry(topic).or_default().push(index);
            }
        }
        Ok(Self { mapping, plan, store, tracks, by_topic, seen: BTreeSet::new() })
    }

    /// Refuses topics that were not there, and paths that led nowhere.
    pub(crate) fn finish(self, source: &FilePath) -> Result<(), Error> {
        for (track, compiled) in self.plan.tracks.iter().zip(&self.tracks) {
            let Some(topic) = &track.topic else { continue };
            if compiled.messages == 0 {
                let some = self.seen.iter().take(LISTED).map(|topic| excerpt(topic)).collect::<Vec<_>>().join(", ");
                let reason = format!(
                    "expected a topic with messages in {} (it has {some}), found {}",
                    source.display(),
                    excerpt(topic)
                );
                return Err(self.mapping.wrong(track.topic_key(), reason));
            }
            if compiled.found.contains(&false) {
                return Err(self.mapping.wrong(track.quantity.key(), not_there(track, compiled)));
            }
        }
        Ok(())
    }

    fn take(&mut self, index: usize, message: &Message<'_>) -> Result<(), Error> {
        let track = &self.plan.tracks[index];
        let compiled = &mut self.tracks[index];
        compiled.messages += 1;
        let Some(value) = compiled.at.follow(&message.value) else {
            compiled.look(&message.value);
            compiled.look_for(compiled.at.others(&message.value));
            return Ok(());
        };
        let mut others = Vec::new();
        let mut picked = Vec::with_capacity(track.width());
        for source in &compiled.sources {
            picked.push(match source {
                Source::Constant(value) => *value,
                Source::Value(path, part, count) => {
                    let at = path.follow(value);
                    if let (Part::Of(..), Some(Value::List(list))) = (part, at)
                        && list.len() > *count
                    {
                        let reason = longer(&track.picks[picked.len()], *count, list.len());
                        return Err(self.mapping.wrong(track.quantity.key(), reason));
                    }
                    let found = match part {
                        Part::All => at,
                        Part::Of(place, name) => at.and_then(|at| at.part(place.unwrap_or(usize::MAX), name)),
                        Part::Named(name) => {
                            let names = compiled.names.as_ref().and_then(|names| names.follow(value));
                            let place = names.and_then(|names| position(names, name));
                            if let (None, Some(Value::List(names))) = (place, names) {
                                others.extend(names.iter().filter_map(Value::words));
                            }
                            at.zip(place).and_then(|(at, place)| at.part(place, ""))
                        }
                    };
                    if at.is_none() {
                        others.extend(path.others(value));
                    }
                    if track.quantity == Quantity::Label {
                        found.and_then(Value::words).map_or(f64::NAN, |words| self.store.label(&words))
                    } else {
                        found.and_then(Value::number).unwrap_or(f64::NAN)
                    }
                }
            });
        }
        if picked.iter().any(|value| value.is_nan()) {
            compiled.look(&message.value);
            compiled.look_for(others);
        }
        if picked.iter().all(|value| value.is_nan()) {
            return Ok(());
        }
        let moment = match (&compiled.stamp, &track.stamp) {
            (None, Stamp::Publish) => Moment::Nanos(message.publish_nanos),
            (None, _) => Moment::Nanos(message.log_nanos),
            (Some(path), _) => stamp(path.follow(value).or_else(|| path.follow(&message.value)), self.plan)
                .ok_or_else(|| unstamped(message, track, "none"))?,
        };
        if compiled.stamp.is_some() && matches!(moment, Moment::Nanos(0)) {
            compiled.zero_stamps += 1;
            if compiled.zero_stamps > 1 {
                return Err(unstamped(message, track, "0 again"));
            }
        }
        for (found, value) in compiled.found.iter_mut().zip(&picked) {
            *found |= !value.is_nan();
        }
        let time = self.store.seconds(moment) + track.offset_secs;
        track.convert(&mut picked);
        self.store.push(index, time, &picked).map_err(|full| too_large(message.path, full.limit))
    }
}

impl Sink for Extractor<'_> {
    fn channel(&mut self, path: &FilePath, topic: &str, kind: &str, problem: Option<&str>) -> Result<(), Error> {
        if self.seen.len() < 10_000 {
            self.seen.insert(topic.to_string());
        }
        match problem {
            Some(reason) if self.wants(topic) => {
                Err(Error::broken(path, "messages", &format!("topic {}, {}: {reason}", excerpt(topic), excerpt(kind))))
            }
            _ => Ok(()),
        }
    }

    fn wants(&self, topic: &str) -> bool {
        self.by_topic.contains_key(topic)
    }

    fn message(&mut self, message: &Message<'_>) -> Result<(), Error> {
        let indices = self.by_topic.get(message.topic).cloned().unwrap_or_default();
        indices.into_iter().try_for_each(|index| self.take(index, message))
    }
}

/// What a track never found: its paths, beside those that there are.
fn not_there(track: &Track, compiled: &Compiled) -> String {
    let missing = track.picks.iter().zip(&compiled.found).filter(|(_, found)| !**found);
    let some = compiled.found.contains(&true);
    let (mut paths, mut unordered) = (Vec::new(), false);
    for (pick, _) in missing {
        let Pick::Value { path, part } = pick else { continue };
        unordered |= some && matches!(part, Part::Of(None, _));
        let path = match part {
            Part::Named(name) => format!("{path} of {name}"),
            Part::All | Part::Of(..) => path.clone(),
        };
        let path = excerpt(&if track.at.is_empty() { path } else { join(&track.at, &path) });
        if !paths.contains(&path) {
            paths.push(path);
        }
    }
    let fields: Vec<String> = compiled.fields.iter().map(|field| excerpt(field)).collect();
    let others: Vec<&str> = compiled.others.iter().map(String::as_str).collect();
    let hint = match (unordered, others.as_slice()) {
        (true, _) => " (a quaternion that is a list needs its order)".into(),
        (false, []) => String::new(),
        (false, others) => format!(" (by name there are {})", others.join(", ")),
    };
    format!(
        "expected readings at {} in messages of {}, which hold {}, found {} messages without some{hint}",
        paths.join(" and "),
        excerpt(track.topic.as_deref().unwrap_or_default()),
        if fields.is_empty() { "others".into() } else { fields.join(", ") },
        compiled.messages,
    )
}

/// Of a list some numbers would be taken and others left, by their order alone.
fn longer(pick: &Pick, count: usize, found: usize) -> String {
    let path = if let Pick::Value { path, .. } = pick { path.as_str() } else { "" };
    format!("expected a list of {count} at {}, found one of {found} {}", excerpt(path), one_by_one(path))
}

fn unstamped(message: &Message<'_>, track: &Track, found: &str) -> Error {
    let path = match &track.stamp {
        Stamp::Field(path) => path.as_str(),
        _ => "header.stamp",
    };
    let fields: Vec<String> = message.value.fields().iter().map(|field| excerpt(field)).collect();
    let expected = format!(
        "a time at {path}, or another clock for {}.stamp, such as log (a message holds {})",
        track.quantity.key(),
        fields.join(", ")
    );
    Error::source(message.path, format!("topic {}", excerpt(message.topic)), &expected, found)
}

/// The place of a name in a list of texts.
fn position(names: &Value, name: &str) -> Option<usize> {
    let Value::List(names) = names else { return None };
    names.iter().position(|other| matches!(other, Value::Text(text) if text == name))
}

/// A stamp: seconds and nanoseconds, as ROS, JSON and Protobuf name them, or a number in the unit of the clock.
fn stamp(value: Option<&Value>, plan: &Plan) -> Option<Moment> {
    let value = value?;
    let part = |names: [&str; 4]| {
        names.into_iter().find_map(|name| match value.part(usize::MAX, name)? {
            Value::Whole(whole) => Some(*whole),
            Value::Text(text) => text.parse().ok(),
            _ => None,
        })
    };
    let Value::Struct(_) = value else { return moment(value, plan.clock_unit_secs) };
    let secs = part(["sec", "secs", "seconds", "s"])?;
    let nanos = part(["nanosec", "nsec", "nsecs", "nanos"])?;
    // Differences must not overflow.
    (secs.unsigned_abs() < 1 << 64 && nanos.unsigned_abs() < 1 << 64)
        .then(|| Moment::Nanos(secs * 1_000_000_000 + nanos))
}
