//! All ways to hold a tool, against configurations that are known to and against searches from anywhere.

use std::time::{Duration, Instant};

use fastrand::Rng;
use nalgebra::Vector2;
use pkm_core::tables::reference::{MACHINE_F64, WRIST, WRIST_F64};
use pkm_core::{Configuration, FiveAxis, Pose, Tool, ToolSolution, Wrist, WristParameters};
use pkm_host::plan::inverse_all::{inverse_all, inverse_all_scanned};
use pkm_tests::seeded;

const FIVE: FiveAxis<'static, f64> = FiveAxis { machine: &MACHINE_F64, wrist: &WRIST_F64 };

fn configuration(rng: &mut Rng, beta: f64) -> Configuration<f64> {
    let mut within = |low: f64, high: f64| low + (high - low) * rng.f64();
    Configuration {
        pose: Pose { theta_rad: within(-0.9, 0.9), sigma_rad: within(-0.9, 0.9), z0_m: within(0.3, 0.8) },
        beta_rad: Vector2::new(within(-beta, beta), within(-beta, beta)),
    }
}

fn apart(a: &Configuration<f64>, b: &Configuration<f64>) -> f64 {
    let all = |c: &Configuration<f64>| [c.pose.theta_rad, c.pose.sigma_rad, c.pose.z0_m, c.beta_rad[0], c.beta_rad[1]];
    all(a).iter().zip(all(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn off(five: &FiveAxis<'_, f64>, solution: &ToolSolution<f64>, tool: &Tool<f64>) -> f64 {
    let held = five.tool(&solution.configuration).expect("within limits");
    let pairs = held.tip_m.iter().chain(&held.axis).zip(tool.tip_m.iter().chain(&tool.axis));
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn every_way_to_hold_a_tool_is_found() {
    let mut rng = seeded();
    let mut counts = [0; 8];
    let mut worst: f64 = 0.0;
    for n in 0..20_000 {
        let mut c = configuration(&mut rng, 1.57);
        // about β2 = 0, where the equation is 0/0
        match n % 5 {
            0 => c.beta_rad[1] = 0.0,
            1 => c.beta_rad[1] *= 1e-6,
            2 => (c.beta_rad[0], c.pose.sigma_rad) = (0.0, 0.0),
            _ => {}
        }
        let (Ok(tool), Ok(share)) = (FIVE.tool(&c), FIVE.normalised_determinant(&c)) else { continue };
        if share.abs() < 1e-3 {
            continue;
        }
        let found = inverse_all(&FIVE, &WRIST, &tool);
        counts[found.len()] += 1;
        for solution in &found {
            worst = worst.max(off(&FIVE, solution, &tool));
        }
        assert!(found.iter().any(|solution| apart(&solution.configuration, &c) < 1e-6), "{c:?} not among {found:?}");
    }
    println!("ways to hold a tool: {counts:?}; off by {worst:e}");
    assert!(worst < 1e-8, "{worst}");
}

#[test]
fn no_search_finds_another() {
    let mut rng = seeded();
    let wide = WristParameters { min_rad: [-3.1; 2], max_rad: [3.1; 2], ..WRIST };
    let mut several = 0;
    for turned in [false, true] {
        let p =
            if turned { WristParameters { first_b_m: 0.1, second_b_m: 0.15, offset_m: 0.05, ..wide } } else { wide };
        let wrist = Wrist::<f64>::new(&p).expect("a wrist");
        let five = FiveAxis { machine: &MACHINE_F64, wrist: &wrist };
        for _ in 0..300 {
            let Ok(tool) = five.tool(&configuration(&mut rng, 3.0)) else { continue };
            let found = inverse_all(&five, &p, &tool);
            several += usize::from(found.iter().filter(|h| h.normalised_determinant > 0.1).count() > 1);
            for _ in 0..30 {
                let Ok(solution) = five.inverse(&tool, &configuration(&mut rng, 3.0)) else { continue };
                let known = found.iter().any(|h| apart(&h.configuration, &solution.configuration) < 1e-6);
                assert!(known, "{solution:?} not among {found:?}");
            }
        }
    }
    println!("{several} tools in several ways in home's working mode");
    assert!(several > 0);
}

#[test]
fn roots_and_scan_find_the_same_ways_and_the_roots_sooner() {
    let mut rng = seeded();
    let wide = WristParameters { min_rad: [-3.1; 2], max_rad: [3.1; 2], ..WRIST };
    // without offset both ways of every β2 are roots of the polynomial twice
    let wrists = [WRIST, wide, WristParameters { offset_m: 0.0, ..wide }];
    let (mut count, mut times) = (0, [Duration::ZERO; 2]);
    for p in &wrists {
        let wrist = Wrist::<f64>::new(p).expect("a wrist");
        let five = FiveAxis { machine: &MACHINE_F64, wrist: &wrist };
        for _ in 0..3000 {
            let Ok(tool) = five.tool(&configuration(&mut rng, p.max_rad[0])) else { continue };
            let start = Instant::now();
            let roots = inverse_all(&five, p, &tool);
            let between = Instant::now();
            let scan = inverse_all_scanned(&five, p, &tool);
            times = [times[0] + (between - start), times[1] + between.elapsed()];
            // next to the singularity locus two ways are one
            for hold in scan.iter().filter(|hold| hold.normalised_determinant.abs() > 1e-3) {
                count += 1;
                let known = roots.iter().any(|root| apart(&root.configuration, &hold.configuration) < 1e-6);
                assert!(known, "{p:?} {tool:?}: {hold:?} not among {roots:?}");
            }
        }
    }
    println!("{count} ways; roots {:?}, scan {:?}", times[0], times[1]);
    assert!(count > 2000 && times[0] < times[1], "{count} {times:?}");
}
