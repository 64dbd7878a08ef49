//! Figures with made-up numbers, of the kinds and sizes that reports need. Tests draw them too.

use figures::{
    Axis, Chart, Direction, Dots, Estimate, Estimates, Figure, Heat, Histogram, Lines, Mark, Panel, Reference, Scale,
    Series, Stroke,
};

/// All with their file names.
pub(crate) fn all() -> Vec<(&'static str, Figure)> {
    vec![
        ("learning", learning()),
        ("ranks", ranks()),
        ("likelihood", likelihood()),
        ("coverage", coverage()),
        ("confusion", confusion()),
        ("success", success()),
        ("table", table()),
        ("gaps", gaps()),
    ]
}

/// A number in [0, 1) that looks random.
fn noise(seed: u32) -> f64 {
    let mixed = seed.wrapping_mul(2_654_435_761) ^ (seed.wrapping_mul(40_503) >> 3);
    f64::from(mixed.wrapping_mul(2_246_822_519) >> 8) / f64::from(1 << 24)
}

fn panel(title: &str, chart: Chart) -> Panel {
    Panel { title: title.into(), chart }
}

/// Two panels with a logarithmic axis, bands, a reference and dashes.
pub(crate) fn learning() -> Figure {
    let curve = |name: &str, rate: f64, floor: f64, stroke| {
        let at = |e: u32| floor + 30.0 * (-f64::from(e) * rate).exp() + 0.1 * floor * noise(e + (rate * 1e4) as u32);
        let points: Vec<(f64, f64)> = (0..=200).map(|e| (f64::from(e), at(e))).collect();
        let band = points.iter().map(|&(x, y)| (x, 0.8 * y, 1.25 * y)).collect();
        Series { name: name.into(), points, band, stroke, ..Series::default() }
    };
    let y = Axis { scale: Scale::Log, ..Axis::new("negative log-likelihood / nat") };
    let chance = Reference { name: "marginal density".into(), low: 9.0, high: 9.0 };
    let lines = |fast, slow| {
        Chart::Lines(Lines {
            x: Axis::new("epoch"),
            y: y.clone(),
            series: vec![curve("training", fast, 0.4, Stroke::Solid), curve("validation", slow, 1.1, Stroke::Dashed)],
            references: vec![chance.clone()],
        })
    };
    Figure {
        title: "Learning curves of the prior".into(),
        panels: vec![panel("jaco", lines(0.05, 0.045)), panel("sawyer", lines(0.03, 0.02))],
        columns: 2,
        panel_size_px: (450, 300),
        ..Figure::default()
    }
}

/// Forty-five small multiples: nine quantities at five steps.
pub(crate) fn ranks() -> Figure {
    let quantities = [
        "mass",
        "friction",
        "centre x",
        "centre y",
        "half extent x",
        "half extent y",
        "obstacle x",
        "obstacle y",
        "damping",
    ];
    let mut panels = Vec::new();
    for (q, quantity) in quantities.iter().enumerate() {
        for step in 0..5 {
            let skew = if q == 3 { 14.0 } else { 0.0 };
            let count = |bin: u32| {
                (40.0 + 22.0 * (noise(bin + 97 * q as u32 + 1009 * step) - 0.5) + skew * (f64::from(bin) / 10.0 - 1.0))
                    .round()
            };
            let histogram = Histogram {
                x: Axis::new("rank"),
                y: Axis { limits: Some((0.0, 70.0)), ..Axis::new("count") },
                name: "ranks".into(),
                counts: (0..20).map(count).collect(),
                edges: (0.0, 100.0),
                expected: Some(Reference { name: "99 % if calibrated".into(), low: 25.0, high: 57.0 }),
            };
            panels.push(panel(&format!("{quantity}, step {step}"), Chart::Histogram(histogram)));
        }
    }
    Figure {
        title: "Ranks of the truth among 100 draws, 800 episodes".into(),
        panels,
        columns: 5,
        panel_size_px: (180, 130),
        ..Figure::default()
    }
}

/// One line a model over few steps.
pub(crate) fn likelihood() -> Figure {
    let models = ["LSTM, 8 components", "LSTM, 1 component", "linear", "marginal density", "oracle"];
    let series = models.iter().enumerate().map(|(i, model)| {
        let points = (0..=5)
            .map(|s| (f64::from(s), 6.0 - 1.2 * i as f64 * (1.0 - (-0.7 * f64::from(s)).exp()) + noise(s + i as u32)))
            .collect();
        Series { name: (*model).into(), points, stroke: Stroke::Marked, ..Series::default() }
    });
    let lines = Lines {
        x: Axis::new("steps observed"),
        y: Axis::new("−ln q(θ | history) / nat"),
        series: series.collect(),
        references: vec![],
    };
    Figure {
        title: String::new(),
        panels: vec![panel("Held-out episodes", Chart::Lines(lines))],
        columns: 1,
        panel_size_px: (900, 360),
        ..Figure::default()
    }
}

/// Rows with long names and a target band.
pub(crate) fn coverage() -> Figure {
    let categories = [
        "mass of the pushed object",
        "friction between object and table",
        "centre of mass along the object's long axis",
        "obstacle",
        "unmodelled_effect_with_one_very_long_name",
    ];
    let series = |name: &str, seed: u32| Estimates {
        name: name.into(),
        values: (0..5)
            .map(|c| {
                let v = 0.82 + 0.15 * noise(c * 7 + seed);
                Estimate::within(v, v - 0.03, v + 0.025)
            })
            .collect(),
        ..Estimates::default()
    };
    let dots = |shift: u32| {
        Chart::Dots(Dots {
            categories: categories.map(String::from).to_vec(),
            value: Axis { limits: Some((0.7, 1.0)), ..Axis::new("coverage of 90 % intervals") },
            series: vec![series("step 0", 1 + shift), series("step 1", 2 + shift), series("step 5", 3 + shift)],
            references: vec![Reference { name: "target 88–92 %".into(), low: 0.88, high: 0.92 }],
            ..Dots::default()
        })
    };
    Figure {
        title: "Coverage".into(),
        panels: vec![panel("jaco", dots(0)), panel("sawyer", dots(50))],
        columns: 2,
        panel_size_px: (450, 340),
        ..Figure::default()
    }
}

/// With numbers, and too many cells for numbers.
pub(crate) fn confusion() -> Figure {
    let shapes = ["box", "cylinder", "L-shaped", "no obstacle"].map(String::from).to_vec();
    let row = |r: usize| {
        let mut v: Vec<f64> = (0..4).map(|c| 0.12 * noise((r * 4 + c) as u32)).collect();
        v[r] = 0.0;
        v[r] = 1.0 - v.iter().sum::<f64>();
        v
    };
    let small = Heat {
        rows: shapes.clone(),
        columns: shapes,
        row_label: "true shape".into(),
        column_label: "inferred shape".into(),
        values: (0..4).map(row).collect(),
        limits: Some((0.0, 1.0)),
        digits: Some(2),
        value_label: "share".into(),
    };
    let names: Vec<String> = (0..24).map(|i| format!("joint {i}")).collect();
    let large = Heat {
        rows: names.clone(),
        columns: names,
        row_label: String::new(),
        column_label: String::new(),
        values: (0..24_u32)
            .map(|r| {
                (0..24_u32)
                    .map(|c| {
                        if r == 3 && c == 5 {
                            f64::NAN
                        } else {
                            (f64::from(r) - f64::from(c)).abs() * -0.3 + 4.0 * noise(r * 31 + c)
                        }
                    })
                    .collect()
            })
            .collect(),
        limits: None,
        digits: Some(1),
        value_label: "correlation / %".into(),
    };
    Figure {
        title: "Which shape".into(),
        panels: vec![panel("Obstacle after 5 steps", Chart::Heat(small)), panel("Residuals", Chart::Heat(large))],
        columns: 2,
        panel_size_px: (450, 380),
        ..Figure::default()
    }
}

fn success_series() -> Vec<Estimates> {
    let methods = ["POMCP with learned prior", "POMCP with uniform prior", "open loop"];
    let mut series = Vec::new();
    for (m, method) in methods.iter().enumerate() {
        let rate =
            |d: u32| (0.95 - 0.2 * m as f64 - 0.08 * f64::from(d) + 0.1 * noise(d + 13 * m as u32)).clamp(0.0, 1.0);
        let values =
            (0..5).map(|d| Estimate::within(rate(d), (rate(d) - 0.09).max(0.0), (rate(d) + 0.07).min(1.0))).collect();
        series.push(Estimates { name: (*method).into(), values, mark: Mark::Bar, ..Estimates::default() });
        let published =
            (0..5).map(|d| if d == 4 { Estimate::missing() } else { Estimate::exact(rate(d) + 0.05) }).collect();
        series.push(Estimates {
            name: format!("{method}, published"),
            values: published,
            mark: Mark::Open,
            like: (*method).into(),
        });
    }
    series
}

fn domains() -> Vec<String> {
    ["D1 known", "D2 unknown mass", "D3 unknown friction and mass", "D4 obstacle", "D5 all"].map(String::from).to_vec()
}

/// Bars by domain and method beside published values.
pub(crate) fn success() -> Figure {
    let dots = Dots {
        categories: domains(),
        value: Axis { limits: Some((0.0, 1.0)), ..Axis::new("success rate") },
        series: success_series(),
        direction: Direction::Up,
        ..Dots::default()
    };
    Figure {
        title: "Success by domain, 95 % Wilson intervals".into(),
        panels: vec![panel("", Chart::Dots(dots))],
        columns: 1,
        panel_size_px: (900, 380),
        ..Figure::default()
    }
}

/// The same as dots, with turned names.
pub(crate) fn table() -> Figure {
    let series = || {
        success_series()
            .into_iter()
            .map(|s| Estimates { mark: if s.like.is_empty() { Mark::Dot } else { s.mark }, ..s })
    };
    let dots = |count: usize| {
        Chart::Dots(Dots {
            categories: domains(),
            category_label: "domain".into(),
            value: Axis::new("success rate"),
            series: series().take(count).collect(),
            direction: Direction::Up,
            references: vec![Reference { name: "chance".into(), low: 0.2, high: 0.2 }],
        })
    };
    Figure {
        title: String::new(),
        panels: vec![
            panel("jaco", dots(6)),
            panel("sawyer", dots(2)),
            panel("both arms, simulated sensors and a long title that wraps", dots(4)),
        ],
        columns: 3,
        panel_size_px: (300, 330),
        ..Figure::default()
    }
}

/// Numbers that are not finite, empty series, single values, values outside limits.
pub(crate) fn gaps() -> Figure {
    let lines = |points: Vec<(f64, f64)>| Lines {
        x: Axis::new("time / s"),
        y: Axis::new("force / N"),
        series: vec![Series {
            name: "measured".into(),
            band: points.iter().map(|&(x, y)| (x, y - 1.0, y + 1.0)).collect(),
            points,
            ..Series::default()
        }],
        references: vec![],
    };
    let mut wave: Vec<(f64, f64)> = (0..40).map(|i| (f64::from(i) / 10.0, (f64::from(i) / 4.0).sin() * 5.0)).collect();
    for i in [9, 10, 12, 30] {
        wave[i].1 = f64::NAN;
    }
    let cut = Lines { y: Axis { limits: Some((-2.0, 3.0)), ..Axis::new("force / N") }, ..lines(wave.clone()) };
    let empty = Heat {
        rows: vec!["a".into()],
        columns: vec!["b".into()],
        values: vec![vec![f64::NAN]],
        digits: Some(1),
        ..Heat::default()
    };
    Figure {
        title: "Gaps".into(),
        panels: vec![
            panel("gaps and a lonely point", Chart::Lines(lines(wave))),
            panel("cut by limits", Chart::Lines(cut)),
            panel("empty", Chart::Lines(lines(vec![]))),
            panel("one value", Chart::Lines(lines(vec![(2.0e7, 1e-7)]))),
            panel("infinite", Chart::Lines(lines(vec![(0.0, f64::INFINITY), (1.0, 1e305)]))),
            panel("no cell", Chart::Heat(empty)),
        ],
        columns: 3,
        panel_size_px: (300, 220),
        ..Figure::default()
    }
}
