//! Chromium without a window, asked through its DevTools protocol (<https://chromedevtools.github.io/devtools-protocol/>):
//! one browser for all tests, through a pipe, and for each test a tab with a session of its own. Every wait has an end.

use super::tab::Tab;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{LazyLock, Mutex};
use std::time::{Duration, Instant};

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
    "--remote-debugging-pipe",
];

/// Runs "$@", which reads commands from descriptor 3 and answers to 4. It ends with its commands, which end when the tests'
/// process does, in whatever way; then nothing is left.
const LEASH: &str = r#"profile="$1"; shift; "$@" 3<&0 4>&1 </dev/null >/dev/null 2>"$profile/log"
# Its children end a little later, and may write until then.
for _ in 1 2 3 4 5 6 7 8 9 10; do rm -rf "$profile" 2>/dev/null && break; sleep 0.2; done"#;

/// Where the browser itself is asked; none where no browser is installed.
static BROWSER: LazyLock<Option<Browser>> = LazyLock::new(|| program().map(Browser::launch));

struct Browser {
    commands: Mutex<ChildStdin>,
    routes: Mutex<Routes>,
    profile: PathBuf,
    // Held for as long as the tests run: statics are never dropped.
    _shell: Child,
}

/// Where what the browser says is wanted.
#[derive(Default)]
struct Routes {
    last: u64,
    /// Answers, by the command's number.
    answers: HashMap<u64, Sender<Value>>,
    /// Events, by the session.
    events: HashMap<String, Sender<Value>>,
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
            shell.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let (commands, said) = (shell.stdin.take().expect("piped"), shell.stdout.take().expect("piped"));
        std::thread::spawn(|| listen(said));
        Browser { commands: Mutex::new(commands), routes: Mutex::default(), profile, _shell: shell }
    }

    fn routes(&self) -> std::sync::MutexGuard<'_, Routes> {
        self.routes.lock().expect("no thread fails with it")
    }
}

/// Hands on what the browser says: messages with a 0 after each.
fn listen(said: ChildStdout) {
    for message in BufReader::new(said).split(0).map_while(Result::ok) {
        let Ok(message) = serde_json::from_slice::<Value>(&message) else { continue };
        let Some(browser) = BROWSER.as_ref() else { return };
        let mut routes = browser.routes();
        let to = match (message["id"].as_u64(), message["sessionId"].as_str()) {
            (Some(id), _) => routes.answers.remove(&id),
            (None, Some(session)) => routes.events.get(session).cloned(),
            _ => None,
        };
        // Whoever does not listen any more has what it wanted.
        to.into_iter().for_each(|to| drop(to.send(message.clone())));
    }
}

/// What the browser has written down, if it does not answer.
fn log(profile: &Path) -> String {
    std::fs::read_to_string(profile.join("log")).unwrap_or_default()
}

/// A tab of its own; none, said on the way, where no browser is installed.
pub fn tab() -> Option<Tab> {
    let Some(browser) = BROWSER.as_ref() else {
        let required = std::env::var_os("SKYLIT_REQUIRE_BROWSER").is_some_and(|v| v == "1");
        assert!(!required, "there is no {} in the PATH, and no SKYLIT_BROWSER", NAMES.join(", no "));
        println!("skipped: no Chromium");
        return None;
    };
    Some(Tab::new(Connection::open(browser)))
}

/// Commands and their answers, and what is told in between.
pub struct Connection {
    browser: &'static Browser,
    told: Receiver<Value>,
    tell: Sender<Value>,
    /// Of the attached tab; commands go to the browser itself before there is one.
    session: Option<String>,
    /// In the order that they came.
    pub events: Vec<Value>,
}

impl Connection {
    fn open(browser: &'static Browser) -> Connection {
        let (tell, told) = channel();
        Connection { browser, told, tell, session: None, events: Vec::new() }
    }

    /// Further commands go to a tab, and its events come.
    pub fn attach(&mut self, session: &str) {
        self.browser.routes().events.insert(session.to_owned(), self.tell.clone());
        self.session = Some(session.to_owned());
    }

    /// Further commands go to the browser itself.
    pub fn detach(&mut self) {
        if let Some(session) = self.session.take() {
            self.browser.routes().events.remove(&session);
        }
    }

    /// The answer to a command, or what the browser has against it.
    pub fn try_ask(&mut self, method: &str, params: Value) -> Result<Value, String> {
        let id = {
            let mut routes = self.browser.routes();
            routes.last += 1;
            let id = routes.last;
            routes.answers.insert(id, self.tell.clone());
            id
        };
        let mut command = json!({ "id": id, "method": method, "params": params });
        if let Some(session) = &self.session {
            command["sessionId"] = json!(session);
        }
        let message = command.to_string() + "\0";
        let sent =
            self.browser.commands.lock().expect("no thread fails with it").write_all(message.as_bytes());
        sent.map_err(|e| format!("{e}\n{}", log(&self.browser.profile)))?;
        let start = Instant::now();
        loop {
            let mut said = self.read()?;
            if said["id"] == id {
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
        let said = self.told.recv_timeout(PATIENCE);
        said.map_err(|e| format!("the browser does not answer: {e}\n{}", log(&self.browser.profile)))
    }
}
