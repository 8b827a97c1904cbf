"""The same cases by mujoco.sysid and by `explain`: errors of the concealed numbers, and the time.

    python3 tests/simulators/beside_mujoco_sysid.py OUT [--cases arm7,folded]

Needs requirements.txt, and OUT as prove.py left it. mujoco.sysid fits rollouts of a quarter of a second under the recorded efforts, from the
recorded states, to the recorded positions and velocities by Gauss-Newton. Its parameter list holds the three that are concealed, and then all
candidates: damping, frictionloss, armature and stiffness of all joints, and the masses of all bodies. `explain` has no such list.
"""
import argparse
import json
import pathlib
import time

import mujoco
import numpy as np
from mujoco import rollout, sysid

import prove

WINDOW = 62                                         # rows, a quarter of a second
EVERY = 3                                           # of three windows one is fitted
LIMITS = {"damping": 20., "frictionloss": 40., "armature": 2., "stiffness": 60., "mass": 5.}
JOINT = ("damping", "frictionloss", "armature", "stiffness")


def spec_of(path):
    """The model with a motor at each joint in place of its own drives."""
    spec = mujoco.MjSpec.from_file(str(path))
    for own in list(spec.actuators):
        spec.delete(own)
    for joint in spec.joints:
        spec.add_actuator(name=f"{joint.name}_torque", target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    spec.option.timestep = 1 / prove.RATE_HZ / 2
    spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    return spec


def windows(folder, m):
    """Initial states, efforts, and the motions that follow, of the fitted recordings."""
    state, control, motion = [], [], []
    for k in range(prove.RECORDINGS):
        if k == prove.HELD_OUT:
            continue
        q, v, e = prove.recorded(folder / f"rec_{k}.csv", m)
        for at in range(0, len(q) - WINDOW - 1, WINDOW * EVERY):
            state.append(np.concatenate([[0.], q[at], v[at]]))
            control.append(np.repeat(e[at:at + WINDOW], 2, axis=0))
            motion.append(np.hstack([q[at + 1:at + WINDOW + 1], v[at + 1:at + WINDOW + 1]]))
    return np.array(state), np.array(control), np.array(motion)


def change(m, kept, attribute, name, value):
    """Sets a parameter of a model to what it was and `value`."""
    if attribute == "mass":
        body = m.body(name).id
        scale = 1 + value / kept["mass"][body]
        m.body_mass[body], m.body_inertia[body] = kept["mass"][body] * scale, kept["inertia"][body] * scale
        return
    joint = m.joint(name).id
    array, at = {"frictionloss": (m.dof_frictionloss, m.jnt_dofadr[joint]), "damping": (m.dof_damping, m.jnt_dofadr[joint]),
                 "armature": (m.dof_armature, m.jnt_dofadr[joint]), "stiffness": (m.jnt_stiffness, joint)}[attribute]
    array[at] = kept[attribute][at] + value


def fitted(folder, model, candidates):
    """Values of the candidates by mujoco.sysid, and the seconds that it took."""
    m = spec_of(folder / f"{model}.xml").compile()
    kept = {"mass": m.body_mass.copy(), "inertia": m.body_inertia.copy(), "frictionloss": m.dof_frictionloss.copy(),
            "damping": m.dof_damping.copy(), "armature": m.dof_armature.copy(), "stiffness": m.jnt_stiffness.copy()}
    state, control, motion = windows(folder, m)
    weight = 1 / np.maximum(np.std(motion.reshape(-1, motion.shape[2]), 0), 1e-9)
    data = [mujoco.MjData(m) for _ in range(2)]
    params = sysid.ParameterDict()
    for attribute, name in candidates:
        low = -0.9 * kept["mass"][m.body(name).id] if attribute == "mass" else 0.
        params.add(sysid.Parameter(f"{attribute}:{name}", 1e-3 * LIMITS[attribute], low, LIMITS[attribute]))

    def residual(x, _):
        x = np.atleast_2d(np.asarray(x).T if np.ndim(x) == 2 else x)
        columns = []
        for one in x:
            for (attribute, name), value in zip(candidates, one):
                change(m, kept, attribute, name, value)
            mujoco.mj_setConst(m, data[0])
            states, _ = rollout.rollout(m, data, state, control)
            moved = states[:, 1::2, 1:1 + m.nq + m.nv]
            columns.append(((moved - motion) * weight).ravel())
        return [columns[0] if len(columns) == 1 else np.array(columns).T], None, None

    begin = time.time()
    found, _ = sysid.optimize(params, residual, optimizer="scipy", verbose=False)
    return dict(zip(candidates, found.as_vector())), time.time() - begin


def ours(folder, model, candidates):
    """Values of the candidates in the written model, beside what it was."""
    old, new = (mujoco.MjModel.from_xml_path(str(path)) for path in (folder / f"{model}.xml", folder / "report" / "robot.xml"))
    out = {}
    for attribute, name in candidates:
        if attribute == "mass":
            out[attribute, name] = float(new.body(name).mass[0] - old.body(name).mass[0])
        else:
            own = {"frictionloss": "dof_frictionloss", "damping": "dof_damping", "armature": "dof_armature", "stiffness": "jnt_stiffness"}[attribute]
            joint = old.joint(name).id
            at = joint if attribute == "stiffness" else old.jnt_dofadr[joint]
            out[attribute, name] = float(getattr(new, own)[at] - getattr(old, own)[at])
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    # Zeros, gains and delays are no parameters of this comparison.
    names = [name for name, (_, changes) in prove.CASES.items() if all(attribute in LIMITS for attribute, _, _ in changes)]
    parser.add_argument("--cases", default=",".join(names))
    args = parser.parse_args()
    print("| case | concealed | explain, nothing given | mujoco.sysid, the three given | mujoco.sysid, all candidates given | seconds: explain, sysid (three), sysid (all) |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name in args.cases.split(","):
        folder, (model, changes) = args.out / name, prove.CASES[name]
        m = mujoco.MjModel.from_xml_path(str(folder / f"{model}.xml"))
        right = [(attribute, place) for attribute, place, _ in changes]
        every = [(attribute, m.joint(j).name) for attribute in JOINT for j in range(m.njnt)]
        every += [("mass", m.body(b).name) for b in range(1, m.nbody) if m.body_weldid[b] != 0]
        told, told_s = fitted(folder, model, right)
        all_of_them, all_s = fitted(folder, model, every)
        own = ours(folder, model, right)
        own_s = json.loads((folder / "seconds.json").read_text())
        errors = lambda found: ", ".join(f"{100 * (found[a, p] / x - 1):+.1f} %" for a, p, x in changes)
        text = ", ".join(f"{a} {p} +{x:g}" for a, p, x in changes)
        print(f"| {name} | {text} | {errors(own)} | {errors(told)} | {errors(all_of_them)} | {own_s:.0f}, {told_s:.0f}, {all_s:.0f} |", flush=True)


if __name__ == "__main__":
    main()
