//! What callers rely on: equal bytes, whole files, stated sizes, every label in the SVG, typed errors.

#[path = "../examples/gallery/made_up.rs"]
mod made_up;

use std::path::Path;

use figures::{
    Axis, Chart, Dots, Error, Estimate, Estimates, Figure, Heat, Histogram, Lines, Panel, Reference, Scale, Series,
};

fn figure(chart: Chart) -> Figure {
    let panel = Panel { title: "only".into(), chart };
    Figure { panels: vec![panel], columns: 1, panel_size_px: (300, 200), ..Figure::default() }
}

fn lines(points: Vec<(f64, f64)>) -> Lines {
    Lines { series: vec![Series { name: "a".into(), points, ..Series::default() }], ..Lines::default() }
}

fn decode(png: &[u8]) -> ((u32, u32), Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.color_type, png::ColorType::Rgb);
    ((info.width, info.height), pixels)
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn equal_figures_give_equal_bytes_and_different_figures_different_ones() {
    let (a, b) = (made_up::learning(), made_up::learning());
    assert_eq!(a.svg().unwrap(), b.svg().unwrap());
    assert_eq!(a.png().unwrap(), b.png().unwrap());
    // Also beside other threads that draw.
    let other = std::thread::spawn(|| (made_up::coverage().png().unwrap(), made_up::learning().png().unwrap()));
    assert_eq!(a.png().unwrap(), other.join().unwrap().1);
    let mut moved = made_up::learning();
    let Chart::Lines(lines) = &mut moved.panels[0].chart else { panic!("learning curves are lines") };
    lines.series[0].points[100].1 *= 2.0;
    assert_ne!(a.svg().unwrap(), moved.svg().unwrap());
    assert_ne!(a.png().unwrap(), moved.png().unwrap());
}

#[test]
fn both_formats_have_the_stated_size() {
    for (name, figure) in made_up::all() {
        let (width, height) = figure.size_px().unwrap();
        assert_eq!(width, figure.panel_size_px.0 * figure.columns as u32, "{name}");
        let svg = figure.svg().unwrap();
        assert!(svg.starts_with(&format!("<svg width=\"{width}\" height=\"{height}\" viewBox=")), "{name}");
        assert!(svg.ends_with("</svg>\n"), "{name}");
        assert_eq!(decode(&figure.png().unwrap()).0, (width, height), "{name}");
    }
}

#[test]
fn every_word_of_every_label_is_text_in_the_svg() {
    for (name, figure) in made_up::all() {
        let svg = figure.svg().unwrap();
        // Inside text elements only, with lines that wrap joined.
        let texts: Vec<&str> = svg.split("<text").skip(1).map(|t| t.split(['>', '<']).nth(1).unwrap().trim()).collect();
        let texts = texts.join(" ");
        let mut labels = vec![figure.title.clone()];
        for panel in &figure.panels {
            labels.push(panel.title.clone());
            match &panel.chart {
                Chart::Lines(c) => {
                    labels.extend([c.x.label.clone(), c.y.label.clone()]);
                    labels.extend(c.series.iter().map(|s| s.name.clone()));
                    labels.extend(c.references.iter().map(|r| r.name.clone()));
                }
                Chart::Histogram(c) => labels.extend([c.x.label.clone(), c.y.label.clone(), c.name.clone()]),
                Chart::Dots(c) => {
                    labels.extend(c.categories.iter().cloned());
                    labels.extend([c.category_label.clone(), c.value.label.clone()]);
                    labels.extend(c.series.iter().map(|s| s.name.clone()));
                }
                Chart::Heat(c) => labels.extend(c.rows.iter().chain(&c.columns).cloned()),
                other => panic!("{other:?} is not looked at"),
            }
        }
        for label in labels {
            let escaped = label.replace('&', "&amp;").replace('\'', "&apos;");
            assert!(texts.contains(&escaped), "{name}: `{label}` is missing in {texts}");
        }
    }
}

#[test]
fn markup_and_control_characters_in_labels_are_harmless() {
    let mut figure = figure(Chart::Lines(lines(vec![(0.0, 0.0), (1.0, 1.0)])));
    figure.title = "a < b & \"c\"\u{1} </svg>\u{0}".into();
    let svg = figure.svg().unwrap();
    assert!(svg.contains("a &lt; b &amp; &quot;c&quot;"));
    assert!(!svg.chars().any(|c| c.is_control() && c != '\n'));
    assert_eq!(svg.matches("</svg>").count(), 1);
}

#[test]
fn a_series_has_one_colour_in_all_panels_and_in_other_figures_that_name_it() {
    let stroke = |svg: &str| -> Vec<String> {
        let lines = svg.lines().filter(|l| l.starts_with("<polyline") && l.contains("stroke-width=\"8\""));
        lines.map(|l| l.split("stroke=\"").nth(1).unwrap()[..7].to_owned()).collect()
    };
    let series = |name: &str| Series { name: name.into(), ..lines(vec![(0.0, 1.0), (1.0, 2.0)]).series.remove(0) };
    let panel = |names: &[&str]| Panel {
        title: String::new(),
        chart: Chart::Lines(Lines { series: names.iter().map(|n| series(n)).collect(), ..Lines::default() }),
    };
    let panels = vec![panel(&["a", "b"]), panel(&["c", "b", "a"])];
    let mut figure = Figure { panels, columns: 2, panel_size_px: (300, 200), ..Figure::default() };
    let colors = stroke(&figure.svg().unwrap());
    // Legend a, b, c, then the panels.
    let [a, b, c] = [&colors[0], &colors[1], &colors[2]];
    assert!(a != b && b != c && a != c);
    assert_eq!(colors[3..].iter().collect::<Vec<_>>(), [a, b, c, b, a]);
    figure.panels.remove(0);
    figure.colors = ["a", "b", "c"].map(String::from).to_vec();
    assert_eq!(stroke(&figure.svg().unwrap())[3..].iter().collect::<Vec<_>>(), [c, b, a]);
}

#[test]
fn a_gap_interrupts_a_line() {
    let count = |y: f64| {
        let points = (0..9).map(|i| (f64::from(i), if i == 4 { y } else { f64::from(i) })).collect();
        let svg = figure(Chart::Lines(lines(points))).svg().unwrap();
        svg.lines().filter(|l| l.starts_with("<polyline") && l.contains("stroke-width=\"8\"")).count()
    };
    // One more in the legend.
    assert_eq!([count(4.0), count(f64::NAN), count(f64::NEG_INFINITY)], [2, 3, 3]);
}

#[test]
fn the_bitmap_shows_what_the_svg_shows() {
    // A bar over the right half: blue there, white on the left.
    let histogram = Histogram {
        x: Axis::default(),
        y: Axis { limits: Some((0.0, 1.0)), ..Axis::default() },
        name: String::new(),
        counts: vec![f64::NAN, 1.0],
        edges: (0.0, 2.0),
        expected: None,
    };
    let ((width, height), pixels) = decode(&figure(Chart::Histogram(histogram)).png().unwrap());
    let share = |columns: std::ops::Range<u32>| {
        let cells = (height / 4..height / 2).flat_map(|y| columns.clone().map(move |x| (y * width + x) as usize * 3));
        let blue = |i: &usize| pixels[i + 2] > 150 && pixels[*i] < 120;
        cells.clone().filter(blue).count() as f64 / cells.count() as f64
    };
    assert_eq!(share(width / 4..width / 2 - 20), 0.0);
    assert_eq!(share(width / 2 + 40..width * 3 / 4), 1.0);
}

#[test]
fn saving_writes_two_files_that_others_may_read_and_replaces_old_ones() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.b.png"), "old").unwrap();
    // Who has the old file open keeps it whole: a second name for it stands for such a reader.
    let reader = folder.path().join("reader");
    std::fs::hard_link(folder.path().join("a.b.png"), &reader).unwrap();
    let figure = made_up::coverage();
    let paths = figure.save(&folder.path().join("a.b")).unwrap();
    assert_eq!(std::fs::read_to_string(&reader).unwrap(), "old");
    assert_eq!(names(folder.path()), ["a.b.png", "a.b.svg", "reader"]);
    assert_eq!(std::fs::read(&paths[0]).unwrap(), figure.svg().unwrap().as_bytes());
    assert_eq!(std::fs::read(&paths[1]).unwrap(), figure.png().unwrap());
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode();
        std::fs::write(folder.path().join("plain"), "").unwrap();
        assert_eq!(mode(&paths[0]), mode(&folder.path().join("plain")));
    }
}

#[test]
fn a_failing_folder_is_left_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let figure = made_up::coverage();
    let missing = figure.save(&folder.path().join("missing/a"));
    assert!(matches!(missing, Err(Error::Io { .. })), "{missing:?}");
    // A folder where a file should go: the temporary file must not stay.
    std::fs::create_dir_all(folder.path().join("b.svg/full")).unwrap();
    let taken = figure.save(&folder.path().join("b"));
    assert!(matches!(taken, Err(Error::Io { action: "publish", .. })), "{taken:?}");
    assert_eq!(names(folder.path()), ["b.svg"]);
    // Bad data are refused before anything is written.
    let bad = Figure { panels: Vec::new(), ..figure };
    assert!(matches!(bad.save(&folder.path().join("c")), Err(Error::Figure { .. })));
    assert_eq!(names(folder.path()), ["b.svg"]);
}

#[test]
fn contradictions_are_errors_that_name_the_panel_and_the_numbers() {
    let reason = |chart: Chart| match figure(chart).svg() {
        Err(Error::Panel { panel, reason }) if panel == "only" => reason,
        other => panic!("{other:?}"),
    };
    let limits = |low, high, scale| Axis { label: "y".into(), limits: Some((low, high)), scale };
    let y = |axis: Axis| Chart::Lines(Lines { y: axis, ..lines(vec![(0.0, 1.0)]) });
    assert!(reason(y(limits(2.0, 1.0, Scale::Linear))).contains("2 to 1"));
    assert!(reason(y(limits(f64::NAN, 1.0, Scale::Linear))).contains("NaN"));
    assert!(reason(y(limits(0.0, 1.0, Scale::Log))).contains("must be positive"));
    let reference = Reference { name: "r".into(), low: 0.0, high: f64::INFINITY };
    assert!(reason(Chart::Lines(Lines { references: vec![reference], ..Lines::default() })).contains("`r`"));
    let band = Series { name: "s".into(), band: vec![(1.0, 0.0, 1.0), (0.5, 0.0, 1.0)], ..Series::default() };
    assert!(reason(Chart::Lines(Lines { series: vec![band], ..Lines::default() })).contains("0.5 follows 1"));
    let two = Estimates { name: "m".into(), values: vec![Estimate::exact(1.0); 2], ..Estimates::default() };
    let dots = Dots { categories: vec!["c".into()], series: vec![two], ..Dots::default() };
    assert!(reason(Chart::Dots(dots)).contains("2 values for 1 categories"));
    assert!(reason(Chart::Dots(Dots::default())).contains("at least one category"));
    let heat = |rows: usize, row: usize| Heat {
        rows: vec!["r".into(); 2],
        columns: vec!["c".into(); 2],
        values: vec![vec![0.0; row]; rows],
        ..Heat::default()
    };
    assert!(reason(Chart::Heat(heat(1, 2))).contains("1 rows of values for 2"));
    assert!(reason(Chart::Heat(heat(2, 3))).contains("3 values for 2"));
    let histogram = |counts: Vec<f64>, edges| Histogram {
        x: Axis::default(),
        y: Axis::default(),
        name: String::new(),
        counts,
        edges,
        expected: None,
    };
    assert!(reason(Chart::Histogram(histogram(vec![], (0.0, 1.0)))).contains("at least one bin"));
    assert!(reason(Chart::Histogram(histogram(vec![-1.0], (0.0, 1.0)))).contains("-1"));
    assert!(reason(Chart::Histogram(histogram(vec![1.0], (1.0, 1.0)))).contains("1 to 1"));
    let many =
        Heat { rows: vec!["r".into(); 80], columns: vec!["c".into()], values: vec![vec![0.0]; 80], ..Heat::default() };
    assert!(reason(Chart::Heat(many)).contains("80 names"));
}

#[test]
fn figures_without_room_are_errors() {
    let mut small = figure(Chart::Lines(lines(vec![(0.0, 0.0), (1.0, 1.0)])));
    for (size, columns) in [((60, 200), 1), ((300, 40), 1)] {
        small.panel_size_px = size;
        small.columns = columns;
        assert!(matches!(small.png(), Err(Error::TooSmall { .. })), "{size:?}");
    }
    for (size, columns) in [
        ((0, 0), 1),
        ((1, 1), 1),
        ((u32::MAX, u32::MAX), 1),
        ((300, 200), 0),
        ((300, 200), usize::MAX),
        ((4000, 4000), 1),
    ] {
        small.panel_size_px = size;
        small.columns = columns;
        assert!(matches!(small.png(), Err(Error::Figure { .. })), "{size:?} {columns}");
    }
    let mut named = figure(Chart::Lines(lines(vec![(0.0, 0.0), (1.0, 1.0)])));
    named.title = "word".repeat(20);
    assert!(matches!(named.svg(), Err(Error::Figure { reason }) if reason.contains("wordword")));
    named.title = String::new();
    named.panels[0].title = "panel".repeat(20);
    assert!(matches!(named.svg(), Err(Error::Panel { reason, .. }) if reason.contains("panelpanel")));
    named.panels[0].title = String::new();
    named.panels[0].chart = Chart::Lines(Lines { y: Axis::new("label".repeat(20)), ..lines(vec![(0.0, 1.0)]) });
    assert!(matches!(named.svg(), Err(Error::Panel { reason, .. }) if reason.contains("labellabel")));
    named.panels[0].chart = Chart::Lines(Lines {
        series: vec![Series { name: "name".repeat(20), ..Series::default() }],
        ..Lines::default()
    });
    assert!(matches!(named.svg(), Err(Error::Figure { reason }) if reason.contains("namename")));
}
