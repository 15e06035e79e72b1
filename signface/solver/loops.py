"""The inner loop of the thin-shell solve: one small convex problem a frame, compiled.

Each frame minimises `c' A c - 2 r' c + sum_i H(c_i)`, with `H` the energy that holds weights in range and at rest
(`signface.solver.bounds`): `2 A c - 2 r + H'(c) = 0`. `A` is the same in every frame, and the slope `H'` is nearly a
piecewise linear function: straight below 0 (optima lie so little below that the exponential hardly bends), straight
in the knee of the rest energy, constant from there to 1, straight above 1. As long as no weight passes from one piece
to another, the step to a frame's optimum is the same matrix, `(2 A + diag(H''))^-1`, times the change of `r`.

So this inverse is kept from frame to frame. In each frame

1. a step with it follows the change of the markers;
2. the slopes are evaluated at the new weights. For each weight that has come to another piece (1.2 a frame at 200 Hz),
   or whose curvature is off by more than a fifth, the inverse is corrected by a matrix of rank one (Sherman and
   Morrison). Where the slopes differ from what the step took them to be, which is at few weights, another step is taken
   from those alone;
3. when they no longer differ, the gradient is computed afresh from `A`. It is what decides whether the frame is solved.
   The inverse only proposes steps, and its rounding errors cannot enter the result.

Nothing is factorised, and a frame costs a dozen products of a 48 x 48 matrix with a vector or with a few of its
entries. Each matrix is padded with weights that nothing moves, so that its rows are whole vector registers.

- `follow`: the frames of a block, one after the other.
- `products`, `finish`: what is multiplied before and after.
"""

from __future__ import annotations

from math import exp, inf, isfinite, log1p, sqrt

from signface.compiling import compiled

#: Steps after which a frame is left to the damped method.
QUICK_STEPS = 60
#: Steps that are taken whole, whatever they lead to: nearly all frames need no more.
TRUSTED = 16
#: Points tried along a later step.
TRIALS = 12
#: A curvature in the kept inverse may be off by this share.
OFF = 0.2
#: The kept inverse is made anew after so many frames: each correction rounds.
RENEW = 256
#: The kept inverse is made anew, too, when a correction would leave this share of a curvature: the rest has cancelled.
CANCELLED = 1e-4
#: Up to so many smoothings outside 0 to 1 the exponential is summed as a series, without a call.
NEAR = 0.25
#: Sums may be reordered and fused; NaN and infinity keep their meaning.
_FASTMATH = {"contract", "reassoc", "nsz", "arcp"}


@compiled(fastmath=_FASTMATH)
def products(rows, matrix, out):
    """`out[f, i] = rows[f] . matrix[i]`, four rows by two at a time."""
    for f0 in range(0, len(rows), 4):
        f1, f2, f3 = min(f0 + 1, len(rows) - 1), min(f0 + 2, len(rows) - 1), min(f0 + 3, len(rows) - 1)
        for i in range(0, len(matrix), 2):
            s00 = s01 = s10 = s11 = s20 = s21 = s30 = s31 = 0.0
            for j in range(matrix.shape[1]):
                u, v = matrix[i, j], matrix[i + 1, j]
                s00 += rows[f0, j] * u
                s01 += rows[f0, j] * v
                s10 += rows[f1, j] * u
                s11 += rows[f1, j] * v
                s20 += rows[f2, j] * u
                s21 += rows[f2, j] * v
                s30 += rows[f3, j] * u
                s31 += rows[f3, j] * v
            out[f0, i], out[f0, i + 1], out[f1, i], out[f1, i + 1] = s00, s01, s10, s11
            out[f2, i], out[f2, i + 1], out[f3, i], out[f3, i + 1] = s20, s21, s30, s31


@compiled(fastmath=_FASTMATH)
def _combine(matrix, factors, which, some, out):
    """`out`, the sum of `factors[i] * matrix[i]` over the first `some` entries `i` of `which`."""
    for i in range(len(out)):
        out[i] = 0.0
    k = 0
    while k + 4 <= some:
        i0, i1, i2, i3 = which[k], which[k + 1], which[k + 2], which[k + 3]
        f0, f1, f2, f3 = factors[i0], factors[i1], factors[i2], factors[i3]
        for i in range(len(out)):
            out[i] += f0 * matrix[i0, i] + f1 * matrix[i1, i] + f2 * matrix[i2, i] + f3 * matrix[i3, i]
        k += 4
    while k < some:
        i0 = which[k]
        f0 = factors[i0]
        for i in range(len(out)):
            out[i] += f0 * matrix[i0, i]
        k += 1


@compiled(fastmath=_FASTMATH)
def _correct(inverse, i, change, row):
    """Make `inverse` that of a matrix whose entry (i, i) is greater by `change`; `row` is room to work in."""
    for j in range(len(row)):
        row[j] = inverse[i, j]
    factor = change / (1.0 + change * row[i])
    for j in range(len(row)):
        part = factor * row[j]
        for k in range(len(row)):
            inverse[j, k] -= part * row[k]


@compiled(fastmath=_FASTMATH)
def follow(
    right, quad, free, stiffness, smoothing, pull, knee, tolerance, inverse, state, which, age, solved, steps
):  # fmt: skip
    """Solve frames one after the other: `2 A c - right[f] + H'(c) = 0`.

    `state` and `inverse` carry over what the next call starts from: the weights in `state[0]`, the slopes taken, and
    the inverse for those; `age` is for how many frames it has been corrected, and is returned. `steps` counts a frame's
    steps, or becomes -1 where `right` has a NaN, -2 where no optimum was reached; a frame that is -2 is left out.
    What numba keeps on disk it renews when this file changes, so that constants of other modules are arguments.
    """
    n = len(quad)
    lean = pull / knee if knee > 0.0 else 0.0
    stiff = stiffness / smoothing
    near = NEAR * smoothing
    # Slopes are taken to be `taken + curve * (c - weight)` around the weights `weight`; `true` and `bend` are the
    # slopes and curvatures there. `balance` is 2 A weight.
    weight, curve, taken, true, bend = state[0], state[1], state[2], state[3], state[4]
    balance, error, move, beyond = state[5], state[6], state[7], state[8]
    for frame in range(len(right)):
        total = 0.0
        for i in range(n):
            total += right[frame, i]
        if not isfinite(total):
            steps[frame] = -1
        if steps[frame] < 0:
            for i in range(n):
                solved[frame, i] = 0.0
            continue
        steps[frame] = -2
        renew = age >= RENEW
        if renew:
            age = 0
            for i in range(n):
                which[i] = i
                bend[i], taken[i] = 0.0, pull
                if weight[i] < 0.0:
                    bend[i], taken[i] = stiff, stiff * weight[i]
                elif weight[i] < knee:
                    bend[i], taken[i] = lean, lean * weight[i]
                elif weight[i] > 1.0:
                    bend[i], taken[i] = stiff, pull + stiff * (weight[i] - 1.0)
            _combine(quad, weight, which, n, balance)
        age += 1
        for i in range(n):
            error[i] = balance[i] + taken[i] - right[frame, i]
        for step in range(QUICK_STEPS):
            some = 0
            for i in range(n):
                which[some] = i
                some += abs(error[i]) > 0.01 * tolerance
            off = 0.0
            for i in range(n):
                off += 1.0 if abs(bend[i] - curve[i]) > OFF * bend[i] else 0.0
            if off > 0.0:
                for i in range(n):
                    change = bend[i] - curve[i]
                    if abs(change) > OFF * bend[i]:
                        curve[i] = bend[i]
                        renew |= change * inverse[i, i] < CANCELLED - 1.0
                        if not renew:
                            _correct(inverse, i, change, move)
            if renew:
                renew = False
                for i in range(n):
                    for j in range(n):
                        inverse[i, j] = free[i, j]
                for i in range(n):
                    if curve[i] > 0.0:
                        _correct(inverse, i, curve[i], move)
            _combine(inverse, error, which, some, move)
            # Short loops over few arrays each, so that the compiler makes vectors of them.
            part, low, high = 1.0, 0.0, 1.0
            for i in range(n):
                taken[i] -= curve[i] * move[i]
            for i in range(n):
                weight[i] -= move[i]
            for _trial in range(TRIALS):
                # Short loops over few arrays each, so that the compiler makes vectors of them.
                for i in range(n):
                    below = -weight[i] if weight[i] < 0.0 else 0.0
                    above = weight[i] - 1.0 if weight[i] > 1.0 else 0.0
                    beyond[i] = below + above
                farthest = 0.0
                for i in range(n):
                    farthest = max(farthest, beyond[i])
                for i in range(n):  # exp(x) - 1
                    x = min(beyond[i], near) / smoothing
                    series = 1 + x / 5 * (1 + x / 6 * (1 + x / 7 * (1 + x / 8 * (1 + x / 9))))
                    beyond[i] = x * (1 + x / 2 * (1 + x / 3 * (1 + x / 4 * series)))
                for i in range(n):
                    resting = max(0.0, min(weight[i], knee))
                    held = stiffness * beyond[i]
                    true[i] = lean * resting + (-held if weight[i] < 0.0 else held)
                for i in range(n):
                    inside = lean if weight[i] < knee else 0.0
                    held = stiff * (beyond[i] + 1.0)
                    bend[i] = held if weight[i] < 0.0 or weight[i] > 1.0 else inside
                if farthest > near and stiffness > 0.0:
                    for i in range(n):
                        far = -weight[i] if weight[i] < 0.0 else weight[i] - 1.0
                        if far <= near:
                            continue
                        # Far outside, the exponential would throw the next step away. It is linearised no further out
                        # than where its slope is what the last step took it to be, or one smoothing.
                        force = -taken[i] if weight[i] < 0.0 else taken[i] - pull
                        x = min(far, smoothing * log1p(force / stiffness) if force > 0.0 else smoothing)
                        if far - x > 0.01 * smoothing:
                            farthest = inf
                        else:
                            x = far
                        bend[i] = stiff * exp(x / smoothing)
                        held = bend[i] * smoothing - stiffness + bend[i] * (far - x)
                        true[i] = -held if weight[i] < 0.0 else pull + held
                total, before, after = 0.0, 0.0, 0.0
                for i in range(n):
                    apart = true[i] - taken[i] + (1.0 - part) * error[i]
                    total += apart * apart
                    before += move[i] * error[i]
                    after += move[i] * apart
                if step < TRUSTED:
                    break
                if after < -0.25 * before:
                    high = part
                elif part < 1.0 and after > 0.9 * before:
                    low = part
                else:
                    break
                # The energy rises again at the end of the step, or has hardly fallen: seek along the step for where it
                # is about least.
                back = part - 0.5 * (low + high)
                part -= back
                for i in range(n):
                    taken[i] += back * curve[i] * move[i]
                for i in range(n):
                    weight[i] += back * move[i]
            for i in range(n):
                error[i] = true[i] - taken[i] + (1.0 - part) * error[i]
            for i in range(n):
                taken[i] = true[i]
            if total <= tolerance * tolerance and farthest < inf:
                for i in range(n):
                    which[i] = i
                _combine(quad, weight, which, n, balance)
                total = 0.0
                for i in range(n):
                    apart = balance[i] + taken[i] - right[frame, i]
                    error[i] = apart
                    total += apart * apart
                if total <= 4.0 * tolerance * tolerance:
                    steps[frame] = step + 1
                    break
                renew = True
        for i in range(n):
            solved[frame, i] = weight[i]
        if steps[frame] < 0:
            age = RENEW
            for i in range(n):
                weight[i] = 0.0
    return age


@compiled(fastmath=_FASTMATH)
def finish(rows, placed, solved, places, count, weights, residual, farthest):
    """Put weights in their places and measure how far they leave the markers: in root mean square, and at most."""
    for frame in range(len(rows)):
        total, most = 0.0, 0.0
        for j in range(0, rows.shape[1], 3):
            x = placed[frame, j] - rows[frame, j]
            y = placed[frame, j + 1] - rows[frame, j + 1]
            z = placed[frame, j + 2] - rows[frame, j + 2]
            squared = x * x + y * y + z * z
            total += squared
            most = max(most, squared)
        residual[frame], farthest[frame] = sqrt(total / count), sqrt(most)
        for i in range(len(places)):
            weights[frame, places[i]] = solved[frame, i]
