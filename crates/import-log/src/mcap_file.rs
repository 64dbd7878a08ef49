//! MCAP files, record by record.

use std::collections::BTreeMap;
use std::io::{self, BufReader, Read};
use std::panic::AssertUnwindSafe;
use std::path::Path;

use mcap::McapError;
use mcap::records::{ChunkHeader, Record, SchemaHeader, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use crate::Error;
use crate::decode::Decoder;
use crate::error::{excerpt, open};
use crate::messages::{Message, Sink};

/// Bytes of a record at most: a picture of 4 K without compression has 25 MiB.
const LARGEST_RECORD: usize = 64 << 20;
/// Of what zstd looks back at: 64 MiB.
const LARGEST_WINDOW_LOG: u32 = 26;
/// Bytes that are read at once.
const READ_BYTES: usize = 256 << 10;
/// Records that are read. Of others a damaged count would have the crate take gigabytes.
const READ: [u8; 4] = [op::SCHEMA, op::CHANNEL, op::MESSAGE, op::CHUNK];
/// Channels and bytes of definitions at most.
const MOST_CHANNELS: usize = 10_000;
const MOST_DEFINITIONS: usize = 64 << 20;

struct Channel {
    topic: String,
    decoder: Result<Decoder, String>,
}

struct Definition {
    name: String,
    encoding: String,
    data: Vec<u8>,
}

struct File<'a, S> {
    path: &'a Path,
    sink: &'a mut S,
    definitions: BTreeMap<u16, Definition>,
    definition_bytes: usize,
    channels: BTreeMap<u16, Channel>,
}

/// Gives the messages of a file to `sink`, in the order in which they stand there.
pub(crate) fn read<S: Sink>(path: &Path, sink: &mut S) -> Result<(), Error> {
    // A decoder of others, given files of others.
    let attempt = AssertUnwindSafe(|| read_trusting(path, sink));
    whole_file::caught(attempt).unwrap_or_else(|| Err(broken(path, &"a record contradicts its length")))
}

fn broken(path: &Path, reason: &dyn std::fmt::Display) -> Error {
    Error::broken(path, "MCAP", reason)
}

fn mcap_error(path: &Path, error: &McapError) -> Error {
    match error {
        McapError::UnexpectedEof | McapError::UnexpectedEoc => {
            broken(path, &"it ends in the middle; what was recorded is often saved by `mcap recover`")
        }
        other => broken(path, other),
    }
}

fn read_trusting<S: Sink>(path: &Path, sink: &mut S) -> Result<(), Error> {
    let mut bytes = BufReader::with_capacity(READ_BYTES, open(path)?);
    let options = LinearReaderOptions::default()
        .with_emit_chunks(true)
        .with_validate_data_section_crc(true)
        .with_record_length_limit(LARGEST_RECORD);
    let mut reader = LinearReader::new_with_options(options);
    let (definitions, channels) = (BTreeMap::new(), BTreeMap::new());
    let mut file = File { path, sink, definitions, definition_bytes: 0, channels };
    while let Some(event) = reader.next_event() {
        match event.map_err(|error| mcap_error(path, &error))? {
            LinearReadEvent::ReadRequest(need) => {
                let count = bytes.read(reader.insert(need.min(LARGEST_RECORD))).map_err(Error::io("read", path))?;
                reader.notify_read(count);
            }
            LinearReadEvent::Record { opcode, .. } if !READ.contains(&opcode) => {}
            LinearReadEvent::Record { opcode, data } => {
                check_texts(path, opcode, data)?;
                match mcap::parse_record(opcode, data).map_err(|error| mcap_error(path, &error))? {
                    Record::Chunk { header, data } => file.chunk(&header, &data)?,
                    record => file.record(record)?,
                }
            }
        }
    }
    Ok(())
}

/// Refuses a record in which a text is longer than the record: the crate would take the memory for it first.
fn check_texts(path: &Path, opcode: u8, body: &[u8]) -> Result<(), Error> {
    // Where texts begin, and how many there are; each has its length in front. After those of a channel come pairs until its end.
    let (first, count) = match opcode {
        op::SCHEMA => (2, 3),
        op::CHANNEL => (4, 2),
        op::CHUNK => (28, 1),
        _ => return Ok(()),
    };
    let mut rest = body.get(first..);
    let text = |bytes: &mut Option<&[u8]>| {
        *bytes = bytes.and_then(|bytes| {
            let (length, after) = bytes.split_first_chunk::<4>()?;
            after.get(usize::try_from(u32::from_le_bytes(*length)).ok()?..)
        });
    };
    (0..count).for_each(|_| text(&mut rest));
    if opcode == op::CHANNEL {
        rest = rest.and_then(|bytes| bytes.get(4..));
        while rest.is_some_and(|bytes| !bytes.is_empty()) {
            text(&mut rest);
        }
    }
    rest.map(|_| ()).ok_or_else(|| broken(path, &"a text is longer than the record that it stands in"))
}

/// Bytes that were unpacked, and their check sum.
struct Unpacked<R> {
    inner: R,
    sum: crc32fast::Hasher,
    count: u64,
}

impl<R: Read> Read for Unpacked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        self.sum.update(&buffer[..count]);
        self.count += count as u64;
        Ok(count)
    }
}

impl<S: Sink> File<'_, S> {
    /// Reads the records of a chunk one by one. The reader of the crate would, but mcap 0.25 never ends on some damaged ones.
    fn chunk(&mut self, header: &ChunkHeader, data: &[u8]) -> Result<(), Error> {
        let bad = |error: io::Error| {
            broken(self.path, &format!("a chunk cannot be unpacked: {}", whole_file::plain(&error.to_string())))
        };
        let inner: Box<dyn Read + '_> = match header.compression.as_str() {
            "" => Box::new(data),
            "zstd" => {
                let mut decoder = zstd::stream::read::Decoder::with_buffer(data).map_err(bad)?;
                decoder.window_log_max(LARGEST_WINDOW_LOG).map_err(bad)?;
                Box::new(decoder)
            }
            "lz4" => Box::new(lz4::Decoder::new(data).map_err(bad)?),
            other => {
                return Err(broken(self.path, &format!("expected chunks in zstd or lz4, found {}", excerpt(other))));
            }
        };
        // One byte more than there should be, to see whether there is.
        let inner = inner.take(header.uncompressed_size.saturating_add(1));
        let mut bytes = Unpacked { inner, sum: crc32fast::Hasher::new(), count: 0 };
        let mut body = Vec::new();
        while bytes.count < header.uncompressed_size {
            let mut head = [0; 9];
            bytes.read_exact(&mut head).map_err(bad)?;
            let mut length = [0; 8];
            length.copy_from_slice(&head[1..]);
            let length = u64::from_le_bytes(length);
            if length > LARGEST_RECORD as u64 {
                return Err(broken(
                    self.path,
                    &format!("expected records of at most {LARGEST_RECORD} bytes, found {length}"),
                ));
            }
            body.clear();
            let read = (&mut bytes).take(length).read_to_end(&mut body);
            let count = read.map_err(bad)?;
            if count as u64 != length {
                return Err(broken(self.path, &format!("a chunk ends within a record of {length} bytes")));
            }
            if !READ.contains(&head[0]) {
                continue;
            }
            check_texts(self.path, head[0], &body)?;
            let record = mcap::parse_record(head[0], &body).map_err(|error| mcap_error(self.path, &error))?;
            self.record(record)?;
        }
        if header.uncompressed_crc != 0 && bytes.sum.finalize() != header.uncompressed_crc {
            return Err(broken(self.path, &"the check sum of a chunk is wrong"));
        }
        Ok(())
    }

    fn record(&mut self, record: Record<'_>) -> Result<(), Error> {
        match record {
            Record::Schema { header: SchemaHeader { id, name, encoding }, data } => {
                if !self.definitions.contains_key(&id) {
                    self.definition_bytes += data.len();
                    if self.definition_bytes > MOST_DEFINITIONS {
                        return Err(broken(
                            self.path,
                            &format!("expected at most {MOST_DEFINITIONS} bytes of definitions"),
                        ));
                    }
                    self.definitions.insert(id, Definition { name, encoding, data: data.into_owned() });
                }
                Ok(())
            }
            Record::Channel(channel) => self.channel(channel),
            Record::Message { header, data } => {
                let number = header.channel_id;
                let Some(channel) = self.channels.get(&number) else {
                    return Err(broken(self.path, &format!("a message of channel {number}, which was not announced")));
                };
                if !self.sink.wants(&channel.topic) {
                    return Ok(());
                }
                // A decoder that is none was told when its channel came.
                let Ok(decoder) = &channel.decoder else { return Ok(()) };
                let value = decoder.decode(&data).map_err(|reason| {
                    let time = header.log_time;
                    broken(self.path, &format!("message of {} at {time} ns: {reason}", excerpt(&channel.topic)))
                })?;
                self.sink.message(&Message {
                    path: self.path,
                    topic: &channel.topic,
                    log_nanos: i128::from(header.log_time),
                    publish_nanos: i128::from(header.publish_time),
                    value,
                })
            }
            _ => Ok(()),
        }
    }

    fn channel(&mut self, channel: mcap::records::Channel) -> Result<(), Error> {
        if self.channels.contains_key(&channel.id) {
            return Ok(());
        }
        if self.channels.len() >= MOST_CHANNELS {
            return Err(broken(self.path, &format!("expected at most {MOST_CHANNELS} channels, found more")));
        }
        let definition = self.definitions.get(&channel.schema_id);
        let (name, encoding, data) =
            definition.map_or(("", "", &[][..]), |d| (d.name.as_str(), d.encoding.as_str(), d.data.as_slice()));
        let decoder = Decoder::new(&channel.message_encoding, name, encoding, data);
        let problem = decoder.as_ref().err().map(String::as_str);
        self.sink.channel(self.path, &channel.topic, name, problem)?;
        self.channels.insert(channel.id, Channel { topic: channel.topic, decoder });
        Ok(())
    }
}
