"""What the quick suite must reach on every `make test`: figure → ("max" | "min", how many), of the sixty recordings.

A floor lies a little below what is reached, so that a change that costs something is seen and noise in the last digit
is not. It may be raised, never lowered without saying why in the commit."""

FLOORS = {
    "failed": ("max", 0),
    "null.false": ("max", 0),
    "one.right": ("min", 0.93),
    "one.wrong": ("max", 0.03),
    "two.right": ("min", 0.6),
    "unknown.right": ("min", 0.85),
    "unknown.wrong": ("max", 0.15),
    "stale.right": ("min", 0.9),
    "ambiguous.with": ("min", 1.0),
}


def check(figures):
    """[(text, holds)]; shares of those recordings that the figure is about."""
    lines = []
    for figure, (sense, limit) in FLOORS.items():
        yes, n = figures.get(figure, (0, 0))
        share = yes / n if n else (0.0 if sense == "max" else 1.0)
        holds = share <= limit if sense == "max" else share >= limit
        bound = f"{'at most' if sense == 'max' else 'at least'} {100 * limit:g} %"
        lines.append((f"{figure}: {yes} of {n} ({bound})", holds))
    return lines
