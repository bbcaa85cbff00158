
function law = law_at_rest()
  c = constants();
  law.model = at_rest();
  law.predictions = zeros(c.LAW_LEAD + 1, 1);
  law.bias = 0; law.missed = 0; law.integral = 0; law.reference = 0; law.learned = 0;
  law.share = 1;
  law.age = 0; law.lost = 0;
  law.on = false;
  law.since = inf;
  law.switches = c.LAW_SWITCHES_CAPACITY;
  law.air = c.LAW_AIR_CAPACITY;
end

% Predicts the flow over the anticipation after `on` arrives, and LAW_LEAD samples from now.
function [foreseen, at_lead] = look_ahead(law, c, on, channels)
  if on
    halves = c.LAW_HALF_SAMPLES_ON; valve = c.LAW_OPENING;
  else
    halves = c.LAW_HALF_SAMPLES_OFF; valve = c.LAW_CLOSING;
  end
  near = valve + floor(halves / 2);
  far = valve + ceil(halves / 2);
  ahead = law.model;
  foreseen = ahead.y(1);
  at_lead = foreseen;
  arrived = false;
  arrived_for = 0;
  for i = 1:c.LAW_LOOK_AHEAD
    [~, flow, following, nearest, ahead] = observe(ahead, double(on), channels, false);
    ahead = advance(ahead, following);
    arrived = arrived || nearest < i;
    if i == c.LAW_LEAD
      at_lead = following;
    end
    if ~arrived
      foreseen = following;
      continue
    end
    arrived_for = arrived_for + 1;
    if arrived_for <= near
      foreseen = following;
    elseif near == 0 && arrived_for == 1
      foreseen = flow;
    end
    if arrived_for >= far && i >= c.LAW_LEAD
      if far > near
        foreseen = (foreseen + following) / 2;
      end
      break
    end
  end
end

% The wanted position, limited by the budgets of switches and air.
function yes = allowed(law, c, wanted)
  yes = wanted;
  if wanted && ~law.on
    yes = (c.LAW_SAMPLES_PER_SWITCH == 0 || law.switches >= 2 * c.LAW_SAMPLES_PER_SWITCH) && ...
          (c.LAW_AIR_CAPACITY == 0 || law.air >= min(c.LAW_AIR_FIRST, c.LAW_AIR_CAPACITY));
  elseif wanted
    yes = c.LAW_AIR_CAPACITY == 0 || law.air >= c.LAW_AIR_DRAIN;
  end
end

function law = correct(law, c, estimate, has_reading, residual, at_lead)
  law.predictions = [law.predictions(2:end); at_lead];
  law.age = law.age + 1;
  if ~has_reading
    law.lost = law.lost + 1;
    return
  end
  law.lost = 0;
  if law.age <= c.LAW_LEAD
    return
  end
  flow = estimate + residual;
  missed = flow - law.predictions(1);
  if law.reference ~= law.learned
    law.learned = law.reference;
    law.share = 1;
  end
  rate = law.share * c.LAW_INTEGRAL_RATE;
  law.missed = limited(law.missed + c.LAW_BIAS_RATE * (missed - law.missed), c.LAW_CORRECTION_LIMIT);
  bias = min(max(law.bias, law.missed - c.LAW_PLAY), law.missed + c.LAW_PLAY);
  if bias ~= law.bias
    law.bias = bias;
    law.share = 1;
  end
  error_now = law.reference - flow;
  if ~(law.since >= 4 * c.LAW_LEAD && (error_now > 0) == law.on)
    law.integral = limited(law.integral + rate * error_now, c.LAW_CORRECTION_LIMIT);
    law.share = law.share - c.LAW_INTEGRAL_RATE * (law.share ^ 2 - c.LAW_SETTLED ^ 2);
  end
end

function [on, law] = law_step(law, reading, channels)
  c = constants();
  if c.LAW_SLOPE > 0
    law.reference = max(min(c.LAW_REFERENCE, law.reference + c.LAW_SLOPE), law.reference - c.LAW_SLOPE);
  else
    law.reference = c.LAW_REFERENCE;
  end
  looks = law.age > 0;
  was_on = law.on;
  target = law.reference + law.integral - law.bias;
  if was_on
    may_switch = law.since >= c.LAW_HOLD_ON;
  else
    may_switch = law.since >= c.LAW_HOLD_OFF;
  end
  if looks
    [foreseen, at_lead] = look_ahead(law, c, was_on ~= may_switch, channels);
  else
    foreseen = law.model.y(1);
    at_lead = foreseen;
  end
  if ~(may_switch && looks)
    wanted = was_on;
  elseif was_on
    wanted = foreseen <= target;
  else
    wanted = foreseen < target;
  end
  wanted = allowed(law, c, wanted);
  if wanted ~= law.on && may_switch
    law.on = wanted;
    law.since = 1;
  else
    law.since = law.since + 1;
  end
  if c.LAW_SAMPLES_PER_SWITCH > 0
    spent = c.LAW_SAMPLES_PER_SWITCH * (was_on ~= law.on);
    law.switches = max(min(law.switches + 1, c.LAW_SWITCHES_CAPACITY) - spent, 0);
  end
  if c.LAW_AIR_CAPACITY > 0
    if law.on
      law.air = max(law.air - c.LAW_AIR_DRAIN, 0);
    else
      law.air = min(law.air + c.LAW_AIR_PER_MILLE, c.LAW_AIR_CAPACITY);
    end
  end
  [measured, flow, following, ~, law.model] = observe(law.model, double(law.on), channels, true);
  has_reading = ~isempty(reading) && isfinite(reading);
  residual = 0;
  if has_reading
    residual = limited(reading - measured, c.LAW_RESIDUAL_LIMIT);
  end
  law = correct(law, c, flow, has_reading, residual, at_lead);
  law.model = advance(law.model, following + c.LAW_OBSERVER * residual);
  law.estimate = flow;
  law.foreseen = foreseen + law.bias - law.integral;
  on = law.on;
end

function x = limited(x, limit)
  x = max(min(x, limit), -limit);
end
