"""What the learned methods of Tajiri and Iwamoto see, computed without tauscope: joint states from MCAP, the twin's effort
from MuJoCo, the momentum observer and the low-passes in numpy.

The twin's gains and offsets are given, so that both sides judge the same residual.
"""
import os
import struct
import sys

import numpy as np
from mcap.reader import make_reader

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "..", "proof"))
from robot import Robot  # noqa: E402

GAIN_PER_S, CUTOFF_HZ, VELOCITY_CUTOFF_HZ = 100., 4., 12.
SETTLED = np.log(np.sqrt(2) / .01) * np.sqrt(2) / (2 * np.pi)  # times 1/cutoff: a Butterworth step is within 1 %


def states(path, topic, joints):
    """Stamps [ns], position, velocity and effort (samples x joints) of a recording's joint states."""
    def message(data):
        at = 4 + 8
        length, = struct.unpack_from("<I", data, at)
        at += 4 + length

        def align(to):
            nonlocal at
            at += -(at - 4) % to

        align(4)
        count, = struct.unpack_from("<I", data, at)
        at += 4
        names = []
        for _ in range(count):
            align(4)
            length, = struct.unpack_from("<I", data, at)
            names.append(data[at + 4:at + 3 + length].decode())
            at += 4 + length
        arrays = []
        for _ in range(3):
            align(4)
            n, = struct.unpack_from("<I", data, at)
            at += 4
            if n:
                align(8)
            arrays.append(np.frombuffer(data, "<f8", n, at))
            at += 8 * n
        seconds, nanoseconds = struct.unpack_from("<iI", data, 4)
        order = [names.index(j) for j in joints]
        return seconds * 10**9 + nanoseconds, [a[order] for a in arrays]

    with open(path, "rb") as file:
        rows = [message(m.data) for _, _, m in make_reader(file).iter_messages(topics=[topic])]
    return np.array([r[0] for r in rows]), *(np.array([r[1][k] for r in rows]) for k in range(3))


def butterworth(t_s, x, cutoff_hz):
    """Second-order Butterworth low-pass, the continuous filter driven by straight lines between the samples; its output and
    the output's derivative."""
    w = 2 * np.pi * cutoff_hz
    a, lag = w / np.sqrt(2), np.sqrt(2) / w
    y, rate = np.empty_like(x), np.zeros_like(x)
    y[0] = x[0]
    for k in range(1, len(x)):
        dt = t_s[k] - t_s[k - 1]
        slope = (x[k] - x[k - 1]) / dt
        c, s = np.exp(-a * dt) * np.cos(a * dt), np.exp(-a * dt) * np.sin(a * dt)
        deviation, drift = y[k - 1] - (x[k - 1] - slope * lag), rate[k - 1] - slope
        y[k] = x[k] - slope * lag + (c + s) * deviation + s / a * drift
        rate[k] = slope + (c - s) * drift - 2 * a * s * deviation
    return y, rate


class Signals:
    """One recording: time since its first stamp [s], external torque, position, velocity and the velocity one sample before, all
    through the low-pass; `settled` where all filters are."""

    def __init__(self, robot, path, topic, gain, offset):
        stamps, q, v, effort = states(path, topic, robot.names)
        self.t_s = (stamps - stamps[0]) * 1e-9
        # The twin's acceleration is the derivative of its low-pass on the velocity.
        a = butterworth(self.t_s, v, VELOCITY_CUTOFF_HZ)[1]
        rigid = robot.nominal.rnea(q, v, a)
        excess = effort - (gain * rigid + offset)
        M = robot.nominal.inertias(q)
        torque = np.zeros_like(q)
        # r' = K (M (v' - a) - (effort - expected) - r), each step solved exactly for its mean input.
        for k in range(1, len(q)):
            dt = self.t_s[k] - self.t_s[k - 1]
            lasting = (v[k] - v[k - 1]) / dt
            inertial = .5 * (M[k] @ (lasting - a[k]) + M[k - 1] @ (lasting - a[k - 1]))
            mean = inertial - .5 * (excess[k] + excess[k - 1])
            torque[k] = torque[k - 1] - np.expm1(-GAIN_PER_S * dt) * (mean - torque[k - 1])
        self.torque, self.q, self.v = (butterworth(self.t_s, x, CUTOFF_HZ)[0] for x in (torque, q, v))
        self.before = np.vstack([self.v[:1], self.v[:-1]])
        self.settled = self.t_s >= SETTLED / VELOCITY_CUTOFF_HZ + SETTLED / CUTOFF_HZ

    def motion(self):
        """q(t), velocity(t), velocity(t-1): what the recurrent net sees."""
        return np.hstack([self.q, self.v, self.before])


def load(set_path, spec, twin):
    """Signals of all recordings of a set by name, in its order."""
    folder = os.path.dirname(set_path)
    robot = Robot(os.path.join(folder, spec["robot"]))
    gain, offset = (np.array([twin["joints"][j][k] for j in robot.names]) for k in ("gain", "offset"))
    return {os.path.splitext(os.path.basename(p))[0]: Signals(robot, os.path.join(folder, p), spec["topics"]["state"], gain, offset)
            for role in ("train", "validation", "test") for p in spec[role]}
