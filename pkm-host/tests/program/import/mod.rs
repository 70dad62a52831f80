//! Measured data as laboratories and shops export them: each file is read with exactly the right numbers, or refused with one
//! message that says where and what to do.

mod check;
mod refused;
pub mod table;

use pkm_host::files::import::COLUMNS;
use pkm_tests::seeded;
use rayon::prelude::*;

use self::table::{HEADER, Table, good, marked, utf16, windows};
use crate::common::{Folder, fixture, json, run};

/// What it is, the file, arguments beside it, and words of what is said, with `|` between.
type Case = (&'static str, fn() -> Vec<u8>, &'static [&'static str], &'static str);

/// Cells of a text file.
pub fn cells(text: &str) -> Table {
    let mut lines = text.lines().map(|l| l.split(',').map(str::to_owned).collect::<Vec<_>>());
    Table { header: lines.next().unwrap(), rows: lines.collect() }
}

/// Columns that are not the same bits: their unit is no power of ten of the column's.
fn tolerance(column: &str, what: &str) -> f64 {
    let is_turned =
        what.contains("radians") && column.ends_with("_deg") || what.contains("degrees") && column.ends_with("urad");
    if is_turned { 1e-12 } else { 0.0 }
}

/// Imports a file; what it wrote, and what it said.
fn imported(bytes: &[u8], args: &[&str]) -> Result<(String, String), String> {
    let folder = Folder::new();
    let (data, out) = (folder.path("theirs.txt"), folder.path("d.csv"));
    std::fs::write(&data, bytes).unwrap();
    let output = run(&[&["import", "--data", &data, "--out", &out][..], args].concat());
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    if output.status.code() != Some(0) {
        return Err(format!("{}: {said}", output.status));
    }
    Ok((folder.read("d.csv"), said))
}

fn check_case((what, make, args, words): &Case) -> Result<(), String> {
    let (written, said) = imported(&make(), args).map_err(|e| format!("{what}: {e}"))?;
    let (found, expected) = (cells(&written), good());
    for word in words.split('|') {
        if !said.contains(word) {
            return Err(format!("{what}: no `{word}` in: {said}"));
        }
    }
    if words.is_empty() && said.contains("warning") {
        return Err(format!("{what}: {said}"));
    }
    for (n, name) in expected.header.iter().enumerate() {
        if !found.header.contains(name) {
            return Err(format!("{what}: no column {name}: {:?}", found.header));
        }
        let own = found.column(name);
        for (line, (found, expected)) in found.rows.iter().zip(&expected.rows).enumerate() {
            let (found, expected) = (&found[own], &expected[n]);
            let same = match (found.parse::<f64>(), expected.parse::<f64>()) {
                (Ok(f), Ok(e)) => f == e || (f - e).abs() <= tolerance(name, what) * e.abs(),
                _ => found == expected,
            };
            if !same {
                return Err(format!("{what}: row {line}, {name}: {found} instead of {expected}"));
            }
        }
    }
    if found.rows.len() != expected.rows.len() {
        return Err(format!("{what}: {} rows", found.rows.len()));
    }
    // what was written is read as it is, and written again with the same bytes
    let (again, said) = imported(written.as_bytes(), &[]).map_err(|e| format!("{what}, again: {e}"))?;
    if again != written || said.contains("- ") {
        return Err(format!("{what}: not the same again: {said}"));
    }
    Ok(())
}

#[test]
fn exports_are_read_with_the_right_numbers() {
    let wrong: Vec<String> = READ.par_iter().filter_map(|case| check_case(case).err()).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), READ.len(), wrong.join("\n"));
    assert!(READ.len() >= 45, "{}", READ.len());
}

/// Names and units of a spreadsheet: mm, kN, N·mm, mrad.
const LABORATORY: [(&str, &str, i32); 12] = [
    ("fx_n", "Fx [kN]", -3),
    ("fy_n", "Fy [kN]", -3),
    ("fz_n", "Fz [kN]", -3),
    ("mx_nm", "Mx [N·mm]", 3),
    ("my_nm", "My [N·mm]", 3),
    ("mz_nm", "Mz [N·mm]", 3),
    ("dx_um", "dx [mm]", -3),
    ("dy_um", "dy [mm]", -3),
    ("dz_um", "dz [mm]", -3),
    ("rx_urad", "rx [mrad]", -3),
    ("ry_urad", "ry [mrad]", -3),
    ("rz_urad", "rz [mrad]", -3),
];

/// The same units in a row of their own.
const UNITS: [(&str, &str); 12] = [
    ("Fx", "kN"),
    ("Fy", "kN"),
    ("Fz", "kN"),
    ("Mx", "N·mm"),
    ("My", "N mm"),
    ("Mz", "Nmm"),
    ("dx", "mm"),
    ("dy", "mm"),
    ("dz", "mm"),
    ("rx", "mrad"),
    ("ry", "mrad"),
    ("rz", "mrad"),
];

fn laboratory() -> Table {
    good().called(&LABORATORY)
}

/// Names without units, for a row of units below.
fn bare() -> Table {
    let bare: Vec<(&str, &str, i32)> =
        LABORATORY.iter().map(|(old, new, places)| (*old, new.split(' ').next().unwrap(), *places)).collect();
    good().called(&bare)
}

/// Poses and loads written once, as merged cells are saved.
fn merged(with_load: bool) -> Table {
    let mut table = good();
    for row in [1, 2, 4] {
        let columns = ["pose", "theta_deg", "sigma_deg", "z0_mm", "series"];
        for column in columns {
            table = table.put(row, column, "");
        }
    }
    if with_load {
        // rows 0 and 2 have one load: moved next to each other it is written once
        table.rows.swap(1, 2);
        for column in ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"] {
            table = table.put(1, column, "");
        }
        table.rows.swap(1, 2);
    }
    table
}

#[rustfmt::skip] // a case a line
const READ: &[Case] = &[
    ("the file of docs/formats.md", || good().text(',').into(), &[], ""),
    ("with its mark", || marked(&good().text(',')), &[], ""),
    ("CR LF", || good().text(',').replace('\n', "\r\n").into(), &[], ""),
    ("CR alone", || good().text(',').replace('\n', "\r").into(), &[], ""),
    ("no line end at the end", || good().text(',').trim_end().into(), &[], ""),
    ("all cells in quotes", || good().text(',').lines().map(|l| format!("\"{}\"\n", l.replace(',', "\",\""))).collect::<String>().into(), &[], ""),
    ("semicolons and points", || good().text(';').into(), &[], ""),
    ("German Excel, CSV UTF-8", || marked(&good().german()), &[], "decimal commas"),
    ("German Excel, CSV", || windows(&laboratory().german()), &[], "Windows-1252|decimal commas|`dx [mm]` is dx_um, mm converted to µm"),
    ("German Excel, Unicode text", || utf16(&laboratory().commas().text('\t'), u16::to_le_bytes), &[], "UTF-16|tabs|decimal commas"),
    ("English Excel, Unicode text", || utf16(&laboratory().text('\t').replace('\n', "\r\n"), u16::to_le_bytes), &[], "UTF-16|tabs"),
    ("English Excel, CSV", || windows(&laboratory().text(',')), &[], "Windows-1252"),
    ("UTF-16 with the high byte first", || utf16(&good().german(), u16::to_be_bytes), &[], "UTF-16"),
    ("UTF-16 with CR alone", || utf16(&good().text('\t').replace('\n', "\r"), u16::to_le_bytes), &[], "UTF-16"),
    ("tabs", || good().text('\t').into(), &[], "tabs"),
    ("tabs and decimal commas", || good().commas().text('\t').into(), &[], "tabs|decimal commas"),
    ("Excel's line that names the separator", || format!("sep=;\n{}", good().german()).into(), &[], "above the header: not read"),
    ("a title", || format!("Measurement of May 12, machine 3\n{}", good().text(',')).into(), &[], "line 1 above the header: not read"),
    ("a title of several cells, and settings of the instrument", || format!("Stiffness;;;\nOperator;Meier\nDate;12.05.2026\n\n{}", good().german()).into(), &[], "lines 1 to 3 above the header"),
    ("comments", || format!("# laboratory 2\n{}", good().text(',')).into(), &[], ""),
    ("groups of columns above the header", || format!("Pose,,,,Force,,,Moment,,,Deflection,,,,,,,,\n{}", good().text(',')).into(), &[], "line 1 above the header: not read"),
    ("empty lines below", || format!("{}\n\n,,,,,,,,,,,,,,,,,,\n", good().text(',')).into(), &[], ""),
    ("empty columns behind", || good().text(',').replace('\n', ",,,\n").into(), &[], ""),
    ("empty lines between poses", || good().text(',').replace("\np02", "\n,,,\np02").into(), &[], ""),
    ("an empty column between", || good().with(10, "", "").text(',').into(), &[], ""),
    ("a column of row numbers without name, as of pandas", || good().with(0, "", "7").text(',').into(), &[], "without a name of their own"),
    ("a column of notes", || good().with(4, "Note", "fine").text(',').into(), &[], "not used: Note"),
    ("another column of a name that is there", || good().with(4, "Position", "left").text(',').into(), &[], "not used: Position"),
    ("names with parentheses, commas and colons", || good().called(&[("fx_n", "F(x) [N]", 0), ("fy_n", "Force (y) [N]", 0), ("fz_n", "Force, Z [N]", 0), ("dx_um", "dx: [µm]", 0)]).text(';').into(), &[], "`F(x) [N]` is fx_n|`Force, Z [N]` is fz_n"),
    ("a separator behind every row", || good().text(';').lines().enumerate().map(|(n, l)| format!("{l}{}\n", if n > 0 { ";" } else { "" })).collect::<String>().into(), &[], ""),
    ("a remark of two lines", || good().with(4, "Note", "\"warm\nsince nine\"").text(',').into(), &[], "not used: Note"),
    ("points before three digits beside others", || good().put(0, "fx_n", "200.000").text(';').into(), &[], ""),
    ("two columns of notes", || good().with(4, "Note", "fine").with(9, "Note", "ok").text(',').into(), &[], "not used"),
    ("columns in another order", || { let t = good(); let cell = |row: &Vec<String>| row.iter().rev().cloned().collect(); Table { header: cell(&t.header), rows: t.rows.iter().map(cell).collect() }.text(',').into() }, &[], ""),
    ("capitals", || good().text(',').replacen(HEADER, &HEADER.to_uppercase(), 1).into(), &[], "`DX_UM` is dx_um"),
    ("capitals, units too", || laboratory().text(',').replacen(&laboratory().header.join(","), &laboratory().header.join(",").to_uppercase(), 1).into(), &[], "`DX [MM]` is dx_um, mm converted to µm|`MX [N·MM]`"),
    ("the micron's letter in a name", || good().text(',').replace("dx_um", "dx_µm").into(), &[], "`dx_µm` is dx_um"),
    ("spaces for underscores", || good().text(',').replacen(HEADER, &HEADER.replace('_', " "), 1).into(), &[], "is theta_deg"),
    ("units in brackets", || laboratory().text(',').into(), &[], "`Fx [kN]` is fx_n, kN converted to N|`Mx [N·mm]` is mx_nm"),
    ("units in parentheses", || laboratory().text(',').replace('[', "(").replace(']', ")").into(), &[], "`Fx (kN)`"),
    ("units behind a slash, as DIN has it", || laboratory().text(';').replace('[', "/ ").replace(']', "").into(), &[], "`Fx / kN` is fx_n"),
    ("units behind in", || laboratory().text(',').replace('[', "in ").replace(']', "").into(), &[], "`Fx in kN` is fx_n"),
    ("units behind a space", || laboratory().text(',').replace(['[', ']'], "").into(), &[], "`Fx kN` is fx_n"),
    ("units in a second line of the cell", || laboratory().text(';').replace(" [kN]", "\u{a0}[kN]").into(), &[], "is fx_n"),
    ("a row of units", || bare().units(&UNITS).text(',').into(), &[], "units in line 2|kN converted to N"),
    ("a row of units in brackets", || bare().units(&UNITS.map(|(name, unit)| (name, ["[kN]", "[N·mm]", "[mm]", "[mrad]"].into_iter().find(|u| u[1..].starts_with(unit.split(' ').next().unwrap())).unwrap_or("[N·mm]")))).text(',').into(), &[], "units in line 2"),
    ("a row of units under full names", || good().units(&[("theta_deg", "°"), ("z0_mm", "mm"), ("fx_n", "N"), ("dx_um", "µm"), ("pose", "-"), ("temperature_c", "°C")]).text(',').into(), &[], "units in line 2"),
    ("a row of units, German", || windows(&bare().units(&UNITS).german()), &[], "units in line 2|decimal commas"),
    ("daN and kN·m", || good().called(&[("fx_n", "Kraft X [daN]", -1), ("my_nm", "MY (kN·m)", -3)]).text(',').into(), &[], "daN converted to N|kN·m converted to N·m"),
    ("metres", || good().called(&[("z0_mm", "Z0 [m]", -3), ("dx_um", "dx [m]", -6)]).text(',').into(), &[], "m converted to mm"),
    ("Greek letters", || good().called(&[("theta_deg", "θ [°]", 0), ("sigma_deg", "σ [°]", 0), ("dx_um", "Δx [µm]", 0), ("dy_um", "∆y [μm]", 0)]).text(',').into(), &[], "`θ [°]` is theta_deg"),
    ("angles in radians", || good().map(&["theta_deg", "sigma_deg"], |c| c.parse::<f64>().unwrap().to_radians().to_string()).called(&[("theta_deg", "theta [rad]", 0), ("sigma_deg", "sigma [rad]", 0)]).text(',').into(), &[], "rad converted to °"),
    ("rotations in degrees", || good().map(&["rx_urad"], |c| (c.parse::<f64>().unwrap() * 1e-6).to_degrees().to_string()).called(&[("rx_urad", "rot x [°]", 0)]).text(',').into(), &[], "° converted to µrad"),
    ("kelvins", || good().map(&["temperature_c"], |c| format!("{:.2}", c.parse::<f64>().unwrap() + 273.15)).called(&[("temperature_c", "Temp [K]", 0)]).text(',').into(), &[], "K converted to °C"),
    ("other usual names", || good().called(&[("fx_n", "Load X [N]", 0), ("dx_um", "X-Displacement [µm]", 0), ("dy_um", "Disp. Y [µm]", 0), ("mx_nm", "Torque X [N m]", 0), ("rx_urad", "Rotation X [µrad]", 0), ("pose", "Pose #", 0)]).text(',').into(), &[], "`Disp. Y [µm]` is dy_um|`Load X [N]` is fx_n"),
    ("German names", || good().called(&[("temperature_c", "Temperatur [°C]", 0), ("direction", "Richtung", 0), ("series", "Messreihe", 0), ("fx_n", "Kraft x [N]", 0)]).map(&["Richtung"], |c| if c == "load" { "Belastung" } else { "Entlastung" }.into()).text(',').into(), &[], "`Richtung` is direction|directions written otherwise"),
    ("up and down", || good().map(&["direction"], |c| if c == "load" { "up" } else { "Down" }.into()).text(',').into(), &[], "directions written otherwise, read as load and unload: 6"),
    ("a dash for what was not measured", || good().put(2, "dz_um", "-").text(',').into(), &[], "not measured: 1"),
    ("n/a", || good().put(2, "dz_um", "n/a").text(',').into(), &[], "not measured"),
    ("an English spreadsheet's #N/A", || good().put(2, "dz_um", "#N/A").text(',').into(), &[], "not measured"),
    ("a German spreadsheet's #NV", || good().put(2, "dz_um", "#NV").german().into(), &[], "not measured"),
    ("a long dash", || good().put(2, "dz_um", "—").text(',').into(), &[], "not measured"),
    ("a typographic minus", || good().map(&["dy_um", "dz_um"], |c| c.replace('-', "\u{2212}")).text(',').into(), &[], "typographic minus"),
    ("exponents", || good().map(&["fx_n"], |c| format!("{:E}", c.parse::<f64>().unwrap())).text(',').into(), &[], ""),
    ("exponents under another unit", || good().map(&["fx_n"], |c| format!("{:E}", c.parse::<f64>().unwrap() / 1e3)).called(&[("fx_n", "Fx [kN]", 0)]).german().into(), &[], "kN converted to N"),
    ("merged poses", || merged(false).text(',').into(), &[], "empty pose taken from the row above, and in lines 4, 6"),
    ("merged coordinates beside names of poses", || { let mut t = merged(false); for (row, name) in [(1, "p01"), (2, "p01"), (4, "p02")] { t = t.put(row, "pose", name); } t.text(',').into() }, &[], "empty pose taken from the row above, and in lines 4, 6"),
    ("merged poses, German", || marked(&merged(false).german()), &[], "merged cells"),
    ("names nobody could guess", || good().called(&[("dx_um", "Kanal 7", 0), ("fx_n", "Soll", 0)]).text(',').into(), &["--columns", "dx_um=Kanal 7,fx_n=Soll"], "`Kanal 7` is dx_um"),
    ("a name of --columns for a column that has its own", || good().text(',').into(), &["--columns", "dx_um=Weg 2"], "no column `Weg 2`: dx_um is that of its own name"),
    ("names of the user with units behind _", || good().called(&[("dx_um", "Weg_X_mm", -3), ("fx_n", "Kraft_kN", -3)]).text(',').into(), &["--columns", "dx_um=Weg_X_mm,fx_n=Kraft_kN"], "`Weg_X_mm` is dx_um, mm converted to µm|`Kraft_kN` is fx_n, kN converted to N"),
    ("names of the user with brackets that are no unit", || good().called(&[("dx_um", "Weg 1 (X)", 0), ("dy_um", "Weg Y [LVDT1]", 0)]).text(',').into(), &["--columns", "dx_um=Weg 1 (X),dy_um=Weg Y [LVDT1]"], "`Weg 1 (X)` is dx_um"),
    ("a byte order mark between files", || good().text(',').replace("\np02", "\n\u{feff}p02").into(), &[], ""),
    ("loading and unloading in German", || good().map(&["direction"], |c| if c == "load" { "auf" } else { "ab" }.into()).text(',').into(), &[], "read as load and unload: 6"),
    ("degrees that look the same", || good().called(&[("theta_deg", "theta [º]", 0), ("sigma_deg", "sigma [˚]", 0)]).text(',').into(), &[], "`theta [º]` is theta_deg"),
    ("names nobody could guess, with units", || good().called(&[("dx_um", "Weg 1 [mm]", -3), ("fx_n", "F,soll [kN]", -3)]).text(';').into(), &["--columns", "dx_um=Weg 1,fx_n=F,soll"], "`Weg 1 [mm]` is dx_um, mm converted to µm"),
];

#[test]
fn missing_moments_are_zero_and_said() {
    let table = good().without(&["mx_nm", "my_nm", "mz_nm"]);
    let (written, said) = imported(table.text(',').as_bytes(), &[]).unwrap();
    assert!(said.contains("no columns mx_nm, my_nm, mz_nm: taken as 0"), "{said}");
    assert_eq!(cells(&written).numbers("my_nm"), [Some(0.0); 6]);
    assert_eq!(cells(&written).numbers("fz_n"), good().numbers("fz_n"));
}

/// Poses and loads are what `predict` fills in; nothing else reads them without a deflection.
#[test]
fn a_file_without_deflections_is_written_and_said() {
    let columns = ["dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad"];
    for (table, why) in [
        (good().without(&columns), "theirs.txt:1: dx_um: missing column"),
        (good().map(&columns, |_| String::new()), "theirs.txt: expected readings, found blank deflection columns only"),
    ] {
        let (written, said) = imported(table.text(',').as_bytes(), &[]).unwrap();
        assert!(said.contains(why) && said.contains("`diagnose` refuses what is written"), "{said}");
        assert_eq!(cells(&written).rows.len(), 6);
        let folder = Folder::new();
        let plan = folder.write("plan.csv", &written);
        json(&["predict", "--data", &plan, "--out", &folder.path("p.csv")]);
    }
}

/// What statistics are called may stand for a pose or a load where it is an extreme, not where it is a mean.
#[test]
fn poses_may_be_extremes_and_no_means() {
    let named = |name: &str| imported(good().put(4, "pose", name).text(',').as_bytes(), &[]);
    for extreme in ["max", "Minimum", "Range", "middle", "mean position"] {
        assert!(named(extreme).is_ok(), "{extreme}");
    }
    let statistics = [
        "Mean",
        "average",
        "AVG",
        "Mittel",
        "Mittelwert:",
        "MW",
        "Median",
        "Std",
        "Std.",
        "StdAbw",
        "STABW",
        "SD",
        "Sum",
        "TOTAL",
        "Summe:",
        "Std. Dev.",
        "Mean value",
        "Durchschnitt",
        "Moyenne",
        "RMS",
        "Varianz",
        "Anzahl",
    ];
    for statistic in statistics {
        let said = named(statistic).unwrap_err();
        assert!(said.contains(&format!("theirs.txt:6: pose: `{statistic}` is no reading")), "{said}");
    }
}

#[test]
fn merged_loads_are_carried_down_with_their_pose_alone() {
    let text = "pose,theta [°],sigma [°],z0 [mm],Fx [N],Fy [N],Fz [N],dx [µm]\n\
                a,0,0,530,100,0,0,12.5\n,,,,,,,12.6\n,,,,200,0,0,25\nb,1,0,530,100,0,0,12.4\n";
    let (written, said) = imported(text.as_bytes(), &[]).unwrap();
    assert!(said.contains("theirs.txt:3: empty load taken from the row above"), "{said}");
    assert_eq!(cells(&written).numbers("fx_n"), [100.0, 100.0, 200.0, 100.0].map(Some));
    assert_eq!(cells(&written).numbers("theta_deg"), [0.0, 0.0, 0.0, 1.0].map(Some));
}

/// An empty temperature means 20 °C, and so must not be left beside a pose that was carried down.
#[test]
fn temperature_and_series_go_with_a_merged_pose() {
    let text = "pose,theta_deg,sigma_deg,z0_mm,fx_n,dx_um,series,temperature_c,direction\n\
                a,0,0,530,100,12.5,4,23.5,load\n,,,,200,25,,,\n,,,,100,12.5,,24,\nb,1,0,530,100,12.4,,,load\n";
    let (written, said) = imported(text.as_bytes(), &[]).unwrap();
    assert!(said.contains("theirs.txt:3: empty pose taken from the row above, and in line 4"), "{said}");
    assert_eq!(cells(&written).numbers("temperature_c"), [Some(23.5), Some(23.5), Some(24.0), None]);
    assert_eq!(cells(&written).numbers("series"), [Some(4.0), Some(4.0), Some(4.0), None]);
    let direction = cells(&written).column("direction");
    assert_eq!(cells(&written).rows[1][direction], "");
}

/// What every command reads is what `import` writes.
#[test]
fn commands_read_exports_as_they_are() {
    let folder = Folder::new();
    let theirs = folder.path("theirs.txt");
    std::fs::write(&theirs, utf16(&laboratory().commas().text('\t'), u16::to_le_bytes)).unwrap();
    let ours = folder.write("ours.csv", &good().text(','));
    let predicted = |data: &str| {
        json(&["predict", "--data", data, "--out", &folder.path("p.csv")]);
        let (text, comma) = (folder.read("p.csv"), folder.read("p.csv").contains('\t'));
        cells(&if comma { text.replace(',', ".").replace('\t', ",") } else { text }).numbers("dx_um")
    };
    assert_eq!(predicted(&theirs), predicted(&ours));
}

/// A file of 600 readings, as a German spreadsheet has it in mm.
#[test]
fn a_whole_set_keeps_every_number() {
    let folder = Folder::new();
    let ours = fixture("measured/own-limb-1-axial-easy/measured.csv");
    let text = std::fs::read_to_string(&ours).unwrap();
    let table = cells(&text.lines().filter(|l| !l.starts_with('#')).map(|l| format!("{l}\n")).collect::<String>());
    let millimetres: Vec<_> = LABORATORY.iter().filter(|(_, name, _)| name.starts_with('d')).copied().collect();
    let theirs = folder.path("theirs.csv");
    std::fs::write(&theirs, windows(&table.called(&millimetres).german())).unwrap();
    let written = |data: &str| {
        let out = folder.path("d.csv");
        json(&["import", "--data", data, "--out", &out]);
        folder.read("d.csv")
    };
    let numbers = |text: &str| cells(text).rows.iter().flatten().map(|c| c.parse::<f64>().ok()).collect::<Vec<_>>();
    assert_eq!(numbers(&written(&ours)), numbers(&written(&theirs)));
}

/// Whatever happens to a file on its way, it is read or refused, and never ends the program in a panic.
#[test]
fn damaged_files_are_read_or_refused() {
    let mut rng = seeded();
    let folder = Folder::new();
    let data = folder.path("d.txt");
    let whole = [
        good().text(',').into_bytes(),
        windows(&laboratory().german()),
        utf16(&bare().units(&UNITS).commas().text('\t'), u16::to_le_bytes),
        merged(true).text(';').into_bytes(),
    ];
    let pieces: [&[u8]; 14] =
        [b",", b";", b"\t", b"\"", b"\n", b"#", b"-", b".", b"[mm]", b"9999", b"\xb5", b"\0", b"e400", b"=1"];
    let mut read = 0;
    for n in 0..400 {
        let mut bytes = whole[n % whole.len()].clone();
        for _ in 0..=rng.usize(..3) {
            let (at, length) = (rng.usize(..bytes.len()), rng.usize(..4));
            let end = (at + length).min(bytes.len());
            bytes.splice(at..end, pieces[rng.usize(..pieces.len())].iter().copied().take(rng.usize(..5)));
        }
        std::fs::write(&data, &bytes).unwrap();
        match pkm_host::cli::run(["check", &data]) {
            Ok(_) => read += 1,
            Err(failure) => assert_eq!(failure.exit_code(), 2, "{failure}"),
        }
    }
    assert!(read > 20, "{read}");
}

/// The fuzzer guesses no name of a column.
#[test]
fn the_fuzzer_knows_every_column() {
    let dictionary = std::fs::read_to_string(fixture("../checks/fuzz/dictionaries/data_file.dict")).unwrap();
    for name in COLUMNS.iter().map(|c| c.name) {
        assert!(dictionary.lines().any(|word| word == format!("\"{name}\"")), "{name}");
    }
}
