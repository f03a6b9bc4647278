

class @CLASS@:
    """A vehicle of the Python Vehicle Simulator; see the text of this module."""

    def __init__(self, controlSystem="stepInput", command=None, V_current=0.0, beta_current=0.0):
        if controlSystem != "stepInput":
            raise ValueError("controlSystem is 'stepInput': subclass this vehicle for a controller")
        neutral = [channel["neutral"] for channel in COMMANDS]
        self.command = np.array(neutral if command is None else command, float)
        if self.command.shape != (len(COMMANDS),):
            raise ValueError(f"command has {self.command.size} values, the vehicle {len(COMMANDS)} commands")
        self.name = NAME
        self.L, self.B = LENGTH, BEAM
        self.controlMode = controlSystem
        self.controlDescription = "Step of the commands"
        self.controls = [f"{channel['name']} ({channel['unit']})" for channel in COMMANDS]
        self.dimU = len(COMMANDS)
        self.V_c = V_current
        self.beta_c = math.radians(beta_current)
        self.nu = np.zeros(6)
        self.u_actual = np.array(neutral, float)
        self.positions = settled(neutral)

    def stepInput(self, t):
        """The command of the constructor."""
        return self.command.copy()

    def current(self, psi):
        """Velocity of the water in the body frame [m/s]."""
        angle = self.beta_c - psi
        return np.array([self.V_c * math.cos(angle), self.V_c * math.sin(angle), 0.0])

    def dynamics(self, eta, nu, u_actual, u_control, sampleTime):
        """The velocities after sampleTime seconds, and the commands. self.positions are those of the actuators."""
        nu, command = np.array(nu, float), np.array(u_control, float)
        motion = nu[[0, 1, 5]] - self.current(eta[5])
        steps = max(1, math.ceil(sampleTime / STEP - 1e-6))
        for _ in range(steps):
            motion, self.positions = advance(motion, self.positions, command, sampleTime / steps)
        # The heading as the simulator moves it, so that the velocity through the water is continuous.
        nu[[0, 1, 5]] = motion + self.current(eta[5] + sampleTime * motion[2])
        return nu, command
