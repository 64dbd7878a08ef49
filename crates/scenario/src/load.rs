//! Which files a scenario is made of, and how they are read.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::{Table, Value};
use whole_file::{one_line, plain};

use crate::layers::{LayerKind, Layers};
use crate::{Error, Scenario, VERSION};

/// Which scenario to load.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Folder that holds `scenarios/` and `assets/`.
    pub root: PathBuf,
    /// Domain: `D1` … `D5`, `obstacle`, or a path to a TOML file (a resolved scenario among them).
    pub domain: String,
    /// Robot: `sawyer`, `jaco`, or a path.
    pub robot: String,
    /// Preset: `surmise`, `paper`, or a path.
    pub preset: String,
    /// A run of a minute or two.
    pub quick: bool,
    /// Overrides `key=value`, with dotted keys and TOML values.
    pub set: Vec<String>,
    /// A `model.toml` of `diagnose`: its effects become `effects.model`, before the overrides.
    pub effects: Option<PathBuf>,
}

impl Selection {
    /// D1 for the Sawyer with preset `paper`.
    #[must_use]
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self {
            root: root.into(),
            domain: "D1".into(),
            robot: "sawyer".into(),
            preset: "paper".into(),
            quick: false,
            set: Vec::new(),
            effects: None,
        }
    }

    /// Reads the layers, merges and checks them.
    ///
    /// # Errors
    ///
    /// [`Error`] with file, key and expectation.
    pub fn load(&self) -> Result<Scenario, Error> {
        self.layers()?.resolve()
    }

    /// Reads the layers.
    pub(crate) fn layers(&self) -> Result<Layers, Error> {
        let scenarios = self.root.join("scenarios");
        let quick = self.quick.then(|| scenarios.join("presets/quick.toml"));
        let paths = [
            (LayerKind::Base, scenarios.join("base.toml")),
            (LayerKind::Robot, locate("robot", &self.robot, &scenarios.join("robots"))?),
            (LayerKind::Preset, locate("preset", &self.preset, &scenarios.join("presets"))?),
            (LayerKind::Domain, locate("domain", &self.domain, &scenarios)?),
        ];
        let mut layers = Layers::default();
        for (kind, path) in paths.into_iter().chain(quick.map(|path| (LayerKind::Quick, path))) {
            let (name, table) = (path.display().to_string(), read(&path)?);
            // Of a file that is no arm, whatever else it says would be missed in others.
            if kind == LayerKind::Robot && !table.get("robot").is_some_and(Value::is_table) {
                let message = "expected the table [robot] of an arm, as in scenarios/robots/sawyer.toml".into();
                return Err(Error::Key { file: name, key: "robot".into(), message });
            }
            layers.push(kind, name, table);
        }
        if let Some(path) = &self.effects {
            layers.push(LayerKind::Effects, path.display().to_string(), read_effects(path)?);
        }
        for text in &self.set {
            layers.push(LayerKind::Set, format!("--set {}", one_line(text, QUOTED)), parse_override(text)?);
        }
        Ok(layers)
    }
}

/// Preset of programs that play, where none is asked for: the best that we build.
pub const PRESET: &str = "surmise";
/// Size of a file.
const MOST_BYTES: u64 = 4 << 20;
/// Characters of a file that a message quotes.
pub(crate) const QUOTED: usize = 200;
/// Characters of what is wrong.
pub(crate) const SENTENCE: usize = 1000;

/// The nearest folder at or above `start` that holds `scenarios/base.toml`.
///
/// # Errors
///
/// [`Error::Robot`] where there is none.
pub fn find_root(start: &Path) -> Result<PathBuf, Error> {
    Ok(physics_model::robot::find_root(start)?)
}

/// The project folder that a command line names, or the nearest one at or above the current folder.
///
/// # Errors
///
/// [`Error::Robot`] where there is none, and where the folder that is named is no project.
pub fn project_root(given: Option<&Path>) -> Result<PathBuf, Error> {
    let Some(root) = given else { return find_root(Path::new(".")) };
    physics_model::robot::check_root(root)?;
    Ok(root.to_path_buf())
}

fn locate(kind: &'static str, name: &str, folder: &Path) -> Result<PathBuf, Error> {
    if name.contains('/') || Path::new(name).extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
        return Ok(PathBuf::from(name));
    }
    let path = folder.join(format!("{}.toml", name.to_lowercase()));
    // `base` and `quick` are layers of their own.
    if path.is_file() && !["base", "quick"].contains(&name) {
        return Ok(path);
    }
    let mut known: Vec<String> = std::fs::read_dir(folder)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.path().file_name()?.to_str()?.strip_suffix(".toml").map(String::from))
        .filter(|stem| !["base", "quick"].contains(&stem.as_str()))
        .collect();
    known.sort();
    Err(Error::Unknown { kind, name: name.into(), known: known.join(", ") })
}

fn read(path: &Path) -> Result<Table, Error> {
    #[derive(Deserialize)]
    struct Head {
        version: Option<Value>,
    }
    let bytes = whole_file::read(path, MOST_BYTES)
        .map_err(|error| Error::Read { file: path.to_path_buf(), source: error.source })?;
    let syntax = |message: &str| Error::Syntax { file: path.to_path_buf(), message: one_line(message, SENTENCE) };
    let text = std::str::from_utf8(&bytes)
        .map_err(|e| syntax(&format!("expected UTF-8 text, found another byte at {}", e.valid_up_to())))?;
    if text.trim_start().starts_with('<') {
        return Err(syntax(
            "expected keys and values, found XML; a URDF file is named in the [robot] table of a TOML file",
        ));
    }
    // The version alone comes first, so that an old file says so instead of listing unknown keys.
    let head: Head = toml::from_str(text).map_err(|e| syntax(&toml_problem(text, &e)))?;
    if let Some(found) = head.version
        && found.as_integer() != Some(i64::from(VERSION))
    {
        let found = one_line(&found.to_string(), QUOTED);
        return Err(Error::Version { file: path.to_path_buf(), found, expected: VERSION });
    }
    toml::from_str(text).map_err(|e| syntax(&toml_problem(text, &e)))
}

/// What a TOML parser says, with the line: its own display quotes the text over several lines.
fn toml_problem(text: &str, error: &toml::de::Error) -> String {
    let line = whole_file::line_of(text, error.span().map_or(0, |span| span.start));
    format!("line {line}: {}", plain(error.message()))
}

/// What a model that `diagnose` wrote says to a scenario: the effects. The rest is about the object of its log.
fn read_effects(path: &Path) -> Result<Table, Error> {
    let mut table = read(path)?;
    if table.contains_key("effect") {
        return Err(Error::Key {
            file: path.display().to_string(),
            key: "effect".into(),
            message: "found a model of an arm's joints, expected one of pushes: the planner has no use for it".into(),
        });
    }
    let missing = || Error::Key {
        file: path.display().to_string(),
        key: "effects.model".into(),
        message: "expected a list of effects, as `diagnose` writes it".into(),
    };
    match table.remove("effects") {
        Some(Value::Table(mut effects)) => match effects.remove("model") {
            Some(model @ Value::Array(_)) => Ok(nested(["effects", "model"], model)),
            _ => Err(missing()),
        },
        _ => Err(missing()),
    }
}

/// A value below two keys.
fn nested([outer, inner]: [&str; 2], value: Value) -> Table {
    let inner = Table::from_iter([(inner.to_string(), value)]);
    Table::from_iter([(outer.to_string(), Value::Table(inner))])
}

fn parse_override(text: &str) -> Result<Table, Error> {
    let error = || Error::Override { text: one_line(text, QUOTED) };
    let (key, value) = text.split_once('=').ok_or_else(error)?;
    let (key, value) = (key.trim(), value.trim());
    if key.is_empty() || key.contains(['\n', '#', '[']) || value.contains('\n') {
        return Err(error());
    }
    toml::from_str(&format!("{key} = {value}")).or_else(|_| {
        // What begins as a list, a table or a text in quotes has to be one.
        let broken = toml::from_str::<Table>(&format!("x = {value}")).is_err();
        if broken && value.starts_with(['[', '{', '"', '\'']) {
            return Err(Error::OverrideValue { text: one_line(text, QUOTED) });
        }
        // A bare word is a string: `--set preset=paper` needs no quotes.
        toml::from_str(&format!("{key} = \"{}\"", value.escape_default())).map_err(|_| error())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn root() -> PathBuf {
        find_root(Path::new(env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    fn load(change: impl FnOnce(&mut Selection)) -> Result<Scenario, Error> {
        let mut selection = Selection::new(root());
        change(&mut selection);
        selection.load()
    }

    #[test]
    fn every_domain_loads_for_every_robot() {
        for domain in ["D1", "D2", "D3", "D4", "D5", "obstacle", "tilted", "training"] {
            for robot in ["sawyer", "jaco"] {
                for quick in [false, true] {
                    let scenario = load(|s| {
                        s.domain = domain.into();
                        s.robot = robot.into();
                        s.quick = quick;
                    })
                    .unwrap_or_else(|e| panic!("{domain} {robot}: {e}"));
                    assert_eq!(scenario.name, domain);
                    assert_eq!(scenario.robot.name, robot);
                }
            }
        }
    }

    #[test]
    fn the_arm_of_a_scenario_is_the_one_of_its_file() {
        for robot in ["sawyer", "jaco"] {
            let file = root().join(format!("scenarios/robots/{robot}.toml"));
            let scenario = load(|s| s.robot = robot.into()).unwrap();
            assert_eq!(physics_model::robot::RobotConfig::read(&file).unwrap(), scenario.robot);
        }
    }

    #[test]
    fn a_resolved_scenario_loads_again_to_the_same_values() {
        let scenario = load(|s| {
            s.domain = "D4".into();
            // Not the arm that is laid under it when it is loaded again.
            s.robot = "jaco".into();
            s.set = vec!["planner.depth=7".into(), "planner.budget={ simulations = 9 }".into()];
        })
        .unwrap();
        assert_eq!(scenario.planner.depth, 7);
        let file = std::env::temp_dir().join(format!("surmise-resolved-{}.toml", std::process::id()));
        std::fs::write(&file, scenario.to_toml()).unwrap();
        let again = load(|s| s.domain = file.display().to_string());
        std::fs::remove_file(&file).unwrap();
        assert_eq!(again.unwrap(), scenario);
    }

    #[test]
    fn an_override_that_begins_as_a_list_or_table_has_to_be_one() {
        for broken in ["[a, b]", "{ low = }", "[1, 2", "\"word", "'word"] {
            let text = format!("distribution.friction={broken}");
            let message = load(|s| s.set = vec![text.clone()]).unwrap_err().to_string();
            assert!(message.starts_with(&format!("--set {text}: expected a TOML value, for example")), "{message}");
        }
        let key = load(|s| s.set = vec!["a b=[1, 2]".into()]).unwrap_err().to_string();
        assert!(key.contains("expected key=value with a dotted key"), "{key}");
        assert!(load(|s| s.set = vec!["preset=paper".into()]).is_ok());
    }

    #[test]
    fn an_arms_urdf_is_no_robot_file() {
        let file = root().join("assets/robots/jaco.urdf").display().to_string();
        let message = load(|s| s.robot.clone_from(&file)).unwrap_err().to_string();
        assert!(message.starts_with(&file) && message.contains("found XML; a URDF file is named in"), "{message}");
    }

    #[test]
    fn a_model_of_diagnose_gives_its_effects_to_the_planner_alone() {
        let file = std::env::temp_dir().join(format!("surmise-model-{}.toml", std::process::id()));
        let load_with = |text: &str| {
            std::fs::write(&file, text).unwrap();
            let scenario = load(|s| s.effects = Some(file.clone()));
            std::fs::remove_file(&file).unwrap();
            scenario
        };
        let tilt = "{ table_tilt = { slope_x_rad = 0.01, slope_y_rad = 0.0 } }";
        let text = format!("version = 1\n[nominal]\n\"table.friction\" = 0.3\n[effects]\nmodel = [{tilt}]\n");
        let (plain, scenario) = (load(|_| ()).unwrap(), load_with(&text).unwrap());
        assert_eq!(scenario.effects.model.iter().map(|e| e.kind().name()).collect::<Vec<_>>(), ["table_tilt"]);
        assert_eq!(scenario.effects.truth, plain.effects.truth);
        assert_eq!(scenario.distribution, plain.distribution);
        let missing = load_with("version = 1\n[effects]\n").unwrap_err().to_string();
        assert!(missing.contains("effects.model"), "{missing}");
    }

    #[test]
    fn the_true_arm_can_be_dynamic_while_the_model_stays_kinematic() {
        use physics_model::config::{ArmConfig, ServoConfig};
        let set = |text: &str| load(|s| s.set = vec![text.into()]);
        let arm = set("arm.truth={ dynamic = { stiffness_nmprad = 3000.0, damping_ratio = 0.7 } }").unwrap().arm;
        assert_eq!(arm.truth, ArmConfig::Dynamic(ServoConfig { stiffness_nmprad: 3000.0, damping_ratio: 0.7 }));
        assert_eq!(arm.model, ArmConfig::Kinematic);
        let soft =
            set("arm.truth={ dynamic = { stiffness_nmprad = 0.0, damping_ratio = 0.7 } }").unwrap_err().to_string();
        assert!(soft.contains("arm.truth.dynamic.stiffness_nmprad") && soft.contains("N·m/rad"), "{soft}");
        let unknown = set("arm.truth={ dynamic = { stiffness = 1.0 } }").unwrap_err().to_string();
        assert!(unknown.contains("stiffness_nmprad"), "{unknown}");
    }

    #[test]
    fn effects_and_their_unknown_parameters_are_checked() {
        let set = |texts: &[&str]| load(|s| s.set = texts.iter().map(ToString::to_string).collect());
        let message = |texts: &[&str]| set(texts).unwrap_err().to_string();
        let tilt = "effects.model=[{ table_tilt = { slope_x_rad = 0.0, slope_y_rad = 0.0 } }]";
        let slope =
            "distribution.effects.table_tilt.slope_x_rad={ mean = 0.0, stddev = 0.02, low = -0.05, high = 0.05 }";
        let scenario = set(&[tilt, slope]).unwrap();
        assert_eq!(scenario.distribution.effects.len(), 1);
        let again: Scenario = toml::from_str(&scenario.to_toml()).unwrap();
        assert_eq!(again, scenario);
        let unlisted = message(&[slope]);
        assert!(
            unlisted.contains("distribution.effects.table_tilt: expected table_tilt in effects.truth"),
            "{unlisted}"
        );
        let wide = message(&[tilt, &slope.replace("high = 0.05", "high = 5.0")]);
        assert!(wide.contains("distribution.effects.table_tilt.slope_x_rad") && wide.contains("rad"), "{wide}");
        let unknown = message(&[tilt, &slope.replace("slope_x_rad", "slope_rad")]);
        assert!(unknown.contains("slope_x_rad, slope_y_rad exist"), "{unknown}");
        let steep = message(&["effects.truth=[{ table_tilt = { slope_x_rad = 0.0, slope_y_rad = 1.0 } }]"]);
        assert!(steep.contains("table_tilt.slope_y_rad: expected -0.7 to 0.7 rad, found 1"), "{steep}");
        let misspelt = message(&["effects.truth=[{ teher = { stiffness_npm = 1.0 } }]"]);
        assert!(misspelt.contains("teher") && misspelt.contains("tether"), "{misspelt}");
        // Nothing is written of what is not there: old runs keep their hashes.
        assert!(!set(&[]).unwrap().to_toml().contains("distribution.effects"));
    }

    #[test]
    fn what_a_file_quotes_stays_on_one_line_and_is_cut() {
        let folder = std::env::temp_dir().join(format!("surmise-quotes-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("mine.toml");
        let message = |bytes: &[u8]| {
            std::fs::write(&file, bytes).unwrap();
            load(|s| s.domain = file.display().to_string()).unwrap_err().to_string()
        };
        let long = format!("{} = 1", "a".repeat(100_000));
        let cases: [(&[u8], &str); 6] = [
            (b"\"a\\nb\" = 1", "a b"),
            (b"a = \x07", "line 1"),
            (b"\n\na = [", "line 3"),
            (b"\xff", "UTF-8"),
            (long.as_bytes(), "there is no key"),
            (b"name = \"../D4\"", "name: expected 1 to 64 letters"),
        ];
        for (bytes, expected) in cases {
            let message = message(bytes);
            assert!(message.contains(expected) && message.contains("mine.toml"), "{message}");
            assert!(!message.contains(char::is_control) && message.len() < 2000, "{message:?}");
        }
        std::fs::remove_dir_all(&folder).unwrap();
        let device = load(|s| s.domain = "/dev/zero".into()).unwrap_err();
        assert!(matches!(device, Error::Read { .. }), "{device}");
    }

    #[test]
    fn what_is_no_number_is_refused_before_it_is_used() {
        let message = |set: &str| load(|s| s.set = vec![set.into()]).unwrap_err().to_string();
        let cases = [
            ("world.arm_stiffness_npm=nan", "world.arm_stiffness_npm: expected above 0 and at most 1e9 N/m, found NaN"),
            ("robot.home_rad=[nan, 0.0]", "robot: expected finite numbers in home_rad"),
            ("robot.locked_joints.head_pan=inf", "robot: expected finite numbers in home_rad"),
            ("robot.urdf=\"a\\tb.urdf\"", "robot.urdf: expected a path without control characters"),
            (
                "agent.search_steps={ world_steps = 0, solver_iterations = 2 }",
                "agent.search_steps.world_steps: expected 1 to 100, found 0",
            ),
            (
                "agent.search_steps={ world_steps = 2, solver_iterations = 0 }",
                "agent.search_steps.solver_iterations: expected 1 to 1000, found 0",
            ),
        ];
        for (set, expected) in cases {
            let message = message(set);
            assert!(message.contains(expected), "{set}: {message}");
        }
    }

    #[test]
    fn unknown_names_list_what_exists() {
        let message = load(|s| s.domain = "D9".into()).unwrap_err().to_string();
        assert!(
            message.contains("unknown domain `D9`")
                && message.contains("d1, d2, d3, d4, d5, obstacle, tilted, training"),
            "{message}"
        );
        let message = load(|s| s.robot = "panda".into()).unwrap_err().to_string();
        assert!(message.contains("jaco, sawyer"), "{message}");
    }
}
