//! Messages of ROS: CDR as DDS writes it, and the plain layout of ROS 1.
//!
//! CDR: OMG, *DDS Interoperability Wire Protocol* 2.5, chapter 10 (the two bytes that say how it is written), and *DDS-XTypes* 1.3, chapter 7.4
//! (alignment). Values lie at multiples of their size, counted from the end of the four bytes at the front; XCDR2 aligns to four at most.

use std::rc::Rc;

use crate::schema::{Count, Field, Kind, Schema};
use crate::value::{LONGEST_LIST, MOST_VALUES, Value};

/// Messages within messages at most.
const DEEPEST: usize = 32;

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    big_endian: bool,
    /// Largest alignment; 1 is none.
    align: usize,
    /// Texts end in a zero, which counts.
    zero_ended: bool,
    /// A message without fields takes a byte.
    filled: bool,
    values: usize,
}

/// Decodes a message in CDR.
pub(crate) fn decode(schema: &Schema, bytes: &[u8]) -> Result<Value, String> {
    let Some((head, body)) = bytes.split_at_checked(4) else {
        return Err(format!("expected 4 bytes at the front, found {}", bytes.len()));
    };
    let (big_endian, align) = match [head[0], head[1]] {
        [0, 0] => (true, 8),
        [0, 1] => (false, 8),
        [0, 6] => (true, 4),
        [0, 7] => (false, 4),
        [a, b] => return Err(format!("expected plain CDR (0, 1, 6 or 7), found representation {a:#04x} {b:#04x}")),
    };
    let mut reader = Reader { bytes: body, at: 0, big_endian, align, zero_ended: true, filled: true, values: 0 };
    reader.message(schema, 0, 0)
}

/// Decodes a message of ROS 1.
pub(crate) fn decode_ros1(schema: &Schema, bytes: &[u8]) -> Result<Value, String> {
    let mut reader = Reader { bytes, at: 0, big_endian: false, align: 1, zero_ended: false, filled: false, values: 0 };
    reader.message(schema, 0, 0)
}

impl<'a> Reader<'a> {
    fn take(&mut self, count: usize) -> Result<&'a [u8], String> {
        let left = &self.bytes[self.at.min(self.bytes.len())..];
        let taken = left.get(..count).ok_or_else(|| format!("expected {count} more bytes, found {}", left.len()))?;
        self.at += count;
        Ok(taken)
    }

    fn aligned(&mut self, size: usize) -> Result<&'a [u8], String> {
        self.at = self.at.next_multiple_of(size.min(self.align));
        self.take(size)
    }

    /// An unsigned number of 1, 2, 4 or 8 bytes.
    fn unsigned(&mut self, size: usize) -> Result<u64, String> {
        let bytes = self.aligned(size)?;
        let add = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        Ok(if self.big_endian { bytes.iter().fold(0, add) } else { bytes.iter().rev().fold(0, add) })
    }

    /// How many elements follow; each takes a byte at least.
    fn length(&mut self) -> Result<usize, String> {
        let length = usize::try_from(self.unsigned(4)?).unwrap_or(usize::MAX);
        let left = self.bytes.len().saturating_sub(self.at);
        if length > left { Err(format!("expected at most {left} elements, found {length}")) } else { Ok(length) }
    }

    fn count(&mut self) -> Result<(), String> {
        self.values += 1;
        if self.values > MOST_VALUES {
            return Err(format!("expected at most {MOST_VALUES} values, found more"));
        }
        Ok(())
    }

    fn message(&mut self, schema: &Schema, index: usize, depth: usize) -> Result<Value, String> {
        if depth > DEEPEST {
            return Err(format!("expected at most {DEEPEST} messages within each other, found more"));
        }
        let fields = &schema.types[index];
        if fields.is_empty() && self.filled {
            self.take(1)?;
        }
        let mut values = Vec::with_capacity(fields.len());
        for field in fields {
            let value = self.field(schema, field, depth).map_err(|reason| named(&field.name, reason))?;
            values.push((field.name.clone(), value));
        }
        self.count()?;
        Ok(Value::Struct(values))
    }

    fn field(&mut self, schema: &Schema, field: &Field, depth: usize) -> Result<Value, String> {
        let count = match field.count {
            Count::One => return self.one(schema, &field.kind, depth),
            Count::Fixed(count) => count,
            Count::Any => self.length()?,
        };
        let plain = match field.kind {
            Kind::Bool => Some(1),
            Kind::Unsigned(size) | Kind::Signed(size) | Kind::Float(size) => Some(usize::from(size)),
            _ => None,
        };
        if let Some(size) = plain
            && count > LONGEST_LIST
        {
            self.at = self.at.next_multiple_of(size.min(self.align));
            self.take(count.checked_mul(size).ok_or_else(|| format!("expected fewer than {count} elements"))?)?;
            return Ok(Value::Missing);
        }
        // Not reserved: the count is the writer's word.
        let mut list = Vec::new();
        for _ in 0..count {
            list.push(self.one(schema, &field.kind, depth)?);
        }
        Ok(Value::List(list))
    }

    fn one(&mut self, schema: &Schema, kind: &Kind, depth: usize) -> Result<Value, String> {
        self.count()?;
        Ok(match kind {
            Kind::Bool => Value::Whole(i128::from(self.unsigned(1)? != 0)),
            Kind::Unsigned(size) => Value::Whole(i128::from(self.unsigned(usize::from(*size))?)),
            Kind::Signed(size) => Value::Whole(i128::from(self.signed(usize::from(*size))?)),
            Kind::Float(4) => number(f64::from(f32::from_bits(self.unsigned(4)? as u32))),
            Kind::Float(_) => number(f64::from_bits(self.unsigned(8)?)),
            Kind::Text => self.text()?,
            Kind::WideText => {
                let length = self.length()?;
                self.take(length.saturating_mul(2))?;
                Value::Missing
            }
            Kind::Time => self.time(false)?,
            Kind::Duration => self.time(true)?,
            Kind::Message(index) => self.message(schema, *index, depth + 1)?,
        })
    }

    fn signed(&mut self, size: usize) -> Result<i64, String> {
        let spare = 64 - 8 * size as u32;
        Ok((self.unsigned(size)? << spare).cast_signed() >> spare)
    }

    fn text(&mut self) -> Result<Value, String> {
        let length = self.length()?;
        let mut bytes = self.take(length)?;
        if self.zero_ended {
            bytes = bytes.strip_suffix(b"\0").unwrap_or(bytes);
        }
        Ok(Value::Text(String::from_utf8_lossy(bytes).into_owned()))
    }

    fn time(&mut self, signed: bool) -> Result<Value, String> {
        let mut read = || if signed { self.signed(4).map(i128::from) } else { self.unsigned(4).map(i128::from) };
        let (secs, nanos) = (read()?, read()?);
        let name = |name: &str| -> Rc<str> { name.into() };
        Ok(Value::Struct(vec![(name("sec"), Value::Whole(secs)), (name("nanosec"), Value::Whole(nanos))]))
    }
}

fn number(value: f64) -> Value {
    if value.is_finite() { Value::Number(value) } else { Value::Missing }
}

/// The reason with the name of the field in front, of bounded length.
fn named(field: &str, reason: String) -> String {
    if reason.len() > 200 { reason } else { format!("{field}: {reason}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::value::Path;

    const TEXT: &str = "\
string name
int16 small
float64 large
Inner[] list
uint8 last
===============
MSG: a/Inner
bool flag
float32[2] pair
";

    /// `name = "ab"`, `small = -2`, `large = 1.5`, two elements, `last = 7`.
    fn bytes(big_endian: bool) -> Vec<u8> {
        let order = |bytes: &[u8]| -> Vec<u8> {
            if big_endian { bytes.iter().rev().copied().collect() } else { bytes.to_vec() }
        };
        let mut bytes = vec![0, u8::from(!big_endian), 0, 0];
        let mut put = |align: usize, part: Vec<u8>| {
            while (bytes.len() - 4) % align != 0 {
                bytes.push(0xee);
            }
            bytes.extend(part);
        };
        put(4, order(&3_u32.to_le_bytes()));
        put(1, b"ab\0".to_vec());
        put(2, order(&(-2_i16).to_le_bytes()));
        put(8, order(&1.5_f64.to_le_bytes()));
        put(4, order(&2_u32.to_le_bytes()));
        for flag in [1, 0] {
            put(1, vec![flag]);
            put(4, order(&0.25_f32.to_le_bytes()));
            put(4, order(&(-8_f32).to_le_bytes()));
        }
        put(1, vec![7]);
        bytes
    }

    #[test]
    fn both_byte_orders_with_alignment_give_the_same_message() {
        let schema = Schema::parse("a/Outer", TEXT).unwrap();
        let little = decode(&schema, &bytes(false)).unwrap();
        assert_eq!(decode(&schema, &bytes(true)).unwrap(), little);
        let at = |path: &str| Path::parse(path).unwrap().follow(&little).cloned();
        assert_eq!(at("name"), Some(Value::Text("ab".into())));
        assert_eq!(at("small"), Some(Value::Whole(-2)));
        assert_eq!(at("large"), Some(Value::Number(1.5)));
        assert_eq!(at("list[1].pair[1]"), Some(Value::Number(-8.0)));
        assert_eq!(at("list[flag=1].pair[0]"), Some(Value::Number(0.25)));
        assert_eq!(at("last"), Some(Value::Whole(7)));
    }

    #[test]
    fn every_cut_is_an_error_that_names_the_field() {
        let schema = Schema::parse("a/Outer", TEXT).unwrap();
        let whole = bytes(false);
        for length in 0..whole.len() {
            let reason = decode(&schema, &whole[..length]).unwrap_err();
            assert!(reason.contains("expected"), "{reason}");
        }
        assert!(decode(&schema, &whole[..12]).unwrap_err().starts_with("small: expected 2 more bytes"));
    }

    #[test]
    fn lengths_that_lie_and_types_that_hold_themselves_end() {
        let schema = Schema::parse("a/Outer", TEXT).unwrap();
        let mut lying = bytes(false);
        lying[4..8].fill(0xff);
        assert!(decode(&schema, &lying).unwrap_err().contains("found 4294967295"));
        let own = Schema::parse("a/Own", "Own own").unwrap();
        assert!(decode(&own, &bytes(false)).unwrap_err().contains("within each other"));
        let huge = Schema::parse("a/Huge", "Empty[4000000000] a\n========\nMSG: a/Empty\n").unwrap();
        assert!(decode_ros1(&huge, &[]).unwrap_err().contains("at most 200000 values"));
    }

    #[test]
    fn ros_1_has_no_alignment_and_no_zero() {
        let schema = Schema::parse("a/One", "uint8 a\nstring b\ntime c\nfloat64 d").unwrap();
        let mut bytes = vec![9, 2, 0, 0, 0];
        bytes.extend(b"hi");
        bytes.extend(5_u32.to_le_bytes());
        bytes.extend(6_u32.to_le_bytes());
        bytes.extend(2.5_f64.to_le_bytes());
        let value = decode_ros1(&schema, &bytes).unwrap();
        let at = |path: &str| Path::parse(path).unwrap().follow(&value).cloned();
        assert_eq!(at("b"), Some(Value::Text("hi".into())));
        assert_eq!(at("c.nanosec"), Some(Value::Whole(6)));
        assert_eq!(at("d"), Some(Value::Number(2.5)));
    }
}
