//! What people do to the viewer: keys, the wheel, fingers, clicks.

use super::{Page, SIZE, STATE, WINDOW, exact, ramp};
use serde_json::{Value, json};
use skylit::report::viewer::{Region, Viewed, Viewer};

fn pictures() -> Vec<Viewed> {
    vec![ramp("a", 0.0), ramp("b", 0.25), ramp("c", 0.5)]
}

#[test]
fn every_key_does_what_the_help_says() {
    let Some(mut page) = Page::of(exact(pictures())) else { return };
    let steps: [(&str, &str, Value); 22] = [
        ("w", "mode", json!("wipe")),
        ("f", "mode", json!("flip")),
        ("f", "front", json!(0)),
        (" ", "front", json!(1)),
        ("d", "mode", json!("map")),
        ("m", "map", json!(1)),
        ("M", "map", json!(0)),
        ("s", "mode", json!("side")),
        ("2", "test", json!(2)),
        ("1", "test", json!(1)),
        ("9", "test", json!(2)),
        ("e", "exposure", json!(0.5)),
        ("E", "exposure", json!(0)),
        ("E", "exposure", json!(-0.5)),
        ("t", "tonemap", json!("reinhard")),
        ("t", "tonemap", json!("aces-fit")),
        ("t", "tonemap", json!("agx")),
        ("r", "tonemap", json!("none")),
        ("z", "scale", json!(1)),
        ("+", "scale", json!(2)),
        ("-", "scale", json!(1)),
        ("e", "exposure", json!(0.5)),
    ];
    for (key, name, value) in steps {
        page.tab.key(key);
        assert_eq!(page.told(&format!("{STATE}.{name}")), value, "{key}");
    }
    // The toolbar follows.
    let toolbar = "['exposure', 'tonemap', 'test'].map((n) => document.querySelector(`[data-${n}]`).value)";
    assert_eq!(page.told(toolbar), json!(["0.5", "none", "2"]));
    page.tab.key("?");
    assert_eq!(page.told("document.querySelector('[data-help]').open"), true);
    page.tab.key("w");
    assert_eq!(page.told(&format!("{STATE}.mode")), "side", "what is behind the help does not listen");
    page.tab.key("Escape");
    assert_eq!(page.told("document.querySelector('[data-help]').open"), false);
    page.tab.assert_clean();
}

#[test]
fn a_flip_shows_one_in_the_others_place() {
    let Some(mut page) = Page::of(exact(pictures())) else { return };
    page.mode("flip");
    let at = page.pixels().of(10, 16);
    let test = page.tab.shot().at(at);
    page.tab.key("f");
    let reference = page.tab.shot().at(at);
    assert!(test.iter().zip(reference).all(|(t, r)| *t > r + 20), "{test:?}, {reference:?}");
    page.tab.click("[data-front]");
    assert_eq!(page.tab.shot().at(at), test);
    page.tab.key_down("x");
    assert_eq!(page.tab.shot().at(at), reference, "while the key is held");
    page.tab.key_up("x");
    assert_eq!(page.tab.shot().at(at), test, "and no longer");
    page.tab.assert_clean();
}

#[test]
fn the_wheel_magnifies_what_the_pointer_is_at() {
    let Some(mut page) = Page::of(exact(pictures())) else { return };
    page.mode("flip");
    let pixels = page.pixels();
    page.tab.move_to(pixels.of(13, 21));
    let before = page.readout();
    let colour = page.tab.shot().at(pixels.of(13, 21));
    let mut scale = page.state("scale");
    for delta in [-300.0, -500.0, 400.0] {
        page.tab.wheel(delta);
        page.tab.wait_for(&format!("{STATE}.scale !== {scale}"), 10.0);
        let told = page.readout();
        assert_eq!(told[..13], before[..13], "after {delta}");
        let next = page.state("scale");
        assert_eq!(next > scale, delta < 0.0, "{scale}, {next}");
        scale = next;
    }
    let near = pixels.of(13, 21);
    assert_eq!(
        page.tab.shot().at([near[0] - scale * 0.42, near[1] - scale * 0.42]),
        colour,
        "below its numbers"
    );
    assert_eq!(page.told("window.scrollY"), 0, "the page stays");
    page.tab.click("[data-tool=fit]");
    page.tab.settle();
    assert!((page.state("scale") - pixels.scale).abs() < 1e-9);
    page.tab.assert_clean();
}

#[test]
fn a_drag_moves_the_picture_with_the_pointer() {
    let Some(mut page) = Page::of(exact(pictures())) else { return };
    page.mode("flip");
    let pixels = page.pixels();
    page.tab.move_to(pixels.of(10, 10));
    let before = page.readout();
    page.tab.press();
    page.tab.move_to([pixels.of(10, 10)[0] + 60.0, pixels.of(10, 10)[1] + 45.0]);
    page.tab.release();
    assert_eq!(page.readout()[..13], before[..13]);
    assert!((page.state("cx") - (SIZE[0] as f64 / 2.0 - 60.0 / pixels.scale)).abs() < 1e-6);
    page.tab.move_to(pixels.of(10, 10));
    assert_ne!(page.readout()[12], before[12], "no longer held");
    page.tab.assert_clean();
}

#[test]
fn a_worst_region_is_flown_to() {
    let region = |label: &str, test, rect| Region { label: label.into(), test, rect };
    let regions = vec![region("low", 2, [3, 24, 5, 4]), region("corner", 1, [18, 0, 2, 2])];
    let Some(mut page) = Page::of(Viewer { regions: regions.clone(), ..exact(pictures()) }) else { return };
    page.mode("flip");
    let fitted = page.state("scale");
    for (i, r) in regions.iter().enumerate() {
        let [x, y, w, h] = r.rect.map(|v| v as f64);
        page.tab.click(&format!("[data-region=\"{i}\"]"));
        let there = format!("Math.hypot({STATE}.cx - {}, {STATE}.cy - {}) < 1e-6", x + w / 2.0, y + h / 2.0);
        page.tab.wait_for(&there, 10.0);
        assert_eq!(page.state("test"), r.test as f64);
        assert!(page.state("scale") > fitted);
        // What the pointer reads in the middle of the stage is of the region.
        let [left, top, wide, high] = page.tab.place("canvas[data-stage]");
        page.tab.move_to([left + wide / 2.0 + 1.0, top + high / 2.0 + 1.0]);
        let told = page.readout();
        let at: Vec<f64> =
            told[12].trim_start_matches("pixel ").split(", ").map(|v| v.parse().unwrap()).collect();
        assert!((x..x + w).contains(&at[0]) && (y..y + h).contains(&at[1]), "{at:?}");
        assert_eq!(told[4], ["", "b", "c"][r.test]);
    }
    page.tab.assert_clean();
}

#[test]
fn any_of_several_tests_is_chosen() {
    let Some(mut page) = Page::of(exact(pictures())) else { return };
    page.mode("flip");
    let pixels = page.pixels();
    page.tab.move_to(pixels.of(4, 4));
    let mut seen = Vec::new();
    for (name, wanted) in [("b", 0.35), ("c", 0.6)] {
        page.tab.choose("[data-test]", name);
        let told = page.readout();
        assert_eq!(told[4], name);
        let green: f64 = told[6].parse().unwrap();
        assert!((green - wanted).abs() < 1e-4, "{told:?}");
        seen.push(page.tab.shot().at(pixels.of(4, 4)));
    }
    assert_ne!(seen[0], seen[1]);
    page.tab.assert_clean();
}

#[test]
fn fingers_move_and_magnify() {
    let Some(mut page) = Page::open(vec![exact(pictures())], [390, 800]) else { return };
    page.mode("flip");
    page.tab.click("[data-tool=in]");
    page.tab.settle();
    let [x, y, w, h] = page.tab.place("canvas[data-stage]");
    let middle = [x + w / 2.0, y + h / 2.0];
    let ([cx, cy], scale) = ([page.state("cx"), page.state("cy")], page.state("scale"));
    let off = |dx: f64, dy: f64| [middle[0] + dx, middle[1] + dy];
    let scrolled = page.tab.number("window.scrollY");
    page.tab.touch("touchStart", &[middle]);
    page.tab.touch("touchMove", &[off(-20.0, -10.0)]);
    page.tab.touch("touchMove", &[off(-36.0, -28.0)]);
    page.tab.touch("touchEnd", &[]);
    page.tab.settle();
    let moved = [page.state("cx") - cx, page.state("cy") - cy];
    assert!((moved[0] - 36.0 / scale).abs() < 0.05 && (moved[1] - 28.0 / scale).abs() < 0.05, "{moved:?}");
    page.tab.touch("touchStart", &[off(-40.0, 0.0), off(40.0, 0.0)]);
    page.tab.touch("touchMove", &[off(-60.0, 0.0), off(60.0, 0.0)]);
    page.tab.touch("touchMove", &[off(-80.0, 0.0), off(80.0, 0.0)]);
    page.tab.touch("touchEnd", &[]);
    page.tab.settle();
    let factor = page.state("scale") / scale;
    assert!((factor - 2.0).abs() < 0.05, "fingers twice as far apart: {factor}");
    assert_eq!(page.tab.number("window.scrollY"), scrolled, "the page stays");
    page.tab.assert_clean();
}

#[test]
fn keys_go_to_the_viewer_that_was_touched() {
    let Some(mut page) = Page::open(vec![exact(pictures()), exact(pictures())], WINDOW) else { return };
    let modes = "[...document.querySelectorAll('[data-viewer]')].map((v) => v.viewer.state.mode)";
    page.tab.key("w");
    assert_eq!(page.told(modes), json!(["wipe", "side"]));
    page.tab.click("section:nth-of-type(2) canvas[data-stage]");
    page.tab.key("f");
    assert_eq!(page.told(modes), json!(["wipe", "flip"]));
    page.tab.assert_clean();
}
