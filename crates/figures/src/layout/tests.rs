//! What every picture must keep, on figures of all kinds.

use super::*;
use crate::panel::Chart;
use crate::scene::Shape;

#[path = "../../examples/gallery/made_up.rs"]
mod made_up;

fn texts(scene: &Scene) -> Vec<&Text> {
    let mut texts = Vec::new();
    for shape in &scene.shapes {
        if let Shape::Text(text) = shape {
            texts.push(text);
        }
    }
    texts
}

#[test]
fn texts_stay_inside_and_apart() {
    // Labels of ticks that are nearly as long as their distance, too.
    let mut far = made_up::gaps();
    for panel in &mut far.panels {
        if let Chart::Lines(lines) = &mut panel.chart {
            lines.series.iter_mut().flat_map(|s| &mut s.points).for_each(|p| p.0 += 123_456.0);
            lines.series.iter_mut().for_each(|s| s.band.clear());
        }
    }
    for (name, figure) in made_up::all().into_iter().chain([("far", far)]) {
        let scene = lay_out(&figure).unwrap();
        let (width, height) = (f64::from(scene.width_px), f64::from(scene.height_px));
        let texts = texts(&scene);
        assert!(texts.len() > 10, "{name}");
        for (i, text) in texts.iter().enumerate() {
            let a = text.bounds();
            let inside = a.left >= 0.0 && a.top >= 0.0 && a.right <= width && a.bottom <= height;
            assert!(inside, "{name}: `{}` at {a:?} leaves {width} × {height}", text.text);
            for other in &texts[..i] {
                let b = other.bounds();
                let apart = a.right <= b.left || b.right <= a.left || a.bottom <= b.top || b.bottom <= a.top;
                assert!(apart, "{name}: `{}` at {a:?} touches `{}` at {b:?}", text.text, other.text);
            }
        }
    }
}

#[test]
fn plots_line_up_and_have_one_size() {
    let figure = made_up::ranks();
    let mut frames = frames(&figure);
    let grid = align(&figure, &mut frames).unwrap();
    let plots: Vec<Rect> = (0..45).map(|i| grid.place(i, 0.0).1).collect();
    for (i, plot) in plots.iter().enumerate() {
        assert_eq!(plot.left, plots[i % 5].left);
        assert_eq!(plot.bottom, plots[i - i % 5].bottom);
        assert!((plot.width() - plots[0].width()).abs() < 1e-9 && (plot.height() - plots[0].height()).abs() < 1e-9);
        // Labels of small multiples must not eat the data.
        assert!(plot.width() > 110.0 && plot.height() > 65.0, "{plot:?}");
    }
    let labels = |text: &str| texts(&lay_out(&figure).unwrap()).iter().filter(|t| t.text == text).count();
    assert_eq!((labels("count"), labels("rank")), (9, 5), "labels are written once a row and a column");
}

#[test]
fn the_legend_is_above_all_data_and_names_each_series_once() {
    let figure = made_up::success();
    let scene = lay_out(&figure).unwrap();
    let highest = scene.shapes.iter().position(|s| matches!(s, Shape::Text(t) if t.text == "1.0")).unwrap();
    let Shape::Text(top_tick) = &scene.shapes[highest] else { panic!("not a text") };
    let Chart::Dots(dots) = &figure.panels[0].chart else { panic!("success rates are dots") };
    for name in dots.series.iter().map(|s| &s.name) {
        let found: Vec<_> = texts(&scene).into_iter().filter(|t| t.text == *name).collect();
        assert_eq!(found.len(), 1, "{name}");
        assert!(found[0].bounds().bottom < top_tick.bounds().top, "{name}");
    }
}
