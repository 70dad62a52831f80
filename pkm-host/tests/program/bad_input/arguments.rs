//! The command line.

use rayon::prelude::*;
use serde_json::Value;

use super::{readable, require};
use crate::common::{Folder, fixture, run};

/// What is wrong, the arguments with `OUT` for a path, `POSES`, `TABLE` and `PATH` for good files, `LONG` for 100,000 digits, and
/// the words of the message.
type Call = (&'static str, &'static str, &'static str);

#[test]
fn arguments() {
    assert!(CALLS.len() >= 60, "{}", CALLS.len());
    let wrong: Vec<String> = CALLS.par_iter().filter_map(|call| refused(call).err()).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), CALLS.len(), wrong.join("\n"));
}

fn refused((what, args, words): &Call) -> Result<(), String> {
    let folder = Folder::new();
    let put = |arg: &str| {
        let arg = arg.replace("OUT", &folder.path("out")).replace("LONG", &"9".repeat(100_000));
        let arg = arg.replace("POSES", &fixture("poses/table5.csv")).replace("TABLE", &fixture("jobs/wide-table.json"));
        arg.replace("PATH", &fixture("jobs/path.csv")).replace("EMPTY", "")
    };
    let args: Vec<String> = args.split(' ').filter(|arg| !arg.is_empty()).map(put).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let check = || {
        let output = run(&args);
        let text = readable(&output)?;
        require(output.stdout.is_empty(), "something on standard output", &text)?;
        for word in words.split('|') {
            require(text.contains(word), &format!("no `{word}` in it"), &text)?;
        }
        let output = run(&[&args, &["--json"][..]].concat());
        require(readable(&output)?.lines().count() == 1, "more than a line with --json", &text)?;
        let document: Value = serde_json::from_slice(&output.stdout).map_err(|e| format!("no JSON ({e}): {text}"))?;
        let message = document["error"]["message"].as_str().ok_or("no message")?;
        require(words.split('|').next().is_some_and(|word| message.contains(word)), "not said with --json", message)?;
        require(folder.contents().is_empty(), "something was written", &text)
    };
    check().map_err(|wrong| format!("{what}: {wrong}"))
}

#[rustfmt::skip] // a kind a line
const CALLS: &[Call] = &[
    // commands and options
    ("an unknown command", "nonsense", "nonsense"),
    ("a misspelt command", "stifness --poses POSES", "stifness|similar subcommand exists: 'stiffness'"),
    ("a command in capitals", "FIT --out OUT", "FIT"),
    ("two commands", "fit plan --out OUT", "plan"),
    ("an unknown option", "fit --out OUT --colour red", "--colour"),
    ("a misspelt option", "fit --out OUT --verfy x.csv", "--verfy|--verify"),
    ("another command's option", "fit --out OUT --poses POSES", "--poses"),
    ("an option twice", "fit --out OUT --out OUT", "--out|multiple times"),
    ("an option without its value", "fit --out", "--out|a value is required"),
    ("a value without its option", "fit OUT", "out|unexpected argument"),
    ("a value for a switch", "ik --json=yes --theta-deg 0 --sigma-deg 0 --z0-mm 530", "--json"),
    ("a missing option", "fit", "--out"),
    ("a dash of typography", "fit \u{2013}\u{2013}out OUT", "\u{2013}out"),
    ("no file to write", "fit --out=", "--out"),
    ("no such machine", "fit --machine absent.toml --out OUT", "absent.toml: cannot read"),
    ("no machine", "fit --machine= --out OUT", "--machine"),
    // poses
    ("two of three", "ik --theta-deg 0 --sigma-deg 0", "--z0-mm"),
    ("text", "ik --theta-deg x --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("NaN", "ik --theta-deg nan --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("infinity", "ik --theta-deg=-inf --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("beyond all numbers", "ik --theta-deg 1e999 --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("digits without end", "ik --theta-deg LONG --sigma-deg 0 --z0-mm 530", "invalid value"),
    ("a decimal comma", "ik --theta-deg 1,5 --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("a minus of typography", "ik --theta-deg \u{2212}5 --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("a degree sign", "ik --theta-deg 5° --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("a unit", "ik --theta-deg 5 --sigma-deg 0 --z0-mm 530mm", "--z0-mm|finite number"),
    ("hexadecimal", "ik --theta-deg 0x5 --sigma-deg 0 --z0-mm 530", "--theta-deg|finite number"),
    ("metres", "ik --theta-deg 5 --sigma-deg 0 --z0-mm 0.53", "are lengths in mm?"),
    ("above travel", "ik --theta-deg 0 --sigma-deg 0 --z0-mm 900", "travel 420 to 770 mm"),
    ("below the base", "ik --theta-deg 0 --sigma-deg 0 --z0-mm -530", "-530"),
    ("beyond 90°", "ik --theta-deg 95 --sigma-deg 0 --z0-mm 530", "95"),
    ("a pose and a tool", "ik --theta-deg 0 --tip-mm 0,0,1137 --axis 0,0,1", "cannot be used with"),
    ("near a pose", "ik --theta-deg 0 --sigma-deg 0 --z0-mm 530 --near 530,530,530,0,0", "--all and --near ask about a tool|--tip-mm"),
    ("all ways to nothing", "ik --all", "--all and --near ask about a tool|--tip-mm"),
    ("a tip without an axis", "ik --tip-mm 0,0,1137", "--axis"),
    ("an axis without a tip", "ik --axis 0,0,1", "--tip-mm"),
    ("an axis of no length", "ik --tip-mm -205,0,1137 --axis 0,0,0", "direction"),
    ("a tip of two numbers", "ik --tip-mm -205,0 --axis 0,0,1", "--tip-mm|expected 3 numbers with commas between, found 2"),
    ("near four joints", "ik --tip-mm -205,0,1137 --axis 0,0,1 --near 1,2,3,4", "--near|expected 5 numbers"),
    ("all for a pose", "ik --theta-deg 0 --sigma-deg 0 --z0-mm 530 --all", "--tip-mm"),
    ("two lengths", "fk --q-mm 500,500", "--q-mm|expected 3 numbers with commas between, found 2"),
    ("four lengths", "fk --q-mm 500,500,500,500", "--q-mm|expected 3 numbers with commas between, found 4"),
    ("semicolons", "fk --q-mm 500;500;500", "--q-mm|finite number"),
    ("spaces", "fk --q-mm 500 500 500", "500"),
    ("nothing between commas", "fk --q-mm 500,,500", "--q-mm|finite number"),
    ("a length beyond travel", "fk --q-mm 500,500,900", "limb 3|900 mm long, travel 420 to 770 mm"),
    ("lengths in metres", "fk --q-mm 0.5,0.5,0.5", "are lengths in mm?"),
    ("lengths that nothing closes", "fk --q-mm 420,770,500", "q = 420, 770, 500 mm"),
    ("a wrist beyond its limits", "fk --q-mm 556,556,553 --beta-deg 95,0", "β1"),
    // tables and plans
    ("a form without a table", "stiffness --poses POSES --form factor", "--form|--table"),
    ("an unknown form", "stiffness --poses POSES --table TABLE --form cubic", "cubic|factor"),
    ("a folder for a file", "stiffness --poses POSES --out OUT/", "expected a file name"),
    ("an unknown plan", "plan --kind l25 --out OUT", "l25|l49"),
    ("no number of levels", "plan --kind levels --out OUT", "levels"),
    ("three levels", "plan --kind levels 3 --out OUT", "from 4 to 50"),
    ("too many levels", "plan --kind levels 51 --out OUT", "from 4 to 50"),
    ("negative levels", "plan --kind levels -4 --out OUT", "from 4 to 50"),
    ("broken levels", "plan --kind levels 4.5 --out OUT", "from 4 to 50"),
    ("a number for l49", "plan --kind l49 7 --out OUT", "7"),
    ("half a box", "plan --kind l49 --box -5,5,-2,2 --out OUT", "--box|expected 6 numbers"),
    ("a box the wrong way", "plan --kind l49 --box 5,-5,-2,2,520,540 --out OUT", "--box: expected least,greatest"),
    ("a box out of travel", "plan --kind l49 --box -5,5,-2,2,520,940 --out OUT", "travel"),
    ("a box in metres", "plan --kind l49 --box -5,5,-2,2,0.52,0.54 --out OUT", "are lengths in mm?"),
    ("data for a plan that needs none", "plan --kind l49 --data POSES --out OUT", "--data goes with --kind discriminate"),
    ("unknown terms", "fit --terms many --out OUT", "many|paper|full|select"),
    // maps, placements, paths
    ("a map beyond 90°", "map --sigma-deg 95 --out OUT", "--sigma-deg: expected different angles within ±90, found 95"),
    ("a map twice", "map --sigma-deg 0,5,0 --out OUT", "--sigma-deg: expected different angles"),
    ("a window the wrong way", "map --x0-mm 100,-100 --out OUT", "--x0-mm: expected least,greatest"),
    ("a window without end", "map --z0-mm 0,1e7 --out OUT", "--z0-mm: expected least,greatest within ±1e6"),
    ("a window in metres", "map --z0-mm 0.4,0.7 --out OUT", "mm"),
    ("a step of nothing", "map --step-mm 0 --out OUT", "--step-mm: expected a number above 0"),
    ("a step too fine", "map --step-mm 1e-6 --out OUT", "step"),
    ("an unknown objective", "place --objective best --out OUT", "best|tip-worst"),
    ("an unknown method", "place --method newton --out OUT", "newton|grid"),
    ("a front of tip-worst against itself", "place --pareto tip-worst --out OUT", "--pareto tip-worst|another objective"),
    ("a front by a grid", "place --table TABLE --pareto paper --method grid --out OUT", "--pareto|--method certified"),
    ("a front without a table", "place --pareto paper --out OUT", "--pareto|--table"),
    ("a front of one point", "place --pareto paper --points 1 --out OUT", "--points"),
    ("points of no front", "place --points 5 --out OUT", "--pareto"),
    ("cycle times without limits", "place --table TABLE --pareto cycle-time --out OUT", "--limits|screw_velocity_mm_per_min"),
    ("limits for no cycle time", "place --limits POSES --out OUT", "--limits|--pareto cycle-time"),
    ("a grid of nothing", "place --step-mm 0 --out OUT", "--step-mm|above 0"),
    ("a grid backwards", "place --step-mm -5 --out OUT", "--step-mm|above 0"),
    ("a grid too fine", "place --step-mm 1e-320 --out OUT", "too fine"),
    ("a grid too coarse", "place --step-mm 800 --out OUT", "too coarse"),
    ("a negative seed", "place --seed=-1 --out OUT", "--seed"),
    ("a seed too great", "place --seed 9007199254740992 --out OUT", "--seed"),
    ("a load of five", "compensate --path PATH --wrench 1,2,3,4,5 --out OUT", "--wrench|expected 6 numbers"),
    ("a load far beyond", "compensate --path PATH --wrench 1e300,0,0,0,0,0 --out OUT", "--wrench: expected numbers within"),
    ("a load for a CSV", "compensate --path PATH --wrench 1,2,3,4,5,6 --out OUT", "--wrench is for G-code"),
    ("a step of nothing along a path", "compensate --path PATH --step-mm 0 --out OUT", "--step-mm: expected at least 0.001"),
    ("a path in the plot's place", "compensate --path PATH --out OUT.svg", "the plot goes there"),
    ("a path of another kind", "compensate --path TABLE --out OUT", ".ngc"),
    // finite elements and firmware
    ("no poses", "fem --out OUT", "--poses"),
    ("elements of no size", "fem --poses POSES --mesh 0 --out OUT", "--mesh|from 0.1 to 5"),
    ("no jobs", "fem --poses POSES --jobs 0 --out OUT", "--jobs"),
    ("a change of nothing", "fem --poses POSES --dry-run --set solid.limb --out OUT", "--set|key.key=value"),
    ("a change of an unknown key", "fem --poses POSES --dry-run --set solid.leg=1 --out OUT", "leg"),
    ("a change to no number", "fem --poses POSES --dry-run --set solid.base.thickness_mm=thick --out OUT", "thickness_mm"),
    ("emit and collect", "fem --poses POSES --emit slurm --collect --out OUT", "--emit|cannot be used with"),
    ("loads without readings", "fem --loads PATH --out OUT", "--readings"),
    ("negative noise", "fem --poses POSES --readings OUT --noise -1,0 --out OUT", "--noise, --zero: expected standard deviations of at least 0"),
    ("no board", "hil", "--port"),
    ("two boards", "hil --qemu --port /dev/null", "--qemu|cannot be used with"),
    ("no steps", "hil --qemu --steps 0", "--steps"),
    ("too many steps", "hil --qemu --steps 1001", "--steps"),
    ("text for a baud rate", "hil --port /dev/null --baud fast", "--baud"),
    ("a machine without its table", "hil --qemu --machine POSES", "table5.csv:2"),
];
