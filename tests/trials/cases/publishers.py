"""Several publishers of joint states in one recording."""

import numpy as np

from lib.arm import ARM, urdf, urdf_body
from lib.motion import Rows
from lib.session import rows_of, session, write_robot, write_session
from lib.trial import CELL, REPORT, Answer, Trial, count, counts, done, explain, info, init, near, refused, replay
from lib.writers import messages

FINGERS = ["finger_a", "finger_b"]
LEFT, RIGHT = ([side + name for name in ARM.names] for side in ("left_", "right_"))
BOTH_SETS = near("left_j_base", "right_j_base", within=400)
# The second arm of a session moves otherwise.
OTHER_ARM = 20


def mounted(side, y):
    return (
        f'  <joint name="{side}mount" type="fixed"><parent link="world"/><child link="{side}foot"/>'
        f'<origin xyz="0 {y} 0.8" rpy="0 0 0"/></joint>\n  <link name="{side}foot"/>\n' + urdf_body(ARM, side)
    )


def robot(body, name="pair"):
    return f'<?xml version="1.0"?>\n<robot name="{name}">\n{body}</robot>\n'


def dual(each):
    def make(folder):
        write_robot(folder, robot('  <link name="world"/>\n' + mounted("left_", 0.5) + mounted("right_", -0.5)))
        roots = "".join(f'  <link name="{side}foot"/>\n' + urdf_body(ARM, side) for side in ("left_", "right_"))
        write_robot(folder, robot(roots), "two_roots.urdf")
        for side in ("left", "right"):
            write_robot(folder, urdf(prefix=f"{side}_"), f"{side}.urdf")
        write_session(folder, each)

    return make


def alternate(recording, rows, begin_ns):
    right = rows_of(recording, OTHER_ARM)
    return messages(rows, begin_ns, LEFT) + messages(right, begin_ns + 4_000_000, RIGHT)


def late_and_slow(recording, rows, begin_ns):
    """The right arm comes at half the rate, and only after the left one has been there for a second."""
    right = rows_of(recording, OTHER_ARM)
    late = Rows(right.t[100::2], right.q[100::2], right.qd[100::2], right.tau[100::2])
    return messages(rows, begin_ns, LEFT) + messages(late, begin_ns + 4_000_000, RIGHT)


def two_topics(recording, rows, begin_ns):
    right = rows_of(recording, OTHER_ARM)
    return {
        "/left/joint_states": messages(rows, begin_ns),
        "/right/joint_states": messages(right, begin_ns + 4_000_000),
    }


def pair_of_arms(*info_says):
    """The pair either gives ten true frictions, or is refused because no message names all joints."""
    return (
        info(Answer(says=(BOTH_SETS, *info_says))),
        init(
            done(CELL, BOTH_SETS, prefixes=("left_", "right_")),
            refused(BOTH_SETS, r"separate|no message|different messages|in turn|alternat|each (of|set)|sets|two"),
        ),
        init(refused("left_foot", "right_foot"), robot="two_roots.urdf", out="cell_two", short=True),
        init(
            done("cell_left/explained/report.json", exits=(0,), prefixes=("left_",)), robot="left.urdf", out="cell_left"
        ),
        init(
            done("cell_right/explained/report.json", exits=(0,), prefixes=("right_",)),
            robot="right.urdf",
            out="cell_right",
        ),
    )


def gripper(step, shift_s):
    """Messages that name only the fingers, each `step` rows of the arm's."""

    def each(recording, rows, begin_ns):
        t = np.arange(round(len(rows) / step)) * step / 100 + shift_s
        still = np.zeros((len(t), 2))
        fingers = Rows(t, still + 0.02, still, still)
        return messages(fingers, begin_ns, FINGERS) + messages(rows, begin_ns)

    return each


def repeated(step, shift_s, fields, change=lambda rows: rows):
    """A second publisher that repeats the arm."""

    def each(_, rows, begin_ns):
        second = change(rows.every(step, shift_s))
        return messages(second, begin_ns, fields=fields) + messages(rows, begin_ns)

    return each


def zero_effort(rows):
    return rows.changed(tau=0 * rows.tau)


# Another order, and a prefix before each name.
PREFIXED = ["SN53_" + name for name in reversed(ARM.names)]


def prefixed_twin(_, rows, begin_ns):
    reverse = Rows(rows.t, rows.q[:, ::-1], rows.qd[:, ::-1], rows.tau[:, ::-1])
    return messages(reverse, begin_ns + 300_000, PREFIXED) + messages(rows, begin_ns)


def unharmed(*info_says, says=(), exits=(0,)):
    """The arm is read as if the others were not there."""
    return (
        info(Answer(exits, (count(1200), *info_says))),
        init(done(CELL, *says, exits=exits)),
        explain(done(REPORT, *says, exits=exits)),
        replay(Answer(exits, says, ("there were no efforts",), events=(0,))),
    )


TRIALS = [
    Trial("dual-alternate", dual(alternate), pair_of_arms(count(1200))),
    Trial("dual-late", dual(late_and_slow), pair_of_arms(count(1200), count(550), r"\b(50|49\.\d+)(\.0+)? Hz")),
    Trial(
        "dual-topics",
        session(two_topics),
        (
            info(Answer(says=("/left/joint_states", "/right/joint_states"))),
            init(refused("/left/joint_states", "/right/joint_states", "--state-topic"), short=True),
            init(done("cell_left/explained/report.json", exits=(0,)),
                 options="--state-topic /left/joint_states", out="cell_left"),
            explain(refused("/left/joint_states", "/right/joint_states", "--state-topic")),
            explain(done("report_right/report.json", exits=(0,)),
                    options="--state-topic /right/joint_states", out="report_right"),
        ),
    ),
    Trial("gripper-first", session(gripper(5, -0.0031)), unharmed("finger_a", count(240))),
    Trial("gripper-fast", session(gripper(1 / 3, -0.0013)), unharmed("finger_a", count(3600))),
    Trial(
        "repeat-positions",
        session(repeated(10, 0.0047, "p")),
        unharmed(
            near(count(120), r"position|no effort|without"),
            says=(near(counts(120), r"position|effort"),),
            exits=(0, 3),
        ),
    ),
    Trial(
        "repeat-zero-effort",
        session(repeated(2, 0.0047, "pve", zero_effort)),
        unharmed(
            near(count(600), r"effort", r"\b(0|zero)\b"),
            says=(near(counts(600), "effort"),),
            exits=(0, 3),
        ),
    ),
    Trial("report-ur-prefixed-twin", session(prefixed_twin), unharmed("SN53_j_base", r"\bj_base")),
]
