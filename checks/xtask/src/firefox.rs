//! Firefox, driven over its Marionette protocol, on a display that nobody sees: without a display it has no WebGL.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

use serde_json::{Value, json};

use crate::Outcome;
use crate::user::{Key, User};

const BROWSERS: [&str; 2] = ["firefox-esr", "firefox"];
const DISPLAY: &str = "Xvfb";
/// Of pages, as Chromium has it.
const WINDOW: [u32; 2] = [1280, 800];
/// Tenths of a second until it has to listen.
const PATIENCE: u32 = 600;
/// It takes a free port, and asks nobody for news.
const PREFERENCES: &str = r#"user_pref("marionette.port", 0);
user_pref("app.update.enabled", false);
user_pref("browser.aboutwelcome.enabled", false);
user_pref("datareporting.policy.dataSubmissionEnabled", false);
user_pref("network.captive-portal-service.enabled", false);
user_pref("network.connectivity-service.enabled", false);
user_pref("toolkit.telemetry.server", "");
"#;

/// In the browser itself: remembers what pages ask of the network.
const WATCH: &str = r#"globalThis.asked = [];
Services.obs.addObserver(channel => {
  const { URI, loadInfo } = channel.QueryInterface(Ci.nsIChannel);
  if (!loadInfo.triggeringPrincipal.isSystemPrincipal) asked.push(`asks for ${URI.spec}`);
}, "http-on-opening-request");"#;
const ASKED: &str = "return asked.splice(0);";

/// In the process of pages: what they complain of, once.
const SAID: &str = r#"const console = Components.classes["@mozilla.org/consoleAPI-storage;1"].getService(Components.interfaces.nsIConsoleAPIStorage);
const errors = Services.console.getMessageArray().filter(m => m instanceof Components.interfaces.nsIScriptError && m.sourceName.startsWith("file:"));
const said = [...errors.map(m => `the browser says: ${m.errorMessage}`), ...console.getEvents().map(e => `the console says: ${e.arguments}`)];
Services.console.reset();
console.clearEvents();
return said;"#;

/// A browser with one page.
pub struct Firefox {
    child: Child,
    display: Child,
    stream: BufReader<TcpStream>,
    calls: u64,
    /// The display ends when nobody reads what it says.
    _number: BufReader<ChildStdout>,
    /// Where it keeps its files.
    _profile: tempfile::TempDir,
}

impl Drop for Firefox {
    fn drop(&mut self) {
        for child in [&mut self.child, &mut self.display] {
            drop(child.kill());
            drop(child.wait());
        }
    }
}

/// A display of its own, and its number.
fn display() -> Result<(Child, BufReader<ChildStdout>, String), String> {
    let mut child = Command::new(DISPLAY)
        .args(["-displayfd", "1", "-screen", "0", "1600x1200x24", "-nolisten", "tcp"])
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .map_err(|e| format!("{DISPLAY}: {e}"))?;
    let mut said = BufReader::new(child.stdout.take().ok_or("no pipe")?);
    let mut number = String::new();
    said.read_line(&mut number).map_err(|e| format!("{DISPLAY}: {e}"))?;
    Ok((child, said, number.trim().to_owned()))
}

/// The port that a browser listens at, once it does.
fn port(child: &mut Child, profile: &Path) -> Result<u16, String> {
    for _ in 0..PATIENCE {
        let written = std::fs::read_to_string(profile.join("MarionetteActivePort")).unwrap_or_default();
        if let Ok(port) = written.trim().parse() {
            return Ok(port);
        }
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            return Err(format!("Firefox has gone: {status}"));
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    Err("Firefox does not listen".into())
}

impl Firefox {
    /// Starts it, where it and a display without a screen are installed.
    pub fn start() -> Result<Option<Self>, String> {
        let runs = |name: &&str, option| {
            Command::new(name).arg(option).output().is_ok_and(|o| !o.stdout.is_empty() || !o.stderr.is_empty())
        };
        let Some(program) = BROWSERS.iter().find(|name| runs(name, "--version")).filter(|_| runs(&DISPLAY, "-help"))
        else {
            return Ok(None);
        };
        let profile = tempfile::tempdir().map_err(|e| e.to_string())?;
        std::fs::write(profile.path().join("user.js"), PREFERENCES).map_err(|e| e.to_string())?;
        let (display, number_of, number) = display()?;
        let mut child = Command::new(program)
            // what is watched is told to the browser itself
            .args(["--marionette", "-remote-allow-system-access", "--no-remote", "--profile"])
            .arg(profile.path())
            .env("DISPLAY", format!(":{number}"))
            .env_remove("WAYLAND_DISPLAY")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("{program}: {e}"))?;
        let port = port(&mut child, profile.path())?;
        let stream = TcpStream::connect(("127.0.0.1", port)).map_err(|e| format!("{program}: {e}"))?;
        let stream = BufReader::new(stream);
        let mut firefox = Self { child, display, stream, calls: 0, _number: number_of, _profile: profile };
        // it greets first
        firefox.receive()?;
        firefox.call("WebDriver:NewSession", json!({}))?;
        firefox.system("chrome", WATCH)?;
        Ok(Some(firefox))
    }

    fn receive(&mut self) -> Result<Value, String> {
        let said = |e: std::io::Error| format!("Firefox: {e}");
        let mut length = Vec::new();
        self.stream.read_until(b':', &mut length).map_err(said)?;
        length.pop();
        let length = String::from_utf8_lossy(&length).parse().map_err(|_| "Firefox has gone")?;
        let mut message = vec![0; length];
        self.stream.read_exact(&mut message).map_err(said)?;
        serde_json::from_slice(&message).map_err(|e| format!("Firefox: {e}"))
    }

    fn call(&mut self, method: &str, parameters: Value) -> Result<Value, String> {
        self.calls += 1;
        let message = json!([0, self.calls, method, parameters]).to_string();
        write!(self.stream.get_mut(), "{}:{message}", message.len()).map_err(|e| format!("Firefox: {e}"))?;
        let mut answer = self.receive()?;
        if answer[2].is_null() { Ok(answer[3].take()) } else { Err(format!("{method}: {}", answer[2]["message"])) }
    }

    /// What statements return that may do anything, in the browser itself (`chrome`) or in the process of pages (`content`).
    fn system(&mut self, context: &str, statements: &str) -> Result<Value, String> {
        self.call("Marionette:SetContext", json!({ "value": context }))?;
        let script = json!({ "script": statements, "args": [], "sandbox": "system", "newSandbox": false });
        let answer = self.call("WebDriver:ExecuteScript", script);
        self.call("Marionette:SetContext", json!({ "value": "content" }))?;
        Ok(answer?["value"].take())
    }

    /// Opens a page, light, on a screen.
    pub fn open(&mut self, path: &Path) -> Outcome {
        self.call("WebDriver:Navigate", json!({ "url": "about:blank" }))?;
        self.complaints()?;
        // a window is larger than what it shows of a page
        let mut outer = WINDOW;
        for _ in 0..2 {
            self.call("WebDriver:SetWindowRect", json!({ "width": outer[0], "height": outer[1] }))?;
            let inner = self.evaluate("[innerWidth, innerHeight]")?;
            for i in 0..2 {
                outer[i] += WINDOW[i]
                    .saturating_sub(inner[i].as_u64().and_then(|v| u32::try_from(v).ok()).unwrap_or(WINDOW[i]));
            }
        }
        self.call("WebDriver:Navigate", json!({ "url": format!("file://{}", path.display()) })).map(drop)
    }

    /// What pages have asked for and complained of since this was called last.
    pub fn complaints(&mut self) -> Result<Vec<String>, String> {
        let all = [self.system("chrome", ASKED)?, self.system("content", SAID)?];
        Ok(all.iter().filter_map(Value::as_array).flatten().filter_map(Value::as_str).map(str::to_owned).collect())
    }

    fn act(&mut self, kind: &str, actions: Vec<Value>) -> Outcome {
        let device = json!({ "type": kind, "id": kind, "actions": actions });
        self.call("WebDriver:PerformActions", json!({ "actions": [device] })).map(drop)
    }

    fn keys(&mut self, keys: impl Iterator<Item = char>) -> Outcome {
        let actions = keys.flat_map(|key| ["keyDown", "keyUp"].map(|kind| json!({ "type": kind, "value": key })));
        self.act("key", actions.collect())
    }
}

impl User for Firefox {
    fn evaluate(&mut self, expression: &str) -> Result<Value, String> {
        let script = format!(
            "const done = arguments[0]; (async () => ({expression}))().then(v => done({{ v: JSON.stringify(v) }}), e => done({{ e: `${{e}}` }}))"
        );
        let asked = json!({ "script": script, "args": [], "scriptTimeout": 120_000 });
        let found = self.call("WebDriver:ExecuteAsyncScript", asked)?;
        match (&found["value"]["e"], found["value"]["v"].as_str()) {
            (Value::String(thrown), _) => Err(format!("{expression}: {thrown}")),
            // what is undefined
            (_, None) => Ok(Value::Null),
            (_, Some(text)) => serde_json::from_str(text).map_err(|e| format!("{expression}: {e}")),
        }
    }

    fn drag(&mut self, from: [f64; 2], to: [f64; 2]) -> Outcome {
        let there =
            |[x, y]: [f64; 2]| json!({ "type": "pointerMove", "duration": 0, "x": x, "y": y, "origin": "viewport" });
        let button = |kind: &str| json!({ "type": kind, "button": 0 });
        self.act("pointer", vec![there(from), button("pointerDown"), there(to), button("pointerUp")])
    }

    fn write(&mut self, text: &str) -> Outcome {
        self.keys(text.chars())
    }

    fn press(&mut self, key: Key) -> Outcome {
        // as WebDriver numbers them
        let key = match key {
            Key::Tab => '\u{e004}',
            Key::Enter => '\u{e007}',
        };
        self.keys(std::iter::once(key))
    }
}
