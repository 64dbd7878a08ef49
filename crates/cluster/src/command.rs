//! Asking an engine's program.

use std::process::{Command, Stdio};

use crate::Error;

/// An engine's program with its arguments.
pub(crate) struct Asked {
    executor: &'static str,
    program: String,
    command: Command,
}

impl Asked {
    /// `program` of an executor.
    pub(crate) fn new(executor: &'static str, program: &str) -> Self {
        let mut command = Command::new(program);
        command.stdin(Stdio::null());
        // An interrupt from the terminal is for us alone: a program that submits must come to its end, so that we know what to cancel.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        Self { executor, program: program.into(), command }
    }

    /// Its arguments.
    pub(crate) fn with(mut self, arguments: impl FnOnce(&mut Command)) -> Self {
        arguments(&mut self.command);
        self
    }

    /// Runs it and returns what it printed.
    pub(crate) fn output(mut self) -> Result<String, Error> {
        let (executor, program) = (self.executor, self.program);
        let output = match self.command.output() {
            Ok(output) => output,
            Err(source) => return Err(Error::NoProgram { executor, program, source }),
        };
        if output.status.success() {
            return Ok(String::from_utf8_lossy(&output.stdout).trim().to_string());
        }
        // What went wrong is on standard error, with HyperQueue's JSON on standard output.
        let said = if output.stderr.trim_ascii().is_empty() { &output.stdout } else { &output.stderr };
        let said = String::from_utf8_lossy(said);
        let lines: Vec<&str> = said.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
        let message = if lines.is_empty() { output.status.to_string() } else { lines.join("; ") };
        Err(Error::Refused { executor, program, message })
    }
}
