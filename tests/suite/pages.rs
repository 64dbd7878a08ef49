//! Pages in a real browser, where there is one: what it makes of them has all parts, and is drawn.

use std::path::Path;
use std::process::Command;

use end_to_end::{program, root, skipped, stderr};

/// Debian's name and that of others.
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser that answers, or the reason why there is none.
fn browser() -> Option<&'static str> {
    let answers = |name: &&&str| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success());
    let found = BROWSERS.iter().find(answers).copied();
    if found.is_none() {
        skipped(&format!("none of {} is installed", BROWSERS.join(", ")));
    }
    found
}

/// Width of a telephone, pixels.
const NARROW: u32 = 420;

/// Ends of figures without and with a caption.
const PLAIN: &str = "</svg></figure>";
const CAPTIONED: &str = "</figcaption></figure>";

/// What the browser prints with these options.
fn browse(browser: &str, options: &[&str], page: &Path) -> String {
    let profile = tempfile::tempdir().unwrap();
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"])
        // Whoever asks the network for something would fail here.
        .args(["--host-resolver-rules=MAP * ~NOTFOUND", "--disable-background-networking"])
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .args(options)
        .arg(format!("file://{}", page.display()))
        .output()
        .unwrap();
    assert!(output.status.success(), "{browser}: {}", stderr(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Share of the pixels that differ from the first one, and the picture's size.
fn ink(picture: &Path) -> (f64, u32, u32) {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(picture).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let size = info.color_type.samples();
    let pixels: Vec<&[u8]> = bytes[..info.buffer_size()].chunks_exact(size).collect();
    let other = pixels.iter().filter(|pixel| **pixel != pixels[0]).count();
    (other as f64 / pixels.len() as f64, info.width, info.height)
}

/// `end`: what each figure ends with.
fn check(browser: &str, page: &Path, sections: &[&str], figures: usize, end: &str) {
    let dom = browse(browser, &["--window-size=1100,1600", "--dump-dom"], page);
    for id in sections {
        assert!(dom.contains(&format!("<section id=\"{id}\">")), "{}: no section {id}", page.display());
    }
    assert_eq!(dom.matches("<figure").count(), figures, "{}", page.display());
    // A browser mends what it cannot read: a mended page would no longer nest as it was written.
    assert_eq!(dom.matches(end).count(), figures, "{}", page.display());
    assert_eq!(dom.matches("<section").count(), sections.len(), "{}", page.display());
    let picture = page.with_extension("png");
    browse(browser, &["--window-size=1100,1600", &format!("--screenshot={}", picture.display())], page);
    let (ink, width, height) = ink(&picture);
    assert_eq!((width, height), (1100, 1600));
    assert!(ink > 0.02 && ink < 0.98, "{}: {ink} of the pixels are drawn on", page.display());
    check_narrow(browser, page);
}

/// On a telephone a page is read by scrolling down alone; only tables scroll sideways, in boxes of their own.
fn check_narrow(browser: &str, page: &Path) {
    // Windows have a least width, frames have not; a frame made of text may be looked into, and pages themselves have no scripts.
    let text = std::fs::read_to_string(page).unwrap().replace('&', "&amp;").replace('"', "&quot;");
    let look =
        "document.title = this.contentWindow.innerWidth + ' ' + this.contentDocument.documentElement.scrollWidth";
    let frame = format!(
        "<!DOCTYPE html><title></title><iframe style=\"border:0;width:{NARROW}px;height:900px\" onload=\"{look}\" srcdoc=\"{text}\"></iframe>"
    );
    let framed = page.with_extension("narrow.html");
    std::fs::write(&framed, frame).unwrap();
    let dom = browse(browser, &["--dump-dom"], &framed);
    let title = dom.split_once("<title>").and_then(|(_, rest)| rest.split_once("</title>")).expect("a title").0;
    let widths: Vec<u32> = title.split(' ').map(|width| width.parse().expect("a width")).collect();
    let [inner, content] = widths[..] else { panic!("{title}") };
    assert_eq!(inner, NARROW, "the frame is as wide as it was asked to be");
    assert!(content <= inner, "{}: {content} of {inner} pixels: it scrolls sideways", page.display());
}

/// A page of `diagnose` has all its parts and at least three figures, and is drawn.
pub(crate) fn check_diagnosis(page: &Path) {
    let Some(browser) = browser() else { return };
    let figures = std::fs::read_to_string(page).unwrap().matches("<figure").count();
    assert!(figures >= 3, "{}: {figures}", page.display());
    check(browser, page, &["what", "where", "gap", "rivals", "nominal", "remains", "reading"], figures, CAPTIONED);
}

#[test]
fn the_pages_of_runs_and_episodes_are_whole_in_a_browser() {
    let Some(browser) = browser() else { return };
    let folder = tempfile::tempdir().unwrap();
    let page = |name: &str| folder.path().join(name);
    let report = |run: &Path, name: &str| {
        let output = program("report").arg(run).arg("--out").arg(page(name)).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
    };
    report(&root().join("assets/results/table1-surmise-D4"), "run.html");
    let sections = ["success", "pictures", "failures", "pairs", "trials", "source", "words"];
    check(browser, &page("run.html"), &sections, 3, PLAIN);

    report(&root().join("assets/results"), "all.html");
    let figures = std::fs::read_to_string(page("all.html")).unwrap().matches("<figure").count();
    assert!(figures >= 5, "{figures}");
    check(browser, &page("all.html"), &["table1", "table2", "ablation", "words"], figures, PLAIN);

    let demo = program("demo").args(["--domain", "D4", "--quick", "--out"]).arg(page("demo")).output().unwrap();
    assert!(demo.status.success(), "{}", stderr(&demo));
    let sections = ["above", "belief", "steps", "source", "words"];
    check(browser, &page("demo").join("episode.html"), &sections, 1, PLAIN);
    for (name, most) in [("episode.png", 0.5), ("animation.png", 0.98)] {
        let (ink, ..) = ink(&page("demo").join(name));
        assert!(ink > 0.02 && ink < most, "{name}: {ink} of the picture's pixels are drawn on");
    }
}
