"""Inverse dynamics of written URDFs by Pinocchio and by Drake. What their formats lack is added, as docs/simulators.md lists it."""
import numpy as np
import pinocchio
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces


def springs(m, position):
    """Efforts of a MuJoCo model's springs; every joint has one coordinate."""
    return m.jnt_stiffness * (position - m.qpos_spring)


def by_pinocchio(path, names, m, position, velocity, acceleration):
    """Efforts [N m or N], rows by joints in the order of `names`. A URDF has neither rotors nor springs: those of `m` are added."""
    model = pinocchio.buildModelFromUrdf(str(path))
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
        efforts.append((bodies + model.damping * v + model.upperDryFrictionLimit * np.sign(v))[at])
    return np.array(efforts) + m.dof_armature * acceleration + springs(m, position)


def by_drake(path, names, m, position, velocity, acceleration):
    """Efforts [N m or N], rows by joints in the order of `names`. Drake reads neither dry friction nor springs: those of `m` are added."""
    plant = MultibodyPlant(0.001)
    Parser(plant).AddModels(str(path))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    joints = [plant.GetJointByName(name) for name in names]
    there, at = [joint.position_start() for joint in joints], [joint.velocity_start() for joint in joints]
    q, v, a = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities()), np.zeros(plant.num_velocities())
    efforts = []
    for positions, velocities, accelerations in zip(position, velocity, acceleration):
        q[there], v[at], a[at] = positions, velocities, accelerations
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        forces = MultibodyForces(plant)
        plant.CalcForceElementsContribution(context, forces)
        efforts.append(plant.CalcInverseDynamics(context, a, forces)[at])
    return np.array(efforts) + m.dof_frictionloss * np.sign(velocity) + springs(m, position)
