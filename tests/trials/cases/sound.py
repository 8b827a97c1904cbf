"""Sound data: what is said of bad data must not be said here."""

from dataclasses import replace

from lib.arm import ARM, urdf
from lib.motion import PUSH, measured
from lib.session import session
from lib.trial import CELL, REPORT, Answer, Run, Trial, calibrate, count, explain, info, init, near, replay
from lib.writers import messages, start_of, write_mcap

STRONG = replace(
    ARM,
    joints=tuple(
        replace(j, coulomb_nm=2 * j.coulomb_nm, viscous_nms_per_rad=2 * j.viscous_nms_per_rad) for j in ARM.joints
    ),
)
COMPLAINTS = (r"other sign", r"\bwarning", r"impossible", r"lost or refused")


def make(folder):
    session()(folder)
    touched = messages(measured(77, push=PUSH), start_of(10))
    write_mcap(folder / "touched.mcap", touched)


TRIALS = [
    Trial(
        "sound",
        make,
        (
            info(Answer(says=(count(1200), "j_turn"), never=COMPLAINTS)),
            calibrate(Answer(never=COMPLAINTS)),
            init(Answer(says=("N m",), never=COMPLAINTS, friction=CELL), short=True),
            explain(Answer(never=COMPLAINTS, friction=REPORT)),
            Run("check cell/pipeline.yaml", (Answer(never=COMPLAINTS),), short=True),
            replay(Answer(never=(*COMPLAINTS, "there were no efforts"), events=(0,))),
            # The push is on the forearm: nothing behind it carries anything.
            replay(
                Answer(
                    says=(near("contact at", r"\b(boom|stick)\b", within=10),),
                    never=(r"contact at[^.:;]{0,60}\((?=[^)]*j_(tilt|turn))", "there were no efforts"),
                    events=(1,),
                ),
                file="touched.mcap",
            ),
        ),
    ),
    # Drives whose friction is as large as the weight of most poses.
    Trial(
        "sound-friction",
        session(robot=urdf(STRONG), arm=STRONG),
        (
            init(Answer(never=("no joint bears weight",), friction=CELL, arm=STRONG)),
            explain(Answer(friction=REPORT, arm=STRONG)),
        ),
    ),
]
