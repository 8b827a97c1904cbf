"""A robot read from a URDF and handed to MuJoCo as rigid bodies with exactly the URDF's inertias.

Fixed joints are merged into the moving link before them.  Only serial or tree structures of revolute, continuous and
prismatic joints are read; meshes, transmissions and mimic joints are ignored.  SI units, gravity 9.81 m/s^2 along -z.
"""
import dataclasses
import os
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

GRAVITY = 9.81
MOVING = {"revolute": "hinge", "continuous": "hinge", "prismatic": "slide"}


def rpy_matrix(rpy):
    """Rotation of URDF roll, pitch, yaw (fixed axes x, y, z)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                     [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], [-sp, cp * sr, cp * cr]])


@dataclasses.dataclass
class Inertial:
    """Mass [kg], centre of mass [m] and inertia about it [kg m^2], all in the axes of one frame."""
    mass: float
    com: np.ndarray
    about_com: np.ndarray

    def seen_from(self, rotation, translation):
        return Inertial(self.mass, rotation @ self.com + translation, rotation @ self.about_com @ rotation.T)


def composite(parts):
    """One inertial out of several given in the same frame."""
    mass = sum(p.mass for p in parts)
    if mass <= 0:
        return Inertial(0., np.zeros(3), np.zeros((3, 3)))
    com = sum(p.mass * p.com for p in parts) / mass
    total = np.zeros((3, 3))
    for p in parts:
        d = p.com - com
        total += p.about_com + p.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertial(mass, com, total)


@dataclasses.dataclass
class Link:
    name: str
    body: int                  # index of the moving link it is fixed to, -1 for the base
    rotation: np.ndarray       # its frame in that moving link's frame
    translation: np.ndarray
    inertial: Inertial | None  # in its own frame


def numbers(text, default):
    return np.array([float(x) for x in (text or default).split()])


def pose(element):
    o = element.find("origin") if element is not None else None
    if o is None:
        return np.eye(3), np.zeros(3)
    return rpy_matrix(numbers(o.get("rpy"), "0 0 0")), numbers(o.get("xyz"), "0 0 0")


def read_inertial(link):
    e = link.find("inertial")
    if e is None:
        return None
    rotation, translation = pose(e)
    i = e.find("inertia")
    x = {k: float(i.get(k) or 0) for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    m = np.array([[x["ixx"], x["ixy"], x["ixz"]], [x["ixy"], x["iyy"], x["iyz"]], [x["ixz"], x["iyz"], x["izz"]]])
    return Inertial(float(e.find("mass").get("value")), translation, rotation @ m @ rotation.T)


class Robot:
    """The nominal robot: joints in the order of the URDF tree, links by name."""

    def __init__(self, path):
        self.path, self.name = path, os.path.splitext(os.path.basename(path))[0]
        root = ET.parse(path).getroot()
        elements = {e.get("name"): e for e in root.findall("link")}
        joints = root.findall("joint")
        children = {j.find("child").get("link") for j in joints}
        self.base = next(n for n in elements if n not in children)
        self.links, self.joints = {}, []
        self._walk(self.base, -1, np.eye(3), np.zeros(3), elements, joints)
        self.n = len(self.joints)
        self.names = [j["name"] for j in self.joints]
        self.lower, self.upper = (np.array([j[k] for j in self.joints]) for k in ("lower", "upper"))
        self.effort, self.speed = (np.array([j[k] for j in self.joints]) for k in ("effort", "velocity"))
        self.slides = np.array([j["kind"] == "slide" for j in self.joints])
        # The tool is the frame at the end of the chain: where a payload is held.
        ends = [l.name for l in self.links.values() if l.body == self.n - 1]
        self.tool = next((n for n in ("tool", "tool0") if n in ends), ends[-1])
        self.moving_links = [j["child"] for j in self.joints]
        self.nominal = Model(self)

    def _walk(self, name, body, rotation, translation, elements, joints):
        self.links[name] = Link(name, body, rotation, translation, read_inertial(elements[name]))
        for j in joints:
            if j.find("parent").get("link") != name:
                continue
            r, p = pose(j)
            r, p, child = rotation @ r, rotation @ p + translation, j.find("child").get("link")
            if j.get("type") == "fixed":
                self._walk(child, body, r, p, elements, joints)
                continue
            axis = j.find("axis")
            lim = j.find("limit")
            spin = j.get("type") == "continuous"
            self.joints.append(dict(
                name=j.get("name"), kind=MOVING[j.get("type")], parent=body, child=child, rotation=r, translation=p,
                axis=numbers(axis.get("xyz") if axis is not None else None, "1 0 0"),
                lower=-6.28 if spin else float(lim.get("lower") or 0), upper=6.28 if spin else float(lim.get("upper") or 0),
                effort=float(lim.get("effort")), velocity=float(lim.get("velocity"))))
            self._walk(child, len(self.joints) - 1, np.eye(3), np.zeros(3), elements, joints)

    def body_inertial(self, body, changed=None, added=()):
        """Inertial of one moving link with all that is fixed to it; `changed`: link name -> inertial in its own frame;
        `added`: (link name, inertial in its frame)."""
        changed = changed or {}
        parts = []
        for link in self.links.values():
            if link.body != body:
                continue
            own = [changed.get(link.name, link.inertial)] + [i for n, i in added if n == link.name]
            parts += [i.seen_from(link.rotation, link.translation) for i in own if i is not None]
        return composite(parts)

    def stripped_urdf(self):
        """The URDF without meshes, shapes and transmissions."""
        tree = ET.parse(self.path)
        root = tree.getroot()
        for e in list(root):
            if e.tag not in ("link", "joint"):
                root.remove(e)
        for e in root.findall("link"):
            for tag in ("visual", "collision"):
                for x in e.findall(tag):
                    e.remove(x)
        ET.indent(tree)
        return ET.tostring(root, encoding="unicode") + "\n"


class Model:
    """A compiled MuJoCo model of the robot, nominal or changed, with the few calls the plant and its truth need."""

    def __init__(self, robot, changed=None, added=(), rotor=None, tilt=(0., 0.)):
        self.robot, self.n = robot, len(robot.joints)
        # Base frame rolled about x, then pitched about y (fixed axes): gravity in the base frame is R^T g.
        g = rpy_matrix((tilt[0], tilt[1], 0.)).T @ np.array([0., 0., -GRAVITY])
        self.model = mujoco.MjModel.from_xml_string(self._mjcf(changed, added, rotor or {}, g))
        self.data = mujoco.MjData(self.model)

    def _mjcf(self, changed, added, rotor, gravity):
        fmt = lambda v: " ".join(repr(float(x)) for x in np.ravel(v))
        r = self.robot

        def body(i):
            j, m = r.joints[i], r.body_inertial(i, changed, added)
            q = np.zeros(4)
            mujoco.mju_mat2Quat(q, np.ascontiguousarray(j["rotation"]).ravel())
            full = [m.about_com[a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
            inner = "".join(body(k) for k in range(self.n) if r.joints[k]["parent"] == i)
            return (f'<body name="b{i}" pos="{fmt(j["translation"])}" quat="{fmt(q)}">'
                    f'<inertial pos="{fmt(m.com)}" mass="{float(m.mass)!r}" fullinertia="{fmt(full)}"/>'
                    f'<joint name="j{i}" type="{j["kind"]}" axis="{fmt(j["axis"])}" armature="{float(rotor.get(i, 0.))!r}"/>{inner}</body>')

        tree = "".join(body(k) for k in range(self.n) if r.joints[k]["parent"] < 0)
        return (f'<mujoco><compiler angle="radian" autolimits="false"/><option gravity="{fmt(gravity)}">'
                f'<flag constraint="disable"/></option><worldbody>{tree}</worldbody></mujoco>')

    def rnea(self, q, v, a):
        """Torques [N m] or forces [N] of the motion, samples x joints."""
        out, d = np.empty_like(q), self.data
        for k in range(len(q)):
            d.qpos[:], d.qvel[:], d.qacc[:] = q[k], v[k], a[k]
            mujoco.mj_inverse(self.model, d)
            out[k] = d.qfrc_inverse
        return out

    def inertias(self, q):
        """Joint-space inertia matrices (samples x n x n) at the poses q."""
        out = np.zeros((len(q), self.n, self.n))
        for k, x in enumerate(q):
            self.data.qpos[:] = x
            mujoco.mj_forward(self.model, self.data)
            mujoco.mj_fullM(self.model, self.data, out[k])
        return out

    def frame(self, data, link, jac):
        """World position of a link's frame; its translational Jacobian (3 x n) goes into jac.  Needs current kinematics."""
        l = self.robot.links[link]
        b = l.body + 1
        p = data.xpos[b] + data.xmat[b].reshape(3, 3) @ l.translation
        mujoco.mj_jac(self.model, data, jac, None, p, b)
        return p

    def frames(self, q, link):
        """Positions (samples x 3) and Jacobians (samples x 3 x n) of a link's frame."""
        P, J, jac = np.empty((len(q), 3)), np.empty((len(q), 3, self.n)), np.zeros((3, self.n))
        for k in range(len(q)):
            self.data.qpos[:] = q[k]
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            P[k] = self.frame(self.data, link, jac)
            J[k] = jac
        return P, J
