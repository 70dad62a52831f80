//! Files are written whole or not at all, whatever happens meanwhile; and what is large needs no more memory than it should.

#![cfg(unix)]

use std::fs::File;
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant, SystemTime};

use crate::common::{Folder, fixture, json, run};

const FIT: [&str; 4] = ["coefficients.rs", "coefficients.json", "fit.json", "report.html"];

/// Names of files that are not yet whole, or never were.
fn unfinished(folder: &str) -> Vec<String> {
    let names = Path::new(folder).read_dir().unwrap().map(|e| e.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with(".pkm-host-")).collect()
}

#[test]
fn a_kill_at_any_moment_leaves_whole_files() {
    const KILLS: usize = 60;
    let folder = Folder::new();
    let (out, seed) = (folder.path("out"), fastrand::u64(..));
    println!("PKM_SEED={seed}");
    let mut rng = fastrand::Rng::with_seed(seed);
    let fit = |terms: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pkm-host"));
        command.args(["fit", "--terms", terms, "--out", &out]).stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let files = || FIT.map(|name| folder.read(&format!("out/{name}")));
    let whole = ["paper", "full"].map(|terms| {
        let started = Instant::now();
        assert!(fit(terms).status().unwrap().success());
        (files(), started.elapsed())
    });
    let (mut cut_short, mut early, mut mixed) = (0, 0, 0);
    for n in 0..KILLS {
        let mut child = fit(["paper", "full"][n % 2]).spawn().unwrap();
        let longest = whole[n % 2].1;
        if n % 3 == 0 {
            std::thread::sleep(longest.mul_f64(1.2 * rng.f64()));
        } else {
            // as soon as it writes, and some time into that
            let (started, before) = (Instant::now(), unfinished(&out).len());
            while unfinished(&out).len() == before && started.elapsed() < 3 * longest {}
            std::thread::sleep(Duration::from_micros(rng.u64(0..4000)));
        }
        child.kill().unwrap();
        early += usize::from(child.wait().unwrap().signal().is_some());
        let old_or_new = files()
            .iter()
            .zip(&whole[0].0)
            .zip(&whole[1].0)
            .map(|((file, a), b)| (file == a, file == b))
            .collect::<Vec<_>>();
        assert!(old_or_new.iter().all(|(a, b)| *a || *b), "after {n} kills: {old_or_new:?}");
        mixed += usize::from(old_or_new.iter().any(|which| *which != old_or_new[0]));
        cut_short = unfinished(&out).len();
    }
    println!("{KILLS} kills, {early} before the end, {mixed} between two files; {cut_short} unfinished files left");
    assert!(early > KILLS / 3 && cut_short > 0, "the kills came too late");

    // young ones might be another run's; old ones go
    let left = unfinished(&out);
    let long_ago = SystemTime::now() - Duration::from_secs(7200);
    for name in &left[1..] {
        File::options().write(true).open(folder.path(&format!("out/{name}"))).unwrap().set_modified(long_ago).unwrap();
    }
    assert!(fit("paper").status().unwrap().success());
    assert_eq!(unfinished(&out), left[..1]);
    assert!(files() == whole[0].0);
}

/// Exit 1 with one message that names the path, and the words.
fn fails(output: &Output, path: &str, words: &str) {
    let text = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert!(output.stdout.is_empty() && text.lines().count() == 1 && text.starts_with("error: "), "{text}");
    assert!(text.contains(path), "{text}");
    assert!(words.split('|').all(|word| text.contains(word)), "{text}");
}

#[test]
fn what_cannot_be_written_is_said_and_changes_nothing() {
    let folder = Folder::new();
    let (file, poses) = (folder.write("file", "old"), fixture("poses/table5.csv"));
    let below = format!("{file}/below");
    let missing = folder.path("new/and/deep/k.csv");
    json(&["stiffness", "--poses", &poses, "--out", &missing]);
    std::fs::create_dir_all(folder.path("taken/report.html")).unwrap();
    folder.write("taken/coefficients.rs", "old");
    let protected = folder.write("protected.csv", "old");
    let mut permissions = std::fs::metadata(&protected).unwrap().permissions();
    permissions.set_readonly(true);
    std::fs::set_permissions(&protected, permissions).unwrap();
    let before = folder.contents();
    for (args, path, words) in [
        (&["fit", "--out", &below][..], "file", "a file is in the way"),
        (&["fit", "--out", &file], "file", "a file is in the way"),
        (&["map", "--step-mm", "50", "--out", &file], "file", "a file is in the way"),
        (&["plan", "--kind", "l49", "--out", &below], "file", "a file is in the way"),
        (&["stiffness", "--poses", &poses, "--out", &folder.path("taken")], "taken", "a folder of this name"),
        (&["fit", "--out", &folder.path("taken")], "report.html", "a folder of this name"),
        (&["plan", "--kind", "l49", "--out", &protected], "protected.csv", "write-protected"),
        (&["plan", "--kind", "l49", "--out", "/dev/full"], "/dev/full", "No space left"),
        (&["stiffness", "--poses", &poses, "--out", "/dev/full"], "/dev/full", "No space left"),
        (&["predict", "--out", "/dev/full"], "/dev/full", "No space left"),
        (&["plan", "--kind", "l49", "--out", "/proc/nothing/k.csv"], "/proc/nothing", "create the folder"),
        (&["plan", "--kind", "l49", "--out", &folder.path(&"x".repeat(300))], "xxx", "File name too long"),
    ] {
        fails(&run(args), path, words);
        assert!(folder.contents() == before, "{args:?} has written");
    }
    let answered = ["ik", "--theta-deg", "0", "--sigma-deg", "0", "--z0-mm", "530"];
    for args in [&answered[..], &["--help"], &["import", "--help"], &["import", "-h"], &["--version"]] {
        let program = env!("CARGO_BIN_EXE_pkm-host");
        let full = Command::new(program).args(args).stdout(File::create("/dev/full").unwrap()).output();
        fails(&full.unwrap(), "standard output", "No space left");
    }
}

/// What goes to standard error beside the work ends none of it: warnings, errors and the document of an error.
#[test]
fn standard_error_that_cannot_be_written_costs_nothing_else() {
    let folder = Folder::new();
    let program = env!("CARGO_BIN_EXE_pkm-host");
    let run =
        |args: &[&str]| Command::new(program).args(args).stderr(File::create("/dev/full").unwrap()).output().unwrap();
    json(&["fit", "--out", &folder.path("fit")]);
    // beyond the table's box, which is worth a warning
    let (poses, table, out) = (fixture("poses/table5.csv"), folder.path("fit/coefficients.json"), folder.path("k.csv"));
    let output = run(&["stiffness", "--poses", &poses, "--table", &table, "--out", &out]);
    assert_eq!(output.status.code(), Some(0));
    assert!(folder.read("k.csv").contains("hole-1"));
    let output =
        run(&["ik", "--json", "--machine", "none.toml", "--theta-deg", "0", "--sigma-deg", "0", "--z0-mm", "530"]);
    let document: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((output.status.code(), document["error"]["kind"].as_str()), (Some(2), Some("input")));
}

/// Two ways to have too little room: a limit on the size of files, and a small file system.
#[test]
fn a_full_disk_leaves_the_old_files() {
    let folder = Folder::new();
    let out = folder.path("out");
    for name in FIT {
        std::fs::create_dir_all(&out).unwrap();
        folder.write(&format!("out/{name}"), "old");
    }
    let before = folder.contents();
    let program = env!("CARGO_BIN_EXE_pkm-host");
    let sh = |script: &str| Command::new("sh").args(["-c", script, program, &out]).output().unwrap();
    fails(&sh("trap '' XFSZ; ulimit -f 8; exec \"$0\" fit --out \"$1\""), "out/", "File too large");
    assert!(folder.contents() == before);

    let small = "mount -t tmpfs -o size=32k none \"$1\" && echo old > \"$1/fit.json\"";
    let unshared = |script: &str| Command::new("unshare").args(["-rm", "sh", "-c", script, program, &out]).output();
    if !unshared(small).is_ok_and(|output| output.status.success()) {
        println!("skipped: no file system may be mounted here");
        return;
    }
    let output =
        unshared(&format!("{small} && \"$0\" fit --out \"$1\"; code=$?; cat \"$1\"/* \"$1\"/.p*; exit $code")).unwrap();
    // nothing else is there, and nothing unfinished
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!((output.status.code(), String::from_utf8_lossy(&output.stdout).as_ref()), (Some(1), "old\n"), "{text}");
    assert!(text.starts_with("error: ") && text.contains("No space left"), "{text}");
}

/// Megabytes of address space, which is more than what is used, for files of 100,000 lines.
#[cfg(target_os = "linux")]
#[test]
fn a_hundred_thousand_lines_need_bounded_memory() {
    const LINES: usize = 100_000;
    let folder = Folder::new();
    let mut rng = fastrand::Rng::with_seed(1);
    let mut within = |half: f64| half * (2.0 * rng.f64() - 1.0);
    let mut poses = "pose,theta_deg,sigma_deg,z0_mm\n".to_owned();
    let mut measured = "pose,series,theta_deg,sigma_deg,z0_mm,fx_n,fy_n,fz_n,mx_nm,my_nm,mz_nm\n".to_owned();
    for n in 0..LINES {
        let [theta, sigma, z0] = [within(14.0), within(14.0), 530.0 + within(30.0)];
        poses += &format!("P{n},{theta:.4},{sigma:.4},{z0:.3}\n");
        measured += &format!("P{n},{},{theta:.4},{sigma:.4},{z0:.3},0,0,{:.1},0,0,0\n", n / 100, within(400.0));
    }
    let (poses, measured) = (folder.write("poses.csv", &poses), folder.write("measured.csv", &measured));
    let (k, out) = (folder.path("k.csv"), folder.path("out"));
    for (megabytes, args) in [
        (400, &["stiffness", "--poses", &poses, "--out", &k][..]),
        (400, &["stiffness", "--poses", &poses, "--json"]),
        (500, &["fit", "--data", &k, "--out", &out]),
        (400, &["predict", "--data", &measured, "--out", &folder.path("predicted.csv")]),
    ] {
        let limited = Command::new("sh")
            .args([
                "-c",
                &format!("ulimit -v {}; exec \"$0\" \"$@\"", 1024 * megabytes),
                env!("CARGO_BIN_EXE_pkm-host"),
            ])
            .args(args)
            // every thread sets some aside
            .env("RAYON_NUM_THREADS", "2")
            .stdout(Stdio::null())
            .output()
            .unwrap();
        assert!(limited.status.success(), "{args:?}: {}", String::from_utf8_lossy(&limited.stderr));
    }
}
