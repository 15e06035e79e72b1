"""A cumulative logit model with random effects: Likert answers and right-or-wrong answers of people who answer often.

- `OrdinalMixedModel`: built from answers, fixed effects and groupings, then fitted.
- `OrdinalFit`: coefficients, standard deviations of the random effects, log-likelihood.

Statsmodels has no ordinal model with random effects, so this one is ours. The model is

    logit P(yᵢ ≤ k) = θₖ − (xᵢ'β + Σ_g b_{g, level of i}),    b_g ~ N(0, σ_g²),

any number of crossed or nested groupings g (participants, participants × methods, stimuli). With two answers, right and
wrong, it is the logistic mixed model. The likelihood is Laplace's approximation, as in R's `ordinal::clmm` (Christensen
2019), with which the tests compare it; its gradient is exact.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.special import expit
from threadpoolctl import threadpool_limits

from signface.errors import SignfaceError
from signface.study.statistics.random_effects import Levels

Array = NDArray[np.float64]

#: A model that is not at its maximum after so many steps is reported as not converged.
MOST_STEPS = 400


@dataclass(frozen=True)
class OrdinalFit:
    """A fitted model.

    Parameters
    ----------
    thresholds : ndarray (K − 1,)
        θ, rising.
    coefficients : ndarray (B,)
        β, in logits: positive means higher answers.
    covariance : ndarray (B, B)
        Of β, from the observed information of all parameters.
    spreads : ndarray (G,)
        σ of each grouping, in logits.
    log_likelihood : float
        At the maximum, Laplace's approximation.
    converged : bool
    """

    thresholds: Array
    coefficients: Array
    covariance: Array
    spreads: Array
    log_likelihood: float
    converged: bool

    def contrast(self, weights: ArrayLike) -> tuple[float, float]:
        """A weighted sum of the coefficients and its standard error."""
        along = np.asarray(weights, float)
        return float(along @ self.coefficients), math.sqrt(max(0.0, float(along @ self.covariance @ along)))


class OrdinalMixedModel:
    """Cumulative logit model with normal random intercepts.

    Parameters
    ----------
    answers : array_like (n,)
        Ordered answers, any numbers; those that occur are the categories.
    fixed : array_like (n, B)
        Fixed effects, without a constant (the thresholds stand for it). B may be 0.
    groupings : sequence of array_like (n,)
        The level of each random intercept, one array per grouping.

    Raises
    ------
    SignfaceError
        There are fewer than two categories.

    Examples
    --------
    >>> model = OrdinalMixedModel([1, 2, 2, 3, 1, 3], np.zeros((6, 0)), [])
    >>> np.round(model.fit().thresholds, 3).tolist()  # a third, two thirds of the answers lie below
    [-0.693, 0.693]
    """

    def __init__(self, answers: ArrayLike, fixed: ArrayLike, groupings: Sequence[ArrayLike]) -> None:
        values, self._answers = np.unique(np.asarray(answers, float), return_inverse=True)
        if len(values) < 2:
            raise SignfaceError("an ordinal model needs two different answers", hint="leave this question out")
        self._fixed = np.asarray(fixed, float)
        self._cuts = len(values) - 1
        self._levels = Levels(len(self._answers), groupings)
        # which threshold bounds an answer above and below: index 0 is −∞, the last +∞
        self._above, self._below = self._answers + 1, self._answers
        self._modes = np.zeros(self._levels.size)

    @threadpool_limits.wrap(limits=1, user_api="blas")  # small matrices: threads that wait for each other cost tenfold
    def fit(self) -> OrdinalFit:
        """Maximise the likelihood."""
        shares = np.cumsum(np.bincount(self._answers))[:-1] / len(self._answers)
        start_cuts = np.log(shares / (1 - shares))
        start = np.concatenate(
            [
                start_cuts[:1],
                np.log(np.diff(start_cuts)),
                np.zeros(self._fixed.shape[1]),
                np.full(self._levels.groups, 0.5),
            ]
        )
        self._modes = np.zeros(self._levels.size)
        optimum = minimize(
            self._negative, start, jac=True, method="BFGS", options={"gtol": 1e-4, "maxiter": MOST_STEPS}
        )
        information = self._information(optimum.x)
        gradient = np.abs(self._negative(optimum.x)[1]).max()
        try:
            covariance = np.linalg.inv(information)
        except np.linalg.LinAlgError:
            covariance = np.full_like(information, np.nan)
        cuts, width = self._cuts, self._fixed.shape[1]
        fixed = slice(cuts, cuts + width)
        return OrdinalFit(
            self._thresholds(optimum.x[:cuts]),
            optimum.x[fixed],
            np.asarray(covariance[fixed, fixed], float),
            np.abs(optimum.x[cuts + width :]).astype(float),
            -float(optimum.fun),
            bool(gradient < 1e-2 and np.isfinite(optimum.fun)),
        )

    def _information(self, point: Array) -> Array:
        """Second derivatives of the negative log-likelihood, by central differences of its exact gradient."""
        step, rows = 1e-4, []
        for axis in np.eye(len(point)):
            rows.append((self._negative(point + step * axis)[1] - self._negative(point - step * axis)[1]) / (2 * step))
        matrix = np.array(rows)
        matrix = (matrix + matrix.T) / 2
        # a spread at zero is a boundary, where the likelihood may be flat: its row tells nothing about the others
        flat = np.abs(point) < 1e-3
        flat[: len(point) - self._levels.groups] = False
        matrix[flat] = matrix[:, flat] = 0
        matrix[flat, flat] = 1
        return matrix

    @staticmethod
    def _thresholds(free: Array) -> Array:
        """Thresholds from the first and the logarithms of the gaps, which keeps them in order."""
        return np.concatenate([free[:1], free[0] + np.cumsum(np.exp(np.clip(free[1:], -30, 30)))])

    def _negative(self, point: Array) -> tuple[float, Array]:
        """Minus the log-likelihood and its gradient.

        With random effects b = Λz, z ~ N(0, I), the approximation is ℓ(ẑ) − ½ẑ'ẑ − ½ log|H|, H = Λ'Z'WZΛ + I and W the
        negative second derivatives of each answer's log-likelihood, at the mode ẑ.
        """
        cuts, width = self._cuts, self._fixed.shape[1]
        thetas = self._thresholds(point[:cuts])
        spreads = point[cuts + width :]
        levels = self._levels
        scale = levels.of_groups(spreads)
        base = self._fixed @ point[cuts : cuts + width]
        modes = self._find_modes(thetas, base, scale)
        curves = _Curves(thetas, base + levels.spread(scale * modes), self._above, self._below)
        hessian = levels.hessian(curves.weight, scale)
        value = curves.log.sum() - 0.5 * modes @ modes - 0.5 * hessian.log_determinant

        # The gradient has three parts: the answers' own, that of ½log|H| at a fixed mode, and that of ½log|H| through
        # the mode. `leverage` is z_i'H⁻¹z_i of each answer; `along` carries a change of modes to a change of ½log|H|.
        leverage = hessian.leverage()
        slope = 0.5 * leverage * curves.weight_eta
        along = hessian.solve(scale * levels.gather(slope))
        through = levels.spread(scale * along)
        # A change dη of the linear predictor (at fixed modes) moves the modes by −H⁻¹Λ'Z'W dη.
        by_eta = curves.eta - slope + through * curves.weight
        gradient_fixed = self._fixed.T @ by_eta
        # thresholds: the answer's two bounds move on their own; the score s_i = ∂ℓ/∂η moves the modes by H⁻¹Λ'Z' ds
        upper = curves.upper - 0.5 * leverage * curves.weight_upper - through * curves.eta_upper
        lower = curves.lower - 0.5 * leverage * curves.weight_lower - through * curves.eta_lower
        by_theta = np.bincount(self._above, upper, cuts + 2)[1:-1] + np.bincount(self._below, lower, cuts + 2)[1:-1]
        gaps = np.exp(np.clip(point[1:cuts], -30, 30))
        tails = np.cumsum(by_theta[::-1])[::-1]
        gradient_theta = np.concatenate([tails[:1], tails[1:] * gaps])
        # spreads: η moves by Z_g z_g; Λ itself stands in H and in the mode's equation Λ'Z's = z
        score, trace = levels.gather(curves.eta), hessian.trace()
        gradient_spread = np.zeros(levels.groups)
        for group, column in enumerate(levels.columns.T):
            distinct = np.unique(column)
            gradient_spread[group] = by_eta @ modes[column] - trace[distinct].sum() - along[distinct] @ score[distinct]
        gradient = np.concatenate([gradient_theta, gradient_fixed, gradient_spread])
        if not np.isfinite(value):
            return 1e10, np.zeros_like(gradient)
        return -float(value), -gradient

    def _find_modes(self, thetas: Array, base: Array, scale: Array) -> Array:
        """The random effects of largest joint density, by Newton's method with halved steps."""
        if not len(scale):
            return self._modes
        modes = self._modes.copy()

        def joint(at: Array) -> tuple[float, _Curves]:
            curves = _Curves(thetas, base + self._levels.spread(scale * at), self._above, self._below)
            return float(curves.log.sum() - 0.5 * at @ at), curves

        height, curves = joint(modes)
        if not np.isfinite(height):
            modes = np.zeros_like(modes)
            height, curves = joint(modes)
        for _ in range(50):
            slope = scale * self._levels.gather(curves.eta) - modes
            if np.abs(slope).max() < 1e-8:
                break
            step = self._levels.hessian(curves.weight, scale).solve(slope)
            for _ in range(30):
                taller, new = joint(modes + step)
                if taller >= height - 1e-12 * (1 + abs(height)):  # rounding of a sum of thousands of terms
                    break
                step = step / 2
            modes, height, curves = modes + step, taller, new
        self._modes = modes
        return modes


class _Curves:
    """The log-likelihood of each answer, log(F(u) − F(l)), u = θ_above − η and l = θ_below − η, and its derivatives.

    `eta`: by η. `weight`: minus the second by η. `weight_eta`: of `weight` by η. `upper`, `lower`: by the thresholds;
    `eta_upper`, `weight_lower` and the like: of `eta` and `weight` by them. All (n,).
    """

    def __init__(self, thetas: Array, predictor: Array, above: NDArray[np.intp], below: NDArray[np.intp]) -> None:
        bounds = np.concatenate([[-np.inf], thetas, [np.inf]])
        u, low = bounds[above] - predictor, bounds[below] - predictor
        # P(l < · ≤ u) computed in the tail where both are small, so that no digits cancel
        flip = np.where(np.isfinite(low), low, u) > 0
        chance = np.where(flip, expit(-low) - expit(-u), expit(u) - expit(low))
        chance = np.maximum(chance, 1e-300)
        fu, fl = expit(u) * expit(-u), expit(low) * expit(-low)
        du, dl = fu * (1 - 2 * expit(u)), fl * (1 - 2 * expit(low))
        ddu, ddl = fu * (1 - 6 * fu), fl * (1 - 6 * fl)
        self.log = np.log(chance)
        self.upper, self.lower = fu / chance, -fl / chance
        g, curve = self.upper + self.lower, (du - dl) / chance
        self.eta = -g
        self.weight = g**2 - curve
        g_upper = du / chance - g * self.upper
        g_lower = -dl / chance - g * self.lower
        self.eta_upper, self.eta_lower = -g_upper, -g_lower
        self.weight_upper = 2 * g * g_upper - ddu / chance + curve * self.upper
        self.weight_lower = 2 * g * g_lower + ddl / chance + curve * self.lower
        self.weight_eta = -(self.weight_upper + self.weight_lower)
