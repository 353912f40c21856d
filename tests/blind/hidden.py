"""The registry of hidden effects: every form of every cause, under the cause's name."""

from dataclasses import dataclass, field
from typing import Callable

FORMS = {}


@dataclass
class Hidden:
    """One effect as this recording has it. apply: see the benches; strength from limits[0] to limits[1], start: where a
    plausible strength lies; weight: how much of it each output shows (1 unless said)."""

    effect: str
    form: str
    apply: Callable
    limits: tuple
    start: tuple
    stage: str
    weight: dict = field(default_factory=dict)
    details: dict = field(default_factory=dict)


def hidden(effect, limits, start, stage="load"):
    """Registers `draw(rng, bench) → apply` as a form of the effect."""
    def register(draw):
        def make(rng, bench):
            made = draw(rng, bench)
            apply, details = made if isinstance(made, tuple) else (made, {})
            span = details.pop("limits", limits), details.pop("start", start)
            return Hidden(effect, draw.__name__, apply, span[0], span[1], details.pop("stage", stage), {}, details)

        FORMS.setdefault(effect, []).append(make)
        make.__name__ = draw.__name__
        make.__doc__ = draw.__doc__
        return make

    return register


def sign_of(rng):
    return float(rng.choice([-1, 1]))


def remember(function, size=4):
    """The function with its last results kept: a memory that takes long to follow does not change with the strength."""
    kept = {}

    def call(x):
        key = hash(x.tobytes())
        if key not in kept:
            if len(kept) >= size:
                kept.pop(next(iter(kept)))
            kept[key] = function(x)
        return kept[key]

    return call
