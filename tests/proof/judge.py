"""Is a finding right? By name and place, with what no recording can tell apart counted as one.

A finding is `right`, `wrong`, or None: neither, because it is a part of something concealed, a second name of it, or not asked for.
"""
CLASSES = [{"counterbalance_spring", "cable_spring"},        # a sine arc over the range moved is close to a line
           {"payload", "link_mass", "link_com"},             # only base-parameter sums are identifiable: one link off, too
           {"external_push", "contact_wall"},                # one wrench, unknown application point: one link off, too
           {"torque_delay", "torque_lowpass"}]               # equal to first order in frequency times lag
NEAR = [CLASSES[1], CLASSES[2]]
NOWHERE = {"base_tilt", "torque_delay", "torque_lowpass"}
# What is part of an effect at the same joint, and so neither right nor wrong beside it or in its place.
PARTS = {"stribeck_friction": {"coulomb_friction", "viscous_friction"}, "asymmetric_coulomb": {"coulomb_friction", "torque_bias"},
         "load_dependent_friction": {"coulomb_friction"}, "presliding_hysteresis": {"coulomb_friction"}, "friction_step": {"coulomb_friction"},
         "temperature_viscous": {"viscous_friction"}, "backlash": {"rotor_inertia"}, "joint_elasticity": {"rotor_inertia"},
         "counterbalance_spring": {"torque_bias"}, "cable_spring": {"torque_bias"}, "payload_pickup": {"payload"},
         "unknown": {"coulomb_friction", "viscous_friction", "torque_bias"}}
# What is the nearest name of something off the list at the same joint: not wrong, not right.
NEAREST = {"gear_efficiency": {"load_dependent_friction"}, "load_squared_friction": {"load_dependent_friction"}}
BODIES = {"payload", "link_mass", "link_com", "unknown"}     # where the bodies are off, a body is never wrong


def places(robot):
    """Index along the chain of each joint and link; the base is -1."""
    return {name: i for i, name in enumerate(robot.names)} | {link.name: link.body for link in robot.links.values()}


def named(x, where):
    place = x.get("joint") or x.get("link")
    return x["effect"], None if x["effect"] in NOWHERE else where.get(place, place)


def agrees(finding, truth, source):
    """Whether (effect, place) names a truth, whose source joint has the index `source`."""
    (fe, fp), (te, tp) = finding, truth
    if fe == te == "transmission_coupling":
        return fp in (tp, source)
    if fe == te and fp == tp:
        return True
    near = isinstance(fp, int) and isinstance(tp, int) and abs(fp - tp) <= 1
    if fe == te == "unknown":
        return near
    return any(fe in c and te in c and (fp == tp or c in NEAR and near) for c in CLASSES)


def judge(findings, effects, robot):
    """`right`, `wrong` or None for each finding."""
    where = places(robot)
    truths = [(named(e, where), where.get(e["parameters"].get("source_joint"))) for e in effects]
    off = any(e["effect"] == "bodies_off" for e in effects)
    # Coulomb friction and an offset are asymmetric friction, and the other way round.
    both = {p for (e, p), _ in truths if e == "coulomb_friction"} & {p for (e, p), _ in truths if e == "torque_bias"}
    said = {named(f, where) for f in findings}
    nearest = {(name, where[e["joint"]]) for e in effects for name in NEAREST.get(e["parameters"].get("kind"), ())}

    def one(finding):
        own = named(finding, where)
        if any(agrees(own, t, source) for t, source in truths):
            return "right"
        if own[0] == "asymmetric_coulomb" and own[1] in both:
            return "right"
        other = ("torque_bias" if own[0] == "coulomb_friction" else "coulomb_friction", own[1])
        if own[0] in ("coulomb_friction", "torque_bias") and other in said and (("asymmetric_coulomb", own[1]), None) in truths:
            return "right"
        if any(agrees(named(r, where), t, source) for r in finding["equivalent_to"][:3] for t, source in truths):
            return "right"
        if any(own[0] in PARTS.get(e, ()) and own[1] == p for (e, p), _ in truths) or own in nearest:
            return None
        # So is what the report itself cannot tell from a body: the spring of a joint may be the weight of its link.
        body = own == ("rotor_inertia", 0) or any(x["effect"] in BODIES and x.get("link") for x in (finding, *finding["equivalent_to"][:3]))
        return None if off and body else "wrong"

    return [one(f) for f in findings]


def counts(findings, effects, robot):
    """Effects that were named, those that were missed, and wrong findings; bodies that are off are not asked for."""
    hit = missed = 0
    for effect in effects:
        if effect["effect"] != "bodies_off":
            own = [f for f, v in zip(findings, judge(findings, [effect], robot)) if v == "right"]
            hit, missed = hit + bool(own), missed + (not own)
    return hit, missed, judge(findings, effects, robot).count("wrong")
