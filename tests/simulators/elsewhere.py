"""Inverse dynamics of a MuJoCo model by Pinocchio and by Drake."""
import logging

import numpy as np
import pinocchio
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

logging.getLogger("drake").setLevel(logging.ERROR)


def by_pinocchio(path, names, position, velocity, acceleration):
    """Efforts [N m or N], rows by joints in the order of `names`."""
    model = pinocchio.buildModelFromMJCF(str(path))
    data = model.createData()
    joints = [model.joints[model.getJointId(name)] for name in names]
    at = [joint.idx_v for joint in joints]
    q, v, a = pinocchio.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
    efforts = []
    for positions, velocities, accelerations in zip(position, velocity, acceleration):
        for joint, value in zip(joints, positions):
            # An unbounded joint has its angle as cosine and sine.
            q[joint.idx_q:joint.idx_q + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
        v[at], a[at] = velocities, accelerations
        bodies = pinocchio.rnea(model, data, q, v, a)
        friction = model.damping * v + model.upperDryFrictionLimit * np.sign(v)
        efforts.append((bodies + friction)[at])
    return np.array(efforts)


def by_drake(path, names, friction, position, velocity, acceleration):
    """Efforts [N m or N], rows by joints in the order of `names`. Drake has no dry friction: `friction` is added."""
    plant = MultibodyPlant(0.001)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    at = [plant.GetJointByName(name).velocity_start() for name in names]
    there = [plant.GetJointByName(name).position_start() for name in names]
    q, v, a = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities()), np.zeros(plant.num_velocities())
    efforts = []
    for positions, velocities, accelerations in zip(position, velocity, acceleration):
        q[there], v[at], a[at] = positions, velocities, accelerations
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        efforts.append(plant.CalcInverseDynamics(context, a, forces)[at] + friction * np.sign(velocities))
    return np.array(efforts)
