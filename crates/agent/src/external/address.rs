//! Where a world is: a command to run, or a socket on this machine.

use std::fmt;
use std::net::SocketAddr;
use std::str::FromStr;

use super::WorldError;

/// Address of an external world, as on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WorldAddress {
    /// A program and its arguments, run without a shell; it speaks on its standard input and output.
    Command {
        /// As it was given.
        text: String,
        /// Program.
        program: String,
        /// Arguments.
        arguments: Vec<String>,
    },
    /// A socket on the loopback interface.
    Tcp(SocketAddr),
}

impl FromStr for WorldAddress {
    type Err = WorldError;

    fn from_str(text: &str) -> Result<Self, WorldError> {
        let refused = |expected| WorldError::Address { text: super::error::one_line(text, 200), expected };
        if let Some(address) = text.strip_prefix("tcp://") {
            const LOOPBACK: &str =
                "a loopback address with a port, for example tcp://127.0.0.1:5555 or tcp://[::1]:5555";
            let address: SocketAddr = address.parse().map_err(|_| refused(LOOPBACK))?;
            // What comes over a network is not trusted, and the protocol has no authentication.
            return if address.ip().is_loopback() { Ok(Self::Tcp(address)) } else { Err(refused(LOOPBACK)) };
        }
        let mut words = shlex::split(text).ok_or_else(|| refused("a command line whose quotes are closed"))?;
        if words.first().is_none_or(String::is_empty) {
            return Err(refused("a command, or tcp://127.0.0.1:PORT"));
        }
        let program = words.remove(0);
        Ok(Self::Command { text: text.to_string(), program, arguments: words })
    }
}

impl fmt::Display for WorldAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Command { text, .. } => f.write_str(text),
            Self::Tcp(address) => write!(f, "tcp://{address}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_line_is_split_as_a_shell_would_and_run_by_none() {
        let address: WorldAddress = "python3 'my world.py' --mode a\\ b $HOME;ls".parse().unwrap();
        let WorldAddress::Command { program, arguments, .. } = &address else { panic!("{address:?}") };
        assert_eq!(program, "python3");
        assert_eq!(arguments, &["my world.py", "--mode", "a b", "$HOME;ls"]);
        assert_eq!(address.to_string(), "python3 'my world.py' --mode a\\ b $HOME;ls");
    }

    #[test]
    fn only_sockets_of_this_machine_are_accepted() {
        for good in ["tcp://127.0.0.1:5555", "tcp://127.8.9.1:1", "tcp://[::1]:5555"] {
            assert!(matches!(good.parse(), Ok(WorldAddress::Tcp(_))), "{good}");
        }
        for bad in ["tcp://192.168.0.2:5555", "tcp://0.0.0.0:5555", "tcp://[::ffff:10.0.0.1]:5", "tcp://localhost:5555"]
        {
            let message = bad.parse::<WorldAddress>().unwrap_err().to_string();
            assert!(message.contains(bad) && message.contains("loopback"), "{message}");
        }
        for bad in ["", "   ", "''", "python3 'open"] {
            assert!(bad.parse::<WorldAddress>().is_err(), "{bad}");
        }
    }
}
