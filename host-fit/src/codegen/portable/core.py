#:_sqrt
def _sqrt(x):
    return math.sqrt(x) if x > 0.0 else 0.0


#:_exp
def _exp(x):
    return math.inf if x > 709.782712893384 else math.exp(x)


#:_cbrt
def _cbrt(x):
    return float(np.cbrt(x))


#:_sin
def _sin(x):
    return math.sin(x) if math.isfinite(x) else math.nan


#:_cos
def _cos(x):
    return math.cos(x) if math.isfinite(x) else math.nan


#:_divided
def _divided(x, y):
    """Division by IEEE 754, also by 0."""
    return x / y if y != 0.0 else float(np.divide(np.float64(x), np.float64(y)))


#:_push
def _push(line, value, length):
    line.append(value)
    if len(line) > 4096 + 2 * length:
        del line[:-length]


#:_ago
def _ago(line, samples):
    """The value `samples` samples ago, with linear interpolation."""
    samples = min(max(0.0, samples), len(line) - 2.0)
    whole = int(samples)
    return line[-1 - whole] + (samples - whole) * (line[-2 - whole] - line[-1 - whole])


