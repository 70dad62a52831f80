//! Files of an identification: the machine with its true geometry, and the residuals of all readings.

use toml_edit::{DocumentMut, Item, value};

use super::model::{CHANNELS, Meaning};
use super::outcome::Identification;
use crate::diagnose::write::set;
use crate::error::{Failure, Result};
use crate::files::dataset::to_csv;
use crate::files::machine::MachineFile;
use crate::files::unloaded::{AT_COLUMNS, DISTANCE_COLUMN, Unloaded};

/// Decimals of mm that are written: a thousandth of what can be measured.
const DECIMALS: f64 = 1e6;

/// The machine file with the identified geometry in `[geometry]` and `[wrist]`, from which the core's kinematics are made; all
/// else as it stood. Effects that say that the true sizes are others than these go. Zeros of the drives are set on the controller
/// and stand in a comment.
///
/// # Errors
/// None for a file that was read before.
pub fn machine_toml(file: &MachineFile, found: &Identification) -> Result<String> {
    let poses = found.size.1;
    if !found.is_of_use() {
        let as_declared = file.source.text()?;
        return Ok(format!(
            "# Geometry as declared: what diagnose --unloaded identified, {poses} poses, predicts no better.\n{as_declared}"
        ));
    }
    let mut document: DocumentMut =
        file.source.text()?.parse().map_err(|e: toml_edit::TomlError| Failure::other(e.to_string()))?;
    for e in &found.estimates {
        let mm = (1e3 * e.held * DECIMALS).round() / DECIMALS;
        let key = e.meaning.key();
        match e.meaning {
            Meaning::Size(_) | Meaning::Wrist(_) => {
                let mut item = document.as_item_mut();
                for part in key.split('.') {
                    item = &mut item[part];
                }
                if item.is_none() {
                    *item = value(mm);
                } else {
                    set(item, mm);
                }
            }
            _ => {}
        }
    }
    if let Some(effects) = document.get_mut("effect").and_then(Item::as_array_of_tables_mut) {
        effects.retain(|e| !e.get("id").and_then(Item::as_str).is_some_and(|id| id.starts_with("geometry-")));
        if effects.is_empty() {
            document.remove("effect");
        }
    }
    let mut comment = format!("# Geometry identified by diagnose --unloaded, {poses} poses.\n");
    comment
        .push_str("# It holds with these additions to the positions of the drives (true position less commanded):\n");
    for (name, e) in found.zeros() {
        comment.push_str(&format!("#   {name}: {:+.4} {} (sd {:.4})\n", 1e3 * e.held, e.unit(), 1e3 * e.sd));
    }
    Ok(comment + &document.to_string())
}

/// What declared and identified geometry leave of every number that was read, in mm and µm.
pub fn residuals_csv(unloaded: &Unloaded, found: &Identification) -> String {
    let header = ["line", "pose", "target", "column", "read_mm", "declared_um", "residual_um", "sd_um", "standardised"];
    let columns = [AT_COLUMNS[0], AT_COLUMNS[1], AT_COLUMNS[2], DISTANCE_COLUMN];
    let mut rows = Vec::new();
    for (n, r) in found.kept(unloaded).enumerate() {
        let sight = unloaded.sights[r.sight];
        for c in 0..CHANNELS {
            let Some(read) = r.observed[c] else { continue };
            let (before, after) = (read - found.said_declared_m[n][c], read - found.said_m[n][c]);
            let sd = found.sd_m[n][c];
            let numbers = [read * 1e3, before * 1e6, after * 1e6, sd * 1e6, after / sd].map(|v| format!("{v:.6}"));
            let (pose, target) = (&unloaded.poses[sight.pose].named.id, &unloaded.targets[sight.target].name);
            let names = [r.line.to_string(), pose.clone(), target.clone(), columns[c].to_owned()];
            rows.push([&names[..], &numbers].concat());
        }
    }
    to_csv(b',', &header.map(str::to_owned), rows)
}
