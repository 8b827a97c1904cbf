"""Writes models/reference.json: what MuJoCo computes for the motions of each model, to which the program's reading of MJCF is compared.

    python3 tests/simulators/reference.py

Needs requirements.txt. For some random states of each model: positions, velocities and accelerations by joint, and the joint efforts of
mj_inverse, first of the bodies alone, then with armature, damping, springs and frictionloss [N m or N].
"""
import json
import pathlib

import mujoco
import numpy as np

MODELS = pathlib.Path(__file__).parent / "models"
NAMES = ("arm7", "folded", "gantry", "hand", "quadruped")
STATES = 6


def reference(path, seed):
    """The states of a model with the efforts that they need."""
    m = mujoco.MjModel.from_xml_path(str(path))
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    # The program's twin has weight on Earth; a mounting in another direction is kept.
    m.opt.gravity *= 9.81 / max(np.linalg.norm(m.opt.gravity), 1e-9)
    d = mujoco.MjData(m)
    rng = np.random.default_rng(seed)
    leads = leaders(m)
    moving = {int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)}
    hinges = [j for j in range(m.njnt) if int(m.jnt_type[j]) in moving]
    own = [j for j in hinges if j not in leads]
    states = []
    for _ in range(STATES):
        mujoco.mj_resetData(m, d)
        d.qvel[:], d.qacc[:] = 0, 0
        for j in own:
            at, low, high = m.jnt_dofadr[j], *(m.jnt_range[j] if m.jnt_limited[j] else (-2., 2.))
            d.qpos[m.jnt_qposadr[j]] = rng.uniform(low, high)
            d.qvel[at], d.qacc[at] = rng.uniform(-2, 2), rng.uniform(-8, 8)
        for j, (other, offset, ratio) in leads.items():
            at, there = m.jnt_dofadr[j], m.jnt_dofadr[other]
            d.qpos[m.jnt_qposadr[j]] = offset + ratio * d.qpos[m.jnt_qposadr[other]]
            d.qvel[at], d.qacc[at] = ratio * d.qvel[there], ratio * d.qacc[there]
        states.append({
            "position": [d.qpos[m.jnt_qposadr[j]] for j in own], "velocity": [d.qvel[m.jnt_dofadr[j]] for j in own],
            "acceleration": [d.qacc[m.jnt_dofadr[j]] for j in own],
            "bodies": effort(m, d, own, leads, False), "all": effort(m, d, own, leads, True)})
    return {"joints": [m.joint(j).name for j in own], "states": states}


def leaders(m):
    """By joint that an equality constraint ties to another: that joint, offset and ratio of its position."""
    ties = {}
    for k in range(m.neq):
        if int(m.eq_type[k]) == int(mujoco.mjtEq.mjEQ_JOINT) and m.eq_obj2id[k] >= 0:
            own, other = int(m.eq_obj1id[k]), int(m.eq_obj2id[k])
            a, b = m.eq_data[k][:2]
            zero = m.qpos0[m.jnt_qposadr[[own, other]]]
            ties[own] = (other, a + zero[0] - b * zero[1], b)
    return ties


def effort(m, d, own, leads, whole):
    """Efforts of the joints [N m or N]; those of followers are passed on to their leaders."""
    arrays = (m.dof_armature, m.dof_damping, m.jnt_stiffness, m.dof_frictionloss)
    kept = [array.copy() for array in arrays]
    if not whole:
        for array in arrays:
            array[:] = 0
    mujoco.mj_setConst(m, mujoco.MjData(m))
    now = mujoco.MjData(m)
    now.qpos[:], now.qvel[:], now.qacc[:] = d.qpos, d.qvel, d.qacc
    # Constraints would add their forces; friction is added here, without the solver's softness.
    m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    mujoco.mj_inverse(m, now)
    all_efforts = now.qfrc_inverse + m.dof_frictionloss * np.sign(d.qvel)
    for array, values in zip(arrays, kept):
        array[:] = values
    out = []
    for j in own:
        total = all_efforts[m.jnt_dofadr[j]]
        for follower, (other, _, ratio) in leads.items():
            if other == j:
                total += ratio * all_efforts[m.jnt_dofadr[follower]]
        out.append(total)
    return out


def main():
    all_models = {name: reference(MODELS / f"{name}.xml", seed) for seed, name in enumerate(NAMES)}
    (MODELS / "reference.json").write_text(json.dumps(all_models, indent=1) + "\n")


if __name__ == "__main__":
    main()
