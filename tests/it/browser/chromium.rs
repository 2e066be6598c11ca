//! Chromium without a window, asked through its DevTools protocol (<https://chromedevtools.github.io/devtools-protocol/>):
//! one browser for all tests, and for each test a tab with a connection of its own. Every wait has an end.

use super::tab::Tab;
use serde_json::{Value, json};
use std::net::TcpStream;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};
use tungstenite::{Message, WebSocket};

/// How long anything may take: far more than it does, even where every core is busy.
pub const PATIENCE: Duration = Duration::from_secs(60);

/// The names under which systems have it.
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Without a sandbox, which wants rights that containers do not give: nothing but our own pages is opened. Tabs that
/// no one looks at are drawn like others, in the colours that they ask for.
const FLAGS: [&str; 14] = [
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-background-timer-throttling",
    "--disable-backgrounding-occluded-windows",
    "--disable-component-update",
    "--disable-extensions",
    "--disable-renderer-backgrounding",
    "--force-color-profile=srgb",
    "--hide-scrollbars",
    "--no-first-run",
    "--remote-debugging-port=0",
];

/// Runs "$@" until standard input ends, which it does when the tests' process does, in whatever way; then nothing is left.
const LEASH: &str = r#"profile="$1"; shift; "$@" </dev/null >/dev/null 2>"$profile/log" & browser=$!
cat >/dev/null; kill "$browser"; wait "$browser"
# Its children end a little later, and may write until then.
for _ in 1 2 3 4 5 6 7 8 9 10; do rm -rf "$profile" 2>/dev/null && break; sleep 0.2; done"#;

/// Where the browser itself is asked; none where no browser is installed.
static BROWSER: LazyLock<Option<Browser>> = LazyLock::new(|| program().map(Browser::launch));

struct Browser {
    url: String,
    // Held open for as long as the tests run: statics are never dropped.
    _leash: ChildStdin,
    _shell: Child,
}

/// What `SKYLIT_BROWSER` names, by its path or as the PATH has it, else the first of [`NAMES`].
fn program() -> Option<PathBuf> {
    let named = std::env::var_os("SKYLIT_BROWSER");
    let names = named.as_ref().map_or_else(|| NAMES.map(Into::into).to_vec(), |n| vec![n.clone()]);
    let folders = std::env::var_os("PATH").unwrap_or_default();
    let mut all = std::env::split_paths(&folders).flat_map(|f| names.iter().map(move |n| f.join(n)));
    let found = all.find(|p| p.is_file());
    assert!(named.is_none() || found.is_some(), "SKYLIT_BROWSER is {named:?}, and there is no such program");
    found
}

impl Browser {
    #[expect(clippy::zombie_processes, reason = "it lives as long as this process; the leash ends it")]
    fn launch(program: PathBuf) -> Browser {
        // The shell removes it.
        let profile = tempfile::tempdir().expect("a folder for the profile").keep();
        let mut shell = Command::new("sh");
        shell.args(["-c", LEASH, "sh"]).arg(&profile).arg(&program).args(FLAGS);
        shell.arg(format!("--user-data-dir={}", profile.display())).arg("about:blank");
        // What ends the tests from a terminal shall not end the shell before it has cleaned up.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut shell, 0);
        let mut shell =
            shell.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let leash = shell.stdin.take().expect("piped");
        let start = Instant::now();
        loop {
            let log = std::fs::read_to_string(profile.join("log")).unwrap_or_default();
            let said = log.split_inclusive('\n').find_map(|l| l.split_once("DevTools listening on "));
            if let Some((_, url)) = said.filter(|(_, url)| url.ends_with('\n')) {
                return Browser { url: url.trim().to_owned(), _leash: leash, _shell: shell };
            }
            assert!(start.elapsed() < PATIENCE, "{} does not answer:\n{log}", program.display());
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

/// A tab of its own; none, said on the way, where no browser is installed.
pub fn tab() -> Option<Tab> {
    let Some(browser) = BROWSER.as_ref() else {
        let required = std::env::var_os("SKYLIT_REQUIRE_BROWSER").is_some_and(|v| v == "1");
        assert!(!required, "there is no {} in the PATH, and no SKYLIT_BROWSER", NAMES.join(", no "));
        println!("skipped: no Chromium");
        return None;
    };
    Some(Tab::new(Connection::open(&browser.url)))
}

/// Commands and their answers, and what is told in between.
pub struct Connection {
    socket: WebSocket<TcpStream>,
    last: u64,
    /// Of the attached tab; commands go to the browser itself before there is one.
    pub session: Option<String>,
    /// In the order that they came.
    pub events: Vec<Value>,
}

impl Connection {
    fn open(url: &str) -> Connection {
        let host = url.trim_start_matches("ws://").split('/').next().unwrap_or_default();
        let stream = TcpStream::connect(host).expect("the browser listens");
        stream.set_read_timeout(Some(PATIENCE)).expect("a time-out");
        stream.set_nodelay(true).expect("small messages at once");
        let (socket, _) = tungstenite::client(url, stream).expect("a websocket");
        Connection { socket, last: 0, session: None, events: Vec::new() }
    }

    /// The answer to a command, or what the browser has against it.
    pub fn try_ask(&mut self, method: &str, params: Value) -> Result<Value, String> {
        self.last += 1;
        let mut command = json!({ "id": self.last, "method": method, "params": params });
        if let Some(session) = &self.session {
            command["sessionId"] = json!(session);
        }
        self.socket.send(Message::text(command.to_string())).map_err(|e| e.to_string())?;
        let start = Instant::now();
        loop {
            let mut said = self.read()?;
            if said["id"] == self.last {
                return if said["error"].is_null() {
                    Ok(said["result"].take())
                } else {
                    Err(said["error"].to_string())
                };
            }
            self.events.push(said);
            if start.elapsed() > PATIENCE {
                return Err("no answer".into());
            }
        }
    }

    /// As [`Connection::try_ask`], where only an answer will do.
    #[track_caller]
    pub fn ask(&mut self, method: &str, params: Value) -> Value {
        self.try_ask(method, params).unwrap_or_else(|e| panic!("{method}: {e}"))
    }

    /// Waits for an event from number `since` of [`Connection::events`] on.
    #[track_caller]
    pub fn wait(&mut self, method: &str, since: usize) {
        let start = Instant::now();
        while !self.events[since..].iter().any(|e| e["method"] == method) {
            assert!(start.elapsed() < PATIENCE, "{method} never came");
            let said = self.read().unwrap_or_else(|e| panic!("{method}: {e}"));
            self.events.push(said);
        }
    }

    fn read(&mut self) -> Result<Value, String> {
        loop {
            if let Message::Text(text) = self.socket.read().map_err(|e| e.to_string())? {
                return serde_json::from_str(&text).map_err(|e| e.to_string());
            }
        }
    }
}
