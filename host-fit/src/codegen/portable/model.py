PERIOD = @period@  # s
COMMAND_OFF, COMMAND_FULL = @off@, @full@  # commands of no jet and of a full jet
CHANNELS = @channel_names@  # measured channels, in the order in which they are passed
USUAL = @usual@  # their usual values
OUTPUTS, JETS = @outputs@, @jets@  # stored flow states and jet strengths, samples
WINDOW = @window@  # length of averages, samples
HELD = @held@  # samples simulated before a run that does not begin at rest
SENSOR_ZERO = @zero@  # y
@if rates
RATE_OFF, RATE_ON = @rate_off@, @rate_on@  # relaxation rates of the separated and the attached flow, 1/sample
@end
@cards@

@derived@
@if track

# The law; times in samples.
@law_constants@
@end
@if maximise

# The law; times in samples, pulses as (first sample, length).
LAW_PERIOD = @law_period@
LAW_PULSES = @law_pulses@
LAW_HOLD_ON, LAW_HOLD_OFF = @law_on@, @law_off@
@end


class Model:
    """The model with its state."""

    def __init__(self):
        self.reset()

    def reset(self, y=None, u=None, channels=USUAL):
        """Restarts at the first sample. Before it all signals are 0, or the reading `y` and the command `u` are constant."""
        self.y = [0.0] * OUTPUTS
        self.jets = [0.0] * JETS
        @if average
        self.sum = self.fresh = 0.0
        self.in_block = 0
        @end
        @if averaged
        self.sums = [0.0] * (JETS + 1)  # sums of the jets so far
        @end
        @if clocked
        self.lived, self.since_edge, self.last_command = 0, 1 << 24, 0.0
        @end
        @memories@
        if y is not None:
            command = COMMAND_OFF if u is None else u
            for _ in range(HELD):
                self.advance(y - SENSOR_ZERO)
                self.observe(@jet@, channels, True)
            self.advance(y - SENSOR_ZERO)

    def copy(self):
        return copy.deepcopy(self)

    def observe(self, u, channels, sensed):
        """Computes one sample without advancing the flow: (reading, flow, next flow, shortest delay)."""
        y, jets = self.y, self.jets
        now = y[-1]
        @if clocked
        self.lived += 1
        self.since_edge = 0 if u != self.last_command else min(self.since_edge + 1, 1 << 24)
        self.last_command = u
        @end
        jet = u
        @command@
        @jet_effects@
        jets.append(jet)
        @if averaged
        sums = self.sums
        sums.append(sums[-1] + jet)
        @end
        @if transport
        @delay@
        nearest = JETS
        @for inputs
        exact = min(max(0.0, @factor@ * delay), 1e9)
        whole = min(int(exact), JETS - 2)
        @if rounded
        if exact - whole >= 0.5:
            whole = min(whole + 1, JETS - 2)
        @if averaged
        jet@l@ = (sums[-1 - whole] - sums[-1 - whole - WINDOW]) / WINDOW
        @else
        jet@l@ = jets[-1 - whole]
        @end
        @if first
        present = jet0
        @end
        @else
        fraction = exact - int(exact)
        @if averaged
        newer, older = (sums[-1 - whole] - sums[-1 - whole - WINDOW]) / WINDOW, (sums[-2 - whole] - sums[-2 - whole - WINDOW]) / WINDOW
        @else
        newer, older = jets[-1 - whole], jets[-2 - whole]
        @end
        @if first
        present = older if fraction else newer
        @end
        jet@l@ = newer + fraction * (older - newer)
        @end
        nearest = min(nearest, whole)
        @end
        arrived = jet0
        @else
        @for inputs
        @if averaged
        jet@l@ = (sums[-1 - @lag@] - sums[-1 - @lag@ - WINDOW]) / WINDOW
        @else
        jet@l@ = jets[-@place@]
        @end
        @end
        arrived = present = jet0
        nearest = @nearest@
        @end
        reading = now
        @if senses
        if sensed:
            @sensor_effects@
        @end
        @if graded
        # Rate and final level of the flow lie between those of separated and attached flow.
        free = @constant@ + (
            0.0@free@)
        past = (
            0.0@past@)
        following = free + past
        if arrived != 0.0:
            share = @share@
            gain = (
            0.0@gain@)
            past_gain = (
            0.0@past_gain@)
            separated = (1.0 - arrived) * past / RATE_OFF if past != 0.0 else 0.0
            attached = arrived * (@drive@ + past + past_gain) / RATE_ON
            following = free + gain * share + (RATE_OFF + (RATE_ON - RATE_OFF) * share) * (separated + attached)
        @else
        following = free = (
            @constant@@free@)
        @for inputs
        if jet@l@ != 0.0:
            following += jet@l@ * (
            @drive@@gain@)
        @end
        @end
        @if drives
        # Effects of the flow: each uses the motion with the preceding effects.
        share = @share@
        relaxation = RATE_OFF + (RATE_ON - RATE_OFF) * share
        separated = 1.0 - share if share in (0.0, 1.0) or relaxation == 0.0 else (1.0 - share) * RATE_OFF / relaxation
        @if proportional
        motion = (1.0 - arrived) * (free - now) if arrived not in (0.0, 1.0) else separated * (following - now)
        @else
        motion = separated * (following - now)
        @end
        added = 0.0
        @for flow_effects
        next_y = following + added
        released = motion + separated * added
        @effect@
        @end
        following += added
        @end
        return reading, now, following, nearest

    def advance(self, flow):
        """Stores `flow` as the newest flow state."""
        y = self.y
        @if average
        # The sum of every block is computed anew, so it does not drift.
        self.fresh += y[-1]
        self.in_block += 1
        if self.in_block >= WINDOW - 1:
            self.sum, self.fresh, self.in_block = self.fresh, 0.0, 0
        else:
            self.sum += y[-1] - y[-WINDOW]
        @end
        y.append(flow)
        if len(y) > 65536 + OUTPUTS:
            del y[:-OUTPUTS]
            del self.jets[:-JETS]
            @if averaged
            self.sums = [s - self.sums[-JETS - 1] for s in self.sums[-JETS - 1:]]
            @end

    def step(self, command, channels=USUAL):
        """Returns the reading at this sample and advances the model; the command holds until the next sample."""
        reading, _, following, _ = self.observe(@jet@, channels, True)
        self.advance(following)
        return reading

    def simulate(self, u, channels=None, y_before=None, u_before=None):
        """A free run for the commands `u`; returns one reading per command.

        `channels` has a column for each of CHANNELS, in its unit. Before the first sample all signals are 0, or the
        reading `y_before` and the command `u_before` (by default the first one) are constant.
        """
        u = np.asarray(u, dtype=float).ravel()
        rows = [USUAL] * len(u) if channels is None else np.asarray(channels, dtype=float).reshape(len(u), -1).tolist()
        first = u[0] if u_before is None and len(u) else u_before
        self.reset(y_before, first, rows[0] if rows else USUAL)
        observe, advance, readings = self.observe, self.advance, []
        for command, row in zip(u.tolist(), rows):
            reading, _, following, _ = observe(@jet@, row, True)
            advance(following)
            readings.append(reading)
        return np.array(readings)
