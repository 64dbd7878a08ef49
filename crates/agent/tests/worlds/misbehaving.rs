//! A world that speaks the protocol properly until it does the one thing, mostly wrong, that its first argument names; `good` never does.
//!
//! Where the second argument is a file and not `-`, a child that it starts writes its process number there and sleeps: to see whether it is
//! ended too. Where the third is a file, it starts only once: it makes the file, and exits where it is there.

use std::io::{BufRead as _, Write as _};
use std::process::exit;
use std::thread::sleep;
use std::time::Duration;

use serde_json::{Value, json};

const FOREVER: Duration = Duration::from_secs(3600);

fn main() {
    let mode = std::env::args().nth(1).unwrap_or_default();
    if mode == "sleep" {
        let file = std::env::args().nth(2).expect("a file");
        // Whole or not at all: somebody may be reading.
        let numbers = format!("{} {}", std::process::id(), parent_id());
        let part = format!("{file}.part");
        std::fs::write(&part, numbers).and_then(|()| std::fs::rename(&part, file)).expect("the file can be written");
        sleep(FOREVER);
    }
    if let Some(file) = std::env::args().nth(3)
        && std::fs::File::create_new(file).is_err()
    {
        exit(4);
    }
    if let Some(file) = std::env::args().nth(2).filter(|file| file != "-") {
        let program = std::env::current_exe().expect("it runs");
        // Not waited for: whoever ends this program has to end it.
        #[expect(clippy::zombie_processes, reason = "the test looks for what is left of it")]
        std::process::Command::new(program).args(["sleep", &file]).spawn().expect("it starts");
        while !std::path::Path::new(&file).exists() {
            sleep(Duration::from_millis(5));
        }
    }
    let mut hello = Value::Null;
    for line in std::io::stdin().lock().lines() {
        let request: Value = serde_json::from_str(&line.expect("the request is text")).expect("the request is JSON");
        let (name, body) = request.as_object().and_then(|o| o.iter().next()).expect("an object with one key");
        let mut answer = match name.as_str() {
            "hello" => {
                hello = body.clone();
                json!({"protocol": 1, "world": "misbehaving", "version": "1.0", "robot": body["robot"]["name"]})
            }
            "reset" => json!({
                "trial": body["trial"], "observation": observation(&hello), "joints_rad": hello["robot"]["start_rad"],
            }),
            "act" => json!({
                "step": body["step"], "observation": observation(&hello), "joints_rad": hello["robot"]["start_rad"],
                "outcome": "continue",
                "events": {"large_force": false, "out_of_reach": false, "object_moved": false, "goal": false},
            }),
            _ => return,
        };
        // hello-…, reset-… or act-…: where it goes wrong, and how.
        let fault = mode.strip_prefix(name.as_str()).and_then(|rest| rest.strip_prefix('-')).unwrap_or("");
        let raw = misbehave(fault, &mut answer);
        let text = raw.unwrap_or_else(|| json!({ name: answer }).to_string());
        println!("{text}");
        std::io::stdout().flush().expect("somebody reads");
    }
}

/// Readings of 0 and an upright object between the tool's start and the goal.
fn observation(hello: &Value) -> Value {
    let names = hello["observation"].as_array().expect("names");
    let mut values = vec![0.0; names.len()];
    let (pose, start) = (names.len() - 7, &hello["task"]["tool_start_m"]);
    values[pose] = start[0].as_f64().expect("a number");
    values[pose + 1] = -0.08;
    values[pose + 2] = 0.045;
    values[pose + 6] = 1.0;
    json!(values)
}

/// What was drawn, with one fault or none.
fn drawn(fault: &str, answer: &mut Value) -> Value {
    let size = [0.08, 0.08, 0.09];
    let mut drawn = json!({
        "theta": {
            "object": {"shape": "box", "mass_kg": 0.5, "size_m": size, "com_m": [0.0, 0.0, 0.0], "friction": 0.4},
            "obstacle": {"shape": "box", "mass_kg": 1.0, "size_m": [0.05, 0.05, 0.09]},
        },
        "object": {"position_m": [0.46, -0.08, 0.045], "yaw_rad": 0.0},
        "obstacle": {"position_m": [0.53, 0.05, 0.045], "yaw_rad": 0.0},
    });
    match fault {
        "drawn-grams" => drawn["theta"]["object"]["mass_kg"] = json!(500.0),
        "drawn-nowhere" => drawn["obstacle"] = Value::Null,
        "drawn-denied" => answer["has_obstacle"] = json!(false),
        "drawn-wide" => drawn["theta"]["object"]["size_m"][0] = json!(0.5),
        "drawn-sphere" => {
            drawn["theta"]["object"]["shape"] = json!("sphere");
            drawn["theta"]["object"]["size_m"] = json!([0.045, 0.0, 0.0]);
        }
        "drawn-low" => drawn["object"]["position_m"][2] = json!(0.09),
        "drawn-far" => drawn["object"]["position_m"][0] = json!(0.43),
        _ => {}
    }
    drawn
}

/// Spoils `answer`, or returns the text to send in its place, or never returns.
fn misbehave(fault: &str, answer: &mut Value) -> Option<String> {
    if spoil(fault, answer) {
        return None;
    }
    let number = |text: &str| Some(format!("{{\"act\":{{\"step\":1,\"observation\":[0,0,{text},0]}}}}"));
    match fault {
        "" => {}
        "hang" => sleep(FOREVER),
        "die" => {
            eprintln!("first line\nthe motors are \u{1b}[31mhot");
            exit(3);
        }
        "close" => {
            close_stdout();
            sleep(FOREVER);
        }
        "half-line" => {
            print!("{{\"act\":");
            std::io::stdout().flush().expect("somebody reads");
            exit(0);
        }
        "drip" => loop {
            print!(" ");
            std::io::stdout().flush().expect("somebody reads");
            sleep(Duration::from_millis(2));
        },
        "endless" => loop {
            // Until the pipe is closed or the process ended.
            if std::io::stdout().write_all(&[b'x'; 4096]).is_err() {
                sleep(FOREVER);
            }
        },
        "long" => return Some("x".repeat(70_000)),
        "chatter" => {
            for i in 0..200_000 {
                eprintln!("line {i} of what nobody asked for");
            }
        }
        "nonsense" => return Some("ready!".into()),
        "empty" => return Some(String::new()),
        "array" => return Some("[1, 2]".into()),
        "deep" => return Some("[".repeat(60_000)),
        "bytes" => {
            std::io::stdout().write_all(b"\xff\xfe\x00\x01\n").expect("somebody reads");
            sleep(FOREVER);
        }
        "twice" => return Some(format!("{} {}", json!({"act": answer}), json!({"act": answer}))),
        "nan" => return number("NaN"),
        "infinity" => return number("Infinity"),
        "huge-number" => return number("1e999"),
        "null" => return number("null"),
        "text-number" => return number("\"0.1\""),
        "two-answers" => {
            let first = json!({"act": answer});
            return Some(format!("{first}\n{first}"));
        }
        "other-name" => return Some(json!({"reset": answer}).to_string()),
        "error" => return Some(json!({"error": {"message": "the gripper\nis open"}}).to_string()),
        other => panic!("no such fault: {other}"),
    }
    None
}

/// Changes a value of `answer`; false where the fault is another one.
fn spoil(fault: &str, answer: &mut Value) -> bool {
    match fault {
        "short" => {
            answer["observation"].as_array_mut().expect("values").pop();
        }
        "extra" => answer["observation"].as_array_mut().expect("values").push(json!(1.0)),
        "missing" => {
            answer.as_object_mut().expect("an object").remove("observation");
        }
        "unknown-key" => answer["run"] = json!("rm -rf /"),
        "no-joints" => {
            answer.as_object_mut().expect("an object").remove("joints_rad");
        }
        "both" => answer["tool_m"] = json!([0.46, -0.26, 0.05]),
        "few-joints" => answer["joints_rad"] = json!([0.0, 1.0]),
        "far-joints" => answer["joints_rad"][1] = json!(90.0),
        "far-tool" => {
            answer.as_object_mut().expect("an object").remove("joints_rad");
            answer["tool_m"] = json!([40.0, 0.0, 0.0]);
        }
        "elsewhere" => {
            answer.as_object_mut().expect("an object").remove("joints_rad");
            answer["tool_m"] = json!([0.46, -0.1, 0.06]);
        }
        "quaternion" => {
            let last = answer["observation"].as_array().expect("values").len() - 1;
            answer["observation"][last] = json!(0.5);
        }
        "far-object" => {
            let x = answer["observation"].as_array().expect("values").len() - 7;
            answer["observation"][x] = json!(1e6);
        }
        fault if fault.starts_with("drawn") => answer["drawn"] = drawn(fault, answer),
        "wrong-trial" => answer["trial"] = json!(77),
        "wrong-step" => answer["step"] = json!(77),
        "outcome" => answer["outcome"] = json!("won"),
        "goal-without-end" => answer["events"]["goal"] = json!(true),
        "end-without-goal" => answer["outcome"] = json!("terminal"),
        "event-number" => answer["events"]["large_force"] = json!(1),
        // Nothing wrong, but something happens.
        "moved" => answer["events"]["object_moved"] = json!(true),
        "pressed" => {
            (answer["events"]["large_force"], answer["events"]["out_of_reach"]) = (json!(true), json!(true));
            answer["events"]["obstacle_touched"] = json!(true);
        }
        "won" => (answer["outcome"], answer["events"]["goal"]) = (json!("terminal"), json!(true)),
        "diverged" => answer["outcome"] = json!("diverged"),
        "place" => {
            answer["tool_m"] = json!([0.46, -0.24, 0.05]);
            answer.as_object_mut().expect("an object").remove("joints_rad");
        }
        "negative" => {
            // The same attitude as 1.
            let last = answer["observation"].as_array().expect("values").len() - 1;
            answer["observation"][last] = json!(-1.004);
        }
        "version" => answer["protocol"] = json!(2),
        "robot" => answer["robot"] = json!("panda"),
        "name" => answer["world"] = json!("../../etc/passwd"),
        _ => return false,
    }
    true
}

/// Closes standard output and keeps the process.
#[cfg(unix)]
fn close_stdout() {
    // Replaced by the null device: the pipe has no writer any longer.
    let null = std::fs::File::options().write(true).open("/dev/null").expect("a Unix system");
    rustix::stdio::dup2_stdout(null).expect("it can be replaced");
}

#[cfg(unix)]
fn parent_id() -> u32 {
    std::os::unix::process::parent_id()
}

#[cfg(not(unix))]
fn close_stdout() {
    exit(0);
}

#[cfg(not(unix))]
fn parent_id() -> u32 {
    0
}
