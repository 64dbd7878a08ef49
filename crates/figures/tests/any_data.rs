//! No data make drawing panic, hang or leave the page.

use figures::{
    Axis, Chart, Direction, Dots, Estimate, Estimates, Figure, Heat, Histogram, Lines, Mark, Panel, Reference, Scale,
    Series, Stroke,
};
use proptest::prelude::*;

/// Numbers of all sizes, and those that are none.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0,
        1 => proptest::num::f64::ANY,
        1 => prop::sample::select(vec![0.0, -0.0, 1.0, f64::NAN, f64::INFINITY, f64::MAX, f64::MIN, f64::MIN_POSITIVE, 1e299, 8e-309, 5e-324]),
    ]
}

fn numbers(most: usize) -> impl Strategy<Value = Vec<f64>> {
    prop::collection::vec(number(), 0..most)
}

fn axis() -> impl Strategy<Value = Axis> {
    let limits = prop_oneof![3 => Just(None), 1 => (number(), number()).prop_map(Some)];
    let scale = prop::sample::select(vec![Scale::Linear, Scale::Log]);
    (limits, scale).prop_map(|(limits, scale)| Axis { label: "quantity / unit".into(), limits, scale })
}

fn references() -> impl Strategy<Value = Vec<Reference>> {
    prop::collection::vec((number(), number()), 0..2)
        .prop_map(|r| r.into_iter().map(|(low, high)| Reference { name: "r".into(), low, high }).collect())
}

fn chart() -> impl Strategy<Value = Chart> {
    let stroke = prop::sample::select(vec![Stroke::Solid, Stroke::Dashed, Stroke::Marked, Stroke::Markers]);
    let mark = prop::sample::select(vec![Mark::Dot, Mark::Open, Mark::Bar]);
    let direction = prop::sample::select(vec![Direction::Right, Direction::Up]);
    let lines = (axis(), axis(), numbers(24), stroke, references()).prop_map(|(x, y, n, stroke, references)| {
        let points = n.chunks_exact(2).map(|p| (p[0], p[1])).collect();
        let mut band: Vec<_> = n.chunks_exact(3).map(|p| (p[0], p[1], p[2])).collect();
        band.sort_by(|a, b| a.0.total_cmp(&b.0));
        Chart::Lines(Lines {
            x,
            y,
            series: vec![Series { name: "s".into(), points, band, stroke, ..Series::default() }],
            references,
        })
    });
    let histogram =
        (axis(), numbers(12), (number(), number()), references()).prop_map(|(y, counts, edges, mut expected)| {
            Chart::Histogram(Histogram {
                x: Axis::new("x"),
                y,
                name: "n".into(),
                counts,
                edges,
                expected: expected.pop(),
            })
        });
    let dots = (axis(), prop::collection::vec((number(), number(), number()), 1..6), mark, direction, references())
        .prop_map(|(value, values, mark, direction, references)| {
            let values: Vec<_> = values.into_iter().map(|(v, l, h)| Estimate::within(v, l, h)).collect();
            let categories = (0..values.len()).map(|i| format!("category {i}")).collect();
            let series = vec![Estimates { name: "s".into(), values, mark, ..Estimates::default() }];
            Chart::Dots(Dots { categories, value, series, direction, references, ..Dots::default() })
        });
    let heat = (1..4_usize, 1..4_usize, prop::collection::vec(number(), 9), prop::option::of(0..5_usize)).prop_map(
        |(r, c, n, digits)| {
            Chart::Heat(Heat {
                rows: vec!["row".into(); r],
                columns: vec!["column".into(); c],
                values: (0..r).map(|i| n[i * c % 3..][..c].to_vec()).collect(),
                digits,
                ..Heat::default()
            })
        },
    );
    prop_oneof![lines, histogram, dots, heat]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_data_give_a_picture_or_a_typed_error(chart in chart()) {
        let figure = Figure { panels: vec![Panel { title: "any".into(), chart }], columns: 1, panel_size_px: (160, 140), ..Figure::default() };
        let Ok(svg) = figure.svg() else { return Ok(()) };
        prop_assert!(!svg.contains("NaN") && !svg.contains("inf"));
        // Within the page, which has four units a pixel: text may overhang by its own width, shapes by a line's.
        for list in svg.split("points=\"").skip(1) {
            for pair in list.split('"').next().unwrap_or("").split_whitespace() {
                let (x, y) = pair.split_once(',').unwrap();
                let (x, y): (i32, i32) = (x.parse().unwrap(), y.parse().unwrap());
                prop_assert!((-8..=648).contains(&x) && (-8..=1000).contains(&y), "{x},{y}");
            }
        }
        prop_assert!(figure.png().is_ok());
    }
}
