"""The velocity field is not the speed; position and effort are right."""

import numpy as np

from lib.session import changed, session
from lib.trial import CELL, REPORT, Answer, Trial, done, explain, info, init, near, replay

SPEED_PER_JOINT = np.array([1.0, 1.0, 1.0, 1.5, 1.5])
# Conclusions about the effort, drawn from a wrong velocity.
INSTEAD = (
    r"measures? (0\.[0-7]|1\.[3-9]|[2-9])\d* times",
    "other sign",
    "no joint bears weight",
    "knows no future",
)


def trial(name, velocity, *fact, never=INSTEAD):
    """The fact is stated by every command, and the results are those of differentiated positions."""
    facts = (near("velocit", *fact, within=200),)
    return Trial(
        name,
        session(changed(lambda _, rows: rows.changed(qd=velocity(rows)))),
        (
            info(Answer(says=facts, never=never)),
            init(done(CELL, *facts, never=never)),
            explain(done(REPORT, *facts, never=never)),
            replay(Answer((0, 3), facts, never, events=(0,))),
        ),
    )


TRIALS = [
    trial("velocity-tenfold", lambda rows: 10 * rows.qd, r"\b(10|10\.\d+|9\.9\d*|ten)\b|0\.1\b"),
    trial("velocity-zero", lambda rows: 0 * rows.qd, r"\b(0|0\.0+|zero)\b"),
    trial(
        "velocity-constant",
        lambda rows: 0 * rows.qd + SPEED_PER_JOINT,
        r"constant|same|one (number|value)|in every message|never changes|does not change",
    ),
    trial(
        "velocity-position",
        lambda rows: 0.8 * rows.q,
        r"unrelated|not (the|a|that|its|follow|match)|no relation|nothing to do|proportional|position itself|copy|"
        r"contradict|differs",
    ),
    trial("velocity-degrees", lambda rows: np.degrees(rows.qd), r"degree|deg/s|57\.\d|180"),
    trial(
        "velocity-sign",
        lambda rows: -rows.qd,
        r"\bsign\b|negative|-1\b|opposite|-1\.0",
        never=(r"effort of [^.;]{0,80}other sign", "no joint bears weight"),
    ),
]
