//! Constants of a rig. Generated from its rig.toml; to change them, calibrate the rig again.

/// Counts of the separated flow, y = 0.
pub const ZERO: f32 = 800.0;
/// y per count.
pub const PER_COUNT: f32 = 0.0005;
/// Readings at or beyond these are at a rail, counts.
pub const RAILS: [f32; 2] = [8.0, 4087.0];
/// Duration of equal readings after which the sensor counts as stuck, s.
pub const STUCK_AFTER_S: f32 = 0.5;
/// Largest residual, averaged over about 64 samples, y.
pub const RESIDUAL_ENVELOPE: f32 = 0.5;
/// The valve's shortest times open and shut, s.
pub const SHORTEST_S: [f32; 2] = [0.004, 0.004];
/// The measured channel: counts at 0, units per count, lower and upper rail in counts; `None` if no channel was measured.
pub const CHANNEL: Option<[f32; 4]> = None;
