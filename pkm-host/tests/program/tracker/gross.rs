//! One reflector that is wrong in one of many readings: it hardly shows in the mean of all, and is named.

use super::{Reflector, SQUARE, UNEVEN, as_points};
use crate::common::{Folder, fixture, run};

/// What `import` says of a campaign on the fixture p08.
fn said_of([points, reflectors, readings]: &[String; 3], folder: &Folder) -> String {
    let machine = fixture("measured/p08/machine.toml");
    let files = ["--machine", &machine, "--points", points, "--reflectors", reflectors, "--readings", readings];
    let output = run(&[&["import"], &files[..], &["--out", &folder.path("d.csv")]].concat());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    String::from_utf8(output.stderr).unwrap()
}

/// The list with one coordinate of one of its points changed, and the point's line.
fn with_error(points: &str, begin: &str, coordinate: usize, error_mm: f64) -> (String, usize) {
    let line = points.lines().position(|l| l.starts_with(begin)).unwrap();
    let row = |(n, l): (usize, &str)| {
        let mut cells: Vec<String> = l.split(',').map(str::to_owned).collect();
        if n == line {
            cells[3 + coordinate] = (cells[3 + coordinate].parse::<f64>().unwrap() + error_mm).to_string();
        }
        cells.join(",") + "\n"
    };
    (points.lines().enumerate().map(row).collect(), line + 1)
}

#[test]
fn a_gross_error_of_one_point_is_named() {
    let platform: Vec<Reflector> = UNEVEN.iter().filter(|r| r.2).copied().collect();
    for (reflectors, seed) in [(SQUARE.to_vec(), 11), (platform, 12), (UNEVEN.to_vec(), 13)] {
        let folder = Folder::new();
        let mut files = as_points("p08", &reflectors, &folder, seed);
        assert!(!said_of(&files, &folder).contains("warning"), "{}", said_of(&files, &folder));
        let good = folder.read("points.csv");
        let mut wrong =
            vec![("r57,loaded,R2,", "`R2` in r57, loaded", 0.4), ("s4,unloaded,R3,", "`R3` in s4, unloaded", 0.4)];
        if reflectors.iter().any(|r| !r.2) {
            let of_base = [("r60,loaded,G1,", "`G1` in r60, loaded"), ("s5,unloaded,G4,", "`G4` in s5, unloaded")];
            wrong.extend(of_base.map(|(begin, words)| (begin, words, 0.15)));
        }
        for (begin, words, error_mm) in wrong {
            for coordinate in 0..3 {
                let (points, line) = with_error(&good, begin, coordinate, error_mm);
                files[0] = folder.write("wrong.csv", &points);
                let said = said_of(&files, &folder);
                let place = format!("warning: {}:{line}: point: {words}", folder.path("wrong.csv"));
                assert!(said.contains(&place) && said.matches("warning").count() == 1, "{place}, {coordinate}: {said}");
            }
        }
    }
}

/// Three reflectors have their distances alone: of an error along the side of two of them nobody can tell whose it is.
#[test]
fn of_three_reflectors_a_gross_error_is_named() {
    let folder = Folder::new();
    let mut files = as_points("p08", &SQUARE[..3], &folder, 18);
    let good = folder.read("points.csv");
    for coordinate in 0..3 {
        let (points, _) = with_error(&good, "r57,loaded,R2,", coordinate, 0.3);
        files[0] = folder.write("wrong.csv", &points);
        let said = said_of(&files, &folder);
        assert!(said.contains("`R2`") && said.contains(" in r57, loaded, is"), "{coordinate}: {said}");
    }
}

/// Out of the plane of a square all four corners are off by as much: nobody can tell which is wrong.
#[test]
fn reflectors_that_cannot_be_told_apart_are_all_named() {
    let folder = Folder::new();
    let mut files = as_points("p08", &SQUARE, &folder, 14);
    let good = folder.read("points.csv");
    // w of the first pose in the tracker's frame: the normal of three corners
    let corner = |name: &str| -> Vec<f64> {
        let row = good.lines().find(|l| l.starts_with(&format!("r8,loaded,{name},"))).unwrap();
        row.split(',').skip(3).take(3).map(|c| c.parse().unwrap()).collect()
    };
    let [a, b, c] = ["R1", "R2", "R3"].map(corner);
    let (p, q): (Vec<f64>, Vec<f64>) = (0..3).map(|i| (b[i] - a[i], c[i] - a[i])).unzip();
    let mut points = good;
    let mut line = 0;
    for i in 0..3 {
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let normal = (p[j] * q[k] - p[k] * q[j]) / (150.0 * 150.0);
        (points, line) = with_error(&points, "r8,loaded,R1,", i, 0.5 * normal);
    }
    files[0] = folder.write("wrong.csv", &points);
    let said = said_of(&files, &folder);
    assert!(said.contains(&format!("wrong.csv:{line}: point: `R1`, `R2`, `R3` or `R4` in r8, loaded")), "{said}");
}

/// Noise of nearly twice the stated uncertainty, in all points or in those of one reflector, is no gross error.
#[test]
fn noise_above_the_stated_uncertainty_is_no_gross_error() {
    for (noisy, seed) in [(4, 15), (4, 16), (1, 17)] {
        let folder = Folder::new();
        let mut reflectors = SQUARE;
        reflectors.iter_mut().take(noisy).for_each(|r| r.3 *= 1.9);
        let files = as_points("p08", &reflectors, &folder, seed);
        folder.write("points.csv", &folder.read("points.csv").replace(",19\n", ",10\n"));
        let said = said_of(&files, &folder);
        assert!(!said.contains("warning"), "{said}");
    }
}

/// The example of the fixtures has no gross error.
#[test]
fn the_fixture_has_no_warning() {
    let folder = Folder::new();
    let [points, reflectors, readings] =
        ["points.csv", "reflectors.toml", "readings.csv"].map(|f| fixture(&format!("tracker/{f}")));
    let files = ["--points", &points, "--reflectors", &reflectors, "--readings", &readings];
    let output = run(&[&["import"], &files[..], &["--out", &folder.path("d.csv")]].concat());
    assert_eq!(String::from_utf8(output.stderr).unwrap(), "");
}
