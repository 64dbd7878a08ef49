//! Datasets on disk: exact, deterministic, resumable, and refused by name when damaged.

mod fixture;
mod refused;
mod written;
