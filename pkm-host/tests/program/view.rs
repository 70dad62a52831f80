//! `view`: the page, its numbers against the core asked in other ways, and what it refuses.

use pkm_core::effects::Effects;
use pkm_core::nalgebra::{Vector2, Vector3};
use pkm_core::tables::reference::{MACHINE_F64, PARAMETERS, TABLE_F64, WRIST};
use pkm_core::{Configuration, Machine, MachineParameters, Pose, Wrench};
use pkm_host::files::machine::MachineFile;
use pkm_host::files::source::Source;
use pkm_host::files::table::TableFile;
use pkm_view::{ANSWER, FORM, Form, MACHINE_NUMBERS, Request, START, TABLE_NUMBERS, View, write_machine};
use serde_json::Value;

use crate::common::{FIVE, Folder, fixture, json, numbers, refused};

/// Part of an answer by its name.
fn part<'a>(answer: &'a [f64], names: &[(&str, usize)], name: &str) -> &'a [f64] {
    let at = names.iter().take_while(|(n, _)| *n != name).map(|(_, length)| length).sum::<usize>();
    let (_, length) = names.iter().find(|(n, _)| *n == name).expect("a part");
    &answer[at..at + length]
}

fn reference(effects: Effects) -> [f64; MACHINE_NUMBERS] {
    let pose_box = [[-0.26, 0.26], [-0.26, 0.26], [0.5, 0.56]];
    write_machine(&MachineParameters { effects, ..PARAMETERS }, &WRIST, &pose_box)
}

/// The page's data.
fn data(page: &str) -> Value {
    let begin = page.find("<script id=\"data\"").expect("data");
    let text = page[begin..].split_once('>').expect("a tag").1;
    serde_json::from_str(text.split_once("</script>").expect("its end").0).expect("JSON")
}

fn request(form: Form) -> Request {
    let pose = Pose { theta_rad: 0.11, sigma_rad: -0.07, z0_m: 0.535 };
    Request {
        configuration: Configuration { pose, beta_rad: Vector2::new(0.3, -0.2) },
        wrench: Wrench { force_n: Vector3::new(120.0, -30.0, -400.0), moment_nm: Vector3::new(1.0, -2.0, 5.0) },
        temperature_c: 20.0,
        form,
    }
}

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    let size = expected.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance * size, "{found} is not {expected}");
    }
}

#[test]
fn answers_are_those_of_the_core_asked_otherwise() {
    let effects = Effects::NONE.with("wrist-compliance", [2e-9, 3e-7]).expect("an effect");
    let effects = effects.with("clearance", [4e-6, 100.0]).expect("an effect");
    let machine = Machine::<f64>::new(&MachineParameters { effects, ..PARAMETERS }).expect("a machine");
    let five = pkm_core::FiveAxis { machine: &machine, ..FIVE };
    let mut view = View::new(&reference(effects)).expect("a view");
    let asked = request(Form::Basic);
    assert!(view.solve(&asked));
    let answer = *view.answer();
    let c = &asked.configuration;
    let expected = five.deflection(None, c, &asked.wrench).expect("a deflection");
    let basic = part(&answer, &ANSWER, "basic");
    close(part(basic, &FORM, "tip"), expected.translation_m.as_slice(), 1e-11);
    close(part(basic, &FORM, "turn"), expected.rotation_rad.as_slice(), 1e-11);
    close(part(basic, &FORM, "k"), machine.stiffness(&c.pose).expect("K_p").matrix().as_slice(), 1e-14);
    let frame = five.frame(c).expect("a frame");
    assert_eq!(part(&answer, &ANSWER, "tip"), frame.tip_m.as_slice());
    let (margin_m, limb) = machine.travel_margin_m(&five.joints(c).expect("joints").lengths).expect("finite");
    assert_eq!(part(&answer, &ANSWER, "margin"), [margin_m, f64::from(limb)]);
    // the last link of the wrist ends at the tip
    let spindle = &part(&answer, &ANSWER, "wrist")[9..];
    let tip: Vec<f64> = (0..3).map(|i| spindle[i] + frame.axes[(i, 2)] * WRIST.flange_m).collect();
    close(part(&answer, &ANSWER, "tip"), &tip, 1e-12);
    // limbs are as long as the screws say, and the ellipsoid is what unit forces do
    let (base, joints) = (part(&answer, &ANSWER, "base"), part(&answer, &ANSWER, "joints"));
    let lengths: Vec<f64> = (0..3)
        .map(|i| {
            (Vector3::from_column_slice(&joints[3 * i..3 * i + 3])
                - Vector3::from_column_slice(&base[3 * i..3 * i + 3]))
            .norm()
        })
        .collect();
    close(part(&answer, &ANSWER, "lengths"), &lengths, 1e-12);
    let stiffness = machine.stiffness(&c.pose).expect("K_p");
    let at_tip = five.tip_stiffness(&stiffness, c).expect("K at the tip").factor().expect("a factor");
    let along =
        at_tip.deflection(&Wrench { force_n: Vector3::x(), ..Wrench::ZERO }).expect("a deflection").translation_m;
    let ellipsoid = part(&answer, &ANSWER, "ellipsoid_tip");
    let force = frame.axes.column(0).into_owned();
    let seen = nalgebra::Matrix3::from_column_slice(ellipsoid) * force;
    close(seen.as_slice(), (frame.axes * along).as_slice(), 1e-9);
}

#[test]
fn with_a_table_deflection_and_command_are_those_of_the_five_axes() {
    let folder = Folder::new();
    let table = TableFile::parse(&Source::read(folder.table().as_ref()).expect("a file")).expect("a table").numbers();
    let mut row = Box::new([0.0; TABLE_NUMBERS]);
    let exponents = table.terms.iter().flatten().map(|e| f64::from(*e));
    let all = table.centre.into_iter().chain(table.half_width).chain([table.terms.len() as f64]).chain(exponents);
    let factor = table.factor.iter().flatten().copied();
    let all = all.chain(table.diagonal.iter().copied()).chain([1.0]).chain(factor);
    row.iter_mut().zip(all).for_each(|(to, v)| *to = v);
    let mut view = View::new(&reference(Effects::NONE)).expect("a view");
    view.set_table(&row).expect("a table");
    let asked = request(Form::Factor);
    assert!(view.solve(&asked));
    let (answer, c) = (view.answer(), &asked.configuration);
    assert_eq!(part(answer, &ANSWER, "inside"), [1.0]);
    let expected = FIVE.deflection(Some(&TABLE_F64), c, &asked.wrench).expect("a deflection");
    close(part(part(answer, &ANSWER, "factor"), &FORM, "tip"), expected.translation_m.as_slice(), 1e-9);
    let diagonal = TABLE_F64.diagonal_form(&MACHINE_F64, &c.pose).expect("K_m").factor.stiffness();
    close(part(part(answer, &ANSWER, "diagonal"), &FORM, "k"), diagonal.matrix().as_slice(), 1e-9);
    let tool = FIVE.tool(c).expect("a tool");
    let command = FIVE.compensated(Some(&TABLE_F64), &tool, &asked.wrench, c).expect("a command");
    close(part(answer, &ANSWER, "command_lengths"), command.solution.joints.lengths.q_m.as_slice(), 1e-9);
}

#[test]
fn a_page_stands_alone_and_is_the_same_every_time() {
    let folder = Folder::new();
    let (table, path) = (fixture("jobs/wide-table.json"), fixture("jobs/path.ngc"));
    let call = |name: &str| json(&["view", "--table", &table, "--path", &path, "--out", &folder.path(name)]);
    let (one, two) = (call("one.html"), call("two.html"));
    let page = folder.read("one.html");
    assert_eq!(page, folder.read("two.html"));
    assert_eq!(one["checksum"], two["checksum"]);
    assert!(page.len() < 1_500_000 && !page.contains("http://") && !page.contains("https://"));
    let data = data(&page);
    assert_eq!(data["checksum"]["value"], one["checksum"]);
    let text: Vec<f64> =
        data["machine"]["numbers"].as_array().expect("numbers").iter().filter_map(Value::as_f64).collect();
    let file = MachineFile::read(None).expect("the reference machine");
    let [theta, sigma, z0] = file.pose_box.ranges();
    let pose_box = [theta.map(f64::to_radians), sigma.map(f64::to_radians), z0.map(|mm| mm / 1e3)];
    let expected = write_machine(&PARAMETERS, &WRIST, &pose_box);
    assert!(text.iter().map(|v| v.to_bits()).eq(expected.iter().map(|v| v.to_bits())), "numbers lost bits on the way");
    // the path's points hold the tips that the program asks for
    let last = data["path"]["points"].as_array().expect("points").last().expect("a point").clone();
    let [theta_rad, sigma_rad, z0_m, beta1, beta2] = numbers(&last[2]);
    let end = Configuration { pose: Pose { theta_rad, sigma_rad, z0_m }, beta_rad: Vector2::new(beta1, beta2) };
    assert!(FIVE.tool(&end).is_ok());
}

#[test]
fn another_machine_another_sum() {
    let sum = |effects| View::new(&reference(effects)).expect("a view").sweep(START, 0, 50);
    let soft = Effects::NONE.with("limb-2-axial", [1e-9]).expect("an effect");
    assert_ne!(sum(Effects::NONE), sum(soft));
    let elastic = Effects::NONE.with_element("limb.2.body", "axial", "constant", [1e-9]).expect("an element");
    assert_ne!(sum(Effects::NONE), sum(elastic));
}

#[test]
fn what_is_not_of_this_machine_is_refused() {
    let folder = Folder::new();
    let out = folder.path("page.html");
    let placement = r#"{"machine": "other", "machine_sha256": "0", "series": []}"#;
    let foreign = folder.write("placement.json", placement);
    let error = refused(&["view", "--placement", &foreign, "--out", &out]);
    assert!(error["message"].as_str().expect("a message").contains("another machine file"), "{error}");
    assert_eq!(error["column"], "machine_sha256");
    let error = refused(&["view", "--diagnosis", &foreign, "--out", &out]);
    assert!(error["message"].as_str().expect("a message").contains("not what `diagnose`"), "{error}");
    let far = folder
        .write("far.csv", "x_mm,y_mm,z_mm,i,j,k,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n9000,0,1137,0,0,1,0,0,0,0,0,0\n");
    let error = refused(&["view", "--path", &far, "--out", &out]);
    assert_eq!(error["line"], 2);
    assert!(!folder.has("page.html"));
}

/// No option of `compensate` is advised that `view` does not have.
#[test]
fn a_program_that_needs_a_job_is_told_what_view_plays() {
    let folder = Folder::new();
    let out = folder.path("page.html");
    let begin = "G0 X-205 Y0 Z1137 I0 J0 K1\n";
    for line in ["G54", "G43 H1", "G0 C5", "G54 G0 X1 C5"] {
        let path = folder.write("p.ngc", &format!("{begin}{line}\n"));
        let error = refused(&["view", "--path", &path, "--out", &out]);
        let message = error["message"].as_str().expect("a message");
        assert!(message.contains("G-code whose X Y Z are those of B") && !message.contains("--"), "{line}: {message}");
        assert_eq!(error["line"], 2, "{line}");
    }
    let path = folder.write("p.ngc", "G1 X-205 Y0 Z1137\n");
    let error = refused(&["view", "--path", &path, "--out", &out]).to_string();
    assert!(error.contains("A and B (the wrist") && !error.contains("--job"), "{error}");
}
