//! What the cells of branch and bound inherit, against positions that are drawn in them.

use fastrand::Rng;
use pkm_core::{FiveAxis, Machine, Wrist};

use super::boxes::{Box2, Cell};
use super::cover::Cover;
use super::targets::Target;
use super::taylor::{THREE, TWO, Taylor};
use super::{Objective, PlacementModel};
use crate::files::job::{Axis, Job, PerAxis};
use crate::files::machine::MachineFile;
use crate::files::source::Source;
use crate::files::table::TableFile;

/// How often a cell is halved along each axis.
const HALVED: usize = 8;

/// Positions of cells, and how they compare with what is known of these.
#[derive(Default)]
struct Tried {
    postures: usize,
    /// A bound that is 5 % too high would be above them.
    near_bound: usize,
    /// Of boxes that a cell took over with their bounds.
    inherited: usize,
}

/// Divides all of the table down to cells about a position, as branch and bound does, and compares each with positions in it.
fn descended<const N: usize>(model: &PlacementModel<'_>, objective: Objective, rng: &mut Rng) -> Tried {
    let series: Vec<usize> = (0..model.job.series.len()).collect();
    let targets = Target::of(model.job, &series);
    let unlimited = model.reach.unlimited();
    let machine: Machine<Taylor<N>> = unlimited.machine.converted();
    let wrist: Wrist<Taylor<N>> = unlimited.wrist.converted();
    let mut store = model.store();
    let table = model.table.as_ref().and_then(|table| table.converted(&mut store));
    let cover = Cover::new(model, FiveAxis { machine: &machine, wrist: &wrist }, table, &targets);
    let hole = rng.usize(..targets.len());
    let limits = Axis::ALL.map(|axis| model.job.limits[axis]);
    let mut cell = Cell { middle: limits.map(|l| 0.5 * (l[0] + l[1])), half: limits.map(|l| 0.5 * (l[1] - l[0])) };
    let mut boxes = cover.whole();
    let mut tried = Tried::default();
    for n in 0..HALVED * Taylor::<N>::SYMBOLS {
        let axis = n % Taylor::<N>::SYMBOLS;
        cell.half[axis] *= 0.5;
        cell.middle[axis] += if rng.bool() { cell.half[axis] } else { -cell.half[axis] };
        let known = |within: &Box2| within.known[0];
        let before: Vec<_> = boxes.iter().map(known).collect();
        let mut solved = cover.solved(hole, &cell, boxes.drain(..));
        solved.retain_mut(|one| cover.cost((objective, 0), hole, &cell, one).is_some());
        boxes = solved.iter().map(|one| one.within).collect();
        tried.inherited += boxes.iter().filter(|within| before.contains(&known(within))).count();
        for _ in 0..8 {
            let at: [f64; 3] = std::array::from_fn(|i| cell.middle[i] + cell.half[i] * (2.0 * rng.f64() - 1.0));
            let position = PerAxis { dx_m: at[0], dy_m: at[1], rotary_rad: at[2] };
            for posture in model.postures(&targets[hole], &position).unwrap_or_default() {
                let cost = objective.cost(&posture);
                let mut holding = boxes.iter().filter(|within| within.holds(&posture.solution.configuration.beta_rad));
                let low = holding.clone().map(|within| within.known[0].low).fold(f64::INFINITY, f64::min);
                assert!(holding.next().is_some(), "{cell:?} lost {posture:?} of hole {hole}");
                assert!(low <= cost, "{cell:?}: {low:e} of hole {hole} at {position:?}, which costs {cost:e}");
                tried.postures += 1;
                tried.near_bound += usize::from(1.05 * low > cost);
            }
        }
    }
    tried
}

fn with_plate(rotary: &str, then: impl FnOnce(&PlacementModel<'_>)) {
    let machine = MachineFile::parse(Source::embedded(pkm_fixtures::MACHINE)).expect("the reference machine");
    let job = pkm_fixtures::JOB.text.replace("dy_mm =", &format!("{rotary}\ndy_mm ="));
    let job = Job::parse(&Source::from_text("job.toml", job)).expect("the case study");
    let table = TableFile::parse(&Source::embedded(pkm_fixtures::DEMO_TABLE)).expect("a table").numbers();
    let objectives = [Objective::Paper, Objective::TipWorst];
    then(&PlacementModel::new(&machine, Some((&table, false)), &job, &objectives, false, None).expect("a model"));
}

/// Many times from all of the table.
fn compared<const N: usize>(rotary: &str, times: usize) {
    let mut rng = Rng::with_seed(11);
    with_plate(rotary, |model| {
        let mut all = Tried::default();
        for n in 0..times {
            let objective = [Objective::Paper, Objective::TipWorst][n % 2];
            let tried = descended::<N>(model, objective, &mut rng);
            all.postures += tried.postures;
            all.near_bound += tried.near_bound;
            all.inherited += tried.inherited;
        }
        let Tried { postures, near_bound, inherited } = all;
        println!("{postures} postures, {near_bound} near their bounds, {inherited} boxes inherited");
        assert!(postures > 10 * times, "{postures}");
        assert!(
            near_bound > postures / 4,
            "a bound that is too high would hardly be found out: {near_bound} of {postures}"
        );
        assert!(inherited > 50 * times, "{inherited}");
    });
}

#[test]
fn no_posture_in_a_cell_is_lost_or_costs_less_than_its_box_says() {
    compared::<TWO>("", 40);
}

#[test]
fn neither_with_a_rotary_axis() {
    compared::<THREE>("rotary = { axis = [0, 0, 1], through_mm = [-220, -300, 0], range_deg = [-30, 30] }", 10);
}
