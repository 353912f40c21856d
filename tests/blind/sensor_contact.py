"""Contact mechanics of the film: curves of force, friction, and the plates that spread a load. No formula is the
catalogue's: curves come from contact integrals, loops from differential equations and relays.

Every form is drawn once (its shape) and returns a function apply(strength, x): x is the load in N on the bench's fine
clock, the result the load that the film answers to. Strength 0 is no effect.
"""

import numpy as np
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from hidden import hidden, remember


# ---- nonlinearity ----------------------------------------------------------------------------------------------------

def through_curve(levels_N, reading_N, x):
    return PchipInterpolator(levels_N, reading_N, extrapolate=True)(x)


@hidden("nonlinearity", limits=(1e-3, 1), start=(0.05, 0.8))
def hertz_spheres(rng, bench):
    """A share of the film conducts through elastic spheres pressed flat: area from the compression that solves the
    force balance of spheres of several radii between two plates, F = Σ 4/3 E √R d^1.5, area = Σ π R d."""
    radii = rng.lognormal(0, 0.5, 12)
    depth = np.linspace(0, 1, 400) ** 2
    force = (np.sqrt(radii)[:, None] * depth ** 1.5).sum(0)
    area = (radii[:, None] * depth).sum(0)
    levels, reading = force / force[-1] * bench.top_N, area / area[-1] * bench.top_N
    return lambda s, x: (1 - s) * x + s * np.interp(x, levels, reading)


@hidden("nonlinearity", limits=(1e-3, 1), start=(0.2, 1))
def greenwood_williamson(rng, bench):
    """Asperities of scattered height: F = ∫(z−d)^1.5 p(z) dz and the spots' conductance ∫(z−d)^0.5 p(z) dz."""
    a, b = rng.uniform(1, 3, 2)
    z = np.linspace(0, 1, 2000)
    p = z ** (a - 1) * (1 - z) ** (b - 1)
    gap = 1 - np.linspace(0, 1, 160) ** 2
    over = np.clip(z[None, :] - gap[:, None], 0, None)
    force, spots = over ** 1.5 @ p, over ** 0.5 @ p
    levels, reading = force / force[-1] * bench.top_N, spots / spots[-1] * bench.top_N
    keep = np.concatenate([[True], np.diff(levels) > 0])
    return lambda s, x: (1 - s) * x + s * np.interp(x, levels[keep], reading[keep])


@hidden("nonlinearity", limits=(1e-3, 1), start=(0.1, 1))
def filling_bundle(rng, bench):
    """More and more grains carry current as the film is squeezed: each grain has a first load, spread over the whole
    range with a density that rises from the lightest load on; the reading grows faster than the load."""
    spread = rng.uniform(0.15, 0.6)
    levels = np.linspace(0, bench.top_N, 300)
    first = np.sort(bench.top_N * rng.beta(spread, 1.2, 4000))
    carrying = np.searchsorted(first, levels) / len(first)
    reading = np.concatenate([[0], np.cumsum((carrying[1:] + carrying[:-1]) / 2 * np.diff(levels))])
    reading *= bench.top_N / reading[-1]
    return lambda s, x: (1 - s) * x + s * through_curve(levels, reading, x)


# ---- saturation ------------------------------------------------------------------------------------------------------

@hidden("saturation", limits=(1e-3, 6), start=(0.6, 4))
def compressed_grains(rng, bench):
    """Contacts close at random: each newton closes a share of those still open, dn/dF = (1 − n)/Fs."""
    return lambda s, x: bench.top_N / s * -np.expm1(-s * x / bench.top_N)


@hidden("saturation", limits=(3e-2, 5), start=(0.6, 3))
def magnetisation_like(rng, bench):
    return lambda s, x: bench.top_N / s * np.tanh(s * x / bench.top_N)


@hidden("saturation", limits=(3e-3, 6), start=(0.8, 4))
def two_populations(rng, bench):
    """Two kinds of contact sites of unlike affinity fill up, as in adsorption; the occupation is averaged over them."""
    weak, share = rng.uniform(0.1, 0.4), rng.uniform(0.55, 0.9)

    def apply(s, x):
        u = s * x / bench.top_N
        filled = share * u / (1 + u) + (1 - share) * np.arctan(weak * u) / weak
        return bench.top_N / s * filled

    return apply


# ---- dead zone -------------------------------------------------------------------------------------------------------

@hidden("dead-zone", limits=(2e-4, 0.4), start=(0.03, 0.3))
def closing_gaps(rng, bench):
    """The spacer's gap is wedged: patches touch one after the other between Fd (1 − w) and Fd (1 + w)."""
    width = rng.uniform(0.05, 0.4)
    patches = np.linspace(1 - width, 1 + width, 41)

    def apply(s, x):
        return np.mean([np.clip(x - s * bench.top_N * p, 0, None) for p in patches], axis=0)

    return apply


@hidden("dead-zone", limits=(2e-4, 0.4), start=(0.03, 0.3))
def weibull_contacts(rng, bench):
    """Each contact begins to conduct at a load of its own; the loads are Weibull with a mean of Fd."""
    shape = rng.uniform(3, 9)
    q = (np.arange(60) + 0.5) / 60
    first = (-np.log1p(-q)) ** (1 / shape)
    first /= first.mean()

    def apply(s, x):
        return np.mean([np.clip(x - s * bench.top_N * f, 0, None) for f in first], axis=0)

    return apply


@hidden("dead-zone", limits=(2e-4, 0.4), start=(0.03, 0.3))
def spring_stop(rng, bench):
    """A puck on a spring: until the stop a small part of the load leaks through, beyond it the film takes the rest."""
    leak = rng.uniform(0.01, 0.1)

    def apply(s, x):
        stop = s * bench.top_N
        corner = 0.08 * stop + 1e-12
        beyond = corner * np.logaddexp(0, (x - stop) / corner)
        return leak * np.minimum(x, stop) * 0.5 + (1 - leak * 0.5) * beyond

    return apply


# ---- hysteresis ------------------------------------------------------------------------------------------------------

def bouc_wen_state(x, limit, sharpness, asymmetry):
    """The friction force of dz = (1 − |z/limit|^n (γ + (1 − γ) sign(z dx))) dx; `limit` is an array along x, N."""
    z, out = 0.0, np.zeros(len(x))
    for i, (dx, top) in enumerate(zip(np.diff(x), limit[1:]), 1):
        if dx:
            pieces = max(1, int(8 * abs(dx) / top))
            for _ in range(pieces):
                along = 1 if z * dx > 0 else -1
                z += dx / pieces * (1 - abs(z / top) ** sharpness * (asymmetry + (1 - asymmetry) * along))
        z = min(max(z, -top), top)
        out[i] = z
    return out


@hidden("hysteresis", limits=(1e-3, 1), start=(0.1, 0.9))
def bouc_wen(rng, bench):
    """Friction with a soft yield: the film feels the load less a part of what friction carries."""
    limit = bench.top_N * rng.uniform(0.06, 0.25)
    sharpness, asymmetry = rng.uniform(1, 3), rng.uniform(0.3, 0.7)
    friction = remember(lambda x: bouc_wen_state(x, np.full(len(x), limit), sharpness, asymmetry))
    return lambda s, x: x - s * friction(x)


@hidden("hysteresis", limits=(2e-3, 1), start=(0.1, 0.9))
def pressed_friction(rng, bench):
    """Friction between sheets is in proportion to the load that presses them: its yield follows the load, and the loop
    closes at no load."""
    mu, floor = rng.uniform(0.1, 0.35), 0.002 * bench.top_N
    sharpness = rng.uniform(1, 2.5)
    friction = remember(lambda x: bouc_wen_state(x, mu * np.abs(x) + floor, sharpness, 0.5))
    return lambda s, x: x - s * friction(x)


@hidden("hysteresis", limits=(1e-3, 1), start=(0.1, 1))
def preisach_relays(rng, bench):
    """A triangle of relays: on at α, off at β < α; the density falls with their width and is even along the mean."""
    n = 34
    edges = (np.arange(n) + 0.5) / n * bench.top_N
    alpha, beta = (a.ravel() for a in np.meshgrid(edges, edges))
    use = alpha >= beta
    alpha, beta = alpha[use], beta[use]
    width = rng.uniform(0.08, 0.2) * bench.top_N
    density = np.exp(-((alpha - beta) / width) ** rng.uniform(1, 2))
    up_order, down_order = np.argsort(alpha), np.argsort(beta)
    ups, downs = alpha[up_order], beta[down_order]

    def run(x):
        # Between two turning points relays only close or only open: their sum over a sorted threshold does the work.
        on, out, previous = np.zeros(len(alpha), bool), np.empty(len(x)), -1.0
        total = 0.0
        for i, load in enumerate(x):
            if load > previous:
                which = up_order[np.searchsorted(ups, previous, "right"):np.searchsorted(ups, load, "right")]
                which = which[~on[which]]
                on[which] = True
                total += density[which].sum()
            elif load < previous:
                which = down_order[np.searchsorted(downs, load, "left"):np.searchsorted(downs, previous, "left")]
                which = which[on[which]]
                on[which] = False
                total -= density[which].sum()
            previous = load
            out[i] = total
        return out / density.sum() * bench.top_N

    relays = remember(run)
    return lambda s, x: (1 - s) * x + s * relays(x)


@hidden("hysteresis", limits=(1e-3, 1), start=(0.15, 1))
def duhem(rng, bench):
    """Coleman and Hodgdon: dw = α |dF| (F − w) + b dF. The state follows the load after a while of travel."""
    alpha, slope = rng.uniform(4, 14) / bench.top_N, rng.uniform(0.1, 0.6)

    def run(x):
        # e = F − w obeys de/du = ±(1 − b) − α e along the travel u, which is
        # solved exactly over each step of the clock.
        steps = np.diff(x, prepend=x[0])
        fade = np.exp(-alpha * np.abs(steps))
        pull = np.sign(steps) * (1 - slope) / alpha * (1 - fade)
        e, behind = 0.0, np.empty(len(x))
        for i in range(len(x)):
            e = e * fade[i] + pull[i]
            behind[i] = e
        return x - behind

    state = remember(run)
    return lambda s, x: (1 - s) * x + s * state(x)


@hidden("hysteresis", limits=(1e-3, 1), start=(0.1, 0.9))
def stick_slip_elements(rng, bench):
    """Thirty springs that slip, in parallel; the loads at which they slip are scattered."""
    slip = bench.top_N * 0.15 * rng.weibull(rng.uniform(1, 2), 30)

    def run(x):
        carried, out = np.zeros(30), np.empty(len(x))
        out[0] = 0
        for i, step in enumerate(np.diff(x), 1):
            if step:
                carried = np.minimum(np.maximum(carried + step, -slip), slip)
            out[i] = carried.sum() if step else out[i - 1]
        return out / 30

    friction = remember(run)
    return lambda s, x: x - s * friction(x)


# ---- neighbours ------------------------------------------------------------------------------------------------------

def beam_spread(distance, length):
    """Pressure under a beam on an elastic foundation beside a point load, as a share of that below it."""
    u = np.abs(distance) / length
    return np.exp(-u) * (np.cos(u) + np.sin(u))


def half_space_spread(distance, depth):
    """Boussinesq: vertical stress at a depth below a point load on an elastic half-space, as a share of the middle's,
    averaged over a patch as wide as the sensors' pitch."""
    def patch(d):
        return quad(lambda r: (1 + (r / depth) ** 2) ** -2.5, d - 0.4, d + 0.4)[0]

    middle = patch(0.0)
    return np.vectorize(lambda d: patch(abs(d)) / middle)(np.asarray(distance, float))
