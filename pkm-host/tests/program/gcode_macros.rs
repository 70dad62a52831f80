//! Programs with parameters, expressions, conditions, loops and subroutines as LinuxCNC has them, our own, and bad ones.

use crate::gcode::rewritten;
use crate::gcode_programs::{
    Case,
    Direction::{Fixed, Wrist},
    Says::Moves,
    case,
};

pub const MACROS: &[Case] = &[
    case(
        "parameters, functions, signs",
        Fixed,
        true,
        Moves(10, [-198.0, -7.0, 1131.0]),
        "G21 G90 G54\nG0 X0 Y0 Z0\n#1=5.5\n#1=[2*3] #2=#1 (the old one)\n#1=[#1+0.5]\n#2=-#1\n#<Feed Rate>=[60*2]\nG1 X#1 Y[#2/2] F#<feedrate>\n\
         Xsqrt[16]Yatan[1]/[1] (45)\n#[1+2]=7 #100=3\nX##100 Y-[2+1]\nX[[-2]**2] Y[2**3**2/32] Z[-7 mod 4]\nXround[-2.5] Yfix[-2.5] Zfup[-2.5]\n\
         Xabs[-1] Y[sin[30]+cos[60]*tan[45]] Z[acos[0]/90]\nX[exp[ln[2]]] Y[asin[1]/-90]\nG[0.5+0.5] X[1 LT 2 AND 3 GE 3] Y[1 EQ 1.00005]\n\
         #3=1 G0 X#3 Y-#3\nM2\n",
    ),
    case(
        "a grid of holes but one, by whiles and ifs",
        Fixed,
        true,
        Moves(1 + 3 + 7 * 4 + 1, [-199.0, 6.0, 1136.0]),
        "G21 G90 G54\n#<dx> = 3 (pitch)\nG0 X0 Y0 Z5\n#1=0\no100 while [#1 LT 3]\n#2=0\no110 while [#2 LT 3]\n\
         o120 if [#1 EQ 1 AND #2 EQ 1]\n(nothing here)\no120 else\nG98 G81 X[#1*#<dx>] Y[#2*#<dx>] Z[-1-#1/10] R1 F[100+10*#2]\no120 endif\n\
         #2=[#2+1]\no110 endwhile\n#1 = [#1+1]\no100 endwhile\nG80\nG0 Z6\nM2\n",
    ),
    case(
        "a subroutine with arguments, its own names, and what it returns",
        Fixed,
        true,
        Moves(7, [-204.0, 3.0, 1135.0]),
        "G21 G90 G54\no<Corner> sub\n#<width>=[#1/2]\nG1 X#<width> Y#2 F200\nZ#3\n#1=99\no<corner> endsub [#<width>+#2]\n\
         #1=4 #<width>=1\nG0 X0 Y0 Z0\no<corner> call [#1+2] [3]\nG0 X#<width> Z#<_value>\no<corner> call [#1] [-#<width>] [1.5]\n\
         o1 if [#<_value_returned> AND EXISTS[#<width>] AND EXISTS[#<nothing>] EQ 0]\nG0 X#<width> Y[#<_value>+2] Z5\no1 endif\nM2\n",
    ),
    case(
        "do while with break and continue",
        Wrist,
        true,
        Moves(5, [-201.0, 2.0, 1130.0]),
        "G21 G90 G54\nG0 X0 Y0 Z0 A0 B0\n#5=0\no1 do\n#5=[#5+1]\no3 if [#5 GT 5]\no1 break\no3 endif\no2 if [#5 EQ 2]\no1 continue\no2 endif\n\
         G1 X[#5-1] Y[#5 MOD 3] A[#5/10] B-[#5/5] F300\no1 while [#5 LT 50]\nM2\n",
    ),
    case(
        "repeats of a computed number, arcs of computed radii",
        Fixed,
        true,
        Moves(1 + 28 + 27 + 29 + 3 + 2, [-203.0, 0.5, 1130.0]),
        "G17 G21 G90 G54\nG0 X0 Y0 Z0\n#10=2\no5 repeat [#10+0.7]\nG2 X#10 Y#10 I#10 J0 F150\nG0 X0 Y0\n#10=[#10+0.5]\no5 endrepeat\n\
         o6 repeat [-1]\nG0 X50\no6 endrepeat\no7 repeat [2]\nG91 G1 X1 Y[1/4]\nG90\no7 endrepeat\nM2\n",
    ),
    case(
        "if, elseif, else",
        Fixed,
        true,
        Moves(6, [-201.0, 5.0, 1130.0]),
        "G21 G90 G54\nG0 X0 Y0 Z0\n#1=0\no9 repeat [5]\no1 IF [#1 LE 1]\nG1 X#1 Y1 F100\no1 elseif [#1 EQ 2] (two)\nG1 X#1 Y2\no1 ELSEIF [#1 EQ 3]\n\
         G0 X#1 Y3\no1 else\no2 if [0]\nX9\no2 elseif [1]\nG0 X#1 Y5\no2 endif\no1 endif\n#1=[#1+1]\no9 endrepeat\nM2\n",
    ),
    case(
        "a subroutine that calls itself, and returns out of a loop",
        Fixed,
        true,
        Moves(1 + 4 + 1, [-205.0, 0.0, 1136.0]),
        "o200 sub\n#<_steps>=[#<_steps>+1]\no201 if [#1 LE 1]\no200 return [1]\no201 endif\nG1 X#1 Y[#1/2] F100\no200 call [#1-1]\n\
         o202 while [1]\no203 repeat [3]\no200 return [#<_value>*#1]\no203 endrepeat\no202 endwhile\no200 endsub\n\
         G21 G90 G54\nG0 X0 Y0 Z0\n#<_steps>=1\no200 call [4]\nG0 X0 Y0 Z[#<_value>/4]\no204 if [#<_steps> EQ 5]\nG0 Z6\no204 endif\nM2\n",
    ),
    case(
        "M98 shares the parameters, in inches",
        Fixed,
        true,
        Moves(1 + 3 * 2 + 1, [-205.0 + 0.4 * 25.4, 0.0, 1130.0 + 0.04 * 25.4]),
        "O0007\nG20 G90 G54\nG0 X0 Y0 Z0\n#1=0.1 #101=0\nM98 P8 L3\n/G1 X#1 Y#101 Z0.04\nM30\nO0008\nG1 X#1 Y0.1 F[2*5]\nY#101\n#1=[#1+0.1]\nM99\n",
    ),
    case(
        "break out of a repeat inside",
        Fixed,
        true,
        Moves(1 + 3, [-203.0, 1.0, 1130.0]),
        "G21 G90 G54\nG0 X0 Y0 Z0\n#1=0\no1 while [1]\no2 repeat [5]\n#1=[#1+1]\nG1 X#1 F100\no3 if [#1 EQ 2]\no1 break\no3 endif\no2 endrepeat\n\
         o1 endwhile\nG1 Y1\nM2\n",
    ),
];

/// Lines behind a start, the line that is refused, words of the reason.
const BAD: &[(&str, u64, &str)] = &[
    ("G1 X[1+2 F100", 3, "expected an operator or `]`"),
    ("G1 X[[1+2] F100", 3, "expected an operator or `]`"),
    ("#1=[2*[3+4]", 3, "`]` is missing"),
    ("G1 X[1+2]] F100", 3, "`]` closes no bracket"),
    ("G1 X[] F100", 3, "expected a number"),
    ("#1=0\nG1 X[5/#1]", 4, "division by 0"),
    ("#1=[5 mod 0]", 3, "division by 0"),
    ("#1=sqrt[-2]", 3, "sqrt[-2] has no value"),
    ("#1=ln[0]", 3, "ln[0] has no value"),
    ("#1=acos[1.01]", 3, "acos[1.01] has no value"),
    ("#1=[[-8] ** 0.5]", 3, "[-8 ** 0.5] has no value"),
    ("#1=[10 ** 400]", 3, "has no value"),
    ("#1=atan[1]", 3, "atan[y]/[x]"),
    ("#1=arctan[1]", 3, "DIN/ISO"),
    ("#1=exists[#5]", 3, "exists[#<depth>]"),
    ("G1 X#<depth>", 3, "X: #<depth> has no value: set it in the program"),
    ("G1 X#<_x>", 3, "what a control keeps"),
    ("G1 X#100", 3, "#100 has no value"),
    ("G1 X#5420", 3, "the control's own"),
    ("#5221=10", 3, "the control's own"),
    ("#1.5=2", 3, "a whole one from 1"),
    ("#0=2", 3, "a whole one from 1"),
    ("#<a=2", 3, "`>` is missing"),
    ("#1", 3, "expected `=`"),
    ("#1=2+3", 3, "stands in brackets"),
    ("#1=2\n#2=#1*3", 4, "stands in brackets"),
    ("G1 X1 = 2", 3, "expected a letter with a number"),
    ("#1=\u{e9}", 3, "expected a number"),
    ("o1 while [1]\no1 endwhile", 3, "does a loop end?"),
    ("#1=1\no1 while [#1 GT 0]\n#1=[#1+1]\no1 endwhile", 6, "nothing moves in 200000 lines"),
    ("o1 sub\no1 call\no1 endsub\no1 call", 4, "more than 10"),
    ("o1 call [1] [2", 3, "`]` is missing"),
    ("o1 call 1", 3, "O1 call: expected `[`, found `1`"),
    ("o1 if [1 GT 0]\nG1 X1", 3, "`O1 endif` is missing"),
    (
        "o1 if [1]\no2 while [1]\no1 endif\no2 endwhile",
        5,
        "`O2 endwhile` is missing, which ends the `O2 while` of line 4",
    ),
    ("o1 endif", 3, "no `O1 if` before it"),
    ("o1 while [0]\no1 endif", 4, "`O1 endwhile` is missing"),
    ("o1 if [1]\no1 else\no1 else\no1 endif", 5, "no `O1 if`"),
    ("o1 repeat [3]\no1 break\no1 endrepeat", 4, "no `O1 while` or `O1 do` around it"),
    ("o1 do\no1 continue\no1 break\no1 while [0]", 5, "where LinuxCNC 2.9 stops"),
    ("o1 if 1\no1 endif", 3, "expected `[`, found `1`"),
    ("o1 if [1] G0 X1\no1 endif", 3, "nothing but a comment"),
    ("o1 return", 3, "no `sub` around it"),
    ("o#1 call", 3, "expected a number, or a name"),
    ("o<drill> call [1]", 3, "is not in this file"),
    ("/o1 if [1]\n/o1 endif", 3, "without `/`"),
    ("IF [#1 GT 2] GOTO 20", 3, "`IF` of Fanuc's macros"),
    ("GOTO 20", 3, "`GOTO` of Fanuc's macros"),
    ("N10 WHILE [#1 LT 2] DO1", 3, "`WHILE` of Fanuc's macros"),
    ("END1", 3, "`END` of Fanuc's macros"),
];

#[test]
fn what_cannot_be_computed_is_refused_with_its_line() {
    let case = Case { direction: Fixed, ..MACROS[0] };
    let mut wrong = Vec::new();
    let deep = format!("#1={}1{}", "[".repeat(60), "]".repeat(60));
    let deep = (deep.as_str(), 3, "inside each other");
    for (text, line, words) in BAD.iter().chain([&deep]) {
        match case.read(&format!("G21 G90 G54\nG0 X0 Y0 Z0\n{text}\nM2\n")) {
            Err(failure) if failure.line == Some(*line) && failure.message.contains(words) => {}
            Err(failure) => wrong.push(format!("{text}: {failure}")),
            Ok(_) => wrong.push(format!("{text} is read")),
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A program may compute for long between its moves.
#[test]
fn lines_without_a_move_count_from_the_last_one() {
    let case = Case { direction: Fixed, ..MACROS[0] };
    let passes = |o: u32| format!("o{o} repeat [120000]\no{o} endrepeat\n");
    let text = format!("G21 G90 G54\nG0 X0 Y0 Z0\n{}G0 X1\n{}M2\n", passes(1), passes(2));
    assert_eq!(case.read(&text).unwrap().moves.len(), 2);
}

/// Every pass of a loop is written out, with the lines that made it as comments.
#[test]
fn a_loop_is_written_out_beside_its_lines() {
    let text = "G21 G90 G54\nG0 X0 Y0 Z0\n#<x>=1 (first)\no1 while [#<x> LE 2] (twice)\nN5 G1 X#<x> Y1. F[50*2] (cut)\n#<x>=[#<x>+1]\no1 endwhile\n\
                M2\n#<x>=[1/0]\n";
    let case = Case { direction: Fixed, ..MACROS[0] };
    let pass = |x: u32| {
        format!(
            "(o1 while [#<x> LE 2])\n(twice)\n(N5 G1 X#<x> Y1. F[50*2])\nN5 G1 F100 X{x} Y1 Z0 (cut)\n(#<x>=[#<x>+1])\n(o1 endwhile)\n"
        )
    };
    let expected = format!(
        "G21 G90 G54\nG0 X0 Y0 Z0\n(#<x>=1)\n(first)\n{}{}(o1 while [#<x> LE 2])\n(twice)\nM2\n",
        pass(1),
        pass(2)
    );
    assert_eq!(rewritten(&case.read(text).unwrap()), expected);
}
