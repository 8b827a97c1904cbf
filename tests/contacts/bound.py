"""How well the touched link can be told from joint torques at all: hands as those of paths.py on an arm whose noise is known, judged by
Bayes' rule with the very distribution that they are drawn from. No detector can name more of them on average.

    bound.py SET.yaml LEARNT.yaml [HANDS] [SEED] [NOISE]

SET is a set of recordings in N m; postures come from its test recordings. LEARNT is `learnt.yaml` as `tauscope evaluate` writes it for
the detector `tauscope`: the noise is that of the means over 0.2 s, as the detector learnt it, times NOISE (1). HANDS are drawn for each
link (400). Prints Markdown: by link and direction of the force, how often the most probable link is the touched one, how often it is
within one of it, and how often the touched one is one of the two most probable.
"""
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import yaml
from mcap.reader import make_reader

LINKS = ["link3", "link4", "link5", "link6"]
# A force of log-uniform strength from any side is a mixture of isotropic normal ones, nearly: their standard deviations [N].
STRENGTHS_N = np.exp(np.linspace(np.log(4.5), np.log(26), 6))
# Places on a link that its evidence is the mean of.
PLACES = 240
ALONG, ACROSS = "along the link", "across it"


class Arm:
    """Kinematics of the movable joints of a chain."""

    def __init__(self, path):
        root = ET.parse(path).getroot()
        self.joints = [joint for joint in root.findall("joint") if joint.get("type") in ("revolute", "continuous")]
        self.names = [joint.get("name") for joint in self.joints]
        self.links = [joint.find("child").get("link") for joint in self.joints]
        self.origins = [transform(joint.find("origin")) for joint in self.joints]
        self.axes = [numbers(joint.find("axis").get("xyz")) for joint in self.joints]
        inertials = {link.get("name"): link.find("inertial/origin") for link in root.findall("link")}
        self.centres = {name: numbers(origin.get("xyz")) for name, origin in inertials.items() if origin is not None}
        fixed = {joint.find("parent").get("link"): joint for joint in root.findall("joint")}
        self.ends = {link: numbers(fixed[link].find("origin").get("xyz")) if link in fixed else np.zeros(3) for link in self.links}

    def frames(self, position):
        """Of each movable link, its pose; and of each joint, its axis and origin in the world."""
        pose, poses = np.eye(4), []
        for origin, axis, angle in zip(self.origins, self.axes, position):
            pose = pose @ origin @ turn(axis, angle)
            poses.append(pose)
        return poses

    def jacobians(self, poses, link, points):
        """How points of a link, in its frame, move by 1 rad/s of each joint: (points, joints, 3)."""
        at = self.links.index(link)
        world = points @ poses[at][:3, :3].T + poses[at][:3, 3]
        moved = np.zeros((len(points), len(poses), 3))
        for joint in range(at + 1):
            axis = poses[joint][:3, :3] @ self.axes[joint]
            moved[:, joint] = np.cross(axis, world - poses[joint][:3, 3])
        return moved


def numbers(text):
    return np.array([float(x) for x in text.split()])


def turn(axis, angle):
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    pose = np.eye(4)
    pose[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return pose


def transform(origin):
    pose = np.eye(4)
    if origin is not None:
        roll, pitch, yaw = numbers(origin.get("rpy", "0 0 0"))
        pose = turn(np.array([0, 0, 1]), yaw) @ turn(np.array([0, 1, 0]), pitch) @ turn(np.array([1, 0, 0]), roll)
        pose[:3, 3] = numbers(origin.get("xyz", "0 0 0"))
    return pose


def positions(path, topic, names):
    """Positions of all joint states of a recording, in this order of joints (CDR, little-endian)."""
    rows = []
    with open(path, "rb") as file:
        for _, _, message in make_reader(file).iter_messages(topics=[topic]):
            data, at = message.data[4:], 8
            length = int.from_bytes(data[at:at + 4], "little")
            at = (at + 4 + length + 3) // 4 * 4
            count, at, found = int.from_bytes(data[at:at + 4], "little"), at + 4, []
            for _ in range(count):
                length = int.from_bytes(data[at:at + 4], "little")
                found.append(data[at + 4:at + 3 + length].decode())
                at = (at + 4 + length + 3) // 4 * 4
            at = (at + 4 + 7) // 8 * 8
            values = np.frombuffer(data, "<f8", len(found), at)
            rows.append([values[found.index(name)] for name in names])
    return np.array(rows)


def units(rng, count):
    directions = rng.normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def places(rng, arm, link, count):
    """Where a hand touches a link, in its frame: as in paths.py."""
    along = (np.linalg.norm(arm.ends[link]) > 0.02) & (rng.uniform(size=(count, 1)) < 0.5)
    middle = np.where(along, arm.ends[link] * rng.uniform(size=(count, 1)), arm.centres[link])
    return middle + units(rng, count) * rng.uniform(0.03, 0.06, size=(count, 1))


def evidence(whitener, moved, residual):
    """Logarithm of a residual's probability, but for a constant, where any of these places may be touched."""
    pulls = np.einsum("ij,pjk->pik", whitener, moved)
    values, vectors = np.linalg.eigh(np.einsum("pik,pil->pkl", pulls, pulls))
    parts = np.einsum("pkl,pik,i->pl", vectors, pulls, whitener @ residual) ** 2
    variances = STRENGTHS_N[:, None, None] ** 2
    grown = 1 + variances * np.maximum(values, 0)
    logs = 0.5 * (variances * parts / grown - np.log(grown)).sum(-1)
    most = logs.max()
    return most + np.log(np.exp(logs - most).mean())


def direction_class(arm, poses, link, force):
    """Whether a force points more along the link than across it; a link without length has the axis of its joint."""
    at, end = arm.links.index(link), arm.ends[link]
    axis = poses[at][:3, :3] @ (end if np.linalg.norm(end) > 0.02 else arm.axes[at])
    return ALONG if abs(axis @ force) > np.sqrt(0.5) * np.linalg.norm(axis) * np.linalg.norm(force) else ACROSS


def told(arm, postures, covariance, hands, rng):
    """By touched link and direction, of each hand the links from the most probable one on."""
    whitener = np.linalg.inv(np.linalg.cholesky(covariance))
    rows = []
    for link in LINKS:
        for _ in range(hands):
            poses = arm.frames(postures[rng.integers(len(postures))])
            force = np.exp(rng.uniform(np.log(7), np.log(45))) * units(rng, 1)[0]
            torque = arm.jacobians(poses, link, places(rng, arm, link, 1))[0] @ force
            residual = torque + rng.multivariate_normal(np.zeros(len(torque)), covariance)
            logs = [evidence(whitener, arm.jacobians(poses, other, places(rng, arm, other, PLACES)), residual) for other in LINKS]
            rows.append((link, direction_class(arm, poses, link, force), [LINKS[i] for i in np.argsort(logs)[::-1]]))
    return rows


def line(name, direction, rows):
    away = np.array([abs(LINKS.index(link) - LINKS.index(order[0])) for link, _, order in rows])
    either = np.array([link in order[:2] for link, _, order in rows])
    shares = [f"{100 * share:.0f} %" for share in ((away == 0).mean(), (away <= 1).mean(), either.mean())]
    return f"| {name} | {direction} | {len(rows)} | {' | '.join(shares)} |"


def noise_of(learnt):
    """Covariance of the mean residual over the longest window, at the speeds that are seen most."""
    window = learnt["windows"][-1]
    noise = np.median(np.array(window["noise"]), axis=1)
    correlation = np.linalg.inv(np.array(window["inverse_correlation"]).reshape(len(noise), -1))
    return correlation * np.outer(noise, noise)


def main():
    path, learnt = Path(sys.argv[1]), yaml.safe_load(Path(sys.argv[2]).read_text())
    hands, seed, share = [*map(float, sys.argv[3:6]), *[400, 1, 1][len(sys.argv[3:6]):]]
    spec, rng = yaml.safe_load(path.read_text()), np.random.default_rng(int(seed))
    if spec.get("effort_unit", "Nm") != "Nm":
        sys.exit("the bound is for efforts in N m")
    arm = Arm(path.parent / spec["robot"])
    topic = spec.get("topics", {}).get("state", "/joint_states")
    postures = np.vstack([positions(path.parent / recording, topic, arm.names)[::20] for recording in spec["test"]])
    rows = told(arm, postures, share**2 * noise_of(learnt["tauscope"]["tauscope"]["learnt"]), int(hands), rng)
    print("| link | force | hands | exact | within one | one of two |\n| --- | --- | --- | --- | --- | --- |")
    for link in LINKS:
        for direction in (ALONG, ACROSS):
            print(line(link, direction, [row for row in rows if row[:2] == (link, direction)]))
    print(line("all", "any", rows))


if __name__ == "__main__":
    main()
