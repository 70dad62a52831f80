//! Exports that are refused: one message, with the line, the column and what to do.

use rayon::prelude::*;

use super::table::{Table, good, windows};
use super::{bare, merged};
use crate::common::{Folder, fixture, run};

/// What it is, the file, arguments beside it, what follows the file's name in the message, and other words of it.
type Case = (&'static str, fn() -> Vec<u8>, &'static [&'static str], &'static str, &'static str);

fn check_case((what, make, args, at, words): &Case) -> Result<(), String> {
    let folder = Folder::new();
    let (data, out) = (folder.path("theirs.txt"), folder.path("d.csv"));
    std::fs::write(&data, make()).unwrap();
    let output = run(&[&["import", "--data", &data, "--out", &out][..], args].concat());
    let said = String::from_utf8_lossy(&output.stderr);
    let errors: Vec<&str> = said.lines().filter(|l| l.starts_with("error: ")).collect();
    let [error] = errors[..] else { return Err(format!("{what}: not one message: {said}")) };
    let begin = if at.is_empty() { "error: ".to_owned() } else { format!("error: {data}{at}") };
    let is_right = output.status.code() == Some(2) && error.starts_with(&begin) && error.len() < 1000;
    if !is_right || folder.has("d.csv") || !words.split('|').all(|word| error.contains(word)) {
        return Err(format!("{what}: expected `{at}` and `{words}`: {}: {said}", output.status));
    }
    Ok(())
}

#[test]
fn what_is_ambiguous_or_wrong_is_refused_with_one_message() {
    let wrong: Vec<String> = REFUSED.par_iter().filter_map(|case| check_case(case).err()).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), REFUSED.len(), wrong.join("\n"));
    assert!(REFUSED.len() >= 35, "{}", REFUSED.len());
}

fn text(table: Table) -> Vec<u8> {
    table.text(',').into()
}

#[rustfmt::skip] // a case a line
const REFUSED: &[Case] = &[
    ("an empty file", Vec::new, &[], ":1: ", "expected a header|found nothing"),
    ("a letter", || b"Dear colleague,\nthe data follow.\n".to_vec(), &[], ":1: ", "expected a header with column names|--columns"),
    ("a spreadsheet's own file", || b"PK\x03\x04\x14\0\x06\0".to_vec(), &[], ": ", "spreadsheet|CSV UTF-8"),
    ("an old spreadsheet's own file", || b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1".to_vec(), &[], ": ", "spreadsheet|CSV UTF-8"),
    ("a picture", || b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec(), &[], ":1: ", "UTF-8"),
    ("UTF-16 without its mark", || good().text(',').encode_utf16().flat_map(u16::to_le_bytes).collect(), &[], ":1: ", "UTF-16"),
    ("UTF-16 cut off within a character", || { let mut b = super::utf16(&good().text(','), u16::to_le_bytes); b.pop(); b }, &[], ":7: ", "ends within a character"),
    ("a byte that no encoding has", || [windows("pose;Fx [kN];\u{b5}\n"), b"a;\x81\n".to_vec()].concat(), &[], ":1: ", "UTF-8"),
    ("a header alone", || good().text(',').lines().next().unwrap().into(), &[], ":1: ", "expected rows of data"),
    ("a header that is a comment, as of numpy", || format!("# {}", good().text(',')).into(), &[], ":1: ", "begins with #|remove the #"),
    ("no header", || good().text(',').split_once('\n').unwrap().1.into(), &[], ":1: ", "expected a header with column names"),
    ("names that are not known", || text(good().called(&[("dx_um", "Kanal 7", 0), ("theta_deg", "B", 0)])), &[], ":1: theta_deg: ", "missing column"),
    ("no unit of a name", || text(good().called(&[("dx_um", "dx", 0), ("dy_um", "dy", 0)])), &[], ":1: dx: ", "no unit of dx, dy|`dx [µm]`|--columns dx_um=dx"),
    ("an unknown unit in brackets", || text(good().called(&[("fx_n", "Fx [tons]", 0)])), &[], ":1: Fx [tons]: ", "unknown unit `tons` of fx_n|known are mN, N, daN, kN, MN"),
    ("a length as a unit of a force", || text(good().called(&[("fx_n", "Fx [mm]", 0)])), &[], ":1: Fx [mm]: ", "unknown unit `mm` of fx_n"),
    ("an unknown unit in the row of units", || text(bare().units(&[("Fx", "kN"), ("dx", "mil")])), &[], ":1: dx: ", "unknown unit `mil` of dx_um|known are m, cm, mm, µm, nm"),
    ("deflections that nobody knows beside those that are known", || text(good().called(&[("dz_um", "Weg Z [µm]", 0)])), &[], ":1: Weg Z [µm]: ", "is it dz_um, which has no column?|--columns dz_um=Weg Z [µm]"),
    ("rotations that nobody knows", || text(good().called(&[("rx_urad", "Kippung [µrad]", 0), ("ry_urad", "Nick [µrad]", 0), ("rz_urad", "Gier [µrad]", 0)])), &[], ":1: Kippung [µrad]: ", "is it rx_urad"),
    ("repeats side by side", || text(good().map(&["series"], |_| "1.5".into()).called(&[("series", "dx 2 [µm]", 0)])), &[], ":1: dx 2 [µm]: ", "a repeat of dx_um?|a row of its own"),
    ("repeats side by side, of another program", || text(good().map(&["series"], |_| "1.5".into()).called(&[("series", "dx_um.1", 0)])), &[], ":1: dx_um.1: ", "a repeat of dx_um?"),
    ("thousands of a German spreadsheet between commas", || text(good().map(&["theta_deg", "sigma_deg", "z0_mm", "fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm", "dx_um", "dy_um", "dz_um", "rx_urad", "ry_urad", "rz_urad", "temperature_c"], |c| c.split('.').next().unwrap().into()).put(1, "fx_n", "1.500")), &[], ":3: fx_n: ", "`1.500`: thousands?"),
    ("units above the program's own names", || format!("Units: mm, mrad, N, deg\n{}", good().text(',')).into(), &[], ":1: ", "units above the header|in brackets behind its name"),
    ("a row of units above the program's own names", || format!(";°;°;mm;N;N;N\n{}", good().text(';')).into(), &[], ":1: ", "units above the header"),
    ("an instrument's overflow", || text(good().put(3, "dy_um", "9.90E+37")), &[], ":5: dy_um: ", "leave the cell empty"),
    ("a dash for the other direction", || text(good().put(2, "direction", "-")), &[], ":4: direction: ", "is `-` unloading?"),
    ("an unknown unit of a name of the user", || text(good().called(&[("dx_um", "Weg 1 [mil]", 0)])), &["--columns", "dx_um=Weg 1 [mil]"], ":1: Weg 1 [mil]: ", "unknown unit `mil` of dx_um"),
    ("Fortran's exponents", || text(good().put(3, "dx_um", "-1.5646D+02")), &[], ":5: dx_um: ", "`-1.5646D+02`: write the exponent with E"),
    ("a minus behind", || text(good().put(3, "dx_um", "156.46-")), &[], ":5: dx_um: ", "`156.46-`: write a minus in front"),
    ("a bookkeeper's minus", || text(good().put(3, "dx_um", "(156.46)")), &[], ":5: dx_um: ", "write a minus in front"),
    ("a space behind the minus", || text(good().put(3, "dx_um", "- 156.46")), &[], ":5: dx_um: ", "and no space"),
    ("a spreadsheet's mark of text", || text(good().put(3, "dx_um", "'156.46")), &[], ":5: dx_um: ", "save the numbers as numbers"),
    ("a date that was a number", || text(good().put(3, "dx_um", "1-May")), &[], ":5: dx_um: ", "has made a date of a number"),
    ("a sign that --columns leaves out", || text(good().called(&[("fz_n", "-Druck [N]", 0)])), &["--columns", "fz_n=Druck"], ":1: -Druck [N]: ", "a sign before a name"),
    ("a mean behind a pose's name", || text(good().put(2, "pose", "p01 Average")), &[], ":4: pose: ", "`p01 Average` is no reading"),
    ("a mean of so many", || text(good().put(2, "pose", "Mean (n=8)")), &[], ":4: pose: ", "is no reading"),
    ("a remark that a row is a scatter", || text(good().map(&["series"], |_| String::new()).put(2, "series", "Std").called(&[("series", "Run", 0)])), &[], ":4: Run: ", "`Std` is no reading"),
    ("another unit in brackets than in the name", || text(good().called(&[("dx_um", "dx_um [mm]", 0)])), &[], ":1: dx_um [mm]: ", "µm or mm?"),
    ("another unit in the row than in brackets", || text(good().called(&[("dx_um", "dx [mm]", 0)]).units(&[("dx [mm]", "µm"), ("fx_n", "N")])), &[], ":1: dx [mm]: ", "mm or µm?"),
    ("another unit in the row than in the name", || text(good().units(&[("dx_um", "mm"), ("fx_n", "N")])), &[], ":1: dx_um: ", "µm or mm?"),
    ("a unit in the name that is not the column's", || text(good().called(&[("dx_um", "dx_mm", 0)])), &[], ":1: dx_mm: ", "did you mean `dx_um`?|in brackets, as `dx [mm]`"),
    ("sigma as a deviation", || text(good().called(&[("sigma_deg", "σ [µm]", 0)])), &[], ":1: σ [µm]: ", "unknown unit `µm` of sigma_deg"),
    ("a deflection twice", || text(good().called(&[("dx_um", "dx [µm]", 0), ("dy_um", "dx [mm]", 0)])), &[], ":1: dx_um: ", "duplicate column"),
    ("a deflection in another unit beside its column", || text(good().with(9, "dx [mm]", "1")), &[], ":1: dx [mm]: ", "duplicate column: `dx_um` is there as well"),
    ("a minus before a name", || text(good().called(&[("fz_n", "-Fz [N]", 0)])), &[], ":1: -Fz [N]: ", "a sign before a name|fz_n with the other sign"),
    ("a minus behind a name", || text(good().called(&[("dx_um", "dx\u{2212} [µm]", 0)])), &[], ":1: dx\u{2212} [µm]: ", "a sign before a name"),
    ("a force that nobody can tell", || text(good().called(&[("fx_n", "Fx soll [N]", 0)])), &[], ":1: Fx soll [N]: ", "is it fx_n, which has no column and would be 0?|--columns fx_n=Fx soll [N]"),
    ("a moment that nobody can tell", || text(good().called(&[("mx_nm", "Kanal 4 [N·m]", 0)])), &[], ":1: Kanal 4 [N·m]: ", "is it mx_nm, which has no column"),
    ("thousands in a file of whole numbers between commas", || b"pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,dx_um,remark\na,0,0,530,1,000,0,0,12,\nb,1,0,530,100,0,0,13,\n".to_vec(), &[], ":2: ", "expected 9 cells as in the header, found 10, the last of them empty: for decimal commas write semicolons"),
    ("one row with a cell too many, the last of them empty", || b"pose;theta_deg;sigma_deg;z0_mm;fx_n;fy_n;fz_n;dx_um;remark\na;0;0;530;1;000;0;0;12;\nb;1;0;530;100;0;0;13;\n".to_vec(), &[], ":2: ", "expected 9 cells as in the header, found 10, the last of them empty"),
    ("something in a column without name behind the others", || b"pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,dx_um,\na,0,0,530,100,0,0,12,foo\nb,1,0,530,100,0,0,13,\n".to_vec(), &[], ":2: ", "`foo` stands in column 9, which has no name"),
    ("points before thousands in a file of whole numbers", || b"pose;theta_deg;sigma_deg;z0_mm;fx_n;fy_n;fz_n;dx_um\na;0;0;530;1.500;0;0;12\nb;1;0;530;100;0;0;13\n".to_vec(), &[], ":2: fx_n: ", "decimal point or thousands?"),
    ("marks of repetition", || { let mut t = good(); for row in 1..4 { t = t.put(row, "direction", "\""); } text(t) }, &[], ":3: ", "is a quote not closed?"),
    ("dashes for a whole load", || { let mut t = good(); for name in ["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"] { t = t.put(1, name, "-"); } text(t) }, &[], ":3: fx_n: ", "expected a finite number"),
    ("means without a name", || format!("{},,,,,,,,,,62.81,,,,,,,,,\n", good().with(19, "repeat", "1").text(',')).into(), &[], ":8: ", "has no pose: if it is a sum or a note, delete it"),
    ("the sign of a mean beside the repeats", || text(good().with(19, "repeat", "1").put(3, "repeat", "Ø")), &[], ":5: repeat: ", "`Ø` is no reading"),
    ("thousands in an English file", || text(good().put(1, "fx_n", "1,500")), &[], ":3: fx_n: ", "without separators between thousands"),
    ("points before thousands in a German file", || good().commas().put(1, "fx_n", "1.500").text(';').into(), &[], ":3: fx_n: ", "point or thousands?"),
    ("points before thousands under another unit", || good().called(&[("fx_n", "Fx [kN]", 0)]).commas().put(1, "Fx [kN]", "1.500").text(';').into(), &[], ":3: fx_n: ", "point or thousands?"),
    ("commas before thousands beside decimal points", || good().put(1, "fx_n", "1,500").text('\t').into(), &[], ":3: fx_n: ", "decimal comma or thousands?"),
    ("one comma in a file of whole numbers", || b"pose;theta_deg;sigma_deg;z0_mm;fx_n;fy_n;fz_n;dx_um\na;0;0;530;1,500;0;0;12\nb;1;0;530;100;0;0;13\n".to_vec(), &[], ":2: fx_n: ", "decimal comma or thousands?"),
    ("spaces between thousands", || good().put(1, "fx_n", "1 500").text(';').into(), &[], ":3: fx_n: ", "without separators between thousands"),
    ("apostrophes between thousands", || good().put(1, "fx_n", "1'500").text(';').into(), &[], ":3: fx_n: ", "without separators between thousands"),
    ("decimal commas between commas", || text(good().put(1, "dx_um", "471,44")), &[], ":3: dx_um: ", "expected a finite number|decimal point"),
    ("decimal commas between commas, over blank cells", || b"pose,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,dx_um,dy_um,rx_urad,ry_urad\np1,0,0,530,200,0,0,28,1,2,8,,\n".to_vec(), &[], ":2: ", "expected 11 cells as in the header, found 13, the last of them empty: for decimal commas write semicolons"),
    ("a unit in a cell", || text(good().put(1, "dx_um", "471.44 µm")), &[], ":3: dx_um: ", "write it without unit"),
    ("a spreadsheet's error", || text(good().put(1, "dx_um", "#DIV/0!")), &[], ":3: dx_um: ", "expected a finite number|#DIV/0!"),
    ("a spreadsheet's column that is too narrow", || text(good().put(1, "dx_um", "#####")), &[], ":3: dx_um: ", "expected a finite number"),
    ("a date where a number was", || text(good().put(1, "dx_um", "12. Mai")), &[], ":3: dx_um: ", "expected a finite number|12. Mai"),
    ("NaN", || text(good().put(1, "dx_um", "NaN")), &[], ":3: dx_um: ", "leave the cell empty"),
    ("a dash for a force", || text(good().put(1, "fx_n", "-")), &[], ":3: fx_n: ", "expected a finite number"),
    ("an empty force", || text(good().put(1, "fx_n", "")), &[], ":3: fx_n: ", "an empty cell"),
    ("an empty angle", || text(good().put(1, "sigma_deg", "")), &[], ":3: sigma_deg: ", "an empty cell"),
    ("merged cells without their first row", || text(merged(false).put(0, "pose", "").put(0, "theta_deg", "").put(0, "sigma_deg", "").put(0, "z0_mm", "")), &[], ":2: theta_deg: ", "has no pose"),
    ("a mean below", || format!("{}mean,,,,,,,,,,62.81,,,,,,,,\n", good().text(',')).into(), &[], ":8: pose: ", "`mean` is no reading|leave out rows"),
    ("a sum below", || format!("{}sum,,,,,,,,,,62.81,,,,,,,,\n", good().text(',')).into(), &[], ":8: pose: ", "`sum` is no reading|leave out rows"),
    ("a note below", || format!("{}by hand,,,,,,,,,,62.81,,,,,,,,\n", good().text(',')).into(), &[], ":8: theta_deg: ", "if it is a sum or a note, delete it"),
    ("a mean in the column of the poses", || text(good().put(1, "pose", "Mittelwert")), &[], ":3: pose: ", "`Mittelwert` is no reading|leave out rows|name it otherwise"),
    ("a scatter in the column of the poses", || text(good().called(&[("pose", "Pose Nr", 0)]).put(2, "Pose Nr", "Std.")), &[], ":4: pose: ", "`Std.` is no reading"),
    ("a mean under merged cells", || text(merged(false).put(1, "series", "Mittelwert")), &[], ":3: series: ", "`Mittelwert` is no reading"),
    ("a direction of another name", || text(good().put(1, "direction", "north")), &[], ":3: direction: ", "expected `load` or `unload`, found `north`"),
    ("a row with a cell too few", || good().text(',').replacen("200,0,0,", "200,0,", 1).into(), &[], ":2: ", "expected 19 cells as in the header, found 18"),
    ("a quote that is not closed", || good().text(',').replacen("p02", "\"p02", 1).into(), &[], ":5: ", "is a quote not closed?"),
    ("no force and no moment", || text(good().without(&["fx_n", "fy_n", "fz_n", "mx_nm", "my_nm", "mz_nm"])), &[], ":1: fx_n: ", "missing column"),
    ("no pose", || text(good().without(&["pose"])), &[], ":1: pose: ", "missing column"),
    ("a tracker's list of points", || b"Point,X [mm],Y [mm],Z [mm],Pose,Series\nP1,1250.211,-33.5,801.2,p01,1\nP2,1250.3,-33.4,801.1,p01,1\n".to_vec(), &[], ":1: ", "list of points|deflections of A"),
    ("unloaded poses", || std::fs::read(fixture("unloaded/five/unloaded.csv")).unwrap(), &[], ":1: ", "diagnose --unloaded|deflections under loads"),
    ("a header in two rows, x, y, z twice", || b"Pose;theta [deg];sigma [deg];z0 [mm];Force [N];;;Deflection [\xc2\xb5m];;\n;;;;x;y;z;x;y;z\na;0;0;530;100;0;0;12;0;0\n".to_vec(), &[], ":1: ", "names of columns in two rows, lines 1 and 2|into one row|`Force x [N]`"),
    ("a header in two rows, units in the second", || b"Pose,,,,Force,,,Deflection,,\nName,theta [deg],sigma [deg],z0 [mm],x [N],y [N],z [N],x [mm],y [mm],z [mm]\na,0,0,530,100,0,0,0.012,0,0\n".to_vec(), &[], ":1: ", "names of columns in two rows, lines 1 and 2|into one row|`Force x [N]`"),
    ("a header in two rows, a name in either", || b"Stiffness of machine 3\nPose\ttheta [deg]\tsigma [deg]\tz0 [mm]\tForce\t\t\tDeflection\t\t\n\t\t\t\tFx [N]\tFy [N]\tFz [N]\tdx [mm]\tdy [mm]\tdz [mm]\na\t0\t0\t530\t100\t0\t0\t0.012\t0\t0\n".to_vec(), &[], ":2: ", "names of columns in two rows, lines 2 and 3|into one row"),
    ("a header in two rows and a row of units", || b"Pose,,,,Kraft,,,Verschiebung,,\nName,theta,sigma,z0,x,y,z,x,y,z\n,deg,deg,mm,N,N,N,mm,mm,mm\na,0,0,530,100,0,0,0.012,0,0\n".to_vec(), &[], ":1: ", "names of columns in two rows, lines 1 and 2|`Kraft x`"),
    ("a log of a load cell", || b"Time [s],Fx [N],Fy [N],Fz [N]\n0.00,1.2,0.1,-0.3\n0.01,1.3,0.2,-0.2\n".to_vec(), &[], ":1: ", "log of loads over time|no pose and no deflection"),
    ("a column of --columns that is not there", || text(good().called(&[("dx_um", "Kanal 9", 0)])), &["--columns", "dx_um=Kanal 9,fx_n=Soll"], ":1: ", "no column `Soll`|there are pose"),
    ("a column of --columns with the name of another", || text(good().called(&[("dy_um", "Weg 1 [µm]", 0)])), &["--columns", "dx_um=Weg 1"], ":1: ", "`Weg 1` is dx_um, and `dx_um` is too"),
    ("--columns without a name", || text(good()), &["--columns", "dx_um="], "", "what is the column called"),
    ("--columns with an unknown column", || text(good()), &["--columns", "dx_mm=Weg"], "", "did you mean `dx_um`?"),
    ("--columns without an equals sign", || text(good()), &["--columns", "Weg"], "", "new=theirs"),
    ("a pose out of travel", || text(good().put(1, "z0_mm", "930")), &[], ":3: pose: ", "travel 420 to 770 mm"),
    ("a pose in metres without saying so", || text(good().put(1, "z0_mm", "0.555")), &[], ":3: pose: ", "are lengths in mm?"),
];
