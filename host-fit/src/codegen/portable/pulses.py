

class Law:
    """Plays pulses in a period that repeats: `step` returns the valve's position until the next sample."""

    def __init__(self):
        self.at = 0
        self.on = False
        self.since = 1 << 32

    def step(self, reading=None, channels=None):
        wanted = any((self.at - first) % LAW_PERIOD < length for first, length in LAW_PULSES)
        self.at = (self.at + 1) % LAW_PERIOD
        if wanted != self.on and self.since >= (LAW_HOLD_ON if self.on else LAW_HOLD_OFF):
            self.on, self.since = wanted, 1
        else:
            self.since += 1
        return self.on
