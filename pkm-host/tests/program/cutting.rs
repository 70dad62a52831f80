//! Cutting forces that are estimated from the cut, against sums over the edges of a turning tool and numbers by hand.

use pkm_core::nalgebra::Vector3;
use pkm_host::files::cutting::{Cut, Cutter, Engagement, Material, Side};
use pkm_host::plan::cutting::{milling, wrench};

use crate::common::{Folder, json, refused};

const STEEL: Material = Material { kc1_1_n_per_mm2: 2000.0, mc: 0.25, u_rel: 0.2, radial_ratio: 0.3, axial_ratio: 0.1 };

/// Force and torque as the mean over many angles of one turning edge, in vectors: whatever touches the material is pushed against its
/// velocity, toward the axis and along it.
fn summed(cut: &Cut, engagement: &Engagement, feed: Vector3<f64>) -> (Vector3<f64>, f64) {
    const ANGLES: usize = 400_000;
    let (spindle, radius_mm) = (Vector3::z(), cut.cutter.diameter_mm / 2.0);
    let right = Vector3::new(-feed.y, feed.x, 0.0);
    let (mut force, mut torque_nmm) = (Vector3::zeros(), 0.0);
    for n in 0..ANGLES {
        let angle = (n as f64 + 0.5) / ANGLES as f64 * std::f64::consts::TAU;
        let edge = Vector3::new(angle.cos(), angle.sin(), 0.0);
        let off_mm = radius_mm * edge.dot(&right);
        let cuts = match engagement.side {
            Side::Climb => off_mm >= radius_mm - engagement.width_mm,
            Side::Conventional => off_mm <= engagement.width_mm - radius_mm,
            Side::Centre => off_mm.abs() <= engagement.width_mm / 2.0,
        };
        let lead = cut.cutter.lead_deg.to_radians().sin();
        let chip_mm = cut.feed_per_tooth_mm * edge.dot(&feed) * lead;
        if !cuts || chip_mm <= 0.0 {
            continue;
        }
        let specific = cut.material.kc1_1_n_per_mm2 / chip_mm.powf(cut.material.mc);
        let tangential = specific * chip_mm * engagement.depth_mm / lead;
        let velocity = spindle.cross(&edge);
        force -= tangential * (velocity + cut.material.radial_ratio * edge + cut.material.axial_ratio * Vector3::z());
        torque_nmm -= tangential * radius_mm;
    }
    let share = f64::from(cut.cutter.teeth) / ANGLES as f64;
    (force * share, torque_nmm * share / 1e3)
}

#[test]
fn a_mills_force_is_the_mean_over_its_edges() {
    for (side, width_mm) in
        [(Side::Climb, 2.5), (Side::Conventional, 2.5), (Side::Centre, 6.0), (Side::Climb, 10.0), (Side::Climb, 7.0)]
    {
        for (lead_deg, angle) in [(90.0, 0.0_f64), (45.0, 2.0)] {
            let engagement = Engagement { depth_mm: 3.0, width_mm, side };
            let cutter = Cutter { diameter_mm: 10.0, teeth: 4, lead_deg, engagement: Some(engagement) };
            let cut = Cut { material: STEEL, cutter, feed_per_tooth_mm: 0.08 };
            let feed = Vector3::new(angle.cos(), angle.sin(), 0.0);
            let (force, torque) = summed(&cut, &engagement, feed);
            let found = wrench(&cut, &milling(&cut), &(feed * 0.003));
            let off = (found.force_n - force).norm() / force.norm();
            assert!(off < 3e-4, "{side:?} {width_mm}: {:?} {force:?}", found.force_n);
            assert!((found.moment_nm.z / torque - 1.0).abs() < 3e-4, "{torque}");
        }
    }
}

/// By hand: h = 0.1·sin 59° = 0.0857167 mm, kc = 2000·h^−0.25 = 3696.27 N/mm², thrust = kc/2·5·0.2·sin 59°, torque = kc·0.2·10²/8000.
#[test]
fn a_drills_thrust_and_torque_are_those_of_the_formulas() {
    let cutter = Cutter { diameter_mm: 10.0, teeth: 2, lead_deg: 59.0, engagement: None };
    let cut = Cut { material: STEEL, cutter, feed_per_tooth_mm: 0.1 };
    let load = |z: f64| wrench(&cut, &milling(&cut), &Vector3::new(0.0, 0.0, z));
    let down = load(0.004);
    assert!((down.force_n.z + 1584.16).abs() < 0.1 && (down.moment_nm.z + 9.24067).abs() < 1e-3, "{down:?}");
    assert_eq!(load(-0.004), pkm_core::Wrench::ZERO);
}

const TOOLS: &str = "format = 1\n[material]\nkc1_1_n_per_mm2 = 2000\nmc = 0.25\nu_rel = 0.2\naxial_ratio = 0.1\n[[tool]]\nnumber = 1\n\
                     length_mm = 0\nkind = \"mill\"\ndiameter_mm = 10\nteeth = 4\ndepth_mm = 3\nwidth_mm = 2.5\n";
const PROGRAM: &str = "G21 G90 G94 G17\nT1 M6\nS3000 M3\nG0 X-235 Y0 Z1130 I0 J0 K1\nG1 X-215 F960\nG0 Z1120\nM30\n";

fn compensated(folder: &Folder, program: &str, tools: &str, more: &[&str]) -> serde_json::Value {
    let (path, tools) = (folder.write("p.ngc", program), folder.write("t.toml", tools));
    let out = folder.path("out.ngc");
    json(&[&["compensate", "--path", &path, "--tools", &tools, "--out", &out], more].concat())
}

/// The whole command: a straight cut has the load that the sum over the edges gives, and its uncertainty leaves its share.
#[test]
fn a_program_is_compensated_for_estimated_forces() {
    let folder = Folder::new();
    let found = compensated(&folder, PROGRAM, TOOLS, &[]);
    let size = |found: &serde_json::Value, key: &str| found[key]["max"].as_f64().unwrap();
    assert_eq!(found["estimated_moves"], 1);
    let (before, off) = (size(&found, "error_before_um"), size(&found, "error_if_load_off_um"));
    assert!(before > 1.0 && (off / (0.2 * before) - 1.0).abs() < 0.02, "{before} {off}");
    assert!(size(&found, "error_after_um") < 0.01 * before);
    // 960 mm/min are 0.08 mm a tooth of four at 3000 turns a minute
    let engagement = Engagement { depth_mm: 3.0, width_mm: 2.5, side: Side::Climb };
    let cutter = Cutter { diameter_mm: 10.0, teeth: 4, lead_deg: 90.0, engagement: Some(engagement) };
    let (f, mz) = summed(&Cut { material: STEEL, cutter, feed_per_tooth_mm: 0.08 }, &engagement, Vector3::x());
    // the tool's frame is turned against B by the wrist: the load along B is compared by what it does
    let given = |wrench: String| {
        let program = PROGRAM.replace("G1 X-215", &format!("({wrench})\nG1 X-215"));
        size(&compensated(&folder, &program, TOOLS, &[]), "error_before_um")
    };
    let same = given(format!("wrench {},{},{},0,0,{mz}", f.x, f.y, f.z));
    assert!((same / before - 1.0).abs() < 2e-3, "{same} {before}");
    assert_eq!(given("F 10 20 -300".to_owned()), given("wrench 10,20,-300,0,0,0".to_owned()));
    // feed a turn says the same; twice the depth is twice the force
    let turn = PROGRAM.replace("G94", "G95").replace("F960", "F0.32");
    assert!((size(&compensated(&folder, &turn, TOOLS, &[]), "error_before_um") / before - 1.0).abs() < 1e-9);
    let deeper = PROGRAM.replace("G1 X", "(cut ap=6)\nG1 X");
    assert!((size(&compensated(&folder, &deeper, TOOLS, &[]), "error_before_um") / before - 2.0).abs() < 0.01);
    // a given load has the uncertainty of the call
    let call = PROGRAM.replace("G1 X", "(wrench 0,0,-300,0,0,0)\nG1 X");
    let found = compensated(&folder, &call, TOOLS, &["--load-u-rel", "0.1"]);
    let (before, off) = (size(&found, "error_before_um"), size(&found, "error_if_load_off_um"));
    assert!((off / (0.1 * before) - 1.0).abs() < 0.02, "{before} {off}");
}

#[test]
fn what_an_estimate_lacks_is_said() {
    let folder = Folder::new();
    let says = |program: &str, tools: &str, words: &str| {
        let (path, tools) = (folder.write("p.ngc", program), folder.write("t.toml", tools));
        let error = refused(&["compensate", "--path", &path, "--tools", &tools, "--out", &folder.path("o.ngc")]);
        assert!(error.to_string().contains(words), "{words}: {error}");
    };
    for (from, to, words) in [
        ("kc1_1_n_per_mm2 = 2000", "kc1_1_n_per_mm2 = -5", "kc1_1_n_per_mm2"),
        ("mc = 0.25\n", "", "material.mc"),
        ("u_rel = 0.2", "u_rel = 2", "u_rel"),
        ("teeth = 4", "teeth = 0", "expected 1 to 100 edges"),
        ("depth_mm = 3\n", "", "tool.depth_mm"),
        ("width_mm = 2.5", "width_mm = 12", "at most 10"),
        ("kind = \"mill\"\n", "", "tool.kind"),
        ("\"mill\"", "\"saw\"", "mill"),
    ] {
        says(PROGRAM, &TOOLS.replace(from, to), words);
    }
    for (from, to, words) in [
        ("S3000 M3", "M3", "give S, and F"),
        ("S3000 M3", "S3000 M4", "M4"),
        ("G94", "G93", "give S, and F"),
        ("T1 M6", "T2 M6", "a cut without a load: T2 (line 2) is not in"),
        ("T1 M6\n", "", "a cut without a load: no T says which tool of"),
        ("G1 X", "T2 M6\nG1 X", "is to be estimated, and T2 (line 5) is not in"),
        ("T1 M6\n", "T2\nM6\n(cut ap 2)\n", "(cut …): T2 (line 2) is not in"),
        ("G1 X", "(cut ae 20)\nG1 X", "at most 10"),
        ("G1 X", "(cut ap 2 deep)\nG1 X", "found `deep`"),
        ("G1 X", "(F 1 2)\nG1 X", "three or six numbers"),
        ("G1 X", "(cut ap 2) (F 1 2 3)\nG1 X", "`(cut ap 2)` and `(F 1 2 3)`: a line can set one load only"),
    ] {
        says(&PROGRAM.replace(from, to), TOOLS, words);
    }
    let without_edges = format!("{TOOLS}[[tool]]\nnumber = 2\nlength_mm = 0\n");
    says(&PROGRAM.replace("T1 M6", "T2 M6"), &without_edges, "T2 (line 2) has no `kind` and `teeth` in");
    // what two of them say of the same cut goes together
    compensated(&folder, &PROGRAM.replace("G1 X", "(cut ap 2) (cut ae 2)\nG1 X"), TOOLS, &[]);
    // a note that only begins so
    compensated(&folder, &PROGRAM.replace("G1 X", "(cut the wall)\n(F 200)\nG1 X"), TOOLS, &[]);
}
