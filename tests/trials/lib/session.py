"""Sessions: the URDF and five recordings of a trial in its folder."""

from lib.arm import ARM, urdf
from lib.motion import measured
from lib.trial import RECORDINGS
from lib.writers import messages, start_of, write_mcap


def write_robot(folder, text=None, name="arm.urdf"):
    (folder / name).write_text(urdf() if text is None else text)


def rows_of(recording, shift=0, **kwargs):
    """The rows of recording 0, 1, ...; `shift` gives another arm or session other motions."""
    return measured(1 + recording + shift, **kwargs)


def write_session(folder, each=None, name="free_{}.mcap", **kwargs):
    """Five MCAP recordings. `each` maps (recording, rows, begin [ns]) to messages or topics with messages."""
    for recording in range(RECORDINGS):
        rows, begin_ns = rows_of(recording, **kwargs), start_of(recording)
        held = messages(rows, begin_ns) if each is None else each(recording, rows, begin_ns)
        write_mcap(folder / name.format(recording + 1), held)


def session(each=None, robot=None, **kwargs):
    """A function that writes the robot and the session into a folder."""

    def make(folder):
        write_robot(folder, robot)
        write_session(folder, each, **kwargs)

    return make


def changed(change, arm=ARM, **message_options):
    """For `session`: each recording's rows pass through `change(recording, rows)`."""

    def each(recording, rows, begin_ns):
        return messages(change(recording, rows), begin_ns, arm.names, **message_options)

    return each
