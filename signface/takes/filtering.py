"""Low-pass filters without lag, for marker trajectories.

- `lowpass`: a take, filtered; `butterworth` or `raised-sine`.
- `Lowpass`: the same as a stage, for any recording.
- `raised_sine_response`: the spectral window of equation 7.1.
- `lowpass_response`: what either filter leaves of each frequency.
"""

from __future__ import annotations

import numpy as np

from signface.errors import SignfaceError
from signface.frames import runs
from signface.takes.stages import Block, Stage, View, run
from signface.takes.take import Take

#: Half of the power passes at this frequency. A lid closes in some 120 ms; its path keeps 99 % of its depth.
CUTOFF_HZ = 12.0

#: A cutoff above this part of the rate leaves nothing to remove.
HIGHEST_CUTOFF = 0.45

#: Poles of the Butterworth filter in one direction; it goes over the data twice.
ORDER = 2

#: What is left of a frame's influence where it no longer counts: 10 mm become less than positions are rounded to.
FORGOTTEN = 1e-18


def raised_sine_response(frequencies: np.ndarray, cutoff_hz: float, width_hz: float) -> np.ndarray:
    """Gain of the raised-sine window: 1 up to `cutoff - width/2`, 0 from `cutoff + width/2`, half a sine between.

    Equation 7.1 of the thesis of Kouadio (1997).

    Parameters
    ----------
    frequencies : array, Hz
    cutoff_hz : float
        Where the gain is 0.5.
    width_hz : float
        Width of the passage from 1 to 0.
    """
    phase = np.clip((cutoff_hz - frequencies) / width_hz, -0.5, 0.5) * np.pi
    return (np.sin(phase) + 1) / 2


def _raised_sine(signals: np.ndarray, rate: float, cutoff_hz: float) -> np.ndarray:
    """(n, K) signals that begin and end at 0 through the spectral window, reflected oddly at both ends.

    Such a run is the half of an odd periodic signal, whose Fourier transform is a sine transform: neither a jump nor a
    corner appears at the ends.
    """
    from scipy.fft import dst, idst

    n = len(signals)
    spectrum = dst(signals[1:-1], type=1, axis=0)
    frequencies = np.arange(1, n - 1) * rate / (2 * (n - 1))
    spectrum *= raised_sine_response(frequencies, cutoff_hz, cutoff_hz / 2)[:, None]
    filtered = np.zeros_like(signals)
    filtered[1:-1] = idst(spectrum, type=1, axis=0)
    return filtered


def _butterworth_coefficients(rate: float, cutoff_hz: float) -> tuple[np.ndarray, np.ndarray]:
    """Numerator and denominator of the filter whose forward and backward passes together have -3 dB at the cutoff.

    Each pass is designed for a higher cutoff: two passes of a filter of order n have `1 / (1 + (w/w0)^2n)` for the
    gain, which is `1 / sqrt(2)` at `w = w0 (sqrt(2) - 1)^(1/2n)`. The correction is made on the analogue axis (the
    tangent), where it is exact; the bilinear transform of `1 / (s^2 + sqrt(2) s + 1)` gives the coefficients.
    """
    corner = np.tan(np.pi * cutoff_hz / rate) / (np.sqrt(2.0) - 1.0) ** (1 / (2 * ORDER))
    whole = 1.0 + np.sqrt(2.0) * corner + corner**2
    gain = corner**2 / whole
    return (
        np.array([gain, 2 * gain, gain]),
        np.array([1.0, 2 * (corner**2 - 1) / whole, (1.0 - np.sqrt(2.0) * corner + corner**2) / whole]),
    )


def _butterworth(signals: np.ndarray, rate: float, cutoff_hz: float) -> np.ndarray:
    """(n, K) signals filtered forward and backward, reflected oddly at both ends."""
    from signface.takes.biquad import forward_and_backward

    b, a = _butterworth_coefficients(rate, cutoff_hz)
    pad = min(len(signals) - 1, _forgetting(a))  # what the filter starts from does not show then
    longer = np.concatenate(
        [2 * signals[0] - signals[pad:0:-1], signals, 2 * signals[-1] - signals[-2 : -2 - pad : -1]]
    )
    forward_and_backward(longer, b, a, np.array([b[1] + b[2] - a[1] - a[2], b[2] - a[2]]))
    return longer[pad : pad + len(signals)]


def lowpass_response(frequencies: np.ndarray, rate: float, *, cutoff_hz: float, method: str) -> np.ndarray:
    """Gain of `lowpass` at some frequencies: 1 passes, 0 is filtered out; 1 everywhere where nothing is filtered.

    Parameters
    ----------
    frequencies : array, Hz
        From 0 to half the rate.
    rate : float
        Of the recording, Hz.
    cutoff_hz, method
        See `lowpass`.

    Examples
    --------
    >>> lowpass_response(np.array([0, 12.0, 60]), 200.0, cutoff_hz=12.0, method="butterworth").round(3).tolist()
    [1.0, 0.707, 0.001]
    >>> lowpass_response(np.array([0, 10.0]), 20.0, cutoff_hz=12.0, method="butterworth").tolist()
    [1.0, 1.0]
    """
    if cutoff_hz > HIGHEST_CUTOFF * rate:
        return np.ones(np.shape(frequencies))
    if method == "raised-sine":
        return raised_sine_response(frequencies, cutoff_hz, cutoff_hz / 2)
    b, a = _butterworth_coefficients(rate, cutoff_hz)
    turn = np.exp(-2j * np.pi * np.asarray(frequencies) / rate)
    return np.abs(np.polyval(b[::-1], turn) / np.polyval(a[::-1], turn)) ** 2


def _forgetting(denominator: np.ndarray) -> int:
    """After how many frames the filter has forgotten one."""
    return int(np.ceil(np.log(FORGOTTEN) / np.log(np.abs(np.roots(denominator)).max())))


def lowpass(take: Take, *, cutoff_hz: float = CUTOFF_HZ, method: str = "butterworth") -> Take:
    """The take with fast variations removed, without lag.

    Every stretch in which a marker is seen is filtered by itself: nothing leaks over a gap, and what is missing stays
    missing. Stretches of fewer than four frames stay as they are. Where the rate is too low for the cutoff
    (`cutoff > 0.45 rate`) nothing is filtered, and the history says so.

    Parameters
    ----------
    take : Take
    cutoff_hz : float
        Frequency with half the power (`butterworth`) or half the amplitude (`raised-sine`), in Hz.
    method : str
        `butterworth`, fourth order over both passes; or `raised-sine`, the spectral window of equation 7.1 of the
        thesis of Kouadio (1997) with a passage as wide as half the cutoff.

    Raises
    ------
    SignfaceError
        The cutoff is not positive, or the method is unknown.

    See Also
    --------
    signface.takes.gaps.fill_gaps : the step before.
    raised_sine_response : the spectral window.

    Examples
    --------
    >>> import signface as sf
    >>> take = sf.datasets.mini_take()
    >>> smooth = lowpass(take, cutoff_hz=8.0)
    >>> smooth.history[-1]
    'lowpass butterworth 8 Hz'
    >>> fastest = [np.nanmax(abs(np.diff(one.positions, 2, axis=0))) for one in (take, smooth)]
    >>> bool(fastest[1] < fastest[0])
    True
    """
    return run(take, Lowpass(cutoff_hz=cutoff_hz, method=method))


class Lowpass(Stage):
    """Takes fast variations away; see `lowpass`, whose parameters and errors it has.

    The Butterworth filter forgets by its poles' radius a frame, and reaches as far as numbers tell. The raised-sine
    window cuts the spectrum of the whole take, and every frame depends on every other.
    """

    alone = False

    def __init__(self, *, cutoff_hz: float = CUTOFF_HZ, method: str = "butterworth") -> None:
        if method not in ("butterworth", "raised-sine"):
            raise SignfaceError(f"no filter named {method}", hint="take butterworth or raised-sine")
        if not (np.isfinite(cutoff_hz) and cutoff_hz > 0):
            raise SignfaceError(f"the cutoff must be positive, not {cutoff_hz} Hz")
        self.cutoff_hz, self.method = cutoff_hz, method

    def learn(self, view: View) -> None:
        """The rate."""
        self._rate = view.recording.rate
        self._skipped = self.cutoff_hz > HIGHEST_CUTOFF * self._rate
        if self._skipped:
            self.reach = 0
        elif self.method == "butterworth":
            self.reach = _forgetting(_butterworth_coefficients(self._rate, self.cutoff_hz)[1])
        else:
            self.reach = None

    @property
    def note(self) -> str:
        """The filter, or why there is none."""
        if self._skipped:
            return f"lowpass skipped: {self.cutoff_hz:g} Hz is too near half the rate of {self._rate:g} Hz"
        return f"lowpass {self.method} {self.cutoff_hz:g} Hz"

    def apply(self, block: Block) -> Block:
        """The block, each stretch in which a marker is seen filtered by itself."""
        if self._skipped:
            return block
        answer = _butterworth if self.method == "butterworth" else _raised_sine
        positions = block.positions.copy()
        known = np.isfinite(positions[..., 0])
        stretches: dict[tuple[int, int], list[int]] = {}  # markers seen in the same stretch are filtered together
        for marker in range(known.shape[1]):
            for begin, end in runs(known[:, marker]):
                stretches.setdefault((int(begin), int(end)), []).append(marker)
        for (begin, end), markers in stretches.items():
            if end - begin < 4:
                continue
            signals = positions[begin:end, markers].reshape(end - begin, -1)
            share = np.linspace(0.0, 1.0, len(signals))[:, None]
            line = signals[0] * (1 - share) + signals[-1] * share  # passes as it is, however short the stretch
            smooth = line + answer(signals - line, self._rate, self.cutoff_hz)
            positions[begin:end, markers] = smooth.reshape(end - begin, len(markers), 3)
        return block.changed(positions)
