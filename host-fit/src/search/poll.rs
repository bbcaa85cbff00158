//! Poll directions: OrthoMADS with 2n or n + 1 directions, and the complete ±1 poll.
//!
//! A random unit vector v gives the orthogonal basis H = I − 2vvᵀ; each column
//! and its negative, rounded to the mesh, are the 2n directions. The n + 1
//! variant keeps of each pair the sign that points along the last success and
//! adds minus their sum. Abramson et al., SIAM J. Optim. 20(2), 2009;
//! Audet et al., SIAM J. Optim. 24(4), 2014.

use crate::order;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::mesh::{Mesh, moved};
use super::settings::PollKind;
use super::variable::{Point, Variable};

/// Trial points of one poll around `center`, in the order in which to try them.
pub(crate) fn points(
    variables: &[Variable],
    groups: &[Vec<usize>],
    center: &[i64],
    mesh: &Mesh,
    kind: PollKind,
    last_step: Option<&[i64]>,
    rng: &mut ChaCha8Rng,
) -> Vec<Point> {
    let mut steps = Vec::new();
    for group in groups {
        let free: Vec<usize> = group
            .iter()
            .copied()
            .filter(|&i| variables.get(i).is_some_and(|v| v.range() > 0))
            .collect();
        if free.is_empty() {
            continue;
        }
        let basis = orthogonal_basis(free.len(), rng);
        let embed = |direction: &[f64]| {
            let mut full = vec![0.0; variables.len()];
            for (&i, d) in free.iter().zip(direction) {
                full[i] = *d;
            }
            full
        };
        let mut chosen: Vec<Vec<f64>> = Vec::new();
        match kind {
            PollKind::Ortho2N => {
                for column in &basis {
                    chosen.push(embed(column));
                    chosen.push(embed(&negative(column)));
                }
            }
            PollKind::OrthoNPlus1 => {
                let mut sum = vec![0.0; free.len()];
                for column in &basis {
                    let along: f64 = last_step.map_or(0.0, |last| {
                        free.iter()
                            .zip(column)
                            .map(|(&i, c)| c * last.get(i).copied().unwrap_or(0) as f64)
                            .sum()
                    });
                    let column = if along < 0.0 {
                        negative(column)
                    } else {
                        column.clone()
                    };
                    sum.iter_mut().zip(&column).for_each(|(s, c)| *s -= c);
                    chosen.push(embed(&column));
                }
                if free.len() > 1 {
                    chosen.push(embed(&sum));
                } else {
                    chosen.push(embed(&negative(&basis[0])));
                }
            }
        }
        let mut group_steps: Vec<Vec<i64>> = chosen.iter().map(|d| mesh.project(d)).collect();
        if let Some(last) = last_step {
            order_along(&mut group_steps, last);
        }
        steps.extend(group_steps);
    }
    distinct(variables, center, &steps)
}

/// Every neighbour one tick away: the 2n points of the complete poll.
pub(crate) fn neighbours(variables: &[Variable], center: &[i64]) -> Vec<Point> {
    let steps: Vec<Vec<i64>> = (0..variables.len())
        .flat_map(|i| {
            [1, -1].map(|sign| {
                (0..variables.len())
                    .map(|j| if i == j { sign } else { 0 })
                    .collect()
            })
        })
        .collect();
    distinct(variables, center, &steps)
}

fn distinct(variables: &[Variable], center: &[i64], steps: &[Vec<i64>]) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::with_capacity(steps.len());
    for step in steps {
        let point = moved(variables, center, step);
        if point != center && !points.contains(&point) {
            points.push(point);
        }
    }
    points
}

fn negative(direction: &[f64]) -> Vec<f64> {
    direction.iter().map(|d| -d).collect()
}

/// Columns of the Householder matrix of a random unit vector.
fn orthogonal_basis(n: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let mut v: Vec<f64> = (0..n).map(|_| StandardNormal.sample(rng)).collect();
    let norm = v.iter().map(|x: &f64| x * x).sum::<f64>().sqrt();
    if norm > 0.0 {
        v.iter_mut().for_each(|x| *x /= norm);
    }
    (0..n)
        .map(|i| {
            (0..n)
                .map(|j| f64::from(u8::from(i == j)) - 2.0 * v[i] * v[j])
                .collect()
        })
        .collect()
}

/// Sorts steps so that those along the last success come first.
fn order_along(steps: &mut [Vec<i64>], last: &[i64]) {
    let cosine = |step: &[i64]| {
        let dot: f64 = step
            .iter()
            .zip(last)
            .map(|(a, b)| *a as f64 * *b as f64)
            .sum();
        let norm: f64 = step.iter().map(|a| (*a as f64).powi(2)).sum::<f64>().sqrt();
        if norm > 0.0 { dot / norm } else { 0.0 }
    };
    order::descending(steps, |step| cosine(step));
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn delays(n: usize) -> Vec<Variable> {
        (0..n)
            .map(|i| Variable::integer(format!("d{i}"), 0, 500))
            .collect()
    }

    #[test]
    fn the_basis_is_orthogonal() {
        let basis = orthogonal_basis(7, &mut ChaCha8Rng::seed_from_u64(3));
        for (i, a) in basis.iter().enumerate() {
            for (j, b) in basis.iter().enumerate() {
                let dot: f64 = a.iter().zip(b).map(|(x, y)| x * y).sum();
                assert!(
                    (dot - f64::from(u8::from(i == j))).abs() < 1e-12,
                    "{i} {j} {dot}"
                );
            }
        }
    }

    #[test]
    fn polls_have_2n_and_n_plus_1_points_on_the_frame() {
        let variables = delays(6);
        let mesh = Mesh::new(&variables);
        let groups = [(0..6).collect::<Vec<_>>()];
        for (kind, count) in [(PollKind::Ortho2N, 12), (PollKind::OrthoNPlus1, 7)] {
            let mut rng = ChaCha8Rng::seed_from_u64(1);
            let poll = points(
                &variables,
                &groups,
                &[250; 6],
                &mesh,
                kind,
                Some(&[10; 6]),
                &mut rng,
            );
            assert_eq!(poll.len(), count);
            for point in &poll {
                let reach = point.iter().map(|x| (x - 250).abs()).max();
                assert_eq!(reach, Some(50));
                assert!(point.iter().all(|x| (x - 250) % 10 == 0));
            }
        }
    }

    #[test]
    fn groups_move_apart() {
        let variables = delays(4);
        let mesh = Mesh::new(&variables);
        let groups = [vec![0, 1, 2], vec![3]];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let poll = points(
            &variables,
            &groups,
            &[250; 4],
            &mesh,
            PollKind::OrthoNPlus1,
            None,
            &mut rng,
        );
        assert_eq!(poll.len(), 4 + 2);
        assert!(poll.iter().all(|p| p[3] == 250 || p[..3] == [250; 3]));
    }

    #[test]
    fn the_complete_poll_has_every_neighbour_inside_the_bounds() {
        let variables = delays(3);
        let mut found = neighbours(&variables, &[0, 7, 500]);
        found.sort();
        assert_eq!(found, [[0, 6, 500], [0, 7, 499], [0, 8, 500], [1, 7, 500]]);
    }
}
