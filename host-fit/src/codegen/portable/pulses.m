
function law = law_at_rest()
  law.at = 0;
  law.on = false;
  law.since = inf;
end

function [on, law] = law_step(law, ~, ~)
  c = constants();
  wanted = any(mod(law.at - c.LAW_FIRST, c.LAW_PERIOD) < c.LAW_LENGTH);
  law.at = mod(law.at + 1, c.LAW_PERIOD);
  if law.on
    may_switch = law.since >= c.LAW_HOLD_ON;
  else
    may_switch = law.since >= c.LAW_HOLD_OFF;
  end
  if wanted ~= law.on && may_switch
    law.on = wanted;
    law.since = 1;
  else
    law.since = law.since + 1;
  end
  on = law.on;
end
