//! Lists of poses, and what every command does with them alike.

use super::{Kind, Make, Put, Reader};

const GOOD: &str = "pose,theta_deg,sigma_deg,z0_mm\na,0,0,530\nb,-5.5,3,540\nc,5,-3,520\n";
const LENGTHS: &str = "pose,q1_mm,q2_mm,q3_mm\na,567.6,549.6,523.5\nb,560,560,560\n";

#[test]
fn poses() {
    let call = ["stiffness", "--poses", "BAD", "--out", "OUT"];
    Reader { good: GOOD, name: "p.csv", call: &call, old: "out" }.refuses(KINDS, 20);
}

#[test]
fn poses_by_screw_lengths() {
    let call = ["stiffness", "--poses", "BAD", "--out", "OUT"];
    Reader { good: LENGTHS, name: "q.csv", call: &call, old: "out" }.refuses(BY_LENGTHS, 20);
}

#[rustfmt::skip] // a kind a line
const KINDS: &[Kind] = &[
    ("a decimal comma between semicolons, and one too many", Make(|good| good.replace(',', ";").replace("-5.5", "-5,5,5").into()), ":3: theta_deg: ", "number|-5,5,5"),
    ("points for thousands", Make(|good| good.replace(',', ";").replace("530", "1.530,0").into()), ":2: z0_mm: ", "number|1.530,0"),
    ("semicolons in one line alone", Put("b,-5.5,3,540", "b;-5.5;3;540"), ":3: ", "expected 4 cells as in the header, found 1"),
    ("commas under a header of semicolons", Put("pose,theta_deg,sigma_deg,z0_mm", "pose;theta_deg;sigma_deg;z0_mm"), ":2: ", "expected 4 cells as in the header, found 1"),
    ("the last line cut off", Make(|good| good[..good.len() - 5].into()), ":4: ", "expected 4 cells as in the header, found 3"),
    ("a second header", Put("b,", "pose,theta_deg,sigma_deg,z0_mm\nb,"), ":3: theta_deg: ", "number|theta_deg"),
    ("two files in one with another order", Put("b,", "pose,z0_mm,theta_deg,sigma_deg\nb,"), ":3: theta_deg: ", "number|z0_mm"),
    ("a title above the header", Make(|good| format!("Poses of May\n{good}").into()), ":1: ", "commas or semicolons"),
    ("a line of units", Put("a,0", ",°,°,mm\na,0"), ":2: theta_deg: ", "number|°"),
    ("a sum below", Make(|good| format!("{good},-0.5,0,1590\n").into()), ":5: pose: ", "travel"),
    ("an id twice", Put("c,", "a,"), ":4: pose: ", "duplicate pose `a`|line 2"),
    ("an id twice at another pose", Put("b,-5.5", "a,-5.5"), ":3: pose: ", "duplicate pose `a`|line 2"),
    ("above travel", Put("540", "940"), ":3: pose: ", "pose `b`|mm long, travel 420 to 770 mm"),
    ("below the base", Put("540", "-540"), ":3: pose: ", "pose `b`"),
    ("in the base", Put("540", "0"), ":3: pose: ", "pose `b`"),
    ("metres", Put("540", "0.54"), ":3: pose: ", "are lengths in mm?"),
    ("an angle beyond 90°", Put("-5.5", "-95.5"), ":3: pose: ", "pose `b`"),
    ("degrees, minutes and seconds", Put("-5.5", "-5°30'"), ":3: theta_deg: ", "number|without unit"),
    ("a fraction", Put("-5.5", "-11/2"), ":3: theta_deg: ", "number|-11/2"),
    ("a formula", Put("-5.5", "=-11/2"), ":3: theta_deg: ", "number"),
    ("underscores", Put("540", "5_40"), ":3: z0_mm: ", "number"),
    ("digits of another script", Put("540", "٥٤٠"), ":3: z0_mm: ", "number|٥٤٠"),
    ("full-width digits", Put("540", "５４０"), ":3: z0_mm: ", "number|５４０"),
    ("an invisible space", Put("540", "540\u{200b}"), ":3: z0_mm: ", "number"),
    ("a question mark", Put("540", "?"), ":3: z0_mm: ", "number|?"),
    ("a comment behind", Put("540", "540 # high"), ":3: z0_mm: ", "number|540 # high"),
    ("a bell", Put("540", "5\u{7}40"), ":3: z0_mm: ", "number"),
    ("a sign twice", Put("-5.5", "--5.5"), ":3: theta_deg: ", "number|--5.5"),
];

#[rustfmt::skip] // a kind a line
const BY_LENGTHS: &[Kind] = &[
    ("a length beyond travel", Put("567.6", "867.6"), ":2: q1_mm: ", "pose `a`|867.6 mm long, travel 420 to 770 mm"),
    ("metres", Put("567.6,549.6,523.5", "0.5676,0.5496,0.5235"), ":2: q3_mm: ", "pose `a`|are lengths in mm?"),
    ("a negative length", Put("567.6", "-567.6"), ":2: q1_mm: ", "pose `a`"),
    ("lengths that nothing closes", Put("567.6,549.6,523.5", "420,770,500"), ":2: pose: ", "pose `a`"),
    ("a length missing", Put("q2_mm", "note"), ":1: q2_mm: ", "missing column"),
    ("a length in another unit", Put("q2_mm", "q2_m"), ":1: q2_m: ", "did you mean `q2_mm`?"),
    ("a length twice", Put("q2_mm", "q1_mm"), ":1: q1_mm: ", "duplicate"),
    ("a fourth length", Put("q3_mm\n", "q3_mm,q4_mm\n"), ":2: ", "expected 5 cells"),
    ("an angle as well", Make(|_| "pose,q1_mm,q2_mm,q3_mm,theta_deg\na,560,560,560,0\n".into()), ":1: q1_mm: ", "not both"),
    ("an empty length", Put("567.6", ""), ":2: q1_mm: ", "number|empty cell"),
];
