"""Faults of drives, brakes, sensors and springs that workshops know: what each does to a simulated arm, and random shapes of them.

Written apart from the laws of `explain`: a motor's constant falls as its winding's temperature does, a rotor's magnets are unequal in pairs, a
channel is read now and then, a dead band is cut out of the motor's torque, a sensor's hysteresis is a sum of plays
(Prandtl-Ishlinskii), a brake follows the command, a gas spring has pivots, and an encoder's error is in the position that the
controller sees. Each has an `amplitude_nm`, about the torque at usual speeds, loads and angles, or for the encoder an angle.
"""
import numpy as np

SMOOTHING = 0.002  # rad/s (m/s), as in effects.py
PLAYS = 6          # of a sensor's hysteresis
REST_S = 0.15      # a brake closes after the command has stood for so long
FADES_S = 0.08     # and takes so long to open once it begins to


def _late_brake(p, m, q, v, since, **_):
    share = (p["late_s"] + FADES_S - since) / FADES_S
    share = np.clip(share, 0., 1.) if m is np else min(max(share, 0.), 1.)
    return -p["amplitude_nm"] * share * m.tanh(v / SMOOTHING)


def _drift(p, m, q, v, session, **_):
    return -p["amplitude_nm"] * (p["at_first"] + (1. - p["at_first"]) * session / p["time_s"]) * m.tanh(v / SMOOTHING)


def _gas_spring(p, m, q, v, **_):
    """A strut pushes between a pivot on the link, `arm_m` from the axis, and one on the base, `base_m` from it."""
    turn = q - p["dead_centre_rad"]
    a, b = p["arm_m"], p["base_m"]
    length = m.sqrt(a * a + b * b - 2. * a * b * m.cos(turn))
    force = p["amplitude_nm"] / min(a, b) * (1. + p["rise"] * (a + b - length) / (2. * min(a, b)))
    return force * a * b * m.sin(turn) / length


FRICTION = {"unknown:late_brake": _late_brake, "unknown:friction_drift": _drift}
FIELD = {"unknown:gas_spring": _gas_spring}
RECORD = tuple(f"unknown:{kind}" for kind in ("sensor_hysteresis", "gain_drift", "gain_ripple", "late_effort"))      # change what is recorded
DRIVE = "unknown:drive_deadband"             # cuts the motor's torque
ENCODER = "unknown:encoder_eccentricity"     # changes the position that is read
KINDS = ["friction_drift", "drive_deadband", "sensor_hysteresis", "late_brake", "encoder_eccentricity", "gas_spring", "gain_drift", "gain_ripple",
         "late_effort"]
# As these laws are called in reports; others have the same name there.
NEEDS_PLANT = {"drive_deadband", "encoder_eccentricity"}


def since_start(command, dt):
    """Time [s] since each joint's command began to move after its last rest (samples x joints)."""
    stands = np.abs(np.gradient(command, dt, axis=0)) < 0.003
    out = np.zeros(command.shape)
    still, since = np.full(command.shape[1], REST_S), np.zeros(command.shape[1])
    for k, row in enumerate(stands):
        still = np.where(row, still + dt, 0.)
        since = np.where(still >= REST_S, 0., since + dt)
        out[k] = since
    return out


def delivered(p, torque):
    """What a drive with a dead band delivers of a motor's torque [N m]."""
    lost = p["amplitude_nm"]
    return torque - min(max(torque, -lost), lost)


def hysteresis(p, torque):
    """What a sensor with hysteresis adds to its reading along the samples `torque` [N m]: it lags behind."""
    share = np.array(p["shares"])
    radii = p["reach_nm"] * np.arange(1, PLAYS + 1) / PLAYS
    weight = p["amplitude_nm"] * share / radii
    play, out = np.full(PLAYS, torque[0]), np.empty(len(torque))
    for k, x in enumerate(torque):
        play = np.clip(play, x - radii, x + radii)
        out[k] = -weight @ (x - play)
    return out


def recorded(p, torque, q, session, dt):
    """What is recorded of a joint's torque, along samples; the angle `q` and the time of the session go with them."""
    kind = p["kind"]
    if kind == "sensor_hysteresis":
        return torque + hysteresis(p, torque)
    share = p["amplitude_nm"] / p["usual_nm"]
    if kind == "gain_drift":       # a winding that warms up towards its end temperature
        return torque * (1. + share * p["sign"] * (1. - np.exp(-session / p["time_s"])))
    if kind == "gain_ripple":      # pairs of magnets of unequal strength
        n, phase = p["pairs"], p["phase_rad"]
        return torque * (1. + share * (np.cos(n * q + phase) + 0.3 * np.cos(2. * n * q + 1.7 * phase)))
    held = np.arange(len(torque)) * dt // max(share * p["longest_s"], dt) * max(share * p["longest_s"], dt)
    return torque[np.minimum(np.round(held / dt).astype(int), len(torque) - 1)]


def read(p, q, v, a):
    """Position, speed and acceleration that an eccentric encoder reads where the joint has these."""
    size, n, phase = p["amplitude_rad"], p["cycles_per_rev"], p["phase_rad"]
    slope = 1. - size * n * np.cos(n * q + phase)
    return q - size * np.sin(n * q + phase), slope * v, slope * a + size * n * n * np.sin(n * q + phase) * v * v


def shows(kind, c):
    """Joints (a mask) on which a fault can be seen and is not another fault as well; c: a draws.Context."""
    load = np.concatenate([c.rigid[m.recording] for m in c.fit_motions])
    if kind == "drive_deadband":
        ahead = (load > 0).mean(0)
        return (ahead > 0.15) & (ahead < 0.85) & (c.swing / c.sigma > 25)
    if kind in ("sensor_hysteresis", "gain_drift", "gain_ripple", "late_effort"):
        return c.swing / c.sigma > 25
    if kind == "gas_spring":
        return (c.range > 1.5) & ~c.robot.slides
    if kind == "encoder_eccentricity":
        return (c.swing / c.sigma > 40) & (c.range > 1.2) & ~c.robot.slides
    return np.ones(c.robot.n, bool)


def shape(kind, c, rng, j):
    """(place, parameters as a function of the amplitude) of a fault on joint j; c: a draws.Context."""
    u = lambda a, b: float(rng.uniform(a, b))
    q = np.concatenate([m.q[:, j] for m in c.fit_motions])
    session = float(max(m.session_start + m.t[-1] for m in c.motions))
    size = "amplitude_rad" if kind == "encoder_eccentricity" else "amplitude_nm"
    extra = {
        "friction_drift": {"time_s": session, "at_first": float(rng.choice([u(0.15, 0.5), u(2., 3.)]))},
        "drive_deadband": {},
        "sensor_hysteresis": {"reach_nm": u(0.3, 1.) * float(c.swing[j]), "shares": rng.dirichlet(np.full(PLAYS, 2.)).tolist()},
        "late_brake": {"late_s": u(0.15, 0.5)},
        "gain_drift": {"usual_nm": float(c.swing[j]), "time_s": u(0.5, 2.) * session, "sign": float(rng.choice([-1., 1.]))},
        "gain_ripple": {"usual_nm": float(c.swing[j]), "pairs": int(rng.integers(1, 5)), "phase_rad": u(-3., 3.)},
        "late_effort": {"usual_nm": float(c.swing[j]), "longest_s": u(0.3, 0.6)},
        "encoder_eccentricity": {"cycles_per_rev": float(rng.choice([1, 2])), "phase_rad": u(-3., 3.)},
        "gas_spring": {"arm_m": u(0.08, 0.2), "base_m": u(0.22, 0.4), "rise": u(0.1, 0.4),
                       "dead_centre_rad": float(np.mean(q)) + float(rng.choice([-1., 1.])) * u(0.1, 1.4)},
    }[kind]
    return {"joint": c.robot.names[j]}, lambda s: {"kind": kind, size: s, **extra}
