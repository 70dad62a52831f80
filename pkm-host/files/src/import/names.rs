//! What the columns of a file are called, as others write it, and the units that stand beside their names.

use super::columns::{COLUMNS, Column, LOAD_LOG, LOGGED, POINT_LIST, TIMED};
use super::units::Quantity::{self, Ratio, Time};
use super::units::{self, Unit};
use crate::dataset::READ_COLUMNS;
use crate::error::{Failure, Result, printable};

/// A column of a file that is known by its name.
struct Named {
    column: &'static Column,
    /// What the header says of its unit.
    unit: Option<String>,
    /// Whether the name has the column's own unit, as `dx_um`.
    is_in_own_unit: bool,
}

/// Small letters, without what separates words.
fn plain(name: &str) -> String {
    let letter = |c: char| match c {
        'µ' | 'μ' => 'u',
        '∆' => 'δ',
        c => c,
    };
    let skipped = |c: &char| !c.is_whitespace() && !"_-.,:()".contains(*c);
    name.chars().filter(skipped).map(letter).collect::<String>().to_lowercase()
}

/// A name and the unit behind it: `dx [µm]`, `Fx (kN)`, `Fx in kN`, `dx / mm`, `dx, mm`, `dx mm`.
pub fn split_unit(cell: &str) -> (&str, Option<&str>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((name, unit)) = cell.strip_suffix(close).and_then(|c| c.rsplit_once(open)) {
            return (name.trim(), Some(unit.trim()));
        }
    }
    let separators = [" in ", "/", ",", " "];
    let parts = separators.iter().filter_map(|s| cell.rsplit_once(s));
    parts
        .map(|(name, unit)| (name.trim(), unit.trim()))
        .find(|(_, unit)| units::is_any(unit))
        .map_or((cell, None), |(name, unit)| (name, Some(unit)))
}

/// Of a column whose name the user gives, also behind `_`: `Kraft_kN`. What brackets hold is part of the name where it is an axis or the name
/// of a channel: `Weg (X)`, `Weg [LVDT1]`.
fn unit_of_renamed(cell: &str) -> Option<&str> {
    let is_channel = |text: &str| {
        let is_name = text.starts_with(char::is_alphabetic) && text.ends_with(|c: char| c.is_ascii_digit());
        ["x", "y", "z"].contains(&text.to_lowercase().as_str()) || (is_name && text.chars().all(char::is_alphanumeric))
    };
    let behind = || cell.rsplit_once('_').map(|(_, unit)| unit).filter(|unit| units::is_any(unit));
    split_unit(cell).1.filter(|text| units::is_any(text) || !is_channel(text)).or_else(behind)
}

const SIGNS: [char; 3] = ['-', '\u{2212}', '–'];

/// Whether a name stands behind a sign or before one: `-Fz [N]`, `Fz- [N]`.
fn has_sign(cell: &str) -> bool {
    let (name, _) = split_unit(cell);
    name.starts_with(SIGNS) || name.ends_with(SIGNS)
}

/// The columns that a file may have, and what they are called there.
pub struct Names<'a> {
    /// In the order in which they are written.
    pub columns: &'static [Column],
    renames: &'a Renames,
}

impl<'a> Names<'a> {
    /// Of measured data.
    pub fn of_readings(renames: &'a Renames) -> Self {
        Self { columns: COLUMNS, renames }
    }

    /// Of readings whose load a log has.
    pub fn of_timed(renames: &'a Renames) -> Self {
        Self { columns: &TIMED, renames }
    }

    /// Of a controller's log.
    pub fn of_controller_log(renames: &'a Renames) -> Self {
        Self { columns: &LOGGED, renames }
    }

    /// Of a load cell's log.
    pub fn of_load_log(renames: &'a Renames) -> Self {
        Self { columns: LOAD_LOG, renames }
    }

    /// Of a tracker's list of points.
    pub fn of_points(renames: &'a Renames) -> Self {
        Self { columns: POINT_LIST, renames }
    }

    /// The names as `docs/formats.md` has them.
    pub fn own(&self) -> Vec<&'static str> {
        self.columns.iter().map(|c| c.name).collect()
    }

    /// The column that a cell of the header was said to be.
    fn renamed(&self, cell: &str) -> Option<&'static Column> {
        let is = |theirs: &str| plain(theirs) == plain(cell) || plain(theirs) == plain(split_unit(cell).0);
        let (new, _) = self.renames.0.iter().find(|(_, theirs)| is(theirs))?;
        self.columns.iter().find(|c| c.name == *new)
    }

    /// What a name in a header means, if it is known.
    fn named(&self, cell: &str) -> Option<Named> {
        let of = |name: &str, unit: Option<&str>| {
            let name = plain(name);
            let column = self.columns.iter().find(|c| plain(c.name) == name || c.others.contains(&name.as_str()))?;
            // `Load [N]` is no name of a load
            let is_known = column.is_number() || !unit.is_some_and(units::is_any);
            let is_in_own_unit = column.quantity == Ratio || (column.is_number() && plain(column.name) == name);
            is_known.then(|| Named { column, unit: unit.map(str::to_owned), is_in_own_unit })
        };
        of(cell, None).or_else(|| {
            let (name, unit) = split_unit(cell);
            of(name, unit)
        })
    }

    /// Why columns of repeats beside each other are refused: `dx [µm]` and `dx 2 [µm]`, `dx_um` and `dx_um.1`.
    pub fn side_by_side(&self, header: &[String]) -> Option<Failure> {
        let column_of = |cell: &String| {
            let name = split_unit(cell).0.trim_end_matches(|c: char| c.is_ascii_digit() || " ._-#".contains(c));
            let column = self.named(name).map(|named| named.column)?;
            (!self.is_known(cell) && READ_COLUMNS.contains(&column.name)).then_some(column)
        };
        let (cell, column) = header.iter().find_map(|cell| Some((cell, column_of(cell)?)))?;
        let message = format!(
            "is `{}` a repeat of {}? Each repeat needs a row of its own; the only one of a row is named by --columns",
            printable(cell),
            column.name
        );
        Some(Failure::input(message).at_column(cell))
    }

    /// The column of numbers that a name with a sign is of: `-Fz [N]`, `Fz- [N]`.
    fn negated(&self, cell: &str) -> Option<&'static Column> {
        let (name, _) = split_unit(cell);
        let bare = name.trim_matches(|c: char| c.is_whitespace() || SIGNS.contains(&c));
        let column = self.named(bare).map(|named| named.column)?;
        (has_sign(cell) && column.is_number()).then_some(column)
    }

    /// Why a name with a sign is refused, of a column that `--columns` names or of another.
    fn sign_in_doubt(&self, cell: &str, is_renamed: bool) -> Option<String> {
        if is_renamed {
            let is_in_doubt = has_sign(cell) && !self.renamed_with_sign(cell);
            return is_in_doubt.then(|| {
                "a sign before a name that --columns has without: write the name there as it stands here, or remove the sign and multiply the \
                 numbers by -1"
                    .to_owned()
            });
        }
        let name = self.negated(cell)?.name;
        Some(format!(
            "a sign before a name: are these numbers those of {name} with the other sign? Multiply them by -1 and remove the sign, or say \
             --columns {name}={cell} where they are not"
        ))
    }

    /// Whether `--columns` has a cell's name with its sign.
    fn renamed_with_sign(&self, cell: &str) -> bool {
        let with_sign = |theirs: &str| has_sign(theirs) && plain(split_unit(theirs).0) == plain(split_unit(cell).0);
        self.renames.0.iter().any(|(_, theirs)| with_sign(theirs))
    }

    /// Which columns of a header hold numbers that are used.
    pub fn number_columns(&self, header: &[String]) -> Vec<usize> {
        let is_number = |cell: &str| {
            let column = self.renamed(cell).or_else(|| self.named(cell).map(|n| n.column));
            column.is_some_and(Column::is_number)
        };
        (0..header.len()).filter(|n| is_number(&header[*n])).collect()
    }

    /// What a cell of the header is called in `docs/formats.md`, if it is known.
    pub fn own_name(&self, cell: &str) -> Option<&'static str> {
        self.renamed(cell).or_else(|| self.named(cell).map(|n| n.column)).map(|column| column.name)
    }

    /// Whether a name in a header is known.
    pub fn is_known(&self, cell: &str) -> bool {
        self.own_name(cell).is_some()
    }

    /// Refuses columns of `--columns` that are not there, or that have the name of another. A file with none of them that has the
    /// program's own names is another one of the same call, and needs no others: which these are is returned, to be said.
    ///
    /// # Errors
    /// The first of them, with the names that are there.
    pub fn require_renamed(&self, header: &[String]) -> Result<Option<String>> {
        let is_there = |new: &str| header.iter().any(|cell| self.renamed(cell).is_some_and(|c| c.name == new));
        let own = |new: &str| {
            let is =
                |cell: &&String| self.renamed(cell).is_none() && self.named(cell).is_some_and(|n| n.column.name == new);
            header.iter().find(is)
        };
        let renames = &self.renames.0;
        if let Some((new, _)) = renames.iter().find(|(new, _)| self.columns.iter().all(|c| c.name != *new)) {
            let of_points = POINT_LIST.iter().any(|c| c.name == *new);
            let other = if of_points { "a tracker's points" } else { "a load cell's log and its readings (--loads)" };
            let message = format!("--columns {new}=…: this file has no such column, only {other}");
            return Err(Failure::input(message));
        }
        if renames.iter().all(|(new, _)| own(new).is_some() && !is_there(new)) {
            let said: Vec<String> = renames
                .iter()
                .map(|(new, theirs)| format!("no column `{theirs}`: {new} is that of its own name"))
                .collect();
            return Ok((!said.is_empty()).then(|| format!("--columns: {}", said.join("; "))));
        }
        for (new, theirs) in renames.iter().filter(|(new, _)| is_there(new)) {
            if let Some(own) = own(new) {
                let message = format!(
                    "--columns says that `{theirs}` is {new}, and `{own}` is too: leave one of them out of the file"
                );
                return Err(Failure::input(message));
            }
        }
        match renames.iter().find(|(new, _)| !is_there(new)) {
            None => Ok(None),
            Some((new, theirs)) => {
                let there = header.iter().filter(|c| !c.is_empty()).cloned().collect::<Vec<_>>().join(", ");
                Err(Failure::input(format!("no column `{theirs}` for {new}: there are {there}")))
            }
        }
    }
}

/// Columns that are called otherwise: `new=theirs,…`.
#[derive(Clone, Debug, Default)]
pub struct Renames(Vec<(&'static str, String)>);

impl Renames {
    /// Those of readings, and those of a tracker's points.
    pub fn of_readings_and_points(&self) -> [Self; 2] {
        [self.of(COLUMNS), self.of(POINT_LIST)]
    }

    /// Those of readings with times, and those of a load cell's log.
    pub fn of_readings_and_log(&self) -> [Self; 2] {
        [self.of(&TIMED), self.of(LOAD_LOG)]
    }

    fn of(&self, columns: &[Column]) -> Self {
        let is_one = |(new, _): &&(&str, String)| columns.iter().any(|c| c.name == *new);
        Self(self.0.iter().filter(is_one).cloned().collect())
    }
}

impl std::str::FromStr for Renames {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let mut pairs: Vec<(&'static str, String)> = Vec::new();
        for part in text.split(',') {
            match part.split_once('=') {
                Some((new, theirs)) => {
                    let new = new.trim();
                    let all = TIMED.iter().chain(POINT_LIST).chain(LOAD_LOG);
                    let Some(column) = all.clone().find(|c| c.name == new) else {
                        let nearest = all.min_by_key(|c| strsim::osa_distance(&new.to_lowercase(), c.name));
                        let meant = nearest.map_or("", |c| c.name);
                        return Err(format!("`{new}` is no column of docs/formats.md: did you mean `{meant}`?"));
                    };
                    pairs.push((column.name, theirs.trim().to_owned()));
                }
                // a comma within their name
                None => match pairs.last_mut() {
                    Some((_, theirs)) => *theirs = format!("{theirs},{part}"),
                    None => return Err("expected new=theirs,… such as `dx_um=Weg X,fx_n=Kraft X`".into()),
                },
            }
        }
        match pairs.iter().find(|(_, theirs)| theirs.is_empty()) {
            Some((new, _)) => Err(format!("`{new}=`: what is the column called in the file?")),
            None => Ok(Self(pairs)),
        }
    }
}

/// How a column of a file is read.
pub struct Use {
    /// What it is.
    pub column: &'static Column,
    /// Its unit in the file; none of a text.
    pub unit: Option<&'static Unit>,
}

/// A column of the header, and what is wrong with it.
pub type Flaw = (String, String);

/// What the columns of a header are; `None` for those that are not used. `units` is the row of units, or empty.
pub fn uses(header: &[String], units: &[String], names: &Names<'_>) -> std::result::Result<Vec<Option<Use>>, Flaw> {
    let mut without_unit = Vec::new();
    let mut all = Vec::new();
    for (n, cell) in header.iter().enumerate() {
        let below = units.get(n).map(|u| u.trim_matches(['[', ']', '(', ')', ' '])).filter(|u| !is_blank_unit(u));
        let renamed = names.renamed(cell).map(|column| Named {
            column,
            unit: unit_of_renamed(cell).map(str::to_owned),
            is_in_own_unit: column.is_number(),
        });
        let is_renamed = renamed.is_some();
        let fail = |message: String| (cell.clone(), message);
        if let Some(message) = names.sign_in_doubt(cell, is_renamed) {
            return Err(fail(message));
        }
        // the program's own name goes before another name of the same
        let is_other = |n: &Named| cell != n.column.name && header.iter().any(|h| h == n.column.name);
        if !is_renamed
            && let Some(twin) = names.named(cell).filter(|n| is_other(n) && (n.unit.is_some() || n.is_in_own_unit))
        {
            return Err(fail(format!(
                "duplicate column: `{}` is there as well, leave out the one that is wrong",
                twin.column.name
            )));
        }
        let Some(named) = renamed.or_else(|| names.named(cell).filter(|n| !is_other(n))) else {
            all.push(None);
            continue;
        };
        let column = named.column;
        if column.quantity == Time && !named.is_in_own_unit {
            // a clock's time unless there is a unit: `Time (UTC)`, `Zeit [hh:mm:ss]`
            let unit = named.unit.as_deref().into_iter().chain(below).find_map(|text| units::find(Time, text));
            let column = if unit.is_some() { Some(column) } else { names.columns.iter().find(|c| c.name == "time") };
            all.push(column.map(|column| Use { column, unit }));
            continue;
        }
        let mut unit = None;
        for text in named.unit.as_deref().into_iter().chain(below).filter(|_| column.is_number()) {
            let found = column.unit_of(text).map_err(fail)?;
            let own = column.own_unit().filter(|_| named.is_in_own_unit && !is_renamed);
            if let Some(other) = unit.or(own).filter(|other: &&Unit| !std::ptr::eq(*other, found)) {
                return Err(fail(format!(
                    "{} or {}? Both are written: leave the right one",
                    other.name(),
                    found.name()
                )));
            }
            unit = Some(found);
        }
        if unit.is_none() && column.is_number() {
            if !named.is_in_own_unit {
                without_unit.push((cell, column));
            }
            unit = column.own_unit();
        }
        all.push(Some(Use { column, unit }));
    }
    match without_unit.first() {
        None => Ok(all),
        Some((first, column)) => {
            let cells: Vec<&str> = without_unit.iter().map(|(cell, _)| cell.as_str()).collect();
            let message = format!(
                "no unit of {}: write it in brackets, `{first} [{}]`, or in a row of units below the header, or say \
                 --columns {}={first} where it is in {}",
                cells.join(", "),
                column.unit,
                column.name,
                column.unit
            );
            Err(((*first).clone(), message))
        }
    }
}

/// The first column that is not used and that has a unit of some quantity, beside its name or in a row of units.
pub fn unused_of<'h>(header: &'h [String], units: &[String], names: &Names<'_>, quantity: Quantity) -> Option<&'h str> {
    let is_of = |text: &str| units::find(quantity, text).is_some();
    let has_unit = |(n, cell): (usize, &String)| {
        split_unit(cell).1.is_some_and(is_of) || units.get(n).is_some_and(|text| is_of(text))
    };
    let mut unused = header.iter().enumerate().filter(|(_, cell)| !names.is_known(cell));
    unused.find(|column| has_unit(*column)).map(|(_, cell)| cell.as_str())
}

/// What stands in a row of units below a column that has none.
pub fn is_blank_unit(text: &str) -> bool {
    text.is_empty() || text.chars().all(|c| "-–—".contains(c))
}
