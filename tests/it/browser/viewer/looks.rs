//! How the viewer looks: at first, by kinds of display, and whatever names say.

use super::{Page, SIZE, WINDOW, assert_colours, exact, ramp};
use serde_json::json;
use skylit::report::viewer::{ErrorMap, Region, Viewed, Viewer};

#[test]
fn three_pictures_stand_side_by_side_at_first() {
    let (a, b) = (ramp("a", 0.0), ramp("b", 0.5));
    let Some(mut page) = Page::of(exact(vec![a, b])) else { return };
    assert_eq!(page.told("document.querySelectorAll('[data-mode][aria-pressed=true]').length"), 1);
    // No pixel of the canvas is stretched.
    let sharp = "(() => { const c = document.querySelector('canvas[data-stage]'), b = c.getBoundingClientRect();
        return [Math.abs(c.width - b.width * devicePixelRatio) < 1, Math.abs(c.height - b.height * devicePixelRatio) < 1]; })()";
    assert_eq!(page.told(sharp), json!([true, true]));
    let [x, y, w, h] = page.tab.place("canvas[data-stage]");
    let shot = page.tab.shot();
    let column = |i: f64| shot.at([x + w * (i + 0.5) / 3.0, y + h / 2.0]);
    let [reference, test, error] = [0.0, 1.0, 2.0].map(column);
    assert!(test.iter().zip(reference).all(|(t, r)| *t > r), "{reference:?}, {test:?}");
    // Everywhere brighter by as much: all of the end of the scale, which is red.
    assert!(error[0] > 150 && error[2] < 80, "{error:?}");
    page.tab.assert_clean();
}

#[test]
fn a_place_that_would_be_empty_shows_another_map() {
    // Twice as wide as high, which is largest in two rows of two.
    let size = [64, 32];
    let flat =
        |name: &str, v: f32| Viewed { name: name.into(), rgb: vec![[v; 3]; 64 * 32], facts: Vec::new() };
    let values = (0..64 * 32).map(|i| (i % 64) as f32 / 64.0).collect();
    let map = ErrorMap { metric: "HDR-FLIP".into(), help: String::new(), test: 1, values, high: Some(1.0) };
    let pictures = vec![flat("a", 0.25), flat("b", 0.5)];
    let Some(mut page) = Page::of(Viewer { size, pictures, maps: vec![map], ..Viewer::default() }) else {
        return;
    };
    let [x, y, w, h] = page.tab.place("canvas[data-stage]");
    for (at, wanted) in [([0.25, 0.75], "signed 0.25"), ([0.75, 0.75], "HDR-FLIP 0.50")] {
        page.tab.move_to([x + at[0] * w + 1.0, y + at[1] * h]);
        let told = page.readout();
        assert!(told[told.len() - 2].starts_with(wanted), "{wanted}: {told:?}");
    }
    // The legend is that of the chosen map, in its corner.
    let legend = page.told(
        "(() => { const l = document.querySelector('[data-legend]').getBoundingClientRect(), c = document.querySelector('canvas[data-stage]').getBoundingClientRect();
        return l.right < c.left + c.width / 2 && l.top > c.top + c.height / 2; })()",
    );
    assert_eq!(legend, json!(true));
    page.mode("map");
    page.tab.choose("[data-map]", "HDR-FLIP");
    page.mode("side");
    // Chosen, it stands in its own place, and the first of the others beside it.
    let names = page.told(
        "(() => { const v = document.querySelector('[data-viewer]').viewer; return v.panels().map((p) => v.name(p.shows).split(',')[0]); })()",
    );
    assert_eq!(names, json!(["a", "b", "HDR-FLIP", "signed"]));
    page.tab.assert_clean();
}

#[test]
fn the_histogram_has_a_line_for_each_picture() {
    let Some(mut page) = Page::of(exact(vec![ramp("a", 0.0), ramp("b", 0.5), ramp("c", 3.0)])) else {
        return;
    };
    let drawn = "(() => {
        const canvas = document.querySelector('canvas[data-histogram]'), style = getComputedStyle(document.documentElement);
        const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return [0, 1, 2].map((i) => {
          const hex = style.getPropertyValue(`--c${i}`).trim(), rgb = [1, 3, 5].map((k) => parseInt(hex.slice(k, k + 2), 16));
          let n = 0;
          for (let k = 0; k < data.length; k += 4) n += rgb.every((v, c) => Math.abs(data[k + c] - v) < 12) && data[k + 3] > 128;
          return n;
        });
      })()";
    let counts = page.told(drawn);
    let counts: Vec<u64> = counts.as_array().unwrap().iter().filter_map(|v| v.as_u64()).collect();
    assert!(counts.len() == 3 && counts.iter().all(|n| *n > 50), "{counts:?}");
    let names = page.told("[...document.querySelectorAll('[data-key] li')].map((l) => l.textContent)");
    assert_eq!(names, json!(["a", "b", "c"]));
    page.tab.assert_clean();
}

#[test]
fn a_phone_has_room_for_it() {
    let long = "a/very/long/folder/with/a/very/long/name-of-a-picture-that-someone-rendered.exr";
    let region = Region { label: format!("{long}: 5 x 4 pixels"), test: 1, rect: [2, 3, 5, 4] };
    let viewer = Viewer { regions: vec![region], ..exact(vec![ramp(long, 0.0), ramp("b", 0.5)]) };
    let Some(mut page) = Page::open(vec![viewer], [360, 740]) else { return };
    for mode in ["side", "wipe", "flip", "map"] {
        page.mode(mode);
        let wide = page.told("[document.scrollingElement.scrollWidth, innerWidth]");
        assert_eq!(wide, json!([360, 360]), "{mode}");
        let [x, _, w, h] = page.tab.place("canvas[data-stage]");
        assert!(x >= 0.0 && x + w <= 360.0 && w > 280.0 && h > 200.0, "{mode}: {x}, {w} x {h}");
    }
    let small = page.told(
        "[...document.querySelectorAll('.viewer button, .viewer select')].filter((b) => {
          const r = b.getBoundingClientRect();
          return r.width > 0 && (r.right > innerWidth || r.height < 20 || r.width < 20);
        }).map((b) => b.outerHTML)",
    );
    assert_eq!(small, json!([]), "what a finger cannot reach");
    page.tab.assert_clean();
}

#[test]
fn dark_rooms_change_the_page_and_no_picture() {
    let (a, b) = (ramp("a", 0.0), ramp("b", 0.25));
    let Some(mut page) = Page::of(exact(vec![a, b])) else { return };
    page.mode("flip");
    let pixels = page.pixels();
    let light = page.tab.shot();
    page.tab.emulate(true, WINDOW[0], WINDOW[1], false);
    let dark = page.tab.shot();
    assert!(light.at([3.0, 3.0])[0] > 200 && dark.at([3.0, 3.0])[0] < 60);
    let same = |x, y| Some(light.at(pixels.of(x, y)));
    assert_colours(&dark, &pixels, 0..SIZE[1], "dark", same, 0);
    page.tab.assert_clean();
}

#[test]
fn names_are_text() {
    let hostile = "</script><img src=x onerror=\"throw 1\"><!--<script>{{ title }}";
    let named =
        |v: Viewed| Viewed { name: hostile.into(), facts: vec![(hostile.into(), hostile.into())], ..v };
    let region = Region { label: hostile.into(), test: 1, rect: [0, 0, 1, 1] };
    let tests = vec![named(ramp("a", 0.0)), named(ramp("b", 0.5)), named(ramp("c", 0.5))];
    let Some(mut page) = Page::of(Viewer { regions: vec![region], ..exact(tests) }) else { return };
    assert_eq!(page.told("document.images.length"), 0);
    assert_eq!(page.tab.text("document.querySelector('[data-region]').textContent"), hostile);
    assert_eq!(page.tab.text("document.querySelector('[data-test] option').textContent"), hostile);
    assert_eq!(page.tab.text("document.querySelector('.viewer summary').textContent"), hostile);
    assert_eq!(page.readout()[0], hostile);
    page.tab.assert_clean();
}

#[test]
fn the_smallest_picture_and_the_longest() {
    for size in [[1, 1], [3000, 1], [1, 3000]] {
        let of = |name: &str, v: f32| Viewed {
            name: name.into(),
            rgb: vec![[v; 3]; size[0] * size[1]],
            facts: vec![],
        };
        let viewer = Viewer { size, pictures: vec![of("a", 0.0), of("b", 1.0)], ..Viewer::default() };
        let Some(mut page) = Page::of(viewer) else { return };
        for mode in ["side", "wipe", "flip", "map"] {
            page.mode(mode);
            for tool in ["in", "in", "fit", "one", "out", "fit"] {
                page.tab.click(&format!("[data-tool={tool}]"));
            }
        }
        page.mode("flip");
        let [x, y, w, h] = page.tab.place("canvas[data-stage]");
        page.tab.move_to([x + w / 2.0, y + h / 2.0]);
        assert_eq!(page.readout()[5..8], ["1", "1", "1"], "{size:?}");
        page.tab.assert_clean();
    }
}
