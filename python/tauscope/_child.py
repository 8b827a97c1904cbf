"""The process that `_process.py` starts: runs one command and writes its answer as JSON."""

import os
import signal
import sys

# Before the command listens to it, Ctrl-C ends this process at once.
signal.signal(signal.SIGINT, signal.SIG_DFL)
# The folder of this file must not hide modules of the standard library; the folder above it has the package.
sys.path[0] = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))

import json  # noqa: E402

from tauscope import _tauscope  # noqa: E402

code, text, said, errors = _tauscope.command(sys.argv[1:])
json.dump([code, text, said, json.loads(errors)], sys.stdout)
