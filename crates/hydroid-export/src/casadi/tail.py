def _moved(pose, before, after):
    """The pose after a sample, on an arc with the means of the velocities in the outputs at its ends."""
    surge, sway, yaw = MOTION
    mean = 0.5 * (before + after)
    u, v, r = mean[surge], 0.0 if sway is None else mean[sway], mean[yaw]
    half = 0.5 * r * DT
    straight = ca.fabs(half) < 1e-6
    angle = ca.if_else(straight, 1.0, half)
    length = DT * ca.if_else(straight, 1.0, ca.sin(angle) / angle)
    sin, cos = ca.sin(pose[2] + half), ca.cos(pose[2] + half)
    return ca.vertcat(
        pose[0] + length * (u * cos - v * sin),
        pose[1] + length * (u * sin + v * cos),
        pose[2] + 2.0 * half,
    )


def _step_with_pose():
    symbols = ca.SX if step.is_a("SXFunction") else ca.MX
    x, c = symbols.sym("state", len(STATES) + 3), symbols.sym("command", len(INPUTS))
    state, pose = x[: len(STATES)], x[len(STATES) :]
    new = step(state, c)
    new = ca.vertcat(new, _moved(pose, output(state), output(new)))
    return ca.Function("step_with_pose", [x, c], [new], ["state", "command"], ["new_state"])


def _rates_with_pose():
    symbols = ca.SX if rates.is_a("SXFunction") else ca.MX
    x, c = symbols.sym("state", len(STATES) + 3), symbols.sym("command", len(INPUTS))
    state, psi = x[: len(STATES)], x[len(STATES) + 2]
    surge, sway, yaw = MOTION
    y = output(state)
    u, v, r = y[surge], 0.0 if sway is None else y[sway], y[yaw]
    sin, cos = ca.sin(psi), ca.cos(psi)
    result = ca.vertcat(rates(state, c), u * cos - v * sin, u * sin + v * cos, r)
    return ca.Function("rates_with_pose", [x, c], [result], ["state", "command"], ["rates"])


# Functions of the state followed by the pose; None where the model has no motion or no rates.
step_with_pose = _step_with_pose() if MOTION is not None else None
rates_with_pose = _rates_with_pose() if MOTION is not None and rates is not None else None


def _chosen(with_pose):
    """Step, rates and names of the state."""
    if not with_pose:
        return step, rates, STATE_IDS
    if MOTION is None:
        raise ValueError(f"the model has no pose: {NO_MOTION}; call without with_pose")
    return step_with_pose, rates_with_pose, STATE_IDS + POSE


def rollout(samples, with_pose=False):
    """The outputs of the next samples: a casadi.Function.

    Arguments: state (with the pose at its end, if with_pose) and commands, a column for each sample.
    Result: outputs, a column for each sample; with_pose, rows of x, y and psi follow.
    """
    if not isinstance(samples, int) or samples < 1:
        raise ValueError(f"samples is a whole number from 1 on, and not {samples!r}")
    names = _chosen(with_pose)[2]
    n, m = len(OUTPUTS), len(INPUTS)
    given = ca.MX.sym("state", len(names))
    commands = ca.MX.sym("commands", m, samples)
    state = given[: len(STATES)]
    if HORIZON is None:
        x, c = ca.MX.sym("x", len(STATES)), ca.MX.sym("c", m)
        new = step(x, c)
        outputs = ca.Function("sample", [x, c], [new, output(new)]).mapaccum(samples)(state, commands)[1]
    else:
        # The model predicts a whole horizon at once; at the end, the last command is held.
        blocks = -(-samples // HORIZON)
        held = ca.horzcat(commands, ca.repmat(commands[:, -1], 1, blocks * HORIZON - samples))
        x, ahead = ca.MX.sym("x", len(STATES)), ca.MX.sym("ahead", m * HORIZON)
        y = predict(x, ahead)
        block = ca.Function("block", [x, ahead], [follow(x, ahead, y), y]).mapaccum(blocks)
        outputs = block(state, ca.reshape(held, m * HORIZON, blocks))[1]
        outputs = ca.reshape(outputs, n, blocks * HORIZON)[:, :samples]
    if with_pose:
        pose, before, after = ca.MX.sym("pose", 3), ca.MX.sym("before", n), ca.MX.sym("after", n)
        arc = ca.Function("arc", [pose, before, after], [_moved(pose, before, after)]).mapaccum(samples)
        ends = ca.horzcat(output(state), outputs)
        outputs = ca.vertcat(outputs, arc(given[len(STATES) :], ends[:, :-1], ends[:, 1:]))
    return ca.Function("rollout", [given, commands], [outputs], ["state", "commands"], ["outputs"])


def jacobians(with_pose=False):
    """A and B of the step, dx+ = A dx + B dc around a state and a command: a casadi.Function of these."""
    law, _, names = _chosen(with_pose)
    x, c = ca.MX.sym("state", len(names)), ca.MX.sym("command", len(INPUTS))
    new = law(x, c)
    matrices = [ca.densify(ca.jacobian(new, of)) for of in (x, c)]
    return ca.Function("jacobians", [x, c], matrices, ["state", "command"], ["A", "B"])


def do_mpc_model(with_pose=False, discrete=False, setup=True):
    """The model as a do_mpc.model.Model: continuous where it has rates, else discrete with the sample time DT.

    States and inputs are named by STATE_IDS, POSE and INPUT_IDS; outputs are expressions, named by OUTPUT_IDS with
    'output_' in front. With discrete, it is discrete in any case. Without setup, the caller can add parameters, and
    calls model.setup().
    """
    import do_mpc

    law, continuous, names = _chosen(with_pose)
    kind = "discrete" if discrete or continuous is None else "continuous"
    law = law if kind == "discrete" else continuous
    model = do_mpc.model.Model(kind, "SX" if law.is_a("SXFunction") else "MX")
    x = ca.vertcat(*[model.set_variable("_x", name) for name in names])
    c = ca.vertcat(*[model.set_variable("_u", name) for name in INPUT_IDS])
    for name, value in zip(OUTPUT_IDS, ca.vertsplit(output(x[: len(STATES)]))):
        model.set_expression("output_" + name, value)
    for name, value in zip(names, ca.vertsplit(law(x, c))):
        model.set_rhs(name, value)
    if setup:
        model.setup()
    return model


def acados_model(with_pose=False):
    """The model as an acados_template.AcadosModel: disc_dyn_expr, and with rates f_expl_expr and f_impl_expr."""
    from acados_template import AcadosModel

    law, continuous, names = _chosen(with_pose)
    symbols = ca.SX if law.is_a("SXFunction") else ca.MX
    model = AcadosModel()
    model.name = NAME
    model.x, model.u = symbols.sym("x", len(names)), symbols.sym("u", len(INPUTS))
    model.disc_dyn_expr = law(model.x, model.u)
    if continuous is not None:
        model.xdot = symbols.sym("xdot", len(names))
        model.f_expl_expr = continuous(model.x, model.u)
        model.f_impl_expr = model.xdot - model.f_expl_expr
    return model
