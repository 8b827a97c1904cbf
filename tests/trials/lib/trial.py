"""Trials: inputs, the commands that are run on them, and the answers that are good.

An answer is about facts: which joint or link, how many, where, and whether the numbers are right. Patterns leave the
words open. Output is matched with all white space folded to one blank, without regard to case.
"""

import json
import math
import re
from dataclasses import dataclass
from itertools import permutations

from lib.arm import ARM

RECORDINGS = 5
# Share by which a friction may differ from its truth.
TOLERANCE = 0.1

# No command may print these, whatever the input.
NEVER = (
    r"panicked at",
    r"RUST_BACKTRACE",
    r"\d{25,}",
    r"(?<![\w.])-?(nan|inf)\s+(N|rad|kg|s)\b",
    r"\b(off|carries) (by )?not told\b",
    r"joints +with (position|velocity|effort)",
)


class Near(str):
    """A pattern with the facts that it finds."""

    facts = ()


def near(*facts, within=250):
    """A pattern that finds all of these patterns close to each other, in any order."""
    between = f".{{0,{within}}}?"
    orders = (between.join(f"(?:{fact})" for fact in order) for order in permutations(facts))
    pattern = Near("|".join(orders))
    pattern.facts = facts
    return pattern


def count(number):
    """A count as people write it: 1200, 1,200 or 1 200."""
    text = str(number)
    if len(text) <= 3:
        return rf"(?<![\d.,]){text}(?![\d]|[.,]\d)"
    return rf"(?<![\d.,]){text[:-3]}[ ,']?{text[-3:]}(?![\d]|[.,]\d)"


def counts(*numbers):
    """A count of one recording, or that of the whole session."""
    return "|".join(count(number) for each in numbers for number in (each, RECORDINGS * each))


# Rows that were not used; a command that is done with exit code 0 has lost none.
LOST = r"\b[1-9][\d,]* (samples|rows|messages)\b[^.;]{0,80}\b(lost|refused|dropped)\b"


@dataclass(frozen=True)
class Answer:
    """What a good answer consists of."""

    exit: tuple = (0,)
    says: tuple = ()
    never: tuple = ()
    # The `report.json` whose Coulomb frictions must be true, for each joint.
    friction: str = ""
    arm: object = ARM
    prefixes: tuple = ("",)
    # Number of events that a replay may report.
    events: tuple = ()

    def faults(self, code, output, folder):
        """Why this answer was not given; empty if it was."""
        if code not in self.exit:
            yield f"exit {code}, not {' or '.join(str(c) for c in self.exit)}"
        for pattern in self.says:
            if not re.search(pattern, output, re.I):
                yield f"does not say `{shown(pattern)}`"
        for pattern in (*NEVER, *self.never):
            if found := re.search(pattern, output, re.I):
                yield f'says "{found.group()[:60]}"'
        if self.friction and code in (0, 3):
            yield from self.wrong_friction(folder / self.friction)
        if code == 0 and (found := re.search(LOST, output, re.I)):
            yield f'exit 0 with "{found.group()[:60]}"'
        if self.events:
            if re.search("cannot judge", output):
                yield "the detector judged nothing"
            found = re.search(r"(\d+) events?\b", output)
            if not found or int(found.group(1)) not in self.events:
                wanted = " or ".join(map(str, self.events))
                yield f"{found.group(1) if found else 'no'} events, not {wanted}"

    def wrong_friction(self, report):
        try:
            findings = json.loads(report.read_text())["findings"]
        except (OSError, ValueError, KeyError) as error:
            yield f"no findings in {report.name}: {error.__class__.__name__}"
            return
        for prefix in self.prefixes:
            for joint in self.arm.joints:
                got = coulomb(findings, prefix + joint.name)
                if got is None:
                    yield f"no Coulomb friction at {prefix}{joint.name}"
                elif not math.isclose(got, joint.coulomb_nm, rel_tol=TOLERANCE):
                    yield f"Coulomb friction of {prefix}{joint.name} {got:.3g}, not {joint.coulomb_nm:g}"


def shown(pattern):
    """A pattern as the table shows it."""
    facts = getattr(pattern, "facts", (pattern,))
    return " + ".join(fact if len(fact) < 40 else fact[:37] + "..." for fact in facts)


def coulomb(findings, joint):
    """The Coulomb friction of a joint [N m], by whichever effect holds it; None without one."""
    total = None
    for finding in findings:
        if finding.get("joint") != joint or finding.get("t_start") is not None:
            continue
        held = finding.get("parameters", {})
        if "coulomb_nm" in held:
            size = held["coulomb_nm"]
        elif "coulomb_positive_nm" in held:
            size = (held["coulomb_positive_nm"] + held["coulomb_negative_nm"]) / 2
        else:
            continue
        total = size + (total or 0.0)
    return total


@dataclass(frozen=True)
class Run:
    """A command and its good answers, of which one must be given.

    In the command, `{free}` stands for all recordings, `{cell}` for the pipeline file of the sound arm.
    """

    command: str
    answers: tuple
    # Part of the short set.
    short: bool = False

    def judge(self, code, output, folder):
        """The faults compared with the nearest answer; empty: good."""
        folded = " ".join(output.split())
        every = [list(answer.faults(code, folded, folder)) for answer in self.answers]
        nearest = [faults for answer, faults in zip(self.answers, every) if code in answer.exit]
        return min(nearest or every, key=len)


@dataclass(frozen=True)
class Trial:
    name: str
    # Writes the inputs into a folder.
    make: object
    runs: tuple
    # Names of the recordings.
    free: str = "free_{}.mcap"

    def command(self, run, cell):
        free = " ".join(self.free.format(number + 1) for number in range(RECORDINGS))
        return run.command.replace("{free}", free).replace("{cell}", str(cell))


def info(*answers, file="free_1.mcap"):
    return Run(f"info {file}", answers, short=True)


def init(*answers, options="", free="{free}", robot="arm.urdf", out="cell", short=False):
    return Run(f"init {free} --robot {robot} {options}".rstrip() + f" --out {out}", answers, short)


def explain(*answers, options="", free="{free}", robot="arm.urdf", out="report"):
    return Run(f"explain {free} --robot {robot} {options}".rstrip() + f" --out {out}", answers)


def replay(*answers, file="free_1.mcap", short=True):
    return Run(f"replay {file} --pipeline {{cell}} --out results", answers, short)


def calibrate(*answers, robot="arm.urdf"):
    files = [f"free_{number}.mcap" for number in (1, 2)]
    command = f"calibrate --robot {robot} {' '.join(files)} --validation free_3.mcap --out twin.yaml"
    return Run(command, answers, short=True)


CELL = "cell/explained/report.json"
REPORT = "report/report.json"


def done(path, *says, exits=(0, 3), never=(), **more):
    """The answer of a command that is done: the facts are stated and the friction is right."""
    return Answer(exits, says, never, path, **more)


def refused(*says, never=()):
    """The answer of a command that started nothing: the facts are stated."""
    return Answer((2,), says, never)
