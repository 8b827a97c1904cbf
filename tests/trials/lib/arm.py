"""A serial arm of five joints: its URDF and its inverse dynamics.

The arm is no product. Its forearm hangs far out, so that three joints bear weight.
"""

from dataclasses import dataclass, replace

import numpy as np

GRAVITY_MPS2 = 9.80665
# Velocity over which dry friction changes its sign [rad/s].
SMOOTHING_RADPS = 0.002


@dataclass(frozen=True)
class Joint:
    """A revolute joint and the link that it moves. Lengths in m, masses in kg, inertias in kg m^2."""

    name: str
    link: str
    origin: tuple
    axis: tuple
    effort_nm: float
    mass: float
    com: tuple
    # ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, as URDF orders them.
    inertia: tuple
    coulomb_nm: float
    viscous_nms_per_rad: float
    noise_nm: float


@dataclass(frozen=True)
class Arm:
    joints: tuple
    name: str = "crane5"
    base: str = "foot"
    velocity_limit_radps: float = 3.0

    @property
    def names(self):
        return [joint.name for joint in self.joints]

    @property
    def links(self):
        return [joint.link for joint in self.joints]

    def joint(self, name):
        return next(joint for joint in self.joints if joint.name == name)

    def with_link(self, link, **changes):
        """The arm with another mass, centre of mass or inertia of one link."""
        return replace(
            self, joints=tuple(replace(j, **changes) if j.link == link else j for j in self.joints)
        )

    def scaled_inertias(self, factor):
        scaled = (replace(j, inertia=tuple(factor * entry for entry in j.inertia)) for j in self.joints)
        return replace(self, joints=tuple(scaled))


ARM = Arm(
    joints=(
        Joint("j_base", "column", (0, 0, 0.18), (0, 0, 1), 180, 4.6, (0.012, 0.02, -0.03),
              (0.0213, 0.0004, -0.0003, 0.0188, 0.0006, 0.0093), 2.6, 3.4, 0.16),
        Joint("j_shoulder", "boom", (0.06, 0.09, 0.05), (0, 1, 0), 180, 6.4, (0.17, 0.015, 0.01),
              (0.0161, 0.0009, -0.0012, 0.1043, 0.0002, 0.1098), 2.3, 3.1, 0.16),
        Joint("j_elbow", "stick", (0.37, -0.08, 0), (0, 1, 0), 110, 2.9, (0.14, 0.01, 0.025),
              (0.0052, 0.0003, 0.0007, 0.0392, -0.0001, 0.0401), 1.6, 2.0, 0.10),
        Joint("j_tilt", "knuckle", (0.31, 0.05, 0), (0, 1, 0), 40, 1.4, (0.045, -0.006, 0),
              (0.0014, 0.0001, 0, 0.0023, 0, 0.0025), 0.7, 0.6, 0.05),
        Joint("j_turn", "plate", (0.11, 0, 0), (1, 0, 0), 25, 0.7, (0.05, 0.018, 0.004),
              (0.00062, 0.00001, 0, 0.00071, 0, 0.00083), 0.4, 0.3, 0.03),
    )
)


def urdf_body(arm, prefix="", joint_type="revolute", decimal="."):
    """Links and joints of the arm without the root link and the robot element."""

    def text(*values):
        return " ".join(f"{value:g}" for value in values).replace(".", decimal)

    parent, lines = arm.base, []
    for j in arm.joints:
        limit = f'effort="{text(j.effort_nm)}" velocity="{text(arm.velocity_limit_radps)}"'
        if joint_type == "revolute":
            limit = f'lower="{text(-6.2832)}" upper="{text(6.2832)}" {limit}'
        entries = zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), j.inertia)
        lines += [
            f'  <joint name="{prefix}{j.name}" type="{joint_type}">',
            f'    <parent link="{prefix}{parent}"/>',
            f'    <child link="{prefix}{j.link}"/>',
            f'    <origin xyz="{text(*j.origin)}" rpy="0 0 0"/>',
            f'    <axis xyz="{text(*j.axis)}"/>',
            f"    <limit {limit}/>",
            "  </joint>",
            f'  <link name="{prefix}{j.link}">',
            "    <inertial>",
            f'      <origin xyz="{text(*j.com)}" rpy="0 0 0"/>',
            f'      <mass value="{text(j.mass)}"/>',
            "      <inertia " + " ".join(f'{key}="{text(value)}"' for key, value in entries) + "/>",
            "    </inertial>",
            "  </link>",
        ]
        parent = j.link
    return "\n".join(lines) + "\n"


def urdf(arm=ARM, prefix="", joint_type="revolute", decimal=".", extra=""):
    root = f'  <link name="{prefix}{arm.base}"/>\n'
    body = urdf_body(arm, prefix, joint_type, decimal)
    return f'<?xml version="1.0"?>\n<robot name="{arm.name}">\n{root}{body}{extra}</robot>\n'


def mjcf(arm=ARM):
    """The arm as a MuJoCo model; `fullinertia` is in the order xx, yy, zz, xy, xz, yz."""

    def text(*values):
        return " ".join(f"{value:g}" for value in values)

    lines = []
    for j in arm.joints:
        xx, xy, xz, yy, yz, zz = j.inertia
        lines += [
            f'<body name="{j.link}" pos="{text(*j.origin)}">',
            f'<inertial mass="{text(j.mass)}" pos="{text(*j.com)}" fullinertia="{text(xx, yy, zz, xy, xz, yz)}"/>',
            f'<joint name="{j.name}" axis="{text(*j.axis)}"/>',
        ]
    body = "\n".join(lines + ["</body>"] * len(arm.joints))
    return f'<mujoco model="{arm.name}">\n<worldbody>\n{body}\n</worldbody>\n</mujoco>\n'


def rotation(axis, angle):
    """Rotation matrices about a unit axis (Rodrigues), one for each angle."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], float)
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + sine * cross + (1 - cosine) * (cross @ cross)


def inverse_dynamics(arm, q, qd, qdd):
    """Joint torques [N m] without friction: the recursive Newton-Euler algorithm, all rows at once.

    Each vector is in the frame of its link (Featherstone, Rigid Body Dynamics Algorithms, section 5.3).
    """
    rows = len(q)
    omega, alpha = np.zeros((rows, 3)), np.zeros((rows, 3))
    acceleration = np.tile([0.0, 0.0, GRAVITY_MPS2], (rows, 1))
    states = []
    for k, j in enumerate(arm.joints):
        axis, origin, com = np.array(j.axis, float), np.array(j.origin, float), np.array(j.com, float)
        turn = rotation(j.axis, q[:, k])
        at_joint = acceleration + np.cross(alpha, origin) + np.cross(omega, np.cross(omega, origin))
        omega_in, alpha_in, acceleration = (np.einsum("nji,nj->ni", turn, v) for v in (omega, alpha, at_joint))
        omega = omega_in + qd[:, k, None] * axis
        alpha = alpha_in + qdd[:, k, None] * axis + np.cross(omega_in, qd[:, k, None] * axis)
        ixx, ixy, ixz, iyy, iyz, izz = j.inertia
        inertia = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
        force = j.mass * (acceleration + np.cross(alpha, com) + np.cross(omega, np.cross(omega, com)))
        moment = alpha @ inertia + np.cross(omega, omega @ inertia)
        states.append((turn, axis, origin, com, force, moment))
    torques, force_on, moment_on = np.zeros_like(q), np.zeros((rows, 3)), np.zeros((rows, 3))
    for k in reversed(range(len(arm.joints))):
        turn, axis, origin, com, force, moment = states[k]
        force_on = force_on + force
        moment_on = moment_on + moment + np.cross(com, force)
        torques[:, k] = moment_on @ axis
        force_on = np.einsum("nij,nj->ni", turn, force_on)
        moment_on = np.einsum("nij,nj->ni", turn, moment_on) + np.cross(origin, force_on)
    return torques


def friction(arm, qd):
    coulomb = np.array([j.coulomb_nm for j in arm.joints])
    viscous = np.array([j.viscous_nms_per_rad for j in arm.joints])
    return coulomb * np.tanh(qd / SMOOTHING_RADPS) + viscous * qd
