//! Friction that another engine solves by axes: its pyramid is re-tuned, and no coefficient stands for it.

use std::path::Path;

use discrepancy::{Nominal, heldout, rig_tool};

/// `make_logs.py --engine dart --draws usual --seed 52`, log 19: nothing is hidden, friction is that of DART's default solver, and μ = 0.2255, of which the log
/// says 0.1998 ± 0.02. Without a pyramid 0.31 was found.
#[test]
fn a_pyramid_is_found_with_the_friction() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/dart-pyramid");
    let log = measured_log::read(&folder).unwrap();
    let nominal = Nominal::new(&log.header, rig_tool(&log, None).unwrap()).unwrap();
    let found = heldout::retuned(&log, &nominal, 1);
    let value = |key: &str| found.tunables.iter().find(|tunable| tunable.key == key).unwrap().mean;
    assert!(value("contact.cone_exponent") < 0.3, "{}", value("contact.cone_exponent"));
    assert!((value("table.friction") / 0.2255 - 1.0).abs() < 0.12, "{}", value("table.friction"));
}
