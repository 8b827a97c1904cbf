"""The concealed arm: MuJoCo's rigid bodies under a controller at 1 kHz, integrated at 4 kHz, with the concealed effects.

One step: accelerations without friction from MuJoCo, then the velocities at the end of the step with friction solved
implicitly (it is nearly a jump at zero speed), then the positions.  Where a joint is elastic or has backlash its motor is a
second mass, integrated here; its encoder sits on the motor.
"""
import dataclasses
import math

import mujoco
import numpy as np

import shop_floor
from effects import BODY, FIELD, FRICTION, TWO_MASS, WRENCH, active, bristle, formula, merged
from robot import Model

STEPS = 4                # per control period
DT = 1. / 4000.
WARM_UP = 1.0            # s held at the first pose before the recording starts


@dataclasses.dataclass
class Log:
    """States and torques at 1 kHz, samples x joints: encoder side and link side (they differ in two-mass joints)."""
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    q_link: np.ndarray
    v_link: np.ndarray
    a_link: np.ndarray
    torque: np.ndarray      # motor effort at the joint side of the gear
    command: np.ndarray     # commanded positions
    lost: np.ndarray        # what the drives did not deliver of `torque`
    trouble: str | None     # why the recording is no good


def implicit(f, free, weight):
    """Speed x with x = free + weight f(x), f falling or nearly so."""
    g = f(free)
    x = free + weight * g
    for _ in range(3):
        y = free + weight * f(x)
        if abs(y - x) < 1e-11:
            return y
        x = y
    a, b = free, free + 3. * weight * g
    fa, fb = a - free - weight * f(a), b - free - weight * f(b)
    if fa * fb > 0:
        return x
    for _ in range(60):                                   # Illinois variant of regula falsi
        c = (a * fb - b * fa) / (fb - fa)
        fc = c - free - weight * f(c)
        if abs(fc) < 1e-11 or abs(b - a) < 1e-12:
            break
        if fc * fb < 0:
            a, fa = b, fb
        else:
            fa *= 0.5
        b, fb = c, fc
    return c


class Plant:
    """The arm with its effects; `record` runs one recording."""

    def __init__(self, robot, effects, commands):
        self.robot, self.effects, self.n = robot, effects, robot.n
        always = [e for e in effects if e["effect"] in (*BODY, "rotor_inertia") and e["effect"] != "payload_pickup"]
        held = [e for e in effects if e["effect"] == "payload_pickup"]
        self.model = Model(robot, **merged(robot, always))
        self.loaded = Model(robot, **merged(robot, always + held)) if held else None
        self.pickup = held[0] if held else None
        self.armature = self.model.model.dof_armature.copy()
        at = lambda e: robot.names.index(e["joint"])
        self.two = [(at(e), e) for e in effects if e["effect"] in TWO_MASS]
        self.rubbing, self.fields = {}, []
        for e in effects:
            if e["effect"] == "presliding_hysteresis" or formula(e) in FRICTION:
                self.rubbing.setdefault(at(e), []).append(e)
            elif formula(e) in FIELD:
                self.fields.append((at(e), FIELD[formula(e)], e["parameters"]))
        self.wrenches = [e for e in effects if e["effect"] in WRENCH]
        self.clip = [(at(e), e["parameters"]["limit_nm"]) for e in effects
                     if e["effect"] == "torque_saturation" and e["parameters"]["mode"] == "actuator"]
        self.deaf = [(at(e), e["parameters"]) for e in effects if formula(e) == shop_floor.DRIVE]
        self.encoders = [(at(e), e["parameters"]) for e in effects if formula(e) == shop_floor.ENCODER]
        self.kp, self.kd, self.ki = self._gains(np.concatenate([q[::500] for q in commands]))

    def _gains(self, poses):
        """Gains from the inertia each motor sees with the other joints free, stiff enough for friction not to move the joint
        far, and damped little enough for 1 kHz."""
        M = self.model.inertias(poses)
        for j, e in self.two:
            M[:, j, j] += e["parameters"]["rotor_inertia_kgm2"]
        seen = 1. / np.diagonal(np.linalg.inv(M), axis1=1, axis2=2)
        kp = np.clip(self.robot.effort, 25.**2 * seen.mean(0), 250.**2 * seen.min(0))
        kd = 1.8 * np.sqrt(kp * seen.mean(0))
        fastest = np.abs(np.linalg.eigvals(np.linalg.solve(M, np.broadcast_to(np.diag(kd), M.shape)))).max()
        ease = min(1., 650. / fastest)
        return ease**2 * kp, ease * kd, 1.5 * ease**2 * kp

    def record(self, name, command, session_start):
        """Run one recording whose commanded positions are given at 1 kHz."""
        from motion import derivatives
        n, robot, total = self.n, self.robot, len(command)
        speed, accel = derivatives(command)
        forward = robot.nominal.rnea(command, speed, accel)
        hold = int(WARM_UP * 1000)
        model, data = self.model, self.model.data
        q, v = command[0].copy(), np.zeros(n)
        motors = {j: [q[j], 0., 0.] for j, _ in self.two}          # position, speed, acceleration
        state = {"z": {}, "load": dict.fromkeys(self.rubbing, 0.)}
        integral, encoder, rate = np.zeros(n), q.copy(), np.zeros(n)
        out = {k: np.empty((total, n)) for k in ("q", "v", "a", "ql", "vl", "al", "tau", "lost")}
        jac, unit, columns = np.zeros((3, n)), np.zeros((1, n)), {j: np.zeros((1, n)) for j in self.rubbing}
        dots = {j: 0. for j in self.rubbing}
        data.qpos[:] = q
        mujoco.mj_forward(model.model, data)
        trouble, since = None, shop_floor.since_start(command, 1e-3)
        for k in range(-hold, total):
            i, t0 = max(k, 0), k * 1e-3
            for j, p in self.encoders:
                encoder[j], rate[j], _ = shop_floor.read(p, encoder[j], rate[j], 0.)
            for j, m in motors.items():
                encoder[j], rate[j] = m[0], m[1]
            e = command[i] - encoder
            integral += e * self.ki * 1e-3
            moving = 1. if k >= 0 else 0.
            torque = forward[i] + self.kp * e + self.kd * (moving * speed[i] - rate) + integral
            if (np.abs(torque) > robot.effort).any() and k > -hold // 2:
                trouble = "a motor saturates"
                break
            applied = torque.copy()
            for j, limit in self.clip:
                applied[j] = min(max(applied[j], -limit), limit)
            for j, p in self.deaf:
                applied[j] = shop_floor.delivered(p, applied[j])
            if self.loaded:
                now = self.loaded if active(self.pickup, name, t0) else self.model
                if now is not model:
                    model, data = now, now.data
                    data.qpos[:], data.qvel[:] = q, v
                    mujoco.mj_forward(model.model, data)
            pushes = [w for w in self.wrenches if w["effect"] == "contact_wall" or active(w, name, t0)]
            for step in range(STEPS):
                t = t0 + step * DT
                tau = applied.copy()
                for j, law in self.two:
                    tau[j] = self._transmit(j, law, motors[j], q[j], v[j], applied[j])
                for j, law, p in self.fields:
                    tau[j] += law(p, math, q[j], v[j], session=session_start + t)
                for w in pushes:
                    tau += self._wrench(w, model, data, jac)
                data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, tau
                mujoco.mj_forward(model.model, data)
                new = v + DT * data.qacc
                if self.rubbing:
                    new = self._rub(new, q, v, tau, model, data, state, columns, dots, unit, max(t, 0.), session_start + t, since[i])
                acceleration = (new - v) / DT
                if step == 0 and k >= 0:
                    for key, value in (("ql", q), ("vl", new), ("al", acceleration), ("tau", torque),
                                       ("q", q), ("v", new), ("a", acceleration)):
                        out[key][k] = value
                    for j, m in motors.items():
                        out["q"][k, j], out["v"][k, j], out["a"][k, j] = m[3], m[1], m[2]
                    for j, p in self.encoders:
                        out["q"][k, j], out["v"][k, j], out["a"][k, j] = shop_floor.read(p, q[j], new[j], acceleration[j])
                    out["lost"][k] = torque - applied
                for j in self.rubbing:                     # what the gear carries, friction aside
                    state["load"][j] = tau[j] + dots[j] - self.armature[j] * acceleration[j]
                v = new
                q = q + DT * v
            encoder[:], rate[:] = q, v
            if not np.isfinite(q).all() or np.abs(q - command[i]).max() > 0.35:
                trouble = "lost track"
                break
        t = np.arange(total) * 1e-3
        return Log(t, out["q"], out["v"], out["a"], out["ql"], out["vl"], out["al"], out["tau"], command, out["lost"], trouble)

    @staticmethod
    def _transmit(j, effect, motor, q, v, torque):
        """Torque the gear passes on; moves the motor one step on."""
        p = effect["parameters"]
        twist, slip = motor[0] - q, motor[1] - v
        if effect["effect"] == "backlash":
            half = 0.5 * p["gap_rad"]
            depth = twist - min(max(twist, -half), half)
            passed = effect["flank_stiffness"] * depth + effect["flank_damping"] * slip if depth else 0.
            passed = passed if passed * depth > 0 else 0.
        else:
            passed = p["stiffness_nm_per_rad"] * twist + effect["damping"] * slip
        before = motor[0]
        acceleration = (torque - passed) / p["rotor_inertia_kgm2"]
        speed = motor[1] + DT * acceleration
        motor[:] = [before + DT * speed, speed, acceleration, before]
        return passed

    @staticmethod
    def _wrench(effect, model, data, jac):
        p = effect["parameters"]
        place = model.frame(data, effect["link"] if effect["effect"] == "external_push" else model.robot.moving_links[-1], jac)
        if effect["effect"] == "external_push":
            return jac.T @ np.array([p["force_x_n"], p["force_y_n"], p["force_z_n"]])
        normal = np.array([p["normal_x"], p["normal_y"], p["normal_z"]])
        depth = normal @ place - p["offset_m"]
        return -p["stiffness_n_per_m"] * max(depth, 0.) * (jac.T @ normal)

    def _rub(self, free, q, v, tau, model, data, state, columns, friction, unit, t, session, since):
        """Speeds at the end of the step with friction: sweeps over the rubbing joints, each solved for its own speed."""
        laws = {}
        for j, effects in self.rubbing.items():
            unit[:] = 0.
            unit[0, j] = 1.
            mujoco.mj_solveM(model.model, data, columns[j], unit)
            load = state["load"][j]

            def law(x, j=j, effects=effects, load=load):
                total = 0.
                for e in effects:
                    p = e["parameters"]
                    if e["effect"] == "presliding_hysteresis":
                        total += bristle(p, state["z"].get(j, 0.), x, DT)[1]
                        continue
                    other = v[self.robot.names.index(p["source_joint"])] if "source_joint" in p else 0.
                    total += FRICTION[formula(e)](p, math, q[j], x, t=t, session=session, load=load, other=other, since=since[j])
                return total

            laws[j] = law
            friction[j] = 0.
        new = free.copy()
        for _ in range(3 if len(laws) > 1 else 1):
            for j, law in laws.items():
                column = columns[j][0]
                weight = DT * column[j]
                x = implicit(law, float(new[j] - weight * friction[j]), weight)
                force = law(x)
                new += DT * column * (force - friction[j])
                friction[j] = force
        for j, effects in self.rubbing.items():
            for e in effects:
                if e["effect"] == "presliding_hysteresis":
                    state["z"][j] = bristle(e["parameters"], state["z"].get(j, 0.), new[j], DT)[0]
        return new
