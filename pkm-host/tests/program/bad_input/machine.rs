//! The machine file.

use super::{Kind, Make, Put, Reader};
use crate::common::reference_machine;

#[test]
fn machine_files() {
    let good = reference_machine();
    let call = ["plan", "--kind", "l49", "--machine", "BAD", "--out", "OUT"];
    Reader { good: &good, name: "m.toml", call: &call, old: "out" }.refuses(KINDS, 60);
}

/// An `[[effect]]` behind the good file, which has 78 lines.
macro_rules! effect {
    ($text:literal) => {
        Make(|good| format!("{good}[[effect]]\n{}\n", $text).into_bytes())
    };
}

/// An `[[element]]` there.
macro_rules! element {
    ($text:literal) => {
        Make(|good| format!("{good}[[element]]\n{}\n", $text).into_bytes())
    };
}

#[rustfmt::skip] // a kind a line
const KINDS: &[Kind] = &[
    // no TOML, or not all of it
    ("empty", Make(|_| Vec::new()), ": format: ", "missing"),
    ("a byte-order mark alone", Make(|_| "\u{feff}".into()), ": format: ", "missing"),
    ("comments alone", Make(|good| good.lines().map(|l| format!("# {l}\n")).collect::<String>().into()), ": format: ", "missing"),
    ("a CSV", Make(|_| "pose,theta_deg,sigma_deg,z0_mm\nO01,0,0,530\n".into()), ":1: ", "expected"),
    ("JSON", Make(|_| "{\n  \"format\": 1\n}\n".into()), ":1: ", "expected"),
    ("YAML", Put("a1_mm = 180.0", "a1_mm: 180.0"), ":6: ", "expected"),
    ("cut off in the middle", Make(|good| good[..700].into()), ":34: linear_n_per_m: ", "expected"),
    ("a mark of a merge", Put("[travel]", "<<<<<<< ours\n[travel]"), ":11: ", "expected"),
    ("an unclosed quote", Put("\"reference\"", "\"reference"), ":3: name: ", "expected"),
    ("an unclosed array", Put("[420.0, 420.0, 420.0]", "[420.0, 420.0, 420.0"), ":13: max_mm: ", "missing comma"),
    ("an unclosed section", Put("[geometry]", "[geometry"), ":5: ", "]"),
    ("an unclosed table", Put("inner_mm = 36.0 }", "inner_mm = 36.0"), ":42: screw: ", "missing comma"),
    ("quotes of typography", Put("\"beam\"", "“beam”"), ":40: kind: ", "quote"),
    ("no quotes", Put("\"beam\"", "beam"), ":40: kind: ", "quote"),
    ("a key in two words", Put("a1_mm", "a1 mm"), ":6: ", "expected"),
    ("no number", Put("a1_mm = 180.0", "a1_mm ="), ":6: a1_mm: ", "number"),
    ("10,000 brackets", Make(|good| good.replacen("180.0", &"[".repeat(10_000), 1).into()), ":6: a1_mm: ", "nested"),
    ("10,000 tables", Make(|good| good.replacen("a1_mm", &"a.".repeat(10_000), 1).into()), ":6: ", "keys"),
    ("a line of 10 MB", Make(|good| good.replacen("# The", &"x".repeat(10_000_000), 1).into()), ":1: ", "expected"),
    ("a name of 10 MB", Make(|good| good.replacen("180.0", &format!("\"{}\"", "x".repeat(10_000_000)), 1).into()), ":6: geometry.a1_mm: ", "number"),
    // numbers
    ("a decimal comma", Put("a1_mm = 180.0", "a1_mm = 180,0"), ":6: a1_mm: ", "decimal point"),
    ("a comma for thousands", Put("outer_mm = 60.0", "outer_mm = 1,060.0"), ":41: ", "decimal point"),
    ("spaces for thousands", Put("180.0", "1 180.0"), ":6: a1_mm: ", "number"),
    ("a minus of typography", Put("-20.0", "\u{2212}20.0"), ":21: offset_mm: ", "minus"),
    ("a degree sign", Put("[-15.0, 15.0]", "[-15.0°, 15.0°]"), ":16: theta_deg: ", "without unit"),
    ("a unit", Put("180.0", "180.0 mm"), ":6: a1_mm: ", "without unit"),
    ("text", Put("180.0", "\"180\""), ":6: geometry.a1_mm: ", "expected a number, found string"),
    ("true", Put("180.0", "true"), ":6: geometry.a1_mm: ", "expected a number, found boolean"),
    ("a date", Put("180.0", "1980-01-01"), ":6: geometry.a1_mm: ", "expected a number|or a date"),
    ("no digit before the point", Put("180.0", ".5"), ":6: a1_mm: ", "digits"),
    ("hexadecimal with a point", Put("180.0", "0xB4.0"), ":6: a1_mm: ", "number"),
    ("NaN", Put("180.0", "nan"), ":6: geometry.a1_mm: ", "finite|NaN"),
    ("infinity", Put("180.0", "inf"), ":6: geometry.a1_mm: ", "finite|inf"),
    ("beyond all numbers", Put("180.0", "1e999"), ":6: geometry.a1_mm: ", "number overflowed"),
    ("a million digits", Make(|good| good.replacen("180.0", &"9".repeat(1_000_000), 1).into()), ":6: geometry.a1_mm: ", "number"),
    ("a million digits behind the point", Make(|good| good.replacen("180.0", &format!("-0.{}", "9".repeat(1_000_000)), 1).into()), ":6: geometry.a1_mm: ", "above 0"),
    // what the numbers mean
    ("negative", Put("180.0", "-180.0"), ":6: geometry.a1_mm: ", "above 0|-180"),
    ("zero", Put("180.0", "0"), ":6: geometry.a1_mm: ", "above 0|found 0"),
    ("platforms in metres", Make(|good| good.replace("180.0", "0.18").replace("220.0", "0.22").replace("350.0", "0.35").replace("380.0", "0.38").into()), ":6: geometry.a1_mm: ", "are all lengths in mm?"),
    ("travel in metres", Make(|good| good.replace("420.0", "0.42").replace("770.0", "0.77").into()), ":12: travel: ", "no screw lengths|are all lengths in mm?"),
    ("a platform that nothing closes", Put("b2_mm = 380.0", "b2_mm = 3800.0"), ":12: travel: ", "no screw lengths"),
    ("travel the wrong way", Put("[770.0, 770.0, 770.0]", "[770.0, 410.0, 770.0]"), ":13: travel.max_mm[1]: ", "above the least"),
    ("no travel", Put("[770.0, 770.0, 770.0]", "[770.0, 770.0, 420.0]"), ":13: travel.max_mm[2]: ", "above the least"),
    ("a length below 0", Put("[420.0, 420.0, 420.0]", "[420.0, -420.0, 420.0]"), ":12: travel.min_mm[1]: ", "above 0"),
    ("a box the wrong way", Put("theta_deg = [-15.0, 15.0]", "theta_deg = [15.0, -15.0]"), ":16: box.theta_deg: ", "least"),
    ("a box without extent", Put("z0_mm = [500.0, 560.0]", "z0_mm = [500.0, 500.0]"), ":18: box.z0_mm: ", "least"),
    ("a box beyond 90°", Put("sigma_deg = [-15.0, 15.0]", "sigma_deg = [-15.0, 95.0]"), ":17: box.sigma_deg: ", "between -90 and 90"),
    ("a box below the base", Put("z0_mm = [500.0, 560.0]", "z0_mm = [-500.0, 560.0]"), ":18: box.z0_mm: ", "above 0"),
    ("limits of the wrist the wrong way", Put("max_deg = 90.0 }\nsecond", "max_deg = -95.0 }\nsecond"), ":22: wrist.first.max_deg: ", "above -90"),
    ("a negative flange", Put("flange_mm = 190.0", "flange_mm = -190.0"), ":24: wrist.flange_mm: ", "at least 0"),
    ("a negative margin", Put("singularity_margin = 0.1", "singularity_margin = -0.1"), ":25: wrist.singularity_margin: ", "at least 0"),
    ("a limit of the wrist beyond the default of the other", Put(", min_deg = -90.0, max_deg = 90.0 }\nsecond", ", min_deg = 95.0 }\nsecond"), ":22: wrist.first.min_deg: ", "below 90"),
    ("a negative deviation", Put("stiffness = 0.10", "stiffness = -0.10"), ":28: uncertainty.stiffness: ", "above 0"),
    ("no deviation", Put("stiffness = 0.10", "stiffness = 0.0"), ":28: uncertainty.stiffness: ", "above 0"),
    ("a deviation in percent", Put("stiffness = 0.10", "stiffness = 10"), ":28: uncertainty.stiffness: ", "at most 1"),
    ("a deviation of joints in percent", Put("stiffness = 0.10", "joint = 10"), ":28: uncertainty.joint: ", "at most 1"),
    ("no deviation of bodies", Put("stiffness = 0.10", "body = 0.0"), ":28: uncertainty.body: ", "above 0"),
    ("no stiffness", Put("[2.0e8, 2.0e8, 3.0e8]", "[2.0e8, 0.0, 3.0e8]"), ":34: limb.1.base_joint.linear_n_per_m[1]: ", "above 0"),
    ("a negative stiffness", Put("[2.5e8, 2.5e8, 2.5e8]", "[2.5e8, 2.5e8, -2.5e8]"), ":37: limb.1.platform_joint.linear_n_per_m[2]: ", "above 0"),
    ("no stiffness where the joint holds", Put("[0.0, 3.0e5, 3.0e5]", "[0.0, 0.0, 3.0e5]"), ":38: limb.1.platform_joint.angular_nm_per_rad[1]: ", "above 0"),
    ("a stiffness where the joint turns", Put("[0.0, 0.0, 2.0e5]", "[1.0, 0.0, 2.0e5]"), ":35: limb.1.base_joint.angular_nm_per_rad[0]: ", "releases"),
    ("axes in another order", Put("[0.0, 4.0e5, 4.0e5]", "[4.0e5, 0.0, 4.0e5]"), ":59: limb.3.base_joint.angular_nm_per_rad[0]: ", "releases"),
    ("a bore as wide as the tube", Put("inner_mm = 36.0", "inner_mm = 60.0"), ":41: limb.1.body.rod.inner_mm: ", "bore"),
    ("a negative bore", Put("inner_mm = 0.0", "inner_mm = -1.0"), ":42: limb.1.body.screw.inner_mm: ", "bore"),
    // shapes
    ("an array too short", Put("[770.0, 770.0, 770.0]", "[770.0, 770.0]"), ":13: travel.max_mm: ", "expected 3 numbers, found 2"),
    ("an array too long", Put("[770.0, 770.0, 770.0]", "[770.0, 770.0, 770.0, 770.0]"), ":13: travel.max_mm: ", "expected 3 numbers, found 4"),
    ("an array of arrays", Put("[770.0, 770.0, 770.0]", "[[770.0], [770.0], [770.0]]"), ":13: travel.max_mm", "expected a number, found an array"),
    ("an empty array", Put("[770.0, 770.0, 770.0]", "[]"), ":13: travel.max_mm: ", "expected 3 numbers, found 0"),
    ("a number for an array", Put("[770.0, 770.0, 770.0]", "770.0"), ":13: travel.max_mm: ", "expected an array|770"),
    ("an array for a number", Put("180.0", "[180.0]"), ":6: geometry.a1_mm: ", "expected a number, found an array"),
    ("a table for a number", Put("180.0", "{ mm = 180.0 }"), ":6: geometry.a1_mm: ", "expected a number, found a table"),
    ("a number for a section", Make(|good| good.replace("[uncertainty]\nstiffness = 0.10\nload_direction_mrad = 0.0\nload_gain = 0.0\n", "").replacen("name", "uncertainty = 5\nname", 1).into()), ":3: uncertainty: ", "expected a table"),
    ("text for a section", Put("rod   = { young_gpa = 206.0, shear_gpa = 79.23, outer_mm = 60.0, inner_mm = 36.0 }", "rod = \"60/36\""), ":41: limb.1.body.rod: ", "a table"),
    ("a limb that is not one of several", Make(|good| good[..good.match_indices("[[limb]]").nth(1).unwrap().0].replacen("[[limb]]", "[limb]", 1).into()), ":32: limb: ", "[[limb]]"),
    ("two limbs", Make(|good| good[..good.rfind("[[limb]]").unwrap()].into()), ":32: limb: ", "three [[limb]] tables, found 2"),
    ("four limbs", Make(|good| good.replacen("# What", &format!("{}\n#", &good[good.rfind("[[limb]]").unwrap()..good.find("# What").unwrap()]), 1).into()), ":32: limb: ", "three [[limb]] tables, found 4"),
    ("no limbs", Make(|good| good[..good.find("[[limb]]").unwrap()].into()), ": limb: ", "missing"),
    ("limbs of a misspelt name", Put("[[limb]]\n[limb.base_joint]\nlinear_n_per_m     = [2.5e8", "[[limbs]]\n[limb.base_joint]\nlinear_n_per_m     = [2.5e8"), ":57: limb.base_joint: ", "duplicate"),
    // keys
    ("an unknown key at the top", Put("name = ", "nome = 1\nname = "), ":3: nome: ", "unknown key|`name`"),
    ("an unknown section", Put("[uncertainty]", "[uncertainties]"), ":27: uncertainties: ", "unknown key|`uncertainty`"),
    ("a misspelt key", Put("shear_gpa", "shaer_gpa"), ":41: limb.1.body.rod.shaer_gpa: ", "unknown key|`shear_gpa`"),
    ("another unit", Put("a1_mm = 180.0", "a1_m = 0.18"), ":6: geometry.a1_m: ", "unknown key|`a1_mm`"),
    ("a missing key", Put("a1_mm = 180.0\n", ""), ":5: geometry.a1_mm: ", "missing"),
    ("a missing section", Put("[travel]\nmin_mm = [420.0, 420.0, 420.0]\nmax_mm = [770.0, 770.0, 770.0]\n", ""), ": travel: ", "missing"),
    ("a missing joint", Put("[limb.platform_joint]\nlinear_n_per_m     = [2.5e8, 2.5e8, 2.5e8]\nangular_nm_per_rad = [0.0, 3.0e5, 3.0e5]\n", ""), ":32: limb.1.platform_joint: ", "missing"),
    ("a missing key of a tube", Put("outer_mm = 60.0, ", ""), ":41: limb.1.body.rod.outer_mm: ", "missing"),
    ("a key twice", Put("a1_mm = 180.0", "a1_mm = 180.0\na1_mm = 180.0"), ":7: a1_mm: ", "duplicate"),
    ("a section twice", Put("[travel]", "[geometry]\n[travel]"), ":11: geometry: ", "duplicate"),
    ("a key twice, once with dots", Put("[geometry]", "geometry.a1_mm = 180.0\n[geometry]"), ":6: geometry: ", "duplicate"),
    ("no format", Put("format = 1\n", ""), ": format: ", "missing"),
    ("another format", Put("format = 1", "format = 2"), ":2: format: ", "expected 1, found 2"),
    ("a format in quotes", Put("format = 1", "format = \"1\""), ":2: format: ", "expected a whole number, found string"),
    ("a format with a point", Put("format = 1", "format = 1.0"), ":2: format: ", "expected a whole number|1.0"),
    ("an empty name", Put("\"reference\"", "\"\""), ":3: name: ", "one line"),
    ("a name of two lines", Put("\"reference\"", "\"a\\nb\""), ":3: name: ", "one line"),
    ("a name that turns its line round", Put("\"reference\"", "\"a\u{202e}b\""), ":3: name: ", "ordinary text"),
    ("a number for a name", Put("\"reference\"", "150"), ":3: name: ", "expected text in quotes|150"),
    ("an unknown body", Put("\"beam\"", "\"truss\""), ":40: limb.1.body.kind: ", "truss|beam|diagonal"),
    ("an unknown limb of solids", Put("\"telescopic\"", "\"telescope\""), ":70: solid.limb: ", "telescope|telescopic"),
    ("a solid of no thickness", Put("thickness_mm = 49.5", "thickness_mm = 0"), ":77: solid.platform.thickness_mm: ", "above 0"),
    // effects
    ("an effect that is one table", Make(|good| format!("{good}[effect]\nid = \"wrist-compliance\"\n").into()), ":79: effect: ", "[[effect]]"),
    ("an unknown effect", effect!("id = \"moon-phase\""), ":80: effect.id: ", "moon-phase|known are|wrist-compliance"),
    ("a misspelt effect", effect!("id = \"wrist-complience\"\nlinear_m_per_n = 1e-9"), ":80: effect.id: ", "did you mean `wrist-compliance`?"),
    ("an effect without a name", effect!("linear_m_per_n = 1e-9"), ":79: effect.1.id: ", "missing key"),
    ("a number for an effect's name", effect!("id = 3"), ":80: effect.1.id: ", "expected text in quotes|3"),
    ("an effect without a parameter", effect!("id = \"wrist-compliance\""), ":80: effect.wrist-compliance: ", "at least one of|linear_m_per_n"),
    ("an effect's parameter in another unit", effect!("id = \"wrist-compliance\"\nlinear_um_per_n = 1.0"), ":81: effect.wrist-compliance.linear_um_per_n: ", "linear_m_per_n"),
    ("an effect's negative parameter", effect!("id = \"wrist-compliance\"\nlinear_m_per_n = -1e-9"), ":81: effect.wrist-compliance.linear_m_per_n: ", "at least 0"),
    ("text for an effect's parameter", effect!("id = \"wrist-compliance\"\nlinear_m_per_n = \"x\""), ":81: effect.wrist-compliance.linear_m_per_n: ", "expected a number"),
    ("an endless text for it", Make(|good| format!("{good}[[effect]]\nid = \"wrist-compliance\"\nlinear_m_per_n = \"{}\"\n", "x".repeat(1_000_000)).into()), ":81: effect.wrist-compliance.linear_m_per_n: ", "expected a number"),
    ("an effect of another size", effect!("id = \"base-compliance\"\nmount_m_per_n = 1e305"), ":81: effect.base-compliance.mount_m_per_n: ", "smaller number"),
    ("an effect twice", effect!("id = \"wrist-compliance\"\nlinear_m_per_n = 1e-9\n[[effect]]\nid = \"wrist-compliance\"\nlinear_m_per_n = 1"), ":83: effect.id: ", "duplicate"),
    // elements
    ("an element of no place", element!("place = \"limb.4.body\"\nmotion = \"axial\"\nlaw = \"constant\"\ncompliance_m_per_n = 1e-9"), ":80: element.place: ", "limb.3.body"),
    ("a motion of another place", element!("place = \"base\"\nmotion = \"axial\"\nlaw = \"constant\"\ncompliance_m_per_n = 1e-9"), ":81: element.motion: ", "x, y, z, rx, ry, rz"),
    ("a law of another place", element!("place = \"base\"\nmotion = \"x\"\nlaw = \"load\"\nplay_m = 1e-6"), ":82: element.law: ", "constant, temperature"),
    ("a law of another motion", element!("place = \"limb.1.body\"\nmotion = \"lateral\"\nlaw = \"load\"\nplay_m = 1e-6"), ":82: element.law: ", "constant, extension, periodic"),
    ("an element without a parameter", element!("place = \"base\"\nmotion = \"x\"\nlaw = \"constant\""), ":82: element.law: ", "compliance_m_per_n"),
    ("a parameter of a rotation", element!("place = \"base\"\nmotion = \"x\"\nlaw = \"constant\"\ncompliance_rad_per_nm = 1e-9"), ":83: element.compliance_rad_per_nm: ", "compliance_m_per_n"),
    ("text for an element's parameter", element!("place = \"base\"\nmotion = \"x\"\nlaw = \"constant\"\ncompliance_m_per_n = \"soft\""), ":83: element.compliance_m_per_n: ", "expected a number"),
    ("an element of another size", element!("place = \"base\"\nmotion = \"x\"\nlaw = \"constant\"\ncompliance_m_per_n = 1e-3"), ":83: element.compliance_m_per_n: ", "smaller number"),
    ("too many elements", Make(|good| format!("{good}{}", "[[element]]\nplace = \"base\"\nmotion = \"x\"\nlaw = \"constant\"\ncompliance_m_per_n = 1e-9\n".repeat(9)).into()), ":119: element: ", "at most 8"),
];
