"""Arms of three or four joints, drawn from a seed: small enough that a case of them is explained in a second or two."""
import numpy as np

GRAVITY = 9.81


def inertia(mass, size):
    """Principal inertias [kg m^2] of a solid box with these sides [m]."""
    x, y, z = np.square(size)
    return mass / 12. * np.array([y + z, x + z, x + y])


def urdf(name, rng):
    """URDF text of an arm: a vertical axis, two horizontal ones, and mostly a fourth; a massless frame `tool` at its end."""
    joints = 3 + int(rng.random() < 0.3)
    length = rng.uniform(0.22, 0.42, joints) * 0.85**np.arange(joints)
    length[0] = rng.uniform(0.1, 0.2)
    mass = rng.uniform(4., 8.) * rng.uniform(0.45, 0.7)**np.arange(joints)
    axes = ["0 0 1", "0 1 0", "0 1 0", str(rng.choice(["1 0 0", "0 1 0", "0 0 1"]))]
    parts = [f'<robot name="{name}">', '<link name="base"/>']
    for j in range(joints):
        origin = "0 0 0.1" if j == 0 else f"0 0 {length[0]:.4f}" if j == 1 else f"{length[j - 1]:.4f} 0 0"
        # What the joint holds at most, all links stretched out, and half as much again for motion.
        reach = np.cumsum(length[max(j, 1):]) - 0.5 * length[max(j, 1):]
        effort = 2.2 * GRAVITY * float(mass[max(j, 1):] @ reach) + 6.
        centre = rng.uniform(-0.02, 0.02, 3) + ([0., 0., 0.5 * length[0]] if j == 0 else [0.45 * length[j], 0., 0.])
        size = [0.1, 0.1, length[0]] if j == 0 else [length[j], 0.07, 0.07]
        ixx, iyy, izz = inertia(mass[j], size)
        parts += [
            f'<joint name="j{j + 1}" type="revolute"><parent link="{"base" if j == 0 else f"link{j}"}"/><child link="link{j + 1}"/>'
            f'<origin xyz="{origin}" rpy="0 0 0"/><axis xyz="{axes[j]}"/>'
            f'<limit lower="-2.4" upper="2.4" effort="{effort:.2f}" velocity="{rng.uniform(1.8, 3.):.2f}"/></joint>',
            f'<link name="link{j + 1}"><inertial><origin xyz="{centre[0]:.4f} {centre[1]:.4f} {centre[2]:.4f}" rpy="0 0 0"/>'
            f'<mass value="{mass[j]:.4f}"/><inertia ixx="{ixx:.6f}" ixy="0" ixz="0" iyy="{iyy:.6f}" iyz="0" izz="{izz:.6f}"/></inertial></link>']
    parts += [f'<joint name="mount" type="fixed"><parent link="link{joints}"/><child link="tool"/>'
              f'<origin xyz="{length[-1]:.4f} 0 0" rpy="0 0 0"/></joint>', '<link name="tool"/>', "</robot>"]
    return "\n".join(parts) + "\n"
