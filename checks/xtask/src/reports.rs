//! All reports, looked at by a browser.

use std::path::{Path, PathBuf};

use crate::browser::{Browser, PALE};
use crate::user::User;
use crate::{Outcome, axe, root, view};
use pkm_host::cli;

/// Width and height: a desktop and a mobile.
const WINDOWS: [[u32; 2]; 2] = [[1280, 800], [390, 844]];
/// What the shorter of the two papers leaves of its long side at 96 dots an inch: Letter with margins of 12 mm.
const PAPER: [u32; 2] = [965, 725];
/// Of body text to what is behind it.
const CONTRAST: f64 = 7.0;
/// What text is in.
const TEXT: &str = "body, h1, h2, p, li, a, summary, figcaption, th, td, th button, dt, dd, pre, .state, svg text";

/// Most pages of paper, by the beginnings of reports' names.
const PAGES: [(&str, usize); 2] = [("fit", 6), ("diagnose", 5)];

/// Reports that docs/gallery.md shows, with the view page.
const GALLERY: [&str; 9] = ["fit", "diagnose-p10", "verify", "geometry", "map", "place", "compensate", "replay", "fem"];
/// Of a picture there: as much of a page as is seen, and how small.
const GALLERY_WINDOW: [u32; 2] = [1000, 1300];
const GALLERY_SCALE: f64 = 0.5;

/// Mistakes that must be seen, made in a report: what is replaced by what, and whether it shows on paper alone.
const PLANTED: [(&str, &str, &str, bool); 10] = [
    ("no language for screen readers", "<html lang=\"en\">", "<html>", false),
    ("no rule for narrow windows", "width=device-width, initial-scale=1", "", false),
    ("something from elsewhere", "<h1>", "<h1 style=\"background:url(http://127.0.0.1:9/x.png)\">", false),
    ("a message in the console", "</h1>", "</h1><script>console.log(1)</script>", false),
    ("pale letters", "--ink:#14181d", "--ink:#9a9a9a", false),
    ("tables as wide as they like", "overflow-x:auto", "", false),
    ("a verdict that nobody sees", "<h1>", "<p style=\"height:2000px\"></p><h1>", false),
    ("text outside of its picture", "<text x=\"", "<text x=\"9", false),
    ("large tables on paper", "table{font-size:7pt", "table{font-size:16pt", true),
    ("folded parts on paper", "content-visibility:visible", "", true),
];

/// In the page: what is wrong with it, as sentences.
const CHECKS: &str = r"(paper, width) => {
  const wrong = [], root = document.documentElement;
  if (innerWidth !== width) wrong.push(`the page is laid out for ${innerWidth}, not for the window's ${width}`);
  if (root.scrollWidth > innerWidth) wrong.push(`the page is ${root.scrollWidth} wide in a window of ${innerWidth}`);
  if (!paper && parseFloat(getComputedStyle(document.body).fontSize) < 17) wrong.push('letters are small');
  const seen = e => e.checkVisibility({ contentVisibilityAuto: true });
  if (paper) for (const e of document.querySelectorAll('details:not(.screen) > :not(.verdict summary)')) if (!seen(e)) { wrong.push('on paper something stays folded'); break; }
  if (paper && [...document.querySelectorAll('.verdict summary')].some(seen)) wrong.push('on paper a heading says that there is more');
  if (!paper) document.querySelectorAll('details').forEach(e => e.open = true);
  for (const svg of document.querySelectorAll(paper ? 'svg:not(.screen svg)' : 'svg')) {
    const box = svg.getBoundingClientRect(), name = svg.querySelector('title')?.textContent;
    const told = svg.getAttribute('role') === 'img' ? name : svg.getAttribute('role') === 'group' && svg.tabIndex === 0 && svg.ariaLabel;
    if (!told) wrong.push('a picture has no name');
    if (box.width < 20 || box.height < 10) wrong.push(`picture ${name} has no size`);
    for (const text of svg.querySelectorAll('text')) {
      const t = text.getBoundingClientRect();
      if (t.left < box.left - 1 || t.right > box.right + 1 || t.top < box.top - 1 || t.bottom > box.bottom + 1)
        wrong.push(`picture ${name} cuts its text ${text.textContent}`);
    }
  }
  for (const e of document.querySelectorAll('table, svg, pre, summary, dd, p, li')) {
    const right = e.getBoundingClientRect().right;
    if (paper && right > innerWidth + 1) wrong.push(`${e.tagName} ${e.textContent.slice(0, 40)} is cut on paper: ${right.toFixed(0)} of ${innerWidth}`);
  }
  if (root.scrollWidth > innerWidth) wrong.push(`unfolded, the page is ${root.scrollWidth} wide in a window of ${innerWidth}`);
  for (const what of ['h1', '.verdict .state', '.verdict .headline']) {
    const box = document.querySelector(what)?.getBoundingClientRect();
    if (!box || box.height === 0 || box.bottom > innerHeight) wrong.push(`${what} is not at the top`);
  }
  if (document.querySelector('script[src], iframe, link, img') || document.scripts.length > 1) wrong.push('there is a second script, or something from elsewhere');
  for (const e of document.querySelectorAll('nav a')) if (!document.querySelector(e.hash)) wrong.push(`${e.hash} leads nowhere`);
  if (!paper) document.querySelectorAll('details').forEach(e => e.open = false);
  return wrong;
}";

/// In the page: what of its script does not work, as sentences.
const USE: &str = r#"() => {
  const wrong = [], expect = (is, what) => { if (!is) wrong.push(what); };
  const all = (selector, within = document) => [...within.querySelectorAll(selector)], tip = document.querySelector('.tip');
  const key = (e, key) => e.dispatchEvent(new KeyboardEvent('keydown', { key, bubbles: true, cancelable: true }));
  document.querySelectorAll('details').forEach(e => e.open = true);
  for (const svg of all('svg').filter(svg => svg.querySelector('.chart, .bars, .heat'))) {
    svg.focus();
    key(svg, 'ArrowRight');
    expect(/[0-9]/.test(tip.textContent), `${svg.ariaLabel}: keys show no value`);
    const ring = svg.querySelector('circle[r="7"]:last-of-type');
    if (!ring) continue;
    svg.scrollIntoView({ block: 'center' });
    const text = tip.textContent, at = ring.getBoundingClientRect();
    key(svg, 'Escape');
    expect(tip.textContent === '', 'Escape hides no value');
    svg.dispatchEvent(new PointerEvent('pointermove', { clientX: at.x + at.width / 2, clientY: at.y + at.height / 2, bubbles: true }));
    expect(/[0-9]/.test(tip.textContent), `${svg.ariaLabel}: the pointer shows no value`);
    svg.dispatchEvent(new PointerEvent('pointerleave'));
  }
  const legend = document.querySelector('[data-legend]');
  if (legend) {
    const series = () => all(`[data-series="${legend.dataset.legend}"]`, legend.closest('.chart, .bars')).map(e => e.style.display);
    key(legend, ' ');
    expect(series().every(d => d === 'none') && legend.getAttribute('aria-pressed') === 'false', 'a series is not switched off');
    key(legend, ' ');
    expect(series().every(d => d === ''), 'a series is not switched on again');
  }
  const button = document.querySelector('thead th button'), column = button.parentElement.cellIndex, rows = button.closest('table').tBodies[0].rows;
  const numbers = () => [...rows].map(row => parseFloat(row.cells[column].textContent)).filter(v => !isNaN(v));
  button.click();
  expect(numbers().every((v, i, a) => i === 0 || a[i - 1] >= v), 'a table is not sorted');
  button.click();
  expect(numbers().every((v, i, a) => i === 0 || a[i - 1] <= v), 'a table is not sorted the other way');
  const reading = document.querySelector('tr[data-key] th button');
  if (reading) {
    reading.click();
    const svg = document.activeElement, row = reading.closest('tr');
    expect(svg.tagName === 'svg' && tip.textContent && row.classList.contains('chosen'), 'a reading does not lead to its point');
    key(svg, 'Enter');
    expect(document.activeElement === reading, 'a point does not lead to its reading');
  }
  return wrong;
}"#;

pub fn run(options: &[String]) -> Outcome {
    let out = root().join("out/reports");
    let mut browser = Browser::start()?;
    let reports = write(&out)?;
    axe::install(&mut browser, &out)?;
    let mut wrong = Vec::new();
    for (name, path) in &reports {
        // light last: it is what is printed
        for dark in [true, false] {
            for window in WINDOWS {
                let picture = out.join(format!("{name}-{}-{}.png", if dark { "dark" } else { "light" }, window[0]));
                let faults = look(&mut browser, path, window, dark, false, &picture)?;
                wrong.extend(faults.into_iter().map(|f| format!("{name}, {window:?}, dark {dark}: {f}")));
            }
            let picture = out.join(format!("{name}-print{}.png", if dark { "-dark" } else { "" }));
            let faults = look(&mut browser, path, PAPER, dark, true, &picture)?;
            wrong.extend(faults.into_iter().map(|f| format!("{name}, on paper, dark {dark}: {f}")));
        }
        let pages = browser.print(&out.join(format!("{name}.pdf")))?;
        println!("{name}: {pages} pages of paper");
        let most = PAGES.iter().find(|(of, _)| name.starts_with(of)).map_or(usize::MAX, |(_, most)| *most);
        if pages > most {
            wrong.push(format!("{name}: {pages} pages of paper, {most} at the most"));
        }
    }
    for name in ["fit", "diagnose-p10", "place", "map"] {
        let path = reports.iter().find(|(of, _)| *of == name).map(|(_, path)| path).ok_or("no such report")?;
        wrong.extend(used(&mut browser, path)?.into_iter().map(|f| format!("{name}, used: {f}")));
    }
    wrong.extend(unseen(&mut browser, &reports[0].1, &out)?);
    wrong.extend(view::look(&mut browser, &out)?);
    if options.iter().any(|option| option == "--gallery") {
        gallery(&mut browser, &reports, &out)?;
    }
    if wrong.is_empty() {
        println!("{} reports are whole; pictures of them are in {}", reports.len(), out.display());
        return Ok(());
    }
    Err(wrong.join("\n"))
}

/// Opens a page, takes its picture, and says what is wrong with it.
fn look(
    browser: &mut Browser,
    path: &Path,
    window: [u32; 2],
    dark: bool,
    paper: bool,
    picture: &Path,
) -> Result<Vec<String>, String> {
    browser.open(path, window, dark, paper)?;
    let mut wrong = browser.sentences(PALE, &format!("{CONTRAST}, '{TEXT}'"))?;
    wrong.extend(browser.sentences(CHECKS, &format!("{paper}, {}", window[0]))?);
    if !paper {
        wrong.extend(browser.sentences(axe::JUDGE, "")?);
    }
    wrong.extend(browser.complaints());
    browser.picture(picture)?;
    Ok(wrong)
}

/// What does not work of the page's script: by keys and clicks, as a reader uses it.
fn used(browser: &mut Browser, path: &Path) -> Result<Vec<String>, String> {
    browser.open(path, WINDOWS[0], false, false)?;
    let mut wrong = browser.sentences(USE, "")?;
    wrong.extend(browser.complaints());
    Ok(wrong)
}

/// Pictures of how reports begin, for docs/gallery.md.
fn gallery(browser: &mut Browser, reports: &[(&str, PathBuf)], out: &Path) -> Outcome {
    let folder = root().join("docs/gallery");
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    for (name, path) in reports.iter().filter(|(name, _)| GALLERY.contains(name)) {
        // names of files without the folders of this machine
        let html = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
        let shown = out.join("gallery.html");
        let html = html.replace(&format!("{}/", root().display()), "");
        std::fs::write(&shown, html).map_err(|e| e.to_string())?;
        browser.open(&shown, GALLERY_WINDOW, false, false)?;
        browser.first_screen(&folder.join(format!("{name}.webp")), GALLERY_WINDOW, GALLERY_SCALE)?;
    }
    view::picture(browser, &out.join("view.html"))?;
    println!("wrote docs/gallery and docs/view.webp");
    Ok(())
}

/// Mutants that the checks miss.
fn unseen(browser: &mut Browser, report: &Path, out: &Path) -> Result<Vec<String>, String> {
    let html = std::fs::read_to_string(report).map_err(|e| e.to_string())?;
    let path = out.join("planted.html");
    let mut unseen = Vec::new();
    for (what, from, to, paper) in PLANTED {
        let spoilt = html.replacen(from, to, 1);
        std::fs::write(&path, &spoilt).map_err(|e| e.to_string())?;
        let window = if paper { PAPER } else { WINDOWS[1] };
        let faults = look(browser, &path, window, false, paper, &out.join("planted.png"))?;
        if spoilt == html || faults.is_empty() {
            unseen.push(format!("planted, and not seen: {what}"));
        }
    }
    Ok(unseen)
}

/// Writes the reports of the fixtures: names and where they are.
fn write(out: &Path) -> Result<Vec<(&'static str, PathBuf)>, String> {
    std::fs::create_dir_all(out).map_err(|e| e.to_string())?;
    let fixture = |name: &str| root().join("fixtures").join(name);
    let diagonal = out.join("k-diagonal.csv");
    std::fs::write(&diagonal, principal_alone(&fixture("stiffness/fe-l49.csv"))?).map_err(|e| e.to_string())?;
    let poses = out.join("poses.csv");
    std::fs::write(&poses, "pose,theta_deg,sigma_deg,z0_mm\na,0,0,530\nb,5,-3,520\n").map_err(|e| e.to_string())?;
    let folder = |name: &str| out.join(name);

    let run = |args: &[&str], out: &Path| {
        let out = format!("--out={}", out.display());
        cli::run(args.iter().copied().chain([out.as_str()])).map(drop).map_err(|e| e.to_string())
    };
    let option = |name: &str, path: &Path| format!("--{name}={}", path.display());
    run(&["fit"], &folder("fit"))?;
    run(&["fit", "--terms=full"], &folder("fit-full"))?;
    run(&["fit", &option("data", &diagonal)], &folder("fit-diagonal"))?;
    // of one machine, before limb 2 was repaired and after
    for (name, set) in [("p10", "p10"), ("worn", "own-limb-2-axial-easy"), ("repaired", "own-none-1")] {
        let part = |what: &str, name: &str| option(what, &fixture(&format!("measured/{set}/{name}")));
        let files = [part("machine", "machine.toml"), part("data", "measured.csv"), part("holdout", "heldout.csv")];
        let [machine, data, others] = files.each_ref().map(String::as_str);
        run(&["diagnose", machine, data, others], &folder(&format!("diagnose-{name}")))?;
    }
    let document = |what: &str, name: &str| option(what, &folder(&format!("diagnose-{name}")));
    run(&["verify", &document("before", "worn"), &document("after", "repaired")], &folder("verify"))?;
    let table = option("table", &fixture("jobs/wide-table.json"));
    run(&["place", &table, "--step-mm=5", "--step-deg=5", "--seed=1"], &folder("place"))?;
    run(&["map", &table], &folder("map"))?;
    let path = option("path", &fixture("jobs/path.ngc"));
    run(&["compensate", &table, &path], &folder("compensate").join("path.ngc"))?;
    let poses = option("poses", &poses);
    run(&["replay", &option("log", &fixture("logs/worn-drive.csv"))], &folder("replay"))?;
    let unloaded = |what: &str, name: &str| option(what, &fixture(&format!("unloaded/five/{name}")));
    run(
        &["diagnose", "--unloaded", &unloaded("data", "unloaded.csv"), &unloaded("holdout", "heldout.csv")],
        &folder("geometry"),
    )?;
    run(&["fem", &poses, "--mesh=3", "--jobs=1"], &out.join("fem.csv"))?;
    run(&["fem", &poses, "--mesh=3", "--jobs=1", "--dry-run"], &out.join("fem-dry.csv"))?;
    let of_folder = [
        "fit",
        "fit-full",
        "fit-diagonal",
        "diagnose-worn",
        "diagnose-p10",
        "verify",
        "place",
        "map",
        "compensate",
        "replay",
        "geometry",
    ];
    let mut all: Vec<_> = of_folder.iter().map(|name| (*name, folder(name).join("report.html"))).collect();
    run(&["demo"], &folder("demo"))?;
    all.push(("demo", folder("demo").join("index.html")));
    all.extend([("fem", folder("fem.html")), ("fem-dry", folder("fem-dry.drawing.html"))]);
    Ok(all)
}

/// A stiffness file without couplings.
fn principal_alone(path: &Path) -> Result<String, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("{}: {e}", path.display()))?;
    let rows: Vec<Vec<&str>> = text.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').collect()).collect();
    let taken = |i: usize| {
        let name: Vec<char> = rows[0][i].chars().collect();
        name[0] != 'k' || name[1] == name[2]
    };
    let line = |row: &Vec<&str>| (0..row.len()).filter(|i| taken(*i)).map(|i| row[i]).collect::<Vec<_>>().join(",");
    Ok(rows.iter().map(|row| line(row) + "\n").collect())
}
