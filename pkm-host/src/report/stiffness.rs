//! The stiffness of poses as CSV, text and JSON.

use pkm_core::Domain;
use serde::Serialize;

use crate::files::dataset::{self, POSE_COLUMNS, stiffness_columns};
use crate::plan::model::Solved;
use crate::pose::NamedPose;

/// A pose in the document of `--json`.
#[derive(Serialize)]
pub struct Document<'a> {
    inside_domain: Option<bool>,
    k: [[f64; 6]; 6],
    pose: &'a str,
    status: &'static str,
    /// Expanded uncertainties of k11…k66, N/m and N·m/rad; null where the table does not say.
    u95_principal: Option<[f64; 6]>,
}

/// The document of `--json`.
pub fn documents<'a>(poses: &'a [NamedPose], solved: &[Solved]) -> Vec<Document<'a>> {
    let document = |(p, s): (&'a NamedPose, &Solved)| Document {
        inside_domain: s.domain.map(|d| d == Domain::Inside),
        // symmetric: its columns are its rows
        k: s.factor.stiffness().matrix().into(),
        pose: &p.id,
        status: if s.domain == Some(Domain::Outside) { "outside_box" } else { "ok" },
        u95_principal: s.u95_principal,
    };
    poses.iter().zip(solved).map(document).collect()
}

/// The stiffness file, 21 columns.
pub fn csv(poses: &[NamedPose], solved: &[Solved]) -> String {
    let rows = poses.iter().zip(solved).map(|(p, s)| {
        let k = s.factor.stiffness().matrix();
        let mut row = vec![p.id.clone()];
        row.extend(dataset::pose_cells(&p.pose));
        row.extend(stiffness_columns().map(|(i, j, _)| k[(i, j)].to_string()));
        row
    });
    dataset::to_csv(b',', &header(), rows)
}

/// Columns of a stiffness file.
pub(crate) fn header() -> Vec<String> {
    POSE_COLUMNS.map(str::to_owned).into_iter().chain(stiffness_columns().map(|(_, _, name)| name)).collect()
}

/// For the terminal.
pub fn text(poses: &[NamedPose], solved: &[Solved]) -> String {
    let mut text = format!(
        "{:>10} {:>11} {:>11} {:>11} {:>11} {:>11} {:>11}\n",
        "pose", "k11 N/m", "k22 N/m", "k33 N/m", "k44 Nm/rad", "k55 Nm/rad", "k66 Nm/rad"
    );
    for (p, s) in poses.iter().zip(solved) {
        let k = <[f64; 6]>::from(s.factor.stiffness().principal()).map(|k| format!("{k:>11.4e}")).join(" ");
        let mark = if s.domain == Some(Domain::Outside) { "  outside the box" } else { "" };
        text.push_str(&format!("{:>10} {k}{mark}\n", p.id));
        if let Some(u95) = s.u95_principal {
            text.push_str(&format!("{:>10} {}\n", "U95", u95.map(|u| format!("{u:>11.4e}")).join(" ")));
        }
    }
    text
}
