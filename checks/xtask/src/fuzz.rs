//! Runs the targets of `checks/fuzz`, as many side by side as there are cores.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;
use std::time::Instant;

use crate::{Outcome, nightly, output, root};

/// One target's share so far.
struct Row {
    target: String,
    executions: u64,
    seconds: f64,
    slots: usize,
    running: bool,
    finding: Option<String>,
}

/// Ten seconds a target from its seeds; with `--executions N` a minute in turn, with a corpus that stays, until all together
/// have done so many. libFuzzer's own seed is the number of the turn: what it tries changes with the code, not with the day.
pub fn run(options: &[String]) -> Outcome {
    let wanted = match options {
        [] => None,
        [name, count] if name == "--executions" => {
            let count = count.parse::<f64>().ok().filter(|n| *n >= 1.0);
            Some(count.ok_or("--executions: expected a number, such as 1e8")? as u64)
        }
        _ => return Err("expected nothing, or --executions N".into()),
    };
    let folder = root().join("checks/fuzz");
    nightly(
        &["fuzz", "build", "--fuzz-dir", ".", "--sanitizer", "none"],
        &folder,
        "cargo install cargo-fuzz --version 0.13.2 --locked",
    )?;

    let files = std::fs::read_dir(folder.join("fuzz_targets")).map_err(|e| e.to_string())?;
    let mut rows: Vec<Row> = files
        .filter_map(|file| file.ok()?.path().file_stem().map(|name| name.to_string_lossy().into_owned()))
        .map(|target| Row { target, executions: 0, seconds: 0.0, slots: 0, running: false, finding: None })
        .collect();
    rows.sort_by(|a, b| a.target.cmp(&b.target));
    let temporary = tempfile::tempdir().map_err(|e| e.to_string())?;
    let corpora = if wanted.is_some() { folder.join("corpus") } else { temporary.path().to_owned() };

    // each worker takes the target that had least, until there is nothing left to do
    let next = |rows: &mut Vec<Row>| {
        let done = wanted.is_some_and(|wanted| rows.iter().map(|row| row.executions).sum::<u64>() >= wanted);
        let open = |row: &Row| !done && !row.running && row.finding.is_none() && (wanted.is_some() || row.slots == 0);
        let index = (0..rows.len()).filter(|i| open(&rows[*i])).min_by_key(|i| rows[*i].slots)?;
        rows[index].running = true;
        rows[index].slots += 1;
        Some((index, rows[index].target.clone(), rows[index].slots))
    };
    let rows = Mutex::new(rows);
    let seconds = if wanted.is_some() { 60 } else { 10 };
    let workers = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                let lock = || rows.lock().expect("no worker panics while it holds the rows");
                while let Some((index, target, turn)) = { next(&mut lock()) } {
                    let started = Instant::now();
                    let slot = slot(&folder, &corpora, &target, (turn, seconds));
                    let mut rows = lock();
                    let row = &mut rows[index];
                    row.running = false;
                    row.seconds += started.elapsed().as_secs_f64();
                    match slot {
                        Ok((executions, finding)) => {
                            row.executions += executions;
                            row.finding = finding;
                        }
                        Err(message) => row.finding = Some(message),
                    }
                    if let Some(wanted) = wanted {
                        let done = rows.iter().map(|row| row.executions).sum::<u64>();
                        eprintln!("{:>4} %, after {target}", 100 * done / wanted);
                    }
                }
            });
        }
    });

    let rows = rows.into_inner().map_err(|e| e.to_string())?;
    println!("{:<14}{:>14}{:>10}  findings", "target", "executions", "a second");
    for row in &rows {
        let rate = row.executions as f64 / row.seconds.max(1e-3);
        println!("{:<14}{:>14}{rate:>10.0}  {}", row.target, row.executions, usize::from(row.finding.is_some()));
    }
    println!("{:<14}{:>14}", "all", rows.iter().map(|row| row.executions).sum::<u64>());
    let findings: Vec<String> =
        rows.into_iter().filter_map(|row| Some(format!("{}: {}", row.target, row.finding?))).collect();
    if findings.is_empty() { Ok(()) } else { Err(findings.join("\n\n")) }
}

/// Runs a target for a while: executions, and what was found.
fn slot(
    folder: &Path,
    corpora: &Path,
    target: &str,
    (turn, seconds): (usize, u32),
) -> Result<(u64, Option<String>), String> {
    let program = folder.join("target/x86_64-unknown-linux-gnu/release").join(target);
    let [corpus, artifacts] = [corpora.join(target), folder.join("artifacts").join(target)];
    for folder in [&corpus, &artifacts] {
        std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    }
    let mut command = Command::new(&program);
    command.args([&corpus, &folder.join("seeds").join(target)]);
    command.args([format!("-max_total_time={seconds}"), format!("-seed={turn}")]);
    command.arg(format!("-artifact_prefix={}/", artifacts.display()));
    // what the target prints is hidden: warnings by the thousand
    command.args(["-timeout=10", "-rss_limit_mb=2048", "-close_fd_mask=3", "-print_final_stats=1"]);
    let dictionary = folder.join("dictionaries").join(format!("{target}.dict"));
    if dictionary.exists() {
        command.arg(format!("-dict={}", dictionary.display()));
    }
    let run = command.output().map_err(|e| format!("{}: {e}", program.display()))?;
    let log = String::from_utf8_lossy(&run.stderr);
    let value = |name: &str| log.lines().find_map(|line| line.split_once(name)).map(|(_, value)| value.trim());
    let executions = value("stat::number_of_executed_units:").and_then(|n| n.parse().ok());
    if run.status.success() {
        return executions.map(|n| (n, None)).ok_or_else(|| format!("no count of executions in\n{log}"));
    }
    let finding = match value("Test unit written to ").map(PathBuf::from) {
        Some(input) => {
            // once more, with what the target says
            let mut again = Command::new(&program);
            let told = output(again.arg("-timeout=10").arg(&input)).err().unwrap_or_else(|| "not repeated".to_owned());
            let lines: Vec<&str> = told.lines().filter(|line| !line.starts_with("INFO:")).take(12).collect();
            let show = format!("cargo fuzz run --fuzz-dir checks/fuzz {target} {}", input.display());
            format!("{show}\n{}", lines.join("\n"))
        }
        None => log.into_owned(),
    };
    Ok((executions.unwrap_or(0), Some(finding)))
}
