"""Motions of the arm and what an honest driver would record of them."""

from dataclasses import dataclass, replace

import numpy as np

from lib.arm import ARM, friction, inverse_dynamics, rotation

DURATION_S, RATE_HZ, STILL_S, RAMP_S = 12.0, 100.0, 1.5, 1.0
CENTRE_RAD = (0.2, -0.5, 0.6, 0.3, -0.4)
AMPLITUDE_RAD = (1.3, 0.6, 0.9, 1.1, 1.4)
POSITION_STEP_RAD, VELOCITY_NOISE_RADPS = 2e-5, 2e-3


@dataclass(frozen=True)
class Push:
    """A force [N] on a point of a link for a while."""

    begin_s: float
    end_s: float
    link: str
    point: tuple
    force: tuple


# A push on the middle of the forearm: the joints behind it feel nothing.
PUSH = Push(5.0, 5.6, "stick", (0.2, 0.0, 0.05), (4.0, 26.0, -22.0))


@dataclass(frozen=True)
class Rows:
    """Rows of a recording: time [s], position [rad], velocity [rad/s], effort [N m]."""

    t: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray

    def changed(self, **fields):
        return replace(self, **fields)

    def every(self, step, shift_s=0.0):
        return Rows(self.t[::step] + shift_s, self.q[::step], self.qd[::step], self.tau[::step])

    def __len__(self):
        return len(self.t)


def step(x):
    """A smooth step from 0 to 1 with its two derivatives."""
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x * x), 30 * x * x * (1 - x) ** 2, 60 * x * (1 - x) * (1 - 2 * x)


def motion(seed, duration=DURATION_S, rate=RATE_HZ, centre=CENTRE_RAD, amplitude=AMPLITUDE_RAD):
    """t, q, qd, qdd: sums of four sines that stand still at both ends."""
    draw = np.random.default_rng(seed)
    t = np.arange(int(round(duration * rate))) / rate
    up, down = step((t - STILL_S) / RAMP_S), step((duration - STILL_S - t) / RAMP_S)
    gate = up[0] * down[0]
    gate_1 = (up[1] * down[0] - up[0] * down[1]) / RAMP_S
    gate_2 = (up[2] * down[0] - 2 * up[1] * down[1] + up[0] * down[2]) / RAMP_S**2
    q, qd, qdd = (np.zeros((len(t), len(centre))) for _ in range(3))
    for k, (middle, size) in enumerate(zip(centre, amplitude)):
        omega = 2 * np.pi * draw.uniform(0.08, 0.45, 4)
        phase = draw.uniform(0, 2 * np.pi, 4)
        weight = draw.uniform(0.3, 1.0, 4)
        weight *= size / weight.sum()
        angles = np.outer(t, omega) + phase
        x, x_1, x_2 = np.sin(angles) @ weight, np.cos(angles) @ (weight * omega), -np.sin(angles) @ (weight * omega**2)
        q[:, k] = middle + gate * x
        qd[:, k] = gate_1 * x + gate * x_1
        qdd[:, k] = gate_2 * x + 2 * gate_1 * x_1 + gate * x_2
    return t, q, qd, qdd


def measured(seed, arm=ARM, push=None, **kwargs):
    """The rows of a sound recording, with a push if one is given."""
    t, q, qd, qdd = motion(seed, **kwargs)
    tau = inverse_dynamics(arm, q, qd, qdd) + friction(arm, qd)
    if push is not None:
        while_pushed = ((t >= push.begin_s) & (t < push.end_s))[:, None]
        tau = tau + while_pushed * push_torques(arm, q, push.link, push.point, push.force)
    draw = np.random.default_rng(1000 + seed)
    tau = tau + draw.normal(size=tau.shape) * np.array([j.noise_nm for j in arm.joints])
    q = np.round(q / POSITION_STEP_RAD) * POSITION_STEP_RAD
    return Rows(t, q, qd + draw.normal(size=qd.shape) * VELOCITY_NOISE_RADPS, tau)


def push_torques(arm, q, link, point, force):
    """Torques [N m] that the drives add against a force [N] on a point of a link, both in the frames of URDF.

    The force is given in the frame of the root, the point in the frame of the link. One row for each pose.
    """
    rows = len(q)
    turn, place = np.tile(np.eye(3), (rows, 1, 1)), np.zeros((rows, 3))
    origins, axes = [], []
    for k, j in enumerate(arm.joints):
        place = place + turn @ np.array(j.origin, float)
        turn = turn @ rotation(j.axis, q[:, k])
        origins.append(place)
        axes.append(turn @ np.array(j.axis, float))
        if j.link == link:
            break
    at = place + turn @ np.array(point, float)
    torques = np.zeros((rows, len(arm.joints)))
    for k, (origin, axis) in enumerate(zip(origins, axes)):
        torques[:, k] = -np.einsum("ni,ni->n", axis, np.cross(at - origin, force))
    return torques
