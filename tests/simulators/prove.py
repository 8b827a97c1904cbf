"""Proof in the simulator itself: what `explain` writes into a MuJoCo model, simulated again.

    python3 tests/simulators/prove.py TAUSCOPE OUT [--cases arm7,folded] [--check] [--table]

Needs requirements.txt. Each case is a model of models/ in which three things are changed in secret: the plant. It follows motions under a
controller of joint torques, and is recorded: positions, velocities and efforts with noise, 250 Hz. `explain` gets the model without the
changes and the recordings, and writes robot.xml. Then, for the recording that nothing was fitted on:

- inverse dynamics: RMS of the recorded effort less that of MuJoCo, Pinocchio and Drake along the motion, with the model as it was and as
  it was written, beside what the report says. Pinocchio and Drake read URDFs that `export` writes;
- rollout: the model under the recorded commands and the same controller; RMS of its positions less the measured ones.

What is there already is not made again.
"""
import argparse
import dataclasses
import json
import pathlib
import shutil
import subprocess
import sys
import time

import mujoco
import numpy as np

import elsewhere

sys.path.append(str(pathlib.Path(__file__).parents[1] / "proof"))
import record

MODELS = pathlib.Path(__file__).parent / "models"
RATE_HZ, STEP_S, LENGTH_S, RECORDINGS = 250, 0.001, 14., 5
HELD_OUT = RECORDINGS - 1
# Stamp of the first message.
START_NS = 1_700_000_000 * 10**9
# Slower rows are no part of the comparison of inverse dynamics: elsewhere.py takes the sign of the velocity, MuJoCo a ramp [rad/s or m/s].
MOVING = 0.1

# By case: the model, and what is changed in the plant: (attribute, joint or body, what is added). Of the recording alone are `gain`, a
# factor of a joint's effort, and `delay`, by which all efforts come late [s].
CASES = {
    "arm7": ("arm7", [("frictionloss", "j2", 2.5), ("armature", "j4", 0.25), ("mass", "flange", 1.4)]),
    "arm7_spring": ("arm7", [("stiffness", "j3", 9.), ("damping", "j1", 4.), ("frictionloss", "j6", 0.8)]),
    "folded": ("folded", [("mass", "turn", 0.5), ("damping", "elbow", 0.8), ("frictionloss", "shoulder", 1.5)]),
    "gantry": ("gantry", [("frictionloss", "rail", 15.), ("damping", "tilt", 0.6), ("mass", "boom", 0.7)]),
    "quadruped": ("quadruped", [("frictionloss", "FL_knee", 0.6), ("armature", "RR_hip", 0.03), ("mass", "RL_calf", 0.25)]),
    "arm7_zero": ("arm7", [("ref", "j4", 0.04), ("frictionloss", "j1", 2.), ("damping", "j5", 0.9)]),
    "arm7_recording": ("arm7", [("gain", "j2", 0.9), ("delay", "all", 0.016), ("armature", "j3", 0.3)]),
}


@dataclasses.dataclass
class Run:
    """A recording: rows of time, position, velocity, acceleration and effort, the joints in the model's order."""
    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    effort: np.ndarray


def load(path):
    m = mujoco.MjModel.from_xml_path(str(path))
    m.opt.timestep = STEP_S
    # The controller's torques take the place of the model's own drives.
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT) | int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    return m


def concealed(m, changes):
    """The model with the changes."""
    for attribute, name, more in changes:
        if attribute in ("gain", "delay"):
            continue
        if attribute == "ref":
            m.qpos0[m.jnt_qposadr[m.joint(name).id]] += more
        elif attribute == "mass":
            body = m.body(name).id
            # The body gets denser: mass and inertia grow by the same factor.
            scale = 1 + more / m.body_mass[body]
            m.body_mass[body] *= scale
            m.body_inertia[body] *= scale
        else:
            joint = m.joint(name).id
            dof = m.jnt_dofadr[joint]
            {"frictionloss": m.dof_frictionloss, "damping": m.dof_damping, "armature": m.dof_armature}.get(
                attribute, m.jnt_stiffness)[joint if attribute == "stiffness" else dof] += more
    mujoco.mj_setConst(m, mujoco.MjData(m))
    return m


class Controller:
    """Joint torques of a PD controller with the gravity of the model as it was, as a robot's own controller has it."""

    def __init__(self, nominal):
        d = mujoco.MjData(nominal)
        full = np.zeros((nominal.nv, nominal.nv))
        mujoco.mj_forward(nominal, d)
        mujoco.mj_fullM(nominal, full, d.qM) if hasattr(d, "qM") else mujoco.mj_fullM(nominal, d, full)
        inertia = np.diag(full)
        self.kp, self.kd = inertia * 25.0**2, inertia * 2 * 0.9 * 25.0
        self.nominal, self.data = nominal, mujoco.MjData(nominal)

    def torque(self, q, v, command):
        self.data.qpos[:], self.data.qvel[:] = q, 0
        mujoco.mj_fwdPosition(self.nominal, self.data)
        mujoco.mj_fwdVelocity(self.nominal, self.data)
        return self.kp * (command - q) - self.kd * v + self.data.qfrc_bias


def commands(m, rng):
    """Finite Fourier series of each joint within its range [rad or m], by step."""
    t = np.arange(int(LENGTH_S / STEP_S)) * STEP_S
    out = np.empty((len(t), m.nv))
    for j in range(m.njnt):
        low, high = m.jnt_range[j] if m.jnt_limited[j] else (-1.5, 1.5)
        wave = sum(rng.uniform(0.3, 1) / (k + 1) * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28))
                   for k, f in enumerate(rng.uniform((0.08, 0.2, 0.4), (0.15, 0.35, 0.7))))
        out[:, j] = (low + high) / 2 + 0.32 * (high - low) * wave / np.abs(wave).max()
    return out


def simulate(m, controller, command):
    """The motion of a model under commands."""
    d = mujoco.MjData(m)
    d.qpos[:] = command[0]
    every, rows = int(round(1 / RATE_HZ / STEP_S)), []
    for k, at in enumerate(command):
        d.qfrc_applied[:] = controller.torque(d.qpos, d.qvel, at)
        mujoco.mj_forward(m, d)
        if k % every == 0:
            rows.append((k * STEP_S, d.qpos.copy(), d.qvel.copy(), d.qacc.copy(), d.qfrc_applied.copy()))
        mujoco.mj_step(m, d)
    return Run(*(np.array(x) for x in zip(*rows)))


def write(path, m, run, rng, changes=(), command=None):
    """A table with noise of encoders and sensors, and the changes of the recording. With commands, the same as messages, too.
    Gives the efforts without the changes of the recording."""
    names = [m.joint(j).name for j in range(m.njnt)]
    size = np.sqrt(np.mean(run.effort**2, 0))
    q = run.position + 1e-5 * rng.standard_normal(run.position.shape)
    v = run.velocity + 1e-3 * rng.standard_normal(run.position.shape)
    e = run.effort + 0.005 * size * rng.standard_normal(run.position.shape)
    measured = e.copy()
    for attribute, name, value in changes:
        if attribute == "gain":
            e[:, m.joint(name).id] *= value
        elif attribute == "delay":
            e = np.array([np.interp(run.time - value, run.time, column) for column in e.T]).T
    head = ["time"] + [f"{n}.{kind}" for n in names for kind in ("position", "velocity", "effort")]
    body = np.column_stack([run.time] + [x[:, j] for j in range(m.njnt) for x in (q, v, e)])
    np.savetxt(path, body, delimiter=",", header=",".join(head), comments="", fmt="%.9g")
    if command is not None:
        every = int(round(1 / RATE_HZ / STEP_S))
        stamps_ns = START_NS + np.rint(run.time * 1e9).astype(int)
        record.write(path.with_suffix(".mcap"), names, stamps_ns, q, v, e, command[::every])
    return measured


def make(out, name, seed):
    """Recordings of a case."""
    model, changes = CASES[name]
    folder = out / name
    folder.mkdir(parents=True, exist_ok=True)
    for file in MODELS.glob(f"{model}*.xml"):
        shutil.copy(file, folder)
    controller = Controller(load(MODELS / f"{model}.xml"))
    plant = concealed(load(MODELS / f"{model}.xml"), changes)
    rng = np.random.default_rng(seed)
    for k in range(RECORDINGS):
        command = commands(plant, rng)
        run = simulate(plant, controller, command)
        measured = write(folder / f"rec_{k}.csv", plant, run, rng, changes, command if k == HELD_OUT else None)
        np.savez_compressed(folder / f"rec_{k}.npz", command=command, measured=measured, **dataclasses.asdict(run))


def explain(program, folder, model):
    fit = [str(folder / f"rec_{k}.csv") for k in range(RECORDINGS) if k != HELD_OUT]
    command = [program, "explain", "--fit", *fit, "--holdout", str(folder / f"rec_{HELD_OUT}.mcap"), "--robot",
               str(folder / f"{model}.xml"), "--command-topic", "/joint_commands", "--out", str(folder / "report"), "--force"]
    begin = time.time()
    subprocess.run(command, check=True, capture_output=True, text=True)
    (folder / "seconds.json").write_text(json.dumps(time.time() - begin))


def names_of(m):
    return [m.joint(j).name for j in range(m.njnt)]


def recorded(path, m):
    """Positions, velocities and efforts of a recording."""
    with open(path) as file:
        names = file.readline().strip().split(",")
    rows = np.loadtxt(path, delimiter=",", skiprows=1)
    return [rows[:, [names.index(f"{name}.{kind}") for name in names_of(m)]] for kind in ("position", "velocity", "effort")]


def rms(x, axis=None):
    return np.sqrt(np.mean(np.square(x), axis))


def by_mujoco(m, run):
    """Efforts that a motion needs, rows by joints."""
    d, efforts = mujoco.MjData(m), []
    for q, v, a in zip(run.position, run.velocity, run.acceleration):
        d.qpos[:], d.qvel[:], d.qacc[:] = q, v, a
        mujoco.mj_inverse(m, d)
        efforts.append(d.qfrc_inverse.copy())
    return np.array(efforts)


def export(program, folder, target):
    """The written model as a URDF for another simulator."""
    path = folder / "report" / f"{target}.urdf"
    command = [program, "export", str(folder / "report"), "--to", target, "--out", str(path), "--force"]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return path


def judge(program, folder, name):
    """Errors of a case on its held-out recording: as it was, and as it was written."""
    model, changes = CASES[name]
    kept = np.load(folder / f"rec_{HELD_OUT}.npz")
    run = Run(*(kept[f.name] for f in dataclasses.fields(Run)))
    controller = Controller(load(folder / f"{model}.xml"))
    report = json.loads((folder / "report" / "report.json").read_text())
    written = folder / "report" / "robot.xml"
    before, after = load(folder / f"{model}.xml"), load(written)
    effort = recorded(folder / f"rec_{HELD_OUT}.csv", after)[2]
    names, motion = names_of(after), (run.position, run.velocity, run.acceleration)
    predicted = np.loadtxt(folder / "report" / report["holdout_predictions"][f"rec_{HELD_OUT}"], delimiter=",")
    # The report predicts the effort as it was recorded, late and scaled; a simulator computes that of the arm.
    residual = lambda x: kept["measured"] - x
    residuals = {"MuJoCo before": residual(by_mujoco(before, run)), "report": effort - predicted,
                 "MuJoCo": residual(by_mujoco(after, run)),
                 "Pinocchio": residual(elsewhere.by_pinocchio(export(program, folder, "urdf"), names, after, *motion)),
                 "Drake": residual(elsewhere.by_drake(export(program, folder, "drake"), names, after, *motion))}
    rollouts = [simulate(m, controller, kept["command"]).position for m in (before, after)]
    moves = np.abs(run.velocity) > MOVING
    found = [f"{f['effect']}@{f['joint'] or f['link'] or 'tool'}" for f in report["findings"]]
    return {"case": name, "changes": changes, "found": found, "inverse": {k: rms(x[moves]) for k, x in residuals.items()},
            "rollout": [rms(x - run.position, 0) for x in rollouts], "said": report.get("simulated"), "measured": run.position, "paths": rollouts}


def table(results):
    causes = ["| case | concealed | found |", "| --- | --- | --- |"]
    lines = ["| case | residual before | after: report | MuJoCo | Pinocchio | Drake | rollout, before and after [mrad] | the report's | worse joints |",
             "| --- | ---: | ---: | ---: | ---: | ---: | --- | --- | --- |"]
    ratios = []
    for r in results:
        rb, ra = (rms(x) for x in r["rollout"])
        worse = sum(a > b * 1.02 + 1e-6 for b, a in zip(*r["rollout"]))
        ratios.append(ra / rb)
        changes = ", ".join(f"{a} {n} +{x:g}" for a, n, x in r["changes"])
        said = r["said"]
        said = ", ".join(f"{1e3 * rms(np.array(said[k])):.2f}" for k in ("rms_before", "rms_after")) if said else "none"
        inverse = " | ".join(f"{x:.3f}" for x in r["inverse"].values())
        causes.append(f"| {r['case']} | {changes} | {', '.join(r['found'])} |")
        lines.append(f"| {r['case']} | {inverse} | "
                     f"{1e3 * rb:.2f}, {1e3 * ra:.2f} | {said} | {worse} of {len(r['rollout'][0])} |")
    return "\n".join([*causes, "", *lines]) + f"\n\nThe rollout's error falls to {np.median(ratios):.3f} of what it was in the median of {len(ratios)} cases."


def faults(results):
    """Where a case misses the bounds of --check, a sentence each."""
    for r in results:
        before, said, *simulated = r["inverse"].values()
        if any(abs(x - said) > 0.02 * before for x in simulated):
            yield f"{r['case']}: residuals in the simulators, {simulated}, are not the report's {said}, of {before} before"
        (old, new) = r["rollout"]
        if any(a > b * 1.02 + 1e-6 for b, a in zip(old, new)):
            yield f"{r['case']}: a joint is further off in the rollout: {old} before, {new} after"
        if rms(new) > 0.2 * rms(old):
            yield f"{r['case']}: the rollout's error falls from {rms(old)} to {rms(new)} only"


def picture(result, joint):
    """An SVG of a joint's position: measured, and simulated as it was and as it was written."""
    width, height, left, top = 720, 260, 56, 18
    lines = [("measured", result["measured"], "#222", 3), ("simulated before", result["paths"][0], "#d1495b", 1.5),
             ("simulated with the written model", result["paths"][1], "#3a86c8", 1.5)]
    values = np.concatenate([path[:, joint] for _, path, _, _ in lines])
    low, high = values.min(), values.max()
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="12">',
           f'<rect width="{width}" height="{height}" fill="#fff"/>']
    for value in (low, (low + high) / 2, high):
        y = top + (height - top - 48) * (high - value) / (high - low)
        svg.append(f'<text x="{left - 6}" y="{y + 4:.1f}" text-anchor="end">{value:.2f}</text>'
                   f'<line x1="{left}" x2="{width - 8}" y1="{y:.1f}" y2="{y:.1f}" stroke="#ddd"/>')
    for k, (name, path, colour, stroke) in enumerate(lines):
        y = top + (height - top - 48) * (high - path[::5, joint]) / (high - low)
        x = left + (width - left - 8) * np.linspace(0, 1, len(y))
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y))
        svg.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="{stroke}"/>'
                   f'<text x="{left + 220 * k}" y="{height - 8}" fill="{colour}">{name}</text>')
    svg.append(f'<text x="{left}" y="{height - 26}">time, 0 to {LENGTH_S:g} s; position [rad]</text></svg>')
    return "\n".join(svg) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tauscope")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--check", action="store_true", help="exit code 1 if residuals in simulators and report differ by 2 %% of that before, a joint gets worse, or a rollout error exceeds a fifth")
    parser.add_argument("--table", action="store_true", help="only print the table of what is there")
    parser.add_argument("--svg", type=pathlib.Path, help="a picture of the first case's rollout, at the joint that was furthest off")
    args = parser.parse_args()
    results = []
    for name in args.cases.split(","):
        folder = args.out / name
        if not args.table:
            if not (folder / f"rec_{HELD_OUT}.npz").exists():
                make(args.out, name, [args.seed, list(CASES).index(name)])
            if not (folder / "report" / "report.json").exists():
                explain(args.tauscope, folder, CASES[name][0])
        results.append(judge(args.tauscope, folder, name))
    print(table(results))
    missed = list(faults(results)) if args.check else []
    if missed:
        sys.exit("\n".join(missed))
    if args.svg:
        args.svg.write_text(picture(results[0], int(np.argmax(results[0]["rollout"][0]))))


if __name__ == "__main__":
    main()
