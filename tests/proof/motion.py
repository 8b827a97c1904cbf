"""Commanded motions at 1 kHz: point to point with rests, sums of harmonics, slow sweeps.

All start and end at rest, stay within the joint limits and well within the velocity limits, and leave torque to spare.
"""
import numpy as np

RATE = 1000  # Hz, of the commands and of the controller


def span(robot, rng):
    """Centre and half width of the range moved, per joint (rad or m)."""
    low, high = np.maximum(robot.lower, -2.6) + 0.1, np.minimum(robot.upper, 2.6) - 0.1
    slide = robot.slides
    low[slide], high[slide] = robot.lower[slide] + 0.02, robot.upper[slide] - 0.02
    half = np.minimum(rng.uniform(0.5, 1.2, robot.n), 0.45 * (high - low))
    half[slide] = rng.uniform(0.25, 0.45) * (high - low)[slide]
    return rng.uniform(low + half, high - half), half


def smooth(x, seconds):
    """Moving average, held at both ends."""
    k = max(1, int(seconds * RATE)) | 1
    padded = np.concatenate([np.repeat(x[:1], k // 2, 0), x, np.repeat(x[-1:], k // 2, 0)])
    total = np.cumsum(np.concatenate([np.zeros_like(x[:1]), padded]), axis=0)
    return (total[k:] - total[:-k]) / k


def via(robot, rng, seconds, pace):
    """Point to point on quintics, all joints at once or one after the other, with rests."""
    centre, half = span(robot, rng)
    rows, q, total = [], centre + half * rng.uniform(-0.7, 0.7, robot.n), int(seconds * RATE)
    rows.append(np.repeat(q[None], int(rng.uniform(0.05, 0.3) * RATE), 0))
    while sum(map(len, rows)) < total:
        goal = centre + half * rng.uniform(-1., 1., robot.n)
        if rng.random() < 0.15:                                   # sometimes only a few joints move
            goal = np.where(rng.random(robot.n) < 0.5, goal, q)
        # A quintic's largest speed is 15/8 of the mean, its largest acceleration 5.77 d/T^2.
        need = np.abs(goal - q) * 1.875 / (pace * robot.speed)
        accel = np.sqrt(np.abs(goal - q) * 5.77 / (4. * pace * robot.speed))
        T = max(0.35, need.max(), accel.max())
        s = np.linspace(0., 1., int(T * RATE) + 1)[1:, None]
        rows.append(q + (goal - q) * (10 * s**3 - 15 * s**4 + 6 * s**5))
        q = goal
        rows.append(np.repeat(q[None], int(rng.uniform(0.15, 0.6) * RATE), 0))
    return np.concatenate(rows)[:total]


def fourier(robot, rng, seconds, pace):
    """Five harmonics per joint of a common base frequency, faded in and out."""
    centre, half = span(robot, rng)
    t = np.arange(int(seconds * RATE)) / RATE
    w = 2 * np.pi * rng.uniform(0.08, 0.16)
    x = np.zeros((len(t), robot.n))
    for h in range(1, 6):
        a, b = rng.normal(size=(2, robot.n)) / h**0.6
        x += a * np.sin(h * w * t)[:, None] + b * np.cos(h * w * t)[:, None]
    x -= x.mean(0)
    speed = np.abs(np.gradient(x, 1 / RATE, axis=0)).max(0)
    x *= np.minimum(half / np.abs(x).max(0), pace * robot.speed / speed)
    s = np.clip(np.minimum(t, t[-1] - t) / 0.8, 0., 1.)
    return centre + x * (10 * s**3 - 15 * s**4 + 6 * s**5)[:, None]


def sweep(robot, rng, seconds, pace):
    """Slow back and forth at constant speed; a joint may rest."""
    centre, half = span(robot, rng)
    t = np.arange(int(seconds * RATE)) / RATE
    speed = rng.uniform(0.12, 0.45, robot.n) * np.minimum(1., pace * robot.speed)
    half = np.where(robot.slides, half, np.minimum(half, rng.uniform(0.3, 0.8, robot.n)))
    x = (speed * (t[:, None] + rng.uniform(0., 10., robot.n))) / half % 4.
    q = centre + half * (np.abs(x - 2.) - 1.)
    rest = rng.random(robot.n) < 0.07
    q[:, rest] = centre[rest]
    q[:int(0.15 * RATE)], q[-int(0.1 * RATE):] = q[int(0.15 * RATE)], q[-int(0.1 * RATE)]
    return smooth(smooth(q, 0.15), 0.1)


KINDS = {"via": via, "fourier": fourier, "sweep": sweep}


def derivatives(q):
    v = np.gradient(q, 1 / RATE, axis=0)
    return v, np.gradient(v, 1 / RATE, axis=0)


def draw(robot, rng, kind, seconds):
    """Commanded positions (samples x joints) at 1 kHz of one recording, slowed until its torques are in reach."""
    pace = rng.uniform(0.4, 0.62)
    for _ in range(6):
        q = KINDS[kind](robot, rng, seconds, pace)
        v, a = derivatives(q)
        torque = robot.nominal.rnea(q[::20], v[::20], a[::20])
        if (np.abs(torque).max(0) < 0.6 * robot.effort).all():
            break
        pace *= 0.85
    return q
