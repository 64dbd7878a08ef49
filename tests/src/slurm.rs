//! A Slurm cluster of one node for tests, apart from any other that the machine may have.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use tempfile::TempDir;

use crate::root;

/// The cluster; stopped when dropped.
pub struct OneNode {
    folder: TempDir,
}

impl OneNode {
    /// Starts it; the reason where it cannot be.
    ///
    /// # Errors
    ///
    /// Where Slurm is not installed or its daemons do not start.
    ///
    /// # Panics
    ///
    /// Where no temporary folder can be made.
    pub fn start() -> Result<Self, String> {
        // Sockets lie in it, whose paths have to be short.
        let folder = tempfile::Builder::new().prefix("slurm").tempdir_in("/tmp").expect("/tmp can be written");
        let cluster = Self { folder };
        cluster.script("start").map(|()| cluster)
    }

    /// Starts the daemons that are not running.
    ///
    /// # Panics
    ///
    /// Where one does not start.
    pub fn restart(&self) {
        self.script("start").unwrap_or_else(|reason| panic!("{reason}"));
    }

    /// The configuration: `SLURM_CONF` of programs that use this cluster.
    #[must_use]
    pub fn configuration(&self) -> PathBuf {
        self.folder.path().join("slurm.conf")
    }

    /// Kills a daemon without notice, and waits until it is gone.
    ///
    /// # Panics
    ///
    /// Where it is not running, or cannot be killed.
    pub fn kill(&self, daemon: &str) {
        let file = self.folder.path().join(format!("{daemon}.pid"));
        let pid = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        let pid = pid.trim();
        assert!(signal("KILL", pid), "{daemon} is not running");
        // One that has ended and that nobody has asked about is still listed, as a zombie.
        let status = Path::new("/proc").join(pid).join("status");
        let gone = || std::fs::read_to_string(&status).map_or(true, |text| text.contains("State:\tZ"));
        for _ in 0..1000 {
            if gone() {
                return;
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        panic!("{daemon} does not end");
    }

    fn script(&self, verb: &str) -> Result<(), String> {
        let output = Command::new("bash")
            .arg(root().join("tests/slurm/one-node.sh"))
            .arg(verb)
            .arg(self.folder.path())
            .stdin(Stdio::null())
            .output()
            .map_err(|e| format!("bash: {e}"))?;
        if output.status.success() { Ok(()) } else { Err(String::from_utf8_lossy(&output.stderr).trim().into()) }
    }
}

impl Drop for OneNode {
    fn drop(&mut self) {
        if let Err(reason) = self.script("stop") {
            eprintln!("{reason}");
        }
    }
}

/// Sends a signal; whether the process was there.
#[must_use]
pub fn signal(name: &str, pid: &str) -> bool {
    Command::new("kill").args([&format!("-{name}"), pid]).stderr(Stdio::null()).status().is_ok_and(|s| s.success())
}

/// Processes that are workers in `folder`, as their command lines say.
#[must_use]
pub fn workers(folder: &Path) -> Vec<String> {
    let Ok(processes) = std::fs::read_dir("/proc") else { return Vec::new() };
    let pids = processes.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let works = |pid: &String| {
        let line = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
        let line = String::from_utf8_lossy(&line);
        line.contains("--worker\0") && line.contains(&*folder.to_string_lossy())
    };
    pids.filter(|pid| pid.bytes().all(|b| b.is_ascii_digit())).filter(works).collect()
}
