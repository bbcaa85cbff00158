//! The rules of design.
//!
//! Lengths of runs are in samples and last at least as many milliseconds ([`closed_loop::span`]).

use crate::rules;
use model_core::average::WINDOW;

rules! {
    /// What a law is given beside its model, and what a trial in the loop says of it.
    pub struct Rules in "design";

    /// A model is settled when its mean over so long a run …
    settled_mean: usize = 2000, "samples", "two seconds at 1 kHz";
    /// … moves by less than this from one to the next …
    settled: f64 = 1e-4, "share of the mean", "judgement";
    /// … and is waited for no longer than this.
    longest_wait: usize = 60_000, "samples", "judgement";
    /// Shares of a mean are shares of this where it is smaller.
    least_mean: f64 = 0.1, "y", "judgement: friction gains are of order one";
    /// A natural friction below this is what is left of the start, and none.
    no_natural: f64 = 1e-4, "share of the friction under steady blowing", "as settled as a mean is";
    /// A model whose largest pole modulus is further above 1 than this grows, and that is remarked.
    grows: f64 = 3e-5, "", "e-folding in half a minute";
    /// A flow beyond this has grown without bound.
    grown: f64 = 20.0, "y", "judgement: far beyond any friction gain";

    /// Delays are looked up for flows up to this.
    swing: f64 = 1.2, "times the friction under steady blowing", "judgement";
    /// A pulse must be longer than its edge is held back by this to arrive in any case.
    sure_pulse: u32 = 3, "samples", "theory 3.2: k − h advances by 0 to 2 a sample";
    /// The observer weighs the sensor's noise against a model that misses the flow by this: with less the estimate is the
    /// model's alone; with more it follows the noise …
    model_error: f64 = 0.005, "share of what can be reached", "chosen on plants other than those of docs/law.md";
    /// … of this size, averaged over 64 samples, where the rig has not been measured …
    usual_slow_noise: f64 = 0.025, "y", "a hot film: white 0.03, coloured 0.035 with 20 ms";
    /// … and corrects no more than this at once.
    observer_most: f64 = 0.1, "share of the residual", "judgement";
    /// The bias of the estimate follows so much of a residual in a delay: slow, so that neither noise nor a wrong delay
    /// turns corrections into an oscillation …
    bias_in_a_delay: f64 = 0.03, "share of the residual", "chosen on the plants of docs/law.md";
    /// … and is believed only where it leaves what is believed already by so many standard deviations of the noise in it …
    play: f64 = 3.0, "standard deviations", "chosen on plants other than those of docs/law.md";
    /// … in a delay of at least this.
    bias_delay: u16 = 10, "samples", "judgement";
    /// The integral correction follows so much of an offset in a delay …
    integral_in_a_delay: f64 = 0.04, "share of the offset", "judgement";
    /// … of at least this.
    integral_delay: u16 = 20, "samples", "judgement";
    /// While the bias stays the integral slows down until it lets through noise of this share of the ripple that cannot be avoided …
    noise_beside_ripple: f64 = 0.2, "share of the ripple", "chosen on plants other than those of docs/law.md";
    /// … but keeps this much of its rate: what drifts has to be followed.
    least_settled: f64 = 0.1, "share of its rate", "judgement";
    /// Corrections go no further than this.
    correction: f64 = 0.3, "share of what can be reached", "judgement";
    /// Switches that may be saved up: with less than two pulses' worth a valve that has been open for long would have to
    /// wait closed for leave to open again.
    saved_switches: u32 = 10, "switches", "five pulses";
    /// The shorter part of a paced cycle is held for this much of its share, so that the budget binds and not the hold.
    paced_hold: f64 = 0.8, "share of its time", "judgement";
    /// Paces that a law may choose to save air.
    paces: [f64; 6] = [40.0, 20.0, 10.0, 6.0, 4.0, 3.0], "switches in 1000 samples", "a grid";
    /// A slower pace is chosen for a saving of at least this …
    worthwhile_saving: f64 = 0.01, "share of the air", "judgement";
    /// … if the mean stays within this of the reference.
    paced_offset: f64 = 0.005, "share of what can be reached", "judgement";
    /// The air budget may be exceeded on the model by this.
    air_margin: f64 = 0.02, "share of the air of steady blowing", "judgement";

    /// Length of the run on the model that says what air a law takes …
    model_run: usize = 15_000, "samples", "judgement";
    /// … and from where it counts.
    model_run_from: usize = 5000, "samples", "judgement: the start is over";
    /// Length of a trial in the loop …
    trial: usize = 12_000, "samples", "judgement";
    /// … and from where it counts.
    trial_from: usize = 4000, "samples", "judgement: the start is over";
    /// Friction is averaged over this before attachment is called lost …
    attached_mean: usize = WINDOW as usize, "samples", "the window of ỹ in eq. (1)";
    /// … which it is below this share of what was asked for, or of what steady blowing gives.
    attached: f64 = 0.5, "share", "judgement: half";

    /// A flow is possible unless the one-sided p-value of the records is below this.
    not_excluded: f64 = 0.025, "p-value", "convention: the ends of intervals of 95 %";
    /// The end of an interval is sought in so many steps of a fifth, from 1.96 standard errors inwards.
    interval_steps: u32 = 20, "", "judgement: to a seventieth";
    /// What chance lets the best effect take when the size is asked that a diagnosis would have named.
    usual_by_chance: f64 = 0.01, "share of the energy", "as large as it is in searches on 8 records";
    /// Gauss–Newton steps in which all else is fitted to a possible flow.
    refitting_steps: usize = 5, "", "judgement";
    /// Iterations of a fit with another delay law.
    law_iterations: usize = 10, "", "judgement";
    /// The size of an effect is sought from this on …
    smallest_size: f64 = 0.015_625, "share of its largest usual size", "judgement: a 64th";
    /// … at so many sizes.
    sizes: usize = 9, "", "judgement: six doublings, three halvings";
    /// Noise of the sensor in trials on the model: without memory …
    white_noise: f64 = 0.03, "y, friction of order one", "a hot film";
    /// … and with one …
    coloured_noise: f64 = 0.035, "y, friction of order one", "a hot film";
    /// … of this length.
    noise_memory: f64 = 20.0, "samples", "a hot film at 1 kHz: 20 ms";

    /// Targets that are tried where the wished one does not pass divide what can be reached into so many parts.
    targets: u32 = 10, "", "judgement: 10 to 90 % of the interval";

    /// A law works on a flow if attachment is kept and the rms error is no more than this …
    margin_rms: f64 = 2.0, "times that on the model", "convention";
    /// … over so many runs with noise of their own …
    margin_runs: u32 = 2, "runs", "judgement: for the time it takes";
    /// … of this length …
    margin_run: usize = 6000, "samples", "judgement";
    /// … counted from here on.
    margin_from: usize = 2000, "samples", "judgement: the start is over";
    /// Delay, gain and time constants are wrong by this factor at most.
    margin_reach: f64 = 4.0, "", "judgement";
    /// Rays in each plane of two errors, a multiple of four …
    margin_rays: u32 = 12, "", "judgement: for the time it takes";
    /// … and halvings along each.
    margin_bisections: u32 = 5, "", "to 4 % of a factor of 4 either way";

    /// Pulse trains are played for this while they are compared …
    train_from: usize = 3000, "samples", "judgement";
    /// … and judged over this at least.
    train_judged: usize = 5000, "samples", "judgement";
    /// The best ones are judged from here on, for as long …
    long_from: usize = 20_000, "samples", "20 s to 40 s at 1 kHz";
    /// … and must do the same until here.
    long_until: usize = 240_000, "samples", "four minutes at 1 kHz";
    /// A mean further than this from the judged one is another motion …
    same_mean: f64 = 0.05, "share of the mean", "judgement";
    /// … and so is one whose range goes further than half of itself beyond the judged one, or than this.
    same_range: f64 = 0.25, "y", "judgement";
    /// An optimum is worth what is left of it on a flow that is slower or faster by one in so many samples.
    detuned: u32 = 50, "samples", "judgement: a resonance sharper than 2 % does not survive on a rig";
    /// Longest period of a pulse train.
    longest_period: usize = 3000, "samples", "six times the longest lag of an identification";
    /// Periods of the first grid of pulse trains …
    periods: u32 = 72, "", "a grid in steps of 7 % over two decades";
    /// … with so many steps of the duty.
    duties: u32 = 20, "", "a grid in steps of 5 %";
    /// The best of the grid that are refined.
    refined: usize = 6, "", "judgement";
    /// The best of the grid that are judged in the long run.
    long_runs: usize = 40, "", "judgement";
    /// Two of these differ by at least this in the logarithm of the period …
    distinct_period: f64 = 0.15, "ln", "judgement";
    /// … or by this in the duty.
    distinct_duty: f64 = 0.1, "", "judgement";

    /// Most chances to switch in a horizon.
    blocks: u32 = 60, "", "judgement: for the time it takes";
    /// Commands kept at each of them.
    beam: usize = 16, "", "judgement: for the time it takes";
    /// A law that plans again and again does so this often in a horizon: the end of a plan is cut off from what follows.
    plans: u32 = 3, "plans", "judgement";
    /// For this long a law plans again and again to show its cycle.
    receding: usize = 8000, "samples", "judgement";
}
