function [xdot, U] = @CLASS@(x, ui, h)
% [xdot, U] = @CLASS@(x, ui) returns the time derivative of the state x = [ u v r x y psi a ]' and the speed U [m/s] of
% @TITLE@
%
%  u, v   = surge and sway velocity through the water (m/s)
%  r      = yaw velocity (rad/s)
%  x, y   = position north and east (m)
%  psi    = heading (rad)
%  a      = positions of the actuators:
@POSITIONS@
%
% ui are the commands (unit, lowest and highest value, neutral value):
@COMMANDS@
%
% [xdot, U] = @CLASS@(x, ui, h) is for integration in steps of h seconds: an actuator without a lag reaches its order within a
% step, in place of a switch between its rates.
%
% Equations: M dnu/dt + C(nu) nu + D(nu) nu = sum of thrusters + sum of rudders (T. I. Fossen, Handbook of Marine Craft
% Hydrodynamics and Motion Control, 2021, chapter 6; rudders: MMG standard method, Yasukawa and Yoshimura 2015).
% Written by hydroid @VERSION@.
if nargin < 3, h = 0; end
p = parameters();
if numel(x) ~= 6 + numel(p.moving), error('x must have dimension %d', 6 + numel(p.moving)); end
if numel(ui) ~= p.inputs, error('ui must have dimension %d', p.inputs); end
x = x(:);
positions = zeros(numel(p.servos), 1);
for k = 1:numel(p.servos)
    positions(k) = order_of(p.servos{k}, ui);
end
adot = zeros(numel(p.moving), 1);
for k = 1:numel(p.moving)
    servo = p.servos{p.moving(k)};
    adot(k) = servo_rate(servo, positions(p.moving(k)) - x(6 + k), h);
    positions(p.moving(k)) = x(6 + k);
end
U = sqrt(x(1)^2 + x(2)^2);
eta_dot = [cos(x(6)) * x(1) - sin(x(6)) * x(2); sin(x(6)) * x(1) + cos(x(6)) * x(2); x(3)];
xdot = [acceleration(p, x(1:3), positions); eta_dot; adot];
end

function p = parameters()
persistent kept
if isempty(kept)
    kept = struct();
    kept.inputs = @INPUTS@;
    kept.rho = @DENSITY@;
    kept.len = @LENGTH@;
    % m11 m22 m23 m33, and m22 - m11 or 0 without the Munk moment
    kept.mass = @MASS@;
    kept.munk = @MUNK@;
    % Rows X Y N, columns u v r: entry (i, j) resists with linear nu_j + quadratic |nu_j| nu_j
    kept.linear = @LINEAR@;
    kept.quadratic = @QUADRATIC@;
    % Rows Y N, columns v r: entry (i, j) resists with |u| nu_j
    kept.lift = @LIFT@;
    % 1/2 rho T C_d
    kept.cross_flow = @CROSS_FLOW@;
    % Mass matrix while flying, factor of the damping, transition speed, slope
    kept.flying = @FLYING@;
    kept.moving = @MOVING@;
    kept.servos = @SERVOS@;
    kept.thrusters = @THRUSTERS@;
    kept.rudders = @RUDDERS@;
    kept.helms = @HELMS@;
end
p = kept;
end

function a = order_of(servo, ui)
a = 0;
for k = 1:numel(servo.gain)
    a = a + servo.gain(k) * (ui(servo.commands(k)) - servo.neutral(k));
end
a = min(max(a, servo.low), servo.high);
end

function rate = servo_rate(servo, distance, h)
if servo.lag > 0
    rate = distance / servo.lag;
elseif h > 0
    rate = distance / h;
else
    rate = servo.rate * sign(distance);
end
rate = min(max(rate, -servo.rate), servo.rate);
end

function nu_dot = acceleration(p, nu, positions)
u = nu(1); v = nu(2); r = nu(3);
m = p.mass;
coriolis = [-(m(2) * v + m(3) * r) * r; m(1) * u * r; p.munk * u * v + m(3) * u * r];
driving = actuators(p, nu, positions) - coriolis;
drag = damping(p, nu);
nu_dot = mass_matrix(m) \ (driving - drag);
if ~isempty(p.flying)
    f = p.flying;
    flying = mass_matrix(f.mass) \ (driving - f.drag_factor * drag);
    weight = 0.5 * (1 + tanh(0.5 * f.slope * (u - f.transition_speed)));
    nu_dot = weight * flying + (1 - weight) * nu_dot;
end
end

function M = mass_matrix(m)
M = [m(1) 0 0; 0 m(2) m(3); 0 m(3) m(4)];
end

function force = damping(p, nu)
force = p.linear * nu + p.quadratic * (abs(nu) .* nu);
force(2:3) = force(2:3) + abs(nu(1)) * (p.lift * nu(2:3));
if p.cross_flow > 0 && p.len > 0
    force(2:3) = force(2:3) + p.cross_flow * cross_flow(p.len / 2, nu(2), nu(3));
end
end

function integrals = cross_flow(half, v, r)
% Integrals of |w| w and x |w| w over the hull, w = v + x r
if abs(v) >= abs(r) * half
    cubed = 2 * half^3 / 3;
    side = 1;
    if v < 0, side = -1; end
    integrals = side * [v^2 * 2 * half + r^2 * cubed; v * r * 2 * cubed];
else
    fore = v + r * half; aft = v - r * half;
    cubes = [fore^2 * abs(fore), aft^2 * abs(aft)];
    force = (cubes(1) - cubes(2)) / (3 * r);
    fourth = (cubes(1) * fore - cubes(2) * aft) / (4 * r^2);
    integrals = [force; fourth - v * force / r];
end
end

function tau = actuators(p, nu, positions)
u = nu(1); v = nu(2); r = nu(3);
tau = zeros(3, 1);
thrusts = zeros(numel(p.thrusters), 3);
for k = 1:numel(p.thrusters)
    t = p.thrusters{k};
    angle = t.angle;
    if t.steering > 0, angle = angle + positions(t.steering); end
    px = t.position(1); py = t.position(2);
    along = (u - py * r) * cos(angle) + (v + px * r) * sin(angle);
    thrust = thrust_of(t, positions(t.servo), along);
    thrusts(k, :) = [thrust, along, t.diameter];
    tau = tau + thrust * [cos(angle); sin(angle); px * sin(angle) - py * cos(angle)];
end
for k = 1:numel(p.rudders)
    d = p.rudders{k};
    px = d.position(1); py = d.position(2);
    angle = positions(d.servo);
    inflow = (u - py * r) * (1 - d.wake);
    if d.thruster > 0
        race = thrusts(d.thruster, :);
        if race(1) > 0
            disc = 0.25 * pi * race(3)^2;
            behind = sqrt(race(2)^2 + race(1) / (0.5 * p.rho * disc));
            inflow = inflow + d.race * (behind - abs(race(2)));
        end
    end
    across = (v + px * r) * d.straightening;
    normal = 0.5 * p.rho * d.area * d.lift_slope * sqrt(inflow^2 + across^2) ...
        * (inflow * sin(angle) + across * cos(angle));
    along = -normal * (1 - d.drag_deduction) * sin(angle);
    aside = -normal * cos(angle);
    tau = tau + [along; aside * (1 + d.hull_force); aside * (px + d.hull_force * d.hull_position) - py * along];
end
for k = 1:numel(p.helms)
    angle = positions(p.helms{k}.servo);
    if p.helms{k}.sine, angle = sin(angle); end
    tau(3) = tau(3) + p.helms{k}.gain * u * angle;
end
end

function thrust = thrust_of(t, position, along)
n = abs(position) - t.dead_band;
if n <= 0
    thrust = 0;
    return
end
gain = t.forward;
if position <= 0, gain = -t.reverse; end
if t.quadratic
    thrust = gain * n^2 - t.speed_loss * n * along;
else
    thrust = gain * n - t.speed_loss * n * along;
end
end
