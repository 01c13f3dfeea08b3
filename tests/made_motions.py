"""Clips of the generated motion as registered examples, and bent copies of them."""

from dataclasses import replace

import numpy as np

from mocapidx.synthesis.blending import Examples
from mocapidx.synthesis.bodies import Movement, body_of, joint_points, movement_of
from mocapidx.synthesis.carrying import carried
from mocapidx.synthesis.quaternions import about_vertical, product
from mocapidx.synthesis.registration import register, star
from mocapidx.tasks.read import ReadOptions, read_recorded


def load_clip(path):
    """Body, movement and canonical positions of a motion file."""
    reading, recording, mapping = read_recorded(path, ReadOptions())
    told = reading.conventions
    body = body_of(recording, mapping, told.unit, told.root_positions)
    frames = slice(reading.source_start, None)
    movement = movement_of(
        recording, mapping, told.unit, told.up, told.root_positions, frames, reading.motion.rate
    )
    return body, movement, reading.motion.positions


def seconds(movement):
    return (len(movement.places) - 1) / movement.rate


def registered(body, movements, ties=None):
    """Examples on one body, registered with the first."""
    poses = []
    for movement in movements:
        points = joint_points(body, movement)
        count = round(seconds(movement) * 30) + 1
        poses.append(points[np.linspace(0, len(points) - 1, count).round().astype(int)])
    registration = register(
        poses,
        [seconds(movement) for movement in movements],
        star(len(movements)) if ties is None else ties,
        range(len(movements)),
        [f"clip {n}" for n in range(len(movements))],
        2 * len(movements[0].places) - 1,
    )
    return Examples(body, tuple(movements), registration)


def examples_of(paths):
    clips = [load_clip(path) for path in paths]
    target = clips[0][0]
    return registered(target, [carried(movement, body, target) for body, movement, _ in clips])


def placed_elsewhere(movement, angle, east, north):
    """The same movement by somebody who stands and faces elsewhere."""
    turns = movement.turns.copy()
    turns[:, 0] = product(about_vertical(np.array(angle)), turns[:, 0])
    flat = np.exp(1j * angle) * (movement.places[:, 2] + 1j * movement.places[:, 0])
    flat += north + 1j * east
    places = np.stack((flat.imag, movement.places[:, 1], flat.real), axis=1)
    return replace(movement, turns=turns, places=places)


def slower(movement, factor):
    """The same movement, a frame rate lower."""
    return Movement(movement.rate / factor, movement.turns, movement.places)
