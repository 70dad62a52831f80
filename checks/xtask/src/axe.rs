//! Accessibility, judged by axe-core from npm.

use std::path::Path;
use std::process::Command;

use serde_json::json;

use crate::browser::Browser;
use crate::{Outcome, output};

const PACKAGE: &str = "axe-core@4.12.1";

/// In the page, unfolded: what breaks a rule of axe-core, as sentences.
pub const JUDGE: &str = "async () => {
  const folded = [...document.querySelectorAll('details:not([open])')];
  folded.forEach(e => e.open = true);
  const { violations } = await axe.run(document, { resultTypes: ['violations'] });
  folded.forEach(e => e.open = false);
  return violations.flatMap(v => v.nodes.map(node => `axe-core, ${v.id}: ${node.target.join(' ')}`));
}";

/// Gives every page that is opened from now on the judge.
pub fn install(browser: &mut Browser, out: &Path) -> Outcome {
    let folder = out.join("npm");
    let options = ["--no-save", "--ignore-scripts", "--no-audit", "--no-fund", "--silent", "--prefer-offline"];
    let mut npm = Command::new("npm");
    output(npm.args(["install", PACKAGE, "--prefix"]).arg(&folder).args(options))
        .map_err(|e| format!("{e}\napt-get install --no-install-recommends npm"))?;
    let script = folder.join("node_modules/axe-core/axe.min.js");
    let script = std::fs::read_to_string(&script).map_err(|e| format!("{}: {e}", script.display()))?;
    browser.call("Page.addScriptToEvaluateOnNewDocument", json!({ "source": script })).map(drop)
}
