//! Options that several programs have, said once. Each is flattened into the arguments of a program.

use std::path::PathBuf;

use clap::Args;

/// `--threads`.
#[derive(Clone, Copy, Debug, Default, Args)]
#[command(about = None, long_about = None)]
pub struct Threads {
    /// Worker threads [default: all cores, but one in a task of slurm or hq]; but for times, what comes out does not depend on it.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub threads: Option<u32>,
}

impl Threads {
    /// The number as rayon takes it: 0 for all cores.
    #[must_use]
    pub fn count(self) -> usize {
        self.threads.unwrap_or(0) as usize
    }
}

/// `--root`.
#[derive(Clone, Debug, Default, Args)]
#[command(about = None, long_about = None)]
pub struct Project {
    /// Project folder [default: the nearest one above with scenarios/base.toml].
    #[arg(long)]
    pub root: Option<PathBuf>,
}

/// `--robot`.
#[derive(Clone, Debug, Args)]
#[command(about = None, long_about = None)]
pub struct Arm {
    /// Arm: sawyer, jaco, or a robot file (docs/src/guides/arm.md).
    #[arg(long, default_value = "sawyer")]
    pub robot: String,
}

/// `--set`.
#[derive(Clone, Debug, Default, Args)]
#[command(about = None, long_about = None)]
pub struct Overrides {
    /// Overrides a scenario entry: key=value.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory as _, Parser};

    use super::*;

    /// About the program.
    #[derive(Debug, Parser)]
    struct Arguments {
        #[command(flatten)]
        work: Threads,
        #[command(flatten)]
        project: Project,
        #[command(flatten)]
        arm: Arm,
        #[command(flatten)]
        overrides: Overrides,
    }

    #[test]
    fn shared_options_are_read_and_leave_the_words_of_the_program_alone() {
        let line = ["test", "--threads", "3", "--root", "here", "--set", "a=1", "--set", "b=2"];
        let read = Arguments::parse_from(line);
        assert_eq!((read.work.count(), read.arm.robot.as_str()), (3, "sawyer"));
        assert_eq!((read.project.root, read.overrides.set), (Some("here".into()), vec!["a=1".into(), "b=2".into()]));
        assert_eq!(Arguments::parse_from(["test"]).work.count(), 0);
        assert!(Arguments::try_parse_from(["test", "--threads", "0"]).is_err());
        let command = Arguments::command();
        assert_eq!(command.get_about().map(ToString::to_string).as_deref(), Some("About the program"));
    }
}
