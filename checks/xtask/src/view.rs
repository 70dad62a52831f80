//! The page of `view`, driven in a browser as an engineer drives it.

use std::path::{Path, PathBuf};

use pkm_host::cli;
use serde_json::{Value, json};

use crate::browser::{Browser, PALE};
use crate::firefox::Firefox;
use crate::user::{Key, User};
use crate::{Outcome, axe, root};

const DESKTOP: [u32; 2] = [1280, 800];
const MOBILE: [u32; 2] = [375, 812];
/// Greatest size of a page with a path and a placement, bytes.
const MAX_PAGE_BYTES: u64 = 1_500_000;
/// Frames that are asked for, each of which has to come.
const FRAMES: u32 = 30;

const FIREFOX: &str = "apt-get install --no-install-recommends firefox-esr xvfb libgl1 libegl1 libgl1-mesa-dri";
/// Mistakes that must be seen there: what, as a script, and how the complaint begins.
const PLANTED: [(&str, &str, &str); 3] = [
    ("a message in the console", "console.log(1)", "the console says"),
    ("an error", "throw new Error()", "the browser says"),
    ("a request", "fetch('http://127.0.0.1:65535/').catch(() => 0)", "asks for http://127.0.0.1:65535/"),
];

/// Of text to what is behind it: WCAG AA.
const CONTRAST: f64 = 4.5;
const TEXT: &str = "body, h1, h2, h3, p, li, a, summary, label, legend, button, select, input[type=number], th, td, dt, dd, output, span, small, strong";

/// In the page: what can be used, and whether the focus has been there.
const CONTROLS: &str = "[...document.querySelectorAll('input, select, button, summary, a[href], canvas, [tabindex]')].filter(e => e.checkVisibility() && !e.disabled && e.type !== 'file')";

/// Waits until something is true, at most a minute.
const UNTIL: &str = "async (what, is) => { for (let n = 0; n < 600; n++) { if (is()) return true; await new Promise(r => setTimeout(r, 100)); } throw new Error('in vain: ' + what); }";

/// Opens a file in the page, as its button does: the message.
const OPEN: &str = "async (name, text) => { await pkm.documents.open(new File([text], name)); return document.getElementById('file-message').textContent; }";

pub fn run() -> Outcome {
    let out = root().join("out/reports");
    std::fs::create_dir_all(&out).map_err(|e| e.to_string())?;
    let mut browser = Browser::start()?;
    axe::install(&mut browser, &out)?;
    let wrong = look(&mut browser, &out)?;
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
}

fn written(out: &Path, name: &str, args: &[String]) -> Result<PathBuf, String> {
    let path = out.join(name);
    let args = ["view".to_owned(), format!("--out={}", path.display())].into_iter().chain(args.iter().cloned());
    cli::run(args).map_err(|e| e.to_string())?;
    Ok(path)
}

/// What is wrong with the page. Pictures of it go to a folder.
pub fn look(browser: &mut Browser, out: &Path) -> Result<Vec<String>, String> {
    let fixture = |option: &str, name: &str| format!("--{option}={}", root().join("fixtures").join(name).display());
    let args = [fixture("table", "jobs/wide-table.json"), fixture("path", "jobs/path.csv")];
    let page = written(out, "view.html", &args)?;
    let machine = out.join("x150.toml");
    std::fs::write(&machine, softened(true, true)?).map_err(|e| e.to_string())?;
    let other = written(out, "view-x150.html", &[format!("--machine={}", machine.display())])?;
    let size = std::fs::metadata(&page).map_err(|e| e.to_string())?.len();
    let mut wrong = Vec::new();
    if size > MAX_PAGE_BYTES {
        wrong.push(format!("view: {size} bytes, {MAX_PAGE_BYTES} at the most"));
    }
    for (name, path, window, dark) in [
        ("view-dark", &page, DESKTOP, true),
        ("view-mobile-dark", &page, MOBILE, true),
        ("view-mobile", &page, MOBILE, false),
        ("view-x150", &other, DESKTOP, false),
        ("view", &page, DESKTOP, false),
    ] {
        let faults = opened(browser, path, window, dark, &out.join(format!("{name}.png")))?;
        wrong.extend(faults.into_iter().map(|fault| format!("{name}: {fault}")));
        if name == "view-x150" {
            wrong.extend(toggled(browser, out)?.into_iter().map(|fault| format!("{name}: {fault}")));
        }
    }
    // not held against a limit: it is longer on a busy machine
    let paint = browser.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")?;
    wrong.extend(driven(browser)?.into_iter().map(|fault| format!("view: {fault}")));
    wrong.extend(pinched(browser)?.into_iter().map(|fault| format!("view: {fault}")));
    wrong.extend(still(browser)?.into_iter().map(|fault| format!("view: {fault}")));
    wrong.extend(unreached(browser)?.into_iter().map(|fault| format!("view: {fault}")));
    wrong.extend(browser.complaints().into_iter().map(|fault| format!("view: {fault}")));
    wrong.extend(in_firefox(&page)?.into_iter().map(|fault| format!("view, in Firefox: {fault}")));
    let pages = browser.print(&out.join("view.pdf"))?;
    println!("view: {size} bytes, first paint after {paint} ms, {pages} pages of paper");
    Ok(wrong)
}

/// What is wrong with the page in Firefox, if that is installed.
fn in_firefox(page: &Path) -> Result<Vec<String>, String> {
    let Some(mut firefox) = Firefox::start()? else {
        println!("view: not looked at in Firefox: {FIREFOX}");
        return Ok(Vec::new());
    };
    firefox.open(page)?;
    let mut wrong = shown(&mut firefox, DESKTOP[0])?;
    wrong.extend(driven(&mut firefox)?);
    // from the beginning, or the focus begins in the middle and goes through the browser's own controls
    firefox.open(page)?;
    wait(&mut firefox)?;
    wrong.extend(unreached(&mut firefox)?);
    wrong.extend(firefox.complaints()?);
    let html = std::fs::read_to_string(page).map_err(|e| format!("{}: {e}", page.display()))?;
    let spoilt = page.with_file_name("planted.html");
    for (what, script, seen) in PLANTED {
        // what the page itself forbids would not get so far
        let free = html.replace("default-src 'none'", "default-src *");
        std::fs::write(&spoilt, free.replacen("</h1>", &format!("</h1><script>{script}</script>"), 1))
            .map_err(|e| e.to_string())?;
        firefox.open(&spoilt)?;
        wait(&mut firefox)?;
        if !firefox.complaints()?.iter().any(|complaint| complaint.starts_with(seen)) {
            wrong.push(format!("planted, and not seen: {what}"));
        }
    }
    println!("view: driven in Firefox, too");
    Ok(wrong)
}

/// The picture of the README and the gallery.
pub fn picture(browser: &mut Browser, page: &Path) -> Outcome {
    browser.open(page, DESKTOP, false, false)?;
    wait(browser)?;
    browser.first_screen(&root().join("docs/view.webp"), DESKTOP, 1.0)
}

/// Waits until the page has compared its results with the program's.
fn wait(browser: &mut dyn User) -> Outcome {
    let compared = "() => /good|bad/.test(document.getElementById('checksum').className)";
    browser.evaluate(&format!("({UNTIL})('the checksum', {compared})")).map(drop)
}

/// Opens the page, waits until it has compared its results with the program's, and takes its picture.
fn opened(
    browser: &mut Browser,
    path: &Path,
    window: [u32; 2],
    dark: bool,
    picture: &Path,
) -> Result<Vec<String>, String> {
    browser.open(path, window, dark, false)?;
    let mut wrong = shown(browser, window[0])?;
    wrong.extend(browser.sentences(axe::JUDGE, "")?);
    wrong.extend(browser.complaints());
    browser.picture(picture)?;
    Ok(wrong)
}

/// What is wrong with a page that has been opened, once it has compared its results with the program's.
fn shown(browser: &mut dyn User, width: u32) -> Result<Vec<String>, String> {
    wait(browser)?;
    let found = browser.evaluate(
        "({ equal: document.getElementById('checksum').classList.contains('good'), wide: document.documentElement.scrollWidth,
            drawn: pkm.renderer !== undefined, small: [...document.querySelectorAll('body *')].filter(e => e.checkVisibility()
              && e.textContent.trim() && parseFloat(getComputedStyle(e).fontSize) < 12).length,
            unnamed: [...document.querySelectorAll('input, select, button')].filter(e => !(e.labels?.length || e.ariaLabel || e.textContent.trim())).length })",
    )?;
    let mut wrong = Vec::new();
    if found["equal"] != true {
        wrong.push("the page's results are not the program's".into());
    }
    if found["wide"].as_u64() > Some(u64::from(width)) {
        wrong.push(format!("{} wide in a window of {width}", found["wide"]));
    }
    if found["drawn"] != true || found["small"] != 0 || found["unnamed"] != 0 {
        wrong.push(format!("no picture, small letters, or controls without names: {found}"));
    }
    wrong.extend(browser.sentences(PALE, &format!("{CONTRAST}, '{TEXT}'"))?);
    Ok(wrong)
}

/// Controls that the key Tab does not reach. Of a group of radio buttons it reaches one.
fn unreached(browser: &mut dyn User) -> Result<Vec<String>, String> {
    browser.evaluate(
        "(() => { document.addEventListener('focusin', e => { e.target.reached = true; }); document.activeElement.blur(); })()",
    )?;
    let count = browser.evaluate(&format!("{CONTROLS}.length"))?.as_u64().unwrap_or_default();
    for _ in 0..count + 5 {
        browser.press(Key::Tab)?;
    }
    let missed = format!(
        "() => {CONTROLS}.filter(e => !e.reached && !(e.type === 'radio' && {CONTROLS}.some(o => o.name === e.name && o.reached)))\
         .map(e => `Tab does not reach ${{e.tagName}} ${{e.id || e.ariaLabel || e.textContent.trim().slice(0, 30)}}`)"
    );
    browser.sentences(&missed, "")
}

/// Drags, types, opens files, plays the path.
fn driven(browser: &mut dyn User) -> Result<Vec<String>, String> {
    let mut wrong = Vec::new();
    let mut expect = |is: bool, what: &str| {
        if !is {
            wrong.push(what.to_owned());
        }
    };
    let tip = "({ tip: pkm.answer.tip, at: pkm.camera.project(pkm.answer.tip).map((v, i) => v + [0, 1].map(n => document.getElementById('picture').getBoundingClientRect()[n ? 'top' : 'left'])[i]) })";
    let before = browser.evaluate(tip)?;
    let [x, y] = [0, 1].map(|i| before["at"][i].as_f64().unwrap_or_default());
    browser.drag([x, y], [x + 30.0, y - 20.0])?;
    let after = browser.evaluate(tip)?;
    let moved = |i: usize| after["at"][i].as_f64().unwrap_or_default() - before["at"][i].as_f64().unwrap_or_default();
    expect((moved(0) - 30.0).abs() < 1.0 && (moved(1) + 20.0).abs() < 1.0, "the tip does not follow the mouse");
    let yaw = browser.evaluate("pkm.camera.yaw")?;
    browser.drag([100.0, 700.0], [160.0, 700.0])?;
    expect(browser.evaluate("pkm.camera.yaw")? != yaw, "the picture does not turn");

    browser.evaluate(
        "(() => { const i = document.querySelector('#position-rows .row input[type=number]'); i.focus(); i.select(); })()",
    )?;
    browser.write("5")?;
    browser.press(Key::Enter)?;
    let theta = browser.evaluate("pkm.state.configuration[0] * 180 / Math.PI")?.as_f64().unwrap_or_default();
    expect((theta - 5.0).abs() < 1e-9, "a typed angle is not taken");
    let by_key = "(() => { const before = pkm.answer.tip[0], key = { key: 'ArrowRight', shiftKey: true, cancelable: true };
        document.getElementById('picture').dispatchEvent(new KeyboardEvent('keydown', key)); return 1e3 * (pkm.answer.tip[0] - before); })()";
    let moved = browser.evaluate(by_key)?.as_f64().unwrap_or_default();
    expect((moved - 1.0).abs() < 1e-6, "a key does not move the tip by 1 mm");
    browser.evaluate("pkm.drive({ configuration: [0, 0, 0.9, 0, 0] })")?;
    let refused = browser.evaluate("document.getElementById('refused').textContent + pkm.state.configuration[2]")?;
    expect(
        refused.as_str().is_some_and(|t| t.contains("travel") && !t.ends_with("0.9")),
        "a pose beyond travel is not refused",
    );

    let frames = format!(
        "(async () => {{ const from = pkm.frames; for (let n = 0; n < {FRAMES}; n++) {{ pkm.camera.turn(0.02, 0); pkm.redraw(); \
         await new Promise(requestAnimationFrame); await new Promise(r => setTimeout(r)); }} return pkm.frames - from; }})()"
    );
    expect(browser.evaluate(&frames)? == FRAMES, "frames are missing");
    expect(documents(browser)?, "a foreign diagnosis is not refused, or the placement not opened");
    browser.evaluate("document.getElementById('play').click()")?;
    browser.evaluate(&format!("({UNTIL})('the path', () => +document.querySelector('#path input').value > 5)"))?;
    browser.evaluate("document.getElementById('play').click()")?;
    let on_path = "(() => { const p = pkm.data.path.points[+document.querySelector('#path input').value - 1]; return p[2].every((v, i) => v === pkm.state.configuration[i]) && p[3].every((v, i) => v === pkm.state.wrench[i]); })()";
    expect(browser.evaluate(on_path)? == true, "the machine is not where the path is");
    Ok(wrong)
}

/// The machine file of x150, with an effect and with an element.
fn softened(effect: bool, element: bool) -> Result<String, String> {
    let path = root().join("fixtures/machines/x150.toml");
    let mut text = std::fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
    if effect {
        text += "[[effect]]\nid = \"limb-2-axial\"\naxial_m_per_n = 1e-8\n";
    }
    if element {
        text += "[[element]]\nplace = \"base\"\nmotion = \"z\"\nlaw = \"constant\"\ncompliance_m_per_n = 2e-8\n";
    }
    Ok(text)
}

/// Effects and elements are switched off and on: the page's k33 at home is that of the program for a machine file that has them or not.
fn toggled(browser: &mut dyn User, out: &Path) -> Result<Vec<String>, String> {
    let (machine, poses) = (out.join("softened.toml"), out.join("home.csv"));
    std::fs::write(&poses, "pose,theta_deg,sigma_deg,z0_mm\nhome,0,0,255\n").map_err(|e| e.to_string())?;
    let [machine_option, poses_option] =
        [("machine", &machine), ("poses", &poses)].map(|(name, path)| format!("--{name}={}", path.display()));
    let click = |name: &str| {
        format!(
            "[...document.querySelectorAll('#model-body label.check, #model-body button')].find(e => e.textContent === '{name}').click()"
        )
    };
    let mut wrong = Vec::new();
    for (press, effect, element) in [
        (None, true, true),
        (Some("limb-2-axial"), false, true),
        (Some("base, z, constant"), false, false),
        (Some("limb-2-axial"), true, false),
        (Some("As in the machine file"), true, true),
    ] {
        if let Some(press) = press {
            browser.evaluate(&click(press))?;
        }
        let shown = browser.evaluate("(() => { pkm.draw(); return pkm.answer.basic.k[14]; })()")?.as_f64();
        std::fs::write(&machine, softened(effect, element)?).map_err(|e| e.to_string())?;
        let said = cli::run(["stiffness", &machine_option, &poses_option, "--json"]).map_err(|e| e.to_string())?;
        let said: Value = serde_json::from_str(&said.json).map_err(|e| e.to_string())?;
        let expected = said["poses"][0]["k"][2][2].as_f64();
        if !shown.zip(expected).is_some_and(|(a, b)| (a - b).abs() < 1e-9 * b) {
            wrong.push(format!("effect {effect}, element {element}: k33 is {shown:?}, the program says {expected:?}"));
        }
    }
    Ok(wrong)
}

/// Two fingers that go apart bring the machine nearer, to twice its size where they are twice as far apart.
fn pinched(browser: &mut Browser) -> Result<Vec<String>, String> {
    const WIDTH: &str = "(() => { const [a, b] = [[0, 0, 0], pkm.answer.tip].map(p => pkm.camera.project(p)); return Math.hypot(a[0] - b[0], a[1] - b[1]); })()";
    let before = browser.evaluate(WIDTH)?.as_f64().unwrap_or_default();
    for (kind, apart) in [("touchStart", Some(60)), ("touchMove", Some(120)), ("touchEnd", None)] {
        let finger = |id: i32, apart: i32| json!({ "x": 400 + (2 * id - 1) * apart / 2, "y": 600, "id": id });
        let fingers: Vec<Value> = apart.into_iter().flat_map(|apart| [finger(0, apart), finger(1, apart)]).collect();
        browser.call("Input.dispatchTouchEvent", json!({ "type": kind, "touchPoints": fingers }))?;
    }
    let grown = browser.evaluate(WIDTH)?.as_f64().unwrap_or_default() / before;
    Ok(if grown > 1.5 { Vec::new() } else { vec![format!("two fingers make the machine {grown} times as large")] })
}

/// Who wants little motion gets a picture of the path twice a second, and nothing that fades or slides.
fn still(browser: &mut Browser) -> Result<Vec<String>, String> {
    let ask = |browser: &mut Browser, value: &str| {
        let features = json!([{ "name": "prefers-reduced-motion", "value": value }]);
        browser.call("Emulation.setEmulatedMedia", json!({ "media": "screen", "features": features })).map(drop)
    };
    ask(browser, "reduce")?;
    let found = browser.evaluate(
        "(async () => {
            const at = () => +document.querySelector('#path input').value, play = document.getElementById('play'), seen = new Set([at()]);
            play.click();
            for (let n = 0; n < 120; n++) { await new Promise(r => setTimeout(r, 10)); seen.add(at()); }
            if (play.ariaPressed === 'true') play.click();
            const moving = [...document.querySelectorAll('*')].filter(e => parseFloat(getComputedStyle(e).transitionDuration) > 0).length;
            return { steps: seen.size, moving };
        })()",
    )?;
    ask(browser, "no-preference")?;
    let few = found["steps"].as_u64().is_some_and(|steps| (2..=5).contains(&steps));
    let fault = || {
        format!(
            "with reduced motion the path is played in {} steps of 1.2 s, {} parts fade",
            found["steps"], found["moving"]
        )
    };
    Ok(if few && found["moving"] == 0 { Vec::new() } else { vec![fault()] })
}

/// A diagnosis of this machine is opened and shows its reading, one of another machine is refused.
fn documents(browser: &mut dyn User) -> Result<bool, String> {
    let sum = browser.evaluate("pkm.data.machine.sha256")?;
    let diagnosis = |machine_sha256: &Value| {
        let reading = json!({ "line": 2, "theta_deg": 3.0, "sigma_deg": -2.0, "z0_mm": 530.0, "point_mm": [0, 0, 100], "wrench": [100, 0, 0, 0, 0, 0],
            "gauge": null, "read": [9.0, 1.0, 0.0, null, null, null], "before": [7.0, 1.0, 0.0, 0, 0, 0], "after": [9.1, 1.0, 0.0, 0, 0, 0], "excluded": false });
        let effect = json!({ "id": "limb-2-axial", "where": "limb.2.body", "where_class": [], "of": "machine", "parameters": {}, "inspect": "Look." });
        json!({ "machine": "m", "machine_sha256": machine_sha256, "verdict": "explained", "effects": [effect], "readings": [reading] }).to_string()
    };
    let mut open = |name: &str, text: &str| browser.evaluate(&format!("({OPEN})({}, {})", json!(name), json!(text)));
    let foreign = open("foreign.json", &diagnosis(&json!("0")))?;
    let own = open("own.json", &diagnosis(&sum))?;
    let hole = json!({ "theta_deg": 1.0, "sigma_deg": 0.0, "z0_mm": 530.0, "beta1_deg": 0.0, "beta2_deg": 3.0, "deflection_um": 12.0, "status": "ok" });
    let series = json!({ "name": "A", "objective": "paper", "dx_mm": 1.0, "dy_mm": 2.0, "rotary_deg": 0.0, "value": 1.0, "unit": "µm", "holes": [hole] });
    let placed =
        open("placed.json", &json!({ "machine": "m", "machine_sha256": sum, "series": [series] }).to_string())?;
    let seen = browser.evaluate(
        "(() => { document.querySelector('#diagnosis [aria-label^=Next]').click(); pkm.draw(); return { found: pkm.scene.found.has('limb.2.body'), \
         theta: pkm.state.configuration[0] * 180 / Math.PI, holes: pkm.documents.holes.length, table: document.querySelectorAll('#diagnosis td').length }; })()",
    )?;
    let says = |message: &Value, text: &str| message.as_str().is_some_and(|message| message.contains(text));
    Ok(says(&foreign, "another machine file")
        && says(&own, "is open")
        && says(&placed, "is open")
        && seen["found"] == true
        && seen["holes"] == 1
        && seen["theta"].as_f64().is_some_and(|theta| (theta - 3.0).abs() < 1e-9)
        && seen["table"].as_u64() > Some(10))
}
