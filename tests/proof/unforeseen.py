"""Faults of arms that no list of this project names: what each does to the efforts or the positions of a recording.

Each fault is a function of an `Arm` in motion (see below), a joint and random numbers. It returns what it adds to the
efforts, for a size of 1, or changes a recording for good. Nothing here is shared with the laws of `explain`.
"""
import dataclasses

import numpy as np


@dataclasses.dataclass
class Moving:
    """An arm along one recording, at 1 kHz: samples x joints; `effort` is the true one so far."""
    robot: object
    t: np.ndarray
    session: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    effort: np.ndarray


def way(v):
    return np.tanh(v / 0.002)


def behind(x, seconds, dt=1e-3):
    """A first-order lag of a signal that was 0 before."""
    share, state, out = 1. - np.exp(-dt / seconds), 0., np.empty(len(x))
    for k, value in enumerate(x):
        state += share * (value - state)
        out[k] = state
    return out


def on_joint(m, j, x):
    out = np.zeros_like(m.effort)
    out[:, j] = x
    return out


def other(m, j):
    """The joint next to `j`, towards the tool if there is one."""
    return j + 1 if j + 1 < m.effort.shape[1] else j - 1


# Torques that a joint has to overcome.

def bearing_under_moment(m, j, p):
    """A bearing rubs more, the more the next joint's torque bends it."""
    k = other(m, j)
    return on_joint(m, j, np.abs(m.effort[:, k]) / p["load_nm"][k] * way(m.v[:, j]))


def gear_hums_at_a_speed(m, j, p):
    """A gear resonates, and loses power, in a band of speeds."""
    band = np.exp(-0.5 * ((np.abs(m.v[:, j]) - p["share"] * p["speed"][j]) / (0.15 * p["speed"][j]))**2)
    return on_joint(m, j, band * way(m.v[:, j]))


def hose_round_the_joint(m, j, p):
    """A hose wound round the joint grips the harder the further it is wound (a capstan)."""
    wound = (m.q[:, j] - p["middle"][j]) / (p["range"][j] + 1e-9)
    return on_joint(m, j, np.exp(2.5 * p["sign"] * wound) * way(m.v[:, j]))


def joints_rub_on_each_other(m, j, p):
    """Two joints of a wrist rub on each other: it is the difference of their speeds that counts."""
    return on_joint(m, j, np.tanh((m.v[:, j] - m.v[:, other(m, j)]) / 0.01))


def rubs_now_and_then(m, j, p):
    """A loose cover touches for a second or so, at no particular time."""
    bouts = np.sin(m.session * p["rate"]) + np.sin(m.session * p["rate"] * 1.618 + p["phase"]) > 0.5
    return on_joint(m, j, bouts * way(m.v[:, j]))


def grease_to_be_parted(m, j, p):
    """After a rest the joint has to part its grease again: friction that fades with the way gone."""
    gone, still, out = 1e9, 0., np.empty(len(m.t))
    for k, speed in enumerate(m.v[:, j]):
        still = still + 1e-3 if abs(speed) < 2e-3 else 0.
        gone = 0. if still > 0.1 else gone + abs(speed) * 1e-3
        out[k] = np.exp(-gone / 0.06)
    return on_joint(m, j, out * way(m.v[:, j]))


def dent_in_a_race(m, j, p):
    """A ball drops into a dent of its race and has to be pulled out."""
    x = (m.q[:, j] - p["place"][j]) / 0.05
    return on_joint(m, j, 1.6 * x * np.exp(-0.5 * x * x))


def dress_pack_pulls(m, j, p):
    """A dress pack between the base and the tool pulls once it is taut."""
    place, jac = m.robot.nominal.frames(m.q[::10], m.robot.moving_links[-1])
    away = place - p["anchor_m"]
    length = np.linalg.norm(away, axis=1)
    pull = np.maximum(length - p["slack_m"], 0.)
    torque = np.einsum("kij,ki->kj", jac, away / length[:, None] * pull[:, None])
    return np.stack([np.interp(m.t, m.t[::10], x) for x in torque.T], 1)


def sail_at_the_tool(m, j, p):
    """A large plate at the tool meets the air: a force against the tool's speed, with its square."""
    _, jac = m.robot.nominal.frames(m.q[::10], m.robot.moving_links[-1])
    speed = np.einsum("kij,kj->ki", jac, m.v[::10])
    force = speed * np.linalg.norm(speed, axis=1)[:, None]
    torque = np.einsum("kij,ki->kj", jac, force)
    return np.stack([np.interp(m.t, m.t[::10], x) for x in torque.T], 1)


# What is recorded of an effort.

def field_weakening(m, j, p):
    """The torque that is told by the current is less at speed."""
    return on_joint(m, j, -m.effort[:, j] / p["load_nm"][j] * (m.v[:, j] / p["speed"][j])**2)


def friction_is_compensated(m, j, p):
    """The controller tells the torque less the friction that it believes in, which is more than there is."""
    return on_joint(m, j, -np.tanh(m.v[:, j] / 0.05))


def offset_by_heat(m, j, p):
    """A sensor's zero follows the heat of its motor."""
    return on_joint(m, j, behind((m.effort[:, j] / p["load_nm"][j])**2, 3.))


def effort_comes_in_steps(m, j, p):
    """A converter has lost its lower bits."""
    step = 3.5
    return lambda size: on_joint(m, j, np.floor(m.effort[:, j] / (step * size)) * step * size - m.effort[:, j])


def effort_cannot_follow(m, j, p):
    """The told effort changes no faster than so much a second."""
    def change(size):
        most, now, out = 1e-3 * p["rate_nm_per_s"][j] / max(size / p["load_nm"][j], 1e-3), m.effort[0, j], np.empty(len(m.t))
        for k, x in enumerate(m.effort[:, j]):
            now += min(max(x - now, -most), most)
            out[k] = now
        return on_joint(m, j, out - m.effort[:, j])
    return change


def effort_without_sign(m, j, p):
    """The drive tells the magnitude of the current."""
    return lambda size: on_joint(m, j, np.abs(m.effort[:, j]) - m.effort[:, j])


def contact_is_lost(m, j, p):
    """A loose connector: for moments the effort is told as zero."""
    gone = np.zeros(len(m.t), bool)
    for at in p["moments"]:
        gone |= (m.t >= at * m.t[-1]) & (m.t < at * m.t[-1] + 0.04)
    return lambda size: on_joint(m, j, -m.effort[:, j] * gone)


# What is recorded of a position: what it adds to the angle [rad], and how large at a size of 1.

def encoder_slips(m, j, p):
    """The encoder's disc turns on its shaft at some time of the session."""
    return 0.03 * p["sign"] * (m.session > p["when_s"])


def gear_ratio_wrong(m, j, p):
    """The drive was told another gear ratio."""
    return 0.025 * p["sign"] * m.q[:, j]


def position_late(m, j, p):
    """One joint's position comes later than those of the others."""
    return np.interp(m.t - 0.03, m.t, m.q[:, j]) - m.q[:, j]


TORQUE = [bearing_under_moment, gear_hums_at_a_speed, hose_round_the_joint, joints_rub_on_each_other, rubs_now_and_then,
          grease_to_be_parted, dent_in_a_race, dress_pack_pulls, sail_at_the_tool]
TOLD = [field_weakening, friction_is_compensated, offset_by_heat, effort_comes_in_steps, effort_cannot_follow,
        effort_without_sign, contact_is_lost]
POSITION = [encoder_slips, gear_ratio_wrong, position_late]
OF_ARM = {"dress_pack_pulls", "sail_at_the_tool"}            # these have no joint of their own
# What a name of the list says as well, at the joint: it counts as found.
NEAREST = {"hose_round_the_joint": {"eccentric_gear"}, "field_weakening": {"torque_gain"}, "position_late": {"torque_delay"},
           "effort_without_sign": {"effort_sign"}, "dress_pack_pulls": {"contact_wall", "cable_spring", "counterbalance_spring"},
           "sail_at_the_tool": {"quadratic_drag", "viscous_friction"}, "bearing_under_moment": {"load_dependent_friction"},
           "gear_hums_at_a_speed": {"stribeck_friction"}, "effort_cannot_follow": {"torque_lowpass", "torque_delay"},
           "dent_in_a_race": {"torque_ripple"}, "encoder_slips": {"joint_zero_offset"}}
FAULTS = {f.__name__: f for f in (*TORQUE, *TOLD, *POSITION)}


def draw(session_s, robot, q, v, effort, rng):
    """The random numbers of a fault, and what it must know of the arm's usual motion."""
    low, wide = q.min(0), np.ptp(q, axis=0)
    place, _ = robot.nominal.frames(q[::50], robot.moving_links[-1])
    anchor = place.mean(0) + rng.normal(size=3) * 0.3
    return {"load_nm": np.sqrt((effort**2).mean(0)) + 1e-3, "speed": np.sqrt((v**2).mean(0)) * 2. + 1e-3, "range": wide,
            "middle": low + 0.5 * wide, "place": low + rng.uniform(0.3, 0.7, q.shape[1]) * wide, "share": float(rng.uniform(0.35, 0.7)),
            "sign": float(rng.choice([-1., 1.])), "rate": float(rng.uniform(1.5, 3.)), "phase": float(rng.uniform(0., 6.)),
            "anchor_m": anchor, "slack_m": float(np.quantile(np.linalg.norm(place - anchor, axis=1), 0.4)),
            "moments": rng.uniform(0.1, 0.9, 4).tolist(), "when_s": float(rng.uniform(0.3, 0.6) * session_s),
            "rate_nm_per_s": np.abs(np.gradient(effort, 1e-3, axis=0)).mean(0)}
