//! The granular mesh of MADS: per variable a frame size and a mesh size.
//!
//! Frame size Δ = a·10^b with a ∈ {1, 2, 5}; mesh size δ = max(1, 10^(b−|b−b₀|)),
//! both in ticks, b₀ being the initial exponent. A success enlarges
//! 1→2→5→10, a failure refines 10→5→2→1, never below one tick.
//! Audet, Le Digabel, Tribes, "The mesh adaptive direct search algorithm for
//! granular and discrete variables", SIAM J. Optim. 29(2), 2019; the numbers
//! follow NOMAD 4's `GMesh`.

use super::rules::RULES;
use super::variable::{Point, Variable};

/// Mantissa and exponent of one variable's frame size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct MeshAxis {
    mantissa: i64,
    exponent: u32,
    initial_exponent: u32,
    range: i64,
}

impl MeshAxis {
    fn new(frame: f64, range: i64) -> Self {
        let frame = frame.max(1.0);
        let mut exponent = frame.log10().floor() as u32;
        let mantissa = match frame / 10f64.powi(exponent as i32) {
            m if m < 1.5 => 1,
            m if m < 3.5 => 2,
            m if m < 7.5 => 5,
            _ => {
                exponent += 1;
                1
            }
        };
        Self {
            mantissa,
            exponent,
            initial_exponent: exponent,
            range,
        }
    }

    fn frame_size(&self) -> i64 {
        self.mantissa * 10i64.pow(self.exponent)
    }

    fn mesh_size(&self) -> i64 {
        let drift = self.exponent.abs_diff(self.initial_exponent);
        10i64.pow(self.exponent.saturating_sub(drift))
    }

    fn ratio(&self) -> f64 {
        self.frame_size() as f64 / self.mesh_size() as f64
    }

    fn enlarge(&mut self) {
        if self.frame_size() >= self.range {
            return;
        }
        (self.mantissa, self.exponent) = match self.mantissa {
            1 => (2, self.exponent),
            2 => (5, self.exponent),
            _ => (1, self.exponent + 1),
        };
    }

    fn refine(&mut self) {
        (self.mantissa, self.exponent) = match (self.mantissa, self.exponent) {
            (5, b) => (2, b),
            (2, b) => (1, b),
            (_, 0) => (1, 0),
            (_, b) => (5, b - 1),
        };
    }
}

/// The mesh around an incumbent, one axis per variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Mesh {
    axes: Vec<MeshAxis>,
}

impl Mesh {
    /// Mesh with the usual initial frame sizes.
    pub fn new(variables: &[Variable]) -> Self {
        Self::with_frame_share(variables, RULES.initial_frame)
    }

    /// Mesh whose initial frames are a given share of each variable's range.
    pub fn with_frame_share(variables: &[Variable], share: f64) -> Self {
        let axes = variables
            .iter()
            .map(|v| MeshAxis::new((v.range() as f64 * share).ceil(), v.range()))
            .collect();
        Self { axes }
    }

    /// Frame sizes Δ in ticks: how far a poll reaches along each variable.
    pub fn frame_sizes(&self) -> Vec<i64> {
        self.axes.iter().map(MeshAxis::frame_size).collect()
    }

    /// Mesh sizes δ in ticks: the spacing of the trial points.
    pub fn mesh_sizes(&self) -> Vec<i64> {
        self.axes.iter().map(MeshAxis::mesh_size).collect()
    }

    /// Whether every frame has shrunk to one tick, so that no further refinement is possible.
    pub fn is_finest(&self) -> bool {
        self.axes.iter().all(|a| a.frame_size() == 1)
    }

    /// Makes the frames smaller, after a failed poll.
    pub fn refine(&mut self) {
        self.axes.iter_mut().for_each(MeshAxis::refine);
    }

    /// Enlarges the frames, after a success along `step` (ticks), for the variables that moved: the frame then takes
    /// the shape of the valley.
    pub fn enlarge(&mut self, step: &[i64]) {
        for (axis, &moved) in self.axes.iter_mut().zip(step) {
            if moved.unsigned_abs() as f64 > RULES.anisotropy * axis.frame_size() as f64 {
                axis.enlarge();
            }
        }
    }

    /// Rounds a direction to the mesh: its largest component reaches the frame,
    /// the others in proportion, each a whole number of mesh sizes.
    pub fn project(&self, direction: &[f64]) -> Vec<i64> {
        let norm = direction.iter().fold(0.0f64, |m, d| m.max(d.abs()));
        if norm == 0.0 {
            return vec![0; self.axes.len()];
        }
        self.axes
            .iter()
            .zip(direction)
            .map(|(axis, d)| (axis.ratio() * d / norm).round() as i64 * axis.mesh_size())
            .collect()
    }

    /// Rounds a displacement in ticks to whole mesh sizes.
    pub fn round(&self, step: &[f64]) -> Vec<i64> {
        self.axes
            .iter()
            .zip(step)
            .map(|(axis, s)| (s / axis.mesh_size() as f64).round() as i64 * axis.mesh_size())
            .collect()
    }
}

/// Moves `from` by `step` and back inside the bounds.
pub(crate) fn moved(variables: &[Variable], from: &[i64], step: &[i64]) -> Point {
    variables
        .iter()
        .zip(from)
        .zip(step)
        .map(|((variable, x), s)| variable.clamp(x.saturating_add(*s)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn delay() -> Mesh {
        Mesh::new(&[Variable::integer("delay", 0, 500)])
    }

    #[test]
    fn a_delay_between_0_and_500_starts_at_frame_50_and_mesh_10() {
        let mesh = delay();
        assert_eq!(mesh.frame_sizes(), [50]);
        assert_eq!(mesh.mesh_sizes(), [10]);
        assert_eq!(mesh.axes[0].ratio(), 5.0);
    }

    #[test]
    fn refinement_follows_5_2_1_down_to_one_tick() {
        let mut mesh = delay();
        let mut seen = vec![];
        for _ in 0..7 {
            mesh.refine();
            seen.push((mesh.frame_sizes()[0], mesh.mesh_sizes()[0]));
        }
        // δ = 10^(b−|b−b₀|): at b = 0 the frame is finer than the start and δ is one tick.
        assert_eq!(
            seen,
            [(20, 10), (10, 10), (5, 1), (2, 1), (1, 1), (1, 1), (1, 1)]
        );
        assert!(mesh.is_finest());
    }

    #[test]
    fn enlargement_follows_1_2_5_and_stops_at_the_range() {
        let mut mesh = delay();
        let mut seen = vec![];
        for _ in 0..5 {
            mesh.enlarge(&[500]);
            seen.push((mesh.frame_sizes()[0], mesh.mesh_sizes()[0]));
        }
        // For a frame larger than at the start the mesh keeps its initial size, 10^(2−1).
        assert_eq!(
            seen,
            [(100, 10), (200, 10), (500, 10), (500, 10), (500, 10)]
        );
    }

    #[test]
    fn only_variables_that_moved_are_enlarged() {
        let two = [
            Variable::integer("a", 0, 500),
            Variable::integer("b", 0, 500),
        ];
        let mut mesh = Mesh::new(&two);
        mesh.enlarge(&[50, 5]);
        assert_eq!(mesh.frame_sizes(), [100, 50]);
    }

    #[test]
    fn projection_reaches_the_frame_and_stays_on_the_mesh() {
        let two = [
            Variable::integer("a", 0, 500),
            Variable::granular("f", 0.0, 1.0, 1e-4),
        ];
        let mesh = Mesh::new(&two);
        assert_eq!(mesh.frame_sizes(), [50, 1000]);
        assert_eq!(mesh.mesh_sizes(), [10, 1000]);
        assert_eq!(mesh.project(&[2.0, -1.0]), [50, -1000]);
        assert_eq!(mesh.project(&[0.5, 0.1]), [50, 0]);
        assert_eq!(mesh.project(&[0.0, 0.0]), [0, 0]);
    }

    #[test]
    fn a_fixed_variable_has_the_finest_frame() {
        let mesh = Mesh::new(&[Variable::integer("fixed", 7, 7)]);
        assert!(mesh.is_finest());
        assert_eq!(moved(&[Variable::integer("fixed", 7, 7)], &[7], &[3]), [7]);
    }
}
