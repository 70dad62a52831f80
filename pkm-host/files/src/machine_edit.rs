//! Changes of a machine file for one run, `key.key=value`.

use crate::error::{Failure, Result};
use crate::machine::MachineFile;
use crate::source::Source;
use crate::toml_error::plain;

/// Sets the value of a key; tables on the way come into being, `[[limb]]` is counted from 1.
fn put(
    table: &mut dyn toml_edit::TableLike,
    keys: &[&str],
    value: toml_edit::Value,
) -> std::result::Result<(), String> {
    match keys {
        [] => Err("expected the key of a value".into()),
        [key] => {
            table.insert(key, toml_edit::Item::Value(value));
            Ok(())
        }
        [key, number, rest @ ..] if table.get(key).is_some_and(toml_edit::Item::is_array_of_tables) => {
            let tables = table.get_mut(key).and_then(toml_edit::Item::as_array_of_tables_mut);
            let at = number.parse::<usize>().ok().and_then(|n| n.checked_sub(1));
            match tables.zip(at).and_then(|(tables, at)| tables.get_mut(at)) {
                Some(table) => put(table, rest, value),
                None => Err(format!("there is no {key}.{number}: they count from 1")),
            }
        }
        [key, rest @ ..] => match table.entry(key).or_insert(toml_edit::table()).as_table_like_mut() {
            Some(table) => put(table, rest, value),
            None => Err(format!("{key} is a value, it has no keys")),
        },
    }
}

/// The machine file with what `--set` says.
///
/// # Errors
/// A bad file, key or value.
pub fn changed(source: Source, set: &[String]) -> Result<Source> {
    if set.is_empty() {
        return Ok(source);
    }
    // what is wrong with the file itself is better told of the file itself
    MachineFile::parse(source.clone())?;
    let fail = |message: String| Failure::usage(format!("--set: {message}"));
    let document = source.text()?.parse::<toml_edit::DocumentMut>();
    let mut document = document.map_err(|e| fail(plain(e.message())))?;
    for change in set {
        let Some((path, value)) = change.split_once('=').map(|(p, v)| (p.trim(), v.trim())) else {
            return Err(fail(format!("expected key.key=value, found `{change}`")));
        };
        let word = !value.is_empty() && value.chars().all(|c| c.is_ascii_alphabetic());
        let value = match value.parse::<toml_edit::Value>() {
            Ok(value) => value,
            Err(_) if word => value.into(),
            Err(_) => return Err(fail(format!("{path}: expected a number, a word or an array, found `{value}`"))),
        };
        let keys: Vec<&str> = path.split('.').collect();
        put(document.as_table_mut(), &keys, value).map_err(|m| fail(format!("{path}: {m}")))?;
    }
    Ok(Source::from_text(&format!("{} with --set", source.name), document.to_string()))
}
