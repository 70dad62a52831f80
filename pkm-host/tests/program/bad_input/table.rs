//! `coefficients.json`.

use super::{Kind, Make, Put, Reader};
use crate::common::fixture;

/// Laid out as `fit` writes it.
#[test]
fn tables() {
    let good = std::fs::read_to_string(fixture("jobs/wide-table.json")).unwrap();
    let poses = fixture("poses/table5.csv");
    let call = ["stiffness", "--poses", &poses, "--table", "BAD", "--out", "OUT"];
    Reader { good: &good, name: "t.json", call: &call, old: "out" }.refuses(KINDS, 60);
}

/// A change to the document.
macro_rules! document {
    ($change:expr) => {
        Make(|good| {
            let mut table: serde_json::Value = serde_json::from_str(good).unwrap();
            let change: fn(&mut serde_json::Value) = $change;
            change(&mut table);
            serde_json::to_vec(&table).unwrap()
        })
    };
}

#[rustfmt::skip] // a kind a line
const KINDS: &[Kind] = &[
    // no JSON, or not all of it
    ("empty", Make(|_| Vec::new()), ":1: ", "not all of it"),
    ("a byte-order mark alone", Make(|_| "\u{feff}".into()), ":1: ", "not all of it"),
    ("an empty document", Make(|_| "{}".into()), ":1: ", "missing|format"),
    ("an array", Make(|_| "[]".into()), ":1: ", "expected a table"),
    ("null", Make(|_| "null".into()), ":1: ", "expected a table, found null"),
    ("text", Make(|_| "\"table\"".into()), ":1: ", "expected a table, found string"),
    ("another document of the program's", Make(|_| "{\n  \"train\": 1,\n  \"verify\": null\n}\n".into()), ":2: ", "train|expected"),
    ("two documents", Make(|good| format!("{good}{good}").into()), ":1220: ", "trailing characters"),
    ("a document a line", Make(|_| "{\"format\": 1}\n{\"format\": 1}\n".into()), ":1: ", "missing"),
    ("TOML", Make(|_| "format = 1\n".into()), ":1: ", "not JSON"),
    ("CSV", Make(|_| "pose,k11\na,1\n".into()), ":1: ", "not JSON"),
    ("Rust source", Make(|_| "//! Stiffness table of `reference`.\n".into()), ":1: ", "not JSON"),
    ("cut off", Make(|good| good[..good.len() / 2].into()), "", "not all of it"),
    ("a comment", Put("{\n", "{ // a table\n"), ":1: ", "not JSON"),
    ("a comma too many", Put("\"reference\",\n", "\"reference\",,\n"), ":3: ", "not JSON"),
    ("a comma at the end", Put("      -27.0,\n      36.0\n", "      -27.0,\n      36.0,\n"), ":11: box.theta_deg: ", "comma"),
    ("a comma at the document's end", Make(|good| good.trim_end().trim_end_matches('}').trim_end().to_owned().into_bytes().into_iter().chain(*b",\n}\n").collect()), "", "comma"),
    ("a missing comma", Put("\"format\": 1,", "\"format\": 1"), ":3: ", "not JSON"),
    ("a missing colon", Put("\"format\": 1,", "\"format\" 1,"), ":2: ", "not JSON"),
    ("a missing quote", Put("\"reference\",", "\"reference,"), ":4: machine: ", "not JSON"),
    ("single quotes", Put("\"reference\"", "'reference'"), ":3: ", "not JSON"),
    ("a key without quotes", Put("\"format\": 1", "format: 1"), ":2: ", "not JSON"),
    ("a missing bracket", Put("      36.0\n    ],", "      36.0\n    ,"), "", "not JSON"),
    ("a brace for a bracket", Put("      36.0\n    ],", "      36.0\n    },"), "", "not JSON"),
    ("10,000 brackets for a name", Make(|good| good.replacen("\"reference\"", &"[".repeat(10_000), 1).into()), ":3: ", "machine"),
    ("10,000 brackets at the top", Make(|_| "[".repeat(10_000).into()), ":1: ", "found an array"),
    ("10,000 brackets under an unknown key", Make(|good| good.replacen("\"format\"", &format!("\"x\": {}", "[".repeat(10_000)), 1).into()), ":2: ", "x"),
    ("a key twice", Put("\"format\": 1,", "\"format\": 1,\n  \"format\": 1,"), ":3: ", "duplicate key|format"),
    ("a machine twice", Put("\"data\":", "\"machine\": \"x\",\n  \"data\":"), ":5: ", "duplicate key|machine"),
    ("a line of 10 MB", Make(|good| good.replacen("{", &format!("{{{}", " x".repeat(5_000_000)), 1).into()), ":1: ", "not JSON"),
    ("a key of 10 MB", Make(|good| good.replacen("\"format\"", &format!("\"{}\"", "x".repeat(10_000_000)), 1).into()), ":2: ", "unknown key"),
    // numbers
    ("a decimal comma", Put("-27.0,", "-27,0,"), "", "box.theta_deg"),
    ("a comma for thousands", Put("        0.572418628297733,", "        1,572.41,"), "", "coefficients"),
    ("a minus of typography", Put("-27.0", "\u{2212}27.0"), ":9: ", "not JSON"),
    ("a degree sign", Put("-27.0", "-27.0°"), ":9: ", "not JSON"),
    ("a plus", Put("36.0", "+36.0"), ":10: ", "not JSON"),
    ("no digit before the point", Put("0.572418628297733", ".572418628297733"), "", "not JSON"),
    ("zeros in front", Put("36.0", "036.0"), ":10: ", "not JSON"),
    ("hexadecimal", Put("36.0", "0x24"), ":10: ", "not JSON"),
    ("NaN", Put("0.572418628297733", "NaN"), "", "not JSON"),
    ("infinity", Put("0.572418628297733", "Infinity"), "", "not JSON"),
    ("beyond all numbers", Put("0.572418628297733", "1e999"), "", "number"),
    ("null for a number", Put("0.572418628297733", "null"), "", "number|null"),
    ("text for a number", Put("0.572418628297733", "\"0.57\""), "", "number|string"),
    ("true for a number", Put("0.572418628297733", "true"), "", "number|boolean"),
    ("a million digits", Make(|good| good.replacen("0.572418628297733", &"9".repeat(1_000_000), 1).into()), "", "number"),
    // shapes
    ("another format", Put("\"format\": 1", "\"format\": 2"), ": format: ", "expected 1, found 2"),
    ("a format in quotes", Put("\"format\": 1", "\"format\": \"1\""), ":2: ", "format"),
    ("a negative format", Put("\"format\": 1", "\"format\": -1"), ":2: ", "format"),
    ("no format", Put("  \"format\": 1,\n", ""), "", "missing|format"),
    ("no scale", document!(|t| drop(t.as_object_mut().unwrap().remove("scale"))), "", "missing|scale"),
    ("no box", document!(|t| drop(t.as_object_mut().unwrap().remove("box"))), "", "missing|box"),
    ("no checksum", document!(|t| drop(t.as_object_mut().unwrap().remove("machine_sha256"))), "", "missing|machine_sha256"),
    ("an unknown key", document!(|t| t["extra"] = 1.into()), ":1: ", "unknown key|extra"),
    ("an unknown key of the box", document!(|t| t["box"]["z0_m"] = serde_json::json!([0.4, 0.6])), ":1: ", "unknown key|z0_m"),
    ("a misspelt key", Put("\"scale\"", "\"scales\""), ":26: scales: ", "did you mean `scale`?"),
    ("a box of three numbers", document!(|t| t["box"]["theta_deg"] = serde_json::json!([-27, 0, 36])), "", "box.theta_deg|more values"),
    ("a box of one number", document!(|t| t["box"]["theta_deg"] = serde_json::json!([-27])), "", "box.theta_deg|array of length 2"),
    ("a number for the box", document!(|t| t["box"] = 5.into()), "", "box"),
    ("a center of two numbers", document!(|t| t["center"] = serde_json::json!([4.5, 0])), "", "center|array of length 3"),
    ("text for rows", document!(|t| t["diagonal"]["coefficients"] = "x".into()), "", "diagonal.coefficients|string"),
    ("a row too few", document!(|t| drop(t["diagonal"]["coefficients"].as_array_mut().unwrap().pop())), ": diagonal.coefficients: ", "6 rows of 33 coefficients"),
    ("a row too many", document!(|t| t["factor"]["coefficients"].as_array_mut().unwrap().push(vec![0.0; 33].into())), ": factor.coefficients: ", "21 rows of 33 coefficients"),
    ("a coefficient too few", document!(|t| drop(t["diagonal"]["coefficients"][0].as_array_mut().unwrap().pop())), ": diagonal.coefficients: ", "6 rows of 33 coefficients"),
    ("a coefficient in the wrong row", document!(|t| {
        let c = t["diagonal"]["coefficients"][0].as_array_mut().unwrap().pop().unwrap();
        t["diagonal"]["coefficients"][1].as_array_mut().unwrap().insert(0, c);
    }), ": diagonal.coefficients: ", "6 rows of 33 coefficients"),
    ("no terms", document!(|t| t["terms"] = serde_json::json!([])), "", "terms"),
    ("a term twice", document!(|t| t["terms"][1] = t["terms"][0].clone()), ": terms: ", "one twice"),
    ("a term of two exponents", document!(|t| t["terms"][1] = serde_json::json!([1, 0])), "", "terms|3"),
    ("an exponent too great", document!(|t| t["terms"][1][0] = 9.into()), ": ", "exponent"),
    ("an exponent beyond a byte", document!(|t| t["terms"][1][0] = 300.into()), "", "terms|300"),
    ("a negative exponent", document!(|t| t["terms"][1][0] = (-1).into()), "", "terms|-1"),
    ("a broken exponent", document!(|t| t["terms"][1][0] = 0.5.into()), "", "terms|0.5"),
    ("a thousand terms", document!(|t| t["terms"] = (0..1000).map(|_| serde_json::json!([0, 0, 0])).collect()), ": diagonal.coefficients: ", "6 rows of 1000"),
    // what the numbers mean
    ("no width", document!(|t| t["scale"][1] = 0.into()), ": box: ", "center ± scale"),
    ("a negative width", document!(|t| t["scale"][1] = (-24).into()), "", "scale"),
    ("the box of another table", document!(|t| t["box"]["z0_mm"][0] = 100.into()), ": box: ", "center ± scale"),
    ("a box the wrong way", document!(|t| t["box"]["theta_deg"] = serde_json::json!([36, -27])), ": box: ", "center ± scale"),
    ("a center in radians", document!(|t| t["center"][0] = 0.0785.into()), ": box: ", "center ± scale"),
    ("a width of another order", document!(|t| t["scale"] = serde_json::json!([90, 24, 31.5])), ": box: ", "center ± scale"),
    ("a negative factor", document!(|t| t["factor"]["coefficients"][5].as_array_mut().unwrap().iter_mut().for_each(|c| *c = (-c.as_f64().unwrap()).into())), "", "g33 is not positive"),
    ("a negative diagonal", document!(|t| t["diagonal"]["coefficients"][2][0] = (-1).into()), "", "c33 is not positive"),
    ("a huge coefficient", document!(|t| t["diagonal"]["coefficients"][0][5] = 1e300.into()), "", "c11 is not positive"),
];
