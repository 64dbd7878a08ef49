//! The importers: on sources made here with known answers, and on the published data, where those lie beside the workspace, by closed forms.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use import_log::published;
use measured_log::{Axis, Channel, Episode, Log, Shape};
use proptest::prelude::*;

/// The published data; where they are not there, `None`, and the test counts as skipped.
#[track_caller]
fn data(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data").join(name);
    if path.exists() {
        return Some(path);
    }
    skipped::skipped(&format!("{name} of the published data is not beside the workspace"));
    None
}

const TOSSES: &str = "\
toss,t_s,x_m,y_m,z_m,qw,qx,qy,qz,vx_mps,vy_mps,vz_mps,wx_body_rps,wy_body_rps,wz_body_rps
0,0.000000,0.1,0.2,0.5,0.8,0,0,0.6,1,2,3,4,5,6
0,0.006757,0.1,0.2,0.5,0.8,0,0,0.6,1,2,3,4,5,6
1,0.000000,0.1,0.2,0.5,1,0,0,0,1,2,3,4,5,6
";

/// Two pushes along y with the tool turned by a quarter, force (1, 2) N on the sensor beside its first reading.
fn pushes() -> String {
    let mut text = String::from("2\n");
    for start in [1_439_834_932_u64, 1_439_834_999] {
        text.push_str("600 30 10 0.70710678 0 0 0.70710678\n600 40 10 0.70710678 0 0 0.70710678\n3\n");
        for (part, fx, fy) in [("231402298", 0.5, 0.25), ("241402298", 0.5, 0.25), ("251402298", 1.5, 2.25)] {
            let _ = writeln!(text, "{start}.{part} {fx} {fy}");
        }
        text.push_str("2\n");
        for (part, y) in [("2414023", 0), ("261402298", 10)] {
            let _ = writeln!(text, "{start}.{part} 550 {y} 20 0.70710678 0 0 0.70710678");
        }
    }
    text
}

const PUSH_NAME: &str = "10_130_20_10_15_130__exp.txt";

fn source(name: &str, text: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn close(found: f64, expected: f64) -> bool {
    (found - expected).abs() < 1e-6
}

#[test]
fn angular_velocity_of_a_toss_is_turned_to_world_axes() {
    let (folder, path) = source("tosses_2.csv", TOSSES);
    let (log, _) = published::contactnets(&path).unwrap();
    assert_eq!(log.episodes.iter().map(|e| (e.id, e.rows())).collect::<Vec<_>>(), [(0, 2), (1, 1)]);
    let spin = log.episodes[0].vector(Channel::ObjectSpin, 1).unwrap();
    assert!(spin.iter().zip([-3.68, 5.24, 6.0]).all(|(found, expected)| close(*found, expected)), "{spin:?}");
    assert_eq!(log.episodes[1].vector(Channel::ObjectVelocity, 0), Some([1.0, 2.0, 3.0]));
    assert_eq!(log.episodes[0].orientation(0), Some([0.0, 0.0, 0.6, 0.8]));
    assert_eq!(published::contactnets(folder.path()).unwrap().0, log, "a folder with one table");
    std::fs::write(folder.path().join("tosses_3.csv"), TOSSES).unwrap();
    let message = published::contactnets(folder.path()).unwrap_err().to_string();
    assert!(message.ends_with("expected exactly one file tosses_*.csv, found 2"), "{message}");
}

#[test]
fn a_push_is_in_metres_and_base_axes_and_nothing_is_resampled() {
    let (_folder, path) = source(PUSH_NAME, &pushes());
    let (log, _) = published::cmu_push(&path, published::HARD_BOARD_N).unwrap();
    let Shape::Prism { feet_m, .. } = &log.header.object.shape else { panic!("{:?}", log.header.object.shape) };
    for (found, expected) in feet_m.iter().flatten().zip([-0.04, -0.04, 0.08, -0.035, -0.03, 0.08]) {
        assert!(close(*found, expected), "{feet_m:?}");
    }
    assert!(close(log.header.table.friction.mean(), 4.2 / (1.518 * 9.81)));
    assert!(close(log.header.table.height_m.mean(), 0.01));
    let push = &log.episodes[1];
    // Force at 0, 10, 20 ms; tool 2 ns after the second force and at 30 ms.
    assert_eq!(push.time_secs, [0.0, 0.01, 0.010_000_002, 0.02, 0.03]);
    assert_eq!(push.get(Channel::WristForce(Axis::X), 0), Some(0.0));
    assert_eq!(push.vector(Channel::Tool, 1), None);
    assert_eq!(push.vector(Channel::Tool, 2), Some([0.55, 0.0, 0.02]));
    // (1, 2) N is (3, -1) / sqrt 2 in the tool's axes, which a quarter turn takes to (1, 3) / sqrt 2.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let force = [Axis::X, Axis::Y].map(|a| push.get(Channel::WristForce(a), 3).unwrap());
    assert!(close(force[0], half) && close(force[1], 3.0 * half), "{force:?}");
    // The centroid, (50, 50) mm from the right angle, turned by a quarter.
    for (row, y) in [(0, 0.08), (4, 0.09)] {
        let centre = push.vector(Channel::ObjectPosition, row).unwrap();
        assert!(close(centre[0], 0.55) && close(centre[1], y) && close(centre[2], 0.035), "{centre:?}");
    }
    assert!((1..4).all(|row| push.orientation(row).is_none()));
}

#[test]
fn packed_pushes_and_folders_named_after_the_feet_are_read() {
    let (folder, path) = source(PUSH_NAME, &pushes());
    let whole = published::cmu_push(&path, 5.0).unwrap().0;
    for (place, expected_feet) in [("wood_10_130_20_10_15_130", 3), ("patch", 0)] {
        let place = folder.path().join(place);
        std::fs::create_dir(&place).unwrap();
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packed.write_all(pushes().as_bytes()).unwrap();
        let path = place.join("exp.txt.gz");
        std::fs::write(&path, packed.finish().unwrap()).unwrap();
        let log = published::cmu_push(&path, 5.0).unwrap().0;
        assert_eq!(log.episodes, whole.episodes);
        let Shape::Prism { feet_m, .. } = log.header.object.shape else { panic!("no prism") };
        assert_eq!(feet_m.len(), expected_feet);
    }
    let other = folder.path().join("exp.txt");
    std::fs::write(&other, pushes()).unwrap();
    let message = published::cmu_push(&other, 5.0).unwrap_err().to_string();
    assert!(message.contains("expected the feet in mm as x1_x2_x3_y1_y2_y3, or patch"), "{message}");
}

#[test]
fn damaged_sources_are_answered_with_their_place() {
    let refused = |text: &str| {
        let (_folder, path) = source(PUSH_NAME, text);
        published::cmu_push(&path, 4.2).unwrap_err().to_string()
    };
    let whole = pushes();
    for (from, to, expected) in [
        ("2\n600", "0\n600", "number 1: expected a count of 1 to 1000000, found `0`"),
        ("600 30", "600 NaN", "number 3: expected a finite number, found `NaN`"),
        ("932.231402298", "932.2314022981", "number 17: expected a date in seconds with at most 9 decimals"),
        ("932.231402298", "-932.2", "number 17: expected a date in seconds"),
        ("\n3\n", "\n999999999\n", "number 16: expected a count"),
        ("0.70710678 0 0 0.70710678\n600 40", "2 0 0 0.70710678\n600 40", "expected"),
    ] {
        let message = refused(&whole.replacen(from, to, 1));
        assert!(message.contains(expected), "{message}");
    }
    // A truncated file misses numbers, wherever it was cut between two of them.
    for (at, _) in whole.match_indices(' ') {
        refused(&whole[..at]);
    }
    assert!(refused(&format!("{whole} 7")).contains("expected the end of the file, found `7`"));
    let (_folder, path) = source("tosses_1.csv", &TOSSES.replace("t_s", "t_ms"));
    assert!(published::contactnets(&path).unwrap_err().to_string().contains("row of names"));
    let (_folder, path) = source("tosses_1.csv", &TOSSES.replacen("0.5", "inf", 1));
    let message = published::contactnets(&path).unwrap_err().to_string();
    assert!(message.contains("row 1, column z_m: expected a finite number, found `inf`"), "{message}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_sources_are_imported_or_refused(
        at in any::<prop::sample::Index>(), bytes in prop::collection::vec(any::<u8>(), 0..12), cut in any::<bool>(), pack in any::<bool>(),
    ) {
        let mutate = |text: &str| {
            let mut mutated = text.as_bytes().to_vec();
            let at = at.index(mutated.len());
            if cut { mutated.truncate(at) } else { mutated.splice(at..at, bytes.iter().copied()); }
            mutated
        };
        let folder = tempfile::tempdir().unwrap();
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packed.write_all(pushes().as_bytes()).unwrap();
        let packed = packed.finish().unwrap();
        let push = if pack { packed.iter().copied().chain(bytes.iter().copied()).collect() } else { mutate(&pushes()) };
        for (name, bytes) in [(PUSH_NAME, push), ("tosses_1.csv", mutate(TOSSES))] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let imported = if name == PUSH_NAME { published::cmu_push(&path, 4.2) } else { published::contactnets(&path) };
            if let Err(error) = imported {
                let message = error.to_string();
                prop_assert!(message.contains(name) && !message.contains('\n'), "{}", message);
            }
        }
    }
}

#[test]
fn the_program_writes_a_log_that_reads_back_and_refuses_with_2() {
    let (folder, path) = source("tosses_2.csv", TOSSES);
    let run = |path: &Path, out: &Path, format: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_import-log"));
        command.arg("contactnets").arg(path).arg("--out").arg(out).args(["--format", format]).output().unwrap()
    };
    for format in ["csv", "parquet"] {
        let out = folder.path().join(format);
        let output = run(&path, &out, format);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(measured_log::read(&out).unwrap(), published::contactnets(&path).unwrap().0);
        let text = std::fs::read_to_string(out.join("log.toml")).unwrap();
        assert!(text.contains("BSD-3-Clause") && text.contains("half-width"), "{text}");
        assert_eq!(run(&path, &out, format).status.code(), Some(2), "there is a log already");
    }
    let out = folder.path().join("none");
    let output = run(&folder.path().join("missing.csv"), &out, "csv");
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.starts_with("error: cannot read ") && message.lines().count() == 1 && !out.exists(), "{message}");
}

/// Least-squares polynomial of degree 2 through (t, y): its coefficients.
fn parabola(points: &[(f64, f64)]) -> [f64; 3] {
    let mut m = [[0.0; 4]; 3];
    for (t, y) in points {
        for (i, row) in m.iter_mut().enumerate() {
            for (j, cell) in row.iter_mut().take(3).enumerate() {
                *cell += t.powi(i32::try_from(i + j).unwrap());
            }
            row[3] += y * t.powi(i32::try_from(i).unwrap());
        }
    }
    for i in 0..3 {
        let pivot = m[i];
        for (j, row) in m.iter_mut().enumerate() {
            if i != j {
                let factor = row[i] / pivot[i];
                row.iter_mut().zip(pivot).for_each(|(a, b)| *a -= factor * b);
            }
        }
    }
    [0, 1, 2].map(|i| m[i][3] / m[i][i])
}

/// Half the height of a cube of half-width `h` m that is turned by `q`.
fn reach([x, y, z, w]: [f64; 4], h: f64) -> f64 {
    let up = [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)];
    h * up.iter().map(|v| v.abs()).sum::<f64>()
}

/// Height over time while the lowest corner is above 4 mm.
fn flight(episode: &Episode) -> Vec<(f64, f64)> {
    (0..episode.rows())
        .map_while(|row| {
            let z = episode.get(Channel::ObjectPosition(Axis::Z), row)?;
            (z - reach(episode.orientation(row)?, 0.0524) > 0.004).then_some((episode.time_secs[row], z))
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[test]
fn published_tosses_fall_two_percent_too_slowly_and_rest_two_percent_too_low() {
    let Some(source) = data("contactnets_cube") else { return };
    let (log, _) = published::contactnets(&source).unwrap();
    assert_eq!((log.episodes.len(), log.episodes.iter().map(Episode::rows).sum::<usize>()), (40, 4117));
    let flights: Vec<_> = log.episodes.iter().map(flight).filter(|f| f.len() >= 12).collect();
    assert!(flights.len() > 30, "{}", flights.len());
    let gravity = median(flights.iter().map(|f| -2.0 * parabola(f)[2]).collect());
    let rest = |e: &Episode| e.get(Channel::ObjectPosition(Axis::Z), e.rows() - 1).unwrap();
    let height = median(log.episodes.iter().map(rest).collect());
    println!("free fall {gravity:.3} m/s2, rest height {:.2} mm of 52.4 mm", height * 1e3);
    // Units and axes are right: a wrong axis or time base would be off by far more. The 2 % are a finding about the data; both say that lengths
    // are short, where a wrong clock would leave the height at rest alone.
    assert!((gravity / 9.81 - 0.98).abs() < 0.01, "{gravity}");
    assert!((height / 0.0524 - 0.98).abs() < 0.01, "{height}");
    for episode in &log.episodes {
        for row in 0..episode.rows() {
            let speed = episode.vector(Channel::ObjectVelocity, row).unwrap().map(|v| v * v).iter().sum::<f64>().sqrt();
            assert!(speed < 2.0, "{speed} m/s");
        }
    }
}

#[test]
fn published_velocities_of_tosses_fit_their_poses_in_world_axes_half_a_frame_late() {
    let Some(source) = data("contactnets_cube") else { return };
    let (log, _) = published::contactnets(&source).unwrap();
    let (mut late, mut spin_errors, mut count) = (Vec::new(), 0.0, 0.0);
    for episode in &log.episodes {
        let points = flight(episode);
        if points.len() < 12 {
            continue;
        }
        let [_, v, a] = parabola(&points);
        for (row, (t, _)) in points.iter().enumerate() {
            let read = episode.get(Channel::ObjectVelocity(Axis::Z), row).unwrap();
            late.push((read - (v + 2.0 * a * t)) / (-2.0 * a));
        }
        for row in 1..points.len() - 1 {
            // World axes: q' conj(q) of two frames is a rotation by the angular velocity times their distance.
            let [ax, ay, az, aw] = episode.orientation(row - 1).unwrap();
            let [bx, by, bz, bw] = episode.orientation(row + 1).unwrap();
            let turn = [
                bx * aw - bw * ax - by * az + bz * ay,
                by * aw - bw * ay - bz * ax + bx * az,
                bz * aw - bw * az - bx * ay + by * ax,
            ];
            let sign = (aw * bw + ax * bx + ay * by + az * bz).signum();
            let step = episode.time_secs[row + 1] - episode.time_secs[row - 1];
            let read = episode.vector(Channel::ObjectSpin, row).unwrap();
            for i in 0..3 {
                spin_errors += (2.0 * sign * turn[i] / step - read[i]).powi(2);
                count += 1.0;
            }
        }
    }
    let (late, spin) = (median(late), f64::sqrt(spin_errors / count));
    println!("velocities are {:.1} ms late, spins differ by {spin:.3} rad/s rms", late * 1e3);
    assert!((0.002..0.005).contains(&late), "{late} s");
    assert!(spin < 0.2, "{spin} rad/s");
}

/// Rows of the tool, as time and position.
fn path(episode: &Episode) -> Vec<(f64, [f64; 3])> {
    (0..episode.rows()).filter_map(|row| Some((episode.time_secs[row], episode.vector(Channel::Tool, row)?))).collect()
}

/// How far a point is outside the triangle, m, and the inward normal of the nearest edge, both for the object's pose in `row`.
fn outside(episode: &Episode, row: usize, point: [f64; 3]) -> (f64, [f64; 2]) {
    let centre = episode.vector(Channel::ObjectPosition, row).unwrap();
    let [_, _, z, w] = episode.orientation(row).unwrap();
    let (sin, cos) = (2.0 * z.atan2(w)).sin_cos();
    let d = [point[0] - centre[0], point[1] - centre[1]];
    let p = [cos * d[0] + sin * d[1] + 0.05, cos * d[1] - sin * d[0] + 0.05];
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let edges = [(-p[0], [1.0, 0.0]), (-p[1], [0.0, 1.0]), ((p[0] + p[1] - 0.15) * half, [-half, -half])];
    let (distance, n) = edges.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
    (distance, [cos * n[0] - sin * n[1], sin * n[0] + cos * n[1]])
}

fn force(episode: &Episode, row: usize) -> Option<[f64; 2]> {
    let [x, y] = [Axis::X, Axis::Y].map(|a| episode.get(Channel::WristForce(a), row));
    Some([x?, y?])
}

fn angle(v: [f64; 2]) -> f64 {
    v[1].atan2(v[0])
}

fn check_pushes(log: &Log) {
    let (mut off_normal, mut gaps, mut agreeing) = (Vec::new(), Vec::new(), 0);
    for episode in &log.episodes {
        let last = episode.rows() - 1;
        let path = path(episode);
        for pair in path.windows(2) {
            let way = (0..3).map(|i| (pair[1].1[i] - pair[0].1[i]).powi(2)).sum::<f64>().sqrt();
            assert!(way < 1e-3, "the tool jumps by {way} m");
        }
        // The tool begins outside the triangle where that was and ends on an edge of the triangle where that is, to the cameras' accuracy.
        let (start, end) = (path[0].1, path[path.len() - 1].1);
        assert!(outside(episode, 0, start).0 > -0.001, "{}", outside(episode, 0, start).0);
        let (gap, normal) = outside(episode, last, end);
        gaps.push(gap);
        assert!(gap.abs() < 0.003, "{gap}");
        // The object moves where the tool touches it, and not farther than the tool went.
        let [a, b] = [0, last].map(|row| episode.vector(Channel::ObjectPosition, row).unwrap());
        let moved = f64::hypot(b[0] - a[0], b[1] - a[1]);
        assert!(moved > 0.001 && moved < 0.025, "{moved}");
        let forces: Vec<[f64; 2]> = (0..=last).filter_map(|row| force(episode, row)).collect();
        let early = forces[..30].iter().map(|f| f64::hypot(f[0], f[1])).fold(0.0, f64::max);
        let tail = &forces[forces.len() - 100..];
        let mean = [0, 1].map(|i| tail.iter().map(|f| f[i]).sum::<f64>() / 100.0);
        assert!(early < 0.2 && f64::hypot(mean[0], mean[1]) > 1.0, "{early} N before, {mean:?} N during contact");
        // What acts on the object is opposite to what acts on the tool: it pushes inwards, and turns the object as that turned.
        let on_object = [-mean[0], -mean[1]];
        let off = (angle(on_object) - angle(normal) + 9.0 * std::f64::consts::PI) % (2.0 * std::f64::consts::PI)
            - std::f64::consts::PI;
        off_normal.push(off.to_degrees());
        let arm = [end[0] - b[0], end[1] - b[1]];
        let torque = arm[0] * on_object[1] - arm[1] * on_object[0];
        let yaw = |row| episode.orientation(row).map(|[_, _, z, w]| 2.0 * f64::atan2(z, w)).unwrap();
        agreeing += usize::from(torque * f64::sin(yaw(last) - yaw(0)) > 0.0);
    }
    let count = off_normal.len();
    #[expect(clippy::cast_precision_loss, reason = "a few dozen")]
    let rms = (off_normal.iter().map(|a| a * a).sum::<f64>() / count as f64).sqrt();
    println!(
        "{agreeing} of {count} turn with the torque, force {rms:.1} degrees off the normal, gap {:.2} mm",
        1e3 * median(gaps)
    );
    assert_eq!(agreeing, count);
    assert!(rms < 30.0 && off_normal.iter().all(|a| a.abs() < 40.0), "{rms}");
}

#[test]
fn published_pushes_push_inwards_and_turn_the_object_as_it_turned() {
    let Some(folder) = data("cmu_triangle_push") else { return };
    for (name, pushes) in
        [("10_130_10_10_10_130__exp_08_17_50.txt.gz", 50), ("30_90_30_30_30_90__exp_08_11_30.txt.gz", 30)]
    {
        let (log, _) = published::cmu_push(&folder.join(name), published::HARD_BOARD_N).unwrap();
        assert_eq!(log.episodes.len(), pushes);
        check_pushes(&log);
    }
}
