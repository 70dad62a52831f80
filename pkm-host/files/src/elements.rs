//! `[[element]]` tables of the machine file, read and written.

use std::collections::BTreeMap;
use std::ops::Range;

use pkm_core::effects::{Element, Law, MAX_ELEMENTS, Place};
use serde::Deserialize;
use toml::Spanned;
use toml_edit::{ArrayOfTables, Table, value};

use crate::error::clipped;
use crate::toml_error::{float, place_of};

/// A table as it stands in the file.
#[derive(Deserialize)]
pub struct RawElement {
    place: Spanned<String>,
    motion: Spanned<String>,
    law: Spanned<String>,
    #[serde(flatten)]
    parameters: BTreeMap<String, toml::Value>,
}

/// The key, where it stands, and what is wrong with it.
type Misplaced = (String, Range<usize>, String);

/// The elements in the order of the file.
///
/// # Errors
/// A place, motion or law that is unknown or does not fit to the others; a parameter that the law does not have; too many.
pub fn elements(text: &str, raw: &[Spanned<RawElement>]) -> Result<[Option<Element>; MAX_ELEMENTS], Misplaced> {
    let mut elements = [None; MAX_ELEMENTS];
    for (i, raw) in raw.iter().enumerate() {
        let Some(slot) = elements.get_mut(i) else {
            return Err(("element".into(), raw.span(), format!("expected at most {MAX_ELEMENTS} of them")));
        };
        *slot = Some(element(text, raw).map_err(|(key, span, message)| (format!("element.{key}"), span, message))?);
    }
    Ok(elements)
}

fn element(text: &str, raw: &Spanned<RawElement>) -> Result<Element, Misplaced> {
    let RawElement { place, motion, law, parameters } = raw.get_ref();
    let unknown = |key: &str, found: &Spanned<String>, known: &[&str]| {
        let message = format!("expected one of {}, found `{}`", known.join(", "), clipped(found.get_ref()));
        (key.to_owned(), found.span(), message)
    };
    let places: Vec<_> = Place::ALL.iter().filter_map(|place| place.name()).collect();
    let of_place = Place::from_name(place.get_ref()).ok_or_else(|| unknown("place", place, &places))?;
    let motions: Vec<_> = of_place.motions().iter().map(|motion| motion.name()).collect();
    if !motions.contains(&motion.get_ref().as_str()) {
        return Err(unknown("motion", motion, &motions));
    }
    let laws = Law::ALL.map(Law::name);
    let possible = |law: &str| Element::from_names(place.get_ref(), motion.get_ref(), law, []);
    let Some(mut element) = possible(law.get_ref()) else {
        let laws: Vec<_> = laws.into_iter().filter(|law| possible(law).is_some()).collect();
        return Err(unknown("law", law, &laws));
    };
    let known = element.parameter_names();
    for (name, number) in parameters {
        let span = place_of(text, raw.span(), name);
        let Some(parameter) = known.iter().position(|known| known == name) else {
            let message = format!("unknown parameter; known are {}", known.join(", "));
            return Err((name.clone(), span, message));
        };
        element.parameters[parameter] = float(number).ok_or_else(|| {
            let found = clipped(&number.to_string());
            (name.clone(), span, format!("expected a number, found {found}"))
        })?;
    }
    if parameters.is_empty() {
        let message = format!("expected at least one of the parameters {}", known.join(", "));
        return Err(("law".into(), law.span(), message));
    }
    Ok(element)
}

/// A parameter of an element that was read: its key, where it stands, and its value.
pub fn locate(text: &str, raw: &Spanned<RawElement>, parameter: usize) -> (String, Range<usize>, f64) {
    let name = element(text, raw).ok().and_then(|element| element.parameter_names().get(parameter).copied());
    let name = name.unwrap_or("law");
    let number = raw.get_ref().parameters.get(name).and_then(float);
    (format!("element.{name}"), place_of(text, raw.span(), name), number.unwrap_or(0.0))
}

/// The tables of elements, for a file; `None` when there are none.
pub fn tables(elements: &[Option<Element>; MAX_ELEMENTS]) -> Option<ArrayOfTables> {
    let mut tables = ArrayOfTables::new();
    for element in elements.iter().flatten() {
        let mut table = Table::new();
        table["place"] = value(element.place.name().unwrap_or_default());
        table["motion"] = value(element.motion.name());
        table["law"] = value(element.law.name());
        let parameters = element.parameter_names().iter().zip(element.parameters);
        for (i, (name, number)) in parameters.enumerate() {
            // a table without any parameter would be refused
            if i == 0 || number != 0.0 {
                table[*name] = value(number);
            }
        }
        tables.push(table);
    }
    (!tables.is_empty()).then_some(tables)
}

#[cfg(test)]
mod tests {
    use pkm_core::effects::Effects;

    use super::*;
    use crate::machine::MachineFile;
    use crate::source::Source;

    #[test]
    fn what_is_written_is_read_again() {
        let mut effects = Effects::NONE;
        for (place, motion, law, parameters) in [
            ("limb.1.base_joint", "tilting", "extension", [1e-7, -2e-8, 3e-9, 0.55, 0.0, 0.0]),
            ("limb.2.body", "axial", "load", [0.0, 1e-13, 0.0, 0.0, 2e-6, 40.0]),
            ("limb.3.platform_joint", "axial", "direction", [0.0, 1e-9, 20.0, 0.0, 0.0, 0.0]),
            ("limb.3.body", "torsion", "periodic", [0.0, 1e-7, 0.01, -0.5, 0.0, 0.0]),
            ("moving_platform", "w", "constant", [-1e-10, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ("base", "rx", "temperature", [1e-10, 0.0, 0.0, 0.0, 0.0, 0.0]),
            ("tool", "u", "constant", [3e-10, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ] {
            effects = effects.with_element(place, motion, law, parameters).unwrap();
        }
        effects = effects.with_element("base", "coupled", "constant", [1e-10, 0.5, 0.0, -1.0, 0.25]).unwrap();
        let mut document: toml_edit::DocumentMut =
            Source::embedded(pkm_fixtures::MACHINE).text().unwrap().parse().unwrap();
        document["element"] = toml_edit::Item::ArrayOfTables(tables(&effects.elements).unwrap());
        let read = MachineFile::parse(Source::from_text("m.toml", document.to_string())).unwrap();
        assert_eq!(read.parameters.effects, effects);
        assert!(tables(&Effects::NONE.elements).is_none());
    }
}
