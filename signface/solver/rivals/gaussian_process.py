"""Gaussian processes from marker positions to weights (Reverdy 2019, 3.3.1, eq. 3.2 to 3.4).

- `GaussianProcess`: the exact posterior mean.
- `SparseOnlineGaussianProcess`: the same seen frame by frame, on a small set of basis vectors.

Both are estimators in scikit-learn's manner and share one kernel over all outputs: a squared exponential whose length
and noise are those of the greatest marginal likelihood on a grid (C. Rasmussen and C. Williams, Gaussian Processes for
Machine Learning, 2006, 5.4).
"""

from __future__ import annotations

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin

#: Lengths tried, in units of the square root of the number of inputs, and shares of noise in the outputs' variance.
LENGTHS = (0.5, 1.0, 2.0, 4.0, 8.0)
NOISES = (1e-4, 1e-3, 1e-2, 1e-1)
#: Examples on which length and noise are chosen.
CHOSEN_ON = 240
#: Outputs that vary less than this are left as they are: to scale them up would be to learn noise.
STILL = 1e-3
#: A new example of whose kernel less than this share is not explained by the basis vectors adds none: with smaller ones
#: the recursion loses its digits.
NOVEL = 1e-4


def gaussian_kernel(a: np.ndarray, b: np.ndarray, length: float) -> np.ndarray:
    """(A, B) `exp(-|a - b|^2 / 2 length^2)` of (A, k) and (B, k) points."""
    squared = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
    return np.exp(-np.maximum(squared, 0.0) / (2.0 * length**2))


def choose_kernel(inputs: np.ndarray, outputs: np.ndarray) -> tuple[float, float]:
    """Length and noise of the greatest marginal likelihood on the grid, the amplitude at its own optimum.

    Parameters
    ----------
    inputs : (F, D) array
    outputs : (F, N) array
        About their mean.

    Returns
    -------
    (float, float)
        Length in the inputs' unit, and noise variance as a share of the kernel's amplitude.
    """
    some = np.linspace(0, len(inputs) - 1, min(CHOSEN_ON, len(inputs))).astype(int)
    inputs, outputs = inputs[some], outputs[some]
    best = (-np.inf, 1.0, NOISES[0])
    for factor in LENGTHS:
        length = factor * np.sqrt(inputs.shape[1])
        values, vectors = np.linalg.eigh(gaussian_kernel(inputs, inputs, length))
        squared = (vectors.T @ outputs) ** 2
        for noise in NOISES:
            spread = np.maximum(values, 0.0) + noise
            amplitude = (squared / spread[:, None]).mean()
            likelihood = -np.log(amplitude) - np.log(spread).mean()
            best = max(best, (float(likelihood), float(length), noise))
    return best[1], best[2]


class _Scaled(RegressorMixin, BaseEstimator):
    """What both share: outputs about their mean and divided by their standard deviation."""

    def _scale(self, outputs: np.ndarray) -> np.ndarray:
        self.mean_ = outputs.mean(axis=0)
        self.deviation_ = np.maximum(outputs.std(axis=0), STILL)
        return (outputs - self.mean_) / self.deviation_


class GaussianProcess(_Scaled):
    """Gaussian process regression, by scikit-learn's, with several outputs.

    Examples
    --------
    >>> x = np.linspace(0, 6, 40)[:, None]
    >>> model = GaussianProcess().fit(x, np.sin(x))
    >>> bool(abs(model.predict([[1.0]])[0, 0] - np.sin(1.0)) < 0.01)
    True
    """

    def fit(self, X: np.ndarray, y: np.ndarray) -> GaussianProcess:
        """Learn from (F, D) inputs and (F, N) outputs."""
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF

        X, scaled = np.asarray(X, dtype=np.float64), self._scale(np.asarray(y, dtype=np.float64))
        self.length_, self.noise_ = choose_kernel(X, scaled)
        kernel = RBF(self.length_, length_scale_bounds="fixed")
        self.process_ = GaussianProcessRegressor(kernel, alpha=self.noise_, optimizer=None).fit(X, scaled)
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """(F, N) posterior means."""
        scaled = self.process_.predict(np.asarray(X, dtype=np.float64))
        return self.mean_ + self.deviation_ * scaled.reshape(len(scaled), -1)


class SparseOnlineGaussianProcess(_Scaled):
    """The sparse online Gaussian process of L. Csató and M. Opper (2002) for regression with Gaussian noise.

    Examples are seen once, in time order. The posterior is kept as `alpha` (mean) and `C` (covariance) on at most
    `basis` inputs; when one more would be too many, the one whose loss changes the posterior mean least is projected
    away (their eq. 3.25 and 3.26, and the score `|alpha_i|^2 / (Q_ii + C_ii)`).

    Parameters
    ----------
    basis : int
        Most basis vectors.
    """

    def __init__(self, basis: int = 150) -> None:
        self.basis = basis

    def fit(self, X: np.ndarray, y: np.ndarray) -> SparseOnlineGaussianProcess:
        """Learn from (F, D) inputs and (F, N) outputs, in their order."""
        X, scaled = np.asarray(X, dtype=np.float64), self._scale(np.asarray(y, dtype=np.float64))
        self.length_, self.noise_ = choose_kernel(X, scaled)
        size = self.basis + 1
        self.vectors_ = np.zeros((size, X.shape[1]))
        self._alpha = np.zeros((size, scaled.shape[1]))
        self._c, self._q = np.zeros((size, size)), np.zeros((size, size))
        self._count = 0
        for row, target in zip(X, scaled):
            self._see(row, target)
        self.vectors_ = self.vectors_[: self._count].copy()
        self.alpha_ = self._alpha[: self._count].copy()
        del self._alpha, self._c, self._q
        return self

    def _see(self, row: np.ndarray, target: np.ndarray) -> None:
        n = self._count
        k = gaussian_kernel(row[None], self.vectors_[:n], self.length_)[0]
        ck = self._c[:n, :n] @ k
        variance = self.noise_ + 1.0 + k @ ck
        pull = (target - k @ self._alpha[:n]) / variance
        known = self._q[:n, :n] @ k
        novelty = 1.0 - k @ known
        if novelty < NOVEL:
            step = ck + known
            self._alpha[:n] += step[:, None] * pull
            self._c[:n, :n] -= np.outer(step, step) / variance
            return
        step = np.append(ck, 1.0)
        self.vectors_[n] = row
        self._alpha[n] = 0.0
        for matrix in (self._c, self._q):
            matrix[n, : n + 1] = matrix[: n + 1, n] = 0.0
        self._alpha[: n + 1] += step[:, None] * pull
        self._c[: n + 1, : n + 1] -= np.outer(step, step) / variance
        new = np.append(known, -1.0)
        self._q[: n + 1, : n + 1] += np.outer(new, new) / novelty
        self._count = n + 1
        if self._count > self.basis:
            self._drop()

    def _drop(self) -> None:
        n = self._count
        alpha, c, q = self._alpha[:n], self._c[:n, :n], self._q[:n, :n]
        diagonal = np.maximum(np.diag(q) + np.diag(c), 1e-12)
        out = int(np.argmin((alpha**2).sum(axis=1) / diagonal))
        q_out, c_out, column_q, column_c = q[out, out], c[out, out], q[:, out].copy(), c[:, out].copy()
        alpha -= np.outer(column_q / q_out, alpha[out])
        crossed = np.outer(column_q, column_c) / q_out
        c += c_out * np.outer(column_q, column_q) / q_out**2 - crossed - crossed.T
        q -= np.outer(column_q, column_q) / q_out
        last = n - 1  # the last takes the place of the one that goes
        for matrix in (self._c, self._q):
            matrix[out, :n], matrix[:n, out] = matrix[last, :n].copy(), matrix[:n, last].copy()
            matrix[out, out] = matrix[last, last]
        self._alpha[out], self.vectors_[out] = self._alpha[last], self.vectors_[last]
        self._count = last

    def predict(self, X: np.ndarray) -> np.ndarray:
        """(F, N) posterior means."""
        kernel = gaussian_kernel(np.asarray(X, dtype=np.float64), self.vectors_, self.length_)
        return self.mean_ + self.deviation_ * (kernel @ self.alpha_)
