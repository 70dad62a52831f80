//! Cases as an array job for Slurm. The nodes need CalculiX, nothing else.

use std::path::Path;

use rayon::prelude::*;

use super::cases::{Case, Model, RESULT};
use crate::error::Result;
use crate::files::source;

/// Name of the script.
pub const SCRIPT: &str = "run.sbatch";

/// Most tasks of an array: a usual limit is 1001.
const MAX_TASKS: usize = 1000;

/// Writes the decks, the script and the list of folders; the number of tasks.
///
/// # Errors
/// What the operating system says.
pub fn emit(model: &Model<'_>, work: &Path, cases: &[Case]) -> Result<usize> {
    cases.par_iter().try_for_each(|case| model.write_deck(case, &work.join(&case.folder)))?;
    let tasks = cases.len().min(MAX_TASKS);
    let script = format!(
        r#"#!/bin/bash
#SBATCH --job-name=pkm-fem
#SBATCH --array=1-{tasks}
#SBATCH --cpus-per-task=1
#SBATCH --output=slurm-%A_%a.log
# Task n computes every {tasks}th folder of cases.txt, from the n-th on. Submit it in the folder that it lies in. Submitted
# again, it computes what has no result yet. CCX names the program, if it isn't called ccx.
set -u
: "${{SLURM_ARRAY_TASK_ID:?this is a task of an array job: submit it with sbatch}}"
cd "${{SLURM_SUBMIT_DIR:-$(dirname "$0")}}" || exit 1
[ -r cases.txt ] || {{ echo "no cases.txt here: submit this in the folder that it lies in" >&2; exit 1; }}
ccx=${{CCX:-ccx}}
version=$("$ccx" -v | grep Version)
export OMP_NUM_THREADS=1
failed=0
for folder in $(awk -v n="$SLURM_ARRAY_TASK_ID" '(NR - n) % {tasks} == 0' cases.txt); do
    [ -e "$folder/{RESULT}" ] && continue
    if (cd "$folder" && "$ccx" -i case >ccx.log 2>&1 && ! grep -q '\*ERROR' ccx.log) &&
        {{ echo "$version" && cat "$folder/case.dat"; }} >"$folder/unfinished" && mv "$folder/unfinished" "$folder/{RESULT}"; then
        :
    else
        echo "failed: $folder/ccx.log" >&2
        failed=1
    fi
done
exit $failed
"#
    );
    let list: String = cases.iter().map(|c| format!("{}\n", c.folder)).collect();
    source::write_all(work, &[("cases.txt", list), (SCRIPT, script)], &[])?;
    Ok(tasks)
}
