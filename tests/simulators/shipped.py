"""MuJoCo models that packages on PyPI ship, explained and corrected.

    python3 tests/simulators/shipped.py TAUSCOPE OUT [--only panda]

Needs requirements.txt. The wheels of robosuite, gymnasium-robotics and dm_control are fetched and unpacked into OUT. Of each robot three
numbers are changed in secret, as prove.py does: the dry friction of a joint and the viscous friction of another, by a third of that
joint's effort, and the mass of a body, by a third. The table has the lines of the model that the written one changes, and the rollout's
error on the recording that was not fitted.
"""
import argparse
import difflib
import pathlib
import shutil
import subprocess
import sys
import zipfile

import mujoco
import numpy as np

import prove

PACKAGES = ("robosuite==1.5.2", "gymnasium-robotics==1.4.2", "dm_control==1.0.50")
MODELS = {
    **{name: f"robosuite/models/assets/robots/{name}/robot.xml" for name in (
        "baxter", "iiwa", "jaco", "kinova3", "panda", "sawyer", "tiago", "ur5e", "xarm7")},
    "inspire_hand": "robosuite/models/assets/grippers/inspire_right_hand.xml",
    "jaco_arm": "dm_control/third_party/kinova/jaco_arm.xml",
    "reacher": "dm_control/suite/reacher.xml",
    "shadow_hand": "gymnasium_robotics/envs/assets/hand/reach.xml",
}


def unpacked(out):
    wheels = out / "wheels"
    if not wheels.exists():
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--dest", str(wheels), *PACKAGES]
        subprocess.run(command, check=True)
        for wheel in wheels.glob("*.whl"):
            zipfile.ZipFile(wheel).extractall(wheels)
    return wheels


def changes(m, rng):
    """Three numbers that are changed, by the efforts that a motion needs."""
    command = prove.commands(m, rng)
    run = prove.simulate(m, prove.Controller(m), command)
    effort, speed = prove.rms(run.effort, 0), prove.rms(run.velocity, 0)
    dry, viscous = rng.choice(m.njnt, 2, replace=False) if m.njnt > 1 else (0, 0)
    moved = [b for b in range(1, m.nbody) if m.body_weldid[b] != 0 and m.body_mass[b] > 0]
    body = int(rng.choice(moved))
    return [("frictionloss", m.joint(dry).name, effort[dry] / 3), ("damping", m.joint(viscous).name, effort[viscous] / speed[viscous] / 3),
            ("mass", m.body(body).name, m.body_mass[body] / 3)]


def changed_lines(before, after):
    """Lines that were changed, added or removed, without the comment at the top."""
    old, new = (path.read_text().splitlines() for path in (before, after))
    new = new[new.index("-->") + 1:]
    return sum(line[:1] in "+-" and line[:3] not in ("+++", "---") for line in difflib.unified_diff(old, new, lineterm="", n=0))


def told(program, model, folder, fit):
    """`explain` on a model; the one that MuJoCo saves where masses have to be computed from meshes."""
    arguments = [program, "explain", "--fit", *fit[:-1], "--holdout", fit[-1], "--out", str(folder / "report"), "--force", "--robot"]
    done = subprocess.run([*arguments, str(model)], capture_output=True, text=True)
    if "Save what MuJoCo has computed" in done.stderr:
        saved = model.parent / f"saved_{folder.name}.xml"
        spec = mujoco.MjSpec.from_file(str(model))
        spec.compiler.saveinertial = True
        spec.compile()
        spec.to_file(str(saved))
        return saved, subprocess.run([*arguments, str(saved)], capture_output=True, text=True)
    return model, done


def judged(program, out, name, path):
    """A row of the table."""
    folder = out / name
    m = prove.load(path)
    rng = np.random.default_rng([3, list(MODELS).index(name)])
    concealed = changes(m, rng)
    controller, plant = prove.Controller(prove.load(path)), prove.concealed(prove.load(path), concealed)
    folder.mkdir(parents=True, exist_ok=True)
    fit = []
    for k in range(prove.RECORDINGS):
        command = prove.commands(plant, rng)
        run = prove.simulate(plant, controller, command)
        fit.append(str(folder / f"rec_{k}.csv"))
        prove.write(pathlib.Path(fit[-1]), plant, run, rng)
    model, done = told(program, path, folder, fit)
    row = f"| {name} | {m.njnt} | {', '.join(f'{a} {n} +{x:.3g}' for a, n, x in concealed)} |"
    if done.returncode not in (0, 3):
        return f"{row} exit {done.returncode}: {done.stderr.strip().splitlines()[0]} | |"
    written = folder / "report" / "robot.xml"
    if not written.exists():
        return f"{row} nothing written | |"
    # Paths of meshes begin at the folder of the model.
    there = path.parent / f"tauscope_{name}.xml"
    shutil.copy(written, there)
    rollouts = [prove.rms(prove.simulate(x, controller, command).position - run.position) for x in (prove.load(path), prove.load(there))]
    lines = "with includes" if "<include" in model.read_text() else f"{changed_lines(model, there)} of {len(model.read_text().splitlines())}"
    return f"{row} {lines} | {1e3 * rollouts[0]:.2f}, {1e3 * rollouts[1]:.2f} |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tauscope")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--only", default=",".join(MODELS))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    wheels = unpacked(args.out)
    print("| model | joints | concealed | changed lines | rollout, before and after [mrad] |\n| --- | ---: | --- | --- | --- |")
    for name in args.only.split(","):
        print(judged(args.tauscope, args.out, name, wheels / MODELS[name]), flush=True)


if __name__ == "__main__":
    main()
