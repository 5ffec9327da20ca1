"""Is the tool in the cut? Evidence against a noise floor that is given or learned out of the cut."""

from __future__ import annotations

import math

from turnmill_core.monitoring.background import Background
from turnmill_core.monitoring.config import ChatterConfig
from turnmill_core.monitoring.features import Features
from turnmill_core.monitoring.spectrum import Spectrum


def learn(config: ChatterConfig, background: Background, f: Features, whole: Spectrum) -> Background:
    """Background moved towards a window judged as air (its features and spectrum).

    The first whatever it holds, unless it would show a cut; later by a twentieth; by a five-hundredth where the window
    is louder than the gate allows for air, so that a coolant pump that starts is learned within half a minute, but a
    passing sound is not. Later windows with a strong family (a tenth of the energy, with sidebands) are not learned:
    they may be chatter.
    """
    known = background.power is not None
    if f.chatter is not None and (f.chatter.sidebands and f.chatter.energy > 0.1 * f.energy if known
                                  else _lone_family(f, False)):
        return background
    quiet = f.energy < config.gate_ratio**2 * background.energy
    return background.towards(f.energy, whole, 0.05 if quiet else 0.002)


def loud(config: ChatterConfig, background: Background, energy: float) -> bool:
    """True where the floor is known and the energy in the band shows more than air."""
    floor = background.energy if config.noise_floor is None else config.noise_floor**2
    return math.isfinite(floor) and energy > config.gate_ratio**2 * floor


def plain_comb(f: Features) -> bool:
    """True where the tooth passing comb stands out of the noise.

    A third of its first harmonics, at least two, with 3 % of the energy, or fewer with half of it. Half-order
    lines that are no spindle harmonics (an odd number of teeth) belong to it: they, too, turn with the tool.
    """
    enough = f.comb >= max(2, -(-f.comb_of // 3))
    return f.tooth + f.own_half > (0.03 if enough else 0.5) * f.energy


def in_cut(config: ChatterConfig, f: Features, background: Background, chattering: bool) -> bool:
    """True where the window shows a cut.

    Either the tooth passing comb is plain, or one family of lines spaced by the tooth passing
    frequency is strong (:func:`_lone_family`), and the level exceeds the floor (where one is known) by the
    gate ratio; while chatter is held (chattering) a tenth is enough. Above a known floor it is enough,
    too, that half of the energy lies at spindle harmonics (the first left out) and in the family.
    """
    if plain_comb(f):
        return True
    floor = background.energy if config.noise_floor is None else config.noise_floor**2
    if math.isfinite(floor) and f.energy < config.gate_ratio**2 * floor:
        return False
    c = f.chatter
    turning = f.synchronous - f.once + f.own_half + (c.energy if c is not None else 0.0)
    if math.isfinite(floor) and turning > 0.5 * f.energy:
        return True
    if c is None:
        return False
    return c.energy > 0.1 * f.energy if chattering else _lone_family(f, math.isfinite(floor))


def _lone_family(f: Features, floor_known: bool) -> bool:
    """True where a family by itself shows a cut: a sideband and a fifth of the energy.

    Where no floor is known, two sidebands and half of it: two tones of the machine may happen to be a tooth passing
    frequency apart.
    """
    c, (sidebands, share) = f.chatter, (1, 0.2) if floor_known else (2, 0.5)
    return c is not None and c.sidebands >= sidebands and c.energy > share * f.energy
