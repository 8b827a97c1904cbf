"""What may be concealed: each effect's parameters, the torque it puts on a joint, and what it does to the record.

Signs: recorded effort = RNEA minus the torques that act on the joints.  sgn is tanh(v / 0.002).  Angles in rad, times in s.
The joint torques below take `math` or `numpy` as `m`, so that the plant and its closure use the same formula.
"""
import numpy as np

import off_list
import shop_floor

SMOOTHING = 0.002  # rad/s (m/s): half width of the sign function


def sgn(m, v):
    return m.tanh(v / SMOOTHING)


def _worn(p, m, q, v, **_):
    inside = (q >= p["q_from_rad"]) * (q <= p["q_to_rad"])
    return -p["coulomb_nm"] * inside * sgn(m, v)


def _bump(p, m, q, v, **_):
    return p["amplitude_nm"] * m.exp(-0.5 * ((q - p["centre_rad"]) / p["width_rad"])**2)


def _step(p, m, q, v, session, **_):
    after = session >= p["change_time_session_s"]
    return -(p["coulomb_before_nm"] + (p["coulomb_after_nm"] - p["coulomb_before_nm"]) * after) * sgn(m, v)


def _asymmetric(p, m, q, v, **_):
    s = sgn(m, v)
    return -p["coulomb_positive_nm"] * 0.5 * (s + abs(s)) - p["coulomb_negative_nm"] * 0.5 * (s - abs(s))


def _stribeck(p, m, q, v, **_):
    f, extra = p["coulomb_nm"], p["static_nm"] - p["coulomb_nm"]
    return -(f + extra * m.exp(-(v / p["stribeck_velocity_rad_s"])**2)) * sgn(m, v)


def _ripple(p, m, q, v, **_):
    out = p["amplitude_nm"] * m.sin(p["cycles_per_rev"] * q + p["phase_rad"])
    if "amplitude2_nm" in p:
        out = out + p["amplitude2_nm"] * m.sin(p["cycles_per_rev2"] * q + p["phase2_rad"])
    return out


# Torques that oppose velocity: solved implicitly at each step, for they are stiff.
FRICTION = {
    "viscous_friction": lambda p, m, q, v, **_: -p["viscous_nms_per_rad"] * v,
    "coulomb_friction": lambda p, m, q, v, **_: -p["coulomb_nm"] * sgn(m, v),
    "stribeck_friction": _stribeck,
    "asymmetric_coulomb": _asymmetric,
    "load_dependent_friction": lambda p, m, q, v, load, **_: -p["coefficient"] * abs(load) * sgn(m, v),
    "quadratic_drag": lambda p, m, q, v, **_: -p["drag_nms2_per_rad2"] * v * abs(v),
    "temperature_viscous": lambda p, m, q, v, t, **_: -(
        p["viscous_warm_nms_per_rad"] + p["viscous_extra_cold_nms_per_rad"] * m.exp(-t / p["time_constant_s"])) * v,
    "friction_step": _step,
    "unknown:worn_segment": _worn,
    "unknown:square_root_friction": lambda p, m, q, v, **_: -p["root_nm"] * m.sqrt(abs(v)) * sgn(m, v),
    # The other joint's load on a common bearing: friction here grows with the speed there.
    "unknown:cross_joint_friction": lambda p, m, q, v, other, **_: -p["coefficient_nms_per_rad"] * abs(other) * sgn(m, v),
    **off_list.FRICTION,
    **shop_floor.FRICTION,
}
# Torques of position or time alone.
FIELD = {
    "counterbalance_spring": lambda p, m, q, v, **_: -p["amplitude_nm"] * m.sin(q - p["rest_angle_rad"]),
    "cable_spring": lambda p, m, q, v, **_: -p["stiffness_nm_per_rad"] * (q - p["rest_angle_rad"]),
    "torque_ripple": _ripple,
    "unknown:torque_bump": _bump,
    "unknown:periodic_disturbance": lambda p, m, q, v, session, **_: p["amplitude_nm"] * m.sin(
        2 * np.pi * p["frequency_hz"] * session + p["phase_rad"]),
    **off_list.FIELD,
    **shop_floor.FIELD,
}
BODY = ("payload", "payload_pickup", "link_mass", "link_com", "base_tilt", "bodies_off")
TWO_MASS = ("joint_elasticity", "backlash")
WRENCH = ("external_push", "contact_wall")
# In the order in which they act on the record.
RECORD = (*shop_floor.RECORD, "transmission_coupling", "torque_gain", "torque_bias", "torque_lowpass", "torque_delay", "torque_saturation")


def formula(effect):
    """Key of the effect in FRICTION or FIELD."""
    return "unknown:" + effect["parameters"]["kind"] if effect["effect"] == "unknown" else effect["effect"]


def bristle(p, z, v, dt):
    """LuGre bristle one step later (implicit in z) and its torque."""
    k = p["bristle_stiffness_nm_per_rad"]
    new = (z + dt * v) / (1. + dt * k * abs(v) / p["coulomb_nm"])
    return new, -(k * new + p["bristle_damping_nms_per_rad"] * (new - z) / dt)


def active(effect, recording, t):
    """Is an effect with windows on at t seconds from the start of a recording?"""
    on = np.zeros(np.shape(t), bool)
    for w in effect["windows"]:
        if w["recording"] == recording:
            on |= (t >= w["t_start"]) & (t < (np.inf if w["t_end"] is None else w["t_end"]))
    return on


def changes(robot, effect):
    """Keyword arguments of robot.Model for an effect on the rigid bodies or the rotor."""
    from robot import Inertial
    p, name = effect["parameters"], effect["effect"]
    if name in ("payload", "payload_pickup"):
        load = Inertial(p["mass_kg"], np.array([p[f"com_{a}_m"] for a in "xyz"]), np.diag([p[f"i{a}{a}_kgm2"] for a in "xyz"]))
        return {"added": [(effect["link"], load)]}
    if name in ("link_mass", "link_com"):
        own = robot.links[effect["link"]].inertial
        com = own.com + np.array([p.get(f"delta_com_{a}_m", 0.) for a in "xyz"])
        return {"changed": {effect["link"]: Inertial(own.mass + p.get("delta_mass_kg", 0.), com, own.about_com)}}
    if name == "bodies_off":
        off = lambda own, by: Inertial(own.mass * by["mass"], own.com + np.array(by["com_m"]), own.about_com * by["inertia"])
        return {"changed": {link: off(robot.links[link].inertial, by) for link, by in p.items()}}
    if name == "base_tilt":
        return {"tilt": (p["roll_rad"], p["pitch_rad"])}
    if name == "rotor_inertia":
        return {"rotor": {robot.names.index(effect["joint"]): p["inertia_kgm2"]}}
    return {}


def merged(robot, effects):
    """The changes of several effects together."""
    out = {"added": [], "changed": {}, "rotor": {}, "tilt": (0., 0.)}
    for e in effects:
        for k, v in changes(robot, e).items():
            out[k] = out[k] + v if k == "added" else {**out[k], **v} if isinstance(v, dict) else v
    return out


def on_record(robot, effect, tau, dt, q, session):
    """The recorded torque (uniform samples x joints) after one effect on the record, along angles `q` and times of the session."""
    p, name, out = effect["parameters"], effect["effect"], tau.copy()
    if name in ("torque_lowpass", "torque_delay"):
        if name == "torque_delay":
            t = np.arange(len(tau)) * dt
            for j in range(tau.shape[1]):
                out[:, j] = np.interp(t - p["delay_s"], t, tau[:, j])
            return out
        c = 1. - np.exp(-2 * np.pi * p["cutoff_hz"] * dt)
        for k in range(1, len(tau)):
            out[k] = out[k - 1] + c * (tau[k] - out[k - 1])
        return out
    j = robot.names.index(effect["joint"])
    if name == "unknown":
        out[:, j] = shop_floor.recorded(p, tau[:, j], q[:, j], session, dt)
    elif name == "torque_gain":
        out[:, j] *= p["gain"]
    elif name == "torque_bias":
        out[:, j] += p["bias_nm"]
    elif name == "torque_saturation" and p["mode"] == "sensor":
        out[:, j] = np.clip(out[:, j], -p["limit_nm"], p["limit_nm"])
    elif name == "transmission_coupling":
        out[:, j] += p["coefficient"] * tau[:, robot.names.index(p["source_joint"])]
    return out
