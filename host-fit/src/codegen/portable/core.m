%:pick

function x = pick(condition, yes, no)
  if condition
    x = yes;
  else
    x = no;
  end
end
%:ago

% The value `samples` samples ago, with linear interpolation.
function x = ago(line, samples)
  samples = max(samples, 0);
  whole = floor(samples);
  x = line(1 + whole) + (samples - whole) * (line(2 + whole) - line(1 + whole));
end
