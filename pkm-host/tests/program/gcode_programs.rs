//! The programs of the test table, as posts write them for five dialects: LinuxCNC, Fanuc, Haas NGC, Siemens in ISO mode
//! (G291), Mach3. All are our own. G54 lies at -205, 0, 1130 in B, G55 at -195, 10, 1132.

/// What gives the tool's direction.
#[derive(Clone, Copy)]
pub enum Direction {
    /// A B are the wrist's joints, or vectors.
    Wrist,
    /// The job's `tool_axis`.
    Fixed,
    /// The job's `head`.
    Ac,
    /// The job's `head`.
    Bc,
}

/// What is to come of a program.
#[derive(Clone, Copy)]
pub enum Says {
    /// So many moves, and the last end in B, mm.
    Moves(usize, [f64; 3]),
    /// The line, and words of the reason.
    Refused(u64, &'static str),
}

use crate::gcode_macros::MACROS;
use Direction::{Ac, Bc, Fixed, Wrist};
use Says::{Moves, Refused};

/// A program.
#[derive(Clone, Copy)]
pub struct Case {
    pub name: &'static str,
    pub direction: Direction,
    /// LinuxCNC's interpreter reads it and takes each word as we do.
    pub for_linuxcnc: bool,
    pub text: &'static str,
    pub says: Says,
}

pub const fn case(
    name: &'static str,
    direction: Direction,
    for_linuxcnc: bool,
    says: Says,
    text: &'static str,
) -> Case {
    Case { name, direction, for_linuxcnc, text, says }
}

/// All programs, those with parameters and conditions among them.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    CASES.iter().chain(MACROS)
}

/// Of an arc of 1 µm: 56 moves a quarter of 10 mm, 40 of 5 mm.
pub const CASES: &[Case] = &[
    case(
        "LinuxCNC: wrist, tool length, work frame",
        Wrist,
        true,
        Moves(6, [-200.0, 3.0, 1120.0]),
        "(T1 6 mm)\nG17 G21 G40 G49 G80 G90 G94\nG64 P0.01\nT1 M6\nG54\nG43 H1\nS6000 M3\nG0 X0 Y0 Z-8 A0 B0\nZ-2\n\
         G1 Z2 F200 M8\nX5 Y3 A2 B-1.5 F600\nG1 X5 Y3 Z0.5\nG0 Z-10\nM9\nM5\nM2\n",
    ),
    case(
        "LinuxCNC: arcs by centre and radius",
        Fixed,
        true,
        Moves(1 + 1 + 56 + 56 + 94 + 1, [-195.0, 10.0, 1135.0]),
        "G17 G21 G90 G91.1\nG54 G0 X0 Y0 Z5\nG1 Z0 F300\nG2 X10 Y10 I10 J0\nG3 X20 Y20 R10\nG2 X10 Y10 I-5 J-5 F200\n\
         G0 Z5\nM2\n",
    ),
    case(
        "LinuxCNC: full circle, helix, turns",
        Fixed,
        true,
        Moves(1 + 158 + 158 + 315, [-200.0, 0.0, 1126.0]),
        "G17 G21 G90\nG55 G0 X-5 Y-10 Z0\nG3 I-5 F200\nG2 I-5 Z-2\nG3 X-5 Y-10 Z-6 I-5 P2\nM2\n",
    ),
    case(
        "LinuxCNC: arcs in G18 and G19",
        Fixed,
        true,
        Moves(1 + 118 + 118 + 40 + 1, [-195.0, 5.0, 1140.0]),
        "G21 G90 G54 G0 X0 Y0 Z0\nG18 G2 X5 Z5 I5 K0 F100\nG3 X10 Z10 I0 K5\nG19 G2 Y5 Z5 J0 K-5\nG17\nG0 Z10\nM2\n",
    ),
    case(
        "LinuxCNC: G81 with increments and repeats",
        Fixed,
        true,
        Moves(1 + 3 * 4 + 3, [-199.0, 6.0, 1135.0]),
        "G21 G90 G54\nG0 X0 Y0 Z5\nG98 G91 G81 X2 Y2 Z-4 R-3 F100 L3\nG90 G80\nG98 G81 X6 Y6 Z-2 R2\nG80\nM2\n",
    ),
    case(
        "LinuxCNC: G82, G83, G73",
        Fixed,
        true,
        Moves(1 + 4 + 9 + 3 + 8, [-190.0, 0.0, 1135.0]),
        "G21 G90 G54 G98\nG0 X0 Y0 Z5\nG82 X5 Y0 Z-3 R1 P0.5 F100\nG80\nG83 X10 Y0 Z-5 R1 Q2\nG80\nG73 X15 Y0 Z-5 R2 Q2\nG80\nM2\n",
    ),
    case(
        "LinuxCNC: subroutine and repeat",
        Fixed,
        true,
        Moves(1 + 2 * 3 + 2, [-199.0, 0.0, 1131.0]),
        "o100 sub\nG91\nG1 X1 F100\nG0 Y1\nX1 Y-1\nG90\no100 endsub\nG21 G90 G54\nG0 X0 Y0 Z0\no100 call\no100 call\n\
         o1 repeat [2]\nG91 G1 X1 Z0.5\nG90\no1 endrepeat\nM2\n",
    ),
    case(
        "LinuxCNC: G92 and G10 L20",
        Fixed,
        true,
        Moves(1 + 1 + 1 + 1 + 1, [-204.0, 1.0, 1132.0]),
        "G21 G90 G54\nG0 X5 Y5 Z2\nG92 X0 Y0\nG0 X1 Y1\nG92.1\nG0 X3 Y3\nG10 L20 P1 X0 Y0 Z0\nG0 X-1 Y-1\nG1 X-2 Y-2 F100\nM2\n",
    ),
    case(
        "LinuxCNC: inches",
        Fixed,
        true,
        Moves(1 + 1 + 126 + 1, [-205.0 + 25.4, 12.7, 1130.0 + 2.54]),
        "G17 G20 G90 G54\nG0 X0 Y0 Z0.1\nG1 Z0 F10\nG3 X1 Y0 R0.5\nG91 G0 Y0.5 Z0.1\nG90\nM2\n",
    ),
    case(
        "LinuxCNC: inverse time",
        Wrist,
        true,
        Moves(4, [-205.0, 0.0, 1130.0]),
        "G21 G90 G54 G0 X0 Y0 Z0 A0 B0\nG93 G1 X5 A3 F20\nX10 Y5 B-2 F15\nG94 G0 X0 Y0 A0 B0\nM2\n",
    ),
    case("LinuxCNC: probe", Fixed, false, Refused(3, "probe"), "G21 G90 G54\nG0 X0 Y0 Z0\nG38.2 Z-5 F50\nM2\n"),
    case(
        "LinuxCNC: threading with the spindle",
        Fixed,
        false,
        Refused(3, "coupled to the spindle"),
        "G21 G90 G54\nG0 X0 Y0 Z0\nG33.1 Z-5 K1\nM2\n",
    ),
    case(
        "Fanuc: a drilling program from start to end",
        Fixed,
        false,
        Moves(1 + 1 + 4 * 4 - 2 + 1, [-205.0, 0.0, 1150.0]),
        "%\nO1000 (DRILL)\nN10 G21\nN20 G0 G17 G40 G49 G80 G90\n(T1 DRILL 6)\nN30 T1 M6\nN40 G0 G90 G54 X0. Y0. S2000 M3\n\
         N50 G43 H1 Z10. M8\nN60 G98 G81 Z-5. R2. F120.\nN70 X10.\nN80 Y10.\nN90 X0.\nN100 G80\nN110 G0 X0. Y0. Z20.\nN120 M5\n\
         N130 G91 G28 Z0.\nN140 G28 X0. Y0.\nN150 M30\n%\n",
    ),
    case(
        "Fanuc: subprogram with M98 P L",
        Fixed,
        true,
        Moves(1 + 3 * 4 + 1, [-196.0, 0.0, 1140.0]),
        "O0001\nG21 G90 G54 G0 X0 Y0 Z2\nM98 P1000 L3\nG90 G0 Z10\nM30\nO1000\nG91 G1 Z-3 F100\nG1 X3\nG0 Z3\nG0 X0 Y0\nG90\nM99\n",
    ),
    case(
        "Fanuc: M98 with the number of times in P",
        Fixed,
        false,
        Moves(1 + 3, [-202.0, 0.0, 1130.0]),
        "O0001\nG21 G90 G54 G0 X0. Y0. Z0.\nM98 P31000\nM30\nO1000\nG91 G1 X1. F100.\nG90\nM99\n",
    ),
    case(
        "Fanuc: G52 for a second part",
        Fixed,
        true,
        Moves(1 + 1 + 1 + 1 + 1, [-205.0, 0.0, 1132.0]),
        "O2\nG21 G90 G54\nG0 X0. Y0. Z2.\nG52 X10. Y5.\nG0 X0. Y0.\nG1 X1. F100.\nG52 X0. Y0.\nG0 X1. Y1.\nX0. Y0.\nM30\n",
    ),
    case(
        "Fanuc: G10 L2 sets a frame",
        Fixed,
        true,
        Moves(1 + 1, [-209.0, 1.0, 1129.0]),
        "O3\nG21 G90\nG10 L2 P3 X-210. Y0. Z1129.\nG56 G0 X0. Y0. Z0.\nG1 X1. Y1. F100.\nM30\n",
    ),
    case(
        "Fanuc: G43.4 with A and C",
        Ac,
        false,
        Moves(1 + 1 + 1 + 1, [-203.0, 1.0, 1131.0]),
        "O4\nG21 G90 G54 G0 X0. Y0. A0. C0.\nG43.4 H1 Z5.\nG1 Z1. F200.\nX1. A3. C20.\nX2. Y1. A5. C45.\nG49\nM30\n",
    ),
    case(
        "Fanuc: look-ahead, dwell in milliseconds, G82",
        Fixed,
        false,
        Moves(1 + 4 + 3, [-195.0, 0.0, 1132.0]),
        "O5\nG21 G90 G54 G0 X0. Y0. Z2.\nG05.1 Q1\nG4 X0.5\nG99 G82 X5. Y0. Z-1. R1. P500 F80.\nG98 X10.\nG80\nG05.1 Q0\nM30\n",
    ),
    case(
        "Fanuc: arcs with increments",
        Fixed,
        true,
        Moves(1 + 56 + 56, [-185.0, 0.0, 1130.0]),
        "O6\nG17 G21 G90 G54\nG0 X0. Y0. Z0.\nG91 G2 X10. Y10. I10. J0. F150.\nG2 X10. Y-10. I0. J-10.\nG90\nM30\n",
    ),
    case(
        "Fanuc: radius compensation",
        Fixed,
        false,
        Refused(3, "tool's centre"),
        "O7\nG21 G90 G54 G0 X0 Y0 Z0\nG41 D1 X5 F100\nM30\n",
    ),
    case(
        "Fanuc: turned frame",
        Fixed,
        false,
        Refused(3, "turned work frames"),
        "O8\nG21 G90 G54 G0 X0 Y0 Z0\nG68.2 X0 Y0 Z0 I0 J20 K0\nM30\n",
    ),
    case("Fanuc: macro call", Fixed, false, Refused(3, "macros"), "O9\nG21 G90 G54 G0 X0 Y0 Z0\nG65 P9010 A1.\nM30\n"),
    case(
        "Haas: G53 at start and end, G187",
        Wrist,
        false,
        Moves(1 + 1 + 1 + 1 + 1, [-205.0, 0.0, 1112.0]),
        "%\nO00010 (HAAS)\nG20\nG0 G17 G40 G49 G80 G90\nG21\nT2 M6\nG54 G0 X0. Y0. A0. B0.\nG43 H2 Z6.\nG187 P3\nG1 Z1. F250.\n\
         X4. Y2. A1.5\nG0 Z8.\nG187\nG49\nG53 G0 X-205. Y0. Z1112.\nM30\n%\n",
    ),
    case(
        "Haas: G53 with the tool length in force passes",
        Fixed,
        false,
        Moves(1 + 1, [-201.0, 0.0, 1131.0]),
        "O00011\nG21 G90 G54 G0 X0. Y0.\nG43 H1 Z5.\nG1 X4. Z1. F100.\nG0 G53 Z0.\nM30\n",
    ),
    case(
        "Haas: TCPC by G234",
        Bc,
        false,
        Moves(1 + 1 + 1, [-204.0, 2.0, 1130.5]),
        "O00012\nG21 G90 G54 G0 X0. Y0. B0. C30.\nG234 H1 Z3.\nG1 Z0.5 B2. F100.\nX1. Y2. B4. C60.\nG49\nM30\n",
    ),
    case(
        "Haas: peck drilling with retract to R",
        Fixed,
        true,
        Moves(1 + 10 + 9, [-195.0, 0.0, 1131.0]),
        "O00013\nG21 G90 G54\nG0 X0. Y0. Z6.\nG99 G83 X5. Y0. Z-4. R1. Q2. F90.\nX10.\nG80\nM30\n",
    ),
    case("Haas: G154", Fixed, false, Refused(2, "G54 to G59.3"), "O00014\nG21 G90 G154 P1 G0 X0 Y0 Z0\nM30\n"),
    case(
        "Haas: local subprogram",
        Fixed,
        false,
        Refused(3, "M97"),
        "O00015\nG21 G90 G54 G0 X0. Y0. Z0.\nM97 P100 L2\nM30\nN100 G1 X1.\nM99\n",
    ),
    case(
        "Haas: rigid tapping",
        Fixed,
        false,
        Refused(3, "coupled to the spindle"),
        "O00016\nG21 G90 G54 G0 X0. Y0. Z5.\nG84 Z-5. R2. F500.\nM30\n",
    ),
    case(
        "Haas: circular pocket",
        Fixed,
        false,
        Refused(3, "circular pockets"),
        "O00017\nG21 G90 G54 G0 X0. Y0. Z5.\nG13 I5. K10. Q2. F500.\nM30\n",
    ),
    case(
        "Siemens ISO: block numbers, comments, feed a revolution",
        Fixed,
        true,
        Moves(1 + 1 + 56 + 1, [-185.0, 0.0, 1135.0]),
        "; PART 7\nN10 G17 G21 G90 G40 G54\nN20 G97 S1500 M3\nN30 G0 X0 Y0 Z2 ; START\nN40 G95 G1 X10 Y0 F0.1\nN50 G94 G3 X20 Y10 I0 J10 F150\nN60 G0 X20 Y0 Z5\nN70 M30\n",
    ),
    case(
        "Siemens ISO: block delete",
        Fixed,
        true,
        Moves(1 + 1 + 1, [-200.0, 5.0, 1130.0]),
        "N10 G21 G90 G54\nN20 G0 X0 Y0 Z0\nN30 G1 X5 F100\nN40 Y5\nN50 M30\n",
    ),
    case(
        "Siemens ISO: G30 with no place in the job",
        Fixed,
        false,
        Moves(1 + 1 + 1, [-205.0, 0.0, 1130.0]),
        "N10 G21 G90 G54\nN20 G0 X0 Y0 Z0\nN30 G1 X2 F100\nN40 G91 G30 Z0\nN50 G90 G0 X0 Y0 Z0\nN60 M30\n",
    ),
    case(
        "Siemens: its own language",
        Fixed,
        false,
        Refused(2, "DIN/ISO"),
        "N10 G21 G90 G54 G0 X0 Y0 Z0\nN20 TRAORI\nN30 M30\n",
    ),
    case(
        "Siemens: arc with CR=",
        Fixed,
        false,
        Refused(2, "DIN/ISO"),
        "N10 G21 G90 G54 G0 X0 Y0 Z0\nN20 G2 X5 Y5 CR=5 F100\nN30 M30\n",
    ),
    case(
        "Mach3: absolute centres",
        Fixed,
        true,
        Moves(1 + 1 + 40 + 40, [-205.0, 10.0, 1131.0]),
        "(Mach3)\nG21 G90 G90.1 G17 G40 G80\nG55 G0 X-10 Y-10 Z3\nG1 Z-1 F100\nG2 X-5 Y-5 I-5 J-10\nG3 X-10 Y0 I-10 J-5\nM30\n",
    ),
    case(
        "Mach3: G28 with a place in the job",
        Wrist,
        false,
        Moves(1 + 1 + 2 + 1, [-205.0, 0.0, 1130.0]),
        "G21 G90 G54\nG0 X0 Y0 Z0 A1 B1\nG1 X3 F100\nG91 G28 Z0\nG90 G0 X0 Y0 Z0 A0 B0\nM30\n",
    ),
    case(
        "Mach3: subprogram with holes",
        Fixed,
        true,
        Moves(1 + 4 + 3 + 3 + 2, [-185.0, 0.0, 1133.0]),
        "G21 G90 G54\nG0 X0 Y0 Z3\nG99 G81 X5 Y0 Z-2 R1 F60\nM98 P20\nG80\nG0 X20 Y0 Z1\nZ3\nM30\nO20\nX10\nX15\nM99\n",
    ),
    case(
        "Mach3: one line a move, modal",
        Wrist,
        true,
        Moves(5, [-203.0, 1.0, 1131.5]),
        "G21 G90 G54 G0 X0 Y0 Z0 A0 B0\nG1 X1 F100\nX2 A1\nZ1 B-1\nY1 Z1.5\nM30\n",
    ),
    case("Mach3: scaling", Fixed, false, Refused(3, "scaling"), "G21 G90 G54\nG0 X0 Y0 Z0\nG51 X2 Y2\nG1 X1\nM30\n"),
    case("Mach3: an unknown frame", Fixed, false, Refused(2, "where G58 lies"), "G21 G90\nG58 G0 X0 Y0 Z0\nM30\n"),
    case(
        "Mach3: a tool without a length",
        Fixed,
        false,
        Refused(3, "tool 9 is not known"),
        "G21 G90 G54\nG0 X0 Y0 Z0\nG43 H9\nM30\n",
    ),
];
