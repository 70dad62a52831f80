//! Compliances of low rank: what yields is often one direction, and a prior on all entries of a matrix pays for the others.

use nalgebra::{DMatrix, DVector};

/// The tangent space of the symmetric matrices of a rank, at the main directions of one: columns are combinations of the
/// entries of the lower triangle, row by row. `None` where that is the whole space.
pub fn tangent(amplitudes: &[f64], forces: usize, rank: usize) -> Option<DMatrix<f64>> {
    if forces < 3 || rank + 1 >= forces {
        return None;
    }
    let index = |i: usize, j: usize| if i >= j { i * (i + 1) / 2 + j } else { j * (j + 1) / 2 + i };
    let share = |i: usize, j: usize| if i == j { 1.0 } else { 0.5 };
    let matrix = DMatrix::from_fn(forces, forces, |i, j| share(i, j) * amplitudes[index(i, j)]);
    let eigen = matrix.symmetric_eigen();
    let mut order: Vec<usize> = (0..forces).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].abs().total_cmp(&eigen.eigenvalues[*a].abs()));
    let directions: Vec<DVector<f64>> = order.iter().map(|k| eigen.eigenvectors.column(*k).clone_owned()).collect();
    let mut columns = Vec::new();
    for r in 0..rank {
        for k in r..forces {
            let (a, b) = (&directions[r], &directions[k]);
            let m = if k == r { a * a.transpose() } else { (a * b.transpose() + b * a.transpose()) * 0.5_f64.sqrt() };
            let mut column = DVector::zeros(forces * (forces + 1) / 2);
            for i in 0..forces {
                for j in 0..=i {
                    column[index(i, j)] = m[(i, j)] / share(i, j);
                }
            }
            columns.push(column);
        }
    }
    Some(DMatrix::from_columns(&columns))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A compliance c a aᵀ lies in its own tangent space, and so do small turns of its direction, to second order.
    #[test]
    fn a_turned_direction_stays_in_the_tangent_space() {
        let entries = |a: [f64; 4]| -> DVector<f64> {
            let pairs = (0..4).flat_map(|i| (0..=i).map(move |j| (i, j)));
            DVector::from_iterator(10, pairs.map(|(i, j)| if i == j { a[i] * a[j] } else { 2.0 * a[i] * a[j] }))
        };
        let (a, turned) = ([0.5, -0.3, 0.7, 0.2], [0.501, -0.301, 0.699, 0.2]);
        let space = tangent(entries(a).as_slice(), 4, 1).unwrap();
        assert_eq!(space.ncols(), 4);
        let rest = |v: DVector<f64>| {
            let fitted = space.clone().svd(true, true).solve(&v, 1e-12).unwrap();
            (v - &space * fitted).norm()
        };
        assert!(rest(entries(a)) < 1e-12);
        assert!(rest(entries(turned)) < 1e-5);
        assert!(rest(entries([0.1, 0.9, -0.2, 0.3])) > 0.1);
    }

    #[test]
    fn a_rank_near_the_whole_space_has_no_tangent_space_of_its_own() {
        assert!(tangent(&[1.0; 6], 3, 2).is_none());
        assert!(tangent(&[1.0; 3], 2, 1).is_none());
    }
}
