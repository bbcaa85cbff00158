

class Law:
    """Holds the flow at LAW_REFERENCE with an on/off valve: `step` takes a reading and returns the valve's position."""

    def __init__(self):
        self.model = Model()
        self.predictions = [0.0] * (LAW_LEAD + 1)
        self.bias = self.missed = self.integral = self.reference = self.learned = 0.0
        self.share = 1.0
        self.age = self.lost = 0
        self.on = False
        self.since = 1 << 32
        self.switches = LAW_SWITCHES_CAPACITY
        self.air = LAW_AIR_CAPACITY
        self.estimate = self.foreseen = self.residual = 0.0

    def _look_ahead(self, on, channels):
        """Predicts the flow over the anticipation after `on` arrives, and LAW_LEAD samples from now."""
        halves = LAW_HALF_SAMPLES_ON if on else LAW_HALF_SAMPLES_OFF
        valve = LAW_OPENING if on else LAW_CLOSING
        near, far = valve + halves // 2, valve + (halves + 1) // 2
        ahead = self.model.copy()
        foreseen = at_lead = ahead.y[-1]
        arrived, arrived_for = False, 0
        for i in range(LAW_LOOK_AHEAD):
            _, flow, following, nearest = ahead.observe(1.0 if on else 0.0, channels, False)
            ahead.advance(following)
            arrived = arrived or nearest <= i
            if i + 1 == LAW_LEAD:
                at_lead = following
            if not arrived:
                foreseen = following
                continue
            arrived_for += 1
            if arrived_for <= near:
                foreseen = following
            elif near == 0 and arrived_for == 1:
                foreseen = flow
            if arrived_for >= far and i + 1 >= LAW_LEAD:
                if far > near:
                    foreseen = (foreseen + following) / 2.0
                break
        return foreseen, at_lead

    def _allowed(self, wanted):
        """The wanted position, limited by the budgets of switches and air."""
        if wanted and not self.on:
            switches = LAW_SAMPLES_PER_SWITCH == 0 or self.switches >= 2 * LAW_SAMPLES_PER_SWITCH
            return switches and (LAW_AIR_CAPACITY == 0 or self.air >= min(LAW_AIR_FIRST, LAW_AIR_CAPACITY))
        if wanted:
            return LAW_AIR_CAPACITY == 0 or self.air >= LAW_AIR_DRAIN
        return False

    def _correct(self, estimate, residual, at_lead):
        self.predictions = self.predictions[1:] + [at_lead]
        self.age += 1
        if residual is None:
            self.lost += 1
            return
        self.lost = 0
        if self.age <= LAW_LEAD:
            return
        flow = estimate + residual
        missed = flow - self.predictions[0]
        if self.reference != self.learned:
            self.learned, self.share = self.reference, 1.0
        rate = self.share * LAW_INTEGRAL_RATE
        self.missed = _limited(self.missed + LAW_BIAS_RATE * (missed - self.missed), LAW_CORRECTION_LIMIT)
        bias = min(max(self.bias, self.missed - LAW_PLAY), self.missed + LAW_PLAY)
        if bias != self.bias:
            self.bias, self.share = bias, 1.0
        error = self.reference - flow
        if not (self.since >= 4 * LAW_LEAD and (error > 0.0) == self.on):
            self.integral = _limited(self.integral + rate * error, LAW_CORRECTION_LIMIT)
            self.share -= LAW_INTEGRAL_RATE * (self.share * self.share - LAW_SETTLED * LAW_SETTLED)

    def step(self, reading, channels=USUAL):
        """The valve's position until the next sample; a reading of None or NaN counts as missing."""
        if LAW_SLOPE > 0.0:
            self.reference = max(min(LAW_REFERENCE, self.reference + LAW_SLOPE), self.reference - LAW_SLOPE)
        else:
            self.reference = LAW_REFERENCE
        looks, was_on = self.age > 0, self.on
        target = self.reference + self.integral - self.bias
        may_switch = self.since >= (LAW_HOLD_ON if was_on else LAW_HOLD_OFF)
        if looks:
            foreseen, at_lead = self._look_ahead(was_on != may_switch, channels)
        else:
            foreseen = at_lead = self.model.y[-1]
        if not (may_switch and looks):
            wanted = was_on
        else:
            wanted = foreseen <= target if was_on else foreseen < target
        wanted = self._allowed(wanted)
        if wanted != self.on and may_switch:
            self.on, self.since = wanted, 1
        else:
            self.since += 1
        if LAW_SAMPLES_PER_SWITCH > 0:
            spent = 0 if was_on == self.on else LAW_SAMPLES_PER_SWITCH
            self.switches = max(min(self.switches + 1, LAW_SWITCHES_CAPACITY) - spent, 0)
        if LAW_AIR_CAPACITY > 0:
            if self.on:
                self.air = max(self.air - LAW_AIR_DRAIN, 0)
            else:
                self.air = min(self.air + LAW_AIR_PER_MILLE, LAW_AIR_CAPACITY)
        measured, flow, following, _ = self.model.observe(1.0 if self.on else 0.0, channels, True)
        residual = None
        if reading is not None and math.isfinite(reading):
            residual = _limited(reading - measured, LAW_RESIDUAL_LIMIT)
        self._correct(flow, residual, at_lead)
        self.residual = 0.0 if residual is None else residual
        self.model.advance(following + LAW_OBSERVER * self.residual)
        self.estimate, self.foreseen = flow, foreseen + self.bias - self.integral
        return self.on


def _limited(x, limit):
    return max(min(x, limit), -limit)
