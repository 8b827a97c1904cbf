"""Values that cannot be, and messages that are not what they seem."""

import numpy as np

from lib.arm import ARM
from lib.motion import Rows
from lib.session import changed, session
from lib.trial import CELL, REPORT, Answer, Trial, count, counts, done, explain, info, init, near, refused, replay
from lib.writers import messages

# What the values made the program say instead.
INSTEAD = ("other sign", r"depends? on another joint", "driver was changed")


def places(recording, rows, number):
    """Distinct rows, drawn anew for each recording."""
    return np.random.default_rng(recording).choice(np.arange(200, len(rows) - 200), number, replace=False)


def garbage(recording, rows):
    """Uninitialised doubles: twelve values of one joint."""
    tau, at = rows.tau.copy(), places(recording, rows, 12)
    tau[at, 3] = np.repeat([1.8146065985459775e237, 1.040420863149002e224, 2.89e-321], 4)
    return rows.changed(tau=tau)


def sentinels(recording, rows):
    """What drivers write where they have no value."""
    tau, at = rows.tau.copy(), places(recording, rows, 15)
    tau[at[:6], 2] = 65535.0
    tau[at[6:12], 4] = -9999.0
    tau[at[12:], 0] = np.inf
    return rows.changed(tau=tau)


def dropouts(recording, rows):
    """A loose plug: six times, the effort of one joint is exactly 0 for 60 ms."""
    tau, draw = rows.tau.copy(), np.random.default_rng(recording)
    for begin in 300 + 110 * np.arange(6) + draw.integers(0, 60, 6):
        tau[begin : begin + 6, 1] = 0.0
    return rows.changed(tau=tau)


def in_spite_of(*facts, exits=(0, 3)):
    """Every command states the facts, and the results are as without the values."""
    return (
        info(Answer(exits, facts)),
        init(done(CELL, *facts, never=INSTEAD)),
        explain(done(REPORT, *facts, never=INSTEAD)),
        replay(Answer(exits, facts, events=(0,))),
    )


def named(count_, *columns):
    """Every message names `count_` joints, and has these columns of the rows."""

    def each(_, rows, begin_ns):
        fields = {"q": rows.q, "qd": rows.qd, "tau": rows.tau}
        part = Rows(rows.t, *(fields[name][:, :width] for name, width in zip(("q", "qd", "tau"), columns)))
        names = (ARM.names + FINGERS)[:count_]
        return messages(part, begin_ns, names)

    return each


FINGERS = ["finger_a", "finger_b"]


def useless(*facts):
    """The messages cannot be used; every command says why in the same words."""
    never = ("holds no sensor_msgs", "not of that type", "hold no effort")
    return (
        info(Answer((0, 2, 3), facts, never)),
        init(refused(*facts, never=never), short=True),
        explain(refused(*facts, never=never)),
        replay(Answer((2, 3), facts, never)),
    )


TRIALS = [
    Trial("effort-garbage", session(changed(garbage)), in_spite_of(near("j_tilt", counts(8, 12)))),
    Trial(
        "effort-sentinel",
        session(changed(sentinels)),
        in_spite_of(
            near("j_elbow", rf"65[ ,']?535|6\.5\d*e4|{counts(6)}"),
            near("j_turn", rf"9[ ,']?999|{counts(6)}"),
            near("j_base", rf"\binf|finite|{counts(3)}"),
        ),
    ),
    Trial(
        "effort-dropout",
        session(changed(dropouts)),
        in_spite_of(near("j_shoulder", r"\b0\b|zero|drop", counts(6, 36))),
    ),
    Trial("length-gripper", session(named(7, 5, 5, 5)), useless(near(count(7), count(5), "name"))),
    Trial("length-short-effort", session(named(5, 5, 5, 4)), useless(near(count(5), count(4), "effort"))),
    Trial("length-no-position", session(named(5, 0, 5, 5)), useless(near("position", r"\b(no|0|without|empty)\b"))),
    Trial(
        "length-no-names",
        session(named(0, 5, 5, 5)),
        useless(near(r"\bnames?\b|named", r"\b(no|0|without|empty)\b")),
    ),
]
