"""What each concealed effect adds to the recorded effort, computed from the true motion and apart from the plant.

`contributions` serves three ends: to choose magnitudes on the commanded motion before anything is simulated, to check that the
plant's record closes (rigid body + contributions = recorded effort), and to state how visible an effect is.
"""
import dataclasses

import numpy as np

import shop_floor
from effects import BODY, FIELD, FRICTION, RECORD, TWO_MASS, active, bristle, formula, merged, on_record
from robot import Model

CUT = 0.25        # s left out at both ends of a hold-out recording
BAND_HZ = 8.      # of the derivatives estimated from the encoder


@dataclasses.dataclass
class Motion:
    """Uniform samples of one recording; `link` is (q, v, a) beyond an elastic or loose joint, or where an encoder errs; `since`
    the time since the command last began to move; `lost` the torque that the drives did not deliver."""
    recording: str
    session_start: float
    dt: float
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    link: tuple | None = None
    since: np.ndarray | None = None
    lost: np.ndarray | None = None


def of_command(recording, session_start, q, stride=20):
    """The commanded motion as if it were followed exactly."""
    from motion import RATE, derivatives
    v, a = derivatives(q)
    s = slice(None, None, stride)
    since = shop_floor.since_start(q, 1. / RATE)[s]
    return Motion(recording, session_start, stride / RATE, np.arange(len(q))[s] / RATE, q[s], v[s], a[s], since=since)


def of_log(recording, session_start, log):
    return Motion(recording, session_start, 1e-3, log.t, log.q, log.v, log.a, (log.q_link, log.v_link, log.a_link),
                  shop_floor.since_start(log.command, 1e-3), log.lost)


def wrench(robot, effect, motion, link):
    p = effect["parameters"]
    if effect["effect"] == "external_push":
        _, J = robot.nominal.frames(link[0], effect["link"])
        force = np.array([p["force_x_n"], p["force_y_n"], p["force_z_n"]])
        return -np.einsum("kij,i->kj", J, force) * active(effect, motion.recording, motion.t)[:, None]
    P, J = robot.nominal.frames(link[0], robot.moving_links[-1])
    normal = np.array([p["normal_x"], p["normal_y"], p["normal_z"]])
    depth = np.maximum(P @ normal - p["offset_m"], 0.)
    return p["stiffness_n_per_m"] * depth[:, None] * np.einsum("kij,i->kj", J, normal)


def misread(robot, effects, motion):
    """(q, v, a) of joints whose encoders read `motion`: to first order in the encoders' errors."""
    q, v, a = motion.q.copy(), motion.v.copy(), motion.a.copy()
    for e in effects:
        if formula(e) == shop_floor.ENCODER:
            j = robot.names.index(e["joint"])
            back = e["parameters"] | {"amplitude_rad": -e["parameters"]["amplitude_rad"]}
            q[:, j], v[:, j], a[:, j] = shop_floor.read(back, q[:, j], v[:, j], a[:, j])
    return q, v, a


def contributions(robot, effects, motion, rigid=None):
    """(rigid-body torque of the nominal robot, one array per effect), samples x joints, N m at the joint; their sum is the
    recorded effort without noise."""
    link = motion.link or misread(robot, effects, motion)
    if rigid is None:
        rigid = robot.nominal.rnea(motion.q, motion.v, motion.a)
    parts, total, so_far = {}, rigid.copy(), []
    encoders = [k for k, e in enumerate(effects) if formula(e) == shop_floor.ENCODER]
    twisted = encoders or any(e["effect"] in TWO_MASS for e in effects)
    nominal = robot.nominal.rnea(*link) if twisted else rigid
    carried = nominal
    for k, e in enumerate(effects):
        if k in encoders:
            parts[k] = (nominal - rigid) / len(encoders)
        elif e["effect"] in TWO_MASS:
            j = robot.names.index(e["joint"])
            parts[k] = nominal - rigid
            parts[k][:, j] += e["parameters"]["rotor_inertia_kgm2"] * motion.a[:, j]
        elif e["effect"] in BODY:
            heavier = Model(robot, **merged(robot, [*so_far, e])).rnea(*link)
            if e["effect"] == "payload_pickup":
                parts[k] = (heavier - carried) * active(e, motion.recording, motion.t)[:, None]
                carried = carried + parts[k]
            else:
                so_far.append(e)
                parts[k], carried = heavier - carried, heavier
    for k, e in enumerate(effects):
        if k in parts or formula(e) in (*RECORD, shop_floor.DRIVE):
            continue
        if e["effect"] in ("external_push", "contact_wall"):
            parts[k] = wrench(robot, e, motion, link)
            continue
        j, p, torque = robot.names.index(e["joint"]), e["parameters"], np.zeros_like(rigid)
        q, v = link[0][:, j], link[1][:, j]
        if e["effect"] == "rotor_inertia":
            torque[:, j] = p["inertia_kgm2"] * link[2][:, j]
        elif e["effect"] == "presliding_hysteresis":
            z = 0.
            for i, x in enumerate(v):
                z, f = bristle(p, z, x, motion.dt)
                torque[i, j] = -f
        else:
            law = FRICTION.get(formula(e)) or FIELD[formula(e)]
            other = link[1][:, robot.names.index(p["source_joint"])] if "source_joint" in p else 0.
            torque[:, j] = -law(p, np, q, v, t=motion.t, session=motion.session_start + motion.t, load=carried[:, j], other=other,
                                since=motion.since[:, j])
        parts[k] = torque
    for x in parts.values():
        total += x
    for k, e in enumerate(effects):
        if formula(e) == shop_floor.DRIVE:
            j, parts[k] = robot.names.index(e["joint"]), np.zeros_like(total)
            parts[k][:, j] = e["parameters"]["amplitude_nm"] * np.sign(total[:, j]) if motion.lost is None else motion.lost[:, j]
            total += parts[k]
    for name in RECORD:
        for k, e in enumerate(effects):
            if formula(e) == name:
                if name == "torque_saturation" and e["parameters"]["mode"] == "actuator":
                    # The command is recorded: what is missing shows only where the motor was cut.
                    j, limit = robot.names.index(e["joint"]), e["parameters"]["limit_nm"]
                    parts[k] = np.zeros_like(total)
                    if motion.link is None:
                        parts[k][:, j] = total[:, j] - np.clip(total[:, j], -limit, limit)
                    continue
                after = on_record(robot, e, total, motion.dt, motion.q, motion.session_start + motion.t)
                parts[k], total = after - total, after
    return rigid, [parts[k] for k in range(len(effects))]


def recorded(robot, effects, log, session_start):
    """The recorded effort without noise, at 1 kHz: the motor's, then what happens on the record."""
    tau = log.torque
    for name in RECORD:
        for e in effects:
            if formula(e) == name:
                tau = on_record(robot, e, tau, 1e-3, log.q, session_start + log.t)
    return tau


def rivals(robot, effect, motion, rigid):
    """Columns other explanations would use on the effect's joint, its own kind left out."""
    j = robot.names.index(effect["joint"])
    q, v, a, g = motion.q[:, j], motion.v[:, j], motion.a[:, j], rigid[:, j]
    s = np.tanh(v / 0.002)
    own = {"viscous_friction": "v", "coulomb_friction": "s", "rotor_inertia": "a", "torque_gain": "g",
           "torque_bias": "1", "cable_spring": "qSC", "counterbalance_spring": "qSC",
           "joint_elasticity": "a", "backlash": "a", "asymmetric_coulomb": "1"}.get(effect["effect"], "")
    columns = {"v": v, "s": s, "1": np.ones_like(v), "a": a, "g": g, "q": q, "S": np.sin(q), "C": np.cos(q)}
    return np.stack([x for key, x in columns.items() if key not in own], 1)


def visibility(robot, effect, pairs, sigma):
    """How visible an effect is over the fit recordings: rms over noise of the joint that shows it most, the same while it acts,
    and what is left of it after the rivals on its joint are fitted to it.  pairs: (motion, rigid, contribution)."""
    x = np.concatenate([c for _, _, c in pairs]) / sigma
    rms = np.sqrt((x**2).mean(0))
    top = int(np.argmax(rms))
    mag = np.abs(x[:, top])
    on = mag > 0.1 * max(mag.max(), 1e-12)
    out = {"snr_rms": float(rms[top]), "snr_active": float(np.sqrt((mag[on]**2).mean())) if on.any() else 0.}
    joint = effect.get("joint")
    if joint in robot.names and effect["effect"] != "unknown":
        A = np.concatenate([rivals(robot, effect, m, r) for m, r, _ in pairs])
        y = x[:, robot.names.index(joint)]
        out["snr_distinct"] = float(np.sqrt(np.mean((y - A @ np.linalg.lstsq(A, y, rcond=None)[0])**2)))
    return out


def smoothed(x, dt, band=BAND_HZ):
    """Zero-phase smoothing to `band` Hz (-3 dB; Gaussian of fourth order, flat for slow motion), reflected oddly at the ends."""
    width = 0.2355 / band / dt
    k = np.arange(-int(4 * width) - 1, int(4 * width) + 2)
    w = np.exp(-0.5 * (k / width)**2) * (1.5 - 0.5 * (k / width)**2)
    w /= w.sum()
    h = len(k) // 2
    ends = np.concatenate([2 * x[:1] - x[h:0:-1], x, 2 * x[-1:] - x[-2:-h - 2:-1]])
    return np.stack([np.convolve(c, w, "valid") for c in ends.T], 1)


def estimated(t, q):
    """Position, speed and acceleration a tool would take from an encoder's samples, at those samples."""
    stamps, first = np.unique(t, return_index=True)
    dt = float(np.median(np.diff(stamps)))
    grid = np.arange(stamps[0], stamps[-1] + dt / 2, dt)
    at = lambda x, to, fr: np.stack([np.interp(to, fr, c) for c in x.T], 1)
    s = smoothed(at(q[first], grid, stamps), dt)
    v = np.gradient(s, dt, axis=0)
    a = np.gradient(v, dt, axis=0)
    return tuple(at(x, t, grid) for x in (s, v, a))
