"""Identification of an axis: a logarithmic chirp, and the frequency response from a recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from catenary.control.compiles import Row, compiles
from catenary.control.parts import PerAxis, axis_count, checked, computed_once, table

KIND = 11.0
NUMBERS = 4  # amplitude, first, last, duration

Vector = npt.NDArray[np.float64] | Sequence[float]


@dataclass(frozen=True)
class Chirp:
    """Settings of a sine sweep whose frequency changes exponentially. The block has no memory.

    Args:
        axes: number of axes.
        amplitude: amplitude, in the unit of the quantity to which the sweep is added.
        first: frequency at the start [Hz].
        last: frequency at the end [Hz].
        duration: duration of the sweep [s]. The value is zero afterwards.

    Raises:
        ValueError: A value is NaN or out of range, the number of values is wrong, or `first` and
            `last` of an axis are equal.

    Source: Farina, Simultaneous measurement of impulse response and distortion with a swept-sine
    technique, AES 108, 2000.
    """

    axes: int
    amplitude: PerAxis
    first: PerAxis
    last: PerAxis
    duration: PerAxis

    def __post_init__(self) -> None:
        _ = self.parameters

    @property
    @computed_once
    def parameters(self) -> Row:
        """Row of parameters, shape (1 + 4 · axes,)."""
        n = axis_count(self.axes)
        amplitude = checked("amplitude", self.amplitude, n)
        names = ("first", "last", "duration")
        first, last, duration = (
            checked(name, getattr(self, name), n, above=True) for name in names
        )
        for i in np.flatnonzero(first == last).tolist():
            raise ValueError(
                f"first and last of axis {i} are both {last[i]:g} Hz; a sweep needs two frequencies"
            )
        return table(KIND, amplitude, first, last, duration)


@compiles
def chirp(parameters: Row, i: int, time: float) -> float:
    """Return the value of the sweep, A sin(2π f₀ T / ln(f₁/f₀) ((f₁/f₀)^(t/T) - 1)).

    Before the start and after the duration T, the value is 0.

    Args:
        parameters: `Chirp.parameters`.
        i: number of the axis.
        time: time since the start of the sweep [s].

    Raises:
        ValueError: `parameters` belongs to a different block.
    """
    if parameters[0] != KIND:
        raise ValueError("chirp: not the parameters of a Chirp")
    p = 1 + NUMBERS * i
    first, duration = parameters[p + 1], parameters[p + 3]
    if time < 0.0 or time > duration:
        return 0.0
    rise = math.log(parameters[p + 2] / first)
    phase = 2 * math.pi * first * duration / rise * (math.exp(rise * time / duration) - 1)
    value: float = parameters[p] * math.sin(phase)
    return value


@dataclass(frozen=True, slots=True)
class FrequencyResponse:
    """Frequency response of one axis at k frequencies.

    `frequency` (k,) is in Hz. `response` (k,) is the complex ratio of output to input. `coherence`
    (k,), 0 to 1, is the part of the output power that depends linearly on the input. The response
    is reliable where the coherence is close to 1, and NaN where the input has no signal.
    """

    frequency: Row
    response: npt.NDArray[np.complex128]
    coherence: Row

    @property
    def magnitude_db(self) -> Row:
        """Magnitude [dB], shape (k,)."""
        decibels: Row = 20 * np.log10(abs(self.response))
        return decibels

    @property
    def phase_deg(self) -> Row:
        """Unwrapped phase [degrees], shape (k,)."""
        degrees: Row = np.degrees(np.unwrap(np.angle(self.response)))
        return degrees


def frequency_response(
    given: Vector, measured: Vector, period: float, *, segment: int | None = None
) -> FrequencyResponse:
    """Estimate the frequency response of one axis from a recording.

    Args:
        given: input (k,), in any unit.
        measured: output (k,), in any unit.
        period: time between two samples [s].
        segment: samples per segment. The segments overlap by half and are averaged. None means an
            eighth of the recording. The resolution is 1 / (segment · period) [Hz].

    Returns:
        Response and coherence at the frequencies above 0 Hz.

    Raises:
        ValueError: The input and output differ in shape, the period is not positive, or the
            segment has fewer than 8 samples or does not fit at least twice.

    Source: H₁ = S_xy / S_xx by Welch's method with Hann windows, the mean of each segment removed;
    coherence `|S_xy|² / (S_xx S_yy)`. Bendat and Piersol, Random Data, ch. 6 and 9.
    """
    x, y = (np.asarray(row, dtype=np.float64) for row in (given, measured))
    if x.ndim != 1 or x.shape != y.shape:
        raise ValueError(
            f"the input has shape {x.shape}, the output {y.shape}; give two rows of equal length"
        )
    if not period > 0:
        raise ValueError(f"period={period} s must be positive")
    length = len(x) // 8 if segment is None else segment
    if not 8 <= length <= len(x):
        raise ValueError(f"segment={length} must be from 8 to {len(x)} samples (the recording)")
    begins = range(0, len(x) - length + 1, max(1, length // 2))
    if len(begins) < 2:
        raise ValueError(
            f"segment={length} fits only once into {len(x)} samples; the coherence needs at least "
            "two segments"
        )
    window = np.hanning(length + 1)[:-1]  # periodic window
    pieces_x = [
        np.fft.rfft(window * (x[k : k + length] - x[k : k + length].mean())) for k in begins
    ]
    pieces_y = [
        np.fft.rfft(window * (y[k : k + length] - y[k : k + length].mean())) for k in begins
    ]
    spectra = np.array(pieces_x)[:, 1:], np.array(pieces_y)[:, 1:]  # without the mean
    sxx, syy = ((abs(piece) ** 2).mean(axis=0) for piece in spectra)
    sxy = (spectra[0].conj() * spectra[1]).mean(axis=0)
    frequency = np.arange(1, len(sxx) + 1, dtype=np.float64) / (length * period)
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.where(sxx * syy > 0, abs(sxy) ** 2 / (sxx * syy), 0.0)
        return FrequencyResponse(frequency, sxy / sxx, coherence)
