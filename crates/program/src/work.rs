//! Work that takes minutes.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result};
use tracing_subscriber::EnvFilter;

/// A flag that the first interrupt sets, to ask for an end. Who asks twice does not want to wait for what is at work: that ends the program
/// with exit code 130, and finished work is safe.
///
/// # Errors
///
/// Where the system has no such signal, or somebody listens already.
pub fn interrupts() -> Result<Arc<AtomicBool>> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    let listen = move || {
        if flag.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    };
    ctrlc::set_handler(listen).context("cannot listen for interrupts")?;
    Ok(interrupted)
}

/// Writes on standard error what `RUST_LOG` asks for; nothing without it, for results go to files, and progress to the bar.
///
/// # Panics
///
/// When called twice.
pub fn log_on_request() {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| "off".into());
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}
