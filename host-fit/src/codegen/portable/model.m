% An identified model.
%   y = @name@(u) is a free run for the commands u, starting at rest.
%   [y, s] = @name@(u, s, channels) continues from the state s ([] for rest); channels has one column per channel.
%   s = @name@('hold', u, y) is the state after a long time with constant command u and reading y.
@if law
%   [on, law] = @name@('law', reading, law) returns the valve's position until the next sample; law is [] at the first call.
@end
%
@header@
function [y, s] = @name@(u, s, channels, more)
  usual = @usual@; % usual values of the channels, in this order: @channel_names@
  if nargin < 2, s = []; end
  if nargin < 3, channels = []; end
  if ischar(u) && strcmp(u, 'hold')
    if nargin < 4, more = usual; end
    y = hold(s, channels, more);
    s = y;
    return
  end
  @if law
  if ischar(u) && strcmp(u, 'law')
    if isempty(channels), channels = law_at_rest(); end
    if nargin < 4, more = usual; end
    [y, s] = law_step(channels, s, more);
    return
  end
  @end
  if isempty(s), s = at_rest(); end
  if isempty(channels), channels = repmat(usual, numel(u), 1); end
  y = zeros(size(u));
  for k = 1:numel(u)
    [y(k), ~, following, ~, s] = observe(s, @jet_k@, channels(k, :), true);
    s = advance(s, following);
  end
end

function s = hold(u, y, channels)
  s = at_rest();
  for k = 1:@held@
    s = advance(s, y - (@zero@));
    [~, ~, ~, ~, s] = observe(s, @jet@, channels, true);
  end
  s = advance(s, y - (@zero@));
end

% All signals are 0 before the first sample; element 1 of each memory is the newest.
function s = at_rest()
  s.y = zeros(@outputs@, 1);
  s.jets = zeros(@jets@, 1);
  @if average
  s.sum = 0; s.fresh = 0; s.in_block = 0;
  @end
  @if clocked
  s.lived = 0; s.since_edge = 2 ^ 24; s.last_command = 0;
  @end
  @memories@
end

% Computes one sample without advancing the flow.
function [reading, now, following, nearest, s] = observe(s, u, channels, sensed)
  PERIOD = @period@; % s
  @cards@
  @derived@
  now = s.y(1);
  @if clocked
  s.lived = s.lived + 1;
  if u ~= s.last_command
    s.since_edge = 0;
  else
    s.since_edge = min(s.since_edge + 1, 2 ^ 24);
  end
  s.last_command = u;
  @end
  jet = u;
  @command@
  @jet_effects@
  s.jets = [jet; s.jets(1:end-1)];
  @if transport
  @delay@
  nearest = inf;
  @for inputs
  exact = max(@factor@ * delay, 0);
  @if rounded
  whole = min(round(exact), @oldest@);
  @if averaged
  jet@l@ = sum(s.jets(1 + whole:@window@ + whole)) / @window@;
  @else
  jet@l@ = s.jets(1 + whole);
  @end
  @if first
  present = jet0;
  @end
  @else
  whole = min(floor(exact), @oldest@);
  fraction = exact - floor(exact);
  @if averaged
  newer = sum(s.jets(1 + whole:@window@ + whole)) / @window@;
  older = sum(s.jets(1 + (whole + 1):@window@ + (whole + 1))) / @window@;
  @else
  newer = s.jets(1 + whole);
  older = s.jets(1 + (whole + 1));
  @end
  @if first
  present = newer;
  if fraction ~= 0, present = older; end
  @end
  jet@l@ = newer + fraction * (older - newer);
  @end
  nearest = min(nearest, whole);
  @end
  arrived = jet0;
  @else
  @for inputs
  @if averaged
  jet@l@ = sum(s.jets(1 + @lag@:@window@ + @lag@)) / @window@;
  @else
  jet@l@ = s.jets(1 + @lag@);
  @end
  @end
  arrived = jet0;
  present = jet0;
  nearest = @nearest@;
  @end
  reading = now;
  @if senses
  if sensed
    @sensor_effects@
  end
  @end
  @if rates
  RATE_OFF = @rate_off@; RATE_ON = @rate_on@; % relaxation rates of the separated and the attached flow, 1/sample
  share = @share@;
  @end
  @if graded
  % Rate and final level of the flow lie between those of separated and attached flow.
  free = @constant@ + @free@;
  past = @past@;
  following = free + past;
  if arrived ~= 0
    gain = @gain@;
    past_gain = @past_gain@;
    separated = 0;
    if past ~= 0, separated = (1 - arrived) * past / RATE_OFF; end
    attached = arrived * (@drive@ + past + past_gain) / RATE_ON;
    following = free + gain * share + (RATE_OFF + (RATE_ON - RATE_OFF) * share) * (separated + attached);
  end
  @else
  free = @constant@ + @free@;
  following = free;
  @for inputs
  if jet@l@ ~= 0
    following = following + jet@l@ * (@drive@ + @gain@);
  end
  @end
  @end
  @if drives
  % Effects of the flow: each uses the motion with the preceding effects.
  relaxation = RATE_OFF + (RATE_ON - RATE_OFF) * share;
  separated = 1 - share;
  if share ~= 0 && share ~= 1 && relaxation ~= 0
    separated = (1 - share) * RATE_OFF / relaxation;
  end
  motion = separated * (following - now);
  @if proportional
  if arrived ~= 0 && arrived ~= 1
    motion = (1 - arrived) * (free - now);
  end
  @end
  added = 0;
  @for flow_effects
  next_y = following + added;
  released = motion + separated * added;
  @effect@
  @end
  following = following + added;
  @end
end

% Stores `flow` as the newest flow state.
function s = advance(s, flow)
  @if average
  % The sum of every block is computed anew, so it does not drift.
  s.fresh = s.fresh + s.y(1);
  s.in_block = s.in_block + 1;
  if s.in_block >= @block@
    s.sum = s.fresh; s.fresh = 0; s.in_block = 0;
  else
    s.sum = s.sum + (s.y(1) - s.y(@window@));
  end
  @end
  s.y = [flow; s.y(1:end-1)];
end
@if law

% The law; times in samples.
function c = constants()
  @law_constants@
  @if maximise
  c.LAW_PERIOD = @law_period@;
  c.LAW_FIRST = @law_first@;
  c.LAW_LENGTH = @law_length@;
  c.LAW_HOLD_ON = @law_on@;
  c.LAW_HOLD_OFF = @law_off@;
  @end
end
@end
