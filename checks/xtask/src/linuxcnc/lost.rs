//! What the compensator says of place and load where a sensor, a drive or the controller says nothing.

use std::path::Path;

use super::learning::{Session, expect, place, probing};
use super::replay::Host;
use crate::Outcome;

/// `PKM_ERROR_NOT_FINITE` and `PKM_ERROR_WRENCH_NOT_FINITE`.
const NOT_FINITE: f64 = 3.0;
const WRENCH_NOT_FINITE: f64 = 80.0;

/// Without a load the place is told all the same, and without a drive's position its last one, with a fault.
pub fn what_is_lost(out: &Path, host: &Host) -> Outcome {
    let five = host.five()?;
    let session = Session { out, host };
    let at = probing(host, &five, 1)?;
    let wait = "loadusr -w sleep 0.3\n";
    let stands = place(&five, &at)?
        + "addf pkmcompensator.from-drives servo\nsetp pkmcompensator.drive-fb-0 500\n\
                                       setp pkmcompensator.enable 1\n"
        + wait;
    let pins = ["fault-code", "sensor-fault", "inside-box", "share", "k-11", "ok", "offset-0"].map(str::to_owned);
    let known = session.run(&stands, &pins)?;
    if !(known[6].abs() > 1e-3 && known[..3] == [0.0, 0.0, 1.0] && known[3] > 0.0 && known[4] > 1e6 && known[5] == 1.0)
    {
        return Err(format!("expected a machine in its box without a fault: {known:?}"));
    }
    // the load is lost, then the machine moves: out of the box's middle, and where no posture is
    let elsewhere = probing(host, &five, 2)?;
    let lost = format!("{stands}setp pkmcompensator.fx nan\n");
    let moved = lost.clone() + &place(&five, &elsewhere)? + "setp pkmcompensator.fx nan\n" + wait;
    let [there, found] = [place(&five, &elsewhere)? + wait, moved].map(|lines| session.run(&lines, &pins));
    let (there, found) = (there?, found?);
    expect("a lost load", &found[..3], &[WRENCH_NOT_FINITE, 1.0, 1.0], 0.0)?;
    expect("stiffness under a lost load", &found[4..5], &there[4..5], 1e-6 * there[4])?;
    expect("whether all of it is known", &found[5..6], &[0.0], 0.0)?;
    // with a load it is the share of the place that the compensation goes to
    expect("the share under a lost load", &found[3..4], &there[3..4], 1e-2)?;
    let nowhere = session.run(&(lost + "setp pkmcompensator.joint-0 0\n" + wait), &pins)?;
    expect("a place that is none", &nowhere[2..4], &[0.0, 0.0], 0.0)?;

    let drives = ["fault-code", "sensor-fault", "feedback-0", "offset-0"].map(str::to_owned);
    let text = stands.clone() + "setp pkmcompensator.drive-fb-0 nan\n" + wait;
    let found = session.run(&text, &drives)?;
    expect("a lost drive", &found[..2], &[NOT_FINITE, 0.0], 0.0)?;
    // where it was when it was lost, with the offset of then
    expect("the last position", &found[2..3], &[500.0], 0.5)?;
    expect("the offset without a drive", &found[3..], &[0.0], 0.0)?;

    let commands = ["fault-code", "drive-0"].map(str::to_owned);
    let commanded = stands + "setp pkmcompensator.command-0 500\n" + wait;
    let lost = commanded.clone() + "setp pkmcompensator.command-0 nan\n" + wait;
    let [before, found] = [commanded, lost].map(|text| session.run(&text, &commands));
    let (before, found) = (before?, found?);
    expect("a command that is no number", &found[..1], &[NOT_FINITE], 0.0)?;
    expect("what the drive is asked for then", &found[1..], &before[1..], 1e-6)?;
    println!(
        "  a lost load, place, drive or command: the place is told as long as it is known, and no NaN reaches the controller or a drive"
    );
    Ok(())
}
