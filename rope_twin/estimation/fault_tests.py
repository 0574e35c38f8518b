"""Likelihood-ratio tests of single faults on the innovations of the top tension, sample by sample.

With innovations e (measured less predicted, before they are assimilated), their covariance S and
the signature s of a cause that begins at an onset, the generalised likelihood ratio is

    ℓ = (sᵀS⁻¹e)² / (sᵀS⁻¹s),

which has a χ² distribution of one degree without a fault (Willsky and Jones 1976, eqs. 12 to 16).
It is formed for every cause and every onset on a grid. S = L·Lᵀ grows by rows with each new sample
and is never factored again: L⁻¹ gets new rows, a row of L⁻¹s is a sum of it over the samples since
the onset (so all onsets come from one running sum), and ℓ is two running sums. Samples before the
onset have no signature but take part: they show what the figures and the coloured error did just
before, which a test of the last seconds alone cannot know. The normalised innovation squared (NIS;
Bar-Shalom, Li and Kirubarajan 2001, section 5.4) is kept for what no signature describes.

Plain rules on measured samples come before any statistics: stuck sensors and a lost payload. Stuck:
a sensor repeats its value for REPEATED_S while what it measures cannot stand still. Load pin and
motion sensor always move (noise, the sea); a repeat is ordinary where their resolution is coarse,
so the time is at least twice the longest repeat of the last minutes that ended by itself. A winch
stands still often: its encoder is stuck if it repeats while the line must have moved, by the speed
before (which the winch's acceleration limit lets fall only so fast).

Payload lost: the mean of the measured tension over LOST_S is below the weight of the rope and half
the payload, and that below the predicted mean by more than a quarter of the payload: in a storm the
waves unload the rope as deeply, but in the prediction too.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import ndtri

from rope_twin.core.state import Floats, Ints
from rope_twin.errors import InputError

REPEATED_S = 1.0
MIN_REPEATS = 5  # samples: a slow sensor has not repeated after two
ORDINARY_S = 600.0  # repeats of the last ten minutes are ordinary
ORDINARY_FACTOR = 2.0
STARTING_S, STARTING_LIMIT_S = 60.0, 5.0  # until ordinary repeats are known
LOST_S = 2.0
MIN_MEANS = 8  # of the mean
MOVED = 3.0  # resolutions of the encoder
COARSE_M = 0.01  # resolution that an encoder has at least
SPEED_S = 0.5  # over which the speed before a repeat is taken


class RepeatedSample:
    """Length of the present run of equal samples of one sensor."""

    def __init__(self) -> None:
        self._value = math.nan
        self._since_s = self._now_s = 0.0
        self._count = 0
        self._ended: deque[tuple[float, float]] = deque()  # end and length of runs that ended
        self._begun_s = math.nan
        self._changed = False  # a sensor that has not begun to move is not stuck

    def take(self, time_s: float, value: float) -> None:
        """Take a sample; one that is not finite is missing."""
        if not math.isfinite(value):
            return
        if value == self._value:
            self._count += 1
        else:
            if self._count >= MIN_REPEATS:
                self._end(self._now_s)
            self._changed |= not math.isnan(self._value)
            self._value, self._since_s, self._count = value, time_s, 1
        if math.isnan(self._begun_s):
            self._begun_s = time_s
        self._now_s = time_s
        while self._ended and self._ended[0][0] < time_s - ORDINARY_S:
            self._ended.popleft()

    def _end(self, time_s: float) -> None:
        """Keep a run that ended; of a stuck sensor, or before it moved, it is no ordinary one."""
        if self._changed and not self.stuck:
            self._ended.append((time_s, time_s - self._since_s))

    @property
    def since_s(self) -> float:
        """Return the time of the first of the equal samples."""
        return self._since_s

    @property
    def length_s(self) -> float:
        """Return the time from the first to the last of the equal samples."""
        return self._now_s - self._since_s

    @property
    def limit_s(self) -> float:
        """Return the length from which on the sensor is stuck."""
        longest = max((length for _, length in self._ended), default=0.0)
        starting = self._since_s - self._begun_s < STARTING_S
        return max(STARTING_LIMIT_S if starting else REPEATED_S, ORDINARY_FACTOR * longest)

    @property
    def stuck(self) -> bool:
        """Return whether the sensor repeats its value for too long, after it had another one."""
        if not self._changed or self._count < MIN_REPEATS:
            return False
        return self.length_s >= self.limit_s - 1e-9


class StuckEncoder:
    """Line out that repeats while the line must have moved."""

    def __init__(self, acceleration_limit_m_per_s2: float, resolution_m: float) -> None:
        """Take the largest deceleration of the winch, and the resolution of the line out [m]."""
        self._limit = acceleration_limit_m_per_s2
        self._resolution_m = max(resolution_m, COARSE_M)
        self._repeat = RepeatedSample()
        self._recent: deque[tuple[float, float]] = deque()  # the last SPEED_S before the repeat
        self._speed = 0.0  # before the repeat [m/s]

    def take(self, time_s: float, line_out_m: float) -> None:
        """Take a sample; one that is not finite is missing."""
        if not math.isfinite(line_out_m):
            return
        recent = self._recent
        if recent and line_out_m != recent[-1][1]:
            recent.append((time_s, line_out_m))
            while recent[0][0] < time_s - SPEED_S and len(recent) > 2:
                recent.popleft()
            (first_s, first_m), (last_s, last_m) = recent[0], recent[-1]
            self._speed = (last_m - first_m) / (last_s - first_s) if last_s > first_s else 0.0
        elif not recent:
            recent.append((time_s, line_out_m))
        self._repeat.take(time_s, line_out_m)

    @property
    def since_s(self) -> float:
        """Return the time of the first of the equal samples."""
        return self._repeat.since_s

    @property
    def stuck(self) -> bool:
        """Return whether it repeats for REPEATED_S while the line moved by MOVED resolutions."""
        held_s = self._repeat.length_s
        if held_s < REPEATED_S - 1e-9:
            return False
        # at the end of those SPEED_S the line may have been slower than over them
        slower = 0.5 * self._limit * SPEED_S + self._resolution_m / SPEED_S
        speed, smallest_m = max(abs(self._speed) - slower, 0.0), MOVED * self._resolution_m
        stopping_s = speed / self._limit if self._limit > 0.0 else 0.0
        ran_s = min(held_s, stopping_s)
        ran_m = ran_s * (speed - 0.5 * self._limit * ran_s)
        return ran_m > smallest_m


class LostPayload:
    """Mean tension of the last seconds against the weight of the rope and half the payload."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float, float]] = deque()
        self._begun_s: float | None = None

    def take(
        self, time_s: float, measured_n: float, predicted_n: float, rope_n: float, payload_n: float
    ) -> float | None:
        """Take means of the same interval; return since when the payload is gone, or None.

        measured_n, predicted_n: NaN: missing; rope_n, payload_n: submerged weight of the rope that
        is out and of the payload [N].
        """
        if math.isfinite(measured_n) and math.isfinite(predicted_n):
            self._samples.append((time_s, measured_n, predicted_n))
        while self._samples and self._samples[0][0] <= time_s - LOST_S:
            self._samples.popleft()
        n = len(self._samples)
        if n < MIN_MEANS:
            return None
        measured = sum(sample[1] for sample in self._samples) / n
        predicted = sum(sample[2] for sample in self._samples) / n
        limit_n = rope_n + 0.5 * payload_n
        if measured < min(limit_n, predicted - 0.25 * payload_n):
            if self._begun_s is None:
                self._begun_s = self._first_below(limit_n)
            return self._begun_s
        self._begun_s = None
        return None

    def _first_below(self, limit_n: float) -> float:
        """Return the time of the oldest sample from which on all are below the limit."""
        begun_s = self._samples[-1][0]
        for time_s, measured_n, _ in reversed(self._samples):
            if measured_n >= limit_n:
                break
            begun_s = time_s
        return begun_s


ONSET_SAMPLES = 4  # between two onsets: 1 s
MIN_SAMPLES = 4  # of a signature before its ratio counts
MIN_POWER = 1e-3  # of a whitened signature of unit size: nothing is seen of it yet
NIS_SPANS = 8, 16, 32, 80, 240  # samples: 2, 4, 8, 20 and 60 s


@dataclass(frozen=True)
class Signature:
    """Change of the measured tension by a cause of unit size, from its onset on.

    Either a direction of the figures, whose columns of ∂ŷ/∂θ it is, or a drift of one load pin.
    """

    cause: str
    direction: Mapping[str, float] = field(default_factory=dict)
    ramp_n_per_s: float = 0.0
    pin: int = 0  # that drifts


@dataclass(frozen=True)
class SuspectedFault:
    """Most likely onset and size of one cause."""

    cause: str
    ratio: float  # ℓ
    onset_s: float
    size: float  # in units of its signature


class FaultTests:
    """Ratios of all causes and onsets since a reference, at which the figures were frozen."""

    def __init__(
        self,
        signatures: Sequence[Signature],
        autocovariance: Floats,
        white_n: float | Floats,
        covariance: Floats,
        names: Sequence[str],
        *,
        begin_s: float,
        interval_s: float,
    ) -> None:
        """Begin without samples.

        Args:
            signatures: one for each cause.
            autocovariance: of the coloured error of the tension at lags of interval_s, (lags,) or
                of pairs of load pins, (pins, pins, lags) [N²]; as many samples are possible since
                the reference.
            white_n: standard deviation of the white noise of a sample [N], one or (pins,).
            covariance: P of the figures at the reference, (figures, figures).
            names: of the figures, in the order of P.
            begin_s: time of the first sample.
            interval_s: of the samples.

        Raises:
            InputError: a signature names a figure that there is not, or gives nothing.
        """
        self.signatures = tuple(signatures)
        self._directions = np.array([_along(signature, names) for signature in signatures]).reshape(
            len(self.signatures), len(names)
        )
        self._ramps = np.array(
            [signature.ramp_n_per_s for signature in signatures], dtype=np.float64
        )
        self._ramping = np.array([signature.pin for signature in signatures], dtype=np.int64)
        self._white: Floats = np.atleast_1d(np.square(white_n))
        self.pins = len(self._white)
        self._colour = np.reshape(autocovariance, (self.pins, self.pins, -1))
        capacity, self._P = self.pins * self._colour.shape[2], covariance
        self.begin_s, self.interval_s = begin_s, interval_s
        self._numbers = 0  # of samples in time, missing ones too
        # of the samples that were taken:
        self.count = 0
        self._place: Ints = np.zeros(capacity, dtype=np.int64)  # number in time
        self._pin: Ints = np.zeros(capacity, dtype=np.int64)  # number of its load pin
        self._columns = np.zeros((capacity, len(names)))
        self._residual = np.zeros(capacity)
        self._whitened = np.zeros(capacity)
        self._inverse = np.zeros((capacity, capacity))  # L⁻¹
        # of each onset and cause:
        onsets = -(-self.capacity // ONSET_SAMPLES)
        self._onset: Ints = ONSET_SAMPLES * np.arange(onsets, dtype=np.int64)
        self._product = np.zeros((onsets, len(self.signatures)))
        self._power = np.zeros((onsets, len(self.signatures)))

    def __len__(self) -> int:
        """Return the number of samples in time since the reference, missing ones too."""
        return self._numbers

    @property
    def capacity(self) -> int:
        """Return the largest number of samples of a load pin."""
        return self._colour.shape[2]

    @property
    def now_s(self) -> float:
        """Return the end of the newest sample."""
        return self.begin_s + self.interval_s * self._numbers

    def extend(self, residual_n: Floats, columns: Floats) -> None:
        """Take new samples, and form the ratios with them.

        residual_n: (m,) or (m, pins), NaN: missing; columns: ∂ŷ/∂θ of each figure, of their shape
        with (figures,) behind it. Samples whose columns are not finite are missing too.

        Raises:
            InputError: more samples than the capacity, or S is not positive definite.
        """
        first, total = self._numbers, self._numbers + len(residual_n)
        if total > self.capacity:
            problem = f"{total} samples do not fit into {self.capacity}"
            raise InputError("fault tests", problem, "restart them with a new reference")
        self._numbers = total
        times = np.repeat(np.arange(first, total), self.pins)
        pins = np.tile(np.arange(self.pins), total - first)
        residual_n, columns = residual_n.ravel(), columns.reshape(len(times), -1)
        good = np.isfinite(residual_n) & np.isfinite(columns).all(axis=1)
        if not good.any():
            return
        n = self.count
        new = slice(n, n + int(good.sum()))
        self._place[new], self._pin[new] = times[good], pins[good]
        self._columns[new], self._residual[new] = columns[good], residual_n[good]
        rows = self._extend_inverse(new)
        self.count = new.stop
        self._whitened[new] = rows @ self._residual[: new.stop]
        signatures = self._whitened_signatures(rows)
        begun = slice(signatures.shape[1])
        self._product[begun] += np.einsum("moc,m->oc", signatures, self._whitened[new])
        self._power[begun] += np.einsum("moc,moc->oc", signatures, signatures)

    def _extend_inverse(self, new: slice) -> Floats:
        """Add the rows of new samples to L⁻¹, and return them, (m, count + m)."""
        n, place, pin, J = new.start, self._place[new], self._pin[new], self._columns[new]
        inverse = self._inverse[:n, :n]
        JP = J @ self._P
        lag = np.abs(place[:, None] - self._place[:n])
        cross = self._colour[pin[:, None], self._pin[:n], lag] + JP @ self._columns[:n].T
        of_new = self._colour[pin[:, None], pin, np.abs(place[:, None] - place)] + JP @ J.T
        link = cross @ inverse.T
        try:
            factor = np.linalg.cholesky(of_new + np.diag(self._white[pin]) - link @ link.T)
        except np.linalg.LinAlgError as error:
            problem = "the covariance of the innovations is not positive definite"
            right = "give a positive noise of the load pin"
            raise InputError("fault tests", problem, right) from error
        own_inverse = np.linalg.inv(factor)
        self._inverse[new, :n] = -own_inverse @ (link @ inverse)
        self._inverse[new, new] = own_inverse
        return self._inverse[new, : new.stop]

    def _whitened_signatures(self, rows: Floats) -> Floats:
        """Return rows of L⁻¹s for each onset so far and each cause, (m, onsets, causes).

        rows: of L⁻¹, (m, count).
        """
        place = self._place[: self.count]
        onset = self._onset[: -(-self._numbers // ONSET_SAMPLES)]
        begin = np.searchsorted(place, onset)
        changes = self._columns[: self.count] @ self._directions.T
        seconds = self.interval_s * (place + 0.5)
        drifts = np.where(self._pin[: self.count, None] == self._ramping, self._ramps, 0.0)
        changes += seconds[:, None] * drifts
        sums = _sums_from_each_on(rows[:, :, None] * changes)[:, begin]
        if self._ramps.any():  # a drift begins at its onset, not at the reference
            ones = _sums_from_each_on(rows[:, :, None] * drifts)[:, begin]
            sums -= ones * (self.interval_s * onset)[:, None]
        return sums

    def ratios(self) -> Floats:
        """Return ℓ of each onset and cause, (onsets, causes); 0: too little was seen."""
        ready = self._power > MIN_POWER
        samples = self.count - np.searchsorted(self._place[: self.count], self._onset)
        ready &= (samples >= MIN_SAMPLES * self._measured_pins)[:, None]
        ratio = np.zeros_like(self._power)
        np.divide(self._product**2, self._power, out=ratio, where=ready)
        return ratio

    def suspicions(self) -> list[SuspectedFault]:
        """Return each cause with its most likely onset, the most likely cause first."""
        ratio, suspicions = self.ratios(), []
        for cause, signature in enumerate(self.signatures):
            onset = int(ratio[:, cause].argmax()) if len(ratio) else 0
            if ratio[onset, cause] <= 0.0:
                continue
            onset_s = self.begin_s + self.interval_s * float(self._onset[onset])
            size = float(self._product[onset, cause] / self._power[onset, cause])
            suspicions.append(
                SuspectedFault(signature.cause, float(ratio[onset, cause]), onset_s, size)
            )
        return sorted(suspicions, key=lambda suspicion: -suspicion.ratio)

    def detectable(self, onset_s: float, threshold: float, share: float) -> Floats:
        """Return the size that a cause must have to be found by now with a probability, (causes,).

        In units of its signature, which begins at an onset [s]; inf: nothing is seen of it. A cause
        of size a has ℓ = (a·√(sᵀS⁻¹s) + N(0, 1))², so that √ℓ reaches √threshold with the
        probability `share` where a·√(sᵀS⁻¹s) = √threshold + Φ⁻¹(share) (the minimal detectable bias
        of Baarda 1968).
        """
        seconds = self.interval_s * self._onset
        onset = int(np.abs(self.begin_s + seconds - onset_s).argmin())
        power = self._power[onset]
        needed = math.sqrt(threshold) + float(ndtri(share))
        size = np.full(len(power), np.inf)
        np.divide(needed, np.sqrt(power), out=size, where=power > 0.0)
        return size

    def fit(self, change_n: Floats) -> tuple[Floats, Floats]:
        """Return sᵀS⁻¹e and sᵀS⁻¹s of changes of the tension, (h,) each.

        change_n: at all samples since the reference, missing ones too, (samples, h) or (samples,
        pins, h).
        """
        by_sample = change_n.reshape(-1, self.pins, change_n.shape[-1])
        measured = by_sample[self._place[: self.count], self._pin[: self.count]]
        whitened = self._inverse[: self.count, : self.count] @ measured
        return whitened.T @ self._whitened[: self.count], (whitened**2).sum(axis=0)

    def nis(self) -> float:
        """Return the largest NIS of the last spans, in standard deviations of χ² above its mean."""
        e, n = self.whitened, self.count
        return max(
            (
                (float(e[n - k :] @ e[n - k :]) - k) / math.sqrt(2.0 * k)
                for k in (self._measured_pins * span for span in NIS_SPANS)
                if k <= n
            ),
            default=0.0,
        )

    @property
    def _measured_pins(self) -> int:
        """Return the number of load pins with samples."""
        return max(1, len(np.unique(self._pin[: self.count])))

    @property
    def whitened(self) -> Floats:
        """Return the whitened innovations, (samples taken,); N(0, 1) each without a fault."""
        return self._whitened[: self.count].copy()


def _along(signature: Signature, names: Sequence[str]) -> Floats:
    """Return the direction of a signature in the order of the names of the figures."""
    if bool(signature.direction) == bool(signature.ramp_n_per_s):
        raise InputError(
            signature.cause, "it has no signature, or two", "give a direction or a ramp"
        )
    row = np.zeros(len(names))
    for name, value in signature.direction.items():
        if name not in names:
            right = f"known: {', '.join(names)}"
            raise InputError(signature.cause, f"there is no figure '{name}'", right)
        row[names.index(name)] = value
    return row


def _sums_from_each_on(values: Floats) -> Floats:
    """Return the sums along axis 1 from each element to the last, and 0 behind it."""
    sums = np.zeros((values.shape[0], values.shape[1] + 1, values.shape[2]))
    sums[:, :-1] = np.cumsum(values[:, ::-1], axis=1)[:, ::-1]
    return sums
