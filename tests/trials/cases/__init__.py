"""The trials, by kind."""

from cases import files, publishers, robots, sound, tables, time, values, velocity

ALL = [
    trial
    for module in (sound, robots, publishers, values, velocity, time, tables, files)
    for trial in module.TRIALS
]
