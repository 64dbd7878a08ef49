//! What a shell completes: the verbs of the menu and the options of the programs.

use std::process::Command;

use end_to_end::run;

/// Completions of the last word, in a real bash.
fn completed(script: &str, words: &[&str]) -> Vec<String> {
    const DRIVER: &str = r#"
source "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
# `complete -o bashdefault -o default -F NAME cargo` says who is asked.
function=$(complete -p "$1")
function=${function##*-F }
function=${function%% *}
"$function" "$1" "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD - 1]}"
printf '%s\n' "${COMPREPLY[@]}"
"#;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("completions.bash");
    std::fs::write(&file, script).unwrap();
    let output = Command::new("bash").args(["--norc", "-c", DRIVER, "bash"]).arg(&file).args(words).output().unwrap();
    assert!(output.stderr.is_empty(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap().lines().map(String::from).collect()
}

#[test]
fn bash_completes_verbs_and_options_behind_cargo_xtask_and_behind_an_alias() {
    let output = run("xtask", "completions bash");
    assert!(output.status.success() && output.stderr.is_empty(), "all programs are built: {output:?}");
    let script = String::from_utf8(output.stdout).unwrap();
    for before in [&["xtask"][..], &["cargo", "xtask"]] {
        let complete = |words: &[&str]| completed(&script, &[before, words].concat());
        assert_eq!(complete(&["cal"]), ["calibrate"]);
        assert_eq!(complete(&["diagnose-"]), ["diagnose-benchmark", "diagnose-learn"]);
        // Options of programs, which the menu does not link.
        assert_eq!(complete(&["eval", "--tr"]), ["--trials"]);
        assert_eq!(complete(&["scenario", "ch"]), ["check"]);
        assert_eq!(complete(&["scenario", "check", "--pre"]), ["--preset"]);
        // The menu's own.
        assert_eq!(complete(&["doctor", "--py"]), ["--python"]);
        assert_eq!(complete(&["completions", "pow"]), ["powershell"]);
    }
    assert_eq!(completed(&script, &["cargo", "bu"]), [""], "without a completion of cargo there is none");
}

#[test]
fn what_completes_cargo_goes_on_to_do_so() {
    let script = String::from_utf8(run("xtask", "completions bash").stdout).unwrap();
    let script = format!("_cargo() {{ COMPREPLY=(build); }}\n{script}");
    assert_eq!(completed(&script, &["cargo", "bu"]), ["build"]);
    assert_eq!(completed(&script, &["cargo", "xtask", "sce"]), ["scenario"]);
}

#[test]
fn every_shell_gets_a_script() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let output = run("xtask", &format!("completions {shell}"));
        let script = String::from_utf8(output.stdout).unwrap();
        assert!(
            output.status.success() && script.contains("diagnose-benchmark") && script.contains("trials"),
            "{shell}"
        );
    }
    let zsh = String::from_utf8(run("xtask", "completions zsh").stdout).unwrap();
    assert!(zsh.contains("_cargo-xtask()"));
    let help = String::from_utf8(run("xtask", "completions --help").stdout).unwrap();
    assert!(help.contains("source") && help.contains("alias xtask='cargo xtask'"), "{help}");
    assert_eq!(run("xtask", "completions tcsh").status.code(), Some(2));
}
