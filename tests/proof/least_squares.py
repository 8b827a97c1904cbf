"""The reference of identification on real arms: least squares, beside what `explain` left.

    python least_squares.py ROBOT.urdf --fit RECORDING... --holdout RECORDING... [--report FOLDER] [--ridge 0.05]

The regressor of all joints together: ten inertial parameters a link with a ridge towards the URDF, and for each joint
Coulomb and viscous friction, an offset, and the rotor's inertia (Swevers et al., "Optimal robot excitation and
identification", IEEE Transactions on Robotics and Automation 13(5), 1997; the ridge is Hoerl and Kennard's). Motion and
effort pass through the same zero-phase Butterworth filter of 6 Hz. Recordings are CSV files with NAME.position and
NAME.effort columns, or MCAP files. Printed: by joint the RMS of measured minus expected effort over all samples of the
hold-out, unfiltered, of the URDF, of least squares, and of the report; then the root of the sum of their squares.
Needs numpy, scipy, pin, mcap.
"""
import argparse
import csv
import json
import pathlib

import numpy as np
import pinocchio as pin
from scipy.signal import butter, filtfilt

import record

CUTOFF_HZ = 6.0
# A joint that is slower has no direction [rad/s].
STILL_RAD_S = 0.01


def read(path, joints):
    """Time [s], position and effort of a recording, columns as `joints`."""
    if path.suffix == ".mcap":
        names, stamps, position, _, effort = record.read(path)
        order = [names.index(joint) for joint in joints]
        return (stamps - stamps[0]) * 1e-9, position[:, order], effort[:, order]
    with path.open() as file:
        rows = csv.DictReader(file)
        of = [[float(row["time"])] + [float(row[f"{joint}.{kind}"]) for kind in ("position", "effort") for joint in joints] for row in rows]
    table = np.array(of)
    return table[:, 0], table[:, 1:1 + len(joints)], table[:, 1 + len(joints):]


def motion(time, position, values):
    """The same on an even clock: position, velocity, acceleration, and `values`, filtered."""
    even = np.linspace(time[0], time[-1], len(time))
    step = even[1] - even[0]
    filters = butter(4, min(CUTOFF_HZ * 2 * step, 0.9))
    smooth = lambda x: filtfilt(*filters, np.array([np.interp(even, time, column) for column in x.T]).T, axis=0)
    q = smooth(position)
    qd = np.gradient(q, step, axis=0)
    return q, qd, np.gradient(qd, step, axis=0), smooth(values), even


def regressor(model, data, q, qd, qdd):
    """Rows by sample and joint; columns: inertial parameters, then four of each joint."""
    n = model.nv
    rows = []
    for k in range(len(q)):
        inertial = pin.computeJointTorqueRegressor(model, data, q[k], qd[k], qdd[k])
        sign = np.sign(qd[k]) * (np.abs(qd[k]) > STILL_RAD_S)
        rows.append(np.hstack([inertial, np.diag(sign), np.diag(qd[k]), np.eye(n), np.diag(qdd[k])]))
    return np.array(rows)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", type=pathlib.Path)
    parser.add_argument("--fit", nargs="+", type=pathlib.Path, required=True)
    parser.add_argument("--holdout", nargs="+", type=pathlib.Path, required=True)
    parser.add_argument("--report", type=pathlib.Path, help="the folder of a report of the same hold-out")
    parser.add_argument("--ridge", type=float, default=0.05, help="root of the ridge, where each column has a mean square of one")
    options = parser.parse_args()
    model = pin.buildModelFromUrdf(str(options.robot))
    data, n = model.createData(), model.nv
    joints = list(model.names)[1:]
    nominal = np.concatenate([inertia.toDynamicParameters() for inertia in list(model.inertias)[1:]])
    rows, right = [], []
    for path in options.fit:
        time, position, effort = read(path, joints)
        q, qd, qdd, measured, _ = motion(time, position, effort)
        own = regressor(model, data, q, qd, qdd)
        rows.append(own)
        right.append(measured - own[:, :, :len(nominal)] @ nominal)
    rows, right = np.concatenate(rows), np.concatenate(right)
    # Joints weigh by their effort's size; columns are scaled to the size that they have in it.
    weights = 1 / np.maximum(right.std(axis=0), 1e-9)
    flat, left = (rows * weights[:, None]).reshape(-1, rows.shape[2]), (right * weights).ravel()
    scale = np.maximum(np.sqrt((flat ** 2).mean(axis=0)), 1e-9)
    scaled = flat / scale
    normal = scaled.T @ scaled / len(left) + options.ridge ** 2 * np.eye(scaled.shape[1])
    found = np.linalg.solve(normal, scaled.T @ left / len(left)) / scale
    squares, count = np.zeros((2, n)), 0
    for path in options.holdout:
        time, position, effort = read(path, joints)
        q, qd, qdd, _, even = motion(time, position, effort)
        own = regressor(model, data, q, qd, qdd)
        rigid = own[:, :, :len(nominal)] @ nominal
        measured = np.array([np.interp(even, time, column) for column in effort.T]).T
        for row, expected in enumerate((rigid, rigid + own @ found)):
            squares[row] += ((measured - expected) ** 2).sum(axis=0)
        count += len(time)
    before, after = np.sqrt(squares / count)
    columns = {"URDF": before, "least squares": after}
    if options.report:
        report = json.loads((options.report / "report.json").read_text())
        order = [report["joints"].index(joint) for joint in joints]
        columns["explain"] = np.array(report["holdout_rms_after"], float)[order]
    print("| joint | " + " | ".join(columns) + " |\n| --- |" + " --- |" * len(columns))
    for j, joint in enumerate(joints):
        print(f"| {joint} | " + " | ".join(f"{values[j]:.3g}" for values in columns.values()) + " |")
    print("| root of the sum of squares | " + " | ".join(f"{np.linalg.norm(values):.4g}" for values in columns.values()) + " |")


if __name__ == "__main__":
    main()
