//! What counts as right, and how often.

use serde_json::{Value, json};

use super::{Answer, Outcome, Truth, report, wilson};

fn said(verdict: &str, effects: &Value, findings: &Value) -> Answer {
    let error = json!({"linear_um_rms": 1.0, "linear_um_max": 2.0});
    Answer::new(&json!({
        "verdict": verdict, "effects": effects, "declared_value_findings": findings,
        "lack_of_fit": {"statistic": 1.0, "p": 0.4, "noise_source": "repeats"},
        "holdout": {"poses": 22, "before": error, "after": error, "retuned_only": error, "table_only": error}
    }))
    .unwrap()
}

fn outcome(truth: &Value, unloading: bool, answer: Answer) -> Outcome {
    let truth = Truth::new(truth, unloading, true);
    Outcome { name: "set".into(), truth, answer: Ok(answer), seconds: 1.0 }
}

#[test]
fn a_class_counts_and_a_guess_outside_it_does_not() {
    let truth = json!({"contains": ["clearance"], "lambda": 200});
    let effect = |id: &str, class: &[&str]| json!([{"id": id, "parameters": {}, "confidence": 1.0, "class": class}]);
    let friction = said("explained", &effect("friction-hysteresis", &[]), &json!([]));
    assert_eq!(outcome(&truth, false, friction.clone()).right(), [true]);
    let o = outcome(&truth, true, friction);
    assert_eq!((o.right(), o.wrong()), (vec![false], vec!["friction-hysteresis"]));
    let by_class = said("ambiguous", &effect("preload", &["clearance", "limb.1.body.young_gpa"]), &json!([]));
    assert_eq!(outcome(&truth, true, by_class.clone()).right(), [true]);
    let clean = outcome(&json!({"contains": []}), true, by_class);
    assert_eq!((clean.truth.kind.as_str(), clean.wrong()), ("none", vec!["preload"]));
}

#[test]
fn a_softer_joint_may_come_out_as_a_declared_value_and_the_reverse() {
    let body = |limb: u8| {
        let parameter = format!("limb.{limb}.body.young_gpa");
        json!([{"parameter": parameter, "class": [], "declared": 1, "estimated": 2, "pull_sd": 4}])
    };
    let finding = body(1);
    for (limb, right) in [(1, true), (2, false)] {
        let said = said("adequate", &json!([]), &body(limb));
        assert_eq!(outcome(&json!({"contains": ["limb-1-axial"]}), true, said).right(), [right]);
    }
    let wrong = json!({"contains": [], "declared_value_finding": "joint", "declared_parameters": ["limb.3.platform_joint.linear_n_per_m"]});
    let o = outcome(&wrong, true, said("explained", &json!([{"id": "limb-3-axial", "class": []}]), &json!([])));
    assert!(o.declared_found() && o.truth.kind == "declared");
    let o = outcome(&wrong, true, said("explained", &json!([{"id": "preload", "class": []}]), &finding));
    assert!(!o.declared_found());
}

#[test]
fn what_is_outside_the_list_must_not_be_explained() {
    let truth = json!({"contains": ["(outside the list)"], "lambda": 900});
    let effects = json!([{"id": "preload", "class": []}]);
    assert!(outcome(&truth, true, said("explained", &effects, &json!([]))).claimed());
    let part = outcome(&truth, true, said("partly_explained", &effects, &json!([])));
    assert!(!part.claimed() && part.truth.kind == "outside");
    assert!(report(&[part], true).contains("| outside the list: not claimed"));
}

#[test]
fn a_place_or_one_of_its_class_counts() {
    let body = ["limb.1.body", "limb.1.base_joint"];
    let truth = json!({"contains": ["limb-1-axial", "base-compliance"], "where_ok": [body, ["base"]]});
    let effect = |place: &str, class: &[&str]| json!({"id": "element", "where": place, "where_class": class});
    let found = |effects: Value| outcome(&truth, true, said("explained", &effects, &json!([])));
    let o = found(json!([effect("moving_platform", &["limb.1.base_joint"]), effect("tool", &[])]));
    assert_eq!((o.located(), o.misplaced()), (vec![true, false], 1));
    // a list that is longer than four places is no finding, right or wrong
    let long = ["limb.1.base_joint", "limb.2.body", "limb.3.body", "tool"];
    let o = found(json!([effect("base", &long), effect("moving_platform", &long)]));
    assert_eq!((o.located(), o.misplaced()), (vec![false, false], 0));
    // a place is no name
    assert!(o.wrong().is_empty() && !o.claimed());
    let value = json!([{"parameter": "limb.1.body.young_gpa", "class": []}]);
    let o = outcome(&truth, true, said("explained", &json!([effect("base", &[])]), &value));
    assert_eq!((o.located(), o.misplaced()), (vec![true, true], 0));
}

#[test]
fn one_find_accounts_for_one_thing() {
    let at_a = ["tool", "moving_platform"];
    let truth = json!({"contains": ["wrist-compliance", "moving-platform-compliance"],
        "where_ok": [["tool"], ["moving_platform", "limb.1.platform_joint"]]});
    let effect = |place: &str, class: &[&str]| json!({"id": "element", "where": place, "where_class": class});
    let found = |effects: Value| outcome(&truth, true, said("explained", &effects, &json!([])));
    let o = found(json!([effect("tool", &at_a)]));
    assert_eq!((o.located(), o.misplaced()), (vec![true, false], 0));
    // the first thing gives way to the second where it has another find
    let o = found(json!([effect("moving_platform", &at_a), effect("tool", &[])]));
    assert_eq!((o.located(), o.misplaced()), (vec![true, true], 0));
    let o = found(json!([effect("tool", &[]), effect("limb.1.platform_joint", &[])]));
    assert_eq!(o.located(), [true, true]);
}

#[test]
fn an_answer_that_breaks_the_contract_is_a_failure() {
    assert!(Answer::new(&json!({"verdict": "adequate"})).is_err());
}

#[test]
fn wilson_is_that_of_the_textbook() {
    let (low, high) = wilson(0, 300);
    assert!(low < 1e-9 && (high - 0.01264).abs() < 1e-4, "{low} {high}");
    let (low, high) = wilson(95, 100);
    assert!((low - 0.8882).abs() < 1e-3 && (high - 0.9785).abs() < 1e-3, "{low} {high}");
}

#[test]
fn what_is_said_with_a_probability_is_counted_by_it() {
    let truth = json!({"contains": ["(outside the list)"], "lambda": 900, "where_ok": [["base"]]});
    let at = |place: &str, class: &[&str], probability: f64| {
        let effects =
            json!([{"id": "element", "class": [], "where": place, "where_class": class, "probability": probability}]);
        outcome(&truth, true, said("partly_explained", &effects, &json!([])))
    };
    let sets = [
        at("base", &[], 0.97),
        at("tool", &["base"], 0.98),
        at("tool", &[], 0.96),
        at("sensor", &[], 0.62),
        // not located, so that nothing is said
        at("limb.1.body", &["limb.2.body", "limb.3.body", "base", "tool"], 0.85),
    ];
    let report = report(&sets, true);
    let row = |begin: &str| {
        report.lines().find(|l| l.starts_with(begin)).map(|l| l.split('|').map(str::trim).collect::<Vec<_>>())
    };
    assert_eq!(row("| 0.95-0.99").unwrap()[2..5], ["3", "0.970", "0.667"]);
    assert_eq!(row("| 0.60-0.70").unwrap()[2..5], ["1", "0.620", "0.000"]);
    assert!(row("| 0.80-0.90").is_none());
}
