//! Chromium without a window, driven over its DevTools protocol by a pair of pipes.

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::{Value, json};

use crate::Outcome;
use crate::user::{Key, User};

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// In the page: text of less than a contrast to what is behind it, by WCAG's formula, as sentences. Letters of controls that are switched off count
/// as little there as here.
pub const PALE: &str = r"(least, selector) => {
  const light = c => { const [r, g, b] = c.match(/[\d.]+/g).map(v => c.startsWith('color(') ? v : v / 255).map(v => v <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
    return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const behind = e => { for (; e; e = e.parentElement) { const c = getComputedStyle(e).backgroundColor; if (c !== 'rgba(0, 0, 0, 0)') return c; } return 'rgb(255, 255, 255)'; };
  const contrast = (a, b) => { const [x, y] = [light(a), light(b)]; return (Math.max(x, y) + 0.05) / (Math.min(x, y) + 0.05); };
  const wrong = [];
  for (const e of document.querySelectorAll(selector)) {
    if (e.disabled || !e.checkVisibility()) continue;
    const style = getComputedStyle(e), c = contrast(e.closest('svg') ? style.fill : style.color, behind(e.closest('svg') ?? e));
    if (c < least) wrong.push(`${e.tagName} ${e.getAttribute('class') ?? ''} has a contrast of ${c.toFixed(1)}: ${e.textContent.slice(0, 40)}`);
  }
  return wrong;
}";

/// What a browser says of a picture that it draws without a graphics card.
fn drawn_slowly(text: &Value) -> bool {
    text.as_str().is_some_and(|text| text.contains("GL Driver Message") && text.contains("Performance"))
}

/// What an answer holds.
fn bytes(answer: &Value) -> Result<Vec<u8>, String> {
    BASE64_STANDARD.decode(answer["data"].as_str().unwrap_or_default()).map_err(|e| e.to_string())
}

/// A browser with one page.
pub struct Browser {
    child: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    session: Option<String>,
    calls: u64,
    /// Of the page that was opened last.
    url: String,
    /// What came between answers.
    events: Vec<Value>,
    /// Where it keeps its files.
    _profile: tempfile::TempDir,
}

impl Drop for Browser {
    fn drop(&mut self) {
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

impl Browser {
    /// Starts it, with an empty page.
    pub fn start() -> Result<Self, String> {
        let installed = |name: &&str| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success());
        let named = std::env::var("PKM_BROWSER").ok();
        let program = match &named {
            Some(program) => Some(program.as_str()).filter(installed),
            None => BROWSERS.iter().copied().find(installed),
        };
        let program = program.ok_or(
            "no browser to look at the reports with: apt-get install chromium, or name another Chromium or Chrome in PKM_BROWSER",
        )?;
        let profile = tempfile::tempdir().map_err(|e| e.to_string())?;
        // the browser reads commands from its file 3 and answers in its file 4
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$@\" 3<&0 4>&1 </dev/null >/dev/null", "sh", program, "--remote-debugging-pipe"])
            .args(["--headless", "--no-first-run", "--disable-gpu", "--hide-scrollbars", "--disable-dev-shm-usage"])
            // what is opened is our own; without it no root user, such as a container's, gets a browser
            .args(["--no-sandbox", "--disable-background-networking", "--disable-component-update"])
            // WebGL without a graphics card
            .arg("--enable-unsafe-swiftshader")
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .map_err(|e| format!("{program}: {e}"))?;
        let (to, from) = child.stdin.take().zip(child.stdout.take()).ok_or("no pipes")?;
        let from = BufReader::new(from);
        let mut browser = Self {
            child,
            to,
            from,
            session: None,
            calls: 0,
            url: String::new(),
            events: Vec::new(),
            _profile: profile,
        };
        let page = browser.call("Target.createTarget", json!({ "url": "about:blank" }))?;
        let attach = json!({ "targetId": page["targetId"], "flatten": true });
        browser.session = browser.call("Target.attachToTarget", attach)?["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}))?;
        }
        Ok(browser)
    }

    fn receive(&mut self) -> Result<Value, String> {
        let mut message = Vec::new();
        self.from.read_until(0, &mut message).map_err(|e| format!("browser: {e}"))?;
        message.pop();
        serde_json::from_slice(&message).map_err(|e| format!("the browser has gone: {e}"))
    }

    pub fn call(&mut self, method: &str, params: Value) -> Result<Value, String> {
        self.calls += 1;
        let mut message = json!({ "id": self.calls, "method": method, "params": params });
        if let Some(session) = &self.session {
            message["sessionId"] = session.as_str().into();
        }
        write!(self.to, "{message}\0").and_then(|()| self.to.flush()).map_err(|e| format!("browser: {e}"))?;
        loop {
            let mut answer = self.receive()?;
            if answer["id"] == self.calls {
                let error = &answer["error"];
                return if error.is_null() { Ok(answer["result"].take()) } else { Err(format!("{method}: {error}")) };
            }
            self.events.push(answer);
        }
    }

    /// Opens a page.
    pub fn open(&mut self, path: &Path, [width, height]: [u32; 2], dark: bool, paper: bool) -> Outcome {
        let screen = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600 });
        self.call("Emulation.setDeviceMetricsOverride", screen)?;
        let scheme = json!([{ "name": "prefers-color-scheme", "value": if dark { "dark" } else { "light" } }]);
        let media = if paper { "print" } else { "screen" };
        self.call("Emulation.setEmulatedMedia", json!({ "media": media, "features": scheme }))?;
        self.events.clear();
        self.url = format!("file://{}", path.display());
        self.call("Page.navigate", json!({ "url": self.url }))?;
        while !self.events.iter().any(|e| e["method"] == "Page.loadEventFired") {
            let event = self.receive()?;
            self.events.push(event);
        }
        Ok(())
    }

    /// What the page that is open asks for and complains of.
    pub fn complaints(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        for event in &self.events {
            let params = &event["params"];
            match event["method"].as_str() {
                Some("Network.requestWillBeSent") => match params["request"]["url"].as_str() {
                    Some(url) if url == self.url || url.starts_with("data:") => {}
                    url => wrong.push(format!("asks for {url:?}")),
                },
                Some("Network.loadingFailed") => wrong.push(format!("a request failed: {}", params["errorText"])),
                Some("Log.entryAdded") if !drawn_slowly(&params["entry"]["text"]) => {
                    wrong.push(format!("the browser says: {}", params["entry"]["text"]));
                }
                Some("Runtime.consoleAPICalled") if !drawn_slowly(&params["args"][0]["value"]) => {
                    wrong.push(format!("the console says: {params}"));
                }
                Some("Runtime.exceptionThrown") => wrong.push(format!("the console says: {params}")),
                _ => {}
            }
        }
        wrong.dedup();
        wrong
    }

    /// A picture of the whole page that is open.
    pub fn picture(&mut self, path: &Path) -> Outcome {
        let size = self.call("Page.getLayoutMetrics", json!({}))?["cssContentSize"].take();
        let clip = json!({ "x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1 });
        let shot = json!({ "format": "png", "captureBeyondViewport": true, "clip": clip });
        let whole = self.call("Page.captureScreenshot", shot)?;
        std::fs::write(path, bytes(&whole)?).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// A small picture of what a window shows of the page that is open.
    pub fn first_screen(&mut self, path: &Path, [width, height]: [u32; 2], scale: f64) -> Outcome {
        let clip = json!({ "x": 0, "y": 0, "width": width, "height": height, "scale": scale });
        let shot = self.call("Page.captureScreenshot", json!({ "format": "webp", "quality": 80, "clip": clip }))?;
        std::fs::write(path, bytes(&shot)?).map_err(|e| format!("{}: {e}", path.display()))
    }

    /// Prints the page that is open; the number of its pages.
    pub fn print(&mut self, path: &Path) -> Result<usize, String> {
        // or what was asked for of the screen would be printed
        self.call("Emulation.setEmulatedMedia", json!({ "media": "print" }))?;
        let printed = self.call("Page.printToPDF", json!({ "preferCSSPageSize": true, "printBackground": true }))?;
        let pdf = bytes(&printed)?;
        std::fs::write(path, &pdf).map_err(|e| format!("{}: {e}", path.display()))?;
        // not `/Pages`, the nodes of their tree
        Ok(pdf.windows(12).filter(|w| w.starts_with(b"/Type /Page") && w[11] != b's').count())
    }
}

impl User for Browser {
    fn evaluate(&mut self, expression: &str) -> Result<Value, String> {
        let asked = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let mut found = self.call("Runtime.evaluate", asked)?;
        match &found["exceptionDetails"] {
            Value::Null => Ok(found["result"]["value"].take()),
            thrown => Err(format!("{expression}: {thrown}")),
        }
    }

    fn drag(&mut self, from: [f64; 2], to: [f64; 2]) -> Outcome {
        for (kind, [x, y], buttons) in [("mousePressed", from, 1), ("mouseMoved", to, 1), ("mouseReleased", to, 0)] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "buttons": buttons, "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event)?;
        }
        Ok(())
    }

    fn write(&mut self, text: &str) -> Outcome {
        self.call("Input.insertText", json!({ "text": text })).map(drop)
    }

    fn press(&mut self, key: Key) -> Outcome {
        let (name, code, text) = match key {
            Key::Tab => ("Tab", 9, ""),
            Key::Enter => ("Enter", 13, "\r"),
        };
        for kind in ["keyDown", "keyUp"] {
            let event = json!({ "type": kind, "key": name, "code": name, "windowsVirtualKeyCode": code, "text": text });
            self.call("Input.dispatchKeyEvent", event)?;
        }
        Ok(())
    }
}
