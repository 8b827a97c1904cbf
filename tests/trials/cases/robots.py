"""Robots that cannot be: inertias that no body has."""

from lib.arm import ARM, mjcf, urdf
from lib.session import session
from lib.trial import CELL, REPORT, Run, Trial, calibrate, done, explain, init, near, refused

NO_BODY = (
    r"impossible|cannot (be|have|belong)|not possible|unphysical|not physical|implausib|invalid|triangle|"
    r"positive[- ](semi)?definite|no (rigid |real )?body|inconsistent|negative"
)
# Findings about the drives that the broken inertia imitates.
IMITATIONS = (r"recorded 0?\.\d+ (\([^)]*\) )?times", r"masses are in kg, not")


def row_major(inertia):
    """xx xy xz / yx yy yz read as xx xy xz yy yz zz."""
    ixx, ixy, ixz, iyy, iyz, _ = inertia
    return (ixx, ixy, ixz, ixy, iyy, iyz)


def diagonal_first(inertia):
    """xx yy zz xy xz yz read as xx xy xz yy yz zz."""
    ixx, ixy, ixz, iyy, iyz, izz = inertia
    return (ixx, iyy, izz, ixy, ixz, iyz)


def inertia_of(link, change):
    joint = next(j for j in ARM.joints if j.link == link)
    return ARM.with_link(link, inertia=change(joint.inertia))


def pipeline(folder):
    """A pipeline for `check`, which opens the robot and nothing else."""
    (folder / "pipeline.yaml").write_text(
        "version: 1\n"
        "cells: {crane: {robot: arm.urdf}}\n"
        "stages:\n"
        "  - {name: ingest, ingest: {file: {path: free_1.mcap}}}\n"
        "  - {name: twin, input: ingest, twin: {}}\n"
        "  - {name: record, inputs: [ingest, twin], record: {mcap: x.mcap}}\n"
    )


def trial(name, arm, *facts, friction=True):
    """Every command that opens the robot must state the facts. Each may refuse it or go on with true results."""

    def make(folder):
        session(robot=urdf(arm))(folder)
        pipeline(folder)

    def answers(path):
        finished = done(path if friction else "", *facts, never=IMITATIONS)
        return (finished, refused(*facts))

    return Trial(
        name,
        make,
        (
            Run("check pipeline.yaml", answers(""), short=True),
            calibrate(*answers("")),
            init(*answers(CELL)),
            explain(*answers(REPORT)),
        ),
    )


def inertia_named(link):
    return near(rf"\b{link}\b", "inertia", NO_BODY)


def with_izz(izz):
    return lambda inertia: (*inertia[:5], izz)


FER_LINK4 = (0.00784585566, -0.00339591957, 0.00158704074, 0.00649543136, -0.00181477884, 0.01003079917)


def other_formats(folder):
    session()(folder)
    (folder / "arm.xacro").write_text(
        '<?xml version="1.0"?>\n<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="crane5">\n'
        '  <xacro:property name="height" value="0.18"/>\n  <link name="foot"/>\n'
        '  <xacro:include filename="$(find crane5_description)/urdf/links.xacro"/>\n</robot>\n'
    )
    (folder / "arm.xml").write_text(mjcf())
    (folder / "massless.xml").write_text(
        '<mujoco model="crane5">\n  <worldbody>\n    <body name="column">\n'
        '      <joint name="j_base" axis="0 0 1"/>\n    </body>\n  </worldbody>\n</mujoco>\n'
    )


TRIALS = [
    trial("inertia-decimal", inertia_of("column", with_izz(9.3)), inertia_named("column")),
    trial(
        "inertia-offdiagonal",
        inertia_of("stick", lambda i: (i[0], 0.03, *i[2:])),
        inertia_named("stick"),
    ),
    # Every inertia is a million times too large: only a refusal, or a correction, can give true results.
    trial(
        "inertia-mm2",
        ARM.scaled_inertias(1e6),
        near("inertia", r"mm|millimet|10\^?-?6|1e-?6|1[ ,']?000[ ,']?000|million|scale|unit"),
        r"\b(every|all|each|5)\b|" + near(*(rf"\b{link}\b" for link in ("column", "plate"))),
    ),
    trial("inertia-row-major", inertia_of("boom", row_major), inertia_named("boom")),
    trial("inertia-negative", inertia_of("stick", lambda i: (*i[:5], -i[5])), inertia_named("stick")),
    trial("inertia-diagonal-first", inertia_of("knuckle", diagonal_first), inertia_named("knuckle")),
    # The triangle inequality fails by a tenth only.
    trial("report-fer-link4", ARM.with_link("stick", inertia=FER_LINK4), inertia_named("stick")),
    # Numbers written under a locale whose decimal separator is the comma; the first is in line 7.
    Trial(
        "report-urdf-locale",
        session(robot=urdf(decimal=",")),
        tuple(
            run(refused(r"0,18", r"number|comma|decimal", r"arm\.urdf:7\b|line 7\b"))
            for run in (calibrate, init, explain)
        ),
    ),
    Trial(
        "robot-formats",
        other_formats,
        (
            init(refused("xacro", r"xacro \S+\.xacro"), robot="arm.xacro", short=True),
            explain(refused("xacro", r"xacro \S+\.xacro"), robot="arm.xacro"),
            init(refused(r"MJCF|MuJoCo", near("column", "mass")), robot="massless.xml", short=True),
            explain(done(REPORT), robot="arm.xml"),
        ),
    ),
]
