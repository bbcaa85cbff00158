//! The rules of design.
//!
//! Lengths of runs are in samples and last at least as many milliseconds ([`closed_loop::span`]).

use crate::rules;
use model_core::average::WINDOW;

rules! {
    /// Default settings of a law, and criteria of its trials in closed loop.
    pub struct Rules in "design";

    /// Length of the runs whose means are compared to decide whether a model has settled.
    settled_mean: usize = 2000, "samples", "two seconds at 1 kHz";
    /// A model has settled if its mean changes by less than this from one run of `settled-mean` samples to the
    /// next.
    settled: f64 = 1e-4, "share of the mean", "judgement";
    /// Longest time allowed for settling.
    longest_wait: usize = 60_000, "samples", "judgement";
    /// A relative change is taken with respect to the mean, or to this value if the mean is smaller.
    least_mean: f64 = 0.1, "y", "judgement: friction gains are of order one";
    /// A natural friction below this is a remainder of the initial transient and counts as 0.
    no_natural: f64 = 1e-4, "share of the friction under steady blowing", "equal to `settled`";
    /// A model whose largest pole modulus exceeds 1 by more than this is reported as unstable.
    grows: f64 = 3e-5, "", "e-folding in half a minute";
    /// A flow beyond this has diverged.
    grown: f64 = 20.0, "y", "judgement: far beyond any friction gain";

    /// Delay tables cover flows up to this level.
    swing: f64 = 1.2, "times the friction under steady blowing", "judgement";
    /// A pulse that is longer than the dispersion of its edges by at least this always arrives.
    sure_pulse: u32 = 3, "samples", "theory 3.2: the index k − h of the arriving command advances by 0 to 2 per sample";
    /// Standard deviation of the model error assumed in the observer. Smaller: the estimate follows the
    /// model; larger: it follows the noise.
    model_error: f64 = 0.005, "share of the reachable interval", "tuned on plants other than those of docs/law.md";
    /// Sensor noise averaged over 64 samples, if the noise of the rig was not measured.
    usual_slow_noise: f64 = 0.025, "y", "a hot film: white noise of 0.03 y, and coloured noise of 0.035 y with a correlation time of 20 ms";
    /// Largest observer correction per sample.
    observer_most: f64 = 0.1, "share of the residual", "judgement";
    /// Rate of the bias estimate: share of a residual per delay time. It is slow, so that neither noise nor a
    /// wrong delay causes oscillation.
    bias_in_a_delay: f64 = 0.03, "share of the residual", "tuned on the plants of docs/law.md";
    /// The bias correction changes only if the estimate moves by this many standard deviations of its noise.
    play: f64 = 3.0, "standard deviations", "tuned on plants other than those of docs/law.md";
    /// Shortest delay time assumed for the rate of the bias estimate.
    bias_delay: u16 = 10, "samples", "judgement";
    /// Rate of the integral correction: share of an offset per delay time.
    integral_in_a_delay: f64 = 0.04, "share of the offset", "judgement";
    /// Shortest delay time assumed for the rate of the integral correction.
    integral_delay: u16 = 20, "samples", "judgement";
    /// While the bias is constant, the integral slows down until its noise is this share of the unavoidable
    /// ripple.
    noise_beside_ripple: f64 = 0.2, "share of the ripple", "tuned on plants other than those of docs/law.md";
    /// The integral keeps at least this share of its rate, to follow drift.
    least_settled: f64 = 0.1, "share of its rate", "judgement";
    /// Largest correction of bias and integral.
    correction: f64 = 0.3, "share of the reachable interval", "judgement";
    /// Anticipations that are tried in turn while the rms error on the model falls.
    anticipations: [f64; 6] = [0.85, 0.7, 0.55, 0.4, 0.2, 0.0], "of half a shortest time", "a grid; with the \
         shortest time m, a flow with the time constant τ crosses the centre of its swing after τ·ln(2/(1 + \
         e^(−m/τ)))";
    /// A smaller anticipation is preferred if it lowers the rms error by at least this share.
    anticipated: f64 = 0.005, "share of the rms error", "judgement";
    /// Switches that the budget can accumulate. With fewer than those of two pulses, a valve that was open for a
    /// long time would have to stay closed until the budget recovers.
    saved_switches: u32 = 10, "switches", "five pulses";
    /// The shorter part of a paced cycle is held for this share of its duration, so that the budget limits
    /// the rate and not the hold time.
    paced_hold: f64 = 0.8, "share of its time", "judgement";
    /// Switching rates that a law may choose to save air.
    paces: [f64; 6] = [40.0, 20.0, 10.0, 6.0, 4.0, 3.0], "switches in 1000 samples", "a grid";
    /// A slower switching rate is chosen if it saves at least this much air.
    worthwhile_saving: f64 = 0.01, "share of the air", "judgement";
    /// A slower switching rate is chosen only if the mean differs from the reference by at most this.
    paced_offset: f64 = 0.005, "share of the reachable interval", "judgement";
    /// On the model the air budget may be exceeded by this share.
    air_margin: f64 = 0.02, "share of the air of steady blowing", "judgement";

    /// Length of the run on the model that measures the air consumption.
    model_run: usize = 15_000, "samples", "judgement";
    /// Start of the scored part of that run.
    model_run_from: usize = 5000, "samples", "judgement: the initial transient has decayed";
    /// Length of a trial in closed loop.
    trial: usize = 12_000, "samples", "judgement";
    /// Start of the scored part of a trial.
    trial_from: usize = 4000, "samples", "judgement: the initial transient has decayed";
    /// Window over which friction is averaged to decide whether attachment is lost.
    attached_mean: usize = WINDOW as usize, "samples", "the window of ỹ in eq. (1)";
    /// Attachment is lost if that average is below this share of the target, or of the level under steady
    /// blowing.
    attached: f64 = 0.5, "share", "judgement: half";

    /// A plant is possible unless the one-sided p-value of the records is below this.
    not_excluded: f64 = 0.025, "p-value", "convention: the ends of intervals of 95 %";
    /// Number of steps in which the end of an interval is searched inwards from 1.96 standard errors; each
    /// step shortens the interval by a fifth.
    interval_steps: u32 = 20, "", "judgement: the last step is at 1/70 of 1.96 standard errors";
    /// Gauss–Newton steps of the refit for a possible plant.
    refitting_steps: usize = 5, "", "judgement";
    /// Iterations of a fit with another delay law.
    law_iterations: usize = 10, "", "judgement";
    /// Smallest size of an effect that is tried.
    smallest_size: f64 = 0.015_625, "share of the effect's largest usual size", "judgement: 1/64";
    /// Number of sizes of an effect that are tried.
    sizes: usize = 9, "", "judgement: six doublings, three halvings";
    /// White sensor noise in trials on the model.
    white_noise: f64 = 0.03, "y, friction of order one", "a hot film";
    /// Coloured sensor noise in trials on the model.
    coloured_noise: f64 = 0.035, "y, friction of order one", "a hot film";
    /// Correlation time of the coloured sensor noise.
    noise_memory: f64 = 20.0, "samples", "a hot film at 1 kHz: 20 ms";

    /// If the target does not pass, this many equal parts of the reachable interval are tried as
    /// alternatives.
    targets: u32 = 10, "", "judgement: 10 to 90 % of the interval";

    /// A law works on a plant if attachment is kept and the rms error is at most this.
    margin_rms: f64 = 2.0, "times that on the model", "convention";
    /// Runs with different noise per plant of the margin.
    margin_runs: u32 = 2, "runs", "judgement: limits the time";
    /// Length of a run for the margin.
    margin_run: usize = 6000, "samples", "judgement";
    /// Start of the scored part of a run for the robustness margin.
    margin_from: usize = 2000, "samples", "judgement: the initial transient has decayed";
    /// Largest factor on delay, gain and time constants that is searched.
    margin_reach: f64 = 4.0, "", "judgement";
    /// Rays in each plane of two errors, a multiple of four.
    margin_rays: u32 = 12, "", "judgement: limits the time";
    /// Bisections along each ray.
    margin_bisections: u32 = 5, "", "an end between the factors 1/4 and 4 is then known to 4 %";

    /// Transient of a pulse train that is not scored in the first comparison.
    train_from: usize = 3000, "samples", "judgement";
    /// Least scored length in the first comparison.
    train_judged: usize = 5000, "samples", "judgement";
    /// Start of the scored part of a long run. The scored part is as long as the part before it.
    long_from: usize = 20_000, "samples", "20 s to 40 s at 1 kHz";
    /// End of a long run, at which the motion must be unchanged.
    long_until: usize = 240_000, "samples", "four minutes at 1 kHz";
    /// A mean that differs from the scored one by more than this is another motion.
    same_mean: f64 = 0.05, "share of the mean", "judgement";
    /// A motion whose range exceeds the scored range by more than half, or by more than this, is another motion.
    same_range: f64 = 0.25, "y", "judgement";
    /// The value of an optimum is the lowest value over the train itself and trains with a longer and a shorter period.
    /// These periods differ from that of the train by 1 / this number of it.
    detuned: u32 = 50, "", "judgement: a resonance sharper than 2 % does not survive on a rig";
    /// Longest period of a pulse train.
    longest_period: usize = 3000, "samples", "six times the longest lag of an identification";
    /// Periods of the first grid of pulse trains.
    periods: u32 = 72, "", "a grid in steps of 7 % over two decades";
    /// Duty steps of that grid.
    duties: u32 = 20, "", "a grid in steps of 5 %";
    /// Grid points that are refined.
    refined: usize = 6, "", "judgement";
    /// Grid points that are evaluated over a long run.
    long_runs: usize = 40, "", "judgement";
    /// Refined pulse trains differ by at least this in the logarithm of the period, or by `distinct_duty`.
    distinct_period: f64 = 0.15, "ln", "judgement";
    /// Refined pulse trains differ by at least this in the duty, or by `distinct_period`.
    distinct_duty: f64 = 0.1, "", "judgement";

    /// Largest number of switching opportunities in a horizon.
    blocks: u32 = 60, "", "judgement: limits the time";
    /// Beam width: commands kept per switching opportunity.
    beam: usize = 16, "", "judgement: limits the time";
    /// Replanning instants per horizon of a receding-horizon law, because the end of a plan ignores what
    /// follows.
    plans: u32 = 3, "plans", "judgement";
    /// Length of the run with receding horizon, long enough to show its limit cycle.
    receding: usize = 8000, "samples", "judgement";
}
