//! Lines to a world and back: over the pipes of a child process, or over a socket. Every wait and every allocation is bounded.
//!
//! Reading and writing have a thread each, because a pipe has no time-out of its own. The threads end when the world's side is gone,
//! which ending the child's process group (or the connection) brings about.

use std::io::{BufRead as _, BufReader, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use super::process::Process;
use super::{WorldAddress, WorldError};

/// Longest line that a world may send, bytes.
pub const LINE_LIMIT_BYTES: usize = 65_536;
/// The last request, which has no answer.
pub(super) const CLOSE: &str = "{\"close\": {}}";
/// Requests that may wait for the world to read them. There is one answer to each, so that a second one waits only for a world that answers
/// without reading.
const UNREAD_REQUESTS: usize = 4;
/// How long a world may take to end, after `close` or after the end of its output.
const GRACE: Duration = Duration::from_secs(2);
/// How often a world that has not answered is looked at.
const WATCH: Duration = Duration::from_millis(100);

enum Line {
    Whole(Vec<u8>),
    TooLong,
}

enum Peer {
    Process(Process),
    Socket(TcpStream),
}

/// An open connection to a world. Dropping it ends the world: asked if the last exchange was good, by force otherwise.
pub(super) struct Link {
    /// `None` once closed.
    requests: Option<SyncSender<Vec<u8>>>,
    lines: Receiver<Line>,
    peer: Peer,
    healthy: bool,
}

impl Link {
    /// Starts the program or connects.
    pub(super) fn open(address: &WorldAddress, timeout: Duration) -> Result<Self, WorldError> {
        match address {
            WorldAddress::Command { program, arguments, .. } => {
                let (process, output, input) = Process::spawn(program, arguments)?;
                let (requests, lines) = threads(output, input);
                Ok(Self { requests: Some(requests), lines, peer: Peer::Process(process), healthy: false })
            }
            WorldAddress::Tcp(address) => {
                let failed = |source| WorldError::Connect { address: *address, source };
                let stream = TcpStream::connect_timeout(address, timeout).map_err(failed)?;
                stream.set_nodelay(true).map_err(failed)?;
                let (reader, writer) = (stream.try_clone().map_err(failed)?, stream.try_clone().map_err(failed)?);
                let (requests, lines) = threads(reader, writer);
                Ok(Self { requests: Some(requests), lines, peer: Peer::Socket(stream), healthy: false })
            }
        }
    }

    /// Sends `line` (without line feed) as `request` and waits for the line that answers it.
    pub(super) fn exchange(
        &mut self,
        request: &'static str,
        line: &str,
        timeout: Duration,
    ) -> Result<String, WorldError> {
        self.healthy = false;
        let bytes = [line.as_bytes(), b"\n"].concat();
        let sent = self.requests.as_ref().map(|requests| requests.try_send(bytes));
        if let Some(Err(std::sync::mpsc::TrySendError::Full(_))) = sent {
            return Err(WorldError::Deaf { request, said: self.said() });
        }
        // A writer that has given up says nothing here: the world's answers end as well, and that tells more.
        match self.receive(timeout) {
            Ok(Line::Whole(line)) => {
                let text = String::from_utf8(line).map_err(|error| WorldError::Answer {
                    request,
                    field: ".".into(),
                    problem: format!("expected UTF-8, found other bytes after {}", error.utf8_error().valid_up_to()),
                })?;
                self.healthy = true;
                Ok(text)
            }
            Ok(Line::TooLong) => Err(WorldError::Long { request, limit: LINE_LIMIT_BYTES }),
            Err(RecvTimeoutError::Timeout) => {
                Err(WorldError::Silent { request, seconds: timeout.as_secs_f64(), said: self.said() })
            }
            Err(RecvTimeoutError::Disconnected) => {
                let how = self.how_it_ended();
                Err(WorldError::Ended { request, how, said: self.said() })
            }
        }
    }

    /// The next line. A world that has exited is not waited for, even where a child of its own keeps its output open.
    fn receive(&mut self, timeout: Duration) -> Result<Line, RecvTimeoutError> {
        let mut left = timeout;
        loop {
            let slice = left.min(WATCH);
            match self.lines.recv_timeout(slice) {
                Err(RecvTimeoutError::Timeout) => left -= slice,
                received => return received,
            }
            if let Peer::Process(process) = &mut self.peer
                && process.exited_within(Duration::ZERO)
            {
                // What it wrote before may still be on its way.
                return self.lines.recv_timeout(WATCH).map_err(|_| RecvTimeoutError::Disconnected);
            }
            if left.is_zero() {
                return Err(RecvTimeoutError::Timeout);
            }
        }
    }

    /// Says that the last answer was no good: the world is ended without being asked.
    pub(super) fn distrust(&mut self) {
        self.healthy = false;
    }

    /// For a world whose output has ended.
    fn how_it_ended(&mut self) -> String {
        let Peer::Process(process) = &mut self.peer else { return "closed the connection".into() };
        if !process.exited_within(GRACE) {
            return "closed its output".into();
        }
        process.end().map_or_else(|| "ended".into(), |status| format!("ended with {status}"))
    }

    fn said(&mut self) -> String {
        match &mut self.peer {
            Peer::Socket(_) => String::new(),
            Peer::Process(process) => process.last_words(),
        }
    }
}

impl Drop for Link {
    fn drop(&mut self) {
        if self.healthy
            && let Some(requests) = &self.requests
        {
            // It may be gone already.
            let _ = requests.try_send(format!("{CLOSE}\n").into_bytes());
        }
        // The writer's end: the world's input closes behind the last request.
        self.requests = None;
        match &mut self.peer {
            Peer::Socket(stream) => {
                // What was just sent is still delivered by an orderly shutdown; it fails where the connection is gone.
                let _ = stream.shutdown(if self.healthy { Shutdown::Read } else { Shutdown::Both });
            }
            Peer::Process(process) => {
                if self.healthy {
                    process.exited_within(GRACE);
                }
                process.end();
            }
        }
    }
}

fn threads(
    reader: impl Read + Send + 'static,
    mut writer: impl Write + Send + 'static,
) -> (SyncSender<Vec<u8>>, Receiver<Line>) {
    let (requests, queue) = sync_channel::<Vec<u8>>(UNREAD_REQUESTS);
    thread::spawn(move || {
        while let Ok(bytes) = queue.recv() {
            if writer.write_all(&bytes).and_then(|()| writer.flush()).is_err() {
                return;
            }
        }
    });
    let (sender, lines) = sync_channel(1);
    thread::spawn(move || read_lines(reader, &sender));
    (requests, lines)
}

/// Hands on whole lines, one at a time, until the end of the input, a line that is too long, or until nobody listens.
fn read_lines(reader: impl Read, lines: &SyncSender<Line>) {
    let mut reader = BufReader::new(reader);
    loop {
        let mut line = Vec::new();
        let read = (&mut reader).take(LINE_LIMIT_BYTES as u64 + 1).read_until(b'\n', &mut line);
        let whole = line.pop_if(|last| *last == b'\n').is_some();
        let next = match read {
            Ok(_) if whole => Line::Whole(line),
            Ok(count) if count > LINE_LIMIT_BYTES => Line::TooLong,
            // The end; what stands before it without a line feed is no line.
            _ => return,
        };
        let last = matches!(next, Line::TooLong);
        if lines.send(next).is_err() || last {
            return;
        }
    }
}
