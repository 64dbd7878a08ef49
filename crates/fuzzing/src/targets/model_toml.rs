//! `model.toml`: what a diagnosis found.

use std::sync::OnceLock;

use discrepancy::{ModelFile, Nominal};
use measured_log::Header;
use physics_model::rig::RigTool;
use scenario::Selection;

use crate::Verdict;
use crate::parts::split;
use crate::verdict::{asset, folder, put, refused, root};

/// Reads the bytes as a model, gives it to a nominal model and to a scenario. What is accepted is read again to the same, and leaves the nominal
/// model with numbers that can be simulated.
///
/// # Panics
///
/// Where the reader breaks its rule.
#[must_use]
pub fn model_toml(data: &[u8]) -> Verdict {
    let folder = folder();
    let file = folder.path().join("model.toml");
    put(&file, data);
    // A model without effects is one for a diagnosis alone.
    if let Err(error) = (Selection { effects: Some(file.clone()), ..Selection::new(root()) }).load() {
        let _ = refused(&error, &["model.toml"]);
    }
    let model = match ModelFile::read(&file) {
        Ok(model) => model,
        Err(error) => return refused(&error, &["model.toml"]),
    };
    let text = model.to_toml().unwrap_or_else(|error| panic!("what was read cannot be written: {error}"));
    put(&file, text.as_bytes());
    let again = ModelFile::read(&file).and_then(|model| model.to_toml());
    assert_eq!(again.unwrap_or_else(|error| panic!("{error}")), text, "a model is read again to the same");
    let mut nominal = Nominal::new(header(), RigTool::None).unwrap_or_else(|error| panic!("{error}"));
    if let Err(error) = model.apply(&mut nominal) {
        return refused(&error, &["nominal."]);
    }
    let zero = vec![0.0; nominal.tunables.len()];
    let engine = nominal.engine();
    let (rig, object) = (nominal.rig(&zero, &engine), nominal.object(&zero, 0.0, &engine));
    let positive = [object.mass_kg, 1.0];
    let not_negative = [object.friction, rig.world.tool_friction];
    assert!(positive.iter().all(|v| v.is_finite() && *v > 0.0), "{object:?}");
    assert!(not_negative.iter().all(|v| v.is_finite() && *v >= 0.0), "{object:?}");
    assert!(object.com_m.iter().all(|v| v.is_finite()) && rig.world.table_height_m.is_finite(), "{object:?}");
    Verdict::Accepted
}

/// The log whose model is read: all that can be re-tuned is.
fn header() -> &'static Header {
    static HEADER: OnceLock<Header> = OnceLock::new();
    HEADER.get_or_init(|| {
        let seed = super::measured_log::seeds().swap_remove(0);
        let [_, samples] = split::<2>(&seed);
        let folder = folder();
        put(&folder.path().join("log.toml"), LOG.as_bytes());
        put(&folder.path().join("samples.csv"), samples);
        measured_log::read(folder.path()).unwrap_or_else(|error| panic!("{error}")).header
    })
}

const LOG: &str = r#"version = 1
robot = "jaco"
period_secs = 0.02
tool_friction = { mean = 0.3, stddev = 0.03 }
gravity_mps2 = 9.81
table = { height_m = { mean = 0.0, stddev = 0.001 }, friction = { mean = 0.4, stddev = 0.04 } }
split = { holdout_fraction = 0.3 }
[object]
shape = "box"
size_m = [0.1, 0.1, 0.1]
mass_kg = { mean = 0.5, stddev = 0.05 }
com_m = [{ mean = 0.0, stddev = 0.002 }, 0.0, 0.0]
restitution = { mean = 0.1, stddev = 0.02 }
"#;

/// A model that was found, and ones with other effects.
///
/// # Panics
///
/// Outside the checkout.
#[must_use]
pub fn seeds() -> Vec<Vec<u8>> {
    let short = "version = 1\n[nominal]\n\"table.friction\" = 0.36\n\"table.height_m\" = 0.001\n[effects]\nmodel = \
                 [{ table_tilt = { slope_x_rad = 0.021, slope_y_rad = 0.0 } }, { rolling_resistance = { lever_m = 0.002 } }]\n\
                 [[interval]]\neffect = \"table_tilt\"\nkey = \"slope_x_rad\"\nvalue = 0.021\ninterval90 = [0.019, 0.023]\n";
    vec![asset("assets/results/closing-the-loop/found/model.toml"), short.into()]
}
