//! All five axes of any machine with any wrist, in both arithmetics.
#![no_main]

use libfuzzer_sys::fuzz_target;
use pkm_core::tables::reference::{TABLE_F32, TABLE_F64};
use pkm_core::{
    Configuration, CorrectionTable, FiveAxis, JointValues, Machine, Scalar, ScrewLengths, Tool, ToolFrame,
    ToolSolution, Wrench, Wrist,
};
use pkm_fuzz::{Numbers, Rounded, assert_finite};

fn assert_configuration<T: Scalar>(c: &Configuration<T>) {
    assert_finite([c.pose.theta_rad, c.pose.sigma_rad, c.pose.z0_m, c.beta_rad[0], c.beta_rad[1]]);
}

fn assert_frame<T: Scalar>(frame: &ToolFrame<T>) {
    assert_finite(frame.tip_m.iter().chain(&frame.axes).copied());
}

/// What holds a tool are joints of its configuration.
fn assert_solution<T: Scalar>(five: &FiveAxis<'_, T>, solution: &ToolSolution<T>) {
    assert_configuration(&solution.configuration);
    assert!(solution.normalised_determinant.is_finite());
    assert_eq!(five.joints(&solution.configuration), Ok(solution.joints));
}

fn walk<T: Scalar>(
    five: &FiveAxis<'_, T>,
    table: &CorrectionTable<'_, T>,
    (near, joints, tool, wrench): (Configuration<T>, JointValues<T>, Tool<T>, Wrench<T>),
) {
    if let Ok((configuration, tool)) = five.forward(&joints) {
        assert_configuration(&configuration);
        assert!(tool.tip_m.iter().chain(&tool.axis).all(|v| v.is_finite()));
    }
    if let Ok(frame) = five.frame(&near) {
        assert_frame(&frame);
        if let Ok(solution) = five.inverse_frame(&frame) {
            assert_solution(five, &solution);
        }
        if let Ok(stiffness) = five.machine.stiffness(&near.pose) {
            let _ = five.tip_stiffness(&stiffness, &near);
        }
    }
    if let Ok(share) = five.normalised_determinant(&near) {
        assert!(share.is_finite());
    }
    for solution in [five.inverse(&tool, &near), five.search(&tool, &near), five.inverse_at(tool.tip_m, near.beta_rad)]
    {
        if let Ok(solution) = solution {
            assert_solution(five, &solution);
        }
    }
    for table in [None, Some(table)] {
        if let Ok(deflection) = five.deflection(table, &near, &wrench) {
            assert_finite(deflection.translation_m.iter().chain(&deflection.rotation_rad).copied());
        }
        if let Ok(compensated) = five.compensated(table, &tool, &wrench, &near) {
            assert_solution(five, &compensated.solution);
            let d = compensated.deflection;
            assert_finite(d.translation_m.iter().chain(&d.rotation_rad).copied().chain([compensated.remaining_m]));
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut n = Numbers(bytes);
    let (parameters, wrist, pose) = (n.machine(), n.wrist(), n.pose());
    let (beta, tip, axis) = (n.numbers([0.1, -0.1]), n.numbers([-0.205, 0.0, 1.137]), n.numbers([0.05, 0.02, 1.0]));
    let (q, wrench) = (n.numbers([0.57, 0.55, 0.52]), n.wrench());
    macro_rules! walk {
        ($t:ty, $table:expr) => {
            if let (Ok(machine), Ok(wrist)) = (Machine::<$t>::new(&parameters), Wrist::<$t>::new(&wrist)) {
                let near = Configuration::<$t> { pose: pose.rounded(), beta_rad: beta.rounded().into() };
                let joints = JointValues { lengths: ScrewLengths { q_m: q.rounded().into() }, beta_rad: near.beta_rad };
                let tool = Tool { tip_m: tip.rounded().into(), axis: axis.rounded().into() };
                let five = FiveAxis { machine: &machine, wrist: &wrist };
                walk(&five, $table, (near, joints, tool, wrench.rounded()));
            }
        };
    }
    walk!(f64, &TABLE_F64);
    walk!(f32, &TABLE_F32);
});
