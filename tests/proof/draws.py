"""Random effects: places, shapes and magnitudes, scaled so that each stands out of the noise by a chosen ratio."""
import dataclasses

import numpy as np

import off_list
import shop_floor
import truth
from effects import active

# Two effects of one class never share a place, so that each can be told from the other.
CLASS = {
    "viscous_friction": "viscous", "temperature_viscous": "viscous", "quadratic_drag": "viscous",
    "coulomb_friction": "dry", "stribeck_friction": "dry", "asymmetric_coulomb": "dry", "load_dependent_friction": "dry",
    "presliding_hysteresis": "dry", "friction_step": "dry", "rotor_inertia": "inertia", "joint_elasticity": "alone",
    "backlash": "alone", "payload": "mass", "payload_pickup": "mass", "link_mass": "mass", "link_com": "mass",
    "base_tilt": "tilt", "counterbalance_spring": "position", "cable_spring": "position", "torque_ripple": "ripple",
    "torque_gain": "sensor", "torque_bias": "position", "torque_delay": "lag", "torque_lowpass": "lag",
    "torque_saturation": "alone", "transmission_coupling": "sensor", "external_push": "contact", "contact_wall": "contact",
}
ONCE = {"mass", "tilt", "lag", "contact"}                 # one of these in a whole case
CLASHES = [{"dry", "position"}, {"viscous", "inertia"}]   # asymmetric friction = Coulomb + offset; drag, lag and inertia blur
EFFECTS = sorted(CLASS)
UNKNOWN = ["worn_segment", "periodic_disturbance", "cross_joint_friction", "square_root_friction", "torque_bump"]
# How much of the common ratio of effect to noise an effect gets: arm-wide ones shift many joints at once, cut ones act rarely.
SHARE = {"payload": 2., "payload_pickup": 2., "contact_wall": 1.5, "base_tilt": 0.5, "torque_delay": 0.45, "torque_lowpass": 0.4,
         "joint_elasticity": 0.35, "backlash": 0.35, "rotor_inertia": 0.4, "torque_saturation": 0.3, "torque_gain": 0.5,
         "transmission_coupling": 0.5, "external_push": 0.7, "link_com": 0.7}


@dataclasses.dataclass
class Context:
    """What a draw may look at: the robot, its commanded motions (one truth.Motion per recording) and the noise [N m]."""
    robot: object
    motions: list
    fit: list          # names of recordings
    sigma: np.ndarray

    def __post_init__(self):
        self.rigid = {m.recording: self.robot.nominal.rnea(m.q, m.v, m.a) for m in self.motions}
        self.fit_motions = [m for m in self.motions if m.recording in self.fit]
        self.rms = np.sqrt(np.mean(np.concatenate([self.rigid[r] for r in self.fit])**2, 0))
        self.swing = np.std(np.concatenate([self.rigid[r] for r in self.fit]), 0)
        self.range = np.ptp(np.concatenate([m.q for m in self.fit_motions]), axis=0)
        self.speed = np.sqrt(np.mean(np.concatenate([m.v for m in self.fit_motions])**2, 0))


def candidates(name, c):
    """Joints (indexes) on which an effect can be seen, and told from its rivals."""
    r, ok = c.robot, c.range > 0.25
    strong = c.swing / c.sigma
    if name in ("torque_gain", "load_dependent_friction", "torque_saturation"):
        ok &= strong > 25
    if name in ("counterbalance_spring", "torque_ripple", "joint_elasticity", "backlash"):
        ok &= ~r.slides
    if name == "counterbalance_spring":
        ok &= c.range > 1.2
    if name == "transmission_coupling":
        near = [any(0 <= k < r.n and strong[k] > 25 for k in (j - 1, j + 1)) for j in range(r.n)]
        ok &= np.array(near)
    return [j for j in range(r.n) if ok[j]]


def window(c, rng, recording, length):
    m = next(x for x in c.motions if x.recording == recording)
    length = min(length, 0.6 * m.t[-1])
    start = rng.uniform(0.12 * m.t[-1], 0.9 * m.t[-1] - length)
    return {"recording": recording, "t_start": float(start), "t_end": float(start + length)}


def shape(name, c, rng, j):
    """(place and extras, parameters as a function of the magnitude s, lowest s, highest s) of an effect on joint j."""
    r = c.robot
    u = lambda a, b: float(rng.uniform(a, b))
    limit, sign = float(r.effort[j]), float(rng.choice([-1., 1.]))
    joint, tool = {"joint": r.names[j]}, {"link": r.tool}
    q = np.concatenate([m.q[:, j] for m in c.fit_motions])
    if name == "viscous_friction":
        return joint, lambda s: {"viscous_nms_per_rad": s}, 0., limit
    if name == "coulomb_friction":
        return joint, lambda s: {"coulomb_nm": s}, 0., 0.12 * limit
    if name == "stribeck_friction":
        ratio, speed = u(1.5, 2.4), u(0.03, 0.15)
        return joint, lambda s: {"coulomb_nm": s, "static_nm": ratio * s, "stribeck_velocity_rad_s": speed}, 0., 0.07 * limit
    if name == "asymmetric_coulomb":
        f, b = rng.permutation([1., u(0.2, 0.7)])
        return joint, lambda s: {"coulomb_positive_nm": float(f * s), "coulomb_negative_nm": float(b * s)}, 0., 0.12 * limit
    if name == "load_dependent_friction":
        return joint, lambda s: {"coefficient": s}, 0., 0.4
    if name == "presliding_hysteresis":
        reach, damping = u(0.008, 0.03), u(0.005, 0.015)
        return joint, lambda s: {"coulomb_nm": s, "bristle_stiffness_nm_per_rad": s / reach,
                                 "bristle_damping_nms_per_rad": damping * s / reach}, 0., 0.1 * limit
    if name == "quadratic_drag":
        return joint, lambda s: {"drag_nms2_per_rad2": s}, 0., limit
    if name == "temperature_viscous":
        extra, time = u(0.9, 2.), u(30., 80.)
        return joint, lambda s: {"viscous_warm_nms_per_rad": s, "viscous_extra_cold_nms_per_rad": extra * s,
                                 "time_constant_s": time}, 0., limit
    if name == "friction_step":
        before, after = rng.permutation([1., u(1.8, 3.)])
        m = c.fit_motions[int(rng.integers(1, len(c.fit_motions)) if len(c.fit_motions) > 2 else 0)]
        t = u(0.3, 0.7) * m.t[-1]
        when = {"windows": [{"recording": m.recording, "t_start": t, "t_end": None}]}
        return joint | when, lambda s: {"coulomb_before_nm": float(before * s), "coulomb_after_nm": float(after * s),
                                        "change_time_session_s": m.session_start + t}, 0., 0.05 * limit
    if name == "rotor_inertia":
        return joint, lambda s: {"inertia_kgm2": s}, 0., limit / 30.
    if name in ("joint_elasticity", "backlash"):
        own = float(r.nominal.inertias(np.concatenate([m.q[::20] for m in c.fit_motions]))[:, j, j].mean())
        if name == "joint_elasticity":
            k = own * (2 * np.pi * u(5., 11.))**2
            return joint | {"damping": 0.02 * np.sqrt(k * own)}, lambda s: {
                "stiffness_nm_per_rad": k, "rotor_inertia_kgm2": s}, 0.02 * own, limit / 30.
        gap, k = u(0.004, 0.015), own * (2 * np.pi * 22.)**2
        return joint | {"flank_stiffness": k, "flank_damping": 0.5 * np.sqrt(k * own)}, lambda s: {
            "gap_rad": gap, "rotor_inertia_kgm2": s}, 0.05 * own, limit / 30.
    if name in ("payload", "payload_pickup"):
        com, box = [u(-0.05, 0.05), u(-0.05, 0.05), u(0.03, 0.14)], rng.uniform(0.03, 0.05, 3)**2
        values = lambda s: {"mass_kg": s, **{f"com_{a}_m": com[k] for k, a in enumerate("xyz")},
                            **{f"i{a}{a}_kgm2": float(s * box[k]) for k, a in enumerate("xyz")}}
        heaviest = 0.25 * r.effort[1] / 9.81
        if name == "payload":
            return tool, values, 0.02, heaviest
        first = min(c.motions, key=lambda m: m.t[-1])
        w = window(c, rng, first.recording, u(2.2, 4.5))
        return tool | {"windows": [w | {"recording": m.recording} for m in c.motions]}, values, 0.02, heaviest
    if name in ("link_mass", "link_com"):
        heavy = [n for n in r.moving_links[1:] if r.links[n].inertial is not None and r.links[n].inertial.mass > 0.3]
        link = {"link": str(rng.choice(heavy[:-1] or heavy))}
        mass = r.links[link["link"]].inertial.mass
        if name == "link_mass":
            return link, lambda s: {"delta_mass_kg": sign * s}, 0., (0.7 if sign < 0 else 1.2) * mass
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        return link, lambda s: {f"delta_com_{a}_m": float(d[k] * s) for k, a in enumerate("xyz")}, 0., 0.1
    if name == "base_tilt":
        angle = u(0., 2 * np.pi)
        return {"link": r.base}, lambda s: {"roll_rad": s * float(np.cos(angle)), "pitch_rad": s * float(np.sin(angle))}, 0., 0.15
    if name == "counterbalance_spring":
        rest = u(q.min() - 0.5, q.max() + 0.5)
        return joint, lambda s: {"amplitude_nm": s, "rest_angle_rad": rest}, 0., 0.3 * limit
    if name == "cable_spring":
        rest = u(q.min(), q.max())
        return joint, lambda s: {"stiffness_nm_per_rad": s, "rest_angle_rad": rest}, 0., 0.3 * limit
    if name == "torque_ripple":
        n = [float(x) for x in rng.choice(np.arange(6, 33), 2, replace=False)]
        part, phase, two = u(0.35, 0.8), rng.uniform(-np.pi, np.pi, 2), rng.random() < 0.7
        return joint, lambda s: {"amplitude_nm": s, "cycles_per_rev": n[0], "phase_rad": float(phase[0])} | ({
            "amplitude2_nm": part * s, "cycles_per_rev2": n[1], "phase2_rad": float(phase[1])} if two else {}), 0., 0.1 * limit
    if name == "torque_gain":
        return joint, lambda s: {"gain": 1. + sign * s}, 0., 0.35
    if name == "torque_bias":
        return joint, lambda s: {"bias_nm": sign * s}, 0., 0.15 * limit
    if name == "torque_delay":
        return {"joint": "all"}, lambda s: {"delay_s": s}, 0.002, 0.06
    if name == "torque_lowpass":
        return {"joint": "all"}, lambda s: {"cutoff_hz": 1. / (2 * np.pi * s)}, 0.003, 0.08
    if name == "torque_saturation":
        top = float(np.abs(np.concatenate([c.rigid[f][:, j] for f in c.fit])).max())
        mode = str(rng.choice(["sensor", "actuator"], p=[0.65, 0.35]))
        return joint, lambda s: {"limit_nm": top * (1. - s), "mode": mode}, 0.02, 0.6 if mode == "sensor" else 0.25
    if name == "transmission_coupling":
        near = [k for k in (j - 1, j + 1) if 0 <= k < r.n and c.swing[k] / c.sigma[k] > 25]
        source = int(rng.choice(near))
        return joint, lambda s: {"coefficient": sign * s, "source_joint": r.names[source]}, 0., 0.5
    if name == "external_push":
        k = int(rng.integers(1, r.n))
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        some = rng.choice(c.fit, size=int(rng.integers(1, 4)) if len(c.fit) > 3 else 1, replace=False)
        return {"link": r.moving_links[k], "windows": [window(c, rng, str(f), u(1., 2.5)) for f in some]}, lambda s: {
            f"force_{a}_n": float(d[i] * s) for i, a in enumerate("xyz")}, 0.5, 150.
    if name == "contact_wall":
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        depth = {m.recording: r.nominal.frames(m.q[::4], r.moving_links[-1])[0] @ d for m in c.motions}
        fit, held = (sorted(x.max() for k, x in depth.items() if (k in c.fit) == use) for use in (True, False))
        # Touched in two recordings to fit (if there are so many) and in one held out.
        offset = min(float(np.quantile(np.concatenate(list(depth.values())), u(0.75, 0.9))), fit[-min(2, len(fit))] - 0.02)
        offset = min(offset, held[-1] - 0.02) if held else offset
        return tool, lambda s: {"stiffness_n_per_m": s, "normal_x": float(d[0]), "normal_y": float(d[1]), "normal_z": float(d[2]),
                                "offset_m": offset}, 80., 6000.
    raise ValueError(name)


def unknown_shape(kind, c, rng, j):
    """The same for something off the list."""
    if kind in off_list.KINDS:
        return off_list.shape(kind, c, rng, j)
    if kind in shop_floor.KINDS:
        return shop_floor.shape(kind, c, rng, j)
    u = lambda a, b: float(rng.uniform(a, b))
    q, joint = np.concatenate([m.q[:, j] for m in c.fit_motions]), {"joint": c.robot.names[j]}
    low, wide = float(q.min()), float(np.ptp(q))
    if kind == "worn_segment":
        a = low + u(0.15, 0.55) * wide
        return joint, lambda s: {"kind": kind, "coulomb_nm": s, "q_from_rad": a, "q_to_rad": a + u(0.2, 0.3) * wide}
    if kind == "periodic_disturbance":
        f, phase = u(0.6, 2.5), u(-3., 3.)
        return joint, lambda s: {"kind": kind, "amplitude_nm": s, "frequency_hz": f, "phase_rad": phase}
    if kind == "cross_joint_friction":
        k = int(rng.choice([x for x in (j - 1, j + 1, j - 2, j + 2) if 0 <= x < c.robot.n]))
        return joint, lambda s: {"kind": kind, "coefficient_nms_per_rad": s, "source_joint": c.robot.names[k]}
    if kind == "square_root_friction":
        return joint, lambda s: {"kind": kind, "root_nm": s}
    centre, width = low + u(0.3, 0.7) * wide, u(0.06, 0.12) * wide
    return joint, lambda s: {"kind": kind, "amplitude_nm": s, "centre_rad": centre, "width_rad": width}


def magnitude(c, place, values, low, high, target, name):
    """The s for which the effect's rms over noise, on the joint that shows it most, reaches the target (or the end of its range);
    windows count alone."""
    def ratio(s):
        e = {"effect": name, "parameters": values(s), **place}
        squares, count = 0., 0
        for m in c.fit_motions:
            _, (x,) = truth.contributions(c.robot, [e], m, c.rigid[m.recording])
            on = active(e, m.recording, m.t) if "windows" in e and name != "friction_step" else np.ones(len(m.t), bool)
            squares, count = squares + (x[on]**2).sum(0), count + on.sum()
        return float((np.sqrt(squares / max(count, 1)) / c.sigma).max())

    low, high = max(low, 1e-5 * high), high
    if ratio(high) <= target:
        return high, ratio(high)
    if ratio(low) >= target:
        return low, ratio(low)
    a, b = np.log(low), np.log(high)
    for _ in range(16):
        mid = 0.5 * (a + b)
        a, b = (mid, b) if ratio(float(np.exp(mid))) < target else (a, mid)
    s = float(np.exp(0.5 * (a + b)))
    return s, ratio(s)


def allowed(name, joint, taken):
    """May an effect of this name come on this joint (or the whole arm) beside those taken?"""
    k = CLASS[name]
    for e in taken:
        other, same = CLASS[e["effect"]], e.get("joint") == joint
        if k == other and k in ONCE:
            return False
        if same and (k == other or "alone" in (k, other) or {k, other} in CLASHES):
            return False
        if "alone" in (k, other) and (k == other or "lag" in (k, other)):
            return False
    return True


def together(names, count, rng):
    """Some distinct effects that may be in one case."""
    out = []
    for name in (str(x) for x in rng.permutation(names)):
        if len(out) < count and allowed(name.partition("@")[0], None, [{"effect": x.partition("@")[0], "joint": x} for x in out]):
            out.append(name)
    return out


def whole_arm(n, rng):
    """What an arm has at once: friction and mostly a rotor on every joint, and up to two things more; `name@joint`."""
    out = []
    for j in range(n):
        dry = ["coulomb_friction", "stribeck_friction", "asymmetric_coulomb"]
        out += [f"viscous_friction@{j}", f"{rng.choice(dry, p=[0.7, 0.2, 0.1])}@{j}"]
        out += [f"rotor_inertia@{j}"] if rng.random() < 0.6 else []
        out += [f"load_dependent_friction@{j}"] if j in (1, 2) and rng.random() < 0.6 else []
    more = ["payload", "payload_pickup", "link_com", "base_tilt", "cable_spring", "counterbalance_spring", "torque_ripple", "torque_bias",
            f"transmission_coupling@{n - 1}", "torque_delay", "external_push", "torque_gain"]
    return out + together(more, int(rng.integers(0, 3)), rng)


def bodies_off(c, rng):
    """All bodies a little off what the URDF says, as those of real arms are: masses by 5 %, centres by 5 mm, inertias by 10 %."""
    heavy = [link.name for link in c.robot.links.values() if link.body >= 0 and link.inertial is not None and link.inertial.mass > 0]
    by = lambda: {"mass": float(np.exp(rng.normal(0., 0.05))), "com_m": rng.normal(0., 0.005, 3).tolist(),
                  "inertia": float(np.exp(rng.normal(0., 0.1)))}
    return {"effect": "bodies_off", "link": heavy[0], "parameters": {link: by() for link in heavy}}


def draw(name, c, rng, target, taken=()):
    """One effect of this name, or None where the robot's motion cannot show it. On a joint of its own it asks nobody: `name@joint`."""
    if name == "bodies_off":
        return bodies_off(c, rng)
    name, _, at = name.partition("@")
    kind = name.split(":")[1] if name.startswith("unknown:") else None
    target = max(target * (1. if kind else SHARE.get(name, 1.)), 1.5)
    # Whole-arm and link effects have no joint of their own.
    free = kind is None and CLASS[name] in ("mass", "tilt", "lag", "contact")
    options = [0] if free else [j for j in candidates("" if kind else name, c)
                                if kind or at or allowed(name, c.robot.names[j], taken)]
    options = [j for j in options if j == int(at)] if at else options
    if kind in shop_floor.KINDS:
        options = [j for j in options if shop_floor.shows(kind, c)[j]]
    if not options or (free and not allowed(name, None, taken)):
        return None
    j = int(rng.choice(options))
    if kind:
        place, values = unknown_shape(kind, c, rng, j)
        fixed = values(1.)
        key = next(k for k in fixed if k in ("coulomb_nm", "amplitude_nm", "amplitude_rad", "root_nm", "coefficient_nms_per_rad"))
        values, low, high = (lambda s: {**fixed, key: s}), 0., 0.03 if key == "amplitude_rad" else 0.15 * float(c.robot.effort[j])
    else:
        place, values, low, high = shape(name, c, rng, j)
    label = "unknown" if kind else name
    s, reached = magnitude(c, place, values, low, high, target, label)
    if reached < 0.4 * target or reached > 4. * target:
        return None
    return {"effect": label, **place, "parameters": values(s)}
