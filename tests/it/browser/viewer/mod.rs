//! The viewer of pictures: pages made by the library of small pictures with known values.

mod hands;
mod looks;
mod values;

use super::chromium::tab;
use super::tab::{Shot, Tab};
use serde_json::Value;
use skylit::report::viewer::{Viewed, Viewer};
use skylit::report::{Report, Section};

/// Of every picture here: so tall that it leaves room beside itself for what is written on the stage, and so small that
/// its pixels are large, but not so large that their values are written into them.
const SIZE: [usize; 2] = [20, 32];

/// Of the window.
const WINDOW: [u32; 2] = [1200, 1100];

/// The state of the first viewer of a page.
const STATE: &str = "document.querySelector('[data-viewer]').viewer.state";

/// A picture by a function of the pixel.
fn picture(name: &str, of: impl Fn(usize, usize) -> [f32; 3]) -> Viewed {
    let rgb = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (x, y))).map(|(x, y)| of(x, y)).collect();
    Viewed { name: name.into(), rgb, facts: vec![("samples".into(), "4".into())] }
}

/// A reference and tests, of values that the page is to keep to the last bit.
fn exact(pictures: Vec<Viewed>) -> Viewer {
    Viewer { size: SIZE, pictures, lossless: true, ..Viewer::default() }
}

/// Blue-green grows to the right and red downwards; `offset` is added to all.
fn ramp(name: &str, offset: f32) -> Viewed {
    picture(name, |x, y| [offset + y as f32 / 64.0, offset + x as f32 / 40.0, offset + x as f32 / 80.0])
}

/// A page with viewers in a tab, ready, and its folder.
struct Page {
    tab: Tab,
    _folder: tempfile::TempDir,
}

impl Page {
    /// None where no browser is installed.
    #[track_caller]
    fn open(viewers: Vec<Viewer>, [width, height]: [u32; 2]) -> Option<Page> {
        let mut tab = tab()?;
        let mut report = Report::new("Pictures");
        for viewer in viewers {
            report = report.section(Section::new("").with(viewer));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("page.html");
        std::fs::write(&path, report.to_html().unwrap()).unwrap();
        tab.emulate(false, width, height, width < 800);
        tab.open(&path);
        tab.wait_for(
            "[...document.querySelectorAll('[data-viewer]')].every((v) => v.dataset.ready === 'true')",
            20.0,
        );
        tab.settle();
        Some(Page { tab, _folder: folder })
    }

    /// As [`Page::open`], with one viewer in the usual window.
    #[track_caller]
    fn of(viewer: Viewer) -> Option<Page> {
        Page::open(vec![viewer], WINDOW)
    }

    #[track_caller]
    fn mode(&mut self, mode: &str) {
        self.tab.click(&format!("[data-mode={mode}]"));
        self.tab.settle();
        assert_eq!(self.tab.text("document.querySelector('[data-viewer]').dataset.shows"), mode);
    }

    /// Where one picture that fills the stage has its pixels, by its own reckoning: the middle of each.
    #[track_caller]
    fn pixels(&mut self) -> Pixels {
        let [x, y, w, h] = self.tab.place("canvas[data-stage]");
        let [width, height] = SIZE.map(|v| v as f64);
        Pixels { middle: [x + w / 2.0, y + h / 2.0], scale: (w / width).min(h / height), stage: [x, y, w, h] }
    }

    /// What is written below the stage: reference, test, difference; place; the map's value; the zoom.
    #[track_caller]
    fn readout(&mut self) -> Vec<String> {
        self.tab.settle();
        let all =
            self.tab.eval("[...document.querySelectorAll('[data-readout] span')].map((s) => s.textContent)");
        all.as_array().expect("a list").iter().map(|v| v.as_str().expect("text").to_owned()).collect()
    }

    /// A number of the state.
    #[track_caller]
    fn state(&mut self, name: &str) -> f64 {
        self.tab.number(&format!("{STATE}.{name}"))
    }

    #[track_caller]
    fn told(&mut self, js: &str) -> Value {
        self.tab.settle();
        self.tab.eval(js)
    }
}

/// See [`Page::pixels`].
struct Pixels {
    middle: [f64; 2],
    scale: f64,
    /// Left, top, width, height.
    stage: [f64; 4],
}

impl Pixels {
    fn of(&self, x: usize, y: usize) -> [f64; 2] {
        let place =
            |v: usize, i: usize| self.middle[i] + (v as f64 + 0.5 - SIZE[i] as f64 / 2.0) * self.scale;
        [place(x, 0), place(y, 1)]
    }
}

/// All pixels of the pictures, or some of them, must have these colours, to `off` of 255.
#[track_caller]
fn assert_colours(
    shot: &Shot,
    pixels: &Pixels,
    rows: std::ops::Range<usize>,
    what: &str,
    of: impl Fn(usize, usize) -> Option<[u8; 3]>,
    off: u8,
) {
    for y in rows {
        for x in 0..SIZE[0] {
            let Some(wanted) = of(x, y) else { continue };
            let seen = shot.at(pixels.of(x, y));
            let close = seen.iter().zip(wanted).all(|(a, b)| a.abs_diff(b) <= off);
            assert!(close, "{what}, pixel {x}, {y}: {seen:?}, not {wanted:?}");
        }
    }
}
