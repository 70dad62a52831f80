//! What the page is given: numbers for the core, and names, sizes and results for people.

use pkm_core::effects::EFFECTS;
use pkm_view::{
    ANSWER, EFFECTS_AT, ELEMENT_NUMBERS, ELEMENTS_AT, FORM, MACHINE_NUMBERS, TABLE_NUMBERS, numbers_of, write_machine,
};
use serde_json::{Value, json};

use super::{SWEPT_POSES, Shown, core_sha256};
use crate::files::machine::MachineFile;
use crate::files::solid::{LimbSolid, Plate};
use crate::plan::model::{Model, Table};
use crate::plan::play::PlayedPoint;

/// The machine in the core's row of numbers.
pub(super) fn machine_numbers(file: &MachineFile) -> [f64; MACHINE_NUMBERS] {
    let [theta, sigma, z0] = file.pose_box.ranges();
    let pose_box = [theta.map(f64::to_radians), sigma.map(f64::to_radians), z0.map(|mm| mm / 1e3)];
    write_machine(&file.parameters, &file.wrist_parameters, &pose_box)
}

/// A table in the core's row of numbers.
pub(super) fn table_numbers(table: &Table) -> Box<[f64; TABLE_NUMBERS]> {
    let numbers = &table.numbers;
    let exponents = numbers.terms.iter().flatten().map(|e| f64::from(*e));
    let all = (numbers.centre.iter().chain(&numbers.half_width).copied())
        .chain([numbers.terms.len() as f64])
        .chain(exponents)
        .chain(numbers.diagonal.iter().copied())
        .chain([if numbers.factor.is_some() { 1.0 } else { 0.0 }])
        .chain(numbers.factor.iter().flatten().copied());
    let mut row = Box::new([0.0; TABLE_NUMBERS]);
    for (to, value) in row.iter_mut().zip(all) {
        *to = value;
    }
    row
}

/// Sizes for the picture, m.
fn drawing(file: &MachineFile) -> Value {
    let limbs = (0..3).map(|i| {
        let body = &file.parameters.limbs[i].body;
        let solid = file.solid.as_ref().ok().map(|s| s.limbs[i]);
        match solid {
            Some(LimbSolid::Telescopic(t)) => json!({
                "tube": t.tube.outer_m, "tube_length": t.tube_m, "behind": t.behind_m,
                "ram": t.ram.outer_m, "ram_length": t.ram_m, "screw": t.screw.outer_m }),
            _ => json!({ "tube": body.rod.outer_m, "screw": body.screw.outer_m }),
        }
    });
    let plate = |plate: Option<Plate>| {
        plate.map(|p| json!({ "thickness": p.thickness_m, "hub": p.hub_m, "rim": p.rim_m, "bore": p.bore_m }))
    };
    let solid = file.solid.as_ref().ok();
    json!({ "limbs": limbs.collect::<Vec<_>>(),
        "platform": plate(solid.and_then(|s| s.platform)), "base": plate(solid.and_then(|s| s.base)) })
}

fn machine(file: &MachineFile, numbers: &[f64]) -> Value {
    let wrist = &file.wrist_parameters;
    let elements: Vec<Value> = (file.parameters.effects.elements.iter().flatten())
        .map(|e| {
            json!({ "place": e.place.name(), "motion": e.motion.name(), "law": e.law.name(), "parameters": e.parameter_names() })
        })
        .collect();
    json!({
        "name": file.name, "file": file.source.file_name(), "sha256": file.source.sha256(),
        "numbers": numbers, "box": file.pose_box, "elements": elements, "drawing": drawing(file),
        "travel_m": [file.parameters.travel.min_m, file.parameters.travel.max_m],
        "wrist_rad": [wrist.min_rad, wrist.max_rad],
        "home": [0.0, 0.0, wrist.home_z0_m, 0.0, 0.0], "margin": wrist.singularity_margin,
    })
}

fn table(table: &Table, numbers: &[f64]) -> Value {
    json!({ "file": table.source.file_name(), "sha256": table.source.sha256(), "box": table.pose_box,
        "has_factor": table.numbers.factor.is_some(), "numbers": numbers })
}

fn point(point: &PlayedPoint) -> Value {
    let wrench: [f64; 6] = point.wrench.to_vector().into();
    json!([point.line, u8::from(point.is_rapid), numbers_of(&point.configuration), wrench])
}

/// All that the page is given.
pub(super) fn document(
    model: &Model,
    numbers: &[f64],
    table_numbers: Option<&[f64; TABLE_NUMBERS]>,
    shown: &Shown,
    checksum: &str,
    warnings: &[String],
) -> Value {
    let effects: Vec<Value> = (EFFECTS.iter())
        .map(|e| json!({ "id": e.id, "parameters": e.names().collect::<Vec<_>>(), "signed": e.signed }))
        .collect();
    let path = shown
        .path
        .as_ref()
        .map(|path| json!({ "name": path.name, "points": path.points.iter().map(point).collect::<Vec<_>>() }));
    json!({
        "program": concat!("pkm-host ", env!("CARGO_PKG_VERSION")), "core_sha256": core_sha256(),
        "machine": machine(&model.machine, numbers),
        "table": model.table.as_ref().zip(table_numbers).map(|(t, numbers)| table(t, numbers)),
        "layout": { "answer": ANSWER, "form": FORM, "effects": EFFECTS_AT, "elements": ELEMENTS_AT,
            "element_numbers": ELEMENT_NUMBERS },
        "effects": effects,
        "checksum": { "poses": SWEPT_POSES, "value": checksum },
        "diagnosis": shown.diagnosis, "placement": shown.placement, "path": path,
        "warnings": warnings,
    })
}
