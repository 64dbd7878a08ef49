use super::page;
use crate::decision::Probabilities;
use crate::evidence::{BINS, ChannelError, Course, Evidence, LAGS, Path, Residuals};
use crate::locate::Cell;
use crate::noise::{SensorNoise, Source};
use crate::report::{Heldout, NamedEffect, RankedEffect, Report, Retuned, Value, Verdict};
use crate::split::Split;
use crate::terms::{Coefficient, FoundTerm, LackingForce};
use crate::thin::Thinned;
use crate::trial::{Kind, Phase};

fn cell(channel: Kind, phase: Phase, mean_square: f64, p_value: f64) -> Cell {
    let over_time = std::array::from_fn(|i| (i > 2).then_some(mean_square));
    Cell { channel, phase, share: 0.5, mean_square, p_value, over_time }
}

fn evidence() -> Evidence {
    let line = |y: f64| vec![[0.0, y], [0.1, y]];
    Evidence {
        episode: Some(3),
        path: Path { measured: line(0.0), before: line(0.01), after: line(0.002) },
        course: Some(Course {
            channel: Kind::WristForce,
            component: 1,
            time_secs: vec![0.0, 1.0],
            measured: vec![0.0, 1.0],
            before: vec![0.0, 2.0],
            after: vec![0.0, 1.1],
        }),
        residuals: Residuals {
            count: 100,
            histogram: [vec![1.0 / BINS as f64; BINS], vec![1.0 / BINS as f64; BINS]],
            autocorrelation: [vec![0.4; LAGS], vec![0.0; LAGS]],
            white_below: 0.196,
        },
        errors: vec![ChannelError {
            channel: Kind::ObjectPosition,
            unit: "m",
            before: 0.0123,
            after: 0.0011,
            median_before: 0.0042,
            median_after: 0.0009,
        }],
    }
}

fn noise() -> SensorNoise {
    let (channel, source) = (Kind::ObjectPosition, Source::Estimated);
    SensorNoise { channel, unit: "m", stddev: 5e-4, source, scatter: Some(5e-4) }
}

fn probabilities() -> Probabilities {
    Probabilities { effects: vec![("table_tilt".into(), 0.97)], none: 0.01, unknown: 0.02 }
}

fn slope() -> Value {
    let (name, key) = ("slope_x".into(), "slope_x_rad".into());
    Value { name, key, unit: "rad", value: -0.021, interval90: [-0.023, -0.019] }
}

fn report(verdict: Verdict) -> Report {
    let tilt = NamedEffect {
        name: "table_tilt",
        description: "The table is not level.",
        confidence: 0.97,
        log_evidence: 210.0,
        parameters: vec![slope()],
    };
    let cells = vec![
        cell(Kind::WristForce, Phase::Sliding, 31.0, 0.001),
        cell(Kind::ObjectPosition, Phase::AfterContact, 0.9, 0.9),
    ];
    let named = verdict == Verdict::Effect;
    Report {
        warnings: Vec::new(),
        findings: Vec::new(),
        probabilities: probabilities(),
        version: 1,
        verdict,
        summary: "A sentence.".into(),
        effects: if named { vec![tilt] } else { Vec::new() },
        confusion_set: if named { vec!["table_tilt", "constant_force"] } else { Vec::new() },
        ranking: vec![
            RankedEffect { name: "table_tilt", log_evidence: 210.0, probability: 0.97, heldout: 1.01 },
            RankedEffect { name: "adhesion", log_evidence: -4.0, probability: 0.0, heldout: 9.0 },
        ],
        located: cells.clone(),
        remaining: cells,
        description: (verdict == Verdict::Unknown).then(|| "wrist_force during sliding".into()),
        lacking_force: (verdict == Verdict::Unknown).then(|| LackingForce {
            windows: 338,
            episodes: 20,
            root_mean_square_n: 0.374,
            noise_n: 0.041,
            between_episodes_share: 0.1,
            explained_share: 0.87,
            terms: vec![FoundTerm {
                name: "near_place",
                description:
                    "towards (-0.019, 0.075) m, or from it where `strength` is negative, falling with the distance"
                        .into(),
                share: 0.87,
                coefficients: vec![Coefficient { key: "strength", unit: "N m²", value: 0.000_853 }],
            }],
        }),
        contact_gap: None,
        heldout: Heldout {
            before: 9.1,
            after: if named { 1.04 } else { 9.1 },
            noise_floor: 1.0,
            closed_fraction: 0.99,
            unit: "chi2 per sample",
            episodes: vec![(3, 12.0, 1.1), (7, 4.0, 0.9)],
            plain: Vec::new(),
        },
        interval_width: 1.0,
        retuned: vec![Retuned {
            key: "object.mass_kg".into(),
            prior: [0.5, 0.05],
            value: 0.62,
            interval90: [0.6, 0.64],
        }],
        evidence: evidence(),
        next_experiment: "Push in eight directions.".into(),
        noise: vec![noise()],
        split: Split { fitted: 28, choosing: 6, reported: 6, shared: false },
        seed: 1,
        fold: None,
        thinned: Thinned::default(),
        left_out: Vec::new(),
        reason: None,
        model: None,
        effects_in_model: Vec::new(),
        rollouts: 3600,
        seconds: 41.0,
    }
}

/// Nothing was found, compared or timed, and what was computed is no number.
fn degenerate() -> Report {
    let void = f64::NAN;
    let mut report = report(Verdict::Effect);
    report.effects[0].confidence = void;
    report.effects[0].log_evidence = f64::INFINITY;
    report.effects[0].parameters[0].interval90 = [void, f64::INFINITY];
    report.ranking[0].log_evidence = f64::NEG_INFINITY;
    report.ranking[0].heldout = f64::INFINITY;
    report.located[0].mean_square = f64::INFINITY;
    report.located[0].share = 0.0;
    report.located[0].over_time = [Some(void); 8];
    report.heldout.before = f64::INFINITY;
    report.heldout.closed_fraction = void;
    report.heldout.episodes = vec![(1, 0.0, f64::INFINITY)];
    report.retuned[0].prior = [0.0, 0.0];
    report.evidence.residuals.count = 1;
    report.evidence.path.before = vec![[void, 0.0]; 2];
    report
}

fn empty(verdict: Verdict) -> Report {
    let mut report = report(verdict);
    report.ranking.clear();
    report.located.clear();
    report.remaining.clear();
    report.heldout.episodes.clear();
    report.retuned.clear();
    report.evidence = Evidence::default();
    report
}

/// Every tag that is opened is closed, in order; nothing else has angle brackets.
fn check_tags(html: &str) {
    let mut open: Vec<&str> = Vec::new();
    let body = html.strip_prefix("<!DOCTYPE html>").expect("a document");
    for piece in body.split('<').skip(1) {
        let (tag, text) = piece.split_once('>').unwrap_or_else(|| panic!("a tag without an end: {piece}"));
        // In style sheets it says what is a child.
        assert!(tag == "style" || !text.contains('>'), "a bare bracket after <{tag}>");
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes in <{tag}>");
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "closed by </{name}>");
        } else if !tag.ends_with('/') && !["meta", "br"].contains(&tag.split_whitespace().next().expect("a name")) {
            open.push(tag.split_whitespace().next().expect("a name"));
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    for entity in body.split('&').skip(1) {
        let name = entity.split_once(';').map_or("", |(name, _)| name);
        assert!(name.len() < 8 && name.chars().all(|c| c == '#' || c.is_ascii_alphanumeric()), "&{entity}");
    }
}

/// What a page says, without its tags.
fn told(html: &str) -> String {
    html.split('<').map(|piece| piece.split_once('>').map_or(piece, |(_, text)| text)).collect()
}

fn check_numbers(html: &str) {
    for word in html.split(|c: char| !c.is_alphanumeric()) {
        assert!(!["NaN", "nan", "inf", "Infinity"].contains(&word), "{word}");
    }
}

fn all() -> Vec<Report> {
    let verdicts = [Verdict::Effect, Verdict::None, Verdict::Unknown];
    let mut all: Vec<Report> = verdicts.iter().flat_map(|verdict| [report(*verdict), empty(*verdict)]).collect();
    all.push(degenerate());
    all
}

#[test]
fn every_report_has_all_sections_in_order() {
    for report in all() {
        let html = page("set-003", &report);
        let places: Vec<usize> = ["what", "where", "gap", "rivals", "nominal", "remains", "reading"]
            .iter()
            .map(|id| html.find(&format!("<section id=\"{id}\">")).unwrap_or_else(|| panic!("section {id}")))
            .collect();
        assert!(places.is_sorted());
        assert!(html.contains("<h1>A sentence.</h1>"));
    }
}

#[test]
fn pages_are_well_formed_whatever_the_numbers() {
    for report in all() {
        let html = page("set-003", &report);
        check_tags(&html);
        check_numbers(&html);
        assert!(!html.contains("class=\"undefined\""), "a word that the glossary lacks");
    }
}

#[test]
fn the_glossary_says_the_numbers_of_the_settings() {
    let settings = crate::Settings::default();
    let set = page::word("confusion set").unwrap();
    assert!(set.means.contains(&format!("1 to {:.0} ", settings.confusion)));
}

#[test]
fn nothing_from_outside_is_markup() {
    let mut report = report(Verdict::Unknown);
    let evil = "<script>alert(\"1\")</script>&'";
    report.summary = evil.into();
    report.next_experiment = evil.into();
    report.description = Some(evil.into());
    report.retuned[0].key = evil.into();
    let html = page(evil, &report);
    assert!(!html.contains("<script"));
    assert!(html.contains("&lt;script&gt;alert(&quot;1&quot;)&lt;/script&gt;&amp;'"));
    check_tags(&html);
}

#[test]
fn pages_need_nothing_from_elsewhere() {
    let html = page("set-003", &report(Verdict::Effect));
    for word in ["http", "src=", "url(", "@import", "<script", "<link"] {
        assert!(!html.contains(word), "{word}");
    }
}

#[test]
fn significant_cells_are_marked_and_hot() {
    let html = page("set-003", &report(Verdict::Effect));
    assert!(html.contains("<td class=\"h6\">31\u{202f}*</td>"), "31 is one and a half decades above noise");
    assert!(html.contains("<td class=\"h0\">0.9</td>"));
    assert!(page("set-003", &empty(Verdict::Unknown)).contains("Nothing was compared."));
}

#[test]
fn an_unknown_gap_is_described_at_the_top() {
    let html = page("set-003", &report(Verdict::Unknown));
    let first = html.find("wrist_force during sliding").expect("a description");
    assert!(first < html.find("<section").expect("a section"));
}

#[test]
fn what_the_lacking_force_follows_is_told_with_its_values() {
    let mut report = report(Verdict::Unknown);
    let html = page("set-003", &report);
    assert!(html.contains("falling with the distance</th><td>87 %</td><td>strength 0.000853 N m²</td>"), "{html}");
    report.lacking_force.as_mut().unwrap().terms.clear();
    assert!(page("set-003", &report).contains("It follows no term that was tried"));
    report.lacking_force = None;
    assert!(!page("set-003", &report).contains("The force that is lacking"));
}

#[test]
fn errors_are_told_in_millimetres() {
    let html = page("set-003", &report(Verdict::Effect));
    assert!(
        html.contains(
            "<th scope=\"row\">object position</th><td>mm</td><td>12.3</td><td>1.10</td><td>4.20</td><td>0.900</td>"
        ),
        "{html}"
    );
    assert!(!page("set-003", &report(Verdict::None)).contains("<td>1.10</td>"));
}

#[test]
fn the_page_says_what_it_takes_to_have_it_again() {
    let parted = Report { fold: Some([2, 5]), ..report(Verdict::Effect) };
    assert!(told(&page("set-003", &parted)).contains("Seed 1, part 2 of 5 held out;"));
    assert!(told(&page("set-003", &report(Verdict::Effect))).contains("Seed 1; 3600 simulated episodes"));
}

#[test]
fn the_page_of_one_held_out_episode_shows_it() {
    let mut report = report(Verdict::Effect);
    report.heldout.episodes = vec![(42, 1.0, 1.0)];
    let html = page("set-003", &report);
    assert!(html.contains("episode 42"));
    check_numbers(&html);
}

#[test]
fn a_pyramid_of_friction_is_told_where_it_is_sure() {
    let said = |value: f64, interval90: [f64; 2]| {
        let mut report = report(Verdict::None);
        report.retuned[0] = Retuned { key: "contact.cone_exponent".into(), prior: [1.0, 1.0], value, interval90 };
        report.retuned_sentences().concat()
    };
    assert!(said(8.0, [4.0, 15.0]).contains("it is less between these axes (exponent 8.00"));
    assert!(said(0.1, [0.05, 0.3]).contains("it is more between these axes"));
    // Near Coulomb's cone, or as likely that.
    assert!(said(1.5, [1.2, 1.9]).is_empty() && said(4.0, [0.8, 20.0]).is_empty());
}
