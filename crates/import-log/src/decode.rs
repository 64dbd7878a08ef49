//! Messages by the definition that stands in their file.

use std::fmt;

use prost_reflect::{DescriptorPool, DynamicMessage, MessageDescriptor, ReflectMessage as _};
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};

use crate::cdr;
use crate::error::excerpt;
use crate::schema::Schema;
use crate::value::{MOST_VALUES, Value};

/// Bytes of a message at most; those in JSON grow most.
const LARGEST: usize = 32 << 20;
const LARGEST_JSON: usize = 4 << 20;

/// How the messages of a topic are written.
#[derive(Clone, Debug)]
pub(crate) enum Decoder {
    Cdr(Schema),
    Ros1(Schema),
    Json,
    Protobuf(MessageDescriptor),
}

impl Decoder {
    /// The decoder for an encoding of messages and a definition of the type `name`; names as in the registry of MCAP.
    pub(crate) fn new(
        encoding: &str,
        name: &str,
        definition_encoding: &str,
        definition: &[u8],
    ) -> Result<Self, String> {
        let text = || std::str::from_utf8(definition).map_err(|_| "expected a definition in UTF-8".to_string());
        match (encoding, definition_encoding) {
            ("cdr", "ros2msg") => Ok(Self::Cdr(Schema::parse(name, text()?)?)),
            ("ros1", "ros1msg") => Ok(Self::Ros1(Schema::parse(name, text()?)?)),
            ("json", _) => Ok(Self::Json),
            ("protobuf", "protobuf") => {
                let attempt = || DescriptorPool::decode(definition);
                let pool = whole_file::caught(attempt).ok_or("the descriptors contradict each other")?;
                let pool = pool.map_err(|e| whole_file::one_line(&e.to_string(), 200))?;
                let message = pool.get_message_by_name(name);
                message.map(Self::Protobuf).ok_or_else(|| format!("expected a descriptor of {}", excerpt(name)))
            }
            ("cdr", other) => Err(format!("expected definitions as ros2msg beside CDR, found {}", excerpt(other))),
            (other, _) => Err(format!("expected messages as cdr, ros1, json or protobuf, found {}", excerpt(other))),
        }
    }

    pub(crate) fn decode(&self, bytes: &[u8]) -> Result<Value, String> {
        let largest = if matches!(self, Self::Json) { LARGEST_JSON } else { LARGEST };
        if bytes.len() > largest {
            return Err(format!("expected at most {largest} bytes, found {}", bytes.len()));
        }
        match self {
            Self::Cdr(schema) => cdr::decode(schema, bytes),
            Self::Ros1(schema) => cdr::decode_ros1(schema, bytes),
            Self::Json => serde_json::from_slice(bytes).map_err(|e| whole_file::plain(&e.to_string())),
            Self::Protobuf(kind) => {
                let message = DynamicMessage::decode(kind.clone(), bytes).map_err(|e| e.to_string())?;
                protobuf(&message, &mut 0)
            }
        }
    }
}

fn protobuf(message: &DynamicMessage, values: &mut usize) -> Result<Value, String> {
    let mut fields = Vec::new();
    for field in message.descriptor().fields() {
        // A number that is 0 is not written; a message that is not there is none.
        let absent = field.kind().as_message().is_some() && !message.has_field(&field);
        let value = if absent { Value::Missing } else { protobuf_value(&message.get_field(&field), values)? };
        fields.push((field.name().into(), value));
    }
    Ok(Value::Struct(fields))
}

fn protobuf_value(value: &prost_reflect::Value, values: &mut usize) -> Result<Value, String> {
    *values += 1;
    if *values > MOST_VALUES {
        return Err(format!("expected at most {MOST_VALUES} values, found more"));
    }
    Ok(match value {
        prost_reflect::Value::Bool(value) => Value::Whole(i128::from(*value)),
        prost_reflect::Value::I32(value) | prost_reflect::Value::EnumNumber(value) => Value::Whole(i128::from(*value)),
        prost_reflect::Value::I64(value) => Value::Whole(i128::from(*value)),
        prost_reflect::Value::U32(value) => Value::Whole(i128::from(*value)),
        prost_reflect::Value::U64(value) => Value::Whole(i128::from(*value)),
        prost_reflect::Value::F32(value) => Value::Number(f64::from(*value)),
        prost_reflect::Value::F64(value) => Value::Number(*value),
        prost_reflect::Value::String(text) => Value::Text(text.clone()),
        prost_reflect::Value::Message(message) => protobuf(message, values)?,
        prost_reflect::Value::List(list) => {
            Value::List(list.iter().map(|one| protobuf_value(one, values)).collect::<Result<_, _>>()?)
        }
        prost_reflect::Value::Bytes(_) | prost_reflect::Value::Map(_) => Value::Missing,
    })
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Json)
    }
}

struct Json;

impl<'de> Visitor<'de> for Json {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Whole(i128::from(value)))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(Value::Whole(i128::from(value)))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(Value::Whole(i128::from(value)))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Value::Number(value))
    }

    fn visit_str<E>(self, text: &str) -> Result<Value, E> {
        Ok(Value::Text(text.into()))
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Missing)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element()? {
            values.push(value);
        }
        Ok(Value::List(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut fields = Vec::new();
        while let Some((name, value)) = map.next_entry::<String, Value>()? {
            fields.push((name.into(), value));
        }
        Ok(Value::Struct(fields))
    }
}
