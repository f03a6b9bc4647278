function [xdot, U] = @CLASS@(x, ui)
% [xdot, U] = @CLASS@(x, ui) returns the time derivative of the state x = [ u v r x y psi s ]' and the speed U [m/s] of
% @TITLE@
%
%  u, v   = surge and sway velocity through the water (m/s)
%  r      = yaw velocity (rad/s)
%  x, y   = position north and east (m)
%  psi    = heading (rad)
%  s      = lags of commands:
@POSITIONS@
%
% ui are the commands (unit, lowest and highest value, neutral value):
@COMMANDS@
%
% Written by hydroid @VERSION@.
lags = @LAGS@;
if numel(x) ~= 6 + numel(lags), error('x must have dimension %d', 6 + numel(lags)); end
if numel(ui) ~= @INPUTS@, error('ui must have dimension %d', @INPUTS@); end
x = x(:);
u = x(1); v = x(2); r = x(3);
c = ui; s = x(7:end);
nu_dot = [ ...
@ACCELERATIONS@
    ];
sdot = zeros(numel(lags), 1);
for k = 1:numel(lags)
    sdot(k) = (c(lags{k}.command) - s(k)) / lags{k}.time;
end
U = sqrt(u^2 + v^2);
xdot = [nu_dot; cos(x(6)) * u - sin(x(6)) * v; sin(x(6)) * u + cos(x(6)) * v; r; sdot];
end
