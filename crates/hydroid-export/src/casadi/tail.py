

def rollout(samples):
    """A casadi.Function of the state and the commands of the next samples (a column for each) to the outputs (a column for
    each). A model that predicts a horizon at once holds the last command at the end of a horizon that is not whole."""
    state = ca.MX.sym("state", len(STATES))
    commands = ca.MX.sym("commands", len(INPUTS), samples)
    if predict is None:
        states = step.mapaccum(samples)(state, commands)
        outputs = output.map(samples)(states)
    else:
        blocks, x = [], state
        for first in range(0, samples, HORIZON):
            ahead = commands[:, first : min(first + HORIZON, samples)]
            ahead = ca.horzcat(ahead, ca.repmat(ahead[:, -1], 1, HORIZON - ahead.shape[1]))
            y = predict(x, ca.vec(ahead))
            x = follow(x, ca.vec(ahead), y)
            blocks.append(ca.reshape(y, len(OUTPUTS), HORIZON))
        outputs = ca.horzcat(*blocks)[:, :samples]
    return ca.Function("rollout", [state, commands], [outputs], ["state", "commands"], ["outputs"])


def jacobians(function=None):
    """A casadi.Function of state and command to the matrices A and B, the derivatives of `step`, or of `rates`."""
    function = step if function is None else function
    state, command = ca.MX.sym("state", len(STATES)), ca.MX.sym("command", len(INPUTS))
    result = function(state, command)
    matrices = [ca.jacobian(result, state), ca.jacobian(result, command)]
    return ca.Function("jacobians", [state, command], matrices, ["state", "command"], ["A", "B"])


def _motion(y):
    """Surge, sway and yaw rate of outputs; a model without sway does not drift."""
    u, v, r = MOTION
    if u is None or r is None:
        raise ValueError("a pose needs a model with the outputs u and r")
    return y[u], 0.0 if v is None else y[v], y[r]


def move(pose, before, after):
    """The pose [x, y, psi] (north, east [m], clockwise from north [rad]) a sample later, on an arc with the mean of the body
    velocities in the outputs at its ends."""
    u, v, r = [0.5 * (a + b) for a, b in zip(_motion(before), _motion(after))]
    half = 0.5 * r * DT
    small = ca.fabs(half) < 1e-6
    length = DT * ca.if_else(small, 1.0, ca.sin(half) / ca.if_else(small, 1.0, half))
    sin, cos = ca.sin(pose[2] + half), ca.cos(pose[2] + half)
    return pose + ca.vertcat(length * (u * cos - v * sin), length * (u * sin + v * cos), 2.0 * half)


def step_with_pose():
    """As `step`, for the state [pose, state]."""
    state, command = ca.MX.sym("state", 3 + len(STATES)), ca.MX.sym("command", len(INPUTS))
    x = step(state[3:], command)
    pose = move(state[:3], output(state[3:]), output(x))
    return ca.Function("step_with_pose", [state, command], [ca.vertcat(pose, x)], ["state", "command"], ["next"])


def rates_with_pose():
    """As `rates`, for the state [pose, state]."""
    if rates is None:
        raise ValueError("a model in discrete time has no rates")
    state, command = ca.MX.sym("state", 3 + len(STATES)), ca.MX.sym("command", len(INPUTS))
    u, v, r = _motion(output(state[3:]))
    sin, cos = ca.sin(state[2]), ca.cos(state[2])
    pose = ca.vertcat(u * cos - v * sin, u * sin + v * cos, r)
    result = ca.vertcat(pose, rates(state[3:], command))
    return ca.Function("rates_with_pose", [state, command], [result], ["state", "command"], ["rates"])


def do_mpc_model(with_pose=False):
    """The model for do-mpc, in discrete time: states `state` (and `pose`), inputs `command`, expression `outputs`."""
    import do_mpc

    model = do_mpc.model.Model("discrete", "MX")
    pose = model.set_variable("_x", "pose", shape=(3, 1)) if with_pose else None
    state = model.set_variable("_x", "state", shape=(len(STATES), 1))
    command = model.set_variable("_u", "command", shape=(len(INPUTS), 1))
    x = step(state, command)
    model.set_rhs("state", x)
    if with_pose:
        model.set_rhs("pose", move(pose, output(state), output(x)))
    model.set_expression("outputs", output(state))
    model.setup()
    return model


def acados_model(with_pose=False):
    """The model for acados: discrete dynamics, and continuous ones if the model has rates."""
    from acados_template import AcadosModel

    model = AcadosModel()
    size = len(STATES) + (3 if with_pose else 0)
    model.name = NAME
    model.x, model.u = ca.MX.sym("x", size), ca.MX.sym("u", len(INPUTS))
    model.disc_dyn_expr = (step_with_pose() if with_pose else step)(model.x, model.u)
    if rates is not None:
        model.xdot = ca.MX.sym("xdot", size)
        model.f_expl_expr = (rates_with_pose() if with_pose else rates)(model.x, model.u)
        model.f_impl_expr = model.xdot - model.f_expl_expr
    return model
