//! A tab with a page, and what people do with it.

use super::chromium::Connection;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};
use std::path::Path;
use std::time::{Duration, Instant};

pub struct Tab {
    connection: Connection,
    target: String,
    /// Where the mouse is, in CSS pixels of the window.
    at: [f64; 2],
    /// Whether its button is held.
    held: bool,
}

/// What a window shows, in pixels of the screen.
pub struct Shot {
    pub size: [usize; 2],
    rgb: Vec<[u8; 3]>,
}

impl Shot {
    /// The colour at a place of the window, in pixels.
    #[track_caller]
    pub fn at(&self, [x, y]: [f64; 2]) -> [u8; 3] {
        let (x, y) = (x.floor(), y.floor());
        let [w, h] = self.size.map(|v| v as f64);
        assert!((0.0..w).contains(&x) && (0.0..h).contains(&y), "{x}, {y} is outside of {w} x {h}");
        self.rgb[y as usize * self.size[0] + x as usize]
    }
}

impl Tab {
    pub(super) fn new(mut connection: Connection) -> Tab {
        // In a window of its own, so that it is never behind another.
        let made = connection.ask("Target.createTarget", json!({ "url": "about:blank", "newWindow": true }));
        let target = made["targetId"].as_str().expect("a tab").to_owned();
        let attached =
            connection.ask("Target.attachToTarget", json!({ "targetId": target, "flatten": true }));
        connection.attach(attached["sessionId"].as_str().expect("a session"));
        let mut tab = Tab { connection, target, at: [0.0; 2], held: false };
        for domain in ["Page", "Runtime", "Log", "Network"] {
            tab.ask(&format!("{domain}.enable"), json!({}));
        }
        tab.ask("Emulation.setFocusEmulationEnabled", json!({ "enabled": true }));
        tab.emulate(false, 1200, 900, false);
        tab
    }

    #[track_caller]
    pub fn ask(&mut self, method: &str, params: Value) -> Value {
        self.connection.ask(method, params)
    }

    /// Opens a file and waits until all of it is there.
    #[track_caller]
    pub fn open(&mut self, path: &Path) {
        let since = self.connection.events.len();
        let said = self.ask("Page.navigate", json!({ "url": format!("file://{}", path.display()) }));
        assert!(said["errorText"].is_null(), "{}: {said}", path.display());
        self.connection.wait("Page.loadEventFired", since);
    }

    /// The look that the system asks for, and the size of the window in CSS pixels, each of which is one of the screen.
    #[track_caller]
    pub fn emulate(&mut self, dark: bool, width: u32, height: u32, mobile: bool) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": mobile });
        self.ask("Emulation.setDeviceMetricsOverride", size);
        let touch = json!({ "enabled": mobile, "maxTouchPoints": if mobile { 2 } else { 1 } });
        self.ask("Emulation.setTouchEmulationEnabled", touch);
        let scheme = if dark { "dark" } else { "light" };
        let still = json!({ "name": "prefers-reduced-motion", "value": "no-preference" });
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }, still]);
        self.ask("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// The value of an expression; promises are awaited.
    #[track_caller]
    pub fn eval(&mut self, js: &str) -> Value {
        let params =
            json!({ "expression": js, "returnByValue": true, "awaitPromise": true, "timeout": 30_000 });
        let mut said = self.ask("Runtime.evaluate", params);
        let thrown = &said["exceptionDetails"];
        assert!(thrown.is_null(), "{js}\n{}", thrown["exception"]["description"]);
        said["result"]["value"].take()
    }

    #[track_caller]
    pub fn number(&mut self, js: &str) -> f64 {
        let value = self.eval(js);
        value.as_f64().unwrap_or_else(|| panic!("{js}: {value}"))
    }

    #[track_caller]
    pub fn text(&mut self, js: &str) -> String {
        let value = self.eval(js);
        value.as_str().unwrap_or_else(|| panic!("{js}: {value}")).to_owned()
    }

    /// Waits until an expression is true.
    #[track_caller]
    pub fn wait_for(&mut self, js: &str, seconds: f64) {
        let start = Instant::now();
        while self.eval(js) != true {
            assert!(start.elapsed().as_secs_f64() < seconds, "not true after {seconds} s: {js}");
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until what was done is drawn: the frame after next.
    #[track_caller]
    pub fn settle(&mut self) {
        self.eval(
            "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))",
        );
    }

    /// Left, top, width, height of the first such element in the window, having scrolled it into view.
    #[track_caller]
    pub fn place(&mut self, selector: &str) -> [f64; 4] {
        let js = format!(
            "(() => {{ const e = document.querySelector({}); if (!e) return null; e.scrollIntoView({{ block: 'nearest' }});
              const b = e.getBoundingClientRect(); return [b.x, b.y, b.width, b.height]; }})()",
            json!(selector)
        );
        let value = self.eval(&js);
        let list: Option<Vec<f64>> = value.as_array().map(|a| a.iter().filter_map(Value::as_f64).collect());
        list.and_then(|l| l.try_into().ok()).unwrap_or_else(|| panic!("no {selector}"))
    }

    /// Moves the mouse, with its button held if it is.
    #[track_caller]
    pub fn move_to(&mut self, at: [f64; 2]) {
        self.at = at;
        self.mouse("mouseMoved", json!({}));
    }

    #[track_caller]
    pub fn press(&mut self) {
        self.held = true;
        self.mouse("mousePressed", json!({}));
    }

    #[track_caller]
    pub fn release(&mut self) {
        self.held = false;
        self.mouse("mouseReleased", json!({}));
    }

    /// Turns the wheel; what is negative magnifies.
    #[track_caller]
    pub fn wheel(&mut self, delta: f64) {
        self.mouse("mouseWheel", json!({ "deltaX": 0, "deltaY": delta }));
    }

    #[track_caller]
    fn mouse(&mut self, kind: &str, more: Value) {
        let button = if self.held || kind == "mouseReleased" { "left" } else { "none" };
        let mut params = json!({ "type": kind, "x": self.at[0], "y": self.at[1], "button": button,
            "buttons": u8::from(self.held), "clickCount": u8::from(["mousePressed", "mouseReleased"].contains(&kind)) });
        for (key, value) in more.as_object().into_iter().flatten() {
            params[key] = value.clone();
        }
        self.ask("Input.dispatchMouseEvent", params);
    }

    /// Clicks into the middle of the first such element.
    #[track_caller]
    pub fn click(&mut self, selector: &str) {
        let [x, y, w, h] = self.place(selector);
        assert!(w > 0.0 && h > 0.0, "{selector} is not seen");
        self.move_to([x + w / 2.0, y + h / 2.0]);
        self.press();
        self.release();
    }

    /// `touchStart`, `touchMove`, or with no finger `touchEnd`.
    #[track_caller]
    pub fn touch(&mut self, kind: &str, fingers: &[[f64; 2]]) {
        let points = fingers.iter().enumerate().map(|(id, [x, y])| json!({ "x": x, "y": y, "id": id }));
        let params = json!({ "type": kind, "touchPoints": points.collect::<Vec<_>>() });
        self.ask("Input.dispatchTouchEvent", params);
    }

    /// A key down and up, by its name in the DOM.
    #[track_caller]
    pub fn key(&mut self, key: &str) {
        self.key_down(key);
        self.key_up(key);
    }

    #[track_caller]
    pub fn key_down(&mut self, key: &str) {
        let text = match key {
            "Enter" => "\r",
            k if k.chars().count() == 1 => k,
            _ => "",
        };
        let mut params = key_event("keyDown", key);
        if !text.is_empty() {
            params["text"] = json!(text);
        }
        self.ask("Input.dispatchKeyEvent", params);
    }

    #[track_caller]
    pub fn key_up(&mut self, key: &str) {
        self.ask("Input.dispatchKeyEvent", key_event("keyUp", key));
    }

    /// Chooses an option of the first such element by its text, as people's choice would tell the page.
    #[track_caller]
    pub fn choose(&mut self, selector: &str, option: &str) {
        let js = format!(
            "(() => {{ const s = document.querySelector({}); const i = [...s.options].findIndex((o) => o.text === {});
              s.selectedIndex = i; s.dispatchEvent(new Event('change', {{ bubbles: true }})); return i; }})()",
            json!(selector),
            json!(option)
        );
        assert!(self.number(&js) >= 0.0, "{selector} has no {option}");
        self.settle();
    }

    /// Moves the first such slider, as a hand would tell the page.
    #[track_caller]
    pub fn slide(&mut self, selector: &str, value: f64) {
        self.eval(&format!(
            "(() => {{ const s = document.querySelector({}); s.value = {value};
              s.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()",
            json!(selector)
        ));
        self.settle();
    }

    /// What the window shows, as a PNG file.
    #[track_caller]
    pub fn screenshot(&mut self) -> Vec<u8> {
        let said = self.ask("Page.captureScreenshot", json!({ "format": "png", "optimizeForSpeed": true }));
        STANDARD.decode(said["data"].as_str().expect("base64")).expect("base64")
    }

    /// What the window shows, having been drawn.
    #[track_caller]
    pub fn shot(&mut self) -> Shot {
        self.settle();
        let file = self.screenshot();
        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().expect("a PNG file");
        let mut bytes = vec![0; reader.output_buffer_size().expect("of a window's size")];
        let info = reader.next_frame(&mut bytes).expect("a picture");
        let samples = info.color_type.samples();
        let rgb = bytes[..info.buffer_size()].chunks_exact(samples).map(|p| [p[0], p[1], p[2]]).collect();
        Shot { size: [info.width as usize, info.height as usize], rgb }
    }

    /// What the page complained about, and what it asked the network for.
    fn complaints(&mut self) -> Vec<String> {
        let mut all = Vec::new();
        for e in &self.connection.events {
            let params = &e["params"];
            let url = params["request"]["url"].as_str().unwrap_or_default();
            let is_page =
                |params: &Value, url: &str| params["type"] == "Document" && url.starts_with("file://");
            let is = |value: &Value, any: &[&str]| any.iter().any(|k| value == *k);
            let bad = match e["method"].as_str().unwrap_or_default() {
                "Runtime.exceptionThrown" => true,
                "Runtime.consoleAPICalled" => is(&params["type"], &["error", "warning", "assert"]),
                "Log.entryAdded" => is(&params["entry"]["level"], &["error", "warning"]),
                "Network.requestWillBeSent" => !url.starts_with("data:") && !is_page(params, url),
                "Inspector.targetCrashed" => true,
                _ => false,
            };
            if bad {
                all.push(params.to_string());
            }
        }
        all
    }

    /// Panics if the page complained about anything or asked for anything but itself and what it holds.
    #[track_caller]
    pub fn assert_clean(&mut self) {
        self.settle();
        let all = self.complaints();
        assert!(all.is_empty(), "{}", all.join("\n"));
    }
}

impl Drop for Tab {
    fn drop(&mut self) {
        // What does not close now ends with the browser.
        self.connection.detach();
        let _ = self.connection.try_ask("Target.closeTarget", json!({ "targetId": self.target }));
    }
}

fn key_event(kind: &str, key: &str) -> Value {
    let code = match key {
        "Enter" => 13,
        " " => 32,
        "ArrowLeft" => 37,
        "ArrowUp" => 38,
        "ArrowRight" => 39,
        "ArrowDown" => 40,
        "Tab" => 9,
        "Escape" => 27,
        k => k.chars().next().map_or(0, |c| c.to_ascii_uppercase() as u32),
    };
    json!({ "type": kind, "key": key, "windowsVirtualKeyCode": code })
}
