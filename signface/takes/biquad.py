"""A second-order recursive filter, forward and backward over many signals at once, compiled."""

from __future__ import annotations

import numpy as np

from signface.compiling import compiled


@compiled()
def forward_and_backward(signals, b, a, rest):
    """Filter (n, K) signals in place along the first axis, forward and then backward.

    `b` (3) and `a` (3, the first one 1) are the filter's coefficients; `rest` (2) is its state in the steady answer to
    a constant 1, from which each direction starts, times the first sample.
    """
    n, count = signals.shape
    one, two = np.empty(count), np.empty(count)
    for direction in range(2):
        first = 0 if direction == 0 else n - 1
        for k in range(count):
            one[k] = rest[0] * signals[first, k]
            two[k] = rest[1] * signals[first, k]
        for step in range(n):
            frame = step if direction == 0 else n - 1 - step
            for k in range(count):
                given = signals[frame, k]
                answer = b[0] * given + one[k]
                one[k] = b[1] * given - a[1] * answer + two[k]
                two[k] = b[2] * given - a[2] * answer
                signals[frame, k] = answer
