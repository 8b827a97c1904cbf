"""Effects that the library of `explain` has no name for: their torques on a joint, and random shapes of them.

Every `amplitude_nm` is about the torque at usual speeds, loads and angles, so that one number scales each effect.
The torques take `math` or `numpy` as `m`, as in effects.py.
"""
import numpy as np

SMOOTHING = 0.002  # rad/s (m/s), as in effects.py


def _sgn(m, v):
    return m.tanh(v / SMOOTHING)


def _eccentric(p, m, q, v, **_):
    return -p["amplitude_nm"] * (1. + p["share"] * m.sin(q + p["phase_rad"])) * _sgn(m, v)


def _efficiency(p, m, q, v, load, **_):
    driven = 0.5 * (1. + m.tanh(load * v / p["power_w"]))      # 1 where the motor drives the load, 0 where the load drives it
    return -p["amplitude_nm"] * abs(load) / p["load_nm"] * (0.2 + 0.8 * driven) * _sgn(m, v)


def _thinning(p, m, q, v, **_):
    return -p["amplitude_nm"] * v / (abs(v) + p["speed_rad_s"])


def _heating(p, m, q, v, session, **_):
    return -p["amplitude_nm"] * (0.3 + session / p["time_s"]) * _sgn(m, v)


# Torques that oppose velocity.
FRICTION = {
    "unknown:eccentric_gear": _eccentric,
    "unknown:gear_efficiency": _efficiency,
    "unknown:load_squared_friction": lambda p, m, q, v, load, **_: -p["amplitude_nm"] * (load / p["load_nm"])**2 * _sgn(m, v),
    "unknown:thinning_grease": _thinning,
    "unknown:one_way_viscous": lambda p, m, q, v, **_: -p["amplitude_nm"] / p["speed_rad_s"] * v * (v * p["way"] > 0),
    "unknown:uneven_grease": lambda p, m, q, v, **_: -p["amplitude_nm"] / p["speed_rad_s"] * v * (1. + m.sin(2. * q + p["phase_rad"])),
    "unknown:heating_friction": _heating,
}
# Torques of position or time alone.
FIELD = {
    "unknown:hardening_spring": lambda p, m, q, v, **_: -p["amplitude_nm"] * ((q - p["rest_rad"]) / p["width_rad"])**3,
    "unknown:end_cushion": lambda p, m, q, v, **_: -p["amplitude_nm"] * (q - p["from_rad"]) * (q > p["from_rad"]) / p["width_rad"],
    "unknown:offset_drift": lambda p, m, q, v, session, **_: p["amplitude_nm"] * (session / p["time_s"] - 0.5),
    "unknown:offset_jump": lambda p, m, q, v, session, **_: p["amplitude_nm"] * (session >= p["time_s"]),
    "unknown:beat": lambda p, m, q, v, session, **_: p["amplitude_nm"] * m.sin(6.2832 * p["fast_hz"] * session) * m.sin(
        6.2832 * p["slow_hz"] * session),
}
KINDS = [key.partition(":")[2] for key in (*FRICTION, *FIELD)]


def shape(kind, c, rng, j):
    """(place, parameters as a function of the amplitude [N m]) of an effect on joint j; c: a draws.Context."""
    u = lambda a, b: float(rng.uniform(a, b))
    q = np.concatenate([m.q[:, j] for m in c.fit_motions])
    low, wide, speed = float(q.min()), float(np.ptp(q)), float(c.speed[j])
    load = max(float(c.rms[j]), 1e-3)
    session = max(m.session_start + m.t[-1] for m in c.motions)
    extra = {
        "eccentric_gear": {"share": u(0.6, 1.), "phase_rad": u(-3., 3.)},
        "gear_efficiency": {"load_nm": load, "power_w": 0.02 * load * speed},
        "load_squared_friction": {"load_nm": load},
        "thinning_grease": {"speed_rad_s": u(0.3, 1.) * speed},
        "one_way_viscous": {"speed_rad_s": speed, "way": float(rng.choice([-1., 1.]))},
        "uneven_grease": {"speed_rad_s": speed, "phase_rad": u(-3., 3.)},
        "heating_friction": {"time_s": session},
        "hardening_spring": {"rest_rad": low + u(0.3, 0.7) * wide, "width_rad": 0.5 * wide},
        "end_cushion": {"from_rad": low + u(0.5, 0.75) * wide, "width_rad": 0.3 * wide},
        "offset_drift": {"time_s": session},
        "offset_jump": {"time_s": u(0.3, 0.7) * session},
        "beat": {"fast_hz": u(0.6, 2.5), "slow_hz": u(0.08, 0.3)},
    }[kind]
    return {"joint": c.robot.names[j]}, lambda s: {"kind": kind, "amplitude_nm": s, **extra}
