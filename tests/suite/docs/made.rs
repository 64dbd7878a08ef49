//! The pages that are made from the code are those that would be made now, and the book can be built.

use end_to_end::{program, root, stderr};

#[test]
fn made_pages_are_up_to_date() {
    let output = program("docs").args(["--check", "--root"]).arg(root()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "cargo xtask docs --write writes these anew:\n{said}{}", stderr(&output));
}

#[test]
fn the_book_is_built_with_its_pictures_and_nothing_else_is_touched() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("docs");
    let build = || program("docs").args(["--no-api", "--out"]).arg(&out).arg("--root").arg(root()).output().unwrap();
    let output = build();
    assert!(output.status.success(), "{}", stderr(&output));
    let index = out.join("index.html");
    assert!(String::from_utf8_lossy(&output.stdout).trim().ends_with("index.html") && index.is_file());
    let page = std::fs::read_to_string(out.join("reference/effects.html")).unwrap();
    let pictures: Vec<&str> = page.split("src=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    let effects = pictures.iter().filter(|picture| picture.starts_with("effects/")).count();
    assert!(effects > 30, "{effects} pictures");
    for picture in pictures.iter().filter(|picture| picture.starts_with("effects/")) {
        assert!(out.join("reference").join(picture).is_file(), "{picture}");
    }
    assert!(build().status.success(), "its own folder is used again");

    let other = folder.path().join("thesis");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("chapter.tex"), "").unwrap();
    let output = program("docs").args(["--no-api", "--out"]).arg(&other).arg("--root").arg(root()).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("found other files"), "{}", stderr(&output));
    assert!(other.join("chapter.tex").is_file());
}
