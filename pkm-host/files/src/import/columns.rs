//! All columns of measured files and logs, with the names that others have for them: long, as these are many.

use super::units::Quantity::{self, Angle, Force, Length, Moment, Ratio, Temperature, Text, Time};
use super::units::{self, Unit};

/// A column of a measured file.
#[derive(Clone, Copy)]
pub struct Column {
    /// As `docs/formats.md` has it.
    pub name: &'static str,
    pub(super) quantity: Quantity,
    /// Its unit; empty for texts and ratios.
    pub(super) unit: &'static str,
    /// Other names, in small letters without spaces and underscores.
    pub(super) others: &'static [&'static str],
}

const fn column(name: &'static str, quantity: Quantity, unit: &'static str, others: &'static [&'static str]) -> Column {
    Column { name, quantity, unit, others }
}

/// Loads, of readings and of a load cell's log.
const WRENCH: [Column; 6] = [
    column("fx_n", Force, "N", &["fx", "forcex", "xforce", "kraftx", "loadx"]),
    column("fy_n", Force, "N", &["fy", "forcey", "yforce", "krafty", "loady"]),
    column("fz_n", Force, "N", &["fz", "forcez", "zforce", "kraftz", "loadz"]),
    column("mx_nm", Moment, "N·m", &["mx", "momentx", "xmoment", "tx", "torquex", "drehmomentx"]),
    column("my_nm", Moment, "N·m", &["my", "momenty", "ymoment", "ty", "torquey", "drehmomenty"]),
    column("mz_nm", Moment, "N·m", &["mz", "momentz", "zmoment", "tz", "torquez", "drehmomentz"]),
];

/// Every column of a measured file, in the order in which they are written.
pub const COLUMNS: &[Column] = &[
    column(
        "pose",
        Text,
        "",
        &["poseid", "posename", "poseno", "posenr", "pose#", "posenumber", "position", "stellung"],
    ),
    column("theta_deg", Angle, "°", &["theta", "θ"]),
    column("sigma_deg", Angle, "°", &["sigma", "σ"]),
    column("z0_mm", Length, "mm", &["z0"]),
    column("q1_mm", Length, "mm", &["q1"]),
    column("q2_mm", Length, "mm", &["q2"]),
    column("q3_mm", Length, "mm", &["q3"]),
    column("point_u_mm", Length, "mm", &["pointu"]),
    column("point_v_mm", Length, "mm", &["pointv"]),
    column("point_w_mm", Length, "mm", &["pointw"]),
    column("load_u_mm", Length, "mm", &["loadu"]),
    column("load_v_mm", Length, "mm", &["loadv"]),
    column("load_w_mm", Length, "mm", &["loadw"]),
    WRENCH[0],
    WRENCH[1],
    WRENCH[2],
    WRENCH[3],
    WRENCH[4],
    WRENCH[5],
    column(
        "dx_um",
        Length,
        "µm",
        &[
            "dx",
            "δx",
            "deltax",
            "deflectionx",
            "displacementx",
            "dispx",
            "xdeflection",
            "xdisplacement",
            "ux",
            "verschiebungx",
        ],
    ),
    column(
        "dy_um",
        Length,
        "µm",
        &[
            "dy",
            "δy",
            "deltay",
            "deflectiony",
            "displacementy",
            "dispy",
            "ydeflection",
            "ydisplacement",
            "uy",
            "verschiebungy",
        ],
    ),
    column(
        "dz_um",
        Length,
        "µm",
        &[
            "dz",
            "δz",
            "deltaz",
            "deflectionz",
            "displacementz",
            "dispz",
            "zdeflection",
            "zdisplacement",
            "uz",
            "verschiebungz",
        ],
    ),
    column("rx_urad", Angle, "µrad", &["rx", "rotx", "rotationx", "xrotation", "verdrehungx"]),
    column("ry_urad", Angle, "µrad", &["ry", "roty", "rotationy", "yrotation", "verdrehungy"]),
    column("rz_urad", Angle, "µrad", &["rz", "rotz", "rotationz", "zrotation", "verdrehungz"]),
    column("gauge_um", Length, "µm", &["gauge", "dialgauge", "messuhr"]),
    column("gauge_u", Ratio, "", &["gaugedirectionu"]),
    column("gauge_v", Ratio, "", &["gaugedirectionv"]),
    column("gauge_w", Ratio, "", &["gaugedirectionw"]),
    column("series", Text, "", &["serie", "seriesno", "seriesnr", "messreihe"]),
    column("reading", Text, "", &["readingid", "readingno", "readingnr", "messung"]),
    column("repeat", Text, "", &["repetition", "rep", "wiederholung", "wdh"]),
    column("load", Text, "", &["loadcase", "loadname", "lastfall"]),
    column("direction", Text, "", &["dir", "loaddirection", "richtung"]),
    column("temperature_c", Temperature, "°C", &["temperature", "temp", "tempc", "temperatur"]),
    column("load_random", Ratio, "", &[]),
    column("sigma_linear_um", Length, "µm", &["sigmalinear"]),
    column("sigma_angular_urad", Angle, "µrad", &["sigmaangular"]),
    column("sigma_dx_um", Length, "µm", &[]),
    column("sigma_dy_um", Length, "µm", &[]),
    column("sigma_dz_um", Length, "µm", &[]),
    column("sigma_rx_urad", Angle, "µrad", &[]),
    column("sigma_ry_urad", Angle, "µrad", &[]),
    column("sigma_rz_urad", Angle, "µrad", &[]),
    column("correlation_dx_dy", Ratio, "", &[]),
    column("correlation_dx_dz", Ratio, "", &[]),
    column("correlation_dx_rx", Ratio, "", &[]),
    column("correlation_dx_ry", Ratio, "", &[]),
    column("correlation_dx_rz", Ratio, "", &[]),
    column("correlation_dy_dz", Ratio, "", &[]),
    column("correlation_dy_rx", Ratio, "", &[]),
    column("correlation_dy_ry", Ratio, "", &[]),
    column("correlation_dy_rz", Ratio, "", &[]),
    column("correlation_dz_rx", Ratio, "", &[]),
    column("correlation_dz_ry", Ratio, "", &[]),
    column("correlation_dz_rz", Ratio, "", &[]),
    column("correlation_rx_ry", Ratio, "", &[]),
    column("correlation_rx_rz", Ratio, "", &[]),
    column("correlation_ry_rz", Ratio, "", &[]),
    column("zero_share", Ratio, "", &[]),
];

/// Every column of a tracker's list of points.
pub const POINT_LIST: &[Column] = &[
    column("reading", Text, "", &["readingid", "readingno", "readingnr", "messung"]),
    column("state", Text, "", &["zustand"]),
    column(
        "point",
        Text,
        "",
        &["pointname", "pointid", "name", "target", "reflector", "punkt", "punktname", "reflektor"],
    ),
    column("x_mm", Length, "mm", &["x"]),
    column("y_mm", Length, "mm", &["y"]),
    column("z_mm", Length, "mm", &["z"]),
    column("u95_um", Length, "µm", &["u95", "expandeduncertainty"]),
];

/// When a row was written: seconds, a time of a clock, its date where that stands apart.
const TIMES: [Column; 3] = [
    column("time_s", Time, "s", &["time", "zeit", "t", "elapsedtime", "messzeit"]),
    column(
        "time",
        Text,
        "",
        &[
            "timestamp",
            "zeitstempel",
            "uhrzeit",
            "clocktime",
            "datetime",
            "date/time",
            "dateandtime",
            "datum/zeit",
            "datum/uhrzeit",
            "datumunduhrzeit",
        ],
    ),
    column("date", Text, "", &["datum"]),
];

/// Every column of a measured file, and others behind them.
const fn measured_and<const N: usize>(others: &[Column]) -> [Column; N] {
    let mut all = [COLUMNS[0]; N];
    let mut n = 0;
    while n < N {
        all[n] = if n < COLUMNS.len() { COLUMNS[n] } else { others[n - COLUMNS.len()] };
        n += 1;
    }
    all
}

/// Columns of readings whose load a log has.
pub const TIMED: [Column; COLUMNS.len() + 6] = measured_and(&[
    TIMES[0],
    TIMES[1],
    TIMES[2],
    column("force_u", Ratio, "", &["forceu"]),
    column("force_v", Ratio, "", &["forcev"]),
    column("force_w", Ratio, "", &["forcew"]),
]);

/// Columns of a controller's log.
pub const LOGGED: [Column; COLUMNS.len() + 1] = measured_and(&[TIMES[0]]);

/// Every column of a load cell's log.
pub const LOAD_LOG: &[Column] = &[
    TIMES[0],
    TIMES[1],
    TIMES[2],
    column("sample", Ratio, "", &["samples", "sampleno", "samplenumber", "scan", "index", "messwertnr"]),
    column("force_n", Force, "N", &["force", "f", "kraft", "load", "last", "loadcell", "kraftaufnehmer"]),
    column("moment_nm", Moment, "N·m", &["moment", "torque", "drehmoment"]),
    WRENCH[0],
    WRENCH[1],
    WRENCH[2],
    WRENCH[3],
    WRENCH[4],
    WRENCH[5],
];

/// What an amplifier gives that is not set to a unit of force, in small letters.
const UNCALIBRATED: [&str; 4] = ["mv/v", "mv", "v", "µm/m"];

impl Column {
    /// Whether it holds numbers.
    pub fn is_number(&self) -> bool {
        self.quantity != Text
    }

    /// Whether it holds names that people choose.
    pub(super) fn is_chosen(&self) -> bool {
        ["pose", "point", "state"].contains(&self.name)
    }

    /// The unit that the program takes; none of a text.
    pub fn own_unit(&self) -> Option<&'static Unit> {
        units::find(self.quantity, self.unit)
    }

    /// The column's unit that is written so.
    pub(super) fn unit_of(&self, text: &str) -> Result<&'static Unit, String> {
        units::find(self.quantity, text).ok_or_else(|| {
            let known = units::known(self.quantity);
            let is_signal = matches!(self.quantity, Force | Moment) && UNCALIBRATED.contains(&text.to_lowercase().as_str());
            if is_signal {
                format!(
                    "`{text}` is the signal of a bridge and no load: nothing in the file tells what the cell gives under a load. Set \
                     the amplifier to the cell's calibration, or convert the column to one of {known}"
                )
            } else {
                format!("unknown unit `{text}` of {}: known are {known}", self.name)
            }
        })
    }
}
